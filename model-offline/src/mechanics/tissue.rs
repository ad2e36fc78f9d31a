//! What a body is made of, cell by cell.

use crate::material::{Law, Material};

/// The materials of a tissue, and how much of each every cell contains.
#[derive(Debug, Clone)]
pub struct Tissue {
    materials: Vec<Law>,
    /// Shear moduli of the materials at rest.
    shear_moduli: Vec<f64>,
    /// Per cell: range into `parts`.
    offsets: Vec<u32>,
    /// (material, factor on its energy).
    parts: Vec<(u32, f64)>,
}

impl Tissue {
    /// A tissue of one material in every cell.
    pub fn uniform(material: Law, cells: usize) -> Self {
        Self::new(vec![material], (0..cells).map(|_| vec![(0, 1.0)]))
    }

    /// A tissue from the parts of every cell: (index into `materials`, factor on the energy).
    pub fn new(materials: Vec<Law>, cells: impl IntoIterator<Item = Vec<(u32, f64)>>) -> Self {
        let (mut offsets, mut parts) = (vec![0], Vec::new());
        for cell in cells {
            parts.extend(cell);
            offsets.push(parts.len() as u32);
        }
        let shear_moduli = materials.iter().map(<Law as Material<2>>::rest_shear_modulus).collect();
        Self { materials, shear_moduli, offsets, parts }
    }

    /// Shear modulus μ₀ of a cell at rest, stress units.
    #[inline]
    pub fn rest_shear_modulus(&self, cell: u32) -> f64 {
        let range = self.offsets[cell as usize] as usize..self.offsets[cell as usize + 1] as usize;
        self.parts[range].iter().map(|&(m, factor)| self.shear_moduli[m as usize] * factor).sum()
    }

    /// The materials and energy factors of a cell.
    #[inline]
    pub fn parts(&self, cell: u32) -> impl Iterator<Item = (&Law, f64)> + '_ {
        let range = self.offsets[cell as usize] as usize..self.offsets[cell as usize + 1] as usize;
        self.parts[range].iter().map(|&(m, factor)| (&self.materials[m as usize], factor))
    }

    /// The materials.
    pub fn laws(&self) -> &[Law] {
        &self.materials
    }

    /// Which materials a cell has, with the factors on their energies.
    pub(super) fn shares(&self, cell: u32) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.offsets[cell as usize] as usize..self.offsets[cell as usize + 1] as usize;
        self.parts[range].iter().map(|&(m, factor)| (m as usize, factor))
    }

    /// The same tissue with the energy of every material scaled.
    #[must_use]
    pub(super) fn scaled(&self, factor: impl Fn(usize) -> f64) -> Self {
        let parts = self.parts.iter().map(|&(m, of_energy)| (m, of_energy * factor(m as usize))).collect();
        Self { parts, ..self.clone() }
    }

    /// Whether stress relaxes anywhere.
    pub fn relaxes(&self) -> bool {
        self.materials.iter().any(|law| law.relaxation().is_some())
    }

    /// Whether every material is linear, so that one tangent serves every state.
    pub fn is_linear(&self) -> bool {
        self.materials.iter().all(Law::is_linear)
    }

    /// The same tissue with every law replaced by its small-strain limit.
    #[must_use]
    pub fn linearised(&self) -> Self {
        Self { materials: self.materials.iter().map(Law::linearised).collect(), ..self.clone() }
    }
}
