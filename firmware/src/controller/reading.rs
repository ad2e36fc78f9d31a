//! Reading the inputs of a tick, and what follows from their ages.

use super::state::{PaddleState, from_components, to_components};
use super::{Controller, State};
use crate::contract::{Faults, NeedleSample, PaddleSample, TargetSample};
use crate::detection::FROZEN_TRAVEL;
use crate::inputs::Inputs;
use crate::inputs::checks::Checks;
use crate::inputs::ledger::{Discard, StreamLedger};
use crate::inputs::monitors::{FollowingMonitor, Motion};
use crate::inputs::sample::{Measurement, are_within};
use crate::inputs::stream::StreamGate;
use crate::scalar::Scalar;
use crate::settings::{AgeLimits, PaddleRuntime};
use crate::units::seconds;

impl<T: Scalar, const D: usize, const N: usize, const P: usize> Controller<'_, T, D, N, P> {
    /// Reads all streams. Returns a target sample that may be integrated.
    pub(super) fn read_inputs(
        &self,
        state: &mut State<T, D, N, P>,
        inputs: &Inputs,
        faults: &mut Faults,
    ) -> Option<Measurement<D>> {
        let checks = Checks::new(&self.runtime, inputs.time_ns);
        if let Some(sample) = &inputs.needle {
            self.read_needle(state, &checks, sample, faults);
        }
        self.read_paddles(state, &checks, inputs, faults);
        inputs.target.as_ref().and_then(|sample| self.read_target(state, &checks, sample, faults))
    }

    fn read_needle(
        &self,
        state: &mut State<T, D, N, P>,
        checks: &Checks<'_, T, P>,
        sample: &NeedleSample,
        faults: &mut Faults,
    ) {
        let (sample, previous) = (Measurement::from(sample), state.needle.accepted.as_ref());
        let checked = checks.needle(&sample, previous, &state.needle_monitor);
        let travelled = previous.map_or(0.0, |previous| (sample.values[0] - previous.values[0]).abs());
        if !state.needle.offer(&sample, checks.judge(checked.map(|_| ())), &mut state.ledger.needle, faults) {
            return;
        }
        state.needle_monitor = checked.unwrap_or_default();
        state.gate.travel.needle += travelled;
    }

    fn read_target(
        &self,
        state: &mut State<T, D, N, P>,
        checks: &Checks<'_, T, P>,
        sample: &TargetSample,
        faults: &mut Faults,
    ) -> Option<Measurement<D>> {
        let is_visible = sample.is_visible();
        let (sample, previous) = (Measurement::from(sample), state.target.accepted);
        // Only a value like the one before it can be frozen.
        let identical = sample.is_like(previous.as_ref());
        let (predicted, admitted) = if identical {
            (self.predicted_target(state), state.target_resolution.unseen_motion(self.runtime.target_range))
        } else {
            ([0.0; D], 0.0)
        };
        let content = if is_visible {
            let frozen = &state.target_frozen;
            checks
                .target(&sample, previous.as_ref(), &state.gate)
                .and_then(|()| frozen.check(identical, &predicted, admitted))
        } else {
            Err(Discard::NotVisible)
        };
        let mut found = Faults::NONE;
        let accepted = state.target.offer(&sample, checks.judge(content), &mut state.ledger.target, &mut found);
        *faults |= found;
        state.target_lost |= found.contains(Faults::TARGET_LOST);
        if !accepted {
            return None;
        }
        state.target_lost = false;
        state.gate.accept();
        state.target_frozen.accept(identical, &predicted);
        state.target_resolution.accept(&sample, previous.as_ref());
        Some(sample)
    }

    /// Where the table has the target at the needle's depth, length.
    fn predicted_target(&self, state: &State<T, D, N, P>) -> [f64; D] {
        let depth = state.needle.accepted.map(|needle| T::of(needle.values[0]));
        let location = depth.and_then(|depth| self.table.locate(depth));
        location.map_or([0.0; D], |location| to_components(&location.target_displacement()))
    }

    /// Every paddle has its own stream and monitors. What they find of the second one is told apart from the first.
    fn read_paddles(
        &self,
        state: &mut State<T, D, N, P>,
        checks: &Checks<'_, T, P>,
        inputs: &Inputs,
        faults: &mut Faults,
    ) {
        let streams = inputs.paddles.iter().zip(&mut state.ledger.paddles);
        let paddles = state.paddles.iter_mut().zip(&self.runtime.paddles);
        for (place, ((sample, ledger), (paddle, limits))) in streams.zip(paddles).enumerate() {
            let Some(sample) = sample else { continue };
            let mut found = Faults::NONE;
            let reading = Reading { checks, limits, armed: state.armed };
            reading.read(paddle, sample, ledger, &mut found);
            *faults |= found;
            faults.set_if(Faults::SECOND_PADDLE, place > 0 && !found.is_empty());
        }
    }

    /// Before RUN, nothing accepted long ago may stand in the way of what arrives now: a first sample that was wrong
    /// would have every right one after it refused as a jump. Once armed, the age leads to SAFE instead.
    pub(super) fn expire_before_arming(&self, state: &mut State<T, D, N, P>) {
        let Some(now_ns) = state.clock.now_ns().filter(|_| !state.armed) else {
            return;
        };
        expire(&mut state.needle, now_ns, self.runtime.needle_age);
        expire(&mut state.target, now_ns, self.runtime.target_age);
        for paddle in &mut state.paddles {
            if expire(&mut paddle.stream, now_ns, self.runtime.paddle_age) {
                paddle.forget_position();
            }
        }
    }

    /// Faults from what was accepted last: age, visibility, speed, range.
    pub(super) fn check_ages(&self, state: &State<T, D, N, P>, faults: &mut Faults) {
        let Some(now_ns) = state.clock.now_ns() else {
            return;
        };
        let runtime = &self.runtime;
        let since = Since { now_ns, armed: state.armed };
        *faults |= since.faults(&state.needle, runtime.needle_age, Faults::NEEDLE_STALE, Faults::NEEDLE_DEAD);
        *faults |= since.faults(&state.target, runtime.target_age, Faults::TARGET_STALE, Faults::TARGET_DEAD);
        for (place, paddle) in state.paddles.iter().enumerate() {
            let mut found = since.faults(&paddle.stream, runtime.paddle_age, Faults::PADDLE_STALE, Faults::PADDLE_DEAD);
            found.set_if(Faults::WAITING, paddle.displacement.is_none());
            *faults |= found;
            faults.set_if(Faults::SECOND_PADDLE, place > 0 && !found.is_empty());
        }
        faults.set_if(Faults::TARGET_LOST, state.target_lost);
        if let Some(needle) = &state.needle.accepted {
            let (start, end) = runtime.table_depth;
            let [depth, velocity] = needle.values;
            faults.set_if(Faults::NEEDLE_TOO_FAST, velocity.abs() > runtime.needle_speed);
            faults.set_if(Faults::DEPTH_CLAMPED, depth < start || depth > end);
        }
    }
}

