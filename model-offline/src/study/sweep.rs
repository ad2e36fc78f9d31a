//! What the mesh does to the choice of a paddle: both rankings along a refinement, on uniform and on graded nodes.

use super::candidates::base_spacing;
use crate::discretization::{Discretization, Integration, Method, Resolution};
use crate::model::{ModelError, TissueModel};
use crate::output::chart::{Axis, Colour, Dash, Figure, Marker, Panel, Series};
use crate::output::csv;
use crate::parallel;
use crate::placement::hindrance::best_to_control;
use crate::placement::reference::Reference;
use crate::placement::rest::{RestResponse, rest_responses};
use crate::scene::Scene;
use std::fmt::Write as _;

/// Uniform spacings over the scene's own.
const SPACINGS: [f64; 5] = [1.0, 0.7, 0.5, 0.25, 0.125];
/// Levels of graded nodes.
const LEVELS: std::ops::Range<i32> = -2..4;
/// Rules on uniform nodes.
const UNIFORM: [Integration; 3] = [Integration::Dni, Integration::Scni, Integration::FemT3];
/// Distance of the reference's two levels.
const REFERENCE_SHARE: f64 = 2e-3;

/// One discretization on the way.
#[derive(Debug, Clone)]
pub struct SweepStep {
    /// The discretization.
    pub discretization: Discretization,
    /// Number of nodes.
    pub nodes: usize,
    /// Responses of all paddles, in the scene's order; or why there are none.
    pub responses: Result<Vec<RestResponse>, ModelError>,
}

/// The rankings along a refinement.
#[derive(Debug, Clone)]
pub struct Sweep {
    scene: Scene,
    /// Every discretization, rule by rule from coarse to fine.
    pub steps: Vec<SweepStep>,
    /// The continuum limit that they go to.
    pub reference: Reference,
}

/// Refines uniform nodes with SCNI, the paper's method, and graded nodes with quadratic triangles.
///
/// # Errors
/// [`ModelError`] when the limit cannot be computed.
pub fn sweep(scene: &Scene, threads: usize, progress: &(dyn Fn() + Sync)) -> Result<Sweep, ModelError> {
    let base = base_spacing(scene);
    let candidate = |rule, nodes| scene.discretization.with(nodes, Method::new(rule));
    let candidates: Vec<Discretization> = UNIFORM
        .into_iter()
        .flat_map(|rule| SPACINGS.map(|share| candidate(rule, Resolution::Spacing(base * share))))
        .chain(LEVELS.map(|level| candidate(Integration::FemT6, Resolution::Level(level))))
        .collect();
    let reference = Reference::compute(scene, REFERENCE_SHARE)?;
    let steps = parallel::map(candidates.len(), threads, |k| {
        let discretization = candidates[k];
        let model = TissueModel::new(&scene.with_discretization(discretization));
        let nodes = model.as_ref().map_or(0, TissueModel::nodes);
        let responses = model.and_then(|model| rest_responses(&model));
        progress();
        SweepStep { discretization, nodes, responses }
    });
    Ok(Sweep { scene: scene.clone(), steps, reference })
}

/// Number of times [`sweep`] calls its progress function.
pub const STEPS: u64 = (UNIFORM.len() * SPACINGS.len()) as u64 + (LEVELS.end - LEVELS.start) as u64;

/// A mesh, or the limit, with what its model answers.
struct Row<'s> {
    rule: String,
    mesh: String,
    nodes: usize,
    responses: &'s [RestResponse],
}

/// Columns of the CSV.
const COLUMNS: [&str; 8] = [
    "integration",
    "mesh",
    "nodes",
    "paddle",
    "controllability_measure",
    "orthogonal_per_depth",
    "best_static",
    "best_dynamic",
];

/// Best static and best dynamic paddle, where there is one.
pub type Optima = (Option<u32>, Option<u32>);

fn named(paddle: Option<u32>) -> String {
    paddle.map_or_else(|| "none".to_owned(), |index| index.to_string())
}

impl Sweep {
    fn orthogonal(&self, response: &RestResponse) -> f64 {
        response.target_per_depth.dot(&self.scene.needle.orthogonal())
    }

