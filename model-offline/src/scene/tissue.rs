//! The two tissues that a scene has: with its inclusions and without.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Scene;

/// Which tissue of a scene.
#[derive(
    Clone,
    Copy,
    Debug,
    PartialEq,
    Eq,
    Serialize,
    Deserialize,
    JsonSchema,
    clap::ValueEnum,
    strum::Display,
    strum::IntoStaticStr,
)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum TissueVariant {
    /// The scene without its inclusions.
    Homogeneous,
    /// The scene as it is.
    Inclusion,
}

impl TissueVariant {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Homogeneous, Self::Inclusion];

    /// Name in results, tables and files.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// The scene with this tissue.
    pub fn of(self, scene: &Scene) -> Scene {
        match self {
            Self::Homogeneous => scene.without_inclusions(),
            Self::Inclusion => scene.clone(),
        }
    }
}
