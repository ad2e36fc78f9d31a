//! The body along an insertion as a VTU series, with a `.pvd` that gives ParaView the times.

use std::fmt::Write as _;

use model_offline::model::TissueModel;
use model_offline::output::vtu::vtu;

use crate::record::files::Artifact;
use crate::world::retrace::Retrace;
use crate::world::truth::Truth;

/// Files of a series.
const FRAMES: usize = 20;

/// The series of one insertion: `NAME.pvd` and `NAME-000.vtu`, `NAME-001.vtu`, … Times are seconds since the start of the
/// needle. Solved again with the full model at some of the run's ticks; ends early where there is no equilibrium.
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
    let mut entries = String::new();
    let mut coefficients = Vec::new();
    for i in 0..=FRAMES {
        let Ok(tissue) = retrace.go_on_to(last * i / FRAMES) else { break };
        tissue.copy_coefficients(&mut coefficients);
        let file = format!("{name}-{i:03}.vtu");
        let time_s = (moving[last * i / FRAMES].time_ns - started_ns) as f64 * 1e-9;
        let _ = writeln!(entries, "    <DataSet timestep=\"{time_s}\" group=\"\" part=\"0\" file=\"{file}\"/>");
        files.push(Artifact { name: file, bytes: vtu(model, &coefficients).into_bytes() });
    }
    let collection = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n  \
         <Collection>\n{entries}  </Collection>\n</VTKFile>\n"
    );
    files.push(Artifact { name: format!("{name}.pvd"), bytes: collection.into_bytes() });
    files
}
