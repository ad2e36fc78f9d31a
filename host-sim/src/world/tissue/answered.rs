//! What a reduced model answered on its way, so that the full one can be asked the same afterwards.

use nalgebra::Vector2;

/// So many states are kept, at most; the half of it at least, once so many have been answered.
const KEPT: usize = 8;

/// A state of the tissue, and where the target was in it by the model that answered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Answer {
    /// Needle depth, length.
    pub depth: f64,
    /// Displacement of the paddle, length.
    pub paddle: Vector2<f64>,
    /// Displacement of the target, length.
    pub target: Vector2<f64>,
}

/// Answers spread evenly over all that were given, and the last one.
#[derive(Clone, Debug)]
pub(super) struct Answered {
    kept: Vec<Answer>,
    last: Option<Answer>,
    /// Every so many answers one is kept.
    every: u64,
    given: u64,
}

impl Default for Answered {
    fn default() -> Self {
        Self { kept: Vec::with_capacity(KEPT + 1), last: None, every: 1, given: 0 }
    }
}

impl Answered {
    /// Takes an answer in; one to the same question as before is none. No allocation: steps are timed.
    pub(super) fn take_in(&mut self, answer: Answer) {
        if self.last.is_some_and(|last| (last.depth, last.paddle) == (answer.depth, answer.paddle)) {
            return;
        }
        self.last = Some(answer);
        self.given += 1;
        if !self.given.is_multiple_of(self.every) {
            return;
        }
        self.kept.push(answer);
        if self.kept.len() > KEPT {
            let mut place = 0;
            self.kept.retain(|_| {
                place += 1;
                place % 2 == 0
            });
            self.every *= 2;
        }
    }

    /// The answers, in their order.
    pub(super) fn states(&self) -> impl Iterator<Item = Answer> {
        let last = self.last.filter(|last| self.kept.last() != Some(last));
        self.kept.iter().copied().chain(last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(depth: f64) -> Answer {
        Answer { depth, paddle: Vector2::zeros(), target: Vector2::new(depth, 0.0) }
    }

    #[test]
    fn they_are_spread_over_the_whole_way_and_the_last_is_among_them() {
        for given in [1_u32, 3, 8, 9, 100, 5567] {
            let mut answered = Answered::default();
            for k in 1..=given {
                answered.take_in(answer(f64::from(k)));
                answered.take_in(answer(f64::from(k)));
            }
            let depths: Vec<f64> = answered.states().map(|a| a.depth).collect();
            assert_eq!(depths.last(), Some(&f64::from(given)));
            assert!(depths.len() <= KEPT + 1 && depths.len() >= (given as usize).min(KEPT / 2), "{given}: {depths:?}");
            let steps = depths.windows(2).map(|pair| pair[1] - pair[0]);
            let widest = depths.first().copied().into_iter().chain(steps).fold(0.0, f64::max);
            assert!(widest <= (2.0 * f64::from(given) / KEPT as f64).max(1.0), "{given}: {depths:?}");
        }
        assert_eq!(Answered::default().states().count(), 0);
    }
}
