//! Which model answered for the tissue, and how well.

use model_offline::scene::PlantModel;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which model answered, how often it could not, and how far off it was.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PlantAccount {
    /// The model.
    pub model: PlantModel,
    /// Modes of the reduced model.
    #[serde(default)]
    pub modes: Option<usize>,
    /// Integration points left of the full model's.
    #[serde(default)]
    pub points: Option<[usize; 2]>,
    /// Steps that the full model answered because the reduced one could not.
    #[serde(default)]
    pub fallbacks: u64,
    /// Why, the first time; or why there is no reduced model.
    #[serde(default)]
    pub first_fallback: Option<String>,
    /// Whether the insertion was simulated near its planned way first, left that, and is of the full model therefore.
    #[serde(default)]
    pub left_the_way: bool,
    /// Why the full model could not simulate the insertion in its place, where that was tried because it left the way.
    #[serde(default)]
    pub not_in_full: Option<String>,
    /// What a step of the full model takes, µs, where the reduced one stands in because that is too long.
    #[serde(default)]
    pub full_step_us: Option<f64>,
    /// Largest error of the target displacement that the reduced model estimated of itself, length.
    #[serde(default)]
    pub largest_estimate: Option<f64>,
    /// States on the path that stands in for tissue that has a past.
    #[serde(default)]
    pub path_knots: Option<usize>,
    /// States that the full model was solved for, where it was extrapolated between.
    #[serde(default)]
    pub solves: Option<u64>,
    /// Largest error of an extrapolated target displacement that solving found, the end of the run included, length.
    #[serde(default)]
    pub extrapolation_error: Option<f64>,
    /// How long the skin had given way either here or in the full model and not yet in both, to half of the path's interval, s.
    /// `extrapolation_error` leaves these moments out where they are less than a tenth of a second.
    #[serde(default)]
    pub puncture_apart_s: Option<f64>,
    /// Largest distance from the full model's target displacement in these moments, length.
    #[serde(default)]
    pub puncture_apart_error: Option<f64>,
    /// Why the full model could not be taken the same way, where it could not: then nothing is known of how far off this was.
    #[serde(default)]
    pub not_verified: Option<String>,
    /// Distance from the full model's target displacement at the end of the learnt insertion, length; computed after it.
    #[serde(default)]
    pub error_at_end: Option<f64>,
    /// States, spread over those that a model which stands in for the full one answered itself, that the full one was asked for
    /// after the run.
    #[serde(default)]
    pub states_verified: Option<usize>,
    /// Largest distance from the full model's target displacement in these, length.
    #[serde(default)]
    pub largest_error: Option<f64>,
}

impl PlantAccount {
    /// How far the target was from where the full model has it, length, where another one stood in for it: found by going the same way
    /// in full, infinite where that could not be done. None of the full model, which is as exact between its solves as is asked for.
    pub fn off(&self) -> Option<f64> {
        match self.not_verified {
            _ if self.model == PlantModel::Full => None,
            Some(_) => Some(f64::INFINITY),
            None => self.extrapolation_error.into_iter().chain(self.largest_error).reduce(f64::max),
        }
    }
}

impl Default for PlantAccount {
    /// The full model, which has nothing to account for.
    fn default() -> Self {
        Self {
            model: PlantModel::Full,
            modes: None,
            points: None,
            fallbacks: 0,
            first_fallback: None,
            left_the_way: false,
            not_in_full: None,
            full_step_us: None,
            largest_estimate: None,
            path_knots: None,
            solves: None,
            extrapolation_error: None,
            puncture_apart_s: None,
            puncture_apart_error: None,
            not_verified: None,
            error_at_end: None,
            states_verified: None,
            largest_error: None,
        }
    }
}
