//! Several faults at once, drawn from a seed: nobody has thought of these combinations.

use firmware::Mode;
use firmware::contract::Table;
use nalgebra::SVector;
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::closed_loop::{ClosedLoop, Setup};
use super::fault::{Event, Fault, below};
use super::invariants::positions;
use crate::bench::error::SimError;

/// Stream of the generator that draws schedules.
const SCHEDULE_STREAM: u128 = 11;
/// Ticks before the first fault: the loop has to be in RUN.
const QUIET_TICKS: u64 = 200;
/// Ticks in which faults start.
const FAULTY_TICKS: u64 = 1500;
/// Longest fault, ticks: past every limit of age.
const LONGEST_FAULT: u64 = 500;
/// Ticks after the last fault in which the loop must come back, re-armed where that is needed.
const RECOVERY_TICKS: u64 = 1000;
/// Ticks of one schedule.
pub const TICKS: u64 = QUIET_TICKS + FAULTY_TICKS + LONGEST_FAULT + RECOVERY_TICKS;

/// Sums over all schedules.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Composed {
    /// Schedules.
    pub schedules: u64,
    /// Ticks of the plant.
    pub ticks: u64,
    /// Faults drawn.
    pub faults: u64,
    /// Samples, steps and plant ticks changed by them.
    pub injected: u64,
    /// Commands that came with a fault code.
    pub flagged: u64,
    /// Commands in HOLD, RUN and SAFE.
    pub modes: [u64; 3],
    /// Re-armings.
    pub rearmed: u64,
    /// Largest orthogonal error, length.
    pub max_error: f64,
    /// Samples and ticks that are in one account and not in the other: 0.
    pub unaccounted: u64,
    /// SHA-256 over all commands: the same seeds give the same digest on every machine.
    pub digest: String,
    /// What did not hold, with the seed that shows it again; the first few.
    pub failures: Vec<String>,
}

/// The faults of one seed.
pub fn schedule<const D: usize, const P: usize>(seed: u64, period_ns: u64, length: f64) -> Vec<Event> {
    let mut random = Pcg64::new(u128::from(seed), SCHEDULE_STREAM);
    let count = 1 + below(&mut random, 5);
    (0..count)
        .map(|_| {
            let fault = Fault::random::<D, P>(&mut random, period_ns, length);
            let from = QUIET_TICKS + below(&mut random, FAULTY_TICKS);
            // Many short ones, some past every limit.
            let longest = [3, 30, LONGEST_FAULT][below(&mut random, 3) as usize];
            Event { fault, from, until: from + 1 + below(&mut random, longest) }
        })
        .collect()
}

/// Runs the schedules of the seeds from `first` on.
///
/// # Errors
/// [`SimError::Runtime`] for settings that the controller refuses.
pub fn composed<const D: usize, const N: usize, const P: usize>(
    table: &Table<f64, D, N, P>,
    first: u64,
    count: u64,
    progress: &dyn Fn(),
) -> Result<Composed, SimError> {
    let mut sum = Composed::default();
    let mut digest = Sha256::new();
    for seed in first..first.saturating_add(count) {
        crate::runtime::signals::check()?;
        one(table, seed, &mut sum, &mut digest)?;
        progress();
    }
    sum.digest = model_offline::output::table_text::hex(&digest.finalize());
    Ok(sum)
}

