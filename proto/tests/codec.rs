//! What the codec promises: every message survives the way there and back, and nothing else is let in.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    reason = "no product code"
)]

mod any;
mod examples;

use any::message;
use examples::{examples, samples, variants};
use proptest::prelude::*;
use tomoswarm_proto::codec::{
    DecodeError, Decoded, Greeting, LIMIT, VERSION, decode, encode, greeting, pack, unpack,
};
use tomoswarm_proto::*;

fn frame(message: &Message) -> Vec<u8> {
    encode(message).unwrap()
}

/// Decodes a frame of a kind that is known.
fn decode_message(frame: &[u8]) -> Result<Message, DecodeError> {
    decode(frame).map(|decoded| match decoded {
        Decoded::Message(message) => message,
        Decoded::Unknown(kind) => panic!("kind {kind} is not known"),
    })
}

#[test]
fn a_frame_cut_anywhere_is_refused() {
    for (name, message) in examples() {
        let frame = frame(&message);
        for length in 0..frame.len() {
            assert!(
                decode(&frame[..length]).is_err(),
                "{name} cut to {length} bytes"
            );
        }
    }
}

#[test]
fn bytes_behind_the_message_are_refused() {
    for (name, message) in examples() {
        let mut frame = frame(&message);
        frame.push(0);
        assert_eq!(
            decode(&frame),
            Err(DecodeError::Trailing { count: 1 }),
            "{name}"
        );
    }
}

#[test]
fn frames_of_others_are_refused() {
    let (_, message) = examples().remove(6);
    let change = |at: usize, to: u8| {
        let mut frame = frame(&message);
        frame[at] = to;
        decode(&frame)
    };
    assert_eq!(change(0, b'T'), Err(DecodeError::NotOurs));
    assert_eq!(change(1, 0), Err(DecodeError::NotOurs));
    assert_eq!(change(2, 1), Err(DecodeError::Version { found: 1 }));
    assert_eq!(change(2, 3), Err(DecodeError::Version { found: 3 }));
    // The kind of the mission is none.
    assert!(matches!(change(12, 9), Err(DecodeError::Body { .. })));
    assert_eq!(decode(&[]), Err(DecodeError::NotOurs));
}

#[test]
fn frames_longer_than_any_message_are_refused() {
    assert_eq!(
        decode(&vec![0; LIMIT + 1]),
        Err(DecodeError::TooLong { length: LIMIT + 1 })
    );
    let sample = samples(Some(-70)).samples[0];
    let batch = Samples {
        samples: vec![sample; 20_000],
        ..samples(None)
    };
    assert!(encode(&Message::Samples(batch)).is_err());
}

#[test]
fn a_claimed_length_reserves_no_memory() {
    // A digest that claims 2^62 layers.
    let mut frame = vec![b't', b'S', VERSION, 3, 253];
    frame.extend_from_slice(&(1_u64 << 62).to_le_bytes());
    assert!(matches!(decode(&frame), Err(DecodeError::Body { .. })));
}

fn refused(message: &Message, expected: &str) {
    match decode_message(&frame(message)) {
        Err(DecodeError::Impossible { reason }) => assert!(reason.contains(expected), "{reason}"),
        other => panic!("{message:?} was not refused: {other:?}"),
    }
}

fn example<T>(pick: fn(Message) -> Option<T>) -> T {
    examples()
        .into_iter()
        .find_map(|(_, message)| pick(message))
        .unwrap()
}

