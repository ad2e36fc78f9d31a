//! Scatter and line charts for print in black and white: panels in a grid, one legend above them.
//!
//! Series are told apart by marker shape, filling and dash pattern, never by colour. What has no place on the axes is
//! left out (a line breaks there), except failures: a chart that hides what did not work misleads, so a failure without
//! a finite coordinate is drawn at the far end of that axis.
//!
//! The drawing is written by hand: dash patterns, marker shapes, log ticks and a legend outside the axes are most of
//! what a chart of this kind is, and none of them comes with the plotting crates that write SVG without fonts.

mod axis;
mod draw;

use std::fmt::Write as _;

pub use axis::{Axis, Scale};

/// Shape of a marker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marker {
    /// None: a line only.
    None,
    /// Circle.
    Circle,
    /// Square.
    Square,
    /// Triangle, tip up.
    Triangle,
    /// Triangle, tip down.
    TriangleDown,
    /// Square on its tip.
    Diamond,
    /// Upright cross, never filled.
    Plus,
    /// A small dot: for cells of a map.
    Dot,
}

/// Pattern of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dash {
    /// ———
    Solid,
    /// – – –
    Dashed,
    /// · · ·
    Dotted,
    /// – · –
    DashDot,
}

/// Points that belong together.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name in the legend; series of several panels with the same name and look share one entry. Empty: no entry.
    pub label: String,
    /// Marker at every point.
    pub marker: Marker,
    /// Whether markers are filled.
    pub filled: bool,
    /// Line through the points in their order.
    pub line: Option<Dash>,
    /// Points (x, y).
    pub points: Vec<(f64, f64)>,
    /// Where it failed: × over the open marker. A coordinate that is not finite stands for the far end of its axis.
    pub failures: Vec<(f64, f64)>,
}

impl Series {
    /// Markers without a line.
    pub fn scatter(label: &str, marker: Marker, filled: bool, points: Vec<(f64, f64)>) -> Self {
        Self { label: label.to_owned(), marker, filled, line: None, points, failures: Vec::new() }
    }

    /// A line without markers.
    pub fn curve(label: &str, dash: Dash, points: Vec<(f64, f64)>) -> Self {
        Self {
            label: label.to_owned(),
            marker: Marker::None,
            filled: false,
            line: Some(dash),
            points,
            failures: Vec::new(),
        }
    }

    fn same_look(&self, other: &Self) -> bool {
        (&self.label, self.marker, self.filled, self.line) == (&other.label, other.marker, other.filled, other.line)
    }
}

/// Which coordinate a reference line fixes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    /// Upright line at this x.
    X(f64),
    /// Level line at this y.
    Y(f64),
}

/// A line across a panel, with its name beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct ReferenceLine {
    /// Name; may be empty.
    pub label: String,
    /// Where.
    pub at: Place,
    /// Pattern.
    pub dash: Dash,
}

/// A short text beside a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Note {
    /// The point.
    pub at: (f64, f64),
    /// What it says.
    pub text: String,
}

/// One pair of axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Title.
    pub title: String,
    /// Abscissa.
    pub x: Axis,
    /// Ordinate.
    pub y: Axis,
    /// What is drawn, first below.
    pub series: Vec<Series>,
    /// Lines across.
    pub lines: Vec<ReferenceLine>,
    /// Texts beside points.
    pub notes: Vec<Note>,
}

impl Panel {
    /// An empty panel.
    pub fn new(title: &str, x: Axis, y: Axis) -> Self {
        Self { title: title.to_owned(), x, y, series: Vec::new(), lines: Vec::new(), notes: Vec::new() }
    }
}

/// Panels in a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Title.
    pub title: String,
    /// A sentence below the title; may be empty.
    pub caption: String,
    /// Panels, row by row.
    pub panels: Vec<Panel>,
    /// Panels per row.
    pub columns: usize,
}

/// Width of the picture with one, two, and more columns, px.
const WIDTHS: [f64; 3] = [560.0, 860.0, 1120.0];
const PANEL_HEIGHT: f64 = 300.0;
const LEGEND_ROW: f64 = 20.0;

impl Figure {
    /// The figure as one self-contained SVG document.
    pub fn svg(&self) -> String {
        let columns = self.columns.clamp(1, self.panels.len().max(1));
        let width = WIDTHS[columns.min(WIDTHS.len()) - 1];
        let rows = self.panels.len().div_ceil(columns);
        let mut body = String::new();
        let mut y = 28.0;
        draw::text(&mut body, [width / 2.0, y], "middle", "font-size=\"17\" font-weight=\"bold\"", &self.title);
        if !self.caption.is_empty() {
            y += 20.0;
            draw::text(&mut body, [width / 2.0, y], "middle", "font-size=\"13\"", &self.caption);
        }
        y = self.legend(&mut body, width, y + 14.0);
        let panel_width = width / columns as f64;
        for (i, panel) in self.panels.iter().enumerate() {
            let corner = [panel_width * (i % columns) as f64, y + PANEL_HEIGHT * (i / columns) as f64];
            draw::panel(&mut body, panel, corner, [panel_width, PANEL_HEIGHT]);
        }
        let height = y + PANEL_HEIGHT * rows as f64 + 8.0;
        let mut out = String::new();
        let _ = write!(
            out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" \
             font-family=\"Helvetica, Arial, DejaVu Sans, sans-serif\" font-size=\"12\" role=\"img\">\n<title>{}</title>\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n{body}</svg>\n",
            draw::escape(&self.title)
        );
        out
    }

