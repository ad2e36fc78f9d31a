//! Making a reduced model: snapshots, modes, sample, and a trial on states that it has not seen.

use super::condensed::Condensed;
use super::lifting::{control_values, flat, lifting, tangent_at_rest};
use super::nnls::non_negative_fit;
use super::online::{Domain, Invalid, ReducedModel, SampledPoint};
use crate::material::Material as _;
use crate::mechanics::assembly::displacement_gradient;
use crate::mechanics::stabilisation;
use crate::model::{ModelError, TissueModel};
use crate::parallel;
use crate::placement::controllability::best_direction;
use crate::solver::equilibrium::{LinearSolver, NewtonSettings};
use nalgebra::{DMatrix, DVector, Matrix2, SymmetricEigen, Vector2};
use serde::Serialize;
use std::sync::Arc;

/// Depths of the snapshots over the trained depth. Denser towards the end, where the response bends most.
const DEPTHS: [f64; 5] = [0.0, 0.3, 0.6, 0.8, 1.0];
/// Less than this part of the depth asked for is not worth training.
const SHALLOWEST: f64 = 0.02;
/// Part of the depth that the tissue reached with the paddle everywhere that is trained: the very end is singular.
const KEPT_DEPTH: f64 = 0.9;
/// Where the tissue loses stability on the way, finding that depth to an eighth of a step is enough.
const SNAPSHOT_SETTINGS: NewtonSettings = NewtonSettings {
    residual_tolerance: 1e-9,
    step_tolerance: 1e-8,
    max_iterations: 12,
    max_cutbacks: 3,
    line_search: true,
    require_stability: true,
    reuse_tangent: false,
    linear_solver: LinearSolver::BySize,
};
/// States that the model is tried on.
const TRIALS: usize = 24;
/// Numbers of modes that are tried, until the trial is passed.
const MODES: [usize; 6] = [4, 6, 8, 12, 16, 20];
/// Modes beyond those used that the error estimate looks at.
const GUARDS: usize = 4;
/// Modes below this singular value, over the largest, are rounding.
const NEGLIGIBLE: f64 = 1e-7;
/// Misfits of the sampled forces that the weights may leave, tried in this order: forces on the modes cause a correction
/// to the response at rest that is a fraction of it, so that a few hundredths can be enough.
const SAMPLING_TOLERANCES: [f64; 3] = [3e-2, 1e-2, 3e-3];
/// Numbers in the matrix that the sample is chosen by, at most: what a few hundred megabytes hold.
const LARGEST_FIT: usize = 30_000_000;
/// What the estimate misses between the states tried, at most, per what it missed on those: the half of the tolerance that
/// training leaves to them.
const BETWEEN_TRIALS: f64 = 2.0;
/// The paddle's range over what it takes to hold the target.
const WORKSPACE_MARGIN: f64 = 2.0;

/// What the model is trained for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrainingOptions {
    /// Largest error of the target displacement, over its largest value in training.
    pub tolerance: f64,
    /// Largest needle depth, length units (default: the scene's).
    pub depth: Option<f64>,
    /// Largest paddle displacement along either axis, length units (default: twice what holding the target takes, and
    /// no more than the actuator has).
    pub paddle: Option<f64>,
    /// Threads that solve snapshots.
    pub threads: usize,
}

impl Default for TrainingOptions {
    fn default() -> Self {
        Self { tolerance: 0.01, depth: None, paddle: None, threads: 1 }
    }
}

/// How training went.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrainingReport {
    /// Displacement modes.
    pub modes: usize,
    /// Integration points that are left, and how many the full model has.
    pub points: usize,
    /// Integration points of the full model.
    pub full_points: usize,
    /// Snapshots that it was trained on.
    pub snapshots: usize,
    /// States that it was tried on.
    pub trials: usize,
    /// Worst error of the target displacement on them, over the largest target displacement in training.
    pub worst_error: f64,
    /// Worst error estimate on them, likewise.
    pub worst_estimate: f64,
    /// Where it holds.
    pub domain: Domain,
}

/// Why there is no reduced model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TrainingError {
    /// The full model fails.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The full model loses stability before any depth worth training.
    #[error("the full model reaches depth {reached:.4} of {asked:.4} only: nothing to train on")]
    TooShallow {
        /// Depth that every snapshot reached.
        reached: f64,
        /// Depth asked for.
        asked: f64,
    },
    /// No number of modes passes the trial.
    #[error(
        "the best reduced model is wrong by {worst_error:.2e} of the largest target displacement, {tolerance:.2e} was asked for"
    )]
    TooInaccurate {
        /// Worst error of the best try.
        worst_error: f64,
        /// Error asked for.
        tolerance: f64,
    },
}

