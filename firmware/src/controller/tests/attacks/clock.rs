//! Ticks and times that jump.

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
            if let Some(paddle) = &mut inputs.paddles[0] {
                paddle.time_ns = time_ns;
            }
            if let Some(target) = &mut inputs.target {
                target.time_ns = time_ns;
            }
            let command = controller.step(&mut state, &inputs);
            plant.act(&command);
            if let Some(before) = last.filter(|before| before.is_valid() && command.is_valid()) {
                let step = distance(to_plane(before.displacement[0]), to_plane(command.displacement[0]));
                let explained = RATE * 1e-9 * elapsed_ns as f64;
                prop_assert!(step <= explained * (1.0 + 1e-9), "{} in {} ns", step, elapsed_ns);
                travelled += step;
            }
            last = Some(command);
        }
        prop_assert!(travelled > 0.0);
    }
}
