//! Orders in virtual time, against vehicles that obey what is above their echo.

use tomoswarm_proto::codec::{self, Greeting};
use tomoswarm_proto::{Boot, Control, Hello, Message, OpenStops, OrderKind as Kind};

use super::super::tests_support::{Rover, at, heard, report};
use super::*;

const GROUNDS: Lease = Lease {
    number: 4,
    holder: 44,
};
const OWN: u64 = 7;

fn want(kind: Kind) -> Instruction {
    Instruction {
        kind,
        begins: true,
        mission: None,
        vehicles: BTreeSet::new(),
        expected: BTreeSet::new(),
        although_unheard: BTreeSet::new(),
        lifts_many: false,
        run: None,
        ends_run: false,
        take_over: false,
        holder: OWN,
        venue_hash: 5,
        timeout: Duration::from_secs(5),
    }
}

fn only_one(kind: Kind) -> Instruction {
    Instruction {
        vehicles: BTreeSet::from([VehicleId(1)]),
        ..want(kind)
    }
}

/// A small world: what is said arrives within a tick of 20 ms unless it is lost.
struct World {
    now: Time,
    ordering: Ordering,
    rovers: Vec<Rover>,
    report: Option<GroundReport>,
    sent: Vec<(Time, Order)>,
    /// Returns whether an order with this running number is lost.
    loses: fn(usize) -> bool,
    /// From when on the vehicles' states come.
    states_from: Time,
}

const TICK: Duration = Duration::from_millis(20);

impl World {
    fn new(want: Instruction, rovers: Vec<Rover>) -> World {
        let ordering = Ordering::new(Time::ZERO, want);
        let loses = |_| false;
        World {
            now: Time::ZERO,
            ordering,
            rovers,
            report: None,
            sent: vec![],
            loses,
            states_from: Time::ZERO,
        }
    }

    fn with_ground(mut self) -> World {
        self.report = Some(report());
        self
    }

    /// Goes on by one tick.
    fn tick(&mut self) -> Option<OrderOutcome> {
        for order in self.ordering.act(self.now, true) {
            if !(self.loses)(self.sent.len()) {
                self.rovers.iter_mut().for_each(|rover| rover.obey(&order));
            }
            self.sent.push((self.now, order));
        }
        self.now = self.now + TICK;
        let tick = self.now.as_nanos() / 20_000_000;
        if tick.is_multiple_of(10) && self.now >= self.states_from {
            for rover in &mut self.rovers {
                self.ordering.hear(self.now, &rover.say_stops());
                self.ordering.hear(self.now, &rover.say());
            }
        }
        if let Some(report) = self.report.as_ref().filter(|_| tick.is_multiple_of(50)) {
            self.ordering
                .hear(self.now, &heard(Message::Report(report.clone())));
        }
        self.ordering.outcome(self.now)
    }

    fn run(&mut self) -> OrderOutcome {
        (0..1000).find_map(|_| self.tick()).unwrap()
    }

    fn run_until(&mut self, until_s: f64) {
        while self.now < at(until_s) {
            assert_eq!(self.tick(), None, "it is over at {} already", self.now);
        }
    }
}

fn outcomes(outcome: &OrderOutcome) -> Vec<VehicleOutcome> {
    outcome.vehicles.values().copied().collect()
}

fn obeyed_ms(outcome: &OrderOutcome) -> Vec<u128> {
    let after = |outcome: &VehicleOutcome| match outcome {
        VehicleOutcome::Obeyed { after, .. } => after.as_millis(),
        other => panic!("{other:?}"),
    };
    outcome.vehicles.values().map(after).collect()
}

#[test]
fn a_start_uses_the_grounds_lease_and_ends_when_all_states_show_it() {
    let mut world = World::new(want(Kind::Start), vec![Rover::new(1), Rover::new(2)]).with_ground();
    let outcome = world.run();
    assert!(outcome.is_done(), "{outcome:?}");
    assert_eq!(
        (outcome.lease, outcome.run),
        (Some(GROUNDS), Some(RunId(1)))
    );
    assert!(
        world
            .sent
            .iter()
            .all(|(_, order)| order.revision == Revision(1) && order.seen.is_some())
    );
    assert_eq!(world.rovers[1].state.ordered.kind, Some(Kind::Start));
}

