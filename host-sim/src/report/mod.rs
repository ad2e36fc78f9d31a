//! The report: one HTML file, made from a [`RunResult`] alone.

use std::fmt::Write as _;

use crate::result::{RunResult, StrategyResult};

/// The page.
pub fn render(run: &RunResult) -> String {
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Stillpoint: {0}</title>\n\
         <style>body{{font:16px/1.5 sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem}}\
         table{{border-collapse:collapse}}td,th{{padding:.2rem .8rem;text-align:right;border-bottom:1px solid #ddd}}\
         </style></head>\n<body><h1>Stillpoint: scene {0}</h1>\n<p>{1}, seed {2}.</p>\n",
        escape(&run.scene),
        run.mode,
        run.seed
    );
    page.push_str(
        "<table><tr><th>tissue</th><th>table</th><th>strategy</th><th>paddle</th>\
         <th>largest orthogonal error</th><th>rms</th><th>final state</th></tr>\n",
    );
    for case in &run.cases {
        let strategies = &case.strategies;
        for (name, strategy) in [
            ("none", &strategies.none),
            ("static", &strategies.fixture),
            ("dynamic", &strategies.dynamic),
            ("dynamic, free-run", &strategies.dynamic_free_run),
        ] {
            if let Some(strategy) = strategy {
                row(&mut page, [&case.tissue, &case.table_tissue], name, strategy);
            }
        }
    }
    page.push_str("</table>\n</body></html>\n");
    page
}

fn row(page: &mut String, tissues: [&String; 2], name: &str, strategy: &StrategyResult) {
    let paddle = strategy.paddle.map_or_else(|| "–".to_owned(), |index| index.to_string());
    let _ = writeln!(
        page,
        "<tr><td>{}</td><td>{}</td><td>{name}</td><td>{paddle}</td><td>{:.6}</td><td>{:.6}</td><td>{}</td></tr>",
        escape(tissues[0]),
        escape(tissues[1]),
        strategy.max_orthogonal_error,
        strategy.rms_orthogonal_error,
        escape(&strategy.final_state),
    );
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
