//! Space, and two paddles: against closed forms, the plane, and what symmetry demands.

use nalgebra::{Matrix3, Matrix3x2, Rotation3, SMatrix, SVector, Vector3};

use super::*;
use crate::contract::frames::{MAX_DIMENSION, TARGET_VISIBLE};
use crate::contract::{Gains, Knot, NeedleSample, Paddle, PaddleSample, SpatialTable, Units, Validity};
use crate::controller::feedback::Setting;
use crate::law::{Direction, Feedback};
use crate::scalar::Scalar;

/// Depth of the table, fastest needle in it, and what the target is pushed by along each direction per depth.
const DEPTH: f64 = 0.1;
const SPEED: f64 = 0.02;

/// What the tissue is like: the needle along −y, and Jacobians that do not depend on the depth.
#[derive(Clone)]
struct Tissue<const D: usize, const N: usize, const P: usize> {
    axis: SVector<f64, D>,
    orthogonal: SMatrix<f64, D, N>,
    jacobians: [SMatrix<f64, D, D>; P],
    /// Displacement of the target per depth, without the paddles.
    drag: SVector<f64, D>,
    limits: [f64; P],
}

impl<const D: usize, const N: usize, const P: usize> Tissue<D, N, P> {
    /// The table that knows it, made with this direction.
    fn table(&self, direction: Direction) -> Table<f64, D, N, P> {
        let weights = crate::contract::relative_weights(&self.limits);
        let directions = direction.solve(&self.jacobians, &self.orthogonal, &weights);
        let across = self.orthogonal.transpose() * self.drag;
        let mut slope = SMatrix::<f64, D, P>::zeros();
        let mut moved = self.drag;
        for (place, (direction, jacobian)) in directions.iter().zip(&self.jacobians).enumerate() {
            let column = -(direction * across);
            slope.set_column(place, &column);
            moved += jacobian * column;
        }
        let knot = |i: u32| {
            let depth = DEPTH * f64::from(i) / 10.0;
            Knot {
                depth,
                jacobian: self.jacobians,
                paddle_path: slope * depth,
                paddle_path_slope: slope,
                target_displacement: moved * depth,
                target_displacement_slope: moved,
                static_target_displacement: self.drag * depth,
            }
        };
        let place = SVector::from_fn(|i, _| 0.2 + 0.1 * i as f64);
        let paddle = |place_in_table: usize| Paddle {
            index: 3 + 4 * place_in_table as u32,
            extent: [place, place * 1.1],
            max_displacement: self.limits[place_in_table],
            max_rate: 0.1,
        };
        let table = Table {
            scene_hash: [7; 32],
            units: Units { length: "1".try_into().unwrap(), stress: "1".try_into().unwrap() },
            tissue: "homogeneous".try_into().unwrap(),
            paddles: core::array::from_fn(paddle),
            needle_axis: self.axis,
            orthogonal: self.orthogonal,
            target_position: SVector::from_element(0.5),
            validity: Validity { depth_start: 0.0, depth_end: DEPTH, paddle_displacement: 0.1, needle_speed: 0.1 },
            gains: Gains { loop_gain: 0.25, delay_samples: 1, lambda_max: 1.0 },
            knots: (0..=10).map(knot).collect(),
        };
        table.validate().unwrap();
        table
    }

    /// The same, turned.
    fn turned(&self, by: &SMatrix<f64, D, D>) -> Self {
        Self {
            axis: by * self.axis,
            orthogonal: by * self.orthogonal,
            jacobians: self.jacobians.map(|jacobian| by * jacobian * by.transpose()),
            drag: by * self.drag,
            limits: self.limits,
        }
    }
}

/// One paddle in space that answers differently in every direction.
fn single() -> Tissue<3, 2, 1> {
    Tissue {
        axis: Vector3::new(0.0, -1.0, 0.0),
        orthogonal: Matrix3x2::from_columns(&[Vector3::x(), Vector3::z()]),
        jacobians: [Matrix3::new(0.30, 0.05, 0.02, -0.04, 0.25, 0.03, 0.01, -0.06, 0.20)],
        drag: Vector3::new(0.02, -0.1, -0.01),
        limits: [0.05],
    }
}

/// Two of them, on two sides.
fn pair() -> Tissue<3, 2, 2> {
    let Tissue { axis, orthogonal, jacobians: [first], drag, .. } = single();
    let second = Rotation3::from_axis_angle(&Vector3::y_axis(), 1.2).matrix() * first * 0.8;
    Tissue { axis, orthogonal, jacobians: [first, second], drag, limits: [0.05, 0.05] }
}

/// A table of two paddles in space, for the tests of other modules.
pub(crate) fn table() -> SpatialTable<f64, 2> {
    pair().table(Direction::MinimumNorm)
}

