//! The longest message of every kind that may be handed to an actor: all lists full, all numbers as long as they may be.

use std::sync::Arc;

use tomoswarm_proto::*;

/// Runs, revisions and stops are under the last number.
const NUMBER: u32 = u32::MAX - 1;

fn position() -> Position {
    Position {
        x_mm: 999_999_999,
        y_mm: -999_999_999,
        z_mm: 999_999_999,
    }
}

fn pose() -> PoseReport {
    PoseReport {
        at: position(),
        heading: Heading::LAST,
        sd: Deviation::UNKNOWN,
    }
}

fn vehicles(count: usize) -> Vec<VehicleId> {
    (0..count)
        .map(|id| VehicleId((255 - (count - 1 - id)) as u8))
        .collect()
}

fn names(count: u32) -> Vec<EmergencyName> {
    (0..count)
        .rev()
        .map(|back| EmergencyName(u32::MAX - back))
        .collect()
}

fn emergency(name: EmergencyName) -> EmergencyStop {
    EmergencyStop {
        name,
        scope: StopScope::One(VehicleId(255)),
        by: OperatorId(255),
    }
}

fn lease() -> Lease {
    Lease {
        number: u32::MAX,
        holder: u64::MAX,
    }
}

fn seen() -> Option<SeenState> {
    Some(SeenState {
        boot: Boot(u32::MAX),
        sequence: u64::MAX,
    })
}

fn progress() -> Progress {
    let stop = Some(StopId(NUMBER));
    Progress {
        run: RunId(NUMBER),
        revision: Revision(NUMBER),
        done: stop,
        leg: stop,
    }
}

fn text(bytes: usize) -> String {
    "x".repeat(bytes)
}

fn hello() -> Hello {
    let autopilot = Capability::Autopilot(AutopilotFamily::Other, BodyKind::Other);
    Hello {
        node: Sender::Vehicle(VehicleId(255)),
        boot: Boot(u32::MAX),
        venue_hash: u64::MAX,
        instance: u64::MAX,
        is_member: true,
        member_for_s: u32::MAX,
        name: text(32),
        software: text(64),
        capabilities: vec![autopilot; 32],
        lease: Some(lease()),
        interest: vec![
            Interest::Fleet,
            Interest::Map,
            Interest::Samples,
            Interest::Images,
            Interest::Looks,
            Interest::Log,
            Interest::Settings,
        ],
    }
}

fn state() -> State {
    let mmps = 1_000_000;
    State {
        vehicle: VehicleId(255),
        boot: Boot(u32::MAX),
        sequence: u64::MAX,
        pose: Some(pose()),
        roll: Tilt::UNKNOWN,
        pitch: Tilt::UNKNOWN,
        velocity: Velocity {
            x_mmps: mmps,
            y_mmps: mmps,
            z_mmps: mmps,
        },
        mode: VehicleMode::MotorsCut,
        stands_under: Some(StandReason::Stop(EmergencyName(u32::MAX))),
        is_at_rest: true,
        control: Control::Silent,
        is_armed: true,
        is_landed: true,
        battery: Some(Permille::WHOLE),
        leg: Some(LegReport {
            route: vec![position(); 1024],
        }),
        accepted: (RunId(NUMBER), Revision(NUMBER)),
        ordered: Ordered {
            lease: lease(),
            revision: Revision(NUMBER),
            run: RunId(NUMBER),
            kind: Some(OrderKind::CutMotors),
        },
    }
}

fn beacon() -> Beacon {
    Beacon {
        sender: VehicleId(255),
        boot: Boot(u32::MAX),
        sequence: u32::MAX,
        pose: Some(pose()),
        channel: 255,
        power_dbm: i8::MIN,
        is_at_rest: true,
        is_armed: true,
        is_airborne: true,
        members: vehicles(BEACON_MEMBERS_MAX),
        progress: progress(),
        stop: Some(emergency(EmergencyName(u32::MAX))),
        tag: Some(BeaconTag([255; 4])),
    }
}

/// Returns samples that take the most bytes.
pub fn samples(count: u64) -> Samples {
    let sample = |back| Sample {
        sequence: u64::MAX - back,
        heard_at_ns: u64::MAX,
        transmitter: VehicleId(255),
        transmitter_pose: pose(),
        receiver_pose: pose(),
        channel: 255,
        power_dbm: i8::MIN,
        rssi_dbm: Some(-200),
    };
    let lost = |index: u64| LostSamples {
        from: (1 << 40) + 4 * index,
        until: (1 << 40) + 4 * index + 2,
    };
    Samples {
        vehicle: VehicleId(255),
        boot: Boot(u32::MAX),
        run: RunId(NUMBER),
        samples: (0..count).rev().map(sample).collect(),
        lost: (0..64).map(lost).collect(),
    }
}