/// A state of the full model.
struct Snapshot {
    controls: [f64; 3],
    coefficients: Vec<f64>,
    target: Vector2<f64>,
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
    let lifts = lifting(model, paddle)?;
    let asked = Domain {
        depth: options.depth.unwrap_or(model.scene().needle.depth),
        paddle: match options.paddle {
            _ if paddle.is_none() => 0.0,
            Some(range) => range,
            None => workspace(model, paddle)?,
        },
    };
    let (snapshots, domain) = take_snapshots(model, paddle, asked, options.threads)?;
    let (snapshots, domain) = match domain.depth < asked.depth {
        // The tissue does not reach the depth with the paddle everywhere: train again, as far as it does.
        true => take_snapshots(model, paddle, domain, options.threads)?,
        false => (snapshots, domain),
    };
    let trials = take_trials(model, paddle, domain, options.threads);
    let space = Space::new(model, &lifts, &snapshots);
    let scale = snapshots.iter().map(|s| s.target.norm()).fold(f64::MIN_POSITIVE, f64::max);
    let mut best = f64::INFINITY;
    let available = space.modes.len();
    let tries = MODES.iter().flat_map(|modes| SAMPLING_TOLERANCES.map(|misfit| (*modes, misfit)));
    for (modes, misfit) in tries.filter(|(modes, _)| *modes <= available.max(MODES[0])) {
        let modes = modes.min(available);
        let guards = GUARDS.min(available - modes);
        let mut reduced = space.reduce(model, Size { modes, guards, misfit }, domain);
        // Half the tolerance for the states tried, so that those between them keep to the whole.
        let (worst_error, worst_estimate) = trial(&mut reduced, &trials);
        reduced.tolerance = options.tolerance * scale;
        best = best.min(worst_error / scale);
        if worst_estimate <= 0.5 * reduced.tolerance {
            let report = TrainingReport {
                modes,
                points: reduced.points(),
                full_points: model.rule().len(),
                snapshots: snapshots.len(),
                trials: trials.len(),
                worst_error: worst_error / scale,
                worst_estimate: worst_estimate / scale,
                domain,
            };
            return Ok((Arc::new(reduced), report));
        }
    }
    Err(TrainingError::TooInaccurate { worst_error: best, tolerance: options.tolerance })
}

/// Displacements that a paddle holding the target needs, with a margin.
fn workspace(model: &TissueModel, paddle: Option<usize>) -> Result<f64, ModelError> {
    let scene = model.scene();
    let condensed = Condensed::new(model, paddle)?;
    let normal = scene.needle.orthogonal();
    let to_hold = condensed.target_displacement(scene.needle.depth, Vector2::zeros()).dot(&normal);
    let needed = best_direction(&condensed.actuation_jacobian(), normal).map_or(0.0, |d| d.amax() * to_hold.abs());
    Ok((WORKSPACE_MARGIN * needed).max(0.02 * scene.needle.depth).min(scene.actuator.max_displacement))
}

/// Full solutions on a grid of paddle positions and depths, and the domain that all of them reached.
fn take_snapshots(
    model: &TissueModel,
    paddle: Option<usize>,
    asked: Domain,
    threads: usize,
) -> Result<(Vec<Snapshot>, Domain), TrainingError> {
    let places: Vec<Vector2<f64>> = match paddle {
        None => vec![Vector2::zeros()],
        Some(_) => {
            (0..9).map(|k| Vector2::new(f64::from(k % 3) - 1.0, f64::from(k / 3) - 1.0) * asked.paddle).collect()
        }
    };
    let runs = parallel::map(places.len(), threads, |k| -> Result<(Vec<Snapshot>, f64), ModelError> {
        let mut body = model.body(paddle, SNAPSHOT_SETTINGS)?;
        let mut taken = Vec::new();
        for depth in DEPTHS.map(|share| share * asked.depth) {
            if body.drive(depth, places[k]).is_err() {
                break;
            }
            taken.push(snapshot(&body));
        }
        Ok((taken, body.depth()))
    });
    let runs = runs.into_iter().collect::<Result<Vec<_>, _>>()?;
    let reached = runs.iter().map(|run| run.1).fold(asked.depth, f64::min);
    if reached < SHALLOWEST * asked.depth {
        return Err(TrainingError::TooShallow { reached, asked: asked.depth });
    }
    let complete = runs.iter().map(|run| run.0.len()).min().unwrap_or(0);
    let depth = if complete == DEPTHS.len() { asked.depth } else { KEPT_DEPTH * reached };
    let domain = Domain { depth, ..asked };
    let runs = runs.into_iter().map(|run| run.0);
    let reached = complete;
    let kept = runs.flat_map(|run| run.into_iter().take(reached));
    // The state at rest teaches nothing.
    Ok((kept.filter(|s| s.controls.iter().any(|c| *c != 0.0)).collect(), domain))
}

