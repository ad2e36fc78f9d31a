//! One pair of axes and what is drawn between them.

use super::axis::Axis;
use super::drawing::Marker;
use super::style::Colour;

/// Pattern of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend; series with the same name and look share one entry. Empty: no entry.
    pub label: String,
    /// Colour of line and markers.
    pub colour: Colour,
    /// Marker at every point.
    pub marker: Option<Marker>,
    /// Whether markers are filled; at most one second property is told by this.
    pub filled: bool,
    /// Line through the points in their order.
    pub line: Option<Dash>,
    /// Points (x, y).
    pub points: Vec<(f64, f64)>,
    /// What is said of each point under the pointer; name and coordinates for those that have none.
    pub titles: Vec<String>,
    /// Where it failed: × over the open marker. One without a height stands in a band above the axes; one without an
    /// abscissa at their right end.
    pub failures: Vec<(f64, f64)>,
}

impl Series {
    /// Markers without a line.
    pub fn scatter(label: &str, colour: Colour, marker: Marker, points: Vec<(f64, f64)>) -> Self {
        Self {
            label: label.to_owned(),
            colour,
            marker: Some(marker),
            filled: true,
            line: None,
            points,
            titles: Vec::new(),
            failures: Vec::new(),
        }
    }

    /// A line without markers.
    pub fn curve(label: &str, colour: Colour, dash: Dash, points: Vec<(f64, f64)>) -> Self {
        Self { marker: None, line: Some(dash), ..Self::scatter(label, colour, Marker::Dot, points) }
    }

    /// The same with open markers.
    #[must_use]
    pub fn open(mut self) -> Self {
        self.filled = false;
        self
    }

    /// The same with a line through its points.
    #[must_use]
    pub fn joined(mut self, dash: Dash) -> Self {
        self.line = Some(dash);
        self
    }
}

/// Which coordinate a reference line fixes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// Upright line at this x; at the end of the axis for what lies beyond.
    X(f64),
    /// Level line at this y.
    Y(f64),
}

/// A line across a panel, named in the legend.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceLine {
    /// Name; may be empty.
    pub label: String,
    /// Where.
    pub at: Place,
    /// Pattern.
    pub dash: Dash,
}

impl ReferenceLine {
    /// A line of this name and pattern.
    pub fn new(label: &str, at: Place, dash: Dash) -> Self {
        Self { label: label.to_owned(), at, dash }
    }
}

/// Bars from zero, or from the lower end of an axis without zero; at least a pixel wide.
#[derive(Clone, Debug, PartialEq)]
pub struct Bars {
    /// Name in the legend; may be empty.
    pub label: String,
    /// Colour.
    pub colour: Colour,
    /// Left end, right end, height.
    pub bars: Vec<[f64; 3]>,
}

/// A strip over the whole height.
#[derive(Clone, Debug, PartialEq)]
pub struct Strip {
    /// Name in the legend.
    pub label: String,
    /// Ends along the abscissa.
    pub range: [f64; 2],
}

/// A short text beside a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Note {
    /// The point.
    pub at: (f64, f64),
    /// What it says.
    pub text: String,
}

/// One pair of axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Title: the answer to the question that the chart is looked at for.
    pub title: String,
    /// What it shows, for people who do not see it; the title where empty.
    pub description: String,
    /// Abscissa.
    pub x: Axis,
    /// Ordinate.
    pub y: Axis,
    /// Strips, below all else.
    pub strips: Vec<Strip>,
    /// Bars.
    pub bars: Vec<Bars>,
    /// Lines across.
    pub lines: Vec<ReferenceLine>,
    /// What is drawn over these, first below.
    pub series: Vec<Series>,
    /// Texts beside points, each where nothing else is drawn; left out where no such place is near.
    pub notes: Vec<Note>,
    /// Whether there is a hidden line of class `cursor`, which a page moves along the abscissa.
    pub cursor: bool,
}

impl Panel {
    /// An empty panel.
    pub fn new(title: &str, x: Axis, y: Axis) -> Self {
        Self {
            title: title.to_owned(),
            description: String::new(),
            x,
            y,
            strips: Vec::new(),
            bars: Vec::new(),
            lines: Vec::new(),
            series: Vec::new(),
            notes: Vec::new(),
            cursor: false,
        }
    }
}
