//! A simulated autopilot that behaves like ArduPilot's where a ground station would notice: modes, arming, stored missions,
//! failsafes; for rovers and copters.
//!
//! It serves the terms of any autopilot ([`crate::autopilot`]): it is told a [`Command`] and answers at once
//! ([`CommandAck`]); what it knows of itself can be read at any moment. What it does is
//! laid as *stages* (drive, turn, climb, stand), each with a known end, so there is no step size: it may be looked at often
//! or seldom ([`Autopilot::advance`]), and everything happens at its own moment all the same.
//!
//! ```text
//!   Command ──► obey ──► stages ──► body, climb          Manual, Hold, Loiter: stay     Guided: what is asked
//!             ▲         │ over                       Auto: the next item            Return, Land: stages laid at once
//!             └─────────┴── next item, failsafe
//! ```
//!
//! Deliberately simple: it climbs, turns and flies one after the other (ArduCopter flies diagonally and turns on the way);
//! gusts are not known, a steady wind carries a copter aside and makes it lean. It speaks no MAVLink and knows no obstacles.

mod flight;
mod messages;
mod mission;
mod navigation;
mod obey;
mod stages;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use super::body::{Body, BodyState, MotionRefusal};
use crate::autopilot::item::ItemError;
use crate::autopilot::{
    ArmRefusal, Command, CommandAck, FlightMode, Item, SystemStatus, VehicleKind,
};
use crate::geom::{Angle, Attitude, Point, Pose, Vector};
use crate::time::Time;

pub use flight::Climb;
pub use messages::{AutopilotSettings, DatedText, LowBattery, Readout, StatusText};
pub use navigation::{Navigation, Outage};
use stages::Stage;

/// Status texts that nobody takes are dropped, the oldest first, beyond this many.
const NOTICES: usize = 256;
/// A copter counts as landed at or below this altitude, metres.
const LANDED_M: f64 = 0.05;

/// A vehicle with its autopilot.
#[derive(Clone, Debug)]
pub struct Autopilot {
    settings: AutopilotSettings,
    navigation: Navigation,
    body: Body,
    climb: Climb,
    mode: FlightMode,
    is_armed: bool,
    home: Option<Point>,
    /// Speed at which it travels unless it is told otherwise, m/s.
    speed_mps: f64,
    stages: VecDeque<Stage>,
    /// When the stage under way is over; `None` = none is under way.
    stage_ends: Option<Time>,
    items: Vec<Item>,
    /// The item under way, or begun last; 0 = none.
    item: usize,
    is_mission_running: bool,
    servos: BTreeMap<u8, u16>,
    charge: f64,
    failsafe: Failsafe,
    /// Since when a copter is armed and has not taken off.
    idle_since: Time,
    /// Up to here everything that was due has happened.
    now: Time,
    notices: VecDeque<DatedText>,
    /// Counts the changes of its motion.
    motions: u64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Failsafe {
    is_battery_low: bool,
    is_battery_empty: bool,
    is_lost: bool,
}

/// What becomes due by itself.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
enum Due {
    StageOver,
    BatteryLow,
    BatteryEmpty,
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
        Ok(Autopilot {
            body: Body::at_rest(at, heading, settings.limits)?,
            climb: Climb::level(0.0),
            mode: FlightMode::Manual,
            is_armed: false,
            home: None,
            speed_mps: settings.limits.speed_mps,
            stages: VecDeque::new(),
            stage_ends: None,
            items: Vec::new(),
            item: 0,
            is_mission_running: false,
            servos: BTreeMap::new(),
            charge: 1.0,
            failsafe: Failsafe::default(),
            idle_since: Time::ZERO,
            now: Time::ZERO,
            notices: VecDeque::new(),
            motions: 0,
            settings,
            navigation,
        })
    }

    /// Returns the same vehicle under way: armed, in GUIDED, home where it is, a copter hovering at this altitude, metres.
    pub fn under_way(self, altitude_m: f64) -> Autopilot {
        let altitude_m = if self.settings.kind == VehicleKind::Copter {
            altitude_m
        } else {
            0.0
        };
        Autopilot {
            climb: Climb::level(altitude_m),
            mode: FlightMode::Guided,
            is_armed: true,
            home: Some(self.body.pose_at(self.now).at),
            ..self
        }
    }

