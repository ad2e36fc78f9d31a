//! What the image costs: instructions per step by branch, flash, RAM and stack; and that its commands are the host's.

use std::collections::BTreeMap;
use std::time::Duration;

use firmware::contract::{MAX_TABLE_BYTES, PaddleCommand, Table, TableError, encode};
use firmware::scalar::{Scalar, ScalarKind};
use firmware::{Controller, Faults, Inputs, Mode, Settings, SettingsError, State};
use serde::{Deserialize, Serialize};

use crate::exchange::board::BoardError;
use crate::exchange::board::device::Device;
use crate::exchange::board::image::{Control, Image, MemoryUse, Processor};
use crate::exchange::board::qemu::ICOUNT_SHIFT;
use crate::record::difference::{Difference, difference};
use crate::record::recording::Recording;

/// A step that takes longer than this is no step.
const PATIENCE: Duration = Duration::from_secs(20);
/// Ticks of each scenario besides the recorded run itself.
const SCENARIO_TICKS: usize = 600;

/// Why an image cannot be measured, or costs too much.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeasureError {
    /// The board cannot be used.
    #[error("the controller on the board cannot be used")]
    Board(#[from] BoardError),
    /// The recording is in another scalar, or its table is broken.
    #[error("the recording's table: {0}")]
    RecordedTable(TableError),
    /// The recording does not have enough ticks to make scenarios of.
    #[error("the recording has {ticks} ticks, at least {needed} are needed: make a longer one")]
    TooShort {
        /// Its ticks.
        ticks: usize,
        /// Ticks needed.
        needed: usize,
    },
    /// The scenario's table cannot be given to the board.
    #[error("{scenario}: {reason}")]
    Table {
        /// Name of the scenario.
        scenario: &'static str,
        /// Why.
        reason: TableError,
    },
    /// The controller refuses the scenario's settings.
    #[error("{scenario}: {reason}")]
    Settings {
        /// Name of the scenario.
        scenario: &'static str,
        /// Why.
        reason: SettingsError,
    },
    /// A command of the board is not the host's.
    #[error("{scenario}: tick {tick}: on the board {difference} (host first)")]
    Differs {
        /// Name of the scenario.
        scenario: &'static str,
        /// The tick.
        tick: u64,
        /// First field that differs.
        difference: Difference,
    },
    /// Samples of a scenario are in no account.
    #[error("{scenario}: samples unaccounted for")]
    Unaccounted {
        /// Name of the scenario.
        scenario: &'static str,
    },
    /// Figures have grown past their budget, or differ from run to run.
    #[error("{}", lines(complaints))]
    Budget {
        /// All of them.
        complaints: Vec<Complaint>,
    },
}

/// A line for each.
fn lines(complaints: &[Complaint]) -> String {
    complaints.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

/// What is wrong with the figures of an image.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Complaint {
    /// A figure is above its budget.
    #[error("{image}: {figure} is {is}, the budget {allowed}")]
    Above {
        /// Name of the image.
        image: String,
        /// Which figure.
        figure: BudgetItem,
        /// The figure.
        is: u32,
        /// Its budget.
        allowed: u32,
    },
    /// The budget has a branch that no step took.
    #[error("{image}: no step took the branch {branch}: the corpus does not reach it")]
    Unreached {
        /// Name of the image.
        image: String,
        /// The branch.
        branch: Branch,
    },
    /// Measuring again gave something else.
    #[error("{image}: two runs gave different figures")]
    Unsteady {
        /// Name of the image.
        image: String,
    },
    /// There is no budget for the image.
    #[error("{image}: the budget does not have it")]
    NotInBudget {
        /// Name of the image.
        image: String,
    },
}

/// A figure that has a budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq, strum::Display)]
#[strum(serialize_all = "kebab-case")]
pub enum BudgetItem {
    /// Flash without a table, bytes.
    Flash,
    /// Statics, bytes.
    #[strum(to_string = "RAM")]
    Ram,
    /// Deepest stack, bytes.
    Stack,
    /// Fewest instructions of a step of this branch.
    #[strum(to_string = "{0} min")]
    Min(Branch),
    /// Median of them.
    #[strum(to_string = "{0} median")]
    Median(Branch),
    /// Most of them.
    #[strum(to_string = "{0} max")]
    Max(Branch),
    /// Most of them, for a branch that the budget does not know.
    #[strum(to_string = "{0}, which the budget lacks,")]
    Unbudgeted(Branch),
}

