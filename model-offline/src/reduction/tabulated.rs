//! A body near one insertion, tabulated: what a simulator in space can afford at every tick.
//!
//! Along the way on which the paddles hold the target the full model is solved at a few depths, and every state z_k = (depth,
//! paddle displacements) leaves the target displacement u_k with its exact [first and second derivatives](ControlDerivatives) A and H.
//! Between two of them both are expanded to where the body is, and blended by a cubic s of the depth:
//!
//! ```text
//! u(z) ≈ (1 − s) T_k(z) + s T_{k+1}(z),   T_k(z) = u_k + A_k Δ + ½ H_k(Δ, Δ),   Δ = z − z_k
//! ```
//!
//! which is third order in the distance from the states, in depth and in whatever the paddles do beside the way. (States with their
//! derivatives that are answered from within a controlled error: in situ adaptive tabulation, Pope, Combustion Theory and
//! Modelling 1, 1997.) Six displacements of two paddles and a depth leave no room for the grid of states that a modal basis is
//! trained on in the plane; here they cost seven right-hand sides of one factor.
//!
//! **Error.** States drawn from the neighbourhood are solved in full. Their errors over what the distance from the table lets expect,
//! `ρ³`, bound that of one more state, drawn like these n, with probability n/(n + 1) (split conformal prediction, Vovk, Gammerman &
//! Shafer 2005); others, which had no part in it, judge the bound.

use crate::geometry::Point;
use crate::model::space::SpaceBody;
use crate::model::{ControlDerivatives, DrivenBody, ModelError, control_derivatives};
use crate::parallel;
use crate::placement::space::holding::hold;
use crate::placement::space::insertion::InsertionModel;
use crate::random::SplitMix64;
use crate::solver::equilibrium::{Failure, NewtonSettings};
use nalgebra::{DVector, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Intervals between tabulated depths, and shares of the room beside the way, that are tried until the error is within the
/// tolerance.
const SIZES: [(usize, f64); 4] = [(10, 1.0), (20, 1.0), (20, 0.5), (40, 0.25)];
/// States per interval that the estimate is calibrated on, and fresh ones that judge it, in all at least.
const CALIBRATION: usize = 48;
const FRESH: usize = 24;
/// The worst of these is not the worst there is.
const UNSEEN: f64 = 2.0;
/// Room of a paddle beside the way, over the way: what a table that takes the tissue for another one asks for.
const ROOM: f64 = 0.5;
/// The same over the longest way of all paddles, at least, and over the depth.
const LEAST_ROOM: f64 = 0.3;
const LEAST_OF_DEPTH: f64 = 0.1;
/// Part of the expected error that is added to every one, so that a state whose error is small by accident does not decide.
const FLOOR: f64 = 0.1;

/// How a body is tabulated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TabulationOptions {
    /// Largest error of the target displacement, over the largest that is orthogonal to the needle when nothing is held.
    pub tolerance: f64,
    /// Whether the paddles hold the target; else they stay where they rest.
    pub steered: bool,
    /// Threads that solve states.
    pub threads: usize,
}

/// How tabulating went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TabulationReport {
    /// Tabulated depths.
    pub knots: usize,
    /// Depth that the table reaches: less than asked for where the tissue loses its stability.
    pub depth: f64,
    /// How far each paddle may be from the way, length.
    pub room: Vec<f64>,
    /// States that the estimate was calibrated on: that of one more is an upper bound with probability trials/(trials + 1).
    pub trials: usize,
    /// States that judged it.
    pub fresh: usize,
    /// Worst error on all of them, length.
    pub worst_error: f64,
    /// Worst estimate on them, length.
    pub worst_estimate: f64,
    /// Smallest ratio of estimate and error on the fresh states: below 1 the estimate was short there.
    pub least_effectivity: f64,
    /// The length that errors were held against: the largest orthogonal displacement when nothing is held.
    pub scale: f64,
}

/// Why there is no table.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TabulationError {
    /// The full model fails.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The tissue loses stability before any depth worth tabulating.
    #[error(
        "the insertion cannot be followed beyond depth {reached:.4} of {asked:.4}: {failure}; ask for less depth, or give the law a barrier"
    )]
    TooShallow {
        /// Depth reached.
        reached: f64,
        /// Depth asked for.
        asked: f64,
        /// What the full model said.
        failure: Failure,
    },
    /// No number of depths is enough.
    #[error(
        "the best table is wrong by {worst_error:.2e} of the target's largest orthogonal displacement and bounds its error by {worst_estimate:.2e}, {tolerance:.2e} was asked for; insert less deep"
    )]
    TooInaccurate {
        /// Worst error of the best try.
        worst_error: f64,
        /// Its largest bound.
        worst_estimate: f64,
        /// What was asked for.
        tolerance: f64,
    },
}

