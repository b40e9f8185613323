//! The round-robin fan, for comparison: one vehicle stands, the others drive around the area and stop
//! at every position to measure with it; then it moves on by one position, and the others drive back.
//!
//! On the ring nobody can pass another, so the rounds go counter-clockwise and clockwise in turn. With
//! two persons in a courtyard it reached 5 % in 20 minutes where [`super::rotating_gap`] reached 100 %:
//! links in a row all meet in one place. It measures while standing only.

use tomoswarm_proto::{Plan, Revision, RunId, StopId, VehicleId};

use super::approach::{ApproachFleet, MIN_GAP, Walk, approach, check_fleet};
use super::schedule::check_stops;
use super::{Lap, PlannedSweep, Ring, Schedule, SweepError, check_separation, order_legs};
use crate::geom::Point;

/// What is wished of the planner.
#[derive(Clone, PartialEq, Debug)]
pub struct FanRequest {
    /// Of which run the plans are.
    pub run: RunId,
    /// Of which revision the plans are.
    pub revision: Revision,
    /// The vehicles (2 to 8) and where they stand, local frame.
    pub vehicles: Vec<(VehicleId, Point)>,
    /// How many rounds, 1 to the number of positions.
    pub rounds: usize,
    /// How long to stay at each position, milliseconds.
    pub dwell_ms: u32,
    /// How long to stay at most when the standing one is not there, milliseconds.
    pub dwell_limit_ms: u32,
    /// How far apart (middle to middle, metres) the vehicles must be at any time.
    pub separation_m: f64,
}

/// Plans a fan, from where the vehicles stand; the rearmost becomes the one that stands.
///
/// # Errors
/// Too few or too many vehicles, too small a ring, no rounds, or a place or area in which it cannot be
/// driven safely.
pub fn fan(ring: &Ring, request: &FanRequest) -> Result<PlannedSweep, SweepError> {
    let fleet = ApproachFleet {
        vehicles: &request.vehicles,
        run: request.run,
        revision: request.revision,
        separation_m: request.separation_m,
    };
    check_fleet(ring, fleet)?;
    let limit = ring.positions();
    if !(1..=limit).contains(&request.rounds) {
        return Err(SweepError::Laps {
            first: 0,
            end: request.rounds,
            limit,
        });
    }
    let offsets: Vec<i64> = (0..request.vehicles.len() as i64)
        .map(|k| k * MIN_GAP)
        .collect();
    let mut rounds = Rounds::new(ring, request, approach(ring, fleet, &offsets)?);
    for round in 0..request.rounds {
        if round > 0 {
            rounds.move_on(round);
        }
        rounds.drive(round);
    }
    rounds.finish(request.separation_m)
}

/// The walks of all vehicles, the standing one first, while rounds are added.
struct Rounds<'a> {
    ring: &'a Ring,
    request: &'a FanRequest,
    walks: Vec<Walk>,
    /// Whose next leg is driven, move by move, in an order in which all can be driven one at a time.
    sequence: Vec<VehicleId>,
    schedule: Schedule,
}

