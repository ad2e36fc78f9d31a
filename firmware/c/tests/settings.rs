//! Every setting arrives: with each of them changed, the commands are those of the controller in Rust, and others than without.
#![allow(unsafe_code)]

mod caller;

use caller::{Caller, default_settings, table};
use firmware::contract::frames::{TARGET_VISIBLE, from_plane, to_plane};
use firmware::{
    Controller, Direction, Faults, Feedback, Inputs, NeedleSample, PaddleCommand, PaddleSample, PositionLimit,
    Settings, State, TargetSample,
};
use stillpoint::StillpointStatus as Status;
use stillpoint::api::stillpoint_step;
use stillpoint::types::*;

/// An insertion in tissue that the table does not know well, pushed aside far enough for every limit, and breathing; the
/// paddle stays a little behind its commands.
struct Run {
    paddle: [f64; 2],
    tick: u64,
}

impl Run {
    fn new() -> Self {
        Self { paddle: [0.0; 2], tick: 0 }
    }

    fn sense(&self) -> Inputs {
        let (tick, time_ns, sequence) = (self.tick, self.tick * 1_000_000, self.tick as u32);
        let seconds = tick as f64 * 1e-3;
        let depth = (0.02 * seconds).min(0.1);
        let [x, y] = self.paddle;
        // In a sensor's steps, so that noise can be told from motion.
        let breath = (1e5 * 2e-3 * (std::f64::consts::TAU * seconds / 2.0).sin()).round() * 1e-5;
        let displacement = [0.30 * x + 0.05 * y + 0.2 * depth + breath, -0.04 * x + 0.25 * y - 0.1 * depth];
        let needle =
            NeedleSample { sequence, reserved: 0, time_ns, depth, velocity: if depth < 0.1 { 0.02 } else { 0.0 } };
        let target = TargetSample { sequence, flags: TARGET_VISIBLE, time_ns, displacement: from_plane(displacement) };
        let paddle = PaddleSample { sequence, paddle_index: 3, time_ns, displacement: from_plane(self.paddle) };
        let target = tick.is_multiple_of(20).then_some(target);
        Inputs { tick, time_ns, needle: Some(needle), target, paddles: [Some(paddle), None] }
    }

    fn act(&mut self, command: &PaddleCommand) {
        if command.is_valid() {
            let [x, y] = to_plane(command.displacement[0]);
            self.paddle = [0.99 * x, 0.99 * y];
        }
        self.tick += 1;
    }
}

fn in_c(inputs: &Inputs) -> StillpointInputs {
    let mut given = StillpointInputs { tick: inputs.tick, time_ns: inputs.time_ns, ..StillpointInputs::default() };
    if let Some(NeedleSample { sequence, reserved, time_ns, depth, velocity }) = inputs.needle {
        let (depth_lu, velocity_lu_per_s) = (depth, velocity);
        given.needle = StillpointNeedleSample { sequence, reserved, time_ns, depth_lu, velocity_lu_per_s };
        given.arrived |= STILLPOINT_NEEDLE_ARRIVED;
    }
    if let Some(TargetSample { sequence, flags, time_ns, displacement }) = inputs.target {
        given.target = StillpointTargetSample { sequence, flags, time_ns, displacement_lu: to_plane(displacement) };
        given.arrived |= STILLPOINT_TARGET_ARRIVED;
    }
    if let Some(PaddleSample { sequence, paddle_index, time_ns, displacement }) = inputs.paddles[0] {
        given.paddle =
            StillpointPaddleSample { sequence, paddle_index, time_ns, displacement_lu: to_plane(displacement) };
        given.arrived |= STILLPOINT_PADDLE_ARRIVED;
    }
    given
}

/// Displacements and faults of every command; equal in both languages.
fn commands(settings: &Settings, given: &StillpointSettings) -> Vec<([u64; 2], u64)> {
    let table = firmware::decode::<f64, 2, 1, 1>(table()).unwrap();
    let controller = Controller::new(&table, settings).unwrap();
    let mut state = State::new();
    let mut caller = Caller::new();
    assert_eq!(caller.load(caller::table()), Status::Ok);
    assert_eq!(caller.configure(given), Status::Ok);
    let mut run = Run::new();
    let step = |_| {
        let inputs = run.sense();
        let expected = controller.step(&mut state, &inputs);
        // SAFETY: a controller and structs.
        let status = unsafe { stillpoint_step(caller.controller, &in_c(&inputs), &mut caller.command) };
        assert_eq!(status, Status::Ok);
        let StillpointCommand { faults, displacement_lu, mode, flags, .. } = caller.command;
        let bits = displacement_lu.map(f64::to_bits);
        assert_eq!(
            (bits, faults),
            (to_plane(expected.displacement[0]).map(f64::to_bits), expected.faults),
            "{settings:?}"
        );
        assert_eq!((mode, flags), (expected.state, expected.flags));
        run.act(&expected);
        (bits, faults)
    };
    (0..8000).map(step).collect()
}

#[test]
fn every_setting_arrives() {
    const MS: u64 = 1_000_000;
    let (plain, given) = (Settings::new(MS, 20 * MS, 20 * MS), default_settings());
    let without = commands(&plain, &given);
    let stopping = (Faults::HOLDING | Faults::LATCHING).bits();
    let running = without.iter().filter(|(_, faults)| faults & stopping == 0).count();
    assert!(running > 6000, "only {running} ticks in RUN");
    for (name, settings, given) in [
        (
            "loop period",
            Settings { loop_period_ns: 2 * MS, ..plain },
            StillpointSettings { loop_period_ns: 2 * MS, ..given },
        ),
        (
            "target period",
            Settings { target_period_ns: 40 * MS, ..plain },
            StillpointSettings { target_period_ns: 40 * MS, ..given },
        ),
        (
            "target latency",
            Settings { target_latency_ns: 90 * MS, ..plain },
            StillpointSettings { target_latency_ns: 90 * MS, ..given },
        ),
        (
            "actuator delay",
            Settings { actuator_delay_ns: 5 * MS, ..plain },
            StillpointSettings { actuator_delay_ns: 5 * MS, ..given },
        ),
        ("noise", Settings { target_noise: 1e-3, ..plain }, StillpointSettings { target_noise_lu: 1e-3, ..given }),
        ("gain", Settings { loop_gain: Some(0.1), ..plain }, StillpointSettings { loop_gain: 0.1, ..given }),
        ("lambda", Settings { lambda_max: Some(2.0), ..plain }, StillpointSettings { lambda_max: 2.0, ..given }),
        (
            "following error",
            Settings { following_error: Some(1e-5), ..plain },
            StillpointSettings { following_error_lu: 1e-5, ..given },
        ),
        (
            "integral",
            Settings { feedback: Feedback::Integral, ..plain },
            StillpointSettings { feedback: STILLPOINT_FEEDBACK_INTEGRAL, ..given },
        ),
        (
            "harmonic",
            Settings { feedback: Feedback::Harmonic, ..plain },
            StillpointSettings { feedback: STILLPOINT_FEEDBACK_HARMONIC, ..given },
        ),
        (
            "direction",
            Settings { direction: Some(Direction::MinimumNorm), ..plain },
            StillpointSettings { direction: STILLPOINT_DIRECTION_MINIMUM_NORM, ..given },
        ),
        (
            "limit",
            Settings { position_limit: PositionLimit::Box, ..plain },
            StillpointSettings { position_limit: STILLPOINT_POSITION_LIMIT_BOX, ..given },
        ),
    ] {
        assert_ne!(commands(&settings, &given), without, "{name} changes nothing: the test tests nothing");
    }
}
