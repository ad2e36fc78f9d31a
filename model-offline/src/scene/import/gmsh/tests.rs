use super::*;
use crate::geometry::Point2;
use crate::material::Preset;

/// A 4 by 2 block of two squares, each cut into two triangles; both are one surface.
const V2: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n6\n1 0 0 0\n2 2 0 0\n3 4 0 0\n4 0 2 0\n5 2 2 0\n6 4 2 0\n$EndNodes\n\
    $Elements\n5\n1 15 2 0 1 1\n2 2 2 7 1 1 2 5\n3 2 2 7 1 1 5 4\n4 2 2 7 1 2 3 6\n5 2 2 7 1 2 6 5\n$EndElements\n";
const V4: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n2 4 1 4\n0 1 0 1\n1\n0 0 0\n2 1 0 3\n2\n3\n4\n3 0 0\n3 1 0\n0 1 0\n$EndNodes\n\
    $Elements\n1 4 1 4\n1 1 1 4\n1 1 2\n2 2 3\n3 3 4\n4 4 1\n$EndElements\n";

fn from(text: &str) -> Result<Imported, ImportError> {
    read(text.as_bytes(), &ImportOptions::default())
}

#[test]
fn both_versions_give_the_boundary() {
    let triangles = from(V2).unwrap().outline;
    assert_eq!(triangles.vertices().len(), 4, "points between collinear edges are left out");
    assert!((triangles.area() - 8.0).abs() < 1e-12);
    let lines = from(V4).unwrap().outline;
    assert!((lines.area() - 3.0).abs() < 1e-12);
}

#[test]
fn broken_meshes_are_refused() {
    assert!(matches!(from(&V2.replace("2.2 0", "3.0 0")), Err(ImportError::Unsupported(_))));
    assert!(matches!(from(&V2.replace("2.2 0 8", "2.2 0 4")), Err(ImportError::Unsupported(_))));
    assert!(matches!(from(&V2.replace("3 4 0 0", "3 four 0 0")), Err(ImportError::Syntax { line: 8, .. })));
    assert!(matches!(from(&V2.replace("3 4 0 0", "3 nan 0 0")), Err(ImportError::Syntax { line: 8, .. })));
    assert!(matches!(from(&V4.replace("4 4 1\n", "4 4 9\n")), Err(ImportError::Syntax { .. })));
    assert!(matches!(from(""), Err(ImportError::NoOutline(_))));
    assert!(from(&V2[..150]).is_err());
    assert!(matches!(from(&V2.replace("5 2 2 7", "5 77 2 7")), Err(ImportError::Syntax { .. })));
    // No line is to blame.
    let missing = from(&V2.replace("3 4 0 0", "33 4 0 0")).unwrap_err().to_string();
    assert!(missing.starts_with("node 3 is used and not given"), "{missing}");
    assert!(matches!(from(&V2.replace("5 2 2 7", "5 2 9000000000 7")), Err(ImportError::Syntax { .. })));
    assert!(matches!(
        from(&V2.replace("\n6\n1 0 0 0", "\n18446744073709551615\n1 0 0 0")),
        Err(ImportError::Syntax { .. })
    ));
    assert!(matches!(from("$Nodes\n1\n"), Err(ImportError::Syntax { .. })));
}

/// A mesh of quadrangles with everything that a scene has: 6 by 4 squares of 10 mm.
struct Example;

/// Groups: dimension, number, name.
const GROUPS: [(i32, i32, &str); 7] = [
    (2, 1, "Body-breast-fat"),
    (2, 2, "inclusion-liver"),
    (1, 3, "fixed"),
    (1, 4, "paddle-2"),
    (1, 5, "needle"),
    (0, 6, "target"),
    (1, 8, "free surface"),
];

impl Example {
    fn nodes() -> Vec<(i32, [f64; 3])> {
        (0..35).map(|i| (i + 1, [f64::from(i % 7) * 10.0, f64::from(i / 7) * 10.0, 0.0])).collect()
    }

    fn node(x: i32, y: i32) -> i32 {
        1 + x + 7 * y
    }

