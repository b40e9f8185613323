//! What an autopilot has said of itself, and what follows: the report for the link, and what is wrong.

use std::collections::BTreeSet;
use std::time::Duration;

use super::attitude::HeardAttitude;
use super::battery::HeardBattery;
use super::{DriverTrouble, MavlinkDriverSettings, PlaceSource};
use crate::autopilot::{
    AutopilotReport, FlightMode, FlightState, Item, Motion, RemoteSwitch, StoredReport,
    SystemStatus, VehicleKind,
};
use crate::geom::{Point, Pose, Vector};
use crate::mavlink::dialect::{
    self as d, EstimatorStatusFlags, GpsFixType, MavAutopilot, MavLandedState, MavMessage,
    MavModeFlag, MavState, MavType, MissionState,
};
use crate::mavlink::frames::{AUTOPILOT, MavAddress};
use crate::mavlink::modes::{ShownMode, mode_of};
use crate::time::Time;

/// The deviation of a place that is not known, metres: further than any vehicle accepts.
const UNKNOWN_SD_M: f64 = 1000.0;
/// Slower than this it stands, m/s.
const RESTS_BELOW_MPS: f64 = 0.05;
/// Slower than this it does not climb, m/s.
const STEADY_BELOW_MPS: f64 = 0.06;
/// Its clock has gone back by more than this: it has started anew, or another one speaks.
const REBOOT_MS: u32 = 1000;
/// What is said beyond these is none: metres, and m/s.
const HIGHEST_M: f64 = 100_000.0;
const FASTEST_MPS: f64 = 100.0;
/// So often within [`DUPLICATE_WITHIN`] is no start any more.
const DUPLICATE_AFTER: usize = 3;
const DUPLICATE_WITHIN: Duration = Duration::from_secs(10);
/// What says how good a place is, is believed for this long.
const FIX_LASTS: Duration = Duration::from_secs(3);
/// A mode that was not said again for this long is not known any more: five heartbeats.
const HEARTBEAT_LASTS: Duration = Duration::from_secs(5);

/// A pulse is of the switch's position when it is this near to it, microseconds.
const SWITCH_WITHIN_US: u16 = 150;

/// A value and when it came.
type Dated<T> = Option<(Time, T)>;

/// What an autopilot has said, the newest of each.
#[derive(Clone, Debug, Default)]
pub(super) struct Heard {
    at: Option<Time>,
    heartbeat: Dated<d::HEARTBEAT_DATA>,
    global: Dated<d::GLOBAL_POSITION_INT_DATA>,
    local: Dated<d::LOCAL_POSITION_NED_DATA>,
    origin: Option<(i32, i32)>,
    pub(super) attitude: HeardAttitude,
    gps: Dated<d::GPS_RAW_INT_DATA>,
    channels: Dated<d::RC_CHANNELS_DATA>,
    estimator: Dated<EstimatorStatusFlags>,
    /// How sure that is of its place, metres; ArduPilot's does not say it.
    estimated_sd_m: Dated<f32>,
    pub(super) battery: HeardBattery,
    /// Of its software, as AUTOPILOT_VERSION has it.
    version: Option<u32>,
    landed: Option<MavLandedState>,
    refusal: Dated<String>,
    mission: HeardMission,
    boot_ms: u32,
    /// When its clock went back, the last few times.
    went_back: Vec<Time>,
    others: BTreeSet<MavAddress>,
}

/// What it has said of the mission that it stores.
#[derive(Clone, Copy, Debug, Default)]
struct HeardMission {
    /// The item under way.
    item: u16,
    is_complete: bool,
    /// The item that it has said to have reached last.
    reached: Option<u16>,
    /// The last item that takes its time, as far as it is known what is stored.
    lasting: Option<u16>,
}

impl HeardMission {
    fn forget(&mut self) {
        (self.item, self.is_complete, self.reached) = (0, false, None);
    }

