//! What a comparison on a body in space consists of: how long its parts take, and what its cases have in common.

use std::rc::Rc;

use model_offline::scene::TissueVariant;
use model_offline::table::BuiltTable;
use model_offline::table::space::SpaceTable;

use super::{SpaceOptions, SpaceStrategyResult};
use crate::bench::forecast::Part;
use crate::runtime::executor::Hardware;
use crate::runtime::time::mode::RunMode;
use crate::world::space::PreparedBody;

/// What several cases need, made once.
#[derive(Debug, Default)]
pub(super) struct Shared<'m> {
    /// Tables, by the tissue that they know.
    pub(super) tables: Once<TissueVariant, BuiltTable<SpaceTable>>,
    /// Bodies, by their tissue, whether their paddles are steered, and their paddles.
    pub(super) bodies: Once<(TissueVariant, bool, Vec<u32>), PreparedBody<'m>>,
    /// Insertions without a paddle, by the tissue.
    pub(super) none: Once<TissueVariant, SpaceStrategyResult>,
}

/// Values that are made when they are first asked for.
#[derive(Debug)]
pub(super) struct Once<K, V>(Vec<(K, Rc<V>)>);

impl<K, V> Default for Once<K, V> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<K: PartialEq, V> Once<K, V> {
    /// The value of this key.
    ///
    /// # Errors
    /// Those of making it, after which it is not there.
    pub(super) fn get<E>(&mut self, key: K, make: impl FnOnce() -> Result<V, E>) -> Result<Rc<V>, E> {
        if let Some((_, made)) = self.0.iter().find(|(other, _)| *other == key) {
            return Ok(Rc::clone(made));
        }
        let made = Rc::new(make()?);
        self.0.push((key, Rc::clone(&made)));
        Ok(made)
    }
}

/// Work of a comparison's parts over that of an insertion without a controller: means of three bodies of 700 to 4,000 nodes, from
/// which single ones differ by a factor of up to two.
const FIRST_STUDY: f64 = 3.5;
const STUDY: f64 = 1.5;
const TABLE: f64 = 1.3;
const STILL: f64 = 1.0;
/// Of a body that was there already.
const STILL_AGAIN: f64 = 0.3;
const STATES: f64 = 1.8;
const LOCKSTEP: f64 = 0.25;
const BODY_AT_THE_END: f64 = 0.25;
/// What an insertion by the emulated board takes over its own duration.
const EMULATED: f64 = 3.0;

/// What comes before any insertion, of so many tissues: the body is meshed for the first.
pub(super) fn before(tissues: usize) -> Vec<Part> {
    (0..tissues).map(|i| Part::work(if i == 0 { FIRST_STUDY } else { STUDY })).collect()
}

/// The insertions of so many seconds and what they need, in the order in which they are done. `best` are the static paddles and the
/// steered ones by the table of a tissue; before anybody knows them they may be thought to be the same.
pub(super) fn insertions<'p>(
    cases: &[(TissueVariant, TissueVariant)],
    options: &SpaceOptions<'_>,
    duration_s: f64,
    best: impl Fn(TissueVariant) -> [&'p [u32]; 2],
) -> Vec<Part> {
    let (mut parts, mut tables, mut none, mut bodies) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    // Whether something is asked for for the first time.
    fn first<K: PartialEq>(made: &mut Vec<K>, key: K) -> bool {
        let is_first = !made.contains(&key);
        if is_first {
            made.push(key);
        }
        is_first
    }
    for &(tissue, believed) in cases {
        parts.extend(first(&mut tables, believed).then_some(Part::work(TABLE)));
        parts.extend(first(&mut none, tissue).then_some(Part::work(STILL)));
        let [fixture, steered] = best(believed);
        let is_new = first(&mut bodies, (tissue, false, fixture));
        parts.push(Part::work(if is_new { STILL } else { STILL_AGAIN }));
        parts.extend(first(&mut bodies, (tissue, true, steered)).then_some(Part::work(STATES)));
        let is_in_lockstep = options.mode != Some(RunMode::FreeRun);
        parts.extend(is_in_lockstep.then_some(match options.hardware {
            Hardware::Native => Part::work(LOCKSTEP),
            Hardware::Qemu => Part::on_the_clock(EMULATED * duration_s),
        }));
        let is_in_free_run = !is_in_lockstep || options.is_once_more([tissue, believed]);
        parts.extend(is_in_free_run.then(|| Part::free_run(duration_s)));
        parts.push(Part::work(BODY_AT_THE_END));
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_made_once_and_a_failure_is_none() {
        let mut once = Once::<u32, u32>::default();
        assert_eq!(once.get(1, || Err("not yet")), Err("not yet"));
        assert_eq!(once.get::<&str>(1, || Ok(10)).as_deref(), Ok(&10));
        assert_eq!(once.get(1, || Err("again")).as_deref(), Ok(&10));
        assert_eq!(once.get::<&str>(2, || Ok(20)).as_deref(), Ok(&20));
    }
}
