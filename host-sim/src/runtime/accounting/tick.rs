//! What the controller saw and answered, tick by tick.

use firmware::Inputs;
use firmware::contract::frames::MAX_PADDLES;
use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};

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
        let needle = inputs.needle.unwrap_or_default();
        writer.u32(needle.sequence);
        writer.u32(needle.reserved);
        writer.u64(needle.time_ns);
        writer.f64(needle.depth);
        writer.f64(needle.velocity);
        let target = inputs.target.unwrap_or_default();
        writer.u32(target.sequence);
        writer.u32(target.flags);
        writer.u64(target.time_ns);
        target.displacement.into_iter().for_each(|component| writer.f64(component));
        for paddle in inputs.paddles.map(Option::unwrap_or_default) {
            writer.u32(paddle.sequence);
            writer.u32(paddle.paddle_index);
            writer.u64(paddle.time_ns);
            paddle.displacement.into_iter().for_each(|component| writer.f64(component));
        }
        writer.u32(command.sequence);
        writer.u32(command.state);
        writer.u64(command.tick);
        writer.u64(command.time_ns);
        writer.u64(command.faults);
        command.displacement.into_iter().flatten().for_each(|component| writer.f64(component));
        writer.u32(command.needle_sequence);
        writer.u32(command.target_sequence);
        command.paddle_index.into_iter().for_each(|index| writer.u32(index));
        writer.u32(command.flags);
        writer.u32(command.reserved);
    }

    /// Reads the fixed-size form; `None` for bytes that nobody writes.
    pub fn decode(reader: &mut ByteReader<'_>) -> Option<Self> {
        let present = reader.u32()?;
        if present > 15 {
            return None;
        }
        let (tick, time_ns) = (reader.u64()?, reader.u64()?);
        let needle = NeedleSample {
            sequence: reader.u32()?,
            reserved: reader.u32()?,
            time_ns: reader.u64()?,
            depth: reader.f64()?,
            velocity: reader.f64()?,
        };
        let target = TargetSample {
            sequence: reader.u32()?,
            flags: reader.u32()?,
            time_ns: reader.u64()?,
            displacement: reader.displacement()?,
        };
        let paddles = [paddle(reader)?, paddle(reader)?];
        let command = PaddleCommand {
            sequence: reader.u32()?,
            state: reader.u32()?,
            tick: reader.u64()?,
            time_ns: reader.u64()?,
            faults: reader.u64()?,
            displacement: [reader.displacement()?, reader.displacement()?],
            needle_sequence: reader.u32()?,
            target_sequence: reader.u32()?,
            paddle_index: [reader.u32()?, reader.u32()?],
            flags: reader.u32()?,
            reserved: reader.u32()?,
        };
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

fn paddle(reader: &mut ByteReader<'_>) -> Option<PaddleSample> {
    Some(PaddleSample {
        sequence: reader.u32()?,
        paddle_index: reader.u32()?,
        time_ns: reader.u64()?,
        displacement: reader.displacement()?,
    })
}
