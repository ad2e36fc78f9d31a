//! The plane of the scene on paper, and the body's nodes as a surface.

use model_offline::output::chart::{Plane, Px};
use model_offline::output::surface::edges;
pub(super) use model_offline::output::surface::{inside, middle};

use crate::bench::result::{Geometry, RunResult};

/// Length of the needle outside the tissue, as a part of the scene's size.
const NEEDLE: f64 = 0.16;
/// Room around the scene, as a part of its size.
const MARGIN: f64 = 0.07;

/// Equal scales on both axes, y upwards.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaneView {
    plane: Plane,
    /// Larger side of the scene, length.
    pub(super) extent: f64,
}

impl PlaneView {
    /// Everything that is ever drawn, this wide.
    pub(super) fn new(run: &RunResult, width: f64) -> Self {
        let geometry = &run.geometry;
        let deformed = run.results().flat_map(|result| &result.deformed_nodes);
        let mut bounds = Bounds::default();
        geometry.outline.iter().chain(&geometry.nodes).chain(deformed).for_each(|point| bounds.add(*point));
        let extent = bounds.extent();
        bounds.add(along(middle(&geometry.needle_contact), geometry.needle_axis, -NEEDLE * extent));
        let margin = MARGIN * bounds.extent();
        let plane = Plane::new(bounds.low.map(|low| low - margin), bounds.high.map(|high| high + margin), width);
        Self { plane, extent }
    }

    /// Width and height, px.
    pub(super) fn size(&self) -> Px {
        self.plane.size
    }

    /// A length, px.
    pub(super) fn length(&self, length: f64) -> f64 {
        self.plane.length(length)
    }

    /// A point, px.
    pub(super) fn at(&self, point: [f64; 2]) -> Px {
        self.plane.at(point)
    }

    /// Points, px.
    pub(super) fn path(&self, points: &[[f64; 2]]) -> Vec<Px> {
        self.plane.path(points)
    }

    /// From the far end of the needle to its contact, at this depth.
    pub(super) fn needle(&self, geometry: &Geometry, depth: f64) -> [Px; 2] {
        let contact = middle(&geometry.needle_contact);
        [-NEEDLE * self.extent + depth, depth].map(|way| self.at(along(contact, geometry.needle_axis, way)))
    }
}

#[derive(Clone, Copy, Debug)]
struct Bounds {
    low: [f64; 2],
    high: [f64; 2],
}

impl Default for Bounds {
    fn default() -> Self {
        Self { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] }
    }
}

impl Bounds {
    fn add(&mut self, point: [f64; 2]) {
        if point.iter().all(|value| value.is_finite()) {
            for (i, value) in point.into_iter().enumerate() {
                self.low[i] = self.low[i].min(value);
                self.high[i] = self.high[i].max(value);
            }
        }
    }

    fn extent(&self) -> f64 {
        (self.high[0] - self.low[0]).max(self.high[1] - self.low[1])
    }
}

/// A point some way along a direction.
pub(super) fn along(from: [f64; 2], direction: [f64; 2], way: f64) -> [f64; 2] {
    [from[0] + direction[0] * way, from[1] + direction[1] * way]
}

/// Nodes on the outline, in its order.
pub(super) fn boundary(geometry: &Geometry, extent: f64) -> Vec<usize> {
    let mut found = Vec::new();
    let mut before = 0.0;
    for (start, end) in edges(&geometry.outline) {
        let [dx, dy] = [end[0] - start[0], end[1] - start[1]];
        let length = dx.hypot(dy);
        for (i, node) in geometry.nodes.iter().enumerate() {
            let [x, y] = [node[0] - start[0], node[1] - start[1]];
            let (way, off) = ((x * dx + y * dy) / length, (x * dy - y * dx) / length);
            let close = 1e-6 * extent;
            // The end belongs to the next edge.
            if off.abs() < close && way > -close && way < length - close {
                found.push((before + way, i));
            }
        }
        before += length;
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.into_iter().map(|(_, i)| i).collect()
}
