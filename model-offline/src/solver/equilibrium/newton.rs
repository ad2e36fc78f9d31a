//! Newton's method with line search, from one state towards the next.

use super::{Equilibrium, FailureReason, LinearSolver, reason_of};
use crate::linalg::NotEnoughMemory;
use crate::solver::conjugate_gradients::dot;
use crate::solver::constrained::{SolveAccuracy, Unknowns};

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

/// Share of the spacing by which a body moves before its stability is checked again: strains of a few per cent, after
/// which no law here has lost what it had.
const STABILITY_REACH: f64 = 0.05;

/// From one shift of an indefinite tangent to the next.
const SHIFT_GROWTH: f64 = 4.0;
/// A shift of so many times the stiffness at rest makes anything positive definite that is a tangent at all.
const MOST_SHIFTED: f64 = 1e3;

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

/// Whether the factor at hand serves the next step.
#[derive(Clone, Copy, PartialEq)]
enum Factor {
    Usable,
    Stale,
}

impl Factor {
    fn usable_if(condition: bool) -> Self {
        if condition { Self::Usable } else { Self::Stale }
    }
}

pub(super) enum Attempt {
    Converged,
    Failed(FailureReason, String),
}

impl From<NotEnoughMemory> for Attempt {
    fn from(error: NotEnoughMemory) -> Self {
        Self::Failed(FailureReason::TooLarge, error.to_string())
    }
}

impl<const D: usize> Equilibrium<D> {
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
    fn newton_step(&mut self, factor: Factor, residual: f64, step: &mut Step) -> Result<(), Attempt> {
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
        if factor == Factor::Stale {
            let iterates = self.iterates();
            self.assemble();
            if iterates && self.step_by_iteration(residual, step) {
                return Ok(());
            }
            step.indefinite = !self.factorise()?;
            if step.indefinite && !self.refactorise_shifted() {
                let detail = "tangent indefinite, no shift helps".into();
                return Err(Attempt::Failed(FailureReason::LostStability, detail));
            }
        }
        let before = step.multipliers.clone();
        let unknowns = Unknowns { x: &mut step.step, multipliers: &mut step.multipliers };
        if !self.solver.solve(&step.rhs, &step.gap, 1e-13 * self.spacing, unknowns) && factor == Factor::Usable {
            step.multipliers = before;
            self.effort.iterations -= 1;
            return self.newton_step(Factor::Stale, residual, step);
        }
        Ok(())
    }

    /// The step by conjugate gradients; false, with nothing changed, when the tangent needs a factor of its own.
    fn step_by_iteration(&mut self, residual: f64, step: &mut Step) -> bool {
        let accuracy = SolveAccuracy {
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
    /// still goes downhill. Tangents on the way to one equilibrium need shifts of one size, so that the search begins a
    /// step below the last one (Nocedal & Wright, Numerical Optimization, 2006, algorithm 3.3).
    fn refactorise_shifted(&mut self) -> bool {
        let least = 1e-4 * self.solver.rest_stiffness();
        let (mut there, mut shift) = (0.0, (self.shift / SHIFT_GROWTH).max(least));
        while shift < MOST_SHIFTED * self.solver.rest_stiffness() {
            self.effort.factorisations += 1;
            if self.solver.factorise_shifted(shift - there).is_ok() {
                self.shift = shift;
                return true;
            }
            (there, shift) = (shift, shift * SHIFT_GROWTH);
        }
        false
    }

    /// Newton's method towards the prescribed values and the load, which may have changed since the last evaluation.
    pub(super) fn attempt(&mut self, load_changed: bool) -> Attempt {
        let n = self.at.coefficients.len();
        if let Some(adapted) = self.weak.as_ref().and_then(|weak| weak.adapted(&self.tissue, &self.at.coefficients)) {
            self.weak = Some(adapted);
            self.factor_is_current = false;
        }
        // Load and weakly imposed values are part of the energy, which has changed with them.
        if (self.weak.is_some() || load_changed)
            && let Err(at) = self.evaluate()
        {
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
        let mut factor = Factor::usable_if(self.factor_is_current || (may_reuse && self.factor_exists));
        let mut last_residual = f64::INFINITY;
        self.residuals.clear();
        for iteration in 0..self.settings.max_iterations {
            if let Err(failed) = self.newton_step(factor, last_residual, &mut step) {
                return failed;
            }
            let slope = dot(&step.step, &self.at.force);
            if let Err(failed) = self.search(&step.step, step.feasible.then_some(slope)) {
                return failed;
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
                return match self.settings.require_stability.then(|| self.is_stable()) {
                    None | Some(Ok(true)) => Attempt::Converged,
                    Some(Ok(false)) => Attempt::Failed(
                        FailureReason::LostStability,
                        "the equilibrium found is not a minimum of the energy".into(),
                    ),
                    Some(Err(error)) => error.into(),
                };
            }
            if iteration + 1 == self.settings.max_iterations {
                let detail = format!("residual {residual:.1e} after {} iterations", iteration + 1);
                return Attempt::Failed(FailureReason::NotConverged, detail);
            }
            factor = Factor::usable_if(linear || (may_reuse && !step.indefinite && residual < 0.25 * last_residual));
            last_residual = residual;
        }
        Attempt::Failed(FailureReason::NotConverged, "no iterations allowed".into())
    }

    /// Takes the step, shortened until the configuration is admissible and (when the prescribed values are already met and
    /// `slope` is given) the energy has decreased enough (Armijo). Where the decrease drowns in the rounding of the
    /// energy, as in the small steps of a simulation, the slope decides instead: the approximate Wolfe condition of
    /// Hager and Zhang (SIAM J. Optim. 16, 2005, equation 4.1).
    fn search(&mut self, step: &[f64], slope: Option<f64>) -> Result<(), Attempt> {
        const SUFFICIENT: f64 = 1e-4;
        // Share of the energy within which two energies are the same for the approximate condition: Hager and Zhang
        // take 1e-6; rounding at strains of 1e-6 needs 1e-10.
        const ROUNDING: f64 = 1e-9;
        let start = self.at.coefficients.clone();
        let energy = self.at.energy;
        // Differences of energies below this are rounding.
        let noise = 1e-12 * (energy.abs() + self.smallest_force * self.spacing) + self.energy_rounding;
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
                    Err(at) => Attempt::Failed(reason_of(&at), at.to_string()),
                    Ok(()) => Attempt::Failed(
                        FailureReason::NotConverged,
                        "no step along Newton's direction lowers the energy".into(),
                    ),
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
