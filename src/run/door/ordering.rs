//! An order on its way: what is sent to whom, and when it is over. Pure: it is told what was heard and the time, says what
//! to send, and is done when every vehicle's State shows the order, or the time is up.
//!
//! ```text
//!   unheard ──State──► issued ──State shows it──► obeyed
//!      │                │  ▲ └─a higher order of another kind─► contested (a start that the ground brings about)
//!      │ (emergency)    │  └── the echo fell back: started anew     │ the ground stands by it      │ it does not
//!      ▼                ▼                                           ▼                              ▼
//!   sent blindly     sent again every 100 ms                      obeyed                       overruled
//! ```
//!
//! **By whose right.** The greatest lease that a State echoes or a live ground station's Report holds; where nobody holds
//! one, number 1 with an own holder. With `take_over` the number after it with an own holder. The revision is the
//! vehicle's echo + 1 within that lease, 1 in another one. To start or to return waits for a Report, or 1.5 s, so that the
//! ground's lease is known; what makes a vehicle stop waits for nothing but its State.
//!
//! **Emergencies** do not wait for a State either. A vehicle obeys only what is above its echo, so to one that was not heard
//! within 100 ms the order goes under a lease that lies 1024 above the greatest number heard, then 2048, 4096 … with every
//! 300 ms of silence, up to 2³¹; from there on with holder 0, which wins a tie, and with doubled revisions. Leases grow by
//! one with a take-over, so the first one is obeyed unless that was done before. Nobody is locked out by it: who orders
//! next reads this lease in State and goes on above it, a ground station that stood by takes the number after it, and
//! above 2³¹ there is room for two thousand million take-overs.
//!
//! **Others.** Of the same lease, the stronger kind insists: a hold goes out again above a start that came in between,
//! never the other way round. A ground station that begins what was started brings everyone to rest first: its Hold
//! after our Start is no contradiction when its Report says that nothing stands. Whatever else is above ours has
//! overruled it. An emergency gives way to nothing but the cutting of motors.
//!
//! **Strangers.** Who greets with another venue file or wire version does not listen to this operator: it is named and not
//! sent anything but an emergency, which it obeys whatever its venue file says.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use tomoswarm_proto::{
    Lease, Order, OrderKind, Ordered, Report, Revision, RunId, SeenState, Sender, State, StationPhase,
    VehicleId,
};

use super::super::bus::Heard;
use super::roll::{Fresh, Misfit, Roll};
use crate::time::Time;

/// An order is repeated this often.
const REPEAT: Duration = Duration::from_millis(100);
/// For so long everyone who is there, and the ground's lease, is listened for.
const LISTEN: Duration = Duration::from_millis(1500);
/// An emergency waits so long for a state at most, counted from when anyone can be reached.
const BLIND_AFTER: Duration = Duration::from_millis(100);
/// An emergency to somebody unheard rises this often.
const RISES: Duration = Duration::from_millis(300);
/// The ground has so long to say that it brings about what was started.
const CONTEST: Duration = Duration::from_millis(2500);
/// So often a stronger order goes above a weaker one of the same lease.
const INSIST: u32 = 3;
/// The first step above the greatest lease heard of an emergency to somebody unheard, and where its numbers end.
const FIRST_STEP: u32 = 10;
const HIGHEST: u32 = 1 << 31;
/// The last revision that may be given; one more is refused by everyone.
const LAST_REVISION: u32 = u32::MAX - 1;

/// What the operator wants.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Wish {
    /// What to do.
    pub kind: OrderKind,
    /// Whether a start begins a new run when the ground station is idle (otherwise it goes on with the present one).
    pub begins: bool,
    /// Whom it is for; empty = all.
    pub vehicles: BTreeSet<VehicleId>,
    /// When it is for all: who is known to be there without being heard.
    pub expected: BTreeSet<VehicleId>,
    /// Whoever might be there besides: an emergency goes to them too.
    pub possible: BTreeSet<VehicleId>,
    /// In which run; `None` = as above.
    pub run: Option<RunId>,
    /// Whether a lease is taken from whoever holds it.
    pub take_over: bool,
    /// Random id of this operator.
    pub holder: u64,
    /// Hash of the operator's venue file: who has another one does not listen to it.
    pub venue_hash: u64,
    /// When it is given up.
    pub timeout: Duration,
}

/// How an order ended for one vehicle.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Fate {
    /// Its state shows the order, so long after it was first sent.
    Obeyed {
        /// From the first sending to the state that shows it.
        after: Duration,
        /// The ground station has gone on from there already.
        by_ground: bool,
    },
    /// A higher order of somebody else came in between.
    Overruled(Ordered),
    /// It is heard, and has not obeyed in time.
    Ignored,
    /// Nothing was heard of it.
    Unheard,
    /// It does not listen to this operator, and was not sent the order unless that is an emergency.
    Foreign(Misfit),
}