/// Inputs for the controller, with the table and settings that it runs with.
#[derive(Clone, Debug)]
pub struct Scenario<const D: usize = 2, const N: usize = 1, const P: usize = 1> {
    /// What it is about.
    pub name: &'static str,
    pub(super) table: Table<f64, D, N, P>,
    pub(super) settings: Settings,
    pub(super) inputs: Vec<Inputs>,
}

/// The recorded run, and variations of its end that reach the other branches of the step.
///
/// # Errors
/// [`MeasureError::TooShort`], or [`MeasureError::RecordedTable`] for another scalar than `f64`.
pub fn scenarios(recording: &Recording) -> Result<Vec<Scenario>, MeasureError> {
    let table =
        firmware::contract::decode::<f64, 2, 1, 1>(&recording.header.table).map_err(MeasureError::RecordedTable)?;
    let settings = recording.header.settings;
    let recorded: Vec<Inputs> = recording.records.iter().map(|record| record.tick.inputs).collect();
    if recorded.len() < 2 * SCENARIO_TICKS {
        return Err(MeasureError::TooShort { ticks: recorded.len(), needed: 2 * SCENARIO_TICKS });
    }
    // The end of the insertion: the needle still moves, then arrives.
    let end = recorded[recorded.len() - 2 * SCENARIO_TICKS..][..SCENARIO_TICKS].to_vec();
    let vary = |name, change: &dyn Fn(usize, &mut Inputs)| {
        let mut inputs = end.clone();
        inputs.iter_mut().enumerate().for_each(|(i, tick)| change(i, tick));
        Scenario { name, table: table.clone(), settings, inputs }
    };
    let mut slow = vary("paddle too slow and too weak", &|_, _| {});
    let longest = slow.table.knots.iter().map(|knot| knot.paddle_path.norm()).fold(0.0, f64::max);
    slow.table.paddles[0].max_displacement = longest * (1.0 + 1e-9);
    slow.table.paddles[0].max_rate *= 0.01;
    // The recorded paddle is faster than that: it would be a fault of its own.
    slow.settings.following_error = Some(1e3 * longest);
    Ok(vec![
        Scenario { name: "recorded run", table: table.clone(), settings, inputs: recorded },
        vary("target lost", &|i, tick| {
            if i % 300 >= 100 {
                tick.target = None;
            }
        }),
        vary("wrong paddle attached", &|i, tick| {
            if let (true, Some(paddle)) = (i >= 100, &mut tick.paddles[0]) {
                paddle.paddle_index += 1;
            }
        }),
        slow,
        vary("needle deeper than the table", &|_, tick| {
            if let Some(needle) = &mut tick.needle {
                needle.depth *= 1.2;
            }
        }),
    ])
}

/// Branch of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, strum::Display)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum Branch {
    /// In HOLD.
    Hold,
    /// In RUN, and nothing special.
    Run,
    /// In SAFE.
    Safe,
    /// In RUN, at a limit of the paddle.
    Saturated,
    /// In RUN, beyond an end of the table.
    TableEdge,
}

impl Branch {
    /// By what the step's command says.
    fn of(command: &PaddleCommand) -> Self {
        let faults = Faults::from_bits(command.faults);
        let has = |codes: Faults| !faults.intersection(codes).is_empty();
        match Mode::from_wire(command.state) {
            Some(Mode::Safe) => Self::Safe,
            Some(Mode::Run) if has(Faults::DEPTH_CLAMPED) => Self::TableEdge,
            Some(Mode::Run) if has(Faults::POSITION_LIMITED | Faults::RATE_LIMITED) => Self::Saturated,
            Some(Mode::Run) => Self::Run,
            _ => Self::Hold,
        }
    }
}

/// Instructions of the steps of one branch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Instructions {
    /// Fewest.
    pub min: u32,
    /// Median.
    pub median: u32,
    /// Most.
    pub max: u32,
}

