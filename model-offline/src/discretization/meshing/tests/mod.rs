//! Invariants of meshes of many bodies.

mod random;
mod scenes;
mod surfaces;

use super::*;
use crate::geometry::{Implicit, Point, Solid};

fn p(x: f64, y: f64, z: f64) -> Point<3> {
    Point::<3>::new(x, y, z)
}

/// A body with all that is asked of its mesh.
struct Case {
    name: &'static str,
    body: Solid,
    interfaces: Vec<Solid>,
    patches: Vec<Solid>,
    pinned: Vec<Point<3>>,
    /// Euler characteristic of its surface.
    euler: Option<usize>,
    /// Smallest dihedral angle that is good enough, degrees.
    worst: f64,
    /// Lengths of edges over the sizes wanted are to be below this.
    longest: f64,
}

impl Case {
    fn new(name: &'static str, body: Solid) -> Self {
        Self {
            name,
            body,
            interfaces: Vec::new(),
            patches: Vec::new(),
            pinned: Vec::new(),
            euler: Some(2),
            worst: 8.0,
            longest: 2.5,
        }
    }

    fn mesh(&self, size: &dyn Sizes) -> TetMesh {
        let mesh = self.stuff(size).unwrap_or_else(|e| panic!("{}: {e}", self.name));
        self.check(&mesh, size);
        mesh
    }

    fn stuff(&self, size: &dyn Sizes) -> Result<TetMesh, StuffingError> {
        let interfaces: Vec<&dyn Implicit> = self.interfaces.iter().map(|s| s as &dyn Implicit).collect();
        let patches: Vec<&dyn Implicit> = self.patches.iter().map(|s| s as &dyn Implicit).collect();
        let request = Request {
            body: &self.body,
            interfaces: &interfaces,
            patches: &patches,
            size,
            lattice: None,
            most_nodes: 1_000_000,
            pinned: &self.pinned,
        };
        let start = std::time::Instant::now();
        let mesh = stuff(&request)?;
        let q = mesh.quality();
        eprintln!(
            "{:12} {:7} nodes {:7} tets  {:5.2} s  angles {:5.2}..{:6.2}",
            self.name,
            mesh.nodes.len(),
            mesh.tetrahedra.len(),
            start.elapsed().as_secs_f64(),
            q.min_dihedral,
            q.max_dihedral,
        );
        Ok(mesh)
    }

