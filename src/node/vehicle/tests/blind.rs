//! A vehicle without a range sensor is not driven, whatever others have seen free.

use super::*;

#[test]
fn a_vehicle_without_a_range_sensor_is_refused_every_drive_and_may_turn() {
    let mut settings = settings(1);
    let drive = drive(&[(0.0, 0.0), (1.0, 0.0)]);
    for is_blind in [false, true] {
        settings.look.is_blind = is_blind;
        let mut vehicle = Vehicle::new(settings.clone());
        fed(&mut vehicle, 1.0, telemetry(0.0, 0.0, 0.05));
        let out = fed(&mut vehicle, 1.1, drive.clone());
        assert_eq!(
            (flies(&out), refusal(&out)),
            (!is_blind, is_blind.then_some(CommandRefusal::Blind)),
            "{out:?}"
        );
        let turn = In::Command(Time::NEVER, MoveCommand::Turn(Angle::from_degrees(90.0)));
        assert!(flies(&fed(&mut vehicle, 1.2, turn)));
    }
}
