//! What the loop needs from its surroundings. Lockstep, free-run and bare metal implement these traits and share
//! [`run_tick`], so that all of them run the same controller.

use crate::contract::frames::MAX_PADDLES;
use crate::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};
use crate::controller::{Controller, State};
use crate::inputs::Inputs;
use crate::scalar::Scalar;

/// A clock that never goes back, ns since an arbitrary start. In lockstep the messages are the clock.
pub trait MonotonicClock {
    /// Time now, ns.
    fn now_ns(&mut self) -> u64;
}

/// Where samples come from. Each call drains the stream and returns its newest sample, or `None` if nothing arrived
/// since the last call.
pub trait SampleSource {
    /// Newest needle sample.
    fn needle(&mut self) -> Option<NeedleSample>;
    /// Newest target sample.
    fn target(&mut self) -> Option<TargetSample>;
    /// Newest sample of the paddle at this place of the table, from 0 on. Only asked for places where the table has one.
    fn paddle(&mut self, place: usize) -> Option<PaddleSample>;
}

/// Where commands go. Must not block.
pub trait CommandSink {
    /// Why a command could not be sent.
    type Error;

    /// Sends one command.
    ///
    /// # Errors
    /// The command did not leave; the loop goes on, the receiver sees a gap in the sequence.
    fn send(&mut self, command: &PaddleCommand) -> Result<(), Self::Error>;
}

/// One tick: drain the inputs, step, send the command. Returns what the step saw and did, for the record.
///
/// # Errors
/// That of the sink; the controller has stepped nevertheless.
pub fn run_tick<T: Scalar, const D: usize, const N: usize, const P: usize, L: SampleSource + CommandSink>(
    controller: &Controller<'_, T, D, N, P>,
    state: &mut State<T, D, N, P>,
    tick: u64,
    time_ns: u64,
    link: &mut L,
) -> Result<(Inputs, PaddleCommand), L::Error> {
    let (needle, target) = (link.needle(), link.target());
    let mut paddles = [None; MAX_PADDLES];
    for (place, paddle) in paddles.iter_mut().take(P).enumerate() {
        *paddle = link.paddle(place);
    }
    let inputs = Inputs { tick, time_ns, needle, target, paddles };
    let command = controller.step(state, &inputs);
    link.send(&command)?;
    Ok((inputs, command))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contract::Mode;
    use crate::contract::example::table;
    use crate::controller::plant::{MS, Plant};
    use crate::settings::Settings;

    /// The plant of the tests behind the traits.
    struct Link {
        plant: Plant,
        arrived: Inputs,
    }

    impl SampleSource for Link {
        fn needle(&mut self) -> Option<NeedleSample> {
            self.arrived.needle.take()
        }
        fn target(&mut self) -> Option<TargetSample> {
            self.arrived.target.take()
        }
        fn paddle(&mut self, place: usize) -> Option<PaddleSample> {
            self.arrived.paddles.get_mut(place)?.take()
        }
    }

    impl CommandSink for Link {
        type Error = core::convert::Infallible;

        fn send(&mut self, command: &PaddleCommand) -> Result<(), Self::Error> {
            self.plant.act(command);
            Ok(())
        }
    }

    #[test]
    fn a_recorded_run_replays_bit_by_bit() {
        let table = table();
        let controller = Controller::new(&table, &Settings::new(MS, 20 * MS, 20 * MS)).unwrap();
        let (mut state, mut replayed) = (State::<f64>::new(), State::<f64>::new());
        let mut link = Link { plant: Plant::new(), arrived: Inputs::default() };
        for tick in 0..3000 {
            link.arrived = link.plant.sense();
            let (inputs, command) = run_tick(&controller, &mut state, tick, tick * MS, &mut link).unwrap();
            assert_eq!(controller.step(&mut replayed, &inputs), command);
            assert_eq!(replayed, state);
        }
        assert_eq!(state.mode(), Mode::Run);
        assert_eq!(state.ledger().unaccounted(), 0);
    }
}
