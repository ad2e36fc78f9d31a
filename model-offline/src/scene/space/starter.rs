//! A commented scene in space to start from.

use crate::scene::starter::StarterNames;

/// The text of a valid, commented scene: a block with one inclusion, four places for paddles and all of their pairs.
pub fn starter(names: &StarterNames) -> String {
    let StarterNames { name, length, stress } = names;
    let depth = numbers("5", names.block() / SIDE);
    let depth = depth.trim_end_matches(".0");
    let head = format!(
        "# A scene for model-offline in three dimensions. All numbers are in consistent units of your choice; presets of materials\n\
         # go by the labels. `model-offline schema --dimension 3` describes every key.\n\
         #   model-offline check FILE                        its numbers and its mesh, and what is seldom meant\n\
         #   model-offline place FILE                        which paddle position or pair is best\n\
         #   model-offline solve FILE --depth {depth} --vtu a.vtu  the deformed body for ParaView\n\n\
         [scene]\nname = {name:?}\ndimension = 3                       # a solid body\n\
         units = {{ length = {length:?}, stress = {stress:?} }}\n"
    );
    head + &scaled(BODY, names.block() / SIDE)
}

/// Longer side of the block in [`BODY`].
const SIDE: f64 = 100.0;
/// Keys of [`BODY`] whose numbers are lengths.
const LENGTHS: [&str; 8] = ["box", "sphere", "region ", "regions", "depth", "position", "solid", "{ half_space"];

/// The text with its lengths in another unit: those of the lines that begin with a key of a place or a length, in comments
/// too. Axes, normals and counts stay.
fn scaled(text: &str, factor: f64) -> String {
    if factor == 1.0 {
        return text.to_owned();
    }
    let line = |line: &str| {
        let key = line.trim_start_matches(['#', ' ']);
        if !LENGTHS.iter().any(|length| key.starts_with(length)) {
            return line.to_owned();
        }
        // A normal is a direction, and what follows `#` behind a key is prose.
        let kept =
            line.find("normal").or_else(|| line.char_indices().skip(1).find(|(_, c)| *c == '#').map(|(at, _)| at));
        let (lengths, rest) = line.split_at(kept.unwrap_or(line.len()));
        numbers(lengths, factor) + rest
    };
    text.lines().map(|text| line(text) + "\n").collect()
}

/// The text with every number in it multiplied.
fn numbers(text: &str, factor: f64) -> String {
    let is_part = |c: char| c.is_ascii_digit() || c == '.';
    let mut out = String::new();
    let mut rest = text;
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        let end = rest[start..].find(|c| !is_part(c)).map_or(rest.len(), |length| start + length);
        out.push_str(&rest[..start]);
        match rest[start..end].parse::<f64>() {
            // Six digits, for people to read.
            Ok(number) => {
                out.push_str(&format!("{:?}", format!("{:.5e}", number * factor).parse::<f64>().unwrap_or(number)))
            }
            Err(_) => out.push_str(&rest[start..end]),
        }
        rest = &rest[end..];
    }
    out + rest
}

/// Everything that has no name.
const BODY: &str = r#"
[domain]                            # the body: one of box, solid, surface, mesh, labels
box = { min = [0.0, 0.0, 0.0], max = [100.0, 80.0, 60.0] }
# solid = { difference = [{ ellipsoid = { centre = [50, 40, 0], semi_axes = [50, 40, 60] } },
#                         { half_space = { point = [0, 0, 0], normal = [0, 0, 1] } }] }
# surface = "body.stl"              # a closed surface: STL, OBJ, PLY
# mesh = "body.msh"                 # tetrahedra: Gmsh 2.2 and 4.1, VTU; inclusions by label or name of a physical volume
# labels = { file = "scan.nii.gz", body = [1, 2] }      # a segmentation: NIfTI, NRRD

[material]                          # Young's modulus 2.8, Poisson's ratio 0.4: soft tissue if stress is in kPa
model = "neo-hookean"               # fung | neo-hookean | saint-venant-kirchhoff | linear
lambda = 4.0                        # E ν / ((1 + ν)(1 − 2ν))
mu = 1.0                            # E / (2 (1 + ν))

