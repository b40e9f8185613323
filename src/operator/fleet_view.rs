//! The fleet as one who only listens sees it: the newest of everything that each node has said of itself, and when it
//! came. Pure and bounded: a vehicle's number is one byte, and of ground stations only the newest few are kept. It judges
//! nothing.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::codec::{Greeting, VERSION};
use tomoswarm_proto::{
    Boot, EmergencyName, EmergencyStop, GroundReport, Health, Hello, Lease, Message,
    MissionProgress, OpenStops, OperatorId, Sender, StandReason, State, StopScope, VehicleId,
};

use super::HeardMessage;
use super::names::listed;
use crate::stops::StopSet;
use crate::sweep::LOWER_BOOT_AFTER;
use crate::time::Time;

/// A ground station whose report is older than this is not live.
pub const GROUND_LIVES: Duration = Duration::from_secs(5);
/// A vehicle whose newest state is older is not known to be there.
pub const SILENT_AFTER: Duration = Duration::from_secs(2);
/// An operator that has not greeted for this long is gone; it greets every 2 s at least.
const OPERATOR_LIVES: Duration = Duration::from_secs(5);
/// Operators of one number kept at most.
const INSTANCES: usize = 4;
/// Ground stations kept at most.
const GROUNDS: usize = 8;

/// Something that was said, and when it came.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Timestamped<T> {
    /// When it came.
    pub at: Time,
    /// What was said.
    pub value: T,
}

impl<T> Timestamped<T> {
    /// Returns how long ago it came.
    pub fn age(&self, now: Time) -> Duration {
        now.since(self.at)
    }
}

/// What one vehicle has said of itself.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct VehicleView {
    /// Newest state, by boot and sequence.
    pub state: Option<Timestamped<State>>,
    /// Newest of how far it is with its mission, of the newest boot.
    pub mission: Option<Timestamped<MissionProgress>>,
    /// Newest health of the newest boot.
    pub health: Option<Timestamped<Health>>,
    /// Newest greeting.
    pub hello: Option<Timestamped<Hello>>,
}

/// Why two nodes do not listen to each other; its text goes on after who it is of.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error, Serialize, Deserialize)]
pub enum Incompatibility {
    /// It speaks this version of the wire.
    #[error("speaks wire version {0}, here it is {VERSION}")]
    Version(u8),
    /// Its venue file has this hash.
    #[error("has another venue file (hash {0:016x})")]
    Venue(u64),
}

/// The newest of everything.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct FleetView {
    vehicles: BTreeMap<VehicleId, VehicleView>,
    /// By store: two grounds never write the same one.
    grounds: BTreeMap<u64, Timestamped<GroundReport>>,
    ground_hello: Option<Timestamped<Hello>>,
    foreign: BTreeMap<Sender, Greeting>,
    /// Operators by number and instance: when each greeted first, and last.
    operators: BTreeMap<OperatorId, BTreeMap<u64, (Time, Time)>>,
    /// Which emergency stops every node says that it knows.
    standing: BTreeMap<Sender, Timestamped<OpenStops>>,
    /// All of them, joined.
    stops: StopSet,
    /// When open stops were given that a vehicle that says them now did not know when it was heard before.
    given: BTreeMap<EmergencyName, Time>,
}

impl FleetView {
    /// Takes what came over the bus.
    pub fn hear(&mut self, now: Time, heard: &HeardMessage) {
        match heard {
            HeardMessage::Greeting(greeting, hello) => self.greeting(now, greeting, hello.as_ref()),
            HeardMessage::Message(sender, message) => self.message(now, *sender, message),
            HeardMessage::Unknown(_) => {}
        }
    }

