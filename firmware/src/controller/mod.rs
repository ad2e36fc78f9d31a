//! The control law, one tick at a time.

use crate::contract::frames::{COMMAND_VALID, MAX_DIMENSION, MAX_PADDLES};
use crate::contract::{Faults, Mode, PaddleCommand, Table};
use crate::inputs::Inputs;
use crate::scalar::Scalar;
use crate::settings::{Runtime, Settings, SettingsError};

mod clock;
mod feedback;
mod handover;
mod history;
mod motion;
#[cfg(test)]
pub(crate) mod plant;
mod reading;
mod state;
#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) use tests::space::{insertion as space_insertion, table as space_table};

use motion::Tick;
pub use state::State;
use state::to_frame;

/// Controller of the table's paddles: a table and settings, nothing that changes. See the crate documentation for the law.
///
/// # Example
/// ```
/// use firmware::contract::frames::TARGET_VISIBLE;
/// use firmware::{Controller, Faults, Inputs, Mode, NeedleSample, PaddleSample, Settings, State, TargetSample, decode};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let table = decode::<f64, 2, 1, 1>(&std::fs::read("tests/planar.table")?)?;
/// let controller = Controller::new(&table, &Settings::new(1_000_000, 20_000_000, 20_000_000))?;
/// let mut state = State::new();
///
/// // Everything at rest, the paddle a little to the side: it is taken up where it is, and stays there.
/// for tick in 0..100 {
///     let (sequence, time_ns) = (tick as u32, tick * 1_000_000);
///     let needle = NeedleSample { sequence, time_ns, ..Default::default() };
///     let target = TargetSample { sequence, time_ns, flags: TARGET_VISIBLE, displacement: [0.0; 3] };
///     let paddle = PaddleSample { sequence, time_ns, paddle_index: 3, displacement: [0.01, 0.0, 0.0] };
///     let inputs = Inputs { tick, time_ns, needle: Some(needle), target: Some(target), paddles: [Some(paddle), None] };
///     let command = controller.step(&mut state, &inputs);
///     assert!(!command.is_valid() || (command.displacement[0][0] - 0.01).abs() < 1e-3);
/// }
/// assert_eq!(state.mode(), Mode::Run);
///
/// // One step without samples is forgiven; after some it holds, and says what it misses.
/// for tick in 100..110 {
///     controller.step(&mut state, &Inputs { tick, time_ns: tick * 1_000_000, ..Inputs::default() });
/// }
/// assert_eq!(state.mode(), Mode::Hold);
/// assert!(state.faults().contains(Faults::NEEDLE_STALE | Faults::PADDLE_STALE));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Controller<'t, T: Scalar, const D: usize = 2, const N: usize = 1, const P: usize = 1> {
    table: &'t Table<T, D, N, P>,
    runtime: Runtime<T, P>,
}

impl<'t, T: Scalar, const D: usize, const N: usize, const P: usize> Controller<'t, T, D, N, P> {
    /// Builds the runtime form of `settings` for `table`, which [`crate::contract::decode`] has validated.
    ///
    /// # Errors
    /// What is wrong with the settings.
    pub fn new(table: &'t Table<T, D, N, P>, settings: &Settings) -> Result<Self, SettingsError> {
        Ok(Self { table, runtime: Runtime::new(table, settings)? })
    }

    /// The same controller with these monitors off: their codes are never set, and what they would refuse is taken. For
    /// test benches that see whether anybody would notice.
    #[cfg(feature = "switches")]
    #[must_use]
    pub fn without(mut self, monitors: Faults) -> Self {
        self.runtime.off = monitors;
        self
    }

    /// Loop gain g per target sample in use.
    pub fn loop_gain(&self) -> f64 {
        self.runtime.gain.to_f64()
    }

    /// Delay d that the gain was chosen for, target samples.
    pub fn delay_samples(&self) -> u32 {
        self.runtime.delay_samples
    }

    /// One tick: reads and checks the inputs, decides the mode, and gives the command for the paddles.
    pub fn step(&self, state: &mut State<T, D, N, P>, inputs: &Inputs) -> PaddleCommand {
        let mut faults = Faults::NONE;
        let elapsed_ns = state.clock.start(&self.runtime, inputs, &mut state.ledger.ticks, &mut faults);
        let fresh_target = elapsed_ns.and_then(|_| self.read_inputs(state, inputs, &mut faults));
        self.expire_before_arming(state);
        self.check_ages(state, &mut faults);
        let mut mode = state.supervisor.decide(self.runtime.seen(faults));
        let depth = self.depth_ahead(state, inputs.time_ns);
        if let (Mode::Run, Some(elapsed_ns), Some(depth)) = (mode, elapsed_ns, depth) {
            state.armed = true;
            self.move_paddles(state, &Tick { time_ns: inputs.time_ns, elapsed_ns, fresh_target }, depth, &mut faults);
            // The law itself may have found a reason to stop; its last command is within the limits.
            mode = state.supervisor.decide(self.runtime.seen(faults));
        }
        if let (Some(_), Some(depth)) = (elapsed_ns, depth) {
            self.remember(state, inputs.time_ns, depth);
        }
        state.mode = mode;
        state.faults = self.runtime.seen(faults) | state.supervisor.latched();
        state.ledger.ticks.end(mode);
        self.command(state, inputs)
    }

    /// The command frame for the state after a tick.
    fn command(&self, state: &mut State<T, D, N, P>, inputs: &Inputs) -> PaddleCommand {
        // A paddle that is not where it is told must not be pulled there once somebody lets it go.
        let follows = !state.faults.contains(Faults::FOLLOWING_ERROR);
        let displacement = state.displacement();
        let mut paddle_index = [0; MAX_PADDLES];
        for (index, paddle) in paddle_index.iter_mut().zip(&self.runtime.paddles) {
            *index = paddle.index;
        }
        let sequence = state.command_sequence;
        state.command_sequence = sequence.wrapping_add(1);
        PaddleCommand {
            sequence,
            state: state.mode as u32,
            tick: inputs.tick,
            time_ns: inputs.time_ns,
            faults: state.faults.bits(),
            displacement: displacement.as_ref().map_or([[0.0; MAX_DIMENSION]; MAX_PADDLES], to_frame),
            needle_sequence: state.needle.accepted.map(|sample| sample.sequence).unwrap_or_default(),
            target_sequence: state.target.accepted.map(|sample| sample.sequence).unwrap_or_default(),
            paddle_index,
            flags: if follows && displacement.is_some() { COMMAND_VALID } else { 0 },
            reserved: 0,
        }
    }
}
