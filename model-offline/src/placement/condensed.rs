//! A body at rest with everything held that always is, and no paddle attached: what its paddles' nodes and its target answer to
//! forces on them is condensed, so that one factorisation serves every paddle and every set of them.

use crate::discretization::{Quadrature, Stencil};
use crate::linalg::CondensedFactor;
use crate::linalg::condensation::Functional;
use crate::mechanics::assembly::{AssemblyState, Medium, internal_force, tangent};
use crate::mechanics::history::Prestress;
use crate::mechanics::{ConstrainedRows, Tissue};
use crate::model::ModelError;
use crate::solver::analysis::Analysis;
use crate::solver::constrained::{ConstrainedSolver, Unknowns};
use crate::solver::equilibrium::{Failure, FailureReason};
use faer::Mat;

/// The tangent at rest, laid out by the pattern of an analysis.
///
/// # Errors
/// [`ModelError`] when the stress at rest cannot be had.
pub(super) fn tangent_at_rest<const D: usize>(
    rule: &Quadrature<D>,
    tissue: &Tissue,
    analysis: &Analysis,
) -> Result<Vec<f64>, ModelError> {
    let unknowns = analysis.pattern().unknowns();
    let stabilisation = analysis.stabilisation(rule, tissue);
    let prestress = Prestress::default();
    let medium = Medium { rule, stabilisation: &stabilisation, tissue, prestress: &prestress };
    let (mut state, mut force) = (AssemblyState::default(), vec![0.0; unknowns]);
    internal_force(medium, &vec![0.0; unknowns], &mut state, &mut force).map_err(|at| singular(&at.to_string()))?;
    let mut values = vec![0.0; analysis.pattern().entries()];
    tangent(medium, &state, analysis.blocks(), &mut values);
    Ok(values)
}

/// Says why a body at rest has no answers.
pub(super) fn singular(detail: &str) -> Failure {
    Failure { reason: FailureReason::SingularTangent, reached: 0.0, detail: detail.to_owned() }
}

/// The factor of a body at rest, some of whose nodes are retained.
#[derive(Debug)]
pub(super) struct CondensedBody<const D: usize> {
    solver: ConstrainedSolver<D>,
    condensed: CondensedFactor,
    /// Flexibility of the springs of ports, length per force; none without ports.
    spring: Option<f64>,
}

/// Stiffness of the springs of ports over the mean diagonal of the tangent. What they yield is known and taken off, so that any
/// stiffness serves that is neither so soft that it hides what is behind it, nor so stiff that it costs digits.
const SPRING: f64 = 10.0;

impl<const D: usize> CondensedBody<D> {
    /// Assembles and factorises, with an analysis that [retains](Analysis::retaining) so many nodes: those of rows, or `ports`, each
    /// the last node of a row that is joined by a spring.
    ///
    /// # Errors
    /// [`ModelError`] when the tangent at rest is singular with these rows held, or too large.
    pub(super) fn new(
        (rule, tissue): (&Quadrature<D>, &Tissue),
        analysis: &Analysis,
        (retained, ports): (usize, Option<&ConstrainedRows>),
        held: ConstrainedRows,
    ) -> Result<Self, ModelError> {
        let mut values = tangent_at_rest(rule, tissue, analysis)?;
        let spring = ports.map(|ports| {
            let (pattern, unknowns) = (analysis.pattern(), analysis.pattern().unknowns() - retained * D);
            let stiffness: f64 = (0..unknowns).map(|u| values[pattern.diagonal_position(u)]).sum();
            let stiffness = SPRING * stiffness / unknowns as f64;
            ports.add_springs::<D>(pattern, stiffness, &mut values);
            1.0 / stiffness
        });
        let mut solver = ConstrainedSolver::<D>::new(analysis, held).map_err(Failure::from)?.held_tight();
        solver.load(&values);
        solver.factorise().map_err(|error| singular(&error.to_string()))?;
        let condensed = solver.condensed(retained);
        Ok(Self { solver, condensed, spring })
    }

    /// Numbers of a field: D for every node, then for every port.
    pub(super) fn unknowns(&self) -> usize {
        self.solver.pattern().unknowns()
    }

    /// Displacements, as nodal coefficients, under forces and values of the held rows: as many fields as there are forces,
    /// one after the other. The held rows have their values to `tolerance` (length units) or to rounding.
    pub(super) fn fields(&mut self, forces: &[f64], values: &[f64], tolerance: f64) -> Vec<f64> {
        let (mut x, mut multipliers) = (vec![0.0; forces.len()], vec![0.0; values.len()]);
        self.solver.solve(forces, values, tolerance, Unknowns { x: &mut x, multipliers: &mut multipliers });
        x
    }

    /// Displacements that rows take per force along each other: D numbers per row, in their order. They are rows of retained nodes
    /// or, where there are ports, those that the ports stand for.
    pub(super) fn compliance<'s>(&self, rows: impl Iterator<Item = &'s Stencil<D>>) -> Mat<f64> {
        let weights = |row: &Stencil<D>, axis: usize| -> Functional {
            row.nodes.iter().zip(&row.values).map(|(&i, &value)| (i * D as u32 + axis as u32, value)).collect()
        };
        let Some(spring) = self.spring else {
            let functionals: Vec<_> = rows.flat_map(|row| (0..D).map(move |axis| weights(row, axis))).collect();
            return self.condensed.compliance(&functionals);
        };
        // A port yields with its spring.
        let rows = rows.count() * D;
        let first = self.unknowns() - rows;
        let ports: Vec<Functional> = (first..self.unknowns()).map(|u| vec![(u as u32, 1.0)]).collect();
        let mut compliance = self.condensed.compliance(&ports);
        (0..rows).for_each(|k| compliance[(k, k)] -= spring);
        compliance
    }
}
