//! What is excused once, and not as a habit.

use super::*;

#[test]
fn a_paddle_that_is_off_in_most_samples_is_found() {
    let table = table();
    for (off, of) in [(19, 20), (10, 20), (6, 20)] {
        let mut closed = Loop::new(&table, &settings());
        closed.run(1000);
        let mut tick = 0;
        let found = closed.until_safe(|inputs| {
            let paddle = inputs.paddles[0].as_mut().unwrap();
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
