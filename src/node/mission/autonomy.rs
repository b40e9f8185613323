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

use super::returning::Line;
use super::{Mission, Out, Remark, Standing, Wanted};
use crate::node::peers::SILENT_AFTER;
use crate::time::Time;

/// A battery that was low must be charged by this much more before it is not low any more, 0 to 1.
const CHARGED: f64 = 0.05;

/// Why a vehicle does something that nobody has ordered.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Cause {
    /// Nobody was heard on the bus for `autonomy_s`.
    BusLost,
    /// The battery is below `battery_return`.
    BatteryLow,
    /// The battery is below `battery_hold`.
    BatteryEmpty,
}

/// Whom a vehicle hears, and what it makes of that.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Links {
    /// When a message of another node came last; `None` = it has never joined a bus.
    bus_at: Option<Time>,
    /// When a beacon came last.
    radio_at: Option<Time>,
    /// Nobody is heard at all.
    pub is_alone: bool,
    is_bus_lost: bool,
}

impl Links {
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
                out.push(Out::Remark(Remark::Silent(vehicle)));
            } else if !peer.is_silent(now) && self.silent.remove(&vehicle) {
                out.push(Out::Remark(Remark::HeardAgain(vehicle)));
            }
        }
    }

    fn look_at_links(&mut self, now: Time, out: &mut Vec<Out>) {
        let Some(bus_at) = self.links.bus_at else { return };
        let bus_for = now.since(bus_at);
        let radio_for = self.links.radio_at.map_or(Duration::MAX, |at| now.since(at));
        let is_alone = bus_for > SILENT_AFTER && radio_for > SILENT_AFTER;
        if is_alone != self.links.is_alone {
            self.links.is_alone = is_alone;
            out.push(Out::Remark(if is_alone { Remark::Alone } else { Remark::NotAlone }));
            if is_alone && self.is_under_way() {
                self.stop(now, out);
            }
        }
        let is_bus_lost = bus_for > self.settings.swarm.autonomy();
        if is_bus_lost != self.links.is_bus_lost {
            self.links.is_bus_lost = is_bus_lost;
            out.push(Out::Remark(if is_bus_lost { Remark::BusLost } else { Remark::BusBack }));
        }
        let is_held_by_it = self.wanted == Wanted::Held && self.own == Some(Cause::BusLost);
        match (is_bus_lost, self.wanted) {
            (true, Wanted::Following) if is_alone => self.decide(now, Wanted::Held, Cause::BusLost, out),
            (true, Wanted::Following) => self.return_on_its_own(now, Cause::BusLost, out),
            (true, Wanted::Held) if is_held_by_it && !is_alone => {
                self.return_on_its_own(now, Cause::BusLost, out);
            }
            (_, Wanted::Waiting | Wanted::Held | Wanted::Returning { .. } | Wanted::Home)
            | (false, Wanted::Following) => {}
        }
    }

    fn look_at_battery(&mut self, now: Time, out: &mut Vec<Out>) {
        let Some(battery) = self.state.as_ref().map(|state| state.battery) else { return };
        let safety = self.settings.safety;
        let enough =
            if self.is_battery_low { safety.battery_return + CHARGED } else { safety.battery_return };
        self.is_battery_low = battery < enough;
        match self.wanted {
            Wanted::Following | Wanted::Returning { .. } if battery < safety.battery_hold => {
                self.decide(now, Wanted::Held, Cause::BatteryEmpty, out);
            }
            Wanted::Following if self.is_battery_low => {
                self.return_on_its_own(now, Cause::BatteryLow, out);
            }
            Wanted::Waiting | Wanted::Held | Wanted::Following | Wanted::Returning { .. } | Wanted::Home => {}
        }
    }

    fn return_on_its_own(&mut self, now: Time, cause: Cause, out: &mut Vec<Out>) {
        self.decide(now, Wanted::Returning { since: now, under_way: false }, cause, out);
    }

    /// Stops, and does from now on what nobody has ordered.
    fn decide(&mut self, now: Time, wanted: Wanted, cause: Cause, out: &mut Vec<Out>) {
        (self.wanted, self.own, self.line) = (wanted, Some(cause), Line::default());
        self.stop(now, out);
        out.push(Out::Remark(Remark::Decides(cause, self.standing())));
    }

    /// A newer plan of its own takes a vehicle back that acts on its own since it had lost the bus: the ground knows of
    /// it, and has planned from where it is.
    pub(super) fn resume_for(&mut self, now: Time, plan: &Plan, out: &mut Vec<Out>) {
        let followed = self.follower.as_ref().and_then(|follower| follower.plan());
        let is_newer = followed.is_none_or(|known| (plan.run, plan.revision) > (known.run, known.revision));
        let is_own = plan.vehicle == self.settings.vehicle && self.own == Some(Cause::BusLost);
        if is_newer && is_own {
            (self.wanted, self.own) = (Wanted::Following, None);
            self.stop(now, out);
        }
    }

    /// Tells whether it drives, or is about to.
    fn is_under_way(&self) -> bool {
        match self.wanted {
            Wanted::Following | Wanted::Returning { .. } => true,
            Wanted::Waiting | Wanted::Held | Wanted::Home => false,
        }
    }

    /// Tells whether it stands and will not go on by itself, however long it takes.
    pub(super) fn holds(&self) -> bool {
        self.wanted == Wanted::Held || (self.links.is_alone && self.is_under_way())
    }

    /// Gives what the vehicle does, for status lines.
    pub fn standing(&self) -> Standing {
        match self.wanted {
            _ if self.holds() => Standing::Held,
            Wanted::Held => Standing::Held,
            Wanted::Waiting => Standing::Waiting,
            Wanted::Following => Standing::Following,
            Wanted::Returning { .. } => Standing::Returning,
            Wanted::Home => Standing::Home,
        }
    }
}
