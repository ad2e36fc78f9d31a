use super::super::tetrahedra::Tetrahedra;
use super::super::*;
use super::made;
use crate::geometry::Point;

/// A box of 6 by 4 by 3 with one of 2 by 2 by 1 in it, meshed by Gmsh and written by Gmsh, meshio and VTK.
pub(super) const FILES: [&str; 12] = [
    "tets_gmsh_22.msh",
    "tets_gmsh_22_binary.msh",
    "tets_gmsh_41.msh",
    "tets_gmsh_41_binary.msh",
    "tets_gmsh_quadratic.msh",
    "tets_meshio_ascii.vtu",
    "tets_meshio_raw.vtu",
    "tets_meshio_zlib.vtu",
    "tets_vtk_appended_base64.vtu",
    "tets_vtk_appended_raw.vtu",
    "tets_vtk_inline.vtu",
    "tets_vtk_inline_zlib.vtu",
];

fn read(name: &str, bytes: &[u8]) -> Result<Noted<Tetrahedra>, ReadError> {
    if name.ends_with(".msh") { msh::read(bytes) } else { vtu::read(bytes) }
}

fn volume(mesh: &Tetrahedra, members: impl Iterator<Item = u32>) -> f64 {
    let of = |t: u32| {
        let [a, b, c, d]: [Point<3>; 4] = mesh.tetrahedra[t as usize].map(|node| mesh.nodes[node as usize]);
        ((b - a).cross(&(c - a)).dot(&(d - a)) / 6.0).abs()
    };
    members.map(of).sum()
}

#[test]
fn every_file_holds_both_boxes() {
    for name in FILES {
        let found = read(name, &made(name)).unwrap_or_else(|wrong| panic!("{name}: {wrong}"));
        let mesh = found.value;
        assert_eq!(mesh.tetrahedra.len(), 156, "{name}");
        let all = volume(&mesh, 0..156);
        assert!((all - 72.0).abs() < 1e-9, "{name}: {all}");
        let groups: Vec<(i64, f64)> =
            mesh.groups.iter().map(|g| (g.label, volume(&mesh, g.members.iter().copied()))).collect();
        let is =
            |(found, expected): (&(i64, f64), (i64, f64))| found.0 == expected.0 && (found.1 - expected.1).abs() < 1e-9;
        assert!(groups.len() == 2 && groups.iter().zip([(3, 68.0), (7, 4.0)]).all(is), "{name}: {groups:?}");
        let names: Vec<Option<&str>> = mesh.groups.iter().map(|g| g.name.as_deref()).collect();
        let expected = if name.ends_with(".msh") { [Some("tissue"), Some("tumour")] } else { [None, None] };
        assert_eq!(names, expected, "{name}");
        let curved = found.notes.iter().any(|note| note.contains("nodes between their corners"));
        assert_eq!(curved, name.contains("quadratic"), "{name}: {:?}", found.notes);
    }
}

#[test]
fn what_is_wrong_with_a_mesh_is_said() {
    let has = |name: &str, from: &str, to: &str, parts: &[&str]| {
        let text = String::from_utf8(made(name)).unwrap();
        assert!(text.contains(from), "{from}");
        let told = read(name, text.replacen(from, to, 1).as_bytes()).unwrap_err().to_string();
        assert!(parts.iter().all(|part| told.contains(part)), "{told:?} has not all of {parts:?}");
    };
    let (msh, vtu) = ("tets_gmsh_22.msh", "tets_meshio_ascii.vtu");
    has(msh, "$Elements", "$Nothing", &["Gmsh", "no tetrahedra", "mesh the volume"]);
    has(msh, "2.2 0 8", "4.0 0 8", &["Gmsh", "4.1"]);
    has(msh, "\n1 2 1 2", "\n1 2 nan 2", &["Gmsh, line", "finite"]);
    has(vtu, "UnstructuredGrid", "PolyData", &["VTU", "PolyData", "unstructured grid"]);
    has(vtu, "\"offsets\"", "\"offset\"", &["VTU", "offsets"]);
    has(vtu, "Int32", "Complex", &["VTU", "type"]);
    has(vtu, "<Points>", "<Pints>", &["VTU", "XML"]);
    // Damaged, and yet every number of it can be read.
    has(msh, "$Elements\n156", "$Elements\n155", &["Gmsh, line", "$Elements has more in it than it counts"]);
    has(msh, "$Nodes\n46", "$Nodes\n45", &["Gmsh, line", "$Nodes has more in it than it counts"]);
    has(msh, "\n1 4 2 7 2 3 7 30 28", "\n1 4 2 7 2 3 7 30 30", &["Gmsh", "tetrahedron 0", "node twice"]);
    has(msh, "\n2 4 2 7 2 3 1 25 30", "\n2 4 2 7 2 30 7 3 28", &["Gmsh", "tetrahedron of nodes", "twice"]);
    has("tets_gmsh_41.msh", "\n3 2 4 24\n", "\n3 9 4 24\n", &["Gmsh, line", "volume 9", "$Entities"]);
    has(vtu, "NumberOfPoints=\"46\"", "NumberOfPoints=\"47\"", &["VTU", "NumberOfPoints", "46 are there"]);
    has(vtu, "NumberOfCells=\"156\"", "NumberOfCells=\"155\"", &["VTU", "NumberOfCells", "156 are there"]);
    // Only lines and points, and a hexahedron.
    let hex = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1\n1 0 0 0\n$EndNodes\n\
               $Elements\n1\n1 5 2 1 1 1 1 1 1 1 1 1 1\n$EndElements\n";
    let told = msh::read(hex.as_bytes()).unwrap_err().to_string();
    assert!(told.contains("no tetrahedra") && told.contains("alone"), "{told}");
}
