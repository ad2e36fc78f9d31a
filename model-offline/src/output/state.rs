//! A state of a body, as its pictures and files show it.

use crate::discretization::Quadrature;
use crate::discretization::cells::nodal_cells::NodalCell;
use crate::geometry::{Point2, cross};
use crate::material::{Law, Material as _, Matrix, green_lagrange};
use crate::mechanics::Tissue;
use crate::mechanics::assembly::displacement_gradient;
use crate::model::TissueModel;

/// A state of a body and its needle.
#[derive(Debug, Clone, Copy)]
pub struct State<'a> {
    /// Nodal coefficients, two numbers per node.
    pub coefficients: &'a [f64],
    /// Needle depth, length.
    pub depth: f64,
    /// Whether the needle is in the tissue, and not pushing it.
    pub within: bool,
}

/// Displacement gradient of every cell: the average over its integration points.
pub(crate) fn cell_gradients(model: &TissueModel, coefficients: &[f64]) -> Vec<Matrix<2>> {
    mean_gradients(model.rule(), model.cells().len(), coefficients)
}

/// The same of so many cells with this rule.
pub(crate) fn mean_gradients<const D: usize>(
    rule: &Quadrature<D>,
    cells: usize,
    coefficients: &[f64],
) -> Vec<Matrix<D>> {
    let mut sums = vec![(Matrix::<D>::zeros(), 0.0); cells];
    for (q, point) in rule.points().enumerate() {
        let (sum, weight) = &mut sums[point.cell as usize];
        *sum += displacement_gradient(rule, q, coefficients) * point.weight;
        *weight += point.weight;
    }
    sums.into_iter().map(|(sum, weight)| sum / weight).collect()
}

/// A planar displacement gradient in space: plane strain.
pub(crate) fn in_space(h: &Matrix<2>) -> Matrix<3> {
    h.fixed_resize::<3, 3>(0.0)
}

/// Whether a displacement tells the stress: in tissue that relaxes it does not, and some laws know no stress out of the plane.
pub fn has_stress(model: &TissueModel) -> bool {
    model.tissue().laws().iter().all(|law| law.relaxation().is_none() && Law::holds_in_space(law))
}

/// Cauchy stress of a cell in space, of all of its materials by their parts.
pub(crate) fn cauchy_stress(tissue: &Tissue, cell: usize, h: &Matrix<3>) -> Matrix<3> {
    tissue.parts(cell as u32).fold(Matrix::zeros(), |sum, (law, factor)| sum + law.cauchy_stress(h) * factor)
}

/// √(3/2) times the norm of the deviator.
pub(crate) fn von_mises(stress: &Matrix<3>) -> f64 {
    (1.5 * (stress - Matrix::<3>::identity() * (stress.trace() / 3.0)).norm_squared()).sqrt()
}

/// What a picture shows at every node: of elements the mean of those around it by area, of nodal cells its own cell's value.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NodalFields {
    /// Frobenius norm of the Green–Lagrange strain.
    pub strain: Vec<f64>,
    /// Von Mises stress (Cauchy), stress; none where the displacement [does not tell it](has_stress).
    pub von_mises: Option<Vec<f64>>,
}

impl NodalFields {
    /// Of a state; `coefficients`: two numbers per node.
    pub fn new(model: &TissueModel, coefficients: &[f64]) -> Self {
        let gradients = cell_gradients(model, coefficients);
        let strains: Vec<f64> = gradients.iter().map(|h| green_lagrange(h).norm()).collect();
        let stresses = has_stress(model).then(|| {
            let of = |(cell, h)| von_mises(&cauchy_stress(model.tissue(), cell, &in_space(h)));
            gradients.iter().enumerate().map(of).collect::<Vec<f64>>()
        });
        Self { strain: at_nodes(model, &strains), von_mises: stresses.map(|stresses| at_nodes(model, &stresses)) }
    }
}

