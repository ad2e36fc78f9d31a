//! Polygons, polylines and segments of the plane: what scenes and nodal cells are made of.

use super::point::{Point2, cross};

/// Where a point lies with respect to a polygon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Location {
    /// Strictly inside.
    Inside,
    /// On the boundary, within the tolerance asked for.
    OnBoundary,
    /// Strictly outside.
    Outside,
}

/// A simple polygon, vertices in counter-clockwise order.
#[derive(Debug, Clone, PartialEq)]
pub struct Polygon {
    vertices: Vec<Point2>,
}

/// Why a list of vertices is not a simple polygon.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PolygonError {
    /// Fewer than three vertices.
    #[error("a polygon needs at least three vertices, this one has {0}")]
    TooFewVertices(usize),
    /// Two successive vertices coincide.
    #[error("vertices {0} and {1} coincide; remove one of them")]
    RepeatedVertex(usize, usize),
    /// The edges enclose no area.
    #[error("the polygon encloses no area")]
    NoArea,
    /// Two edges that are not neighbours meet, or two neighbours fold back on each other.
    #[error(
        "edge {first} (from vertex {first}) and edge {second} (from vertex {second}) cross or touch; reorder the vertices so that the outline does not meet itself"
    )]
    Crossing {
        /// Index of one edge, counted from its first vertex.
        first: usize,
        /// Index of the other edge.
        second: usize,
    },
}

impl Polygon {
    /// Checks that the vertices form a simple polygon and orients them counter-clockwise.
    ///
    /// # Errors
    /// [`PolygonError`] names the vertex or the edges at fault.
    pub fn new(mut vertices: Vec<Point2>) -> Result<Self, PolygonError> {
        let n = vertices.len();
        if n < 3 {
            return Err(PolygonError::TooFewVertices(n));
        }
        let size = extent(&vertices);
        for i in 0..n {
            let next = (i + 1) % n;
            if (vertices[next] - vertices[i]).norm() <= 1e-12 * size {
                return Err(PolygonError::RepeatedVertex(i, next));
            }
        }
        if let Some((first, second)) = first_crossing(&vertices, 1e-12 * size) {
            return Err(PolygonError::Crossing { first, second });
        }
        let area = signed_area(&vertices);
        if area.abs() <= 1e-12 * size * size {
            return Err(PolygonError::NoArea);
        }
        if area < 0.0 {
            vertices.reverse();
        }
        Ok(Self { vertices })
    }

    /// Vertices, counter-clockwise.
    pub fn vertices(&self) -> &[Point2] {
        &self.vertices
    }

