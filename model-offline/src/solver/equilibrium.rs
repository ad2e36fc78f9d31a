//! Static equilibrium under prescribed nodal values: Newton's method on the total Lagrangian weak form, with line search on
//! the energy and adaptive cutback of the increment.
//!
//! Loading is by prescribed displacement and dead loads, so an equilibrium is a stationary point of the potential energy over the
//! coefficients that satisfy `Λ d = g`, and a *stable* one is a minimum. That is what is looked for: a state whose
//! tangent is not positive definite is reported as lost stability, never passed off as an answer.
//!
//! Every converged state has a Cholesky factor, which proves that it is stable. On the way to the next state that factor is
//! the preconditioner of conjugate gradients: tangents change little from one increment to the next, so that a few
//! iterations, each the price of a back-substitution, replace a factorisation. Negative curvature on the way, or too many
//! iterations, bring the factorisation back.

use super::analysis::Analysis;
use super::conjugate_gradients::dot;
use super::constrained::{Accuracy, ConstrainedSolver, Unknowns};
use crate::discretization::Quadrature;
use crate::geometry::Point;
use crate::mechanics::Tissue;
use crate::mechanics::assembly::{self, BlockPositions, Inverted, State};
use crate::mechanics::{Constraints, WeaklyImposed};
use serde::Serialize;
use std::sync::Arc;

/// From this many nodes on, conjugate gradients with the last factor cost less than a factor per Newton iteration.
const ITERATION_PAYS: usize = 500;
/// Error of the linear solves by iteration, over their solution: no more, less where Newton's method is near its end, and
/// never beyond rounding. Newton's method then takes the iterations that it takes with a factor.
const LOOSEST: f64 = 1e-3;
const TIGHTEST: f64 = 1e-9;
/// Relative residual of the last Newton step times this is the error of the next linear solve.
const FORCING: f64 = 0.01;

/// Violation of the prescribed values, over the spacing, within which they are met.
const FEASIBLE: f64 = 1e-10;

/// How the linear systems of Newton's method are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LinearSolver {
    /// By iteration where there are nodes enough for it to pay, else directly.
    #[default]
    BySize,
    /// By a factor for every tangent.
    Direct,
    /// By conjugate gradients with the last factor as preconditioner; a tangent that is not positive definite, or far from
    /// the last, gets a factor of its own, and so does every converged state.
    Iterative,
}

/// Settings of Newton's method. The defaults are meant for everyone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NewtonSettings {
    /// Residual force over reaction force at convergence.
    pub residual_tolerance: f64,
    /// Last Newton step over the model's node spacing at convergence.
    pub step_tolerance: f64,
    /// Iterations per increment before it is cut.
    pub max_iterations: u32,
    /// How often an increment may be halved before the solver gives up.
    pub max_cutbacks: u32,
    /// Whether steps that raise the energy are shortened.
    pub line_search: bool,
    /// Whether a converged state with an indefinite tangent ends the run.
    pub require_stability: bool,
    /// Keep the last factor while each iteration still gains a factor of four: cheap for small steps. Stability is then
    /// checked whenever the body has moved by a twentieth of the spacing since it was last.
    pub reuse_tangent: bool,
    /// How the linear systems are solved.
    pub linear_solver: LinearSolver,
}

impl Default for NewtonSettings {
    fn default() -> Self {
        Self {
            residual_tolerance: 1e-9,
            step_tolerance: 1e-8,
            max_iterations: 25,
            max_cutbacks: 8,
            line_search: true,
            require_stability: true,
            reuse_tangent: false,
            linear_solver: LinearSolver::BySize,
        }
    }
}

/// Why no equilibrium was found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, thiserror::Error)]
#[serde(rename_all = "kebab-case")]
pub enum FailureReason {
    /// det F ≤ 0 at an integration point.
    #[error("element-inverted")]
    ElementInverted,
    /// The material law has no finite stress at an integration point: an exponential overflowed.
    #[error("law-overflow")]
    LawOverflow,
    /// The equilibrium is not stable: its tangent is not positive definite.
    #[error("lost-stability")]
    LostStability,
    /// The tangent at rest is singular: too little of the boundary is constrained, or the rule has zero-energy modes.
    #[error("singular-tangent")]
    SingularTangent,
    /// Newton's method did not converge.
    #[error("not-converged")]
    NotConverged,
}