/// Everything that is measured of one image.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figures {
    /// Flash without a table, bytes.
    pub flash: u32,
    /// Statics, bytes.
    pub ram: u32,
    /// Deepest stack, bytes.
    pub stack: u32,
    /// Steps counted.
    pub steps: u32,
    /// Instructions per step, by branch.
    pub instructions: BTreeMap<Branch, Instructions>,
}

/// Figures of all images, by [`name`].
pub type Budget = BTreeMap<String, Figures>;

/// Name of an image in a budget.
pub fn name(image: &Image) -> String {
    format!("{}{}-{}", image.scalar.name(), image.control.suffix(), image.processor.name())
}

/// Builds all four images of the plane.
///
/// # Errors
/// As [`Image::build`].
pub fn images() -> Result<Vec<Image>, BoardError> {
    let kinds = Processor::ALL
        .into_iter()
        .flat_map(|processor| [ScalarKind::F64, ScalarKind::F32].map(|scalar| (scalar, processor)));
    kinds.map(|(scalar, processor)| Image::build(scalar, processor)).collect()
}

/// Builds the image of two paddles in space.
///
/// # Errors
/// As [`Image::build`].
pub fn spatial_image() -> Result<Image, BoardError> {
    Image::build_for(Control::SpacePair, ScalarKind::F64, Processor::Double)
}

/// Runs all scenarios on an image. Every command must be the host's, bit by bit.
///
/// # Errors
/// [`MeasureError`]; [`MeasureError::Differs`] for a command that is not the host's.
pub(super) fn measure<const D: usize, const N: usize, const P: usize>(
    image: &Image,
    scenarios: &[Scenario<D, N, P>],
) -> Result<Figures, MeasureError> {
    let mut device = Device::emulate(image)?;
    let mut counted: BTreeMap<Branch, Vec<u32>> = BTreeMap::new();
    let mut stack = 0;
    for scenario in scenarios {
        match image.scalar {
            ScalarKind::F32 => run(&mut device, &scenario.table.cast::<f32>(), scenario, &mut counted)?,
            ScalarKind::F64 => run(&mut device, &scenario.table, scenario, &mut counted)?,
        }
        let account = device.account()?;
        stack = stack.max(account.stack_bytes);
        if account.ledger.unaccounted() > 0 {
            return Err(MeasureError::Unaccounted { scenario: scenario.name });
        }
    }
    let MemoryUse { flash, ram } = image.memory_use()?;
    let steps = counted.values().map(Vec::len).sum::<usize>() as u32;
    let instructions = counted
        .into_iter()
        .map(|(branch, mut counts)| {
            counts.sort_unstable();
            let (min, max) = (counts[0], counts[counts.len() - 1]);
            (branch, Instructions { min, median: counts[counts.len() / 2], max })
        })
        .collect();
    Ok(Figures { flash, ram, stack, steps, instructions })
}

fn run<T: Scalar, const D: usize, const N: usize, const P: usize>(
    device: &mut Device,
    table: &Table<T, D, N, P>,
    scenario: &Scenario<D, N, P>,
    counted: &mut BTreeMap<Branch, Vec<u32>>,
) -> Result<(), MeasureError> {
    let name = scenario.name;
    let mut bytes = vec![0; MAX_TABLE_BYTES];
    let length = encode(table, &mut bytes).map_err(|reason| MeasureError::Table { scenario: name, reason })?;
    let controller = Controller::new(table, &scenario.settings)
        .map_err(|reason| MeasureError::Settings { scenario: name, reason })?;
    let mut state = State::new();
    device.begin(&bytes[..length], &scenario.settings)?;
    let counter_hz = device.identity().counter_hz;
    for inputs in &scenario.inputs {
        let expected = controller.step(&mut state, inputs);
        let answer = device
            .step(inputs, PATIENCE)?
            .ok_or(BoardError::Silent { to: "a step", silent_s: PATIENCE.as_secs_f64() })?;
        if let Some(difference) = difference(&expected, &answer.command) {
            return Err(MeasureError::Differs { scenario: name, tick: inputs.tick, difference });
        }
        counted.entry(Branch::of(&answer.command)).or_default().push(instructions(answer.counts, counter_hz));
    }
    Ok(())
}

