//! What a vehicle decides on its own: it holds when it hears nobody, goes home when the bus is lost for long or the
//! battery is low, and says who has fallen silent. How it drives home is decided by `returning`.
//!
//! ```text
//!                    nobody on bus or radio               heard again
//!   Following ──────────────────────────────► standing ───────────────► Following
//!       │ bus lost for autonomy_s, radio heard      │ bus lost for autonomy_s
//!       ▼                                           ▼
//!   Returning ◄──────── radio heard ────────────── Held          a Start, or a newer plan: Following (ground decides)
//! ```

use serde::{Deserialize, Serialize};
use std::time::Duration;

use tomoswarm_proto::{Plan, Sender, VehicleId};

use super::goal::{Goal, GoalSource};
use super::{Mission, MissionEvent, MissionStatus, Out};
use crate::node::peers::SILENT_AFTER;
use crate::time::Time;

/// A battery that was low must be charged by this much more before it is not low any more, 0 to 1.
const CHARGED: f64 = 0.05;

/// Why a vehicle does something that nobody has ordered.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum AutonomyCause {
    /// Nobody was heard on the bus for `autonomy_s`.
    BusLost,
    /// The battery is below `battery_return`.
    BatteryLow,
    /// The battery is below `battery_hold`.
    BatteryEmpty,
}

/// Whom a vehicle hears, and what it makes of that.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct HeardNodes {
    /// When a message of another node came last; `None` = it has never joined a bus.
    bus_at: Option<Time>,
    /// When a beacon came last.
    radio_at: Option<Time>,
    /// Nobody is heard at all.
    pub is_alone: bool,
    is_bus_lost: bool,
}

impl HeardNodes {
    /// Takes that another node was heard on the bus.
    pub fn heard_bus(&mut self, now: Time, own: VehicleId, by: Sender) {
        if by != Sender::Vehicle(own) {
            self.bus_at = Some(now);
        }
    }

    /// Takes that another vehicle was heard by radio.
    pub fn heard_radio(&mut self, now: Time) {
        self.radio_at = Some(now);
    }
}

impl Mission {
    /// Looks at links and battery, before anything else is decided.
    pub(super) fn look_after_itself(&mut self, now: Time, out: &mut Vec<Out>) {
        self.look_at_peers(now, out);
        self.look_at_links(now, out);
        self.look_at_battery(now, out);
    }

    fn look_at_peers(&mut self, now: Time, out: &mut Vec<Out>) {
        for (vehicle, peer) in self.peers.iter() {
            if peer.is_silent(now) && self.silent.insert(vehicle) {
                out.push(Out::MissionEvent(MissionEvent::Silent(vehicle)));
            } else if !peer.is_silent(now) && self.silent.remove(&vehicle) {
                out.push(Out::MissionEvent(MissionEvent::HeardAgain(vehicle)));
            }
        }
    }

    fn look_at_links(&mut self, now: Time, out: &mut Vec<Out>) {
        let Some(bus_at) = self.links.bus_at else {
            return;
        };
        let bus_for = now.since(bus_at);
        let radio_for = self
            .links
            .radio_at
            .map_or(Duration::MAX, |at| now.since(at));
        let is_alone = bus_for > SILENT_AFTER && radio_for > SILENT_AFTER;
        if is_alone != self.links.is_alone {
            self.links.is_alone = is_alone;
            out.push(Out::MissionEvent(if is_alone {
                MissionEvent::Alone
            } else {
                MissionEvent::NotAlone
            }));
            if is_alone && self.goal.is_under_way() {
                self.stop(now, out);
            }
        }
        let is_bus_lost = bus_for > self.settings.swarm.autonomy();
        if is_bus_lost != self.links.is_bus_lost {
            self.links.is_bus_lost = is_bus_lost;
            out.push(Out::MissionEvent(if is_bus_lost {
                MissionEvent::BusLost
            } else {
                MissionEvent::BusBack
            }));
        }
        let is_held_by_it = self.goal == Goal::Held(GoalSource::Itself(AutonomyCause::BusLost));
        match (is_bus_lost, self.goal) {
            (true, Goal::Following) if is_alone => {
                self.decide(now, AutonomyCause::BusLost, Goal::Held, out)
            }
            (true, Goal::Following) => self.return_on_its_own(now, AutonomyCause::BusLost, out),
            (true, Goal::Held(_)) if is_held_by_it && !is_alone => {
                self.return_on_its_own(now, AutonomyCause::BusLost, out);
            }
            (_, Goal::Waiting | Goal::Held(_) | Goal::Returning(_) | Goal::Home(_))
            | (false, Goal::Following) => {}
        }
    }

    fn look_at_battery(&mut self, now: Time, out: &mut Vec<Out>) {
        let Some(battery) = self.state.as_ref().map(|state| state.battery) else {
            return;
        };
        let safety = self.settings.safety;
        let enough = if self.is_battery_low {
            safety.battery_return + CHARGED
        } else {
            safety.battery_return
        };
        self.is_battery_low = battery < enough;
        match self.goal {
            Goal::Following | Goal::Returning(_) if battery < safety.battery_hold => {
                self.decide(now, AutonomyCause::BatteryEmpty, Goal::Held, out);
            }
            Goal::Following if self.is_battery_low => {
                self.return_on_its_own(now, AutonomyCause::BatteryLow, out);
            }
            Goal::Waiting
            | Goal::Held(_)
            | Goal::Following
            | Goal::Returning(_)
            | Goal::Home(_) => {}
        }
    }

    fn return_on_its_own(&mut self, now: Time, cause: AutonomyCause, out: &mut Vec<Out>) {
        self.decide(now, cause, |by| Goal::go_home(now, by), out);
    }

    /// Stops, and does from now on what nobody has ordered.
    fn decide(
        &mut self,
        now: Time,
        cause: AutonomyCause,
        goal: impl FnOnce(GoalSource) -> Goal,
        out: &mut Vec<Out>,
    ) {
        self.goal = goal(GoalSource::Itself(cause));
        self.stop(now, out);
        out.push(Out::MissionEvent(MissionEvent::Decides(
            cause,
            self.status(),
        )));
    }

    /// A newer plan of its own takes a vehicle back that acts on its own since it had lost the bus: the ground knows of
    /// it, and has planned from where it is.
    pub(super) fn resume_for(&mut self, now: Time, plan: &Plan, out: &mut Vec<Out>) {
        if self.plan.is_newer(plan) && self.goal.cause() == Some(AutonomyCause::BusLost) {
            self.goal = Goal::Following;
            self.stop(now, out);
        }
    }

    /// Returns whether it stands and will not go on by itself, however long it takes.
    pub(super) fn holds(&self) -> bool {
        matches!(self.goal, Goal::Held(_)) || (self.links.is_alone && self.goal.is_under_way())
    }

    /// Returns what the vehicle does, for status lines.
    pub fn status(&self) -> MissionStatus {
        if self.holds() {
            MissionStatus::Held
        } else {
            self.goal.status()
        }
    }
}
