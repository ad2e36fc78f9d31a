//! The closed loop on a linear plant, and one fault at a time.

use nalgebra::{Matrix2, Vector2};
use proptest::prelude::*;

use super::plant::{MS, Plant};
use super::*;
use crate::contract::example::{jacobian, table};
use crate::contract::frames::{from_plane, to_plane};
use crate::contract::{Table, TargetSample};
use crate::detection::{MAX_SUCCESSIVE_OVERRUNS, TICKS_TO_HOLD};
use crate::inputs::Discard;
use crate::loop_stability;

mod attacks;
mod bits;
mod control;
mod faults;
pub(super) mod space;

fn settings() -> Settings {
    Settings::new(MS, 20 * MS, 20 * MS)
}

/// Controller, state and plant, with every command checked against the limits.
struct Loop<'t> {
    controller: Controller<'t, f64>,
    state: State<f64>,
    plant: Plant,
    last: Option<PaddleCommand>,
    /// Largest orthogonal error so far.
    worst: f64,
}

impl<'t> Loop<'t> {
    fn new(table: &'t Table<f64>, settings: &Settings) -> Self {
        let controller = Controller::new(table, settings).unwrap();
        Self { controller, state: State::new(), plant: Plant::new(), last: None, worst: 0.0 }
    }

    /// One tick with the inputs changed by `fault`.
    fn tick(&mut self, fault: impl FnOnce(&mut Inputs)) -> PaddleCommand {
        let mut inputs = self.plant.sense();
        fault(&mut inputs);
        let command = self.controller.step(&mut self.state, &inputs);
        let displacement = Vector2::from(to_plane(command.displacement[0]));
        assert!(displacement.norm() <= 0.05 * (1.0 + 1e-12));
        // A command that is not valid is none: the actuator keeps its position, wherever that is.
        if let Some(last) = self.last.filter(|last| last.is_valid() && command.is_valid()) {
            assert!((displacement - Vector2::from(to_plane(last.displacement[0]))).norm() <= 1e-4 * (1.0 + 1e-9));
        }
        assert_eq!(self.state.ledger().unaccounted(), 0);
        self.plant.act(&command);
        self.last = Some(command);
        self.worst = self.worst.max(self.plant.target().x.abs());
        command
    }

    fn run(&mut self, ticks: usize) -> &mut Self {
        for _ in 0..ticks {
            self.tick(|_| {});
        }
        self
    }

    /// Ticks until SAFE under a lasting fault, at most 2000.
    fn until_safe(&mut self, fault: impl Fn(&mut Inputs)) -> Option<usize> {
        (0..2000).find(|_| self.tick(&fault).state == Mode::Safe as u32)
    }
}
