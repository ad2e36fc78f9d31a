//! Large-deformation tissue model, paddle placement and controller tables.
//!
//! A body of soft tissue is partly immobile; a needle pushes tissue along its axis; a paddle attached to the accessible
//! boundary moves a target inside. This crate answers where the paddle belongs and what it must do:
//!
//! 1. [`scene`]: the scene file, validated, with errors that point at line and column.
//! 2. [`discretization`]: nodes (lattice or graded), kernel, moment matrix, shape functions Ψ_I, nodal cells, and
//!    integration rules. Every rule, meshfree or finite element, becomes one list of points with gradients g_I, so that
//!    there is one assembly for all.
//! 3. [`mechanics`]: strain energy W, first Piola–Kirchhoff stress P = ∂W/∂F, tangent A = ∂P/∂F;
//!    internal force `f_I = Σ_q w_q P g_I`, tangent stiffness `K_IJ = Σ_q w_q g_I · A · g_J`; Nitsche's boundary terms.
//! 4. [`solver`]: minimise the energy over the coefficients d subject to held nodal values `Λ d = g`, by Newton's method
//!    with line search and cutback; every way to fail is typed and keeps the last converged state.
//! 5. [`placement`]: actuation Jacobian J = d(target)/d(paddle) by exact linearisation, controllability measure ‖J⁻¹n‖,
//!    static study, refinement to a tolerance, and the controller's table.
//! 6. [`output`]: JSON, VTU, SVG, tables; every file whole or not at all.
//!
//! Where to begin: [precompute tables](guide::precompute), [how it works](guide::how_it_works), a
//! [worked example](guide::change_a_material).
//!
//! # Example
//! ```
//! use model_offline::placement::{TissueModel, place};
//! use model_offline::scene::Scene;
//! use model_offline::solver::equilibrium::NewtonSettings;
//!
//! let scene = Scene::bundled("paper").expect("bundled").without_inclusions();
//! let model = TissueModel::new(&scene)?;
//! let placement = place(&model, NewtonSettings::default(), 1, &|| {})?;
//! assert_eq!((placement.optimum.fixture, placement.optimum.dynamic), (4, 3)); // the paper's optima
//! # Ok::<(), model_offline::placement::ModelError>(())
//! ```

pub mod cli;
pub mod discretization;
pub mod guide;
pub mod mechanics;
pub mod output;
pub mod placement;
pub mod reduction;
pub mod scene;
pub mod solver;
pub mod study;
