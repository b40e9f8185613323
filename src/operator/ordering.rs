//! An order on its way: what is sent to whom, and when it is over. Pure: it is told what was heard and the time, says what
//! to send, and is done when every vehicle's State shows the order, or the time is up.
//!
//! ```text
//!   unheard ──State──► issued ──State shows it──► obeyed
//!      │                │  ▲ └─a higher order of another kind─► contested (a start that the ground brings about)
//!                       │  └── the echo has no kind: started anew   │ the ground stands by it      │ it does not
//!                       ▼                                           ▼                              ▼
//!                    sent again every 100 ms                      obeyed                       overruled
//! ```
//!
//! **By whose right.** The greatest lease that a State echoes or a live ground station's Report holds; where nobody holds
//! one, number 2 with an own holder: a ground station, heard or not, may be taking 1. With `take_over` the number after it
//! with an own holder. The revision is the vehicle's echo + 1 within that lease, 1 in another one. To start or to return
//! waits for a Report, or 2 s, so that the ground's lease is known; what makes a vehicle stop waits for nothing but its
//! State. Nothing is sent to a vehicle that was not heard: it obeys only what is above its echo.
//!
//! **Emergency stops.** Under an open stop a vehicle obeys neither Start nor Return. A start names the stops that are known to
//! be open when it is first sent, and lifts them; it does not lift later ones. It waits until every vehicle has
//! told what it knows, or 2 s; it is refused while a vehicle that it is for was not heard for 2 s, unless that one is
//! named as one that may be unheard. What stands for many stops is lifted only when that is asked for. A return is refused
//! while a stop is open. The stops themselves are given by [`super::stopping`].
//!
//! **Others.** Of the same lease, the stronger kind insists: a hold goes out again above a start that came in between,
//! never the other way round. A ground station that begins what was started brings everyone to rest first: its Hold
//! after our Start is no contradiction when its Report says that nothing stands. Whatever else is above ours has
//! overruled it.
//!
//! **Refused.** A start of a run while the ground station drives another one would be obeyed by every vehicle, and nothing
//! would come of it: it is not sent. By hand it is over at once and names the run; an order that stands waits.
//!
//! **Missions.** A start may begin a mission: then its run is one above all that are known, a [task](Ordering::task) says what
//! that run is, for whom it is, and each vehicle has obeyed only when its Mission shows that it is out for it.
//!
//! **Standing.** An order by hand is over when it is obeyed. One that [stands](Ordering::standing) is told again to whoever
//! was started anew since, until somebody has ordered something else, or a greater lease is in force than its own.
//!
//! **Started anew.** A vehicle remembers the highest order that it has obeyed, and shows it without its kind until it obeys
//! another. Within its own lease the order goes above it; a greater lease has overruled it.
//!
//! **Strangers.** Who greets with another venue file or wire version does not listen to this operator: it is named and not
//! sent anything.

mod delivery;
mod instruction;
mod run;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    EmergencyName, EmergencyStop, GroundReport, Lease, Order, OrderKind, Revision, RunId,
    SeenState, Sender, StandReason, State, StationPhase, StopScope, VehicleId,
};

use self::delivery::{CONTEST, OrderRight, VehicleDelivery, take_over_of};
pub(crate) use self::instruction::Instruction;
use self::instruction::{ENDS_MAX, ended, may_be_brought_about};
use super::HeardMessage;
use super::fleet_view::{FleetView, Incompatibility, SILENT_AFTER, Timestamped};
use super::outcome::{OrderOutcome, OrderRefusal, VehicleOutcome};
use crate::time::Time;

/// An order is repeated this often.
const REPEAT: Duration = Duration::from_millis(100);
/// How long to listen for everyone, and for the ground's lease: what is said once a second may wait half of one for company.
const LISTEN: Duration = Duration::from_secs(2);
/// So often a stronger order goes above a weaker one of the same lease.
const INSIST: u32 = 3;
/// The number of the lease that an operator takes when nobody holds one. A ground station may take number 1 in that very
/// moment, also one that was not heard yet.
pub(super) const FIRST_LEASE: u32 = 2;
/// The last revision that may be given; one more is refused by everyone.
const LAST_REVISION: u32 = u32::MAX - 1;

