//! Files as ground stations write them, everything that can be wrong with one, and there and back.

use super::*;
use crate::geom::Bearing;
use proptest::prelude::*;

/// A line with tabs where the table has blanks.
fn wpl(lines: &[&str]) -> String {
    let tabbed = |line: &&str| line.split(' ').collect::<Vec<_>>().join("\t");
    format!(
        "QGC WPL 110\n{}\n",
        lines.iter().map(tabbed).collect::<Vec<_>>().join("\n")
    )
}

const HOME: &str = "0 1 0 16 0 0 0 0 52.1 4.5 12 1";

fn plan(items: &str) -> String {
    format!(
        r#"{{"fileType": "Plan", "version": 1, "groundStation": "QGroundControl", "geoFence": {{"version": 2}},
          "mission": {{"version": 2, "firmwareType": 3, "plannedHomePosition": [52.1, 4.5, 12], "items": [{items}]}}}}"#
    )
}

fn simple(command: u32, frame: u32, params: &str) -> String {
    format!(
        r#"{{"type": "SimpleItem", "autoContinue": true, "doJumpId": 1, "command": {command}, "frame": {frame}, "params": [{params}]}}"#
    )
}

fn target(spot: Option<(f64, f64)>, altitude_m: f64, above: Above) -> Target {
    let spot = spot.map(|(latitude_deg, longitude_deg)| Spot {
        latitude_deg,
        longitude_deg,
    });
    Target {
        spot,
        altitude_m,
        above,
    }
}

fn refused(text: &str) -> String {
    WaypointFile::read("m.waypoints", text)
        .unwrap_err()
        .to_string()
}

/// Checks that a file is refused, and that the message says all the given words.
fn check_refused(text: &str, words: &[&str]) {
    let message = refused(text);
    assert!(
        words.iter().all(|word| message.contains(word)),
        "{message}\nlacks one of {words:?}"
    );
}

#[test]
fn every_command_of_a_text_file_gets_its_meaning() {
    let text = wpl(&[
        HOME,
        "1 0 3 22 15 0 0 0 0 0 10 1",
        "2 0 3 16 5 2.5 0 0 52.1001 4.5002 10 1",
        "3 0 2 178 1 3.5 -1 0 0 0 0 1",
        "4 0 10 19 30 0 0 0 52.1002 4.5003 8 1",
        "5 0 2 183 9 1500 0 0 0 0 0 1",
        "6 0 2 115 90 20 -1 1 0 0 0 1",
        "7 0 3 93 4 -1 -1 -1 0 0 0 1",
        "8 0 0 17 0 0 0 0 0 0 20 1",
        "9 0 0 20 0 0 0 0 0 0 0 1",
        "10 0 3 21 0 0 0 0 52.1 4.5 0 1",
    ]);
    let file = WaypointFile::read("m.waypoints", &text).unwrap();
    assert_eq!(
        file.home,
        Some(Geodetic {
            latitude_deg: 52.1,
            longitude_deg: 4.5,
            altitude_m: 12.0
        })
    );
    let to = target(Some((52.1001, 4.5002)), 10.0, Above::Home);
    let expected = [
        MissionItem::Takeoff {
            to: target(None, 10.0, Above::Home),
        },
        MissionItem::Waypoint {
            to,
            hold_s: 5.0,
            radius_m: 2.5,
        },
        MissionItem::ChangeSpeed {
            of: SpeedOf::Ground,
            speed_mps: 3.5,
        },
        MissionItem::LoiterTime {
            at: target(Some((52.1002, 4.5003)), 8.0, Above::Ground),
            time_s: 30.0,
        },
        MissionItem::SetServo {
            channel: 9,
            pulse_us: 1500.0,
        },
        MissionItem::Yaw {
            angle_deg: 90.0,
            rate_dps: 20.0,
            turning: TurnDirection::CounterClockwise,
            is_relative: true,
        },
        MissionItem::Delay { time_s: 4.0 },
        MissionItem::Loiter {
            at: target(None, 20.0, Above::Sea),
        },
        MissionItem::ReturnToLaunch,
        MissionItem::Land {
            at: target(Some((52.1, 4.5)), 0.0, Above::Home),
        },
    ];
    assert_eq!(file.items(), expected);
}

