//! Non-negative least squares by active sets (Lawson & Hanson 1974), stopped as soon as the fit is good enough: the
//! fewer positive weights, the better.

use nalgebra::{Cholesky, DMatrix, DVector};
use std::collections::HashMap;

/// Columns that were tried and would have got a negative weight are skipped until another one has changed the set.
const FEASIBLE: f64 = 1e-12;

/// Columns `A` that are to be added up to `b`, with what is known of their products: every column's with those
/// that were taken. One product with all columns is a pass over the whole matrix, which is what a fit would else cost at every
/// step.
#[derive(Debug)]
pub(super) struct Columns {
    a: DMatrix<f64>,
    b: DVector<f64>,
    /// Aᵀ b.
    with_b: DVector<f64>,
    norms: Vec<f64>,
    /// Aᵀ a for columns a that were taken.
    known: HashMap<usize, DVector<f64>>,
}

impl Columns {
    /// The columns of `a`, and what they are to be added up to.
    pub(super) fn new(a: DMatrix<f64>, b: DVector<f64>) -> Self {
        let norms = (0..a.ncols()).map(|c| a.column(c).norm()).collect();
        Self { with_b: a.tr_mul(&b), norms, known: HashMap::new(), a, b }
    }
}

/// Weights `x ≥ 0` that bring `A x` near `b`, better and better.
#[derive(Debug)]
pub(super) struct NonNegativeFit<'a> {
    of: &'a mut Columns,
    active: Vec<usize>,
    weights: Vec<f64>,
    /// Products of the active columns with each other, and with `b`.
    gram: DMatrix<f64>,
    right: Vec<f64>,
    residual: DVector<f64>,
    /// Columns that are never taken, and those that cannot be taken now.
    excluded: Vec<bool>,
    refused: Vec<bool>,
}

impl<'a> NonNegativeFit<'a> {
    /// No weight yet; the columns `excluded` never get one.
    pub(super) fn new(of: &'a mut Columns, excluded: impl Iterator<Item = usize>) -> Self {
        let columns = of.a.ncols();
        let mut fit = Self {
            active: Vec::new(),
            weights: Vec::new(),
            gram: DMatrix::zeros(0, 0),
            right: Vec::new(),
            residual: of.b.clone(),
            excluded: vec![false; columns],
            refused: vec![false; columns],
            of,
        };
        excluded.for_each(|c| fit.excluded[c] = true);
        fit
    }

    /// Takes up weights found before, for a looser tolerance.
    pub(super) fn start_from(&mut self, weights: &[(usize, f64)]) {
        for &(column, _) in weights {
            self.enter(column);
        }
        self.settle();
        self.update_residual();
    }

    /// The positive weights as (column, weight), by column.
    pub(super) fn weights(&self) -> Vec<(usize, f64)> {
        let mut fit: Vec<(usize, f64)> = self.active.iter().copied().zip(self.weights.iter().copied()).collect();
        fit.sort_unstable_by_key(|entry| entry.0);
        fit
    }

    /// Takes more columns until `‖A x − b‖ ≤ tolerance ‖b‖`, or as close as non-negative weights come.
    pub(super) fn improve(&mut self, tolerance: f64) {
        let goal = tolerance * self.of.b.norm();
        let most = self.of.a.ncols().min(self.of.a.nrows());
        while self.residual.norm() > goal && self.active.len() < most {
            let Some(entering) = self.best_column() else {
                break;
            };
            let before = self.residual.norm();
            self.enter(entering);
            self.settle();
            self.update_residual();
            let taken = self.active.contains(&entering);
            if taken && self.residual.norm() < before {
                self.refused.fill(false);
            } else {
                self.refused[entering] = true;
            }
            if !taken {
                self.of.known.remove(&entering);
            }
        }
    }

    fn update_residual(&mut self) {
        self.residual.copy_from(&self.of.b);
        for (&c, w) in self.active.iter().zip(&self.weights) {
            self.residual.axpy(-w, &self.of.a.column(c), 1.0);
        }
    }

    /// The column best aligned with what is left.
    fn best_column(&self) -> Option<usize> {
        let mut descent = self.of.with_b.clone();
        for (c, w) in self.active.iter().zip(&self.weights) {
            descent.axpy(-w, &self.of.known[c], 1.0);
        }
        let scaled = |c: usize| if self.of.norms[c] > 0.0 { descent[c] / self.of.norms[c] } else { 0.0 };
        let best = (0..descent.len())
            .filter(|c| !self.excluded[*c] && !self.refused[*c] && !self.active.contains(c))
            .map(|c| (c, scaled(c)))
            .max_by(|x, y| x.1.total_cmp(&y.1));
        best.filter(|(_, d)| *d > FEASIBLE * self.of.b.norm()).map(|(c, _)| c)
    }

    fn enter(&mut self, column: usize) {
        let Columns { a, with_b, known, .. } = &mut *self.of;
        let products = known.entry(column).or_insert_with(|| a.tr_mul(&a.column(column)));
        let n = self.active.len();
        self.active.push(column);
        self.weights.push(0.0);
        self.right.push(with_b[column]);
        self.gram.resize_mut(n + 1, n + 1, 0.0);
        for (i, active) in self.active.iter().enumerate() {
            (self.gram[(i, n)], self.gram[(n, i)]) = (products[*active], products[*active]);
        }
    }

