//! What is asked of an autopilot, and when it says no.

use super::messages::StatusText;
use super::stages::Stage;
use super::{ArmRefusal, Autopilot, Command, CommandAck, FlightMode, Item, ItemError, VehicleKind};
use crate::autopilot::item::{check_items, is_altitude, is_output, is_place, is_speed};
use crate::geom::{Point, Vector};
use crate::time::Time;

/// A velocity holds for this long after it was said last, seconds.
const VELOCITY_HOLDS_S: f64 = 3.0;
/// Slower than this is standing, m/s.
const STANDING_MPS: f64 = 0.001;

impl Autopilot {
    /// Takes a command, now; returns the answer. What was due before has happened then.
    pub fn command(&mut self, now: Time, command: Command) -> CommandAck {
        self.advance(now);
        match command {
            Command::Mode(mode) => self.change_mode(mode),
            Command::Arm { force } => self.arm(force),
            Command::Disarm { force } => {
                if !force && !self.is_landed(self.now) {
                    return CommandAck::Failed;
                }
                self.disarm();
                CommandAck::Accepted
            }
            Command::Takeoff { altitude_m } => self.take_off(altitude_m),
            Command::Route {
                corners,
                altitude_m,
                speed_mps,
            } => self.go(corners, altitude_m, speed_mps),
            Command::Velocity(velocity) => self.move_on(velocity),
            Command::Yaw(heading) if !heading.radians().is_finite() => CommandAck::Denied,
            Command::Yaw(heading) => self.guided([Stage::Turn(heading)]),
            Command::Stop => self.guided([Stage::Brake]),
            Command::Upload(items) => match self.upload(now, items) {
                Ok(()) => CommandAck::Accepted,
                Err(_) => CommandAck::Denied,
            },
            Command::Clear => {
                self.forget_mission();
                CommandAck::Accepted
            }
            Command::Begin => self.begin(),
            Command::SetCurrent(item) => self.set_current(item),
            Command::Speed(speed_mps) if !is_speed(speed_mps) => CommandAck::Denied,
            Command::Speed(speed_mps) => {
                self.speed_mps = speed_mps;
                CommandAck::Accepted
            }
            Command::Servo { channel, pulse_us } if !is_output(channel, pulse_us) => {
                CommandAck::Denied
            }
            Command::Servo { channel, pulse_us } => {
                self.servos.insert(channel, pulse_us);
                CommandAck::Accepted
            }
            Command::SetHome(at) if !is_place(at) => CommandAck::Denied,
            Command::SetHome(at) => {
                self.home = Some(at);
                CommandAck::Accepted
            }
        }
    }

    /// Takes a mission in place of the stored one; one under way is given up where it is.
    ///
    /// # Errors
    /// [`ItemError`]; the stored mission stays.
    pub fn upload(&mut self, now: Time, items: Vec<Item>) -> Result<(), ItemError> {
        self.advance(now);
        check_items(&items, self.settings.kind)?;
        self.forget_mission();
        self.items = items;
        Ok(())
    }

    fn forget_mission(&mut self) {
        self.items.clear();
        self.item = 0;
        if std::mem::take(&mut self.is_mission_running) {
            self.lay([Stage::Brake]);
        }
    }

    /// Changes the mode by itself.
    pub(super) fn enter(&mut self, mode: FlightMode) {
        if mode != self.mode {
            self.mode = mode;
            self.say(StatusText::Mode(mode));
        }
        self.is_mission_running = false;
        if !self.is_armed {
            return;
        }
        let home = self.home.unwrap_or_else(|| self.body.pose_at(self.now).at);
        match mode {
            FlightMode::Manual | FlightMode::Hold | FlightMode::Loiter | FlightMode::Guided => {
                self.lay([Stage::Brake])
            }
            FlightMode::Auto => self.run_mission(),
            FlightMode::Return => self.lay(self.way_home(home)),
            FlightMode::Land => self.lay(self.way_down(self.climb.altitude_m(self.now))),
        }
    }

    fn change_mode(&mut self, mode: FlightMode) -> CommandAck {
        let is_missing = !mode.is_of(self.settings.kind);
        let is_blind = mode.needs_place() && !self.has_place();
        if is_missing || is_blind || (mode == FlightMode::Auto && !self.can_begin()) {
            return CommandAck::Failed;
        }
        // Said again it changes nothing: a mission goes on.
        if mode != self.mode {
            self.enter(mode);
        }
        CommandAck::Accepted
    }

    /// Returns whether there is a mission that could be flown from here: from the ground a copter must take off first.
    fn can_begin(&self) -> bool {
        let first = self
            .items
            .iter()
            .skip(self.item.max(1))
            .find(|item| item.takes_time());
        let stands =
            self.settings.kind == VehicleKind::Copter && self.is_armed && self.is_landed(self.now);
        match first {
            None => false,
            Some(first) => !stands || matches!(first, Item::Takeoff { .. }),
        }
    }

