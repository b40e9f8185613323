//! A plan alone: nothing drives, and nobody orders.

use tomoswarm_proto::{Position, Revision};

use super::*;
use crate::node::tests_support::settings;

const RUN: RunId = RunId(1);

fn at(time_s: f64) -> Time {
    Time::from_secs_f64(time_s)
}

/// A plan of vehicle 1 alone, with stops 2 m apart along x.
fn edition(revision: u32, stops: u32) -> Plan {
    let stop = |index: u32| Stop {
        id: StopId(index),
        at: Position::from_metres(2.0 * f64::from(index), 0.0, 0.0),
        route: vec![],
        dwell_ms: 0,
        dwell_limit_ms: 0,
        partners: vec![],
        after: vec![],
    };
    let (vehicle, members) = (VehicleId(1), vec![VehicleId(1)]);
    let stops = (1..=stops).map(stop).collect();
    Plan {
        vehicle,
        run: RUN,
        revision: Revision(revision),
        members,
        stops,
        ..Plan::default()
    }
}

/// A vehicle at the datum that has adopted a plan.
fn followed(stops: u32) -> GroundPlan {
    let mut plan = GroundPlan::new(&settings(1));
    assert!(plan.begin_at(Point::default()) && !plan.begin_at(Point::new(1.0, 0.0)));
    for plan_heard in [edition(1, 0), edition(2, stops)] {
        assert_eq!(plan.offer(Time::ZERO, &plan_heard), None);
    }
    let news = plan.news();
    assert!(
        news.is_adopted
            && news
                .progress
                .is_some_and(|progress| progress.revision == Revision(2))
    );
    plan
}

#[test]
fn legs_are_entered_as_far_ahead_as_the_way_is_short() {
    let mut plan = followed(4);
    assert_eq!(
        plan.enter_next(0.0, false).map(|stop| stop.id),
        Some(StopId(1))
    );
    assert_eq!(
        plan.enter_next(2.0, false).map(|stop| stop.id),
        Some(StopId(2))
    );
    assert_eq!(plan.enter_next(4.0, false), None, "the way is long enough");
    assert_eq!(
        plan.enter_next(4.0, true).map(|stop| stop.id),
        Some(StopId(3)),
        "nothing nearer can be reached"
    );
}

#[test]
fn the_end_of_a_plan_is_news_once() {
    let mut plan = followed(1);
    assert_eq!(plan.measures_for(), Some(RUN));
    plan.enter_next(0.0, false).unwrap();
    plan.pass(at(3.0), StopId(1), Point::new(2.0, 0.0));
    let news = plan.news();
    assert_eq!((news.finished, news.is_adopted), (Some(RUN), false));
    assert_eq!(plan.news(), PlanChanges::default());
    assert_eq!(plan.measures_for(), None);
}

#[test]
fn a_plan_that_was_left_is_left_until_a_newer_one_is_adopted() {
    let mut plan = followed(2);
    plan.leave();
    plan.rest_at(Point::default());
    assert!(plan.has_left() && !plan.is_newer(&edition(2, 2)));
    assert!(plan.is_newer(&edition(3, 0)));
    plan.offer(Time::ZERO, &edition(3, 0));
    assert!(plan.news().is_adopted && !plan.has_left());
}

#[test]
fn a_revision_that_nobody_gives_any_more_keeps_nobody_from_going_on() {
    let both = |revision| Plan {
        members: vec![VehicleId(1), VehicleId(2)],
        ..edition(revision, 0)
    };
    for (heard_s, goes_on) in [(14.9, false), (15.0, true)] {
        let mut plan = followed(2);
        plan.offer(at(0.0), &both(900));
        assert!(plan.enter_next(0.0, false).is_none());
        plan.offer(at(heard_s), &edition(2, 2));
        assert_eq!(
            plan.enter_next(0.0, false).is_some(),
            goes_on,
            "{heard_s} s"
        );
        // As long as it is given it counts.
        let mut given = followed(2);
        for second in 0..60_u32 {
            given.offer(at(f64::from(second)), &both(900));
            given.offer(at(f64::from(second)), &edition(2, 2));
        }
        assert!(given.enter_next(0.0, false).is_none());
    }
}

#[test]
fn a_plan_that_is_not_taken_is_said_once_and_why() {
    let mut plan = followed(1);
    let far = edition(3, 20);
    let outside = MissionEvent::Outside(Point::new(26.0, 0.0));
    assert_eq!(plan.refuse(&far, false), Err(Some(outside)));
    assert_eq!(
        plan.refuse(&far, false),
        Err(None),
        "it is repeated by the ground"
    );
    assert_eq!(
        plan.refuse(&edition(4, 1), true),
        Err(Some(MissionEvent::OldPlan(RUN, Revision(4))))
    );
    assert_eq!(plan.refuse(&edition(4, 1), false), Ok(()));
}

#[test]
fn a_stop_is_given_up_only_for_one_behind_it_that_can_be_reached() {
    let mut plan = followed(8);
    plan.enter_next(0.0, false).unwrap();
    assert!(!plan.gives_up_stop(1, |_| false));
    assert!(plan.gives_up_stop(1, |place| place.x_m > 5.0));
}

#[test]
fn at_the_end_of_a_plan_the_last_stops_may_be_given_up_and_no_more_in_a_row_than_a_few() {
    let mut plan = followed(1);
    plan.enter_next(0.0, false).unwrap();
    assert!(!plan.gives_up_stop(5, |_| false), "too many are left");
    let given_up = (0..100)
        .filter(|_| plan.gives_up_stop(1, |_| false))
        .count();
    assert_eq!(given_up, 16);
    plan.pass(at(3.0), StopId(1), Point::new(2.0, 0.0));
    assert!(plan.gives_up_stop(1, |_| true), "one was reached meanwhile");
}