    /// Edges as (start, end), counter-clockwise.
    pub fn edges(&self) -> impl Iterator<Item = (Point2, Point2)> + '_ {
        let n = self.vertices.len();
        (0..n).map(move |i| (self.vertices[i], self.vertices[(i + 1) % n]))
    }

    /// Enclosed area.
    pub fn area(&self) -> f64 {
        signed_area(&self.vertices)
    }

    /// Whether no corner turns inwards, but for rounding.
    pub fn is_convex(&self) -> bool {
        let v = &self.vertices;
        (0..v.len()).all(|i| {
            let (a, b, c) = (v[i], v[(i + 1) % v.len()], v[(i + 2) % v.len()]);
            cross(b - a, c - b) >= -1e-9 * (b - a).norm() * (c - b).norm()
        })
    }

    /// Lower left and upper right corner of the bounding box.
    pub fn bounds(&self) -> (Point2, Point2) {
        bounds(&self.vertices)
    }

    /// Diagonal of the bounding box: the length that tolerances are relative to.
    pub fn size(&self) -> f64 {
        extent(&self.vertices)
    }

    /// Distance from a point to the nearest edge.
    pub fn distance_to_boundary(&self, p: Point2) -> f64 {
        self.edges().map(|(a, b)| distance_to_segment(p, a, b)).fold(f64::INFINITY, f64::min)
    }

    /// Classifies a point; within `tolerance` of an edge it is on the boundary.
    pub fn locate(&self, p: Point2, tolerance: f64) -> Location {
        if self.distance_to_boundary(p) <= tolerance {
            Location::OnBoundary
        } else if self.contains(p) {
            Location::Inside
        } else {
            Location::Outside
        }
    }

    /// Even-odd rule; points on the boundary may fall either way.
    pub fn contains(&self, p: Point2) -> bool {
        self.edges().fold(false, |inside, (a, b)| {
            let crosses = (a.y > p.y) != (b.y > p.y) && p.x < (b.x - a.x) * (p.y - a.y) / (b.y - a.y) + a.x;
            inside ^ crosses
        })
    }

    /// Whether the whole segment lies on the boundary (it may run over several collinear edges).
    pub fn segment_on_boundary(&self, a: Point2, b: Point2, tolerance: f64) -> bool {
        self.boundary_stations(a, b).iter().all(|p| self.distance_to_boundary(*p) <= tolerance)
    }

    /// The points of a segment where it must be on the boundary to lie on it as a whole.
    pub fn boundary_stations(&self, a: Point2, b: Point2) -> Vec<Point2> {
        // The distance to a simple polygon along a segment is piecewise smooth with breaks only where the
        // foot changes edge; those breaks lie at projections of vertices, so testing between them suffices.
        let direction = b - a;
        let length2 = direction.norm_squared();
        let mut stations: Vec<f64> = self
            .vertices
            .iter()
            .map(|v| (v - a).dot(&direction) / length2)
            .filter(|s| (0.0..=1.0).contains(s))
            .collect();
        stations.extend([0.0, 1.0]);
        stations.sort_by(f64::total_cmp);
        stations.windows(2).flat_map(|s| [s[0], 0.5 * (s[0] + s[1]), s[1]]).map(|t| a + direction * t).collect()
    }
}

/// Distance from `p` to the segment from `a` to `b`.
pub fn distance_to_segment(p: Point2, a: Point2, b: Point2) -> f64 {
    let d = b - a;
    let length2 = d.norm_squared();
    let s = if length2 > 0.0 { ((p - a).dot(&d) / length2).clamp(0.0, 1.0) } else { 0.0 };
    (p - a - d * s).norm()
}

/// Distance from `p` to a polyline.
pub fn distance_to_polyline(p: Point2, polyline: &[Point2]) -> f64 {
    polyline.windows(2).map(|s| distance_to_segment(p, s[0], s[1])).fold(f64::INFINITY, f64::min)
}

/// A closed loop without vertices that lie within `tolerance` (length) of the line between others (Ramer, Douglas and
/// Peucker).
pub fn simplified_loop(points: &[Point2], tolerance: f64) -> Vec<Point2> {
    let mut open: Vec<Point2> = points.to_vec();
    while open.len() > 1 && (open[0] - open[open.len() - 1]).norm() <= 1e-9 * tolerance.max(f64::MIN_POSITIVE) {
        open.pop();
    }
    // Two far corners split the loop into two open lines. Both are corners: the lowest-left and the one farthest away.
    let first =
        (0..open.len()).min_by(|&a, &b| (open[a].x + open[a].y).total_cmp(&(open[b].x + open[b].y))).unwrap_or(0);
    open.rotate_left(first);
    let far =
        (0..open.len()).max_by(|&a, &b| (open[a] - open[0]).norm().total_cmp(&(open[b] - open[0]).norm())).unwrap_or(0);
    let mut kept = simplified_line(&open[..=far], tolerance);
    kept.pop();
    let back: Vec<Point2> = open[far..].iter().chain(open.first()).copied().collect();
    kept.extend(simplified_line(&back, tolerance));
    kept.pop();
    kept
}

