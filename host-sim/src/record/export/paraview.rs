//! The body along an insertion as a VTU series, with a `.pvd` that gives ParaView the times and a script that shows it.

use std::fmt::Write as _;

use model_offline::model::TissueModel;
use model_offline::output::State;
use model_offline::output::has_stress;
use model_offline::output::vtu::{Shown, parts, script, vtu};

use crate::record::files::Artifact;
use crate::world::retrace::Retrace;
use crate::world::truth::Truth;

/// Files of a series.
const FRAMES: usize = 20;

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
    let mut files = Vec::new();
    let [mut bodies, mut of_parts] = [Collection::default(), Collection::default()];
    let mut coefficients = Vec::new();
    for i in 0..=FRAMES {
        let Ok(tissue) = retrace.go_on_to(last * i / FRAMES) else { break };
        tissue.copy_coefficients(&mut coefficients);
        let Truth { time_ns, depth, .. } = moving[last * i / FRAMES];
        let time_s = (time_ns - started_ns) as f64 * 1e-9;
        let within = model.scene().needle.shaft.is_some();
        let state = State { coefficients: &coefficients, depth, within };
        files.push(bodies.artifact(time_s, format!("{name}-{i:03}.vtu"), vtu(model, &coefficients)));
        files.push(of_parts.artifact(time_s, format!("{name}-{i:03}-parts.vtu"), parts(model, state)));
    }
    let (body, beside) = (format!("{name}.pvd"), format!("{name}-parts.pvd"));
    let shown = Shown { body: &body, parts: &beside, stress: has_stress(model) };
    let script = Artifact { name: format!("{name}.py"), bytes: script(model.scene(), shown).into_bytes() };
    files.extend([bodies.finish(body), of_parts.finish(beside), script]);
    files
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
