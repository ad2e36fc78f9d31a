//! Accounts of a stream, and thresholds of the checks.

use std::vec::Vec;

use super::checks::Checks;
use super::ledger::{Discard, StreamLedger};
use super::monitors::{InnovationGate, NeedleMonitor};
use super::sample::Measurement;
use super::stream::StreamGate;
use crate::contract::Faults;
use crate::contract::example::table;
use crate::detection::{NEEDLE_JUMP_FLOOR, NEEDLE_WINDOW_NS, RESTART_SAMPLES, RESTART_SPACING, SEQUENCE_JUMP};
use crate::settings::{Runtime, Settings};

const MS: u64 = 1_000_000;
const BAD: Result<(), Discard> = Err(Discard::NotFinite);

/// A stream and its accounts, which must balance after every delivery.
#[derive(Default)]
struct AccountedStream {
    stream: StreamGate,
    ledger: StreamLedger,
}

impl AccountedStream {
    fn offer(&mut self, sequence: u32, content: Result<(), Discard>) -> (bool, Faults) {
        let mut faults = Faults::NONE;
        let sample = Measurement { sequence, time_ns: 0, values: [0.0; 2] };
        let accepted = self.stream.offer(&sample, content, &mut self.ledger, &mut faults);
        assert_eq!(self.ledger.unaccounted(), 0, "after {sequence}: {:?}", self.ledger);
        assert!(!accepted || self.stream.accepted.is_some_and(|last| last.sequence == sequence));
        (accepted, faults)
    }

    fn accept(&mut self, sequences: impl IntoIterator<Item = u32>) {
        for sequence in sequences {
            assert!(self.offer(sequence, Ok(())).0, "{sequence}");
        }
    }

    /// Published, consumed, lost, duplicates, strays, late, not finite.
    fn counts(&self) -> [u64; 7] {
        let l = &self.ledger;
        [l.published, l.consumed, l.lost, l.duplicates, l.strays, l.discarded[0], l.discarded[1]]
    }
}

#[test]
fn gaps_are_lost_and_flagged_and_filled_by_late_samples() {
    let mut account = AccountedStream::default();
    account.accept([7, 8]);
    assert_eq!(account.offer(12, Ok(())), (true, Faults::SAMPLE_GAP));
    assert_eq!(account.counts(), [6, 3, 3, 0, 0, 0, 0]);
    assert_eq!(account.offer(10, Err(Discard::Time)), (false, Faults::OUT_OF_ORDER));
    assert_eq!(account.counts(), [6, 3, 2, 0, 0, 1, 0]);
    assert_eq!(account.offer(10, Err(Discard::Time)), (false, Faults::DUPLICATE));
    assert_eq!(account.offer(12, Err(Discard::Time)), (false, Faults::DUPLICATE));
    assert_eq!(account.offer(6, Err(Discard::Time)), (false, Faults::OUT_OF_ORDER), "before the first one of all");
    assert_eq!(account.counts(), [6, 3, 2, 2, 1, 1, 0]);
    assert_eq!(account.offer(13, Ok(())), (true, Faults::NONE));
}

#[test]
fn refused_samples_count_as_delivered_and_do_not_hide_others() {
    let mut account = AccountedStream::default();
    account.accept([0, 1]);
    assert_eq!(account.offer(2, BAD), (false, Faults::NOT_FINITE));
    assert_eq!(account.offer(2, BAD), (false, Faults::DUPLICATE), "once only");
    // A refused one ahead makes a gap, which those in it fill in their turn.
    assert_eq!(account.offer(6, BAD), (false, Faults::NOT_FINITE | Faults::SAMPLE_GAP));
    assert_eq!(account.counts(), [7, 2, 3, 1, 0, 0, 2]);
    account.accept([3, 4, 5]);
    assert_eq!(account.counts(), [7, 5, 0, 1, 0, 0, 2]);
    assert_eq!(account.offer(6, Ok(())), (false, Faults::DUPLICATE), "its number has been seen");
    account.accept([7]);
    assert_eq!(account.counts(), [8, 6, 0, 2, 0, 0, 2]);
}

#[test]
fn what_a_number_from_nowhere_made_seem_lost_is_taken_back() {
    for far in [64, 65, 1000, SEQUENCE_JUMP.cast_unsigned()] {
        let mut account = AccountedStream::default();
        account.accept(0..10);
        account.offer(9 + far, BAD);
        account.accept(10..30);
        let [published, consumed, lost, ..] = account.counts();
        assert_eq!((published - lost, consumed), (31, 30), "{far}");
        // Within the window it may have been right: then the rest of the gap is still lost.
        assert_eq!(lost, if far < 65 { u64::from(far) - 21 } else { 0 }, "{far}");
    }
    let mut account = AccountedStream::default();
    account.accept(0..10);
    assert_eq!(account.offer(10 + SEQUENCE_JUMP.cast_unsigned(), BAD), (false, Faults::OUT_OF_ORDER));
    assert_eq!(account.counts(), [10, 10, 0, 0, 1, 0, 0], "a jump past the limit is no loss");
}

