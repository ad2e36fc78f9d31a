//! Stress and tangent of every law against closed forms, finite differences and frame invariance.

use model_offline::material::{FungTensors, Law, Material as _, Matrix, determinant};
use nalgebra::{Matrix2, Matrix3};
use tests::Pcg32;

/// Table I of the paper, entry for entry.
const TABLE_I_A: [(u32, u32, u32, u32, f64); 8] = [
    (0, 0, 0, 0, 1020.0),
    (1, 1, 1, 1, 1020.0),
    (0, 1, 0, 1, 254.0),
    (1, 0, 1, 0, 254.0),
    (0, 0, 1, 1, 383.0),
    (1, 1, 0, 0, 383.0),
    (0, 1, 1, 0, 383.0),
    (1, 0, 0, 1, 383.0),
];
const TABLE_I_C: [(u32, u32, u32, u32, f64); 8] = [
    (0, 0, 0, 0, 3.5),
    (1, 1, 1, 1, 3.5),
    (0, 1, 0, 1, 0.5),
    (1, 0, 1, 0, 0.5),
    (0, 0, 1, 1, 1.5),
    (1, 1, 0, 0, 1.5),
    (0, 1, 1, 0, 1.5),
    (1, 0, 0, 1, 1.5),
];

fn paper_law(c: f64) -> Law {
    Law::fung(383.0, 318.5, c, 1.5, 1.0).unwrap()
}

fn laws() -> Vec<(&'static str, Law)> {
    let general = Law::fung_general(FungTensors::from_entries(&TABLE_I_A, &TABLE_I_C, 10.0).unwrap()).unwrap();
    vec![
        ("fung", paper_law(10.0)),
        ("fung general", general),
        ("st venant-kirchhoff", Law::saint_venant_kirchhoff(383.0, 318.5).unwrap()),
        ("neo-hookean", Law::neo_hookean(383.0, 318.5).unwrap()),
        ("linear", Law::linear(383.0, 318.5).unwrap()),
        ("fung with barrier", paper_law(10.0).with_barrier(50.0).unwrap()),
    ]
}

fn gradient(scatter: &mut Pcg32, size: f64) -> Matrix<2> {
    Matrix2::from_fn(|_, _| size * scatter.sample())
}

#[test]
fn table_i_is_isotropic_with_the_published_moduli() {
    let general = Law::fung_general(FungTensors::from_entries(&TABLE_I_A, &TABLE_I_C, 0.779).unwrap()).unwrap();
    let mut scatter = Pcg32::new(1);
    for _ in 0..50 {
        let h = gradient(&mut scatter, 0.3);
        let (a, b) = (general.respond(&h), paper_law(0.779).respond(&h));
        assert!((a.pk1_stress - b.pk1_stress).norm() <= 1e-12 * b.pk1_stress.norm());
        assert!((a.energy - b.energy).abs() <= 1e-12 * b.energy.abs().max(1.0));
    }
}

#[test]
fn closed_form_stresses_confined_compression_and_extension() {
    // Reference values to four decimals, law c = 0.779.
    for (stretch, expected) in [
        (0.9, -87.4506),
        (0.8, -147.3198),
        (0.7, -182.6811),
        (0.6, -196.5891),
        (0.5, -192.0863),
        (1.2, 270.1327),
        (1.5, 966.2809),
    ] {
        let p = paper_law(0.779).respond(&Matrix2::new(0.0, 0.0, 0.0, stretch - 1.0)).pk1_stress;
        assert!((p[(1, 1)] - expected).abs() < 6e-5, "{stretch}: {}", p[(1, 1)]);
    }
}

#[test]
fn closed_form_stresses_with_free_lateral_faces() {
    for (stretch, lateral, expected) in [(0.8, 1.065_473, -126.5239), (0.7, 1.091_598, -156.8798)] {
        let law = paper_law(0.779);
        let p = |x: f64| law.respond(&Matrix2::new(x - 1.0, 0.0, 0.0, stretch - 1.0)).pk1_stress;
        let (mut low, mut high) = (1.0, 1.2);
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if p(middle)[(0, 0)] < 0.0 { low = middle } else { high = middle }
        }
        assert!((low - lateral).abs() < 6e-7, "{low}");
        assert!((p(low)[(1, 1)] - expected).abs() < 6e-5);
    }
}

#[test]
fn closed_form_stresses_simple_shear() {
    let p = paper_law(0.779).respond(&Matrix2::new(0.0, 0.5, 0.0, 0.0)).pk1_stress;
    for (at, expected) in [((0, 0), 127.9622), ((0, 1), 223.7593), ((1, 0), 159.7782), ((1, 1), 127.9622)] {
        assert!((p[at] - expected).abs() < 6e-5, "{at:?}: {}", p[at]);
    }
}

#[test]
fn nominal_stress_peaks_where_the_law_loses_stability() {
    // A_2222 = dP22/dF22 changes sign at the published stretches.
    for (c, expected) in [(0.0, 0.5773), (0.779, 0.5768), (100.0, 0.523), (1000.0, 0.452)] {
        let slope = |s: f64| paper_law(c).tangent(&Matrix2::new(0.0, 0.0, 0.0, s - 1.0))[1][1][1][1];
        let (mut low, mut high) = (0.3, 0.9);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if slope(middle) < 0.0 { low = middle } else { high = middle }
        }
        assert!((low - expected).abs() < 6e-4, "c = {c}: {low}");
    }
}

