//! `host-sim`: see `host-sim --help`.

mod commands;

use std::process::ExitCode;

fn main() -> ExitCode {
    let command = commands::parse();
    // Two processes share one terminal: whose error is it?
    let is_controller = matches!(command, commands::Command::Controller(_));
    match commands::execute(command) {
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
