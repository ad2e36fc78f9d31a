//! One look per method in all charts: colour and marker.

use crate::discretization::Integration;
use crate::output::chart::{Colour, Marker};

/// Colour and marker of a rule.
pub(super) fn look(integration: Integration) -> (Colour, Marker) {
    match integration {
        Integration::Dni => (Colour::Orange, Marker::Diamond),
        Integration::Scni => (Colour::Sky, Marker::Square),
        Integration::ScniStabilised => (Colour::Blue, Marker::Circle),
        Integration::Mscni => (Colour::Ink, Marker::TriangleLeft),
        Integration::Nsni => (Colour::Purple, Marker::TriangleRight),
        Integration::Gauss => (Colour::Yellow, Marker::Pentagon),
        Integration::FemT3 | Integration::FemT4 => (Colour::Green, Marker::Triangle),
        Integration::FemT6 | Integration::FemT10 => (Colour::Vermillion, Marker::TriangleDown),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_methods_share_a_colour_or_a_shape() {
        let all = Integration::PLANAR;
        for (i, a) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|b| look(*a).0 != look(*b).0 && look(*a).1 != look(*b).1), "{a}");
        }
    }
}