/// Inputs of a closed loop on it, and the commands that the controller gives by itself.
pub(crate) fn insertion(ticks: usize) -> std::vec::Vec<(Inputs, PaddleCommand)> {
    let (tissue, table) = (pair(), table());
    let mut closed = Space::new(&table, &tissue, &settings());
    (0..ticks)
        .map(|_| {
            let mut given = Inputs::default();
            let command = closed.tick(|inputs| given = *inputs);
            (given, command)
        })
        .collect()
}

/// Controller, tissue and paddles, with every command checked against the limits of each paddle.
struct Space<'t, const D: usize, const N: usize, const P: usize> {
    controller: Controller<'t, f64, D, N, P>,
    state: State<f64, D, N, P>,
    table: &'t Table<f64, D, N, P>,
    tissue: Tissue<D, N, P>,
    /// What nobody knows of.
    offset: SVector<f64, D>,
    paddles: [SVector<f64, D>; P],
    depth: f64,
    speed: f64,
    tick: u64,
    seen: std::collections::VecDeque<(u64, SVector<f64, D>)>,
    last: Option<PaddleCommand>,
}

fn frame<const D: usize>(vector: &SVector<f64, D>) -> [f64; MAX_DIMENSION] {
    core::array::from_fn(|i| if i < D { vector[i] } else { 0.0 })
}

fn vector<const D: usize>(frame: &[f64; MAX_DIMENSION]) -> SVector<f64, D> {
    SVector::from_fn(|i, _| frame[i])
}

impl<'t, const D: usize, const N: usize, const P: usize> Space<'t, D, N, P> {
    fn new(table: &'t Table<f64, D, N, P>, tissue: &Tissue<D, N, P>, settings: &Settings) -> Self {
        Self {
            controller: Controller::new(table, settings).unwrap(),
            state: State::new(),
            table,
            tissue: tissue.clone(),
            offset: SVector::zeros(),
            paddles: [SVector::zeros(); P],
            depth: 0.0,
            speed: SPEED,
            tick: 0,
            seen: Default::default(),
            last: None,
        }
    }

    fn target(&self) -> SVector<f64, D> {
        let drag = self.tissue.drag * self.depth + self.offset;
        self.paddles.iter().zip(&self.tissue.jacobians).fold(drag, |sum, (paddle, jacobian)| sum + jacobian * paddle)
    }

    /// What is left across the needle.
    fn error(&self) -> f64 {
        (self.tissue.orthogonal.transpose() * self.target()).norm()
    }

    fn tick(&mut self, fault: impl FnOnce(&mut Inputs)) -> PaddleCommand {
        let (tick, time_ns) = (self.tick, self.tick * MS);
        let sequence = tick as u32;
        if tick.is_multiple_of(20) {
            self.seen.push_back((tick, self.target()));
        }
        let arrived = self.seen.front().filter(|(at, _)| at + 20 <= tick).copied();
        let target = arrived.map(|(at, target)| {
            self.seen.pop_front();
            let sequence = (at / 20) as u32;
            TargetSample { sequence, flags: TARGET_VISIBLE, time_ns: at * MS, displacement: frame(&target) }
        });
        let mut paddles = [None; 2];
        for (place, paddle) in self.paddles.iter().enumerate() {
            let paddle_index = self.table.paddles[place].index;
            paddles[place] = Some(PaddleSample { sequence, paddle_index, time_ns, displacement: frame(paddle) });
        }
        let needle = Some(NeedleSample { sequence, reserved: 0, time_ns, depth: self.depth, velocity: self.speed });
        let mut inputs = Inputs { tick, time_ns, needle, target, paddles };
        fault(&mut inputs);
        let command = self.controller.step(&mut self.state, &inputs);
        self.check(&command);
        if command.is_valid() {
            for (paddle, displacement) in self.paddles.iter_mut().zip(&command.displacement) {
                *paddle = vector(displacement);
            }
        }
        self.depth = (self.depth + self.speed * 1e-3).min(DEPTH);
        if self.depth >= DEPTH {
            self.speed = 0.0;
        }
        self.tick += 1;
        self.last = Some(command);
        command
    }

    fn check(&self, command: &PaddleCommand) {
        for (place, displacement) in command.displacement.iter().enumerate() {
            let Some(paddle) = self.table.paddles.get(place) else {
                assert_eq!((*displacement, command.paddle_index[place]), ([0.0; 3], 0), "there is no such paddle");
                continue;
            };
            assert_eq!(command.paddle_index[place], paddle.index);
            let now = Vector3::from(*displacement);
            assert!(now.norm() <= paddle.max_displacement * (1.0 + 1e-12));
            if let Some(last) = self.last.filter(|last| last.is_valid() && command.is_valid()) {
                assert!((now - Vector3::from(last.displacement[place])).norm() <= 1e-4 * (1.0 + 1e-9));
            }
        }
        assert_eq!(self.state.ledger().unaccounted(), 0);
    }

    fn run(&mut self, ticks: usize) -> &mut Self {
        for _ in 0..ticks {
            self.tick(|_| {});
        }
        self
    }
}

