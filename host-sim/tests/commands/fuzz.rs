//! Generated input for everything that reads bytes from outside: good bytes, damaged in a few places. `PROPTEST_CASES` says
//! how often; the entries are those of the fuzz targets.

mod entries;

use firmware::serial::{FrameWriter, Request};
use firmware::{Faults, Settings};
use host_sim::exchange::bytes::ByteWriter;
use host_sim::record::recording::{Record, Recording, RecordingHeader};
use host_sim::runtime::accounting::accounts::ControllerAccounts;
use host_sim::runtime::accounting::tick::ControllerTick;
use host_sim::runtime::time::mode::RunMode;
use host_sim::world::truth::Truth;
use proptest::prelude::*;

const SVG: &str = r#"<svg xmlns="http://www.w3.org/2000/svg" width="120mm" height="80mm" viewBox="0 0 120 80">
<g transform="translate(2 3) scale(1.5)"><path d="M0 0 L60 0 C70 0 70 40 60 40 Q30 50 0 40 A20 20 0 0 1 0 0 Z"/></g>
<rect x="30" y="20" width="10" height="10" rx="2"/><circle cx="60" cy="30" r="6"/><ellipse cx="20" cy="30" rx="4" ry="2"/>
<polygon points="5,5 9,5 9,9"/></svg>"#;

/// A drawing with every role.
const SVG_ROLES: &str = include_str!("../../../model-offline/pictures/drawing.svg");

const GMSH_2: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 0.5 0.5 0\n$EndNodes\n\
$Elements\n4\n1 2 2 1 1 1 2 5\n2 2 2 1 1 2 3 5\n3 2 2 1 1 3 4 5\n4 2 2 1 1 4 1 5\n$EndElements\n";

const GMSH_4: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 1 0\n1 0 0 0 1 1 0 0 0\n$EndEntities\n$Nodes\n1 4 1 4\n\
2 1 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n$EndNodes\n$Elements\n1 2 1 2\n2 1 2 2\n1 1 2 3\n2 1 3 4\n$EndElements\n";

const GMSH_NAMES: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n5\n2 1 \"body-liver\"\n1 2 \"fixed\"\n1 3 \"paddle-1\"\n\
1 4 \"needle\"\n0 5 \"target\"\n$EndPhysicalNames\n$Nodes\n5\n1 0 0 0\n2 80 0 0\n3 80 50 0\n4 0 50 0\n5 30 20 0\n$EndNodes\n\
$Elements\n8\n1 2 2 1 1 1 2 5\n2 2 2 1 1 2 3 5\n3 2 2 1 1 3 4 5\n4 2 2 1 1 4 1 5\n5 1 2 2 1 1 2\n6 1 2 3 1 2 3\n7 1 2 4 1 3 4\n\
8 15 2 5 1 5\n$EndElements\n";

