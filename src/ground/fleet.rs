//! The vehicles that the ground expects: who is there, who is lost, and what is asked of or ordered to all of them. What one
//! of them has said is a [`FleetMember`], what it was ordered and by whom are its [`Dealings`]. What follows from that is the
//! station's business.

mod member;
mod order_ledger;

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    EmergencyStop, Lease, MissionProgress, Order, OrderKind, Revision, RunId, SeenState, State,
    VehicleId,
};

pub(super) use self::member::{FleetChange, FleetMember};
pub(super) use self::order_ledger::OrderLedger;
use crate::geom::Point;
use crate::stops::first_that_stops;
use crate::sweep::VehicleProgress;
use crate::time::Time;

/// When no vehicle has been heard for this long, nothing is known of any.
const SILENT_AFTER: Duration = Duration::from_secs(10);
/// After such a silence they are gone.
const SILENT_AT_MOST: Duration = Duration::from_secs(3600);

/// All vehicles that the ground expects.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Fleet {
    members: BTreeMap<VehicleId, FleetMember>,
    lease: Lease,
}

impl Fleet {
    /// Makes a fleet of vehicles that have not been heard yet.
    pub(crate) fn new(expected: &[VehicleId], lease: Lease) -> Fleet {
        Fleet {
            members: expected
                .iter()
                .map(|id| (*id, FleetMember::default()))
                .collect(),
            lease,
        }
    }

    /// Takes up what was dealt with vehicles before; those not expected any more are passed over.
    pub(crate) fn recall(&mut self, dealings: &[(VehicleId, OrderLedger)]) {
        for (vehicle, known) in dealings {
            if let Some(member) = self.members.get_mut(vehicle) {
                member.recall(known.clone());
            }
        }
    }

    /// Returns the vehicles, ascending.
    pub(crate) fn members(&self) -> impl Iterator<Item = (VehicleId, &FleetMember)> {
        self.members.iter().map(|(id, member)| (*id, member))
    }

    /// Returns where a vehicle is; `None` when it was not heard, or does not know well enough.
    pub(crate) fn place_of(&self, vehicle: VehicleId) -> Option<Point> {
        self.members.get(&vehicle)?.place()
    }

    /// Returns the fastest that a vehicle was heard to drive, m/s.
    pub(crate) fn fastest_mps(&self) -> f64 {
        let speeds = self.members.values().map(FleetMember::fastest_mps);
        speeds.fold(0.0, f64::max)
    }

    /// Returns what was dealt with each vehicle, ascending.
    pub(crate) fn dealings(&self) -> Vec<(VehicleId, OrderLedger)> {
        self.members()
            .map(|(id, member)| (id, member.dealings().clone()))
            .collect()
    }

    /// Returns whether a vehicle is one of the fleet.
    pub(crate) fn expects(&self, vehicle: VehicleId) -> bool {
        self.members.contains_key(&vehicle)
    }

    /// Returns how many vehicles there are, lost ones included.
    pub(crate) fn len(&self) -> usize {
        self.members.len()
    }

    /// Returns the vehicles that are neither lost nor out, ascending.
    pub(crate) fn present(&self) -> Vec<VehicleId> {
        self.those(|member| !member.is_away())
    }

    /// Returns the vehicles that are lost, ascending.
    pub(crate) fn lost(&self) -> Vec<VehicleId> {
        self.those(|member| member.dealings().is_lost())
    }

    /// Returns the vehicles that are heard, and do not go on by themselves, ascending.
    pub(crate) fn out_of_service(&self) -> Vec<VehicleId> {
        self.those(|member| member.is_out_of_service() && !member.dealings().is_lost())
    }

    /// Returns the vehicles that are waited for and have not been heard yet, ascending.
    pub(crate) fn unheard(&self) -> Vec<VehicleId> {
        self.those(FleetMember::is_unheard)
    }

    fn those(&self, is_meant: impl Fn(&FleetMember) -> bool) -> Vec<VehicleId> {
        self.members()
            .filter(|(_, member)| is_meant(member))
            .map(|(id, _)| id)
            .collect()
    }

