//! Bodies of labelled voxels, with a smooth boundary.
//!
//! Voxels are stairs. The level is made of exact distances from every voxel to the nearest one inside and outside,
//! smoothed by a Gaussian, moved by the constant that keeps the volume of the voxels, and interpolated linearly in
//! between.

use super::smooth::{reach, smooth};
use super::transform::{Lattice, nearest};
use super::{LabelError, Labels, MOST_VOXELS};
use crate::geometry::implicit::{Implicit, Sheet};
use crate::geometry::point::{Point, box_of};
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeSet;

/// Axes may be so far from right angles, as the cosine between them: single precision and rounded headers.
const SKEW: f64 = 1e-3;
/// Voxels around the body beside what smoothing needs.
const MARGIN: usize = 3;
/// The widest smoothing, in voxels.
const WIDEST: f64 = 10.0;

/// A body that is where labels are.
#[derive(Debug, Clone)]
pub struct LabelBody {
    /// Distances in mm at voxels of a box around the body, negative inside.
    levels: Lattice<f32>,
    /// From millimetres to indices of the box.
    to_box: Matrix3<f64>,
    /// Where voxel (0, 0, 0) of the box is.
    origin: Point<3>,
    axes: Matrix3<f64>,
    bounds: (Point<3>, Point<3>),
    extent: (Point<3>, Point<3>),
    moved: f64,
}

impl LabelBody {
    /// The body of the labels `wanted`, its boundary smoothed by a Gaussian whose standard deviation is `smoothing`
    /// voxels (0.7 takes the stairs away and leaves what is two voxels thick; 0 leaves the stairs).
    ///
    /// # Errors
    /// [`LabelError`] says what is wrong with the labels, the axes or the smoothing.
    pub fn new(labels: &Labels, wanted: &BTreeSet<u16>, smoothing: f64) -> Result<Self, LabelError> {
        if !(0.0..=WIDEST).contains(&smoothing) {
            return Err(LabelError::Smoothing(smoothing));
        }
        let voxels = labels.size.iter().try_fold(1_usize, |all, size| all.checked_mul(*size));
        if voxels != Some(labels.data.len()) {
            return Err(LabelError::Size { found: labels.data.len(), size: labels.size });
        }
        let axes = labels.axes();
        right_angles(&axes)?;
        let (low, high) = extent(labels, wanted)?;
        let margin = MARGIN + reach(smoothing);
        let first: [i64; 3] = std::array::from_fn(|axis| low[axis] as i64 - margin as i64);
        let size: [usize; 3] = std::array::from_fn(|axis| high[axis] - low[axis] + 1 + 2 * margin);
        // An image one voxel thick and very long is small, and its margin is not.
        let all = size.iter().try_fold(1_u64, |all, size| all.checked_mul(*size as u64));
        if all.is_none_or(|all| all > MOST_VOXELS) {
            return Err(LabelError::TooLarge { wanted: wanted.iter().copied().collect(), size, most: MOST_VOXELS });
        }
        let is_inside = Lattice::of(size, |place| {
            wanted.contains(&labels.at(std::array::from_fn(|axis| first[axis] + place[axis] as i64)))
        });
        let steps: [f64; 3] = std::array::from_fn(|axis| axes.column(axis).norm());
        let mut levels = distances(&is_inside, steps);
        smooth(&mut levels, smoothing);
        let inside = is_inside.data.iter().filter(|inside| **inside).count();
        let moved = keep_volume(&mut levels, inside as f64, steps);
        let (Some(to_box), Some(at)) = (axes.try_inverse(), within(&levels)) else {
            return Err(LabelError::Vanished { wanted: wanted.iter().copied().collect(), smoothing });
        };
        let origin = labels.world(first.map(|i| i as f64));
        let corner = |i: usize| {
            let index = Vector3::from_fn(|axis, _| if i >> axis & 1 == 0 { at.0[axis] } else { at.1[axis] });
            origin + axes * index
        };
        let corners: Vec<Point<3>> = (0..8).map(corner).collect();
        let bounds = box_of(&corners).unwrap_or((origin, origin));
        let surface: Vec<Point<3>> = crossings(&levels).map(|index| origin + axes * index).collect();
        let extent = box_of(&surface).unwrap_or(bounds);
        Ok(Self { levels, to_box, origin, axes, bounds, extent, moved })
    }

    /// How far the boundary was moved outwards to keep the volume of the voxels, in mm.
    pub fn moved(&self) -> f64 {
        self.moved
    }

