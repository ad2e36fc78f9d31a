use firmware::contract::{NeedleSample, PaddleCommand, TargetSample};
use firmware::{Inputs, Settings};

use super::*;

fn recording(ticks: u64) -> Recording {
    let records = (0..ticks)
        .map(|tick| Record {
            tick: ControllerTick {
                inputs: Inputs {
                    tick,
                    time_ns: tick * 1_000_000,
                    needle: Some(NeedleSample {
                        sequence: tick as u32,
                        depth: 1e-3 * tick as f64,
                        ..NeedleSample::default()
                    }),
                    target: tick.is_multiple_of(2).then(TargetSample::default),
                    paddles: [None; 2],
                },
                command: PaddleCommand {
                    tick,
                    displacement: [[0.1, -0.0, 0.0], [0.0; 3]],
                    faults: 1 << 40,
                    ..PaddleCommand::default()
                },
            },
            truth: (tick > 0).then_some(Truth {
                tick,
                time_ns: tick * 1_000_000,
                depth: 0.5,
                target: [1.0, 2.0, -0.0],
                paddles: [[3.0, 4.0, 5.0], [6.0, -7.0, 1e-300]],
            }),
        })
        .collect();
    Recording {
        header: RecordingHeader {
            mode: RunMode::Lockstep,
            seed: 7,
            scene_hash: [9; 32],
            settings: Settings { loop_gain: Some(0.25), ..Settings::new(1_000_000, 20_000_000, 20_000_000) },
            table: vec![1, 2, 3, 4, 5],
        },
        records,
    }
}

#[test]
fn a_recording_survives_its_file() {
    let recording = recording(5);
    assert_eq!(Recording::decode(&recording.encode()), Ok(recording));
}

#[test]
fn every_altered_byte_is_found() {
    let bytes = recording(3).encode();
    for position in 0..bytes.len() {
        for flip in [0x01, 0x80] {
            let mut altered = bytes.clone();
            altered[position] ^= flip;
            assert!(Recording::decode(&altered).is_err(), "byte {position} of {}", bytes.len());
        }
    }
}

#[test]
fn every_truncation_is_found() {
    let bytes = recording(3).encode();
    for length in 0..bytes.len() {
        assert!(Recording::decode(&bytes[..length]).is_err(), "{length}");
    }
    let cut = &bytes[..bytes.len() - RECORD_BYTES];
    assert_eq!(Recording::decode(cut), Err(RecordingError::Unfinished { records: 3 }));
    let mut longer = bytes.clone();
    longer.push(0);
    assert_eq!(Recording::decode(&longer), Err(RecordingError::Trailing { bytes: 1 }));
}

#[test]
fn the_place_of_an_alteration_is_told() {
    let recording = recording(4);
    let mut bytes = recording.encode();
    let third_from_the_end = bytes.len() - 3 * RECORD_BYTES;
    bytes[third_from_the_end + 20] ^= 1;
    assert_eq!(Recording::decode(&bytes), Err(RecordingError::Chain { record: 2 }));
}

/// Whatever happens to a recording, what is salvaged is what was recorded up to the damage, and the damage is named.
#[test]
fn what_is_salvaged_was_recorded() {
    let recording = recording(4);
    let bytes = recording.encode();
    let header = bytes.len() - 5 * RECORD_BYTES;
    let salvaged = |bytes: &[u8]| Recording::whole_records(bytes).unwrap();
    assert_eq!(salvaged(&bytes), Salvaged { recording: recording.clone(), damage: None });
    for position in header..bytes.len() {
        let before = (position - header) / RECORD_BYTES;
        let mut altered = bytes.clone();
        altered[position] ^= 0x10;
        let found = salvaged(&altered);
        assert_eq!(found.recording.records, recording.records[..before], "byte {position}");
        assert_eq!(found.damage, Some(RecordingError::Chain { record: before }));
        assert_eq!(Recording::growing(&altered), Err(RecordingError::Chain { record: before }));
        let found = salvaged(&bytes[..position]);
        assert_eq!(found.recording.records, recording.records[..before], "cut at {position}");
        assert_eq!(found.damage, Some(RecordingError::Unfinished { records: before }));
    }
    let mut longer = bytes;
    longer.push(0);
    assert_eq!(salvaged(&longer), Salvaged { recording, damage: Some(RecordingError::Trailing { bytes: 1 }) });
    assert_eq!(Recording::whole_records(&longer[..header - 1]), Err(RecordingError::Header));
}