fn holds<const D: usize, const N: usize, const P: usize>(tissue: &Tissue<D, N, P>, settings: &Settings) {
    let table = tissue.table(settings.direction.unwrap_or(Direction::default_in(D)));
    let mut closed = Space::new(&table, tissue, settings);
    let mut worst = 0.0_f64;
    for _ in 0..6000 {
        closed.tick(|_| {});
        worst = worst.max(closed.error());
    }
    assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
    // A tick of the actuator, and the first ones, in which the paddles are adopted.
    assert!(worst < 2e-3 / 5.0 && closed.error() < 1e-6, "{settings:?}: {worst} {}", closed.error());
    // A tissue that answers less, pushed harder: the feedback removes it.
    let mut other = tissue.clone();
    other.jacobians = other.jacobians.map(|jacobian| jacobian * 0.7);
    other.drag *= 1.3;
    let mut wrong = Space::new(&table, &other, settings);
    wrong.run(7000);
    assert!(wrong.error() < 1e-6, "{settings:?}: {}", wrong.error());
    assert_eq!(wrong.state.mode(), Mode::Run);
}

#[test]
fn target_is_held_in_space_by_one_paddle_and_by_two() {
    for feedback in [Feedback::Observer, Feedback::Integral, Feedback::Harmonic] {
        for direction in [None, Some(Direction::Inverse), Some(Direction::MinimumNorm)] {
            let chosen = Settings { feedback, direction, ..settings() };
            holds(&single(), &chosen);
            holds(&pair(), &chosen);
        }
    }
}

/// Whatever the axes of the scene, the paddles do the same.
#[test]
fn what_is_turned_is_answered_turned() {
    let turn = *Rotation3::from_euler_angles(0.4, -1.1, 2.3).matrix();
    for feedback in [Feedback::Observer, Feedback::Integral] {
        for direction in [Direction::Inverse, Direction::MinimumNorm] {
            let chosen = Settings { feedback, direction: Some(direction), ..settings() };
            let tissue = pair();
            let (table, turned) = (tissue.table(direction), tissue.turned(&turn));
            let turned_table = turned.table(direction);
            let mut straight = Space::new(&table, &tissue, &chosen);
            let mut turned = Space::new(&turned_table, &turned, &chosen);
            straight.offset = Vector3::new(1e-3, 2e-4, -5e-4);
            turned.offset = turn * straight.offset;
            for tick in 0..5500 {
                let [one, other] = [straight.tick(|_| {}), turned.tick(|_| {})];
                assert_eq!((one.state, one.faults), (other.state, other.faults), "{tick}");
                for (one, other) in one.displacement.iter().zip(&other.displacement) {
                    let off = (turn * Vector3::from(*one) - Vector3::from(*other)).norm();
                    assert!(off < 1e-11, "tick {tick}: {off}");
                }
            }
            assert!(straight.paddles[1].norm() > 1e-4, "the second paddle moves, too");
        }
    }
}

/// A plane in space is the plane: nothing is out of it, and in it the same commands up to rounding.
#[test]
fn a_planar_table_in_space_gives_the_planar_commands() {
    let flat = jacobian();
    let solid = Matrix3::new(flat.m11, flat.m12, 0.0, flat.m21, flat.m22, 0.0, 0.0, 0.0, 0.3);
    let drag = Vector2::new(0.02, -0.1);
    let plane =
        Tissue { axis: Vector2::new(0.0, -1.0), orthogonal: Vector2::x(), jacobians: [flat], drag, limits: [0.05] };
    let space = Tissue {
        axis: Vector3::new(0.0, -1.0, 0.0),
        orthogonal: Matrix3x2::from_columns(&[Vector3::x(), Vector3::z()]),
        jacobians: [solid],
        drag: Vector3::new(drag.x, drag.y, 0.0),
        limits: [0.05],
    };
    for feedback in [Feedback::Observer, Feedback::Integral] {
        for direction in [Direction::Inverse, Direction::MinimumNorm] {
            let chosen = Settings { feedback, direction: Some(direction), target_noise: 1e-5, ..settings() };
            let (planar_table, spatial_table) = (plane.table(direction), space.table(direction));
            // The plane knows nothing of the third direction, whose norm would only widen the gates.
            let mut planar = Space::new(&planar_table, &plane, &chosen);
            let mut spatial = Space::new(&spatial_table, &space, &chosen);
            planar.offset.x = 1e-3;
            spatial.offset.x = 1e-3;
            for tick in 0..6000 {
                let (one, other) = (planar.tick(|_| {}), spatial.tick(|_| {}));
                assert_eq!(one.state, other.state, "{tick}");
                let off = (Vector3::from(one.displacement[0]) - Vector3::from(other.displacement[0])).norm();
                assert!(off < 1e-12 && other.displacement[0][2] == 0.0, "tick {tick}: {off}");
            }
        }
    }
}

