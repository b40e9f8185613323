//! Orders under faults, in virtual time: 30 % loss, delays, doubling, partitions, restarts of vehicles and of the ground
//! station, two operators with take-over, one of them at times by a script. More seeds: `cargo bench --bench orders -- 2000`.

#[path = "orders/chance.rs"]
mod chance;
#[path = "orders/nodes.rs"]
mod nodes;
#[path = "orders/world.rs"]
mod world;

use world::{Mistake, play};

/// Worlds of every run of the tests.
const SEEDS: u64 = 100;
/// A planted mistake is noticed within so many worlds.
const NOTICED_WITHIN: u64 = 20;

#[test]
fn what_an_operator_calls_obeyed_was_in_force_no_lower_lease_is_obeyed_and_every_want_ends() {
    let (mut obeyed, mut below_disk) = (0, 0);
    for seed in 0..SEEDS {
        match play(seed, None) {
            Ok(tally) => (obeyed, below_disk) = (obeyed + tally.obeyed, below_disk + tally.below_disk),
            Err(wrong) => panic!("{wrong}"),
        }
    }
    assert!(obeyed > 10 * SEEDS, "the claims are about {obeyed} orders only");
    assert!(below_disk > 0, "no order came that a vehicle started anew must refuse");
}

fn is_noticed(mistake: Mistake, by: &str) {
    let wrong: Vec<String> = (0..NOTICED_WITHIN).filter_map(|seed| play(seed, Some(mistake)).err()).collect();
    assert!(wrong.iter().any(|wrong| wrong.contains(by)), "{mistake:?}: {wrong:?}");
}

#[test]
fn an_order_that_is_not_repeated_is_noticed() {
    is_noticed(Mistake::NotRepeated, "is not obeyed");
}

#[test]
fn a_lease_that_is_compared_the_wrong_way_is_noticed() {
    is_noticed(Mistake::LeaseComparedWrongly, "obeys");
}

#[test]
fn an_order_taken_as_obeyed_from_an_old_state_is_noticed() {
    is_noticed(Mistake::OldStateCounts, "calls");
}

#[test]
fn a_vehicle_that_forgets_what_it_obeyed_when_it_is_started_anew_is_noticed() {
    is_noticed(Mistake::MemoryLost, "its disk has");
}

#[test]
fn an_order_that_is_shown_before_it_is_on_disk_is_noticed() {
    is_noticed(Mistake::ToldTooEarly, "shows");
}
