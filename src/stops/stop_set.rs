//! The emergency stops that a node knows: those that are open, and the names lifted last. Two sets join by union, and
//! lifted wins: in whatever order, and however often, sets are joined, every node comes to the same open stops.
//!
//! A node names eight open stops. What comes beyond is not told apart any more: one stop of the whole swarm, whose name
//! says *many*, stands for it. A stop that is not named is not forgotten by the node that named it: it is heard of again
//! once there is room. Nothing here knows time, disks or nodes.

use std::collections::{BTreeMap, VecDeque};

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{EmergencyName, EmergencyStop, OpenStops, StopScope, VehicleId};

/// Open stops that are told apart.
pub const OPEN_BY_NAME: usize = 8;
/// Lifted names that are remembered.
const LIFTED: usize = 64;
/// At most this many names, the latest, are taken from a received list of lifted names; older ones give way.
const LATEST: usize = LIFTED / 2;

/// Open stops, and names that were lifted.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct StopSet {
    /// At most [`OPEN_BY_NAME`] that were drawn, and one that stands for many.
    open: BTreeMap<EmergencyName, EmergencyStop>,
    /// The latest at the end.
    lifted: VecDeque<EmergencyName>,
}

impl StopSet {
    /// Returns the set that a message or a disk tells; what goes beyond its limits stands for many.
    pub fn of(standing: &OpenStops) -> StopSet {
        let mut set = StopSet::default();
        set.join(standing);
        set
    }

    /// Returns it as it is told.
    pub fn standing(&self) -> OpenStops {
        OpenStops {
            open: self.open.values().copied().collect(),
            lifted: self.lifted.iter().copied().collect(),
        }
    }

    /// Returns the open stops, ascending by name.
    pub fn open(&self) -> impl Iterator<Item = &EmergencyStop> {
        self.open.values()
    }

    /// Returns whether no stop is open.
    pub fn is_clear(&self) -> bool {
        self.open.is_empty()
    }

    /// Returns the open stop of a name.
    pub fn named(&self, name: EmergencyName) -> Option<&EmergencyStop> {
        self.open.get(&name)
    }

    /// Returns whether a name was lifted, as far as that is remembered.
    pub fn is_lifted(&self, name: EmergencyName) -> bool {
        self.lifted.contains(&name)
    }

    /// Returns whether a stop would be new.
    pub fn is_news(&self, name: EmergencyName) -> bool {
        !self.open.contains_key(&name) && !self.is_lifted(name)
    }

    /// Opens a stop, unless its name was lifted; returns whether another stop is open now.
    pub fn open_stop(&mut self, stop: EmergencyStop) -> bool {
        if !self.is_news(stop.name) {
            return false;
        }
        let named = self.open.keys().filter(|name| !name.is_many()).count();
        if stop.name.is_many() || named >= OPEN_BY_NAME {
            return self.open_many(stop);
        }
        self.open.insert(stop.name, stop).is_none()
    }

    /// Opens what stands for many in place of a stop; returns whether another stop is open now. Of several that stand for
    /// many the lowest name stays.
    pub fn open_many(&mut self, stop: EmergencyStop) -> bool {
        let many = EmergencyStop {
            name: EmergencyName::many_of(stop.name),
            scope: StopScope::All,
            ..stop
        };
        let known = self.open.keys().find(|name| name.is_many()).copied();
        if self.is_lifted(many.name) || known.is_some_and(|known| known <= many.name) {
            return false;
        }
        known.map(|known| self.open.remove(&known));
        self.open.insert(many.name, many);
        true
    }

    /// Lifts a name, whether or not it is open; returns whether a stop is open no longer.
    pub fn lift(&mut self, name: EmergencyName) -> bool {
        if !self.is_lifted(name) {
            if self.lifted.len() >= LIFTED {
                self.lifted.pop_front();
            }
            self.lifted.push_back(name);
        }
        self.open.remove(&name).is_some()
    }

