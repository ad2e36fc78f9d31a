//! Prescribed nodal values as constraints in coefficient space.
//!
//! The transformation method re-expresses every shape function in nodal values so that boundary values can be
//! prescribed; that makes all matrices dense. Minimising the energy over the coefficients d subject to `Λ d = g`, with
//! Λ_bI = Ψ_I(X_b) for the constrained nodes b only, gives the same displacement and keeps the tangent sparse. Each Newton
//! step then solves
//!
//! ```text
//! ⎡ K  Λᵀ ⎤ ⎡ x ⎤   ⎡ rhs ⎤
//! ⎣ Λ  0  ⎦ ⎣ μ ⎦ = ⎣ gap ⎦
//! ```
//!
//! by the method of multipliers: factorise `K_ρ = K + Λᵀ ρ Λ` (positive definite exactly when K is on the null space
//! of Λ, for ρ large enough, so Cholesky detects lost stability; same sparsity as K plus the constrained stencils) and iterate
//! on μ. The constraint error shrinks by about ρ⁻¹ K per round; a few rounds reach rounding error.

use super::analysis::Analysis;
use super::conjugate_gradients::{Breakdown, Stop, conjugate_gradients, dot};
use crate::linalg::{CondensedFactor, MixedCholesky, NotEnoughMemory, Pattern, Unfactorised};
use crate::mechanics::ConstrainedRows;
use std::sync::Arc;

/// Penalty over the mean diagonal of the tangent. Large enough that two or three rounds of multipliers reach rounding
/// error, small enough that the factor of K_ρ keeps its digits.
const PENALTY: f64 = 1e4;
/// The same where the factor alone must hold them.
const TIGHT_PENALTY: f64 = 1e8;
/// Rounds of multipliers; each costs one back-substitution.
const MAX_ROUNDS: usize = 12;
/// Correction over the solution at which refinement ends: the next would be of rounding.
const REFINED: f64 = 1e-12;
/// And at which it has converged: a factor's own matrix is left at its rounding, far below.
const CONVERGED: f64 = 1e-7;
/// Rounds of refinement.
const MAX_REFINEMENTS: usize = 20;
/// More iterations than this cost as much as a factorisation.
const MAX_ITERATIONS: u32 = 12;

/// Solves tangent systems with constrained rows; see the module documentation.
#[derive(Debug, Clone)]
pub struct ConstrainedSolver<const D: usize> {
    pattern: Arc<Pattern>,
    cholesky: MixedCholesky,
    constrained: ConstrainedRows,
    penalty: f64,
    /// Penalty over the mean diagonal of the first tangent.
    stiffness_ratio: f64,
    /// Block positions of every pair (row ≥ column) of every constrained stencil.
    positions: Vec<u32>,
    matrix: Vec<f64>,
    work: Work,
}

/// The unknowns of a constrained system.
#[derive(Debug)]
pub struct Unknowns<'a> {
    /// Coefficients x, D numbers per node.
    pub x: &'a mut [f64],
    /// Multipliers μ, D numbers per constrained row.
    pub multipliers: &'a mut [f64],
}

/// How well a system is solved that is not solved to rounding.
#[derive(Debug, Clone, Copy)]
pub(super) struct SolveAccuracy {
    /// Error over the solution, in the norm of energy.
    pub relative: f64,
    /// Largest violation of the constraints, length units.
    pub violation: f64,
}

#[derive(Debug, Clone, Default)]
struct Work {
    solution: Vec<f64>,
    weighted: Vec<f64>,
    violation: Vec<f64>,
}

impl<const D: usize> ConstrainedSolver<D> {
    /// Solves systems of an analysed pattern, which must cover the stencils of the constrained rows.
    ///
    /// # Errors
    /// [`NotEnoughMemory`] when the machine has none for the factor.
    ///
    /// # Panics
    /// When the pattern misses a pair of a constrained stencil.
    pub fn new(analysis: &Analysis, rows: ConstrainedRows) -> Result<Self, NotEnoughMemory> {
        Ok(Self::with(MixedCholesky::new(&analysis.symbolic)?, analysis, rows))
    }

    /// The same by a factor in double precision, however large it is.
    ///
    /// # Errors
    /// [`NotEnoughMemory`] when the machine has none for the factor.
    ///
    /// # Panics
    /// When the pattern misses a pair of a constrained stencil.
    pub fn in_double_precision(analysis: &Analysis, rows: ConstrainedRows) -> Result<Self, NotEnoughMemory> {
        Ok(Self::with(MixedCholesky::in_double_precision(&analysis.symbolic)?, analysis, rows))
    }

