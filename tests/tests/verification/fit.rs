//! The choice of `model-offline fit` against the continuum limits of `golden/continuum.json`, which an independent
//! implementation made, good to about 0.1 %.

use model_offline::model::TissueModel;
use model_offline::placement::reference::Reference;
use model_offline::placement::rest::rest_responses;
use model_offline::scene::schema::PlantModel;
use model_offline::scene::{BUNDLED, Scene};
use model_offline::study::fit::{Decision, Rejected, discretization, fit};
use tests::continuum::{errors, limits};

#[test]
fn three_tolerances_have_three_answers_and_each_is_kept() {
    let scene = Scene::bundled("paper").unwrap();
    let limits = limits("paper", "inclusion");
    let mut nodes = Vec::new();
    for tolerance in [0.05, 0.01, 0.002] {
        let reference = Reference::compute(&scene, 0.2 * tolerance).unwrap();
        let chosen = discretization(&scene, tolerance, &reference).unwrap();
        let (nodes_of_chosen, verified) = (chosen.assessment.nodes, chosen.verified_error);
        let found = errors(&chosen.assessment.responses, &limits);
        println!(
            "{tolerance}: {:?}, {nodes_of_chosen} nodes, {found:?}, verified {verified:.5}",
            chosen.discretization
        );
        assert!(found.controllability <= tolerance && found.displacement <= tolerance, "{tolerance}: {found:?}");
        assert!(verified <= tolerance);
        // Something cheaper was tried, and it was its error that spoke against it, not its time.
        let for_its_error = |r: &&Rejected| r.reason.error().is_some_and(|error| error > tolerance);
        let cheaper: Vec<&Rejected> = chosen.rejected.iter().filter(for_its_error).collect();
        assert!(!cheaper.is_empty(), "{tolerance}: {:?}", chosen.rejected);
        nodes.push(nodes_of_chosen);
    }
    assert!(nodes[0] < nodes[1] && nodes[1] < nodes[2], "{nodes:?}");
}

#[test]
fn the_scene_that_is_written_is_the_model_that_was_chosen() {
    let scene = Scene::bundled("paper").unwrap();
    let found = fit(&scene, 0.05, 2).unwrap();
    let text = found.written_into(BUNDLED[0].1).unwrap();
    let written = Scene::parse(&text, "fitted.toml").unwrap();
    let model = TissueModel::new(&written).unwrap();
    assert_eq!(model.nodes(), found.chosen.nodes);
    assert_eq!(written.fit, Some(found.section()));
    let kept = errors(&rest_responses(&model).unwrap(), &limits("paper", "inclusion"));
    assert!(kept.controllability <= 0.05 && kept.displacement <= 0.05, "{kept:?}");
    // The paper's law at full depth is far from linear: the linear law is rejected with its number.
    assert_eq!(found.chosen.plant, PlantModel::Reduced);
    assert!(found.rejected.iter().any(|r| r.alternative.decision() == Decision::Law && r.reason.number() > Some(0.05)));
    // Comments of the original survive.
    let comments = BUNDLED[0].1.lines().filter(|l| l.trim_start().starts_with('#')).count();
    assert!(comments > 0 && text.lines().filter(|l| l.trim_start().starts_with('#')).count() >= comments);
}