[[inclusion]]                       # a region of another stiffness: box, sphere, ellipsoid, solid, surface, label or name
sphere = { centre = [66.0, 40.0, 26.0], radius = 8.0 }
stiffness = 10.0                    # times the body's

[immobile]                          # what bone or a table holds: what of the surface lies in a region
regions = [{ box = { min = [0.0, 0.0, 0.0], max = [100.0, 80.0, 0.0] } }]       # a flat box is a part of a face

[needle]
region = { box = { min = [45.0, 35.0, 60.0], max = [55.0, 45.0, 60.0] } }       # tissue that moves with the needle
axis = [0.0, 0.0, -1.0]             # direction of insertion
depth = 5.0                         # how far the contact is pushed
increments = 10

[target]                            # the point to hold still
position = [54.0, 40.0, 30.0]

[[paddle]]                          # a place where a paddle may be attached
index = 1
region = { box = { min = [0.0, 30.0, 20.0], max = [0.0, 50.0, 40.0] } }

[[paddle]]
index = 2
region = { box = { min = [100.0, 30.0, 20.0], max = [100.0, 50.0, 40.0] } }

[[paddle]]
index = 3
region = { box = { min = [45.0, 0.0, 20.0], max = [65.0, 0.0, 40.0] } }

[[paddle]]                          # within a radius of a point of the surface
index = 4
region = { sphere = { centre = [55.0, 80.0, 30.0], radius = 10.0 } }

[pairs]                             # which of them work together: "all", "none", or [[1, 3], [2, 4]]
of = "all"

[discretization]                    # how fine: one of tolerance, level and spacing
tolerance = 0.05                    # relative error of the controllability measures
integration = "fem-t10"             # quadratic tetrahedra; without this line place takes them, and solve scni-stabilised (meshfree)
"#;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::space::AnyScene;

    #[test]
    fn it_is_a_scene_in_space_of_the_name_and_units_that_are_asked_for() {
        let names = StarterNames { name: "a \"b\"\\".to_owned(), length: "cm".to_owned(), stress: "1".to_owned() };
        let AnyScene::Space(scene) = AnyScene::parse(&starter(&names), "<new>").unwrap() else { panic!("planar") };
        assert_eq!((scene.name.as_str(), scene.length_unit.as_str()), ("a \"b\"\\", "cm"));
        assert_eq!((scene.paddles.len(), scene.pairs.len()), (4, 6));
    }

    /// A body of 100 mm in every unit; directions, counts and prose stay.
    #[test]
    fn it_is_as_large_in_every_unit_that_is_known() {
        let of = |length: &str| {
            let text =
                starter(&StarterNames { name: "a".to_owned(), length: length.to_owned(), stress: "kPa".to_owned() });
            let AnyScene::Space(scene) = AnyScene::parse(&text, "<new>").unwrap() else { panic!("planar") };
            (text, scene)
        };
        let (in_mm, there) = of("mm");
        assert!(in_mm.ends_with(BODY));
        for (length, side) in [("m", 0.1), ("cm", 10.0), ("um", 1e5), ("in", 100.0 / 25.4), ("ell", 100.0)] {
            let (text, scene) = of(length);
            let relative =
                |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-5, "{length}: {found}");
            relative(scene.needle.depth, 0.05 * side);
            relative(scene.target.x, 0.54 * side);
            assert_eq!(scene.needle.axis, there.needle.axis);
            assert_eq!((scene.paddles.len(), scene.needle.increments), (4, there.needle.increments));
            for kept in ["normal = [0, 0, 1]", "Gmsh 2.2 and 4.1", "2.8, Poisson's ratio 0.4", "stiffness = 10.0"] {
                assert!(text.contains(kept), "{length}: {kept}");
            }
        }
        let (text, _) = of("m");
        assert!(text.contains("sphere = { centre = [0.066, 0.04, 0.026], radius = 0.008 }"), "{text}");
        assert!(
            text.contains("# solid = { difference = [{ ellipsoid = { centre = [0.05, 0.04, 0.0], semi_axes"),
            "{text}"
        );
    }
}
