//! Who waits for whom: an action dependency graph (Hönig et al. 2019, "Persistent and Robust Execution
//! of MAPF Schedules in Warehouses") over the stops of all vehicles.
//!
//! A vehicle is at any time on the leg it has entered last, or at rest at the stop at that leg's end.
//! A leg may be entered once all stops named in `after` are done; so whatever happens in time, two
//! legs that are ordered never overlap. Times are not known here and play no part.

use std::collections::BTreeMap;

use tomoswarm_proto::{Plan, Stop, StopId, VehicleId};

use super::PlanError;
use crate::geom::{Point, Track};

/// Returns the track of every leg of a plan: the first from its start to the first stop.
pub fn tracks_of(plan: &Plan) -> Vec<Track> {
    let mut from = Point::from(plan.start);
    let mut tracks = Vec::with_capacity(plan.stops.len());
    for stop in &plan.stops {
        let mut points = Vec::with_capacity(stop.route.len() + 2);
        points.push(from);
        points.extend(stop.route.iter().map(|corner| Point::from(*corner)));
        from = stop.at.into();
        points.push(from);
        tracks.extend(Track::new(points));
    }
    tracks
}

/// Adds to every leg's `after` what it must wait for, given an order in which the legs can be driven
/// one at a time.
///
/// `sequence` names, move by move, whose next leg is driven. A leg that comes within `separation_m`
/// (between the middles of two vehicles) of another vehicle's earlier leg or resting place waits until
/// that vehicle has done the last such leg. What an earlier stop of the same plan already waits for is
/// not named again.
///
/// # Errors
/// The plans are not a valid set, the order does not name every leg once, or a leg of the order comes
/// too close to where another vehicle rests at that moment.
pub fn order_legs(
    plans: &mut [Plan],
    sequence: &[VehicleId],
    separation_m: f64,
) -> Result<(), PlanError> {
    validate(plans)?;
    let indices: BTreeMap<VehicleId, usize> = plans
        .iter()
        .enumerate()
        .map(|(i, p)| (p.vehicle, i))
        .collect();
    let tracks: Vec<Vec<Track>> = plans.iter().map(tracks_of).collect();
    let mut driven = vec![0; plans.len()];
    let mut waited = vec![vec![0; plans.len()]; plans.len()];
    check_starts(plans, separation_m)?;
    for vehicle in sequence {
        let Some(&mover) = indices
            .get(vehicle)
            .filter(|index| driven[**index] < tracks[**index].len())
        else {
            return Err(wrong_count(plans, sequence, *vehicle));
        };
        let leg = driven[mover];
        let track = &tracks[mover][leg];
        for other in (0..plans.len()).filter(|other| *other != mover) {
            let distance_m = track.distance_to_point(rest_after(&plans[other], driven[other]));
            if distance_m < separation_m {
                let at = (other, driven[other]);
                return Err(too_close(
                    plans,
                    (mover, leg + 1),
                    at,
                    distance_m,
                    separation_m,
                ));
            }
            let known = waited[mover][other];
            let earlier = &tracks[other][known..driven[other]];
            if let Some(last) = earlier
                .iter()
                .rposition(|early| early.distance_to(track) < separation_m)
            {
                waited[mover][other] = known + last + 1;
                let waits_for = (plans[other].vehicle, plans[other].stops[known + last].id);
                plans[mover].stops[leg].after.push(waits_for);
            }
        }
        driven[mover] += 1;
    }
    match (0..plans.len()).find(|index| driven[*index] != tracks[*index].len()) {
        Some(index) => Err(wrong_count(plans, sequence, plans[index].vehicle)),
        None => Ok(()),
    }
}

fn wrong_count(plans: &[Plan], sequence: &[VehicleId], vehicle: VehicleId) -> PlanError {
    let named = sequence.iter().filter(|named| **named == vehicle).count();
    let planned = plans
        .iter()
        .find(|plan| plan.vehicle == vehicle)
        .map_or(0, |plan| plan.stops.len());
    PlanError::Sequence {
        vehicle,
        named,
        planned,
    }
}

/// Where a vehicle rests once so many of its stops are done.
pub(super) fn rest_after(plan: &Plan, done: usize) -> Point {
    done.checked_sub(1)
        .and_then(|last| plan.stops.get(last))
        .map_or(plan.start, |stop| stop.at)
        .into()
}

/// Says that a vehicle on a leg (counted from 1; 0 = at its start) comes too close to another.
pub(super) fn too_close(
    plans: &[Plan],
    (mover, leg): (usize, usize),
    (other, at): (usize, usize),
    distance_m: f64,
    separation_m: f64,
) -> PlanError {
    let id = |plan: &Plan, count: usize| {
        count
            .checked_sub(1)
            .and_then(|last| plan.stops.get(last))
            .map(|stop: &Stop| stop.id)
    };
    PlanError::TooClose {
        vehicle: plans[mover].vehicle,
        stop: id(&plans[mover], leg),
        other: plans[other].vehicle,
        at: id(&plans[other], at),
        distance_m,
        separation_m,
    }
}

