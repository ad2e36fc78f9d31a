//! `host-sim`: see `host-sim --help`.

use std::process::ExitCode;

use clap::Parser as _;

fn main() -> ExitCode {
    match host_sim::cli::execute(host_sim::cli::Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let code = error.exit_code();
            eprintln!("{:?}", miette::Report::new(error));
            ExitCode::from(code)
        }
    }
}
