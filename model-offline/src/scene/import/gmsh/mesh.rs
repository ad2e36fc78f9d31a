//! Nodes, elements and groups of a Gmsh file, versions 2.2 and 4.1, ASCII and binary.

use super::super::ImportError;
use super::input::Input;
use crate::geometry::Point;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Numbers of nodes of element types 1 to 31, as Gmsh's manual lists them.
const NODES: [u8; 31] =
    [2, 3, 4, 4, 8, 6, 5, 3, 6, 9, 10, 27, 18, 14, 1, 8, 20, 15, 13, 9, 10, 12, 15, 15, 21, 4, 5, 6, 20, 35, 56];
const LINES: [i64; 5] = [1, 8, 26, 27, 28];
const TRIANGLES: [i64; 8] = [2, 9, 20, 21, 22, 23, 24, 25];
const QUADRANGLES: [i64; 3] = [3, 10, 16];
const TETRAHEDRA: [i64; 5] = [4, 11, 29, 30, 31];
const POINT: i64 = 15;

fn nodes_of(kind: i64) -> Option<usize> {
    match kind {
        1..=31 => Some(NODES[kind as usize - 1].into()),
        92 => Some(64),
        93 => Some(125),
        _ => None,
    }
}

/// Elements of a dimension that belong together: by a named physical group, or else by what the version of the format
/// tells apart.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Group {
    Named(String),
    Tag(i64),
}

/// Corners of elements by group.
pub(super) type Elements = BTreeMap<Group, Vec<Vec<u64>>>;

#[derive(Default)]
pub(super) struct Mesh {
    pub(super) version: f64,
    pub(super) nodes: HashMap<u64, Point<3>>,
    /// By dimension: points, lines, surfaces.
    pub(super) elements: [Elements; 3],
    /// Elements that are no part of a plane.
    pub(super) solids: usize,
    /// Tetrahedra among them: corners, and what tells where they belong to, a physical group in version 2.2 and an entity in
    /// 4.1.
    pub(super) tetrahedra: Vec<([u64; 4], i64)>,
    /// How many of these have nodes between their corners.
    pub(super) curved: usize,
    /// Lowest and highest z.
    pub(super) z: Option<[f64; 2]>,
    /// Dimensions and numbers of what is listed as an entity.
    entities: BTreeSet<(i64, i64)>,
    /// Names of physical groups, by dimension and number.
    pub(super) names: BTreeMap<(i64, i64), String>,
    /// Physical groups of entities, by dimension and number.
    pub(super) physical: BTreeMap<(i64, i64), Vec<i64>>,
}

impl Mesh {
    pub(super) fn read(bytes: &[u8]) -> Result<Self, ImportError> {
        let mut input = Input::new(bytes);
        let mut mesh = Self::default();
        while let Some(section) = input.section() {
            let is_2 = mesh.version == 2.2;
            match section.as_str() {
                "MeshFormat" => mesh.format(&mut input)?,
                "PhysicalNames" => mesh.physical_names(&mut input)?,
                "Nodes" | "Elements" | "Entities" if mesh.version == 0.0 => {
                    return Err(input.wrong(format!("${section} comes before $MeshFormat")));
                }
                "Entities" if !is_2 => mesh.entities(&mut input)?,
                "Nodes" if is_2 => mesh.nodes_2(&mut input)?,
                "Nodes" => mesh.nodes_4(&mut input)?,
                "Elements" if is_2 => mesh.elements_2(&mut input)?,
                "Elements" => mesh.elements_4(&mut input)?,
                "PartitionedEntities" => {
                    return Err(ImportError::Unsupported("the mesh is partitioned: save it without partitions".into()));
                }
                // Ends of sections, and sections that tell nothing of a scene.
                _ => continue,
            }
            input.closes(&section)?;
        }
        Ok(mesh)
    }

    fn format(&mut self, input: &mut Input<'_>) -> Result<(), ImportError> {
        self.version = input.number()?;
        let kind = input.int()?;
        if self.version != 2.2 && self.version != 4.1 {
            return Err(ImportError::Unsupported(format!(
                "mesh format {}: save it as version 2.2 or 4.1 (gmsh -format msh2)",
                self.version
            )));
        }
        let bytes = input.int()?;
        if bytes != 8 {
            return Err(ImportError::Unsupported(format!("numbers of {bytes} bytes: save the mesh with 8")));
        }
        if kind == 1 {
            input.line();
            input.binary = true;
            input.order_of_bytes()?;
        } else if kind != 0 {
            return Err(input.wrong(format!("a mesh is ASCII (0) or binary (1), not {kind}")));
        }
        Ok(())
    }

    /// Text, in binary files too.
    fn physical_names(&mut self, input: &mut Input<'_>) -> Result<(), ImportError> {
        let binary = std::mem::replace(&mut input.binary, false);
        let count = input.count()?;
        for _ in 0..count {
            let (dimension, tag) = (input.int()?, input.int()?);
            let rest = input.line().unwrap_or_default();
            let name = String::from_utf8_lossy(rest).trim().trim_matches('"').to_owned();
            self.names.insert((dimension, tag), name);
        }
        input.binary = binary;
        Ok(())
    }

    fn entities(&mut self, input: &mut Input<'_>) -> Result<(), ImportError> {
        let counts = [input.size()?, input.size()?, input.size()?, input.size()?];
        for (dimension, count) in (0_i64..).zip(counts) {
            for _ in 0..count {
                let tag = input.int()?;
                self.entities.insert((dimension, tag));
                for _ in 0..if dimension == 0 { 3 } else { 6 } {
                    input.number()?;
                }
                let groups = input.size()?;
                for _ in 0..groups {
                    // Negative where it is turned round.
                    let group = input.int()?.saturating_abs();
                    self.physical.entry((dimension, tag)).or_default().push(group);
                }
                let bounding = if dimension == 0 { 0 } else { input.size()? };
                for _ in 0..bounding {
                    input.int()?;
                }
            }
        }
        Ok(())
    }