/// A failed solve; the equilibrium is left at the last converged state.
#[derive(Debug, Clone, PartialEq, Serialize, thiserror::Error)]
#[error("{reason}: {detail}")]
pub struct Failure {
    /// What happened.
    pub reason: FailureReason,
    /// Fraction of the way from the last state to the prescribed one that was reached.
    pub reached: f64,
    /// Numbers behind the reason.
    pub detail: String,
}

/// What a successful solve cost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Effort {
    /// Newton iterations (tangent solves).
    pub iterations: u32,
    /// Factorisations.
    pub factorisations: u32,
    /// Iterations of conjugate gradients within them.
    pub conjugate_gradients: u32,
    /// Times the increment was halved.
    pub cutbacks: u32,
}

/// What a body is made of once it is discretized.
#[derive(Debug, Clone)]
pub struct DiscreteBody<'a, const D: usize> {
    /// Integration rule.
    pub rule: Arc<Quadrature<D>>,
    /// Materials by cell.
    pub tissue: Tissue,
    /// Positions of the nodes at rest, length units.
    pub positions: &'a [Point<D>],
    /// A typical node spacing: the length that step tolerances are relative to.
    pub spacing: f64,
}

/// A body in equilibrium, and the means to take it to the next.
#[derive(Debug, Clone)]
pub struct Equilibrium<const D: usize> {
    rule: Arc<Quadrature<D>>,
    tissue: Tissue,
    blocks: Arc<BlockPositions>,
    solver: ConstrainedSolver<D>,
    weak: Option<Arc<dyn WeaklyImposed>>,
    settings: NewtonSettings,
    /// Length that step tolerances are relative to.
    spacing: f64,
    /// Force that moves a node by a thousandth of the spacing: what residuals are relative to at rest.
    smallest_force: f64,
    at: Configuration<D>,
    /// Whether the factor belongs to the current state.
    factor_is_current: bool,
    factor_exists: bool,
    /// Coefficients where the tangent was last found positive definite.
    stable_at: Vec<f64>,
    residuals: Vec<f64>,
    effort: Effort,
}

/// Everything that a failed increment must give back.
#[derive(Debug, Clone)]
struct Configuration<const D: usize> {
    coefficients: Vec<f64>,
    multipliers: Vec<f64>,
    /// Values of the constrained rows, then those of the weakly imposed points.
    prescribed: Vec<f64>,
    /// Dead load, D numbers per node.
    external: Vec<f64>,
    /// Gradient of the potential energy.
    force: Vec<f64>,
    energy: f64,
    state: State<D>,
}

/// A step of Newton's method and what it is computed from.
struct Step {
    step: Vec<f64>,
    /// Multipliers before the step, then after it.
    multipliers: Vec<f64>,
    rhs: Vec<f64>,
    gap: Vec<f64>,
    /// Whether the prescribed values are met already.
    feasible: bool,
    /// Whether the tangent was not positive definite.
    indefinite: bool,
}

enum Attempt {
    Converged,
    Failed(FailureReason, String),
}

impl<const D: usize> Equilibrium<D> {
    /// A body at rest, of which `constraints` will be prescribed.
    ///
    /// # Errors
    /// [`Failure`] with [`FailureReason::SingularTangent`] when the tangent at rest is not positive definite.
    pub fn at_rest(
        body: DiscreteBody<'_, D>,
        constraints: impl Into<Constraints>,
        settings: NewtonSettings,
    ) -> Result<Self, Failure> {
        let constraints = constraints.into();
        let weak_lists = constraints.weak.as_ref().map_or_else(Vec::new, |w| w.node_lists());
        let lists = constraints.rows.node_lists().chain(weak_lists.iter().copied());
        let analysis = Analysis::new(&body.rule, body.positions, lists);
        Self::analysed(body, &analysis, constraints, settings)
    }

