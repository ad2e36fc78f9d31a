//! Quadratic triangles refined where the answer asks for it, with an error that nested meshes certify.
//!
//! What is asked for are displacements of one point, so that the error of an answer is a product of two errors: with the
//! response u to what is prescribed and the response z to a load on the target, both in their spaces of finite elements,
//! `J(u_f) − J(u_h) = a(u_f − u_h, z_f − z_h)` when the fine space contains the coarse one (Becker & Rannacher, Acta
//! Numerica 10, 2001). Here the fine mesh is the coarse one with every triangle cut into four: the sum over the triangles
//! is the difference of the two answers to rounding, and a triangle's part of it says whether cutting it will pay.
//!
//! **Error.** One more cut of everything would reduce what is left by a factor r: 1/16 where the solution is smooth, 1/2
//! where the type of boundary condition changes (order 2α of the singularity r^α, α = ½), and up to 0.57 at corners of stiff
//! inclusions. So the limit lies between 0.07 and 1.35 differences beyond the fine answer, which is shifted to the middle of
//! that; a whole difference is left open, half again as much as the range, because coarse meshes need not obey. Where the limit
//! has gone farther than that since the pair of meshes before, that way is left open.

use super::fields::{Fields, Loads};
use super::hindrance::{Open, is_hindered_within, is_usable, is_usable_within, is_useless_within};
use super::rest::{RestResponse, for_each_paddle, response_of};
use crate::discretization::nodes::bisection::Triangulation;
use crate::discretization::{Integration, Method, Planar};
use crate::geometry::{Point2, cross};
use crate::material::Material;
use crate::mechanics::Tissue;
use crate::mechanics::assembly::displacement_gradient;
use crate::model::{ModelError, TissueModel};
use crate::scene::Scene;
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

/// The limit's distance from the fine answer over the difference of the answers: middle, and what is left open.
const SHIFT: f64 = 0.7;
const OPEN: f64 = 1.0;
/// What direction may add to the error of a length whose own difference vanishes by accident.
const SIDEWAYS: f64 = 0.25;
/// The share of an amplified error of the Jacobian that reaches a length, before a pair of meshes has shown one.
const UNKNOWN_SHARE: f64 = 0.1;
/// How much of the share counts one pair of meshes later: where a Jacobian is all but singular, the differences of one
/// pair cancel by accident.
const REMEMBERED: f64 = 0.5;
/// What is left open, relative, from which on the measure of a paddle that no table can be made of is given up, where those of
/// all paddles are asked for.
const HOPELESS: f64 = 0.1;
/// Share of the sum of the triangles' parts that the triangles cut next make up; less of it where that takes too many nodes.
const CUTS: [f64; 4] = [0.6, 0.45, 0.3, 0.2];
/// Fewer triangles more than that, over those that there are, are not worth another solution.
const LEAST_GROWTH: f64 = 1.1;
/// More nodes than this are not tried on the fine mesh.
const MAX_NODES: usize = 80_000;
/// Refinement level of the graded nodes that the first triangulation is made of.
const FIRST_LEVEL: i32 = -2;

/// What a pair of nested meshes says.
#[derive(Debug, Clone)]
pub(super) struct Certified {
    /// The coarse model.
    pub model: TissueModel,
    /// Its answers.
    pub responses: Vec<RestResponse>,
    /// Where the answers tend to, paddle by paddle.
    pub limit: Vec<RestResponse>,
    /// What that leaves open of the controllability measures, relative.
    pub open: Vec<f64>,
    /// What it leaves open of the Jacobians, over their norm.
    pub open_jacobian: Vec<f64>,
    /// Whose measures are to be known.
    pub asked: Asked,
    /// Whose measures have to be known: those that are [asked for](Asked), and of all paddles where that leaves none.
    pub counted: Vec<bool>,
    /// Which cannot hold the target, wherever the limit lies, nor be the best to control it.
    unable: Vec<bool>,
    /// What it leaves open of the small-depth displacements, over the largest.
    pub open_displacement: f64,
    /// The share of an amplified error of the Jacobian that reaches the length, paddle by paddle.
    shares: Vec<f64>,
    /// Nodes of the fine model.
    pub nodes: usize,
    /// Fields of the coarse model, paddle by paddle.
    pub fields: Vec<Fields>,
}

