//! Bodies given by tetrahedra: their outer boundary is the body's surface, that of a group a part's.

use super::import::tetrahedra::{Group, Tetrahedra};
use crate::discretization::TetMesh;
use crate::geometry::Point;
use crate::geometry::point::{digits, shown};
use crate::geometry::surface::{CheckedSurface, SurfaceError, TriangleSurface, welded_points};

/// Volumes of tetrahedra and of what they enclose differ by this part at most.
const SAME_VOLUME: f64 = 1e-5;
/// Groups that are told of at most.
const TOLD: usize = 20;

/// Why tetrahedra are no body.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum MeshError {
    /// Faces that one tetrahedron has do not close.
    #[error("the outer faces of the tetrahedra are no closed surface: {0}")]
    Boundary(SurfaceError),
    /// The same of a group.
    #[error("the outer faces of group {group} are no closed surface: {wrong}")]
    Part { group: String, wrong: SurfaceError },
    /// Tetrahedra lie in each other.
    #[error("the tetrahedra have a volume of {tetrahedra} together and enclose {enclosed}: they overlap")]
    Overlap { tetrahedra: String, enclosed: String },
    /// No group is called so.
    #[error("the mesh has no group {wanted}")]
    NoGroup { wanted: String, groups: Vec<String> },
    /// Several groups are called so.
    #[error("the mesh has several groups {wanted}")]
    Ambiguous { wanted: String },
}

impl MeshError {
    pub(super) fn help(&self) -> String {
        match self {
            Self::Boundary(_) | Self::Overlap { .. } => {
                "tetrahedra have to share whole faces, without gaps or hanging nodes: unite the volumes before meshing \
                 (in Gmsh: Coherence, or BooleanFragments), and export the mesh again"
                    .to_owned()
            }
            Self::Part { .. } => "parts of a group that touch in an edge alone have to be groups of their own".to_owned(),
            Self::NoGroup { groups, .. } if groups.is_empty() => {
                "the mesh has no groups of volumes: make physical volumes where it is made, or describe the inclusion by \
                 another shape"
                    .to_owned()
            }
            Self::NoGroup { groups, .. } => format!("it has {}", groups.join(", ")),
            Self::Ambiguous { .. } => "name it by its label".to_owned(),
        }
    }
}

/// A body of tetrahedra.
#[derive(Debug)]
pub(super) struct MeshBody {
    mesh: TetMesh,
    groups: Vec<Group>,
    surface: CheckedSurface,
}

/// How an inclusion names its group.
#[derive(Debug, Clone, Copy)]
pub(super) enum Wanted<'a> {
    Label(i64),
    Name(&'a str),
}

impl Wanted<'_> {
    fn is(&self, group: &Group) -> bool {
        match self {
            Self::Label(label) => group.label == *label,
            Self::Name(name) => group.name.as_deref() == Some(*name),
        }
    }

    fn told(&self) -> String {
        match self {
            Self::Label(label) => label.to_string(),
            Self::Name(name) => format!("{name:?}"),
        }
    }
}

impl MeshBody {
    /// Nodes in one place become one, inverted tetrahedra are turned; both is told, as are the groups.
    pub(super) fn new(read: Tetrahedra) -> Result<(Self, Vec<String>), MeshError> {
        let mut notes = Vec::new();
        let (nodes, place) = welded_points(&read.nodes);
        if nodes.len() < read.nodes.len() {
            notes.push(format!(
                "{} nodes lie where others do and are made one with them",
                read.nodes.len() - nodes.len()
            ));
        }
        let tetrahedra = read.tetrahedra.iter().map(|t| t.map(|node| place[node as usize])).collect::<Vec<_>>();
        let mut mesh = TetMesh { nodes, part: vec![0; tetrahedra.len()], tetrahedra };
        let volumes = mesh.volumes();
        let total: f64 = volumes.iter().map(|volume| volume.abs()).sum();
        // Some programs order all corners the other way.
        let inverted: Vec<usize> = (0..volumes.len()).filter(|t| volumes[*t] < 0.0).collect();
        if let Some(first) = inverted.first() {
            let at = shown(&(mesh.corners(*first).iter().sum::<Point<3>>() / 4.0));
            notes.push(format!("{} tetrahedra were inside out and are turned, the first around {at}", inverted.len()));
        }
        inverted.into_iter().for_each(|t| mesh.tetrahedra[t].swap(0, 1));
        let surface = outer(&mesh, 0..mesh.tetrahedra.len()).check().map_err(MeshError::Boundary)?;
        notes.push(format!("{} tetrahedra; the body is what their outer faces enclose", mesh.tetrahedra.len()));
        if (total - surface.volume()).abs() > SAME_VOLUME * total {
            let (tetrahedra, enclosed) = (digits(total), digits(surface.volume()));
            return Err(MeshError::Overlap { tetrahedra, enclosed });
        }
        for group in read.groups.iter().take(TOLD) {
            let volume: f64 = group.members.iter().map(|t| volumes[*t as usize].abs()).sum();
            let (told, volume) = (told(group), digits(volume));
            notes.push(format!("group {told}: {} tetrahedra, volume {volume}", group.members.len()));
        }
        Ok((Self { mesh, groups: read.groups, surface }, notes))
    }

    pub(super) fn surface(&self) -> &CheckedSurface {
        &self.surface
    }

    /// What a group encloses.
    pub(super) fn part(&self, wanted: Wanted<'_>) -> Result<CheckedSurface, MeshError> {
        let mut found = self.groups.iter().filter(|group| wanted.is(group));
        let Some(group) = found.next() else {
            let groups = self.groups.iter().map(told).collect();
            return Err(MeshError::NoGroup { wanted: wanted.told(), groups });
        };
        if found.next().is_some() {
            return Err(MeshError::Ambiguous { wanted: wanted.told() });
        }
        let surface = outer(&self.mesh, group.members.iter().map(|t| *t as usize));
        surface.check_within(&self.surface).map_err(|wrong| MeshError::Part { group: told(group), wrong })
    }
}