    /// The same for a rule and nodes that were analysed before, with at least these constraints.
    ///
    /// # Errors
    /// [`Failure`] with [`FailureReason::SingularTangent`] when the tangent at rest is not positive definite.
    ///
    /// # Panics
    /// When the analysis does not cover the constraints.
    pub fn analysed(
        body: DiscreteBody<'_, D>,
        analysis: &Analysis,
        constraints: Constraints,
        settings: NewtonSettings,
    ) -> Result<Self, Failure> {
        let DiscreteBody { rule, tissue, positions, spacing } = body;
        let Constraints { rows, weak } = constraints;
        let nodes = positions.len();
        let at = Configuration {
            coefficients: vec![0.0; nodes * D],
            multipliers: vec![0.0; rows.len() * D],
            prescribed: vec![0.0; rows.len() * D + weak.as_ref().map_or(0, |w| w.prescribed())],
            external: vec![0.0; nodes * D],
            force: vec![0.0; nodes * D],
            energy: 0.0,
            state: State::default(),
        };
        let mut body = Self {
            rule,
            tissue,
            blocks: Arc::clone(&analysis.blocks),
            solver: ConstrainedSolver::new(analysis, rows),
            weak,
            settings,
            spacing,
            smallest_force: f64::MIN_POSITIVE,
            at,
            factor_is_current: false,
            factor_exists: false,
            stable_at: Vec::new(),
            residuals: Vec::new(),
            effort: Effort::default(),
        };
        body.evaluate().map_err(|at| body.failure(reason_of(&at), 0.0, "at rest".into()))?;
        if !body.refactorise() {
            return Err(body.failure(
                FailureReason::SingularTangent,
                0.0,
                "the tangent at rest is not positive definite: hold more of the boundary, or use a rule without zero-energy modes".into(),
            ));
        }
        body.smallest_force = 1e-3 * spacing * body.solver.rest_stiffness();
        Ok(body)
    }

    /// Changes the settings for the solves to come.
    pub fn set_settings(&mut self, settings: NewtonSettings) {
        self.settings = settings;
    }

    /// Nodal coefficients d, D numbers per node.
    pub fn coefficients(&self) -> &[f64] {
        &self.at.coefficients
    }

