//! Plain structs of samples, settings and commands, and the constants in them.
//!
//! `_ns` are nanoseconds of one monotonic clock, `_lu` the unit of length of the scene that the table was made for.

use core::ffi::c_char;

/// Version of this header: give it to `stillpoint_init`, which refuses any other.
pub const STILLPOINT_API_VERSION: u32 = 1;

/// Bytes of memory that a controller needs at most, on every target; `stillpoint_memory_bytes()` are enough.
pub const STILLPOINT_MEMORY_BYTES: usize = 36864;
/// Alignment of that memory, bytes.
pub const STILLPOINT_MEMORY_ALIGNMENT: usize = 8;

/// `StillpointTargetSample.flags`: the sensor saw the target; without it the displacement means nothing.
pub const STILLPOINT_TARGET_VISIBLE: u32 = 1;

/// `StillpointCommand.flags`: the displacement is to be executed. Without it the actuator keeps its position.
pub const STILLPOINT_COMMAND_VALID: u32 = 1;

/// `StillpointInputs.arrived`: a needle sample has arrived since the last step.
pub const STILLPOINT_NEEDLE_ARRIVED: u32 = 1;
/// `StillpointInputs.arrived`: a target sample has arrived since the last step.
pub const STILLPOINT_TARGET_ARRIVED: u32 = 2;
/// `StillpointInputs.arrived`: a paddle sample has arrived since the last step.
pub const STILLPOINT_PADDLE_ARRIVED: u32 = 4;

/// `StillpointCommand.mode`: the paddle keeps its position; RUN follows by itself when the reason is gone.
pub const STILLPOINT_MODE_HOLD: u32 = 1;
/// `StillpointCommand.mode`: feed-forward and feedback act.
pub const STILLPOINT_MODE_RUN: u32 = 2;
/// `StillpointCommand.mode`: the paddle keeps its position until `stillpoint_rearm`.
pub const STILLPOINT_MODE_SAFE: u32 = 3;

/// `StillpointSettings.feedback`: every sample moves the paddle by a fixed part of the error; the fewest instructions.
pub const STILLPOINT_FEEDBACK_INTEGRAL: u32 = 0;
/// `StillpointSettings.feedback`: what the table leaves is estimated and removed. The default.
pub const STILLPOINT_FEEDBACK_OBSERVER: u32 = 1;
/// `StillpointSettings.feedback`: the observer, which predicts a patient's breaths as well.
pub const STILLPOINT_FEEDBACK_HARMONIC: u32 = 2;

/// `StillpointSettings.direction`: moves the target orthogonally to the needle only. The default.
pub const STILLPOINT_DIRECTION_INVERSE: u32 = 0;
/// `StillpointSettings.direction`: the shortest motion of the paddle; the target may move along the needle, too.
pub const STILLPOINT_DIRECTION_MINIMUM_NORM: u32 = 1;

/// `StillpointSettings.position_limit`: the norm of the displacement is limited. The default.
pub const STILLPOINT_POSITION_LIMIT_NORM: u32 = 0;
/// `StillpointSettings.position_limit`: each axis by itself, to the largest square inside the disc.
pub const STILLPOINT_POSITION_LIMIT_BOX: u32 = 1;

/// The tip of the needle as measured, at the rate of the loop.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StillpointNeedleSample {
    /// Counts the samples of this stream, from any number on; wraps.
    pub sequence: u32,
    /// 0.
    pub reserved: u32,
    /// Time of the measurement, ns.
    pub time_ns: u64,
    /// Depth of the insertion along the axis of the needle.
    pub depth_lu: f64,
    /// Rate of the depth.
    pub velocity_lu_per_s: f64,
}

/// Displacement of the target from its rest position, at the rate of its sensor.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StillpointTargetSample {
    /// Counts the samples of this stream, from any number on; wraps.
    pub sequence: u32,
    /// Set of `STILLPOINT_TARGET_VISIBLE`.
    pub flags: u32,
    /// Time of the measurement, not of its arrival, ns.
    pub time_ns: u64,
    /// x and y in the axes of the scene.
    pub displacement_lu: [f64; 2],
}