impl Certified {
    /// The largest part that is left open, of measures that have to be known and of displacements.
    pub(super) fn worst_open(&self) -> f64 {
        let known = self.open.iter().zip(&self.counted).filter(|(_, counts)| **counts);
        known.map(|(open, _)| *open).fold(self.open_displacement, f64::max)
    }
}

/// Whose measures a refinement is to make known: never those of the hopeless, of which no table can be made, wherever the limit
/// lies, and which are far from known.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Asked {
    /// Those of all other paddles.
    All,
    /// Those of all others but the spared, in the order of the scene.
    AllBut(Vec<bool>),
}

impl Asked {
    /// Whether a paddle is spared.
    pub(super) fn spares(&self, paddle: usize) -> bool {
        matches!(self, Self::AllBut(spared) if spared[paddle])
    }
}

/// A refinement on its way: it can be asked for more.
#[derive(Debug)]
pub(super) struct Refinement {
    scene: Scene,
    asked: Asked,
    mesh: Triangulation,
    /// What the present mesh says, and every triangle's part of what is missing.
    last: Option<(Certified, Vec<f64>)>,
}

impl Refinement {
    /// The present mesh and what it says.
    pub(super) fn present(&self) -> Option<(&Triangulation, &Certified)> {
        self.last.as_ref().map(|(certified, _)| (&self.mesh, certified))
    }

    /// What else to ask for where the tolerance is not reached: the same without paddles that cannot hold the target and whose
    /// measures, on this mesh, are not within `most`. None where those are none, or all.
    pub(super) fn without_unable(&self, most: f64) -> Option<Asked> {
        let (last, _) = self.last.as_ref()?;
        let limits = last.limit.iter().zip(&last.open);
        let errors =
            last.responses.iter().zip(limits).map(|(found, (limit, open))| found.measure_distance(limit) + open);
        let is_spared = |(unable, error): (&bool, f64)| *unable && error > most;
        let spared: Vec<bool> = last.unable.iter().zip(errors).map(is_spared).collect();
        let changes = spared.iter().zip(&last.counted).any(|(spared, counted)| *spared && *counted);
        (changes && spared.contains(&false)).then_some(Asked::AllBut(spared))
    }

    /// The coarsest mesh, not solved yet.
    ///
    /// # Errors
    /// [`ModelError`] where the scene has no triangulation.
    pub(super) fn new(scene: &Scene, asked: Asked) -> Result<Self, ModelError> {
        let mut scene = scene.clone();
        scene.discretization.essential = crate::discretization::Essential::Transformation;
        scene.discretization.method = Method::new(Integration::FemT6);
        let features = scene.features();
        let mesh =
            Triangulation::coarse(&features, FIRST_LEVEL).map_err(crate::discretization::DiscretizationError::from)?;
        Ok(Self { scene, asked, mesh, last: None })
    }

    /// Refines until `enough` says so; the last pair of meshes, enough or not, when more nodes would be too many.
    ///
    /// # Errors
    /// [`ModelError`] as for any model.
    pub(super) fn until(
        &mut self,
        mut enough: impl FnMut(&Certified) -> bool,
    ) -> Result<(&Certified, bool), ModelError> {
        let mut last = match self.last.take() {
            Some(last) => last,
            None => certified(&self.scene, &self.asked, &self.mesh, None)?,
        };
        let mut is_enough = enough(&last.0);
        while !is_enough {
            let Some(next) = self.finer(&last.1) else { break };
            last = certified(&self.scene, &self.asked, &next, Some(&last.0))?;
            self.mesh = next;
            is_enough = enough(&last.0);
        }
        Ok((&self.last.insert(last).0, is_enough))
    }

