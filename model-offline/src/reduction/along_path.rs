//! A body whose state depends on its past, reduced to the neighbourhood of one insertion.
//!
//! Needle and patient go their way whatever the paddle does. Along that way the full model is solved once, the paddle
//! steered so that the target stays on the needle's line as well as one step's delay allows; what a paddle does that goes
//! another way is the actuation Jacobian there times the difference. A step costs a lookup. How far off that is, which no
//! state of the model itself can tell, is learnt from ways that the paddle does not go in training, and estimated with every
//! step from how far it has been off the path so far. The step in which the skin gives way is looked into: the body jumps there.

use super::error::TrainingError;
use crate::model::{Pose, TissueModel};
use crate::needle::{Course, NeedleError, NeedleReading};
use crate::parallel;
use crate::random::SplitMix64;
use crate::scene::Motion;
use nalgebra::{Matrix2, SMatrix, Vector2};
use std::sync::Arc;

/// Steps of an insertion, if nothing asks for more, and as many as are tried.
const LEAST_STEPS: usize = 110;
const MOST_STEPS: f64 = 5000.0;

/// How an insertion is learnt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathOptions {
    /// Seconds from the start of the needle to the end.
    pub duration: f64,
    /// Steps of time.
    pub steps: usize,
    /// Whether the paddle is steered; else it stays where it rests, and nothing is learnt of what it does.
    pub steered: bool,
    /// Ways that errors are learnt from.
    pub trials: usize,
    /// Threads.
    pub threads: usize,
}

impl PathOptions {
    /// For an insertion of so many seconds.
    pub fn new(duration: f64) -> Self {
        Self { duration, steps: LEAST_STEPS, steered: true, trials: 6, threads: 1 }
    }

    /// The same with steps that follow what moves the patient.
    ///
    /// # Errors
    /// [`TrainingError::TooFast`] where that takes more steps than are tried.
    pub fn following(self, motion: &Motion) -> Result<Self, TrainingError> {
        motion.longest_step().map_or(Ok(self), |step| self.in_steps_of(step))
    }

    /// The same with steps that take at most so many seconds.
    ///
    /// # Errors
    /// [`TrainingError::TooFast`] where that takes more steps than are tried.
    pub fn in_steps_of(self, longest: f64) -> Result<Self, TrainingError> {
        let needed = (self.duration / longest * (1.0 - 1e-9)).ceil();
        if needed > MOST_STEPS {
            return Err(TrainingError::TooFast { steps: needed, most: MOST_STEPS });
        }
        Ok(Self { steps: self.steps.max(needed as usize), ..self })
    }
}

/// A state on the path.
#[derive(Debug, Clone)]
struct Knot {
    paddle: Vector2<f64>,
    target: Vector2<f64>,
    jacobian: Matrix2<f64>,
    coefficients: Vec<f64>,
}

/// What is known of the moment when the skin gives way: it is found within its step, because target and Jacobian jump there.
#[derive(Debug, Clone)]
struct Jump {
    /// The knot before it.
    knot: usize,
    /// When it has not happened and when it has, parts of the interval after that knot.
    between: [f64; 2],
    /// The states then.
    states: Box<[Knot; 2]>,
}

impl Jump {
    /// How far it is known: halvings of an interval.
    const HALVINGS: u32 = 7;

    /// Something at a part of the interval whose `ends` are known: straight before and after the jump.
    fn at<const C: usize>(
        &self,
        share: f64,
        ends: [SMatrix<f64, 2, C>; 2],
        of: impl Fn(&Knot) -> SMatrix<f64, 2, C>,
    ) -> SMatrix<f64, 2, C> {
        let [from, to] = self.between;
        let [before, after] = [of(&self.states[0]), of(&self.states[1])];
        let ([start, end], low, high) = if share < from {
            ([ends[0], before], 0.0, from)
        } else if share < to {
            ([before, after], from, to)
        } else {
            ([after, ends[1]], to, 1.0)
        };
        if high > low { start + (end - start) * ((share - low) / (high - low)) } else { end }
    }
}

/// What errors grow with: the largest distance from the path so far, and its square.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct ErrorGrowth {
    /// Length: of the path itself, by what lies between its knots.
    still: f64,
    linear: f64,
    /// Per length.
    square: f64,
}

