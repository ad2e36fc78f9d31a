//! Controllability and small-depth displacement against continuum limits of the paper's two inferred geometries.
//!
//! `golden/continuum.json` holds the limits: quadratic finite elements graded towards every singular point, 70,000 to
//! 90,000 degrees of freedom, by an independent implementation, good to about 0.1 %.

use model_offline::discretization::{Integration, Method, Resolution};
use model_offline::model::graded_model;
use model_offline::placement::adaptive::discretise;
use model_offline::placement::rest::rest_responses;
use model_offline::scene::Scene;

struct Limit {
    measure: f64,
    per_depth: nalgebra::Vector2<f64>,
}

fn limits(scene: &str, tissue: &str) -> Vec<Limit> {
    let golden: serde_json::Value = serde_json::from_str(include_str!("../golden/continuum.json")).unwrap();
    golden[scene][tissue]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| Limit {
            measure: p["controllability_measure"].as_f64().unwrap(),
            per_depth: nalgebra::Vector2::new(
                p["target_per_depth"][0].as_f64().unwrap(),
                p["target_per_depth"][1].as_f64().unwrap(),
            ),
        })
        .collect()
}

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

/// Worst error of the measures, and of the displacements over the largest one.
fn errors(responses: &[model_offline::placement::rest::RestResponse], limits: &[Limit]) -> (f64, f64) {
    let largest = limits.iter().map(|l| l.per_depth.norm()).fold(0.0, f64::max);
    responses.iter().zip(limits).fold((0.0, 0.0), |(m, d): (f64, f64), (r, l)| {
        (
            m.max((r.controllability_measure / l.measure - 1.0).abs()),
            d.max((r.target_per_depth - l.per_depth).amax() / largest),
        )
    })
}

#[test]
fn a_tolerance_of_one_percent_is_kept_by_quadratic_triangles() {
    for (mut scene, limits) in cases() {
        scene.discretization.method.integration = Integration::FemT6;
        scene.discretization.resolution = Resolution::Tolerance(0.01);
        let (model, estimate) = discretise(&scene).unwrap();
        let (measure, displacement) = errors(&rest_responses(&model).unwrap(), &limits);
        let estimate = estimate.unwrap();
        println!(
            "{} {}: {} nodes, {measure:.4} {displacement:.4}, {estimate:?}",
            scene.name,
            scene.tissue(),
            model.nodes()
        );
        assert!(measure < 0.01 && displacement < 0.02, "{} {}: {measure} {displacement}", scene.name, scene.tissue());
        assert!(estimate.controllability <= 0.01);
    }
}

#[test]
fn a_tolerance_of_one_percent_is_kept_by_scni() {
    for (mut scene, limits) in cases() {
        scene.discretization.resolution = Resolution::Tolerance(0.01);
        let (model, _) = discretise(&scene).unwrap();
        let (measure, displacement) = errors(&rest_responses(&model).unwrap(), &limits);
        println!("{} {}: {} nodes, {measure:.4} {displacement:.4}", scene.name, scene.tissue(), model.nodes());
        assert!(measure < 0.01 && displacement < 0.02, "{} {}: {measure} {displacement}", scene.name, scene.tissue());
    }
}

#[test]
fn every_method_converges_to_the_continuum_on_graded_nodes() {
    let scene = Scene::bundled("paper").unwrap().without_inclusions();
    let limits = limits("paper", "homogeneous");
    for (integration, at_level_2) in [
        (Integration::Scni, 0.015),
        (Integration::Nsni, 0.004),
        (Integration::Gauss, 0.004),
        (Integration::FemT3, 0.015),
        (Integration::FemT6, 0.004),
    ] {
        let method = Method::new(integration);
        let error = |level| errors(&rest_responses(&graded_model(&scene, method, level).unwrap()).unwrap(), &limits).0;
        let (coarse, fine) = (error(0), error(2));
        println!("{integration:?}: {coarse:.4} {fine:.4}");
        assert!(fine < at_level_2 && fine < coarse, "{integration:?}: {coarse} then {fine}");
    }
}

#[test]
fn the_static_optimum_moves_with_the_mesh_and_the_dynamic_one_does_not() {
    // In the continuum limit of the paper's scene the best fixture in homogeneous tissue is paddle 2, not 4.
    let limits = limits("paper", "homogeneous");
    let best = |key: &dyn Fn(&Limit) -> f64| {
        1 + (0..limits.len()).min_by(|&a, &b| key(&limits[a]).total_cmp(&key(&limits[b]))).unwrap()
    };
    assert_eq!((best(&|l| l.per_depth.x.abs()), best(&|l| l.measure)), (2, 3));
    let scene = Scene::bundled("paper").unwrap().without_inclusions();
    let method = Method::new(Integration::FemT6);
    let fine = rest_responses(&graded_model(&scene, method, 2).unwrap()).unwrap();
    let smallest =
        (0..5).min_by(|&a, &b| fine[a].target_per_depth.x.abs().total_cmp(&fine[b].target_per_depth.x.abs()));
    assert_eq!(smallest, Some(1));
}