fn mission() -> MissionProgress {
    MissionProgress {
        vehicle: VehicleId(255),
        boot: Boot(u32::MAX),
        progress: progress(),
        kind: MissionKind::Explore,
        phase: MissionPhase::Over,
        share: Some(Permille::WHOLE),
        places_left: u16::MAX,
        goal: Some(position()),
        slice: i16::MIN,
        end: Some(MissionEnd::GaveUp(u16::MAX)),
        is_at_home: true,
        lease_number: u32::MAX,
    }
}

fn order() -> Order {
    Order {
        vehicle: VehicleId(255),
        lease: lease(),
        run: RunId(NUMBER),
        revision: Revision(NUMBER),
        seen: seen(),
        kind: OrderKind::Start,
        ends: names(8),
    }
}

fn health() -> Health {
    let most = u64::MAX;
    let autopilot = AutopilotHealth {
        family: AutopilotFamily::Other,
        body: BodyKind::Other,
        firmware: text(32),
        battery_mv: Some(u32::MAX),
        battery_ma: Some(i32::MIN),
        fix: SatelliteFix::RtkFixed,
        satellites: Some(255),
        estimator: Estimator::Bad,
        failsafes: Failsafes::default(),
    };
    Health {
        vehicle: VehicleId(255),
        boot: Boot(u32::MAX),
        hears: vehicles(256),
        samples_waiting: most,
        samples_lost: most,
        inputs_dropped: most,
        frames_refused: most,
        frames_unknown: most,
        disk_free_mb: Some(u32::MAX),
        recording: Some(RecordingHealth {
            used_mb: u32::MAX,
            limit_mb: u32::MAX,
        }),
        autopilot: Some(autopilot),
        radio: Some(RadioHealth {
            sent: most,
            unsent: most,
            busy: most,
            bad: most,
            reopens: most,
        }),
        range: Some(RangeHealth {
            glitches: most,
            faults: most,
        }),
        power: Power::Low,
        processor_c: Some(i8::MIN),
        is_clock_synchronised: Some(true),
        troubles: vec![text(200); 16],
    }
}

fn report() -> GroundReport {
    let run = |back| RunReport {
        run: RunId(NUMBER - back),
        kind: MissionKind::Explore,
        compared_with: Some(RunId(NUMBER)),
        end: Some(RunEnd::Failed),
        samples: u64::MAX,
        images: u32::MAX,
    };
    GroundReport {
        boot: Boot(u32::MAX),
        lease: lease(),
        store: u64::MAX,
        phase: StationPhase::Closing,
        run: RunId(NUMBER),
        laps_done: u32::MAX,
        laps: u32::MAX,
        samples: u64::MAX,
        images: u32::MAX,
        expected: vehicles(256),
        members: vehicles(256),
        lost: vehicles(256),
        in_force: Some(OrderKind::CutMotors),
        runs: (0..16).rev().map(run).collect(),
        troubles: vec![text(200); 16],
    }
}

/// Returns a task of so many places, each as far away as may be.
pub fn task(places: Vec<Position>) -> Task {
    Task {
        lease: lease(),
        run: RunId(NUMBER),
        members: vehicles(256),
        compare_with: Some(RunId(NUMBER - 1)),
        kind: TaskKind::Pathfind { places },
    }
}

/// Returns the longest task.
fn stored() -> Task {
    let item = StoredItem::Other {
        command: u16::MAX,
        at: Some(position()),
        parameters: [f32::NAN; 4].map(Parameter::from),
    };
    let items = vec![item; STORED_ITEMS_MAX];
    Task {
        members: vehicles(1),
        kind: TaskKind::Stored { items, from: 717 },
        ..task(vec![position()])
    }
}

fn image() -> Image {
    let covariance = Covariance {
        xx_mm2: u32::MAX,
        xy_mm2: i32::MIN,
        yy_mm2: u32::MAX,
    };
    let find = Find {
        at: position(),
        covariance: Some(covariance),
        strength_udb_per_m: i32::MIN,
        probability: Some(Permille::WHOLE),
    };
    let least = Position {
        x_mm: -999_999_999,
        y_mm: -999_999_999,
        z_mm: 999_999_999,
    };
    Image {
        run: RunId(NUMBER),
        sequence: u32::MAX,
        laps: u32::MAX,
        subject: ImageSubject::Change,
        area: Rectangle {
            least,
            greatest: Position {
                y_mm: 999_999_999,
                ..position()
            },
        },
        columns: 400,
        rows: 400,
        part: 0,
        parts: 53,
        mean_step_udb_per_m: u32::MAX,
        mean: vec![i8::MIN; IMAGE_PART_PIXELS],
        deviation_step_udb_per_m: u32::MAX,
        deviation: Some(vec![u8::MAX; IMAGE_PART_PIXELS]),
        finds: vec![find; 32],
        links_used: u32::MAX,
        links_dropped: u32::MAX,
    }
}

