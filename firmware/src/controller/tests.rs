//! The closed loop on a linear plant, and one fault at a time.

use nalgebra::{Matrix2, Vector2};
use proptest::prelude::*;

use super::plant::{MS, Plant};
use super::*;
use crate::contract::example::{jacobian, table};
use crate::contract::{Table, TargetSample};
use crate::detection::{MAX_SUCCESSIVE_OVERRUNS, TICKS_TO_HOLD};
use crate::inputs::Discard;
use crate::loop_stability;

mod attacks;

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
    fn new(table: &'t Table<f64, 2>, settings: &Settings) -> Self {
        let controller = Controller::new(table, settings).unwrap();
        Self { controller, state: State::new(), plant: Plant::new(), last: None, worst: 0.0 }
    }

    /// One tick with the inputs changed by `fault`.
    fn tick(&mut self, fault: impl FnOnce(&mut Inputs)) -> PaddleCommand {
        let mut inputs = self.plant.sense();
        fault(&mut inputs);
        let command = self.controller.step(&mut self.state, &inputs);
        let displacement = Vector2::from(command.displacement);
        assert!(displacement.norm() <= 0.05 * (1.0 + 1e-12));
        // A command that is not valid is none: the actuator keeps its position, wherever that is.
        if let Some(last) = self.last.filter(|last| last.is_valid() && command.is_valid()) {
            assert!((displacement - Vector2::from(last.displacement)).norm() <= 1e-4 * (1.0 + 1e-9));
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

#[test]
fn the_right_table_leaves_almost_no_error() {
    let table = table();
    let mut closed = Loop::new(&table, &settings());
    closed.run(5500);
    assert_eq!(closed.state.mode(), Mode::Run);
    assert!(closed.worst < 0.002 / 10.0, "worst {}", closed.worst);
    assert!(closed.plant.target().x.abs() < 1e-6);
}

#[test]
fn a_wrong_table_is_corrected_by_feedback() {
    let table = table();
    for direction in [crate::law::Direction::Inverse, crate::law::Direction::MinimumNorm] {
        let mut closed = Loop::new(&table, &Settings { direction, ..settings() });
        closed.plant.push = 0.035;
        closed.plant.jacobian = jacobian() * 0.7;
        closed.run(6500);
        assert!(closed.worst < 0.0035 / 5.0, "worst {}", closed.worst);
        assert!(closed.plant.target().x.abs() < 1e-6);
    }
}

#[test]
fn a_slow_target_sensor_makes_no_oscillation() {
    let table = table();
    let mut closed = Loop::new(&table, &Settings::new(MS, 33 * MS, 20 * MS));
    closed.plant.target_period = 33;
    closed.plant.speed = 0.0;
    closed.plant.offset = 1e-3;
    closed.run(200);
    let mut last = closed.plant.target().x;
    for _ in 0..2000 {
        closed.tick(|_| {});
        let error = closed.plant.target().x;
        assert!(error >= -1e-12 && error <= last + 1e-12, "neither overshoot nor return");
        last = error;
    }
    assert_eq!(closed.state.mode(), Mode::Run);
    assert!(last < 1e-6);
}

/// Final size of the orthogonal error at g·λ = `ratio` × limit, relative to its start, with everything linear.
fn growth(ratio: f64) -> f64 {
    let mut table = table();
    table.paddle.max_rate = 1e3;
    let limit = loop_stability::gain_limit(0.0, 1);
    let mut closed = Loop::new(&table, &Settings { loop_gain: Some(ratio * limit), ..settings() });
    closed.plant.speed = 0.0;
    let start = 1e-5;
    closed.plant.offset = start;
    let mut end: f64 = 0.0;
    for tick in 0..2400 {
        let inputs = closed.plant.sense();
        let command = closed.controller.step(&mut closed.state, &inputs);
        closed.plant.act(&command);
        if tick >= 2200 {
            end = end.max(closed.plant.target().x.abs());
        }
    }
    end / start
}

#[test]
fn the_sampled_loop_is_stable_exactly_up_to_the_theoretical_limit() {
    assert!(growth(0.25) < 1e-3);
    assert!(growth(0.9) < 0.1);
    assert!(growth(1.1) > 10.0);
}

#[test]
fn a_start_moves_nothing_and_restarts_where_the_paddle_is() {
    let table = table();
    let mut closed = Loop::new(&table, &settings());
    closed.plant.paddle = Vector2::new(0.01, -0.02);
    closed.plant.depth = 0.05;
    let command = closed.tick(|inputs| inputs.paddle = None);
    assert!(!command.is_valid() && command.state == Mode::Hold as u32);
    for tick in 0..100 {
        let command = closed.tick(|_| {});
        assert_eq!(command.is_valid(), tick >= TICKS_TO_HOLD, "at rest for as long as a sample may be old");
        if command.is_valid() && command.state == Mode::Hold as u32 {
            assert_eq!(command.displacement, [0.01, -0.02]);
        }
        if command.state == Mode::Run as u32 {
            return;
        }
    }
    panic!("never reached RUN");
}

#[test]
fn ages_lead_to_hold_and_safe_and_safe_needs_rearming() {
    let table = table();
    for stream in 0..3 {
        let silence = |inputs: &mut Inputs| match stream {
            0 => inputs.needle = None,
            1 => inputs.target = None,
            _ => inputs.paddle = None,
        };
        let mut closed = Loop::new(&table, &settings());
        closed.run(1000);
        let held = (0..200).find(|_| closed.tick(silence).state == Mode::Hold as u32).unwrap();
        let position = closed.last.unwrap().displacement;
        assert!(held <= 100, "stream {stream}: {held}");
        closed.until_safe(silence).unwrap();
        closed.run(100);
        assert_eq!(closed.state.mode(), Mode::Safe);
        assert_eq!(closed.last.unwrap().displacement, position);
        closed.state.rearm();
        closed.run(100);
        assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
    }
}

#[test]
fn a_pause_of_100_ms_is_one_gap_and_resumes() {
    let table = table();
    let mut closed = Loop::new(&table, &settings());
    closed.run(1000);
    for _ in 0..100 {
        closed.tick(|inputs| {
            (inputs.needle, inputs.target, inputs.paddle) = (None, None, None);
        });
    }
    assert_eq!(closed.state.mode(), Mode::Hold);
    closed.run(100);
    assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
    assert_eq!(closed.state.ledger().needle.lost, 100);
}

#[test]
fn rejected_inputs_leave_the_integral_bit_identical() {
    let table = table();
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-310, 1e3, -1e3, f64::MAX];
    for value in bad {
        for field in 0..6 {
            let mut closed = Loop::new(&table, &settings());
            closed.plant.push = 0.03;
            closed.run(1020);
            let integral = closed.state.integral().unwrap();
            // Tick 1020 brings a target sample; the ticks after it none, so that every field can be hit.
            closed.tick(|inputs| {
                let target = inputs.target.as_mut();
                match field {
                    0 => inputs.needle.as_mut().unwrap().depth = value,
                    1 => inputs.needle.as_mut().unwrap().velocity = value,
                    2 => target.unwrap().displacement[0] = value,
                    3 => target.unwrap().displacement[1] = value,
                    4 => inputs.paddle.as_mut().unwrap().displacement[0] = value,
                    _ => inputs.paddle.as_mut().unwrap().displacement[1] = value,
                }
                if field != 2 && field != 3 {
                    inputs.target = None;
                }
            });
            let same = integral.map(f64::to_bits) == closed.state.integral().unwrap().map(f64::to_bits);
            assert!(same, "field {field} = {value}");
        }
    }
}

#[test]
fn units_off_by_1000_are_refused() {
    let table = table();
    let mut closed = Loop::new(&table, &settings());
    closed.plant.push = 0.03;
    closed.run(2500);
    closed.until_safe(|inputs| {
        if let Some(needle) = &mut inputs.needle {
            needle.depth *= 1e3;
        }
    });
    assert_eq!(closed.state.mode(), Mode::Safe);
    assert!(closed.state.ledger().needle.discarded_for(Discard::OutOfRange) > 200);
}

#[test]
fn duplicates_are_integrated_once() {
    let table = table();
    let (mut once, mut twice) = (Loop::new(&table, &settings()), Loop::new(&table, &settings()));
    once.plant.push = 0.03;
    twice.plant.push = 0.03;
    let mut repeated = None;
    for _ in 0..2000 {
        let expected = once.tick(|_| {});
        let command = twice.tick(|inputs| {
            inputs.target = inputs.target.or(repeated);
            repeated = inputs.target;
        });
        assert_eq!(command.displacement, expected.displacement);
    }
    assert!(twice.state.ledger().target.duplicates > 1000);
}

#[test]
fn lost_target_holds_and_the_return_keeps_the_rate() {
    let table = table();
    let mut closed = Loop::new(&table, &settings());
    closed.run(1000);
    let hide = |inputs: &mut Inputs| {
        if let Some(target) = &mut inputs.target {
            target.flags = 0;
        }
    };
    for _ in 0..150 {
        closed.tick(hide);
    }
    assert_eq!(closed.state.mode(), Mode::Hold);
    closed.run(500);
    assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
    for _ in 0..500 {
        closed.tick(hide);
    }
    assert_eq!(closed.state.mode(), Mode::Safe);
}

#[test]
fn a_jump_of_the_target_is_gated() {
    let table = table();
    let noise = 1e-4;
    let mut closed = Loop::new(&table, &Settings { target_noise: noise, ..settings() });
    closed.run(1000);
    let integral = closed.state.integral();
    for _ in 0..20 {
        closed.tick(|inputs| {
            if let Some(target) = &mut inputs.target {
                target.displacement[0] += 50.0 * noise;
            }
        });
    }
    assert_eq!(closed.state.ledger().target.discarded_for(Discard::Innovation), 1);
    assert_eq!(closed.state.integral(), integral);
}

#[test]
fn frozen_inputs_are_detected() {
    let table = table();
    for stream in 0..2 {
        let mut closed = Loop::new(&table, &settings());
        closed.run(1000);
        let depth = closed.plant.depth;
        let displacement = closed.plant.target().into();
        let ticks = closed.until_safe(|inputs| match (stream, &mut inputs.needle, &mut inputs.target) {
            (0, Some(needle), _) => needle.depth = depth,
            (1, _, Some(target)) => target.displacement = displacement,
            _ => {}
        });
        assert!(ticks.is_some_and(|ticks| ticks < 600), "stream {stream}: {ticks:?}");
    }
}

#[test]
fn clock_identity_actuator_and_overruns_lead_to_safe() {
    let table = table();
    let running = || {
        let mut closed = Loop::new(&table, &settings());
        closed.run(1000);
        closed
    };
    let mut closed = running();
    closed.tick(|inputs| inputs.time_ns -= 5 * MS);
    assert!(closed.state.faults().contains(Faults::CLOCK_REVERSED));

    let mut closed = running();
    closed.plant.paddle_index = 4;
    closed.run(1);
    assert!(closed.state.faults().contains(Faults::PADDLE_IDENTITY));

    let mut closed = running();
    closed.plant.actuator_gain = 0.5;
    closed.run(2000);
    assert!(closed.state.faults().contains(Faults::FOLLOWING_ERROR));

    let mut closed = running();
    for _ in 0..MAX_SUCCESSIVE_OVERRUNS {
        closed.plant.tick += 1;
        closed.run(1);
    }
    assert!(closed.state.faults().contains(Faults::OVERRUN));
    assert_eq!(closed.state.ledger().ticks.skipped, u64::from(MAX_SUCCESSIVE_OVERRUNS));
}

#[test]
fn a_sign_error_of_the_plant_trips_and_right_signs_never_do() {
    let table = table();
    let mut closed = Loop::new(&table, &settings());
    closed.plant.jacobian = -jacobian();
    closed.run(5000);
    assert!(closed.state.faults().contains(Faults::DIVERGENCE), "worst {}", closed.worst);
    assert!(closed.worst < 0.01, "worst {}", closed.worst);
    for (scale, push) in [(0.3, 0.02), (1.0, 0.05), (1.5, -0.03), (0.5, 0.06)] {
        let mut closed = Loop::new(&table, &settings());
        closed.plant.jacobian = jacobian() * scale;
        closed.plant.push = push;
        closed.run(5500);
        let faults = closed.state.faults();
        assert_eq!(closed.state.mode(), Mode::Run, "scale {scale} push {push}: {faults}");
    }
}

#[test]
fn fast_and_deep_needles() {
    let table = table();
    let mut closed = Loop::new(&table, &settings());
    closed.run(1000);
    closed.tick(|inputs| inputs.needle.as_mut().unwrap().velocity = 0.2);
    assert_eq!(closed.state.mode(), Mode::Hold);
    closed.run(1);
    assert_eq!(closed.state.mode(), Mode::Run);
    closed.plant.speed = -0.02;
    closed.run(900);
    assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());

    let mut deep = Loop::new(&table, &settings());
    deep.run(6000);
    deep.tick(|inputs| inputs.needle.as_mut().unwrap().depth = 0.1005);
    assert!(deep.state.faults().contains(Faults::DEPTH_CLAMPED));
    assert_eq!(deep.state.mode(), Mode::Run);
}

