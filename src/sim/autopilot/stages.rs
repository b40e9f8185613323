//! The stages of motion, one after the other, each with an end that is known when it begins.

use std::time::Duration;

use super::flight::Climb;
use super::messages::StatusText;
use super::{Autopilot, FlightMode, LANDED_M, VehicleKind};
use crate::geom::{Angle, Point, Vector};
use crate::time::Time;

/// Where a landing becomes slow, metres.
const SLOW_BELOW_M: f64 = 10.0;
/// Time over home before a copter that returns comes down.
const HOVERS: Duration = Duration::from_secs(5);
/// How far a steady wind carries a copter from its line, metres for each m/s.
const CARRIED_S: f64 = 0.05;

/// One stage of motion.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum Stage {
    /// Through believed places, to rest in the last.
    Drive { corners: Vec<Point>, speed_mps: f64 },
    /// On the spot.
    Turn(Angle),
    /// On the spot, to an altitude, metres.
    Climb { to_m: f64, rate_mps: f64 },
    /// For a while.
    Stand(Duration),
    /// To rest.
    Brake,
    /// On the ground: the motors are cut, unless a mission has a say in it.
    Touchdown,
}

impl Autopilot {
    /// Gives up what is under way and lays stages; the first begins now.
    pub(super) fn lay(&mut self, stages: impl IntoIterator<Item = Stage>) {
        self.stages = stages.into_iter().collect();
        self.begin_stage();
    }

    pub(super) fn end_stage(&mut self) {
        self.stage_ends = None;
        if self.stages.is_empty() {
            self.stages_over();
        } else {
            self.begin_stage();
        }
    }

    fn begin_stage(&mut self) {
        self.stage_ends = None;
        let Some(stage) = self.stages.pop_front() else {
            return;
        };
        self.motions += 1;
        let is_moving = self.body.pose_at(self.now).speed_mps > 0.0;
        let rests = matches!(
            stage,
            Stage::Climb { .. } | Stage::Stand(_) | Stage::Touchdown
        );
        if rests && is_moving {
            // What is done on the spot waits until it stands.
            self.stages.push_front(stage);
            return self.brake();
        }
        self.halt_climb();
        match stage {
            Stage::Drive { corners, speed_mps } => self.drive(&corners, speed_mps),
            Stage::Turn(heading) => {
                // Checked when it was asked for; a body refuses nothing else.
                let _ = self.body.turn(self.now, heading);
                self.ends_with_motion();
            }
            Stage::Climb { to_m, rate_mps } => {
                let from_m = self.climb.altitude_m(self.now);
                self.climb = Climb {
                    since: self.now,
                    from_m,
                    to_m,
                    rate_mps,
                };
                self.stage_ends = Some(self.climb.until());
            }
            Stage::Stand(time) => self.stage_ends = Some(self.now + time),
            Stage::Brake => self.brake(),
            Stage::Touchdown => self.touch_down(),
        }
    }

    /// A climb that is given up ends where it is.
    fn halt_climb(&mut self) {
        let altitude_m = if self.now >= self.climb.until() {
            self.climb.to_m
        } else {
            self.climb.altitude_m(self.now)
        };
        self.climb = Climb {
            since: self.now,
            ..Climb::level(altitude_m)
        };
    }

    fn brake(&mut self) {
        self.body.stop(self.now);
        self.halt_climb();
        self.ends_with_motion();
    }

    fn ends_with_motion(&mut self) {
        self.stage_ends = Some(self.body.arrival().unwrap_or(self.now).max(self.now));
    }

    /// Steers so that the believed place goes through the corners; a steady wind carries it aside.
    fn drive(&mut self, corners: &[Point], speed_mps: f64) {
        let error = self.place_error(self.now);
        let truly: Vec<Point> = match self.settings.kind {
            VehicleKind::Rover => corners.iter().map(|corner| *corner - error).collect(),
            VehicleKind::Copter => corners
                .iter()
                .map(|corner| *corner - error + self.carried())
                .collect(),
        };
        // An impossible command leaves the motion as it was.
        let _ = self.body.drive(self.now, &truly, speed_mps);
        self.ends_with_motion();
    }

    pub(super) fn carried(&self) -> Vector {
        self.settings.wind * CARRIED_S
    }

    fn touch_down(&mut self) {
        self.climb = Climb {
            since: self.now,
            ..Climb::level(0.0)
        };
        // A mission says first that it was reached; then it goes on, or is over.
        if !(self.mode == FlightMode::Auto && self.is_mission_running) {
            self.disarm();
        }
        self.stage_ends = Some(self.now);
    }

    /// All stages are over: the mission goes on, or it stays where it is.
    fn stages_over(&mut self) {
        if self.mode == FlightMode::Auto && self.is_mission_running {
            self.say(StatusText::Reached(self.item));
            self.next_item();
        }
    }

    /// The way to a place and an altitude: up before the way, down after it.
    pub(super) fn way_to(
        &self,
        corners: Vec<Point>,
        altitude_m: f64,
        speed_mps: f64,
    ) -> Vec<Stage> {
        let drive = Stage::Drive { corners, speed_mps };
        match self.change_of_altitude(altitude_m) {
            None => vec![drive],
            Some(climb) if altitude_m > self.climb.altitude_m(self.now) => vec![climb, drive],
            Some(sinking) => vec![drive, sinking],
        }
    }

    fn change_of_altitude(&self, to_m: f64) -> Option<Stage> {
        let (from_m, settings) = (self.climb.altitude_m(self.now), &self.settings);
        let rate_mps = if to_m > from_m {
            settings.climb_mps
        } else {
            settings.descent_mps
        };
        let changes = settings.kind == VehicleKind::Copter && (to_m - from_m).abs() > 1e-6;
        changes.then_some(Stage::Climb { to_m, rate_mps })
    }

    /// Down to the ground, slowly at last.
    pub(super) fn way_down(&self, from_m: f64) -> Vec<Stage> {
        let (descent_mps, landing_mps) = (self.settings.descent_mps, self.settings.landing_mps);
        let fast = (from_m > SLOW_BELOW_M).then_some(Stage::Climb {
            to_m: SLOW_BELOW_M,
            rate_mps: descent_mps,
        });
        let slow = Stage::Climb {
            to_m: 0.0,
            rate_mps: landing_mps,
        };
        fast.into_iter().chain([slow, Stage::Touchdown]).collect()
    }

    /// Straight home; a copter not below the altitude of its return, and down there.
    pub(super) fn way_home(&self, home: Point) -> Vec<Stage> {
        let here_m = self.climb.altitude_m(self.now);
        let home_at_speed = |altitude_m| self.way_to(vec![home], altitude_m, self.speed_mps);
        match self.settings.kind {
            VehicleKind::Rover => home_at_speed(0.0),
            VehicleKind::Copter if here_m <= LANDED_M => vec![Stage::Touchdown],
            VehicleKind::Copter => {
                let high_m = here_m.max(self.settings.return_m);
                let mut stages = home_at_speed(high_m);
                stages.push(Stage::Stand(HOVERS));
                stages.extend(self.way_down(high_m));
                stages
            }
        }
    }

    pub(super) fn disarm(&mut self) {
        self.stages.clear();
        self.is_mission_running = false;
        // Motors without current brake.
        self.body.stop(self.now);
        self.motions += 1;
        self.stage_ends = None;
        if std::mem::take(&mut self.is_armed) {
            self.say(StatusText::Armed(false));
        }
    }

    /// Returns when nothing of what is under way moves any more.
    pub(super) fn ends(&self) -> Option<Time> {
        self.stage_ends
    }
}
