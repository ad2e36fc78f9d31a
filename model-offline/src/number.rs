//! Numbers for people, whatever the unit of length.

/// Digits that are shown of a small number.
const DIGITS: i32 = 4;
/// More decimals than this are zeros before the first digit of something that is zero but for rounding.
const MOST: i32 = 12;

/// Decimals that show four digits of a number of this size, and no fewer than `least`: a scene in metres needs more of
/// them than one in millimetres.
pub fn decimals(size: f64, least: usize) -> usize {
    let size = size.abs();
    if size == 0.0 || !size.is_finite() {
        return least;
    }
    // At most 12: no loss.
    least.max((DIGITS - 1 - size.log10().floor() as i32).clamp(0, MOST) as usize)
}

/// A length with four digits or more.
pub fn length(value: f64) -> String {
    format!("{value:.*}", decimals(value, 4))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_numbers_keep_their_digits_and_large_ones_their_decimals() {
        let shown = [(0.00301234, "0.003012"), (2.5e-7, "0.0000002500"), (15.30284, "15.3028"), (0.0, "0.0000")];
        for (value, text) in shown {
            assert_eq!(length(value), text);
            assert_eq!(length(-value).trim_start_matches('-'), text);
        }
        assert_eq!(decimals(0.723754, 6), 6);
        assert_eq!(decimals(3.1e-6, 6), 9);
        assert_eq!(decimals(1e-300, 6), 12);
        assert_eq!(decimals(f64::NAN, 6), 6);
    }
}
