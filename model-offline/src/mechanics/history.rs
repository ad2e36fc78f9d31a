//! What the past has left in tissue whose stress relaxes.
//!
//! With `S = G ∗ Ṡ_e` and an elastic stress that changes linearly within a step, the stress at its end is
//! `S = γ S_e(E) + R`: the law with its moduli scaled by a factor of the step's length, and a stress R that the past has left
//! and that does not depend on the strain (Simo & Hughes, Computational Inelasticity, 1998, section 10.3). A step is therefore an
//! equilibrium like any other, of the energy `γ W + R : E`: line search and Cholesky factors mean what they always do.

use super::stabilisation::Stabilisation;
use super::tissue::Tissue;
use crate::discretization::Quadrature;
use crate::material::{Law, Material, Matrix};

/// Stress that is there whatever the strain is, already weighted with the points' volumes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Prestress<const D: usize> {
    /// Per integration point; empty for none.
    points: Vec<Carried<D>>,
    /// Force of the stabilisation, D numbers per node; empty for none.
    nodal: Vec<f64>,
}

/// What an integration point carries.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Carried<const D: usize> {
    /// Second Piola–Kirchhoff stress, which turns with the tissue.
    pk2: Matrix<D>,
    /// Stress of linear laws, which do not know that it turns.
    linear: Matrix<D>,
}

impl<const D: usize> Prestress<D> {
    /// Adds energy and first Piola–Kirchhoff stress at a point.
    #[inline]
    pub(super) fn add_stress(&self, point: usize, h: &Matrix<D>, energy: &mut f64, pk1: &mut Matrix<D>) {
        let Some(Carried { pk2, linear }) = self.points.get(point) else { return };
        *energy += linear.dot(h) + pk2.dot(&crate::material::green_lagrange(h));
        *pk1 += linear + (Matrix::<D>::identity() + h) * pk2;
    }

    /// Second Piola–Kirchhoff stress of a point: what it adds to the tangent, δ_ik S_JL.
    #[inline]
    pub(super) fn geometric(&self, point: usize) -> Option<&Matrix<D>> {
        self.points.get(point).map(|carried| &carried.pk2)
    }

    /// Adds the stabilisation's force; returns its energy.
    pub(super) fn add_nodal(&self, coefficients: &[f64], force: &mut [f64]) -> f64 {
        force.iter_mut().zip(&self.nodal).for_each(|(f, carried)| *f += carried);
        self.nodal.iter().zip(coefficients).map(|(carried, d)| carried * d).sum()
    }
}

/// The history of a body, of which some materials relax.
#[derive(Debug, Clone)]
pub struct History<const D: usize> {
    /// The tissue of a fast deformation.
    tissue: Tissue,
    /// The stabilisation of what does not relax.
    elastic: Stabilisation,
    relaxing: Vec<RelaxingMaterial<D>>,
}

/// The history of one material.
#[derive(Debug, Clone)]
struct RelaxingMaterial<const D: usize> {
    material: usize,
    law: Law,
    /// Integration points that contain it, and how much of it, as a volume.
    points: Vec<(u32, f64)>,
    /// Per point: elastic stress at the end of the last step.
    elastic: Vec<Matrix<D>>,
    /// Per term, then per point: what is left of changes of the elastic stress.
    left: Vec<Vec<Matrix<D>>>,
    /// The same of the stabilisation's force, where there is one.
    stabilisation: Stabilisation,
    elastic_force: Vec<f64>,
    left_force: Vec<Vec<f64>>,
}

/// What a step of time makes of a body.
#[derive(Debug, Clone)]
pub struct StepTissue<const D: usize> {
    /// The tissue, its moduli those of the step.
    pub tissue: Tissue,
    /// Its stabilisation.
    pub stabilisation: Stabilisation,
}

