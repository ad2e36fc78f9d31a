//! Scalable vector graphics as text: escaped, finite, and with classes instead of colours.

use std::fmt::Write as _;

use super::style;

/// Position or size in a drawing, px.
pub type Px = [f64; 2];

/// Size of all letters but those of titles, px.
pub(super) const TEXT: f64 = 12.0;
/// Size of a title's letters, px.
pub(super) const TITLE: f64 = 13.0;
/// Half the size of a marker, px.
pub(super) const MARKER: f64 = 4.2;
/// Space between drawings on a sheet, px.
pub(super) const GAP: f64 = 16.0;

/// A drawing: shapes in a box.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawing {
    /// Width and height, px.
    pub size: Px,
    /// What it shows, for people who do not see it.
    pub label: String,
    /// Identifier in the page; empty: none.
    pub id: String,
    body: String,
}

/// Where a text is anchored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// At its first letter.
    Start,
    /// In its middle.
    Middle,
    /// At its last letter.
    End,
}

/// Shape of a marker: methods and strategies are told apart without colour, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marker {
    /// Circle.
    Circle,
    /// Square.
    Square,
    /// Triangle, tip up.
    Triangle,
    /// Triangle, tip down.
    TriangleDown,
    /// Triangle, tip to the right.
    TriangleRight,
    /// Triangle, tip to the left.
    TriangleLeft,
    /// Regular pentagon.
    Pentagon,
    /// Square on its tip.
    Diamond,
    /// Upright cross, never filled.
    Plus,
    /// A small dot, for cells of a map.
    Dot,
    /// A level stroke.
    Dash,
}

/// Text in XML, content or attribute.
pub fn escape(text: &str) -> String {
    // Control characters are no XML at all, nor are these two.
    let is_xml = |letter: &char| !letter.is_control() && !['\u{fffe}', '\u{ffff}'].contains(letter);
    text.chars().filter(is_xml).fold(String::with_capacity(text.len()), |mut escaped, letter| {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            other => escaped.push(other),
        }
        escaped
    })
}

/// Width of a text, px: an estimate from above, since no font is read. The widest of the style sheet's fonts, DejaVu
/// Sans, has 0.6 of its size per letter on average; bold letters are a tenth wider.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    let bold = if size > TEXT { 1.1 } else { 1.0 };
    0.6 * size * bold * text.chars().count() as f64
}

/// A text in as few lines as there can be that are at most this wide, about equally long, lest the last one be a single word; a
/// word of its own may be wider.
pub(super) fn wrap(text: &str, width: f64, size: f64) -> Vec<String> {
    let widest = |lines: &[String]| lines.iter().map(|line| text_width(line, size)).fold(0.0, f64::max);
    let mut lines = filled(text, width, size);
    loop {
        // Narrower by less than a letter: the longest line gives a word to the next one.
        let narrower = filled(text, widest(&lines) - 0.5 * text_width("i", size), size);
        if narrower.len() > lines.len() || widest(&narrower) >= widest(&lines) {
            return lines;
        }
        lines = narrower;
    }
}