/// Checks that all vehicles start far enough from each other.
pub(super) fn check_starts(plans: &[Plan], separation_m: f64) -> Result<(), PlanError> {
    for (index, plan) in plans.iter().enumerate() {
        for (other, peer) in plans.iter().enumerate().skip(index + 1) {
            let distance_m = Point::from(plan.start).distance_to(peer.start.into());
            if distance_m < separation_m {
                return Err(too_close(
                    plans,
                    (index, 0),
                    (other, 0),
                    distance_m,
                    separation_m,
                ));
            }
        }
    }
    Ok(())
}

/// Checks that plans belong together and can be driven to their ends: all of one run and revision,
/// exactly one for each member, unique stop ids, known stops in `after`, no circle.
///
/// # Errors
/// The first thing found wrong.
pub fn validate(plans: &[Plan]) -> Result<(), PlanError> {
    let first = plans.first().ok_or(PlanError::Empty)?;
    let (run, revision) = (first.run, first.revision);
    for plan in plans {
        if (plan.run, plan.revision) != (run, revision) || plan.members != first.members {
            return Err(PlanError::Mixed {
                vehicle: plan.vehicle,
                run,
                revision,
            });
        }
    }
    check_members(plans, &first.members)?;
    topological_order(plans).map(drop)
}

fn check_members(plans: &[Plan], members: &[VehicleId]) -> Result<(), PlanError> {
    if let Some(pair) = members.windows(2).find(|pair| pair[0] >= pair[1]) {
        return Err(PlanError::Members { vehicle: pair[1] });
    }
    let mut vehicles: Vec<VehicleId> = plans.iter().map(|plan| plan.vehicle).collect();
    vehicles.sort();
    let differs =
        (0..vehicles.len().max(members.len())).find(|i| vehicles.get(*i) != members.get(*i));
    match differs {
        Some(at) => Err(PlanError::Members {
            vehicle: members
                .get(at)
                .or(vehicles.get(at))
                .copied()
                .unwrap_or_default(),
        }),
        None => Ok(()),
    }
}

/// A stop by the index of its plan and its own index in it.
pub(super) type StopIndex = (usize, usize);

/// Returns, for every stop, the indices of the stops in its `after`.
pub(super) fn resolve_after(plans: &[Plan]) -> Result<Vec<Vec<Vec<StopIndex>>>, PlanError> {
    let mut known: BTreeMap<(VehicleId, StopId), StopIndex> = BTreeMap::new();
    for (index, plan) in plans.iter().enumerate() {
        for (at, stop) in plan.stops.iter().enumerate() {
            if known.insert((plan.vehicle, stop.id), (index, at)).is_some() {
                return Err(PlanError::Repeated {
                    vehicle: plan.vehicle,
                    stop: stop.id,
                });
            }
        }
    }
    let find = |plan: &Plan, stop: &Stop, (of, after): (VehicleId, StopId)| {
        known
            .get(&(of, after))
            .copied()
            .filter(|_| of != plan.vehicle)
            .ok_or(PlanError::UnknownStop {
                vehicle: plan.vehicle,
                stop: stop.id,
                of,
                after,
            })
    };
    plans
        .iter()
        .map(|plan| {
            let of_stop = |stop: &Stop| {
                stop.after
                    .iter()
                    .map(|after| find(plan, stop, *after))
                    .collect()
            };
            plan.stops.iter().map(of_stop).collect()
        })
        .collect()
}

