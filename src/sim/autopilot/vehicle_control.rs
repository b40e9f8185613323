//! What a simulated vehicle does: its mode, whether its motors have current, and the motion and the mission that follow from
//! them. It does what it is told without asking whether that is allowed ([`super::checks`]), and knows no battery.
//!
//! ```text
//!   [Manual] [Hold] [Loiter]   it brakes, and stays
//!   [Guided]                   it brakes, and then the stages that are asked for
//!   [Auto]                     the stored mission, item by item; after it a rover enters Hold
//!   [Return]                   home; a copter comes down there
//!   [Land]                     down where it is
//! ```
//!
//! Any mode may follow any other, by a command or a failsafe. Without current nothing moves. After a touchdown the motors
//! are cut, unless a mission has a say in it.

use std::collections::BTreeMap;

use super::super::body::Body;
use super::checks::{Action, MissionSituation};
use super::flight::LANDED_M;
use super::messages::{AutopilotSettings, StatusText};
use super::place_estimate::PlaceEstimate;
use super::staged_motion::StagedMotion;
use super::stages::{Stage, StagePlanner};
use super::status_texts::StatusTexts;
use super::stored_mission::StoredMission;
use crate::autopilot::item::ITEMS_MAX;
use crate::autopilot::{FlightMode, Item, VehicleKind};
use crate::config::CARRIED_S;
use crate::geom::Point;
use crate::time::Time;

/// So many items that take no time are done at one moment; jumps that lead round in circles then end the mission.
const ITEMS_AT_ONCE: usize = 2 * ITEMS_MAX;

/// A vehicle under control.
#[derive(Clone, Debug)]
pub(super) struct VehicleControl {
    mode: FlightMode,
    /// Since when the motors have current; `None` = they have none.
    armed_since: Option<Time>,
    home: Option<Point>,
    /// Speed at which it travels unless it is told otherwise, m/s.
    speed_mps: f64,
    motion: StagedMotion,
    mission: StoredMission,
    servos: BTreeMap<u8, u16>,
}

/// What it must know of the moment in which it acts, and where it says what it does.
pub(super) struct Moment<'a> {
    pub now: Time,
    pub settings: &'a AutopilotSettings,
    pub place: &'a PlaceEstimate,
    pub texts: &'a mut StatusTexts,
}

impl Moment<'_> {
    fn say(&mut self, text: StatusText) {
        self.texts.say(self.now, text);
    }
}

impl VehicleControl {
    /// Takes a body that stands on the ground, disarmed.
    pub(super) fn switched_on(body: Body) -> VehicleControl {
        VehicleControl {
            mode: FlightMode::Manual,
            armed_since: None,
            home: None,
            speed_mps: body.limits().speed_mps,
            motion: StagedMotion::at_rest(body, 0.0),
            mission: StoredMission::default(),
            servos: BTreeMap::new(),
        }
    }

    /// Returns the same vehicle as it stands or hovers at an altitude, metres: armed in GUIDED, home where it is.
    pub(super) fn under_way(self, altitude_m: f64, now: Time) -> VehicleControl {
        VehicleControl {
            mode: FlightMode::Guided,
            armed_since: Some(Time::ZERO),
            home: Some(self.motion.pose_at(now).at),
            motion: StagedMotion::at_rest(self.motion.body().clone(), altitude_m),
            ..self
        }
    }

    /// Returns its mode.
    pub(super) fn mode(&self) -> FlightMode {
        self.mode
    }

    /// Returns whether the motors have current.
    pub(super) fn is_armed(&self) -> bool {
        self.armed_since.is_some()
    }

    /// Returns where home is, if that is known.
    pub(super) fn home(&self) -> Option<Point> {
        self.home
    }

    /// Returns how fast it travels unless it is told otherwise, m/s.
    pub(super) fn speed_mps(&self) -> f64 {
        self.speed_mps
    }

    /// Returns how it moves.
    pub(super) fn motion(&self) -> &StagedMotion {
        &self.motion
    }

    /// Returns the stored mission.
    pub(super) fn mission(&self) -> &StoredMission {
        &self.mission
    }

    /// Returns what is so of the stored mission.
    pub(super) fn mission_situation(&self) -> MissionSituation {
        MissionSituation {
            items: self.mission.items().len(),
            is_running: self.mission.is_running(),
            next_lasting_item: self.mission.next_lasting_item(),
        }
    }

