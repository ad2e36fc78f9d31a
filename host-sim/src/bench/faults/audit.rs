//! What became of every sample, known from outside of the controller: its ledger has to agree.

use firmware::Ledger;
use firmware::inputs::StreamLedger;

use super::fault::Stream;

/// What has become of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    /// On its way, or waiting to be read.
    InFlight,
    /// Taken away by a fault.
    Lost,
    /// A newer one took its place before anybody read it.
    Overwritten,
    /// Read by the controller since its last re-arming but this many.
    Read(u32),
    /// Read too late to be matched with its publication.
    Stray,
    /// Read in a tick that the controller rejected as a whole.
    Rejected,
}

/// How far back the controller can tell a late sample from a duplicate; part of its contract.
const WINDOW: usize = 64;

/// Counts of one stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Published by the sensor.
    pub published: u64,
    /// Read by the controller.
    pub read: u64,
    /// Taken away by a fault.
    pub lost: u64,
    /// Overwritten by a newer one.
    pub overwritten: u64,
    /// Read too late to be matched.
    pub strays: u64,
    /// Read in a rejected tick.
    pub rejected: u64,
    /// Neither read nor gone yet.
    pub in_flight: u64,
    /// Reads beyond the first of the same sample.
    pub repeated: u64,
}

/// The fate of every sample of one stream.
#[derive(Clone, Debug, Default)]
pub struct StreamAudit {
    first: Option<u32>,
    fates: Vec<Fate>,
    repeated: u64,
    /// Number of re-armings so far.
    epoch: u32,
    /// Places of the first and of the newest sample read since the last re-arming.
    span: Option<(usize, usize)>,
    /// Gaps in what was read before the last re-arming.
    gaps: u64,
}

impl StreamAudit {
    fn place(&self, sequence: u32) -> Option<usize> {
        let index = sequence.wrapping_sub(self.first?) as usize;
        (index < self.fates.len()).then_some(index)
    }

    /// The sensor has published the next sample.
    pub fn publish(&mut self, sequence: u32) {
        self.first.get_or_insert(sequence);
        self.fates.push(Fate::InFlight);
    }

    /// A fault has taken it away.
    pub fn lose(&mut self, sequence: u32) {
        self.end(sequence, Fate::Lost);
    }

    /// A newer delivery took its place.
    pub fn overwrite(&mut self, sequence: u32) {
        self.end(sequence, Fate::Overwritten);
    }

    fn end(&mut self, sequence: u32, fate: Fate) {
        if let Some(place) = self.place(sequence)
            && self.fates[place] == Fate::InFlight
        {
            self.fates[place] = fate;
        }
    }

    /// The controller has read it, in a tick that it `accepted` or not.
    pub fn read(&mut self, sequence: u32, accepted: bool) {
        let Some(place) = self.place(sequence) else { return };
        let seen = matches!(self.fates[place], Fate::Read(_) | Fate::Stray);
        if !accepted {
            if !seen {
                self.fates[place] = Fate::Rejected;
            }
            return;
        }
        self.repeated += u64::from(seen);
        let (first, newest) = *self.span.get_or_insert((place, place));
        if place < first || newest.saturating_sub(place) >= WINDOW {
            if !seen {
                self.fates[place] = Fate::Stray;
            }
            return;
        }
        self.span = Some((first, newest.max(place)));
        self.fates[place] = Fate::Read(self.epoch);
    }

    /// The controller forgets where its sequences stood.
    fn rearm(&mut self) {
        self.gaps = self.gaps();
        self.span = None;
        self.epoch += 1;
    }

    /// Samples between the first and the newest one read that were not read, over all re-armings.
    fn gaps(&self) -> u64 {
        let now = self.span.map_or(0, |(first, newest)| {
            self.fates[first..=newest].iter().filter(|fate| **fate != Fate::Read(self.epoch)).count()
        });
        self.gaps + now as u64
    }

    /// All counts.
    pub fn tally(&self) -> Tally {
        let mut tally = Tally { published: self.fates.len() as u64, repeated: self.repeated, ..Tally::default() };
        for fate in &self.fates {
            *match fate {
                Fate::InFlight => &mut tally.in_flight,
                Fate::Lost => &mut tally.lost,
                Fate::Overwritten => &mut tally.overwritten,
                Fate::Read(_) => &mut tally.read,
                Fate::Stray => &mut tally.strays,
                Fate::Rejected => &mut tally.rejected,
            } += 1;
        }
        tally
    }

    /// Samples that are in one account and not in the other: every delivery is consumed, discarded, a duplicate or a
    /// stray; every gap is missed.
    fn unaccounted(&self, ledger: &StreamLedger) -> u64 {
        let tally = self.tally();
        let deliveries = ledger.consumed + ledger.discarded.iter().sum::<u64>() + ledger.duplicates + ledger.strays;
        ledger.unaccounted()
            + deliveries.abs_diff(tally.read + tally.strays + tally.repeated)
            + ledger.lost.abs_diff(self.gaps())
    }
}

/// Accounts of a whole bench.
#[derive(Clone, Debug, Default)]
pub struct Audit {
    streams: [StreamAudit; Stream::ALL.len()],
    /// Ticks of the controller by mode on the wire: HOLD, RUN, SAFE.
    pub modes: [u64; 3],
    /// Periods that the controller was not started in, by arithmetic of its own.
    pub skipped: u64,
}

impl Audit {
    /// Account of a stream.
    pub fn stream(&mut self, stream: Stream) -> &mut StreamAudit {
        &mut self.streams[stream as usize]
    }

    /// Counts of a stream.
    pub fn tally(&self, stream: Stream) -> Tally {
        self.streams[stream as usize].tally()
    }

    /// Somebody has re-armed the controller.
    pub fn rearm(&mut self) {
        self.streams.iter_mut().for_each(StreamAudit::rearm);
    }

    /// Everything that is not in both accounts: the controller's and this one.
    pub fn unaccounted(&self, ledger: &Ledger) -> u64 {
        let of = |stream: &Stream| self.streams[*stream as usize].unaccounted(stream.account(ledger));
        let samples: u64 = Stream::ALL.iter().map(of).sum();
        let ticks = &ledger.ticks;
        let [hold, run, safe] = self.modes;
        samples
            + ticks.unaccounted()
            + ticks.hold.abs_diff(hold)
            + ticks.run.abs_diff(run)
            + ticks.safe.abs_diff(safe)
            + ticks.skipped.abs_diff(self.skipped)
            + ticks.due.abs_diff(hold + run + safe + self.skipped)
    }
}