/// A second paddle that moves nothing is none.
#[test]
fn a_paddle_without_effect_stays_and_changes_nothing() {
    let alone = single();
    let beside = Tissue {
        axis: alone.axis,
        orthogonal: alone.orthogonal,
        jacobians: [alone.jacobians[0], Matrix3::zeros()],
        drag: alone.drag,
        limits: [0.05, 0.05],
    };
    for direction in [Direction::Inverse, Direction::MinimumNorm] {
        let chosen = Settings { direction: Some(direction), ..settings() };
        let (one_table, two_table) = (alone.table(direction), beside.table(direction));
        let mut one = Space::new(&one_table, &alone, &chosen);
        let mut two = Space::new(&two_table, &beside, &chosen);
        one.offset = Vector3::new(1e-3, 0.0, -1e-3);
        two.offset = one.offset;
        for tick in 0..5500 {
            let (one, two) = (one.tick(|_| {}), two.tick(|_| {}));
            let off = (Vector3::from(one.displacement[0]) - Vector3::from(two.displacement[0])).norm();
            assert!(off < 1e-12 && two.displacement[1] == [0.0; 3], "tick {tick}: {off} {two:?}");
            assert_eq!(one.state, two.state);
        }
    }
}

/// Equal paddles share equally; one that may go twice as far goes four times as far.
#[test]
fn paddles_share_by_the_squares_of_their_limits() {
    for (limits, ratio) in [([0.05, 0.05], 1.0), ([0.025, 0.05], 4.0), ([0.05, 0.025], 0.25)] {
        let one = single();
        let tissue = Tissue {
            axis: one.axis,
            orthogonal: one.orthogonal,
            jacobians: [one.jacobians[0]; 2],
            drag: one.drag * 0.2,
            limits,
        };
        let table = tissue.table(Direction::MinimumNorm);
        let mut closed = Space::new(&table, &tissue, &Settings { feedback: Feedback::Integral, ..settings() });
        closed.offset = Vector3::new(1e-3, 0.0, -1e-3);
        closed.run(5000);
        let [first, second] = closed.paddles;
        assert!((second - first * ratio).norm() < 1e-9, "{limits:?}: {first} {second}");
        assert!(first.norm() > 1e-4 && closed.error() < 1e-6, "{limits:?}: {first} {}", closed.error());
    }
}

/// Jacobians j and 2j: for e the paddles go e/5j and 2e/5j. At e = 2.8·j·L the second would have to go 1.12·L: it goes L,
/// and the first 0.8·L instead of 0.56·L.
#[test]
fn what_a_saturated_paddle_cannot_give_the_other_gives() {
    const J: f64 = 0.2;
    const L: f64 = 0.05;
    let one = single();
    let tissue = Tissue {
        axis: one.axis,
        orthogonal: one.orthogonal,
        jacobians: [Matrix3::identity() * J, Matrix3::identity() * (2.0 * J)],
        drag: Vector3::new(1e-3, 0.0, 0.0),
        limits: [L; 2],
    };
    for feedback in [Feedback::Observer, Feedback::Integral] {
        for direction in [Direction::MinimumNorm, Direction::Inverse] {
            let table = tissue.table(direction);
            let chosen = Settings { feedback, direction: Some(direction), ..settings() };
            let mut closed = Space::new(&table, &tissue, &chosen);
            closed.speed = 0.0;
            let asked = 2.8 * J * L;
            for tick in 0..8000 {
                closed.offset.z = -asked * (f64::from(tick) / 5000.0).min(1.0);
                closed.tick(|_| {});
            }
            assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
            let [first, second] = closed.paddles.map(|paddle| paddle.z / L);
            assert!(closed.error() < 1e-4 * asked, "{feedback:?} {direction:?}: {} is left", closed.error() / asked);
            if feedback == Feedback::Observer {
                assert!(closed.state.faults().contains(Faults::POSITION_LIMITED));
                assert!((first - 0.8).abs() < 1e-3 && (second - 1.0).abs() < 1e-9, "{direction:?}: {first} {second}");
            }
            // And back: nothing has wound up.
            for tick in 0..8000 {
                closed.offset.z = -asked * (1.0 - f64::from(tick) / 5000.0).max(0.0);
                closed.tick(|_| {});
                assert!(closed.error() < 0.05 * asked, "{feedback:?} {direction:?} {tick}: {}", closed.error() / asked);
            }
            assert!(closed.error() < 1e-6, "{feedback:?} {direction:?}: {}", closed.error());
        }
    }
}

