//! Samples that keep a controller in RUN: an insertion over and over, a paddle that is where it should be.

use firmware::contract::frames::TARGET_VISIBLE;
use firmware::contract::{NeedleSample, PaddleSample, Table, TargetSample};

use crate::world::loop_settings::LoopSettings;
use crate::world::needle::{NeedleMotion, NeedleTrajectory};

/// Time of one insertion, s.
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

/// Makes the samples of one tick after the other.
#[derive(Clone, Debug)]
pub(super) struct Stimulus {
    trajectory: NeedleTrajectory,
    target_ticks: u64,
    period_ns: u64,
    paddle_index: u32,
    sequence: u32,
    target_sequence: u32,
}

impl Stimulus {
    /// For a controller with this table.
    pub(super) fn new(table: &Table<f64, 2>, loop_settings: &LoopSettings) -> Self {
        Self {
            trajectory: NeedleTrajectory::new(table.validity.depth_end, INSERTION_S),
            target_ticks: (loop_settings.rate / loop_settings.target_rate).round().max(1.0) as u64,
            period_ns: loop_settings.period_ns(),
            paddle_index: table.paddle.index,
            sequence: 0,
            target_sequence: 0,
        }
    }

    /// The samples measured at `time_ns`, with the paddle where the last command wanted it.
    pub(super) fn samples(&mut self, time_ns: u64, displacement: [f64; 2]) -> Samples {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        let NeedleMotion { depth, velocity } = self.trajectory.at(f64::from(sequence) * self.period_ns as f64 * 1e-9);
        let target = u64::from(sequence).is_multiple_of(self.target_ticks).then(|| {
            // Alternates by an amount below every gate: a frozen value would be refused.
            let wobble = if self.target_sequence.is_multiple_of(2) { 1e-6 } else { -1e-6 };
            let sequence = self.target_sequence;
            self.target_sequence = sequence.wrapping_add(1);
            TargetSample { sequence, flags: TARGET_VISIBLE, time_ns, displacement: [wobble, 0.0] }
        });
        Samples {
            needle: NeedleSample { sequence, reserved: 0, time_ns, depth, velocity },
            target,
            paddle: PaddleSample { sequence, paddle_index: self.paddle_index, time_ns, displacement },
        }
    }
}
