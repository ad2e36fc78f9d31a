//! Recordings while they happen: the loop hands over, a thread of its own writes. The loop never waits for a disk.
//!
//! What does not fit into the ring, or not onto the disk, is lost and counted. A process that is killed leaves whole
//! records behind; only the end mark is missing then.

use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;

use super::{Chain, Record, RecordingHeader};
use crate::record::error::FileError;
use crate::runtime::accounting::accounts::RecordAccount;
use crate::runtime::accounting::tick::ControllerTick;
use crate::runtime::controller::TickRecorder;

/// Ticks that wait for the writer: two seconds at 1 kHz, more than any disk takes to answer.
const RING: usize = 2048;
/// How often the writer looks.
const NAP: Duration = Duration::from_millis(5);

/// A recording in the making.
#[derive(Debug)]
pub struct StreamRecorder {
    producer: Producer<ControllerTick>,
    offered: u64,
    lost: u64,
    stop: Arc<AtomicBool>,
    writer: JoinHandle<RecordAccount>,
}

impl StreamRecorder {
    /// Opens the file and starts its writer. What was in the file is replaced when the first tick is written: a controller
    /// that no plant comes to takes nobody's recording away.
    ///
    /// # Errors
    /// [`FileError::Write`] when there can be no such file, or another process is recording into it.
    pub fn create(path: &Path, header: &RecordingHeader) -> Result<Self, FileError> {
        let file = open_alone(path).map_err(FileError::write(path))?;
        let (producer, consumer) = RingBuffer::new(RING);
        let stop = Arc::new(AtomicBool::new(false));
        let (chain, start) = Chain::start(header);
        let account = RecordAccount::default();
        let writer = FileWriter { file, chain, started: false, consumer, stop: Arc::clone(&stop), account };
        let writer = std::thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || writer.run(&start))
            .map_err(FileError::write(path))?;
        Ok(Self { producer, offered: 0, lost: 0, stop, writer })
    }
}

impl TickRecorder for StreamRecorder {
    /// Hands a tick over; neither waits nor allocates.
    fn record(&mut self, tick: &ControllerTick) {
        self.offered += 1;
        self.lost += u64::from(self.producer.push(*tick).is_err());
    }

    /// Writes what waits and the end mark.
    fn finish(self: Box<Self>) -> RecordAccount {
        self.stop.store(true, Ordering::Release);
        let written = self.writer.join().unwrap_or_default();
        RecordAccount { offered: self.offered, lost_in_ring: self.lost, ..written }
    }
}

/// Opens a file as it is; a regular one locked, so that nobody else records into it.
fn open_alone(path: &Path) -> std::io::Result<File> {
    let file = File::options().write(true).create(true).truncate(false).open(path)?;
    if file.metadata()?.is_file() {
        match flock(&file, FlockOperation::NonBlockingLockExclusive) {
            Err(Errno::WOULDBLOCK) => return Err(std::io::Error::other("another process is recording into it")),
            outcome => outcome?,
        }
    }
    Ok(file)
}

struct FileWriter {
    file: File,
    chain: Chain,
    /// Whether the file has this recording's start.
    started: bool,
    consumer: Consumer<ControllerTick>,
    stop: Arc<AtomicBool>,
    account: RecordAccount,
}

impl FileWriter {
    fn run(mut self, start: &[u8]) -> RecordAccount {
        loop {
            // Read before draining: what was handed over before the stop is drained after it.
            let last = self.stop.load(Ordering::Acquire);
            let mut bytes = Vec::new();
            let mut records = 0;
            while let Ok(tick) = self.consumer.pop() {
                self.chain.record(&Record { tick, truth: None }, &mut bytes);
                records += 1;
            }
            if records > 0 || last && self.is_empty() {
                self.begin(start);
            }
            if self.account.error.is_some() || !self.write(&bytes) {
                self.account.lost_on_disk += records;
            } else {
                self.account.written += records;
            }
            if last {
                let mut end = Vec::new();
                self.chain.end(self.account.written, &mut end);
                if self.started && self.account.error.is_none() {
                    self.write(&end);
                    self.keep(|file| file.sync_all());
                }
                return self.account;
            }
            std::thread::sleep(NAP);
        }
    }

