//! Files for other tools, read back with readers that are not ours: `mcap`, `vtk` and `jsonschema` from PyPI. Where
//! they are not installed, that part says "skipped".

use std::path::{Path, PathBuf};
use std::process::Command;

use assert_cmd::Command as Checked;
use host_sim::bench::result::RunResult;
use model_offline::output::field_picture::Field;
use model_offline::output::result_file::{AnyBody, Which, read_body};
use serde_json::Value;

fn host_sim() -> Checked {
    Checked::new(env!("CARGO_BIN_EXE_host-sim"))
}

/// Runs a Python program with a module, in a folder; its output, or none without the module.
fn python(module: &str, folder: &Path, program: &str) -> Option<String> {
    let has =
        Command::new("python3").args(["-c", &format!("import {module}")]).output().is_ok_and(|o| o.status.success());
    if !has {
        println!("skipped: no python3 with {module}");
        return None;
    }
    let output = Command::new("python3").args(["-c", program]).current_dir(folder).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(String::from_utf8(output.stdout).unwrap())
}

/// A run with everything that it can write for other tools, beside its result as JSON.
fn run_with_everything(folder: &Path) -> PathBuf {
    let report = folder.join("report");
    let words = "run --quiet --tissue inclusion --mode lockstep --insertion-time 0.4 --mcap --vtu --json";
    let mut run = host_sim();
    run.args(words.split(' ')).arg(folder.join("result.json")).arg("--out").arg(&report).assert().success();
    report
}

/// The same recording, exported afterwards, gives the same bytes. Rows of its time series.
fn check_exports(folder: &Path, report: &Path) -> usize {
    let again = folder.join("again.mcap");
    let csv = folder.join("again.csv");
    let recording = report.join("inclusion-dynamic.rec");
    let export = |scene: &[&str], mcap: &Path| {
        let mut export = host_sim();
        export.arg("export").arg(&recording).arg("--mcap").arg(mcap).arg("--csv").arg(&csv).args(scene);
        export.assert()
    };
    let layout = folder.join("again.json");
    export(&["--scene", "paper", "--layout", layout.to_str().unwrap()], &again).success();
    let whole = std::fs::read(&again).unwrap();
    assert!(whole == std::fs::read(report.join("inclusion-dynamic.mcap")).unwrap());
    assert_eq!(std::fs::read(&layout).unwrap(), std::fs::read(report.join("inclusion-dynamic.foxglove.json")).unwrap());
    // A layout is of what is to be seen: none without the scene, and not over the file that it is of.
    let refused = export(&["--layout", layout.to_str().unwrap()], &folder.join("none.mcap")).code(2);
    assert!(String::from_utf8_lossy(&refused.get_output().stderr).contains("--scene"));
    let refused = export(&["--scene", "block"], &folder.join("none.mcap")).code(2);
    assert!(String::from_utf8_lossy(&refused.get_output().stderr).contains("not the scene that was recorded"));
    // A device that takes nothing: nothing else is written.
    #[cfg(target_os = "linux")]
    export(&["--scene", "paper", "--layout", "/dev/full"], &folder.join("none.mcap")).code(1);
    let refused = export(&["--scene", "paper", "--layout", again.to_str().unwrap()], &again).code(2);
    assert!(String::from_utf8_lossy(&refused.get_output().stderr).contains("same file"));
    assert!(std::fs::read(&again).unwrap() == whole && !folder.join("none.mcap").exists());
    // Without the scene there is nothing to be seen, and all the rest; another scene is none.
    let blind = folder.join("blind.mcap");
    export(&[], &blind).success();
    assert!(std::fs::read(&blind).unwrap().len() < whole.len());
    let other = folder.join("other.mcap");
    let refused = export(&["--scene", "breast"], &other).code(2);
    assert!(String::from_utf8_lossy(&refused.get_output().stderr).contains("not the scene that was recorded"));
    assert!(!other.exists());
    let text = std::fs::read_to_string(&csv).unwrap();
    assert!(text == std::fs::read_to_string(report.join("inclusion-dynamic.csv")).unwrap(), "one schema, one file");
    let times: Vec<f64> = text.lines().skip(1).map(|line| line.split(',').next().unwrap().parse().unwrap()).collect();
    assert!(times.len() > 800 && times.windows(2).all(|pair| pair[0] < pair[1]), "{} rows", times.len());
    let columns = text.lines().next().unwrap().split(',').count();
    assert!(text.lines().all(|line| line.split(',').count() == columns));
    times.len()
}

