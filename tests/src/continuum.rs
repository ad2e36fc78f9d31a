//! The continuum limits of `golden/continuum.json`, and how far a model is from them.

use model_offline::placement::rest::RestResponse;
use nalgebra::{Matrix2, Vector2};

/// What one paddle does in the continuum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limit {
    /// d(target)/d(paddle), needle held: rows target x, y, columns paddle x, y.
    pub jacobian: Matrix2<f64>,
    /// ‖J⁻¹ n‖.
    pub controllability_measure: f64,
    /// d(target)/d(depth), paddle held, at small depth.
    pub target_per_depth: Vector2<f64>,
}

/// Limits of a geometry (`paper` or `hull`) with a tissue (`homogeneous` or `inclusion`), paddle by paddle.
///
/// # Panics
/// When the file has none.
pub fn limits(geometry: &str, tissue: &str) -> Vec<Limit> {
    let golden: serde_json::Value = serde_json::from_str(include_str!("../golden/continuum.json")).expect("JSON");
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    let paddles = golden[geometry][tissue].as_array().expect("a geometry and a tissue of the file");
    let limit = |paddle: &serde_json::Value| Limit {
        jacobian: Matrix2::from_fn(|i, j| number(&paddle["jacobian"][i][j])),
        controllability_measure: number(&paddle["controllability_measure"]),
        target_per_depth: Vector2::from_fn(|i, _| number(&paddle["target_per_depth"][i])),
    };
    paddles.iter().map(limit).collect()
}

/// Distance of a model's responses from the limits, the worst of all paddles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    /// Of the controllability measures, relative.
    pub controllability: f64,
    /// Of the target displacements per depth, ‖·‖₂, over the largest one.
    pub displacement: f64,
    /// Of the Jacobians, Frobenius norm, relative.
    pub jacobian: f64,
}

impl Errors {
    /// The worst of them.
    pub fn worst(&self) -> f64 {
        self.controllability.max(self.displacement).max(self.jacobian)
    }
}

/// Distance of a model's responses from the limits.
///
/// # Panics
/// When they are of another number of paddles.
pub fn errors(responses: &[RestResponse], limits: &[Limit]) -> Errors {
    assert_eq!(responses.len(), limits.len());
    let largest = limits.iter().map(|l| l.target_per_depth.norm()).fold(0.0, f64::max);
    let worst = |of: &dyn Fn(&RestResponse, &Limit) -> f64| {
        responses.iter().zip(limits).map(|(r, l)| of(r, l)).fold(0.0, f64::max)
    };
    Errors {
        controllability: worst(&|r, l| (r.controllability_measure / l.controllability_measure - 1.0).abs()),
        displacement: worst(&|r, l| (r.target_per_depth - l.target_per_depth).norm() / largest),
        jacobian: worst(&|r, l| (r.jacobian - l.jacobian).norm() / l.jacobian.norm()),
    }
}
