//! What holds whatever the vehicle is told, and in which order: random sequences of inputs, and a witness that sees only
//! what goes in and what comes out. The witness knows no state of the actor, so that both can be wrong only apart.

use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::time::Duration;

use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use tomoswarm_proto::{EmergencyName, Ordered, StopScope};

use super::*;
use crate::autopilot::Item;
use crate::node::tests_support::{variant_of, variants};
use crate::node::vehicle::disarming::DisarmingState;
use crate::node::vehicle::restraint::Restraint;

/// What happens next; what refers to something refers to what the witness has seen.
#[derive(Clone, Debug)]
enum Happening {
    Telemetry {
        x_m: f64,
        motion: Motion,
        is_armed: bool,
        is_lost: bool,
    },
    Scan {
        range_m: f64,
    },
    Drive {
        is_off_plan: bool,
        to_m: f64,
        decided_ago: Duration,
    },
    Turn {
        decided_ago: Duration,
    },
    FollowStored {
        to_m: f64,
        decided_ago: Duration,
    },
    Stand,
    Order {
        kind: OrderKind,
        lease_step: i32,
        holder: u64,
        revision_step: i32,
        states_ago: u64,
        is_ours: bool,
        names_take_over: bool,
    },
    /// Who steers.
    Steered(Control),
    Peer {
        y_m: f64,
        drives: bool,
    },
    MissionHolds(bool),
    /// Whether an emergency stop is open.
    Stops(bool),
    Nothing,
}

fn any_motion() -> impl Strategy<Value = Motion> {
    prop_oneof![
        Just(Motion::Resting),
        Just(Motion::Turning),
        Just(Motion::Driving)
    ]
}

fn any_kind() -> impl Strategy<Value = OrderKind> {
    prop_oneof![
        3 => Just(OrderKind::Start),
        1 => Just(OrderKind::Hold),
        1 => Just(OrderKind::Return),
        1 => Just(OrderKind::Land),
        1 => Just(OrderKind::CutMotors),
    ]
}

fn any_order() -> impl Strategy<Value = Happening> {
    let lease_step = prop_oneof![6 => Just(0), 1 => Just(1), 1 => Just(-1)];
    let states_ago = prop_oneof![5 => 0..3u64, 1 => 3..80u64];
    let often = || prop::bool::weighted(0.9);
    (
        any_kind(),
        lease_step,
        0..3u64,
        -1..3i32,
        states_ago,
        often(),
        any::<bool>(),
    )
        .prop_map(
            |(kind, lease_step, holder, revision_step, states_ago, is_ours, names_take_over)| {
                Happening::Order {
                    kind,
                    lease_step,
                    holder,
                    revision_step,
                    states_ago,
                    is_ours,
                    names_take_over,
                }
            },
        )
}

fn any_control() -> impl Strategy<Value = Control> {
    prop_oneof![
        Just(Control::Ours),
        Just(Control::Remote),
        Just(Control::Own),
        Just(Control::Silent)
    ]
}

fn any_happening() -> impl Strategy<Value = Happening> {
    let decided_ago = || (0..1300u64).prop_map(Duration::from_millis);
    let telemetry = (
        0.0..2.0f64,
        any_motion(),
        any::<bool>(),
        prop::bool::weighted(0.05),
    )
        .prop_map(|(x_m, motion, is_armed, is_lost)| Happening::Telemetry {
            x_m,
            motion,
            is_armed,
            is_lost,
        });
    let drive = (any::<bool>(), -4.0..26.0f64, decided_ago()).prop_map(
        |(is_off_plan, to_m, decided_ago)| Happening::Drive {
            is_off_plan,
            to_m,
            decided_ago,
        },
    );
    let follow = (-4.0..26.0f64, decided_ago())
        .prop_map(|(to_m, decided_ago)| Happening::FollowStored { to_m, decided_ago });
    prop_oneof![
        2 => follow,
        12 => telemetry,
        2 => (0.1..4.0f64).prop_map(|range_m| Happening::Scan { range_m }),
        4 => drive,
        2 => decided_ago().prop_map(|decided_ago| Happening::Turn { decided_ago }),
        1 => Just(Happening::Stand),
        5 => any_order(),
        1 => (0.0..6.0f64, any::<bool>()).prop_map(|(y_m, drives)| Happening::Peer { y_m, drives }),
        1 => any::<bool>().prop_map(Happening::MissionHolds),
        2 => prop::bool::weighted(0.4).prop_map(Happening::Stops),
        1 => any_control().prop_map(Happening::Steered),
        1 => Just(Happening::Nothing),
    ]
}

