//! The cheapest candidate that keeps a tolerance and that the next finer one confirms. What candidates are, cost and miss
//! is for others to say, so that the search itself can be tried on outcomes that are made up.

/// What is asked about candidates.
pub(super) trait Trials<C> {
    /// What solving leaves.
    type Solution;
    /// Why a candidate cannot be built or solved.
    type Error;
    /// Cost, in any unit, before anything is solved; it grows within a family.
    fn cost(&mut self, candidate: &C) -> Result<f64, Self::Error>;
    /// Solves.
    fn solve(&mut self, candidate: &C) -> Result<Self::Solution, Self::Error>;
    /// Estimated error of a solution.
    fn error(&self, solution: &Self::Solution) -> f64;
    /// Distance from the next finer candidate.
    fn confirm(&mut self, candidate: &C, solution: &Self::Solution) -> Result<f64, Self::Error>;
}

/// Why a candidate was not chosen.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Unfit<E> {
    /// Its estimated error is above the tolerance.
    TooWrong(f64),
    /// It is farther from the next finer one than the tolerance.
    Unconfirmed(f64),
    /// It costs this much, more than what was chosen.
    Dearer(f64),
    /// It does not work.
    Unusable(E),
    /// Its finer neighbour does not work.
    Unconfirmable(E),
}

/// A candidate that keeps the tolerance, and is confirmed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Kept<C, S> {
    pub candidate: C,
    pub cost: f64,
    pub solution: S,
    /// Distance from the next finer candidate.
    pub apart: f64,
}

/// How a search ended.
#[derive(Debug)]
pub(super) struct Search<C, S, E> {
    /// What was kept, if anything.
    pub best: Option<Kept<C, S>>,
    /// What was not, in the order of the search.
    pub refused: Vec<(C, Unfit<E>)>,
}

/// Goes through families, each from coarse to fine and from cheap to dear, until one of its candidates is kept, or none
/// can be cheaper than the best so far. A candidate that its finer neighbour refutes is passed over like one that is too
/// wrong: the search goes on behind it. The families' order matters to the time it takes, not to the answer.
pub(super) fn cheapest<C: Clone, J: Trials<C>>(
    families: &[Vec<C>],
    tolerance: f64,
    trials: &mut J,
) -> Search<C, J::Solution, J::Error> {
    let mut best: Option<Kept<C, J::Solution>> = None;
    let mut refused = Vec::new();
    for candidate_family in families {
        for candidate in candidate_family {
            let limit = best.as_ref().map_or(f64::INFINITY, |b| b.cost);
            match judge(candidate, limit, tolerance, trials) {
                Ok(kept) => {
                    if let Some(dearer) = best.replace(kept) {
                        refused.push((dearer.candidate, Unfit::Dearer(dearer.cost)));
                    }
                    break;
                }
                Err(refusal) => {
                    let last = !matches!(refusal, Unfit::TooWrong(_) | Unfit::Unconfirmed(_));
                    refused.push((candidate.clone(), refusal));
                    if last {
                        break;
                    }
                }
            }
        }
    }
    Search { best, refused }
}