    /// Elements: type, group, nodes.
    fn elements() -> Vec<(i32, i32, Vec<i32>)> {
        let n = Self::node;
        let mut all = Vec::new();
        all.push((15, 6, vec![n(2, 2)]));
        all.extend((1..5).map(|x| (1, 3, vec![n(x, 0), n(x + 1, 0)])));
        all.push((1, 4, vec![n(6, 2), n(6, 3)]));
        all.push((1, 5, vec![n(2, 4), n(3, 4)]));
        all.push((1, 8, vec![n(0, 4), n(1, 4)]));
        for (x, y) in (0..4).flat_map(|y| (0..6).map(move |x| (x, y))) {
            let is_inside = (3..5).contains(&x) && (1..3).contains(&y);
            all.push((3, if is_inside { 2 } else { 1 }, vec![n(x, y), n(x + 1, y), n(x + 1, y + 1), n(x, y + 1)]));
        }
        all
    }

    fn names() -> String {
        let lines: String =
            GROUPS.iter().map(|(dimension, tag, name)| format!("{dimension} {tag} \"{name}\"\n")).collect();
        format!("$PhysicalNames\n{}\n{lines}$EndPhysicalNames\n", GROUPS.len())
    }

    fn ascii_2() -> Vec<u8> {
        let nodes: String = Self::nodes().iter().map(|(tag, [x, y, z])| format!("{tag} {x} {y} {z}\n")).collect();
        let words = |nodes: &[i32]| nodes.iter().map(|n| format!(" {n}")).collect::<String>();
        let elements = Self::elements();
        let lines: String = elements
            .iter()
            .enumerate()
            .map(|(i, (kind, group, nodes))| format!("{} {kind} 2 {group} {group}{}\n", i + 1, words(nodes)))
            .collect();
        let names = Self::names();
        let count = elements.len();
        format!(
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{names}$Nodes\n35\n{nodes}$EndNodes\n$Elements\n{count}\n{lines}$EndElements\n"
        )
        .into_bytes()
    }

    fn binary_2() -> Vec<u8> {
        let mut out = b"$MeshFormat\n2.2 1 8\n".to_vec();
        let ints = |out: &mut Vec<u8>, numbers: &[i32]| numbers.iter().for_each(|n| out.extend(n.to_le_bytes()));
        ints(&mut out, &[1]);
        out.extend(b"\n$EndMeshFormat\n");
        out.extend(Self::names().bytes());
        out.extend(b"$Nodes\n35\n");
        for (tag, x) in Self::nodes() {
            ints(&mut out, &[tag]);
            x.iter().for_each(|x| out.extend(x.to_le_bytes()));
        }
        let elements = Self::elements();
        out.extend(format!("\n$EndNodes\n$Elements\n{}\n", elements.len()).bytes());
        for (i, part) in (1..).zip(elements.chunk_by(|a, b| a.0 == b.0)) {
            ints(&mut out, &[part[0].0, part.len() as i32, 2]);
            for (_, group, nodes) in part {
                ints(&mut out, &[i, *group, *group]);
                ints(&mut out, nodes);
            }
        }
        out.extend(b"\n$EndElements\n");
        out
    }

