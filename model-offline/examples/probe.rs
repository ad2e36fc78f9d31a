use model_offline::{
    placement::*,
    scene::{Integration, Scene},
    solver::equilibrium::NewtonSettings,
};
fn main() {
    for name in ["paper", "paper-hull"] {
        for integ in [Integration::Scni, Integration::Dni] {
            for incl in [false, true] {
                let mut s = Scene::bundled(name).unwrap();
                s.discretization.integration = integ;
                if let Some(h) = std::env::args().nth(1) {
                    s.discretization.resolution =
                        model_offline::scene::Resolution::Spacing(h.parse().unwrap());
                }
                if let Some(h) = std::env::args().nth(2) {
                    s.needle.depth = h.parse().unwrap();
                }
                if !incl {
                    s = s.without_inclusions();
                }
                let t = std::time::Instant::now();
                let m = TissueModel::new(&s).unwrap();
                let t1 = t.elapsed();
                let p = place(&m, NewtonSettings::default(), 1, &|| {}).unwrap();
                println!(
                    "{name} {integ:?} incl={incl} nodes={} disc {:?} total {:?} opt {:?}",
                    m.nodes(),
                    t1,
                    t.elapsed(),
                    p.optimum
                );
                for r in &p.paddles {
                    println!(
                        "  {} cm {:.4} static {:.5} reached {:.4} {:?}",
                        r.index,
                        r.controllability_measure,
                        r.fixture.max_orthogonal,
                        r.fixture.reached_depth,
                        r.fixture.failure
                    );
                }
            }
        }
    }
}
