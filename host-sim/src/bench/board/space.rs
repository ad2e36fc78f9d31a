//! What the image of two paddles in space is measured with: linear tissue that two paddles hold, and what may go wrong.
//!
//! The tissue is that of no scene: Jacobians of two paddles on two sides, the needle along −y, and a target that is dragged
//! along and aside.

use std::collections::VecDeque;

use firmware::contract::frames::TARGET_VISIBLE;
use firmware::contract::{
    Gains, Knot, NeedleSample, Paddle, PaddleCommand, PaddleSample, SpatialTable, TargetSample, Units, Validity,
};
use firmware::{Controller, Direction, Inputs, Settings, State};
use nalgebra::{Matrix3, Matrix3x2, Rotation3, Vector3};

use super::measure::Scenario;

const MS: u64 = 1_000_000;
/// Depth of the table, length, and knots in it.
const DEPTH: f64 = 0.1;
const KNOTS: u32 = 21;
/// The insertion takes 2 s.
const SPEED: f64 = 0.05;
/// Displacement of the target per depth without the paddles.
const DRAG: Vector3<f64> = Vector3::new(0.02, -0.1, -0.01);
/// What each paddle may do: length, and length/s.
const LIMIT: f64 = 0.05;
const RATE: f64 = 0.1;
/// Ticks of each scenario.
const TICKS: u64 = 2600;

fn jacobians() -> [Matrix3<f64>; 2] {
    let first = Matrix3::new(0.30, 0.05, 0.02, -0.04, 0.25, 0.03, 0.01, -0.06, 0.20);
    [first, Rotation3::from_axis_angle(&Vector3::y_axis(), 1.2).matrix() * first * 0.8]
}

/// A table of that tissue whose paddles may go this far, length.
pub fn table(limit: f64) -> SpatialTable<f64, 2> {
    let orthogonal = Matrix3x2::from_columns(&[Vector3::x(), Vector3::z()]);
    let directions = Direction::MinimumNorm.solve(&jacobians(), &orthogonal, &[1.0; 2]);
    let slopes = directions.map(|direction| -(direction * orthogonal.tr_mul(&DRAG)));
    let moved = slopes.iter().zip(jacobians()).fold(DRAG, |moved, (slope, jacobian)| moved + jacobian * slope);
    let slope = Matrix3x2::from_columns(&slopes);
    let knot = |i: u32| {
        let depth = DEPTH * f64::from(i) / f64::from(KNOTS - 1);
        Knot {
            depth,
            jacobian: jacobians(),
            paddle_path: slope * depth,
            paddle_path_slope: slope,
            target_displacement: moved * depth,
            target_displacement_slope: moved,
            static_target_displacement: DRAG * depth,
        }
    };
    let paddle = |index: u32, side: f64| {
        let centre = Vector3::new(side, 0.3, 0.1);
        let extent = [centre.add_scalar(-0.02), centre.add_scalar(0.02)];
        Paddle { index, extent, max_displacement: limit, max_rate: RATE }
    };
    SpatialTable {
        scene_hash: [0; 32],
        units: Units::default(),
        tissue: Default::default(),
        paddles: [paddle(3, 0.2), paddle(6, 0.8)],
        needle_axis: -Vector3::y(),
        orthogonal,
        target_position: Vector3::new(0.5, 0.5, 0.0),
        validity: Validity { depth_start: 0.0, depth_end: DEPTH, paddle_displacement: LIMIT, needle_speed: 0.1 },
        gains: Gains { loop_gain: 0.25, delay_samples: 1, lambda_max: 1.0 },
        knots: (0..KNOTS).map(knot).collect(),
    }
}

/// Insertions that reach every branch of the step.
pub fn scenarios() -> Vec<Scenario<3, 2, 2>> {
    let settings = Settings::new(MS, 20 * MS, 20 * MS);
    let plain = |name, fault: &dyn Fn(u64, &mut Inputs)| inserted(name, table(LIMIT), settings, 1.3, fault);
    // The second paddle has to take over, and more than both can give is asked of them.
    let mut weak = table(0.009);
    weak.validity.paddle_displacement = LIMIT;
    vec![
        plain("insertion with two paddles", &|_, _| {}),
        inserted("paddles too weak", weak, settings, 2.5, &|_, _| {}),
        plain("second paddle lost", &|tick, inputs| {
            if tick > 600 && tick % 300 < 100 {
                inputs.paddles[1] = None;
            }
        }),
        plain("wrong second paddle attached", &|tick, inputs| {
            if let (true, Some(paddle)) = (tick > 600, &mut inputs.paddles[1]) {
                paddle.paddle_index += 1;
            }
        }),
        plain("needle deeper than the table", &|_, inputs| {
            if let Some(needle) = &mut inputs.needle {
                (needle.depth, needle.velocity) = (1.1 * needle.depth, 1.1 * needle.velocity);
            }
        }),
    ]
}

/// What a controller is given while it holds tissue that drags `harder` than the table says.
fn inserted(
    name: &'static str,
    table: SpatialTable<f64, 2>,
    settings: Settings,
    harder: f64,
    fault: &dyn Fn(u64, &mut Inputs),
) -> Scenario<3, 2, 2> {
    let mut inputs = Vec::new();
    // Valid by construction; without a controller there is nothing to measure.
    if let Ok(controller) = Controller::new(&table, &settings) {
        let mut state = State::new();
        let mut world = Linear { harder, ..Linear::default() };
        for tick in 0..TICKS {
            let mut given = world.sense(tick, &table);
            fault(tick, &mut given);
            world.act(&controller.step(&mut state, &given));
            inputs.push(given);
        }
    }
    Scenario { name, table, settings, inputs }
}

/// The tissue with its sensors: exact, and the target's 20 ms old.
#[derive(Default)]
struct Linear {
    harder: f64,
    paddles: [Vector3<f64>; 2],
    depth: f64,
    speed: f64,
    seen: VecDeque<TargetSample>,
}

impl Linear {
    fn sense(&mut self, tick: u64, table: &SpatialTable<f64, 2>) -> Inputs {
        let (time_ns, sequence) = (tick * MS, tick as u32);
        if tick.is_multiple_of(20) {
            let dragged = DRAG * (self.harder * self.depth);
            let moved = self.paddles.iter().zip(jacobians()).fold(dragged, |sum, (u, jacobian)| sum + jacobian * u);
            let sample =
                TargetSample { sequence: sequence / 20, flags: TARGET_VISIBLE, time_ns, displacement: moved.into() };
            self.seen.push_back(sample);
        }
        let arrived = self.seen.front().is_some_and(|sample| sample.time_ns + 20 * MS <= time_ns);
        let paddle = |place: usize| PaddleSample {
            sequence,
            paddle_index: table.paddles[place].index,
            time_ns,
            displacement: self.paddles[place].into(),
        };
        Inputs {
            tick,
            time_ns,
            needle: Some(NeedleSample { sequence, reserved: 0, time_ns, depth: self.depth, velocity: self.speed }),
            paddles: [Some(paddle(0)), Some(paddle(1))],
            target: if arrived { self.seen.pop_front() } else { None },
        }
    }

    /// A period passes; the needle starts with RUN, and stops at the end of the table.
    fn act(&mut self, command: &PaddleCommand) {
        if command.is_valid() {
            self.paddles = command.displacement.map(Vector3::from);
        }
        if command.state == firmware::Mode::Run as u32 && self.depth == 0.0 {
            self.speed = SPEED;
        }
        self.depth = (self.depth + self.speed * 1e-3).min(DEPTH);
        if self.depth >= DEPTH {
            self.speed = 0.0;
        }
    }
}