/// Two triangles in a binary file of version 2.2 or 4.1.
fn binary_mesh(version: &str) -> Vec<u8> {
    let mut mesh = format!("$MeshFormat\n{version} 1 8\n").into_bytes();
    let int = |mesh: &mut Vec<u8>, numbers: &[i32]| numbers.iter().for_each(|n| mesh.extend(n.to_le_bytes()));
    let size = |mesh: &mut Vec<u8>, numbers: &[u64]| numbers.iter().for_each(|n| mesh.extend(n.to_le_bytes()));
    let point = |mesh: &mut Vec<u8>, x: [f64; 2]| [x[0], x[1], 0.0].iter().for_each(|x| mesh.extend(x.to_le_bytes()));
    let corners = [[0.0, 0.0], [8.0, 0.0], [8.0, 5.0], [0.0, 5.0]];
    int(&mut mesh, &[1]);
    mesh.extend(b"\n$EndMeshFormat\n");
    if version == "2.2" {
        mesh.extend(b"$PhysicalNames\n1\n2 7 \"body\"\n$EndPhysicalNames\n$Nodes\n4\n");
        for (tag, x) in (1..).zip(corners) {
            int(&mut mesh, &[tag]);
            point(&mut mesh, x);
        }
        mesh.extend(b"\n$EndNodes\n$Elements\n2\n");
        int(&mut mesh, &[2, 2, 2, 1, 7, 7, 1, 2, 3, 2, 7, 7, 1, 3, 4]);
    } else {
        mesh.extend(b"$Entities\n");
        size(&mut mesh, &[0, 0, 1, 0]);
        int(&mut mesh, &[1]);
        (0..2).for_each(|_| point(&mut mesh, [8.0, 5.0]));
        size(&mut mesh, &[0, 0]);
        mesh.extend(b"\n$EndEntities\n$Nodes\n");
        size(&mut mesh, &[1, 4, 1, 4]);
        int(&mut mesh, &[2, 1, 0]);
        size(&mut mesh, &[4, 1, 2, 3, 4]);
        corners.iter().for_each(|x| point(&mut mesh, *x));
        mesh.extend(b"\n$EndNodes\n$Elements\n");
        size(&mut mesh, &[1, 2, 1, 2]);
        int(&mut mesh, &[2, 1, 2]);
        size(&mut mesh, &[2, 1, 1, 2, 3, 2, 1, 3, 4]);
    }
    mesh.extend(b"\n$EndElements\n");
    mesh
}

/// What the damages begin with is read: else they would only try the first lines.
#[test]
fn fuzz_begins_with_drawings_and_meshes_that_are_read() {
    use model_offline::scene::import::{ImportOptions, gmsh, svg};
    let options = ImportOptions::default();
    for drawing in seeds("svg") {
        assert!(svg::read(std::str::from_utf8(&drawing).unwrap(), &options).is_ok());
    }
    for mesh in seeds("gmsh") {
        gmsh::read(&mesh, &options).unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&mesh)));
    }
}

fn tick(tick: u64) -> ControllerTick {
    let inputs =
        firmware::Inputs { tick, time_ns: tick * 1_000_000, needle: Some(Default::default()), ..Default::default() };
    ControllerTick { inputs, ..ControllerTick::default() }
}

fn a_recording() -> Vec<u8> {
    let settings = Settings::new(1_000_000, 20_000_000, 0);
    let header =
        RecordingHeader { mode: RunMode::Lockstep, seed: 1, scene_hash: [7; 32], settings, table: vec![1, 2, 3] };
    let truth = |tick| Truth {
        tick,
        time_ns: tick * 1_000_000,
        depth: 0.1,
        target: [0.1, 0.2, 0.0],
        paddles: [[0.0, 0.3, 0.0], [0.0; 3]],
    };
    let records = (0..20).map(|n| Record { tick: tick(n), truth: (n % 2 == 0).then(|| truth(n)) }).collect();
    Recording { header, records }.encode()
}

fn some_accounts() -> Vec<u8> {
    let kept = [tick(0), tick(1)];
    ControllerAccounts { kept: 2, faults: Faults::WATCHDOG, ..ControllerAccounts::default() }.encode(&kept)
}

fn some_ticks() -> Vec<u8> {
    let mut writer = ByteWriter::default();
    (0..3).for_each(|n| tick(n).encode(&mut writer));
    writer.0
}

fn some_frames() -> Vec<u8> {
    let mut writer = FrameWriter::new();
    let (needle, time) = (Request::Needle(Default::default()), Request::Time { tick: 1, time_ns: 2 });
    let requests = [Request::Hello { session: 1 }, needle, time, Request::Account];
    requests.iter().flat_map(|request| writer.encode(request).unwrap_or_default().to_vec()).collect()
}

