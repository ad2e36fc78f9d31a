//! The files that `--vtu` names: a body, what is beside it, and the script that shows both.

use super::error::CliError;
use model_offline::output;
use model_offline::output::vtu::{Shown, script};
use std::path::{Path, PathBuf};

/// The body's file and those beside it.
#[derive(Debug, Clone)]
pub(super) struct ForParaView<'a> {
    body: &'a Path,
    parts: PathBuf,
    script: PathBuf,
}

impl<'a> ForParaView<'a> {
    /// Beside this file of the body.
    pub(super) fn beside(body: &'a Path) -> Self {
        let stem = body.file_stem().unwrap_or_default().to_string_lossy();
        let [parts, script] = [format!("{stem}-parts.vtu"), format!("{stem}.py")].map(|name| body.with_file_name(name));
        Self { body, parts, script }
    }

    /// All of them.
    pub(super) fn files(&self) -> [&Path; 3] {
        [self.body, &self.parts, &self.script]
    }

    /// Writes the body, the parts, and a script that shows them so.
    pub(super) fn write(&self, body: &str, parts: &str, shown: Shown<'_>) -> Result<(), CliError> {
        let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let text = script(Shown { body: &name(self.body), parts: &name(&self.parts), ..shown });
        for (file, text) in self.files().into_iter().zip([body, parts, &text]) {
            output::write_whole(file, text.as_bytes())?;
        }
        Ok(())
    }
}
