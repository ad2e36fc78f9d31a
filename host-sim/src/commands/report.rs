//! `host-sim report`.

use model_offline::say;
use std::path::PathBuf;

use clap::Args;
use host_sim::SimError;
use host_sim::report::directory::{rebuild_report, write_pictures};

/// Options of `report`.
#[derive(Args, Clone, Debug)]
pub(crate) struct ReportArgs {
    /// Directory of the run
    pub(crate) directory: PathBuf,
    /// Also write the charts here, as SVG files
    #[arg(long, value_name = "DIR")]
    pub(crate) svg_dir: Option<PathBuf>,
}

/// Makes the report again and says where everything is.
///
/// # Errors
/// [`SimError::File`], [`SimError::NotARun`].
pub(crate) fn report(args: &ReportArgs) -> Result<(), SimError> {
    rebuild_report(&args.directory)?;
    say!("{}", args.directory.join("report.html").display());
    if let Some(into) = &args.svg_dir {
        for path in write_pictures(&args.directory, into)? {
            say!("{}", path.display());
        }
    }
    Ok(())
}
