//! The body's response at rest to each thing that moves it.

use crate::material::Material as _;
use crate::mechanics::Tissue;
use crate::model::{Body, ModelError, TissueModel};
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

/// What moves the body: needle depth, and paddle displacement x and y where one is attached.
pub(super) fn controls(paddle: Option<usize>) -> usize {
    if paddle.is_some() { 3 } else { 1 }
}

/// Depth and paddle displacement as control values.
pub(super) fn control_values(depth: f64, paddle: Vector2<f64>) -> [f64; 3] {
    [depth, paddle.x, paddle.y]
}

/// Coefficients of the response at rest to unit rates of every control: they meet the prescribed values exactly, so that
/// whatever is added to them may vanish there. `at_rest` is the body with the paddle at this place attached.
///
/// # Errors
/// [`ModelError::Unsupported`] where Nitsche's method holds the body (its prescribed values are met only weakly);
/// [`ModelError::Solve`] when too little of the body is constrained.
pub(super) fn lifting(
    model: &TissueModel,
    paddle: Option<usize>,
    mut at_rest: Body<'_>,
) -> Result<Vec<Vec<f64>>, ModelError> {
    if model.constrained_rows(paddle).is_none() {
        return Err(ModelError::ImposedWeakly);
    }
    (0..controls(paddle))
        .map(|control| {
            let mut unit = [0.0; 3];
            unit[control] = 1.0;
            let rates = model.prescribed_values(paddle, unit[0], Vector2::new(unit[1], unit[2]));
            Ok(at_rest.equilibrium_mut().sensitivities(&rates)?)
        })
        .collect()
}

/// A displacement gradient with its components in a row: xx, xy, yx, yy.
pub(super) fn flat(h: &Matrix2<f64>) -> Vector4<f64> {
    Vector4::new(h[(0, 0)], h[(0, 1)], h[(1, 0)], h[(1, 1)])
}

/// Tangent of a cell's tissue at rest, times `weight`, between flat displacement gradients.
pub(super) fn tangent_at_rest(tissue: &Tissue, cell: u32, weight: f64) -> Matrix4<f64> {
    tissue.parts(cell).fold(Matrix4::zeros(), |sum, (material, factor)| {
        let a = material.tangent(&Matrix2::zeros());
        sum + Matrix4::from_fn(|k, l| a[k / 2][k % 2][l / 2][l % 2]) * (factor * weight)
    })
}