    /// Takes a state; those of strangers change nothing, older ones only when they go on and nothing newer comes, and those
    /// of an earlier start only after a long silence.
    pub(crate) fn heard_state(&mut self, now: Time, state: State) -> FleetChange {
        match self.members.get_mut(&state.vehicle) {
            Some(member) => member.hear_state(now, state, self.lease),
            None => FleetChange::default(),
        }
    }

    /// Takes a progress; one of an older start of the software changes nothing, nor does one behind what was said not long
    /// ago.
    pub(crate) fn heard_progress(&mut self, now: Time, progress: VehicleProgress) -> FleetChange {
        match self.members.get_mut(&progress.vehicle) {
            Some(member) => member.hear_progress(now, progress),
            None => FleetChange::default(),
        }
    }

    /// Takes what a vehicle says of its mission, unless an earlier start of its software has said it.
    pub(crate) fn heard_mission(&mut self, mission: &MissionProgress) {
        if let Some(member) = self.members.get_mut(&mission.vehicle) {
            member.hear_mission(mission);
        }
    }

    /// Returns what a vehicle has said of its mission last.
    pub(crate) fn mission(&self, vehicle: VehicleId) -> Option<&MissionProgress> {
        self.members.get(&vehicle)?.mission()
    }

    /// Returns whether a progress was said by the newest start of a vehicle's software.
    pub(crate) fn is_current(&self, progress: &VehicleProgress) -> bool {
        self.members
            .get(&progress.vehicle)
            .is_none_or(|member| member.is_current(progress.boot))
    }

    /// Returns the newest state heard from a vehicle, as plans and orders name it; `None` = it was not heard.
    pub(crate) fn newest_state(&self, vehicle: VehicleId) -> Option<SeenState> {
        self.members.get(&vehicle)?.seen_state()
    }

    /// Returns whether it is known where every vehicle is that is neither lost nor out.
    pub(crate) fn are_placed(&self) -> bool {
        self.members
            .values()
            .all(|member| member.is_away() || member.place().is_some())
    }

    /// Returns the highest revision of a run that any vehicle shows, so that a new ground begins above it.
    pub(crate) fn highest_revision(&self, run: RunId) -> Revision {
        let shown = self
            .accepted()
            .filter(|accepted| accepted.0 == run)
            .map(|accepted| accepted.1);
        shown.max().unwrap_or_default()
    }

    /// Returns the highest run whose plans any vehicle follows.
    pub(crate) fn highest_run(&self) -> RunId {
        self.accepted()
            .map(|accepted| accepted.0)
            .max()
            .unwrap_or_default()
    }

    fn accepted(&self) -> impl Iterator<Item = (RunId, Revision)> {
        self.members
            .values()
            .filter_map(FleetMember::state)
            .map(|state| state.accepted)
    }

    /// Returns the order in force for any vehicle that is not lost: given by anyone and not ended by a Start; the strongest.
    pub(crate) fn order_in_force(&self) -> Option<OrderKind> {
        let present = self
            .members
            .values()
            .filter(|member| !member.dealings().is_lost());
        present
            .filter_map(|member| member.dealings().stands())
            .reduce(OrderKind::stronger)
    }

    /// Orders by this right from now on; what is still to be repeated too, as the first of this right: others count from
    /// there as well, and a higher revision would beat what they order.
    pub(crate) fn set_lease(&mut self, lease: Lease) {
        self.lease = lease;
        for member in self.members.values_mut() {
            member.dealings_mut().pass_to(lease);
        }
    }

    /// Orders what the operator wishes of every vehicle, above whatever it has obeyed before.
    pub(crate) fn order_all(&mut self, run: RunId, kind: OrderKind) {
        for (vehicle, member) in &mut self.members {
            member.dealings_mut().order(*vehicle, self.lease, run, kind);
        }
    }