/// A plan of as many bytes as one may have is longer than a frame; this one is as long as a frame nearly.
fn plan() -> Plan {
    let stop = Stop {
        id: StopId(NUMBER),
        at: position(),
        route: vec![],
        dwell_ms: u32::MAX,
        dwell_limit_ms: u32::MAX,
        partners: vehicles(15),
        after: vec![(VehicleId(255), StopId(NUMBER)); 2],
    };
    Plan {
        vehicle: VehicleId(255),
        run: RunId(NUMBER),
        revision: Revision(NUMBER),
        lease: lease(),
        seen: seen(),
        members: vehicles(256),
        start: position(),
        stops: vec![stop; 4096],
    }
}

/// Returns the longest message of every kind, in the order of the kinds; a plan may be as long as a frame.
pub fn extremes() -> Vec<Message> {
    let lines = (0..LOG_LINES_MAX as u32).map(|back| LogLine {
        number: u32::MAX - (LOG_LINES_MAX as u32 - back),
        age_ms: u32::MAX,
        severity: LogSeverity::Error,
        text: "x".repeat(LOG_LINE_BYTES_MAX),
    });
    let reading = LookReading {
        at: position(),
        toward: Heading::LAST,
        range_mm: Some(u32::MAX),
        is_suspect: true,
        age_ms: READING_AGE_MAX_MS,
    };
    let layer = LayerId {
        vehicle: VehicleId(255),
        boot: Boot(u32::MAX),
    };
    let address = TileAddress {
        slice: i16::MIN,
        x: i32::MIN,
        y: i32::MIN,
    };
    let cells = Arc::new(std::array::from_fn(|index| (index % 7) as i8));
    let digest = LayerDigest {
        layer,
        tiles: u32::MAX,
        revisions: u64::MAX,
        hash: u64::MAX,
    };
    let mark = HeardFrom {
        vehicle: VehicleId(255),
        boot: Boot(u32::MAX),
        run: RunId(NUMBER),
        below: u64::MAX,
    };
    let open = names(8).into_iter().map(emergency).collect();
    vec![
        Message::Hello(hello()),
        Message::State(state()),
        Message::Tile(TileReport {
            layer,
            address,
            revision: u32::MAX,
            cells,
        }),
        Message::Digest(Digest {
            layers: vec![digest; 256],
        }),
        Message::Want(TileRequest {
            layer,
            known: vec![(address, u32::MAX); 4096],
        }),
        Message::Plan(plan()),
        Message::Mission(mission()),
        Message::Order(order()),
        Message::Samples(samples(1024)),
        Message::Have(Have {
            store: u64::MAX,
            watermarks: vec![mark; 4096],
            closed: vec![RunId(NUMBER); 1024],
        }),
        Message::Beacon(beacon()),
        Message::Health(health()),
        Message::Report(report()),
        Message::Standing(OpenStops {
            open,
            lifted: names(64),
        }),
        Message::Task(stored()),
        Message::Image(image()),
        Message::Fix(Fix {
            vehicle: VehicleId(250),
            at: position(),
            heading: Some(Heading::LAST),
            sd: Deviation::UNKNOWN,
            age_ms: FIX_AGE_MAX_MS,
        }),
        Message::Mark(Mark {
            run: RunId(NUMBER),
            at: position(),
            stands: true,
        }),
        Message::Look(Look {
            vehicle: VehicleId(250),
            half_angle: Heading::LAST,
            max_range_mm: u32::MAX,
            readings: vec![reading; LOOK_READINGS_MAX],
        }),
        Message::Log(LogLines {
            node: Sender::Vehicle(VehicleId(250)),
            instance: u64::MAX,
            lines: lines.collect(),
        }),
        Message::Settings(NodeSettings {
            node: Sender::Vehicle(VehicleId(250)),
            instance: u64::MAX,
            part: SETTINGS_PARTS_MAX - 1,
            parts: SETTINGS_PARTS_MAX,
            text: "x".repeat(SETTINGS_PART_BYTES_MAX),
        }),
    ]
}
