//! The stages of motion (drive, turn, climb, stand), and how ways are laid as stages: to a place, home, down to the ground, and
//! for an item of a mission. It computes only: what moves, when, and in which mode is not known here.

use std::time::Duration;

use super::flight::LANDED_M;
use super::messages::AutopilotSettings;
use crate::autopilot::{Item, VehicleKind};
use crate::geom::{Angle, Point};

/// Where a landing becomes slow, metres.
const SLOW_BELOW_M: f64 = 10.0;
/// Time over home before a copter that returns comes down.
const HOVERS: Duration = Duration::from_secs(5);

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

impl Stage {
    /// Returns whether it begins only at rest.
    pub(super) fn is_done_at_rest(&self) -> bool {
        match self {
            Stage::Climb { .. } | Stage::Stand(_) | Stage::Touchdown => true,
            Stage::Drive { .. } | Stage::Turn(_) | Stage::Brake => false,
        }
    }
}

/// Lays ways as stages, for a vehicle at an altitude.
#[derive(Clone, Copy, Debug)]
pub(super) struct StagePlanner<'a> {
    pub settings: &'a AutopilotSettings,
    /// Where it is now, metres above home.
    pub altitude_m: f64,
    /// How fast it travels, m/s.
    pub speed_mps: f64,
}

