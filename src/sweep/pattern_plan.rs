//! Plans that drive a measurement pattern: a stop for every step of a vehicle, at which it stands with the other one.
//!
//! Nobody begins a step before both have ended the last one; a point that is handed over is left before it is entered.
//! Before the first step the vehicles come to their places along the border of the area, one after the other. Where
//! obstacles stand is not known here.

use tomoswarm_proto::{Plan, Position, Revision, RunId, Stop, StopId, VehicleId};

use super::schedule::check_count;
use super::{
    Lap, LatticePoint, Pattern, PlannedSweep, Ring, Schedule, SweepError, check_separation,
    order_legs, tracks_of,
};
use crate::geom::{Point, Rect};

/// What is wished of the planner.
#[derive(Clone, PartialEq, Debug)]
pub struct PatternRequest {
    /// Of which run the plans are.
    pub run: RunId,
    /// Of which revision the plans are.
    pub revision: Revision,
    /// Both vehicles and where they stand, local frame; the lower id is the first of the pattern.
    pub vehicles: Vec<(VehicleId, Point)>,
    /// Over which the lattice is laid, its corners on the corners.
    pub area: Rect,
    /// How many rounds were driven before, less than [`Pattern::round_count`].
    pub first_round: usize,
    /// How long to stay after each step, milliseconds; above 0.
    pub dwell_ms: u32,
    /// How long to stay at most when the other one is not there, milliseconds.
    pub dwell_limit_ms: u32,
    /// How far apart (middle to middle, metres) the vehicles must be at any time; at most the pitch of the lattice.
    pub separation_m: f64,
}

/// Plans a pattern, from where the vehicles stand; each round is a lap.
///
/// # Errors
/// Not two vehicles, more stops than a plan has, no round left, an area without an inside, or a lattice too narrow for the
/// separation.
pub fn pattern_sweep(
    pattern: &Pattern,
    request: &PatternRequest,
) -> Result<PlannedSweep, SweepError> {
    let [one, other] = check(pattern, request)?;
    let steps_a_round = pattern.step_count() / pattern.round_count();
    let skipped = request.first_round * steps_a_round;
    let at = pattern
        .steps()
        .take(skipped)
        .last()
        .unwrap_or_else(|| pattern.start());
    let (mut plans, mut sequence) = approach(pattern, request, at, [one, other])?;
    let mut schedule = Schedule::default();
    let mut before = at;
    for round in request.first_round..pattern.round_count() {
        let begins = [0, 1].map(|which: usize| plans[which].stops.len());
        for (step, now) in pattern
            .steps()
            .enumerate()
            .skip(round * steps_a_round)
            .take(steps_a_round)
        {
            add_step(
                &mut plans,
                &mut sequence,
                Step {
                    pattern,
                    request,
                    number: step,
                    before,
                    now,
                },
            );
            before = now;
        }
        schedule.laps.push(lap(round, &plans, begins));
    }
    finish(plans, &sequence, schedule, request.separation_m)
}

fn check(
    pattern: &Pattern,
    request: &PatternRequest,
) -> Result<[(VehicleId, Point); 2], SweepError> {
    let &[one, other] = request.vehicles.as_slice() else {
        return Err(SweepError::NotTwo {
            vehicles: request.vehicles.len(),
        });
    };
    let wrong = [one, other].into_iter().find(|(_, at)| !at.is_finite());
    if let Some((vehicle, _)) = wrong.or_else(|| (one.0 == other.0).then_some(other)) {
        return Err(SweepError::Vehicle { vehicle });
    }
    check_count(1 + most_moves(pattern))?;
    let limit = pattern.round_count();
    if request.first_round >= limit {
        return Err(SweepError::Laps {
            first: request.first_round,
            end: limit,
            limit,
        });
    }
    Ok([one, other])
}

/// Returns how many steps the vehicle takes that moves more.
fn most_moves(pattern: &Pattern) -> usize {
    let (mut moves, mut before) = ([0; 2], pattern.start());
    for now in pattern.steps() {
        (0..2).for_each(|which| moves[which] += usize::from(now[which] != before[which]));
        before = now;
    }
    moves[0].max(moves[1])
}

