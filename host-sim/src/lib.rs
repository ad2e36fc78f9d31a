//! Tissue, sensors and actuators in a process of their own, exchanging samples with the controller over shared memory.
//!
//! ```text
//! plant process                                    controller process
//! plant → sensors → ─── needle, paddle, target ──→ firmware::Controller
//!    ↑                  clock                             │
//! actuator ←──────────── command ─────────────────────────┘
//! ```
//!
//! Where to begin: [run simulations](guide::run_simulations), [check timing](guide::check_timing),
//! [inject faults](guide::inject_faults), [run on a microcontroller](guide::run_on_a_microcontroller),
//! [precompute tables](model_offline::guide::precompute), [how it works](model_offline::guide::how_it_works).
//!
//! A folder for each step of the data, each using only those before it:
//!
//! | | |
//! |---|---|
//! | [`world`] | tissue, needle drive, actuator, sensors: no I/O, no clock |
//! | [`exchange`] | shared memory between plant and controller, the serial line to a board |
//! | [`runtime`] | the loop at work: both processes, in [lockstep](runtime::plant::lockstep) and in [free-run](runtime::plant::free_run) |
//! | [`record`] | recordings of every tick, their replay, files for other tools |
//! | [`bench`](mod@bench) | strategies [compared](bench::comparison), [faults](bench::faults), [timing](bench::timing), [stability](bench::loop_stability), the controller on a [board](bench::board) |
//! | [`report`], [`view`] | what a person sees |
//!
//! Beside them stands [`process`], which ends children with their parents.
//!
//! Two modes of time, never mixed: in lockstep it comes from the messages, and the same seed gives the same bytes; in
//! free-run both processes follow the machine's steady clock with absolute deadlines. Either way every tick is recorded and
//! every sample accounted for ([`runtime::accounting::accounts`]).
//!
//! An insertion without a paddle, and with the best static one:
//!
//! ```
//! use host_sim::{Label, LoopSettings, SimulatedInsertion, Simulation, Strategy, TissueVariant};
//! use model_offline::{Scene, PlacementOptions, PlacementStudy};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scene = Scene::bundled("paper").expect("it comes with the program");
//! let PlacementStudy { model, placement, .. } = PlacementStudy::run(&scene, &PlacementOptions::default())?;
//! let loop_settings = LoopSettings { rate: 50.0, ..LoopSettings::default() };
//! let simulation = Simulation { loop_settings, ..Simulation::new(&scene).with_insertion(1.0) };
//! let label = Label::new(TissueVariant::Inclusion, Strategy::Static);
//! let insertion = SimulatedInsertion::new(&model, &simulation, label);
//!
//! let without = insertion.uncontrolled(None)?.result;
//! let held = insertion.uncontrolled(Some(placement.optimum.static_paddle))?.result;
//! assert!(held.max_orthogonal_error < without.max_orthogonal_error);
//! # Ok(())
//! # }
//! ```
//!
//! With a [`ControllerSetup`] the paddle moves, and the controller has a process of its own; a [`Comparison`] of all three
//! is what `host-sim run` does.

// In the order of use: a module uses only what stands above its group, or beside it.
pub mod process;

pub mod world;

pub mod exchange;

pub mod runtime;

pub mod record;

pub mod bench;

pub mod report;

pub mod view;

pub mod guide;

pub use bench::comparison::{Compared, Comparison, ComparisonOptions};
pub use bench::error::SimError;
pub use bench::insertion::{ControllerSetup, Extras, Label, SimulatedInsertion};
pub use bench::progress::{Progress, Silent};
pub use bench::result::RunResult;
pub use bench::strategy::Strategy;
pub use exchange::Space;
pub use model_offline::scene::TissueVariant;
pub use record::recording::Recording;
pub use record::replay::replay_file;
pub use runtime::time::mode::RunMode;
pub use world::World;
pub use world::loop_settings::LoopSettings;
pub use world::simulation::Simulation;
pub use world::tissue::WantedPlant;
