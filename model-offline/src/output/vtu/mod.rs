//! ParaView's unstructured grids: the body with everything that is known in it, needle, paddles and target beside it, and a
//! script that shows both.

mod grid;
mod parts;
mod script;
mod space;

pub use parts::{parts, parts_in_space};
pub use script::{Shown, Sight, script};
pub use space::vtu_in_space;

use self::grid::{Array, Grid, Shape};
use crate::discretization::Integration;
use crate::geometry::Point2;
use crate::material::{Law, Matrix, determinant, green_lagrange};
use crate::mechanics::Tissue;
use crate::model::TissueModel;
use crate::output::state::{cauchy_stress, cell_gradients, has_stress, in_space, von_mises};

/// The body as a VTU file, cells connected: nodal cells as polygons, elements as triangles, quadratic ones as such.
///
/// Displacement at every point; per cell the Green–Lagrange strain and the Cauchy stress as 3 × 3 tensors (row by row; plane
/// strain has stress out of its plane), their principal values from the largest down, von Mises stress, det F, region (0:
/// body, else the inclusion's place in the file) and material (the place of the law in the tissue). Units are in the names.
/// Stress is left out where the displacement does not tell it: in tissue that relaxes, and of laws that are known in
/// the plane alone.
///
/// `coefficients`: two numbers per node. ASCII, so that it can be read without ParaView too.
pub fn vtu(model: &TissueModel, coefficients: &[f64]) -> String {
    let scene = model.scene();
    let mut grid = Grid::new(scene.outline.size());
    for cell in model.cells() {
        push(&mut grid, model.scene().discretization.method.integration, &cell.corners());
    }
    let moved = grid.points().iter().flat_map(|x| {
        let u = model.displacement_at(x, coefficients);
        [u.x, u.y, 0.0]
    });
    let displacement = Array::new(in_unit("displacement", &scene.length_unit), 3, moved.collect());
    grid.file(&[displacement], &of_cells(model, &cell_gradients(model, coefficients)))
}

fn push(grid: &mut Grid<2>, integration: Integration, corners: &[Point2]) {
    match (integration, corners) {
        (Integration::FemT3, [_, _, _]) => grid.push(Shape::Triangle, corners),
        (Integration::FemT6, &[a, b, c]) => {
            grid.push(Shape::QuadraticTriangle, &[a, b, c, (a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5]);
        }
        _ => grid.push(Shape::Polygon, corners),
    }
}

/// What is known of every cell.
fn of_cells(model: &TissueModel, gradients: &[Matrix<2>]) -> Vec<Array> {
    let scene = model.scene();
    let inclusion_at = |x: &Point2| scene.inclusions.iter().rposition(|inclusion| inclusion.outline.contains(*x));
    let regions = model.cells().iter().map(|cell| inclusion_at(&cell.centroid()).map_or(0.0, |i| (i + 1) as f64));
    let gradients: Vec<Matrix<3>> = gradients.iter().map(in_space).collect();
    known(model.tissue(), regions.collect(), &gradients, has_stress(model), &scene.stress_unit)
}

/// What displacement gradients tell of cells of these regions.
fn known(tissue: &Tissue, regions: Vec<f64>, gradients: &[Matrix<3>], has_stress: bool, unit: &str) -> Vec<Array> {
    let laws = tissue.laws();
    let place_of = |law: &Law| laws.iter().position(|known| std::ptr::eq(known, law)).unwrap_or(0) as f64;
    // The law with most of the stiffness where a cell has several.
    let stiffest = |cell: usize| tissue.parts(cell as u32).max_by(|a, b| a.1.total_cmp(&b.1));
    let materials = (0..gradients.len()).map(|cell| stiffest(cell).map_or(0.0, |(law, _)| place_of(law)));
    let strains: Vec<Matrix<3>> = gradients.iter().map(green_lagrange).collect();
    let det_f = gradients.iter().map(|h| determinant(&(Matrix::<3>::identity() + h)));
    let mut arrays = vec![
        Array::counts("region", regions),
        Array::counts("material", materials.collect()),
        Array::new("green_lagrange_strain".to_owned(), 9, rows(&strains)),
        Array::new("principal_strain".to_owned(), 3, strains.iter().flat_map(principal).collect()),
        Array::new("det_f".to_owned(), 1, det_f.collect()),
    ];
    if has_stress {
        let stress = |(cell, h)| cauchy_stress(tissue, cell, h);
        let stresses: Vec<Matrix<3>> = gradients.iter().enumerate().map(stress).collect();
        let named = |name| in_unit(name, unit);
        arrays.extend([
            Array::new(named("cauchy_stress"), 9, rows(&stresses)),
            Array::new(named("principal_stress"), 3, stresses.iter().flat_map(principal).collect()),
            Array::new(named("von_mises_stress"), 1, stresses.iter().map(von_mises).collect()),
        ]);
    }
    arrays
}

fn rows(tensors: &[Matrix<3>]) -> Vec<f64> {
    tensors.iter().flat_map(|t| t.transpose().as_slice().to_vec()).collect()
}

/// Principal values of a symmetric tensor, the largest first.
fn principal(tensor: &Matrix<3>) -> [f64; 3] {
    let mut values: [f64; 3] = tensor.symmetric_eigenvalues().into();
    values.sort_by(|a, b| b.total_cmp(a));
    values
}

/// A name with its unit.
fn in_unit(name: &str, unit: &str) -> String {
    if unit == "1" || unit.is_empty() { name.to_owned() } else { format!("{name} [{unit}]") }
}

#[cfg(test)]
mod tests;