    fn with(cholesky: MixedCholesky, analysis: &Analysis, rows: ConstrainedRows) -> Self {
        let mut solver = Self {
            cholesky,
            matrix: vec![0.0; analysis.pattern.entries()],
            pattern: Arc::clone(&analysis.pattern),
            constrained: ConstrainedRows::default(),
            penalty: 0.0,
            stiffness_ratio: PENALTY,
            positions: Vec::new(),
            work: Work::default(),
        };
        solver.constrain(rows);
        solver
    }

    /// The same with a penalty that holds the constrained rows to rounding without rounds of multipliers, for what is asked of
    /// the factor itself. It costs as many digits where constrained rows are no single unknowns.
    #[must_use]
    pub(crate) fn held_tight(self) -> Self {
        Self { stiffness_ratio: TIGHT_PENALTY, ..self }
    }

    /// What the unknowns of `nodes` nodes that the analysis retains answer, all others following.
    pub(crate) fn condensed(&self, nodes: usize) -> CondensedFactor {
        CondensedFactor::new(&self.cholesky, self.pattern.unknowns(), nodes * D)
    }

    /// Constrains other rows from now on; the symbolic analysis is kept. The pattern must cover their stencils too.
    ///
    /// # Panics
    /// When the pattern misses a pair of a constrained stencil.
    pub fn constrain(&mut self, rows: ConstrainedRows) {
        self.positions.clear();
        for nodes in rows.node_lists() {
            for (column, &j) in nodes.iter().enumerate() {
                let find = |&i: &u32| {
                    self.pattern.block_position(i, j).expect("the pattern covers the constrained rows") as u32
                };
                self.positions.extend(nodes[column..].iter().map(find));
            }
        }
        self.constrained = rows;
    }

    /// The sparsity pattern.
    pub fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// The constrained rows.
    pub fn constrained(&self) -> &ConstrainedRows {
        &self.constrained
    }

    /// Entries of the Cholesky factor.
    pub fn factor_entries(&self) -> usize {
        self.cholesky.factor_entries()
    }

    /// Zeroes the matrix and lets `assemble` add the tangent into it; adds the constrained rows' penalty, which the first
    /// call fixes.
    pub fn assemble(&mut self, assemble: impl FnOnce(&Pattern, &mut [f64])) {
        self.matrix.fill(0.0);
        assemble(&self.pattern, &mut self.matrix);
        self.penalise();
    }

    /// Sets the matrix to a tangent assembled before, plus the penalty.
    ///
    /// # Panics
    /// When the tangent is not laid out by this pattern.
    pub fn load(&mut self, tangent: &[f64]) {
        self.matrix.copy_from_slice(tangent);
        self.penalise();
    }

    /// Mean diagonal entry of the tangent at the first factorisation: force per displacement of a node.
    pub fn rest_stiffness(&self) -> f64 {
        self.penalty / self.stiffness_ratio
    }

    fn mean_diagonal(&self) -> f64 {
        let n = self.pattern.unknowns();
        (0..n).map(|u| self.matrix[self.pattern.diagonal_position(u)]).sum::<f64>() / n as f64
    }

    fn penalise(&mut self) {
        if self.penalty == 0.0 {
            self.penalty = self.stiffness_ratio * self.mean_diagonal();
        }
        let mut next = 0;
        for b in 0..self.constrained.len() {
            let (nodes, values) = self.constrained.row(b);
            for (column, &j) in nodes.iter().enumerate() {
                let stride = self.pattern.column_length(j);
                for value in &values[column..] {
                    let weight = self.penalty * value * values[column];
                    for k in 0..D {
                        self.matrix[self.positions[next] as usize + k * stride + k] += weight;
                    }
                    next += 1;
                }
            }
        }
    }

    /// Factorises the assembled matrix.
    ///
    /// # Errors
    /// [`Unfactorised`] when the tangent is not positive definite, on the displacements that the prescribed values leave free.
    pub fn factorise(&mut self) -> Result<(), Unfactorised> {
        self.cholesky.factorise::<D>(&self.pattern, &self.matrix)
    }

    /// Whether the last factor proves that the assembled tangent is positive definite, for less than a factorisation; see
    /// [`MixedCholesky::proves`].
    ///
    /// # Panics
    /// When there is no factor.
    pub(super) fn is_proven_stable(&mut self) -> bool {
        self.cholesky.proves::<D>(&self.pattern, &self.matrix)
    }

