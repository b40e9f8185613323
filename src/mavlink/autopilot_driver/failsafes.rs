//! What an autopilot does by itself when something fails, by its parameters. The numbers are ArduPilot's, of Rover 4.2 and
//! Copter 4.2 and newer: <https://ardupilot.org/rover/docs/parameters.html>,
//! <https://ardupilot.org/copter/docs/parameters.html>.
//!
//! Deliberately absent: which of them are needed, see `operator::preflight`.

use std::collections::BTreeMap;

use tomoswarm_proto::{FailsafeAction, Failsafes};

use crate::autopilot::VehicleKind;

/// The parameters that say it, of either kind of vehicle and by their old and new names.
pub(super) const NAMES: [&str; 15] = [
    "BATT_CRT_MAH",
    "BATT_CRT_VOLT",
    "BATT_FS_CRT_ACT",
    "BATT_FS_LOW_ACT",
    "BATT_LOW_MAH",
    "BATT_LOW_VOLT",
    "BATT_MONITOR",
    "FENCE_ACTION",
    "FENCE_ENABLE",
    "FS_ACTION",
    "FS_EKF_ACTION",
    "FS_GCS_ENABLE",
    "FS_THR_ENABLE",
    "MAV_GCS_SYSID",
    "SYSID_MYGCS",
];

/// Returns what parameters say that it does; `own_system` is the system whose heartbeats are those of its companion.
pub(super) fn failsafes(
    kind: VehicleKind,
    own_system: u8,
    values: &BTreeMap<&'static str, f32>,
) -> Failsafes {
    let value = |name: &str| values.get(name).map(|value| *value as i64);
    let action =
        |name: &str, of: fn(i64) -> FailsafeAction| value(name).map_or(FailsafeAction::Unknown, of);
    let is_set = |name: &str| values.get(name).is_some_and(|value| *value > 0.0);
    let gcs = value("SYSID_MYGCS").or_else(|| value("MAV_GCS_SYSID"));
    let companion = match gcs {
        // It listens to somebody else: our silence means nothing to it.
        Some(gcs) if gcs != i64::from(own_system) => FailsafeAction::Off,
        _ => by_switch(
            kind,
            value("FS_GCS_ENABLE"),
            action("FS_ACTION", rover),
            copter_gcs,
        ),
    };
    let of_battery: fn(i64) -> FailsafeAction = match kind {
        VehicleKind::Rover => rover,
        VehicleKind::Copter => copter_battery,
    };
    let stage = |level: [&str; 2], name: &str| match level.into_iter().any(is_set) {
        true => action(name, of_battery),
        false => FailsafeAction::Off,
    };
    let battery = match value("BATT_MONITOR") {
        None => FailsafeAction::Unknown,
        Some(0) => FailsafeAction::Off,
        Some(_) => {
            let low = stage(["BATT_LOW_VOLT", "BATT_LOW_MAH"], "BATT_FS_LOW_ACT");
            match stage(["BATT_CRT_VOLT", "BATT_CRT_MAH"], "BATT_FS_CRT_ACT") {
                // The first one acts; the second one must not undo it.
                returns @ (FailsafeAction::Return | FailsafeAction::Other) => returns,
                critical if low == FailsafeAction::Off => critical,
                _ => low,
            }
        }
    };
    let of_fence: fn(i64) -> FailsafeAction = match kind {
        VehicleKind::Rover => rover_fence,
        VehicleKind::Copter => copter_fence,
    };
    let of_estimator: fn(i64) -> FailsafeAction = match kind {
        VehicleKind::Rover => rover_estimator,
        VehicleKind::Copter => copter_estimator,
    };
    Failsafes {
        battery,
        companion,
        remote: by_switch(
            kind,
            value("FS_THR_ENABLE"),
            action("FS_ACTION", rover),
            copter_remote,
        ),
        fence: match value("FENCE_ENABLE") {
            None => FailsafeAction::Unknown,
            Some(0) => FailsafeAction::Off,
            Some(_) => action("FENCE_ACTION", of_fence),
        },
        estimator: action("FS_EKF_ACTION", of_estimator),
    }
}

/// A failsafe that a rover switches on, with one action for all; a copter's switch is the action.
fn by_switch(
    kind: VehicleKind,
    switch: Option<i64>,
    of_rover: FailsafeAction,
    of_copter: fn(i64) -> FailsafeAction,
) -> FailsafeAction {
    match (kind, switch) {
        (_, None) => FailsafeAction::Unknown,
        (_, Some(0)) => FailsafeAction::Off,
        (VehicleKind::Rover, Some(1)) => of_rover,
        // A mission in AUTO goes on.
        (VehicleKind::Rover, Some(_)) => FailsafeAction::Other,
        (VehicleKind::Copter, Some(switch)) => of_copter(switch),
    }
}

/// FS_ACTION and BATT_FS_…_ACT of a rover.
fn rover(value: i64) -> FailsafeAction {
    match value {
        0 => FailsafeAction::Off,
        2 | 6 => FailsafeAction::Hold,
        1 | 3 | 4 => FailsafeAction::Return,
        _ => FailsafeAction::Other,
    }
}

