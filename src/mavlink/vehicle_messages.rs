//! What is known of a vehicle, as the messages of an autopilot: for whoever shows vehicles to ground stations. Pure values
//! in, messages out; how often they are said is not known here.

use super::dialect::{self as d, GpsFixType, MavMessage, MavProtocolCapability, MissionState};
use super::earth_frame::EarthFrame;
use super::modes;
use crate::autopilot::{FlightMode, SystemStatus, VehicleKind};
use crate::geom::{Angle, Point, Pose};
use crate::time::Time;

/// The message that says that a vehicle is there, and in which mode.
pub const HEARTBEAT: u32 = 0;
/// The message that says what the autopilot can do.
pub const AUTOPILOT_VERSION: u32 = 148;
/// The message that says where home is.
pub const HOME_POSITION: u32 = 242;

/// What is known of a vehicle.
#[derive(Clone, PartialEq, Debug)]
pub struct VehicleReadout {
    /// What it is.
    pub kind: VehicleKind,
    /// What it does.
    pub mode: FlightMode,
    /// Whether the motors have current.
    pub is_armed: bool,
    /// Whether it stands on the ground.
    pub is_landed: bool,
    /// How it is, as a whole.
    pub status: SystemStatus,
    /// Where it is, facing where, and how sure that is; `None` = not known.
    pub pose: Option<Pose>,
    /// Altitude above the ground of the datum, metres.
    pub altitude_m: f64,
    /// About its forward axis and about its left axis.
    pub tilt: (Angle, Angle),
    /// Along the axes of the local frame, m/s.
    pub velocity_mps: (f64, f64),
    /// Climb, m/s, negative when it sinks.
    pub climb_mps: f64,
    /// Its battery.
    pub battery: BatteryReadout,
    /// How well it knows its place by satellites.
    pub fix: GpsFixType,
    /// Satellites that it uses; `None` = not known.
    pub satellites: Option<u8>,
    /// Where home is; `None` = not known.
    pub home: Option<Point>,
    /// How far it is with its mission.
    pub mission: MissionReadout,
    /// Major, minor and patch version of its software.
    pub version: [u8; 3],
    /// What it can be asked for.
    pub capabilities: MavProtocolCapability,
}

/// What is known of a battery; `None` = not known.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct BatteryReadout {
    /// Charge left, 0 to 1.
    pub charge: Option<f64>,
    /// Voltage, V.
    pub volts: Option<f64>,
    /// Current out of it, A.
    pub amperes: Option<f64>,
}

/// How far a vehicle is with its mission.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct MissionReadout {
    /// The current item.
    pub item: u16,
    /// Items without home.
    pub total: u16,
    /// Whether it is under way.
    pub state: MissionState,
}

/// A vehicle at a moment.
pub struct VehicleMessages<'a> {
    /// When that was, since whoever shows it was started.
    pub at: Time,
    /// What is known of it.
    pub readout: VehicleReadout,
    /// Where its frame lies.
    pub frame: &'a EarthFrame,
}

