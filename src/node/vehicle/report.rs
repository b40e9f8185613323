//! What the vehicle says of itself: its state with every telemetry to its other actors, unrounded; less often the state that
//! travels, which is made of it here and nowhere else; and which of its states an order answers. It decides nothing.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    Boot, Control, LegReport, Permille, PoseReport, Position, Revision, RunId, SeenState,
    StandReason, State, Tilt, VehicleMode, Velocity,
};

use super::messages::{Motion, Telemetry};
use super::restraint::Restraint;
use super::{Out, Vehicle};
use crate::autopilot::{FlightState, RemoteSwitch};
use crate::geom::{Point, Pose, Vector};
use crate::node::OwnState;
use crate::node::state_ages::StateAges;
use crate::time::Time;

/// States are published this often while the mode stays the same.
const PUBLISH_EVERY: Duration = Duration::from_millis(200);
/// So often, with the first telemetry that comes then, while the vehicle rests and says nothing new: every half second, since
/// each state wakes three actors of every other node. Two may be lost before others take it for silent.
const PUBLISH_AT_REST_EVERY: Duration = Duration::from_millis(450);
/// A place that is further off than this is news, metres.
const MOVED_M: f64 = 0.1;
/// A heading that is further off than this is news, radians.
const TURNED_RAD: f64 = 0.1;

/// A vehicle does not see when one of its range sensors has not answered for this long after a ping was due.
const BLIND_AFTER: Duration = Duration::from_secs(1);

/// What was said of the vehicle, and what its mission told to say.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Reports {
    sequence: u64,
    /// When recent states were made, to judge the age of orders by.
    made: StateAges,
    published: Option<(Time, State)>,
    accepted: (RunId, Revision),
    /// Why the mission stands still on its own, if it does.
    mission_holds: Option<StandReason>,
    /// When the first state was made.
    begun_at: Option<Time>,
    /// When each range sensor has answered last, by its number.
    answered_at: BTreeMap<usize, Time>,
}

impl Reports {
    /// Notes which plan the mission follows.
    pub(super) fn note_accepted(&mut self, run: RunId, revision: Revision) {
        self.accepted = (run, revision);
    }

    /// Notes why the mission stands still on its own, if it does.
    pub(super) fn note_mission_holds(&mut self, holds: Option<StandReason>) {
        self.mission_holds = holds;
    }

    /// Lets the next state be published at once.
    pub(super) fn publish_next(&mut self) {
        self.published = None;
    }

    /// Returns whether what answers a state of this `boot` was said in time, and answers one of after a moment.
    pub(super) fn is_answer(
        &self,
        now: Time,
        boot: Boot,
        seen: Option<SeenState>,
        after: Option<Time>,
    ) -> bool {
        let is_of_then =
            |sequence| after.is_none_or(|after| self.made.made_at(sequence) > Some(after));
        let is_fresh = |sequence| self.made.is_fresh(now, sequence) && is_of_then(sequence);
        seen.is_some_and(|seen| seen.boot == boot && is_fresh(seen.sequence))
    }

    /// Returns the number of the newest state.
    #[cfg(test)]
    pub fn sequence(&self) -> u64 {
        self.sequence
    }

    /// Notes that a range sensor has answered.
    pub(super) fn note_scan(&mut self, now: Time, sensor: usize) {
        self.answered_at.insert(sensor, now);
    }

    /// Returns since when a range sensor has not answered; one that never has, since the first state was made.
    fn silent_since(&self, sensor: usize) -> Option<Time> {
        self.answered_at.get(&sensor).copied().or(self.begun_at)
    }

    fn begin(&mut self, now: Time) {
        self.sequence += 1;
        self.begun_at.get_or_insert(now);
        self.made.note(now, self.sequence);
    }

    /// Returns whether a state of this mode may be published now, if it says something new.
    fn may_publish(&self, now: Time, mode: VehicleMode) -> bool {
        self.published
            .as_ref()
            .is_none_or(|(at, last)| mode != last.mode || now.since(*at) >= PUBLISH_EVERY)
    }

    /// Returns whether a state that may be published is.
    fn is_due(&self, now: Time, state: &State) -> bool {
        self.published.as_ref().is_none_or(|(at, last)| {
            is_news(last, state) || now.since(*at) >= PUBLISH_AT_REST_EVERY
        })
    }
}

/// Returns whether a state says of a vehicle what the last one did not: that it moves, is somewhere else, or is about to do
/// something else.
fn is_news(last: &State, state: &State) -> bool {
    let is_place_new = match (last.pose.map(Pose::from), state.pose.map(Pose::from)) {
        (Some(last), Some(now)) => {
            let turned = (now.heading - last.heading).radians().abs();
            last.at.distance_to(now.at) > MOVED_M || turned > TURNED_RAD
        }
        (last, now) => last.is_some() != now.is_some(),
    };
    // What a sensor says of a vehicle at rest trembles.
    let but_for_trembling = State {
        sequence: last.sequence,
        pose: last.pose,
        roll: last.roll,
        pitch: last.pitch,
        velocity: last.velocity,
        battery: last.battery,
        ..state.clone()
    };
    !state.is_at_rest || is_place_new || but_for_trembling != *last
}

impl Vehicle {
    /// Says what the vehicle does and where, as telemetry shows it.
    pub(super) fn report(&mut self, now: Time, telemetry: &Telemetry, out: &mut Vec<Out>) {
        self.reports.begin(now);
        let state = self.state(now, telemetry);
        if self.reports.may_publish(now, state.mode) {
            let on_wire = self.on_wire(&state);
            if self.reports.is_due(now, &on_wire) {
                self.reports.published = Some((now, on_wire.clone()));
                out.push(Out::Publish(on_wire));
            }
        }
        out.push(Out::State(state));
    }

