//! Making a reduced model: snapshots, modes, samples, and a trial on states that it has not seen.

use super::condensed::Condensed;
pub use super::error::TrainingError;
use super::lifting::lifting;
use super::online::{Domain, Invalid, ReducedModel};
use super::snapshots::{Grid, SNAPSHOT_SETTINGS, Snapshot, States, states};
use super::space::{GUARDS, MODES, ModalSpace, Size};
use crate::discretization::Resolution;
use crate::model::{ModelError, TissueModel};
use crate::placement::controllability::best_direction;
use crate::scene::Scene;
use nalgebra::Vector2;
use serde::Serialize;
use std::sync::Arc;

/// States that the estimate is calibrated on, and fresh ones that then judge it.
const CALIBRATION: usize = 24;
const FRESH: usize = 12;
/// Guard modes that the error estimate cannot do without.
const FEWEST_GUARDS: usize = 1;
/// Misfits of the sampled forces that the weights may leave, tried in this order: forces on the modes cause a correction
/// to the response at rest that is a fraction of it, so that a few hundredths can be enough.
const SAMPLING_TOLERANCES: [f64; 3] = [3e-2, 1e-2, 3e-3];
/// Part of the tolerance that is added to every raw estimate before it is scaled, so that an estimate that is small by
/// accident does not decide the scale. (Whatever it is, the probability of the bound is the same; the bound is tighter.)
const FLOOR: f64 = 0.25;
/// Modes onto which the states cannot be projected within this multiple of the tolerance are not tried: the equilibrium
/// on them may be nearer than the projection, but not by more.
const HOPELESS: f64 = 2.0;
/// The paddle's range over the way that it takes to hold the target: the first, and a shorter one where that cannot be had.
/// A range beyond what any insertion needs costs modes, and states that no insertion comes to have no equilibrium.
const RANGES: [f64; 2] = [1.5, 1.25];
/// The shorter side of the range over the longer, at least.
const ASPECT: f64 = 0.5;

/// What the model is trained for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrainingOptions {
    /// Largest error of the target displacement that is accepted, over its largest value in training.
    pub tolerance: f64,
    /// The error that is looked for, likewise: of the models that are accepted the first that keeps to this is taken, and where none
    /// does, the smallest that is about as good as the best (default: the tolerance).
    pub aim: f64,
    /// Largest needle depth, length units (default: the scene's).
    pub depth: Option<f64>,
    /// Largest paddle displacement along either axis, length units; 0 for one that is held where it rests (default: half as
    /// much again as holding the target takes, or a quarter where no more can be had; never more than the actuator has).
    pub paddle: Option<f64>,
    /// Threads that solve snapshots.
    pub threads: usize,
}

/// Tolerance for scenes that name none.
const USUAL_TOLERANCE: f64 = 0.01;
/// What is looked for where nobody has fitted the plant: a controller leaves a hundredth of what the needle does, and a plant that is
/// as far off as that shows its own error.
const AIM: f64 = 0.001;
/// Where that is not reached, models whose errors are within this factor of the best are as good.
const AS_GOOD: f64 = 1.5;

impl TrainingOptions {
    /// To the accuracy that the scene itself asks for: what its fit has left to the plant, else that of its nodes.
    pub fn of(scene: &Scene) -> Self {
        let fitted = scene.fit.as_ref().and_then(|fit| fit.plant_tolerance);
        let tolerance = fitted.unwrap_or(match scene.discretization.resolution {
            Resolution::Tolerance(tolerance) => tolerance,
            Resolution::Spacing(_) | Resolution::Level(_) => USUAL_TOLERANCE,
        });
        let aim = if fitted.is_some() { tolerance } else { tolerance.min(AIM) };
        Self { aim, ..Self::to(tolerance) }
    }

    /// To an accuracy.
    pub fn to(tolerance: f64) -> Self {
        Self { tolerance, aim: tolerance, depth: None, paddle: None, threads: 1 }
    }
}

impl Default for TrainingOptions {
    fn default() -> Self {
        Self::to(USUAL_TOLERANCE)
    }
}

