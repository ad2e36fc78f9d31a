//! Made-up segmentations, to try things on.

use super::Labels;
use nalgebra::{Matrix4, Vector4};
use std::collections::BTreeMap;

/// Side of a voxel in mm.
const VOXEL: f64 = 2.0;

/// Half of an ellipsoid on the plane z = 0 as label 1, with two balls in it as labels 2 and 3, in mm.
struct Phantom {
    semi_axes: [f64; 3],
    /// Middle and radius.
    balls: [([f64; 3], f64); 2],
    /// Voxels, two of them empty around.
    size: [usize; 3],
    names: [&'static str; 3],
}

/// Half of an ellipsoid of 60 × 60 × 50 mm semi-axes with balls of radius 8 and 5 mm; the same every time.
pub(crate) fn synthetic_breast() -> Labels {
    let balls = [([18.0, 8.0, 22.0], 8.0), ([-20.0, -12.0, 14.0], 5.0)];
    let names = ["breast", "tumour 1", "tumour 2"];
    Phantom { semi_axes: [60.0, 60.0, 50.0], balls, size: [64, 64, 29], names }.labels()
}

/// What the bundled scene `scan` has: a breast as it hangs from a patient who lies face down, 35 × 35 × 60 mm of semi-axes, with the
/// lesion that is to be hit and a smaller one; the same every time.
pub(crate) fn synthetic_scan() -> Labels {
    let balls = [([0.0, 0.0, 38.0], 8.0), ([12.0, 10.0, 18.0], 6.0)];
    let names = ["breast", "lesion", "cyst"];
    Phantom { semi_axes: [35.0, 35.0, 60.0], balls, size: [40, 40, 34], names }.labels()
}

impl Phantom {
    fn labels(&self) -> Labels {
        // Voxels on both sides of z = 0 have their common face there.
        let middle = |voxels: usize| -0.5 * VOXEL * (voxels as f64 - 1.0);
        let first = [middle(self.size[0]), middle(self.size[1]), -1.5 * VOXEL];
        let mut to_world = Matrix4::from_diagonal(&Vector4::new(VOXEL, VOXEL, VOXEL, 1.0));
        (0..3).for_each(|axis| to_world[(axis, 3)] = first[axis]);
        let mut data = Vec::with_capacity(self.size.iter().product());
        for k in 0..self.size[2] {
            for j in 0..self.size[1] {
                for i in 0..self.size[0] {
                    let at = [i, j, k].map(|i| i as f64);
                    data.push(self.label(std::array::from_fn(|axis| first[axis] + VOXEL * at[axis])));
                }
            }
        }
        let names: BTreeMap<u16, String> = (1..).zip(self.names.map(str::to_owned)).collect();
        Labels { size: self.size, to_world, data, names }
    }

    fn label(&self, x: [f64; 3]) -> u16 {
        let in_ball = |(middle, radius): &([f64; 3], f64)| {
            (0..3).map(|axis| (x[axis] - middle[axis]).powi(2)).sum::<f64>() <= radius * radius
        };
        let in_body = x[2] > 0.0 && (0..3).map(|axis| (x[axis] / self.semi_axes[axis]).powi(2)).sum::<f64>() <= 1.0;
        match self.balls.iter().position(in_ball) {
            Some(ball) if in_body => ball as u16 + 2,
            _ => u16::from(in_body),
        }
    }
}
