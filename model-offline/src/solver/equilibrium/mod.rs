//! Static equilibrium under prescribed nodal values: Newton's method on the total Lagrangian weak form, with line search on
//! the energy and adaptive cutback of the increment.
//!
//! Loading is by prescribed displacement and dead loads, so an equilibrium is a stationary point of the potential energy over the
//! coefficients that satisfy `Λ d = g`, and a *stable* one is a minimum. That is what is looked for: a state whose
//! tangent is not positive definite is reported as lost stability, never passed off as an answer.
//!
//! A Cholesky factor proves that a state is stable. On the way to the next state that factor is the preconditioner of
//! conjugate gradients: tangents change little from one increment to the next, so that a few iterations, each the price of a
//! back-substitution, replace a factorisation. Negative curvature on the way, or too many iterations, bring the factorisation
//! back. In large models it proves that the next state is stable, too, as long as [refinement](crate::linalg::mixed) with it converges.

mod newton;
mod settings;

pub use settings::{Effort, Failure, FailureReason, LinearSolver, NewtonSettings};

use self::newton::Attempt;
use super::analysis::Analysis;
use super::conjugate_gradients::dot;
use super::constrained::{ConstrainedSolver, Unknowns};
use crate::discretization::Quadrature;
use crate::geometry::Point;
use crate::linalg::{NotEnoughMemory, Unfactorised};
use crate::mechanics::Tissue;
use crate::mechanics::assembly::{self, AssemblyState, Inverted, Medium};
use crate::mechanics::blocks::BlockPositions;
use crate::mechanics::history::{History, Prestress};
use crate::mechanics::stabilisation::Stabilisation;
use crate::mechanics::{Constraints, WeaklyImposed};
use std::sync::Arc;

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

/// Rounding of a cell's strain energy over its volume and shear modulus: a dozen operations in every one; of all cells together 16
/// epsilons were seen.
const ENERGY_ROUNDING: f64 = 64.0 * f64::EPSILON;