/// The body is where the table does not reach: the full model has to be asked.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Untabulated {
    /// Deeper, or out of the body.
    #[error("depth {depth:.4} is not tabulated (0 to {deepest:.4})")]
    Depth {
        /// Depth asked for.
        depth: f64,
        /// Deepest.
        deepest: f64,
    },
    /// Too far from the way.
    #[error("paddle {} is {distance:.4} beside its way at depth {depth:.4}, {room:.4} is tabulated", paddle + 1)]
    Beside {
        /// Which of the attached paddles.
        paddle: usize,
        /// Depth.
        depth: f64,
        /// How far it is from the way.
        distance: f64,
        /// How far it may be.
        room: f64,
    },
}

/// A state with its derivatives.
#[derive(Debug, Clone)]
struct Knot {
    /// Depth, then paddle displacements.
    at: DVector<f64>,
    target: Vector3<f64>,
    derivatives: ControlDerivatives<3>,
    coefficients: Vec<f64>,
}

impl Knot {
    fn expanded(&self, at: &DVector<f64>) -> Vector3<f64> {
        let step = at - &self.at;
        let slope = &self.derivatives.slope * &step;
        let bend = self.derivatives.bend.as_ref();
        Vector3::from_fn(|r, _| {
            let second = bend.map_or(0.0, |bend| 0.5 * step.dot(&(&bend[r] * &step)));
            self.target[r] + slope[r] + second
        })
    }
}

/// The neighbourhood of one insertion; see the module's documentation.
#[derive(Debug, Clone)]
pub struct Tabulated {
    knots: Vec<Knot>,
    /// How far each paddle may be from the way, length.
    room: Vec<f64>,
    /// Error over ρ³ and the floor, length.
    growth: f64,
}

impl Tabulated {
    /// Tabulates the insertion of a body with paddles attached at these places of the scene's list.
    ///
    /// # Errors
    /// [`TabulationError`].
    pub fn learn(
        model: &InsertionModel,
        attached: &[usize],
        options: &TabulationOptions,
    ) -> Result<(Arc<Self>, TabulationReport), TabulationError> {
        let scale = unheld(model)?;
        let mut best = (f64::INFINITY, f64::INFINITY);
        for size in SIZES {
            let (table, report) = Self::of_size(model, attached, options, size, scale)?;
            if report.worst_error.max(report.worst_estimate) <= options.tolerance * scale {
                return Ok((Arc::new(table), report));
            }
            if report.worst_estimate < best.1 {
                best = (report.worst_error, report.worst_estimate);
            }
        }
        Err(TabulationError::TooInaccurate {
            worst_error: best.0 / scale,
            worst_estimate: best.1 / scale,
            tolerance: options.tolerance,
        })
    }

    fn of_size(
        model: &InsertionModel,
        attached: &[usize],
        options: &TabulationOptions,
        (intervals, share): (usize, f64),
        scale: f64,
    ) -> Result<(Self, TabulationReport), TabulationError> {
        let steered = options.steered && !attached.is_empty();
        let (knots, bodies) = walk(model, attached, steered, intervals)?;
        let deepest = knots.last().map_or(0.0, |knot| knot.at[0]);
        let way = |p: usize| knots.iter().map(|knot| knot.at.rows(1 + 3 * p, 3).norm()).fold(0.0, f64::max);
        let longest = (0..attached.len()).map(way).fold(0.0, f64::max);
        let room = |p: usize| match steered {
            true => share * (ROOM * way(p)).max(LEAST_ROOM * longest).max(LEAST_OF_DEPTH * deepest),
            false => 0.0,
        };
        let mut table = Self { room: (0..attached.len()).map(room).collect(), knots, growth: 0.0 };
        let trials = table.trials(&bodies, options.threads);
        let (fresh, calibration): (Vec<_>, Vec<_>) = trials.iter().partition(|trial| trial.fresh);
        table.growth = UNSEEN * calibration.iter().map(|t| t.error / t.expected).fold(0.0, f64::max);
        let estimate = |t: &Trial| table.growth * t.expected;
        let report = TabulationReport {
            knots: table.knots.len(),
            depth: deepest,
            room: table.room.clone(),
            trials: calibration.len(),
            fresh: fresh.len(),
            worst_error: trials.iter().map(|t| t.error).fold(0.0, f64::max),
            worst_estimate: trials.iter().map(estimate).fold(0.0, f64::max),
            least_effectivity: fresh
                .iter()
                .map(|t| estimate(t) / t.error.max(f64::MIN_POSITIVE))
                .fold(f64::INFINITY, f64::min),
            scale,
        };
        Ok((table, report))
    }

