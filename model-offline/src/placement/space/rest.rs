//! Responses at rest in space, of all paddles and pairs from one factorisation.
//!
//! The body is factorised with immobile part and needle held and no paddle attached, and what paddles and target take is
//! condensed to the compliance C between the rows of all paddle nodes, G from them to the target, and u°, what the needle
//! does to both per depth. Attaching paddles A is then dense work on their own rows: forces λ with `C_AA λ = E δ − u°_A` hold them
//! at the translations δ, and the target moves by `u°_t + G_Aᵀ λ`. Rows in several attached patches follow the mean
//! of their translations, which does not change the limit of the Jacobian: forces there do no work on it.

use super::controllability::Controllability;
use crate::linalg::DenseCholesky;
use crate::model::space::{Holder, SpaceModel};
use crate::model::{Condensing, ModelError};
use crate::placement::condensed::{CondensedBody, singular};
use faer::Mat;
use nalgebra::{DMatrix, Vector3};
use std::collections::BTreeMap;

/// How the target answers to paddles and needle, at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct SpaceResponse {
    /// Actuation Jacobian, needle held: rows target x, y, z, three columns per paddle.
    pub jacobian: DMatrix<f64>,
    /// d(target displacement)/d(depth), paddles held.
    pub target_per_depth: Vector3<f64>,
    /// What the Jacobian controls; none without a paddle.
    pub controllability: Option<Controllability>,
}

impl SpaceResponse {
    /// What the target does per depth, then per displacement of the paddles: 3 rows, a column per control.
    pub fn per_control(&self) -> DMatrix<f64> {
        let mut all = self.jacobian.clone().insert_column(0, 0.0);
        all.set_column(0, &self.target_per_depth);
        all
    }
}

/// The condensed body at rest: what answers for any set of attached paddles.
#[derive(Debug)]
pub struct CondensedRest<'m> {
    model: &'m SpaceModel,
    /// Place of a paddle node among all of them.
    place: BTreeMap<u32, usize>,
    /// Compliance between the rows of the paddle nodes, three each, and of the target, which come last.
    compliance: Mat<f64>,
    /// What the needle does per depth to the paddle nodes, and to the target.
    per_depth: Vec<Vector3<f64>>,
    target_per_depth: Vector3<f64>,
}

impl<'m> CondensedRest<'m> {
    /// Assembles, factorises and condenses.
    ///
    /// # Errors
    /// [`ModelError`] when the tangent at rest is singular.
    pub fn new(model: &'m SpaceModel) -> Result<Self, ModelError> {
        let Condensing { analysis, retained, ports } = model.condensing_analysis();
        let held = model.held_rows(&[]);
        let sampled = (&**model.spatial().rule(), model.tissue());
        let mut body = CondensedBody::<3>::new(sampled, &analysis, (retained, ports.as_ref()), held.rows.clone())?;
        let field = body.fields(&vec![0.0; body.unknowns()], &held.values(model.scene().needle.axis, &[]), 1e-14);
        let nodes = model.paddles_nodes();
        Ok(Self {
            per_depth: nodes.iter().map(|&node| model.row(node).interpolate(&field)).collect(),
            target_per_depth: model.target_row().interpolate(&field),
            compliance: body.compliance(nodes.iter().map(|&node| model.row(node)).chain([model.target_row()])),
            place: nodes.iter().enumerate().map(|(at, &node)| (node, at)).collect(),
            model,
        })
    }

    /// The response with some paddles attached, by their places in the scene's list.
    ///
    /// # Errors
    /// [`ModelError`] when the paddles' compliance is singular.
    pub fn response(&self, attached: &[usize]) -> Result<SpaceResponse, ModelError> {
        if attached.is_empty() {
            return Ok(SpaceResponse {
                jacobian: DMatrix::zeros(3, 0),
                target_per_depth: self.target_per_depth,
                controllability: None,
            });
        }
        let mut on: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (slot, &paddle) in attached.iter().enumerate() {
            self.model.paddle_nodes(paddle).iter().for_each(|&node| on.entry(node).or_default().push(slot));
        }
        let holders: Vec<(usize, Holder)> =
            on.into_iter().map(|(node, slots)| (self.place[&node], Holder::Paddles(slots))).collect();
        let row = |r: usize| 3 * holders[r / 3].0 + r % 3;
        let (count, rates) = (3 * holders.len(), 3 * attached.len());
        let attached_compliance = Mat::from_fn(count, count, |r, c| self.compliance[(row(r), row(c))]);
        // A column per translation of a paddle, and what the needle does.
        let mut sides = Mat::from_fn(count, rates + 1, |r, c| match &holders[r / 3] {
            (_, Holder::Paddles(slots)) if c < rates => {
                let follows = slots.contains(&(c / 3)) && c % 3 == r % 3;
                f64::from(u8::from(follows)) / slots.len() as f64
            }
            (place, _) => self.per_depth[*place][r % 3],
        });
        let refused = |_| singular("the compliance of the paddles is not positive definite");
        DenseCholesky::new(attached_compliance).map_err(refused)?.solve(sides.as_mut());
        let target = self.compliance.nrows() - 3;
        let answer =
            |t: usize, c: usize| (0..count).map(|r| self.compliance[(row(r), target + t)] * sides[(r, c)]).sum::<f64>();
        let jacobian = DMatrix::from_fn(3, rates, &answer);
        Ok(SpaceResponse {
            target_per_depth: self.target_per_depth - Vector3::from_fn(|t, _| answer(t, rates)),
            controllability: Some(Controllability::of(&jacobian, &self.model.scene().needle.orthogonal())),
            jacobian,
        })
    }
}

/// What is attached: every paddle, every pair, nothing; by place in the scene's list.
pub(super) fn all_sets(model: &SpaceModel) -> Vec<Vec<usize>> {
    let scene = model.scene();
    let singles = (0..scene.paddles.len()).map(|p| vec![p]);
    singles.chain(scene.pairs.iter().map(|pair| pair.to_vec())).chain([Vec::new()]).collect()
}

/// Responses of every paddle, then every pair, then without any, at rest.
///
/// # Errors
/// [`ModelError`] when the body at rest cannot be solved.
pub fn rest_responses(model: &SpaceModel) -> Result<Vec<SpaceResponse>, ModelError> {
    let rest = CondensedRest::new(model)?;
    all_sets(model).iter().map(|attached| rest.response(attached)).collect()
}
