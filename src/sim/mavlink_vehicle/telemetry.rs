//! What a simulated vehicle knows of itself, as messages.

use super::remote_control::CHANNELS;
use crate::autopilot::{FlightMode, SystemStatus, VehicleKind};
use crate::mavlink::client_link::Said;
use crate::mavlink::dialect::{
    self as d, EstimatorStatusFlags, GpsFixType, MavMessage, MavProtocolCapability as Can,
    MissionState,
};
use crate::mavlink::earth_frame::EarthFrame;
use crate::mavlink::vehicle_messages::{
    BatteryReadout, MissionReadout, VehicleMessages, VehicleReadout,
};
use crate::mavlink::wire_message::EKF_STATUS;
use crate::sim::autopilot::Readout;
use crate::time::Time;

/// Volts of a full and of an empty battery of three cells.
const VOLTS: (f64, f64) = (12.6, 10.5);
/// So many satellites a simulated receiver sees.
const SATELLITES: u8 = 10;
/// The version that it claims to be.
const VERSION: [u8; 3] = [4, 5, 4];

/// A vehicle at a moment.
pub(super) struct Telemetry<'a> {
    common: VehicleMessages<'a>,
    readout: Readout,
    /// Of the remote control, pulse widths, microseconds.
    channels: [u16; CHANNELS],
}

impl<'a> Telemetry<'a> {
    /// Takes what its autopilot knows, when that is and when it was started, and how many items its stored mission has.
    pub(super) fn new(
        (now, booted): (Time, Time),
        kind: VehicleKind,
        readout: Readout,
        frame: &'a EarthFrame,
        (items, channels): (usize, [u16; CHANNELS]),
    ) -> Telemetry<'a> {
        let common = VehicleMessages {
            at: Time::ZERO + now.since(booted),
            readout: in_common(kind, &readout, items),
            frame,
        };
        Telemetry {
            common,
            readout,
            channels,
        }
    }

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
            36 => self.servo_outputs(),
            65 => self.channels(),
            _ => self.common.message(number)?,
        })
    }

    fn servo_outputs(&self) -> MavMessage {
        let of = |channel: u8| self.readout.servos.get(&channel).copied().unwrap_or(0);
        MavMessage::SERVO_OUTPUT_RAW(d::SERVO_OUTPUT_RAW_DATA {
            time_usec: self.common.boot_us() as u32,
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

    fn channels(&self) -> MavMessage {
        let of = self.channels;
        MavMessage::RC_CHANNELS(d::RC_CHANNELS_DATA {
            time_boot_ms: self.common.boot_ms(),
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
}

/// Returns what every vehicle has that is shown.
fn in_common(kind: VehicleKind, readout: &Readout, items: usize) -> VehicleReadout {
    let heading_rad = readout.pose.heading.radians();
    VehicleReadout {
        kind,
        mode: readout.mode,
        is_armed: readout.is_armed,
        is_landed: readout.is_landed,
        status: readout.status,
        pose: Some(readout.pose),
        altitude_m: readout.altitude_m,
        tilt: (readout.attitude.roll, readout.attitude.pitch),
        velocity_mps: (
            readout.speed_mps * libm::cos(heading_rad),
            readout.speed_mps * libm::sin(heading_rad),
        ),
        climb_mps: readout.climb_mps,
        battery: BatteryReadout {
            charge: Some(readout.battery),
            volts: Some(VOLTS.1 + (VOLTS.0 - VOLTS.1) * readout.battery),
            amperes: None,
        },
        fix: GpsFixType::GPS_FIX_TYPE_3D_FIX,
        satellites: Some(SATELLITES),
        home: readout.home,
        mission: MissionReadout {
            item: readout.item as u16,
            total: items.saturating_sub(1) as u16,
            state: match (readout.is_over, readout.mode, items) {
                (_, _, 0 | 1) => MissionState::MISSION_STATE_NO_MISSION,
                (true, _, _) => MissionState::MISSION_STATE_COMPLETE,
                (false, FlightMode::Auto, _) => MissionState::MISSION_STATE_ACTIVE,
                (false, _, _) if readout.item == 0 => MissionState::MISSION_STATE_NOT_STARTED,
                (false, _, _) => MissionState::MISSION_STATE_PAUSED,
            },
        },
        version: VERSION,
        capabilities: Can::MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
            | Can::MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
            | Can::MAV_PROTOCOL_CAPABILITY_MISSION_INT
            | Can::MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | Can::MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
            | Can::MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
            | Can::MAV_PROTOCOL_CAPABILITY_MAVLINK2,
    }
}
