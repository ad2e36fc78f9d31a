//! What the model writes: JSON, CSV, VTU, figures. Every file is written whole or not at all.

pub mod body;
pub mod chart;
pub mod csv;
pub mod field_picture;
mod geometry;
mod picture_file;
pub mod placement_picture;
mod preflight;
pub mod result_file;
pub mod scene_picture;
pub mod space_picture;
pub mod space_table_text;
mod state;
pub mod surface;
pub mod table_text;
pub mod terminal;
pub mod vtu;

pub use geometry::{Geometry, PaddleGeometry};
pub use picture_file::{PictureError, PictureFormat, write_picture};
pub use preflight::{OutputRefused, RefusalReason, check_outputs};
pub use state::{NodalFields, State, has_stress};

use std::io::Write as _;
use std::path::{Path, PathBuf};

/// A file that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct OutputError {
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub source: std::io::Error,
}

/// Writes a file whole or not at all: into a temporary file in the same folder, synced, then renamed over the target.
///
/// # Errors
/// [`OutputError`] names the file; whatever was there before is untouched.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let fail = |source| OutputError { path: path.to_owned(), source };
    // Renaming over a device or a pipe would replace it: those are written to directly.
    if path.exists() && !path.is_file() && !path.is_dir() {
        return std::fs::write(path, bytes).map_err(fail);
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(".stillpoint-");
    // Temporary files are private; a result is for whom the umask lets read it.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder).map_err(fail)?;
    file.write_all(bytes).map_err(fail)?;
    // Who has closed a file to others finds it closed afterwards.
    if let Ok(before) = path.metadata() {
        file.as_file().set_permissions(before.permissions()).map_err(fail)?;
    }
    file.as_file().sync_all().map_err(fail)?;
    file.persist(path).map_err(|e| fail(e.error))?;
    Ok(())
}

/// Makes a folder for results, with those above it.
///
/// # Errors
/// [`OutputError`] names the folder.
pub fn make_folder(path: &Path) -> Result<(), OutputError> {
    std::fs::create_dir_all(path).map_err(|source| OutputError { path: path.to_owned(), source })
}
