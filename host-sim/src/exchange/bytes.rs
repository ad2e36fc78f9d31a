//! Little-endian fields and frames, written and read one after the other: a frame as it lies in memory, without padding.

use firmware::contract::frames::MAX_DIMENSION;
use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};

/// Appends fields.
#[derive(Clone, Debug, Default)]
pub struct ByteWriter(pub Vec<u8>);

impl ByteWriter {
    /// Appends bytes as they are.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.0.extend_from_slice(bytes);
    }

    /// Appends four bytes.
    pub fn u32(&mut self, value: u32) {
        self.bytes(&value.to_le_bytes());
    }

    /// Appends eight bytes.
    pub fn u64(&mut self, value: u64) {
        self.bytes(&value.to_le_bytes());
    }

    /// Appends the bits of a number.
    pub fn f64(&mut self, value: f64) {
        self.u64(value.to_bits());
    }

    /// Appends the components of a displacement.
    pub fn displacement(&mut self, components: [f64; MAX_DIMENSION]) {
        components.into_iter().for_each(|component| self.f64(component));
    }

    /// Appends a needle sample, 32 bytes.
    pub fn needle(&mut self, needle: &NeedleSample) {
        self.u32(needle.sequence);
        self.u32(needle.reserved);
        self.u64(needle.time_ns);
        self.f64(needle.depth);
        self.f64(needle.velocity);
    }

    /// Appends a target sample, 40 bytes.
    pub fn target(&mut self, target: &TargetSample) {
        self.u32(target.sequence);
        self.u32(target.flags);
        self.u64(target.time_ns);
        self.displacement(target.displacement);
    }

    /// Appends a sample of a paddle, 40 bytes.
    pub fn paddle(&mut self, paddle: &PaddleSample) {
        self.u32(paddle.sequence);
        self.u32(paddle.paddle_index);
        self.u64(paddle.time_ns);
        self.displacement(paddle.displacement);
    }

    /// Appends a command, 104 bytes.
    pub fn command(&mut self, command: &PaddleCommand) {
        self.u32(command.sequence);
        self.u32(command.state);
        self.u64(command.tick);
        self.u64(command.time_ns);
        self.u64(command.faults);
        command.displacement.into_iter().for_each(|components| self.displacement(components));
        self.u32(command.needle_sequence);
        self.u32(command.target_sequence);
        command.paddle_index.into_iter().for_each(|index| self.u32(index));
        self.u32(command.flags);
        self.u32(command.reserved);
    }
}

/// Takes fields off the front; `None` at the end.
#[derive(Clone, Debug)]
pub struct ByteReader<'a>(pub &'a [u8]);

impl<'a> ByteReader<'a> {
    /// Takes some bytes.
    pub fn slice(&mut self, length: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(taken)
    }

    /// Takes a fixed number of bytes.
    pub fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*taken)
    }

    /// Takes four bytes.
    pub fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    /// Takes eight bytes.
    pub fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// Takes the bits of a number.
    pub fn f64(&mut self) -> Option<f64> {
        self.u64().map(f64::from_bits)
    }

    /// Takes the components of a displacement.
    pub fn displacement(&mut self) -> Option<[f64; MAX_DIMENSION]> {
        Some([self.f64()?, self.f64()?, self.f64()?])
    }

    /// Takes a needle sample.
    pub fn needle(&mut self) -> Option<NeedleSample> {
        Some(NeedleSample {
            sequence: self.u32()?,
            reserved: self.u32()?,
            time_ns: self.u64()?,
            depth: self.f64()?,
            velocity: self.f64()?,
        })
    }

    /// Takes a target sample.
    pub fn target(&mut self) -> Option<TargetSample> {
        Some(TargetSample {
            sequence: self.u32()?,
            flags: self.u32()?,
            time_ns: self.u64()?,
            displacement: self.displacement()?,
        })
    }

    /// Takes a sample of a paddle.
    pub fn paddle(&mut self) -> Option<PaddleSample> {
        Some(PaddleSample {
            sequence: self.u32()?,
            paddle_index: self.u32()?,
            time_ns: self.u64()?,
            displacement: self.displacement()?,
        })
    }

    /// Takes a command.
    pub fn command(&mut self) -> Option<PaddleCommand> {
        Some(PaddleCommand {
            sequence: self.u32()?,
            state: self.u32()?,
            tick: self.u64()?,
            time_ns: self.u64()?,
            faults: self.u64()?,
            displacement: [self.displacement()?, self.displacement()?],
            needle_sequence: self.u32()?,
            target_sequence: self.u32()?,
            paddle_index: [self.u32()?, self.u32()?],
            flags: self.u32()?,
            reserved: self.u32()?,
        })
    }
}
