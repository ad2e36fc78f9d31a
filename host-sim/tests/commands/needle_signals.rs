//! What a needle that slips meets, in the files of a run: forces that add up, the same in all of them, and a body that has
//! gone the same way.

use std::collections::BTreeMap;
use std::path::Path;

use assert_cmd::Command;

/// A run of the paper's scene in this world with what it can write for other tools.
fn run(folder: &Path, more: &[&str]) -> serde_json::Value {
    let words = "run --quiet --scene paper --tissue inclusion --mode lockstep --insertion-time 1 --mcap --vtu";
    let mut run = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    run.args(words.split(' ')).args(more).arg("--out").arg(folder.join("report")).assert().success();
    serde_json::from_slice(&std::fs::read(folder.join("report/result.json")).unwrap()).unwrap()
}

/// Columns of numbers by the name before the unit.
fn columns(path: &Path) -> BTreeMap<String, Vec<f64>> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let names = lines.next().unwrap();
    assert!(names.iter().all(|name| name.contains(" [") && name.ends_with(']')), "{names:?}");
    let rows: Vec<Vec<String>> = lines.collect();
    let column = |k: usize| rows.iter().map(|row| row[k].parse().unwrap_or(f64::NAN)).collect();
    names.iter().enumerate().map(|(k, name)| (name.split(' ').next().unwrap().to_owned(), column(k))).collect()
}

#[test]
fn forces_add_up_and_are_the_same_in_every_file() {
    for plant in [None, Some("full")] {
        let folder = tempfile::tempdir().unwrap();
        let more: Vec<&str> = ["--world", "shaft,creep", "--rate", "100"]
            .into_iter()
            .chain(plant.iter().flat_map(|plant| ["--plant", plant]))
            .collect();
        let result = run(folder.path(), &more);
        let report = folder.path().join("report");
        for strategy in ["none", "static", "dynamic"] {
            let needle = columns(&report.join(format!("inclusion-{strategy}-needle.csv")));
            let shaft = columns(&report.join(format!("inclusion-{strategy}-shaft.csv")));
            let length = needle["time"].len();
            assert!(length > 50 && needle["time"].windows(2).all(|pair| pair[0] < pair[1]), "{length}");
            let forces = ["base_force", "tip_force", "shaft_friction"].map(|name| &needle[name]);
            for ((base, tip), friction) in forces[0].iter().zip(forces[1]).zip(forces[2]) {
                assert!((base - tip - friction).abs() < 1e-9 * base.abs().max(1.0), "{base} {tip} {friction}");
            }
            // The skin holds first; then what the tip has passed grows, and never beyond the depth.
            let cut = &needle["cut_length"];
            let within = cut.iter().position(|cut| cut.is_finite()).unwrap();
            assert!(within > 2, "the skin gives way at once");
            assert!(cut[within..].windows(2).all(|pair| pair[0] <= pair[1] + 1e-12));
            assert!(cut.iter().zip(&needle["true_depth"]).skip(within).all(|(cut, depth)| *cut <= depth + 1e-9));
            assert_eq!(needle["base_force"][..within], needle["tip_force"][..within]);
            // Friction per length over the length of the shaft is the friction of the other table, by the trapezoidal rule
            // that its points stand for.
            let last = *shaft["time"].last().unwrap();
            let first = shaft["time"].iter().position(|time| *time == last).unwrap();
            let (at, per_length) = (&shaft["arc_length"][first..], &shaft["friction_per_length"][first..]);
            let sum: f64 = (1..at.len()).map(|k| 0.5 * (at[k] - at[k - 1]) * (per_length[k] + per_length[k - 1])).sum();
            let row = needle["time"].iter().position(|time| (time - last).abs() < 1e-9).unwrap();
            let whole = needle["shaft_friction"][row];
            assert!(whole > 0.0 && (sum - whole).abs() < 1e-6 * whole, "{sum} {whole}");
            // The same in the result.
            let points = result["cases"][0]["strategies"][strategy]["needle"]["points"].as_array().unwrap();
            let end = points.last().unwrap();
            assert!((end["base_force"].as_f64().unwrap() - needle["base_force"][length - 1]).abs() < 1e-12);
        }
        let bytes = std::fs::read(report.join("inclusion-dynamic.mcap")).unwrap();
        let messages: Vec<_> = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).collect();
        let forces: Vec<_> = messages.iter().filter(|message| message.channel.topic == "/needle_forces").collect();
        let needle = columns(&report.join("inclusion-dynamic-needle.csv"));
        assert_eq!(forces.len(), needle["time"].len());
        for (message, (time, base)) in forces.iter().zip(needle["time"].iter().zip(&needle["base_force"])) {
            let body: serde_json::Value = serde_json::from_slice(&message.data).unwrap();
            assert!((body["base_force"].as_f64().unwrap() - base).abs() < 1e-12);
            assert!((message.log_time as f64 * 1e-9 - time).abs() < 1e-6, "{} {time}", message.log_time);
        }
    }
}

/// The series for ParaView ends where the run ended, though what it shows depends on everything before.
#[test]
fn a_series_of_bodies_goes_the_way_that_the_run_went() {
    let folder = tempfile::tempdir().unwrap();
    let more = ["--world", "creep,breathing", "--rate", "100", "--wait", "2.5", "--plant", "full"];
    let result = run(folder.path(), &more);
    let dynamic = &result["cases"][0]["strategies"]["dynamic"];
    let points = |value: &serde_json::Value| -> Vec<[f64; 2]> { serde_json::from_value(value.clone()).unwrap() };
    let (rest, end) = (points(&result["geometry"]["nodes"]), points(&dynamic["deformed_nodes"]));
    let last = dynamic["frames"].as_array().unwrap().last().unwrap();
    let moved = rest.iter().zip(&end).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max);
    let off =
        points(&last["nodes"]).iter().zip(&end).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max);
    assert!(off < 0.01 * moved, "{off} of {moved}");
    let vtu = std::fs::read_to_string(folder.path().join("report/inclusion-dynamic-020.vtu")).unwrap();
    let document = roxmltree::Document::parse(&vtu).unwrap();
    let array = document.descendants().find(|node| node.attribute("Name") == Some("displacement")).unwrap();
    let numbers = array.text().unwrap().split_whitespace().map(|word| word.parse::<f64>().unwrap());
    let largest = numbers.collect::<Vec<_>>().chunks(3).map(|u| u[0].hypot(u[1])).fold(0.0, f64::max);
    // Corners of cells lie between nodes, where a meshfree field overshoots a little what is held.
    assert!((largest - moved).abs() < 0.06 * moved, "{largest} {moved}");
}
