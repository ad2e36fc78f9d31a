//! Constrained Delaunay triangulation of the nodes inside the outline: elements of the baselines, background cells of
//! the Gauss rule.

use crate::geometry::{Point2, Polygon, cross, distance_to_segment};
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, DelaunayTriangulation, Point2 as Site, Triangulation as _};
use std::collections::BTreeSet;

type Mesh = ConstrainedDelaunayTriangulation<Site<f64>>;

/// The nodes cannot be triangulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TriangulationError {
    /// A coordinate that is not finite, or too large or too small for exact predicates.
    #[error("the nodes cannot be triangulated: {0}")]
    Coordinate(spade::InsertionError),
    /// Two nodes at one point.
    #[error("the nodes cannot be triangulated: two nodes coincide")]
    Coincident,
    /// The triangles do not tile the body.
    #[error("the nodes cannot be triangulated: the nodes do not follow the outline: put nodes on every corner")]
    OffTheOutline,
}

/// Triangles (counter-clockwise node numbers) that tile the outline. Their edges follow the outlines of `inclusions`
/// wherever nodes lie on them.
///
/// # Errors
/// Nodes that coincide, or an outline that its nodes do not follow.
pub fn triangulate(
    nodes: &[Point2],
    outline: &Polygon,
    inclusions: &[Polygon],
) -> Result<Vec<[u32; 3]>, TriangulationError> {
    triangulate_along(nodes, outline, &inclusions.iter().flat_map(Polygon::edges).collect::<Vec<_>>())
}

/// The same with edges that follow straight `lines` wherever nodes lie on them.
///
/// # Errors
/// Nodes that coincide, or an outline that its nodes do not follow.
pub fn triangulate_along(
    nodes: &[Point2],
    outline: &Polygon,
    lines: &[(Point2, Point2)],
) -> Result<Vec<[u32; 3]>, TriangulationError> {
    let sites: Vec<Site<f64>> = nodes.iter().map(|x| Site::new(x.x, x.y)).collect();
    let tolerance = 1e-9 * outline.size();
    let outline_edges = edges_along(nodes, outline.edges(), tolerance);
    let mut mesh = Mesh::bulk_load_cdt(sites, outline_edges.clone()).map_err(TriangulationError::Coordinate)?;
    if mesh.num_vertices() != nodes.len() {
        return Err(TriangulationError::Coincident);
    }
    for [a, b] in edges_along(nodes, lines.iter().copied(), tolerance) {
        let (a, b) = (FixedVertexHandle::from_index(a), FixedVertexHandle::from_index(b));
        if mesh.can_add_constraint(a, b) {
            mesh.add_constraint(a, b);
        }
    }
    let is_outside = outside(&mesh, &outline_edges);
    let of_body = mesh.inner_faces().filter(|face| !is_outside[face.index()]);
    let triangles: Vec<[u32; 3]> = of_body.map(|face| face.vertices().map(|v| v.index() as u32)).collect();
    let area: f64 = triangles.iter().map(|t| area(nodes, t)).sum();
    if (area - outline.area()).abs() > 1e-6 * outline.area() {
        return Err(TriangulationError::OffTheOutline);
    }
    Ok(triangles)
}

/// Which faces can be reached from without and not across the outline, by their index. A node that lies a rounding inside of an
/// edge has a triangle between both; that is outside as well: as an element it would hold all three corners in line.
fn outside(mesh: &Mesh, outline_edges: &[[usize; 2]]) -> Vec<bool> {
    let outline: BTreeSet<[usize; 2]> = outline_edges.iter().map(|[a, b]| [*a.min(b), *a.max(b)]).collect();
    let mut is_outside = vec![false; mesh.num_all_faces()];
    let mut edges: Vec<_> = mesh.directed_edges().filter(|edge| edge.face().is_outer()).collect();
    while let Some(edge) = edges.pop() {
        let [a, b] = edge.vertices().map(|vertex| vertex.index());
        let Some(face) = edge.rev().face().as_inner() else { continue };
        if !is_outside[face.index()] && !outline.contains(&[a.min(b), a.max(b)]) {
            is_outside[face.index()] = true;
            edges.extend(face.adjacent_edges());
        }
    }
    is_outside
}