/// Good bytes for an entry.
fn seeds(entry: &str) -> Vec<Vec<u8>> {
    let text = |texts: &[&str]| texts.iter().map(|text| text.as_bytes().to_vec()).collect();
    match entry {
        "recording" => vec![a_recording()],
        "ticks" => vec![some_ticks()],
        "accounts" => vec![some_accounts()],
        "serial" => vec![some_frames()],
        "scene" => model_offline::scene::BUNDLED.iter().map(|(_, scene)| scene.as_bytes().to_vec()).collect(),
        "svg" => text(&[SVG, SVG_ROLES]),
        "gmsh" => {
            let ascii: Vec<Vec<u8>> = text(&[GMSH_2, GMSH_4, GMSH_NAMES]);
            [ascii, vec![binary_mesh("2.2"), binary_mesh("4.1")]].concat()
        }
        entry => panic!("give good bytes for `{entry}`"),
    }
}

/// One damage: what, where (as a part of the length), and with what.
type Damage = (u8, f64, Vec<u8>);

/// Words that formats give a meaning to.
const WORDS: [&str; 16] = [
    "-1",
    "1e999",
    "NaN",
    "inf",
    "18446744073709551615",
    "9e307",
    "[]",
    "{",
    "\"",
    "\0",
    "\n",
    "0",
    "A",
    "-0.0",
    "\u{feff}",
    "z",
];

fn damaged(mut bytes: Vec<u8>, damages: &[Damage]) -> Vec<u8> {
    for (kind, part, with) in damages {
        let at = ((bytes.len() as f64) * part) as usize;
        let end = (at + with.len()).min(bytes.len());
        match kind % 7 {
            0 => bytes[at..end].iter_mut().zip(with).for_each(|(byte, with)| *byte ^= with),
            1 => drop(bytes.splice(at..end, with.iter().copied())),
            2 => drop(bytes.splice(at..at, with.iter().copied())),
            3 => drop(bytes.drain(at..end)),
            4 => bytes.truncate(at),
            5 => {
                let repeated: Vec<u8> = bytes[at..end].repeat(3);
                drop(bytes.splice(at..end, repeated));
            }
            _ => {
                // A whole word becomes another one.
                let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || b".-+_".contains(byte);
                let end = at + bytes[at..].iter().take_while(|byte| is_word(byte)).count();
                let word = WORDS[with.first().map_or(0, |byte| *byte as usize) % WORDS.len()];
                drop(bytes.splice(at..end, word.bytes()));
            }
        }
    }
    bytes
}

fn damages() -> impl Strategy<Value = Vec<Damage>> {
    prop::collection::vec((any::<u8>(), 0.0..1.0, prop::collection::vec(any::<u8>(), 0..12)), 0..6)
}

fn try_entry(name: &str) {
    let (_, entry) = entries::ENTRIES.into_iter().find(|(entry, _)| *entry == name).unwrap();
    let seeds = seeds(name);
    for seed in &seeds {
        entry(seed);
    }
    let mut runner = prop::test_runner::TestRunner::default();
    let strategy = (any::<prop::sample::Index>(), damages(), prop::collection::vec(any::<u8>(), 0..64));
    runner
        .run(&strategy, |(which, damages, noise)| {
            entry(&damaged(which.get(&seeds).clone(), &damages));
            entry(&noise);
            Ok(())
        })
        .unwrap();
}

/// Nested and long input ends in a refusal, not in a stack that overflows.
#[test]
fn fuzz_deep_and_long_input() {
    for (_, entry) in entries::ENTRIES {
        for piece in ["[", "{", "<g>", "(", "a=[", "\"", "1 ", "<g><path d=\"M0 0L1 0L1 1Z\"/>"] {
            entry(piece.repeat(20_000).as_bytes());
        }
    }
}

macro_rules! entries {
    ($($name:ident: $entry:literal;)*) => {
        $(#[test]
        fn $name() {
            try_entry($entry);
        })*

        #[test]
        fn fuzz_has_every_entry() {
            let tried = [$($entry),*];
            assert_eq!(entries::ENTRIES.map(|(name, _)| name), tried);
        }
    };
}

entries! {
    fuzz_recording: "recording";
    fuzz_ticks: "ticks";
    fuzz_accounts: "accounts";
    fuzz_serial: "serial";
    fuzz_scene: "scene";
    fuzz_svg: "svg";
    fuzz_gmsh: "gmsh";
}
