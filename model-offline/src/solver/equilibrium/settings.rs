//! How an equilibrium is looked for, why there may be none, and what it cost.

use crate::linalg::NotEnoughMemory;
use serde::Serialize;

/// How the linear systems of Newton's method are solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LinearSolver {
    /// By iteration where there are nodes enough for it to pay, else directly.
    #[default]
    BySize,
    /// By a factor in double precision for every tangent. What a body is made with: the precision stays when settings change.
    Direct,
    /// By conjugate gradients with the last factor as preconditioner; a tangent that is not positive definite, or far from
    /// the last, gets a factor of its own, and so does every converged state that the last factor does not prove to be stable.
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

impl NewtonSettings {
    /// For the small steps of a simulator from one converged state to the next: the last factor nearly always does. What
    /// a plant's error is compared with is 1e-5 of the target's motion; a residual of 1e-7 is far below it.
    pub const SMALL_STEPS: Self = Self {
        residual_tolerance: 1e-7,
        step_tolerance: 1e-6,
        max_iterations: 25,
        max_cutbacks: 8,
        line_search: true,
        require_stability: true,
        reuse_tangent: true,
        linear_solver: LinearSolver::BySize,
    };
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
#[derive(Debug, Clone, Copy, PartialEq, Serialize, strum::VariantArray, thiserror::Error)]
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
    /// There is no memory to factorise the tangent.
    #[error("too-large")]
    TooLarge,
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

impl From<NotEnoughMemory> for Failure {
    fn from(error: NotEnoughMemory) -> Self {
        Self { reason: FailureReason::TooLarge, reached: 0.0, detail: error.to_string() }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_that_is_too_large_says_so() {
        let failure = Failure::from(NotEnoughMemory {
            unknowns: 300_000,
            needed: Some((30_000_000_000, 4_000_000_000)),
            fixed: 0,
        });
        let told = failure.to_string();
        assert!(told.starts_with("too-large: to factorise 300000 unknowns would take 30.0 GB, and 4.0 GB"), "{told}");
    }
}