#[test]
fn impossible_states_are_refused() {
    let state = || {
        example(|message| {
            if let Message::State(state) = message {
                Some(state)
            } else {
                None
            }
        })
    };
    let check = |change: fn(&mut State), expected: &str| {
        let mut state = state();
        change(&mut state);
        refused(&Message::State(state), expected);
    };
    let pose =
        |state: &mut State, change: fn(&mut PoseReport)| change(state.pose.as_mut().unwrap());
    let nowhere = Position::from_metres(f64::NAN, 0.0, 0.0);
    let changes: [fn(&mut PoseReport); 4] = [
        |pose| pose.at.x_mm = i32::MIN,
        |pose| pose.at.y_mm = i32::MAX,
        |pose| pose.at.z_mm = 1_000_000_000,
        |pose| pose.at.z_mm = -1_000_000_000,
    ];
    for change in changes {
        let mut state = state();
        pose(&mut state, change);
        refused(&Message::State(state), "position");
    }
    let lost = State {
        pose: Some(PoseReport {
            at: nowhere,
            ..examples::pose()
        }),
        ..state()
    };
    refused(&Message::State(lost), "position");
    let heading = Heading::from_radians(f64::NAN);
    let turned = State {
        pose: Some(PoseReport {
            heading,
            ..examples::pose()
        }),
        ..state()
    };
    refused(&Message::State(turned), "heading");
    check(
        |state| state.pose.as_mut().unwrap().heading = Heading(62_832),
        "heading",
    );
    check(|state| state.velocity.x_mmps = i32::MIN, "speed");
    check(|state| state.velocity.z_mmps = -1_000_001, "speed");
    check(|state| state.roll = Tilt(31_417), "tilt");
    check(|state| state.pitch = Tilt(-31_417), "tilt");
    check(|state| state.battery = Some(Permille(1001)), "battery");
    check(
        |state| {
            state.leg = Some(LegReport {
                route: vec![Position {
                    x_mm: -1_000_000_000,
                    ..Position::default()
                }],
            })
        },
        "position",
    );
}

#[test]
fn impossible_samples_plans_and_beacons_are_refused() {
    refused(&Message::Samples(samples(Some(300))), "-200 to 100 dBm");
    refused(
        &Message::Samples(samples(Some(i16::MIN))),
        "-200 to 100 dBm",
    );
    let mut batch = samples(None);
    batch.samples[1].transmitter_pose.at.x_mm = i32::MIN;
    refused(&Message::Samples(batch), "position");

    let plan = || {
        example(|message| {
            if let Message::Plan(plan) = message {
                Some(plan)
            } else {
                None
            }
        })
    };
    let (mut nowhere, mut bent, mut foreign) = (plan(), plan(), plan());
    nowhere.stops[0].at.y_mm = i32::MIN;
    bent.stops[0].route[0].x_mm = i32::MIN;
    foreign.members = vec![VehicleId(1)];
    refused(&Message::Plan(nowhere), "position");
    refused(&Message::Plan(bent), "position");
    refused(&Message::Plan(foreign), "members");

    let mut beacon = example(|message| {
        if let Message::Beacon(beacon) = message {
            Some(beacon)
        } else {
            None
        }
    });
    beacon.pose.as_mut().unwrap().at.x_mm = i32::MIN;
    refused(&Message::Beacon(beacon), "position");
}

fn changed<T>(
    pick: fn(Message) -> Option<T>,
    wrap: fn(T) -> Message,
    change: impl Fn(&mut T),
) -> Message {
    let mut inner = example(pick);
    change(&mut inner);
    wrap(inner)
}

#[test]
fn the_last_number_is_refused_everywhere() {
    let state = |change: fn(&mut State)| {
        let pick = |message| {
            if let Message::State(state) = message {
                Some(state)
            } else {
                None
            }
        };
        refused(&changed(pick, Message::State, change), "under 4294967295");
    };
    state(|state| state.ordered.revision = Revision(u32::MAX));
    state(|state| state.accepted.1 = Revision(u32::MAX));
    state(|state| state.accepted.0 = RunId(u32::MAX));
    let mission = |change: fn(&mut Progress)| {
        let pick = |message| {
            if let Message::Mission(mission) = message {
                Some(mission)
            } else {
                None
            }
        };
        let mission = changed(pick, Message::Mission, |mission| {
            change(&mut mission.progress)
        });
        refused(&mission, "under 4294967295");
        let pick = |message| {
            if let Message::Beacon(beacon) = message {
                Some(beacon)
            } else {
                None
            }
        };
        let beacon = changed(pick, Message::Beacon, |beacon| change(&mut beacon.progress));
        refused(&beacon, "under 4294967295");
    };
    mission(|progress| progress.run = RunId(u32::MAX));
    mission(|progress| progress.revision = Revision(u32::MAX));
    mission(|progress| progress.done = Some(StopId(u32::MAX)));
    mission(|progress| progress.leg = Some(StopId(u32::MAX)));
    let order = |change: fn(&mut Order)| {
        let pick = |message| {
            if let Message::Order(order) = message {
                Some(order)
            } else {
                None
            }
        };
        refused(&changed(pick, Message::Order, change), "under 4294967295");
    };
    order(|order| order.revision = Revision(u32::MAX));
    order(|order| order.run = RunId(u32::MAX));
    let task = |change: fn(&mut Task)| {
        let pick = |message| {
            if let Message::Task(task) = message {
                Some(task)
            } else {
                None
            }
        };
        refused(&changed(pick, Message::Task, change), "under 4294967295");
    };
    task(|task| task.run = RunId(u32::MAX));
    task(|task| task.compare_with = Some(RunId(u32::MAX)));
    let report = |change: fn(&mut GroundReport)| {
        let pick = |message| {
            if let Message::Report(report) = message {
                Some(report)
            } else {
                None
            }
        };
        refused(&changed(pick, Message::Report, change), "under 4294967295");
    };
    report(|report| report.run = RunId(u32::MAX));
    report(|report| report.runs[2].run = RunId(u32::MAX));
    report(|report| report.runs[0].compared_with = Some(RunId(u32::MAX)));
}

