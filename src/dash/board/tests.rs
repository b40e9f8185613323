//! The board: what it keeps, and what it says has changed.

use std::sync::Arc;

use tomoswarm_proto::{
    Boot, Digest, LayerDigest, LayerId, LegReport, Position, Rectangle, Revision, RunId, TileReport,
};

use super::*;
use crate::dash::newest_image::EARLIER_MAX;
use crate::operator::tests_support::{at, heard, report, state};

const LAYER: LayerId = LayerId {
    vehicle: VehicleId(1),
    boot: Boot(1),
};

fn board() -> Board {
    Board::new(7, Lattice::new(0.1))
}

fn tile(x: i32, revision: u32, value: i8) -> Message {
    Message::Tile(TileReport {
        layer: LAYER,
        address: TileAddress { slice: 0, x, y: 0 },
        revision,
        cells: Arc::new([value; TILE_CELLS]),
    })
}

fn image(sequence: u32, part: u16, pixel: i8) -> Image {
    let at = |m| Position::from_metres(m, m, 0.0);
    Image {
        run: RunId(1),
        sequence,
        laps: 1,
        subject: ImageSubject::Change,
        area: Rectangle {
            least: at(0.0),
            greatest: at(4.0),
        },
        columns: 100,
        rows: 40,
        part,
        parts: 2,
        mean_step_udb_per_m: 1,
        mean: vec![pixel; if part == 0 { 3072 } else { 928 }],
        deviation_step_udb_per_m: 1,
        deviation: None,
        finds: Vec::new(),
        links_used: 5,
        links_dropped: 0,
    }
}

fn changes(board: &mut Board, at_s: f64, message: Message) -> Vec<Subject> {
    board.hear(at(at_s), &heard(message));
    board.take_changes().into_iter().collect()
}

#[test]
fn the_newest_tile_is_kept_and_an_older_one_changes_nothing() {
    let mut board = board();
    let address = TileAddress {
        slice: 0,
        x: 3,
        y: 0,
    };
    assert_eq!(
        changes(&mut board, 0.0, tile(3, 2, 17)),
        [Subject::Tile(address)]
    );
    assert_eq!(changes(&mut board, 0.1, tile(3, 1, -17)), []);
    assert_eq!(board.tile(address).unwrap()[0], 17);
    let surer = changes(&mut board, 0.2, tile(3, 3, 12));
    assert_eq!(surer, [], "it is drawn as before");
    let free = changes(&mut board, 0.3, tile(3, 4, -9));
    assert_eq!(free, [Subject::Tile(address)]);
    assert_eq!(board.tile(TileAddress::default()), None);
}

#[test]
fn a_state_changes_the_row_of_its_vehicle_only_when_it_says_more_than_where_it_is() {
    let mut board = board();
    let one = VehicleId(1);
    let row = [Subject::Orders, Subject::State(one), Subject::Vehicle(one)];
    let first = [row.as_slice(), &[Subject::Events]].concat();
    assert_eq!(changes(&mut board, 0.0, Message::State(state(1))), first);
    let moved = tomoswarm_proto::State {
        sequence: 2,
        ..state(1)
    };
    assert_eq!(
        changes(&mut board, 0.2, Message::State(moved.clone())),
        [Subject::State(one)]
    );
    let ordered = tomoswarm_proto::State {
        sequence: 3,
        accepted: (RunId(1), Revision(1)),
        ..moved
    };
    assert_eq!(changes(&mut board, 0.4, Message::State(ordered)), row);
}

#[test]
fn a_lease_that_the_ground_station_says_is_told_at_once() {
    let mut board = board();
    let said = |number| {
        let mut report = report();
        report.lease.number = number;
        Message::Report(report)
    };
    changes(&mut board, 0.0, said(0));
    assert!(changes(&mut board, 1.0, said(1)).contains(&Subject::Orders));
    assert!(!changes(&mut board, 2.0, said(1)).contains(&Subject::Orders));
    assert!(changes(&mut board, 3.0, said(2)).contains(&Subject::Orders));
}

#[test]
fn stops_that_are_said_again_change_nothing_and_one_who_shows_them_does() {
    let mut board = board();
    let stop = tomoswarm_proto::EmergencyStop {
        name: EmergencyName(77_777),
        scope: tomoswarm_proto::StopScope::All,
        by: tomoswarm_proto::OperatorId(1),
    };
    let standing = Message::Standing(tomoswarm_proto::OpenStops {
        open: vec![stop],
        lifted: Vec::new(),
    });
    for (vehicle, expected) in [(1, 1), (1, 0), (2, 1), (2, 0)] {
        let sender = Sender::Vehicle(VehicleId(vehicle));
        board.hear(at(0.0), &HeardMessage::Message(sender, standing.clone()));
        assert_eq!(board.take_changes().len(), expected, "vehicle {vehicle}");
    }
}

