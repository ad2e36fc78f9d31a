//! A state of a body, as its pictures and files show it.

use crate::discretization::Quadrature;
use crate::discretization::cells::nodal_cells::NodalCell;
use crate::geometry::{Point, Point2, cross};
use crate::material::{Law, Material as _, Matrix, green_lagrange};
use crate::mechanics::Tissue;
use crate::mechanics::assembly::displacement_gradient;
use crate::model::TissueModel;
use crate::model::space::SpaceModel;

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
    tells_stress(model.tissue())
}

fn tells_stress(tissue: &Tissue) -> bool {
    tissue.laws().iter().all(|law| law.relaxation().is_none() && Law::holds_in_space(law))
}

/// Cauchy stress of a cell in space, of all of its materials by their parts.
pub(crate) fn cauchy_stress(tissue: &Tissue, cell: usize, h: &Matrix<3>) -> Matrix<3> {
    tissue.parts(cell as u32).fold(Matrix::zeros(), |sum, (law, factor)| sum + law.cauchy_stress(h) * factor)
}

/// √(3/2) times the norm of the deviator.
pub(crate) fn von_mises(stress: &Matrix<3>) -> f64 {
    (1.5 * (stress - Matrix::<3>::identity() * (stress.trace() / 3.0)).norm_squared()).sqrt()
}

/// What a picture shows at every node: of elements the mean of those around it by area or volume, of nodal cells its own cell's
/// value.
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
        let gradients: Vec<Matrix<3>> = cell_gradients(model, coefficients).iter().map(in_space).collect();
        Self::of_cells(model.tissue(), &gradients).map(|of_cells| at_nodes(model, of_cells))
    }

    /// Of a body in space, at the nodes that are corners of tetrahedra; `coefficients`: three numbers per node.
    pub fn in_space(model: &SpaceModel, coefficients: &[f64]) -> Self {
        let spatial = model.spatial();
        let gradients = mean_gradients(spatial.rule(), spatial.shares().len(), coefficients);
        let is_nodal = model.scene().discretization.method.integration.is_nodal();
        Self::of_cells(model.tissue(), &gradients).map(|of_cells| match is_nodal {
            true => of_cells.to_vec(),
            false => at_corners(spatial.positions(), spatial.tetrahedra(), of_cells),
        })
    }

    /// One value per cell, of these displacement gradients.
    fn of_cells(tissue: &Tissue, gradients: &[Matrix<3>]) -> Self {
        let stress = |(cell, h)| von_mises(&cauchy_stress(tissue, cell, h));
        Self {
            strain: gradients.iter().map(|h| green_lagrange(h).norm()).collect(),
            von_mises: tells_stress(tissue).then(|| gradients.iter().enumerate().map(stress).collect()),
        }
    }

    fn map(self, at_nodes: impl Fn(&[f64]) -> Vec<f64>) -> Self {
        Self { strain: at_nodes(&self.strain), von_mises: self.von_mises.map(|values| at_nodes(&values)) }
    }
}

/// A value of every tetrahedron at its corners: the mean of those around a node by their volume at rest.
fn at_corners(positions: &[Point<3>], tetrahedra: &[[u32; 4]], of_cells: &[f64]) -> Vec<f64> {
    let corners = tetrahedra.iter().flatten().max().map_or(0, |last| *last as usize + 1);
    let mut sums = vec![(0.0, 0.0); corners];
    for (tetrahedron, value) in tetrahedra.iter().zip(of_cells) {
        let [a, b, c, d] = tetrahedron.map(|node| positions[node as usize]);
        let volume = (b - a).cross(&(c - a)).dot(&(d - a)).abs() / 6.0;
        for node in tetrahedron {
            let (sum, weight) = &mut sums[*node as usize];
            *sum += value * volume;
            *weight += volume;
        }
    }
    means(sums)
}

/// Sums over their weights; 0 where nothing weighs.
fn means(sums: Vec<(f64, f64)>) -> Vec<f64> {
    sums.into_iter().map(|(sum, weight)| if weight > 0.0 { sum / weight } else { 0.0 }).collect()
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
    means(sums)
}

/// Whether a point is in a convex cell or on its rim, corners counter-clockwise.
fn is_in(corners: &[Point2], x: &Point2, tolerance: f64) -> bool {
    let edges = corners.iter().zip(corners.iter().cycle().skip(1));
    edges.into_iter().all(|(a, b)| cross(b - a, x - a) >= -tolerance * (b - a).norm())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::{Integration, Method, Resolution};
    use crate::geometry::box_of;
    use crate::placement::space::workflow;
    use crate::scene::Scene;
    use crate::scene::space::SpaceScene;

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

    /// In space, of every rule: stretched more and more along the needle, every node has the strain of its own place to a part of
    /// a cell, and 2 μ times it is the stress.
    #[test]
    fn every_node_in_space_has_the_strain_of_its_own_place() {
        let e = 1e-6;
        for rule in Integration::SPATIAL.iter().copied() {
            let mut scene = SpaceScene::bundled("block").unwrap().without_inclusions().with_method(Method::new(rule));
            scene.material = Law::linear(383.0, 318.5).unwrap();
            scene.discretization.resolution = Resolution::Level(0);
            let model = workflow::model(&scene).unwrap();
            let (low, high) = box_of(model.spatial().positions()).unwrap();
            let at = |x: &Point<3>| (x.z - low.z) / (high.z - low.z);
            let of = |x: &Point<3>| [0.0, 0.0, e * 0.5 * at(x) * at(x) * (high.z - low.z)];
            let coefficients: Vec<f64> = model.spatial().positions().iter().flat_map(of).collect();
            let fields = NodalFields::in_space(&model, &coefficients);
            let stresses = fields.von_mises.unwrap();
            let corners = model.spatial().tetrahedra().iter().flatten().max().unwrap() + 1;
            assert!(fields.strain.len() == corners as usize && stresses.len() == corners as usize, "{rule}");
            let inner = |x: &Point<3>| (0.3..0.7).contains(&at(x));
            for (node, x) in
                model.spatial().positions()[..corners as usize].iter().enumerate().filter(|(_, x)| inner(x))
            {
                let (strain, stress) = (fields.strain[node], stresses[node]);
                assert!((strain - e * at(x)).abs() < 0.06 * e, "{rule}: {strain} at {x:?}");
                assert!((stress - 2.0 * 318.5 * strain).abs() < 1.0 * e, "{rule}: {stress} of {strain}");
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
