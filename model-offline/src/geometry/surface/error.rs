//! Why triangles enclose no volume.

use crate::geometry::point::{Point, digits, shown};

/// A place where a surface is open.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// A point on its rim: the middle of its first edge.
    pub at: Point<3>,
    /// How wide it is: of a slit the largest way across, of a hole four times its area by its rim's length (of a round
    /// one its diameter). In the file's unit of length.
    pub width: f64,
    /// Length of its rim, in the file's unit of length.
    pub rim: f64,
    /// Edges of its rim.
    pub edges: usize,
}

/// Why triangles are not the surface of a body.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// Nothing is left that has an area.
    #[error("the surface has no triangles with an area: export the body as a surface mesh")]
    Empty,
    /// A triangle has a vertex that is not there.
    #[error("triangle {triangle} has vertex {vertex}, and there are {vertices}: the file is damaged, export it again")]
    Index {
        /// Which triangle, from 0.
        triangle: usize,
        /// Its vertex, from 0.
        vertex: u32,
        /// How many there are.
        vertices: usize,
    },
    /// A coordinate is infinite, no number, or too large to compute with.
    #[error("vertex {vertex} has the coordinate {value:e}: coordinates are finite and at most 1e12, export it again")]
    Coordinate {
        /// Which vertex, from 0.
        vertex: usize,
        /// The coordinate.
        value: f64,
    },
    /// The surface has a rim.
    #[error("the surface is open at {}{}: {}", .gaps.len(), if .gaps.len() == 1 { " place" } else { " places" },
        listed(.gaps))]
    Open {
        /// Every place where it is open, the widest first.
        gaps: Vec<Gap>,
    },
    /// More than two triangles meet in an edge.
    #[error("{triangles} triangles meet in the edge from {} to {}: a surface has two at every edge; \
        remove doubled faces, or move parts apart that touch", shown(&.edge[0]), shown(&.edge[1]))]
    Branching {
        /// Ends of the edge.
        edge: [Point<3>; 2],
        /// How many triangles have it.
        triangles: usize,
    },
    /// It has one side only, as a Klein bottle has.
    #[error("the surface has no inside: following it round leads to its other side at {}; repair it where it was made",
        shown(.at))]
    OneSided {
        /// Middle of an edge where both sides meet.
        at: Point<3>,
    },
    /// Triangles cut or touch each other.
    #[error("the surface meets itself at {}, where triangles {} and {} cut or touch: \
        unite the parts, or repair it where it was made", shown(.at), .triangles[0], .triangles[1])]
    SelfIntersection {
        /// A point of both triangles.
        at: Point<3>,
        /// The triangles, from 0, after those without area are left out.
        triangles: [usize; 2],
    },
    /// A part within another faces outwards too.
    #[error("a closed part at {} lies within another and faces outwards: an inclusion belongs into a file of its own, \
        and a cavity has to face inwards (flip its normals)", shown(.at))]
    Nested {
        /// A vertex of the inner part.
        at: Point<3>,
    },
}

/// The first gaps, in words.
fn listed(gaps: &[Gap]) -> String {
    const SHOWN: usize = 5;
    let told = gaps
        .iter()
        .take(SHOWN)
        .map(|gap| format!("{} wide at {} (rim of {} edges)", digits(gap.width), shown(&gap.at), gap.edges));
    let mut text = told.collect::<Vec<_>>().join(", ");
    if gaps.len() > SHOWN {
        text.push_str(&format!(", and {} more", gaps.len() - SHOWN));
    }
    text + "; close it where it was made: gaps are not repaired here"
}
