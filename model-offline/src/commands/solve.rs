//! `model-offline solve`: one equilibrium.

use super::common::{self, DiscretizationArgs, RunArgs, SceneArgs, StudyProgress};
use super::error::CliError;
use super::for_paraview::ForParaView;
use super::json::write_json;
use super::solve_space::{self, SpaceArgs};
use model_offline::model::jumps::{Jump, TargetPath};
use model_offline::model::{Body, ModelError, Pose, TissueModel};
use model_offline::needle::{EnergyAccount, Inserted, SlippingNeedle, Way, insert};
use model_offline::number::{in_unit, length};
use model_offline::output;
use model_offline::output::terminal::complain;
use model_offline::output::vtu::{self, Shown};
use model_offline::output::{Geometry, NodalFields, State, body, check_outputs, has_stress};
use model_offline::placement::{controllability, discretise};
use model_offline::say;
use model_offline::scene::Scene;
use model_offline::scene::space::SpaceScene;
use model_offline::solver::equilibrium::{Equilibrium, NewtonSettings};
use nalgebra::{Matrix2, Vector2};
use std::path::{Path, PathBuf};

/// How much deeper than the scene's a depth may be that was computed from it, as a part of it.
const ROUNDING: f64 = 1e-6;

/// Options of `solve`.
#[derive(Debug, clap::Args)]
pub(super) struct SolveArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Index of the paddle that is attached [default: none]; in space also several, as in `3,8`
    #[arg(long, value_delimiter = ',', num_args = 1, value_parser = common::paddle_index)]
    paddle: Vec<u32>,
    /// Needle depth, length units.
    #[arg(long)]
    depth: f64,
    /// Paddle displacement, length units; in space three numbers, and once for every paddle, in their order. The paddle goes there
    /// along with the needle; the Jacobian is that of a paddle that moves once both are there. Where the needle slips these differ.
    #[arg(
        long,
        requires = "paddle",
        value_name = "X,Y[,Z]",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true
    )]
    paddle_displacement: Option<Vec<f64>>,
    /// Hold needle and paddle there for so many seconds: tissue that relaxes goes on.
    #[arg(long, default_value_t = 0.0, value_name = "SECONDS")]
    dwell: f64,
    /// Write the result as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write displacement, strain and stress for ParaView; beside it needle, target and paddles (-parts.vtu) and a script that
    /// shows all of it (.py).
    #[arg(long, value_name = "FILE")]
    vtu: Option<PathBuf>,
    /// Draw the deformed body; in space its outside and three sections through the target.
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    #[command(flatten)]
    discretization: DiscretizationArgs,
    #[command(flatten)]
    run: RunArgs,
}

pub(super) fn run(args: &SolveArgs) -> Result<(), CliError> {
    if !args.depth.is_finite() || args.depth < 0.0 {
        return Err(CliError::usage(format!("--depth is {}", args.depth), "give a depth of 0 or more"));
    }
    if let Some(scene) = args.scene.read_in_space()? {
        let scene = args.discretization.over_space(scene)?;
        check_all_outputs(&args.scene.files(&scene), args)?;
        return in_space(&scene, args);
    }
    let scene = args.discretization.over(args.scene.read_still()?)?;
    let paddle = match args.paddle[..] {
        [] => None,
        [index] => Some(index),
        _ => {
            let help = "give one: in the plane one paddle is attached at a time";
            return Err(CliError::usage(format!("--paddle names {} paddles", args.paddle.len()), help));
        }
    };
    let displacement = match args.paddle_displacement.as_deref() {
        None => Vector2::zeros(),
        Some([x, y]) if x.is_finite() && y.is_finite() => Vector2::new(*x, *y),
        Some(_) => {
            return Err(CliError::usage(
                "--paddle-displacement takes two finite numbers",
                "e.g. --paddle-displacement 0.01,-0.002",
            ));
        }
    };
    common::check_displacements(displacement.as_slice(), scene.outline.size())?;
    common::check_depth(args.depth, scene.outline.size())?;
    if !args.dwell.is_finite() || args.dwell < 0.0 {
        return Err(CliError::usage(format!("--dwell is {}", args.dwell), "give seconds, 0 or more"));
    }
    if args.dwell > 0.0 && !scene.relaxes() {
        return Err(CliError::usage(
            "--dwell changes nothing: this tissue does not relax",
            "add [material.relaxation] to the scene, or leave --dwell out",
        ));
    }
    if scene.needle.shaft.is_some() && args.depth > scene.needle.depth * (1.0 + ROUNDING) {
        return Err(CliError::usage(
            format!("--depth is {}, and the needle of this scene goes to {}", args.depth, scene.needle.depth),
            "raise depth in [needle]: nodes are placed along its shaft",
        ));
    }
    note_what_is_too_deep(&scene, args.depth);
    let (gone, available) = (displacement.norm(), scene.actuator.max_displacement);
    if gone > available {
        let [gone, available] = [gone, available].map(|length| in_unit(length, &scene.length_unit));
        complain(&format!("note: the paddle is {gone} from rest, and [actuator] max_displacement is {available}"));
    }
    check_all_outputs(&[&args.scene.scene], args)?;
    solve(&scene, Held { paddle, displacement }, args).map_err(|error| error.reported(args.json.as_deref(), &scene))
}