#[test]
fn a_text_file_may_have_blanks_other_line_ends_and_remarks() {
    let text = "\u{feff}QGC WPL 110\r\n# made by hand\r\n0 1 0 16 0 0 0 0 0 0 0 1\r\n\r\n1  0 3 16 0.000 0 0 0 -33.9 18.4 1e0 1";
    let file = WaypointFile::read("m.txt", text).unwrap();
    assert_eq!(file.home, None, "zeros are no home");
    assert_eq!(
        file.items()[0].spot(),
        Some(Spot {
            latitude_deg: -33.9,
            longitude_deg: 18.4
        })
    );
    let problem = file
        .problem("m.txt", 0, "lies outside the fence", "")
        .to_string();
    assert_eq!(
        problem,
        "m.txt:5: item 1 = command 16 at -33.9, 18.4: lies outside the fence"
    );
}

#[test]
fn a_plan_is_read_as_the_same_mission() {
    let items = [
        simple(22, 3, "0, 0, 0, null, null, null, 10"),
        simple(16, 3, "5, 0, 0, null, 52.1001, 4.5002, 10"),
        simple(178, 2, "1, 3.5, -1, 0, 0, 0, 0"),
        simple(20, 2, "0, 0, 0, 0, 0, 0, 0"),
    ];
    let file = WaypointFile::read("m.plan", &plan(&items.join(","))).unwrap();
    let text = wpl(&[
        HOME,
        "1 0 3 22 0 0 0 0 0 0 10 1",
        "2 0 3 16 5 0 0 0 52.1001 4.5002 10 1",
        "3 0 2 178 1 3.5 -1 0 0 0 0 1",
        "4 0 2 20 0 0 0 0 0 0 0 1",
    ]);
    let same = WaypointFile::read("m.waypoints", &text).unwrap();
    assert_eq!((file.home, file.items()), (same.home, same.items()));
    let problem = file
        .problem("m.plan", 1, "lies outside the fence", "")
        .to_string();
    assert_eq!(
        problem,
        "m.plan: mission.items[1] = command 16 at 52.1001, 4.5002: lies outside the fence"
    );
}

#[test]
fn places_are_given_in_the_local_frame() {
    let datum = Geodetic {
        latitude_deg: 52.1,
        longitude_deg: 4.5,
        altitude_m: 12.0,
    };
    let frame = TangentPlane::new(datum, Bearing::from_degrees(90.0));
    let track: Vec<Geodetic> = [[3.0, 4.0, 0.0], [-8.0, 0.5, 0.0]]
        .iter()
        .map(|at| frame.to_earth(*at))
        .collect();
    let file = WaypointFile::of_track(datum, &track).unwrap();
    let points = file.points(&frame);
    assert_eq!(points.len(), 2);
    assert!(
        points[0].1.distance_to(Point::new(3.0, 4.0)) < 1e-6,
        "{points:?}"
    );
    assert!(
        points[1].1.distance_to(Point::new(-8.0, 0.5)) < 1e-6,
        "{points:?}"
    );
}

#[test]
fn the_track_of_a_copter_takes_off_and_keeps_its_height() {
    let datum = Geodetic {
        latitude_deg: 52.1,
        longitude_deg: 4.5,
        altitude_m: 12.0,
    };
    let frame = TangentPlane::new(datum, Bearing::from_degrees(90.0));
    let track = [[3.0, 4.0, 2.5], [-8.0, 0.5, 2.5]].map(|at| frame.to_earth(at));
    let file = WaypointFile::of_track(datum, &track).unwrap();
    let flown = file.with_takeoff(2.5);
    let heights = |file: &WaypointFile| -> Vec<f64> {
        let height = |item: &MissionItem| match item {
            MissionItem::Takeoff { to } | MissionItem::Waypoint { to, .. } => to.altitude_m,
            other => panic!("{other:?}"),
        };
        file.items().iter().map(height).collect()
    };
    assert!(matches!(flown.items()[0], MissionItem::Takeoff { .. }));
    assert_eq!(heights(&flown), [2.5, 2.5, 2.5]);
    assert_eq!(
        flown.points(&frame).len(),
        2,
        "it takes off where it stands"
    );
    let read = WaypointFile::read("m.waypoints", &flown.to_wpl()).unwrap();
    assert_eq!(read.items(), flown.items());
}

