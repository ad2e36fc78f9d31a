//! Points in any dimension, and the shapes that bodies are made of: polygons in the plane, and in space implicit solids,
//! closed surfaces of triangles and labelled voxels.

pub mod implicit;
pub mod labels;
pub mod measures;
pub mod point;
pub mod polygon;
pub mod solid;
pub mod surface;

pub use implicit::{Implicit, Sheet, is_reentrant};
pub use measures::{Nearest, nearest_on_loop};
pub use point::{Point, Point2, box_of, cross};
pub use polygon::{
    Location, Polygon, PolygonError, bounds, clip_half_plane, distance_to_polyline, distance_to_segment, overlap_area,
    segments_meet, shared_area, signed_area, simplified_line, simplified_loop,
};
pub use solid::Solid;
