//! What a follower does with plans and with what it hears, in stories of two vehicles.

use tomoswarm_proto::{Boot, Position};

use super::*;

pub(super) const ONE: VehicleId = VehicleId(1);
pub(super) const TWO: VehicleId = VehicleId(2);

/// A plan along the x axis, one metre a stop, from x = 0 in its vehicle's own lane.
pub(super) fn plan(vehicle: VehicleId, revision: u32, stops: u32) -> Plan {
    let lane_m = 5.0 * f64::from(vehicle.0);
    let stop = |number: u32| Stop {
        id: StopId(number),
        at: Position::from_metres(f64::from(number), lane_m, 0.0),
        route: vec![],
        dwell_ms: 0,
        dwell_limit_ms: 0,
        partners: vec![],
        after: vec![],
    };
    Plan {
        vehicle,
        run: RunId(1),
        revision: Revision(revision),
        members: vec![ONE, TWO],
        start: Position::from_metres(0.0, lane_m, 0.0),
        stops: (1..=stops).map(stop).collect(),
        ..Plan::default()
    }
}

fn peer(revision: u32, done: Option<u32>, leg: Option<u32>) -> VehicleProgress {
    let (run, revision) = (RunId(1), Revision(revision));
    let (done, leg) = (done.map(StopId), leg.map(StopId));
    VehicleProgress {
        vehicle: TWO,
        run,
        revision,
        done,
        leg,
        ..VehicleProgress::default()
    }
}

fn at(x_m: f64) -> Point {
    Point::new(x_m, 5.0)
}

fn second(seconds: f64) -> Time {
    Time::from_secs_f64(seconds)
}

/// A follower of vehicle 1 that has adopted the empty revision 1.
fn stopped() -> Follower {
    let mut follower = Follower::new(ONE, at(0.0), 0.3);
    assert_eq!(follower.offer(&plan(ONE, 1, 0)), OfferResult::Unchanged);
    assert_eq!(follower.offer(&plan(TWO, 1, 0)), OfferResult::Adopted);
    follower
}

/// A follower of vehicle 1 under revision 2, with the given plan of its own and 5 stops of vehicle 2.
fn following(own: &Plan) -> Follower {
    let mut follower = stopped();
    follower.offer(&plan(TWO, 2, 5));
    assert_eq!(follower.offer(own), OfferResult::Adopted);
    follower
}

#[test]
fn nobody_moves_before_all_report_the_revision() {
    let mut follower = following(&plan(ONE, 2, 3));
    assert_eq!(
        follower.waits_for(),
        Some(WaitsFor::Member { vehicle: TWO })
    );
    follower.hear(second(1.0), &peer(1, None, None));
    assert!(follower.next_leg().is_none());
    follower.hear(second(1.0), &peer(3, None, None));
    assert!(
        follower.next_leg().is_none(),
        "a peer beyond the revision may never have been at its start"
    );
    follower.hear(second(1.0), &peer(2, None, None));
    assert_eq!(follower.next_leg().map(|stop| stop.id), Some(StopId(1)));
}

#[test]
fn a_leg_waits_for_what_it_is_after_and_late_progress_takes_nothing_back() {
    let mut own = plan(ONE, 2, 3);
    own.stops[1].after = vec![(TWO, StopId(3))];
    let mut follower = following(&own);
    follower.hear(second(1.0), &peer(2, Some(2), Some(3)));
    assert_eq!(follower.may_enter(0).map(|stop| stop.id), Some(StopId(1)));
    assert!(follower.may_enter(1).is_none());
    follower.enter(StopId(1)).unwrap();
    assert_eq!(
        follower.waits_for(),
        Some(WaitsFor::Stop {
            vehicle: TWO,
            stop: StopId(3)
        })
    );
    assert_eq!(
        follower.enter(StopId(2)),
        Err(FollowError::NotYet(StopId(2)))
    );
    follower.hear(second(2.0), &peer(2, Some(4), None));
    follower.hear(second(2.0), &peer(2, Some(1), None));
    follower.hear(second(2.0), &peer(1, None, None));
    follower.hear(second(2.0), &peer(2, Some(99), None));
    follower.enter(StopId(2)).unwrap();
    assert_eq!(follower.may_enter(0).map(|stop| stop.id), Some(StopId(3)));
    assert_eq!(
        follower.progress(),
        VehicleProgress {
            vehicle: ONE,
            leg: Some(StopId(2)),
            ..peer(2, None, None)
        }
    );
    follower.arrive(second(3.0), StopId(1), at(1.0)).unwrap();
    assert_eq!(follower.progress().done, Some(StopId(1)));
    assert_eq!(
        follower.arrive(second(3.0), StopId(3), at(3.0)),
        Err(FollowError::NotThere(StopId(3)))
    );
}

