//! What an attack found: one module per row, the class behind it by generated histories.

use proptest::prelude::*;

use super::*;
use crate::contract::{Field, NeedleSample, PaddleSample};
use crate::detection::FOLLOWING_FRACTION;

/// Largest paddle displacement, rate per second, and depth range of the table.
const RANGE: f64 = 0.05;
const RATE: f64 = 0.1;
const DEPTH: f64 = 0.1;
/// What the paddle's sensor resolves: a tenth of the following error.
const RESOLUTION: f64 = 0.1 * FOLLOWING_FRACTION * RANGE;

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (Vector2::from(a) - Vector2::from(b)).norm()
}

mod adoption {
    use super::*;

    #[test]
    fn a_measurement_from_long_ago_is_not_adopted() {
        let table = table();
        let controller = Controller::new(&table, &settings()).unwrap();
        let mut state = State::new();
        let mut plant = Plant::new();
        plant.tick = 20_000;
        for tick in 0..200 {
            let mut inputs = plant.sense();
            if tick == 0 {
                let paddle = inputs.paddle.as_mut().unwrap();
                (paddle.time_ns, paddle.displacement) = (paddle.time_ns - 10_000 * MS, [RANGE, 0.0]);
            }
            let command = controller.step(&mut state, &inputs);
            assert!(!command.is_valid() || distance(command.displacement, [0.0; 2]) < 0.1 * RANGE, "tick {tick}");
            plant.act(&command);
        }
        assert_eq!(state.mode(), Mode::Run, "{}", state.faults());
    }

    #[test]
    fn a_measurement_beyond_the_limit_is_not_adopted_and_says_so() {
        let table = table();
        let mut closed = Loop::new(&table, &settings());
        closed.plant.paddle = Vector2::new(1.09 * RANGE, 0.0);
        let mut codes = Faults::NONE;
        for _ in 0..200 {
            assert!(!closed.tick(|_| {}).is_valid());
            codes |= closed.state.faults();
        }
        assert!(codes.contains(Faults::PADDLE_BEYOND_LIMIT), "{codes}");
        // By what the sensor resolves it may be beyond.
        closed.plant.paddle = Vector2::new(RANGE + 0.9 * RESOLUTION, 0.0);
        closed.run(500);
        assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
    }

    #[test]
    fn a_moving_paddle_is_not_adopted_and_says_so() {
        let table = table();
        let mut closed = Loop::new(&table, &settings());
        let mut codes = Faults::NONE;
        for tick in 0..300 {
            closed.plant.paddle.x = 1e-4 * f64::from(tick);
            assert!(!closed.tick(|_| {}).is_valid());
            codes |= closed.state.faults();
        }
        assert!(codes.contains(Faults::PADDLE_MOVING), "{codes}");
        closed.run(100);
        assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
    }

    #[test]
    fn the_adopted_position_expires_with_its_measurement() {
        let table = table();
        let mut closed = Loop::new(&table, &settings());
        // Adopted, but never armed: the target is not seen.
        for _ in 0..50 {
            closed.tick(|inputs| inputs.target = None);
        }
        assert!(closed.last.unwrap().is_valid());
        for _ in 0..400 {
            closed.tick(|inputs| (inputs.target, inputs.paddle) = (None, None));
        }
        assert!(!closed.last.unwrap().is_valid(), "nobody knows where the paddle is");
        closed.plant.paddle = Vector2::new(0.0, 0.02);
        let first = (0..50).map(|_| closed.tick(|_| {})).find(PaddleCommand::is_valid);
        assert_eq!(first.unwrap().displacement, [0.0, 0.02]);
    }

    #[test]
    fn a_paddle_that_somebody_moves_before_the_start_is_adopted_anew() {
        let table = table();
        let mut closed = Loop::new(&table, &settings());
        for _ in 0..50 {
            closed.tick(|inputs| inputs.target = None);
        }
        closed.plant.paddle = Vector2::new(0.0, 0.02);
        for _ in 0..50 {
            // The actuator is held by somebody: commands do not move it.
            let mut inputs = closed.plant.sense();
            inputs.target = None;
            let command = closed.controller.step(&mut closed.state, &inputs);
            assert!(!command.is_valid() || command.displacement == [0.0, 0.02]);
        }
        closed.last = None;
        closed.run(100);
        assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
    }

