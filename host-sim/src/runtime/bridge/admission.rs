//! Which datagrams of the rig are obeyed, and when their samples were measured on this machine's clock.

use firmware::contract::frames::MAX_PADDLES;
use firmware::contract::{NeedleSample, PaddleSample, TargetSample};

use crate::exchange::udp::{Datagram, Message, Refusal};

/// Longest time from a measurement to its sending, ns.
const LONGEST_AGE_NS: u64 = 60_000_000_000;

/// How much faster than this machine's the sender's clock may seem to lag, parts per million: two quartzes of 50 each.
const DRIFT_PPM: i128 = 100;

/// A sample with its place, stamped by this machine's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sample {
    /// Of the needle.
    Needle(NeedleSample),
    /// Of the target.
    Target(TargetSample),
    /// Of the paddle at this place of the controller's table.
    Paddle(usize, PaddleSample),
}

/// What this machine's clock shows minus what the sender's does, as far as one way tells: the least difference between
/// arrival and sending, let up by 100 ppm, as two quartzes may part. It is too large by the shortest time that a datagram is under way.
///
/// A datagram that was held up is therefore stamped as old as it is. An arrival alone would make it look fresh, and the
/// controller, which goes by ages, would follow the past.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SenderClock {
    /// The difference, ns, and when it was found.
    found: Option<(i128, u64)>,
}

impl SenderClock {
    /// A datagram came. Returns the difference, ns.
    fn observe(&mut self, sent_ns: u64, arrived_ns: u64) -> i128 {
        let now = i128::from(arrived_ns) - i128::from(sent_ns);
        let difference = self.found.map_or(now, |(least, at_ns)| {
            now.min(least + i128::from(arrived_ns.saturating_sub(at_ns)) * DRIFT_PPM / 1_000_000)
        });
        self.found = Some((difference, arrived_ns));
        difference
    }
}

/// Decides on datagrams, one after the other.
#[derive(Clone, Debug)]
pub struct Admission {
    run: u64,
    paddles: Vec<u32>,
    /// Least time that a datagram is under way, ns.
    delay_ns: u64,
    newest: Option<u64>,
    /// Numbers that were left out.
    missing: u64,
    clock: SenderClock,
}

impl Admission {
    /// Before the first datagram of this run; for paddles of these indices, in the order of the controller's table. Datagrams
    /// are known to be under way for at least `delay_ns`.
    pub fn new(run: u64, paddles: &[u32], delay_ns: u64) -> Self {
        let paddles = paddles.iter().copied().take(MAX_PADDLES).collect();
        Self { run, paddles, delay_ns, newest: None, missing: 0, clock: SenderClock::default() }
    }

    /// Datagrams that never came, by the gaps in their numbers.
    pub fn missing(&self) -> u64 {
        self.missing
    }

    /// The sample of a datagram that arrived at `arrived_ns`, stamped by the same clock. What is refused changes nothing.
    ///
    /// # Errors
    /// [`Refusal`].
    pub fn admit(&mut self, datagram: &Datagram, arrived_ns: u64) -> Result<Sample, Refusal> {
        let Datagram { run, number, sent_ns, ref message } = *datagram;
        if run != self.run {
            return Err(Refusal::OtherRun);
        }
        if self.newest.is_some_and(|newest| number <= newest) {
            return Err(Refusal::Replayed);
        }
        let sample = match message {
            Message::Needle(needle) => Sample::Needle(*needle),
            Message::Target(target) => Sample::Target(*target),
            Message::Paddle(paddle) => {
                let place = self.paddles.iter().position(|index| *index == paddle.paddle_index);
                Sample::Paddle(place.ok_or(Refusal::Paddle)?, *paddle)
            }
            Message::Hello(_) | Message::Command(_) => return Err(Refusal::Meaning),
        };
        let mut clock = self.clock;
        let stamped = sample.stamped(|measured_ns| {
            let age_ns = sent_ns.checked_sub(measured_ns).filter(|age_ns| *age_ns <= LONGEST_AGE_NS)?;
            let difference = clock.observe(sent_ns, arrived_ns) - i128::from(self.delay_ns);
            u64::try_from(i128::from(sent_ns) - i128::from(age_ns) + difference).ok()
        });
        let stamped = stamped.ok_or(Refusal::Time)?;
        self.missing = self.missing.saturating_add(self.newest.map_or(0, |newest| number - newest - 1));
        self.newest = Some(number);
        self.clock = clock;
        Ok(stamped)
    }
}

