//! The operator in virtual time, against vehicles that obey what is above their echo.

use std::collections::BTreeSet;

use tomoswarm_proto::{
    Boot, GroundReport, Interest, Lease, MissionPhase, MissionProgress, OperatorId, Order,
    OrderKind as Kind, RunId, RunReport, Sender, StandReason, StationPhase, Task, VehicleId,
};

use super::super::outcome::{OrderRefusal, VehicleOutcome};
use super::super::script::{Condition, LiveVehicles, ScriptEnd, ScriptStep};
use super::super::status::Expected;
use super::super::tests_support::{Rover, at, heard, report};
use super::*;
use crate::actor::{ActorCell, Input};

mod runs;

const OWN: u64 = 7;
const TICK: Duration = Duration::from_millis(20);

fn settings(greets: bool) -> OperatorSettings {
    let asking = Hello::asking(Sender::Operator(OperatorId(1)), Boot(0), 5, 1);
    let hello = Hello {
        is_member: true,
        software: "0.1.0".to_owned(),
        ..asking
    };
    OperatorSettings {
        hello,
        greets,
        holder: OWN,
        expected: BTreeSet::new(),
    }
}

fn want(kind: Kind) -> OrderGoal {
    OrderGoal {
        begins: true,
        ..OrderGoal::new(kind, BTreeSet::new(), Duration::from_secs(5))
    }
}

fn one_present() -> LiveVehicles {
    LiveVehicles {
        vehicles: [VehicleId(1)].into(),
        lost_after: Duration::from_secs(30),
    }
}

fn only(kind: Kind, vehicle: u8) -> OrderGoal {
    OrderGoal {
        vehicles: BTreeSet::from([VehicleId(vehicle)]),
        ..want(kind)
    }
}

/// A small world: what is said arrives within a tick of 20 ms; states come every 200 ms, a report every second.
struct World {
    now: Time,
    operator: ActorCell<Operator>,
    rovers: Vec<Rover>,
    report: Option<GroundReport>,
    orders: Vec<(Time, Order)>,
    greetings: usize,
    /// When it greeted, and the lease that it named.
    hellos: Vec<(Time, Option<Lease>)>,
    tasks: Vec<(Time, Task)>,
    output: Vec<Out>,
}

impl World {
    fn new(rovers: Vec<Rover>) -> World {
        let mut operator = ActorCell::new(Operator::new(settings(true)));
        operator.push(In::Linked(true));
        let now = Time::ZERO;
        let (hellos, tasks) = (vec![], vec![]);
        World {
            now,
            operator,
            rovers,
            report: None,
            orders: vec![],
            greetings: 0,
            hellos,
            tasks,
            output: vec![],
        }
    }

    fn tell(&mut self, input: In) {
        self.operator.push(input);
    }

    fn tick(&mut self) {
        let mut published = Vec::new();
        let output = &mut self.output;
        let sort = |out| match out {
            Out::Publish(message) => published.push(message),
            out => output.push(out),
        };
        self.operator.act(self.now, sort).unwrap();
        for message in published {
            match message {
                Message::Order(order) => {
                    self.rovers.iter_mut().for_each(|rover| rover.obey(&order));
                    self.orders.push((self.now, order));
                }
                Message::Hello(hello) => {
                    self.greetings += 1;
                    self.hellos.push((self.now, hello.lease));
                }
                Message::Task(task) => self.tasks.push((self.now, task)),
                other => panic!("an operator does not say {other:?}"),
            }
        }
        self.now = self.now + TICK;
        let tick = self.now.as_nanos() / 20_000_000;
        if tick.is_multiple_of(10) {
            for rover in &mut self.rovers {
                self.operator.push(In::Bus(rover.say_stops()));
                self.operator.push(In::Bus(rover.say()));
            }
        }
        if let Some(report) = self.report.as_ref().filter(|_| tick.is_multiple_of(50)) {
            self.operator
                .push(In::Bus(heard(Message::Report(report.clone()))));
        }
    }

