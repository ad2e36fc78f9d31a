//! Error against time: every method on one scene, the Pareto front marked, failures shown.
//!
//! Three jobs are charted, since they ask for different things:
//! - `placement`: nodes, shape functions, the Jacobians and small-depth displacements of all paddles; against quadratic
//!   triangles far finer than the rest, extrapolated.
//! - `insertion`: the target displacement along the whole insertion, every paddle static, by the nonlinear law and
//!   by the linear one; on a law that has a mesh limit at finite depth.
//! - `step`: one tick of a simulator: the full, the reduced and the condensed model, against the same fine insertion.

use super::candidates::{assess, families};
use super::extent::Extent;
use super::insertion::{insertion_points, step_points, with_mesh_limit};
use super::measurement::{Job, Linearity, Measurement, Peer};
use crate::discretization::Discretization;
use crate::model::ModelError;
use crate::output::csv::table;
use crate::placement::reference::Reference;
use crate::scene::Scene;
use strum::VariantArray as _;

/// Distance of the reference's two levels at which it is fine enough to judge the finest candidates.
const REFERENCE_SHARE: f64 = 1e-3;
/// Runs per candidate; the best counts.
const REPEATS: u32 = 5;
/// A family is not refined beyond a candidate that took longer than this.
const LONGEST_S: f64 = 1.5;
const LONGEST_QUICK_S: f64 = 0.2;

/// A whole comparison.
#[derive(Debug, Clone)]
pub struct Pareto {
    /// Dimension of the body.
    pub dimension: usize,
    /// Everything that was tried.
    pub points: Vec<Measurement>,
    /// How good the references are: worst relative distance of their two finest levels, for `placement` and for the
    /// finite depths of the other two jobs.
    pub open: (f64, f64),
    /// Nodes of the references.
    pub reference_nodes: (usize, usize),
    /// The barrier that was added to give the law a mesh limit at finite depth, stress units.
    pub barrier: Option<f64>,
    /// What others took for the same scene, where that is known.
    pub peers: Vec<Peer>,
}

/// Compares every method on the scene; `progress` is told how much is done, from 0 to 1. Times are those of one thread.
///
/// # Errors
/// [`ModelError`] when not even the reference can be computed.
pub fn compare(scene: &Scene, extent: Extent, progress: &dyn Fn(f64)) -> Result<Pareto, ModelError> {
    let reference = Reference::compute(scene, extent.choose(REFERENCE_SHARE, 4.0 * REFERENCE_SHARE))?;
    let families = families(scene, extent);
    let longest = extent.choose(LONGEST_S, LONGEST_QUICK_S);
    let mut points = Vec::new();
    for (i, family) in families.iter().enumerate() {
        progress(0.8 * i as f64 / families.len() as f64);
        for &discretization in family {
            let point = placement_point(discretization, scene, &reference);
            let too_long = point.wall_s > longest;
            points.push(point);
            if too_long {
                break;
            }
        }
    }
    let (scene, barrier) = with_mesh_limit(scene)?;
    let insertion = insertion_points(&scene, extent)?;
    progress(0.9);
    let steps = step_points(&scene, extent, &insertion.reference)?;
    let (open, nodes) = (insertion.open, insertion.reference_nodes);
    points.extend(insertion.points);
    points.extend(steps);
    for &job in Job::VARIANTS {
        mark_front(&mut points, job);
    }
    progress(1.0);
    Ok(Pareto {
        dimension: 2,
        points,
        open: (reference.open, open),
        reference_nodes: (reference.nodes, nodes),
        barrier,
        peers: Vec::new(),
    })
}

fn placement_point(discretization: Discretization, scene: &Scene, reference: &Reference) -> Measurement {
    let mut point = Measurement::new(Job::Placement, discretization, Linearity::Linear);
    let start = std::time::Instant::now();
    match assess(discretization, scene, reference, REPEATS) {
        Ok(found) => {
            (point.nodes, point.spacing, point.wall_s) = (found.nodes, found.spacing, found.wall_s);
            (point.error_cm, point.error_static) = found.errors;
        }
        Err(error) => {
            point.wall_s = start.elapsed().as_secs_f64();
            point.failure = Some(error.into());
        }
    }
    point
}

/// Marks the points of a job that no other beats in both time and error.
pub(super) fn mark_front(points: &mut [Measurement], job: Job) {
    let usable = |p: &Measurement| p.job == job && p.failure.is_none() && p.wall_s.is_finite() && p.error().is_finite();
    let mut order: Vec<usize> = (0..points.len()).filter(|&i| usable(&points[i])).collect();
    order.sort_by(|&i, &j| points[i].wall_s.total_cmp(&points[j].wall_s));
    let mut best = f64::INFINITY;
    for i in order {
        if points[i].error() < best {
            best = points[i].error();
            points[i].on_front = true;
        }
    }
}

