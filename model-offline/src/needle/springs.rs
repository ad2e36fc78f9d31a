//! What keeps tissue on the needle's line while the forces that do are still sought.

use super::station::{Station, add_force};
use crate::discretization::Stencil;
use crate::geometry::Point2;
use crate::linalg::Pattern;
use crate::mechanics::{Tissue, WeaklyImposed};
use std::sync::Arc;

/// A point of the tissue that belongs on the needle's line.
#[derive(Debug, Clone, PartialEq)]
struct Point {
    stencil: Stencil<2>,
    /// Displacement across the needle with which it is there.
    there: f64,
}

/// Springs across the needle, between its line and points of the tissue.
///
/// Tissue that friction and the tip push along the needle may buckle sideways: held by the needle it cannot, under the
/// forces that the needle holds it with, and that stay while it moves, it does. Rounds of forces then jump from one side to
/// the other. With springs the same forces are found, which pull on nothing where everything is in its place.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Springs {
    normal: Point2,
    /// Force per displacement of a point.
    stiffness: f64,
    points: Vec<Point>,
}

impl Springs {
    /// Springs at stations, each with the displacement across the needle with which it is on the line, in a body whose
    /// tangent has these blocks: what it does not couple stays without.
    pub(super) fn new<'s>(
        (normal, stiffness): (Point2, f64),
        stations: impl Iterator<Item = (&'s Station, f64)>,
        pattern: &Pattern,
    ) -> Self {
        let coupled = |(station, _): &(&Station, f64)| {
            let nodes = &station.stencil.nodes;
            nodes.iter().enumerate().all(|(k, &j)| nodes[k..].iter().all(|&i| pattern.block_position(i, j).is_some()))
        };
        let point = |(station, there): (&Station, f64)| Point { stencil: station.stencil.clone(), there };
        Self { normal, stiffness, points: stations.filter(coupled).map(point).collect() }
    }
}

impl WeaklyImposed for Springs {
    fn prescribed(&self) -> usize {
        0
    }

    fn node_lists(&self) -> Vec<&[u32]> {
        self.points.iter().map(|point| point.stencil.nodes.as_slice()).collect()
    }

    fn add_force(&self, _: &Tissue, d: &[f64], _: &[f64], force: &mut [f64]) -> f64 {
        let energies = self.points.iter().map(|Point { stencil, there }| {
            let off = self.normal.dot(&stencil.interpolate(d)) - there;
            add_force(stencil, self.normal * (self.stiffness * off), force);
            0.5 * self.stiffness * off * off
        });
        energies.sum()
    }

    fn add_tangent(&self, _: &Tissue, _: (&[f64], &[f64]), pattern: &Pattern, values: &mut [f64]) {
        let across = self.normal * self.normal.transpose() * self.stiffness;
        for Stencil { nodes, values: shares, .. } in self.points.iter().map(|point| &point.stencil) {
            for (column, &j) in nodes.iter().enumerate() {
                let stride = pattern.column_length(j);
                for (row, &i) in nodes.iter().enumerate().skip(column) {
                    let Some(at) = pattern.block_position(i, j) else { continue };
                    let block = across * (shares[row] * shares[column]);
                    for (k, r) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                        values[at + k * stride + r] += block[(r, k)];
                    }
                }
            }
        }
    }

    fn adapted(&self, _: &Tissue, _: &[f64]) -> Option<Arc<dyn WeaklyImposed>> {
        None
    }

    fn add_response(&self, _: &Tissue, _: &[f64], _: &[f64], _: &mut [f64]) {}
}
