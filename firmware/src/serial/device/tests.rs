//! A device on a line of two queues, with a counter that the test turns.

use std::collections::VecDeque;
use std::vec::Vec;

use super::super::message::TABLE_CHUNK_BYTES;
use super::*;
use crate::contract::example::table;
use crate::contract::{MAX_TABLE_BYTES, encode};
use crate::controller::plant::{MS, Plant};
use crate::inputs::{Discard, Ledger, StreamLedger, TickLedger};
use crate::scalar::ScalarKind;
use crate::serial::LineLedger;

/// A board whose line is closed once the host has nothing left to say.
#[derive(Default)]
struct Bench {
    to_device: VecDeque<u8>,
    from_device: Vec<u8>,
    counter: u32,
    /// Counts per look at the counter.
    speed: u32,
    served: u32,
    hung: bool,
}

impl Board for Bench {
    const COUNTER_HZ: u32 = 1_000_000;

    fn read(&mut self) -> Option<u8> {
        self.to_device.pop_front()
    }
    fn write(&mut self, byte: u8) {
        self.from_device.push(byte);
    }
    fn counter(&mut self) -> u32 {
        self.counter = (self.counter + self.speed) & COUNTER_MASK;
        self.counter
    }
    fn alive(&mut self) {
        self.served += 1;
    }
    fn hang(&mut self) {
        self.hung = true;
    }
    fn stack_bytes(&self) -> u32 {
        7
    }
    fn is_closed(&self) -> bool {
        self.to_device.is_empty()
    }
}

fn encoded<T: Scalar, const D: usize, const N: usize, const P: usize>(table: &Table<T, D, N, P>) -> Vec<u8> {
    let mut bytes = std::vec![0; MAX_TABLE_BYTES];
    let length = encode(table, &mut bytes).unwrap();
    bytes.truncate(length);
    bytes
}

const HELLO: Request<'_> = Request::Hello { session: 0 };

/// The requests that give a device this table, and begin a run.
fn loading(table: &[u8], clock: ClockSource) -> Vec<Request<'_>> {
    let pieces = table.chunks(TABLE_CHUNK_BYTES).enumerate();
    let mut requests: Vec<_> =
        pieces.map(|(i, bytes)| Request::Table { offset: (i * TABLE_CHUNK_BYTES) as u32, bytes }).collect();
    requests.push(Request::Begin { settings: Settings::new(MS, 20 * MS, 20 * MS), clock });
    requests
}

