//! The body drawn: cells in their deformed place, coloured by strain, with needle, paddle and target.

use super::vtu::cell_gradients;
use crate::geometry::Point2;
use crate::material::green_lagrange;
use crate::model::{Body, TissueModel};
use std::fmt::Write as _;

/// A picture of a body in its present state, width 720 px, self-contained.
pub fn svg(model: &TissueModel, body: &Body<'_>) -> String {
    let scene = model.scene();
    let coefficients = body.equilibrium().coefficients();
    let moved = |x: &Point2| x + model.displacement_at(x, coefficients);
    let strains: Vec<f64> = cell_gradients(model, coefficients).iter().map(|h| green_lagrange(h).norm()).collect();
    let largest = strains.iter().copied().fold(1e-12, f64::max);
    let (low, high) = scene.outline.bounds();
    let size = high - low;
    let scale = 640.0 / size.x.max(size.y);
    let pixel = |p: Point2| (40.0 + (p.x - low.x) * scale, 40.0 + (high.y - p.y) * scale);
    let path = |points: &mut dyn Iterator<Item = Point2>| {
        points.fold(String::new(), |mut s, p| {
            let (x, y) = pixel(p);
            let _ = write!(s, "{x:.2},{y:.2} ");
            s
        })
    };
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0} {:.0}\" width=\"720\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
        size.x * scale + 80.0,
        size.y * scale + 110.0
    );
    for (cell, strain) in model.cells().iter().zip(&strains) {
        let _ = writeln!(
            out,
            "<polygon points=\"{}\" fill=\"{}\" stroke=\"#ffffff\" stroke-width=\"0.5\"/>",
            path(&mut cell.corners().iter().map(moved)),
            colour(strain / largest)
        );
    }
    let mut line = |points: Vec<Point2>, colour: &str, width: f64| {
        let _ = writeln!(
            out,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\"/>",
            path(&mut points.into_iter())
        );
    };
    let mut rest = scene.outline.vertices().to_vec();
    rest.push(rest[0]);
    line(rest, "#888888", 1.0);
    for immobile in &scene.immobile {
        line(immobile.clone(), "#222222", 5.0);
    }
    for inclusion in &scene.inclusions {
        let mut edge: Vec<Point2> = inclusion.outline.vertices().iter().map(moved).collect();
        edge.push(edge[0]);
        line(edge, "#7b3294", 2.0);
    }
    line(scene.needle.contact.iter().map(moved).collect(), "#d7191c", 5.0);
    for paddle in &scene.paddles {
        line(paddle.segment.iter().map(moved).collect(), "#2c7bb6", 3.0);
    }
    let ((x, y), (x0, y0)) = (pixel(moved(&scene.target)), pixel(scene.target));
    let _ = writeln!(out, "<circle cx=\"{x0:.2}\" cy=\"{y0:.2}\" r=\"5\" fill=\"none\" stroke=\"#000000\"/>");
    let _ = writeln!(out, "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"4\" fill=\"#000000\"/>");
    let bottom = size.y * scale + 70.0;
    for i in 0..50 {
        let _ = writeln!(
            out,
            "<rect x=\"{}\" y=\"{bottom:.0}\" width=\"4.2\" height=\"12\" fill=\"{}\"/>",
            40 + 4 * i,
            colour(f64::from(i) / 49.0)
        );
    }
    let _ = writeln!(
        out,
        "<text x=\"40\" y=\"{:.0}\">0</text><text x=\"240\" y=\"{:.0}\" text-anchor=\"end\">{largest:.3}</text>\
         <text x=\"256\" y=\"{:.0}\">‖E‖ Green–Lagrange; depth {:.4}; red needle, blue paddles, black immobile, ring target at rest</text>\n</svg>",
        bottom + 26.0,
        bottom + 26.0,
        bottom + 11.0,
        body.depth()
    );
    out
}

/// Light to dark, readable in grey: a straight line through perceptual lightness.
fn colour(t: f64) -> String {
    let stops = [(255.0, 247.0, 188.0), (254.0, 153.0, 41.0), (102.0, 37.0, 6.0)];
    let t = t.clamp(0.0, 1.0) * 2.0;
    let (a, b, s) = if t < 1.0 { (stops[0], stops[1], t) } else { (stops[1], stops[2], t - 1.0) };
    let mix = |p: f64, q: f64| (p + (q - p) * s).round() as u8;
    format!("#{:02x}{:02x}{:02x}", mix(a.0, b.0), mix(a.1, b.1), mix(a.2, b.2))
}
