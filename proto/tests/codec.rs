//! What the codec promises: every message survives the way there and back, and nothing else is let in.

mod examples;

use examples::{examples, samples};
use proptest::prelude::*;
use tomoswarm_proto::codec::{DecodeError, LIMIT, decode, encode};
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
fn impossible_samples_plans_tiles_and_beacons_are_refused() {
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

    let mut tile = example(|message| if let Message::Tile(tile) = message { Some(tile) } else { None });
    tile.cells.pop();
    refused(&Message::Tile(tile), "1024 cells");
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
    let layer = LayerDigest { layer: LayerId::default(), tiles: 1, hash: 1 };
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

fn tile() -> impl Strategy<Value = Message> {
    let cells = prop::collection::vec(any::<i8>(), TILE_CELLS);
    (vehicle(), any::<u32>(), any::<(i16, i32, i32)>(), any::<u32>(), cells).prop_map(
        |(vehicle, boot, (slice, x, y), revision, cells)| {
            let layer = LayerId { vehicle, boot: Boot(boot) };
            Message::Tile(TileReport { layer, address: TileAddress { slice, x, y }, revision, cells })
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
    (node, any::<u32>(), any::<[u64; 2]>(), any::<bool>(), ".{0,40}", words).prop_map(
        |(node, boot, [venue_hash, instance], is_member, software, capabilities)| {
            let boot = Boot(boot);
            Message::Hello(Hello { node, boot, venue_hash, instance, is_member, software, capabilities })
        },
    )
}

fn order() -> impl Strategy<Value = Message> {
    let kind = prop::sample::select(vec![
        OrderKind::Start,
        OrderKind::Hold,
        OrderKind::Return,
        OrderKind::Land,
        OrderKind::Emergency,
    ]);
    (vehicle(), [number(), number(), number()], any::<[u64; 2]>(), kind).prop_map(
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
