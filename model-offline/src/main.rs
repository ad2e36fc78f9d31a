//! `model-offline`: see `model-offline --help`.

mod commands;

use std::process::ExitCode;

fn main() -> ExitCode {
    match commands::run(commands::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let code = error.exit_code();
            eprintln!("{:?}", miette::Report::new(error));
            ExitCode::from(code)
        }
    }
}
