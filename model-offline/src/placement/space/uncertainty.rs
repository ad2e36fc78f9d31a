//! What the estimated errors of a placement leave open: how far off fixtures are, and which sets of paddles cannot be told from the best.

use super::discretised::SpaceErrorEstimate;
use super::study::{SpaceAnswer, SpaceOptimum, SpacePlacement, SpaceStatic};
use crate::placement::accuracy::measure_range;
use serde::Serialize;

/// Sets of paddles that are as good as the best of as many, as far as the errors tell; by index, without the best.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct AsGoodSets {
    /// To hold still, to the depth that both reached; none that stopped where the best did not.
    #[serde(rename = "static")]
    pub fixtures: Vec<Vec<u32>>,
    /// By the controllability measure.
    pub dynamic: Vec<Vec<u32>>,
}

/// A placement with the estimated errors of it. Sets are counted as in [`SpaceErrorEstimate`]: paddles, then pairs, in the scene's
/// order, then none.
#[derive(Debug, Clone, Copy)]
pub struct Uncertain<'a> {
    /// What was found.
    pub placement: &'a SpacePlacement,
    /// How far off it may be.
    pub estimate: &'a SpaceErrorEstimate,
}

impl Uncertain<'_> {
    /// Estimated error of a set's largest orthogonal displacement, length; none where its insertion stopped at once.
    pub fn static_error(&self, set: usize) -> Option<f64> {
        self.fixture(set).map(|fixture| fixture.largest(fixture.of.depth.len()).1)
    }

    /// Whether one set's fixture may move the target no more than another's, to the depth that both reached; none where nothing is
    /// known of one of them.
    pub fn may_hold_as_well(&self, set: usize, other: usize) -> Option<bool> {
        let (one, other) = (self.fixture(set)?, self.fixture(other)?);
        let common = one.of.depth.len().min(other.of.depth.len());
        let ((largest, error), (least, its_error)) = (one.largest(common), other.largest(common));
        Some(largest - error <= least + its_error)
    }

    /// Between what a set's controllability measure lies; none where it has none.
    pub fn measure_range(&self, set: usize) -> Option<[f64; 2]> {
        let (_, answer) = self.placement.sets().nth(set)?;
        let measure = Some(answer.controllability_measure).filter(|measure| measure.is_finite())?;
        Some(measure_range(measure, *self.estimate.by_set.get(set)?))
    }

    /// Which sets cannot be told from the best of as many paddles. `overlapping` are pairs that cannot be attached together, by index.
    pub fn as_good(&self, best: &SpaceOptimum, overlapping: &[[u32; 2]]) -> AsGoodSets {
        let place = |of: &[u32]| self.placement.sets().position(|(paddles, _)| paddles == of);
        let others = |best: &[u32], is_as_good: &dyn Fn(usize, &SpaceAnswer) -> bool| -> Vec<Vec<u32>> {
            let is_alike = |paddles: &[u32]| {
                paddles.len() == best.len() && paddles != best && overlapping.iter().all(|pair| pair[..] != *paddles)
            };
            let all = self.placement.sets().enumerate().filter(|(_, (paddles, _))| is_alike(paddles));
            all.filter(|(set, (_, answer))| is_as_good(*set, answer))
                .map(|(_, (paddles, _))| paddles.to_vec())
                .collect()
        };
        let fixtures = place(&best.fixture).map(|held| {
            let best_stopped = self.placement.static_study(held).is_some_and(|of| of.failure.is_some());
            let is_as_deep = |answer: &SpaceAnswer| answer.static_study.failure.is_none() || best_stopped;
            others(&best.fixture, &|set, answer| is_as_deep(answer) && self.may_hold_as_well(set, held) == Some(true))
        });
        let most = place(&best.dynamic).and_then(|moving| self.measure_range(moving)).map(|[_, most]| most);
        let dynamic = most.map(|most| {
            others(&best.dynamic, &|set, _| self.measure_range(set).is_some_and(|[least, _]| least <= most))
        });
        AsGoodSets { fixtures: fixtures.unwrap_or_default(), dynamic: dynamic.unwrap_or_default() }
    }

    /// A set's fixture, of which something is known.
    fn fixture(&self, set: usize) -> Option<HeldStill<'_>> {
        let of = self.placement.static_study(set).filter(|of| !of.depth.is_empty())?;
        Some(HeldStill { of, per_depth: *self.estimate.per_depth_by_set.get(set)? })
    }
}

