//! Messages with all fields set: one of every kind, in the order of the kinds, then more of those whose bytes depend on
//! a choice.

use std::sync::Arc;

use tomoswarm_proto::*;

fn position(x_mm: i32, y_mm: i32) -> Position {
    Position {
        x_mm,
        y_mm,
        z_mm: 0,
    }
}

/// A pose in a yard.
pub fn pose() -> PoseReport {
    PoseReport {
        at: position(1500, -2250),
        heading: Heading(7500),
        sd: Deviation(50),
    }
}

fn layer() -> LayerId {
    LayerId {
        vehicle: VehicleId(2),
        boot: Boot(70_000),
    }
}

fn address() -> TileAddress {
    TileAddress {
        slice: -1,
        x: -300,
        y: 4,
    }
}

fn progress() -> Progress {
    let (done, leg) = (Some(StopId(151)), Some(StopId(152)));
    Progress {
        run: RunId(9),
        revision: Revision(3),
        done,
        leg,
    }
}

fn lease() -> Lease {
    Lease {
        number: 1,
        holder: 0xfeed_0000_0000_0001,
    }
}

fn seen() -> Option<SeenState> {
    Some(SeenState {
        boot: Boot(5),
        sequence: 1000,
    })
}

fn emergency() -> EmergencyStop {
    EmergencyStop {
        name: EmergencyName(0x1234_5678),
        scope: StopScope::All,
        by: OperatorId(1),
    }
}

fn hello() -> Hello {
    Hello {
        node: Sender::Vehicle(VehicleId(2)),
        boot: Boot(5),
        venue_hash: 0x0123_4567_89ab_cdef,
        instance: 1 << 50,
        is_member: true,
        member_for_s: 3600,
        name: "north rover".to_owned(),
        software: "tomoswarm 0.1.0".to_owned(),
        capabilities: vec![
            Capability::Autopilot(AutopilotFamily::ArduPilot, BodyKind::Rover),
            Capability::RangeSensor(RangeSensorKind::HcSr04),
            Capability::RangeSensor(RangeSensorKind::HcSr04),
            Capability::Servo(ServoKind::Autopilot),
            Capability::Radio(RadioKind::XBee),
            Capability::StoredMissions,
        ],
        lease: None,
        interest: vec![],
    }
}

fn state() -> State {
    State {
        vehicle: VehicleId(2),
        boot: Boot(5),
        sequence: 70_000,
        pose: Some(pose()),
        roll: Tilt(-120),
        pitch: Tilt(350),
        velocity: Velocity {
            x_mmps: 300,
            y_mmps: 331,
            z_mmps: 0,
        },
        mode: VehicleMode::Driving,
        stands_under: None,
        is_at_rest: false,
        control: Control::Ours,
        is_armed: true,
        is_landed: true,
        battery: Some(Permille(875)),
        leg: None,
        accepted: (RunId(9), Revision(3)),
        ordered: Ordered {
            lease: lease(),
            revision: Revision(4),
            run: RunId(9),
            kind: Some(OrderKind::Start),
        },
    }
}

fn plan() -> Plan {
    let stop = Stop {
        id: StopId(152),
        at: position(10_000, 500),
        route: vec![position(5000, 250)],
        dwell_ms: 2000,
        dwell_limit_ms: 10_000,
        partners: vec![VehicleId(1)],
        after: vec![(VehicleId(1), StopId(160))],
    };
    Plan {
        vehicle: VehicleId(2),
        run: RunId(9),
        revision: Revision(3),
        lease: lease(),
        seen: seen(),
        members: vec![VehicleId(1), VehicleId(2)],
        start: position(0, -1000),
        stops: vec![stop],
    }
}

fn mission() -> MissionProgress {
    MissionProgress {
        vehicle: VehicleId(2),
        boot: Boot(5),
        progress: progress(),
        kind: MissionKind::Sweep,
        phase: MissionPhase::Going,
        share: Some(Permille(496)),
        places_left: 153,
        goal: Some(position(10_000, 500)),
        slice: 0,
        end: None,
        is_at_home: false,
        lease_number: 1,
    }
}

