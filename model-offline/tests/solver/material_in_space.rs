//! Laws in three dimensions: stress and tangent against finite differences, frame invariance, stability at rest.

use model_offline::material::{FungTensors, Law, Material, MaterialError, Matrix};
use nalgebra::{Rotation3, Vector3};

/// Every law that holds in space, with and without a barrier.
fn laws() -> Vec<Law> {
    [frame_indifferent_laws(), with_and_without_barrier([Law::linear(383.0, 318.5).unwrap()])].concat()
}

/// All but linear elasticity, which is meant for small strains.
fn frame_indifferent_laws() -> Vec<Law> {
    let laws = [
        Law::fung(383.0, 318.5, 10.0, 1.5, 1.0),
        Law::saint_venant_kirchhoff(383.0, 318.5),
        Law::neo_hookean(383.0, 318.5),
    ];
    with_and_without_barrier(laws.map(Result::unwrap))
}

fn with_and_without_barrier<const N: usize>(plain: [Law; N]) -> Vec<Law> {
    let guarded = plain.clone().map(|law| law.with_barrier(200.0).unwrap());
    plain.into_iter().chain(guarded).collect()
}

/// A displacement gradient without any symmetry, entries up to `size`.
fn gradient(seed: u32, size: f64) -> Matrix<3> {
    Matrix::from_fn(|i, j| size * (f64::from(seed) * 1.7 + 2.3 * i as f64 + 0.9 * j as f64).sin())
}

#[test]
fn stress_is_the_slope_of_energy_and_tangent_the_slope_of_stress() {
    for law in laws() {
        for seed in 0..10 {
            let h = gradient(seed, 0.2);
            let (response, tangent) = (law.respond(&h), law.tangent(&h));
            let scale = Material::<3>::rest_stiffness(&law);
            for (k, l) in (0..9).map(|n| (n / 3, n % 3)) {
                let mut step = Matrix::<3>::zeros();
                step[(k, l)] = 1e-5;
                let (ahead, behind) = (law.respond(&(h + step)), law.respond(&(h - step)));
                let slope = (ahead.energy - behind.energy) / 2e-5;
                assert!((slope - response.pk1_stress[(k, l)]).abs() < 1e-6 * scale, "{law:?}: {slope}");
                let slope = (ahead.pk1_stress - behind.pk1_stress) / 2e-5;
                for (i, j) in (0..9).map(|n| (n / 3, n % 3)) {
                    assert!((slope[(i, j)] - tangent[i][j][k][l]).abs() < 1e-6 * scale, "{law:?}: {i}{j}{k}{l}");
                }
            }
        }
    }
}

#[test]
fn energy_does_not_depend_on_the_frame_and_stress_turns_with_it() {
    for law in frame_indifferent_laws() {
        for seed in 0..10 {
            let (h, identity) = (gradient(seed, 0.2), Matrix::<3>::identity());
            let q = Rotation3::new(Vector3::new(0.3, -1.1, 0.7) * f64::from(seed)).into_inner();
            let (here, turned) = (law.respond(&h), law.respond(&(q * (identity + h) - identity)));
            assert!((here.energy - turned.energy).abs() <= 1e-11 * (1.0 + here.energy), "{law:?}");
            assert!((q * here.pk1_stress - turned.pk1_stress).norm() <= 1e-10 * (1.0 + here.pk1_stress.norm()));
        }
    }
}

#[test]
fn plane_strain_is_a_slice_of_the_solid() {
    for law in laws() {
        let h = gradient(3, 0.2);
        let plane = h.fixed_view::<2, 2>(0, 0).into_owned();
        let mut solid = Matrix::<3>::zeros();
        solid.fixed_view_mut::<2, 2>(0, 0).copy_from(&plane);
        let (two, three) = (law.respond(&plane), law.respond(&solid));
        assert!((two.energy - three.energy).abs() <= 1e-12 * three.energy.abs(), "{law:?}");
        let slice = three.pk1_stress.fixed_view::<2, 2>(0, 0).into_owned();
        assert!((two.pk1_stress - slice).norm() <= 1e-12 * slice.norm(), "{law:?}");
    }
}

/// λ + 2μ/3 > 0 is what keeps a solid from swelling by itself; λ + μ > 0 would do in the plane.
#[test]
fn a_solid_that_would_swell_by_itself_is_refused() {
    let mu = 3.0;
    for lambda in [-0.7 * mu, -0.99 * mu] {
        for law in [Law::linear(lambda, mu), Law::neo_hookean(lambda, mu), Law::fung(lambda, mu, 0.0, 0.0, 0.0)] {
            // The lowest eigenvalue is that of a pure change of volume, 3λ + 2μ.
            match law {
                Err(MaterialError::Unstable(lowest)) => {
                    assert!((lowest - (3.0 * lambda + 2.0 * mu)).abs() < 1e-12 * mu, "{lowest}");
                }
                other => panic!("λ = {lambda}: {other:?}"),
            }
        }
    }
    assert!(Law::linear(-0.66 * mu, mu).is_ok());
}

/// A law whose stability drowns in rounding is not called unstable, on either side; one that resists some strain not at all is.
#[test]
fn a_law_that_rounding_decides_on_says_so() {
    for lambda in [1e12, 1e13, 1e15, 1e20, -2.0 / 3.0 * (1.0 - 1e-14)] {
        for law in [Law::linear(lambda, 1.0), Law::neo_hookean(lambda, 1.0), Law::fung(lambda, 1.0, 0.0, 0.0, 0.0)] {
            assert_eq!(law, Err(MaterialError::TooFarApart), "{lambda}");
        }
    }
    assert!(Law::linear(1e11, 1.0).is_ok() && Law::linear(-0.66, 1.0).is_ok());
    assert!(matches!(Law::linear(1.0, 0.0), Err(MaterialError::Unstable(_))));
    assert!(matches!(Law::linear(-0.7, 1.0), Err(MaterialError::Unstable(_))));
    assert!(matches!(Law::neo_hookean(1e300, 1e300), Err(MaterialError::NotFinite(_))));
}

#[test]
fn moduli_at_rest_are_those_of_the_linear_law() {
    for law in laws() {
        let (two, three) = (Material::<2>::rest_stiffness(&law), Material::<3>::rest_stiffness(&law));
        let linear = law.linearised();
        assert!((two - Material::<2>::rest_stiffness(&linear)).abs() < 1e-10 * two);
        assert!((three - two).abs() < 1e-12 * two, "isotropic: {two} {three}");
    }
}

#[test]
fn negative_exponents_are_refused_and_tensors_say_nothing_outside_the_plane() {
    assert_eq!(Law::fung(383.0, 318.5, 1.0, -0.1, 1.0), Err(MaterialError::Negative("lambda_c")));
    assert_eq!(Law::fung(383.0, 318.5, 1.0, 1.5, -0.1), Err(MaterialError::Negative("mu_c")));
    let entries = [(0, 0, 0, 0, 3.0), (1, 1, 1, 1, 3.0), (0, 1, 0, 1, 1.0)];
    let planar = FungTensors::from_entries(&entries, &[], 0.0).unwrap();
    assert_eq!(Material::<3>::check_stable_at_rest(&planar), Err(MaterialError::PlanarOnly));
    assert!(Material::<2>::check_stable_at_rest(&planar).is_ok());
}
