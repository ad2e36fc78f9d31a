//! Bodies put together at random.

use super::*;

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

/// A body with patches and interfaces that have nothing to do with its lattice or with each other. Where they leave
/// slits thinner than the elements, angles are as flat as these.
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
    Case { patches, interfaces, euler: None, worst: 2.0, longest: 4.0, ..Case::new("random", body) }
}

#[test]
fn bodies_with_patches_and_interfaces_anywhere() {
    let seeds = std::env::var("STUFFING_SEEDS").ok().and_then(|s| s.parse().ok()).unwrap_or(24_u64);
    let mut refused = Vec::new();
    for seed in 0_u64..seeds {
        let case = random_case(seed);
        let fine = if seed % 2 == 0 { 0.03 } else { 0.08 };
        let sizes = graded(&case, 0.08, fine, 0.5);
        match case.stuff(&sizes) {
            Ok(mesh) => case.check(&mesh, &sizes),
            // A dent may leave next to nothing of a side of the block.
            Err(e) if seed % 6 == 4 && matches!(e, StuffingError::Unresolved { .. }) => eprintln!("random {seed}: {e}"),
            Err(e) => refused.push((seed, e)),
        }
    }
    // Rims and interfaces that almost touch, on elements of half the size of a patch, may be too much.
    assert!(20 * refused.len() as u64 <= seeds.max(20), "{refused:?}");
}
