//! Processes that die, stop and come back in the middle of a sweep.

use std::time::Duration;

use tomoswarm_proto::VehicleId;

use crate::swarm::{GROUND, Size, Swarm, vehicle};

fn two() -> Swarm {
    Swarm::start(Size { vehicles: 2, laps: 1, relayed: false })
}

#[test]
fn a_sweep_of_separate_processes_ends_and_loses_nothing() {
    let mut swarm = two();
    swarm.begin();
    swarm.finish();
}

#[test]
fn a_vehicle_that_dies_comes_back_and_its_earlier_samples_arrive() {
    let mut swarm = Swarm::start(Size { vehicles: 3, laps: 2, relayed: false });
    swarm.begin();
    swarm.until_samples(200);
    swarm.kill("vehicle-3");
    swarm.until("it is given up", 30, |watch| watch.report().lost == [VehicleId(3)]);
    swarm.restart(vehicle(3));
    swarm.until("it is back", 30, |watch| watch.report().lost.is_empty());
    swarm.until_end();
    let boots = swarm.look(|watch| (watch.samples_of(3, 1), watch.samples_of(3, 2)));
    assert!(boots.0 > 0, "{boots:?}");
    swarm.finish();
}

#[test]
fn a_ground_that_dies_goes_on_with_its_run() {
    let mut swarm = two();
    swarm.begin();
    swarm.until_samples(150);
    let before = swarm.look(|watch| watch.report());
    swarm.kill("ground");
    std::thread::sleep(Duration::from_secs(3));
    swarm.restart(GROUND);
    swarm.until("it is back", 20, |watch| watch.report().boot > before.boot);
    let after = swarm.look(|watch| watch.report());
    assert_eq!((after.run, after.store), (before.run, before.store));
    assert!(after.samples >= before.samples);
    swarm.finish();
}

#[test]
fn a_vehicle_that_stands_still_for_20_s_does_no_harm() {
    let mut swarm = two();
    swarm.begin();
    swarm.until_samples(100);
    swarm.stop(vehicle(2));
    std::thread::sleep(Duration::from_secs(20));
    swarm.go_on(vehicle(2));
    swarm.finish();
}