/// Happenings, each some time after the one before.
fn any_sequence() -> impl Strategy<Value = Vec<(Duration, Happening)>> {
    let gap_ms = prop_oneof![8 => 0..250u64, 2 => 250..700u64, 1 => 700..9000u64];
    prop::collection::vec(
        (gap_ms.prop_map(Duration::from_millis), any_happening()),
        1..120,
    )
}

/// What the orders obeyed so far forbid.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Ban {
    None,
    UntilStartOrReturn,
    UntilStart,
}

/// What emergency stops forbid.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Stopped {
    No,
    Open,
    Lifted,
}

/// Watches what goes into a vehicle and what comes out of it.
struct Witness {
    vehicle: Vehicle,
    now: Time,
    sequence: u64,
    here: Point,
    peer_sequence: u64,
    highest: (u32, Reverse<u64>, u32),
    ban: Ban,
    stopped: Stopped,
    /// Somebody has taken over, and no start has named that.
    is_taken: bool,
    /// What answers a state of before this one does not send the vehicle out.
    answers_from: u64,
    /// When the last stop was said, unless a drive or a turn was said since.
    stop_said: Option<Time>,
    /// When the last disarming was said, unless an arming was said since.
    disarm_said: Option<Time>,
    /// A stop was lifted: what an order still owes the motors is not known from outside.
    may_disarm: bool,
    /// When an order to disarm at rest was obeyed that no disarming and no arming has followed.
    disarm_owed: Option<Time>,
    has_reported_silence: bool,
}

impl Witness {
    fn new() -> Witness {
        Witness {
            vehicle: Vehicle {
                readiness: Readiness::Ready,
                ..Vehicle::new(settings(1))
            },
            now: at(1.0),
            sequence: 0,
            here: Point::new(0.0, 0.0),
            peer_sequence: 0,
            highest: (0, Reverse(0), 0),
            ban: Ban::None,
            stopped: Stopped::No,
            is_taken: false,
            answers_from: 0,
            stop_said: None,
            disarm_said: None,
            may_disarm: false,
            disarm_owed: None,
            has_reported_silence: false,
        }
    }

    /// Lets the time pass, and then something happen; wakes the vehicle in between as every runtime does.
    fn see(&mut self, gap: Duration, happening: &Happening) {
        let next = self.now + gap;
        if let Some(due) = self.vehicle.deadline().filter(|due| due.at <= next) {
            self.now = due.at;
            let mut out = Vec::new();
            self.vehicle.wake(due.at, &mut out).unwrap();
            assert_eq!(out, [Out::SafetyEvent(SafetyEvent::AutopilotSilent)]);
            assert!(
                self.vehicle
                    .deadline()
                    .is_none_or(|later| later.at > due.at),
                "woken in vain"
            );
            assert!(
                !std::mem::replace(&mut self.has_reported_silence, true),
                "silence is reported once"
            );
        }
        self.now = next;
        let Some(input) = self.input(happening) else {
            return;
        };
        let mut out = Vec::new();
        handled(&mut self.vehicle, self.now, input.clone(), &mut out);
        if let In::Stops(open) = &input {
            self.check_stops(!open.is_empty(), &out);
        }
        if let In::Autopilot(status) = &input {
            self.check_steered(status.control, &out);
        }
        self.check_flying(&input, &out);
        self.check_order(&input, &out);
        self.note(&out);
        if let In::Telemetry(telemetry) = input {
            self.check_owed(&telemetry);
            self.check_state(&out);
        }
    }

