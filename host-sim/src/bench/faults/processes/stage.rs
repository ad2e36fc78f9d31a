//! Real processes under observation: started, signalled, waited for, and nothing of them left behind.

use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use firmware::contract::Table;
use iceoryx2::service::ipc;
use model_offline::table::to_bytes;
use rustix::process::{Pid, Signal, kill_process, kill_process_group};
use serde::de::DeserializeOwned;

use crate::bench::error::SimError;
use crate::bench::paper_table::BRICK;
use crate::exchange::{Departure, LinkError, Space};
use crate::record::error::FileError;
use crate::runtime::controller::process::ControllerResult;
use crate::runtime::error::RuntimeError;
use crate::runtime::plant::process::PlantResult;
use crate::runtime::signals;

/// How long any of them may take to end.
pub(super) const TIMEOUT: Duration = Duration::from_secs(20);

/// Where the rows with real processes take place.
#[derive(Debug)]
pub(crate) struct Stage<'t, const D: usize = 2, const N: usize = 1, const P: usize = 1> {
    /// The controller's table.
    pub(super) table: &'t Table<f64, D, N, P>,
    /// This program.
    pub(super) program: PathBuf,
    /// The table as a file.
    pub(super) table_file: PathBuf,
    /// Which plant belongs to it.
    plant: Vec<String>,
    /// How long that takes before it looks for a controller: what it has to compute first.
    lead: Duration,
    /// Seed of the phases.
    pub(super) seed: u64,
    /// Part of the catalogue's number of repetitions, 1 for all.
    pub(super) effort: f64,
    folder: tempfile::TempDir,
    /// Distinguishes files and links.
    counter: AtomicU32,
}

impl<'t, const D: usize, const N: usize, const P: usize> Stage<'t, D, N, P> {
    /// A folder with a copy of this program and the table, for other users to read.
    pub(crate) fn new(table: &'t Table<f64, D, N, P>, seed: u64, effort: f64) -> Result<Self, SimError> {
        let folder = tempfile::Builder::new().prefix("stillpoint-faults-").tempdir().map_err(RuntimeError::Spawn)?;
        let write = |path: &Path, outcome: std::io::Result<()>| outcome.map_err(FileError::write(path));
        let readable = std::fs::Permissions::from_mode(0o755);
        write(folder.path(), std::fs::set_permissions(folder.path(), readable))?;
        let program = folder.path().join("host-sim");
        let current = std::env::current_exe().map_err(RuntimeError::Spawn)?;
        write(&program, std::fs::copy(current, &program).map(drop))?;
        let table_file = folder.path().join("controller.table");
        write(&table_file, std::fs::write(&table_file, to_bytes(table)?))?;
        let indices = table.paddles.each_ref().map(|paddle| paddle.index.to_string());
        let mut plant = vec!["--paddle".to_owned(), indices.join(",")];
        if D > 2 {
            let scene = folder.path().join("brick.toml");
            write(&scene, std::fs::write(&scene, BRICK))?;
            plant.extend(["--scene".to_owned(), scene.to_string_lossy().into_owned()]);
        }
        let (counter, lead) = (AtomicU32::new(0), Duration::ZERO);
        let stage = Self { table, program, table_file, plant, lead, seed, effort, folder, counter };
        if D > 2 { stage.with_lead() } else { Ok(stage) }
    }

    /// The same with the time that a plant takes: one that finds no controller gives up at once.
    fn with_lead(self) -> Result<Self, SimError> {
        let started = Instant::now();
        let mut plant = self.start(&self.plant_call(&self.link(), &["--patience", "0.001"]))?;
        let _ = plant.code();
        Ok(Self { lead: started.elapsed(), ..self })
    }

    /// This long after its start the plant is at work, and then so much longer.
    pub(super) fn after_the_start(&self, then: Duration) -> Duration {
        self.lead + then
    }

