//! Which tissues are simulated with which tables.

use firmware::contract::Table;
use model_offline::scene::Scene;

use crate::bench::error::SimError;
use crate::bench::insertion::Label;
use crate::bench::strategy::Strategy;
use crate::runtime::time::mode::RunMode;
use model_offline::scene::TissueVariant;

/// A plant, and what its controller believes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Case {
    pub(super) tissue: TissueVariant,
    pub(super) table_tissue: TissueVariant,
    /// A mismatch repeats nothing that its plant's own case shows already.
    pub(super) is_mismatch: bool,
}

impl Case {
    pub(super) fn label(&self, strategy: Strategy) -> Label {
        Label { tissue: self.tissue, table_tissue: self.table_tissue, strategy }
    }

    /// Insertions of this case.
    pub(super) fn runs(&self, mode: Option<RunMode>) -> u64 {
        match (mode, self.is_mismatch) {
            (None, false) => 4,
            (Some(_), false) => 3,
            (_, true) => 2,
        }
    }
}

/// What is to be simulated, where these tissues are asked for: that of the simulation, and that of the table.
///
/// # Errors
/// [`SimError::NoInclusion`].
pub(super) fn cases(
    asked: [Option<TissueVariant>; 2],
    scene: &Scene,
    table: Option<&Table<f64, 2>>,
) -> Result<Vec<Case>, SimError> {
    let has_inclusion = !scene.inclusions.is_empty();
    let [simulated, table_tissue] = asked;
    if !has_inclusion && asked.contains(&Some(TissueVariant::Inclusion)) {
        return Err(SimError::NoInclusion { scene: scene.name.clone() });
    }
    let believed = match table {
        Some(table) if table.tissue == TissueVariant::Homogeneous.name() => Some(TissueVariant::Homogeneous),
        Some(table) if has_inclusion && table.tissue == TissueVariant::Inclusion.name() => {
            Some(TissueVariant::Inclusion)
        }
        _ => table_tissue,
    };
    let case = |tissue| Case { tissue, table_tissue: believed.unwrap_or(tissue), is_mismatch: false };
    let mut cases = match simulated {
        Some(tissue) => vec![case(tissue)],
        None if has_inclusion => TissueVariant::ALL.map(case).to_vec(),
        None => vec![case(TissueVariant::Homogeneous)],
    };
    if has_inclusion && simulated.is_none() && believed.is_none() {
        cases.push(Case {
            tissue: TissueVariant::Inclusion,
            table_tissue: TissueVariant::Homogeneous,
            is_mismatch: true,
        });
    }
    Ok(cases)
}
