//! A small table and frames for tests.

use nalgebra::{Matrix2, Vector2};

use crate::contract::frames::TARGET_VISIBLE;
use crate::contract::{
    Gains, Knot, NeedleSample, Paddle, PaddleCommand, PaddleSample, Table, TargetSample, Units, Validity,
};
use crate::inputs::Inputs;

/// Jacobian of [`table`]: well-conditioned and not symmetric.
pub(crate) fn jacobian() -> Matrix2<f64> {
    Matrix2::new(0.30, 0.05, -0.04, 0.25)
}

/// Needle down, depth 0 to 0.1, the target pushed sideways by 0.02 per unit of depth without the paddle.
pub(crate) fn table() -> Table<f64, 2> {
    let n = Vector2::new(1.0, 0.0);
    let inverse = jacobian().try_inverse().unwrap();
    let knots = (0..=10)
        .map(|i| {
            let depth = 0.1 * f64::from(i) / 10.0;
            let slope = -(inverse * n) * 0.02;
            let axial = Vector2::new(0.0, -0.1 * depth);
            Knot {
                depth,
                jacobian: jacobian(),
                paddle_path: slope * depth,
                paddle_path_slope: slope,
                target_displacement: axial,
                target_displacement_slope: Vector2::new(0.0, -0.1),
                static_target_displacement: axial + n * 0.02 * depth,
            }
        })
        .collect();
    Table {
        scene_hash: [7; 32],
        units: Units { length: "1".try_into().unwrap(), stress: "1".try_into().unwrap() },
        tissue: "homogeneous".try_into().unwrap(),
        paddle: Paddle {
            index: 3,
            segment: [Vector2::new(0.2, 0.3), Vector2::new(0.1, 0.4)],
            max_displacement: 0.05,
            max_rate: 0.1,
        },
        needle_axis: Vector2::new(0.0, -1.0),
        orthogonal: n,
        target_position: Vector2::new(0.5, 0.5),
        validity: Validity { depth_start: 0.0, depth_end: 0.1, paddle_displacement: 0.05, needle_speed: 0.1 },
        gains: Gains { loop_gain: 0.25, delay_samples: 1, lambda_max: 1.0 },
        knots,
    }
}

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
                displacement: self.target().into(),
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
            paddle: Some(PaddleSample {
                sequence: self.sequence,
                paddle_index: self.paddle_index,
                time_ns,
                displacement: self.paddle.into(),
            }),
        };
        self.tick += 1;
        self.sequence = self.sequence.wrapping_add(1);
        inputs
    }

    /// Time goes on by one tick under `command`.
    pub(crate) fn act(&mut self, command: &PaddleCommand) {
        if command.is_valid() {
            self.paddle = Vector2::from(command.displacement) * self.actuator_gain;
        }
        self.depth = (self.depth + self.speed * 1e-3).clamp(0.0, 0.1);
        if self.depth >= 0.1 {
            self.speed = 0.0;
        }
    }
}