#[test]
fn saturation_recovers_without_overshoot() {
    let table = table();
    let mut closed = Loop::new(&table, &settings());
    closed.plant.speed = 0.0;
    closed.run(100);
    // The paddle can take away 0.05/‖J⁻¹n‖ = 0.0152.
    for _ in 0..9000 {
        closed.plant.offset += 2e-6;
        closed.tick(|_| {});
    }
    closed.run(2000);
    assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
    assert!(closed.plant.target().x > 2e-3);
    for _ in 0..5000 {
        closed.plant.offset -= 2e-6;
        closed.tick(|_| {});
        assert!(closed.plant.target().x > -2.2e-4, "overshoot {}", closed.plant.target().x);
    }
    closed.run(1000);
    assert!(closed.plant.target().x.abs() < 1e-5);
}

#[test]
fn accounts_go_on_when_rearming_and_rearming_in_run_does_nothing() {
    let table = table();
    let mut closed = Loop::new(&table, &settings());
    closed.run(1000);
    let state = closed.state.clone();
    closed.state.rearm();
    assert_eq!(closed.state, state);
    closed.tick(|inputs| inputs.time_ns -= 5 * MS);
    let before = *closed.state.ledger();
    assert_eq!((before.ticks.due, before.ticks.safe, before.needle.consumed), (1001, 1, 1000));
    let sequence = closed.last.unwrap().sequence;
    closed.state.rearm();
    assert_eq!((*closed.state.ledger(), closed.state.mode()), (before, Mode::Hold));
    closed.last = None;
    closed.run(1);
    assert_eq!((closed.state.ledger().ticks.due, closed.last.unwrap().sequence), (1002, sequence + 1));
}

