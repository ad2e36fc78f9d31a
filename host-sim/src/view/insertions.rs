//! Insertions for the page: one after another under its knobs, until it or a signal asks for the end.

use std::path::Path;

use firmware::Mode;
use firmware::contract::Table;
use model_offline::placement::discretise;
use model_offline::scene::{Scene, TissueVariant};

use super::server::View;
use super::shared::Knobs;
use crate::bench::error::SimError;
use crate::bench::in_space::{RepeatedCase, SpaceStrategyResult};
use crate::bench::insertion::{ControllerSetup, Label, SimulatedInsertion};
use crate::bench::result::StrategyResult;
use crate::bench::strategy::Strategy;
use crate::runtime::error::RuntimeError;
use crate::runtime::executor::Hardware;
use crate::runtime::names;
use crate::runtime::time::durations::LoopTiming;
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
    one_after_another(view, say, &|knobs| {
        let (scene, simulation) = under(knobs, basis);
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
        let insertion = SimulatedInsertion::new(&model, &simulation, label);
        let result = insertion.controlled(&controller)?.result;
        Ok(format!(", stiffness × {}){}", knobs.stiffness, Outcome::from(&result)))
    })
}

/// The same of a body in space, whose inclusions keep their stiffness.
///
/// # Errors
/// As [`insertions`].
pub fn insertions_in_space(
    view: &View,
    case: &RepeatedCase<'_>,
    simulation: &Simulation,
    mode: RunMode,
    say: &dyn Fn(&str),
) -> Result<(), SimError> {
    one_after_another(view, say, &|knobs| {
        let result = case.insert(&simulation_under(knobs, simulation), mode, view)?;
        Ok(format!("){}", Outcome::from(&result)))
    })
}

/// Inserts under the knobs until the page says finish; what an insertion says ends its line.
fn one_after_another(
    view: &View,
    say: &dyn Fn(&str),
    insert: &dyn Fn(&Knobs) -> Result<String, SimError>,
) -> Result<(), SimError> {
    let shared = view.shared();
    shared.allow_restarts();
    for number in 1_u64.. {
        shared.started();
        let knobs = shared.knobs();
        match insert(&knobs) {
            Ok(outcome) => {
                let Knobs { needle_speed, target_rate, latency, noise, .. } = knobs;
                say(&format!(
                    "insertion {number} (needle × {needle_speed}, sensor {target_rate} Hz, {latency} ms, noise × {noise}{outcome}"
                ));
            }
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
    (scene, simulation_under(knobs, &basis.simulation))
}

/// A simulation as the knobs want it.
fn simulation_under(knobs: &Knobs, simulation: &Simulation) -> Simulation {
    let mut simulation = simulation.clone();
    let settle_s = simulation.duration_s - simulation.needle.end_s();
    simulation.needle = simulation.needle.faster(knobs.needle_speed);
    simulation.duration_s = simulation.needle.end_s() + settle_s;
    let loop_settings = &mut simulation.loop_settings;
    loop_settings.noise = Some(loop_settings.noise_for(simulation.depth) * knobs.noise);
    // The target sensor is never faster than the loop.
    loop_settings.target_rate = knobs.target_rate.min(loop_settings.rate);
    loop_settings.latency = knobs.latency;
    simulation
}

/// What an insertion came to, in words.
struct Outcome<'r> {
    error: f64,
    state: Option<Mode>,
    timing: Option<&'r LoopTiming>,
}

impl<'r> From<&'r StrategyResult> for Outcome<'r> {
    fn from(result: &'r StrategyResult) -> Self {
        let StrategyResult { max_orthogonal_error, final_state, plant_timing, .. } = result;
        Self { error: *max_orthogonal_error, state: *final_state, timing: plant_timing.as_ref() }
    }
}

impl<'r> From<&'r SpaceStrategyResult> for Outcome<'r> {
    fn from(result: &'r SpaceStrategyResult) -> Self {
        let SpaceStrategyResult { max_orthogonal_error, final_state, plant_timing, .. } = result;
        Self { error: *max_orthogonal_error, state: *final_state, timing: plant_timing.as_ref() }
    }
}

impl std::fmt::Display for Outcome<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, ": largest error {:.3e}, {}", self.error, names::mode::name(self.state))?;
        let Some(timing) = self.timing else { return Ok(()) };
        write!(
            f,
            ", plant step p50 {:.1} µs, p99 {:.1} µs, {} skipped",
            timing.execution_time.p50_ns as f64 * 1e-3,
            timing.execution_time.p99_ns as f64 * 1e-3,
            timing.skipped
        )
    }
}
