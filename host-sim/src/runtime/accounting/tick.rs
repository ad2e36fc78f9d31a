//! What the controller saw and answered, tick by tick.

use firmware::Inputs;
use firmware::contract::PaddleCommand;
use firmware::contract::frames::MAX_PADDLES;

use crate::exchange::bytes::{ByteReader, ByteWriter};

/// What the controller saw and answered in one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ControllerTick {
    /// Inputs of the step.
    pub inputs: Inputs,
    /// Its command.
    pub command: PaddleCommand,
}

/// Bytes of an encoded [`ControllerTick`].
pub const TICK_BYTES: usize = 4 + 16 + 32 + 40 + MAX_PADDLES * 40 + 104;

impl ControllerTick {
    /// Writes the fixed-size form.
    pub fn encode(&self, writer: &mut ByteWriter) {
        let (inputs, command) = (&self.inputs, &self.command);
        let [first, second] = &inputs.paddles;
        let present = u32::from(inputs.needle.is_some())
            | u32::from(inputs.target.is_some()) << 1
            | u32::from(first.is_some()) << 2
            | u32::from(second.is_some()) << 3;
        writer.u32(present);
        writer.u64(inputs.tick);
        writer.u64(inputs.time_ns);
        writer.needle(&inputs.needle.unwrap_or_default());
        writer.target(&inputs.target.unwrap_or_default());
        inputs.paddles.map(Option::unwrap_or_default).iter().for_each(|paddle| writer.paddle(paddle));
        writer.command(command);
    }

    /// Reads the fixed-size form; `None` for bytes that nobody writes.
    pub fn decode(reader: &mut ByteReader<'_>) -> Option<Self> {
        let present = reader.u32()?;
        if present > 15 {
            return None;
        }
        let (tick, time_ns) = (reader.u64()?, reader.u64()?);
        let (needle, target) = (reader.needle()?, reader.target()?);
        let paddles = [reader.paddle()?, reader.paddle()?];
        let command = reader.command()?;
        Some(Self {
            inputs: Inputs {
                tick,
                time_ns,
                needle: (present & 1 != 0).then_some(needle),
                target: (present & 2 != 0).then_some(target),
                paddles: [(present & 4 != 0).then_some(paddles[0]), (present & 8 != 0).then_some(paddles[1])],
            },
            command,
        })
    }
}