#[test]
fn where_nobody_holds_a_lease_an_own_one_begins() {
    let outcome = World::new(want(Kind::Start), vec![Rover::new(1)]).run();
    assert!(outcome.is_done());
    assert_eq!(
        outcome.lease,
        Some(Lease {
            number: 2,
            holder: OWN
        })
    );
}

#[test]
fn the_revision_is_above_each_vehicles_own_echo() {
    let rovers = vec![Rover::ordered(1, GROUNDS, 9, Kind::Start), Rover::new(2)];
    let mut world = World::new(want(Kind::Hold), rovers);
    assert!(world.run().is_done());
    let of = |id| {
        world
            .sent
            .iter()
            .find(|(_, order)| order.vehicle == VehicleId(id))
            .unwrap()
            .1
            .clone()
    };
    assert_eq!((of(1).lease, of(1).revision), (GROUNDS, Revision(10)));
    assert_eq!((of(2).lease, of(2).revision), (GROUNDS, Revision(1)));
}

#[test]
fn lost_orders_are_sent_again_every_100_ms() {
    let mut world = World::new(want(Kind::Hold), vec![Rover::new(1)]);
    world.loses = |number| number < 8;
    let outcome = world.run();
    let times: Vec<u64> = world
        .sent
        .iter()
        .map(|(at, _)| at.as_nanos() / 1_000_000)
        .collect();
    assert!(
        times.windows(2).all(|pair| pair[1] - pair[0] == 100),
        "{times:?}"
    );
    let after = obeyed_ms(&outcome)[0];
    assert!(
        (800..=1000).contains(&after),
        "{after} ms: eight are lost, a state comes every 200 ms"
    );
}

#[test]
fn what_stops_waits_for_no_ground_and_what_starts_does() {
    for (kind, from_s, to_s) in [(Kind::Hold, 0.2, 0.24), (Kind::Start, 2.0, 2.1)] {
        let mut world = World::new(want(kind), vec![Rover::new(1)]);
        world.run();
        let first = world.sent[0].0;
        assert!(
            (at(from_s)..=at(to_s)).contains(&first),
            "{kind:?} at {first}"
        );
    }
}

#[test]
fn late_states_are_waited_for_and_nobody_counts_as_missing_who_then_comes() {
    let two = BTreeSet::from([VehicleId(1), VehicleId(2)]);
    let mut world = World::new(
        Instruction {
            vehicles: two,
            ..want(Kind::Hold)
        },
        vec![Rover::new(1), Rover::new(2)],
    );
    world.states_from = at(3.0);
    world.run_until(2.9);
    assert_eq!(world.sent, vec![]);
    assert!(world.run().is_done());
}

#[test]
fn who_is_not_heard_is_named_when_the_time_is_up() {
    let two = BTreeSet::from([VehicleId(1), VehicleId(2)]);
    let mut world = World::new(
        Instruction {
            vehicles: two,
            ..want(Kind::Hold)
        },
        vec![Rover::new(2)],
    );
    let outcome = world.run();
    assert!(
        matches!(
            outcomes(&outcome)[..],
            [VehicleOutcome::Unheard, VehicleOutcome::Obeyed { .. }]
        ),
        "{outcome:?}"
    );
    assert!(!outcome.is_done() && world.now == at(5.0));
    let nobody = World::new(want(Kind::Hold), vec![]).run();
    assert!(!nobody.is_done() && nobody.vehicles.is_empty());
}

#[test]
fn who_hears_nothing_is_said_to_have_ignored_it() {
    let mut world = World::new(want(Kind::Hold), vec![Rover::new(1)]);
    world.loses = |_| true;
    assert_eq!(outcomes(&world.run()), [VehicleOutcome::Ignored]);
}