    /// Milliseconds until a plant looks for a controller.
    pub(super) fn lead_ms(&self) -> u64 {
        u64::try_from(self.lead.as_millis()).unwrap_or(u64::MAX)
    }

    /// Seconds that either side waits for the other.
    pub(super) fn patience(&self) -> String {
        (3 + 3 * self.lead.as_secs()).to_string()
    }

    /// Which plant belongs to the table, as arguments.
    pub(super) fn plant_arguments(&self) -> impl Iterator<Item = &str> {
        self.plant.iter().map(String::as_str)
    }

    fn plant_call<'a>(&'a self, link: &'a str, more: &[&'a str]) -> Vec<&'a str> {
        let mut arguments = vec!["plant", "--mode", "free-run", "--link", link];
        arguments.extend(self.plant_arguments());
        arguments.extend(more);
        arguments
    }

    /// This many repetitions, or the part of them that was asked for.
    pub(super) fn repetitions(&self, all: u64) -> u64 {
        ((all as f64 * self.effort).ceil() as u64).max(1)
    }

    /// A name that nobody else uses.
    pub(super) fn link(&self) -> String {
        static LINKS: AtomicU32 = AtomicU32::new(0);
        format!("faults-{}-{}", std::process::id(), LINKS.fetch_add(1, Ordering::Relaxed))
    }

    /// A path in the folder that nothing is at yet.
    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(format!("{}-{name}", self.counter.fetch_add(1, Ordering::Relaxed)))
    }

    /// Starts this program.
    pub(super) fn start(&self, arguments: &[&str]) -> Result<Process, SimError> {
        let mut command = Command::new(&self.program);
        command.args(arguments);
        self.start_command(command)
    }

    /// Starts any program.
    pub(super) fn start_command(&self, mut command: Command) -> Result<Process, SimError> {
        let said = self.path("stderr");
        let stderr = std::fs::File::create(&said).map_err(RuntimeError::Spawn)?;
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(stderr).process_group(0).spawn();
        Ok(Process { child: child.map_err(RuntimeError::Spawn)?, said })
    }

    /// Starts a controller in free-run; returns where it records and where its accounts will be.
    pub(super) fn controller(&self, link: &str, more: &[&str]) -> Result<(Process, PathBuf, PathBuf), SimError> {
        let (record, json) = (self.path("controller.rec"), self.path("controller.json"));
        let files = [&self.table_file, &record, &json].map(|path| path.to_string_lossy().into_owned());
        let [table, record_text, json_text] = files.each_ref().map(String::as_str);
        let patience = self.patience();
        let mut arguments = vec!["controller", "--link", link, "--patience", &patience];
        if !more.contains(&"--mode") {
            arguments.extend(["--mode", "free-run"]);
        }
        arguments.extend(["--table", table, "--json", json_text, "--record", record_text]);
        arguments.extend(more);
        Ok((self.start(&arguments)?, record, json))
    }

    /// Starts a plant in free-run; returns where its account will be.
    pub(super) fn plant(&self, link: &str, more: &[&str]) -> Result<(Process, PathBuf), SimError> {
        let json = self.path("plant.json");
        let json_text = json.to_string_lossy().into_owned();
        let patience = self.patience();
        let mut arguments = self.plant_call(link, &["--patience", &patience, "--json", &json_text]);
        arguments.extend(more);
        Ok((self.start(&arguments)?, json))
    }
}

/// Names in shared memory and directories that a link has left behind; tidies up after looking.
pub(super) fn left_behind(link: &str) -> Result<Vec<PathBuf>, LinkError> {
    let root = Space::directory_of(link);
    let existed = root.exists();
    let space = Space::new(link)?;
    let traces = space.traces().into_iter().filter(|path| existed || *path != root).collect();
    space.leave::<ipc::Service>(Departure::First);
    Ok(traces)
}

/// Reads what a process has written.
pub(super) fn read_json<T: DeserializeOwned>(path: &Path) -> Option<T> {
    serde_json::from_slice(&std::fs::read(path).ok()?).ok()
}