    /// Records which emergency stops are open: for whom they hold stands until somebody starts it, and an own start that is
    /// still to be repeated is given up.
    pub(crate) fn stop(&mut self, open: &[EmergencyStop]) {
        for (vehicle, member) in &mut self.members {
            if first_that_stops(open, *vehicle).is_some() {
                member.dealings_mut().be_stopped(*vehicle, self.lease);
            }
        }
    }

    /// Starts every vehicle for which nothing stands: one that an operator stopped, only an operator starts; and one that
    /// is out comes home.
    pub(crate) fn start_all(&mut self, run: RunId) {
        let in_service = self
            .members
            .iter_mut()
            .filter(|(_, member)| !member.is_out_of_service());
        for (vehicle, member) in in_service {
            member.dealings_mut().start(*vehicle, self.lease, run);
        }
    }

    /// Returns the orders that are not yet seen in a state, answering the newest state heard.
    pub(crate) fn open_orders(&self) -> Vec<Order> {
        self.members
            .values()
            .filter_map(FleetMember::open_order)
            .collect()
    }

    /// Takes the open orders for said.
    pub(crate) fn note_said(&mut self) {
        self.members.values_mut().for_each(FleetMember::note_said);
    }

    /// Returns whether no vehicle is heard just now; after a very long silence they are taken to be gone.
    pub(crate) fn is_silent(&self, now: Time) -> bool {
        let heard = self.members.values().filter_map(FleetMember::heard_at);
        let silence = heard.max().map(|heard_at| now.since(heard_at));
        silence.is_some_and(|silence| silence > SILENT_AFTER && silence < SILENT_AT_MOST)
    }

    /// Returns who has not said its state for `after`, although another vehicle was heard within `others`; they are lost from
    /// now on.
    pub(crate) fn lose(&mut self, now: Time, after: Duration, others: Duration) -> Vec<VehicleId> {
        let within =
            |member: &FleetMember, span| member.heard_at().is_some_and(|at| now.since(at) <= span);
        if !self.members.values().any(|member| within(member, others)) {
            return Vec::new();
        }
        let is_gone = |member: &FleetMember| {
            !member.dealings().is_lost() && member.heard_at().is_some() && !within(member, after)
        };
        let lost: Vec<VehicleId> = self
            .members()
            .filter(|(_, member)| is_gone(member))
            .map(|(id, _)| id)
            .collect();
        let gone = self.members.values_mut().filter(|member| is_gone(member));
        gone.for_each(|member| member.dealings_mut().lose());
        lost
    }

    /// Counts vehicles never heard as lost, silent since `since`; returns them.
    pub(crate) fn lose_unheard(&mut self, since: Time) -> Vec<VehicleId> {
        let unheard = self.unheard();
        for vehicle in &unheard {
            if let Some(member) = self.members.get_mut(vehicle) {
                member.dealings_mut().lose();
                member.count_silence_from(since);
            }
        }
        unheard
    }

