//! Panels as shapes: heading, axes, marks, legend, from top to bottom.

use super::axis::Axis;
use super::drawing::{Anchor, Drawing, MARKER, TEXT, TITLE, text_width, wrap};
use super::legend::{Key, Legend};
use super::notes::{self, Box2, Name};
use super::number::number;
use super::panel::{Bars, Dash, Panel, Place, ReferenceLine, Series};
use super::plot_area::PlotArea;
use super::style::Colour;

/// Height of the rectangle between the axes, px.
const PLOT: f64 = 196.0;
/// Height of the band of failures without a value, px.
const BAND: f64 = 18.0;
/// Heights of a line of the title and of other text, px.
const TITLE_LINE: f64 = 17.0;
pub(super) const LINE: f64 = 15.0;
/// Room right of the axes for half a tick label, and left of them for the widest, at least, px.
pub(super) const RIGHT: f64 = 16.0;
const LEFT: f64 = 30.0;
/// From the axis to its tick labels, px.
pub(super) const TICK: f64 = 7.0;

impl Panel {
    /// The panel with its legend below, this wide in px.
    pub fn drawing(&self, width: f64) -> Drawing {
        let layout = Layout::new(self, width);
        draw(self, &layout, layout.head(), &layout.legend)
    }

    /// Left and right end of the abscissa on a drawing of this width, px, and what they stand for.
    pub fn horizontal_span(&self, width: f64) -> [f64; 4] {
        Layout::new(self, width).horizontal_span()
    }
}

fn dashes(dash: Dash) -> &'static str {
    match dash {
        Dash::Solid => "",
        Dash::Dashed => " dashed",
        Dash::Dotted => " dotted",
        Dash::DashDot => " dashdot",
    }
}

fn line_class(colour: Colour, dash: Dash) -> String {
    format!("line {}{}", colour.class(), dashes(dash))
}

fn mark_class(series: &Series, filled: bool) -> String {
    format!("mark {}{}", series.colour.class(), if filled { "" } else { " open" })
}

fn reference_class(line: &ReferenceLine) -> String {
    format!("reference{}", dashes(line.dash))
}

fn bar_class(bars: &Bars) -> String {
    format!("area {}", bars.colour.class())
}

/// What a panel needs of the paper.
#[derive(Debug)]
pub(super) struct Layout {
    title: Vec<String>,
    ordinate: Vec<String>,
    abscissa: Vec<String>,
    frame: PlotArea,
    width: f64,
    /// Height of the tick labels below the axes, px.
    ticks: f64,
    pub(super) legend: Legend,
}

impl Layout {
    pub(super) fn new(panel: &Panel, width: f64) -> Self {
        let all = || panel.series.iter().flat_map(|s| s.points.iter().chain(&s.failures));
        let bars = || panel.bars.iter().flat_map(|b| &b.bars);
        let on_y = panel.lines.iter().filter_map(|l| if let Place::Y(y) = l.at { Some(y) } else { None });
        let x = panel.x.settle(all().map(|p| p.0).chain(bars().flat_map(|b| [b[0], b[1]])));
        let y = panel.y.settle(all().map(|p| p.1).chain(bars().map(|b| b[2])).chain(on_y));
        let failed = panel.series.iter().flat_map(|s| &s.failures).any(|p| !y.fraction(p.1).is_finite());
        let band = if failed { BAND } else { 0.0 };
        let labels = y.ticks.iter().map(|tick| tick.1.as_str()).chain(failed.then_some("failed"));
        let left = labels.map(|label| text_width(label, TEXT)).fold(LEFT, f64::max) + TICK + 2.0;
        let rows = x.ticks.iter().map(|tick| tick.1.split('\n').count()).max().unwrap_or(0);
        // Half of a tick's label at the end of the axis is beyond it.
        let room = width - left - RIGHT;
        let beyond = |(value, label): &(f64, String)| {
            let widest = label.lines().map(|line| text_width(line, TEXT)).fold(0.0, f64::max);
            0.5 * widest - (1.0 - x.fraction(*value)) * room
        };
        let right = x.ticks.iter().map(beyond).filter(|beyond| beyond.is_finite()).fold(RIGHT, f64::max);
        let size = [(width - left - right).max(40.0), PLOT];
        Self {
            title: wrap(&panel.title, width, TITLE),
            ordinate: wrap(&y.label, width, TEXT),
            abscissa: wrap(&x.label, size[0], TEXT),
            ticks: LINE * rows as f64,
            frame: PlotArea { x, y, corner: [left, 0.0], size, band },
            width,
            legend: legend(panel),
        }
    }

