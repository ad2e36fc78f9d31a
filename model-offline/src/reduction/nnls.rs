//! Non-negative least squares by active sets (Lawson & Hanson 1974), stopped as soon as the fit is good enough: the
//! fewer positive weights, the better.

use nalgebra::{Cholesky, DMatrix, DVector};

/// Columns that were tried and would have got a negative weight are skipped until another one has changed the set.
const FEASIBLE: f64 = 1e-12;

/// Weights `x ≥ 0` with `‖A x − b‖ ≤ tolerance ‖b‖`, or as close as non-negative weights come. Returns the positive ones
/// as (column, weight), by column.
pub(super) fn non_negative_fit(a: &DMatrix<f64>, b: &DVector<f64>, tolerance: f64) -> Vec<(usize, f64)> {
    let columns = a.ncols();
    let mut active: Vec<usize> = Vec::new();
    let mut weights: Vec<f64> = Vec::new();
    let mut refused = vec![false; columns];
    let mut residual = b.clone();
    let scale: Vec<f64> = (0..columns).map(|c| a.column(c).norm()).collect();
    let goal = tolerance * b.norm();
    while residual.norm() > goal && active.len() < columns.min(a.nrows()) {
        // The column best aligned with what is left.
        let descent = |c: usize| if scale[c] > 0.0 { a.column(c).dot(&residual) / scale[c] } else { 0.0 };
        let best = (0..columns)
            .filter(|c| !refused[*c] && !active.contains(c))
            .map(|c| (c, descent(c)))
            .max_by(|x, y| x.1.total_cmp(&y.1));
        let Some((entering, _)) = best.filter(|(_, d)| *d > FEASIBLE * b.norm()) else {
            break;
        };
        active.push(entering);
        weights.push(0.0);
        let before = residual.norm();
        settle(a, b, &mut active, &mut weights);
        residual = b - active.iter().zip(&weights).fold(DVector::zeros(b.len()), |sum, (&c, w)| sum + a.column(c) * *w);
        if active.contains(&entering) && residual.norm() < before {
            refused.fill(false);
        } else {
            refused[entering] = true;
        }
    }
    let mut fit: Vec<(usize, f64)> = active.into_iter().zip(weights).collect();
    fit.sort_unstable_by_key(|entry| entry.0);
    fit
}

/// Least squares on the active columns; those whose weight would turn negative leave, one after the other.
fn settle(a: &DMatrix<f64>, b: &DVector<f64>, active: &mut Vec<usize>, weights: &mut Vec<f64>) {
    while !active.is_empty() {
        let n = active.len();
        let mut normal =
            DMatrix::from_fn(n, n, |i, j| if i >= j { a.column(active[i]).dot(&a.column(active[j])) } else { 0.0 });
        normal.fill_upper_triangle_with_lower_triangle();
        let largest = normal.diagonal().max();
        for i in 0..n {
            normal[(i, i)] += 1e-14 * largest;
        }
        let right = DVector::from_iterator(n, active.iter().map(|&c| a.column(c).dot(b)));
        let Some(solution) = Cholesky::new(normal).map(|factor| factor.solve(&right)) else {
            // The last column depends on the others.
            active.pop();
            weights.pop();
            continue;
        };
        if solution.iter().all(|x| *x > 0.0) {
            weights.copy_from_slice(solution.as_slice());
            return;
        }
        // As far towards the solution as all stay non-negative.
        let step = weights
            .iter()
            .zip(solution.iter())
            .filter(|(_, s)| **s <= 0.0)
            .map(|(w, s)| if w - s > 0.0 { w / (w - s) } else { 0.0 })
            .fold(1.0, f64::min);
        for (w, s) in weights.iter_mut().zip(solution.iter()) {
            *w += step * (s - *w);
        }
        let keep: Vec<bool> = weights.iter().zip(solution.iter()).map(|(w, s)| *w > FEASIBLE || *s > 0.0).collect();
        // Rounding may leave the blocking weight a hair above zero.
        let blocked = if keep.iter().all(|k| *k) {
            (0..n).filter(|&i| solution[i] <= 0.0).min_by(|&i, &j| weights[i].total_cmp(&weights[j]))
        } else {
            None
        };
        let mut index = 0;
        active.retain(|_| (keep[index] && Some(index) != blocked, index += 1).0);
        index = 0;
        weights.retain(|_| (keep[index] && Some(index) != blocked, index += 1).0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
