//! A chart: two axes, marks in their coordinates, a legend below.

use super::axis::Axis;
use super::svg::{Anchor, Drawing, Marker, Px};

/// Size of a chart without its legend, px: legible at the width of a phone.
const SIZE: Px = [420.0, 286.0];
/// Room around the plot: left, top, right, bottom, px.
const LEFT: f64 = 46.0;
const TOP: f64 = 46.0;
const RIGHT: f64 = 18.0;
const BOTTOM: f64 = 40.0;
/// Height of a row of the legend, and how wide a letter is, px.
const ROW: f64 = 18.0;
const LETTER: f64 = 6.3;
/// Width of a sample of a line in the legend, px.
const SAMPLE: f64 = 26.0;

/// How an entry of the legend looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Key {
    Line,
    Marker(Marker),
    Area,
}

/// A chart in the making.
#[derive(Debug)]
pub(super) struct Chart {
    drawing: Drawing,
    x: Axis,
    y: Axis,
    legend: Vec<(Key, &'static str, String)>,
}

impl Chart {
    /// `title` above the chart, `label` for people who do not see it.
    pub(super) fn new(title: &str, label: &str, x: Axis, y: Axis) -> Self {
        let mut chart = Self { drawing: Drawing::new(SIZE, label), x, y, legend: Vec::new() };
        chart.draw_axes(title);
        chart
    }

    fn draw_axes(&mut self, title: &str) {
        let [left, right] = [LEFT, SIZE[0] - RIGHT];
        let [top, bottom] = [TOP, SIZE[1] - BOTTOM];
        self.drawing.text("title", [2.0, 15.0], Anchor::Start, title);
        self.drawing.text("muted", [2.0, 34.0], Anchor::Start, &self.y.label.clone());
        self.drawing.text("muted", [0.5 * (left + right), SIZE[1] - 5.0], Anchor::Middle, &self.x.label.clone());
        for (value, label) in self.x.ticks.clone() {
            let x = self.px([value, self.y.range[0]])[0];
            if self.x.grid {
                self.drawing.line("grid", [x, top], [x, bottom]);
            }
            self.drawing.line("axis", [x, bottom], [x, bottom + 4.0]);
            self.drawing.text("tick", [x, bottom + 17.0], Anchor::Middle, &label);
        }
        for (value, label) in self.y.ticks.clone() {
            let y = self.px([self.x.range[0], value])[1];
            if self.y.grid {
                self.drawing.line("grid", [left, y], [right, y]);
            }
            self.drawing.line("axis", [left - 4.0, y], [left, y]);
            self.drawing.text("tick", [left - 7.0, y + 4.0], Anchor::End, &label);
        }
        self.drawing.line("axis", [left, bottom], [right, bottom]);
        self.drawing.line("axis", [left, top], [left, bottom]);
    }

    /// Where a point of the chart is, px.
    fn px(&self, [x, y]: [f64; 2]) -> Px {
        let width = SIZE[0] - LEFT - RIGHT;
        let height = SIZE[1] - TOP - BOTTOM;
        [LEFT + self.x.fraction(x) * width, SIZE[1] - BOTTOM - self.y.fraction(y) * height]
    }

    /// A line through points; `class` carries colour and dashes.
    pub(super) fn line(&mut self, class: &'static str, name: &str, points: impl IntoIterator<Item = [f64; 2]>) {
        let points: Vec<Px> = points.into_iter().map(|point| self.px(point)).collect();
        self.drawing.polyline(class, &points);
        self.entry(Key::Line, class, name);
    }

    /// Markers at points.
    pub(super) fn markers(
        &mut self,
        marker: Marker,
        class: &'static str,
        name: &str,
        points: impl IntoIterator<Item = [f64; 2]>,
    ) {
        for point in points {
            let point = self.px(point);
            self.drawing.marker(marker, class, point);
        }
        self.entry(Key::Marker(marker), class, name);
    }

