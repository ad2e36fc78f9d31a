//! Materials of the cells: how a cell that an inclusion covers partly responds.

use crate::discretization::{Integration, NodalCell};
use crate::geometry::{Point2, Polygon, shared_area};
use crate::material::{Law, Material};
use crate::mechanics::Tissue;
use crate::scene::{Inclusion, Scene};

/// Which mean of the moduli stands for a cell of several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mixing {
    /// The area-weighted mean, as the paper's own method takes it. It is the upper bound of Voigt: right for layers pulled
    /// along, and too stiff by up to 38 % of a controllability measure where half a cell is a hundred times stiffer.
    Area,
    /// What surrounds an inclusion governs: the area-weighted mean with what is softer than the body, and with what is
    /// stiffer the power mean `(Σ f μᵖ)^(1/p)`, p = −0.4, between the harmonic mean (Reuss, −1) and the geometric one (0).
    /// Fitted to quadratic triangles over stiffness ratios from 0.02 to 100 and six spacings of `paper` and
    /// `paper-hull`, where harmonic and geometric means leave up to twice the error.
    Surrounding,
}

impl Mixing {
    /// The mean that belongs to an integration rule.
    pub(super) fn of(integration: Integration) -> Self {
        match integration {
            Integration::Dni | Integration::Scni => Self::Area,
            _ => Self::Surrounding,
        }
    }
}

/// The materials of a scene's cells.
pub(super) fn tissue_of(scene: &Scene, cells: &[NodalCell], mixing: Mixing) -> Tissue {
    let mut materials: Vec<Law> = vec![scene.material.clone()];
    let of_inclusion: Vec<u32> = scene
        .inclusions
        .iter()
        .map(|inclusion| match &inclusion.material {
            Some(material) => {
                materials.push(material.clone());
                materials.len() as u32 - 1
            }
            None => 0,
        })
        .collect();
    let shear: Vec<f64> = materials.iter().map(<Law as Material<2>>::rest_shear_modulus).collect();
    let parts: Vec<Vec<(u32, f64)>> = cells
        .iter()
        .map(|cell| {
            let phases: Vec<Phase> = phases(cell, &scene.inclusions)
                .into_iter()
                .map(|(share, members)| Phase {
                    share,
                    // Of inclusions that cover the same the last one counts, as in space.
                    parts: vec![members.last().map_or((0, 1.0), |&i| (of_inclusion[i], scene.inclusions[i].stiffness))],
                })
                .collect();
            mixture(&phases, &shear, mixing)
        })
        .collect();
    Tissue::new(materials, parts)
}

/// A part of a cell that is made of one thing.
pub(super) struct Phase {
    /// Share of the cell's area, or volume.
    pub(super) share: f64,
    /// Materials with the factors on their energies.
    pub(super) parts: Vec<(u32, f64)>,
}

impl Phase {
    fn shear_modulus(&self, shear: &[f64]) -> f64 {
        self.parts.iter().map(|&(m, factor)| shear[m as usize] * factor).sum()
    }
}

/// One evaluation per law: shares of the same material add up, all scaled so that the shear modulus at rest is the mean
/// that was asked for.
pub(super) fn mixture(phases: &[Phase], shear: &[f64], mixing: Mixing) -> Vec<(u32, f64)> {
    let scale = match (mixing, phases.len()) {
        (Mixing::Surrounding, 2..) => mean_over_area(phases, shear),
        _ => 1.0,
    };
    let mut merged: Vec<(u32, f64)> = Vec::new();
    for phase in phases {
        for &(material, factor) in &phase.parts {
            let factor = phase.share * factor;
            match merged.iter_mut().find(|m| m.0 == material) {
                Some(m) => m.1 += factor,
                None => merged.push((material, factor)),
            }
        }
    }
    merged.retain(|m| m.1 > 0.0);
    if scale != 1.0 {
        merged.iter_mut().for_each(|m| m.1 *= scale);
    }
    merged
}

/// The mean of the moduli over the area-weighted one; see [`Mixing::Surrounding`].
fn mean_over_area(phases: &[Phase], shear: &[f64]) -> f64 {
    let moduli: Vec<(f64, f64)> = phases.iter().map(|p| (p.share, p.shear_modulus(shear))).collect();
    let area: f64 = moduli.iter().map(|(share, mu)| share * mu).sum();
    let (stiff, soft): (Vec<_>, Vec<_>) = moduli.into_iter().partition(|(_, mu)| *mu > shear[0]);
    let soft_share: f64 = soft.iter().map(|(share, _)| share).sum();
    let soft_mean = soft.iter().map(|(share, mu)| share * mu).sum::<f64>() / soft_share;
    let surrounding = if soft_share > 0.0 { soft_share * soft_mean.powf(STIFF) } else { 0.0 };
    let sum: f64 = surrounding + stiff.iter().map(|(share, mu)| share * mu.powf(STIFF)).sum::<f64>();
    sum.powf(1.0 / STIFF) / area
}

/// Exponent of the power mean with stiffer parts.
const STIFF: f64 = -0.4;

/// The parts of a cell by the inclusions that cover them, with their shares of its area; the body alone first.
fn phases(cell: &NodalCell, inclusions: &[Inclusion]) -> Vec<(f64, Vec<usize>)> {
    let corners = cell.corners();
    let touching: Vec<(usize, f64)> = inclusions
        .iter()
        .enumerate()
        .map(|(i, inclusion)| (i, covered_share(&[&inclusion.outline], &corners, cell.area)))
        .filter(|(_, share)| *share > 0.0)
        .collect();
    match touching[..] {
        [] => vec![(1.0, Vec::new())],
        [(i, share)] if share < 1.0 => vec![(1.0 - share, Vec::new()), (share, vec![i])],
        [(i, share)] => vec![(share, vec![i])],
        _ => overlapping_phases(&touching.iter().map(|t| t.0).collect::<Vec<_>>(), &corners, cell.area, inclusions),
    }
}

