//! Gmsh meshes: `.msh`, versions 2.2 and 4.1, ASCII and binary; planar ones here, tetrahedra in `solid`.
//!
//! With triangles or quadrangles in the file the body is what they cover. Physical groups whose names say so are
//! inclusions, materials, the needle, the target, paddles and what is fixed. Without names every surface but the
//! largest becomes an inclusion (in 2.2 a surface is a physical group, in 4.1 an entity). Without surfaces the lines
//! are joined to loops.

mod chain;
mod input;
mod mesh;
pub(in crate::scene) mod solid;

use super::assemble::assemble;
use super::role::{Meaning, Role, meaning};
use super::shape::Shape;
use super::{ImportError, ImportOptions, Imported, Summary};
use crate::geometry::{Point2, signed_area};
use chain::{Line, boundary, joined};
use mesh::{Group, Mesh};
use std::collections::{BTreeMap, BTreeSet};

/// A mesh whose nodes differ in z by more than this part of its size is not planar.
const FLAT: f64 = 1e-6;

/// Reads the mesh.
///
/// # Errors
/// [`ImportError`].
pub fn read(bytes: &[u8], options: &ImportOptions<'_>) -> Result<Imported, ImportError> {
    let mesh = Mesh::read(bytes)?;
    let mut summary = Summary::default();
    if mesh.solids > 0 {
        summary.leave(&format!("{} solid elements", mesh.solids), "scenes are planar");
    }
    let shapes = Shapes { mesh: &mesh, shapes: Vec::new(), summary }.read()?;
    let Shapes { shapes, mut summary, .. } = shapes;
    let size = shapes.iter().flat_map(|shape| &shape.points).fold(0.0_f64, |size, p| size.max(p.amax()));
    if mesh.z.is_some_and(|[low, high]| high - low > FLAT * size) {
        summary.note("z: nodes differ in z, which is left out: the mesh should lie in the plane of x and y");
    }
    assemble(shapes, None, options, summary)
}

struct Shapes<'a> {
    mesh: &'a Mesh,
    shapes: Vec<Shape>,
    summary: Summary,
}

/// What a group is called, and what that says.
fn named(group: &Group, what: &str) -> (String, Meaning) {
    match group {
        Group::Named(name) => (format!("{what} `{name}`"), meaning(name)),
        Group::Tag(tag) => (format!("{what} {tag}"), Meaning::default()),
    }
}

/// Whether a surface is beside the body, and not a part of it.
fn is_beside(role: Option<Role>) -> bool {
    matches!(role, Some(Role::Fixed | Role::Paddle(_) | Role::Needle))
}

