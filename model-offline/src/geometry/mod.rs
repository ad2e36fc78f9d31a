//! Points in any dimension, and the planar shapes that bodies are made of.

pub mod measures;
pub mod point;
pub mod polygon;

pub use measures::{Nearest, nearest_on_loop};
pub use point::{Point, Point2, cross};
pub use polygon::{
    Location, Polygon, PolygonError, bounds, clip_half_plane, distance_to_polyline, distance_to_segment, overlap_area,
    segments_meet, shared_area, signed_area,
};