/// Every file of the series is there, and its time rises.
fn check_series(report: &Path) {
    for name in ["inclusion-dynamic.pvd", "inclusion-dynamic-parts.pvd"] {
        let pvd = std::fs::read_to_string(report.join(name)).unwrap();
        let pvd = roxmltree::Document::parse(&pvd).unwrap();
        let sets: Vec<_> = pvd.descendants().filter(|node| node.has_tag_name("DataSet")).collect();
        assert_eq!(sets.len(), 21);
        assert!(sets.iter().all(|set| report.join(set.attribute("file").unwrap()).is_file()));
        let at = |set: &roxmltree::Node<'_, '_>| set.attribute("timestep").unwrap().parse::<f64>().unwrap();
        assert!(sets.windows(2).all(|pair| at(&pair[0]) < at(&pair[1])));
    }
}

/// `mcap` reads every message, and its largest error is the result's; `rows` are those of the time series.
fn check_mcap(folder: &Path, report: &Path, rows: usize) {
    let program = "import json\nfrom mcap.reader import make_reader\n\
         r = make_reader(open('inclusion-dynamic.mcap', 'rb'), validate_crcs=True)\n\
         n, last, worst, names, ids = 0, 0, 0.0, {}, set()\n\
         for schema, channel, message in r.iter_messages():\n\
         \x20   assert schema.encoding == 'jsonschema' and channel.message_encoding == 'json'\n\
         \x20   body = json.loads(message.data)\n\
         \x20   assert set(json.loads(schema.data).get('required', [])) <= set(body) <= set(json.loads(schema.data)['properties']), body\n\
         \x20   n += 1\n\
         \x20   names[schema.name] = names.get(schema.name, 0) + 1\n\
         \x20   if channel.topic.startswith('/scene'): ids |= {e['id'] for e in body['entities']}\n\
         \x20   if channel.topic == '/truth': worst = max(worst, abs(body['orthogonal_error']))\n\
         assert ids == {'body at rest', 'target at rest', 'target', 'paddle', 'needle'}, ids\n\
         assert names['foxglove.FrameTransform'] == 1 and names['foxglove.Log'] >= 2, names\n\
         assert 25 <= names['foxglove.SceneUpdate'] <= 40, names\n\
         print(n, worst)\n";
    let Some(said) = python("mcap", report, program) else { return };
    let (count, worst) = said.trim().split_once(' ').unwrap();
    assert!(count.parse::<usize>().unwrap() > 3 * rows, "{said}");
    let result: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.join("result.json")).unwrap()).unwrap();
    let ours = result["cases"][0]["strategies"]["dynamic"]["max_orthogonal_error"].as_f64().unwrap();
    assert!((worst.parse::<f64>().unwrap() - ours).abs() <= 1e-12, "{said} {ours}");
}

/// `vtk` reads the last body and what is beside it: tensors as such, the tissue at the needle as deep as the needle, and a
/// picture's script that Python understands.
fn check_vtu(report: &Path) {
    let program = "import ast, vtk\nfrom vtk.util.numpy_support import vtk_to_numpy as numpy\n\
         ast.parse(open('inclusion-dynamic.py').read())\n\
         def read(name):\n\
         \x20   r = vtk.vtkXMLUnstructuredGridReader(); r.SetFileName(name); r.Update(); return r.GetOutput()\n\
         m = read('inclusion-dynamic-020.vtu')\n\
         x, u = numpy(m.GetPoints().GetData()), numpy(m.GetPointData().GetArray('displacement'))\n\
         assert numpy(m.GetCellData().GetArray('det_f')).min() > 0\n\
         assert numpy(m.GetCellData().GetArray('cauchy_stress')).shape == (m.GetNumberOfCells(), 9)\n\
         under = (abs(x[:, 1] - 1) < 1e-9) & (abs(x[:, 0] - 0.5) < 0.06)\n\
         parts = read('inclusion-dynamic-020-parts.vtu')\n\
         part = numpy(parts.GetCellData().GetArray('part')).tolist()\n\
         assert sorted(set(part)) == [1, 2, 3, 4] and part.count(4) == 5, part\n\
         print(len(x), float(u[under, 1].mean()))\n";
    let Some(said) = python("vtk", report, program) else { return };
    let (points, deepest) = said.trim().split_once(' ').unwrap();
    assert!(points.parse::<usize>().unwrap() > 100);
    // Held values are met at nodes; corners of cells lie between them, where a meshfree field overshoots a little.
    assert!((deepest.parse::<f64>().unwrap() + 0.1).abs() < 6e-3, "the needle is 0.1 deep: {said}");
}

