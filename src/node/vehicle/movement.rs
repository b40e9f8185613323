//! What the vehicle was told about moving, and which way it claims meanwhile: the states that the actor's doc draws.
//! Whether the body moves is said by telemetry, which ends a leg, a turn or a braking; nothing here speaks to the autopilot.

use std::collections::VecDeque;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::messages::{Motion, Telemetry};
use super::stored_way::way_ahead;
use crate::autopilot::{Item, StoredPhase, StoredProgress};
use crate::geom::{Angle, Point, Segment, Track};
use crate::time::Time;

/// After this long a resting autopilot has ended the drive that it was told.
pub(super) const REST_GRACE: Duration = Duration::from_millis(300);
/// What telemetry does not show yet is said again this often.
pub(super) const RESEND_AFTER: Duration = Duration::from_millis(300);

/// Autopilots pass a corner this near to it at the latest, metres: 0.25 m by their own place, which may be off.
const PASSED_M: f64 = 0.35;
/// This near to a corner it is reached, metres.
const REACHED_M: f64 = 0.05;
/// Who is farther from a corner again by this than it was has turned there, metres: the place believed jumps by less.
const TURNED_M: f64 = 0.1;
/// Who is this far along the piece beyond a corner has turned there, metres: at the latest where it turned at [`PASSED_M`].
const BEYOND_M: f64 = 0.5;
/// Where a braking ends this near to the new route, that claims it, metres.
const BESIDE_M: f64 = 0.05;
/// A corner this near is no direction, metres.
const HERE_M: f64 = 0.1;

/// What the vehicle was told last about moving.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub(super) enum MovementOrder {
    /// Nothing yet, or what it was told has ended.
    #[default]
    Idle,
    /// To drive a leg.
    Driving(Leg),
    /// To turn on the spot.
    Turning {
        /// When it was told.
        since: Time,
        /// What it drove before, claimed until telemetry has shown its end.
        leg: Option<Leg>,
    },
    /// To let the autopilot carry out a mission that it stores.
    FollowingStored(StoredWay),
    /// To stop; it stands until it is told to move.
    Stopped(RepeatedStop),
    /// To stop, by the reflex.
    Halted(RepeatedStop),
}

/// A way that is being driven.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct Leg {
    since: Time,
    /// It leads to no stop: nobody's plan says who goes first.
    is_off_plan: bool,
    /// The corner that was passed last; at first where it began.
    passed: Point,
    /// What lies ahead; never empty.
    corners: VecDeque<Point>,
    /// How near to the next corner it has come, along the piece that leads there, metres; `None` = not yet near.
    nearest_m: Option<f64>,
    /// The end of what it was driving before.
    braking: Option<Braking>,
}

/// What is still driven of a leg after another one was told.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct Braking {
    /// Where it ends.
    pub end: Point,
    /// When it ends at the latest.
    pub until: Time,
}

/// The places of a mission that the autopilot carries out.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct StoredWay {
    since: Time,
    /// The item under way.
    item: usize,
    /// All items; item 0 is home.
    items: Vec<Item>,
    /// Where returns lead.
    home: Point,
}

/// A stop, said again until telemetry shows rest.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct RepeatedStop {
    /// When it was said last.
    sent: Time,
    /// Where the braking on a leg ends; `None` once it has ended, and where there was no leg.
    braking_end: Option<Point>,
}

impl MovementOrder {
    /// Drives along a route of two corners or more, which begins where it is, from now on; what it drives now may have a
    /// braking of its own.
    pub(super) fn drive(
        &mut self,
        now: Time,
        is_off_plan: bool,
        route: &Track,
        braking: Option<Braking>,
    ) {
        let is_beside = |braking: &Braking| route.distance_to_point(braking.end) > BESIDE_M;
        *self = MovementOrder::Driving(Leg {
            since: now,
            is_off_plan,
            passed: route.start(),
            corners: route.segments().map(|piece| piece.to).collect(),
            nearest_m: None,
            braking: braking.filter(is_beside),
        });
    }

