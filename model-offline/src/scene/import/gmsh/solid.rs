//! Tetrahedra of a Gmsh file and the groups that they are in.

use super::super::ImportError;
use super::mesh::Mesh;
use crate::geometry::Point;
use std::collections::{BTreeMap, HashMap, HashSet};

/// Tetrahedra of a file.
#[derive(Debug, Default)]
pub(in crate::scene) struct SolidMesh {
    /// Positions, in the file's unit of length.
    pub(in crate::scene) nodes: Vec<Point<3>>,
    /// Corners, as the file orders them.
    pub(in crate::scene) tetrahedra: Vec<[u32; 4]>,
    /// Physical groups by number, with their names and the tetrahedra in them; entities where the file has no groups.
    pub(in crate::scene) groups: BTreeMap<i64, (Option<String>, Vec<u32>)>,
    /// How many tetrahedra had nodes between their corners, which are left out.
    pub(in crate::scene) curved: usize,
    /// How many solid elements are no tetrahedra.
    pub(in crate::scene) others: usize,
}

/// Reads the tetrahedra of a mesh.
///
/// # Errors
/// [`ImportError`].
pub(in crate::scene) fn read(bytes: &[u8]) -> Result<SolidMesh, ImportError> {
    let mesh = Mesh::read(bytes)?;
    let mut solid =
        SolidMesh { curved: mesh.curved, others: mesh.solids - mesh.tetrahedra.len(), ..SolidMesh::default() };
    let is_2 = mesh.version == 2.2;
    let has_groups = is_2 || mesh.physical.keys().any(|(dimension, _)| *dimension == 3);
    let mut number: HashMap<u64, u32> = HashMap::new();
    let mut known: HashMap<[u32; 4], u32> = HashMap::new();
    let mut told = HashSet::new();
    for (corners, part) in &mesh.tetrahedra {
        let mut nodes = [0; 4];
        for (node, tag) in nodes.iter_mut().zip(corners) {
            let missing = || ImportError::Syntax { line: 0, what: format!("node {tag} is used and not given") };
            let x = mesh.nodes.get(tag).ok_or_else(missing)?;
            *node = *number.entry(*tag).or_insert_with(|| {
                solid.nodes.push(*x);
                solid.nodes.len() as u32 - 1
            });
        }
        // In version 2.2 an element stands in the file once for every group that it is in.
        let mut key = nodes;
        key.sort_unstable();
        let next = solid.tetrahedra.len() as u32;
        let t = *known.entry(key).or_insert(next);
        if t == next {
            solid.tetrahedra.push(nodes);
        }
        if !told.insert((t, *part)) || (!is_2 && t != next) {
            let [a, b, c, d] = corners;
            let what = format!("the tetrahedron of nodes {a}, {b}, {c} and {d} is in it twice");
            return Err(ImportError::Syntax { line: 0, what });
        }
        let groups: &[i64] = match mesh.physical.get(&(3, *part)) {
            Some(groups) if !is_2 => groups.as_slice(),
            None if !is_2 && has_groups => &[],
            _ => std::slice::from_ref(part),
        };
        for group in groups.iter().filter(|group| **group != 0) {
            let name = || (mesh.names.get(&(3, *group)).cloned(), Vec::new());
            let members = &mut solid.groups.entry(*group).or_insert_with(name).1;
            members.push(t);
        }
    }
    Ok(solid)
}
