//! Static condensation: what a few retained unknowns answer to forces on them, all others following.
//!
//! With the retained unknowns S eliminated last, the last block L_S of the Cholesky factor satisfies `L_S L_Sᵀ = K_SS − K_SI
//! K_II⁻¹ K_IS`, and `(K⁻¹)_SS = L_S⁻ᵀ L_S⁻¹`. Whatever is asked of K⁻¹ between retained unknowns then costs dense work on their
//! number alone, however large the body is.

use super::dense::{products_of_columns, solve_lower};
use super::mixed::MixedCholesky;
use faer::Mat;

/// The factor of the retained unknowns of a matrix.
#[derive(Debug, Clone)]
pub struct CondensedFactor {
    factor: Mat<f64>,
    /// Place of every unknown among the retained ones.
    place: Vec<Option<u32>>,
}

/// A sparse functional of the unknowns: (unknown, weight).
pub type Functional = Vec<(u32, f64)>;

impl CondensedFactor {
    /// The last `count` unknowns of a factor whose analysis [retains](super::SymbolicFactor::retaining) them.
    ///
    /// # Panics
    /// When the analysis retains none.
    pub fn new(cholesky: &MixedCholesky, unknowns: usize, count: usize) -> Self {
        let double = cholesky.double().expect("what an analysis retains has double precision");
        let (factor, retained) = double.last(count);
        let mut place = vec![None; unknowns];
        retained.iter().enumerate().for_each(|(k, &u)| place[u as usize] = Some(k as u32));
        Self { factor, place }
    }

    /// `f K⁻¹ g` for all pairs of functionals f, g of the retained unknowns.
    ///
    /// # Panics
    /// When a functional takes an unknown that is not retained.
    pub fn compliance(&self, functionals: &[Functional]) -> Mat<f64> {
        let place = |unknown: u32| self.place[unknown as usize].expect("functionals of retained unknowns") as usize;
        let begins = |f: usize| functionals[f].iter().map(|&(unknown, _)| place(unknown)).min().unwrap_or(0);
        // Forward substitution leaves zeros above where a functional begins: in the order of beginnings that is a triangle, and a
        // third of the work.
        let mut order: Vec<(usize, usize)> = (0..functionals.len()).map(|f| (begins(f), f)).collect();
        order.sort_unstable();
        let first: Vec<usize> = order.iter().map(|&(begin, _)| begin).collect();
        let (mut columns, mut rank) = (Mat::zeros(self.factor.nrows(), order.len()), vec![0; order.len()]);
        for (column, &(_, f)) in order.iter().enumerate() {
            rank[f] = column;
            functionals[f].iter().for_each(|&(unknown, weight)| columns[(place(unknown), column)] += weight);
        }
        // L_S⁻¹ F, a column each, whose products they are.
        solve_lower(self.factor.as_ref(), columns.as_mut(), &first);
        let products = products_of_columns(&columns, &first);
        drop(columns);
        Mat::from_fn(rank.len(), rank.len(), |f, g| products[(rank[f].max(rank[g]), rank[f].min(rank[g]))])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;
    use crate::linalg::{Pattern, SymbolicFactor};

    /// A grid of springs, three unknowns a node: (K⁻¹) between retained nodes by condensation and by whole solves.
    #[test]
    fn what_is_retained_answers_as_in_the_whole() {
        let side = 9_u32;
        let n = (side * side) as usize;
        let positions: Vec<Point<3>> =
            (0..n as u32).map(|i| Point::<3>::new(f64::from(i % side), f64::from(i / side), 0.0)).collect();
        let lists: Vec<Vec<u32>> = (0..n as u32)
            .flat_map(|i| {
                let right = (i % side + 1 < side).then(|| vec![i, i + 1]);
                let up = (i + side < n as u32).then(|| vec![i, i + side]);
                right.into_iter().chain(up)
            })
            .collect();
        let pattern = Pattern::new(3, n, lists.iter().map(Vec::as_slice));
        let mut values = vec![0.0; pattern.entries()];
        for list in &lists {
            for (&i, &j, weight) in [(&list[0], &list[0], 1.0), (&list[1], &list[1], 1.0), (&list[1], &list[0], -1.0)] {
                let (at, stride) = (pattern.block_position(i, j).unwrap(), pattern.column_length(j));
                (0..3).for_each(|k| values[at + k * stride + k] += weight * f64::from(k as u32 + 1));
            }
        }
        (0..3 * n).for_each(|u| values[pattern.diagonal_position(u)] += 0.05);
        let retained = [3, 17, 18, 40, 80];
        let symbolic = SymbolicFactor::retaining(&pattern, &positions, &retained);
        let mut cholesky = MixedCholesky::new(&symbolic).unwrap();
        cholesky.factorise::<3>(&pattern, &values).unwrap();
        let condensed = CondensedFactor::new(&cholesky, 3 * n, 3 * retained.len());
        let functionals: Vec<Functional> =
            vec![vec![(9, 1.0)], vec![(51, 0.5), (54, -2.0)], vec![(121, 1.0), (122, 1.0)], vec![(241, 3.0)]];
        let compliance = condensed.compliance(&functionals);
        for (g, right) in functionals.iter().enumerate() {
            let mut x = vec![0.0; 3 * n];
            right.iter().for_each(|&(u, w)| x[u as usize] += w);
            cholesky.apply(&mut x, 1);
            for (f, left) in functionals.iter().enumerate() {
                let whole: f64 = left.iter().map(|&(u, w)| w * x[u as usize]).sum();
                let condensed = compliance[(f, g)];
                assert!((whole - condensed).abs() < 1e-12, "{f} {g}: {whole} {condensed}");
            }
        }
    }
}
