//! The image: built from the sources beside this crate, and what it takes of the board.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use firmware::contract::Header;
use firmware::scalar::ScalarKind;

use super::error::BoardError;
use crate::process::dies_with_parent;

/// Rust target of the board.
pub const TARGET: &str = "thumbv7em-none-eabihf";
/// Where SRAM begins on every Cortex-M.
const RAM_START: u32 = 0x2000_0000;

/// What the compiler may assume of the processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Processor {
    /// Cortex-M7 with double precision in hardware.
    Double,
    /// Cortex-M4F or M7 with single precision only: `f64` in software.
    Single,
}

impl Processor {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Double, Self::Single];

    /// Name of target directories and budgets.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Double => "double",
            Self::Single => "single",
        }
    }

    /// `#[inline]` is no reason to inline what is compiled for size: 50 is the threshold without it. Left alone, the
    /// encoders of postcard and serde, all of which have it, take 2 KB more.
    fn rustflags(self) -> &'static str {
        match self {
            Self::Double => include_str!("../../../../firmware/image/double.rustflags").trim(),
            // The target's own baseline: Armv7E-M with single-precision hardware.
            Self::Single => include_str!("../../../../firmware/image/single.rustflags").trim(),
        }
    }
}

/// What an image controls: the table's dimension of space and number of paddles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Control {
    /// One paddle in the plane.
    #[default]
    Plane,
    /// Two paddles in space.
    SpacePair,
}

impl Control {
    /// What follows the scalar in the names of images and budgets.
    pub const fn suffix(self) -> &'static str {
        match self {
            Self::Plane => "",
            Self::SpacePair => "-space",
        }
    }

    /// The profile of its images in the workspace's Cargo.toml.
    const fn profile(self) -> &'static str {
        match self {
            Self::Plane => "image",
            Self::SpacePair => "image-space",
        }
    }

    /// What an image is to control with a table of so many paddles in so many dimensions.
    ///
    /// # Errors
    /// [`BoardError::NoImage`].
    pub fn of(dimension: u8, paddles: usize, scalar: ScalarKind) -> Result<Self, BoardError> {
        match (dimension, paddles, scalar) {
            (2, 1, _) => Ok(Self::Plane),
            (3, 2, ScalarKind::F64) => Ok(Self::SpacePair),
            _ => Err(BoardError::NoImage { dimension, paddles, scalar: scalar.name() }),
        }
    }

    /// What the image for a table with such a header controls.
    ///
    /// # Errors
    /// [`BoardError::NoImage`].
    pub fn of_table(header: &Header) -> Result<Self, BoardError> {
        let Header { dimension, paddle_dof, scalar, .. } = *header;
        Self::of(dimension, usize::from(paddle_dof) / usize::from(dimension).max(1), scalar)
    }

    /// Dimension of space.
    pub const fn dimension(self) -> u8 {
        match self {
            Self::Plane => 2,
            Self::SpacePair => 3,
        }
    }

    /// Paddles that are moved.
    pub const fn paddles(self) -> u8 {
        match self {
            Self::Plane => 1,
            Self::SpacePair => 2,
        }
    }
}

/// An image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// What it controls.
    pub control: Control,
    /// What it computes in.
    pub scalar: ScalarKind,
    /// What it was compiled for.
    pub processor: Processor,
    /// The ELF file.
    pub elf: PathBuf,
}

/// What an image takes of the board's memory, without the stack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryUse {
    /// Vector table, code, constants and initial values, bytes.
    pub flash: u32,
    /// Statics, bytes: the table, its encoded form while it is loaded, the line's buffers.
    pub ram: u32,
}

impl Image {
    /// Builds the planar image, or finds that it is up to date. Linking proves that no panic can be reached.
    ///
    /// # Errors
    /// [`BoardError::NoTarget`], [`BoardError::Build`], [`BoardError::Io`].
    pub fn build(scalar: ScalarKind, processor: Processor) -> Result<Self, BoardError> {
        Self::build_for(Control::Plane, scalar, processor)
    }

    /// The same for what is to be controlled; in space, in `f64` only.
    ///
    /// # Errors
    /// As [`Image::build`].
    pub fn build_for(control: Control, scalar: ScalarKind, processor: Processor) -> Result<Self, BoardError> {
        if !has_target() {
            return Err(BoardError::NoTarget { target: TARGET });
        }
        let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let base = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| workspace.join("target"), PathBuf::from);
        // Apart from the host's: this may run while cargo holds the lock of that one.
        let directory = base.join(format!("board-{}", processor.name()));
        let name = format!("stillpoint-{}{}", scalar.name(), control.suffix());
        let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        cargo
            .current_dir(&workspace)
            .args(["build", "--quiet", "--locked", "-p", "firmware", "--features", "image", "--bin", &name])
            .args(["--profile", control.profile(), "--target", TARGET, "--target-dir"])
            .arg(&directory)
            .env_remove("RUSTFLAGS")
            .env_remove("CARGO_ENCODED_RUSTFLAGS")
            .env("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_RUSTFLAGS", processor.rustflags())
            .stdin(Stdio::null());
        let output = dies_with_parent(&mut cargo)
            .output()
            .map_err(|source| BoardError::Io { what: "cannot run cargo to build the image", source })?;
        if !output.status.success() {
            return Err(BoardError::Build { log: String::from_utf8_lossy(&output.stderr).into_owned() });
        }
        Ok(Self { control, scalar, processor, elf: directory.join(TARGET).join(control.profile()).join(name) })
    }

    /// What it takes of the board's memory.
    ///
    /// # Errors
    /// [`BoardError::Image`].
    pub fn memory_use(&self) -> Result<MemoryUse, BoardError> {
        let image = |reason: String| BoardError::Image { path: self.elf.clone(), reason };
        let bytes = std::fs::read(&self.elf).map_err(|error| image(error.to_string()))?;
        memory_use(&bytes).ok_or_else(|| image("not a 32-bit ELF file".to_owned()))
    }
}

/// Whether the compiler can build for the board.
fn has_target() -> bool {
    let output = Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]).output();
    output.is_ok_and(|output| {
        let directory = String::from_utf8_lossy(&output.stdout).trim().to_owned();
        output.status.success() && Path::new(&directory).is_dir()
    })
}

/// Adds up the sections of an ELF32 file (little-endian) that occupy memory on the board.
fn memory_use(elf: &[u8]) -> Option<MemoryUse> {
    const PROGBITS: u32 = 1;
    const NOBITS: u32 = 8;
    const ALLOCATED: u32 = 2;
    let half = |at: usize| elf.get(at..at + 2).map(|b| u16::from_le_bytes([b[0], b[1]]));
    let word = |at: usize| elf.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    if elf.get(..6)? != b"\x7fELF\x01\x01" {
        return None;
    }
    let (sections, size, count) = (word(0x20)? as usize, half(0x2e)? as usize, half(0x30)? as usize);
    let mut used = MemoryUse { flash: 0, ram: 0 };
    for section in (0..count).map(|i| sections + i * size) {
        let (kind, flags, address, bytes) =
            (word(section + 4)?, word(section + 8)?, word(section + 12)?, word(section + 20)?);
        if flags & ALLOCATED == 0 {
            continue;
        }
        // Initialised data lies in flash and is copied into RAM.
        if kind != NOBITS {
            used.flash += bytes;
        }
        if address >= RAM_START && (kind == NOBITS || kind == PROGBITS) {
            used.ram += bytes;
        }
    }
    Some(used)
}
