//! What the paper reports, for comparison: "Model Based Stabilization of Soft Tissue Targets in Needle Insertion
//! Procedures", section III.

use model_offline::scene::TissueVariant;

/// Scenes that reproduce the paper.
const PAPER_SCENES: [&str; 2] = ["paper", "paper-hull"];
/// Tissue, static and dynamic optimum, and Table III: the controllability measure of paddles 1 to 5.
const PAPER_RESULTS: [(TissueVariant, u32, u32, [f64; 5]); 2] = [
    (TissueVariant::Homogeneous, 4, 3, [4.7822, 4.1544, 3.2715, 3.3748, 3.3999]),
    (TissueVariant::Inclusion, 2, 3, [6.3556, 5.3583, 4.8749, 5.4552, 5.9523]),
];

/// Whether a scene reproduces the paper's.
pub fn is_paper(scene: &str) -> bool {
    PAPER_SCENES.contains(&scene)
}

fn results(scene: &str, tissue: TissueVariant) -> Option<&'static (TissueVariant, u32, u32, [f64; 5])> {
    PAPER_RESULTS.iter().find(|(known, ..)| is_paper(scene) && *known == tissue)
}

/// The static and the dynamic optimum that the paper found for a tissue of this scene.
pub fn paper_optima(scene: &str, tissue: TissueVariant) -> Option<(u32, u32)> {
    results(scene, tissue).map(|(_, static_paddle, dynamic, _)| (*static_paddle, *dynamic))
}

/// The controllability measure of a paddle, from the paper's Table III.
pub fn paper_controllability(scene: &str, tissue: TissueVariant, paddle: u32) -> Option<f64> {
    let place = usize::try_from(paddle).ok()?.checked_sub(1)?;
    results(scene, tissue).and_then(|(.., measures)| measures.get(place).copied())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_paper_names_the_smallest_measure_of_its_table() {
        for (tissue, _, dynamic, measures) in &PAPER_RESULTS {
            let best = paper_controllability("paper", *tissue, *dynamic).unwrap();
            assert!(measures.iter().all(|measure| best <= *measure));
        }
        assert_eq!(paper_controllability("paper", TissueVariant::Inclusion, 0), None);
        assert_eq!(paper_controllability("paper", TissueVariant::Inclusion, 6), None);
        assert_eq!(paper_optima("another", TissueVariant::Inclusion), None);
    }
}
