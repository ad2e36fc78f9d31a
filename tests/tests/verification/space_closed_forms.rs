//! Three dimensions against closed forms of linear elasticity: a harmonic displacement and its orders of convergence, and the
//! load of Boussinesq on a square patch.

use model_offline::discretization::meshing::{Request, stuff};
use model_offline::discretization::{Integration, Method, Spatial, TetMesh};
use model_offline::geometry::{Implicit, Point, Solid};
use model_offline::material::Law;
use model_offline::mechanics::{ConstrainedRows, Tissue};
use model_offline::solver::equilibrium::{DiscreteBody, Equilibrium, NewtonSettings};
use nalgebra::Vector3;
use std::f64::consts::PI;
use std::sync::Arc;

const LAMBDA: f64 = 383.0;
const MU: f64 = 318.5;

fn meshed(low: Point<3>, high: Point<3>, patches: &[&dyn Implicit], size: &dyn Fn(&Point<3>) -> f64) -> TetMesh {
    let body = Solid::Box { min: low, max: high };
    stuff(&Request {
        body: &body,
        interfaces: &[],
        patches,
        size: &size,
        lattice: None,
        most_nodes: 40_000,
        pinned: &[],
    })
    .unwrap()
}

/// A body of linear tissue whose nodes have displacements wherever `prescribed` gives one, under the force `load` of its nodes.
fn solved(
    mesh: &TetMesh,
    integration: Integration,
    prescribed: impl Fn(&Point<3>) -> Option<Vector3<f64>>,
    load: impl Fn(&Spatial, &mut [f64]),
) -> (Spatial, Vec<f64>) {
    let method = Method { support: integration.default_support_in_space(), ..Method::new(integration) };
    let spatial = Spatial::new(mesh, method, |_, _| None).unwrap();
    let (mut stencils, mut values) = (Vec::new(), Vec::new());
    for (node, x) in spatial.positions().iter().enumerate() {
        if let Some(u) = prescribed(x) {
            stencils.push(spatial.nodal_stencil(node as u32).unwrap());
            values.extend(u.iter());
        }
    }
    let mut body = Equilibrium::at_rest(
        DiscreteBody {
            rule: Arc::clone(spatial.rule()),
            tissue: Tissue::uniform(Law::linear(LAMBDA, MU).unwrap(), spatial.volumes().len()),
            positions: spatial.positions(),
            spacing: 0.1,
        },
        ConstrainedRows::new(stencils.iter()),
        NewtonSettings::default(),
    )
    .unwrap();
    let mut force = vec![0.0; 3 * spatial.positions().len()];
    load(&spatial, &mut force);
    body.drive_loaded(&values, &force).unwrap();
    let coefficients = body.coefficients().to_vec();
    (spatial, coefficients)
}

/// The gradient of a harmonic function has neither divergence nor Laplacian: no force is needed to hold it.
fn harmonic(x: &Point<3>) -> Vector3<f64> {
    let (a, c) = (PI / 2.0_f64.sqrt(), PI);
    let ((sx, cx), (sy, cy)) = ((a * x.x).sin_cos(), (a * x.y).sin_cos());
    let (sinh, cosh) = ((c * x.z).sinh(), (c * x.z).cosh());
    Vector3::new(a * cx * sy * sinh, a * sx * cy * sinh, c * sx * sy * cosh) * (1e-3 / (c * PI.cosh()))
}

/// Root mean square error in the inside of the unit cube over the field's.
fn error(integration: Integration, edge: f64) -> f64 {
    let mesh = meshed(Point::zeros(), Point::repeat(1.0), &[], &|_| edge);
    let on_surface = |x: &Point<3>| x.iter().any(|c| c.abs() < 1e-9 || (c - 1.0).abs() < 1e-9);
    let (spatial, coefficients) = solved(&mesh, integration, |x| on_surface(x).then(|| harmonic(x)), |_, _| {});
    let (mut wrong, mut whole) = (0.0, 0.0);
    // Points that no lattice favours.
    for i in 0..400 {
        let part = |k: f64| 0.1 + 0.8 * (f64::from(i) * k).fract();
        let x = Point::<3>::new(part(0.819_172_5), part(0.671_043_6), part(0.549_700_5));
        let found = spatial.value_stencil(&x).unwrap().interpolate(&coefficients);
        wrong += (found - harmonic(&x)).norm_squared();
        whole += harmonic(&x).norm_squared();
    }
    (wrong / whole).sqrt()
}

/// Order 2 for linear fields and 3 for quadratic ones, in the mean square.
#[test]
fn a_harmonic_displacement_converges_at_the_orders_of_theory() {
    for (integration, order, within) in [
        (Integration::FemT4, 1.7, 0.02),
        (Integration::FemT10, 2.7, 0.001),
        (Integration::ScniStabilised, 1.7, 0.02),
        (Integration::Mscni, 1.7, 0.02),
    ] {
        let [coarse, fine] = [0.25, 0.125].map(|edge| error(integration, edge));
        let found = (coarse / fine).log2();
        println!("{integration}: {coarse:.2e} {fine:.2e}, order {found:.2}");
        assert!(found > order && fine < within, "{integration}: {coarse} {fine}, order {found}");
    }
}