    /// Best static paddle for small depths, and best dynamic one; none where no paddle has a finite measure.
    pub fn optima(&self, responses: &[RestResponse]) -> Optima {
        let drifts = responses.iter().map(|rest| self.orthogonal(rest).abs()).enumerate();
        let still = drifts.filter(|drift| drift.1.is_finite()).min_by(|a, b| a.1.total_cmp(&b.1));
        let named = |place: usize| self.scene.paddles[place].index;
        (still.map(|still| named(still.0)), best_to_control(responses).map(named))
    }

    fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        let meshes = self.steps.iter().filter_map(|step| {
            let mesh = match step.discretization.resolution {
                Resolution::Spacing(h) => format!("uniform {}", (h * 1e6).round() / 1e6),
                Resolution::Level(level) => format!("level {level}"),
                other @ Resolution::Tolerance(_) => other.to_string(),
            };
            let rule = step.discretization.method.integration.to_string();
            Some(Row { rule, mesh, nodes: step.nodes, responses: step.responses.as_deref().ok()? })
        });
        let (rule, mesh) = ("limit".to_owned(), "extrapolated".to_owned());
        meshes.chain([Row { rule, mesh, nodes: self.reference.nodes, responses: self.reference.responses() }])
    }

    /// One line per mesh and paddle.
    pub fn csv(&self) -> Vec<u8> {
        let rows: Vec<Row<'_>> = self.rows().collect();
        let lines = rows.iter().flat_map(|row| {
            let optima = self.optima(row.responses);
            let paddles = self.scene.paddles.iter().zip(row.responses);
            paddles.map(move |(paddle, response)| (row, optima, paddle.index, response))
        });
        csv::table(COLUMNS, lines, |(row, (best_static, best_dynamic), paddle, response)| {
            [
                row.rule.clone(),
                row.mesh.clone(),
                row.nodes.to_string(),
                paddle.to_string(),
                format!("{:.6}", response.controllability_measure),
                format!("{:.6}", self.orthogonal(response)),
                (Some(paddle) == best_static).to_string(),
                (Some(paddle) == best_dynamic).to_string(),
            ]
        })
    }

    /// Best paddles, mesh by mesh.
    pub fn table(&self) -> String {
        let mut out =
            format!("{:<8} {:<16} {:>7} {:>13} {:>14}\n", "method", "mesh", "nodes", "best static", "best dynamic");
        for Row { rule, mesh, nodes, responses } in self.rows() {
            let (best_static, best_dynamic) = self.optima(responses);
            let (best_static, best_dynamic) = (named(best_static), named(best_dynamic));
            let _ = writeln!(out, "{rule:<8} {mesh:<16} {nodes:>7} {best_static:>13} {best_dynamic:>14}");
        }
        let _ = writeln!(
            out,
            "\nbest static paddle by |orthogonal target displacement per depth| at small depth; the limit is good to {:.2} %{}",
            100.0 * self.reference.open,
            self.left_out()
        );
        out
    }

    /// Of which paddles that is not said.
    fn left_out(&self) -> String {
        let open = self.reference.open_by_paddle();
        let of = |place: usize| match open[place] {
            open if open.is_finite() => format!("is known to {:.0} %", 100.0 * open),
            _ => "is not known".to_owned(),
        };
        let index = |place: usize| self.scene.paddles[place].index;
        let named = |place: usize| format!("; paddle {}, of which no table can be made, {}", index(place), of(place));
        self.reference.left_out().map(named).collect()
    }

    /// Best paddles on the coarsest and on the finest mesh of a rule, and in the limit.
    fn moves(&self, rule: Integration) -> [Optima; 3] {
        let of_rule = || self.steps.iter().filter(|step| step.discretization.method.integration == rule);
        let optima = |step: Option<&SweepStep>| {
            step.and_then(|step| step.responses.as_deref().ok())
                .map_or((None, None), |responses| self.optima(responses))
        };
        [optima(of_rule().next()), optima(of_rule().next_back()), self.optima(self.reference.responses())]
    }

    /// Both rankings against the number of nodes: one panel per approach, one line per paddle, the limit at the right.
    pub fn svg(&self) -> String {
        let moves = self.moves(Integration::Scni);
        let says = |name: &str, of: fn(Optima) -> Option<u32>| {
            let [coarse, fine, limit] = moves.map(of).map(named);
            if coarse == fine && fine == limit {
                format!("best {name} paddle {limit} on every mesh")
            } else {
                format!("best {name} paddle {coarse} on the coarsest mesh, {fine} on the finest, {limit} in the limit")
            }
        };
        let (fixed, moved) = (says("static", |o| o.0), says("dynamic", |o| o.1));
        let changes = |of: fn(Optima) -> Option<u32>| moves.map(of).windows(2).any(|pair| pair[0] != pair[1]);
        let decides = match (changes(|o| o.0), changes(|o| o.1)) {
            (true, true) => "The mesh decides which paddle is best",
            (true, false) => "The mesh decides which static paddle is best, not which dynamic one",
            (false, true) => "The mesh decides which dynamic paddle is best, not which static one",
            (false, false) => "The best paddles are the same on every mesh",
        };
        Figure {
            title: format!("{decides}: {}, {} tissue", self.scene.name, self.scene.tissue()),
            caption:
                "SCNI on uniform nodes, coarsest to finest; filled at the right: continuum limit (quadratic triangles, \
                      extrapolated). Lowest is best."
                    .into(),
            panels: vec![
                self.panel(&fixed, "|orthogonal target displacement| per depth", &|r| self.orthogonal(r).abs()),
                self.panel(&moved, "controllability measure ‖J⁻¹n‖", &|r| r.controllability_measure),
            ],
            columns: 2,
        }
        .svg()
    }

    fn panel(&self, title: &str, quantity: &str, key: &dyn Fn(&RestResponse) -> f64) -> Panel {
        const MARKERS: [Marker; 6] = [
            Marker::Circle,
            Marker::Square,
            Marker::Triangle,
            Marker::Diamond,
            Marker::TriangleDown,
            Marker::TriangleRight,
        ];
        let mut panel = Panel::new(title, Axis::log("nodes", ""), Axis::linear(quantity, ""));
        for (k, paddle) in self.scene.paddles.iter().enumerate() {
            let mut points: Vec<(f64, f64)> = self
                .steps
                .iter()
                .filter(|step| step.discretization.method.integration == Integration::Scni)
                .filter_map(|step| Some((step.nodes as f64, key(&step.responses.as_ref().ok()?[k]))))
                .collect();
            let (colour, marker) = (Colour::CYCLE[k % Colour::CYCLE.len()], MARKERS[k % MARKERS.len()]);
            let label = format!("paddle {}", paddle.index);
            let end = points.last().map_or(1.0, |p| p.0) * 3.0;
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            panel.series.push(Series::scatter(&label, colour, marker, points).open().joined(Dash::Solid));
            let limit = vec![(end, key(&self.reference.responses()[k]))];
            panel.series.push(Series::scatter("", colour, marker, limit));
        }
        panel
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_static_optimum_of_the_paper_moves_with_the_mesh_and_the_dynamic_one_does_not() {
        let scene = Scene::bundled("paper").unwrap().without_inclusions();
        let sweep = sweep(&scene, 2, &|| {}).unwrap();
        assert_eq!(sweep.optima(sweep.reference.responses()), (Some(2), Some(3)));
        for (rule, coarsest) in [(Integration::Dni, 4), (Integration::Scni, 3), (Integration::FemT3, 4)] {
            let optima: Vec<Optima> = sweep
                .steps
                .iter()
                .filter(|s| s.discretization.method.integration == rule)
                .map(|s| sweep.optima(s.responses.as_ref().unwrap()))
                .collect();
            assert_eq!((optima[0].0, optima[optima.len() - 1].0), (Some(coarsest), Some(2)), "{rule:?}: {optima:?}");
            assert!(optima.iter().all(|o| o.1 == Some(3)), "{rule:?}: {optima:?}");
        }
        assert_eq!(sweep.steps.len() as u64, STEPS);
        assert_eq!(sweep.csv().iter().filter(|&&byte| byte == b'\n').count(), 1 + 5 * (sweep.steps.len() + 1));
    }
}