    fn arm(&mut self, force: bool) -> CommandAck {
        if self.is_armed {
            return CommandAck::Accepted;
        }
        if self.arm_refusal(force).is_some() {
            return CommandAck::Failed;
        }
        (self.is_armed, self.idle_since) = (true, self.now);
        self.say(StatusText::Armed(true));
        let here = self.body.pose_at(self.now).at + self.place_error(self.now);
        self.home.get_or_insert(here);
        if self.mode == FlightMode::Auto {
            (self.item, self.is_mission_running) = (0, false);
            self.run_mission();
        }
        CommandAck::Accepted
    }

    /// Returns why it would not arm now; `None` when it would, or is armed. An empty battery cannot be forced.
    pub fn arm_refusal(&self, force: bool) -> Option<ArmRefusal> {
        if self.is_armed {
            return None;
        }
        if self.failsafe.is_battery_empty {
            return Some(ArmRefusal::BatteryEmpty);
        }
        if force {
            return None;
        }
        if self.now < Time::ZERO + self.settings.ready_after {
            return Some(ArmRefusal::NotReady);
        }
        let arms = match self.mode {
            FlightMode::Return | FlightMode::Land => false,
            FlightMode::Auto => self.settings.kind == VehicleKind::Rover,
            FlightMode::Manual | FlightMode::Hold | FlightMode::Loiter | FlightMode::Guided => true,
        };
        if !arms {
            return Some(ArmRefusal::Mode(self.mode));
        }
        (self.mode.needs_place() && !self.has_place()).then_some(ArmRefusal::NoPlace)
    }

    fn take_off(&mut self, altitude_m: f64) -> CommandAck {
        if self.settings.kind == VehicleKind::Rover {
            return CommandAck::Unsupported;
        }
        if !(altitude_m > 0.0 && is_altitude(altitude_m)) {
            return CommandAck::Denied;
        }
        if !self.is_landed(self.now) || self.ends().is_some() {
            return CommandAck::Failed;
        }
        self.guided([Stage::Climb {
            to_m: altitude_m,
            rate_mps: self.settings.climb_mps,
        }])
    }

    fn go(
        &mut self,
        corners: Vec<Point>,
        altitude_m: Option<f64>,
        speed_mps: Option<f64>,
    ) -> CommandAck {
        let speed_mps = speed_mps.unwrap_or(self.speed_mps);
        let are_sound =
            corners.iter().all(|corner| is_place(*corner)) && altitude_m.is_none_or(is_altitude);
        if !are_sound || speed_mps.is_nan() || speed_mps < STANDING_MPS {
            return CommandAck::Denied;
        }
        if self.settings.kind == VehicleKind::Copter && self.is_landed(self.now) {
            return CommandAck::Failed;
        }
        let altitude_m = altitude_m.unwrap_or_else(|| self.climb.altitude_m(self.now));
        let stages = self.way_to(corners, altitude_m, speed_mps);
        self.guided(stages)
    }

    /// Moves along a velocity so far that it has come to rest after the time for which it holds and that of braking.
    fn move_on(&mut self, velocity: Vector) -> CommandAck {
        let speed_mps = velocity.length_m();
        if !speed_mps.is_finite() {
            return CommandAck::Denied;
        }
        if speed_mps < STANDING_MPS {
            return self.guided([Stage::Brake]);
        }
        let top_mps = speed_mps.min(self.settings.limits.speed_mps);
        let way_m = top_mps * VELOCITY_HOLDS_S + self.settings.limits.stopping_distance_m(top_mps);
        let here = self.body.pose_at(self.now).at + self.place_error(self.now);
        let goal = here + velocity * (way_m / speed_mps);
        self.go(vec![goal], None, Some(top_mps))
    }

    fn guided(&mut self, stages: impl IntoIterator<Item = Stage>) -> CommandAck {
        if self.mode != FlightMode::Guided || !self.is_armed {
            return CommandAck::Failed;
        }
        self.lay(stages);
        CommandAck::Accepted
    }

    fn begin(&mut self) -> CommandAck {
        if !self.is_armed || !self.has_place() || !self.can_begin() {
            return CommandAck::Failed;
        }
        if self.mode != FlightMode::Auto {
            self.enter(FlightMode::Auto);
        } else if !self.is_mission_running {
            self.item = 0;
            self.run_mission();
        }
        CommandAck::Accepted
    }

    fn set_current(&mut self, item: usize) -> CommandAck {
        if item >= self.items.len() {
            return CommandAck::Denied;
        }
        self.item = item;
        if self.mode == FlightMode::Auto && self.is_armed {
            self.is_mission_running = true;
            self.begin_from(item.max(1));
        }
        CommandAck::Accepted
    }
}
