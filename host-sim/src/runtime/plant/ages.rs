//! How old the samples behind a command are when the actuator has it.

use firmware::Mode;
use firmware::contract::PaddleCommand;

use crate::runtime::time::durations::{Distribution, Durations};

/// Samples whose time is remembered: as many as a controller may be late before it goes to SAFE, many times over.
const REMEMBERED: usize = 4096;

/// When the newest samples of a stream were measured, by their number.
#[derive(Clone, Debug)]
struct SampleTimes(Vec<(u32, u64)>);

impl SampleTimes {
    fn new() -> Self {
        Self(vec![(u32::MAX, 0); REMEMBERED])
    }

    fn note(&mut self, sequence: u32, time_ns: u64) {
        self.0[sequence as usize % REMEMBERED] = (sequence, time_ns);
    }

    /// When this sample was measured, ns; none for one that is long past or never was.
    fn of(&self, sequence: u32) -> Option<u64> {
        let (found, time_ns) = self.0[sequence as usize % REMEMBERED];
        (found == sequence).then_some(time_ns)
    }
}

/// Ages of the inputs of commands in RUN at their actuation.
#[derive(Clone, Debug)]
pub struct InputAges {
    needle: SampleTimes,
    target: SampleTimes,
    input_age: Durations,
    target_age: Durations,
}

impl Default for InputAges {
    fn default() -> Self {
        let [needle, target] = [(); 2].map(|()| SampleTimes::new());
        Self { needle, target, input_age: Durations::default(), target_age: Durations::default() }
    }
}

impl InputAges {
    /// A needle sample was measured, and the paddle's with it, ns.
    pub fn needle(&mut self, sequence: u32, time_ns: u64) {
        self.needle.note(sequence, time_ns);
    }

    /// A target sample was measured, ns.
    pub fn target(&mut self, sequence: u32, time_ns: u64) {
        self.target.note(sequence, time_ns);
    }

    /// The actuator has this command now, ns.
    pub fn actuate(&mut self, command: &PaddleCommand, now_ns: u64) {
        if command.state != Mode::Run as u32 {
            return;
        }
        if let Some(time_ns) = self.needle.of(command.needle_sequence) {
            self.input_age.record(now_ns.saturating_sub(time_ns));
        }
        if let Some(time_ns) = self.target.of(command.target_sequence) {
            self.target_age.record(now_ns.saturating_sub(time_ns));
        }
    }

    /// Ages of needle and target samples; none where no command was actuated.
    pub fn distributions(&self) -> [Option<Distribution>; 2] {
        [&self.input_age, &self.target_age]
            .map(|ages| Some(ages.distribution()).filter(|distribution| distribution.count > 0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ages_are_those_of_the_samples_that_a_command_names() {
        let mut ages = InputAges::default();
        for sequence in 0..5000 {
            ages.needle(sequence, u64::from(sequence) * 1_000_000);
        }
        ages.target(7, 4_900_000_000);
        let command = |needle_sequence, state: Mode| PaddleCommand {
            needle_sequence,
            target_sequence: 7,
            state: state as u32,
            ..PaddleCommand::default()
        };
        ages.actuate(&command(4998, Mode::Run), 4_999_500_000);
        ages.actuate(&command(4998, Mode::Hold), 9_000_000_000);
        ages.actuate(&command(10, Mode::Run), 5_000_000_000); // Long forgotten.
        let [input, target] = ages.distributions().map(Option::unwrap);
        assert_eq!((input.count, target.count), (1, 2));
        assert!(input.max_ns.abs_diff(1_500_000) < 2_000, "{input:?}");
        assert!(target.min_ns.abs_diff(99_500_000) < 100_000, "{target:?}");
    }
}