impl ErrorGrowth {
    fn at(&self, distance: f64) -> f64 {
        self.still + distance * (self.linear + distance * self.square)
    }
}

/// The neighbourhood of one insertion.
#[derive(Debug, Clone)]
pub struct AlongPath {
    interval: f64,
    knots: Vec<Knot>,
    jump: Option<Jump>,
    growth: ErrorGrowth,
}

/// Shortest distance from the path, over the depth, that errors are learnt at: where nothing moves the target there is no
/// other.
const LEAST_DISTANCE: f64 = 0.02;

/// The worst of a few trials is not the worst there is.
const UNSEEN: f64 = 3.0;

/// The direction J⁻¹n in which a paddle moves the target across the needle alone.
fn across(rest: &Knot, normal: Vector2<f64>) -> Option<Vector2<f64>> {
    rest.jacobian.try_inverse().map(|inverse| (inverse * normal).normalize())
}

/// Where on the path.
struct Between {
    knot: usize,
    share: f64,
}

impl AlongPath {
    /// Learns an insertion; `way` says where patient and needle are at a time since its start, and where the paddle is
    /// planned to be. Where it is steered, it leaves the plan by as much as the target's way off the line asks for.
    ///
    /// # Errors
    /// [`TrainingError::Path`] where the tissue cannot be taken along it.
    pub fn learn(
        model: &TissueModel,
        paddle: Option<usize>,
        way: &(dyn Fn(f64) -> Pose + Sync),
        options: &PathOptions,
    ) -> Result<Self, TrainingError> {
        let walk = Walk { model, paddle, way, interval: options.duration / options.steps as f64, steps: options.steps };
        let normal = model.scene().needle.orthogonal();
        let steered = options.steered && paddle.is_some();
        // How far it is off the plan, along the one direction that moves the target across the needle and not along it: steered
        // by the Jacobians on the way it would drift where no controller goes.
        let (mut now, mut then) = (0.0, 0.0);
        let (knots, jump) = walk.knots(|knots| {
            let ([.., before, last], Some(direction)) = (knots, knots.first().and_then(|rest| across(rest, normal)))
            else {
                return Vector2::zeros();
            };
            if steered {
                // What the last step added, and what it left: what a controller does that knows the tissue.
                let error = |knot: &Knot| normal.dot(&knot.target);
                let answer = normal.dot(&(last.jacobian * direction));
                let next = 2.0 * now - then - (2.0 * error(last) - error(before)) / answer;
                // No farther than its actuator goes.
                let farthest = model.scene().actuator.max_displacement;
                (then, now) = (now, if next.is_finite() { next.clamp(-farthest, farthest) } else { now });
            }
            direction * now
        })?;
        let mut path = Self { interval: walk.interval, knots, jump, growth: ErrorGrowth::default() };
        path.growth.still = path.between_knots();
        if steered && options.trials > 0 {
            path.learn_errors(&walk, options)?;
        }
        Ok(path)
    }

    /// What cubics between knots leave out: an eighth of second differences is what straight lines would, of fourth ones 3/128
    /// what cubics do. Where the skin gives way they do not go.
    fn between_knots(&self) -> f64 {
        let fourth = |k: usize| {
            let at = |i: usize| self.knots[k + i].target;
            (at(0) - at(1) * 4.0 + at(2) * 6.0 - at(3) * 4.0 + at(4)).norm()
        };
        let is_smooth = |k: &usize| !self.jump.as_ref().is_some_and(|jump| (*k..k + 4).contains(&jump.knot));
        (0..self.knots.len().saturating_sub(4)).filter(is_smooth).map(fourth).fold(0.0, f64::max) * 3.0 / 128.0
    }

