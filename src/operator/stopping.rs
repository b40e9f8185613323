//! An emergency stop on its way: who shows it. The stop itself is kept and said on by every node (`stops`); what is looked
//! for here is State, or that a vehicle says itself that it knows the stop. It gives nothing up: a stop that somebody has not
//! shown in time is in force all the same for whoever hears of it.
//!
//! It ends when every vehicle that it is for shows the stop and rests, or when the time is up.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{EmergencyStop, StandReason, VehicleId};

use super::fleet_view::FleetView;
use super::order_goal::StopRequest;
use super::outcome::{OrderOutcome, VehicleOutcome};
use crate::time::Time;

/// How long to listen for everyone who is there.
const LISTEN: Duration = Duration::from_secs(2);
/// How often to check whether the time is up.
const LOOKS_EVERY: Duration = Duration::from_millis(50);

/// Emergency stops that were given by one command.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StopBatch {
    stops: Vec<EmergencyStop>,
    wish: StopRequest,
    /// Who is known to be there without being heard.
    expected: BTreeSet<VehicleId>,
    began: Time,
    /// Since when anyone can be reached.
    linked: Option<Time>,
    has_listened: bool,
    /// When each vehicle showed it first.
    shown: BTreeMap<VehicleId, Time>,
}

impl StopBatch {
    /// Begins; `has_listened` tells whether everyone who is there is known.
    pub fn new(
        now: Time,
        stops: Vec<EmergencyStop>,
        wish: StopRequest,
        expected: BTreeSet<VehicleId>,
        has_listened: bool,
    ) -> StopBatch {
        StopBatch {
            stops,
            wish,
            expected,
            began: now,
            linked: None,
            has_listened,
            shown: BTreeMap::new(),
        }
    }

    /// Looks who shows it.
    pub fn look(&mut self, now: Time, view: &FleetView, is_linked: bool) {
        if is_linked {
            self.linked.get_or_insert(now);
        }
        for id in self.targets(now, view) {
            if self.is_in_force(view, id) {
                self.shown.entry(id).or_insert(now);
            }
        }
    }

    /// Returns what became of it once it is over.
    pub fn outcome(&self, now: Time, view: &FleetView) -> Option<OrderOutcome> {
        let so_far = self.outcome_so_far(now, view);
        let knows_all = self.has_listened
            || !self.wish.vehicles.is_empty()
            || self.linked.is_some_and(|since| now.since(since) >= LISTEN);
        let rests = |of: &VehicleOutcome| {
            matches!(
                of,
                VehicleOutcome::Stopped {
                    is_at_rest: true,
                    ..
                }
            )
        };
        let all_rest = !so_far.vehicles.is_empty() && so_far.vehicles.values().all(rests);
        let is_lifted = so_far
            .vehicles
            .values()
            .any(|of| *of == VehicleOutcome::StopLifted);
        let is_over =
            all_rest && knows_all || is_lifted || now.since(self.began) >= self.wish.within;
        is_over.then_some(so_far)
    }

    /// Returns what became of it so far.
    pub fn outcome_so_far(&self, now: Time, view: &FleetView) -> OrderOutcome {
        let from = self.linked.unwrap_or(self.began);
        let of = |id: VehicleId| {
            let state = view.state(id).filter(|state| state.at >= self.began);
            let is_at_rest = state.is_some_and(|state| state.value.is_at_rest);
            let outcome = match (self.shown.get(&id), state) {
                _ if self.is_lifted(view, id) => VehicleOutcome::StopLifted,
                (Some(at), _) => VehicleOutcome::Stopped {
                    after: at.since(from),
                    is_at_rest,
                },
                (None, Some(_)) => VehicleOutcome::Ignored,
                (None, None) => VehicleOutcome::Unheard,
            };
            (id, outcome)
        };
        let vehicles = self.targets(now, view).into_iter().map(of).collect();
        OrderOutcome {
            vehicles,
            lease: None,
            run: None,
            refused: None,
            lifts: Vec::new(),
        }
    }

    /// Returns when to look next.
    pub fn next(&self, now: Time) -> Time {
        now + LOOKS_EVERY
    }