    /// Returns whether something shows more than that a vehicle is where it is: a State that shows the same start of its
    /// software and the same order as the one before does not.
    pub fn is_news(&self, heard: &HeardMessage) -> bool {
        let HeardMessage::Message(_, Message::State(state)) = heard else {
            return true;
        };
        let key = |state: &State| {
            (
                state.boot,
                state.ordered,
                state.accepted,
                state.stands_under,
                state.is_at_rest,
            )
        };
        self.state(state.vehicle)
            .is_none_or(|known| key(&known.value) != key(state))
    }

    /// Returns what a vehicle has said; `None` when it was not heard.
    pub fn vehicle(&self, id: VehicleId) -> Option<&VehicleView> {
        self.vehicles.get(&id)
    }

    /// Returns a vehicle's newest state.
    pub fn state(&self, id: VehicleId) -> Option<&Timestamped<State>> {
        self.vehicles.get(&id)?.state.as_ref()
    }

    /// Returns all vehicles that said anything, ascending.
    pub fn vehicles(&self) -> impl Iterator<Item = (VehicleId, &VehicleView)> {
        self.vehicles.iter().map(|(id, seen)| (*id, seen))
    }

    /// Returns the vehicles of a venue file that are known to be there, ascending.
    pub fn live_vehicles(
        &self,
        now: Time,
        venue_hash: u64,
    ) -> impl Iterator<Item = (&Timestamped<State>, &VehicleView)> {
        self.vehicles.iter().filter_map(move |(id, seen)| {
            let state = seen.state.as_ref()?;
            let is_ours = self.misfit(Sender::Vehicle(*id), venue_hash).is_none();
            (is_ours && state.age(now) <= SILENT_AFTER).then_some((state, seen))
        })
    }

    /// Returns the reports of all ground stations heard, by store.
    pub fn grounds(&self) -> impl Iterator<Item = &Timestamped<GroundReport>> {
        self.grounds.values()
    }

    /// Returns the report of the live ground station with the greatest lease.
    pub fn ground(&self, now: Time) -> Option<&Timestamped<GroundReport>> {
        let live = self
            .grounds
            .values()
            .filter(|report| report.age(now) <= GROUND_LIVES);
        live.max_by_key(|report| report.value.lease)
    }

    /// Returns the greeting of the ground station heard last.
    pub fn ground_hello(&self) -> Option<&Timestamped<Hello>> {
        self.ground_hello.as_ref()
    }

    /// Returns the nodes whose greeting is of another wire version.
    pub fn foreign(&self) -> impl Iterator<Item = &Greeting> {
        self.foreign.values()
    }

    /// Returns the numbers under which two operators greet at the same time. One that has come after another has left is
    /// none of them.
    pub fn shared_operators(&self, now: Time) -> impl Iterator<Item = OperatorId> {
        let overlap = |one: &(Time, Time), other: &(Time, Time)| one.1 > other.0 && other.1 > one.0;
        let is_shared = move |instances: &BTreeMap<u64, (Time, Time)>| {
            let live: Vec<&(Time, Time)> = instances
                .values()
                .filter(|(_, last)| now.since(*last) <= OPERATOR_LIVES)
                .collect();
            live.iter()
                .enumerate()
                .any(|(index, one)| live[index + 1..].iter().any(|other| overlap(one, other)))
        };
        self.operators
            .iter()
            .filter(move |(_, instances)| is_shared(instances))
            .map(|(id, _)| *id)
    }

    /// Returns why a node does not listen to whoever has this venue file; `None` = it does, or has not greeted.
    pub fn misfit(&self, node: Sender, venue_hash: u64) -> Option<Incompatibility> {
        if let Some(greeting) = self.foreign.get(&node) {
            return Some(Incompatibility::Version(greeting.version));
        }
        let hello = match node {
            Sender::Ground => self.ground_hello.as_ref(),
            Sender::Vehicle(id) => self.vehicles.get(&id)?.hello.as_ref(),
            Sender::Operator(_) => None,
        };
        let theirs = hello?.value.venue_hash;
        (theirs != venue_hash).then_some(Incompatibility::Venue(theirs))
    }