    /// Whether the file has nothing yet: a recording without ticks is one, but replaces none.
    fn is_empty(&self) -> bool {
        self.file.metadata().is_ok_and(|metadata| metadata.len() == 0)
    }

    /// Replaces what is in the file by the start of this recording, once.
    fn begin(&mut self, start: &[u8]) {
        if self.started {
            return;
        }
        self.started = true;
        // Devices and pipes have no length.
        let is_file = self.file.metadata().is_ok_and(|metadata| metadata.is_file());
        self.keep(|file| if is_file { file.set_len(0) } else { Ok(()) });
        if self.account.error.is_none() {
            self.write(start);
        }
    }

    fn write(&mut self, bytes: &[u8]) -> bool {
        self.keep(|file| file.write_all(bytes))
    }

    /// Remembers the first failure.
    fn keep(&mut self, act: impl FnOnce(&mut File) -> std::io::Result<()>) -> bool {
        match act(&mut self.file) {
            Ok(()) => true,
            Err(error) => {
                self.account.error.get_or_insert(error.to_string());
                false
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use firmware::Settings;

    use super::*;
    use crate::record::error::RecordingError;
    use crate::record::recording::Recording;
    use crate::runtime::time::mode::RunMode;

    fn header() -> RecordingHeader {
        let settings = Settings::new(1_000_000, 20_000_000, 0);
        RecordingHeader { mode: RunMode::FreeRun, seed: 1, scene_hash: [0; 32], settings, table: vec![1, 2, 3] }
    }

    #[test]
    fn what_is_streamed_is_a_recording() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stream.rec");
        let mut recorder = StreamRecorder::create(&path, &header()).unwrap();
        let at =
            |tick| ControllerTick { inputs: firmware::Inputs { tick, ..Default::default() }, ..Default::default() };
        (0..500).for_each(|tick| recorder.record(&at(tick)));
        let account = Box::new(recorder).finish();
        assert_eq!((account.offered, account.written, account.unaccounted()), (500, 500, 0));
        let bytes = std::fs::read(&path).unwrap();
        let records = (0..500).map(|tick| Record { tick: at(tick), truth: None }).collect();
        assert_eq!(bytes, Recording { header: header(), records }.encode(), "the same bytes as written at once");
        let cut = &bytes[..bytes.len() - 1000];
        assert!(matches!(Recording::decode(cut), Err(RecordingError::Unfinished { .. })));
        assert!(Recording::growing(cut).is_ok());
        let salvaged = Recording::whole_records(cut).unwrap();
        assert!(matches!(salvaged.damage, Some(RecordingError::Unfinished { records }) if records > 490));
        assert!(salvaged.recording.records.len() > 490);
    }

    #[test]
    fn a_recording_is_replaced_by_ticks_alone_and_by_one_process_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stream.rec");
        std::fs::write(&path, b"an hour on the bench").unwrap();
        let idle = StreamRecorder::create(&path, &header()).unwrap();
        let refused = StreamRecorder::create(&path, &header()).unwrap_err();
        assert!(std::error::Error::source(&refused).unwrap().to_string().contains("another process"), "{refused}");
        Box::new(idle).finish();
        assert_eq!(std::fs::read(&path).unwrap(), b"an hour on the bench");
        let mut recorder = StreamRecorder::create(&path, &header()).unwrap();
        recorder.record(&ControllerTick::default());
        Box::new(recorder).finish();
        let replaced = Recording::decode(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(replaced.records.len(), 1);
        let (fresh, empty) = (folder.path().join("fresh.rec"), Recording { header: header(), records: Vec::new() });
        Box::new(StreamRecorder::create(&fresh, &header()).unwrap()).finish();
        assert_eq!(std::fs::read(&fresh).unwrap(), empty.encode(), "no tick is a recording as well");
    }

    #[test]
    fn a_full_disk_is_counted_and_nothing_else() {
        let mut recorder = StreamRecorder::create(Path::new("/dev/full"), &header()).unwrap();
        (0..500).for_each(|_| recorder.record(&ControllerTick::default()));
        let account = Box::new(recorder).finish();
        assert_eq!((account.written, account.lost_on_disk + account.lost_in_ring), (0, 500));
        assert!(account.error.is_some() && account.unaccounted() == 0);
    }
}