impl<'a> Rounds<'a> {
    fn new(ring: &'a Ring, request: &'a FanRequest, mut walks: Vec<Walk>) -> Rounds<'a> {
        let mut sequence = Vec::new();
        for walk in walks.iter_mut().rev() {
            sequence.extend(std::iter::repeat_n(
                walk.plan.vehicle,
                walk.plan.stops.len(),
            ));
            // The order of all legs is derived anew at the end.
            walk.plan
                .stops
                .iter_mut()
                .for_each(|stop| stop.after.clear());
        }
        Rounds {
            ring,
            request,
            walks,
            sequence,
            schedule: Schedule::default(),
        }
    }

    /// Lets the standing vehicle go one position forward, once all others have ended the round.
    fn move_on(&mut self, round: usize) {
        let ended: Vec<_> = self.walks[1..].iter().filter_map(last_stop).collect();
        let walk = &mut self.walks[0];
        walk.step_forward(self.ring, stop_id(self.ring, round, 0));
        if let Some(stop) = walk.plan.stops.last_mut() {
            stop.after.extend(ended);
        }
        self.sequence.push(walk.plan.vehicle);
    }

    /// Drives all but the standing one around: forward in even rounds, backward in odd ones.
    fn drive(&mut self, round: usize) {
        let stands = last_stop(&self.walks[0]);
        let begins: Vec<usize> = self
            .walks
            .iter()
            .map(|walk| walk.plan.stops.len())
            .collect();
        let count = self.walks.len();
        let base = self.walks[0].at;
        let forward = round.is_multiple_of(2);
        let steps = if forward {
            base + self.ring.positions() as i64 - MIN_GAP - self.walks[count - 1].at
        } else {
            // One more than the least gap, so that the standing one can move on.
            self.walks[1].at - (base + MIN_GAP + 1)
        };
        for step in 0..steps {
            for turn in 1..count {
                let k = if forward { count - turn } else { turn };
                self.drive_one(k, stop_id(self.ring, round, step), forward);
            }
        }
        for (walk, begin) in self.walks.iter_mut().zip(&begins).skip(1) {
            if let Some(first) = walk.plan.stops.get_mut(*begin) {
                first.after.extend(stands);
            }
        }
        let ends = |(walk, begin): (&Walk, &usize)| {
            let stops = walk.plan.stops.get(*begin..)?;
            Some((walk.plan.vehicle, stops.first()?.id, stops.last()?.id))
        };
        let mut stops: Vec<_> = self.walks.iter().zip(&begins).filter_map(ends).collect();
        stops.sort();
        self.schedule.laps.push(Lap {
            number: round,
            stops,
        });
    }

    fn drive_one(&mut self, k: usize, id: StopId, forward: bool) {
        let stands = self.walks[0].plan.vehicle;
        let walk = &mut self.walks[k];
        if forward {
            walk.step_forward(self.ring, id);
        } else {
            walk.step_backward(self.ring, id);
        }
        if let Some(stop) = walk.plan.stops.last_mut() {
            stop.dwell_ms = self.request.dwell_ms;
            stop.dwell_limit_ms = self.request.dwell_limit_ms;
            stop.partners.push(stands);
        }
        self.sequence.push(walk.plan.vehicle);
    }

    fn finish(self, separation_m: f64) -> Result<PlannedSweep, SweepError> {
        let mut plans: Vec<Plan> = self.walks.into_iter().map(|walk| walk.plan).collect();
        plans.sort_by_key(|plan| plan.vehicle);
        check_stops(&plans)?;
        order_legs(&mut plans, &self.sequence, separation_m)?;
        for stop in plans.iter_mut().flat_map(|plan| &mut plan.stops) {
            stop.after.sort();
            stop.after.dedup();
        }
        check_separation(&plans, separation_m)?;
        Ok(PlannedSweep {
            plans,
            schedule: self.schedule,
        })
    }
}

fn last_stop(walk: &Walk) -> Option<(VehicleId, StopId)> {
    walk.plan
        .stops
        .last()
        .map(|stop| (walk.plan.vehicle, stop.id))
}

/// Names a stop: the same in every revision of a run. Ids below twice the ring are approach stops.
fn stop_id(ring: &Ring, round: usize, step: i64) -> StopId {
    let number = (round as i64 + 1) * 2 * ring.positions() as i64 + step;
    StopId(u32::try_from(number).unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Rect;

    fn plan(count: u8, rounds: usize) -> (Ring, PlannedSweep) {
        let ring = Ring::new(Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 20.0)), 76).unwrap();
        let vehicles = (0..count)
            .map(|k| (VehicleId(k), Point::new(2.0 * f64::from(k), -1.0)))
            .collect();
        let request = FanRequest {
            run: RunId(1),
            revision: Revision(1),
            vehicles,
            rounds,
            dwell_ms: 2000,
            dwell_limit_ms: 10_000,
            separation_m: 1.2,
        };
        let sweep = fan(&ring, &request).unwrap();
        (ring, sweep)
    }

    #[test]
    fn every_fleet_has_a_safe_fan() {
        for count in 2..=8 {
            let (_, sweep) = plan(count, 5);
            check_separation(&sweep.plans, 1.2).unwrap();
            assert_eq!(sweep.schedule.laps.len(), 5);
        }
    }

    #[test]
    fn one_stands_while_the_other_measures_from_nearly_everywhere() {
        let (ring, sweep) = plan(2, 6);
        let [stands, drives] = &sweep.plans[..] else {
            panic!("two plans")
        };
        let measured: Vec<usize> = drives
            .stops
            .iter()
            .filter(|s| s.dwell_ms > 0)
            .map(|s| ring.nearest(s.at.into()))
            .collect();
        assert!(measured.len() >= 6 * 65, "{}", measured.len());
        assert!(
            drives
                .stops
                .iter()
                .all(|stop| stop.dwell_ms == 0 || stop.partners == [stands.vehicle])
        );
        assert_eq!(
            stands.stops.iter().filter(|stop| stop.id.0 >= 152).count(),
            5
        );
    }

    #[test]
    fn a_fan_without_rounds_is_refused() {
        let ring = Ring::new(Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 20.0)), 76).unwrap();
        let vehicles = vec![
            (VehicleId(1), Point::new(0.0, 0.0)),
            (VehicleId(2), Point::new(5.0, 0.0)),
        ];
        let request = FanRequest {
            run: RunId(1),
            revision: Revision(1),
            vehicles,
            rounds: 0,
            dwell_ms: 0,
            dwell_limit_ms: 0,
            separation_m: 1.2,
        };
        assert!(matches!(fan(&ring, &request), Err(SweepError::Laps { .. })));
    }
}
