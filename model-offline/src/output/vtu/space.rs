//! A body in space for ParaView.

use super::grid::{Array, Grid, Shape};
use super::{in_unit, known};
use crate::geometry::Point;
use crate::model::space::SpaceModel;
use crate::output::state::mean_gradients;

/// The body as a VTU file of tetrahedra, quadratic ones as such.
///
/// Displacement at every point. What else is known is that of elements per cell, that of nodal rules per point, whose cells are
/// around the nodes: Green–Lagrange strain and Cauchy stress as 3 × 3 tensors, their principal values from the largest down,
/// von Mises stress, det F, region (0: body, else the inclusion's place in the file) and material. Units are in the names.
///
/// `coefficients`: three numbers per node. ASCII, so that it can be read without ParaView too.
pub fn vtu_in_space(model: &SpaceModel, coefficients: &[f64]) -> String {
    let (scene, spatial) = (model.scene(), model.spatial());
    let middles = spatial.middles();
    let middle = |a: u32, b: u32| middles.get(&(a.min(b), a.max(b))).copied();
    let cell = |&corners: &[u32; 4]| {
        let edges = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]].map(|[i, j]| middle(corners[i], corners[j]));
        let between: Vec<u32> = edges.into_iter().flatten().collect();
        let shape = if between.is_empty() { Shape::Tetrahedron } else { Shape::QuadraticTetrahedron };
        (shape, corners.into_iter().chain(between).collect())
    };
    let positions: Vec<Point<3>> = spatial.positions().to_vec();
    let grid = Grid::of(positions, spatial.tetrahedra().iter().map(cell).collect());
    let moved = model.nodal_displacements(coefficients);
    let moved = moved.iter().flat_map(|u| <[f64; 3]>::from(*u)).collect();
    let displacement = Array::new(in_unit("displacement", &scene.length_unit), 3, moved);
    // The part that has most of a cell.
    let region = |shares: &std::collections::BTreeMap<u32, f64>| {
        shares.iter().max_by(|a, b| a.1.total_cmp(b.1)).map_or(0.0, |(part, _)| f64::from(*part))
    };
    let regions = spatial.shares().iter().map(region).collect();
    let gradients = mean_gradients(spatial.rule(), spatial.shares().len(), coefficients);
    let known = known(model.tissue(), regions, &gradients, true, &scene.stress_unit);
    if scene.discretization.method.integration.is_nodal() {
        let of_points: Vec<Array> = [displacement].into_iter().chain(known).collect();
        return grid.file(&of_points, &[]);
    }
    grid.file(&[displacement], &known)
}
