//! What a vehicle decides on its own: it holds when it hears nobody, goes home when the bus is lost for long or the
//! battery is low (and when it does not see, see `place_watch`), and says who has fallen silent. How it drives home is
//! decided by `returning`.
//!
//! ```text
//!                    nobody on bus or radio                heard again
//!   [Following] ───────────────────────────► (it stands) ───────────────► [Following]
//!       │ bus lost for autonomy_s, radio heard      │ bus lost for autonomy_s
//!       ▼                                           ▼
//!   [Returning] ◄─────── radio heard ───────────── [Held]        a Start, or a newer plan: [Following] (ground decides)
//! ```
//!
//! The states are those of [`super::goal`]. Here is only decided; what the vehicle does by it is done in
//! [`super::Mission`].

use std::collections::BTreeSet;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Sender, VehicleId};

use super::goal::{Goal, GoalSource};
use super::messages::{AutonomyCause, MissionEvent};
use crate::config::Safety;
use crate::node::peers::{Peers, SILENT_AFTER};
use crate::time::Time;

/// A battery that was low must be charged by this much more before it is not low any more, 0 to 1.
const CHARGED: f64 = 0.05;

/// What a vehicle decides on its own.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum Decision {
    /// It says something.
    Say(MissionEvent),
    /// It stops, and goes on as soon as somebody is heard.
    Stop,
    /// It holds from now on.
    Hold(AutonomyCause),
    /// It returns from now on.
    Return(AutonomyCause),
}

/// Whom a vehicle hears, how its battery is, and what it has made of that.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Autonomy {
    /// When a message of another node came last; `None` = it has never joined a bus.
    bus_at: Option<Time>,
    /// When a beacon came last.
    radio_at: Option<Time>,
    /// Nobody is heard at all.
    is_alone: bool,
    is_bus_lost: bool,
    is_battery_low: bool,
    /// Peers that have fallen silent.
    silent: BTreeSet<VehicleId>,
}

impl Autonomy {
    /// Records that another node was heard on the bus.
    pub(super) fn heard_bus(&mut self, now: Time, own: VehicleId, by: Sender) {
        if by != Sender::Vehicle(own) {
            self.bus_at = Some(now);
        }
    }

    /// Records that another vehicle was heard by radio.
    pub(super) fn heard_radio(&mut self, now: Time) {
        self.radio_at = Some(now);
    }

    /// Returns whether nobody is heard at all: the vehicle stands.
    pub(super) fn is_alone(&self) -> bool {
        self.is_alone
    }

    /// Returns whether the battery is low.
    pub(super) fn is_battery_low(&self) -> bool {
        self.is_battery_low
    }

    /// Forgets peers that are not known any more: they are neither silent nor heard again.
    pub(super) fn forget_strangers(&mut self, peers: &Peers) {
        self.silent.retain(|vehicle| peers.get(*vehicle).is_some());
    }

    /// Returns which peers have fallen silent, or are heard again.
    pub(super) fn watch_peers(&mut self, now: Time, peers: &Peers) -> Vec<Decision> {
        let mut decisions = Vec::new();
        for (vehicle, peer) in peers.iter() {
            if peer.is_silent(now) && self.silent.insert(vehicle) {
                decisions.push(Decision::Say(MissionEvent::Silent(vehicle)));
            } else if !peer.is_silent(now) && self.silent.remove(&vehicle) {
                decisions.push(Decision::Say(MissionEvent::HeardAgain(vehicle)));
            }
        }
        decisions
    }

    /// Returns what is done about whom the vehicle hears: a bus lost for longer than `autonomy` is lost for good.
    pub(super) fn watch_links(
        &mut self,
        now: Time,
        autonomy: Duration,
        goal: Goal,
    ) -> Vec<Decision> {
        let Some(bus_at) = self.bus_at else {
            return Vec::new();
        };
        let bus_for = now.since(bus_at);
        let radio_for = self.radio_at.map_or(Duration::MAX, |at| now.since(at));
        let mut decisions = Vec::new();
        let is_alone = bus_for > SILENT_AFTER && radio_for > SILENT_AFTER;
        if is_alone != std::mem::replace(&mut self.is_alone, is_alone) {
            let (alone, heard) = (MissionEvent::Alone, MissionEvent::NotAlone);
            decisions.push(Decision::Say(if is_alone { alone } else { heard }));
            let stops = is_alone && goal.is_under_way();
            decisions.extend(stops.then_some(Decision::Stop));
        }
        let is_bus_lost = bus_for > autonomy;
        if is_bus_lost != std::mem::replace(&mut self.is_bus_lost, is_bus_lost) {
            let (lost, back) = (MissionEvent::BusLost, MissionEvent::BusBack);
            decisions.push(Decision::Say(if is_bus_lost { lost } else { back }));
        }
        decisions.extend(self.without_bus(goal));
        decisions
    }

    /// Without a bus it holds as long as nobody is heard at all, and returns otherwise. What an operator has ordered stays.
    fn without_bus(&self, goal: Goal) -> Option<Decision> {
        let is_held_by_it = goal == Goal::Held(GoalSource::Itself(AutonomyCause::BusLost));
        match (self.is_bus_lost, goal) {
            (true, Goal::Following) if self.is_alone => {
                Some(Decision::Hold(AutonomyCause::BusLost))
            }
            (true, Goal::Following) => Some(Decision::Return(AutonomyCause::BusLost)),
            (true, Goal::Held(_)) if is_held_by_it && !self.is_alone => {
                Some(Decision::Return(AutonomyCause::BusLost))
            }
            (_, Goal::Waiting | Goal::Held(_) | Goal::Returning(_) | Goal::Home(_))
            | (false, Goal::Following) => None,
        }
    }

    /// Returns what is done about the battery, charged from 0 to 1. One whose charge is not known any more is as low as it was.
    pub(super) fn watch_battery(
        &mut self,
        battery: Option<f64>,
        safety: &Safety,
        goal: Goal,
    ) -> Option<Decision> {
        let charge = if self.is_battery_low { CHARGED } else { 0.0 };
        if let Some(battery) = battery {
            self.is_battery_low = battery < safety.battery_return + charge;
        }
        let is_empty = battery.is_some_and(|battery| battery < safety.battery_hold);
        match goal {
            Goal::Following | Goal::Returning(_) if is_empty => {
                Some(Decision::Hold(AutonomyCause::BatteryEmpty))
            }
            Goal::Following if self.is_battery_low => {
                Some(Decision::Return(AutonomyCause::BatteryLow))
            }
            Goal::Waiting
            | Goal::Held(_)
            | Goal::Following
            | Goal::Returning(_)
            | Goal::Home(_) => None,
        }
    }
}

#[cfg(test)]
mod tests;