    /// The present mesh with the triangles cut that what is missing asks for most; with fewer of them cut where those would be
    /// too many nodes, and none where that is hardly more than there are.
    fn finer(&self, parts: &[f64]) -> Option<Triangulation> {
        // Quadratic triangles have about twice as many nodes as there are triangles, and the fine ones four times that.
        let most = MAX_NODES / 8;
        let worth = |share: f64, next: &Triangulation| {
            share == CUTS[0] || next.triangles.len() as f64 > LEAST_GROWTH * self.mesh.triangles.len() as f64
        };
        let mut tries = CUTS.into_iter().map(|share| (share, self.mesh.bisected(&largest(parts, share)).0));
        let fits = tries.find(|(_, next)| next.triangles.len() <= most);
        fits.filter(|(share, next)| worth(*share, next)).map(|(_, next)| next)
    }
}

/// A mesh certified by the one in which each of its triangles is cut into four, and by what coarser ones have shown.
fn certified(
    scene: &Scene,
    asked: &Asked,
    mesh: &Triangulation,
    before: Option<&Certified>,
) -> Result<(Certified, Vec<f64>), ModelError> {
    let (fine, parents) = mesh.refined();
    Pair { coarse: model_on(scene, mesh)?, fine: model_on(scene, &fine)?, parents }.certify(asked, before)
}

fn model_on(scene: &Scene, mesh: &Triangulation) -> Result<TissueModel, ModelError> {
    let planar = Planar::on_triangles(mesh.nodes.clone(), mesh.triangles.clone(), scene.discretization.method);
    let shortest = mesh
        .triangles
        .iter()
        .map(|&[a, b, _]| (mesh.nodes[a as usize] - mesh.nodes[b as usize]).norm())
        .fold(f64::INFINITY, f64::min);
    TissueModel::on(scene, planar, shortest)
}

/// The fewest items that make up a share of the sum.
fn largest(parts: &[f64], share: f64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..parts.len()).collect();
    order.sort_by(|&a, &b| parts[b].total_cmp(&parts[a]));
    let wanted = share * parts.iter().sum::<f64>();
    let mut sum = 0.0;
    order
        .into_iter()
        .take_while(|&i| {
            let go_on = sum < wanted;
            sum += parts[i];
            go_on
        })
        .collect()
}

/// Two nested meshes: every coarse triangle has four children.
struct Pair {
    coarse: TissueModel,
    fine: TissueModel,
    parents: Vec<u32>,
}