    /// Returns the greatest lease that a vehicle has obeyed or a live ground station holds; number 0 = nobody's.
    pub fn lease(&self, now: Time) -> Lease {
        let of_orders = |seen: &VehicleView| Some(seen.state.as_ref()?.value.ordered.lease);
        let of_plans =
            |seen: &VehicleView| Some(Lease::lowest(seen.mission.as_ref()?.value.lease_number));
        let obeyed = self
            .vehicles
            .values()
            .flat_map(|seen| of_orders(seen).max(of_plans(seen)));
        let held = self.ground(now).map(|report| report.value.lease);
        obeyed.chain(held).max().unwrap_or_default()
    }

    /// Returns the emergency stops that any node says to be open and none to be lifted, ascending by name.
    pub fn open_stops(&self) -> Vec<EmergencyStop> {
        self.stops.open().copied().collect()
    }

    /// Returns the open stops that were given after a moment, as vehicles show it that were heard before and did not know them.
    /// A stop that all who say it have said since they were first heard may be older.
    pub fn stops_given_after(&self, moment: Time) -> impl Iterator<Item = &EmergencyStop> {
        let given_after = move |stop: &&EmergencyStop| {
            let given = self.given.get(&stop.name);
            given.is_some_and(|given| *given > moment)
        };
        self.stops.open().filter(given_after)
    }

    /// Returns whether somebody has said that a stop was lifted.
    pub fn is_lifted(&self, name: EmergencyName) -> bool {
        self.stops.is_lifted(name)
    }

    /// Returns an open stop in words: whom it stops, who made it, and who of these vehicles does not show it.
    pub fn stop_in_words(&self, stop: &EmergencyStop, vehicles: &BTreeSet<VehicleId>) -> String {
        let concerns = |id: &&VehicleId| stop.concerns(**id);
        let shows = |id: &VehicleId| self.shows_stop(*id, stop.name) || self.is_under_a_stop(*id);
        let whom = match stop.scope {
            StopScope::All => "all vehicles".to_owned(),
            StopScope::One(vehicle) => format!("vehicle {vehicle}"),
        };
        let not_shown: Vec<VehicleId> = vehicles
            .iter()
            .filter(concerns)
            .filter(|id| !shows(id))
            .copied()
            .collect();
        let is_any = vehicles.iter().any(|id| concerns(&id));
        let shown = match (is_any, not_shown.is_empty()) {
            (false, _) => "not known to be shown by anyone".to_owned(),
            (true, true) => "shown by all of them".to_owned(),
            (true, false) => format!("not shown by vehicle {}", listed(&not_shown)),
        };
        format!("{} for {whom}, by operator {}, {shown}", stop.name, stop.by)
    }

    fn is_under_a_stop(&self, id: VehicleId) -> bool {
        self.state(id).is_some_and(|state| !is_free(&state.value))
    }

    /// Returns when a node said last which stops it knows; `None` = it never has.
    pub fn standing_at(&self, node: Sender) -> Option<Time> {
        self.standing.get(&node).map(|standing| standing.at)
    }

    /// Returns whether a vehicle shows that it stands under a stop, in its state or by saying that it knows it.
    pub fn shows_stop(&self, id: VehicleId, name: EmergencyName) -> bool {
        let is_shown = |standing: &Timestamped<OpenStops>| {
            standing.value.open.iter().any(|stop| stop.name == name)
        };
        let is_in_state = self
            .state(id)
            .is_some_and(|state| state.value.stands_under == Some(StandReason::Stop(name)));
        is_in_state
            || self
                .standing
                .get(&Sender::Vehicle(id))
                .is_some_and(is_shown)
    }

    /// Forgets the states that came before a moment, as if those vehicles had not been heard.
    pub fn forget_states_before(&mut self, moment: Time) {
        for seen in self.vehicles.values_mut() {
            seen.state = seen.state.take().filter(|state| state.at >= moment);
        }
    }

