//! Nodal cells of a mesh of tetrahedra, and the nodal rules on them.
//!
//! A node's cell is the barycentric dual: of every tetrahedron that it is a corner of, the quarter whose points are nearest to it in
//! barycentric coordinates. That quarter is bounded by six plane quadrilaterals: three inside the tetrahedron, between the
//! node and another corner (middle of their edge, centres of the two faces at it, centre of the tetrahedron), and three on
//! faces (node, middle, centre of the face, middle). Cells tile the body, and a cell that lies on the boundary has pieces of
//! the boundary among its quadrilaterals.
//!
//! Gradients are means over cells and quarters, from their boundaries: `(1/V) ∮ Ψ_I n dΓ` with one point in the centroid of
//! every quadrilateral. Linear fields are integrated exactly so, and neighbours cancel, because both take the same point;
//! that is what the patch test asks for.

use super::geometry::volume;
use crate::discretization::approximation::shape_functions::Wanted;
use crate::discretization::meshing::TetMesh;
use crate::discretization::quadrature::subcells::STABILISATION;
use crate::discretization::{Quadrature, ShapeError, ShapeFunctions, Stencil};
use crate::geometry::Point;
use crate::parallel;
use std::collections::BTreeMap;

/// The nodal cells of a mesh.
#[derive(Debug, Clone)]
pub struct DualCells<'m> {
    mesh: &'m TetMesh,
    /// Tetrahedra that every node is a corner of, one row after the other.
    starts: Vec<u32>,
    incident: Vec<u32>,
    volumes: Vec<f64>,
}

/// A cell's row of an integration rule.
struct Row {
    nodes: Vec<u32>,
    mean: Vec<Point<3>>,
    /// Weight and gradients of the quarters, one after the other.
    volumes: Vec<f64>,
    quarters: Vec<Point<3>>,
}

impl<'m> DualCells<'m> {
    /// The cells of a mesh.
    pub fn new(mesh: &'m TetMesh) -> Self {
        let mut starts = vec![0_u32; mesh.nodes.len() + 1];
        for &i in mesh.tetrahedra.iter().flatten() {
            starts[i as usize + 1] += 1;
        }
        (0..mesh.nodes.len()).for_each(|i| starts[i + 1] += starts[i]);
        let (mut fill, mut incident) = (starts.clone(), vec![0; 4 * mesh.tetrahedra.len()]);
        let mut volumes = vec![0.0; mesh.nodes.len()];
        for (cell, t) in mesh.tetrahedra.iter().enumerate() {
            for &i in t {
                incident[fill[i as usize] as usize] = cell as u32;
                fill[i as usize] += 1;
                volumes[i as usize] += 0.25 * volume(&mesh.nodes, t);
            }
        }
        Self { mesh, starts, incident, volumes }
    }

    /// Volumes of the cells.
    pub fn volumes(&self) -> &[f64] {
        &self.volumes
    }

    /// Shares of a cell that lie in each part of the mesh.
    pub fn shares(&self, node: usize) -> BTreeMap<u32, f64> {
        let mut shares = BTreeMap::new();
        for &cell in self.of(node) {
            let share = self.quarter_volume(cell as usize) / self.volumes[node];
            *shares.entry(self.mesh.part[cell as usize]).or_insert(0.0) += share;
        }
        shares
    }

    fn quarter_volume(&self, cell: usize) -> f64 {
        0.25 * volume(&self.mesh.nodes, &self.mesh.tetrahedra[cell])
    }

    fn of(&self, node: usize) -> &[u32] {
        &self.incident[self.starts[node] as usize..self.starts[node + 1] as usize]
    }