impl Pair {
    /// Answers of both, and every coarse triangle's part of their differences (the largest over all answers).
    fn certify(self, asked: &Asked, earlier: Option<&Certified>) -> Result<(Certified, Vec<f64>), ModelError> {
        let mut coarse: Vec<Fields> = Vec::new();
        for_each_paddle(&self.coarse, Loads::OnTarget, |_, fields| {
            coarse.push(fields.clone());
            Ok(())
        })?;
        let responses: Vec<_> = coarse.iter().map(|fields| response_of(&self.coarse, fields)).collect();
        let largest = responses.iter().map(|r| r.target_per_depth.norm()).fold(f64::MIN_POSITIVE, f64::max);
        let stiffness = self.stiffness();
        let mut parts = vec![0.0_f64; self.coarse.cells().len()];
        let (mut limit, mut open, mut open_displacement) = (Vec::new(), Vec::new(), 0.0_f64);
        let (mut open_jacobian, mut shares) = (Vec::new(), Vec::new());
        let (mut useless, mut hindered, mut within) = (Vec::new(), Vec::new(), Vec::new());
        // What one pair of meshes has decided is decided; the next one looks again.
        let is_asked = |paddle: usize| earlier.is_none_or(|earlier| earlier.counted[paddle]);
        for_each_paddle(&self.fine, Loads::OnTarget, |paddle, fields| {
            let found = response_of(&self.fine, fields);
            let errors = self.errors(&coarse[paddle], fields);
            // The first is of the measure.
            for pair in pairs(&found, largest).into_iter().skip(usize::from(!is_asked(paddle))) {
                self.add_parts(&errors, &pair, &stiffness, &mut parts);
            }
            let before = &responses[paddle];
            let shifted = shifted(before, &found, self.fine.scene().needle.orthogonal());
            let left = left_open(before, &found, earlier.map(|earlier| earlier.shares[paddle]));
            let jacobian = OPEN * (found.jacobian - before.jacobian).norm();
            let left_open = left.open.max(earlier.map_or(0.0, |earlier| went(&earlier.limit[paddle], &shifted)));
            let moved = OPEN * (found.target_per_depth - before.target_per_depth).norm();
            useless.push(is_useless_within(&shifted, jacobian) || vanishes(before, &found));
            within.push(Open { measure: left_open, jacobian, displacement: moved });
            hindered.push(is_hindered_within(&shifted, &within[paddle], self.fine.scene()));
            open_jacobian.push(jacobian / shifted.jacobian.norm().max(f64::MIN_POSITIVE));
            open.push(left_open);
            limit.push(shifted);
            shares.push(left.share);
            open_displacement = open_displacement.max(moved / largest);
            Ok(())
        })?;
        let unable = unable_and_worse(&useless, &hindered, &limit, &within);
        let counted = counted(asked, &useless, &open);
        let nodes = self.fine.nodes();
        let certified = Certified {
            model: self.coarse,
            responses,
            asked: asked.clone(),
            counted,
            unable,
            limit,
            open,
            open_jacobian,
            open_displacement,
            shares,
            nodes,
            fields: coarse,
        };
        Ok((certified, parts))
    }

    /// Stiffness of the fine triangles at rest, between flat displacement gradients.
    fn stiffness(&self) -> Vec<Matrix4<f64>> {
        (0..self.fine.cells().len() as u32).map(|cell| tangent_at_rest(self.fine.tissue(), cell)).collect()
    }

    /// Differences of the displacement gradients of all fields at the fine mesh's integration points.
    fn errors(&self, coarse: &Fields, fine: &Fields) -> Vec<[Vector4<f64>; 5]> {
        let rule = self.fine.rule();
        let at_corners = corner_gradients(&self.coarse, coarse);
        (0..rule.len())
            .map(|q| {
                let cell = rule.point(q).cell as usize;
                let parent = self.parents[cell] as usize;
                let weights = barycentric(&self.coarse.cells()[parent].corners(), point_of(&self.fine, q));
                std::array::from_fn(|f| {
                    let here = displacement_gradient(rule, q, fine.field(f));
                    let there: Matrix2<f64> = (0..3).map(|k| at_corners[f][parent][k] * weights[k]).sum();
                    flat(&(here - there))
                })
            })
            .collect()
    }

    /// |a(u_f − u_h, z_f − z_h)| of every coarse triangle, where larger than what is there.
    fn add_parts(
        &self,
        errors: &[[Vector4<f64>; 5]],
        (u, z): &([f64; 5], [f64; 5]),
        stiffness: &[Matrix4<f64>],
        parts: &mut [f64],
    ) {
        let rule = self.fine.rule();
        let mut own = vec![0.0; parts.len()];
        for (q, errors) in errors.iter().enumerate() {
            let point = rule.point(q);
            let combined = |weights: &[f64; 5]| errors.iter().zip(weights).map(|(e, w)| e * *w).sum::<Vector4<f64>>();
            let stress = stiffness[point.cell as usize] * combined(z);
            own[self.parents[point.cell as usize] as usize] += point.weight * combined(u).dot(&stress);
        }
        for (part, own) in parts.iter_mut().zip(own) {
            *part = part.max(own.abs());
        }
    }
}

