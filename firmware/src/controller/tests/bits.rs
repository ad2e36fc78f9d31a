//! The plane as it has always been: every bit of every command of closed loops, as a hash.

use super::*;

/// FNV-1a over words.
fn hashed(hash: u64, word: u64) -> u64 {
    word.to_le_bytes().into_iter().fold(hash, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Commands of a loop of 4 s whose tissue is not the table's, whose target is lost for a while, and whose paddle
/// saturates at the end.
fn commands(table: &Table<f64>, settings: &Settings) -> u64 {
    let mut control = Loop::new(table, settings);
    control.plant.offset = 0.001;
    control.plant.push = 0.03;
    let mut hash = 0xcbf2_9ce4_8422_2325;
    for tick in 0..4000 {
        control.plant.offset += if tick > 2500 { 1e-5 } else { 0.0 };
        let command = control.tick(|inputs| {
            if (1200..1260).contains(&tick) {
                inputs.target = None;
            }
        });
        let [x, y] = to_plane(command.displacement[0]);
        for word in [x.to_bits(), y.to_bits(), command.faults, u64::from(command.state)] {
            hash = hashed(hash, word);
        }
    }
    hash
}

/// Written by the controller that knew the plane and one paddle only (24 November 2026), before it learnt of space.
#[test]
fn the_plane_is_what_it_was_bit_by_bit() {
    use crate::{Direction, Feedback, PositionLimit};
    let table = table();
    let written = [
        (Feedback::Integral, Direction::Inverse, PositionLimit::Norm, 0x3eb7_ac72_9de9_2796),
        (Feedback::Integral, Direction::Inverse, PositionLimit::Box, 0x735b_d6be_e49c_95cd),
        (Feedback::Integral, Direction::MinimumNorm, PositionLimit::Norm, 0x3ea0_1ee1_656d_063e),
        (Feedback::Integral, Direction::MinimumNorm, PositionLimit::Box, 0xe9ce_2411_b89a_b5e7),
        (Feedback::Observer, Direction::Inverse, PositionLimit::Norm, 0x460a_7437_8022_a021),
        (Feedback::Observer, Direction::Inverse, PositionLimit::Box, 0xb712_101b_0b33_6913),
        (Feedback::Observer, Direction::MinimumNorm, PositionLimit::Norm, 0x8a73_471d_7c6f_fdea),
        (Feedback::Observer, Direction::MinimumNorm, PositionLimit::Box, 0xb284_24d6_7d14_a1e5),
        // No breath is seen in so short a time: what it is before one, the observer is.
        (Feedback::Harmonic, Direction::Inverse, PositionLimit::Norm, 0x460a_7437_8022_a021),
    ];
    for (feedback, direction, position_limit, hash) in written {
        let chosen =
            Settings { feedback, direction: Some(direction), position_limit, target_noise: 1e-5, ..settings() };
        assert_eq!(commands(&table, &chosen), hash, "{feedback:?} {direction:?} {position_limit:?}");
    }
}
