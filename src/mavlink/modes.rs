//! Flight modes by the numbers that ArduPilot gives them, for each kind of vehicle
//! (<https://ardupilot.org/rover/docs/parameters.html#mode1>, <https://ardupilot.org/copter/docs/parameters.html#fltmode1>).

use crate::autopilot::{FlightMode, VehicleKind};

/// A mode as an autopilot may show it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ShownMode {
    /// One that we know.
    Known(FlightMode),
    /// Any other, by its number.
    Other(u32),
}

/// Numbers of a rover's modes.
const ROVER: [(u32, FlightMode); 6] = [
    (0, FlightMode::Manual),
    (4, FlightMode::Hold),
    (5, FlightMode::Loiter),
    (10, FlightMode::Auto),
    (11, FlightMode::Return),
    (15, FlightMode::Guided),
];
/// Numbers of a copter's modes.
const COPTER: [(u32, FlightMode); 6] = [
    (0, FlightMode::Manual),
    (3, FlightMode::Auto),
    (4, FlightMode::Guided),
    (5, FlightMode::Loiter),
    (6, FlightMode::Return),
    (9, FlightMode::Land),
];

fn table(kind: VehicleKind) -> &'static [(u32, FlightMode)] {
    match kind {
        VehicleKind::Rover => &ROVER,
        VehicleKind::Copter => &COPTER,
    }
}

/// Returns the number of a mode; `None` when the kind of vehicle has none such.
pub fn number_of(kind: VehicleKind, mode: FlightMode) -> Option<u32> {
    let found = table(kind).iter().find(|(_, known)| *known == mode);
    found.map(|(number, _)| *number)
}

/// Returns the mode of a number.
pub fn mode_of(kind: VehicleKind, number: u32) -> ShownMode {
    let found = table(kind).iter().find(|(known, _)| *known == number);
    found.map_or(ShownMode::Other(number), |(_, mode)| {
        ShownMode::Known(*mode)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mode_of_a_kind_has_a_number_and_back() {
        let modes = [
            FlightMode::Manual,
            FlightMode::Hold,
            FlightMode::Loiter,
            FlightMode::Guided,
            FlightMode::Auto,
            FlightMode::Return,
            FlightMode::Land,
        ];
        for kind in [VehicleKind::Rover, VehicleKind::Copter] {
            for mode in modes {
                let number = number_of(kind, mode);
                assert_eq!(number.is_some(), mode.is_of(kind));
                if let Some(number) = number {
                    assert_eq!(mode_of(kind, number), ShownMode::Known(mode));
                }
            }
        }
        assert_eq!(mode_of(VehicleKind::Rover, 1), ShownMode::Other(1));
    }
}
