//! Nitsche's method at finite strain: its tangent is the derivative of its force, gap and all, and its penalty follows the law.

use model_offline::discretization::{Integration, Method, Planar};
use model_offline::geometry::Point2;
use model_offline::linalg::Pattern;
use model_offline::material::Law;
use model_offline::mechanics::nitsche::Nitsche;
use model_offline::mechanics::{Tissue, WeaklyImposed};
use tests::{jittered_rectangle, rectangle};

struct Imposed {
    planar: Planar,
    tissue: Tissue,
    nitsche: Nitsche,
}

fn imposed() -> Imposed {
    let nodes = jittered_rectangle([1.0, 1.0], [5, 5], 0.2, 3);
    let planar = Planar::new(&rectangle(1.0, 1.0), &[], nodes, None, Method::new(Integration::Scni)).unwrap();
    let law = Law::fung(383.0, 318.5, 40.0, 1.5, 1.0).unwrap();
    // Cells that an inclusion cuts: parts of two laws.
    let other = Law::neo_hookean(200.0, 100.0).unwrap();
    let tissue = Tissue::new(vec![law, other], (0..planar.cells().len()).map(|_| vec![(0, 0.8), (1, 1.7)]));
    let points = planar.boundary_points_on(&[Point2::new(0.0, 0.0), Point2::new(1.0, 0.0)]).unwrap();
    let nitsche = Nitsche::new(&planar, &tissue, points);
    Imposed { planar, tissue, nitsche }
}

/// A field with strains of `size`, that misses what is prescribed by as much.
fn field(planar: &Planar, size: f64) -> Vec<f64> {
    let wave = |x: &Point2| [size * ((3.0 * x.y).sin() + x.x), size * ((4.0 * x.x + x.y).cos() - 0.4 * x.y)];
    planar.positions().iter().flat_map(wave).collect()
}

#[test]
fn the_tangent_is_the_derivative_of_the_force_at_large_gaps_too() {
    let Imposed { planar, tissue, nitsche } = imposed();
    let (d, prescribed) = (field(&planar, 0.1), vec![0.02; nitsche.prescribed()]);
    let pattern = Pattern::new(2, planar.positions().len(), nitsche.node_lists().into_iter());
    let mut values = vec![0.0; pattern.entries()];
    nitsche.add_tangent(&tissue, (&d, &prescribed), &pattern, &mut values);
    let force = |d: &[f64]| {
        let mut force = vec![0.0; d.len()];
        nitsche.add_force(&tissue, d, &prescribed, &mut force);
        force
    };
    let largest = values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let step = 1e-6;
    let mut worst = 0.0_f64;
    for u in 0..d.len() {
        let moved = |by: f64| {
            let mut d = d.clone();
            d[u] += by;
            force(&d)
        };
        let (ahead, behind) = (moved(step), moved(-step));
        for (node, axis) in (u / 2..d.len() / 2).flat_map(|node| [(node, 0), (node, 1)]) {
            let column = (u / 2) as u32;
            let Some(at) = pattern.block_position(node as u32, column) else { continue };
            let entry = values[at + (u % 2) * pattern.column_length(column) + axis];
            let difference = (ahead[2 * node + axis] - behind[2 * node + axis]) / (2.0 * step);
            worst = worst.max((difference - entry).abs() / largest);
        }
    }
    println!("worst entry off by {worst:.1e} of the largest");
    assert!(worst < 1e-7, "{worst:.1e}");
}

#[test]
fn the_force_is_the_derivative_of_the_energy() {
    let Imposed { planar, tissue, nitsche } = imposed();
    let (d, prescribed) = (field(&planar, 0.1), vec![0.02; nitsche.prescribed()]);
    let energy = |d: &[f64]| nitsche.add_force(&tissue, d, &prescribed, &mut vec![0.0; d.len()]);
    let mut force = vec![0.0; d.len()];
    nitsche.add_force(&tissue, &d, &prescribed, &mut force);
    let largest = force.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    for (u, force) in force.iter().enumerate() {
        let moved = |by: f64| {
            let mut d = d.clone();
            d[u] += by;
            energy(&d)
        };
        let difference = (moved(1e-5) - moved(-1e-5)) / 2e-5;
        assert!((difference - force).abs() < 1e-7 * largest, "{u}: {difference} {force}, largest {largest}");
    }
}

#[test]
fn the_penalty_grows_with_the_stiffness_of_the_deformed_tissue_and_only_then() {
    let Imposed { planar, tissue, nitsche } = imposed();
    let rest = vec![0.0; 2 * planar.positions().len()];
    assert!(nitsche.adapted(&tissue, &rest).is_none());
    let strained = field(&planar, 0.4);
    let adapted = nitsche.adapted(&tissue, &strained).expect("forty per cent of strain stiffen Fung's law");
    assert!(adapted.adapted(&tissue, &strained).is_none(), "once is enough");
    // The energy of a gap alone, at rest strain: that of the penalty.
    let energy = |weak: &dyn WeaklyImposed| {
        let (prescribed, mut force) = (vec![0.01; nitsche.prescribed()], vec![0.0; rest.len()]);
        weak.add_force(&tissue, &rest, &prescribed, &mut force)
    };
    assert!(energy(adapted.as_ref()) > 1.1 * energy(&nitsche));
}