/// The points of an open line that matter, ends included: the others lie within `tolerance` (length) of it (Ramer,
/// Douglas and Peucker).
pub fn simplified_line(line: &[Point2], tolerance: f64) -> Vec<Point2> {
    let Some(end) = line.len().checked_sub(1) else {
        return Vec::new();
    };
    // Not recursive: lines from files may be long.
    let mut matters = vec![false; line.len()];
    (matters[0], matters[end]) = (true, true);
    let mut open = vec![(0, end)];
    while let Some((from, to)) = open.pop() {
        let off = |i: usize| distance_to_segment(line[i], line[from], line[to]);
        if let Some(i) = (from + 1..to).max_by(|&a, &b| off(a).total_cmp(&off(b)))
            && off(i) > tolerance
        {
            matters[i] = true;
            open.extend([(from, i), (i, to)]);
        }
    }
    line.iter().zip(matters).filter_map(|(p, matters)| matters.then_some(*p)).collect()
}

/// Signed area of a closed loop of vertices (positive when counter-clockwise).
pub fn signed_area(vertices: &[Point2]) -> f64 {
    let n = vertices.len();
    // Relative to the first vertex: cells far from the origin keep their digits.
    (1..n.saturating_sub(1)).map(|i| 0.5 * cross(vertices[i] - vertices[0], vertices[i + 1] - vertices[0])).sum()
}

/// Lower left and upper right corner of the bounding box of some points.
pub fn bounds(points: &[Point2]) -> (Point2, Point2) {
    points.iter().fold((Point2::repeat(f64::INFINITY), Point2::repeat(f64::NEG_INFINITY)), |(low, high), p| {
        (low.inf(p), high.sup(p))
    })
}

fn extent(points: &[Point2]) -> f64 {
    let (low, high) = bounds(points);
    (high - low).norm()
}

/// First pair of edges that meet other than at a shared vertex, or that fold back on each other there.
///
/// A sweep over the edges sorted by their lowest x keeps this near linear for outlines of many vertices.
fn first_crossing(v: &[Point2], tolerance: f64) -> Option<(usize, usize)> {
    let n = v.len();
    let end = |i: usize| v[(i + 1) % n];
    let mut order: Vec<usize> = (0..n).collect();
    let low = |i: usize| v[i].x.min(end(i).x);
    let high = |i: usize| v[i].x.max(end(i).x);
    order.sort_by(|&i, &j| low(i).total_cmp(&low(j)));
    let mut active: Vec<usize> = Vec::new();
    for &i in &order {
        active.retain(|&j| high(j) + tolerance >= low(i));
        for &j in &active {
            let (first, second) = (i.min(j), i.max(j));
            let neighbours = second == first + 1 || (first == 0 && second == n - 1);
            let meet = if neighbours {
                let (shared, p, q) =
                    if second == first + 1 { (v[second], v[first], end(second)) } else { (v[0], v[n - 1], end(0)) };
                let (a, b) = (p - shared, q - shared);
                a.dot(&b) > 0.0 && cross(a, b).abs() <= 1e-12 * a.norm() * b.norm()
            } else {
                segments_meet(v[i], end(i), v[j], end(j), tolerance)
            };
            if meet {
                return Some((first, second));
            }
        }
        active.push(i);
    }
    None
}

/// Whether two closed segments meet or come closer than `tolerance`.
pub fn segments_meet(a: Point2, b: Point2, c: Point2, d: Point2, tolerance: f64) -> bool {
    let side = |p: Point2, q: Point2, r: Point2| cross(q - p, r - p);
    let straddle = |x: f64, y: f64| (x > 0.0 && y < 0.0) || (x < 0.0 && y > 0.0);
    if straddle(side(a, b, c), side(a, b, d)) && straddle(side(c, d, a), side(c, d, b)) {
        return true;
    }
    distance_to_segment(a, c, d) <= tolerance
        || distance_to_segment(b, c, d) <= tolerance
        || distance_to_segment(c, a, b) <= tolerance
        || distance_to_segment(d, a, b) <= tolerance
}

