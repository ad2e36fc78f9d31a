//! What passes between the loop and the view.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use model_offline::model::TissueModel;
use serde::{Deserialize, Serialize};

use crate::record::recording::RunMode;
use crate::runtime::clock::now_ns;
use crate::runtime::signals;
use crate::world::tissue::TissueSolver;

/// Time between two pictures: 30 a second.
pub(super) const FRAME_NS: u64 = 33_333_333;
/// How long a paused loop sleeps between two looks.
const PAUSE: Duration = Duration::from_millis(5);

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
    /// What is wrong with the numbers, if anything is.
    ///
    /// # Errors
    /// One line that names the knob.
    pub fn check(&self) -> Result<(), String> {
        let ranges = [
            ("needle_speed", self.needle_speed, 0.1, 10.0),
            ("target_rate", self.target_rate, 1.0, 1000.0),
            ("latency", self.latency, 0.0, 500.0),
            ("noise", self.noise, 0.0, 1000.0),
            ("stiffness", self.stiffness, 1e-3, 1e3),
        ];
        match ranges.iter().find(|(_, value, low, high)| !(*low..=*high).contains(value)) {
            Some((name, value, low, high)) => Err(format!("{name} is {value}; it must be from {low} to {high}")),
            None => Ok(()),
        }
    }
}

/// The newest state that the loop has left.
#[derive(Clone, Debug, Default)]
pub(super) struct Snapshot {
    /// Counts snapshots; 0: none yet.
    pub(super) number: u64,
    /// Counts insertions: a new one has new geometry.
    pub(super) insertion: u64,
    pub(super) title: String,
    pub(super) mode: Option<RunMode>,
    pub(super) model: Option<Arc<TissueModel>>,
    pub(super) paddle_index: u32,
    pub(super) coefficients: Vec<f64>,
    pub(super) time_s: f64,
    pub(super) tick: u64,
    pub(super) depth: f64,
    pub(super) target: [f64; 2],
    pub(super) paddle: [f64; 2],
    /// Longest solve since the snapshot before, ns.
    pub(super) solve_ns: u64,
    /// Latest start of a tick after its release since the snapshot before, ns; free-run only.
    pub(super) late_ns: u64,
}

/// Everything that the loop and the view's threads share.
#[derive(Debug)]
pub struct Shared {
    snapshot: Mutex<Snapshot>,
    knobs: Mutex<Knobs>,
    paused: AtomicBool,
    steps: AtomicU64,
    /// Simulated per real time, in thousandths; 0: as fast as it goes.
    pace: AtomicU64,
    restart: AtomicBool,
    finish: AtomicBool,
    /// Restarts are for the view's own insertions, not for the comparison of strategies.
    may_restart: AtomicBool,
    /// Snapshots that were not left because a view thread held the last one.
    missed: AtomicU64,
}

/// A poisoned lock holds data that is still whole: every write to it is a plain copy.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    pub(super) fn new(knobs: Knobs) -> Self {
        Self {
            snapshot: Mutex::default(),
            knobs: Mutex::new(knobs),
            paused: AtomicBool::new(false),
            steps: AtomicU64::new(0),
            pace: AtomicU64::new(1000),
            restart: AtomicBool::new(false),
            finish: AtomicBool::new(false),
            may_restart: AtomicBool::new(false),
            missed: AtomicU64::new(0),
        }
    }

    /// The knobs as they are now.
    pub fn knobs(&self) -> Knobs {
        *lock(&self.knobs)
    }

    pub(super) fn turn(&self, knobs: Knobs) {
        *lock(&self.knobs) = knobs;
        self.restart.store(true, Ordering::Release);
    }

    pub(super) fn set_paused(&self, paused: bool) {
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
    pub fn is_finished(&self) -> bool {
        self.finish.load(Ordering::Acquire)
    }

    /// From here on the page may end insertions early.
    pub(super) fn allow_restarts(&self) {
        self.may_restart.store(true, Ordering::Release);
    }

    /// Knobs only take effect at the start of an insertion: what they asked for is being done.
    pub(super) fn started(&self) {
        self.restart.store(false, Ordering::Release);
    }

    /// Whether the present insertion is to end early.
    fn ends_early(&self) -> bool {
        self.may_restart.load(Ordering::Acquire)
            && (self.restart.load(Ordering::Acquire) || self.finish.load(Ordering::Acquire))
    }

    /// Snapshots that the loop did not leave because somebody was reading.
    pub fn missed(&self) -> u64 {
        self.missed.load(Ordering::Relaxed)
    }

    /// The newest snapshot, if there is one after `number` or of another insertion.
    pub(super) fn newer(&self, insertion: u64, number: u64) -> Option<Snapshot> {
        let snapshot = lock(&self.snapshot);
        let is_new = snapshot.number > number || snapshot.insertion != insertion;
        (snapshot.number > 0 && is_new).then(|| snapshot.clone())
    }

    /// Holds time between two ticks of lockstep: while paused, and to keep pace with the clock on the wall.
    pub fn hold(&self, pacing: &mut Pacing) {
        while self.is_paused() && !self.ends_early() && signals::check().is_ok() {
            let step = self.steps.fetch_update(Ordering::AcqRel, Ordering::Acquire, |left| left.checked_sub(1));
            pacing.restart();
            if step.is_ok() {
                return;
            }
            std::thread::sleep(PAUSE);
        }
        pacing.keep(self.pace());
    }
}

