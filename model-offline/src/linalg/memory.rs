//! Whether a factor fits into the memory of the machine. A process that takes more than there is gets killed without a word.

/// A factor that the machine has no memory for.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub struct NotEnoughMemory {
    /// Unknowns of the matrix.
    pub unknowns: usize,
    /// Bytes that the factor takes, and that are free; none where it has more entries than can be numbered.
    pub needed: Option<(u64, u64)>,
}

impl std::fmt::Display for NotEnoughMemory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let gigabytes = |bytes: u64| bytes as f64 / 1e9;
        write!(f, "the factor of {} unknowns would take ", self.unknowns)?;
        match self.needed {
            Some((needed, free)) => {
                write!(f, "{:.1} GB, and {:.1} GB of memory are free", gigabytes(needed), gigabytes(free))?
            }
            None => write!(f, "more than {:.0} GB, which is not tried", gigabytes(MOST_ENTRIES * BYTES))?,
        }
        f.write_str(": take a coarser mesh, or elements, whose factors are smaller (fem-t6, in space fem-t10)")
    }
}

/// Bytes of an entry.
const BYTES: u64 = size_of::<f64>() as u64;
/// Entries that signed numbers of 32 bits count.
const MOST_ENTRIES: u64 = i32::MAX as u64;

/// Bytes of memory that can be taken without pushing anything out, as Linux tells it; none elsewhere.
fn available() -> Option<u64> {
    let told = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = told.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kilobytes| kilobytes * 1024)
}

/// Refuses a factor of so many entries that there is no memory for.
pub(super) fn room_for(unknowns: usize, entries: usize) -> Result<(), NotEnoughMemory> {
    let needed = entries as u64 * BYTES;
    match available() {
        Some(free) if needed > free => Err(NotEnoughMemory { unknowns, needed: Some((needed, free)) }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_larger_than_the_machine_is_refused_in_words() {
        assert_eq!(room_for(30, 465), Ok(()));
        // Ten million gigabytes.
        let refused = room_for(9_000_000, 1 << 53);
        let Some(free) = available() else { return assert_eq!(refused, Ok(())) };
        assert!((1 << 20..1 << 50).contains(&free), "{free}");
        let told = refused.unwrap_err().to_string();
        assert!(told.starts_with("the factor of 9000000 unknowns would take 72057594.0 GB, and "), "{told}");
        assert!(told.contains(" GB of memory are free: take a coarser mesh"), "{told}");
        let uncounted = NotEnoughMemory { unknowns: 1, needed: None };
        assert!(
            uncounted
                .to_string()
                .starts_with("the factor of 1 unknowns would take more than 17 GB, which is not tried: take")
        );
    }
}