#[test]
fn lists_are_bounded_and_in_order() {
    let plan = |change: fn(&mut Plan), expected: &str| {
        let pick = |message| {
            if let Message::Plan(plan) = message {
                Some(plan)
            } else {
                None
            }
        };
        refused(&changed(pick, Message::Plan, change), expected);
    };
    plan(
        |plan| plan.members = vec![VehicleId(2), VehicleId(1)],
        "ascending",
    );
    plan(
        |plan| plan.members = vec![VehicleId(2), VehicleId(2)],
        "ascending",
    );
    plan(
        |plan| plan.stops[0].id = StopId(u32::MAX),
        "under 4294967295",
    );
    plan(
        |plan| plan.stops[0].route = vec![Position::default(); 1025],
        "1024 corners",
    );
    plan(
        |plan| {
            plan.stops = vec![
                Stop {
                    route: vec![],
                    partners: vec![],
                    after: vec![],
                    ..plan.stops[0].clone()
                };
                4097
            ]
        },
        "4096 stops",
    );
    let beacon = |change: fn(&mut Beacon), expected: &str| {
        let pick = |message| {
            if let Message::Beacon(beacon) = message {
                Some(beacon)
            } else {
                None
            }
        };
        refused(&changed(pick, Message::Beacon, change), expected);
    };
    beacon(
        |beacon| beacon.members = vec![VehicleId(3), VehicleId(1)],
        "ascending",
    );
    beacon(
        |beacon| beacon.members = (0..13).map(VehicleId).collect(),
        "12 members",
    );
    let layer = LayerDigest {
        layer: LayerId::default(),
        tiles: 1,
        revisions: 1,
        hash: 1,
    };
    refused(
        &Message::Digest(Digest {
            layers: vec![layer; 257],
        }),
        "256 layers",
    );
    let known = vec![(TileAddress::default(), 1); 4097];
    refused(
        &Message::Want(TileRequest {
            layer: LayerId::default(),
            known,
        }),
        "4096 tiles",
    );
    let mut batch = samples(None);
    batch.samples.swap(0, 1);
    refused(&Message::Samples(batch), "ascending by sequence");
    let hello = |change: fn(&mut Hello), expected: &str| {
        let pick = |message| {
            if let Message::Hello(hello) = message {
                Some(hello)
            } else {
                None
            }
        };
        refused(&changed(pick, Message::Hello, change), expected);
    };
    hello(|hello| hello.software = "x".repeat(65), "64 bytes");
    hello(|hello| hello.name = "x".repeat(33), "32 bytes");
    hello(
        |hello| hello.capabilities.reverse(),
        "32 capabilities are named, ascending",
    );
    hello(
        |hello| hello.capabilities = vec![Capability::StoredMissions; 33],
        "32 capabilities",
    );
    hello(
        |hello| hello.interest = vec![Interest::Map, Interest::Map],
        "each named once",
    );
}

