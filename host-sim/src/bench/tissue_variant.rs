//! The two tissues that a scene has: with its inclusions and without.

use model_offline::scene::Scene;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which tissue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
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
    pub const fn name(self) -> &'static str {
        match self {
            Self::Homogeneous => "homogeneous",
            Self::Inclusion => "inclusion",
        }
    }

    /// The scene with this tissue.
    pub fn of(self, scene: &Scene) -> Scene {
        match self {
            Self::Homogeneous => scene.without_inclusions(),
            Self::Inclusion => scene.clone(),
        }
    }
}

impl std::fmt::Display for TissueVariant {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
