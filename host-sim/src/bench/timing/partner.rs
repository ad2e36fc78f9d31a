//! The whole exchange with another process: sample published → command received, with both sides polling.

use firmware::contract::frames::to_plane;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use firmware::contract::{PaddleCommand, Table};
use iceoryx2::service::ipc;

use super::blocks::{ModeAnswer, Stamps};
use super::own::TICKS_TO_RUN;
use super::peer::{Bare, DATAGRAM, Transport};
use super::spin::Spin;
use super::stimulus::{Samples, Stimulus};
use crate::bench::rounds::MeasuredLoop;
use crate::exchange::{Departure, PlantPorts, Space};
use crate::process::dies_with_parent;
use crate::runtime::error::{Role, RuntimeError};
use crate::runtime::peer::child::describe_exit;
use crate::runtime::signals;
use crate::runtime::time::clock::now_ns;
use crate::world::loop_settings::LoopSettings;

/// How long the other process may take to be there, and to answer.
const TIMEOUT: Duration = Duration::from_secs(10);

/// How long it may take to see that nobody is left.
const LEAVE_TIMEOUT: Duration = Duration::from_secs(2);

/// What all exchanges have in common.
#[derive(Clone, Debug)]
pub(super) struct Partner<'t> {
    pub(super) program: PathBuf,
    pub(super) table: &'t Table<f64, 2>,
    pub(super) table_file: PathBuf,
    pub(super) loop_settings: LoopSettings,
    pub(super) cpu: Option<usize>,
    pub(super) priority: u8,
}

/// An exchange with a process that polls.
pub(super) struct Running {
    ends: Ends,
    child: Child,
    space: Space,
    stimulus: Stimulus,
    /// The last command; none over plain services, which have no controller.
    last: Option<PaddleCommand>,
    transport: Transport,
    period_ns: u64,
    /// Exchanges that led to RUN.
    armed_after: u64,
}

enum Ends {
    Link(Box<PlantPorts<ipc::Service>>),
    Bare(Bare),
    Socket(UnixDatagram),
    Closed,
}

fn child(partner: &Partner<'_>, exchange: &str, space: &Space, stdin: Stdio) -> Result<Child, RuntimeError> {
    let mut command = Command::new(&partner.program);
    command.args(["timing-peer", "--exchange", exchange, "--link", space.name()]);
    command.arg("--table").arg::<&Path>(&partner.table_file);
    command.args(["--rate", &partner.loop_settings.rate.to_string(), "--priority", &partner.priority.to_string()]);
    if let Some(cpu) = partner.cpu {
        command.args(["--cpu", &cpu.to_string()]);
    }
    command.stdin(stdin).stdout(Stdio::null());
    dies_with_parent(&mut command).spawn().map_err(RuntimeError::Spawn)
}