/// What a sample of one paddle is read with.
struct Reading<'r, T: Scalar, const P: usize> {
    checks: &'r Checks<'r, T, P>,
    limits: &'r PaddleRuntime<T>,
    armed: bool,
}

impl<T: Scalar, const P: usize> Reading<'_, T, P> {
    fn read<const D: usize>(
        &self,
        paddle: &mut PaddleState<T, D>,
        sample: &PaddleSample,
        ledger: &mut StreamLedger,
        faults: &mut Faults,
    ) {
        let Self { checks, limits, .. } = self;
        let identity = sample.paddle_index;
        let (sample, previous) = (Measurement::from(sample), paddle.stream.accepted.as_ref());
        let identical = sample.is_like(previous);
        let age = seconds(checks.now_ns.saturating_sub(sample.time_ns));
        let unseen = limits.unseen_motion(age, checks.runtime.unseen_delay);
        let commanded = paddle.displacement.as_ref().map(to_components);
        let mut content = checks.paddle(limits, &sample, previous);
        if identity != limits.index {
            content = Err(Discard::Identity);
        } else if let (Ok(()), Some(commanded)) = (content, &commanded) {
            let admitted = FROZEN_TRAVEL * limits.limits.max_displacement.to_f64() + unseen;
            content = paddle.frozen.check(identical, commanded, admitted);
        }
        if !paddle.stream.offer(&sample, checks.judge(content), ledger, faults) {
            return;
        }
        let Some(commanded) = commanded else {
            self.adopt(paddle, &sample, faults);
            return;
        };
        paddle.frozen.accept(identical, &commanded);
        let follows = FollowingMonitor::follows(limits, &sample.values, &commanded, unseen);
        if follows || self.armed {
            faults.set_if(Faults::FOLLOWING_ERROR, paddle.following.enter(follows));
        } else {
            // Moved by somebody else before the start: where it is then counts.
            *faults |= Faults::PADDLE_MOVING;
            paddle.forget_position();
        }
    }

    /// Starting (again) must not move a paddle: the first command is where it is. That is known from a measurement
    /// that is fresh, within the limits, and at rest.
    fn adopt<const D: usize>(&self, paddle: &mut PaddleState<T, D>, sample: &Measurement<D>, faults: &mut Faults) {
        let Self { checks, limits, .. } = self;
        // Even when everything else is there already: RUN may follow on the next tick.
        *faults |= Faults::WAITING;
        let longest_ns = checks.runtime.paddle_age.hold_ns;
        let motion = paddle.rest.enter(limits.resolution, longest_ns, sample);
        faults.set_if(Faults::PADDLE_MOVING, motion == Motion::Moving);
        let fresh = checks.now_ns.saturating_sub(sample.time_ns) <= longest_ns;
        if motion != Motion::Resting || !fresh {
            return;
        }
        let admissible = limits.limits.clamp_position(&from_components(&sample.values));
        if are_within(&to_components(&admissible), &sample.values, limits.resolution) {
            paddle.displacement = Some(admissible);
        } else {
            *faults |= Faults::PADDLE_BEYOND_LIMIT;
        }
    }
}

/// Forgets what was accepted too long ago; returns whether it was.
fn expire<const V: usize>(stream: &mut StreamGate<V>, now_ns: u64, limits: AgeLimits) -> bool {
    let expired = stream.accepted.is_some_and(|last| now_ns.saturating_sub(last.time_ns) > limits.safe_ns);
    if expired {
        stream.accepted = None;
    }
    expired
}

/// What the age of a stream is measured by.
struct Since {
    now_ns: u64,
    armed: bool,
}

impl Since {
    fn faults<const V: usize>(&self, stream: &StreamGate<V>, limits: AgeLimits, stale: Faults, dead: Faults) -> Faults {
        let mut faults = Faults::NONE;
        let Some(last) = &stream.accepted else {
            return Faults::WAITING;
        };
        let age_ns = self.now_ns.saturating_sub(last.time_ns);
        faults.set_if(stale, age_ns > limits.hold_ns);
        faults.set_if(dead, self.armed && age_ns > limits.safe_ns);
        faults
    }
}