/// That all files that are asked for can be written and are none of these.
fn check_all_outputs(inputs: &[&Path], args: &SolveArgs) -> Result<(), CliError> {
    let vtu = args.vtu.as_deref().map(ForParaView::beside);
    let mut outputs = vec![("--json", args.json.as_deref()), ("--svg", args.svg.as_deref())];
    outputs.extend(vtu.iter().flat_map(ForParaView::outputs));
    Ok(check_outputs(inputs, &outputs)?)
}

/// Says what would be unusual about the scene if its needle went as deep as is asked for.
fn note_what_is_too_deep(scene: &Scene, depth: f64) {
    let mut deeper = scene.clone();
    deeper.needle.depth = depth.max(scene.needle.depth);
    let known = scene.warnings();
    for warning in deeper.warnings().iter().filter(|warning| !known.contains(warning)) {
        complain(&format!("note: {}", warning.told(&scene.length_unit)));
    }
}

/// The same of a scene in space, without the options of the plane.
fn in_space(scene: &SpaceScene, args: &SolveArgs) -> Result<(), CliError> {
    if args.dwell != 0.0 {
        return Err(CliError::usage("--dwell is planar", "leave --dwell out: tissue does not relax in space"));
    }
    let asked = SpaceArgs {
        paddles: &args.paddle,
        displacements: args.paddle_displacement.as_deref().unwrap_or_default(),
        depth: args.depth,
        json: args.json.as_deref(),
        vtu: args.vtu.as_deref(),
        svg: args.svg.as_deref(),
        threads: args.run.threads(),
        quiet: args.run.quiet,
        progress: &StudyProgress::new(&args.run, scene.discretization.resolution),
    };
    solve_space::run(scene, asked)
}

/// The paddle, and where it is.
#[derive(Debug, Clone, Copy)]
struct Held {
    paddle: Option<u32>,
    displacement: Vector2<f64>,
}

fn solve(scene: &Scene, held: Held, args: &SolveArgs) -> Result<(), CliError> {
    let progress = StudyProgress::new(&args.run, scene.discretization.resolution);
    let (model, _) = discretise(scene)?;
    let Held { paddle, displacement } = held;
    let position = paddle.map(|index| scene.paddle_position(index)).transpose().map_err(ModelError::from)?;
    // Nodes are placed along a shaft: it ends where they end.
    let depth = if scene.needle.shaft.is_some() { args.depth.min(scene.needle.depth) } else { args.depth };
    // In pieces of the scene's increment: the path matters near the limits of stability, and to a needle that slips.
    let increments = (depth / scene.needle.depth * f64::from(scene.needle.increments)).ceil().max(1.0) as u32;
    let way = Way { depth, paddle: displacement, increments, seconds: args.depth / scene.needle.speed };
    progress.follow(increments);
    let mut path = None;
    let mut solved = match scene.needle.shaft {
        Some(_) => match insert(&model, position, way)? {
            Inserted::Pushing(body) => Solved::Pushing(body),
            Inserted::Within { needle, punctured_at } => Solved::Within(needle, punctured_at),
        },
        None => {
            let mut body = model.body(position, NewtonSettings::default()).map_err(ModelError::from)?;
            let end = Pose { depth: args.depth, paddle: displacement, ..Pose::default() };
            // What tissue does that relaxes is no matter of the controls alone.
            let is_followed = args.depth > 0.0 && !scene.relaxes();
            path = is_followed.then(|| TargetPath::from_rest(&mut body, displacement / args.depth));
            for increment in 1..=increments {
                let pose = Pose::default().towards(&end, f64::from(increment) / f64::from(increments));
                if let Err(failure) = body.take_in(pose, way.seconds / f64::from(increments)) {
                    warn(path.as_ref(), scene);
                    return Err(CliError::Solve { failure, depth: body.depth() });
                }
                if let Some(path) = &mut path {
                    path.goes_on(&mut body);
                }
                progress.increment();
            }
            Solved::Pushing(Box::new(body))
        }
    };
    solved.dwell(args.dwell)?;
    progress.finish();
    write(&model, &mut solved, (held, path.as_ref()), args)?;
    warn(path.as_ref(), scene);
    if !args.run.quiet {
        print(scene, &solved, held, args);
    }
    Ok(())
}

