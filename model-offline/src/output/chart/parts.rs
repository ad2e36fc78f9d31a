//! The parts of a scene as shapes: what is held, the needle, the target.

use super::drawing::{Drawing, Px};

/// Length of a needle's point and half its width, px.
const POINT: Px = [11.0, 5.5];
/// Radius of a target's ring and half the width of its cross, px.
const RING: f64 = 6.0;
const CROSS: f64 = 10.0;
/// Strokes along one piece of what is held, at most.
const STROKES: f64 = 500.0;

fn along(from: Px, direction: Px, way: f64) -> Px {
    [from[0] + direction[0] * way, from[1] + direction[1] * way]
}

/// Length and direction of the way from one point to another.
fn way(from: Px, to: Px) -> (f64, Px) {
    let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    let length = dx.hypot(dy);
    (length, [dx / length, dy / length])
}

impl Drawing {
    /// A line that is held: short strokes on its outer side, so far apart, px. `inside` tells on which side the body is.
    pub fn held(&mut self, line: &[Px], step: f64, inside: impl Fn(Px) -> bool) {
        self.polyline("immobile", line);
        for edge in line.windows(2) {
            let (length, [tx, ty]) = way(edge[0], edge[1]);
            let probe = along(along(edge[0], [tx, ty], 0.5 * length), [ty, -tx], 0.3 * step);
            let outward = if inside(probe) { [-ty, tx] } else { [ty, -tx] };
            let strokes = (length / step).clamp(0.0, STROKES) as u32;
            for i in 0..=strokes {
                let root = along(edge[0], [tx, ty], f64::from(i) * length / f64::from(strokes.max(1)));
                let tip = along(along(root, outward, 0.8 * step), [tx, ty], -0.6 * step);
                self.line("hatch", root, tip);
            }
        }
    }

    /// A needle with its tip at the second point.
    pub fn needle(&mut self, from: Px, to: Px) {
        let (_, [tx, ty]) = way(from, to);
        let root = along(to, [tx, ty], -POINT[0]);
        self.open_group("shaft");
        self.line("needle", from, root);
        self.polygon("arrow", &[to, along(root, [ty, -tx], POINT[1]), along(root, [-ty, tx], POINT[1])]);
        self.close_group();
    }

    /// A target: ring and cross, with a rim that separates them from any ground.
    pub fn target(&mut self, [x, y]: Px) {
        self.open_group("aim");
        for class in ["under", "target"] {
            self.circle(class, [x, y], RING);
            self.line(class, [x - CROSS, y], [x + CROSS, y]);
            self.line(class, [x, y - CROSS], [x, y + CROSS]);
        }
        self.close_group();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ends of the lines of a class.
    fn lines(drawing: &Drawing, class: &str) -> Vec<[f64; 4]> {
        let file = drawing.file();
        let document = roxmltree::Document::parse(&file).unwrap();
        let of_class = document.descendants().filter(|node| node.attribute("class") == Some(class));
        of_class
            .map(|line| ["x1", "y1", "x2", "y2"].map(|name| line.attribute(name).unwrap().parse().unwrap()))
            .collect()
    }

    #[test]
    fn strokes_lie_outside_whichever_way_the_line_runs() {
        // The body is below the line.
        for line in [[[0.0, 50.0], [100.0, 50.0]], [[100.0, 50.0], [0.0, 50.0]]] {
            let mut drawing = Drawing::new([100.0, 100.0], "");
            drawing.held(&line, 10.0, |[_, y]| y > 50.0);
            let strokes = lines(&drawing, "hatch");
            assert_eq!(strokes.len(), 11);
            assert!(strokes.iter().all(|[_, y1, _, y2]| *y1 == 50.0 && *y2 == 42.0), "{strokes:?}");
        }
    }

    #[test]
    fn a_needle_without_length_is_left_out() {
        let mut drawing = Drawing::new([10.0, 10.0], "");
        drawing.needle([1.0, 1.0], [1.0, 1.0]);
        assert!(!drawing.file().contains("NaN") && lines(&drawing, "needle").is_empty());
    }
}
