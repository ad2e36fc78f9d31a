//! Numbers that are finite and absurd, in samples and in tables.

use super::*;
use crate::contract::TableError;

#[test]
fn no_velocity_lets_the_depth_jump() {
    let table = table();
    for velocity in [1e300, -1e300, 1e3, f64::MAX, 1.01] {
        let mut closed = Loop::new(&table, &settings());
        closed.run(1000);
        let depth = closed.plant.depth;
        closed.tick(|inputs| {
            let needle = inputs.needle.as_mut().unwrap();
            (needle.depth, needle.velocity) = (0.09, velocity);
        });
        assert_eq!(closed.state.ledger().needle.discarded.iter().sum::<u64>(), 1, "velocity {velocity}");
        closed.tick(|inputs| inputs.needle.as_mut().unwrap().depth = 0.09);
        assert_eq!(closed.state.ledger().needle.discarded.iter().sum::<u64>(), 2, "velocity {velocity}");
        assert!(depth < 0.05);
    }
}

proptest! {
    /// Whatever one sample says: the accepted depth moves no further than ten times the limit of speed explains.
    #[test]
    fn one_sample_moves_the_depth_by_little(depth in 0.0..0.1f64, velocity: f64) {
        let table = table();
        let mut closed = Loop::new(&table, &settings());
        closed.run(1000);
        let before = closed.plant.depth;
        let consumed = closed.state.ledger().needle.consumed;
        closed.tick(|inputs| {
            let needle = inputs.needle.as_mut().unwrap();
            (needle.depth, needle.velocity) = (depth, velocity);
        });
        let accepted = closed.state.ledger().needle.consumed > consumed;
        prop_assert!(!accepted || (depth - before).abs() <= 0.04 * DEPTH);
    }
}

#[test]
fn no_huge_number_passes_in_a_table() {
    type Change = fn(&mut Table<f64>, f64);
    let changes: [(&str, Change); 17] = [
        ("rate", |t, x| t.paddles[0].max_rate = x),
        ("needle speed", |t, x| t.validity.needle_speed = x),
        ("paddle range", |t, x| (t.paddles[0].max_displacement, t.validity.paddle_displacement) = (x, x)),
        ("valid range", |t, x| t.validity.paddle_displacement = x),
        ("segment start", |t, x| t.paddles[0].extent[0].x = x),
        ("segment end", |t, x| t.paddles[0].extent[1].y = -x),
        ("target position", |t, x| t.target_position.y = x),
        ("depth end", |t, x| (t.validity.depth_end, t.knots[10].depth) = (x, x)),
        ("depth start", |t, x| (t.validity.depth_start, t.knots[0].depth) = (-x, -x)),
        ("Jacobian", |t, x| t.knots[4].jacobian[0] *= x),
        ("path slope", |t, x| t.knots[0].paddle_path_slope.x = x),
        ("last path slope", |t, x| t.knots[10].paddle_path_slope.y = -x),
        ("target", |t, x| t.knots[5].target_displacement.x = x),
        ("target slope", |t, x| t.knots[5].target_displacement_slope.y = x),
        ("static target", |t, x| t.knots[5].static_target_displacement.x = -x),
        ("path", |t, x| t.knots[5].paddle_path.x = x),
        ("lambda", |t, x| t.gains.lambda_max = x),
    ];
    for (name, change) in changes {
        for huge in [1e300, 1e150, f64::MAX, 1e20, 1e6] {
            let mut table = table();
            change(&mut table, huge);
            // The margin of the gain is a setting, too, and checked as one.
            let refused = table.validate().is_err() || Controller::new(&table, &settings()).is_err();
            assert!(refused, "{name} = {huge}");
        }
    }
}

#[test]
fn proportions_are_refused_at_their_limits() {
    let refused = |change: fn(&mut Table<f64>)| {
        let mut table = table();
        change(&mut table);
        table.validate()
    };
    let field = |field| Err(TableError::Implausible { field });
    // 100 crossings per second; the paddle's range is 0.05, the table's depth 0.1.
    assert_eq!(refused(|t| t.paddles[0].max_rate = 4.99), Ok(()));
    assert_eq!(refused(|t| t.paddles[0].max_rate = 5.01), field(Field::PaddleRateLimit));
    assert_eq!(refused(|t| t.validity.needle_speed = 9.99), Ok(()));
    assert_eq!(refused(|t| t.validity.needle_speed = 10.01), field(Field::NeedleSpeedLimit));
    // A slope of 33.75 over an interval of 0.01 lifts the path by 0.05.
    assert_eq!(refused(|t| t.knots[3].paddle_path_slope = Vector2::new(33.7, 0.0)), Ok(()));
    assert_eq!(refused(|t| t.knots[3].paddle_path_slope = Vector2::new(33.8, 0.0)), field(Field::PaddlePathSlope));
    assert_eq!(refused(|t| t.knots[3].target_displacement_slope = Vector2::new(0.0, 2.99)), Ok(()));
    let steep = refused(|t| t.knots[3].target_displacement_slope = Vector2::new(0.0, 3.01));
    assert_eq!(steep, field(Field::TargetDisplacementSlope));
    // ‖J‖ = 0.396.
    assert_eq!(refused(|t| t.knots[3].jacobian[0] *= 252.0), Ok(()));
    assert_eq!(refused(|t| t.knots[3].jacobian[0] *= 253.0), field(Field::KnotJacobian));
    // From (0.5, 0.5) to (0.1, 0.4) it is 0.412: ten times that and the depth are 5.12.
    assert_eq!(refused(|t| t.validity.paddle_displacement = 5.12), Ok(()));
    assert_eq!(refused(|t| t.validity.paddle_displacement = 5.13), field(Field::ValidPaddleDisplacement));
    // A depth is a difference: where it is counted from does not matter.
    let deeper = |t: &mut Table<f64>| {
        t.knots.iter_mut().for_each(|knot| knot.depth += 1000.0);
        (t.validity.depth_start, t.validity.depth_end) = (1000.0, 1000.1);
        let last = t.knots.len() - 1;
        t.knots[last].depth = 1000.1;
    };
    assert_eq!(refused(deeper), Ok(()));
    let far = |t: &mut Table<f64>| t.target_position.x = 100.3;
    assert_eq!(refused(far), field(Field::DistanceFromPaddleToTarget));
    let near = |t: &mut Table<f64>| t.paddles[0].extent = [t.target_position.add_scalar(5e-5); 2];
    assert_eq!(refused(near), field(Field::DepthRange));
}
