//! Several vehicles whose ways cross in an empty yard make room for each other, and all of them do everything: a sample. All
//! of it: `cargo bench --bench yards -- 20`.

use crate::yard_trial::{YardMission, YardTrial};

#[test]
fn vehicles_in_an_empty_yard_make_room_for_each_other_and_do_everything() {
    for (mission, side_m, vehicles) in [
        (YardMission::SmallSquare, 8.0, 4),
        (YardMission::Square, 8.0, 8),
        (YardMission::Waypoints, 8.0, 6),
        (YardMission::Waypoints, 12.0, 2),
        (YardMission::Forward, 12.0, 4),
        (YardMission::Pathfind, 8.0, 8),
        (YardMission::Patrol, 8.0, 4),
    ] {
        let trial = YardTrial {
            mission,
            vehicles,
            side_m,
            seed: 1,
        };
        let result = trial.run();
        assert_eq!(
            (result.done, result.home, result.mishaps),
            (vehicles, vehicles, 0),
            "{result:?}"
        );
    }
}