/// A value of every cell at the nodes.
fn at_nodes(model: &TissueModel, of_cells: &[f64]) -> Vec<f64> {
    if model.scene().discretization.method.integration.is_nodal() {
        return of_cells.to_vec();
    }
    let corners: Vec<Vec<Point2>> = model.cells().iter().map(NodalCell::corners).collect();
    let tolerance = 1e-9 * model.scene().outline.size();
    let mut sums = vec![(0.0, 0.0); model.nodes()];
    for point in model.rule().points() {
        let triangle = &corners[point.cell as usize];
        for node in point.nodes {
            if is_in(triangle, &model.positions()[*node as usize], tolerance) {
                let (sum, weight) = &mut sums[*node as usize];
                *sum += of_cells[point.cell as usize] * point.weight;
                *weight += point.weight;
            }
        }
    }
    sums.into_iter().map(|(sum, weight)| if weight > 0.0 { sum / weight } else { 0.0 }).collect()
}

/// Whether a point is in a convex cell or on its rim, corners counter-clockwise.
fn is_in(corners: &[Point2], x: &Point2, tolerance: f64) -> bool {
    let edges = corners.iter().zip(corners.iter().cycle().skip(1));
    edges.into_iter().all(|(a, b)| cross(b - a, x - a) >= -tolerance * (b - a).norm())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::Integration;
    use crate::scene::Scene;

    fn model(name: &str, integration: Integration) -> TissueModel {
        let mut scene = Scene::bundled(name).unwrap().without_inclusions();
        scene.material = Law::linear(383.0, 318.5).unwrap();
        scene.discretization.method.integration = integration;
        scene.discretization.method.support = integration.default_support();
        TissueModel::new(&scene).unwrap()
    }

    const RULES: [Integration; 6] = [
        Integration::Dni,
        Integration::Scni,
        Integration::ScniStabilised,
        Integration::Gauss,
        Integration::FemT3,
        Integration::FemT6,
    ];

    /// Stretched along an axis: ‖E‖ = e and √((λ+2μ−λ)²) = 2 μ e, at every node of every rule.
    #[test]
    fn fields_of_a_uniform_stretch_are_uniform() {
        let e = 1e-6;
        for rule in RULES {
            let model = model("paper", rule);
            let coefficients: Vec<f64> = model.positions().iter().flat_map(|x| [e * x.x, 0.0]).collect();
            let fields = NodalFields::new(&model, &coefficients);
            assert_eq!(fields.strain.len(), model.nodes());
            assert!(fields.strain.iter().all(|strain| (strain - e).abs() < 1e-4 * e), "{rule}");
            let stresses = fields.von_mises.unwrap();
            assert!(stresses.iter().all(|stress| (stress - 2.0 * 318.5 * e).abs() < 0.1 * e), "{rule}");
        }
    }

    /// Stretched more and more along an axis: every node has the strain of its own place, to a cell's width.
    #[test]
    fn every_node_has_the_strain_of_its_own_place() {
        let e = 1e-6;
        for rule in RULES {
            let model = model("paper", rule);
            let coefficients: Vec<f64> = model.positions().iter().flat_map(|x| [0.5 * e * x.x * x.x, 0.0]).collect();
            let fields = NodalFields::new(&model, &coefficients);
            let (low, high) = model.scene().outline.bounds();
            let inner = |x: f64| x > low.x + 0.25 * (high.x - low.x) && x < high.x - 0.25 * (high.x - low.x);
            for (x, strain) in model.positions().iter().zip(&fields.strain).filter(|(x, _)| inner(x.x)) {
                assert!((strain - e * x.x).abs() < 0.06 * e, "{rule}: {strain} at {x:?}");
            }
        }
    }

    /// Where the past is not in the displacement there is a strain and no stress.
    #[test]
    fn tissue_that_relaxes_has_no_stress_to_show() {
        let scene = Scene::bundled("breast-world").unwrap();
        let model = TissueModel::new(&scene).unwrap();
        let fields = NodalFields::new(&model, &vec![0.0; model.dofs()]);
        assert!(fields.von_mises.is_none() && fields.strain.iter().all(|strain| *strain == 0.0));
    }
}
