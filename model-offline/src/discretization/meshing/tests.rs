//! Invariants of meshes of many bodies.

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
}

impl Case {
    fn new(name: &'static str, body: Solid) -> Self {
        Self { name, body, interfaces: Vec::new(), patches: Vec::new(), pinned: Vec::new(), euler: Some(2), worst: 8.0 }
    }

    fn mesh(&self, size: &dyn Fn(&Point<3>) -> f64) -> TetMesh {
        let mesh = self.stuff(size).unwrap_or_else(|e| panic!("{}: {e}", self.name));
        self.check(&mesh, size);
        mesh
    }

    fn stuff(&self, size: &dyn Fn(&Point<3>) -> f64) -> Result<TetMesh, StuffingError> {
        let interfaces: Vec<&dyn Implicit> = self.interfaces.iter().map(|s| s as &dyn Implicit).collect();
        let patches: Vec<&dyn Implicit> = self.patches.iter().map(|s| s as &dyn Implicit).collect();
        let request = Request {
            body: &self.body,
            interfaces: &interfaces,
            patches: &patches,
            size,
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
    fn check(&self, mesh: &TetMesh, size: &dyn Fn(&Point<3>) -> f64) {
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
            ratios.push((a - b).norm() / size(&((a + b) / 2.0)));
        }
        ratios.sort_by(f64::total_cmp);
        let (middle, last) = (ratios[ratios.len() / 2], ratios[ratios.len() - 1]);
        // Sizes are rounded by √2 at most, and may change by as much within a leaf.
        assert!((0.6..1.2).contains(&middle) && last < 2.8, "{name}: lengths over sizes {middle}, at most {last}");
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
    of.iter().zip(&mesh.part).filter(|(_, q)| part.is_none_or(|p| p == **q)).map(|(v, _)| v).sum()
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

#[test]
fn spheres_of_any_size() {
    let mut counts = Vec::new();
    for radius in [1.0, 1e-3, 50.0] {
        let mesh = Case::new("sphere", ball(p(0.0, 0.0, 0.0), radius)).mesh(&|_| 0.15 * radius);
        // A sphere inscribed with triangles of size h misses about h²/R² of its volume.
        assert_close("volume", volume(&mesh, None), SPHERE * radius.powi(3), 0.01);
        counts.push(mesh.tetrahedra.len());
    }
    assert!(counts.windows(2).all(|w| w[0] == w[1]), "{counts:?}");
}

fn block() -> Case {
    let square = |axis: usize, at: f64, a: [f64; 2], b: [f64; 2]| {
        let mut corners = [[a[0], b[0]], [a[1], b[1]]].map(|c| c.to_vec());
        corners.iter_mut().for_each(|c| c.insert(axis, at));
        cuboid([corners[0][0], corners[0][1], corners[0][2]], [corners[1][0], corners[1][1], corners[1][2]])
    };
    let patches = vec![
        square(0, 0.0, [0.2, 0.4], [0.2, 0.4]),
        square(0, 0.0, [0.6, 0.8], [0.2, 0.4]),
        square(0, 0.0, [0.4, 0.6], [0.4, 0.6]),
        square(0, 0.0, [0.4, 0.6], [0.6, 0.8]),
        square(1, 0.0, [0.2, 0.4], [0.4, 0.6]),
        square(1, 0.0, [0.5, 0.7], [0.4, 0.6]),
        square(1, 1.0, [0.2, 0.4], [0.4, 0.6]),
        square(1, 1.0, [0.5, 0.7], [0.4, 0.6]),
        square(2, 1.0, [0.4, 0.6], [0.4, 0.6]),
        square(0, 1.0, [0.0, 1.0], [0.0, 1.0]),
    ];
    Case {
        patches,
        interfaces: vec![cuboid([0.6, 0.4, 0.3], [0.7, 0.6, 0.4])],
        pinned: vec![p(0.5, 0.5, 0.5)],
        ..Case::new("block", cuboid([0.0; 3], [1.0; 3]))
    }
}

/// Sizes that grow from `fine` at all rims.
fn graded(case: &Case, coarse: f64, fine: f64, growth: f64) -> Grading {
    let rims: Vec<Point<3>> = case.patches.iter().flat_map(|r| rim_points(&case.body, r, fine)).collect();
    Grading::new(coarse, growth).with(&rims, fine)
}

#[test]
fn the_block_with_its_paddles() {
    let case = block();
    let sizes = graded(&case, 0.1, 0.02, 0.4);
    let mesh = case.mesh(&|x| sizes.size(x));
    assert_close("volume", volume(&mesh, None), 1.0, 1e-12);
    assert_close("inclusion", volume(&mesh, Some(1)), 0.002, 1e-12);
    for patch in &case.patches[..9] {
        assert_close("paddle", area(&mesh, patch), 0.04, 1e-12);
    }
    assert_close("immobile", area(&mesh, &case.patches[9]), 1.0, 1e-12);
    assert_eq!(mesh, case.mesh(&|x| sizes.size(x)), "not deterministic");
}

fn mound() -> Case {
    let top = Solid::Ellipsoid { centre: p(0.0, 0.0, 0.0), semi_axes: p(60.0, 60.0, 50.0) };
    let above = Solid::HalfSpace { point: p(0.0, 0.0, 0.0), normal: p(0.0, 0.0, -1.0) };
    let spot = |azimuth: f64, z: f64, radius: f64| {
        let (r, phi) = (60.0 * (1.0 - (z / 50.0).powi(2)).sqrt(), azimuth.to_radians());
        ball(p(r * phi.cos(), r * phi.sin(), z), radius)
    };
    let paddles = [(0.0, 42.0), (60.0, 38.0), (120.0, 42.0), (180.0, 36.0), (240.0, 40.0), (300.0, 30.0)];
    let mut patches: Vec<Solid> = paddles.iter().map(|(phi, z)| spot(*phi, *z, 8.0)).collect();
    patches.push(spot(0.0, 20.0, 4.0));
    patches.push(cuboid([-100.0, -100.0, 0.0], [100.0, 100.0, 0.0]));
    Case {
        patches,
        interfaces: vec![ball(p(20.0, 12.0, 22.0), 6.0), ball(p(-10.0, -8.0, 15.0), 4.0)],
        pinned: vec![p(5.0, 0.0, 20.0)],
        ..Case::new("mound", Solid::Intersection(vec![top, above]))
    }
}

#[test]
fn the_mound_with_its_paddles() {
    let case = mound();
    let rims = |patches: &[Solid], h: f64| -> Vec<Point<3>> {
        patches.iter().flat_map(|r| rim_points(&case.body, r, h)).collect()
    };
    let base = feature_points(&case.body, 4.0);
    assert!(base.iter().all(|x| x.z.abs() < 1e-9 && (x.norm() - 60.0).abs() < 1e-6) && base.len() > 80);
    let sizes = Grading::new(8.0, 0.35)
        .with(&rims(&case.patches[..6], 1.4), 1.4)
        .with(&rims(&case.patches[6..7], 0.8), 0.8)
        .with(&base, 4.0)
        .with(&surface_points(&case.body, &case.interfaces[0], 1.5), 1.5)
        .with(&surface_points(&case.body, &case.interfaces[1], 1.0), 1.0);
    let mesh = case.mesh(&|x| sizes.size(x));
    assert_close("volume", volume(&mesh, None), 0.5 * SPHERE * 60.0 * 60.0 * 50.0, 0.01);
    assert_close("inclusion", volume(&mesh, Some(1)), SPHERE * 216.0, 0.05);
    assert_close("inclusion", volume(&mesh, Some(2)), SPHERE * 64.0, 0.05);
    assert_close("base", area(&mesh, &case.patches[7]), std::f64::consts::PI * 3600.0, 0.01);
    for patch in &case.patches[..7] {
        let radius = if let Solid::Sphere { radius, .. } = patch { *radius } else { 0.0 };
        // The spherical cap that a ball cuts out of a sphere has area πr², whatever the sphere.
        assert_close("paddle", area(&mesh, patch), std::f64::consts::PI * radius * radius, 0.01);
    }
}

#[test]
fn bodies_off_the_lattice() {
    let hole = Solid::Ellipsoid { centre: p(0.47, 0.53, 1.02), semi_axes: p(0.23, 0.31, 0.27) };
    let dented = Solid::Difference(vec![cuboid([0.0; 3], [1.0; 3]), hole]);
    Case::new("dented", dented).mesh(&|_| 0.07);

    let two = Solid::Union(vec![ball(p(0.0, 0.0, 0.0), 1.0), ball(p(0.9, 0.31, 0.17), 0.8)]);
    Case::new("two spheres", two).mesh(&|_| 0.13);

    let (from, to) = (p(0.1, 0.2, 0.0), p(0.7, 1.9, 0.55));
    let mesh = Case::new("cylinder", Solid::Cylinder { from, to, radius: 0.5 }).mesh(&|_| 0.11);
    assert_close("volume", volume(&mesh, None), std::f64::consts::PI * 0.25 * (to - from).norm(), 0.015);

    let mesh = Case::new("plate", cuboid([0.0; 3], [1.0, 1.0, 0.1])).mesh(&|_| 0.1);
    assert_close("volume", volume(&mesh, None), 0.1, 1e-12);

    let odd = cuboid([0.013, -0.21, 0.0], [1.0, 0.777, 0.618]);
    let case = Case { patches: vec![cuboid([0.3, 0.1, 0.618], [0.51, 0.333, 0.618])], ..Case::new("odd box", odd) };
    let mesh = case.mesh(&|_| 0.08);
    assert_close("volume", volume(&mesh, None), 0.987 * 0.987 * 0.618, 1e-9);
    assert_close("patch", area(&mesh, &case.patches[0]), 0.21 * 0.233, 1e-9);
}

#[test]
fn inclusions_inside_overlapping_and_sticking_out() {
    let case = Case {
        interfaces: vec![ball(p(0.31, 0.4, 0.52), 0.17), ball(p(0.71, 0.66, 0.35), 0.12)],
        ..Case::new("inclusions", cuboid([0.0; 3], [1.0; 3]))
    };
    let mesh = case.mesh(&|_| 0.06);
    assert_close("first", volume(&mesh, Some(1)), SPHERE * 0.17_f64.powi(3), 0.06);
    assert_close("second", volume(&mesh, Some(2)), SPHERE * 0.12_f64.powi(3), 0.1);
    assert_close("all", volume(&mesh, None), 1.0, 1e-12);

    let case =
        Case { interfaces: vec![ball(p(0.5, 0.47, 1.0), 0.3)], ..Case::new("sticks out", cuboid([0.0; 3], [1.0; 3])) };
    let mesh = case.mesh(&|_| 0.07);
    assert_close("half in", volume(&mesh, Some(1)), 0.5 * SPHERE * 0.027, 0.04);
    assert_close("all", volume(&mesh, None), 1.0, 1e-12);
}

#[test]
fn what_cannot_be_meshed_is_refused() {
    let body = ball(p(0.0, 0.0, 0.0), 1.0);
    let far = ball(p(3.0, 0.0, 0.0), 1.0);
    let space = Solid::HalfSpace { point: p(0.0, 0.0, 0.0), normal: p(0.0, 0.0, 1.0) };
    let patches: [&dyn Implicit; 1] = [&far];
    let fine = Request { body: &body, interfaces: &[], patches: &[], size: &|_| 0.3, most_nodes: 100_000, pinned: &[] };
    assert!(stuff(&fine).is_ok());
    assert_eq!(stuff(&Request { patches: &patches, ..fine }), Err(StuffingError::EmptyPatch { patch: 0 }));
    assert_eq!(stuff(&Request { body: &space, ..fine }), Err(StuffingError::Unbounded));
    let apart = Solid::Intersection(vec![body.clone(), far.clone()]);
    assert_eq!(stuff(&Request { body: &apart, ..fine }), Err(StuffingError::Vanishes));
    let small = stuff(&Request { size: &|_| 0.01, ..fine });
    assert!(matches!(small, Err(StuffingError::TooManyNodes { .. })), "{small:?}");
    assert!(matches!(stuff(&Request { size: &|_| 0.0, ..fine }), Err(StuffingError::BadSize { .. })));
}

/// Numbers between 0 and 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    fn point(&mut self, low: f64, high: f64) -> Point<3> {
        Point::from_fn(|_, _| self.between(low, high))
    }
}

/// A body with patches and interfaces that have nothing to do with its lattice or with each other.
fn random_case(seed: u64) -> Case {
    let mut r = Random(seed.wrapping_mul(7919) + 1);
    let _ = [(); 5].map(|()| r.next());
    let body = match seed % 6 {
        0 => ball(r.point(-0.1, 0.1), 0.6),
        1 => Solid::Box { min: r.point(-0.6, -0.4), max: r.point(0.3, 0.6) },
        2 => {
            let whole = Solid::Ellipsoid { centre: r.point(-0.1, 0.1), semi_axes: r.point(0.4, 0.8) };
            let half = Solid::HalfSpace { point: r.point(-0.1, 0.1), normal: r.point(-1.0, 1.0) };
            Solid::Intersection(vec![whole, half])
        }
        3 => Solid::Cylinder { from: r.point(-0.6, -0.4), to: r.point(0.4, 0.6), radius: r.between(0.3, 0.5) },
        4 => Solid::Difference(vec![cuboid([-0.5; 3], [0.5; 3]), ball(r.point(-0.5, 0.5), 0.3)]),
        _ => Solid::Union(vec![ball(r.point(-0.3, 0.0), 0.4), ball(r.point(0.0, 0.3), 0.4)]),
    };
    // Patches round random points of the surface, across its edges too.
    let mut patches = Vec::new();
    while patches.len() < 4 {
        let mut x = r.point(-0.8, 0.8);
        for _ in 0..20 {
            let g = body.gradient(&x);
            x -= g * (body.level(&x) / g.norm_squared().max(1e-3));
        }
        if body.level(&x).abs() < 1e-9 {
            let half = r.point(0.1, 0.2);
            let round = r.next() < 0.7;
            patches.push(if round { ball(x, half.x) } else { Solid::Box { min: x - half, max: x + half } });
        }
    }
    let (centre, half) = (r.point(-0.3, 0.3), r.point(0.08, 0.2));
    let inner = Solid::Box { min: centre - half, max: centre + half };
    let interfaces = vec![ball(r.point(-0.4, 0.4), r.between(0.1, 0.2)), inner];
    Case { patches, interfaces, euler: None, worst: 4.0, ..Case::new("random", body) }
}

#[test]
fn bodies_with_patches_and_interfaces_anywhere() {
    let seeds = std::env::var("STUFFING_SEEDS").ok().and_then(|s| s.parse().ok()).unwrap_or(24);
    for seed in 0..seeds {
        let case = random_case(seed);
        let fine = if seed % 2 == 0 { 0.03 } else { 0.08 };
        let sizes = graded(&case, 0.08, fine, 0.5);
        match case.stuff(&|x| sizes.size(x)) {
            Ok(mesh) => case.check(&mesh, &|x| sizes.size(x)),
            // A dent may leave next to nothing of a side of the block.
            Err(e) => assert!(seed % 6 == 4 && matches!(e, StuffingError::Unresolved { .. }), "{seed}: {e}"),
        }
    }
}
