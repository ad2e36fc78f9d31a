//! Parts of the boundary as a scene file gives them: by points, or by an edge of the outline and fractions of it.

use super::exactly::{Coordinates, Exactly};
use schemars::JsonSchema;
use serde::Deserialize;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};
use std::fmt;
use std::marker::PhantomData;

/// A part of one edge of the outline.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EdgePart {
    /// Which edge, from 0: edge k runs from vertex k of the outline to vertex k + 1, as they stand in the file; the last one
    /// closes it.
    pub edge: u32,
    /// Where the part begins on the edge: 0 at its first vertex, 1 at its last (default 0).
    #[serde(default)]
    pub from: f64,
    /// Where it ends (default 1).
    #[serde(default = "whole")]
    pub to: f64,
}

fn whole() -> f64 {
    1.0
}

/// Points, or a part of an edge of the outline. Points that must lie on the boundary and miss it by less than a thousandth of
/// the body's size (the diagonal of its bounding box) are put onto it; so is a needle contact that is outside by as
/// much, or inside by less than a hundred-thousandth.
#[derive(Debug, Clone, PartialEq, JsonSchema)]
#[schemars(untagged, rename = "OnBoundary_{T}")]
pub enum OnBoundary<T> {
    /// By its points.
    Points(T),
    /// By an edge.
    Edge(EdgePart),
}

/// A polyline.
pub type BoundaryPath = OnBoundary<Vec<Coordinates<2>>>;

/// Two ends.
pub type BoundarySegment = OnBoundary<Exactly<Coordinates<2>, 2>>;

impl<'de, T: Deserialize<'de>> Deserialize<'de> for OnBoundary<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Either(PhantomData))
    }
}

/// A list is points, a table an edge: errors are those of the one that was meant.
struct Either<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for Either<T> {
    type Value = OnBoundary<T>;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("points [[x, y], [x, y]], or an edge of the outline { edge = 3, from = 0.2, to = 0.4 }")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, sequence: A) -> Result<Self::Value, A::Error> {
        T::deserialize(SeqAccessDeserializer::new(sequence)).map(OnBoundary::Points)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        EdgePart::deserialize(MapAccessDeserializer::new(map)).map(OnBoundary::Edge)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    struct File {
        path: BoundaryPath,
    }

    fn read(value: &str) -> Result<BoundaryPath, String> {
        toml::from_str::<File>(&format!("path = {value}")).map(|file| file.path).map_err(|error| error.to_string())
    }

    #[test]
    fn points_and_edges_are_told_apart_and_each_has_its_own_errors() {
        assert_eq!(
            read("[[0, 1.5], [2.0, 3]]").unwrap(),
            OnBoundary::Points([[0.0, 1.5], [2.0, 3.0]].map(Exactly).into())
        );
        let part = |from, to| OnBoundary::Edge(EdgePart { edge: 3, from, to });
        assert_eq!(read("{ edge = 3, from = 0.2, to = 0.4 }").unwrap(), part(0.2, 0.4));
        assert_eq!(read("{ edge = 3 }").unwrap(), part(0.0, 1.0));
        for (value, expected) in [
            ("{ edge = -1 }", "-1"),
            ("{ from = 0.2 }", "missing field `edge`"),
            ("{ edge = 3, till = 0.2 }", "unknown field `till`"),
            ("[[0, 1], [2]]", "length"),
            ("7", "{ edge = 3, from = 0.2, to = 0.4 }"),
        ] {
            let error = read(value).unwrap_err();
            assert!(error.contains(expected), "{value}: {error}");
        }
    }
}