/// The estimate over the error, on fresh states.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Effectivity {
    /// Smallest: below 1 the estimate was short there.
    pub least: f64,
    /// Largest.
    pub most: f64,
}

/// How training went.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrainingReport {
    /// Displacement modes.
    pub modes: usize,
    /// Integration points that are left.
    pub points: usize,
    /// Integration points that judge them: none of the former.
    pub control_points: usize,
    /// Integration points of the full model.
    pub full_points: usize,
    /// Snapshots that it was trained on.
    pub snapshots: usize,
    /// States that its error estimate was calibrated on: that of one more is an upper bound with probability
    /// trials/(trials + 1).
    pub trials: usize,
    /// States that neither training nor calibration has seen.
    pub fresh: usize,
    /// Worst error of the target displacement on all of them, over the largest target displacement in training.
    pub worst_error: f64,
    /// Worst error estimate on them, likewise.
    pub worst_estimate: f64,
    /// The estimate over the error on the fresh states.
    pub effectivity: Effectivity,
    /// Where it holds.
    pub domain: Domain,
}

/// Trains a reduced model of the body with the paddle at this place of the scene's list attached, or none.
///
/// # Errors
/// [`TrainingError`].
pub fn train(
    model: &TissueModel,
    paddle: Option<usize>,
    options: &TrainingOptions,
) -> Result<(Arc<ReducedModel>, TrainingReport), TrainingError> {
    let at_rest = model.body(paddle, SNAPSHOT_SETTINGS).map_err(ModelError::from)?;
    let lifts = lifting(model, paddle, at_rest.clone())?;
    let depth = options.depth.unwrap_or(model.scene().needle.depth);
    let ranges = match options.paddle {
        _ if paddle.is_none() => vec![Vector2::zeros()],
        Some(range) => vec![Vector2::repeat(range)],
        None => workspaces(model, paddle)?,
    };
    let mut outcome = Err(TrainingError::NoEquilibrium { depth });
    for range in ranges {
        let grid = if range.amax() > 0.0 { Grid::with_paddle() } else { Grid::of_depths() };
        let asked = Domain { depth, paddle: range };
        outcome = states(&at_rest, &grid, asked, (CALIBRATION + FRESH) as u32, options.threads).and_then(|states| {
            let space = ModalSpace::new(model, &lifts, &states.snapshots);
            smallest(model, &space, &states, options)
        });
        if outcome.is_ok() {
            break;
        }
    }
    outcome
}

