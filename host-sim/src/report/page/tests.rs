//! Every chart is there, every string escaped, every number finite.

use super::*;
use crate::bench::bound::Bound;
use crate::bench::causes::{Cause, CausesResult, Without};
use crate::bench::in_process::Errors;
use crate::bench::result::*;
use crate::bench::study_failure::StudyFailure;
use crate::bench::table_tissue::TableTissue;
use crate::runtime::accounting::ledger::{LedgerResult, StreamResult};
use crate::runtime::time::clock::Scheduling;
use crate::runtime::time::durations::{Distribution, LoopTiming};
use crate::runtime::time::mode::RunMode;
use firmware::{Discard, Faults};
use model_offline::discretization::Integration;
use model_offline::needle::StationState;
use model_offline::scene::{PlantModel, TissueVariant};
use model_offline::solver::equilibrium::FailureReason;

const EVIL: &str = "<script>alert(\"x\")</script>&'";

fn strategy(mode: RunMode, paddle: Option<u32>, error: f64) -> StrategyResult {
    let depths = [0.0, 0.05, 0.1];
    let series = depths.map(|depth| SeriesPoint {
        time_s: depth * 50.0,
        depth,
        orthogonal_error: error * depth * 10.0,
        axial: 0.2 * depth,
        paddle: [depth, -depth],
    });
    let nodes = rest().iter().map(|[x, y]| [x + 0.01 * y, *y]).collect::<Vec<_>>();
    let controlled = paddle == Some(1);
    StrategyResult {
        mode,
        paddle,
        max_orthogonal_error: error,
        max_error_depth: 0.1,
        rms_orthogonal_error: 0.5 * error,
        paddle_travel: 0.0,
        final_state: None,
        run_share: None,
        outside_run_for: Faults::NONE,
        faults: Faults::NONE,
        ledger: controlled.then(|| LedgerResult {
            needle: StreamResult {
                published: 1_234_567,
                discarded_for: vec![(Discard::Late, 3)],
                ..StreamResult::default()
            },
            ..LedgerResult::default()
        }),
        timing: (mode == RunMode::FreeRun).then(timing),
        plant_timing: (mode == RunMode::FreeRun).then(timing),
        seed: 1,
        table_hash: Some(EVIL.to_owned()),
        scene_hash: EVIL.to_owned(),
        recording: Some(RecordingResult { file: EVIL.to_owned(), sha256: EVIL.to_owned(), ticks: 3 }),
        csv: Some(EVIL.to_owned()),
        needle_csv: Vec::new(),
        series: series.to_vec(),
        deformed_nodes: nodes.clone(),
        frames: vec![frame(0.05, rest()), frame(0.1, nodes)],
        needle: controlled.then(needle),
        plant_step_us: 1.0,
        plant: crate::world::tissue::PlantAccount::default(),
    }
}

fn frame(depth: f64, nodes: Vec<[f64; 2]>) -> BodyFrame {
    let each = |value: f64| vec![value; nodes.len()];
    BodyFrame { depth, strain: each(2.0 * depth), von_mises: each(600.0 * depth), nodes }
}

fn causes() -> CausesResult {
    let errors = |peak: f64| Errors { peak, rms: 0.5 * peak };
    CausesResult {
        whole: errors(4e-4),
        without: vec![Without { cause: Cause::SensorNoise, left: errors(1e-4) }],
        without_all: errors(1e-5),
        bound: Bound { sensor: errors(5e-5), delay: errors(2e-5), paddle: 0.0 },
    }
}

fn needle() -> NeedleResult {
    let point = |time_s: f64| NeedlePoint {
        time_s,
        depth: 0.02 * time_s,
        base_force: 3.0 * time_s,
        tip_force: 2.0 * time_s,
        friction: time_s,
        cut_length: (time_s > 1.0).then_some(0.01 * time_s),
        largest_slip: 0.01 * time_s,
    };
    let station = |arc_length: f64| StationState { arc_length, slip: 0.1 - arc_length, friction: 1.0, normal: 0.5 };
    NeedleResult {
        points: [0.0, 2.5, 5.0].map(point).to_vec(),
        shaft_depth: 0.1,
        shaft: [0.0, 0.1].map(station).to_vec(),
    }
}

