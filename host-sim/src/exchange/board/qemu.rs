//! QEMU's model of the board as a child process, its UART on two pipes.

use std::path::Path;
use std::process::{Child, Command, Stdio};

use super::error::BoardError;
use super::line::SerialLine;
use crate::process::dies_with_parent;

/// The emulator.
pub const PROGRAM: &str = "qemu-system-arm";

/// Every instruction takes 2⁸ ns of the board's time. SysTick, at 40 ns per count, then tells single instructions
/// apart: at the board's nominal speed it could not. The board's time has nothing to do with the loop's, which comes
/// from the messages.
pub const ICOUNT_SHIFT: u32 = 8;

/// A running emulator; ended and reaped when dropped.
#[derive(Debug)]
pub struct Qemu {
    child: Child,
}

impl Qemu {
    /// Whether QEMU is installed.
    pub fn is_installed() -> bool {
        let version = Command::new(PROGRAM).arg("--version").stdin(Stdio::null()).output();
        version.is_ok_and(|output| output.status.success())
    }

    /// Starts an image. The line does nothing before the image says Hello.
    ///
    /// # Errors
    /// [`BoardError::NoQemu`], [`BoardError::Io`].
    pub fn start(elf: &Path) -> Result<(Self, SerialLine), BoardError> {
        if !Self::is_installed() {
            return Err(BoardError::NoQemu { program: PROGRAM });
        }
        let mut command = Command::new(PROGRAM);
        command
            .args(["-machine", "mps2-an500", "-cpu", "cortex-m7", "-display", "none", "-monitor", "none"])
            .args(["-icount", &format!("shift={ICOUNT_SHIFT},sleep=off"), "-serial", "stdio"])
            .arg("-kernel")
            .arg(elf)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        let mut child = dies_with_parent(&mut command)
            .spawn()
            .map_err(|source| BoardError::Io { what: "cannot start QEMU", source })?;
        let (Some(stdin), Some(stdout)) = (child.stdin.take(), child.stdout.take()) else {
            unreachable!("both are piped");
        };
        Ok((Self { child }, SerialLine::new(stdout, stdin)))
    }

    /// Process id, for stopping it in tests.
    pub fn id(&self) -> u32 {
        self.child.id()
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        // Both fail harmlessly if it has ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