    fn run(&mut self, for_s: f64) {
        let end = self.now + Duration::from_secs_f64(for_s);
        while self.now < end {
            self.tick();
        }
    }

    fn kinds(&self) -> Vec<Option<Kind>> {
        self.rovers
            .iter()
            .map(|rover| rover.state.ordered.kind)
            .collect()
    }

    fn given(&self) -> Vec<EmergencyStop> {
        let given = |out: &Out| {
            if let Out::Give(stops) = out {
                stops.clone()
            } else {
                vec![]
            }
        };
        self.output.iter().flat_map(given).collect()
    }

    fn ended(&self) -> Vec<(GoalId, &OrderOutcome)> {
        let ended = |out: &Out| matches!(out, Out::Ended(..));
        let all = self.output.iter().filter(|out| ended(out));
        all.filter_map(|out| {
            if let Out::Ended(id, outcome) = out {
                Some((*id, outcome))
            } else {
                None
            }
        })
        .collect()
    }
}

/// A report of an idle ground station that knows vehicle 1 only.
fn of_one() -> GroundReport {
    GroundReport {
        members: vec![VehicleId(1)],
        ..report()
    }
}

fn follow(world: &mut World, steps: &[ScriptStep]) {
    world.tell(In::Follow(steps.to_vec()));
}

#[test]
fn a_want_by_hand_ends_when_every_state_shows_it_and_then_nothing_is_sent() {
    let mut world = World::new(vec![Rover::new(1), Rover::new(2)]);
    world.run(1.0);
    world.tell(In::Want(3, want(Kind::Hold)));
    world.run(3.0);
    let ended = world.ended();
    assert!(
        ended.len() == 1 && ended[0].0 == GoalId::Hand(3) && ended[0].1.is_done(),
        "{:?}",
        world.output
    );
    let sent = world.orders.len();
    world.rovers[0].restart();
    world.run(5.0);
    assert_eq!(
        (world.orders.len(), world.kinds()),
        (sent, vec![None, Some(Kind::Hold)])
    );
}

#[test]
fn a_want_of_a_script_stands_and_whoever_restarts_is_told_again() {
    let mut world = World::new(vec![Rover::new(1), Rover::new(2)]);
    follow(&mut world, &[ScriptStep::Want(want(Kind::Start))]);
    world.run(4.0);
    assert!(
        matches!(
            world.output[..],
            [Out::ScriptEnded(_), Out::InForce(GoalId::Script(0), _)]
        ),
        "{:?}",
        world.output
    );
    // Far later than the time in which it had to be brought about.
    world.run(20.0);
    for vehicle in [0, 1] {
        world.rovers[vehicle].restart();
        world.run(1.0);
        assert_eq!(world.kinds(), [Some(Kind::Start); 2]);
    }
    assert_eq!(world.ended(), []);
}

#[test]
fn what_somebody_else_has_ordered_since_is_neither_fought_nor_undone_by_a_restart() {
    for lease in [
        Lease {
            number: 2,
            holder: OWN,
        },
        Lease {
            number: 3,
            holder: 99,
        },
    ] {
        let mut world = World::new(vec![Rover::new(1), Rover::new(2)]);
        follow(&mut world, &[ScriptStep::Want(want(Kind::Start))]);
        world.run(4.0);
        let sent = world.orders.len();
        world.rovers[0].state.ordered = Rover::ordered(1, lease, 9, Kind::Hold).state.ordered;
        world.run(1.0);
        world.rovers[0].restart();
        world.run(5.0);
        assert_eq!(
            (world.kinds(), world.orders.len()),
            (vec![None, Some(Kind::Start)], sent),
            "{lease:?}"
        );
    }
}

#[test]
fn after_a_take_over_the_former_operator_tells_nobody_who_restarts() {
    let mut world = World::new(vec![Rover::new(1), Rover::new(2)]);
    follow(&mut world, &[ScriptStep::Want(want(Kind::Start))]);
    world.run(4.0);
    let other = Lease {
        number: 3,
        holder: 99,
    };
    world.rovers[0].state.ordered = Rover::ordered(1, other, 1, Kind::Start).state.ordered;
    world.run(1.0);
    world.rovers[1].restart();
    world.run(3.0);
    assert_eq!(world.kinds(), [Some(Kind::Start), None]);
}