    fn take(&mut self, current: &d::MISSION_CURRENT_DATA) {
        (self.item, self.is_complete) = (
            current.seq,
            current.mission_state == MissionState::MISSION_STATE_COMPLETE,
        );
        // A jump has led back.
        self.reached.take_if(|reached| current.seq < *reached);
    }

    /// Returns how far it is. Old software does not say that a mission is over: it has reached the last item then, and left
    /// AUTO.
    fn report(&self, mode: ShownMode) -> StoredReport {
        let is_reached = self
            .lasting
            .zip(self.reached)
            .is_some_and(|(last, reached)| reached >= last);
        let has_left = mode != ShownMode::Known(FlightMode::Auto);
        StoredReport {
            item: self.item,
            is_over: self.is_complete || (is_reached && has_left),
        }
    }
}

/// Returns the last item that takes its time; one that is not known may do so.
fn last_lasting(items: &[Item]) -> Option<u16> {
    let lasts = |item: &Item| item.takes_time() || matches!(item, Item::Other { .. });
    let last = items.iter().rposition(lasts)?;
    u16::try_from(last).ok()
}

impl Heard {
    /// Notes that somebody else speaks on the same link.
    pub(super) fn note_other(&mut self, from: MavAddress) {
        if self.others.len() < 16 {
            self.others.insert(from);
        }
    }

    /// Takes a message of the autopilot; returns whether it has started anew.
    pub(super) fn take(
        &mut self,
        now: Time,
        message: &MavMessage,
        settings: &MavlinkDriverSettings,
    ) -> bool {
        self.at = Some(now);
        let mut boot_ms = None;
        match message {
            MavMessage::HEARTBEAT(heartbeat) => self.heartbeat = Some((now, heartbeat.clone())),
            MavMessage::GLOBAL_POSITION_INT(place) => {
                boot_ms = Some(place.time_boot_ms);
                self.global = Some((now, place.clone()));
            }
            MavMessage::LOCAL_POSITION_NED(place) => {
                boot_ms = Some(place.time_boot_ms);
                self.local = Some((now, place.clone()));
            }
            MavMessage::ATTITUDE(attitude) => self.attitude.take(now, attitude),
            MavMessage::GPS_GLOBAL_ORIGIN(origin) => {
                self.origin = Some((origin.latitude, origin.longitude))
            }
            MavMessage::GPS_RAW_INT(gps) => self.gps = Some((now, gps.clone())),
            MavMessage::ESTIMATOR_STATUS(status) => {
                self.take_estimator(now, status.flags);
                self.estimated_sd_m = Some((now, status.pos_horiz_accuracy));
            }
            MavMessage::EXTENDED_SYS_STATE(state) => self.landed = Some(state.landed_state),
            MavMessage::SYS_STATUS(status) => self.battery.take(now, status),
            MavMessage::MISSION_CURRENT(current) => self.mission.take(current),
            MavMessage::MISSION_ITEM_REACHED(reached) => self.mission.reached = Some(reached.seq),
            MavMessage::RC_CHANNELS(channels) => self.channels = Some((now, channels.clone())),
            MavMessage::AUTOPILOT_VERSION(version) => {
                self.version = Some(version.flight_sw_version);
            }
            MavMessage::STATUSTEXT(said) => {
                let text = said.text.to_str().unwrap_or_default();
                if text.starts_with("PreArm:") || text.starts_with("Arm:") {
                    self.refusal = Some((now, text.to_owned()));
                }
            }
            _ => {}
        }
        if self.is_armed() {
            self.refusal = None;
        }
        boot_ms.is_some_and(|boot_ms| self.has_gone_back(now, boot_ms, settings))
    }