/// Keeps lockstep from running ahead of the clock on the wall.
#[derive(Debug)]
pub struct Pacing {
    period_ns: u64,
    next_ns: u64,
}

impl Pacing {
    /// For ticks of this period, ns.
    pub fn new(period_ns: u64) -> Self {
        Self { period_ns, next_ns: now_ns() }
    }

    fn restart(&mut self) {
        self.next_ns = now_ns();
    }

    fn keep(&mut self, thousandths: u64) {
        if thousandths == 0 {
            return;
        }
        self.next_ns += self.period_ns * 1000 / thousandths;
        let now = now_ns();
        if self.next_ns > now {
            crate::runtime::clock::sleep_until(self.next_ns);
        } else if now - self.next_ns > 200_000_000 {
            // Too slow for this pace: what is lost stays lost.
            self.next_ns = now;
        }
    }
}

/// The loop's end of the hand-over.
#[derive(Debug)]
pub struct Watch {
    shared: Arc<Shared>,
    mode: RunMode,
    due_ns: u64,
    solve_ns: u64,
    late_ns: u64,
}

/// A moment of the simulation, as the loop knows it.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Tick of the plant.
    pub tick: u64,
    /// Time of the tick, ns.
    pub time_ns: u64,
    /// Time since the start of the needle, s.
    pub time_s: f64,
    /// Needle depth, length.
    pub depth: f64,
    /// Target displacement, length.
    pub target: [f64; 2],
    /// Paddle displacement, length.
    pub paddle: [f64; 2],
    /// When the tick began to be solved, ns of the steady clock.
    pub began_ns: u64,
}

impl Watch {
    /// Begins an insertion.
    pub fn new(shared: &Arc<Shared>, model: &TissueModel, paddle: u32, mode: RunMode, title: String) -> Self {
        {
            let mut snapshot = lock(&shared.snapshot);
            *snapshot = Snapshot {
                insertion: snapshot.insertion + 1,
                number: snapshot.number,
                title,
                mode: Some(mode),
                model: Some(Arc::new(model.clone())),
                paddle_index: paddle,
                coefficients: vec![0.0; model.dofs()],
                ..Snapshot::default()
            };
        }
        Self { shared: Arc::clone(shared), mode, due_ns: 0, solve_ns: 0, late_ns: 0 }
    }

    /// Whether the page wants the insertion to end now.
    pub fn ends_early(&self) -> bool {
        self.shared.ends_early()
    }

    /// Leaves a picture if one is due and nobody reads the last one. Never waits.
    pub fn offer(&mut self, tissue: &TissueSolver<'_>, moment: &Moment) {
        let now = now_ns();
        self.solve_ns = self.solve_ns.max(now.saturating_sub(moment.began_ns));
        if self.mode == RunMode::FreeRun {
            self.late_ns = self.late_ns.max(moment.began_ns.saturating_sub(moment.time_ns));
        }
        // A paused simulation shows every single step.
        if now < self.due_ns && !self.shared.is_paused() {
            return;
        }
        let Ok(mut snapshot) = self.shared.snapshot.try_lock() else {
            self.shared.missed.fetch_add(1, Ordering::Relaxed);
            return;
        };
        self.due_ns = now + FRAME_NS;
        tissue.copy_coefficients(&mut snapshot.coefficients);
        snapshot.number += 1;
        snapshot.time_s = moment.time_s;
        snapshot.tick = moment.tick;
        snapshot.depth = moment.depth;
        snapshot.target = moment.target;
        snapshot.paddle = moment.paddle;
        snapshot.solve_ns = std::mem::take(&mut self.solve_ns);
        snapshot.late_ns = std::mem::take(&mut self.late_ns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::tissue::PlantChoice;
    use model_offline::scene::Scene;

    const KNOBS: Knobs = Knobs { needle_speed: 1.0, target_rate: 50.0, latency: 20.0, noise: 1.0, stiffness: 1.0 };

    #[test]
    fn the_loop_never_waits_for_a_reader() {
        let model = TissueModel::new(&Scene::bundled("paper").unwrap()).unwrap();
        let tissue = TissueSolver::new(&model, None, PlantChoice::Full).unwrap();
        let shared = Arc::new(Shared::new(KNOBS));
        let mut watch = Watch::new(&shared, &model, 0, RunMode::Lockstep, String::new());
        let moment =
            Moment { tick: 1, time_ns: 0, time_s: 0.0, depth: 0.0, target: [0.0; 2], paddle: [0.0; 2], began_ns: 0 };
        let reader = lock(&shared.snapshot);
        watch.offer(&tissue, &moment);
        assert_eq!((reader.number, shared.missed()), (0, 1));
        drop(reader);
        watch.offer(&tissue, &moment);
        let snapshot = shared.newer(0, 0).unwrap();
        assert_eq!((snapshot.number, snapshot.tick, snapshot.coefficients.len()), (1, 1, model.dofs()));
        assert!(shared.newer(snapshot.insertion, snapshot.number).is_none());
    }

    #[test]
    fn knobs_out_of_range_are_refused_by_name() {
        assert!(KNOBS.check().is_ok());
        assert!(Knobs { latency: -1.0, ..KNOBS }.check().unwrap_err().starts_with("latency"));
        assert!(Knobs { noise: f64::NAN, ..KNOBS }.check().is_err());
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