    proptest! {
        /// A paddle that moves steadily and then rests, or does not; samples that come late, twice, or not at all.
        #[test]
        fn the_first_valid_command_is_where_the_paddle_is(
            start in (-0.6..0.6f64, -0.6..0.6f64),
            velocity in (-1.0..1.0f64, -1.0..1.0f64),
            slowness in 0..5i32,
            moves_until in 0..400u64,
            ages in prop::collection::vec((0..12u64, any::<bool>()), 400),
            first_age in 0..20_000u64,
        ) {
            // Where it rests in the end, and how it comes there.
            let truth = |tick: u64| {
                let left = 1e-3 * (20_000 + moves_until).saturating_sub(tick) as f64;
                let speed = RATE * 10f64.powi(-slowness);
                [start.0 * RANGE - velocity.0 * speed * left, start.1 * RANGE - velocity.1 * speed * left]
            };
            let table = table();
            let controller = Controller::new(&table, &settings()).unwrap();
            let mut state = State::<f64>::new();
            for (i, (age, arrives)) in ages.into_iter().enumerate() {
                let tick = 20_000 + i as u64;
                let age = if i == 0 { first_age } else { age };
                // What is 20 s old was measured elsewhere.
                let displacement = if i == 0 && age > 100 { [RANGE, 0.0] } else { truth(tick - age) };
                let sample =
                    PaddleSample { sequence: i as u32, paddle_index: 3, time_ns: (tick - age) * MS, displacement };
                let paddle = (arrives || i == 0).then_some(sample);
                let inputs = Inputs { tick, time_ns: tick * MS, paddle, ..Inputs::default() };
                let command = controller.step(&mut state, &inputs);
                if command.is_valid() {
                    let off = distance(command.displacement, truth(tick));
                    prop_assert!(off <= RESOLUTION * (1.0 + 1e-9), "tick {}: {} off", tick, off);
                    break;
                }
            }
        }

        /// A paddle that follows, hangs, slips, or is taken away by somebody for a while.
        #[test]
        fn no_valid_command_is_far_from_the_last_measurement(
            events in prop::collection::vec((0..6u8, 1..200u32, -1.0..1.0f64, -1.0..1.0f64), 1..12),
        ) {
            let table = table();
            let mut closed = Loop::new(&table, &settings());
            closed.plant.push = 0.05;
            let mut away = 0;
            for (kind, ticks, x, y) in events {
                for _ in 0..ticks {
                    let mut inputs = closed.plant.sense();
                    if kind == 0 {
                        inputs.paddle = None;
                    }
                    let consumed = closed.state.ledger().paddle.consumed;
                    let command = closed.controller.step(&mut closed.state, &inputs);
                    let mut moved = closed.plant.paddle;
                    match kind {
                        1 => {}
                        2 => moved = Vector2::new(0.5 * RANGE * x, 0.5 * RANGE * y),
                        3 if command.is_valid() => moved = Vector2::from(command.displacement) * 0.5,
                        _ if command.is_valid() => moved = Vector2::from(command.displacement),
                        _ => {}
                    }
                    closed.plant.act(&command);
                    closed.plant.paddle = moved;
                    if !command.is_valid() {
                        away = 0;
                    }
                    // A position that is refused, as frozen, is no measurement.
                    let is_accepted = closed.state.ledger().paddle.consumed > consumed;
                    let Some(last) = inputs.paddle.filter(|_| command.is_valid() && is_accepted) else { continue };
                    let age = 1e-3 * (inputs.tick - last.time_ns / MS) as f64;
                    let explained = FOLLOWING_FRACTION * RANGE + RATE * (age + 2e-3 + 1e-3);
                    let off = distance(command.displacement, last.displacement);
                    // Further away in no more samples than the following error takes to be certain.
                    away = if off > explained { away + 1 } else { 0 };
                    // A command is compared with the next sample.
                    prop_assert!(away <= 21, "{} off in {} samples", off, away);
                    if closed.state.mode() == Mode::Safe && kind == 5 {
                        closed.state.rearm();
                    }
                }
            }
        }
    }
}

mod sequences {
    use super::*;
    use std::vec::Vec;

    use crate::detection::RESTART_SAMPLES;

