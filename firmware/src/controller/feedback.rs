//! What measurements of the target add to the feed-forward.

use nalgebra::{SMatrix, SVector};

use super::state::{Added, Estimate, columns, from_components, of_columns};
use super::{Controller, State};
use crate::inputs::sample::Measurement;
use crate::limits::Limits;
use crate::observer::Observer;
use crate::scalar::Scalar;
use crate::table_lookup::TableLocation;
use crate::units::seconds;

/// What the feedback of a tick starts from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setting<'t, T: Scalar, const D: usize = 2, const P: usize = 1> {
    /// Time of the tick, ns.
    pub(super) time_ns: u64,
    /// The table where the needle will be.
    pub(super) location: TableLocation<'t, T, D, P>,
    /// Its paddle displacements, length; a column per paddle, as below.
    pub(super) feed_forward: SMatrix<T, D, P>,
    /// The command before, length.
    pub(super) previous: SMatrix<T, D, P>,
    /// Limits of this tick.
    pub(super) limits: [Limits<T>; P],
}

/// What the feedback of a tick comes to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fed<T: Scalar, const D: usize = 2, const P: usize = 1> {
    /// What it adds to the feed-forward.
    pub(super) added: Added<T, D, P>,
    /// What was done about a sample, for the monitors.
    pub(super) correction: Option<Correction>,
}

/// An orthogonal error and what was done about it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Correction {
    /// Norm of the orthogonal displacement of the target, length.
    pub(super) error: f64,
    /// How far the target is to move because of it, length.
    pub(super) size: f64,
    /// Whether it acts; `None`: as long as the limits leave room for it.
    pub(super) acted: Option<bool>,
}