    fn node(&mut self, tag: u64, input: &mut Input<'_>) -> Result<(), ImportError> {
        let (x, y, z) = (input.number()?, input.number()?, input.number()?);
        self.nodes.insert(tag, Point::<3>::new(x, y, z));
        let [low, high] = self.z.unwrap_or([z, z]);
        self.z = Some([low.min(z), high.max(z)]);
        Ok(())
    }

    fn nodes_2(&mut self, input: &mut Input<'_>) -> Result<(), ImportError> {
        for _ in 0..input.count()? {
            let tag = input.int()?;
            self.node(tag as u64, input)?;
        }
        Ok(())
    }

    fn nodes_4(&mut self, input: &mut Input<'_>) -> Result<(), ImportError> {
        let [blocks, ..] = [input.size()?, input.size()?, input.size()?, input.size()?];
        for _ in 0..blocks {
            let (dimension, _, parametric) = (input.int()?, input.int()?, input.int()?);
            let count = input.size()?;
            let mut tags = Vec::new();
            for _ in 0..count {
                tags.push(input.size()?);
            }
            for tag in tags {
                self.node(tag, input)?;
                for _ in 0..if parametric == 1 { dimension.clamp(0, 3) } else { 0 } {
                    input.number()?;
                }
            }
        }
        Ok(())
    }

    fn elements_2(&mut self, input: &mut Input<'_>) -> Result<(), ImportError> {
        let count = input.count()?;
        let mut read = 0;
        while read < count {
            // In binary files elements of one type follow each other, their type and tags told once.
            let (kind, follow, tags);
            if input.binary {
                (kind, follow, tags) = (input.int()?, input.int()?, input.int()?);
            } else {
                input.int()?;
                (kind, follow, tags) = (input.int()?, 1, input.int()?);
            }
            if follow < 1 {
                return Err(input.wrong(format!("{follow} elements of type {kind} cannot follow")));
            }
            for _ in 0..follow {
                if input.binary {
                    input.int()?;
                }
                let mut group = None;
                for _ in 0..tags {
                    let tag = input.int()?;
                    group = group.or(Some(tag));
                }
                let nodes = Self::corners(kind, input, |input| Ok(input.int()? as u64))?;
                let group = group.unwrap_or(0);
                self.add((kind, group), |mesh, dimension| mesh.group(dimension, group), nodes);
            }
            read = read.saturating_add(follow as u64);
        }
        Ok(())
    }

    fn elements_4(&mut self, input: &mut Input<'_>) -> Result<(), ImportError> {
        let [blocks, ..] = [input.size()?, input.size()?, input.size()?, input.size()?];
        for _ in 0..blocks {
            let (dimension, entity, kind) = (input.int()?, input.int()?, input.int()?);
            // The list may be left out; an entity that is not in it would be in no group.
            if dimension == 3 && !self.entities.is_empty() && !self.entities.contains(&(3, entity)) {
                return Err(input.wrong(format!("elements of volume {entity}, which $Entities does not list")));
            }
            let count = input.size()?;
            for _ in 0..count {
                input.size()?;
                let nodes = Self::corners(kind, input, |input| input.size())?;
                let group = |mesh: &Self, dimension: i64| {
                    // The first group with a name: entities may be in several.
                    let groups = mesh.physical.get(&(dimension, entity)).into_iter().flatten();
                    let named = groups.filter_map(|group| mesh.names.get(&(dimension, *group)));
                    named.into_iter().next().map_or(Group::Tag(entity), |name| Group::Named(name.clone()))
                };
                self.add((kind, entity), group, nodes);
            }
        }
        Ok(())
    }

    fn group(&self, dimension: i64, tag: i64) -> Group {
        self.names.get(&(dimension, tag)).map_or(Group::Tag(tag), |name| Group::Named(name.clone()))
    }

    /// The corners of an element, all its nodes read.
    fn corners(
        kind: i64,
        input: &mut Input<'_>,
        mut next: impl FnMut(&mut Input<'_>) -> Result<u64, ImportError>,
    ) -> Result<Vec<u64>, ImportError> {
        let Some(count) = nodes_of(kind) else {
            return Err(
                input.wrong(format!("elements of type {kind} are not known: how many nodes they have is not told"))
            );
        };
        let mut corners = Vec::with_capacity(4);
        for i in 0..count {
            let node = next(input)?;
            if i < 4 {
                corners.push(node);
            }
        }
        Ok(corners)
    }

    /// Adds an element of a kind that belongs to a group or an entity.
    fn add(&mut self, (kind, part): (i64, i64), group: impl Fn(&Self, i64) -> Group, mut corners: Vec<u64>) {
        let (dimension, count) = match kind {
            POINT => (0, 1),
            _ if LINES.contains(&kind) => (1, 2),
            _ if TRIANGLES.contains(&kind) => (2, 3),
            _ if QUADRANGLES.contains(&kind) => (2, 4),
            _ => {
                self.solids += 1;
                if let Some(corners) = corners.first_chunk::<4>().filter(|_| TETRAHEDRA.contains(&kind)) {
                    self.tetrahedra.push((*corners, part));
                    self.curved += usize::from(kind != TETRAHEDRA[0]);
                }
                return;
            }
        };
        corners.truncate(count);
        let group = group(self, dimension);
        self.elements[dimension as usize].entry(group).or_default().push(corners);
    }
}
