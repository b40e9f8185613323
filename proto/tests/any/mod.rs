//! Messages of every kind with values drawn from all that may be handed to an actor.

use std::sync::Arc;

use proptest::collection::{btree_map, btree_set, vec};
use proptest::option;
use proptest::prelude::*;
use proptest::sample::select;
use tomoswarm_proto::*;

fn position() -> impl Strategy<Value = Position> {
    let coordinate = || prop_oneof![-40_000..40_000, -999_999_999..=999_999_999];
    (coordinate(), coordinate(), coordinate()).prop_map(|(x_mm, y_mm, z_mm)| Position {
        x_mm,
        y_mm,
        z_mm,
    })
}

fn pose() -> impl Strategy<Value = PoseReport> {
    (position(), 0..=Heading::LAST.0, any::<u16>()).prop_map(|(at, heading, sd)| PoseReport {
        at,
        heading: Heading(heading),
        sd: Deviation(sd),
    })
}

fn tilt() -> impl Strategy<Value = Tilt> {
    prop_oneof![Just(Tilt::UNKNOWN), (-31_416..=31_416_i16).prop_map(Tilt)]
}

fn permille() -> impl Strategy<Value = Option<Permille>> {
    option::of((0..=1000_u16).prop_map(Permille))
}

fn vehicle() -> impl Strategy<Value = VehicleId> {
    any::<u8>().prop_map(VehicleId)
}