impl Sample {
    /// The same with another time; `None` where `translate` finds none.
    fn stamped(self, translate: impl FnOnce(u64) -> Option<u64>) -> Option<Self> {
        Some(match self {
            Self::Needle(needle) => Self::Needle(NeedleSample { time_ns: translate(needle.time_ns)?, ..needle }),
            Self::Target(target) => Self::Target(TargetSample { time_ns: translate(target.time_ns)?, ..target }),
            Self::Paddle(place, paddle) => {
                Self::Paddle(place, PaddleSample { time_ns: translate(paddle.time_ns)?, ..paddle })
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RUN: u64 = 77;
    /// The sender's clock is behind by an hour.
    const BEHIND_NS: u64 = 3_600_000_000_000;
    const MS: u64 = 1_000_000;

    fn needle(number: u64, measured_ns: u64, sent_ns: u64) -> Datagram {
        let sample = NeedleSample { sequence: number as u32, time_ns: measured_ns, ..NeedleSample::default() };
        Datagram { run: RUN, number, sent_ns, message: Message::Needle(sample) }
    }

    fn time_ns(sample: Result<Sample, Refusal>) -> u64 {
        match sample {
            Ok(Sample::Needle(needle)) => needle.time_ns,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn samples_are_stamped_by_this_clock_within_the_time_under_way() {
        let mut admission = Admission::new(RUN, &[3], 0);
        for number in 0..1000 {
            // Measured every ms, sent 0.2 ms later, under way for 0.1 to 0.5 ms.
            let measured = (10_000 + number) * MS;
            let sent = measured + MS / 5;
            let arrived = sent + BEHIND_NS + MS / 10 + number % 5 * (MS / 10);
            let stamp = time_ns(admission.admit(&needle(number, measured, sent), arrived));
            let truth = measured + BEHIND_NS;
            let error = stamp.checked_sub(truth).expect("no sample seems older than it is");
            // The shortest way, and what the clocks may part in the 5 ms until there is the next shortest one.
            assert!((MS / 10..=MS / 10 + 500).contains(&error), "{number}: {error} ns");
        }
        assert_eq!(admission.missing(), 0);
    }

    #[test]
    fn what_was_held_up_is_as_old_as_it_is() {
        let mut admission = Admission::new(RUN, &[3], 0);
        let first = time_ns(admission.admit(&needle(0, 0, 0), BEHIND_NS));
        let held = time_ns(admission.admit(&needle(1, MS, MS), BEHIND_NS + 300 * MS));
        assert_eq!(first, BEHIND_NS);
        assert!(held.abs_diff(BEHIND_NS + MS) <= 300 * MS / 10_000, "{}", held - BEHIND_NS);
    }

    #[test]
    fn the_least_delay_is_taken_off() {
        let mut admission = Admission::new(RUN, &[3], 2 * MS);
        assert_eq!(time_ns(admission.admit(&needle(0, 5 * MS, 6 * MS), 50 * MS)), 50 * MS - MS - 2 * MS);
    }

    #[test]
    fn a_slow_clock_is_followed_and_one_that_jumps_back_makes_everything_old() {
        let mut admission = Admission::new(RUN, &[3], 0);
        // 50 ppm slow for 100 s: 5 ms, of which a difference that is found once knows nothing.
        let mut error = 0;
        for number in 0..10_000_u64 {
            let truth = BEHIND_NS + number * 10 * MS;
            let sent = number * (10 * MS - 500);
            let stamp = time_ns(admission.admit(&needle(number, sent, sent), truth));
            error = stamp.abs_diff(truth).max(error);
        }
        assert_eq!(error, 0);
        let now = BEHIND_NS + 100_000 * MS;
        let back = time_ns(admission.admit(&needle(10_000, 90_000 * MS, 90_000 * MS), now));
        assert!(now - back > 9_000 * MS, "{}", now - back);
    }

    #[test]
    fn every_refusal_leaves_things_as_they_were() {
        let mut admission = Admission::new(RUN, &[3, 6], 0);
        let good = |number: u64| needle(number, 1000 * MS, 1001 * MS);
        let paddle = |index: u32| Message::Paddle(PaddleSample { paddle_index: index, ..PaddleSample::default() });
        let now = 5000 * MS;
        assert!(admission.admit(&good(10), now).is_ok());
        let hello = Message::Hello(crate::exchange::udp::Hello::default());
        for (datagram, refusal) in [
            (Datagram { run: RUN ^ 1, ..good(11) }, Refusal::OtherRun),
            (good(10), Refusal::Replayed),
            (good(9), Refusal::Replayed),
            (Datagram { message: hello, ..good(1000) }, Refusal::Meaning),
            (Datagram { message: paddle(4), ..good(1000) }, Refusal::Paddle),
            (needle(1000, 1001 * MS + 1, 1001 * MS), Refusal::Time),
            (needle(1000, 0, LONGEST_AGE_NS + 1), Refusal::Time),
            // Older than this clock.
            (needle(1000, 1000 * MS, 50_000 * MS), Refusal::Time),
            (needle(1000, 0, u64::MAX), Refusal::Time),
        ] {
            assert_eq!(admission.admit(&datagram, now), Err(refusal), "{datagram:?}");
        }
        assert_eq!(time_ns(admission.admit(&good(12), now)), now - MS);
        assert_eq!(admission.missing(), 1);
        let sixth = Datagram { message: paddle(6), sent_ns: 0, ..good(13) };
        assert!(matches!(admission.admit(&sixth, now), Ok(Sample::Paddle(1, _))));
    }
}