#[test]
fn a_vehicle_started_anew_in_between_is_told_again() {
    let both = BTreeSet::from([VehicleId(1), VehicleId(2)]);
    let mut world = World::new(
        Instruction {
            vehicles: both,
            ..want(Kind::Hold)
        },
        vec![Rover::ordered(1, GROUNDS, 5, Kind::Start)],
    );
    world.run_until(1.0);
    assert_eq!(world.rovers[0].state.ordered.kind, Some(Kind::Hold));
    world.rovers[0].restart();
    world.rovers.push(Rover::new(2));
    world.run_until(1.15);
    assert_eq!(
        world.rovers[0].state.ordered.kind, None,
        "its new state has not come yet"
    );
    assert!(world.run().is_done());
    assert_eq!(world.rovers[0].state.ordered.kind, Some(Kind::Hold));
}

#[test]
fn a_higher_order_of_another_lease_overrules_and_is_named() {
    let mut world = World::new(only_one(Kind::Start), vec![Rover::new(1)]).with_ground();
    world.loses = |_| true;
    world.run_until(1.2);
    let lease = Lease {
        number: 9,
        holder: 1,
    };
    let other = Rover::ordered(1, lease, 1, Kind::Hold).state.ordered;
    world.rovers[0].state.ordered = other;
    assert_eq!(outcomes(&world.run()), [VehicleOutcome::Overruled(other)]);
    assert!(world.now < at(1.5));
}

#[test]
fn a_hold_goes_above_a_start_of_the_same_lease_and_not_the_other_way_round() {
    for (ours, theirs, wins) in [
        (Kind::Hold, Kind::Start, true),
        (Kind::Start, Kind::Hold, false),
    ] {
        let mut world = World::new(want(ours), vec![Rover::ordered(1, GROUNDS, 5, Kind::Start)]);
        world.loses = |number| number < 10;
        while world.sent.is_empty() {
            world.tick();
        }
        world.rovers[0].state.ordered = Rover::ordered(1, GROUNDS, 6, theirs).state.ordered;
        assert_eq!(world.run().is_done(), wins, "{ours:?} against {theirs:?}");
    }
}

#[test]
fn a_start_that_the_ground_brings_about_by_a_hold_is_obeyed_unless_something_stands() {
    for (standing, is_done) in [(None, true), (Some(Kind::Hold), false)] {
        let mut world = World::new(only_one(Kind::Start), vec![Rover::new(1)]).with_ground();
        world.loses = |_| true;
        while world.sent.is_empty() {
            world.tick();
        }
        // It was obeyed between two states, and the ground has ordered to hold in the same run.
        world.rovers[0].state.ordered = Rover::ordered(1, GROUNDS, 2, Kind::Hold).state.ordered;
        world.report = Some(GroundReport {
            phase: StationPhase::Stopping,
            run: RunId(1),
            in_force: standing,
            ..report()
        });
        let outcome = world.run();
        assert_eq!(outcome.is_done(), is_done, "{outcome:?}");
    }
}

#[test]
fn a_start_that_never_came_is_not_taken_for_one_that_the_ground_brings_about() {
    for (revision, theirs) in [
        (1, Kind::Hold),
        (1, Kind::Land),
        (2, Kind::Land),
        (2, Kind::Return),
    ] {
        let mut world = World::new(only_one(Kind::Start), vec![Rover::new(1)]).with_ground();
        world.loses = |_| true;
        while world.sent.is_empty() {
            world.tick();
        }
        // Somebody else has ordered it at the same time; the ground station has not heard of that yet.
        world.rovers[0].state.ordered = Rover::ordered(1, GROUNDS, revision, theirs).state.ordered;
        world.report = Some(GroundReport {
            phase: StationPhase::Stopping,
            run: RunId(1),
            ..report()
        });
        let outcome = world.run();
        assert!(!outcome.is_done(), "{revision} {theirs:?}: {outcome:?}");
    }
}

#[test]
fn a_lease_is_taken_over_with_the_next_number_and_an_own_holder() {
    let rovers = vec![Rover::ordered(1, GROUNDS, 9, Kind::Start), Rover::new(2)];
    let outcome = World::new(
        Instruction {
            take_over: true,
            ..want(Kind::Start)
        },
        rovers,
    )
    .with_ground()
    .run();
    assert!(outcome.is_done());
    assert_eq!(
        outcome.lease,
        Some(Lease {
            number: 5,
            holder: OWN
        })
    );
}

