//! ParaView's unstructured grid, one file.

use crate::material::{Material as _, Matrix, determinant, green_lagrange};
use crate::mechanics::assembly::displacement_gradient;
use crate::model::TissueModel;
use std::fmt::Write as _;

/// The body as a VTU file: the nodal cells as polygons over the nodes' cells, with displacement, Green–Lagrange strain,
/// Cauchy stress and det F per node (cell data) and the displacement per polygon corner's node.
///
/// `coefficients`: two numbers per node. ASCII, so that it can be read without ParaView too.
pub fn vtu(model: &TissueModel, coefficients: &[f64]) -> String {
    let mut points = String::new();
    let mut displacement = String::new();
    let (mut connectivity, mut offsets, mut types) = (String::new(), String::new(), String::new());
    let (mut strain, mut stress, mut det_f) = (String::new(), String::new(), String::new());
    let (mut count, mut cells) = (0, 0);
    let gradients = cell_gradients(model, coefficients);
    for (cell, h) in model.cells().iter().zip(&gradients) {
        let corners = cell.corners();
        for x in &corners {
            let u = model.displacement_at(x, coefficients);
            let _ = writeln!(points, "{:.9e} {:.9e} 0", x.x, x.y);
            let _ = writeln!(displacement, "{:.9e} {:.9e} 0", u.x, u.y);
            let _ = write!(connectivity, "{count} ");
            count += 1;
        }
        cells += 1;
        connectivity.push('\n');
        let _ = writeln!(offsets, "{count}");
        types.push_str("7\n");
        let e = green_lagrange(h);
        let _ = writeln!(strain, "{:.9e} {:.9e} {:.9e}", e[(0, 0)], e[(1, 1)], e[(0, 1)]);
        let _ = writeln!(det_f, "{:.9e}", determinant(&(Matrix::<2>::identity() + h)));
        let index = cells - 1;
        let sigma = model
            .tissue()
            .parts(index as u32)
            .fold(Matrix::<2>::zeros(), |sum, (material, factor)| sum + material.cauchy_stress(h) * factor);
        let _ = writeln!(stress, "{:.9e} {:.9e} {:.9e}", sigma[(0, 0)], sigma[(1, 1)], sigma[(0, 1)]);
    }
    let array = |name: &str, kind: &str, components: usize, content: &str| {
        format!(
            "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"ascii\">\n{content}</DataArray>\n"
        )
    };
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\">\n\
         <UnstructuredGrid>\n<Piece NumberOfPoints=\"{count}\" NumberOfCells=\"{cells}\">\n<Points>\n{}</Points>\n\
         <Cells>\n{}{}{}</Cells>\n<PointData Vectors=\"displacement\">\n{}</PointData>\n<CellData>\n{}{}{}</CellData>\n\
         </Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
        array("Points", "Float64", 3, &points),
        array("connectivity", "Int64", 1, &connectivity),
        array("offsets", "Int64", 1, &offsets),
        array("types", "UInt8", 1, &types),
        array("displacement", "Float64", 3, &displacement),
        array("green_lagrange_strain_xx_yy_xy", "Float64", 3, &strain),
        array("cauchy_stress_xx_yy_xy", "Float64", 3, &stress),
        array("det_f", "Float64", 1, &det_f),
    )
}

/// Displacement gradient of every cell: the average over its integration points.
pub(crate) fn cell_gradients(model: &TissueModel, coefficients: &[f64]) -> Vec<Matrix<2>> {
    let mut sums = vec![(Matrix::<2>::zeros(), 0.0); model.cells().len()];
    for (q, point) in model.rule().points().enumerate() {
        let (sum, weight) = &mut sums[point.cell as usize];
        *sum += displacement_gradient(model.rule(), q, coefficients) * point.weight;
        *weight += point.weight;
    }
    sums.into_iter().map(|(sum, weight)| sum / weight).collect()
}