#[test]
fn a_ground_that_took_its_lease_unheard_does_not_end_what_stands() {
    let mut world = World::new(vec![Rover::new(1)]);
    follow(&mut world, &[ScriptStep::Want(want(Kind::Start))]);
    world.run(4.0);
    // Its first reports were lost.
    world.report = Some(GroundReport {
        lease: Lease {
            number: 1,
            holder: OWN - 1,
        },
        ..of_one()
    });
    world.run(2.0);
    world.rovers[0].restart();
    world.run(2.0);
    assert_eq!(world.kinds(), [Some(Kind::Start)]);
}

#[test]
fn the_grounds_own_orders_after_a_start_do_not_end_it() {
    let mut world = World::new(vec![Rover::new(1)]);
    world.report = Some(of_one());
    world.run(1.5);
    follow(&mut world, &[ScriptStep::Want(want(Kind::Start))]);
    world.run(2.0);
    let lease = world.rovers[0].state.ordered.lease;
    assert_eq!(lease, of_one().lease);
    world.report = Some(GroundReport {
        phase: StationPhase::Stopping,
        run: RunId(1),
        ..of_one()
    });
    world.rovers[0].state.ordered = Rover::ordered(1, lease, 5, Kind::Hold).state.ordered;
    world.run(6.0);
    assert_eq!(world.ended(), []);
    world.rovers[0].restart();
    world.run(1.0);
    assert_eq!(world.kinds(), [Some(Kind::Start)]);
    // What an operator has ordered stands, by the report.
    world.report = Some(GroundReport {
        in_force: Some(Kind::Hold),
        ..of_one()
    });
    world.rovers[0].state.ordered = Rover::ordered(1, lease, 9, Kind::Hold).state.ordered;
    world.run(6.0);
    assert_eq!(world.ended().len(), 1, "nobody is left for whom it stands");
}

#[test]
fn a_later_want_takes_the_place_of_an_earlier_one_on_the_vehicles_that_both_name() {
    let mut world = World::new(vec![Rover::new(1), Rover::new(2)]);
    follow(&mut world, &[ScriptStep::Want(want(Kind::Start))]);
    world.run(4.0);
    world.tell(In::Want(1, only(Kind::Hold, 2)));
    world.run(1.0);
    assert_eq!(world.kinds(), [Some(Kind::Start), Some(Kind::Hold)]);
    world.rovers.iter_mut().for_each(Rover::restart);
    world.run(3.0);
    assert_eq!(world.kinds(), [Some(Kind::Start), None]);
    world.tell(In::Want(2, want(Kind::Return)));
    world.run(1.0);
    assert!(
        world.ended().iter().any(|(id, _)| *id == GoalId::Script(0)),
        "nothing is left of it"
    );
}

#[test]
fn a_start_of_another_run_is_refused_by_hand_and_awaited_by_a_script() {
    let under_way = GroundReport {
        phase: StationPhase::Running,
        run: RunId(1),
        ..of_one()
    };
    let of_seven = OrderGoal {
        run: Some(RunId(7)),
        ..want(Kind::Start)
    };
    let mut world = World::new(vec![Rover::new(1)]);
    world.report = Some(under_way.clone());
    world.tell(In::Want(0, of_seven.clone()));
    world.run(3.0);
    let refused = OrderRefusal::UnderWay {
        under_way: RunId(1),
        asked: RunId(7),
    };
    assert_eq!(world.ended()[0].1.refused, Some(refused));
    assert_eq!(
        (world.orders.len(), world.ended()[0].1.is_done()),
        (0, false)
    );
    // The run that is under way may be told again, and what stops is never refused.
    world.tell(In::Want(
        1,
        OrderGoal {
            run: Some(RunId(1)),
            ..want(Kind::Start)
        },
    ));
    world.run(1.0);
    world.tell(In::Want(
        2,
        OrderGoal {
            run: Some(RunId(7)),
            ..want(Kind::Hold)
        },
    ));
    world.run(1.0);
    assert!(
        world.ended()[1..]
            .iter()
            .all(|(_, outcome)| outcome.is_done()),
        "{:?}",
        world.output
    );
    let sent = world.orders.len();
    follow(&mut world, &[ScriptStep::Want(of_seven)]);
    world.run(2.0);
    assert_eq!(world.orders.len(), sent);
    world.report = Some(GroundReport {
        phase: StationPhase::Idle,
        ..under_way
    });
    world.run(2.0);
    assert_eq!(world.rovers[0].state.ordered.run, RunId(7));
}

