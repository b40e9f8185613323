//! What a vehicle knows of itself, as messages.

use super::Said;
use super::remote_control::CHANNELS;
use crate::autopilot::{FlightMode, SystemStatus, VehicleKind};
use crate::mavlink::dialect::{self as d, EstimatorStatusFlags, MavMessage};
use crate::mavlink::earth_frame::EarthFrame;
use crate::mavlink::modes;
use crate::mavlink::wire_message::EKF_STATUS;
use crate::sim::autopilot::Readout;
use crate::time::Time;

/// Volts of a full and of an empty battery of three cells.
const VOLTS: (f64, f64) = (12.6, 10.5);
/// So many satellites a simulated receiver sees.
const SATELLITES: u8 = 10;

/// A vehicle at a moment.
pub(super) struct Telemetry<'a> {
    pub now: Time,
    pub kind: VehicleKind,
    pub readout: Readout,
    pub frame: &'a EarthFrame,
    /// Items of the stored mission.
    pub items: usize,
    /// Of the remote control, pulse widths, microseconds.
    pub channels: [u16; CHANNELS],
}

impl Telemetry<'_> {
    /// Returns what is said under a number; `None` for one under which this vehicle says nothing.
    pub(super) fn said(&self, number: u32) -> Option<Said> {
        if number == EKF_STATUS {
            return Some(Said::EkfStatus(self.estimator()));
        }
        let message = self.message(number)?;
        Some(Said::Message(Box::new(message)))
    }

    /// Returns the message of a number in the dialect; `None` for one that this vehicle does not say.
    pub(super) fn message(&self, number: u32) -> Option<MavMessage> {
        Some(match number {
            0 => self.heartbeat(),
            1 => self.sys_status(),
            2 => self.system_time(),
            24 => self.gps_raw(),
            30 => self.attitude(),
            32 => self.local_position(),
            33 => self.global_position(),
            36 => self.servo_outputs(),
            42 => self.mission_current(),
            49 => self.origin(),
            74 => self.hud(),
            147 => self.battery(),
            65 => self.channels(),
            148 => self.version(),
            242 => self.home()?,
            245 => self.extended_state(),
            _ => return None,
        })
    }

    fn boot_ms(&self) -> u32 {
        (self.now.as_secs_f64() * 1e3) as u32
    }

    fn boot_us(&self) -> u64 {
        (self.now.as_secs_f64() * 1e6) as u64
    }

    /// Velocity to the east, to the north and up, m/s.
    fn velocity_mps(&self) -> (f64, f64, f64) {
        let bearing = self.bearing_rad();
        let speed_mps = self.readout.speed_mps;
        (
            speed_mps * libm::sin(bearing),
            speed_mps * libm::cos(bearing),
            self.readout.climb_mps,
        )
    }

    /// Where it faces, clockwise from north.
    fn bearing_rad(&self) -> f64 {
        self.frame.bearing_of(self.readout.pose.heading).radians()
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
            custom_mode: modes::number_of(self.kind, self.readout.mode).unwrap_or(0),
            mavtype: match self.kind {
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

    fn volts(&self) -> f64 {
        VOLTS.1 + (VOLTS.0 - VOLTS.1) * self.readout.battery
    }

    fn percent(&self) -> i8 {
        (self.readout.battery * 100.0).round() as i8
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
        let is_ready = self.readout.status != SystemStatus::Booting;
        let healthy = match is_ready {
            true => parts,
            false => parts - Sensor::MAV_SYS_STATUS_PREARM_CHECK - Sensor::MAV_SYS_STATUS_AHRS,
        };
        MavMessage::SYS_STATUS(d::SYS_STATUS_DATA {
            onboard_control_sensors_present: parts,
            onboard_control_sensors_enabled: parts,
            onboard_control_sensors_health: healthy,
            voltage_battery: (self.volts() * 1e3).round() as u16,
            current_battery: -1,
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

    /// Where it believes to be: latitude and longitude, 1e-7 degrees, and millimetres above the sea.
    fn place(&self) -> (i32, i32, i32) {
        let at = self.readout.pose.at;
        let (latitude, longitude) = self.frame.wire_place(at);
        let above_sea_m = self.frame.datum.altitude_m + self.readout.altitude_m;
        (latitude, longitude, (above_sea_m * 1e3).round() as i32)
    }

    fn course_cdeg(&self) -> u16 {
        let degrees = self.bearing_rad().to_degrees().rem_euclid(360.0);
        ((degrees * 100.0).round() as u32 % 36_000) as u16
    }

    fn gps_raw(&self) -> MavMessage {
        let (lat, lon, alt) = self.place();
        MavMessage::GPS_RAW_INT(d::GPS_RAW_INT_DATA {
            time_usec: self.boot_us(),
            lat,
            lon,
            alt,
            eph: 80,
            epv: 120,
            vel: (self.readout.speed_mps * 100.0).round() as u16,
            cog: self.course_cdeg(),
            fix_type: d::GpsFixType::GPS_FIX_TYPE_3D_FIX,
            satellites_visible: SATELLITES,
            h_acc: (self.readout.pose.sd_m * 1e3).round() as u32,
            ..d::GPS_RAW_INT_DATA::default()
        })
    }

    fn attitude(&self) -> MavMessage {
        let attitude = self.readout.attitude;
        MavMessage::ATTITUDE(d::ATTITUDE_DATA {
            time_boot_ms: self.boot_ms(),
            roll: attitude.roll.radians() as f32,
            pitch: attitude.pitch.radians() as f32,
            yaw: self.bearing_rad() as f32,
            ..d::ATTITUDE_DATA::default()
        })
    }

    fn local_position(&self) -> MavMessage {
        // From the origin of the estimator, which is the datum: north, east, down.
        let (north_m, east_m) = self.frame.north_east(self.readout.pose.at);
        let (east_mps, north_mps, up_mps) = self.velocity_mps();
        MavMessage::LOCAL_POSITION_NED(d::LOCAL_POSITION_NED_DATA {
            time_boot_ms: self.boot_ms(),
            x: north_m as f32,
            y: east_m as f32,
            z: -self.readout.altitude_m as f32,
            vx: north_mps as f32,
            vy: east_mps as f32,
            vz: -up_mps as f32,
        })
    }

    fn global_position(&self) -> MavMessage {
        let (lat, lon, alt) = self.place();
        let (east_mps, north_mps, up_mps) = self.velocity_mps();
        let cm = |mps: f64| (mps * 100.0).round() as i16;
        MavMessage::GLOBAL_POSITION_INT(d::GLOBAL_POSITION_INT_DATA {
            time_boot_ms: self.boot_ms(),
            lat,
            lon,
            alt,
            relative_alt: (self.readout.altitude_m * 1e3).round() as i32,
            vx: cm(north_mps),
            vy: cm(east_mps),
            vz: cm(-up_mps),
            hdg: self.course_cdeg(),
        })
    }

    fn servo_outputs(&self) -> MavMessage {
        let of = |channel: u8| self.readout.servos.get(&channel).copied().unwrap_or(0);
        MavMessage::SERVO_OUTPUT_RAW(d::SERVO_OUTPUT_RAW_DATA {
            time_usec: self.boot_us() as u32,
            servo1_raw: of(1),
            servo2_raw: of(2),
            servo3_raw: of(3),
            servo4_raw: of(4),
            servo5_raw: of(5),
            servo6_raw: of(6),
            servo7_raw: of(7),
            servo8_raw: of(8),
            servo9_raw: of(9),
            servo10_raw: of(10),
            servo11_raw: of(11),
            servo12_raw: of(12),
            servo13_raw: of(13),
            servo14_raw: of(14),
            servo15_raw: of(15),
            servo16_raw: of(16),
            ..d::SERVO_OUTPUT_RAW_DATA::default()
        })
    }

    /// What its estimator knows: nothing before it has started up.
    fn estimator(&self) -> EstimatorStatusFlags {
        match self.readout.status {
            SystemStatus::Booting => EstimatorStatusFlags::empty(),
            SystemStatus::Standby | SystemStatus::Active | SystemStatus::Critical => {
                EstimatorStatusFlags::ESTIMATOR_ATTITUDE
                    | EstimatorStatusFlags::ESTIMATOR_VELOCITY_HORIZ
                    | EstimatorStatusFlags::ESTIMATOR_VELOCITY_VERT
                    | EstimatorStatusFlags::ESTIMATOR_POS_HORIZ_REL
                    | EstimatorStatusFlags::ESTIMATOR_POS_HORIZ_ABS
                    | EstimatorStatusFlags::ESTIMATOR_POS_VERT_ABS
            }
        }
    }

    fn mission_current(&self) -> MavMessage {
        MavMessage::MISSION_CURRENT(d::MISSION_CURRENT_DATA {
            seq: self.readout.item as u16,
            total: self.items.saturating_sub(1) as u16,
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
        MavMessage::VFR_HUD(d::VFR_HUD_DATA {
            airspeed: self.readout.speed_mps as f32,
            groundspeed: self.readout.speed_mps as f32,
            alt: (self.frame.datum.altitude_m + self.readout.altitude_m) as f32,
            climb: self.readout.climb_mps as f32,
            heading: (self.course_cdeg() / 100) as i16,
            throttle: 0,
        })
    }

    fn battery(&self) -> MavMessage {
        let mut voltages = [u16::MAX; 10];
        voltages[0] = (self.volts() * 1e3).round() as u16;
        MavMessage::BATTERY_STATUS(d::BATTERY_STATUS_DATA {
            voltages,
            temperature: i16::MAX,
            current_battery: -1,
            current_consumed: -1,
            energy_consumed: -1,
            battery_remaining: self.percent(),
            ..d::BATTERY_STATUS_DATA::default()
        })
    }

    /// `None` before it knows one.
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

    fn channels(&self) -> MavMessage {
        let of = self.channels;
        MavMessage::RC_CHANNELS(d::RC_CHANNELS_DATA {
            time_boot_ms: self.boot_ms(),
            chan1_raw: of[0],
            chan2_raw: of[1],
            chan3_raw: of[2],
            chan4_raw: of[3],
            chan5_raw: of[4],
            chan6_raw: of[5],
            chan7_raw: of[6],
            chan8_raw: of[7],
            chan9_raw: of[8],
            chan10_raw: of[9],
            chan11_raw: of[10],
            chan12_raw: of[11],
            chan13_raw: of[12],
            chan14_raw: of[13],
            chan15_raw: of[14],
            chan16_raw: of[15],
            chan17_raw: of[16],
            chan18_raw: of[17],
            chancount: of.iter().filter(|width| **width > 0).count() as u8,
            rssi: u8::MAX,
        })
    }

    fn version(&self) -> MavMessage {
        use d::MavProtocolCapability as Can;
        MavMessage::AUTOPILOT_VERSION(d::AUTOPILOT_VERSION_DATA {
            capabilities: Can::MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
                | Can::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
                | Can::MAV_PROTOCOL_CAPABILITY_MISSION_INT
                | Can::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
                | Can::MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
                | Can::MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
                | Can::MAV_PROTOCOL_CAPABILITY_MAVLINK2,
            // 4.5.4, an official version.
            flight_sw_version: u32::from_be_bytes([4, 5, 4, 255]),
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