fn timing() -> LoopTiming {
    let distribution = Distribution {
        count: 3,
        p50_ns: 1_000,
        p999_ns: 900_000,
        max_ns: 900_000,
        bins_us: vec![(0, 1), (1, 1), (900, 1)],
        ..Distribution::default()
    };
    LoopTiming {
        rate_hz: 1000.0,
        ticks: 3,
        scheduling: Scheduling::default(),
        release_lateness: distribution.clone(),
        execution_time: distribution.clone(),
        response_time: distribution,
        ..LoopTiming::default()
    }
}

fn rest() -> Vec<[f64; 2]> {
    (0..9).map(|i| [f64::from(i % 3) * 0.5, f64::from(i / 3) * 0.5]).collect()
}

fn paddle_placement(index: u32) -> PaddlePlacement {
    PaddlePlacement {
        index,
        jacobian: [[1.0, 0.0], [0.0, 1.0]],
        controllability_measure: Some(3.0 + f64::from(index)),
        best_direction: Some([1.0, 0.0]),
        depth: vec![0.1],
        orthogonal: vec![-0.001 * f64::from(index)],
        max_orthogonal: 0.001 * f64::from(index),
        reached_depth: 0.1,
        failure: Some(StudyFailure { reason: FailureReason::NotConverged, detail: EVIL.to_owned() }),
    }
}

fn run(scene: &str) -> RunResult {
    let placement = |tissue: TissueVariant| PlacementResult {
        tissue,
        nodes: 9,
        integration: Integration::default(),
        wall_s: 0.1,
        best_static: 1,
        best_dynamic: Some(1),
        paddles: vec![paddle_placement(1), paddle_placement(2)],
        no_paddle: None,
    };
    let case = |tissue: TissueVariant, table_tissue: TableTissue| CaseResult {
        tissue,
        table_tissue,
        table: TableResult {
            hash: EVIL.to_owned(),
            scene_hash: EVIL.to_owned(),
            paddle: 1,
            knots: 2,
            bytes: 100,
            loop_gain: 0.2,
            delay_samples: 1,
            depth: vec![0.0, 0.1],
            paddle_path: vec![[0.0; 2]; 2],
            ends_early: None,
        },
        strategies: Strategies {
            none: Some(strategy(RunMode::Lockstep, None, 2e-3)),
            static_paddle: Some(strategy(RunMode::Lockstep, Some(2), 4e-4)),
            dynamic: Some(strategy(RunMode::Lockstep, Some(1), 1e-5)),
            dynamic_free_run: Some(strategy(RunMode::FreeRun, Some(1), 1e-5)),
        },
        improvement: Some(40.0),
        improvement_over_none: Some(200.0),
        causes: Some(causes()),
    };
    RunResult {
        format: FORMAT,
        version: EVIL.to_owned(),
        scene: scene.to_owned(),
        units: [EVIL.to_owned(), EVIL.to_owned()],
        mode: RunMode::Lockstep,
        seed: 1,
        settings: SimulationSettings {
            needle_depth: None,
            rate_hz: 1000.0,
            insertion_s: 5.0,
            wait_s: 0.0,
            pauses_s: 0.0,
            duration_s: 5.5,
            depth: 0.1,
            world: Vec::new(),
            table_knows_the_world: true,
            sensor: "ideal".to_owned(),
            feedback: "observer".to_owned(),
            target_rate_hz: 50.0,
            target_latency_ms: 20.0,
            noise: 1e-5,
            paddle_lag_ms: 0.0,
            paddle_delay_ticks: 0,
            paddle_gain: 1.0,
            paddle_max_rate: 0.1,
            paddle_max_displacement: 0.1,
        },
        geometry: Geometry {
            outline: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
            immobile: vec![vec![[1.0, 0.0], [1.0, 1.0]]],
            needle_contact: vec![[0.4, 1.0], [0.6, 1.0]],
            needle_axis: [0.0, -1.0],
            orthogonal: [1.0, 0.0],
            target: [0.5, 0.5],
            paddles: vec![
                PaddleGeometry { index: 1, segment: [[0.0, 0.5], [0.0, 0.0]] },
                PaddleGeometry { index: 2, segment: [[0.0, 0.5], [0.0, 1.0]] },
            ],
            inclusions: vec![vec![[0.6, 0.6], [0.8, 0.6], [0.8, 0.8]]],
            nodes: rest(),
        },
        placements: vec![placement(TissueVariant::Homogeneous), placement(TissueVariant::Inclusion)],
        cases: vec![
            case(TissueVariant::Homogeneous, TableTissue::OfThisScene(TissueVariant::Homogeneous)),
            case(TissueVariant::Inclusion, TableTissue::OfAnotherScene(EVIL.to_owned())),
        ],
        wall_s: 1.0,
        command: vec!["host-sim".to_owned(), EVIL.to_owned()],
        platform: EVIL.to_owned(),
    }
}