    /// Publishes what was known last of a vehicle whose autopilot has fallen silent: that it has.
    pub(super) fn report_silence(&mut self, now: Time, out: &mut Vec<Out>) {
        let Some(telemetry) = self.telemetry.of_any_age().copied() else {
            return;
        };
        self.reports.begin(now);
        let state = self.state(now, &telemetry);
        out.push(Out::Publish(self.on_wire(&state)));
    }

    fn state(&self, now: Time, telemetry: &Telemetry) -> OwnState {
        OwnState {
            sees: self.sees(now),
            sequence: self.reports.sequence,
            pose: telemetry.pose,
            flight_state: telemetry.flight_state,
            speed_mps: telemetry.speed_mps,
            mode: self.mode(telemetry.motion),
            is_at_rest: telemetry.motion == Motion::Resting,
            may_move: !self.is_held_back() && !self.take_over.stands(),
            is_armed: telemetry.is_armed,
            is_landed: self.autopilot.is_landed,
            battery: telemetry.battery,
            leg: self.movement.way_from(telemetry.pose.at),
            stored: self.movement.stored_progress(telemetry),
            accepted: self.reports.accepted,
            ordered: self.orders.highest(),
        }
    }

    /// Returns whether every range sensor that is asked answers.
    fn sees(&self, now: Time) -> bool {
        let look = &self.settings.look;
        // Of several each is asked once a round at least.
        let asked_every = match look.mounts.all() {
            [_] => look.period,
            _ => look.cycle(),
        };
        let answers = |sensor: usize| {
            let silent_since = self.reports.silent_since(sensor).unwrap_or(now);
            now.since(silent_since) <= asked_every + BLIND_AFTER
        };
        let mut aims = look.beams.iter().filter_map(|beam| look.mounts.aim(*beam));
        !look.is_blind && aims.all(|aim| answers(aim.sensor))
    }

    /// Returns the state as it travels.
    fn on_wire(&self, own: &OwnState) -> State {
        let report = |corners: &Vec<Point>| LegReport {
            route: corners.iter().copied().map(Into::into).collect(),
        };
        let FlightState {
            altitude_m,
            climb_mps,
            course,
            tilt,
        } = own.flight_state;
        let Pose { at, heading, .. } = own.pose;
        let place = Position::from_metres(at.x_m, at.y_m, altitude_m);
        let over_ground = Vector::polar(course.unwrap_or(heading), own.speed_mps);
        let (roll, pitch) = tilt.map_or((Tilt::UNKNOWN, Tilt::UNKNOWN), |(roll, pitch)| {
            (
                Tilt::from_radians(roll.radians()),
                Tilt::from_radians(pitch.radians()),
            )
        });
        State {
            vehicle: self.settings.vehicle,
            boot: self.settings.boot,
            sequence: own.sequence,
            pose: at.is_finite().then(|| PoseReport {
                at: place,
                ..own.pose.into()
            }),
            roll,
            pitch,
            velocity: Velocity::from_metres_per_second(over_ground.x_m, over_ground.y_m, climb_mps),
            mode: own.mode,
            stands_under: self.stands_under(own),
            is_at_rest: own.is_at_rest,
            control: self.autopilot.control,
            is_armed: own.is_armed,
            is_landed: own.is_landed,
            battery: own.battery.and_then(Permille::from_fraction),
            leg: own.leg.as_ref().map(report),
            accepted: own.accepted,
            ordered: own.ordered,
        }
    }

    /// Returns why the vehicle does not go on by itself, as far as it is known here.
    fn stands_under(&self, own: &OwnState) -> Option<StandReason> {
        if let Some(name) = self.emergency.stop() {
            return Some(StandReason::Stop(name));
        }
        if self.autopilot.switch == Some(RemoteSwitch::Hold) {
            return Some(StandReason::Remote);
        }
        match self.orders.restraint() {
            _ if self.emergency.stands() => Some(StandReason::Held),
            Restraint::Held | Restraint::Landing(_) | Restraint::MotorsCut(_) => {
                Some(StandReason::Held)
            }
            Restraint::Free if self.take_over.stands() => self.take_over.reason(),
            Restraint::Free if self.autopilot.control == Control::Silent => {
                Some(StandReason::Autopilot)
            }
            Restraint::Free if own.pose.sd_m > self.settings.swarm.pose_sd_max_m => {
                Some(StandReason::NoPlace)
            }
            Restraint::Free => self.reports.mission_holds,
        }
    }

    fn mode(&self, motion: Motion) -> VehicleMode {
        if self.emergency.stop().is_some() {
            return VehicleMode::Stopped;
        }
        match (self.orders.restraint(), motion) {
            (Restraint::MotorsCut(_), Motion::Resting | Motion::Turning | Motion::Driving) => {
                VehicleMode::MotorsCut
            }
            (Restraint::Free | Restraint::Held | Restraint::Landing(_), Motion::Driving) => {
                VehicleMode::Driving
            }
            (Restraint::Free | Restraint::Held | Restraint::Landing(_), Motion::Turning) => {
                VehicleMode::Turning
            }
            (Restraint::Held | Restraint::Landing(_), Motion::Resting) => VehicleMode::Held,
            (Restraint::Free, Motion::Resting) if self.reports.mission_holds.is_some() => {
                VehicleMode::Held
            }
            (Restraint::Free, Motion::Resting) if self.movement.is_halted() => VehicleMode::Halted,
            (Restraint::Free, Motion::Resting) => VehicleMode::Idle,
        }
    }
}