/// An order on its way.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Ordering {
    instruction: Instruction,
    began: Time,
    /// Since when anyone can be reached.
    linked: Option<Time>,
    /// Everyone who is there has been listened for before.
    has_listened: bool,
    view: FleetView,
    deliveries: BTreeMap<VehicleId, VehicleDelivery>,
    run: Option<RunId>,
    /// Its mission was given as a task.
    is_task_given: bool,
    /// The emergency stops that it lifts, known when it was first sent.
    ends: Option<Vec<EmergencyStop>>,
    refused: Option<OrderRefusal>,
    stands: bool,
    withdrawn: BTreeSet<VehicleId>,
}

impl Ordering {
    /// Begins.
    pub fn new(now: Time, instruction: Instruction) -> Ordering {
        Ordering {
            instruction,
            began: now,
            linked: None,
            has_listened: false,
            view: FleetView::default(),
            deliveries: BTreeMap::new(),
            run: None,
            is_task_given: false,
            ends: None,
            refused: None,
            stands: false,
            withdrawn: BTreeSet::new(),
        }
    }

    /// Takes over what is known already, but for vehicles that have fallen silent; `has_listened` tells whether that is of
    /// everyone who is there.
    pub fn knowing(self, view: &FleetView, has_listened: bool) -> Ordering {
        let mut view = view.clone();
        view.forget_states_before(self.began - SILENT_AFTER);
        Ordering {
            view,
            has_listened,
            ..self
        }
    }

    /// Makes an order that stands: whoever is started anew is told again.
    pub fn standing(self) -> Ordering {
        Ordering {
            stands: true,
            ..self
        }
    }

    /// Returns whether it stands after it was obeyed.
    pub fn stands(&self) -> bool {
        self.stands
    }

    /// Leaves these vehicles alone from now on, since its operator wants something else of them; empty = all.
    pub fn withdraw(&mut self, now: Time, vehicles: &BTreeSet<VehicleId>) {
        let all = if vehicles.is_empty() {
            self.targets(now)
        } else {
            vehicles.clone()
        };
        self.withdrawn.extend(all);
    }

    /// Returns whether nobody is left whom it concerns.
    pub fn is_withdrawn(&self, now: Time) -> bool {
        let targets = self.targets(now);
        !self.withdrawn.is_empty() && targets.is_subset(&self.withdrawn)
    }

    /// Returns whether nobody is left for whom it stands: somebody has ordered all of them something else.
    pub fn is_lost(&self, now: Time) -> bool {
        let is_overruled = |id: &VehicleId| {
            self.deliveries
                .get(id)
                .is_some_and(|delivery| delivery.overruled.is_some())
        };
        self.targets(now)
            .iter()
            .all(|id| self.withdrawn.contains(id) || is_overruled(id))
    }

    /// Returns whether there is nothing to do until something is heard.
    pub fn is_settled(&self, now: Time) -> bool {
        let is_settled = |id: &VehicleId| {
            let delivery = self.deliveries.get(id);
            delivery.is_some_and(|delivery| delivery.is_over() && delivery.doubted.is_none())
        };
        self.targets(now)
            .iter()
            .all(|id| self.withdrawn.contains(id) || is_settled(id))
    }

    /// Takes what came over the bus and is no news, while everything is settled.
    pub fn look(&mut self, now: Time, heard: &HeardMessage) {
        self.view.hear(now, heard);
    }

    /// Takes what came over the bus.
    pub fn hear(&mut self, now: Time, heard: &HeardMessage) {
        self.view.hear(now, heard);
        let ids: Vec<VehicleId> = self.deliveries.keys().copied().collect();
        ids.into_iter().for_each(|id| self.judge(now, id));
    }

    /// Returns the orders that are due; `is_linked` tells whether anyone can be reached.
    pub fn act(&mut self, now: Time, is_linked: bool) -> Vec<Order> {
        if is_linked {
            self.linked.get_or_insert(now);
        }
        if self
            .deliveries
            .values()
            .all(|delivery| delivery.first_at.is_none())
        {
            self.refused = self.refusal(now);
        }
        if self.refused.is_some() {
            return Vec::new();
        }
        if !self.knows_stops(now) || self.waits_for_task() {
            return Vec::new();
        }
        let mut due = Vec::new();
        for id in self.addressees(now) {
            self.settle(now, id);
            if self.misfit(id).is_none() {
                due.extend(self.due(now, id));
            }
        }
        due
    }

    /// Returns when to act next at the latest.
    pub fn next(&self, now: Time) -> Time {
        let sent = self
            .deliveries
            .values()
            .filter_map(|delivery| delivery.sent_at.filter(|_| !delivery.is_over()));
        // What waits for something else than its turn was due before.
        let repeated = sent.map(|at| at + REPEAT).filter(|at| *at > now).min();
        let given_up = Some(self.began + self.instruction.timeout).filter(|at| *at > now);
        let looked = now + REPEAT / 2;
        [repeated, given_up]
            .into_iter()
            .flatten()
            .fold(looked, Time::min)
    }