/// What is beyond a limit is given in full by a paddle that moves the target across the needle, which is known then, and not
/// by one that moves nothing.
#[test]
fn what_is_handed_over_is_known_to_be_given_or_not() {
    let able = pair();
    let unable = Tissue { jacobians: [able.jacobians[0], Matrix3::zeros()], ..able.clone() };
    for (tissue, expected) in [(able, true), (unable, false)] {
        let table = tissue.table(Direction::MinimumNorm);
        let controller = Controller::new(&table, &settings()).unwrap();
        let mut goals = Matrix3x2::from_columns(&[Vector3::new(0.09, 0.0, 0.0), Vector3::zeros()]);
        let setting = Setting {
            time_ns: 0,
            location: table.locate(0.5 * DEPTH).unwrap(),
            feed_forward: Matrix3x2::zeros(),
            previous: Matrix3x2::zeros(),
            limits: controller.runtime.paddles.each_ref().map(|paddle| paddle.limits),
        };
        assert_eq!(controller.hand_over(&mut goals, &setting), expected);
        // 0.04 of the 0.09 is more than the first paddle may.
        let across = |moved: Vector3<f64>| tissue.orthogonal.tr_mul(&moved);
        let (lost, given) =
            (across(tissue.jacobians[0] * Vector3::x() * 0.04), across(tissue.jacobians[1] * goals.column(1)));
        assert!(!expected || (given - lost).norm() < 1e-12, "{given} {lost}");
        assert!(expected || goals.column(1).norm() == 0.0, "{goals}");
    }
}

/// What integral feedback asks of a saturated paddle goes to the other in the same sample, so that the loop is as fast as
/// with both: the second paddle's share is four fifths, and without it the error would stay five times as long.
#[test]
fn a_correction_that_one_paddle_cannot_give_goes_to_the_other_at_once() {
    const J: f64 = 0.2;
    const L: f64 = 0.05;
    let Tissue { axis, orthogonal, .. } = single();
    let jacobians = [Matrix3::identity() * J, Matrix3::identity() * (2.0 * J)];
    let tissue = Tissue { axis, orthogonal, jacobians, drag: Vector3::new(1e-3, 0.0, 0.0), limits: [L; 2] };
    for direction in [Direction::MinimumNorm, Direction::Inverse] {
        let table = tissue.table(direction);
        let chosen = Settings { feedback: Feedback::Integral, direction: Some(direction), ..settings() };
        // From 2.5·j·L on, the second paddle is at its limit. A small step then, which no rate limit sees.
        let left = [2.0, 2.7].map(|asked| {
            let mut closed = Space::new(&table, &tissue, &chosen);
            closed.speed = 0.0;
            for tick in 0..8000 {
                closed.offset.z = -asked * J * L * (f64::from(tick) / 5000.0).min(1.0);
                closed.tick(|_| {});
            }
            let saturated = closed.paddles[1].norm() > L * (1.0 - 1e-9);
            assert_eq!(saturated, asked > 2.5, "{direction:?} {asked}");
            let step = 1e-3 * J * L;
            closed.offset.z -= step;
            closed.run(200).error() / step
        });
        let [free, saturated] = left;
        assert!(free < 0.2 && (saturated - free).abs() < 0.05, "{direction:?}: {free} {saturated}");
    }
}

/// Where both are at their limits, nobody is asked any more: no commands beyond, and no verdict on the sign of the plant.
#[test]
fn when_both_saturate_what_is_left_is_left() {
    let tissue = pair();
    let table = tissue.table(Direction::MinimumNorm);
    for feedback in [Feedback::Observer, Feedback::Integral] {
        let mut closed = Space::new(&table, &tissue, &Settings { feedback, ..settings() });
        closed.speed = 0.0;
        for tick in 0..8000 {
            closed.offset.x = 0.04 * (f64::from(tick) / 6000.0).min(1.0);
            closed.tick(|_| {});
        }
        assert_eq!(closed.state.mode(), Mode::Run, "{feedback:?}: {}", closed.state.faults());
        let near = closed.paddles.map(|paddle| paddle.norm());
        assert!(near.iter().all(|norm| *norm > 0.0499), "{feedback:?}: {near:?}");
    }
}

/// What goes wrong with one paddle keeps both where they are, says which it was, and is SAFE if it lasts.
#[test]
fn one_paddle_lost_holds_both_and_is_told_apart() {
    type Change = fn(&mut PaddleSample);
    let silence: Option<Change> = None;
    let cases: [(Option<Change>, Faults, bool); 6] = [
        (silence, Faults::PADDLE_STALE, false),
        (Some(|sample| sample.displacement[2] = f64::NAN), Faults::NOT_FINITE, false),
        (Some(|sample| sample.displacement[2] = 0.9), Faults::OUT_OF_RANGE, false),
        (Some(|sample| sample.time_ns = 0), Faults::SAMPLE_TIME, false),
        (Some(|sample| sample.displacement[2] += 0.02), Faults::FOLLOWING_ERROR, true),
        (Some(|sample| sample.paddle_index += 1), Faults::PADDLE_IDENTITY, true),
    ];
    let tissue = pair();
    let table = tissue.table(Direction::MinimumNorm);
    for place in 0..2 {
        for (case, (change, code, latches)) in cases.iter().enumerate() {
            let mut closed = Space::new(&table, &tissue, &settings());
            closed.run(1000);
            assert_eq!(closed.state.mode(), Mode::Run);
            let spoil = |inputs: &mut Inputs| match (change, &mut inputs.paddles[place]) {
                (Some(change), Some(sample)) => change(sample),
                (_, sample) => *sample = None,
            };
            let mut seen = Faults::NONE;
            let stopped = (0..60).find(|_| {
                let command = closed.tick(spoil);
                seen |= Faults::from_bits(command.faults);
                command.state != Mode::Run as u32
            });
            assert!(stopped.is_some(), "paddle {place}, case {case}: {seen}");
            assert!(seen.contains(*code), "paddle {place}, case {case}: {seen}");
            assert_eq!(seen.contains(Faults::SECOND_PADDLE), place == 1, "paddle {place}, case {case}: {seen}");
            let position = closed.last.unwrap().displacement;
            assert_eq!(closed.state.mode(), if *latches { Mode::Safe } else { Mode::Hold });
            for _ in 0..300 {
                assert_eq!(closed.tick(spoil).displacement, position, "both stay");
            }
            assert_eq!(closed.state.mode(), Mode::Safe, "it lasts");
            let faults = closed.state.faults();
            assert_eq!(faults.contains(Faults::SECOND_PADDLE), place == 1, "paddle {place}, case {case}: {faults}");
            let paddles = closed.state.ledger().paddles;
            assert_eq!(paddles[1 - place].discarded, [0; 8], "the other's accounts know nothing of it");
        }
    }
}

