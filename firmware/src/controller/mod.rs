//! The control law, one tick at a time.

use crate::contract::frames::COMMAND_VALID;
use crate::contract::{Faults, Mode, PaddleCommand, Table};
use crate::inputs::Inputs;
use crate::scalar::Scalar;
use crate::settings::{Runtime, Settings, SettingsError};

mod clock;
mod motion;
#[cfg(test)]
pub(crate) mod plant;
mod reading;
mod state;
#[cfg(test)]
mod tests;

use motion::Tick;
pub use state::State;
use state::to_frame;

/// Planar tissue: displacements have two components.
const D: usize = 2;

/// Controller of one paddle: a table and settings, nothing that changes. See the crate documentation for the law.
#[derive(Clone, Copy, Debug)]
pub struct Controller<'t, T: Scalar> {
    table: &'t Table<T, D>,
    runtime: Runtime<T>,
}

impl<'t, T: Scalar> Controller<'t, T> {
    /// Builds the runtime form of `settings` for `table`, which [`crate::contract::decode`] has validated.
    ///
    /// # Errors
    /// What is wrong with the settings.
    pub fn new(table: &'t Table<T, D>, settings: &Settings) -> Result<Self, SettingsError> {
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

    /// One tick: reads and checks the inputs, decides the mode, and gives the command for the paddle.
    pub fn step(&self, state: &mut State<T>, inputs: &Inputs) -> PaddleCommand {
        let mut faults = Faults::NONE;
        let elapsed_ns = state.clock.start(&self.runtime, inputs, &mut state.ledger.ticks, &mut faults);
        let fresh_target = elapsed_ns.and_then(|_| self.read_inputs(state, inputs, &mut faults));
        self.expire_before_arming(state);
        self.check_ages(state, &mut faults);
        let mut mode = state.supervisor.decide(self.runtime.seen(faults));
        if let (Mode::Run, Some(elapsed_ns)) = (mode, elapsed_ns) {
            state.armed = true;
            self.move_paddle(state, &Tick { time_ns: inputs.time_ns, elapsed_ns, fresh_target }, &mut faults);
            // The law itself may have found a reason to stop; its last command is within the limits.
            mode = state.supervisor.decide(self.runtime.seen(faults));
        }
        state.mode = mode;
        state.faults = self.runtime.seen(faults) | state.supervisor.latched();
        state.ledger.ticks.end(mode);
        self.command(state, inputs)
    }

    /// The command frame for the state after a tick.
    fn command(&self, state: &mut State<T>, inputs: &Inputs) -> PaddleCommand {
        // A paddle that is not where it is told must not be pulled there once somebody lets it go.
        let follows = !state.faults.contains(Faults::FOLLOWING_ERROR);
        let sequence = state.command_sequence;
        state.command_sequence = sequence.wrapping_add(1);
        PaddleCommand {
            sequence,
            state: state.mode as u32,
            tick: inputs.tick,
            time_ns: inputs.time_ns,
            faults: state.faults.bits(),
            displacement: state.displacement.as_ref().map(to_frame).unwrap_or_default(),
            needle_sequence: state.needle.accepted.map(|sample| sample.sequence).unwrap_or_default(),
            target_sequence: state.target.accepted.map(|sample| sample.sequence).unwrap_or_default(),
            paddle_index: self.table.paddle.index,
            flags: if follows && state.displacement.is_some() { COMMAND_VALID } else { 0 },
        }
    }
}