/// Returns all stops in an order in which each comes after everything it waits for (Kahn 1962).
pub(super) fn topological_order(plans: &[Plan]) -> Result<Vec<StopIndex>, PlanError> {
    let after = resolve_after(plans)?;
    let mut missing: Vec<Vec<usize>> = Vec::with_capacity(plans.len());
    let mut waiting: Vec<Vec<Vec<StopIndex>>> = plans
        .iter()
        .map(|p| vec![Vec::new(); p.stops.len()])
        .collect();
    for (index, stops) in after.iter().enumerate() {
        missing.push(
            stops
                .iter()
                .enumerate()
                .map(|(at, list)| list.len() + usize::from(at > 0))
                .collect(),
        );
        for (at, list) in stops.iter().enumerate() {
            for (of, stop) in list {
                waiting[*of][*stop].push((index, at));
            }
        }
    }
    let ready =
        |(index, counts): (usize, &Vec<usize>)| (counts.first() == Some(&0)).then_some((index, 0));
    let mut order: Vec<StopIndex> = missing.iter().enumerate().filter_map(ready).collect();
    let mut next = 0;
    while let Some(&(index, at)) = order.get(next) {
        next += 1;
        let own = (at + 1 < plans[index].stops.len()).then_some((index, at + 1));
        for (of, stop) in waiting[index][at].iter().copied().chain(own) {
            missing[of][stop] -= 1;
            if missing[of][stop] == 0 {
                order.push((of, stop));
            }
        }
    }
    for (index, counts) in missing.iter().enumerate() {
        if let Some(at) = counts.iter().position(|count| *count > 0) {
            return Err(PlanError::Circle {
                vehicle: plans[index].vehicle,
                stop: plans[index].stops[at].id,
            });
        }
    }
    Ok(order)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::check_separation;
    use tomoswarm_proto::{Position, Revision, RunId};

    const ONE: VehicleId = VehicleId(1);
    const TWO: VehicleId = VehicleId(2);

    fn position((x_m, y_m): (f64, f64)) -> Position {
        Position::from_metres(x_m, y_m, 0.0)
    }

    fn plan(vehicle: VehicleId, start: (f64, f64), stops: &[(f64, f64)]) -> Plan {
        let stop = |(number, at): (usize, &(f64, f64))| Stop {
            id: StopId(number as u32 + 1),
            at: position(*at),
            route: vec![],
            dwell_ms: 0,
            dwell_limit_ms: 0,
            partners: vec![],
            after: vec![],
        };
        Plan {
            vehicle,
            run: RunId(1),
            revision: Revision(1),
            members: vec![ONE, TWO],
            start: position(start),
            stops: stops.iter().enumerate().map(stop).collect(),
            ..Plan::default()
        }
    }

    /// One drives east across the way that two drives north.
    fn crossing() -> Vec<Plan> {
        let one = plan(ONE, (0.0, 5.0), &[(4.0, 5.0), (6.0, 5.0), (10.0, 5.0)]);
        vec![one, plan(TWO, (5.0, 0.0), &[(5.0, 3.0), (5.0, 10.0)])]
    }

    #[test]
    fn whoever_comes_second_waits_for_the_leg_that_leaves_the_conflict() {
        let mut plans = crossing();
        assert!(matches!(
            check_separation(&plans, 1.2),
            Err(PlanError::TooClose { .. })
        ));
        order_legs(&mut plans, &[ONE, TWO, ONE, ONE, TWO], 1.2).unwrap();
        // Stop 2 of one is 1 m from the crossing way: the third leg is the one that leaves it.
        assert_eq!(plans[1].stops[1].after, [(ONE, StopId(3))]);
        assert!(plans[0].stops.iter().all(|stop| stop.after.is_empty()));
        check_separation(&plans, 1.2).unwrap();
        let mut plans = crossing();
        order_legs(&mut plans, &[TWO, TWO, ONE, ONE, ONE], 1.2).unwrap();
        assert_eq!(plans[0].stops[0].after, [(TWO, StopId(2))]);
        check_separation(&plans, 1.2).unwrap();
    }

    #[test]
    fn an_order_in_which_someone_is_in_the_way_is_refused() {
        let wrong = order_legs(&mut crossing(), &[ONE, ONE, TWO, TWO, ONE], 1.2);
        assert!(
            matches!(wrong, Err(PlanError::TooClose { vehicle: TWO, .. })),
            "{wrong:?}"
        );
        let short = order_legs(&mut crossing(), &[TWO, TWO, ONE], 1.2);
        assert_eq!(
            short,
            Err(PlanError::Sequence {
                vehicle: ONE,
                named: 1,
                planned: 3
            })
        );
        let long = order_legs(&mut crossing(), &[TWO, TWO, TWO], 1.2);
        assert_eq!(
            long,
            Err(PlanError::Sequence {
                vehicle: TWO,
                named: 3,
                planned: 2
            })
        );
    }

    #[test]
    fn a_vehicle_without_stops_is_in_the_way_too() {
        let parked = plan(TWO, (5.0, 5.5), &[]);
        let plans = [crossing().remove(0), parked];
        assert!(matches!(
            check_separation(&plans, 1.2),
            Err(PlanError::TooClose { .. })
        ));
        let near = [plan(ONE, (0.0, 0.0), &[]), plan(TWO, (1.0, 0.0), &[])];
        assert!(matches!(
            check_separation(&near, 1.2),
            Err(PlanError::TooClose { stop: None, .. })
        ));
    }

    #[test]
    fn sets_of_plans_that_do_not_belong_together_are_refused() {
        let check = |change: fn(&mut Vec<Plan>), expected: &str| {
            let mut plans = crossing();
            change(&mut plans);
            let error = validate(&plans).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        };
        assert_eq!(validate(&crossing()), Ok(()));
        check(|plans| plans.clear(), "no plans");
        check(|plans| drop(plans.pop()), "vehicle 2 does not fit");
        check(|plans| plans[1].vehicle = ONE, "members");
        check(
            |plans| plans[1].revision = Revision(9),
            "does not belong to run 1 revision 1",
        );
        check(
            |plans| plans.iter_mut().for_each(|p| p.members = vec![TWO, ONE]),
            "vehicle 1 does not fit",
        );
        check(
            |plans| plans[0].stops[2].id = StopId(1),
            "stop 1 occurs twice",
        );
        check(
            |plans| plans[0].stops[0].after = vec![(TWO, StopId(7))],
            "stop 7 of vehicle 2",
        );
        check(
            |plans| plans[0].stops[0].after = vec![(ONE, StopId(1))],
            "no other plan has",
        );
        check(
            |plans| {
                plans[0].stops[1].after = vec![(TWO, StopId(2))];
                plans[1].stops[0].after = vec![(ONE, StopId(2))];
            },
            "circle",
        );
    }
}
