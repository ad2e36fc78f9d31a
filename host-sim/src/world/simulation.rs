//! The numbers of a simulation.

use super::actuator::ActuatorModel;
use super::loop_settings::LoopSettings;
use super::tissue::PlantChoice;

/// The controller needs one target sample to arrive; everything longer is a fault of the set-up.
pub const LONGEST_WAIT_FOR_RUN_NS: u64 = 2_000_000_000;

/// Numbers of a simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Simulation {
    /// Rates, latency, noise.
    pub loop_settings: LoopSettings,
    /// Duration of the insertion, s.
    pub insertion_s: f64,
    /// Time simulated after the start of the needle, s.
    pub duration_s: f64,
    /// Depth of the insertion, length.
    pub depth: f64,
    /// The paddle's actuator.
    pub actuator: ActuatorModel,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// What answers for the tissue.
    pub plant: PlantChoice,
}

impl Simulation {
    /// Ticks of a run, with the wait for RUN.
    pub fn ticks(&self) -> u64 {
        let longest_ns = self.duration_ns() + LONGEST_WAIT_FOR_RUN_NS;
        longest_ns / self.loop_settings.period_ns() + 2
    }

    /// Time simulated after the start of the needle, ns.
    pub fn duration_ns(&self) -> u64 {
        (self.duration_s * 1e9).round() as u64
    }
}