/// What a device answers to these requests.
fn answers<T: Scalar>(bench: &mut Bench, requests: &[Request<'_>]) -> Vec<Reply> {
    say(bench, requests);
    answers_of::<T>(bench)
}

/// Puts these requests on the line, after a Hello.
fn say(bench: &mut Bench, requests: &[Request<'_>]) {
    let mut writer = FrameWriter::new();
    let begun = matches!(requests.first(), Some(Request::Hello { .. }));
    for request in [HELLO].iter().take(usize::from(!begun)).chain(requests) {
        if matches!(request, Request::Hello { .. }) {
            writer.restart();
        }
        bench.to_device.extend(writer.encode(request).unwrap());
    }
}

/// What a device answers to what is on the line.
fn answers_of<T: Scalar>(bench: &mut Bench) -> Vec<Reply> {
    answers_with(bench, &mut std::boxed::Box::new(Memory::<T>::new()))
}

/// The same of a device with this memory.
fn answers_with<T: Scalar, const D: usize, const N: usize, const P: usize, const BYTES: usize>(
    bench: &mut Bench,
    memory: &mut Memory<T, D, N, P, BYTES>,
) -> Vec<Reply> {
    serve(bench, memory, ResetCause::PowerOn);
    let mut reader = FrameReader::new();
    let mut replies = Vec::new();
    for byte in &bench.from_device {
        let frame = reader.feed(*byte);
        if frame == Some(Frame::Start) {
            reader.follow();
        }
        replies.extend(frame.and_then(|_| reader.message::<Reply>()));
    }
    replies
}

/// Inputs of a closed loop and the commands that the controller gives by itself.
fn insertion<T: Scalar>(ticks: u64) -> Vec<(Inputs, PaddleCommand)> {
    let table = table().cast::<T>();
    let controller = Controller::new(&table, &Settings::new(MS, 20 * MS, 20 * MS)).unwrap();
    let (mut state, mut plant) = (State::<T>::new(), Plant::new());
    (0..ticks)
        .map(|_| {
            let inputs = plant.sense();
            let command = controller.step(&mut state, &inputs);
            plant.act(&command);
            (inputs, command)
        })
        .collect()
}

fn requests_of<'a>(inputs: &Inputs) -> impl Iterator<Item = Request<'a>> + use<'a> {
    let Inputs { tick, time_ns, needle, target, paddles } = *inputs;
    let [first, second] = paddles.map(|paddle| paddle.map(Request::Paddle));
    let samples = [needle.map(Request::Needle), target.map(Request::Target), first, second];
    samples.into_iter().flatten().chain([Request::Time { tick, time_ns }])
}

fn commands_are_the_controllers<T: Scalar>() {
    let bytes = encoded(&table().cast::<T>());
    let expected = insertion::<T>(300);
    let mut requests = loading(&bytes, ClockSource::Frames);
    requests.extend(expected.iter().flat_map(|(inputs, _)| requests_of(inputs)));
    requests.push(Request::Account);
    let replies = answers::<T>(&mut Bench::default(), &requests);
    let commands: Vec<_> = replies
        .iter()
        .filter_map(|reply| match reply {
            Reply::Command { command, .. } => Some(*command),
            _ => None,
        })
        .collect();
    assert!(commands.iter().eq(expected.iter().map(|(_, command)| command)));
    // The host is told once that the board is ready, and before anything is commanded.
    let ready: Vec<usize> = (0..replies.len()).filter(|i| matches!(replies[*i], Reply::Ready)).collect();
    let first = replies.iter().position(|reply| matches!(reply, Reply::Command { .. }));
    assert!(ready.len() == 1 && first.is_some_and(|first| ready[0] < first), "{ready:?} {first:?}");
    let Some(Reply::Account(account)) = replies.last() else { panic!("no account: {:?}", replies.last()) };
    assert_eq!((account.ledger.unaccounted(), account.ledger.ticks.due), (0, 300));
    assert_eq!((account.line.frames.unaccounted(), account.line.damaged), (0, 0));
    assert_eq!(account.state, Mode::Run as u32);
}

#[test]
fn commands_are_the_controllers_in_both_precisions() {
    commands_are_the_controllers::<f64>();
    commands_are_the_controllers::<f32>();
}

#[test]
fn requests_out_of_place_are_refused() {
    let bytes = encoded(&table());
    let begin = |bytes| *loading(bytes, ClockSource::Frames).last().unwrap();
    let refusal = |requests: &[Request<'_>]| match answers::<f64>(&mut Bench::default(), requests).last() {
        Some(Reply::Refused(refusal)) => *refusal,
        other => panic!("{other:?}"),
    };
    assert_eq!(refusal(&[Request::Account]), Refusal::Order);
    assert_eq!(refusal(&[Request::Table { offset: 3, bytes: &[0] }]), Refusal::Offset { expected: 0 });
    assert_eq!(
        refusal(&[begin(&bytes)]),
        Refusal::Table { code: crate::contract::TableError::TooShort { bytes: 0 }.code() }
    );
    let single = encoded(&table().cast::<f32>());
    let kind = crate::contract::TableError::ScalarKind { found: ScalarKind::F32, expected: ScalarKind::F64 };
    assert_eq!(refusal(&loading(&single, ClockSource::Frames)), Refusal::Table { code: kind.code() });
    let mut requests = loading(&bytes, ClockSource::Frames);
    requests.pop();
    requests.push(Request::Begin { settings: Settings::new(0, 1, 1), clock: ClockSource::Frames });
    assert_eq!(refusal(&requests), Refusal::Settings);
    let too_much = std::vec![0; TABLE_CHUNK_BYTES];
    let pieces: Vec<_> = (0..=TABLE_BYTES / TABLE_CHUNK_BYTES)
        .map(|i| Request::Table { offset: (i * TABLE_CHUNK_BYTES) as u32, bytes: &too_much })
        .collect();
    assert_eq!(refusal(&pieces), Refusal::TooLarge);
    let mut twice = loading(&bytes, ClockSource::Frames);
    twice.push(begin(&bytes));
    assert_eq!(refusal(&twice), Refusal::Order);
}

#[test]
fn of_two_samples_the_newer_one_is_kept() {
    let last = u32::MAX;
    for (first, second, newer) in [(3, 4, 4), (4, 3, 4), (last, 0, 0), (0, last, 0)] {
        let mut kept = None;
        keep_newest(&mut kept, first, |sequence| *sequence);
        assert_eq!(kept, Some(first));
        keep_newest(&mut kept, second, |sequence| *sequence);
        assert_eq!(kept, Some(newer), "{first}, then {second}");
    }
}

#[test]
fn the_board_releases_its_own_steps_without_drift() {
    // 100 µs per look: about ten looks per period, and the counter wraps.
    let mut bench = Bench { speed: 100, counter: COUNTER_MASK - 5_000, ..Bench::default() };
    let bytes = encoded(&table());
    let mut requests = loading(&bytes, ClockSource::Board);
    let start_ns = 5_000 * MS;
    requests.push(Request::Time { tick: 0, time_ns: start_ns });
    // Empty words on the line keep it open while the board's time goes on.
    requests.extend(std::iter::repeat_n(Request::Rearm, 400));
    let replies = answers::<f64>(&mut bench, &requests);
    let times: Vec<(u64, u64)> = replies
        .iter()
        .filter_map(|reply| match reply {
            Reply::Command { command, .. } => Some((command.tick, command.time_ns)),
            _ => None,
        })
        .collect();
    assert!(times.len() > 20, "{} steps", times.len());
    for (tick, time_ns) in times {
        let due_ns = start_ns + (tick + 1) * MS;
        assert!((due_ns..due_ns + MS / 2).contains(&time_ns), "tick {tick} at {time_ns}");
    }
}

#[test]
fn the_watchdog_is_served_and_its_proof_test_stops_that() {
    let mut bench = Bench::default();
    answers::<f64>(&mut bench, &[HELLO, Request::TestWatchdog]);
    assert!(bench.hung && bench.served > 0);
}

#[test]
fn the_last_word_is_a_safe_command_that_moves_nothing() {
    let mut memory = std::boxed::Box::new(Memory::<f64>::new());
    let mut reader = FrameReader::new();
    let arrival = memory.last_word().iter().filter_map(|byte| reader.feed(*byte)).last();
    assert_eq!(arrival, Some(Frame::Start));
    let Some(Reply::Command { command, .. }) = reader.message::<Reply>() else { panic!("no command") };
    assert_eq!((command.state, command.is_valid()), (Mode::Safe as u32, false));
    assert_eq!(command.faults, Faults::WATCHDOG.bits());
    assert!(memory.last_word().len() <= 96, "fits where an exception finds it");
}

/// A run in RUN, then these requests, then some more of the insertion: the mode at its end and the replies in between.
fn disturbed(disturbance: &[u8]) -> (Mode, Vec<Reply>) {
    let bytes = encoded(&table());
    let expected = insertion::<f64>(200);
    let mut writer = FrameWriter::new();
    let mut stream = Vec::new();
    let requests = [HELLO].into_iter().chain(loading(&bytes, ClockSource::Frames));
    let (before, after) = expected.split_at(100);
    for request in requests.chain(before.iter().flat_map(|(inputs, _)| requests_of(inputs))) {
        stream.extend_from_slice(writer.encode(&request).unwrap());
    }
    stream.extend_from_slice(disturbance);
    for (inputs, _) in after {
        for request in requests_of(inputs) {
            stream.extend_from_slice(writer.encode(&request).unwrap());
        }
    }
    let mut bench = Bench { to_device: stream.into(), ..Bench::default() };
    let replies = answers_of::<f64>(&mut bench);
    let commands: Vec<_> = replies
        .iter()
        .filter_map(|reply| match reply {
            Reply::Command { command, .. } => Some(*command),
            _ => None,
        })
        .collect();
    assert!(!bench.hung, "the proof test of the watchdog ran in RUN");
    assert!(commands.iter().eq(expected.iter().map(|(_, command)| command)), "the run went on as if undisturbed");
    let others = replies.into_iter().filter(|reply| !matches!(reply, Reply::Command { .. })).collect();
    (Mode::from_wire(commands.last().unwrap().state).unwrap(), others)
}

#[test]
fn no_request_ends_or_resets_a_run_in_run() {
    let bytes = encoded(&table());
    // Frames of the run itself, sent again: the Hello that began it, and all that followed.
    let mut writer = FrameWriter::new();
    let mut again: Vec<Vec<u8>> = Vec::new();
    let requests = [HELLO].into_iter().chain(loading(&bytes, ClockSource::Frames));
    for request in requests.chain(insertion::<f64>(100).iter().flat_map(|(inputs, _)| requests_of(inputs))) {
        again.push(writer.encode(&request).unwrap().to_vec());
    }
    let (mode, _) = disturbed(&again[..5].concat());
    assert_eq!(mode, Mode::Run);
    disturbed(&again.concat());
    // A host that knows nothing of the run.
    let stranger = FrameWriter::new().encode(&Request::Hello { session: 7 }).unwrap().to_vec();
    let (_, replies) = disturbed(&stranger);
    assert_eq!(replies.last(), Some(&Reply::Refused(Refusal::Session { current: 1 })));
    // Frame 0 with any other message is no start.
    for request in [Request::Rearm, Request::TestWatchdog, Request::Time { tick: 1 << 40, time_ns: 1 << 60 }] {
        let frame = FrameWriter::new().encode(&request).unwrap().to_vec();
        disturbed(&frame);
    }
}

/// Before a run as in it: an old frame sent again.
#[test]
fn frame_0_with_anything_but_a_hello_asks_for_nothing() {
    for request in [Request::Account, Request::Rearm, Request::TestWatchdog] {
        let frame = FrameWriter::new().encode(&request).unwrap().to_vec();
        let mut bench = Bench { to_device: frame.into(), ..Bench::default() };
        let replies = answers_of::<f64>(&mut bench);
        assert!(!bench.hung, "the proof test of the watchdog ran");
        assert!(matches!(replies[..], [Reply::Hello(_)]), "{request:?}: {replies:?}");
    }
}

/// A step that was asked for too late is not made: its time has passed.
#[test]
fn a_request_to_step_that_comes_after_the_next_frame_is_no_step() {
    let bytes = encoded(&table());
    let expected = insertion::<f64>(200);
    let mut writer = FrameWriter::new();
    let mut frames: Vec<Vec<u8>> = Vec::new();
    let mut late = 0;
    for request in [HELLO].into_iter().chain(loading(&bytes, ClockSource::Frames)) {
        frames.push(writer.encode(&request).unwrap().to_vec());
    }
    for (i, (inputs, _)) in expected.iter().enumerate() {
        for request in requests_of(inputs) {
            frames.push(writer.encode(&request).unwrap().to_vec());
        }
        if i == 100 {
            late = frames.len() - 1;
        }
    }
    frames.swap(late, late + 1);
    let mut bench = Bench { to_device: frames.concat().into(), ..Bench::default() };
    let ticks = answers_of::<f64>(&mut bench).into_iter().filter_map(|reply| match reply {
        Reply::Command { command, .. } => Some(command.tick),
        _ => None,
    });
    assert!(ticks.eq((0..200).filter(|tick| *tick != 100)));
}

#[test]
fn the_watchdog_is_not_tested_and_nothing_rearmed_in_run() {
    let bytes = encoded(&table());
    for request in [Request::Rearm, Request::TestWatchdog] {
        let expected = insertion::<f64>(200);
        let mut requests = loading(&bytes, ClockSource::Frames);
        for (i, (inputs, _)) in expected.iter().enumerate() {
            if i == 100 {
                requests.push(request);
            }
            requests.extend(requests_of(inputs));
        }
        let mut bench = Bench::default();
        let replies = answers::<f64>(&mut bench, &requests);
        assert!(!bench.hung);
        assert!(replies.contains(&Reply::Refused(Refusal::Order)), "{request:?}");
        let Some(Reply::Command { command, .. }) = replies.last() else { panic!("no command") };
        assert_eq!(Some(command), expected.last().map(|(_, command)| command), "{request:?}");
    }
}

#[test]
fn the_watchdog_can_be_tested_and_a_run_rearmed_in_safe() {
    let bytes = encoded(&table());
    let mut requests = loading(&bytes, ClockSource::Frames);
    let run = insertion::<f64>(200);
    requests.extend(run.iter().flat_map(|(inputs, _)| requests_of(inputs)));
    // Nothing but time goes on: too long for anybody who controls.
    requests.extend((200..2000).map(|tick| Request::Time { tick, time_ns: tick * MS }));
    requests.extend([Request::Rearm, Request::Time { tick: 2000, time_ns: 2000 * MS }, Request::TestWatchdog]);
    let mut bench = Bench::default();
    let replies = answers::<f64>(&mut bench, &requests);
    let states = replies.iter().filter_map(|reply| match reply {
        Reply::Command { command, .. } => Some(command.state),
        _ => None,
    });
    let states: Vec<u32> = states.collect();
    assert_eq!(states[states.len() - 2..], [Mode::Safe as u32, Mode::Hold as u32]);
    assert!(!bench.hung && replies.contains(&Reply::Refused(Refusal::Order)), "not in SAFE any more");
    let safe: Vec<Request<'_>> = requests.into_iter().filter(|request| *request != Request::Rearm).collect();
    answers::<f64>(&mut bench, &safe);
    assert!(bench.hung);
}

/// Every piece of a table is answered with how much of it is there.
#[test]
fn pieces_of_a_table_are_counted() {
    let bytes = encoded(&table());
    let taken: Vec<usize> = answers::<f64>(&mut Bench::default(), &loading(&bytes, ClockSource::Frames))
        .iter()
        .filter_map(|reply| if let Reply::Taken { bytes } = reply { Some(*bytes as usize) } else { None })
        .collect();
    let ends: Vec<usize> = (TABLE_CHUNK_BYTES..bytes.len()).step_by(TABLE_CHUNK_BYTES).chain([bytes.len()]).collect();
    assert_eq!(taken, ends);
}

/// What a step took is the difference of two looks at the counter, also where it has begun again in between.
#[test]
fn the_counts_of_a_step_are_those_between_two_looks() {
    let bytes = encoded(&table());
    for counter in [0, COUNTER_MASK - 12_345] {
        let mut requests = loading(&bytes, ClockSource::Frames);
        requests.extend(insertion::<f64>(300).iter().flat_map(|(inputs, _)| requests_of(inputs)));
        let mut bench = Bench { counter, speed: 700, ..Bench::default() };
        let replies = answers::<f64>(&mut bench, &requests);
        let counts = replies.iter().filter_map(|reply| match reply {
            Reply::Command { counts, .. } => Some(*counts),
            _ => None,
        });
        let counts: Vec<u32> = counts.collect();
        assert!(counts.len() == 300 && counts.iter().all(|counts| *counts == 700), "from {counter}: {counts:?}");
    }
}

#[test]
fn a_host_that_knows_the_run_ends_it() {
    let bytes = encoded(&table());
    let mut requests = loading(&bytes, ClockSource::Frames);
    requests.extend(insertion::<f64>(100).iter().flat_map(|(inputs, _)| requests_of(inputs)));
    requests.push(Request::Hello { session: 1 });
    requests.push(Request::Account);
    let replies = answers::<f64>(&mut Bench::default(), &requests);
    let [.., Reply::Hello(_), Reply::Refused(Refusal::Order)] = replies[..] else { panic!("{:?}", replies.last()) };
}

#[test]
fn an_account_with_every_counter_full_fits_into_a_frame() {
    let stream = StreamLedger {
        delivered: u64::MAX,
        published: u64::MAX,
        consumed: u64::MAX,
        lost: u64::MAX,
        discarded: [u64::MAX; Discard::ALL.len()],
        duplicates: u64::MAX,
        strays: u64::MAX,
    };
    let most = u64::MAX;
    let ticks = TickLedger { due: most, run: most, hold: most, safe: most, skipped: most };
    let line = LineLedger { frames: stream, damaged: most, unknown: most, starts: most, replayed_starts: most };
    let ledger = Ledger { needle: stream, target: stream, paddles: [stream; 2], ticks };
    let account = Account { ledger, line, state: u32::MAX, faults: Faults::from_bits(most), stack_bytes: u32::MAX };
    let mut writer = FrameWriter::new();
    writer.encode(&HELLO).unwrap();
    assert!(writer.encode(&Reply::Account(account)).is_some());
}

#[test]
fn the_newer_of_two_samples_is_kept_up_to_half_the_range_ahead() {
    const HALF: u32 = u32::MAX / 2;
    for start in [0, 7, u32::MAX - 2] {
        for (ahead, kept) in [(1, true), (HALF, true), (HALF + 1, false), (u32::MAX, false), (0, true)] {
            let (first, second) = ((start, 'a'), (start.wrapping_add(ahead), 'b'));
            let mut newest = Some(first);
            keep_newest(&mut newest, second, |sample| sample.0);
            assert_eq!(newest == Some(second), kept, "{ahead} ahead of {start}");
        }
    }
}

/// The offset is the largest that a message was not too late to show, and is forgotten at the rate that crystals drift.
#[test]
fn a_message_that_is_late_does_not_set_the_clock_back_and_drift_does() {
    let mut bench = Bench::default();
    let mut now = Now::new(0);
    let told = 5_000_000_000;
    now.set(&mut bench, told);
    // 0.5 s later by the board's counter of 1 MHz; the message was 0.1 s on its way.
    bench.counter = 500_000;
    now.set(&mut bench, told + 400_000_000);
    let forgotten = 500_000_000 / DRIFT;
    assert_eq!(now.read(&mut bench), Some(told + 500_000_000 - forgotten));
    // One that was faster than the first counts as it is.
    bench.counter = 600_000;
    now.set(&mut bench, told + 600_500_000);
    assert_eq!(now.read(&mut bench), Some(told + 600_500_000));
}

/// Two paddles in space: every sample goes to its paddle's place, whatever comes first, and one of neither to the first.
#[test]
fn a_device_in_space_moves_two_paddles() {
    let bytes = encoded(&crate::controller::space_table());
    let expected = crate::controller::space_insertion(300);
    let mut requests = loading(&bytes, ClockSource::Frames);
    for (tick, (inputs, _)) in expected.iter().enumerate() {
        let mut swapped = *inputs;
        if tick % 2 == 1 {
            swapped.paddles.reverse();
        }
        requests.extend(requests_of(&swapped));
    }
    let mut bench = Bench::default();
    say(&mut bench, &requests);
    let mut memory = std::boxed::Box::new(Memory::<f64, 3, 2, 2, SPATIAL_TABLE_BYTES>::new());
    let replies = answers_with(&mut bench, &mut memory);
    let commands: Vec<_> = replies
        .iter()
        .filter_map(|reply| match reply {
            Reply::Command { command, .. } => Some(*command),
            _ => None,
        })
        .collect();
    assert!(commands.iter().eq(expected.iter().map(|(_, command)| command)));
    assert_eq!(commands.last().map(|command| command.state), Some(Mode::Run as u32));
    let Some(Reply::Hello(identity)) = replies.first() else { panic!("no Hello") };
    assert_eq!((identity.dimension, identity.paddles), (3, 2));
    // The table of a plane is refused there.
    let planar = encoded(&table());
    let mut bench = Bench::default();
    say(&mut bench, &loading(&planar, ClockSource::Frames));
    let refused = Refusal::Table { code: crate::contract::TableError::Dimension { found: 2, expected: 3 }.code() };
    assert_eq!(answers_with(&mut bench, &mut memory).last(), Some(&Reply::Refused(refused)));
}