    /// Level and its derivative by the indices of the box, for indices within it.
    fn interpolated(&self, at: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let size = self.levels.size;
        let cell: [usize; 3] = std::array::from_fn(|axis| (at[axis].floor() as usize).min(size[axis] - 2));
        let part = Vector3::from_fn(|axis, _| at[axis] - cell[axis] as f64);
        let (mut level, mut slope) = (0.0, Vector3::zeros());
        for corner in 0..8 {
            let high: [usize; 3] = std::array::from_fn(|axis| corner >> axis & 1);
            let weight: [f64; 3] = std::array::from_fn(|i| if high[i] == 1 { part[i] } else { 1.0 - part[i] });
            let place = std::array::from_fn(|axis| cell[axis] + high[axis]);
            let value = f64::from(self.levels.data[self.levels.index(place)]);
            level += value * weight.iter().product::<f64>();
            for axis in 0..3 {
                let others: f64 = (0..3).filter(|other| *other != axis).map(|other| weight[other]).product();
                slope[axis] += value * others * if high[axis] == 1 { 1.0 } else { -1.0 };
            }
        }
        (level, slope)
    }

    /// Indices of the nearest point of the box, and how far beyond them those of a point are.
    fn place(&self, x: &Point<3>) -> (Vector3<f64>, Vector3<f64>) {
        let at = self.to_box * (x - self.origin);
        let within = Vector3::from_fn(|axis, _| at[axis].clamp(0.0, (self.levels.size[axis] - 1) as f64));
        (within, at - within)
    }
}

impl Implicit for LabelBody {
    /// About the distance to the boundary in mm, negative inside. Beyond the box around the body the distance to the
    /// box and the level there are added as legs of a right triangle.
    fn level(&self, x: &Point<3>) -> f64 {
        if !x.iter().all(|c| c.is_finite()) {
            return f64::INFINITY;
        }
        let (at, beyond) = self.place(x);
        let level = self.interpolated(&at).0;
        if beyond == Vector3::zeros() { level } else { level.max(0.0).hypot((self.axes * beyond).norm()) }
    }

    fn gradient(&self, x: &Point<3>) -> Point<3> {
        if !x.iter().all(|c| c.is_finite()) {
            return Point::<3>::zeros();
        }
        let (at, beyond) = self.place(x);
        let (level, mut slope) = self.interpolated(&at);
        if beyond == Vector3::zeros() {
            return self.to_box.tr_mul(&slope);
        }
        // Along axes where the point is beyond the box, the level there is that of the side.
        (0..3).filter(|axis| beyond[*axis] != 0.0).for_each(|axis| slope[axis] = 0.0);
        let (level, beyond) = (level.max(0.0), self.axes * beyond);
        (self.to_box.tr_mul(&slope) * level + beyond) / level.hypot(beyond.norm())
    }

    fn bounds(&self) -> Option<(Point<3>, Point<3>)> {
        Some(self.bounds)
    }

    fn extent(&self) -> Option<(Point<3>, Point<3>)> {
        Some(self.extent)
    }

    fn sheets(&self) -> Vec<Sheet<'_>> {
        vec![Sheet::Smooth(self)]
    }

    fn is_measured(&self) -> bool {
        true
    }
}

/// Distances along axes are distances in space only where axes are at right angles.
fn right_angles(axes: &Matrix3<f64>) -> Result<(), LabelError> {
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        let (u, v) = (axes.column(a).normalize(), axes.column(b).normalize());
        let cosine = u.dot(&v);
        if cosine.is_nan() || cosine.abs() > SKEW {
            return Err(LabelError::Sheared { axes: [a, b], angle: cosine.acos().to_degrees() });
        }
    }
    Ok(())
}

/// Lowest and highest voxel with one of the labels.
fn extent(labels: &Labels, wanted: &BTreeSet<u16>) -> Result<([usize; 3], [usize; 3]), LabelError> {
    let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
    for (row, line) in labels.data.chunks(labels.size[0].max(1)).enumerate() {
        let is = |label: &u16| wanted.contains(label);
        let (Some(first), Some(last)) = (line.iter().position(is), line.iter().rposition(is)) else { continue };
        let (j, k) = (row % labels.size[1], row / labels.size[1]);
        low = [low[0].min(first), low[1].min(j), low[2].min(k)];
        high = [high[0].max(last), high[1].max(j), high[2].max(k)];
    }
    if low[0] == usize::MAX {
        let present = labels.counts().iter().map(|count| count.label).take(20).collect();
        return Err(LabelError::Absent { wanted: wanted.iter().copied().collect(), present });
    }
    Ok((low, high))
}