/// A frozen sensor of either paddle is found, by its own paddle's commands.
#[test]
fn a_frozen_sensor_of_either_paddle_is_found() {
    let tissue = pair();
    let table = tissue.table(Direction::MinimumNorm);
    for place in 0..2 {
        let mut closed = Space::new(&table, &tissue, &settings());
        closed.run(1000);
        let stuck = frame(&closed.paddles[place]);
        let mut seen = Faults::NONE;
        for _ in 0..1500 {
            let command = closed.tick(|inputs| inputs.paddles[place].as_mut().unwrap().displacement = stuck);
            seen |= Faults::from_bits(command.faults);
        }
        assert!(seen.contains(Faults::FROZEN) && closed.state.mode() != Mode::Run, "{seen}");
        assert_eq!(seen.contains(Faults::SECOND_PADDLE), place == 1);
        assert!(closed.state.ledger().paddles[place].discarded_for(Discard::Frozen) > 0);
    }
}

/// Starting moves neither paddle, and waits for both.
#[test]
fn both_paddles_are_adopted_where_they_are() {
    let tissue = pair();
    let table = tissue.table(Direction::MinimumNorm);
    let mut closed = Space::new(&table, &tissue, &settings());
    closed.speed = 0.0;
    closed.paddles = [Vector3::new(0.01, 0.0, -0.02), Vector3::new(0.0, 0.03, 0.0)];
    for _ in 0..50 {
        let command = closed.tick(|inputs| inputs.paddles[1] = None);
        assert!(!command.is_valid() && command.displacement == [[0.0; 3]; 2]);
        assert!(Faults::from_bits(command.faults).contains(Faults::WAITING | Faults::SECOND_PADDLE));
    }
    let placed = closed.paddles.map(|paddle| frame(&paddle));
    let adopted = (0..20).map(|_| closed.tick(|_| {})).find(PaddleCommand::is_valid).unwrap();
    assert_eq!(adopted.displacement, placed);
    // Moved by somebody before RUN: where it is then counts, for both of them together.
    let mut closed = Space::new(&table, &tissue, &settings());
    closed.run(20);
    closed.tick(|inputs| (inputs.needle, inputs.target) = (None, None));
    assert_eq!(closed.last.unwrap().paddle_index, [3, 7]);
}

/// A plane looks at nothing that is out of it, and at no second paddle.
#[test]
fn the_plane_ignores_what_is_out_of_it() {
    let table = crate::contract::example::table();
    let (mut plain, mut strange) = (Loop::new(&table, &settings()), Loop::new(&table, &settings()));
    for tick in 0..1500 {
        let one = plain.tick(|_| {});
        let other = strange.tick(|inputs| {
            for sample in inputs.target.iter_mut() {
                sample.displacement[2] = [1e6, f64::NAN, -3.0][tick % 3];
            }
            let first = inputs.paddles[0].as_mut().unwrap();
            first.displacement[2] = f64::INFINITY;
            inputs.paddles[1] = Some(PaddleSample { paddle_index: 9, ..*first });
        });
        assert_eq!(one, other, "{tick}");
    }
    assert_eq!(strange.state.mode(), Mode::Run);
    assert_eq!(strange.state.ledger().paddles[1], Default::default());
}

/// Breath along two directions at once, with two sizes: both are foretold.
#[test]
fn a_breath_in_space_is_foretold_along_both_directions() {
    let tissue = pair();
    let table = tissue.table(Direction::MinimumNorm);
    let left = |feedback| {
        let chosen = Settings { feedback, target_noise: 2e-5, loop_gain: Some(0.1), ..settings() };
        let mut closed = Space::new(&table, &tissue, &chosen);
        closed.speed = 0.0;
        let mut worst = 0.0_f64;
        for tick in 0..40_000 {
            let phase = core::f64::consts::TAU * f64::from(tick) * 1e-3 / 4.0;
            let breath = libm::pow(libm::cos(0.5 * phase), 4.0);
            closed.offset = Vector3::new(2e-3, 0.0, -1e-3) * breath;
            closed.tick(|_| {});
            worst = if tick > 25_000 { worst.max(closed.error()) } else { 0.0 };
        }
        assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
        worst
    };
    let (followed, foretold) = (left(Feedback::Observer), left(Feedback::Harmonic));
    assert!(foretold < 0.4 * followed, "{foretold} of {followed}");
}