    /// One sample of `stream` with the number `by` further on, and with bad content if asked for.
    fn poison(inputs: &mut Inputs, stream: usize, by: u32, bad: Option<f64>) {
        match stream {
            0 => {
                let needle = inputs.needle.as_mut().unwrap();
                needle.sequence = needle.sequence.wrapping_add(by);
                needle.depth = bad.unwrap_or(needle.depth);
            }
            1 => {
                let target = inputs.target.as_mut().unwrap();
                target.sequence = target.sequence.wrapping_add(by);
                target.displacement[0] = bad.unwrap_or(target.displacement[0]);
            }
            _ => {
                let paddle = inputs.paddle.as_mut().unwrap();
                paddle.sequence = paddle.sequence.wrapping_add(by);
                paddle.displacement[0] = bad.unwrap_or(paddle.displacement[0]);
            }
        }
    }

    #[test]
    fn a_refused_sample_with_a_number_far_ahead_costs_itself_alone() {
        let table = table();
        for stream in 0..3 {
            for armed in [true, false] {
                let mut closed = Loop::new(&table, &settings());
                // The first target sample arrives with tick 20.
                closed.run(if armed { 1020 } else { 20 });
                closed.tick(|inputs| poison(inputs, stream, 0x7fff_fff0, Some(f64::NAN)));
                closed.run(100);
                assert_eq!(closed.state.mode(), Mode::Run, "stream {stream}: {}", closed.state.faults());
                closed.run(1000);
                assert_eq!(closed.state.mode(), Mode::Run, "stream {stream}: {}", closed.state.faults());
            }
        }
    }

    proptest! {
        #[test]
        fn no_refused_sample_makes_a_stream_miss_another(
            stream in 0..3usize,
            ahead in prop_oneof![0..200u32, 0..0x7fff_ffffu32],
            bad in prop_oneof![Just(f64::NAN), Just(1e3), Just(-1e300), Just(5e-324)],
        ) {
            let table = table();
            let mut closed = Loop::new(&table, &settings());
            closed.run(1020);
            closed.tick(|inputs| poison(inputs, stream, ahead, Some(bad)));
            let consumed = |state: &State<f64>| {
                let ledger = state.ledger();
                [ledger.needle.consumed, ledger.target.consumed, ledger.paddle.consumed]
            };
            let before = consumed(&closed.state);
            closed.run(200);
            let used: Vec<u64> = consumed(&closed.state).iter().zip(before).map(|(now, then)| now - then).collect();
            // The number itself, when it comes again in its turn, has been seen.
            let sent = [200, 10, 200];
            for (i, (used, sent)) in used.iter().zip(sent).enumerate() {
                let again = u64::from(i == stream && ahead != 0);
                prop_assert!(used + again >= sent, "stream {}: {} of {}", i, used, sent);
            }
            prop_assert_eq!(closed.state.mode(), Mode::Run);
        }

        /// Numbers that start anywhere: before, within, or far from those before, as after a restart.
        #[test]
        fn a_sender_that_counts_anew_is_taken_up_again(stream in 0..3usize, offset: u32) {
            let table = table();
            let mut closed = Loop::new(&table, &settings());
            closed.run(1020);
            for _ in 0..(20 * (RESTART_SAMPLES + 1)) {
                closed.tick(|inputs| if inputs.target.is_some() || stream != 1 { poison(inputs, stream, offset, None) });
            }
            let faults = closed.state.faults();
            prop_assert_eq!(closed.state.mode(), Mode::Run, "offset {}: {}", offset, faults);
            let ledger = closed.state.ledger();
            prop_assert_eq!(ledger.unaccounted(), 0);
        }
    }

    #[test]
    fn fewer_samples_than_it_takes_do_not_take_a_stream_over() {
        let table = table();
        let mut closed = Loop::new(&table, &settings());
        closed.run(1000);
        for _ in 0..RESTART_SAMPLES - 1 {
            closed.tick(|inputs| poison(inputs, 0, 1 << 30, None));
        }
        let consumed = closed.state.ledger().needle.consumed;
        closed.tick(|_| {});
        assert_eq!(closed.state.ledger().needle.consumed, consumed + 1, "the old numbers go on");
        for _ in 0..RESTART_SAMPLES {
            closed.tick(|inputs| poison(inputs, 0, 1 << 30, None));
        }
        assert_eq!(closed.state.ledger().needle.consumed, consumed + 2, "and the new ones are believed at the last");
    }