    /// Height of everything above the axes, px.
    pub(super) fn head(&self) -> f64 {
        TITLE_LINE * self.title.len() as f64 + LINE * self.ordinate.len() as f64 + 8.0 + self.frame.band
    }

    pub(super) fn horizontal_span(&self) -> [f64; 4] {
        let [low, high] = self.frame.x.range;
        [self.frame.corner[0], self.frame.right(), low, high]
    }
}

fn legend(panel: &Panel) -> Legend {
    let mut legend = Legend::default();
    for strip in &panel.strips {
        legend.add(Key::Area("strip".to_owned()), &strip.label);
    }
    for bars in &panel.bars {
        legend.add(Key::Area(bar_class(bars)), &bars.label);
    }
    for series in &panel.series {
        let line = series.line.map(|dash| line_class(series.colour, dash));
        let marker = series.marker.map(|marker| (marker, mark_class(series, series.filled)));
        legend.add(Key::Series(line, marker), &series.label);
    }
    for line in &panel.lines {
        legend.add(Key::Series(Some(reference_class(line)), None), &line.label);
    }
    if panel.series.iter().any(|series| !series.failures.is_empty()) {
        legend.add(Key::Failed, "failed");
    }
    legend
}

/// The panel with the axes `head` below its upper edge, and this legend.
pub(super) fn draw(panel: &Panel, layout: &Layout, head: f64, legend: &Legend) -> Drawing {
    let below = 6.0 + layout.ticks + LINE * layout.abscissa.len() as f64 + 8.0;
    let height = head + PLOT + below + legend.height(layout.width - LEFT);
    let label = if panel.description.is_empty() { &panel.title } else { &panel.description };
    let mut drawing = Drawing::new([layout.width, height], label.clone());
    let frame = PlotArea { corner: [layout.frame.corner[0], head], ..layout.frame.clone() };
    for (i, line) in layout.title.iter().enumerate() {
        drawing.text("title", [0.0, 13.0 + TITLE_LINE * i as f64], Anchor::Start, line);
    }
    // The ordinate's name stays close to its axis, however many lines the titles beside this one have.
    let first = frame.top() - 12.0 - LINE * (layout.ordinate.len().saturating_sub(1)) as f64;
    for (i, line) in layout.ordinate.iter().enumerate() {
        drawing.text("muted", [0.0, first + LINE * i as f64], Anchor::Start, line);
    }
    axes(&mut drawing, &frame);
    frame_for_reading(&mut drawing, panel, &frame);
    let first = frame.bottom() + 6.0 + layout.ticks + 12.0;
    for (i, line) in layout.abscissa.iter().enumerate() {
        let middle = frame.corner[0] + 0.5 * frame.size[0];
        drawing.text("muted", [middle, first + LINE * i as f64], Anchor::Middle, line);
    }
    marks(&mut drawing, panel, &frame);
    legend.draw(&mut drawing, [LEFT, head + PLOT + below], layout.width - LEFT);
    drawing
}

/// The rectangle between the axes with what it stands for, for a page that tells values under the pointer.
fn frame_for_reading(drawing: &mut Drawing, panel: &Panel, frame: &PlotArea) {
    let unit = |axis: &Axis| if axis.unit == "1" { String::new() } else { axis.unit.clone() };
    drawing.data_rectangle(
        "frame",
        [frame.corner, frame.size],
        &[
            ("x", &frame.x.span()),
            ("y", &frame.y.span()),
            ("x-name", &panel.x.quantity),
            ("x-unit", &unit(&panel.x)),
            ("y-unit", &unit(&panel.y)),
        ],
    );
}