#[test]
fn a_good_sample_that_is_far_too_late_takes_nothing_back_from_those_refused_meanwhile() {
    // Found by random schedule 3123: two samples are late by more than the window, all after them are refused.
    let mut account = AccountedStream::default();
    account.accept([0, 1]);
    for sequence in 4..124 {
        assert!(!account.offer(sequence, BAD).0);
    }
    assert_eq!(account.counts(), [124, 2, 2, 0, 0, 0, 120]);
    account.accept([2]);
    // Whether it is one of the two that seemed lost cannot be told any more: it is in the account once more.
    assert_eq!(account.counts(), [125, 3, 2, 0, 0, 0, 120]);
    assert_eq!(account.offer(124, BAD), (false, Faults::NOT_FINITE), "no gap");
    assert_eq!(account.counts(), [126, 3, 2, 0, 0, 0, 121]);
    account.accept([125, 126]);
}

#[test]
fn a_refused_first_sample_is_no_beginning() {
    let mut account = AccountedStream::default();
    account.offer(1000, BAD);
    account.accept(0..100);
    assert_eq!(account.counts(), [101, 100, 0, 0, 0, 0, 1]);
    let mut account = AccountedStream::default();
    account.offer(20, BAD);
    account.accept(0..20);
    assert_eq!(account.counts(), [21, 20, 0, 0, 0, 0, 1]);
}

#[test]
fn a_sender_that_counts_anew_needs_consistent_numbers_and_good_content() {
    let steps = |account: &mut AccountedStream, numbers: &[u32]| -> Vec<bool> {
        numbers.iter().map(|number| account.offer(*number, Ok(())).0).collect()
    };
    let begin = || {
        let mut account = AccountedStream::default();
        account.accept(1_000_000..1_000_010);
        account
    };
    let widest: Vec<u32> = (0..RESTART_SAMPLES).map(|i| i * RESTART_SPACING).collect();
    assert_eq!(steps(&mut begin(), &widest), [false, false, false, false, true]);
    let too_wide: Vec<u32> = (0..2 * RESTART_SAMPLES).map(|i| i * (RESTART_SPACING + 1)).collect();
    assert!(!steps(&mut begin(), &too_wide).contains(&true));
    assert!(!steps(&mut begin(), &[7; 20]).contains(&true), "the same again and again");
    assert!(!steps(&mut begin(), &[9, 8, 7, 6, 5, 4, 3, 2, 1]).contains(&true), "backwards");
    // A good one of the old numbering in between, and it begins anew.
    let mut account = begin();
    assert!(!steps(&mut account, &[0, 1, 2, 3]).contains(&true));
    account.accept([1_000_010]);
    assert_eq!(steps(&mut account, &[4, 5, 6, 7, 8, 9]), [false, false, false, false, true, true]);
    // Samples with bad content do not count.
    let mut account = begin();
    for number in 0..20 {
        assert!(!account.offer(number, Err(Discard::Time)).0);
    }
    assert_eq!(account.ledger.strays, 20);
}

fn checks_of(runtime: &Runtime<f64>) -> Checks<'_, f64> {
    Checks::new(runtime, 1000 * MS)
}

fn at(time_ns: u64, values: [f64; 2]) -> Measurement {
    Measurement { sequence: 0, time_ns, values }
}

#[test]
fn times_are_after_the_last_one_and_at_most_a_period_ahead() {
    let table = table();
    let runtime = Runtime::new(&table, &Settings::new(MS, 20 * MS, 20 * MS)).unwrap();
    let checks = checks_of(&runtime);
    let paddle =
        |time_ns, previous: Option<&Measurement>| checks.paddle(&runtime.paddles[0], &at(time_ns, [0.0; 2]), previous);
    assert_eq!(paddle(1001 * MS, None), Ok(()));
    assert_eq!(paddle(1001 * MS + 1, None), Err(Discard::Time));
    let previous = at(990 * MS, [0.0; 2]);
    assert_eq!(paddle(990 * MS + 1, Some(&previous)), Ok(()));
    assert_eq!(paddle(990 * MS, Some(&previous)), Err(Discard::Time));
    assert_eq!(paddle(0, None), Ok(()), "age is the business of others");
}

