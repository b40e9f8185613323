//! The parameters of a simulated autopilot: those that clients ask for by name, with ArduPilot's defaults. Values are kept and
//! given back; few of them change what the vehicle does.

use std::collections::VecDeque;
use std::time::Duration;

use super::ClientId;
use crate::autopilot::VehicleKind;
use crate::mavlink::dialect::{MavMessage, MavParamType, PARAM_VALUE_DATA};
use crate::sim::autopilot::LowBattery;
use crate::time::Time;

/// So many values go out at once, while a list is told.
const AT_ONCE: usize = 20;
/// And then again after this time.
const EVERY: Duration = Duration::from_millis(5);
/// The index of a value that nobody asked for by its index.
const NO_INDEX: u16 = u16::MAX;

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

/// What a vehicle of a swarm is given: its failsafes for battery, companion and fence keep it where it is. After that of its companion
/// a start is needed: it waits a while for a link that is lost.
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

#[derive(Clone, Debug)]
struct Parameter {
    name: &'static str,
    value: f32,
    kind: MavParamType,
}

/// The parameters of a vehicle, by name.
#[derive(Clone, Debug)]
pub(super) struct Parameters {
    all: Vec<Parameter>,
    /// Whom the list is told, and from which value on.
    telling: VecDeque<(ClientId, usize)>,
    told: Time,
}

impl Parameters {
    /// Returns the defaults of a kind of vehicle.
    pub(super) fn of(kind: VehicleKind, system: u8) -> Parameters {
        let own: &[_] = match kind {
            VehicleKind::Rover => &ROVER,
            VehicleKind::Copter => &COPTER,
        };
        let mut all: Vec<Parameter> = COMMON
            .iter()
            .chain(own)
            .map(|(name, value, kind)| Parameter {
                name,
                value: *value,
                kind: *kind,
            })
            .collect();
        all.sort_by_key(|parameter| parameter.name);
        let mut parameters = Parameters {
            all,
            telling: VecDeque::new(),
            told: Time::ZERO,
        };
        parameters.set("SYSID_THISMAV", f32::from(system));
        parameters
    }

    /// Begins to tell a client all of them.
    pub(super) fn tell_all(&mut self, client: ClientId) {
        self.telling.retain(|(other, _)| *other != client);
        self.telling.push_back((client, 0));
    }

    /// Forgets a client that is gone.
    pub(super) fn forget(&mut self, client: ClientId) {
        self.telling.retain(|(other, _)| *other != client);
    }

    /// Returns when more of a list is to be told.
    pub(super) fn deadline(&self) -> Option<Time> {
        (!self.telling.is_empty()).then(|| self.told + EVERY)
    }

    /// Tells the next values of each list.
    pub(super) fn due(&mut self, now: Time, out: &mut Vec<(ClientId, MavMessage)>) {
        if self.deadline().is_none_or(|at| now < at) {
            return;
        }
        self.told = now;
        for (client, from) in std::mem::take(&mut self.telling) {
            let until = (from + AT_ONCE).min(self.all.len());
            out.extend((from..until).map(|index| (client, self.value(index, index as u16))));
            if until < self.all.len() {
                self.telling.push_back((client, until));
            }
        }
    }

    /// Returns the value of a name, or when there is none of an index; `None` when there is neither.
    pub(super) fn read(&self, name: &str, index: i16) -> Option<MavMessage> {
        let of_index = usize::try_from(index).ok();
        let index = of_index.or_else(|| self.index_of(name))?;
        (index < self.all.len()).then(|| self.value(index, index as u16))
    }

    /// Gives a parameter a value and returns what it is then; `None` when there is none of that name. One that is no number is not
    /// taken.
    pub(super) fn set(&mut self, name: &str, value: f32) -> Option<MavMessage> {
        let index = self.index_of(name)?;
        if value.is_finite() {
            self.all[index].value = value;
        }
        Some(self.value(index, NO_INDEX))
    }

    /// Returns the value of a name.
    pub(super) fn value_of(&self, name: &str) -> Option<f32> {
        let index = self.index_of(name)?;
        Some(self.all[index].value)
    }

    /// Returns the speed that a parameter of this name is for, m/s; `None` for any other.
    pub(super) fn speed_mps(&self, name: &str, kind: VehicleKind) -> Option<f64> {
        let per_mps = match (kind, name) {
            (VehicleKind::Rover, "WP_SPEED") => 1.0,
            (VehicleKind::Copter, "WPNAV_SPEED") => 100.0,
            _ => return None,
        };
        Some(f64::from(self.value_of(name)?) / per_mps)
    }

    /// Returns what is to happen when the battery is low, as `BATT_FS_LOW_ACT` says
    /// (<https://ardupilot.org/rover/docs/parameters.html#batt-fs-low-act>).
    pub(super) fn on_low_battery(&self, kind: VehicleKind) -> LowBattery {
        match (kind, self.value_of("BATT_FS_LOW_ACT").unwrap_or(0.0) as i32) {
            (VehicleKind::Rover, 1) | (VehicleKind::Copter, 2) => LowBattery::Return,
            (VehicleKind::Rover, 2) | (VehicleKind::Copter, 1) => LowBattery::Land,
            (VehicleKind::Rover | VehicleKind::Copter, _) => LowBattery::Warn,
        }
    }

    fn index_of(&self, name: &str) -> Option<usize> {
        self.all
            .binary_search_by_key(&name, |parameter| parameter.name)
            .ok()
    }

    fn value(&self, index: usize, param_index: u16) -> MavMessage {
        let parameter = &self.all[index];
        MavMessage::PARAM_VALUE(PARAM_VALUE_DATA {
            param_value: parameter.value,
            param_count: self.all.len() as u16,
            param_index,
            param_id: parameter.name.into(),
            param_type: parameter.kind,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let mut parameters = Parameters::of(VehicleKind::Rover, 3);
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
        let mut parameters = Parameters::of(VehicleKind::Copter, 1);
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