/// Whether one mesh finds a paddle that the target hardly follows, and the other one none: it is on the border of what controls
/// anything at all, and no mesh will find a measure of it.
fn vanishes(coarse: &RestResponse, fine: &RestResponse) -> bool {
    let one_alone = coarse.best_direction.is_some() != fine.best_direction.is_some();
    one_alone && [coarse, fine].iter().all(|response| !is_usable(response))
}

/// Which paddles cannot hold the target and are not the best to control it either, wherever the limits lie: no table can be made
/// of the useless, so that none of them is the best; of the others, one that a table can surely be made of is surely better.
fn unable_and_worse(useless: &[bool], hindered: &[bool], limit: &[RestResponse], open: &[Open]) -> Vec<bool> {
    let measure = |paddle: usize| limit[paddle].controllability_measure;
    let usable = (0..limit.len()).filter(|&paddle| is_usable_within(&limit[paddle], open[paddle].jacobian));
    let best = usable.map(|paddle| measure(paddle) * (1.0 + open[paddle].measure)).fold(f64::INFINITY, f64::min);
    let is_worse = |paddle: usize| measure(paddle) * (1.0 - open[paddle].measure) > best;
    (0..limit.len()).map(|paddle| useless[paddle] || hindered[paddle] && is_worse(paddle)).collect()
}

/// Whose measures have to be known, of paddles that are useless or not and left open so far.
fn counted(asked: &Asked, useless: &[bool], open: &[f64]) -> Vec<bool> {
    let is_counted = |paddle: usize| !asked.spares(paddle) && (!useless[paddle] || open[paddle] <= HOPELESS);
    let mut counted: Vec<bool> = (0..open.len()).map(is_counted).collect();
    if !counted.contains(&true) {
        counted.fill(true);
    }
    counted
}

/// By how much an error of the Jacobian can change the relative error of ‖b‖: ‖J⁻ᵀb‖ / ‖b‖.
fn amplification(response: &RestResponse) -> f64 {
    let b = response.best_direction.unwrap_or_default();
    let inverse = response.jacobian.transpose().try_inverse();
    inverse.map_or(0.0, |inverse| (inverse * b).norm() / b.norm())
}

/// What is prescribed and where it is looked at, as weights on the fields (paddle x, y, needle, target x, y): the
/// controllability measure ‖b‖, whose relative change is `−(J⁻ᵀ b)ᵀ ∂J b / ‖b‖²`, and the needle's two displacements.
pub(super) fn pairs(response: &RestResponse, largest: f64) -> [([f64; 5], [f64; 5]); 3] {
    let b = response.best_direction.unwrap_or_default();
    let w = response
        .jacobian
        .transpose()
        .try_inverse()
        .filter(|_| b != Vector2::zeros())
        .map_or(Vector2::zeros(), |i| i * b / b.norm_squared());
    let needle = [0.0, 0.0, 1.0, 0.0, 0.0];
    [
        ([b.x, b.y, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, w.x, w.y]),
        (needle, [0.0, 0.0, 0.0, 1.0 / largest, 0.0]),
        (needle, [0.0, 0.0, 0.0, 0.0, 1.0 / largest]),
    ]
}

/// The middle of where the limit lies.
fn shifted(coarse: &RestResponse, fine: &RestResponse, normal: Vector2<f64>) -> RestResponse {
    let jacobian = fine.jacobian + (fine.jacobian - coarse.jacobian) * SHIFT;
    let per_depth = fine.target_per_depth + (fine.target_per_depth - coarse.target_per_depth) * SHIFT;
    RestResponse::new(jacobian, per_depth, normal)
}

/// How far the limit of a measure went from one pair of meshes to the next, relative: pairs that agree by accident on two meshes
/// do not on three. What only one of them can control went nowhere that is known.
fn went(from: &RestResponse, to: &RestResponse) -> f64 {
    Some(from.measure_distance(to)).filter(|way| way.is_finite()).unwrap_or(0.0)
}

