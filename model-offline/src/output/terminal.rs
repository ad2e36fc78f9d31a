//! What commands show on a terminal besides their results.

use std::any::TypeId;
use std::io::{IsTerminal as _, Write as _};
use std::time::Duration;

/// Time between the lines that take a progress bar's place.
const LINES_EVERY: Duration = Duration::from_secs(4);

/// A progress bar of so many steps; where standard error is not a terminal, a line there every few seconds until the bar
/// is finished or dropped.
pub fn progress(steps: u64) -> indicatif::ProgressBar {
    if !std::io::stderr().is_terminal() {
        let bar = indicatif::ProgressBar::with_draw_target(Some(steps), indicatif::ProgressDrawTarget::hidden());
        let observed = bar.downgrade();
        std::thread::spawn(move || {
            loop {
                std::thread::sleep(LINES_EVERY);
                let Some(bar) = observed.upgrade().filter(|bar| !bar.is_finished()) else { return };
                // Where nobody listens any more there is nobody to tell.
                if writeln!(std::io::stderr(), "{}", progress_line(&bar)).is_err() {
                    return;
                }
            }
        });
        return bar;
    }
    let style = indicatif::ProgressStyle::with_template("{wide_bar} {percent} %, {eta} left  {msg}");
    let bar = indicatif::ProgressBar::new(steps);
    if let Ok(style) = style { bar.with_style(style) } else { bar }
}

/// How far something has come, in one line. What is left is not said: steps of a run differ too much in what they take.
fn progress_line(bar: &indicatif::ProgressBar) -> String {
    let (done, of) = (bar.position(), bar.length().unwrap_or(0).max(1));
    format!("{:3} % of the steps after {} s  {}", 100 * done / of, bar.elapsed().as_secs(), bar.message())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_says_how_far_it_is_and_with_what() {
        let bar = indicatif::ProgressBar::with_draw_target(Some(40), indicatif::ProgressDrawTarget::hidden());
        bar.set_message("controller tables");
        bar.set_position(10);
        let line = progress_line(&bar);
        assert!(line.trim_start().starts_with("25 % of the steps") && line.ends_with("controller tables"), "{line}");
        // Nothing is known of how many there will be.
        assert!(progress_line(&indicatif::ProgressBar::hidden()).trim_start().starts_with("0 %"));
    }
}
