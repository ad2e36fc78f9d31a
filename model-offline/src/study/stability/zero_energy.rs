//! Deformations that a rule does not feel: eigenvalues of the unconstrained tangent at rest, and the energy of
//! displacements that alternate from node to node.

use super::plan::{self, Experiment};
use super::setting::Setting;
use super::{bloch, probe};
use crate::discretization::cells::triangulation::triangulate;
use crate::discretization::quadrature::finite_element::Elements;
use crate::discretization::quadrature::integration;
use crate::discretization::{
    Basis, Consistency, DiscretizationError, Integration, NodalCell, NodeCloud, Quadrature, ShapeFunctions,
};
use crate::geometry::Point2;
use crate::material::{Material as _, Tensor4};
use crate::model::ModelError;
use crate::scene::Scene;
use nalgebra::{DMatrix, DVector, Matrix2};

/// Eigenvalues below this share of the largest count as zero.
const ZERO: f64 = 1e-10;

/// What one method feels of deformations that alternate from node to node, on the scene's homogeneous body, nothing constrained.
///
/// On a regular lattice the checkerboard is symmetric about every node of the interior: its gradient vanishes at the node
/// (DNI) and its mean vanishes over the nodal cell (SCNI), so that neither feels it there, and only the boundary keeps it
/// from being free. NSNI feels the variation of the gradient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ZeroEnergy {
    /// Method.
    pub integration: Integration,
    /// Node jitter over spacing.
    pub jitter: f64,
    /// Nodes.
    pub nodes: usize,
    /// Zero eigenvalues of the unconstrained tangent; the three rigid motions are right.
    pub zero_modes: usize,
    /// Energy of the checkerboard displacement over that of one sine wave over the body with the same ‖d‖.
    pub checkerboard_over_smooth: f64,
    /// Energy of the checkerboard displacement over the energy that the same field has when integrated accurately.
    pub checkerboard_energy_ratio: f64,
    /// The same, in the cells that are far enough from the boundary not to feel it; not a number when there are none.
    pub interior_energy_ratio: f64,
    /// The least share of its energy, integrated accurately, that the rule gives to any deformation.
    pub least_energy_ratio: f64,
    /// The same for any wave on an unbounded lattice, where no boundary helps (see [`bloch`]): 0 is a ghost mode.
    pub bloch_share: f64,
}

/// A method that cannot be measured on some nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Unmeasured {
    /// Method.
    pub integration: Integration,
    /// Node jitter over spacing.
    pub jitter: f64,
    /// Why there is no model.
    pub error: ModelError,
}

/// Measures every method at a spacing, on a regular lattice and with nodes jittered by 40 %; and which have no model there.
pub fn measure(scene: &Scene, spacing: f64) -> (Vec<ZeroEnergy>, Vec<Unmeasured>) {
    let setting = &Setting::from(scene);
    let (mut measured, mut not) = (Vec::new(), Vec::new());
    for jitter in [0.0, 0.4] {
        for &integration in Integration::PLANAR {
            match measure_one(scene, &Experiment { jitter, ..plan::base(setting, integration, spacing) }) {
                Ok(found) => measured.push(found),
                Err(error) => not.push(Unmeasured { integration, jitter, error }),
            }
        }
    }
    (measured, not)
}