    /// Version 4.1, by what writes an int, a size, a number, and text.
    fn version_4(binary: bool) -> Vec<u8> {
        let mut out = format!("$MeshFormat\n4.1 {} 8\n", i32::from(binary)).into_bytes();
        let int = |out: &mut Vec<u8>, n: i32| {
            if binary { out.extend(n.to_le_bytes()) } else { out.extend(format!("{n} ").bytes()) }
        };
        let size = |out: &mut Vec<u8>, n: usize| {
            if binary { out.extend((n as u64).to_le_bytes()) } else { out.extend(format!("{n}\n").bytes()) }
        };
        let number = |out: &mut Vec<u8>, x: f64| {
            if binary { out.extend(x.to_le_bytes()) } else { out.extend(format!("{x} ").bytes()) }
        };
        if binary {
            int(&mut out, 1);
        }
        out.extend(format!("\n$EndMeshFormat\n{}$Entities\n", Self::names()).bytes());
        // An entity for every group, with 10 more than its number; the second one is turned round.
        let of = |dimension: i32| GROUPS.iter().filter(move |group| group.0 == dimension);
        (0..4).for_each(|dimension| size(&mut out, of(dimension).count()));
        for (dimension, tag, _) in (0..3).flat_map(of) {
            int(&mut out, tag + 10);
            (0..if *dimension == 0 { 3 } else { 6 }).for_each(|_| number(&mut out, 0.5));
            size(&mut out, 1);
            int(&mut out, if *tag == 4 { -tag } else { *tag });
            if *dimension > 0 {
                size(&mut out, 2);
                int(&mut out, 1);
                int(&mut out, -2);
            }
        }
        out.extend(b"\n$EndEntities\n$Nodes\n");
        let nodes = Self::nodes();
        [1, 35, 1, 35].into_iter().for_each(|n| size(&mut out, n));
        [2, 11, 0].into_iter().for_each(|n| int(&mut out, n));
        size(&mut out, 35);
        nodes.iter().for_each(|(tag, _)| size(&mut out, *tag as usize));
        nodes.iter().flat_map(|(_, x)| x).for_each(|x| number(&mut out, *x));
        out.extend(b"\n$EndNodes\n$Elements\n");
        let elements = Self::elements();
        let parts: Vec<_> = elements.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).collect();
        [parts.len(), elements.len(), 1, elements.len()].into_iter().for_each(|n| size(&mut out, n));
        for part in parts {
            let (kind, group, _) = &part[0];
            [2, group + 10, *kind].into_iter().for_each(|n| int(&mut out, n));
            size(&mut out, part.len());
            for (_, _, nodes) in part {
                size(&mut out, 1);
                nodes.iter().for_each(|n| size(&mut out, *n as usize));
            }
        }
        out.extend(b"\n$EndElements\n");
        out
    }
}

/// The same body in all four formats: roles, materials and numbers by hand.
#[test]
fn all_formats_give_the_same_scene() {
    use crate::scene::Scene;
    use crate::scene::starter::{StarterNames, imported};

    let formats = [Example::ascii_2(), Example::binary_2(), Example::version_4(false), Example::version_4(true)];
    let texts = formats.map(|bytes| {
        let mut read = read(&bytes, &ImportOptions::default()).unwrap();
        assert_eq!((read.material, read.inclusions[0].material), (Some(Preset::BreastFat), Some(Preset::Liver)));
        let left: Vec<&str> = read.summary.left_out.iter().map(|left| left.what.as_str()).collect();
        assert_eq!(left, ["lines `free surface`"]);
        let names = StarterNames { name: "mesh".into(), length: "mm".into(), stress: "kPa".into() };
        let text = imported(&names, &mut read).unwrap();
        assert_eq!(read.summary.suggested, ["depth of the needle"], "{:?}", read.summary);
        text
    });
    assert!(texts.iter().all(|text| *text == texts[0]));
    let scene = Scene::parse(&texts[0], "mesh").unwrap();
    assert_eq!((scene.outline.area(), scene.inclusions.len(), scene.inclusions[0].outline.area()), (2400.0, 1, 400.0));
    assert_eq!(scene.immobile, [[[10.0, 0.0], [50.0, 0.0]].map(Point2::from).to_vec()]);
    assert_eq!(scene.target, Point2::new(20.0, 20.0));
    assert_eq!((scene.paddles.len(), scene.paddles[0].index), (1, 2));
    let mut ends = scene.paddles[0].segment.map(|p| [p.x, p.y]);
    ends.sort_by(|a, b| a[1].total_cmp(&b[1]));
    assert_eq!(ends, [[60.0, 20.0], [60.0, 30.0]]);
    assert_eq!((scene.needle.axis, scene.needle.entry()), (Point2::new(0.0, -1.0), Point2::new(25.0, 40.0)));
}

