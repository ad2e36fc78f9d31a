//! Timing of the fixed-rate loop, with an empty loop for comparison in the same run.
//!
//! Wake-up tails on a shared machine describe the machine. So an empty loop and the controller's take turns, block by
//! block, and the ratio of their medians says what the controller adds.

use std::path::{Path, PathBuf};

use clap::Args;
use firmware::contract::frames::TARGET_VISIBLE;
use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, Table, TargetSample};
use firmware::schedule::Schedule;
use firmware::{Controller, Inputs, State};
use model_offline::placement::TissueModel;
use model_offline::placement::table::{TableOptions, build};
use model_offline::scene::Scene;
use serde::{Deserialize, Serialize};

use crate::clock::{Scheduling, now_ns, release_real_time, request_real_time, sleep_until};
use crate::control::{LoopArgs, positive};
use crate::error::SimError;
use crate::interrupt;
use crate::plant::Trajectory;
use crate::result::LoopTiming;
use crate::statistics::LoopDurations;

/// Pairs of blocks: enough for a range of ratios.
const PAIRS: u64 = 5;
/// From the set-up to the first release of a block.
const LEAD_NS: u64 = 5_000_000;
/// The paddle of the bundled scene whose table the timed controller uses.
const PADDLE: u32 = 3;

/// Options of `timing`.
#[derive(Args, Clone, Debug)]
pub struct TimingArgs {
    /// Rate of the loop, Hz
    #[arg(long, default_value_t = 1000.0, value_name = "HZ")]
    pub rate: f64,
    /// Duration of the whole measurement, s
    #[arg(long, default_value_t = 10.0, value_name = "S")]
    pub seconds: f64,
    /// Also write the result here, as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Result of `timing`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimingResult {
    /// The loop that does nothing.
    pub empty: LoopTiming,
    /// The loop with the controller's step.
    pub controller: LoopTiming,
    /// Median lateness of the controller's loop over that of the empty loop, pair by pair.
    pub lateness_ratios: Vec<f64>,
    /// Time that the host took away from this machine, all processors, ms; none where the kernel does not say.
    pub steal_ms: Option<u64>,
}

/// Measures and prints.
///
/// # Errors
/// [`SimError`].
pub fn timing(args: &TimingArgs) -> Result<TimingResult, SimError> {
    interrupt::install();
    positive("--rate", args.rate)?;
    positive("--seconds", args.seconds)?;
    let scene = Scene::read(Path::new("paper")).map_err(|error| SimError::Scene(error.into()))?;
    let model = TissueModel::new(&scene)?;
    let table = build(&model, PADDLE, &TableOptions::default())?;
    let loop_args = LoopArgs { rate: args.rate, target_rate: f64::min(50.0, args.rate), latency: 20.0, noise: None };
    let settings = loop_args.settings(scene.needle.depth);
    let controller = Controller::new(&table, &settings)?;
    let mut stimulus = Stimulus::new(&table, &loop_args);

    let ticks = ((args.seconds * args.rate) as u64 / (2 * PAIRS)).max(1);
    let steal_before = steal_ms();
    let scheduling = request_real_time();
    let mut empty = Blocks::new(args.rate, ticks, &scheduling);
    let mut loaded = Blocks::new(args.rate, ticks, &scheduling);
    let mut state = State::new();
    let outcome = (0..PAIRS).try_for_each(|_| {
        empty.block(|| ())?;
        loaded.block(|| stimulus.step(&controller, &mut state))
    });
    release_real_time();
    outcome?;
    let result = TimingResult {
        lateness_ratios: loaded
            .medians_ns
            .iter()
            .zip(&empty.medians_ns)
            .map(|(loaded, empty)| *loaded as f64 / (*empty).max(1) as f64)
            .collect(),
        empty: empty.timing(),
        controller: loaded.timing(),
        steal_ms: steal_ms().zip(steal_before).map(|(now, before)| now.saturating_sub(before)),
    };
    print_result(&result);
    if let Some(path) = &args.json {
        crate::output::write_json(path, &result)?;
    }
    Ok(result)
}

/// Blocks of one kind of loop.
struct Blocks {
    rate_hz: f64,
    ticks: u64,
    scheduling: Scheduling,
    durations: LoopDurations,
    medians_ns: Vec<u64>,
    sum: LoopTiming,
}

impl Blocks {
    fn new(rate_hz: f64, ticks: u64, scheduling: &Scheduling) -> Self {
        Self {
            rate_hz,
            ticks,
            scheduling: scheduling.clone(),
            durations: LoopDurations::default(),
            medians_ns: Vec::with_capacity(PAIRS as usize),
            sum: LoopTiming::default(),
        }
    }

