//! Reading the inputs of a tick, and what follows from their ages.

use super::state::{from_frame, to_frame};
use super::{Controller, State};
use crate::contract::{Faults, NeedleSample, PaddleSample, TargetSample};
use crate::detection::FROZEN_TRAVEL;
use crate::inputs::Inputs;
use crate::inputs::checks::Checks;
use crate::inputs::ledger::Discard;
use crate::inputs::monitors::{FollowingMonitor, Motion};
use crate::inputs::sample::{Measurement, are_within};
use crate::inputs::stream::StreamGate;
use crate::scalar::Scalar;
use crate::settings::AgeLimits;
use crate::units::seconds;

impl<T: Scalar> Controller<'_, T> {
    /// Reads all streams. Returns a target sample that may be integrated.
    pub(super) fn read_inputs(
        &self,
        state: &mut State<T>,
        inputs: &Inputs,
        faults: &mut Faults,
    ) -> Option<Measurement> {
        let checks = Checks::new(&self.runtime, inputs.time_ns);
        if let Some(sample) = &inputs.needle {
            self.read_needle(state, &checks, sample, faults);
        }
        if let Some(sample) = &inputs.paddle {
            self.read_paddle(state, &checks, sample, faults);
        }
        inputs.target.as_ref().and_then(|sample| self.read_target(state, &checks, sample, faults))
    }

    fn read_needle(&self, state: &mut State<T>, checks: &Checks<'_, T>, sample: &NeedleSample, faults: &mut Faults) {
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
        state: &mut State<T>,
        checks: &Checks<'_, T>,
        sample: &TargetSample,
        faults: &mut Faults,
    ) -> Option<Measurement> {
        let is_visible = sample.is_visible();
        let (sample, previous) = (Measurement::from(sample), state.target.accepted);
        // Only a value like the one before it can be frozen.
        let identical = sample.is_like(previous.as_ref());
        let (predicted, admitted) = if identical {
            (self.predicted_target(state), state.target_resolution.unseen_motion(self.runtime.target_range))
        } else {
            Default::default()
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
    fn predicted_target(&self, state: &State<T>) -> [f64; 2] {
        let depth = state.needle.accepted.map(|needle| T::of(needle.values[0]));
        let location = depth.and_then(|depth| self.table.locate(depth));
        location.map(|location| to_frame(&location.target_displacement())).unwrap_or_default()
    }

    fn read_paddle(&self, state: &mut State<T>, checks: &Checks<'_, T>, sample: &PaddleSample, faults: &mut Faults) {
        let runtime = &self.runtime;
        let identity = sample.paddle_index;
        let (sample, previous) = (Measurement::from(sample), state.paddle.accepted.as_ref());
        let identical = sample.is_like(previous);
        let age = seconds(checks.now_ns.saturating_sub(sample.time_ns));
        let commanded = state.displacement.as_ref().map(to_frame);
        let mut content = checks.paddle(&sample, previous);
        if identity != runtime.paddle_index {
            content = Err(Discard::Identity);
        } else if let (Ok(()), Some(commanded)) = (content, &commanded) {
            let admitted = FROZEN_TRAVEL * runtime.limits.max_displacement.to_f64() + runtime.unseen_motion(age);
            content = state.paddle_frozen.check(identical, commanded, admitted);
        }
        if !state.paddle.offer(&sample, checks.judge(content), &mut state.ledger.paddle, faults) {
            return;
        }
        let Some(commanded) = commanded else {
            self.adopt(state, checks, &sample, faults);
            return;
        };
        state.paddle_frozen.accept(identical, &commanded);
        let follows = FollowingMonitor::follows(runtime, &sample.values, &commanded, age);
        if follows || state.armed {
            faults.set_if(Faults::FOLLOWING_ERROR, state.following.enter(follows));
        } else {
            // Moved by somebody else before the start: where it is then counts.
            *faults |= Faults::PADDLE_MOVING;
            state.forget_position();
        }
    }

    /// Starting (again) must not move the paddle: the first command is where it is. That is known from a measurement
    /// that is fresh, within the limits, and at rest.
    fn adopt(&self, state: &mut State<T>, checks: &Checks<'_, T>, sample: &Measurement, faults: &mut Faults) {
        let runtime = &self.runtime;
        // Even when everything else is there already: RUN may follow on the next tick.
        *faults |= Faults::WAITING;
        let motion = state.rest.enter(runtime, sample);
        faults.set_if(Faults::PADDLE_MOVING, motion == Motion::Moving);
        let fresh = checks.now_ns.saturating_sub(sample.time_ns) <= runtime.paddle_age.hold_ns;
        if motion != Motion::Resting || !fresh {
            return;
        }
        let admissible = runtime.limits.clamp_position(&from_frame(&sample.values));
        if are_within(&to_frame(&admissible), &sample.values, runtime.paddle_resolution) {
            state.displacement = Some(admissible);
        } else {
            *faults |= Faults::PADDLE_BEYOND_LIMIT;
        }
    }

    /// Before RUN, nothing accepted long ago may stand in the way of what arrives now: a first sample that was wrong
    /// would have every right one after it refused as a jump. Once armed, the age leads to SAFE instead.
    pub(super) fn expire_before_arming(&self, state: &mut State<T>) {
        let Some(now_ns) = state.clock.now_ns().filter(|_| !state.armed) else {
            return;
        };
        let expire = |stream: &mut StreamGate, limits: AgeLimits| {
            let expired = stream.accepted.is_some_and(|last| now_ns.saturating_sub(last.time_ns) > limits.safe_ns);
            if expired {
                stream.accepted = None;
            }
            expired
        };
        expire(&mut state.needle, self.runtime.needle_age);
        expire(&mut state.target, self.runtime.target_age);
        if expire(&mut state.paddle, self.runtime.paddle_age) {
            state.forget_position();
        }
    }

    /// Faults from what was accepted last: age, visibility, speed, range.
    pub(super) fn check_ages(&self, state: &State<T>, faults: &mut Faults) {
        let Some(now_ns) = state.clock.now_ns() else {
            return;
        };
        let runtime = &self.runtime;
        let mut check = |stream: &StreamGate, limits: AgeLimits, stale: Faults, dead: Faults| {
            let Some(last) = &stream.accepted else {
                *faults |= Faults::WAITING;
                return;
            };
            let age_ns = now_ns.saturating_sub(last.time_ns);
            faults.set_if(stale, age_ns > limits.hold_ns);
            faults.set_if(dead, state.armed && age_ns > limits.safe_ns);
        };
        check(&state.needle, runtime.needle_age, Faults::NEEDLE_STALE, Faults::NEEDLE_DEAD);
        check(&state.target, runtime.target_age, Faults::TARGET_STALE, Faults::TARGET_DEAD);
        check(&state.paddle, runtime.paddle_age, Faults::PADDLE_STALE, Faults::PADDLE_DEAD);
        faults.set_if(Faults::WAITING, state.displacement.is_none());
        faults.set_if(Faults::TARGET_LOST, state.target_lost);
        if let Some(needle) = &state.needle.accepted {
            let (start, end) = runtime.table_depth;
            let [depth, velocity] = needle.values;
            faults.set_if(Faults::NEEDLE_TOO_FAST, velocity.abs() > runtime.needle_speed);
            faults.set_if(Faults::DEPTH_CLAMPED, depth < start || depth > end);
        }
    }
}
