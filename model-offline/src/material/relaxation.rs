//! Stress relaxation: what is left of a stress some time after the strain that caused it.

use super::error::{MaterialError, finite};
use serde::Serialize;

/// A Prony series `G(t) = 1 − Σ g (1 − e^(−t/τ))`, the same factor on all moduli of a material (quasi-linear viscoelasticity;
/// Fung, Biomechanics, 1993, section 7.6): the second Piola–Kirchhoff stress is `S(t) = ∫ G(t − s) dS_e(s)`, S_e that of the
/// law, whose moduli are those of a fast deformation.
///
/// # Example
/// ```
/// use model_offline::material::Relaxation;
///
/// // In vivo breast: about half of the stiffness is gone in the end, most of it within seconds.
/// let relaxation = Relaxation::new([(0.3, 3.2), (0.2, 42.0)])?;
/// assert_eq!(relaxation.remaining(0.0), 1.0);
/// assert!((relaxation.remaining(1e4) - 0.5).abs() < 1e-12);
/// # Ok::<(), model_offline::material::MaterialError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Relaxation {
    terms: Vec<Term>,
}

/// A share of the stress that decays with a time of its own.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Term {
    /// g, of the stress at once.
    share: f64,
    /// τ, seconds.
    time: f64,
}

/// What a step of time does to a term, where the elastic stress changes linearly in it (Taylor, Pister & Goudreau,
/// International Journal for Numerical Methods in Engineering 2, 1970).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Decay {
    /// What is left of the old stress: e^(−Δt/τ).
    pub(crate) kept: f64,
    /// What is left of a change in the step, over the change of the elastic stress: g φ, φ = (1 − e^(−Δt/τ)) τ/Δt.
    pub(crate) gained: f64,
}

impl Relaxation {
    /// The series of these shares g and times τ (seconds).
    ///
    /// # Errors
    /// Shares or times that are not positive, or shares that leave nothing in the end: that is a fluid.
    pub fn new(terms: impl IntoIterator<Item = (f64, f64)>) -> Result<Self, MaterialError> {
        let positive = |value: f64, name| match finite(value, name)? {
            value if value > 0.0 => Ok(value),
            _ => Err(MaterialError::NotPositive(name)),
        };
        let term = |(share, time)| {
            Ok(Term { share: positive(share, "a share g")?, time: positive(time, "a relaxation time tau")? })
        };
        let terms: Vec<Term> = terms.into_iter().map(term).collect::<Result<_, _>>()?;
        let relaxed: f64 = terms.iter().map(|term| term.share).sum();
        if terms.is_empty() {
            return Err(MaterialError::Missing("a term of the relaxation"));
        }
        if relaxed >= 1.0 {
            return Err(MaterialError::Fluid(relaxed));
        }
        Ok(Self { terms })
    }

    /// G(t): what is left of a stress after `time` seconds under the same strain.
    pub fn remaining(&self, time: f64) -> f64 {
        1.0 + self.terms.iter().map(|term| term.share * (-time / term.time).exp_m1()).sum::<f64>()
    }

    /// What a step of so many seconds does, term by term.
    pub(crate) fn decays(&self, elapsed: f64) -> impl Iterator<Item = Decay> + '_ {
        self.terms.iter().map(move |term| {
            let x = elapsed / term.time;
            let mean = if x > 0.0 { -(-x).exp_m1() / x } else { 1.0 };
            Decay { kept: (-x).exp(), gained: term.share * mean }
        })
    }

    /// Moduli within a step, over those of a fast deformation: `1 − Σ g (1 − φ)`.
    pub(crate) fn stiffness(&self, elapsed: f64) -> f64 {
        let shares: f64 = self.terms.iter().map(|term| term.share).sum();
        1.0 - shares + self.decays(elapsed).map(|decay| decay.gained).sum::<f64>()
    }

    /// Number of terms.
    pub(crate) fn len(&self) -> usize {
        self.terms.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_then_rest_is_the_series_whatever_the_steps() {
        let relaxation = Relaxation::new([(0.3, 3.2), (0.2, 42.0)]).unwrap();
        for steps in [vec![10.0], vec![1.0; 10], vec![0.5, 7.0, 2.5]] {
            // A unit of elastic stress at once, then none.
            let mut held: Vec<f64> = relaxation.decays(0.0).map(|decay| decay.gained).collect();
            for step in steps {
                held.iter_mut().zip(relaxation.decays(step)).for_each(|(held, decay)| *held *= decay.kept);
            }
            let stress = 0.5 + held.iter().sum::<f64>();
            assert!((stress - relaxation.remaining(10.0)).abs() < 1e-14);
        }
        assert!((relaxation.stiffness(0.0) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_ramp_of_strain_is_the_integral_of_the_series() {
        // ∫ G over the ramp's time, for a rate of one: in closed form and by one step.
        let (g, tau, time) = (0.4_f64, 2.0_f64, 5.0_f64);
        let relaxation = Relaxation::new([(g, tau)]).unwrap();
        let integral: f64 = (1.0 - g) * time + g * tau * (1.0 - (-time / tau).exp());
        assert!((relaxation.stiffness(time) * time - integral).abs() < 1e-14);
    }

    #[test]
    fn what_is_no_relaxation_is_refused() {
        for terms in [vec![], vec![(0.0, 1.0)], vec![(-0.1, 1.0)], vec![(0.1, 0.0)], vec![(0.6, 1.0), (0.4, 2.0)]] {
            assert!(Relaxation::new(terms.clone()).is_err(), "{terms:?}");
        }
        assert!(Relaxation::new([(f64::NAN, 1.0)]).is_err() && Relaxation::new([(0.1, f64::INFINITY)]).is_err());
    }
}
