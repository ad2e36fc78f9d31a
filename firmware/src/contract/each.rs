//! `serde(with)` of a field that is one value per paddle: a tuple, as serde has it for arrays of a known length.

use core::fmt;
use core::marker::PhantomData;

use serde::de::{Error, SeqAccess, Visitor};
use serde::ser::SerializeTuple;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub(super) fn serialize<S: Serializer, V: Serialize, const P: usize>(
    values: &[V; P],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let mut tuple = serializer.serialize_tuple(P)?;
    for value in values {
        tuple.serialize_element(value)?;
    }
    tuple.end()
}

pub(super) fn deserialize<'de, S: Deserializer<'de>, V: Deserialize<'de>, const P: usize>(
    deserializer: S,
) -> Result<[V; P], S::Error> {
    deserializer.deserialize_tuple(P, Each(PhantomData))
}

struct Each<V, const P: usize>(PhantomData<V>);

impl<'de, V: Deserialize<'de>, const P: usize> Visitor<'de> for Each<V, P> {
    type Value = [V; P];

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "one value for each of {P} paddles")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut values: A) -> Result<[V; P], A::Error> {
        let mut each = heapless::Vec::<V, P>::new();
        while let Some(value) = values.next_element()? {
            each.push(value).map_err(|_| A::Error::invalid_length(P + 1, &self))?;
        }
        let found = each.len();
        each.into_array().map_err(|_| A::Error::invalid_length(found, &self))
    }
}
