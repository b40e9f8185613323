//! What the vehicle says of itself: its state with every telemetry, published less often, and which of its states an order
//! answers. It decides nothing.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{LegReport, Mode, Revision, RunId, State};

use super::restraint::Restraint;
use super::words::{Motion, Telemetry};
use super::{Out, Vehicle};
use crate::node::ages::Ages;
use crate::time::Time;

/// States are published this often while the mode stays the same.
const PUBLISH_EVERY: Duration = Duration::from_millis(200);

/// What was said of the vehicle, and what its mission told to say.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Reports {
    sequence: u64,
    /// When recent states were made, to judge the age of orders by.
    made: Ages,
    published: Option<(Time, Mode)>,
    accepted: (RunId, Revision),
    mission_holds: bool,
}

impl Reports {
    /// Notes which plan the mission follows.
    pub fn note_accepted(&mut self, run: RunId, revision: Revision) {
        self.accepted = (run, revision);
    }

    /// Notes whether the mission stands still on its own.
    pub fn note_mission_holds(&mut self, holds: bool) {
        self.mission_holds = holds;
    }

    /// Returns whether what answers a state was said in time.
    pub fn is_answer(&self, now: Time, seen_state: u64) -> bool {
        self.made.is_fresh(now, seen_state)
    }

    /// Returns the number of the newest state.
    #[cfg(test)]
    pub fn sequence(&self) -> u64 {
        self.sequence
    }

    fn begin(&mut self, now: Time) {
        self.sequence += 1;
        self.made.note(now, self.sequence);
    }

    /// Returns whether a state is to be published now, and takes it for published.
    fn publishes(&mut self, now: Time, mode: Mode) -> bool {
        let is_due = |(at, last)| mode != last || now.since(at) >= PUBLISH_EVERY;
        let is_due = self.published.is_none_or(is_due);
        if is_due {
            self.published = Some((now, mode));
        }
        is_due
    }
}

impl Vehicle {
    /// Says what the vehicle does and where, as telemetry shows it.
    pub(super) fn report(&mut self, now: Time, telemetry: &Telemetry, out: &mut Vec<Out>) {
        self.reports.begin(now);
        let state = self.state(telemetry);
        if self.reports.publishes(now, state.mode) {
            out.push(Out::Publish(state.clone()));
        }
        out.push(Out::State(state));
    }

    fn state(&self, telemetry: &Telemetry) -> State {
        let way = self.movement.way_from(telemetry.pose.at);
        State {
            vehicle: self.settings.vehicle,
            boot: self.settings.boot,
            sequence: self.reports.sequence,
            pose: telemetry.pose.into(),
            speed_mps: telemetry.speed_mps,
            mode: self.mode(telemetry.motion),
            battery: telemetry.battery,
            leg: way.map(|way| LegReport { route: way.into_iter().map(Into::into).collect() }),
            accepted: self.reports.accepted,
            ordered: self.orders.highest(),
        }
    }

    fn mode(&self, motion: Motion) -> Mode {
        match (self.orders.restraint(), motion) {
            (Restraint::Emergency(_), Motion::Resting | Motion::Turning | Motion::Driving) => Mode::Emergency,
            (Restraint::Free | Restraint::Held | Restraint::Landing(_), Motion::Driving) => Mode::Driving,
            (Restraint::Free | Restraint::Held | Restraint::Landing(_), Motion::Turning) => Mode::Turning,
            (Restraint::Held | Restraint::Landing(_), Motion::Resting) => Mode::Held,
            (Restraint::Free, Motion::Resting) if self.reports.mission_holds => Mode::Held,
            (Restraint::Free, Motion::Resting) if self.movement.is_halted() => Mode::Halted,
            (Restraint::Free, Motion::Resting) => Mode::Idle,
        }
    }
}