    /// Notes its clock; returns whether it has gone back.
    fn has_gone_back(&mut self, now: Time, boot_ms: u32, settings: &MavlinkDriverSettings) -> bool {
        let is_back = boot_ms.saturating_add(REBOOT_MS) < self.boot_ms;
        self.boot_ms = boot_ms;
        if is_back {
            self.went_back
                .retain(|at| now.since(*at) <= DUPLICATE_WITHIN);
            self.went_back.push(now);
            if self.trouble_of_two(now, settings).is_none() {
                (self.origin, self.estimator, self.gps) = (None, None, None);
                self.attitude = HeardAttitude::default();
                return true;
            }
        }
        false
    }

    fn trouble_of_two(&self, now: Time, settings: &MavlinkDriverSettings) -> Option<DriverTrouble> {
        let lately = self
            .went_back
            .iter()
            .filter(|at| now.since(**at) <= DUPLICATE_WITHIN);
        (lately.count() >= DUPLICATE_AFTER).then_some(DriverTrouble::Duplicate {
            system: settings.system,
        })
    }

    /// Forgets how far it was with its mission: it is told another, or to go on with another item.
    pub(super) fn forget_stored(&mut self, items: Option<&[Item]>) {
        self.mission.forget();
        if let Some(items) = items {
            self.mission.lasting = last_lasting(items);
        }
    }

    /// Returns its mode, as its last heartbeat showed it.
    pub(super) fn mode(&self, kind: VehicleKind) -> Option<ShownMode> {
        let (_, heartbeat) = self.heartbeat.as_ref()?;
        Some(mode_of(kind, heartbeat.custom_mode))
    }