impl Shapes<'_> {
    fn read(mut self) -> Result<Self, ImportError> {
        if self.mesh.elements[2].is_empty() {
            self.body_of_lines()?
        } else {
            self.surfaces()?
        }
        let has_surfaces = !self.mesh.elements[2].is_empty();
        // A mesh whose lines have no names at all has them of its curves.
        let is_named = |group: &&Group| matches!(group, Group::Named(_));
        let unnamed = self.mesh.elements[1].keys().filter(|group| !is_named(group)).count();
        if has_surfaces && unnamed > 0 && self.mesh.elements[1].keys().any(|group| is_named(&group)) {
            let told = if unnamed == 1 { "a line".to_owned() } else { format!("{unnamed} lines") };
            self.summary.leave(
                &format!("{told} without a name"),
                "a line has the role that the name of its physical group says",
            );
        }
        for (group, lines) in &self.mesh.elements[1] {
            let (told, meaning) = named(group, "lines");
            self.summary.ask(&told, meaning.meant);
            match meaning.role {
                Some(Role::Needle | Role::Target | Role::Paddle(_) | Role::Fixed) => {
                    self.lines(&told, meaning, lines)?
                }
                // Names of boundaries are common, and lines are no regions where there are surfaces.
                _ if has_surfaces && matches!(group, Group::Named(_)) => {
                    self.summary.leave(
                        &told,
                        "body and inclusions are those of the surfaces, and the name is no role of a line",
                    );
                }
                _ => {}
            }
        }
        for (group, points) in &self.mesh.elements[0] {
            let (told, meaning) = named(group, "point");
            self.summary.ask(&told, meaning.meant);
            match (meaning.role, group) {
                (Some(Role::Target), _) => {
                    for node in points.iter().flatten() {
                        self.shapes.push(Shape::new(told.clone(), meaning, vec![self.point(*node)?], false));
                    }
                }
                (_, Group::Named(_)) => self.summary.leave(&told, "a point can be the target, and nothing else"),
                _ => {}
            }
        }
        Ok(self)
    }

    fn point(&self, node: u64) -> Result<Point2, ImportError> {
        let missing = || ImportError::Syntax { line: 0, what: format!("node {node} is used and not given") };
        self.mesh.nodes.get(&node).map(|x| x.xy()).ok_or_else(missing)
    }

    fn points(&self, line: &Line) -> Result<Vec<Point2>, ImportError> {
        line.nodes.iter().map(|node| self.point(*node)).collect()
    }

    /// Closed loops of edges, the largest first; open ones are an error.
    fn loops(&self, edges: &[[u64; 2]]) -> Result<Vec<Vec<Point2>>, ImportError> {
        let mut loops = Vec::new();
        for line in joined(edges) {
            let points = self.points(&line)?;
            if !line.closed {
                let end = line.nodes.last().copied().unwrap_or(0);
                return Err(ImportError::NoOutline(format!("the boundary ends at node {end}")));
            }
            loops.push(points);
        }
        loops.sort_by(|a, b| signed_area(b).abs().total_cmp(&signed_area(a).abs()));
        Ok(loops)
    }

    /// The body is around all surfaces that are part of it; the others are inclusions.
    fn surfaces(&mut self) -> Result<(), ImportError> {
        let mut regions: Vec<(String, Meaning, f64, Vec<Vec<u64>>)> = Vec::new();
        for (group, cells) in &self.mesh.elements[2] {
            let (told, meaning) = named(group, "surface");
            self.summary.ask(&told, meaning.meant);
            let mut area = 0.0;
            for cell in cells {
                let corners: Vec<Point2> = cell.iter().map(|node| self.point(*node)).collect::<Result<_, _>>()?;
                area += signed_area(&corners).abs();
            }
            regions.push((told, meaning, area, cells.clone()));
        }
        let part = |meaning: &Meaning| !is_beside(meaning.role);
        let has_body = regions.iter().any(|region| region.1.role == Some(Role::Body));
        let candidates = regions.iter().enumerate().filter(|(_, region)| {
            if has_body { region.1.role == Some(Role::Body) } else { part(&region.1) && region.1.role.is_none() }
        });
        let main = candidates.max_by(|a, b| a.1.2.total_cmp(&b.1.2)).map(|(i, _)| i);
        let all: Vec<Vec<u64>> = regions.iter().filter(|r| part(&r.1)).flat_map(|r| r.3.iter().cloned()).collect();
        let outer = self.loops(&boundary(&all))?;
        let (told, meaning) = match main {
            Some(i) => (regions[i].0.clone(), regions[i].1),
            None => ("all surfaces".to_owned(), Meaning::default()),
        };
        for (i, points) in outer.into_iter().enumerate() {
            if i == 0 {
                let body = Meaning { role: Some(Role::Body), ..meaning };
                self.shapes.push(Shape::new(told.clone(), body, points, true));
            } else {
                self.summary.leave(
                    &format!("a further boundary of {told}"),
                    "holes and separate parts have no place in a scene",
                );
            }
        }
        for (i, (told, meaning, _, cells)) in regions.iter().enumerate() {
            if Some(i) != main && meaning.role != Some(Role::Body) {
                self.region(told, *meaning, cells)?;
            }
        }
        Ok(())
    }

    /// A surface by itself: its outer boundary, of each of its parts.
    fn region(&mut self, told: &str, meaning: Meaning, cells: &[Vec<u64>]) -> Result<(), ImportError> {
        let mut outer: Vec<Vec<Point2>> = Vec::new();
        for points in self.loops(&boundary(cells))? {
            // The larger come first: what begins in one of them is a hole of it.
            let hole = outer.iter().any(|loop_| {
                crate::geometry::Polygon::new(loop_.clone())
                    .is_ok_and(|around| points.iter().all(|p| around.contains(*p)))
            });
            if hole {
                self.summary.leave(&format!("a hole of {told}"), "it is filled: regions have no holes in a scene");
            } else {
                self.shapes.push(Shape::new(told.to_owned(), meaning, points.clone(), true));
                outer.push(points);
            }
        }
        Ok(())
    }

    /// Lines of one role, joined.
    fn lines(&mut self, told: &str, meaning: Meaning, lines: &[Vec<u64>]) -> Result<(), ImportError> {
        for line in joined(&edges(lines)) {
            let points = self.points(&line)?;
            self.shapes.push(Shape::new(told.to_owned(), meaning, points, line.closed));
        }
        Ok(())
    }

    /// Without surfaces: named loops, and all others, of which what is fixed and paddles are parts.
    fn body_of_lines(&mut self) -> Result<(), ImportError> {
        let mut outline: BTreeMap<bool, Vec<[u64; 2]>> = BTreeMap::new();
        let mut body = None;
        for (group, lines) in &self.mesh.elements[1] {
            let (told, meaning) = named(group, "lines");
            match meaning.role {
                Some(Role::Inclusion) => {
                    for points in self.loops(&edges(lines))? {
                        self.shapes.push(Shape::new(told.clone(), meaning, points, true));
                    }
                }
                Some(Role::Target) => {}
                role => {
                    outline.entry(role == Some(Role::Needle)).or_default().extend(edges(lines));
                    if role == Some(Role::Body) {
                        body = Some((told, meaning));
                    }
                }
            }
        }
        // A needle may be a part of the boundary: then without it nothing closes.
        let without = outline.remove(&false).unwrap_or_default();
        let needle = outline.remove(&true).unwrap_or_default();
        let closed = match self.loops(&without) {
            Err(_) if !needle.is_empty() => self.loops(&[without, needle].concat())?,
            loops => loops?,
        };
        for (i, points) in closed.into_iter().enumerate() {
            let (told, meaning) = match &body {
                Some((told, meaning)) if i == 0 => (told.clone(), *meaning),
                _ => (format!("loop {} of lines", i + 1), Meaning::default()),
            };
            self.shapes.push(Shape::new(told, meaning, points, true));
        }
        Ok(())
    }
}

/// Lines as edges, each once: a line that is in several groups may stand in the file as often.
fn edges(lines: &[Vec<u64>]) -> Vec<[u64; 2]> {
    let mut seen = BTreeSet::new();
    let edges = lines.iter().filter_map(|line| line.first_chunk::<2>().copied());
    edges.filter(|[a, b]| a != b && seen.insert([*a.min(b), *a.max(b)])).collect()
}

#[cfg(test)]
mod tests;