#[test]
fn a_start_of_an_idle_ground_begins_the_next_run_and_otherwise_goes_on() {
    let run_of = |begins, phase, run| {
        let mut world = World::new(
            Instruction {
                begins,
                run,
                ..want(Kind::Start)
            },
            vec![Rover::new(1)],
        );
        world.report = Some(GroundReport {
            phase,
            run: RunId(6),
            ..report()
        });
        world.run().run
    };
    assert_eq!(run_of(true, StationPhase::Idle, None), Some(RunId(7)));
    assert_eq!(run_of(true, StationPhase::Running, None), Some(RunId(6)));
    assert_eq!(run_of(false, StationPhase::Idle, None), Some(RunId(6)));
    assert_eq!(
        run_of(true, StationPhase::Idle, Some(RunId(12))),
        Some(RunId(12))
    );
}

#[test]
fn who_has_no_part_in_the_mission_that_a_start_goes_on_with_is_named() {
    let outcome_of = |kind, end| {
        let mut world = World::new(want(Kind::Start), vec![Rover::new(1), Rover::new(2)]);
        let run = tomoswarm_proto::RunReport {
            run: RunId(6),
            kind,
            end,
            ..Default::default()
        };
        world.report = Some(GroundReport {
            run: RunId(6),
            runs: vec![run],
            ..report()
        });
        let outcome = world.run();
        assert!(outcome.is_done(), "{outcome:?}");
        outcome.vehicles[&VehicleId(1)]
    };
    use tomoswarm_proto::MissionKind::{Explore, Sweep};
    let of = outcome_of(Explore, None);
    let is_named = matches!(of, VehicleOutcome::NoPart { run: RunId(6), .. });
    assert!(is_named, "{of}");
    assert!(of.to_string().contains("shows no mission of run 6"), "{of}");
    let of = outcome_of(Sweep, None);
    assert!(matches!(of, VehicleOutcome::Obeyed { .. }), "{of}");
    let of = outcome_of(Explore, Some(tomoswarm_proto::RunEnd::Done));
    assert!(matches!(of, VehicleOutcome::Obeyed { .. }), "{of}");
}

/// A greeting of a vehicle with this version and venue file.
fn greets(vehicle: u8, version: u8, venue_hash: u64) -> HeardMessage {
    let (node, boot) = (Sender::Vehicle(VehicleId(vehicle)), Boot(1));
    let hello = Hello {
        is_member: true,
        member_for_s: 9,
        ..Hello::asking(node, boot, venue_hash, 1)
    };
    let hello = (version == codec::VERSION).then_some(hello);
    HeardMessage::Greeting(
        Greeting {
            version,
            node,
            boot,
            venue_hash,
        },
        hello,
    )
}

#[test]
fn who_has_another_venue_file_or_version_is_named_at_once_and_not_ordered() {
    for (version, venue_hash, misfit) in [
        (codec::VERSION, 6, Incompatibility::Venue(6)),
        (
            codec::VERSION + 1,
            5,
            Incompatibility::Version(codec::VERSION + 1),
        ),
    ] {
        let mut ordering = Ordering::new(Time::ZERO, only_one(Kind::Hold));
        ordering.hear(at(0.1), &Rover::new(1).say());
        ordering.hear(at(0.1), &greets(1, version, venue_hash));
        assert_eq!(ordering.act(at(0.2), true), vec![]);
        let outcome = ordering.outcome(at(0.2)).unwrap();
        assert_eq!(outcomes(&outcome), [VehicleOutcome::Foreign(misfit)]);
        assert!(!outcome.is_done());
        // It fits: nothing is refused.
        ordering.hear(at(0.3), &greets(1, codec::VERSION, 5));
        assert_eq!(ordering.act(at(0.4), true).len(), 1);
    }
}