fn stop_wish(vehicles: &[u8]) -> StopRequest {
    let vehicles = vehicles.iter().map(|id| VehicleId(*id)).collect();
    StopRequest {
        vehicles,
        within: Duration::from_secs(3),
    }
}

#[test]
fn an_emergency_stop_is_given_under_a_new_name_and_ends_when_every_vehicle_shows_it_at_rest() {
    let mut world = World::new(vec![Rover::new(1), Rover::new(2)]);
    world.run(2.0);
    world.tell(In::Stop(0, stop_wish(&[])));
    world.tell(In::Stop(1, stop_wish(&[2])));
    world.run(0.1);
    let given: Vec<EmergencyStop> = world.given();
    let scopes: Vec<StopScope> = given.iter().map(|stop| stop.scope).collect();
    assert_eq!(scopes, [StopScope::All, StopScope::One(VehicleId(2))]);
    assert!(given[0].name != given[1].name && given.iter().all(|stop| !stop.name.is_many()));
    world.rovers[0].state.stands_under = Some(StandReason::Stop(given[0].name));
    world.run(1.0);
    assert_eq!(world.ended(), [], "vehicle 2 does not show it");
    world.rovers[1].state.stands_under = Some(StandReason::Stop(given[1].name));
    world.rovers[1].state.is_at_rest = false;
    world.run(0.5);
    assert_eq!(world.ended(), [], "vehicle 2 moves still");
    world.rovers[1].state.is_at_rest = true;
    world.run(0.5);
    assert_eq!(world.ended().len(), 2);
    assert!(world.ended().iter().all(|(_, outcome)| outcome.is_done()));
}

#[test]
fn who_does_not_show_a_stop_in_time_is_named() {
    let mut world = World::new(vec![Rover::new(1)]);
    world.tell(In::Stop(0, stop_wish(&[1, 3])));
    world.run(3.5);
    let expected = [
        (VehicleId(1), VehicleOutcome::Ignored),
        (VehicleId(3), VehicleOutcome::Unheard),
    ];
    assert_eq!(world.ended()[0].1.vehicles, expected.into());
}

#[test]
fn with_take_over_the_lease_in_force_is_outbid_once_and_without_it_it_is_joined() {
    let theirs = Lease {
        number: 4,
        holder: 44,
    };
    for (take_over, lease) in [
        (false, theirs),
        (
            true,
            Lease {
                number: 5,
                holder: OWN,
            },
        ),
    ] {
        let mut world = World::new(vec![Rover::ordered(1, theirs, 3, Kind::Start)]);
        for number in 0..3 {
            world.tell(In::Want(
                number,
                OrderGoal {
                    take_over,
                    ..want(Kind::Hold)
                },
            ));
            world.run(2.0);
            assert_eq!(world.rovers[0].state.ordered.lease, lease);
        }
    }
}

