//! Damage on the line: drops, changes, doubles and swaps bytes and frames, from a seed.

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};

/// What happens to the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Damage {
    /// A byte is lost.
    DropByte,
    /// A bit of a byte is flipped.
    CorruptByte,
    /// A byte comes twice.
    DoubleByte,
    /// Two neighbouring bytes change places.
    SwapBytes,
    /// A frame is lost.
    DropFrame,
    /// A frame comes twice.
    DoubleFrame,
    /// A frame comes after the one behind it.
    SwapFrames,
}

impl Damage {
    /// All kinds.
    pub const ALL: [Self; 7] = [
        Self::DropByte,
        Self::CorruptByte,
        Self::DoubleByte,
        Self::SwapBytes,
        Self::DropFrame,
        Self::DoubleFrame,
        Self::SwapFrames,
    ];
}

/// Damages one frame in so many.
#[derive(Debug)]
pub struct Tamper {
    damage: Option<(Damage, u32, Pcg64Mcg)>,
    /// Bytes of a frame that is not complete yet.
    partial: Vec<u8>,
    /// A frame that waits for the one behind it.
    held: Vec<u8>,
    damaged: u64,
}

impl Tamper {
    /// A line that passes everything.
    pub const fn none() -> Self {
        Self { damage: None, partial: Vec::new(), held: Vec::new(), damaged: 0 }
    }

    /// Damages one frame in `one_in`, on average.
    pub fn new(damage: Damage, one_in: u32, seed: u64) -> Self {
        Self { damage: Some((damage, one_in.max(1), Pcg64Mcg::seed_from_u64(seed))), ..Self::none() }
    }

    /// Frames damaged so far.
    pub fn damaged(&self) -> u64 {
        self.damaged
    }

    /// What comes out at the other end for these bytes.
    pub fn pass(&mut self, bytes: &[u8]) -> Vec<u8> {
        if self.damage.is_none() {
            return bytes.to_vec();
        }
        let mut passed = Vec::new();
        for byte in bytes {
            self.partial.push(*byte);
            // Frames start and end with 0: whole once there is something between.
            if *byte == 0 && self.partial.len() > 1 {
                let frame = std::mem::take(&mut self.partial);
                self.pass_frame(frame, &mut passed);
            }
        }
        passed
    }

    fn pass_frame(&mut self, mut frame: Vec<u8>, passed: &mut Vec<u8>) {
        let Some((damage, one_in, random)) = &mut self.damage else { return };
        let hit = random.next_u32() % *one_in == 0;
        let held = std::mem::take(&mut self.held);
        if hit {
            self.damaged += 1;
            let at = random.next_u32() as usize % frame.len();
            match damage {
                Damage::DropByte => drop(frame.remove(at)),
                Damage::CorruptByte => frame[at] ^= 1 << (random.next_u32() % 8),
                Damage::DoubleByte => frame.insert(at, frame[at]),
                Damage::SwapBytes => frame.swap(at, at.saturating_sub(1)),
                Damage::DropFrame => frame.clear(),
                Damage::DoubleFrame => frame.extend_from_within(..),
                Damage::SwapFrames if held.is_empty() => self.held = std::mem::take(&mut frame),
                Damage::SwapFrames => {}
            }
        }
        passed.extend(frame);
        passed.extend(held);
    }
}