#[test]
fn what_is_wrong_in_a_text_file_is_said_with_line_value_and_rule() {
    check_refused(
        "QGC WPL 100\n",
        &["m.waypoints:1: line = QGC WPL 100: is of another version; \"QGC WPL 110\""],
    );
    check_refused(
        "hello",
        &["m.waypoints:1: line = hello: is no waypoint file"],
    );
    check_refused("", &["is no waypoint file"]);
    check_refused(&wpl(&[HOME]), &["m.waypoints: items = none: is no mission"]);
    check_refused(
        &wpl(&[HOME, "1 0 3 16 0 0 0 0 91 4.5 0 1"]),
        &[":3: latitude = 91: is out of range; -90 to 90"],
    );
    check_refused(
        &wpl(&[HOME, "1 0 3 16 0 0 0 0 52 180.5 0 1"]),
        &["longitude = 180.5: is out of range"],
    );
    check_refused(
        &wpl(&[HOME, "1 0 3 16 0 0 0 0 52 4 1e9 1"]),
        &["altitude = 1000000000: is out of range"],
    );
    check_refused(
        &wpl(&[HOME, "1 0 3 16 0 0 0 0 NaN 4.5 0 1"]),
        &["latitude = NaN: is no number"],
    );
    check_refused(
        &wpl(&[HOME, "1 0 3 16 inf 0 0 0 52 4.5 0 1"]),
        &["param1 = inf: is no number"],
    );
    check_refused(
        &wpl(&[HOME, "1 0 3 16 -1 0 0 0 52 4.5 0 1"]),
        &["param1 = -1: is out of range"],
    );
    check_refused(
        &wpl(&[HOME, "1 0 1 16 0 0 0 0 52 4.5 0 1"]),
        &["frame = 1: is not known; 0 (above the sea)"],
    );
    check_refused(
        &wpl(&[HOME, "1 0 3 400 0 0 0 0 52 4.5 0 1"]),
        &["command = 400: is not known; 16 (waypoint)"],
    );
    check_refused(
        &wpl(&[HOME, "2 0 3 16 0 0 0 0 52 4.5 0 1"]),
        &["index = 2: is out of order", "1 is the next"],
    );
    check_refused(
        &wpl(&[HOME, "1 0 3 16 0 0 0 52 4.5 0 1"]),
        &["has not twelve fields"],
    );
    check_refused(
        &wpl(&[HOME, "1 0 3 16 0 0 0 0 52 4.5 0 1 7"]),
        &["has not twelve fields"],
    );
    check_refused(
        &wpl(&[HOME, "1 0 3 16 0 0 0 0 52 4.5 0 2"]),
        &["autocontinue = 2: is no flag"],
    );
    check_refused(
        &wpl(&["0 1 0 22 0 0 0 0 52 4.5 0 1"]),
        &[":2: command = 22: is no home"],
    );
    check_refused(
        &wpl(&["0 1 0 16 0 0 0 0 92 4.5 0 1"]),
        &[":2: latitude = 92: is out of range"],
    );
    check_refused(
        &wpl(&[HOME, "1 0 2 183 0 1500 0 0 0 0 0 1"]),
        &["param1 = 0: is out of range; 1 to 32"],
    );
    check_refused(
        &wpl(&[HOME, "1 0 2 183 2.5 1500 0 0 0 0 0 1"]),
        &["param1 = 2.5: is not whole"],
    );
    check_refused(
        &wpl(&[HOME, "1 0 2 178 1 0 0 0 0 0 0 1"]),
        &["param2 = 0: is out of range; 0.001 to 100"],
    );
    let both = refused(&wpl(&[
        HOME,
        "1 0 3 16 0 0 0 0 95 4.5 0 1",
        "2 0 3 16 0 0 0 0 52 999 0 1",
    ]));
    assert_eq!(both.lines().count(), 2, "{both}");
}

