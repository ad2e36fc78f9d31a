//! The body along an insertion as a VTU series, with a `.pvd` that gives ParaView the times and a script that shows it.

use std::fmt::Write as _;

use model_offline::model::TissueModel;
use model_offline::model::space::SpaceModel;
use model_offline::output::space_picture::SpaceGeometry;
use model_offline::output::vtu::{Shown, Sight, parts, parts_in_space, script, vtu, vtu_in_space};
use model_offline::output::{State, has_stress};

use crate::record::files::Artifact;
use crate::world::retrace::{PICTURES, Retrace, SolvedBody};
use crate::world::truth::Truth;

/// The series of one insertion: `NAME.pvd` and `NAME-000.vtu`, `NAME-001.vtu`, …, the same with `-parts` of needle, target and
/// paddles, and `NAME.py`, which shows all of it in ParaView. Times are seconds since the start of the needle. Solved again
/// with the full model at some of the run's ticks; ends early where there is no equilibrium.
pub fn series(
    model: &TissueModel,
    paddle: Option<u32>,
    truths: &[Truth],
    started_ns: u64,
    name: &str,
) -> Vec<Artifact> {
    let moving = &truths[truths.partition_point(|truth| truth.time_ns < started_ns)..];
    let Ok(mut retrace) = Retrace::new(model, paddle, moving, started_ns) else { return Vec::new() };
    let Some(last) = moving.len().checked_sub(1) else { return Vec::new() };
    let mut series = Series::new(name);
    let mut coefficients = Vec::new();
    let scene = model.scene();
    for i in 0..=PICTURES {
        let Ok(tissue) = retrace.go_on_to(last * i / PICTURES) else { break };
        tissue.copy_coefficients(&mut coefficients);
        let Truth { time_ns, depth, .. } = moving[last * i / PICTURES];
        let state = State { coefficients: &coefficients, depth, within: scene.needle.shaft.is_some() };
        series.push(seconds(time_ns, started_ns), vtu(model, &coefficients), parts(model, state));
    }
    series.finish(Shown {
        scene: &scene.name,
        units: [&scene.length_unit, &scene.stress_unit],
        stress: has_stress(model),
        ..Shown::default()
    })
}

/// The same of a body in space that has been solved for already, with these paddles attached.
pub fn series_in_space(
    model: &SpaceModel,
    paddles: &[u32],
    bodies: &[SolvedBody],
    started_ns: u64,
    name: &str,
) -> Vec<Artifact> {
    let (scene, geometry) = (model.scene(), SpaceGeometry::new(model));
    let mut series = Series::new(name);
    for SolvedBody { truth, state, coefficients } in bodies {
        let time_s = seconds(truth.time_ns, started_ns);
        series.push(time_s, vtu_in_space(model, coefficients), parts_in_space(&geometry, state));
    }
    series.finish(Shown {
        scene: &scene.name,
        units: [&scene.length_unit, &scene.stress_unit],
        stress: true,
        of_points: scene.discretization.method.integration.is_nodal(),
        in_space: Some(Sight::new(&geometry, paddles)),
        ..Shown::default()
    })
}

/// Since the start of the needle, s.
fn seconds(time_ns: u64, started_ns: u64) -> f64 {
    (time_ns as f64 - started_ns as f64) * 1e-9
}

/// The files of an insertion.
struct Series<'n> {
    name: &'n str,
    files: Vec<Artifact>,
    bodies: Collection,
    parts: Collection,
}

impl<'n> Series<'n> {
    fn new(name: &'n str) -> Self {
        Self { name, files: Vec::new(), bodies: Collection::default(), parts: Collection::default() }
    }

    /// The body and what is beside it at a time.
    fn push(&mut self, time_s: f64, body: String, parts: String) {
        let (name, i) = (self.name, self.files.len() / 2);
        self.files.push(self.bodies.artifact(time_s, format!("{name}-{i:03}.vtu"), body));
        self.files.push(self.parts.artifact(time_s, format!("{name}-{i:03}-parts.vtu"), parts));
    }

    /// All of them, with the script that shows them.
    fn finish(self, shown: Shown<'_>) -> Vec<Artifact> {
        let Self { name, mut files, bodies, parts } = self;
        let (body, beside) = (format!("{name}.pvd"), format!("{name}-parts.pvd"));
        let text = script(Shown { body: &body, parts: &beside, ..shown });
        let script = Artifact { name: format!("{name}.py"), bytes: text.into_bytes() };
        files.extend([bodies.finish(body), parts.finish(beside), script]);
        files
    }
}

/// Files and the times that they belong to, as ParaView reads them.
#[derive(Default)]
struct Collection {
    entries: String,
}

impl Collection {
    fn artifact(&mut self, time_s: f64, name: String, content: String) -> Artifact {
        let _ = writeln!(self.entries, "    <DataSet timestep=\"{time_s}\" group=\"\" part=\"0\" file=\"{name}\"/>");
        Artifact { name, bytes: content.into_bytes() }
    }

    fn finish(self, name: String) -> Artifact {
        let collection = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n  \
             <Collection>\n{}  </Collection>\n</VTKFile>\n",
            self.entries
        );
        Artifact { name, bytes: collection.into_bytes() }
    }
}
