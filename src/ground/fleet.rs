//! What the ground knows of each vehicle: its newest state and progress, and what it was ordered.

use std::collections::BTreeMap;

use tomoswarm_proto::{Lease, Order, OrderKind, Progress, Revision, RunId, State, VehicleId};

use crate::time::Time;

/// One vehicle as the ground sees it.
#[derive(Clone, Debug, Default)]
pub struct Member {
    /// Its newest state, and when it came.
    pub state: Option<(Time, State)>,
    /// Its newest progress.
    pub progress: Option<Progress>,
    /// What it was ordered last, repeated until its state shows it.
    pub order: Option<Order>,
}

/// All vehicles that the ground expects.
#[derive(Clone, Debug)]
pub struct Fleet {
    members: BTreeMap<VehicleId, Member>,
    lease: Lease,
}

impl Fleet {
    /// Makes a fleet of vehicles that have not been heard yet.
    pub fn new(expected: &[VehicleId], lease: Lease) -> Fleet {
        Fleet { members: expected.iter().map(|id| (*id, Member::default())).collect(), lease }
    }

    /// Gives the vehicles, ascending.
    pub fn members(&self) -> impl Iterator<Item = (VehicleId, &Member)> {
        self.members.iter().map(|(id, member)| (*id, member))
    }

    /// Gives the ids, ascending.
    pub fn ids(&self) -> Vec<VehicleId> {
        self.members.keys().copied().collect()
    }

    /// Gives by which right orders and plans are given.
    pub fn lease(&self) -> Lease {
        self.lease
    }

    /// Gives the number of the newest state of a vehicle; 0 when none was heard.
    pub fn seen_state(&self, vehicle: VehicleId) -> u64 {
        let state = self.members.get(&vehicle).and_then(|member| member.state.as_ref());
        state.map_or(0, |(_, state)| state.sequence)
    }

    /// Takes a state; older ones and those of strangers change nothing.
    pub fn heard_state(&mut self, now: Time, state: State) {
        let Some(member) = self.members.get_mut(&state.vehicle) else { return };
        let key = |state: &State| (state.boot, state.sequence);
        if member.state.as_ref().is_none_or(|(_, known)| key(&state) > key(known)) {
            let obeyed = |order: &Order| state.ordered.edition() >= (order.lease, order.revision);
            if member.order.as_ref().is_some_and(obeyed) {
                member.order = None;
            }
            member.state = Some((now, state));
        }
    }

    /// Takes a progress; a lower revision of the same run changes nothing. Gives whether the vehicle has got on.
    pub fn heard_progress(&mut self, progress: Progress) -> bool {
        let Some(member) = self.members.get_mut(&progress.vehicle) else { return false };
        let key = |progress: &Progress| (progress.run, progress.revision, progress.done);
        let before = member.progress.as_ref().map(key);
        if before <= Some(key(&progress)) {
            member.progress = Some(progress);
        }
        before < Some(key(&progress))
    }

    /// Tells whether every vehicle has been heard.
    pub fn is_complete(&self) -> bool {
        self.members.values().all(|member| member.state.is_some())
    }

    /// Gives the highest revision of a run that any vehicle shows, so that a new ground begins above it.
    pub fn highest_revision(&self, run: RunId) -> Revision {
        let states = self.members.values().filter_map(|member| member.state.as_ref());
        let shown = states.filter(|(_, state)| state.accepted.0 == run).map(|(_, state)| state.accepted.1);
        shown.max().unwrap_or_default()
    }

    /// Orders something of every vehicle, above whatever it has obeyed before.
    pub fn order_all(&mut self, run: RunId, kind: OrderKind) {
        for (vehicle, member) in &mut self.members {
            let obeyed = member.state.as_ref().map_or(Revision(0), |(_, state)| state.ordered.revision);
            let pending = member.order.as_ref().map_or(Revision(0), |order| order.revision);
            let revision = Revision(obeyed.max(pending).0.saturating_add(1));
            member.order =
                Some(Order { vehicle: *vehicle, lease: self.lease, run, revision, seen_state: 0, kind });
        }
    }

    /// Gives the orders that are not yet seen in a state, answering the newest state heard.
    pub fn open_orders(&self) -> Vec<Order> {
        let order = |member: &Member| {
            let (_, state) = member.state.as_ref()?;
            Some(Order { seen_state: state.sequence, ..member.order? })
        };
        self.members.values().filter_map(order).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Boot, Mode, Ordered};

    fn state(sequence: u64, ordered: Revision, lease: Lease) -> State {
        State {
            vehicle: VehicleId(1),
            boot: Boot(1),
            sequence,
            pose: Default::default(),
            speed_mps: 0.0,
            mode: Mode::Idle,
            battery: 1.0,
            leg: None,
            accepted: Default::default(),
            ordered: Ordered { lease, revision: ordered, ..Ordered::default() },
        }
    }

    #[test]
    fn an_order_is_repeated_until_its_effect_shows() {
        let lease = Lease { number: 1, holder: 9 };
        let mut fleet = Fleet::new(&[VehicleId(1)], lease);
        fleet.heard_state(Time::ZERO, state(5, Revision(3), lease));
        fleet.order_all(RunId(1), OrderKind::Start);
        assert_eq!(fleet.open_orders()[0].revision, Revision(4));
        assert_eq!(fleet.open_orders()[0].seen_state, 5);
        fleet.heard_state(Time::ZERO, state(6, Revision(3), lease));
        assert_eq!(fleet.open_orders().len(), 1);
        fleet.heard_state(Time::ZERO, state(7, Revision(4), lease));
        assert!(fleet.open_orders().is_empty());
    }

    #[test]
    fn old_states_and_strangers_change_nothing() {
        let mut fleet = Fleet::new(&[VehicleId(1)], Lease::default());
        fleet.heard_state(
            Time::ZERO,
            State { vehicle: VehicleId(8), ..state(1, Revision(0), Lease::default()) },
        );
        assert!(!fleet.is_complete());
        fleet.heard_state(Time::ZERO, state(9, Revision(0), Lease::default()));
        fleet.heard_state(Time::ZERO, state(4, Revision(0), Lease::default()));
        let (_, member) = fleet.members().next().unwrap();
        assert_eq!(member.state.as_ref().unwrap().1.sequence, 9);
    }

    #[test]
    fn an_order_above_the_highest_revision_is_no_overflow() {
        let mut fleet = Fleet::new(&[VehicleId(1)], Lease::default());
        fleet.heard_state(Time::ZERO, state(1, Revision(u32::MAX), Lease::default()));
        fleet.order_all(RunId(1), OrderKind::Emergency);
        assert_eq!(fleet.open_orders()[0].revision, Revision(u32::MAX));
    }
}
