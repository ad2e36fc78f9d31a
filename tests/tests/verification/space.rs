//! Three dimensions: controllability against continuum limits that an independent solver made (`golden/README.md`), closed
//! forms, rigid modes, consistency of the nodal rules, and the condensed body against whole solves.

use model_offline::discretization::meshing::{Request, stuff};
use model_offline::discretization::{Integration, Method, Resolution, Spatial, TetMesh};
use model_offline::geometry::{Point, Solid};
use model_offline::material::{Law, Material, Matrix};
use model_offline::mechanics::Tissue;
use model_offline::mechanics::assembly::{AssemblyState, Medium, internal_force, tangent};
use model_offline::mechanics::history::Prestress;
use model_offline::model::space::SpaceModel;
use model_offline::model::space::meshing::{MeshSize, mesh};
use model_offline::parallel;
use model_offline::placement::space::InsertionModel;
use model_offline::placement::space::rest::{CondensedRest, SpaceResponse};
use model_offline::placement::space::study::{SpaceStatic, place_in_space};
use model_offline::placement::space::workflow::{at_resolution, coarse, discretise};
use model_offline::scene::space::SpaceScene;
use model_offline::solver::analysis::Analysis;
use model_offline::solver::equilibrium::NewtonSettings;
use nalgebra::{DMatrix, Vector3};
use serde_json::Value;

fn golden() -> Value {
    serde_json::from_str(include_str!("../../golden/continuum3d.json")).unwrap()
}

/// A bundled scene by another method, with or without its inclusions, and its limits.
fn case(name: &str, inclusions: bool, integration: Integration) -> (SpaceScene, Value) {
    let scene = SpaceScene::bundled(name).unwrap();
    let method = Method { support: integration.default_support_in_space(), ..Method::new(integration) };
    let scene = scene.with_method(method);
    let limits = golden()[name][if inclusions { "inclusion" } else { "homogeneous" }].take();
    (if inclusions { scene } else { scene.without_inclusions() }, limits)
}

/// Worst relative errors of both measures over singles and pairs.
fn errors(responses: &[SpaceResponse], limits: &Value) -> [f64; 2] {
    let all = ["single", "pair"].into_iter().flat_map(|kind| limits[kind].as_array().unwrap());
    let mut worst = [0.0_f64; 2];
    for (response, limit) in responses.iter().zip(all) {
        let found = response.controllability.unwrap();
        for (k, (found, key)) in [(found.measure, "cm"), (found.full, "cm_full")].into_iter().enumerate() {
            worst[k] = worst[k].max((found / limit[key].as_f64().unwrap() - 1.0).abs());
        }
    }
    worst
}

/// Worst relative error of the first measure.
fn worst_of(responses: &[SpaceResponse], limits: &Value) -> f64 {
    let pairs = responses.iter().zip(limits.as_array().unwrap());
    let errors = pairs.map(|(r, limit)| r.controllability.unwrap().measure / limit["cm"].as_f64().unwrap() - 1.0);
    errors.fold(0.0, |worst, e| worst.max(e.abs()))
}

fn responses(scene: &SpaceScene, level: f64) -> (usize, Vec<SpaceResponse>) {
    let model = SpaceModel::on(scene, &mesh(scene, &MeshSize::level(level)).unwrap()).unwrap();
    (model.nodes(), model_offline::placement::space::rest::rest_responses(&model).unwrap())
}

#[test]
fn quadratic_tetrahedra_reach_the_continuum_limits_of_all_singles_and_pairs() {
    // The worst at level 1 is a pair whose patches touch, where the displacement jumps; all single paddles are within 1 %.
    reach(
        Integration::FemT10,
        &[
            ("block", false, 0.0, 0.025),
            ("block", true, 0.0, 0.025),
            ("block", false, 1.0, 0.015),
            ("mound", true, 1.0, 0.025),
            ("mound", false, 1.0, 0.025),
        ],
    );
}

#[test]
#[ignore = "minutes and 16 GB"]
fn fine_meshes_are_within_a_few_percent() {
    parallel::within(parallel::available(), || {
        reach(Integration::FemT10, &[("block", false, 2.0, 0.01), ("block", true, 2.0, 0.01)]);
        reach(Integration::FemT10, &[("mound", false, 2.0, 0.02), ("mound", true, 2.0, 0.02)]);
        reach(
            Integration::ScniStabilised,
            &[
                ("block", false, 2.0, 0.04),
                ("block", true, 2.0, 0.04),
                ("block", true, 3.0, 0.03),
                ("mound", false, 2.0, 0.06),
                ("mound", true, 2.0, 0.06),
                // The finest that is affordable, and what refinement to 5 % ends with.
                ("mound", false, 2.5, 0.04),
                ("mound", true, 2.5, 0.04),
            ],
        );
    });
}

