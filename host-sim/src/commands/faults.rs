//! `host-sim faults`.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use firmware::Mode;
use host_sim::SimError;
use host_sim::bench::faults::evidence::RowVerdict;
use host_sim::bench::faults::monitors::MonitorOff;
use host_sim::bench::faults::random::Composed;
use host_sim::bench::faults::report::{CatalogueMode, FaultsResult, RowResult};
use host_sim::bench::faults::session::{Session, row_count, session};
use host_sim::bench::usage::UsageError;
use host_sim::record::error::FileError;
use host_sim::record::files::{write_bytes, write_json};
use host_sim::report::faults_chart;
use host_sim::runtime::signals;
use host_sim::world::error::OptionRange;

use model_offline::output::check_outputs;
use model_offline::say;

/// Options of `faults`.
#[derive(Args, Clone, Debug)]
pub(crate) struct FaultsArgs {
    /// 2: one paddle in the plane; 3: two paddles on a small body in space, and rows 46 to 51 of their own
    #[arg(long, default_value_t = 2, value_name = "D", value_parser = clap::value_parser!(u32).range(2..=3))]
    pub(crate) dimension: u32,
    /// Only these rows [default: all]
    #[arg(long, value_name = "N,...", value_delimiter = ',')]
    pub(crate) only: Vec<u32>,
    /// Seed of phases, noise and schedules
    #[arg(long, default_value_t = 1, value_name = "S")]
    pub(crate) seed: u64,
    /// Random schedules of several faults at once [default: 1000, none with --only]
    #[arg(long, value_name = "N")]
    pub(crate) seeds: Option<u64>,
    /// Part of the repetitions of rows 33, 35, 36 and 37 (200 kills, 100 kills, 100 cycles, 200 visits)
    #[arg(long, default_value_t = 1.0, value_name = "PART")]
    pub(crate) effort: f64,
    /// Instead, switch off one monitor of the controller after the other, and show which rows in lockstep notice
    #[arg(long, conflicts_with_all = ["only", "seeds", "effort", "out"])]
    pub(crate) monitors_off: bool,
    /// Write faults.csv, faults.json and faults.svg into this directory
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Also write the result here, as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
}

/// Part of the repetitions; ten times as many is already an hour.
const EFFORT: OptionRange = OptionRange::new("--effort", 0.0, 10.0, "");

/// What `--out` gets.
const FILES: [&str; 3] = ["faults.csv", "faults.json", "faults.svg"];

/// Random schedules without `--seeds`.
const DEFAULT_SEEDS: u64 = 1000;

/// Tries what was asked for and prints it row by row.
///
/// # Errors
/// [`SimError::Faults`] when something does not hold; everything is written nevertheless.
pub(crate) fn faults(args: &FaultsArgs) -> Result<(), SimError> {
    signals::install();
    EFFORT.check(args.effort)?;
    let last = row_count(args.dimension);
    let asked: Vec<u32> = if args.only.is_empty() { (1..=last).collect() } else { args.only.clone() };
    if let Some(&row) = asked.iter().find(|id| !(1..=last).contains(id)) {
        return Err(UsageError::NoRow { row, last }.into());
    }
    if let Some(directory) = &args.out {
        FileError::make_folder(directory)?;
    }
    let files = FILES.map(|name| args.out.as_ref().map(|directory| directory.join(name)));
    let [csv, own, svg] = files.each_ref().map(Option::as_deref);
    check_outputs(&[], &[("--out", csv), ("--out", own), ("--out", svg), ("--json", args.json.as_deref())])?;
    let session = signals::ends_at_once(|| session(args.dimension, args.seed))?;
    if args.monitors_off { without_monitors(args, session.as_ref()) } else { tried(args, &asked, session.as_ref()) }
}

