//! What the kernel makes of what happens in the environment, in one small place: vehicle 1 faces a wall 1.5 m ahead,
//! vehicle 2 has free space ahead. Nobody sees anything, and nobody is ordered to move: the tests drive.

mod forging;
mod joining;
mod single_vehicle;

use std::collections::BTreeSet;
use std::time::Duration;

use tomoswarm_proto::{
    Control, Health, Lease, OperatorId, Order, OrderKind, Revision, RunId, Sender, StandReason,
    VehicleId, VehicleMode as StateMode,
};

use super::*;
use crate::autopilot::{Command, FlightMode, NumberedCommand};
use crate::config;
use crate::geom::Point;
use crate::operator::fleet_view::FleetView;
use crate::operator::operator_actor::OperatorSettings;
use crate::operator::order_goal::OrderGoal;
use crate::operator::script as operator_script;
use crate::operator::script::Condition;
use crate::sim::operator_script::SCENARIO_OPERATOR;
use crate::sim::{RunOutcome, Scenario};

const SIM: &str = "kind = \"sim\"\nvenue = \"venue.toml\"\nscene = \"scene.toml\"\nuntil_s = 12.0
[vehicles]\nmax_speed_mps = 1.0\nacceleration_mps2 = 5.0\nbraking_mps2 = 5.0
[range]\nbeams_deg = [0.0]\nincidence_limit_deg = 75.0\n[sweep]\npositions = 40
[[fault]]\nkind = \"sensor\"\nat_s = 0.0\n";
const VENUE: &str =
    "kind = \"venue\"\narea_m = [0.0, 0.0, 10.0, 10.0]\nhomes_m = [[-1.5, 5.0], [5.0, -2.0]]