    /// Draws the legend from `y` down, in centred rows; returns where the panels begin.
    fn legend(&self, out: &mut String, width: f64, y: f64) -> f64 {
        let mut entries: Vec<Series> = Vec::new();
        for series in self.panels.iter().flat_map(|p| &p.series) {
            if !series.label.is_empty() && !entries.iter().any(|e| e.same_look(series)) {
                entries.push(series.clone());
            }
        }
        if self.panels.iter().any(|p| p.series.iter().any(|s| !s.failures.is_empty())) {
            entries.push(Series {
                failures: vec![(0.0, 0.0)],
                ..Series::scatter("failed", Marker::None, false, Vec::new())
            });
        }
        let sizes: Vec<f64> = entries.iter().map(|e| 56.0 + 6.6 * e.label.chars().count() as f64).collect();
        let (mut first, mut y) = (0, y);
        while first < entries.len() {
            let mut last = first + 1;
            let mut size = sizes[first];
            while last < entries.len() && size + sizes[last] <= width - 40.0 {
                size += sizes[last];
                last += 1;
            }
            let mut x = (width - size) / 2.0;
            for (entry, size) in entries[first..last].iter().zip(&sizes[first..last]) {
                draw::legend_entry(out, entry, [x, y]);
                x += size;
            }
            y += LEGEND_ROW;
            first = last;
        }
        y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(series: Vec<Series>) -> Figure {
        let panel = Panel { series, ..Panel::new("a < b & c", Axis::log("x \"quoted\""), Axis::linear("y")) };
        Figure { title: "t".into(), caption: String::new(), panels: vec![panel], columns: 1 }
    }

    fn count(svg: &str, what: &str) -> usize {
        svg.matches(what).count()
    }

    #[test]
    fn text_is_escaped_and_the_same_figure_gives_the_same_bytes() {
        let f = figure(vec![]);
        assert!(f.svg().contains("a &lt; b &amp; c") && f.svg().contains("x &quot;quoted&quot;"));
        assert_eq!(f.svg(), f.svg());
    }

    #[test]
    fn points_without_a_place_are_left_out_and_break_the_line() {
        let points = vec![(1.0, 1.0), (10.0, 2.0), (f64::NAN, 2.0), (100.0, f64::INFINITY), (-1.0, 1.0), (1e3, 3.0)];
        let series = Series { line: Some(Dash::Solid), ..Series::scatter("", Marker::Circle, true, points) };
        let svg = figure(vec![series]).svg();
        assert_eq!(count(&svg, "<circle"), 3);
        // One piece through the first two; the last point stands alone.
        assert_eq!(count(&svg, "<polyline"), 1);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn failures_are_never_left_out() {
        let series = Series {
            failures: vec![(10.0, f64::NAN), (f64::INFINITY, 1.0), (0.0, 0.5)],
            ..Series::scatter("", Marker::Square, true, vec![(1.0, 1.0)])
        };
        let svg = figure(vec![series]).svg();
        assert_eq!(count(&svg, "class=\"failed\""), 4, "three and their entry in the legend");
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn the_legend_names_a_look_once() {
        let series = Series::scatter("scni", Marker::Square, true, vec![(1.0, 1.0)]);
        let other = Series { filled: false, ..series.clone() };
        assert_eq!(count(&figure(vec![series.clone(), series.clone()]).svg(), ">scni<"), 1);
        assert_eq!(count(&figure(vec![series, other]).svg(), ">scni<"), 2);
    }

    #[test]
    fn empty_series_and_figures_are_drawn() {
        assert!(figure(vec![Series::curve("none", Dash::Dotted, vec![])]).svg().ends_with("</svg>\n"));
        let empty = Figure { title: String::new(), caption: String::new(), panels: vec![], columns: 3 };
        assert!(empty.svg().ends_with("</svg>\n"));
    }

    #[test]
    fn lines_end_at_the_axes() {
        let panel = Panel {
            series: vec![Series::curve("", Dash::Solid, vec![(-10.0, 0.5), (10.0, 0.5)])],
            ..Panel::new("", Axis::linear("x").range(0.0, 1.0), Axis::linear("y").range(0.0, 1.0))
        };
        let f = Figure { title: String::new(), caption: String::new(), panels: vec![panel], columns: 1 };
        let inner = draw::inner([0.0, 0.0], [WIDTHS[0], PANEL_HEIGHT]);
        let ends = format!("{:.1},", inner.0[0]);
        assert!(f.svg().contains(&format!("points=\"{ends}")), "{}", f.svg());
    }
}
