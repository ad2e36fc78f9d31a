//! Closed paths and polygons of an SVG drawing; curves are flattened, transforms applied, y turned upwards.

use super::{ImportError, Imported, assemble};
use crate::geometry::Point2;
use kurbo::{Affine, BezPath, PathEl};
use roxmltree::{Document, Node};
use std::str::FromStr as _;

/// Distance between a curve and its chords, part of the drawing's size.
const FLATNESS: f64 = 1e-3;

/// Reads the drawing; with `size` the longer side of the body becomes that many length units.
///
/// # Errors
/// [`ImportError`].
pub fn read(text: &str, size: Option<f64>) -> Result<Imported, ImportError> {
    let document = Document::parse(text)
        .map_err(|error| ImportError::Syntax { line: error.pos().row as usize, what: error.to_string() })?;
    let mut loops = Vec::new();
    for node in document.descendants().filter(Node::is_element) {
        let path = match node.tag_name().name() {
            "path" => node.attribute("d").map(|d| BezPath::from_svg(d).map_err(|error| error.to_string())),
            "polygon" => {
                node.attribute("points").map(|p| polygon(p).ok_or_else(|| "polygon without points".to_owned()))
            }
            _ => None,
        };
        let Some(path) = path else { continue };
        let line = document.text_pos_at(node.range().start).row as usize;
        let path = path.map_err(|what| ImportError::Syntax { line, what })?;
        loops.extend(flattened(transform(node, line)? * path));
    }
    if loops.is_empty() {
        return Err(ImportError::NoOutline(
            "the drawing has no <path> and no <polygon>; convert shapes to paths".into(),
        ));
    }
    assemble(loops, size)
}

fn polygon(points: &str) -> Option<BezPath> {
    let mut path = BezPath::new();
    for (i, (x, y)) in svgtypes::PointsParser::from(points).enumerate() {
        if i == 0 { path.move_to((x, y)) } else { path.line_to((x, y)) }
    }
    (!path.elements().is_empty()).then_some(path)
}

/// Transforms of the element and of everything around it.
fn transform(node: Node<'_, '_>, line: usize) -> Result<Affine, ImportError> {
    let mut whole = Affine::IDENTITY;
    for ancestor in node.ancestors() {
        if let Some(attribute) = ancestor.attribute("transform") {
            let t = svgtypes::Transform::from_str(attribute)
                .map_err(|error| ImportError::Syntax { line, what: format!("transform: {error}") })?;
            whole = Affine::new([t.a, t.b, t.c, t.d, t.e, t.f]) * whole;
        }
    }
    Ok(whole)
}

/// Subpaths as closed loops of points, y upwards.
fn flattened(path: BezPath) -> Vec<Vec<Point2>> {
    use kurbo::Shape as _;
    let size = path.bounding_box();
    let tolerance = FLATNESS * size.width().max(size.height()).max(f64::MIN_POSITIVE);
    let mut loops: Vec<Vec<Point2>> = Vec::new();
    kurbo::flatten(path, tolerance, |element| match element {
        PathEl::MoveTo(p) => loops.push(vec![Point2::new(p.x, -p.y)]),
        PathEl::LineTo(p) => {
            if let Some(points) = loops.last_mut() {
                points.push(Point2::new(p.x, -p.y));
            }
        }
        _ => {}
    });
    loops
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A circle of two arcs has the circle's area, and a transform moves and turns without changing it.
    #[test]
    fn curves_and_transforms_keep_areas() {
        let text = r#"<svg xmlns="http://www.w3.org/2000/svg"><g transform="translate(30 -4) rotate(25)">
            <path transform="scale(2)" d="M -10 0 A 10 10 0 0 0 10 0 A 10 10 0 0 0 -10 0 Z"/>
            <polygon points="-3,-3 3,-3 3,3 -3,3"/></g></svg>"#;
        let imported = read(text, None).unwrap();
        let circle = std::f64::consts::PI * 400.0;
        assert!((imported.outline.area() / circle - 1.0).abs() < 5e-3, "{}", imported.outline.area());
        assert_eq!(imported.inclusions.len(), 1);
        assert!((imported.inclusions[0].area() / 36.0 - 1.0).abs() < 1e-3);
        let sized = read(text, Some(80.0)).unwrap();
        let (low, high) = sized.outline.bounds();
        assert!(((high - low).max() - 80.0).abs() < 1e-2);
    }

    #[test]
    fn what_is_no_drawing_is_refused_with_its_line() {
        assert!(matches!(read("<svg>\n<path d=\"M 0 0 L\"/></svg>", None), Err(ImportError::Syntax { line: 2, .. })));
        assert!(matches!(read("not xml", None), Err(ImportError::Syntax { .. })));
        assert!(matches!(read("<svg/>", None), Err(ImportError::NoOutline(_))));
        assert!(matches!(read("<svg><path d=\"M0 0 L1 1 L2 2\"/></svg>", None), Err(ImportError::NoOutline(_))));
    }
}