    fn leave(&mut self, place: usize) {
        self.active.remove(place);
        self.weights.remove(place);
        self.right.remove(place);
        self.gram = std::mem::take(&mut self.gram).remove_row(place).remove_column(place);
    }

    /// Least squares on the active columns; those whose weight would turn negative leave.
    fn settle(&mut self) {
        while !self.active.is_empty() {
            let n = self.active.len();
            let mut normal = self.gram.clone();
            let largest = normal.diagonal().max();
            for i in 0..n {
                normal[(i, i)] += 1e-14 * largest;
            }
            let right = DVector::from_column_slice(&self.right);
            let Some(solution) = Cholesky::new(normal).map(|factor| factor.solve(&right)) else {
                // The last column depends on the others.
                self.leave(n - 1);
                continue;
            };
            if solution.iter().all(|x| *x > 0.0) {
                self.weights.copy_from_slice(solution.as_slice());
                return;
            }
            self.step_towards(&solution);
        }
    }

    /// As far towards the solution as all stay non-negative; those that reach zero leave.
    fn step_towards(&mut self, solution: &DVector<f64>) {
        let step = self
            .weights
            .iter()
            .zip(solution.iter())
            .filter(|(_, s)| **s <= 0.0)
            .map(|(w, s)| if w - s > 0.0 { w / (w - s) } else { 0.0 })
            .fold(1.0, f64::min);
        for (w, s) in self.weights.iter_mut().zip(solution.iter()) {
            *w += step * (s - *w);
        }
        let n = self.active.len();
        let mut leaving: Vec<usize> = (0..n).filter(|&i| self.weights[i] <= FEASIBLE && solution[i] <= 0.0).collect();
        if leaving.is_empty() {
            // Rounding may leave the blocking weight a hair above zero.
            let blocking = (0..n).filter(|&i| solution[i] <= 0.0);
            leaving.extend(blocking.min_by(|&i, &j| self.weights[i].total_cmp(&self.weights[j])));
        }
        for place in leaving.into_iter().rev() {
            self.leave(place);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn non_negative_fit(a: &DMatrix<f64>, b: &DVector<f64>, tolerance: f64) -> Vec<(usize, f64)> {
        let mut columns = Columns::new(a.clone(), b.clone());
        let mut fit = NonNegativeFit::new(&mut columns, std::iter::empty());
        // By way of a looser one, which must not matter.
        fit.improve(0.5);
        fit.improve(tolerance);
        fit.weights()
    }

    #[test]
    fn excluded_columns_get_no_weight() {
        let a = DMatrix::from_fn(60, 30, |i, k| (k as f64 * (i as f64 + 0.5) * std::f64::consts::PI / 60.0).cos());
        let b = a.column(2) * 3.0 + a.column(7) * 0.5;
        let mut columns = Columns::new(a.clone(), b);
        let mut fit = NonNegativeFit::new(&mut columns, [7].into_iter());
        fit.improve(1e-10);
        assert!(fit.weights().iter().all(|(c, _)| *c != 7));
        // What the excluded column is needed for stays: the others are orthogonal to it.
        assert!((fit.residual.norm() - 0.5 * a.column(7).norm()).abs() < 1e-9);
    }

    #[test]
    fn a_sum_of_few_columns_is_found_again() {
        // Columns cos(k t), k = 0..30, sampled at 60 points; b is made of three of them.
        let a = DMatrix::from_fn(60, 30, |i, k| (k as f64 * (i as f64 + 0.5) * std::f64::consts::PI / 60.0).cos());
        let b = a.column(2) * 3.0 + a.column(7) * 0.5 + a.column(29) * 1.0;
        let fit = non_negative_fit(&a, &b, 1e-10);
        assert_eq!(fit.iter().map(|f| f.0).collect::<Vec<_>>(), [2, 7, 29]);
        for ((_, weight), expected) in fit.iter().zip([3.0, 0.5, 1.0]) {
            assert!((weight - expected).abs() < 1e-9);
        }
    }

    #[test]
    fn the_conditions_of_optimality_hold_when_no_exact_fit_exists() {
        // Karush-Kuhn-Tucker: the gradient vanishes on positive weights and points outwards on the others.
        let a = DMatrix::from_fn(12, 20, |i, k| ((i * 7 + k * 13) % 11) as f64 / 11.0 - 0.4);
        let b = DVector::from_fn(12, |i, _| ((i * 5) % 7) as f64 / 7.0 - 0.8);
        let fit = non_negative_fit(&a, &b, 0.0);
        let x = fit.iter().fold(DVector::zeros(20), |mut x, (c, w)| (x[*c] = *w, x).1);
        let gradient = a.transpose() * (&b - &a * &x);
        for c in 0..20 {
            assert!(x[c] >= 0.0);
            assert!(if x[c] > 0.0 { gradient[c].abs() < 1e-6 } else { gradient[c] < 1e-6 }, "{c}: {gradient}");
        }
    }
}