#[test]
fn space_has_its_own_default_direction() {
    let tissue = single();
    let table = tissue.table(Direction::MinimumNorm);
    let controller = Controller::new(&table, &settings()).unwrap();
    assert_eq!(controller.runtime.direction, Direction::MinimumNorm);
    let planar = crate::contract::example::table();
    assert_eq!(Controller::new(&planar, &settings()).unwrap().runtime.direction, Direction::Inverse);
}

#[test]
fn spatial_tables_survive_their_file_and_fit_into_no_other_controller() {
    use crate::contract::{Header, MAX_TABLE_BYTES, TableError, decode, encode};
    let table: SpatialTable<f64, 2> = pair().table(Direction::MinimumNorm);
    let encoded = |table: &SpatialTable<f64, 2>| {
        let mut bytes = std::vec![0; MAX_TABLE_BYTES];
        let length = encode(table, &mut bytes).unwrap();
        bytes.truncate(length);
        bytes
    };
    let bytes = encoded(&table);
    assert_eq!(decode::<f64, 3, 2, 2>(&bytes).unwrap(), table);
    let header = Header::read(&bytes).unwrap();
    assert_eq!((header.dimension, header.paddle_dof, header.format_version), (3, 6, 2));
    let payload = &bytes[52..bytes.len() - 4];
    let derived: SpatialTable<f64, 2> = postcard::from_bytes(payload).unwrap();
    assert_eq!(SpatialTable { scene_hash: table.scene_hash, ..derived }, table);
    assert_eq!(decode::<f64, 2, 1, 1>(&bytes).unwrap_err(), TableError::Dimension { found: 3, expected: 2 });
    assert_eq!(decode::<f64, 3, 2, 1>(&bytes).unwrap_err(), TableError::PaddleDof { found: 6, expected: 3 });
    // As many knots as there are.
    let mut largest = table.clone();
    while let Ok(()) = largest.knots.push(largest.knots.last().unwrap().clone()) {}
    for (index, knot) in largest.knots.iter_mut().enumerate() {
        knot.depth = 0.01 * index as f64;
    }
    largest.validity.depth_end = largest.knots.last().unwrap().depth;
    let bytes = encoded(&largest);
    assert_eq!(decode::<f64, 3, 2, 2>(&bytes).unwrap(), largest);
    assert!(bytes.len() <= crate::serial::device::SPATIAL_TABLE_BYTES, "{}", bytes.len());
    assert!(f64::KIND == header.scalar);
}

#[test]
fn spatial_tables_are_checked_paddle_by_paddle_and_direction_by_direction() {
    use crate::contract::{Field, TableError};
    type Change = fn(&mut SpatialTable<f64, 2>);
    let cases: [(Change, TableError); 9] = [
        (|t| t.paddles[1].max_rate = 0.0, TableError::NotPositive { field: Field::PaddleRateLimit }),
        (|t| t.paddles[1].max_displacement = 1.0, TableError::DisplacementRange),
        (|t| t.paddles[1].extent[1].z = f64::NAN, TableError::NotFinite { field: Field::PaddleExtent }),
        (|t| t.knots[3].jacobian[1].m33 = f64::NAN, TableError::NotFinite { field: Field::KnotJacobian }),
        (|t| t.knots[3].paddle_path[(2, 1)] = 0.06, TableError::PathBeyondLimit { knot: 3 }),
        (|t| t.orthogonal[(2, 1)] = 0.9, TableError::NotUnit { field: Field::OrthogonalDirection }),
        (|t| t.orthogonal.set_column(1, &Vector3::x()), TableError::NotOrthogonal),
        (|t| t.orthogonal.set_column(1, &Vector3::y()), TableError::NotOrthogonal),
        (|t| t.knots[2].jacobian = [Matrix3::zeros(); 2], TableError::IllConditioned { knot: 2 }),
    ];
    for (case, (change, refusal)) in cases.into_iter().enumerate() {
        let mut table = pair().table(Direction::MinimumNorm);
        change(&mut table);
        assert_eq!(table.validate(), Err(refusal), "case {case}");
    }
    // One paddle alone may be weak where the other is not.
    let mut table = pair().table(Direction::MinimumNorm);
    for knot in &mut table.knots {
        knot.jacobian[1] = Matrix3::from_diagonal(&Vector3::new(0.3, 0.0, 0.0));
    }
    table.validate().unwrap();
}

