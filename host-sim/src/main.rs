//! `host-sim`: see `host-sim --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = host_sim::commands::parse();
    // Two processes share one terminal: whose error is it?
    let is_controller = matches!(cli.command, Some(host_sim::commands::Command::Controller(_)));
    match host_sim::commands::execute(cli) {
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