#[test]
fn it_greets_while_anyone_can_be_reached_and_who_only_looks_says_nothing() {
    let mut world = World::new(vec![]);
    world.run(5.0);
    world.tell(In::Linked(false));
    world.run(5.0);
    assert_eq!(world.greetings, 3);
    let mut viewer = ActorCell::new(Operator::new(settings(false)));
    viewer.push(In::Linked(true));
    viewer.push(In::Bus(Rover::new(1).say()));
    let mut output = Vec::new();
    viewer.act(at(1.0), |out| output.push(out)).unwrap();
    assert_eq!((output, viewer.deadline()), (vec![], None));
    assert!(viewer.actor().view().state(VehicleId(1)).is_some());
}

#[test]
fn who_wants_looks_says_so_at_once_and_as_long_as_it_wants_them() {
    let mut operator = ActorCell::new(Operator::new(settings(true)));
    let mut asks = |now: Time, input: Option<In>| -> Vec<bool> {
        input.into_iter().for_each(|input| operator.push(input));
        let mut said = Vec::new();
        let asks = |out| match out {
            Out::Publish(Message::Hello(hello)) => said.push(hello.interest == [Interest::Looks]),
            other => panic!("{other:?}"),
        };
        operator.act(now, asks).unwrap();
        said
    };
    assert_eq!(
        asks(at(0.0), Some(In::Ask(Interest::Looks, true))),
        [false; 0],
        "nobody is reached"
    );
    assert_eq!(asks(at(0.5), Some(In::Linked(true))), [true]);
    assert_eq!(
        asks(at(0.6), Some(In::Ask(Interest::Looks, false))),
        [false; 0]
    );
    assert_eq!(
        asks(at(0.7), Some(In::Ask(Interest::Looks, false))),
        [false; 0],
        "nothing new"
    );
    assert_eq!(asks(at(0.8), Some(In::Ask(Interest::Looks, true))), [true]);
    assert_eq!(asks(at(2.7), None), [false; 0]);
    assert_eq!(asks(at(2.8), None), [true]);
    assert_eq!(asks(at(2.9), Some(In::Ask(Interest::Fleet, true))), [false]);
    let interest = &operator.actor().settings.hello.interest;
    assert_eq!(*interest, [Interest::Fleet, Interest::Looks], "ascending");
}

#[test]
fn a_want_that_is_withdrawn_is_over_at_once() {
    let mut world = World::new(vec![]);
    world.tell(In::Want(0, only(Kind::Hold, 1)));
    world.run(1.0);
    world.tell(In::Withdraw(0));
    world.run(0.1);
    assert_eq!(
        world.ended()[0].1.vehicles,
        [(VehicleId(1), VehicleOutcome::Unheard)].into()
    );
}

#[test]
fn a_script_goes_on_as_the_fleet_shows_it_and_as_its_cues_are_done() {
    let within = Duration::from_secs(10);
    let expected = Expected {
        vehicles: [VehicleId(1)].into(),
        ground: true,
    };
    let run_one = OrderGoal {
        run: Some(RunId(1)),
        ..want(Kind::Start)
    };
    let steps = [
        ScriptStep::Wait {
            until: Condition::Heard(expected),
            within,
        },
        ScriptStep::Delay(Duration::from_secs(2)),
        ScriptStep::Want(run_one),
        ScriptStep::Wait {
            until: Condition::InForce,
            within,
        },
        ScriptStep::Wait {
            until: Condition::Driven(RunId(1)),
            within,
        },
        ScriptStep::Announce {
            name: "enter".to_owned(),
            within,
        },
        ScriptStep::Want(want(Kind::Return)),
        ScriptStep::Wait {
            until: Condition::Home(one_present()),
            within,
        },
    ];
    let mut world = World::new(vec![Rover::new(1)]);
    follow(&mut world, &steps);
    world.run(1.0);
    world.report = Some(of_one());
    world.run(1.9);
    assert_eq!(world.orders, [], "it lets two seconds pass");
    world.run(3.0);
    assert_eq!(world.kinds(), [Some(Kind::Start)]);
    let runs = vec![RunReport {
        run: RunId(1),
        ..RunReport::default()
    }];
    world.report = Some(GroundReport {
        run: RunId(1),
        laps: 3,
        laps_done: 3,
        runs,
        ..of_one()
    });
    world.run(2.0);
    assert_eq!(
        world.output.last(),
        Some(&Out::Announce("enter".to_owned()))
    );
    world.run(1.0);
    assert_eq!(
        world.kinds(),
        [Some(Kind::Start)],
        "the cue is not done yet"
    );
    world.tell(In::CueDone);
    world.run(2.0);
    assert_eq!(world.kinds(), [Some(Kind::Return)]);
    assert!(
        !world
            .output
            .iter()
            .any(|out| matches!(out, Out::ScriptEnded(_))),
        "it is not home yet"
    );
    let (vehicle, phase, is_at_home) = (VehicleId(1), MissionPhase::Over, true);
    let home = MissionProgress {
        vehicle,
        boot: Boot(1),
        phase,
        is_at_home,
        ..MissionProgress::default()
    };
    world.tell(In::Bus(heard(Message::Mission(home))));
    world.run(0.1);
    assert!(
        world.output.contains(&Out::ScriptEnded(ScriptEnd::Done)),
        "{:?}",
        world.output
    );
}

