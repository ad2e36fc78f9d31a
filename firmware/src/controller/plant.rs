//! A linear plant for tests.

use nalgebra::{Matrix2, Vector2};

use crate::contract::example::jacobian;
use crate::contract::frames::{TARGET_VISIBLE, from_plane, to_plane};
use crate::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};
use crate::inputs::Inputs;

/// 1 ms: the loop period of the tests.
pub(crate) const MS: u64 = 1_000_000;

/// A linear plant with sensors: y = J·u + n·push(z) + axial, paddle one tick behind its command, target sampled every
/// 20 ms (unless changed) and 20 ms old on arrival.
pub(crate) struct Plant {
    pub(crate) jacobian: Matrix2<f64>,
    /// Sideways push per unit of depth; the table assumes 0.02.
    pub(crate) push: f64,
    /// Constant sideways displacement, unknown to the table.
    pub(crate) offset: f64,
    pub(crate) speed: f64,
    pub(crate) depth: f64,
    pub(crate) paddle: Vector2<f64>,
    /// Part of its command that the actuator reaches.
    pub(crate) actuator_gain: f64,
    pub(crate) tick: u64,
    pub(crate) sequence: u32,
    pub(crate) paddle_index: u32,
    /// Target period, ticks.
    pub(crate) target_period: u64,
    pending: std::collections::VecDeque<TargetSample>,
    target_sequence: u32,
}

impl Plant {
    pub(crate) fn new() -> Self {
        Self {
            jacobian: jacobian(),
            push: 0.02,
            offset: 0.0,
            speed: 0.02,
            depth: 0.0,
            paddle: Vector2::zeros(),
            actuator_gain: 1.0,
            tick: 0,
            sequence: 0,
            paddle_index: 3,
            target_period: 20,
            pending: std::collections::VecDeque::new(),
            target_sequence: 0,
        }
    }

    pub(crate) fn target(&self) -> Vector2<f64> {
        self.jacobian * self.paddle + Vector2::new(self.push * self.depth + self.offset, -0.1 * self.depth)
    }

    /// Inputs of the next tick.
    pub(crate) fn sense(&mut self) -> Inputs {
        let time_ns = self.tick * MS;
        if self.tick.is_multiple_of(self.target_period) {
            self.pending.push_back(TargetSample {
                sequence: self.target_sequence,
                flags: TARGET_VISIBLE,
                time_ns,
                displacement: from_plane(self.target().into()),
            });
            self.target_sequence = self.target_sequence.wrapping_add(1);
        }
        let arrived = self.pending.front().is_some_and(|sample| sample.time_ns + 20 * MS <= time_ns);
        let inputs = Inputs {
            tick: self.tick,
            time_ns,
            needle: Some(NeedleSample {
                sequence: self.sequence,
                reserved: 0,
                time_ns,
                depth: self.depth,
                velocity: self.speed,
            }),
            target: if arrived { self.pending.pop_front() } else { None },
            paddles: [
                Some(PaddleSample {
                    sequence: self.sequence,
                    paddle_index: self.paddle_index,
                    time_ns,
                    displacement: from_plane(self.paddle.into()),
                }),
                None,
            ],
        };
        self.tick += 1;
        self.sequence = self.sequence.wrapping_add(1);
        inputs
    }

    /// Time goes on by one tick under `command`.
    pub(crate) fn act(&mut self, command: &PaddleCommand) {
        if command.is_valid() {
            self.paddle = Vector2::from(to_plane(command.displacement[0])) * self.actuator_gain;
        }
        self.depth = (self.depth + self.speed * 1e-3).clamp(0.0, 0.1);
        if self.depth >= 0.1 {
            self.speed = 0.0;
        }
    }
}
