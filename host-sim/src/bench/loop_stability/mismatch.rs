//! A table that was computed for other tissue than it meets: eigenvalues of J·Ĵ⁻¹ along the depth, what they leave of the
//! stability margin, and the simulated loop.

use firmware::contract::{Knot, Table};
use firmware::loop_stability::gain_limit;
use model_offline::model::ModelError;
use model_offline::parallel;
use model_offline::placement::discretise;
use model_offline::scene::Scene;
use model_offline::table::{TableBuildError, TableOptions, build};
use nalgebra::{Complex, Matrix2, Vector2};

use super::behaviour::Behaviour;
use super::cells::simulate;
use model_offline::scene::TissueVariant;

/// One depth of one paddle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mismatch {
    /// Paddle index.
    pub paddle: u32,
    /// Tissue that the table was computed for.
    pub table: TissueVariant,
    /// Tissue that it meets.
    pub tissue: TissueVariant,
    /// Needle depth, length.
    pub depth: f64,
    /// The eigenvalue of J·Ĵ⁻¹ that leaves the smallest margin: size, and angle in degrees.
    pub eigenvalue: (f64, f64),
    /// Largest |λ|.
    pub largest: f64,
    /// nᵀ·J·Ĵ⁻¹·n: what the loop over the orthogonal error alone, which the controller closes, is multiplied by.
    pub orthogonal: f64,
    /// Gain g and delay d of the table.
    pub gain: (f64, u32),
    /// How many times the gain could grow before the loop is unstable, by theory.
    pub margin: f64,
    /// The same found by simulation, to one per cent.
    pub simulated_margin: f64,
    /// What the loop does with the table's gain.
    pub behaviour: Behaviour,
}

/// Eigenvalues of a real 2 × 2 matrix.
pub fn eigenvalues(m: &Matrix2<f64>) -> [Complex<f64>; 2] {
    let half = 0.5 * m.trace();
    let root = Complex::new(half * half - m.determinant(), 0.0).sqrt();
    [half + root, half - root]
}

/// A paddle without a table, and why.
pub type Refused = (u32, TableBuildError);

/// Every paddle of the scene, table and tissue swapped both ways, at every knot that both tables have. A paddle without a
/// table comes with the reason.
///
/// # Errors
/// [`ModelError`] when the tissue cannot be modelled.
pub fn mismatches(scene: &Scene, knots: usize, threads: usize) -> Result<(Vec<Mismatch>, Vec<Refused>), ModelError> {
    let models = [discretise(&scene.without_inclusions())?.0, discretise(scene)?.0];
    let options = TableOptions { knots, ..TableOptions::default() };
    let paddles = &scene.paddles;
    let tables = parallel::map(2 * paddles.len(), threads, |i| build(&models[i % 2], paddles[i / 2].index, &options));
    let (mut rows, mut refused) = (Vec::new(), Vec::new());
    for (paddle, pair) in paddles.iter().zip(tables.chunks(2)) {
        match (&pair[0], &pair[1]) {
            (Ok(plain), Ok(included)) => {
                rows.extend(along_depth([plain, included], [TissueVariant::Homogeneous, TissueVariant::Inclusion]));
                rows.extend(along_depth([included, plain], [TissueVariant::Inclusion, TissueVariant::Homogeneous]));
            }
            (Err(error), _) | (_, Err(error)) => refused.push((paddle.index, error.clone())),
        }
    }
    Ok((rows, refused))
}

fn along_depth<'t>(
    [table, truth]: [&'t Table<f64, 2>; 2],
    names: [TissueVariant; 2],
) -> impl Iterator<Item = Mismatch> + 't {
    table.knots.iter().zip(&truth.knots).map(move |(assumed, real)| compare(table, assumed, real, names))
}

fn compare(table: &Table<f64, 2>, assumed: &Knot<f64, 2>, real: &Knot<f64, 2>, names: [TissueVariant; 2]) -> Mismatch {
    let inverse = assumed.jacobian[0].try_inverse().unwrap_or_else(Matrix2::zeros);
    let product = real.jacobian[0] * inverse;
    let n: Vector2<f64> = table.orthogonal;
    let (gain, delay) = (table.gains.loop_gain, table.gains.delay_samples);
    let margin_of = |l: &Complex<f64>| gain_limit(l.arg(), delay) / (gain * l.norm());
    let [a, b] = eigenvalues(&product);
    let worst = if margin_of(&a) <= margin_of(&b) { a } else { b };
    Mismatch {
        paddle: table.paddles[0].index,
        table: names[0],
        tissue: names[1],
        depth: assumed.depth,
        eigenvalue: (worst.norm(), worst.arg().to_degrees()),
        largest: a.norm().max(b.norm()),
        orthogonal: n.dot(&(product * n)),
        gain: (gain, delay),
        margin: margin_of(&worst),
        simulated_margin: simulated_margin(&real.jacobian[0], &assumed.jacobian[0], gain, delay),
        behaviour: simulate(&real.jacobian[0], &assumed.jacobian[0], gain, delay),
    }
}

/// The factor on the gain at which the simulated loop stops settling, by bisection.
fn simulated_margin(truth: &Matrix2<f64>, table: &Matrix2<f64>, gain: f64, delay: u32) -> f64 {
    let settles = |factor: f64| simulate(truth, table, gain * factor, delay) == Behaviour::Settles;
    let (mut low, mut high) = (1e-2_f64, 1e2_f64);
    if !settles(low) {
        return 0.0;
    }
    while high > 1.005 * low {
        let middle = (low * high).sqrt();
        if settles(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low * high).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvalues_of_known_matrices() {
        let [a, b] = eigenvalues(&Matrix2::new(0.0, -2.0, 2.0, 0.0));
        assert!((a - Complex::new(0.0, 2.0)).norm() < 1e-15 && (b - Complex::new(0.0, -2.0)).norm() < 1e-15);
        let [a, b] = eigenvalues(&Matrix2::new(3.0, 1.0, 0.0, 2.0));
        assert!((a.re - 3.0).abs() < 1e-15 && (b.re - 2.0).abs() < 1e-15);
    }

    #[test]
    fn the_papers_inclusion_leaves_a_margin_and_simulation_finds_the_same() {
        let scene = Scene::bundled("paper").unwrap();
        let (rows, refused) = mismatches(&scene, 3, 2).unwrap();
        assert!(refused.is_empty(), "{refused:?}");
        assert_eq!(rows.len(), 5 * 2 * 3);
        for row in &rows {
            assert_eq!(row.behaviour, Behaviour::Settles, "{row:?}");
            assert!((row.simulated_margin / row.margin - 1.0).abs() < 0.02, "{row:?}");
        }
    }
}