    /// Solves states beside the way in full and sees how far off the table is. Where the tissue has no state, no insertion comes to
    /// be.
    fn trials(&self, bodies: &[SpaceBody<'_>], threads: usize) -> Vec<Trial> {
        let intervals = self.knots.len() - 1;
        let each = (CALIBRATION + FRESH).div_ceil(intervals);
        let trial = |number: usize| {
            let at = self.drawn(number / each, number as u64);
            let mut body = bodies[number / each].clone();
            body.drive_to(at.as_slice()).ok()?;
            let error = (self.target(&at) - body.target()).norm();
            // What was drawn from the table lies in it.
            let distance = self.distance(&at).unwrap_or(f64::INFINITY);
            Some(Trial { error, expected: expected(distance), fresh: number % 3 == 2 })
        };
        parallel::map(intervals * each, threads, trial).into_iter().flatten().collect()
    }

    /// A state drawn from an interval and the room beside it.
    fn drawn(&self, knot: usize, seed: u64) -> DVector<f64> {
        let mut random = SplitMix64(seed);
        let [from, to] = [0, 1].map(|k| &self.knots[knot + k].at);
        let mut at = from + (to - from) * random.unit();
        at = self.on_way(at[0]);
        for (p, room) in self.room.iter().enumerate() {
            let direction = loop {
                let d = Vector3::new(random.symmetric(), random.symmetric(), random.symmetric());
                if d.norm_squared() <= 1.0 {
                    break d;
                }
            };
            // As often near the way, where insertions are, as far from it.
            let size = *room * random.unit();
            let mut paddle = at.rows_mut(1 + 3 * p, 3);
            paddle += direction * size;
        }
        at
    }

    /// Where depth and paddles are on the way.
    fn on_way(&self, depth: f64) -> DVector<f64> {
        let (knot, share) = self.interval(depth);
        let [a, b] = [0, 1].map(|k| &self.knots[knot + k].at);
        let mut at = a + (b - a) * share;
        at[0] = depth;
        at
    }

    fn interval(&self, depth: f64) -> (usize, f64) {
        let last = self.knots.len() - 2;
        let knot = self.knots.partition_point(|knot| knot.at[0] <= depth).saturating_sub(1).min(last);
        let [from, to] = [0, 1].map(|k| self.knots[knot + k].at[0]);
        (knot, ((depth - from) / (to - from)).clamp(0.0, 1.0))
    }

    /// Distance from the nearer knot in intervals, and from the way in rooms.
    fn distance(&self, at: &DVector<f64>) -> Result<f64, Untabulated> {
        let (depth, deepest) = (at[0], self.deepest());
        // A rounding error beyond the last state is still that state.
        if depth < -1e-9 * deepest || depth > deepest * (1.0 + 1e-9) {
            return Err(Untabulated::Depth { depth, deepest });
        }
        let way = self.on_way(depth);
        let mut beside = 0.0_f64;
        for (p, &room) in self.room.iter().enumerate() {
            let distance = (at.rows(1 + 3 * p, 3) - way.rows(1 + 3 * p, 3)).norm();
            if distance > room * (1.0 + 1e-9) {
                return Err(Untabulated::Beside { paddle: p, depth, distance, room });
            }
            if room > 0.0 {
                beside += distance / room;
            }
        }
        let (_, share) = self.interval(depth);
        Ok(share.min(1.0 - share) + beside)
    }

    fn target(&self, at: &DVector<f64>) -> Vector3<f64> {
        let (knot, share) = self.interval(at[0]);
        let blend = blended(share);
        let [before, after] = [0, 1].map(|k| self.knots[knot + k].expanded(at));
        before * (1.0 - blend) + after * blend
    }

    /// A body of this table, at rest.
    pub fn body(self: &Arc<Self>) -> TabulatedBody {
        let at = self.knots[0].at.clone() * 0.0;
        TabulatedBody { table: Arc::clone(self), at, target: Vector3::zeros(), estimate: 0.0 }
    }

    /// Where the paddles are on their way.
    pub fn way(&self, depth: f64) -> Vec<Point<3>> {
        self.on_way(depth).as_slice()[1..].chunks_exact(3).map(Point::from_column_slice).collect()
    }

    /// Tabulated depths.
    pub fn knots(&self) -> usize {
        self.knots.len()
    }

    /// Deepest state.
    pub fn deepest(&self) -> f64 {
        self.knots[self.knots.len() - 1].at[0]
    }
}

/// The cubic from 0 to 1 that leaves no kink at either end.
fn blended(share: f64) -> f64 {
    share * share * (3.0 - 2.0 * share)
}

/// What an error grows with.
fn expected(distance: f64) -> f64 {
    FLOOR + distance.powi(3)
}

/// A state that was solved in full.
struct Trial {
    error: f64,
    expected: f64,
    fresh: bool,
}

/// The body's states with the paddles on their way, and the bodies there.
fn walk<'m>(
    model: &'m InsertionModel,
    attached: &[usize],
    steered: bool,
    intervals: usize,
) -> Result<(Vec<Knot>, Vec<SpaceBody<'m>>), TabulationError> {
    let asked = model.scene().needle.depth;
    let mut body = model.body(attached, NewtonSettings::default())?;
    let (mut knots, mut bodies) = (Vec::new(), Vec::new());
    for k in 0..=intervals {
        let depth = asked * k as f64 / intervals as f64;
        let reached = body.depth();
        let state = match steered {
            true => hold(&mut body, depth),
            false => body.drive(depth, &vec![Vector3::zeros(); attached.len()]).map_err(ModelError::from),
        };
        let knot = state.and_then(|()| Ok(Knot::of(&mut body)?));
        match knot {
            Ok(knot) => knots.push(knot),
            Err(ModelError::Solve(failure)) if knots.len() < 2 => {
                return Err(TabulationError::TooShallow { reached, asked, failure });
            }
            Err(ModelError::Solve(_)) => break,
            Err(ModelError::NotHeld { .. }) if knots.len() >= 2 => break,
            Err(error) => return Err(error.into()),
        }
        bodies.push(body.clone());
    }
    Ok((knots, bodies))
}

