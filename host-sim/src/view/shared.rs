//! What the loop and the view share.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use hyper::body::Bytes;
use serde::{Deserialize, Serialize};

use super::body::ShownBody;
use crate::record::export::messages::Said;
use crate::runtime::accounting::tick::ControllerTick;
use crate::runtime::plant::observer::Answer;
use crate::runtime::time::mode::RunMode;
use crate::world::truth::{NeedleMoment, Truth};

/// One file: no network but the events of its own address.
pub(super) const PAGE: &str = include_str!("page.html");

/// Time between two pictures: 30 a second.
pub(super) const FRAME_NS: u64 = 33_333_333;

/// What the page lets its reader turn. Takes effect with the next insertion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Knobs {
    /// Speed of the needle, times that of the command line.
    pub needle_speed: f64,
    /// Rate of the target sensor, Hz.
    pub target_rate: f64,
    /// Latency of the target sensor, ms.
    pub latency: f64,
    /// Noise of the target sensor, times that of the command line.
    pub noise: f64,
    /// Stiffness of the inclusions, times that of the scene; the controller's table does not know of it.
    pub stiffness: f64,
}

impl Knobs {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`KnobOutOfRange`] names the knob.
    pub fn check(&self) -> Result<(), KnobOutOfRange> {
        let ranges = [
            ("needle_speed", self.needle_speed, 0.1, 10.0),
            ("target_rate", self.target_rate, 1.0, 1000.0),
            ("latency", self.latency, 0.0, 500.0),
            ("noise", self.noise, 0.0, 1000.0),
            ("stiffness", self.stiffness, 1e-3, 1e3),
        ];
        match ranges.iter().find(|(_, value, low, high)| !(*low..=*high).contains(value)) {
            Some(&(knob, value, low, high)) => Err(KnobOutOfRange { knob, value, low, high }),
            None => Ok(()),
        }
    }
}

/// A knob cannot be turned that far.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{knob} is {value}; it must be from {low} to {high}")]
pub struct KnobOutOfRange {
    /// Its name.
    pub knob: &'static str,
    /// What was asked for.
    pub value: f64,
    /// Least value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
}

/// The newest state that the loop has left.
#[derive(Clone, Debug, Default)]
pub(super) struct ViewState {
    /// Counts states; 0: none yet.
    pub(super) number: u64,
    /// Counts insertions: a new one has new geometry.
    pub(super) insertion: u64,
    pub(super) title: String,
    /// Whether time stands still at this tick.
    pub(super) held: bool,
    /// Whether it is one of the view's own, under its knobs, and no part of the comparison of strategies.
    pub(super) live: bool,
    pub(super) mode: Option<RunMode>,
    pub(super) body: Option<ShownBody>,
    /// Of the plane; in space what is true tells the body.
    pub(super) coefficients: Vec<f64>,
    pub(super) time_s: f64,
    pub(super) truth: Truth,
    /// Target displacement orthogonal to the needle, length: with a sign in the plane.
    pub(super) error: f64,
    pub(super) answer: Option<Answer>,
    /// Samples and the command of the last tick that was answered.
    pub(super) exchanged: Option<ControllerTick>,
    /// What a needle that slips met last.
    pub(super) needle: Option<NeedleMoment>,
    /// What the controller said of itself, with the time, ns: the newest [`CHANGES`] changes.
    pub(super) changes: VecDeque<(u64, Said)>,
    /// Largest orthogonal error of every tick since the needle moves, length: a page that comes late knows it, too.
    pub(super) largest: f64,
    /// What a page that comes late has missed.
    pub(super) history: History,
    /// Longest solve since the state before, ns.
    pub(super) solve_ns: u64,
    /// Latest start of a tick after its release since the state before, ns; free-run only.
    pub(super) late_ns: u64,
}

/// Changes of the controller's mode or faults that are kept.
pub(super) const CHANGES: usize = 64;

/// States of the present insertion as [time in s, orthogonal error, longest solve in µs, lateness in µs], and the target's
/// way: evenly thinned out where they become many.
#[derive(Clone, Debug)]
pub(super) struct History {
    pub(super) rows: Vec<[f64; 4]>,
    pub(super) trail: Vec<[f64; 3]>,
    stride: u64,
    seen: u64,
}

