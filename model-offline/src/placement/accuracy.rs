//! How far every number of a study may be off: those at rest by a certified solution, those at depth by an insertion that
//! another method follows on nodes of its own.

use super::hindrance::is_usable;
use super::reference::Reference;
use super::study::{FollowedInsertion, PaddleResult, Placement, StaticStudy, follow, newton_for};
use crate::discretization::{Essential, Integration, Method, Resolution};
use crate::model::{ModelError, TissueModel, graded_model};
use crate::parallel;
use crate::scene::Scene;
use nalgebra::{Matrix2, Vector2};
use serde::Serialize;

/// Level of the nodes on which the insertion is followed a second time: 200 to 500 of them.
const LEVEL: i32 = -2;

/// Estimated errors of one paddle's numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PaddleErrors {
    /// Of the Jacobian at rest: Frobenius norm, over that of the Jacobian.
    pub jacobian: f64,
    /// Of ‖J⁻¹n‖, over what it is on ever finer nodes (see [`measure_range`]); none where the paddle cannot control the target.
    pub controllability_measure: Option<f64>,
    /// Of J⁻¹n: length of the difference; none where there is no J⁻¹n.
    pub best_direction: Option<f64>,
    /// Of d(target displacement)/d(depth): length of the difference.
    pub target_per_depth: f64,
    /// Of the insertion.
    #[serde(rename = "static")]
    pub static_study: StaticErrors,
}

/// Estimated errors of an insertion, depth by depth; none where the second model did not get there.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct StaticErrors {
    /// Of the target displacement and its orthogonal part, length units.
    pub target_displacement: Vec<Option<f64>>,
    /// Of the Jacobians: Frobenius norm, over that of the Jacobian.
    pub jacobians: Vec<Option<f64>>,
    /// Of the largest orthogonal displacement, length units.
    pub max_orthogonal: Option<f64>,
}

/// Estimated errors of a whole study.
#[derive(Debug, Clone, PartialEq)]
pub struct Accuracy {
    /// Errors by paddle, in the study's order.
    pub paddles: Vec<PaddleErrors>,
    /// Errors of the insertion without a paddle.
    pub no_paddle: StaticErrors,
    /// Nodes of the second model of the insertion; none where it could not be made.
    pub second_nodes: Option<usize>,
}

/// Paddles that are as good as the best ones, as far as their errors tell; by index, without the best.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct AsGood {
    /// By the largest orthogonal displacement with the paddle static, of those that got as deep as the best one.
    #[serde(rename = "static")]
    pub static_paddles: Vec<u32>,
    /// By the controllability measure.
    #[serde(rename = "dynamic")]
    pub dynamic_paddles: Vec<u32>,
}

impl Accuracy {
    /// Who cannot be told from the best. A paddle whose error is not known is not among them, and tells nothing as the best.
    pub fn as_good(&self, placement: &Placement) -> AsGood {
        let optimum = placement.optimum;
        let all = || placement.paddles.iter().zip(&self.paddles);
        let best = placement.paddles.iter().find(|paddle| paddle.index == optimum.static_paddle);
        let deep = best.map_or(0, |paddle| paddle.static_study.depth.len());
        let held = all().filter(|(paddle, _)| paddle.static_study.depth.len() == deep).map(|(paddle, errors)| {
            let largest = paddle.static_study.max_orthogonal;
            (paddle.index, errors.static_study.max_orthogonal.map(|error| [largest - error, largest + error]))
        });
        // What no table can be made of is not as good as what one can.
        let usable = |paddle: &PaddleResult| is_usable(&paddle.rest());
        let among = placement.paddles.iter().any(usable);
        let moved = all().filter(|(paddle, _)| !among || usable(paddle)).map(|(paddle, errors)| {
            let error = errors.controllability_measure;
            (paddle.index, error.map(|error| measure_range(paddle.controllability_measure, error)))
        });
        AsGood {
            static_paddles: not_told_from(optimum.static_paddle, held),
            dynamic_paddles: optimum.dynamic_paddle.map_or_else(Vec::new, |best| not_told_from(best, moved)),
        }
    }
}

