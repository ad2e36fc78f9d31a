//! Everything that is needed to do it again.

use maud::{Markup, html};
use model_offline::output::chart::number::{NO_NUMBER, count, number, plain};

use super::insertion::case_name;
use crate::bench::result::{CaseResult, RunResult, StrategyResult};

/// A word of a command line as a shell takes it.
fn word(word: &str) -> String {
    let plain = |letter: char| letter.is_ascii_alphanumeric() || "-_./=:,+@%".contains(letter);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

fn files(strategy: &StrategyResult) -> Vec<(&str, Option<&str>)> {
    let recording = strategy.recording.as_ref();
    let recording = recording.map(|recording| (recording.file.as_str(), Some(recording.sha256.as_str())));
    recording.into_iter().chain(strategy.csv.as_deref().map(|file| (file, None))).collect()
}

fn rows(run: &RunResult) -> Vec<(&'static str, String, String)> {
    let settings = &run.settings;
    let length = if run.units[0] == "1" { "" } else { run.units[0].as_str() };
    let per_s = format!("{}/s", if length.is_empty() { "1" } else { length });
    let row = |what, value: f64, unit: &str| (what, plain(value), unit.to_owned());
    vec![
        row("rate of the loop", settings.rate_hz, "Hz"),
        row("depth of the insertion", settings.depth, length),
        row("duration of the insertion", settings.insertion_s, "s"),
        row("wait of the needle before it", settings.wait_s, "s"),
        row("pauses, rest and way back of the needle", settings.pauses_s, "s"),
        row("time simulated", settings.duration_s, "s"),
        ("the world, besides the simplest model", settings.world_in_words(), String::new()),
        ("what sees the target", settings.sensor.clone(), String::new()),
        ("feedback", settings.feedback.clone(), String::new()),
        row("rate of the target sensor", settings.target_rate_hz, "Hz"),
        row("latency of the target sensor", settings.target_latency_ms, "ms"),
        row("noise of the target sensor, σ per component", settings.noise, length),
        row("lag of the paddle", settings.paddle_lag_ms, "ms"),
        row("delay of the paddle", f64::from(settings.paddle_delay_ticks), "ticks"),
        row("part of its command that the paddle reaches", settings.paddle_gain, ""),
        row("largest speed of the paddle", settings.paddle_max_rate, &per_s),
        row("largest displacement of the paddle", settings.paddle_max_displacement, length),
        ("seed of the sensors' noise", run.seed.to_string(), String::new()),
    ]
}

fn tables(run: &RunResult) -> Markup {
    html! {
        div.scroll.on-screen { table {
            caption { span { "Controller tables" } }
            thead { tr {
                th { "case" } th { "paddle" } th { "knots" } th { "bytes" } th { "gain per sample" }
                th { "delay [samples]" } th.left { "SHA-256 of the table" } th.left { "SHA-256 of its scene" }
            } }
            tbody { @for case in &run.cases {
                tr {
                    td { (case_name(case)) } td { (case.table.paddle) } td { (case.table.knots) }
                    td { (count(case.table.bytes as u64)) } td { (number(case.table.loop_gain, 3)) }
                    td { (case.table.delay_samples) } td.wrap { code { (case.table.hash) } }
                    td.wrap { code { (case.table.scene_hash) } }
                }
            } }
        } }
    }
}

fn case_files(case: &CaseResult) -> Markup {
    html! {
        @for (strategy, result) in case.strategies.iter() { @for (file, hash) in files(result) {
            tr {
                td { (case_name(case)) ": " (strategy.title()) } td.left { code { (file) } }
                td.wrap { @if let Some(hash) = hash { code { (hash) } } @else { (NO_NUMBER) } }
            }
        } }
    }
}

/// The part of the page.
pub(super) fn section(run: &RunResult) -> Markup {
    let command: Vec<String> = run.command.iter().map(|argument| word(argument)).collect();
    html! {
        @if !command.is_empty() { pre { code { (command.join(" ")) } } }
        p {
            "host-sim " (run.version) ", format of the result " (run.format)
            @if !run.platform.is_empty() { ", " (run.platform) }
            ". The whole command took " (number(run.wall_s, 3)) " s. What is in lockstep is the same, bit by bit, with the \
             same seed; free-run is not and cannot be. Any recording is checked with "
            code { "host-sim replay FILE.rec" } "; this page is made again from " code { "result.json" } " with "
            code { "host-sim report DIRECTORY" } "."
        }
        div.scroll { table {
            caption { span { "Settings of the simulation" } }
            thead { tr { th { "setting" } th { "value" } th.left { "unit" } } }
            tbody { @for (what, value, unit) in rows(run) { tr { td { (what) } td { (value) } td.left { (unit) } } } }
        } }
        div.scroll { table {
            caption { span { "Models" } }
            thead { tr { th { "tissue" } th { "nodes" } th.left { "integration" } th { "placement study [s]" } } }
            tbody { @for placement in &run.placements { tr {
                td { (placement.tissue) } td { (placement.nodes) } td.left { (placement.integration) }
                td { (number(placement.wall_s, 3)) }
            } } }
        } }
        (tables(run))
        div.scroll.on-screen { table {
            caption { span { "Files beside this page" } }
            thead { tr { th { "case" } th.left { "file" } th.left { "SHA-256" } } }
            tbody { @for case in &run.cases { (case_files(case)) } }
        } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_survive_a_shell() {
        assert_eq!(word("--out"), "--out");
        assert_eq!(word("my scene.toml"), "'my scene.toml'");
        assert_eq!(word("it's"), r"'it'\''s'");
        assert_eq!(word(""), "''");
    }
}