    /// Returns the servo outputs that were set, microseconds by output.
    pub(super) fn servos(&self) -> &BTreeMap<u8, u16> {
        &self.servos
    }

    /// Returns whether it stands on the ground.
    pub(super) fn is_landed(&self, kind: VehicleKind, at: Time) -> bool {
        kind == VehicleKind::Rover || self.motion.altitude_m(at) <= LANDED_M
    }

    /// Returns until when it uses what motion takes; a copter in the air always does, as long as its motors turn.
    pub(super) fn works_until(&self, kind: VehicleKind, now: Time) -> Time {
        let flies = kind == VehicleKind::Copter
            && self.is_armed()
            && (!self.is_landed(kind, now) || self.motion.climb().to_m > LANDED_M);
        if flies {
            Time::NEVER
        } else {
            self.motion.moves_until().max(now)
        }
    }

    /// Returns when it is disarmed because it was armed and has not taken off; `None` = it has, or needs not.
    pub(super) fn idle_until(&self, settings: &AutopilotSettings, now: Time) -> Option<Time> {
        let is_idle = settings.kind == VehicleKind::Copter
            && self.motion.stage_ends().is_none()
            && self.is_landed(settings.kind, now);
        let since = self.armed_since.filter(|_| is_idle)?;
        Some(since + settings.disarm_after)
    }

    /// Does what was found right to be done.
    pub(super) fn act(&mut self, action: Action, moment: &mut Moment<'_>) {
        match action {
            Action::Nothing => {}
            Action::Enter(mode) => self.enter(mode, moment),
            Action::Arm => self.arm(moment),
            Action::Disarm => self.disarm(moment),
            Action::Lay(stages) => self.lay(stages, moment),
            Action::StoreMission(items) => {
                if self.mission.store(items) {
                    self.lay(vec![Stage::Brake], moment);
                }
            }
            Action::BeginMission => {
                self.mission.rewind();
                self.run_mission(moment);
            }
            Action::SetItem(item) => {
                self.mission.set_item(item);
                if self.mode == FlightMode::Auto && self.is_armed() {
                    self.run_mission(moment);
                }
            }
            Action::SetSpeed(speed_mps) => self.speed_mps = speed_mps,
            Action::SetServo { channel, pulse_us } => {
                self.servos.insert(channel, pulse_us);
            }
            Action::SetHome(at) => self.home = Some(at),
        }
    }

    /// Ends the stage under way; after the last one the mission goes on, or it stays where it is.
    pub(super) fn end_stage(&mut self, moment: &mut Moment<'_>) {
        if !self.motion.end_stage() {
            self.begin_stage(moment);
        } else if self.mission.is_running() {
            let item = self.mission.item();
            moment.say(StatusText::Reached(item));
            self.begin_item(item + 1, moment);
        }
    }

    /// Comes to rest at once, against all limits, and gives up everything.
    pub(super) fn wreck(&mut self, at: Time) {
        self.motion.wreck(at);
        self.mission.stop();
    }

    fn enter(&mut self, mode: FlightMode, moment: &mut Moment<'_>) {
        if mode != self.mode {
            self.mode = mode;
            moment.say(StatusText::Mode(mode));
        }
        self.mission.stop();
        if !self.is_armed() {
            return;
        }
        let planner = self.planner(moment);
        let stages = match mode {
            FlightMode::Manual | FlightMode::Hold | FlightMode::Loiter | FlightMode::Guided => {
                vec![Stage::Brake]
            }
            FlightMode::Auto => return self.run_mission(moment),
            FlightMode::Return => {
                let here = self.motion.pose_at(moment.now).at;
                planner.way_home(self.home.unwrap_or(here))
            }
            FlightMode::Land => planner.landing(planner.altitude_m),
        };
        self.lay(stages, moment);
    }

    fn arm(&mut self, moment: &mut Moment<'_>) {
        self.armed_since = Some(moment.now);
        moment.say(StatusText::Armed(true));
        let here = self.motion.pose_at(moment.now).at + moment.place.error(moment.now);
        self.home.get_or_insert(here);
        if self.mode == FlightMode::Auto {
            self.mission.rewind();
            self.run_mission(moment);
        }
    }

    fn disarm(&mut self, moment: &mut Moment<'_>) {
        self.mission.stop();
        // Motors without current brake.
        self.motion.cut(moment.now);
        if self.armed_since.take().is_some() {
            moment.say(StatusText::Armed(false));
        }
    }