/// What ParaView's script asks of ParaView, from a folder that is not its own. As it runs in ParaView's window: nothing tells it
/// which file it is but the command line. Colours are scaled by all that is to be seen; at rest that is nothing.
fn check_script(report: &Path) {
    const IN_A_WINDOW: &str = "import os, sys, types\n\
         from unittest.mock import MagicMock\n\
         names = 'GetActiveViewOrCreate OpenDataFile WarpByVector Show ColorBy GetScalarBar GetColorTransferFunction Threshold \\\n\
         Glyph GetAnimationScene ResetCamera Render SaveScreenshot'.split()\n\
         every, simple = MagicMock(), types.ModuleType('paraview.simple')\n\
         for name in names: setattr(simple, name, getattr(every, name))\n\
         opened = []\n\
         def open_data_file(path):\n\
         \x20   assert os.path.isfile(path), path\n\
         \x20   opened.append(os.path.basename(path))\n\
         every.OpenDataFile.side_effect = open_data_file\n\
         warped = every.WarpByVector.return_value\n\
         warped.GetDataInformation.return_value.GetBounds.return_value = (0.0, 2.0, -1.0, 0.5, 0.0, 0.0)\n\
         sys.modules.update({'paraview': types.ModuleType('paraview'), 'paraview.simple': simple})\n\
         script, sys.argv = sys.argv[1].partition('=')[2], ['']\n\
         exec(open(script).read(), {})\n\
         calls = [str(call[0]) for call in every.mock_calls]\n\
         after = [name for name in calls[calls.index('GetAnimationScene().GoToLast'):] if 'Rescale' in name]\n\
         assert after == ['Show().RescaleTransferFunctionToDataRangeOverTime'], calls\n\
         assert every.Glyph.return_value.ScaleFactor == 0.08\n\
         assert not every.SaveScreenshot.called\n\
         print(*opened)\n";
    let elsewhere = tempfile::tempdir().unwrap();
    let script = format!("--script={}", report.join("inclusion-dynamic.py").display());
    let output = Command::new("python3").args(["-c", IN_A_WINDOW, &script]).current_dir(elsewhere.path()).output();
    let Ok(output) = output else { return println!("skipped: no python3") };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(String::from_utf8_lossy(&output.stdout), "inclusion-dynamic.pvd inclusion-dynamic-parts.pvd\n");
}

/// A script may be called as a module is that it needs: it does not take itself for that.
fn check_script_named_paraview(report: &Path) {
    let [own, modules] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    std::fs::copy(report.join("inclusion-dynamic.py"), own.path().join("paraview.py")).unwrap();
    std::fs::create_dir(modules.path().join("paraview")).unwrap();
    std::fs::write(modules.path().join("paraview/__init__.py"), "").unwrap();
    std::fs::write(modules.path().join("paraview/simple.py"), "raise SystemExit('this is simple')").unwrap();
    let mut python = Command::new("python3");
    let output = python.arg("paraview.py").current_dir(own.path()).env("PYTHONPATH", modules.path()).output();
    let Ok(output) = output else { return println!("skipped: no python3") };
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("this is simple"), "{said}");
}