    /// Takes the full model along ways beside the path and sees how far off the reduction is.
    fn learn_errors(&mut self, walk: &Walk<'_>, options: &PathOptions) -> Result<(), TrainingError> {
        let travel = self.knots.iter().map(|knot| knot.paddle.norm()).fold(0.0, f64::max);
        let moved = self.knots.iter().map(|knot| knot.target.norm()).fold(0.0, f64::max);
        let far = (0.5 * travel.max(moved)).max(LEAST_DISTANCE * walk.model.scene().needle.depth);
        let path = &*self;
        let trials = parallel::map(options.trials, options.threads, |trial| {
            // Alternately near and far, so that what grows with the distance is told from what grows with its square.
            let size = if trial % 2 == 0 { 0.1 * far } else { far };
            path.errors_beside(walk, size, trial as u64 + 1)
        });
        let mut seen: Vec<(f64, f64)> = Vec::new();
        for trial in trials {
            seen.extend(trial?);
        }
        let still = self.growth.still;
        let beyond = |error: f64, known: f64| (error - known).max(0.0);
        let near = seen.iter().filter(|(distance, _)| *distance > 0.0 && *distance < 0.3 * far);
        let linear = near.map(|(distance, error)| beyond(*error, still) / distance).fold(0.0, f64::max);
        let apart = seen.iter().filter(|(distance, _)| *distance > 0.3 * far);
        let square = apart
            .map(|(distance, error)| beyond(*error, still + linear * distance) / distance.powi(2))
            .fold(0.0, f64::max);
        self.growth = ErrorGrowth { still, linear: UNSEEN * linear, square: UNSEEN * square };
        Ok(())
    }

    /// Largest distance from the path so far and error now, knot by knot, on a random way beside it.
    fn errors_beside(&self, walk: &Walk<'_>, size: f64, seed: u64) -> Result<Vec<(f64, f64)>, TrainingError> {
        let beside = RandomWay::new(size, seed, walk.interval * walk.steps as f64);
        let at = |k: usize| self.knots[k].paddle + beside.at(walk.interval * k as f64);
        let found = walk.courses(&at, |course| course.target_displacement())?;
        let mut farthest = 0.0_f64;
        let errors = found.into_iter().enumerate().map(|(k, target)| {
            let off = at(k) - self.knots[k].paddle;
            farthest = farthest.max(off.norm());
            let own = self.knots[k].target + self.knots[k].jacobian * off;
            (farthest, (own - target).norm())
        });
        Ok(errors.collect())
    }

    fn between(&self, since_start: f64) -> Between {
        let place = (since_start / self.interval).clamp(0.0, (self.knots.len() - 1) as f64);
        let knot = (place as usize).min(self.knots.len() - 2);
        Between { knot, share: place - knot as f64 }
    }

    /// The jump, if it lies after this knot.
    fn jump_after(&self, knot: usize) -> Option<&Jump> {
        self.jump.as_ref().filter(|jump| jump.knot == knot)
    }

    /// A cubic through the knots around, its slopes those of their differences on this side of the jump.
    fn cubic(&self, Between { knot, share }: &Between, of: impl Fn(&Knot) -> Vector2<f64>) -> Vector2<f64> {
        let at = |k: usize| of(&self.knots[k]);
        if let Some(jump) = self.jump_after(*knot) {
            return jump.at(*share, [at(*knot), at(knot + 1)], of);
        }
        let last = self.knots.len() - 1;
        let slope = |k: usize| match k {
            k if k == 0 || self.jump_after(k - 1).is_some() => at(k + 1) - at(k),
            k if k == last || self.jump_after(k).is_some() => at(k) - at(k - 1),
            k => 0.5 * (at(k + 1) - at(k - 1)),
        };
        let (s, a, b) = (*share, at(*knot), at(knot + 1));
        let (da, db) = (slope(*knot), slope(knot + 1));
        a + da * s + (3.0 * (b - a) - 2.0 * da - db) * s.powi(2) + (da + db - 2.0 * (b - a)) * s.powi(3)
    }

    /// A body of this model, at the start.
    pub fn body(self: &Arc<Self>) -> PathBody {
        PathBody { path: Arc::clone(self), time: 0.0, off: Vector2::zeros(), farthest: 0.0 }
    }

    /// Number of knots.
    pub fn knots(&self) -> usize {
        self.knots.len()
    }

    /// Time between knots, s.
    pub fn interval(&self) -> f64 {
        self.interval
    }

    /// Where the paddle is on the path, at a time since its start.
    pub fn paddle(&self, since_start: f64) -> Vector2<f64> {
        self.cubic(&self.between(since_start), |knot| knot.paddle)
    }
}

/// A body beside the path.
#[derive(Debug, Clone)]
pub struct PathBody {
    path: Arc<AlongPath>,
    time: f64,
    off: Vector2<f64>,
    farthest: f64,
}

