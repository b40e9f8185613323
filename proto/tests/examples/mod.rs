//! One message of every kind with all fields set, in the order of the kinds.

use std::sync::Arc;

use tomoswarm_proto::*;

fn position(x_m: f64, y_m: f64) -> Position {
    Position { x_m, y_m, z_m: 0.0 }
}

fn pose() -> PoseReport {
    PoseReport { at: position(1.5, -2.25), heading_rad: 0.75, sd_m: 0.05 }
}

fn layer() -> LayerId {
    LayerId { vehicle: VehicleId(2), boot: Boot(70_000) }
}

fn address() -> TileAddress {
    TileAddress { slice: -1, x: -300, y: 4 }
}

fn progress() -> Progress {
    let (done, leg) = (Some(StopId(151)), Some(StopId(152)));
    Progress { vehicle: VehicleId(2), boot: Boot(5), run: RunId(9), revision: Revision(3), done, leg }
}

fn state() -> State {
    State {
        vehicle: VehicleId(2),
        boot: Boot(5),
        sequence: 1 << 40,
        pose: pose(),
        speed_mps: 0.45,
        mode: Mode::Driving,
        battery: 0.875,
        leg: Some(LegReport { route: vec![position(0.0, 0.0), position(1.0, 0.0)] }),
        accepted: (RunId(9), Revision(3)),
        ordered: Ordered {
            lease: Lease { number: 1, holder: u64::MAX },
            revision: Revision(4),
            run: RunId(9),
            kind: Some(OrderKind::Hold),
        },
    }
}

fn plan() -> Plan {
    let stop = Stop {
        id: StopId(152),
        at: position(10.0, 0.5),
        route: vec![position(5.0, 0.25)],
        dwell_ms: 2000,
        dwell_limit_ms: 10_000,
        partners: vec![VehicleId(1)],
        after: vec![(VehicleId(1), StopId(160))],
    };
    Plan {
        vehicle: VehicleId(2),
        run: RunId(9),
        revision: Revision(3),
        lease: Lease { number: 1, holder: u64::MAX },
        seen_state: 1000,
        members: vec![VehicleId(1), VehicleId(2)],
        start: position(0.0, -1.0),
        stops: vec![stop],
    }
}

/// A batch with a sample heard and a missed one.
pub fn samples(rssi_dbm: Option<i16>) -> Samples {
    let sample = |sequence, rssi_dbm| Sample {
        sequence,
        heard_at_ns: 12_345_678_901,
        transmitter: VehicleId(1),
        transmitter_pose: pose(),
        receiver_pose: pose(),
        channel: 12,
        power_dbm: -3,
        rssi_dbm,
    };
    let samples = vec![sample(41, rssi_dbm), sample(42, None)];
    Samples { vehicle: VehicleId(2), boot: Boot(5), run: RunId(9), samples }
}

fn beacon() -> Beacon {
    Beacon {
        sender: VehicleId(2),
        boot: Boot(5),
        sequence: 77,
        pose: pose(),
        channel: 12,
        power_dbm: 18,
        members: vec![VehicleId(1), VehicleId(3)],
        progress: progress(),
    }
}

fn order() -> Order {
    Order {
        vehicle: VehicleId(2),
        lease: Lease { number: 1, holder: 99 },
        run: RunId(9),
        revision: Revision(4),
        seen_state: 1000,
        kind: OrderKind::Return,
    }
}

fn health() -> Health {
    Health {
        vehicle: VehicleId(2),
        boot: Boot(5),
        hears: vec![VehicleId(1), VehicleId(3)],
        samples_waiting: 700,
        samples_lost: 1,
        inputs_dropped: 2,
        disk_free_mb: Some(12_000),
        troubles: vec!["the range sensor is silent".to_owned()],
    }
}

fn report() -> Report {
    Report {
        boot: Boot(4),
        lease: Lease { number: 1, holder: u64::MAX },
        store: 1 << 63,
        phase: StationPhase::Running,
        run: RunId(9),
        laps_done: 3,
        laps: 8,
        samples: 70_000,
        pictures: 2,
        members: vec![VehicleId(1), VehicleId(2)],
        lost: vec![VehicleId(3)],
        standing: Some(OrderKind::Hold),
        troubles: vec![],
    }
}

/// Gives the examples with the names of their golden files.
pub fn examples() -> Vec<(&'static str, Message)> {
    // A free stretch, cells all different, and an unknown rest.
    let cell = |index: usize| match index {
        0..700 => -17,
        700..800 => (index % 35) as i8 - 17,
        _ => 0,
    };
    let cells = Arc::new(std::array::from_fn(cell));
    let watermark = HeardFrom { vehicle: VehicleId(2), boot: Boot(5), run: RunId(9), below: 42 };
    let hello = Hello {
        node: Sender::Vehicle(VehicleId(2)),
        boot: Boot(5),
        venue_hash: 0x0123_4567_89ab_cdef,
        instance: 1 << 50,
        is_member: true,
        member_for_s: 3600,
        software: "tomoswarm 0.1.0".to_owned(),
        capabilities: vec!["range".to_owned(), "radio".to_owned()],
    };
    let digest = LayerDigest { layer: layer(), tiles: 12, revisions: 340, hash: 0xfedc_ba98_7654_3210 };
    vec![
        ("hello", Message::Hello(hello)),
        ("state", Message::State(state())),
        ("tile", Message::Tile(TileReport { layer: layer(), address: address(), revision: 6, cells })),
        ("digest", Message::Digest(Digest { layers: vec![digest] })),
        ("want", Message::Want(Want { layer: layer(), known: vec![(address(), 6)] })),
        ("plan", Message::Plan(plan())),
        ("progress", Message::Progress(progress())),
        ("order", Message::Order(order())),
        ("samples", Message::Samples(samples(Some(-71)))),
        ("have", Message::Have(Have { store: 1 << 63, watermarks: vec![watermark], closed: vec![RunId(8)] })),
        ("beacon", Message::Beacon(beacon())),
        ("health", Message::Health(health())),
        ("report", Message::Report(report())),
    ]
}