    /// SCNI with the variation of the gradient over the quarters of a cell given energy; see
    /// [`subcells`](crate::discretization::quadrature::subcells).
    ///
    /// # Errors
    /// [`ShapeError`] names the node in whose cell the moment matrix fails.
    pub fn scni_stabilised(&self, shape: &ShapeFunctions<'_, 3>) -> Result<Quadrature<3>, ShapeError> {
        let rows = self.rows(|node| {
            let row = self.row(shape, node)?;
            let n = row.nodes.len();
            let mut matrix = vec![0.0; n * (n + 1) / 2];
            for (volume, gradients) in row.volumes.iter().zip(row.quarters.chunks_exact(n)) {
                let variation: Vec<Point<3>> = gradients.iter().zip(&row.mean).map(|(k, l)| k - l).collect();
                let mut next = matrix.iter_mut();
                for (column, gj) in variation.iter().enumerate() {
                    for (gi, b) in variation[column..].iter().zip(&mut next) {
                        *b += STABILISATION * volume * gi.dot(gj);
                    }
                }
            }
            Ok((row, matrix))
        })?;
        let mut rule = Quadrature::default();
        for (node, (row, matrix)) in rows.into_iter().enumerate() {
            rule.push_stabilised((self.volumes[node], node), &row.nodes, &row.mean, &matrix);
        }
        Ok(rule)
    }

    /// Stabilised conforming nodal integration: the mean gradient over the cell.
    ///
    /// # Errors
    /// [`ShapeError`] names the node in whose cell the moment matrix fails.
    pub fn scni(&self, shape: &ShapeFunctions<'_, 3>) -> Result<Quadrature<3>, ShapeError> {
        let rows = self.rows(|node| self.row(shape, node))?;
        let mut rule = Quadrature::default();
        for (node, row) in rows.iter().enumerate() {
            rule.push(self.volumes[node], node, &row.nodes, &row.mean);
        }
        Ok(rule)
    }

    /// Modified SCNI: the law in every quarter.
    ///
    /// # Errors
    /// [`ShapeError`] names the node in whose cell the moment matrix fails.
    pub fn modified_scni(&self, shape: &ShapeFunctions<'_, 3>) -> Result<Quadrature<3>, ShapeError> {
        let rows = self.rows(|node| self.row(shape, node))?;
        let mut rule = Quadrature::default();
        for (node, row) in rows.iter().enumerate() {
            for (volume, gradients) in row.volumes.iter().zip(row.quarters.chunks_exact(row.nodes.len())) {
                rule.push(*volume, node, &row.nodes, gradients);
            }
        }
        Ok(rule)
    }

    /// Direct nodal integration: the gradient at the node.
    ///
    /// # Errors
    /// [`ShapeError`] names the node whose moment matrix fails.
    pub fn direct_nodal(&self, shape: &ShapeFunctions<'_, 3>) -> Result<Quadrature<3>, ShapeError> {
        let rows = self.rows(|node| {
            let (mut candidates, mut stencil) = (Vec::new(), Stencil::default());
            let x = shape.cloud().positions()[node];
            shape.cloud().covering(&x, &x, &mut candidates);
            shape.evaluate(&x, node, &candidates, Wanted::GRADIENTS, &mut stencil)?;
            Ok(stencil)
        })?;
        let mut rule = Quadrature::default();
        for (node, stencil) in rows.iter().enumerate() {
            rule.push(self.volumes[node], node, &stencil.nodes, &stencil.gradients);
        }
        Ok(rule)
    }

    fn rows<T: Send>(&self, row: impl Fn(usize) -> Result<T, ShapeError> + Sync + Send) -> Result<Vec<T>, ShapeError> {
        parallel::map(self.mesh.nodes.len(), parallel::available(), row).into_iter().collect()
    }