    /// Returns whether the stops of a vehicle that were given here are lifted, and it shows no other one.
    fn is_lifted(&self, view: &FleetView, id: VehicleId) -> bool {
        let mut those = self.of(id).peekable();
        let are_lifted = those.peek().is_some() && those.all(|stop| view.is_lifted(stop.name));
        are_lifted && !self.is_under_another(view, id)
    }

    /// Returns whether a vehicle shows in its State a stop that was not lifted of those given here, or another one.
    fn is_under_another(&self, view: &FleetView, id: VehicleId) -> bool {
        let state = view.state(id).filter(|state| state.at >= self.began);
        match state.and_then(|state| state.value.stands_under) {
            Some(StandReason::Stop(name)) => !view.is_lifted(name),
            _ => false,
        }
    }

    /// Returns the stops given here that concern a vehicle.
    fn of(&self, id: VehicleId) -> impl Iterator<Item = &EmergencyStop> {
        self.stops.iter().filter(move |stop| stop.concerns(id))
    }

    /// Returns whether a vehicle shows a stop that was given here, or another one that is open.
    fn is_in_force(&self, view: &FleetView, id: VehicleId) -> bool {
        let state = view.state(id).filter(|state| state.at >= self.began);
        let is_under = state
            .is_some_and(|state| matches!(state.value.stands_under, Some(StandReason::Stop(_))));
        is_under || self.of(id).any(|stop| view.shows_stop(id, stop.name))
    }

    fn targets(&self, now: Time, view: &FleetView) -> BTreeSet<VehicleId> {
        if !self.wish.vehicles.is_empty() {
            return self.wish.vehicles.clone();
        }
        let members = view
            .ground(now)
            .map(|report| report.value.members.clone())
            .unwrap_or_default();
        let heard = view
            .vehicles()
            .filter(|(_, seen)| seen.state.is_some())
            .map(|(id, _)| id);
        self.expected
            .iter()
            .copied()
            .chain(members)
            .chain(heard)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{
        EmergencyName, Message, OpenStops, OperatorId, Sender, State, StopScope,
    };

    use super::super::HeardMessage;
    use super::super::tests_support::{at, heard, state};
    use super::*;

    const NAME: EmergencyName = EmergencyName(0x1_0007);

    fn stop() -> EmergencyStop {
        EmergencyStop {
            name: NAME,
            scope: StopScope::All,
            by: OperatorId(1),
        }
    }

    fn says(view: &mut FleetView, time_s: f64, sequence: u64, under: Option<EmergencyName>) {
        let said = State {
            sequence,
            is_at_rest: true,
            stands_under: under.map(StandReason::Stop),
            ..state(1)
        };
        view.hear(at(time_s), &heard(Message::State(said)));
    }

    fn tells(view: &mut FleetView, time_s: f64, standing: OpenStops) {
        let of_ground = HeardMessage::Message(Sender::Ground, Message::Standing(standing));
        view.hear(at(time_s), &of_ground);
    }

    #[test]
    fn a_stop_that_is_lifted_before_it_is_over_is_not_called_done() {
        let one = VehicleId(1);
        let wish = StopRequest {
            vehicles: [one].into(),
            within: Duration::from_secs(5),
        };
        for other in [None, Some(EmergencyName(0x1_0009))] {
            let mut view = FleetView::default();
            let mut batch =
                StopBatch::new(at(0.0), vec![stop()], wish.clone(), BTreeSet::new(), true);
            says(&mut view, 0.1, 1, Some(NAME));
            batch.look(at(0.1), &view, true);
            let done = batch.outcome_so_far(at(0.1), &view);
            assert!(done.is_done(), "{done:?}");
            let lifted = OpenStops {
                open: Vec::new(),
                lifted: vec![NAME],
            };
            tells(&mut view, 0.2, lifted);
            says(&mut view, 0.3, 2, other);
            batch.look(at(0.3), &view, true);
            let outcome = batch.outcome(at(0.3), &view).expect("it is over at once");
            match other {
                None => assert_eq!(outcome.vehicles[&one], VehicleOutcome::StopLifted),
                // It stands all the same, under another one.
                Some(_) => assert!(outcome.is_done(), "{outcome:?}"),
            }
        }
    }
}