#[test]
fn lists_of_version_2_are_bounded_and_in_order() {
    let batch = |lost: &[(u64, u64)], expected: &str| {
        let lost = lost
            .iter()
            .map(|(from, until)| LostSamples {
                from: *from,
                until: *until,
            })
            .collect();
        refused(
            &Message::Samples(Samples {
                lost,
                ..samples(None)
            }),
            expected,
        );
    };
    batch(&[(5, 5)], "ranges are lost");
    batch(&[(5, 7), (7, 9)], "ranges are lost");
    batch(&[(8, 9), (1, 2)], "ranges are lost");
    batch(
        &std::array::from_fn::<_, 65, _>(|at| (3 * at as u64, 3 * at as u64 + 1)),
        "64 ranges",
    );
    let sample = |sequence| Sample {
        sequence,
        ..samples(None).samples[0]
    };
    let many = Samples {
        samples: (0..1025).map(sample).collect(),
        ..samples(None)
    };
    refused(&Message::Samples(many), "1024 samples");

    let health = |change: fn(&mut Health), expected: &str| {
        let pick = |message| {
            if let Message::Health(health) = message {
                Some(health)
            } else {
                None
            }
        };
        refused(&changed(pick, Message::Health, change), expected);
    };
    health(
        |health| health.troubles = vec![String::new(); 17],
        "16 troubles",
    );
    health(
        |health| health.troubles = vec!["x".repeat(201)],
        "200 bytes",
    );
    health(
        |health| health.hears = vec![VehicleId(2), VehicleId(2)],
        "ascending",
    );
    health(
        |health| health.autopilot.as_mut().unwrap().firmware = "x".repeat(33),
        "firmware",
    );

    let report = |change: fn(&mut GroundReport), expected: &str| {
        let pick = |message| {
            if let Message::Report(report) = message {
                Some(report)
            } else {
                None
            }
        };
        refused(&changed(pick, Message::Report, change), expected);
    };
    report(
        |report| report.runs.reverse(),
        "16 runs are reported, ascending",
    );
    report(
        |report| {
            report.runs = (0..17)
                .map(|run| RunReport {
                    run: RunId(run),
                    ..RunReport::default()
                })
                .collect()
        },
        "16 runs",
    );
    report(|report| report.expected.reverse(), "ascending");
    report(
        |report| report.troubles = vec!["x".repeat(201)],
        "200 bytes",
    );
}

#[test]
fn impossible_missions_orders_and_stops_are_refused() {
    let mission = |change: fn(&mut MissionProgress), expected: &str| {
        let pick = |message| {
            if let Message::Mission(mission) = message {
                Some(mission)
            } else {
                None
            }
        };
        refused(&changed(pick, Message::Mission, change), expected);
    };
    mission(|mission| mission.share = Some(Permille(1001)), "share");
    mission(
        |mission| mission.goal.as_mut().unwrap().x_mm = i32::MIN,
        "position",
    );
    mission(
        |mission| mission.end = Some(MissionEnd::NoWay(0)),
        "at least one",
    );
    mission(
        |mission| mission.end = Some(MissionEnd::GaveUp(0)),
        "at least one",
    );

    let order = |kind, ends: &[u32], expected: &str| {
        let pick = |message| {
            if let Message::Order(order) = message {
                Some(order)
            } else {
                None
            }
        };
        let ends: Vec<EmergencyName> = ends.iter().copied().map(EmergencyName).collect();
        let order = Order {
            kind,
            ends,
            ..example(pick)
        };
        refused(&Message::Order(order), expected);
    };
    order(OrderKind::Hold, &[1], "only a start");
    order(OrderKind::Start, &[2, 1], "ascending");
    order(OrderKind::Start, &[1, 1], "named once");
    order(OrderKind::Start, &[1, 2, 3, 4, 5, 6, 7, 8, 9], "at most 8");

    let stop = |name| EmergencyStop {
        name: EmergencyName(name),
        scope: StopScope::All,
        by: OperatorId(1),
    };
    let standing = |open: &[u32], lifted: &[u32], expected: &str| {
        let open = open.iter().copied().map(stop).collect();
        let lifted = lifted.iter().copied().map(EmergencyName).collect();
        refused(&Message::Standing(OpenStops { open, lifted }), expected);
    };
    standing(&[2, 1], &[], "ascending by name");
    standing(&[1, 1], &[], "ascending by name");
    standing(&[1, 2, 3, 4, 5, 6, 7, 8, 9, 10], &[], "9 stops");
    standing(&[], &[7, 1, 7], "named once");
    standing(&[], &(0..65).collect::<Vec<u32>>(), "64");
}

