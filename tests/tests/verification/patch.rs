//! Linear patch test: a linear displacement on the boundary must give the same linear displacement inside.

use model_offline::discretization::{Consistency, Integration, Method, Planar};
use model_offline::geometry::Point2;
use model_offline::material::{Law, Material as _};
use model_offline::mechanics::nitsche::Nitsche;
use model_offline::mechanics::{ConstrainedRows, Constraints, Tissue, WeaklyImposed};
use model_offline::solver::equilibrium::{DiscreteBody, Equilibrium, NewtonSettings};
use nalgebra::Matrix2;
use std::sync::Arc;
use tests::{jittered_rectangle, rectangle};

const SPACING: f64 = 0.1;

/// How the boundary learns of the linear field.
#[derive(Debug, Clone, Copy)]
enum Boundary {
    /// Nodal values on all of it, by the transformation method.
    Transformation,
    /// Weakly, on all of it.
    Nitsche,
    /// Tractions on all of it, and two corners constrained.
    Tractions,
}

fn gradient() -> Matrix2<f64> {
    Matrix2::new(0.01, 0.02, -0.015, 0.01)
}

fn on_boundary(x: &Point2) -> bool {
    [x.x, x.y].iter().any(|c| c.abs() < 1e-12 || (c - 1.0).abs() < 1e-12)
}

/// Largest error of the nodal displacements over the largest displacement, on 11 × 11 nodes of the unit square.
fn patch_error(boundary: Boundary, integration: Integration, consistency: Consistency, jitter: f64) -> f64 {
    let nodes = jittered_rectangle([1.0, 1.0], [10, 10], jitter, 11);
    let method = Method { consistency, ..Method::new(integration) };
    let planar = Planar::new(&rectangle(1.0, 1.0), &[], nodes, Some(SPACING), method).unwrap();
    let material = Law::linear(383.0, 318.5).unwrap();
    let tissue = Tissue::uniform(material.clone(), planar.cells().len());

    let corner = |x: &&Point2| x.y == 0.0 && (x.x == 0.0 || x.x == 1.0);
    let constrained: Vec<Point2> = match boundary {
        Boundary::Transformation => planar.positions().iter().filter(|x| on_boundary(x)).copied().collect(),
        Boundary::Tractions => planar.positions().iter().filter(corner).copied().collect(),
        Boundary::Nitsche => Vec::new(),
    };
    let weakly = match boundary {
        Boundary::Nitsche => planar.boundary_points().unwrap(),
        Boundary::Transformation | Boundary::Tractions => Vec::new(),
    };
    let load = match boundary {
        Boundary::Tractions => {
            let stress = material.respond(&gradient()).pk1_stress;
            planar.boundary_force(|_, normal| stress * normal).unwrap()
        }
        Boundary::Transformation | Boundary::Nitsche => vec![0.0; 2 * planar.positions().len()],
    };
    let prescribed_at = constrained.iter().copied().chain(weakly.iter().map(|p| p.position));
    let prescribed: Vec<f64> = prescribed_at.flat_map(|x| <[f64; 2]>::from(gradient() * x)).collect();
    let stencils: Vec<_> = constrained.iter().map(|x| planar.value_stencil(x).unwrap()).collect();
    let weak = (!weakly.is_empty()).then(|| Arc::new(Nitsche::new(&planar, &tissue, weakly)) as Arc<dyn WeaklyImposed>);

    let settings = NewtonSettings { residual_tolerance: 1e-12, ..Default::default() };
    let rows = ConstrainedRows::new(stencils.iter());
    let rule = Arc::clone(planar.rule());
    let body = DiscreteBody { rule, tissue, positions: planar.positions(), spacing: SPACING };
    let mut body = Equilibrium::at_rest(body, Constraints { rows, weak }, settings).unwrap();
    body.drive_loaded(&prescribed, &load).unwrap();
    let error =
        |x: &Point2| (planar.value_stencil(x).unwrap().interpolate(body.coefficients()) - gradient() * x).amax();
    let largest = planar.positions().iter().map(|x| (gradient() * x).amax()).fold(0.0, f64::max);
    planar.positions().iter().map(error).fold(0.0, f64::max) / largest
}

#[test]
fn consistent_boundary_terms_make_scni_exact() {
    for boundary in [Boundary::Nitsche, Boundary::Tractions] {
        for integration in [Integration::Scni, Integration::ScniStabilised, Integration::Mscni] {
            let error = patch_error(boundary, integration, Consistency::Uncorrected, 0.4);
            assert!(error < 1e-10, "{integration:?} {boundary:?}: {error:.1e}");
        }
    }
}

#[test]
fn the_consistent_correction_makes_every_rule_exact() {
    // Corrected DNI, one point per cell with the cell's boundary average, is SCNI.
    for integration in [Integration::Nsni, Integration::Gauss, Integration::FemT3, Integration::FemT6] {
        for boundary in [Boundary::Nitsche, Boundary::Tractions] {
            let error = patch_error(boundary, integration, Consistency::Corrected, 0.4);
            assert!(error < 1e-10, "{integration:?} {boundary:?}: {error:.1e}");
        }
    }
}

#[test]
fn rules_without_the_correction_fail_by_a_known_amount() {
    // They integrate rational functions inexactly: ∑ w ∇Ψ_I ≠ ∮ Ψ_I n.
    for (integration, low, high) in
        [(Integration::Dni, 1e-3, 0.5), (Integration::Nsni, 1e-4, 0.5), (Integration::Gauss, 1e-5, 0.1)]
    {
        let error = patch_error(Boundary::Tractions, integration, Consistency::Uncorrected, 0.4);
        println!("{integration:?} uncorrected: {error:.1e}");
        assert!((low..high).contains(&error), "{integration:?}: {error:.1e}");
    }
}

/// With the transformation method and the whole boundary prescribed, shape functions of interior nodes do not vanish between
/// boundary nodes, so even SCNI leaves a small error there. The expected sizes are an independent implementation's.
#[test]
fn the_transformation_method_leaves_the_error_of_an_independent_implementation() {
    for (integration, jitter, expected) in [
        (Integration::Scni, 0.0, 9e-4),
        (Integration::Scni, 0.4, 8e-4),
        (Integration::Dni, 0.0, 7e-4),
        (Integration::Dni, 0.4, 4e-2),
    ] {
        let error = patch_error(Boundary::Transformation, integration, Consistency::Uncorrected, jitter);
        println!("{integration:?}, jitter {jitter}: {error:.2e}");
        let found = error / expected;
        assert!((0.4..2.5).contains(&found), "{integration:?} {jitter}: {error:.2e}, expected {expected:.0e}");
    }
}