    fn block(&mut self, mut step: impl FnMut()) -> Result<(), SimError> {
        interrupt::check()?;
        let period_ns = (1e9 / self.rate_hz).round() as u64;
        let mut schedule = Schedule::new(now_ns() + LEAD_NS, period_ns);
        let mut own = LoopDurations::default();
        for _ in 0..self.ticks {
            sleep_until(schedule.next_release_ns());
            let start_ns = now_ns();
            let release = schedule.begin(start_ns);
            step();
            let end_ns = now_ns();
            schedule.finish(end_ns);
            own.record(release.release_ns, start_ns, end_ns);
            self.durations.record(release.release_ns, start_ns, end_ns);
        }
        self.medians_ns.push(own.release_lateness.median_ns());
        self.sum.ticks += self.ticks;
        self.sum.deadline_misses += schedule.deadline_misses();
        self.sum.overruns += schedule.overruns();
        self.sum.skipped += schedule.skipped();
        Ok(())
    }

    fn timing(self) -> LoopTiming {
        LoopTiming {
            rate_hz: self.rate_hz,
            scheduling: self.scheduling,
            release_lateness: self.durations.release_lateness.distribution(),
            execution_time: self.durations.execution_time.distribution(),
            response_time: self.durations.response_time.distribution(),
            ..self.sum
        }
    }
}

/// Samples that keep the controller in RUN: an insertion over and over, a paddle that is where it should be.
struct Stimulus {
    trajectory: Trajectory,
    period_ns: u64,
    target_ticks: u64,
    paddle_index: u32,
    command: PaddleCommand,
    tick: u64,
}

impl Stimulus {
    fn new(table: &Table<f64, 2>, loop_args: &LoopArgs) -> Self {
        Self {
            trajectory: Trajectory::new(table.validity.depth_end, 5.0),
            period_ns: loop_args.period_ns(),
            target_ticks: (loop_args.rate / loop_args.target_rate).round().max(1.0) as u64,
            paddle_index: table.paddle.index,
            command: PaddleCommand::default(),
            tick: 0,
        }
    }

    fn step(&mut self, controller: &Controller<'_, f64>, state: &mut State<f64>) {
        let tick = self.tick;
        self.tick += 1;
        let time_ns = tick * self.period_ns;
        let sequence = tick as u32;
        let (depth, velocity) = self.trajectory.at(time_ns as f64 * 1e-9);
        // Alternates by an amount below every gate: a frozen value would be refused.
        let wobble = 1e-6 * if (tick / self.target_ticks).is_multiple_of(2) { 1.0 } else { -1.0 };
        let target = TargetSample {
            sequence: (tick / self.target_ticks) as u32,
            flags: TARGET_VISIBLE,
            time_ns,
            displacement: [wobble, 0.0],
        };
        let inputs = Inputs {
            tick,
            time_ns,
            needle: Some(NeedleSample { sequence, reserved: 0, time_ns, depth, velocity }),
            target: tick.is_multiple_of(self.target_ticks).then_some(target),
            paddle: Some(PaddleSample {
                sequence,
                paddle_index: self.paddle_index,
                time_ns,
                displacement: self.command.displacement,
            }),
        };
        self.command = controller.step(state, std::hint::black_box(&inputs));
        std::hint::black_box(&self.command);
    }
}

/// Steal time of all processors since boot, ms, from `/proc/stat`.
fn steal_ms() -> Option<u64> {
    /// Linux counts in hundredths of a second on every machine that users see.
    const MS_PER_TICK: u64 = 10;
    let text = std::fs::read_to_string("/proc/stat").ok()?;
    let line = text.lines().next()?;
    let steal: u64 = line.split_whitespace().nth(8)?.parse().ok()?;
    Some(steal * MS_PER_TICK)
}

fn print_result(result: &TimingResult) {
    println!("{}", result.controller.scheduling.policy);
    for (name, timing) in [("empty", &result.empty), ("controller", &result.controller)] {
        let lateness = &timing.release_lateness;
        let us = |ns: u64| ns as f64 * 1e-3;
        // The format of cyclictest, which users of real-time Linux know, in µs.
        println!(
            "T: {name:<10} I:{:.0} C:{:>7} Min:{:>6.0} Avg:{:>6.0} Max:{:>7.0}  p50 {:.1} p99 {:.1} p99.9 {:.1} p99.99 {:.1}",
            1e6 / timing.rate_hz,
            timing.ticks,
            us(lateness.min_ns),
            lateness.mean_ns * 1e-3,
            us(lateness.max_ns),
            us(lateness.p50_ns),
            us(lateness.p99_ns),
            us(lateness.p999_ns),
            us(lateness.p9999_ns),
        );
    }
    let step = &result.controller.execution_time;
    println!(
        "controller's step with both clock readings: p50 {} ns, p99.9 {} ns, max {} ns; deadline misses {}, skipped {}",
        step.p50_ns, step.p999_ns, step.max_ns, result.controller.deadline_misses, result.controller.skipped
    );
    let mut ratios = result.lateness_ratios.clone();
    ratios.sort_by(f64::total_cmp);
    if let (Some(least), Some(most)) = (ratios.first(), ratios.last()) {
        println!(
            "median lateness over that of the empty loop: {:.2} (from {least:.2} to {most:.2} over {} pairs of blocks)",
            ratios[ratios.len() / 2],
            ratios.len()
        );
    }
    if let Some(steal) = result.steal_ms {
        println!("time taken away by the host: {steal} ms");
    }
}
