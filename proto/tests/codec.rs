//! What the codec promises: every message survives the way there and back, and nothing else is let in.

mod examples;

use std::sync::Arc;

use examples::{examples, samples};
use proptest::prelude::*;
use tomoswarm_proto::codec::{DecodeError, Greeting, LIMIT, VERSION, decode, encode, greeting, pack, unpack};
use tomoswarm_proto::*;

fn frame(message: &Message) -> Vec<u8> {
    encode(message).unwrap()
}

#[test]
fn a_frame_cut_anywhere_is_refused() {
    for (name, message) in examples() {
        let frame = frame(&message);
        for length in 0..frame.len() {
            assert!(decode(&frame[..length]).is_err(), "{name} cut to {length} bytes");
        }
    }
}

#[test]
fn bytes_behind_the_message_are_refused() {
    for (name, message) in examples() {
        let mut frame = frame(&message);
        frame.push(0);
        assert_eq!(decode(&frame), Err(DecodeError::Trailing { count: 1 }), "{name}");
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
    assert_eq!(change(2, 2), Err(DecodeError::Version { found: 2 }));
    assert_eq!(change(3, 5), Err(DecodeError::Kind { header: 5, body: 6 }));
    assert!(matches!(change(4, 11), Err(DecodeError::Body { .. })));
    assert_eq!(decode(&[]), Err(DecodeError::NotOurs));
}

#[test]
fn frames_longer_than_any_message_are_refused() {
    assert_eq!(decode(&vec![0; LIMIT + 1]), Err(DecodeError::TooLong { length: LIMIT + 1 }));
    let sample = samples(Some(-70)).samples[0];
    let batch = Samples { samples: vec![sample; 10_000], ..samples(None) };
    assert!(encode(&Message::Samples(batch)).is_err());
}

#[test]
fn a_claimed_length_reserves_no_memory() {
    // A digest that claims 2^62 layers.
    let mut frame = vec![b't', b'S', 1, 3, 3, 253];
    frame.extend_from_slice(&(1_u64 << 62).to_le_bytes());
    assert!(matches!(decode(&frame), Err(DecodeError::Body { .. })));
}

fn refused(message: &Message, expected: &str) {
    match decode(&frame(message)) {
        Err(DecodeError::Impossible { reason }) => assert!(reason.contains(expected), "{reason}"),
        other => panic!("{message:?} was not refused: {other:?}"),
    }
}

fn example<T>(pick: fn(Message) -> Option<T>) -> T {
    examples().into_iter().find_map(|(_, message)| pick(message)).unwrap()
}

#[test]
fn impossible_states_are_refused() {
    let state = || example(|message| if let Message::State(state) = message { Some(state) } else { None });
    let check = |change: fn(&mut State), expected: &str| {
        let mut state = state();
        change(&mut state);
        refused(&Message::State(state), expected);
    };
    check(|state| state.pose.at.x_m = f64::NAN, "position");
    check(|state| state.pose.at.y_m = f64::INFINITY, "position");
    check(|state| state.pose.heading_rad = f64::NAN, "heading");
    check(|state| state.pose.sd_m = -0.1, "deviation");
    check(|state| state.speed_mps = f64::NAN, "speed");
    check(|state| state.battery = 1.01, "battery");
    check(|state| state.leg.as_mut().unwrap().route[1].x_m = -1e6, "position");
}

#[test]
fn impossible_samples_plans_and_beacons_are_refused() {
    refused(&Message::Samples(samples(Some(300))), "-200 to 100 dBm");
    refused(&Message::Samples(samples(Some(i16::MIN))), "-200 to 100 dBm");
    let mut batch = samples(None);
    batch.samples[1].transmitter_pose.at.x_m = f64::NAN;
    refused(&Message::Samples(batch), "position");

    let plan = || example(|message| if let Message::Plan(plan) = message { Some(plan) } else { None });
    let (mut nowhere, mut bent, mut foreign) = (plan(), plan(), plan());
    nowhere.stops[0].at.y_m = f64::NAN;
    bent.stops[0].route[0].x_m = f64::NEG_INFINITY;
    foreign.members = vec![VehicleId(1)];
    refused(&Message::Plan(nowhere), "position");
    refused(&Message::Plan(bent), "position");
    refused(&Message::Plan(foreign), "members");

    let mut beacon =
        example(|message| if let Message::Beacon(beacon) = message { Some(beacon) } else { None });
    beacon.pose.at.x_m = f64::NAN;
    refused(&Message::Beacon(beacon), "position");
}

fn changed<T>(pick: fn(Message) -> Option<T>, wrap: fn(T) -> Message, change: impl Fn(&mut T)) -> Message {
    let mut inner = example(pick);
    change(&mut inner);
    wrap(inner)
}

#[test]
fn the_last_number_is_refused_everywhere() {
    let state = |change: fn(&mut State)| {
        let pick = |message| if let Message::State(state) = message { Some(state) } else { None };
        refused(&changed(pick, Message::State, change), "under 4294967295");
    };
    state(|state| state.ordered.revision = Revision(u32::MAX));
    state(|state| state.accepted.1 = Revision(u32::MAX));
    state(|state| state.accepted.0 = RunId(u32::MAX));
    let progress = |change: fn(&mut Progress)| {
        let pick = |message| if let Message::Progress(progress) = message { Some(progress) } else { None };
        refused(&changed(pick, Message::Progress, change), "under 4294967295");
    };
    progress(|progress| progress.revision = Revision(u32::MAX));
    progress(|progress| progress.done = Some(StopId(u32::MAX)));
    progress(|progress| progress.leg = Some(StopId(u32::MAX)));
    let order = |change: fn(&mut Order)| {
        let pick = |message| if let Message::Order(order) = message { Some(order) } else { None };
        refused(&changed(pick, Message::Order, change), "under 4294967295");
    };
    order(|order| order.revision = Revision(u32::MAX));
    order(|order| order.run = RunId(u32::MAX));
}

#[test]
fn lists_are_bounded_and_in_order() {
    let plan = |change: fn(&mut Plan), expected: &str| {
        let pick = |message| if let Message::Plan(plan) = message { Some(plan) } else { None };
        refused(&changed(pick, Message::Plan, change), expected);
    };
    plan(|plan| plan.members = vec![VehicleId(2), VehicleId(1)], "ascending");
    plan(|plan| plan.members = vec![VehicleId(2), VehicleId(2)], "ascending");
    plan(|plan| plan.stops[0].id = StopId(u32::MAX), "under 4294967295");
    plan(|plan| plan.stops[0].route = vec![Position::default(); 1025], "1024 corners");
    plan(
        |plan| {
            plan.stops =
                vec![Stop { route: vec![], partners: vec![], after: vec![], ..plan.stops[0].clone() }; 4097]
        },
        "4096 stops",
    );
    let beacon = |change: fn(&mut Beacon), expected: &str| {
        let pick = |message| if let Message::Beacon(beacon) = message { Some(beacon) } else { None };
        refused(&changed(pick, Message::Beacon, change), expected);
    };
    beacon(|beacon| beacon.members = vec![VehicleId(3), VehicleId(1)], "ascending");
    beacon(|beacon| beacon.progress.vehicle = VehicleId(3), "sender");
    let layer = LayerDigest { layer: LayerId::default(), tiles: 1, revisions: 1, hash: 1 };
    refused(&Message::Digest(Digest { layers: vec![layer; 257] }), "256 layers");
    let known = vec![(TileAddress::default(), 1); 4097];
    refused(&Message::Want(Want { layer: LayerId::default(), known }), "4096 tiles");
    let mut batch = samples(None);
    batch.samples.swap(0, 1);
    refused(&Message::Samples(batch), "ascending by sequence");
    let software = "x".repeat(257);
    let hello = || example(|message| if let Message::Hello(hello) = message { Some(hello) } else { None });
    refused(&Message::Hello(Hello { software: software.clone(), ..hello() }), "256 bytes");
    refused(&Message::Hello(Hello { capabilities: vec![software], ..hello() }), "32 words");
}

fn tile_frame(cells: &[u8]) -> Vec<u8> {
    let mut frame = vec![b't', b'S', VERSION, 2, 2, 1, 1, 0, 0, 0, 1];
    match u8::try_from(cells.len()).ok().filter(|length| *length < 251) {
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
    let Ok(Message::Tile(tile)) = decode(&tile_frame(&even(1024))) else { panic!("an even tile") };
    assert_eq!(*tile.cells, [-17; TILE_CELLS]);
    for cells in [0, 3, 130, 1023, 1025, 1027, 2048, 60_000] {
        let refused = decode(&tile_frame(&even(cells)));
        assert!(matches!(refused, Err(DecodeError::Body { .. })), "{cells} cells: {refused:?}");
    }
    for broken in [&[127, 1][..], &[255], &[0]] {
        assert!(decode(&tile_frame(broken)).is_err());
    }
}

#[test]
fn the_same_tile_written_in_other_pieces_is_the_same_message() {
    let plain = [vec![127], vec![239; 128]].concat().repeat(8);
    let runs = [[255, 239].repeat(7), vec![128 + 111, 239]].concat();
    let (plain, runs) = (decode(&tile_frame(&plain)).unwrap(), decode(&tile_frame(&runs)).unwrap());
    assert_eq!(plain, runs);
    assert!(frame(&runs).len() < 32, "an even tile is small: {}", frame(&runs).len());
}

#[test]
fn a_claimed_length_of_cells_reserves_no_memory() {
    let mut frame = vec![b't', b'S', VERSION, 2, 2, 1, 1, 0, 0, 0, 1, 253];
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
    assert!(matches!(unpack::<String>(&claims), Err(DecodeError::Body { .. })));
    assert!(matches!(unpack::<Vec<u64>>(&claims), Err(DecodeError::Body { .. })));
    assert_eq!(unpack::<u8>(&[1, 2]), Err(DecodeError::Trailing { count: 1 }));
}

fn example_hello() -> Hello {
    example(|message| if let Message::Hello(hello) = message { Some(hello) } else { None })
}

#[test]
fn a_greeting_of_any_version_can_be_read() {
    for node in
        [Sender::Vehicle(VehicleId(0)), Sender::Vehicle(VehicleId(255)), Sender::Ground, Sender::Operator]
    {
        let hello = Hello { node, ..example_hello() };
        let mut frame = frame(&Message::Hello(hello.clone()));
        for version in 0..=255 {
            frame[2] = version;
            let expected = Greeting { version, node, boot: hello.boot, venue_hash: hello.venue_hash };
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
        assert_eq!(greeting(&hello[..length]), Err(DecodeError::NotOurs), "{length} bytes");
    }
    for (name, message) in examples().into_iter().filter(|(name, _)| *name != "hello") {
        assert_eq!(greeting(&frame(&message)), Err(DecodeError::NotOurs), "{name}");
    }
    for node in [258_u16, 1000, u16::MAX] {
        let mut unknown = hello.clone();
        unknown[4..6].copy_from_slice(&node.to_le_bytes());
        assert!(matches!(greeting(&unknown), Err(DecodeError::Impossible { .. })), "node {node}");
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
        assert!(reason.contains("same node") || reason.contains("a node is"), "byte {at}: {reason}");
    }
}

#[test]
fn whoever_alone_may_say_a_message_also_has_its_key() {
    for (name, message) in examples() {
        let speaker = Sender::Vehicle(VehicleId(2));
        let (author, free) = match name {
            "plan" | "have" | "report" => (Some(Sender::Ground), false),
            "tile" | "digest" | "want" | "order" => (None, true),
            _ => (Some(speaker), false),
        };
        assert_eq!(message.author(), author, "{name}");
        assert_eq!(message.word(), name);
        for sender in [Sender::Ground, speaker, Sender::Operator] {
            let key = Key::of(sender, &message);
            assert_eq!(Key::sender(key.as_str()), Some(sender), "{}", key.as_str());
            assert_eq!(key.as_str().strip_prefix(&sender.prefix()).unwrap().split('/').nth(1), Some(name));
            assert_eq!(
                free || author == Some(sender),
                message.author().is_none_or(|author| author == sender)
            );
        }
    }
}

fn position() -> impl Strategy<Value = Position> {
    (-9e5..9e5, -9e5..9e5, -9e5..9e5).prop_map(|(x_m, y_m, z_m)| Position { x_m, y_m, z_m })
}

fn pose() -> impl Strategy<Value = PoseReport> {
    (position(), -10.0..10.0, 0.0..100.0).prop_map(|(at, heading_rad, sd_m)| PoseReport {
        at,
        heading_rad,
        sd_m,
    })
}

fn vehicle() -> impl Strategy<Value = VehicleId> {
    any::<u8>().prop_map(VehicleId)
}

/// A run, revision or stop.
fn number() -> impl Strategy<Value = u32> {
    0..u32::MAX
}

fn progress() -> impl Strategy<Value = Progress> {
    (vehicle(), number(), number(), prop::option::of(number()), prop::option::of(number())).prop_map(
        |(vehicle, run, revision, done, leg)| Progress {
            vehicle,
            boot: Boot(run ^ 5),
            run: RunId(run),
            revision: Revision(revision),
            done: done.map(StopId),
            leg: leg.map(StopId),
        },
    )
}

fn stop() -> impl Strategy<Value = Stop> {
    let waits = prop::collection::vec((vehicle(), number().prop_map(StopId)), 0..4);
    let route = prop::collection::vec(position(), 0..4);
    let partners = prop::collection::vec(vehicle(), 0..4);
    (number(), position(), route, any::<u32>(), any::<u32>(), partners, waits).prop_map(
        |(id, at, route, dwell_ms, dwell_limit_ms, partners, after)| Stop {
            id: StopId(id),
            at,
            route,
            dwell_ms,
            dwell_limit_ms,
            partners,
            after,
        },
    )
}

fn plan() -> impl Strategy<Value = Message> {
    let stops = prop::collection::vec(stop(), 0..6);
    (vehicle(), number(), number(), prop::collection::vec(vehicle(), 0..4), position(), stops).prop_map(
        |(vehicle, run, revision, mut members, start, stops)| {
            members.push(vehicle);
            members.sort_unstable();
            members.dedup();
            let (run, revision) = (RunId(run), Revision(revision));
            let lease = Lease { number: 3, holder: 5 };
            Message::Plan(Plan { vehicle, run, revision, lease, seen_state: 9, members, start, stops })
        },
    )
}

fn sample() -> impl Strategy<Value = Sample> {
    let rssi = prop::option::of(-200_i16..=100);
    (any::<u64>(), any::<u64>(), vehicle(), pose(), pose(), any::<u8>(), any::<i8>(), rssi).prop_map(
        |(
            sequence,
            heard_at_ns,
            transmitter,
            transmitter_pose,
            receiver_pose,
            channel,
            power_dbm,
            rssi_dbm,
        )| {
            Sample {
                sequence,
                heard_at_ns,
                transmitter,
                transmitter_pose,
                receiver_pose,
                channel,
                power_dbm,
                rssi_dbm,
            }
        },
    )
}

fn sample_batch() -> impl Strategy<Value = Message> {
    (vehicle(), any::<u32>(), number(), prop::collection::vec(sample(), 0..5)).prop_map(
        |(vehicle, boot, run, mut samples)| {
            samples.sort_by_key(|sample| sample.sequence);
            samples.dedup_by_key(|sample| sample.sequence);
            Message::Samples(Samples { vehicle, boot: Boot(boot), run: RunId(run), samples })
        },
    )
}

fn state() -> impl Strategy<Value = Message> {
    let mode = prop::sample::select(vec![
        Mode::Idle,
        Mode::Driving,
        Mode::Turning,
        Mode::Halted,
        Mode::Held,
        Mode::Emergency,
    ]);
    let leg = prop::option::of(prop::collection::vec(position(), 0..4));
    (
        vehicle(),
        any::<u64>(),
        pose(),
        0.0..900.0,
        mode,
        0.0..=1.0,
        leg,
        [number(), number(), number(), number()],
        any::<u64>(),
    )
        .prop_map(
            |(
                vehicle,
                sequence,
                pose,
                speed_mps,
                mode,
                battery,
                leg,
                [boot, run, accepted, ordered],
                holder,
            )| {
                Message::State(State {
                    vehicle,
                    boot: Boot(boot),
                    sequence,
                    pose,
                    speed_mps,
                    mode,
                    battery,
                    leg: leg.map(|route| LegReport { route }),
                    accepted: (RunId(run), Revision(accepted)),
                    ordered: Ordered {
                        lease: Lease { number: boot, holder },
                        revision: Revision(ordered),
                        run: RunId(run),
                        kind: None,
                    },
                })
            },
        )
}

/// A tile in stretches of equal cells, some of one cell.
fn tile() -> impl Strategy<Value = Message> {
    let stretches = prop::collection::vec((any::<i8>(), prop_oneof![Just(1_usize), 2..300_usize]), 1..400);
    (vehicle(), any::<u32>(), any::<(i16, i32, i32)>(), any::<u32>(), stretches).prop_map(
        |(vehicle, boot, (slice, x, y), revision, stretches)| {
            let layer = LayerId { vehicle, boot: Boot(boot) };
            let cells = stretches.into_iter().flat_map(|(value, count)| std::iter::repeat_n(value, count));
            let mut cells = cells.chain(std::iter::repeat(0));
            let cells = Arc::new(std::array::from_fn(|_| cells.next().unwrap()));
            Message::Tile(TileReport { layer, address: TileAddress { slice, x, y }, revision, cells })
        },
    )
}

fn health() -> impl Strategy<Value = Message> {
    let counts = any::<[u64; 3]>();
    let words = prop::collection::vec(".{0,30}", 0..4);
    let hears = prop::collection::btree_set(vehicle(), 0..9);
    (vehicle(), any::<u32>(), hears, counts, prop::option::of(any::<u32>()), words).prop_map(
        |(vehicle, boot, hears, [samples_waiting, samples_lost, inputs_dropped], disk_free_mb, troubles)| {
            let (boot, hears) = (Boot(boot), hears.into_iter().collect());
            Message::Health(Health {
                vehicle,
                boot,
                hears,
                samples_waiting,
                samples_lost,
                inputs_dropped,
                disk_free_mb,
                troubles,
            })
        },
    )
}

fn order_kind() -> impl Strategy<Value = OrderKind> {
    prop::sample::select(vec![
        OrderKind::Start,
        OrderKind::Hold,
        OrderKind::Return,
        OrderKind::Land,
        OrderKind::Emergency,
        OrderKind::CutMotors,
    ])
}

fn report() -> impl Strategy<Value = Message> {
    let phase = prop::sample::select(vec![
        StationPhase::Idle,
        StationPhase::Waiting,
        StationPhase::Stopping,
        StationPhase::Planning,
        StationPhase::Running,
        StationPhase::Closing,
    ]);
    let ids = || prop::collection::btree_set(vehicle(), 0..9);
    let words = prop::collection::vec(".{0,30}", 0..4);
    let standing = prop::option::of(order_kind());
    (any::<[u32; 4]>(), any::<[u64; 3]>(), number(), phase, ids(), ids(), standing, words).prop_map(
        |(
            [boot, lease, laps, pictures],
            [holder, store, samples],
            run,
            phase,
            members,
            lost,
            standing,
            troubles,
        )| {
            Message::Report(Report {
                boot: Boot(boot),
                lease: Lease { number: lease, holder },
                store,
                phase,
                run: RunId(run),
                laps_done: laps / 2,
                laps,
                samples,
                pictures,
                members: members.into_iter().collect(),
                lost: lost.into_iter().collect(),
                standing,
                troubles,
            })
        },
    )
}

fn beacon() -> impl Strategy<Value = Message> {
    let members = prop::collection::btree_set(vehicle(), 0..9);
    (vehicle(), any::<u32>(), any::<u64>(), pose(), any::<u8>(), any::<i8>(), members, progress()).prop_map(
        |(sender, boot, sequence, pose, channel, power_dbm, members, progress)| {
            let (boot, members) = (Boot(boot), members.into_iter().collect());
            let progress = Progress { vehicle: sender, ..progress };
            Message::Beacon(Beacon { sender, boot, sequence, pose, channel, power_dbm, members, progress })
        },
    )
}

fn hello() -> impl Strategy<Value = Message> {
    let node = prop_oneof![Just(Sender::Ground), Just(Sender::Operator), vehicle().prop_map(Sender::Vehicle)];
    let words = prop::collection::vec(".{0,20}", 0..4);
    (node, any::<[u32; 2]>(), any::<[u64; 2]>(), any::<bool>(), ".{0,40}", words).prop_map(
        |(node, [boot, member_for_s], [venue_hash, instance], is_member, software, capabilities)| {
            let boot = Boot(boot);
            Message::Hello(Hello {
                node,
                boot,
                venue_hash,
                instance,
                is_member,
                member_for_s,
                software,
                capabilities,
            })
        },
    )
}

fn order() -> impl Strategy<Value = Message> {
    (vehicle(), [number(), number(), number()], any::<[u64; 2]>(), order_kind()).prop_map(
        |(vehicle, [number, run, revision], [holder, seen_state], kind)| {
            let (run, revision) = (RunId(run), Revision(revision));
            Message::Order(Order {
                vehicle,
                lease: Lease { number, holder },
                run,
                revision,
                seen_state,
                kind,
            })
        },
    )
}

fn bookkeeping() -> impl Strategy<Value = Message> {
    let entry = (vehicle(), any::<u32>(), number(), any::<u64>(), any::<(i16, i32, i32)>());
    (0..3, any::<u64>(), prop::collection::vec(entry, 0..6)).prop_map(|(kind, store, entries)| {
        let layer = |vehicle, boot| LayerId { vehicle, boot: Boot(boot) };
        match kind {
            0 => Message::Digest(Digest {
                layers: entries
                    .iter()
                    .map(|(vehicle, boot, tiles, hash, _)| LayerDigest {
                        layer: layer(*vehicle, *boot),
                        tiles: *tiles,
                        revisions: *hash ^ 7,
                        hash: *hash,
                    })
                    .collect(),
            }),
            1 => Message::Want(Want {
                layer: layer(VehicleId(1), 2),
                known: entries
                    .iter()
                    .map(|(_, _, revision, _, (slice, x, y))| {
                        (TileAddress { slice: *slice, x: *x, y: *y }, *revision)
                    })
                    .collect(),
            }),
            _ => Message::Have(Have {
                closed: vec![RunId(3)],
                store,
                watermarks: entries
                    .iter()
                    .map(|(vehicle, boot, run, below, _)| HeardFrom {
                        vehicle: *vehicle,
                        boot: Boot(*boot),
                        run: RunId(*run),
                        below: *below,
                    })
                    .collect(),
            }),
        }
    })
}

fn message() -> impl Strategy<Value = Message> {
    prop_oneof![
        hello(),
        state(),
        tile(),
        bookkeeping(),
        plan(),
        progress().prop_map(Message::Progress),
        order(),
        sample_batch(),
        beacon(),
        health(),
        report(),
    ]
}

proptest! {
    #[test]
    fn every_message_survives_the_way_there_and_back(message in message()) {
        let frame = encode(&message).unwrap();
        prop_assert_eq!(decode(&frame), Ok(message));
    }

    #[test]
    fn what_is_read_from_noise_is_written_as_it_was(noise in prop::collection::vec(any::<u8>(), 0..80)) {
        let mut frame = vec![b't', b'S', 1];
        frame.extend(noise);
        if let Ok(message) = decode(&frame) {
            prop_assert!(message.check().is_ok());
            let again = decode(&encode(&message).unwrap());
            prop_assert_eq!(again, Ok(message));
        }
    }

    #[test]
    fn a_changed_byte_never_panics(at in 0_usize..2000, to in any::<u8>(), which in 0_usize..13) {
        let mut frame = frame(&examples()[which].1);
        let at = at % frame.len();
        frame[at] = to;
        if let Ok(message) = decode(&frame) {
            prop_assert!(message.check().is_ok());
        }
    }
}