#[test]
fn values_are_normal_and_within_the_geometry() {
    let table = table();
    let runtime = Runtime::new(&table, &Settings::new(MS, 20 * MS, 20 * MS)).unwrap();
    let checks = checks_of(&runtime);
    let paddle = |x, y| checks.paddle(&runtime.paddles[0], &at(990 * MS, [x, y]), None);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 5e-324, -1e-310] {
        assert_eq!((paddle(bad, 0.0), paddle(0.0, bad)), (Err(Discard::NotFinite), Err(Discard::NotFinite)));
    }
    for good in [0.0, -0.0, f64::MIN_POSITIVE, -f64::MIN_POSITIVE] {
        assert_eq!(paddle(good, good), Ok(()));
    }
    // The paddle's range is 0.05, with a margin of a tenth.
    assert_eq!((paddle(0.0, 0.0549), paddle(-0.0551, 0.0)), (Ok(()), Err(Discard::OutOfRange)));
    assert_eq!((paddle(0.03, 0.04), paddle(0.04, 0.04)), (Ok(()), Err(Discard::OutOfRange)));
    let target = |x: f64| checks.target(&at(990 * MS, [x, 0.0]), None, &InnovationGate::default());
    let range = runtime.target_range;
    assert_eq!((target(0.999 * range), target(1.001 * range)), (Ok(()), Err(Discard::OutOfRange)));
    // One depth range around the table, ten times its speed.
    let needle =
        |depth, velocity| checks.needle(&at(990 * MS, [depth, velocity]), None, &NeedleMonitor::default()).map(|_| ());
    assert_eq!((needle(-0.0999, 0.0), needle(-0.1001, 0.0)), (Ok(()), Err(Discard::OutOfRange)));
    assert_eq!((needle(0.1999, 0.0), needle(0.2001, 0.0)), (Ok(()), Err(Discard::OutOfRange)));
    assert_eq!((needle(0.0, 0.999), needle(0.0, -1.001)), (Ok(()), Err(Discard::OutOfRange)));
    let fastest = runtime.plausible_speed;
    assert_eq!((needle(0.0, fastest), needle(0.0, -fastest)), (Ok(()), Ok(())), "the limit itself is plausible");
}

#[test]
fn a_depth_jumps_by_what_speed_and_resolution_explain() {
    let table = table();
    let runtime = Runtime::new(&table, &Settings::new(MS, 20 * MS, 20 * MS)).unwrap();
    let checks = checks_of(&runtime);
    // Twice (its speed for as long as it was away, the limit of 0.1 for at most 5 ticks), and 1 % of the range.
    let refused = |before: f64, velocity: f64, ticks: u64, jump: f64| {
        let (now, then) = (at(990 * MS, [0.05 + jump, velocity]), at((990 - ticks) * MS, [0.05, before]));
        checks.needle(&now, Some(&then), &NeedleMonitor::default()) == Err(Discard::Innovation)
    };
    for (before, velocity, ticks, jump) in [
        (0.0, 0.0, 1, 0.0012),
        (0.0, 0.0, 5, 0.002),
        (0.0, 0.0, 50, 0.002),
        (0.05, 0.0, 1, 0.0013),
        (0.0, -0.05, 10, 0.003),
    ] {
        for sign in [1.0, -1.0] {
            assert!(refused(before, velocity, ticks, sign * jump * 1.001), "{before} {velocity} {ticks}");
            assert!(!refused(before, velocity, ticks, sign * jump * 0.999), "{before} {velocity} {ticks}");
        }
    }
}

#[test]
fn the_ends_of_what_is_plausible_are_plausible() {
    let table = table();
    let runtime = Runtime::new(&table, &Settings::new(MS, 20 * MS, 20 * MS)).unwrap();
    let (least, most) = runtime.plausible_depth;
    let first = |depth: f64| checks_of(&runtime).needle(&at(MS, [depth, 0.0]), None, &NeedleMonitor::default()).is_ok();
    assert_eq!([least.next_down(), least, most, most.next_up()].map(first), [false, true, true, false]);
}

#[test]
fn a_depth_may_jump_by_the_limit_itself() {
    let table = table();
    let runtime = Runtime::new(&table, &Settings::new(MS, 20 * MS, 20 * MS)).unwrap();
    // Nothing but the resolution is left, so that the limit is known to the last bit.
    let resting = Runtime { needle_speed: 0.0, ..runtime };
    let most = NEEDLE_JUMP_FLOOR * resting.depth_range();
    let is_jump = |depth: f64| {
        let (now, then) = (at(990 * MS, [depth, 0.0]), at(989 * MS, [0.0; 2]));
        checks_of(&resting).needle(&now, Some(&then), &NeedleMonitor::default()) == Err(Discard::Innovation)
    };
    assert_eq!((is_jump(most), is_jump(most.next_up())), (false, true));
}

/// The window of depth against velocity begins with the sample that opens it.
#[test]
fn the_window_of_the_needle_begins_with_its_first_sample() {
    let table = table();
    let runtime = Runtime::new(&table, &Settings::new(MS, 20 * MS, 20 * MS)).unwrap();
    let resting = |time_ns: u64| at(time_ns, [0.02, 0.0]);
    let begun = NeedleMonitor::beginning_with(&resting(NEEDLE_WINDOW_NS));
    assert_ne!(begun, NeedleMonitor::default());
    let still = |monitor: &NeedleMonitor, before: u64, time_ns: u64| {
        monitor.next(&runtime, &resting(time_ns), &resting(before)).unwrap()
    };
    // A period before its end it is still the same window; a period past it a new one.
    let last = 2 * NEEDLE_WINDOW_NS;
    assert_eq!(still(&begun, last - MS, last), begun);
    assert_eq!(still(&begun, last, last + MS), NeedleMonitor::beginning_with(&resting(last + MS)));
}