    /// Lets everything happen that is due by now, each at its own moment.
    pub fn advance(&mut self, now: Time) {
        while let Some((at, due)) = self.next_due().filter(|(at, _)| *at <= now) {
            self.spend(at);
            self.happen(due);
        }
        if now > self.now {
            self.spend(now);
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

    /// Returns where it truly is at a moment, as far as its stage goes.
    pub fn truth(&self, at: Time) -> BodyState {
        self.body.pose_at(at)
    }

    /// Returns its body, as it moves in the plane.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Returns its change of altitude.
    pub fn climb(&self) -> &Climb {
        &self.climb
    }

    /// Returns its altitude above the ground at its start, metres.
    pub fn altitude_m(&self, at: Time) -> f64 {
        self.climb.altitude_m(at)
    }

    /// Returns how it lies.
    pub fn attitude(&self, at: Time) -> Attitude {
        let state = self.truth(at);
        match self.settings.kind {
            VehicleKind::Rover => Attitude::level(state.heading),
            VehicleKind::Copter if self.is_landed(at) => Attitude::level(state.heading),
            VehicleKind::Copter => flight::leaning(&self.body, state, at, self.settings.wind),
        }
    }

    /// Returns the believed place less the true one.
    pub fn place_error(&self, at: Time) -> Vector {
        self.navigation.error(at)
    }

    /// Returns a number that changes whenever its motion does.
    pub fn motions(&self) -> u64 {
        self.motions
    }

    /// Returns whether it neither moves nor turns nor climbs.
    pub fn is_at_rest(&self, at: Time) -> bool {
        self.body.is_done(at) && self.climb.until() <= at
    }

    /// Returns whether the motors have current.
    pub fn is_armed(&self) -> bool {
        self.is_armed
    }

    /// Returns whether it stands on the ground.
    pub fn is_landed(&self, at: Time) -> bool {
        self.settings.kind == VehicleKind::Rover || self.climb.altitude_m(at) <= LANDED_M
    }

    /// Returns what it steers.
    pub fn kind(&self) -> VehicleKind {
        self.settings.kind
    }

    /// Returns its mode.
    pub fn mode(&self) -> FlightMode {
        self.mode
    }

    /// Returns the stored mission.
    pub fn items(&self) -> &[Item] {
        &self.items
    }

    /// Returns the charge left, 0 to 1.
    pub fn battery(&self) -> f64 {
        self.charge
    }

    /// Gives the battery a charge, 0 to 1.
    pub fn set_battery(&mut self, now: Time, charge: f64) {
        self.advance(now);
        self.charge = charge.clamp(0.0, 1.0);
        self.failsafe.is_battery_low &= self.charge <= self.settings.low_battery;
        self.failsafe.is_battery_empty &= self.charge <= 0.0;
    }

    /// Returns what it has said since the last call, in order.
    pub fn status_texts(&mut self) -> Vec<DatedText> {
        self.notices.drain(..).collect()
    }

    /// Comes to rest at once, against all limits: it has hit something. Nothing moves it any more.
    pub fn wreck(&mut self, at: Time) {
        self.body.halt(at);
        self.climb = Climb::level(self.climb.altitude_m(at));
        self.stages.clear();
        (self.stage_ends, self.is_mission_running) = (None, false);
        self.motions += 1;
    }

    /// Returns what it reports at a moment; call [`Autopilot::advance`] first.
    pub fn report(&self, now: Time) -> Readout {
        let truth = self.truth(now);
        let at = truth.at + self.place_error(now);
        Readout {
            pose: Pose {
                at,
                heading: truth.heading,
                sd_m: self.navigation.sd_m(now),
            },
            altitude_m: self.altitude_m(now),
            attitude: self.attitude(now),
            speed_mps: truth.speed_mps,
            climb_mps: self.climb.climb_mps(now),
            battery: self.charge,
            mode: self.mode,
            is_armed: self.is_armed,
            is_landed: self.is_landed(now),
            status: self.status(now),
            item: self.item,
            home: self.home,
            servos: self.servos.clone(),
        }
    }

    fn status(&self, now: Time) -> SystemStatus {
        if now < Time::ZERO + self.settings.ready_after {
            SystemStatus::Booting
        } else if self.failsafe.is_lost || self.failsafe.is_battery_low {
            SystemStatus::Critical
        } else if self.is_armed
            && (self.settings.kind == VehicleKind::Rover || !self.is_landed(now))
        {
            SystemStatus::Active
        } else {
            SystemStatus::Standby
        }
    }

    /// Returns whether it knows its place.
    fn has_place(&self) -> bool {
        let is_known = self.navigation.sd_m(self.now) <= self.settings.place_sd_max_m;
        is_known && self.now >= Time::ZERO + self.settings.place_after
    }

    fn say(&mut self, notice: StatusText) {
        if self.notices.len() >= NOTICES {
            self.notices.pop_front();
        }
        self.notices.push_back((self.now, notice));
    }

    fn next_due(&self) -> Option<(Time, Due)> {
        let is_idle = self.settings.kind == VehicleKind::Copter
            && self.is_armed
            && self.stage_ends.is_none()
            && self.is_landed(self.now);
        [
            self.stage_ends.map(|at| (at, Due::StageOver)),
            self.charge_reached(self.settings.low_battery)
                .filter(|_| !self.failsafe.is_battery_low)
                .map(|at| (at, Due::BatteryLow)),
            self.charge_reached(0.0)
                .filter(|_| !self.failsafe.is_battery_empty)
                .map(|at| (at, Due::BatteryEmpty)),
            self.place_lost_at().map(|at| (at, Due::PlaceLost)),
            is_idle.then(|| (self.idle_since + self.settings.disarm_after, Due::Idle)),
        ]
        .into_iter()
        .flatten()
        .map(|(at, due)| (at.max(self.now), due))
        .min()
    }

    fn place_lost_at(&self) -> Option<Time> {
        self.navigation
            .lost_at(self.now, self.settings.place_sd_max_m)
    }

    fn happen(&mut self, due: Due) {
        match due {
            Due::StageOver => self.end_stage(),
            Due::BatteryLow => {
                self.failsafe.is_battery_low = true;
                self.say(StatusText::BatteryLow);
                self.act_on_low_battery();
            }
            Due::BatteryEmpty => {
                self.failsafe.is_battery_empty = true;
                self.say(StatusText::BatteryEmpty);
                self.stop_for_good();
            }
            Due::PlaceLost => self.lose_place(),
            Due::Idle => self.disarm(),
        }
    }

    fn act_on_low_battery(&mut self) {
        if !self.is_armed {
            return;
        }
        match (self.settings.on_low_battery, self.settings.kind) {
            (LowBattery::Warn, _) => {}
            (LowBattery::Return, _) if self.has_place() => self.enter(FlightMode::Return),
            (LowBattery::Return | LowBattery::Land, VehicleKind::Copter) => {
                self.enter(FlightMode::Land)
            }
            (LowBattery::Return | LowBattery::Land, VehicleKind::Rover) => {
                self.enter(FlightMode::Hold)
            }
        }
    }

    /// Who does not know its place any more stands, or comes down where it is.
    fn lose_place(&mut self) {
        self.failsafe.is_lost = true;
        self.say(StatusText::PlaceLost);
        if self.is_armed && self.mode.needs_place() {
            self.enter(match self.settings.kind {
                VehicleKind::Rover => FlightMode::Hold,
                VehicleKind::Copter => FlightMode::Land,
            });
        }
    }

    /// Without current a rover brakes; a copter sinks with what is left.
    fn stop_for_good(&mut self) {
        match self.settings.kind {
            VehicleKind::Rover => self.disarm(),
            VehicleKind::Copter if self.is_landed(self.now) => self.disarm(),
            VehicleKind::Copter => self.enter(FlightMode::Land),
        }
    }

    /// Takes from the battery what is used until a moment, during which nothing changes by itself.
    fn spend(&mut self, until: Time) {
        let used = self.used(until);
        self.charge = (self.charge - used).max(0.0);
        self.now = until;
        self.failsafe.is_lost &= self.navigation.sd_m(until) > self.settings.place_sd_max_m;
    }

    /// The charge used from now until a later moment.
    fn used(&self, until: Time) -> f64 {
        let moves_s = self.moves_until().min(until).since(self.now).as_secs_f64();
        let all_s = until.since(self.now).as_secs_f64();
        let (driving, resting) = (
            self.settings.endurance_driving,
            self.settings.endurance_resting,
        );
        moves_s / driving.as_secs_f64() + (all_s - moves_s).max(0.0) / resting.as_secs_f64()
    }

    /// Until when it uses what motion takes; a copter in the air always does, as long as its motors turn.
    fn moves_until(&self) -> Time {
        let arrival = self
            .body
            .arrival()
            .unwrap_or(Time::ZERO)
            .max(self.climb.until());
        let flies = self.settings.kind == VehicleKind::Copter
            && self.is_armed
            && (!self.is_landed(self.now) || self.climb.to_m > LANDED_M);
        if flies {
            Time::NEVER
        } else {
            arrival.max(self.now)
        }
    }

    /// When the charge will have sunk to a level, if nothing changes; `None` = it lies below already, or never.
    fn charge_reached(&self, level: f64) -> Option<Time> {
        let spare = self.charge - level;
        if spare < 0.0 || (spare == 0.0 && level > 0.0) {
            // Given by hand, or there already.
            return Some(self.now);
        }
        let moves_until = self.moves_until();
        let moving = self.settings.endurance_driving.as_secs_f64() * spare;
        let moves_s = moves_until.since(self.now).as_secs_f64();
        let wait_s = if moving <= moves_s {
            moving
        } else {
            let left = spare - moves_s / self.settings.endurance_driving.as_secs_f64();
            moves_s + left * self.settings.endurance_resting.as_secs_f64()
        };
        (wait_s < 1e9).then(|| self.now + Duration::from_nanos(libm::ceil(wait_s * 1e9) as u64))
    }
}