/// Every drawing of a page, read as XML.
fn drawings(page: &str) -> Vec<&str> {
    page.split("<svg").skip(1).map(|rest| &rest[..rest.find("</svg>").unwrap()]).collect()
}

fn labels(page: &str) -> Vec<String> {
    drawings(page)
        .iter()
        .map(|drawing| {
            let text = format!("<svg{drawing}</svg>");
            let document = roxmltree::Document::parse(&text).unwrap();
            document.root_element().attribute("aria-label").unwrap().to_owned()
        })
        .collect()
}

fn assert_finite(svg: &str) {
    for wrong in ["NaN", "inf", "null"] {
        // Words may have these letters; coordinates stand in quotation marks or between commas and spaces.
        for start in ["\"", ",", " ", "-"] {
            for end in ["\"", ",", " "] {
                assert!(!svg.contains(&format!("{start}{wrong}{end}")), "{wrong}");
            }
        }
    }
}

/// Inclusions are drawn into the bodies that have them, where their nodes have taken them, and into no other.
#[test]
fn inclusions_move_with_the_bodies_that_have_them() {
    let run = run("paper");
    let surface = scene::Surface::new(&run);
    let moved: Vec<[f64; 2]> = rest().iter().map(|[x, y]| [x + 0.05, y - 0.1]).collect();
    let rim = |tissue, nodes: &[[f64; 2]]| {
        let mut strategy = run.cases[0].strategies.controlled().unwrap().clone();
        strategy.deformed_nodes = nodes.to_vec();
        let text = inline(&surface.body(&run, tissue, (String::new(), ""), &strategy)).into_string();
        let document = roxmltree::Document::parse(&text).unwrap();
        let rims = document.descendants().filter(|part| part.attribute("class") == Some("lump"));
        rims.map(|rim| rim.attribute("points").unwrap().to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(rim(TissueVariant::Homogeneous, &moved), [""; 0]);
    let points = |text: &str| -> Vec<f64> { text.split([' ', ',']).map(|number| number.parse().unwrap()).collect() };
    let [before, after] = [rest(), moved].map(|nodes| points(&rim(TissueVariant::Inclusion, &nodes)[0]));
    let expected = surface.view.path(&run.geometry.inclusions[0]).concat();
    assert_eq!(before.len(), expected.len());
    assert!(before.iter().zip(&expected).all(|(found, at)| (found - at).abs() < 0.06), "{before:?} {expected:?}");
    let [right, down] = [0.05, 0.1].map(|by| surface.view.length(by));
    for (place, (before, after)) in before.iter().zip(&after).enumerate() {
        let by = if place % 2 == 0 { right } else { down };
        assert!((after - before - by).abs() < 0.12, "{place}: {before} {after} {by}");
    }
}

#[test]
fn every_part_and_every_chart_is_there() {
    let page = render(&run("paper"));
    for (id, title) in PARTS {
        assert!(page.contains(&format!("<section id=\"{id}\">")), "{title}");
    }
    let labels = labels(&page);
    for (start, number) in [
        ("Scene paper at rest", 1),
        ("Body at full depth", 6),
        ("Colours", 1),
        ("Static error", 2),
        ("Controllability measure", 2),
        ("Orthogonal error along the insertion", 2),
        ("Orthogonal error of the dynamic paddle", 2),
        ("Paddle displacement", 2),
        ("Histogram of the release lateness", 2),
        ("Histogram of the execution time", 2),
        ("Histogram of the response time", 2),
    ] {
        assert_eq!(labels.iter().filter(|label| label.starts_with(start)).count(), number, "{start}");
    }
    assert!(page.contains("The geometry is inferred."));
    assert!(!render(&run("mine")).contains("The geometry is inferred."));
}

/// Of a scene that the paper knows nothing of, nothing is as in the paper, least of all where there is no optimum.
#[test]
fn a_scene_without_a_dynamic_paddle_says_so_and_agrees_with_nothing() {
    for scene in ["mine", "paper"] {
        let mut run = run(scene);
        assert!(!render(&run).contains("best dynamic paddle none"));
        for placement in &mut run.placements {
            placement.best_dynamic = None;
        }
        let page = render(&run);
        assert!(page.contains("best dynamic paddle none") && !page.contains("as in the paper"), "{scene}");
        // Without the tags between its lines.
        let words: String =
            page.split('<').filter_map(|part| part.split_once('>')).map(|(_, text)| format!("{text} ")).collect();
        let words = words.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words.contains("no paddle moves the target sideways"), "{scene}");
        assert!(!page.contains("★"), "{scene}: nothing is best");
        let text = crate::report::terminal::summary::summary(&run, "out".as_ref());
        assert_eq!(text.matches("DIFFERENT").count(), if scene == "paper" { 2 } else { 0 }, "{text}");
    }
}

/// What the bodies can be coloured by: what the result has, and no more.
#[test]
fn fields_that_a_result_does_not_have_are_not_offered() {
    let offered = |run: &RunResult| {
        let page = render(run);
        let from = page.find("<select id=\"field\">").unwrap();
        let list = &page[from..from + page[from..].find("</select>").unwrap()];
        list.split("value=\"").skip(1).map(|rest| rest[..rest.find('"').unwrap()].to_owned()).collect::<Vec<_>>()
    };
    let mut run = run("paper");
    assert_eq!(offered(&run), ["size", "orthogonal", "strain", "von_mises"]);
    let each = |run: &mut RunResult, act: fn(&mut BodyFrame)| {
        for case in &mut run.cases {
            let all = &mut case.strategies;
            let all = [&mut all.none, &mut all.static_paddle, &mut all.dynamic, &mut all.dynamic_free_run];
            all.into_iter().flatten().flat_map(|strategy| &mut strategy.frames).for_each(act);
        }
    };
    each(&mut run, |frame| frame.von_mises.clear());
    assert_eq!(offered(&run), ["size", "orthogonal", "strain"]);
    each(&mut run, |frame| frame.strain.clear());
    assert_eq!(offered(&run), ["size", "orthogonal"]);
}

/// What the page tells under the pointer can be told: every curve has a name, and every chart what its axes stand for.
#[test]
fn every_curve_can_be_read() {
    let page = render(&run("paper"));
    let mut curves = 0;
    for drawing in drawings(&page) {
        let text = format!("<svg{drawing}</svg>");
        let document = roxmltree::Document::parse(&text).unwrap();
        let with = |name: &'static str| document.descendants().filter(move |node| node.has_attribute(name));
        for frame in document.descendants().filter(|node| node.attribute("class") == Some("frame")) {
            for axis in ["data-x", "data-y"] {
                let words: Vec<&str> = frame.attribute(axis).unwrap().split(' ').collect();
                let [low, high] = [words[0], words[1]].map(|word| word.parse::<f64>().unwrap());
                assert!(low < high && ["linear", "log"].contains(&words[2]), "{words:?}");
            }
            assert!(frame.attribute("data-x-name").is_some());
        }
        assert!(with("data-name").count() == 0 || with("data-x").count() == 1, "{drawing}");
        curves += with("data-name").count();
    }
    // Two cases of three strategies, two enlarged, two components of the paddle, three forces, one slip.
    assert!(curves >= 2 * (3 + 2 + 2 + 3 + 1), "{curves}");
}

/// What would make a run worthless stands in its first lines.
#[test]
fn the_conclusion_says_what_spoils_it() {
    let said = |run: &RunResult| conclusion::sentences(run).join(" ");
    let mut good = run("mine");
    for case in &mut good.cases {
        for strategy in [&mut case.strategies.dynamic, &mut case.strategies.dynamic_free_run].into_iter().flatten() {
            strategy.run_share = Some(1.0);
        }
    }
    let text = said(&good);
    assert_eq!(conclusion::sentences(&good).len(), 3, "{text}");
    assert!(
        text.contains("200 times smaller than without a paddle and 40 times smaller than the best static"),
        "{text}"
    );
    assert!(text.contains("in RUN all the time") && text.contains("none of 12 deadlines was missed"), "{text}");
    assert!(text.contains("no tick or sample is unaccounted for"), "{text}");

    let free_run = |run: &mut RunResult, act: fn(&mut StrategyResult)| {
        act(run.cases[1].strategies.dynamic_free_run.as_mut().unwrap());
    };
    let mut run = good.clone();
    free_run(&mut run, |strategy| {
        (strategy.run_share, strategy.outside_run_for) = (Some(0.834), Faults::NEEDLE_STALE);
    });
    assert!(said(&run).contains("in RUN for only 83 % of an insertion (free-run, NEEDLE_STALE)"), "{}", said(&run));
    // What answered for the tissue, and a table that is too short.
    let off = |share: f64, why: Option<&str>| {
        let mut run = good.clone();
        let plant = &mut run.cases[1].strategies.dynamic.as_mut().unwrap().plant;
        plant.model = PlantModel::Reduced;
        (plant.extrapolation_error, plant.not_verified) = (Some(share * 1e-5), why.map(str::to_owned));
        said(&run)
    };
    assert!(
        off(0.3, None).contains("That is not to be trusted: its tissue is up to 30 % of that off"),
        "{}",
        off(0.3, None)
    );
    assert!(!off(0.2, None).contains("trusted"), "{}", off(0.2, None));
    assert!(
        off(0.2, Some("no way")).contains("how far its tissue is off is not known"),
        "{}",
        off(0.2, Some("no way"))
    );
    assert!(!off(0.3, Some("no way")).contains("--plant full"), "{}", off(0.3, Some("no way")));
    assert!(off(1e9, None).contains("its tissue is off by more than ten times that"), "{}", off(1e9, None));
    // Where the full model was tried in its place, that is known, and so is how far off this one was.
    let mut run = good.clone();
    let plant = &mut run.cases[1].strategies.dynamic.as_mut().unwrap().plant;
    (plant.model, plant.extrapolation_error) = (PlantModel::Reduced, Some(0.3e-5));
    plant.not_in_full = Some("no way".to_owned());
    let expected = "its tissue is up to 30 % of that off; the full model was tried and ended (no way)";
    assert!(said(&run).contains(expected), "{}", said(&run));
    // Between its solves the full model is as exact as is asked for, and where next to nothing is left that is much of it.
    let mut run = good.clone();
    run.cases[1].strategies.dynamic.as_mut().unwrap().plant.extrapolation_error = Some(4e-5);
    assert!(!said(&run).contains("trusted"), "{}", said(&run));
    let mut run = good.clone();
    run.cases[1].table.ends_early = Some("it ends".to_owned());
    assert!(
        said(&run).contains(
            "Past the end of its table the controller goes on with the last knot, to twice that depth at most: tissue "
        ),
        "{}",
        said(&run)
    );
    let mut run = good.clone();
    free_run(&mut run, |strategy| strategy.plant_timing.as_mut().unwrap().deadline_misses = 2);
    assert!(said(&run).contains("2 of 12 deadlines were MISSED"), "{}", said(&run));
    let mut run = good.clone();
    free_run(&mut run, |strategy| strategy.ledger.as_mut().unwrap().unaccounted = 7);
    assert!(said(&run).contains("7 ticks or samples are UNACCOUNTED"), "{}", said(&run));
    for case in &mut run.cases {
        (case.improvement, case.improvement_over_none) = (Some(0.5), Some(0.2));
    }
    assert!(said(&run).contains("5.0 times larger than without a paddle"), "{}", said(&run));
    // Whoever reads that is told what to do, and what is best is marked.
    assert!(said(&run).contains(": leave the paddle away here"), "{}", said(&run));
    let mut still = run.clone();
    still.cases.iter_mut().for_each(|case| case.improvement_over_none = Some(3.0));
    assert!(said(&still).contains("hold it still here") && !said(&good).contains("still here"), "{}", said(&still));
    assert!(!said(&good).contains("away"), "{}", said(&good));
    let marked = |run: &RunResult, column: usize| {
        let page = render(run);
        let rows = page.split("<tbody>").nth(1).unwrap().split("</tbody>").next().unwrap().to_owned();
        rows.split("<tr>").skip(1).all(|row| row.split("<td").nth(column).unwrap().starts_with(" class=\"best\""))
    };
    // A factor that is no number decides nothing.
    let mut unknown = run.clone();
    unknown.cases.iter_mut().for_each(|case| case.improvement = Some(f64::NAN));
    for (run, best) in [(&good, 4), (&still, 3), (&run, 2), (&unknown, 2)] {
        assert!((2..5).all(|column| marked(run, column) == (column == best)), "{best}");
    }
    // Without a paddle it makes no difference what a table knows.
    let page = render(&good);
    let rows = page.split("<tbody>").nth(1).unwrap().split("</tbody>").next().unwrap();
    assert!(rows.split("<tr>").skip(1).all(|row| !row.split("<td").nth(2).unwrap().contains('–')), "{rows}");
}

/// A target that moves by less than a measurement is off is no matter of feedback, and whoever reads that it got worse reads why.
#[test]
fn feedback_below_the_noise_is_told() {
    let said = |run: &RunResult| conclusion::sentences(run).join(" ");
    let told = "less than the sensor's noise of";
    let with = |noise_over_moved: f64, improvement: f64| {
        let mut run = run("mine");
        let moved = |case: &CaseResult| case.strategies.none.as_ref().map(|none| none.max_orthogonal_error);
        let moved = run.cases.iter().filter_map(moved).fold(0.0, f64::max);
        run.settings.noise = noise_over_moved * moved;
        run.cases.iter_mut().for_each(|case| case.improvement = Some(improvement));
        run
    };
    assert!(!said(&with(0.9, 0.5)).contains(told) && !said(&with(f64::NAN, 0.5)).contains(told));
    let worse = said(&with(1.1, 0.5));
    assert!(
        worse.contains(told) && worse.contains("the best static paddle, which needs no sensor, leaves less"),
        "{worse}"
    );
    let better = said(&with(1.1, 2.0));
    assert!(better.contains(told) && better.contains("is the table's doing"), "{better}");
    for (beaten, told) in [(usize::MAX, "stillest without any paddle"), (1, "stillest without any paddle in 1 of ")] {
        let mut run = with(1.1, 0.5);
        run.cases.iter_mut().take(beaten).for_each(|case| case.improvement_over_none = Some(0.3));
        assert!(said(&run).contains(told) && !said(&run).contains("what the dynamic"), "{}", said(&run));
    }
    let on_screen = |run: &RunResult| crate::report::terminal::summary::summary(run, "there".as_ref());
    assert!(on_screen(&with(1.1, 0.5)).contains(told) && !on_screen(&with(0.9, 0.5)).contains(told));
    // Without an insertion that has no paddle there is nothing to hold it against.
    let mut unknown = with(1.1, 0.5);
    unknown.cases.iter_mut().for_each(|case| case.strategies.none = None);
    assert!(!said(&unknown).contains(told));
}

/// The loop that runs beside the one in a row is not in that row.
#[test]
fn free_run_beside_lockstep_has_its_own_word_on_its_tissue() {
    let on_screen = |run: &RunResult| crate::report::terminal::summary::summary(run, "there".as_ref());
    let off = |in_row: bool| {
        let mut run = run("mine");
        let strategies = &mut run.cases[1].strategies;
        let of = if in_row { &mut strategies.dynamic } else { &mut strategies.dynamic_free_run };
        let found = of.as_mut().unwrap();
        (found.plant.model, found.plant.path_knots) = (PlantModel::Reduced, Some(9));
        found.plant.extrapolation_error = Some(0.5 * found.max_orthogonal_error);
        on_screen(&run)
    };
    let marked = |text: &str| -> Vec<String> {
        text.lines().filter(|line| line.contains("NOT TO BE TRUSTED")).map(str::to_owned).collect()
    };
    assert!(marked(&on_screen(&run("mine"))).is_empty());
    let (beside, in_row) = (marked(&off(false)), marked(&off(true)));
    assert!(beside.len() == 1 && beside[0].contains("free-run: tissue") && beside[0].contains("50 %"), "{beside:?}");
    assert!(in_row.len() == 1 && !in_row[0].contains(": tissue"), "{in_row:?}");
}

#[test]
fn strings_of_the_result_are_text() {
    let page = render(&run(EVIL));
    assert!(!page.contains("<script>alert"));
    assert_eq!(page.matches("<script").count(), 2, "the data and the page's own script");
    assert!(page.contains("&lt;script&gt;alert"));
    // Nothing to load, and nothing that could be.
    for address in ["http:", "https:", "src=", "url(", "@import"] {
        assert!(!page.contains(address), "{address}");
    }
}

#[test]
fn numbers_that_are_none_leave_the_page_whole() {
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut run = run("paper");
        run.placements[0].paddles[0].orthogonal = vec![wrong];
        run.placements[0].paddles[1].orthogonal.clear();
        run.placements[0].paddles[1].controllability_measure = Some(wrong);
        run.placements[1].paddles[1].best_direction = None;
        run.placements[1].paddles[0].max_orthogonal = wrong;
        run.cases[0].improvement = Some(wrong);
        run.geometry.nodes[4] = [wrong, wrong];
        run.geometry.target = [wrong, 0.0];
        let dynamic = run.cases[0].strategies.dynamic.as_mut().unwrap();
        dynamic.series[1].orthogonal_error = wrong;
        dynamic.series[2].paddle = [wrong, 0.0];
        dynamic.deformed_nodes[3] = [wrong, 0.0];
        dynamic.frames[0].nodes[3] = [wrong, 0.0];
        dynamic.max_orthogonal_error = wrong;
        let page = render(&run);
        drawings(&page).into_iter().for_each(assert_finite);
        labels(&page);
        for (name, svg) in pictures(&run) {
            assert_finite(&svg);
            roxmltree::Document::parse(&svg).unwrap_or_else(|error| panic!("{name}: {error}"));
        }
    }
}

