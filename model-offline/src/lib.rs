//! Large-deformation tissue model, paddle placement and controller tables.
//!
//! A body of soft tissue is partly immobile; a needle pushes tissue along its axis; a paddle attached to the accessible
//! boundary moves a target inside. This crate answers where the paddle belongs and what it must do.
//!
//! Modules in the order of the data; each uses only those above it:
//!
//! 1. [`geometry`]: points and polygons. [`material`]: strain energy W, first Piola–Kirchhoff stress P = ∂W/∂F, tangent
//!    A = ∂P/∂F.
//! 2. [`linalg`]: sparse patterns, orderings, Cholesky factors.
//! 3. [`discretization`]: nodes (lattice or graded), kernel, moment matrix, shape functions Ψ_I, nodal cells, and
//!    integration rules. Every rule, meshfree or finite element, becomes one list of points with gradients g_I, so that
//!    there is one assembly for all.
//! 4. [`mechanics`]: internal force `f_I = Σ_q w_q P g_I`, tangent stiffness `K_IJ = Σ_q w_q g_I · A · g_J`, essential
//!    boundary conditions.
//! 5. [`solver`]: minimise the energy over the coefficients d subject to prescribed nodal values `Λ d = g`, by Newton's method
//!    with line search and cutback; every way to fail is typed and keeps the last converged state.
//! 6. [`scene`]: the scene file, validated, with errors that point at line and column. [`model`]: a scene turned into a
//!    discrete body. [`needle`]: a needle that punctures, cuts and slips in it.
//! 7. [`placement`]: actuation Jacobian J = d(target)/d(paddle) by exact linearisation, controllability measure ‖J⁻¹n‖,
//!    static study, refinement to a tolerance. [`table`]: what the controller gets. [`reduction`]: what a simulator can
//!    afford at every tick.
//! 8. [`output`]: JSON, VTU, SVG, tables; every file whole or not at all. [`study`]: which method is fast, which is
//!    accurate, and where each stops working.
//!
//! Beside them stand small things that all may use: [`parallel`] (threads), [`number`] (lengths for people), [`reading`] (of no more
//! than a file may have), `random` (seeded numbers), `choice` (enums that files and command lines call by the same names).
//!
//! Where to begin: [precompute tables](guide::precompute), [how it works](guide::how_it_works), a
//! [worked example](guide::change_a_material).
//!
//! # Example
//! ```
//! use model_offline::{PlacementOptions, PlacementStudy, Scene, table};
//!
//! let scene = Scene::bundled("paper").expect("bundled").without_inclusions();
//! let study = PlacementStudy::run(&scene, &PlacementOptions::default())?;
//! let optimum = study.placement.optimum;
//! assert_eq!((optimum.static_paddle, optimum.dynamic_paddle), (4, Some(3))); // the paper's optima
//!
//! let table = table::build(&study.model, 3, &Default::default())?;
//! assert_eq!(table.paddles[0].index, 3);
//! # Ok::<(), table::TableBuildError>(())
//! ```

// In the order of use: a module uses only what stands above its group, or beside it.
mod choice;
pub mod number;
pub mod parallel;
mod random;
pub mod reading;

pub mod geometry;
pub mod material;

pub mod linalg;

pub mod discretization;

pub mod mechanics;

pub mod solver;

pub mod scene;

pub mod model;

pub mod needle;

pub mod placement;

pub mod reduction;
pub mod table;

pub mod output;

pub mod study;

pub mod guide;

pub use discretization::{Basis, Discretization, Essential, Integration, Method, Resolution};
pub use geometry::{Point2, Polygon};
pub use material::{Law, Material};
pub use model::{Body, ModelError, TissueModel};
pub use placement::{Placement, PlacementOptions, PlacementStudy, discretise, place};
pub use scene::{Scene, SceneError, TissueVariant};
pub use solver::equilibrium::{Failure, FailureReason, NewtonSettings};
pub use table::{TableBuildError, TableOptions};
