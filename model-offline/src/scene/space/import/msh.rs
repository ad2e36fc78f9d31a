//! Tetrahedra of Gmsh: versions 2.2 and 4.1, as text or binary.

use super::error::{Noted, Place, ReadError};
use super::tetrahedra::{Group, Tetrahedra};
use crate::scene::import::{ImportError, gmsh};

const FORMAT: &str = "Gmsh";

/// Reads the tetrahedra and the physical groups of volumes; elements of fewer dimensions are left out.
///
/// # Errors
/// [`ReadError`] names the line or the byte.
pub fn read(bytes: &[u8]) -> Result<Noted<Tetrahedra>, ReadError> {
    let solid = gmsh::solid::read(bytes).map_err(|wrong| match wrong {
        ImportError::Syntax { line: 0, what } => ReadError::broken(FORMAT, Place::Whole, what),
        ImportError::Syntax { line, what } => ReadError::broken(FORMAT, Place::Line(line), what),
        ImportError::Binary { at, what } => ReadError::broken(FORMAT, Place::Byte(at), what),
        other => ReadError::unsupported(FORMAT, other.to_string(), "export the mesh as version 4.1 in ASCII"),
    })?;
    if solid.others > 0 {
        let what = format!("{} solid elements are no tetrahedra", solid.others);
        return Err(ReadError::unsupported(FORMAT, what, "mesh the body with tetrahedra alone"));
    }
    if solid.tetrahedra.is_empty() {
        let help = "mesh the volume (in Gmsh: Mesh, 3D), and save all elements or volumes that are in a physical group";
        return Err(ReadError::unsupported(FORMAT, "no tetrahedra are in it", help));
    }
    let told = |count: usize| format!("{count} tetrahedra have nodes between their corners, which are left out");
    let group = |(label, (name, members))| Group { label, name, members };
    let mesh = Tetrahedra {
        nodes: solid.nodes,
        tetrahedra: solid.tetrahedra,
        groups: solid.groups.into_iter().map(group).collect(),
    };
    Ok(Noted {
        value: mesh.distinct(FORMAT)?,
        notes: Some(solid.curved).filter(|count| *count > 0).map(told).into_iter().collect(),
    })
}
