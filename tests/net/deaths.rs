//! Processes that die, stop and come back in the middle of a sweep.

use std::time::Duration;

use tomoswarm::store::memory::MemoryFile;
use tomoswarm_proto::{
    Boot, Lease, Message, Order, OrderKind, Ordered, Revision, RunId, VehicleId, codec,
};

use crate::raw::{Shows, Stranger};
use crate::swarm::{GROUND, Size, Swarm, Watch, start, vehicle};

fn two() -> Swarm {
    Swarm::start(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    })
}

/// Returns which start of vehicle 3 was heard last, and what it shows that it was ordered.
fn ordered(watch: &Watch) -> (Boot, Ordered) {
    let state = &watch.view.state(VehicleId(3)).unwrap().value;
    (state.boot, state.ordered)
}

/// Returns an order below a lease, which only a vehicle obeys that has forgotten that one.
fn lowest_cut(id: u8, lease: Lease) -> Message {
    let lease = Lease::lowest(lease.number);
    let (vehicle, revision, kind) = (VehicleId(id), Revision(1_000_000), OrderKind::CutMotors);
    Message::Order(Order {
        vehicle,
        lease,
        run: RunId(1),
        revision,
        seen: None,
        kind,
        ends: vec![],
    })
}

#[test]
fn a_sweep_of_separate_processes_ends_and_loses_nothing() {
    let mut swarm = two();
    swarm.begin();
    swarm.finish();
}

#[test]
fn a_vehicle_that_dies_comes_back_and_its_earlier_samples_arrive() {
    let mut swarm = Swarm::start(Size {
        vehicles: 3,
        laps: 2,
        relayed: false,
    });
    swarm.begin();
    swarm.until_samples(200);
    let obeyed = swarm.look(|watch| ordered(watch).1);
    assert!(obeyed.kind.is_some());
    swarm.kill("vehicle-3");
    let kept = MemoryFile::at(swarm.path("state-3/memory")).read().unwrap();
    assert!(
        kept.ordered.key() >= obeyed.edition(),
        "{kept:?} is on disk, {obeyed:?} was shown"
    );
    swarm.until("it is given up", 30, |watch| {
        watch.report().lost == [VehicleId(3)]
    });
    swarm.restart(vehicle(3));
    let insistent = Stranger::peer(Shows::Nothing, None, &[swarm.address(vehicle(3))]);
    swarm.until("it is back, and obeys nothing lower", 30, |watch| {
        let low = lowest_cut(3, kept.ordered.lease);
        insistent.say(
            "tomoswarm/courtyard/operator/1/order/3",
            &codec::encode(&low).unwrap(),
        );
        let (boot, shown) = ordered(watch);
        assert!(
            boot == start(1) || shown.lease >= kept.ordered.lease,
            "{shown:?} after {kept:?}"
        );
        assert_ne!(shown.kind, Some(OrderKind::CutMotors));
        boot == start(2) && watch.report().lost.is_empty()
    });
    swarm.until_end();
    let boots = swarm.look(|watch| (watch.samples_of(3, 1), watch.samples_of(3, 2)));
    assert!(boots.0 > 0, "{boots:?}");
    swarm.finish();
}

#[test]
fn a_vehicle_with_an_old_folder_starts_above_all_that_the_others_know_of_it() {
    let mut swarm = two();
    swarm.begin();
    swarm.until_samples(100);
    swarm.kill("vehicle-2");
    // As if the card had been restored from a copy: the start before this one was the first.
    let older = start(1).0 - 10;
    swarm.write("state-2/boot", &format!("{older}\n"));
    swarm.restart(vehicle(2));
    let (code, said) = swarm.ended("vehicle-2", Duration::from_secs(20));
    assert_eq!(code, Some(1), "{said}");
    let reason = format!("others know start {} of this vehicle", start(1));
    assert!(said.contains(&reason), "{said}");
    assert_eq!(
        std::fs::read_to_string(swarm.path("state-2/boot")).unwrap(),
        format!("{}\n", start(1))
    );
    swarm.restart(vehicle(2));
    swarm.until("it is back", 30, |watch| {
        let state = watch.view.state(VehicleId(2));
        state.is_some_and(|state| state.value.boot == start(2))
    });
    swarm.finish();
}

#[test]
fn a_vehicle_whose_folder_repeats_a_number_gives_it_up_for_the_next() {
    let mut swarm = two();
    swarm.begin();
    swarm.until_samples(100);
    swarm.kill("vehicle-2");
    // As if the card had been restored from a copy of the start before: this one counts the number of the last again.
    swarm.write("state-2/boot", &format!("{}\n", start(1).0 - 1));
    swarm.restart(vehicle(2));
    let (code, said) = swarm.ended("vehicle-2", Duration::from_secs(20));
    assert_eq!(code, Some(1), "{said}");
    let reason = format!("others know of start {} of this vehicle what", start(1));
    assert!(said.contains(&reason), "{said}");
    swarm.restart(vehicle(2));
    swarm.until("it is back", 30, |watch| {
        let state = watch.view.state(VehicleId(2));
        state.is_some_and(|state| state.value.boot == start(2))
    });
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
