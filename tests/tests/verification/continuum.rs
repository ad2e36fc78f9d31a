//! Controllability and small-depth displacement against the continuum limits of the paper's two inferred geometries, which
//! an independent implementation made (`golden/README.md`).

use model_offline::discretization::{Integration, Method, Resolution};
use model_offline::model::graded_model;
use model_offline::parallel::{map_each, threads};
use model_offline::placement::adaptive::discretise;
use model_offline::placement::rest::rest_responses;
use model_offline::scene::Scene;
use tests::continuum::{Limit, errors, limits};

fn cases() -> Vec<(Scene, Vec<Limit>)> {
    [("paper", "paper"), ("paper-hull", "hull")]
        .into_iter()
        .flat_map(|(name, key)| {
            let scene = Scene::bundled(name).unwrap();
            let homogeneous = scene.without_inclusions();
            [(scene, limits(key, "inclusion")), (homogeneous, limits(key, "homogeneous"))]
        })
        .collect()
}

#[test]
fn a_tolerance_of_one_percent_is_kept_by_quadratic_triangles() {
    for (mut scene, limits) in cases() {
        scene.discretization.method.integration = Integration::FemT6;
        scene.discretization.resolution = Resolution::Tolerance(0.01);
        let (model, estimate) = discretise(&scene).unwrap();
        let found = errors(&rest_responses(&model).unwrap(), &limits);
        let estimate = estimate.unwrap();
        println!("{} {}: {} nodes, {found:?}, {estimate:?}", scene.name, scene.tissue(), model.nodes());
        assert!(
            found.controllability <= 0.01 && found.displacement <= 0.01,
            "{} {}: {found:?}",
            scene.name,
            scene.tissue()
        );
        // Neither smaller than the error, but for the limits' own 0.1 %, nor three times as large.
        assert!(estimate.controllability <= 0.01 && found.controllability <= estimate.controllability + 0.001);
        assert!(estimate.controllability <= 3.0 * found.controllability + 0.003, "{found:?}, {estimate:?}");
    }
}

#[test]
#[ignore = "a minute: `.ci/long` runs it"]
fn a_tolerance_of_one_percent_is_kept_by_scni() {
    map_each(cases(), threads(None), |(mut scene, limits)| {
        scene.discretization.resolution = Resolution::Tolerance(0.01);
        let (model, _) = discretise(&scene).unwrap();
        let found = errors(&rest_responses(&model).unwrap(), &limits);
        println!("{} {}: {} nodes, {found:?}", scene.name, scene.tissue(), model.nodes());
        assert!(
            found.controllability <= 0.01 && found.displacement <= 0.01,
            "{} {}: {found:?}",
            scene.name,
            scene.tissue()
        );
    });
}

#[test]
fn every_method_converges_to_the_continuum_on_graded_nodes() {
    let scene = Scene::bundled("paper").unwrap().without_inclusions();
    let limits = limits("paper", "homogeneous");
    for (integration, at_level_2) in [
        (Integration::Dni, 0.02),
        (Integration::Scni, 0.015),
        (Integration::ScniStabilised, 0.004),
        (Integration::Mscni, 0.004),
        (Integration::Nsni, 0.004),
        (Integration::Gauss, 0.004),
        (Integration::FemT3, 0.015),
        (Integration::FemT6, 0.004),
    ] {
        let method = Method::new(integration);
        let error = |level| {
            errors(&rest_responses(&graded_model(&scene, method, level).unwrap()).unwrap(), &limits).controllability
        };
        let (coarse, fine) = (error(0), error(2));
        println!("{integration:?}: {coarse:.4} {fine:.4}");
        assert!(fine < at_level_2 && fine < coarse, "{integration:?}: {coarse} then {fine}");
    }
}

#[test]
fn the_static_optimum_moves_with_the_mesh_and_the_dynamic_one_does_not() {
    // In the continuum limit of the paper's scene the best static paddle in homogeneous tissue is paddle 2, not 4.
    let limits = limits("paper", "homogeneous");
    let best = |key: &dyn Fn(&Limit) -> f64| {
        1 + (0..limits.len()).min_by(|&a, &b| key(&limits[a]).total_cmp(&key(&limits[b]))).unwrap()
    };
    assert_eq!((best(&|l| l.target_per_depth.x.abs()), best(&|l| l.controllability_measure)), (2, 3));
    let scene = Scene::bundled("paper").unwrap().without_inclusions();
    let method = Method::new(Integration::FemT6);
    let fine = rest_responses(&graded_model(&scene, method, 2).unwrap()).unwrap();
    let smallest =
        (0..5).min_by(|&a, &b| fine[a].target_per_depth.x.abs().total_cmp(&fine[b].target_per_depth.x.abs()));
    assert_eq!(smallest, Some(1));
}
