//! The link over the process-local service variant: no file, no shared memory, the same code.

use firmware::contract::{NeedleSample, PaddleCommand, TargetSample};
use firmware::io::{CommandSink, SampleSource};
use iceoryx2::service::local::Service;

use super::{ClockFrame, ClockKind, ControllerPorts, Departure, LinkError, PlantPorts, Space};

fn both(name: &str) -> (Space, PlantPorts<Service>, ControllerPorts<Service>) {
    let space = Space::new(&format!("test-{name}-{}", std::process::id())).unwrap();
    let plant = PlantPorts::open(&space).unwrap();
    assert!(!plant.has_peer());
    let controller = ControllerPorts::open(&space).unwrap();
    assert!(plant.has_peer() && controller.has_peer());
    plant.connect().unwrap();
    controller.connect().unwrap();
    (space, plant, controller)
}

fn end(space: &Space, plant: PlantPorts<Service>, controller: ControllerPorts<Service>) {
    drop((plant, controller));
    space.leave::<Service>(Departure::Last);
    assert!(!space.root().exists(), "nothing stays behind");
}

#[test]
fn frames_cross_unchanged() {
    let (space, mut plant, mut controller) = both("cross");
    let needle = NeedleSample { sequence: 7, depth: 0.25, velocity: -0.0, ..NeedleSample::default() };
    plant.needle.send(needle).unwrap();
    assert_eq!(controller.needle(), Some(needle));
    assert_eq!(controller.needle(), None, "each frame once");
    assert_eq!(controller.target(), None);

    let command = PaddleCommand { tick: 3, displacement: [[1e-9, 2.0, 0.0], [0.0; 3]], ..PaddleCommand::default() };
    controller.send(&command).unwrap();
    assert_eq!(plant.command.oldest().unwrap(), Some(command));
    end(&space, plant, controller);
}

#[test]
fn a_reader_that_does_not_read_loses_the_oldest_and_knows_how_many() {
    let (space, mut plant, mut controller) = both("overflow");
    for sequence in 0..100 {
        let sample = TargetSample { sequence, ..TargetSample::default() };
        plant.target.send(sample).unwrap();
    }
    assert_eq!(controller.target().map(|sample| sample.sequence), Some(99));
    let [_, target, _] = controller.counts();
    assert_eq!(target.received, target.superseded + 1);
    assert_eq!(plant.target.published(), 100);
    end(&space, plant, controller);
}

#[test]
fn clock_frames_come_in_order_and_unknown_kinds_are_no_kind() {
    let (space, mut plant, mut controller) = both("clock");
    for tick in 0..3 {
        let frame = ClockFrame::new(ClockKind::Step, tick, tick * 10);
        plant.clock.send(frame).unwrap();
    }
    for tick in 0..3 {
        let frame = controller.clock.oldest().unwrap().unwrap();
        assert_eq!((frame.tick, frame.kind()), (tick, Some(ClockKind::Step)));
    }
    let garbage = ClockFrame { kind: 77, ..ClockFrame::default() };
    assert_eq!(garbage.kind(), None);
    end(&space, plant, controller);
}

#[test]
fn a_second_controller_is_refused() {
    let (space, plant, controller) = both("second");
    let second = ControllerPorts::<Service>::open(&space);
    assert!(matches!(second, Err(LinkError::Taken { .. })), "{second:?}");
    end(&space, plant, controller);
}

#[test]
fn names_that_are_no_file_names_are_refused() {
    for name in ["", "../up", "a b", "é", &"x".repeat(41)] {
        assert!(matches!(Space::new(name), Err(LinkError::Name { .. })));
    }
}
