//! The sweep by laps at a constant gap: all vehicles drive counter-clockwise around the area and
//! measure on the way; between laps some wait while others go ahead, so that the gaps change.
//!
//! A lap at gap g never crosses the area inside its caustic, so the gaps are varied from the full half
//! ring downward and up again. Two vehicles on 76 positions use gaps of 38, 36, 33, 30, 26, 22, 35 and
//! 28 steps: with approach and shifts 680 steps, 25 minutes at 0.48 m/s around 20 m × 20 m. More vehicles start evenly
//! spaced; in lap j the k-th is k·s_j steps nearer to the rearmost, s = 0, 2, 5, 8, 12, 16, 3, 10 (the same numbers that
//! give two vehicles their gaps), as far as they stay 4 steps apart. Since every lap then brings N − 1 different gaps,
//! fewer laps do: 8, 7, 7, 6, 5, 4, 4 for 2 to 8 vehicles ([`default_laps`]).
//!
//! **Precedence.** (a) Every step waits until the vehicle ahead is at least 4 steps ahead of where it
//! leads; (b) within a lap, stop i waits until all others have done their stop i − 2, so that gaps hold
//! within two steps; (c) a lap begins when all have taken their places for it. The result is proven by
//! [`check_separation`] before it is handed out. Ways around obstacles are not known here.

use tomoswarm_proto::{Revision, RunId, StopId, VehicleId};

use super::approach::{ApproachFleet, MIN_GAP, Walk, approach, check_fleet};
use super::schedule::check_stops;
use super::{Lap, PlannedSweep, Ring, Schedule, SweepError, check_separation};
use crate::geom::Point;

/// By how many steps the gaps of each lap are shorter than even ones, on a ring of 76.
const SHIFTS: [i64; 8] = [0, 2, 5, 8, 12, 16, 3, 10];
/// The ring for which [`SHIFTS`] are given.
const SHIFTS_RING: i64 = 76;
/// Most laps of a sweep: longer ones repeat their gaps.
const MAX_LAPS: usize = 64;

/// What is wished of the planner.
#[derive(Clone, PartialEq, Debug)]
pub struct GapRequest {
    /// Of which run the plans are.
    pub run: RunId,
    /// Of which revision the plans are.
    pub revision: Revision,
    /// The vehicles (2 to 8) and where they stand, local frame.
    pub vehicles: Vec<(VehicleId, Point)>,
    /// First lap to drive, from 0; higher when a sweep is planned anew.
    pub first_lap: usize,
    /// The lap behind the last; usually [`default_laps`].
    pub end_lap: usize,
    /// How far apart (middle to middle, metres) the vehicles must be at any time.
    pub separation_m: f64,
}

/// Returns the number of laps of a whole sweep: all gaps that fit, 8 for two vehicles, at most 7 for more.
pub fn default_laps(positions: usize, vehicles: usize) -> usize {
    let longest = if vehicles > 2 { 7 } else { 8 };
    shifts(positions, vehicles).len().min(longest)
}

/// The shifts that keep even gaps at 4 steps or more, scaled to the ring.
fn shifts(positions: usize, vehicles: usize) -> Vec<i64> {
    let largest = (positions / vehicles.max(1)) as i64 - MIN_GAP;
    let mut fitting: Vec<i64> = Vec::with_capacity(SHIFTS.len());
    for shift in SHIFTS {
        let scaled = (shift * positions as i64 + SHIFTS_RING / 2) / SHIFTS_RING;
        if (scaled == 0 || scaled <= largest) && !fitting.contains(&scaled) {
            fitting.push(scaled);
        }
    }
    fitting
}

fn shift_of_lap(positions: usize, vehicles: usize, lap: usize) -> i64 {
    let shifts = shifts(positions, vehicles);
    shifts[lap % shifts.len()]
}

/// How far each vehicle is ahead of the rearmost in a lap, steps.
fn offsets(positions: usize, vehicles: usize, lap: usize) -> Vec<i64> {
    let shift = shift_of_lap(positions, vehicles, lap);
    let even = |k: usize| ((k * positions + vehicles / 2) / vehicles.max(1)) as i64;
    (0..vehicles).map(|k| even(k) - k as i64 * shift).collect()
}

