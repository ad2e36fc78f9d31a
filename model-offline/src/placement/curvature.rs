//! Where the answers feel that nodes are apart, for methods whose shape functions make linear displacements and no more.
//!
//! What such a method gets wrong of an answer is `a(u − u_h, z − z_h)` with the response u to what is prescribed and the
//! response z to a load on the target, at most `∫ 2μ h² |∂²u| |∂²z|` up to a constant, while the number of nodes is `∫ h⁻²`.
//! With `w = 2μ |∂²u| |∂²z|` the most accurate spacing for a number of nodes is `h = s w^(−1/4)`, and then the error goes as
//! `s² ∫ √w`. The second derivatives are those of quadratic triangles.

use super::fields::Fields;
use super::goal_oriented::{Certified, corner_gradients, pairs};
use crate::discretization::nodes::bisection::Triangulation;
use crate::discretization::nodes::sizing::Sizing;
use crate::geometry::{Point2, cross};
use nalgebra::Matrix2;

/// The error over `s² ∫ √w`: gradients are averaged over cells, and what is too much here cancels what is too little there.
/// Measured on bodies with inner corners, necks and slots, whatever else adds to the error: 0.5 to 2 times this.
const LEFT_OVER: f64 = 1e-3;

/// Derivatives along x and y of a displacement gradient.
type Bend = [Matrix2<f64>; 2];

/// The spacing that keeps the error to about `error`, on the triangles that were certified; it grows by no more than `slope`
/// per length.
pub(super) fn spacing_for(error: f64, mesh: &Triangulation, certified: &Certified, slope: f64) -> Sizing {
    let felt = curvature(certified);
    let cells = certified.model.cells().iter();
    let whole: f64 = felt.iter().zip(cells).map(|(w, cell)| w.sqrt() * cell.area).sum();
    let scale = (error / (LEFT_OVER * whole)).sqrt();
    let wanted: Vec<f64> = felt.iter().map(|w| scale / w.sqrt().sqrt()).collect();
    Sizing::new(&mesh.nodes, &mesh.triangles, &wanted, slope)
}

/// w of every triangle, that of the answer which feels it most.
fn curvature(certified: &Certified) -> Vec<f64> {
    let Certified { model, responses, fields, counted, .. } = certified;
    let largest = responses.iter().map(|r| r.target_per_depth.norm()).fold(f64::MIN_POSITIVE, f64::max);
    let mut most = vec![0.0_f64; model.cells().len()];
    for ((response, fields), counts) in responses.iter().zip(fields).zip(counted) {
        // The first is of the measure.
        let answers = &pairs(response, largest)[usize::from(!counts)..];
        for (cell, (most, bends)) in most.iter_mut().zip(bends(certified, fields)).enumerate() {
            let felt = answers.iter().map(|(u, z)| size(&bends, u) * size(&bends, z)).fold(0.0, f64::max);
            *most = most.max(2.0 * model.tissue().rest_shear_modulus(cell as u32) * felt);
        }
    }
    most
}

/// Second derivatives of all fields, triangle by triangle: gradients are linear there, the sum of their values at the corners
/// times the barycentric coordinates.
fn bends(certified: &Certified, fields: &Fields) -> Vec<[Bend; 5]> {
    let at_corners = corner_gradients(&certified.model, fields);
    let cells = certified.model.cells().iter().enumerate();
    cells
        .map(|(cell, shape)| {
            let corners = shape.corners();
            let twice = cross(corners[1] - corners[0], corners[2] - corners[0]);
            let slopes: [Point2; 3] = std::array::from_fn(|k| {
                let opposite = corners[(k + 2) % 3] - corners[(k + 1) % 3];
                Point2::new(-opposite.y, opposite.x) / twice
            });
            std::array::from_fn(|f| {
                let gradients = &at_corners[f][cell];
                [0, 1].map(|axis| gradients.iter().zip(&slopes).map(|(g, slope)| g * slope[axis]).sum())
            })
        })
        .collect()
}

/// |∂²| of a combination of the fields.
fn size(bends: &[Bend; 5], weights: &[f64; 5]) -> f64 {
    let along = |axis: usize| bends.iter().zip(weights).map(|(b, w)| b[axis] * *w).sum::<Matrix2<f64>>().norm_squared();
    (along(0) + along(1)).sqrt()
}
