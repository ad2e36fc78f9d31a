use super::*;
use crate::geometry::{Implicit as _, box_of};
use crate::random::SplitMix64;
use nalgebra::{Rotation3, Vector3};
use std::collections::BTreeSet;

fn set(labels: &[u16]) -> BTreeSet<u16> {
    labels.iter().copied().collect()
}

/// An image of voxels whose middles fulfil a condition in world coordinates.
fn image(size: [usize; 3], to_world: Matrix4<f64>, inside: impl Fn(&Point<3>) -> bool) -> Labels {
    let mut labels = Labels { size, to_world, data: Vec::new(), names: BTreeMap::new() };
    for k in 0..size[2] {
        for j in 0..size[1] {
            for i in 0..size[0] {
                let x = labels.world([i, j, k].map(|i| i as f64));
                labels.data.push(u16::from(inside(&x)));
            }
        }
    }
    labels
}

/// Voxels of these sides, turned, with the world's origin in their middle.
fn turned(size: [usize; 3], steps: [f64; 3], turn: Rotation3<f64>) -> Matrix4<f64> {
    let axes = turn.matrix() * Matrix3::from_diagonal(&Vector3::from(steps));
    let middle = Vector3::from(size.map(|n| 0.5 * (n as f64 - 1.0))) + Vector3::new(0.2, -0.1, 0.3);
    let mut matrix = axes.to_homogeneous();
    matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&(-(axes * middle)));
    matrix
}

/// Volume of a body by counting points of a lattice.
fn volume(body: &LabelBody, step: f64) -> f64 {
    let (low, high) = body.bounds().unwrap();
    let counts = (high - low).map(|length| (length / step).ceil() as usize);
    let mut inside = 0;
    for k in 0..counts.z {
        for j in 0..counts.y {
            for i in 0..counts.x {
                let at = Point::<3>::new(i as f64, j as f64, k as f64).add_scalar(0.5) * step;
                inside += usize::from(body.level(&(low + at)) < 0.0);
            }
        }
    }
    inside as f64 * step.powi(3)
}

#[test]
fn a_ball_of_voxels_is_a_ball() {
    let cases = [
        ([27; 3], [1.0; 3], Rotation3::identity(), 10.0),
        ([27; 3], [2.0; 3], Rotation3::from_euler_angles(0.4, -0.3, 1.0), 20.0),
        ([41, 27, 17], [0.6, 1.0, 1.6], Rotation3::from_euler_angles(0.4, -0.3, 1.0), 10.0),
    ];
    for (size, steps, turn, radius) in cases {
        let labels = image(size, turned(size, steps, turn), |x| x.norm() <= radius);
        let voxels = labels.counts()[0].volume;
        for smoothing in [0.0, 0.7, 1.0, 2.0] {
            let body = LabelBody::new(&labels, &set(&[1]), smoothing).unwrap();
            let smooth = volume(&body, 0.04 * radius);
            let part = smooth / voxels - 1.0;
            assert!(part.abs() < 0.005, "{steps:?}, {smoothing}: {part}");
            // The level is about the distance, the gradient points outwards.
            let mut random = SplitMix64(3);
            let (mut worst, mut steep) = (0.0_f64, 0.0_f64);
            for _ in 0..3000 {
                let direction = Point::<3>::from_fn(|_, _| random.symmetric()).normalize();
                let x = direction * (radius * (0.7 + 0.6 * random.unit()));
                worst = worst.max((body.level(&x) - (x.norm() - radius)).abs());
                steep = steep.max((body.gradient(&x) - direction).norm());
            }
            let largest = steps[2].max(steps[0]);
            if smoothing == 0.7 {
                assert!(worst < 0.6 * largest && steep < 0.5, "{steps:?}, {smoothing}: {worst}, {steep}");
            }
        }
    }
}

