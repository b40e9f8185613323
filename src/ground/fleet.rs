//! What the ground knows of each vehicle: its newest state and progress, when it was heard, what it was ordered and by
//! whom. What follows from that is the station's business.
//!
//! **Orders by several.** The station and an operator's `order` use the same lease, each with a revision above the
//! vehicle's echo; the higher (lease, revision) wins, and a vehicle obeys only what is above its echo. So an echo that
//! is not the station's own order shows what somebody else has ordered: a Start, or something that *stands* until the
//! next Start of that vehicle. An own order that lost is given up, never raised over the other one; a Start that was on its
//! way when somebody stopped the vehicle lifts nothing: what stands is ordered again, above it, at once and when the start
//! came all the same. So nobody else's next start has its number.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    Boot, EmergencyStop, Lease, Mission, Order, OrderKind, Ordered, Revision, RunId, SeenState, State,
    VehicleId,
};

use crate::geom::Point;
use crate::stops::first_that_stops;
use crate::sweep::{LOWER_BOOT_AFTER, LowerNumbers, VOID_AFTER, VehicleProgress};
use crate::time::Time;

/// What must not be forgotten of a vehicle when the ground station starts anew.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Dealings {
    /// Newest start of its software that was heard.
    pub boot: Option<Boot>,
    /// What the station has ordered last.
    pub issued: Option<Order>,
    /// Whether that order is still to be repeated.
    pub is_pending: bool,
    /// Whether it was said; then it may be on its way.
    pub is_said: bool,
    /// An own start that was said, and given up because somebody else has stopped the vehicle.
    pub crossing: Option<Order>,
    /// What it said last that it was ordered.
    pub echo: Option<Ordered>,
    /// The run that it had been started for before anything was heard of it, as long as it shows nothing else.
    pub earlier: Option<RunId>,
    /// What it was ordered other than Start, by anyone, since its last Start; the strongest.
    pub stands: Option<OrderKind>,
    /// Whether it has been silent for too long while others were heard.
    pub is_lost: bool,
}

/// One vehicle as the ground sees it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Member {
    /// Its newest state, and when it came.
    pub state: Option<(Time, State)>,
    /// States that came behind the newest one since.
    lower: LowerNumbers,
    /// Its newest progress.
    pub progress: Option<VehicleProgress>,
    /// When that, or a later one, was said last.
    pub progress_at: Option<Time>,
    /// What the newest start of its software has said of its mission last.
    pub mission: Option<Mission>,
    /// When it last said its state. Progress alone is no sign of life: it comes on when the autopilot is silent.
    pub heard_at: Option<Time>,
    /// What was dealt with it.
    pub dealings: Dealings,
}

/// What a message of a vehicle has shown.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Shown {
    /// Its software has been started anew.
    pub restarted: bool,
    /// It was lost, and is back.
    pub found: bool,
    /// It has got on with its plan.
    pub got_on: bool,
    /// Somebody else has ordered it to begin this run.
    pub started: Option<RunId>,
}

/// All vehicles that the ground expects.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Fleet {
    members: BTreeMap<VehicleId, Member>,
    lease: Lease,
}

impl Fleet {
    /// Makes a fleet of vehicles that have not been heard yet.
    pub fn new(expected: &[VehicleId], lease: Lease) -> Fleet {
        Fleet { members: expected.iter().map(|id| (*id, Member::default())).collect(), lease }
    }

    /// Takes up what was dealt with vehicles before; those not expected any more are passed over.
    pub fn recall(&mut self, dealings: &[(VehicleId, Dealings)]) {
        for (vehicle, known) in dealings {
            if let Some(member) = self.members.get_mut(vehicle) {
                member.dealings = known.clone();
            }
        }
    }

    /// Gives the vehicles, ascending.
    pub fn members(&self) -> impl Iterator<Item = (VehicleId, &Member)> {
        self.members.iter().map(|(id, member)| (*id, member))
    }

    /// Gives what was dealt with each vehicle, ascending.
    pub fn dealings(&self) -> Vec<(VehicleId, Dealings)> {
        self.members().map(|(id, member)| (id, member.dealings.clone())).collect()
    }

    /// Tells whether a vehicle is one of the fleet.
    pub fn expects(&self, vehicle: VehicleId) -> bool {
        self.members.contains_key(&vehicle)
    }

    /// Gives how many vehicles there are, lost ones included.
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Gives the vehicles that are not lost, ascending.
    pub fn present(&self) -> Vec<VehicleId> {
        self.members().filter(|(_, member)| !member.dealings.is_lost).map(|(id, _)| id).collect()
    }

    /// Gives the vehicles that are lost, ascending.
    pub fn lost(&self) -> Vec<VehicleId> {
        self.members().filter(|(_, member)| member.dealings.is_lost).map(|(id, _)| id).collect()
    }

