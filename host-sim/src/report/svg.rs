//! Scalable vector graphics as text: escaped, finite, and with classes instead of colours.

use std::fmt::Write as _;

use maud::{Markup, PreEscaped, html};

use super::style;

/// Position or size in a drawing, px.
pub(super) type Px = [f64; 2];

/// A drawing.
#[derive(Clone, Debug, Default)]
pub(super) struct Drawing {
    /// Width and height, px.
    pub(super) size: Px,
    /// What it shows, for people who do not see it.
    pub(super) label: String,
    /// Identifier in the page; empty: none.
    pub(super) id: String,
    body: String,
}

/// Text in XML.
pub(super) fn escape(text: &str) -> String {
    // Control characters are no XML at all.
    text.chars().filter(|letter| !letter.is_control()).fold(String::with_capacity(text.len()), |mut escaped, letter| {
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

/// Where a text is anchored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// Shapes that are told apart without colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Marker {
    Disc,
    Diamond,
    Dash,
}

impl Drawing {
    pub(super) fn new(size: Px, label: impl Into<String>) -> Self {
        Self { size, label: label.into(), ..Self::default() }
    }

    /// A shape is left out when a coordinate is not finite.
    fn shape(&mut self, points: &[Px], text: std::fmt::Arguments<'_>) {
        if finite(points) {
            let _ = self.body.write_fmt(text);
        }
    }

    pub(super) fn line(&mut self, class: &str, from: Px, to: Px) {
        let [x1, y1, x2, y2] = [from[0], from[1], to[0], to[1]].map(px);
        self.shape(&[from, to], format_args!(r#"<line class="{class}" x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}"/>"#));
    }

    /// Pieces of finite points, each one polyline.
    pub(super) fn polyline(&mut self, class: &str, points: &[Px]) {
        for piece in points.split(|point| !finite(&[*point])).filter(|piece| piece.len() > 1) {
            let points = joined(piece);
            self.shape(piece, format_args!(r#"<polyline class="{class}" points="{points}"/>"#));
        }
    }

    pub(super) fn polygon(&mut self, class: &str, points: &[Px]) {
        let text = joined(points);
        self.shape(points, format_args!(r#"<polygon class="{class}" points="{text}"/>"#));
    }

    pub(super) fn rectangle(&mut self, class: &str, corner: Px, size: Px) {
        let [x, y, width, height] = [corner[0], corner[1], size[0].max(0.0), size[1].max(0.0)].map(px);
        self.shape(
            &[corner, size],
            format_args!(r#"<rect class="{class}" x="{x}" y="{y}" width="{width}" height="{height}"/>"#),
        );
    }

    pub(super) fn circle(&mut self, class: &str, centre: Px, radius: f64) {
        let [x, y, r] = [centre[0], centre[1], radius].map(px);
        self.shape(&[centre], format_args!(r#"<circle class="{class}" cx="{x}" cy="{y}" r="{r}"/>"#));
    }

    pub(super) fn marker(&mut self, marker: Marker, class: &str, [x, y]: Px) {
        match marker {
            Marker::Disc => self.circle(class, [x, y], 4.5),
            Marker::Diamond => self.polygon(class, &[[x, y - 6.0], [x + 6.0, y], [x, y + 6.0], [x - 6.0, y]]),
            Marker::Dash => self.line(class, [x - 9.0, y], [x + 9.0, y]),
        }
    }

    pub(super) fn text(&mut self, class: &str, at: Px, anchor: Anchor, text: &str) {
        let [x, y] = at.map(px);
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let text = escape(text);
        self.shape(
            &[at],
            format_args!(r#"<text class="{class}" x="{x}" y="{y}" text-anchor="{anchor}">{text}</text>"#),
        );
    }

    pub(super) fn open_group(&mut self, class: &str) {
        let _ = write!(self.body, r#"<g class="{class}">"#);
    }

    pub(super) fn close_group(&mut self) {
        self.body.push_str("</g>");
    }

    /// In the page, whose style sheet it uses.
    pub(super) fn inline(&self) -> Markup {
        let [width, height] = self.size.map(px);
        html! {
            svg class="chart" id=[(!self.id.is_empty()).then_some(&self.id)] role="img" aria-label=(self.label)
                viewBox=(format!("0 0 {width} {height}")) {
                (PreEscaped(&self.body))
            }
        }
    }
}

/// Space between drawings on a sheet, px.
const GAP: f64 = 16.0;

/// A file of its own: drawings in rows on a white ground.
pub(super) fn sheet(drawings: &[Drawing], columns: usize) -> String {
    let rows: Vec<&[Drawing]> = drawings.chunks(columns.max(1)).collect();
    let row_height = |row: &[Drawing]| row.iter().map(|drawing| drawing.size[1]).fold(0.0, f64::max);
    let row_width = |row: &[Drawing]| row.iter().map(|drawing| drawing.size[0] + GAP).sum::<f64>() + GAP;
    let width = px(rows.iter().map(|row| row_width(row)).fold(0.0, f64::max));
    let height = px(rows.iter().map(|row| row_height(row) + GAP).sum::<f64>() + GAP);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"chart\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\"><style>{}</style><rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>",
        style::standalone()
    );
    let mut y = GAP;
    for row in rows {
        let mut x = GAP;
        for drawing in row {
            let _ = write!(
                text,
                "<g transform=\"translate({},{})\"><title>{}</title>{}</g>",
                px(x),
                px(y),
                escape(&drawing.label),
                drawing.body
            );
            x += drawing.size[0] + GAP;
        }
        y += row_height(row) + GAP;
    }
    text.push_str("</svg>\n");
    text
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
        let page = drawing.inline().into_string();
        assert!(page.contains("aria-label=\"a &quot;b&quot; &lt;c&gt;\""), "{page}");
        assert!(roxmltree::Document::parse(&sheet(&[drawing.clone(), drawing], 1)).is_ok());
    }
}
