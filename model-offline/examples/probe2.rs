use model_offline::{placement::*, scene::Scene, solver::equilibrium::NewtonSettings};
use nalgebra::Vector2;
fn main() {
    let s = Scene::bundled("paper").unwrap();
    let m = TissueModel::new(&s).unwrap();
    let mut b = m
        .body(
            Some(2),
            NewtonSettings {
                max_cutbacks: 0,
                ..Default::default()
            },
        )
        .unwrap();
    b.drive(0.0, Vector2::new(0.005, 0.0)).unwrap();
    println!("{:?}", b.equilibrium().residual_history());
    let r = b.drive(0.0, Vector2::zeros());
    println!("{r:?} {:?}", b.equilibrium().residual_history());
}