/// Long before the paddle is at its limit: corrections that act are what tells a wrong sign.
#[test]
fn a_sign_error_is_found_before_saturation() {
    let table = table();
    let mut closed = Loop::new(&table, &settings());
    closed.plant.jacobian = -jacobian();
    let mut limited = false;
    while closed.state.mode() != Mode::Safe {
        closed.tick(|_| {});
        limited |= closed.state.faults().contains(Faults::POSITION_LIMITED);
        assert!(closed.plant.tick < 5000, "never found");
    }
    assert!(closed.state.faults().contains(Faults::DIVERGENCE) && !limited);
}

#[test]
fn the_delay_and_the_gain_in_use_are_told() {
    let table = table();
    let controller = Controller::new(&table, &Settings::new(MS, 20 * MS, 38 * MS)).unwrap();
    assert_eq!(controller.delay_samples(), 2);
    assert!((controller.loop_gain() - 4.0 / 27.0).abs() < 1e-15);
}

/// A target that is pushed away so far that the paddle needs many samples to get there at its full rate.
#[test]
fn a_long_motion_at_full_rate_does_not_overshoot() {
    let table = table();
    let mut closed = Loop::new(&table, &Settings { loop_gain: Some(0.9), ..settings() });
    closed.plant.speed = 0.0;
    closed.plant.offset = 8e-3;
    let mut least: f64 = 8e-3;
    for _ in 0..2000 {
        closed.tick(|_| {});
        least = least.min(closed.plant.target().x);
    }
    assert!(least > -4e-4, "overshoot {least}");
    assert!(closed.plant.target().x.abs() < 1e-5, "{}", closed.plant.target().x);
}

