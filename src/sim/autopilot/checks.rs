//! Which command is taken, and when an autopilot says no; what it does when a failsafe trips. It judges by what is so at a
//! moment and says what is to be done; it does nothing itself.

use super::messages::{AutopilotSettings, LowBattery};
use super::stages::{Stage, StagePlanner};
use crate::autopilot::item::{check_items, is_altitude, is_output, is_place, is_speed};
use crate::autopilot::{ArmRefusal, Command, CommandAck, FlightMode, Item, VehicleKind};
use crate::geom::{Point, Vector};

/// A velocity holds for this long after it was said last, seconds.
const VELOCITY_HOLDS_S: f64 = 3.0;
/// Slower than this is standing, m/s.
const STANDING_MPS: f64 = 0.001;

/// What is to be done.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum Action {
    Nothing,
    Enter(FlightMode),
    Arm,
    Disarm,
    /// Give up what is under way for these stages.
    Lay(Vec<Stage>),
    StoreMission(Vec<Item>),
    /// Begin the stored mission at its first item after home.
    BeginMission,
    SetItem(usize),
    SetSpeed(f64),
    SetServo {
        channel: u8,
        pulse_us: u16,
    },
    SetHome(Point),
}

/// Why an autopilot acts by itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Failsafe {
    BatteryLow,
    BatteryEmpty,
    PlaceLost,
}

/// What is so at the moment of a command or a failsafe.
#[derive(Clone, Debug)]
pub(super) struct Situation<'a> {
    pub settings: &'a AutopilotSettings,
    pub mode: FlightMode,
    pub is_armed: bool,
    pub is_landed: bool,
    /// Whether a stage is under way.
    pub is_under_way: bool,
    /// Whether it has started up.
    pub is_ready: bool,
    pub has_place: bool,
    pub is_battery_empty: bool,
    /// Where it believes to be.
    pub at: Point,
    /// Metres above home.
    pub altitude_m: f64,
    /// How fast it travels unless it is told otherwise, m/s.
    pub speed_mps: f64,
    pub mission: MissionSituation,
}

/// What is so of the stored mission.
#[derive(Clone, Copy, Debug)]
pub(super) struct MissionSituation {
    /// How many items it has.
    pub items: usize,
    pub is_running: bool,
    /// The first item with which it would go on that takes time.
    pub next_lasting_item: Option<Item>,
}

