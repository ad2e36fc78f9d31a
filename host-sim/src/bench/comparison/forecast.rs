//! When a comparison will have ended, as far as its finished parts tell.

use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use super::Comparison;
use crate::runtime::executor::Hardware;
use crate::runtime::time::mode::RunMode;
use model_offline::scene::TissueVariant;

/// A part of a comparison; parts follow each other.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Part {
    /// What it takes, over what the table of the same scene takes.
    work: f64,
    /// What it takes on the machine's clock, s.
    clock_s: f64,
}

/// Work of the jobs of a comparison, on one thread: medians of scenes of 100 to 2,700 nodes, from which single ones differ by
/// a factor of up to two.
struct Jobs {
    study: f64,
    table: f64,
    uncontrolled: f64,
    controlled: f64,
}

/// Of tissue that answers to where needle and paddle are.
const ELASTIC: Jobs = Jobs { study: 0.2, table: 1.0, uncontrolled: 0.6, controlled: 0.87 };

/// Of tissue and needles that have a past: they are solved for at more moments.
const WITH_A_PAST: Jobs = Jobs { study: 0.2, table: 1.0, uncontrolled: 1.4, controlled: 3.2 };

/// What beginning and ending the two processes of a free-run take beside its duration, s.
const AROUND_FREE_RUN_S: f64 = 1.2;

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

    /// What nobody foresaw is to be done next, and takes so long, s.
    pub(super) fn interpose(&self, takes_s: f64) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let part = match state.pace_s {
            Some(pace_s) if pace_s > 0.0 => Part { work: takes_s / pace_s, clock_s: 0.0 },
            _ => Part { work: 0.0, clock_s: takes_s },
        };
        let next = state.begun;
        if next > 0 && next <= state.parts.len() {
            state.parts.insert(next, part);
        }
    }

    /// The next part begins now, and the one before has ended: what this part and all behind it will take, s; none where no
    /// part has told yet how fast it goes.
    pub(super) fn next(&self, now: Instant) -> Option<[f64; 2]> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
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

impl Comparison<'_> {
    /// What the comparison consists of, in the order in which it is done; nothing where that says too little of how long it
    /// takes.
    pub(super) fn parts(&self) -> Vec<Part> {
        let options = &self.options;
        if options.hardware == Hardware::Qemu || options.causes {
            return Vec::new();
        }
        let has_a_past = TissueVariant::ALL.iter().any(|tissue| tissue.of(&self.scene).has_a_past());
        let jobs = if has_a_past { WITH_A_PAST } else { ELASTIC };
        let tissues = self.tissues();
        let tables = tissues.iter().filter(|tissue| self.needs_table(**tissue)).count();
        let uncontrolled = self.cases.iter().map(|case| if case.is_mismatch { 1 } else { 2 }).sum();
        let in_parallel = |count: usize, work: f64| {
            let rounds = (count as f64 / options.threads as f64).max(1.0);
            Part { work: work * rounds, clock_s: 0.0 }
        };
        let mut parts: Vec<Part> = tissues.iter().map(|_| in_parallel(1, jobs.study)).collect();
        parts.extend((tables > 0).then(|| in_parallel(tables, jobs.table)));
        parts.push(in_parallel(uncontrolled, jobs.uncontrolled));
        if options.mode != Some(RunMode::FreeRun) {
            parts.push(in_parallel(self.cases.len(), jobs.controlled));
        }
        let clock_s = self.simulation.duration_s + AROUND_FREE_RUN_S;
        parts.extend(self.cases.iter().filter(|case| self.is_in_free_run(case)).map(|_| Part { work: 0.0, clock_s }));
        parts
    }

    /// Something that nobody foresaw begins: of so many steps, and of so many seconds.
    pub(super) fn begins_in_addition(&self, what: &str, steps: u64, takes_s: f64) {
        self.progress.extend(steps);
        self.forecast.interpose(takes_s);
        self.begins(what);
    }

    /// The next of the parts begins.
    pub(super) fn begins(&self, what: &str) {
        self.progress.say(what);
        if let Some([this_s, then_s]) = self.forecast.next(Instant::now()) {
            self.progress.expect(this_s, then_s);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn work(work: f64) -> Part {
        Part { work, clock_s: 0.0 }
    }

    #[test]
    fn what_is_left_follows_from_the_last_part() {
        let free_run = Part { work: 0.0, clock_s: 7.0 };
        let forecast = Forecast::of(vec![work(1.0), work(2.0), free_run, free_run, work(4.0)]);
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
        let forecast = Forecast::of(vec![work(1.0), work(2.0), free_run]);
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
