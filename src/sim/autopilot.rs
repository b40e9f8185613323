//! A simulated autopilot that behaves like ArduPilot's where a ground station would notice: modes, arming, stored missions,
//! failsafes; for rovers and copters.
//!
//! It serves the terms of any autopilot ([`crate::autopilot`]): it is told a [`Command`] and answers at once
//! ([`CommandAck`]); what it knows of itself can be read at any moment. What it does is
//! laid as *stages* (drive, turn, climb, stand), each with a known end, so there is no step size: it may be looked at often
//! or seldom ([`Autopilot::advance`]), and everything happens at its own moment all the same.
//!
//! ```text
//!   Command ──► checks ──► action ──► vehicle control ──► stages ──► body, climb
//!                   ▲                      ▲      │  over
//!   battery, place ─┴─ failsafe            └──────┴─ next item of the stored mission
//! ```
//!
//! Deliberately simple: it climbs, turns and flies one after the other (ArduCopter flies diagonally and turns on the way);
//! gusts are not known, a steady wind carries a copter aside and makes it lean. It speaks no MAVLink and knows no obstacles.

mod battery;
mod checks;
mod flight;
mod messages;
mod navigation;
mod place_estimate;
mod staged_motion;
mod stages;
mod status_texts;
mod stored_mission;
#[cfg(test)]
mod tests;
mod vehicle_control;

use super::body::{Body, BodyState, MotionRefusal};
use crate::autopilot::{ArmRefusal, Command, CommandAck, StoredReport, SystemStatus, VehicleKind};
use crate::geom::{Angle, Attitude, Point, Pose};
use crate::time::Time;

pub use flight::Climb;
pub use messages::{AutopilotSettings, DatedText, LowBattery, Readout, StatusText};
pub use navigation::{Navigation, Outage};
pub use staged_motion::StagedMotion;

use battery::{Battery, ChargeLevel};
use checks::{Action, Failsafe, Situation};
use place_estimate::PlaceEstimate;
use status_texts::StatusTexts;
use vehicle_control::{Moment, VehicleControl};

/// A vehicle with its autopilot.
#[derive(Clone, Debug)]
pub struct Autopilot {
    settings: AutopilotSettings,
    place: PlaceEstimate,
    battery: Battery,
    control: VehicleControl,
    texts: StatusTexts,
    /// Up to here everything that was due has happened.
    now: Time,
}

/// What becomes due by itself.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
enum Due {
    StageOver,
    BatterySinks,
    PlaceLost,
    Idle,
}

impl Autopilot {
    /// Switches an autopilot on, disarmed, on the ground.
    ///
    /// # Errors
    /// The place, the heading or the drive are impossible.
    pub fn new(
        settings: AutopilotSettings,
        navigation: Navigation,
        at: Point,
        heading: Angle,
    ) -> Result<Autopilot, MotionRefusal> {
        let body = Body::at_rest(at, heading, settings.limits)?;
        Ok(Autopilot {
            place: PlaceEstimate::new(navigation),
            battery: Battery::full(),
            control: VehicleControl::switched_on(body),
            texts: StatusTexts::default(),
            now: Time::ZERO,
            settings,
        })
    }

    /// Returns the same vehicle under way: armed, in GUIDED, home where it is, a copter hovering at this altitude, metres.
    pub fn under_way(self, altitude_m: f64) -> Autopilot {
        let altitude_m = match self.settings.kind {
            VehicleKind::Rover => 0.0,
            VehicleKind::Copter => altitude_m,
        };
        Autopilot {
            control: self.control.under_way(altitude_m, self.now),
            ..self
        }
    }

    /// Lets everything happen that is due by now, each at its own moment.
    pub fn advance(&mut self, now: Time) {
        while let Some((at, due)) = self.next_due().filter(|(at, _)| *at <= now) {
            self.pass_time(at);
            self.happen(due);
        }
        if now > self.now {
            self.pass_time(now);
        }
    }

    /// Returns the next moment at which something happens by itself.
    pub fn next_change(&self) -> Option<Time> {
        self.next_due().map(|(at, _)| at)
    }

    /// Returns up to when everything that was due has happened.
    pub fn now(&self) -> Time {
        self.now
    }

    /// Takes a command, now; returns the answer. What was due before has happened then.
    pub fn command(&mut self, now: Time, command: Command) -> CommandAck {
        self.advance(now);
        match self.situation().judge(command) {
            Ok(action) => {
                self.act(action);
                CommandAck::Accepted
            }
            Err(refusal) => refusal,
        }
    }

    /// Returns why it would not arm now; `None` when it would, or is armed. An empty battery cannot be forced.
    pub fn arm_refusal(&self, force: bool) -> Option<ArmRefusal> {
        self.situation().arm_refusal(force)
    }

    /// Returns what it steers.
    pub fn kind(&self) -> VehicleKind {
        self.settings.kind
    }

    /// Returns how it moves: its body in the plane, and its altitude.
    pub fn motion(&self) -> &StagedMotion {
        self.control.motion()
    }

    /// Returns how far it is with the mission that it stores.
    pub fn stored_report(&self) -> StoredReport {
        self.control.mission().report()
    }

    /// Returns where it truly is at a moment, as far as its stage goes.
    pub fn truth(&self, at: Time) -> BodyState {
        self.motion().pose_at(at)
    }

    /// Returns how it lies.
    pub fn attitude(&self, at: Time) -> Attitude {
        let (state, motion) = (self.truth(at), self.motion());
        if self.settings.kind == VehicleKind::Rover || self.is_landed(at) {
            Attitude::level(state.heading)
        } else {
            flight::leaning(motion.body(), state, at, self.settings.wind)
        }
    }

