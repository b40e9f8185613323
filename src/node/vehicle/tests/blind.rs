//! A vehicle without a range sensor is not driven, whatever others have seen free.

use super::*;
use crate::plan::{Mount, Mounts};

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

#[test]
fn a_vehicle_sees_while_all_of_its_range_sensors_answer() {
    let fixed = |zero_deg: f64| Mount {
        zero: Angle::from_degrees(zero_deg),
        from_rad: 0.0,
        to_rad: 0.0,
        slew_s_per_rad: 0.0,
    };
    for sensors in [1, 2] {
        let mut settings = settings(1);
        settings.look.beams = [0.0, 180.0].map(Angle::from_degrees).to_vec();
        if sensors == 2 {
            settings.look.mounts = Mounts::new(vec![fixed(0.0), fixed(180.0)]);
        }
        let mut vehicle = Vehicle::new(settings);
        let mut sees = Vec::new();
        // Both answer for 3 s, then that to the rear alone; from 6 s on both again.
        for tenth in 0..90 {
            let now_s = 1.0 + 0.1 * f64::from(tenth);
            fed(&mut vehicle, now_s, scan(2.0, 180.0));
            if !(30..60).contains(&tenth) {
                fed(&mut vehicle, now_s, scan(2.0, 0.0));
            }
            let out = fed(&mut vehicle, now_s, telemetry(0.0, 0.0, 0.05));
            sees.extend(out.iter().filter_map(|out| match out {
                Out::State(state) => Some(state.sees),
                _ => None,
            }));
        }
        let silent = sees.iter().filter(|sees| !**sees).count();
        assert!(sees[..40].iter().all(|sees| *sees) && sees[60..].iter().all(|sees| *sees));
        // A second and a round of two readings after the last answer.
        assert!(
            if sensors == 1 {
                silent == 0
            } else {
                (16..=20).contains(&silent)
            },
            "{silent}"
        );
    }
}
