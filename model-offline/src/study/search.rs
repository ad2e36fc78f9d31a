//! The cheapest candidate that keeps a tolerance and that the next finer one confirms. What candidates are, cost and miss
//! is for others to say, so that the search itself can be tried on outcomes that are made up.

/// What is asked about candidates.
pub(super) trait Trials<C> {
    /// What a solution leaves.
    type Outcome;
    /// Cost, in any unit, before anything is solved; it grows within a family.
    fn cost(&mut self, candidate: &C) -> Result<f64, String>;
    /// Estimated error.
    fn solve(&mut self, candidate: &C) -> Result<(f64, Self::Outcome), String>;
    /// Distance from the next finer candidate.
    fn confirm(&mut self, candidate: &C, outcome: &Self::Outcome) -> Result<f64, String>;
}

/// Why a candidate was not chosen.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Verdict {
    /// Its estimated error is above the tolerance.
    TooWrong(f64),
    /// It is farther from the next finer one than the tolerance.
    Unconfirmed(f64),
    /// It costs this much, more than what was chosen.
    Dearer(f64),
    /// It does not work.
    Unusable(String),
}

/// A candidate that keeps the tolerance, and is confirmed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Kept<C, T> {
    pub candidate: C,
    pub cost: f64,
    pub outcome: T,
    /// Distance from the next finer candidate.
    pub apart: f64,
}

/// What was kept, if anything, and what was not.
pub(super) type Searched<C, T> = (Option<Kept<C, T>>, Vec<(C, Verdict)>);

/// Goes through families, each from coarse to fine and from cheap to dear, until one of its candidates is kept, or none
/// can be cheaper than the best so far. A candidate that its finer neighbour refutes is passed over like one that is too
/// wrong: the search goes on behind it. The families' order matters to the time it takes, not to the answer.
pub(super) fn cheapest<C: Clone, J: Trials<C>>(
    families: &[Vec<C>],
    tolerance: f64,
    trials: &mut J,
) -> Searched<C, J::Outcome> {
    let mut best: Option<Kept<C, J::Outcome>> = None;
    let mut rejected = Vec::new();
    for candidate_family in families {
        for candidate in candidate_family {
            let limit = best.as_ref().map_or(f64::INFINITY, |b| b.cost);
            match judge(candidate, limit, tolerance, trials) {
                Ok(kept) => {
                    if let Some(dearer) = best.replace(kept) {
                        rejected.push((dearer.candidate, Verdict::Dearer(dearer.cost)));
                    }
                    break;
                }
                Err(verdict) => {
                    let last = matches!(verdict, Verdict::Dearer(_) | Verdict::Unusable(_));
                    rejected.push((candidate.clone(), verdict));
                    if last {
                        break;
                    }
                }
            }
        }
    }
    (best, rejected)
}

fn judge<C: Clone, J: Trials<C>>(
    candidate: &C,
    limit: f64,
    tolerance: f64,
    trials: &mut J,
) -> Result<Kept<C, J::Outcome>, Verdict> {
    let cost = trials.cost(candidate).map_err(Verdict::Unusable)?;
    if cost >= limit {
        return Err(Verdict::Dearer(cost));
    }
    let (error, outcome) = trials.solve(candidate).map_err(Verdict::Unusable)?;
    if error.is_nan() || error > tolerance {
        return Err(Verdict::TooWrong(error));
    }
    let apart = trials.confirm(candidate, &outcome).map_err(Verdict::Unusable)?;
    if apart.is_nan() || apart > tolerance {
        return Err(Verdict::Unconfirmed(apart));
    }
    Ok(Kept { candidate: candidate.clone(), cost, outcome, apart })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Name, cost, error, distance from the next finer.
    type Made = (&'static str, f64, f64, f64);

    #[derive(Default)]
    struct MadeUp {
        solved: Vec<&'static str>,
    }

    impl Trials<Made> for MadeUp {
        type Outcome = ();
        fn cost(&mut self, candidate: &Made) -> Result<f64, String> {
            if candidate.1.is_finite() { Ok(candidate.1) } else { Err("broken".into()) }
        }
        fn solve(&mut self, candidate: &Made) -> Result<(f64, ()), String> {
            self.solved.push(candidate.0);
            Ok((candidate.2, ()))
        }
        fn confirm(&mut self, candidate: &Made, (): &()) -> Result<f64, String> {
            Ok(candidate.3)
        }
    }

    fn search(families: &[Vec<Made>]) -> (Option<&'static str>, Vec<(&'static str, Verdict)>, Vec<&'static str>) {
        let mut trials = MadeUp::default();
        let (best, rejected) = cheapest(families, 0.01, &mut trials);
        let rejected = rejected.into_iter().map(|(candidate, verdict)| (candidate.0, verdict)).collect();
        (best.map(|b| b.candidate.0), rejected, trials.solved)
    }

    #[test]
    fn a_family_comes_back_after_a_confirmation_that_failed() {
        // The coarse one is right by accident; the next finer one is not near it.
        let family = vec![("coarse", 1.0, 0.005, 0.2), ("middle", 2.0, 0.03, 0.0), ("fine", 4.0, 0.004, 0.003)];
        let (best, rejected, _) = search(&[family]);
        assert_eq!(best, Some("fine"));
        assert_eq!(rejected, [("coarse", Verdict::Unconfirmed(0.2)), ("middle", Verdict::TooWrong(0.03))]);
    }

    #[test]
    fn the_order_of_families_does_not_matter_and_what_cannot_win_is_not_solved() {
        let dear = vec![("a", 3.0, 0.02, 0.0), ("b", 9.0, 0.001, 0.001), ("never", 20.0, 0.0, 0.0)];
        let cheap = vec![("c", 1.0, 0.5, 0.0), ("d", 5.0, 0.009, 0.009), ("never", 6.0, 0.0, 0.0)];
        let broken = vec![("e", f64::NAN, 0.0, 0.0), ("never", 0.1, 0.0, 0.0)];
        let (first, rejected, solved) = search(&[cheap.clone(), dear.clone(), broken.clone()]);
        assert_eq!((first, solved), (Some("d"), vec!["c", "d", "a"]));
        assert!(
            rejected.contains(&("b", Verdict::Dearer(9.0)))
                && rejected.contains(&("e", Verdict::Unusable("broken".into())))
        );
        let (second, rejected, solved) = search(&[broken, dear, cheap]);
        assert_eq!((second, solved), (Some("d"), vec!["a", "b", "c", "d"]));
        assert!(rejected.contains(&("b", Verdict::Dearer(9.0))));
    }

    #[test]
    fn numbers_that_are_none_keep_no_tolerance() {
        for candidate in [("error", 1.0, f64::NAN, 0.0), ("apart", 1.0, 0.0, f64::NAN), ("both", 1.0, 0.02, 0.02)] {
            let (best, rejected, _) = search(&[vec![candidate]]);
            assert!(best.is_none() && rejected.len() == 1);
        }
    }
}
