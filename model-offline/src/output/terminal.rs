//! What commands show on a terminal besides their results.

use std::io::IsTerminal as _;

/// A progress bar of so many steps; hidden where standard error is not a terminal.
pub fn progress(steps: u64) -> indicatif::ProgressBar {
    if !std::io::stderr().is_terminal() {
        return indicatif::ProgressBar::hidden();
    }
    let style = indicatif::ProgressStyle::with_template("{wide_bar} {percent} %, {eta} left  {msg}");
    let bar = indicatif::ProgressBar::new(steps);
    if let Ok(style) = style { bar.with_style(style) } else { bar }
}

/// Names the command that a word was meant for where clap does not: it counts letters near their places, and finds
/// nothing in common between `rnu` and `run`.
pub fn suggest(error: &clap::Error, word: &str, command: &clap::Command) {
    let suggested = error.get(clap::error::ContextKind::SuggestedSubcommand).is_some();
    let nearest = command
        .get_subcommands()
        .map(|known| (strsim::osa_distance(word, known.get_name()), known.get_name()))
        .min_by_key(|(distance, _)| *distance);
    if let Some((1, name)) = nearest.filter(|_| !suggested) {
        eprintln!("\n  tip: did you mean `{name}`?");
    }
}
