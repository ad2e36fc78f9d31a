//! How well the target is held, and where the loop stops being stable.

use super::*;
use crate::controller::feedback::Setting;
use crate::controller::state::{Added, Underway};
use crate::inputs::sample::Measurement;
use crate::law::Feedback;

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
        let mut closed = Loop::new(&table, &Settings { direction: Some(direction), ..settings() });
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
    table.paddles[0].max_rate = 1e3;
    let limit = loop_stability::gain_limit(0.0, 1);
    let settings = Settings { feedback: Feedback::Integral, loop_gain: Some(ratio * limit), ..settings() };
    let mut closed = Loop::new(&table, &settings);
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

/// What saturation swallows proves nothing about the sign of the plant.
#[test]
fn monitors_hear_of_corrections_that_act_by_more_than_half() {
    let table = table();
    let controller = Controller::new(&table, &Settings { feedback: Feedback::Integral, ..settings() }).unwrap();
    // A quarter of the error is to be removed.
    let (error, size) = (-4e-3, 1e-3);
    let correction = jacobian().try_inverse().unwrap() * Vector2::new(size, 0.0);
    let sample = Measurement { sequence: 0, time_ns: 0, values: [error, 0.0] };
    for (room, heard) in [(2.0, true), (0.6, true), (0.4, false), (0.0, false)] {
        let previous = correction.normalize() * 0.05 - correction * room;
        let added = Some(Added { now: previous, at_sample: previous });
        let state = State { added, ..State::new() };
        let setting = Setting {
            time_ns: 0,
            location: table.locate(0.0).unwrap(),
            feed_forward: Vector2::zeros(),
            previous,
            limits: controller.runtime.paddles.map(|paddle| paddle.limits),
        };
        let found = controller.integrate(&state, Some(sample), &setting).correction;
        let found = found.map(|found| (found.error, found.size, found.acted));
        assert_eq!(found, Some((-error, size, Some(heard))), "room for {room}");
    }
}

/// The table's path where the needle will be once the command acts, and what the feedback adds to it.
#[test]
fn a_command_is_the_path_ahead_of_the_needle_and_the_feedback() {
    let table = table();
    let mut closed = Loop::new(&table, &Settings { actuator_delay_ns: 3 * MS, ..settings() });
    assert_eq!(closed.state.added(), None);
    closed.plant.push = 0.03;
    closed.run(1000);
    let [depth, velocity] = closed.state.needle.accepted.unwrap().values;
    for silence in 1..=4 {
        let command = closed.tick(|inputs| inputs.needle = None);
        assert!(!closed.state.faults().contains(Faults::RATE_LIMITED));
        let ahead = depth + velocity * 1e-3 * f64::from(silence + 3);
        let expected =
            table.knots[0].paddle_path_slope * ahead + Vector2::from(to_plane(closed.state.added().unwrap()[0]));
        let off = (Vector2::from(to_plane(command.displacement[0])) - expected).norm();
        assert!(off < 1e-15, "{silence} ticks after the last sample: {off}");
    }
}

#[test]
fn a_motion_at_full_rate_is_one_as_long_as_no_tick_is_without_it() {
    let table = table();
    let mut closed = Loop::new(&table, &settings());
    closed.plant.speed = 0.0;
    closed.plant.offset = 8e-3;
    let (mut begun, mut longest) = (None, 0);
    for tick in 0..1000 {
        closed.tick(|_| {});
        if !closed.state.faults().contains(Faults::RATE_LIMITED) {
            begun = None;
            continue;
        }
        let since = *begun.get_or_insert(tick);
        let underway = closed.state.underway.unwrap();
        // Its last step shows after a tick and the delay of the actuator, which is as long.
        assert_eq!((underway.since_ns, underway.until_ns), (since * MS, (tick + 2) * MS));
        longest = longest.max(tick - since);
    }
    assert!(longest > 10, "{longest}");
}

#[test]
fn a_motion_explains_corrections_that_were_measured_in_it_and_ask_for_more_of_it() {
    let motion = Underway { since_ns: 10, until_ns: 20, step: Vector2::new(1.0, 0.0) };
    let more = Vector2::new(0.5, -3.0);
    for (time_ns, explained) in [(9, false), (10, false), (11, true), (19, true), (20, false), (21, false)] {
        assert_eq!(motion.explains(time_ns, &more), explained, "{time_ns}");
    }
    assert!(!motion.explains(15, &-more) && !motion.explains(15, &Vector2::new(0.0, 1.0)));
}

