//! Sample frames: what crosses the boundary of the controller, byte for byte.
//!
//! Every frame is `repr(C)`, has `u32`, `u64` and `f64` fields whatever the controller computes in, and no padding (checked at compile time), so that it can lie in shared
//! memory, and derives serde, so that postcard can put it on a serial line. Lengths are in the scene's length unit,
//! times in nanoseconds of one monotonic clock shared by all frames of a run.
//!
//! Displacements have three components in every frame, so that one layout serves the plane and space. In the plane the
//! third one is 0 in what the controller sends and ignored in what it receives: nothing out of the plane is in its model,
//! and a sensor in space may well show some. Every paddle has its own samples, with its own sensor, numbers and times;
//! the command is one for both, because they act together.
//!
//! `sequence` counts publications of one stream and wraps at 2³²; its first value is free.

use core::mem::{align_of, size_of};

use serde::{Deserialize, Serialize};

/// Version of the layout of all frames; goes into service names and handshakes.
pub const LAYOUT_VERSION: u32 = 2;

/// Largest dimension of space: components of a displacement in a frame.
pub const MAX_DIMENSION: usize = 3;

/// Most paddles that a controller moves: displacements in a command.
pub const MAX_PADDLES: usize = 2;

/// [`TargetSample::flags`]: the sensor saw the target; without it the displacement means nothing.
pub const TARGET_VISIBLE: u32 = 1 << 0;

/// [`PaddleCommand::flags`]: `displacement` is to be executed. Without it the actuators keep their positions, because
/// the controller has not yet heard where every paddle is.
pub const COMMAND_VALID: u32 = 1 << 0;

/// Needle tip as measured, at loop rate.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NeedleSample {
    /// Publication counter, wraps.
    pub sequence: u32,
    /// Zero; keeps the layout free of padding.
    pub reserved: u32,
    /// Time of the measurement, ns.
    pub time_ns: u64,
    /// Insertion depth along the needle axis, length.
    pub depth: f64,
    /// Rate of the depth, length/s.
    pub velocity: f64,
}

/// Displacement of the target from its rest position, at the sensor's own rate.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TargetSample {
    /// Publication counter, wraps.
    pub sequence: u32,
    /// Bit set of [`TARGET_VISIBLE`].
    pub flags: u32,
    /// Time of the measurement (not of its arrival), ns.
    pub time_ns: u64,
    /// Displacement x, y, z from the rest position, length.
    pub displacement: [f64; MAX_DIMENSION],
}

impl TargetSample {
    /// Whether the sensor saw the target.
    pub const fn is_visible(&self) -> bool {
        self.flags & TARGET_VISIBLE != 0
    }
}

/// Where one paddle is, as measured by its actuator.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PaddleSample {
    /// Publication counter, wraps.
    pub sequence: u32,
    /// Identity of the attached paddle; must be the table's for the place that the sample is read from.
    pub paddle_index: u32,
    /// Time of the measurement, ns.
    pub time_ns: u64,
    /// Displacement x, y, z of the paddle from where it touches the undeformed tissue, length.
    pub displacement: [f64; MAX_DIMENSION],
}

/// Where the paddles shall be: one per tick, in every state.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PaddleCommand {
    /// Publication counter, wraps.
    pub sequence: u32,
    /// [`super::Mode`] as a number: 1 HOLD, 2 RUN, 3 SAFE.
    pub state: u32,
    /// Number of the release that this command belongs to; skipped periods leave gaps.
    pub tick: u64,
    /// Time of the tick, ns.
    pub time_ns: u64,
    /// Bit set of [`super::Faults`].
    pub faults: u64,
    /// Displacement x, y, z of each paddle in the order of the table, length; 0 for a paddle that the table does not have.
    pub displacement: [[f64; MAX_DIMENSION]; MAX_PADDLES],
    /// Sequence number of the newest needle sample that was used.
    pub needle_sequence: u32,
    /// Sequence number of the newest target sample that was used.
    pub target_sequence: u32,
    /// Identities of the paddles that the command is for, in the order of the table; 0 in a place without a paddle, where
    /// the displacement is 0, too.
    pub paddle_index: [u32; MAX_PADDLES],
    /// Bit set of [`COMMAND_VALID`].
    pub flags: u32,
    /// Zero; keeps the layout free of padding.
    pub reserved: u32,
}

impl PaddleCommand {
    /// Whether the actuators may execute [`displacement`](Self::displacement).
    pub const fn is_valid(&self) -> bool {
        self.flags & COMMAND_VALID != 0
    }
}

/// The components in a frame of a displacement in the plane: z is 0.
pub const fn from_plane([x, y]: [f64; 2]) -> [f64; MAX_DIMENSION] {
    [x, y, 0.0]
}

/// The displacement in the plane of components in a frame: z is left out.
pub const fn to_plane([x, y, _]: [f64; MAX_DIMENSION]) -> [f64; 2] {
    [x, y]
}

/// A frame is as large as its fields together (no padding) and aligned to 8.
macro_rules! assert_layout {
    ($frame:ty, $bytes:expr, $words32:expr, $words64:expr) => {
        const _: () = {
            assert!(size_of::<$frame>() == $bytes);
            assert!(align_of::<$frame>() == 8);
            assert!($words32 * size_of::<u32>() + $words64 * size_of::<u64>() == $bytes);
        };
    };
}

assert_layout!(NeedleSample, 32, 2, 3);
assert_layout!(TargetSample, 40, 2, 4);
assert_layout!(PaddleSample, 40, 2, 4);
assert_layout!(PaddleCommand, 104, 8, 9);

#[cfg(test)]
mod tests {
    use super::*;

    fn round_trip<F: Serialize + for<'de> Deserialize<'de> + PartialEq + core::fmt::Debug>(frame: F) {
        let mut buffer = [0u8; 128];
        let bytes = postcard::to_slice_cobs(&frame, &mut buffer).unwrap();
        assert_eq!(postcard::from_bytes_cobs::<F>(bytes).unwrap(), frame);
    }

    #[test]
    fn every_frame_survives_the_serial_line() {
        round_trip(NeedleSample { sequence: u32::MAX, reserved: 0, time_ns: 7, depth: 0.1, velocity: -2.5e-3 });
        round_trip(TargetSample { sequence: 3, flags: TARGET_VISIBLE, time_ns: 9, displacement: [1e-9, -0.3, 7.0] });
        round_trip(PaddleSample { sequence: 3, paddle_index: 4, time_ns: u64::MAX, displacement: [0.0, -0.0, 1.0] });
        round_trip(PaddleCommand {
            state: 2,
            tick: 1 << 40,
            faults: 1 << 33,
            flags: 1,
            displacement: [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]],
            paddle_index: [3, u32::MAX],
            ..PaddleCommand::default()
        });
    }
}