/// The smallest model that passes its trial and keeps to what is looked for; where none does, one about as good as the best that passes.
fn smallest(
    model: &TissueModel,
    space: &ModalSpace,
    states: &States,
    &TrainingOptions { tolerance, aim, .. }: &TrainingOptions,
) -> Result<(Arc<ReducedModel>, TrainingReport), TrainingError> {
    let scale = states.snapshots.iter().map(|s| s.target.norm()).fold(f64::MIN_POSITIVE, f64::max);
    let available = space.available();
    if available < MODES[0] + FEWEST_GUARDS {
        return Err(TrainingError::TooFewModes { modes: available });
    }
    let mut best = (f64::INFINITY, f64::INFINITY);
    let mut accepted: Vec<(Arc<ReducedModel>, TrainingReport)> = Vec::new();
    'modes: for modes in MODES.into_iter().filter(|modes| modes + FEWEST_GUARDS <= available) {
        let projected = space.projection_error(&states.drawn, modes);
        if projected > HOPELESS * tolerance * scale {
            best.0 = best.0.min(projected);
            continue;
        }
        let size = Size { modes, guards: GUARDS.min(available - modes) };
        let mut points = space.sampling(model, size);
        for misfit in SAMPLING_TOLERANCES {
            let mut reduced = space.reduce(model, size, points.next(misfit), states.domain)?;
            reduced.tolerance = tolerance * scale;
            reduced.floor = FLOOR * tolerance * scale;
            let Some(trial) = trial(&mut reduced, &states.snapshots, &states.drawn) else {
                continue;
            };
            if trial.worst_estimate < best.1 {
                best = (trial.worst_error, trial.worst_estimate);
            }
            if trial.worst_estimate <= reduced.tolerance && trial.worst_error <= reduced.tolerance {
                let report = TrainingReport {
                    modes,
                    points: reduced.points(),
                    control_points: reduced.control.points.len(),
                    full_points: model.rule().len(),
                    snapshots: states.snapshots.len(),
                    trials: CALIBRATION,
                    fresh: FRESH,
                    worst_error: trial.worst_error / scale,
                    worst_estimate: trial.worst_estimate / scale,
                    effectivity: trial.effectivity,
                    domain: states.domain,
                };
                let is_aimed_at = report.worst_error <= aim;
                accepted.push((Arc::new(reduced), report));
                if is_aimed_at {
                    break 'modes;
                }
            }
        }
    }
    let least = accepted.iter().map(|(_, report)| report.worst_error).fold(f64::INFINITY, f64::min);
    if let Some(smallest) = accepted.into_iter().find(|(_, report)| report.worst_error <= aim.max(AS_GOOD * least)) {
        return Ok(smallest);
    }
    let (worst_error, worst_estimate) = (best.0 / scale, best.1 / scale);
    match worst_error.is_finite() {
        true => Err(TrainingError::TooInaccurate { worst_error, worst_estimate, tolerance }),
        false => Err(TrainingError::NoEquilibrium { depth: states.domain.depth }),
    }
}

/// Displacements that a paddle holding the target needs, with a margin: the larger first.
fn workspaces(model: &TissueModel, paddle: Option<usize>) -> Result<Vec<Vector2<f64>>, ModelError> {
    let scene = model.scene();
    let condensed = Condensed::new(model, paddle)?;
    let normal = scene.needle.orthogonal();
    let to_hold = condensed.target_displacement(scene.needle.depth, Vector2::zeros()).dot(&normal);
    let direction = best_direction(&condensed.actuation_jacobian(), normal).unwrap_or_default();
    let way = (direction * to_hold).abs();
    let least = 0.02 * scene.needle.depth;
    let within = |side: f64| f64::min(side.max(least), scene.actuator.max_displacement);
    let sides = way.sup(&Vector2::repeat(ASPECT * way.amax()));
    let mut ranges: Vec<_> = RANGES.into_iter().map(|over| (sides * over).map(within)).collect();
    ranges.dedup();
    Ok(ranges)
}

/// What a trial found.
struct Trial {
    worst_error: f64,
    worst_estimate: f64,
    effectivity: Effectivity,
}

/// Calibrates the scale of the estimate on the snapshots, which hold the ends of the domain, and on the first of the drawn
/// states; judges it on the others. None when there is a state without an equilibrium on the modes.
fn trial(reduced: &mut ReducedModel, snapshots: &[Snapshot], drawn: &[Snapshot]) -> Option<Trial> {
    let uncalibrated = Arc::new(ReducedModel { scale: 1.0, tolerance: f64::INFINITY, ..reduced.clone() });
    let outcomes: Vec<(f64, f64)> = snapshots
        .iter()
        .chain(drawn)
        .map(|state| -> Result<(f64, f64), Invalid> {
            let mut body = uncalibrated.body();
            body.drive(state.controls[0], Vector2::new(state.controls[1], state.controls[2]))?;
            Ok(((body.target_displacement() - state.target).norm(), body.error_estimate()))
        })
        .collect::<Result<_, _>>()
        .ok()?;
    let (calibration, fresh) = outcomes.split_at(outcomes.len() - FRESH.min(outcomes.len()));
    reduced.scale = conformal_scale(calibration);
    let worst = |part: fn(&(f64, f64)) -> f64| outcomes.iter().map(part).fold(0.0, f64::max);
    let ratios = || fresh.iter().map(|(error, estimate)| reduced.scale * estimate / error.max(f64::MIN_POSITIVE));
    Some(Trial {
        worst_error: worst(|o| o.0),
        worst_estimate: reduced.scale * worst(|o| o.1),
        effectivity: Effectivity { least: ratios().fold(f64::INFINITY, f64::min), most: ratios().fold(0.0, f64::max) },
    })
}