#[test]
fn what_is_wrong_in_a_plan_is_said_with_its_path() {
    let good = simple(16, 3, "0, 0, 0, null, 52, 4.5, 10");
    check_refused("{\n\"fileType\": ", &["m.waypoints:2: no valid JSON"]);
    check_refused(
        &plan(&good).replace("\"version\": 1", "\"version\": 2"),
        &["version = 2: is of another kind"],
    );
    check_refused(
        &plan(&good).replace(
            "\"mission\": {\"version\": 2",
            "\"mission\": {\"version\": 3",
        ),
        &["mission.version = 3: is of another kind or version; 2 is needed"],
    );
    check_refused(
        &plan(&good).replace("\"Plan\"", "\"Parameters\""),
        &["fileType = \"Parameters\""],
    );
    check_refused(
        &plan(&good).replace("[52.1, 4.5, 12]", "[152.1, 4.5, 12]"),
        &["mission.plannedHomePosition"],
    );
    check_refused(
        &plan("{\"type\": \"ComplexItem\"}"),
        &["mission.items[0].type = \"ComplexItem\": is not known"],
    );
    check_refused(&plan("7"), &["mission.items[0] = 7: is no item"]);
    check_refused(&plan(""), &["items = none: is no mission"]);
    let items = format!("{good}, {}", simple(16, 3, "0, 0, 0, null, null, 4.5, 10"));
    check_refused(
        &plan(&items),
        &["mission.items[1].params[4] = null: is needed; -90 to 90 is allowed (degrees)"],
    );
    check_refused(
        &plan(&simple(16, 3, "0, 0, 0, 0, 52, 200, 10")),
        &["params[5] = 200: is out of range"],
    );
    check_refused(
        &plan(&simple(16, 3, "0, 0, 0, 0, \"x\", 4, 10")),
        &["params[4] = \"x\": is no number"],
    );
    check_refused(
        &plan(&simple(16, 3, "0, 0, 0")),
        &["mission.items[0].params", "is no list of seven"],
    );
    check_refused(
        &plan(&simple(16, 3, "0, 0, 0, 0, 1e999, 4, 10")),
        &["no valid JSON: number out of range"],
    );
    check_refused(
        &plan(&good).replace("\"frame\": 3", "\"frame\": -1"),
        &["frame = -1: is no such number"],
    );
}

#[test]
fn huge_files_are_refused_and_not_every_mistake_is_listed() {
    check_refused(
        &" ".repeat(MOST_WAYPOINT_BYTES + 1),
        &["size = 4194305 bytes: is too long"],
    );
    let many: Vec<String> = (0..=MOST_ITEMS + 1)
        .map(|k| format!("{k} 0 3 16 0 0 0 0 52 4 0 1"))
        .collect();
    check_refused(
        &format!("QGC WPL 110\n{}", many.join("\n")),
        &["index = 10001: is too high"],
    );
    let bad = vec!["x"; 5000].join("\n");
    assert_eq!(
        refused(&format!("QGC WPL 110\n{bad}")).lines().count(),
        MOST_PROBLEMS
    );
    let deep = "{\"a\":".repeat(100_000);
    check_refused(&deep, &["no valid JSON: recursion limit"]);
    let items = vec!["1"; MOST_ITEMS + 1].join(",");
    check_refused(
        &plan(&items),
        &["mission.items = 10001 items: are too many"],
    );
}

#[test]
fn a_track_that_cannot_be_written_is_refused() {
    let home = Geodetic {
        latitude_deg: 52.0,
        longitude_deg: 4.0,
        altitude_m: 0.0,
    };
    assert!(WaypointFile::of_track(home, &[]).is_err());
    assert!(WaypointFile::of_track(home, &vec![home; MOST_ITEMS + 1]).is_err());
    assert!(
        WaypointFile::of_track(
            home,
            &[Geodetic {
                latitude_deg: f64::NAN,
                ..home
            }]
        )
        .is_err()
    );
    assert!(
        WaypointFile::of_track(
            Geodetic {
                longitude_deg: 181.0,
                ..home
            },
            &[home]
        )
        .is_err()
    );
}

