//! `host-sim`: see `host-sim --help`.

mod commands;

use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = commands::parse();
    // Two processes share one terminal: whose error is it?
    let is_controller = matches!(cli.command, Some(commands::Command::Controller(_)));
    match commands::execute(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let code = error.exit_code();
            if is_controller {
                eprintln!("controller process:");
            }
            eprintln!("{:?}", miette::Report::new(error));
            ExitCode::from(code)
        }
    }
}