impl Situation<'_> {
    /// Returns what a command lets it do.
    ///
    /// # Errors
    /// The answer that the command is not taken.
    pub(super) fn judge(&self, command: Command) -> Result<Action, CommandAck> {
        match command {
            Command::Mode(mode) => self.change_of_mode(mode),
            Command::Arm { .. } if self.is_armed => Ok(Action::Nothing),
            Command::Arm { force } => {
                let refusal = self.arm_refusal(force);
                refusal.map_or(Ok(Action::Arm), |_| Err(CommandAck::Failed))
            }
            Command::Disarm { force } if !force && !self.is_landed => Err(CommandAck::Failed),
            Command::Disarm { .. } => Ok(Action::Disarm),
            Command::Takeoff { altitude_m } => self.takeoff(altitude_m),
            Command::Route {
                corners,
                altitude_m,
                speed_mps,
            } => self.route(corners, altitude_m, speed_mps),
            Command::Velocity(velocity) => self.velocity(velocity),
            Command::Yaw(heading) if !heading.radians().is_finite() => Err(CommandAck::Denied),
            Command::Yaw(heading) => self.guided(|| vec![Stage::Turn(heading)]),
            Command::Stop => self.guided(|| vec![Stage::Brake]),
            Command::Upload(items) => check_items(&items, self.settings.kind)
                .map_err(|_| CommandAck::Denied)
                .map(|()| Action::StoreMission(items)),
            Command::Clear => Ok(Action::StoreMission(Vec::new())),
            Command::Begin => self.begin(),
            Command::SetCurrent(item) if item >= self.mission.items => Err(CommandAck::Denied),
            Command::SetCurrent(item) => Ok(Action::SetItem(item)),
            Command::Speed(speed_mps) if !is_speed(speed_mps) => Err(CommandAck::Denied),
            Command::Speed(speed_mps) => Ok(Action::SetSpeed(speed_mps)),
            Command::Servo { channel, pulse_us } if !is_output(channel, pulse_us) => {
                Err(CommandAck::Denied)
            }
            Command::Servo { channel, pulse_us } => Ok(Action::SetServo { channel, pulse_us }),
            Command::SetHome(at) if !is_place(at) => Err(CommandAck::Denied),
            Command::SetHome(at) => Ok(Action::SetHome(at)),
        }
    }

    /// Returns why it would not arm now; `None` when it would, or is armed. An empty battery cannot be forced.
    pub(super) fn arm_refusal(&self, force: bool) -> Option<ArmRefusal> {
        if self.is_armed {
            return None;
        }
        if self.is_battery_empty {
            return Some(ArmRefusal::BatteryEmpty);
        }
        if force {
            return None;
        }
        if !self.is_ready {
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
        (self.mode.needs_place() && !self.has_place).then_some(ArmRefusal::NoPlace)
    }

    /// Returns what a failsafe that trips lets it do.
    pub(super) fn reaction(&self, failsafe: Failsafe) -> Action {
        let kind = self.settings.kind;
        match failsafe {
            Failsafe::BatteryLow if !self.is_armed => Action::Nothing,
            Failsafe::BatteryLow => match (self.settings.on_low_battery, kind) {
                (LowBattery::Warn, _) => Action::Nothing,
                (LowBattery::Return, _) if self.has_place => Action::Enter(FlightMode::Return),
                (LowBattery::Return | LowBattery::Land, _) => Action::Enter(stays_down(kind)),
            },
            // Without current a rover brakes; a copter sinks with what is left.
            Failsafe::BatteryEmpty if self.is_landed => Action::Disarm,
            Failsafe::BatteryEmpty => Action::Enter(FlightMode::Land),
            // Who does not know its place any more stands, or comes down where it is.
            Failsafe::PlaceLost if self.is_armed && self.mode.needs_place() => {
                Action::Enter(stays_down(kind))
            }
            Failsafe::PlaceLost => Action::Nothing,
        }
    }

    fn change_of_mode(&self, mode: FlightMode) -> Result<Action, CommandAck> {
        let is_missing = !mode.is_of(self.settings.kind);
        let is_blind = mode.needs_place() && !self.has_place;
        if is_missing || is_blind || (mode == FlightMode::Auto && !self.can_begin()) {
            return Err(CommandAck::Failed);
        }
        // Said again it changes nothing: a mission goes on.
        Ok(if mode == self.mode {
            Action::Nothing
        } else {
            Action::Enter(mode)
        })
    }

    /// Returns whether there is a mission that could be flown from here: from the ground a copter must take off first.
    fn can_begin(&self) -> bool {
        let stands = self.settings.kind == VehicleKind::Copter && self.is_armed && self.is_landed;
        match self.mission.next_lasting_item {
            None => false,
            Some(first) => !stands || matches!(first, Item::Takeoff { .. }),
        }
    }

    fn begin(&self) -> Result<Action, CommandAck> {
        if !self.is_armed || !self.has_place || !self.can_begin() {
            return Err(CommandAck::Failed);
        }
        Ok(match self.mode {
            FlightMode::Auto if self.mission.is_running => Action::Nothing,
            FlightMode::Auto => Action::BeginMission,
            FlightMode::Manual
            | FlightMode::Hold
            | FlightMode::Loiter
            | FlightMode::Guided
            | FlightMode::Return
            | FlightMode::Land => Action::Enter(FlightMode::Auto),
        })
    }

    fn takeoff(&self, altitude_m: f64) -> Result<Action, CommandAck> {
        if self.settings.kind == VehicleKind::Rover {
            return Err(CommandAck::Unsupported);
        }
        if !(altitude_m > 0.0 && is_altitude(altitude_m)) {
            return Err(CommandAck::Denied);
        }
        if !self.is_landed || self.is_under_way {
            return Err(CommandAck::Failed);
        }
        self.guided(|| vec![self.planner(self.speed_mps).takeoff(altitude_m)])
    }

    fn route(
        &self,
        corners: Vec<Point>,
        altitude_m: Option<f64>,
        speed_mps: Option<f64>,
    ) -> Result<Action, CommandAck> {
        let speed_mps = speed_mps.unwrap_or(self.speed_mps);
        let are_sound =
            corners.iter().all(|corner| is_place(*corner)) && altitude_m.is_none_or(is_altitude);
        if !are_sound || speed_mps.is_nan() || speed_mps < STANDING_MPS {
            return Err(CommandAck::Denied);
        }
        if self.settings.kind == VehicleKind::Copter && self.is_landed {
            return Err(CommandAck::Failed);
        }
        let altitude_m = altitude_m.unwrap_or(self.altitude_m);
        self.guided(|| self.planner(speed_mps).route(corners, altitude_m))
    }

    /// Moves along a velocity so far that it has come to rest after the time for which it holds and that of braking.
    fn velocity(&self, velocity: Vector) -> Result<Action, CommandAck> {
        let speed_mps = velocity.length_m();
        if !speed_mps.is_finite() {
            return Err(CommandAck::Denied);
        }
        if speed_mps < STANDING_MPS {
            return self.guided(|| vec![Stage::Brake]);
        }
        let limits = &self.settings.limits;
        let top_mps = speed_mps.min(limits.speed_mps);
        let way_m = top_mps * VELOCITY_HOLDS_S + limits.stopping_distance_m(top_mps);
        let goal = self.at + velocity * (way_m / speed_mps);
        self.route(vec![goal], None, Some(top_mps))
    }

    fn guided(&self, stages: impl FnOnce() -> Vec<Stage>) -> Result<Action, CommandAck> {
        if self.mode != FlightMode::Guided || !self.is_armed {
            return Err(CommandAck::Failed);
        }
        Ok(Action::Lay(stages()))
    }

    fn planner(&self, speed_mps: f64) -> StagePlanner<'_> {
        StagePlanner {
            settings: self.settings,
            altitude_m: self.altitude_m,
            speed_mps,
        }
    }
}

