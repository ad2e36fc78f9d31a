//! Shapes of a chart as SVG text.

use super::axis::Settled;
use super::{Dash, Marker, Panel, Place, Series};
use std::fmt::Write as _;

type Px = [f64; 2];

/// Room for labels left of, above, right of and below the axes, px.
const MARGIN: [f64; 4] = [62.0, 30.0, 18.0, 46.0];
/// Half the size of a marker, px.
const SIZE: f64 = 4.2;

/// Text in XML.
pub(super) fn escape(text: &str) -> String {
    // Control characters are no XML at all.
    text.chars().filter(|c| !c.is_control()).fold(String::with_capacity(text.len()), |mut out, c| {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            other => out.push(other),
        }
        out
    })
}

pub(super) fn text(out: &mut String, [x, y]: Px, anchor: &str, attributes: &str, content: &str) {
    if !content.is_empty() {
        let content = escape(content);
        let _ = writeln!(out, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" {attributes}>{content}</text>");
    }
}

fn line(out: &mut String, a: Px, b: Px, attributes: &str) {
    let [x1, y1, x2, y2] = [a[0], a[1], b[0], b[1]];
    let _ = writeln!(out, "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" {attributes}/>");
}

fn pattern(dash: Dash) -> &'static str {
    match dash {
        Dash::Solid => "stroke=\"#000000\"",
        Dash::Dashed => "stroke=\"#000000\" stroke-dasharray=\"7 4\"",
        Dash::Dotted => "stroke=\"#000000\" stroke-dasharray=\"1.5 3.5\" stroke-linecap=\"round\"",
        Dash::DashDot => "stroke=\"#000000\" stroke-dasharray=\"8 3 1.5 3\"",
    }
}

fn marker(out: &mut String, shape: Marker, filled: bool, [x, y]: Px) {
    let fill = if filled { "#000000" } else { "#ffffff" };
    let polygon = |out: &mut String, corners: &[Px]| {
        let points: Vec<String> =
            corners.iter().map(|c| format!("{:.1},{:.1}", x + SIZE * c[0], y + SIZE * c[1])).collect();
        let _ = writeln!(
            out,
            "<polygon points=\"{}\" fill=\"{fill}\" stroke=\"#000000\" stroke-width=\"1.1\"/>",
            points.join(" ")
        );
    };
    match shape {
        Marker::None => {}
        Marker::Circle | Marker::Dot => {
            let r = if shape == Marker::Dot { 0.5 * SIZE } else { SIZE };
            let style = format!("fill=\"{fill}\" stroke=\"#000000\" stroke-width=\"1.1\"");
            let _ = writeln!(out, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r:.1}\" {style}/>");
        }
        Marker::Square => polygon(out, &[[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]]),
        Marker::Triangle => polygon(out, &[[-1.15, 0.85], [1.15, 0.85], [0.0, -1.2]]),
        Marker::TriangleDown => polygon(out, &[[-1.15, -0.85], [1.15, -0.85], [0.0, 1.2]]),
        Marker::Diamond => polygon(out, &[[-1.25, 0.0], [0.0, -1.25], [1.25, 0.0], [0.0, 1.25]]),
        Marker::Plus => {
            let stroke = "stroke=\"#000000\" stroke-width=\"1.6\"";
            line(out, [x - 1.2 * SIZE, y], [x + 1.2 * SIZE, y], stroke);
            line(out, [x, y - 1.2 * SIZE], [x, y + 1.2 * SIZE], stroke);
        }
    }
}

/// × over the open marker, so that it is seen whose failure it is.
fn failure(out: &mut String, shape: Marker, [x, y]: Px) {
    marker(out, shape, false, [x, y]);
    let s = 1.35 * SIZE;
    let _ = writeln!(
        out,
        "<path class=\"failed\" d=\"M{:.1},{:.1}L{:.1},{:.1}M{:.1},{:.1}L{:.1},{:.1}\" fill=\"none\" stroke=\"#000000\" stroke-width=\"1.5\"/>",
        x - s,
        y - s,
        x + s,
        y + s,
        x - s,
        y + s,
        x + s,
        y - s
    );
}

