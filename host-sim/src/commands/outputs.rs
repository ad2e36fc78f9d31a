//! Outputs, checked before the work begins.

use std::path::Path;

use host_sim::SimError;
use host_sim::bench::usage::UsageError;
use model_offline::output::check_outputs;

/// Refuses a `--json` that lies in the report's directory `out` under a name that the report uses itself. Another name
/// there is fine, although the directory may not exist yet: it is written after the report.
///
/// # Errors
/// [`SimError::Usage`], [`SimError::Refused`].
pub(super) fn check_json_beside_report(inputs: &[&Path], json: Option<&Path>, out: &Path) -> Result<(), SimError> {
    let Some(path) = json.filter(|path| path.parent() == Some(out)) else {
        return Ok(check_outputs(inputs, &[("--json", json)])?);
    };
    let is_json = path.extension().is_some_and(|extension| extension == "json");
    if is_json && path.file_name().is_some_and(|name| name != "result.json") {
        return Ok(());
    }
    Err(UsageError::NameOfTheReport { path: path.to_owned() }.into())
}
