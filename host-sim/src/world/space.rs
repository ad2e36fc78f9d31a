//! The world in space: a solid body that a needle and one or two paddles move. No I/O, no clock, as in the plane.
//!
//! A [table of states](Tabulated) answers for the tissue at every tick; where it does not reach, the model that it was made of.

use std::sync::Arc;

use model_offline::model::space::SpaceBody;
use model_offline::placement::space::insertion::InsertionModel;
use model_offline::reduction::{Tabulated, TabulatedBody, TabulationOptions, TabulationReport};
use model_offline::solver::equilibrium::NewtonSettings;
use nalgebra::Vector3;

use super::World;
use super::error::WorldError;
use super::needle::NeedleTrajectory;
use super::sensors::TargetSensor;
use super::simulation::Simulation;
use super::tissue::TissueResponse;
use super::truth::{Truth, from_frame};

/// Error of the tabulated tissue that is aimed at, over the target's largest orthogonal displacement.
const TOLERANCE: f64 = 0.01;

/// A body that is tabulated with some paddles attached; insertions into it share the table.
#[derive(Clone, Debug)]
pub struct PreparedBody<'m> {
    model: &'m InsertionModel,
    paddles: Vec<u32>,
    attached: Vec<usize>,
    table: Arc<Tabulated>,
    /// How it was tabulated.
    pub report: TabulationReport,
}

impl<'m> PreparedBody<'m> {
    /// Tabulates the insertion into a model with the paddles of these indices, in the order of the controller's table; they hold the
    /// target where they are steered, else they stay where they rest.
    ///
    /// # Errors
    /// [`WorldError::NoPaddle`], [`WorldError::Tabulation`].
    pub fn new(
        model: &'m InsertionModel,
        paddles: &[u32],
        are_steered: bool,
        threads: usize,
    ) -> Result<Self, WorldError> {
        let place =
            |index: &u32| model.scene().paddle_position(*index).map_err(|_| WorldError::NoPaddle { index: *index });
        let attached = paddles.iter().map(place).collect::<Result<Vec<_>, _>>()?;
        let options = TabulationOptions { tolerance: TOLERANCE, steered: are_steered, threads };
        let (table, report) = Tabulated::learn(model, &attached, &options).map_err(WorldError::Tabulation)?;
        Ok(Self { model, paddles: paddles.to_vec(), attached, table, report })
    }

    /// The model that it was made of.
    pub fn model(&self) -> &'m InsertionModel {
        self.model
    }

    /// Indices of its paddles.
    pub fn paddles(&self) -> &[u32] {
        &self.paddles
    }

    /// The table of its states.
    pub fn table(&self) -> &Arc<Tabulated> {
        &self.table
    }

    /// Its tissue at rest.
    pub fn tissue(&self) -> SpaceTissue<'m> {
        SpaceTissue::new(self.model, &self.attached, &self.table)
    }

    /// A world at rest.
    pub fn world(&self, simulation: &Simulation) -> World<SpaceTissue<'m>, NeedleTrajectory, 3> {
        let target = TargetSensor::of(simulation).quantised(simulation.sensor.quantisation);
        World::with_sensor(self.tissue(), &self.paddles, simulation, target)
    }
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
    pub fn held_against_full(&mut self, truth: &Truth) -> Result<f64, WorldError> {
        let paddles: Vec<Vector3<f64>> =
            truth.paddles.iter().take(self.attached.len()).map(|p| from_frame(*p)).collect();
        Ok((self.step_in_full(truth.depth, &paddles)? - truth.target::<3>()).norm())
    }
}

impl TissueResponse<3> for SpaceTissue<'_> {
    fn step(&mut self, depth: f64, paddles: &[Vector3<f64>]) -> Result<Vector3<f64>, WorldError> {
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
}