impl PathBody {
    /// Goes to a time since the start of the needle, with the paddle displaced.
    pub fn go_to(&mut self, since_start: f64, paddle: Vector2<f64>) {
        self.time = since_start;
        self.off = paddle - self.path.cubic(&self.path.between(since_start), |knot| knot.paddle);
        self.farthest = self.farthest.max(self.off.norm());
    }

    /// The same path, from its start.
    pub fn afresh(&self) -> Self {
        self.path.body()
    }

    /// Moves the paddle at the same time.
    pub fn displace(&mut self, paddle: Vector2<f64>) {
        self.go_to(self.time, paddle);
    }

    /// Target displacement.
    pub fn target_displacement(&self) -> Vector2<f64> {
        let between = self.path.between(self.time);
        let [before, after] = [0, 1].map(|k| self.path.knots[between.knot + k].jacobian);
        let jacobian = match self.path.jump_after(between.knot) {
            Some(jump) => jump.at(between.share, [before, after], |knot| knot.jacobian),
            None => before * (1.0 - between.share) + after * between.share,
        };
        self.path.cubic(&between, |knot| knot.target) + jacobian * self.off
    }

    /// Error of the target displacement that it is estimated to have, length: it grows with the square of the largest
    /// distance from the path so far. Between knots of the path nothing is known but how the knots bend.
    pub fn error_estimate(&self) -> f64 {
        self.path.growth.at(self.farthest)
    }

    /// Whether a body whose skin `holds` has the jump at the puncture still before it where this one has it behind, or the other
    /// way round: targets are then apart by as much as they jump, whatever the rest is worth. On the jump itself nobody knows.
    pub fn is_apart_from(&self, holds: bool) -> bool {
        let between = self.path.between(self.time);
        self.path.jump.as_ref().is_some_and(|jump| {
            let [from, to] = jump.between.map(|share| jump.knot as f64 + share);
            let place = between.knot as f64 + between.share;
            place > from && place < to || holds != (place <= from)
        })
    }

    /// Coefficients of the path's nearest knot: what a picture shows.
    pub fn coefficients(&self) -> &[f64] {
        let Between { knot, share } = self.path.between(self.time);
        let turn = self.path.jump_after(knot).map_or(0.5, |jump| jump.between[1]);
        &self.path.knots[if share < turn { knot } else { knot + 1 }].coefficients
    }
}

/// The full model's way through an insertion, step by step.
struct Walk<'w> {
    model: &'w TissueModel,
    paddle: Option<usize>,
    way: &'w (dyn Fn(f64) -> Pose + Sync),
    interval: f64,
    steps: usize,
}

