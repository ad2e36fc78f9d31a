//! Numbers for people, whatever the unit of length.

/// Digits that are shown of a small number.
const DIGITS: i32 = 4;
/// More decimals than this are zeros before the first digit of something that is zero but for rounding.
const MOST: i32 = 12;
/// Numbers this much smaller than the largest of their column are zero but for rounding.
const ROUNDING: f64 = 1e-9;
/// Below and from here on short numbers have a power of ten.
const SMALL: f64 = 1e-5;
const LARGE: f64 = 1e12;

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

/// The smallest size among numbers of one column, whose digits are shown of all of them; what is zero but for rounding
/// does not count.
pub fn smallest_told(column: impl Iterator<Item = f64>) -> f64 {
    let sizes: Vec<f64> = column.map(f64::abs).filter(|size| size.is_finite()).collect();
    let rounding = ROUNDING * sizes.iter().copied().fold(0.0, f64::max);
    sizes.into_iter().filter(|size| *size > rounding).min_by(f64::total_cmp).unwrap_or(0.0)
}

/// The number in the middle, of an even count the mean of the two; none of nothing.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let upper = *values.get(values.len() / 2)?;
    if values.len() % 2 == 1 { Some(upper) } else { Some(0.5 * (values[values.len() / 2 - 1] + upper)) }
}

/// A length with four digits or more.
pub fn length(value: f64) -> String {
    format!("{value:.*}", decimals(value, 4))
}

/// Four digits, without zeros at the end; with a power of ten where the zeros before them would have to be counted.
pub fn short(value: f64) -> String {
    if (f64::MIN_POSITIVE..SMALL).contains(&value.abs()) || (LARGE..f64::INFINITY).contains(&value.abs()) {
        let text = format!("{value:.*e}", DIGITS as usize - 1);
        let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{power}", without_zeros(digits.to_owned()));
    }
    without_zeros(format!("{value:.*}", decimals(value, 0)))
}

/// Four digits with their unit; the label `1` means that there is none.
pub fn in_unit(value: f64, unit: &str) -> String {
    if unit == "1" || unit.is_empty() { short(value) } else { format!("{} {unit}", short(value)) }
}

/// The same for an area, by the unit of length.
pub fn area(value: f64, unit: &str) -> String {
    if unit == "1" || unit.is_empty() { short(value) } else { format!("{} {unit}²", short(value)) }
}

/// A coordinate of a body of this size, to a ten-thousandth of it, without zeros at the end: far from the origin four
/// digits would all be the same.
pub fn coordinate(value: f64, size: f64) -> String {
    if size < SMALL && value.abs() < SMALL {
        return short(value);
    }
    without_zeros(format!("{:.*}", decimals(0.1 * size, 0), value))
}

fn without_zeros(text: String) -> String {
    let short = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_numbers_have_no_zeros_at_the_end_and_coordinates_as_many_digits_as_the_body_asks() {
        let shown =
            [(12.0, "12"), (0.30000000000000004, "0.3"), (1234567.0, "1234567"), (-0.0, "0"), (2.5e-4, "0.00025")];
        assert_eq!(shown.map(|(value, _)| short(value)), shown.map(|(_, text)| text));
        assert_eq!([short(5e-9), short(-1.23456e-20), short(3e15)], ["5e-9", "-1.235e-20", "3e15"]);
        assert_eq!([short(f64::INFINITY), short(f64::NAN)], ["inf", "NaN"]);
        assert_eq!([in_unit(12.0, "mm"), in_unit(12.0, "1"), area(0.5, "in")], ["12 mm", "12", "0.5 in²"]);
        assert_eq!(coordinate(1_000_012.345_6, 50.0), "1000012.346");
        assert_eq!(coordinate(-1e-12, 1.0), "0");
        assert_eq!(coordinate(100.0, 4000.0), "100");
        assert_eq!(coordinate(2.1e-7, 1e-7), "2.1e-7");
    }

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

    #[test]
    fn a_median_of_an_even_count_lies_between_the_two_in_the_middle() {
        assert_eq!(median(vec![5.0, 1.0, 3.0]), Some(3.0));
        assert_eq!(median(vec![9.0, 1.0, 2.0, 4.0]), Some(3.0));
        assert_eq!(median(Vec::new()), None);
    }

    #[test]
    fn a_zero_does_not_decide_for_its_column() {
        let smallest = |column: &[f64]| smallest_told(column.iter().copied());
        assert_eq!(smallest(&[0.0, 3.0, -0.2, f64::INFINITY, 1e-17]), 0.2);
        assert_eq!(smallest(&[0.0, 0.0]), 0.0);
        assert_eq!(smallest(&[]), 0.0);
        assert_eq!(smallest(&[2e-12, 5e-13]), 5e-13);
    }
}