/// The ways of the paddle that the gate for jumps of the target allows for.
#[test]
fn the_way_of_the_paddle_is_summed_along_both_axes() {
    let table = table();
    let mut closed = Loop::new(&table, &settings());
    closed.plant.push = 0.035;
    let mut way = [0.0; 2];
    let mut before: Option<[f64; 2]> = None;
    for _ in 0..3000 {
        let command = closed.tick(|_| {});
        if !command.is_valid() {
            continue;
        }
        if let Some(before) = before {
            way = core::array::from_fn(|axis| way[axis] + (command.displacement[0][axis] - before[axis]).abs());
        }
        before = Some(to_plane(command.displacement[0]));
    }
    assert!(way.iter().all(|along| *along > 1e-4), "{way:?}");
    let summed = closed.state.gate.travel.paddles[0];
    assert!((0..2).all(|axis| (summed[axis] - way[axis]).abs() < 1e-12), "{summed:?} instead of {way:?}");
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
        let distance =
            Vector2::from(to_plane(other.displacement[0])) - Vector2::from(to_plane(command.displacement[0]));
        assert!(distance.norm() < 1e-6);
    }
}

/// Root mean square of the orthogonal error over an insertion of 5 s, with a sensor whose noise is six times what the
/// table's tissue is thought to be off by at the end; mean over seeds.
fn root_mean_square(settings: &Settings, push: f64) -> f64 {
    const NOISE: f64 = 1.8e-3;
    const SEEDS: u64 = 20;
    let table = table();
    let mean_square = |seed: u64| {
        let mut closed = Loop::new(&table, &Settings { target_noise: NOISE, ..*settings });
        closed.plant.push = push;
        let mut random = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        // Uniform of unit variance (xorshift).
        let mut deviate = || {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            ((random >> 11) as f64 / (1u64 << 53) as f64 - 0.5) * 12f64.sqrt()
        };
        let mut squares = 0.0;
        for _ in 0..5000 {
            closed.tick(|inputs| {
                for component in inputs.target.iter_mut().flat_map(|sample| &mut sample.displacement) {
                    *component += NOISE * deviate();
                }
            });
            squares += closed.plant.target().x.powi(2);
        }
        assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
        squares / 5000.0
    };
    ((1..=SEEDS).map(mean_square).sum::<f64>() / SEEDS as f64).sqrt()
}

/// With a sensor that is poor against the table, using it must not be worse than not using it, nor than trusting it.
#[test]
fn feedback_does_not_hurt() {
    let integral = Settings { feedback: Feedback::Integral, ..settings() };
    let none = Settings { loop_gain: Some(1e-9), ..integral };
    for (push, bound) in [(0.02, 1.2e-4), (0.023, 1.4e-4), (0.026, 2.5e-4), (0.04, 6e-4)] {
        let [by_table, by_sensor, observed] =
            [none, integral, settings()].map(|settings| root_mean_square(&settings, push));
        assert!(observed < bound, "push {push}: {observed}");
        assert!(observed < by_sensor, "push {push}: {observed} against {by_sensor} by the sensor alone");
        // The table alone is best where it is right, which nobody knows.
        assert!(observed < by_table.max(1.2e-4), "push {push}: {observed} against {by_table} by the table alone");
    }
}

/// With a good sensor: what the table leaves grows with the depth, and an integral lags behind it.
#[test]
fn the_observer_does_not_lag_behind_a_ramp() {
    let table = table();
    let halfway = |feedback| {
        let mut closed = Loop::new(&table, &Settings { feedback, target_noise: 1e-5, ..settings() });
        closed.plant.push = 0.035;
        closed.run(3000);
        closed.plant.target().x.abs()
    };
    let (integral, observer) = (halfway(Feedback::Integral), halfway(Feedback::Observer));
    assert!(integral > 1e-5 && observer < 0.02 * integral, "{integral} {observer}");
}

/// A servo that is slower than thought, and tissue that answers more or less than thought: no offset, no instability.
#[test]
fn the_observer_bears_an_effect_that_is_not_the_table_s() {
    let table = table();
    for scale in [0.3, 0.7, 1.3, 2.0, 3.0] {
        for actuator_gain in [0.99, 1.0] {
            let mut closed = Loop::new(&table, &settings());
            closed.plant.jacobian = jacobian() * scale;
            closed.plant.actuator_gain = actuator_gain;
            closed.run(9000);
            let left = closed.plant.target().x.abs();
            assert_eq!(closed.state.mode(), Mode::Run, "{scale}: {}", closed.state.faults());
            assert!(left < 1e-6, "effect {scale}, gain {actuator_gain}: {left}");
        }
    }
}

/// A slow sensor of a patient who breathes fast: between two samples the paddle goes the breath's way, and not straight on.
#[test]
fn between_samples_a_breath_turns() {
    let table = table();
    let slow = Settings { target_period_ns: 200 * MS, feedback: Feedback::Harmonic, target_noise: 2e-4, ..settings() };
    let mut closed = Loop::new(&table, &slow);
    closed.plant.target_period = 200;
    closed.plant.speed = 0.0;
    let mut worst = 0.0f64;
    for tick in 0..60_000 {
        closed.plant.offset = 2e-3 * (1.0 - (core::f64::consts::PI * f64::from(tick) / 2000.0).cos().powi(4));
        closed.tick(|_| {});
        worst = if tick < 40_000 { worst } else { worst.max(closed.plant.target().x.abs()) };
    }
    assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
    assert!(worst < 2e-5, "{worst} of 2e-3");
}