    /// The edges that end a patch make closed chains along its rim.
    fn check_rim(&self, mesh: &TetMesh, boundary: &[[u32; 3]], patch: &Solid) {
        let (low, high) = self.body.bounds().unwrap();
        let tolerance = 1e-9 * (high - low).max();
        let held = patch_triangles(mesh, boundary, patch, tolerance);
        let mut edges: Vec<[u32; 2]> = held.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]).collect();
        edges.sort_unstable();
        let rim: Vec<[u32; 2]> =
            edges.iter().copied().filter(|[a, b]| edges.binary_search(&[*b, *a]).is_err()).collect();
        assert!(!rim.is_empty());
        for n in rim.iter().flatten() {
            let x = mesh.nodes[*n as usize];
            let on_edge = || self.body.sheets().iter().filter(|s| s.level(&x).abs() <= tolerance).count() > 1;
            assert!(
                patch.patch_level(&x).abs() <= tolerance || (patch.carrier().is_some() && on_edge()),
                "{}: the rim of {patch:?} leaves it at {x}",
                self.name,
            );
            let (ins, outs) = (rim.iter().filter(|e| e[1] == *n).count(), rim.iter().filter(|e| e[0] == *n).count());
            assert_eq!(ins, outs, "{}: open rim", self.name);
        }
    }

    /// All that holds for any mesh, whatever the body.
    fn check(&self, mesh: &TetMesh, size: &dyn Sizes) {
        let (low, high) = self.body.bounds().unwrap();
        let extent = (high - low).max();
        let name = self.name;
        assert!(mesh.volumes().iter().all(|v| *v > 0.0), "{name}: inverted");
        assert!(mesh.sorted_faces().chunk_by(|a, b| a.0 == b.0).all(|f| f.len() <= 2), "{name}: face of three");
        let boundary = mesh.boundary();
        let mut edges: Vec<[u32; 2]> = boundary.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]).collect();
        edges.sort_unstable();
        // Every directed edge once, and once the other way: closed and oriented.
        assert!(edges.windows(2).all(|w| w[0] != w[1]), "{name}: not a manifold");
        assert!(edges.iter().all(|[a, b]| edges.binary_search(&[*b, *a]).is_ok()), "{name}: open");
        let mut on: Vec<u32> = boundary.iter().flatten().copied().collect();
        on.sort_unstable();
        on.dedup();
        let euler = on.len() + boundary.len() - edges.len() / 2;
        assert!(self.euler.is_none_or(|e| e == euler), "{name}: Euler characteristic {euler}");
        for n in &on {
            let level = self.body.level(&mesh.nodes[*n as usize]);
            assert!(level.abs() < 1e-9 * extent, "{name}: off the surface by {level}");
        }
        for (i, patch) in self.patches.iter().enumerate() {
            let straddling = boundary.iter().filter(|t| rims::straddles(mesh, t, patch, 1e-9 * extent)).count();
            assert_eq!(straddling, 0, "{name}: triangles across the rim of patch {i}");
            self.check_rim(mesh, &boundary, patch);
        }
        for (i, interface) in self.interfaces.iter().enumerate() {
            // Where a later interface holds a tetrahedron, earlier ones do not matter.
            let across = |t: &usize| {
                let levels = mesh.corners(*t).map(|x| interface.level(&x));
                mesh.part[*t] as usize <= i + 1
                    && levels.iter().any(|l| *l < -1e-9 * extent)
                    && levels.iter().any(|l| *l > 1e-9 * extent)
            };
            assert_eq!((0..mesh.part.len()).find(across), None, "{name}: across interface {i}");
        }
        for x in &self.pinned {
            assert!(mesh.nodes.contains(x), "{name}: {x} is no node");
        }
        let mut ratios: Vec<f64> = Vec::new();
        for [a, b] in mesh.edges() {
            let (a, b) = (mesh.nodes[a as usize], mesh.nodes[b as usize]);
            ratios.push((a - b).norm() / size.at(&((a + b) / 2.0)));
        }
        ratios.sort_by(f64::total_cmp);
        let (middle, last) = (ratios[ratios.len() / 2], ratios[ratios.len() - 1]);
        // Sizes are rounded by √2 at most, and may change by as much within a leaf.
        assert!(
            (0.6..1.2).contains(&middle) && last < self.longest,
            "{name}: lengths over sizes {middle}, at most {last}"
        );
        let q = mesh.quality();
        assert!(
            q.min_dihedral > self.worst && q.max_dihedral < 180.0 - self.worst,
            "{name}: {q:?} {:?}",
            mesh.corners(q.worst)
        );
    }
}

fn volume(mesh: &TetMesh, part: Option<u32>) -> f64 {
    let of = mesh.volumes();
    let counted: Vec<f64> =
        of.iter().zip(&mesh.part).filter(|(_, q)| part.is_none_or(|p| p == **q)).map(|(v, _)| *v).collect();
    // Those of a lattice are alike: added one by one, their rounding errors add up to 1e-12.
    counted.chunks(256).map(|some| some.iter().sum::<f64>()).sum()
}

fn area(mesh: &TetMesh, patch: &Solid) -> f64 {
    let at = |n: u32| mesh.nodes[n as usize];
    let triangles = rims::patch_triangles(mesh, &mesh.boundary(), patch, 1e-9);
    triangles.iter().map(|[a, b, c]| 0.5 * (at(*b) - at(*a)).cross(&(at(*c) - at(*a))).norm()).sum()
}

fn assert_close(what: &str, value: f64, exact: f64, relative: f64) {
    assert!((value - exact).abs() <= relative * exact.abs(), "{what}: {value} instead of {exact}");
}

fn ball(centre: Point<3>, radius: f64) -> Solid {
    Solid::Sphere { centre, radius }
}

fn cuboid(min: [f64; 3], max: [f64; 3]) -> Solid {
    Solid::Box { min: min.into(), max: max.into() }
}

const SPHERE: f64 = 4.0 / 3.0 * std::f64::consts::PI;

/// Sizes that grow from `fine` at all rims.
fn graded(case: &Case, coarse: f64, fine: f64, growth: f64) -> Grading {
    let rims: Vec<Point<3>> = case.patches.iter().flat_map(|r| rim_points(&case.body, r, fine)).collect();
    Grading::new(coarse, growth).with(&rims, fine)
}
