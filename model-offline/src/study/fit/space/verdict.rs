//! Which dimension and how many paddles a scene needs, and the numbers that speak against fewer.

use super::{PaddleSet, SliceInBody, SpaceFit};
use serde::{Serialize, Serializer};
use std::fmt;

/// A way orthogonal to the needle below this part of the whole is none.
pub(super) const NEGLIGIBLE: f64 = 1e-3;

/// What is needed at the tolerance.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SpaceVerdict {
    /// 2 where the slice will do, else 3.
    pub dimension: u32,
    /// The paddles to mount and move, by index.
    pub paddles: Vec<u32>,
    /// What was not chosen, and why.
    pub rejected: Vec<RejectedInSpace>,
}

/// What was considered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SpaceAlternative {
    /// The slice in place of the body.
    PlaneStrain,
    /// The body in place of the slice.
    Body,
    /// One paddle in place of two.
    OnePaddle,
    /// Two paddles in place of one.
    TwoPaddles,
}

impl SpaceAlternative {
    fn name(self) -> &'static str {
        match self {
            Self::PlaneStrain => "plane strain",
            Self::Body => "the body",
            Self::OnePaddle => "one paddle",
            Self::TwoPaddles => "two paddles",
        }
    }
}

impl fmt::Display for SpaceAlternative {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Why something was not chosen. Numbers are shares, but for costs.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReasonInSpace {
    /// There is no slice.
    #[error("{0}")]
    NoSlice(String),
    /// The slice does not have the best paddle.
    #[error("the slice does not have paddle {0}, the best one")]
    BestMissing(u32),
    /// The best paddle's corrections come out otherwise.
    #[error("|1 − λ|: what is wrong of a correction by paddle {paddle} in the body, of the slice's Jacobian")]
    Gain {
        /// The paddle.
        paddle: u32,
        /// |1 − λ|.
        mismatch: f64,
    },
    /// The best paddle's corrections may come out otherwise, for what the two models know.
    #[error(
        "|1 − λ| of paddle {paddle} is below the tolerance, but not with {:.3} % that the estimates of the two models leave open: a smaller tolerance refines both",
        100.0 * open
    )]
    Unsure {
        /// The paddle.
        paddle: u32,
        /// |1 − λ|.
        mismatch: f64,
        /// What both estimates leave open.
        open: f64,
    },
    /// What a correction does across the plane.
    #[error("of a correction by paddle {paddle} goes across the plane, which the slice cannot see")]
    Across {
        /// The paddle.
        paddle: u32,
        /// Part of the correction.
        part: f64,
    },
    /// The way of the target without help.
    #[error("of the way orthogonal to the needle without help: by so much the slice is off")]
    WithoutHelp(f64),
    /// What the slice's controller leaves.
    #[error("of the way orthogonal to the needle without help is left by the slice's table with feedback")]
    ClosedLoop(f64),
    /// Corrections by the slice's table do not end.
    #[error("corrections by the slice's table do not converge in the body")]
    Diverges,
    /// Another paddle is the best in the slice.
    #[error("longer way in the body of paddle {0}, the best in the slice")]
    OtherOptimum(u32, f64),
    /// It costs more, and is not needed.
    #[error("times the cost of the slice, which keeps the tolerance")]
    Dearer(f64),
    /// A paddle at its limit leaves something.
    #[error("of the target's displacement left where the paddle is at its limit")]
    AtLimit(f64),
    /// A paddle is not fast enough.
    #[error("of the paddle's largest speed")]
    TooSlow(f64),
    /// A table without inclusions leads to the wrong side.
    #[error("|1 − λ| of a table that knows of no inclusions: corrections may lead to the wrong side")]
    WrongSide(f64),
    /// A second paddle is not needed.
    #[error(
        "of the way in the worst direction is {}: not needed, since one paddle takes {:.3} % of its limit",
        if *shorter < 0.0 { "lost (the pair's is longer)" } else { "saved" },
        100.0 * stroke
    )]
    NotNeeded {
        /// By which part the way is shorter.
        shorter: f64,
        /// What one paddle takes of its limit.
        stroke: f64,
    },
    /// A second paddle does not help.
    #[error("of the target's displacement left by the best pair, too: it does not help")]
    NoHelp(f64),
}