/// Delaunay neighbours of every node.
///
/// # Errors
/// Nodes that coincide.
pub fn neighbours(nodes: &[Point2]) -> Result<Vec<Vec<u32>>, TriangulationError> {
    let sites: Vec<Site<f64>> = nodes.iter().map(|x| Site::new(x.x, x.y)).collect();
    let mesh = DelaunayTriangulation::<Site<f64>>::bulk_load_stable(sites).map_err(TriangulationError::Coordinate)?;
    if mesh.num_vertices() != nodes.len() {
        return Err(TriangulationError::Coincident);
    }
    Ok(mesh.vertices().map(|v| v.out_edges().map(|e| e.to().index() as u32).collect()).collect())
}

/// Area of a triangle of nodes.
pub fn area(nodes: &[Point2], t: &[u32; 3]) -> f64 {
    let [a, b, c] = t.map(|i| nodes[i as usize]);
    0.5 * cross(b - a, c - a)
}

/// Pairs of nodes that follow each other along straight lines.
fn edges_along(nodes: &[Point2], lines: impl Iterator<Item = (Point2, Point2)>, tolerance: f64) -> Vec<[usize; 2]> {
    let mut edges = Vec::new();
    for (a, b) in lines {
        let mut on: Vec<(f64, usize)> = nodes
            .iter()
            .enumerate()
            .filter(|(_, x)| distance_to_segment(**x, a, b) <= tolerance)
            .map(|(i, x)| ((x - a).dot(&(b - a)), i))
            .collect();
        on.sort_by(|p, q| p.0.total_cmp(&q.0));
        edges.extend(on.windows(2).map(|w| [w[0].1, w[1].1]));
    }
    edges
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// A node on an edge lies a rounding inside of it: no triangle spans the edge beneath it, whose three corners would be held
    /// in line.
    #[test]
    fn a_node_that_is_nearly_on_an_edge_makes_no_sliver() {
        let corners = [[0.0, 0.0], [3.0, 1.0], [2.0, 4.0], [-1.0, 3.0]].map(Point2::from);
        let outline = Polygon::new(corners.to_vec()).unwrap();
        let (along, inwards) = (corners[1] - corners[0], Point2::new(-1.0, 3.0).normalize());
        for off in [0.0, 1e-15, 1e-12, 1e-10, 0.9e-9] {
            for part in [0.02, 0.5, 0.9] {
                let on = corners[0] + along * part + inwards * (off * outline.size());
                let nodes = [corners.to_vec(), vec![on, Point2::new(1.0, 2.0)]].concat();
                let triangles = triangulate(&nodes, &outline, &[]).unwrap();
                assert_eq!(triangles.len(), 5, "{off} {part}: {triangles:?}");
                assert!(triangles.iter().all(|t| area(&nodes, t) > 0.01), "{off} {part}: {triangles:?}");
            }
            // Several of them in a row, over one another as seen from outside.
            let row = (1..9).map(|i| corners[0] + along * (f64::from(i) / 9.0) + inwards * (off * outline.size()));
            let nodes: Vec<Point2> = corners.into_iter().chain(row).chain([Point2::new(1.0, 2.0)]).collect();
            let triangles = triangulate(&nodes, &outline, &[]).unwrap();
            assert!(triangles.len() == 12 && triangles.iter().all(|t| area(&nodes, t) > 0.01), "{off}: {triangles:?}");
        }
    }

    /// Inside of the body there is something on either side of a triangle, however thin: left out, it would leave a crack.
    #[test]
    fn thin_triangles_inside_of_the_body_leave_no_crack() {
        let outline =
            Polygon::new([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]].map(Point2::from).to_vec()).unwrap();
        for off in [0.0, 0.5e-9, 2e-9, 1e-8] {
            let [a, b, c] = [[1.0, 2.0], [2.0, 2.0 + off * outline.size()], [3.0, 2.0]].map(Point2::from);
            let nodes = [outline.vertices().to_vec(), vec![a, b, c]].concat();
            let triangles = triangulate_along(&nodes, &outline, &[(a, c), (a, b), (b, c)]).unwrap();
            let mut sides: BTreeMap<[u32; 2], usize> = BTreeMap::new();
            for [i, j, k] in &triangles {
                for (from, to) in [(i, j), (j, k), (k, i)] {
                    *sides.entry([*from.min(to), *from.max(to)]).or_default() += 1;
                }
            }
            let free: Vec<_> = sides.iter().filter(|side| *side.1 != 2).collect();
            assert!(free.len() == 4 && free.iter().all(|(ends, _)| ends[1] < 4), "{off}: {free:?}");
        }
    }
}
