//! `model-offline`: see `model-offline --help`.

mod commands;

use std::process::ExitCode;

use model_offline::output::terminal::{all_was_said, complain};
use model_offline::output::{end_between_results, told};

fn main() -> ExitCode {
    end_between_results();
    match commands::run(commands::parse()) {
        Ok(()) if all_was_said() => ExitCode::SUCCESS,
        Ok(()) => ExitCode::FAILURE,
        Err(error) => {
            let code = error.exit_code();
            complain(&told(error));
            ExitCode::from(code)
        }
    }
}
