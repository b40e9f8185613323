//! The parameters of a simulated autopilot: those that clients ask for by name, with ArduPilot's defaults. Values are kept and
//! given back; few of them change what the vehicle does.

use crate::autopilot::VehicleKind;
use crate::mavlink::dialect::MavParamType;
use crate::mavlink::parameter_table::ParameterTable;
use crate::sim::autopilot::LowBattery;

/// Names, values and types of both kinds of vehicle.
const COMMON: [(&str, f32, MavParamType); 14] = [
    ("ARMING_CHECK", 1.0, MavParamType::MAV_PARAM_TYPE_INT32),
    ("BATT_CAPACITY", 3300.0, MavParamType::MAV_PARAM_TYPE_INT32),
    ("BATT_CRT_VOLT", 0.0, MavParamType::MAV_PARAM_TYPE_REAL32),
    ("BATT_FS_CRT_ACT", 0.0, MavParamType::MAV_PARAM_TYPE_INT8),
    ("BATT_FS_LOW_ACT", 0.0, MavParamType::MAV_PARAM_TYPE_INT8),
    ("BATT_LOW_VOLT", 10.5, MavParamType::MAV_PARAM_TYPE_REAL32),
    ("BATT_MONITOR", 4.0, MavParamType::MAV_PARAM_TYPE_INT8),
    ("FENCE_ACTION", 2.0, MavParamType::MAV_PARAM_TYPE_INT8),
    ("FENCE_ENABLE", 0.0, MavParamType::MAV_PARAM_TYPE_INT8),
    ("FS_OPTIONS", 0.0, MavParamType::MAV_PARAM_TYPE_INT32),
    ("SR0_POSITION", 0.0, MavParamType::MAV_PARAM_TYPE_INT16),
    ("SYSID_MYGCS", 255.0, MavParamType::MAV_PARAM_TYPE_INT16),
    ("SYSID_THISMAV", 1.0, MavParamType::MAV_PARAM_TYPE_INT16),
    ("WPNAV_ACCEL", 100.0, MavParamType::MAV_PARAM_TYPE_REAL32),
];
const ROVER: [(&str, f32, MavParamType); 6] = [
    ("CRUISE_SPEED", 2.0, MavParamType::MAV_PARAM_TYPE_REAL32),
    ("FS_ACTION", 2.0, MavParamType::MAV_PARAM_TYPE_INT8),
    ("FS_CRASH_CHECK", 0.0, MavParamType::MAV_PARAM_TYPE_INT8),
    ("FS_GCS_ENABLE", 0.0, MavParamType::MAV_PARAM_TYPE_INT8),
    ("FS_GCS_TIMEOUT", 5.0, MavParamType::MAV_PARAM_TYPE_REAL32),
    ("WP_SPEED", 2.0, MavParamType::MAV_PARAM_TYPE_REAL32),
];
const COPTER: [(&str, f32, MavParamType); 6] = [
    ("FS_EKF_ACTION", 1.0, MavParamType::MAV_PARAM_TYPE_INT8),
    ("FS_GCS_ENABLE", 0.0, MavParamType::MAV_PARAM_TYPE_INT8),
    ("FS_GCS_TIMEOUT", 5.0, MavParamType::MAV_PARAM_TYPE_REAL32),
    ("RTL_ALT", 1500.0, MavParamType::MAV_PARAM_TYPE_INT32),
    ("WPNAV_SPEED", 500.0, MavParamType::MAV_PARAM_TYPE_REAL32),
    ("WPNAV_SPEED_UP", 250.0, MavParamType::MAV_PARAM_TYPE_REAL32),
];

/// What a vehicle of a swarm is given: its failsafes for battery, companion and fence keep it where it is. After that of
/// its companion a start is needed: it waits a while for a link that is lost.
const KEEPS_PLACE_ROVER: [(&str, f32); 5] = [
    ("BATT_FS_LOW_ACT", 2.0),
    ("FENCE_ACTION", 2.0),
    ("FENCE_ENABLE", 1.0),
    ("FS_GCS_ENABLE", 1.0),
    ("FS_GCS_TIMEOUT", 10.0),
];
const KEEPS_PLACE_COPTER: [(&str, f32); 5] = [
    ("BATT_FS_LOW_ACT", 1.0),
    ("FENCE_ACTION", 2.0),
    ("FENCE_ENABLE", 1.0),
    ("FS_GCS_ENABLE", 5.0),
    ("FS_GCS_TIMEOUT", 10.0),
];