    /// Turns on the spot from now on.
    pub(super) fn turn(&mut self, now: Time) {
        let leg = match std::mem::take(self) {
            MovementOrder::Idle => None,
            MovementOrder::Driving(leg) => Some(leg),
            MovementOrder::Turning { since: _, leg } => leg,
            // The autopilot brakes first.
            MovementOrder::FollowingStored(_) => None,
            MovementOrder::Stopped(stop) | MovementOrder::Halted(stop) => stop.leg(),
        };
        *self = MovementOrder::Turning { since: now, leg };
    }

    /// Lets the autopilot carry out a mission, from an item on.
    pub(super) fn follow_stored(&mut self, now: Time, items: &[Item], from: usize, home: Point) {
        *self = MovementOrder::FollowingStored(StoredWay {
            since: now,
            item: from,
            items: items.to_vec(),
            home,
        });
    }

    /// Returns whether the autopilot carries out what it stores.
    pub(super) fn follows_stored(&self) -> bool {
        matches!(self, MovementOrder::FollowingStored(_))
    }

    /// Returns how far the autopilot is with the mission that it stores: as long as it is followed, and what became of it.
    pub(super) fn stored_progress(&self, telemetry: &Telemetry) -> Option<StoredProgress> {
        match (self, telemetry.stored.map(|stored| stored.phase)) {
            (MovementOrder::FollowingStored(_), _) => telemetry.stored.or(Some(StoredProgress {
                item: 0,
                phase: StoredPhase::Preparing,
            })),
            (_, Some(StoredPhase::Over | StoredPhase::Failed)) => telemetry.stored,
            (_, Some(StoredPhase::Preparing | StoredPhase::UnderWay) | None) => None,
        }
    }

    /// Stops, or says so again; on a leg it claims the way to where its braking ends.
    pub(super) fn stop(&mut self, now: Time, braking_end: Option<Point>) {
        let stop = RepeatedStop {
            sent: now,
            braking_end: braking_end.filter(|_| self.claims_a_way()),
        };
        *self = match self {
            MovementOrder::Halted(_) => MovementOrder::Halted(stop),
            MovementOrder::Idle
            | MovementOrder::Driving(_)
            | MovementOrder::Turning { .. }
            | MovementOrder::FollowingStored(_)
            | MovementOrder::Stopped(_) => MovementOrder::Stopped(stop),
        };
    }

    /// Stops by the reflex.
    pub(super) fn halt(&mut self, now: Time, braking_end: Option<Point>) {
        *self = MovementOrder::Halted(RepeatedStop {
            sent: now,
            braking_end: braking_end.filter(|_| self.claims_a_way()),
        });
    }

    /// Somebody else moves the vehicle: nothing is claimed but its place.
    pub(super) fn let_go(&mut self) {
        *self = MovementOrder::Idle;
    }

    /// Takes what telemetry shows: drops what was driven, and ends what has come to rest. Returns the end of a leg that was
    /// driven to its end.
    pub(super) fn take(&mut self, now: Time, telemetry: &Telemetry) -> Option<Point> {
        let has_ended =
            |since: Time| telemetry.motion == Motion::Resting && now.since(since) > REST_GRACE;
        match self {
            MovementOrder::Idle => {}
            MovementOrder::Driving(leg) => {
                leg.take(now, telemetry);
                if has_ended(leg.since) {
                    let end = leg.corners.back().copied();
                    *self = MovementOrder::Idle;
                    return end;
                }
            }
            MovementOrder::Turning { since, leg } => {
                if let Some(leg) = leg {
                    leg.take(now, telemetry);
                }
                leg.take_if(|leg| has_ended(leg.since));
                if has_ended(*since) {
                    *self = MovementOrder::Idle;
                }
            }
            MovementOrder::FollowingStored(way) => {
                if way.take(telemetry, has_ended(way.since)) {
                    *self = MovementOrder::Idle;
                }
            }
            MovementOrder::Stopped(stop) | MovementOrder::Halted(stop) => {
                stop.braking_end.take_if(|_| has_ended(stop.sent));
            }
        }
        None
    }

    /// Returns whether the last word was to stop.
    pub(super) fn is_stop(&self) -> bool {
        match self {
            MovementOrder::Stopped(_) | MovementOrder::Halted(_) => true,
            MovementOrder::Idle
            | MovementOrder::Driving(_)
            | MovementOrder::Turning { .. }
            | MovementOrder::FollowingStored(_) => false,
        }
    }