fn measure_one(scene: &Scene, experiment: &Experiment) -> Result<ZeroEnergy, ModelError> {
    let (integration, spacing) = (experiment.method.integration, experiment.spacing);
    let model = probe::model(scene, experiment)?;
    // The lattice before it was jittered: what the checkerboard alternates on.
    let lattice = probe::model(scene, &Experiment { jitter: 0.0, ..*experiment })?.positions().to_vec();
    let law = scene.material.tangent(&Matrix2::zeros());
    let everywhere = |_: u32| true;
    let stiffness = dense_tangent(model.rule(), &law, model.nodes(), &everywhere);
    // Elements are integrated exactly by their own rule.
    let accurate = match !integration.is_element() {
        true => Some(accurate_rule(scene, model.positions(), experiment)?),
        false => None,
    };
    let exact = match &accurate {
        Some((rule, _)) => dense_tangent(rule, &law, model.nodes(), &everywhere),
        None => stiffness.clone(),
    };
    // Quadratic triangles have nodes at half the spacing.
    let pitch = if integration == Integration::FemT6 { 0.5 * spacing } else { spacing };
    let (low, high) = scene.outline.bounds();
    let extent = (high - low).max();
    let even = |x: &Point2| {
        let steps = (x - low) / pitch;
        (steps.x.round() + steps.y.round()).rem_euclid(2.0) == 0.0
    };
    let checkerboard: Vec<f64> = lattice.iter().map(|x| if even(x) { 1.0 } else { -1.0 }).collect();
    let smooth: Vec<f64> = lattice
        .iter()
        .map(|x| {
            let phase = (x - low) * (std::f64::consts::TAU / extent);
            phase.x.sin() * phase.y.sin()
        })
        .collect();
    let interior_energy_ratio = accurate.as_ref().map_or(1.0, |(rule, cells)| {
        // Cells in which no kernel feels the boundary.
        let clear = experiment.method.support * spacing - 1e-9 * extent;
        let inside = |cells: &[NodalCell]| -> Vec<bool> {
            cells.iter().map(|c| c.corners().iter().all(|x| scene.outline.distance_to_boundary(*x) >= clear)).collect()
        };
        let per_area = |rule: &Quadrature<2>, cells: &[NodalCell]| {
            let inside = inside(cells);
            let area: f64 = cells.iter().zip(&inside).filter(|c| *c.1).map(|c| c.0.area).sum();
            energy(&dense_tangent(rule, &law, model.nodes(), &|c| inside[c as usize]), &checkerboard) / area
        };
        per_area(model.rule(), model.cells()) / per_area(rule, cells)
    });
    let eigenvalues = stiffness.clone().symmetric_eigenvalues();
    let zero = ZERO * eigenvalues.max();
    Ok(ZeroEnergy {
        integration,
        jitter: experiment.jitter,
        nodes: model.nodes(),
        zero_modes: eigenvalues.iter().filter(|v| v.abs() <= zero).count(),
        checkerboard_over_smooth: energy(&stiffness, &checkerboard) / energy(&stiffness, &smooth),
        checkerboard_energy_ratio: energy(&stiffness, &checkerboard) / energy(&exact, &checkerboard),
        interior_energy_ratio,
        bloch_share: bloch::least_share(integration, experiment.method.support, &scene.material)?.share,
        least_energy_ratio: if !integration.is_element() { least_share(&stiffness, &exact) } else { 1.0 },
    })
}

/// ½ dᵀKd / ‖d‖², for the field along x plus the field along y.
fn energy(k: &DMatrix<f64>, field: &[f64]) -> f64 {
    (0..2)
        .map(|axis| {
            let d = DVector::from_fn(k.nrows(), |u, _| if u % 2 == axis { field[u / 2] } else { 0.0 });
            0.5 * d.dot(&(k * &d)) / d.norm_squared()
        })
        .sum()
}

/// Six Gauss points in every triangle of the nodes, for the same kernels, and the triangles.
fn accurate_rule(
    scene: &Scene,
    nodes: &[Point2],
    experiment: &Experiment,
) -> Result<(Quadrature<2>, Vec<NodalCell>), ModelError> {
    let cloud = NodeCloud::new(nodes.to_vec(), vec![experiment.spacing * experiment.method.support; nodes.len()]);
    let shape = ShapeFunctions::new(&cloud, experiment.method.basis);
    let triangles = triangulate(nodes, &scene.outline, &[]).map_err(DiscretizationError::from)?;
    let cells = Elements::linear(nodes.to_vec(), triangles.clone()).cells();
    Ok((integration::gauss(&shape, &triangles, &cells, Basis::Quadratic, Consistency::Uncorrected)?, cells))
}

/// K_IJ = Σ_q w_q g_I · A · g_J, and the rule's stabilisation, over the points of the cells that are wanted, 2 × 2 blocks.
fn dense_tangent(rule: &Quadrature<2>, a: &Tensor4<2>, nodes: usize, wanted: &dyn Fn(u32) -> bool) -> DMatrix<f64> {
    let mut k = DMatrix::zeros(2 * nodes, 2 * nodes);
    for point in rule.points().filter(|p| wanted(p.cell)) {
        for (row, (&i, gi)) in point.nodes.iter().zip(point.gradients).enumerate() {
            for (column, (&j, gj)) in point.nodes.iter().zip(point.gradients).enumerate() {
                let stabilisation = a[0][1][0][1] * point.stabilisation_entry(row, column);
                for (r, c) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    let block: f64 = (0..2)
                        .flat_map(|m| (0..2).map(move |n| (m, n)))
                        .map(|(m, n)| gi[m] * a[r][m][c][n] * gj[n])
                        .sum();
                    let same = if r == c { stabilisation } else { 0.0 };
                    k[(2 * i as usize + r, 2 * j as usize + c)] += point.weight * block + same;
                }
            }
        }
    }
    k
}

/// The smallest xᵀKx / xᵀK₀x over all x that are no rigid motion.
fn least_share(k: &DMatrix<f64>, exact: &DMatrix<f64>) -> f64 {
    let modes = exact.clone().symmetric_eigen();
    let zero = ZERO * modes.eigenvalues.max();
    let kept: Vec<usize> = (0..modes.eigenvalues.len()).filter(|i| modes.eigenvalues[*i] > zero).collect();
    let mut basis = modes.eigenvectors.select_columns(&kept);
    for (mut column, i) in basis.column_iter_mut().zip(&kept) {
        column /= modes.eigenvalues[*i].sqrt();
    }
    (basis.transpose() * k * basis).symmetric_eigenvalues().min()
}
