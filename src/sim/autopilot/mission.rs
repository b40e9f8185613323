//! AUTO: the stored mission, item after item.

use super::messages::StatusText;
use super::stages::Stage;
use super::{Autopilot, FlightMode, Item, VehicleKind};

impl Autopilot {
    /// Begins the mission at its first item after home, or goes on with the one that was under way.
    pub(super) fn run_mission(&mut self) {
        self.is_mission_running = true;
        let from = self.item.max(1);
        self.begin_from(from);
    }

    /// Goes on with an item; those that take no time are done at once, on the way to the next that does.
    pub(super) fn begin_from(&mut self, first: usize) {
        let mut index = first;
        while let Some(item) = self.items.get(index).copied() {
            self.item = index;
            self.say(StatusText::Begun(index));
            match item {
                Item::Speed(speed_mps) => self.speed_mps = speed_mps,
                Item::Servo { channel, pulse_us } => {
                    self.servos.insert(channel, pulse_us);
                }
                Item::Waypoint { .. }
                | Item::Takeoff { .. }
                | Item::Loiter { .. }
                | Item::Delay(_)
                | Item::Land { .. }
                | Item::Return
                | Item::Yaw(_) => return self.lay_item(item),
            }
            index += 1;
        }
        self.mission_over();
    }

    pub(super) fn next_item(&mut self) {
        if self.is_mission_running {
            self.begin_from(self.item + 1);
        }
    }

    fn lay_item(&mut self, item: Item) {
        let here_m = self.climb.altitude_m(self.now);
        let level_m = |altitude_m: f64| match self.settings.kind {
            VehicleKind::Rover => 0.0,
            VehicleKind::Copter => altitude_m.max(0.0),
        };
        let stages = match item {
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
                let mut stages = self.way_to(vec![at], level_m(altitude_m), self.speed_mps);
                stages.extend((!time.is_zero()).then_some(Stage::Stand(time)));
                stages
            }
            Item::Takeoff { altitude_m } => {
                let higher_m = altitude_m.max(here_m);
                vec![Stage::Climb {
                    to_m: higher_m,
                    rate_mps: self.settings.climb_mps,
                }]
            }
            Item::Delay(time) => vec![Stage::Stand(time)],
            Item::Land { at } => {
                let mut stages = at.map_or(Vec::new(), |at| {
                    self.way_to(vec![at], here_m, self.speed_mps)
                });
                stages.extend(self.way_down(here_m));
                stages
            }
            Item::Return => match self.home {
                Some(home) => self.way_home(home),
                None => vec![Stage::Brake],
            },
            Item::Yaw(heading) => vec![Stage::Turn(heading)],
            // Done at once, before.
            Item::Speed(_) | Item::Servo { .. } => Vec::new(),
        };
        self.lay(stages);
    }

    /// A rover holds after its mission, a copter in the air stays where it is, one on the ground is disarmed.
    fn mission_over(&mut self) {
        self.is_mission_running = false;
        self.item = self.items.len().saturating_sub(1);
        self.say(StatusText::MissionDone);
        match self.settings.kind {
            VehicleKind::Rover => self.enter(FlightMode::Hold),
            VehicleKind::Copter if self.is_landed(self.now) => self.disarm(),
            VehicleKind::Copter => {}
        }
    }
}