#[test]
fn the_gradient_is_the_slope_of_the_level() {
    let size = [30, 20, 14];
    let to_world = turned(size, [1.0, 1.5, 2.2], Rotation3::from_euler_angles(0.2, 0.5, -0.9));
    let labels = image(size, to_world, |x| x.norm() < 8.0);
    let body = LabelBody::new(&labels, &set(&[1]), 0.7).unwrap();
    let mut random = SplitMix64(4);
    let mut checked = 0;
    for _ in 0..2000 {
        let x = Point::<3>::from_fn(|_, _| 40.0 * random.symmetric());
        let gradient = body.gradient(&x);
        for axis in 0..3 {
            let step = Point::<3>::from_fn(|i, _| if i == axis { 1e-5 } else { 0.0 });
            let (before, after) = (body.level(&(x - step)), body.level(&(x + step)));
            let (left, right) = ((body.level(&x) - before) / 1e-5, (after - body.level(&x)) / 1e-5);
            // Between two cells the slope jumps.
            if (left - right).abs() < 1e-4 {
                assert!((gradient[axis] - right).abs() < 1e-3, "{x}: {gradient}, {axis}: {right}");
                checked += 1;
            }
        }
    }
    assert!(checked > 5000, "{checked}");
    assert_eq!(body.level(&Point::<3>::new(f64::NAN, 0.0, 0.0)), f64::INFINITY);
}

#[test]
fn far_away_the_level_is_about_the_distance() {
    let labels = image([27; 3], turned([27; 3], [1.0; 3], Rotation3::identity()), |x| x.norm() <= 10.0);
    let body = LabelBody::new(&labels, &set(&[1]), 0.7).unwrap();
    for x in [[40.0, 0.0, 0.0], [0.0, -100.0, 0.0], [30.0, 30.0, 30.0]].map(Point::<3>::from) {
        let distance = x.norm() - 10.0;
        let level = body.level(&x);
        assert!(level > 0.6 * distance && level < 1.1 * distance, "{x}: {level}, not {distance}");
    }
}

/// A slab to the border of the image ends there: its sides are flat faces half a voxel beyond the last middles.
#[test]
fn a_body_ends_at_the_border_of_the_image() {
    let labels = image([12, 10, 8], Matrix4::identity(), |_| true);
    let body = LabelBody::new(&labels, &set(&[1]), 0.0).unwrap();
    for (x, level) in
        [([11.5, 5.0, 4.0], 0.0), ([5.0, 9.5, 4.0], 0.0), ([5.0, 5.0, -0.5], 0.0), ([5.0, 5.0, 0.5], -1.0)]
    {
        assert!((body.level(&x.into()) - level).abs() < 0.04, "{x:?}: {}", body.level(&x.into()));
    }
    let (low, high) = body.bounds().unwrap();
    assert!(low.x <= -0.5 && low.x >= -2.1 && high.y >= 9.5 && high.y < 11.1, "{low}, {high}");
    // Half a voxel beyond the last middles, and no more.
    let extent = body.extent().unwrap();
    let expected = (Point::<3>::repeat(-0.5), Point::<3>::new(11.5, 9.5, 7.5));
    assert!((extent.0 - expected.0).amax() < 0.04 && (extent.1 - expected.1).amax() < 0.04, "{extent:?}");
    let points: Vec<Point<3>> = vec![low, high];
    assert_eq!(box_of(&points), Some((low, high)));
}

#[test]
fn what_makes_no_body_is_refused() {
    let mut labels = image([9; 3], Matrix4::identity(), |x| (x.add_scalar(-4.0)).norm() < 3.0);
    let of =
        |labels: &Labels, wanted: &[u16], smoothing: f64| LabelBody::new(labels, &set(wanted), smoothing).map(drop);
    let absent = of(&labels, &[7], 0.7).unwrap_err();
    assert_eq!(absent, LabelError::Absent { wanted: vec![7], present: vec![1] });
    assert!(of(&labels, &[1], f64::NAN).is_err());
    assert_eq!(of(&labels, &[1], -1.0), Err(LabelError::Smoothing(-1.0)));
    let long = Labels { size: [1, 1, 300_000], data: vec![1; 300_000], ..labels.clone() };
    assert!(matches!(of(&long, &[1], 10.0), Err(LabelError::TooLarge { size: [87, 87, 300_086], .. })));
    labels.to_world[(0, 1)] = 0.2;
    assert!(matches!(of(&labels, &[1], 0.7), Err(LabelError::Sheared { axes: [0, 1], .. })));
    labels.to_world[(0, 1)] = 0.0;
    labels.data.pop();
    assert!(matches!(of(&labels, &[1], 0.7), Err(LabelError::Size { .. })));
}