    /// Gives up what is under way and lays stages; the first begins now.
    fn lay(&mut self, stages: Vec<Stage>, moment: &mut Moment<'_>) {
        self.motion.lay(stages);
        self.begin_stage(moment);
    }

    fn begin_stage(&mut self, moment: &mut Moment<'_>) {
        let (now, place, settings) = (moment.now, moment.place, moment.settings);
        let carried = (settings.kind == VehicleKind::Copter).then(|| settings.wind * CARRIED_S);
        let steer = |corners: &mut [Point]| place.turn_to_true(now, corners, carried);
        if self.motion.begin_next(now, steer) {
            // A mission says first that it was reached; then it goes on, or is over.
            if !self.mission.is_running() {
                self.disarm(moment);
            }
            self.motion.touch_down(now);
        }
    }

    fn planner<'a>(&self, moment: &Moment<'a>) -> StagePlanner<'a> {
        StagePlanner {
            settings: moment.settings,
            altitude_m: self.motion.altitude_m(moment.now),
            speed_mps: self.speed_mps,
        }
    }

    /// Begins the mission at its first item after home, or goes on with the one that was under way.
    fn run_mission(&mut self, moment: &mut Moment<'_>) {
        let item = self.mission.run();
        self.begin_item(item, moment);
    }

    /// Goes on with an item; those that take no time are done at once, on the way to the next that does.
    fn begin_item(&mut self, first: usize, moment: &mut Moment<'_>) {
        let mut index = first;
        for _ in 0..ITEMS_AT_ONCE {
            let Some(item) = self.mission.begin(index) else {
                break;
            };
            moment.say(StatusText::Begun(index));
            match item {
                Item::Speed(speed_mps) => self.speed_mps = speed_mps,
                Item::Servo { channel, pulse_us } => {
                    self.servos.insert(channel, pulse_us);
                }
                Item::Jump { .. } | Item::Other { .. } => {}
                Item::Waypoint { .. }
                | Item::Takeoff { .. }
                | Item::Loiter { .. }
                | Item::Delay(_)
                | Item::Land { .. }
                | Item::Return
                | Item::Yaw(_) => {
                    let stages = self.planner(moment).item(item, self.home);
                    return self.lay(stages, moment);
                }
            }
            index = self.mission.after(index);
        }
        self.end_mission(moment);
    }

    /// A rover holds after its mission, a copter in the air stays where it is, one on the ground is disarmed.
    fn end_mission(&mut self, moment: &mut Moment<'_>) {
        self.mission.end();
        moment.say(StatusText::MissionDone);
        match moment.settings.kind {
            VehicleKind::Rover => self.enter(FlightMode::Hold, moment),
            VehicleKind::Copter if self.is_landed(VehicleKind::Copter, moment.now) => {
                self.disarm(moment)
            }
            VehicleKind::Copter => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::time::Duration;

    use super::super::messages::DatedText;
    use super::super::navigation::Navigation;
    use super::super::tests::{LIMITS, secs};
    use super::*;
    use crate::actor::tests_support::drawn;
    use crate::geom::Angle;
    use crate::sim::noise::Noise;

    /// Armed in GUIDED at an altitude.
    fn control(altitude_m: f64) -> VehicleControl {
        let body = Body::at_rest(Point::default(), Angle::ZERO, LIMITS).unwrap();
        VehicleControl::switched_on(body).under_way(altitude_m, Time::ZERO)
    }

    /// Does something to it at a moment; returns what it said.
    fn at(kind: VehicleKind, now_s: f64, act: impl FnOnce(&mut Moment<'_>)) -> Vec<StatusText> {
        let navigation = Navigation::new(Noise::new(1), 1, 0.0, Duration::from_secs(20));
        let (place, mut texts) = (PlaceEstimate::new(navigation), StatusTexts::default());
        act(&mut Moment {
            now: secs(now_s),
            settings: &AutopilotSettings::new(kind, LIMITS),
            place: &place,
            texts: &mut texts,
        });
        let text = |(_, text): DatedText| text;
        texts.take().into_iter().map(text).collect()
    }

    fn word(mode: FlightMode) -> &'static str {
        match mode {
            FlightMode::Manual => "Manual",
            FlightMode::Hold => "Hold",
            FlightMode::Loiter => "Loiter",
            FlightMode::Guided => "Guided",
            FlightMode::Auto => "Auto",
            FlightMode::Return => "Return",
            FlightMode::Land => "Land",
        }
    }

    #[test]
    fn the_drawing_has_the_modes_that_there_are() {
        let modes = [
            FlightMode::Manual,
            FlightMode::Hold,
            FlightMode::Loiter,
            FlightMode::Guided,
            FlightMode::Auto,
            FlightMode::Return,
            FlightMode::Land,
        ];
        let words: BTreeSet<String> = modes.map(|mode| word(mode).to_owned()).into();
        assert_eq!(drawn(include_str!("vehicle_control.rs")), words);
    }

    #[test]
    fn a_mode_is_entered_without_current_and_nothing_moves() {
        let mut control = control(5.0);
        at(VehicleKind::Copter, 1.0, |moment| {
            control.act(Action::Disarm, moment)
        });
        let changes = control.motion().changes();
        let output = at(VehicleKind::Copter, 2.0, |moment| {
            control.act(Action::Enter(FlightMode::Return), moment)
        });
        assert_eq!(output, [StatusText::Mode(FlightMode::Return)]);
        assert_eq!(
            (control.motion().changes(), control.motion().stage_ends()),
            (changes, None)
        );
    }

    #[test]
    fn items_that_take_no_time_are_done_on_the_way_to_the_next_that_does() {
        let mut control = control(0.0);
        let home = Item::Waypoint {
            at: Point::default(),
            altitude_m: 0.0,
            delay: Duration::ZERO,
        };
        let wait = Item::Delay(Duration::from_secs(4));
        let servo = Item::Servo {
            channel: 9,
            pulse_us: 1700,
        };
        let items = vec![home, Item::Speed(0.5), servo, wait];
        at(VehicleKind::Rover, 1.0, |moment| {
            control.act(Action::StoreMission(items), moment)
        });
        let output = at(VehicleKind::Rover, 2.0, |moment| {
            control.act(Action::Enter(FlightMode::Auto), moment)
        });
        let begun = [1, 2, 3].map(StatusText::Begun);
        assert_eq!(
            output,
            [&[StatusText::Mode(FlightMode::Auto)], &begun[..]].concat()
        );
        assert_eq!(
            (control.speed_mps(), control.servos().get(&9)),
            (0.5, Some(&1700))
        );
        assert_eq!(control.motion().stage_ends(), Some(secs(6.0)));
        let output = at(VehicleKind::Rover, 6.0, |moment| control.end_stage(moment));
        let expected = [
            StatusText::Reached(3),
            StatusText::MissionDone,
            StatusText::Mode(FlightMode::Hold),
        ];
        assert_eq!(
            (output, control.mode()),
            (expected.to_vec(), FlightMode::Hold)
        );
    }

    #[test]
    fn who_has_touched_down_is_disarmed_unless_a_mission_goes_on() {
        for (running, armed) in [(false, false), (true, true)] {
            let mut control = control(0.0);
            if running {
                let items = vec![Item::Delay(Duration::ZERO); 3];
                at(VehicleKind::Copter, 1.0, |moment| {
                    control.act(Action::StoreMission(items), moment);
                    control.act(Action::Enter(FlightMode::Auto), moment);
                });
            }
            let touchdown = Action::Lay(vec![Stage::Touchdown]);
            let output = at(VehicleKind::Copter, 2.0, |moment| {
                control.act(touchdown, moment)
            });
            assert_eq!(control.is_armed(), armed, "{output:?}");
            assert_eq!(control.motion().stage_ends(), Some(secs(2.0)));
        }
    }

    #[test]
    fn an_armed_copter_on_the_ground_is_idle_and_one_in_the_air_works() {
        let settings = AutopilotSettings::new(VehicleKind::Copter, LIMITS);
        let (landed, flying) = (control(0.0), control(5.0));
        assert_eq!(landed.idle_until(&settings, secs(1.0)), Some(secs(10.0)));
        assert_eq!(flying.idle_until(&settings, secs(1.0)), None);
        assert_eq!(
            landed.works_until(VehicleKind::Copter, secs(1.0)),
            secs(1.0)
        );
        assert_eq!(
            flying.works_until(VehicleKind::Copter, secs(1.0)),
            Time::NEVER
        );
        let rover = AutopilotSettings::new(VehicleKind::Rover, LIMITS);
        assert_eq!(landed.idle_until(&rover, secs(1.0)), None);
    }
}