/// Between what a measure may lie that was found with this relative error, which is over what it really is: a measure that came
/// out at twice what it is has an error of 1, and nothing says that it may be none.
pub fn measure_range(found: f64, error: f64) -> [f64; 2] {
    [found / (1.0 + error), if error < 1.0 { found / (1.0 - error) } else { f64::INFINITY }]
}

/// Of paddles with the range of what is to be small, those whose range meets that of the best one.
fn not_told_from(best: u32, all: impl Iterator<Item = (u32, Option<[f64; 2]>)>) -> Vec<u32> {
    let known: Vec<(u32, [f64; 2])> = all.filter_map(|(index, range)| Some((index, range?))).collect();
    let Some((_, [_, most])) = known.iter().find(|paddle| paddle.0 == best) else { return Vec::new() };
    let reaches = |(index, [least, _]): &&(u32, [f64; 2])| *index != best && least <= most;
    known.iter().filter(reaches).map(|paddle| paddle.0).collect()
}

/// Estimates the errors of a placement in `scene`, whose numbers at rest are judged by `reference`.
///
/// # Errors
/// [`ModelError`] when the second model's body at rest cannot be solved.
pub fn accuracy(
    scene: &Scene,
    placement: &Placement,
    reference: &Reference,
    threads: usize,
) -> Result<Accuracy, ModelError> {
    let second = second_model(scene);
    let none = vec![FollowedInsertion::default(); scene.paddles.len() + 1];
    let seconds = second.as_ref().map_or(Ok(none), |model| follow_all(model, threads))?;
    let rest = Rest::new(reference);
    let paddles = placement.paddles.iter().enumerate();
    let paddles = paddles.map(|(i, paddle)| rest.paddle_errors(i, paddle, &seconds[i])).collect();
    // The reference answers for paddles; without one the body is no harder to solve than with the worst of them.
    let slope = placement.paddles.iter().enumerate().map(|(i, p)| rest.slope_error(i, p)).fold(0.0, f64::max);
    let followed = Followed { study: &placement.no_paddle.static_study, jacobians: &[] };
    let no_paddle = followed.errors(&seconds[scene.paddles.len()], slope);
    Ok(Accuracy { paddles, no_paddle, second_nodes: second.map(|model| model.nodes()) })
}

/// Quadratic triangles on a few graded nodes; the default rule where the study is of quadratic triangles itself. Never
/// the study's own method: what is alike agrees where both are wrong.
fn second_model(scene: &Scene) -> Option<TissueModel> {
    let mut scene = scene.clone();
    scene.discretization.essential = Essential::Transformation;
    let integration = match scene.discretization.method.integration {
        Integration::FemT6 => Integration::default(),
        _ => Integration::FemT6,
    };
    graded_model(&scene, Method::new(integration), LEVEL).ok()
}

/// The insertion with every paddle, and last without one.
fn follow_all(model: &TissueModel, threads: usize) -> Result<Vec<FollowedInsertion>, ModelError> {
    let count = model.scene().paddles.len();
    let newton = newton_for(Resolution::Level(LEVEL));
    parallel::map(count + 1, threads, |i| follow(model, (i < count).then_some(i), newton, None, &|| {}))
        .into_iter()
        .collect()
}

/// What is known at rest.
struct Rest<'a> {
    reference: &'a Reference,
    /// What the reference leaves open of displacements per depth.
    open_per_depth: f64,
}

impl<'a> Rest<'a> {
    fn new(reference: &'a Reference) -> Self {
        let largest = reference.responses().iter().map(|r| r.target_per_depth.norm()).fold(0.0, f64::max);
        Self { reference, open_per_depth: reference.open_displacement() * largest }
    }

    fn per_depth_error(&self, i: usize, per_depth: [f64; 2]) -> f64 {
        (Vector2::from(per_depth) - self.reference.responses()[i].target_per_depth).norm() + self.open_per_depth
    }

    /// The same of the insertion.
    fn slope_error(&self, i: usize, paddle: &PaddleResult) -> f64 {
        self.per_depth_error(i, paddle.static_study.target_per_depth)
    }