    /// Gives the vehicles that are waited for and have not been heard yet, ascending.
    pub fn unheard(&self) -> Vec<VehicleId> {
        let is_unheard = |member: &Member| member.state.is_none() && !member.dealings.is_lost;
        self.members().filter(|(_, member)| is_unheard(member)).map(|(id, _)| id).collect()
    }

    /// Gives by which right orders and plans are given.
    pub fn lease(&self) -> Lease {
        self.lease
    }

    /// Takes a state; those of strangers change nothing, older ones only when they go on and nothing newer comes, and those
    /// of an earlier start only after a long silence.
    pub fn heard_state(&mut self, now: Time, state: State) -> Shown {
        let lease = self.lease;
        let Some(member) = self.members.get_mut(&state.vehicle) else { return Shown::default() };
        let key = |state: &State| (state.boot, state.sequence);
        let known = member.state.as_ref().map(|(_, known)| key(known));
        let is_earlier_start = member.dealings.boot.is_some_and(|boot| state.boot < boot);
        let is_believed = match known {
            _ if is_earlier_start => member.counts_anew(now, state.boot),
            Some((boot, sequence)) if boot == state.boot && state.sequence < sequence => {
                member.lower.go_on(now, state.sequence)
            }
            Some(known) => known < key(&state),
            None => true,
        };
        if !is_believed {
            return Shown::default();
        }
        member.lower = LowerNumbers::default();
        let mut shown = member.hear(state.boot);
        member.heard_at = Some(now);
        shown.found = std::mem::take(&mut member.dealings.is_lost);
        let started = member.dealings.take_echo(state.ordered, state.accepted.0, lease);
        shown.started = started.or_else(|| member.dealings.under_way(&state));
        member.state = Some((now, state));
        shown
    }

    /// Takes a progress; one of an older start of the software changes nothing, nor does one behind what was said not long
    /// ago.
    pub fn heard_progress(&mut self, now: Time, progress: VehicleProgress) -> Shown {
        let Some(member) = self.members.get_mut(&progress.vehicle) else { return Shown::default() };
        if member.dealings.boot.is_some_and(|boot| progress.boot < boot) {
            return Shown::default();
        }
        let mut shown = member.hear(progress.boot);
        let key = |progress: &VehicleProgress| (progress.run, progress.revision, progress.done);
        let before = member.progress.as_ref().map(key);
        let is_void = member.progress_at.is_none_or(|at| now.since(at) > VOID_AFTER);
        if before <= Some(key(&progress)) || is_void {
            (member.progress, member.progress_at) = (Some(progress), Some(now));
        }
        shown.got_on = before < Some(key(&progress));
        shown
    }

    /// Takes what a vehicle says of its mission, unless an earlier start of its software has said it.
    pub fn heard_mission(&mut self, mission: &Mission) {
        let Some(member) = self.members.get_mut(&mission.vehicle) else { return };
        if member.dealings.boot.is_none_or(|boot| boot <= mission.boot) {
            member.mission = Some(*mission);
        }
    }

    /// Returns what a vehicle has said of its mission last.
    pub fn mission(&self, vehicle: VehicleId) -> Option<&Mission> {
        self.members.get(&vehicle)?.mission.as_ref()
    }

    /// Tells whether a progress was said by the newest start of a vehicle's software.
    pub fn is_current(&self, progress: &VehicleProgress) -> bool {
        let known = self.members.get(&progress.vehicle).and_then(|member| member.dealings.boot);
        known.is_none_or(|boot| boot <= progress.boot)
    }

    /// Returns the newest state heard from a vehicle, as plans and orders name it; `None` = it was not heard.
    pub fn newest_state(&self, vehicle: VehicleId) -> Option<SeenState> {
        let (_, state) = self.members.get(&vehicle)?.state.as_ref()?;
        Some(SeenState { boot: state.boot, sequence: state.sequence })
    }

    /// Tells whether it is known where every vehicle is that is not lost.
    pub fn are_placed(&self) -> bool {
        self.members.values().all(|member| member.dealings.is_lost || member.place().is_some())
    }

    /// Gives the highest revision of a run that any vehicle shows, so that a new ground begins above it.
    pub fn highest_revision(&self, run: RunId) -> Revision {
        let shown = self.accepted().filter(|accepted| accepted.0 == run).map(|accepted| accepted.1);
        shown.max().unwrap_or_default()
    }

    /// Gives the highest run whose plans any vehicle follows.
    pub fn highest_run(&self) -> RunId {
        self.accepted().map(|accepted| accepted.0).max().unwrap_or_default()
    }

