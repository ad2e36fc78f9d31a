//! Which measured paddle positions the controller takes up as its own.

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
            let paddle = inputs.paddles[0].as_mut().unwrap();
            (paddle.time_ns, paddle.displacement) = (paddle.time_ns - 10_000 * MS, [RANGE, 0.0, 0.0]);
        }
        let command = controller.step(&mut state, &inputs);
        assert!(
            !command.is_valid() || distance(to_plane(command.displacement[0]), [0.0; 2]) < 0.1 * RANGE,
            "tick {tick}"
        );
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
        closed.tick(|inputs| (inputs.target, inputs.paddles) = (None, [None; 2]));
    }
    assert!(!closed.last.unwrap().is_valid(), "nobody knows where the paddle is");
    closed.plant.paddle = Vector2::new(0.0, 0.02);
    let first = (0..50).map(|_| closed.tick(|_| {})).find(PaddleCommand::is_valid);
    assert_eq!(first.unwrap().displacement, [[0.0, 0.02, 0.0], [0.0; 3]]);
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
        assert!(!command.is_valid() || command.displacement[0] == [0.0, 0.02, 0.0]);
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
        let mut is_adopted = false;
        // In the end it rests, and every sample arrives: then it must be adopted.
        for (i, (age, arrives)) in ages.into_iter().chain([(0, true); 200]).enumerate() {
            if i >= 400 && state.mode() == Mode::Safe {
                state.rearm();
            }
            let tick = 20_000 + i as u64;
            let age = if i == 0 { first_age } else { age };
            // What is 20 s old was measured elsewhere.
            let displacement = from_plane(if i == 0 && age > 100 { [RANGE, 0.0] } else { truth(tick - age) });
            let sample =
                PaddleSample { sequence: i as u32, paddle_index: 3, time_ns: (tick - age) * MS, displacement };
            let paddle = (arrives || i == 0).then_some(sample);
            let inputs = Inputs { tick, time_ns: tick * MS, paddles: [paddle, None], ..Inputs::default() };
            let command = controller.step(&mut state, &inputs);
            if command.is_valid() {
                let off = distance(to_plane(command.displacement[0]), truth(tick));
                prop_assert!(off <= RESOLUTION * (1.0 + 1e-9), "tick {}: {} off", tick, off);
                is_adopted = true;
                break;
            }
        }
        prop_assert!(is_adopted, "{:?}", state.faults());
    }

    /// A paddle that follows, hangs, slips, or is taken away by somebody for a while.
    #[test]
    fn no_valid_command_is_far_from_the_last_measurement(
        events in prop::collection::vec((0..6u8, 1..200u32, -1.0..1.0f64, -1.0..1.0f64), 1..12),
    ) {
        let table = table();
        let mut closed = Loop::new(&table, &settings());
        closed.plant.push = 0.05;
        let (mut away, mut compared) = (0, 0);
        // In the end it follows again, so that there is something to compare.
        for (kind, ticks, x, y) in events.into_iter().chain([(5, 400, 0.0, 0.0)]) {
            for _ in 0..ticks {
                let mut inputs = closed.plant.sense();
                if kind == 0 {
                    inputs.paddles[0] = None;
                }
                let consumed = closed.state.ledger().paddles[0].consumed;
                let command = closed.controller.step(&mut closed.state, &inputs);
                let mut moved = closed.plant.paddle;
                match kind {
                    1 => {}
                    2 => moved = Vector2::new(0.5 * RANGE * x, 0.5 * RANGE * y),
                    3 if command.is_valid() => moved = Vector2::from(to_plane(command.displacement[0])) * 0.5,
                    _ if command.is_valid() => moved = Vector2::from(to_plane(command.displacement[0])),
                    _ => {}
                }
                closed.plant.act(&command);
                closed.plant.paddle = moved;
                if !command.is_valid() {
                    away = 0;
                }
                // A position that is refused, as frozen, is no measurement.
                let is_accepted = closed.state.ledger().paddles[0].consumed > consumed;
                let Some(last) = inputs.paddles[0].filter(|_| command.is_valid() && is_accepted) else { continue };
                let age = 1e-3 * (inputs.tick - last.time_ns / MS) as f64;
                let explained = FOLLOWING_FRACTION * RANGE + RATE * (age + 2e-3 + 1e-3);
                let off = distance(to_plane(command.displacement[0]), to_plane(last.displacement));
                // Further away in no more samples than the following error takes to be certain.
                compared += 1;
                away = if off > explained { away + 1 } else { 0 };
                // A command is compared with the next sample.
                prop_assert!(away <= 21, "{} off in {} samples", off, away);
                if closed.state.mode() == Mode::Safe && kind == 5 {
                    closed.state.rearm();
                }
            }
        }
        prop_assert!(compared > 0, "{:?}", closed.state.faults());
    }
}
