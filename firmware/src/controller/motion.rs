//! The law: where the paddles go on a tick in RUN.

use nalgebra::{SMatrix, SVector};

use super::feedback::Setting;
use super::history::{INTERVALS, Moment};
use super::state::{Underway, columns};
use super::{Controller, State};
use crate::contract::Faults;
use crate::inputs::sample::Measurement;
use crate::law::Feedback;
use crate::limits::Limits;
use crate::scalar::Scalar;
use crate::units::seconds;

/// What the law has to know of a tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tick<const D: usize = 2> {
    /// Its time, ns.
    pub(super) time_ns: u64,
    /// Time since the tick before, ns.
    pub(super) elapsed_ns: u64,
    /// A target sample that has not been used.
    pub(super) fresh_target: Option<Measurement<D>>,
}

impl<T: Scalar, const D: usize, const N: usize, const P: usize> Controller<'_, T, D, N, P> {
    /// Where the needle will be when a command of this tick acts, length.
    pub(super) fn depth_ahead(&self, state: &State<T, D, N, P>, time_ns: u64) -> Option<T> {
        let needle = state.needle.accepted?;
        let [depth, velocity] = needle.values;
        let lead_ns = time_ns.saturating_sub(needle.time_ns).saturating_add(self.runtime.actuator_delay_ns);
        Some(T::of(depth + velocity * seconds(lead_ns)))
    }

    /// Feed-forward plus feedback, within the limits of each paddle.
    pub(super) fn move_paddles(&self, state: &mut State<T, D, N, P>, tick: &Tick<D>, depth: T, faults: &mut Faults) {
        let runtime = &self.runtime;
        let (Some(previous), Some(needle)) = (state.displacement(), state.needle.accepted) else {
            return;
        };
        let Some(location) = self.table.locate(depth) else {
            return;
        };
        let feed_forward = location.paddle_path();
        let limits = self.limits(tick.elapsed_ns);
        let setting = Setting { time_ns: tick.time_ns, location, feed_forward, previous, limits };
        let feedback = match runtime.feedback {
            Feedback::Integral => self.integrate(state, tick.fresh_target, &setting),
            Feedback::Observer | Feedback::Harmonic => self.observe(state, tick.fresh_target, &setting),
        };
        let mut goals = feed_forward + feedback.added.now;
        let recovered = self.hand_over(&mut goals, &setting);

        let mut next = previous;
        let (mut beyond, mut rate_limited) = (0, false);
        let towards = columns(&previous).iter().zip(columns(&goals)).zip(&setting.limits);
        for (next, ((previous, goal), limits)) in next.data.0.iter_mut().zip(towards) {
            let limited = limits.command::<D>(&SVector::from(*previous), &SVector::from(*goal));
            *next = limited.displacement.into();
            beyond += usize::from(limited.position_limited);
            rate_limited |= limited.rate_limited;
        }
        // A correction that saturation swallows proves nothing about the sign of the plant.
        let acts = beyond == 0 || (beyond < P && recovered);
        if let Some(correction) = feedback.correction.filter(|correction| correction.acted.unwrap_or(acts)) {
            let diverges = state.divergence.update(runtime, correction.error, correction.size, needle.values[1]);
            faults.set_if(Faults::DIVERGENCE, diverges);
        }
        if !next.as_slice().iter().all(|component| component.to_f64().is_finite()) {
            *faults |= Faults::INTERNAL;
            return;
        }
        faults.set_if(Faults::POSITION_LIMITED, beyond > 0);
        faults.set_if(Faults::RATE_LIMITED, rate_limited);
        let steps = next - previous;
        if rate_limited {
            self.note_motion_underway(state, tick, steps);
        }
        for (travel, step) in state.gate.travel.paddles.iter_mut().zip(columns(&steps)) {
            for (travel, step) in travel.iter_mut().zip(step) {
                *travel += step.abs().to_f64();
            }
        }
        state.added = Some(feedback.added);
        for (paddle, next) in state.paddles.iter_mut().zip(columns(&next)) {
            paddle.displacement = Some(SVector::from(*next));
        }
    }

    /// Limits of each paddle, so long after the tick before. The rate limit is one per second: a tick that comes early may
    /// go less far, one that comes late no further.
    fn limits(&self, elapsed_ns: u64) -> [Limits<T>; P] {
        let mut limits = self.runtime.paddles.each_ref().map(|paddle| paddle.limits);
        if elapsed_ns < self.runtime.loop_period_ns {
            for (limits, paddle) in limits.iter_mut().zip(&self.runtime.paddles) {
                limits.max_step = T::of(paddle.rate * seconds(elapsed_ns));
            }
        }
        limits
    }

    /// Remembers where needle and paddles are once the command of this tick has acted.
    pub(super) fn remember(&self, state: &mut State<T, D, N, P>, time_ns: u64, depth: T) {
        if let (Feedback::Observer | Feedback::Harmonic, Some(paddles)) = (self.runtime.feedback, state.displacement())
        {
            let time_ns = time_ns.saturating_add(self.runtime.actuator_delay_ns);
            state.history.record(self.runtime.history_ns / INTERVALS, Moment { time_ns, depth, paddles });
        }
    }

    fn note_motion_underway(&self, state: &mut State<T, D, N, P>, tick: &Tick<D>, step: SMatrix<T, D, P>) {
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