/// What a second paddle does for control at rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SecondPaddle {
    /// Controllability measure of the best paddle.
    pub single: f64,
    /// That of the best pair.
    pub pair: f64,
    /// The part of the way for the worst direction that the pair saves; negative where it is longer, none where neither controls.
    pub gain: Option<f64>,
    /// Whether the estimated errors leave open that it saves none; none where none are estimated.
    pub left_open: Option<bool>,
}

impl SecondPaddle {
    /// By the best of a placement, with what is known of its errors; none where there are no pairs.
    pub fn of(placement: &SpacePlacement, uncertain: Option<Uncertain<'_>>) -> Option<Self> {
        let place = |best: &[u32]| placement.sets().position(|(paddles, _)| paddles == best);
        let [alone, together] = [&placement.optimum_single, &placement.optimum].map(|best| place(&best.dynamic));
        let (alone, together) = alone.zip(together).filter(|_| !placement.pairs.is_empty())?;
        let measure = |set| placement.sets().nth(set).map(|(_, answer)| answer.controllability_measure);
        let (single, pair) = measure(alone).zip(measure(together))?;
        let left_open = uncertain.map(|uncertain| {
            let ranges = uncertain.measure_range(alone).zip(uncertain.measure_range(together));
            ranges.is_some_and(|([least, _], [_, most])| least <= most)
        });
        let gain = Some(1.0 - pair / single).filter(|gain| gain.is_finite());
        Some(Self { single, pair, gain, left_open })
    }
}

/// A fixture, and how far it is off per depth at rest.
struct HeldStill<'a> {
    of: &'a SpaceStatic,
    per_depth: f64,
}

