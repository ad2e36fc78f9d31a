//! `host-sim timing`.

use std::path::PathBuf;

use clap::Args;
use host_sim::SimError;
use host_sim::bench::timing::{TimingOptions, TimingResult, timing as measure};
use host_sim::bench::usage::UsageError;
use host_sim::record::error::FileError;
use host_sim::record::files::{write_bytes, write_json};
use host_sim::report::cyclictest::{Column, histogram_file};
use host_sim::report::terminal::timing_summary::timing_summary;
use host_sim::report::timing_histograms;
use host_sim::runtime::error::RuntimeError;
use host_sim::runtime::signals;
use host_sim::runtime::time::clock::FIFO_PRIORITY;
use host_sim::world::error::OptionRange;

use model_offline::output::check_outputs;
use model_offline::tell;

const RATE: OptionRange = OptionRange::new("--rate", 0.1, 1e5, " Hz");
const INTERVAL: OptionRange = OptionRange::new("--interval", 10.0, 1e7, " µs");
const SECONDS: OptionRange = OptionRange::new("--seconds", 0.01, 86_400.0, " s");
const MAX_LATENESS: OptionRange = OptionRange::new("--max-lateness", 0.0, 6e7, " µs");

/// Options of `timing`.
#[derive(Args, Clone, Debug)]
pub(crate) struct TimingArgs {
    /// Rate of the loop, Hz
    #[arg(long, default_value_t = 1000.0, value_name = "HZ")]
    pub(crate) rate: f64,
    /// Period of the loop in place of its rate, µs
    #[arg(short, long, value_name = "US", conflicts_with = "rate")]
    pub(crate) interval: Option<f64>,
    /// Duration of the periodic measurement, s, or with m, h or d for minutes, hours or days: a third each for an empty loop, the
    /// controller's loop and the exchange
    #[arg(short = 'D', long, visible_alias = "duration", default_value_t = 10.0, value_name = "S", value_parser = duration)]
    pub(crate) seconds: f64,
    /// Processor of the loop; the controller process stays on the next one [default: left to the kernel]
    #[arg(short = 'a', long, value_name = "N")]
    pub(crate) cpu: Option<usize>,
    /// Real-time priority to ask for, 1 to 99; 0: the ordinary policy
    #[arg(short, long, default_value_t = FIFO_PRIORITY, value_name = "P", value_parser = clap::value_parser!(u8).range(0..=99))]
    pub(crate) priority: u8,
    /// Also find the highest rate at which no deadline is missed
    #[arg(long)]
    pub(crate) sweep: bool,
    /// End with exit code 1 if any release of any loop is later than this, µs
    #[arg(long, value_name = "US")]
    pub(crate) max_lateness: Option<f64>,
    /// Write the histogram of the release lateness here, in cyclictest's format
    #[arg(long, visible_alias = "histfile", value_name = "FILE")]
    pub(crate) histogram: Option<PathBuf>,
    /// Also write the result here, as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    /// Write timing.json and histograms into this directory
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

/// Seconds behind "90", "90s", "1.5m", "2h" or "1d", as cyclictest takes them.
fn duration(text: &str) -> Result<f64, std::num::ParseFloatError> {
    let units = [('s', 1.0), ('m', 60.0), ('h', 3_600.0), ('d', 86_400.0)];
    let given = units.into_iter().find_map(|(unit, seconds)| Some((text.strip_suffix(unit)?, seconds)));
    let (number, seconds) = given.unwrap_or((text, 1.0));
    Ok(seconds * number.parse::<f64>()?)
}

/// Measures and prints.
///
/// # Errors
/// [`SimError`]; [`SimError::TooLate`] when a release was later than allowed and [`SimError::Void`] when nothing is left to
/// compare, with everything written all the same.
pub(crate) fn timing(args: &TimingArgs) -> Result<(), SimError> {
    signals::install();
    super::sweep();
    let rate = rate(args)?;
    SECONDS.check(args.seconds)?;
    args.max_lateness.map_or(Ok(()), |limit| MAX_LATENESS.check(limit))?;
    let processors = model_offline::parallel::available();
    if let Some(cpu) = args.cpu
        && cpu >= processors
    {
        return Err(UsageError::NoProcessor { cpu, last: processors - 1 }.into());
    }
    if let Some(directory) = &args.out {
        FileError::make_folder(directory)?;
    }
    let own = args.out.as_ref().map(|directory| directory.join("timing.json"));
    let picture = args.out.as_ref().map(|directory| directory.join("timing.svg"));
    let (json, histogram) = (args.json.as_deref(), args.histogram.as_deref());
    check_outputs(
        &[],
        &[("--out", own.as_deref()), ("--out", picture.as_deref()), ("--json", json), ("--histogram", histogram)],
    )?;
    let result = measure(&TimingOptions {
        rate,
        seconds: args.seconds,
        cpu: args.cpu,
        priority: args.priority,
        sweep: args.sweep,
        program: std::env::current_exe().map_err(RuntimeError::Spawn)?,
    })?;
    write(args, &result)?;
    tell!("{}", timing_summary(&result, args.priority));
    if let Some(limit_us) = args.max_lateness {
        result.check_lateness(limit_us)?;
    }
    Ok(result.check_rounds()?)
}

/// Rate that is asked for, Hz.
fn rate(args: &TimingArgs) -> Result<f64, SimError> {
    match args.interval {
        Some(interval_us) => {
            INTERVAL.check(interval_us)?;
            Ok(1e6 / interval_us)
        }
        None => {
            RATE.check(args.rate)?;
            Ok(args.rate)
        }
    }
}

fn write(args: &TimingArgs, result: &TimingResult) -> Result<(), SimError> {
    if let Some(directory) = &args.out {
        write_json(&directory.join("timing.json"), result)?;
        let loops =
            [("empty loop", &result.empty), ("controller's loop", &result.controller), ("exchange", &result.exchange)];
        write_bytes(&directory.join("timing.svg"), timing_histograms(&loops).as_bytes())?;
    }
    if let Some(path) = &args.json {
        write_json(path, result)?;
    }
    if let Some(path) = &args.histogram {
        let loops = result.loops().map(|(measured, timings)| Column { name: measured.name(), timings });
        write_bytes(path, histogram_file(&loops).as_bytes())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::duration;

    #[test]
    fn durations_are_taken_as_cyclictest_takes_them() {
        for (text, seconds) in [("90", 90.0), ("90s", 90.0), ("1.5m", 90.0), ("2h", 7_200.0), ("1d", 86_400.0)] {
            assert_eq!(duration(text), Ok(seconds), "{text}");
        }
        for text in ["", "m", "1w", "1 m", "m1", "1mm"] {
            assert!(duration(text).is_err(), "{text}");
        }
    }
}