pub(super) fn legend_entry(out: &mut String, series: &Series, [x, y]: Px) {
    if let Some(dash) = series.line {
        line(out, [x, y], [x + 32.0, y], &format!("{} stroke-width=\"1.3\"", pattern(dash)));
    }
    marker(out, series.marker, series.filled, [x + 16.0, y]);
    if !series.failures.is_empty() && series.points.is_empty() {
        failure(out, Marker::None, [x + 16.0, y]);
    }
    text(out, [x + 38.0, y + 4.0], "start", "", &series.label);
}

/// Upper left corner and size of the axes inside a panel.
pub(super) fn inner(corner: Px, size: Px) -> (Px, Px) {
    let [left, top, right, bottom] = MARGIN;
    ([corner[0] + left, corner[1] + top], [size[0] - left - right, size[1] - top - bottom])
}

/// Where values lie on the paper.
struct Frame {
    x: Settled,
    y: Settled,
    corner: Px,
    size: Px,
}

impl Frame {
    /// Fractions along both axes, y up.
    fn fractions(&self, (x, y): (f64, f64)) -> Px {
        [self.x.fraction(x), self.y.fraction(y)]
    }

    fn paper(&self, [u, v]: Px) -> Px {
        [self.corner[0] + self.size[0] * u, self.corner[1] + self.size[1] * (1.0 - v)]
    }

    /// A point on the paper, if it lies within the axes.
    fn place(&self, point: (f64, f64)) -> Option<Px> {
        let f = self.fractions(point);
        f.iter().all(|t| (-1e-9..=1.0 + 1e-9).contains(t)).then(|| self.paper(f))
    }

    /// A failure's place: what has none goes to the far end.
    fn failure_place(&self, point: (f64, f64)) -> Px {
        self.paper(self.fractions(point).map(|t| if t.is_finite() { t.clamp(0.0, 1.0) } else { 1.0 }))
    }

    /// The part of a straight piece within the axes (Liang & Barsky).
    fn clip(&self, a: Px, b: Px) -> Option<(Px, Px)> {
        let (mut low, mut high) = (0.0_f64, 1.0_f64);
        for k in 0..2 {
            for (p, q) in [(a[k] - b[k], a[k]), (b[k] - a[k], 1.0 - a[k])] {
                if p == 0.0 && q < 0.0 {
                    return None;
                }
                if p < 0.0 {
                    low = low.max(q / p);
                } else if p > 0.0 {
                    high = high.min(q / p);
                }
            }
        }
        let at = |t: f64| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
        (low <= high).then(|| (at(low), at(high)))
    }

    fn polyline(&self, out: &mut String, points: &[(f64, f64)], dash: Dash) {
        let mut piece: Vec<Px> = Vec::new();
        let mut end = |piece: &mut Vec<Px>| {
            if piece.len() > 1 {
                let points: Vec<String> = piece.iter().map(|p| format!("{:.1},{:.1}", p[0], p[1])).collect();
                let _ = writeln!(
                    out,
                    "<polyline points=\"{}\" fill=\"none\" {} stroke-width=\"1.3\"/>",
                    points.join(" "),
                    pattern(dash)
                );
            }
            piece.clear();
        };
        for pair in points.windows(2) {
            let (a, b) = (self.fractions(pair[0]), self.fractions(pair[1]));
            let clipped = if a.iter().chain(&b).all(|t| t.is_finite()) { self.clip(a, b) } else { None };
            let Some((start, stop)) = clipped else {
                end(&mut piece);
                continue;
            };
            if piece.is_empty() || start != a {
                end(&mut piece);
                piece.push(self.paper(start));
            }
            piece.push(self.paper(stop));
        }
        end(&mut piece);
    }
}

