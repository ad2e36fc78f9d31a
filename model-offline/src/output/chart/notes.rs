//! Names beside points, where nothing is drawn.

use super::drawing::{Anchor, Drawing, MARKER, Px, TEXT, text_width};

/// Distances from the point to the text that are tried, px.
const DISTANCES: [f64; 8] = [8.0, 16.0, 28.0, 42.0, 58.0, 76.0, 96.0, 120.0];
/// Directions that are tried, y down. Below and left first: there a Pareto front of errors against times has nothing.
const DIRECTIONS: [Px; 12] = [
    [-0.7, 0.7],
    [0.0, 1.0],
    [-1.0, 0.0],
    [0.7, 0.7],
    [0.7, -0.7],
    [-0.7, -0.7],
    [0.0, -1.0],
    [1.0, 0.0],
    [-0.4, 0.9],
    [-0.9, 0.4],
    [0.4, -0.9],
    [0.9, -0.4],
];
/// From this distance on a thin line leads from the text to its point, px.
const LEADER: f64 = 14.0;

/// A rectangle: its ends along x and y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Box2 {
    pub(super) low: Px,
    pub(super) high: Px,
}

impl Box2 {
    /// Around a point.
    pub(super) fn around([x, y]: Px, half: f64) -> Self {
        Self { low: [x - half, y - half], high: [x + half, y + half] }
    }

    pub(super) fn meets(&self, other: &Self) -> bool {
        (0..2).all(|k| self.low[k] < other.high[k] && other.low[k] < self.high[k])
    }

    fn within(&self, other: &Self) -> bool {
        (0..2).all(|k| self.low[k] >= other.low[k] && self.high[k] <= other.high[k])
    }
}

/// Points along a line, so close that no text fits between.
pub(super) fn along(piece: &[Px]) -> Vec<Box2> {
    piece
        .windows(2)
        .flat_map(|pair| {
            let way = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
            let steps = (way[0].hypot(way[1]) / 4.0).ceil().clamp(1.0, 2000.0);
            (0..=steps as u32).map(move |i| {
                let t = f64::from(i) / steps;
                Box2::around([pair[0][0] + t * way[0], pair[0][1] + t * way[1]], 1.5)
            })
        })
        .collect()
}

/// The text's box at this distance in this direction from its point.
fn text_box([x, y]: Px, text: &str, distance: f64, [dx, dy]: Px) -> Box2 {
    let half = [0.5 * text_width(text, TEXT), 0.5 * TEXT];
    let centre =
        [x + dx * distance + dx.signum() * f64::from(u8::from(dx != 0.0)) * half[0], y + dy * distance + dy * half[1]];
    Box2 { low: [centre[0] - half[0], centre[1] - half[1]], high: [centre[0] + half[0], centre[1] + half[1]] }
}

/// The line from a point to its text; none where they are close.
fn leader(at: Px, place: &Box2, distance: f64) -> Option<[Px; 2]> {
    (distance > LEADER).then(|| [at, [0, 1].map(|k| at[k].clamp(place.low[k], place.high[k]))])
}

/// The directions in the order in which they are tried: those that a name is meant to lie in first.
fn directions(towards: Option<Px>) -> [Px; 12] {
    let mut directions = DIRECTIONS;
    if let Some(towards) = towards {
        let along = |[x, y]: Px| (x * towards[0] + y * towards[1]) / x.hypot(y);
        directions.sort_by(|a, b| along(*b).total_cmp(&along(*a)));
    }
    directions
}

/// A name, its point, and where from it the name is meant to lie, y down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Name<'a> {
    pub(super) at: Px,
    pub(super) text: &'a str,
    pub(super) towards: Option<Px>,
}

