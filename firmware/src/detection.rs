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

/// The paddle's resolution as a part of its following error: its position is adopted when it has rested this well.
pub const RESOLUTION_PER_FOLLOWING_ERROR: f64 = 0.1;

/// Largest jump of sequence numbers that is a loss: 17 s at 1 MHz, 4 h at 1 kHz. What jumps further counts anew.
pub const SEQUENCE_JUMP: i32 = 1 << 24;

/// Samples in a row with new times, old numbers, and good content that take up a sender that counts anew.
pub const RESTART_SAMPLES: u32 = 5;

/// How far the numbers of two such samples may be apart.
pub const RESTART_SPACING: u32 = 64;

/// How much faster than the table's limit the needle may seem between two samples: jitter of their times.
pub const NEEDLE_JUMP_MARGIN: f64 = 2.0;

/// Depth jump that is always plausible, part of the table's depth range: sensor resolution.
pub const NEEDLE_JUMP_FLOOR: f64 = 0.01;

/// How much faster than the table's limit a needle may say that it goes: faster is a wrong unit. What is slower, and
/// too fast for the table, leads to HOLD.
pub const NEEDLE_SPEED_MARGIN: f64 = 10.0;

/// Contradiction of depth and velocity that is no fault, part of the depth range: resolution of the encoder.
pub const NEEDLE_CONTRADICTION: f64 = 0.005;

/// The same as a part of the motion: calibration of the velocity.
pub const NEEDLE_CONTRADICTION_RATIO: f64 = 0.25;

/// Motion over which depth and velocity are compared, part of the depth range.
pub const NEEDLE_WINDOW: f64 = 0.02;

/// Travel within which a depth that freezes, or a velocity that sticks or is more than twice too large, is found, part
/// of the depth range (there is a test). An encoder that says in both numbers that the needle rests cannot be told from a
/// needle that rests.
pub const NEEDLE_CONTRADICTION_TRAVEL: f64 = 0.02;

/// Longest time over which they are compared, ns: a velocity that is off by less than 0.05 % of the depth range per
/// second at rest is no fault.
pub const NEEDLE_WINDOW_NS: u64 = 10_000_000_000;

/// Identical samples that are still a coincidence.
pub const FROZEN_SAMPLES: u32 = 5;

/// Travel that must change the paddle's position, part of its range: well above any sensor's resolution.
pub const FROZEN_TRAVEL: f64 = 0.005;

/// Steps of the sensor's resolution that the target moves according to the table before an unchanged value is frozen:
/// real tissue may move a quarter as far as the table says.
pub const FROZEN_STEPS: f64 = 4.0;

/// Finest resolution that a target sensor is credited with, part of the plausible range of the target.
pub const FROZEN_RESOLUTION: f64 = 0.0005;

/// Coarsest resolution that a target sensor may have: assumed until its value has changed for the first time.
pub const FROZEN_UNSEEN_RESOLUTION: f64 = 0.025;

/// Standard deviations of noise that one innovation may show: one false alarm in 10¹⁴ samples.
pub const GATE_SIGMAS: f64 = 8.0;

/// Motion that real tissue may add to what the table says.
pub const GATE_MOTION: f64 = 3.0;

/// Always admitted, part of the plausible range of the target: what a sensor without stated noise resolves.
pub const GATE_FLOOR: f64 = 0.01;

/// The same for a sensor whose noise is stated: only what the table may be wrong by between two samples.
pub const GATE_FLOOR_STATED: f64 = 0.002;

/// What an event adds to a leaky bucket; a sample without one takes 1. With 4, every share of events above 1 in 5 is
/// found sooner or later. For the 20 events of the following error: 19 of 20 within 30 samples, half within 120, a
/// third within 400 (each with 99.99 %); 1 of 20 is a false alarm with less than 10⁻¹² in 100,000 samples.
pub const BUCKET_EVENT: u32 = 4;

/// Paddle samples off the command that are a fault, if in a row: longer than any hiccup of a servo. Otherwise
/// n of m, see [`BUCKET_EVENT`].
pub const FOLLOWING_SAMPLES: u32 = 20;

/// A window ends after this many time constants 1/g of the loop: enough for e³ of growth, too short for drift.
pub const DIVERGENCE_WINDOW: f64 = 3.0;

/// Growth of the error that is no transient. The lag behind a ramp approaches its end value from below.
pub const DIVERGENCE_GROWTH: f64 = 2.0;

/// Noise below which growth says nothing, standard deviations.
pub const DIVERGENCE_SIGMAS: f64 = 8.0;

/// Errors below this part of the plausible target range are left to the feedback.
pub const DIVERGENCE_FLOOR: f64 = 0.01;

/// How far off the table's tissue is thought to be, part of the largest slope of the target in depth, as the standard
/// deviation of the orthogonal slope that it leaves. The bundled scenes, mistaken for tissue without their inclusions,
/// leave 2.3 to 7.5 %; three standard deviations cover them.
pub const TISSUE_SPREAD: f64 = 0.025;

/// The target moves by itself as far as the tissue is thought to be off over the whole depth within this time, s.
pub const LEVEL_TIME: f64 = 30.0;

/// How much of the innovations before counts with the newest: ten samples or so.
pub const SURPRISE_MEMORY: f64 = 0.9;

/// Standard deviations of their sum that are no noise: of white innovations about one sum in two thousand is larger.
pub const SURPRISE_SIGMAS: f64 = 3.5;

/// Growth of the variances at every sample that surprises.
pub const SURPRISE_GROWTH: f64 = 3.0;

/// Variance of the slope, over that before the first sample, from which on surprise widens the level alone: a slope eight
/// times as steep as was thought.
pub const STEEPEST_SURPRISE: f64 = 64.0;

/// A breath takes at least and at most this long, s: a child's, and five a minute by a ventilator.
pub const SHORTEST_BREATH: f64 = 1.5;
/// See [`SHORTEST_BREATH`].
pub const LONGEST_BREATH: f64 = 12.0;

/// The target is smoothed over this time, s, before breaths are looked for: a sixth of the shortest one.
pub const BREATH_SMOOTHING: f64 = 0.25;

/// Smallest breath, standard deviations of the smoothed noise: twenty hours of noise alone have no two such swings in a row
/// (there is a test).
pub const BREATH_SIGMAS: f64 = 7.0;

/// How much a breath differs from the one before, standard deviation over its size.
pub const BREATH_WANDER: f64 = 0.3;

/// Change of the period, part of it, from which on a breath is another one: the second in a row is learnt anew.
pub const BREATH_CHANGE: f64 = 0.25;

/// How much a new period counts against those before: its own scatter, seen by ultrasound, is a tenth.
pub const BREATH_LEARNS: f64 = 0.3;

/// Time without a sample, over the shortest breath, in which a breath may begin unseen.
pub const BREATH_GAP: f64 = 0.5;

/// Breaths that may be missed before none is predicted any more.
pub const BREATHS_MISSED: f64 = 1.5;

/// Ticks with skipped periods before them that are a fault, if in a row; otherwise n of m, see [`BUCKET_EVENT`]. A loop
/// that skips every second period no longer runs at the rate that its gain was chosen for.
pub const MAX_SUCCESSIVE_OVERRUNS: u32 = 10;
