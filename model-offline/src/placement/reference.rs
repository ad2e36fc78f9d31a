//! A solution to judge others by: quadratic triangles, refined where the answers ask for it and extrapolated.

use super::goal_oriented::{Asked, Certified, Refinement};
use super::hindrance::{best_to_control, hindrance, is_usable};
use super::rest::RestResponse;
use crate::model::ModelError;
use crate::scene::Scene;

/// A solution on quadratic triangles, extrapolated, to judge others by.
#[derive(Debug, Clone)]
pub struct Reference {
    scene: Scene,
    asked: Asked,
    responses: Vec<RestResponse>,
    open_by_paddle: Vec<f64>,
    open_jacobian: Vec<f64>,
    counted: Vec<bool>,
    open_displacement: f64,
    /// What it leaves open: worst relative error, of the displacements and of the measures of all paddles but those that are
    /// left out.
    pub open: f64,
    /// Nodes of the finer mesh.
    pub nodes: usize,
}

impl Reference {
    /// Refines until what the limit leaves open is no more than `share`, or as far as nodes are accepted.
    ///
    /// # Errors
    /// [`ModelError`] as for any model.
    pub fn compute(scene: &Scene, share: f64) -> Result<Self, ModelError> {
        Self::sharpened(&mut Refinement::new(scene, Asked::All)?, share)
    }

    /// The same from where a refinement has got to.
    ///
    /// # Errors
    /// [`ModelError`] as for any model.
    pub(super) fn sharpened(refinement: &mut Refinement, share: f64) -> Result<Self, ModelError> {
        let (certified, _) = refinement.until(|certified| certified.worst_open() <= share)?;
        Ok(Self::from_certified(certified))
    }

    pub(super) fn from_certified(certified: &Certified) -> Self {
        Self {
            scene: certified.model.scene().clone(),
            asked: certified.asked.clone(),
            responses: certified.limit.clone(),
            open_by_paddle: certified.open.clone(),
            open_jacobian: certified.open_jacobian.clone(),
            counted: certified.counted.clone(),
            open_displacement: certified.open_displacement,
            open: certified.worst_open(),
            nodes: certified.nodes,
        }
    }

    /// Estimated relative errors of the controllability measures, paddle by paddle: the distance to the limit, and what
    /// that leaves open.
    pub fn errors(&self, responses: &[RestResponse]) -> Vec<f64> {
        let off = responses.iter().zip(&self.responses).map(|(found, limit)| found.measure_distance(limit));
        off.zip(&self.open_by_paddle).map(|(off, open)| off + open).collect()
    }

    /// Whose measures a tolerance is of, paddle by paddle: not those of paddles that no table can be made of, neither by these
    /// responses nor wherever the limit lies, where they are not known to a tenth; and where the tolerance is not reached with
    /// them, not those of paddles that can neither hold the target nor are the best to control it, by these responses either.
    /// Nobody needs such measures to three digits. All count where that leaves none.
    pub fn counts(&self, responses: &[RestResponse]) -> Vec<bool> {
        let best = best_to_control(responses);
        let may_matter = |place: usize, found: &RestResponse| {
            let is_asked = !self.asked.spares(place) || best == Some(place);
            is_usable(found) && (is_asked || hindrance(found, &self.scene).is_none())
        };
        let all = responses.iter().enumerate();
        all.map(|(place, found)| self.counted[place] || may_matter(place, found)).collect()
    }

    /// Worst of the [errors](Self::errors) that [count](Self::counts).
    pub fn worst_error(&self, responses: &[RestResponse]) -> f64 {
        worst(self.errors(responses), &self.counts(responses))
    }

    /// Whether the errors that count are known to within a factor of three: what is left open of each is at most half the
    /// distance, or negligible.
    pub(super) fn tells(&self, responses: &[RestResponse], negligible: f64) -> bool {
        let open = self.open_by_paddle.iter().zip(self.counts(responses));
        let off = responses.iter().zip(&self.responses).map(|(found, limit)| found.measure_distance(limit));
        open.zip(off).all(|((open, counts), off)| !counts || *open <= 0.5 * off || *open <= negligible)
    }

    /// What the limit leaves open of the controllability measures, paddle by paddle, relative.
    pub fn open_by_paddle(&self) -> &[f64] {
        &self.open_by_paddle
    }

    /// What the limit leaves open of the Jacobians, paddle by paddle, over their norm.
    pub fn open_jacobian(&self) -> &[f64] {
        &self.open_jacobian
    }

    /// Whose measures do not count by the limit alone, as places in the scene's list of paddles.
    pub fn left_out(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.counted.len()).filter(|&place| !self.counted[place])
    }

    /// What the limit leaves open of the small-depth displacements, over the largest.
    pub fn open_displacement(&self) -> f64 {
        self.open_displacement
    }

    /// Worst relative distance of the controllability measures that [count](Self::counts), and of the small-depth target
    /// displacements over the largest one.
    pub fn distance(&self, responses: &[RestResponse]) -> (f64, f64) {
        distance(responses, &self.responses, &self.counts(responses))
    }

    /// The extrapolated responses.
    pub fn responses(&self) -> &[RestResponse] {
        &self.responses
    }
}

/// Worst relative distance of the measures that count, and of the displacements over the largest one.
pub fn distance(a: &[RestResponse], b: &[RestResponse], counts: &[bool]) -> (f64, f64) {
    let largest = b.iter().map(|r| r.target_per_depth.norm()).fold(f64::MIN_POSITIVE, f64::max);
    let apart = a.iter().zip(b).map(|(a, b)| (a.target_per_depth - b.target_per_depth).norm() / largest);
    (worst(a.iter().zip(b).map(|(a, b)| a.measure_distance(b)), counts), apart.fold(0.0, f64::max))
}

/// The largest of what counts.
fn worst(errors: impl IntoIterator<Item = f64>, counts: &[bool]) -> f64 {
    let counted = errors.into_iter().zip(counts).filter(|(_, counts)| **counts);
    counted.map(|(error, _)| error).fold(0.0, f64::max)
}