/// Returns names and values with which the failsafes for battery, companion and fence keep a vehicle where it is.
pub fn that_keep_place(kind: VehicleKind) -> &'static [(&'static str, f32)] {
    match kind {
        VehicleKind::Rover => &KEEPS_PLACE_ROVER,
        VehicleKind::Copter => &KEEPS_PLACE_COPTER,
    }
}

/// Returns the defaults of a kind of vehicle.
pub(super) fn defaults(kind: VehicleKind, system: u8) -> ParameterTable {
    let own: &[_] = match kind {
        VehicleKind::Rover => &ROVER,
        VehicleKind::Copter => &COPTER,
    };
    let mut table = ParameterTable::new(COMMON.iter().chain(own).copied());
    table.set("SYSID_THISMAV", f32::from(system));
    table
}

/// Returns the speed that a parameter of this name is for, m/s; `None` for any other.
pub(super) fn speed_mps(table: &ParameterTable, name: &str, kind: VehicleKind) -> Option<f64> {
    let per_mps = match (kind, name) {
        (VehicleKind::Rover, "WP_SPEED") => 1.0,
        (VehicleKind::Copter, "WPNAV_SPEED") => 100.0,
        _ => return None,
    };
    Some(f64::from(table.value_of(name)?) / per_mps)
}

/// Returns what is to happen when the battery is low, as `BATT_FS_LOW_ACT` says
/// (<https://ardupilot.org/rover/docs/parameters.html#batt-fs-low-act>).
pub(super) fn on_low_battery(table: &ParameterTable, kind: VehicleKind) -> LowBattery {
    match (
        kind,
        table.value_of("BATT_FS_LOW_ACT").unwrap_or(0.0) as i32,
    ) {
        (VehicleKind::Rover, 1) | (VehicleKind::Copter, 2) => LowBattery::Return,
        (VehicleKind::Rover, 2) | (VehicleKind::Copter, 1) => LowBattery::Land,
        (VehicleKind::Rover | VehicleKind::Copter, _) => LowBattery::Warn,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mavlink::client_link::ClientId;
    use crate::mavlink::dialect::MavMessage;
    use crate::time::Time;

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    fn name_of(message: &MavMessage) -> (String, f32) {
        match message {
            MavMessage::PARAM_VALUE(value) => (
                value.param_id.to_str().unwrap().to_owned(),
                value.param_value,
            ),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_list_is_told_in_order_and_whole_to_each_who_asks() {
        let mut parameters = defaults(VehicleKind::Rover, 3);
        parameters.tell_all(ClientId(1));
        parameters.tell_all(ClientId(2));
        let mut out = Vec::new();
        while let Some(due) = parameters.deadline() {
            parameters.due(due, &mut out);
        }
        for client in [1, 2] {
            let names: Vec<String> = out
                .iter()
                .filter(|(to, _)| *to == ClientId(client))
                .map(|(_, message)| name_of(message).0)
                .collect();
            assert_eq!(names.len(), COMMON.len() + ROVER.len());
            assert!(names.is_sorted());
        }
        assert_eq!(parameters.read("", -1), None);
        let system = parameters.read("SYSID_THISMAV", -1).unwrap();
        assert_eq!(name_of(&system).1, 3.0);
    }

    #[test]
    fn what_is_set_is_read_back_and_nonsense_is_not_taken() {
        let mut parameters = defaults(VehicleKind::Copter, 1);
        assert_eq!(name_of(&parameters.set("RTL_ALT", 700.0).unwrap()).1, 700.0);
        assert_eq!(
            name_of(&parameters.set("RTL_ALT", f32::NAN).unwrap()).1,
            700.0
        );
        assert_eq!(parameters.set("WP_SPEED", 1.0), None, "a rover's");
        assert_eq!(parameters.read("RTL_ALT", 9_999), None);
        assert!(parameters.deadline().is_none() && at(1.0) > Time::ZERO);
    }
}
