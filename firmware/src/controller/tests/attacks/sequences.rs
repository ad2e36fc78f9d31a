//! Sequence numbers that are damaged, or sent again.

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
            let paddle = inputs.paddles[0].as_mut().unwrap();
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
            [ledger.needle.consumed, ledger.target.consumed, ledger.paddles[0].consumed]
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
