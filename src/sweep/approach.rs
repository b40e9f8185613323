//! Brings vehicles from where they stand to their first positions on the ring, in the order in which
//! they stand around the area, so that none has to pass another.

use tomoswarm_proto::{Plan, Position, Revision, RunId, Stop, StopId, VehicleId};

use super::{Ring, SweepError, order_legs};
use crate::geom::Point;

/// Steps that vehicles on the ring keep from each other.
pub(super) const MIN_GAP: i64 = 4;

/// One vehicle's way to its first position; positions are unrolled: they grow with every step driven.
#[derive(Clone, Copy, Debug)]
struct Way {
    vehicle: VehicleId,
    place: Point,
    entry: i64,
    slot: i64,
}

/// A vehicle's plan under construction, with the unrolled ring position of every stop.
#[derive(Clone, Debug)]
pub(super) struct Walk {
    pub(super) plan: Plan,
    /// Unrolled position of each stop.
    pub(super) unrolled: Vec<i64>,
    /// Unrolled position reached last.
    pub(super) at: i64,
}

impl Walk {
    /// Adds one step forward along the ring, without dwell.
    pub(super) fn step_forward(&mut self, ring: &Ring, id: StopId) {
        let corners = ring.corners_after(index_on(ring, self.at));
        let route = corners.into_iter().map(Position::from).collect();
        self.push(ring, id, self.at + 1, route);
    }

    /// Adds one step backward along the ring, without dwell.
    pub(super) fn step_backward(&mut self, ring: &Ring, id: StopId) {
        let corners = ring.corners_after(index_on(ring, self.at - 1));
        let route = corners.into_iter().rev().map(Position::from).collect();
        self.push(ring, id, self.at - 1, route);
    }

    fn push(&mut self, ring: &Ring, id: StopId, unrolled: i64, route: Vec<Position>) {
        let at = ring.position(index_on(ring, unrolled)).into();
        let stop = Stop {
            id,
            at,
            route,
            dwell_ms: 0,
            dwell_limit_ms: 0,
            partners: Vec::new(),
            after: Vec::new(),
        };
        self.plan.stops.push(stop);
        self.unrolled.push(unrolled);
        self.at = unrolled;
    }
}

/// The ring index of an unrolled position.
pub(super) fn index_on(ring: &Ring, unrolled: i64) -> usize {
    usize::try_from(unrolled.rem_euclid(ring.positions() as i64)).unwrap_or(0)
}

/// Who drives where from, and under which name.
#[derive(Clone, Copy, Debug)]
pub(super) struct ApproachFleet<'a> {
    pub(super) vehicles: &'a [(VehicleId, Point)],
    pub(super) run: RunId,
    pub(super) revision: Revision,
    pub(super) separation_m: f64,
}

/// Checks what every planner asks of a fleet on a ring.
pub(super) fn check_fleet(ring: &Ring, fleet: ApproachFleet<'_>) -> Result<(), SweepError> {
    let vehicles = fleet.vehicles.len();
    if !(2..=8).contains(&vehicles) {
        return Err(SweepError::Vehicles { vehicles });
    }
    let again =
        |index: usize, id: VehicleId| fleet.vehicles[..index].iter().any(|known| known.0 == id);
    let wrong = fleet
        .vehicles
        .iter()
        .enumerate()
        .find(|(i, (id, at))| !at.is_finite() || again(*i, *id));
    if let Some((_, (vehicle, _))) = wrong {
        return Err(SweepError::Vehicle { vehicle: *vehicle });
    }
    let (positions, needed) = (ring.positions(), 5 * vehicles);
    if positions < needed {
        Err(SweepError::RingTooSmall {
            vehicles,
            positions,
            needed,
        })
    } else {
        Ok(())
    }
}

