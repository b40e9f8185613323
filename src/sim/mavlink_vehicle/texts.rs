//! What the autopilot says in words, and what it says of its mission's items.

use crate::autopilot::VehicleKind;
use crate::mavlink::dialect::{MISSION_ITEM_REACHED_DATA, MavMessage, MavSeverity};
use crate::mavlink::status_text::line;
use crate::sim::autopilot::StatusText;

/// Returns which firmware it claims to be.
pub(super) fn banner(kind: VehicleKind) -> MavMessage {
    let name = match kind {
        VehicleKind::Rover => "ArduRover V4.5.4 (simulated by tomoswarm)",
        VehicleKind::Copter => "ArduCopter V4.5.4 (simulated by tomoswarm)",
    };
    line(MavSeverity::MAV_SEVERITY_INFO, name)
}

/// Returns that the ground station is silent.
pub(super) fn failsafe() -> MavMessage {
    line(MavSeverity::MAV_SEVERITY_WARNING, "GCS Failsafe")
}

/// Returns the messages for something that an autopilot has said.
pub(super) fn messages(text: StatusText) -> Vec<MavMessage> {
    let notice = |text: &str| vec![line(MavSeverity::MAV_SEVERITY_NOTICE, text)];
    let warning = |text: &str| vec![line(MavSeverity::MAV_SEVERITY_WARNING, text)];
    match text {
        // It shows its mode with its heartbeat.
        StatusText::Mode(_) => Vec::new(),
        StatusText::Armed(true) => notice("Arming motors"),
        StatusText::Armed(false) => notice("Disarming motors"),
        StatusText::Begun(item) => notice(&format!("Mission: {item}")),
        StatusText::Reached(item) => vec![MavMessage::MISSION_ITEM_REACHED(
            MISSION_ITEM_REACHED_DATA {
                seq: u16::try_from(item).unwrap_or(u16::MAX),
            },
        )],
        StatusText::MissionDone => notice("Mission Complete"),
        StatusText::BatteryLow => warning("Battery 1 is low"),
        StatusText::BatteryEmpty => warning("Battery 1 is critical"),
        StatusText::PlaceLost => warning("EKF failsafe: position lost"),
    }
}