/// The folder's `result.json` is what its schema says: `jsonschema` finds so, and no field has a name that is not in the schema.
pub(crate) fn check_schema(folder: &Path, subject: &str) {
    let schema = host_sim().args(["schema", subject]).assert().success();
    let schema = &schema.get_output().stdout;
    let [result, schema_of_result] =
        [&std::fs::read(folder.join("result.json")).unwrap(), schema].map(|json| serde_json::from_slice(json).unwrap());
    check_names("", &result, &schema_of_result, &schema_of_result);
    let own = tempfile::tempdir().unwrap();
    std::fs::write(own.path().join("schema.json"), schema).unwrap();
    std::fs::copy(folder.join("result.json"), own.path().join("result.json")).unwrap();
    let program = "import json, jsonschema\njsonschema.validate(json.load(open('result.json')), json.load(open('schema.json')))\n";
    python("jsonschema", own.path(), program);
}

/// Objects at `path` and below have the fields that `schema` names, and no others, as far as the schema names any.
fn check_names(path: &str, value: &Value, schema: &Value, whole: &Value) {
    if let Some(reference) = schema["$ref"].as_str() {
        let definition = whole.pointer(&reference[1..]).unwrap_or_else(|| panic!("{path}: no {reference}"));
        return check_names(path, value, definition, whole);
    }
    if let Some(choices) = schema["anyOf"].as_array() {
        let fits = |choice: &&Value| (choice["type"] == "null") == value.is_null();
        return check_names(path, value, choices.iter().find(fits).unwrap(), whole);
    }
    if let (Some(object), Some(properties)) = (value.as_object(), schema["properties"].as_object()) {
        for required in schema["required"].as_array().into_iter().flatten() {
            assert!(object.contains_key(required.as_str().unwrap()), "{path}: no {required}");
        }
        for (name, value) in object {
            let schema = properties.get(name).unwrap_or_else(|| panic!("{path}: {name} is not in the schema"));
            check_names(&format!("{path}/{name}"), value, schema, whole);
        }
    }
    for (index, value) in value.as_array().into_iter().flatten().enumerate() {
        let schema = if schema["prefixItems"].is_array() { &schema["prefixItems"][index] } else { &schema["items"] };
        check_names(&format!("{path}/{index}"), value, schema, whole);
    }
}

/// What `model-offline draw` makes pictures of: every strategy's body, at the depth that is asked for, with every field.
fn check_bodies(report: &Path) {
    let result = report.join("result.json");
    let whole: RunResult = serde_json::from_slice(&std::fs::read(&result).unwrap()).unwrap();
    for (strategy, found) in whole.cases[0].strategies.iter().map(|(strategy, found)| (strategy.to_string(), found)) {
        for frame in &found.frames {
            let which = Which { strategy: Some(strategy.clone()), depth: Some(frame.depth), ..Which::default() };
            let AnyBody::Planar(body) = read_body(&result, &which).unwrap() else { panic!("in the plane") };
            assert_eq!((body.depth, &body.nodes, &body.strain), (frame.depth, &frame.nodes, &frame.strain));
            assert_eq!((body.paddle, &body.units), (found.paddle, &whole.units));
            let fields = Field::ALL.map(|(_, field)| field.values(&body).unwrap());
            assert!(fields.iter().all(|values| values.len() == whole.geometry.nodes.len()));
        }
    }
    let error = read_body(&result, &Which { strategy: Some("dynamic-free-run".to_owned()), ..Which::default() });
    assert!(error.unwrap_err().to_string().contains("case 1 has no dynamic-free-run"));
}

#[test]
fn a_run_can_be_opened_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    let report = run_with_everything(folder.path());
    let rows = check_exports(folder.path(), &report);
    check_series(&report);
    check_mcap(folder.path(), &report, rows);
    check_vtu(&report);
    check_script(&report);
    check_script_named_paraview(&report);
    check_bodies(&report);
    check_schema(folder.path(), "result");
}

#[test]
fn completions_manuals_and_schemas_can_be_generated() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish"] {
        let said = host_sim().args(["completions", shell]).assert().success();
        assert!(String::from_utf8_lossy(&said.get_output().stdout).contains("replay"), "{shell}");
    }
    host_sim().arg("man").arg(folder.path().join("man1")).assert().success();
    let page = std::fs::read_to_string(folder.path().join("man1/host-sim-run.1")).unwrap();
    assert!(page.contains("table\\-tissue"), "{page}");
    for of in ["result", "result-in-space", "timing", "mcap"] {
        let said = host_sim().args(["schema", of]).assert().success();
        serde_json::from_slice::<serde_json::Value>(&said.get_output().stdout).unwrap();
    }
}
