//! What measurements of the target add to the feed-forward.

use nalgebra::SVector;

use super::state::{Added, Estimate, from_frame};
use super::{Controller, D, State};
use crate::inputs::sample::Measurement;
use crate::limits::Limits;
use crate::observer::Observer;
use crate::scalar::Scalar;
use crate::table_lookup::TableLocation;
use crate::units::seconds;

/// What the feedback of a tick starts from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setting<'t, T: Scalar> {
    /// Time of the tick, ns.
    pub(super) time_ns: u64,
    /// The table where the needle will be.
    pub(super) location: TableLocation<'t, T, D>,
    /// Its paddle displacement, length.
    pub(super) feed_forward: SVector<T, D>,
    /// The command before, length.
    pub(super) previous: SVector<T, D>,
    /// Limits of this tick.
    pub(super) limits: Limits<T>,
}

/// What the feedback of a tick comes to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fed<T: Scalar> {
    /// What it adds to the feed-forward.
    pub(super) added: Added<T>,
    /// A correction that acts, for the monitors.
    pub(super) correction: Option<Correction>,
}

/// An orthogonal error and what was done about it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Correction {
    /// Orthogonal displacement of the target, length.
    pub(super) error: f64,
    /// How far the target is to move because of it, length.
    pub(super) size: f64,
}

impl<T: Scalar> Controller<'_, T> {
    /// A fixed part of the error, at every sample.
    pub(super) fn integrate(&self, state: &State<T>, sample: Option<Measurement>, setting: &Setting<'_, T>) -> Fed<T> {
        let runtime = &self.runtime;
        let Setting { location, feed_forward, previous, limits, .. } = setting;
        let integral = state.added.map_or(previous - feed_forward, |added| added.at_sample);
        let Some(sample) = sample else {
            return Fed { added: Added { now: integral, at_sample: integral }, correction: None };
        };
        let n = &self.table.orthogonal;
        let error = n.dot(&from_frame(&sample.values));
        let direction = runtime.direction.solve(&location.jacobian(), n);
        let change = -runtime.gain * error;
        let correction = direction.map(|component| component * change);
        // Measured while the paddle was on its way at full rate: what is asked for once more may be there already.
        let repeats = state.underway.is_some_and(|underway| underway.explains(sample.time_ns, &correction));
        let corrected =
            if repeats { integral } else { limits.integrate(&integral, &correction, feed_forward, previous) };
        // A correction that saturation swallows proves nothing about the sign of the plant.
        let taken = (corrected - integral).dot(&correction);
        let acted = taken > correction.norm_squared() * T::of(0.5);
        let correction = Correction { error: error.to_f64(), size: change.abs().to_f64() };
        Fed { added: Added { now: corrected, at_sample: corrected }, correction: acted.then_some(correction) }
    }

    /// As much as the observer believes that the table leaves, at every tick: the needle goes on between two samples, and a
    /// breath turns. What the observer knows is changed where it is: a copy would be a tenth of a microcontroller's stack.
    pub(super) fn observe(
        &self,
        state: &mut State<T>,
        sample: Option<Measurement>,
        setting: &Setting<'_, T>,
    ) -> Fed<T> {
        let Setting { time_ns, location, feed_forward, previous, limits } = setting;
        let n = &self.table.orthogonal;
        let jacobian = location.jacobian();
        // Whoever placed the paddle beside its path had a reason: so much is left there.
        let before = state.added.map_or(previous - feed_forward, |added| added.at_sample);
        let estimate = state.estimate.get_or_insert_with(|| {
            let level = -n.dot(&(jacobian * before));
            self.first_estimate(level, location.depth, *time_ns)
        });
        let then = sample.and_then(|sample| state.history.at(sample.time_ns));
        let measured = then.and_then(|then| Some((then, self.table.locate(then.depth)?)));
        let mut seen = None;
        if let (Some(sample), Some((then, measured))) = (sample, measured) {
            let error = n.dot(&from_frame(&sample.values));
            let by_paddle = n.dot(&(measured.jacobian() * (then.paddle - measured.paddle_path())));
            let elapsed = T::of(seconds(sample.time_ns.saturating_sub(estimate.time_ns)));
            estimate.observer.update(&self.runtime.belief, error - by_paddle, measured.depth, elapsed);
            estimate.time_ns = sample.time_ns;
            seen = Some(error);
        }

        let acts_ns = time_ns.saturating_add(self.runtime.actuator_delay_ns);
        let breath = estimate.observer.ahead(T::of(seconds(acts_ns.saturating_sub(estimate.time_ns))));
        let change = -(estimate.observer.at(location.depth) + breath + n.dot(&(jacobian * before)));
        // Changed along d alone: where the paddle was placed across it, it stays.
        let now = before + self.runtime.direction.solve(&jacobian, n) * change;
        let Some(error) = seen else {
            return Fed { added: Added { now, at_sample: before }, correction: None };
        };
        // A correction that saturation swallows proves nothing about the sign of the plant.
        let setpoint = feed_forward + now;
        let acted = limits.clamp_position(&setpoint) == setpoint;
        let correction = Correction { error: error.to_f64(), size: change.abs().to_f64() };
        Fed { added: Added { now, at_sample: now }, correction: acted.then_some(correction) }
    }

    fn first_estimate(&self, level: T, depth: T, time_ns: u64) -> Estimate<T> {
        let surface = T::of(self.runtime.table_depth.0);
        Estimate { observer: Observer::starting(&self.runtime.belief, level, depth, surface), time_ns }
    }
}
