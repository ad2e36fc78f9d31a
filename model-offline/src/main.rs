//! `model-offline`: see `model-offline --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    match model_offline::cli::run(model_offline::cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let code = error.exit_code();
            eprintln!("{:?}", miette::Report::new(error));
            ExitCode::from(code)
        }
    }
}