fn snapshot(body: &crate::model::Body<'_>) -> Snapshot {
    Snapshot {
        controls: control_values(body.depth(), body.paddle()),
        coefficients: body.equilibrium().coefficients().to_vec(),
        target: body.target_displacement(),
    }
}

/// Full solutions at states spread over the domain without a pattern (Halton's sequence in bases 2, 3, 5).
fn take_trials(model: &TissueModel, paddle: Option<usize>, domain: Domain, threads: usize) -> Vec<Snapshot> {
    let states = parallel::map(TRIALS, threads, |k| {
        let at = |base| radical_inverse(k as u32 + 1, base);
        let place = Vector2::new(2.0 * at(3) - 1.0, 2.0 * at(5) - 1.0) * domain.paddle;
        let mut body = model.body(paddle, NewtonSettings::default()).ok()?;
        body.drive(at(2) * domain.depth, place).ok()?;
        Some(snapshot(&body))
    });
    states.into_iter().flatten().collect()
}

fn radical_inverse(mut k: u32, base: u32) -> f64 {
    let (mut sum, mut digit) = (0.0, 1.0 / f64::from(base));
    while k > 0 {
        sum += digit * f64::from(k % base);
        k /= base;
        digit /= f64::from(base);
    }
    sum
}

/// Worst error and worst estimate on the trial states; sets what the estimate missed.
fn trial(reduced: &mut ReducedModel, trials: &[Snapshot]) -> (f64, f64) {
    let untried = Arc::new(reduced.clone());
    let outcomes: Vec<Result<(f64, f64), Invalid>> = trials
        .iter()
        .map(|state| {
            let mut body = untried.body();
            body.drive(state.controls[0], Vector2::new(state.controls[1], state.controls[2]))?;
            Ok(((body.target_displacement() - state.target).norm(), body.error_estimate()))
        })
        .collect();
    if outcomes.iter().any(Result::is_err) {
        return (f64::INFINITY, f64::INFINITY);
    }
    let outcomes: Vec<(f64, f64)> = outcomes.into_iter().flatten().collect();
    let missed = outcomes.iter().map(|(error, estimate)| error - estimate).fold(0.0, f64::max);
    // The estimate is for the states between those tried, which miss by more.
    reduced.underestimate = BETWEEN_TRIALS * missed;
    let worst = |part: fn(&(f64, f64)) -> f64| outcomes.iter().map(part).fold(0.0, f64::max);
    (worst(|o| o.0), worst(|o| o.1) + missed)
}

/// How large a reduced model is.
#[derive(Debug, Clone, Copy)]
struct Size {
    modes: usize,
    /// Modes behind them that only the error estimate sees.
    guards: usize,
    /// Relative misfit of the weighted points.
    misfit: f64,
}

/// Modes of the snapshots, with what the full model says about them.
struct Space {
    lifts: Vec<Vec<f64>>,
    modes: Vec<Vec<f64>>,
    /// Displacement gradients: column by column (lifts, then modes), point by point.
    gradients: Vec<Vec<Matrix2<f64>>>,
    target: Vec<Vector2<f64>>,
    /// Controls and mode amplitudes of the snapshots.
    states: Vec<(Vec<f64>, DVector<f64>)>,
}

