//! A controller in this thread, with its samples.

use firmware::contract::frames::to_plane;
use firmware::contract::{PaddleCommand, Table};
use firmware::inputs::TickLedger;
use firmware::{Controller, Inputs, State};

use super::blocks::ModeAnswer;
use super::stimulus::Stimulus;
use crate::runtime::error::RuntimeError;
use crate::world::loop_settings::LoopSettings;

/// Ticks within which a controller must be in RUN: arming takes a few samples at rest.
pub(super) const TICKS_TO_RUN: u64 = 20_000;

/// A controller in RUN, with its samples.
pub(super) struct Own<'c> {
    controller: &'c Controller<'c, f64>,
    stimulus: Stimulus,
    state: State<f64>,
    command: PaddleCommand,
    period_ns: u64,
    /// Ticks that led to RUN.
    armed_after: u64,
}

impl<'c> Own<'c> {
    /// A controller that simulated ticks have brought to RUN. Nothing of them is in any figure.
    ///
    /// # Errors
    /// [`RuntimeError::NeverArmed`].
    pub(super) fn in_run(
        controller: &'c Controller<'c, f64>,
        table: &Table<f64, 2>,
        loop_settings: &LoopSettings,
    ) -> Result<Self, RuntimeError> {
        let stimulus = Stimulus::new(table, loop_settings);
        let period_ns = loop_settings.period_ns();
        let command = PaddleCommand::default();
        let mut own = Self { controller, stimulus, state: State::new(), command, period_ns, armed_after: 0 };
        for tick in 0..TICKS_TO_RUN {
            let inputs = own.inputs_at(tick);
            own.answer(&inputs);
            if ModeAnswer::of(&own.command).is_run() {
                own.armed_after = tick + 1;
                own.stimulus.start_needle(own.armed_after * period_ns);
                return Ok(own);
            }
        }
        Err(ModeAnswer::of(&own.command).never_armed(TICKS_TO_RUN, period_ns))
    }

    fn inputs_at(&mut self, tick: u64) -> Inputs {
        let time_ns = tick * self.period_ns;
        let samples = self.stimulus.samples(time_ns, to_plane(self.command.displacement[0]));
        Inputs {
            tick,
            time_ns,
            needle: Some(samples.needle),
            target: samples.target,
            paddles: [Some(samples.paddle), None],
        }
    }

    /// What arrives for this release since RUN.
    pub(super) fn inputs(&mut self, release: u64) -> Inputs {
        self.inputs_at(self.armed_after + release)
    }

    /// The controller's step, and nothing else.
    pub(super) fn answer(&mut self, inputs: &Inputs) {
        self.command = self.controller.step(&mut self.state, std::hint::black_box(inputs));
        std::hint::black_box(&self.command);
    }

    /// What it said last.
    pub(super) fn said(&self) -> ModeAnswer {
        ModeAnswer::of(&self.command)
    }

    /// A release since RUN, skipped ones included.
    pub(super) fn step(&mut self, release: u64) -> ModeAnswer {
        let inputs = self.inputs(release);
        self.answer(&inputs);
        self.said()
    }

    /// Its own count of ticks, those before RUN included, and how many these were.
    pub(super) fn ledger(&self) -> (&TickLedger, u64) {
        (&self.state.ledger().ticks, self.armed_after)
    }
}
