//! What commands show on a terminal besides their results.

use std::any::TypeId;
use std::fmt;
use std::io::{ErrorKind, IsTerminal as _, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

/// Time between the lines that take a progress bar's place.
const LINES_EVERY: Duration = Duration::from_secs(4);

/// Whether something that was to be said could not be, and somebody wants to read it.
static UNSAID: AtomicBool = AtomicBool::new(false);

/// Whether standard output is what a file was asked to be.
static IS_A_FILE: AtomicBool = AtomicBool::new(false);

/// From now on words go to standard error: standard output is a result (`--json /dev/stdout`), which another program reads.
pub fn give_way() {
    IS_A_FILE.store(true, Ordering::Relaxed);
}

/// Says a line on standard output. Where its reader has gone (`| head`) the work goes on in silence: files that are asked for
/// are written all the same. Another reason why it cannot be written is told once, and [`all_was_said`] knows.
#[macro_export]
macro_rules! say {
    ($($what:tt)*) => { $crate::output::terminal::put(format_args!("{}\n", format_args!($($what)*))) };
}

/// As [`say!`], without a new line at its end.
#[macro_export]
macro_rules! tell {
    ($($what:tt)*) => { $crate::output::terminal::put(format_args!($($what)*)) };
}

/// What [`say!`] and [`tell!`] do.
pub fn put(what: fmt::Arguments<'_>) {
    if IS_A_FILE.load(Ordering::Relaxed) {
        put_into(&mut std::io::stderr().lock(), "standard error", what);
    } else {
        put_into(&mut std::io::stdout().lock(), "standard output", what);
    }
}

fn put_into(out: &mut impl Write, name: &str, what: fmt::Arguments<'_>) {
    match out.write_fmt(what).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe && !UNSAID.swap(true, Ordering::Relaxed) => {
            complain(&format!("cannot write to {name}: {error}"));
        }
        _ => {}
    }
}

/// Says a line on standard error; where that cannot be written either, nobody is left to be told.
pub fn complain(what: &str) {
    let _ = writeln!(std::io::stderr(), "{what}");
}

/// Whether everything that was said could be written: a program that could not ends in failure.
pub fn all_was_said() -> bool {
    !UNSAID.load(Ordering::Relaxed)
}

/// A progress bar of so many steps that all take about as long; where standard error is not a terminal, a line there every
/// few seconds until the bar is finished or dropped.
pub fn progress(steps: u64) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return with_lines(steps, None);
    }
    styled(ProgressBar::new(steps), ProgressStyle::with_template("{wide_bar} {percent} %, {eta} left  {msg}"))
}

/// The progress of something of which only the present stage is known: its message.
pub fn stages() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return with_lines(0, Some(TimeLeft::default()));
    }
    let bar = styled(ProgressBar::new_spinner(), ProgressStyle::with_template("{spinner} {msg}, {elapsed}"));
    bar.enable_steady_tick(Duration::from_millis(500));
    bar
}

/// The progress of something whose steps differ in what they take: what is left is said where somebody foretells it.
#[derive(Clone, Debug)]
pub struct LongRun {
    /// How far it has come.
    pub bar: ProgressBar,
    /// When it will have ended.
    pub left: TimeLeft,
}

impl LongRun {
    /// On a terminal a bar, else lines, as for [`progress`].
    pub fn new() -> Self {
        let left = TimeLeft::default();
        if !std::io::stderr().is_terminal() {
            return Self { bar: with_lines(0, Some(left.clone())), left };
        }
        let shown = left.clone();
        let told = move |_: &ProgressState, out: &mut dyn std::fmt::Write| {
            let _ = out.write_str(&in_words(shown.seconds()));
        };
        let style = ProgressStyle::with_template("{wide_bar} {percent} %{left}  {msg}");
        let bar = styled(ProgressBar::new(0), style.map(|style| style.with_key("left", told)));
        // Time goes by between steps, too.
        bar.enable_steady_tick(Duration::from_millis(500));
        Self { bar, left }
    }

    /// Nobody is told.
    pub fn hidden() -> Self {
        Self { bar: ProgressBar::hidden(), left: TimeLeft::default() }
    }
}

impl Default for LongRun {
    fn default() -> Self {
        Self::new()
    }
}

fn styled<E>(bar: ProgressBar, style: Result<ProgressStyle, E>) -> ProgressBar {
    if let Ok(style) = style { bar.with_style(style) } else { bar }
}

/// A bar that nobody sees, and lines in its place; where nobody foretells what is left, steps are taken for equally long.
fn with_lines(steps: u64, left: Option<TimeLeft>) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(steps), ProgressDrawTarget::hidden());
    let observed = bar.downgrade();
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(LINES_EVERY);
            let Some(bar) = observed.upgrade().filter(|bar| !bar.is_finished()) else { return };
            // Where nobody listens any more there is nobody to tell.
            let left_s = left.as_ref().map_or_else(|| left_at_this_rate(&bar), TimeLeft::seconds);
            if writeln!(std::io::stderr(), "{}", progress_line(&bar, left_s)).is_err() {
                return;
            }
        }
    });
    bar
}

