//! `host-sim board`: measures the images and holds them against a budget.

use std::fmt::Write as _;
use std::path::PathBuf;

use crate::bench::board::measure::{self, Budget, Figures};
use crate::error::SimError;
use crate::exchange::board::BoardError;
use crate::record::recording::Recording;
use crate::report::directory;

/// Options of `board`.
#[derive(clap::Args, Clone, Debug)]
pub struct BoardArgs {
    /// Recording whose inputs are the corpus, as `run` writes it
    pub recording: PathBuf,
    /// Fail if a figure is more than 2 % above this budget (TOML)
    #[arg(long, value_name = "FILE")]
    pub budget: Option<PathBuf>,
    /// Write the measured figures here, as a budget
    #[arg(long, value_name = "FILE")]
    pub write_budget: Option<PathBuf>,
    /// Measure everything twice and fail if any figure differs
    #[arg(long)]
    pub twice: bool,
}

/// Builds, measures, prints, compares.
///
/// # Errors
/// [`SimError::Board`], [`SimError::Read`], [`SimError::Write`], [`SimError::Recording`].
pub fn board(args: &BoardArgs) -> Result<(), SimError> {
    let path = &args.recording;
    let bytes = std::fs::read(path).map_err(|source| SimError::Read { path: path.clone(), source })?;
    let recording = Recording::decode(&bytes).map_err(|source| SimError::Recording { path: path.clone(), source })?;
    let budget = args.budget.as_ref().map(read_budget).transpose()?;
    let scenarios = measure::scenarios(&recording)?;
    let mut measured = Budget::new();
    let mut complaints = Vec::new();
    for image in measure::images()? {
        let name = measure::name(&image);
        let figures = measure::measure(&image, &scenarios)?;
        if args.twice && measure::measure(&image, &scenarios)? != figures {
            complaints.push(format!("{name}: two runs gave different figures"));
        }
        print!("{}", table(&name, &figures));
        if let Some(budget) = &budget {
            match budget.get(&name) {
                Some(allowed) => complaints.extend(measure::exceeded(&figures, allowed, &name)),
                None => complaints.push(format!("{name}: the budget does not have it")),
            }
        }
        measured.insert(name, figures);
    }
    if let Some(path) = &args.write_budget {
        let text = format!("{HEAD}{}", toml::to_string(&measured).unwrap_or_default());
        directory::write_text(path, &text)?;
    }
    if complaints.is_empty() { Ok(()) } else { Err(BoardError::Budget(complaints.join("\n")).into()) }
}

const HEAD: &str = "\
# What the images may cost; `host-sim board RECORDING --budget THIS` fails when a figure is more than 2 % above.
# Bytes, and instructions per step by branch. Written by `host-sim board RECORDING --write-budget THIS`.
";

fn read_budget(path: &PathBuf) -> Result<Budget, SimError> {
    let text = std::fs::read_to_string(path).map_err(|source| SimError::Read { path: path.clone(), source })?;
    toml::from_str(&text).map_err(|error| SimError::Usage(format!("the budget {}: {error}", path.display())))
}

fn table(name: &str, figures: &Figures) -> String {
    let Figures { flash, ram, stack, steps, instructions } = figures;
    let mut text = format!(
        "{name}: flash {flash} B, statics {ram} B, stack {stack} B; {steps} steps, every command bit-identical to \
         the host's\n"
    );
    for (branch, count) in instructions {
        let _ = writeln!(
            text,
            "  {branch:<10}  min {:>6}  median {:>6}  max {:>6} instructions",
            count.min, count.median, count.max
        );
    }
    text
}
