//! What the marks mean: samples with their names, in rows.

use super::drawing::{Anchor, Drawing, MARKER, Marker, Px, TEXT, text_width, wrap};

/// Width of a sample, px, and its distance from the name.
const SAMPLE: f64 = 26.0;
const SPACE: f64 = 6.0;
/// Between entries, and between the lines of text, px.
const BETWEEN: f64 = 14.0;
const ROW: f64 = 18.0;

/// How an entry looks.
#[derive(Clone, Debug, PartialEq)]
pub enum Key {
    /// A line of this class, a marker of that one over it.
    Series(Option<String>, Option<(Marker, String)>),
    /// A filled box.
    Area(String),
    /// Something failed.
    Failed,
}

/// An entry with its place in the block and the lines of its name.
struct Placed<'a> {
    at: Px,
    key: &'a Key,
    lines: Vec<String>,
}

/// Entries in the order in which they are shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Legend(Vec<(Key, String)>);

impl Legend {
    /// An entry, unless the same is there; an empty name has none.
    pub fn add(&mut self, key: Key, name: &str) {
        if !name.is_empty() && !self.0.iter().any(|entry| (&entry.0, entry.1.as_str()) == (&key, name)) {
            self.0.push((key, name.to_owned()));
        }
    }

    /// What stands in more than half of several legends.
    pub(super) fn common(all: &[&Self]) -> Self {
        let mut common = Self::default();
        for (key, name) in all.iter().flat_map(|legend| &legend.0) {
            let holders = all.iter().filter(|legend| legend.0.iter().any(|e| (&e.0, &e.1) == (key, name))).count();
            if all.len() > 1 && 2 * holders > all.len() {
                common.add(key.clone(), name);
            }
        }
        common
    }

    /// What is here and not there.
    pub(super) fn without(&self, other: &Self) -> Self {
        Self(self.0.iter().filter(|entry| !other.0.contains(entry)).cloned().collect())
    }

    /// The entries in a block this wide, and the height of the block.
    fn rows(&self, width: f64) -> (Vec<Placed<'_>>, f64) {
        let mut places = Vec::new();
        let mut at = [0.0, 0.0];
        let mut lines_here = 0;
        for (key, name) in &self.0 {
            let lines = wrap(name, width - SAMPLE - SPACE, TEXT);
            let text = lines.iter().map(|line| text_width(line, TEXT)).fold(0.0, f64::max);
            let entry = SAMPLE + SPACE + text;
            if at[0] > 0.0 && at[0] + entry > width {
                at = [0.0, at[1] + ROW * f64::from(lines_here)];
                lines_here = 0;
            }
            lines_here = lines_here.max(u32::try_from(lines.len()).unwrap_or(u32::MAX));
            places.push(Placed { at, key, lines });
            at[0] += entry + BETWEEN;
        }
        (places, at[1] + ROW * f64::from(lines_here))
    }

    pub(super) fn height(&self, width: f64) -> f64 {
        self.rows(width).1
    }

    /// It alone, this wide, px.
    pub fn drawing(&self, width: f64) -> Drawing {
        let mut drawing = Drawing::new([width, self.height(width)], "");
        self.draw(&mut drawing, [0.0, 0.0], width);
        drawing
    }

    /// Draws it with its upper left corner here.
    pub(super) fn draw(&self, drawing: &mut Drawing, corner: Px, width: f64) {
        for Placed { at: [x, y], key, lines } in self.rows(width).0 {
            let [x, y] = [corner[0] + x, corner[1] + y + 0.5 * ROW];
            let centre = [x + 0.5 * SAMPLE, y];
            match key {
                Key::Series(line, marker) => {
                    if let Some(class) = line {
                        drawing.line(class, [x, y], [x + SAMPLE, y]);
                    }
                    if let Some((marker, class)) = marker {
                        drawing.marker(*marker, class, centre);
                    }
                }
                Key::Area(class) => drawing.rectangle(class, [x + 3.0, y - 6.0], [SAMPLE - 6.0, 12.0]),
                Key::Failed => drawing.cross("failed", centre),
            }
            for (i, line) in lines.iter().enumerate() {
                let at = [x + SAMPLE + SPACE, y + MARKER + ROW * i as f64];
                drawing.text("tick", at, Anchor::Start, line);
            }
        }
    }
}