/// What became of an order.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Outcome {
    /// By vehicle, ascending.
    pub fates: BTreeMap<VehicleId, Fate>,
    /// The lease of the orders to those that were heard; `None` when nothing was sent.
    pub lease: Option<Lease>,
    /// Their run.
    pub run: Option<RunId>,
}

impl Outcome {
    /// Tells whether every vehicle has obeyed, and there is one.
    pub fn is_done(&self) -> bool {
        let obeyed = |fate: &Fate| matches!(fate, Fate::Obeyed { .. });
        !self.fates.is_empty() && self.fates.values().all(obeyed)
    }
}

/// An order on its way.
#[derive(Clone, Debug)]
pub struct Ordering {
    wish: Wish,
    began: Time,
    /// Since when anyone can be reached.
    linked: Option<Time>,
    roll: Roll,
    dealings: BTreeMap<VehicleId, Dealing>,
    run: Option<RunId>,
}

/// How far it is with one vehicle.
#[derive(Clone, Debug, Default)]
struct Dealing {
    issued: Option<Issued>,
    first_at: Option<Time>,
    sent_at: Option<Time>,
    /// When its state showed it, and whether the ground has gone on from there.
    obeyed: Option<(Time, bool)>,
    contested: Option<(Time, Ordered)>,
    overruled: Option<Ordered>,
    insisted: u32,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Issued {
    lease: Lease,
    revision: Revision,
    /// It was made without having heard the vehicle.
    is_blind: bool,
}

impl Ordering {
    /// Begins.
    pub fn new(now: Time, wish: Wish) -> Ordering {
        Ordering {
            wish,
            began: now,
            linked: None,
            roll: Roll::default(),
            dealings: BTreeMap::new(),
            run: None,
        }
    }

    /// Takes what came over the bus.
    pub fn hear(&mut self, now: Time, heard: &Heard) {
        self.roll.hear(now, heard);
        let ids: Vec<VehicleId> = self.dealings.keys().copied().collect();
        ids.into_iter().for_each(|id| self.judge(now, id));
    }

    /// Gives the orders that are due; `is_linked` tells whether anyone can be reached.
    pub fn act(&mut self, now: Time, is_linked: bool) -> Vec<Order> {
        if is_linked {
            self.linked.get_or_insert(now);
        }
        let mut due = Vec::new();
        for id in self.addressees(now) {
            self.settle(now, id);
            if !self.is_emergency() && self.misfit(id).is_some() {
                continue;
            }
            due.extend(self.due(now, id));
        }
        due
    }

    /// Gives when to act next at the latest.
    pub fn next(&self, now: Time) -> Time {
        let sent =
            self.dealings.values().filter_map(|dealing| dealing.sent_at.filter(|_| !dealing.is_over()));
        let repeated = sent.map(|at| at + REPEAT).min().unwrap_or(now + REPEAT / 2);
        repeated.min(now + REPEAT / 2).max(now)
    }

    /// Gives what became of it once it is over.
    pub fn outcome(&self, now: Time) -> Option<Outcome> {
        let fates = self.fates(now);
        let is_emergency = self.is_emergency();
        let is_open = |fate: &Fate| match fate {
            Fate::Ignored | Fate::Unheard => true,
            // In an emergency it may still obey.
            Fate::Foreign(_) => is_emergency,
            Fate::Obeyed { .. } | Fate::Overruled(_) => false,
        };
        let knows_all =
            !self.wish.vehicles.is_empty() || !self.wish.expected.is_empty() || self.has_listened(now);
        let is_over = knows_all && !fates.is_empty() && !fates.values().any(is_open);
        (is_over || now.since(self.began) >= self.wish.timeout).then(|| self.outcome_so_far(now))
    }

    /// Gives what became of it so far.
    pub fn outcome_so_far(&self, now: Time) -> Outcome {
        let issued = self.dealings.values().filter_map(|dealing| dealing.issued);
        let lease = issued.filter(|issued| !issued.is_blind).map(|issued| issued.lease).max();
        Outcome { fates: self.fates(now), lease, run: self.run }
    }

    fn fates(&self, now: Time) -> BTreeMap<VehicleId, Fate> {
        let nothing = Dealing::default();
        let of = |id| {
            let dealing = self.dealings.get(&id).unwrap_or(&nothing);
            let fate = dealing.fate(self.roll.state(id).is_some());
            match (fate, self.misfit(id)) {
                (Fate::Ignored | Fate::Unheard, Some(misfit)) => (id, Fate::Foreign(misfit)),
                (fate, _) => (id, fate),
            }
        };
        self.targets(now).into_iter().map(of).collect()
    }

