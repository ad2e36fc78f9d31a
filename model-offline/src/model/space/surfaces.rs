//! What of a body is seen: its outside, the patches on it, and the surfaces of its inclusions.

use super::SpaceModel;
use super::patches::Surface;
use crate::discretization::TetMesh;
use crate::geometry::{Implicit, Point};
use std::collections::BTreeMap;

/// Triangles of the model's mesh, as numbers of its nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Surfaces {
    /// The outside, outwards by the right-hand rule.
    pub outside: Vec<[u32; 3]>,
    /// What of it cannot move.
    pub immobile: Vec<[u32; 3]>,
    /// What of it moves with the needle.
    pub needle: Vec<[u32; 3]>,
    /// What of it moves with each of the scene's paddles.
    pub paddles: Vec<Vec<[u32; 3]>>,
    /// Per inclusion of the scene its whole surface, outwards, where it meets the outside too.
    pub inclusions: Vec<Vec<[u32; 3]>>,
    /// Per tetrahedron: 0 in the body, 1 + i in inclusion i.
    pub parts: Vec<u32>,
}

impl Surfaces {
    /// Those of a model. Of nodal rules, which inclusion a tetrahedron is in is what the scene says of its middle.
    pub fn new(model: &SpaceModel) -> Self {
        let (scene, spatial) = (model.scene(), model.spatial());
        let (nodes, tetrahedra) = (spatial.positions(), spatial.tetrahedra());
        let holds = |corners: &[u32; 4]| {
            let middle = corners.iter().map(|&node| nodes[node as usize]).sum::<Point<3>>() / 4.0;
            let holds = scene.inclusions.iter().rposition(|inclusion| inclusion.region.level(&middle) < 0.0);
            holds.map_or(0, |place| 1 + place as u32)
        };
        let parts: Vec<u32> = if spatial.method().integration.is_nodal() {
            tetrahedra.iter().map(holds).collect()
        } else {
            // Parts that the scene has no inclusion for are the body's.
            let known = |shares: &BTreeMap<u32, f64>| shares.keys().next().copied().unwrap_or(0);
            let last = scene.inclusions.len() as u32;
            spatial.shares().iter().map(known).map(|part| if part > last { 0 } else { part }).collect()
        };
        let mesh = TetMesh { nodes: nodes.to_vec(), tetrahedra: tetrahedra.to_vec(), part: parts.clone() };
        let surface = Surface::new(&mesh, scene.size());
        let immobile: Vec<&dyn Implicit> = scene.immobile.iter().map(|region| region as _).collect();
        Self {
            immobile: surface.patch(&immobile),
            needle: surface.patch(&[&scene.needle.region]),
            paddles: scene.paddles.iter().map(|paddle| surface.patch(&[&paddle.region])).collect(),
            inclusions: (1..=scene.inclusions.len() as u32).map(|part| boundary_of(&mesh, part)).collect(),
            outside: surface.triangles().to_vec(),
            parts,
        }
    }
}

/// The boundary of a part of a mesh, outwards.
fn boundary_of(mesh: &TetMesh, part: u32) -> Vec<[u32; 3]> {
    let of_part = mesh.tetrahedra.iter().zip(&mesh.part).filter(|(_, of)| **of == part);
    let tetrahedra: Vec<[u32; 4]> = of_part.map(|(corners, _)| *corners).collect();
    TetMesh { nodes: Vec::new(), part: vec![part; tetrahedra.len()], tetrahedra }.boundary()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::placement::space::workflow::coarse;
    use crate::scene::space::SpaceScene;

    /// Volume inside of outward triangles, by the divergence theorem; and whether every edge is run once each way.
    fn enclosed(nodes: &[Point<3>], triangles: &[[u32; 3]]) -> (f64, bool) {
        let corner = |node: u32| nodes[node as usize];
        let sixth = |[a, b, c]: &[u32; 3]| corner(*a).dot(&corner(*b).cross(&corner(*c))) / 6.0;
        let mut runs: BTreeMap<(u32, u32), i32> = BTreeMap::new();
        for t in triangles {
            for k in 0..3 {
                let (from, to) = (t[k], t[(k + 1) % 3]);
                *runs.entry((from.min(to), from.max(to))).or_default() += if from < to { 1 } else { -1 };
            }
        }
        (triangles.iter().map(sixth).sum(), runs.values().all(|sum| *sum == 0))
    }

    /// The unit cube of `block` with its box: closed, outward, and as large as they are said to be.
    #[test]
    fn the_outside_is_closed_and_outward_and_so_are_inclusions() {
        let model = coarse(&SpaceScene::bundled("block").unwrap()).unwrap();
        let (surfaces, nodes) = (Surfaces::new(&model), model.spatial().positions());
        let (volume, closed) = enclosed(nodes, &surfaces.outside);
        assert!(closed && (volume - 1.0).abs() < 1e-9, "{volume}");
        let (volume, closed) = enclosed(nodes, &surfaces.inclusions[0]);
        let of_elements: f64 =
            surfaces.parts.iter().zip(model.spatial().volumes()).filter(|(part, _)| **part == 1).map(|(_, v)| v).sum();
        assert!(closed && (volume - of_elements).abs() < 1e-9 && volume > 0.0, "{volume} {of_elements}");
        assert!((volume - 0.1 * 0.2 * 0.1).abs() < 1e-9, "a box of 0.1 × 0.2 × 0.1: {volume}");
    }

    /// Patches are of the outside, and lie where the scene says.
    #[test]
    fn patches_are_parts_of_the_outside() {
        let model = coarse(&SpaceScene::bundled("scan").unwrap()).unwrap();
        let (surfaces, scene) = (Surfaces::new(&model), model.scene());
        let all = surfaces.paddles.iter().chain([&surfaces.needle, &surfaces.immobile]);
        for patch in all {
            assert!(!patch.is_empty() && patch.iter().all(|triangle| surfaces.outside.contains(triangle)));
        }
        for (place, patch) in surfaces.paddles.iter().enumerate() {
            let mut nodes: Vec<u32> = patch.iter().flatten().copied().collect();
            nodes.sort_unstable();
            nodes.dedup();
            assert_eq!(nodes, model.paddle_nodes(place), "paddle {}", scene.paddles[place].index);
        }
    }
}