fn wait(child: &mut Child, ready: impl Fn() -> bool) -> Result<(), RuntimeError> {
    let until = Instant::now() + TIMEOUT;
    while !ready() {
        signals::check()?;
        if let Ok(Some(status)) = child.try_wait() {
            return Err(RuntimeError::PeerDied { peer: Role::TimingPeer, how: describe_exit(&status) });
        }
        if Instant::now() > until {
            return Err(RuntimeError::PeerSilent { peer: Role::TimingPeer, silent_s: TIMEOUT.as_secs_f64() });
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    Ok(())
}

impl Running {
    /// Starts the other process, waits until it polls, and brings its controller to RUN.
    pub(super) fn in_run(partner: &Partner<'_>, transport: Transport) -> Result<Self, RuntimeError> {
        let mut running = Self::start(partner, transport)?;
        if transport == Transport::Bare {
            return Ok(running);
        }
        for tick in 0..TICKS_TO_RUN {
            signals::check()?;
            let stamps = running.at(tick)?;
            if stamps.answer.is_some_and(ModeAnswer::is_run) {
                running.armed_after = tick + 1;
                running.stimulus.start_needle(running.armed_after * running.period_ns);
                return Ok(running);
            }
        }
        let answer = ModeAnswer::of(&running.last.unwrap_or_default());
        Err(answer.never_armed(TICKS_TO_RUN, running.period_ns))
    }

    fn start(partner: &Partner<'_>, transport: Transport) -> Result<Self, RuntimeError> {
        let space = Space::unique()?;
        let stimulus = Stimulus::new(partner.table, &partner.loop_settings);
        let (ends, mut child) = match transport {
            Transport::Link => {
                let ports = PlantPorts::open(&space)?;
                (Ends::Link(Box::new(ports)), child(partner, "link", &space, Stdio::null())?)
            }
            Transport::Bare => {
                let bare = Bare::open(&space, "ping", "pong")?;
                (Ends::Bare(bare), child(partner, "bare", &space, Stdio::null())?)
            }
            Transport::Socket => {
                let (ours, theirs) = UnixDatagram::pair().map_err(RuntimeError::Spawn)?;
                ours.set_nonblocking(true).map_err(RuntimeError::Spawn)?;
                (Ends::Socket(ours), child(partner, "socket", &space, OwnedFd::from(theirs).into())?)
            }
        };
        match &ends {
            Ends::Link(ports) => {
                wait(&mut child, || ports.has_peer())?;
                ports.connect()?;
            }
            Ends::Bare(bare) => wait(&mut child, || bare.has_peer())?,
            Ends::Socket(_) | Ends::Closed => {}
        }
        // It has to reach its polling loop.
        std::thread::sleep(Duration::from_millis(20));
        let period_ns = partner.loop_settings.period_ns();
        Ok(Self { ends, child, space, stimulus, last: None, transport, period_ns, armed_after: 0 })
    }

    /// What is measured with it.
    pub(super) const fn measured(&self) -> MeasuredLoop {
        match self.transport {
            Transport::Link => MeasuredLoop::Link,
            Transport::Bare => MeasuredLoop::Bare,
            Transport::Socket => MeasuredLoop::Socket,
        }
    }

    /// The exchange of a release since RUN, skipped ones included: when its input was measured, and when the command
    /// was there.
    pub(super) fn release(&mut self, tick: u64) -> Result<Stamps, RuntimeError> {
        let measured_ns = now_ns();
        let stamps = self.exchange(tick)?;
        Ok(Stamps { exchanged_ns: stamps.exchanged_ns.map(|(_, command_ns)| (measured_ns, command_ns)), ..stamps })
    }

    /// One exchange; says when the sample was published and when the command was received, ns.
    pub(super) fn exchange(&mut self, tick: u64) -> Result<Stamps, RuntimeError> {
        self.at(self.armed_after + tick)
    }

    fn at(&mut self, tick: u64) -> Result<Stamps, RuntimeError> {
        let samples = {
            let paddle = to_plane(self.last.unwrap_or_default().displacement[0]);
            self.stimulus.samples(tick * self.period_ns, paddle)
        };
        let exchanged_ns = match &mut self.ends {
            Ends::Link(ports) => over_link(ports, &samples, &mut self.last),
            Ends::Bare(bare) => over_bare(bare, tick),
            Ends::Socket(socket) => over_socket(socket, &samples, &mut self.last),
            Ends::Closed => Err(silent()),
        }?;
        Ok(Stamps { answer: self.last.as_ref().map(ModeAnswer::of), exchanged_ns: Some(exchanged_ns) })
    }
}

/// Why no answer was waited for any longer.
fn silent() -> RuntimeError {
    let silent = RuntimeError::PeerSilent { peer: Role::TimingPeer, silent_s: TIMEOUT.as_secs_f64() };
    signals::check().err().unwrap_or(silent)
}

fn over_link(
    ports: &mut PlantPorts<ipc::Service>,
    samples: &Samples,
    last: &mut Option<PaddleCommand>,
) -> Result<(u64, u64), RuntimeError> {
    // The needle is what the other side polls: it comes last, when all is there.
    ports.paddle.send(samples.paddle)?;
    if let Some(target) = samples.target {
        ports.target.send(target)?;
    }
    let start_ns = now_ns();
    ports.needle.send(samples.needle)?;
    let mut outcome = Ok(None);
    spin(|| {
        outcome = ports.command.oldest();
        !matches!(outcome, Ok(None))
    });
    let end_ns = now_ns();
    *last = Some(outcome?.ok_or_else(silent)?);
    Ok((start_ns, end_ns))
}

fn over_bare(bare: &Bare, tick: u64) -> Result<(u64, u64), RuntimeError> {
    let start_ns = now_ns();
    bare.send([tick; 8])?;
    let mut outcome = Ok(None);
    spin(|| {
        outcome = bare.receive();
        !matches!(outcome, Ok(None))
    });
    let end_ns = now_ns();
    outcome?.ok_or_else(silent)?;
    Ok((start_ns, end_ns))
}

fn over_socket(
    socket: &UnixDatagram,
    samples: &Samples,
    last: &mut Option<PaddleCommand>,
) -> Result<(u64, u64), RuntimeError> {
    let mut buffer = [0; DATAGRAM];
    let start_ns = now_ns();
    let datagram = (samples.needle, samples.target, samples.paddle);
    let bytes = postcard::to_slice(&datagram, &mut buffer).map_err(|_| silent())?;
    socket.send(bytes).map_err(RuntimeError::Spawn)?;
    let mut answer = [0; DATAGRAM];
    let mut length = None;
    spin(|| {
        length = socket.recv(&mut answer).ok();
        length.is_some()
    });
    let command = length.and_then(|length| postcard::from_bytes::<PaddleCommand>(&answer[..length]).ok());
    let end_ns = now_ns();
    *last = Some(command.ok_or_else(silent)?);
    Ok((start_ns, end_ns))
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Ends::Socket(socket) = &self.ends {
            let _ = socket.send(&[]);
        }
        self.ends = Ends::Closed;
        // It has seen by itself that nobody is left; an unreaped child would count as alive.
        let patience = if signals::check().is_ok() { LEAVE_TIMEOUT } else { Duration::from_millis(100) };
        let until = Instant::now() + patience;
        while !matches!(self.child.try_wait(), Ok(Some(_))) {
            if Instant::now() > until {
                let _ = self.child.kill();
                let _ = self.child.wait();
                break;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        self.space.leave::<ipc::Service>(Departure::Last);
    }
}

fn spin(mut done: impl FnMut() -> bool) {
    let (mut polls, mut spin): (u32, _) = (0, Spin::default());
    let mut since = None;
    while !done() {
        polls = polls.wrapping_add(1);
        if !spin.nothing() && !polls.is_multiple_of(1 << 16) {
            continue;
        }
        if signals::check().is_err() || since.get_or_insert_with(Instant::now).elapsed() > TIMEOUT {
            return;
        }
    }
}