/// Tells of a jump on the way.
fn warn(path: Option<&TargetPath>, scene: &Scene) {
    let Some(Jump { from, to, off }) = path.and_then(TargetPath::jump) else { return };
    let [from, to, off] = [from, to, off].map(|length| in_unit(length, &scene.length_unit));
    complain(&format!(
        "warning: between depth {from} and {to} the tissue seems to go over to another equilibrium, as where a surface folds: the target \
         ends {off} from where its slopes lead, and numbers beyond depend on the nodes"
    ));
}

/// What the needle has come to.
enum Solved<'m> {
    /// It pushes the contact.
    Pushing(Box<Body<'m>>),
    /// It is in, and punctured the skin at this depth.
    Within(Box<SlippingNeedle<'m>>, f64),
}

impl Solved<'_> {
    fn target_displacement(&self) -> Vector2<f64> {
        match self {
            Self::Pushing(body) => body.target_displacement(),
            Self::Within(needle, _) => needle.target_displacement(),
        }
    }

    fn coefficients(&self) -> &[f64] {
        match self {
            Self::Pushing(body) => body.equilibrium().coefficients(),
            Self::Within(needle, _) => needle.equilibrium().coefficients(),
        }
    }

    fn equilibrium(&self) -> &Equilibrium<2> {
        match self {
            Self::Pushing(body) => body.equilibrium(),
            Self::Within(needle, _) => needle.equilibrium(),
        }
    }

    /// Holds everything where it is for so many seconds, in steps that grow: relaxation is fastest at first.
    fn dwell(&mut self, seconds: f64) -> Result<(), CliError> {
        const STEPS: u32 = 40;
        let until = |step: u32| seconds * (f64::from(step) / f64::from(STEPS)).powi(3);
        for step in 1..=if seconds > 0.0 { STEPS } else { 0 } {
            let elapsed = until(step) - until(step - 1);
            match self {
                Self::Pushing(body) => body
                    .take_in(body.pose(), elapsed)
                    .map_err(|failure| CliError::Solve { failure, depth: body.depth() })?,
                Self::Within(needle, _) => needle.take_in(needle.pose(), elapsed)?,
            }
        }
        Ok(())
    }

    fn jacobian(&mut self) -> Result<Matrix2<f64>, CliError> {
        match self {
            Self::Pushing(body) => {
                body.actuation_jacobian().map_err(|failure| CliError::Solve { failure, depth: body.depth() })
            }
            Self::Within(needle, _) => Ok(needle.actuation_jacobian()?),
        }
    }

    /// What is told of the needle.
    fn needle(&self, scene: &Scene, depth: f64) -> serde_json::Value {
        let tip = |at: Vector2<f64>| [at.x, at.y];
        match self {
            Self::Pushing(body) => {
                let (entry, force) = (scene.needle.entry(), body.contact_force());
                serde_json::json!({
                    "base_force": force, "tip_force": force, "cut_length": 0.0, "punctured_at": null,
                    "tip_position": tip(entry + scene.needle.axis * depth), "shaft": [], "energy": null,
                    "depth_of_target": scene.needle.axis.dot(&(scene.target + self.target_displacement() - entry)),
                })
            }
            Self::Within(needle, punctured_at) => serde_json::json!({
                "base_force": needle.base_force(), "tip_force": needle.tip_force(), "cut_length": needle.cut_length(),
                "punctured_at": punctured_at, "tip_position": tip(needle.tip_position()), "shaft": needle.stations(),
                "energy": needle.energy(), "depth_of_target": needle.depth_of_target(),
            }),
        }
    }
}

fn print(scene: &Scene, solved: &Solved<'_>, held: Held, args: &SolveArgs) {
    let Held { displacement, .. } = held;
    let target = solved.target_displacement();
    let paddle = match held.paddle {
        Some(index) => format!("paddle {index} at ({}, {})", displacement.x, displacement.y),
        None => "no paddle".to_owned(),
    };
    say!(
        "{} · {} tissue · {paddle} · depth {}\ntarget displacement ({:.8}, {:.8}), orthogonal {:.8}, axial {:.8}",
        scene.name,
        scene.tissue(),
        args.depth,
        target.x,
        target.y,
        target.dot(&scene.needle.orthogonal()),
        target.dot(&scene.needle.axis)
    );
    match solved {
        Solved::Pushing(body) => say!("base force {:.6}", body.contact_force()),
        Solved::Within(needle, punctured_at) => {
            say!(
                "punctured at depth {}; base force {:.6}, of it at the tip {:.6}; cut {}; the target is at depth {} now",
                length(*punctured_at),
                needle.base_force(),
                needle.tip_force(),
                length(needle.cut_length()),
                length(needle.depth_of_target())
            );
            print_balance(needle.energy(), scene.relaxes());
        }
    }
}

