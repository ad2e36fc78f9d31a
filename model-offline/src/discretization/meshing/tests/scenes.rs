//! Bodies of the reference scenes, and simple ones.

use super::*;

#[test]
fn spheres_of_any_size() {
    let mut counts = Vec::new();
    for radius in [1.0, 1e-3, 50.0] {
        let mesh = Case::new("sphere", ball(p(0.0, 0.0, 0.0), radius)).mesh(&|_: &Point<3>| 0.15 * radius);
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

#[test]
fn the_block_with_its_paddles() {
    let case = block();
    let sizes = graded(&case, 0.1, 0.02, 0.4);
    let mesh = case.mesh(&sizes);
    assert_close("volume", volume(&mesh, None), 1.0, 1e-12);
    assert_close("inclusion", volume(&mesh, Some(1)), 0.002, 1e-12);
    for patch in &case.patches[..9] {
        assert_close("paddle", area(&mesh, patch), 0.04, 1e-12);
    }
    assert_close("immobile", area(&mesh, &case.patches[9]), 1.0, 1e-12);
    assert_eq!(mesh, case.mesh(&sizes), "not deterministic");
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
        .with(&surface_points(&case.body, &case.interfaces[0], &|_| 1.5), 1.5)
        .with(&surface_points(&case.body, &case.interfaces[1], &|_| 1.0), 1.0);
    let mesh = case.mesh(&sizes);
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
    Case::new("dented", dented).mesh(&|_: &Point<3>| 0.07);

    let two = Solid::Union(vec![ball(p(0.0, 0.0, 0.0), 1.0), ball(p(0.9, 0.31, 0.17), 0.8)]);
    Case::new("two spheres", two).mesh(&|_: &Point<3>| 0.13);

    let (from, to) = (p(0.1, 0.2, 0.0), p(0.7, 1.9, 0.55));
    let mesh = Case::new("cylinder", Solid::Cylinder { from, to, radius: 0.5 }).mesh(&|_: &Point<3>| 0.11);
    assert_close("volume", volume(&mesh, None), std::f64::consts::PI * 0.25 * (to - from).norm(), 0.015);

    let mesh = Case::new("plate", cuboid([0.0; 3], [1.0, 1.0, 0.1])).mesh(&|_: &Point<3>| 0.1);
    assert_close("volume", volume(&mesh, None), 0.1, 1e-12);

    let odd = cuboid([0.013, -0.21, 0.0], [1.0, 0.777, 0.618]);
    let case = Case { patches: vec![cuboid([0.3, 0.1, 0.618], [0.51, 0.333, 0.618])], ..Case::new("odd box", odd) };
    let mesh = case.mesh(&|_: &Point<3>| 0.08);
    assert_close("volume", volume(&mesh, None), 0.987 * 0.987 * 0.618, 1e-9);
    assert_close("patch", area(&mesh, &case.patches[0]), 0.21 * 0.233, 1e-9);
}

#[test]
fn inclusions_inside_overlapping_and_sticking_out() {
    let case = Case {
        interfaces: vec![ball(p(0.31, 0.4, 0.52), 0.17), ball(p(0.71, 0.66, 0.35), 0.12)],
        ..Case::new("inclusions", cuboid([0.0; 3], [1.0; 3]))
    };
    let mesh = case.mesh(&|_: &Point<3>| 0.06);
    assert_close("first", volume(&mesh, Some(1)), SPHERE * 0.17_f64.powi(3), 0.06);
    assert_close("second", volume(&mesh, Some(2)), SPHERE * 0.12_f64.powi(3), 0.1);
    assert_close("all", volume(&mesh, None), 1.0, 1e-12);

    let case =
        Case { interfaces: vec![ball(p(0.5, 0.47, 1.0), 0.3)], ..Case::new("sticks out", cuboid([0.0; 3], [1.0; 3])) };
    let mesh = case.mesh(&|_: &Point<3>| 0.07);
    assert_close("half in", volume(&mesh, Some(1)), 0.5 * SPHERE * 0.027, 0.04);
    assert_close("all", volume(&mesh, None), 1.0, 1e-12);
}

#[test]
fn what_cannot_be_meshed_is_refused() {
    let body = ball(p(0.0, 0.0, 0.0), 1.0);
    let far = ball(p(3.0, 0.0, 0.0), 1.0);
    let space = Solid::HalfSpace { point: p(0.0, 0.0, 0.0), normal: p(0.0, 0.0, 1.0) };
    let patches: [&dyn Implicit; 1] = [&far];
    let fine = Request {
        body: &body,
        interfaces: &[],
        patches: &[],
        size: &|_: &Point<3>| 0.3,
        lattice: None,
        most_nodes: 100_000,
        pinned: &[],
    };
    assert!(stuff(&fine).is_ok());
    assert_eq!(stuff(&Request { patches: &patches, ..fine }), Err(StuffingError::EmptyPatch { patch: 0 }));
    assert_eq!(stuff(&Request { body: &space, ..fine }), Err(StuffingError::Unbounded));
    let apart = Solid::Intersection(vec![body.clone(), far.clone()]);
    assert_eq!(stuff(&Request { body: &apart, ..fine }), Err(StuffingError::Vanishes));
    let small = stuff(&Request { size: &|_: &Point<3>| 0.01, ..fine });
    assert!(matches!(small, Err(StuffingError::TooManyNodes { .. })), "{small:?}");
    assert!(matches!(stuff(&Request { size: &|_: &Point<3>| 0.0, ..fine }), Err(StuffingError::BadSize { .. })));
    for lattice in [0.0, -1.0] {
        let laid = stuff(&Request { lattice: Some(lattice), ..fine });
        assert!(matches!(laid, Err(StuffingError::BadSize { .. })), "{laid:?}");
    }
    assert!(stuff(&Request { lattice: Some(100.0), ..fine }).is_ok());
}

/// A region that ends in the surface, as one drawn beside the body does, holds what of the surface lies in its own: all of a face, or a
/// part of it, on the mesh that a region flat in that face has.
#[test]
fn a_region_that_touches_the_body_holds_what_it_touches() {
    for (name, low, high, face, expected) in [
        ("whole face", [0.0, 0.0, -1.0], [1.0, 1.0, 0.0], 0.0, 1.0),
        ("part of it", [0.3, 0.25, -1.0], [0.7, 0.6, 0.0], 0.0, 0.14),
        ("from the other side", [0.31, 0.27, 1.0], [0.7, 0.61, 2.0], 1.0, 0.39 * 0.34),
    ] {
        let mesh =
            |patch: &Solid| {
                Case { patches: vec![patch.clone()], ..Case::new(name, cuboid([0.0; 3], [1.0; 3])) }
                    .mesh(&|_: &Point<3>| 0.12)
            };
        let flat = cuboid([low[0], low[1], face], [high[0], high[1], face]);
        for touching in [cuboid(low, high), flat.clone()] {
            let meshed = mesh(&touching);
            assert_close(name, area(&meshed, &touching), expected, 1e-9);
            assert_eq!(meshed.nodes.len(), mesh(&flat).nodes.len(), "{name}");
        }
    }
}