proptest! {
    /// Whatever arrives: limits of both paddles (checked in every tick), accounts that balance, a mode that follows.
    #[test]
    fn any_inputs_keep_the_limits_of_both_paddles(
        choices in prop::collection::vec((0..12u32, any::<u32>(), -0.1..0.1f64, -0.1..0.1f64), 1..400),
        offset in prop::array::uniform3(-5e-3..5e-3f64),
    ) {
        let (tissue, table) = (pair(), table());
        let mut closed = Space::new(&table, &tissue, &settings());
        closed.run(60);
        closed.offset = Vector3::from(offset);
        for (choice, bits, a, b) in choices {
            let command = closed.tick(|inputs| {
                let place = (bits & 1) as usize;
                match (choice, &mut inputs.paddles[place]) {
                    (0, sample) => *sample = None,
                    (1, Some(sample)) => sample.displacement = [a, b, a],
                    (2, Some(sample)) => sample.sequence = bits,
                    (3, Some(sample)) => sample.time_ns = sample.time_ns.wrapping_sub(u64::from(bits)),
                    (4, _) => inputs.target = None,
                    (5, _) => inputs.needle = None,
                    (6, _) => inputs.target.iter_mut().for_each(|sample| sample.displacement = [a, b, a]),
                    _ => {}
                }
            });
            let faults = Faults::from_bits(command.faults);
            let has = |codes: Faults| !faults.intersection(codes).is_empty();
            let expected =
                if has(Faults::LATCHING) { Mode::Safe } else if has(Faults::HOLDING) { Mode::Hold } else { Mode::Run };
            prop_assert_eq!(Mode::from_wire(command.state), Some(expected));
            if closed.state.mode() == Mode::Safe && bits % 16 == 0 {
                closed.state.rearm();
                closed.last = None;
            }
        }
    }
}

fn jacobian_of(entries: [f64; 9]) -> Matrix3<f64> {
    Matrix3::from_column_slice(&entries) + Matrix3::identity() * 3.0
}

proptest! {
    /// G solves what it says, and no other w that does costs less.
    #[test]
    fn directions_solve_and_are_the_cheapest(
        first in prop::array::uniform9(-1.0..1.0f64),
        second in prop::array::uniform9(-1.0..1.0f64),
        ratio in 0.2..5.0f64,
        other in prop::array::uniform6(-1.0..1.0f64),
        error in prop::array::uniform2(-1.0..1.0f64),
    ) {
        let (jacobians, orthogonal) = ([first, second].map(jacobian_of), pair().orthogonal);
        let weights = crate::contract::relative_weights(&[1.0, ratio]);
        let error = Vector2::from(error);
        let effect = |w: &[Vector3<f64>; 2]| jacobians[0] * w[0] + jacobians[1] * w[1];
        let cost = |w: &[Vector3<f64>; 2]| w[0].norm_squared() / weights[0] + w[1].norm_squared() / weights[1];
        let shortest = Direction::MinimumNorm.solve(&jacobians, &orthogonal, &weights).map(|g| g * error);
        let straight = Direction::Inverse.solve(&jacobians, &orthogonal, &weights).map(|g| g * error);
        prop_assert!((orthogonal.transpose() * effect(&shortest) - error).norm() < 1e-12);
        prop_assert!((effect(&straight) - orthogonal * error).norm() < 1e-12, "nothing along the needle");
        prop_assert!(cost(&shortest) <= cost(&straight) * (1.0 + 1e-12));
        // Any motion without effect, added: [a, −J₂⁻¹J₁a].
        let a = Vector3::new(other[0], other[1], other[2]);
        let b = -(jacobians[1].try_inverse().unwrap() * (jacobians[0] * a));
        let more = [straight[0] + a, straight[1] + b];
        prop_assert!(cost(&straight) <= cost(&more) * (1.0 + 1e-12));
        let axial = Vector3::new(0.0, other[3], 0.0);
        let more = [shortest[0] + a, shortest[1] + b + jacobians[1].try_inverse().unwrap() * axial];
        prop_assert!((orthogonal.transpose() * effect(&more) - error).norm() < 1e-9);
        prop_assert!(cost(&shortest) <= cost(&more) * (1.0 + 1e-12));
    }

    /// Whatever is near singular is damped: bounded by the condition number past which it is.
    #[test]
    fn directions_stay_bounded(exponent in 0.0..14.0f64, angle in 0.0..6.3f64) {
        let weak = 10f64.powf(-exponent);
        let turn = *Rotation3::from_euler_angles(angle, 0.3, -angle).matrix();
        let jacobian = turn * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, weak)) * turn.transpose();
        for direction in [Direction::Inverse, Direction::MinimumNorm] {
            let [one] = direction.solve(&[jacobian], &single().orthogonal, &[1.0]);
            let two = direction.solve(&[jacobian; 2], &single().orthogonal, &[1.0, 0.5]);
            prop_assert!(one.norm() < 2.0 * 100.0 && two.iter().all(|g| g.norm() < 2.0 * 100.0), "{one} {two:?}");
        }
    }
}
