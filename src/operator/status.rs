//! Whether the picture of the fleet is whole: who is expected, and who of them was not heard. The rows of the picture are
//! those of [`FleetView`]; how they are shown is the business of whoever shows them.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::VehicleId;

use super::fleet_view::FleetView;
use crate::time::Time;

/// Who must be heard for the picture to be whole.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Expected {
    /// These vehicles; those that a ground station's report names come on top.
    pub vehicles: BTreeSet<VehicleId>,
    /// Whether a ground station is expected too.
    pub ground: bool,
}

impl Expected {
    /// Returns all vehicles that are expected or heard.
    pub fn vehicles(&self, view: &FleetView, now: Time) -> BTreeSet<VehicleId> {
        let named = view.ground(now).into_iter().flat_map(|report| {
            report
                .value
                .members
                .iter()
                .chain(&report.value.lost)
                .copied()
                .collect::<Vec<VehicleId>>()
        });
        let heard = view.vehicles().map(|(id, _)| id);
        self.vehicles
            .iter()
            .copied()
            .chain(named)
            .chain(heard)
            .collect()
    }

    /// Returns whether the state of every vehicle, and the ground station if it is expected, was heard; of nobody at all
    /// never.
    pub fn all_heard(&self, view: &FleetView, now: Time) -> bool {
        let vehicles = self.vehicles(view, now);
        let is_ground_heard = !self.ground || view.ground(now).is_some();
        !vehicles.is_empty()
            && is_ground_heard
            && vehicles.iter().all(|id| view.state(*id).is_some())
    }

    /// Names what was not heard.
    pub fn missing(&self, view: &FleetView, now: Time) -> Vec<String> {
        let silent = |id: &VehicleId| view.state(*id).is_none();
        let vehicles = self.vehicles(view, now);
        let mut missing: Vec<String> = vehicles
            .iter()
            .filter(|id| silent(id))
            .map(|id| format!("vehicle {id}"))
            .collect();
        if vehicles.is_empty() {
            missing.push("any vehicle".to_owned());
        }
        if self.ground && view.ground(now).is_none() {
            missing.push("the ground station".to_owned());
        }
        missing
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests_support::{at, heard, report, state};
    use super::*;
    use tomoswarm_proto::Message;

    fn view(messages: Vec<Message>) -> FleetView {
        let mut view = FleetView::default();
        messages
            .into_iter()
            .for_each(|message| view.hear(at(1.0), &heard(message)));
        view
    }

    fn expected(vehicles: &[u8]) -> Expected {
        Expected {
            vehicles: vehicles.iter().map(|id| VehicleId(*id)).collect(),
            ground: true,
        }
    }

    #[test]
    fn all_are_heard_when_the_ground_and_everyone_it_names_are() {
        let (one, two) = (Message::State(state(1)), Message::State(state(2)));
        let ground = Message::Report(report());
        let check = |messages: Vec<Message>, vehicles: &[u8], is_whole: bool, missing: &[&str]| {
            let (view, expected) = (view(messages), expected(vehicles));
            assert_eq!(expected.all_heard(&view, at(1.0)), is_whole);
            assert_eq!(expected.missing(&view, at(1.0)), missing);
        };
        check(
            vec![one.clone(), two.clone(), ground.clone()],
            &[],
            true,
            &[],
        );
        check(
            vec![one.clone(), ground.clone()],
            &[],
            false,
            &["vehicle 2"],
        );
        check(
            vec![one.clone(), two.clone()],
            &[],
            false,
            &["the ground station"],
        );
        check(vec![one, two, ground], &[3], false, &["vehicle 3"]);
        check(vec![], &[], false, &["any vehicle", "the ground station"]);
    }
}