    fn input(&mut self, happening: &Happening) -> Option<In> {
        let decided = |ago: Duration| self.now - ago;
        Some(match *happening {
            Happening::Telemetry {
                x_m,
                motion,
                is_armed,
                is_lost,
            } => {
                (self.here, self.has_reported_silence) = (Point::new(x_m, 0.0), false);
                let sd_m = if is_lost { 0.9 } else { 0.05 };
                let pose = Pose {
                    at: self.here,
                    heading: Angle::default(),
                    sd_m,
                };
                let speed_mps = if motion == Motion::Driving { 0.5 } else { 0.0 };
                In::Telemetry(Telemetry {
                    pose,
                    flight_state: Default::default(),
                    speed_mps,
                    battery: Some(1.0),
                    motion,
                    is_armed,
                    stored: None,
                })
            }
            Happening::Scan { range_m } => scan(range_m, 0.0),
            Happening::Drive {
                is_off_plan,
                to_m,
                decided_ago,
            } => {
                let route = vec![
                    self.here,
                    Point::new(1.0, to_m / 2.0),
                    Point::new(0.0, to_m),
                ];
                In::Command(
                    decided(decided_ago),
                    MoveCommand::Drive { is_off_plan, route },
                )
            }
            Happening::Turn { decided_ago } => {
                In::Command(decided(decided_ago), MoveCommand::Turn(Angle::default()))
            }
            Happening::FollowStored { to_m, decided_ago } => {
                let to = |y_m: f64| Item::Waypoint {
                    at: Point::new(0.0, y_m),
                    altitude_m: 0.0,
                    delay: Duration::ZERO,
                };
                let items = vec![to(0.0), to(to_m / 2.0), to(to_m)];
                In::Command(
                    decided(decided_ago),
                    MoveCommand::FollowStored { items, from: 1 },
                )
            }
            Happening::Stand => In::Command(Time::ZERO, MoveCommand::Hold),
            Happening::Order {
                kind,
                lease_step,
                holder,
                revision_step,
                states_ago,
                is_ours,
                names_take_over,
            } => {
                let (number, Reverse(known_holder), revision) = self.highest;
                let lease = Lease {
                    number: number.saturating_add_signed(lease_step),
                    holder: if lease_step == 0 {
                        known_holder
                    } else {
                        holder
                    },
                };
                let revision = revision.saturating_add_signed(revision_step);
                let seen_state = self.sequence.saturating_sub(states_ago);
                let vehicle = if is_ours { VehicleId(1) } else { VehicleId(2) };
                let names = names_take_over && kind == OrderKind::Start;
                let name = EmergencyName::of_take_over(VehicleId(1), Boot(1));
                let ends = names.then_some(name).into_iter().collect();
                given(Order {
                    vehicle,
                    ends,
                    ..order(kind, lease, revision, seen_state)
                })
            }
            Happening::Peer { y_m, drives } => {
                self.peer_sequence += 1;
                let to = [Point::new(1.0, y_m), Point::new(1.0, 1.0)]
                    .map(Into::into)
                    .to_vec();
                let leg = drives.then_some(LegReport { route: to });
                let mode = if drives {
                    VehicleMode::Driving
                } else {
                    VehicleMode::Idle
                };
                let peer = crate::node::tests_support::state(2, 1.0, y_m);
                In::Peer(State {
                    sequence: self.peer_sequence,
                    mode,
                    leg,
                    ..peer
                })
            }
            Happening::MissionHolds(holds) => In::Holds(holds.then_some(StandReason::Alone)),
            Happening::Stops(is_open) => {
                let name = EmergencyName(EmergencyName::LOWEST_DRAWN);
                let stop = EmergencyStop {
                    name,
                    scope: StopScope::All,
                    by: OperatorId(1),
                };
                In::Stops(is_open.then_some(stop).into_iter().collect())
            }
            Happening::Steered(control) => In::Autopilot(ControlStatus {
                switch: None,
                control,
                is_landed: true,
            }),
            Happening::Nothing => return None,
        })
    }