#[test]
fn stress_is_the_slope_of_energy_and_tangent_the_slope_of_stress() {
    let mut scatter = Pcg32::new(2);
    for (name, law) in laws() {
        for _ in 0..20 {
            let h = gradient(&mut scatter, 0.25);
            let (response, tangent) = (law.respond(&h), law.tangent(&h));
            let step = 1e-5;
            for k in 0..2 {
                for l in 0..2 {
                    let mut d = Matrix2::zeros();
                    d[(k, l)] = step;
                    let (ahead, behind) = (law.respond(&(h + d)), law.respond(&(h - d)));
                    let slope = (ahead.energy - behind.energy) / (2.0 * step);
                    assert!((slope - response.pk1_stress[(k, l)]).abs() < 1e-6 * 1e3, "{name}");
                    let dp = (ahead.pk1_stress - behind.pk1_stress) / (2.0 * step);
                    for i in 0..2 {
                        for j in 0..2 {
                            let exact = tangent[i][j][k][l];
                            assert!((dp[(i, j)] - exact).abs() < 1e-6 * 1e3, "{name} {exact} {}", dp[(i, j)]);
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn the_same_holds_in_three_dimensions() {
    let mut scatter = Pcg32::new(3);
    for law in [paper_law(10.0), Law::neo_hookean(383.0, 318.5).unwrap().with_barrier(20.0).unwrap()] {
        let h = Matrix3::from_fn(|_, _| 0.2 * scatter.sample());
        let tangent = law.tangent(&h);
        for k in 0..3 {
            for l in 0..3 {
                let mut d = Matrix3::zeros();
                d[(k, l)] = 1e-5;
                let dp = (law.respond(&(h + d)).pk1_stress - law.respond(&(h - d)).pk1_stress) / 2e-5;
                for i in 0..3 {
                    for j in 0..3 {
                        assert!((dp[(i, j)] - tangent[i][j][k][l]).abs() < 1e-3);
                    }
                }
            }
        }
    }
}

#[test]
fn energy_does_not_depend_on_the_frame_and_stress_turns_with_it() {
    let mut scatter = Pcg32::new(4);
    for (name, law) in laws().into_iter().filter(|(name, _)| *name != "linear") {
        for _ in 0..20 {
            let f = Matrix2::identity() + gradient(&mut scatter, 0.25);
            let angle = 3.0 * scatter.sample();
            let q = Matrix2::new(angle.cos(), -angle.sin(), angle.sin(), angle.cos());
            let here = law.respond(&(f - Matrix2::identity()));
            let turned = law.respond(&(q * f - Matrix2::identity()));
            assert!((here.energy - turned.energy).abs() <= 1e-11 * (1.0 + here.energy), "{name}");
            assert!(
                (q * here.pk1_stress - turned.pk1_stress).norm() <= 1e-10 * (1.0 + here.pk1_stress.norm()),
                "{name}"
            );
        }
    }
}

#[test]
fn the_energy_of_a_strain_does_not_depend_on_its_direction() {
    // The trap: shear modulus 254 instead of 318.5 makes the tangent anisotropic, so that a rotated uniaxial strain
    // costs another energy. The symmetrised law has no such direction.
    let law = paper_law(0.0);
    let energy = |angle: f64| {
        let q = Matrix2::new(angle.cos(), -angle.sin(), angle.sin(), angle.cos());
        law.respond(&(q * Matrix2::new(0.1, 0.0, 0.0, 0.0) * q.transpose())).energy
    };
    assert!((energy(0.0) - energy(0.6)).abs() < 1e-12 * energy(0.0));
}

#[test]
fn barrier_is_not_felt_at_small_strain_and_is_felt_in_strong_compression() {
    let (plain, guarded) = (paper_law(0.779), paper_law(0.779).with_barrier(500.0).unwrap());
    let zero = Matrix2::zeros();
    assert_eq!(plain.tangent(&zero), guarded.tangent(&zero));
    let squeezed = Matrix2::new(0.0, 0.0, 0.0, -0.7);
    assert!(plain.tangent(&squeezed)[1][1][1][1] < 0.0);
    assert!(guarded.tangent(&squeezed)[1][1][1][1] > 0.0);
    assert!((determinant(&(Matrix2::identity() + squeezed)) - 0.3).abs() < 1e-15);
}

#[test]
fn unusable_moduli_are_refused() {
    assert!(Law::fung(383.0, -1.0, 0.0, 0.0, 0.0).is_err());
    assert!(Law::fung(f64::NAN, 1.0, 0.0, 0.0, 0.0).is_err());
    assert!(Law::fung(383.0, 318.5, -1.0, 1.5, 1.0).is_err());
    assert!(Law::linear(-2.0, 1.0).is_err());
    assert!(FungTensors::from_entries(&[(0, 0, 0, 2, 1.0)], &[], 0.0).is_err());
    assert!(paper_law(0.0).with_barrier(f64::INFINITY).is_err());
}

/// At strains of 1e-7 a law counted as a difference of numbers near 1 has nothing left but rounding; the quadratic form of
/// linear elasticity is exact there to 1e-6.
#[test]
fn energies_of_tiny_strains_are_those_of_linear_elasticity() {
    let linear = Law::linear(383.0, 318.5).unwrap();
    let h = Matrix2::new(2.0e-7, -0.7e-7, 1.1e-7, -0.4e-7);
    let solid = Matrix3::new(2.0e-7, -0.7e-7, 0.3e-7, 1.1e-7, -0.4e-7, 0.9e-7, 0.2e-7, -0.8e-7, 1.3e-7);
    for (name, law) in laws().into_iter().filter(|(name, _)| ["neo-hookean", "st venant-kirchhoff"].contains(name)) {
        let planar = law.respond(&h).energy / linear.respond(&h).energy - 1.0;
        let full = law.respond(&solid).energy / linear.respond(&solid).energy - 1.0;
        assert!(planar.abs() < 2e-6 && full.abs() < 2e-6, "{name}: {planar:e} {full:e}");
    }
}
