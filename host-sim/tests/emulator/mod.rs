//! The controller's image for a Cortex-M7, where it can be built and emulated.

use firmware::scalar::ScalarKind;
use host_sim::exchange::board::{BoardError, Image, Processor, Qemu, qemu};

use super::missing::skip;

/// The image, or `None` and a word about what is missing.
pub(crate) fn image(scalar: ScalarKind) -> Option<Image> {
    let missing = match Image::build(scalar, Processor::Double) {
        Ok(image) if Qemu::is_installed() => return Some(image),
        Ok(_) => BoardError::NoQemu { program: qemu::PROGRAM },
        Err(missing @ BoardError::NoTarget { .. }) => missing,
        Err(other) => panic!("{other}"),
    };
    skip("the controller on a Cortex-M7 in QEMU", missing);
    None
}