impl VehicleMessages<'_> {
    /// Returns the message of a number; `None` for one that cannot be said.
    pub fn message(&self, number: u32) -> Option<MavMessage> {
        Some(match number {
            HEARTBEAT => self.heartbeat(),
            1 => self.sys_status(),
            2 => self.system_time(),
            24 => self.gps_raw(),
            30 => self.attitude()?,
            32 => self.local_position()?,
            33 => self.global_position()?,
            42 => self.mission_current(),
            49 => self.origin(),
            74 => self.hud(),
            147 => self.battery(),
            AUTOPILOT_VERSION => self.version(),
            HOME_POSITION => self.home()?,
            245 => self.extended_state(),
            _ => return None,
        })
    }

    /// Returns the moment, ms.
    pub fn boot_ms(&self) -> u32 {
        (self.at.as_secs_f64() * 1e3) as u32
    }

    /// Returns the moment, µs.
    pub fn boot_us(&self) -> u64 {
        (self.at.as_secs_f64() * 1e6) as u64
    }

    fn speed_mps(&self) -> f64 {
        libm::hypot(self.readout.velocity_mps.0, self.readout.velocity_mps.1)
    }

    /// Velocity to the north and to the east, m/s.
    fn north_east_mps(&self) -> (f64, f64) {
        let (x_mps, y_mps) = self.readout.velocity_mps;
        self.frame.north_east(Point::new(x_mps, y_mps))
    }

    /// Where it faces, clockwise from north; where that is not known, north.
    fn bearing_rad(&self) -> f64 {
        let heading = self.readout.pose.map(|pose| pose.heading);
        heading.map_or(0.0, |heading| self.frame.bearing_of(heading).radians())
    }

    fn heartbeat(&self) -> MavMessage {
        let mut base_mode = d::MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED;
        if self.readout.is_armed {
            base_mode |= d::MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED;
        }
        base_mode |= match self.readout.mode {
            FlightMode::Guided => d::MavModeFlag::MAV_MODE_FLAG_GUIDED_ENABLED,
            FlightMode::Auto => d::MavModeFlag::MAV_MODE_FLAG_AUTO_ENABLED,
            FlightMode::Manual => d::MavModeFlag::MAV_MODE_FLAG_MANUAL_INPUT_ENABLED,
            FlightMode::Hold | FlightMode::Loiter | FlightMode::Return | FlightMode::Land => {
                d::MavModeFlag::MAV_MODE_FLAG_STABILIZE_ENABLED
            }
        };
        MavMessage::HEARTBEAT(d::HEARTBEAT_DATA {
            custom_mode: modes::number_of(self.readout.kind, self.readout.mode).unwrap_or(0),
            mavtype: match self.readout.kind {
                VehicleKind::Rover => d::MavType::MAV_TYPE_GROUND_ROVER,
                VehicleKind::Copter => d::MavType::MAV_TYPE_QUADROTOR,
            },
            autopilot: d::MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            base_mode,
            system_status: match self.readout.status {
                SystemStatus::Booting => d::MavState::MAV_STATE_CALIBRATING,
                SystemStatus::Standby => d::MavState::MAV_STATE_STANDBY,
                SystemStatus::Active => d::MavState::MAV_STATE_ACTIVE,
                SystemStatus::Critical => d::MavState::MAV_STATE_CRITICAL,
            },
            mavlink_version: 3,
        })
    }

    /// Voltage, mV; the largest number = not known.
    fn battery_mv(&self) -> u16 {
        let volts = self.readout.battery.volts;
        volts.map_or(u16::MAX, |volts| (volts * 1e3).round() as u16)
    }

    /// Current, hundredths of an ampere; -1 = not known.
    fn battery_ca(&self) -> i16 {
        let amperes = self.readout.battery.amperes;
        amperes.map_or(-1, |amperes| (amperes * 1e2).round() as i16)
    }

    /// Charge left, percent; -1 = not known.
    fn percent(&self) -> i8 {
        let charge = self.readout.battery.charge;
        charge.map_or(-1, |charge| (charge * 100.0).round() as i8)
    }

    fn sys_status(&self) -> MavMessage {
        use d::MavSysStatusSensor as Sensor;
        let parts = Sensor::MAV_SYS_STATUS_SENSOR_3D_GYRO
            | Sensor::MAV_SYS_STATUS_SENSOR_3D_ACCEL
            | Sensor::MAV_SYS_STATUS_SENSOR_3D_MAG
            | Sensor::MAV_SYS_STATUS_SENSOR_GPS
            | Sensor::MAV_SYS_STATUS_AHRS
            | Sensor::MAV_SYS_STATUS_SENSOR_BATTERY
            | Sensor::MAV_SYS_STATUS_PREARM_CHECK;
        let is_ready = self.readout.status != SystemStatus::Booting && self.readout.pose.is_some();
        let healthy = match is_ready {
            true => parts,
            false => parts - Sensor::MAV_SYS_STATUS_PREARM_CHECK - Sensor::MAV_SYS_STATUS_AHRS,
        };
        MavMessage::SYS_STATUS(d::SYS_STATUS_DATA {
            onboard_control_sensors_present: parts,
            onboard_control_sensors_enabled: parts,
            onboard_control_sensors_health: healthy,
            voltage_battery: self.battery_mv(),
            current_battery: self.battery_ca(),
            battery_remaining: self.percent(),
            ..d::SYS_STATUS_DATA::default()
        })
    }

    fn system_time(&self) -> MavMessage {
        MavMessage::SYSTEM_TIME(d::SYSTEM_TIME_DATA {
            time_unix_usec: 0,
            time_boot_ms: self.boot_ms(),
        })
    }

    /// Latitude and longitude, 1e-7 degrees, and millimetres above the sea; `None` when it does not know where it is.
    fn place(&self) -> Option<(i32, i32, i32)> {
        let (latitude, longitude) = self.frame.wire_place(self.readout.pose?.at);
        let above_sea_m = self.frame.datum.altitude_m + self.readout.altitude_m;
        Some((latitude, longitude, (above_sea_m * 1e3).round() as i32))
    }

    fn course_cdeg(&self) -> u16 {
        let degrees = self.bearing_rad().to_degrees().rem_euclid(360.0);
        ((degrees * 100.0).round() as u32 % 36_000) as u16
    }

    fn gps_raw(&self) -> MavMessage {
        let (lat, lon, alt) = self.place().unwrap_or_default();
        let sd_m = self.readout.pose.map_or(f64::INFINITY, |pose| pose.sd_m);
        MavMessage::GPS_RAW_INT(d::GPS_RAW_INT_DATA {
            time_usec: self.boot_us(),
            lat,
            lon,
            alt,
            eph: 80,
            epv: 120,
            vel: (self.speed_mps() * 100.0).round() as u16,
            cog: self.course_cdeg(),
            fix_type: self.readout.fix,
            satellites_visible: self.readout.satellites.unwrap_or(u8::MAX),
            h_acc: (sd_m * 1e3).round() as u32,
            ..d::GPS_RAW_INT_DATA::default()
        })
    }

    fn attitude(&self) -> Option<MavMessage> {
        self.readout.pose?;
        let (roll, pitch) = self.readout.tilt;
        Some(MavMessage::ATTITUDE(d::ATTITUDE_DATA {
            time_boot_ms: self.boot_ms(),
            roll: roll.radians() as f32,
            pitch: pitch.radians() as f32,
            yaw: self.bearing_rad() as f32,
            ..d::ATTITUDE_DATA::default()
        }))
    }

    fn local_position(&self) -> Option<MavMessage> {
        // From the origin of the estimator, which is the datum: north, east, down.
        let (north_m, east_m) = self.frame.north_east(self.readout.pose?.at);
        let (north_mps, east_mps) = self.north_east_mps();
        Some(MavMessage::LOCAL_POSITION_NED(d::LOCAL_POSITION_NED_DATA {
            time_boot_ms: self.boot_ms(),
            x: north_m as f32,
            y: east_m as f32,
            z: -self.readout.altitude_m as f32,
            vx: north_mps as f32,
            vy: east_mps as f32,
            vz: -self.readout.climb_mps as f32,
        }))
    }

    fn global_position(&self) -> Option<MavMessage> {
        let (lat, lon, alt) = self.place()?;
        let (north_mps, east_mps) = self.north_east_mps();
        let cm = |mps: f64| (mps * 100.0).round() as i16;
        Some(MavMessage::GLOBAL_POSITION_INT(
            d::GLOBAL_POSITION_INT_DATA {
                time_boot_ms: self.boot_ms(),
                lat,
                lon,
                alt,
                relative_alt: (self.readout.altitude_m * 1e3).round() as i32,
                vx: cm(north_mps),
                vy: cm(east_mps),
                vz: cm(-self.readout.climb_mps),
                hdg: self.course_cdeg(),
            },
        ))
    }

    fn mission_current(&self) -> MavMessage {
        let MissionReadout { item, total, state } = self.readout.mission;
        MavMessage::MISSION_CURRENT(d::MISSION_CURRENT_DATA {
            seq: item,
            total,
            mission_state: state,
            ..d::MISSION_CURRENT_DATA::default()
        })
    }

    fn origin(&self) -> MavMessage {
        MavMessage::GPS_GLOBAL_ORIGIN(d::GPS_GLOBAL_ORIGIN_DATA {
            latitude: (self.frame.datum.latitude_deg * 1e7).round() as i32,
            longitude: (self.frame.datum.longitude_deg * 1e7).round() as i32,
            altitude: (self.frame.datum.altitude_m * 1e3).round() as i32,
            time_usec: self.boot_us(),
        })
    }

    fn hud(&self) -> MavMessage {
        let speed_mps = self.speed_mps() as f32;
        MavMessage::VFR_HUD(d::VFR_HUD_DATA {
            airspeed: speed_mps,
            groundspeed: speed_mps,
            alt: (self.frame.datum.altitude_m + self.readout.altitude_m) as f32,
            climb: self.readout.climb_mps as f32,
            heading: (self.course_cdeg() / 100) as i16,
            throttle: 0,
        })
    }

    fn battery(&self) -> MavMessage {
        let mut voltages = [u16::MAX; 10];
        voltages[0] = self.battery_mv();
        MavMessage::BATTERY_STATUS(d::BATTERY_STATUS_DATA {
            voltages,
            temperature: i16::MAX,
            current_battery: self.battery_ca(),
            current_consumed: -1,
            energy_consumed: -1,
            battery_remaining: self.percent(),
            ..d::BATTERY_STATUS_DATA::default()
        })
    }

    /// `None` before it is known.
    fn home(&self) -> Option<MavMessage> {
        let (latitude, longitude) = self.frame.wire_place(self.readout.home?);
        Some(MavMessage::HOME_POSITION(d::HOME_POSITION_DATA {
            latitude,
            longitude,
            altitude: (self.frame.datum.altitude_m * 1e3).round() as i32,
            q: [1.0, 0.0, 0.0, 0.0],
            ..d::HOME_POSITION_DATA::default()
        }))
    }

    fn version(&self) -> MavMessage {
        let [major, minor, patch] = self.readout.version;
        MavMessage::AUTOPILOT_VERSION(d::AUTOPILOT_VERSION_DATA {
            capabilities: self.readout.capabilities,
            // An official version.
            flight_sw_version: u32::from_be_bytes([major, minor, patch, 255]),
            ..d::AUTOPILOT_VERSION_DATA::default()
        })
    }

    fn extended_state(&self) -> MavMessage {
        MavMessage::EXTENDED_SYS_STATE(d::EXTENDED_SYS_STATE_DATA {
            landed_state: match self.readout.is_landed {
                true => d::MavLandedState::MAV_LANDED_STATE_ON_GROUND,
                false => d::MavLandedState::MAV_LANDED_STATE_IN_AIR,
            },
            ..d::EXTENDED_SYS_STATE_DATA::default()
        })
    }
}
