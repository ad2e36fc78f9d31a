//! Cholesky factors of large matrices in single precision, and solutions with the digits of double precision.
//!
//! A factor in single precision takes half the memory and little more than half the time. It is the factor of a matrix M near K. With it,
//! `K x = b` is solved by refinement, `x ← x + M⁻¹ (b − K x)` with residuals in double precision: the error is multiplied by
//! `R = I − M⁻¹ K` in every round, until it is as small as the digits of K allow (Higham, Accuracy and Stability of Numerical
//! Algorithms, 2002, chapter 12).
//!
//! M is positive definite, or it had no factor; and K is where R has no eigenvalue of one or more, because those of `M⁻¹ K` are
//! positive then. Of a vector drawn at random a round of refinement leaves R times it. Where a few rounds leave less than what
//! hardly any vector has along one direction of so many, no such eigenvalue is there. (Lengths are those of the norm of M, and the
//! vector is drawn for M's diagonal: to the condition of what that leaves, stiff directions have the share of soft ones.) Where
//! they leave more, K is too near to indefinite, or too ill conditioned, for single precision, and is factorised in double precision.
//!
//! None of this asks where M comes from: the factor of one tangent proves that the next is positive definite, too.

use super::cholesky::{SparseCholesky, SymbolicFactor};
use super::dense::NotPositiveDefinite;
use super::memory::NotEnoughMemory;
use super::pattern::Pattern;
use crate::random::SplitMix64;

/// Operations of a factorisation from which on single precision pays: a tenth of a second in double precision.
const SINGLE_PAYS: f64 = 5e9;

/// Operations per entry of the factor from which on a factorisation costs more than [`ROUNDS_AFTER`] rounds of refinement.
const DEAR: f64 = 700.0;

/// A vector drawn at random has at least so much of its length along any one direction, over the square root of its dimension: one
/// in a million has less.
const SURE_SHARE: f64 = 1e-6;

/// Rounds of refinement within which that must be reached with the factor of a matrix itself,
const ROUNDS: usize = 8;
/// and with one of another.
const ROUNDS_AFTER: usize = 14;

/// So many matrices may be tried in single precision in vain.
const PATIENCE: u32 = 2;