    /// Nothing moves under a ban or disarmed, and only by a command; motors get current only by an order that frees.
    fn check_flying(&self, input: &In, out: &[Out]) {
        for fly in flown(out) {
            match fly {
                AutopilotCommand::Drive { .. }
                | AutopilotCommand::Turn(_)
                | AutopilotCommand::FollowStored { .. } => {
                    assert!(matches!(input, In::Command(..)), "it moves by itself");
                    assert_eq!(
                        self.ban,
                        Ban::None,
                        "it moves although it was stopped by an order"
                    );
                    assert_eq!(
                        self.stopped,
                        Stopped::No,
                        "it moves under an emergency stop"
                    );
                    assert_eq!(self.disarm_said, None, "it moves without motors");
                    assert!(!self.is_taken, "it moves although somebody else steers");
                }
                AutopilotCommand::Arm => {
                    let frees = obeyed_kind(out).is_some_and(|kind| match kind {
                        OrderKind::Start => true,
                        OrderKind::Return => self.ban != Ban::UntilStart,
                        OrderKind::Hold | OrderKind::Land | OrderKind::CutMotors => false,
                    });
                    assert!(frees, "it is armed by {input:?}");
                }
                AutopilotCommand::TakeBack => {
                    let is_ended = self.is_taken && obeyed_kind(out) == Some(OrderKind::Start);
                    assert!(is_ended, "it is taken back by {input:?}");
                }
                AutopilotCommand::Disarm => {
                    let may = self.disarm_said.is_some()
                        || self.may_disarm
                        || obeyed_kind(out) == Some(OrderKind::CutMotors);
                    let rests =
                        matches!(input, In::Telemetry(told) if told.motion == Motion::Resting);
                    assert!(
                        may || (self.disarm_owed.is_some() && rests),
                        "braking needs the motors"
                    );
                }
                AutopilotCommand::Stop => {
                    let is_lost = |told: &Telemetry| told.pose.sd_m > 0.5;
                    let is_due = |told| self.stop_said.is_some() || is_lost(told);
                    assert!(
                        !matches!(input, In::Telemetry(told) if !is_due(told)),
                        "it stops for nothing"
                    );
                }
            }
        }
        if let In::Command(_, MoveCommand::Hold) = input {
            assert!(stops(out), "standing is always allowed");
        }
    }

    /// Orders are obeyed in ascending order, those that stop whatever their age, and at once.
    fn check_order(&self, input: &In, out: &[Out]) {
        let In::Order(_, order) = input else {
            assert!(!obeyed(out), "an order out of nothing");
            return;
        };
        let is_higher = edition(order) > self.highest;
        let is_ours = order.vehicle == VehicleId(1);
        assert!(
            !obeyed(out) || (is_higher && is_ours),
            "obeyed {order:?} after {:?}",
            self.highest
        );
        let stopping = !matches!(order.kind, OrderKind::Start | OrderKind::Return);
        assert!(
            obeyed(out) || !(is_higher && is_ours && stopping),
            "not stopped by {order:?}"
        );
        let seen = order.seen.map_or(0, |seen| seen.sequence);
        let may_begin = match (order.kind, self.stopped) {
            (OrderKind::Start, Stopped::Open)
            | (OrderKind::Return, Stopped::Open | Stopped::Lifted) => false,
            (OrderKind::Start | OrderKind::Return, _) => seen > self.answers_from,
            (OrderKind::Hold | OrderKind::Land | OrderKind::CutMotors, _) => true,
        };
        assert!(
            !obeyed(out) || may_begin,
            "an emergency stop forbids {order:?}"
        );
        let names_it = order.kind == OrderKind::Start && !order.ends.is_empty();
        let sends_out = matches!(order.kind, OrderKind::Start | OrderKind::Return);
        let may_end = !self.is_taken || !sends_out || names_it;
        assert!(!obeyed(out) || may_end, "a take-over forbids {order:?}");
        if obeyed(out) {
            assert_eq!(stops(out), order.kind != OrderKind::Start, "{order:?}");
            assert_eq!(
                flown(out).contains(&AutopilotCommand::Disarm),
                order.kind == OrderKind::CutMotors,
                "{order:?}"
            );
            let armed = match order.kind {
                OrderKind::Start => true,
                OrderKind::Return => self.ban != Ban::UntilStart,
                OrderKind::Hold | OrderKind::Land | OrderKind::CutMotors => false,
            };
            assert_eq!(
                flown(out).contains(&AutopilotCommand::Arm),
                armed,
                "{order:?}"
            );
        }
    }

