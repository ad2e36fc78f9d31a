//! Error against time in space: every method on one body, and what a general finite-element code took for the same.
//!
//! The job is `placement`: mesh, shape functions, and the Jacobians and small-depth displacements of all paddles and pairs, from one
//! factorisation; against quadratic tetrahedra that are refined further than the rest.

use super::extent::Extent;
use super::measurement::{Job, Linearity, Measurement, Peer};
use super::pareto::{Pareto, mark_front};
use crate::discretization::{Discretization, Integration, Method, Resolution};
use crate::model::ModelError;
use crate::model::space::SpaceModel;
use crate::placement::space::Discretised;
use crate::placement::space::distances;
use crate::placement::space::rest::SpaceResponse;
use crate::placement::space::workflow::{at_resolution, discretise};
use crate::scene::space::SpaceScene;
use nalgebra::{Matrix3x2, Vector2};
use std::time::Instant;

/// Estimated error of the reference, at most.
const OPEN: f64 = 0.02;
const OPEN_QUICK: f64 = 0.15;
/// A family is not refined beyond a candidate that took longer than this, s.
const LONGEST_S: f64 = 10.0;
const LONGEST_QUICK_S: f64 = 0.5;
/// Factors by which time grows from a level to the next, at least: what would take too long is not begun.
const GROWTH: f64 = 4.0;
/// Candidates that take less are run again; the best counts.
const QUICK_S: f64 = 1.0;
const REPEATS: u32 = 3;
/// Even spacings, over the length of the body's diagonal: lattices halve, so that others between give the same meshes.
const EVEN: [f64; 4] = [0.08, 0.04, 0.02, 0.01];

/// DOLFINx 0.5 with MUMPS (OpenBLAS, SCOTCH) on the homogeneous `block`: eight single paddles, a factorisation each, on grids of
/// tetrahedra without or with grading, CPU seconds on one thread of a 2-core AMD EPYC virtual machine, best of two. Errors against the
/// continuum limits in `tests/golden`.
const DOLFINX: [Peer; 8] = [
    Peer { dofs: 3_993, quadratic: false, wall_s: 0.331, error: 0.387 },
    Peer { dofs: 10_125, quadratic: false, wall_s: 1.43, error: 0.281 },
    Peer { dofs: 27_783, quadratic: false, wall_s: 7.863, error: 0.222 },
    Peer { dofs: 22_743, quadratic: false, wall_s: 4.886, error: 0.245 },
    Peer { dofs: 89_373, quadratic: false, wall_s: 56.071, error: 0.155 },
    Peer { dofs: 27_783, quadratic: true, wall_s: 8.204, error: 0.139 },
    Peer { dofs: 29_925, quadratic: true, wall_s: 9.477, error: 0.127 },
    Peer { dofs: 89_373, quadratic: true, wall_s: 70.698, error: 0.137 },
];

/// Compares every method on a scene in space; `progress` is told how much is done, from 0 to 1. Times are those of one thread.
///
/// # Errors
/// [`ModelError`] when not even the reference can be computed.
pub fn compare_in_space(scene: &SpaceScene, extent: Extent, progress: &dyn Fn(f64)) -> Result<Pareto, ModelError> {
    let open = extent.choose(OPEN, OPEN_QUICK);
    let reference = discretise(&with(scene, Method::new(Integration::FemT10), Resolution::Tolerance(open)))?;
    progress(0.3);
    let methods = Integration::SPATIAL;
    let longest = extent.choose(LONGEST_S, LONGEST_QUICK_S);
    let mut points = Vec::new();
    for (i, &integration) in methods.iter().enumerate() {
        let support = integration.default_support_in_space();
        let method = Method { support, ..Method::new(integration) };
        let even = EVEN.map(|share| Resolution::Spacing(share * scene.size()));
        let graded = [-1, 0, 1, 2].map(Resolution::Level);
        for family in [graded, even] {
            points.extend(followed(scene, method, family, &reference, longest));
        }
        progress(0.3 + 0.7 * (i + 1) as f64 / methods.len() as f64);
    }
    without_repeats(&mut points);
    mark_front(&mut points, Job::Placement);
    let nodes = reference.model.nodes();
    Ok(Pareto {
        dimension: 3,
        points,
        open: (reference.estimate.map_or(f64::NAN, |estimate| estimate.controllability), f64::NAN),
        reference_nodes: (nodes, nodes),
        barrier: None,
        peers: if is_homogeneous_block(scene) { DOLFINX.to_vec() } else { Vec::new() },
    })
}

/// The scene with another discretization.
fn with(scene: &SpaceScene, method: Method, resolution: Resolution) -> SpaceScene {
    let mut scene = scene.with_method(method);
    scene.discretization.resolution = resolution;
    scene
}