    /// Counts silence from now on, for those who were heard before this station was started.
    pub(crate) fn count_silence_from(&mut self, now: Time) {
        for member in self
            .members
            .values_mut()
            .filter(|member| member.dealings().boot().is_some())
        {
            member.count_silence_from(now);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Boot, EmergencyName, OperatorId, Ordered, StandReason, StopScope};

    const ONE: VehicleId = VehicleId(1);
    const LEASE: Lease = Lease {
        number: 1,
        holder: 9,
    };

    fn state(sequence: u64, revision: u32, kind: Option<OrderKind>) -> State {
        let ordered = Ordered {
            lease: LEASE,
            revision: Revision(revision),
            run: RunId(1),
            kind,
        };
        State {
            vehicle: ONE,
            boot: Boot(1),
            sequence,
            ordered,
            ..State::default()
        }
    }

    fn heard(fleet: &mut Fleet, sequence: u64, revision: u32, kind: OrderKind) -> FleetChange {
        fleet.heard_state(Time::ZERO, state(sequence, revision, Some(kind)))
    }

    #[test]
    fn strangers_change_nothing() {
        let mut fleet = Fleet::new(&[ONE], LEASE);
        let stranger = VehicleId(8);
        assert_eq!(
            fleet.heard_state(
                Time::ZERO,
                State {
                    vehicle: stranger,
                    ..state(1, 0, None)
                }
            ),
            FleetChange::default()
        );
        let progress = VehicleProgress {
            vehicle: stranger,
            ..VehicleProgress::default()
        };
        assert_eq!(
            fleet.heard_progress(Time::ZERO, progress),
            FleetChange::default()
        );
        assert_eq!(
            (fleet.unheard(), fleet.newest_state(stranger), fleet.len()),
            (vec![ONE], None, 1)
        );
    }

    #[test]
    fn what_was_dealt_with_those_that_are_expected_is_taken_up_and_ordered_on_by_the_next_lease() {
        let mut before = Fleet::new(&[ONE, VehicleId(2)], LEASE);
        heard(&mut before, 1, 4, OrderKind::Start);
        before.order_all(RunId(1), OrderKind::Hold);
        let mut fleet = Fleet::new(&[ONE], LEASE);
        fleet.recall(&before.dealings());
        assert_eq!(
            (fleet.order_in_force(), fleet.len()),
            (Some(OrderKind::Hold), 1)
        );
        let next = Lease { number: 2, ..LEASE };
        fleet.set_lease(next);
        heard(&mut fleet, 2, 4, OrderKind::Start);
        let orders = fleet.open_orders();
        assert_eq!(
            (orders.len(), orders[0].lease, orders[0].revision),
            (1, next, Revision(1))
        );
        assert_eq!(orders[0].seen, fleet.newest_state(ONE));
    }

    #[test]
    fn who_is_silent_while_others_speak_is_lost_until_heard_again() {
        let two = VehicleId(2);
        let (after, others) = (Duration::from_secs(30), Duration::from_secs(2));
        let at = |seconds| Time::ZERO + Duration::from_secs(seconds);
        let mut fleet = Fleet::new(&[ONE, two], LEASE);
        fleet.heard_state(at(0), state(1, 0, None));
        fleet.heard_state(
            at(0),
            State {
                vehicle: two,
                ..state(1, 0, None)
            },
        );
        assert!(
            fleet.lose(at(40), after, others).is_empty(),
            "nobody is heard: the ground itself is cut off"
        );
        fleet.heard_state(
            at(41),
            State {
                vehicle: two,
                ..state(2, 0, None)
            },
        );
        assert_eq!(fleet.lose(at(42), after, others), [ONE]);
        assert_eq!(fleet.lose(at(42), after, others), []);
        assert_eq!((fleet.present(), fleet.lost()), (vec![two], vec![ONE]));
        assert!(
            !fleet.heard_state(at(43), state(1, 0, None)).found,
            "an old state is no sign of life"
        );
        assert!(fleet.heard_state(at(43), state(2, 0, None)).found);
        assert_eq!(fleet.present(), [ONE, two]);
    }

    #[test]
    fn a_state_that_its_vehicle_did_not_say_is_forgotten_when_its_own_go_on() {
        let at = |time_s: f64| Time::from_secs_f64(time_s);
        let mut fleet = Fleet::new(&[ONE], LEASE);
        fleet.heard_state(at(0.0), state(100, 0, None));
        fleet.heard_state(at(0.1), state(u64::MAX, 0, None));
        let newest = |fleet: &Fleet| fleet.newest_state(ONE).unwrap().sequence;
        for turn in 1..=50_u32 {
            fleet.heard_state(
                at(0.2 * f64::from(turn)),
                state(100 + u64::from(turn), 0, None),
            );
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
        let progress = |fleet: &Fleet| fleet.members().next().unwrap().1.progress();
        fleet.heard_progress(at(0.0), of(2, 5));
        fleet.heard_progress(at(1.0), of(900, 9));
        fleet.heard_progress(at(10.9), of(2, 6));
        assert_eq!(progress(&fleet), Some(of(900, 9)), "it may be late");
        fleet.heard_progress(at(11.1), of(2, 6));
        assert_eq!(progress(&fleet), Some(of(2, 6)));
        assert!(fleet.heard_progress(at(11.2), of(2, 7)).made_progress);
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
            fleet.heard_state(
                at(second),
                State {
                    vehicle: two,
                    ..state(second + 1, 0, None)
                },
            );
            fleet.heard_progress(
                Time::ZERO,
                VehicleProgress {
                    vehicle: ONE,
                    boot: Boot(1),
                    ..VehicleProgress::default()
                },
            );
            let lost = fleet.lose(at(second), after, others);
            assert_eq!(
                lost,
                if second == 31 { vec![ONE] } else { vec![] },
                "{second}"
            );
        }
        assert_eq!(fleet.lost(), [ONE]);
    }

    #[test]
    fn the_station_does_not_start_a_lost_one_that_was_stopped() {
        let two = VehicleId(2);
        let mut fleet = Fleet::new(&[ONE, two], LEASE);
        heard(&mut fleet, 1, 1, OrderKind::Land);
        fleet.heard_state(
            Time::ZERO,
            State {
                vehicle: two,
                ..state(1, 0, None)
            },
        );
        let later = Time::ZERO + Duration::from_secs(40);
        fleet.heard_state(
            later,
            State {
                vehicle: two,
                ..state(2, 0, None)
            },
        );
        assert_eq!(
            fleet.lose(later, Duration::from_secs(30), Duration::from_secs(2)),
            [ONE]
        );
        assert_eq!(fleet.order_in_force(), None, "who is lost stops nobody");
        fleet.start_all(RunId(1));
        let ordered = |fleet: &Fleet| {
            fleet
                .open_orders()
                .iter()
                .map(|order| order.vehicle)
                .collect::<Vec<_>>()
        };
        assert_eq!(ordered(&fleet), [two]);
        assert!(heard(&mut fleet, 2, 1, OrderKind::Land).found);
        assert_eq!(
            (fleet.order_in_force(), ordered(&fleet)),
            (Some(OrderKind::Land), vec![two])
        );
        heard(&mut fleet, 3, 2, OrderKind::Start);
        assert_eq!(fleet.order_in_force(), None);
    }

    #[test]
    fn what_an_open_stop_holds_stands_also_when_a_start_of_before_it_is_shown_later() {
        let open = [EmergencyStop {
            name: EmergencyName(7),
            scope: StopScope::All,
            by: OperatorId(1),
        }];
        let mut fleet = Fleet::new(&[ONE], LEASE);
        heard(&mut fleet, 1, 1, OrderKind::Hold);
        fleet.stop(&open);
        heard(&mut fleet, 2, 2, OrderKind::Start);
        let stopped = StandReason::Stop(EmergencyName(7));
        let started = state(3, 2, Some(OrderKind::Start));
        fleet.heard_state(
            Time::ZERO,
            State {
                stands_under: Some(stopped),
                ..started.clone()
            },
        );
        assert_eq!(fleet.order_in_force(), Some(OrderKind::Hold));
        fleet.stop(&[]);
        let held = State {
            sequence: 4,
            stands_under: Some(StandReason::Held),
            ..started.clone()
        };
        fleet.heard_state(Time::ZERO, held);
        assert_eq!(
            fleet.order_in_force(),
            Some(OrderKind::Hold),
            "it was lifted, and moves nobody"
        );
        heard(&mut fleet, 5, 3, OrderKind::Start);
        assert_eq!(fleet.order_in_force(), None);
        // One that knew nothing of the stop, such as a ground station that was started anew, sees it all the same.
        let mut other = Fleet::new(&[ONE], LEASE);
        other.heard_state(
            Time::ZERO,
            State {
                stands_under: Some(stopped),
                ..started
            },
        );
        assert_eq!(other.order_in_force(), Some(OrderKind::Hold));
    }
}
