//! The controller's step.
#![allow(clippy::unwrap_used, clippy::indexing_slicing)]

use firmware::contract::{
    Gains, Knot, NeedleSample, Paddle, PaddleCommand, PaddleSample, Table, TargetSample, Units, Validity,
};
use firmware::{Controller, Faults, Feedback, Inputs, Mode, Settings, State};

/// A small valid table: needle down, depth 0 to 0.1.
pub(crate) fn table() -> Table<f64> {
    use nalgebra::{Matrix2, Vector2};
    let jacobian = Matrix2::new(0.30, 0.05, -0.04, 0.25);
    let n = Vector2::new(1.0, 0.0);
    let slope = -(jacobian.try_inverse().unwrap() * n) * 0.02;
    let knot = |i: u32| {
        let depth = 0.01 * f64::from(i);
        let axial = Vector2::new(0.0, -0.1 * depth);
        Knot {
            depth,
            jacobian: [jacobian],
            paddle_path: slope * depth,
            paddle_path_slope: slope,
            target_displacement: axial,
            target_displacement_slope: Vector2::new(0.0, -0.1),
            static_target_displacement: axial + n * 0.02 * depth,
        }
    };
    let knots: heapless::Vec<_, { firmware::contract::MAX_KNOTS }> = (0..=10).map(knot).collect();
    Table {
        scene_hash: [7; 32],
        units: Units { length: "1".try_into().unwrap(), stress: "1".try_into().unwrap() },
        tissue: "homogeneous".try_into().unwrap(),
        paddles: [Paddle { index: 3, extent: [n, n * 2.0], max_displacement: 0.05, max_rate: 0.1 }],
        needle_axis: Vector2::new(0.0, -1.0),
        orthogonal: n,
        target_position: Vector2::new(0.5, 0.5),
        validity: Validity {
            depth_start: knots[0].depth,
            depth_end: knots[10].depth,
            paddle_displacement: 0.05,
            needle_speed: 0.1,
        },
        gains: Gains { loop_gain: 0.25, delay_samples: 1, lambda_max: 1.0 },
        knots,
    }
}

/// Takes numbers off the front of the bytes; zeros at the end.
struct Source<'a>(&'a [u8]);

impl Source<'_> {
    fn u64(&mut self) -> u64 {
        let (taken, rest) = self.0.split_at(self.0.len().min(8));
        self.0 = rest;
        taken.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
    }

    /// Mostly plausible, sometimes any bits.
    fn f64(&mut self) -> f64 {
        let bits = self.u64();
        if bits & 3 == 0 { f64::from_bits(bits) } else { (bits >> 11) as f64 / (1u64 << 53) as f64 * 0.2 - 0.1 }
    }
}

/// Ticks with inputs of any bytes, from any state that they lead to: limits on every command, the mode follows from the
/// fault codes, SAFE is left by re-arming alone, rejected inputs change nothing, everything is accounted for.
pub(crate) fn step(bytes: &[u8]) {
    const MS: u64 = 1_000_000;
    let table = table();
    let feedback = [Feedback::Observer, Feedback::Integral, Feedback::Harmonic][bytes.len() % 3];
    let settings = Settings { feedback, ..Settings::new(MS, 20 * MS, 20 * MS) };
    let controller = Controller::new(&table, &settings).unwrap();
    let mut state = State::<f64>::new();
    let mut source = Source(bytes);
    let mut last: Option<PaddleCommand> = None;
    let mut position = [0.0; 3];
    for tick in 0..2000u64 {
        if source.0.is_empty() {
            break;
        }
        let choice = source.u64();
        let time_ns = tick * MS;
        let bits = |shift: u32| choice >> shift;
        // Healthy samples, and each of them spoilt in some way now and then.
        let mut needle = NeedleSample { sequence: tick as u32, reserved: 0, time_ns, depth: 0.02, velocity: 0.0 };
        let mut paddle = PaddleSample { sequence: tick as u32, paddle_index: 3, time_ns, displacement: position };
        let mut target = TargetSample { sequence: tick as u32, flags: 1, time_ns, displacement: [0.0; 3] };
        let mut inputs = Inputs { tick, time_ns, ..Inputs::default() };
        match choice & 15 {
            0 => (needle.depth, needle.velocity) = (source.f64(), source.f64()),
            1 => (needle.sequence, needle.time_ns) = (source.u64() as u32, source.u64()),
            2 => paddle.displacement = [source.f64(), source.f64(), source.f64()],
            3 => (paddle.sequence, paddle.paddle_index) = (source.u64() as u32, source.u64() as u32),
            4 => (target.flags, target.displacement) = (bits(8) as u32, [source.f64(), source.f64(), 0.0]),
            5 => (target.sequence, target.time_ns) = (source.u64() as u32, source.u64()),
            6 if bits(8) & 7 == 0 => inputs.time_ns = source.u64(),
            7 if bits(8) & 63 == 0 => inputs.tick = source.u64(),
            _ => target.displacement = [source.f64() * 1e-3, 0.0, 0.0],
        }
        inputs.needle = (bits(4) & 7 != 0).then_some(needle);
        inputs.paddles[0] = (bits(12) & 7 != 0).then_some(paddle);
        inputs.target = (bits(16) & 3 == 0).then_some(target);

        let before = state.clone();
        let command = controller.step(&mut state, &inputs);
        check(&before, &state, last.as_ref(), &command);
        if command.is_valid() {
            position = command.displacement[0];
        }
        last = Some(command);
        if state.mode() == Mode::Safe && bits(24) & 15 == 0 {
            state.rearm();
            // Re-arming adopts the measured position, which the limits do not bind to the last command.
            last = None;
        }
    }
}

fn check(before: &State<f64>, after: &State<f64>, last: Option<&PaddleCommand>, command: &PaddleCommand) {
    let [[x, y, z], second] = command.displacement;
    assert_eq!((z, second), (0.0, [0.0; 3]), "nothing out of the plane, and no second paddle");
    assert!(x.hypot(y) <= 0.05 * (1.0 + 1e-9), "position limit");
    let faults = Faults::from_bits(command.faults);
    let mode = Mode::from_wire(command.state).unwrap();
    let expected = if !faults.intersection(Faults::LATCHING).is_empty() {
        Mode::Safe
    } else if !faults.intersection(Faults::HOLDING).is_empty() {
        Mode::Hold
    } else {
        Mode::Run
    };
    assert_eq!(mode, expected, "the mode follows from the codes: {faults}");
    assert_eq!(after.ledger().unaccounted(), 0, "accounts");
    if let Some(last) = last {
        assert_eq!(command.sequence, last.sequence.wrapping_add(1), "one command per tick");
        assert!(last.state != Mode::Safe as u32 || mode == Mode::Safe, "SAFE is latched");
        // A command that is not valid is none.
        if last.is_valid() && command.is_valid() {
            let [[a, b, _], _] = last.displacement;
            assert!((x - a).hypot(y - b) <= 1e-4 * (1.0 + 1e-9), "rate limit");
            let moved = [x, y].map(f64::to_bits) != [a, b].map(f64::to_bits);
            assert!(!moved || mode == Mode::Run || faults.contains(Faults::DIVERGENCE), "HOLD and SAFE keep it");
        }
    }
    let consumed = after.ledger().target.consumed != before.ledger().target.consumed;
    let bits = |state: &State<f64>| state.integral().map(|integral| integral.map(|column| column.map(f64::to_bits)));
    if bits(before).is_some() && !consumed {
        assert_eq!(bits(before), bits(after), "no accepted sample, no change of the integral");
    }
}