    /// Returns whether the reflex has stopped it.
    pub(super) fn is_halted(&self) -> bool {
        match self {
            MovementOrder::Halted(_) => true,
            MovementOrder::Idle
            | MovementOrder::Driving(_)
            | MovementOrder::Turning { .. }
            | MovementOrder::FollowingStored(_)
            | MovementOrder::Stopped(_) => false,
        }
    }

    /// Returns whether a stop must be said again: a while ago it was said, and telemetry shows no rest.
    pub(super) fn is_stop_due_again(&self, now: Time, motion: Motion) -> bool {
        match self {
            MovementOrder::Stopped(stop) | MovementOrder::Halted(stop) => {
                motion != Motion::Resting && now.since(stop.sent) >= RESEND_AFTER
            }
            MovementOrder::Idle
            | MovementOrder::Driving(_)
            | MovementOrder::Turning { .. }
            | MovementOrder::FollowingStored(_) => false,
        }
    }

    /// Returns the way that it claims from where it is: on a leg or braking; `None` when it claims no more than its place.
    pub(super) fn way_from(&self, at: Point) -> Option<Vec<Point>> {
        match self {
            MovementOrder::Idle | MovementOrder::Turning { leg: None, .. } => None,
            MovementOrder::Driving(leg) | MovementOrder::Turning { leg: Some(leg), .. } => {
                Some(leg.claim_from(at))
            }
            MovementOrder::FollowingStored(way) => Some(way.way_from(at)),
            MovementOrder::Stopped(stop) | MovementOrder::Halted(stop) => {
                stop.braking_end.map(|end| vec![at, end])
            }
        }
    }

    /// Returns what is left of a leg that it drives; `None` when it drives none.
    pub(super) fn leg_from(&self, at: Point) -> Option<Vec<Point>> {
        match self {
            MovementOrder::Driving(leg) => Some(leg.way_from(at)),
            MovementOrder::Idle
            | MovementOrder::Turning { .. }
            | MovementOrder::FollowingStored(_)
            | MovementOrder::Stopped(_)
            | MovementOrder::Halted(_) => None,
        }
    }

    /// Returns what is left of the way that it is to drive, on plan or off it; `None` when it stands, turns or brakes.
    pub(super) fn route_from(&self, at: Point) -> Option<Vec<Point>> {
        self.leg_from(at).or_else(|| self.way_off_plan_from(at))
    }

    /// Returns the direction in which it goes on along its leg when it has turned at a corner; `None` without a leg.
    pub(super) fn sets_out_toward(&self, at: Point) -> Option<Angle> {
        match self {
            MovementOrder::Driving(leg) => Some(leg.direction_beyond(at)),
            MovementOrder::Idle
            | MovementOrder::Turning { .. }
            | MovementOrder::FollowingStored(_)
            | MovementOrder::Stopped(_)
            | MovementOrder::Halted(_) => None,
        }
    }

    /// Returns the way that it claims on a leg on which nobody's plan says who goes first; `None` for any other.
    pub(super) fn way_off_plan_from(&self, at: Point) -> Option<Vec<Point>> {
        match self {
            MovementOrder::Driving(leg) | MovementOrder::Turning { leg: Some(leg), .. } => {
                leg.is_off_plan.then(|| leg.way_from(at))
            }
            MovementOrder::FollowingStored(way) => Some(way.way_from(at)),
            MovementOrder::Idle
            | MovementOrder::Turning { leg: None, .. }
            | MovementOrder::Stopped(_)
            | MovementOrder::Halted(_) => None,
        }
    }

    fn claims_a_way(&self) -> bool {
        match self {
            MovementOrder::Idle => false,
            MovementOrder::Driving(_) | MovementOrder::FollowingStored(_) => true,
            MovementOrder::Turning { since: _, leg } => leg.is_some(),
            MovementOrder::Stopped(stop) | MovementOrder::Halted(stop) => {
                stop.braking_end.is_some()
            }
        }
    }
}

