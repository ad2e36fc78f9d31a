//! The command line of `model-offline`: one file per command.

mod check;
mod check_space;
mod common;
mod compare;
mod completions;
mod draw;
mod error;
mod fit;
mod fit_space;
mod for_paraview;
mod inspect;
mod json;
mod man;
mod materials;
mod new;
mod pareto;
mod place;
mod place_space;
mod place_text;
mod schema;
mod slice;
mod solve;
mod solve_space;
mod stability;
mod sweep;
mod table;

use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use error::CliError;
use model_offline::output::terminal;

/// Tissue model, paddle placement and controller tables for needle insertion.
#[derive(Debug, Parser)]
#[command(name = "model-offline", version, about, max_term_width = 100)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Full placement study: every paddle, static and dynamic.
    #[command(after_help = "Example:\n  model-offline place model-offline/scenes/paper.toml --json place.json")]
    Place(place::PlaceArgs),
    /// A scene's numbers, and what of it is seldom meant, without solving.
    #[command(after_help = "Example:\n  model-offline check breast --json check.json")]
    Check(check::CheckArgs),
    /// Draws a scene: body, needle, target, paddles and inclusions, named and to scale.
    #[command(after_help = "Example:\n  model-offline draw breast -o breast.svg")]
    Draw(draw::DrawArgs),
    /// One equilibrium: needle at a depth, one paddle displaced.
    #[command(
        after_help = "Example:\n  model-offline solve paper --paddle 3 --depth 0.1 --vtu body.vtu --svg body.svg"
    )]
    Solve(solve::SolveArgs),
    /// Controller table of one paddle, in space of one or two.
    #[command(after_help = "Example:\n  model-offline table paper --paddle 3 -o paddle3.table")]
    Table(table::TableArgs),
    /// Where each method stops working, and why: depth reached against every parameter.
    #[command(
        after_help = "Example:\n  model-offline stability paper --out stability --quick\n\nIn space a run takes seconds to minutes, and a study many minutes, also with --quick: begin with a coarse --spacing."
    )]
    Stability(stability::StabilityArgs),
    /// What a table holds, checked.
    #[command(after_help = "Example:\n  model-offline inspect paddle3.table")]
    Inspect(inspect::InspectArgs),
    /// Error against time for every method there is: pareto.csv and pareto.svg.
    #[command(
        after_help = "Example:\n  model-offline pareto paper --out charts --quick\n\nTimes are those of one thread, whatever --threads says; leave the machine alone meanwhile. About five minutes without --quick."
    )]
    Pareto(pareto::ParetoArgs),
    /// What the mesh does to the choice of a paddle: both rankings along a refinement, sweep.csv and sweep.svg.
    #[command(after_help = "Example:\n  model-offline sweep paper --without-inclusion --out charts")]
    Sweep(sweep::SweepArgs),
    /// The smallest model that keeps a tolerance, chosen from the cheapest up, and the fewest of the scene's effects (shaft,
    /// creep, breathing), or in space of its dimensions and paddles; what was rejected, and by which number.
    #[command(
        after_help = "Examples:\n  model-offline fit paper --tolerance 0.01 -o fitted.toml --json fit.json\n  model-offline fit breast-world --tolerance 0.02 -o fitted.toml\n  model-offline fit block --tolerance 0.15 --svg both.svg"
    )]
    Fit(fit::FitArgs),
    /// The planar scene that a plane through needle and target cuts of a scene in space.
    #[command(after_help = "Example:\n  model-offline slice block -o plane.toml && model-offline place plane.toml")]
    Slice(slice::SliceArgs),
    /// Which effects a scene needs: what a needle that slips, tissue that creeps and a patient that breathes add.
    #[command(after_help = "Example:\n  model-offline compare breast --svg effects.svg")]
    Compare(compare::CompareArgs),
    /// A commented scene to start from, also from an SVG drawing or a Gmsh mesh.
    #[command(
        after_help = "Examples:\n  model-offline new -o my.toml\n  model-offline new --dimension 3 -o body.toml\n  model-offline new --svg outline.svg --size 120 -o my.toml\n  model-offline new --msh body.msh -o my.toml"
    )]
    New(new::NewArgs),
    /// Prints a completion script for a shell.
    #[command(
        after_help = "Example:\n  model-offline completions bash > ~/.local/share/bash-completion/completions/model-offline"
    )]
    Completions(completions::CompletionsArgs),
    /// Writes manual pages, one for every command.
    #[command(after_help = "Example:\n  model-offline man man1 && man ./man1/model-offline.1")]
    Man(man::ManArgs),
    /// Materials that scenes can name (`[material] preset = ...`): law, moduli, source, and what of each is a judgement.
    #[command(after_help = "Example:\n  model-offline materials --json materials.json")]
    Materials(materials::MaterialsArgs),
    /// JSON Schema of the scene file.
    #[command(
        after_help = "Examples:\n  model-offline schema > scene.schema.json\n  model-offline schema --dimension 3 > space.schema.json"
    )]
    Schema(schema::SchemaArgs),
}

