//! All worlds of a scene as a table.

use std::fmt::Write as _;

use model_offline::number::length;

use crate::bench::worlds::{Controlled, Errors, Spread, WorldRow, Worlds};

/// The table, in Markdown: readable in a terminal too.
pub fn summary(worlds: &Worlds) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write(&mut text, worlds);
    text
}

fn write(text: &mut String, worlds: &Worlds) -> std::fmt::Result {
    let Worlds { scene, length_unit, seeds, paddles: [fixture, dynamic], rows } = worlds;
    writeln!(
        text,
        "Scene {scene}: target displacement orthogonal to the needle, peak / RMS in {length_unit}; fixture: paddle {fixture}, \
         Stillpoint: paddle {dynamic}, medians of {seeds} seeds (peaks of nine in ten)\n"
    )?;
    writeln!(
        text,
        "| needle | tissue | patient | sensor | no paddle | fixture | Stillpoint, table knows | table does not |"
    )?;
    writeln!(text, "|---|---|---|---|---|---|---|---|")?;
    for row in rows {
        for sensor in &row.sensors {
            let known = sensor.known.as_ref().map_or_else(|| "no table".to_owned(), |known| controlled(known, row));
            writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {known} | {} |",
                if has(row, "shaft") { "shaft" } else { "patch" },
                if has(row, "creep") { "creeping" } else { "elastic" },
                if has(row, "breathing") { "breathing" } else { "still" },
                sensor.sensor,
                errors(&row.none),
                errors(&row.fixture),
                controlled(&sensor.simple, row),
            )?;
        }
    }
    let all = || rows.iter().flat_map(|row| &row.sensors).flat_map(|row| row.known.iter().chain([&row.simple]));
    let found = all().filter_map(|run| run.tissue_error).fold(0.0, f64::max);
    let estimate = all().map(|run| run.tissue_estimate).fold(0.0, f64::max);
    writeln!(
        text,
        "\n(−): worse than no paddle. The simulated tissue is the neighbourhood of each insertion: at most {} {length_unit} from \
         the full model along the insertions that were solved again (estimate, over all: {}).",
        length(found),
        length(estimate)
    )?;
    for row in rows.iter().filter(|row| row.no_table.is_some()) {
        let effects: Vec<&str> = row.effects.iter().map(|effect| effect.name()).collect();
        writeln!(text, "No table that knows {}: {}", effects.join(", "), row.no_table.as_deref().unwrap_or_default())?;
    }
    Ok(())
}

fn has(row: &WorldRow, effect: &str) -> bool {
    row.effects.iter().any(|found| found.name() == effect)
}

fn errors(Errors { peak, rms }: &Errors) -> String {
    format!("{peak:.3} / {rms:.3}")
}

fn controlled(run: &Controlled, row: &WorldRow) -> String {
    let Spread { low, median, high } = run.peak;
    let hurts = if median > row.none.peak { " (−)" } else { "" };
    let share = if run.run_share < 1.0 { format!("; {:.0} % in RUN", 100.0 * run.run_share) } else { String::new() };
    format!("{median:.3} / {:.3} ({low:.2}–{high:.2}{share}){hurts}", run.rms.median)
}