impl StagePlanner<'_> {
    /// Returns the way through places to an altitude: up before the way, down after it.
    pub(super) fn route(&self, corners: Vec<Point>, altitude_m: f64) -> Vec<Stage> {
        let speed_mps = self.speed_mps;
        let drive = Stage::Drive { corners, speed_mps };
        match self.change_of_altitude(altitude_m) {
            None => vec![drive],
            Some(climb) if altitude_m > self.altitude_m => vec![climb, drive],
            Some(sinking) => vec![drive, sinking],
        }
    }

    fn change_of_altitude(&self, to_m: f64) -> Option<Stage> {
        let (from_m, settings) = (self.altitude_m, self.settings);
        let rate_mps = if to_m > from_m {
            settings.climb_mps
        } else {
            settings.descent_mps
        };
        let changes = settings.kind == VehicleKind::Copter && (to_m - from_m).abs() > 1e-6;
        changes.then_some(Stage::Climb { to_m, rate_mps })
    }

    /// Returns the way up on the spot.
    pub(super) fn takeoff(&self, to_m: f64) -> Stage {
        Stage::Climb {
            to_m,
            rate_mps: self.settings.climb_mps,
        }
    }

    /// Returns the way from an altitude down to the ground, slow at last.
    pub(super) fn landing(&self, from_m: f64) -> Vec<Stage> {
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

    /// Returns the way straight home; a copter flies it not below the altitude of its return, and comes down there.
    pub(super) fn way_home(&self, home: Point) -> Vec<Stage> {
        match self.settings.kind {
            VehicleKind::Rover => self.route(vec![home], 0.0),
            VehicleKind::Copter if self.altitude_m <= LANDED_M => vec![Stage::Touchdown],
            VehicleKind::Copter => {
                let high_m = self.altitude_m.max(self.settings.return_m);
                let mut stages = self.route(vec![home], high_m);
                stages.push(Stage::Stand(HOVERS));
                stages.extend(self.landing(high_m));
                stages
            }
        }
    }

    /// Returns the stages of an item of a mission; none of one that takes no time. Without a home a return only brakes.
    pub(super) fn item(&self, item: Item, home: Option<Point>) -> Vec<Stage> {
        let here_m = self.altitude_m;
        let level_m = |altitude_m: f64| match self.settings.kind {
            VehicleKind::Rover => 0.0,
            VehicleKind::Copter => altitude_m.max(0.0),
        };
        match item {
            Item::Waypoint {
                at,
                altitude_m,
                delay: time,
            }
            | Item::Loiter {
                at,
                altitude_m,
                time,
            } => {
                let mut stages = self.route(vec![at], level_m(altitude_m));
                stages.extend((!time.is_zero()).then_some(Stage::Stand(time)));
                stages
            }
            Item::Takeoff { altitude_m } => vec![self.takeoff(altitude_m.max(here_m))],
            Item::Delay(time) => vec![Stage::Stand(time)],
            Item::Land { at } => {
                let mut stages = at.map_or(Vec::new(), |at| self.route(vec![at], here_m));
                stages.extend(self.landing(here_m));
                stages
            }
            Item::Return => home.map_or(vec![Stage::Brake], |home| self.way_home(home)),
            Item::Yaw(heading) => vec![Stage::Turn(heading)],
            Item::Speed(_) | Item::Servo { .. } | Item::Jump { .. } | Item::Other { .. } => {
                Vec::new()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::LIMITS;
    use super::*;

    fn planned(
        kind: VehicleKind,
        altitude_m: f64,
        plan: impl Fn(&StagePlanner<'_>) -> Vec<Stage>,
    ) -> String {
        let settings = AutopilotSettings::new(kind, LIMITS);
        let stages = plan(&StagePlanner {
            settings: &settings,
            altitude_m,
            speed_mps: 1.5,
        });
        let word = |stage: &Stage| match stage {
            Stage::Drive { corners, speed_mps } => {
                format!("drive {} at {speed_mps}", corners.len())
            }
            Stage::Turn(heading) => format!("turn {:.0}", heading.degrees()),
            Stage::Climb { to_m, rate_mps } => format!("climb {to_m} at {rate_mps}"),
            Stage::Stand(time) => format!("stand {}", time.as_secs()),
            Stage::Brake => "brake".to_owned(),
            Stage::Touchdown => "touchdown".to_owned(),
        };
        stages.iter().map(word).collect::<Vec<_>>().join(", ")
    }

    fn check(kind: VehicleKind, altitude_m: f64, item: Item, expected: &str) {
        let home = Some(Point::new(1.0, 1.0));
        let got = planned(kind, altitude_m, |planner| planner.item(item, home));
        assert_eq!(got, expected, "{item:?} from {altitude_m} m");
    }

    fn waypoint(altitude_m: f64, delay_s: u64) -> Item {
        Item::Waypoint {
            at: Point::new(5.0, 0.0),
            altitude_m,
            delay: Duration::from_secs(delay_s),
        }
    }

    #[test]
    fn a_copter_climbs_before_its_way_and_sinks_after_it_and_a_rover_does_neither() {
        let (rover, copter) = (VehicleKind::Rover, VehicleKind::Copter);
        check(
            copter,
            3.0,
            waypoint(8.0, 0),
            "climb 8 at 2.5, drive 1 at 1.5",
        );
        check(
            copter,
            8.0,
            waypoint(3.0, 4),
            "drive 1 at 1.5, climb 3 at 1.5, stand 4",
        );
        check(
            copter,
            8.0,
            waypoint(-3.0, 0),
            "drive 1 at 1.5, climb 0 at 1.5",
        );
        check(rover, 0.0, waypoint(8.0, 0), "drive 1 at 1.5");
    }

    #[test]
    fn a_landing_becomes_slow_below_ten_metres_and_ends_on_the_ground() {
        let land = Item::Land { at: None };
        check(
            VehicleKind::Copter,
            12.0,
            land,
            "climb 10 at 1.5, climb 0 at 0.5, touchdown",
        );
        check(VehicleKind::Copter, 10.0, land, "climb 0 at 0.5, touchdown");
    }

    #[test]
    fn who_returns_does_so_in_its_way_and_only_with_a_home() {
        let home =
            "climb 15 at 2.5, drive 1 at 1.5, stand 5, climb 10 at 1.5, climb 0 at 0.5, touchdown";
        check(VehicleKind::Copter, 3.0, Item::Return, home);
        check(VehicleKind::Copter, LANDED_M, Item::Return, "touchdown");
        check(VehicleKind::Rover, 0.0, Item::Return, "drive 1 at 1.5");
        let homeless = planned(VehicleKind::Rover, 0.0, |planner| {
            planner.item(Item::Return, None)
        });
        assert_eq!(homeless, "brake");
    }

    #[test]
    fn a_takeoff_never_sinks_and_what_takes_no_time_has_no_stages() {
        let takeoff = Item::Takeoff { altitude_m: 5.0 };
        check(VehicleKind::Copter, 7.0, takeoff, "climb 7 at 2.5");
        check(VehicleKind::Copter, 0.0, takeoff, "climb 5 at 2.5");
        check(VehicleKind::Copter, 0.0, Item::Speed(2.0), "");
        check(
            VehicleKind::Rover,
            0.0,
            Item::Yaw(Angle::from_degrees(90.0)),
            "turn 90",
        );
    }

    #[test]
    fn only_what_leaves_the_place_begins_while_it_moves() {
        let corners = vec![Point::default()];
        let drive = Stage::Drive {
            corners,
            speed_mps: 1.0,
        };
        assert!(!drive.is_done_at_rest() && !Stage::Brake.is_done_at_rest());
        assert!(Stage::Touchdown.is_done_at_rest() && Stage::Stand(HOVERS).is_done_at_rest());
    }
}