/// Nearest marked places against all pairs.
#[test]
fn distances_are_those_to_the_nearest() {
    let mut random = SplitMix64(9);
    for steps in [[1.0, 1.0, 1.0], [0.5, 2.0, 3.0]] {
        let size = [9, 7, 6];
        let marked = transform::Lattice { size, data: (0..378).map(|_| random.unit() < 0.02).collect() };
        let found = transform::nearest(&marked, steps);
        let place = |i: usize| [i % 9, i / 9 % 7, i / 63];
        let away = |a: usize, b: usize| {
            let (a, b) = (place(a), place(b));
            (0..3).map(|i| ((a[i] as f64 - b[i] as f64) * steps[i]).powi(2)).sum::<f64>()
        };
        let all: Vec<usize> = (0..378).filter(|i| marked.data[*i]).collect();
        assert!(!all.is_empty());
        for (i, found) in found.into_iter().enumerate() {
            let least = all.iter().map(|j| away(i, *j)).fold(f64::INFINITY, f64::min);
            assert!((away(i, found as usize) - least).abs() < 1e-12);
        }
    }
}

#[test]
fn what_reaches_the_edge_of_an_image_is_known() {
    let ball = |x: &Point<3>| (x - Point::<3>::new(4.0, 4.0, 4.0)).norm() < 3.5;
    let whole = image([9, 9, 9], Matrix4::identity(), ball);
    let wanted = BTreeSet::from([1]);
    assert!(!whole.reaches_edge(&wanted));
    // Each of the six faces, and a label that is not wanted.
    for at in [[0, 4, 4], [8, 4, 4], [4, 0, 4], [4, 8, 4], [4, 4, 0], [4, 4, 8]] {
        for (label, reaches) in [(1, true), (2, false)] {
            let mut cut = whole.clone();
            cut.data[at[0] + 9 * (at[1] + 9 * at[2])] = label;
            assert_eq!(cut.reaches_edge(&wanted), reaches, "{at:?}");
        }
    }
}

#[test]
fn parts_are_what_hangs_together_by_faces() {
    // Two balls apart, a speck, and one voxel that touches it by an edge alone.
    let inside = |x: &Point<3>| {
        (x - Point::<3>::new(4.0, 4.0, 4.0)).norm() < 2.5 || (x - Point::<3>::new(11.0, 4.0, 4.0)).norm() < 1.5
    };
    let mut labels = image([16, 9, 9], Matrix4::identity(), inside);
    let voxels = |r: f64| {
        let near = |n: i32| (-n..=n).map(f64::from);
        near(3)
            .flat_map(|i| near(3).flat_map(move |j| near(3).map(move |k| i * i + j * j + k * k)))
            .filter(|d| *d < r * r)
            .count()
    };
    for (i, j, k) in [(0, 0, 0), (1, 1, 0), (15, 8, 8)] {
        labels.data[i + 16 * (j + 9 * k)] = 2;
    }
    assert_eq!(labels.parts(&set(&[1, 2])), [voxels(2.5), voxels(1.5), 1, 1, 1]);
    assert_eq!(labels.parts(&set(&[2])), [1, 1, 1]);
    assert_eq!(labels.parts(&set(&[3])), [0; 0]);
    // Voxels of label 2 in the corners of the image are beside what reaches its edge; one in the middle of a ball is shut off.
    assert_eq!(labels.cavities(&set(&[1])), [0; 0]);
    labels.data[4 + 16 * (4 + 9 * 4)] = 2;
    labels.data[11 + 16 * (4 + 9 * 4)] = 0;
    assert_eq!((labels.cavities(&set(&[1])), labels.cavities(&set(&[1, 2]))), (vec![1, 1], vec![1]));
}