    #[test]
    fn old_samples_sent_again_do_not_take_a_stream_over() {
        let table = table();
        let mut closed = Loop::new(&table, &settings());
        let mut old: Vec<NeedleSample> = Vec::new();
        for _ in 0..200 {
            closed.tick(|inputs| old.extend(inputs.needle));
        }
        let consumed = closed.state.ledger().needle.consumed;
        for sample in old {
            closed.tick(|inputs| inputs.needle = Some(sample));
        }
        assert_eq!(closed.state.ledger().needle.consumed, consumed);
    }
}

mod too_often {
    use super::*;

    #[test]
    fn a_paddle_that_is_off_in_most_samples_is_found() {
        let table = table();
        for (off, of) in [(19, 20), (10, 20), (6, 20)] {
            let mut closed = Loop::new(&table, &settings());
            closed.run(1000);
            let mut tick = 0;
            let found = closed.until_safe(|inputs| {
                let paddle = inputs.paddle.as_mut().unwrap();
                if paddle.sequence % of < off {
                    paddle.displacement[1] += 45.0 * FOLLOWING_FRACTION * RANGE;
                }
            });
            tick += found.unwrap_or(2000);
            assert!(closed.state.faults().contains(Faults::FOLLOWING_ERROR), "{off} of {of}: {tick}");
        }
    }

    #[test]
    fn skipped_releases_before_every_other_tick_are_found() {
        let table = table();
        for rest in [0, 1, 2, 3] {
            let mut closed = Loop::new(&table, &settings());
            closed.run(1000);
            let safe = (0..200).find(|_| {
                closed.plant.tick += 1;
                closed.run(1 + rest);
                closed.state.mode() == Mode::Safe
            });
            assert!(safe.is_some(), "{rest} good ticks between two skipped");
            assert!(closed.state.faults().contains(Faults::OVERRUN));
        }
    }

    #[test]
    fn rare_skipped_releases_are_no_fault() {
        let table = table();
        let mut closed = Loop::new(&table, &settings());
        for _ in 0..200 {
            closed.plant.tick += 1;
            closed.run(10);
        }
        assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
    }
}

mod frozen {
    use super::*;
    use crate::detection::NEEDLE_CONTRADICTION_TRAVEL;

    /// Rounded to steps of `step`.
    fn rounded(value: f64, step: f64) -> f64 {
        (value / step).round() * step
    }

    #[test]
    fn a_coarse_healthy_target_is_not_frozen() {
        let table = table();
        for step in [0.02 * DEPTH, 0.005 * DEPTH, 1e-6 * DEPTH] {
            for speed in [0.02, 0.002, 0.0005] {
                // Rounding to steps is noise of this deviation.
                let target_noise = step / 12f64.sqrt();
                let mut closed = Loop::new(&table, &Settings { target_noise, ..settings() });
                closed.plant.speed = speed;
                for _ in 0..6000 {
                    closed.tick(|inputs| {
                        if let Some(target) = &mut inputs.target {
                            target.displacement = target.displacement.map(|value| rounded(value, step));
                        }
                    });
                }
                let faults = closed.state.faults();
                let frozen = closed.state.ledger().target.discarded_for(Discard::Frozen);
                assert_eq!((closed.state.mode(), frozen), (Mode::Run, 0), "step {step} speed {speed}: {faults}");
            }
        }
    }

    #[test]
    fn an_encoder_that_trembles_at_rest_does_not_travel() {
        let table = table();
        let mut closed = Loop::new(&table, &settings());
        closed.plant.speed = 0.0;
        closed.plant.depth = 0.05;
        for tick in 0..5000 {
            closed.tick(|inputs| {
                let needle = inputs.needle.as_mut().unwrap();
                let sign = if tick % 2 == 0 { 1.0 } else { -1.0 };
                needle.depth += sign * 0.001 * DEPTH;
                if let Some(target) = &mut inputs.target {
                    target.displacement = [0.0, -0.005];
                }
            });
        }
        assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
        assert_eq!(closed.state.ledger().target.discarded_for(Discard::Frozen), 0);
    }