    /// Returns what became of it once it is over.
    pub fn outcome(&self, now: Time) -> Option<OrderOutcome> {
        let outcomes = self.outcomes(now);
        let is_open = |outcome: &VehicleOutcome| match outcome {
            VehicleOutcome::Ignored | VehicleOutcome::Unheard | VehicleOutcome::NotOut => true,
            VehicleOutcome::Foreign(_)
            | VehicleOutcome::Refused(_)
            | VehicleOutcome::UnderStop(_)
            | VehicleOutcome::StopLifted
            | VehicleOutcome::Stopped { .. }
            | VehicleOutcome::Obeyed { .. }
            | VehicleOutcome::NoPart { .. }
            | VehicleOutcome::Overruled(_)
            | VehicleOutcome::Withdrawn => false,
        };
        if self.refused.is_some() && !self.stands {
            return Some(self.outcome_so_far(now));
        }
        let knows_all = !self.instruction.vehicles.is_empty()
            || !self.instruction.expected.is_empty()
            || self.has_listened(now);
        let is_over = knows_all && !outcomes.is_empty() && !outcomes.values().any(is_open);
        (is_over || now.since(self.began) >= self.instruction.timeout)
            .then(|| self.outcome_so_far(now))
    }

    /// Returns the lease of the orders to those that were heard; `None` when nothing was sent.
    pub fn lease(&self) -> Option<Lease> {
        let issued = self
            .deliveries
            .values()
            .filter_map(|delivery| delivery.issued);
        issued.map(|issued| issued.lease).max()
    }

    /// Returns what became of it so far.
    pub fn outcome_so_far(&self, now: Time) -> OrderOutcome {
        let lease = self.lease();
        let vehicles = if self.refused.is_some() {
            BTreeMap::new()
        } else {
            self.outcomes(now)
        };
        OrderOutcome {
            vehicles,
            lease,
            run: self.run,
            refused: self.refused,
            lifts: self.ends.clone().unwrap_or_default(),
        }
    }

    /// Decides whether something is asked for that cannot be; before anything is sent.
    fn refusal(&self, now: Time) -> Option<OrderRefusal> {
        match self.instruction.kind {
            OrderKind::Start => self
                .run_under_way(now)
                .or_else(|| self.run_ended(now))
                .or_else(|| self.mission_misfit(now))
                .or_else(|| self.unheard_under_stop(now))
                .or_else(|| self.stopped_since()),
            OrderKind::Return => self.under_stop().map(OrderRefusal::StopOpen),
            OrderKind::Hold | OrderKind::Land | OrderKind::CutMotors => None,
        }
    }

    /// Returns a stop that would be lifted although it was given after this start: its operator cannot have meant that.
    fn stopped_since(&self) -> Option<OrderRefusal> {
        let ends = self.stops_to_end();
        let mut since = self.view.stops_given_after(self.began);
        let stop = since.find(|stop| ends.contains(stop))?;
        let (name, by) = (stop.name, stop.by);
        Some(OrderRefusal::StoppedSince { name, by })
    }

    /// Returns who was not heard for too long while a stop is open that would be lifted.
    fn unheard_under_stop(&self, now: Time) -> Option<OrderRefusal> {
        if !self.has_listened(now) || self.stops_to_end().is_empty() {
            return None;
        }
        let is_unheard = |id: &VehicleId| {
            self.view
                .state(*id)
                .is_none_or(|state| state.age(now) > SILENT_AFTER)
        };
        let mut unheard = self.targets(now);
        unheard.retain(|id| is_unheard(id) && !self.instruction.although_unheard.contains(id));
        unheard.first().map(|id| OrderRefusal::Unheard(*id))
    }

    /// Returns an open stop that concerns a vehicle of this order.
    fn under_stop(&self) -> Option<EmergencyName> {
        let concerns = |stop: &&EmergencyStop| match stop.scope {
            StopScope::All => true,
            StopScope::One(id) => {
                self.instruction.vehicles.is_empty() || self.instruction.vehicles.contains(&id)
            }
        };
        self.view
            .open_stops()
            .iter()
            .find(concerns)
            .map(|stop| stop.name)
    }

    /// Returns the stops that a start lifts now.
    fn stops_to_end(&self) -> Vec<EmergencyStop> {
        let open = self.view.open_stops().into_iter();
        open.filter(|stop| self.instruction.lifts_many || !stop.name.is_many())
            .take(ENDS_MAX)
            .collect()
    }

