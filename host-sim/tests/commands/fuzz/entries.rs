//! Entries for generated input, the same for the fuzz targets and for the properties: bytes from outside, of which
//! nothing but a typed refusal or a plausible value may come.

use firmware::serial::{Frame, FrameReader, Reply, Request};
use host_sim::exchange::bytes::{ByteReader, ByteWriter};
use host_sim::record::export::{csv, mcap};
use host_sim::record::recording::{Recording, Salvaged};
use host_sim::runtime::accounting::accounts::ControllerAccounts;
use host_sim::runtime::accounting::tick::{ControllerTick, TICK_BYTES};
use model_offline::scene::Scene;
use model_offline::scene::import::{ImportError, ImportOptions, Imported, gmsh, svg};
use model_offline::scene::starter::{self, StarterNames};

/// An entry: its name and what is done with the bytes.
pub(crate) type Entry = (&'static str, fn(&[u8]));

/// All of them.
pub(crate) const ENTRIES: [Entry; 7] = [
    ("recording", recording),
    ("ticks", ticks),
    ("accounts", accounts),
    ("serial", serial),
    ("scene", scene),
    ("svg", svg_drawing),
    ("gmsh", gmsh_mesh),
];

/// A recording: what is read is written back to the same bytes, and what is whole of a damaged one is exported.
pub(crate) fn recording(bytes: &[u8]) {
    if let Ok(recording) = Recording::decode(bytes) {
        assert_eq!(recording.encode(), bytes, "what is read is what was written");
    }
    if let Ok(Salvaged { recording, .. }) = Recording::whole_records(bytes) {
        let series = csv::Series { orthogonal: &nalgebra::Vector2::x(), paddles: 1, length: "mm" };
        let table = series.recording(&recording);
        let lines = table.iter().filter(|byte| **byte == b'\n').count();
        assert_eq!(lines, recording.records.len() + 1);
        assert!(mcap::encode(&recording, &series, mcap::Known::default()).is_ok());
        let in_space = csv::Series { orthogonal: &nalgebra::Matrix3x2::identity(), paddles: 2, length: "mm" };
        assert_eq!(in_space.recording(&recording).iter().filter(|byte| **byte == b'\n').count(), lines);
        assert!(mcap::encode(&recording, &in_space, mcap::Known::default()).is_ok());
    }
}

/// Ticks as a controller hands them over.
pub(crate) fn ticks(bytes: &[u8]) {
    let mut reader = ByteReader(bytes);
    while let Some(tick) = ControllerTick::decode(&mut reader) {
        let mut writer = ByteWriter::default();
        tick.encode(&mut writer);
        assert_eq!(writer.0.len(), TICK_BYTES);
    }
}

/// Accounts as a controller hands them in.
pub(crate) fn accounts(bytes: &[u8]) {
    if let Some((accounts, kept)) = ControllerAccounts::decode(bytes) {
        assert_eq!(accounts.kept, kept.len() as u64);
    }
}

/// Both directions of a board's line.
pub(crate) fn serial(bytes: &[u8]) {
    let mut reader = FrameReader::new();
    for byte in bytes {
        if matches!(reader.feed(*byte), Some(Frame::Start | Frame::New)) {
            let _ = reader.message::<Request<'_>>();
            let _ = reader.message::<Reply>();
        }
    }
}

/// A scene: what is accepted is finite.
pub(crate) fn scene(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(scene) = Scene::parse(text, "generated.toml") {
        assert!(scene.needle.depth.is_finite() && scene.target.iter().all(|x| x.is_finite()));
        assert!((scene.needle.axis.norm() - 1.0).abs() < 1e-9);
        let _ = scene.hash();
    }
}

fn is_plausible(imported: &Imported) {
    for outline in std::iter::once(&imported.outline).chain(imported.inclusions.iter().map(|region| &region.outline)) {
        assert!(outline.vertices().len() > 2);
        assert!(outline.vertices().iter().all(|point| point.iter().all(|x| x.is_finite())));
    }
}

/// A drawing: what is read is finite, and the scene of it is valid or refused by a type.
pub(crate) fn svg_drawing(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    imported(|options| svg::read(text, options));
}

/// A mesh.
pub(crate) fn gmsh_mesh(bytes: &[u8]) {
    imported(|options| gmsh::read(bytes, options));
}

fn imported(read: impl Fn(&ImportOptions<'_>) -> Result<Imported, ImportError>) {
    let names = StarterNames { name: "generated".into(), length: "mm".into(), stress: "kPa".into() };
    for size in [None, Some(120.0)] {
        if let Ok(mut imported) = read(&ImportOptions { size, ..ImportOptions::default() }) {
            is_plausible(&imported);
            let _ = starter::imported(&names, &mut imported);
            let _ = imported.summary.to_string();
        }
    }
}
