//! The controller as a child process of the plant.

use std::io::Read;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use crate::exchange::Space;
use crate::runtime::accounting::accounts::ControllerAccounts;
use crate::runtime::accounting::tick::ControllerTick;
use crate::runtime::error::{Role, RuntimeError};
use crate::runtime::executor::Hardware;
use crate::runtime::time::mode::RunMode;
use crate::world::loop_settings::LoopSettings;

/// How long a controller may take to hand in its accounts after the stop.
const ACCOUNTS_TIMEOUT: Duration = Duration::from_secs(20);

/// A running controller; ended and reaped when dropped.
#[derive(Debug)]
pub struct ControllerProcess {
    child: Child,
    /// Everything it says on stdout, once it has closed it.
    said: Receiver<std::io::Result<Vec<u8>>>,
}

/// What a controller process is started with.
#[derive(Clone, Copy, Debug)]
pub struct ControllerCall<'a> {
    /// This program.
    pub program: &'a Path,
    /// Table file.
    pub table: &'a Path,
    /// Shared memory.
    pub space: &'a Space,
    /// What drives time.
    pub mode: RunMode,
    /// What computes the steps.
    pub hardware: Hardware,
    /// Rates, latency, noise.
    pub loop_settings: LoopSettings,
    /// Insertion depth, for the default of the noise.
    pub depth: f64,
    /// Ticks to keep room for.
    pub capacity: u64,
    /// Seconds of silence after which it gives the plant up.
    pub patience_s: f64,
}

impl ControllerProcess {
    /// Starts `host-sim controller`.
    ///
    /// # Errors
    /// [`RuntimeError::Spawn`].
    pub fn start(call: &ControllerCall<'_>) -> Result<Self, RuntimeError> {
        let mut child = Command::new(call.program)
            .arg("controller")
            .arg("--table")
            .arg(call.table)
            .args(["--link", call.space.name()])
            .args(["--mode", &call.mode.to_string()])
            .args(["--controller", call.hardware.name()])
            .args(call.loop_settings.to_arguments(call.depth))
            .args(["--capacity", &call.capacity.to_string()])
            .args(["--patience", &call.patience_s.to_string()])
            .args(["--parent", &std::process::id().to_string()])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            // Ctrl-C in the terminal is for the plant, which ends its controller itself.
            .process_group(0)
            .spawn()
            .map_err(RuntimeError::Spawn)?;
        let (sender, said) = channel();
        if let Some(mut stdout) = child.stdout.take() {
            std::thread::spawn(move || {
                let mut bytes = Vec::new();
                let outcome = stdout.read_to_end(&mut bytes).map(|_| bytes);
                let _ = sender.send(outcome);
            });
        }
        Ok(Self { child, said })
    }

    /// Process id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// How it ended, if it has.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().ok().flatten()
    }

    /// After the stop: its accounts and everything that it saw.
    ///
    /// # Errors
    /// [`RuntimeError::PeerDied`], [`RuntimeError::PeerSilent`], [`RuntimeError::Protocol`].
    pub fn finish(mut self) -> Result<(ControllerAccounts, Vec<ControllerTick>), RuntimeError> {
        let said = self.said.recv_timeout(ACCOUNTS_TIMEOUT).map_err(|_| RuntimeError::PeerSilent {
            peer: Role::Controller,
            silent_s: ACCOUNTS_TIMEOUT.as_secs_f64(),
        })?;
        let status = self.child.wait().map_err(RuntimeError::Spawn)?;
        if !status.success() {
            return Err(RuntimeError::PeerDied { peer: Role::Controller, how: describe_exit(&status) });
        }
        let bytes = said.map_err(RuntimeError::Spawn)?;
        ControllerAccounts::decode(&bytes).ok_or_else(|| RuntimeError::Protocol {
            peer: Role::Controller,
            what: "its accounts cannot be read".to_owned(),
        })
    }
}

impl Drop for ControllerProcess {
    fn drop(&mut self) {
        // Both fail harmlessly if it has been waited for; an unreaped child would count as alive in shared memory.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// How a process ended, in words.
pub fn describe_exit(status: &ExitStatus) -> String {
    use std::os::unix::process::ExitStatusExt;
    match (status.code(), status.signal()) {
        (Some(code), _) => format!("exit code {code}"),
        (_, Some(9)) => "killed by SIGKILL".to_owned(),
        (_, Some(15)) => "killed by SIGTERM".to_owned(),
        (_, Some(signal)) => format!("killed by signal {signal}"),
        _ => status.to_string(),
    }
}
