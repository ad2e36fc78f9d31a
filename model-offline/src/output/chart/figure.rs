//! Panels in a grid under one title.

use super::draw::{Layout, draw};
use super::drawing::{Anchor, Drawing, GAP, TEXT, wrap};
use super::legend::Legend;
use super::panel::Panel;

/// Width of a panel where one, two, three or more stand side by side, px: letters stay readable where a page shows the
/// figure 900 px wide.
const WIDTHS: [f64; 3] = [560.0, 430.0, 290.0];
/// Size of the title's letters and height of its lines, and of the caption's, px.
const HEADING: f64 = 16.0;
const HEADING_LINE: f64 = 21.0;
const CAPTION_LINE: f64 = 16.0;

/// Panels in a grid. What more than half of them have in common stands once, in a legend above them.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Title: what the figure as a whole says.
    pub title: String,
    /// Sentences below the title; may be empty.
    pub caption: String,
    /// Panels, row by row.
    pub panels: Vec<Panel>,
    /// Panels per row.
    pub columns: usize,
}

impl Figure {
    /// The figure as a drawing.
    pub fn drawing(&self) -> Drawing {
        let columns = self.columns.clamp(1, self.panels.len().max(1));
        let panel_width = WIDTHS[columns.min(WIDTHS.len()) - 1];
        let width = columns as f64 * (panel_width + GAP) + GAP;
        let layouts: Vec<Layout> = self.panels.iter().map(|panel| Layout::new(panel, panel_width)).collect();
        let shared = Legend::common(&layouts.iter().map(|layout| &layout.legend).collect::<Vec<_>>());
        let mut drawing = Drawing::new([width, 0.0], self.title.clone());
        let mut y = self.heading(&mut drawing, &shared);
        for (panels, layouts) in self.panels.chunks(columns).zip(layouts.chunks(columns)) {
            // Axes of one row start at one height.
            let head = layouts.iter().map(Layout::head).fold(0.0, f64::max);
            let drawn = panels
                .iter()
                .zip(layouts)
                .map(|(panel, layout)| draw(panel, layout, head, &layout.legend.without(&shared)));
            let mut height = 0.0_f64;
            for (i, panel) in drawn.enumerate() {
                height = height.max(panel.size[1]);
                drawing.place([GAP + i as f64 * (panel_width + GAP), y], &panel);
            }
            y += height + GAP;
        }
        drawing.size[1] = y;
        drawing
    }

    /// Draws title, caption and shared legend; returns where the panels begin.
    fn heading(&self, drawing: &mut Drawing, shared: &Legend) -> f64 {
        let width = drawing.size[0] - 2.0 * GAP;
        let heading = heading(&self.title, &self.caption, width);
        let mut y = GAP + heading.size[1];
        drawing.place([GAP, GAP], &heading);
        let height = shared.height(width);
        if height > 0.0 {
            shared.draw(drawing, [GAP, y + 6.0], width);
            y += height + 6.0;
        }
        if y > GAP { y + 10.0 } else { y }
    }

    /// The figure as one self-contained SVG document.
    pub fn svg(&self) -> String {
        self.drawing().file()
    }
}

/// A title and the sentences below it, as wide as this.
pub fn heading(title: &str, caption: &str, width: f64) -> Drawing {
    let mut drawing = Drawing::new([width, 0.0], "");
    let mut y = 0.0;
    for line in wrap(title, width, HEADING) {
        drawing.text("heading", [0.0, y + HEADING - 2.0], Anchor::Start, &line);
        y += HEADING_LINE;
    }
    for line in wrap(caption, width, TEXT) {
        drawing.text("muted", [0.0, y + TEXT], Anchor::Start, &line);
        y += CAPTION_LINE;
    }
    drawing.size[1] = y;
    drawing
}