impl HeldStill<'_> {
    fn largest(&self, increments: usize) -> (f64, f64) {
        self.of.largest(increments, self.per_depth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::placement::space::study::{SpaceNoPaddle, SpacePaddleResult, SpacePairResult};
    use crate::placement::study::StaticFailure;
    use crate::solver::equilibrium::FailureReason;

    fn held(orthogonal: &[f64]) -> SpaceStatic {
        SpaceStatic {
            depth: (1..=orthogonal.len()).map(|depth| depth as f64).collect(),
            orthogonal: orthogonal.to_vec(),
            max_orthogonal: orthogonal.iter().copied().fold(0.0, f64::max),
            nonlinear_error: vec![0.0; orthogonal.len()],
            ..SpaceStatic::default()
        }
    }

    fn answer(measure: f64, static_study: SpaceStatic) -> SpaceAnswer {
        SpaceAnswer {
            jacobian: Vec::new(),
            condition: 1.0,
            controllability_measure: measure,
            controllability_full: measure,
            controllability_easiest: measure,
            worst_direction: [0.0; 3],
            target_per_depth: [0.0; 3],
            static_study,
        }
    }

    fn optimum(fixture: &[u32], dynamic: &[u32]) -> SpaceOptimum {
        SpaceOptimum { fixture: fixture.to_vec(), dynamic: dynamic.to_vec() }
    }

    /// Three paddles and their pairs.
    fn placement() -> SpacePlacement {
        let single =
            |index, measure, orthogonal: &[f64]| SpacePaddleResult { index, answer: answer(measure, held(orthogonal)) };
        let pair = |paddles, measure, orthogonal: &[f64]| SpacePairResult {
            paddles,
            answer: answer(measure, held(orthogonal)),
        };
        SpacePlacement {
            paddles: vec![
                single(3, 10.0, &[0.2, 0.4]),
                single(5, 10.9, &[0.2, 0.5]),
                single(7, f64::INFINITY, &[0.2, 0.41]),
            ],
            pairs: vec![
                pair([3, 5], 8.0, &[0.1, 0.3]),
                pair([3, 7], 8.1, &[0.1, 0.31]),
                pair([5, 7], 8.1, &[0.1, 0.31]),
            ],
            no_paddle: SpaceNoPaddle { target_per_depth: [0.0; 3], static_study: held(&[0.2, 0.405]) },
            optimum: optimum(&[3, 5], &[3, 5]),
            optimum_single: optimum(&[3], &[3]),
            profile_nodes: 1,
        }
    }

    fn estimate(controllability: f64, per_depth: f64) -> SpaceErrorEstimate {
        SpaceErrorEstimate {
            controllability,
            by_set: vec![controllability; 6],
            full_by_set: vec![controllability; 6],
            per_depth_by_set: vec![per_depth; 7],
            reference: controllability,
            reference_nodes: 1,
            level: 0.0,
        }
    }

    #[test]
    fn sets_whose_ranges_meet_that_of_the_best_are_as_good() {
        let placement = placement();
        // Paddles 3 and 7 are 0.01 apart at a depth of 2: the errors of both make that up from 0.0025 per depth on.
        for (per_depth, fixtures) in [(0.0024, vec![]), (0.0026, vec![vec![7]]), (0.026, vec![vec![5], vec![7]])] {
            let estimate = estimate(0.0, per_depth);
            let found =
                Uncertain { placement: &placement, estimate: &estimate }.as_good(&placement.optimum_single, &[]);
            assert_eq!(found, AsGoodSets { fixtures, dynamic: vec![] }, "{per_depth}");
        }
        // 10 / (1 − e) meets 10.9 / (1 + e) where e is 0.9 / 20.9; what controls nothing never does.
        for (error, dynamic) in [(0.043, vec![]), (0.0431, vec![vec![5]]), (0.9, vec![vec![5]])] {
            let estimate = estimate(error, 0.0);
            let found =
                Uncertain { placement: &placement, estimate: &estimate }.as_good(&placement.optimum_single, &[]);
            assert_eq!(found, AsGoodSets { fixtures: vec![], dynamic }, "{error}");
        }
    }

    #[test]
    fn a_second_paddle_gains_what_the_errors_do_not_take() {
        let mut placement = placement();
        let of = |placement: &SpacePlacement, error: f64| {
            let estimate = estimate(error, 0.0);
            SecondPaddle::of(placement, Some(Uncertain { placement, estimate: &estimate })).unwrap()
        };
        // 10 / (1 + e) meets 8 / (1 − e) where e is 1/9.
        for (error, left_open) in [(0.11, false), (0.112, true)] {
            let found = of(&placement, error);
            assert_eq!((found.single, found.pair, found.left_open), (10.0, 8.0, Some(left_open)), "{error}");
            assert!((found.gain.unwrap() - 0.2).abs() < 1e-12);
        }
        assert_eq!(SecondPaddle::of(&placement, None).unwrap().left_open, None);
        // Where no paddle controls alone, the second is all of it; where no pair does either, nothing is gained.
        placement.optimum_single.dynamic = vec![7];
        let found = of(&placement, 0.5);
        assert_eq!((found.gain, found.left_open), (Some(1.0), Some(false)));
        placement.pairs[0].answer.controllability_measure = f64::INFINITY;
        assert_eq!(of(&placement, 0.5).gain, None);
        placement.pairs.clear();
        assert_eq!(SecondPaddle::of(&placement, None), None);
    }

    #[test]
    fn pairs_that_cannot_be_attached_together_are_none() {
        let (placement, estimate) = (placement(), estimate(0.1, 0.1));
        let uncertain = Uncertain { placement: &placement, estimate: &estimate };
        let both = vec![vec![3, 7], vec![5, 7]];
        let found = uncertain.as_good(&placement.optimum, &[]);
        assert_eq!(found, AsGoodSets { fixtures: both.clone(), dynamic: both });
        let found = uncertain.as_good(&placement.optimum, &[[3, 7]]);
        assert_eq!(found, AsGoodSets { fixtures: vec![vec![5, 7]], dynamic: vec![vec![5, 7]] });
    }

    #[test]
    fn what_stopped_is_as_good_as_nothing_but_what_stopped() {
        let mut placement = placement();
        let stopped = StaticFailure { reason: FailureReason::NotConverged, depth: 1.0, detail: String::new() };
        let stop = |of: &mut SpaceStatic| {
            (of.depth, of.orthogonal, of.nonlinear_error) = (vec![1.0], vec![0.2], vec![0.0]);
            (of.max_orthogonal, of.failure) = (0.2, Some(stopped.clone()));
        };
        // To the depth of 1 that it reached it is as good as the best.
        stop(&mut placement.paddles[2].answer.static_study);
        let estimate = estimate(0.0, 1e-9);
        let found = |placement: &SpacePlacement| {
            let uncertain = Uncertain { placement, estimate: &estimate };
            (uncertain.as_good(&placement.optimum_single, &[]).fixtures, uncertain.may_hold_as_well(2, 0))
        };
        assert_eq!(found(&placement), (vec![], Some(true)));
        stop(&mut placement.paddles[0].answer.static_study);
        assert_eq!(found(&placement), (vec![vec![5], vec![7]], Some(true)));
        // Of what stopped at once nothing is known.
        placement.paddles[0].answer.static_study = SpaceStatic::default();
        assert_eq!(found(&placement), (vec![], None));
        assert_eq!(Uncertain { placement: &placement, estimate: &estimate }.static_error(0), None);
    }
}