impl Leg {
    /// Takes what telemetry shows: drops what lies behind.
    fn take(&mut self, now: Time, telemetry: &Telemetry) {
        self.pass(telemetry.pose.at);
        let still_brakes = telemetry.motion == Motion::Driving;
        self.braking
            .take_if(|braking| !still_brakes || now >= braking.until);
    }

    /// Drops the corners that lie behind; the last one stays. Being beside the piece beyond a corner does not do: where a way
    /// turns back, that is so long before the corner.
    fn pass(&mut self, at: Point) {
        while self.corners.len() > 1 {
            let corner = self.corners[0];
            let to_corner = Segment::new(self.passed, corner);
            let left_m = (1.0 - to_corner.nearest_share(at)) * to_corner.length_m();
            let beyond = Segment::new(corner, self.corners[1]);
            let beyond_m = beyond.nearest_share(at) * beyond.length_m();
            if left_m <= PASSED_M {
                self.nearest_m = Some(self.nearest_m.map_or(left_m, |least_m| least_m.min(left_m)));
            }
            let is_passed = self.nearest_m.is_some_and(|least_m| {
                least_m <= REACHED_M
                    || left_m > least_m + TURNED_M
                    || beyond_m >= BEYOND_M.min(beyond.length_m())
            });
            if !is_passed || beyond_m <= 0.0 {
                break;
            }
            (self.passed, self.nearest_m) = (corner, None);
            self.corners.pop_front();
        }
    }

    /// Returns the ground that it claims: its way, and first where it brakes beside it.
    fn claim_from(&self, at: Point) -> Vec<Point> {
        let mut claim = self.way_from(at);
        if let Some(braking) = self.braking {
            claim.splice(0..0, [at, braking.end]);
        }
        claim
    }

    fn way_from(&self, at: Point) -> Vec<Point> {
        std::iter::once(at)
            .chain(self.corners.iter().copied())
            .collect()
    }

    /// Returns the direction to the first corner that is not here: one at which the autopilot may turn is left out, although it
    /// is claimed still.
    fn direction_beyond(&self, at: Point) -> Angle {
        let turns_here = self.corners.len() > 1 && at.distance_to(self.corners[0]) <= PASSED_M;
        let ahead = self
            .corners
            .iter()
            .skip(usize::from(turns_here))
            .find(|corner| at.distance_to(**corner) > HERE_M);
        ahead
            .or(self.corners.back())
            .map_or_else(Angle::default, |corner| at.angle_to(*corner))
    }
}

impl StoredWay {
    /// Takes how far the autopilot is; returns whether it is over and done with. `rests` when it has stood for a while.
    fn take(&mut self, telemetry: &Telemetry, rests: bool) -> bool {
        match telemetry.stored {
            Some(StoredProgress {
                item,
                phase: StoredPhase::UnderWay | StoredPhase::Over,
            }) if item > 0 => self.item = usize::from(item),
            Some(_) | None => {}
        }
        match telemetry.stored.map(|stored| stored.phase) {
            Some(StoredPhase::Preparing | StoredPhase::UnderWay) => false,
            Some(StoredPhase::Over | StoredPhase::Failed) | None => rests,
        }
    }

    /// Returns the way that is claimed, from where it is.
    fn way_from(&self, at: Point) -> Vec<Point> {
        way_ahead(&self.items, self.item, self.home, at)
    }
}