fn vehicles(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<VehicleId>> {
    btree_set(vehicle(), count).prop_map(|ids| ids.into_iter().collect())
}

fn boot() -> impl Strategy<Value = Boot> {
    any::<u32>().prop_map(Boot)
}

/// A run, revision or stop.
fn number() -> impl Strategy<Value = u32> {
    prop_oneof![0..300_u32, 0..u32::MAX]
}

fn run() -> impl Strategy<Value = RunId> {
    number().prop_map(RunId)
}

fn stop_id() -> impl Strategy<Value = StopId> {
    number().prop_map(StopId)
}

fn lease() -> impl Strategy<Value = Lease> {
    any::<(u32, u64)>().prop_map(|(number, holder)| Lease { number, holder })
}

fn seen() -> impl Strategy<Value = Option<SeenState>> {
    option::of((boot(), any::<u64>()).prop_map(|(boot, sequence)| SeenState { boot, sequence }))
}

fn emergency_names(
    count: std::ops::RangeInclusive<usize>,
) -> impl Strategy<Value = Vec<EmergencyName>> {
    btree_set(any::<u32>().prop_map(EmergencyName), count)
        .prop_map(|names| names.into_iter().collect())
}

fn emergency() -> impl Strategy<Value = EmergencyStop> {
    let scope = prop_oneof![Just(StopScope::All), vehicle().prop_map(StopScope::One)];
    (any::<u32>(), scope, any::<u8>()).prop_map(|(name, scope, by)| EmergencyStop {
        name: EmergencyName(name),
        scope,
        by: OperatorId(by),
    })
}

fn order_kind() -> impl Strategy<Value = OrderKind> {
    select(vec![
        OrderKind::Start,
        OrderKind::Hold,
        OrderKind::Return,
        OrderKind::Land,
        OrderKind::CutMotors,
    ])
}

fn mission_kind() -> impl Strategy<Value = MissionKind> {
    select(vec![
        MissionKind::Sweep,
        MissionKind::Legs,
        MissionKind::Forward,
        MissionKind::Browse,
        MissionKind::Search,
        MissionKind::Pathfind,
        MissionKind::Explore,
        MissionKind::Patrol,
        MissionKind::Stored,
    ])
}

fn progress() -> impl Strategy<Value = Progress> {
    (
        run(),
        number(),
        option::of(stop_id()),
        option::of(stop_id()),
    )
        .prop_map(|(run, revision, done, leg)| Progress {
            run,
            revision: Revision(revision),
            done,
            leg,
        })
}

fn capability() -> impl Strategy<Value = Capability> {
    let family = select(vec![
        AutopilotFamily::Simulated,
        AutopilotFamily::ArduPilot,
        AutopilotFamily::Px4,
        AutopilotFamily::SerialText,
        AutopilotFamily::Other,
    ]);
    let range = select(vec![
        RangeSensorKind::Simulated,
        RangeSensorKind::HcSr04,
        RangeSensorKind::TfLuna,
        RangeSensorKind::Autopilot,
        RangeSensorKind::Other,
        RangeSensorKind::SerialText,
    ]);
    let servo = select(vec![
        ServoKind::Simulated,
        ServoKind::Pwm,
        ServoKind::Autopilot,
        ServoKind::Other,
    ]);
    let radio = select(vec![
        RadioKind::Simulated,
        RadioKind::XBee,
        RadioKind::Other,
    ]);
    prop_oneof![
        (family, body()).prop_map(|(family, body)| Capability::Autopilot(family, body)),
        range.prop_map(Capability::RangeSensor),
        servo.prop_map(Capability::Servo),
        radio.prop_map(Capability::Radio),
        Just(Capability::StoredMissions),
    ]
}

fn body() -> impl Strategy<Value = BodyKind> {
    select(vec![
        BodyKind::Rover,
        BodyKind::Copter,
        BodyKind::Boat,
        BodyKind::Plane,
        BodyKind::Other,
    ])
}

fn hello() -> impl Strategy<Value = Hello> {
    let node = prop_oneof![
        Just(Sender::Ground),
        any::<u8>().prop_map(|id| Sender::Operator(OperatorId(id))),
        vehicle().prop_map(Sender::Vehicle)
    ];
    let interests = vec![
        Interest::Fleet,
        Interest::Map,
        Interest::Samples,
        Interest::Images,
        Interest::Looks,
        Interest::Log,
        Interest::Settings,
    ];
    let has = (
        vec(capability(), 0..9),
        option::of(lease()),
        btree_set(select(interests), 0..5),
    );
    let member = (any::<bool>(), any::<u32>());
    (
        node,
        boot(),
        any::<[u64; 2]>(),
        member,
        "[ -~]{0,32}",
        "[ -~]{0,64}",
        has,
    )
        .prop_map(
            |(
                node,
                boot,
                [venue_hash, instance],
                member,
                name,
                software,
                (mut capabilities, lease, interest),
            )| {
                capabilities.sort();
                Hello {
                    node,
                    boot,
                    venue_hash,
                    instance,
                    is_member: member.0,
                    member_for_s: member.1,
                    name,
                    software,
                    capabilities,
                    lease,
                    interest: interest.into_iter().collect(),
                }
            },
        )
}

fn stand_reason() -> impl Strategy<Value = Option<StandReason>> {
    let others = select(vec![
        StandReason::Held,
        StandReason::Remote,
        StandReason::Autopilot,
        StandReason::Battery,
        StandReason::NoPlace,
        StandReason::Alone,
        StandReason::Blind,
    ]);
    option::of(prop_oneof![
        any::<u32>().prop_map(|name| StandReason::Stop(EmergencyName(name))),
        others
    ])
}

fn state() -> impl Strategy<Value = State> {
    let mode = select(vec![
        VehicleMode::Idle,
        VehicleMode::Driving,
        VehicleMode::Turning,
        VehicleMode::Halted,
        VehicleMode::Held,
        VehicleMode::TakingOff,
        VehicleMode::Climbing,
        VehicleMode::Landing,
        VehicleMode::Stopped,
        VehicleMode::MotorsCut,
    ]);
    let control = select(vec![
        Control::Ours,
        Control::Remote,
        Control::Own,
        Control::Silent,
    ]);
    let velocity =
        prop::array::uniform3(-1_000_000..=1_000_000).prop_map(|[x_mmps, y_mmps, z_mmps]| {
            Velocity {
                x_mmps,
                y_mmps,
                z_mmps,
            }
        });
    let motion = (option::of(pose()), tilt(), tilt(), velocity);
    let ordered = (lease(), number(), run(), option::of(order_kind())).prop_map(
        |(lease, revision, run, kind)| Ordered {
            lease,
            revision: Revision(revision),
            run,
            kind,
        },
    );
    let plan = (option::of(vec(position(), 0..4)), run(), number(), ordered);
    let who = (vehicle(), boot(), any::<u64>());
    let does = (
        mode,
        stand_reason(),
        control,
        any::<[bool; 3]>(),
        permille(),
    );
    (who, motion, does, plan).prop_map(|(who, motion, does, (leg, run, accepted, ordered))| State {
        vehicle: who.0,
        boot: who.1,
        sequence: who.2,
        pose: motion.0,
        roll: motion.1,
        pitch: motion.2,
        velocity: motion.3,
        mode: does.0,
        stands_under: does.1,
        is_at_rest: does.3[0],
        control: does.2,
        is_armed: does.3[1],
        is_landed: does.3[2],
        battery: does.4,
        leg: leg.map(|route| LegReport { route }),
        accepted: (run, Revision(accepted)),
        ordered,
    })
}

fn layer() -> impl Strategy<Value = LayerId> {
    (vehicle(), boot()).prop_map(|(vehicle, boot)| LayerId { vehicle, boot })
}

fn address() -> impl Strategy<Value = TileAddress> {
    any::<(i16, i32, i32)>().prop_map(|(slice, x, y)| TileAddress { slice, x, y })
}

/// A tile in stretches of equal cells, some of one cell.
fn tile() -> impl Strategy<Value = TileReport> {
    let stretches = vec(
        (any::<i8>(), prop_oneof![Just(1_usize), 2..300_usize]),
        1..400,
    );
    (layer(), address(), any::<u32>(), stretches).prop_map(
        |(layer, address, revision, stretches)| {
            let cells = stretches
                .into_iter()
                .flat_map(|(value, count)| std::iter::repeat_n(value, count));
            let mut cells = cells.chain(std::iter::repeat(0));
            TileReport {
                layer,
                address,
                revision,
                cells: Arc::new(std::array::from_fn(|_| cells.next().unwrap())),
            }
        },
    )
}

fn digest() -> impl Strategy<Value = Digest> {
    let entry =
        (layer(), any::<u32>(), any::<[u64; 2]>()).prop_map(|(layer, tiles, [revisions, hash])| {
            LayerDigest {
                layer,
                tiles,
                revisions,
                hash,
            }
        });
    vec(entry, 0..6).prop_map(|layers| Digest { layers })
}

fn want() -> impl Strategy<Value = TileRequest> {
    (layer(), vec((address(), any::<u32>()), 0..6))
        .prop_map(|(layer, known)| TileRequest { layer, known })
}

fn stop() -> impl Strategy<Value = Stop> {
    let after = vec((vehicle(), stop_id()), 0..4);
    (
        stop_id(),
        position(),
        vec(position(), 0..4),
        any::<[u32; 2]>(),
        vec(vehicle(), 0..4),
        after,
    )
        .prop_map(
            |(id, at, route, [dwell_ms, dwell_limit_ms], partners, after)| Stop {
                id,
                at,
                route,
                dwell_ms,
                dwell_limit_ms,
                partners,
                after,
            },
        )
}

fn plan() -> impl Strategy<Value = Plan> {
    let right = (run(), number(), lease(), seen());
    (
        vehicle(),
        right,
        vec(vehicle(), 0..4),
        position(),
        vec(stop(), 0..6),
    )
        .prop_map(
            |(vehicle, (run, revision, lease, seen), mut members, start, stops)| {
                members.push(vehicle);
                members.sort_unstable();
                members.dedup();
                Plan {
                    vehicle,
                    run,
                    revision: Revision(revision),
                    lease,
                    seen,
                    members,
                    start,
                    stops,
                }
            },
        )
}

fn mission() -> impl Strategy<Value = MissionProgress> {
    let phase = select(vec![
        MissionPhase::Waiting,
        MissionPhase::Choosing,
        MissionPhase::Going,
        MissionPhase::Dwelling,
        MissionPhase::Looking,
        MissionPhase::Yielding,
        MissionPhase::Held,
        MissionPhase::Returning,
        MissionPhase::Over,
    ]);
    let refusal = select(vec![
        MissionRefusal::NotCapable,
        MissionRefusal::Busy,
        MissionRefusal::OutsideFence,
        MissionRefusal::NoPlace,
        MissionRefusal::BadPlans,
        MissionRefusal::Autopilot,
    ]);
    let end = prop_oneof![
        Just(MissionEnd::Done),
        Just(MissionEnd::Stopped),
        (1..=u16::MAX).prop_map(MissionEnd::NoWay),
        (1..=u16::MAX).prop_map(MissionEnd::GaveUp),
        refusal.prop_map(MissionEnd::Refused),
    ];
    let does = (mission_kind(), phase, permille(), any::<u16>());
    let goes = (
        option::of(position()),
        any::<i16>(),
        option::of(end),
        any::<bool>(),
        any::<u32>(),
    );
    (vehicle(), boot(), progress(), does, goes).prop_map(|(vehicle, boot, progress, does, goes)| {
        MissionProgress {
            vehicle,
            boot,
            progress,
            kind: does.0,
            phase: does.1,
            share: does.2,
            places_left: does.3,
            goal: goes.0,
            slice: goes.1,
            end: goes.2,
            is_at_home: goes.3,
            lease_number: goes.4,
        }
    })
}

fn order() -> impl Strategy<Value = Order> {
    (
        vehicle(),
        lease(),
        run(),
        number(),
        seen(),
        order_kind(),
        emergency_names(0..=8),
    )
        .prop_map(|(vehicle, lease, run, revision, seen, kind, mut ends)| {
            if kind != OrderKind::Start {
                ends.clear();
            }
            Order {
                vehicle,
                lease,
                run,
                revision: Revision(revision),
                seen,
                kind,
                ends,
            }
        })
}

fn sample() -> impl Strategy<Value = Sample> {
    let rssi = option::of(-200_i16..=100);
    (
        any::<[u64; 2]>(),
        vehicle(),
        pose(),
        pose(),
        any::<u8>(),
        any::<i8>(),
        rssi,
    )
        .prop_map(
            |(
                [sequence, heard_at_ns],
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

fn samples() -> impl Strategy<Value = Samples> {
    let lost = btree_set(any::<u64>(), 0..8).prop_map(|bounds| {
        let bounds: Vec<u64> = bounds.into_iter().collect();
        bounds
            .chunks_exact(2)
            .map(|pair| LostSamples {
                from: pair[0],
                until: pair[1],
            })
            .collect()
    });
    (vehicle(), boot(), run(), vec(sample(), 0..5), lost).prop_map(
        |(vehicle, boot, run, mut samples, lost)| {
            samples.sort_by_key(|sample| sample.sequence);
            samples.dedup_by_key(|sample| sample.sequence);
            Samples {
                vehicle,
                boot,
                run,
                samples,
                lost,
            }
        },
    )
}

fn have() -> impl Strategy<Value = Have> {
    let mark = (vehicle(), boot(), run(), any::<u64>()).prop_map(|(vehicle, boot, run, below)| {
        HeardFrom {
            vehicle,
            boot,
            run,
            below,
        }
    });
    (any::<u64>(), vec(mark, 0..6), vec(run(), 0..4)).prop_map(|(store, watermarks, closed)| Have {
        store,
        watermarks,
        closed,
    })
}

/// Any beacon that may be sent.
pub fn beacon() -> impl Strategy<Value = Beacon> {
    let who = (vehicle(), boot(), any::<u32>());
    let radio = (any::<u8>(), any::<i8>(), any::<[bool; 3]>());
    let tag = option::of(any::<[u8; 4]>().prop_map(BeaconTag));
    (
        who,
        option::of(pose()),
        radio,
        vehicles(0..13),
        progress(),
        option::of(emergency()),
        tag,
    )
        .prop_map(
            |(
                (sender, boot, sequence),
                pose,
                (channel, power_dbm, is),
                members,
                progress,
                stop,
                tag,
            )| Beacon {
                sender,
                boot,
                sequence,
                pose,
                channel,
                power_dbm,
                is_at_rest: is[0],
                is_armed: is[1],
                is_airborne: is[2],
                members,
                progress,
                stop,
                tag,
            },
        )
}

fn autopilot_health() -> impl Strategy<Value = AutopilotHealth> {
    let action = || {
        select(vec![
            FailsafeAction::Unknown,
            FailsafeAction::Off,
            FailsafeAction::Hold,
            FailsafeAction::Land,
            FailsafeAction::Return,
            FailsafeAction::Other,
        ])
    };
    let failsafes = (action(), action(), action(), action(), action()).prop_map(
        |(battery, companion, remote, fence, estimator)| Failsafes {
            battery,
            companion,
            remote,
            fence,
            estimator,
        },
    );
    let fix = select(vec![
        SatelliteFix::Unknown,
        SatelliteFix::NoReceiver,
        SatelliteFix::NoFix,
        SatelliteFix::TwoD,
        SatelliteFix::ThreeD,
        SatelliteFix::Differential,
        SatelliteFix::RtkFloat,
        SatelliteFix::RtkFixed,
    ]);
    let estimator = select(vec![
        Estimator::Unknown,
        Estimator::Starting,
        Estimator::Good,
        Estimator::Bad,
    ]);
    let battery = any::<(Option<u32>, Option<i32>)>();
    (
        body(),
        "[ -~]{0,32}",
        battery,
        fix,
        any::<Option<u8>>(),
        estimator,
        failsafes,
    )
        .prop_map(
            |(body, firmware, (battery_mv, battery_ma), fix, satellites, estimator, failsafes)| {
                AutopilotHealth {
                    family: AutopilotFamily::ArduPilot,
                    body,
                    firmware,
                    battery_mv,
                    battery_ma,
                    fix,
                    satellites,
                    estimator,
                    failsafes,
                }
            },
        )
}

fn troubles() -> impl Strategy<Value = Vec<String>> {
    vec(".{0,30}", 0..4)
}

fn health() -> impl Strategy<Value = Health> {
    let recording = option::of(
        any::<[u32; 2]>().prop_map(|[used_mb, limit_mb]| RecordingHealth { used_mb, limit_mb }),
    );
    let radio = option::of(
        any::<[u64; 5]>().prop_map(|[sent, unsent, busy, bad, reopens]| RadioHealth {
            sent,
            unsent,
            busy,
            bad,
            reopens,
        }),
    );
    let range = option::of(
        any::<[u64; 2]>().prop_map(|[glitches, faults]| RangeHealth { glitches, faults }),
    );
    let devices = (recording, option::of(autopilot_health()), radio, range);
    let power = select(vec![Power::Unknown, Power::Good, Power::WasLow, Power::Low]);
    let computer = (
        any::<Option<u32>>(),
        power,
        any::<Option<i8>>(),
        any::<Option<bool>>(),
    );
    (
        vehicle(),
        boot(),
        vehicles(0..9),
        any::<[u64; 5]>(),
        devices,
        computer,
        troubles(),
    )
        .prop_map(
            |(
                vehicle,
                boot,
                hears,
                counts,
                (recording, autopilot, radio, range),
                computer,
                troubles,
            )| Health {
                vehicle,
                boot,
                hears,
                samples_waiting: counts[0],
                samples_lost: counts[1],
                inputs_dropped: counts[2],
                frames_refused: counts[3],
                frames_unknown: counts[4],
                disk_free_mb: computer.0,
                recording,
                autopilot,
                radio,
                range,
                power: computer.1,
                processor_c: computer.2,
                is_clock_synchronised: computer.3,
                troubles,
            },
        )
}

fn run_report() -> impl Strategy<Value = RunReport> {
    let end = option::of(select(vec![RunEnd::Done, RunEnd::Stopped, RunEnd::Failed]));
    (
        run(),
        mission_kind(),
        option::of(run()),
        end,
        any::<u64>(),
        any::<u32>(),
    )
        .prop_map(
            |(run, kind, compared_with, end, samples, images)| RunReport {
                run,
                kind,
                compared_with,
                end,
                samples,
                images,
            },
        )
}

fn report() -> impl Strategy<Value = GroundReport> {
    let phase = select(vec![
        StationPhase::Idle,
        StationPhase::Waiting,
        StationPhase::Stopping,
        StationPhase::Planning,
        StationPhase::Running,
        StationPhase::Closing,
    ]);
    let ids = (vehicles(0..9), vehicles(0..9), vehicles(0..9));
    let counts = (any::<[u32; 3]>(), any::<[u64; 2]>());
    let runs = (vec(run_report(), 0..17), option::of(order_kind()));
    (boot(), lease(), phase, run(), counts, ids, runs, troubles()).prop_map(
        |(
            boot,
            lease,
            phase,
            run,
            (numbers, [store, samples]),
            ids,
            (mut runs, in_force),
            troubles,
        )| {
            runs.sort_by_key(|report| report.run);
            runs.dedup_by_key(|report| report.run);
            GroundReport {
                boot,
                lease,
                store,
                phase,
                run,
                laps_done: numbers[0],
                laps: numbers[1],
                samples,
                images: numbers[2],
                expected: ids.0,
                members: ids.1,
                lost: ids.2,
                in_force,
                runs,
                troubles,
            }
        },
    )
}

fn standing() -> impl Strategy<Value = OpenStops> {
    (vec(emergency(), 0..9), emergency_names(0..=64)).prop_map(|(mut open, mut lifted)| {
        open.sort();
        open.dedup_by_key(|stop| stop.name);
        lifted.reverse();
        OpenStops { open, lifted }
    })
}

fn task_kind() -> impl Strategy<Value = TaskKind> {
    let planner = select(vec![
        SweepPlanner::RotatingGap,
        SweepPlanner::Fan,
        SweepPlanner::Calibrate,
        SweepPlanner::FanCorners,
        SweepPlanner::FanStraight,
    ]);
    let sweep = (
        planner,
        any::<u16>(),
        any::<Option<u16>>(),
        any::<[u32; 2]>(),
    )
        .prop_map(|(planner, positions, laps, [a, b])| TaskKind::Sweep {
            planner,
            positions,
            laps,
            dwell_ms: a.min(b),
            dwell_limit_ms: a.max(b),
        });
    let configured = (
        any::<Option<u16>>(),
        any::<Option<u16>>(),
        any::<Option<[u32; 2]>>(),
    )
        .prop_map(|(positions, laps, dwell_ms)| TaskKind::ConfiguredSweep {
            planner: laps.map(|_| SweepPlanner::Fan),
            positions,
            laps,
            dwell_ms: dwell_ms.map(|[a, b]| a.min(b)),
            dwell_limit_ms: dwell_ms.map(|[a, b]| a.max(b)),
        });
    prop_oneof![
        sweep,
        configured,
        vec(position(), 1..9).prop_map(|places| TaskKind::Legs { places }),
        (0..1_000_000_000_u32).prop_map(|distance_mm| TaskKind::Forward { distance_mm }),
        Just(TaskKind::Browse),
        Just(TaskKind::Search),
        vec(position(), 1..9).prop_map(|places| TaskKind::Pathfind { places }),
        Just(TaskKind::Explore),
        (vec(position(), 1..9), any::<[u32; 2]>()).prop_map(|(places, [rounds, duration_ms])| {
            TaskKind::Patrol {
                places,
                rounds,
                duration_ms,
            }
        }),
        stored(),
    ]
}

fn stored() -> impl Strategy<Value = TaskKind> {
    let parameters = any::<[f32; 4]>().prop_map(|numbers| numbers.map(Parameter::from));
    let item = prop_oneof![
        (position(), any::<u32>()).prop_map(|(at, stay_ms)| StoredItem::Waypoint { at, stay_ms }),
        any::<i32>().prop_map(|height_mm| StoredItem::Takeoff { height_mm }),
        (position(), any::<u32>()).prop_map(|(at, time_ms)| StoredItem::Loiter { at, time_ms }),
        any::<u32>().prop_map(StoredItem::Delay),
        option::of(position()).prop_map(StoredItem::Land),
        Just(StoredItem::Return),
        any::<u32>().prop_map(StoredItem::Speed),
        any::<(u8, u16)>().prop_map(|(channel, pulse_us)| StoredItem::Servo { channel, pulse_us }),
        (0..=Heading::LAST.0).prop_map(|units| StoredItem::Yaw(Heading(units))),
        any::<Option<u16>>().prop_map(|times| StoredItem::Jump { to: 1, times }),
        (any::<u16>(), option::of(position()), parameters).prop_map(|(command, at, parameters)| {
            StoredItem::Other {
                command,
                at,
                parameters,
            }
        }),
    ];
    vec(item, 1..9).prop_map(|items| TaskKind::Stored { items, from: 1 })
}

fn task() -> impl Strategy<Value = Task> {
    (
        lease(),
        run(),
        vehicles(1..9),
        option::of(run()),
        task_kind(),
    )
        .prop_map(|(lease, run, mut members, compare_with, kind)| {
            let compare_with = compare_with.filter(|other| *other != run);
            if matches!(kind, TaskKind::Stored { .. }) {
                members.truncate(1);
            }
            Task {
                lease,
                run,
                members,
                compare_with,
                kind,
            }
        })
}

fn find() -> impl Strategy<Value = Find> {
    let covariance = any::<(u32, i32, u32)>().prop_map(|(xx_mm2, xy_mm2, yy_mm2)| Covariance {
        xx_mm2,
        xy_mm2,
        yy_mm2,
    });
    (position(), option::of(covariance), any::<i32>(), permille()).prop_map(
        |(at, covariance, strength_udb_per_m, probability)| Find {
            at,
            covariance,
            strength_udb_per_m,
            probability,
        },
    )
}

fn area() -> impl Strategy<Value = Rectangle> {
    (position(), position()).prop_filter_map("a rectangle has an area", |(a, b)| {
        let least = Position {
            x_mm: a.x_mm.min(b.x_mm),
            y_mm: a.y_mm.min(b.y_mm),
            z_mm: a.z_mm,
        };
        let greatest = Position {
            x_mm: a.x_mm.max(b.x_mm),
            y_mm: a.y_mm.max(b.y_mm),
            z_mm: a.z_mm,
        };
        (least.x_mm < greatest.x_mm && least.y_mm < greatest.y_mm)
            .then_some(Rectangle { least, greatest })
    })
}

fn image() -> impl Strategy<Value = Image> {
    let subject = select(vec![ImageSubject::Structure, ImageSubject::Change]);
    let size = (
        1..=IMAGE_SIDE_MAX,
        1..=IMAGE_SIDE_MAX,
        any::<prop::sample::Index>(),
    );
    let about = (run(), subject, area(), size);
    (
        about,
        any::<[u32; 6]>(),
        any::<u8>(),
        any::<bool>(),
        vec(find(), 0..5),
    )
        .prop_map(
            |(
                (run, subject, area, (columns, rows, part)),
                numbers,
                seed,
                has_deviation,
                mut finds,
            )| {
                let pixels = usize::from(columns) * usize::from(rows);
                let parts = pixels.div_ceil(IMAGE_PART_PIXELS);
                let part = part.index(parts);
                let here = (pixels - part * IMAGE_PART_PIXELS).min(IMAGE_PART_PIXELS);
                let deviation: Vec<u8> = (0..here)
                    .map(|pixel| (pixel as u8).wrapping_mul(seed))
                    .collect();
                if part > 0 {
                    finds.clear();
                }
                Image {
                    run,
                    sequence: numbers[0],
                    laps: numbers[1],
                    subject,
                    area,
                    columns,
                    rows,
                    part: part as u16,
                    parts: parts as u16,
                    mean_step_udb_per_m: numbers[2],
                    mean: deviation
                        .iter()
                        .map(|value| value.cast_signed().wrapping_add(3))
                        .collect(),
                    deviation_step_udb_per_m: numbers[3],
                    deviation: has_deviation.then_some(deviation),
                    finds,
                    links_used: numbers[4],
                    links_dropped: numbers[5],
                }
            },
        )
}

fn fix() -> impl Strategy<Value = Fix> {
    let heading = option::of((0..=Heading::LAST.0).prop_map(Heading));
    let numbers = (any::<u16>(), 0..=FIX_AGE_MAX_MS);
    (vehicle(), position(), heading, numbers).prop_map(|(vehicle, at, heading, (sd, age_ms))| Fix {
        vehicle,
        at,
        heading,
        sd: Deviation(sd),
        age_ms,
    })
}

fn look() -> impl Strategy<Value = Look> {
    let heading = (0..=Heading::LAST.0).prop_map(Heading);
    let numbers = (
        option::of(any::<u32>()),
        any::<bool>(),
        0..=READING_AGE_MAX_MS,
    );
    let reading = (position(), heading, numbers);
    let reading = reading.prop_map(|(at, toward, (range_mm, is_suspect, age_ms))| LookReading {
        at,
        toward,
        range_mm,
        is_suspect,
        age_ms,
    });
    let half_angle = (0..=Heading::LAST.0).prop_map(Heading);
    let readings = vec(reading, 0..=LOOK_READINGS_MAX);
    (vehicle(), half_angle, any::<u32>(), readings).prop_map(
        |(vehicle, half_angle, max_range_mm, readings)| Look {
            vehicle,
            half_angle,
            max_range_mm,
            readings,
        },
    )
}

fn node() -> impl Strategy<Value = Sender> {
    prop_oneof![Just(Sender::Ground), vehicle().prop_map(Sender::Vehicle)]
}

fn log() -> impl Strategy<Value = LogLines> {
    let severity = prop_oneof![
        Just(LogSeverity::Info),
        Just(LogSeverity::Warning),
        Just(LogSeverity::Error)
    ];
    let said = (any::<u32>(), severity, "[a-zäöüß ]{0,80}");
    let lines = btree_map(any::<u32>(), said, 0..=LOG_LINES_MAX);
    (node(), any::<u64>(), lines).prop_map(|(node, instance, lines)| {
        let line = |(number, (age_ms, severity, text))| LogLine {
            number,
            age_ms,
            severity,
            text,
        };
        LogLines {
            node,
            instance,
            lines: lines.into_iter().map(line).collect(),
        }
    })
}

fn settings() -> impl Strategy<Value = NodeSettings> {
    let parts = (1..=SETTINGS_PARTS_MAX).prop_flat_map(|parts| (0..parts, Just(parts)));
    let text = "[a-zäöüß =\\n]{0,400}";
    (node(), any::<u64>(), parts, text).prop_map(|(node, instance, (part, parts), text)| {
        NodeSettings {
            node,
            instance,
            part,
            parts,
            text,
        }
    })
}

fn mark() -> impl Strategy<Value = Mark> {
    let run = (0..u32::MAX).prop_map(RunId);
    (run, position(), any::<bool>()).prop_map(|(run, at, stands)| Mark { run, at, stands })
}

/// Draws a message of any kind.
pub fn message() -> impl Strategy<Value = Message> {
    prop_oneof![
        hello().prop_map(Message::Hello),
        state().prop_map(Message::State),
        tile().prop_map(Message::Tile),
        digest().prop_map(Message::Digest),
        want().prop_map(Message::Want),
        plan().prop_map(Message::Plan),
        mission().prop_map(Message::Mission),
        order().prop_map(Message::Order),
        samples().prop_map(Message::Samples),
        have().prop_map(Message::Have),
        beacon().prop_map(Message::Beacon),
        health().prop_map(Message::Health),
        report().prop_map(Message::Report),
        standing().prop_map(Message::Standing),
        task().prop_map(Message::Task),
        image().prop_map(Message::Image),
        fix().prop_map(Message::Fix),
        mark().prop_map(Message::Mark),
        look().prop_map(Message::Look),
        log().prop_map(Message::Log),
        settings().prop_map(Message::Settings),
    ]
}
