//! Numbers as people read them: in charts, tables and pages alike.

const SUPERSCRIPTS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];

/// What stands for a number that is none.
pub const NO_NUMBER: &str = "–";

/// `10ⁿ`.
pub fn power_of_ten(exponent: i32) -> String {
    let digits = exponent.unsigned_abs().to_string();
    let sign = if exponent < 0 { "⁻" } else { "" };
    let digits: String = digits.bytes().map(|digit| SUPERSCRIPTS[usize::from(digit - b'0')]).collect();
    format!("10{sign}{digits}")
}

/// Decimal exponent of a number; 0 for 0 and for what is not finite.
pub fn exponent(value: f64) -> i32 {
    if value == 0.0 || !value.is_finite() { 0 } else { value.abs().log10().floor() as i32 }
}

/// With this many significant digits; `–` when it is not finite.
pub fn number(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return NO_NUMBER.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let exponent = exponent(value);
    if (-4..6).contains(&exponent) {
        let decimals = usize::try_from(digits - 1 - exponent).unwrap_or(0);
        minus(format!("{value:.decimals$}"))
    } else {
        let decimals = usize::try_from(digits - 1).unwrap_or(0);
        let mantissa = minus(format!("{:.decimals$}", value / 10f64.powi(exponent)));
        format!("{mantissa}\u{a0}×\u{a0}{}", power_of_ten(exponent))
    }
}

/// As short as three significant digits allow: settings and places.
pub fn plain(value: f64) -> String {
    let text = number(value, 3);
    match text.split_once('.') {
        Some((_, decimals)) if decimals.bytes().all(|digit| digit.is_ascii_digit()) => {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        }
        _ => text,
    }
}

/// An integer with thin spaces between thousands.
pub fn count(value: u64) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) && digits.len() > 4 {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// A true minus sign.
pub fn minus(text: String) -> String {
    match text.strip_prefix('-') {
        Some(rest) => format!("−{rest}"),
        None => text,
    }
}

/// A scene's unit label in brackets; the label `1` means that the scene has no units.
pub fn in_unit(what: &str, unit: &str) -> String {
    match unit {
        "" | "1" => what.to_owned(),
        unit => format!("{what} [{unit}]"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_never_infinite() {
        assert_eq!(number(0.000_366_123, 3), "0.000366");
        assert_eq!(number(-1.043e-5, 3), "−1.04\u{a0}×\u{a0}10⁻⁵");
        assert_eq!(number(5.0875, 5), "5.0875");
        assert_eq!(number(f64::NAN, 3), "–");
        assert_eq!(number(f64::INFINITY, 3), "–");
        assert_eq!([plain(0.1), plain(5.0), plain(20.0), plain(1.04e-5)], ["0.1", "5", "20", "1.04\u{a0}×\u{a0}10⁻⁵"]);
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(count(5520), "5520");
        assert_eq!(in_unit("depth", "1"), "depth");
        assert_eq!(in_unit("depth", "mm"), "depth [mm]");
    }
}