    fn greeting(&mut self, now: Time, greeting: &Greeting, hello: Option<&Hello>) {
        if greeting.version != VERSION {
            self.foreign.insert(greeting.node, *greeting);
            return;
        }
        self.foreign.remove(&greeting.node);
        let Some(hello) = hello else { return };
        let fresh = Some(Timestamped {
            at: now,
            value: hello.clone(),
        });
        match greeting.node {
            Sender::Ground => self.ground_hello = fresh,
            Sender::Vehicle(id) => self.vehicles.entry(id).or_default().hello = fresh,
            Sender::Operator(id) => self.operator(now, id, hello.instance),
        }
    }

    fn operator(&mut self, now: Time, id: OperatorId, instance: u64) {
        let known = self.operators.entry(id).or_default();
        known.entry(instance).or_insert((now, now)).1 = now;
        if known.len() > INSTANCES {
            let oldest = known
                .iter()
                .min_by_key(|(_, (_, last))| *last)
                .map(|(instance, _)| *instance);
            oldest.and_then(|instance| known.remove(&instance));
        }
    }

    fn message(&mut self, now: Time, sender: Sender, message: &Message) {
        match message {
            Message::Standing(standing) => {
                self.note_given(now, sender, standing);
                self.stops.join(standing);
                self.standing.insert(
                    sender,
                    Timestamped {
                        at: now,
                        value: standing.clone(),
                    },
                );
            }
            Message::State(state) => {
                let seen = self.vehicles.entry(state.vehicle).or_default();
                let was_free = seen
                    .state
                    .as_ref()
                    .is_some_and(|known| is_free(&known.value));
                if let (true, Some(StandReason::Stop(name))) = (was_free, state.stands_under) {
                    self.given.entry(name).or_insert(now);
                }
                renew(&mut seen.state, now, state, |state| {
                    (state.boot, state.sequence)
                });
            }
            Message::Mission(mission) => {
                let seen = self.vehicles.entry(mission.vehicle).or_default();
                renew(&mut seen.mission, now, mission, |mission| (mission.boot, 0));
            }
            Message::Health(health) => {
                let seen = self.vehicles.entry(health.vehicle).or_default();
                renew(&mut seen.health, now, health, |health| (health.boot, 0));
            }
            Message::Report(report) => self.report(now, report),
            Message::Hello(_)
            | Message::Tile(_)
            | Message::Digest(_)
            | Message::Want(_)
            | Message::Plan(_)
            | Message::Order(_)
            | Message::Samples(_)
            | Message::Have(_)
            | Message::Beacon(_)
            | Message::Task(_)
            | Message::Image(_)
            | Message::Fix(_)
            | Message::Mark(_)
            | Message::Look(_)
            | Message::Log(_)
            | Message::Settings(_) => {}
        }
    }

    /// Notes which stops a vehicle says that it did not know when it was heard before. Others learn of old stops when they
    /// join: of them that says nothing.
    fn note_given(&mut self, now: Time, sender: Sender, standing: &OpenStops) {
        let Sender::Vehicle(id) = sender else {
            return;
        };
        let before = self.standing.get(&sender).map(|before| &before.value.open);
        let was_free = self.state(id).is_some_and(|state| is_free(&state.value));
        let is_given = |stop: &&EmergencyStop| {
            let said = before.is_some_and(|open| open.iter().any(|known| known.name == stop.name));
            !said && (before.is_some() || was_free && stop.concerns(id))
        };
        let given = standing.open.iter().filter(is_given).map(|stop| stop.name);
        for name in given.collect::<Vec<EmergencyName>>() {
            self.given.entry(name).or_insert(now);
        }
        let open: BTreeSet<EmergencyName> = self
            .stops
            .open()
            .chain(standing.open.iter())
            .map(|stop| stop.name)
            .collect();
        self.given.retain(|name, _| open.contains(name));
    }

