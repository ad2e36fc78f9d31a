//! What the literature knows of materials that scene files can name.

use super::lame::{LameParameters, lambda};
use crate::choice::choice;

choice! {
    /// A material by name, with numbers of the literature; `model-offline materials` lists them with their sources.
    pub enum Preset {
        /// Fat of the breast, outside the body.
        BreastFat,
        /// Glandular tissue of the breast, which creeps.
        BreastGland,
        /// Prostate without a tumour, outside the body.
        Prostate,
        /// Liver of the healthy, which creeps.
        Liver,
        /// Skin of rabbits by Fung's exponential law: the material of the paper.
        SkinRabbit,
        /// Gelatine, 5 % by weight: a phantom.
        #[serde(rename = "gelatine-5")]
        #[strum(serialize = "gelatine-5")]
        #[value(name = "gelatine-5")]
        Gelatine5,
    }
}

/// Poisson's ratio where a source gives one modulus alone. Soft tissue gives way in volume hardly at all within seconds; this is
/// how near to that plane strain is taken here.
const POISSON: f64 = 0.45;

/// What a source measured; stresses in kPa.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Measured {
    /// Young's modulus.
    Young(f64),
    /// The shear modulus.
    Shear(f64),
    /// All of Fung's law.
    Fung(FungModuli),
}

/// The moduli of Fung's law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FungModuli {
    /// λ and μ beside the exponential term, kPa.
    pub(super) linear: LameParameters,
    /// c, kPa.
    pub(super) c: f64,
    /// λ and μ of the exponent, dimensionless.
    pub(super) exponent: LameParameters,
}

/// The paper's Table I, summed over a symmetric strain, in Pa read as such.
const RABBIT: FungModuli = FungModuli {
    linear: LameParameters { lambda: 0.383, mu: 0.3185 },
    c: 0.779e-3,
    exponent: LameParameters { lambda: 1.5, mu: 1.0 },
};

// Two creep times whose shares are each half of the elastic strain, as relaxation: G is 1/(s² J) in Laplace space, so its times
// are the zeros of s J. Times of relaxation are shorter than those of creep.
/// Creep within 3.2 and 42 s.
const GLAND: [(f64, f64); 2] = [(0.345, 2.114), (0.155, 31.79)];
/// Creep within 1.86 and 51.3 s.
const LIVER: [(f64, f64); 2] = [(0.339, 1.235), (0.161, 38.64)];

impl Preset {
    fn measured(self) -> Measured {
        match self {
            Self::BreastFat => Measured::Young(3.25),
            Self::BreastGland => Measured::Young(3.24),
            Self::Prostate => Measured::Young(17.0),
            Self::Liver => Measured::Shear(2.0),
            Self::SkinRabbit => Measured::Fung(RABBIT),
            Self::Gelatine5 => Measured::Shear(4.18),
        }
    }

    /// Shares and times (seconds) of its relaxation; none where the literature has no series.
    pub(super) fn relaxation(self) -> &'static [(f64, f64)] {
        match self {
            Self::BreastGland => &GLAND,
            Self::Liver => &LIVER,
            Self::BreastFat | Self::Prostate | Self::SkinRabbit | Self::Gelatine5 => &[],
        }
    }

    /// λ and μ at small strain, kPa.
    pub(super) fn at_rest(self) -> LameParameters {
        let of_shear = |mu: f64| LameParameters { lambda: lambda(mu, POISSON), mu };
        match self.measured() {
            Measured::Young(young) => of_shear(young / (2.0 * (1.0 + POISSON))),
            Measured::Shear(mu) => of_shear(mu),
            Measured::Fung(FungModuli { linear, c, exponent }) => {
                LameParameters { lambda: linear.lambda + c * exponent.lambda, mu: linear.mu + c * exponent.mu }
            }
        }
    }

    /// The moduli of Fung's law, where it is that.
    pub(super) fn fung(self) -> Option<FungModuli> {
        match self.measured() {
            Measured::Fung(moduli) => Some(moduli),
            Measured::Young(_) | Measured::Shear(_) => None,
        }
    }

    /// Who measured what.
    pub fn source(self) -> &'static str {
        match self {
            Self::BreastFat => {
                "Samani, Zubovits & Plewes, Physics in Medicine and Biology 52, 2007: Young's modulus 3.25 kPa, ex vivo"
            }
            Self::BreastGland => {
                "Samani, Zubovits & Plewes, Physics in Medicine and Biology 52, 2007: Young's modulus 3.24 kPa, ex vivo; Sridhar & \
                 Insana, Medical Physics 34, 2007: creep within 3.2 and 42 s in vivo, as much as the elastic strain"
            }
            Self::Prostate => {
                "Ahn et al., Urology 76, 2010: Young's modulus 17.0 ± 9.0 kPa where there is no cancer, ex vivo"
            }
            Self::Liver => {
                "Rouvière et al., Radiology 240, 2006: shear modulus 2.0 ± 0.3 kPa of the healthy, in vivo; Kerdok, Ottensmeyer & \
                 Howe, Journal of Biomechanics 39, 2006: creep within 1.86 and 51.3 s, porcine"
            }
            Self::SkinRabbit => {
                "the paper's Table I, and c = 0.779 from Tong & Fung, Journal of Biomechanics 9, 1976: rabbit skin"
            }
            Self::Gelatine5 => {
                "Nguyen, Zhou, Robert, Shamdasani & Xie, Ultrasound in Medicine & Biology 40, 2014: shear modulus 4.18 ± 0.84 kPa \
                 without oil"
            }
        }
    }

    /// What of it is a judgement, and no measurement.
    pub fn judgement(self) -> &'static str {
        match self {
            Self::BreastFat => {
                "neo-Hookean with Poisson's ratio 0.45; Samani's mean is as others quote it; aspiration in vivo found \
                 3.0 ± 1.2 kPa, others several times as much under more strain; no relaxation"
            }
            Self::BreastGland => {
                "neo-Hookean with Poisson's ratio 0.45; Samani's mean is as others quote it, and taken as that of a fast \
                 deformation; the two creep times take equal shares"
            }
            Self::Prostate => {
                "neo-Hookean with Poisson's ratio 0.45; others found 25 kPa in vivo, and several times as much under compression; no \
                 relaxation: it is known as a fractional law, not as a series"
            }
            Self::Liver => {
                "neo-Hookean with Poisson's ratio 0.45; a modulus of shear waves is taken as that of a fast deformation; that creep \
                 is as much as the elastic strain, in equal shares, is an order of magnitude, as in the breast"
            }
            Self::SkinRabbit => {
                "the paper names no unit: pascals are an order of magnitude; Poisson's ratio is that of its table, and belongs to skin \
                 stretched in its own plane; softens in compression, so that needles in it have no mesh limit"
            }
            Self::Gelatine5 => {
                "neo-Hookean with Poisson's ratio 0.45; gels differ with bloom and age by half or more; no relaxation: it takes minutes"
            }
        }
    }
}
