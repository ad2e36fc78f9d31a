//! Outlines from files of other tools: an SVG drawing, a Gmsh mesh.
//!
//! Whatever the file, the largest closed region becomes the body and the others inside it become inclusions.

pub mod gmsh;
pub mod svg;

use crate::geometry::{Point2, Polygon, bounds, distance_to_segment, signed_area};

/// Details below this part of the body's size are left out: nothing that a node spacing of a few percent could show.
const DETAIL: f64 = 2e-3;

/// Regions read from a drawing or a mesh.
#[derive(Debug, Clone)]
pub struct Imported {
    /// The body.
    pub outline: Polygon,
    /// Regions inside it.
    pub inclusions: Vec<Polygon>,
}

/// Why a file gives no outline.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ImportError {
    /// The file is not what its name says.
    #[error("line {line}: {what}")]
    Syntax {
        /// Line, from 1.
        line: usize,
        /// What is wrong there.
        what: String,
    },
    /// A kind of file that is not read.
    #[error("{0}")]
    Unsupported(String),
    /// Nothing in it encloses an area.
    #[error("no closed outline is in it: {0}")]
    NoOutline(String),
}

/// Sorts closed loops into the body and what is inside it; `size`, if given, becomes the longer side of the body.
///
/// # Errors
/// [`ImportError::NoOutline`] when no loop is a simple polygon.
pub fn assemble(loops: Vec<Vec<Point2>>, size: Option<f64>) -> Result<Imported, ImportError> {
    let mut loops: Vec<Vec<Point2>> = loops.into_iter().filter(|points| points.len() > 2).collect();
    loops.sort_by(|a, b| signed_area(b).abs().total_cmp(&signed_area(a).abs()));
    let Some(body) = loops.first() else {
        return Err(ImportError::NoOutline("draw a closed path around the body".to_owned()));
    };
    let (low, high) = bounds(body);
    let longer = (high - low).max();
    let scale = size.map_or(1.0, |size| size / longer);
    let prepared = loops.iter().map(|points| {
        let scaled: Vec<Point2> = points.iter().map(|p| if size.is_some() { (p - low) * scale } else { *p }).collect();
        let mut rounded = simplified(&scaled, DETAIL * longer * scale);
        // A thousandth of the detail that was kept: files that people can read.
        let step = 10f64.powf((1e-3 * DETAIL * longer * scale).log10().floor());
        rounded.iter_mut().for_each(|p| *p = p.map(|v| (v / step).round() * step));
        Polygon::new(rounded)
    });
    let mut polygons = prepared.collect::<Vec<_>>().into_iter();
    let outline = match polygons.next() {
        Some(Ok(outline)) => outline,
        Some(Err(error)) => {
            return Err(ImportError::NoOutline(format!("the largest closed path is no outline: {error}")));
        }
        None => return Err(ImportError::NoOutline("it is empty".to_owned())),
    };
    let inclusions = polygons.flatten().filter(|p| p.vertices().iter().all(|v| outline.contains(*v))).collect();
    Ok(Imported { outline, inclusions })
}

/// A closed loop without vertices that lie on the line between others (Ramer, Douglas and Peucker).
fn simplified(points: &[Point2], tolerance: f64) -> Vec<Point2> {
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
    let mut kept = Vec::new();
    keep(&open[..=far], tolerance, &mut kept);
    kept.pop();
    let back: Vec<Point2> = open[far..].iter().chain(open.first()).copied().collect();
    keep(&back, tolerance, &mut kept);
    kept.pop();
    kept
}

/// Adds the points of an open line that matter, ends included.
fn keep(line: &[Point2], tolerance: f64, kept: &mut Vec<Point2>) {
    let (Some(first), Some(last)) = (line.first(), line.last()) else {
        return;
    };
    let off = |i: usize| distance_to_segment(line[i], *first, *last);
    match (1..line.len().saturating_sub(1)).max_by(|&a, &b| off(a).total_cmp(&off(b))) {
        Some(i) if off(i) > tolerance => {
            keep(&line[..=i], tolerance, kept);
            kept.pop();
            keep(&line[i..], tolerance, kept);
        }
        _ if line.len() > 1 => kept.extend([*first, *last]),
        _ => kept.push(*first),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_with_points_on_its_edges_keeps_its_four_corners() {
        let edge = |a: [f64; 2], b: [f64; 2]| {
            (0..10).map(move |i| Point2::from(a) + (Point2::from(b) - Point2::from(a)) * (f64::from(i) / 10.0))
        };
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let points: Vec<Point2> = (0..4).flat_map(|i| edge(corners[i], corners[(i + 1) % 4])).collect();
        let imported = assemble(vec![points], Some(50.0)).unwrap();
        assert_eq!(imported.outline.vertices().len(), 4);
        assert!((imported.outline.area() - 2500.0).abs() < 1e-9);
    }
}