    fn report(&mut self, now: Time, report: &GroundReport) {
        self.grounds.insert(
            report.store,
            Timestamped {
                at: now,
                value: report.clone(),
            },
        );
        if self.grounds.len() > GROUNDS {
            let oldest = self
                .grounds
                .iter()
                .min_by_key(|(_, report)| report.at)
                .map(|(store, _)| *store);
            oldest.and_then(|store| self.grounds.remove(&store));
        }
    }
}

/// Returns whether a vehicle stands under no emergency stop; of several reasons its State names a stop first.
fn is_free(state: &State) -> bool {
    !matches!(state.stands_under, Some(StandReason::Stop(_)))
}

/// Puts what was said in the place of what is older.
fn renew<T: Clone>(
    known: &mut Option<Timestamped<T>>,
    now: Time,
    said: &T,
    edition: fn(&T) -> (Boot, u64),
) {
    let is_older = |known: &Timestamped<T>| {
        edition(said) < edition(&known.value) && known.age(now) <= LOWER_BOOT_AFTER
    };
    if !known.as_ref().is_some_and(is_older) {
        *known = Some(Timestamped {
            at: now,
            value: said.clone(),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests_support::{at, heard, report, state};
    use super::*;

    fn hear(view: &mut FleetView, at_s: f64, message: Message) {
        view.hear(at(at_s), &heard(message));
    }

    #[test]
    fn of_states_the_newest_by_boot_and_sequence_is_kept_whatever_comes_last() {
        let mut view = FleetView::default();
        for (at_s, boot, sequence) in [(0.0, 1, 5), (0.1, 2, 1), (0.2, 1, 6), (0.3, 2, 0)] {
            hear(
                &mut view,
                at_s,
                Message::State(State {
                    sequence,
                    boot: Boot(boot),
                    ..state(3)
                }),
            );
        }
        let newest = view.state(VehicleId(3)).unwrap();
        assert_eq!(
            (newest.value.boot, newest.value.sequence, newest.at),
            (Boot(2), 1, at(0.1))
        );
    }

    #[test]
    fn a_vehicle_with_a_new_disk_is_heard_again_after_some_silence() {
        let mut view = FleetView::default();
        hear(
            &mut view,
            0.0,
            Message::State(State {
                boot: Boot(9),
                ..state(3)
            }),
        );
        hear(
            &mut view,
            1.0,
            Message::State(State {
                boot: Boot(1),
                ..state(3)
            }),
        );
        assert_eq!(view.state(VehicleId(3)).unwrap().value.boot, Boot(9));
        hear(
            &mut view,
            30.1,
            Message::State(State {
                boot: Boot(1),
                ..state(3)
            }),
        );
        assert_eq!(view.state(VehicleId(3)).unwrap().value.boot, Boot(1));
    }

    #[test]
    fn of_two_grounds_the_live_one_with_the_greatest_lease_counts() {
        let mut view = FleetView::default();
        let of = |store, number| {
            Message::Report(GroundReport {
                store,
                lease: Lease {
                    number,
                    holder: store,
                },
                ..report()
            })
        };
        hear(&mut view, 0.0, of(1, 9));
        hear(&mut view, 4.0, of(2, 3));
        assert_eq!(view.ground(at(4.5)).unwrap().value.store, 1);
        assert_eq!(
            view.ground(at(5.5)).unwrap().value.store,
            2,
            "the other has been silent"
        );
        assert_eq!(view.ground(at(9.5)), None);
    }

    #[test]
    fn a_state_is_news_when_it_shows_another_start_or_order() {
        let mut view = FleetView::default();
        let mut said = state(3);
        let mut is_news = |said: &State| {
            let heard = heard(Message::State(said.clone()));
            let is_news = view.is_news(&heard);
            view.hear(at(0.0), &heard);
            is_news
        };
        assert!(is_news(&said), "it was not heard before");
        said.sequence += 1;
        assert!(!is_news(&said));
        said.ordered.revision.0 += 1;
        assert!(is_news(&said));
        said.boot.0 += 1;
        assert!(is_news(&said));
        assert!(view.is_news(&heard(Message::Report(report()))));
    }

    #[test]
    fn the_lease_in_force_is_the_greatest_of_orders_plans_and_a_live_ground() {
        let mut view = FleetView::default();
        let lease = |number| Lease { number, holder: 4 };
        assert_eq!(view.lease(at(0.0)).number, 0);
        let mut ordered = state(3);
        ordered.ordered.lease = lease(1);
        hear(&mut view, 0.0, Message::State(ordered));
        assert_eq!(view.lease(at(0.0)), lease(1));
        let planned = MissionProgress {
            vehicle: VehicleId(3),
            lease_number: 2,
            ..MissionProgress::default()
        };
        hear(&mut view, 0.0, Message::Mission(planned));
        assert_eq!(
            view.lease(at(60.0)).number,
            2,
            "the ground that gave the plan may be gone"
        );
        hear(
            &mut view,
            60.0,
            Message::Report(GroundReport {
                lease: lease(5),
                ..report()
            }),
        );
        assert_eq!(
            (view.lease(at(60.0)), view.lease(at(70.0))),
            (lease(5), Lease::lowest(2))
        );
    }

    fn operator_hello(node: Sender, instance: u64) -> Hello {
        Hello {
            is_member: true,
            member_for_s: 1,
            ..Hello::asking(node, Boot(1), 5, instance)
        }
    }

    #[test]
    fn two_operators_of_one_number_are_seen_and_one_after_the_other_are_not() {
        let mut view = FleetView::default();
        let mut greet = |at_s: f64, operator: u8, instance: u64| {
            let node = Sender::Operator(OperatorId(operator));
            let greeting = Greeting {
                version: VERSION,
                node,
                boot: Boot(1),
                venue_hash: 5,
            };
            let hello = operator_hello(node, instance);
            view.hear(at(at_s), &HeardMessage::Greeting(greeting, Some(hello)));
            view.shared_operators(at(at_s)).collect::<Vec<OperatorId>>()
        };
        assert_eq!(greet(0.0, 1, 7), []);
        assert_eq!(greet(0.5, 2, 8), [], "another number");
        assert_eq!(greet(1.0, 1, 7), []);
        assert_eq!(greet(1.5, 1, 9), [], "the first one may have left");
        assert_eq!(greet(2.0, 1, 7), [OperatorId(1)]);
        for instance in 20..40 {
            greet(3.0, 1, instance);
        }
        assert_eq!(greet(20.0, 1, 9), [], "the other one has left");
        assert!(
            view.operators
                .values()
                .all(|known| known.len() <= INSTANCES)
        );
    }

    #[test]
    fn what_is_kept_is_bounded() {
        let mut view = FleetView::default();
        for store in 0..1000 {
            let at_s = store as f64;
            hear(
                &mut view,
                at_s,
                Message::Report(GroundReport { store, ..report() }),
            );
            hear(&mut view, at_s, Message::State(state((store % 256) as u8)));
        }
        assert_eq!(
            view.grounds().map(|report| report.value.store).max(),
            Some(999)
        );
        assert_eq!(
            (view.grounds().count(), view.vehicles().count()),
            (GROUNDS, 256)
        );
    }

    #[test]
    fn a_greeting_of_another_version_is_known_as_such_until_it_is_of_ours() {
        let mut view = FleetView::default();
        let node = Sender::Vehicle(VehicleId(3));
        let greeting = |version| Greeting {
            version,
            node,
            boot: Boot(1),
            venue_hash: 5,
        };
        view.hear(at(0.0), &HeardMessage::Greeting(greeting(9), None));
        assert_eq!(view.foreign().count(), 1);
        view.hear(at(0.1), &HeardMessage::Greeting(greeting(VERSION), None));
        assert_eq!(view.foreign().count(), 0);
    }
}
