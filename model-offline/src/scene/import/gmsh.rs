//! The boundary of a planar Gmsh mesh: ASCII `.msh`, versions 2.2 and 4.1.
//!
//! With triangles in the file the body is what they cover, and every surface but the largest becomes an inclusion (in
//! 2.2 a surface is a physical group, in 4.1 an entity). Without triangles the lines are joined to closed loops.

use super::{ImportError, Imported, assemble};
use crate::geometry::Point2;
use std::collections::{BTreeMap, HashMap};

/// Element types: 2- and 3-node lines, 3- and 6-node triangles. Others are skipped.
const LINES: [u32; 2] = [1, 8];
const TRIANGLES: [u32; 2] = [2, 9];

/// Reads the mesh; with `size` the longer side of the body becomes that many length units.
///
/// # Errors
/// [`ImportError`].
pub fn read(text: &str, size: Option<f64>) -> Result<Imported, ImportError> {
    let mut lines = Lines { lines: text.lines().enumerate() };
    let mut mesh = Mesh::default();
    let mut version = 0.0;
    while let Some((line, section)) = lines.next_line() {
        match section {
            "$MeshFormat" => {
                let format = lines.numbers()?;
                version = format[0];
                if format.get(1) != Some(&0.0) {
                    return Err(ImportError::Unsupported("binary mesh: save it as ASCII".into()));
                }
                if version != 2.2 && version != 4.1 {
                    return Err(ImportError::Unsupported(format!(
                        "mesh format {version}: save it as version 2.2 or 4.1 (gmsh -format msh2)"
                    )));
                }
            }
            "$Nodes" if version == 2.2 => mesh.nodes_2(&mut lines)?,
            "$Nodes" if version == 4.1 => mesh.nodes_4(&mut lines)?,
            "$Elements" if version == 2.2 => mesh.elements_2(&mut lines)?,
            "$Elements" if version == 4.1 => mesh.elements_4(&mut lines)?,
            "$Nodes" | "$Elements" => {
                return Err(ImportError::Syntax { line, what: format!("{section} comes before $MeshFormat") });
            }
            _ => {}
        }
    }
    assemble(mesh.loops()?, size)
}

struct Lines<'a> {
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
}

impl<'a> Lines<'a> {
    fn next_line(&mut self) -> Option<(usize, &'a str)> {
        self.lines.by_ref().map(|(i, text)| (i + 1, text.trim())).find(|(_, text)| !text.is_empty())
    }

    /// The numbers of the next line, at least one.
    fn numbers(&mut self) -> Result<Vec<f64>, ImportError> {
        let (line, text) = self
            .next_line()
            .ok_or_else(|| ImportError::Syntax { line: 0, what: "the file ends in the middle of a section".into() })?;
        let numbers: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
        numbers.map_err(|_| ImportError::Syntax { line, what: format!("numbers are expected, not {text:?}") })
    }

    /// The same with at least `count` of them.
    fn at_least(&mut self, count: usize) -> Result<Vec<f64>, ImportError> {
        let numbers = self.numbers()?;
        if numbers.len() < count {
            return Err(ImportError::Syntax { line: 0, what: format!("{count} numbers are expected: {numbers:?}") });
        }
        Ok(numbers)
    }
}

#[derive(Default)]
struct Mesh {
    nodes: HashMap<u64, Point2>,
    lines: Vec<[u64; 2]>,
    /// Corners of triangles by surface.
    surfaces: BTreeMap<i64, Vec<[u64; 3]>>,
}

impl Mesh {
    fn nodes_2(&mut self, lines: &mut Lines<'_>) -> Result<(), ImportError> {
        for _ in 0..lines.numbers()?[0] as u64 {
            let node = lines.at_least(3)?;
            self.nodes.insert(node[0] as u64, Point2::new(node[1], node[2]));
        }
        Ok(())
    }

    fn nodes_4(&mut self, lines: &mut Lines<'_>) -> Result<(), ImportError> {
        for _ in 0..lines.numbers()?[0] as u64 {
            let count = lines.at_least(4)?[3] as u64;
            let tags = (0..count).map(|_| Ok(lines.numbers()?[0] as u64)).collect::<Result<Vec<_>, ImportError>>()?;
            for tag in tags {
                let x = lines.at_least(2)?;
                self.nodes.insert(tag, Point2::new(x[0], x[1]));
            }
        }
        Ok(())
    }

    fn elements_2(&mut self, lines: &mut Lines<'_>) -> Result<(), ImportError> {
        for _ in 0..lines.numbers()?[0] as u64 {
            let element = lines.at_least(3)?;
            let tags = element[2] as usize;
            let surface = if tags > 0 { element.get(3).copied().unwrap_or(0.0) } else { 0.0 };
            self.add(element[1] as u32, surface as i64, element.get(tags.saturating_add(3)..).unwrap_or_default());
        }
        Ok(())
    }

    fn elements_4(&mut self, lines: &mut Lines<'_>) -> Result<(), ImportError> {
        for _ in 0..lines.numbers()?[0] as u64 {
            let block = lines.at_least(4)?;
            for _ in 0..block[3] as u64 {
                let element = lines.at_least(2)?;
                self.add(block[2] as u32, block[1] as i64, &element[1..]);
            }
        }
        Ok(())
    }