#[test]
fn impossible_tasks_and_images_are_refused() {
    let task = |change: fn(&mut Task), expected: &str| {
        let pick = |message| {
            if let Message::Task(task) = message {
                Some(task)
            } else {
                None
            }
        };
        refused(&changed(pick, Message::Task, change), expected);
    };
    task(|task| task.members.clear(), "has members");
    task(|task| task.members.reverse(), "ascending");
    task(|task| task.compare_with = Some(task.run), "another one");
    task(
        |task| task.kind = TaskKind::Legs { places: vec![] },
        "1 to 1000",
    );
    task(
        |task| {
            task.kind = TaskKind::Pathfind {
                places: vec![Position::default(); 1001],
            }
        },
        "1 to 1000",
    );
    let nowhere = Position {
        x_mm: 0,
        y_mm: i32::MIN,
        z_mm: 0,
    };
    refused(
        &Message::Task(Task {
            kind: TaskKind::Legs {
                places: vec![nowhere],
            },
            ..example(|message| {
                if let Message::Task(task) = message {
                    Some(task)
                } else {
                    None
                }
            })
        }),
        "position",
    );
    task(
        |task| {
            task.kind = TaskKind::Forward {
                distance_mm: 1_000_000_000,
            }
        },
        "distance",
    );
    task(
        |task| {
            task.kind = TaskKind::Sweep {
                planner: SweepPlanner::Fan,
                positions: 8,
                laps: None,
                dwell_ms: 2,
                dwell_limit_ms: 1,
            }
        },
        "dwell",
    );

    let image = |change: fn(&mut Image), expected: &str| {
        let pick = |message| {
            if let Message::Image(image) = message {
                Some(image)
            } else {
                None
            }
        };
        refused(&changed(pick, Message::Image, change), expected);
    };
    image(|image| image.columns = 0, "400 columns");
    image(|image| image.rows = 401, "400 columns");
    image(|image| image.rows = 41, "3072 pixels");
    image(|image| image.part = 1, "3072 pixels");
    image(|image| image.parts = 2, "3072 pixels");
    image(|image| image.mean.push(0), "3072 pixels");
    image(
        |image| image.deviation.as_mut().unwrap().clear(),
        "3072 pixels",
    );
    image(|image| image.area.greatest = image.area.least, "rectangle");
    image(|image| image.area.greatest.z_mm = 1, "one height");
    image(|image| image.finds = vec![image.finds[0]; 33], "32 finds");
    image(
        |image| image.finds[0].probability = Some(Permille(1001)),
        "probability",
    );
    image(|image| image.finds[0].at.x_mm = i32::MAX, "position");
    let pick = |(name, message)| match message {
        Message::Image(image) if name == "image-last-part" => Some(image),
        _ => None,
    };
    let mut last = variants().into_iter().find_map(pick).unwrap();
    last.finds = example(|message| {
        if let Message::Image(image) = message {
            Some(image)
        } else {
            None
        }
    })
    .finds;
    refused(&Message::Image(last), "in the first part");
}

#[test]
fn a_text_that_is_too_long_is_cut_between_two_letters() {
    let fit = |text: &str, most| fitted(text.to_owned(), most);
    assert_eq!(fit("ääää", 8), "ääää");
    assert_eq!(fit("ääää", 7), "ää…");
    assert_eq!(fit("ääää", 6), "ä…");
    assert_eq!(
        (fit("ääää", 3), fit("ääää", 2), fit("x", 0)),
        ("…".to_owned(), String::new(), String::new())
    );
}