/// Keeps the part of a loop on the side of `origin` opposite to `normal` (Sutherland–Hodgman), carrying a label
/// per edge; the new edge gets `label`. `vertices[i]` and `labels[i]` describe the edge from vertex i to i + 1.
///
/// For a loop that is not convex the result may contain coincident edges that run both ways: every boundary
/// integral over them cancels, and areas stay exact.
pub fn clip_half_plane<L: Copy>(
    loop_in: &[(Point2, L)],
    origin: Point2,
    normal: Point2,
    label: L,
    out: &mut Vec<(Point2, L)>,
) {
    out.clear();
    let n = loop_in.len();
    let side = |p: Point2| (p - origin).dot(&normal);
    for i in 0..n {
        let (p, edge) = loop_in[i];
        let (q, _) = loop_in[(i + 1) % n];
        let (sp, sq) = (side(p), side(q));
        let crossing = |from: f64, to: f64| p + (q - p) * (from / (from - to));
        match (sp <= 0.0, sq <= 0.0) {
            (true, true) => out.push((p, edge)),
            (true, false) => {
                out.push((p, edge));
                if sp < 0.0 {
                    out.push((crossing(sp, sq), label));
                } else if let Some(last) = out.last_mut() {
                    // `p` lies on the line and the loop leaves: the new edge starts right here.
                    last.1 = label;
                }
            }
            (false, true) => {
                if sq < 0.0 {
                    out.push((crossing(sp, sq), edge));
                }
            }
            (false, false) => {}
        }
    }
}

/// Area of a polygon that lies inside a convex loop (counter-clockwise).
pub fn overlap_area(polygon: &Polygon, convex: &[Point2]) -> f64 {
    signed_area(&clipped(polygon, convex)).max(0.0)
}

/// The part of a polygon inside a convex loop (counter-clockwise): a loop, empty when there is none.
fn clipped(polygon: &Polygon, convex: &[Point2]) -> Vec<Point2> {
    let mut current: Vec<(Point2, ())> = polygon.vertices.iter().map(|&v| (v, ())).collect();
    let mut next = Vec::with_capacity(current.len() + 4);
    for i in 0..convex.len() {
        let (a, b) = (convex[i], convex[(i + 1) % convex.len()]);
        let d = b - a;
        clip_half_plane(&current, a, Point2::new(d.y, -d.x), (), &mut next);
        std::mem::swap(&mut current, &mut next);
    }
    current.iter().map(|c| c.0).collect()
}

/// Area of a closed loop (counter-clockwise, convex or not) that lies inside all of some polygons.
pub fn shared_area(polygons: &[&Polygon], corners: &[Point2]) -> f64 {
    let Some((last, others)) = polygons.split_last() else { return signed_area(corners) };
    if others.is_empty() && is_convex(corners) {
        return overlap_area(last, corners);
    }
    // A fan of signed triangles stands for any loop: what they count twice they also count back.
    let mut triangles = signed_fan(corners);
    for polygon in others {
        triangles = triangles
            .iter()
            .flat_map(|(sign, triangle)| {
                signed_fan(&clipped(polygon, triangle)).into_iter().map(move |(inner, t)| (sign * inner, t))
            })
            .collect();
    }
    triangles.iter().map(|(sign, triangle)| sign * overlap_area(last, triangle)).sum::<f64>().max(0.0)
}

fn is_convex(corners: &[Point2]) -> bool {
    let n = corners.len();
    (0..n).all(|i| {
        let (a, b) = (corners[(i + 1) % n] - corners[i], corners[(i + 2) % n] - corners[(i + 1) % n]);
        cross(a, b) >= -1e-12 * a.norm() * b.norm()
    })
}