/// Distance from the middle of every voxel to the boundary between voxels, negative inside.
fn distances(is_inside: &Lattice<bool>, steps: [f64; 3]) -> Lattice<f32> {
    let size = is_inside.size;
    let to_inside = nearest(is_inside, steps);
    let outside = Lattice { size, data: is_inside.data.iter().map(|inside| !inside).collect() };
    let to_outside = nearest(&outside, steps);
    let place = |index: usize| [index % size[0], index / size[0] % size[1], index / size[0] / size[1]];
    let distance = |(index, inside): (usize, &bool)| {
        let (found, sign) = if *inside { (to_outside[index], -1.0) } else { (to_inside[index], 1.0) };
        let (from, to) = (place(index), place(found as usize));
        let way: [f64; 3] = std::array::from_fn(|axis| (to[axis] as f64 - from[axis] as f64) * steps[axis]);
        let length = way.iter().map(|x| x * x).sum::<f64>().sqrt();
        // The boundary is half of a layer of voxels nearer than the middle of the nearest voxel of the other side:
        // along an axis half a voxel, between axes less, as layers are nearer to each other there.
        let layer = length / (0..3).map(|axis| way[axis].abs() / steps[axis]).sum::<f64>();
        (sign * (length - 0.5 * layer)) as f32
    };
    Lattice { size, data: is_inside.data.iter().enumerate().map(distance).collect() }
}

/// Moves all levels by one constant, so that as much is inside as before smoothing, in voxels. Says how far outwards.
fn keep_volume(levels: &mut Lattice<f32>, inside: f64, steps: [f64; 3]) -> f64 {
    let step = steps.iter().product::<f64>().cbrt();
    let (deep, near) = samples(levels, 3.0 * step);
    // What of an eighth of a voxel is inside of a plane at this distance, its normal along an axis.
    let part = |level: f32, by: f64| 0.125 * (0.5 - (f64::from(level) - by) / (0.5 * step)).clamp(0.0, 1.0);
    let (mut low, mut high) = (-2.0 * step, 2.0 * step);
    for _ in 0..40 {
        let by = 0.5 * (low + high);
        let volume = deep + near.iter().map(|level| part(*level, by)).sum::<f64>();
        if volume < inside { low = by } else { high = by }
    }
    let by = 0.5 * (low + high);
    levels.data.iter_mut().for_each(|level| *level -= by as f32);
    by
}

/// How many cells between voxels are deeper inside than `reach`, and levels in the middles of the eighths of all cells
/// that are nearer to the boundary: what is interpolated between voxels counts, and not voxels alone.
fn samples(levels: &Lattice<f32>, reach: f64) -> (f64, Vec<f32>) {
    let (mut deep, mut near) = (0.0, Vec::new());
    let [x, y, z] = levels.size.map(|n| n.saturating_sub(1));
    for (k, j, i) in (0..z).flat_map(|k| (0..y).flat_map(move |j| (0..x).map(move |i| (k, j, i)))) {
        let mut cell: [f32; 8] =
            std::array::from_fn(|c| levels.data[levels.index([i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)])]);
        if cell.iter().all(|level| f64::from(*level) < -reach) {
            deep += 1.0;
        } else if cell.iter().any(|level| f64::from(level.abs()) <= reach) {
            for axis in 0..3 {
                for low in (0..8).filter(|c| c >> axis & 1 == 0) {
                    let (a, b) = (cell[low], cell[low | 1 << axis]);
                    (cell[low], cell[low | 1 << axis]) = (0.75 * a + 0.25 * b, 0.25 * a + 0.75 * b);
                }
            }
            near.extend(cell);
        }
    }
    (deep, near)
}

/// Indices of where levels vanish between neighbours: the surface is farthest out along an axis on such a line, because levels in
/// between are linear in each index.
fn crossings(levels: &Lattice<f32>) -> impl Iterator<Item = Vector3<f64>> {
    let size = levels.size;
    let steps = [1, size[0], size[0] * size[1]];
    let place = move |index: usize| [index % size[0], index / size[0] % size[1], index / size[0] / size[1]];
    levels.data.iter().enumerate().flat_map(move |(index, level)| {
        let at = place(index);
        (0..3).filter_map(move |axis| {
            let next = (at[axis] + 1 < size[axis]).then(|| levels.data[index + steps[axis]])?;
            let [here, there] = [*level, next].map(f64::from);
            ((here < 0.0) != (there < 0.0)).then(|| {
                let mut found = Vector3::from(at).map(|i| i as f64);
                found[axis] += here / (here - there);
                found
            })
        })
    })
}

/// Lowest and highest indices of a box around what is inside; none where nothing is.
fn within(levels: &Lattice<f32>) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let size = levels.size;
    let inside = levels.data.iter().enumerate().filter(|(_, level)| **level < 0.0);
    let place = |index: usize| Vector3::new(index % size[0], index / size[0] % size[1], index / size[0] / size[1]);
    let places = inside.map(|(index, _)| place(index).map(|i| i as f64));
    let (low, high) = places.fold(None, |found: Option<(Vector3<f64>, Vector3<f64>)>, x| {
        Some(found.map_or((x, x), |(low, high)| (low.inf(&x), high.sup(&x))))
    })?;
    Some((low.add_scalar(-1.0), high.add_scalar(1.0)))
}
