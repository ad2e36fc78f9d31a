//! Samples that keep a controller in RUN: an insertion, and a paddle that is where it should be.

use firmware::contract::frames::{TARGET_VISIBLE, from_plane};
use firmware::contract::{NeedleSample, PaddleSample, Table, TargetSample};

use crate::world::loop_settings::LoopSettings;
use crate::world::needle::{NeedleMotion, NeedleTrajectory};

/// Time of the insertion, s; then the needle rests.
const INSERTION_S: f64 = 5.0;

/// What arrives for one tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct Samples {
    /// Every tick.
    pub(super) needle: NeedleSample,
    /// When the target sensor has one.
    pub(super) target: Option<TargetSample>,
    /// Every tick.
    pub(super) paddle: PaddleSample,
}

/// Makes the samples of one tick after the other, on the controller's own clock: it starts at 0 with the first tick.
#[derive(Clone, Debug)]
pub(super) struct Stimulus {
    trajectory: NeedleTrajectory,
    target_period_ns: u64,
    paddle_index: u32,
    sequence: u32,
    target_sequence: u32,
    next_target_ns: u64,
    /// When the needle started; none: it rests at the surface.
    needle_started_ns: Option<u64>,
}

impl Stimulus {
    /// For a controller with this table.
    pub(super) fn new(table: &Table<f64, 2>, loop_settings: &LoopSettings) -> Self {
        let target_ticks = (loop_settings.rate / loop_settings.target_rate).round().max(1.0) as u64;
        Self {
            trajectory: NeedleTrajectory::new(table.validity.depth_end, INSERTION_S),
            target_period_ns: target_ticks * loop_settings.period_ns(),
            paddle_index: table.paddles[0].index,
            sequence: 0,
            target_sequence: 0,
            next_target_ns: 0,
            needle_started_ns: None,
        }
    }

    /// The needle starts, as it does with the first RUN.
    pub(super) fn start_needle(&mut self, time_ns: u64) {
        self.needle_started_ns = Some(time_ns);
    }

    /// The samples measured at `time_ns`, with the paddle where the last command wanted it. The world goes on with
    /// time: what a stopped loop has missed is over.
    pub(super) fn samples(&mut self, time_ns: u64, displacement: [f64; 2]) -> Samples {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        let since_start_ns = self.needle_started_ns.map_or(0, |started_ns| time_ns.saturating_sub(started_ns));
        let NeedleMotion { depth, velocity } = self.trajectory.at(since_start_ns as f64 * 1e-9);
        let target = (time_ns >= self.next_target_ns).then(|| {
            self.next_target_ns = time_ns + self.target_period_ns - time_ns % self.target_period_ns;
            // Alternates by an amount below every gate: a frozen value would be refused.
            let wobble = if self.target_sequence.is_multiple_of(2) { 1e-6 } else { -1e-6 };
            let sequence = self.target_sequence;
            self.target_sequence = sequence.wrapping_add(1);
            TargetSample { sequence, flags: TARGET_VISIBLE, time_ns, displacement: from_plane([wobble, 0.0]) }
        });
        Samples {
            needle: NeedleSample { sequence, reserved: 0, time_ns, depth, velocity },
            target,
            paddle: PaddleSample {
                sequence,
                paddle_index: self.paddle_index,
                time_ns,
                displacement: from_plane(displacement),
            },
        }
    }
}
