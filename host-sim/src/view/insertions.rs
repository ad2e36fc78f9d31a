//! Insertions for the page: one after another under its knobs, until it or a signal asks for the end.

use std::path::Path;

use firmware::contract::Table;
use model_offline::placement::discretise;
use model_offline::scene::{Scene, TissueVariant};

use super::server::View;
use super::shared::Knobs;
use crate::bench::error::SimError;
use crate::bench::insertion::{ControllerSetup, Label, SimulatedInsertion};
use crate::bench::result::StrategyResult;
use crate::bench::strategy::Strategy;
use crate::runtime::error::RuntimeError;
use crate::runtime::executor::Hardware;
use crate::runtime::names;
use crate::runtime::time::mode::RunMode;
use crate::world::error::WorldError;
use crate::world::simulation::Simulation;

/// What the page's insertions start from.
#[derive(Clone, Debug)]
pub struct InsertionBasis<'a> {
    /// This program, which is also the controller.
    pub program: &'a Path,
    /// The scene of the simulation, as the knobs find it.
    pub scene: &'a Scene,
    /// The tissue that the table was made for.
    pub table_tissue: TissueVariant,
    /// What the controller believes; the knobs do not change it.
    pub table: &'a Table<f64, 2>,
    /// The same as encoded.
    pub table_bytes: &'a [u8],
    /// Settings of the command line.
    pub simulation: Simulation,
    /// What drives time.
    pub mode: RunMode,
    /// What computes the controller's steps.
    pub hardware: Hardware,
}

/// Simulates insertions until the page says finish (or a signal ends the program); one line about each goes to `say`.
///
/// # Errors
/// [`SimError`] of the first insertion that cannot be simulated, except for the signal.
pub fn insertions(view: &View, basis: &InsertionBasis<'_>, say: &dyn Fn(&str)) -> Result<(), SimError> {
    let shared = view.shared();
    shared.allow_restarts();
    for number in 1_u64.. {
        shared.started();
        let knobs = shared.knobs();
        let (scene, simulation) = under(&knobs, basis);
        let (model, _) = discretise(&scene)?;
        let controller = ControllerSetup {
            program: basis.program,
            table: basis.table,
            table_bytes: basis.table_bytes,
            mode: basis.mode,
            hardware: basis.hardware,
            spectator: Some(view),
        };
        let strategy = Strategy::dynamic(basis.mode);
        let label = Label { tissue: scene.tissue(), table_tissue: basis.table_tissue, strategy };
        match SimulatedInsertion::new(&model, &simulation, label).controlled(&controller) {
            Ok(measured) => say(&line(number, &knobs, &measured.result)),
            Err(SimError::Runtime(RuntimeError::Interrupted { .. })) => return Ok(()),
            // A tissue that has no equilibrium any more is something to see, not the end of the view.
            Err(error @ SimError::Runtime(RuntimeError::World(WorldError::Tissue { .. }))) => {
                say(&format!("insertion {number}: {error}"));
                shared.set_paused(true);
            }
            Err(error) => return Err(error),
        }
        if shared.is_finished() {
            return Ok(());
        }
    }
    Ok(())
}

/// Scene and simulation as the knobs want them.
fn under(knobs: &Knobs, basis: &InsertionBasis<'_>) -> (Scene, Simulation) {
    let mut scene = basis.scene.clone();
    for inclusion in &mut scene.inclusions {
        inclusion.stiffness *= knobs.stiffness;
    }
    let mut simulation = basis.simulation.clone();
    let settle_s = simulation.duration_s - simulation.needle.end_s();
    simulation.needle = simulation.needle.faster(knobs.needle_speed);
    simulation.duration_s = simulation.needle.end_s() + settle_s;
    let loop_settings = &mut simulation.loop_settings;
    loop_settings.noise = Some(loop_settings.noise_for(simulation.depth) * knobs.noise);
    // The target sensor is never faster than the loop.
    loop_settings.target_rate = knobs.target_rate.min(loop_settings.rate);
    loop_settings.latency = knobs.latency;
    (scene, simulation)
}

fn line(number: u64, knobs: &Knobs, result: &StrategyResult) -> String {
    let Knobs { needle_speed, target_rate, latency, noise, stiffness } = knobs;
    let mut text = format!(
        "insertion {number} (needle × {needle_speed}, sensor {target_rate} Hz, {latency} ms, noise × {noise}, \
         stiffness × {stiffness}): largest error {:.3e}, {}",
        result.max_orthogonal_error,
        names::mode::name(result.final_state)
    );
    if let Some(timing) = &result.plant_timing {
        text += &format!(
            ", plant step p50 {:.1} µs, p99 {:.1} µs, {} skipped",
            timing.execution_time.p50_ns as f64 * 1e-3,
            timing.execution_time.p99_ns as f64 * 1e-3,
            timing.skipped
        );
    }
    text
}
