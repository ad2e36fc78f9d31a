//! Conversions of units.

/// Nanoseconds as seconds.
///
/// Converted in halves: each is exact, so that their sum is rounded once, as `nanoseconds as f64` would be. Hardware
/// converts 32 bits; for 64, a microcontroller calls a function ten times as long.
pub(crate) fn seconds(nanoseconds: u64) -> f64 {
    let (high, low) = ((nanoseconds >> 32) as u32, nanoseconds as u32);
    (f64::from(high) * 4_294_967_296.0 + f64::from(low)) * 1e-9
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn seconds_are_rounded_once(nanoseconds: u64, shift in 0..64u32) {
            for nanoseconds in [nanoseconds >> shift, u64::MAX << shift, u64::MAX >> shift] {
                prop_assert_eq!(seconds(nanoseconds).to_bits(), (nanoseconds as f64 * 1e-9).to_bits());
            }
        }
    }
}