#[test]
fn a_log_has_few_short_lines_in_order_and_settings_are_not_endless() {
    let line = |number, bytes| LogLine {
        number,
        age_ms: 0,
        severity: LogSeverity::Info,
        text: "x".repeat(bytes),
    };
    let log = |lines| {
        Message::Log(LogLines {
            node: Sender::Ground,
            instance: 1,
            lines,
        })
    };
    let numbered = |count: usize| (1..=count as u32).map(|number| line(number, 1)).collect();
    assert!(log(vec![]).check().is_ok());
    assert!(log(numbered(LOG_LINES_MAX)).check().is_ok());
    refused(&log(numbered(LOG_LINES_MAX + 1)), "at most 16");
    refused(&log(vec![line(2, 1), line(2, 1)]), "ascending");
    assert!(log(vec![line(2, LOG_LINE_BYTES_MAX)]).check().is_ok());
    refused(&log(vec![line(2, LOG_LINE_BYTES_MAX + 1)]), "240 bytes");
    let settings = |part, parts, bytes| {
        Message::Settings(NodeSettings {
            node: Sender::Ground,
            instance: 1,
            part,
            parts,
            text: "x".repeat(bytes),
        })
    };
    assert!(settings(15, 16, SETTINGS_PART_BYTES_MAX).check().is_ok());
    refused(&settings(0, 1, SETTINGS_PART_BYTES_MAX + 1), "4096 bytes");
    for (part, parts) in [(0, 0), (1, 1), (0, 17)] {
        refused(&settings(part, parts, 1), "1 to 16 parts");
    }
}

#[test]
fn a_look_has_few_readings_and_none_of_long_ago() {
    let reading = LookReading {
        at: Position::from_metres(1.0, 2.0, 0.0),
        toward: Heading::LAST,
        range_mm: Some(1),
        is_suspect: false,
        age_ms: READING_AGE_MAX_MS,
    };
    let with = |half_angle, readings| {
        Message::Look(Look {
            vehicle: VehicleId(1),
            half_angle,
            max_range_mm: 4000,
            readings,
        })
    };
    let look = |readings| with(Heading(2618), readings);
    refused(&with(Heading(62_832), vec![]), "heading");
    assert!(look(vec![reading; LOOK_READINGS_MAX]).check().is_ok());
    assert!(look(vec![]).check().is_ok());
    refused(&look(vec![reading; LOOK_READINGS_MAX + 1]), "at most 16");
    for (wrong, why) in [
        (
            LookReading {
                age_ms: READING_AGE_MAX_MS + 1,
                ..reading
            },
            "two seconds",
        ),
        (
            LookReading {
                toward: Heading(62_832),
                ..reading
            },
            "heading",
        ),
        (
            LookReading {
                at: Position::from_metres(1e6, 0.0, 0.0),
                ..reading
            },
            "1000 km",
        ),
    ] {
        refused(&look(vec![reading, wrong]), why);
    }
}

#[test]
fn an_unknown_kind_is_no_mistake_whatever_it_holds() {
    for kind in 21..=u8::MAX {
        for body in [&[][..], &[0], &[255; 300]] {
            let frame = [&[b't', b'S', VERSION, kind], body].concat();
            assert_eq!(decode(&frame), Ok(Decoded::Unknown(kind)));
        }
    }
    let long = [&[b't', b'S', VERSION, 21][..], &vec![0; LIMIT]].concat();
    assert_eq!(
        decode(&long),
        Err(DecodeError::TooLong { length: LIMIT + 4 })
    );
    assert_eq!(
        decode(b"tS\x01\x10"),
        Err(DecodeError::Version { found: 1 })
    );
    assert_eq!(decode(b"tT\x02\x10"), Err(DecodeError::NotOurs));
}

fn tile_frame(cells: &[u8]) -> Vec<u8> {
    let mut frame = vec![b't', b'S', VERSION, 2, 1, 1, 0, 0, 0, 1];
    match u8::try_from(cells.len())
        .ok()
        .filter(|length| *length < 251)
    {
        Some(length) => frame.push(length),
        None => {
            frame.push(251);
            frame.extend_from_slice(&(cells.len() as u16).to_le_bytes());
        }
    }
    frame.extend_from_slice(cells);
    frame
}

#[test]
fn a_tile_of_any_other_number_of_cells_is_refused() {
    let even = |cells: usize| {
        let (long, rest) = (cells / 130, cells % 130);
        let mut bytes = [255, 239].repeat(long);
        if rest > 0 {
            bytes.extend([rest as u8 + 125, 239]);
        }
        bytes
    };
    let Ok(Message::Tile(tile)) = decode_message(&tile_frame(&even(1024))) else {
        panic!("an even tile")
    };
    assert_eq!(*tile.cells, [-17; TILE_CELLS]);
    for cells in [0, 3, 130, 1023, 1025, 1027, 2048, 60_000] {
        let refused = decode(&tile_frame(&even(cells)));
        assert!(
            matches!(refused, Err(DecodeError::Body { .. })),
            "{cells} cells: {refused:?}"
        );
    }
    for broken in [&[127, 1][..], &[255], &[0]] {
        assert!(decode(&tile_frame(broken)).is_err());
    }
}