/// Holds a rule on (scene, inclusions, level) to the continuum limits, within so much.
fn reach(integration: Integration, cases: &[(&str, bool, f64, f64)]) {
    for &(name, inclusions, level, within) in cases {
        let (scene, limits) = case(name, inclusions, integration);
        let (nodes, found) = responses(&scene, level);
        let errors = errors(&found, &limits);
        println!("{integration} {name} {inclusions} level {level}: {nodes} nodes, {errors:?}");
        assert!(errors.iter().all(|e| *e < within), "{name} {inclusions} level {level}: {errors:?}");
        let singles = worst_of(&found[..scene.paddles.len()], &limits["single"]);
        let quadratic = integration == Integration::FemT10;
        assert!(!quadratic || name == "mound" || level == 0.0 || singles < 0.01, "{singles}");
        // Without a paddle, too.
        let none = found.last().unwrap().target_per_depth;
        let limit = Vector3::from_fn(|k, _| limits["no_paddle"][k].as_f64().unwrap());
        assert!((none - limit).norm() < if quadratic { 0.02 } else { 0.04 } * limit.norm(), "{none} {limit}");
    }
}

#[test]
fn the_default_rule_comes_nearer_with_every_level() {
    let (scene, limits) = case("block", false, Integration::ScniStabilised);
    let (nodes, coarse) = responses(&scene, 0.0);
    let (finer_nodes, fine) = responses(&scene, 1.0);
    let (coarse, fine) = (errors(&coarse, &limits)[0], errors(&fine, &limits)[0]);
    println!("{nodes} nodes {coarse:.4}, {finer_nodes} nodes {fine:.4}");
    assert!(coarse < 0.17 && fine < 0.08 && fine < 0.6 * coarse, "{coarse} {fine}");
}

#[test]
fn a_tolerance_is_kept_and_its_estimate_is_no_smaller_than_the_error() {
    let (mut scene, limits) = case("block", false, Integration::FemT10);
    scene.discretization.resolution = Resolution::Tolerance(0.05);
    let found = discretise(&scene).unwrap();
    let (error, estimate) = (errors(&found.rest, &limits)[0], found.estimate.unwrap());
    // Of every paddle and pair, but for what the limits themselves leave open.
    let all = ["single", "pair"].into_iter().flat_map(|kind| limits[kind].as_array().unwrap());
    let estimates = estimate.by_set.iter().zip(&estimate.full_by_set);
    for ((response, limit), (of_measure, of_full)) in found.rest.iter().zip(all).zip(estimates) {
        let controls = response.controllability.unwrap();
        for (found, key, estimate) in [(controls.measure, "cm", of_measure), (controls.full, "cm_full", of_full)] {
            let error = found / limit[key].as_f64().unwrap() - 1.0;
            assert!(error.abs() < estimate + 0.003, "{} {key}: {error} {estimate}", limit["paddles"]);
            assert!(*estimate < 0.1, "{} {key}: {estimate}", limit["paddles"]);
        }
    }
    // And what the needle does to the target orthogonal to its axis, but for what the limits leave open (0.0008 of their length of 0.36).
    let all = ["single", "pair"].into_iter().flat_map(|kind| limits[kind].as_array().unwrap());
    let all: Vec<&Value> = all.map(|limit| &limit["target_per_depth"]).chain([&limits["no_paddle"]]).collect();
    assert_eq!((estimate.per_depth_by_set.len(), all.len()), (found.rest.len(), found.rest.len()));
    for ((response, limit), estimate) in found.rest.iter().zip(all).zip(&estimate.per_depth_by_set) {
        let limit = Vector3::from_fn(|k, _| limit[k].as_f64().unwrap());
        let off = scene.needle.axis.cross(&(response.target_per_depth - limit)).norm();
        assert!(off < estimate + 0.0008 && *estimate < 0.01, "{off} {estimate}");
    }
    println!("{error:.4} {}", estimate.controllability);
    assert!(error <= estimate.controllability + 0.003 && estimate.controllability <= 0.05, "{error} {estimate:?}");
}

/// A bundled scene as its user has it: at its own tolerance, by the method that `place` takes, against the continuum limits.
#[test]
#[ignore = "a minute: `.ci/long` runs it"]
fn a_bundled_body_is_placed_at_its_own_tolerance() {
    let scene = SpaceScene::bundled("mound").unwrap();
    let Resolution::Tolerance(tolerance) = scene.discretization.resolution else { panic!("a tolerance") };
    let limits = golden()["mound"]["inclusion"].take();
    let placed = parallel::within(parallel::available(), || discretise(&scene.for_placement())).unwrap();
    let (error, estimate) = (errors(&placed.rest, &limits)[0], placed.estimate.unwrap().controllability);
    println!("{} nodes, {error:.4}, estimated {estimate:.4}", placed.model.nodes());
    assert!(error <= tolerance && estimate <= tolerance, "{error} {estimate} {tolerance}");
}