    /// Returns the stored mission.
    #[cfg(test)]
    pub fn items(&self) -> &[crate::autopilot::Item] {
        self.control.mission().items()
    }

    /// Gives the battery a charge, 0 to 1.
    pub fn set_battery(&mut self, now: Time, charge: f64) {
        self.advance(now);
        self.battery.set(charge, &self.settings);
    }

    /// Says what is to happen when the battery is low.
    pub fn set_low_battery(&mut self, action: LowBattery) {
        self.settings.on_low_battery = action;
    }

    /// Returns what it has said since the last call, in order.
    pub fn status_texts(&mut self) -> Vec<DatedText> {
        self.texts.take()
    }

    /// Comes to rest at once, against all limits: it has hit something. Nothing moves it any more.
    pub fn wreck(&mut self, at: Time) {
        self.control.wreck(at);
    }

    /// Returns what it reports at a moment; call [`Autopilot::advance`] first.
    pub fn report(&self, now: Time) -> Readout {
        let (control, motion, truth) = (&self.control, self.motion(), self.truth(now));
        Readout {
            pose: Pose {
                at: truth.at + self.place.error(now),
                heading: truth.heading,
                sd_m: self.place.sd_m(now),
            },
            altitude_m: motion.altitude_m(now),
            attitude: self.attitude(now),
            speed_mps: truth.speed_mps,
            climb_mps: motion.climb().climb_mps(now),
            battery: self.battery.charge(),
            mode: control.mode(),
            is_armed: control.is_armed(),
            is_landed: self.is_landed(now),
            status: self.status(now),
            item: control.mission().item(),
            is_over: control.mission().report().is_over,
            home: control.home(),
            servos: control.servos().clone(),
        }
    }

    fn status(&self, now: Time) -> SystemStatus {
        if now < Time::ZERO + self.settings.ready_after {
            return SystemStatus::Booting;
        }
        if self.place.is_lost() || self.battery.level() != ChargeLevel::Enough {
            return SystemStatus::Critical;
        }
        let is_grounded = self.settings.kind == VehicleKind::Copter && self.is_landed(now);
        if self.control.is_armed() && !is_grounded {
            SystemStatus::Active
        } else {
            SystemStatus::Standby
        }
    }

    fn is_landed(&self, at: Time) -> bool {
        self.control.is_landed(self.settings.kind, at)
    }

    fn next_due(&self) -> Option<(Time, Due)> {
        let (now, settings) = (self.now, &self.settings);
        let works = self.control.works_until(settings.kind, now).since(now);
        [
            (self.motion().stage_ends(), Due::StageOver),
            (
                self.battery.sinks_at(now, works, settings),
                Due::BatterySinks,
            ),
            (self.place.lost_at(now, settings), Due::PlaceLost),
            (self.control.idle_until(settings, now), Due::Idle),
        ]
        .into_iter()
        .filter_map(|(at, due)| Some((at?.max(now), due)))
        .min()
    }

    fn happen(&mut self, due: Due) {
        match due {
            Due::StageOver => {
                let (control, mut moment) = self.parts();
                control.end_stage(&mut moment);
            }
            Due::BatterySinks => match self.battery.sink() {
                ChargeLevel::Enough | ChargeLevel::Low => {
                    self.trip(Failsafe::BatteryLow, StatusText::BatteryLow);
                }
                ChargeLevel::Empty => self.trip(Failsafe::BatteryEmpty, StatusText::BatteryEmpty),
            },
            Due::PlaceLost => {
                self.place.lose();
                self.trip(Failsafe::PlaceLost, StatusText::PlaceLost);
            }
            Due::Idle => self.act(Action::Disarm),
        }
    }

    fn trip(&mut self, failsafe: Failsafe, text: StatusText) {
        self.texts.say(self.now, text);
        let action = self.situation().reaction(failsafe);
        self.act(action);
    }

    fn act(&mut self, action: Action) {
        let (control, mut moment) = self.parts();
        control.act(action, &mut moment);
    }

    /// Lets time pass during which nothing changes by itself.
    fn pass_time(&mut self, until: Time) {
        let (from, settings) = (self.now, &self.settings);
        let works_until = self.control.works_until(settings.kind, from);
        let works = works_until.min(until).since(from);
        self.battery.spend(works, until.since(from), settings);
        self.place.refresh(until, settings);
        self.now = until;
    }

    fn situation(&self) -> Situation<'_> {
        let (now, settings, control) = (self.now, &self.settings, &self.control);
        Situation {
            settings,
            mode: control.mode(),
            is_armed: control.is_armed(),
            is_landed: self.is_landed(now),
            is_under_way: self.motion().stage_ends().is_some(),
            is_ready: now >= Time::ZERO + settings.ready_after,
            has_place: self.place.is_known(now, settings),
            is_battery_empty: self.battery.level() == ChargeLevel::Empty,
            at: self.truth(now).at + self.place.error(now),
            altitude_m: self.motion().altitude_m(now),
            speed_mps: control.speed_mps(),
            mission: control.mission_situation(),
        }
    }

    /// Returns what acts, and the moment in which it does.
    fn parts(&mut self) -> (&mut VehicleControl, Moment<'_>) {
        let moment = Moment {
            now: self.now,
            settings: &self.settings,
            place: &self.place,
            texts: &mut self.texts,
        };
        (&mut self.control, moment)
    }
}