impl Knot {
    fn of(body: &mut SpaceBody<'_>) -> Result<Self, Failure> {
        let derivatives = control_derivatives::<3, _>(body)?;
        Ok(Self {
            at: DVector::from_vec(body.controls()),
            target: body.target(),
            coefficients: body.equilibrium().coefficients().to_vec(),
            derivatives,
        })
    }
}

/// The target's largest orthogonal displacement on the insertion without a paddle, length.
fn unheld(model: &InsertionModel) -> Result<f64, TabulationError> {
    let needle = &model.scene().needle;
    let mut body = model.body(&[], NewtonSettings::default())?;
    let mut largest = f64::MIN_POSITIVE;
    for k in 1..=needle.increments {
        if body.drive(needle.depth * f64::from(k) / f64::from(needle.increments), &[]).is_err() {
            break;
        }
        largest = largest.max((needle.orthogonal().transpose() * body.target()).norm());
    }
    Ok(largest)
}

/// A body beside the way.
#[derive(Debug, Clone)]
pub struct TabulatedBody {
    table: Arc<Tabulated>,
    at: DVector<f64>,
    target: Vector3<f64>,
    estimate: f64,
}

impl TabulatedBody {
    /// Takes needle and paddles there; paddles beyond those attached move nothing.
    ///
    /// # Errors
    /// [`Untabulated`]; the body is then where it was before.
    pub fn drive(&mut self, depth: f64, paddles: &[Point<3>]) -> Result<(), Untabulated> {
        let mut at = DVector::zeros(self.at.len());
        let numbers = std::iter::once(depth).chain(paddles.iter().flat_map(|p| p.iter().copied()));
        at.iter_mut().zip(numbers).for_each(|(to, from)| *to = from);
        self.estimate = self.table.growth * expected(self.table.distance(&at)?);
        self.target = self.table.target(&at);
        self.at = at;
        Ok(())
    }

    /// Target displacement.
    pub fn target_displacement(&self) -> Vector3<f64> {
        self.target
    }

    /// Estimated error of the target displacement, length.
    pub fn error_estimate(&self) -> f64 {
        self.estimate
    }

    /// Nodal coefficients of the full model, to first order.
    pub fn coefficients(&self) -> Vec<f64> {
        let (knot, share) = self.table.interval(self.at[0]);
        let blend = blended(share);
        let mut sum = vec![0.0; self.table.knots[0].coefficients.len()];
        for (knot, weight) in [(knot, 1.0 - blend), (knot + 1, blend)] {
            let Knot { at, coefficients, derivatives, .. } = &self.table.knots[knot];
            sum.iter_mut().zip(coefficients).for_each(|(s, c)| *s += weight * c);
            let step = &self.at - at;
            for (response, way) in derivatives.responses.chunks_exact(sum.len()).zip(step.iter()) {
                sum.iter_mut().zip(response).for_each(|(s, r)| *s += weight * way * r);
            }
        }
        sum
    }
}