    /// Gives why a vehicle does not listen to this operator, if it does not.
    fn misfit(&self, id: VehicleId) -> Option<Misfit> {
        self.roll.misfit(Sender::Vehicle(id), self.wish.venue_hash)
    }

    /// Gives who must obey.
    fn targets(&self, now: Time) -> BTreeSet<VehicleId> {
        if !self.wish.vehicles.is_empty() {
            return self.wish.vehicles.clone();
        }
        let members = self.roll.ground(now).map(|report| report.said.members.clone()).unwrap_or_default();
        let heard = self.roll.vehicles().filter(|(_, seen)| seen.state.is_some()).map(|(id, _)| id);
        self.wish.expected.iter().copied().chain(members).chain(heard).collect()
    }

    /// Gives to whom it is sent: in an emergency also to those of whom nothing is known.
    fn addressees(&self, now: Time) -> BTreeSet<VehicleId> {
        let mut all = self.targets(now);
        if self.is_emergency() && self.wish.vehicles.is_empty() {
            all.extend(&self.wish.possible);
        }
        all
    }

    fn is_emergency(&self) -> bool {
        self.wish.kind.is_emergency()
    }

    /// Compares what a vehicle says it was ordered with what was sent to it.
    fn judge(&mut self, now: Time, id: VehicleId) {
        let (kind, is_emergency, holder) = (self.wish.kind, self.is_emergency(), self.wish.holder);
        let ground_lives = self.roll.ground(now).is_some();
        let Some(state) = self.roll.state(id) else { return };
        let echo = state.said.ordered;
        let Some(dealing) = self.dealings.get_mut(&id) else { return };
        let Some(issued) = dealing.issued else { return };
        // Of an emergency sent blindly an earlier, lower one may have been obeyed.
        let is_own = is_emergency && echo.lease.holder == holder && echo.kind == Some(kind);
        let is_above = echo.edition() >= (issued.lease, issued.revision);
        let Some(theirs) = echo.kind.filter(|_| is_above || is_own) else {
            // It was never obeyed, or the vehicle has been started anew and knows nothing of it.
            (dealing.obeyed, dealing.contested) = (None, None);
            return;
        };
        if dealing.obeyed.is_some() || dealing.overruled.is_some() {
            return;
        }
        let is_same_lease = echo.lease == issued.lease;
        if theirs == kind {
            dealing.obeyed = Some((now, false));
        } else if kind.strength() > theirs.strength()
            && (is_emergency || issued.is_blind || is_same_lease && dealing.insisted < INSIST)
        {
            dealing.insisted += 1;
            (dealing.issued, dealing.sent_at) = (None, None);
        } else if kind == OrderKind::Start && is_same_lease && ground_lives {
            let since = dealing.contested.map_or(now, |(since, _)| since);
            dealing.contested = Some((since, echo));
        } else {
            dealing.overruled = Some(echo);
        }
    }

    /// Decides whether what came above a start is the ground station bringing it about.
    fn settle(&mut self, now: Time, id: VehicleId) {
        let report = self.roll.ground(now);
        let Some(dealing) = self.dealings.get_mut(&id) else { return };
        let Some((since, echo)) = dealing.contested.filter(|_| !dealing.is_over()) else { return };
        let brings_about = |report: &Fresh<Report>| {
            report.at >= since && report.said.in_force.is_none() && report.said.phase != StationPhase::Idle
        };
        if report.is_some_and(brings_about) {
            dealing.obeyed = Some((since, true));
        } else if report.is_none() || now.since(since) >= CONTEST {
            dealing.overruled = Some(echo);
        }
    }

    fn due(&mut self, now: Time, id: VehicleId) -> Option<Order> {
        let dealing = self.dealings.entry(id).or_default();
        let waits = dealing.sent_at.is_some_and(|at| now.since(at) < REPEAT);
        if dealing.is_over() || dealing.contested.is_some() || waits {
            return None;
        }
        let issued = match dealing.issued {
            Some(issued) if !issued.is_blind => issued,
            Some(issued) if self.roll.state(id).is_some() => issued,
            Some(_) | None => self.issue(now, id)?,
        };
        let run = self.run_of(now);
        let dealing = self.dealings.entry(id).or_default();
        dealing.issued = Some(issued);
        dealing.sent_at = Some(now);
        dealing.first_at.get_or_insert(now);
        let Issued { lease, revision, .. } = issued;
        let state = self.roll.state(id).map(|state| &state.said);
        let seen = state.map(|state| SeenState { boot: state.boot, sequence: state.sequence });
        Some(Order { vehicle: id, lease, run, revision, seen, kind: self.wish.kind, ends: Vec::new() })
    }

