//! All worlds of a scene as a table.

use std::fmt::Write as _;

use model_offline::number::{decimals, length};

use crate::bench::in_process::Errors;
use crate::bench::worlds::{Controlled, OtherTissue, OtherTissueRow, Spread, WorldRow, Worlds};
use model_offline::scene::Effect;

/// The table, in Markdown: readable in a terminal too.
pub fn summary(worlds: &Worlds) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write(&mut text, worlds);
    text
}

fn write(text: &mut String, worlds: &Worlds) -> std::fmt::Result {
    let Worlds { scene, length_unit, seeds, paddles: [fixture, dynamic], rows, waiting, other_tissue } = worlds;
    writeln!(
        text,
        "Scene {scene}: target displacement orthogonal to the needle, peak / RMS in {length_unit}; static: paddle {fixture}, \
         Stillpoint: paddle {dynamic}, medians of {seeds} seeds (peaks of nine in ten)\n"
    )?;
    writeln!(
        text,
        "| needle | tissue | patient | sensor | no paddle | static paddle | Stillpoint, table knows | table does not |"
    )?;
    writeln!(text, "|---|---|---|---|---|---|---|---|")?;
    for row in rows {
        for sensor in &row.sensors {
            let known = sensor.known.as_ref();
            let known = known.map_or_else(|| "no table".to_owned(), |known| controlled(known, &row.none));
            let [needle, tissue, patient] = in_words(&row.effects);
            writeln!(
                text,
                "| {needle} | {tissue} | {patient} | {} | {} | {} | {known} | {} |",
                sensor.sensor,
                errors(&row.none, &row.none),
                errors(&row.fixture, &row.none),
                controlled(&sensor.simple, &row.none),
            )?;
        }
    }
    writeln!(
        text,
        "\nThe same where the needle waits for some breaths at the skin, the table knowing all but the breath: followed by the \
         observer, foretold by the harmonic predictor. From the needle's first motion on.\n"
    )?;
    writeln!(text, "| needle | tissue | breaths | waits | sensor | no paddle | static paddle | followed | foretold |")?;
    writeln!(text, "|---|---|---|---|---|---|---|---|---|")?;
    for row in waiting {
        for sensor in &row.sensors {
            let [needle, tissue, _] = in_words(&row.effects);
            writeln!(
                text,
                "| {needle} | {tissue} | {} | {} s | {} | {} | {} | {} | {} |",
                breaths(row.varies),
                row.wait_s,
                sensor.sensor,
                errors(&row.none, &row.none),
                errors(&row.fixture, &row.none),
                controlled(&sensor.followed, &row.none),
                controlled(&sensor.predicted, &row.none),
            )?;
        }
    }
    if let (Some(other), Some(simplest)) = (other_tissue, rows.first()) {
        write_other_tissue(text, other, simplest)?;
    }
    let all = rows.iter().flat_map(|row| &row.sensors).flat_map(|row| row.known.iter().chain([&row.simple]));
    let all = all.chain(waiting.iter().flat_map(|row| &row.sensors).flat_map(|row| [&row.followed, &row.predicted]));
    let found = all.filter_map(|run| run.tissue_error).fold(0.0, f64::max);
    writeln!(
        text,
        "\n(−): a larger peak than without a paddle. ±: how far the simulated tissue, the neighbourhood of each insertion, was from \
         the full model in half of its steps along the first seed's insertion, where that is more than a tenth of the peak, but for \
         the moment when the skin gives way; at most {} {length_unit}. Static paddle: the best one of the simplest world.",
        length(found)
    )?;
    for row in rows.iter().filter(|row| row.no_table.is_some()) {
        let effects: Vec<&str> = row.effects.iter().map(|effect| effect.name()).collect();
        writeln!(text, "No table that knows {}: {}", effects.join(", "), row.no_table.as_deref().unwrap_or_default())?;
    }
    Ok(())
}

/// The table of other tissue.
fn write_other_tissue(text: &mut String, other: &OtherTissue, simplest: &WorldRow) -> std::fmt::Result {
    writeln!(
        text,
        "\nThe simplest world where the table is of homogeneous tissue and the tissue has inclusions: by its feed-forward alone, \
         and with what the sensor shows.\n"
    )?;
    writeln!(
        text,
        "| sensor | no paddle | static paddle | feed-forward alone | Stillpoint, table does not know | table knows |"
    )?;
    writeln!(text, "|---|---|---|---|---|---|")?;
    for OtherTissueRow { sensor, homogeneous, known } in &other.sensors {
        writeln!(
            text,
            "| {sensor} | {} | {} | {} | {} | {} |",
            errors(&simplest.none, &simplest.none),
            errors(&simplest.fixture, &simplest.none),
            errors(&other.fed_forward, &simplest.none),
            controlled(homogeneous, &simplest.none),
            controlled(known, &simplest.none),
        )?;
    }
    Ok(())
}

/// Needle, tissue and patient.
pub(super) fn in_words(effects: &[Effect]) -> [&'static str; 3] {
    let has = |effect: Effect| effects.contains(&effect);
    [
        if has(Effect::Shaft) { "shaft" } else { "patch" },
        if has(Effect::Creep) { "creeping" } else { "elastic" },
        if has(Effect::Breathing) { "breathing" } else { "still" },
    ]
}

/// How much breaths differ.
fn breaths([period, amplitude]: [f64; 2]) -> String {
    if period == 0.0 && amplitude == 0.0 {
        return "alike".to_owned();
    }
    format!("±{:.0} % long, ±{:.0} % large", 100.0 * period, 100.0 * amplitude)
}

/// Decimals for errors of a world: three digits of what they are without a paddle, in metres as in millimetres.
fn places(none: &Errors) -> usize {
    decimals(10.0 * none.peak, 3)
}

fn errors(Errors { peak, rms }: &Errors, none: &Errors) -> String {
    let places = places(none);
    format!("{peak:.places$} / {rms:.places$}")
}

fn controlled(run: &Controlled, none: &Errors) -> String {
    let Spread { low, median, high } = run.peak;
    let places = places(none);
    let hurts = if median > none.peak { " (−)" } else { "" };
    let share = if run.run_share < 1.0 { format!("; {:.0} % in RUN", 100.0 * run.run_share) } else { String::new() };
    // What the simulated tissue itself is off by, where that counts.
    let off = match run.tissue_error {
        Some(error) if error < 0.1 * median => String::new(),
        Some(error) => format!("; tissue ±{error:.places$}"),
        None => "; tissue not verified".to_owned(),
    };
    format!("{median:.places$} / {:.places$} ({low:.places$}–{high:.places$}{share}{off}){hurts}", run.rms.median)
}