/// Both vehicles' way to where the pattern begins: of both orders and ways round the border that are safe, the ones
/// with the shortest longest way. Gives the plans, the first vehicle of the pattern first, and the sequence of legs.
fn approach(
    pattern: &Pattern,
    request: &PatternRequest,
    to: [LatticePoint; 2],
    [one, other]: [(VehicleId, Point); 2],
) -> Result<(Vec<Plan>, Vec<VehicleId>), SweepError> {
    // The ring refuses an area without an inside.
    let ring = Ring::new(request.area, 4 * (pattern.size() - 1))?;
    let to = to.map(|point| pattern.place(point, request.area));
    let roles = if one.0 < other.0 {
        [one, other]
    } else {
        [other, one]
    };
    let mut best: Option<(f64, Vec<Plan>, Vec<VehicleId>)> = None;
    let mut refused = None;
    for choice in 0..8 {
        let is = |bit: usize| choice >> bit & 1 == 1;
        let mut plans: Vec<Plan> = [0, 1]
            .map(|which: usize| {
                let route = ring.way_between(roles[which].1, to[which], is(which));
                plan_to(request, roles[which], to[which], route, [one.0, other.0])
            })
            .to_vec();
        let mut sequence = vec![roles[0].0, roles[1].0];
        if is(2) {
            sequence.reverse();
        }
        let longest_m = plans
            .iter()
            .flat_map(tracks_of)
            .map(|track| track.length_m())
            .fold(0.0, f64::max);
        match order_legs(&mut plans, &sequence, request.separation_m) {
            // Millimetres of rounding must not decide between equal ways.
            Ok(())
                if best
                    .as_ref()
                    .is_none_or(|(kept_m, ..)| longest_m < kept_m - 1e-3) =>
            {
                best = Some((longest_m, plans, sequence));
            }
            Ok(()) => {}
            Err(error) => refused = Some(error),
        }
    }
    match (best, refused) {
        (Some((_, mut plans, sequence)), _) => {
            // The order of all legs is derived anew at the end.
            plans
                .iter_mut()
                .flat_map(|plan| &mut plan.stops)
                .for_each(|stop| stop.after.clear());
            Ok((plans, sequence))
        }
        (None, Some(error)) => Err(SweepError::Unsafe(error)),
        (None, None) => Err(SweepError::NoApproach),
    }
}

fn plan_to(
    request: &PatternRequest,
    (vehicle, from): (VehicleId, Point),
    to: Point,
    way: Vec<Point>,
    mut members: [VehicleId; 2],
) -> Plan {
    members.sort();
    let mut plan = Plan {
        vehicle,
        run: request.run,
        revision: request.revision,
        members: members.to_vec(),
        start: from.into(),
        ..Plan::default()
    };
    let mut stop = stop_at(StopId(0), to);
    stop.route = way.into_iter().map(Position::from).collect();
    plan.stops.push(stop);
    plan
}

fn stop_at(id: StopId, at: Point) -> Stop {
    let (partners, after) = (Vec::new(), Vec::new());
    Stop {
        id,
        at: at.into(),
        route: Vec::new(),
        dwell_ms: 0,
        dwell_limit_ms: 0,
        partners,
        after,
    }
}

/// One step of a pattern.
#[derive(Clone, Copy)]
struct Step<'a> {
    pattern: &'a Pattern,
    request: &'a PatternRequest,
    number: usize,
    before: [LatticePoint; 2],
    now: [LatticePoint; 2],
}

impl Step<'_> {
    fn moves(&self, which: usize) -> bool {
        self.before[which] != self.now[which]
    }

    /// Returns whether a vehicle leaves the point that the other one enters in this step.
    fn hands_over(&self, which: usize) -> bool {
        self.moves(which) && self.before[which] == self.now[1 - which]
    }
}

/// Adds the stops of one step to the plans of both vehicles, who leaves a point before who enters it.
fn add_step(plans: &mut [Plan], sequence: &mut Vec<VehicleId>, step: Step<'_>) {
    let done = [0, 1].map(|which: usize| plans[which].stops.last().map(|stop| stop.id));
    let order = if step.hands_over(1) { [1, 0] } else { [0, 1] };
    let peers = [plans[1].vehicle, plans[0].vehicle];
    for which in order.into_iter().filter(|which| step.moves(*which)) {
        let at = step.pattern.place(step.now[which], step.request.area);
        let mut stop = stop_at(step_id(step.number), at);
        stop.after
            .extend(done[1 - which].map(|id| (peers[which], id)));
        // Who hands a point over drives on before the other comes, and stands for it at the next step's link.
        if !step.hands_over(which) {
            stop.dwell_ms = step.request.dwell_ms;
            stop.dwell_limit_ms = step.request.dwell_limit_ms;
            stop.partners.push(peers[which]);
        }
        plans[which].stops.push(stop);
        sequence.push(plans[which].vehicle);
    }
}