pub(super) fn panel(out: &mut String, panel: &Panel, corner: Px, size: Px) {
    let (at, extent) = inner(corner, size);
    let all = || panel.series.iter().flat_map(|s| s.points.iter().chain(&s.failures));
    let fixed = |want_x: bool| {
        panel.lines.iter().filter_map(move |l| match l.at {
            Place::X(v) => want_x.then_some(v),
            Place::Y(v) => (!want_x).then_some(v),
        })
    };
    let frame = Frame {
        x: panel.x.settle(all().map(|p| p.0).chain(fixed(true))),
        y: panel.y.settle(all().map(|p| p.1).chain(fixed(false))),
        corner: at,
        size: extent,
    };
    axes(out, panel, &frame);
    let (right, bottom) = (at[0] + extent[0], at[1] + extent[1]);
    // White behind letters keeps them readable over lines.
    let halo = "font-size=\"11\" paint-order=\"stroke\" stroke=\"#ffffff\" stroke-width=\"3\"";
    for reference in &panel.lines {
        let stroke = format!("{} stroke-width=\"1\"", pattern(reference.dash));
        match reference.at {
            Place::X(x) => {
                let Some([x, _]) = frame.place((x, frame.y.low)) else { continue };
                line(out, [x, at[1]], [x, bottom], &stroke);
                let turned = format!("{halo} transform=\"rotate(-90 {:.1} {:.1})\"", x - 4.0, at[1] + 6.0);
                text(out, [x - 4.0, at[1] + 6.0], "end", &turned, &reference.label);
            }
            Place::Y(y) => {
                let Some([_, y]) = frame.place((frame.x.low, y)) else { continue };
                line(out, [at[0], y], [right, y], &stroke);
                let below = if y - at[1] < 14.0 { y + 13.0 } else { y - 4.0 };
                text(out, [right - 4.0, below], "end", halo, &reference.label);
            }
        }
    }
    for series in &panel.series {
        if let Some(dash) = series.line {
            frame.polyline(out, &series.points, dash);
        }
        for place in series.points.iter().filter_map(|p| frame.place(*p)) {
            marker(out, series.marker, series.filled, place);
        }
        for point in &series.failures {
            failure(out, series.marker, frame.failure_place(*point));
        }
    }
    for note in &panel.notes {
        if let Some([x, y]) = frame.place(note.at) {
            // Texts near the right edge go to the left of their point.
            let (x, anchor) = if x > right - 60.0 { (x - 7.0, "end") } else { (x + 7.0, "start") };
            text(out, [x, y - 5.0], anchor, halo, &note.text);
        }
    }
}

fn axes(out: &mut String, panel: &Panel, frame: &Frame) {
    let (at, extent) = (frame.corner, frame.size);
    let (right, bottom) = (at[0] + extent[0], at[1] + extent[1]);
    let grid = "stroke=\"#dddddd\" stroke-width=\"0.8\"";
    for (value, label) in panel.x.ticks_on(&frame.x) {
        let [x, _] = frame.paper([frame.x.fraction(value), 0.0]);
        line(out, [x, at[1]], [x, bottom], grid);
        text(out, [x, bottom + 16.0], "middle", "", &label);
    }
    for (value, label) in panel.y.ticks_on(&frame.y) {
        let [_, y] = frame.paper([0.0, frame.y.fraction(value)]);
        line(out, [at[0], y], [right, y], grid);
        text(out, [at[0] - 6.0, y + 4.0], "end", "", &label);
    }
    let [x, y, width, height] = [at[0], at[1], extent[0], extent[1]];
    let _ = writeln!(
        out,
        "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"none\" stroke=\"#000000\" stroke-width=\"1\"/>"
    );
    let middle = [0.5 * (at[0] + right), 0.5 * (at[1] + bottom)];
    text(out, [middle[0], at[1] - 9.0], "middle", "font-size=\"13\" font-weight=\"bold\"", &panel.title);
    text(out, [middle[0], bottom + 36.0], "middle", "", &panel.x.label);
    let left = at[0] - MARGIN[0] + 14.0;
    let turned = format!("transform=\"rotate(-90 {left:.1} {:.1})\"", middle[1]);
    text(out, [left, middle[1]], "middle", &turned, &panel.y.label);
}
