//! How simulated nodes take part in the bus: they ask first, one that does not fit ends, one that is started anew asks again,
//! and nobody sends more than its budget allows.

use super::*;

fn log_of(kernel: &Kernel) -> &str {
    kernel.record.log_text()
}

fn times(kernel: &Kernel, words: &str) -> usize {
    log_of(kernel).matches(words).count()
}

#[test]
fn nobody_is_heard_before_it_takes_part() {
    let mut scenario = scenario("");
    scenario.shown_every = Duration::from_millis(50);
    let mut kernel = Kernel::new(scenario.parts().unwrap());
    let heard = |kernel: &Kernel| {
        view(&kernel.nodes.operators()[0])
            .vehicles()
            .filter(|(_, seen)| seen.state.is_some())
            .count()
    };
    run(&mut kernel, 0.25);
    assert_eq!(
        (heard(&kernel), times(&kernel, "takes part in the bus")),
        (0, 0)
    );
    run(&mut kernel, 1.0);
    assert_eq!(
        (heard(&kernel), times(&kernel, "takes part in the bus")),
        (2, 3)
    );
}

#[test]
fn a_vehicle_with_another_venue_file_ends_and_the_others_do_not_miss_it() {
    let scenario = scenario("");
    let mut parts = scenario.parts().unwrap();
    parts.greetings.vehicles[1].venue_hash += 1;
    let mut kernel = Kernel::new(parts);
    kernel.network.leave(NodePlace::Vehicle(1));
    run(&mut kernel, 1.0);
    kernel
        .network
        .join(NodePlace::Vehicle(1), Boot(1), &mut kernel.schedule);
    run(&mut kernel, 3.0);
    assert!(kernel.nodes.vehicles()[1].is_dead() && !kernel.nodes.vehicles()[0].is_dead());
    assert_eq!(
        times(&kernel, "vehicle 2 may not take part"),
        1,
        "{}",
        log_of(&kernel)
    );
    assert!(
        log_of(&kernel).contains("vehicle 2 is refused: another venue file"),
        "both sides say why"
    );
    assert!(
        view(&kernel.nodes.operators()[0])
            .state(VehicleId(2))
            .is_none()
    );
    assert!(
        view(&kernel.nodes.operators()[0])
            .state(VehicleId(1))
            .is_some()
    );
}

#[test]
fn without_a_ground_station_that_may_take_part_the_run_has_failed() {
    let scenario = scenario("");
    let mut parts = scenario.parts().unwrap();
    parts.greetings.ground.venue_hash += 1;
    let mut kernel = Kernel::new(parts);
    kernel.network.leave(NodePlace::Ground);
    run(&mut kernel, 1.0);
    kernel
        .network
        .join(NodePlace::Ground, Boot(1), &mut kernel.schedule);
    run(&mut kernel, 3.0);
    assert!(kernel.schedule.ended_at().is_some());
    let why = kernel.record.failure().unwrap_or_default();
    assert!(
        why.contains("the ground station may not take part"),
        "{why}"
    );
}

#[test]
fn who_is_started_anew_asks_again() {
    let mut scenario =
        scenario("[[fault]]\nkind = \"restart\"\nat_s = 2.0\nuntil_s = 3.0\nvehicles = [2]\n");
    scenario.shown_every = Duration::from_millis(50);
    let mut kernel = Kernel::new(scenario.parts().unwrap());
    run(&mut kernel, 3.2);
    assert_eq!(times(&kernel, "vehicle 2 takes part in the bus"), 1);
    run(&mut kernel, 5.0);
    assert_eq!(times(&kernel, "vehicle 2 takes part in the bus"), 2);
    let state = view(&kernel.nodes.operators()[0])
        .state(VehicleId(2))
        .expect("it is heard");
    assert_eq!(state.value.boot, Boot(2));
}

#[test]
fn nobody_sends_more_than_its_budget() {
    let span_s = 8.0;
    let sent = |more: &str| {
        let mut kernel = Kernel::new(scenario(more).parts().unwrap());
        run(&mut kernel, span_s);
        let bytes = kernel.network.bus().sent_by_kind()[&NodeId::Vehicle(VehicleId(1))]
            .values()
            .sum::<u64>();
        (
            bytes,
            kernel.network.bus().sent_by_kind()[&NodeId::Vehicle(VehicleId(1))]["state"],
        )
    };
    let (plenty, states) = sent("");
    assert!(
        plenty > 1000 && states > 500,
        "{plenty} bytes, {states} of states"
    );
    // A map that grows all the time would take more.
    let parts = || {
        let mut parts = scenario("").parts().unwrap();
        parts.egress_bytes_per_s = 200;
        parts
    };
    let mut kernel = Kernel::new(parts());
    run(&mut kernel, span_s);
    let by_kind = &kernel.network.bus().sent_by_kind()[&NodeId::Vehicle(VehicleId(1))];
    let urgent: u64 = ["hello", "standing"]
        .iter()
        .filter_map(|word| by_kind.get(word))
        .sum();
    let others = by_kind.values().sum::<u64>() - urgent;
    assert!(
        others as f64 <= 200.0 * (span_s + 0.5) && others < plenty / 2,
        "{by_kind:?}"
    );
    assert!(by_kind["state"] > 0, "the newest of what it says goes out");
}