    /// Notes what was said.
    fn note(&mut self, out: &[Out]) {
        for sent_at in out {
            match sent_at {
                Out::AutopilotCommand(
                    AutopilotCommand::Drive { .. }
                    | AutopilotCommand::Turn(_)
                    | AutopilotCommand::FollowStored { .. },
                ) => self.stop_said = None,
                Out::AutopilotCommand(AutopilotCommand::Stop) => self.stop_said = Some(self.now),
                Out::AutopilotCommand(AutopilotCommand::Arm) => {
                    (self.disarm_said, self.disarm_owed, self.may_disarm) = (None, None, false);
                }
                Out::AutopilotCommand(AutopilotCommand::TakeBack) => self.is_taken = false,
                Out::AutopilotCommand(AutopilotCommand::Disarm) => {
                    (self.disarm_said, self.disarm_owed) = (Some(self.now), None)
                }
                Out::Order(order) => self.note_order(order),
                Out::State(state) => self.sequence = state.sequence,
                Out::Publish(_) | Out::Remember(_) | Out::SafetyEvent(_) => {}
            }
        }
    }

    /// An emergency stop brakes at once, and its lifting does nothing.
    fn check_stops(&mut self, is_open: bool, out: &[Out]) {
        match (self.stopped, is_open) {
            (Stopped::No | Stopped::Lifted, true) => {
                assert_eq!(flown(out), [AutopilotCommand::Stop], "at once");
                (self.stopped, self.disarm_owed) = (Stopped::Open, Some(self.now));
                self.answers_from = self.sequence;
                if self.ban == Ban::None {
                    self.ban = Ban::UntilStartOrReturn;
                }
            }
            (Stopped::Open, false) => {
                assert_eq!(out, []);
                self.stopped = Stopped::Lifted;
                self.answers_from = self.sequence;
                (self.disarm_said, self.disarm_owed, self.may_disarm) = (None, None, true);
            }
            (_, _) => assert_eq!(out, []),
        }
    }

    /// What was asked for before somebody took over is not obeyed after it. An autopilot that acts by itself is stopped if
    /// the vehicle is to stand.
    fn check_steered(&mut self, control: Control, out: &[Out]) {
        let is_banned = self.ban != Ban::None || self.stopped != Stopped::No;
        assert_eq!(
            stops(out),
            control == Control::Own && is_banned,
            "{control:?}"
        );
        // The link says so only when it was told to take it back.
        self.is_taken &= control != Control::Ours;
        if matches!(control, Control::Remote | Control::Own) {
            self.stop_said = None;
            if !std::mem::replace(&mut self.is_taken, true) {
                self.answers_from = self.sequence;
            }
        }
    }

    fn note_order(&mut self, order: &Order) {
        self.highest = edition(order);
        if order.kind == OrderKind::Start {
            assert!(!self.is_taken, "a start leaves nobody steering");
            self.stopped = Stopped::No;
        }
        match order.kind {
            OrderKind::Start => self.ban = Ban::None,
            OrderKind::Return if self.ban == Ban::UntilStart => {}
            OrderKind::Return => self.ban = Ban::None,
            OrderKind::Hold | OrderKind::Land if self.ban == Ban::UntilStart => {}
            OrderKind::Hold | OrderKind::Land => self.ban = Ban::UntilStartOrReturn,
            OrderKind::CutMotors => self.ban = Ban::UntilStart,
        }
        if order.kind == OrderKind::Land {
            self.disarm_owed = Some(self.now);
        }
    }