impl<T: Scalar, const D: usize, const N: usize, const P: usize> Controller<'_, T, D, N, P> {
    /// A fixed part of the error, at every sample.
    pub(super) fn integrate(
        &self,
        state: &State<T, D, N, P>,
        sample: Option<Measurement<D>>,
        setting: &Setting<'_, T, D, P>,
    ) -> Fed<T, D, P> {
        let runtime = &self.runtime;
        let Setting { location, feed_forward, previous, limits, .. } = setting;
        let integral = state.added.map_or(previous - feed_forward, |added| added.at_sample);
        let Some(sample) = sample else {
            return Fed { added: Added { now: integral, at_sample: integral }, correction: None };
        };
        let error = self.across(&from_components(&sample.values));
        let jacobians = location.jacobian();
        let directions = runtime.direction.solve(&jacobians, &self.table.orthogonal, &runtime.weights);
        let change = error.map(|error| -runtime.gain * error);
        let correction = along(&directions, &change);
        // Measured while the paddles were on their way at full rate: what is asked for once more may be there already.
        let repeats = state.underway.is_some_and(|underway| underway.explains(sample.time_ns, &correction));
        let mut corrected = integral;
        if !repeats {
            let correction = self.hand_over_correction(&integral, correction, setting);
            let steps = columns(&integral).iter().zip(columns(&correction));
            let places = columns(feed_forward).iter().zip(columns(previous));
            let each = corrected.data.0.iter_mut().zip(limits).zip(steps.zip(places));
            for ((corrected, limits), ((integral, correction), (feed_forward, previous))) in each {
                let [integral, correction] = [*integral, *correction].map(SVector::from);
                let [feed_forward, previous] = [*feed_forward, *previous].map(SVector::from);
                *corrected = limits.integrate::<D>(&integral, &correction, &feed_forward, &previous).into();
            }
        }
        // A correction that saturation swallows proves nothing about the sign of the plant. Of several paddles, what they do
        // together counts.
        let acted = if P == 1 {
            (corrected - integral).dot(&correction) > correction.norm_squared() * T::of(0.5)
        } else {
            let done = SVector::from(self.effect(&jacobians, &(corrected - integral)));
            let asked = SVector::from(change);
            done.dot(&asked) > asked.norm_squared() * T::of(0.5)
        };
        let correction = Correction { error: norm(&error), size: norm(&change), acted: Some(acted) };
        Fed { added: Added { now: corrected, at_sample: corrected }, correction: Some(correction) }
    }

    /// As much as the observer believes that the table leaves, at every tick: the needle goes on between two samples, and a
    /// breath turns. What the observer knows is changed where it is: a copy would be a tenth of a microcontroller's stack.
    pub(super) fn observe(
        &self,
        state: &mut State<T, D, N, P>,
        sample: Option<Measurement<D>>,
        setting: &Setting<'_, T, D, P>,
    ) -> Fed<T, D, P> {
        let Setting { time_ns, location, feed_forward, previous, .. } = setting;
        let jacobians = location.jacobian();
        // Whoever placed a paddle beside its path had a reason: so much is left there.
        let before = state.added.map_or(previous - feed_forward, |added| added.at_sample);
        let by_feedback = self.effect(&jacobians, &before);
        let estimate = state
            .estimate
            .get_or_insert_with(|| self.first_estimate(by_feedback.map(|effect| -effect), location.depth, *time_ns));
        let then = sample.and_then(|sample| state.history.at(sample.time_ns));
        let measured = then.and_then(|then| Some((then, self.table.locate(then.depth)?)));
        let mut seen = None;
        if let (Some(sample), Some((then, measured))) = (sample, measured) {
            let error = self.across(&from_components(&sample.values));
            let by_paddles = self.effect(&measured.jacobian(), &(then.paddles - measured.paddle_path()));
            let elapsed = T::of(seconds(sample.time_ns.saturating_sub(estimate.time_ns)));
            for ((observer, error), by_paddles) in estimate.observers.iter_mut().zip(error).zip(by_paddles) {
                observer.update(&self.runtime.belief, error - by_paddles, measured.depth, elapsed);
            }
            estimate.time_ns = sample.time_ns;
            seen = Some(error);
        }

        let acts_ns = time_ns.saturating_add(self.runtime.actuator_delay_ns);
        let ahead = T::of(seconds(acts_ns.saturating_sub(estimate.time_ns)));
        let mut change = by_feedback;
        for (change, observer) in change.iter_mut().zip(&estimate.observers) {
            *change = -(observer.at(location.depth) + observer.ahead(ahead) + *change);
        }
        // Changed along these directions alone: where a paddle was placed across them, it stays.
        let directions = self.runtime.direction.solve(&jacobians, &self.table.orthogonal, &self.runtime.weights);
        let now = before + along(&directions, &change);
        let Some(error) = seen else {
            return Fed { added: Added { now, at_sample: before }, correction: None };
        };
        let correction = Correction { error: norm(&error), size: norm(&change), acted: None };
        Fed { added: Added { now, at_sample: now }, correction: Some(correction) }
    }

    fn first_estimate(&self, levels: [T; N], depth: T, time_ns: u64) -> Estimate<T, N> {
        let surface = T::of(self.runtime.table_depth.0);
        let observers = levels.map(|level| Observer::starting(&self.runtime.belief, level, depth, surface));
        Estimate { observers, time_ns }
    }

    /// What of a displacement of the target is orthogonal to the needle, along each direction: Nᵀy.
    #[inline(always)]
    fn across(&self, target: &SVector<T, D>) -> [T; N] {
        columns(&self.table.orthogonal).map(|direction| SVector::from(direction).dot(target))
    }

    /// What displacements of the paddles, a column each, do to the target orthogonally to the needle: Nᵀ·Σ Jₚ·uₚ.
    #[inline(always)]
    fn effect(&self, jacobians: &[SMatrix<T, D, D>; P], displacements: &SMatrix<T, D, P>) -> [T; N] {
        // A loop, not a fold: compiled for size, that is a call even for a single paddle.
        let mut moved = None;
        for (jacobian, column) in jacobians.iter().zip(columns(displacements)) {
            let term = jacobian * SVector::from(*column);
            moved = Some(moved.map_or(term, |sum: SVector<T, D>| sum + term));
        }
        self.across(&moved.unwrap_or_else(SVector::zeros))
    }
}

/// A change of the target along each direction, as a motion of each paddle: Gₚ·c.
#[inline(always)]
fn along<T: Scalar, const D: usize, const N: usize, const P: usize>(
    directions: &[SMatrix<T, D, N>; P],
    change: &[T; N],
) -> SMatrix<T, D, P> {
    of_columns(directions.each_ref().map(|directions| {
        let mut terms = columns(directions).iter().zip(change).map(|(column, part)| SVector::from(*column) * *part);
        let first = terms.next().unwrap_or_else(SVector::zeros);
        terms.fold(first, |sum, term| sum + term).into()
    }))
}

/// Norm of what is orthogonal to the needle: of a single number without the square root, which is dear.
#[inline(always)]
fn norm<T: Scalar, const N: usize>(components: &[T; N]) -> f64 {
    match components.as_slice() {
        [component] => component.abs().to_f64(),
        _ => SVector::from(*components).norm().to_f64(),
    }
}