/// Points of one method on finer and finer meshes, until one takes too long.
fn followed(
    scene: &SpaceScene,
    method: Method,
    family: [Resolution; 4],
    reference: &Discretised,
    longest: f64,
) -> Vec<Measurement> {
    let mut points: Vec<Measurement> = Vec::new();
    for resolution in family {
        let point = point(&with(scene, method, resolution), reference);
        let time = point.wall_s;
        // The reference, or finer: it cannot judge that.
        if method.integration == Integration::FemT10 && point.nodes >= reference.model.nodes() {
            break;
        }
        points.push(point);
        if time * GROWTH > longest {
            break;
        }
    }
    points
}

/// Leaves out meshes of a method that have come before: even ones that had to be refined at patches until they were graded.
fn without_repeats(points: &mut Vec<Measurement>) {
    let mut seen: Vec<(Integration, usize)> = Vec::new();
    points.retain(|point| {
        let mesh = (point.discretization.method.integration, point.nodes);
        let is_new = point.failure.is_some() || !seen.contains(&mesh);
        seen.push(mesh);
        is_new
    });
}

fn point(scene: &SpaceScene, reference: &Discretised) -> Measurement {
    let discretization: Discretization = scene.discretization;
    let mut point = Measurement::new(Job::Placement, discretization, Linearity::Linear);
    for repeat in 0..REPEATS {
        let start = Instant::now();
        let found = at_resolution(scene);
        let wall_s = start.elapsed().as_secs_f64();
        match found {
            Ok((model, rest)) => {
                point.wall_s = if repeat == 0 { wall_s } else { point.wall_s.min(wall_s) };
                measure(&mut point, &model, &rest, reference);
            }
            Err(error) => {
                (point.wall_s, point.failure) = (wall_s, Some(error.into()));
                break;
            }
        }
        if wall_s > QUICK_S {
            break;
        }
    }
    point
}

fn measure(point: &mut Measurement, model: &SpaceModel, rest: &[SpaceResponse], reference: &Discretised) {
    (point.nodes, point.spacing) = (model.nodes(), model.spacing());
    point.error_cm = distances(rest, &reference.rest).into_iter().fold(0.0, f64::max);
    let orthogonal = model.scene().needle.orthogonal();
    point.error_static = across(rest, &reference.rest, &orthogonal);
}

/// Worst difference of the orthogonal displacements per depth, over the largest of them.
fn across(found: &[SpaceResponse], reference: &[SpaceResponse], orthogonal: &Matrix3x2<f64>) -> f64 {
    let of = |response: &SpaceResponse| -> Vector2<f64> { orthogonal.transpose() * response.target_per_depth };
    let largest = reference.iter().map(|r| of(r).norm()).fold(0.0, f64::max);
    found.iter().zip(reference).map(|(a, b)| (of(a) - of(b)).norm() / largest).fold(0.0, f64::max)
}

/// Whether it is the bundled scene that others have computed, whatever it is discretised with.
fn is_homogeneous_block(scene: &SpaceScene) -> bool {
    let block = SpaceScene::bundled("block").map(|block| block.without_inclusions());
    let alike = |block: SpaceScene| {
        with(&block, scene.discretization.method, scene.discretization.resolution).hash() == scene.hash()
    };
    block.is_some_and(alike)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quick_comparison_in_space_shows_every_method_and_the_peer_where_it_belongs() {
        let block = SpaceScene::bundled("block").unwrap();
        let pareto = compare_in_space(&block.without_inclusions(), Extent::Quick, &|_| {}).unwrap();
        for &rule in Integration::SPATIAL {
            let mut of_rule = pareto.points.iter().filter(|p| p.discretization.method.integration == rule);
            assert!(of_rule.any(|p| p.failure.is_none()), "{rule}");
        }
        // On graded meshes quadratic tetrahedra are several times as accurate as linear ones on the same mesh.
        let of = |rule, level| {
            let wanted = Discretization::new(Resolution::Level(level), Method::new(rule));
            let alike = |p: &&Measurement| {
                p.discretization.method.integration == rule && p.discretization.resolution == wanted.resolution
            };
            pareto.points.iter().find(alike).map(|p| p.error_cm).unwrap()
        };
        assert!(of(Integration::FemT10, -1) < 0.5 * of(Integration::FemT4, -1));
        assert!(pareto.points.iter().all(|p| p.error_cm > 0.0), "the reference is not a candidate");
        let front = pareto.front(Job::Placement);
        assert!(front.windows(2).all(|w| w[0].wall_s <= w[1].wall_s && w[0].error() > w[1].error()));
        assert_eq!(pareto.peers.len(), 8);
        let svg = pareto.svg("block", block.without_inclusions().tissue());
        assert!(svg.contains("DOLFINx") && svg.contains("pairs") && !svg.contains("simulator"));
        assert!(!is_homogeneous_block(&block) && !is_homogeneous_block(&SpaceScene::bundled("mound").unwrap()));
        let csv = String::from_utf8(pareto.csv()).unwrap();
        assert!(csv.lines().nth(1).unwrap().contains("placement"));
    }
}