    #[test]
    fn depth_and_velocity_are_checked_against_each_other() {
        let table = table();
        // Frozen depth; velocity stuck at zero, at another value, or with the wrong sign.
        for (depth_moves, factor) in [(false, 1.0), (true, 0.0), (true, 2.5), (true, -1.0)] {
            let mut closed = Loop::new(&table, &settings());
            closed.run(1000);
            let (stopped, refused) = (closed.plant.depth, closed.state.ledger().needle.discarded_for(Discard::Frozen));
            let travel = |plant: &Plant| plant.depth - stopped;
            while closed.state.ledger().needle.discarded_for(Discard::Frozen) == refused {
                closed.tick(|inputs| {
                    let needle = inputs.needle.as_mut().unwrap();
                    if !depth_moves {
                        needle.depth = stopped;
                    }
                    needle.velocity *= factor;
                });
                assert!(travel(&closed.plant) <= NEEDLE_CONTRADICTION_TRAVEL * DEPTH, "velocity × {factor}");
            }
        }
    }

    proptest! {
        /// Healthy needles: any speed profile within the limits, encoders and velocities with noise, gaps.
        #[test]
        fn a_healthy_needle_is_never_refused(
            profile in prop::collection::vec((-0.1..0.1f64, 1..300u32), 1..12),
            calibration in 0.9..1.1f64,
            resolution in prop_oneof![Just(1e-9), Just(1e-5), Just(2e-4)],
            gaps in any::<bool>(),
        ) {
            let table = table();
            let controller = Controller::new(&table, &settings()).unwrap();
            let mut state = State::<f64>::new();
            let (mut depth, mut velocity, mut tick) = (0.05, 0.0, 0u64);
            for (goal, ticks) in profile {
                for _ in 0..ticks {
                    let before = velocity;
                    velocity += (goal - velocity).clamp(-1e-3, 1e-3);
                    depth += 0.5e-3 * (before + velocity);
                    if !(0.0..=0.1).contains(&depth) {
                        (depth, velocity) = (depth.clamp(0.0, 0.1), 0.0);
                    }
                    let needle = NeedleSample {
                        sequence: tick as u32,
                        reserved: 0,
                        time_ns: tick * MS,
                        depth: rounded(depth, resolution),
                        velocity: calibration * velocity,
                    };
                    let missing = gaps && tick % 97 < 40;
                    let inputs =
                        Inputs { tick, time_ns: tick * MS, needle: (!missing).then_some(needle), ..Inputs::default() };
                    controller.step(&mut state, &inputs);
                    tick += 1;
                }
            }
            let refused: u64 = state.ledger().needle.discarded.iter().sum();
            prop_assert_eq!(refused, 0);
        }
    }
}

mod proportions {
    use super::*;
    use crate::contract::TableError;

    #[test]
    fn no_velocity_lets_the_depth_jump() {
        let table = table();
        for velocity in [1e300, -1e300, 1e3, f64::MAX, 1.01] {
            let mut closed = Loop::new(&table, &settings());
            closed.run(1000);
            let depth = closed.plant.depth;
            closed.tick(|inputs| {
                let needle = inputs.needle.as_mut().unwrap();
                (needle.depth, needle.velocity) = (0.09, velocity);
            });
            assert_eq!(closed.state.ledger().needle.discarded.iter().sum::<u64>(), 1, "velocity {velocity}");
            closed.tick(|inputs| inputs.needle.as_mut().unwrap().depth = 0.09);
            assert_eq!(closed.state.ledger().needle.discarded.iter().sum::<u64>(), 2, "velocity {velocity}");
            assert!(depth < 0.05);
        }
    }

    proptest! {
        /// Whatever one sample says: the accepted depth moves no further than ten times the limit of speed explains.
        #[test]
        fn one_sample_moves_the_depth_by_little(depth in 0.0..0.1f64, velocity: f64) {
            let table = table();
            let mut closed = Loop::new(&table, &settings());
            closed.run(1000);
            let before = closed.plant.depth;
            let consumed = closed.state.ledger().needle.consumed;
            closed.tick(|inputs| {
                let needle = inputs.needle.as_mut().unwrap();
                (needle.depth, needle.velocity) = (depth, velocity);
            });
            let accepted = closed.state.ledger().needle.consumed > consumed;
            prop_assert!(!accepted || (depth - before).abs() <= 0.04 * DEPTH);
        }
    }