/// A process of ours; ended and reaped when dropped.
#[derive(Debug)]
pub(super) struct Process {
    child: Child,
    said: PathBuf,
}

impl Process {
    pub(super) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Sends a signal; to a process that has ended already, nothing happens.
    pub(super) fn signal(&self, signal: Signal) {
        if let Some(process) = Pid::from_raw(self.child.id() as i32) {
            let _ = kill_process(process, signal);
        }
    }

    /// Kills and reaps it: an unreaped child would count as alive in shared memory.
    pub(super) fn kill(&mut self) {
        // The whole group: a script may have started others.
        if let Some(group) = Pid::from_raw(self.child.id() as i32)
            && self.child.try_wait().is_ok_and(|ended| ended.is_none())
        {
            let _ = kill_process_group(group, Signal::KILL);
        }
        let _ = self.child.wait();
    }

    /// How it ended, if it does within `timeout`; not waited for once a signal asks for the end.
    pub(super) fn wait(&mut self, timeout: Duration) -> Option<ExitStatus> {
        let until = Instant::now() + timeout;
        loop {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Some(status);
            }
            if Instant::now() > until || signals::check().is_err() {
                return None;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Its exit code; none when a signal ended it, or nothing did.
    pub(super) fn code(&mut self) -> Option<i32> {
        self.wait(TIMEOUT).and_then(|status| status.code())
    }

    /// Whether it ended by SIGKILL: the kernel's word that a fault took place.
    pub(super) fn was_killed(&mut self) -> bool {
        self.child.try_wait().ok().flatten().is_some_and(|status| status.signal() == Some(Signal::KILL.as_raw()))
    }

    /// What it said on stderr, in one line.
    pub(super) fn message(&self) -> String {
        let text = std::fs::read_to_string(&self.said).unwrap_or_default();
        text.replace(['│', '╰', '├', '─', '▶', '×'], " ").split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// Open descriptors.
    pub(super) fn descriptors(&self) -> usize {
        descriptors(&self.id().to_string())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Open descriptors of a process (`self` for this one).
pub(super) fn descriptors(process: &str) -> usize {
    std::fs::read_dir(format!("/proc/{process}/fd")).map_or(0, Iterator::count)
}

/// Children of this process, zombies included.
pub(super) fn children() -> usize {
    let threads = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let children = threads.filter_map(|thread| std::fs::read_to_string(thread.path().join("children")).ok());
    children.map(|list| list.split_whitespace().count()).sum()
}

/// Samples and ticks that a controller cannot account for, given the plant's account of what it published, if it lived to say.
pub(super) fn unaccounted(result: &ControllerResult, plant: Option<&PlantResult>) -> u64 {
    let handover = &result.accounts;
    let streams = [&handover.needle, &handover.target, &handover.paddle].into_iter().chain(&handover.second_paddle);
    let own: u64 = streams.clone().map(|stream| stream.unaccounted).sum();
    let lost: u64 = plant.map_or(0, |plant| {
        let published = plant.published.into_iter().chain(plant.published_second_paddle);
        let entries = streams.map(|stream| {
            stream.consumed + stream.overwritten + stream.discarded.iter().sum::<u64>() + stream.in_flight
        });
        published.zip(entries).map(|(published, entries)| published.abs_diff(entries)).sum()
    });
    let record = handover.record.as_ref().map_or(0, |record| record.unaccounted());
    own + lost + handover.ticks.unaccounted + record
}

/// Milliseconds.
pub(super) const fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// Lets time pass, until a signal asks for the end.
pub(super) fn pause(duration: Duration) {
    wait_until(duration, || false);
}

/// Waits until `condition` holds; not once a signal asks for the end.
pub(super) fn wait_until(timeout: Duration, mut condition: impl FnMut() -> bool) -> bool {
    let until = Instant::now() + timeout;
    while !condition() {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() || signals::check().is_err() {
            return false;
        }
        std::thread::sleep(left.min(ms(5)));
    }
    true
}