/// Who names lines means all that matter; a mesh without names has lines of its curves.
#[test]
fn a_line_without_a_name_among_others_is_told() {
    let text = String::from_utf8(Example::ascii_2()).unwrap();
    let count = |names: usize| format!("$PhysicalNames\n{names}\n");
    let unnamed: String =
        text.lines().filter(|line| !line.contains("free surface")).map(|line| format!("{line}\n")).collect();
    let unnamed = unnamed.replace(&count(GROUPS.len()), &count(GROUPS.len() - 1));
    let read = read(unnamed.as_bytes(), &ImportOptions::default()).unwrap();
    let left: Vec<&str> = read.summary.left_out.iter().map(|left| left.what.as_str()).collect();
    assert_eq!(left, ["a line without a name"]);
    assert!(read.summary.left_out[0].why.contains("physical group"), "{:?}", read.summary);
}

#[test]
fn binary_files_that_are_cut_off_or_turned_round_are_refused() {
    let is_typed = |bytes: &[u8]| match read(bytes, &ImportOptions::default()) {
        Ok(_) => false,
        Err(ImportError::Binary { what, .. } | ImportError::Syntax { what, .. }) => !what.is_empty(),
        Err(ImportError::NoOutline(_)) => true,
        Err(error) => panic!("{error}"),
    };
    for whole in [Example::binary_2(), Example::version_4(true)] {
        let end = whole.len() - "\n$EndElements\n".len();
        for cut in (0..end).step_by(7) {
            assert!(is_typed(&whole[..cut]), "cut at {cut}");
        }
        let mut turned = whole.clone();
        let at = whole.iter().position(|byte| *byte == 1).unwrap();
        turned[at..at + 4].reverse();
        let refused = read(&turned, &ImportOptions::default()).unwrap_err();
        assert!(matches!(&refused, ImportError::Unsupported(what) if what.contains("ASCII")), "{refused}");
        turned[at] = 7;
        assert!(matches!(read(&turned, &ImportOptions::default()), Err(ImportError::Binary { .. })));
    }
}

/// Without names every surface but the largest is an inclusion: the larger by its area, however fine the other is.
#[test]
fn surfaces_without_names_are_inclusions_but_for_the_largest() {
    let text = String::from_utf8(Example::ascii_2()).unwrap();
    let names = text.find("$PhysicalNames").unwrap()..text.find("$Nodes").unwrap();
    let unnamed = [&text[..names.start], &text[names.end..]].concat();
    let read = from(&unnamed).unwrap();
    assert_eq!((read.outline.area(), read.inclusions.len(), read.inclusions[0].outline.area()), (2400.0, 1, 400.0));
    assert!(read.needle.is_none() && read.immobile.is_empty() && read.paddles.is_empty() && read.material.is_none());
}

/// Without surfaces the lines are the body, those that are fixed among them.
#[test]
fn lines_alone_are_a_body_with_roles() {
    let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n1 1 \"outline\"\n1 2 \"fixed\"\n1 3 \"needle\"\n$EndPhysicalNames\n\
        $Nodes\n4\n1 0 0 0\n2 80 0 0\n3 80 50 0\n4 0 50 0\n$EndNodes\n\
        $Elements\n4\n1 1 2 2 1 1 2\n2 1 2 1 2 2 3\n3 1 2 3 3 3 4\n4 1 2 1 4 4 1\n$EndElements\n";
    let read = from(text).unwrap();
    assert_eq!((read.outline.area(), read.immobile.len()), (4000.0, 1));
    assert_eq!(read.needle.unwrap().axis, Point2::new(0.0, -1.0));
}

#[test]
fn what_is_not_planar_says_so() {
    let solid = V2.replace("\n5\n1 15", "\n6\n9 4 2 0 1 1 2 3 4\n1 15").replace("6 4 2 0", "6 4 2 1");
    let read = from(&solid).unwrap();
    assert!(read.summary.left_out[0].what.contains("1 solid"), "{:?}", read.summary);
    assert!(read.summary.notes.iter().any(|note| note.starts_with("z:")));
}