fn any_target(needs_spot: bool) -> impl Strategy<Value = Target> {
    let above = prop_oneof![Just(Above::Sea), Just(Above::Home), Just(Above::Ground)];
    (
        any::<bool>(),
        -90.0..=90.0f64,
        -180.0..=180.0f64,
        -500.0..9000.0f64,
        above,
    )
        .prop_map(move |(has_spot, latitude, longitude, altitude_m, above)| {
            target(
                (needs_spot || has_spot).then_some((latitude, longitude)),
                altitude_m,
                above,
            )
        })
}

fn any_item() -> impl Strategy<Value = MissionItem> {
    let of = prop_oneof![
        Just(SpeedOf::Air),
        Just(SpeedOf::Ground),
        Just(SpeedOf::Climb),
        Just(SpeedOf::Descent)
    ];
    let turning = prop_oneof![
        Just(TurnDirection::Shortest),
        Just(TurnDirection::Clockwise),
        Just(TurnDirection::CounterClockwise)
    ];
    prop_oneof![
        (any_target(true), 0.0..100.0f64, 0.0..50.0f64).prop_map(|(to, hold_s, radius_m)| {
            MissionItem::Waypoint {
                to,
                hold_s,
                radius_m,
            }
        }),
        any_target(false).prop_map(|at| MissionItem::Loiter { at }),
        (any_target(false), 0.0..1e4f64)
            .prop_map(|(at, time_s)| MissionItem::LoiterTime { at, time_s }),
        Just(MissionItem::ReturnToLaunch),
        any_target(false).prop_map(|at| MissionItem::Land { at }),
        any_target(false).prop_map(|to| MissionItem::Takeoff { to }),
        (0.0..1e4f64).prop_map(|time_s| MissionItem::Delay { time_s }),
        (0.0..=360.0f64, 0.0..90.0f64, turning, any::<bool>()).prop_map(
            |(angle_deg, rate_dps, turning, is_relative)| {
                MissionItem::Yaw {
                    angle_deg,
                    rate_dps,
                    turning,
                    is_relative,
                }
            }
        ),
        (of, 0.01..30.0f64).prop_map(|(of, speed_mps)| MissionItem::ChangeSpeed { of, speed_mps }),
        (1..=32u8, 500.0..=2500.0f64)
            .prop_map(|(channel, pulse_us)| MissionItem::SetServo { channel, pulse_us }),
    ]
}

proptest! {
    #[test]
    fn what_is_written_is_read_as_the_same(
        items in proptest::collection::vec(any_item(), 1..30),
        home in proptest::option::of((-90.0..=90.0f64, -180.0..=180.0f64, -100.0..3000.0f64)),
    ) {
        let home = home.map(|(latitude_deg, longitude_deg, altitude_m)| Geodetic { latitude_deg, longitude_deg, altitude_m });
        let mut file = WaypointFile { home, items: Vec::new(), origins: Vec::new() };
        items.iter().for_each(|item| file.push(*item, wpl::origin_of(file.items.len())));
        let back = WaypointFile::read("m.waypoints", &file.to_wpl()).unwrap();
        let plan = WaypointFile::read("t.plan", &file.to_plan()).unwrap();
        prop_assert_eq!((plan.items(), plan.home), (file.items(), file.home));
        prop_assert_eq!(back, file);
    }

    #[test]
    fn a_track_comes_back_from_its_file(
        places in proptest::collection::vec((-90.0..=90.0f64, -180.0..=180.0f64, 0.0..100.0f64), 1..50),
    ) {
        let track: Vec<Geodetic> = places.into_iter()
            .map(|(latitude_deg, longitude_deg, altitude_m)| Geodetic { latitude_deg, longitude_deg, altitude_m })
            .collect();
        let file = WaypointFile::of_track(track[0], &track).unwrap();
        let back = WaypointFile::read("t.waypoints", &file.to_wpl()).unwrap();
        let spots: Vec<_> = track.iter()
            .map(|at| Some(Spot { latitude_deg: at.latitude_deg, longitude_deg: at.longitude_deg }))
            .collect();
        prop_assert_eq!(back.items().iter().map(MissionItem::spot).collect::<Vec<_>>(), spots);
        prop_assert_eq!(back, file);
    }

    #[test]
    fn no_text_makes_it_fall_over(text in "(QGC WPL 110\n)?[ -~\t\n]{0,200}", flipped in 0..400usize, by in any::<char>()) {
        let _ = WaypointFile::read("x", &text);
        let good = plan(&simple(16, 3, "5, 0, 0, null, 52.1001, 4.5002, 10"));
        let broken: String = good.chars().enumerate().map(|(at, c)| if at == flipped { by } else { c }).collect();
        let _ = WaypointFile::read("x", &broken);
    }
}