    /// Adds `shift` to the diagonal of the matrix that the last [`factorise`](Self::factorise) refused, and tries again.
    ///
    /// # Errors
    /// [`Unfactorised`] when the shift is still too small.
    pub fn factorise_shifted(&mut self, shift: f64) -> Result<(), Unfactorised> {
        for u in 0..self.pattern.unknowns() {
            self.matrix[self.pattern.diagonal_position(u)] += shift;
        }
        self.cholesky.factorise_in_double_precision(&self.pattern, &self.matrix)
    }

    /// Solves `K x + Λᵀ μ = rhs`, `Λ x = gap` with the last factor, for as many right-hand sides as `rhs` holds one after
    /// the other (several at once pass through the factor together). The multipliers come in as a first guess (zeros will
    /// do); the constraint is met to `tolerance` (length units) or to rounding error.
    ///
    /// False where the factor is one of single precision and the matrix assembled last, which is then solved for, too far from the
    /// factorised one.
    ///
    /// # Panics
    /// When the lengths do not belong to the same number of right-hand sides.
    pub fn solve(&mut self, rhs: &[f64], gap: &[f64], tolerance: f64, solution: Unknowns<'_>) -> bool {
        let columns = self.first_right_side(rhs, gap, &solution);
        self.cholesky.apply(&mut self.work.solution, columns);
        solution.x.copy_from_slice(&self.work.solution);
        if self.cholesky.is_rough() {
            return self.refine(rhs, gap, tolerance, solution);
        }
        self.meet_constraints(gap, tolerance, solution);
        true
    }

    /// The same for one right-hand side and the matrix assembled last, by conjugate gradients with the last factor as
    /// preconditioner; returns the number of iterations. The preconditioner has the same penalty, so that it is exact on
    /// the constraints: the multipliers' rounds go through it alone, and what that leaves of the first equation is second
    /// order.
    ///
    /// # Errors
    /// [`Breakdown`] where the matrix is seen not to be positive definite, or a factorisation would cost less.
    pub(super) fn solve_by_iteration(
        &mut self,
        rhs: &[f64],
        gap: &[f64],
        accuracy: SolveAccuracy,
        solution: Unknowns<'_>,
    ) -> Result<u32, Breakdown> {
        self.first_right_side(rhs, gap, &solution);
        let Self { work: Work { solution: residual, violation, .. }, cholesky, pattern, matrix, .. } = self;
        solution.x.copy_from_slice(residual);
        cholesky.apply(solution.x, 1);
        let mut image = vec![0.0; residual.len()];
        pattern.multiply::<D>(matrix, solution.x, &mut image);
        // Energy of the solution without that of the penalty.
        self.constrained.apply::<D>(solution.x, violation);
        let energy = dot(solution.x, &image) - self.penalty * dot(violation, violation);
        if energy.is_nan() || energy < 0.0 {
            return Err(Breakdown::NegativeCurvature);
        }
        residual.iter_mut().zip(&image).for_each(|(r, i)| *r -= i);
        let iterations = conjugate_gradients(
            |x, out| pattern.multiply::<D>(matrix, x, out),
            |r| cholesky.apply(r, 1),
            residual,
            solution.x,
            Stop { goal: accuracy.relative * energy.sqrt(), iterations: MAX_ITERATIONS },
        )?;
        self.meet_constraints(gap, accuracy.violation, solution);
        Ok(iterations)
    }

    /// Right side of the first round, `K_ρ x = rhs + Λᵀ (ρ gap − μ)`, into the workspace; returns how many columns it has.
    fn first_right_side(&mut self, rhs: &[f64], gap: &[f64], solution: &Unknowns<'_>) -> usize {
        let (unknowns, rows) = (self.pattern.unknowns(), self.constrained.len() * D);
        let columns = rhs.len() / unknowns;
        let one_shape = solution.x.len() == rhs.len() && solution.multipliers.len() == gap.len();
        assert!(one_shape && gap.len() == columns * rows, "one shape");
        let Work { solution: right, weighted, violation } = &mut self.work;
        right.clear();
        right.extend_from_slice(rhs);
        violation.resize(gap.len(), 0.0);
        weighted.clear();
        weighted.extend(gap.iter().zip(solution.multipliers.iter()).map(|(g, m)| self.penalty * g - m));
        for column in 0..columns {
            // Where nothing is constrained there are no rows to walk through.
            let (free, row) = (column * unknowns..(column + 1) * unknowns, column * rows..(column + 1) * rows);
            self.constrained.add_transpose::<D>(&weighted[row], &mut right[free]);
        }
        columns
    }

