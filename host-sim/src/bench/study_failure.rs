//! Why a static study of a placement ended early, as results have it: the reason's name and the numbers behind it in one
//! string.

use model_offline::placement::study::StaticFailure;
use model_offline::solver::equilibrium::FailureReason;
use serde::{Deserialize, Serialize};
use strum::VariantArray as _;

/// Why a study ended before the full depth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct StudyFailure {
    /// What happened.
    pub reason: FailureReason,
    /// Numbers behind the reason.
    pub detail: String,
}

impl From<&StaticFailure> for StudyFailure {
    fn from(failure: &StaticFailure) -> Self {
        Self { reason: failure.reason, detail: failure.detail.clone() }
    }
}

impl std::fmt::Display for StudyFailure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.reason, self.detail)
    }
}

impl From<StudyFailure> for String {
    fn from(failure: StudyFailure) -> Self {
        failure.to_string()
    }
}

impl TryFrom<String> for StudyFailure {
    type Error = NoReason;

    fn try_from(text: String) -> Result<Self, NoReason> {
        let known = |(name, detail): (&str, &str)| {
            let reason = FailureReason::VARIANTS.iter().copied().find(|reason| reason.to_string() == name)?;
            Some(Self { reason, detail: detail.to_owned() })
        };
        text.split_once(": ").and_then(known).ok_or_else(|| NoReason { text: text.clone() })
    }
}

/// A text that does not begin with the name of a reason.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` does not begin with a reason why a study ends early")]
pub struct NoReason {
    /// The text.
    pub text: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_are_read_back_and_others_refused() {
        for &reason in FailureReason::VARIANTS {
            let failure = StudyFailure { reason, detail: "det F = -0.1: at 3".to_owned() };
            let text = serde_json::to_string(&failure).unwrap();
            assert_eq!(text, format!("\"{reason}: det F = -0.1: at 3\""));
            assert_eq!(serde_json::from_str::<StudyFailure>(&text).unwrap(), failure);
        }
        for wrong in ["\"tired: at 3\"", "\"not-converged\"", "\"\""] {
            assert!(serde_json::from_str::<StudyFailure>(wrong).is_err(), "{wrong}");
        }
    }
}