fn judge<C: Clone, J: Trials<C>>(
    candidate: &C,
    limit: f64,
    tolerance: f64,
    trials: &mut J,
) -> Result<Kept<C, J::Solution>, Unfit<J::Error>> {
    let cost = trials.cost(candidate).map_err(Unfit::Unusable)?;
    if cost >= limit {
        return Err(Unfit::Dearer(cost));
    }
    let solution = trials.solve(candidate).map_err(Unfit::Unusable)?;
    let error = trials.error(&solution);
    if error.is_nan() || error > tolerance {
        return Err(Unfit::TooWrong(error));
    }
    let apart = trials.confirm(candidate, &solution).map_err(Unfit::Unconfirmable)?;
    if apart.is_nan() || apart > tolerance {
        return Err(Unfit::Unconfirmed(apart));
    }
    Ok(Kept { candidate: candidate.clone(), cost, solution, apart })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Name, cost, error, distance from the next finer.
    type Made = (&'static str, f64, f64, f64);

    #[derive(Debug, PartialEq)]
    struct Broken;

    /// What was kept, what was refused, what was solved.
    type Found = (Option<&'static str>, Vec<(&'static str, Unfit<Broken>)>, Vec<&'static str>);

    #[derive(Default)]
    struct MadeUp {
        solved: Vec<&'static str>,
    }

    impl Trials<Made> for MadeUp {
        type Solution = f64;
        type Error = Broken;
        fn cost(&mut self, candidate: &Made) -> Result<f64, Broken> {
            if candidate.1.is_finite() { Ok(candidate.1) } else { Err(Broken) }
        }
        fn solve(&mut self, candidate: &Made) -> Result<f64, Broken> {
            self.solved.push(candidate.0);
            Ok(candidate.2)
        }
        fn error(&self, solution: &f64) -> f64 {
            *solution
        }
        fn confirm(&mut self, candidate: &Made, _: &f64) -> Result<f64, Broken> {
            if candidate.3 < 0.0 { Err(Broken) } else { Ok(candidate.3) }
        }
    }

    fn search(families: &[Vec<Made>]) -> Found {
        let mut trials = MadeUp::default();
        let Search { best, refused } = cheapest(families, 0.01, &mut trials);
        let refused = refused.into_iter().map(|(candidate, refusal)| (candidate.0, refusal)).collect();
        (best.map(|b| b.candidate.0), refused, trials.solved)
    }

    #[test]
    fn a_family_comes_back_after_a_confirmation_that_failed() {
        // The coarse one is right by accident; the next finer one is not near it.
        let family = vec![("coarse", 1.0, 0.005, 0.2), ("middle", 2.0, 0.03, 0.0), ("fine", 4.0, 0.004, 0.003)];
        let (best, rejected, _) = search(&[family]);
        assert_eq!(best, Some("fine"));
        assert_eq!(rejected, [("coarse", Unfit::Unconfirmed(0.2)), ("middle", Unfit::TooWrong(0.03))]);
    }

    #[test]
    fn the_order_of_families_does_not_matter_and_what_cannot_win_is_not_solved() {
        let dear = vec![("a", 3.0, 0.02, 0.0), ("b", 9.0, 0.001, 0.001), ("never", 20.0, 0.0, 0.0)];
        let cheap = vec![("c", 1.0, 0.5, 0.0), ("d", 5.0, 0.009, 0.009), ("never", 6.0, 0.0, 0.0)];
        let broken = vec![("e", f64::NAN, 0.0, 0.0), ("never", 0.1, 0.0, 0.0)];
        let (first, rejected, solved) = search(&[cheap.clone(), dear.clone(), broken.clone()]);
        assert_eq!((first, solved), (Some("d"), vec!["c", "d", "a"]));
        assert!(rejected.contains(&("b", Unfit::Dearer(9.0))) && rejected.contains(&("e", Unfit::Unusable(Broken))));
        let (second, rejected, solved) = search(&[broken, dear, cheap]);
        assert_eq!((second, solved), (Some("d"), vec!["a", "b", "c", "d"]));
        assert!(rejected.contains(&("b", Unfit::Dearer(9.0))));
    }

    #[test]
    fn what_nothing_finer_can_confirm_is_not_kept() {
        let (best, rejected, solved) = search(&[vec![("last", 1.0, 0.0, -1.0), ("never", 2.0, 0.0, 0.0)]]);
        assert!(best.is_none() && solved == ["last"]);
        assert_eq!(rejected, [("last", Unfit::Unconfirmable(Broken))]);
    }

    #[test]
    fn numbers_that_are_none_keep_no_tolerance() {
        for candidate in [("error", 1.0, f64::NAN, 0.0), ("apart", 1.0, 0.0, f64::NAN), ("both", 1.0, 0.02, 0.02)] {
            let (best, rejected, _) = search(&[vec![candidate]]);
            assert!(best.is_none() && rejected.len() == 1);
        }
    }
}