/// Inclusions that meet in one cell at most: what 2ⁿ subsets can be told apart in no time.
const MOST_IN_A_CELL: usize = 8;

/// The same where several inclusions meet: the share of every subset that covers something together, by inclusion and
/// exclusion.
fn overlapping_phases(
    touching: &[usize],
    corners: &[Point2],
    area: f64,
    inclusions: &[Inclusion],
) -> Vec<(f64, Vec<usize>)> {
    // The last ones count where they overlap.
    let touching = &touching[touching.len().saturating_sub(MOST_IN_A_CELL)..];
    let members = |set: usize| touching.iter().enumerate().filter(move |(k, _)| set >> k & 1 == 1).map(|(_, &i)| i);
    let sets = 1_usize << touching.len();
    // Share covered by all members of a set, whatever else covers it.
    let mut share: Vec<f64> = (0..sets)
        .map(|set| {
            let outlines: Vec<&Polygon> = members(set).map(|i| &inclusions[i].outline).collect();
            if outlines.is_empty() { 1.0 } else { covered_share(&outlines, corners, area) }
        })
        .collect();
    // Less what others cover too: a Möbius transform over the supersets.
    for k in 0..touching.len() {
        for set in 0..sets {
            if set >> k & 1 == 0 {
                share[set] -= share[set | 1 << k];
            }
        }
    }
    let phases = (0..sets).filter(|&set| share[set] > NEGLIGIBLE);
    phases.map(|set| (share[set], members(set).collect())).collect()
}

/// Shares below this are rounding.
const NEGLIGIBLE: f64 = 1e-9;

/// Share of a cell that all of some regions cover. Within rounding of nothing or all it is exactly that, so that a lattice
/// cell inside an inclusion has the inclusion's stiffness and no other.
fn covered_share(regions: &[&Polygon], corners: &[Point2], area: f64) -> f64 {
    let share = shared_area(regions, corners) / area;
    if share < NEGLIGIBLE {
        0.0
    } else if share > 1.0 - NEGLIGIBLE {
        1.0
    } else {
        share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell() -> NodalCell {
        let boundary = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let across = crate::discretization::cells::nodal_cells::Across::Outline(u32::MAX);
        NodalCell { boundary: boundary.map(|c| (Point2::from(c), across)).to_vec(), area: 1.0 }
    }

    fn inclusion(low: [f64; 2], high: [f64; 2], stiffness: f64) -> Inclusion {
        let corners = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]];
        let outline = Polygon::new(corners.map(Point2::from).to_vec()).unwrap();
        Inclusion { outline, stiffness, material: None, resistance: None }
    }

    fn factor(inclusions: Vec<Inclusion>, mixing: Mixing) -> f64 {
        let scene = Scene { inclusions, ..Scene::bundled("paper").unwrap() };
        tissue_of(&scene, &[cell()], mixing).parts(0).map(|p| p.1).sum()
    }

    #[test]
    fn a_cell_half_covered_has_the_mean_that_was_asked_for() {
        let half = |stiffness| vec![inclusion([-1.0, -1.0], [0.5, 2.0], stiffness)];
        for (stiffness, mixing, expected) in [
            (100.0, Mixing::Area, 50.5),
            (100.0, Mixing::Surrounding, (0.5 + 0.5 * 100.0_f64.powf(-0.4)).powf(-2.5)),
            (0.04, Mixing::Area, 0.52),
            (0.04, Mixing::Surrounding, 0.52),
        ] {
            let found = factor(half(stiffness), mixing);
            assert!((found - expected).abs() < 1e-12 * expected, "{stiffness} {mixing:?}: {found}");
        }
        // Covered whole, every mean is the inclusion.
        for mixing in [Mixing::Area, Mixing::Surrounding] {
            assert_eq!(factor(vec![inclusion([-1.0, -1.0], [2.0, 2.0], 7.0)], mixing), 7.0);
        }
    }

    #[test]
    fn what_two_inclusions_cover_together_is_taken_from_the_body_once() {
        // 0.25 body alone, 0.25 each inclusion alone, 0.25 both, of which the last one counts.
        let crossing = || vec![inclusion([0.5, -1.0], [2.0, 2.0], 3.0), inclusion([-1.0, 0.5], [2.0, 2.0], 8.0)];
        assert!((factor(crossing(), Mixing::Area) - 0.25 * (1.0 + 3.0 + 8.0 + 8.0)).abs() < 1e-12);
        let sum = 0.25 * [1.0, 3.0, 8.0, 8.0_f64].iter().map(|mu| mu.powf(-0.4)).sum::<f64>();
        assert!((factor(crossing(), Mixing::Surrounding) - sum.powf(-2.5)).abs() < 1e-12);
        // The same region twice, over half of the cell.
        let twice = vec![inclusion([-1.0, -1.0], [0.5, 2.0], 3.0), inclusion([-1.0, -1.0], [0.5, 2.0], 8.0)];
        assert!((factor(twice, Mixing::Area) - (0.5 + 0.5 * 8.0)).abs() < 1e-12);
    }
}
