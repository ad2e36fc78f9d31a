//! Every sample and every tick accounted for.

use firmware::Discard;
use maud::{Markup, html};
use model_offline::output::chart::number::{NO_NUMBER, count};

use crate::bench::result::RunResult;
use crate::runtime::accounting::ledger::LedgerResult;

fn ledgers(run: &RunResult) -> Vec<(String, &LedgerResult)> {
    run.cases
        .iter()
        .flat_map(|case| case.strategies.iter().map(move |shown| (case, shown)))
        .filter_map(|(case, (_, result))| {
            let table = if case.table_tissue.is(case.tissue) {
                String::new()
            } else {
                format!(" (table of {})", case.table_tissue)
            };
            result.ledger.as_ref().map(|ledger| (format!("{}{table}, {}", case.tissue, result.mode), ledger))
        })
        .collect()
}

fn reasons(reasons: &[(Discard, u64)]) -> String {
    let all: Vec<String> =
        reasons.iter().map(|(reason, number)| format!("{}: {}", reason.name(), count(*number))).collect();
    if all.is_empty() { NO_NUMBER.to_owned() } else { all.join(", ") }
}

/// The part of the page.
pub(super) fn section(run: &RunResult) -> Markup {
    let ledgers = ledgers(run);
    let unaccounted: u64 = ledgers.iter().map(|(_, ledger)| ledger.unaccounted).sum();
    html! {
        p {
            "Published = consumed + overwritten + discarded + in flight, for every stream. Ticks due = RUN + HOLD + SAFE + \
             skipped. Without an entry: " b { (count(unaccounted)) } "."
        }
        div.scroll.on-screen { table {
            caption { span { "Samples" } }
            thead { tr {
                th { "controlled run" } th.left { "stream" } th { "published" } th { "consumed" } th { "overwritten" }
                th { "discarded" } th { "in flight" } th { "unaccounted" } th.left { "discarded for" }
            } }
            tbody { @for (name, ledger) in &ledgers {
                @for (stream, of) in [("needle", &ledger.needle), ("target", &ledger.target),
                    ("paddle", &ledger.paddle), ("command", &ledger.command)] {
                    tr {
                        td { (name) } td.left { (stream) }
                        @for number in [of.published, of.consumed, of.overwritten, of.discarded, of.in_flight, of.unaccounted] {
                            td { (count(number)) }
                        }
                        td.left { (reasons(&of.discarded_for)) }
                    }
                }
            } }
        } }
        div.scroll { table {
            caption { span { "Ticks of the controller" } }
            thead { tr {
                th { "controlled run" } th { "due" } th { "RUN" } th { "HOLD" } th { "SAFE" } th { "skipped" } th { "unaccounted" }
                th { "not recorded" }
            } }
            tbody { @for (name, ledger) in &ledgers {
                @let ticks = &ledger.ticks;
                tr {
                    td { (name) }
                    @for number in [ticks.due, ticks.run, ticks.hold, ticks.safe, ticks.skipped, ticks.unaccounted,
                        ledger.not_recorded] {
                        td { (count(number)) }
                    }
                }
            } }
        } }
        p.quiet {
            "A controller begins in HOLD until both sensors have reported; samples are overwritten when a newer one comes \
             before anybody looked, which lockstep never does."
        }
    }
}
