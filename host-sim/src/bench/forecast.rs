//! When something will have ended, as far as its finished parts tell.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::progress::Progress;

/// What beginning and ending the two processes of a free-run take beside its duration, s.
const AROUND_FREE_RUN_S: f64 = 1.2;

/// A part of a comparison; parts follow each other.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Part {
    /// What it takes, over what any one of the parts takes.
    work: f64,
    /// What it takes on the machine's clock, s.
    clock_s: f64,
}

impl Part {
    /// What takes as long as the machine needs.
    pub(super) fn work(work: f64) -> Self {
        Self { work, clock_s: 0.0 }
    }

    /// What takes so long, s, whatever the rest of the parts take.
    pub(super) fn on_the_clock(clock_s: f64) -> Self {
        Self { work: 0.0, clock_s }
    }

    /// An insertion in free-run that takes so long, s.
    pub(super) fn free_run(duration_s: f64) -> Self {
        Self::on_the_clock(duration_s + AROUND_FREE_RUN_S)
    }
}

/// The parts of a comparison in their order, and how fast they go.
#[derive(Debug, Default)]
pub(super) struct Forecast {
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    parts: Vec<Part>,
    /// How many parts have begun, and when the last of them did.
    begun: usize,
    since: Option<Instant>,
    /// Seconds per unit of work, as of the last part that had any.
    pace_s: Option<f64>,
    /// What the last part on the machine's clock took beside it, s.
    beside_clock_s: f64,
}

impl Forecast {
    /// Without parts nothing is foretold.
    pub(super) fn of(parts: Vec<Part>) -> Self {
        Self { state: Mutex::new(State { parts, ..State::default() }) }
    }

    /// What is known by now to come behind the parts that have begun.
    pub(super) fn foresee(&self, rest: Vec<Part>) {
        let mut state = self.lock();
        let begun = state.begun;
        state.parts.truncate(begun);
        state.parts.extend(rest);
    }

    /// The next of the parts begins, and whoever follows the progress is told.
    pub(super) fn begins(&self, what: &str, progress: &dyn Progress) {
        progress.say(what);
        if let Some([this_s, then_s]) = self.next(Instant::now()) {
            progress.expect(this_s, then_s);
        }
    }

    /// The next of the parts begins, each of which is a step of the progress.
    pub(super) fn steps_on(&self, what: &str, progress: &dyn Progress) {
        if self.lock().begun > 0 {
            progress.step();
        }
        progress.begin(self.lock().parts.len() as u64);
        self.begins(what, progress);
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What nobody foresaw is to be done next, and takes so long, s.
    pub(super) fn interpose(&self, takes_s: f64) {
        let mut state = self.lock();
        let part = match state.pace_s {
            Some(pace_s) if pace_s > 0.0 => Part::work(takes_s / pace_s),
            _ => Part { work: 0.0, clock_s: takes_s },
        };
        let next = state.begun;
        if next > 0 && next <= state.parts.len() {
            state.parts.insert(next, part);
        }
    }

    /// The next part begins now, and the one before has ended: what this part and all behind it will take, s; none where no
    /// part has told yet how fast it goes.
    fn next(&self, now: Instant) -> Option<[f64; 2]> {
        let mut state = self.lock();
        let before = state.begun.checked_sub(1).and_then(|last| state.parts.get(last).copied());
        if let (Some(part), Some(since)) = (before, state.since) {
            let took_s = (now - since).as_secs_f64();
            if part.work > 0.0 {
                state.pace_s = Some(took_s / part.work);
            } else {
                state.beside_clock_s = (took_s - part.clock_s).max(0.0);
            }
        }
        state.since = Some(now);
        state.begun += 1;
        let takes = |part: &Part| match state.pace_s {
            _ if part.work == 0.0 => Some(part.clock_s + state.beside_clock_s),
            pace_s => pace_s.map(|pace_s| pace_s * part.work + part.clock_s),
        };
        let this = takes(state.parts.get(state.begun - 1)?)?;
        let behind: Option<f64> = state.parts[state.begun..].iter().map(takes).sum();
        Some([this, behind?])
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn what_is_left_follows_from_the_last_part() {
        let free_run = Part { work: 0.0, clock_s: 7.0 };
        let forecast = Forecast::of(vec![Part::work(1.0), Part::work(2.0), free_run, free_run, Part::work(4.0)]);
        let start = Instant::now();
        let at = |seconds: u64| start + Duration::from_secs(seconds);
        assert_eq!(forecast.next(at(0)), None, "nobody knows how fast it goes");
        assert_eq!(forecast.next(at(3)), Some([6.0, 7.0 + 7.0 + 12.0]));
        // Slower than thought: 5 s per unit from now on.
        assert_eq!(forecast.next(at(13)), Some([7.0, 7.0 + 20.0]));
        // What is on the clock took a second longer than that, and says nothing of the rest.
        assert_eq!(forecast.next(at(21)), Some([8.0, 20.0]));
        assert_eq!(forecast.next(at(29)), Some([20.0, 0.0]));
        assert_eq!(forecast.next(at(49)), None, "there is none any more");
    }

    #[test]
    fn what_nobody_foresaw_is_done_before_the_rest() {
        let free_run = Part { work: 0.0, clock_s: 7.0 };
        let forecast = Forecast::of(vec![Part::work(1.0), Part::work(2.0), free_run]);
        let start = Instant::now();
        let at = |seconds: u64| start + Duration::from_secs(seconds);
        assert_eq!(forecast.next(at(0)), None);
        assert_eq!(forecast.next(at(3)), Some([6.0, 7.0]));
        forecast.interpose(30.0);
        let [this, then] = forecast.next(at(9)).unwrap();
        assert!((this - 30.0).abs() < 1e-12 && then == 7.0, "{this} {then}");
        // How long it took says nothing of what is on the clock.
        assert_eq!(forecast.next(at(29)), Some([7.0, 0.0]));
        // At the end, too; where nothing was foretold, nothing is.
        forecast.interpose(5.0);
        assert!(forecast.next(at(36)).is_some_and(|[this, then]| (this - 5.0).abs() < 1e-12 && then == 0.0));
        let nothing = Forecast::default();
        nothing.interpose(5.0);
        assert_eq!(nothing.next(at(40)), None);
        nothing.interpose(5.0);
        assert_eq!(nothing.next(at(41)), None);
    }

    #[test]
    fn where_only_the_clock_counts_all_is_known() {
        let free_run = Part { work: 0.0, clock_s: 7.0 };
        assert_eq!(Forecast::of(vec![free_run, free_run]).next(Instant::now()), Some([7.0, 7.0]));
        assert_eq!(Forecast::default().next(Instant::now()), None);
    }
}