#[test]
fn for_an_autopilot_jumps_and_commands_that_are_not_known_here_are_read_as_well() {
    let lines = [
        HOME,
        "1 0 3 16 2 0 0 0 52 4.5 7 1",
        "2 0 3 82 1 0 0 0 52 4.6 8 1",
        "3 0 2 203 1 2 3 4 0 0 0 1",
        "4 0 2 177 1 -1 0 0 0 0 0 1",
    ];
    let file = WaypointFile::read_stored("m.waypoints", &wpl(&lines)).unwrap();
    let other = |command, at, parameters: [f64; 4]| MissionItem::Other {
        command,
        at,
        parameters: parameters.map(Some),
    };
    let spline = target(Some((52.0, 4.6)), 8.0, Above::Home);
    assert_eq!(
        file.items()[1..],
        [
            other(82, Some(spline), [1.0, 0.0, 0.0, 0.0]),
            other(203, None, [1.0, 2.0, 3.0, 4.0]),
            MissionItem::Jump { to: 1, times: None },
        ]
    );
    assert_eq!(
        file.points(&venue().plane()).len(),
        2,
        "both lead somewhere"
    );
    for text in [file.to_wpl(), file.to_plan()] {
        let again = WaypointFile::read_stored("m.waypoints", &text).unwrap();
        assert_eq!(
            (again.items(), again.home),
            (file.items(), file.home),
            "{text}"
        );
    }
}

#[test]
fn a_jump_of_a_plan_names_its_item_by_the_number_that_it_was_given() {
    let item = |id: u32, command: u32, params: &str| {
        simple(command, 3, params).replace("\"doJumpId\": 1", &format!("\"doJumpId\": {id}"))
    };
    let place = "0, 0, 0, null, 52, 4.5, 3";
    let items = [
        item(4, 16, place),
        item(9, 16, place),
        item(10, 177, "9, 3, 0, 0, 0, 0, 0"),
    ];
    let file = WaypointFile::read_stored("m.plan", &plan(&items.join(","))).unwrap();
    let jump = MissionItem::Jump {
        to: 2,
        times: Some(3),
    };
    assert_eq!(file.items()[2], jump);
}