#[test]
fn results_with_nothing_in_them_have_a_page() {
    let mut run = run("mine");
    run.cases.clear();
    run.placements.clear();
    run.geometry = Geometry { needle_axis: [0.0, -1.0], ..empty_geometry() };
    labels(&render(&run)).iter().for_each(|label| assert!(!label.is_empty()));
    pictures(&run).iter().for_each(|(_, svg)| assert_finite(svg));
}

fn empty_geometry() -> Geometry {
    Geometry {
        outline: Vec::new(),
        immobile: Vec::new(),
        needle_contact: Vec::new(),
        needle_axis: [0.0; 2],
        orthogonal: [0.0; 2],
        target: [0.0; 2],
        paddles: Vec::new(),
        inclusions: Vec::new(),
        nodes: Vec::new(),
    }
}

#[test]
fn pictures_are_files_of_their_own() {
    let pictures = pictures(&run(EVIL));
    let names: Vec<_> = pictures.iter().map(|picture| picture.0).collect();
    let expected = [
        "scene.svg",
        "static-error.svg",
        "controllability.svg",
        "error-along-insertion.svg",
        "needle-forces.svg",
        "causes.svg",
        "timing-histogram.svg",
    ];
    assert_eq!(names, expected);
    for (name, svg) in pictures {
        let document = roxmltree::Document::parse(&svg).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(document.root_element().attribute("viewBox").is_some());
        assert!(!svg.contains("var("), "{name}");
        assert!(svg.contains("fill=\"#ffffff\""), "{name}");
    }
}

#[test]
fn a_paddle_that_makes_it_worse_is_said_to() {
    assert_eq!(conclusion::change(&[277.3]), "277 times smaller");
    assert_eq!(conclusion::change(&[2.5, 40.2]), "2.5 to 40 times smaller");
    assert_eq!(conclusion::change(&[0.02]), "50 times larger");
    assert_eq!(conclusion::change(&[0.5, 0.02]), "2.0 to 50 times larger");
    assert_eq!(conclusion::change(&[0.5, 4.0]), "between 2.0 times larger and 4.0 times smaller");
}