impl RepeatedStop {
    /// Returns what is left of its braking, as a leg.
    fn leg(self) -> Option<Leg> {
        let corners = VecDeque::from([self.braking_end?]);
        Some(Leg {
            since: self.sent,
            is_off_plan: false,
            passed: self.braking_end?,
            corners,
            nearest_m: None,
            braking: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Angle, Pose};
    use crate::node::tests_support::variant_of;

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    fn point(x_m: f64) -> Point {
        Point::new(x_m, 0.0)
    }

    /// A route along x.
    fn route(corners_m: &[f64]) -> Track {
        Track::new(corners_m.iter().map(|x_m| point(*x_m)).collect()).unwrap()
    }

    fn telemetry(x_m: f64, motion: Motion) -> Telemetry {
        let pose = Pose {
            at: point(x_m),
            heading: Angle::default(),
            sd_m: 0.05,
        };
        Telemetry {
            pose,
            flight_state: Default::default(),
            speed_mps: 0.0,
            battery: Some(1.0),
            motion,
            is_armed: true,
            stored: None,
        }
    }

    fn mission() -> Vec<Item> {
        let to = |x_m: f64| Item::Land {
            at: Some(point(x_m)),
        };
        vec![to(0.0), to(2.0), Item::Speed(1.0), to(4.0), to(6.0)]
    }

    /// One movement of each kind, with its name; all were told at 1 s.
    fn every_kind() -> [(&'static str, MovementOrder); 8] {
        let told = |tell: &dyn Fn(&mut MovementOrder)| {
            let mut movement = MovementOrder::default();
            tell(&mut movement);
            movement
        };
        let drive = |movement: &mut MovementOrder| {
            movement.drive(at(1.0), true, &route(&[0.0, 2.0, 4.0]), None)
        };
        [
            ("Idle", told(&|_| {})),
            ("Driving", told(&drive)),
            ("Turning", told(&|movement| movement.turn(at(1.0)))),
            (
                "Turning, a leg left",
                told(&|movement| (drive(movement), movement.turn(at(1.0))).1),
            ),
            (
                "FollowingStored",
                told(&|movement| movement.follow_stored(at(1.0), &mission(), 1, point(-9.0))),
            ),
            ("Stopped", told(&|movement| movement.stop(at(1.0), None))),
            (
                "Stopped on a leg",
                told(&|movement| (drive(movement), movement.stop(at(1.0), Some(point(1.0)))).1),
            ),
            (
                "Halted",
                told(&|movement| (drive(movement), movement.halt(at(1.0), Some(point(1.0)))).1),
            ),
        ]
    }

    #[test]
    fn every_word_leads_from_every_state_where_the_drawing_says() {
        for (from, before) in every_kind() {
            let after = |tell: &dyn Fn(&mut MovementOrder)| {
                let mut movement = before.clone();
                tell(&mut movement);
                variant_of(&movement)
            };
            assert_eq!(
                after(&|it| it.drive(at(2.0), true, &route(&[0.0, 1.0]), None)),
                "Driving",
                "from {from}"
            );
            assert_eq!(after(&|it| it.turn(at(2.0))), "Turning", "from {from}");
            assert_eq!(after(&|it| it.let_go()), "Idle", "from {from}");
            let stopped = if from == "Halted" {
                "Halted"
            } else {
                "Stopped"
            };
            assert_eq!(after(&|it| it.stop(at(2.0), None)), stopped, "from {from}");
            assert_eq!(after(&|it| it.halt(at(2.0), None)), "Halted", "from {from}");
            let rests = telemetry(0.0, Motion::Resting);
            assert_eq!(
                after(&|it| {
                    let _ = it.take(at(1.3), &rests);
                }),
                variant_of(&before),
                "it may not have begun"
            );
            let rested = if before.is_stop() {
                variant_of(&before)
            } else {
                "Idle".to_owned()
            };
            assert_eq!(
                after(&|it| {
                    let _ = it.take(at(1.4), &rests);
                }),
                rested,
                "from {from}"
            );
            for motion in [Motion::Driving, Motion::Turning] {
                assert_eq!(
                    after(&|it| {
                        let _ = it.take(at(9.0), &telemetry(0.0, motion));
                    }),
                    variant_of(&before),
                    "from {from}"
                );
            }
        }
    }

    #[test]
    fn a_way_is_claimed_until_rest_and_no_further_than_it_is_needed() {
        for (kind, mut movement) in every_kind() {
            let claimed = movement.way_from(point(0.0)).map(|way| way.len());
            let expected = match kind {
                "Driving" | "Turning, a leg left" | "FollowingStored" => Some(3),
                "Stopped on a leg" | "Halted" => Some(2),
                _ => None,
            };
            assert_eq!(claimed, expected, "{kind}");
            movement.take(at(1.1), &telemetry(3.0, Motion::Driving));
            assert_eq!(
                movement.way_from(point(3.0)).map(|way| way.len()),
                // Of a stored mission the autopilot says what is passed, and two places are not far enough.
                expected.map(|_| if kind == "FollowingStored" { 4 } else { 2 }),
                "{kind}, on its way"
            );
            movement.take(at(1.4), &telemetry(3.0, Motion::Resting));
            assert_eq!(movement.way_from(point(3.0)), None, "{kind}, at rest");
        }
    }

    #[test]
    fn where_a_way_turns_back_its_corner_is_claimed_until_it_is_reached() {
        // Out to 4 m, and 1 m back beside the way there.
        let (corner, end) = (point(4.0), Point::new(3.0, 0.3));
        let mut movement = MovementOrder::default();
        let out_and_back = Track::new(vec![point(0.0), corner, end]).unwrap();
        movement.drive(at(1.0), true, &out_and_back, None);
        let mut way_at = |x_m: f64| {
            movement.take(at(2.0), &telemetry(x_m, Motion::Driving));
            movement.way_from(point(x_m))
        };
        // It turns 0.2 m before the corner.
        for x_m in [0.0, 2.0, 3.2, 3.6, 3.8, 3.72] {
            assert_eq!(way_at(x_m), Some(vec![point(x_m), corner, end]), "{x_m}");
        }
        assert_eq!(way_at(3.6), Some(vec![point(3.6), end]), "on its way back");
    }

    #[test]
    fn a_corner_is_claimed_until_it_is_reached_or_the_piece_beyond_it_is_driven() {
        let (corner, end) = (point(4.0), Point::new(4.0, 3.0));
        let around = Track::new(vec![point(0.0), corner, end]).unwrap();
        let claims_corner = |places: &[(f64, f64)]| {
            let mut movement = MovementOrder::default();
            movement.drive(at(1.0), true, &around, None);
            for (x_m, y_m) in places {
                let mut shown = telemetry(*x_m, Motion::Driving);
                shown.pose.at.y_m = *y_m;
                movement.take(at(2.0), &shown);
            }
            movement.way_from(point(0.0)).unwrap().contains(&corner)
        };
        assert!(claims_corner(&[(3.7, 0.0), (3.9, 0.1)]));
        assert!(!claims_corner(&[(3.7, 0.0), (3.96, 0.1)]), "reached");
        // Far inside of it, it is never near.
        assert!(claims_corner(&[(3.7, 0.1), (3.7, 0.4)]));
        assert!(!claims_corner(&[(3.7, 0.1), (3.7, 0.55)]), "beyond it");
    }

    #[test]
    fn a_corner_before_a_short_piece_is_passed_as_well() {
        let corners = [(0.0, 0.0), (4.0, 0.0), (4.0, 0.4), (3.9, 5.0)];
        let corners = corners.map(|(x_m, y_m)| Point::new(x_m, y_m));
        let mut movement = MovementOrder::default();
        let zigzag = Track::new(corners.to_vec()).unwrap();
        movement.drive(at(1.0), true, &zigzag, None);
        for (x_m, y_m) in [(3.75, 0.0), (3.85, 0.2), (3.9, 1.0)] {
            let mut shown = telemetry(x_m, Motion::Driving);
            shown.pose.at.y_m = y_m;
            movement.take(at(2.0), &shown);
        }
        let here = Point::new(3.9, 1.0);
        assert_eq!(movement.way_from(here), Some(vec![here, corners[3]]));
    }

    #[test]
    fn who_turns_at_a_corner_sets_out_beyond_it_although_it_claims_it() {
        for beyond in [Point::new(1.0, 0.5), Point::new(4.0, 3.0)] {
            let corner = point(4.0);
            let mut movement = MovementOrder::default();
            let around = Track::new(vec![point(0.0), corner, beyond]).unwrap();
            movement.drive(at(1.0), true, &around, None);
            let here = point(3.75);
            movement.take(at(2.0), &telemetry(3.75, Motion::Turning));
            assert!(movement.way_from(here).unwrap().contains(&corner));
            assert_eq!(movement.sets_out_toward(here), Some(here.angle_to(beyond)));
            assert_eq!(
                movement.sets_out_toward(point(3.0)),
                Some(Angle::default()),
                "still far from it"
            );
        }
    }

    #[test]
    fn where_it_brakes_beside_its_new_route_is_claimed_until_it_has() {
        let brakes = |end: Point, motion, time_s: f64| {
            let mut movement = MovementOrder::default();
            let until = at(1.5);
            let braking = Some(Braking { end, until });
            movement.drive(at(1.0), true, &route(&[0.0, 4.0]), braking);
            movement.take(at(time_s), &telemetry(0.1, motion));
            let claimed = movement.way_from(point(0.1));
            assert_eq!(
                movement.leg_from(point(0.1)),
                Some(vec![point(0.1), point(4.0)])
            );
            claimed.unwrap().len() > 2
        };
        let beside = Point::new(0.1, -0.3);
        assert!(brakes(beside, Motion::Driving, 1.4));
        assert!(!brakes(beside, Motion::Driving, 1.5), "it has");
        assert!(!brakes(beside, Motion::Turning, 1.2), "it has");
        assert!(!brakes(point(0.3), Motion::Driving, 1.2), "on its route");
    }

    #[test]
    fn of_a_stored_mission_the_next_two_places_are_claimed_until_it_is_over_or_has_failed() {
        let shown = |x_m: f64, item: u16, phase| Telemetry {
            stored: Some(StoredProgress { item, phase }),
            ..telemetry(x_m, Motion::Resting)
        };
        let mut movement = MovementOrder::default();
        movement.follow_stored(at(1.0), &mission(), 1, point(-9.0));
        movement.take(at(9.0), &shown(0.0, 0, StoredPhase::Preparing));
        assert_eq!(
            movement.way_from(point(0.0)),
            Some(vec![point(0.0), point(2.0), point(4.0)])
        );
        movement.take(at(9.0), &shown(1.0, 3, StoredPhase::UnderWay));
        assert_eq!(
            movement.way_from(point(1.0)),
            Some(vec![point(1.0), point(4.0), point(6.0)])
        );
        let progress = movement.stored_progress(&telemetry(1.0, Motion::Driving));
        assert_eq!(
            progress.map(|progress| progress.phase),
            Some(StoredPhase::Preparing)
        );
        for phase in [StoredPhase::Over, StoredPhase::Failed] {
            let (mut ended, shown) = (movement.clone(), shown(6.0, 4, phase));
            ended.take(at(9.0), &shown);
            assert_eq!(
                (ended.way_from(point(6.0)), ended.stored_progress(&shown)),
                (None, shown.stored)
            );
        }
    }

    #[test]
    fn only_a_leg_off_plan_yields_and_no_longer_once_it_brakes() {
        let mut movement = MovementOrder::default();
        movement.drive(at(1.0), false, &route(&[0.0, 2.0]), None);
        assert_eq!(
            movement.way_off_plan_from(point(0.0)),
            None,
            "a plan says who goes first"
        );
        movement.drive(at(1.0), true, &route(&[0.0, 2.0]), None);
        assert_eq!(
            movement.way_off_plan_from(point(0.0)),
            Some(vec![point(0.0), point(2.0)])
        );
        movement.stop(at(1.5), Some(point(0.5)));
        assert_eq!(movement.way_off_plan_from(point(0.0)), None);
        movement.turn(at(1.6));
        assert_eq!(
            movement.way_from(point(0.4)),
            Some(vec![point(0.4), point(0.5)]),
            "it brakes still"
        );
        assert_eq!(movement.way_off_plan_from(point(0.4)), None);
    }

    #[test]
    fn a_stop_is_due_again_while_anything_moves_and_braking_is_not_made_up_again_at_rest() {
        for (kind, movement) in every_kind() {
            for motion in [Motion::Driving, Motion::Turning] {
                assert_eq!(
                    movement.is_stop_due_again(at(1.3), motion),
                    movement.is_stop(),
                    "{kind}"
                );
                assert!(!movement.is_stop_due_again(at(1.2), motion), "{kind}");
            }
            assert!(
                !movement.is_stop_due_again(at(9.0), Motion::Resting),
                "{kind}"
            );
        }
        let mut movement = MovementOrder::default();
        movement.stop(at(1.0), Some(point(1.0)));
        assert_eq!(
            movement.way_from(point(0.0)),
            None,
            "what drove no leg claims none when it brakes"
        );
    }
}