/// A body in equilibrium, and the means to take it to the next.
#[derive(Debug, Clone)]
pub struct Equilibrium<const D: usize> {
    rule: Arc<Quadrature<D>>,
    tissue: Tissue,
    stabilisation: Stabilisation,
    blocks: Arc<BlockPositions>,
    solver: ConstrainedSolver<D>,
    weak: Option<Arc<dyn WeaklyImposed>>,
    settings: NewtonSettings,
    /// What the past has left in tissue that relaxes, and what it is at the end of the present step.
    history: Option<Box<History<D>>>,
    prestress: Prestress<D>,
    /// Length of the present step, s.
    elapsed: f64,
    /// Whether the energy has changed since it was last evaluated, because a step has begun.
    time_passed: bool,
    /// Length that step tolerances are relative to.
    spacing: f64,
    /// Force that moves a node by a thousandth of the spacing: what residuals are relative to at rest.
    smallest_force: f64,
    /// What rounding leaves of the strain energies, which are differences of numbers as large as the stiffness: in tissue with
    /// a part a million times as stiff, far more than an epsilon of their sum.
    energy_rounding: f64,
    at: Configuration<D>,
    /// Whether the factor belongs to the current state.
    factor_is_current: bool,
    factor_exists: bool,
    /// What the last indefinite tangent needed on its diagonal to become positive definite.
    shift: f64,
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
    state: AssemblyState<D>,
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
            state: AssemblyState::default(),
        };
        let history = History::at_rest(&rule, &tissue, |tissue| analysis.stabilisation(&rule, tissue), nodes * D);
        let mut body = Self {
            stabilisation: analysis.stabilisation(&rule, &tissue),
            history: history.map(Box::new),
            prestress: Prestress::default(),
            elapsed: 0.0,
            time_passed: false,
            rule,
            tissue,
            blocks: Arc::clone(&analysis.blocks),
            solver: match settings.linear_solver {
                LinearSolver::Direct => ConstrainedSolver::in_double_precision(analysis, rows)?,
                LinearSolver::BySize | LinearSolver::Iterative => ConstrainedSolver::new(analysis, rows)?,
            },
            weak,
            settings,
            spacing,
            smallest_force: f64::MIN_POSITIVE,
            energy_rounding: 0.0,
            at,
            factor_is_current: false,
            factor_exists: false,
            shift: 0.0,
            stable_at: Vec::new(),
            residuals: Vec::new(),
            effort: Effort::default(),
        };
        body.evaluate().map_err(|at| body.failure(reason_of(&at), 0.0, "at rest".into()))?;
        if !body.refactorise()? {
            return Err(body.failure(
                FailureReason::SingularTangent,
                0.0,
                "the tangent at rest is not positive definite: hold more of the boundary, or use a rule without zero-energy modes".into(),
            ));
        }
        body.smallest_force = 1e-3 * spacing * body.solver.rest_stiffness();
        let stiffnesses = body.rule.points().map(|p| p.weight * body.tissue.rest_shear_modulus(p.cell));
        body.energy_rounding = ENERGY_ROUNDING * stiffnesses.sum::<f64>();
        Ok(body)
    }

    /// Changes the settings for the solves to come.
    pub fn set_settings(&mut self, settings: NewtonSettings) {
        self.settings = settings;
    }

    /// Adds a term to the energy, in place of the last one, on nodes that the tangent couples; nothing is prescribed by it.
    pub(crate) fn hold(&mut self, by: Arc<dyn WeaklyImposed>) {
        self.weak = Some(by);
        (self.factor_is_current, self.factor_exists) = (false, false);
    }

    /// Mean force per displacement of a node at rest.
    pub(crate) fn rest_stiffness(&self) -> f64 {
        self.solver.rest_stiffness()
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
    pub fn state(&self) -> &AssemblyState<D> {
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

    /// Whether the Cholesky factor is one of [single precision](crate::linalg::mixed).
    pub fn has_single_precision(&self) -> bool {
        self.solver.has_single_precision()
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
            let load_changed = self.at.external != last.external || self.time_passed;
            match self.attempt(load_changed) {
                Attempt::Converged => {
                    self.time_passed = false;
                    reached = next;
                    // Grow back after success, so that one hard spot does not slow down the rest.
                    step *= 2.0;
                }
                Attempt::Failed(reason, detail) => {
                    let hopeless = reason == FailureReason::TooLarge;
                    self.at = last;
                    self.factor_is_current = false;
                    // A kept factor may be what led astray: the shorter way begins with one of its own.
                    self.factor_exists &= !self.settings.reuse_tangent || self.tissue.is_linear();
                    if hopeless || cuts >= self.settings.max_cutbacks {
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

    /// Begins a step of so many seconds, which [`remember`](Self::remember) ends: tissue that relaxes has the moduli of the
    /// step and carries what its past has left. What is driven until then happens in the step; another beginning
    /// before its end takes its place. Without a step time stands still, and moduli are those of a fast deformation.
    pub fn begin(&mut self, elapsed: f64) {
        let Some(history) = &self.history else { return };
        self.prestress = history.prestress(&self.rule, elapsed);
        if elapsed != self.elapsed {
            let step = history.within(elapsed);
            (self.tissue, self.stabilisation, self.elapsed) = (step.tissue, step.stabilisation, elapsed);
            // One tangent serves every state of a linear tissue, but not other moduli.
            self.factor_exists &= !self.tissue.is_linear();
        }
        self.factor_is_current = false;
        self.time_passed = true;
    }

    /// Ends a step: the present state is what tissue that relaxes remembers.
    pub fn remember(&mut self) {
        if let Some(history) = &mut self.history {
            history.remember(self.elapsed, self.at.state.displacement_gradients(), &self.at.coefficients);
        }
    }

    /// Responses of the coefficients to rates of the prescribed values at the current state, one after the other for as
    /// many rates as `rates` holds one after the other: solves `K x + Λᵀ μ = 0, Λ x = rate`. This is the exact
    /// linearisation of the equilibrium; all rates pass through the factor together.
    ///
    /// # Errors
    /// [`Failure`] when the tangent at the current state is not positive definite.
    ///
    /// # Panics
    /// When `rates` is no whole number of rates.
    pub fn sensitivities(&mut self, rates: &[f64]) -> Result<Vec<f64>, Failure> {
        self.linear_responses(rates, &[])
    }

    /// The same, and behind them the responses to loads (D numbers per node each) with the prescribed values held:
    /// `K x + Λᵀ μ = load, Λ x = 0`.
    ///
    /// # Errors
    /// [`Failure`] when the tangent at the current state is not positive definite.
    ///
    /// # Panics
    /// When there is no whole number of rates or of loads.
    pub(crate) fn linear_responses(&mut self, rates: &[f64], loads: &[f64]) -> Result<Vec<f64>, Failure> {
        if !self.factor_is_current && !self.refactorise()? {
            return Err(self.failure(FailureReason::LostStability, 1.0, "tangent not positive definite".into()));
        }
        Ok(self.responses(rates, loads).0)
    }

    /// Responses by the last factor, and whether it serves.
    fn responses(&mut self, rates: &[f64], loads: &[f64]) -> (Vec<f64>, bool) {
        let (unknowns, rows, length) = (self.at.force.len(), self.at.multipliers.len(), self.at.prescribed.len());
        let whole = rates.len().is_multiple_of(length) && loads.len().is_multiple_of(unknowns);
        assert!(length > 0 && whole, "a whole number of rates and loads");
        let columns = rates.len() / length + loads.len() / unknowns;
        let (mut rhs, mut strong) = (vec![0.0; rates.len() / length * unknowns], Vec::with_capacity(columns * rows));
        for (rate, rhs) in rates.chunks_exact(length).zip(rhs.chunks_exact_mut(unknowns)) {
            let (met, weakly) = rate.split_at(rows);
            strong.extend_from_slice(met);
            if let Some(imposed) = &self.weak {
                imposed.add_response(&self.tissue, &self.at.coefficients, weakly, rhs);
            }
        }
        rhs.extend_from_slice(loads);
        strong.resize(columns * rows, 0.0);
        let (mut x, mut mu) = (vec![0.0; columns * unknowns], vec![0.0; columns * rows]);
        let serves = self.solver.solve(&rhs, &strong, 1e-14, Unknowns { x: &mut x, multipliers: &mut mu });
        (x, serves)
    }

    /// Responses to loads with the last factor, whatever state it is of: good enough to step with.
    ///
    /// # Errors
    /// [`Failure`] when there is no factor and the tangent at the current state is not positive definite.
    ///
    /// # Panics
    /// When there is no whole number of loads.
    pub(crate) fn rough_responses(&mut self, loads: &[f64]) -> Result<Vec<f64>, Failure> {
        if self.factor_exists
            && let (responses, true) = self.responses(&[], loads)
        {
            return Ok(responses);
        }
        self.linear_responses(&[], loads)
    }

    /// How the internal force curves along a direction of the coefficients, by second differences over a way of `length`
    /// along it: `[f(d + v) − 2 f(d) + f(d − v)] · w` for every w of `onto`, `v = length · direction`, over length². For bodies
    /// whose prescribed values are imposed exactly.
    ///
    /// # Errors
    /// [`Inverted`] when the body does not admit the way.
    pub(crate) fn force_curvature(
        &self,
        direction: &[f64],
        length: f64,
        onto: &[&[f64]],
    ) -> Result<Vec<f64>, Inverted> {
        let mut sums = vec![0.0; onto.len()];
        let (mut state, mut force) = (AssemblyState::default(), vec![0.0; direction.len()]);
        for (sum, onto) in sums.iter_mut().zip(onto) {
            *sum = -2.0 * (dot(&self.at.force, onto) + dot(&self.at.external, onto));
        }
        for step in [-length, length] {
            let moved: Vec<f64> = self.at.coefficients.iter().zip(direction).map(|(d, v)| d + step * v).collect();
            assembly::internal_force(self.medium(), &moved, &mut state, &mut force)?;
            for (sum, onto) in sums.iter_mut().zip(onto) {
                *sum += dot(&force, onto);
            }
        }
        sums.iter_mut().for_each(|sum| *sum /= length * length);
        Ok(sums)
    }

    /// What resists.
    fn medium(&self) -> Medium<'_, D> {
        let Self { rule, stabilisation, tissue, prestress, .. } = self;
        Medium { rule, stabilisation, tissue, prestress }
    }

    fn failure(&self, reason: FailureReason, reached: f64, detail: String) -> Failure {
        Failure { reason, reached, detail }
    }

    /// Potential energy and its gradient at the current coefficients.
    fn evaluate(&mut self) -> Result<(), Inverted> {
        let Self { rule, stabilisation, tissue, prestress, at, .. } = self;
        let medium = Medium { rule, stabilisation, tissue, prestress };
        at.energy = assembly::internal_force(medium, &at.coefficients, &mut at.state, &mut at.force)?;
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
        let Self { rule, stabilisation, tissue, prestress, at, blocks, weak, solver, .. } = self;
        let medium = Medium { rule, stabilisation, tissue, prestress };
        solver.assemble(|pattern, values| {
            assembly::tangent(medium, &at.state, blocks, values);
            if let Some(weak) = weak {
                weak.add_tangent(tissue, (&at.coefficients, &at.prescribed[at.multipliers.len()..]), pattern, values);
            }
        });
    }

    /// Assembles and factorises the tangent at the current state; false when it is not positive definite.
    fn refactorise(&mut self) -> Result<bool, NotEnoughMemory> {
        self.assemble();
        self.factorise()
    }

    fn factorise(&mut self) -> Result<bool, NotEnoughMemory> {
        self.effort.factorisations += 1;
        // A failed factorisation overwrites the last factor.
        (self.factor_is_current, self.factor_exists) = (false, false);
        match self.solver.factorise() {
            Ok(()) => {
                (self.factor_is_current, self.factor_exists) = (true, true);
                self.stable_at.clone_from(&self.at.coefficients);
                Ok(true)
            }
            Err(Unfactorised::NotPositiveDefinite(_)) => Ok(false),
            Err(Unfactorised::NotEnoughMemory(error)) => Err(error),
        }
    }

    /// Whether the tangent at the current state is positive definite: by the last factor where that proves it for less, else by one
    /// of its own.
    fn is_stable(&mut self) -> Result<bool, NotEnoughMemory> {
        self.assemble();
        if self.factor_exists && self.settings.linear_solver != LinearSolver::Direct && self.solver.is_proven_stable() {
            self.stable_at.clone_from(&self.at.coefficients);
            return Ok(true);
        }
        self.factorise()
    }
}

fn reason_of(at: &Inverted) -> FailureReason {
    if at.law_overflowed() { FailureReason::LawOverflow } else { FailureReason::ElementInverted }
}