/// Part of the work that may be missing from where it went before that is told as a fault of the increments.
const BALANCED: f64 = 0.01;

/// Where the work at base and paddle went, and whether it is all there.
fn print_balance(energy: EnergyAccount, relaxes: bool) {
    let EnergyAccount { stored, friction, cutting, .. } = energy;
    let done = energy.work + energy.paddle + energy.base;
    let kept = if relaxes { "stored or lost by relaxing" } else { "stored" };
    say!("work {done:.6}: {kept} {stored:.6}, friction {friction:.6}, cutting {cutting:.6}");
    let imbalance = energy.imbalance();
    if imbalance.abs() > BALANCED {
        say!(
            "{:.1} % of the work is {}: forces and way are followed no better than that; take more increments",
            100.0 * imbalance.abs(),
            if imbalance > 0.0 { "missing" } else { "too much in what it went into" }
        );
    }
}

/// Writes the files that are asked for.
fn write(
    model: &TissueModel,
    solved: &mut Solved<'_>,
    (Held { paddle, displacement }, path): (Held, Option<&TargetPath>),
    args: &SolveArgs,
) -> Result<(), CliError> {
    let scene = model.scene();
    let target = solved.target_displacement();
    let jacobian = paddle.map(|_| solved.jacobian()).transpose()?;
    let nodal = model.nodal_displacements(solved.coefficients()).map_err(ModelError::from)?;
    let point = |p: &Vector2<f64>| [p.x, p.y];
    let fields = NodalFields::new(model, solved.coefficients());
    let mut document = serde_json::json!({
        "scene": scene.name, "tissue": scene.tissue(), "nodes": model.nodes(), "dofs": model.dofs(),
        "integration": scene.discretization.method.integration,
        "paddle": paddle, "depth": args.depth, "paddle_displacement": point(&displacement),
        "target_displacement": point(&target), "orthogonal": target.dot(&scene.needle.orthogonal()),
        "axial": target.dot(&scene.needle.axis),
        "jacobian": jacobian.as_ref().map(controllability::rows),
        "strain_energy": solved.equilibrium().energy(),
        "newton_iterations": solved.equilibrium().effort().iterations,
        "node_positions": model.positions().iter().map(point).collect::<Vec<_>>(),
        "node_displacements": nodal.iter().map(point).collect::<Vec<_>>(),
        "units": [&scene.length_unit, &scene.stress_unit], "geometry": Geometry::new(scene, model.positions()),
        "strain": fields.strain, "von_mises": fields.von_mises,
        "failure": null,
    });
    if let Some(path) = path {
        document["jump"] = serde_json::json!(path.jump());
    }
    if let (serde_json::Value::Object(needle), Some(document)) =
        (solved.needle(scene, args.depth), document.as_object_mut())
    {
        document.extend(needle);
    }
    if let Solved::Within(needle, _) = solved {
        document["strain_energy"] = needle.energy().stored.into();
        document["energy_imbalance"] = needle.energy().imbalance().into();
    }
    if scene.relaxes() {
        // What an increment's potential is of tissue that relaxes is no energy, and what a slipping needle's work went into is not told
        // apart from what is lost: nothing is left to balance it with.
        document["strain_energy"] = serde_json::Value::Null;
        if let Solved::Within(needle, _) = solved {
            document["stored_or_lost"] = needle.energy().stored.into();
            document["energy_imbalance"] = serde_json::Value::Null;
        }
    }
    let _together = output::together();
    write_json(args.json.as_deref(), &document)?;
    let within = matches!(solved, Solved::Within(..));
    let state = State { coefficients: solved.coefficients(), depth: args.depth, within };
    if let Some(path) = &args.vtu {
        let scene = model.scene();
        let units = [&scene.length_unit[..], &scene.stress_unit];
        let shown = Shown { scene: &scene.name, units, stress: has_stress(model), ..Shown::default() };
        if !shown.stress {
            say!(
                "{}: without stress, which a displacement does not tell of this tissue (it relaxes, or its law is planar)",
                path.display()
            );
        }
        ForParaView::beside(path).write(&vtu::vtu(model, state.coefficients), &vtu::parts(model, state), shown)?;
    }
    if let Some(path) = &args.svg {
        output::write_whole(path, body::svg(model, state).as_bytes())?;
    }
    Ok(())
}
