//! Elements that draw something, as paths, and paths as lines of points.

use crate::geometry::Point2;
use kurbo::{Affine, BezPath, Ellipse, PathEl, Rect, RoundedRect, Shape as _};
use roxmltree::Node;
use std::str::FromStr as _;
use svgtypes::{Length, LengthUnit};

/// Distance between a curve and its chords, part of the path's size.
const FLATNESS: f64 = 1e-3;
/// Curves become paths to this part of their size.
const ACCURACY: f64 = 1e-5;
/// CSS pixels, which a user unit is without a viewBox, in an inch.
const PER_INCH: f64 = 96.0;
/// Digits before the point beyond which a number is refused: arcs are divided by their radius.
const DIGITS: usize = 9;

pub(super) const SHAPES: [&str; 7] = ["path", "rect", "circle", "ellipse", "line", "polyline", "polygon"];

/// Why an element draws nothing.
pub(super) enum NotDrawn {
    /// The file is wrong.
    Wrong(String),
    /// It is no shape that can be taken.
    LeftOut(String),
}

/// What percentages are parts of, in user units.
#[derive(Debug, Clone, Copy)]
pub(super) struct Viewport {
    pub(super) size: Option<[f64; 2]>,
}

/// Which side of the viewport a percentage is a part of.
#[derive(Clone, Copy)]
enum Side {
    Width,
    Height,
    Diagonal,
}

struct Attributes<'a, 'input> {
    node: Node<'a, 'input>,
    viewport: Viewport,
}

impl Attributes<'_, '_> {
    /// A length in user units, if it is given.
    fn given(&self, name: &str, side: Side) -> Result<Option<f64>, NotDrawn> {
        let Some(text) = self.node.attribute(name).map(str::trim).filter(|text| *text != "auto") else {
            return Ok(None);
        };
        let wrong = |_| NotDrawn::Wrong(format!("{name}={text:?} is no length"));
        let Length { number, unit } = Length::from_str(text).map_err(wrong)?;
        let per_unit = match unit {
            LengthUnit::None | LengthUnit::Px => 1.0,
            LengthUnit::In => PER_INCH,
            LengthUnit::Cm => PER_INCH / 2.54,
            LengthUnit::Mm => PER_INCH / 25.4,
            LengthUnit::Pt => PER_INCH / 72.0,
            LengthUnit::Pc => PER_INCH / 6.0,
            LengthUnit::Percent => match (self.viewport.size, side) {
                (Some([width, _]), Side::Width) => width / 100.0,
                (Some([_, height]), Side::Height) => height / 100.0,
                (Some([width, height]), Side::Diagonal) => width.hypot(height) / 2f64.sqrt() / 100.0,
                (None, _) => {
                    return Err(NotDrawn::LeftOut(format!(
                        "{name}={text:?} is a part of a viewBox, and there is none"
                    )));
                }
            },
            LengthUnit::Em | LengthUnit::Ex => {
                return Err(NotDrawn::LeftOut(format!("{name}={text:?} depends on a font; give a number")));
            }
        };
        Ok(Some(number * per_unit))
    }

    fn or_zero(&self, name: &str, side: Side) -> Result<f64, NotDrawn> {
        Ok(self.given(name, side)?.unwrap_or(0.0))
    }

    /// Lengths of which none is drawn without.
    fn positive(&self, name: &str, side: Side) -> Result<f64, NotDrawn> {
        match self.given(name, side)? {
            Some(value) if value > 0.0 => Ok(value),
            Some(value) => Err(NotDrawn::LeftOut(format!("{name} is {value}, so it encloses no area"))),
            None => Err(NotDrawn::LeftOut(format!("it has no {name}, so it encloses no area"))),
        }
    }

    fn path(&self) -> Result<BezPath, NotDrawn> {
        match self.node.tag_name().name() {
            "path" => {
                let d = self.node.attribute("d").ok_or_else(|| NotDrawn::LeftOut("it has no d".to_owned()))?;
                if has_large_numbers(d) {
                    return Err(NotDrawn::LeftOut(format!("it has a number of more than {DIGITS} digits")));
                }
                BezPath::from_svg(d).map_err(|error| NotDrawn::Wrong(format!("path: {error}")))
            }
            "rect" => self.rect(),
            "circle" => {
                let r = self.positive("r", Side::Diagonal)?;
                self.ellipse(r, r)
            }
            // A radius that is not given is the other one.
            "ellipse" => {
                match ["rx", "ry"].map(|radius| self.node.attribute(radius).is_some_and(|text| text.trim() != "auto")) {
                    [true, false] => self.positive("rx", Side::Width).and_then(|r| self.ellipse(r, r)),
                    [false, true] => self.positive("ry", Side::Height).and_then(|r| self.ellipse(r, r)),
                    _ => self.ellipse(self.positive("rx", Side::Width)?, self.positive("ry", Side::Height)?),
                }
            }
            "line" => {
                let mut path = BezPath::new();
                path.move_to((self.or_zero("x1", Side::Width)?, self.or_zero("y1", Side::Height)?));
                path.line_to((self.or_zero("x2", Side::Width)?, self.or_zero("y2", Side::Height)?));
                Ok(path)
            }
            name => self.points(name == "polygon"),
        }
    }

