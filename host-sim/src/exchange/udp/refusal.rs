//! Why a datagram is not obeyed.

use std::collections::BTreeMap;

/// Why a datagram is not obeyed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, strum::IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
pub enum Refusal {
    /// It comes from another address than the peer's.
    Foreign,
    /// Too short, too long, or not as long as its kind is.
    Length,
    /// It does not begin as one of ours, or its checksum is wrong.
    Damaged,
    /// Of another version.
    Version,
    /// A kind that is none, bits that mean nothing, or nothing that a rig may say.
    Meaning,
    /// Of another run of the bridge.
    OtherRun,
    /// Its number is not above that of the one before: late, doubled or sent again.
    Replayed,
    /// A sample that was measured after it was sent, or more than a minute before.
    Time,
    /// A sample of a paddle that the controller's table does not have.
    Paddle,
}

impl Refusal {
    /// Every reason.
    pub const ALL: [Self; 9] = [
        Self::Foreign,
        Self::Length,
        Self::Damaged,
        Self::Version,
        Self::Meaning,
        Self::OtherRun,
        Self::Replayed,
        Self::Time,
        Self::Paddle,
    ];

    /// As in results.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

/// Datagrams that were refused, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Refused([u64; Refusal::ALL.len()]);

impl Refused {
    /// One more.
    pub fn count(&mut self, refusal: Refusal) {
        self.0[refusal as usize] += 1;
    }

    /// The counts that are not 0, by the reasons' names.
    pub fn by_name(&self) -> BTreeMap<String, u64> {
        let counts = Refusal::ALL.into_iter().map(|refusal| (refusal.name().to_owned(), self.0[refusal as usize]));
        counts.filter(|(_, count)| *count > 0).collect()
    }
}