/// What is left of steps that go on as they have gone, s; nothing is known before the first.
fn left_at_this_rate(bar: &ProgressBar) -> Option<f64> {
    let (done, of) = (bar.position() as f64, bar.length()? as f64);
    (done > 0.0).then(|| bar.elapsed().as_secs_f64() * (of - done).max(0.0) / done)
}

/// How far something has come, in one line.
fn progress_line(bar: &ProgressBar, left_s: Option<f64>) -> String {
    let (done, of) = (bar.position(), bar.length().unwrap_or(0).max(1));
    let (after, left) = (bar.elapsed().as_secs(), in_words(left_s));
    let message = bar.message();
    // Nothing is known of the part that is not counted in steps, and more steps than were foretold are still no more than all.
    if done == 0 {
        return format!("after {after} s{left}  {message}");
    }
    format!("{:3} % of the steps after {after} s{left}  {message}", (100 * done / of).min(100))
}

fn in_words(left_s: Option<f64>) -> String {
    left_s.map_or_else(String::new, |seconds| format!(", about {:.0} s left", seconds.ceil()))
}

/// When something will have ended, as far as somebody has foretold it. Clones tell the same.
#[derive(Clone, Debug, Default)]
pub struct TimeLeft(Arc<Mutex<Option<Expected>>>);

/// From a moment on, a part takes so long, and those behind it so long, s.
#[derive(Clone, Copy, Debug)]
struct Expected {
    since: Instant,
    this_s: f64,
    then_s: f64,
}

/// Part of what something has taken that it is thought to take on when it is overdue.
const OVERDUE: f64 = 0.2;

impl TimeLeft {
    /// What begins now takes so long, and what comes then so long, s.
    pub fn expect(&self, this_s: f64, then_s: f64) {
        let expected = Expected { since: Instant::now(), this_s, then_s };
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(expected);
    }

    /// What is left by now, s; none where nothing was foretold.
    pub fn seconds(&self) -> Option<f64> {
        let expected = *self.0.lock().unwrap_or_else(PoisonError::into_inner);
        expected.map(|expected| expected.left(expected.since.elapsed().as_secs_f64()))
    }
}

impl Expected {
    fn left(&self, elapsed_s: f64) -> f64 {
        (self.this_s - elapsed_s).max(OVERDUE * elapsed_s.min(self.this_s)) + self.then_s
    }
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
        complain(&format!("\n  tip: did you mean `{name}`?"));
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
    fn what_is_left_grows_less_and_is_never_nothing_before_the_end() {
        let left = TimeLeft::default();
        assert_eq!(left.seconds(), None);
        left.expect(10.0, 5.0);
        let seconds = left.clone().seconds().unwrap();
        assert!(seconds > 14.0 && seconds <= 15.0, "{seconds}");
        let expected = Expected { since: Instant::now(), this_s: 10.0, then_s: 5.0 };
        assert_eq!([4.0, 9.0, 20.0].map(|elapsed| expected.left(elapsed)), [11.0, 6.8, 7.0]);
    }

    /// A pipe whose reader has gone, then a disk without room.
    #[test]
    fn a_reader_who_has_gone_is_no_failure_and_a_full_disk_is_one() {
        struct Failing(ErrorKind);
        impl Write for Failing {
            fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
                Err(self.0.into())
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        put_into(&mut Failing(ErrorKind::BrokenPipe), "a pipe", format_args!("words"));
        assert!(all_was_said());
        put_into(&mut Failing(ErrorKind::StorageFull), "a disk", format_args!("words"));
        assert!(!all_was_said());
    }

    #[test]
    fn a_line_says_how_far_it_is_and_with_what() {
        let bar = ProgressBar::with_draw_target(Some(40), ProgressDrawTarget::hidden());
        bar.set_message("controller tables");
        bar.set_position(10);
        let line = progress_line(&bar, None);
        assert!(line.trim_start().starts_with("25 % of the steps") && line.ends_with("controller tables"), "{line}");
        // Nothing is known of how many there will be.
        assert_eq!(progress_line(&ProgressBar::hidden(), None), "after 0 s  ");
        let early = ProgressBar::with_draw_target(Some(40), ProgressDrawTarget::hidden()).with_message("meshing");
        assert_eq!(progress_line(&early, None), "after 0 s  meshing");
        // More than were foretold.
        early.set_position(41);
        assert!(progress_line(&early, None).starts_with("100 % of the steps"), "{}", progress_line(&early, None));
        assert!(progress_line(&bar, Some(7.2)).contains(", about 8 s left  controller"));
        // A quarter is done, and the rest takes three times as long.
        let bar = bar.with_elapsed(Duration::from_secs(100));
        let left = left_at_this_rate(&bar).unwrap();
        assert!((left - 300.0).abs() < 30.0, "{left}");
        bar.set_position(0);
        assert_eq!(left_at_this_rate(&bar), None);
        bar.set_position(41);
        assert_eq!(left_at_this_rate(&bar), Some(0.0));
    }
}
