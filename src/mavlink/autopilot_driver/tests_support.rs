//! What the tests of the driver's parts are told.

use super::{MavlinkDriverSettings, PlaceSource};
use crate::autopilot::VehicleKind;
use crate::geom::{Bearing, Geodetic};
use crate::mavlink::earth_frame::EarthFrame;
use crate::mavlink::frames::MavAddress;

/// Returns the settings of a rover's driver.
pub(super) fn settings() -> MavlinkDriverSettings {
    let datum = Geodetic {
        latitude_deg: 52.0,
        longitude_deg: 4.0,
        altitude_m: 3.0,
    };
    MavlinkDriverSettings {
        own: MavAddress {
            system: 255,
            component: 191,
        },
        system: 1,
        kind: VehicleKind::Rover,
        frame: EarthFrame::new(datum, Bearing::from_degrees(40.0)),
        place: PlaceSource::Global,
        sets_origin: false,
        place_sd_min_m: 0.01,
        switch: None,
        arms_without_failsafes: true,
        takes_fixes: true,
        ranges: None,
    }
}
