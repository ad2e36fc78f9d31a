//! Options of the simulated world, the same for `run` and `plant`.

use std::path::{Path, PathBuf};

use clap::Args;
use host_sim::SimError;
use host_sim::bench::usage::UsageError;
use host_sim::world::error::OptionRange;
use host_sim::world::loop_settings::{LoopArgs, LoopSettings};
use host_sim::world::needle::NeedleTrajectory;
use host_sim::world::simulation::Simulation;
use host_sim::world::tissue::WantedPlant;
use model_offline::output::csv;
use model_offline::scene::space::{AnyScene, SpaceScene};
use model_offline::scene::{Effect, Motion, Scene, Sensor, SensorPreset};

/// How long a silent peer is waited for.
pub(super) const PATIENCE: OptionRange = OptionRange::new("--patience", 1e-3, 86_400.0, " s");
/// Less is more speed than a table may allow: a hundred depths per second, with what a drive is faster at times.
const INSERTION_TIME: OptionRange = OptionRange::new("--insertion-time", 0.02, 86_400.0, " s");
const WAIT: OptionRange = OptionRange::new("--wait", 0.0, 3600.0, " s");
const STEPS: OptionRange = OptionRange::new("--steps", 1.0, 1000.0, "");
const PAUSE: OptionRange = OptionRange::new("--pause", 0.0, 3600.0, " s");
const DWELL: OptionRange = OptionRange::new("--dwell", 0.0, 3600.0, " s");
const DURATION: OptionRange = OptionRange::new("--duration", 1e-3, 86_400.0, " s");
const PADDLE_LAG: OptionRange = OptionRange::new("--paddle-lag", 0.0, 6e4, " ms");
const PADDLE_DELAY: OptionRange = OptionRange::new("--paddle-delay", 0.0, 1e5, " ticks");
const PADDLE_GAIN: OptionRange = OptionRange::new("--paddle-gain", 0.0, 100.0, "");

/// Ticks of one insertion at most: every one is recorded and kept until the report is written, about 400 bytes each.
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
    /// Time that the needle waits at the skin, s: the patient breathes already, the controller sees it
    #[arg(long, default_value_t = 0.0, value_name = "S")]
    pub(crate) wait: f64,
    /// Steps that the needle goes in, with a pause after each
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub(crate) steps: u32,
    /// Pause between two steps, s
    #[arg(long, default_value_t = 0.5, value_name = "S")]
    pub(crate) pause: f64,
    /// Time that the needle rests at its depth, s
    #[arg(long, default_value_t = 0.0, value_name = "S")]
    pub(crate) dwell: f64,
    /// Draw the needle back in the end, as fast as it came
    #[arg(long)]
    pub(crate) withdraw: bool,
    /// How the needle goes, as recorded: a CSV file of two columns, time in s and depth
    #[arg(long, value_name = "FILE", conflicts_with_all = ["insertion_time", "steps", "pause", "wait"])]
    pub(crate) needle_motion: Option<PathBuf>,
    /// Time simulated from the start of the needle, s [default: all that the needle does, and half a second]
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
    /// tissue that has a past, in lockstep again in full where that was far off]
    #[arg(long, value_enum)]
    pub(crate) plant: Option<WantedPlant>,
    /// Part of its command that the paddle reaches
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR")]
    pub(crate) paddle_gain: f64,
}

/// Seconds of an insertion at the speed of the scene's needle.
fn own_insertion_time(depth: f64, speed: f64) -> f64 {
    const USUAL_S: f64 = 5.0;
    let own_s = depth / speed;
    // The speed of a scene that names none is the depth in five seconds, but for rounding.
    if (own_s - USUAL_S).abs() < 1e-9 { USUAL_S } else { own_s }
}