#[test]
fn a_vehicle_that_remembers_is_told_again_above_what_it_remembers() {
    for revisions_missed in 0..3 {
        let mut world = World::new(
            only_one(Kind::Hold),
            vec![Rover::ordered(1, GROUNDS, 5, Kind::Start)],
        );
        world.loses = |_| true;
        world.run_until(0.5);
        // It has obeyed what nobody has seen, and others' orders of this lease.
        world.rovers[0].state.ordered.revision.0 += revisions_missed;
        world.rovers[0].restart_remembering();
        world.loses = |_| false;
        assert!(world.run().is_done(), "{revisions_missed}");
        let ordered = world.rovers[0].state.ordered;
        assert_eq!((ordered.lease, ordered.kind), (GROUNDS, Some(Kind::Hold)));
        assert!(ordered.revision.0 > 5);
    }
}

#[test]
fn what_a_vehicle_remembers_of_a_greater_lease_overrules() {
    let mut world = World::new(
        only_one(Kind::Hold),
        vec![Rover::ordered(1, GROUNDS, 5, Kind::Start)],
    );
    world.loses = |_| true;
    world.run_until(0.5);
    world.rovers[0].state.ordered.lease.number += 1;
    world.rovers[0].restart_remembering();
    let remembered = world.rovers[0].state.ordered;
    world.loses = |_| false;
    assert_eq!(
        outcomes(&world.run()),
        [VehicleOutcome::Overruled(remembered)]
    );
}

fn stop(name: u32) -> EmergencyStop {
    EmergencyStop {
        name: EmergencyName(name),
        scope: StopScope::All,
        by: tomoswarm_proto::OperatorId(1),
    }
}

fn tells(vehicle: u8, open: &[u32]) -> HeardMessage {
    told_by(Sender::Vehicle(VehicleId(vehicle)), open)
}

fn told_by(sender: Sender, open: &[u32]) -> HeardMessage {
    let standing = OpenStops {
        open: open.iter().copied().map(stop).collect(),
        lifted: vec![],
    };
    HeardMessage::Message(sender, Message::Standing(standing))
}

/// A vehicle's State, standing under a stop.
fn stands_under(vehicle: u8, sequence: u64, stop: Option<&u32>) -> HeardMessage {
    heard(Message::State(State {
        sequence,
        stands_under: stop.map(|name| StandReason::Stop(EmergencyName(*name))),
        ..Rover::new(vehicle).state
    }))
}

/// An order to two vehicles; the second one has been heard last so long ago. Both have told which stops are open.
fn under_stops(instruction: Instruction, open: &[u32], silent: Duration) -> (Ordering, Vec<Order>) {
    let mut ordering = Ordering::new(Time::ZERO, instruction);
    ordering.act(Time::ZERO, true);
    let now = at(5.0);
    ordering.hear(now - silent, &stands_under(2, 1, open.first()));
    ordering.hear(now, &stands_under(1, 1, open.first()));
    (1..=2).for_each(|vehicle| ordering.hear(now, &tells(vehicle, open)));
    let sent = ordering.act(now, true);
    (ordering, sent)
}

const STOPS: [u32; 2] = [0x1_0001, 0x1_0002];