    fn add(&mut self, kind: u32, surface: i64, nodes: &[f64]) {
        let nodes: Vec<u64> = nodes.iter().map(|n| *n as u64).collect();
        match nodes[..] {
            [a, b, ..] if LINES.contains(&kind) => self.lines.push([a, b]),
            [a, b, c, ..] if TRIANGLES.contains(&kind) => self.surfaces.entry(surface).or_default().push([a, b, c]),
            _ => {}
        }
    }

    /// Closed loops: around all triangles, around every surface but the largest, or of lines.
    fn loops(&self) -> Result<Vec<Vec<Point2>>, ImportError> {
        if self.surfaces.is_empty() {
            return self.joined(&self.lines);
        }
        let all: Vec<[u64; 3]> = self.surfaces.values().flatten().copied().collect();
        let mut loops = self.joined(&boundary(&all))?;
        let largest = self.surfaces.iter().max_by_key(|surface| surface.1.len()).map(|surface| *surface.0);
        for (surface, triangles) in &self.surfaces {
            if Some(*surface) != largest {
                loops.extend(self.joined(&boundary(triangles))?);
            }
        }
        Ok(loops)
    }

    /// Joins edges end to end.
    fn joined(&self, edges: &[[u64; 2]]) -> Result<Vec<Vec<Point2>>, ImportError> {
        let mut at: HashMap<u64, Vec<usize>> = HashMap::new();
        for (i, edge) in edges.iter().enumerate() {
            edge.iter().for_each(|node| at.entry(*node).or_default().push(i));
        }
        let mut used = vec![false; edges.len()];
        let mut loops = Vec::new();
        for start in 0..edges.len() {
            if used[start] {
                continue;
            }
            used[start] = true;
            let [first, mut here] = edges[start];
            let mut points = vec![self.point(first)?];
            while here != first {
                points.push(self.point(here)?);
                let Some(next) = at[&here].iter().copied().find(|i| !used[*i]) else {
                    return Err(ImportError::NoOutline(format!("the boundary ends at node {here}")));
                };
                used[next] = true;
                here = if edges[next][0] == here { edges[next][1] } else { edges[next][0] };
            }
            loops.push(points);
        }
        Ok(loops)
    }

    fn point(&self, node: u64) -> Result<Point2, ImportError> {
        self.nodes
            .get(&node)
            .copied()
            .ok_or_else(|| ImportError::Syntax { line: 0, what: format!("node {node} is used and not given") })
    }
}

/// Edges that belong to one triangle only.
fn boundary(triangles: &[[u64; 3]]) -> Vec<[u64; 2]> {
    let mut count: BTreeMap<[u64; 2], ([u64; 2], u32)> = BTreeMap::new();
    for t in triangles {
        for edge in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]] {
            count.entry([edge[0].min(edge[1]), edge[0].max(edge[1])]).or_insert((edge, 0)).1 += 1;
        }
    }
    count.into_values().filter(|(_, times)| *times == 1).map(|(edge, _)| edge).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A 4 by 2 block of two squares, each cut into two triangles; the right square is another surface only in part.
    const V2: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n6\n1 0 0 0\n2 2 0 0\n3 4 0 0\n4 0 2 0\n5 2 2 0\n6 4 2 0\n$EndNodes\n\
        $Elements\n5\n1 15 2 0 1 1\n2 2 2 7 1 1 2 5\n3 2 2 7 1 1 5 4\n4 2 2 7 1 2 3 6\n5 2 2 7 1 2 6 5\n$EndElements\n";
    const V4: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n2 4 1 4\n0 1 0 1\n1\n0 0 0\n2 1 0 3\n2\n3\n4\n3 0 0\n3 1 0\n0 1 0\n$EndNodes\n\
        $Elements\n1 4 1 4\n1 1 1 4\n1 1 2\n2 2 3\n3 3 4\n4 4 1\n$EndElements\n";

    #[test]
    fn both_versions_give_the_boundary() {
        let triangles = read(V2, None).unwrap().outline;
        assert_eq!(triangles.vertices().len(), 4, "points between collinear edges are left out");
        assert!((triangles.area() - 8.0).abs() < 1e-12);
        let lines = read(V4, None).unwrap().outline;
        assert!((lines.area() - 3.0).abs() < 1e-12);
    }

    #[test]
    fn broken_meshes_are_refused() {
        assert!(matches!(read(&V2.replace("2.2 0", "3.0 0"), None), Err(ImportError::Unsupported(_))));
        assert!(matches!(read(&V2.replace("2.2 0", "2.2 1"), None), Err(ImportError::Unsupported(_))));
        assert!(matches!(read(&V2.replace("3 4 0 0", "3 four 0 0"), None), Err(ImportError::Syntax { line: 8, .. })));
        assert!(matches!(read(&V4.replace("4 4 1\n", "4 4 9\n"), None), Err(ImportError::Syntax { .. })));
        assert!(matches!(read("", None), Err(ImportError::NoOutline(_))));
        assert!(read(&V2[..150], None).is_err());
        // A number of tags beyond any that a computer counts: an element without nodes.
        let with = |element: &str| format!("{:?}", read(&V2.replace("5 2 2 7 1 2 6 5", element), None));
        assert_eq!(with("5 2 1e300 7 1 2 6 5"), with("5 2 2 7 1"));
    }
}
