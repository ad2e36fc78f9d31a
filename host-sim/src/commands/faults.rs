//! `host-sim faults`.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use crate::bench::faults::catalogue::ROWS;
use crate::bench::faults::random::composed;
use crate::bench::faults::report::{FaultsResult, RowResult, print_composed, print_row};
use crate::error::SimError;
use crate::report::directory;
use crate::runtime::signals;

/// Options of `faults`.
#[derive(Args, Clone, Debug)]
pub struct FaultsArgs {
    /// Only these rows [default: all]
    #[arg(long, value_name = "N,...", value_delimiter = ',')]
    pub only: Vec<u32>,
    /// Seed of phases, noise and schedules
    #[arg(long, default_value_t = 1, value_name = "S")]
    pub seed: u64,
    /// Random schedules of several faults at once [default: 1000, none with --only]
    #[arg(long, value_name = "N")]
    pub seeds: Option<u64>,
    /// Part of the repetitions of rows 33, 35 and 36 (200 kills, 100 kills, 100 cycles)
    #[arg(long, default_value_t = 1.0, value_name = "PART")]
    pub effort: f64,
    /// Write faults.csv and faults.json into this directory
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Also write the result here, as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Random schedules without `--seeds`.
const DEFAULT_SEEDS: u64 = 1000;

/// Tries what was asked for and prints it row by row.
///
/// # Errors
/// [`SimError::Faults`] when something does not hold; everything is written nevertheless.
pub fn faults(args: &FaultsArgs) -> Result<FaultsResult, SimError> {
    signals::install();
    if let Some(unknown) = args.only.iter().find(|id| !ROWS.iter().any(|row| row.id == **id)) {
        return Err(SimError::Usage(format!("--only {unknown}: the catalogue has rows 1 to {}", ROWS.len())));
    }
    if let Some(directory) = &args.out {
        std::fs::create_dir_all(directory).map_err(|source| SimError::Write { path: directory.clone(), source })?;
    }
    let table = crate::bench::faults::fixture()?;
    let mut result = FaultsResult {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed: args.seed,
        mode: "rows 1 to 32 and random schedules: lockstep; rows 33 to 45: real processes".to_owned(),
        ..FaultsResult::default()
    };
    for row in ROWS.iter().filter(|row| args.only.is_empty() || args.only.contains(&row.id)) {
        signals::check()?;
        let started = Instant::now();
        let row = RowResult::new(row, &row.run(&table, args.seed, args.effort)?);
        print_row(&row, started.elapsed().as_secs_f64());
        result.rows.push(row);
    }
    let default = if args.only.is_empty() { DEFAULT_SEEDS } else { 0 };
    let seeds = args.seeds.unwrap_or(default);
    if seeds > 0 {
        let started = Instant::now();
        let sums = composed(&table, args.seed, seeds, &|| {})?;
        print_composed(&sums, started.elapsed().as_secs_f64());
        result.composed = Some(sums);
    }
    write(args, &result)?;
    let (failed, schedules) = (result.failed(), result.composed.as_ref().map_or(0, |sums| sums.failures.len()));
    if failed + schedules > 0 {
        println!("seed {}: host-sim faults --seed {} shows it again", args.seed, args.seed);
        return Err(SimError::Faults { failed, rows: result.rows.len(), schedules });
    }
    Ok(result)
}

fn write(args: &FaultsArgs, result: &FaultsResult) -> Result<(), SimError> {
    if let Some(directory) = &args.out {
        directory::write_text(&directory.join("faults.csv"), &result.csv())?;
        directory::write_json(&directory.join("faults.json"), result)?;
    }
    args.json.as_ref().map_or(Ok(()), |path| directory::write_json(path, result))
}
