//! What an autopilot has said of its health, in the words of the wire.

use std::collections::BTreeMap;

use tomoswarm_proto::{AutopilotFamily, AutopilotHealth, Estimator, SatelliteFix};

use super::MavlinkDriverSettings;
use super::failsafes::failsafes;
use super::heard::Heard;
use crate::mavlink::dialect::{EstimatorStatusFlags, GpsFixType, MavAutopilot, SYS_STATUS_DATA};
use crate::time::Time;

/// Returns it; `None` before it was heard.
pub(super) fn health(
    now: Time,
    heard: &Heard,
    parameters: &BTreeMap<&'static str, f32>,
    settings: &MavlinkDriverSettings,
) -> Option<AutopilotHealth> {
    let power = heard.battery.measured(now);
    Some(AutopilotHealth {
        family: match heard.firmware()? {
            MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA => AutopilotFamily::ArduPilot,
            MavAutopilot::MAV_AUTOPILOT_PX4 => AutopilotFamily::Px4,
            _ => AutopilotFamily::Other,
        },
        body: settings.kind.body(),
        firmware: heard.version().map(version).unwrap_or_default(),
        battery_mv: power.and_then(voltage_mv),
        // Of hundredths of an ampere; less than nothing = not measured.
        battery_ma: power
            .filter(|power| power.current_battery >= 0)
            .map(|power| i32::from(power.current_battery) * 10),
        fix: heard
            .fix(now)
            .map_or(SatelliteFix::Unknown, |gps| fix(gps.fix_type)),
        satellites: heard
            .fix(now)
            .map(|gps| gps.satellites_visible)
            .filter(|satellites| *satellites != u8::MAX),
        estimator: heard
            .estimator_flags(now)
            .map_or(Estimator::Unknown, estimator),
        failsafes: failsafes(settings.kind, settings.own.system, parameters),
    })
}

fn voltage_mv(power: &SYS_STATUS_DATA) -> Option<u32> {
    let voltage_mv = power.voltage_battery;
    (voltage_mv != u16::MAX).then_some(u32::from(voltage_mv))
}

/// Major, minor and patch version, of the three high bytes.
fn version(flight_software: u32) -> String {
    let [major, minor, patch, _] = flight_software.to_be_bytes();
    format!("{major}.{minor}.{patch}")
}

fn fix(found: GpsFixType) -> SatelliteFix {
    match found {
        GpsFixType::GPS_FIX_TYPE_NO_GPS => SatelliteFix::NoReceiver,
        GpsFixType::GPS_FIX_TYPE_NO_FIX => SatelliteFix::NoFix,
        GpsFixType::GPS_FIX_TYPE_2D_FIX => SatelliteFix::TwoD,
        GpsFixType::GPS_FIX_TYPE_DGPS => SatelliteFix::Differential,
        GpsFixType::GPS_FIX_TYPE_RTK_FLOAT => SatelliteFix::RtkFloat,
        GpsFixType::GPS_FIX_TYPE_RTK_FIXED => SatelliteFix::RtkFixed,
        _ => SatelliteFix::ThreeD,
    }
}

fn estimator(flags: EstimatorStatusFlags) -> Estimator {
    let has = |flag| flags.intersects(flag);
    let knows_place = EstimatorStatusFlags::ESTIMATOR_POS_HORIZ_ABS
        | EstimatorStatusFlags::ESTIMATOR_POS_HORIZ_REL;
    if !has(EstimatorStatusFlags::ESTIMATOR_ATTITUDE) {
        Estimator::Starting
    } else if !has(knows_place) || has(EstimatorStatusFlags::ESTIMATOR_CONST_POS_MODE) {
        Estimator::Bad
    } else {
        Estimator::Good
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_read_and_an_estimator_is_good_that_knows_its_place() {
        assert_eq!(version(0x0405_07ff), "4.5.7");
        let attitude = EstimatorStatusFlags::ESTIMATOR_ATTITUDE;
        let place = attitude | EstimatorStatusFlags::ESTIMATOR_POS_HORIZ_ABS;
        let constant = place | EstimatorStatusFlags::ESTIMATOR_CONST_POS_MODE;
        assert_eq!(
            [EstimatorStatusFlags::empty(), attitude, place, constant].map(estimator),
            [
                Estimator::Starting,
                Estimator::Bad,
                Estimator::Good,
                Estimator::Bad
            ]
        );
    }
}