#[test]
fn a_paddle_that_hangs_is_frozen_once_the_command_has_left_it() {
    let table = table();
    let mut closed = Loop::new(&table, &Settings { following_error: Some(1.0), ..settings() });
    closed.run(1000);
    let (stuck, commanded) = (closed.plant.paddle, Vector2::from(closed.last.unwrap().displacement));
    while !closed.state.faults().contains(Faults::FROZEN) {
        closed.tick(|inputs| inputs.paddle.as_mut().unwrap().displacement = stuck.into());
        assert!(closed.plant.tick < 4000, "never found");
    }
    // 0.5 % of the range, and what is on its way for two ticks at the full rate.
    let left = (Vector2::from(closed.last.unwrap().displacement) - commanded).norm();
    let admitted = 0.005 * 0.05 + 0.1 * 2e-3;
    assert!((admitted..admitted + 2e-4).contains(&left), "{left}, {admitted} admitted");
}

#[test]
fn counters_may_start_anywhere() {
    let table = table();
    let (mut zero, mut wrapping) = (Loop::new(&table, &settings()), Loop::new(&table, &settings()));
    wrapping.plant.sequence = u32::MAX - 5;
    for _ in 0..500 {
        assert_eq!(zero.tick(|_| {}).displacement, wrapping.tick(|_| {}).displacement);
    }
    assert_eq!(wrapping.state.ledger().needle.lost, 0);
}