/// Plans a sweep by laps at a constant gap, from where the vehicles stand.
///
/// # Errors
/// Too few or too many vehicles, too small a ring, no laps, or a place or area in which it cannot be
/// driven safely.
pub fn rotating_gap(ring: &Ring, request: &GapRequest) -> Result<PlannedSweep, SweepError> {
    let fleet = ApproachFleet {
        vehicles: &request.vehicles,
        run: request.run,
        revision: request.revision,
        separation_m: request.separation_m,
    };
    check_fleet(ring, fleet)?;
    let (first, end) = (request.first_lap, request.end_lap);
    if first >= end || end > MAX_LAPS {
        return Err(SweepError::Laps {
            first,
            end,
            limit: MAX_LAPS,
        });
    }
    let count = request.vehicles.len();
    let walks = approach(ring, fleet, &offsets(ring.positions(), count, first))?;
    let mut laps = Laps::new(ring, walks);
    for lap in first..end {
        if lap > first {
            laps.shift(lap);
        }
        laps.drive(lap);
    }
    let sweep = laps.finish();
    check_stops(&sweep.plans)?;
    check_separation(&sweep.plans, request.separation_m)?;
    Ok(sweep)
}

/// The walks of all vehicles, from the rearmost forward, while laps are added.
struct Laps<'a> {
    ring: &'a Ring,
    walks: Vec<Walk>,
    /// Per vehicle: number of stops when its current lap begins.
    begins: Vec<usize>,
    /// Per vehicle and other: how many stops of the other are waited for already.
    waited: Vec<Vec<usize>>,
    schedule: Schedule,
}