/// What a pair of meshes says of one controllability measure.
struct Left {
    /// What the limit leaves open, relative.
    open: f64,
    /// How much of the most that the Jacobian's difference can do to the length is to be expected.
    share: f64,
}

/// What a limit leaves open, where `shown` is the share that the pairs before this one have shown.
fn left_open(coarse: &RestResponse, fine: &RestResponse, shown: Option<f64>) -> Left {
    match (coarse.best_direction, fine.best_direction) {
        (Some(before), Some(after)) => {
            let difference = (after.norm() - before.norm()).abs() / after.norm();
            let sideways = (after - before).norm() / after.norm();
            let amplified = amplification(fine) * (fine.jacobian - coarse.jacobian).norm();
            let own = if amplified > 0.0 { (difference / amplified).min(1.0) } else { 0.0 };
            let share = own.max(shown.map_or(UNKNOWN_SHARE, |shown| REMEMBERED * shown));
            Left { open: (OPEN * difference).max(SIDEWAYS * sideways).max(share * amplified), share }
        }
        // Nothing has been shown of the share.
        (None, None) => Left { open: 0.0, share: shown.unwrap_or(UNKNOWN_SHARE) },
        _ => Left { open: f64::INFINITY, share: shown.unwrap_or(UNKNOWN_SHARE) },
    }
}

/// Displacement gradients of every field at the corners of every triangle: they are linear, and the integration points
/// have barycentric coordinates (2/3, 1/6, 1/6).
pub(super) fn corner_gradients(model: &TissueModel, fields: &Fields) -> [Vec<[Matrix2<f64>; 3]>; 5] {
    let rule = model.rule();
    std::array::from_fn(|f| {
        (0..model.cells().len())
            .map(|cell| {
                let at: [Matrix2<f64>; 3] =
                    std::array::from_fn(|k| displacement_gradient(rule, 3 * cell + k, fields.field(f)));
                let third = (at[0] + at[1] + at[2]) / 3.0;
                at.map(|g| g * 2.0 - third)
            })
            .collect()
    })
}

/// Position of integration point q: three per triangle, each near one corner.
fn point_of(model: &TissueModel, q: usize) -> Point2 {
    let corners = model.cells()[q / 3].corners();
    (0..3).fold(Point2::zeros(), |sum, k| sum + corners[k] * if k == q % 3 { 2.0 / 3.0 } else { 1.0 / 6.0 })
}

fn barycentric(corners: &[Point2], x: Point2) -> [f64; 3] {
    let twice = cross(corners[1] - corners[0], corners[2] - corners[0]);
    std::array::from_fn(|k| cross(corners[(k + 1) % 3] - x, corners[(k + 2) % 3] - x) / twice)
}

fn flat(h: &Matrix2<f64>) -> Vector4<f64> {
    Vector4::new(h[(0, 0)], h[(0, 1)], h[(1, 0)], h[(1, 1)])
}