/// Instructions that took so many counts: an instruction is 2^[`ICOUNT_SHIFT`] ns, several counts long, so that
/// rounding gives the exact number.
fn instructions(counts: u32, counter_hz: u32) -> u32 {
    let ns = f64::from(counts) * 1e9 / f64::from(counter_hz);
    (ns / f64::from(1 << ICOUNT_SHIFT)).round() as u32
}

/// How far a figure may be above its budget.
pub const TOLERANCE: f64 = 0.02;

/// Figures above their budget.
pub fn exceeded(measured: &Figures, budget: &Figures, image: &str) -> Vec<Complaint> {
    let mut found = Vec::new();
    let mut hold = |figure: BudgetItem, is: u32, allowed: u32| {
        if f64::from(is) > f64::from(allowed) * (1.0 + TOLERANCE) {
            found.push(Complaint::Above { image: image.to_owned(), figure, is, allowed });
        }
    };
    hold(BudgetItem::Flash, measured.flash, budget.flash);
    hold(BudgetItem::Ram, measured.ram, budget.ram);
    hold(BudgetItem::Stack, measured.stack, budget.stack);
    for (branch, is) in &measured.instructions {
        match budget.instructions.get(branch) {
            Some(allowed) => {
                hold(BudgetItem::Min(*branch), is.min, allowed.min);
                hold(BudgetItem::Median(*branch), is.median, allowed.median);
                hold(BudgetItem::Max(*branch), is.max, allowed.max);
            }
            None => hold(BudgetItem::Unbudgeted(*branch), is.max, 0),
        }
    }
    let unreached = budget.instructions.keys().filter(|branch| !measured.instructions.contains_key(branch));
    found.extend(unreached.map(|branch| Complaint::Unreached { image: image.to_owned(), branch: *branch }));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figures() -> Figures {
        let run = Instructions { min: 100, median: 200, max: 300 };
        Figures { flash: 1000, ram: 2000, stack: 500, steps: 9, instructions: [(Branch::Run, run)].into() }
    }

    /// The complaints about figures that differ from the budget in this.
    fn complaints(change: impl FnOnce(&mut Figures)) -> Vec<String> {
        let mut measured = figures();
        change(&mut measured);
        exceeded(&measured, &figures(), "image").iter().map(ToString::to_string).collect()
    }

    #[test]
    fn what_is_within_the_tolerance_is_within_the_budget() {
        assert_eq!(complaints(|_| {}), [""; 0]);
        assert_eq!(complaints(|f| f.flash = 1020), [""; 0]);
        assert_eq!(complaints(|f| (f.flash, f.ram, f.stack) = (1, 1, 1)), [""; 0], "less is welcome");
    }

    #[test]
    fn every_figure_above_its_budget_is_named_with_both_numbers() {
        assert_eq!(complaints(|f| f.flash = 1021), ["image: flash is 1021, the budget 1000"]);
        assert_eq!(complaints(|f| f.ram = 2041), ["image: RAM is 2041, the budget 2000"]);
        assert_eq!(complaints(|f| f.stack = 511), ["image: stack is 511, the budget 500"]);
        let all = complaints(|f| {
            f.instructions.insert(Branch::Run, Instructions { min: 103, median: 205, max: 307 });
        });
        let expected =
            ["run min is 103, the budget 100", "run median is 205, the budget 200", "run max is 307, the budget 300"];
        assert_eq!(all, expected.map(|complaint| format!("image: {complaint}")));
    }

    #[test]
    fn branches_have_one_name_in_budgets_and_complaints() {
        for branch in [Branch::Hold, Branch::Run, Branch::Safe, Branch::Saturated, Branch::TableEdge] {
            assert_eq!(serde_json::to_value(branch).unwrap(), branch.to_string());
        }
    }

    #[test]
    fn both_know_the_same_branches() {
        let more = complaints(|f| {
            f.instructions.insert(Branch::Safe, Instructions { min: 1, median: 1, max: 1 });
        });
        assert_eq!(more, ["image: safe, which the budget lacks, is 1, the budget 0"]);
        let fewer = complaints(|f| f.instructions.clear());
        assert_eq!(fewer, ["image: no step took the branch run: the corpus does not reach it"]);
    }
}