#[test]
fn a_start_does_not_lift_a_stop_that_was_given_after_it() {
    let both = Instruction {
        vehicles: [VehicleId(1), VehicleId(2)].into(),
        ..want(Kind::Start)
    };
    // Who said something without the stop before it says it knows that it is new: by its State, or by what it tells.
    for by_state in [true, false] {
        for second_knew in [false, true] {
            let mut ordering = Ordering::new(Time::ZERO, both.clone());
            ordering.act(Time::ZERO, true);
            let earlier: &[u32] = if second_knew { &STOPS[..1] } else { &[] };
            match by_state {
                true => ordering.hear(at(0.1), &stands_under(1, 1, None)),
                false => ordering.hear(at(0.1), &tells(1, &[])),
            }
            ordering.hear(at(0.2), &stands_under(2, 1, earlier.first()));
            ordering.hear(at(0.2), &tells(2, &STOPS[..1]));
            ordering.hear(at(0.3), &tells(1, &STOPS[..1]));
            ordering.hear(at(0.3), &stands_under(1, 2, STOPS.first()));
            assert!(ordering.act(at(0.4), true).is_empty());
            let refused = ordering.outcome(at(0.4)).unwrap().refused;
            assert!(
                matches!(refused, Some(OrderRefusal::StoppedSince { name, .. }) if name.0 == STOPS[0]),
                "{refused:?}"
            );
            // Given again it lifts it, and says so.
            let again = Ordering::new(at(0.5), both.clone());
            let mut again = again.knowing(&ordering.view, true);
            let sent = again.act(at(0.5), true);
            assert_eq!(sent.len(), 2);
            assert!(
                sent.iter()
                    .all(|order| order.ends == [EmergencyName(STOPS[0])])
            );
            let lifts = again.outcome_so_far(at(0.5)).lifts;
            assert_eq!(lifts.len(), 1);
            assert_eq!(lifts[0].name, EmergencyName(STOPS[0]));
        }
    }
}

#[test]
fn whoever_joins_and_learns_of_an_older_stop_keeps_no_start_from_lifting_it() {
    let both = Instruction {
        vehicles: [VehicleId(1), VehicleId(2)].into(),
        ..want(Kind::Start)
    };
    let (old, joining) = (
        &STOPS[..1],
        Sender::Operator(tomoswarm_proto::OperatorId(9)),
    );
    let mut ordering = Ordering::new(Time::ZERO, both);
    ordering.act(Time::ZERO, true);
    ordering.hear(at(0.1), &told_by(joining, &[]));
    (1..=2).for_each(|vehicle| ordering.hear(at(0.2), &stands_under(vehicle, 1, old.first())));
    ordering.hear(at(0.2), &tells(1, old));
    ordering.hear(at(0.3), &told_by(joining, old));
    ordering.hear(at(0.3), &tells(2, old));
    (1..=2).for_each(|vehicle| ordering.hear(at(1.9), &stands_under(vehicle, 2, old.first())));
    let sent = ordering.act(at(2.0), true);
    assert_eq!(sent.len(), 2);
    assert!(
        sent.iter()
            .all(|order| order.ends == [EmergencyName(old[0])])
    );
}

#[test]
fn a_start_names_the_stops_that_are_open_when_it_is_first_sent_and_no_later_one() {
    let both = Instruction {
        vehicles: [VehicleId(1), VehicleId(2)].into(),
        ..want(Kind::Start)
    };
    let (mut ordering, sent) = under_stops(both.clone(), &STOPS, Duration::ZERO);
    assert_eq!(sent.len(), 2);
    assert!(
        sent.iter()
            .all(|order| order.ends == STOPS.map(EmergencyName)),
        "{sent:?}"
    );
    ordering.hear(at(5.1), &tells(1, &[STOPS[0], STOPS[1], 0x1_0003]));
    assert!(
        ordering
            .act(at(5.2), true)
            .iter()
            .all(|order| order.ends == STOPS.map(EmergencyName))
    );
    let mut state = Rover::new(1).state;
    (state.sequence, state.stands_under) = (9, Some(StandReason::Stop(EmergencyName(0x1_0003))));
    ordering.hear(at(5.3), &heard(Message::State(state)));
    let of_one = ordering.outcome_so_far(at(5.3)).vehicles[&VehicleId(1)];
    assert_eq!(of_one, VehicleOutcome::UnderStop(EmergencyName(0x1_0003)));
    let (_, sent) = under_stops(
        Instruction {
            kind: Kind::Hold,
            ..both
        },
        &STOPS,
        Duration::ZERO,
    );
    assert!(sent.iter().all(|order| order.ends.is_empty()));
}