    /// A line between two points without a name.
    pub(super) fn segment(&mut self, class: &str, from: [f64; 2], to: [f64; 2]) {
        let [from, to] = [self.px(from), self.px(to)];
        self.drawing.line(class, from, to);
    }

    /// A strip over the whole height.
    pub(super) fn strip(&mut self, class: &'static str, name: &str, from: f64, to: f64) {
        let [left, right] = [from, to].map(|x| self.px([x, self.y.range[0]])[0]);
        self.drawing.rectangle(class, [left, TOP], [right - left, SIZE[1] - TOP - BOTTOM]);
        self.entry(Key::Area, class, name);
    }

    /// Bars from the bottom, at least a pixel wide: left, right, height.
    pub(super) fn bars(&mut self, class: &str, bars: impl IntoIterator<Item = [f64; 3]>) {
        for [from, to, value] in bars {
            let [left, top] = self.px([from, value]);
            let right = self.px([to, value])[0];
            self.drawing.rectangle(class, [left, top], [(right - left).max(1.0), SIZE[1] - BOTTOM - top]);
        }
    }

    /// A vertical line with words at its upper end, in this row; at the end of the axis for what lies beyond.
    pub(super) fn mark(&mut self, class: &'static str, x: f64, words: &str, row: u32) {
        let at = self.px([x, self.y.range[0]])[0].clamp(LEFT, SIZE[0] - RIGHT);
        self.drawing.line(class, [at, TOP], [at, SIZE[1] - BOTTOM]);
        let left = at > 0.7 * SIZE[0];
        let (anchor, shift) = if left { (Anchor::End, -4.0) } else { (Anchor::Start, 4.0) };
        self.drawing.text("tick halo", [at + shift, TOP + 11.0 + 14.0 * f64::from(row)], anchor, words);
    }

    /// Words at the upper edge over a place of the horizontal axis.
    pub(super) fn heading(&mut self, x: f64, words: &str) {
        let [x, _] = self.px([x, self.y.range[0]]);
        self.drawing.text("tick halo", [x, TOP + 12.0], Anchor::Middle, words);
    }

    /// A line that the page moves along the horizontal axis.
    pub(super) fn cursor(&mut self) {
        self.drawing.line("cursor", [LEFT, TOP], [LEFT, SIZE[1] - BOTTOM]);
    }

    /// Left and right end of the plot, px, and what they stand for.
    pub(super) fn horizontal_span(&self) -> [f64; 4] {
        [LEFT, SIZE[0] - RIGHT, self.x.range[0], self.x.range[1]]
    }

    /// An entry of the legend, once per name; an empty name has none.
    fn entry(&mut self, key: Key, class: &'static str, name: &str) {
        if !name.is_empty() && !self.legend.iter().any(|entry| entry.2 == name) {
            self.legend.push((key, class, name.to_owned()));
        }
    }

    /// The chart with its legend.
    pub(super) fn finish(mut self) -> Drawing {
        let mut at = [LEFT, SIZE[1] + 12.0];
        for (key, class, name) in &self.legend {
            let width = SAMPLE + 6.0 + LETTER * name.chars().count() as f64;
            if at[0] > LEFT && at[0] + width > SIZE[0] {
                at = [LEFT, at[1] + ROW];
            }
            let [x, y] = [at[0], at[1] - 4.0];
            let centre = [x + 0.5 * SAMPLE, y];
            match key {
                Key::Line => self.drawing.line(class, [x, y], [x + SAMPLE, y]),
                Key::Marker(marker) => self.drawing.marker(*marker, class, centre),
                Key::Area => self.drawing.rectangle(class, [x + 3.0, y - 6.0], [SAMPLE - 6.0, 12.0]),
            }
            self.drawing.text("tick", [x + SAMPLE + 6.0, at[1]], Anchor::Start, name);
            at[0] += width + 14.0;
        }
        if !self.legend.is_empty() {
            self.drawing.size[1] = at[1] + 6.0;
        }
        self.drawing
    }
}