    /// Chooses the lease and the revision that are above a vehicle's echo; `None` while nothing may be sent yet.
    fn issue(&self, now: Time, id: VehicleId) -> Option<Issued> {
        match self.roll.state(id) {
            Some(state) => self.knows_ground(now).then(|| self.above(now, &state.said)),
            None => self.is_emergency().then(|| self.blind(now)).flatten(),
        }
    }

    /// Tells whether the ground's lease is known as far as this order needs it.
    fn knows_ground(&self, now: Time) -> bool {
        let may_wait = matches!(self.wish.kind, OrderKind::Start | OrderKind::Return);
        !may_wait || self.roll.ground(now).is_some() || self.has_listened(now)
    }

    fn has_listened(&self, now: Time) -> bool {
        self.linked.is_some_and(|since| now.since(since) >= LISTEN)
    }

    fn above(&self, now: Time, state: &State) -> Issued {
        let highest = self.roll.lease(now);
        let own = |number| Lease { number, holder: self.wish.holder };
        let is_ours = highest.holder == self.wish.holder;
        let lease = match highest.number {
            0 => own(1),
            number if self.wish.take_over && !is_ours => own(number.saturating_add(1)),
            _ => highest,
        };
        let echo = state.ordered;
        if echo.lease != lease {
            return Issued { lease, revision: Revision(1), is_blind: false };
        }
        match echo.revision.0.checked_add(1).filter(|next| *next <= LAST_REVISION) {
            Some(next) => Issued { lease, revision: Revision(next), is_blind: false },
            // This lease is used up.
            None => {
                let lease = own(lease.number.saturating_add(1));
                Issued { lease, revision: Revision(1), is_blind: false }
            }
        }
    }

    /// Chooses what is above whatever a vehicle that was not heard may echo; higher the longer it is not heard.
    fn blind(&self, now: Time) -> Option<Issued> {
        let since = now.since(self.linked?).checked_sub(BLIND_AFTER)?;
        let rung = u32::try_from(since.as_millis() / RISES.as_millis()).unwrap_or(u32::MAX);
        let heard = self.roll.lease(now).number;
        let step = 1_u32.checked_shl(rung.saturating_add(FIRST_STEP)).unwrap_or(HIGHEST);
        let number = heard.saturating_add(step.min(HIGHEST)).min(HIGHEST.max(heard));
        if number < HIGHEST {
            let lease = Lease { number, holder: self.wish.holder };
            return Some(Issued { lease, revision: Revision(1), is_blind: true });
        }
        let beyond = rung.saturating_sub(31 - FIRST_STEP);
        let revision = 1_u32.checked_shl(beyond).unwrap_or(LAST_REVISION);
        let lease = Lease { number, holder: 0 };
        Some(Issued { lease, revision: Revision(revision), is_blind: true })
    }

    /// Gives the run of the orders, chosen once: what was started must not count as a run before.
    fn run_of(&mut self, now: Time) -> RunId {
        if let Some(run) = self.run {
            return run;
        }
        let states = self.roll.vehicles().filter_map(|(_, seen)| seen.state.as_ref());
        let driven = states.map(|state| state.said.accepted.0.max(state.said.ordered.run));
        let report = self.roll.ground(now).map(|report| &report.said);
        let newest = driven.chain(report.map(|report| report.run)).max().unwrap_or_default();
        let is_idle = report.is_some_and(|report| report.phase == StationPhase::Idle);
        let is_new = self.wish.begins && is_idle;
        let next = RunId(newest.0.saturating_add(1).min(LAST_REVISION));
        let run = self.wish.run.unwrap_or(if is_new { next } else { newest });
        // Nothing may be known yet when an emergency goes out.
        if !self.is_emergency() {
            self.run = Some(run);
        }
        run
    }
}

impl Dealing {
    fn is_over(&self) -> bool {
        self.obeyed.is_some() || self.overruled.is_some()
    }

    fn fate(&self, is_heard: bool) -> Fate {
        match (self.obeyed, self.overruled) {
            (Some((at, by_ground)), _) => {
                Fate::Obeyed { after: at.since(self.first_at.unwrap_or(at)), by_ground }
            }
            (None, Some(echo)) => Fate::Overruled(echo),
            (None, None) if is_heard => Fate::Ignored,
            (None, None) => Fate::Unheard,
        }
    }
}

#[cfg(test)]
mod tests;