/// The axes of a rectangle: lines, ticks with their labels, and lines across it.
pub(super) fn axes(drawing: &mut Drawing, frame: &PlotArea) {
    let [left, top] = frame.corner;
    let (right, bottom) = (frame.right(), frame.bottom());
    let mut free = f64::NEG_INFINITY;
    for (value, label) in &frame.x.ticks {
        let [x, _] = frame.clamped((*value, frame.y.range[0]));
        if frame.x.grid {
            drawing.line("grid", [x, frame.top()], [x, bottom]);
        }
        drawing.line("axis", [x, bottom], [x, bottom + 4.0]);
        // Numbers too close to the one before are left out; names are not.
        let half = 0.5 * text_width(label, TEXT);
        if frame.x.grid && x - half < free {
            continue;
        }
        free = x + half + 3.0;
        for (i, line) in label.split('\n').enumerate() {
            drawing.text("tick", [x, bottom + 17.0 + LINE * i as f64], Anchor::Middle, line);
        }
    }
    let mut free = f64::INFINITY;
    for (value, label) in &frame.y.ticks {
        let [_, y] = frame.clamped((frame.x.range[0], *value));
        if frame.y.grid {
            drawing.line("grid", [left, y], [right, y]);
        }
        drawing.line("axis", [left - 4.0, y], [left, y]);
        if frame.y.grid && y + 0.5 * TEXT > free {
            continue;
        }
        free = y - 0.5 * TEXT;
        // Beside the band's name there is no room for a tick's.
        if frame.band == 0.0 || y > top + 6.0 {
            drawing.text("tick", [left - TICK, y + 4.0], Anchor::End, label);
        }
    }
    if frame.band > 0.0 {
        drawing.rectangle("band", [left, frame.top()], [frame.size[0], frame.band]);
        drawing.text("tick", [left - TICK, top - 0.5 * frame.band + 4.0], Anchor::End, "failed");
    }
    drawing.line("axis", [left, bottom], [right, bottom]);
    drawing.line("axis", [left, frame.top()], [left, bottom]);
}

fn marks(drawing: &mut Drawing, panel: &Panel, frame: &PlotArea) {
    let (top, bottom) = (frame.top(), frame.bottom());
    for strip in &panel.strips {
        let [from, to] = strip.range.map(|x| frame.clamped((x, frame.y.range[0]))[0]);
        drawing.rectangle("strip", [from, top], [to - from, bottom - top]);
    }
    for bars in &panel.bars {
        for [from, to, value] in &bars.bars {
            let zero = if frame.y.fraction(0.0).is_finite() { 0.0 } else { frame.y.range[0] };
            let ([left, y], [right, base]) = (frame.clamped((*from, *value)), frame.clamped((*to, zero)));
            drawing.rectangle(&bar_class(bars), [left, y.min(base)], [(right - left).max(1.0), (base - y).abs()]);
        }
    }
    for line in &panel.lines {
        let class = reference_class(line);
        match line.at {
            Place::X(x) => {
                let [x, _] = frame.clamped((x, frame.y.range[0]));
                drawing.line(&class, [x, top], [x, bottom]);
            }
            Place::Y(y) => {
                if let Some([left, y]) = frame.place((frame.x.range[0], y)) {
                    drawing.line(&class, [left, y], [frame.right(), y]);
                }
            }
        }
    }
    let mut taken = Vec::new();
    for series in &panel.series {
        draw_series(drawing, series, frame, &mut taken);
    }
    let placed: Vec<Name<'_>> = panel
        .notes
        .iter()
        .filter_map(|note| Some(Name { at: frame.place(note.at)?, text: &note.text, towards: None }))
        .collect();
    let within = Box2 { low: frame.corner, high: [frame.right(), bottom] };
    notes::draw(drawing, &placed, taken, within);
    if panel.cursor {
        drawing.line("cursor", [frame.corner[0], top], [frame.corner[0], bottom]);
    }
}

/// Draws a series and adds what it covers.
fn draw_series(drawing: &mut Drawing, series: &Series, frame: &PlotArea, taken: &mut Vec<Box2>) {
    if let Some(dash) = series.line {
        for piece in frame.pieces(&series.points) {
            drawing.named_polyline(&line_class(series.colour, dash), &series.label, &piece);
            taken.extend(notes::along(&piece));
        }
    }
    let Some(marker) = series.marker else { return };
    let class = mark_class(series, series.filled);
    for (i, point) in series.points.iter().enumerate() {
        let Some(at) = frame.place(*point) else { continue };
        drawing.open_titled(&title(series, i, *point));
        drawing.marker(marker, &class, at);
        drawing.close_group();
        taken.push(Box2::around(at, MARKER + 1.0));
    }
    for point in &series.failures {
        let at = frame.failure(*point);
        drawing.marker(marker, &mark_class(series, false), at);
        drawing.cross("failed", at);
        taken.push(Box2::around(at, MARKER + 1.0));
    }
}

fn title(series: &Series, i: usize, (x, y): (f64, f64)) -> String {
    series.titles.get(i).cloned().unwrap_or_else(|| {
        let name = if series.label.is_empty() { String::new() } else { format!("{}: ", series.label) };
        format!("{name}{}, {}", number(x, 4), number(y, 4))
    })
}
