//! Every limit of detection in one place, each with its reason.

/// Lost target samples that do not interrupt RUN: two in a row happen to every camera, three are an outage.
pub const TARGET_SAMPLES_TO_HOLD: u64 = 3;

/// Missing target samples after which the situation must be looked at.
pub const TARGET_SAMPLES_TO_SAFE: u64 = 15;

/// Loop-rate inputs older than this many ticks lead to HOLD: scheduling hiccups of a few ticks are normal.
pub const TICKS_TO_HOLD: u64 = 5;

/// Nothing goes to SAFE by age sooner: a peer stopped for 100 ms must be able to come back.
pub const SAFE_AGE_FLOOR_NS: u64 = 250_000_000;

/// Depths this far outside the table, as a part of its range, are plausible (clamped); further ones are wrong units.
pub const DEPTH_MARGIN: f64 = 1.0;

/// Target displacements up to this multiple of the table's largest are plausible.
pub const TARGET_MARGIN: f64 = 3.0;

/// Measured paddle positions this far outside the limit are still noise.
pub const PADDLE_MARGIN: f64 = 1.1;

/// Following error at rest, part of the paddle's range: ten times the resolution of ordinary actuators.
pub const FOLLOWING_FRACTION: f64 = 0.02;

/// How much faster than the table's limit the needle may seem between two samples: jitter of their times.
pub const NEEDLE_JUMP_MARGIN: f64 = 2.0;

/// Depth jump that is always plausible, part of the table's depth range: sensor resolution.
pub const NEEDLE_JUMP_FLOOR: f64 = 0.01;

/// Identical samples that are still a coincidence.
pub const FROZEN_SAMPLES: u32 = 5;

/// Travel that must change a value, part of the range of the depth or the paddle: well above any sensor's resolution.
pub const FROZEN_TRAVEL: f64 = 0.005;

/// Standard deviations of noise that one innovation may show: one false alarm in 10¹⁴ samples.
pub const GATE_SIGMAS: f64 = 8.0;

/// Motion that real tissue may add to what the table says.
pub const GATE_MOTION: f64 = 3.0;

/// Always admitted, part of the plausible range of the target: what a sensor without stated noise resolves.
pub const GATE_FLOOR: f64 = 0.01;

/// The same for a sensor whose noise is stated: only what the table may be wrong by between two samples.
pub const GATE_FLOOR_STATED: f64 = 0.002;

/// Successive paddle samples off the command that are a fault: longer than any hiccup of a servo.
pub const FOLLOWING_SAMPLES: u32 = 20;

/// A window ends after this many time constants 1/g of the loop: enough for e³ of growth, too short for drift.
pub const DIVERGENCE_WINDOW: f64 = 3.0;

/// Growth of the error that is no transient. The lag behind a ramp approaches its end value from below.
pub const DIVERGENCE_GROWTH: f64 = 2.0;

/// Noise below which growth says nothing, standard deviations.
pub const DIVERGENCE_SIGMAS: f64 = 8.0;

/// Errors below this part of the plausible target range are left to the feedback.
pub const DIVERGENCE_FLOOR: f64 = 0.01;

/// Successive ticks with skipped periods before them that are tolerated: a loop that skips every second period no
/// longer runs at the rate that its gain was chosen for.
pub const MAX_SUCCESSIVE_OVERRUNS: u32 = 10;
