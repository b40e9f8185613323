//! What is asked of an autopilot, and when it says no.

use super::item::{check_items, is_altitude, is_output, is_place, is_speed};
use super::stages::Stage;
use super::words::{Answer, Ask, Kind, Mode, Notice};
use super::{Autopilot, Item, ItemError};
use crate::geom::{Point, Vector};
use crate::time::Time;

/// A velocity holds for this long after it was said last, seconds.
const VELOCITY_HOLDS_S: f64 = 3.0;
/// Slower than this is standing, m/s.
const STANDING_MPS: f64 = 0.001;

impl Autopilot {
    /// Asks for something, now; gives the answer. What was due before has happened then.
    pub fn ask(&mut self, now: Time, ask: Ask) -> Answer {
        self.advance(now);
        match ask {
            Ask::Mode(mode) => self.change_mode(mode),
            Ask::Arm { force } => self.arm(force),
            Ask::Disarm { force } => {
                if !force && !self.is_landed(self.now) {
                    return Answer::Failed;
                }
                self.disarm();
                Answer::Accepted
            }
            Ask::Takeoff { altitude_m } => self.take_off(altitude_m),
            Ask::Route { corners, altitude_m, speed_mps } => self.go(corners, altitude_m, speed_mps),
            Ask::Velocity(velocity) => self.move_on(velocity),
            Ask::Yaw(heading) if !heading.radians().is_finite() => Answer::Denied,
            Ask::Yaw(heading) => self.guided([Stage::Turn(heading)]),
            Ask::Stop => self.guided([Stage::Brake]),
            Ask::Upload(items) => match self.upload(now, items) {
                Ok(()) => Answer::Accepted,
                Err(_) => Answer::Denied,
            },
            Ask::Clear => {
                self.forget_mission();
                Answer::Accepted
            }
            Ask::Begin => self.begin(),
            Ask::SetCurrent(item) => self.set_current(item),
            Ask::Speed(speed_mps) if !is_speed(speed_mps) => Answer::Denied,
            Ask::Speed(speed_mps) => {
                self.speed_mps = speed_mps;
                Answer::Accepted
            }
            Ask::Servo { channel, pulse_us } if !is_output(channel, pulse_us) => Answer::Denied,
            Ask::Servo { channel, pulse_us } => {
                self.servos.insert(channel, pulse_us);
                Answer::Accepted
            }
            Ask::SetHome(at) if !is_place(at) => Answer::Denied,
            Ask::SetHome(at) => {
                self.home = Some(at);
                Answer::Accepted
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
    pub(super) fn enter(&mut self, mode: Mode) {
        if mode != self.mode {
            self.mode = mode;
            self.say(Notice::Mode(mode));
        }
        self.is_mission_running = false;
        if !self.is_armed {
            return;
        }
        let home = self.home.unwrap_or_else(|| self.body.pose_at(self.now).at);
        match mode {
            Mode::Manual | Mode::Hold | Mode::Loiter | Mode::Guided => self.lay([Stage::Brake]),
            Mode::Auto => self.run_mission(),
            Mode::Return => self.lay(self.way_home(home)),
            Mode::Land => self.lay(self.way_down(self.climb.altitude_m(self.now))),
        }
    }

    fn change_mode(&mut self, mode: Mode) -> Answer {
        let is_missing = !mode.is_of(self.settings.kind);
        let is_blind = mode.needs_place() && !self.has_place();
        if is_missing || is_blind || (mode == Mode::Auto && !self.can_begin()) {
            return Answer::Failed;
        }
        // Said again it changes nothing: a mission goes on.
        if mode != self.mode {
            self.enter(mode);
        }
        Answer::Accepted
    }

    /// Tells whether there is a mission that could be flown from here: from the ground a copter must take off first.
    fn can_begin(&self) -> bool {
        let first = self.items.iter().skip(self.item.max(1)).find(|item| item.takes_time());
        let stands = self.settings.kind == Kind::Copter && self.is_armed && self.is_landed(self.now);
        match first {
            None => false,
            Some(first) => !stands || matches!(first, Item::Takeoff { .. }),
        }
    }

    fn arm(&mut self, force: bool) -> Answer {
        if self.is_armed {
            return Answer::Accepted;
        }
        if !force && !self.may_arm() {
            return Answer::Failed;
        }
        if self.failsafe.is_battery_empty {
            return Answer::Failed;
        }
        (self.is_armed, self.idle_since) = (true, self.now);
        self.say(Notice::Armed(true));
        let here = self.body.pose_at(self.now).at + self.place_error(self.now);
        self.home.get_or_insert(here);
        if self.mode == Mode::Auto {
            (self.item, self.is_mission_running) = (0, false);
            self.run_mission();
        }
        Answer::Accepted
    }

    fn may_arm(&self) -> bool {
        let is_ready = self.now >= Time::ZERO + self.settings.ready_after;
        let is_mode = match self.mode {
            Mode::Return | Mode::Land => false,
            Mode::Auto => self.settings.kind == Kind::Rover,
            Mode::Manual | Mode::Hold | Mode::Loiter | Mode::Guided => true,
        };
        is_ready && is_mode && (!self.mode.needs_place() || self.has_place())
    }

    fn take_off(&mut self, altitude_m: f64) -> Answer {
        if self.settings.kind == Kind::Rover {
            return Answer::Unsupported;
        }
        if !(altitude_m > 0.0 && is_altitude(altitude_m)) {
            return Answer::Denied;
        }
        if !self.is_landed(self.now) || self.ends().is_some() {
            return Answer::Failed;
        }
        self.guided([Stage::Climb { to_m: altitude_m, rate_mps: self.settings.climb_mps }])
    }

    fn go(&mut self, corners: Vec<Point>, altitude_m: Option<f64>, speed_mps: Option<f64>) -> Answer {
        let speed_mps = speed_mps.unwrap_or(self.speed_mps);
        let are_sound = corners.iter().all(|corner| is_place(*corner)) && altitude_m.is_none_or(is_altitude);
        if !are_sound || speed_mps.is_nan() || speed_mps < STANDING_MPS {
            return Answer::Denied;
        }
        if self.settings.kind == Kind::Copter && self.is_landed(self.now) {
            return Answer::Failed;
        }
        let altitude_m = altitude_m.unwrap_or_else(|| self.climb.altitude_m(self.now));
        let stages = self.way_to(corners, altitude_m, speed_mps);
        self.guided(stages)
    }

    /// Moves along a velocity so far that it has come to rest after the time for which it holds and that of braking.
    fn move_on(&mut self, velocity: Vector) -> Answer {
        let speed_mps = velocity.length_m();
        if !speed_mps.is_finite() {
            return Answer::Denied;
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

    fn guided(&mut self, stages: impl IntoIterator<Item = Stage>) -> Answer {
        if self.mode != Mode::Guided || !self.is_armed {
            return Answer::Failed;
        }
        self.lay(stages);
        Answer::Accepted
    }

    fn begin(&mut self) -> Answer {
        if !self.is_armed || !self.has_place() || !self.can_begin() {
            return Answer::Failed;
        }
        if self.mode != Mode::Auto {
            self.enter(Mode::Auto);
        } else if !self.is_mission_running {
            self.item = 0;
            self.run_mission();
        }
        Answer::Accepted
    }

    fn set_current(&mut self, item: usize) -> Answer {
        if item >= self.items.len() {
            return Answer::Denied;
        }
        self.item = item;
        if self.mode == Mode::Auto && self.is_armed {
            self.is_mission_running = true;
            self.begin_from(item.max(1));
        }
        Answer::Accepted
    }
}
