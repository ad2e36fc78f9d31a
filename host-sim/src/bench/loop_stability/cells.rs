//! Gain × delay × Jacobian error: a linear, noise-free plant under the controller's own law, cell by cell.

use firmware::law::Direction;
use firmware::loop_stability::gain_limit;
use model_offline::study::Extent;
use nalgebra::{Matrix2, Rotation2, Vector2};

use super::behaviour::Behaviour;

/// Delays, target samples.
pub const DELAYS: [u32; 6] = [0, 1, 2, 3, 5, 10];
/// Angles of the eigenvalues of J·Ĵ⁻¹, degrees.
pub const ANGLES: [f64; 8] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 85.0, 95.0];
/// Their size.
pub const SIZES: [f64; 3] = [0.5, 1.0, 2.0];

/// Samples after which a loop that has neither settled nor diverged is judged by whether its error has grown.
const SAMPLES: u32 = 40_000;
/// How often a loop is judged, samples.
const JUDGED_EVERY: usize = 32;
/// Error, relative to that at the start, below which it has settled and above which it has diverged.
const ENDS: [f64; 2] = [1e-6, 1e6];

/// One boundary: a delay and a Jacobian error, with the largest gain that is stable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Boundary {
    /// Delay d, target samples.
    pub delay: u32,
    /// |λ| of both eigenvalues of J·Ĵ⁻¹.
    pub size: f64,
    /// ±arg λ, degrees.
    pub angle: f64,
    /// Limit of the gain in theory; 0 where none is stable.
    pub theory: f64,
    /// Number of cells, from the smallest gain up, that are stable in theory.
    pub theory_cells: usize,
    /// Number of cells, from the smallest gain up, that settle when simulated.
    pub simulated_cells: usize,
    /// Cells on which the two disagree.
    pub disagreeing: usize,
}

/// The gains of the cells: evenly spaced in the logarithm.
pub fn gains(extent: Extent) -> Vec<f64> {
    let per_decade = match extent {
        Extent::Quick => 15,
        Extent::Full => 40,
    };
    // From 0.002, below the least limit of all cells but those that no gain makes stable (0.0042 at 85°, |λ| = 2 and a
    // delay of 10), to 5, above the largest.
    (0..=17 * per_decade / 5).map(|i| 0.002 * 10f64.powf(f64::from(i) / f64::from(per_decade))).collect()
}

/// What the loop does with this gain and delay when the tissue's Jacobian is `truth` and the table's is `table`.
///
/// The paddle goes where the law sends it at once; the target is measured without noise, `delay` samples late:
/// e(k+1) = e(k) − g·J·Ĵ⁻¹·e(k−d).
pub fn simulate(truth: &Matrix2<f64>, table: &Matrix2<f64>, gain: f64, delay: u32) -> Behaviour {
    let start = Vector2::new(1.0, 0.5).normalize();
    let depth = delay as usize + 1;
    let mut history = vec![start; depth];
    let mut paddle = Vector2::zeros();
    for sample in 0..SAMPLES as usize {
        let measured = history[sample % depth];
        paddle -= Direction::Inverse.solve(&[*table], &measured, &[1.0])[0] * gain;
        history[sample % depth] = start + truth * paddle;
        if sample % JUDGED_EVERY != 0 {
            continue;
        }
        let largest = history.iter().map(Vector2::norm).fold(0.0, f64::max);
        if largest < ENDS[0] {
            return Behaviour::Settles;
        }
        if largest > ENDS[1] {
            return Behaviour::Diverges;
        }
    }
    let largest = history.iter().map(Vector2::norm).fold(0.0, f64::max);
    if largest < 1.0 { Behaviour::Settles } else { Behaviour::Diverges }
}

/// Simulates every cell around a table's Jacobian; the tissue's is |λ|·R(arg λ)·Ĵ, so that J·Ĵ⁻¹ has exactly the
/// eigenvalues |λ|·e^(±i·arg λ).
pub fn boundaries(table: &Matrix2<f64>, extent: Extent) -> Vec<Boundary> {
    let gains = gains(extent);
    let mut all = Vec::new();
    for delay in DELAYS {
        for size in SIZES {
            for angle in ANGLES {
                let turned = Rotation2::new(angle.to_radians()).into_inner();
                let truth = turned * table * size;
                let limit = gain_limit(angle.to_radians(), delay) / size;
                let stable: Vec<bool> =
                    gains.iter().map(|gain| simulate(&truth, table, *gain, delay) == Behaviour::Settles).collect();
                all.push(Boundary {
                    delay,
                    size,
                    angle,
                    theory: limit,
                    theory_cells: gains.iter().take_while(|gain| **gain < limit).count(),
                    simulated_cells: stable.iter().take_while(|stable| **stable).count(),
                    disagreeing: gains
                        .iter()
                        .zip(&stable)
                        .filter(|(gain, stable)| (**gain < limit) != **stable)
                        .count(),
                });
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simulated_cells_agree_with_theory_within_one() {
        let table = Matrix2::new(0.30, 0.05, -0.04, 0.25);
        let all = boundaries(&table, Extent::Quick);
        assert_eq!(all.len(), DELAYS.len() * ANGLES.len() * SIZES.len());
        for boundary in &all {
            assert!(boundary.theory_cells.abs_diff(boundary.simulated_cells) <= 1, "{boundary:?}");
            assert!(boundary.disagreeing <= 1, "{boundary:?}");
            assert_eq!(boundary.angle > 90.0, boundary.simulated_cells == 0, "{boundary:?}");
        }
    }

    /// Limits of g·|λ| as published for d = 0, 1, 2, 3, 5, 10.
    #[test]
    fn the_published_limits_lie_between_stable_and_unstable_loops() {
        let table = Matrix2::identity();
        for (angle, limits) in [
            (0.0_f64, [2.000, 1.000, 0.618, 0.445, 0.285, 0.149]),
            (30.0, [1.732, 0.684, 0.416, 0.298, 0.190, 0.100]),
            (60.0, [1.000, 0.347, 0.209, 0.149, 0.095, 0.050]),
        ] {
            let truth = Rotation2::new(angle.to_radians()).into_inner();
            for (delay, limit) in DELAYS.into_iter().zip(limits) {
                assert_eq!(simulate(&truth, &table, 0.98 * limit, delay), Behaviour::Settles, "{angle} {delay}");
                assert_eq!(simulate(&truth, &table, 1.02 * limit, delay), Behaviour::Diverges, "{angle} {delay}");
            }
        }
    }
}