#[test]
fn what_an_autopilot_could_not_store_is_told_by_its_line() {
    let refused = |line: &str| {
        let text = wpl(&[HOME, line]);
        let file = WaypointFile::read_stored("m.waypoints", &text);
        let stored = file.and_then(|file| file.stored_items("m.waypoints", &venue()));
        stored.unwrap_err().to_string()
    };
    for (line, said) in [
        (
            "1 0 2 177 2 1 0 0 0 0 0 1",
            "m.waypoints:3: param1 = 2: leads to no item; 1 to 1 is allowed",
        ),
        (
            "1 0 2 177 1 0.5 0 0 0 0 0 1",
            "m.waypoints:3: param2 = 0.5: is not whole",
        ),
        (
            "1 0 2 203 0 0 0 0 0 0 5 1",
            "m.waypoints:3: altitude = 5: is given without a place",
        ),
        (
            "1 0 3 70000 0 0 0 0 0 0 5 1",
            "m.waypoints:3: command = 70000: is none",
        ),
        (
            "1 0 7 82 0 0 0 0 52 4.5 5 1",
            "m.waypoints:3: frame = 7: is not known",
        ),
        (
            "1 0 10 16 0 0 0 0 52 4.5 5 1",
            "has a height above the ground, which is not known here",
        ),
    ] {
        let output = refused(line);
        assert!(output.contains(said), "{line}: {output}");
    }
    let long = vec!["0 0 3 16 0 0 0 0 52 4.5 0 1"; 718];
    let lines: Vec<String> = long
        .iter()
        .enumerate()
        .map(|(index, line)| line.replacen('0', &(index + 1).to_string(), 1))
        .collect();
    let lines: Vec<&str> = std::iter::once(HOME)
        .chain(lines.iter().map(String::as_str))
        .collect();
    let file = WaypointFile::read_stored("m.waypoints", &wpl(&lines)).unwrap();
    let output = file.stored_items("m.waypoints", &venue()).unwrap_err();
    assert!(
        output.to_string().contains("m.waypoints:720: item 718"),
        "{output}"
    );
}

#[test]
fn a_file_becomes_what_travels_with_heights_above_home_and_places_of_the_venue() {
    use tomoswarm_proto::{Heading, Parameter, Position, StoredItem};
    let lines = [
        HOME,
        "1 0 3 22 0 0 0 0 0 0 3.5 1",
        "2 0 0 16 1.5 0 0 0 52.1 4.5 14 1",
        "3 0 3 19 4 0 0 0 0 0 2 1",
        "4 0 2 115 90 0 0 0 0 0 0 1",
        "5 0 2 115 90 10 1 1 0 0 0 1",
        "6 0 2 178 1 0.5 -1 0 0 0 0 1",
        "7 0 2 183 9 1700 0 0 0 0 0 1",
        "8 0 3 21 0 0 0 0 0 0 0 1",
        "9 0 3 20 0 0 0 0 0 0 0 1",
    ];
    let file = WaypointFile::read_stored("m.waypoints", &wpl(&lines)).unwrap();
    let items = file.stored_items("m.waypoints", &venue()).unwrap();
    let StoredItem::Waypoint { at, stay_ms: 1500 } = items[1] else {
        panic!("{:?}", items[1])
    };
    // The venue's datum is there, and home 12 m above the sea.
    assert_eq!((at.x_mm, at.y_mm, at.z_mm), (0, 0, 2000));
    let _: Position = at;
    assert_eq!(items[0], StoredItem::Takeoff { height_mm: 3500 });
    assert_eq!(items[2], StoredItem::Delay(4000), "it stays where it is");
    assert_eq!(items[3], StoredItem::Yaw(Heading(0)), "east is along x");
    let StoredItem::Other {
        command: 115,
        at: None,
        parameters,
    } = items[4]
    else {
        panic!("a turn by an angle is the autopilot's own: {:?}", items[4])
    };
    assert_eq!(parameters.map(Parameter::number), [90.0, 10.0, 1.0, 1.0]);
    assert_eq!(
        items[5..],
        [
            StoredItem::Speed(500),
            StoredItem::Servo {
                channel: 9,
                pulse_us: 1700
            },
            StoredItem::Land(None),
            StoredItem::Return,
        ]
    );
}

/// A venue whose datum is the home of these files, and whose x axis leads east.
fn venue() -> crate::config::Venue {
    let text = "kind = \"venue\"\narea_m = [0.0, 0.0, 9.0, 9.0]\nhomes_m = [[-2.0, 0.0]]\n\
                fence_m = [[-9.0, -9.0], [20.0, -9.0], [20.0, 20.0], [-9.0, 20.0]]\n\
                [datum]\nlatitude_deg = 52.1\nlongitude_deg = 4.5\naltitude_m = 12.0\n";
    match crate::config::read("v.toml", text, &mut |_| Err("no file".to_owned())) {
        Ok(crate::config::Config::Venue(venue)) => venue,
        other => panic!("{other:?}"),
    }
}