    /// Mean gradients over the cell of a node and over its quarters.
    fn row(&self, shape: &ShapeFunctions<'_, 3>, node: usize) -> Result<Row, ShapeError> {
        let quarters: Vec<Quarter> = self.of(node).iter().map(|&cell| self.quarter(node, cell as usize)).collect();
        let x = self.mesh.nodes[node];
        let corners = quarters.iter().flat_map(|q| q.corners);
        let (low, high) = corners.fold((x, x), |(low, high), c| (low.inf(&c), high.sup(&c)));
        let mut candidates = Vec::new();
        shape.cloud().covering(&low, &high, &mut candidates);
        let n = candidates.len();
        let mut sums = vec![Point::<3>::zeros(); quarters.len() * n];
        let mut stencil = Stencil::default();
        // A face between two tetrahedra is one quadrilateral for both.
        let mut on_faces: BTreeMap<[u32; 2], (Vec<u32>, Vec<f64>)> = BTreeMap::new();
        for (quarter, sum) in quarters.iter().zip(sums.chunks_exact_mut(n.max(1))) {
            for side in &quarter.sides {
                if let Some((nodes, values)) = side.face.and_then(|face| on_faces.get(&face)) {
                    add(sum, &candidates, nodes, values, &side.area);
                    continue;
                }
                shape.evaluate(&side.centroid, node, &candidates, Wanted::VALUES, &mut stencil)?;
                add(sum, &candidates, &stencil.nodes, &stencil.values, &side.area);
                if let Some(face) = side.face {
                    on_faces.insert(face, (stencil.nodes.clone(), stencil.values.clone()));
                }
            }
        }
        let used: Vec<usize> =
            (0..n).filter(|i| sums.iter().skip(*i).step_by(n).any(|g| *g != Point::<3>::zeros())).collect();
        let volumes: Vec<f64> = quarters.iter().map(|q| q.volume).collect();
        let total = |place: usize| sums.iter().skip(place).step_by(n).sum::<Point<3>>();
        let gradients = |q: usize| used.iter().map(move |&i| (q, i)).map(|(q, i)| sums[q * n + i] / volumes[q]);
        Ok(Row {
            nodes: used.iter().map(|&i| candidates[i]).collect(),
            mean: used.iter().map(|&i| total(i) / self.volumes[node]).collect(),
            quarters: (0..quarters.len()).flat_map(gradients).collect(),
            volumes: volumes.clone(),
        })
    }

    /// The quarter of tetrahedron `cell` that belongs to a node.
    fn quarter(&self, node: usize, cell: usize) -> Quarter {
        let (nodes, mut t) = (&self.mesh.nodes, self.mesh.tetrahedra[cell]);
        // The node first, by an even permutation.
        let place = t.iter().position(|&i| i as usize == node).unwrap_or(0);
        match place {
            0 => {}
            _ => {
                t.swap(0, place);
                let rest: Vec<usize> = (1..4).filter(|&k| k != place).collect();
                t.swap(rest[0], rest[1]);
            }
        }
        let [a, b, c, d] = t.map(|i| nodes[i as usize]);
        let (ab, ac, ad) = ((a + b) * 0.5, (a + c) * 0.5, (a + d) * 0.5);
        let (abc, acd, adb) = ((a + b + c) / 3.0, (a + c + d) / 3.0, (a + d + b) / 3.0);
        let centre = (a + b + c + d) * 0.25;
        let face = |i: usize, j: usize| Some([t[i].min(t[j]), t[i].max(t[j])]);
        Quarter {
            volume: self.quarter_volume(cell),
            corners: [ab, ac, ad, abc, acd, adb, centre],
            sides: [
                Side::new([ab, abc, centre, adb], None),
                Side::new([ac, acd, centre, abc], None),
                Side::new([ad, adb, centre, acd], None),
                Side::new([a, ac, abc, ab], face(1, 2)),
                Side::new([a, ad, acd, ac], face(2, 3)),
                Side::new([a, ab, adb, ad], face(1, 3)),
            ],
        }
    }
}

/// What a node has of one tetrahedron.
struct Quarter {
    volume: f64,
    corners: [Point<3>; 7],
    sides: [Side; 6],
}

/// A plane quadrilateral.
struct Side {
    centroid: Point<3>,
    /// Outward normal, times the area.
    area: Point<3>,
    /// The two other corners of the face that it lies on.
    face: Option<[u32; 2]>,
}

impl Side {
    /// `corners` run counter-clockwise as seen from outside.
    fn new([a, b, c, d]: [Point<3>; 4], face: Option<[u32; 2]>) -> Self {
        let (first, second) = ((b - a).cross(&(c - a)) * 0.5, (c - a).cross(&(d - a)) * 0.5);
        let (one, two) = (first.norm(), second.norm());
        let centroid = ((a + b + c) * one + (a + c + d) * two) / (3.0 * (one + two));
        Self { centroid, area: first + second, face }
    }
}

/// Adds values times the area of a side to the candidates' sums.
fn add(sums: &mut [Point<3>], candidates: &[u32], nodes: &[u32], values: &[f64], area: &Point<3>) {
    let mut at = 0;
    for (i, value) in nodes.iter().zip(values) {
        while candidates[at] != *i {
            at += 1;
        }
        sums[at] += area * *value;
    }
}