/// Returns the mode in which a kind of vehicle neither needs a place nor goes anywhere.
fn stays_down(kind: VehicleKind) -> FlightMode {
    match kind {
        VehicleKind::Rover => FlightMode::Hold,
        VehicleKind::Copter => FlightMode::Land,
    }
}

#[cfg(test)]
mod tests {
    use CommandAck::{Denied, Failed, Unsupported};

    use super::super::tests::LIMITS;
    use super::*;
    use crate::geom::Angle;

    const TAKEOFF: Item = Item::Takeoff { altitude_m: 3.0 };

    fn settings(kind: VehicleKind) -> AutopilotSettings {
        AutopilotSettings::new(kind, LIMITS)
    }

    /// Armed in GUIDED, in the air if it flies, without a mission.
    fn guided(settings: &AutopilotSettings) -> Situation<'_> {
        Situation {
            settings,
            mode: FlightMode::Guided,
            is_armed: true,
            is_landed: settings.kind == VehicleKind::Rover,
            is_under_way: false,
            is_ready: true,
            has_place: true,
            is_battery_empty: false,
            at: Point::new(1.0, 2.0),
            altitude_m: if settings.kind == VehicleKind::Rover {
                0.0
            } else {
                5.0
            },
            speed_mps: 1.0,
            mission: MissionSituation {
                items: 0,
                is_running: false,
                next_lasting_item: None,
            },
        }
    }

    fn with_mission(situation: Situation<'_>, next: Item) -> Situation<'_> {
        let mission = MissionSituation {
            items: 4,
            next_lasting_item: Some(next),
            ..situation.mission
        };
        Situation {
            mission,
            ..situation
        }
    }

    fn route(corners: Vec<Point>) -> Command {
        Command::Route {
            corners,
            altitude_m: None,
            speed_mps: None,
        }
    }

    #[test]
    fn only_who_is_armed_in_guided_goes_where_it_is_told() {
        let settings = settings(VehicleKind::Rover);
        let armed = guided(&settings);
        let disarmed = Situation {
            is_armed: false,
            ..guided(&settings)
        };
        let holding = Situation {
            mode: FlightMode::Hold,
            ..guided(&settings)
        };
        let corner = Point::new(3.0, 0.0);
        let turn = Command::Yaw(Angle::from_degrees(10.0));
        for command in [route(vec![corner]), Command::Stop, turn] {
            assert!(
                matches!(armed.judge(command.clone()), Ok(Action::Lay(_))),
                "{command:?}"
            );
            assert_eq!(disarmed.judge(command.clone()), Err(Failed), "{command:?}");
            assert_eq!(holding.judge(command.clone()), Err(Failed), "{command:?}");
        }
        assert_eq!(
            holding.judge(route(vec![Point::new(f64::NAN, 0.0)])),
            Err(Denied)
        );
        assert_eq!(
            armed.judge(Command::Takeoff { altitude_m: 2.0 }),
            Err(Unsupported)
        );
    }

    #[test]
    fn a_velocity_leads_as_far_as_three_seconds_and_braking_need_and_no_faster_than_it_can() {
        let settings = settings(VehicleKind::Rover);
        let judged = guided(&settings).judge(Command::Velocity(Vector::new(0.0, 4.0)));
        let Ok(Action::Lay(stages)) = judged else {
            panic!("{judged:?}")
        };
        let [Stage::Drive { corners, speed_mps }] = &stages[..] else {
            panic!("{stages:?}")
        };
        // 3 s at 2 m/s, and 2 m of braking.
        assert_eq!((corners[0], *speed_mps), (Point::new(1.0, 10.0), 2.0));
        let still = guided(&settings).judge(Command::Velocity(Vector::default()));
        assert_eq!(still, Ok(Action::Lay(vec![Stage::Brake])));
    }

    #[test]
    fn a_copter_takes_off_from_the_ground_and_goes_nowhere_before() {
        let settings = settings(VehicleKind::Copter);
        let takeoff = Command::Takeoff { altitude_m: 4.0 };
        let landed = Situation {
            is_landed: true,
            altitude_m: 0.0,
            ..guided(&settings)
        };
        assert!(matches!(landed.judge(takeoff.clone()), Ok(Action::Lay(_))));
        assert_eq!(landed.judge(route(vec![Point::default()])), Err(Failed));
        assert_eq!(guided(&settings).judge(takeoff.clone()), Err(Failed));
        let climbing = Situation {
            is_under_way: true,
            ..landed.clone()
        };
        assert_eq!(climbing.judge(takeoff), Err(Failed));
        assert_eq!(
            landed.judge(Command::Takeoff { altitude_m: 0.0 }),
            Err(Denied)
        );
        assert_eq!(
            landed.judge(Command::Disarm { force: false }),
            Ok(Action::Disarm)
        );
        assert_eq!(
            guided(&settings).judge(Command::Disarm { force: false }),
            Err(Failed)
        );
        assert_eq!(
            guided(&settings).judge(Command::Disarm { force: true }),
            Ok(Action::Disarm)
        );
    }

    #[test]
    fn a_mode_is_taken_once_and_where_it_can_be() {
        let (rover, copter) = (settings(VehicleKind::Rover), settings(VehicleKind::Copter));
        let mode = |situation: Situation<'_>, mode| situation.judge(Command::Mode(mode));
        assert_eq!(
            mode(guided(&rover), FlightMode::Guided),
            Ok(Action::Nothing)
        );
        assert_eq!(
            mode(guided(&rover), FlightMode::Hold),
            Ok(Action::Enter(FlightMode::Hold))
        );
        assert_eq!(mode(guided(&copter), FlightMode::Hold), Err(Failed));
        assert_eq!(
            mode(guided(&rover), FlightMode::Auto),
            Err(Failed),
            "there is no mission"
        );
        let lost = Situation {
            has_place: false,
            ..guided(&rover)
        };
        assert_eq!(mode(lost.clone(), FlightMode::Return), Err(Failed));
        assert_eq!(
            mode(lost, FlightMode::Manual),
            Ok(Action::Enter(FlightMode::Manual))
        );
        let landed = Situation {
            is_landed: true,
            ..guided(&copter)
        };
        let auto = Ok(Action::Enter(FlightMode::Auto));
        assert_eq!(
            mode(with_mission(landed.clone(), Item::Return), FlightMode::Auto),
            Err(Failed)
        );
        assert_eq!(mode(with_mission(landed, TAKEOFF), FlightMode::Auto), auto);
        assert_eq!(
            mode(
                with_mission(guided(&copter), Item::Return),
                FlightMode::Auto
            ),
            auto
        );
    }

    #[test]
    fn a_mission_is_begun_once() {
        let settings = settings(VehicleKind::Rover);
        let begin = |mode, is_running| {
            let mut situation = with_mission(guided(&settings), Item::Return);
            (situation.mode, situation.mission.is_running) = (mode, is_running);
            situation.judge(Command::Begin)
        };
        assert_eq!(
            begin(FlightMode::Guided, false),
            Ok(Action::Enter(FlightMode::Auto))
        );
        assert_eq!(begin(FlightMode::Auto, false), Ok(Action::BeginMission));
        assert_eq!(begin(FlightMode::Auto, true), Ok(Action::Nothing));
        assert_eq!(guided(&settings).judge(Command::Begin), Err(Failed));
    }

    #[test]
    fn what_makes_no_sense_is_denied() {
        let settings = settings(VehicleKind::Rover);
        let situation = with_mission(guided(&settings), Item::Return);
        let servo = |channel, pulse_us| situation.judge(Command::Servo { channel, pulse_us });
        assert_eq!(
            (servo(0, 1500), servo(1, 60_000)),
            (Err(Denied), Err(Denied))
        );
        assert_eq!(
            servo(9, 1500),
            Ok(Action::SetServo {
                channel: 9,
                pulse_us: 1500
            })
        );
        assert_eq!(situation.judge(Command::SetCurrent(4)), Err(Denied));
        assert_eq!(
            situation.judge(Command::SetCurrent(3)),
            Ok(Action::SetItem(3))
        );
        assert_eq!(situation.judge(Command::Speed(-1.0)), Err(Denied));
        assert_eq!(
            situation.judge(Command::Upload(vec![Item::Return])),
            Err(Denied)
        );
        let cleared = situation.judge(Command::Clear);
        assert_eq!(cleared, Ok(Action::StoreMission(Vec::new())));
    }

    #[test]
    fn it_is_armed_unless_something_is_in_the_way() {
        let (rover, copter) = (settings(VehicleKind::Rover), settings(VehicleKind::Copter));
        let disarmed = |settings| Situation {
            is_armed: false,
            ..guided(settings)
        };
        assert_eq!(disarmed(&rover).arm_refusal(false), None);
        let starting = Situation {
            is_ready: false,
            ..disarmed(&rover)
        };
        assert_eq!(starting.arm_refusal(false), Some(ArmRefusal::NotReady));
        assert_eq!(starting.arm_refusal(true), None);
        let empty = Situation {
            is_battery_empty: true,
            ..disarmed(&rover)
        };
        assert_eq!(empty.arm_refusal(true), Some(ArmRefusal::BatteryEmpty));
        assert_eq!(empty.judge(Command::Arm { force: true }), Err(Failed));
        let lost = Situation {
            has_place: false,
            ..disarmed(&rover)
        };
        assert_eq!(lost.arm_refusal(false), Some(ArmRefusal::NoPlace));
        let auto = |settings| Situation {
            mode: FlightMode::Auto,
            ..disarmed(settings)
        };
        assert_eq!(auto(&rover).arm_refusal(false), None);
        assert_eq!(
            auto(&copter).arm_refusal(false),
            Some(ArmRefusal::Mode(FlightMode::Auto))
        );
        assert_eq!(
            guided(&rover).judge(Command::Arm { force: false }),
            Ok(Action::Nothing)
        );
    }

    #[test]
    fn a_failsafe_lets_a_rover_stand_and_a_copter_come_down() {
        for (kind, down) in [
            (VehicleKind::Rover, FlightMode::Hold),
            (VehicleKind::Copter, FlightMode::Land),
        ] {
            let plain = settings(kind);
            let react = |on_low_battery, has_place, failsafe| {
                let settings = AutopilotSettings {
                    on_low_battery,
                    ..plain
                };
                Situation {
                    has_place,
                    ..guided(&settings)
                }
                .reaction(failsafe)
            };
            let low = |choice, has_place| react(choice, has_place, Failsafe::BatteryLow);
            assert_eq!(low(LowBattery::Warn, true), Action::Nothing);
            assert_eq!(
                low(LowBattery::Return, true),
                Action::Enter(FlightMode::Return)
            );
            assert_eq!(low(LowBattery::Return, false), Action::Enter(down));
            assert_eq!(low(LowBattery::Land, true), Action::Enter(down));
            let lost = react(LowBattery::Warn, false, Failsafe::PlaceLost);
            assert_eq!(lost, Action::Enter(down));
            let needs_none = Situation {
                mode: FlightMode::Manual,
                ..guided(&plain)
            };
            assert_eq!(needs_none.reaction(Failsafe::PlaceLost), Action::Nothing);
            let empty = react(LowBattery::Warn, true, Failsafe::BatteryEmpty);
            let expected = if kind == VehicleKind::Rover {
                Action::Disarm
            } else {
                Action::Enter(FlightMode::Land)
            };
            assert_eq!(empty, expected);
        }
    }
}