/// A text in lines that each take all the words that they hold.
fn filled(text: &str, width: f64, size: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    // What may not be parted, as a number and its power of ten, is one word.
    for word in text.split([' ', '\n']).filter(|word| !word.is_empty()) {
        match lines.last_mut() {
            Some(line) if text_width(&format!("{line} {word}"), size) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// A coordinate: a tenth of a pixel is enough.
fn px(value: f64) -> f64 {
    // Adding zero makes −0 a 0.
    (value * 10.0).round() / 10.0 + 0.0
}

fn finite(points: &[Px]) -> bool {
    points.iter().flatten().all(|value| value.is_finite())
}

fn joined(points: &[Px]) -> String {
    let mut text = String::with_capacity(points.len() * 12);
    for point in points {
        let space = if text.is_empty() { "" } else { " " };
        let _ = write!(text, "{space}{},{}", px(point[0]), px(point[1]));
    }
    text
}

impl Drawing {
    /// An empty drawing of this size; `label` says what it shows.
    pub fn new(size: Px, label: impl Into<String>) -> Self {
        Self { size, label: label.into(), ..Self::default() }
    }

    /// A shape is left out when a coordinate is not finite.
    fn shape(&mut self, points: &[Px], text: std::fmt::Arguments<'_>) {
        if finite(points) {
            let _ = self.body.write_fmt(text);
        }
    }

    /// A straight line.
    pub fn line(&mut self, class: &str, from: Px, to: Px) {
        let [x1, y1, x2, y2] = [from[0], from[1], to[0], to[1]].map(px);
        self.shape(&[from, to], format_args!(r#"<line class="{class}" x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}"/>"#));
    }

    /// Pieces of finite points, each one polyline.
    pub fn polyline(&mut self, class: &str, points: &[Px]) {
        for piece in points.split(|point| !finite(&[*point])).filter(|piece| piece.len() > 1) {
            let points = joined(piece);
            self.shape(piece, format_args!(r#"<polyline class="{class}" points="{points}"/>"#));
        }
    }

    /// The same with a name that a page can tell; none where it is empty.
    pub(super) fn named_polyline(&mut self, class: &str, name: &str, points: &[Px]) {
        let name = if name.is_empty() { String::new() } else { format!(" data-name=\"{}\"", escape(name)) };
        let text = joined(points);
        self.shape(points, format_args!(r#"<polyline class="{class}"{name} points="{text}"/>"#));
    }

    /// A rectangle, corner and size, with data for a page's script.
    pub(super) fn data_rectangle(&mut self, class: &str, [corner, size]: [Px; 2], data: &[(&str, &str)]) {
        let [x, y, width, height] = [corner[0], corner[1], size[0], size[1]].map(px);
        let data = data.iter().filter(|(_, value)| !value.is_empty());
        let data: String = data.map(|(name, value)| format!(" data-{name}=\"{}\"", escape(value))).collect();
        self.shape(
            &[corner, size],
            format_args!(r#"<rect class="{class}" x="{x}" y="{y}" width="{width}" height="{height}"{data}/>"#),
        );
    }

    /// A closed shape; left out when any corner is not finite.
    pub fn polygon(&mut self, class: &str, points: &[Px]) {
        let text = joined(points);
        self.shape(points, format_args!(r#"<polygon class="{class}" points="{text}"/>"#));
    }

    /// A shape with holes: what lies inside of an odd number of these loops; left out when any corner is not finite.
    pub fn region(&mut self, class: &str, loops: &[Vec<Px>]) {
        let mut text = String::new();
        for points in loops.iter().filter(|points| points.len() > 2) {
            let _ = write!(text, "M{}Z", joined(points));
        }
        let all: Vec<Px> = loops.iter().flatten().copied().collect();
        if !text.is_empty() {
            self.shape(&all, format_args!(r#"<path class="{class}" fill-rule="evenodd" d="{text}"/>"#));
        }
    }

    /// A rectangle by its upper left corner; a negative size is none.
    pub fn rectangle(&mut self, class: &str, corner: Px, size: Px) {
        let [x, y, width, height] = [corner[0], corner[1], size[0].max(0.0), size[1].max(0.0)].map(px);
        self.shape(
            &[corner, size],
            format_args!(r#"<rect class="{class}" x="{x}" y="{y}" width="{width}" height="{height}"/>"#),
        );
    }

    /// A circle.
    pub fn circle(&mut self, class: &str, centre: Px, radius: f64) {
        let [x, y, r] = [centre[0], centre[1], radius].map(px);
        self.shape(&[centre], format_args!(r#"<circle class="{class}" cx="{x}" cy="{y}" r="{r}"/>"#));
    }

    /// A marker, all of its shapes of this class.
    pub fn marker(&mut self, marker: Marker, class: &str, [x, y]: Px) {
        let s = MARKER;
        let mut polygon = |corners: &[Px]| {
            let corners: Vec<Px> = corners.iter().map(|c| [x + s * c[0], y + s * c[1]]).collect();
            self.polygon(class, &corners);
        };
        match marker {
            Marker::Square => polygon(&[[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]]),
            Marker::Triangle => polygon(&[[-1.15, 0.85], [1.15, 0.85], [0.0, -1.2]]),
            Marker::TriangleDown => polygon(&[[-1.15, -0.85], [1.15, -0.85], [0.0, 1.2]]),
            Marker::TriangleRight => polygon(&[[-0.85, -1.15], [1.2, 0.0], [-0.85, 1.15]]),
            Marker::TriangleLeft => polygon(&[[0.85, -1.15], [-1.2, 0.0], [0.85, 1.15]]),
            Marker::Pentagon => {
                let corner = |k: u32| (std::f64::consts::TAU * f64::from(k) / 5.0).sin_cos();
                polygon(&[0, 1, 2, 3, 4].map(corner).map(|(sin, cos)| [1.15 * sin, -1.15 * cos]));
            }
            Marker::Diamond => polygon(&[[-1.25, 0.0], [0.0, -1.25], [1.25, 0.0], [0.0, 1.25]]),
            Marker::Circle => self.circle(class, [x, y], s),
            Marker::Dot => self.circle(class, [x, y], 0.4 * s),
            Marker::Dash => self.line(class, [x - 2.0 * s, y], [x + 2.0 * s, y]),
            Marker::Plus => {
                self.line(class, [x - 1.2 * s, y], [x + 1.2 * s, y]);
                self.line(class, [x, y - 1.2 * s], [x, y + 1.2 * s]);
            }
        }
    }

    /// A diagonal cross: something failed here.
    pub fn cross(&mut self, class: &str, [x, y]: Px) {
        let s = 1.1 * MARKER;
        self.line(class, [x - s, y - s], [x + s, y + s]);
        self.line(class, [x - s, y + s], [x + s, y - s]);
    }

    /// One line of text; nothing for an empty one.
    pub fn text(&mut self, class: &str, at: Px, anchor: Anchor, text: &str) {
        let [x, y] = at.map(px);
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let text = escape(text);
        if !text.is_empty() {
            self.shape(
                &[at],
                format_args!(r#"<text class="{class}" x="{x}" y="{y}" text-anchor="{anchor}">{text}</text>"#),
            );
        }
    }

    /// What follows until [`close_group`](Self::close_group) belongs together.
    pub fn open_group(&mut self, class: &str) {
        let _ = write!(self.body, r#"<g class="{class}">"#);
    }

    /// The same with words that appear under the pointer.
    pub(super) fn open_titled(&mut self, title: &str) {
        let _ = write!(self.body, "<g><title>{}</title>", escape(title));
    }

    /// Ends a group.
    pub fn close_group(&mut self) {
        self.body.push_str("</g>");
    }

    /// Another drawing inside this one, its upper left corner here.
    pub fn place(&mut self, [x, y]: Px, other: &Self) {
        let [x, y] = [x, y].map(px);
        let title =
            if other.label.is_empty() { String::new() } else { format!("<title>{}</title>", escape(&other.label)) };
        let _ = write!(self.body, "<g transform=\"translate({x},{y})\">{title}{}</g>", other.body);
    }

    /// An element for a page, whose [style sheet](style::page) it needs.
    pub fn inline(&self) -> String {
        let [width, height] = self.size.map(px);
        let id = if self.id.is_empty() { String::new() } else { format!(" id=\"{}\"", escape(&self.id)) };
        format!(
            "<svg class=\"chart\"{id} role=\"img\" aria-label=\"{}\" viewBox=\"0 0 {width} {height}\">{}</svg>",
            escape(&self.label),
            self.body
        )
    }

    /// A file of its own on a white ground.
    pub fn file(&self) -> String {
        let [width, height] = self.size.map(px);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"chart\" role=\"img\" viewBox=\"0 0 {width} {height}\" \
             width=\"{width}\" height=\"{height}\"><title>{}</title><style>{}</style>\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>{}</svg>\n",
            escape(&self.label),
            style::standalone(),
            self.body
        )
    }
}

/// Drawings side by side, in rows of this many.
pub fn sheet(label: &str, drawings: &[Drawing], columns: usize) -> Drawing {
    let rows: Vec<&[Drawing]> = drawings.chunks(columns.max(1)).collect();
    let row_height = |row: &[Drawing]| row.iter().map(|drawing| drawing.size[1]).fold(0.0, f64::max);
    let row_width = |row: &[Drawing]| row.iter().map(|drawing| drawing.size[0] + GAP).sum::<f64>() + GAP;
    let width = rows.iter().map(|row| row_width(row)).fold(0.0, f64::max);
    let height = rows.iter().map(|row| row_height(row) + GAP).sum::<f64>() + GAP;
    let mut all = Drawing::new([width, height], label);
    let mut y = GAP;
    for row in rows {
        let mut x = GAP;
        for drawing in row {
            all.place([x, y], drawing);
            x += drawing.size[0] + GAP;
        }
        y += row_height(row) + GAP;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_finite_is_not_drawn() {
        let mut drawing = Drawing::new([10.0, 10.0], "a \"b\" <c>");
        drawing.line("l", [0.0, f64::NAN], [1.0, 1.0]);
        drawing.circle("c", [f64::INFINITY, 0.0], 1.0);
        drawing.polygon("p", &[[0.0, 0.0], [f64::NEG_INFINITY, 1.0]]);
        drawing.text("t", [f64::NAN, 0.0], Anchor::Start, "x");
        assert_eq!(drawing.body, "");
        drawing.polyline("p", &[[0.0, 0.0], [1.0, 1.0], [f64::NAN, 1.0], [2.0, 2.0], [3.0, -0.01]]);
        let expected =
            concat!(r#"<polyline class="p" points="0,0 1,1"/>"#, r#"<polyline class="p" points="2,2 3,0"/>"#);
        assert_eq!(drawing.body, expected);
        assert!(drawing.inline().contains("aria-label=\"a &quot;b&quot; &lt;c&gt;\""), "{}", drawing.inline());
        let file = sheet("\u{0}s & t", &[drawing.clone(), drawing], 1).file();
        assert!(roxmltree::Document::parse(&file).is_ok(), "{file}");
    }

    #[test]
    fn text_is_wrapped_between_words() {
        assert_eq!(wrap("one two three", text_width("one two", TEXT), TEXT), ["one two", "three"]);
        assert_eq!(wrap("unbreakable", 1.0, TEXT), ["unbreakable"]);
        // No more lines than are needed, and no word alone on the last.
        let five = "one two three four five";
        assert_eq!(wrap(five, text_width("one two three four", TEXT), TEXT), ["one two three", "four five"]);
        assert_eq!(wrap(five, text_width("one two", TEXT), TEXT), ["one two", "three", "four", "five"]);
        assert!(wrap(" ", 100.0, TEXT).is_empty());
    }
}
