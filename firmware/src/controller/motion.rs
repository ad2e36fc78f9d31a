//! The law: where the paddle goes on a tick in RUN.

use nalgebra::SVector;

use super::state::{Underway, from_frame, to_frame};
use super::{Controller, D, State};
use crate::contract::Faults;
use crate::inputs::sample::Measurement;
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
    /// Feed-forward plus integral feedback, within the limits.
    pub(super) fn move_paddle(&self, state: &mut State<T>, tick: &Tick, faults: &mut Faults) {
        let runtime = &self.runtime;
        let (Some(previous), Some(needle)) = (state.displacement, state.needle.accepted) else {
            return;
        };
        let [depth, velocity] = needle.values;
        // Where the needle will be when the command acts.
        let lead_ns = tick.time_ns.saturating_sub(needle.time_ns).saturating_add(runtime.actuator_delay_ns);
        let Some(location) = self.table.locate(T::of(depth + velocity * seconds(lead_ns))) else {
            return;
        };
        // The rate limit is one per second: a tick that comes early may go less far, one that comes late no further.
        let limits = if tick.elapsed_ns >= runtime.loop_period_ns {
            runtime.limits
        } else {
            Limits { max_step: T::of(runtime.paddle_rate * seconds(tick.elapsed_ns)), ..runtime.limits }
        };
        let feed_forward = location.paddle_path();
        let mut integral = state.integral.unwrap_or(previous - feed_forward);
        if let Some(sample) = tick.fresh_target {
            let n = &self.table.orthogonal;
            let error = n.dot(&from_frame(&sample.values));
            let direction = runtime.direction.solve(&location.jacobian(), n);
            let change = -runtime.gain * error;
            let correction = direction.map(|component| component * change);
            // Measured while the paddle was on its way at full rate: what is asked for once more may be there already.
            let repeats = state.underway.is_some_and(|underway| underway.explains(sample.time_ns, &correction));
            let corrected =
                if repeats { integral } else { limits.integrate(&integral, &correction, &feed_forward, &previous) };
            // A correction that saturation swallows proves nothing about the sign of the plant.
            let taken = (corrected - integral).dot(&correction);
            let acted = taken > correction.norm_squared() * T::of(0.5);
            integral = corrected;
            if acted {
                let diverges = state.divergence.update(runtime, error.to_f64(), velocity);
                faults.set_if(Faults::DIVERGENCE, diverges);
            }
        }

        let limited = limits.command(&previous, &(feed_forward + integral));
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
        state.integral = Some(integral);
        state.displacement = Some(limited.displacement);
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