/// The default rule is held against quadratic tetrahedra, which are refined as far as it needs.
#[test]
#[ignore = "half a minute: `.ci/long` runs it"]
fn a_tolerance_of_the_default_rule_is_kept_with_what_its_reference_leaves_open() {
    let (mut scene, limits) = case("block", false, Integration::ScniStabilised);
    scene.discretization.resolution = Resolution::Tolerance(0.15);
    let found = discretise(&scene).unwrap();
    let estimate = found.estimate.unwrap();
    println!("{} of which {}", estimate.controllability, estimate.reference);
    assert!(estimate.controllability <= 0.15 && estimate.reference < estimate.controllability, "{estimate:?}");
    let all = ["single", "pair"].into_iter().flat_map(|kind| limits[kind].as_array().unwrap());
    for ((response, limit), estimate) in found.rest.iter().zip(all).zip(&estimate.by_set) {
        let error = response.controllability.unwrap().measure / limit["cm"].as_f64().unwrap() - 1.0;
        assert!(error.abs() < estimate + 0.003, "{}: {error} {estimate}", limit["paddles"]);
    }
}

/// Insertions are followed on a coarse model, which is off beyond rest; by how much is estimated, and finer ones are off by no more.
#[test]
fn what_a_coarse_insertion_leaves_open_is_estimated() {
    let mut effectivities = Vec::new();
    for (name, depth) in [("block", 0.03), ("mound", 0.4)] {
        let (mut scene, _) = case(name, true, Integration::FemT10);
        (scene.needle.depth, scene.needle.increments) = (depth, 2);
        scene.paddles.truncate(3);
        scene.pairs = vec![[1, 2]];
        scene.discretization.resolution = Resolution::Level(0);
        let (accurate, rest) = at_resolution(&scene).unwrap();
        let linear = scene.with_method(Method::new(Integration::FemT4));
        let finer = SpaceModel::on(&linear, &mesh(&linear, &MeshSize::level(2)).unwrap()).unwrap();
        let [found, finer] = [coarse(&scene).unwrap(), finer].map(|model| {
            assert!(model.nodes() < 14_000, "{}", model.nodes());
            let insertions = InsertionModel::new(&scene, model, accurate.clone(), rest.clone());
            let placement = place_in_space(&insertions, parallel::available(), &|| ()).unwrap();
            let singles = placement.paddles.into_iter().map(|paddle| paddle.answer.static_study);
            let pairs = placement.pairs.into_iter().map(|pair| pair.answer.static_study);
            singles.chain(pairs).chain([placement.no_paddle.static_study]).collect::<Vec<_>>()
        });
        for (found, finer) in found.iter().zip(&finer) {
            assert!(found.failure.is_none() && finer.failure.is_none(), "{name}");
            let at_depth = |study: &SpaceStatic| Vector3::from(*study.target_displacement.last().unwrap());
            let off = scene.needle.axis.cross(&(at_depth(found) - at_depth(finer))).norm();
            let [estimate, finer] = [found, finer].map(|study| *study.nonlinear_error.last().unwrap());
            println!("{name}: {estimate:e} off {off:e}");
            // The finer one is off itself, by less.
            assert!(1.5 * off < estimate, "{name}");
            // What is followed on finer nodes leaves less open.
            assert!(finer < 0.75 * estimate, "{name}");
            effectivities.push(estimate / off);
        }
    }
    effectivities.sort_by(f64::total_cmp);
    let median = effectivities[effectivities.len() / 2];
    assert!(median < 8.0, "{effectivities:?}");
}

/// What attached paddles do, condensed, is what whole solves with them attached say: a single one, and a pair that touches.
#[test]
fn the_condensed_body_answers_as_the_whole_one() {
    let (scene, _) = case("block", true, Integration::FemT4);
    for integration in [Integration::FemT4, Integration::ScniStabilised] {
        let (scene, _) = (case("block", true, integration).0, &scene);
        let model = SpaceModel::on(&scene, &mesh(&scene, &MeshSize::level(0)).unwrap()).unwrap();
        let rest = CondensedRest::new(&model).unwrap();
        for attached in [vec![0], vec![2, 3]] {
            let condensed = rest.response(&attached).unwrap();
            let mut body = model.body(&attached, NewtonSettings::default()).unwrap();
            let whole = body.actuation_jacobian().unwrap();
            let apart = (&whole - &condensed.jacobian).norm() / whole.norm();
            assert!(apart < 1e-7, "{integration} {attached:?}: {apart:e}");
            let slope = body.depth_sensitivity().unwrap();
            assert!((slope - condensed.target_per_depth).norm() < 1e-7 * slope.norm(), "{integration} {attached:?}");
        }
    }
}