    fn accepted(&self) -> impl Iterator<Item = (RunId, Revision)> {
        self.members.values().filter_map(|member| member.state.as_ref()).map(|(_, state)| state.accepted)
    }

    /// Gives what stands for any vehicle that is not lost: ordered by anyone and not ended by a Start; the strongest.
    pub fn standing(&self) -> Option<OrderKind> {
        let present = self.members.values().filter(|member| !member.dealings.is_lost);
        present.filter_map(|member| member.dealings.stands).reduce(OrderKind::stronger)
    }

    /// Orders by this right from now on; what is still to be repeated too, as the first of this right: others count from
    /// there as well, and a higher revision would beat what they order.
    pub fn set_lease(&mut self, lease: Lease) {
        self.lease = lease;
        for member in self.members.values_mut() {
            member.dealings.pass_to(lease);
        }
    }

    /// Orders what the operator wishes of every vehicle, above whatever it has obeyed before.
    pub fn order_all(&mut self, run: RunId, kind: OrderKind) {
        for (vehicle, member) in &mut self.members {
            member.dealings.order(*vehicle, self.lease, run, kind);
        }
    }

    /// Takes which emergency stops are open: for whom they hold stands until somebody starts it, and an own start that is
    /// still to be repeated is given up.
    pub fn stop(&mut self, open: &[EmergencyStop]) {
        for (vehicle, member) in &mut self.members {
            if first_that_stops(open, *vehicle).is_some() {
                member.dealings.be_stopped(*vehicle, self.lease);
            }
        }
    }

    /// Starts every vehicle for which nothing stands: what somebody has stopped, lost or not, only somebody starts.
    pub fn start_all(&mut self, run: RunId) {
        for (vehicle, member) in
            self.members.iter_mut().filter(|(_, member)| member.dealings.stands.is_none())
        {
            member.dealings.order(*vehicle, self.lease, run, OrderKind::Start);
        }
    }

    /// Gives the orders that are not yet seen in a state, answering the newest state heard.
    pub fn open_orders(&self) -> Vec<Order> {
        let order = |member: &Member| {
            let (_, state) = member.state.as_ref()?;
            let order = member.dealings.issued.as_ref().filter(|_| member.dealings.is_pending)?;
            let seen = SeenState { boot: state.boot, sequence: state.sequence };
            Some(Order { seen: Some(seen), ..order.clone() })
        };
        self.members.values().filter_map(order).collect()
    }

    /// Takes the open orders for said.
    pub fn note_said(&mut self) {
        for member in self.members.values_mut() {
            let is_open = member.state.is_some() && member.dealings.is_pending;
            member.dealings.is_said |= is_open && member.dealings.issued.is_some();
        }
    }

    /// Gives who has not said its state for `after`, although another vehicle was heard within `others`; they are lost from
    /// now on.
    pub fn lose(&mut self, now: Time, after: Duration, others: Duration) -> Vec<VehicleId> {
        let within = |member: &Member, span| member.heard_at.is_some_and(|at| now.since(at) <= span);
        if !self.members.values().any(|member| within(member, others)) {
            return Vec::new();
        }
        let is_gone =
            |member: &Member| !member.dealings.is_lost && member.heard_at.is_some() && !within(member, after);
        let lost = self.members().filter(|(_, member)| is_gone(member)).map(|(id, _)| id).collect();
        self.members.values_mut().filter(|member| is_gone(member)).for_each(|member| {
            member.dealings.is_lost = true;
        });
        lost
    }

    /// Counts those as lost who have not been heard at all, silent since `since`; gives them.
    pub fn lose_unheard(&mut self, since: Time) -> Vec<VehicleId> {
        let unheard = self.unheard();
        for vehicle in &unheard {
            if let Some(member) = self.members.get_mut(vehicle) {
                member.dealings.is_lost = true;
                member.heard_at.get_or_insert(since);
            }
        }
        unheard
    }

    /// Counts silence from now on, for those who were heard before this station was started.
    pub fn count_silence_from(&mut self, now: Time) {
        for member in self.members.values_mut().filter(|member| member.dealings.boot.is_some()) {
            member.heard_at.get_or_insert(now);
        }
    }
}

impl Member {
    /// Returns where it is; `None` when it was not heard, or does not know.
    pub fn place(&self) -> Option<Point> {
        let (_, state) = self.state.as_ref()?;
        state.pose.map(|pose| pose.at.into())
    }

    /// Returns whether a lower count of starts is believed: it has been silent for so long that its disk is a new one.
    fn counts_anew(&self, now: Time, boot: Boot) -> bool {
        let is_lower = self.dealings.boot.is_some_and(|known| boot < known);
        is_lower && self.heard_at.is_some_and(|at| now.since(at) > LOWER_BOOT_AFTER)
    }

