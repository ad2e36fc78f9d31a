//! Small geometry of meshes: volumes, and distances between neighbours.

use crate::discretization::meshing::TetMesh;
use crate::geometry::Point;

/// Edges of a tetrahedron, in the order of the middle nodes of a quadratic one.
pub const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];

/// Signed volume of a tetrahedron.
pub fn volume(nodes: &[Point<3>], t: &[u32; 4]) -> f64 {
    let [a, b, c, d] = t.map(|i| nodes[i as usize]);
    (b - a).cross(&(c - a)).dot(&(d - a)) / 6.0
}

/// For every node the farthest, in any one axis, of the nodes that it shares an edge with: on a cubic lattice the spacing,
/// whatever diagonals the cubes are cut along.
pub fn neighbour_distance(mesh: &TetMesh) -> Vec<f64> {
    let mut farthest = vec![0.0_f64; mesh.nodes.len()];
    for t in &mesh.tetrahedra {
        for [a, b] in EDGES {
            let (a, b) = (t[a] as usize, t[b] as usize);
            let distance = (mesh.nodes[a] - mesh.nodes[b]).amax();
            farthest[a] = farthest[a].max(distance);
            farthest[b] = farthest[b].max(distance);
        }
    }
    farthest
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A box cut by planes, every piece into six tetrahedra around a diagonal (Kuhn).
    pub(crate) fn of_planes(lines: &[Vec<f64>; 3], part: impl Fn(&Point<3>) -> u32) -> TetMesh {
        let n = [lines[0].len(), lines[1].len(), lines[2].len()];
        let at = |i: [usize; 3]| (i[0] + n[0] * (i[1] + n[1] * i[2])) as u32;
        let mut mesh = TetMesh::default();
        for k in 0..n[2] {
            for j in 0..n[1] {
                mesh.nodes.extend((0..n[0]).map(|i| Point::<3>::new(lines[0][i], lines[1][j], lines[2][k])));
            }
        }
        const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
        for k in 0..n[2] - 1 {
            for j in 0..n[1] - 1 {
                for i in 0..n[0] - 1 {
                    for (o, order) in ORDERS.into_iter().enumerate() {
                        let mut corner = [i, j, k];
                        let mut t = [at(corner); 4];
                        for (step, axis) in order.into_iter().enumerate() {
                            corner[axis] += 1;
                            t[step + 1] = at(corner);
                        }
                        if o >= 3 {
                            t.swap(2, 3);
                        }
                        let middle = t.iter().map(|&i| mesh.nodes[i as usize]).sum::<Point<3>>() / 4.0;
                        mesh.tetrahedra.push(t);
                        mesh.part.push(part(&middle));
                    }
                }
            }
        }
        mesh
    }

    pub(crate) fn even(count: usize) -> Vec<f64> {
        (0..=count).map(|i| i as f64 / count as f64).collect()
    }

    #[test]
    fn a_cut_box_is_full_and_closed() {
        let mesh = of_planes(&[even(3), even(2), even(4)], |_| 0);
        let volumes: Vec<f64> = mesh.tetrahedra.iter().map(|t| volume(&mesh.nodes, t)).collect();
        assert!(volumes.iter().all(|v| *v > 0.0) && (volumes.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        let boundary = mesh.boundary();
        assert_eq!(boundary.len(), 4 * (3 * 2 + 2 * 4 + 3 * 4));
        // Closed and oriented outwards: ∮ n = 0 and ∮ x·n = 3 V.
        let corner = |i: u32| mesh.nodes[i as usize];
        let area = |t: &[u32; 3]| (corner(t[1]) - corner(t[0])).cross(&(corner(t[2]) - corner(t[0]))) * 0.5;
        assert!(boundary.iter().map(area).sum::<Point<3>>().norm() < 1e-14);
        let flux: f64 = boundary.iter().map(|t| area(t).dot(&(corner(t[0]) + corner(t[1]) + corner(t[2]))) / 3.0).sum();
        assert!((flux - 3.0).abs() < 1e-13);
        assert_eq!(neighbour_distance(&mesh).iter().copied().fold(0.0, f64::max), 0.5);
    }
}