    #[test]
    fn no_huge_number_passes_in_a_table() {
        type Change = fn(&mut Table<f64, 2>, f64);
        let changes: [(&str, Change); 17] = [
            ("rate", |t, x| t.paddle.max_rate = x),
            ("needle speed", |t, x| t.validity.needle_speed = x),
            ("paddle range", |t, x| (t.paddle.max_displacement, t.validity.paddle_displacement) = (x, x)),
            ("valid range", |t, x| t.validity.paddle_displacement = x),
            ("segment start", |t, x| t.paddle.segment[0].x = x),
            ("segment end", |t, x| t.paddle.segment[1].y = -x),
            ("target position", |t, x| t.target_position.y = x),
            ("depth end", |t, x| (t.validity.depth_end, t.knots[10].depth) = (x, x)),
            ("depth start", |t, x| (t.validity.depth_start, t.knots[0].depth) = (-x, -x)),
            ("Jacobian", |t, x| t.knots[4].jacobian *= x),
            ("path slope", |t, x| t.knots[0].paddle_path_slope.x = x),
            ("last path slope", |t, x| t.knots[10].paddle_path_slope.y = -x),
            ("target", |t, x| t.knots[5].target_displacement.x = x),
            ("target slope", |t, x| t.knots[5].target_displacement_slope.y = x),
            ("static target", |t, x| t.knots[5].static_target_displacement.x = -x),
            ("path", |t, x| t.knots[5].paddle_path.x = x),
            ("lambda", |t, x| t.gains.lambda_max = x),
        ];
        for (name, change) in changes {
            for huge in [1e300, 1e150, f64::MAX, 1e20, 1e6] {
                let mut table = table();
                change(&mut table, huge);
                // The margin of the gain is a setting, too, and checked as one.
                let refused = table.validate().is_err() || Controller::new(&table, &settings()).is_err();
                assert!(refused, "{name} = {huge}");
            }
        }
    }

    #[test]
    fn proportions_are_refused_at_their_limits() {
        let refused = |change: fn(&mut Table<f64, 2>)| {
            let mut table = table();
            change(&mut table);
            table.validate()
        };
        let field = |field| Err(TableError::Implausible { field });
        // 100 crossings per second; the paddle's range is 0.05, the table's depth 0.1.
        assert_eq!(refused(|t| t.paddle.max_rate = 4.99), Ok(()));
        assert_eq!(refused(|t| t.paddle.max_rate = 5.01), field(Field::PaddleRateLimit));
        assert_eq!(refused(|t| t.validity.needle_speed = 9.99), Ok(()));
        assert_eq!(refused(|t| t.validity.needle_speed = 10.01), field(Field::NeedleSpeedLimit));
        // A slope of 33.75 over an interval of 0.01 lifts the path by 0.05.
        assert_eq!(refused(|t| t.knots[3].paddle_path_slope = Vector2::new(33.7, 0.0)), Ok(()));
        assert_eq!(refused(|t| t.knots[3].paddle_path_slope = Vector2::new(33.8, 0.0)), field(Field::PaddlePathSlope));
        assert_eq!(refused(|t| t.knots[3].target_displacement_slope = Vector2::new(0.0, 2.99)), Ok(()));
        let steep = refused(|t| t.knots[3].target_displacement_slope = Vector2::new(0.0, 3.01));
        assert_eq!(steep, field(Field::TargetDisplacementSlope));
        // ‖J‖ = 0.396.
        assert_eq!(refused(|t| t.knots[3].jacobian *= 252.0), Ok(()));
        assert_eq!(refused(|t| t.knots[3].jacobian *= 253.0), field(Field::KnotJacobian));
        // From (0.5, 0.5) to (0.1, 0.4) it is 0.412: ten times that and the depth are 5.12.
        assert_eq!(refused(|t| t.validity.paddle_displacement = 5.12), Ok(()));
        assert_eq!(refused(|t| t.validity.paddle_displacement = 5.13), field(Field::ValidPaddleDisplacement));
        let far = |t: &mut Table<f64, 2>| t.target_position.x = 100.3;
        assert_eq!(refused(far), field(Field::DistanceFromPaddleToTarget));
        let near = |t: &mut Table<f64, 2>| t.paddle.segment = [t.target_position.add_scalar(5e-5); 2];
        assert_eq!(refused(near), field(Field::DepthRange));
    }
}