/// Runs a command.
///
/// # Errors
/// [`CliError`], whose [`exit_code`](CliError::exit_code) is the process's.
pub(crate) fn run(cli: Cli) -> Result<(), CliError> {
    match cli.command {
        Command::Place(args) => place::run(&args),
        Command::Check(args) => check::run(&args),
        Command::Draw(args) => draw::run(&args),
        Command::Solve(args) => solve::run(&args),
        Command::Table(args) => table::run(&args),
        Command::Stability(args) => stability::run(&args),
        Command::Inspect(args) => inspect::run(&args),
        Command::Pareto(args) => pareto::run(&args),
        Command::Sweep(args) => sweep::run(&args),
        Command::Fit(args) => fit::run(&args),
        Command::Slice(args) => slice::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::New(args) => new::run(&args),
        Command::Completions(args) => completions::run(&args, &mut Cli::command()),
        Command::Man(args) => man::run(&args, Cli::command()),
        Command::Materials(args) => materials::run(&args),
        Command::Schema(args) => schema::run(&args),
    }
}

/// Commands of the other program of this project, for those who mix them up.
const ELSEWHERE: [&str; 13] = [
    "worlds",
    "run",
    "controller",
    "plant",
    "bridge",
    "rearm",
    "timing",
    "faults",
    "tables",
    "replay",
    "board",
    "export",
    "report",
];

/// Options of the discretization that studies do not take.
const VARIED: [&str; 4] = ["--integration", "--support", "--basis", "--tolerance"];

/// The command line of these words.
fn parsed(words: impl IntoIterator<Item = impl Into<std::ffi::OsString> + Clone>) -> Result<Cli, clap::Error> {
    let mut command = terminal::accepting_negative_numbers(Cli::command());
    let matches = command.try_get_matches_from_mut(words)?;
    Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
}

/// Reads the command line; ends the process with help, or with what is wrong and what was meant.
pub(crate) fn parse() -> Cli {
    parsed(std::env::args_os()).unwrap_or_else(|error| {
        let word = error.get(clap::error::ContextKind::InvalidSubcommand).map(ToString::to_string);
        let argument = error.get(clap::error::ContextKind::InvalidArg).map(ToString::to_string);
        let _ = error.print();
        let is_unknown = error.kind() == clap::error::ErrorKind::UnknownArgument;
        if is_unknown && argument.is_some_and(|argument| VARIED.iter().any(|option| argument.starts_with(option))) {
            terminal::complain("\n  tip: studies vary this themselves: leave it out");
        }
        if let Some(word) = word {
            if ELSEWHERE.contains(&word.as_str()) {
                terminal::complain(&format!("\n  tip: `{word}` is a command of host-sim: host-sim {word} --help"));
            } else {
                terminal::suggest(&error, &word, &Cli::command());
            }
        }
        std::process::exit(error.exit_code());
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// How each command that takes numbers is called with everything that it needs; outputs are in `OUT`.
    const CALLS: [(&str, &str); 13] = [
        ("place", "paper"),
        ("check", "paper"),
        ("draw", "result.json -o OUT/a.svg"),
        ("solve", "paper --paddle 3 --depth 0.01"),
        ("table", "paper -o OUT/a.table"),
        ("stability", "paper --out OUT/stability"),
        ("pareto", "paper --out OUT/pareto"),
        ("sweep", "paper --out OUT/sweep"),
        ("fit", "paper --tolerance 0.1 -o OUT/a.toml"),
        ("slice", "block -o OUT/a.toml"),
        ("compare", "paper"),
        ("new", "-o OUT/a.toml"),
        ("schema", ""),
    ];

    /// What a negative number after an option is answered with, and whether that is exit code 2.
    fn answer(command: &str, option: &str, out: &Path) -> (String, bool) {
        let (_, call) = CALLS.iter().find(|(name, _)| *name == command).unwrap_or_else(|| panic!("call `{command}`"));
        let call = call.replace("OUT", out.to_str().unwrap());
        let mut words: Vec<&str> = ["model-offline", command].into_iter().chain(call.split_whitespace()).collect();
        if let Some(at) = words.iter().position(|word| *word == option) {
            words.drain(at..at + 2);
        }
        words.extend([option, "-0.5"]);
        match parsed(&words) {
            Err(error) => (error.to_string(), error.exit_code() == 2),
            Ok(cli) => match run(cli) {
                Ok(()) => ("nothing".to_owned(), false),
                Err(error) => (error.to_string(), error.exit_code() == 2),
            },
        }
    }

    #[test]
    fn a_negative_number_is_refused_by_the_option_that_it_is_given_to() {
        let folder = tempfile::tempdir().unwrap();
        let mut tried = 0;
        for command in Cli::command().get_subcommands() {
            for option in command.get_arguments().filter(|option| terminal::takes_numbers(option)) {
                let name = format!("--{}", option.get_long().unwrap());
                let (said, is_usage) = answer(command.get_name(), &name, folder.path());
                let told = is_usage && said.contains(&name) && !said.contains("unexpected argument");
                assert!(told, "{} {name} -0.5: {said}", command.get_name());
                tried += 1;
            }
        }
        assert!(tried > 30, "only {tried}: are numbers known by their types?");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "something was written");
    }
}