fn rover_fence(value: i64) -> FailsafeAction {
    match value {
        0 => FailsafeAction::Off,
        2 | 6 => FailsafeAction::Hold,
        1 | 3 | 4 => FailsafeAction::Return,
        _ => FailsafeAction::Other,
    }
}

fn rover_estimator(value: i64) -> FailsafeAction {
    match value {
        0 | 2 => FailsafeAction::Off,
        1 => FailsafeAction::Hold,
        _ => FailsafeAction::Other,
    }
}

/// FS_GCS_ENABLE of a copter, but for 0.
fn copter_gcs(value: i64) -> FailsafeAction {
    match value {
        5 => FailsafeAction::Land,
        7 => FailsafeAction::Hold,
        1 | 3 | 4 | 6 => FailsafeAction::Return,
        _ => FailsafeAction::Other,
    }
}

/// FS_THR_ENABLE of a copter, but for 0.
fn copter_remote(value: i64) -> FailsafeAction {
    match value {
        3 => FailsafeAction::Land,
        7 => FailsafeAction::Hold,
        1 | 4 | 5 | 6 => FailsafeAction::Return,
        _ => FailsafeAction::Other,
    }
}

fn copter_battery(value: i64) -> FailsafeAction {
    match value {
        0 => FailsafeAction::Off,
        1 => FailsafeAction::Land,
        7 => FailsafeAction::Hold,
        2 | 3 | 4 | 6 => FailsafeAction::Return,
        _ => FailsafeAction::Other,
    }
}

fn copter_fence(value: i64) -> FailsafeAction {
    match value {
        0 => FailsafeAction::Off,
        2 => FailsafeAction::Land,
        4 => FailsafeAction::Hold,
        1 | 3 | 5 => FailsafeAction::Return,
        _ => FailsafeAction::Other,
    }
}

fn copter_estimator(value: i64) -> FailsafeAction {
    match value {
        0 => FailsafeAction::Off,
        1 | 3 => FailsafeAction::Land,
        2 => FailsafeAction::Hold,
        _ => FailsafeAction::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use FailsafeAction::{Hold, Land, Off, Other, Return, Unknown};

    fn of(kind: VehicleKind, values: &[(&'static str, f32)]) -> Failsafes {
        failsafes(kind, 255, &values.iter().copied().collect())
    }

    #[test]
    fn a_rover_that_says_nothing_is_unknown_and_one_with_its_defaults_is_off() {
        assert_eq!(of(VehicleKind::Rover, &[]), Failsafes::default());
        assert_eq!(of(VehicleKind::Rover, &[]).battery, Unknown);
        let found = of(
            VehicleKind::Rover,
            &[
                ("FS_ACTION", 2.0),
                ("FS_GCS_ENABLE", 0.0),
                ("FS_THR_ENABLE", 1.0),
                ("FENCE_ENABLE", 0.0),
                ("BATT_MONITOR", 0.0),
                ("FS_EKF_ACTION", 1.0),
            ],
        );
        let expected = Failsafes {
            battery: Off,
            companion: Off,
            remote: Hold,
            fence: Off,
            estimator: Hold,
        };
        assert_eq!(found, expected);
    }

    #[test]
    fn one_that_listens_to_another_ground_station_does_not_miss_us() {
        for (system, expected) in [(255.0, Hold), (254.0, Off)] {
            for name in ["SYSID_MYGCS", "MAV_GCS_SYSID"] {
                let values = [("FS_GCS_ENABLE", 1.0), ("FS_ACTION", 2.0), (name, system)];
                assert_eq!(of(VehicleKind::Rover, &values).companion, expected);
            }
        }
        let goes_on = [("FS_GCS_ENABLE", 2.0), ("FS_ACTION", 2.0)];
        assert_eq!(of(VehicleKind::Rover, &goes_on).companion, Other);
    }

    #[test]
    fn a_battery_acts_at_its_levels_and_the_last_one_must_not_return() {
        let battery = |low_volt: f32, low: f32, critical_volt: f32, critical: f32| {
            let values = [
                ("BATT_MONITOR", 4.0),
                ("BATT_LOW_VOLT", low_volt),
                ("BATT_FS_LOW_ACT", low),
                ("BATT_CRT_VOLT", critical_volt),
                ("BATT_FS_CRT_ACT", critical),
            ];
            of(VehicleKind::Copter, &values).battery
        };
        assert_eq!(battery(10.5, 1.0, 0.0, 2.0), Land);
        assert_eq!(battery(0.0, 1.0, 0.0, 1.0), Off, "no level is set");
        assert_eq!(battery(10.5, 0.0, 10.0, 1.0), Land);
        assert_eq!(battery(10.5, 1.0, 10.0, 2.0), Return);
        assert_eq!(battery(10.5, 7.0, 10.0, 1.0), Hold);
    }

    #[test]
    fn a_fence_acts_when_it_is_on() {
        for (action, expected) in [
            (0.0, Off),
            (2.0, Land),
            (4.0, Hold),
            (1.0, Return),
            (9.0, Other),
        ] {
            let values = [("FENCE_ENABLE", 1.0), ("FENCE_ACTION", action)];
            assert_eq!(of(VehicleKind::Copter, &values).fence, expected);
        }
    }
}
