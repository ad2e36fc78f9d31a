//! Values that stay: healthy coarse sensors apart from dead ones, needle and speed against each other.

use super::*;
use crate::detection::NEEDLE_CONTRADICTION_TRAVEL;

/// Rounded to steps of `step`.
fn rounded(value: f64, step: f64) -> f64 {
    (value / step).round() * step
}

#[test]
fn a_coarse_healthy_target_is_not_frozen() {
    let table = table();
    for step in [0.02 * DEPTH, 0.005 * DEPTH, 1e-6 * DEPTH] {
        for speed in [0.02, 0.002, 0.0005] {
            // Rounding to steps is noise of this deviation.
            let target_noise = step / 12f64.sqrt();
            let mut closed = Loop::new(&table, &Settings { target_noise, ..settings() });
            closed.plant.speed = speed;
            for _ in 0..6000 {
                closed.tick(|inputs| {
                    if let Some(target) = &mut inputs.target {
                        target.displacement = target.displacement.map(|value| rounded(value, step));
                    }
                });
            }
            let faults = closed.state.faults();
            let frozen = closed.state.ledger().target.discarded_for(Discard::Frozen);
            assert_eq!((closed.state.mode(), frozen), (Mode::Run, 0), "step {step} speed {speed}: {faults}");
        }
    }
}

#[test]
fn an_encoder_that_trembles_at_rest_does_not_travel() {
    let table = table();
    let mut closed = Loop::new(&table, &settings());
    closed.plant.speed = 0.0;
    closed.plant.depth = 0.05;
    for tick in 0..5000 {
        closed.tick(|inputs| {
            let needle = inputs.needle.as_mut().unwrap();
            let sign = if tick % 2 == 0 { 1.0 } else { -1.0 };
            needle.depth += sign * 0.001 * DEPTH;
            if let Some(target) = &mut inputs.target {
                target.displacement = [0.0, -0.005, 0.0];
            }
        });
    }
    assert_eq!(closed.state.mode(), Mode::Run, "{}", closed.state.faults());
    assert_eq!(closed.state.ledger().target.discarded_for(Discard::Frozen), 0);
}

#[test]
fn depth_and_velocity_are_checked_against_each_other() {
    let table = table();
    // Frozen depth; velocity stuck at zero, at another value, or with the wrong sign.
    for (depth_moves, factor) in [(false, 1.0), (true, 0.0), (true, 2.5), (true, -1.0)] {
        let mut closed = Loop::new(&table, &settings());
        closed.run(1000);
        let (stopped, refused) = (closed.plant.depth, closed.state.ledger().needle.discarded_for(Discard::Frozen));
        let travel = |plant: &Plant| plant.depth - stopped;
        while closed.state.ledger().needle.discarded_for(Discard::Frozen) == refused {
            closed.tick(|inputs| {
                let needle = inputs.needle.as_mut().unwrap();
                if !depth_moves {
                    needle.depth = stopped;
                }
                needle.velocity *= factor;
            });
            assert!(travel(&closed.plant) <= NEEDLE_CONTRADICTION_TRAVEL * DEPTH, "velocity × {factor}");
        }
    }
}

proptest! {
    /// Healthy needles: any speed profile within the limits of a drive, encoders and velocities with noise, gaps.
    #[test]
    fn a_healthy_needle_is_never_refused(
        profile in prop::collection::vec((-0.1..0.1f64, 1..300u32), 1..12),
        calibration in 0.9..1.1f64,
        resolution in prop_oneof![Just(1e-9), Just(1e-5), Just(2e-4)],
        gaps in any::<bool>(),
    ) {
        let table = table();
        let controller = Controller::new(&table, &settings()).unwrap();
        let mut state = State::<f64>::new();
        let (mut depth, mut velocity, mut tick) = (0.05, 0.0, 0u64);
        for (goal, ticks) in profile {
            for _ in 0..ticks {
                let before = velocity;
                // A drive brakes before its ends: nothing stops within a tick.
                let way = 0.5 * velocity * f64::abs(velocity) + 2e-3 * velocity.signum();
                let goal = if (0.0..=0.1).contains(&(depth + way)) { goal } else { 0.0 };
                velocity += (goal - velocity).clamp(-1e-3, 1e-3);
                depth += 0.5e-3 * (before + velocity);
                let needle = NeedleSample {
                    sequence: tick as u32,
                    reserved: 0,
                    time_ns: tick * MS,
                    depth: rounded(depth, resolution),
                    velocity: calibration * velocity,
                };
                let missing = gaps && tick % 97 < 40;
                let inputs =
                    Inputs { tick, time_ns: tick * MS, needle: (!missing).then_some(needle), ..Inputs::default() };
                controller.step(&mut state, &inputs);
                tick += 1;
            }
        }
        let refused: u64 = state.ledger().needle.discarded.iter().sum();
        prop_assert_eq!(refused, 0);
    }
}
