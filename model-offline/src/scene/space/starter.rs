//! A commented scene in space to start from.

use crate::scene::starter::StarterNames;

/// The text of a valid, commented scene: a block with one inclusion, four places for paddles and all of their pairs.
pub fn starter(names: &StarterNames) -> String {
    let StarterNames { name, length, stress } = names;
    let head = format!(
        "# A scene for model-offline in three dimensions. All numbers are in consistent units of your choice; presets of materials\n\
         # go by the labels. `model-offline schema --dimension 3` describes every key.\n\
         #   model-offline check FILE                        its numbers and its mesh, and what is seldom meant\n\
         #   model-offline place FILE                        which paddle position or pair is best\n\
         #   model-offline solve FILE --depth 5 --vtu a.vtu  the deformed body for ParaView\n\n\
         [scene]\nname = {name:?}\ndimension = 3                       # a solid body\n\
         units = {{ length = {length:?}, stress = {stress:?} }}\n"
    );
    head + BODY
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
integration = "fem-t10"             # quadratic tetrahedra; scni-stabilised (meshfree) is the default
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
}
