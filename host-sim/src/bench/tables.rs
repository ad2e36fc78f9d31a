//! What a table's size is worth: depth knots and number type against bytes, cost of a step, and closed-loop error.
//!
//! The loop is the firmware's own controller on a reduced model of the tissue, in this process and in virtual time: 1 kHz,
//! target at 50 Hz and 20 ms late, insertion in 5 s, sensors all but exact, so that what is left is the table's and the
//! delay's.

use std::time::Instant;

use firmware::contract::{MAX_TABLE_BYTES, PaddleCommand, Table, encode};
use firmware::scalar::{Scalar, ScalarKind};
use firmware::{Controller, Faults, Inputs, State};
use model_offline::model::TissueModel;
use model_offline::reduction::{TrainingOptions, train};
use model_offline::table::{TableOptions, build};
use nalgebra::Vector2;

use super::error::SimError;
use crate::runtime::error::RuntimeError;
use crate::world::World;
use crate::world::error::WorldError;
use crate::world::loop_settings::LoopSettings;
use crate::world::simulation::Simulation;
use crate::world::tissue::TissuePlant;

/// Knots that are tried.
pub const KNOTS: [usize; 7] = [2, 3, 5, 9, 17, 33, 65];
/// Noise of the target sensor, part of the depth: none that counts, but no sensor reads the same number twice.
const NOISE: f64 = 1e-9;
/// Runs per setting; the best time counts.
const REPEATS: u32 = 3;

/// One table, tried.
#[derive(Debug)]
pub struct TableTrial {
    /// Depth knots.
    pub knots: usize,
    /// Number type of the payload.
    pub scalar: ScalarKind,
    /// Encoded size.
    pub bytes: usize,
    /// Mean time of a controller's step, ns: best of several runs.
    pub step_ns: f64,
    /// Largest orthogonal target displacement over the insertion, length.
    pub max_error: f64,
    /// Why the loop stopped.
    pub failure: Option<SimError>,
}

impl TableTrial {
    /// Whether the insertion was finished.
    pub fn worked(&self) -> bool {
        self.failure.is_none() && self.max_error.is_finite()
    }
}

/// Tries tables of a paddle, each in both number types; `progress` is called after each number of knots.
///
/// # Errors
/// [`SimError`]: there is no table, or no reduced model to close the loop on.
pub fn compare(
    model: &TissueModel,
    paddle: u32,
    threads: usize,
    progress: &dyn Fn(),
) -> Result<Vec<TableTrial>, SimError> {
    let position = model.paddle_position(paddle);
    let options = TrainingOptions { threads, ..TrainingOptions::of(model.scene()) };
    let (trained, _) = train(model, position, &options).map_err(WorldError::Training)?;
    let simulation = Simulation::new(model.scene());
    let plant = || TissuePlant::reduced(model, position, &trained);
    let mut trials = Vec::new();
    for knots in KNOTS {
        let table = build(model, paddle, &TableOptions { knots, ..TableOptions::default() })?;
        trials.push(try_table(&table.cast::<f32>(), plant(), &simulation));
        trials.push(try_table(&table, plant(), &simulation));
        progress();
    }
    Ok(trials)
}

fn try_table<T: Scalar>(table: &Table<T, 2>, plant: TissuePlant<'_>, simulation: &Simulation) -> TableTrial {
    let mut trial = TableTrial {
        knots: table.knots.len(),
        scalar: T::KIND,
        bytes: encode(table, &mut vec![0; MAX_TABLE_BYTES]).unwrap_or(0),
        step_ns: f64::INFINITY,
        max_error: f64::NAN,
        failure: None,
    };
    match insert(table, plant, simulation) {
        Ok((max_error, inputs)) => {
            trial.max_error = max_error;
            trial.step_ns = (0..REPEATS).map(|_| step_ns(table, simulation, &inputs)).fold(f64::INFINITY, f64::min);
        }
        Err(error) => trial.failure = Some(error),
    }
    trial
}

/// One insertion: largest orthogonal error, length, and what the controller was given.
fn insert<T: Scalar>(
    table: &Table<T, 2>,
    plant: TissuePlant<'_>,
    simulation: &Simulation,
) -> Result<(f64, Vec<Inputs>), SimError> {
    let settings = simulation.loop_settings.settings(simulation.depth);
    let controller = Controller::new(table, &settings)?;
    let mut state = State::<T>::new();
    // The controller expects a camera's noise, and gets next to none: what is left is the table's error.
    let noise = Some(NOISE * simulation.depth);
    let quiet = Simulation { loop_settings: LoopSettings { noise, ..simulation.loop_settings }, ..simulation.clone() };
    let mut world = World::simulated(plant, table.paddles[0].index, &quiet);
    let normal = Vector2::new(table.orthogonal[0].to_f64(), table.orthogonal[1].to_f64());
    let (mut largest, mut seen) = (0.0_f64, Vec::with_capacity(simulation.ticks() as usize));
    let mut command: Option<PaddleCommand> = None;
    for tick in 0..simulation.ticks() {
        let (truth, inputs) = world.tick(tick, command.as_ref(), settings.loop_period_ns)?;
        largest = largest.max(truth.target::<2>().dot(&normal).abs());
        command = Some(controller.step(&mut state, &inputs));
        seen.push(inputs);
        if world.since_start_s(truth.time_ns) >= simulation.duration_s {
            return Ok((largest, seen));
        }
    }
    let faults = Faults::from_bits(command.map_or(0, |command| command.faults));
    Err(RuntimeError::NeverArmed { waited_s: simulation.ticks() as f64 / simulation.loop_settings.rate, faults }.into())
}

/// The same inputs once more, for the mean time of the steps alone, ns.
fn step_ns<T: Scalar>(table: &Table<T, 2>, simulation: &Simulation, inputs: &[Inputs]) -> f64 {
    let Ok(controller) = Controller::new(table, &simulation.loop_settings.settings(simulation.depth)) else {
        return f64::NAN;
    };
    let mut state = State::<T>::new();
    let start = Instant::now();
    for inputs in inputs {
        std::hint::black_box(controller.step(&mut state, inputs));
    }
    1e9 * start.elapsed().as_secs_f64() / inputs.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_offline::placement::model_with_paddle;
    use model_offline::scene::Scene;

    #[test]
    fn every_table_holds_the_target_and_single_precision_costs_nothing() {
        let scene = Scene::bundled("paper").unwrap().without_inclusions();
        let (model, paddle) = model_with_paddle(&scene, None).unwrap();
        let trials = compare(&model, paddle, 2, &|| {}).unwrap();
        assert_eq!(trials.len(), 2 * KNOTS.len());
        assert!(trials.iter().all(TableTrial::worked), "{trials:?}");
        let of = |knots: usize, scalar: ScalarKind| {
            trials.iter().find(|trial| trial.knots == knots && trial.scalar == scalar).unwrap()
        };
        // The path is cubic between knots with its slopes, and feedback removes what is left: already two knots hold the
        // target a hundred times better than the best static paddle does (0.00037).
        for knots in KNOTS {
            let [single, double] = [ScalarKind::F32, ScalarKind::F64].map(|scalar| of(knots, scalar));
            assert!(double.max_error < 3.7e-6, "{double:?}");
            assert!((single.max_error - double.max_error).abs() < 0.1 * double.max_error, "{single:?} {double:?}");
        }
        assert!(of(65, ScalarKind::F32).bytes < of(65, ScalarKind::F64).bytes);
    }
}
