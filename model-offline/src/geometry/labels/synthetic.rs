//! A made-up segmentation, to try things on.

use super::Labels;
use nalgebra::{Matrix4, Vector4};
use std::collections::BTreeMap;

/// Side of a voxel in mm.
const VOXEL: f64 = 2.0;
/// Semi-axes of the body in mm; it is cut by the plane z = 0.
const BODY: [f64; 3] = [60.0, 60.0, 50.0];
/// Middle and radius of the tumours in mm.
const TUMOURS: [([f64; 3], f64); 2] = [([18.0, 8.0, 22.0], 8.0), ([-20.0, -12.0, 14.0], 5.0)];

/// Half of an ellipsoid of 60 × 60 × 50 mm semi-axes on the plane z = 0 as label 1, with two balls in it as labels 2
/// (radius 8 mm) and 3 (radius 5 mm); voxels of 2 mm. The same every time.
pub(crate) fn synthetic_breast() -> Labels {
    let size = [64, 64, 29];
    // Voxels on both sides of z = 0 have their common face there; two empty ones are around.
    let first = [-63.0, -63.0, -3.0];
    let mut to_world = Matrix4::from_diagonal(&Vector4::new(VOXEL, VOXEL, VOXEL, 1.0));
    (0..3).for_each(|axis| to_world[(axis, 3)] = first[axis]);
    let mut data = Vec::with_capacity(size.iter().product());
    for k in 0..size[2] {
        for j in 0..size[1] {
            for i in 0..size[0] {
                let at = [i, j, k].map(|i| i as f64);
                let x: [f64; 3] = std::array::from_fn(|axis| first[axis] + VOXEL * at[axis]);
                data.push(label(x));
            }
        }
    }
    let names = ["breast", "tumour 1", "tumour 2"];
    let names: BTreeMap<u16, String> = (1..).zip(names.map(str::to_owned)).collect();
    Labels { size, to_world, data, names }
}

fn label(x: [f64; 3]) -> u16 {
    let in_tumour = |(middle, radius): &([f64; 3], f64)| {
        (0..3).map(|axis| (x[axis] - middle[axis]).powi(2)).sum::<f64>() <= radius * radius
    };
    let in_body = x[2] > 0.0 && (0..3).map(|axis| (x[axis] / BODY[axis]).powi(2)).sum::<f64>() <= 1.0;
    match TUMOURS.iter().position(in_tumour) {
        Some(tumour) if in_body => tumour as u16 + 2,
        _ => u16::from(in_body),
    }
}