    /// Returns whether it is known which stops are open, as far as this order needs it, and chooses once which of them it
    /// lifts.
    fn knows_stops(&mut self, now: Time) -> bool {
        if self.instruction.kind != OrderKind::Start || self.ends.is_some() {
            return true;
        }
        let have_told = |id: &VehicleId| self.view.standing_at(Sender::Vehicle(*id)).is_some();
        let targets = self.targets(now);
        let all_have_told = !targets.is_empty() && targets.iter().all(have_told);
        let knows_all = !self.instruction.vehicles.is_empty()
            || !self.instruction.expected.is_empty()
            || self.view.ground(now).is_some();
        // Who does not tell may be unheard; that is judged once all were listened for.
        let is_known = self.has_listened(now) || all_have_told && knows_all;
        if is_known {
            self.ends = Some(self.stops_to_end());
        }
        is_known
    }

    fn outcomes(&self, now: Time) -> BTreeMap<VehicleId, VehicleOutcome> {
        let nothing = VehicleDelivery::default();
        let of = |id| {
            let delivery = self.deliveries.get(&id).unwrap_or(&nothing);
            let outcome = delivery.outcome(self.view.state(id).is_some());
            if let Some(outcome) = self.mission_outcome(now, id, outcome) {
                return (id, outcome);
            }
            if let (VehicleOutcome::Ignored, Some(name)) = (outcome, self.other_stop(id)) {
                return (id, VehicleOutcome::UnderStop(name));
            }
            match (outcome, self.misfit(id)) {
                (VehicleOutcome::Ignored | VehicleOutcome::Unheard, _)
                    if self.withdrawn.contains(&id) =>
                {
                    (id, VehicleOutcome::Withdrawn)
                }
                (VehicleOutcome::Ignored | VehicleOutcome::Unheard, Some(misfit)) => {
                    (id, VehicleOutcome::Foreign(misfit))
                }
                (outcome, _) => (id, outcome),
            }
        };
        self.targets(now).into_iter().map(of).collect()
    }

    /// Returns an open stop that a vehicle stands under and this order does not lift.
    fn other_stop(&self, id: VehicleId) -> Option<EmergencyName> {
        let ends = self.ends.as_deref()?;
        match self.view.state(id)?.value.stands_under? {
            StandReason::Stop(name) => {
                Some(name).filter(|name| ends.iter().all(|stop| stop.name != *name))
            }
            _ => None,
        }
    }

    /// Returns why a vehicle does not listen to this operator, if it does not.
    fn misfit(&self, id: VehicleId) -> Option<Incompatibility> {
        self.view
            .misfit(Sender::Vehicle(id), self.instruction.venue_hash)
    }

    /// Returns who must obey.
    fn targets(&self, now: Time) -> BTreeSet<VehicleId> {
        self.instruction.targets(&self.view, now)
    }

    /// Returns to whom it is sent.
    fn addressees(&self, now: Time) -> BTreeSet<VehicleId> {
        let mut all = self.targets(now);
        all.retain(|id| !self.withdrawn.contains(id));
        all
    }

    /// Compares what a vehicle says it was ordered with what was sent to it.
    fn judge(&mut self, now: Time, id: VehicleId) {
        let kind = self.instruction.kind;
        let ground = self.view.ground(now).map(|report| report.value.in_force);
        let (in_force, stands) = (self.view.lease(now), self.stands);
        let Some(state) = self.view.state(id) else {
            return;
        };
        let echo = state.value.ordered;
        let Some(delivery) = self.deliveries.get_mut(&id) else {
            return;
        };
        let Some(issued) = delivery.issued else {
            return;
        };
        let is_above = echo.edition() >= (issued.lease, issued.revision);
        let Some(theirs) = echo.kind.filter(|_| is_above) else {
            // It was never obeyed, or the vehicle has been started anew and knows nothing of it.
            if stands && delivery.obeyed.is_some() {
                delivery.forget(in_force);
            }
            (delivery.obeyed, delivery.contested) = (None, None);
            delivery.look_at_memory(echo);
            return;
        };
        let is_same_lease = echo.lease == issued.lease;
        // What has our edition was ordered instead of ours, not after it.
        let is_later = echo.edition() > (issued.lease, issued.revision);
        if delivery.obeyed.is_some() && stands {
            let is_by_ground = is_same_lease && ground == Some(None);
            delivery.doubt(now, echo, theirs == kind || is_by_ground);
        }
        if delivery.obeyed.is_some() || delivery.overruled.is_some() {
            return;
        }
        if theirs == kind {
            delivery.obeyed = Some((now, false));
        } else if kind.strength() > theirs.strength() && is_same_lease && delivery.insisted < INSIST
        {
            delivery.insisted += 1;
            (delivery.issued, delivery.sent_at) = (None, None);
        } else if may_be_brought_about(kind, theirs)
            && is_later
            && is_same_lease
            && ground.is_some()
        {
            let since = delivery.contested.map_or(now, |(since, _)| since);
            delivery.contested = Some((since, echo));
        } else {
            delivery.overruled = Some(echo);
        }
    }