    /// Gives whether its software was started anew.
    fn hear(&mut self, boot: Boot) -> Shown {
        let known = self.dealings.boot.replace(boot);
        Shown { restarted: known.is_some_and(|known| known != boot), ..Shown::default() }
    }
}

impl Dealings {
    fn order(&mut self, vehicle: VehicleId, lease: Lease, run: RunId, kind: OrderKind) {
        let echo = self.echo.filter(|echo| echo.lease >= lease);
        let obeyed = echo.map_or(Revision(0), |echo| echo.revision);
        let pending = self.issued.as_ref().filter(|order| self.is_pending && order.lease == lease);
        let pending = pending.map_or(Revision(0), |order| order.revision);
        let crossing = self.crossing.as_ref().filter(|order| order.lease == lease);
        let crossing = crossing.map_or(Revision(0), |order| order.revision);
        let revision = Revision(obeyed.max(pending).max(crossing).0.saturating_add(1));
        self.issued = Some(Order { vehicle, lease, run, revision, seen: None, kind, ends: Vec::new() });
        (self.is_pending, self.is_said) = (true, false);
        self.stand(kind);
    }

    /// Passes what is still to be repeated to another right, above what the vehicle shows of that right.
    fn pass_to(&mut self, lease: Lease) {
        let obeyed = self.echo.filter(|echo| echo.lease == lease).map_or(Revision(0), |echo| echo.revision);
        let pending = self.issued.as_mut().filter(|order| self.is_pending && order.lease != lease);
        if let Some(order) = pending {
            (order.lease, order.revision) = (lease, Revision(obeyed.0.saturating_add(1)));
            self.is_said = false;
        }
    }

    /// An emergency stop holds it, whoever has ordered what. An own start that was said and is not obeyed yet has a number
    /// that the next one to order counts on to: a hold goes above it, so that no other start is taken for it.
    fn be_stopped(&mut self, vehicle: VehicleId, lease: Lease) {
        self.stand(OrderKind::Hold);
        let start = self.issued.clone().filter(|order| self.is_pending && order.kind == OrderKind::Start);
        match start {
            Some(start) if self.is_said => self.order(vehicle, lease, start.run, OrderKind::Hold),
            Some(_) => self.is_pending = false,
            None => {}
        }
    }

    fn stand(&mut self, kind: OrderKind) {
        let strongest = self.stands.into_iter().chain([kind]).reduce(OrderKind::stronger);
        self.stands = strongest.filter(|_| kind != OrderKind::Start);
    }

    /// Takes what a vehicle says it was ordered; gives the run that somebody else has started it for. Of what was
    /// ordered before anything was heard of it, only a run whose plans it has not `accepted` counts, by a right not
    /// below `lease`.
    fn take_echo(&mut self, echo: Ordered, accepted: RunId, lease: Lease) -> Option<RunId> {
        let known = self.echo.replace(echo);
        self.go_above(echo);
        let kind = echo.kind.filter(|_| known != Some(echo))?;
        let of = |order: &Order| (order.lease, order.revision);
        let is = |order: &Order| of(order) == echo.edition() && (order.kind, order.run) == (kind, echo.run);
        if let Some(order) = self.crossing.take_if(|order| is(order)) {
            let is_above = self.issued.as_ref().is_some_and(|issued| of(issued) > echo.edition());
            if !(self.is_pending && is_above) {
                self.stop_again(order.vehicle, lease, echo.run);
            }
            return None;
        }
        let is_own = self.issued.as_ref().is_some_and(is);
        // What somebody has stopped meanwhile is not started again by what was ordered before.
        let is_beaten = self.issued.as_ref().is_some_and(|order| {
            echo.edition() >= of(order) || (kind != OrderKind::Start && order.kind == OrderKind::Start)
        });
        self.is_pending = self.is_pending && !is_beaten;
        if is_own {
            return None;
        }
        let is_start = kind == OrderKind::Start;
        if is_beaten {
            // Another order of the same edition is not taken for the own one.
            let lost = self.issued.take().filter(|order| self.is_said && order.kind == OrderKind::Start);
            self.crossing = lost.filter(|order| !is_start && of(order) > echo.edition());
        }
        self.stand(kind);
        if let Some(start) = self.crossing.clone().filter(|_| is_beaten && kind != OrderKind::CutMotors) {
            // It may be on its way still, and whoever orders next counts on to its number.
            self.stop_again(start.vehicle, lease, echo.run);
        }
        let is_fresh = known.is_some() || (echo.lease >= lease && accepted < echo.run);
        self.earlier = (is_start && !is_fresh && echo.lease >= lease).then_some(echo.run);
        (is_start && is_fresh).then_some(echo.run)
    }