    fn is_armed(&self) -> bool {
        let flags = self
            .heartbeat
            .as_ref()
            .map(|(_, heartbeat)| heartbeat.base_mode);
        flags.is_some_and(|flags| flags.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED))
    }

    /// Returns whose software it is.
    pub(super) fn firmware(&self) -> Option<MavAutopilot> {
        self.heartbeat
            .as_ref()
            .map(|(_, heartbeat)| heartbeat.autopilot)
    }

    /// Returns the version of its software.
    pub(super) fn version(&self) -> Option<u32> {
        self.version
    }

    /// Returns what its receiver of satellites has said lately.
    pub(super) fn fix(&self, now: Time) -> Option<&d::GPS_RAW_INT_DATA> {
        self.fresh(now, &self.gps).map(|(_, gps)| gps)
    }

    /// Takes what its estimator knows.
    pub(super) fn take_estimator(&mut self, now: Time, flags: EstimatorStatusFlags) {
        self.estimator = Some((now, flags));
    }

    /// Returns what its estimator has said lately.
    pub(super) fn estimator_flags(&self, now: Time) -> Option<EstimatorStatusFlags> {
        self.fresh(now, &self.estimator).map(|(_, flags)| *flags)
    }

    /// Returns whether it has said where its frame's origin is.
    pub(super) fn has_origin(&self) -> bool {
        self.origin.is_some()
    }

    /// Returns the last text that explains why it does not arm, if it is no older than this.
    pub(super) fn explanation(&self, now: Time, most: Duration) -> Option<&str> {
        let (at, text) = self.refusal.as_ref()?;
        (now.since(*at) <= most).then_some(text.as_str())
    }

    /// Returns its altitude above home, metres.
    pub(super) fn altitude_m(&self) -> f64 {
        let above =
            |(_, place): &(Time, d::GLOBAL_POSITION_INT_DATA)| f64::from(place.relative_alt) * 1e-3;
        self.global.as_ref().map_or(0.0, above)
    }

    /// Returns what it says of itself, for the link; `None` before it has said what it is, or when it is not what it is to be.
    pub(super) fn report(
        &self,
        now: Time,
        settings: &MavlinkDriverSettings,
    ) -> Option<AutopilotReport> {
        // One whose mode is not known any more may have been taken over.
        let (_, heartbeat) = self
            .heartbeat
            .as_ref()
            .filter(|(at, _)| now.since(*at) <= HEARTBEAT_LASTS)?;
        if self.is_other(settings).is_some() || self.trouble_of_two(now, settings).is_some() {
            return None;
        }
        let (at, sd_m, climb_mps, velocity) = self.place(now, settings)?;
        let speed_mps = velocity.length_m();
        let motion = if speed_mps > RESTS_BELOW_MPS {
            Motion::Driving
        } else if self.attitude.turns(now) || climb_mps.abs() > STEADY_BELOW_MPS {
            Motion::Turning
        } else {
            Motion::Resting
        };
        let is_landed = match (settings.kind, self.landed) {
            (VehicleKind::Rover, _) => true,
            (VehicleKind::Copter, Some(state)) => {
                state == MavLandedState::MAV_LANDED_STATE_ON_GROUND
            }
            (VehicleKind::Copter, None) => !self.is_armed(),
        };
        Some(AutopilotReport {
            pose: Pose {
                at,
                // Without one the place counts as unknown, too.
                heading: self.attitude.heading(now, settings).unwrap_or_default(),
                sd_m,
            },
            flight_state: FlightState {
                altitude_m: self.altitude_m().clamp(-HIGHEST_M, HIGHEST_M),
                climb_mps: climb_mps.clamp(-FASTEST_MPS, FASTEST_MPS),
                course: (speed_mps > RESTS_BELOW_MPS).then(|| velocity.angle()),
                tilt: self.attitude.tilt(now),
            },
            speed_mps,
            battery: self.battery.charge(now),
            motion,
            is_landed,
            mode: match mode_of(settings.kind, heartbeat.custom_mode) {
                ShownMode::Known(mode) => mode,
                // Whatever it is, somebody has chosen it, and it is not ours.
                ShownMode::Other(_) => FlightMode::Manual,
            },
            is_armed: self.is_armed(),
            status: match heartbeat.system_status {
                MavState::MAV_STATE_UNINIT
                | MavState::MAV_STATE_BOOT
                | MavState::MAV_STATE_CALIBRATING => SystemStatus::Booting,
                MavState::MAV_STATE_STANDBY => SystemStatus::Standby,
                MavState::MAV_STATE_ACTIVE => SystemStatus::Active,
                MavState::MAV_STATE_CRITICAL
                | MavState::MAV_STATE_EMERGENCY
                | MavState::MAV_STATE_POWEROFF
                | MavState::MAV_STATE_FLIGHT_TERMINATION => SystemStatus::Critical,
            },
            switch: self.switch(now, settings),
            stored: self
                .mission
                .report(mode_of(settings.kind, heartbeat.custom_mode)),
        })
    }

    /// Where it is, how sure that is, metres, its climb and its velocity over ground, m/s.
    fn place(
        &self,
        now: Time,
        settings: &MavlinkDriverSettings,
    ) -> Option<(Point, f64, f64, Vector)> {
        let frame = &settings.frame;
        let sd_m = match self.no_place(now, settings) {
            Some(_) => UNKNOWN_SD_M,
            None => self.deviation_m(now).max(settings.place_sd_min_m),
        };
        match settings.place {
            PlaceSource::Global => {
                let (_, place) = self.global.as_ref()?;
                let cm = |speed: i16| f64::from(speed) * 0.01;
                Some((
                    frame.local_place((place.lat, place.lon)),
                    sd_m,
                    -cm(place.vz),
                    frame.from_north_east(cm(place.vx), cm(place.vy)) - Point::default(),
                ))
            }
            PlaceSource::Local => {
                let (_, place) = self
                    .local
                    .as_ref()
                    .filter(|(_, place)| are_numbers(place))?;
                let (north_m, east_m) = (f64::from(place.x), f64::from(place.y));
                let step = frame.from_north_east(north_m, east_m) - Point::default();
                Some((
                    self.local_origin(settings) + step,
                    sd_m,
                    -f64::from(place.vz),
                    frame.from_north_east(f64::from(place.vx), f64::from(place.vy))
                        - Point::default(),
                ))
            }
        }
    }

    /// Returns where the origin of its local frame is; before it has said so, the venue's datum.
    pub(super) fn local_origin(&self, settings: &MavlinkDriverSettings) -> Point {
        let origin = self.origin.map(|origin| settings.frame.local_place(origin));
        origin.unwrap_or_default()
    }

    /// Where the switch of its remote control stands; without a receiver nowhere.
    fn switch(&self, now: Time, settings: &MavlinkDriverSettings) -> Option<RemoteSwitch> {
        let switch = settings.switch?;
        let (_, channels) = self.fresh(now, &self.channels)?;
        let is_at = |level_us: u16| {
            width_us(channels, switch.channel).abs_diff(level_us) <= SWITCH_WITHIN_US
        };
        if is_at(switch.hold_us) {
            Some(RemoteSwitch::Hold)
        } else {
            is_at(switch.return_us).then_some(RemoteSwitch::Return)
        }
    }

    /// How sure its place is, metres: what its estimator says, or its receiver.
    fn deviation_m(&self, now: Time) -> f64 {
        if let Some((_, sd_m)) = self.fresh(now, &self.estimated_sd_m)
            && sd_m.is_finite()
            && *sd_m > 0.0
        {
            return f64::from(*sd_m);
        }
        match self.fresh(now, &self.gps) {
            Some((_, gps)) if gps.h_acc > 0 => f64::from(gps.h_acc) * 1e-3,
            Some(_) | None => 0.0,
        }
    }

    fn fresh<'a, T>(&self, now: Time, value: &'a Dated<T>) -> Option<&'a (Time, T)> {
        value.as_ref().filter(|(at, _)| now.since(*at) <= FIX_LASTS)
    }

    /// Returns why its place is not to be believed; `None` when it is.
    fn no_place(&self, now: Time, settings: &MavlinkDriverSettings) -> Option<String> {
        if let Some((_, known)) = self.fresh(now, &self.estimator) {
            let has = |flags| known.intersects(flags);
            let knows = EstimatorStatusFlags::ESTIMATOR_POS_HORIZ_ABS
                | EstimatorStatusFlags::ESTIMATOR_POS_HORIZ_REL;
            if !has(knows) || has(EstimatorStatusFlags::ESTIMATOR_CONST_POS_MODE) {
                return Some("its estimator has no position".to_owned());
            }
        }
        let why = match settings.place {
            PlaceSource::Global => {
                let (_, place) = self.global.as_ref()?;
                if (place.lat, place.lon) == (0, 0) {
                    return Some("it says latitude 0, longitude 0".to_owned());
                }
                let Some((_, gps)) = self.fresh(now, &self.gps) else {
                    return Some("it does not say what its receiver hears".to_owned());
                };
                let has_fix = !matches!(
                    gps.fix_type,
                    GpsFixType::GPS_FIX_TYPE_NO_GPS
                        | GpsFixType::GPS_FIX_TYPE_NO_FIX
                        | GpsFixType::GPS_FIX_TYPE_2D_FIX
                );
                (!has_fix).then(|| format!("no fix ({} satellites)", gps.satellites_visible))
            }
            PlaceSource::Local => {
                let (_, place) = self.local.as_ref()?;
                if !are_numbers(place) {
                    return Some("its local position is no number".to_owned());
                }
                self.origin
                    .is_none()
                    .then(|| "the origin of its local frame is not known".to_owned())
            }
        };
        let points_nowhere = self.attitude.heading(now, settings).is_none();
        why.or_else(|| points_nowhere.then(|| "it does not say where it points".to_owned()))
    }

    /// Returns in which way it is not what it is to be.
    fn is_other(&self, settings: &MavlinkDriverSettings) -> Option<DriverTrouble> {
        let (_, heartbeat) = self.heartbeat.as_ref()?;
        if heartbeat.autopilot != MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA {
            return Some(DriverTrouble::Firmware {
                found: heartbeat.autopilot as u8,
            });
        }
        let found = kind_of(heartbeat.mavtype);
        let expected = match settings.kind {
            VehicleKind::Rover => "rover",
            VehicleKind::Copter => "copter",
        };
        (found != Some(settings.kind)).then(|| DriverTrouble::Kind {
            found: match found {
                Some(VehicleKind::Rover) => "a rover".to_owned(),
                Some(VehicleKind::Copter) => "a copter".to_owned(),
                None => format!("something else (MAV_TYPE {})", heartbeat.mavtype as u8),
            },
            expected,
        })
    }

    /// Returns what is wrong, the worst first.
    pub(super) fn trouble(
        &self,
        now: Time,
        stale: Duration,
        settings: &MavlinkDriverSettings,
    ) -> Option<DriverTrouble> {
        let system = settings.system;
        let Some(at) = self.at else {
            let others: Vec<String> = self
                .others
                .iter()
                .filter(|other| other.component == AUTOPILOT)
                .map(|other| other.system.to_string())
                .collect();
            return Some(DriverTrouble::NeverHeard {
                system,
                others: match others.is_empty() {
                    true => String::new(),
                    false => format!(", but {}", others.join(", ")),
                },
            });
        };
        let silent = now.since(at);
        if silent > stale {
            return Some(DriverTrouble::Silent {
                system,
                silent_s: silent.as_secs_f64(),
            });
        }
        self.is_other(settings)
            .or_else(|| self.trouble_of_two(now, settings))
            .or_else(|| {
                self.no_place(now, settings)
                    .map(|why| DriverTrouble::NoPlace { why })
            })
            .or_else(|| {
                let text = self.explanation(now, Duration::from_secs(30))?;
                Some(DriverTrouble::Refuses(text.to_owned()))
            })
            .or_else(|| {
                let charge = self.battery.ceased_at(now)?;
                Some(DriverTrouble::NoCharge {
                    last_percent: charge * 100.0,
                })
            })
    }
}