    /// Forces that hold the constrained nodes, D numbers per row: −μ.
    pub fn reactions(&self) -> impl Iterator<Item = f64> + '_ {
        self.at.multipliers.iter().map(|m| -m)
    }

    /// Strain energy.
    pub fn energy(&self) -> f64 {
        self.at.energy
    }

    /// Displacement gradients at the integration points.
    pub fn state(&self) -> &State<D> {
        &self.at.state
    }

    /// The integration rule.
    pub fn rule(&self) -> &Arc<Quadrature<D>> {
        &self.rule
    }

    /// The tissue.
    pub fn tissue(&self) -> &Tissue {
        &self.tissue
    }

    /// Relative residuals of the last solve, iteration by iteration.
    pub fn residual_history(&self) -> &[f64] {
        &self.residuals
    }

    /// Work done since the body was made.
    pub fn effort(&self) -> Effort {
        self.effort
    }

    /// Entries of the Cholesky factor.
    pub fn factor_entries(&self) -> usize {
        self.solver.factor_entries()
    }

    /// Takes the prescribed values from where they are to `prescribed` (D numbers per row, then those of the weakly imposed
    /// points), cutting the way into pieces where it must.
    ///
    /// # Errors
    /// [`Failure`] with the reason; the body is then at the last state that converged on the way.
    pub fn drive(&mut self, prescribed: &[f64]) -> Result<(), Failure> {
        let external = self.at.external.clone();
        self.drive_loaded(prescribed, &external)
    }

    /// Takes prescribed values and dead load (D numbers per node) together to what is given.
    ///
    /// # Errors
    /// [`Failure`] with the reason; the body is then at the last state that converged on the way.
    pub fn drive_loaded(&mut self, prescribed: &[f64], external: &[f64]) -> Result<(), Failure> {
        let (start, start_load) = (self.at.prescribed.clone(), self.at.external.clone());
        let between = |a: &[f64], b: &[f64], t: f64| -> Vec<f64> {
            // The end itself, not the end up to rounding.
            if t >= 1.0 { b.to_vec() } else { a.iter().zip(b).map(|(a, b)| a + (b - a) * t).collect() }
        };
        let (mut reached, mut step) = (0.0_f64, 1.0_f64);
        let mut cuts = 0;
        while reached < 1.0 {
            let next = (reached + step).min(1.0);
            let last = self.at.clone();
            self.at.prescribed = between(&start, prescribed, next);
            self.at.external = between(&start_load, external, next);
            match self.attempt() {
                Attempt::Converged => {
                    reached = next;
                    // Grow back after success, so that one hard spot does not slow down the rest.
                    step *= 2.0;
                }
                Attempt::Failed(reason, detail) => {
                    self.at = last;
                    self.factor_is_current = false;
                    if cuts >= self.settings.max_cutbacks {
                        return Err(self.failure(reason, reached, detail));
                    }
                    cuts += 1;
                    self.effort.cutbacks += 1;
                    step = 0.5 * (next - reached);
                }
            }
        }
        Ok(())
    }

    /// Response of the coefficients to unit rates of the prescribed values at the current state: solves
    /// `K x + Λᵀ μ = 0, Λ x = rates`. This is the exact linearisation of the equilibrium.
    ///
    /// # Errors
    /// [`Failure`] when the tangent at the current state is not positive definite.
    pub fn sensitivity(&mut self, rates: &[f64]) -> Result<Vec<f64>, Failure> {
        if !self.factor_is_current && !self.refactorise() {
            return Err(self.failure(FailureReason::LostStability, 1.0, "tangent not positive definite".into()));
        }
        let n = self.at.coefficients.len();
        let (strong, weak) = rates.split_at(self.at.multipliers.len());
        let (mut x, mut mu, mut rhs) = (vec![0.0; n], vec![0.0; strong.len()], vec![0.0; n]);
        if let Some(imposed) = &self.weak {
            imposed.add_response(&self.tissue, &self.at.coefficients, weak, &mut rhs);
        }
        self.solver.solve(&rhs, strong, 1e-14, Unknowns { x: &mut x, multipliers: &mut mu });
        Ok(x)
    }

    fn failure(&self, reason: FailureReason, reached: f64, detail: String) -> Failure {
        Failure { reason, reached, detail }
    }

    /// Potential energy and its gradient at the current coefficients.
    fn evaluate(&mut self) -> Result<(), Inverted> {
        let at = &mut self.at;
        at.energy = assembly::internal_force(&self.rule, &self.tissue, &at.coefficients, &mut at.state, &mut at.force)?;
        if let Some(weak) = &self.weak {
            let values = &at.prescribed[at.multipliers.len()..];
            at.energy += weak.add_force(&self.tissue, &at.coefficients, values, &mut at.force);
        }
        for ((f, load), d) in at.force.iter_mut().zip(&at.external).zip(&at.coefficients) {
            *f -= load;
            at.energy -= load * d;
        }
        Ok(())
    }

    /// Assembles the tangent at the current state.
    fn assemble(&mut self) {
        let (rule, tissue, at, blocks, weak) = (&self.rule, &self.tissue, &self.at, &self.blocks, &self.weak);
        self.solver.assemble(|pattern, values| {
            assembly::tangent(rule, tissue, &at.state, blocks, values);
            if let Some(weak) = weak {
                weak.add_tangent(tissue, (&at.coefficients, &at.prescribed[at.multipliers.len()..]), pattern, values);
            }
        });
    }

    /// Assembles and factorises the tangent at the current state; false when it is not positive definite.
    fn refactorise(&mut self) -> bool {
        self.assemble();
        self.factorise()
    }

    fn factorise(&mut self) -> bool {
        self.effort.factorisations += 1;
        self.factor_is_current = self.solver.factorise().is_ok();
        // A failed factorisation has overwritten the last factor.
        self.factor_exists = self.factor_is_current;
        if self.factor_is_current {
            self.stable_at.clone_from(&self.at.coefficients);
        }
        self.factor_is_current
    }

    /// Whether the body has moved far enough since its tangent was last found positive definite for that to have changed.
    fn stability_is_uncertain(&self) -> bool {
        let moved = |(a, b): (&f64, &f64)| (a - b).abs() > STABILITY_REACH * self.spacing;
        self.at.coefficients.iter().zip(&self.stable_at).any(moved)
    }

    /// Whether a new tangent is first tried by conjugate gradients with the last factor.
    fn iterates(&self) -> bool {
        let pays = match self.settings.linear_solver {
            LinearSolver::BySize => self.at.coefficients.len() >= ITERATION_PAYS * D,
            LinearSolver::Direct => false,
            LinearSolver::Iterative => true,
        };
        pays && self.factor_exists
            && !self.factor_is_current
            && !self.settings.reuse_tangent
            && !self.tissue.is_linear()
    }

    /// Newton's step at the current state and the multipliers after it; `residual` is the relative one that the last step
    /// left.
    fn newton_step(&mut self, usable: bool, residual: f64, step: &mut Step) -> Result<(), Attempt> {
        let Step { rhs, gap, .. } = step;
        self.solver.constrained().apply::<D>(&self.at.coefficients, gap);
        for (g, p) in gap.iter_mut().zip(&self.at.prescribed) {
            *g = p - *g;
        }
        for (r, f) in rhs.iter_mut().zip(&self.at.force) {
            *r = -f;
        }
        step.feasible = step.gap.iter().all(|g| g.abs() <= FEASIBLE * self.spacing);
        self.effort.iterations += 1;
        if !usable {
            let iterates = self.iterates();
            self.assemble();
            if iterates && self.step_by_iteration(residual, step) {
                return Ok(());
            }
            step.indefinite = !self.factorise();
            if step.indefinite && !self.refactorise_shifted() {
                let detail = "tangent indefinite, no shift helps".into();
                return Err(Attempt::Failed(FailureReason::LostStability, detail));
            }
        }
        let unknowns = Unknowns { x: &mut step.step, multipliers: &mut step.multipliers };
        self.solver.solve(&step.rhs, &step.gap, 1e-13 * self.spacing, unknowns);
        Ok(())
    }

    /// The step by conjugate gradients; false, with nothing changed, when the tangent needs a factor of its own.
    fn step_by_iteration(&mut self, residual: f64, step: &mut Step) -> bool {
        let accuracy = Accuracy {
            relative: (FORCING * residual).clamp(TIGHTEST, LOOSEST),
            violation: 0.1 * FEASIBLE * self.spacing,
        };
        let before = step.multipliers.clone();
        let unknowns = Unknowns { x: &mut step.step, multipliers: &mut step.multipliers };
        match self.solver.solve_by_iteration(&step.rhs, &step.gap, accuracy, unknowns) {
            Ok(iterations) => {
                self.effort.conjugate_gradients += iterations;
                true
            }
            Err(_) => {
                step.multipliers = before;
                false
            }
        }
    }

    /// A factor to step with when the tangent is indefinite: shifted until it is positive definite, so that the step
    /// still goes downhill.
    fn refactorise_shifted(&mut self) -> bool {
        let mut shift = 1e-4 * self.solver.rest_stiffness();
        for _ in 0..12 {
            self.effort.factorisations += 1;
            if self.solver.factorise_shifted(shift).is_ok() {
                return true;
            }
            shift *= 4.0;
        }
        false
    }

    /// Newton's method towards the prescribed values and the load.
    fn attempt(&mut self) -> Attempt {
        let n = self.at.coefficients.len();
        if let Some(adapted) = self.weak.as_ref().and_then(|weak| weak.adapted(&self.tissue, &self.at.coefficients)) {
            self.weak = Some(adapted);
            self.factor_is_current = false;
        }
        // Load and weakly imposed values are part of the energy, which has changed with them.
        let loaded = self.weak.is_some() || self.at.external.iter().any(|f| *f != 0.0);
        if loaded && let Err(at) = self.evaluate() {
            return Attempt::Failed(reason_of(&at), "before the first step".into());
        }
        let rows = self.at.multipliers.len();
        let mut step = Step {
            step: vec![0.0; n],
            multipliers: self.at.multipliers.clone(),
            rhs: vec![0.0; n],
            gap: vec![0.0; rows],
            feasible: false,
            indefinite: false,
        };
        let may_reuse = self.settings.reuse_tangent || self.tissue.is_linear();
        let mut factor_usable = self.factor_is_current || (may_reuse && self.factor_exists);
        let mut last_residual = f64::INFINITY;
        self.residuals.clear();
        for iteration in 0..self.settings.max_iterations {
            if let Err(failed) = self.newton_step(factor_usable, last_residual, &mut step) {
                return failed;
            }
            let slope = dot(&step.step, &self.at.force);
            match self.search(&step.step, step.feasible.then_some(slope)) {
                Ok(()) => {}
                Err((reason, detail)) => return Attempt::Failed(reason, detail),
            }
            self.factor_is_current = false;
            let largest = step.step.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            if !largest.is_finite() {
                return Attempt::Failed(FailureReason::NotConverged, "step is not a number".into());
            }
            let residual = self.relative_residual(&step.multipliers);
            self.residuals.push(residual);
            let linear = self.tissue.is_linear();
            if residual <= self.settings.residual_tolerance
                && (linear || largest <= self.settings.step_tolerance * self.spacing || residual <= 1e-12)
            {
                self.at.multipliers.copy_from_slice(&step.multipliers);
                if linear {
                    self.factor_is_current = true;
                    return Attempt::Converged;
                }
                if self.settings.reuse_tangent && !step.indefinite && !self.stability_is_uncertain() {
                    return Attempt::Converged;
                }
                if self.settings.require_stability && !self.refactorise() {
                    return Attempt::Failed(
                        FailureReason::LostStability,
                        "the equilibrium found is not a minimum of the energy".into(),
                    );
                }
                return Attempt::Converged;
            }
            if iteration + 1 == self.settings.max_iterations {
                let detail = format!("residual {residual:.1e} after {} iterations", iteration + 1);
                return Attempt::Failed(FailureReason::NotConverged, detail);
            }
            factor_usable = linear || (may_reuse && !step.indefinite && residual < 0.25 * last_residual);
            last_residual = residual;
        }
        Attempt::Failed(FailureReason::NotConverged, "no iterations allowed".into())
    }

    /// Takes the step, shortened until the configuration is admissible and (when the prescribed values are already met and
    /// `slope` is given) the energy has decreased enough (Armijo). Where the decrease drowns in the rounding of the
    /// energy, as in the small steps of a simulation, the slope decides instead: the approximate Wolfe condition of
    /// Hager and Zhang (SIAM J. Optim. 16, 2005, equation 4.1).
    fn search(&mut self, step: &[f64], slope: Option<f64>) -> Result<(), (FailureReason, String)> {
        const SUFFICIENT: f64 = 1e-4;
        // Share of the energy within which two energies are the same for the approximate condition: Hager and Zhang
        // take 1e-6; rounding at strains of 1e-6 needs 1e-10.
        const ROUNDING: f64 = 1e-9;
        let start = self.at.coefficients.clone();
        let energy = self.at.energy;
        // Differences of energies below this are rounding.
        let noise = 1e-12 * (energy.abs() + self.smallest_force * self.spacing);
        let mut length = 1.0;
        let shortest = if self.settings.line_search && slope.is_some() { 1.0 / 256.0 } else { 1.0 };
        loop {
            for ((d, s), x) in self.at.coefficients.iter_mut().zip(&start).zip(step) {
                *d = s + length * x;
            }
            let outcome = self.evaluate();
            let decreased = match (&outcome, slope) {
                (Ok(()), Some(slope)) if self.settings.line_search => {
                    self.at.energy <= energy + SUFFICIENT * length * slope + noise
                        || (self.at.energy <= energy + ROUNDING * energy.abs() + noise
                            && dot(step, &self.at.force) <= (2.0 * SUFFICIENT - 1.0) * slope)
                }
                (Ok(()), _) => true,
                (Err(_), _) => false,
            };
            if decreased {
                return Ok(());
            }
            length *= 0.5;
            if length < shortest {
                return Err(match outcome {
                    Err(at) => (reason_of(&at), at.to_string()),
                    Ok(()) => {
                        (FailureReason::NotConverged, "no step along Newton's direction lowers the energy".into())
                    }
                });
            }
        }
    }

    /// ‖f + Λᵀ μ‖ over the largest of ‖Λᵀ μ‖, the load, and (near rest) the force of a negligible displacement.
    fn relative_residual(&self, mu: &[f64]) -> f64 {
        let mut reaction = vec![0.0; self.at.force.len()];
        self.solver.constrained().add_transpose::<D>(mu, &mut reaction);
        let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
        let residual = norm(&mut reaction.iter().zip(&self.at.force).map(|(r, f)| r + f));
        let holding = norm(&mut reaction.iter().copied());
        let load = norm(&mut self.at.external.iter().copied());
        residual / holding.max(load).max(self.smallest_force)
    }
}

/// Share of the spacing by which a body moves before its stability is checked again: strains of a few per cent, after
/// which no law here has lost what it had.
const STABILITY_REACH: f64 = 0.05;

fn reason_of(at: &Inverted) -> FailureReason {
    if at.law_overflowed() { FailureReason::LawOverflow } else { FailureReason::ElementInverted }
}