    /// Joins what another node knows; returns whether other stops are open now.
    pub fn join(&mut self, other: &OpenStops) -> bool {
        let mut is_changed = false;
        let earlier = other.lifted.len().saturating_sub(LATEST);
        for (index, name) in other.lifted.iter().enumerate() {
            let has_room = self.lifted.len() < LIFTED;
            if self.open.contains_key(name)
                || has_room
                || (index >= earlier && !self.is_lifted(*name))
            {
                is_changed |= self.lift(*name);
            }
        }
        other.open.iter().fold(is_changed, |is_changed, stop| {
            self.open_stop(*stop) || is_changed
        })
    }
}

/// Returns the first of some open stops that a vehicle stands under.
pub fn first_that_stops<'a>(
    open: impl IntoIterator<Item = &'a EmergencyStop>,
    vehicle: VehicleId,
) -> Option<EmergencyName> {
    let mut those = open.into_iter().filter(|stop| stop.concerns(vehicle));
    those.next().map(|stop| stop.name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tomoswarm_proto::{Message, OperatorId};

    fn name(number: u32) -> EmergencyName {
        EmergencyName(EmergencyName::LOWEST_DRAWN + number)
    }

    fn stop(number: u32) -> EmergencyStop {
        EmergencyStop {
            name: name(number),
            scope: StopScope::All,
            by: OperatorId(1),
        }
    }

    fn names(set: &StopSet) -> Vec<u32> {
        set.open()
            .map(|stop| stop.name.0.wrapping_sub(EmergencyName::LOWEST_DRAWN))
            .collect()
    }

    /// What one node does or hears.
    #[derive(Clone, Copy, Debug)]
    enum Action {
        Open(usize, u32),
        Lift(usize, u32),
        Tell(usize, usize),
    }

    fn actions(nodes: usize, names: u32) -> impl Strategy<Value = Vec<Action>> {
        let action = prop_oneof![
            (0..nodes, 0..names).prop_map(|(node, name)| Action::Open(node, name)),
            (0..nodes, 0..names).prop_map(|(node, name)| Action::Lift(node, name)),
            (0..nodes, 0..nodes).prop_map(|(from, to)| Action::Tell(from, to)),
        ];
        proptest::collection::vec(action, 0..60)
    }

    fn tell(nodes: &mut [StopSet], from: usize, to: usize) {
        let told = nodes[from].standing();
        assert_eq!(Message::Standing(told.clone()).check(), Ok(()), "{told:?}");
        nodes[to].join(&told);
    }

    fn settle(nodes: &mut [StopSet]) {
        for _ in 0..12 {
            for from in 0..nodes.len() {
                (0..nodes.len()).for_each(|to| tell(nodes, from, to));
            }
        }
    }

    proptest! {
        /// As long as no limit is met: what was opened anywhere and lifted nowhere is open everywhere, and nothing else.
        #[test]
        fn all_nodes_come_to_what_was_opened_and_not_lifted(actions in actions(4, 8)) {
            let mut nodes = vec![StopSet::default(); 4];
            let (mut opened, mut lifted) = (vec![], vec![]);
            for action in actions {
                match action {
                    // Whoever knows that a name was lifted does not draw it again.
                    Action::Open(node, number) => if nodes[node].open_stop(stop(number)) { opened.push(number) },
                    Action::Lift(node, number) => { nodes[node].lift(name(number)); lifted.push(number) }
                    Action::Tell(from, to) => tell(&mut nodes, from, to),
                }
            }
            settle(&mut nodes);
            opened.sort_unstable();
            opened.dedup();
            opened.retain(|number| !lifted.contains(number));
            for node in &nodes {
                prop_assert_eq!(&names(node), &opened);
            }
        }

        /// With any number of names: all nodes stop when one does, come to the same, and are clear once all they name is
        /// lifted as often as it takes.
        #[test]
        fn more_names_than_are_told_apart_stop_all_and_can_be_lifted(actions in actions(4, 40)) {
            let mut nodes = vec![StopSet::default(); 4];
            for action in actions {
                match action {
                    Action::Open(node, number) => { nodes[node].open_stop(stop(number)); }
                    Action::Lift(node, number) => { nodes[node].lift(name(number)); }
                    Action::Tell(from, to) => tell(&mut nodes, from, to),
                }
            }
            settle(&mut nodes);
            let clear: Vec<bool> = nodes.iter().map(StopSet::is_clear).collect();
            prop_assert!(clear.iter().all(|is| *is == clear[0]), "{clear:?}");
            for _ in 0..12 {
                let open: Vec<EmergencyName> = nodes[0].open().map(|stop| stop.name).collect();
                open.into_iter().for_each(|name| { nodes[0].lift(name); });
                settle(&mut nodes);
            }
            prop_assert!(nodes.iter().all(StopSet::is_clear));
        }

        #[test]
        fn to_join_twice_changes_nothing(actions in actions(2, 40)) {
            let mut nodes = vec![StopSet::default(); 2];
            for action in actions {
                match action {
                    Action::Open(node, number) => { nodes[node].open_stop(stop(number)); }
                    Action::Lift(node, number) => { nodes[node].lift(name(number)); }
                    Action::Tell(from, to) => tell(&mut nodes, from, to),
                }
            }
            let told = nodes[0].standing();
            nodes[1].join(&told);
            let once = nodes[1].clone();
            prop_assert!(!nodes[1].join(&told));
            prop_assert_eq!(&nodes[1], &once);
            prop_assert_eq!(StopSet::of(&told).standing().open, told.open);
        }
    }

    #[test]
    fn lifted_wins_in_either_order() {
        let (mut lifts_first, mut opens_first) = (StopSet::default(), StopSet::default());
        assert!(!lifts_first.lift(name(1)) && !lifts_first.open_stop(stop(1)));
        assert!(opens_first.open_stop(stop(1)) && opens_first.lift(name(1)));
        assert!(lifts_first.is_clear() && opens_first.is_clear());
    }

    #[test]
    fn the_ninth_stop_stands_for_many_of_the_whole_swarm() {
        let mut set = StopSet::default();
        (0..8).for_each(|number| assert!(set.open_stop(stop(number))));
        let ninth = EmergencyStop {
            scope: StopScope::One(VehicleId(3)),
            ..stop(8)
        };
        assert!(set.open_stop(ninth), "it stops more than it was given for");
        let many = set.open().next().unwrap();
        assert_eq!((many.name.is_many(), many.scope), (true, StopScope::All));
        assert!(!set.open_stop(stop(9)), "nothing more is told");
        assert_eq!(set.open().count(), 9);
        assert_eq!(
            first_that_stops(set.open(), VehicleId(7)),
            Some(EmergencyName::many_of(name(8)))
        );
    }

    #[test]
    fn a_stop_for_one_vehicle_stops_no_other() {
        let mut set = StopSet::default();
        set.open_stop(EmergencyStop {
            scope: StopScope::One(VehicleId(3)),
            ..stop(1)
        });
        assert_eq!(
            [3, 2].map(|id| first_that_stops(set.open(), VehicleId(id))),
            [Some(name(1)), None]
        );
    }

    #[test]
    fn the_names_lifted_last_are_remembered_and_full_lists_do_not_push_each_other_out() {
        let (mut one, mut other) = (StopSet::default(), StopSet::default());
        (0..100).for_each(|number| {
            one.lift(name(number));
        });
        assert!(one.is_lifted(name(99)) && one.is_lifted(name(36)) && !one.is_lifted(name(35)));
        (0..64).for_each(|number| {
            other.lift(name(200 + number));
        });
        for _ in 0..5 {
            let (of_one, of_other) = (one.standing(), other.standing());
            one.join(&of_other);
            other.join(&of_one);
        }
        let (was_one, was_other) = (one.clone(), other.clone());
        let (of_one, of_other) = (one.standing(), other.standing());
        one.join(&of_other);
        other.join(&of_one);
        assert_eq!((one, other), (was_one, was_other), "they come to rest");
    }
}