    /// Whether the factor is one of single precision.
    pub fn has_single_precision(&self) -> bool {
        self.cholesky.is_rough()
    }

    /// Rounds of refinement, and of multipliers with them, until both equations are met to rounding; false where they do not
    /// converge.
    fn refine(&mut self, rhs: &[f64], gap: &[f64], tolerance: f64, solution: Unknowns<'_>) -> bool {
        let Unknowns { x, multipliers: mu } = solution;
        let (unknowns, rows) = (self.pattern.unknowns(), self.constrained.len() * D);
        let columns = x.len() / unknowns;
        let Work { solution: correction, weighted, violation } = &mut self.work;
        let mut image = vec![0.0; unknowns];
        // Of the last two rounds: x and the multipliers take turns.
        let mut sizes = [f64::INFINITY; 2];
        for _ in 0..MAX_REFINEMENTS {
            let mut largest = 0.0_f64;
            correction.copy_from_slice(rhs);
            for c in 0..columns {
                let (free, row) = (c * unknowns..(c + 1) * unknowns, c * rows..(c + 1) * rows);
                let (violation, weighted) = (&mut violation[row.clone()], &mut weighted[row.clone()]);
                self.constrained.apply::<D>(&x[free.clone()], violation);
                let pairs = violation.iter_mut().zip(&gap[row.clone()]).zip(&mut mu[row]).zip(weighted.iter_mut());
                for (((v, g), m), w) in pairs {
                    *v -= g;
                    *m += self.penalty * *v;
                    *w = self.penalty * g - *m;
                    largest = largest.max(v.abs());
                }
                self.constrained.add_transpose::<D>(weighted, &mut correction[free.clone()]);
                self.pattern.multiply::<D>(&self.matrix, &x[free.clone()], &mut image);
                correction[free].iter_mut().zip(&image).for_each(|(r, i)| *r -= i);
            }
            self.cholesky.apply(correction, columns);
            let length = |of: &[f64]| dot(of, of).sqrt();
            let relative = |(c, x): (&[f64], &[f64])| length(c) / length(x).max(f64::MIN_POSITIVE);
            let larger = |most: f64, size: f64| if size > most || size.is_nan() { size } else { most };
            let size = correction.chunks(unknowns).zip(x.chunks(unknowns)).map(relative).fold(0.0, larger);
            if size.is_nan() || size > 0.5 * sizes[0] {
                break;
            }
            x.iter_mut().zip(correction.iter()).for_each(|(x, c)| *x += c);
            sizes = [sizes[1], size];
            if size <= REFINED && largest <= tolerance {
                break;
            }
        }
        sizes[1] <= CONVERGED
    }

    /// Rounds of multipliers after the first, until the constraint is met to `tolerance`.
    fn meet_constraints(&mut self, gap: &[f64], tolerance: f64, solution: Unknowns<'_>) {
        let Unknowns { x, multipliers: mu } = solution;
        let (unknowns, rows) = (self.pattern.unknowns(), self.constrained.len() * D);
        let columns = x.len() / unknowns;
        let Work { solution, weighted, violation } = &mut self.work;
        let by_column = |c: usize| (c * unknowns..(c + 1) * unknowns, c * rows..(c + 1) * rows);
        let mut previous = f64::INFINITY;
        for _ in 0..MAX_ROUNDS {
            for (free, row) in (0..columns).map(by_column) {
                self.constrained.apply::<D>(&x[free], &mut violation[row]);
            }
            let mut largest = 0.0_f64;
            for ((v, g), m) in violation.iter_mut().zip(gap).zip(mu.iter_mut()) {
                *v -= g;
                *m += self.penalty * *v;
                largest = largest.max(v.abs());
            }
            if largest <= tolerance || largest > 0.5 * previous {
                break;
            }
            previous = largest;
            // The first equation holds with the new μ; correct x so that the constraint does too.
            for (w, v) in weighted.iter_mut().zip(violation.iter()) {
                *w = -self.penalty * v;
            }
            solution.fill(0.0);
            for (free, row) in (0..columns).map(by_column) {
                self.constrained.add_transpose::<D>(&weighted[row], &mut solution[free]);
            }
            self.cholesky.apply(solution, columns);
            for (x, s) in x.iter_mut().zip(solution.iter()) {
                *x += s;
            }
        }
    }
}
