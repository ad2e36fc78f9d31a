//! The law: where the paddle goes on a tick in RUN.

use nalgebra::SVector;

use super::feedback::Setting;
use super::history::{INTERVALS, Moment};
use super::state::{Underway, to_frame};
use super::{Controller, D, State};
use crate::contract::Faults;
use crate::inputs::sample::Measurement;
use crate::law::Feedback;
use crate::limits::Limits;
use crate::scalar::Scalar;
use crate::units::seconds;

/// What the law has to know of a tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tick {
    /// Its time, ns.
    pub(super) time_ns: u64,
    /// Time since the tick before, ns.
    pub(super) elapsed_ns: u64,
    /// A target sample that has not been used.
    pub(super) fresh_target: Option<Measurement>,
}

impl<T: Scalar> Controller<'_, T> {
    /// Where the needle will be when a command of this tick acts, length.
    pub(super) fn depth_ahead(&self, state: &State<T>, time_ns: u64) -> Option<T> {
        let needle = state.needle.accepted?;
        let [depth, velocity] = needle.values;
        let lead_ns = time_ns.saturating_sub(needle.time_ns).saturating_add(self.runtime.actuator_delay_ns);
        Some(T::of(depth + velocity * seconds(lead_ns)))
    }

    /// Feed-forward plus feedback, within the limits.
    pub(super) fn move_paddle(&self, state: &mut State<T>, tick: &Tick, depth: T, faults: &mut Faults) {
        let runtime = &self.runtime;
        let (Some(previous), Some(needle)) = (state.displacement, state.needle.accepted) else {
            return;
        };
        let Some(location) = self.table.locate(depth) else {
            return;
        };
        // The rate limit is one per second: a tick that comes early may go less far, one that comes late no further.
        let limits = if tick.elapsed_ns >= runtime.loop_period_ns {
            runtime.limits
        } else {
            Limits { max_step: T::of(runtime.paddle_rate * seconds(tick.elapsed_ns)), ..runtime.limits }
        };
        let feed_forward = location.paddle_path();
        let setting = Setting { time_ns: tick.time_ns, location, feed_forward, previous, limits };
        let feedback = match runtime.feedback {
            Feedback::Integral => self.integrate(state, tick.fresh_target, &setting),
            Feedback::Observer | Feedback::Harmonic => self.observe(state, tick.fresh_target, &setting),
        };
        if let Some(correction) = feedback.correction {
            let diverges = state.divergence.update(runtime, correction.error, correction.size, needle.values[1]);
            faults.set_if(Faults::DIVERGENCE, diverges);
        }

        let limited = limits.command(&previous, &(feed_forward + feedback.added.now));
        if !to_frame(&limited.displacement).iter().all(|component| component.is_finite()) {
            *faults |= Faults::INTERNAL;
            return;
        }
        faults.set_if(Faults::POSITION_LIMITED, limited.position_limited);
        faults.set_if(Faults::RATE_LIMITED, limited.rate_limited);
        let step = limited.displacement - previous;
        if limited.rate_limited {
            self.note_motion_underway(state, tick, step);
        }
        let [x, y] = &mut state.gate.travel.paddle;
        (*x, *y) = (*x + step.x.abs().to_f64(), *y + step.y.abs().to_f64());
        state.added = Some(feedback.added);
        state.displacement = Some(limited.displacement);
    }

    /// Remembers where needle and paddle are once the command of this tick has acted.
    pub(super) fn remember(&self, state: &mut State<T>, time_ns: u64, depth: T) {
        if let (Feedback::Observer | Feedback::Harmonic, Some(paddle)) = (self.runtime.feedback, state.displacement) {
            let time_ns = time_ns.saturating_add(self.runtime.actuator_delay_ns);
            state.history.record(self.runtime.history_ns / INTERVALS, Moment { time_ns, depth, paddle });
        }
    }

    fn note_motion_underway(&self, state: &mut State<T>, tick: &Tick, step: SVector<T, D>) {
        let runtime = &self.runtime;
        let until_ns = tick.time_ns.saturating_add(runtime.loop_period_ns).saturating_add(runtime.actuator_delay_ns);
        // One motion as long as no tick is without it.
        let since_ns = match state.underway {
            Some(before) if before.until_ns >= tick.time_ns => before.since_ns,
            _ => tick.time_ns,
        };
        state.underway = Some(Underway { since_ns, until_ns, step });
    }
}
