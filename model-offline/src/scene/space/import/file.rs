//! Files by their names' endings.

use super::error::{FileError, Noted, ReadError};
use super::tetrahedra::Tetrahedra;
use super::{msh, nifti, nrrd, obj, ply, stl, vtu};
use crate::geometry::labels::Labels;
use crate::geometry::surface::TriangleSurface;
use crate::reading;
use std::path::Path;

/// Files that bundled scenes name.
const BUNDLED: [(&str, &[u8]); 1] = [("scan.nii.gz", include_bytes!("../../../../scenes/scan.nii.gz"))];

/// What a file holds: a bundled one where there is none of its name.
///
/// # Errors
/// [`FileError::Io`].
pub fn bytes(path: &Path) -> Result<Vec<u8>, FileError> {
    let found = BUNDLED.iter().find(|(name, _)| Path::new(name) == path && !path.exists());
    found.map_or_else(
        || reading::read(path, reading::DATA).map_err(|source| FileError::Io { path: path.into(), source }),
        |(_, bytes)| Ok(bytes.to_vec()),
    )
}

fn read<T>(
    path: &Path,
    wanted: &'static str,
    endings: &'static str,
    reader: impl Fn(&str) -> Option<fn(&[u8]) -> Result<T, ReadError>>,
) -> Result<T, FileError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let reader = reader(&name).ok_or_else(|| FileError::Ending { path: path.into(), wanted, endings })?;
    let bytes = bytes(path)?;
    reader(&bytes).map_err(|source| FileError::Read { path: path.into(), source })
}

/// Reads a surface from a `.stl`, `.obj` or `.ply` file; nothing is checked about it yet.
///
/// # Errors
/// [`FileError`] names the file, the place in it, and what to do.
pub fn surface(path: &Path) -> Result<Noted<TriangleSurface>, FileError> {
    read(path, "a surface", ".stl, .obj or .ply", |name| match name.rsplit('.').next()? {
        "stl" => Some(stl::read),
        "obj" => Some(obj::read),
        "ply" => Some(ply::read),
        _ => None,
    })
}

/// Reads tetrahedra from a `.msh` or `.vtu` file; nothing is checked about how they fit.
///
/// # Errors
/// [`FileError`] names the file, the place in it, and what to do.
pub fn mesh(path: &Path) -> Result<Noted<Tetrahedra>, FileError> {
    read(path, "a mesh of tetrahedra", ".msh (Gmsh) or .vtu (VTK)", |name| match name.rsplit('.').next()? {
        "msh" => Some(msh::read),
        "vtu" => Some(vtu::read),
        _ => None,
    })
}

/// Reads a segmentation from a `.nii`, `.nii.gz` or `.nrrd` file (also `.seg.nrrd`).
///
/// # Errors
/// [`FileError`] names the file, the place in it, and what to do.
pub fn labels(path: &Path) -> Result<Noted<Labels>, FileError> {
    read(path, "a segmentation", ".nii, .nii.gz or .nrrd", |name| {
        if name.ends_with(".nii") || name.ends_with(".nii.gz") {
            Some(nifti::read)
        } else if name.ends_with(".nrrd") || name.ends_with(".nhdr") {
            Some(nrrd::read)
        } else {
            None
        }
    })
}