impl ReasonInSpace {
    /// The number that rejects; none where there is only a failure.
    pub fn number(&self) -> Option<f64> {
        match *self {
            Self::NoSlice(_) | Self::BestMissing(_) | Self::Diverges => None,
            Self::Gain { mismatch: number, .. }
            | Self::Unsure { mismatch: number, .. }
            | Self::Across { part: number, .. }
            | Self::NotNeeded { shorter: number, .. }
            | Self::OtherOptimum(_, number)
            | Self::WithoutHelp(number)
            | Self::ClosedLoop(number)
            | Self::Dearer(number)
            | Self::AtLimit(number)
            | Self::TooSlow(number)
            | Self::WrongSide(number)
            | Self::NoHelp(number) => Some(number),
        }
    }

    /// The number as people read it.
    pub(super) fn number_text(&self) -> String {
        match (self, self.number()) {
            (Self::Dearer(ratio), _) => format!("{ratio:.1}"),
            (_, Some(share)) if share.is_finite() => format!("{:.3} %", 100.0 * share),
            _ => "–".to_owned(),
        }
    }
}

/// What was not chosen, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RejectedInSpace {
    /// What.
    pub alternative: SpaceAlternative,
    /// Why, in words.
    #[serde(serialize_with = "in_words")]
    pub reason: ReasonInSpace,
    /// The number that rejects; null where there is only a failure.
    pub number: Option<f64>,
}

fn in_words<S: Serializer>(reason: &ReasonInSpace, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(reason)
}

impl RejectedInSpace {
    fn new(alternative: SpaceAlternative, reason: ReasonInSpace) -> Self {
        Self { alternative, number: reason.number(), reason }
    }
}

/// What a fit's numbers say.
pub(super) fn verdict(fit: &SpaceFit) -> SpaceVerdict {
    let against = against_slice(fit);
    let mut verdict = SpaceVerdict { dimension: if against.is_empty() { 2 } else { 3 }, ..SpaceVerdict::default() };
    let reject = |alternative, reasons: Vec<ReasonInSpace>| {
        reasons.into_iter().map(move |reason| RejectedInSpace::new(alternative, reason))
    };
    if let (true, Some(slice)) = (against.is_empty(), &fit.slice) {
        let dearer = ReasonInSpace::Dearer(fit.body.cost_s / slice.model.cost_s);
        verdict.rejected.extend(reject(SpaceAlternative::Body, vec![dearer]));
    }
    verdict.rejected.extend(reject(SpaceAlternative::PlaneStrain, against));
    let against = against_one(&fit.one, fit.tolerance);
    match (&fit.two, against.is_empty()) {
        (Some(two), false) if helps(two, &fit.one) => {
            verdict.paddles.clone_from(&two.paddles);
            verdict.rejected.extend(reject(SpaceAlternative::OnePaddle, against));
        }
        (Some(two), enough) => {
            verdict.paddles.clone_from(&fit.one.paddles);
            let shorter = 1.0 - two.measure / fit.one.measure;
            let reason = match enough {
                true => ReasonInSpace::NotNeeded { shorter, stroke: fit.one.stroke_over_limit },
                false => ReasonInSpace::NoHelp(two.left_at_limit),
            };
            verdict.rejected.extend(reject(SpaceAlternative::TwoPaddles, vec![reason]));
        }
        (None, _) => {
            verdict.paddles.clone_from(&fit.one.paddles);
            verdict.rejected.extend(reject(SpaceAlternative::OnePaddle, against));
        }
    }
    verdict
}

/// Whether a pair does better in what one paddle fails in.
fn helps(two: &PaddleSet, one: &PaddleSet) -> bool {
    let wrong = |set: &PaddleSet| set.without_knowing.is_some_and(|gain| gain >= 1.0);
    two.left_at_limit < one.left_at_limit
        || one.rate_over_limit > 1.0 && two.rate_over_limit < one.rate_over_limit
        || wrong(one) && !wrong(two)
}

