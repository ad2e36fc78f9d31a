//! Draws estimated beside true errors on all scenes of `tests --test verification unseen_scenes`:
//! `cargo run --release -p tests --example estimates -- estimates.svg`.

use model_offline::output::chart::{Axis, Colour, Dash, Figure, Marker, Panel, Place, ReferenceLine, Series};
use std::error::Error;
use tests::estimates::{Outcome, SCENES, TOLERANCE, outcome};

/// Errors below this, in per cent, are drawn there: on a logarithmic axis everything smaller looks alike.
const SMALLEST: f64 = 1e-3;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args_os().nth(1).ok_or("give the file to write, e.g. estimates.svg")?;
    let mut outcomes = Vec::new();
    for (name, text) in SCENES {
        let found = outcome(text)?;
        println!("{name}: {} nodes, {} paddles", found.nodes, found.paddles.len());
        outcomes.push(found);
    }
    model_offline::output::write_whole(path.as_ref(), figure(&outcomes).svg().as_bytes())?;
    Ok(())
}

fn figure(outcomes: &[Outcome]) -> Figure {
    let paddles = || outcomes.iter().flat_map(|outcome| outcome.paddles.iter().map(move |paddle| (outcome, paddle)));
    let below = paddles().filter(|(outcome, paddle)| paddle.truth - outcome.open <= paddle.estimated).count();
    let worst = paddles().map(|(_, paddle)| paddle.truth).fold(0.0, f64::max);
    let names = (1..=SCENES.len()).map(|k| k.to_string()).collect();
    let title = format!("No error is above {:.2} %, where {:.0} % was asked for", 100.0 * worst, 100.0 * TOLERANCE);
    let mut panel =
        Panel::new(&title, Axis::categories("scene", names), Axis::log("error of ‖J⁻¹n‖", "%").range(SMALLEST, 2.0));
    let places = |k: usize, count: usize, i: usize| k as f64 - 0.35 + 0.7 * (i as f64 + 0.5) / count as f64;
    let [mut estimated, mut truth] = [Vec::new(), Vec::new()];
    for (k, outcome) in outcomes.iter().enumerate() {
        for (i, paddle) in outcome.paddles.iter().enumerate() {
            let x = places(k, outcome.paddles.len(), i);
            let [high, low] = [paddle.estimated, paddle.truth].map(|error| (100.0 * error).max(SMALLEST));
            panel.series.push(Series::curve("", Colour::Faint, Dash::Solid, vec![(x, low), (x, high)]));
            estimated.push((x, high));
            truth.push((x, low));
        }
    }
    panel.series.push(Series::scatter("estimated", Colour::Blue, Marker::Circle, estimated).open());
    panel.series.push(Series::scatter("true", Colour::Blue, Marker::Circle, truth));
    panel.lines.push(ReferenceLine::new("tolerance", Place::Y(100.0 * TOLERANCE), Dash::Dashed));
    let scenes: Vec<String> = SCENES.iter().zip(1..).map(|((name, _), k)| format!("{k} {name}")).collect();
    Figure {
        title: format!("The estimate holds for {below} of {} paddles on {} scenes", paddles().count(), SCENES.len()),
        caption: format!(
            "Default rule, tolerance {:.0} %; a pair of marks for every paddle. True: against quadratic triangles refined until \
             they leave a twentieth of the tolerance open. {}.",
            100.0 * TOLERANCE,
            scenes.join("; ")
        ),
        panels: vec![panel],
        columns: 1,
    }
}
