//! Fault codes as constants of C: numbers, because a header cannot hold Rust's expressions. `tests/header.rs` holds them
//! against [`firmware::Faults`].

/// Not armed: some input has never been heard, or the measured paddle position is not adopted yet. HOLD.
pub const STILLPOINT_FAULT_WAITING: u64 = 0x1;
/// Needle sample older than its first limit. HOLD.
pub const STILLPOINT_FAULT_NEEDLE_STALE: u64 = 0x2;
/// Target sample older than its first limit. HOLD.
pub const STILLPOINT_FAULT_TARGET_STALE: u64 = 0x4;
/// Paddle sample older than its first limit. HOLD.
pub const STILLPOINT_FAULT_PADDLE_STALE: u64 = 0x8;
/// The sensor does not see the target. HOLD.
pub const STILLPOINT_FAULT_TARGET_LOST: u64 = 0x10;
/// Needle faster than the table holds for. HOLD.
pub const STILLPOINT_FAULT_NEEDLE_TOO_FAST: u64 = 0x20;
/// The measured paddle moves: its position is not adopted. HOLD.
pub const STILLPOINT_FAULT_PADDLE_MOVING: u64 = 0x40;
/// The measured paddle is further out than it may be commanded: its position is not adopted. HOLD.
pub const STILLPOINT_FAULT_PADDLE_BEYOND_LIMIT: u64 = 0x80;
/// Needle sample older than its second limit. SAFE.
pub const STILLPOINT_FAULT_NEEDLE_DEAD: u64 = 0x100;
/// Target sample older than its second limit. SAFE.
pub const STILLPOINT_FAULT_TARGET_DEAD: u64 = 0x200;
/// Paddle sample older than its second limit. SAFE.
pub const STILLPOINT_FAULT_PADDLE_DEAD: u64 = 0x400;
/// The tick's time or number did not go on; the tick's inputs were not read. SAFE.
pub const STILLPOINT_FAULT_CLOCK_REVERSED: u64 = 0x800;
/// Too many ticks were preceded by skipped ones. SAFE.
pub const STILLPOINT_FAULT_OVERRUN: u64 = 0x1000;
/// The paddle does not follow its commands. SAFE.
pub const STILLPOINT_FAULT_FOLLOWING_ERROR: u64 = 0x2000;
/// Another paddle is attached than the table was made for. SAFE.
pub const STILLPOINT_FAULT_PADDLE_IDENTITY: u64 = 0x4000;
/// The error grows although the controller acts: wrong sign, wrong table or wrong tissue. SAFE.
pub const STILLPOINT_FAULT_DIVERGENCE: u64 = 0x8000;
/// The law gave a number that is not finite; not emitted. SAFE.
pub const STILLPOINT_FAULT_INTERNAL: u64 = 0x10000;
/// The watchdog outside of the controller has taken over. SAFE; never set by the controller itself.
pub const STILLPOINT_FAULT_WATCHDOG: u64 = 0x20000;
/// The tick's time and number went on by different amounts; the tick's inputs were not read. SAFE.
pub const STILLPOINT_FAULT_CLOCK_JUMPED: u64 = 0x40000;
/// Depth outside the table, its nearest end is used. Goes on.
pub const STILLPOINT_FAULT_DEPTH_CLAMPED: u64 = 0x1000000;
/// Command limited in position. Goes on.
pub const STILLPOINT_FAULT_POSITION_LIMITED: u64 = 0x2000000;
/// Command limited in rate. Goes on.
pub const STILLPOINT_FAULT_RATE_LIMITED: u64 = 0x4000000;
/// Sequence numbers of an input skipped some. Goes on.
pub const STILLPOINT_FAULT_SAMPLE_GAP: u64 = 0x8000000;
/// An input arrived twice. Goes on.
pub const STILLPOINT_FAULT_DUPLICATE: u64 = 0x10000000;
/// An input arrived after a newer one and was discarded. Goes on.
pub const STILLPOINT_FAULT_OUT_OF_ORDER: u64 = 0x20000000;
/// An input with NaN, infinity or a subnormal was discarded. Goes on until stale.
pub const STILLPOINT_FAULT_NOT_FINITE: u64 = 0x40000000;
/// An implausible input was discarded (wrong units?). Goes on until stale.
pub const STILLPOINT_FAULT_OUT_OF_RANGE: u64 = 0x80000000;
/// An input from the future, or not after the one before it, was discarded. Goes on until stale.
pub const STILLPOINT_FAULT_SAMPLE_TIME: u64 = 0x100000000;
/// An input that jumped was discarded. Goes on until stale.
pub const STILLPOINT_FAULT_INNOVATION: u64 = 0x200000000;
/// An input whose value no longer changes was discarded. Goes on until stale.
pub const STILLPOINT_FAULT_FROZEN: u64 = 0x400000000;
/// Periods before this tick were skipped. Goes on until too many in a row.
pub const STILLPOINT_FAULT_TICKS_SKIPPED: u64 = 0x800000000;
/// What another code of this step says of a paddle, it says of the second one, at least. Never set in the plane.
pub const STILLPOINT_FAULT_SECOND_PADDLE: u64 = 0x1000000000;