fn tangent_at_rest(tissue: &Tissue, cell: u32) -> Matrix4<f64> {
    tissue.parts(cell).fold(Matrix4::zeros(), |sum, (material, factor)| {
        let a = material.tangent(&Matrix2::zeros());
        sum + Matrix4::from_fn(|k, l| factor * a[k / 2][k % 2][l / 2][l % 2])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Beyond the limit of what controls anything one mesh finds a measure and the other one none; within it none vanishes.
    #[test]
    fn a_paddle_on_the_border_of_controlling_nothing_is_useless() {
        let of = |least: f64, most: f64| {
            RestResponse::new(Matrix2::new(most, 0.0, 0.0, least), Vector2::zeros(), Vector2::y())
        };
        let [here, gone] = [of(1.01e-6, 5e-4), of(0.99e-6, 5e-4)];
        assert!(here.best_direction.is_some() && gone.best_direction.is_none());
        assert!(vanishes(&here, &gone) && vanishes(&gone, &here));
        assert!(!vanishes(&here, &here) && !vanishes(&gone, &gone));
        // What a table can be made of does not vanish for another mesh's sake: that mesh is wrong, and has to be refined.
        assert!(!vanishes(&of(0.1, 0.2), &gone));
    }

    #[test]
    fn the_amplification_is_the_most_that_an_error_of_the_jacobian_can_do() {
        let normal = Vector2::new(0.6, -0.8);
        for jacobian in [Matrix2::new(0.3, 0.1, -0.05, 0.2), Matrix2::new(0.3, 0.1, 0.29, 0.1)] {
            let of = |jacobian: Matrix2<f64>| RestResponse::new(jacobian, Vector2::zeros(), normal);
            let found = of(jacobian);
            let change = |angles: (f64, f64)| {
                let [u, v] = [angles.0, angles.1].map(|a: f64| Vector2::new(a.cos(), a.sin()));
                let step = 1e-8;
                let moved = of(jacobian + u * v.transpose() * step).controllability_measure;
                (moved / found.controllability_measure - 1.0).abs() / step
            };
            let angles = |i: i32| f64::from(i) * std::f64::consts::PI / 180.0;
            let all = (0..180).flat_map(|i| (0..180).map(move |j| (angles(i), angles(j))));
            let most = all.map(change).fold(0.0, f64::max);
            assert!((most / amplification(&found) - 1.0).abs() < 1e-2, "{most} {}", amplification(&found));
        }
    }

    /// The lengths agree and the Jacobians do not: by accident, as the pair before shows.
    #[test]
    fn what_cancels_on_one_pair_is_not_forgotten() {
        let of = |jacobian: Matrix2<f64>| RestResponse::new(jacobian, Vector2::zeros(), Vector2::new(0.6, -0.8));
        let fine = Matrix2::new(0.3, 0.1, 0.29, 0.1);
        // J⁻¹n does not change with what is added to its normal.
        let b = of(fine).best_direction.unwrap();
        let harmless = Vector2::new(1.0, 0.0) * Vector2::new(-b.y, b.x).transpose() * (1e-4 / b.norm());
        let left = |shown: Option<f64>| left_open(&of(fine + harmless), &of(fine), shown);
        let most = amplification(&of(fine)) * harmless.norm();
        for (shown, share) in [(None, UNKNOWN_SHARE), (Some(0.4), 0.2), (Some(0.2), 0.1), (Some(0.0), 0.0)] {
            let left = left(shown);
            assert!((left.share - share).abs() < 1e-9 && (left.open - share * most).abs() < 1e-9, "{shown:?}");
        }
        // Where one of the two cannot control the target, nothing is known, and nothing learnt.
        let singular = of(Matrix2::new(0.3, 0.1, 0.3, 0.1));
        for (shown, share) in [(None, UNKNOWN_SHARE), (Some(0.4), 0.4)] {
            let left = left_open(&singular, &of(fine), shown);
            assert!(left.open.is_infinite() && left.share == share, "{shown:?}: {}", left.share);
        }
        // What this pair shows counts whole.
        let harmful = Matrix2::new(1e-4, 0.0, 0.0, 0.0);
        let shown = left_open(&of(fine + harmful), &of(fine), Some(0.0));
        let change = of(fine + harmful).controllability_measure / of(fine).controllability_measure - 1.0;
        assert!((shown.open - change.abs()).abs() < 1e-9 && shown.share > 0.1, "{} {}", shown.open, shown.share);
    }

    /// The meshes say 4e-3 and 1.7e-3 where the truth is 1.6e-3: by the limit that they tend to, 1e-4, no table could be made of it.
    #[test]
    fn what_a_pair_of_meshes_misjudges_is_not_left_out() {
        let of = |least: f64| RestResponse::new(Matrix2::new(1.0, 0.0, 0.0, least), Vector2::zeros(), Vector2::y());
        let useless = |coarse: f64, fine: f64| {
            let limit = shifted(&of(coarse), &of(fine), Vector2::y());
            is_useless_within(&limit, OPEN * (of(fine).jacobian - of(coarse).jacobian).norm())
        };
        assert!(!useless(4e-3, 1.7e-3) && !useless(1.7e-3, 4e-3));
        assert!(useless(3e-4, 2e-4) && useless(2e-4, 3e-4) && useless(1e-4, -1e-4));
        assert!(!useless(1.1e-3, 1.05e-3) && !useless(0.2, 0.1));
    }

    /// The first answers best and may or may not be one that a table can be made of; the second is the only one that surely is. It
    /// cannot hold the target, but is the best if the first is none.
    #[test]
    fn the_best_that_a_table_can_surely_be_made_of_is_not_unable() {
        let of = |least: f64, most: f64| {
            RestResponse::new(Matrix2::new(least, 0.0, 0.0, most), Vector2::zeros(), Vector2::y())
        };
        let open = |jacobian: f64| Open { measure: 0.1, jacobian, displacement: 0.0 };
        let limit = [of(0.36 / 1400.0, 0.36), of(0.01, 0.02), of(0.01, 0.005)];
        assert!(!is_usable(&limit[0]) && !is_useless_within(&limit[0], 3e-4) && is_usable(&limit[1]));
        let within = [open(3e-4), open(1e-4), open(1e-4)];
        let unable = unable_and_worse(&[false; 3], &[false, true, true], &limit, &within);
        assert_eq!(unable, [false, false, true]);
        // Where the first is one for certain, both others are.
        let sure = [of(0.1, 0.36), limit[1], limit[2]];
        assert_eq!(unable_and_worse(&[false; 3], &[false, true, true], &sure, &within), [false, true, true]);
        // All are hindered: the best of them is asked for.
        assert_eq!(unable_and_worse(&[false; 3], &[true; 3], &sure, &within), [false, true, true]);
    }

    #[test]
    fn the_triangles_parts_sum_to_the_difference_of_the_answers() {
        // Galerkin orthogonality: J(u_f) − J(u_h) = a(u_f − u_h, z_f − z_h), on a scene with an inclusion.
        let mut scene = Scene::bundled("paper-hull").unwrap();
        scene.discretization.method = Method::new(Integration::FemT6);
        let mesh = Triangulation::coarse(&scene.features(), -2).unwrap();
        let (fine, parents) = mesh.refined();
        let pair = Pair { coarse: model_on(&scene, &mesh).unwrap(), fine: model_on(&scene, &fine).unwrap(), parents };
        let mut coarse: Vec<Fields> = Vec::new();
        for_each_paddle(&pair.coarse, Loads::OnTarget, |_, fields| {
            coarse.push(fields.clone());
            Ok(())
        })
        .unwrap();
        let stiffness = pair.stiffness();
        for_each_paddle(&pair.fine, Loads::OnTarget, |paddle, fields| {
            let (before, after) = (response_of(&pair.coarse, &coarse[paddle]), response_of(&pair.fine, fields));
            let errors = pair.errors(&coarse[paddle], fields);
            let rule = pair.fine.rule();
            let product = |u: usize, z: usize| -> f64 {
                let point = |q: usize| {
                    let p = rule.point(q);
                    p.weight * errors[q][u].dot(&(stiffness[p.cell as usize] * errors[q][z]))
                };
                (0..rule.len()).map(point).sum()
            };
            let change = after.jacobian - before.jacobian;
            for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let sum = product(column, 3 + row);
                assert!((sum - change[(row, column)]).abs() < 1e-8, "{paddle}: {sum} {}", change[(row, column)]);
            }
            Ok(())
        })
        .unwrap();
    }
}