#[test]
fn the_same_tile_written_in_other_pieces_is_the_same_message() {
    let plain = [vec![127], vec![239; 128]].concat().repeat(8);
    let runs = [[255, 239].repeat(7), vec![128 + 111, 239]].concat();
    let [plain, runs] = [plain, runs].map(|cells| decode_message(&tile_frame(&cells)).unwrap());
    assert_eq!(plain, runs);
    assert!(
        frame(&runs).len() < 32,
        "an even tile is small: {}",
        frame(&runs).len()
    );
}

#[test]
fn a_claimed_length_of_cells_reserves_no_memory() {
    let mut frame = vec![b't', b'S', VERSION, 2, 1, 1, 0, 0, 0, 1, 253];
    frame.extend_from_slice(&(1_u64 << 62).to_le_bytes());
    assert!(matches!(decode(&frame), Err(DecodeError::Body { .. })));
}

#[test]
fn a_snapshot_that_claims_more_than_there_is_is_refused() {
    let kept = (7_u32, "words".to_owned(), vec![1_u64, 2]);
    let bytes = pack(&kept).unwrap();
    assert_eq!(unpack::<(u32, String, Vec<u64>)>(&bytes), Ok(kept));
    let mut claims = vec![253];
    claims.extend_from_slice(&(1_u64 << 61).to_le_bytes());
    assert!(matches!(
        unpack::<String>(&claims),
        Err(DecodeError::Body { .. })
    ));
    assert!(matches!(
        unpack::<Vec<u64>>(&claims),
        Err(DecodeError::Body { .. })
    ));
    assert_eq!(
        unpack::<u8>(&[1, 2]),
        Err(DecodeError::Trailing { count: 1 })
    );
}

fn example_hello() -> Hello {
    example(|message| {
        if let Message::Hello(hello) = message {
            Some(hello)
        } else {
            None
        }
    })
}

#[test]
fn a_greeting_of_any_version_can_be_read() {
    let vehicles = [0, 255].map(|id| Sender::Vehicle(VehicleId(id)));
    let operators = [0, 1, 255].map(|id| Sender::Operator(OperatorId(id)));
    for node in vehicles
        .into_iter()
        .chain(operators)
        .chain([Sender::Ground])
    {
        let hello = Hello {
            node,
            ..example_hello()
        };
        let mut frame = frame(&Message::Hello(hello.clone()));
        for version in 0..=255 {
            frame[2] = version;
            let expected = Greeting {
                version,
                node,
                boot: hello.boot,
                venue_hash: hello.venue_hash,
            };
            // Whatever that version writes behind the greeting.
            for behind in [&frame[18..], &[], &[255; 40]] {
                assert_eq!(greeting(&[&frame[..18], behind].concat()), Ok(expected));
            }
            assert_eq!(decode(&frame).is_ok(), version == VERSION);
        }
    }
}

#[test]
fn what_is_no_greeting_is_refused() {
    let hello = frame(&Message::Hello(example_hello()));
    for length in 0..18 {
        assert_eq!(
            greeting(&hello[..length]),
            Err(DecodeError::NotOurs),
            "{length} bytes"
        );
    }
    for (name, message) in examples().into_iter().filter(|(name, _)| *name != "hello") {
        assert_eq!(
            greeting(&frame(&message)),
            Err(DecodeError::NotOurs),
            "{name}"
        );
    }
    for node in [513_u16, 1000, u16::MAX] {
        let mut unknown = hello.clone();
        unknown[4..6].copy_from_slice(&node.to_le_bytes());
        assert!(
            matches!(greeting(&unknown), Err(DecodeError::Impossible { .. })),
            "node {node}"
        );
        assert!(decode(&unknown).is_err());
    }
}

