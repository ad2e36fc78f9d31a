//! A small table for tests.

use nalgebra::{Matrix2, Vector2};

use super::{Gains, Knot, Paddle, Table, Units, Validity};

/// Jacobian of [`table`]: well-conditioned and not symmetric.
pub(crate) fn jacobian() -> Matrix2<f64> {
    Matrix2::new(0.30, 0.05, -0.04, 0.25)
}

/// Needle down, depth 0 to 0.1, the target pushed sideways by 0.02 per unit of depth without the paddle.
pub(crate) fn table() -> Table<f64> {
    let n = Vector2::new(1.0, 0.0);
    let inverse = jacobian().try_inverse().unwrap();
    let knots = (0..=10)
        .map(|i| {
            let depth = 0.1 * f64::from(i) / 10.0;
            let slope = -(inverse * n) * 0.02;
            let axial = Vector2::new(0.0, -0.1 * depth);
            Knot {
                depth,
                jacobian: [jacobian()],
                paddle_path: slope * depth,
                paddle_path_slope: slope,
                target_displacement: axial,
                target_displacement_slope: Vector2::new(0.0, -0.1),
                static_target_displacement: axial + n * 0.02 * depth,
            }
        })
        .collect();
    Table {
        scene_hash: [7; 32],
        units: Units { length: "1".try_into().unwrap(), stress: "1".try_into().unwrap() },
        tissue: "homogeneous".try_into().unwrap(),
        paddles: [Paddle {
            index: 3,
            extent: [Vector2::new(0.2, 0.3), Vector2::new(0.1, 0.4)],
            max_displacement: 0.05,
            max_rate: 0.1,
        }],
        needle_axis: Vector2::new(0.0, -1.0),
        orthogonal: n,
        target_position: Vector2::new(0.5, 0.5),
        validity: Validity { depth_start: 0.0, depth_end: 0.1, paddle_displacement: 0.05, needle_speed: 0.1 },
        gains: Gains { loop_gain: 0.25, delay_samples: 1, lambda_max: 1.0 },
        knots,
    }
}
