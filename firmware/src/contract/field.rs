//! Parts of a table that refusals name.

use core::fmt;

/// Part of a table, named in refusals. A number, so that an image that shows no words carries none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Field {
    /// Target position.
    TargetPosition,
    /// Paddle extent.
    PaddleExtent,
    /// Needle axis.
    NeedleAxis,
    /// Orthogonal direction.
    OrthogonalDirection,
    /// Paddle displacement limit.
    PaddleDisplacementLimit,
    /// Paddle rate limit.
    PaddleRateLimit,
    /// Valid paddle displacement.
    ValidPaddleDisplacement,
    /// Needle speed limit.
    NeedleSpeedLimit,
    /// Gains.
    Gains,
    /// Validity depth range.
    ValidityDepthRange,
    /// Knot depth.
    KnotDepth,
    /// Knot Jacobian.
    KnotJacobian,
    /// Knot paddle path.
    KnotPaddlePath,
    /// Knot paddle path slope.
    KnotPaddlePathSlope,
    /// Knot target displacement.
    KnotTargetDisplacement,
    /// Knot target displacement slope.
    KnotTargetDisplacementSlope,
    /// Knot static target displacement.
    KnotStaticTargetDisplacement,
    /// Depth range.
    DepthRange,
    /// Distance from paddle to target.
    DistanceFromPaddleToTarget,
    /// Target displacement.
    TargetDisplacement,
    /// Target displacement slope.
    TargetDisplacementSlope,
    /// Paddle path slope.
    PaddlePathSlope,
}

impl Field {
    /// Name as messages show it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::TargetPosition => "target position",
            Self::PaddleExtent => "paddle extent",
            Self::NeedleAxis => "needle axis",
            Self::OrthogonalDirection => "orthogonal direction",
            Self::PaddleDisplacementLimit => "paddle displacement limit",
            Self::PaddleRateLimit => "paddle rate limit",
            Self::ValidPaddleDisplacement => "valid paddle displacement",
            Self::NeedleSpeedLimit => "needle speed limit",
            Self::Gains => "gains",
            Self::ValidityDepthRange => "validity depth range",
            Self::KnotDepth => "knot depth",
            Self::KnotJacobian => "knot Jacobian",
            Self::KnotPaddlePath => "knot paddle path",
            Self::KnotPaddlePathSlope => "knot paddle path slope",
            Self::KnotTargetDisplacement => "knot target displacement",
            Self::KnotTargetDisplacementSlope => "knot target displacement slope",
            Self::KnotStaticTargetDisplacement => "knot static target displacement",
            Self::DepthRange => "depth range",
            Self::DistanceFromPaddleToTarget => "distance from paddle to target",
            Self::TargetDisplacement => "target displacement",
            Self::TargetDisplacementSlope => "target displacement slope",
            Self::PaddlePathSlope => "paddle path slope",
        }
    }
}

impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::string::ToString;

    use super::Field;

    #[test]
    fn every_field_has_a_name_of_its_own() {
        use Field as F;
        let all = [
            F::TargetPosition,
            F::PaddleExtent,
            F::NeedleAxis,
            F::OrthogonalDirection,
            F::PaddleDisplacementLimit,
            F::PaddleRateLimit,
            F::ValidPaddleDisplacement,
            F::NeedleSpeedLimit,
            F::Gains,
            F::ValidityDepthRange,
            F::KnotDepth,
            F::KnotJacobian,
            F::KnotPaddlePath,
            F::KnotPaddlePathSlope,
            F::KnotTargetDisplacement,
            F::KnotTargetDisplacementSlope,
            F::KnotStaticTargetDisplacement,
            F::DepthRange,
            F::DistanceFromPaddleToTarget,
            F::TargetDisplacement,
            F::TargetDisplacementSlope,
            F::PaddlePathSlope,
        ];
        let names: BTreeSet<&str> = all.iter().map(|field| field.name()).collect();
        assert_eq!(names.len(), all.len());
        for field in all {
            // The variant's name in words: `KnotJacobian` is the knot Jacobian.
            let letters = std::format!("{field:?}").to_lowercase();
            assert_eq!(field.name().replace(' ', "").to_lowercase(), letters);
            assert_eq!(field.to_string(), field.name());
        }
    }
}
