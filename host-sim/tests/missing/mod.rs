//! What a machine may lack, and a test then skip. In CI nothing may be missing.

use std::fmt::Display;

/// Says what is not tested here, and why.
///
/// # Panics
/// In CI, which sets `CI_NEEDS_QEMU`: a test that is skipped there is a test that nobody runs.
pub(crate) fn skip(untested: &str, missing: impl Display) {
    assert!(std::env::var_os("CI_NEEDS_QEMU").is_none(), "{missing}");
    eprintln!("skipped: {untested} was not tested: {missing}");
}