impl<'a> Laps<'a> {
    fn new(ring: &'a Ring, walks: Vec<Walk>) -> Laps<'a> {
        let count = walks.len();
        Laps {
            ring,
            walks,
            begins: vec![0; count],
            waited: vec![vec![0; count]; count],
            schedule: Schedule::default(),
        }
    }

    /// Adds the steps by which the gaps change to those of `lap`, always forward.
    fn shift(&mut self, lap: usize) {
        let (positions, count) = (self.ring.positions(), self.walks.len());
        let by = shift_of_lap(positions, count, lap) - shift_of_lap(positions, count, lap - 1);
        let from: Vec<usize> = self
            .walks
            .iter()
            .map(|walk| walk.plan.stops.len())
            .collect();
        for (k, walk) in self.walks.iter_mut().enumerate() {
            let steps = if by > 0 {
                (count - 1 - k) as i64 * by
            } else {
                k as i64 * -by
            };
            for step in 0..steps {
                walk.step_forward(self.ring, stop_id(positions, lap, positions as i64 + step));
            }
        }
        for (k, first) in from.into_iter().enumerate() {
            for stop in first..self.walks[k].plan.stops.len() {
                self.wait_for_the_one_ahead(k, stop);
            }
        }
    }

    /// Adds one whole lap for every vehicle.
    fn drive(&mut self, lap: usize) {
        let positions = self.ring.positions();
        self.begins = self
            .walks
            .iter()
            .map(|walk| walk.plan.stops.len())
            .collect();
        for walk in &mut self.walks {
            for step in 0..positions {
                walk.step_forward(self.ring, stop_id(positions, lap, step as i64));
            }
        }
        for k in 0..self.walks.len() {
            for step in 0..positions {
                for other in (0..self.walks.len()).filter(|other| *other != k) {
                    // The first two stops wait for the others' places at the begin of the lap.
                    self.wait(
                        k,
                        self.begins[k] + step,
                        other,
                        self.begins[other] + step.saturating_sub(1),
                    );
                }
                self.wait_for_the_one_ahead(k, self.begins[k] + step);
            }
        }
        self.schedule.laps.push(self.lap(lap));
    }

    fn lap(&self, number: usize) -> Lap {
        let ends = |(walk, begin): (&Walk, &usize)| {
            let stops = &walk.plan.stops[*begin..];
            Some((walk.plan.vehicle, stops.first()?.id, stops.last()?.id))
        };
        let mut stops: Vec<_> = self
            .walks
            .iter()
            .zip(&self.begins)
            .filter_map(ends)
            .collect();
        stops.sort();
        Lap { number, stops }
    }

    /// Lets a stop wait until the vehicle ahead is 4 steps ahead of it.
    fn wait_for_the_one_ahead(&mut self, k: usize, stop: usize) {
        let count = self.walks.len();
        let lapped = if k + 1 == count {
            self.ring.positions() as i64
        } else {
            0
        };
        let needed = self.walks[k].unrolled[stop] + MIN_GAP - lapped;
        let ahead = (k + 1) % count;
        let walk = &self.walks[ahead];
        let before = walk.unrolled.partition_point(|at| *at < needed);
        let starts_there = walk.unrolled.first().is_none_or(|at| *at > needed);
        if !(before == 0 && starts_there) {
            self.wait(k, stop, ahead, before + 1);
        }
    }

    /// Lets a stop wait until another vehicle has done so many stops, unless an earlier stop does.
    fn wait(&mut self, k: usize, stop: usize, other: usize, done: usize) {
        if done <= self.waited[k][other] {
            return;
        }
        let Some(last) = self.walks[other].plan.stops.get(done - 1) else {
            return;
        };
        let after = (self.walks[other].plan.vehicle, last.id);
        self.walks[k].plan.stops[stop].after.push(after);
        self.waited[k][other] = done;
    }

    fn finish(self) -> PlannedSweep {
        let mut plans: Vec<_> = self.walks.into_iter().map(|walk| walk.plan).collect();
        plans.sort_by_key(|plan| plan.vehicle);
        PlannedSweep {
            plans,
            schedule: self.schedule,
        }
    }
}

/// Names a stop: the same in every revision of a run. Ids below twice the ring are approach stops.
fn stop_id(positions: usize, lap: usize, step: i64) -> StopId {
    let number = (lap as i64 + 1) * 2 * positions as i64 + step;
    StopId(u32::try_from(number).unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Rect;
    use crate::sweep::{expected_duration_s, has_done};
    use tomoswarm_proto::Plan;

    fn square(side_m: f64, positions: usize) -> Ring {
        Ring::new(
            Rect::new(Point::new(0.0, 0.0), Point::new(side_m, side_m)),
            positions,
        )
        .unwrap()
    }

    /// Homes in a row a little south of the ring, every other vehicle numbered from the far end.
    fn homes(count: usize) -> Vec<(VehicleId, Point)> {
        let number = |k: usize| if k.is_multiple_of(2) { k + 1 } else { 20 - k };
        (0..count)
            .map(|k| {
                (
                    VehicleId(number(k) as u8),
                    Point::new(1.0 + 2.0 * k as f64, -1.0),
                )
            })
            .collect()
    }

    fn request(vehicles: Vec<(VehicleId, Point)>, laps: std::ops::Range<usize>) -> GapRequest {
        GapRequest {
            run: RunId(1),
            revision: Revision(1),
            vehicles,
            first_lap: laps.start,
            end_lap: laps.end,
            separation_m: 1.2,
        }
    }

    /// The ring position of every stop, found from its coordinates alone.
    fn indices(ring: &Ring, plan: &Plan) -> Vec<usize> {
        plan.stops
            .iter()
            .map(|stop| ring.nearest(stop.at.into()))
            .collect()
    }

    #[test]
    fn two_vehicles_drive_the_gaps_that_found_both_persons() {
        let ring = square(20.0, 76);
        let sweep = rotating_gap(&ring, &request(homes(2), 0..8)).unwrap();
        let [one, other] = &sweep.plans[..] else {
            panic!("two plans")
        };
        let mut gaps = Vec::new();
        for lap in &sweep.schedule.laps {
            let [(_, first, last), (_, other_first, other_last)] = lap.stops[..] else {
                panic!("two ends")
            };
            let at =
                |plan: &Plan, id: StopId| plan.stops.iter().position(|stop| stop.id == id).unwrap();
            assert_eq!(at(one, last) - at(one, first) + 1, 76);
            assert_eq!(at(other, other_last) - at(other, other_first) + 1, 76);
            let here = indices(&ring, one)[at(one, first)];
            let there = indices(&ring, other)[at(other, other_first)];
            gaps.push(ring.steps_between(here, there));
        }
        assert_eq!(gaps, [38, 36, 33, 30, 26, 22, 35, 28]);
        let minutes = expected_duration_s(&sweep.plans, 0.45).unwrap() / 60.0;
        assert!((23.0..27.0).contains(&minutes), "{minutes}");
    }

    #[test]
    fn any_delays_leave_four_steps_between_all_vehicles() {
        for count in 2..=8 {
            let ring = square(20.0, 76);
            let laps = default_laps(76, count);
            let sweep = rotating_gap(&ring, &request(homes(count), 0..laps)).unwrap();
            for seed in 0..6 {
                drive_at_random(&ring, &sweep.plans, seed);
            }
        }
    }

    /// Enters legs in a random order that `after` allows, and looks at the steps between all vehicles
    /// that are on the ring and past their first approach.
    fn drive_at_random(ring: &Ring, plans: &[Plan], seed: u64) {
        let indices: Vec<Vec<usize>> = plans.iter().map(|plan| indices(ring, plan)).collect();
        let lap_begins: Vec<usize> = plans
            .iter()
            .map(|p| p.stops.iter().position(|s| s.id.0 >= 152).unwrap())
            .collect();
        let mut done = vec![0; plans.len()];
        let mut dice = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        loop {
            let is_done = |vehicle: VehicleId, id: StopId| {
                let of = plans
                    .iter()
                    .position(|plan| plan.vehicle == vehicle)
                    .unwrap();
                plans[of].stops[..done[of]].iter().any(|stop| stop.id == id)
            };
            let ready: Vec<usize> = (0..plans.len())
                .filter(|k| {
                    plans[*k]
                        .stops
                        .get(done[*k])
                        .is_some_and(|s| s.after.iter().all(|a| is_done(a.0, a.1)))
                })
                .collect();
            if ready.is_empty() {
                break;
            }
            dice ^= dice << 13;
            dice ^= dice >> 7;
            dice ^= dice << 17;
            // A skewed choice lets single vehicles run as far ahead as they may.
            let k = if dice % 100 < 90 {
                ready[(seed as usize) % ready.len()]
            } else {
                ready[dice as usize % ready.len()]
            };
            done[k] += 1;
            if (0..plans.len()).all(|k| done[k] >= lap_begins[k]) {
                for (one, other) in (0..plans.len()).flat_map(|a| (0..a).map(move |b| (a, b))) {
                    let at = |k: usize| indices[k][done[k].max(1) - 1];
                    let steps = ring.steps_between(at(one), at(other));
                    assert!(
                        steps >= 4,
                        "{} vehicles, seed {seed}: {steps} steps",
                        plans.len()
                    );
                }
            }
        }
        assert!(
            (0..plans.len()).all(|k| done[k] == plans[k].stops.len()),
            "{} vehicles wait for ever",
            plans.len()
        );
    }

    #[test]
    fn a_sweep_of_any_fleet_takes_about_as_long() {
        for count in 2..=8 {
            let laps = default_laps(76, count);
            let sweep = rotating_gap(&square(20.0, 76), &request(homes(count), 0..laps)).unwrap();
            let minutes = expected_duration_s(&sweep.plans, 0.45).unwrap() / 60.0;
            assert!(
                (10.0..28.0).contains(&minutes),
                "{count} vehicles: {minutes}"
            );
            println!("{count} vehicles: {laps} laps, {minutes:.1} minutes");
            assert_eq!(sweep.schedule.laps.len(), laps);
        }
    }

    #[test]
    fn other_rings_and_areas_can_be_swept() {
        for (width_m, height_m, positions) in
            [(30.0, 12.0, 60), (40.0, 40.0, 152), (25.0, 18.0, 41)]
        {
            let area = Rect::new(
                Point::new(-5.0, 3.0),
                Point::new(width_m - 5.0, 3.0 + height_m),
            );
            let ring = Ring::new(area, positions).unwrap();
            let places: Vec<_> = (0..4)
                .map(|k| (VehicleId(k), ring.position(usize::from(k) * 11 + 3)))
                .collect();
            let laps = default_laps(positions, 4);
            assert!(laps >= 3);
            rotating_gap(&ring, &request(places, 0..laps)).unwrap();
        }
    }

    #[test]
    fn a_sweep_planned_anew_goes_on_with_its_lap() {
        let ring = square(20.0, 76);
        let anywhere = vec![
            (VehicleId(4), Point::new(20.0, 7.3)),
            (VehicleId(2), Point::new(3.0, 20.0)),
        ];
        let sweep = rotating_gap(&ring, &request(anywhere, 5..8)).unwrap();
        let whole = rotating_gap(&ring, &request(homes(2), 0..8)).unwrap();
        assert_eq!(sweep.schedule.laps[0].number, 5);
        let ends = |sweep: &PlannedSweep, lap: usize| {
            sweep.schedule.laps[lap]
                .stops
                .iter()
                .map(|s| s.2)
                .collect::<Vec<_>>()
        };
        assert_eq!(ends(&sweep, 0), ends(&whole, 5));
        assert_eq!(sweep.plans[0].vehicle, VehicleId(2));
    }

    #[test]
    fn vehicles_that_stand_at_a_right_gap_begin_at_once() {
        let ring = square(20.0, 76);
        let placed = vec![
            (VehicleId(1), ring.position(50)),
            (VehicleId(2), ring.position(12)),
        ];
        let sweep = rotating_gap(&ring, &request(placed, 0..2)).unwrap();
        for plan in &sweep.plans {
            assert_eq!(plan.stops.first().map(|stop| stop.id), Some(StopId(152)));
        }
        let beside = vec![
            (VehicleId(1), Point::new(-1.0, 10.0)),
            (VehicleId(2), Point::new(20.5, 9.0)),
        ];
        let sweep = rotating_gap(&ring, &request(beside, 0..2)).unwrap();
        assert!(
            sweep
                .plans
                .iter()
                .all(|plan| plan.stops.iter().take_while(|s| s.id.0 < 152).count() <= 3)
        );
    }

    #[test]
    fn laps_are_done_when_all_have_ended_them() {
        let sweep = rotating_gap(&square(20.0, 76), &request(homes(2), 0..3)).unwrap();
        let report = |plan: &Plan, done: u32| crate::sweep::VehicleProgress {
            vehicle: plan.vehicle,
            run: plan.run,
            revision: plan.revision,
            done: Some(StopId(done)),
            ..Default::default()
        };
        let laps_done = |progress: [crate::sweep::VehicleProgress; 2]| {
            let has_ended = |(vehicle, _, last): &(VehicleId, StopId, StopId)| {
                let at = sweep
                    .plans
                    .iter()
                    .position(|plan| plan.vehicle == *vehicle)
                    .unwrap();
                has_done(&sweep.plans[at], &progress[at], *last)
            };
            let laps = sweep.schedule.laps.iter();
            laps.take_while(|lap| lap.stops.iter().all(has_ended))
                .count()
        };
        let laps = |one: u32, other: u32| {
            laps_done([report(&sweep.plans[0], one), report(&sweep.plans[1], other)])
        };
        assert_eq!(
            [
                laps(226, 227),
                laps(227, 227),
                laps(304, 227),
                laps(379, 380 + 76),
                laps(531, 531)
            ],
            [0, 1, 1, 2, 3]
        );
        let mut stale = report(&sweep.plans[0], 531);
        stale.revision = Revision(0);
        assert_eq!(laps_done([stale, report(&sweep.plans[1], 531)]), 0);
    }

    #[test]
    fn what_cannot_be_swept_is_said() {
        let ring = square(20.0, 76);
        let error = |ring: &Ring, vehicles, laps| {
            rotating_gap(ring, &request(vehicles, laps))
                .map(drop)
                .unwrap_err()
        };
        assert_eq!(
            error(&ring, homes(1), 0..8),
            SweepError::Vehicles { vehicles: 1 }
        );
        assert_eq!(
            error(&ring, homes(9), 0..8),
            SweepError::Vehicles { vehicles: 9 }
        );
        assert!(matches!(
            error(&square(20.0, 30), homes(7), 0..2),
            SweepError::RingTooSmall { .. }
        ));
        assert!(matches!(
            error(&ring, homes(2), 3..3),
            SweepError::Laps { .. }
        ));
        assert!(matches!(
            error(&square(1.0, 76), homes(2), 0..8),
            SweepError::Unsafe(_)
        ));
        let twice = vec![homes(2)[0], homes(2)[0]];
        assert!(matches!(
            error(&ring, twice, 0..8),
            SweepError::Vehicle { .. }
        ));
        let close = vec![
            (VehicleId(1), Point::new(1.0, -1.0)),
            (VehicleId(2), Point::new(1.5, -1.0)),
        ];
        assert!(matches!(error(&ring, close, 0..8), SweepError::Unsafe(_)));
    }
}