/// Triangles from the first corner, counter-clockwise, with the sign that they count with.
fn signed_fan(corners: &[Point2]) -> Vec<(f64, [Point2; 3])> {
    (1..corners.len().saturating_sub(1))
        .filter_map(|i| {
            let (a, b, c) = (corners[0], corners[i], corners[i + 1]);
            match cross(b - a, c - a) {
                twice if twice > 0.0 => Some((1.0, [a, b, c])),
                twice if twice < 0.0 => Some((-1.0, [a, c, b])),
                _ => None,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(v: &[[f64; 2]]) -> Result<Polygon, PolygonError> {
        Polygon::new(v.iter().map(|p| Point2::new(p[0], p[1])).collect())
    }

    #[test]
    fn a_square_with_points_on_its_edges_keeps_its_four_corners() {
        let edge = |a: [f64; 2], b: [f64; 2]| {
            (0..10).map(move |i| Point2::from(a) + (Point2::from(b) - Point2::from(a)) * (f64::from(i) / 10.0))
        };
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let points: Vec<Point2> = (0..4).flat_map(|i| edge(corners[i], corners[(i + 1) % 4])).collect();
        assert_eq!(simplified_loop(&points, 1e-3), corners.map(Point2::from));
    }

    #[test]
    fn either_orientation_gives_the_same_area() {
        let ccw = polygon(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]).unwrap();
        let cw = polygon(&[[0.0, 0.0], [0.0, 1.0], [2.0, 1.0], [2.0, 0.0]]).unwrap();
        assert_eq!(ccw.area(), 2.0);
        assert_eq!(cw.area(), 2.0);
    }

    #[test]
    fn crossing_spike_and_repeated_vertices_are_refused() {
        let bow_tie = polygon(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]);
        assert!(matches!(bow_tie, Err(PolygonError::Crossing { .. })));
        let spike = polygon(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 0.0], [1.0, 1.0]]);
        assert!(matches!(spike, Err(PolygonError::Crossing { .. })));
        let repeated = polygon(&[[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]);
        assert_eq!(repeated, Err(PolygonError::RepeatedVertex(0, 1)));
        assert!(polygon(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]).is_err());
    }

    #[test]
    fn location_and_boundary_segments() {
        let l = polygon(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]]).unwrap();
        assert_eq!(l.locate(Point2::new(0.5, 0.5), 1e-9), Location::Inside);
        assert_eq!(l.locate(Point2::new(1.5, 1.5), 1e-9), Location::Outside);
        assert_eq!(l.locate(Point2::new(1.0, 1.5), 1e-9), Location::OnBoundary);
        assert!(l.segment_on_boundary(Point2::new(0.2, 0.0), Point2::new(1.7, 0.0), 1e-9));
        assert!(!l.segment_on_boundary(Point2::new(0.0, 2.0), Point2::new(2.0, 0.0), 1e-9));
    }

    #[test]
    fn overlap_with_a_non_convex_polygon_is_exact() {
        let u =
            polygon(&[[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [2.0, 2.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]])
                .unwrap();
        let window: Vec<Point2> =
            [[0.5, 0.5], [2.5, 0.5], [2.5, 1.5], [0.5, 1.5]].iter().map(|p| Point2::new(p[0], p[1])).collect();
        assert!((overlap_area(&u, &window) - 1.5).abs() < 1e-14);
        assert_eq!(shared_area(&[&u], &window), overlap_area(&u, &window));
        // The other way round the loop is not convex, and together with a third region there are two polygons.
        let square = Polygon::new(window).unwrap();
        assert!((shared_area(&[&square], u.vertices()) - 1.5).abs() < 1e-14);
        let left = polygon(&[[0.0, 0.0], [1.5, 0.0], [1.5, 3.0], [0.0, 3.0]]).unwrap();
        assert!((shared_area(&[&square, &left], u.vertices()) - 0.75).abs() < 1e-14);
        assert!((shared_area(&[&left, &u], square.vertices()) - 0.75).abs() < 1e-14);
    }
}
