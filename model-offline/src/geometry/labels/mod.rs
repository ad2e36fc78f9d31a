//! Segmented images: a label per voxel, from NIfTI-1 or NRRD, and the bodies that labels make.
//!
//! World coordinates are millimetres to the right, to the front and upwards (RAS), as NIfTI has them; NRRD files of
//! 3D Slicer go to the left and to the back (LPS) and are turned, so that the same segmentation is at the same place.

mod body;
mod error;
mod smooth;
#[cfg(test)]
mod synthetic;
mod transform;

pub use body::LabelBody;
pub use error::LabelError;
#[cfg(test)]
pub(crate) use synthetic::{synthetic_breast, synthetic_scan};

use crate::geometry::point::Point;
use nalgebra::{Matrix3, Matrix4};
use std::collections::{BTreeMap, BTreeSet};

/// So many voxels at most: 512 in every direction, 256 MiB.
pub const MOST_VOXELS: u64 = 1 << 27;

/// A label per voxel, and where voxels are.
#[derive(Debug, Clone, PartialEq)]
pub struct Labels {
    /// Number of voxels along each axis.
    pub size: [usize; 3],
    /// From indices of voxels, (0, 0, 0) the middle of the first one, to millimetres (RAS).
    pub to_world: Matrix4<f64>,
    /// Labels, the first axis fastest: voxel (i, j, k) is at `i + size[0] * (j + size[1] * k)`.
    pub data: Vec<u16>,
    /// Names of labels, where the file has them.
    pub names: BTreeMap<u16, String>,
}

/// How much there is of a label.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelCount {
    /// The label.
    pub label: u16,
    /// Its name, where the file has one.
    pub name: Option<String>,
    /// Number of voxels.
    pub voxels: usize,
    /// Their volume in mm³.
    pub volume: f64,
}

impl Labels {
    /// Volume of a voxel in mm³.
    pub fn voxel_volume(&self) -> f64 {
        self.axes().determinant().abs()
    }

    /// Steps of the three axes in mm, a column each.
    pub(crate) fn axes(&self) -> Matrix3<f64> {
        self.to_world.fixed_view::<3, 3>(0, 0).into_owned()
    }

    /// The label of a voxel; 0 beside the image.
    pub fn at(&self, voxel: [i64; 3]) -> u16 {
        let mut place = 0;
        for axis in [2, 1, 0] {
            match usize::try_from(voxel[axis]) {
                Ok(i) if i < self.size[axis] => place = place * self.size[axis] + i,
                _ => return 0,
            }
        }
        self.data.get(place).copied().unwrap_or(0)
    }

    /// Where the middle of a voxel is, in mm (RAS).
    pub fn world(&self, voxel: [f64; 3]) -> Point<3> {
        let [i, j, k] = voxel;
        (self.to_world * nalgebra::Vector4::new(i, j, k, 1.0)).xyz()
    }

    /// Every label but 0 with its voxels and its volume, in the order of their numbers.
    pub fn counts(&self) -> Vec<LabelCount> {
        let mut counts: BTreeMap<u16, usize> = BTreeMap::new();
        for same in self.data.chunk_by(|a, b| a == b) {
            *counts.entry(same[0]).or_default() += same.len();
        }
        counts.remove(&0);
        let volume = self.voxel_volume();
        let count = |(label, voxels): (u16, usize)| {
            let name = self.names.get(&label).cloned();
            LabelCount { label, name, voxels, volume: voxels as f64 * volume }
        };
        counts.into_iter().map(count).collect()
    }

    /// Whether a voxel of the labels `wanted` is an outermost one of the image, beyond which nobody knows what is there.
    pub fn reaches_edge(&self, wanted: &BTreeSet<u16>) -> bool {
        let [nx, ny, nz] = self.size;
        let is_last = |place: usize, count: usize| place == 0 || place + 1 == count;
        let is_outermost =
            |index: usize| is_last(index % nx, nx) || is_last(index / nx % ny, ny) || is_last(index / nx / ny, nz);
        self.data.iter().enumerate().any(|(index, label)| wanted.contains(label) && is_outermost(index))
    }

    /// Numbers of voxels of the separate parts of the labels `wanted`, the largest first: voxels of one part share faces.
    pub fn parts(&self, wanted: &BTreeSet<u16>) -> Vec<usize> {
        sorted(self.connected(&|label| wanted.contains(label)).into_iter().map(|part| part.voxels))
    }

    /// Numbers of voxels of the cavities in the labels `wanted`, the largest first: what they shut off from the edge of the image.
    pub fn cavities(&self, wanted: &BTreeSet<u16>) -> Vec<usize> {
        let others = self.connected(&|label| !wanted.contains(label));
        sorted(others.into_iter().filter(|part| !part.reaches_edge).map(|part| part.voxels))
    }

    /// The parts of the labels that `is` tells, in the order of their first voxels: voxels of one part share faces.
    fn connected(&self, is: &dyn Fn(&u16) -> bool) -> Vec<Connected> {
        let steps = [1, self.size[0], self.size[0] * self.size[1]];
        let mut left: Vec<bool> = self.data.iter().map(is).collect();
        let mut parts = Vec::new();
        let mut found = Vec::new();
        for first in 0..left.len() {
            if !std::mem::take(&mut left[first]) {
                continue;
            }
            found.push(first);
            let mut part = Connected::default();
            while let Some(place) = found.pop() {
                part.voxels += 1;
                for (axis, step) in steps.into_iter().enumerate() {
                    let along = place / step % self.size[axis];
                    let before = (along > 0).then(|| place - step);
                    let behind = (along + 1 < self.size[axis]).then(|| place + step);
                    part.reaches_edge |= before.is_none() || behind.is_none();
                    found.extend(before.into_iter().chain(behind).filter(|next| std::mem::take(&mut left[*next])));
                }
            }
            parts.push(part);
        }
        parts
    }
}

/// Voxels that share faces.
#[derive(Default)]
struct Connected {
    voxels: usize,
    /// Whether one of them is an outermost one of the image.
    reaches_edge: bool,
}

/// The largest first.
fn sorted(voxels: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut voxels: Vec<usize> = voxels.collect();
    voxels.sort_unstable_by(|a, b| b.cmp(a));
    voxels
}

#[cfg(test)]
mod tests;