/// Returns whether a place and its velocity are numbers: of one that is none nobody knows whether the vehicle stands.
fn are_numbers(place: &d::LOCAL_POSITION_NED_DATA) -> bool {
    [place.x, place.y, place.vx, place.vy, place.vz]
        .iter()
        .all(|value| value.is_finite())
}

/// Returns which kind of vehicle a type is.
fn kind_of(found: MavType) -> Option<VehicleKind> {
    match found {
        MavType::MAV_TYPE_GROUND_ROVER | MavType::MAV_TYPE_SURFACE_BOAT => Some(VehicleKind::Rover),
        MavType::MAV_TYPE_QUADROTOR
        | MavType::MAV_TYPE_COAXIAL
        | MavType::MAV_TYPE_HELICOPTER
        | MavType::MAV_TYPE_HEXAROTOR
        | MavType::MAV_TYPE_OCTOROTOR
        | MavType::MAV_TYPE_TRICOPTER
        | MavType::MAV_TYPE_DODECAROTOR
        | MavType::MAV_TYPE_DECAROTOR => Some(VehicleKind::Copter),
        _ => None,
    }
}
/// Returns the pulse width of a channel, microseconds; 0 for one that there is not.
fn width_us(channels: &d::RC_CHANNELS_DATA, channel: u8) -> u16 {
    let widths_us = [
        channels.chan1_raw,
        channels.chan2_raw,
        channels.chan3_raw,
        channels.chan4_raw,
        channels.chan5_raw,
        channels.chan6_raw,
        channels.chan7_raw,
        channels.chan8_raw,
        channels.chan9_raw,
        channels.chan10_raw,
        channels.chan11_raw,
        channels.chan12_raw,
        channels.chan13_raw,
        channels.chan14_raw,
        channels.chan15_raw,
        channels.chan16_raw,
        channels.chan17_raw,
        channels.chan18_raw,
    ];
    let index = usize::from(channel).checked_sub(1);
    index
        .and_then(|index| widths_us.get(index))
        .copied()
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::super::tests_support::settings;
    use super::*;
    use crate::geom::Bearing;

    /// What it reports of a place that it says now, and whether it has started anew.
    fn report_of_place(
        heard: &mut Heard,
        time_s: f64,
        time_boot_ms: u32,
    ) -> (AutopilotReport, bool) {
        let (now, settings) = (Time::from_secs_f64(time_s), settings());
        let fix = MavMessage::GPS_RAW_INT(d::GPS_RAW_INT_DATA {
            fix_type: GpsFixType::GPS_FIX_TYPE_3D_FIX,
            h_acc: 300,
            ..d::GPS_RAW_INT_DATA::default()
        });
        let place = MavMessage::GLOBAL_POSITION_INT(d::GLOBAL_POSITION_INT_DATA {
            time_boot_ms,
            lat: 520_000_000,
            lon: 40_000_000,
            ..d::GLOBAL_POSITION_INT_DATA::default()
        });
        heard.take(now, &fix, &settings);
        let has_rebooted = heard.take(now, &place, &settings);
        heard.take(now, &fix, &settings);
        (heard.report(now, &settings).unwrap(), has_rebooted)
    }

    /// Says that it is a rover, that it points somewhere and turns.
    fn take_attitude(heard: &mut Heard, time_s: f64) {
        let (now, settings) = (Time::from_secs_f64(time_s), settings());
        let heartbeat = MavMessage::HEARTBEAT(d::HEARTBEAT_DATA {
            mavtype: MavType::MAV_TYPE_GROUND_ROVER,
            autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            ..d::HEARTBEAT_DATA::default()
        });
        let attitude = MavMessage::ATTITUDE(d::ATTITUDE_DATA {
            yaw: 1.0,
            yawspeed: 0.5,
            ..d::ATTITUDE_DATA::default()
        });
        heard.take(now, &heartbeat, &settings);
        heard.take(now, &attitude, &settings);
    }

    #[test]
    fn an_attitude_is_believed_for_as_long_as_a_slow_stream_needs_and_no_longer() {
        let mut heard = Heard::default();
        take_attitude(&mut heard, 1.0);
        let known = |heard: &mut Heard, time_s: f64| {
            let (report, _) = report_of_place(heard, time_s, (time_s * 1e3) as u32);
            let trouble = heard.trouble(Time::from_secs_f64(time_s), FIX_LASTS, &settings());
            assert_eq!(report.pose.sd_m < 1.0, trouble.is_none(), "{trouble:?}");
            let turns = report.motion == Motion::Turning;
            assert_eq!(report.flight_state.tilt.is_some(), turns, "{report:?}");
            (report.pose.sd_m, turns)
        };
        assert_eq!(known(&mut heard, 2.5), (0.3, true));
        assert_eq!(known(&mut heard, 2.6), (UNKNOWN_SD_M, false));
        let trouble = heard.trouble(Time::from_secs_f64(2.6), FIX_LASTS, &settings());
        let said = trouble.unwrap().to_string();
        assert!(said.ends_with("it does not say where it points"), "{said}");
        take_attitude(&mut heard, 2.7);
        assert_eq!(known(&mut heard, 2.8), (0.3, true));
    }

    #[test]
    fn it_moves_where_its_velocity_says_and_not_where_it_points() {
        let mut heard = Heard::default();
        let (now, settings) = (Time::from_secs_f64(1.0), settings());
        take_attitude(&mut heard, 1.0);
        let mut report = |vx, vy| {
            let place = MavMessage::GLOBAL_POSITION_INT(d::GLOBAL_POSITION_INT_DATA {
                lat: 520_000_000,
                lon: 40_000_000,
                vx,
                vy,
                ..d::GLOBAL_POSITION_INT_DATA::default()
            });
            heard.take(now, &place, &settings);
            heard.report(now, &settings).unwrap()
        };
        // Southwards at 1.5 m/s, pointing 1 rad east of north.
        let south = settings.frame.heading_of(Bearing::from_degrees(180.0));
        let moving = report(-150, 0);
        assert!((moving.speed_mps - 1.5).abs() < 1e-9, "{moving:?}");
        let course = moving.flight_state.course.unwrap();
        assert!((course - south).radians().abs() < 1e-6, "{moving:?}");
        assert!((course - moving.pose.heading).radians().abs() > 1.0);
        let resting = report(0, 1);
        assert_eq!(resting.flight_state.course, None, "{resting:?}");
    }

    #[test]
    fn one_that_has_started_anew_does_not_point_where_it_did_before() {
        let mut heard = Heard::default();
        take_attitude(&mut heard, 1.0);
        let (report, has_rebooted) = report_of_place(&mut heard, 1.1, 90_000);
        assert_eq!((report.pose.sd_m, has_rebooted), (0.3, false));
        let (report, has_rebooted) = report_of_place(&mut heard, 1.2, 100);
        assert_eq!((report.pose.sd_m, has_rebooted), (UNKNOWN_SD_M, true));
    }

    #[test]
    fn a_charge_that_is_not_said_any_more_is_not_known_and_a_trouble() {
        let mut heard = Heard::default();
        take_attitude(&mut heard, 1.0);
        let charge = |heard: &mut Heard, time_s: f64, percent: i8| {
            take_attitude(heard, time_s);
            let status = MavMessage::SYS_STATUS(d::SYS_STATUS_DATA {
                battery_remaining: percent,
                ..d::SYS_STATUS_DATA::default()
            });
            let now = Time::from_secs_f64(time_s);
            heard.take(now, &status, &settings());
            let (report, _) = report_of_place(heard, time_s, (time_s * 1e3) as u32);
            let trouble = heard.trouble(now, FIX_LASTS, &settings());
            let said = trouble.map_or(String::new(), |trouble| trouble.to_string());
            (report.battery, said)
        };
        let well = String::new();
        assert_eq!(charge(&mut heard, 2.0, -1), (Some(1.0), well.clone()));
        assert_eq!(charge(&mut heard, 3.0, 34), (Some(0.34), well.clone()));
        assert_eq!(charge(&mut heard, 12.0, -1), (Some(0.34), well));
        let ceased = "it does not say its battery's charge any more; it was 34 %";
        assert_eq!(charge(&mut heard, 13.5, -1), (None, ceased.to_owned()));
    }

    #[test]
    fn a_mission_is_over_when_it_says_so_or_has_left_auto_after_its_last_item() {
        let items = [Item::Return, Item::Return, Item::Return, Item::Speed(1.0)];
        let mut heard = HeardMission {
            lasting: last_lasting(&items),
            ..HeardMission::default()
        };
        let current = |seq, mission_state| d::MISSION_CURRENT_DATA {
            seq,
            mission_state,
            ..d::MISSION_CURRENT_DATA::default()
        };
        let auto = ShownMode::Known(FlightMode::Auto);
        let hold = ShownMode::Known(FlightMode::Hold);
        heard.take(&current(2, MissionState::MISSION_STATE_UNKNOWN));
        assert!(!heard.report(hold).is_over, "somebody holds it");
        heard.reached = Some(2);
        assert_eq!(
            [auto, hold].map(|mode| heard.report(mode).is_over),
            [false, true]
        );
        heard.take(&current(1, MissionState::MISSION_STATE_UNKNOWN));
        assert!(!heard.report(hold).is_over, "a jump has led back");
        heard.take(&current(2, MissionState::MISSION_STATE_COMPLETE));
        assert!(heard.report(auto).is_over);
        heard.forget();
        assert_eq!(heard.report(auto), StoredReport::default());
    }
}