/// Where the paddle is, as measured by its actuator, at the rate of the loop.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StillpointPaddleSample {
    /// Counts the samples of this stream, from any number on; wraps.
    pub sequence: u32,
    /// Number of the paddle that is attached; must be the table's.
    pub paddle_index: u32,
    /// Time of the measurement, ns.
    pub time_ns: u64,
    /// x and y from where the paddle touches the undeformed tissue, in the axes of the scene.
    pub displacement_lu: [f64; 2],
}

/// What a step is given: the newest sample of each stream since the last one.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StillpointInputs {
    /// Number of this release of the loop; skipped releases leave gaps.
    pub tick: u64,
    /// Time of this tick on the clock that stamps the samples, ns.
    pub time_ns: u64,
    /// Newest needle sample, if `STILLPOINT_NEEDLE_ARRIVED`.
    pub needle: StillpointNeedleSample,
    /// Newest target sample, if `STILLPOINT_TARGET_ARRIVED`.
    pub target: StillpointTargetSample,
    /// Newest paddle sample, if `STILLPOINT_PADDLE_ARRIVED`.
    pub paddle: StillpointPaddleSample,
    /// Set of `STILLPOINT_*_ARRIVED`; what has not arrived is not read.
    pub arrived: u32,
    /// 0.
    pub reserved: u32,
}

/// Where the paddle shall be: one per step, in every mode.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StillpointCommand {
    /// Counts the commands; wraps.
    pub sequence: u32,
    /// One of `STILLPOINT_MODE_*`.
    pub mode: u32,
    /// The step's.
    pub tick: u64,
    /// The step's, ns.
    pub time_ns: u64,
    /// Set of `STILLPOINT_FAULT_*`.
    pub faults: u64,
    /// x and y of the paddle; to be executed only with `STILLPOINT_COMMAND_VALID`.
    pub displacement_lu: [f64; 2],
    /// Of the newest needle sample that was used.
    pub needle_sequence: u32,
    /// Of the newest target sample that was used.
    pub target_sequence: u32,
    /// Number of the paddle that the command is for.
    pub paddle_index: u32,
    /// Set of `STILLPOINT_COMMAND_VALID`.
    pub flags: u32,
}

/// What may be chosen; `stillpoint_default_settings` fills it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StillpointSettings {
    /// Period of the loop, ns; at most 10 s.
    pub loop_period_ns: u64,
    /// Period of the target sensor, ns; at least that of the loop, at most 10 s.
    pub target_period_ns: u64,
    /// Longest time from the measurement of the target to its arrival, ns.
    pub target_latency_ns: u64,
    /// Time from a command to the paddle being there, ns.
    pub actuator_delay_ns: u64,
    /// Standard deviation of the target sensor per component; 0: unknown.
    pub target_noise_lu: f64,
    /// Loop gain per target sample, at most 2; 0: the one that follows from the delay of the loop.
    pub loop_gain: f64,
    /// How much stronger the tissue may answer than the table says, from 1 to 100; 0: the table's.
    pub lambda_max: f64,
    /// Admitted distance between measured and commanded paddle at rest; 0: 2 % of the paddle's range.
    pub following_error_lu: f64,
    /// One of `STILLPOINT_FEEDBACK_*`.
    pub feedback: u32,
    /// One of `STILLPOINT_DIRECTION_*`.
    pub direction: u32,
    /// One of `STILLPOINT_POSITION_LIMIT_*`.
    pub position_limit: u32,
    /// 0.
    pub reserved: u32,
}

/// What a loaded table is for: to be compared with what is attached.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StillpointTable {
    /// SHA-256 of the scene that the table was made from.
    pub scene_hash: [u8; 32],
    /// What `_lu` means, as the scene calls it, for example "mm"; ends with 0.
    pub length_unit: [c_char; 24],
    /// Number of the paddle.
    pub paddle_index: u32,
    /// Depths in the table.
    pub knots: u32,
    /// Largest norm of a commanded displacement.
    pub max_displacement_lu: f64,
    /// Largest norm of its rate.
    pub max_rate_lu_per_s: f64,
    /// Smallest depth of the needle in the table.
    pub depth_start_lu: f64,
    /// Largest depth of the needle in the table.
    pub depth_end_lu: f64,
    /// Fastest needle that the table holds for.
    pub needle_speed_lu_per_s: f64,
    /// Unit vector along the insertion, in the axes of the scene.
    pub needle_axis: [f64; 2],
    /// Rest position of the target in the scene.
    pub target_position_lu: [f64; 2],
}