#[test]
fn an_image_of_a_later_start_is_newer_also_where_numbers_begin_again() {
    for (earlier, later) in [(0x0007_0003, 0x0008_0001), (0xFFFF_0003, 1)] {
        let mut board = board();
        let hears = |board: &mut Board, sequence| {
            let message = Message::Image(image(sequence, 0, 3));
            !changes(board, 1.0, message).is_empty()
        };
        assert!(hears(&mut board, earlier));
        assert!(hears(&mut board, later), "{later:#x} after {earlier:#x}");
        assert!(!hears(&mut board, earlier), "it is older");
    }
}

#[test]
fn parts_of_one_image_stand_together_and_a_newer_image_takes_the_place_of_all_of_them() {
    let mut board = board();
    let of = |part| Subject::Stripe(ImageSubject::Change, part);
    let finds = Subject::Finds(ImageSubject::Change);
    assert_eq!(
        changes(&mut board, 0.0, Message::Image(image(1, 0, 3))),
        [Subject::Events, finds, of(0)]
    );
    assert_eq!(
        changes(&mut board, 0.0, Message::Image(image(1, 1, 3))),
        [of(1)]
    );
    assert_eq!(
        changes(&mut board, 0.1, Message::Image(image(1, 1, 3))),
        [],
        "it was said again"
    );
    assert_eq!(
        changes(&mut board, 1.0, Message::Image(image(2, 1, 4))),
        [Subject::Events, of(1)]
    );
    assert_eq!(
        changes(&mut board, 1.0, Message::Image(image(1, 0, 3))),
        [],
        "it is older"
    );
    let parts: Vec<u16> = board
        .image(ImageSubject::Change)
        .unwrap()
        .parts
        .keys()
        .copied()
        .collect();
    assert_eq!(parts, [1]);
    let anew = changes(&mut board, 62.0, Message::Image(image(1, 0, 3)));
    assert_eq!(
        anew,
        [Subject::Events, finds, of(0)],
        "the ground station has begun anew"
    );
}

#[test]
fn what_was_found_before_stays_known_for_some_images() {
    let mut board = board();
    for sequence in 1..60 {
        let mut image = image(sequence, 0, 3);
        image.laps = sequence;
        changes(&mut board, f64::from(sequence), Message::Image(image));
    }
    let earlier = &board.image(ImageSubject::Change).unwrap().earlier;
    assert_eq!(earlier.len(), EARLIER_MAX);
    let last = earlier.back().unwrap();
    assert_eq!((last.laps, last.at), (58, at(58.0)));
}

#[test]
fn what_the_map_lacks_is_asked_for_and_nothing_else_is_said() {
    let mut board = board();
    let digest = Digest {
        layers: vec![LayerDigest {
            layer: LAYER,
            tiles: 1,
            revisions: 4,
            hash: 9,
        }],
    };
    let sender = Sender::Vehicle(VehicleId(1));
    board.hear(
        at(0.0),
        &HeardMessage::Message(sender, Message::Digest(digest)),
    );
    let due = board.deadline().unwrap();
    let wants = board.wake(due);
    assert!(
        matches!(&wants[..], [Message::Want(want)] if want.layer == LAYER),
        "{wants:?}"
    );
}

#[test]
fn a_page_that_comes_late_is_sent_everything_that_is_there() {
    let mut board = board();
    for message in [
        Message::State(state(2)),
        tile(1, 1, 9),
        Message::Image(image(1, 0, 3)),
    ] {
        board.hear(at(0.0), &heard(message));
    }
    let tile = Subject::Tile(TileAddress {
        slice: 0,
        x: 1,
        y: 0,
    });
    let two = VehicleId(2);
    let all: Vec<Subject> = board.subjects().into_iter().collect();
    let of = ImageSubject::Change;
    assert_eq!(
        all,
        [
            Subject::Orders,
            Subject::State(two),
            Subject::Ground,
            Subject::Vehicle(two),
            Subject::Events,
            Subject::Finds(of),
            Subject::Track(two),
            tile,
            Subject::Stripe(of, 0)
        ]
    );
}

#[test]
fn plans_that_are_complete_have_a_timetable_and_progress_changes_it() {
    let mut board = board();
    let plan = |vehicle: u8| {
        Message::Plan(Plan {
            vehicle: VehicleId(vehicle),
            run: RunId(1),
            revision: Revision(1),
            members: vec![VehicleId(1), VehicleId(2)],
            ..Plan::default()
        })
    };
    board.hear(at(0.0), &heard(plan(1)));
    assert!(
        board.timetable().is_none(),
        "the plan of vehicle 2 is missing"
    );
    let second = changes(&mut board, 0.1, plan(2));
    assert!(OF_PLANS.iter().all(|of| second.contains(of)) && board.timetable().is_some());
    let mission = Message::Mission(tomoswarm_proto::MissionProgress {
        vehicle: VehicleId(1),
        ..tomoswarm_proto::MissionProgress::default()
    });
    let changed = changes(&mut board, 0.2, mission.clone());
    assert!(changed.contains(&Subject::Progress) && !changed.contains(&Subject::Timetable));
    assert_eq!(changes(&mut board, 0.3, mission), [], "it was said again");
}