/// Names the stop of a step: the same in every revision of a run. 0 is the approach.
fn step_id(number: usize) -> StopId {
    StopId(u32::try_from(number + 1).unwrap_or(u32::MAX))
}

fn lap(number: usize, plans: &[Plan], begins: [usize; 2]) -> Lap {
    let driven = plans.iter().zip(begins).filter_map(|(plan, begin)| {
        let stops = plan.stops.get(begin..)?;
        Some((plan.vehicle, stops.first()?.id, stops.last()?.id))
    });
    let mut stops: Vec<_> = driven.collect();
    stops.sort();
    Lap { number, stops }
}

fn finish(
    mut plans: Vec<Plan>,
    sequence: &[VehicleId],
    schedule: Schedule,
    separation_m: f64,
) -> Result<PlannedSweep, SweepError> {
    plans.sort_by_key(|plan| plan.vehicle);
    order_legs(&mut plans, sequence, separation_m)?;
    for stop in plans.iter_mut().flat_map(|plan| &mut plan.stops) {
        // Of several stops of the other the last one is waited for; ids ascend along a plan.
        let last = stop.after.iter().copied().max();
        stop.after = last.into_iter().collect();
    }
    check_separation(&plans, separation_m)?;
    Ok(PlannedSweep { plans, schedule })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::{PatternKind, PlanError, expected_duration_s, validate};
    use proptest::prelude::*;
    use std::collections::BTreeSet;
    use tomoswarm_proto::Message;
    use tomoswarm_proto::codec::{Decoded, decode, encode};

    const KINDS: [PatternKind; 3] = [
        PatternKind::Calibrate,
        PatternKind::Fan,
        PatternKind::FanStraight,
    ];

    fn request(side_m: f64, homes: [Point; 2]) -> PatternRequest {
        PatternRequest {
            run: RunId(1),
            revision: Revision(1),
            vehicles: vec![(VehicleId(1), homes[0]), (VehicleId(2), homes[1])],
            area: Rect::new(Point::new(1.0, 2.0), Point::new(1.0 + side_m, 2.0 + side_m)),
            first_round: 0,
            dwell_ms: 1000,
            dwell_limit_ms: 10_000,
            separation_m: 1.0,
        }
    }

    fn homes() -> [Point; 2] {
        [Point::new(1.0, 0.5), Point::new(3.0, 0.5)]
    }

    /// The links of a pattern, as unordered pairs of lattice points.
    fn links(pattern: &Pattern) -> BTreeSet<[LatticePoint; 2]> {
        pattern.steps().map(|[a, b]| [a.min(b), a.max(b)]).collect()
    }

    /// Drives plans leg after leg, whoever may go next being chosen by a list of numbers; returns for each stay the points
    /// of both vehicles.
    fn driven(
        sweep: &PlannedSweep,
        pattern: &Pattern,
        area: Rect,
        choices: &[u8],
    ) -> BTreeSet<[LatticePoint; 2]> {
        let border: Vec<LatticePoint> = pattern
            .steps()
            .flatten()
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect();
        let on = |at: Point| {
            *border
                .iter()
                .find(|p| pattern.place(**p, area).distance_to(at) < 1e-9)
                .unwrap()
        };
        let (mut done, mut met, mut turn) = ([0usize; 2], BTreeSet::new(), 0);
        let may_go = |done: [usize; 2], which: usize| {
            let Some(stop) = sweep.plans[which].stops.get(done[which]) else {
                return false;
            };
            let other = &sweep.plans[1 - which].stops[..done[1 - which]];
            stop.after
                .iter()
                .all(|(_, id)| other.iter().any(|stop| stop.id == *id))
        };
        loop {
            let can: Vec<usize> = [0, 1]
                .into_iter()
                .filter(|which| may_go(done, *which))
                .collect();
            let Some(which) =
                can.get(usize::from(choices[turn % choices.len()]) % can.len().max(1))
            else {
                break;
            };
            turn += 1;
            done[*which] += 1;
            let stop = &sweep.plans[*which].stops[done[*which] - 1];
            if stop.dwell_ms > 0 {
                let peer = sweep.plans[1 - which].stops[done[1 - which] - 1].at;
                let (a, b) = (on(stop.at.into()), on(peer.into()));
                met.insert([a.min(b), a.max(b)]);
            }
        }
        let all = [0, 1].map(|which: usize| sweep.plans[which].stops.len());
        assert_eq!(done, all, "everything is driven");
        met
    }

    #[test]
    fn a_pattern_takes_up_where_it_was_left() {
        for kind in KINDS {
            let pattern = Pattern::new(kind, 6).unwrap();
            let whole = pattern_sweep(&pattern, &request(10.0, homes())).unwrap();
            let rest = PatternRequest {
                first_round: 2,
                ..request(10.0, homes())
            };
            let rest = pattern_sweep(&pattern, &rest).unwrap();
            assert_eq!(rest.schedule.laps, whole.schedule.laps[2..], "{kind}");
            assert_eq!(rest.schedule.laps.len(), pattern.round_count() - 2);
        }
    }

    #[test]
    fn a_fan_straight_of_the_original_takes_about_its_time() {
        let pattern = Pattern::new(PatternKind::FanStraight, 20).unwrap();
        let sweep = pattern_sweep(&pattern, &request(20.0, homes())).unwrap();
        // 12 passes of 19 steps of 20/19 m at 0.5 m/s with 1 s each, and the second's 21 m to its corner.
        let expected_s = 12.0 * 19.0 * (20.0 / 19.0 / 0.5 + 1.0);
        let got_s = expected_duration_s(&sweep.plans, 0.5).unwrap();
        assert!(
            (got_s - expected_s - 40.0).abs() < 5.0,
            "{got_s} for {expected_s}"
        );
    }

    #[test]
    fn the_largest_plan_still_travels() {
        let planned = |size: usize| {
            let pattern = Pattern::new(PatternKind::Calibrate, size).unwrap();
            pattern_sweep(&pattern, &request(1.2 * (size - 1) as f64, homes()))
        };
        let sweep = planned(22).unwrap();
        for plan in &sweep.plans {
            let message = Message::Plan(plan.clone());
            let bytes = encode(&message).unwrap();
            let read = decode(&bytes).unwrap();
            assert_eq!(
                read,
                Decoded::Message(message),
                "{} stops, {} bytes",
                plan.stops.len(),
                bytes.len()
            );
        }
        assert_eq!(
            planned(60).unwrap_err(),
            SweepError::TooManyStops {
                stops: 118 * 234 + 1,
                limit: 4096
            }
        );
    }

    #[test]
    fn what_cannot_be_driven_is_refused() {
        let pattern = Pattern::new(PatternKind::Fan, 5).unwrap();
        let base = request(10.0, homes());
        let refused = |request: &PatternRequest| pattern_sweep(&pattern, request).unwrap_err();
        let one = PatternRequest {
            vehicles: base.vehicles[..1].to_vec(),
            ..base.clone()
        };
        assert_eq!(refused(&one), SweepError::NotTwo { vehicles: 1 });
        let twice = PatternRequest {
            vehicles: vec![base.vehicles[0]; 2],
            ..base.clone()
        };
        assert_eq!(
            refused(&twice),
            SweepError::Vehicle {
                vehicle: VehicleId(1)
            }
        );
        let over = PatternRequest {
            first_round: 4,
            ..base.clone()
        };
        assert!(matches!(refused(&over), SweepError::Laps { .. }));
        let narrow = PatternRequest {
            separation_m: 2.6,
            ..request(10.0, [Point::new(1.0, 0.5), Point::new(9.0, 0.5)])
        };
        assert!(matches!(
            refused(&narrow),
            SweepError::Unsafe(PlanError::TooClose { .. })
        ));
        assert!(matches!(
            refused(&request(0.0, homes())),
            SweepError::EmptyArea { .. }
        ));
        assert!(matches!(
            refused(&request(10.0, [homes()[0]; 2])),
            SweepError::Unsafe(_)
        ));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        #[test]
        fn every_pattern_is_safe_and_measures_its_links_in_any_order(
            which in 0..3usize, size in 2..8usize, choices in proptest::collection::vec(any::<u8>(), 1..40),
            share in 0.0..1.0f64, y_m in -3.0..0.5f64, apart_m in 1.1..8.0f64,
        ) {
            let pattern = Pattern::new(KINDS[which], size).unwrap();
            let side_m = 1.2 * (size - 1) as f64;
            let home = Point::new(1.0 + share * side_m, y_m);
            let request = request(side_m, [home, Point::new(home.x_m + apart_m, y_m)]);
            let sweep = pattern_sweep(&pattern, &request).unwrap();
            validate(&sweep.plans).unwrap();
            let met = driven(&sweep, &pattern, request.area, &choices);
            let missing: Vec<_> = links(&pattern).difference(&met).copied().collect();
            prop_assert!(missing.is_empty(), "{missing:?}");
        }
    }
}