#[test]
fn a_script_that_waits_for_what_never_comes_ends_with_a_reason_after_its_limit() {
    let within = Duration::from_secs(4);
    let never = |step: ScriptStep, why: &str| {
        let mut world = World::new(vec![Rover::new(1)]);
        follow(
            &mut world,
            &[
                ScriptStep::Delay(Duration::from_secs(1)),
                step,
                ScriptStep::Want(want(Kind::Hold)),
            ],
        );
        world.run(4.9);
        assert_eq!(
            world
                .output
                .iter()
                .filter(|out| matches!(out, Out::ScriptEnded(_)))
                .count(),
            0,
            "{why}"
        );
        world.run(0.2);
        let end = ScriptEnd::GaveUp {
            step: 1,
            why: why.to_owned(),
        };
        assert_eq!(world.output.last(), Some(&Out::ScriptEnded(end)));
        world.run(10.0);
        assert_eq!(world.orders, [], "what comes after it is not wanted");
    };
    let expected = Expected {
        vehicles: [VehicleId(1), VehicleId(2)].into(),
        ground: true,
    };
    let wait = |until| ScriptStep::Wait { until, within };
    let silent = "not heard: vehicle 2, the ground station, within 4.0 s";
    never(wait(Condition::Heard(expected)), silent);
    never(
        wait(Condition::Driven(RunId(1))),
        "not shown: run 1 is driven to its end, within 4.0 s",
    );
    never(
        wait(Condition::InForce),
        "not shown: every vehicle shows the order, within 4.0 s",
    );
    never(
        wait(Condition::Home(one_present())),
        "vehicle 1 was not home 4 s after waiting began",
    );
    never(
        ScriptStep::Announce {
            name: "enter".to_owned(),
            within,
        },
        "\"enter\" was not done within 4.0 s",
    );
}

#[test]
fn a_script_whose_want_fails_ends_with_the_reason() {
    let mut world = World::new(vec![Rover::new(1)]);
    let until = Condition::InForce;
    let steps = [
        ScriptStep::Want(only(Kind::Hold, 2)),
        ScriptStep::Wait {
            until,
            within: Duration::from_secs(60),
        },
    ];
    follow(&mut world, &steps);
    world.run(5.1);
    let end = ScriptEnd::GaveUp {
        step: 1,
        why: "vehicle 2 is not heard".to_owned(),
    };
    assert_eq!(world.output.last(), Some(&Out::ScriptEnded(end)));
}

#[test]
fn of_two_unread_states_the_later_one_stays_whichever_came_last() {
    let mut rover = Rover::new(1);
    let (first, second) = (In::Bus(rover.say()), In::Bus(rover.say()));
    assert_eq!(In::join(first.clone(), second.clone()), second);
    assert_eq!(In::join(second.clone(), first), second);
    rover.restart();
    let anew = In::Bus(rover.say());
    assert_eq!(In::join(second, anew.clone()), anew);
}
