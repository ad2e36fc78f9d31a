//! `host-sim board`: measures the images and holds them against a budget.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use host_sim::Progress as _;
use host_sim::SimError;
use host_sim::bench::board::measure::{self, Budget, Complaint, Figures, MeasureError};
use host_sim::bench::board::scenarios::Scenarios;
use host_sim::bench::usage::UsageError;
use host_sim::record::error::FileError;
use host_sim::record::files::write_bytes;
use host_sim::record::recording::Recording;
use host_sim::report::board_chart;
use host_sim::runtime::signals;

use model_offline::output::check_outputs;
use model_offline::parallel;
use model_offline::reading;
use model_offline::tell;

/// Options of `board`.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct BoardArgs {
    /// Recording whose inputs are the corpus, as `run` writes it
    pub(crate) recording: PathBuf,
    /// Fail if a figure is more than 2 % above this budget (TOML)
    #[arg(long, value_name = "FILE")]
    pub(crate) budget: Option<PathBuf>,
    /// Write the measured figures here, as a budget
    #[arg(long, value_name = "FILE")]
    pub(crate) write_budget: Option<PathBuf>,
    /// Draw the measured figures
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
    /// Measure everything twice and fail if any figure differs
    #[arg(long)]
    pub(crate) twice: bool,
}

/// Builds, measures, prints, compares.
///
/// # Errors
/// [`SimError::Measure`], [`SimError::File`], [`SimError::Record`].
pub(crate) fn board(args: &BoardArgs) -> Result<(), SimError> {
    signals::install();
    let outputs = [("--write-budget", args.write_budget.as_deref()), ("--svg", args.svg.as_deref())];
    check_outputs(&[&args.recording], &outputs)?;
    let recording = Recording::read(&args.recording)?;
    let budget = args.budget.as_deref().map(read_budget).transpose()?;
    let scenarios = Scenarios::of(&recording)?;
    let mut measured = Budget::new();
    let mut complaints = Vec::new();
    let images = signals::ends_at_once(|| -> Result<_, MeasureError> {
        let mut images = measure::images()?;
        images.push(measure::spatial_image()?);
        Ok(images)
    })?;
    let runs = if args.twice { 2 } else { 1 };
    let bar = super::progress_bar(false);
    bar.begin((images.len() * runs) as u64);
    // Instructions are counted, not timed: how many run at once changes nothing. The last image, in space, takes longest and begins.
    let measure_image = |k: usize| {
        let figures = scenarios.measure(&images[images.len() - 1 - k / runs]);
        bar.step();
        figures
    };
    let measure_all = || parallel::map(images.len() * runs, parallel::threads(None), measure_image);
    let mut found = signals::ends_at_once(measure_all);
    bar.finish_and_clear();
    for image in &images {
        let name = measure::name(image);
        let of_image = found.split_off(found.len() - runs).into_iter().collect::<Result<Vec<Figures>, _>>()?;
        if of_image.windows(2).any(|two| two[0] != two[1]) {
            complaints.push(Complaint::Unsteady { image: name.clone() });
        }
        let Some(figures) = of_image.into_iter().next() else { continue };
        tell!("{}", table(&name, &figures));
        if let Some(budget) = &budget {
            match budget.get(&name) {
                Some(allowed) => complaints.extend(measure::exceeded(&figures, allowed, &name)),
                None => complaints.push(Complaint::NotInBudget { image: name.clone() }),
            }
        }
        measured.insert(name, figures);
    }
    if let Some(path) = &args.write_budget {
        let text = format!("{HEAD}{}", toml::to_string(&measured).unwrap_or_default());
        write_bytes(path, text.as_bytes())?;
    }
    if let Some(path) = &args.svg {
        write_bytes(path, board_chart::figure(&measured).svg().as_bytes())?;
    }
    if complaints.is_empty() { Ok(()) } else { Err(MeasureError::Budget { complaints }.into()) }
}

const HEAD: &str = "\
# What the images may cost; `host-sim board RECORDING --budget THIS` fails when a figure is more than 2 % above.
# Bytes, and instructions per step by branch. Written by `host-sim board RECORDING --write-budget THIS`.
";

fn read_budget(path: &Path) -> Result<Budget, SimError> {
    let text =
        reading::read_text(path, reading::TEXT).map_err(|source| FileError::Read { path: path.to_owned(), source })?;
    toml::from_str(&text)
        .map_err(|source| UsageError::Budget { path: path.to_owned(), source: Box::new(source) }.into())
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
