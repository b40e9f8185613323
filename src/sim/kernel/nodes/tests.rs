//! What the nodes of a run are by themselves, without environment and network.

use tomoswarm_proto::{OperatorId, PoseReport, Sample, VehicleId};

use super::*;
use crate::node;
use crate::sim::kernel::tests::scenario;
use crate::sim::operator_script::RUN;

/// Two vehicles, a ground station and the scenario's operator.
fn nodes() -> Nodes {
    let parts = scenario("").parts().unwrap();
    let ground = SimulatedGround::new(parts.ground, true);
    Nodes::new(parts.vehicles, ground, parts.operators)
}

#[test]
fn a_node_is_found_by_its_name_and_named_by_its_place() {
    let nodes = nodes();
    let places: Vec<NodePlace> = nodes.places().collect();
    let expected = [
        NodePlace::Vehicle(0),
        NodePlace::Vehicle(1),
        NodePlace::Ground,
        NodePlace::Operator(0),
    ];
    assert_eq!(places, expected);
    for place in places {
        assert_eq!(nodes.place_of(nodes.id_of(place)), Some(place));
    }
    assert_eq!(nodes.place_of(NodeId::Vehicle(VehicleId(9))), None);
    assert_eq!(nodes.place_of(NodeId::Operator(OperatorId(9))), None);
    assert_eq!(name_of(NodeId::Vehicle(VehicleId(2))), "vehicle 2");
}

#[test]
fn who_is_dead_is_not_woken_and_counts_for_nothing() {
    let (mut nodes, one) = (nodes(), NodePlace::Vehicle(0));
    let (_, generation) = nodes.set_alarm(one, Time::ZERO).unwrap();
    assert_eq!(nodes.count_fleet(|_| true, |_| false).alive, 2);
    nodes.end(one);
    assert!(!nodes.rings(one, generation));
    assert_eq!(nodes.are_dead().collect::<Vec<_>>(), [true, false]);
    assert_eq!(nodes.count_fleet(|_| true, |_| false).alive, 1);
}

#[test]
fn a_vehicle_that_is_started_anew_goes_on_with_its_disk_and_nothing_else() {
    let (mut nodes, one) = (nodes(), NodePlace::Vehicle(0));
    let sample = Sample {
        sequence: 5,
        heard_at_ns: 1,
        transmitter: VehicleId(2),
        transmitter_pose: PoseReport::default(),
        receiver_pose: PoseReport::default(),
        channel: 11,
        power_dbm: 0,
        rssi_dbm: Some(-60),
    };
    let vehicle = nodes.vehicle_mut(0);
    let kept = vehicle.store(node::Effect::Keep(RUN, sample));
    let is_it =
        |kept| matches!(kept, Some(node::Event::SampleStored(Boot(1), RUN, it)) if it == sample);
    assert!(is_it(kept));
    assert!(
        vehicle
            .store(node::Effect::Steer(Default::default()))
            .is_none()
    );
    nodes.end(one);
    assert_eq!(nodes.restart(one, Noise::new(1)), Some(Boot(2)));
    assert!(!nodes.vehicles()[0].is_dead());
    assert_eq!(nodes.vehicles()[0].node().boot(), Boot(2));
    let recalled = nodes
        .vehicle_mut(0)
        .store(node::Effect::Recall { after: None });
    let Some(node::Event::Recalled(recalled)) = recalled else {
        panic!("{recalled:?}")
    };
    assert_eq!(recalled.samples, [(Boot(1), RUN, sample)]);
}

#[test]
fn a_ground_station_counts_its_starts_and_operators_are_not_started_anew() {
    let mut nodes = nodes();
    for boot in [2, 3] {
        let started = nodes.restart(NodePlace::Ground, Noise::new(1));
        assert_eq!(started, Some(Boot(boot)));
    }
    assert_eq!(nodes.restart(NodePlace::Operator(0), Noise::new(1)), None);
}

#[test]
fn snapshots_are_of_all_or_of_those_that_were_started_anew() {
    let mut nodes = nodes();
    let of = |nodes: &mut Nodes, of_all| {
        let mut whom = Vec::new();
        nodes.snapshots(of_all, |node, _| whom.push(node)).unwrap();
        whom
    };
    assert_eq!(of(&mut nodes, true).len(), 4);
    assert_eq!(of(&mut nodes, false), []);
    nodes.restart(NodePlace::Vehicle(1), Noise::new(1));
    nodes.restart(NodePlace::Ground, Noise::new(1));
    let anew = [NodeId::Vehicle(VehicleId(2)), NodeId::Ground];
    assert_eq!(of(&mut nodes, false), anew);
    assert_eq!(of(&mut nodes, false), [], "once");
}

#[test]
fn an_operator_is_told_its_script_once() {
    let mut nodes = nodes();
    let told = |nodes: &mut Nodes| nodes.operator_mut(0).begin().count();
    assert_eq!((told(&mut nodes), told(&mut nodes)), (2, 1));
}