/// Confined compression and tension of the paper's law in space: what an independent evaluation gives for P₃₃.
#[test]
fn the_papers_law_in_space_has_its_closed_forms() {
    let law = Law::fung(383.0, 318.5, 0.779, 1.5, 1.0).unwrap();
    for (stretch, expected) in
        [(0.9, -87.4506), (0.8, -147.3198), (0.7, -182.6811), (0.6, -196.5891), (0.5, -192.0863), (1.2, 270.1327)]
    {
        let h = Matrix::<3>::from_diagonal(&Vector3::new(0.0, 0.0, stretch - 1.0));
        let found = law.respond(&h).pk1_stress[(2, 2)];
        assert!((found - expected).abs() < 1e-3, "{stretch}: {found}");
    }
}

/// A mesh that is no lattice: a ball of radius 1 with edges of about this length.
fn ball(edge: f64) -> TetMesh {
    let body = Solid::Sphere { centre: Point::<3>::new(0.1, -0.2, 0.3), radius: 1.0 };
    stuff(&Request {
        body: &body,
        interfaces: &[],
        patches: &[],
        size: &|_: &Point<3>| edge,
        lattice: None,
        most_nodes: 10_000,
        pinned: &[],
    })
    .unwrap()
}

const RULES: [Integration; 5] =
    [Integration::Scni, Integration::ScniStabilised, Integration::Mscni, Integration::FemT4, Integration::FemT10];

fn on_ball(integration: Integration, edge: f64) -> Spatial {
    let method = Method { support: integration.default_support_in_space(), ..Method::new(integration) };
    Spatial::new(&ball(edge), method, |_, _| None).unwrap()
}

/// Linear fields have their gradient at every point, and a constant stress pulls on no node whose shape function does not
/// reach the boundary: what the patch test asks for. Whatever pulls on the others is the traction: it sums to nothing.
#[test]
fn every_rule_passes_the_patch_test() {
    let slope = nalgebra::Matrix3::new(0.3, -0.1, 0.2, 0.5, 0.1, -0.4, 0.2, 0.6, -0.2);
    for integration in RULES {
        let spatial = on_ball(integration, 0.2);
        let (rule, positions) = (spatial.rule(), spatial.positions());
        let mut pull = vec![Vector3::zeros(); positions.len()];
        for point in rule.points() {
            let gradient =
                point.nodes.iter().zip(point.gradients).fold(nalgebra::Matrix3::zeros(), |sum, (&i, g)| {
                    sum + slope * positions[i as usize] * g.transpose()
                });
            assert!((gradient - slope).norm() < 1e-10, "{integration}: {gradient}");
            for (&i, g) in point.nodes.iter().zip(point.gradients) {
                pull[i as usize] += g * point.weight;
            }
        }
        let centre = Point::<3>::new(0.1, -0.2, 0.3);
        let inner = |i: &usize| (positions[*i] - centre).norm() < 0.25;
        let inside: Vec<usize> = (0..positions.len()).filter(inner).collect();
        assert!(!inside.is_empty(), "{integration}");
        assert!(inside.iter().all(|&i| pull[i].norm() < 1e-10), "{integration}");
        assert!(pull.iter().sum::<Vector3<f64>>().norm() < 1e-10, "{integration}");
    }
}

#[test]
fn a_free_body_has_six_rigid_modes_and_no_other() {
    let law = Law::fung(383.0, 318.5, 0.779, 1.5, 1.0).unwrap();
    for integration in RULES {
        let spatial = on_ball(integration, 0.6);
        let (rule, n) = (spatial.rule(), 3 * spatial.positions().len());
        let tissue = Tissue::uniform(law.clone(), spatial.volumes().len());
        let analysis = Analysis::new(rule, spatial.positions(), std::iter::empty());
        let stabilisation = analysis.stabilisation(rule, &tissue);
        let prestress = Prestress::default();
        let medium = Medium { rule, stabilisation: &stabilisation, tissue: &tissue, prestress: &prestress };
        let (mut state, mut force) = (AssemblyState::default(), vec![0.0; n]);
        internal_force(medium, &vec![0.0; n], &mut state, &mut force).unwrap();
        let mut values = vec![0.0; analysis.pattern().entries()];
        tangent(medium, &state, analysis.blocks(), &mut values);
        let column = |j: usize| {
            let (mut unit, mut image) = (vec![0.0; n], vec![0.0; n]);
            unit[j] = 1.0;
            analysis.pattern().multiply::<3>(&values, &unit, &mut image);
            image
        };
        let dense = DMatrix::from_iterator(n, n, (0..n).flat_map(column));
        let eigenvalues = dense.symmetric_eigenvalues();
        let zero = eigenvalues.iter().filter(|v| v.abs() < 1e-9 * eigenvalues.max()).count();
        assert_eq!(zero, 6, "{integration}: {n} unknowns");
    }
}