    /// Decides whether what came above a start is the ground station bringing it about.
    fn settle(&mut self, now: Time, id: VehicleId) {
        let report = self.view.ground(now);
        let Some(delivery) = self.deliveries.get_mut(&id) else {
            return;
        };
        let Some((since, echo)) = delivery.contested.filter(|_| !delivery.is_over()) else {
            return;
        };
        let brings_about = |report: &Timestamped<GroundReport>| {
            report.at >= since
                && report.value.in_force.is_none()
                && report.value.phase != StationPhase::Idle
        };
        if report.is_some_and(brings_about) {
            delivery.obeyed = Some((since, true));
        } else if report.is_none() || now.since(since) >= CONTEST {
            delivery.overruled = Some(echo);
        }
    }

    fn due(&mut self, now: Time, id: VehicleId) -> Option<Order> {
        let delivery = self.deliveries.entry(id).or_default();
        let waits = delivery.sent_at.is_some_and(|at| now.since(at) < REPEAT);
        if delivery.is_over() || delivery.contested.is_some() || waits {
            return None;
        }
        let issued = match delivery.issued {
            Some(issued) => issued,
            None => self.issue(now, id)?,
        };
        let run = self.run_of(now);
        let state = self.view.state(id).map(|state| &state.value);
        let kind = self.instruction.kind;
        let delivery = self.deliveries.entry(id).or_default();
        if delivery.first_at.is_none() && kind == OrderKind::Start {
            delivery.take_over = state.and_then(take_over_of);
        }
        delivery.issued = Some(issued);
        delivery.sent_at = Some(now);
        delivery.first_at.get_or_insert(now);
        let OrderRight { lease, revision } = issued;
        let seen = state.map(|state| SeenState {
            boot: state.boot,
            sequence: state.sequence,
        });
        let lifted = self.ends.iter().flatten().map(|stop| stop.name);
        let ends = ended(&lifted.collect::<Vec<EmergencyName>>(), delivery.take_over);
        Some(Order {
            vehicle: id,
            lease,
            run,
            revision,
            seen,
            kind,
            ends,
        })
    }

    /// Chooses the lease and the revision that are above a vehicle's echo; `None` while nothing may be sent yet.
    fn issue(&self, now: Time, id: VehicleId) -> Option<OrderRight> {
        let state = self.view.state(id).filter(|_| self.knows_ground(now))?;
        Some(self.above(now, &state.value))
    }

    /// Returns whether the ground's lease is known as far as this order needs it.
    fn knows_ground(&self, now: Time) -> bool {
        let may_wait = matches!(self.instruction.kind, OrderKind::Start | OrderKind::Return);
        !may_wait || self.view.ground(now).is_some() || self.has_listened(now)
    }

    fn has_listened(&self, now: Time) -> bool {
        self.has_listened || self.linked.is_some_and(|since| now.since(since) >= LISTEN)
    }

    fn above(&self, now: Time, state: &State) -> OrderRight {
        let highest = self.view.lease(now);
        let own = |number| Lease {
            number,
            holder: self.instruction.holder,
        };
        let is_ours = highest.holder == self.instruction.holder;
        let lease = match highest.number {
            0 => own(FIRST_LEASE),
            number if self.instruction.take_over && !is_ours => own(number.saturating_add(1)),
            _ => highest,
        };
        let echo = state.ordered;
        if echo.lease != lease {
            return OrderRight {
                lease,
                revision: Revision(1),
            };
        }
        match echo
            .revision
            .0
            .checked_add(1)
            .filter(|next| *next <= LAST_REVISION)
        {
            Some(next) => OrderRight {
                lease,
                revision: Revision(next),
            },
            // This lease is used up.
            None => {
                let lease = own(lease.number.saturating_add(1));
                OrderRight {
                    lease,
                    revision: Revision(1),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