    /// What telemetry does not show was said again by now; what waits for rest was said at rest.
    fn check_owed(&self, telemetry: &Telemetry) {
        let again = Duration::from_millis(300);
        let moves = telemetry.motion != Motion::Resting;
        let is_older =
            |sent_at: Option<Time>| sent_at.is_some_and(|sent_at| self.now.since(sent_at) >= again);
        assert!(
            !(moves && is_older(self.stop_said)),
            "it moves and is not told to stop again"
        );
        assert!(
            !(telemetry.is_armed && is_older(self.disarm_said)),
            "armed, and not told to disarm again"
        );
        let is_late = self
            .disarm_owed
            .is_some_and(|since| self.now.since(since) > again);
        assert!(moves || !is_late, "it rests and is not disarmed");
    }

    /// The state tells the highest order, and whether an emergency stands.
    fn check_state(&self, out: &[Out]) {
        let state = out.iter().find_map(|out| match out {
            Out::State(state) => Some(state),
            Out::Publish(_)
            | Out::AutopilotCommand(_)
            | Out::Remember(_)
            | Out::Order(_)
            | Out::SafetyEvent(_) => None,
        });
        let state = state.expect("every telemetry makes a state");
        let Ordered {
            lease, revision, ..
        } = state.ordered;
        assert_eq!(
            (lease.number, Reverse(lease.holder), revision.0),
            self.highest
        );
        assert_eq!(
            state.mode == VehicleMode::Stopped,
            self.stopped == Stopped::Open
        );
        let is_cut = self.ban == Ban::UntilStart && self.stopped != Stopped::Open;
        assert_eq!(state.mode == VehicleMode::MotorsCut, is_cut);
        assert!(
            state.mode != VehicleMode::Idle || self.ban == Ban::None,
            "a vehicle that is held says so"
        );
    }
}

/// What orders are compared by, in the words of this file: the higher lease, of two the lower holder, then the revision.
fn edition(order: &Order) -> (u32, Reverse<u64>, u32) {
    (
        order.lease.number,
        Reverse(order.lease.holder),
        order.revision.0,
    )
}

fn obeyed_kind(out: &[Out]) -> Option<OrderKind> {
    out.iter().find_map(|out| match out {
        Out::Order(order) => Some(order.kind),
        Out::SafetyEvent(_)
        | Out::AutopilotCommand(_)
        | Out::Remember(_)
        | Out::State(_)
        | Out::Publish(_) => None,
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn the_laws_hold_whatever_comes(sequence in any_sequence()) {
        let mut witness = Witness::new();
        for (gap, happening) in &sequence {
            witness.see(*gap, happening);
        }
    }
}

#[test]
fn the_sequences_reach_every_state_and_move_and_stop_in_all_of_them() {
    let mut runner = TestRunner::deterministic();
    let (mut moved, mut restrained, mut disarmed) =
        (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
    for _ in 0..200 {
        let mut witness = Witness::new();
        for (gap, happening) in any_sequence().new_tree(&mut runner).unwrap().current() {
            witness.see(gap, &happening);
            moved.insert(variant_of(&witness.vehicle.movement));
            let restraint = witness.vehicle.orders.restraint();
            restrained.insert(variant_of(restraint));
            if let Restraint::Landing(disarming) | Restraint::MotorsCut(disarming) = restraint {
                disarmed.insert(variant_of(disarming));
            }
        }
    }
    assert_eq!(moved, variants::<MovementOrder>());
    assert_eq!(restrained, variants::<Restraint>());
    assert_eq!(disarmed, variants::<DisarmingState>());
}