impl<const D: usize> History<D> {
    /// That of a body at rest; none where nothing relaxes. `stabilised` is the rule's stabilisation on a tissue.
    pub fn at_rest(
        rule: &Quadrature<D>,
        tissue: &Tissue,
        stabilised: impl Fn(&Tissue) -> Stabilisation,
        unknowns: usize,
    ) -> Option<Self> {
        let relaxing: Vec<_> = tissue
            .laws()
            .iter()
            .enumerate()
            .filter_map(|(material, law)| {
                let terms = law.relaxation()?.len();
                let of_material = |(q, cell): (usize, u32)| {
                    let share: f64 =
                        tissue.shares(cell).filter(|(m, _)| *m == material).map(|(_, factor)| factor).sum();
                    (share > 0.0).then(|| (q as u32, rule.point(q).weight * share))
                };
                let points: Vec<_> = (0..rule.len()).map(|q| (q, rule.point(q).cell)).filter_map(of_material).collect();
                let stabilisation = stabilised(&tissue.scaled(|m| if m == material { 1.0 } else { 0.0 }));
                let forces = if stabilisation.acts() { unknowns } else { 0 };
                Some(RelaxingMaterial {
                    material,
                    law: law.clone(),
                    elastic: vec![Matrix::zeros(); points.len()],
                    left: vec![vec![Matrix::zeros(); points.len()]; terms],
                    points,
                    stabilisation,
                    elastic_force: vec![0.0; forces],
                    left_force: vec![vec![0.0; forces]; terms],
                })
            })
            .collect();
        if relaxing.is_empty() {
            return None;
        }
        let elastic = stabilised(&tissue.scaled(|m| if tissue.laws()[m].relaxation().is_some() { 0.0 } else { 1.0 }));
        Some(Self { tissue: tissue.clone(), elastic, relaxing })
    }

    /// The tissue and its stabilisation within a step of so many seconds.
    pub fn within(&self, elapsed: f64) -> StepTissue<D> {
        let stiffness = |m: usize| self.tissue.laws()[m].relaxation().map_or(1.0, |r| r.stiffness(elapsed));
        let mut stabilisation = self.elastic.clone();
        for of in &self.relaxing {
            stabilisation.add_scaled(&of.stabilisation, stiffness(of.material));
        }
        StepTissue { tissue: self.tissue.scaled(stiffness), stabilisation }
    }

    /// What the past leaves at the end of a step of so many seconds.
    pub fn prestress(&self, rule: &Quadrature<D>, elapsed: f64) -> Prestress<D> {
        let mut points = vec![Carried { pk2: Matrix::zeros(), linear: Matrix::zeros() }; rule.len()];
        let mut nodal: Vec<f64> = Vec::new();
        for of in &self.relaxing {
            let Some(relaxation) = of.law.relaxation() else { continue };
            let linear = of.law.is_linear();
            nodal.resize(nodal.len().max(of.elastic_force.len()), 0.0);
            for (decay, (left, left_force)) in relaxation.decays(elapsed).zip(of.left.iter().zip(&of.left_force)) {
                for ((left, elastic), &(q, volume)) in left.iter().zip(&of.elastic).zip(&of.points) {
                    let carried = (left * decay.kept - elastic * decay.gained) * volume;
                    let point = &mut points[q as usize];
                    *(if linear { &mut point.linear } else { &mut point.pk2 }) += carried;
                }
                for ((sum, left), elastic) in nodal.iter_mut().zip(left_force).zip(&of.elastic_force) {
                    *sum += left * decay.kept - elastic * decay.gained;
                }
            }
        }
        Prestress { points, nodal }
    }

    /// Remembers the end of a step of so many seconds, by the displacement gradients of all integration points and the
    /// coefficients.
    pub fn remember(&mut self, elapsed: f64, gradients: &[Matrix<D>], coefficients: &[f64]) {
        for of in &mut self.relaxing {
            let Some(relaxation) = of.law.relaxation() else { continue };
            let law = &of.law;
            let stress = |q: u32| {
                let h = &gradients[q as usize];
                if law.is_linear() { law.respond(h).pk1_stress } else { law.pk2_stress(h) }
            };
            let elastic: Vec<Matrix<D>> = of.points.iter().map(|&(q, _)| stress(q)).collect();
            let mut force = vec![0.0; of.elastic_force.len()];
            if !force.is_empty() {
                of.stabilisation.add_force::<D>(coefficients, &mut force);
            }
            for (decay, (left, left_force)) in
                relaxation.decays(elapsed).zip(of.left.iter_mut().zip(&mut of.left_force))
            {
                for ((left, now), before) in left.iter_mut().zip(&elastic).zip(&of.elastic) {
                    *left = *left * decay.kept + (now - before) * decay.gained;
                }
                for ((left, now), before) in left_force.iter_mut().zip(&force).zip(&of.elastic_force) {
                    *left = *left * decay.kept + (now - before) * decay.gained;
                }
            }
            (of.elastic, of.elastic_force) = (elastic, force);
        }
    }
}
