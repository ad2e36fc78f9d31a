use model_offline::{
    discretization::{graded::*, *},
    placement::*,
    scene::*,
    solver::equilibrium::NewtonSettings,
};
use std::time::Instant;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let f = |i: usize| a[i].parse::<f64>().unwrap();
    let refs = [[5.2935, 3.7929, 3.3150, 3.5596, 4.5066], [5.7208, 4.2798, 3.8669, 4.2103, 5.1274]];
    let integ = match a[4].as_str() {
        "scni" => Integration::Scni,
        "dni" => Integration::Dni,
        "nsni" => Integration::Nsni,
        "gauss" => Integration::Gauss,
        "t3" => Integration::FemT3,
        _ => Integration::FemT6,
    };
    let basis = if a[5] == "q" { Basis::Quadratic } else { Basis::Linear };
    for incl in [0, 1] {
        let mut s = Scene::bundled("paper").unwrap();
        if incl == 0 {
            s = s.without_inclusions();
        }
        let t = Instant::now();
        let g = graded_nodes(
            &s,
            &Grading {
                coarsest: f(1),
                finest: f(2),
                slope: f(3),
                interface: f(7),
                fit: if matches!(integ, Integration::Scni | Integration::Dni | Integration::Nsni) {
                    InterfaceFit::Between
                } else {
                    InterfaceFit::On
                },
            },
        );
        let n = g.len();
        let t1 = t.elapsed();
        let p = match Planar::new(
            &s.outline, &s.inclusion_outlines(),
            g,
            None,
            Method { integration: integ, basis, support: f(6), consistent: true },
        ) {
            Ok(p) => p,
            Err(e) => {
                println!("{n}: {e}");
                return;
            }
        };
        let t2 = t.elapsed();
        let m = TissueModel::on(&s, p, f(1)).unwrap();
        let mut o = vec![];
        let rs = rest::rest_responses(&m).unwrap();
        for k in 0..5 {
            o.push((rs[k].controllability_measure / refs[incl][k] - 1.0) * 100.0);
        }
        println!(
            "{} nodes {n}/{} gen {:?} disc {:?} all {:?} err% {:.2?}",
            a[4],
            m.nodes(),
            t1,
            t2 - t1,
            t.elapsed(),
            o
        );
    }
}
