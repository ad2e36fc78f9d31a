//! The stretch past which a law no longer resists compression: where its nominal stress peaks.

use crate::material::{Law, Material as _};
use nalgebra::Matrix2;

/// Steps of the search from the state at rest downwards.
const STEP: f64 = 2e-3;
/// Stretch below which no limit is looked for.
const SMALLEST: f64 = 0.02;

/// How the lateral faces of the compressed body are constrained.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lateral {
    /// They cannot move: lateral stretch 1.
    Confined,
    /// They are free of stress.
    Free,
}

/// Stretch at the peak of the nominal stress in compression along the first axis, plane strain; none when the law
/// resists ever more. At that stretch ∂P₁₁/∂F₁₁ = 0 (with the lateral stretch following, when it is free), and no
/// homogeneous state beyond it is stable under a dead load. For St. Venant–Kirchhoff, 1/√3 either way.
pub fn limit_stretch(law: &Law, lateral: Lateral) -> Option<f64> {
    let mut width = 1.0;
    let mut slope_at = |stretch: f64| {
        if lateral == Lateral::Free {
            width = free_width(law, stretch, width);
        }
        slope(law, stretch, width, lateral)
    };
    let mut high = 1.0;
    while slope_at(high) > 0.0 {
        high -= STEP;
        if high < SMALLEST {
            return None;
        }
    }
    let (mut low, mut high) = (high, high + STEP);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if slope_at(middle) > 0.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(0.5 * (low + high))
}

fn gradient(stretch: f64, width: f64) -> Matrix2<f64> {
    Matrix2::new(stretch - 1.0, 0.0, 0.0, width - 1.0)
}

/// dP₁₁/dF₁₁ along the path.
fn slope(law: &Law, stretch: f64, width: f64, lateral: Lateral) -> f64 {
    let a = law.tangent(&gradient(stretch, width));
    match lateral {
        Lateral::Confined => a[0][0][0][0],
        Lateral::Free => a[0][0][0][0] - a[0][0][1][1] * a[1][1][0][0] / a[1][1][1][1],
    }
}

/// The lateral stretch at which P₂₂ = 0, by Newton's method from that of a neighbouring state.
fn free_width(law: &Law, stretch: f64, guess: f64) -> f64 {
    let mut width = guess;
    for _ in 0..50 {
        let h = gradient(stretch, width);
        let step = law.respond(&h).pk1_stress[(1, 1)] / law.tangent(&h)[1][1][1][1];
        width -= step;
        if step.abs() < 1e-14 {
            break;
        }
    }
    width
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fung(c: f64) -> Law {
        Law::fung(383.0, 318.5, c, 1.5, 1.0).unwrap()
    }

    #[test]
    fn saint_venant_kirchhoff_peaks_at_one_over_root_three() {
        for lateral in [Lateral::Confined, Lateral::Free] {
            let limit = limit_stretch(&fung(0.0), lateral).unwrap();
            assert!((limit - 1.0 / 3f64.sqrt()).abs() < 1e-9, "{lateral:?}: {limit}");
        }
    }

    /// Peaks of the confined nominal stress that an independent implementation found.
    #[test]
    fn the_exponential_term_moves_the_peak() {
        for (c, expected) in [(0.0, 0.5773), (0.779, 0.5768), (100.0, 0.523), (1000.0, 0.452)] {
            let limit = limit_stretch(&fung(c), Lateral::Confined).unwrap();
            assert!((limit - expected).abs() < 6e-4, "c = {c}: {limit}");
        }
    }

    #[test]
    fn a_neo_hookean_law_has_no_peak() {
        assert_eq!(limit_stretch(&Law::neo_hookean(383.0, 318.5).unwrap(), Lateral::Confined), None);
    }
}