impl<'w> Walk<'w> {
    fn course(&self) -> Result<Course<'w>, TrainingError> {
        Course::in_small_steps(self.model, self.paddle).map_err(failed(0.0))
    }

    fn step(&self, course: &mut Course<'_>, k: usize, paddle: Vector2<f64>) -> Result<(), TrainingError> {
        let time = self.interval * k as f64;
        course.take_in(Pose { paddle, ..(self.way)(time) }, self.interval).map_err(failed(time))
    }

    /// The knots of a way whose paddle is decided step by step, and where between them the skin gives way.
    fn knots(
        &self,
        mut decide: impl FnMut(&[Knot]) -> Vector2<f64>,
    ) -> Result<(Vec<Knot>, Option<Jump>), TrainingError> {
        let mut course = self.course()?;
        let mut knots = vec![self.knot(&mut course, 0.0)?];
        let mut jump = None;
        for k in 1..=self.steps {
            let time = self.interval * k as f64;
            let paddle = (self.way)(time).paddle + decide(&knots);
            let before = course.pushes_the_skin().then(|| course.clone());
            self.step(&mut course, k, paddle)?;
            if let Some(before) = before.filter(|_| !course.pushes_the_skin()) {
                jump = self.jump(&before, k, paddle);
            }
            knots.push(self.knot(&mut course, time)?);
        }
        Ok((knots, jump))
    }

    fn knot(&self, course: &mut Course<'_>, time: f64) -> Result<Knot, TrainingError> {
        let jacobian = match self.paddle {
            Some(_) => course.actuation_jacobian().map_err(failed(time))?,
            None => Matrix2::zeros(),
        };
        Ok(Knot {
            paddle: course.pose().paddle,
            target: course.target_displacement(),
            jacobian,
            coefficients: course.coefficients().to_vec(),
        })
    }

    /// Where within step `k`, which begins with a needle that pushes the skin, that gives way; none where a shorter step
    /// cannot be taken.
    fn jump(&self, begin: &Course<'_>, k: usize, paddle: Vector2<f64>) -> Option<Jump> {
        let from = begin.pose().paddle;
        let after = |share: f64| {
            let time = self.interval * (k as f64 - 1.0 + share);
            let pose = Pose { paddle: from + (paddle - from) * share, ..(self.way)(time) };
            let mut course = begin.clone();
            course.take_in(pose, self.interval * share).ok()?;
            Some(course)
        };
        let [mut pushing, mut through] = [(0.0, begin.clone()), (1.0, after(1.0)?)];
        for _ in 0..Jump::HALVINGS {
            let share = 0.5 * (pushing.0 + through.0);
            let course = after(share)?;
            let end = if course.pushes_the_skin() { &mut pushing } else { &mut through };
            *end = (share, course);
        }
        let between = [pushing.0, through.0];
        let states = [self.knot(&mut pushing.1, 0.0).ok()?, self.knot(&mut through.1, 0.0).ok()?];
        Some(Jump { knot: k - 1, between, states: Box::new(states) })
    }

    /// What is seen of the body step by step, on a way whose paddle is known.
    fn courses<T>(
        &self,
        paddle: &dyn Fn(usize) -> Vector2<f64>,
        mut see: impl FnMut(&Course<'_>) -> T,
    ) -> Result<Vec<T>, TrainingError> {
        let mut course = self.course()?;
        (0..=self.steps)
            .map(|k| {
                if k > 0 {
                    self.step(&mut course, k, paddle(k))?;
                }
                Ok(see(&course))
            })
            .collect()
    }
}

/// A moment of the full model's way.
#[derive(Debug, Clone, PartialEq)]
pub struct AlongTheWay {
    /// Target displacement, length.
    pub target: Vector2<f64>,
    /// What the needle meets.
    pub needle: NeedleReading,
}

/// Where the full model goes, moment by moment, when the paddle goes its own way.
///
/// # Errors
/// [`TrainingError::Path`] where the tissue cannot be taken along it.
pub fn along(
    model: &TissueModel,
    attached: Option<usize>,
    way: &(dyn Fn(f64) -> Pose + Sync),
    interval: f64,
    paddle: &[Vector2<f64>],
) -> Result<Vec<AlongTheWay>, TrainingError> {
    let walk = Walk { model, paddle: attached, way, interval, steps: paddle.len().saturating_sub(1) };
    let see = |course: &Course<'_>| AlongTheWay { target: course.target_displacement(), needle: course.reading() };
    walk.courses(&|k| paddle[k], see)
}

fn failed(time: f64) -> impl FnOnce(NeedleError) -> TrainingError {
    move |source| TrainingError::Path { time, source: Box::new(source) }
}

/// A smooth random way that begins at rest: three waves of random phases and directions.
struct RandomWay {
    waves: [(Vector2<f64>, f64, f64); 3],
    /// Seconds until it is at its full size.
    rise: f64,
}

impl RandomWay {
    fn new(size: f64, seed: u64, duration: f64) -> Self {
        let mut random = SplitMix64(seed);
        let mut uniform = || random.unit();
        let waves = std::array::from_fn(|_| {
            let angle = std::f64::consts::TAU * uniform();
            let direction = Vector2::new(angle.cos(), angle.sin()) * (size / 3.0);
            // From one wave in the insertion to eight.
            let frequency = std::f64::consts::TAU * 8.0_f64.powf(uniform()) / duration;
            (direction, frequency, std::f64::consts::TAU * uniform())
        });
        Self { waves, rise: 0.1 * duration }
    }

    fn at(&self, time: f64) -> Vector2<f64> {
        let sum: Vector2<f64> =
            self.waves.iter().map(|(way, frequency, phase)| way * (frequency * time + phase).sin()).sum();
        sum * (time / self.rise).clamp(0.0, 1.0)
    }
}