mod clock {
    use super::*;

    #[test]
    fn a_tick_from_the_far_future_does_not_lock_the_controller_out() {
        let table = table();
        for garbage in [(0, 1 << 63), (1 << 63, 0), (1 << 62, 1 << 62), (0, 3_600_000 * MS), (100_000, 0)] {
            let mut closed = Loop::new(&table, &settings());
            closed.run(1000);
            let integral = closed.state.integral();
            closed.tick(|inputs| {
                inputs.tick += garbage.0;
                inputs.time_ns += garbage.1;
            });
            assert_eq!(closed.state.mode(), Mode::Safe);
            assert!(closed.state.faults().contains(Faults::CLOCK_JUMPED), "{}", closed.state.faults());
            assert_eq!(closed.state.integral(), integral);
            closed.run(10);
            closed.state.rearm();
            closed.last = None;
            closed.run(100);
            assert_eq!(closed.state.mode(), Mode::Run, "{garbage:?}: {}", closed.state.faults());
        }
    }

    #[test]
    fn a_clock_that_really_jumped_is_believed_after_rearming() {
        let table = table();
        let mut closed = Loop::new(&table, &settings());
        closed.run(1000);
        closed.plant.tick += 3_600_000;
        let hour = |inputs: &mut Inputs| inputs.tick -= 3_600_000;
        closed.tick(hour);
        assert!(closed.state.faults().contains(Faults::CLOCK_JUMPED));
        closed.state.rearm();
        closed.last = None;
        for _ in 0..100 {
            closed.tick(hour);
        }
        assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
    }

    #[test]
    fn a_pause_with_numbers_and_time_in_step_is_no_jump() {
        let table = table();
        let mut closed = Loop::new(&table, &settings());
        closed.plant.speed = 0.0;
        closed.run(1000);
        closed.plant.tick += 200;
        closed.run(100);
        assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
        closed.plant.tick += 100_000;
        closed.run(1);
        assert!(!closed.state.faults().contains(Faults::CLOCK_JUMPED), "{}", closed.state.faults());
    }

    #[test]
    fn equal_times_are_a_fault() {
        let table = table();
        let mut closed = Loop::new(&table, &settings());
        closed.run(1000);
        let stuck = (closed.plant.tick - 1) * MS;
        closed.tick(|inputs| inputs.time_ns = stuck);
        assert!(closed.state.faults().contains(Faults::CLOCK_REVERSED), "{}", closed.state.faults());
    }

    proptest! {
        /// Whatever the times of the ticks: the paddle goes no further than its rate explains.
        #[test]
        fn the_rate_limit_is_one_per_second(steps in prop::collection::vec(1..2_500_000u64, 50..400)) {
            let table = table();
            let controller = Controller::new(&table, &settings()).unwrap();
            let mut state = State::new();
            let mut plant = Plant::new();
            plant.push = 0.3;
            plant.depth = 0.1;
            plant.speed = 0.0;
            let (mut time_ns, mut travelled) = (0, 0.0);
            let mut last: Option<PaddleCommand> = None;
            for (tick, step) in steps.into_iter().enumerate() {
                // In step until RUN.
                let elapsed_ns = if tick < 40 { MS } else { step };
                time_ns += elapsed_ns;
                let mut inputs = plant.sense();
                (inputs.tick, inputs.time_ns) = (tick as u64, time_ns);
                if let Some(needle) = &mut inputs.needle {
                    needle.time_ns = time_ns;
                }
                if let Some(paddle) = &mut inputs.paddle {
                    paddle.time_ns = time_ns;
                }
                if let Some(target) = &mut inputs.target {
                    target.time_ns = time_ns;
                }
                let command = controller.step(&mut state, &inputs);
                plant.act(&command);
                if let Some(before) = last.filter(|before| before.is_valid() && command.is_valid()) {
                    let step = distance(before.displacement, command.displacement);
                    let explained = RATE * 1e-9 * elapsed_ns as f64;
                    prop_assert!(step <= explained * (1.0 + 1e-9), "{} in {} ns", step, elapsed_ns);
                    travelled += step;
                }
                last = Some(command);
            }
            prop_assert!(travelled > 0.0);
        }
    }
}
