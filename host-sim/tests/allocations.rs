//! What the loop allocates: nothing in the controller's step; in the exchange no more than the transport's own.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use firmware::contract::{NeedleSample, PaddleCommand, PaddleSample, TargetSample};
use firmware::io::run_tick;
use firmware::{Controller, Inputs, Mode, Settings, State};
use host_sim::bench::paper_table::paper_table;
use host_sim::exchange::{ControllerPorts, Departure, PlantPorts, Space};
use host_sim::record::recording::RecordingHeader;
use host_sim::record::recording::stream::StreamRecorder;
use host_sim::runtime::accounting::tick::ControllerTick;
use host_sim::runtime::controller::TickRecorder as _;
use host_sim::runtime::time::mode::RunMode;
use iceoryx2::service::ipc;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// Counts the allocations of each thread.
struct Counting;

// SAFETY: every call goes to the system's allocator as it came; the counter is a thread-local without a destructor and
// allocates nothing itself.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller keeps the contract of `realloc`.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// Allocations of this thread during `act`.
fn allocations(act: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.with(Cell::get);
    act();
    ALLOCATIONS.with(Cell::get) - before
}

const MS: u64 = 1_000_000;
const TICKS: u64 = 2000;

fn samples(tick: u64, paddle: [f64; 3]) -> (NeedleSample, Option<TargetSample>, PaddleSample) {
    let (sequence, time_ns) = (tick as u32, tick * MS);
    let depth = 1e-5 * tick as f64;
    let wobble = if (tick / 20).is_multiple_of(2) { 1e-6 } else { -1e-6 };
    let target = TargetSample { sequence: (tick / 20) as u32, flags: 1, time_ns, displacement: [wobble, 0.0, 0.0] };
    (
        NeedleSample { sequence, reserved: 0, time_ns, depth, velocity: 0.01 },
        tick.is_multiple_of(20).then_some(target),
        PaddleSample { sequence, paddle_index: 3, time_ns, displacement: paddle },
    )
}

#[test]
fn the_counter_counts() {
    assert!(allocations(|| drop(std::hint::black_box(Box::new(7)))) == 1);
}

#[test]
fn the_step_allocates_nothing() {
    let table = paper_table().unwrap();
    let controller = Controller::new(&table, &Settings::new(MS, 20 * MS, 0)).unwrap();
    let mut state = State::<f64>::new();
    let mut command = PaddleCommand::default();
    let mut in_run = 0;
    let count = allocations(|| {
        for tick in 0..TICKS {
            let (needle, target, paddle) = samples(tick, command.displacement[0]);
            let inputs =
                Inputs { tick, time_ns: tick * MS, needle: Some(needle), target, paddles: [Some(paddle), None] };
            command = controller.step(&mut state, &inputs);
            in_run += u64::from(state.mode() == Mode::Run);
        }
    });
    assert_eq!(count, 0);
    assert!(in_run > TICKS - 10, "the law itself was measured: {in_run} ticks in RUN");
}

#[test]
fn the_loop_allocates_no_more_than_its_transport() {
    let table = paper_table().unwrap();
    let settings = Settings::new(MS, 20 * MS, 0);
    let controller = Controller::new(&table, &settings).unwrap();
    let mut state = State::<f64>::new();
    let space = Space::new(&format!("test-allocations-{}", std::process::id())).unwrap();
    let mut plant = PlantPorts::<ipc::Service>::open(&space).unwrap();
    let mut ports = ControllerPorts::<ipc::Service>::open(&space).unwrap();
    plant.connect().unwrap();
    ports.connect().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let header = RecordingHeader { mode: RunMode::Lockstep, seed: 0, scene_hash: [0; 32], settings, table: Vec::new() };
    let mut recorder = StreamRecorder::create(&folder.path().join("log.rec"), &header).unwrap();
    let mut displacement = [0.0; 3];
    let (mut reading, mut ticking, mut recording) = (0, 0, 0);
    for tick in 0..TICKS {
        let (needle, target, paddle) = samples(tick, displacement);
        plant.paddle.send(paddle).unwrap();
        if let Some(target) = target {
            plant.target.send(target).unwrap();
        }
        plant.needle.send(needle).unwrap();
        let mut exchange = ControllerTick::default();
        ticking += allocations(|| {
            let (inputs, command) = run_tick(&controller, &mut state, tick, tick * MS, &mut ports).unwrap();
            exchange = ControllerTick { inputs, command };
        });
        recording += allocations(|| recorder.record(&exchange));
        reading += allocations(|| displacement = plant.command.newest().unwrap().unwrap().displacement[0]);
    }
    // iceoryx2 allocates once for each frame that is lent out for sending; a tick sends one command.
    assert!(ticking <= TICKS, "{ticking} allocations in {TICKS} ticks");
    // Receiving gives frames back to their lender, for which it allocates now and then.
    assert!(reading <= TICKS / 10, "{reading} allocations in {TICKS} receptions");
    assert_eq!(recording, 0);
    assert_eq!(Box::new(recorder).finish().unaccounted(), 0);
    drop((plant, ports));
    space.leave::<ipc::Service>(Departure::Last);
}