/// Columns of the CSV.
const COLUMNS: [&str; 16] = [
    "method",
    "basis",
    "integration",
    "graded",
    "spacing",
    "support",
    "nodes",
    "dofs",
    "law",
    "wall_s",
    "error_cm",
    "error_static",
    "failed",
    "on_front",
    "job",
    "reason",
];

impl Pareto {
    /// The points of a job's front, fastest first.
    pub fn front(&self, job: Job) -> Vec<&Measurement> {
        let mut front: Vec<&Measurement> = self.points.iter().filter(|p| p.job == job && p.on_front).collect();
        front.sort_by(|a, b| a.wall_s.total_cmp(&b.wall_s));
        front
    }

    /// The comparison as CSV, one line per setting. Times in s; errors relative.
    pub fn csv(&self) -> Vec<u8> {
        let number = |x: f64| if x.is_finite() { format!("{x:.6e}") } else { String::new() };
        table(COLUMNS, &self.points, |p| {
            let method = p.discretization.method;
            let element = method.integration.is_element();
            [
                p.model_kind.to_string(),
                method.displacement_basis().to_string(),
                method.integration.to_string(),
                p.discretization.resolution.is_graded().to_string(),
                number(p.spacing),
                if element { String::new() } else { method.support.to_string() },
                p.nodes.to_string(),
                (self.dimension * p.nodes).to_string(),
                p.law.to_string(),
                number(p.wall_s),
                number(p.error_cm),
                number(p.error_static),
                p.failure.is_some().to_string(),
                p.on_front.to_string(),
                p.job.to_string(),
                p.failure.as_ref().map_or_else(String::new, ToString::to_string),
            ]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::{Integration, Method, Resolution};

    #[test]
    fn the_front_is_what_nothing_beats() {
        let candidate = Discretization::new(Resolution::Spacing(0.1), Method::new(Integration::Scni));
        let at = |wall_s, error_cm| Measurement {
            wall_s,
            error_cm,
            ..Measurement::new(Job::Placement, candidate, Linearity::Linear)
        };
        let mut points = vec![at(1.0, 0.1), at(2.0, 0.2), at(3.0, 0.05), at(0.5, 0.3), at(0.4, f64::NAN)];
        points.push(Measurement { failure: Some(ModelError::NoPaddleControls.into()), ..at(0.1, 0.01) });
        mark_front(&mut points, Job::Placement);
        assert_eq!(points.iter().map(|p| p.on_front).collect::<Vec<_>>(), [true, false, true, true, false, false]);
    }

    #[test]
    fn a_quick_comparison_shows_every_method_and_hides_no_failure() {
        let scene = Scene::bundled("paper").unwrap().without_inclusions();
        let pareto = compare(&scene, Extent::Quick, &|_| {}).unwrap();
        for &rule in Integration::PLANAR {
            assert!(
                pareto.points.iter().any(|p| p.discretization.method.integration == rule && p.job == Job::Placement)
            );
        }
        assert!(pareto.open.0 < 0.004 && pareto.open.1 < 0.05, "{:?}", pareto.open);
        assert!(pareto.barrier.is_some(), "the paper's law has no mesh limit of its own");
        for job in [Job::Placement, Job::Insertion, Job::Step] {
            let front = pareto.front(job);
            assert!(!front.is_empty());
            assert!(front.windows(2).all(|w| w[0].wall_s <= w[1].wall_s && w[0].error() > w[1].error()));
        }
        let csv = pareto.csv();
        let mut lines = csv::Reader::from_reader(csv.as_slice());
        assert_eq!(lines.headers().unwrap(), COLUMNS.as_slice());
        assert_eq!(lines.records().map(Result::unwrap).count(), pareto.points.len());
        // The linear law is cheaper and, at full depth, worse than the nonlinear one on the same nodes.
        let by_law = |law: Linearity| {
            pareto.points.iter().find(|p| {
                p.job == Job::Insertion && p.law == law && p.discretization.method.integration == Integration::FemT6
            })
        };
        let (linear, nonlinear) = (by_law(Linearity::Linear).unwrap(), by_law(Linearity::Nonlinear).unwrap());
        assert!(linear.wall_s < nonlinear.wall_s && linear.error_static > nonlinear.error_static);
    }
}
