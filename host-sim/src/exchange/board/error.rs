//! Why a board cannot be used.

use std::path::PathBuf;

use firmware::serial::{Identity, Refusal};

/// Why a board cannot be used, and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BoardError {
    /// The compiler cannot build for the board.
    #[error("no Rust target for the board: run `rustup target add {target}`")]
    NoTarget {
        /// The Rust target.
        target: &'static str,
    },
    /// QEMU is not installed.
    #[error("`{program}` is not there: install QEMU (Debian, Ubuntu: `apt-get install qemu-system-arm`)")]
    NoQemu {
        /// The emulator's program.
        program: &'static str,
    },
    /// There is no image for such a table.
    #[error(
        "no image controls {paddles} paddle(s) in {dimension} dimensions in {scalar}: there are images for one paddle in the plane in f64 and f32, and for two paddles in space in f64; use `--controller native`"
    )]
    NoImage {
        /// The table's dimension of space.
        dimension: u8,
        /// Its paddles.
        paddles: usize,
        /// What it is computed in.
        scalar: &'static str,
    },
    /// The image does not build or, because a panic can be reached, does not link.
    #[error("the image does not build:\n{log}")]
    Build {
        /// What cargo said.
        log: String,
    },
    /// The image is not what the linker writes.
    #[error("{} is no image: {reason}", path.display())]
    Image {
        /// File.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A process cannot be started, or the line cannot be used.
    #[error("{what}: {source}")]
    Io {
        /// What was tried.
        what: &'static str,
        /// Why not.
        source: std::io::Error,
    },
    /// The line was closed from the other end.
    #[error("the board has closed the line (has QEMU died?)")]
    Closed,
    /// No answer.
    #[error("no answer from the board to {to} for {silent_s:.1} s: is it stopped, or does the line lose bytes?")]
    Silent {
        /// The request.
        to: &'static str,
        /// How long was waited, s.
        silent_s: f64,
    },
    /// Another version, or another scalar.
    #[error("the board is {found:?}, this program talks to {expected}: build the image and host-sim from one source")]
    Identity {
        /// What it says.
        found: Identity,
        /// What was expected.
        expected: String,
    },
    /// It has started anew in the middle of a run.
    #[error("the board has started anew: {found:?}")]
    Restarted {
        /// What it says.
        found: Identity,
    },
    /// It does not do what was asked for.
    #[error("the board refuses {to}: {refusal:?}")]
    Refused {
        /// The request.
        to: &'static str,
        /// Why.
        refusal: Refusal,
    },
}