fence_m = [[-4.0, -4.0], [14.0, -4.0], [14.0, 14.0], [-4.0, 14.0]]
[datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\n";
const SCENE: &str = "kind = \"scene\"
[[object]]\nname = \"wall\"\noutline_m = [[0.0, 4.5], [1.0, 4.5], [1.0, 5.5], [0.0, 5.5]]\n";

pub(super) fn scenario(more: &str) -> Scenario {
    let mut loader = |name: &str| match name {
        "venue.toml" => Ok(VENUE.to_owned()),
        "scene.toml" => Ok(SCENE.to_owned()),
        other => Err(format!("no file {other}")),
    };
    let text = format!("{SIM}{more}");
    let sim = config::read_sim("test.toml", &text, None, &mut loader)
        .unwrap_or_else(|wrong| panic!("{wrong}"));
    Scenario::new(sim, Vec::new(), 1).unwrap()
}

fn drive(kernel: &mut Kernel, vehicle: usize, to: Point) {
    let command = Command::Route {
        corners: vec![to],
        altitude_m: None,
        speed_mps: Some(1.0),
    };
    let command = DeviceCommand::Autopilot(NumberedCommand { number: 0, command });
    let (environment, schedule) = (&mut kernel.environment, &mut kernel.schedule);
    environment.obey(vehicle, command, schedule);
}

/// Runs until a second, or to the end.
fn run(kernel: &mut Kernel, until_s: f64) {
    let mut watch = |shown: &RunView<'_>| shown.status.now.as_secs_f64() < until_s;
    kernel.run(&mut watch, None).unwrap();
}

#[test]
fn a_contact_ends_the_run_unless_the_scenario_says_otherwise() {
    for ends_at_contact in [true, false] {
        let mut scenario = scenario("");
        scenario.ends_at_contact = ends_at_contact;
        let mut kernel = Kernel::new(scenario.parts().unwrap());
        drive(&mut kernel, 0, Point::new(3.0, 5.0));
        run(&mut kernel, 3.5);
        assert_eq!(kernel.schedule.ended_at().is_some(), ends_at_contact);
        assert!(
            kernel
                .record
                .failure()
                .is_some_and(|why| why.contains("touched the scene"))
        );
        let wreck = kernel.environment.truth(0, kernel.schedule.now());
        assert!(
            (wreck.at.x_m + 0.25).abs() < 0.01 && wreck.speed_mps == 0.0,
            "{wreck:?}"
        );
        assert_eq!(
            kernel.environment.environment().world().collisions().len(),
            1
        );
    }
}

#[test]
fn a_rover_whose_software_has_died_stops_two_seconds_later() {
    let scenario = scenario("[[fault]]\nkind = \"dead\"\nat_s = 1.0\nvehicles = [2]\n");
    let mut kernel = Kernel::new(scenario.parts().unwrap());
    drive(&mut kernel, 1, Point::new(5.0, 9.0));
    let speed_mps = |kernel: &Kernel| kernel.environment.truth(1, kernel.schedule.now()).speed_mps;
    run(&mut kernel, 2.0);
    assert_eq!(speed_mps(&kernel), 1.0, "nobody has told it to stop");
    run(&mut kernel, 4.0);
    assert_eq!(speed_mps(&kernel), 0.0);
    let y_m = kernel.environment.truth(1, kernel.schedule.now()).at.y_m;
    // Its last word was a beacon of the second before.
    assert!((-0.6..=1.0).contains(&y_m), "{y_m}");
}

#[test]
fn a_person_who_takes_over_by_remote_control_is_left_alone_until_a_start() {
    let scenario = scenario("");
    let starts = vec![
        operator_script::ScriptStep::Delay(Duration::from_secs(7)),
        want(OrderKind::Start, true),
    ];
    let mut parts = scenario.parts().unwrap();
    parts.operators.push(operator(&scenario, 3, starts));
    let mut kernel = Kernel::new(parts);
    run(&mut kernel, 3.0);
    let shown = |kernel: &mut Kernel| {
        let state = view(&kernel.nodes.operators()[1])
            .state(VehicleId(2))
            .unwrap()
            .value
            .clone();
        let now = kernel.schedule.now();
        let known = kernel.environment.environment().known(1, now);
        (state.control, state.stands_under, known.mode)
    };
    assert_eq!(
        shown(&mut kernel),
        (Control::Ours, None, FlightMode::Guided)
    );
    let (now, manual) = (kernel.schedule.now(), Command::Mode(FlightMode::Manual));
    kernel
        .environment
        .environment()
        .command_by_remote_control(now, 1, &manual, &mut Vec::new());
    run(&mut kernel, 6.5);
    assert_eq!(
        shown(&mut kernel),
        (
            Control::Remote,
            Some(StandReason::Remote),
            FlightMode::Manual
        )
    );
    assert!(
        kernel.record.log_text().contains(
            "vehicle 2 autopilot: a person has taken over by remote control, mode manual"
        )
    );
    run(&mut kernel, 9.0);
    assert_eq!(
        shown(&mut kernel),
        (Control::Ours, None, FlightMode::Guided)
    );
}

/// An operator of this number, and what it does; without steps it only looks.
fn operator(
    scenario: &Scenario,
    number: u8,
    steps: Vec<operator_script::ScriptStep>,
) -> SimulatedOperator {
    let (id, greets) = (OperatorId(number), !steps.is_empty());
    let settings = crate::sim::operator_script::settings(scenario.sim(), id, u64::from(number) + 7);
    SimulatedOperator::new(id, OperatorSettings { greets, ..settings }, steps)
}

fn want(kind: OrderKind, take_over: bool) -> operator_script::ScriptStep {
    let (vehicles, within) = (BTreeSet::new(), Duration::from_secs(60));
    operator_script::ScriptStep::Want(OrderGoal {
        take_over,
        ..OrderGoal::new(kind, vehicles, within)
    })
}

#[test]
fn who_only_looks_changes_no_byte_of_the_run() {
    let scenario = scenario("");
    let log = |viewers: u8| {
        let mut parts = scenario.parts().unwrap();
        parts
            .operators
            .extend((1..=viewers).map(|number| operator(&scenario, number, Vec::new())));
        let mut kernel = Kernel::new(parts);
        run(&mut kernel, 3.5);
        let seen: Vec<usize> = kernel.nodes.operators()[1..]
            .iter()
            .map(vehicles_seen)
            .collect();
        let finished = kernel.finish();
        let is_operator = |node: &&NodeId| matches!(node, NodeId::Operator(_));
        let output: Vec<NodeId> = finished
            .bus
            .sent_by_kind()
            .keys()
            .filter(is_operator)
            .copied()
            .collect();
        (
            seen,
            (
                finished.record.log.into_text(),
                finished.record.counts,
                finished.ended_at,
                output,
            ),
        )
    };
    let (alone, watched) = (log(0), log(2));
    assert_eq!(watched.0, [2, 2], "they have heard every vehicle");
    assert_eq!(
        watched.1.3,
        [NodeId::Operator(SCENARIO_OPERATOR)],
        "only who plays says anything"
    );
    assert!(alone.1 == watched.1);
}

#[test]
fn simulated_vehicles_say_how_they_fare_as_live_ones_do() {
    let scenario = scenario("");
    let mut parts = scenario.parts().unwrap();
    parts.operators.push(operator(&scenario, 1, Vec::new()));
    let mut kernel = Kernel::new(parts);
    let healths = |kernel: &Kernel| -> Vec<(Time, Health)> {
        let vehicles = view(&kernel.nodes.operators()[1]).vehicles();
        let healths = vehicles.filter_map(|(_, seen)| seen.health.clone());
        healths.map(|health| (health.at, health.value)).collect()
    };
    run(&mut kernel, 6.5);
    let before = healths(&kernel);
    assert_eq!(before.len(), 2, "every vehicle says it");
    for (_, health) in &before {
        assert!(health.autopilot.is_some() && health.radio.is_some() && health.range.is_some());
        assert_eq!(health.troubles, ["range sensor: it answers nothing"]);
    }
    run(&mut kernel, 12.0);
    let after = healths(&kernel);
    assert!(after.iter().all(|(at, _)| *at > Time::from_secs_f64(9.0)));
    let hears = after.iter().filter(|(_, health)| health.hears.len() == 1);
    assert_eq!(hears.count(), 2, "{after:?}");
    assert!(
        after
            .iter()
            .all(|(_, health)| health.radio.unwrap().sent > 0)
    );
}

fn vehicles_seen(operator: &SimulatedOperator) -> usize {
    view(operator).vehicles().count()
}

fn view(operator: &SimulatedOperator) -> &FleetView {
    operator.node().actors().operator.place.actor().view()
}

fn wait(until: Condition) -> operator_script::ScriptStep {
    operator_script::ScriptStep::Wait {
        until,
        within: Duration::from_secs(60),
    }
}

#[test]
fn an_operator_on_the_simulated_bus_takes_over_and_is_obeyed() {
    let scenario = scenario("");
    let heard = Condition::Heard(crate::operator::status::Expected {
        vehicles: BTreeSet::new(),
        ground: true,
    });
    let steps = vec![
        wait(heard),
        want(OrderKind::Hold, true),
        wait(Condition::InForce),
    ];
    let mut parts = scenario.parts().unwrap();
    parts.operators.push(operator(&scenario, 3, steps));
    let mut kernel = Kernel::new(parts);
    run(&mut kernel, 3.5);
    let operator = &kernel.nodes.operators()[1];
    assert_eq!(
        operator.script_end(),
        Some(&operator_script::ScriptEnd::Done),
        "State shows the order"
    );
    let lease = view(operator).lease(kernel.schedule.now());
    assert_eq!((lease.number, lease.holder), (2, 10));
    let report = view(operator)
        .ground(kernel.schedule.now())
        .expect("the ground station is heard");
    assert_eq!(
        report.value.lease, lease,
        "the ground station plans under it"
    );
}

/// A whole mission with two small rovers, and what else operators do in it.
fn small(others: impl Fn(&Scenario) -> Vec<SimulatedOperator>) -> RunOutcome {
    let mut read = |name: &str| {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
        std::fs::read_to_string(path).map_err(|error| error.to_string())
    };
    let name = "configs/small.sim.toml";
    let text = read(name).unwrap();
    let sim = config::read_sim(name, &text, None, &mut read);
    let scenario = Scenario::new(sim.unwrap(), Vec::new(), 1).unwrap();
    let mut parts = scenario.parts().unwrap();
    parts.operators.extend(others(&scenario));
    let mut kernel = Kernel::new(parts);
    kernel.run(&mut |_| true, None).unwrap();
    scenario.outcome(kernel).unwrap()
}

#[test]
fn another_operator_takes_over_in_the_middle_of_a_sweep_and_the_mission_ends_as_it_would_have() {
    let whole = small(|_| Vec::new());
    let held_for = Duration::from_secs(10);
    let steps = vec![
        operator_script::ScriptStep::Delay(Duration::from_secs(20)),
        want(OrderKind::Hold, true),
        wait(Condition::InForce),
        operator_script::ScriptStep::Delay(held_for),
        want(OrderKind::Start, false),
        wait(Condition::InForce),
    ];
    let disturbed = small(|scenario| vec![operator(scenario, 3, steps.clone())]);
    for outcome in [&whole, &disturbed] {
        assert!(outcome.finished, "{:?}", outcome.failure);
        assert!(
            outcome
                .log
                .contains("operator 0 its script has ended: done")
        );
    }
    assert!(
        disturbed
            .log
            .contains("operator 3 its script has ended: done")
    );
    let longer_s = disturbed.simulated.as_secs_f64() - whole.simulated.as_secs_f64();
    // After the hold the rest is driven in another order of crossings, which may save some seconds.
    assert!(
        (6.0..20.0).contains(&longer_s),
        "{longer_s} s longer: everyone stood for {held_for:?}"
    );
    for outcome in [&whole, &disturbed] {
        let surest = outcome.found()[0];
        assert!(
            surest.error_m.is_some_and(|error_m| error_m < 0.5),
            "{surest:?}"
        );
    }
}

#[test]
fn what_another_operator_has_stopped_neither_ground_nor_the_first_operator_starts() {
    let steps = vec![
        operator_script::ScriptStep::Delay(Duration::from_secs(20)),
        want(OrderKind::Hold, true),
    ];
    let stopped = small(|scenario| vec![operator(scenario, 3, steps.clone())]);
    assert_eq!(
        stopped.failure.as_deref(),
        Some("the sweep did not end in time: the run was given up after 600 s (until_s)")
    );
    assert_eq!(stopped.held, 2, "they stand");
    assert!(stopped.simulated >= Time::from_secs_f64(590.0));
}

#[test]
fn a_vehicle_that_is_started_anew_obeys_nothing_below_what_its_disk_has() {
    let scenario =
        scenario("[[fault]]\nkind = \"restart\"\nat_s = 5.0\nuntil_s = 6.0\nvehicles = [2]\n");
    let steps = vec![
        operator_script::ScriptStep::Delay(Duration::from_secs(3)),
        want(OrderKind::Hold, true),
    ];
    let mut parts = scenario.parts().unwrap();
    parts.operators.push(operator(&scenario, 3, steps));
    let mut kernel = Kernel::new(parts);
    run(&mut kernel, 5.5);
    let kept = kernel.nodes.vehicles()[1].memory();
    assert_eq!(kept.ordered.lease.number, 2, "the operator has taken over");
    run(&mut kernel, 6.3);
    assert_eq!(kernel.nodes.vehicles()[1].node().boot(), Boot(2));
    let low = Order {
        vehicle: VehicleId(2),
        lease: Lease {
            number: 1,
            holder: 0,
        },
        run: RunId(1),
        revision: Revision(1000),
        seen: None,
        kind: OrderKind::CutMotors,
        ends: Vec::new(),
    };
    let from = Sender::Operator(OperatorId(3));
    kernel
        .tell(1, node::Event::Bus(from, Message::Order(low.clone())))
        .unwrap();
    run(&mut kernel, 7.5);
    let mode = |kernel: &Kernel| {
        let state = &view(&kernel.nodes.operators()[1])
            .state(VehicleId(2))
            .expect("it is heard")
            .value;
        (
            state.boot,
            state.mode == StateMode::MotorsCut,
            state.ordered.lease >= kept.ordered.lease,
        )
    };
    assert_eq!(mode(&kernel), (Boot(2), false, true));
    let high = Order {
        lease: Lease {
            number: 9,
            holder: 0,
        },
        ..low
    };
    kernel
        .tell(1, node::Event::Bus(from, Message::Order(high)))
        .unwrap();
    run(&mut kernel, 8.5);
    assert_eq!(
        mode(&kernel),
        (Boot(2), true, true),
        "a higher one is obeyed"
    );
}
