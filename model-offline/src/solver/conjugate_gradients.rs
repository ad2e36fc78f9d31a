//! Conjugate gradients for a symmetric matrix that is positive definite unless a body loses stability, preconditioned by
//! the factor of one that is near it.

/// Why conjugate gradients gave up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Breakdown {
    /// A direction along which the matrix is not positive: it is not positive definite.
    NegativeCurvature,
    /// The preconditioner is too far from the matrix to pay.
    Slow,
}

/// When to stop: at an error, estimated in the norm of the preconditioner, or after so many iterations.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stop {
    pub goal: f64,
    pub iterations: u32,
}

/// Improves `x` until its error is within the goal; `residual` is that of `x` and becomes that of the result. Returns the
/// number of iterations.
///
/// # Errors
/// [`Breakdown`]; `x` is then no solution.
pub(super) fn conjugate_gradients(
    mut multiply: impl FnMut(&[f64], &mut [f64]),
    mut precondition: impl FnMut(&mut [f64]),
    residual: &mut [f64],
    x: &mut [f64],
    stop: Stop,
) -> Result<u32, Breakdown> {
    let mut z = residual.to_vec();
    precondition(&mut z);
    let (mut direction, mut image) = (z.clone(), vec![0.0; x.len()]);
    let mut error = dot(residual, &z);
    for iteration in 0..=stop.iterations {
        // A preconditioner of few digits can leave what no symmetric one does.
        if error.is_nan() || error < 0.0 {
            return Err(Breakdown::Slow);
        }
        if error.sqrt() <= stop.goal {
            return Ok(iteration);
        }
        multiply(&direction, &mut image);
        let curvature = dot(&direction, &image);
        if curvature.is_nan() || curvature <= 0.0 {
            return Err(Breakdown::NegativeCurvature);
        }
        let length = error / curvature;
        for (((x, d), r), i) in x.iter_mut().zip(&direction).zip(residual.iter_mut()).zip(&image) {
            *x += length * d;
            *r -= length * i;
        }
        z.copy_from_slice(residual);
        precondition(&mut z);
        let before = std::mem::replace(&mut error, dot(residual, &z));
        for (d, z) in direction.iter_mut().zip(&z) {
            *d = z + error / before * *d;
        }
    }
    Err(Breakdown::Slow)
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five-point Laplacian of a row plus `shift` on the diagonal.
    fn chain(shift: f64) -> impl Fn(&[f64], &mut [f64]) {
        move |x, out| {
            let at = |k: usize| x.get(k).copied().unwrap_or(0.0);
            for (k, out) in out.iter_mut().enumerate() {
                *out = (2.0 + shift) * x[k] - at(k + 1) - if k > 0 { at(k - 1) } else { 0.0 };
            }
        }
    }

    #[test]
    fn as_many_iterations_as_unknowns_solve_exactly_and_negative_curvature_is_seen() {
        let n = 30;
        let exact: Vec<f64> = (0..n).map(|k| f64::from(k * k % 7) - 3.0).collect();
        let (mut right, mut x) = (vec![0.0; n as usize], vec![0.0; n as usize]);
        chain(0.0)(&exact, &mut right);
        let stop = Stop { goal: 1e-12, iterations: n as u32 };
        conjugate_gradients(chain(0.0), |_| {}, &mut right.clone(), &mut x, stop).unwrap();
        assert!(x.iter().zip(&exact).all(|(x, e)| (x - e).abs() < 1e-9), "{x:?}");
        // The smallest eigenvalue of the row is 4 sin²(π/62) = 0.0103: a little below, and more than one below.
        for shift in [-0.011, -0.05] {
            let outcome = conjugate_gradients(chain(shift), |_| {}, &mut right.clone(), &mut [0.0; 30], stop);
            assert_eq!(outcome, Err(Breakdown::NegativeCurvature), "{shift}");
        }
        let short = Stop { iterations: 3, ..stop };
        let outcome = conjugate_gradients(chain(0.0), |_| {}, &mut right.clone(), &mut [0.0; 30], short);
        assert_eq!(outcome, Err(Breakdown::Slow));
    }
}