#[test]
fn a_hello_that_contradicts_its_greeting_is_refused() {
    let hello = frame(&Message::Hello(example_hello()));
    for at in 4..18 {
        let mut twisted = hello.clone();
        twisted[at] ^= 1;
        let reason = match decode(&twisted) {
            Err(DecodeError::Impossible { reason }) => reason,
            other => panic!("byte {at}: {other:?}"),
        };
        assert!(
            reason.contains("same node") || reason.contains("a node is"),
            "byte {at}: {reason}"
        );
    }
}

#[test]
fn an_operator_greets_with_257_and_its_number() {
    for id in [0, 1, 255] {
        let hello = Hello {
            node: Sender::Operator(OperatorId(id)),
            ..example_hello()
        };
        let frame = frame(&Message::Hello(hello));
        assert_eq!(
            u16::from_le_bytes([frame[4], frame[5]]),
            257 + u16::from(id)
        );
    }
}

#[test]
fn whoever_alone_may_say_a_message_also_has_its_key() {
    for (name, message) in examples() {
        let speaker = Sender::Vehicle(VehicleId(2));
        let (author, free) = match name {
            "plan" | "have" | "report" | "image" => (Some(Sender::Ground), false),
            "tile" | "digest" | "want" | "order" | "standing" | "task" | "fix" | "mark" => {
                (None, true)
            }
            _ => (Some(speaker), false),
        };
        assert_eq!(message.author(), author, "{name}");
        assert_eq!(message.word(), name);
        for sender in [Sender::Ground, speaker, Sender::Operator(OperatorId(1))] {
            let key = Key::of(sender, &message).to_string();
            assert_eq!(Key::sender(&key), Some(sender), "{key}");
            let topic = key.strip_prefix(&sender.prefix()).unwrap();
            assert_eq!(topic.split('/').nth(1), Some(name));
            assert_eq!(topic, format!("/{}", Topic::of(&message)));
            assert_eq!(
                free || author == Some(sender),
                message.author().is_none_or(|author| author == sender)
            );
        }
    }
}

proptest! {
    #[test]
    fn every_message_survives_the_way_there_and_back(message in message()) {
        let frame = encode(&message).unwrap();
        prop_assert_eq!(decode(&frame), Ok(Decoded::Message(message)));
    }

    #[test]
    fn what_is_read_from_noise_is_written_as_it_was(noise in prop::collection::vec(any::<u8>(), 0..80)) {
        let mut frame = vec![b't', b'S', VERSION];
        frame.extend(noise);
        if let Ok(Decoded::Message(message)) = decode(&frame) {
            prop_assert!(message.check().is_ok());
            let again = decode(&encode(&message).unwrap());
            prop_assert_eq!(again, Ok(Decoded::Message(message)));
        }
    }

    #[test]
    fn a_changed_byte_never_panics(at in 0_usize..4000, to in any::<u8>(), which in any::<prop::sample::Index>()) {
        let all: Vec<_> = examples().into_iter().chain(variants()).collect();
        let mut frame = frame(&which.get(&all).1);
        let at = at % frame.len();
        frame[at] = to;
        if let Ok(Decoded::Message(message)) = decode(&frame) {
            prop_assert!(message.check().is_ok());
        }
    }

    #[test]
    fn several_changed_bytes_and_another_end_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        end in any::<prop::sample::Index>(),
        which in any::<prop::sample::Index>(),
    ) {
        let all: Vec<_> = examples().into_iter().chain(variants()).collect();
        let mut frame = frame(&which.get(&all).1);
        for (at, to) in changes {
            let at = at.index(frame.len());
            frame[at] = to;
        }
        frame.truncate(1 + end.index(frame.len()));
        if let Ok(Decoded::Message(message)) = decode(&frame) {
            prop_assert!(message.check().is_ok());
        }
    }

    #[test]
    fn any_bytes_at_all_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = decode(&bytes);
        let _ = greeting(&bytes);
        let _ = Key::sender(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn any_body_of_an_unknown_kind_is_unknown(kind in 21..=u8::MAX, body in prop::collection::vec(any::<u8>(), 0..200)) {
        let frame = [&[b't', b'S', VERSION, kind], &body[..]].concat();
        prop_assert_eq!(decode(&frame), Ok(Decoded::Unknown(kind)));
    }
}
