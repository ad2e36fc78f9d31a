//! Which static paddles are best, where insertions may stop before the full depth.

use std::cmp::Ordering;

/// What is known of an insertion with paddles that do not move.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fixture<'a> {
    /// The depth at which it stopped before the full one; none where it did not.
    pub stopped: Option<f64>,
    /// Orthogonal displacement of the target at every increment that it reached, length.
    pub orthogonal: &'a [f64],
    /// The same per depth, at the beginning.
    pub per_depth: f64,
}

/// The largest of some displacements.
fn largest(displacements: &[f64]) -> f64 {
    displacements.iter().fold(0.0, |most, u| f64::max(most, u.abs()))
}

/// Place of the best: of those that reached the full depth the one with the smallest largest displacement. Where none did, of those
/// that reached an increment, over the depth that all of these reached; where none did even that, of those that came the farthest by
/// how they begin. None of none.
pub(super) fn best(fixtures: &[Fixture<'_>]) -> Option<usize> {
    let began = |fixture: &Fixture<'_>| !fixture.orthogonal.is_empty();
    let common = common(fixtures.iter().map(|fixture| fixture.orthogonal)).unwrap_or(0);
    let key = |fixture: &Fixture<'_>| match fixture {
        Fixture { stopped: None, orthogonal, .. } => (0, 0.0, largest(orthogonal)),
        Fixture { orthogonal, .. } if began(fixture) => (1, 0.0, largest(&orthogonal[..common])),
        Fixture { stopped: Some(depth), per_depth, .. } => (2, -depth, per_depth.abs()),
    };
    let order = |a: (u8, f64, f64), b: (u8, f64, f64)| -> Ordering {
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2))
    };
    (0..fixtures.len()).min_by(|&a, &b| order(key(&fixtures[a]), key(&fixtures[b])))
}

/// Increments that all insertions reached which reached one; none where none did.
pub(crate) fn common<'a>(insertions: impl Iterator<Item = &'a [f64]>) -> Option<usize> {
    insertions.map(<[f64]>::len).filter(|increments| *increments > 0).min()
}

/// Largest displacement over that of another insertion, to the depth that both reached; none where they have no depth in common, or
/// the other one does not move the target.
pub(super) fn over(own: &[f64], other: &[f64]) -> Option<f64> {
    let common = own.len().min(other.len());
    let reference = largest(&other[..common]);
    (reference > 0.0).then(|| largest(&own[..common]) / reference)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOWHERE: Fixture<'_> = Fixture { stopped: Some(0.0), orthogonal: &[], per_depth: 0.01 };

    fn stopped(orthogonal: &[f64]) -> Fixture<'_> {
        Fixture { stopped: Some(0.5), orthogonal, per_depth: 0.0 }
    }

    #[test]
    fn what_reached_the_depth_comes_before_what_stopped_and_that_before_what_never_began() {
        let whole = |orthogonal| Fixture { stopped: None, orthogonal, per_depth: 0.0 };
        assert_eq!(best(&[NOWHERE, stopped(&[0.1]), whole(&[-0.2, 0.3]), whole(&[0.1, -0.4])]), Some(2));
        assert_eq!(best(&[NOWHERE, stopped(&[0.2, 0.3, 0.9]), stopped(&[-0.3, 0.3])]), Some(1), "over two increments");
        assert_eq!(best(&[stopped(&[0.4]), NOWHERE]), Some(0), "nothing is known of what never began");
        assert_eq!(best(&[Fixture { per_depth: -0.02, ..NOWHERE }, NOWHERE]), Some(1), "by how they begin");
        assert_eq!(
            best(&[NOWHERE, Fixture { stopped: Some(0.1), per_depth: 0.5, ..NOWHERE }]),
            Some(1),
            "the farthest"
        );
        assert_eq!(best(&[]), None);
    }

    #[test]
    fn insertions_are_compared_over_the_depth_that_both_reached() {
        assert_eq!(over(&[0.25, -0.75], &[0.5, 0.5, 5.0]), Some(1.5));
        assert_eq!(over(&[0.1], &[]), None);
        assert_eq!(over(&[0.1], &[0.0, 1.0]), None);
    }
}
