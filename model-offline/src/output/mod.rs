//! What the model writes: JSON, CSV, VTU, figures. Every file is written whole or not at all.

pub mod body;
pub mod chart;
pub mod csv;
mod destination;
pub mod field_picture;
mod geometry;
mod picture_file;
pub mod placement_picture;
mod preflight;
pub mod resampling;
pub mod result_file;
pub mod scene_picture;
pub mod space_picture;
pub mod space_table_text;
mod state;
pub mod surface;
pub mod table_text;
pub mod terminal;
mod together;
mod told;
pub mod vtu;

pub use geometry::{Geometry, PaddleGeometry};
pub use picture_file::{PictureError, PictureFormat, write_picture};
pub use preflight::{OutputRefused, RefusalReason, check_outputs};
pub use state::{NodalFields, State, has_stress};
pub use together::{Together, end_between_results, together};
pub use told::told;

use destination::Destination;
use std::io::{self, Write as _};
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

/// Writes a file whole or not at all: into a temporary file in the same folder, synced, then renamed over the target. What
/// is behind a symbolic link is written, and the link stays; devices, pipes and `/dev/stdout` are written to as they are.
///
/// # Errors
/// [`OutputError`] names the file; whatever was there before is untouched.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let fail = |source| OutputError { path: path.to_owned(), source };
    match Destination::of(path).map_err(fail)? {
        Destination::Stream(stream) => destination::write_stream(&stream, bytes),
        Destination::File(file) => replace(&file, bytes),
    }
    .map_err(fail)
}

/// Whether a path is of something that bytes flow into, a pipe, a device or `/dev/stdout`: nothing can be put beside it.
pub fn is_stream(path: &Path) -> bool {
    matches!(Destination::of(path), Ok(Destination::Stream(_)))
}

/// Puts a file with these bytes in place of what is there.
fn replace(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let _together = together();
    let mut builder = tempfile::Builder::new();
    builder.prefix(".stillpoint-");
    // Temporary files are private; a result is for whom the umask lets read it.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(destination::folder_of(path))?;
    file.write_all(bytes)?;
    // Who has closed a file to others finds it closed afterwards.
    if let Ok(before) = path.metadata() {
        file.as_file().set_permissions(before.permissions())?;
    }
    file.as_file().sync_all()?;
    file.persist(path).map_err(|refused| refused.error)?;
    Ok(())
}

/// Makes a folder for results, with those above it.
///
/// # Errors
/// [`OutputError`] names the folder.
pub fn make_folder(path: &Path) -> Result<(), OutputError> {
    let fail = |error: io::Error| match error.kind() {
        io::ErrorKind::AlreadyExists => {
            io::Error::new(error.kind(), "a file of that name is where a folder is to be: name another")
        }
        _ => error,
    };
    std::fs::create_dir_all(path).map_err(|error| OutputError { path: path.to_owned(), source: fail(error) })
}

#[cfg(all(test, unix))]
mod tests {
    use super::{make_folder, write_whole};
    use std::fs;
    use std::os::unix::fs::{PermissionsExt as _, symlink};

    #[test]
    fn a_folder_is_not_made_where_a_file_is() {
        let folder = tempfile::tempdir().unwrap();
        let taken = folder.path().join("taken");
        fs::write(&taken, "kept").unwrap();
        let refused = make_folder(&taken).unwrap_err().to_string();
        assert!(refused.contains("taken: a file of that name is where a folder is to be: name another"), "{refused}");
        assert_eq!(fs::read_to_string(&taken).unwrap(), "kept");
        // One that is there already serves.
        make_folder(&folder.path().join("a/b")).unwrap();
        make_folder(&folder.path().join("a")).unwrap();
    }

    #[test]
    fn a_link_stays_and_what_is_behind_it_is_replaced_whole() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("sub")).unwrap();
        fs::write(at("sub/file"), b"older and longer").unwrap();
        fs::set_permissions(at("sub/file"), fs::Permissions::from_mode(0o600)).unwrap();
        symlink("sub/file", at("link")).unwrap();
        symlink("sub/none", at("dangling")).unwrap();
        for (name, behind) in [("link", "sub/file"), ("dangling", "sub/none")] {
            write_whole(&at(name), b"new").unwrap();
            assert!(at(name).is_symlink(), "{name}");
            assert_eq!(fs::read(at(behind)).unwrap(), b"new");
        }
        assert_eq!(at("sub/file").metadata().unwrap().permissions().mode() & 0o777, 0o600);
        symlink("round", at("round")).unwrap();
        let refused = write_whole(&at("round"), b"new").unwrap_err();
        assert_eq!(refused.path, at("round"));
        assert!(at("round").is_symlink());
        symlink("no/such/folder", at("nowhere")).unwrap();
        write_whole(&at("nowhere"), b"new").unwrap_err();
        write_whole(&at("sub"), b"new").unwrap_err();
        // No temporary file is left: what was made, and nothing else.
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 5);
        assert_eq!(fs::read_dir(at("sub")).unwrap().count(), 2);
    }
}
