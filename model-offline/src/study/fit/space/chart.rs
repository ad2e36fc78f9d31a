//! The same scene in both dimensions as a figure.

use super::{SliceInBody, SpaceFit};
use crate::output::chart::{Axis, Bars, Colour, Figure, Marker, Panel, Series};

/// Width of a bar; two stand side by side.
const BAR: f64 = 0.24;
/// How far markers of one paddle are apart.
const APART: f64 = 0.15;

impl SpaceFit {
    /// Measures of all paddles, and the target without help, in body and slice, as one SVG.
    pub fn svg(&self) -> String {
        let verdict = if self.verdict.dimension == 2 { "the slice will do" } else { "the body is needed" };
        let plane = match (&self.slice, &self.slice_failure) {
            (Some(slice), _) => format!("The slice is {}.", slice.plane),
            (None, Some(why)) => format!("No slice: {why}."),
            (None, None) => String::new(),
        };
        let mut panels = vec![self.measures()];
        panels.extend(self.slice.as_ref().map(|slice| self.without_help(slice)));
        Figure {
            title: format!(
                "{} at a tolerance of {} %: body against plane strain, scene {}, {} tissue",
                capital(verdict),
                100.0 * self.tolerance,
                self.scene,
                self.tissue
            ),
            caption: format!("{plane} Paddles without a mark of the slice are not in its plane."),
            panels,
            columns: 2,
        }
        .svg()
    }

    /// How far paddles go for a unit of the target.
    fn measures(&self) -> Panel {
        let best = self.paddles.iter().find(|paddle| Some(paddle.index) == self.optimum.dynamic);
        let title = match best.and_then(|paddle| Some((paddle.index, paddle.ratio?))) {
            Some((index, ratio)) => {
                format!(
                    "Paddle {index} goes {ratio:.2} times as far in the body as the slice says, in the same direction"
                )
            }
            None => "Controllability measure of every paddle".to_owned(),
        };
        let names = self.paddles.iter().map(|paddle| paddle.index.to_string()).collect();
        let y = Axis::log("way of the paddle per way of the target", "1");
        let mut panel = Panel::new(&title, Axis::categories("paddle", names), y);
        let mut add = |label: &str, colour, marker, place: f64, values: Vec<Option<f64>>| {
            let shown = values.into_iter().enumerate().filter_map(|(i, value)| Some((i as f64 + place, value?)));
            let points: Vec<(f64, f64)> = shown.filter(|(_, value)| value.is_finite()).collect();
            if !points.is_empty() {
                panel.series.push(Series::scatter(label, colour, marker, points));
            }
        };
        let of = |value: fn(&super::PaddleInBoth) -> Option<f64>| self.paddles.iter().map(value).collect();
        let worst = of(|paddle| Some(paddle.body));
        add("body, worst direction", Colour::Blue, Marker::Circle, -APART, worst);
        add("body, the slice's direction", Colour::Green, Marker::Square, 0.0, of(|paddle| paddle.body_in_plane));
        add("slice, plane strain", Colour::Vermillion, Marker::Diamond, APART, of(|paddle| paddle.slice));
        panel
    }

    /// Where the target goes by itself.
    fn without_help(&self, slice: &SliceInBody) -> Panel {
        let way = slice.without_help;
        let names = ["in the plane", "across the plane", "along the needle"].map(str::to_owned).to_vec();
        let title =
            format!("The target without help, at depth {}", crate::number::in_unit(way.depth, &self.length_unit));
        let y = Axis::linear("displacement", &self.length_unit);
        let mut panel = Panel::new(&title, Axis::categories("direction", names), y);
        let bars = |place: f64, values: [f64; 3]| {
            let bar = |(i, value): (usize, f64)| {
                let left = i as f64 + BAR * place;
                [left, left + BAR, value]
            };
            values.into_iter().enumerate().map(bar).collect()
        };
        let body = [way.body_in_plane, way.body_across_plane, way.body_axial];
        let flat = [way.slice_in_plane, 0.0, way.slice_axial];
        panel.bars.push(Bars { label: "body".to_owned(), colour: Colour::Blue, bars: bars(-1.0, body) });
        panel.bars.push(Bars {
            label: "slice, plane strain".to_owned(),
            colour: Colour::Vermillion,
            bars: bars(0.0, flat),
        });
        panel
    }
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