    /// An own start has come after what stands: that is ordered again. Motors that would be cut stop otherwise: the vehicle
    /// may be under way by now.
    fn stop_again(&mut self, vehicle: VehicleId, lease: Lease, run: RunId) {
        match self.stands {
            None | Some(OrderKind::Start) => {}
            Some(OrderKind::CutMotors) => self.order(vehicle, lease, run, OrderKind::Land),
            Some(kind @ (OrderKind::Hold | OrderKind::Return | OrderKind::Land)) => {
                self.order(vehicle, lease, run, kind);
            }
        }
    }

    /// Orders above what a vehicle that was started anew remembers of this lease: it obeys nothing lower.
    fn go_above(&mut self, echo: Ordered) {
        let pending = self.issued.as_mut().filter(|_| self.is_pending && echo.kind.is_none());
        if let Some(order) =
            pending.filter(|order| order.lease == echo.lease && order.revision < echo.revision)
        {
            order.revision = Revision(echo.revision.0.saturating_add(1));
            self.is_said = false;
        }
    }

    /// Gives the run that a vehicle is in the middle of, though it was started before anything was heard of it: who
    /// drives a leg has not come to the end of its plan.
    fn under_way(&mut self, state: &State) -> Option<RunId> {
        if state.leg.is_some() { self.earlier.take() } else { None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Mode, Permille};

    const ONE: VehicleId = VehicleId(1);
    const LEASE: Lease = Lease { number: 1, holder: 9 };

    fn state(sequence: u64, revision: u32, kind: Option<OrderKind>) -> State {
        State {
            vehicle: ONE,
            boot: Boot(1),
            sequence,
            pose: Some(Default::default()),
            is_at_rest: true,
            mode: Mode::Idle,
            battery: Some(Permille::WHOLE),
            leg: None,
            accepted: Default::default(),
            ordered: Ordered { lease: LEASE, revision: Revision(revision), run: RunId(1), kind },
            ..State::default()
        }
    }

    fn heard(fleet: &mut Fleet, sequence: u64, revision: u32, kind: OrderKind) -> Shown {
        fleet.heard_state(Time::ZERO, state(sequence, revision, Some(kind)))
    }

    #[test]
    fn an_order_is_repeated_until_its_effect_shows() {
        let mut fleet = Fleet::new(&[ONE], LEASE);
        heard(&mut fleet, 5, 3, OrderKind::Start);
        fleet.order_all(RunId(1), OrderKind::Start);
        assert_eq!(fleet.open_orders()[0].revision, Revision(4));
        assert_eq!(fleet.open_orders()[0].seen, Some(SeenState { boot: Boot(1), sequence: 5 }));
        heard(&mut fleet, 6, 3, OrderKind::Start);
        assert_eq!(fleet.open_orders().len(), 1);
        heard(&mut fleet, 7, 4, OrderKind::Start);
        assert!(fleet.open_orders().is_empty());
    }

    #[test]
    fn old_states_and_strangers_change_nothing() {
        let mut fleet = Fleet::new(&[ONE], Lease::default());
        fleet.heard_state(Time::ZERO, State { vehicle: VehicleId(8), ..state(1, 0, None) });
        assert_eq!(fleet.unheard(), [ONE]);
        fleet.heard_state(Time::ZERO, state(9, 0, None));
        fleet.heard_state(Time::ZERO, state(4, 0, None));
        let (_, member) = fleet.members().next().unwrap();
        assert_eq!(member.state.as_ref().unwrap().1.sequence, 9);
    }

    #[test]
    fn an_order_above_the_highest_revision_is_no_overflow() {
        let mut fleet = Fleet::new(&[ONE], Lease::default());
        fleet.heard_state(Time::ZERO, state(1, u32::MAX, None));
        fleet.order_all(RunId(1), OrderKind::Land);
        assert_eq!(fleet.open_orders()[0].revision, Revision(u32::MAX));
    }

    #[test]
    fn what_somebody_else_has_stopped_stands_and_beats_the_own_start() {
        for revision in [3, 4, 7] {
            let mut fleet = Fleet::new(&[ONE], LEASE);
            heard(&mut fleet, 1, 2, OrderKind::Start);
            fleet.order_all(RunId(1), OrderKind::Start);
            fleet.order_all(RunId(1), OrderKind::Start);
            // The operator's order came before, at the same time as, or after the own one.
            let shown = heard(&mut fleet, 2, revision, OrderKind::Hold);
            assert_eq!((fleet.standing(), shown.started), (Some(OrderKind::Hold), None));
            assert!(fleet.open_orders().is_empty(), "the own start is not repeated: {revision}");
            let shown = heard(&mut fleet, 3, revision + 1, OrderKind::Start);
            assert_eq!((fleet.standing(), shown.started), (None, Some(RunId(1))));
        }
    }

    #[test]
    fn an_own_start_that_came_after_a_stop_lifts_nothing_and_the_stop_is_ordered_again() {
        for (stop, again) in [
            (OrderKind::Hold, OrderKind::Hold),
            (OrderKind::Land, OrderKind::Land),
            (OrderKind::CutMotors, OrderKind::Land),
        ] {
            let mut fleet = Fleet::new(&[ONE], LEASE);
            heard(&mut fleet, 1, 2, OrderKind::Start);
            fleet.order_all(RunId(1), OrderKind::Start);
            fleet.order_all(RunId(1), OrderKind::Start);
            fleet.note_said();
            // The operator has not heard of the own start, which has revision 4.
            heard(&mut fleet, 2, 3, stop);
            assert_eq!(heard(&mut fleet, 3, 4, OrderKind::Start).started, None);
            assert_eq!(fleet.standing(), Some(stop));
            let orders = fleet.open_orders();
            assert_eq!((orders[0].kind, orders[0].revision), (again, Revision(5)));
            fleet.start_all(RunId(1));
            assert_eq!(fleet.open_orders(), orders, "what stands is not started");
            heard(&mut fleet, 4, 5, again);
            heard(&mut fleet, 5, 6, OrderKind::Start);
            assert_eq!(fleet.standing(), None, "somebody has started it");
        }
    }

    #[test]
    fn whoever_starts_next_does_not_have_the_number_of_an_own_start_that_was_given_up() {
        let said = || {
            let mut fleet = Fleet::new(&[ONE], LEASE);
            heard(&mut fleet, 1, 2, OrderKind::Start);
            fleet.order_all(RunId(1), OrderKind::Start);
            fleet.note_said();
            fleet
        };
        // It was stopped under a lower lease, or by an emergency stop: its echo says nothing of the start.
        let (mut held, mut stopped) = (said(), said());
        let lower = Lease { number: 0, holder: 3 };
        let mut hold = state(2, 9, Some(OrderKind::Hold));
        hold.ordered.lease = lower;
        held.heard_state(Time::ZERO, hold);
        let (name, by) = (tomoswarm_proto::EmergencyName(70_000), tomoswarm_proto::OperatorId(1));
        stopped.stop(&[EmergencyStop { name, scope: tomoswarm_proto::StopScope::All, by }]);
        for fleet in [&mut held, &mut stopped] {
            let orders = fleet.open_orders();
            assert_eq!((orders[0].kind, fleet.standing()), (OrderKind::Hold, Some(OrderKind::Hold)));
            let revision = orders[0].revision.0;
            heard(fleet, 3, revision, OrderKind::Hold);
            let shown = heard(fleet, 4, revision + 1, OrderKind::Start);
            assert_eq!((fleet.standing(), shown.started), (None, Some(RunId(1))), "somebody has started it");
        }
    }

    #[test]
    fn under_another_lease_orders_count_from_one_again() {
        let mut fleet = Fleet::new(&[ONE], LEASE);
        heard(&mut fleet, 1, 7, OrderKind::Start);
        fleet.order_all(RunId(1), OrderKind::Start);
        assert_eq!(fleet.open_orders()[0].revision, Revision(8));
        let next = Lease { number: 2, ..LEASE };
        for order_anew in [false, true] {
            fleet.set_lease(next);
            if order_anew {
                heard(&mut fleet, 2, 9, OrderKind::Hold);
                fleet.order_all(RunId(1), OrderKind::Start);
            }
            let order = &fleet.open_orders()[0];
            assert_eq!((order.lease, order.revision), (next, Revision(1)), "{order_anew}");
        }
    }

    #[test]
    fn what_waits_goes_above_what_a_vehicle_started_anew_remembers_of_the_next_lease() {
        let mut fleet = Fleet::new(&[ONE], LEASE);
        heard(&mut fleet, 1, 7, OrderKind::Start);
        fleet.order_all(RunId(1), OrderKind::Start);
        let next = Lease { number: 2, ..LEASE };
        let remembered = Ordered { lease: next, revision: Revision(3), run: RunId(1), kind: None };
        let anew = State { boot: Boot(2), ordered: remembered, ..state(1, 0, None) };
        fleet.heard_state(Time::ZERO, anew);
        fleet.set_lease(next);
        assert_eq!(fleet.open_orders()[0].revision, Revision(4));
    }

    #[test]
    fn what_was_ordered_long_ago_by_a_lower_right_starts_nothing() {
        let mut fleet = Fleet::new(&[ONE], Lease { number: 5, holder: 9 });
        assert_eq!(heard(&mut fleet, 1, 2, OrderKind::Start).started, None);
        assert_eq!(heard(&mut fleet, 2, 3, OrderKind::Start).started, Some(RunId(1)), "that one is new");
    }

    #[test]
    fn an_own_order_that_was_obeyed_is_nobody_elses() {
        let mut fleet = Fleet::new(&[ONE], LEASE);
        heard(&mut fleet, 1, 1, OrderKind::Start);
        fleet.order_all(RunId(1), OrderKind::Start);
        assert_eq!(heard(&mut fleet, 2, 2, OrderKind::Start).started, None);
        assert!(fleet.open_orders().is_empty());
    }

    #[test]
    fn who_is_silent_while_others_speak_is_lost_until_heard_again() {
        let two = VehicleId(2);
        let (after, others) = (Duration::from_secs(30), Duration::from_secs(2));
        let at = |seconds| Time::ZERO + Duration::from_secs(seconds);
        let mut fleet = Fleet::new(&[ONE, two], LEASE);
        fleet.heard_state(at(0), state(1, 0, None));
        fleet.heard_state(at(0), State { vehicle: two, ..state(1, 0, None) });
        assert!(
            fleet.lose(at(40), after, others).is_empty(),
            "nobody is heard: the ground itself is cut off"
        );
        fleet.heard_state(at(41), State { vehicle: two, ..state(2, 0, None) });
        assert_eq!(fleet.lose(at(42), after, others), [ONE]);
        assert_eq!(fleet.lose(at(42), after, others), []);
        assert_eq!((fleet.present(), fleet.lost()), (vec![two], vec![ONE]));
        assert!(!fleet.heard_state(at(43), state(1, 0, None)).found, "an old state is no sign of life");
        assert!(fleet.heard_state(at(43), state(2, 0, None)).found);
        assert_eq!(fleet.present(), [ONE, two]);
    }

    #[test]
    fn what_waits_to_be_obeyed_goes_above_what_a_vehicle_started_anew_remembers() {
        let check = |remembered: u32, expected: u32| {
            let mut fleet = Fleet::new(&[ONE], LEASE);
            heard(&mut fleet, 5, 3, OrderKind::Hold);
            fleet.order_all(RunId(1), OrderKind::Return);
            fleet.heard_state(Time::ZERO, State { boot: Boot(2), ..state(1, remembered, None) });
            assert_eq!(fleet.open_orders()[0].revision, Revision(expected), "{remembered}");
        };
        check(3, 4);
        check(4, 4);
        check(7, 8);
    }

    #[test]
    fn a_restart_is_seen_and_what_was_said_before_it_counts_no_more() {
        let mut fleet = Fleet::new(&[ONE], LEASE);
        assert!(!fleet.heard_state(Time::ZERO, state(100, 0, None)).restarted);
        assert!(fleet.heard_state(Time::ZERO, State { boot: Boot(2), ..state(1, 0, None) }).restarted);
        let old =
            VehicleProgress { vehicle: ONE, boot: Boot(1), run: RunId(1), ..VehicleProgress::default() };
        assert_eq!(fleet.heard_progress(Time::ZERO, old), Shown::default());
        assert!(fleet.heard_progress(Time::ZERO, VehicleProgress { boot: Boot(2), ..old }).got_on);
        assert!(fleet.heard_progress(Time::ZERO, VehicleProgress { boot: Boot(3), ..old }).restarted);
    }

    #[test]
    fn a_vehicle_with_a_new_disk_is_believed_after_a_long_silence_and_has_restarted() {
        let at = |seconds: u32| Time::from_secs_f64(f64::from(seconds));
        let mut fleet = Fleet::new(&[ONE], LEASE);
        let state_of = |boot: u32, sequence: u64| State { boot: Boot(boot), ..state(sequence, 0, None) };
        fleet.heard_state(at(0), state_of(9, 100));
        assert_eq!(fleet.heard_state(at(30), state_of(1, 7)), Shown::default(), "30 s are not long enough");
        let progress =
            VehicleProgress { vehicle: ONE, boot: Boot(1), run: RunId(1), ..VehicleProgress::default() };
        assert!(!fleet.is_current(&progress));
        assert!(fleet.heard_state(at(31), state_of(1, 8)).restarted);
        assert!(fleet.is_current(&progress) && fleet.heard_progress(Time::ZERO, progress).got_on);
        assert!(!fleet.heard_state(at(32), state_of(1, 9)).restarted, "it is heard by its own count now");
    }

    #[test]
    fn a_state_that_its_vehicle_did_not_say_is_forgotten_when_its_own_go_on() {
        let at = |time_s: f64| Time::from_secs_f64(time_s);
        let mut fleet = Fleet::new(&[ONE], LEASE);
        fleet.heard_state(at(0.0), state(100, 0, None));
        fleet.heard_state(at(0.1), state(u64::MAX, 0, None));
        let newest = |fleet: &Fleet| fleet.newest_state(ONE).unwrap().sequence;
        for turn in 1..=50_u32 {
            fleet.heard_state(at(0.2 * f64::from(turn)), state(100 + u64::from(turn), 0, None));
            assert_eq!(newest(&fleet), u64::MAX, "a few may be late");
        }
        let shown = fleet.heard_state(at(10.2), state(151, 0, None));
        assert_eq!((newest(&fleet), shown.restarted), (151, false));
        fleet.heard_state(at(10.3), state(120, 0, None));
        assert_eq!(newest(&fleet), 151, "one that is late is late");
    }

    #[test]
    fn a_progress_that_its_vehicle_does_not_say_again_is_forgotten() {
        let at = |time_s: f64| Time::from_secs_f64(time_s);
        let of = |revision: u32, done: u32| VehicleProgress {
            vehicle: ONE,
            boot: Boot(1),
            run: RunId(1),
            revision: Revision(revision),
            done: Some(tomoswarm_proto::StopId(done)),
            leg: None,
        };
        let mut fleet = Fleet::new(&[ONE], LEASE);
        let progress = |fleet: &Fleet| fleet.members().next().unwrap().1.progress;
        fleet.heard_progress(at(0.0), of(2, 5));
        fleet.heard_progress(at(1.0), of(900, 9));
        fleet.heard_progress(at(10.9), of(2, 6));
        assert_eq!(progress(&fleet), Some(of(900, 9)), "it may be late");
        fleet.heard_progress(at(11.1), of(2, 6));
        assert_eq!(progress(&fleet), Some(of(2, 6)));
        assert!(fleet.heard_progress(at(11.2), of(2, 7)).got_on);
        fleet.heard_progress(at(11.3), of(2, 5));
        assert_eq!(progress(&fleet), Some(of(2, 7)));
    }

    #[test]
    fn progress_alone_keeps_nobody_from_being_lost_and_finds_nobody() {
        let two = VehicleId(2);
        let (after, others) = (Duration::from_secs(30), Duration::from_secs(2));
        let at = |seconds| Time::ZERO + Duration::from_secs(seconds);
        let mut fleet = Fleet::new(&[ONE, two], LEASE);
        fleet.heard_state(at(0), state(1, 0, None));
        for second in 0..40 {
            fleet.heard_state(at(second), State { vehicle: two, ..state(second + 1, 0, None) });
            fleet.heard_progress(
                Time::ZERO,
                VehicleProgress { vehicle: ONE, boot: Boot(1), ..VehicleProgress::default() },
            );
            let lost = fleet.lose(at(second), after, others);
            assert_eq!(lost, if second == 31 { vec![ONE] } else { vec![] }, "{second}");
        }
        assert_eq!(fleet.lost(), [ONE]);
    }

    #[test]
    fn the_station_does_not_start_a_lost_one_that_was_stopped() {
        let two = VehicleId(2);
        let mut fleet = Fleet::new(&[ONE, two], LEASE);
        heard(&mut fleet, 1, 1, OrderKind::Land);
        fleet.heard_state(Time::ZERO, State { vehicle: two, ..state(1, 0, None) });
        let later = Time::ZERO + Duration::from_secs(40);
        fleet.heard_state(later, State { vehicle: two, ..state(2, 0, None) });
        assert_eq!(fleet.lose(later, Duration::from_secs(30), Duration::from_secs(2)), [ONE]);
        assert_eq!(fleet.standing(), None, "who is lost stops nobody");
        fleet.start_all(RunId(1));
        let ordered =
            |fleet: &Fleet| fleet.open_orders().iter().map(|order| order.vehicle).collect::<Vec<_>>();
        assert_eq!(ordered(&fleet), [two]);
        assert!(heard(&mut fleet, 2, 1, OrderKind::Land).found);
        assert_eq!((fleet.standing(), ordered(&fleet)), (Some(OrderKind::Land), vec![two]));
        heard(&mut fleet, 3, 2, OrderKind::Start);
        assert_eq!(fleet.standing(), None);
    }

    #[test]
    fn of_what_was_ordered_before_anything_was_heard_only_what_was_not_driven_counts() {
        for (accepted, started) in [(0, Some(RunId(1))), (1, None), (2, None)] {
            let mut fleet = Fleet::new(&[ONE], Lease::default());
            let old =
                State { accepted: (RunId(accepted), Revision(7)), ..state(1, 3, Some(OrderKind::Start)) };
            assert_eq!(fleet.heard_state(Time::ZERO, old).started, started, "{accepted}");
        }
    }
}