/// A group in words.
fn told(group: &Group) -> String {
    group.name.as_ref().map_or_else(|| group.label.to_string(), |name| format!("{} ({name:?})", group.label))
}

/// Faces that one of these tetrahedra has alone.
fn outer(mesh: &TetMesh, members: impl Iterator<Item = usize>) -> TriangleSurface {
    let tetrahedra: Vec<[u32; 4]> = members.map(|t| mesh.tetrahedra[t]).collect();
    let part = TetMesh { nodes: mesh.nodes.clone(), part: vec![0; tetrahedra.len()], tetrahedra };
    let corners = |t: [u32; 3]| t.map(|node| part.nodes[node as usize]);
    TriangleSurface::of_soup(&part.boundary().into_iter().map(corners).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Implicit as _;

    /// A box of so many cubes, each cut into six tetrahedra round its diagonal; the cubes of group 1 and of group 2.
    fn cubes(size: [u32; 3], is_second: impl Fn([u32; 3]) -> bool) -> Tetrahedra {
        let [x, y, z] = size;
        let node = |i: u32, j: u32, k: u32| i + (x + 1) * (j + (y + 1) * k);
        let mut mesh = Tetrahedra::default();
        for (k, j, i) in (0..=z).flat_map(|k| (0..=y).flat_map(move |j| (0..=x).map(move |i| (k, j, i)))) {
            mesh.nodes.push(Point::<3>::new(f64::from(i), f64::from(j), f64::from(k)));
        }
        let mut members = [Vec::new(), Vec::new()];
        for (k, j, i) in (0..z).flat_map(|k| (0..y).flat_map(move |j| (0..x).map(move |i| (k, j, i)))) {
            for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
                let mut at = [i, j, k];
                let mut corners = [node(i, j, k); 4];
                for (corner, axis) in corners[1..].iter_mut().zip(order) {
                    at[axis] += 1;
                    *corner = node(at[0], at[1], at[2]);
                }
                members[usize::from(is_second([i, j, k]))].push(mesh.tetrahedra.len() as u32);
                mesh.tetrahedra.push(corners);
            }
        }
        let group = |(label, name, members): (i64, &str, Vec<u32>)| Group { label, name: Some(name.into()), members };
        let [first, second] = members;
        mesh.groups = [(1, "tissue", first), (2, "tumour", second)].map(group).to_vec();
        mesh
    }

    fn middle(at: [u32; 3]) -> bool {
        at == [1, 1, 1]
    }

    #[test]
    fn the_outer_faces_are_the_body_and_those_of_a_group_its_part() {
        let (body, notes) = MeshBody::new(cubes([3, 4, 5], middle)).unwrap();
        assert!((body.surface().volume() - 60.0).abs() < 1e-12);
        // Half of them are ordered the other way round.
        assert!(notes.iter().any(|note| note.contains("180 tetrahedra were inside out")), "{notes:?}");
        assert!(notes.iter().any(|note| note.contains("2 (\"tumour\"): 6 tetrahedra, volume 1")), "{notes:?}");
        for wanted in [Wanted::Label(2), Wanted::Name("tumour")] {
            let part = body.part(wanted).unwrap();
            assert!((part.volume() - 1.0).abs() < 1e-12 && part.level(&Point::repeat(1.5)) == -0.5);
        }
        // The rest has a cavity.
        assert_eq!(body.part(Wanted::Name("tissue")).unwrap().volumes().len(), 2);
        let wrong = body.part(Wanted::Name("bone")).unwrap_err();
        assert!(wrong.help().contains("2 (\"tumour\")"), "{}", wrong.help());
    }

    #[test]
    fn gaps_hanging_nodes_and_overlaps_are_refused_with_their_place() {
        let changed = |change: &dyn Fn(&mut Tetrahedra)| {
            let mut mesh = cubes([2, 2, 2], middle);
            change(&mut mesh);
            MeshBody::new(mesh)
        };
        // A node of its own for one tetrahedron, a little beside.
        let apart = changed(&|mesh| {
            mesh.nodes.push(Point::<3>::new(1.0, 1.0, 1.001));
            mesh.tetrahedra[0] = mesh.tetrahedra[0].map(|n| if n == 13 { 27 } else { n });
        });
        assert!(matches!(apart, Err(MeshError::Boundary(SurfaceError::Branching { .. }))), "{apart:?}");
        // A cube pushed a quarter into its neighbour, whose nodes are its own.
        let overlapping = changed(&|mesh| {
            let other = cubes([1, 1, 1], |_| false);
            mesh.tetrahedra.extend(other.tetrahedra.iter().map(|t| t.map(|n| n + 27)));
            mesh.nodes.extend(other.nodes.iter().map(|x| x.add_scalar(1.75)));
        });
        assert!(matches!(overlapping, Err(MeshError::Boundary(SurfaceError::SelfIntersection { .. }))));
        // The same tetrahedra twice: their faces are nobody's alone.
        let twice = changed(&|mesh| mesh.tetrahedra.extend_from_within(..6));
        assert!(twice.is_err(), "{twice:?}");
        // Equal nodes with numbers of their own are one.
        let (body, notes) = changed(&|mesh| {
            mesh.nodes.push(mesh.nodes[13]);
            mesh.tetrahedra[0] = mesh.tetrahedra[0].map(|n| if n == 13 { 27 } else { n });
        })
        .unwrap();
        assert!((body.surface().volume() - 8.0).abs() < 1e-12 && notes[0].contains("1 nodes"), "{notes:?}");
    }
}