impl Space {
    /// Proper orthogonal decomposition of what the responses at rest leave of the snapshots.
    fn new(model: &TissueModel, lifts: &[Vec<f64>], snapshots: &[Snapshot]) -> Self {
        let rest: Vec<DVector<f64>> = snapshots
            .iter()
            .map(|s| {
                let mut rest = DVector::from_column_slice(&s.coefficients);
                for (lift, control) in lifts.iter().zip(s.controls) {
                    rest.axpy(-control, &DVector::from_column_slice(lift), 1.0);
                }
                rest
            })
            .collect();
        let gram = DMatrix::from_fn(rest.len(), rest.len(), |i, j| rest[i].dot(&rest[j]));
        let decomposition = SymmetricEigen::new(gram);
        let mut order: Vec<usize> = (0..rest.len()).collect();
        order.sort_by(|&i, &j| decomposition.eigenvalues[j].total_cmp(&decomposition.eigenvalues[i]));
        let largest = decomposition.eigenvalues[order[0]];
        let modes: Vec<Vec<f64>> = order
            .into_iter()
            .take(MODES[MODES.len() - 1] + GUARDS)
            .filter(|&k| decomposition.eigenvalues[k] > NEGLIGIBLE * NEGLIGIBLE * largest)
            .map(|k| {
                let shares = decomposition.eigenvectors.column(k);
                let mut mode = DVector::zeros(rest[0].len());
                for (share, snapshot) in shares.iter().zip(&rest) {
                    mode.axpy(*share, snapshot, 1.0);
                }
                (mode / decomposition.eigenvalues[k].sqrt()).as_slice().to_vec()
            })
            .collect();
        let columns = || lifts.iter().chain(&modes);
        let rule = model.rule();
        let gradients =
            columns().map(|c| (0..rule.len()).map(|q| displacement_gradient(rule, q, c)).collect()).collect();
        let target = columns().map(|c| model.target_row().interpolate(c)).collect();
        let amplitudes = |r: &DVector<f64>| {
            DVector::from_iterator(modes.len(), modes.iter().map(|m| r.dot(&DVector::from_column_slice(m))))
        };
        let states =
            snapshots.iter().zip(&rest).map(|(s, r)| (s.controls[..lifts.len()].to_vec(), amplitudes(r))).collect();
        Self { lifts: lifts.to_vec(), gradients, target, states, modes }
    }

    /// The reduced model on the first `modes` modes, with guards behind them.
    fn reduce(&self, model: &TissueModel, size: Size, domain: Domain) -> ReducedModel {
        let Size { modes, guards, .. } = size;
        let controls = self.lifts.len();
        let width = controls + modes + guards;
        let stabilisation = self.stabilisation(model, modes + guards);
        let seen = modes + guards;
        let tangent_at_rest =
            self.tangent_at_rest(model, seen) + stabilisation.view((controls, controls), (seen, seen));
        let sample = self.sample(model, size);
        let rule = model.rule();
        let points: Vec<SampledPoint> = sample
            .iter()
            .map(|&(q, factor)| SampledPoint { weight: factor * rule.point(q).weight, cell: rule.point(q).cell })
            .collect();
        let gradients = sample
            .iter()
            .flat_map(|&(q, _)| (0..4).flat_map(move |k| (0..width).map(move |c| self.gradients[c][q][(k / 2, k % 2)])))
            .collect();
        // What a residual on the guards alone does to the target: columns of T K⁻¹.
        let inverse = tangent_at_rest.try_inverse().unwrap_or_else(|| DMatrix::zeros(modes + guards, modes + guards));
        let target = DMatrix::from_fn(2, modes + guards, |i, m| self.target[controls + m][i]);
        let guard_response = (target * inverse).columns(modes, guards).into_owned();
        ReducedModel {
            controls,
            modes,
            guards,
            tissue: model.tissue().clone(),
            points,
            gradients,
            stabilisation,
            target: self.target[..controls + modes].to_vec(),
            guard_response,
            underestimate: 0.0,
            tolerance: f64::INFINITY,
            amplitude: self.states.iter().map(|s| s.1.norm()).fold(f64::MIN_POSITIVE, f64::max),
            domain,
            columns: self.lifts.iter().chain(&self.modes[..modes]).cloned().collect(),
        }
    }

    /// The constant stabilisation between lifts and modes; it is projected once, and not part of the sample.
    fn stabilisation(&self, model: &TissueModel, modes: usize) -> DMatrix<f64> {
        let columns: Vec<&[f64]> = self.lifts.iter().chain(&self.modes[..modes]).map(Vec::as_slice).collect();
        stabilisation::project(model.rule(), model.tissue(), &columns)
    }

    /// `K_mn = Σ_q w_q H_m · A(0) · H_n` over all points.
    fn tangent_at_rest(&self, model: &TissueModel, modes: usize) -> DMatrix<f64> {
        let mut k = DMatrix::zeros(modes, modes);
        for (q, point) in model.rule().points().enumerate() {
            let a = tangent_at_rest(model.tissue(), point.cell, point.weight);
            for n in 0..modes {
                let stress = a * flat(&self.mode_gradient(n, q));
                for m in 0..modes {
                    k[(m, n)] += flat(&self.mode_gradient(m, q)).dot(&stress);
                }
            }
        }
        k
    }

    fn mode_gradient(&self, mode: usize, q: usize) -> Matrix2<f64> {
        self.gradients[self.lifts.len() + mode][q]
    }