#[test]
fn a_row_is_told_anew_when_something_that_it_shows_has_changed() {
    let mut board = board();
    let mut health = tomoswarm_proto::Health {
        vehicle: VehicleId(1),
        ..tomoswarm_proto::Health::default()
    };
    let row = Subject::Vehicle(VehicleId(1));
    let mut is_told = |health: &tomoswarm_proto::Health| {
        changes(&mut board, 0.1, Message::Health(health.clone())).contains(&row)
    };
    assert!(is_told(&health), "it is the first");
    health.samples_waiting = 7;
    health.disk_free_mb = Some(900);
    health.radio = Some(tomoswarm_proto::RadioHealth::default());
    assert!(
        !is_told(&health),
        "records say the one, preflight the others"
    );
    health.hears = vec![VehicleId(2)];
    assert!(is_told(&health));
    health.troubles = vec!["no echo".to_owned()];
    assert!(is_told(&health) && !is_told(&health));

    let mut mission = tomoswarm_proto::MissionProgress {
        vehicle: VehicleId(1),
        ..tomoswarm_proto::MissionProgress::default()
    };
    let mut is_told = |mission: &tomoswarm_proto::MissionProgress| {
        changes(&mut board, 0.2, Message::Mission(*mission)).contains(&row)
    };
    assert!(is_told(&mission));
    mission.progress.done = Some(tomoswarm_proto::StopId(3));
    assert!(!is_told(&mission));
    mission.places_left = 4;
    mission.goal = Some(Position::from_metres(3.0, 4.0, 0.0));
    mission.share = Some(tomoswarm_proto::Permille(9));
    assert!(is_told(&mission), "it has a share");
    mission.share = Some(tomoswarm_proto::Permille(3));
    assert!(!is_told(&mission), "the percent is the same");
    mission.share = Some(tomoswarm_proto::Permille(10));
    assert!(is_told(&mission) && !is_told(&mission));
}

#[test]
fn a_way_is_told_by_itself_when_its_corners_change_and_when_it_ends() {
    let mut board = board();
    let way = Subject::Way(VehicleId(2));
    let on = |board: &mut Board, corners: Option<&[f64]>| {
        let mut state = state(2);
        let place = |x_m: &f64| Position::from_metres(*x_m, 0.0, 0.0);
        state.leg = corners.map(|corners| LegReport {
            route: corners.iter().map(place).collect(),
        });
        changes(board, 0.1, Message::State(state))
    };
    assert!(!on(&mut board, None).contains(&way));
    assert!(on(&mut board, Some(&[0.0, 2.0])).contains(&way));
    let row = Subject::Vehicle(VehicleId(2));
    let moved = on(&mut board, Some(&[1.0, 2.0]));
    assert!(!moved.contains(&way), "its records say where it is");
    let other = on(&mut board, Some(&[1.0, 3.0]));
    assert!(other.contains(&way) && !other.contains(&row));
    assert!(board.subjects().contains(&way));
    let text = |board: &Board| crate::dash::texts::way(board, VehicleId(2));
    let ahead = r#"{"id":2,"ahead":[[3.0,0.0]]}"#;
    assert_eq!(text(&board).as_deref(), Some(ahead));
    assert!(on(&mut board, None).contains(&way));
    let none = r#"{"id":2,"ahead":null}"#;
    assert_eq!(text(&board).as_deref(), Some(none));
    assert!(!board.subjects().contains(&way));
}

#[test]
fn samples_change_their_pair() {
    let mut board = board();
    let sample = tomoswarm_proto::Sample {
        sequence: 1,
        heard_at_ns: 1,
        transmitter: VehicleId(2),
        transmitter_pose: tomoswarm_proto::PoseReport::default(),
        receiver_pose: tomoswarm_proto::PoseReport::default(),
        channel: 20,
        power_dbm: 0,
        rssi_dbm: Some(-60),
    };
    let batch = Message::Samples(tomoswarm_proto::Samples {
        vehicle: VehicleId(1),
        samples: vec![sample],
        ..tomoswarm_proto::Samples::default()
    });
    let pair = (VehicleId(1), VehicleId(2));
    assert_eq!(changes(&mut board, 0.0, batch), [Subject::Radio(pair)]);
    assert_eq!(board.radio().pair(pair).unwrap().rssi_dbm, Some(-60));
}
