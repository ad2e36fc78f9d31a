//! What nodes must follow: outline, inclusions, and everything whose displacement is prescribed or asked for.

use crate::geometry::{Point2, Polygon};

/// The geometry of a body that nodes are fitted to.
#[derive(Debug, Clone)]
pub struct Features {
    /// The body.
    pub outline: Polygon,
    /// Regions of another stiffness or material.
    pub inclusions: Vec<Polygon>,
    /// Polylines on the boundary that cannot move.
    pub immobile: Vec<Vec<Point2>>,
    /// Polyline of tissue that moves with the needle.
    pub contact: Vec<Point2>,
    /// Ends of the paddles.
    pub paddles: Vec<[Point2; 2]>,
    /// The point whose displacement is asked for.
    pub target: Point2,
    /// Where a needle that slips enters the body, and the deepest place of its tip.
    pub shaft: Option<[Point2; 2]>,
}

impl Features {
    /// Points that must be nodes: outline corners, ends of paddles and of the needle contact, corners of the immobile
    /// part, and the target.
    pub fn points(&self) -> Vec<Point2> {
        let mut points = self.outline.vertices().to_vec();
        points.extend(self.paddles.iter().flatten());
        points.extend(&self.contact);
        points.extend(self.immobile.iter().flatten());
        points.push(self.target);
        points
    }

    /// Straight pieces that nodes must follow: outline edges and needle contact.
    pub fn segments(&self) -> Vec<(Point2, Point2)> {
        let contact = self.contact.windows(2).map(|s| (s[0], s[1]));
        self.outline.edges().chain(contact).collect()
    }
}