/// The largest ratio of error to estimate: what bounds the ratio of one more state, drawn like these n, with probability
/// n/(n + 1).
fn conformal_scale(outcomes: &[(f64, f64)]) -> f64 {
    outcomes.iter().map(|(error, estimate)| error / estimate).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discretization::Resolution;
    use crate::scene::starter::{StarterNames, starter};
    use crate::solver::equilibrium::NewtonSettings;

    #[test]
    fn the_reduced_model_follows_the_full_one_and_knows_its_limits() {
        for scene in [Scene::bundled("paper").unwrap(), Scene::bundled("paper").unwrap().without_inclusions()] {
            let model = TissueModel::new(&scene).unwrap();
            let paddle = model.paddle_position(3);
            let options = TrainingOptions::to(0.005);
            let (reduced, report) = train(&model, paddle, &options).unwrap();
            println!("{report:?}");
            assert!(report.worst_error <= options.tolerance);
            assert!(report.points < report.full_points);
            // An insertion with a moving paddle that is in no snapshot.
            let mut full = model.body(paddle, NewtonSettings::default()).unwrap();
            let mut body = reduced.body();
            let range = report.domain.paddle;
            let mut largest = 0.0_f64;
            let mut worst = 0.0_f64;
            for k in 1..=20 {
                let t = f64::from(k) / 20.0;
                let place = Vector2::new((7.0 * t).sin(), (5.0 * t).cos() - 1.0).component_mul(&range) * 0.5;
                full.drive(report.domain.depth * t, place).unwrap();
                body.drive(report.domain.depth * t, place).unwrap();
                let error = (full.target_displacement() - body.target_displacement()).norm();
                largest = largest.max(full.target_displacement().norm());
                worst = worst.max(error);
                // These states had no part in what the estimate was fitted to: it may be short by a quarter, not more,
                // and the error itself keeps to the tolerance.
                let (estimate, tolerance) = (body.error_estimate(), reduced.tolerance());
                assert!(error <= 1.25 * estimate && estimate <= tolerance, "{k}: error {error:.2e}, {estimate:.2e}");
                assert!(error <= tolerance, "{k}: error {error:.2e}, tolerance {tolerance:.2e}");
            }
            assert!(worst < 0.005 * largest, "{worst} of {largest}");
            // Outside it says so and stays where it was.
            let before = body.target_displacement();
            let outside = body.drive(report.domain.depth * 1.2, Vector2::zeros()).unwrap_err();
            assert!(matches!(outside, Invalid::OutsideDomain { .. }));
            assert!(matches!(body.drive(0.0, Vector2::new(3.0 * range.x, 0.0)), Err(Invalid::OutsideDomain { .. })));
            assert_eq!(body.target_displacement(), before);
        }
    }

    /// A block with nodes gathered at the ends of its paddles.
    fn block() -> TissueModel {
        let names = StarterNames { name: "block".into(), length: "mm".into(), stress: "kPa".into() };
        let scene = Scene::parse(&starter(&names, None), "block").unwrap();
        crate::placement::adaptive::discretise(&scene).unwrap().0
    }

    /// On the way to equilibrium the response at rest squeezes a few points there so much that their forces were all that
    /// the sample saw: one point.
    #[test]
    fn points_at_the_ends_of_the_paddle_do_not_stand_for_the_body() {
        let model = block();
        let paddle = model.paddle_position(2);
        let at_rest = model.body(paddle, SNAPSHOT_SETTINGS).unwrap();
        let lifts = lifting(&model, paddle, at_rest.clone()).unwrap();
        let domain = Domain { depth: model.scene().needle.depth, paddle: workspaces(&model, paddle).unwrap()[0] };
        let states = states(&at_rest, &Grid::with_paddle(), domain, 1, 2).unwrap();
        let space = ModalSpace::new(&model, &lifts, &states.snapshots);
        for modes in [4, 8, 12] {
            let [first, _] = space.sampling(&model, Size { modes, guards: 4 }).next(1e-2);
            assert!(first.len() > 3 * modes, "{modes} modes: {} points", first.len());
        }
    }

    /// Where nothing can be held, or nothing has to be, there is room of a fiftieth of the depth, and no more than the actuator has.
    #[test]
    fn the_paddle_has_room_where_it_is_not_needed() {
        let mut scene = Scene::bundled("prostate").unwrap();
        scene.discretization.resolution = Resolution::Spacing(6.0);
        let depth = scene.needle.depth;
        for (most, expected) in [(1.0, 0.02 * depth), (0.01, 0.01)] {
            scene.actuator.max_displacement = most;
            let model = TissueModel::new(&scene).unwrap();
            for range in workspaces(&model, None).unwrap() {
                assert!((range - Vector2::repeat(expected)).amax() < 1e-12, "{range} at a depth of {depth}");
            }
        }
    }

    /// A paddle on a stiff band, whose far corners have no equilibrium: the way to the target can be had.
    #[test]
    fn a_paddle_that_cannot_go_everywhere_can_hold_the_target() {
        let scene = Scene::bundled("tethered").unwrap();
        let (model, _) = crate::placement::adaptive::discretise(&scene).unwrap();
        let paddle = model.paddle_position(2);
        let ranges = workspaces(&model, paddle).unwrap();
        let [first, second] = ranges[..] else { panic!("two ranges") };
        assert!(second.amax() < first.amax() && first.amin() < first.amax());
        let (_, report) = train(&model, paddle, &TrainingOptions::of(&scene)).unwrap();
        assert_eq!(report.domain.depth, scene.needle.depth);
        assert!(ranges.contains(&report.domain.paddle), "{:?} of {ranges:?}", report.domain);
        assert!(report.worst_error <= 0.01);
    }

    /// What is accepted is improved as far as the modes go, and kept where they do not go far enough.
    #[test]
    fn what_is_looked_for_is_found_where_it_can_be() {
        let model = TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap();
        let paddle = model.paddle_position(3);
        let of = |aim: f64| train(&model, paddle, &TrainingOptions { aim, ..TrainingOptions::to(0.02) }).unwrap();
        let [(_, accepted), (reduced, aimed), (_, best)] = [0.02, 1e-3, 1e-12].map(of);
        assert!(accepted.worst_error > 1e-3, "{accepted:?}");
        assert!(aimed.worst_error <= 1e-3 && aimed.modes > accepted.modes, "{aimed:?}");
        assert!(best.worst_error <= AS_GOOD * aimed.worst_error, "{best:?}");
        // What is accepted of it is what was.
        let scale = reduced.tolerance() / 0.02;
        assert!(reduced.tolerance() > 10.0 * aimed.worst_error * scale);
    }

    #[test]
    fn training_aims_at_what_the_scene_asks_for() {
        let tolerance = |resolution: &str, fit: &str| {
            let text = crate::scene::BUNDLED[0].1.replace("spacing = 0.1", resolution);
            let scene = Scene::parse(&format!("{text}\n{fit}"), "asked.toml").unwrap();
            let options = TrainingOptions::of(&scene);
            assert_eq!(options.aim, if fit.is_empty() { AIM } else { options.tolerance });
            options.tolerance
        };
        let fitted = "[fit]\nplant = \"reduced\"\nplant_tolerance = 0.0006\ntable_knots = 9\ntable_scalar = \"f32\"\n";
        assert_eq!(tolerance("spacing = 0.1", ""), 0.01);
        assert_eq!(tolerance("tolerance = 0.02", ""), 0.02);
        assert_eq!(tolerance("level = 1", fitted), 0.0006);
        let negative = fitted.replace("0.0006", "-1.0");
        let text = format!("{}\n{negative}", crate::scene::BUNDLED[0].1);
        let refused = Scene::parse(&text, "asked.toml").unwrap_err();
        assert!(format!("{refused:?}").contains("relative error"), "{refused:?}");
    }

    #[test]
    fn tiny_samples_are_refused_by_the_estimate() {
        // A model forced to believe in a tiny tolerance says that it is not that good.
        let model = TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap();
        let error = train(&model, Some(2), &TrainingOptions::to(1e-9));
        assert!(matches!(error, Err(TrainingError::TooInaccurate { .. })), "{error:?}");
    }

    #[test]
    fn the_scale_bounds_every_state_that_it_was_made_of_and_no_more() {
        let outcomes = [(1.0, 2.0), (3.0, 1.0), (0.5, 0.25)];
        assert_eq!(conformal_scale(&outcomes), 3.0);
        assert!(outcomes.iter().all(|(error, estimate)| *error <= conformal_scale(&outcomes) * estimate));
    }

    #[test]
    fn without_a_paddle_the_estimate_is_of_the_state_and_holds_on_fresh_ones() {
        let model = TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap();
        let (reduced, report) = train(&model, None, &TrainingOptions::default()).unwrap();
        println!("{report:?}");
        // The scale bounds a fresh state with probability 24/25: it may be short here and there, by a quarter, not more.
        assert!(report.effectivity.least >= 0.8, "{report:?}");
        let mut body = reduced.body();
        let mut estimates = Vec::new();
        for share in [0.13, 0.47, 0.71, 0.97] {
            let depth = share * report.domain.depth;
            body.drive(depth, Vector2::zeros()).unwrap();
            let mut full = model.body(None, NewtonSettings::default()).unwrap();
            full.drive(depth, Vector2::zeros()).unwrap();
            let error = (full.target_displacement() - body.target_displacement()).norm();
            assert!(error <= 1.25 * body.error_estimate(), "{share}: {error:.2e} {:.2e}", body.error_estimate());
            assert!(error <= reduced.tolerance() && body.error_estimate() <= reduced.tolerance());
            estimates.push(body.error_estimate());
        }
        assert!(estimates.windows(2).all(|pair| pair[0] != pair[1]), "{estimates:?}");
    }

    #[test]
    fn points_that_judge_are_not_those_that_solve() {
        let model = TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap();
        let at_rest = model.body(Some(2), SNAPSHOT_SETTINGS).unwrap();
        let lifts = lifting(&model, Some(2), at_rest.clone()).unwrap();
        let domain = Domain { depth: 0.1, paddle: Vector2::repeat(0.02) };
        let states = states(&at_rest, &Grid::with_paddle(), domain, 4, 1).unwrap();
        let space = ModalSpace::new(&model, &lifts, &states.snapshots);
        let mut sampling = space.sampling(&model, Size { modes: 4, guards: 4 });
        for misfit in SAMPLING_TOLERANCES {
            let [first, second] = sampling.next(misfit);
            assert!(!first.is_empty() && !second.is_empty());
            assert!(first.iter().all(|(q, _)| second.iter().all(|(other, _)| q != other)));
            // Each weighs the body within a third: weights of a sample that missed a part of it would not.
            let rule = model.rule();
            let area = |sample: &[(usize, f64)]| sample.iter().map(|&(q, w)| w * rule.point(q).weight).sum::<f64>();
            let whole: f64 = rule.points().map(|p| p.weight).sum();
            for share in [area(&first) / whole, area(&second) / whole] {
                assert!((0.67..1.5).contains(&share), "{share} of the body");
            }
        }
    }

    #[test]
    fn a_range_without_equilibria_is_refused_or_shrunk() {
        let model = TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap();
        // A paddle pushed through the body: nothing stable is there.
        let options = TrainingOptions { paddle: Some(5.0), ..TrainingOptions::default() };
        let error = train(&model, Some(2), &options).unwrap_err();
        assert!(matches!(error, TrainingError::TooShallow { .. } | TrainingError::Unstable { .. }), "{error:?}");
        assert!(error.to_string().contains("less depth"), "{error}");
    }
}
