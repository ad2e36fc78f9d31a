//! The world in space: a solid body that a needle and one or two paddles move. No I/O, no clock, as in the plane.
//!
//! A [table of states](Tabulated) answers for the tissue at every tick; where it does not reach, the model that it was made of.

use std::sync::Arc;

use firmware::contract::frames::MAX_PADDLES;
use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample};
use firmware::{Inputs, Mode};
use model_offline::model::space::SpaceBody;
use model_offline::placement::space::insertion::InsertionModel;
use model_offline::reduction::{Tabulated, TabulatedBody};
use model_offline::solver::equilibrium::NewtonSettings;
use nalgebra::Vector3;

use super::actuator::PaddleActuator;
use super::error::WorldError;
use super::needle::{NeedleDrive, NeedleStart};
use super::sensors::{TargetSensor, to_frame};
use super::simulation::Simulation;

/// What really happens at a tick, which the controller does not see.
#[derive(Clone, Debug, PartialEq)]
pub struct SpaceTruth {
    /// Tick of the plant.
    pub tick: u64,
    /// Time of that tick, ns.
    pub time_ns: u64,
    /// Needle depth, length.
    pub depth: f64,
    /// Target displacement, length.
    pub target: Vector3<f64>,
    /// Displacement of every attached paddle, length.
    pub paddles: Vec<Vector3<f64>>,
}

/// A solid body with attached paddles.
#[derive(Debug)]
pub struct SpaceTissue<'m> {
    model: &'m InsertionModel,
    attached: Vec<usize>,
    body: TabulatedBody,
    /// Made when it is first needed.
    full: Option<Box<SpaceBody<'m>>>,
    /// Steps that the full model answered.
    pub fallbacks: u64,
    /// Why, the first time.
    pub first_fallback: Option<String>,
    /// Largest error of the target displacement that the table estimated of itself, length.
    pub largest_estimate: f64,
}

impl<'m> SpaceTissue<'m> {
    /// Tissue at rest, by a table of this model with these paddles attached (places in the scene's list).
    pub fn new(model: &'m InsertionModel, attached: &[usize], table: &Arc<Tabulated>) -> Self {
        Self {
            model,
            attached: attached.to_vec(),
            body: table.body(),
            full: None,
            fallbacks: 0,
            first_fallback: None,
            largest_estimate: 0.0,
        }
    }

    /// Takes needle and paddles to where they are now; returns the target displacement, length.
    ///
    /// # Errors
    /// [`WorldError::Tissue`] when there is no equilibrium.
    pub fn step(&mut self, depth: f64, paddles: &[Vector3<f64>]) -> Result<Vector3<f64>, WorldError> {
        match self.body.drive(depth, paddles) {
            Ok(()) => {
                self.largest_estimate = self.largest_estimate.max(self.body.error_estimate());
                Ok(self.body.target_displacement())
            }
            Err(reason) => {
                self.fallbacks += 1;
                self.first_fallback.get_or_insert_with(|| reason.to_string());
                self.step_in_full(depth, paddles)
            }
        }
    }

    fn step_in_full(&mut self, depth: f64, paddles: &[Vector3<f64>]) -> Result<Vector3<f64>, WorldError> {
        let failed = |source| WorldError::Tissue { depth, source };
        let mut full = match self.full.take() {
            Some(full) => full,
            None => {
                let body = self.model.body(&self.attached, NewtonSettings::default());
                Box::new(body.map_err(|error| WorldError::Tabulation(error.into()))?)
            }
        };
        full.drive(depth, paddles).map_err(failed)?;
        let target = full.target_displacement();
        self.full = Some(full);
        Ok(target)
    }

    /// Distance of the table's target displacement from that of the model that it was made of, at this state, length.
    ///
    /// # Errors
    /// [`WorldError::Tissue`].
    pub fn held_against_full(&mut self, truth: &SpaceTruth) -> Result<f64, WorldError> {
        Ok((self.step_in_full(truth.depth, &truth.paddles)? - truth.target).norm())
    }
}

/// The simulated world in space.
#[derive(Debug)]
pub struct SpaceWorld<'m, N> {
    /// The tissue.
    pub tissue: SpaceTissue<'m>,
    drive: N,
    actuators: Vec<PaddleActuator<3>>,
    indices: Vec<u32>,
    target_sensor: TargetSensor<3>,
    sequence: u32,
    /// When the needle started: for the first RUN, or for nobody where there is no controller.
    pub started: NeedleStart,
}

impl<'m, N: NeedleDrive + Clone> SpaceWorld<'m, N> {
    /// A world at rest whose paddles have these indices.
    pub fn new(tissue: SpaceTissue<'m>, drive: &N, indices: &[u32], simulation: &Simulation) -> Self {
        let settings = simulation.loop_settings.settings(simulation.depth);
        let noise = simulation.loop_settings.noise_for(simulation.depth);
        Self {
            tissue,
            drive: drive.clone(),
            actuators: indices.iter().map(|_| PaddleActuator::new(simulation.actuator)).collect(),
            indices: indices.to_vec(),
            target_sensor: TargetSensor::new(
                settings.target_period_ns,
                settings.target_latency_ns,
                noise,
                simulation.seed,
            )
            .quantised(simulation.sensor.quantisation),
            sequence: 0,
            started: NeedleStart::default(),
        }
    }

    /// One tick: time goes on by a period under `command`, the first RUN starts the needle, and every sensor is read. Returns what is
    /// true then, and what the controller is given.
    ///
    /// # Errors
    /// [`WorldError::Tissue`].
    pub fn tick(
        &mut self,
        tick: u64,
        command: Option<&PaddleCommand>,
        period_ns: u64,
    ) -> Result<(SpaceTruth, Inputs), WorldError> {
        let time_ns = tick * period_ns;
        if command.is_some_and(|command| command.state == Mode::Run as u32) {
            // The command is the answer to the tick before.
            self.started.at(time_ns.saturating_sub(period_ns));
        }
        let command = command.filter(|command| command.is_valid());
        for (place, actuator) in self.actuators.iter_mut().enumerate() {
            let goal = command.map(|command| Vector3::from(command.displacement[place]));
            actuator.advance(goal, period_ns as f64 * 1e-9);
        }
        let needle = self.drive.motion(self.started.since_s(time_ns));
        let paddles: Vec<Vector3<f64>> = self.actuators.iter().map(PaddleActuator::position).collect();
        let target = self.tissue.step(needle.depth, &paddles)?;
        self.target_sensor.measure(time_ns, &target);
        let mut newest = None;
        while let Some(sample) = self.target_sensor.arrived(time_ns) {
            newest = Some(sample);
        }
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        let mut samples = [None; MAX_PADDLES];
        for ((sample, paddle), &paddle_index) in samples.iter_mut().zip(&paddles).zip(&self.indices) {
            *sample = Some(PaddleSample { sequence, paddle_index, time_ns, displacement: to_frame(paddle) });
        }
        let inputs = Inputs {
            tick,
            time_ns,
            needle: Some(NeedleSample {
                sequence,
                reserved: 0,
                time_ns,
                depth: needle.depth,
                velocity: needle.velocity,
            }),
            target: newest,
            paddles: samples,
        };
        Ok((SpaceTruth { tick, time_ns, depth: needle.depth, target, paddles }, inputs))
    }
}