#[test]
fn single_precision_follows_double() {
    let table = table();
    let single_table = table.cast::<f32>();
    single_table.validate().unwrap();
    let mut closed = Loop::new(&table, &settings());
    let single = Controller::new(&single_table, &settings()).unwrap();
    let mut state = State::<f32>::new();
    for _ in 0..5000 {
        let mut seen = Inputs::default();
        let command = closed.tick(|inputs| seen = *inputs);
        let other = single.step(&mut state, &seen);
        assert_eq!(other.state, command.state);
        let distance = Vector2::from(other.displacement) - Vector2::from(command.displacement);
        assert!(distance.norm() < 1e-6);
    }
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![4 => -0.1..0.1f64, 1 => any::<f64>()]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever arrives: no panic, limits on every command, nothing unaccounted.
    #[test]
    fn anything_may_arrive(
        seeds in prop::collection::vec(
            (any::<u8>(), 0u32..70, any_number(), any_number(), any::<u64>()),
            1..300,
        ),
        ill in any::<bool>(),
    ) {
        let mut table = table();
        if ill {
            for knot in &mut table.knots {
                knot.jacobian = Matrix2::new(0.3, 0.0, 0.0, 0.3 / 400.0);
            }
        }
        let mut closed = Loop::new(&table, &settings());
        closed.run(100);
        for (kind, shift, a, b, time) in seeds {
            closed.tick(|inputs| {
                let needle = inputs.needle.as_mut().unwrap();
                let paddle = inputs.paddle.as_mut().unwrap();
                match kind % 12 {
                    0 => (needle.depth, needle.velocity) = (a, b),
                    1 => needle.sequence = needle.sequence.wrapping_sub(shift),
                    2 => needle.time_ns = time,
                    3 => paddle.displacement = [a, b],
                    4 => paddle.sequence = paddle.sequence.wrapping_add(shift),
                    5 => inputs.target = Some(TargetSample {
                        sequence: shift,
                        flags: 1,
                        time_ns: inputs.time_ns,
                        displacement: [a, b],
                    }),
                    6 => inputs.needle = None,
                    7 if kind > 200 => inputs.time_ns = time,
                    8 if kind > 200 => inputs.tick = time,
                    _ => {}
                }
            });
            if closed.state.mode() == Mode::Safe && kind % 5 == 0 {
                closed.state.rearm();
                // Re-arming adopts the measured position, which the limits do not bind to the last command.
                closed.last = None;
            }
        }
    }
}