/// Whether something speaks against the best single paddle alone.
pub(super) fn fails_alone(fit: &SpaceFit) -> bool {
    !against_one(&fit.one, fit.tolerance).is_empty()
}

fn against_one(one: &PaddleSet, tolerance: f64) -> Vec<ReasonInSpace> {
    let mut against = Vec::new();
    if one.left_at_limit > tolerance {
        against.push(ReasonInSpace::AtLimit(one.left_at_limit));
    }
    if one.rate_over_limit > 1.0 {
        against.push(ReasonInSpace::TooSlow(one.rate_over_limit));
    }
    against.extend(one.without_knowing.filter(|gain| *gain >= 1.0).map(ReasonInSpace::WrongSide));
    against
}

/// What speaks against the slice; nothing where it will do.
fn against_slice(fit: &SpaceFit) -> Vec<ReasonInSpace> {
    let Some(slice) = &fit.slice else {
        return vec![ReasonInSpace::NoSlice(fit.slice_failure.clone().unwrap_or_default())];
    };
    let is_wrong = |error: f64| error.is_nan() || error > fit.tolerance;
    let best = fit.optimum.dynamic;
    let mut against = Vec::new();
    let found = fit.paddles.iter().find(|paddle| Some(paddle.index) == best);
    match found.and_then(|paddle| Some((paddle.index, paddle.feedback?, paddle.body_error))) {
        Some((paddle, feedback, body_error)) => {
            let open = body_error.unwrap_or(0.0) + slice.model.error_estimate.unwrap_or(0.0);
            let mismatch = feedback.gain_mismatch;
            if is_wrong(mismatch) {
                against.push(ReasonInSpace::Gain { paddle, mismatch });
            } else if is_wrong(mismatch + open) {
                against.push(ReasonInSpace::Unsure { paddle, mismatch, open });
            }
            if is_wrong(feedback.across.abs()) {
                against.push(ReasonInSpace::Across { paddle, part: feedback.across.abs() });
            }
        }
        None => against.extend(best.map(ReasonInSpace::BestMissing)),
    }
    let off = off_without_help(slice);
    if is_wrong(off) {
        against.push(ReasonInSpace::WithoutHelp(off));
    }
    match &slice.closed_loop {
        Some(followed) if !followed.converges => against.push(ReasonInSpace::Diverges),
        Some(followed) => {
            let left = followed.with_feedback.whole() / orthogonal_way(slice);
            against.extend(is_wrong(left).then_some(ReasonInSpace::ClosedLoop(left)));
        }
        None => {}
    }
    if let Some(other) = slice.optimum.dynamic.filter(|other| Some(*other) != best) {
        let measure = |index: Option<u32>| fit.paddles.iter().find(|p| Some(p.index) == index).map(|p| p.body);
        let longer = measure(Some(other)).zip(measure(best)).map_or(f64::INFINITY, |(other, best)| other / best - 1.0);
        if is_wrong(longer) {
            against.push(ReasonInSpace::OtherOptimum(other, longer));
        }
    }
    against
}

/// How far the slice is off the target's displacement without help: orthogonal to the needle, which is what paddles are
/// for, over the way there; along it, over the whole way.
fn off_without_help(slice: &SliceInBody) -> f64 {
    let way = slice.without_help;
    let apart = (way.body_in_plane - way.slice_in_plane).hypot(way.body_across_plane);
    let whole = way.body_in_plane.hypot(way.body_across_plane).hypot(way.body_axial);
    (apart / orthogonal_way(slice)).max((way.body_axial - way.slice_axial).abs() / whole)
}

/// The target's displacement in the body orthogonal to the needle, without help; not less than what of the whole way
/// nobody would take care of.
fn orthogonal_way(slice: &SliceInBody) -> f64 {
    let way = slice.without_help;
    let orthogonal = way.body_in_plane.hypot(way.body_across_plane);
    orthogonal.max(NEGLIGIBLE * orthogonal.hypot(way.body_axial))
}