fn order() -> Order {
    Order {
        vehicle: VehicleId(2),
        lease: lease(),
        run: RunId(9),
        revision: Revision(4),
        seen: seen(),
        kind: OrderKind::Return,
        ends: vec![],
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
    let samples = vec![sample(4100, rssi_dbm), sample(4101, None)];
    let lost = vec![LostSamples {
        from: 4090,
        until: 4095,
    }];
    Samples {
        vehicle: VehicleId(2),
        boot: Boot(5),
        run: RunId(9),
        samples,
        lost,
    }
}

fn beacon() -> Beacon {
    Beacon {
        sender: VehicleId(2),
        boot: Boot(5),
        sequence: 7700,
        pose: Some(pose()),
        channel: 12,
        power_dbm: 18,
        is_at_rest: false,
        is_armed: true,
        is_airborne: false,
        members: [1, 3, 4, 5, 6, 7, 8].map(VehicleId).to_vec(),
        progress: Progress {
            done: Some(StopId(351)),
            leg: Some(StopId(352)),
            ..progress()
        },
        stop: None,
        tag: None,
    }
}

fn health() -> Health {
    let failsafes = Failsafes {
        battery: FailsafeAction::Return,
        companion: FailsafeAction::Hold,
        remote: FailsafeAction::Off,
        fence: FailsafeAction::Land,
        estimator: FailsafeAction::Other,
    };
    let autopilot = AutopilotHealth {
        family: AutopilotFamily::ArduPilot,
        body: BodyKind::Rover,
        firmware: "4.5.4".to_owned(),
        battery_mv: Some(11_840),
        battery_ma: Some(-1250),
        fix: SatelliteFix::RtkFixed,
        satellites: Some(17),
        estimator: Estimator::Good,
        failsafes,
    };
    Health {
        vehicle: VehicleId(2),
        boot: Boot(5),
        hears: vec![VehicleId(1), VehicleId(3)],
        samples_waiting: 700,
        samples_lost: 1,
        inputs_dropped: 2,
        frames_refused: 3,
        frames_unknown: 4,
        disk_free_mb: Some(12_000),
        recording: Some(RecordingHealth {
            used_mb: 180,
            limit_mb: 2000,
        }),
        autopilot: Some(autopilot),
        radio: Some(RadioHealth {
            sent: 7700,
            unsent: 12,
            busy: 9,
            bad: 1,
            reopens: 2,
        }),
        range: Some(RangeHealth {
            glitches: 44,
            faults: 5,
        }),
        power: Power::WasLow,
        processor_c: Some(61),
        is_clock_synchronised: Some(true),
        troubles: vec!["the range sensor is silent".to_owned()],
    }
}

fn report() -> GroundReport {
    let run = |run, kind, compared_with, end| RunReport {
        run: RunId(run),
        kind,
        compared_with: Option::map(compared_with, RunId),
        end,
        samples: 70_000,
        images: 2,
    };
    GroundReport {
        boot: Boot(4),
        lease: lease(),
        store: 1 << 63,
        phase: StationPhase::Running,
        run: RunId(9),
        laps_done: 3,
        laps: 8,
        samples: 70_000,
        images: 2,
        expected: vec![VehicleId(1), VehicleId(2), VehicleId(3)],
        members: vec![VehicleId(1), VehicleId(2)],
        lost: vec![VehicleId(3)],
        in_force: Some(OrderKind::Hold),
        runs: vec![
            run(7, MissionKind::Explore, None, Some(RunEnd::Stopped)),
            run(8, MissionKind::Sweep, None, Some(RunEnd::Done)),
            run(9, MissionKind::Sweep, Some(8), None),
        ],
        troubles: vec![],
    }
}

fn standing() -> OpenStops {
    let lifted = vec![EmergencyName(0xdead_beef), EmergencyName(0x0bad_cafe)];
    OpenStops {
        open: vec![emergency()],
        lifted,
    }
}

fn task() -> Task {
    Task {
        lease: lease(),
        run: RunId(9),
        members: vec![VehicleId(1), VehicleId(2)],
        compare_with: Some(RunId(8)),
        kind: TaskKind::Sweep {
            planner: SweepPlanner::RotatingGap,
            positions: 76,
            laps: Some(8),
            dwell_ms: 1000,
            dwell_limit_ms: 30_000,
        },
    }
}

fn image() -> Image {
    let find = Find {
        at: position(4210, 6850),
        covariance: Some(Covariance {
            xx_mm2: 40_000,
            xy_mm2: -2500,
            yy_mm2: 62_500,
        }),
        strength_udb_per_m: 1_850_000,
        probability: Some(Permille(970)),
    };
    Image {
        run: RunId(9),
        sequence: 6,
        laps: 3,
        subject: ImageSubject::Change,
        area: Rectangle {
            least: position(0, 0),
            greatest: position(10_000, 10_000),
        },
        columns: 40,
        rows: 40,
        part: 0,
        parts: 1,
        mean_step_udb_per_m: 20_000,
        mean: (0..1600)
            .map(|pixel: i32| (pixel % 256 - 128) as i8)
            .collect(),
        deviation_step_udb_per_m: 5_000,
        deviation: Some((0..1600).map(|pixel: i32| (pixel % 251) as u8).collect()),
        finds: vec![find],
        links_used: 612,
        links_dropped: 88,
    }
}

/// Returns one message of every kind with the names of their golden files.
pub fn examples() -> Vec<(&'static str, Message)> {
    // A free stretch, cells all different, and an unknown rest.
    let cell = |index: usize| match index {
        0..700 => -17,
        700..800 => (index % 35) as i8 - 17,
        _ => 0,
    };
    let cells = Arc::new(std::array::from_fn(cell));
    let watermark = HeardFrom {
        vehicle: VehicleId(2),
        boot: Boot(5),
        run: RunId(9),
        below: 42,
    };
    let digest = LayerDigest {
        layer: layer(),
        tiles: 12,
        revisions: 340,
        hash: 0xfedc_ba98_7654_3210,
    };
    vec![
        ("hello", Message::Hello(hello())),
        ("state", Message::State(state())),
        (
            "tile",
            Message::Tile(TileReport {
                layer: layer(),
                address: address(),
                revision: 6,
                cells,
            }),
        ),
        (
            "digest",
            Message::Digest(Digest {
                layers: vec![digest],
            }),
        ),
        (
            "want",
            Message::Want(TileRequest {
                layer: layer(),
                known: vec![(address(), 6)],
            }),
        ),
        ("plan", Message::Plan(plan())),
        ("mission", Message::Mission(mission())),
        ("order", Message::Order(order())),
        ("samples", Message::Samples(samples(Some(-71)))),
        (
            "have",
            Message::Have(Have {
                store: 1 << 63,
                watermarks: vec![watermark],
                closed: vec![RunId(8)],
            }),
        ),
        ("beacon", Message::Beacon(beacon())),
        ("health", Message::Health(health())),
        ("report", Message::Report(report())),
        ("standing", Message::Standing(standing())),
        ("task", Message::Task(task())),
        ("image", Message::Image(image())),
        (
            "fix",
            Message::Fix(Fix {
                vehicle: VehicleId(2),
                at: position(1500, -2250),
                heading: Some(Heading(7500)),
                sd: Deviation(5),
                age_ms: 12,
            }),
        ),
        (
            "mark",
            Message::Mark(Mark {
                run: RunId(7),
                at: position(8000, 12_250),
                stands: true,
            }),
        ),
        ("look", Message::Look(look())),
        (
            "log",
            Message::Log(LogLines {
                node: Sender::Vehicle(VehicleId(2)),
                instance: 0x0123_4567_89ab_cdef,
                lines: vec![LogLine {
                    number: 17,
                    age_ms: 340,
                    severity: LogSeverity::Warning,
                    text: "autopilot: PreArm: GPS 1 not healthy".to_owned(),
                }],
            }),
        ),
        (
            "settings",
            Message::Settings(NodeSettings {
                node: Sender::Vehicle(VehicleId(2)),
                instance: 0x0123_4567_89ab_cdef,
                part: 0,
                parts: 1,
                text: "kind = \"vehicle\"\nid = 2\n".to_owned(),
            }),
        ),
    ]
}

fn look() -> Look {
    let reading = |toward, range_mm, age_ms| LookReading {
        at: position(1500, -2250),
        toward: Heading(toward),
        range_mm,
        is_suspect: false,
        age_ms,
    };
    Look {
        vehicle: VehicleId(2),
        half_angle: Heading(2618),
        max_range_mm: 4000,
        readings: vec![reading(7500, Some(1830), 104), reading(9245, None, 4)],
    }
}

/// Returns further messages of kinds whose bytes depend on a choice, with the names of their golden files.
pub fn variants() -> Vec<(&'static str, Message)> {
    let operator = Hello {
        node: Sender::Operator(OperatorId(1)),
        name: String::new(),
        capabilities: vec![],
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
        ..hello()
    };
    let corners = [(0, 0), (1000, 0), (1000, 2500)].map(|(x_mm, y_mm)| position(x_mm, y_mm));
    let on_a_leg = State {
        leg: Some(LegReport {
            route: corners.to_vec(),
        }),
        ..state()
    };
    let stopped = State {
        pose: None,
        roll: Tilt::UNKNOWN,
        pitch: Tilt::UNKNOWN,
        velocity: Velocity::default(),
        mode: VehicleMode::Stopped,
        stands_under: Some(StandReason::Stop(emergency().name)),
        is_at_rest: true,
        control: Control::Silent,
        is_armed: false,
        battery: None,
        ..state()
    };
    let blind = State {
        stands_under: Some(StandReason::Blind),
        ..state()
    };
    let refused = MissionProgress {
        progress: Progress {
            done: None,
            leg: None,
            ..progress()
        },
        kind: MissionKind::Pathfind,
        phase: MissionPhase::Over,
        share: None,
        goal: None,
        slice: -1,
        end: Some(MissionEnd::Refused(MissionRefusal::OutsideFence)),
        is_at_home: true,
        ..mission()
    };
    let gave_up = MissionProgress {
        end: Some(MissionEnd::GaveUp(300)),
        ..refused
    };
    let start = Order {
        seen: None,
        kind: OrderKind::Start,
        ends: vec![EmergencyName(0), emergency().name],
        ..order()
    };
    let one = EmergencyStop {
        scope: StopScope::One(VehicleId(2)),
        ..emergency()
    };
    let stop = Beacon {
        pose: None,
        is_at_rest: true,
        is_armed: false,
        is_airborne: true,
        stop: Some(one),
        tag: Some(BeaconTag([1, 2, 3, 4])),
        ..beacon()
    };
    let bare = Health {
        disk_free_mb: None,
        recording: None,
        autopilot: None,
        radio: None,
        range: None,
        power: Power::Unknown,
        processor_c: None,
        is_clock_synchronised: None,
        troubles: vec![],
        ..health()
    };
    let of_kind = |kind| {
        Message::Task(Task {
            kind,
            compare_with: None,
            ..task()
        })
    };
    let last = Image {
        subject: ImageSubject::Structure,
        columns: 80,
        part: 1,
        parts: 2,
        mean: vec![-1; 128],
        deviation: None,
        finds: vec![],
        ..image()
    };
    vec![
        ("hello-operator", Message::Hello(operator)),
        (
            "hello-ground",
            Message::Hello(Hello {
                node: Sender::Ground,
                capabilities: vec![],
                ..hello()
            }),
        ),
        ("state-on-a-leg", Message::State(on_a_leg)),
        ("state-blind", Message::State(blind)),
        ("state-stopped", Message::State(stopped)),
        ("mission-refused", Message::Mission(refused)),
        ("mission-gave-up", Message::Mission(gave_up)),
        ("order-start", Message::Order(start)),
        ("beacon-stop", Message::Beacon(stop)),
        ("health-bare", Message::Health(bare)),
        (
            "task-legs",
            of_kind(TaskKind::Legs {
                places: corners.to_vec(),
            }),
        ),
        (
            "task-forward",
            of_kind(TaskKind::Forward { distance_mm: 5000 }),
        ),
        (
            "task-pathfind",
            of_kind(TaskKind::Pathfind {
                places: corners[1..].to_vec(),
            }),
        ),
        ("task-explore", of_kind(TaskKind::Explore)),
        (
            "task-configured-sweep",
            of_kind(TaskKind::ConfiguredSweep {
                planner: None,
                positions: None,
                laps: Some(4),
                dwell_ms: None,
                dwell_limit_ms: None,
            }),
        ),
        (
            "task-patrol",
            of_kind(TaskKind::Patrol {
                places: corners.to_vec(),
                rounds: 3,
                duration_ms: 600_000,
            }),
        ),
        (
            "task-stored",
            Message::Task(Task {
                members: vec![VehicleId(2)],
                compare_with: None,
                kind: TaskKind::Stored {
                    items: stored_items(corners[0]),
                    from: 2,
                },
                ..task()
            }),
        ),
        ("image-last-part", Message::Image(last)),
    ]
}

/// One item of each kind.
fn stored_items(at: Position) -> Vec<StoredItem> {
    vec![
        StoredItem::Takeoff { height_mm: 3000 },
        StoredItem::Waypoint { at, stay_ms: 1500 },
        StoredItem::Speed(500),
        StoredItem::Servo {
            channel: 9,
            pulse_us: 1700,
        },
        StoredItem::Loiter { at, time_ms: 4000 },
        StoredItem::Yaw(Heading(15_708)),
        StoredItem::Delay(2000),
        StoredItem::Jump {
            to: 2,
            times: Some(3),
        },
        StoredItem::Other {
            command: 82,
            at: Some(at),
            parameters: [0.0, 0.5, f32::NAN, -1.0].map(Parameter::from),
        },
        StoredItem::Land(None),
        StoredItem::Return,
    ]
}
