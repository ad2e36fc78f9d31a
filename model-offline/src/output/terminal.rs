//! What commands show on a terminal besides their results.

use std::any::TypeId;
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

/// Whether an option takes numbers.
pub fn takes_numbers(option: &clap::Arg) -> bool {
    let kind = option.get_value_parser().type_id();
    [TypeId::of::<f64>(), TypeId::of::<u8>(), TypeId::of::<u16>(), TypeId::of::<u32>(), TypeId::of::<u64>()]
        .into_iter()
        .chain([TypeId::of::<usize>()])
        .any(|number| kind == number)
}

/// The same command line, in whose commands a number after an option may be negative: it is refused in the words of the
/// option, and not as an option that there is not. (What clap itself takes for a negative number has no negative exponent.)
pub fn accepting_negative_numbers(command: clap::Command) -> clap::Command {
    let accepting = |option: clap::Arg| {
        let is_number = takes_numbers(&option);
        if is_number { option.allow_hyphen_values(true) } else { option }
    };
    command.mut_subcommands(|command| command.mut_args(accepting))
}
