//! `host-sim`: see `host-sim --help`.

mod commands;

use std::process::ExitCode;

use model_offline::output::terminal::{all_was_said, complain};
use model_offline::output::told;

fn main() -> ExitCode {
    // Its warnings show whole data structures of a link whose other side has gone; what matters of that is an error of ours.
    iceoryx2::prelude::set_log_level_from_env_or(iceoryx2::prelude::LogLevel::Error);
    let command = commands::parse();
    // Two processes share one terminal: whose error is it?
    let is_controller = matches!(command, commands::Command::Controller(_));
    match commands::execute(command) {
        Ok(()) if all_was_said() => ExitCode::SUCCESS,
        Ok(()) => ExitCode::FAILURE,
        Err(error) => {
            let code = error.exit_code();
            if is_controller {
                complain("controller process:");
            }
            complain(&told(error));
            ExitCode::from(code)
        }
    }
}