    /// Points and weights that give the forces on the modes, on the way from the response at rest to equilibrium at
    /// every snapshot, as all points together do; and the mode stiffness at rest. (At equilibrium alone these forces
    /// vanish, and any sample would do.)
    fn sample(&self, model: &TissueModel, size: Size) -> Vec<(usize, f64)> {
        let Size { modes, guards, misfit } = size;
        let rule = model.rule();
        let seen = modes + guards;
        let all = 2 * self.states.len() * seen;
        let stride = (all * rule.len()).div_ceil(LARGEST_FIT).max(1);
        let mut rows: Vec<DVector<f64>> = Vec::new();
        for (controls, amplitudes) in self.states.iter().step_by(stride) {
            for share in [0.0, 1.0] {
                let forces = self.point_forces(model, controls, &(amplitudes.rows(0, modes) * share), seen);
                rows.extend(forces.into_iter().filter(|row| row.iter().all(|x| x.is_finite())));
            }
        }
        let typical =
            self.states.iter().map(|s| s.1.rows(0, modes).abs()).fold(DVector::zeros(modes), |m, a| m.sup(&a));
        let tangents: Vec<_> =
            rule.points().map(|point| tangent_at_rest(model.tissue(), point.cell, point.weight)).collect();
        for n in 0..modes {
            let stresses: Vec<_> =
                tangents.iter().enumerate().map(|(q, a)| a * flat(&self.mode_gradient(n, q)) * typical[n]).collect();
            for m in 0..=n {
                let work = |(q, stress): (usize, &nalgebra::Vector4<f64>)| flat(&self.mode_gradient(m, q)).dot(stress);
                rows.push(DVector::from_iterator(rule.len(), stresses.iter().enumerate().map(work)));
            }
        }
        let a = DMatrix::from_fn(rows.len(), rule.len(), |i, q| rows[i][q]);
        let b = DVector::from_iterator(rows.len(), rows.iter().map(|row| row.sum()));
        non_negative_fit(&a, &b, misfit)
    }

    /// Every point's part of the force on each of the first `seen` modes.
    fn point_forces(
        &self,
        model: &TissueModel,
        controls: &[f64],
        amplitudes: &DVector<f64>,
        seen: usize,
    ) -> Vec<DVector<f64>> {
        let rule = model.rule();
        let mut forces = vec![DVector::zeros(rule.len()); seen];
        let values: Vec<f64> = controls.iter().chain(amplitudes.iter()).copied().collect();
        for (q, point) in rule.points().enumerate() {
            let h: Matrix2<f64> = self.gradients.iter().zip(&values).map(|(g, a)| g[q] * *a).sum();
            let mut p = Matrix2::zeros();
            for (material, factor) in model.tissue().parts(point.cell) {
                p += material.respond(&h).pk1_stress * (factor * point.weight);
            }
            for (m, force) in forces.iter_mut().enumerate() {
                force[q] = self.mode_gradient(m, q).dot(&p);
            }
        }
        forces
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    #[test]
    fn the_reduced_model_follows_the_full_one_and_knows_its_limits() {
        for scene in [Scene::bundled("paper").unwrap(), Scene::bundled("paper").unwrap().without_inclusions()] {
            let model = TissueModel::new(&scene).unwrap();
            let paddle = model.paddle_position(3);
            let (reduced, report) = train(&model, paddle, &TrainingOptions::default()).unwrap();
            println!("{report:?}");
            assert!(report.worst_error < 0.005);
            assert!(report.points < report.full_points);
            // An insertion with a moving paddle that is in no snapshot.
            let mut full = model.body(paddle, NewtonSettings::default()).unwrap();
            let mut body = reduced.body();
            let range = report.domain.paddle;
            let mut largest = 0.0_f64;
            let mut worst = 0.0_f64;
            for k in 1..=20 {
                let t = f64::from(k) / 20.0;
                let place = Vector2::new((7.0 * t).sin(), (5.0 * t).cos() - 1.0) * (0.5 * range);
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
            assert!(matches!(body.drive(0.0, Vector2::new(3.0 * range, 0.0)), Err(Invalid::OutsideDomain { .. })));
            assert_eq!(body.target_displacement(), before);
        }
    }

    #[test]
    fn tiny_samples_are_refused_by_the_estimate() {
        // A model forced to believe in a tiny tolerance says that it is not that good.
        let model = TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap();
        let error = train(&model, Some(2), &TrainingOptions { tolerance: 1e-9, ..TrainingOptions::default() });
        assert!(matches!(error, Err(TrainingError::TooInaccurate { .. })), "{error:?}");
    }
}