#[test]
fn a_start_names_the_take_over_that_a_vehicle_shows_when_it_is_first_sent_and_no_later_one() {
    let both = Instruction {
        vehicles: [VehicleId(1), VehicleId(2)].into(),
        ..want(Kind::Start)
    };
    let stop = EmergencyName(STOPS[0]);
    let steered = |vehicle: u8, control: Control, sequence: u64| {
        let state = State {
            control,
            sequence,
            ..Rover::new(vehicle).state
        };
        heard(Message::State(state))
    };
    let name = EmergencyName::of_take_over(VehicleId(1), Rover::new(1).state.boot);
    for (kind, control, names) in [
        (Kind::Start, Control::Remote, true),
        (Kind::Start, Control::Own, true),
        (Kind::Start, Control::Silent, true),
        (Kind::Start, Control::Ours, false),
        (Kind::Hold, Control::Remote, false),
    ] {
        let mut ordering = Ordering::new(
            Time::ZERO,
            Instruction {
                kind,
                ..both.clone()
            },
        );
        ordering.act(Time::ZERO, true);
        (1..=2).for_each(|vehicle| ordering.hear(at(5.0), &tells(vehicle, &STOPS[..1])));
        ordering.hear(at(5.0), &steered(1, control, 1));
        ordering.hear(at(5.0), &steered(2, Control::Ours, 1));
        let mut both_end = BTreeSet::from([stop]);
        both_end.retain(|_| kind == Kind::Start);
        let others: Vec<EmergencyName> = both_end.iter().copied().collect();
        both_end.extend(names.then_some(name));
        let first: Vec<EmergencyName> = both_end.into_iter().collect();
        for time_s in [5.0, 5.2] {
            let sent = ordering.act(at(time_s), true);
            assert_eq!(sent.len(), 2, "{kind:?} {control:?}");
            assert_eq!(sent[0].ends, first, "{kind:?} {control:?}");
            assert_eq!(sent[1].ends, others, "{kind:?}, whoever takes over later");
            ordering.hear(at(5.1), &steered(2, Control::Remote, 2));
        }
    }
    let full = ended(&[EmergencyName(0x1_0001); 1], Some(stop));
    assert_eq!(full, [stop], "each once");
    let eight: Vec<EmergencyName> = (1..=8)
        .map(|number| EmergencyName(0x2_0000 + number))
        .collect();
    assert_eq!(
        ended(&eight, Some(stop)).len(),
        8,
        "as many as an order carries"
    );
}

#[test]
fn stops_are_not_lifted_while_somebody_is_not_heard_unless_it_is_named() {
    let two = VehicleId(2);
    let both = Instruction {
        vehicles: [VehicleId(1), two].into(),
        ..want(Kind::Start)
    };
    let silent = Duration::from_millis(2500);
    let (ordering, sent) = under_stops(both.clone(), &STOPS, silent);
    assert_eq!(
        (sent, ordering.outcome(at(5.0)).unwrap().refused),
        (vec![], Some(OrderRefusal::Unheard(two)))
    );
    let (_, sent) = under_stops(both.clone(), &[], silent);
    assert!(!sent.is_empty(), "nothing is to be lifted");
    let (_, sent) = under_stops(
        Instruction {
            although_unheard: [two].into(),
            ..both
        },
        &STOPS,
        silent,
    );
    assert!(!sent.is_empty());
}

#[test]
fn what_stands_for_many_is_lifted_only_when_that_is_asked_for() {
    let both = Instruction {
        vehicles: [VehicleId(1), VehicleId(2)].into(),
        ..want(Kind::Start)
    };
    let open = [0x42, STOPS[0]];
    let (_, sent) = under_stops(both.clone(), &open, Duration::ZERO);
    assert_eq!(sent[0].ends, [EmergencyName(STOPS[0])]);
    let (_, sent) = under_stops(
        Instruction {
            lifts_many: true,
            ..both
        },
        &open,
        Duration::ZERO,
    );
    assert_eq!(sent[0].ends, open.map(EmergencyName));
}

#[test]
fn nobody_is_called_home_while_a_stop_is_open() {
    let (ordering, sent) = under_stops(want(Kind::Return), &STOPS, Duration::ZERO);
    let refused = ordering.outcome(at(5.0)).unwrap().refused;
    assert_eq!(
        (sent, refused),
        (
            vec![],
            Some(OrderRefusal::StopOpen(EmergencyName(STOPS[0])))
        )
    );
}
