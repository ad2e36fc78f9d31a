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

use crate::geometry::Point;
use crate::linalg::{NotPositiveDefinite, Pattern, SparseCholesky};
use crate::mechanics::ConstrainedRows;

/// Penalty over the mean diagonal of the tangent. Large enough that two or three rounds of multipliers reach rounding
/// error, small enough that the factor of K_ρ keeps its digits.
const PENALTY: f64 = 1e4;
/// Rounds of multipliers; each costs one back-substitution.
const MAX_ROUNDS: usize = 12;

/// Solves tangent systems with constrained rows; see the module documentation.
#[derive(Debug)]
pub struct ConstrainedSolver<const D: usize> {
    pattern: Pattern,
    cholesky: SparseCholesky,
    constrained: ConstrainedRows,
    penalty: f64,
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

#[derive(Debug, Default)]
struct Work {
    solution: Vec<f64>,
    weighted: Vec<f64>,
    violation: Vec<f64>,
}

impl<const D: usize> ConstrainedSolver<D> {
    /// Analyses the pattern of nodes at `positions`, which must cover the stencils of the constrained rows.
    ///
    /// # Panics
    /// When the pattern misses a pair of a constrained stencil.
    pub fn new(pattern: Pattern, positions: &[Point<D>], rows: ConstrainedRows) -> Self {
        let cholesky = SparseCholesky::analyse(&pattern, positions);
        let mut solver = Self {
            matrix: vec![0.0; pattern.entries()],
            pattern,
            cholesky,
            constrained: ConstrainedRows::default(),
            penalty: 0.0,
            positions: Vec::new(),
            work: Work::default(),
        };
        solver.constrain(rows);
        solver
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

    /// Zeroes the matrix and lets `assemble` add the tangent into it.
    pub fn assemble(&mut self, assemble: impl FnOnce(&Pattern, &mut [f64])) {
        self.matrix.fill(0.0);
        assemble(&self.pattern, &mut self.matrix);
    }

    /// Sets the matrix to a tangent assembled before.
    ///
    /// # Panics
    /// When the tangent is not laid out by this pattern.
    pub fn load(&mut self, tangent: &[f64]) {
        self.matrix.copy_from_slice(tangent);
    }

    /// Mean diagonal entry of the tangent at the first factorisation: force per displacement of a node.
    pub fn rest_stiffness(&self) -> f64 {
        self.penalty / PENALTY
    }

    fn mean_diagonal(&self) -> f64 {
        let n = self.pattern.unknowns();
        (0..n).map(|u| self.matrix[self.pattern.diagonal_position(u)]).sum::<f64>() / n as f64
    }

    /// Factorises the assembled tangent with the constrained rows' penalty. The penalty is fixed by the first call.
    ///
    /// # Errors
    /// [`NotPositiveDefinite`] when the tangent is not, on the displacements that the prescribed values leave free.
    pub fn factorise(&mut self) -> Result<(), NotPositiveDefinite> {
        if self.penalty == 0.0 {
            self.penalty = PENALTY * self.mean_diagonal();
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
        self.cholesky.factorise(&self.pattern, &self.matrix)
    }

    /// Adds `shift` to the diagonal of the matrix that the last [`factorise`](Self::factorise) refused, and tries again.
    ///
    /// # Errors
    /// [`NotPositiveDefinite`] when the shift is still too small.
    pub fn factorise_shifted(&mut self, shift: f64) -> Result<(), NotPositiveDefinite> {
        for u in 0..self.pattern.unknowns() {
            self.matrix[self.pattern.diagonal_position(u)] += shift;
        }
        self.cholesky.factorise(&self.pattern, &self.matrix)
    }

    /// Solves `K x + Λᵀ μ = rhs`, `Λ x = gap` with the last factor, for as many right-hand sides as `rhs` holds one after
    /// the other (several at once pass through the factor together). The multipliers come in as a first guess (zeros will
    /// do); the constraint is met to `tolerance` (length units) or to rounding error.
    ///
    /// # Panics
    /// When the lengths do not belong to the same number of right-hand sides.
    pub fn solve(&mut self, rhs: &[f64], gap: &[f64], tolerance: f64, solution: Unknowns<'_>) {
        let Unknowns { x, multipliers: mu } = solution;
        let (unknowns, rows) = (self.pattern.unknowns(), self.constrained.len() * D);
        let columns = rhs.len() / unknowns;
        assert!(x.len() == rhs.len() && gap.len() == columns * rows && mu.len() == gap.len(), "one shape");
        let Work { solution, weighted, violation } = &mut self.work;
        solution.resize(rhs.len(), 0.0);
        weighted.resize(gap.len(), 0.0);
        violation.resize(gap.len(), 0.0);
        // Where nothing is constrained there are no rows to walk through.
        let by_column = |c: usize| (c * unknowns..(c + 1) * unknowns, c * rows..(c + 1) * rows);

        // First round: K_ρ x = rhs + Λᵀ (ρ gap − μ).
        solution.copy_from_slice(rhs);
        for ((w, g), m) in weighted.iter_mut().zip(gap).zip(mu.iter()) {
            *w = self.penalty * g - m;
        }
        for (free, row) in (0..columns).map(by_column) {
            self.constrained.add_transpose::<D>(&weighted[row], &mut solution[free]);
        }
        self.cholesky.solve(solution, columns);
        x.copy_from_slice(solution);
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
            self.cholesky.solve(solution, columns);
            for (x, s) in x.iter_mut().zip(solution.iter()) {
                *x += s;
            }
        }
    }
}