impl WorldArgs {
    /// Files that are read.
    pub(crate) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.scene.iter().chain(&self.needle_motion)
    }

    /// Reads the scene.
    ///
    /// # Errors
    /// [`SimError::Scene`].
    pub(crate) fn scene(&self) -> Result<Scene, SimError> {
        let path = self.scene.as_deref().unwrap_or(Path::new("paper"));
        let mut scene = Scene::read(path)?;
        scene = self.world.iter().fold(scene, |scene, effect| scene.with_effect(*effect));
        // Friction and relaxation are those of the insertion that is asked for, in the table too.
        if let Some(insertion_s) = self.insertion_time {
            INSERTION_TIME.check(insertion_s)?;
            scene.set_speed(scene.needle.depth / insertion_s);
        } else if self.needle_motion.is_some() {
            let needle = self.needle(scene.needle.depth, scene.needle.speed)?;
            scene.set_speed(needle.depth() / needle.insertion_s());
        }
        Ok(scene)
    }

    /// How the needle goes.
    ///
    /// # Errors
    /// [`SimError::Usage`] names the option.
    fn needle(&self, depth: f64, speed: f64) -> Result<NeedleTrajectory, SimError> {
        DWELL.check(self.dwell)?;
        let inserted = match &self.needle_motion {
            Some(path) => recorded_needle(path, depth)?,
            None => {
                let insertion_s = self.insertion_time.unwrap_or_else(|| own_insertion_time(depth, speed));
                INSERTION_TIME.check(insertion_s)?;
                WAIT.check(self.wait)?;
                STEPS.check(f64::from(self.steps))?;
                PAUSE.check(self.pause)?;
                NeedleTrajectory::in_steps(depth, insertion_s, self.steps, self.pause).after(self.wait)
            }
        };
        let rested = inserted.dwelling(self.dwell);
        Ok(if self.withdraw { rested.withdrawn() } else { rested })
    }

    /// Checks the numbers and combines them with the scene's.
    ///
    /// # Errors
    /// [`SimError::Usage`] names the option.
    pub(crate) fn simulation(&self, scene: &Scene) -> Result<Simulation, SimError> {
        let sensor = self.loop_args.sensor(&scene.sensor, scene.needle.depth, &scene.length_unit)?;
        let loop_settings = self.loop_args.settings(&sensor, &scene.motion)?;
        let simulation = Simulation::new(scene).with_needle(self.needle(scene.needle.depth, scene.needle.speed)?);
        self.over(simulation, sensor, loop_settings)
    }

    /// The scene, where it is one in space.
    ///
    /// # Errors
    /// [`SimError::Scene`], [`SimError::Usage`] for what no world in space has.
    pub(crate) fn scene_in_space(&self) -> Result<Option<SpaceScene>, SimError> {
        let Some(path) = self.scene.as_deref() else { return Ok(None) };
        let AnyScene::Space(mut scene) = AnyScene::read(path)? else { return Ok(None) };
        for (given, option) in [(!self.world.is_empty(), "--world"), (self.plant.is_some(), "--plant")] {
            if given {
                return Err(UsageError::NotInSpace { option: option.to_owned() }.into());
            }
        }
        if let Some(insertion_s) = self.insertion_time {
            INSERTION_TIME.check(insertion_s)?;
            scene.needle.speed = scene.needle.depth / insertion_s;
        }
        Ok(Some(*scene))
    }

    /// As [`simulation`](Self::simulation), in space.
    ///
    /// # Errors
    /// [`SimError::Usage`] names the option.
    pub(crate) fn simulation_in_space(&self, scene: &SpaceScene) -> Result<Simulation, SimError> {
        let (depth, unit) = (scene.needle.depth, &scene.length_unit);
        // A preset of the unit is always known.
        let own = SensorPreset::of_unit(unit).sensor(depth, unit)?;
        let sensor = self.loop_args.sensor(&own, depth, unit)?;
        let loop_settings = self.loop_args.settings(&sensor, &Motion::default())?;
        let needle = self.needle(depth, scene.needle.speed)?;
        let simulation = Simulation::in_space(scene, sensor).with_needle(needle);
        self.over(simulation, sensor, loop_settings)
    }

    fn over(
        &self,
        mut simulation: Simulation,
        sensor: Sensor,
        loop_settings: LoopSettings,
    ) -> Result<Simulation, SimError> {
        PADDLE_LAG.check(self.paddle_lag)?;
        PADDLE_DELAY.check(f64::from(self.paddle_delay))?;
        PADDLE_GAIN.check(self.paddle_gain)?;
        simulation.duration_s = self.duration.unwrap_or(simulation.duration_s);
        DURATION.check(simulation.duration_s)?;
        let (duration_s, wait_s) = (simulation.duration_s, simulation.needle.wait_s());
        if duration_s <= wait_s {
            return Err(UsageError::OnlyWaits { duration_s, wait_s }.into());
        }
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

/// Reads a recorded needle that goes no deeper than the scene's.
fn recorded_needle(path: &Path, depth: f64) -> Result<NeedleTrajectory, UsageError> {
    let file = path.to_path_buf();
    let rows = csv::rows::<(f64, f64)>(path).map_err(|source| UsageError::NeedleFile { file: file.clone(), source })?;
    if let Some((k, row)) = rows.iter().enumerate().find(|(_, row)| row.1 > depth * (1.0 + 1e-9)) {
        return Err(UsageError::NeedleTooDeep { file, row: k + 1, depth: row.1, most: depth });
    }
    NeedleTrajectory::recorded(&rows).map_err(|source| UsageError::NeedleMotion { file, source })
}
