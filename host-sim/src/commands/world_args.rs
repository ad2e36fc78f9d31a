//! Options of the simulated world, the same for `run` and `plant`.

use std::path::{Path, PathBuf};

use clap::Args;
use host_sim::SimError;
use host_sim::bench::usage::UsageError;
use host_sim::world::error::OptionRange;
use host_sim::world::loop_settings::LoopArgs;
use host_sim::world::simulation::Simulation;
use host_sim::world::tissue::WantedPlant;
use model_offline::scene::{Effect, Scene};

/// How long a silent peer is waited for.
pub(super) const PATIENCE: OptionRange = OptionRange::new("--patience", 1e-3, 86_400.0, " s");
const INSERTION_TIME: OptionRange = OptionRange::new("--insertion-time", 1e-3, 86_400.0, " s");
const DURATION: OptionRange = OptionRange::new("--duration", 1e-3, 86_400.0, " s");
const PADDLE_LAG: OptionRange = OptionRange::new("--paddle-lag", 0.0, 6e4, " ms");
const PADDLE_DELAY: OptionRange = OptionRange::new("--paddle-delay", 0.0, 1e5, " ticks");
const PADDLE_GAIN: OptionRange = OptionRange::new("--paddle-gain", 0.0, 100.0, "");

/// Ticks of one insertion at most: every one is recorded and kept until the report is written, 300 bytes each.
const MOST_TICKS: f64 = 1e7;

/// Options of the simulated world.
#[derive(Args, Clone, Debug)]
pub(crate) struct WorldArgs {
    /// Scene file, or the name of a bundled scene [default: paper]
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: Option<PathBuf>,
    /// What the world does that the scene does not say: the needle punctures, cuts and slips; stress relaxes; the patient
    /// breathes
    #[arg(long, value_enum, value_delimiter = ',', value_name = "EFFECT,..")]
    pub(crate) world: Vec<Effect>,
    /// Rates, and what sees the target.
    #[command(flatten)]
    pub(crate) loop_args: LoopArgs,
    /// Duration of the insertion, s [default: at the speed of the scene's needle, 5 where it names none]
    #[arg(long, value_name = "S")]
    pub(crate) insertion_time: Option<f64>,
    /// Time simulated from the start of the needle, s [default: the insertion and half a second]
    #[arg(long, value_name = "S")]
    pub(crate) duration: Option<f64>,
    /// Seed of the sensors' noise
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Time constant of the paddle's lag, ms
    #[arg(long, default_value_t = 0.0, value_name = "MS")]
    pub(crate) paddle_lag: f64,
    /// Ticks that a command waits before the paddle acts
    #[arg(long, default_value_t = 0, value_name = "TICKS")]
    pub(crate) paddle_delay: u32,
    /// What answers for the tissue at every tick [default: full; reduced in free-run where full cannot keep the period, and for
    /// tissue that has a past]
    #[arg(long, value_enum)]
    pub(crate) plant: Option<WantedPlant>,
    /// Part of its command that the paddle reaches
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR")]
    pub(crate) paddle_gain: f64,
}

/// Seconds of an insertion at the speed of the scene's needle.
fn own_insertion_time(scene: &Scene) -> f64 {
    const USUAL_S: f64 = 5.0;
    let own_s = scene.needle.depth / scene.needle.speed;
    // The speed of a scene that names none is the depth in five seconds, but for rounding.
    if (own_s - USUAL_S).abs() < 1e-9 { USUAL_S } else { own_s }
}

impl WorldArgs {
    /// Reads the scene.
    ///
    /// # Errors
    /// [`SimError::Scene`].
    pub(crate) fn scene(&self) -> Result<Scene, SimError> {
        let path = self.scene.as_deref().unwrap_or(Path::new("paper"));
        let mut scene = Scene::read(path)?;
        scene = self.world.iter().fold(scene, |scene, effect| scene.with_effect(*effect));
        if let Some(insertion_s) = self.insertion_time {
            INSERTION_TIME.check(insertion_s)?;
            // Friction and relaxation are those of the insertion that is asked for, in the table too.
            scene.set_speed(scene.needle.depth / insertion_s);
        }
        Ok(scene)
    }

    /// Checks the numbers and combines them with the scene's.
    ///
    /// # Errors
    /// [`SimError::Usage`] names the option.
    pub(crate) fn simulation(&self, scene: &Scene) -> Result<Simulation, SimError> {
        let sensor = self.loop_args.sensor(&scene.sensor, scene.needle.depth, &scene.length_unit)?;
        let loop_settings = self.loop_args.settings(&sensor)?;
        let insertion_s = self.insertion_time.unwrap_or_else(|| own_insertion_time(scene));
        INSERTION_TIME.check(insertion_s)?;
        PADDLE_LAG.check(self.paddle_lag)?;
        PADDLE_DELAY.check(f64::from(self.paddle_delay))?;
        PADDLE_GAIN.check(self.paddle_gain)?;
        let mut simulation = Simulation::new(scene).with_insertion(insertion_s);
        simulation.duration_s = self.duration.unwrap_or(simulation.duration_s);
        DURATION.check(simulation.duration_s)?;
        let ticks = simulation.duration_s * loop_settings.rate;
        if ticks > MOST_TICKS {
            let (duration_s, rate_hz) = (simulation.duration_s, loop_settings.rate);
            return Err(UsageError::TooManyTicks { duration_s, rate_hz, ticks, most: MOST_TICKS }.into());
        }
        simulation.loop_settings = loop_settings;
        simulation.sensor = sensor;
        simulation.actuator.lag_s = self.paddle_lag * 1e-3;
        simulation.actuator.delay_ticks = self.paddle_delay;
        simulation.actuator.gain = self.paddle_gain;
        simulation.seed = self.seed;
        simulation.plant = self.plant;
        Ok(simulation)
    }
}
