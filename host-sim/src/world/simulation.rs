//! The numbers of a simulation.

use model_offline::scene::space::SpaceScene;
use model_offline::scene::{Scene, Sensor};

use super::actuator::ActuatorModel;
use super::loop_settings::{FeedbackLaw, LoopSettings};
use super::needle::NeedleTrajectory;
use super::tissue::WantedPlant;

/// The controller needs one target sample to arrive; everything longer is a fault of the set-up.
pub const LONGEST_WAIT_FOR_RUN_NS: u64 = 2_000_000_000;

/// Time simulated after the needle has arrived, s: long enough for the feedback to remove what is left.
const SETTLE_S: f64 = 0.5;

/// Numbers of a simulation.
///
/// ```
/// use host_sim::Simulation;
/// use model_offline::scene::Scene;
///
/// let scene = Scene::bundled("paper").expect("it comes with the program");
/// let slow = Simulation::new(&scene).with_insertion(10.0);
/// assert_eq!((slow.needle.insertion_s(), slow.duration_s), (10.0, 10.5));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Simulation {
    /// Rates, latency, noise.
    pub loop_settings: LoopSettings,
    /// What sees the target; its rate, latency, and noise are those of the loop's settings.
    pub sensor: Sensor,
    /// How the needle goes.
    pub needle: NeedleTrajectory,
    /// Time simulated after the start of the needle, s.
    pub duration_s: f64,
    /// Depth of the insertion, length.
    pub depth: f64,
    /// The paddle's actuator.
    pub actuator: ActuatorModel,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// What answers for the tissue; none: the full model, or the reduced one where the clock drives time and the full
    /// one cannot keep the period.
    pub plant: Option<WantedPlant>,
}

impl Simulation {
    /// An insertion to the scene's depth in 5 s, seen by the scene's sensor, with a servo that follows at the scene's largest rate.
    pub fn new(scene: &Scene) -> Self {
        let actuator = ActuatorModel { max_rate: scene.actuator.max_rate, lag_s: 0.0, delay_ticks: 0, gain: 1.0 };
        let feedback = FeedbackLaw::for_patient(&scene.motion);
        let loop_settings = LoopSettings { feedback, ..LoopSettings::of(&scene.sensor) };
        let sensor = scene.sensor;
        let depth = scene.needle.depth;
        let needle = NeedleTrajectory::new(depth, 5.0);
        let duration_s = needle.end_s() + SETTLE_S;
        Self { loop_settings, sensor, needle, duration_s, depth, actuator, seed: 1, plant: None }
    }

    /// The same on a body in space, seen by this sensor.
    pub fn in_space(scene: &SpaceScene, sensor: Sensor) -> Self {
        let actuator = ActuatorModel { max_rate: scene.actuator.max_rate, lag_s: 0.0, delay_ticks: 0, gain: 1.0 };
        let depth = scene.needle.depth;
        let needle = NeedleTrajectory::new(depth, 5.0);
        let duration_s = needle.end_s() + SETTLE_S;
        Self {
            loop_settings: LoopSettings::of(&sensor),
            sensor,
            needle,
            duration_s,
            depth,
            actuator,
            seed: 1,
            plant: None,
        }
    }

    /// The same in so many seconds, with half a second for what is left then.
    #[must_use]
    pub fn with_insertion(self, insertion_s: f64) -> Self {
        let needle = NeedleTrajectory::new(self.depth, insertion_s);
        self.with_needle(needle)
    }

    /// The same with a needle that goes another way, with half a second for what is left then.
    #[must_use]
    pub fn with_needle(self, needle: NeedleTrajectory) -> Self {
        Self { duration_s: needle.end_s() + SETTLE_S, needle, ..self }
    }

    /// Largest speed of the needle, length/s.
    pub fn needle_speed(&self) -> f64 {
        self.needle.speed()
    }

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
