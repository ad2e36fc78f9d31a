//! What a controller table believes about the tissue.

use firmware::Table;
use model_offline::scene::{Scene, TissueVariant};
use serde::{Deserialize, Serialize};

/// The tissue that a table believes in.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum TableTissue {
    /// One of the simulated scene's.
    OfThisScene(TissueVariant),
    /// That of another scene, by the name that the table has for it.
    OfAnotherScene(String),
}

/// What stands behind the name of a tissue of another scene.
const ELSEWHERE: &str = " of another scene";

impl TableTissue {
    /// What `table` believes in, where `scene` is simulated.
    pub fn believed(table: &Table<f64, 2>, scene: &Scene) -> Self {
        let simple = scene.without_a_past();
        let of_scene =
            |tissue: &TissueVariant| [scene, &simple].iter().any(|s| tissue.of(s).hash() == table.scene_hash);
        let named = |tissue: &TissueVariant| tissue.name() == table.tissue;
        // Without inclusions both tissues are one: the table's own name for it counts.
        let matching = || TissueVariant::ALL.into_iter().filter(of_scene);
        let found = matching().find(named).or_else(|| matching().next());
        found.map_or_else(|| Self::OfAnotherScene(table.tissue.as_str().to_owned()), Self::OfThisScene)
    }

    /// Whether it is this tissue of the simulated scene.
    pub fn is(&self, tissue: TissueVariant) -> bool {
        *self == Self::OfThisScene(tissue)
    }
}

impl std::fmt::Display for TableTissue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OfThisScene(tissue) => tissue.fmt(f),
            Self::OfAnotherScene(name) => write!(f, "{name}{ELSEWHERE}"),
        }
    }
}

impl From<TableTissue> for String {
    fn from(tissue: TableTissue) -> Self {
        tissue.to_string()
    }
}

impl TryFrom<String> for TableTissue {
    type Error = NoTissue;

    fn try_from(text: String) -> Result<Self, NoTissue> {
        if let Some(name) = text.strip_suffix(ELSEWHERE) {
            return Ok(Self::OfAnotherScene(name.to_owned()));
        }
        let own = TissueVariant::ALL.into_iter().find(|tissue| tissue.name() == text);
        own.map(Self::OfThisScene).ok_or(NoTissue { text })
    }
}

/// A text that names no tissue of a table.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` is no tissue of a table: homogeneous, inclusion, or a name with `{ELSEWHERE}` behind it")]
pub struct NoTissue {
    /// The text.
    pub text: String,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::paper_table::paper_table;

    #[test]
    fn what_a_table_believes_in_is_read_back() {
        let elsewhere = TableTissue::OfAnotherScene("liver".to_owned());
        let names = ["homogeneous", "inclusion", "liver of another scene"];
        let own = TissueVariant::ALL.map(TableTissue::OfThisScene);
        for (tissue, name) in own.into_iter().chain([elsewhere]).zip(names) {
            let text = serde_json::to_string(&tissue).unwrap();
            assert_eq!(text, format!("\"{name}\""));
            assert_eq!(serde_json::from_str::<TableTissue>(&text).unwrap(), tissue);
        }
        assert!(serde_json::from_str::<TableTissue>("\"liver\"").is_err());
    }

    #[test]
    fn a_table_of_another_scene_is_told_from_its_own() {
        let scene = Scene::bundled("paper").unwrap();
        let mut table = paper_table().unwrap();
        for tissue in TissueVariant::ALL {
            table.scene_hash = tissue.of(&scene).hash();
            assert!(TableTissue::believed(&table, &scene).is(tissue));
        }
        let name = table.tissue.as_str().to_owned();
        table.scene_hash[0] ^= 1;
        assert_eq!(TableTissue::believed(&table, &scene), TableTissue::OfAnotherScene(name));
    }
}