/// The rows that were asked for, in the order of the catalogue, then random schedules.
fn tried(args: &FaultsArgs, asked: &[u32], session: &dyn Session) -> Result<(), SimError> {
    let mut result =
        FaultsResult { version: env!("CARGO_PKG_VERSION").to_owned(), seed: args.seed, ..FaultsResult::default() };
    let in_space = args.dimension > 2;
    if in_space {
        (result.dimension, result.mode) = (Some(args.dimension), CatalogueMode::InSpace);
    }
    let in_order = asked.iter().collect::<BTreeSet<_>>();
    for &id in in_order {
        signals::check()?;
        let started = Instant::now();
        if let Some(row) = session.row(id, args.effort)? {
            print_row(&row, started.elapsed().as_secs_f64());
            result.rows.push(row);
        }
    }
    let default = if args.only.is_empty() { DEFAULT_SEEDS } else { 0 };
    let seeds = args.seeds.unwrap_or(default);
    if seeds > 0 {
        let started = Instant::now();
        let sums = session.composed(seeds)?;
        print_composed(&sums, started.elapsed().as_secs_f64());
        result.composed = Some(sums);
    }
    write(args, &result)?;
    let (failed, schedules) = (result.failed(), result.composed.as_ref().map_or(0, |sums| sums.failures.len()));
    if failed + schedules > 0 {
        let space = if in_space { " --dimension 3" } else { "" };
        say!("seed {}: host-sim faults{space} --seed {} shows it again", args.seed, args.seed);
        return Err(SimError::Faults { failed, rows: result.rows.len(), schedules });
    }
    Ok(())
}

/// The table monitor × row.
fn without_monitors(args: &FaultsArgs, session: &dyn Session) -> Result<(), SimError> {
    let monitors = session.monitors_off()?;
    for MonitorOff { monitor, rows } in &monitors {
        let rows: Vec<String> = rows.iter().map(ToString::to_string).collect();
        say!(
            "{:<20}  {}",
            monitor.to_string(),
            if rows.is_empty() { "nobody notices".to_owned() } else { rows.join(" ") }
        );
    }
    if let Some(path) = &args.json {
        write_json(path, &monitors)?;
    }
    let unnoticed = monitors.iter().filter(|off| off.rows.is_empty()).count();
    if unnoticed > 0 { Err(SimError::Unnoticed { monitors: unnoticed }) } else { Ok(()) }
}

fn write(args: &FaultsArgs, result: &FaultsResult) -> Result<(), SimError> {
    if let Some(directory) = &args.out {
        let [csv, json, svg] = FILES.map(|name| directory.join(name));
        write_bytes(&csv, &result.csv())?;
        write_json(&json, result)?;
        write_bytes(&svg, faults_chart::figure(result).svg().as_bytes())?;
    }
    if let Some(path) = &args.json {
        write_json(path, result)?;
    }
    Ok(())
}

/// Prints a row as soon as it is known.
fn print_row(row: &RowResult, wall_s: f64) {
    say!(
        "{:>2}  {:<46} {:>8} injected {:>8} detected {:>6} ticks  {:<4} unaccounted {}  {}  ({wall_s:.1} s)",
        row.id,
        row.name,
        row.injected,
        row.detected,
        row.ticks_to_detect.map_or_else(|| "–".to_owned(), |ticks| ticks.to_string()),
        row.final_state.map_or("–", Mode::name),
        row.unaccounted,
        row.result,
    );
    if row.result != RowVerdict::Passed {
        for note in &row.notes {
            say!("    {note}");
        }
    }
}

/// Prints what became of the random schedules.
fn print_composed(composed: &Composed, wall_s: f64) {
    let [hold, run, safe] = composed.modes;
    say!(
        "{} random schedules of {} faults: {} ticks ({run} RUN, {hold} HOLD, {safe} SAFE), {} injections, {} commands \
         with fault codes, {} re-armings, largest error {:.3e}, unaccounted {}  ({wall_s:.1} s)",
        composed.schedules,
        composed.faults,
        composed.ticks,
        composed.injected,
        composed.flagged,
        composed.rearmed,
        composed.max_error,
        composed.unaccounted,
    );
    for failure in &composed.failures {
        say!("    {failure}");
    }
}