/// Why there is no factor.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unfactorised {
    /// There is none.
    #[error(transparent)]
    NotPositiveDefinite(#[from] NotPositiveDefinite),
    /// Single precision does not do, and there is no memory for double precision.
    #[error(transparent)]
    NotEnoughMemory(#[from] NotEnoughMemory),
}

/// Cholesky factor in single precision where that pays and suffices, else in double precision.
#[derive(Debug, Clone)]
pub struct MixedCholesky {
    analysed: SymbolicFactor,
    /// None after there was no memory for what was needed.
    numbers: Option<Numbers>,
    /// Whether the next matrix is tried in single precision.
    tries_single: bool,
    /// How many matrices single precision did not do for that have a factor.
    in_vain: u32,
    /// Diagonal of the matrix that was factorised last.
    diagonal: Vec<f64>,
}

#[derive(Debug, Clone)]
enum Numbers {
    Single(Single),
    Double(SparseCholesky),
}

#[derive(Debug, Clone)]
struct Single {
    factor: SparseCholesky<f32>,
    /// What the factorised matrix was divided by, so that its numbers are within the range of single precision: a power of two.
    scale: f64,
    columns: Vec<f32>,
}

impl MixedCholesky {
    /// Room for a factor of a pattern that was analysed, in single precision where that pays. What is condensed to nodes that the
    /// analysis [retains](SymbolicFactor::retaining) needs the factor's own digits: those are of double precision.
    ///
    /// # Errors
    /// [`NotEnoughMemory`] when there is none for it and what is computed with it, before any is taken.
    pub fn new(analysed: &SymbolicFactor) -> Result<Self, NotEnoughMemory> {
        if analysed.retains() || analysed.flops() < SINGLE_PAYS {
            return Self::in_double_precision(analysed);
        }
        let numbers = Some(Numbers::Single(Single::new(analysed)?));
        Ok(Self { numbers, analysed: analysed.clone(), tries_single: true, in_vain: 0, diagonal: Vec::new() })
    }

    /// Room for a factor in double precision.
    ///
    /// # Errors
    /// [`NotEnoughMemory`] when there is none for it and what is computed with it, before any is taken.
    pub fn in_double_precision(analysed: &SymbolicFactor) -> Result<Self, NotEnoughMemory> {
        let numbers = Some(Numbers::Double(SparseCholesky::new(analysed)?));
        Ok(Self { numbers, analysed: analysed.clone(), tries_single: false, in_vain: PATIENCE, diagonal: Vec::new() })
    }

    /// Entries of the factor.
    pub fn factor_entries(&self) -> usize {
        match &self.numbers {
            Some(Numbers::Single(single)) => single.factor.factor_entries(),
            Some(Numbers::Double(double)) => double.factor_entries(),
            None => 0,
        }
    }

    /// Whether [`apply`](Self::apply) solves to a few digits only, and refinement must follow.
    pub fn is_rough(&self) -> bool {
        matches!(self.numbers, Some(Numbers::Single(_)))
    }

    /// The factor in double precision, where it is that.
    pub(super) fn double(&self) -> Option<&SparseCholesky> {
        match &self.numbers {
            Some(Numbers::Double(double)) => Some(double),
            _ => None,
        }
    }

    /// Factorises the matrix with these values (lower triangle, laid out by the analysed pattern, which has D unknowns a node).
    ///
    /// # Errors
    /// [`Unfactorised`]; the factor is then not usable.
    pub fn factorise<const D: usize>(&mut self, pattern: &Pattern, values: &[f64]) -> Result<(), Unfactorised> {
        self.diagonal.clear();
        self.diagonal.extend((0..pattern.unknowns()).map(|u| values[pattern.diagonal_position(u)]));
        let tried = self.tries_single;
        if tried {
            let mut single = match self.numbers.take() {
                Some(Numbers::Single(single)) => single,
                other => {
                    // Its memory is given back before this one's is taken.
                    drop(other);
                    Single::new(&self.analysed)?
                }
            };
            if single.factorise::<D>(pattern, values, &self.diagonal) {
                self.numbers = Some(Numbers::Single(single));
                return Ok(());
            }
        }
        // What has no factor at all will not have one after small changes either.
        self.tries_single = false;
        self.factorise_in_double_precision(pattern, values)?;
        self.in_vain += u32::from(tried);
        self.tries_single = self.in_vain < PATIENCE;
        Ok(())
    }

    /// The same in double precision, as all that follow until one of [`factorise`](Self::factorise) succeeds.
    ///
    /// # Errors
    /// [`Unfactorised`]; the factor is then not usable.
    pub fn factorise_in_double_precision(&mut self, pattern: &Pattern, values: &[f64]) -> Result<(), Unfactorised> {
        let mut double = match self.numbers.take() {
            Some(Numbers::Double(double)) => double,
            other => {
                drop(other);
                SparseCholesky::new(&self.analysed)?
            }
        };
        let outcome = double.factorise(pattern, values);
        self.numbers = Some(Numbers::Double(double));
        Ok(outcome?)
    }

    /// Whether the last factor, of whatever matrix near to it, proves that the one with these values is positive definite, for less
    /// than a factorisation. Where it does not, it may be all the same.
    ///
    /// # Panics
    /// When there is no factor.
    pub fn proves<const D: usize>(&mut self, pattern: &Pattern, values: &[f64]) -> bool {
        self.analysed.flops() >= DEAR * self.analysed.entries() && self.refinement_converges::<D>(pattern, values)
    }

    fn refinement_converges<const D: usize>(&mut self, pattern: &Pattern, values: &[f64]) -> bool {
        let diagonal = std::mem::take(&mut self.diagonal);
        let converges =
            refinement_converges::<D>((pattern, values), &diagonal, ROUNDS_AFTER, |left| self.apply(left, 1));
        self.diagonal = diagonal;
        converges
    }

    /// Solves in place for `columns` right-hand sides stored one after the other, with the digits of the factor.
    ///
    /// # Panics
    /// When the length of `rhs` is not `columns` times the number of unknowns, or there is no factor.
    pub fn apply(&mut self, rhs: &mut [f64], columns: usize) {
        match self.numbers.as_mut().expect("a factor") {
            Numbers::Single(single) => single.apply(rhs, columns),
            Numbers::Double(double) => double.solve(rhs, columns),
        }
    }
}

/// Whether so many rounds of refinement with M, of this diagonal, by which `apply` divides in place, leave too little of a vector
/// drawn at random for `I − M⁻¹ K` to have an eigenvalue of one or more.
fn refinement_converges<const D: usize>(
    (pattern, values): (&Pattern, &[f64]),
    diagonal: &[f64],
    rounds: usize,
    mut apply: impl FnMut(&mut [f64]),
) -> bool {
    // The same in every run.
    let mut random = SplitMix64(1);
    let mut residual: Vec<f64> = diagonal.iter().map(|stiffness| stiffness.sqrt() * random.symmetric()).collect();
    let (mut left, mut image) = (residual.clone(), vec![0.0; residual.len()]);
    apply(&mut left);
    // Lengths in the norm of M, of which the residual is M times what is left.
    let length = |residual: &[f64], left: &[f64]| residual.iter().zip(left).map(|(r, l)| r * l).sum::<f64>().sqrt();
    let mut before = length(&residual, &left);
    if !before.is_finite() {
        return false;
    }
    let enough = SURE_SHARE / (residual.len() as f64).sqrt() * before;
    for rest in (0..rounds).rev() {
        pattern.multiply::<D>(values, &left, &mut image);
        residual.iter_mut().zip(&image).for_each(|(r, i)| *r -= i);
        left.copy_from_slice(&residual);
        apply(&mut left);
        let now = length(&residual, &left);
        if now < enough {
            return true;
        }
        // No round leaves a smaller share than the one before it.
        let at_best = now * (now / before).powi(rest as i32);
        if at_best.is_nan() || at_best >= enough {
            return false;
        }
        before = now;
    }
    false
}

impl Single {
    fn new(analysed: &SymbolicFactor) -> Result<Self, NotEnoughMemory> {
        Ok(Self { factor: SparseCholesky::new(analysed)?, scale: 1.0, columns: Vec::new() })
    }

    /// False where single precision does not do.
    fn factorise<const D: usize>(&mut self, pattern: &Pattern, values: &[f64], diagonal: &[f64]) -> bool {
        let largest = diagonal.iter().copied().fold(0.0, f64::max);
        self.scale = largest.log2().floor().exp2();
        let narrow: Vec<f32> = values.iter().map(|value| (value / self.scale) as f32).collect();
        self.factor.factorise(pattern, &narrow).is_ok()
            && refinement_converges::<D>((pattern, values), diagonal, ROUNDS, |left| self.apply(left, 1))
    }

    fn apply(&mut self, rhs: &mut [f64], columns: usize) {
        if columns == 0 {
            return;
        }
        let length = rhs.len() / columns;
        self.columns.clear();
        // Numbers as small as the last digits of a solution are within the range of single precision, too.
        for column in rhs.chunks_exact(length) {
            let largest = column.iter().fold(f64::MIN_POSITIVE, |most, value| most.max(value.abs()));
            self.columns.extend(column.iter().map(|value| (value / largest) as f32));
        }
        self.factor.solve(&mut self.columns, columns);
        for (column, solved) in rhs.chunks_exact_mut(length).zip(self.columns.chunks_exact(length)) {
            let largest = column.iter().fold(f64::MIN_POSITIVE, |most, value| most.max(value.abs()));
            column.iter_mut().zip(solved).for_each(|(value, x)| *value = f64::from(*x) * largest / self.scale);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::cholesky::tests::cube;
    use super::*;
    use crate::parallel::within;
    use std::sync::LazyLock;

    /// A cube of springs, large enough for single precision to pay, and its analysis.
    static CUBE: LazyLock<(Pattern, SymbolicFactor)> = LazyLock::new(|| {
        let (pattern, positions, _) = cube(SIDE, 0.0);
        let analysed = SymbolicFactor::new(&pattern, &positions);
        (pattern, analysed)
    });
    const SIDE: u32 = 20;

    /// The cube with its nodes tied to the ground by so much, which is its smallest eigenvalue, and the factor that it begins with.
    fn grounded(ground: f64) -> (&'static Pattern, Vec<f64>, MixedCholesky) {
        let (pattern, analysed) = &*CUBE;
        let cholesky = MixedCholesky::new(analysed).unwrap();
        assert!(cholesky.is_rough(), "large enough for single precision to pay");
        (pattern, cube(SIDE, ground).2, cholesky)
    }

    #[test]
    fn what_single_precision_cannot_tell_from_indefinite_is_factorised_in_double_precision() {
        // The diagonal is 40 or so: single precision has no digit of a billionth.
        for (ground, rough, definite) in
            [(0.1, true, true), (1e-9, false, true), (-1e-9, false, false), (-0.1, false, false)]
        {
            let (pattern, values, mut cholesky) = grounded(ground);
            assert_eq!(cholesky.factorise::<3>(pattern, &values).is_ok(), definite, "{ground}");
            assert_eq!(cholesky.is_rough(), rough, "{ground}");
        }
        // Where single precision did not do, it is tried again: at once if there was no factor at all, and only once more if there was.
        for (ground, tried_again) in [(-0.1, true), (1e-9, false)] {
            let (pattern, values, mut cholesky) = grounded(0.1);
            let (_, refused, _) = grounded(ground);
            for _ in 0..PATIENCE {
                let definite = cholesky.factorise::<3>(pattern, &refused).is_ok();
                assert!(definite != tried_again && !cholesky.is_rough(), "{ground}");
                cholesky.factorise::<3>(pattern, &values).unwrap();
            }
            cholesky.factorise::<3>(pattern, &values).unwrap();
            assert_eq!(cholesky.is_rough(), tried_again, "{ground}");
        }
        // A factor in single precision alone proves nothing.
        let (pattern, values, cholesky) = grounded(-1e-9);
        let mut single = Single::new(&cholesky.analysed).unwrap();
        let narrow: Vec<f32> = values.iter().map(|value| *value as f32).collect();
        assert!(single.factor.factorise(pattern, &narrow).is_ok());
    }

    #[test]
    fn the_factor_of_one_matrix_proves_others_near_it_and_only_those() {
        let (pattern, values, mut cholesky) = grounded(0.1);
        cholesky.factorise::<3>(pattern, &values).unwrap();
        for (ground, proven) in
            [(0.1, true), (0.11, true), (0.08, true), (0.001, false), (-1e-9, false), (-0.1, false), (0.5, false)]
        {
            let (_, values, _) = grounded(ground);
            assert_eq!(cholesky.refinement_converges::<3>(pattern, &values), proven, "{ground}");
        }
        // One unknown that was far stiffer than all others and is not any more.
        let (_, mut values, _) = grounded(0.1);
        let first = pattern.diagonal_position(0);
        values[first] = 1e14;
        cholesky.factorise::<3>(pattern, &values).unwrap();
        assert!(cholesky.is_rough() && cholesky.refinement_converges::<3>(pattern, &values));
        values[first] = -1.0;
        assert!(!cholesky.refinement_converges::<3>(pattern, &values));
    }

    #[test]
    fn numbers_of_any_size_solve_to_the_same_digits() {
        let (pattern, values, mut cholesky) = grounded(0.1);
        cholesky.factorise::<3>(pattern, &values).unwrap();
        let right: Vec<f64> = (0..pattern.unknowns()).map(|u| (u % 11) as f64 - 5.0).collect();
        let mut solution = right.clone();
        cholesky.apply(&mut solution, 1);
        let mut back = vec![0.0; right.len()];
        pattern.multiply::<3>(&values, &solution, &mut back);
        let off = back.iter().zip(&right).map(|(b, r)| (b - r).abs()).fold(0.0, f64::max);
        assert!(off > 1e-9 && off < 1e-2, "of single precision: {off:e}");
        // Powers of two leave every digit as it is.
        let (small, large) = (f64::exp2(-500.0), f64::exp2(400.0));
        let scaled: Vec<f64> = values.iter().map(|value| value * large).collect();
        cholesky.factorise::<3>(pattern, &scaled).unwrap();
        assert!(cholesky.is_rough());
        for size in [small, 1.0] {
            let mut x: Vec<f64> = right.iter().map(|r| r * size).collect();
            cholesky.apply(&mut x, 1);
            assert!(x.iter().zip(&solution).all(|(x, s)| x / (size / large) == *s), "{size}");
        }
    }

    #[test]
    fn shared_by_threads_it_has_the_same_bits() {
        let (pattern, values, mut alone) = grounded(0.1);
        alone.factorise::<3>(pattern, &values).unwrap();
        let solved = |cholesky: &mut MixedCholesky| {
            let mut x: Vec<f64> = (0..pattern.unknowns()).map(|u| (u % 11) as f64 - 5.0).collect();
            cholesky.apply(&mut x, 1);
            x
        };
        let expected = solved(&mut alone);
        for threads in [2, 3] {
            let mut shared = within(threads, || MixedCholesky::new(&CUBE.1).unwrap());
            within(threads, || shared.factorise::<3>(pattern, &values)).unwrap();
            assert_eq!(solved(&mut shared), expected, "{threads} threads");
        }
    }
}
