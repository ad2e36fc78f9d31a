mod labels;
mod robust;
mod surfaces;
mod tetrahedra;

/// A file that another program wrote: trimesh, vtk, nibabel, pynrrd, Gmsh or meshio.
fn made(name: &str) -> Vec<u8> {
    let path = format!("{}/tests/data3d/{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read(&path).unwrap_or_else(|wrong| panic!("{path}: {wrong}"))
}