#[test]
fn a_begun_leg_is_ended_before_the_next_revision() {
    let mut follower = following(&plan(ONE, 2, 3));
    follower.hear(second(1.0), &peer(2, None, None));
    follower.enter(StopId(1)).unwrap();
    assert_eq!(follower.offer(&plan(TWO, 3, 0)), OfferResult::Unchanged);
    assert!(
        follower.next_leg().is_none(),
        "half a revision heard is enough to stop"
    );
    assert_eq!(follower.offer(&plan(ONE, 3, 0)), OfferResult::Unchanged);
    assert_eq!(follower.progress().revision, Revision(2));
    follower.arrive(second(2.0), StopId(1), at(1.0)).unwrap();
    assert_eq!(
        follower.progress(),
        VehicleProgress {
            vehicle: ONE,
            ..peer(3, None, None)
        }
    );
    assert!(follower.finished());
    assert_eq!(follower.offer(&plan(ONE, 2, 3)), OfferResult::Old);
}

#[test]
fn a_held_leg_may_be_given_up_for_the_next_revision() {
    let mut follower = following(&plan(ONE, 2, 3));
    follower.hear(second(1.0), &peer(2, None, None));
    follower.enter(StopId(1)).unwrap();
    assert!(!follower.hold(at(0.5)), "there is nothing to change to");
    follower.resume();
    follower.offer(&plan(TWO, 3, 0));
    follower.offer(&plan(ONE, 3, 0));
    assert!(follower.hold(at(0.7)));
    assert!(follower.entered().is_empty());
    let mut next = plan(ONE, 4, 1);
    next.start = Position::from_metres(0.8, 5.0, 0.0);
    follower.offer(&plan(TWO, 4, 1));
    assert_eq!(follower.offer(&next), OfferResult::Adopted);
}

#[test]
fn a_revision_from_elsewhere_is_refused_and_holds() {
    let mut follower = following(&plan(ONE, 2, 3));
    follower.hear(second(1.0), &peer(2, None, None));
    let mut next = plan(ONE, 3, 0);
    next.start.x_mm = 2000;
    follower.offer(&next);
    let verdict = follower.offer(&plan(TWO, 3, 4));
    assert!(
        matches!(verdict, OfferResult::Refused(PlanRefusal::Elsewhere { .. })),
        "{verdict:?}"
    );
    assert!(follower.next_leg().is_none());
    assert_eq!(follower.progress().revision, Revision(2));
}

#[test]
fn invalid_and_foreign_revisions_are_refused_and_hold() {
    let mut circle = plan(ONE, 3, 2);
    circle.stops[0].after = vec![(TWO, StopId(2))];
    let mut other = plan(TWO, 3, 2);
    other.stops[0].after = vec![(ONE, StopId(2))];
    let mut follower = stopped();
    follower.offer(&circle);
    assert!(matches!(
        follower.offer(&other),
        OfferResult::Refused(PlanRefusal::Invalid { .. })
    ));
    let mut without = plan(TWO, 4, 2);
    without.members = vec![TWO];
    assert!(matches!(
        follower.offer(&without),
        OfferResult::Refused(PlanRefusal::NotMember { .. })
    ));
    assert_eq!(follower.progress().revision, Revision(1));
    follower.offer(&plan(TWO, 5, 2));
    assert_eq!(follower.offer(&plan(ONE, 5, 2)), OfferResult::Adopted);
}

#[test]
fn a_restarted_vehicle_begins_nothing_before_an_empty_revision() {
    let mut follower = Follower::new(ONE, at(0.0), 0.3);
    follower.offer(&plan(TWO, 7, 2));
    let verdict = follower.offer(&plan(ONE, 7, 2));
    assert!(
        matches!(
            verdict,
            OfferResult::Refused(PlanRefusal::NotStopped { .. })
        ),
        "{verdict:?}"
    );
    assert_eq!(
        follower.progress(),
        VehicleProgress {
            vehicle: ONE,
            ..VehicleProgress::default()
        }
    );
}

#[test]
fn a_dwell_ends_when_the_partner_was_there_or_at_its_limit() {
    for (heard, ends_s) in [(true, 12.0), (false, 16.0)] {
        let mut own = plan(ONE, 2, 2);
        own.stops[0].dwell_ms = 2000;
        own.stops[0].dwell_limit_ms = 6000;
        own.stops[0].partners = vec![TWO];
        let mut follower = following(&own);
        follower.hear(second(1.0), &peer(2, None, Some(1)));
        assert!(
            follower.may_enter(1).is_none(),
            "nobody drives through a dwell"
        );
        follower.enter(StopId(1)).unwrap();
        follower.arrive(second(10.0), StopId(1), at(1.0)).unwrap();
        assert_eq!(
            follower.waits_for(),
            Some(WaitsFor::Dwell { stop: StopId(1) })
        );
        assert_eq!(follower.progress().leg, None, "who dwells is at rest");
        if heard {
            follower.hear(second(10.5), &peer(2, Some(1), None));
            follower.hear(second(10.7), &peer(2, Some(1), Some(2)));
        }
        assert_eq!(
            follower.deadline().map(|deadline| deadline.at),
            Some(second(ends_s))
        );
        assert!(!follower.wake(second(ends_s - 0.1)) && follower.wake(second(ends_s)));
        assert_eq!(follower.next_leg().map(|stop| stop.id), Some(StopId(2)));
    }
}