/// Rows of a history before it is thinned out to half of them.
const HISTORY: usize = 1024;

impl Default for History {
    fn default() -> Self {
        Self { rows: Vec::with_capacity(HISTORY), trail: Vec::with_capacity(HISTORY), stride: 1, seen: 0 }
    }
}

impl History {
    /// Adds a state. Allocates nothing.
    pub(super) fn push(&mut self, row: [f64; 4], target: [f64; 3]) {
        if self.seen.is_multiple_of(self.stride) {
            if self.rows.len() == HISTORY {
                self.stride *= 2;
                let mut at = 0..;
                self.rows.retain(|_| at.next().is_some_and(|i: u32| i.is_multiple_of(2)));
                let mut at = 0..;
                self.trail.retain(|_| at.next().is_some_and(|i: u32| i.is_multiple_of(2)));
            }
            if self.seen.is_multiple_of(self.stride) {
                self.rows.push(row);
                self.trail.push(target);
            }
        }
        self.seen += 1;
    }
}

/// Everything that the loop and the view's threads share.
#[derive(Debug)]
pub(super) struct Shared {
    /// The page's own text.
    page: Bytes,
    state: Mutex<ViewState>,
    knobs: Mutex<Knobs>,
    paused: AtomicBool,
    steps: AtomicU64,
    /// Simulated per real time, in thousandths; 0: as fast as it goes.
    pace: AtomicU64,
    restart: AtomicBool,
    finish: AtomicBool,
    /// The program ends: nothing new will come.
    over: AtomicBool,
    /// Restarts are for the view's own insertions, not for the comparison of strategies.
    may_restart: AtomicBool,
    /// States that were dropped because a view thread held the last one.
    dropped: AtomicU64,
}

