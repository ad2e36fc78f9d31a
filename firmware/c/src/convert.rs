//! Between the structs of C and those of the controller.

use core::ffi::c_char;

use firmware::contract::frames::{from_plane, to_plane};
use firmware::{
    Direction, Feedback, Inputs, Mode, NeedleSample, PaddleCommand, PaddleSample, PositionLimit, Settings, Table,
    TargetSample,
};

use crate::faults::STILLPOINT_FAULT_WATCHDOG;
use crate::status::StillpointStatus;
use crate::types::*;

impl From<&StillpointNeedleSample> for NeedleSample {
    fn from(sample: &StillpointNeedleSample) -> Self {
        Self {
            sequence: sample.sequence,
            reserved: 0,
            time_ns: sample.time_ns,
            depth: sample.depth_lu,
            velocity: sample.velocity_lu_per_s,
        }
    }
}

impl From<&StillpointTargetSample> for TargetSample {
    fn from(sample: &StillpointTargetSample) -> Self {
        Self {
            sequence: sample.sequence,
            flags: sample.flags,
            time_ns: sample.time_ns,
            displacement: from_plane(sample.displacement_lu),
        }
    }
}

impl From<&StillpointPaddleSample> for PaddleSample {
    fn from(sample: &StillpointPaddleSample) -> Self {
        Self {
            sequence: sample.sequence,
            paddle_index: sample.paddle_index,
            time_ns: sample.time_ns,
            displacement: from_plane(sample.displacement_lu),
        }
    }
}

impl TryFrom<&StillpointInputs> for Inputs {
    type Error = StillpointStatus;

    fn try_from(inputs: &StillpointInputs) -> Result<Self, StillpointStatus> {
        const KNOWN: u32 = STILLPOINT_NEEDLE_ARRIVED | STILLPOINT_TARGET_ARRIVED | STILLPOINT_PADDLE_ARRIVED;
        if inputs.arrived & !KNOWN != 0 || inputs.reserved != 0 {
            return Err(StillpointStatus::UnknownOption);
        }
        let has = |bit| inputs.arrived & bit != 0;
        Ok(Self {
            tick: inputs.tick,
            time_ns: inputs.time_ns,
            needle: has(STILLPOINT_NEEDLE_ARRIVED).then(|| (&inputs.needle).into()),
            target: has(STILLPOINT_TARGET_ARRIVED).then(|| (&inputs.target).into()),
            paddles: [has(STILLPOINT_PADDLE_ARRIVED).then(|| (&inputs.paddle).into()), None],
        })
    }
}

impl From<&PaddleCommand> for StillpointCommand {
    fn from(command: &PaddleCommand) -> Self {
        Self {
            sequence: command.sequence,
            mode: command.state,
            tick: command.tick,
            time_ns: command.time_ns,
            faults: command.faults,
            displacement_lu: to_plane(command.displacement[0]),
            needle_sequence: command.needle_sequence,
            target_sequence: command.target_sequence,
            paddle_index: command.paddle_index[0],
            flags: command.flags,
        }
    }
}

impl StillpointCommand {
    /// What stands in the place of a command that could not be computed: SAFE, and nothing to execute. A caller that does
    /// not look at the status moves nothing.
    pub(crate) const NONE: Self = Self {
        sequence: 0,
        mode: Mode::Safe as u32,
        tick: 0,
        time_ns: 0,
        faults: STILLPOINT_FAULT_WATCHDOG,
        displacement_lu: [0.0; 2],
        needle_sequence: 0,
        target_sequence: 0,
        paddle_index: 0,
        flags: 0,
    };
}

impl From<&Settings> for StillpointSettings {
    fn from(settings: &Settings) -> Self {
        Self {
            loop_period_ns: settings.loop_period_ns,
            target_period_ns: settings.target_period_ns,
            target_latency_ns: settings.target_latency_ns,
            actuator_delay_ns: settings.actuator_delay_ns,
            target_noise_lu: settings.target_noise,
            loop_gain: settings.loop_gain.unwrap_or_default(),
            lambda_max: settings.lambda_max.unwrap_or_default(),
            following_error_lu: settings.following_error.unwrap_or_default(),
            feedback: match settings.feedback {
                Feedback::Integral => STILLPOINT_FEEDBACK_INTEGRAL,
                Feedback::Observer => STILLPOINT_FEEDBACK_OBSERVER,
                Feedback::Harmonic => STILLPOINT_FEEDBACK_HARMONIC,
            },
            direction: match settings.direction {
                // What the plane has when nobody chooses.
                None | Some(Direction::Inverse) => STILLPOINT_DIRECTION_INVERSE,
                Some(Direction::MinimumNorm) => STILLPOINT_DIRECTION_MINIMUM_NORM,
            },
            position_limit: match settings.position_limit {
                PositionLimit::Norm => STILLPOINT_POSITION_LIMIT_NORM,
                PositionLimit::Box => STILLPOINT_POSITION_LIMIT_BOX,
            },
            reserved: 0,
        }
    }
}

impl TryFrom<&StillpointSettings> for Settings {
    type Error = StillpointStatus;

    fn try_from(settings: &StillpointSettings) -> Result<Self, StillpointStatus> {
        let unknown = StillpointStatus::UnknownOption;
        if settings.reserved != 0 {
            return Err(unknown);
        }
        // None of the three may be 0, which therefore means that it is left open.
        let chosen = |number: f64| (number != 0.0).then_some(number);
        Ok(Self {
            loop_period_ns: settings.loop_period_ns,
            target_period_ns: settings.target_period_ns,
            target_latency_ns: settings.target_latency_ns,
            actuator_delay_ns: settings.actuator_delay_ns,
            target_noise: settings.target_noise_lu,
            feedback: match settings.feedback {
                STILLPOINT_FEEDBACK_INTEGRAL => Feedback::Integral,
                STILLPOINT_FEEDBACK_OBSERVER => Feedback::Observer,
                STILLPOINT_FEEDBACK_HARMONIC => Feedback::Harmonic,
                _ => return Err(unknown),
            },
            loop_gain: chosen(settings.loop_gain),
            lambda_max: chosen(settings.lambda_max),
            direction: match settings.direction {
                STILLPOINT_DIRECTION_INVERSE => Some(Direction::Inverse),
                STILLPOINT_DIRECTION_MINIMUM_NORM => Some(Direction::MinimumNorm),
                _ => return Err(unknown),
            },
            position_limit: match settings.position_limit {
                STILLPOINT_POSITION_LIMIT_NORM => PositionLimit::Norm,
                STILLPOINT_POSITION_LIMIT_BOX => PositionLimit::Box,
                _ => return Err(unknown),
            },
            following_error: chosen(settings.following_error_lu),
        })
    }
}

impl From<&Table<f64>> for StillpointTable {
    fn from(table: &Table<f64>) -> Self {
        let mut length_unit = [0; 24];
        // A label has 16 bytes at most: the rest is 0.
        for (place, byte) in length_unit.iter_mut().zip(table.units.length.bytes()) {
            *place = byte as c_char;
        }
        Self {
            scene_hash: table.scene_hash,
            length_unit,
            paddle_index: table.paddles[0].index,
            knots: table.knots.len() as u32,
            max_displacement_lu: table.paddles[0].max_displacement,
            max_rate_lu_per_s: table.paddles[0].max_rate,
            depth_start_lu: table.validity.depth_start,
            depth_end_lu: table.validity.depth_end,
            needle_speed_lu_per_s: table.validity.needle_speed,
            needle_axis: table.needle_axis.into(),
            target_position_lu: table.target_position.into(),
        }
    }
}
