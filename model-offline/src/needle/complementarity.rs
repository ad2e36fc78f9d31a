//! Forces between bounds, on a compliant body: friction that holds or slides, a tip that holds, cuts or withdraws.
//!
//! With the displacements `y = y₀ + C p` that forces p cause, C symmetric and positive definite, every force lies between
//! its bounds and
//!
//! ```text
//! lower < p < upper ⇒ y = 0,   p = upper ⇒ y ≤ 0,   p = lower ⇒ y ≥ 0:
//! ```
//!
//! the conditions of the one minimum of `½ pᵀ C p + y₀ᵀ p` over a box. Solved by the primal-dual active set method, a
//! semi-smooth Newton method (Hintermüller, Ito, Kunisch, SIAM J. Optim. 13, 2003); where it should cycle, the variable
//! that is worst changes alone.

use nalgebra::{Cholesky, DMatrix, DVector};

/// Rounds in which all that is wrong changes at once, and rounds in all.
const TOGETHER: usize = 40;
const ROUNDS: usize = 400;
/// What is added to the diagonal, over its largest entry: forces at points that cannot move are not unique.
const RIDGE: f64 = 1e-13;

/// Which condition a force is under.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    Between,
    AtLower,
    AtUpper,
}

/// Bounds of a force; equal ones prescribe it, infinite ones let it be what holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bounds {
    pub(super) lower: f64,
    pub(super) upper: f64,
}

impl Bounds {
    /// Whatever holds.
    pub(super) const HOLDS: Self = Self { lower: f64::NEG_INFINITY, upper: f64::INFINITY };

    /// This force.
    pub(super) const fn exactly(force: f64) -> Self {
        Self { lower: force, upper: force }
    }
}

/// The forces; `start` is a guess. None where no set of sides is found that fits.
pub(super) fn forces_between(
    bounds: &[Bounds],
    compliance: &DMatrix<f64>,
    at_zero: &DVector<f64>,
    start: &DVector<f64>,
) -> Option<DVector<f64>> {
    let sides = bounds.iter().zip(start.iter()).map(|(bounds, &p)| match p {
        p if p >= bounds.upper => Side::AtUpper,
        p if p <= bounds.lower => Side::AtLower,
        _ => Side::Between,
    });
    let mut sides: Vec<Side> = sides.collect();
    let ridge = RIDGE * compliance.diagonal().amax();
    for round in 0..ROUNDS {
        let forces = with_sides(&sides, bounds, compliance, at_zero, ridge)?;
        let displacements = at_zero + compliance * &forces;
        // Rounding: of forces by what they could hold, of displacements by what forces cause.
        let largest = compliance.diagonal().amax() * forces.amax();
        let wrong = (0..bounds.len()).filter_map(|i| {
            let Bounds { lower, upper } = bounds[i];
            let (p, y) = (forces[i], displacements[i]);
            let room = 1e-12 * forces.amax();
            match sides[i] {
                Side::Between if p > upper + room => Some((i, Side::AtUpper, (p - upper) * compliance[(i, i)])),
                Side::Between if p < lower - room => Some((i, Side::AtLower, (lower - p) * compliance[(i, i)])),
                Side::AtUpper if y > 1e-12 * largest && lower < upper => Some((i, Side::Between, y)),
                Side::AtLower if y < -1e-12 * largest && lower < upper => Some((i, Side::Between, -y)),
                _ => None,
            }
        });
        let wrong: Vec<(usize, Side, f64)> = wrong.collect();
        let Some(worst) = wrong.iter().copied().max_by(|a, b| a.2.total_cmp(&b.2)) else {
            return Some(forces);
        };
        if round < TOGETHER {
            wrong.iter().for_each(|(i, side, _)| sides[*i] = *side);
        } else {
            sides[worst.0] = worst.1;
        }
    }
    None
}

/// Forces at the bounds that their sides say, and between them what makes their displacements zero.
fn with_sides(
    sides: &[Side],
    bounds: &[Bounds],
    compliance: &DMatrix<f64>,
    at_zero: &DVector<f64>,
    ridge: f64,
) -> Option<DVector<f64>> {
    let mut forces = DVector::from_fn(bounds.len(), |i, _| match sides[i] {
        Side::Between => 0.0,
        Side::AtLower => bounds[i].lower,
        Side::AtUpper => bounds[i].upper,
    });
    let free: Vec<usize> = (0..bounds.len()).filter(|&i| sides[i] == Side::Between).collect();
    if free.is_empty() {
        return Some(forces);
    }
    let bent = at_zero + compliance * &forces;
    let matrix = DMatrix::from_fn(free.len(), free.len(), |r, c| {
        let symmetric = 0.5 * (compliance[(free[r], free[c])] + compliance[(free[c], free[r])]);
        if r == c { symmetric + ridge } else { symmetric }
    });
    let right = DVector::from_iterator(free.len(), free.iter().map(|&i| -bent[i]));
    let held = Cholesky::new(matrix)?.solve(&right);
    free.iter().zip(held.iter()).for_each(|(&i, &force)| forces[i] = force);
    Some(forces)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the conditions themselves, on compliances that couple strongly.
    #[test]
    fn the_conditions_hold_for_every_force() {
        let mut random = crate::random::SplitMix64(5);
        let mut between = |low: f64, high: f64| low + (high - low) * random.unit();
        let mut sides_seen = [0; 3];
        for trial in 0..400 {
            let n = 2 + trial % 24;
            let factor = DMatrix::from_fn(n, n, |_, _| between(-1.0, 1.0));
            let compliance = &factor * factor.transpose() + DMatrix::identity(n, n) * 1e-3;
            let at_zero = DVector::from_fn(n, |_, _| between(-1.0, 1.0));
            let bounds: Vec<Bounds> = (0..n)
                .map(|i| match i % 4 {
                    0 => Bounds::HOLDS,
                    1 => Bounds { lower: 0.0, upper: between(0.0, 0.5) },
                    2 => Bounds::exactly(between(-0.5, 0.5)),
                    _ => Bounds { lower: -0.1, upper: 0.1 },
                })
                .collect();
            let start = DVector::from_fn(n, |_, _| between(-1.0, 1.0));
            let forces = forces_between(&bounds, &compliance, &at_zero, &start).unwrap();
            let y = &at_zero + &compliance * &forces;
            for i in 0..n {
                let (p, Bounds { lower, upper }) = (forces[i], bounds[i]);
                assert!(lower - 1e-9 <= p && p <= upper + 1e-9, "{trial} {i}: {p}");
                if lower == upper {
                    continue;
                }
                let side = usize::from(p >= upper - 1e-12) + 2 * usize::from(p <= lower + 1e-12);
                sides_seen[side] += 1;
                let holds = match side {
                    0 => y[i].abs() < 1e-8,
                    1 => y[i] < 1e-8,
                    _ => y[i] > -1e-8,
                };
                assert!(holds, "{trial} {i}: force {p} in {lower}..{upper}, displacement {}", y[i]);
            }
        }
        assert!(sides_seen.iter().all(|seen| *seen > 100), "{sides_seen:?}");
    }
}