    fn paddle_errors(&self, i: usize, paddle: &PaddleResult, second: &FollowedInsertion) -> PaddleErrors {
        let (limit, open) = (&self.reference.responses()[i], self.reference.open_by_paddle()[i]);
        let measure = (paddle.controllability_measure / limit.controllability_measure - 1.0).abs() + open;
        let directions = paddle.best_direction.map(Vector2::from).zip(limit.best_direction);
        let followed = Followed { study: &paddle.static_study, jacobians: &paddle.jacobians };
        PaddleErrors {
            jacobian: relative(&matrix(&paddle.jacobian), &limit.jacobian) + self.reference.open_jacobian()[i],
            controllability_measure: measure.is_finite().then_some(measure),
            best_direction: directions.map(|(found, limit)| (found - limit).norm() + open * limit.norm()),
            target_per_depth: self.per_depth_error(i, paddle.target_per_depth),
            static_study: followed.errors(second, self.slope_error(i, paddle)),
        }
    }
}

/// An insertion to judge.
struct Followed<'a> {
    study: &'a StaticStudy,
    jacobians: &'a [[[f64; 2]; 2]],
}

impl Followed<'_> {
    /// What the error at rest (`slope`, per depth) grows to, and how far what the law's nonlinearity adds to the response at
    /// rest is from what it adds on the second model, whose own error at rest does not matter then.
    fn errors(&self, second: &FollowedInsertion, slope: f64) -> StaticErrors {
        let added = |study: &StaticStudy, k: usize, depth: f64| -> Option<Vector2<f64>> {
            let displacement: [f64; 2] = *study.target_displacement.get(k)?;
            Some(Vector2::from(displacement) - Vector2::from(study.target_per_depth) * depth)
        };
        let target_displacement: Vec<Option<f64>> = self
            .study
            .depth
            .iter()
            .enumerate()
            .map(|(k, &depth)| {
                let apart = added(self.study, k, depth)? - added(&second.study, k, depth)?;
                Some(apart.norm() + slope * depth)
            })
            .collect();
        let jacobians = self.jacobians.iter().enumerate();
        StaticErrors {
            // Of an insertion that stopped at once nothing is known.
            max_orthogonal: target_displacement.iter().copied().reduce(|m, e| Some(m?.max(e?))).flatten(),
            target_displacement,
            jacobians: jacobians.map(|(k, j)| Some(relative(&matrix(j), &matrix(second.jacobians.get(k)?)))).collect(),
        }
    }
}

fn matrix(rows: &[[f64; 2]; 2]) -> Matrix2<f64> {
    Matrix2::new(rows[0][0], rows[0][1], rows[1][0], rows[1][1])
}

/// Distance over the size of what it is measured from.
fn relative(found: &Matrix2<f64>, limit: &Matrix2<f64>) -> f64 {
    (found - limit).norm() / limit.norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ranges that meet are not told from each other; a range that is not known says nothing, of others nor of the best.
    #[test]
    fn who_is_within_the_errors_of_the_best_is_named() {
        let all = [(3, Some([0.9, 1.1])), (5, Some([1.05, 1.45])), (8, Some([1.15, 1.35])), (9, None)];
        assert_eq!(not_told_from(3, all.into_iter()), [5]);
        assert_eq!(not_told_from(9, all.into_iter()), [0; 0]);
        let exact = [(1, Some([2.0, 2.0])), (2, Some([2.0, 2.0])), (4, Some([2.1, 2.1]))];
        assert_eq!(not_told_from(1, exact.into_iter()), [2], "equal to the last digit");
    }

    /// Whatever a measure really is, what was found of it has it in its range, and the range ends there on one side.
    #[test]
    fn the_range_of_a_measure_holds_what_it_really_is() {
        for (found, really) in [(105.86, 48.84), (2.55, 2.94), (1.0, 1.0), (0.2, 40.0), (3.0, 1.5)] {
            let error = f64::abs(found / really - 1.0);
            let [least, most] = measure_range(found, error);
            assert!(
                least <= really * (1.0 + 1e-12) && really <= most * (1.0 + 1e-12),
                "{found} for {really}: {least} to {most}"
            );
            let end = if found > really { least } else { most };
            assert!((end / really - 1.0).abs() < 1e-12, "{found} for {really}: {least} to {most}");
        }
        assert_eq!(measure_range(3.0, 1.0)[1], f64::INFINITY);
    }
}