/// Draws each text in the first place that is free; those that find none, or whose point is nowhere, are left out, and counted.
pub(super) fn draw(drawing: &mut Drawing, notes: &[Name<'_>], mut taken: Vec<Box2>, within: Box2) -> usize {
    let mut left_out = 0;
    let mut texts: Vec<Box2> = Vec::new();
    for Name { at, text, towards } in notes {
        if !at.iter().all(|v| v.is_finite()) {
            left_out += 1;
            continue;
        }
        let own = Box2::around(*at, MARKER);
        let directions = directions(*towards);
        let places = DISTANCES.iter().flat_map(|distance| directions.iter().map(move |way| (*distance, *way)));
        let places = places.map(|(distance, way)| (text_box(*at, text, distance, way), distance));
        let clear = |place: &Box2| place.within(&within) && !place.meets(&own) && !taken.iter().any(|t| t.meets(place));
        // A leader may cross lines and markers, but no text.
        let free = places.map(|(place, distance)| (place, leader(*at, &place, distance))).find(|(place, leader)| {
            let crossed = leader.iter().flat_map(|ends| along(ends)).any(|part| texts.iter().any(|t| t.meets(&part)));
            clear(place) && !crossed
        });
        let Some((place, leader)) = free else {
            left_out += 1;
            continue;
        };
        if let Some(ends) = leader {
            drawing.line("leader", ends[0], ends[1]);
            taken.extend(along(&ends));
        }
        drawing.text("tick", [place.low[0], place.high[1] - 2.0], Anchor::Start, text);
        taken.push(place);
        texts.push(place);
    }
    left_out
}

/// Names in a drawing that is no chart, and what they must not lie on.
#[derive(Clone, Debug, Default)]
pub struct Names {
    taken: Vec<Box2>,
    names: Vec<(Px, String, Option<Px>)>,
}

impl Names {
    /// Keeps clear of a line.
    pub fn avoid(&mut self, line: &[Px]) {
        self.taken.extend(along(line));
    }

    /// Keeps clear of a square around a point, by half its side.
    pub fn avoid_around(&mut self, at: Px, half: f64) {
        self.taken.push(Box2::around(at, half));
    }

    /// A name for what is at a point; on this side of it, if there is room.
    pub fn add(&mut self, at: Px, text: impl Into<String>, towards: Option<Px>) {
        self.names.push((at, text.into(), towards));
    }

    /// Draws them within a rectangle, by its upper left corner and size, in the order in which they were added. Those that
    /// find no room are left out, and counted.
    pub fn draw(self, drawing: &mut Drawing, corner: Px, size: Px) -> usize {
        let within = Box2 { low: corner, high: [corner[0] + size[0], corner[1] + size[1]] };
        let names: Vec<Name<'_>> =
            self.names.iter().map(|(at, text, towards)| Name { at: *at, text, towards: *towards }).collect();
        draw(drawing, &names, self.taken, within)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A result may say anything.
    #[test]
    fn what_is_nowhere_has_no_name() {
        for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut drawing = Drawing::new([100.0, 100.0], "names".to_owned());
            let mut names = Names::default();
            names.avoid(&[[wrong, 1.0], [2.0, wrong]]);
            names.avoid_around([1.0, wrong], 5.0);
            for at in [[wrong, 50.0], [50.0, wrong], [50.0, 50.0]] {
                names.add(at, "name", Some([wrong, 1.0]));
                names.add(at, "name", None);
            }
            assert!(names.draw(&mut drawing, [0.0; 2], [100.0; 2]) >= 4, "{wrong}");
        }
    }

    #[test]
    fn a_name_lies_on_the_side_that_it_is_meant_for() {
        for (towards, expected) in [([0.0, -1.0], [0, -1]), ([1.0, 0.1], [1, 0]), ([0.6, 0.7], [1, 1])] {
            let mut names = Names::default();
            names.add([50.0, 50.0], "7", Some(towards));
            let mut drawing = Drawing::new([100.0, 100.0], "");
            assert_eq!(names.draw(&mut drawing, [0.0, 0.0], [100.0, 100.0]), 0);
            let file = drawing.file();
            let document = roxmltree::Document::parse(&file).unwrap();
            let text = document.descendants().find(|node| node.has_tag_name("text")).unwrap();
            let [x, y] = ["x", "y"].map(|name| text.attribute(name).unwrap().parse::<f64>().unwrap());
            // The middle of the text, from its point.
            let side = [x + 0.5 * text_width("7", TEXT) - 50.0, y + 2.0 - 0.5 * TEXT - 50.0];
            assert_eq!(side.map(|v| if v.abs() < 1.0 { 0 } else { v.signum() as i32 }), expected, "{side:?}");
        }
    }

    #[test]
    fn texts_meet_neither_each_other_nor_what_is_drawn() {
        let within = Box2 { low: [0.0, 0.0], high: [400.0, 300.0] };
        let points: Vec<Px> = (0..8).map(|i| [100.0 + 12.0 * f64::from(i), 60.0 + 14.0 * f64::from(i)]).collect();
        let taken: Vec<Box2> = points.iter().map(|p| Box2::around(*p, MARKER)).chain(along(&points)).collect();
        let notes: Vec<Name<'_>> = points.iter().map(|p| Name { at: *p, text: "fem-t6, 925", towards: None }).collect();
        let mut drawing = Drawing::new([400.0, 300.0], "");
        assert_eq!(draw(&mut drawing, &notes, taken.clone(), within), 0);
        let file = drawing.file();
        let document = roxmltree::Document::parse(&file).unwrap();
        let texts: Vec<Box2> = document
            .descendants()
            .filter(|node| node.has_tag_name("text"))
            .map(|node| {
                let [x, y] = ["x", "y"].map(|name| node.attribute(name).unwrap().parse::<f64>().unwrap());
                // The descenders' two pixels belong to the text.
                let high = y + 2.0;
                Box2 { low: [x, high - TEXT], high: [x + text_width("fem-t6, 925", TEXT), high] }
            })
            .collect();
        assert_eq!(texts.len(), 8);
        for (i, text) in texts.iter().enumerate() {
            let shrunk = Box2 { low: text.low.map(|v| v + 0.1), high: text.high.map(|v| v - 0.1) };
            assert!(!taken.iter().any(|t| t.meets(&shrunk)), "{i}");
            assert!(!texts[..i].iter().any(|t| t.meets(&shrunk)), "{i}");
        }
        // Where nothing is free, nothing is written.
        assert_eq!(draw(&mut drawing, &notes[..1], vec![within], within), 1);
    }
}