fn one<const D: usize, const N: usize, const P: usize>(
    table: &Table<f64, D, N, P>,
    seed: u64,
    sum: &mut Composed,
    digest: &mut Sha256,
) -> Result<(), SimError> {
    let mut setup = Setup::new(table, seed);
    setup.shuttles = true;
    // Every other insertion starts right before its counters wrap.
    setup.sequence = if seed.is_multiple_of(2) { 0 } else { u32::MAX - 300 };
    let mut bench = ClosedLoop::new(table, setup)?;
    let events = schedule::<D, P>(seed, setup.settings.loop_period_ns, table.validity.depth_end);
    for event in &events {
        bench.inject_at(*event);
    }
    let faulty = events.iter().map(|event| event.until).max().unwrap_or(0);
    let mut safe_for = 0;
    let mut hash = 0u64;
    while bench.now() < TICKS {
        if let Some(exchange) = bench.step() {
            hash = mix(hash, exchange.command.faults ^ u64::from(exchange.command.state) << 56);
            let positions: [SVector<f64, D>; P] = positions(&exchange.command);
            hash = positions.iter().flatten().fold(hash, |hash, part| mix(hash, part.to_bits()));
        }
        safe_for = if bench.mode() == Mode::Safe { safe_for + 1 } else { 0 };
        // Somebody re-arms after a while, in vain as long as the fault lasts; and once more when all is over.
        if safe_for == 100 || (safe_for > 0 && bench.now() == faulty + 300) {
            bench.rearm();
            sum.rearmed += 1;
            safe_for = 0;
        }
    }
    let mut fail = |what: String| {
        if sum.failures.len() < 10 {
            let faults: Vec<_> = events.iter().map(|event| format!("{:?}", event)).collect();
            sum.failures.push(format!("--seed {seed} --seeds 1: {what} [{}]", faults.join("; ")));
        }
    };
    for violation in bench.invariants.violations() {
        fail(violation.clone());
    }
    let unaccounted = bench.unaccounted();
    if unaccounted > 0 {
        fail(format!("{unaccounted} unaccounted"));
    }
    if bench.mode() != Mode::Run {
        fail(format!("still {:?} after the faults: {}", bench.mode(), bench.state.faults()));
    }
    sum.schedules += 1;
    sum.ticks += bench.now();
    sum.faults += events.len() as u64;
    sum.injected += bench.injected;
    sum.flagged += bench.flagged;
    sum.modes.iter_mut().zip(bench.audit.modes).for_each(|(sum, count)| *sum += count);
    sum.max_error = sum.max_error.max(bench.max_error);
    sum.unaccounted += unaccounted;
    digest.update(hash.to_le_bytes());
    Ok(())
}

/// One round of FNV-1a over eight bytes at once: cheap, and sensitive to every bit.
fn mix(hash: u64, value: u64) -> u64 {
    (hash ^ value).wrapping_mul(0x0100_0000_01b3).rotate_left(23)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::faults::fault::Stream;
    use crate::bench::paper_table::{brick_table, paper_table};

    #[test]
    fn random_schedules_leave_nothing_unaccounted_and_repeat_bit_by_bit() {
        accounted_for_and_repeated(&paper_table().unwrap());
    }

    #[test]
    fn so_they_do_in_space_with_two_paddles() {
        let table = brick_table().unwrap();
        accounted_for_and_repeated(&table);
        // The witness: second paddles are among what goes wrong.
        let events = (1..200).flat_map(|seed| schedule::<3, 2>(seed, 1_000_000, 1.0));
        let of_the_second =
            events.filter(|event| matches!(event.fault, Fault::Stuck(1) | Fault::Lost(Stream::SecondPaddle)));
        assert!(of_the_second.count() > 5);
    }

    fn accounted_for_and_repeated<const D: usize, const N: usize, const P: usize>(table: &Table<f64, D, N, P>) {
        let first = composed(table, 1, 200, &|| {}).unwrap();
        assert_eq!((first.failures.as_slice(), first.unaccounted), (&[] as &[String], 0));
        assert!(first.modes.iter().all(|ticks| *ticks > 0), "every mode occurs: {:?}", first.modes);
        assert_eq!(composed(table, 1, 200, &|| {}).unwrap(), first);
    }

    #[test]
    fn a_schedule_that_was_once_counted_wrong_is_counted_right() {
        // Samples late by more than the window while all after them are refused; found by 10,000 schedules.
        let found = composed(&paper_table().unwrap(), 3123, 1, &|| {}).unwrap();
        assert_eq!((found.failures.as_slice(), found.unaccounted), (&[] as &[String], 0));
    }
}