    fn ellipse(&self, rx: f64, ry: f64) -> Result<BezPath, NotDrawn> {
        let centre = (self.or_zero("cx", Side::Width)?, self.or_zero("cy", Side::Height)?);
        Ok(curve(&Ellipse::new(centre, (rx, ry), 0.0), rx.max(ry)))
    }

    fn rect(&self) -> Result<BezPath, NotDrawn> {
        let (x, y) = (self.or_zero("x", Side::Width)?, self.or_zero("y", Side::Height)?);
        let (width, height) = (self.positive("width", Side::Width)?, self.positive("height", Side::Height)?);
        let (rx, ry) = (self.given("rx", Side::Width)?, self.given("ry", Side::Height)?);
        // A radius that is not given is the other one; none is longer than half its side.
        let (rx, ry) = (rx.or(ry).unwrap_or(0.0).min(0.5 * width), ry.or(rx).unwrap_or(0.0).min(0.5 * height));
        if !(rx > 0.0 && ry > 0.0) {
            return Ok(Rect::new(x, y, x + width, y + height).to_path(ACCURACY));
        }
        // Corners of circles, drawn out.
        let stretch = rx / ry;
        let rounded = RoundedRect::new(0.0, 0.0, width / stretch, height, ry);
        let place = Affine::translate((x, y)) * Affine::scale_non_uniform(stretch, 1.0);
        Ok(place * curve(&rounded, ry))
    }

    fn points(&self, is_closed: bool) -> Result<BezPath, NotDrawn> {
        let mut path = BezPath::new();
        let text = self.node.attribute("points").unwrap_or("");
        for (i, (x, y)) in svgtypes::PointsParser::from(text).enumerate() {
            if i == 0 { path.move_to((x, y)) } else { path.line_to((x, y)) }
        }
        if path.elements().is_empty() {
            return Err(NotDrawn::LeftOut("it has no points".to_owned()));
        }
        if is_closed {
            path.close_path();
        }
        Ok(path)
    }
}

/// The path of a curve with this radius. Beyond all digits it is refused with all other coordinates that are.
fn curve(shape: &impl kurbo::Shape, radius: f64) -> BezPath {
    if radius.is_normal() && radius < 10f64.powi(DIGITS as i32) {
        return shape.to_path(ACCURACY * radius);
    }
    let mut path = BezPath::new();
    path.move_to((f64::NAN, f64::NAN));
    path
}

/// The path of an element.
pub(super) fn path(node: Node<'_, '_>, viewport: Viewport) -> Result<BezPath, NotDrawn> {
    Attributes { node, viewport }.path()
}

/// Whether a number has more digits before its point than any drawing needs: how many curves an arc becomes grows
/// with it.
pub(super) fn has_large_numbers(d: &str) -> bool {
    let (mut whole, mut fraction) = (0, false);
    // The sign and the digits of a power of ten.
    let mut power: Option<(bool, usize)> = None;
    for c in d.bytes() {
        match (c, &mut power) {
            (b'0'..=b'9', Some((negative, power))) => {
                *power = (10 * *power + usize::from(c - b'0')).min(1000);
                if *power >= DIGITS && !*negative {
                    return true;
                }
            }
            (b'0'..=b'9', None) => {
                whole += usize::from(!fraction && (whole > 0 || c != b'0'));
                if whole > DIGITS {
                    return true;
                }
            }
            (b'.', None) => fraction = true,
            (b'e' | b'E', None) => power = Some((false, 0)),
            (b'-', Some((negative, 0))) => *negative = true,
            (b'+', Some((_, 0))) => {}
            _ => (whole, fraction, power) = (0, c == b'.', None),
        }
    }
    false
}

/// Subpaths as lines of points, y upwards, each with whether it is closed; none where its coordinates are no numbers.
pub(super) fn flattened(path: BezPath) -> Option<Vec<(Vec<Point2>, bool)>> {
    if !path.elements().iter().all(PathEl::is_finite) {
        return None;
    }
    let size = path.bounding_box();
    let longer = size.width().max(size.height());
    if !longer.is_finite() {
        return None;
    }
    let tolerance = FLATNESS * longer.max(f64::MIN_POSITIVE / FLATNESS);
    let mut parts: Vec<(Vec<Point2>, bool)> = Vec::new();
    kurbo::flatten(path, tolerance, |element| match element {
        PathEl::MoveTo(p) => parts.push((vec![Point2::new(p.x, -p.y)], false)),
        PathEl::LineTo(p) => {
            if let Some((points, closed)) = parts.last_mut() {
                if *closed {
                    // After its end a closed part goes on from its beginning.
                    let start = points[0];
                    parts.push((vec![start, Point2::new(p.x, -p.y)], false));
                } else {
                    points.push(Point2::new(p.x, -p.y));
                }
            }
        }
        PathEl::ClosePath => {
            if let Some(part) = parts.last_mut() {
                part.1 = true;
            }
        }
        _ => {}
    });
    // A move alone draws nothing.
    parts.retain(|(points, _)| points.len() > 1);
    Some(parts)
}