/// Half the side of the loaded square, and the pressure on it.
const HALF: f64 = 0.25;
const PRESSURE: f64 = 1.0;

/// Boussinesq's displacement under a unit force downwards at the origin, at a point with z ≤ 0 (Johnson, *Contact Mechanics*,
/// 1985, section 3.2).
fn boussinesq(x: Vector3<f64>) -> Vector3<f64> {
    let nu = LAMBDA / (2.0 * (LAMBDA + MU));
    let (depth, distance) = (-x.z, x.norm());
    let aside = depth / distance.powi(3) - (1.0 - 2.0 * nu) / (distance * (distance + depth));
    let down = depth * depth / distance.powi(3) + 2.0 * (1.0 - nu) / distance;
    Vector3::new(x.x * aside, x.y * aside, -down) / (4.0 * PI * MU)
}

/// The same under the pressure on the square: the forces of `pieces` × `pieces` small squares.
fn under_pressure(x: &Point<3>, pieces: i32) -> Vector3<f64> {
    let side = 2.0 * HALF / f64::from(pieces);
    let middle = |i: i32| -HALF + side * (f64::from(i) + 0.5);
    let all = (0..pieces).flat_map(|i| (0..pieces).map(move |j| (i, j)));
    let one = |(i, j): (i32, i32)| boussinesq(x - Vector3::new(middle(i), middle(j), 0.0));
    all.map(one).sum::<Vector3<f64>>() * (PRESSURE * side * side)
}

#[test]
fn a_pressed_square_sinks_as_boussinesq_says() {
    let square = Solid::Box { min: Point::<3>::new(-HALF, -HALF, 0.0), max: Point::<3>::new(HALF, HALF, 0.0) };
    let size = |x: &Point<3>| 0.1 + 0.25 * (x.norm() - 0.4).max(0.0);
    let mesh = meshed(Point::<3>::new(-1.0, -1.0, -1.0), Point::<3>::new(1.0, 1.0, 0.0), &[&square], &size);
    // Elsewhere the half space goes on: there it has the displacement of theory.
    let cut = |x: &Point<3>| x.z < -1.0 + 1e-9 || x.x.abs() > 1.0 - 1e-9 || x.y.abs() > 1.0 - 1e-9;
    let pressed: Vec<[Point<3>; 3]> = mesh
        .boundary()
        .into_iter()
        .map(|triangle| triangle.map(|node| mesh.nodes[node as usize]))
        .filter(|corners| {
            let middle = corners.iter().sum::<Point<3>>() / 3.0;
            middle.z > -1e-9 && middle.x.abs() < HALF && middle.y.abs() < HALF
        })
        .collect();
    let area = |[a, b, c]: &[Point<3>; 3]| 0.5 * (b - a).cross(&(c - a)).norm();
    let whole: f64 = pressed.iter().map(area).sum();
    assert!((whole - 4.0 * HALF * HALF).abs() < 1e-9, "the square's rim is in the mesh: {whole}");
    let press = |spatial: &Spatial, force: &mut [f64]| {
        for triangle in &pressed {
            for (p, q) in [(0, 1), (1, 2), (2, 0)] {
                let stencil = spatial.value_stencil(&((triangle[p] + triangle[q]) * 0.5)).unwrap();
                for (node, value) in stencil.nodes.iter().zip(&stencil.values) {
                    force[3 * *node as usize + 2] -= PRESSURE * area(triangle) / 3.0 * value;
                }
            }
        }
    };
    // The middle sinks by 8 a p (1 − ν²)/(π E) ln(1 + √2) (Johnson, section 3.3, at the centre of a square).
    let nu = LAMBDA / (2.0 * (LAMBDA + MU));
    let young = 2.0 * MU * (1.0 + nu);
    let middle = -8.0 * HALF * PRESSURE * (1.0 - nu * nu) / (PI * young) * (1.0 + 2.0_f64.sqrt()).ln();
    let summed = under_pressure(&Point::<3>::new(0.0, 0.0, 0.0), 400).z;
    assert!((summed / middle - 1.0).abs() < 0.005, "{summed} {middle}");
    for (integration, within) in
        [(Integration::FemT10, 0.01), (Integration::ScniStabilised, 0.03), (Integration::FemT4, 0.05)]
    {
        let (spatial, coefficients) = solved(&mesh, integration, |x| cut(x).then(|| under_pressure(x, 24)), press);
        let at = |x: Point<3>| spatial.value_stencil(&x).unwrap().interpolate(&coefficients);
        let top = at(Point::<3>::new(0.0, 0.0, 0.0)).z;
        println!("{integration}: {} nodes, middle {:.4} of theory", spatial.positions().len(), top / middle);
        assert!((top / middle - 1.0).abs() < within, "{integration}: {top} {middle}");
        // Below and beside it, as far as the target of a needle would be.
        for x in
            [Point::<3>::new(0.05, -0.02, -0.3), Point::<3>::new(0.4, 0.1, -0.25), Point::<3>::new(-0.3, -0.3, -0.5)]
        {
            let (found, expected) = (at(x), under_pressure(&x, 60));
            let off = (found - expected).norm() / expected.norm();
            println!("  {off:.4} off at {:?}", x.as_slice());
            assert!(off < within, "{integration} at {x}: {found} {expected}");
        }
    }
}