/// Plans the approach to slots that lie `offsets` (ascending from 0, steps) ahead of the rearmost
/// vehicle's; returns the walks from the rearmost vehicle forward.
///
/// Every vehicle drives straight to the ring position nearest to it, then forward along the ring. The
/// foremost goes first. Of all places for the rearmost slot, and all choices of who is rearmost, the
/// one with the shortest longest travel is taken.
pub(super) fn approach(
    ring: &Ring,
    fleet: ApproachFleet<'_>,
    offsets: &[i64],
) -> Result<Vec<Walk>, SweepError> {
    let ways = shortest_ways(ring, fleet.vehicles, offsets).ok_or(SweepError::NoApproach)?;
    let mut members: Vec<VehicleId> = fleet.vehicles.iter().map(|(vehicle, _)| *vehicle).collect();
    members.sort();
    let mut walks: Vec<Walk> = ways
        .iter()
        .map(|way| walk_to_slot(ring, way, fleet, &members))
        .collect();
    let forward = walks.iter().rev();
    let sequence: Vec<VehicleId> = forward
        .flat_map(|walk| std::iter::repeat_n(walk.plan.vehicle, walk.plan.stops.len()))
        .collect();
    let mut plans: Vec<Plan> = walks.iter().map(|walk| walk.plan.clone()).collect();
    order_legs(&mut plans, &sequence, fleet.separation_m)?;
    for (walk, plan) in walks.iter_mut().zip(plans) {
        walk.plan = plan;
    }
    Ok(walks)
}

fn walk_to_slot(ring: &Ring, way: &Way, fleet: ApproachFleet<'_>, members: &[VehicleId]) -> Walk {
    let plan = Plan {
        vehicle: way.vehicle,
        run: fleet.run,
        revision: fleet.revision,
        members: members.to_vec(),
        start: way.place.into(),
        ..Plan::default()
    };
    let mut walk = Walk {
        plan,
        unrolled: Vec::new(),
        at: way.entry,
    };
    let entry = ring.position(index_on(ring, way.entry));
    if way.place.distance_to(entry) > 1e-6 {
        walk.push(ring, StopId(0), way.entry, Vec::new());
    }
    for number in 1..=way.slot - way.entry {
        walk.step_forward(ring, StopId(u32::try_from(number).unwrap_or(u32::MAX)));
    }
    walk
}

/// Tries every vehicle as the rearmost and every place of the rearmost slot.
fn shortest_ways(
    ring: &Ring,
    vehicles: &[(VehicleId, Point)],
    offsets: &[i64],
) -> Option<Vec<Way>> {
    let around = ring.positions() as i64;
    let mut standing: Vec<(f64, VehicleId, Point)> = vehicles
        .iter()
        .map(|(vehicle, at)| (ring.nearest_arc_m(*at), *vehicle, *at))
        .collect();
    standing.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut best: Option<(f64, f64, Vec<Way>)> = None;
    for rearmost in 0..standing.len() {
        let entries = entries_from(ring, &standing, rearmost);
        for slot in entries[0].1..entries[0].1 + around {
            let ways: Vec<Way> = std::iter::zip(&entries, offsets)
                .map(|((standing, entry), offset)| Way {
                    vehicle: standing.1,
                    place: standing.2,
                    entry: *entry,
                    slot: slot + offset,
                })
                .collect();
            let passes_home = ways
                .last()
                .is_some_and(|way| way.slot > entries[0].1 + around - MIN_GAP);
            if passes_home || ways.iter().any(|way| way.slot < way.entry) {
                continue;
            }
            let travels = ways.iter().map(|way| travel_m(ring, way));
            let (longest, sum) =
                travels.fold((0.0, 0.0), |(max, sum), m| (f64::max(max, m), sum + m));
            // Millimetres of rounding must not decide between equal ways.
            let better = |kept: &(f64, f64, Vec<Way>)| {
                longest < kept.0 - 1e-3 || (longest < kept.0 + 1e-3 && sum < kept.1 - 1e-3)
            };
            if best.as_ref().is_none_or(better) {
                best = Some((longest, sum, ways));
            }
        }
    }
    best.map(|(_, _, ways)| ways)
}

fn travel_m(ring: &Ring, way: &Way) -> f64 {
    let entry = ring.position(index_on(ring, way.entry));
    way.place.distance_to(entry) + ring.pitch_m() * (way.slot - way.entry) as f64
}

/// The vehicles from the rearmost forward, with the unrolled position at which each enters the ring.
fn entries_from(
    ring: &Ring,
    standing: &[(f64, VehicleId, Point)],
    rearmost: usize,
) -> Vec<((f64, VehicleId, Point), i64)> {
    let around = ring.positions() as i64;
    let count = standing.len();
    let mut entries: Vec<((f64, VehicleId, Point), i64)> = Vec::with_capacity(count);
    for step in 0..count {
        let vehicle = standing[(rearmost + step) % count];
        let index = (vehicle.0 / ring.pitch_m()).round() as i64;
        let lapped = if rearmost + step >= count { around } else { 0 };
        entries.push((vehicle, index + lapped));
    }
    entries
}
