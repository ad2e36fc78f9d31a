//! The files that `--vtu` names: a body, what is beside it, and the script that shows both.

use super::error::CliError;
use model_offline::output;
use model_offline::output::vtu::{Shown, script};
use std::path::{Path, PathBuf};

/// The body's file and those beside it.
#[derive(Debug, Clone)]
pub(super) struct ForParaView<'a> {
    body: &'a Path,
    /// Parts and script; nothing is beside a pipe.
    beside: Option<[PathBuf; 2]>,
}

impl<'a> ForParaView<'a> {
    /// Beside this file of the body.
    pub(super) fn beside(body: &'a Path) -> Self {
        let stem = body.file_stem().unwrap_or_default().to_string_lossy();
        let names = [format!("{stem}-parts.vtu"), format!("{stem}.py")];
        let beside = (!output::is_stream(body)).then(|| names.map(|name| body.with_file_name(name)));
        Self { body, beside }
    }

    /// All of them, with what they are.
    pub(super) fn outputs(&self) -> [(&'static str, Option<&Path>); 3] {
        let [parts, script] = [0, 1].map(|i| self.beside.as_ref().map(|beside| beside[i].as_path()));
        [("--vtu", Some(self.body)), ("the parts beside --vtu", parts), ("the script beside --vtu", script)]
    }

    /// Writes the body, the parts, and a script that shows them so.
    pub(super) fn write(&self, body: &str, parts: &str, shown: Shown<'_>) -> Result<(), CliError> {
        let _together = output::together();
        output::write_whole(self.body, body.as_bytes())?;
        let Some([parts_file, script_file]) = &self.beside else { return Ok(()) };
        let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let text = script(Shown { body: &name(self.body), parts: &name(parts_file), ..shown });
        output::write_whole(parts_file, parts.as_bytes())?;
        Ok(output::write_whole(script_file, text.as_bytes())?)
    }
}