/// A poisoned lock holds data that is still whole: every write to it is a plain copy.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    /// Of the plane.
    pub(super) fn new(knobs: Knobs) -> Self {
        Self::showing(knobs, Bytes::from_static(PAGE.as_bytes()))
    }

    /// With another page.
    pub(super) fn showing(knobs: Knobs, page: Bytes) -> Self {
        Self {
            page,
            state: Mutex::default(),
            knobs: Mutex::new(knobs),
            paused: AtomicBool::new(false),
            steps: AtomicU64::new(0),
            pace: AtomicU64::new(1000),
            restart: AtomicBool::new(false),
            finish: AtomicBool::new(false),
            over: AtomicBool::new(false),
            may_restart: AtomicBool::new(false),
            dropped: AtomicU64::new(0),
        }
    }

    /// The page's own text.
    pub(super) fn page(&self) -> Bytes {
        self.page.clone()
    }

    /// The knobs as they are now.
    pub(super) fn knobs(&self) -> Knobs {
        *lock(&self.knobs)
    }

    pub(super) fn turn(&self, knobs: Knobs) {
        *lock(&self.knobs) = knobs;
        self.restart.store(true, Ordering::Release);
    }

    /// Steps that are still waiting are no longer wanted once time goes on.
    pub(super) fn set_paused(&self, paused: bool) {
        if !paused {
            self.steps.store(0, Ordering::Release);
        }
        self.paused.store(paused, Ordering::Release);
    }

    pub(super) fn is_paused(&self) -> bool {
        self.paused.load(Ordering::Acquire)
    }

    pub(super) fn step(&self, ticks: u64) {
        self.set_paused(true);
        self.steps.fetch_add(ticks, Ordering::AcqRel);
    }

    pub(super) fn set_pace(&self, thousandths: u64) {
        self.pace.store(thousandths, Ordering::Release);
    }

    pub(super) fn pace(&self) -> u64 {
        self.pace.load(Ordering::Acquire)
    }

    pub(super) fn finish(&self) {
        self.finish.store(true, Ordering::Release);
        self.set_paused(false);
    }

    pub(super) fn restart(&self) {
        self.restart.store(true, Ordering::Release);
        self.set_paused(false);
    }

    /// Whether the page has asked for the end of the view.
    pub(super) fn is_finished(&self) -> bool {
        self.finish.load(Ordering::Acquire)
    }

    /// Nothing new will come.
    pub(super) fn end(&self) {
        self.over.store(true, Ordering::Release);
    }

    /// Whether nothing new will come.
    pub(super) fn is_over(&self) -> bool {
        self.over.load(Ordering::Acquire)
    }

    /// From here on the page may end insertions early.
    pub(super) fn allow_restarts(&self) {
        self.may_restart.store(true, Ordering::Release);
    }

    /// Whether insertions are the view's own.
    pub(super) fn restarts_are_allowed(&self) -> bool {
        self.may_restart.load(Ordering::Acquire)
    }

    /// Knobs only take effect at the start of an insertion: what they asked for is being done.
    pub(super) fn started(&self) {
        self.restart.store(false, Ordering::Release);
    }

    /// Whether the present insertion is to end early.
    pub(super) fn ends_early(&self) -> bool {
        self.restarts_are_allowed() && (self.restart.load(Ordering::Acquire) || self.finish.load(Ordering::Acquire))
    }

    /// States that were dropped because somebody was reading.
    pub(super) fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// The newest state, if there is one after `number` or of another insertion.
    pub(super) fn newer(&self, insertion: u64, number: u64) -> Option<ViewState> {
        let state = lock(&self.state);
        let is_new = state.number > number || state.insertion != insertion;
        (state.number > 0 && is_new).then(|| state.clone())
    }

    /// Takes one of the single steps that were asked for; whether there was one.
    pub(super) fn take_step(&self) -> bool {
        self.steps.fetch_update(Ordering::AcqRel, Ordering::Acquire, |left| left.checked_sub(1)).is_ok()
    }

    /// The state, to be replaced at the start of an insertion; waits for a reader.
    pub(super) fn state(&self) -> MutexGuard<'_, ViewState> {
        lock(&self.state)
    }

    /// The state, to be renewed; none, and counted, while somebody reads it.
    pub(super) fn try_state(&self) -> Option<MutexGuard<'_, ViewState>> {
        let state = self.state.try_lock().ok();
        if state.is_none() {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
        state
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOBS: Knobs = Knobs { needle_speed: 1.0, target_rate: 50.0, latency: 20.0, noise: 1.0, stiffness: 1.0 };

    #[test]
    fn knobs_out_of_range_are_refused_by_name() {
        assert!(KNOBS.check().is_ok());
        assert!(Knobs { latency: -1.0, ..KNOBS }.check().unwrap_err().to_string().starts_with("latency"));
        assert!(Knobs { noise: f64::NAN, ..KNOBS }.check().is_err());
    }

    /// However long an insertion, its history is even, begins at its beginning, and takes no more room.
    #[test]
    fn a_long_history_is_thinned_out_evenly() {
        let mut history = History::default();
        let room = history.rows.capacity();
        for i in 0..100_000_u32 {
            history.push([f64::from(i), 0.0, 0.0, 0.0], [f64::from(i), 0.0, 0.0]);
            assert!(history.rows.len() == history.trail.len() && history.rows.capacity() == room);
        }
        let gaps: Vec<f64> = history.rows.windows(2).map(|pair| pair[1][0] - pair[0][0]).collect();
        assert!(history.rows[0][0] == 0.0 && gaps.iter().all(|gap| *gap == gaps[0]), "{gaps:?}");
        assert!(history.rows.len() > HISTORY / 2 - 1 && history.rows.last().unwrap()[0] > 99_000.0);
        assert!(history.rows.iter().zip(&history.trail).all(|(row, target)| row[0] == target[0]));
    }

    #[test]
    fn restarts_wait_until_they_are_allowed() {
        let shared = Shared::new(KNOBS);
        shared.turn(Knobs { noise: 2.0, ..KNOBS });
        assert!(!shared.ends_early());
        shared.allow_restarts();
        assert!(shared.ends_early());
        shared.started();
        assert!(!shared.ends_early() && shared.knobs().noise == 2.0);
    }
}