#[test]
fn plans_of_two_grounds_under_one_edition_are_not_mixed() {
    let of = |plan: Plan, number: u32| Plan {
        lease: tomoswarm_proto::Lease { number, holder: 7 },
        ..plan
    };
    let mut follower = stopped();
    assert_eq!(
        follower.offer(&of(plan(ONE, 2, 3), 1)),
        OfferResult::Unchanged
    );
    assert_eq!(
        follower.offer(&of(plan(TWO, 2, 5), 2)),
        OfferResult::Unchanged,
        "the own one is of the lower right"
    );
    assert_eq!(follower.offer(&of(plan(ONE, 2, 3), 1)), OfferResult::Old);
    assert_eq!(
        follower.offer(&of(plan(ONE, 2, 4), 2)),
        OfferResult::Adopted
    );
    assert!(follower.plans().iter().all(|plan| plan.lease.number == 2));
}

#[test]
fn what_a_lower_right_has_given_and_nobody_follows_is_void_whatever_its_revision() {
    let of = |plan: Plan, number: u32| Plan {
        lease: tomoswarm_proto::Lease { number, holder: 7 },
        ..plan
    };
    let mut follower = following(&plan(ONE, 2, 3));
    follower.hear(second(1.0), &peer(2, None, None));
    assert_eq!(
        follower.offer(&of(plan(ONE, 900, 0), 1)),
        OfferResult::Unchanged
    );
    assert!(follower.next_leg().is_none());
    assert_eq!(
        follower.offer(&of(plan(ONE, 3, 0), 2)),
        OfferResult::Unchanged
    );
    assert_eq!(follower.pending_edition(), Some((RunId(1), Revision(3))));
    assert_eq!(
        follower.offer(&of(plan(TWO, 900, 0), 1)),
        OfferResult::Unchanged,
        "a later one is collected"
    );
    assert_eq!(
        follower.offer(&of(plan(ONE, 2, 3), 3)),
        OfferResult::Old,
        "it is followed already"
    );
    assert_eq!(
        follower.next_leg().map(|stop| stop.id),
        Some(StopId(1)),
        "and nothing is newer"
    );
}

#[test]
fn a_revision_that_a_peer_does_not_say_again_is_none_that_it_follows() {
    for (heard_s, rests) in [(10.9, false), (11.1, true)] {
        let mut own = plan(ONE, 2, 1);
        (own.stops[0].dwell_ms, own.stops[0].dwell_limit_ms) = (1000, 60_000);
        own.stops[0].partners = vec![TWO];
        let mut follower = following(&own);
        follower.hear(second(0.9), &peer(2, None, None));
        follower.hear(second(1.0), &peer(900, None, None));
        follower.hear(second(heard_s), &peer(2, None, None));
        follower.enter(StopId(1)).unwrap();
        follower.arrive(second(12.0), StopId(1), at(1.0)).unwrap();
        let stays_s = if rests { 1.0 } else { 60.0 };
        assert_eq!(
            follower.deadline().map(|deadline| deadline.at),
            Some(second(12.0 + stays_s))
        );
    }
}

#[test]
fn a_peer_that_lost_its_count_of_starts_is_believed_after_a_silence() {
    let of = |boot: u32, leg: Option<u32>| VehicleProgress {
        boot: Boot(boot),
        ..peer(2, None, leg)
    };
    for (heard_s, rests) in [(30.9, false), (31.1, true)] {
        let mut own = plan(ONE, 2, 1);
        (own.stops[0].dwell_ms, own.stops[0].dwell_limit_ms) = (1000, 60_000);
        own.stops[0].partners = vec![TWO];
        let mut follower = following(&own);
        follower.hear(second(1.0), &of(40, Some(1)));
        follower.enter(StopId(1)).unwrap();
        follower.arrive(second(2.0), StopId(1), at(1.0)).unwrap();
        follower.hear(second(heard_s), &of(3, None));
        let stays_s = if rests { 1.0 } else { 60.0 };
        let expected = (!rests).then(|| second(2.0 + stays_s));
        assert_eq!(
            follower.deadline().map(|deadline| deadline.at),
            expected,
            "{heard_s}"
        );
    }
}
