//! When bodies touch: a body against what stands (a shape cast per straight leg, mapped to time),
//! and two bodies against each other. Decides nothing: what a contact means is the world's matter.
//!
//! Pairs: between two changes of motion the relative place is a parabola in time, which leaves its
//! chord by at most |w| h² / 8 (w relative acceleration, h the span). Spans whose chord stays away
//! by more than that are passed over whole, others are halved; so nothing is missed, however slow,
//! and two bodies at constant speed cost one step. (The same promise as conservative advancement,
//! which creeps where two bodies pass closely.)

use std::time::Duration;

use super::autopilot::Climb;
use super::body::Body;
use super::motion::MotionPhase;
use crate::geom::{Point, Segment, Vector};
use crate::time::Time;

/// A contact is reported within this distance above the one asked for, metres.
pub const TOLERANCE_M: f64 = 1e-3;

/// A straight way of a body with its speed law.
#[derive(Clone, Debug)]
pub struct Swept<'a> {
    /// From where to where the middle moves.
    pub segment: Segment,
    /// When it is at the segment's start.
    pub from: Time,
    /// When it is at the segment's end.
    pub until: Time,
    body: &'a Body,
    phases: &'a [MotionPhase],
}

impl Swept<'_> {
    /// Returns when a share of the segment (0 to 1) is covered, rounded down to a nanosecond.
    pub fn time_at(&self, share: f64) -> Time {
        let share = share.clamp(0.0, 1.0);
        let way_m = self.segment.length_m() * share;
        let Some(first) = self.phases.first() else {
            return self.from;
        };
        let mut left_m = way_m + first.from.distance_to(self.segment.from);
        for phase in self.phases {
            let length_m = phase.from.distance_to(phase.to);
            if left_m <= length_m {
                let time_s = phase.time_at_s(left_m);
                return self.body.moment_before(time_s).clamp(self.from, self.until);
            }
            left_m -= length_m;
        }
        self.until
    }
}

impl Body {
    /// Returns the straight ways between two moments, in order; one for a leg without a bend, whatever
    /// its speed law. Nothing while it stands or turns.
    pub fn swept(&self, from: Time, until: Time) -> Vec<Swept<'_>> {
        self.phases_between(from, until)
            .chunk_by(|before, after| {
                before.is_straight() && after.is_straight() && before.heading == after.heading
            })
            .filter(|leg| leg[0].is_straight())
            .map(|leg| self.sweep(leg, from, until))
            .collect()
    }

    fn sweep<'a>(&'a self, leg: &'a [MotionPhase], from: Time, until: Time) -> Swept<'a> {
        let (first, last) = (&leg[0], &leg[leg.len() - 1]);
        let (begins, ends) = (self.moment(first.start_s), self.moment(last.end_s()));
        let start = if begins < from {
            first.at(self.seconds(from))
        } else {
            first.from
        };
        let end = if ends > until {
            last.at(self.seconds(until))
        } else {
            last.to
        };
        let segment = Segment::new(start, end);
        Swept {
            segment,
            from: begins.max(from),
            until: ends.min(until),
            body: self,
            phases: leg,
        }
    }

    /// Returns when the body first touches what stands, or `None` until `until`. `first_contact` casts
    /// the body's disc along a segment and gives the share of the segment (0 to 1) at which it touches.
    pub fn contact_time(
        &self,
        from: Time,
        until: Time,
        first_contact: &dyn Fn(Segment) -> Option<f64>,
    ) -> Option<Time> {
        let ways = self.swept(from, until);
        ways.iter()
            .find_map(|way| first_contact(way.segment).map(|share| way.time_at(share)))
    }
}

/// Returns the first moment at which the middles of two bodies are no more than `distance_m` apart, or
/// `None` until `until`. Before the moment given they are surely further apart; at it they are within
/// `distance_m` + [`TOLERANCE_M`].
pub fn first_contact_of(
    a: &Body,
    b: &Body,
    from: Time,
    until: Time,
    distance_m: f64,
) -> Option<Time> {
    spans(a, b, from, until)
        .into_iter()
        .find_map(|span| span.first_within(distance_m))
}

/// Returns the smallest distance between the middles of two bodies between two moments, metres, and
/// when it is reached; within 0.2 mm of the true one, never below it.
pub fn closest_approach(a: &Body, b: &Body, from: Time, until: Time) -> (f64, Time) {
    let start_m = a.pose_at(from).at.distance_to(b.pose_at(from).at);
    let mut best = (start_m, from);
    for span in spans(a, b, from, until) {
        span.improve(&mut best);
    }
    best
}

/// Returns when a body that climbs or sinks on the spot first touches what stands, or `None` until the climb is over.
/// `touches` tells whether anything stands between two altitudes of the body's foot, metres.
///
/// What is swept only grows, so the moment is found by halving, to a nanosecond.
pub fn climb_contact(
    climb: &Climb,
    from: Time,
    touches: &dyn Fn(f64, f64) -> bool,
) -> Option<Time> {
    let start_m = climb.altitude_m(from);
    let touched_by = |at: Time| {
        let here_m = climb.altitude_m(at);
        touches(start_m.min(here_m), start_m.max(here_m))
    };
    let (mut free, mut touched) = (from, climb.until());
    if touched <= free || !touched_by(touched) {
        return None;
    }
    if touched_by(free) {
        return Some(free);
    }
    while touched.since(free) > Duration::from_nanos(1) {
        let middle = free + touched.since(free) / 2;
        if touched_by(middle) {
            touched = middle
        } else {
            free = middle
        }
    }
    Some(free)
}

/// Returns the times, from a moment on, in which two bodies of this height reach to the same altitudes.
pub fn overlaps(a: &Climb, b: &Climb, from: Time, height_m: f64) -> Vec<(Time, Time)> {
    let mut borders = vec![from];
    borders.extend(
        [a.since, a.until(), b.since, b.until()]
            .into_iter()
            .filter(|at| *at > from),
    );
    borders.push(Time::NEVER);
    borders.sort();
    let apart = |at: Time| b.altitude_m(at) - a.altitude_m(at);
    let mut found: Vec<(Time, Time)> = Vec::new();
    for pair in borders.windows(2).filter(|pair| pair[0] < pair[1]) {
        let Some((begins, ends)) =
            overlap(pair[0], pair[1], apart(pair[0]), apart(pair[1]), height_m)
        else {
            continue;
        };
        match found.last_mut().filter(|last| last.1 == begins) {
            Some(last) => last.1 = ends,
            None => found.push((begins, ends)),
        }
    }
    found
}

/// The part of a span, in which the gap changes evenly, with a gap under the height.
fn overlap(
    from: Time,
    until: Time,
    first_m: f64,
    last_m: f64,
    height_m: f64,
) -> Option<(Time, Time)> {
    if first_m == last_m {
        return (first_m.abs() < height_m).then_some((from, until));
    }
    let share = |gap_m: f64| ((gap_m - first_m) / (last_m - first_m)).clamp(0.0, 1.0);
    let (one, other) = (share(-height_m), share(height_m));
    let (begins, ends) = (one.min(other), one.max(other));
    let span_ns = until.since(from).as_nanos() as f64;
    // At the borders themselves the time is exact, so that spans join.
    let moment = |share: f64| {
        if share >= 1.0 {
            until
        } else {
            from + Duration::from_nanos((span_ns * share) as u64)
        }
    };
    (begins < ends).then(|| (moment(begins), moment(ends)))
}

/// The relative place of two bodies over a span of constant accelerations.
#[derive(Clone, Copy, Debug)]
struct Span {
    from: Time,
    length: Duration,
    first: Vector,
    last: Vector,
    acceleration: Vector,
}

fn spans(a: &Body, b: &Body, from: Time, until: Time) -> Vec<Span> {
    let mut moments = vec![from, until.max(from)];
    for body in [a, b] {
        let phases = body.phases_between(from, until).iter();
        moments.extend(
            phases
                .map(|phase| body.moment(phase.end_s()))
                .filter(|moment| *moment < until),
        );
    }
    moments.sort();
    moments.dedup();
    let apart = |at: Time| b.pose_at(at).at - a.pose_at(at).at;
    moments
        .windows(2)
        .map(|pair| {
            let length = pair[1].since(pair[0]);
            let middle = pair[0] + length / 2;
            let acceleration = b.acceleration_at(middle) - a.acceleration_at(middle);
            Span {
                from: pair[0],
                length,
                first: apart(pair[0]),
                last: apart(pair[1]),
                acceleration,
            }
        })
        .collect()
}

impl Span {
    /// Largest distance between the parabola and its chord, metres.
    fn bow_m(&self) -> f64 {
        self.acceleration.length_m() * self.square_s2() / 8.0
    }

    fn square_s2(&self) -> f64 {
        let length_s = self.length.as_secs_f64();
        length_s * length_s
    }

    fn chord(&self) -> Segment {
        let origin = Point::default();
        Segment::new(origin + self.first, origin + self.last)
    }

    /// The relative place after a share of the span.
    fn place(&self, share: f64) -> Vector {
        let sag = self.acceleration * (0.5 * share * (1.0 - share) * self.square_s2());
        self.first + (self.last - self.first) * share - sag
    }

    fn moment(&self, share: f64) -> Time {
        self.from + Duration::from_nanos((self.length.as_nanos() as f64 * share) as u64)
    }

    fn halves(&self) -> [Span; 2] {
        let (middle, length) = (self.place(0.5), self.length / 2);
        let later = Span {
            from: self.from + length,
            length: self.length - length,
            first: middle,
            ..*self
        };
        [
            Span {
                length,
                last: middle,
                ..*self
            },
            later,
        ]
    }

    fn first_within(&self, distance_m: f64) -> Option<Time> {
        let (bow_m, chord) = (self.bow_m(), self.chord());
        if chord.distance_to_point(Point::default()) > distance_m + bow_m {
            return None;
        }
        if bow_m > TOLERANCE_M / 2.0 {
            return self
                .halves()
                .iter()
                .find_map(|half| half.first_within(distance_m));
        }
        // So flat a span is its chord; with the bow on top of the distance it is never later than the contact.
        Some(self.moment(entry_share(chord, distance_m + bow_m)))
    }

    /// Lowers the best (distance, moment) where this span comes nearer.
    fn improve(&self, best: &mut (f64, Time)) {
        let (bow_m, chord) = (self.bow_m(), self.chord());
        if chord.distance_to_point(Point::default()) - bow_m >= best.0 {
            return;
        }
        if bow_m > 1e-4 {
            self.halves().iter().for_each(|half| half.improve(best));
            return;
        }
        for share in [chord.nearest_share(Point::default()), 1.0] {
            let distance_m = self.place(share).length_m();
            if distance_m < best.0 {
                *best = (distance_m, self.moment(share));
            }
        }
    }
}

/// The share of a segment at which it enters the circle around the origin that it is known to
/// touch; 0 when it starts inside.
fn entry_share(chord: Segment, radius_m: f64) -> f64 {
    let (start, along) = (chord.from - Point::default(), chord.vector());
    let square = along.dot(along);
    let outside = start.dot(start) - radius_m * radius_m;
    if outside <= 0.0 || square <= 0.0 {
        return 0.0;
    }
    let half = -start.dot(along);
    let root = (half * half - square * outside).max(0.0).sqrt();
    (outside / (half + root)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::super::body::DriveLimits;
    use super::*;
    use crate::geom::Angle;
    use proptest::prelude::*;

    const LIMITS: DriveLimits = DriveLimits {
        speed_mps: 0.5,
        acceleration_mps2: 0.4,
        braking_mps2: 0.8,
        turn_rate_radps: 1.0,
    };

    fn secs(seconds_s: f64) -> Time {
        Time::from_secs_f64(seconds_s)
    }

    fn rover(from: (f64, f64), corners: &[(f64, f64)], speed_mps: f64) -> Body {
        let at = Point::new(from.0, from.1);
        let mut body = Body::at_rest(at, Angle::default(), LIMITS).unwrap();
        let corners: Vec<Point> = corners.iter().map(|(x, y)| Point::new(*x, *y)).collect();
        body.drive(Time::ZERO, &corners, speed_mps).unwrap();
        body
    }

    /// A wall along the y axis at `x_m`; the body touches it with its middle.
    fn wall(x_m: f64) -> impl Fn(Segment) -> Option<f64> {
        move |way| {
            let share = (x_m - way.from.x_m) / (way.to.x_m - way.from.x_m);
            (0.0..=1.0).contains(&share).then_some(share)
        }
    }

    #[test]
    fn a_leg_is_one_cast_from_start_to_goal() {
        let body = rover((0.0, 0.0), &[(3.0, 0.0), (5.0, 0.0), (5.0, 2.0)], 0.5);
        let ways = body.swept(Time::ZERO, Time::NEVER);
        let ends: Vec<Segment> = ways.iter().map(|way| way.segment).collect();
        let (start, corner, goal) = (Point::default(), Point::new(5.0, 0.0), Point::new(5.0, 2.0));
        assert_eq!(
            ends,
            [Segment::new(start, corner), Segment::new(corner, goal)]
        );
        assert_eq!(ways[1].until, body.arrival().unwrap());
    }

    #[test]
    fn static_contact_is_met_in_every_phase_of_speed() {
        let body = rover((0.0, 0.0), &[(5.0, 0.0)], 0.5);
        for x_m in [0.05, 0.2, 1.0, 3.0, 4.9, 4.99] {
            for begin_s in [0.0, 0.3] {
                let time = body
                    .contact_time(secs(begin_s), Time::NEVER, &wall(x_m))
                    .unwrap();
                assert!(
                    (body.pose_at(time).at.x_m - x_m).abs() < 1e-8,
                    "wall at {x_m}"
                );
            }
        }
        assert_eq!(body.contact_time(secs(3.0), Time::NEVER, &wall(0.5)), None);
        assert_eq!(body.contact_time(Time::ZERO, secs(3.0), &wall(4.0)), None);
    }

    #[test]
    fn two_that_drive_at_each_other_meet_when_the_gap_is_used_up() {
        let (a, b) = (
            rover((0.0, 0.0), &[(10.0, 0.0)], 0.5),
            rover((8.0, 0.0), &[(5.0, 0.0)], 0.5),
        );
        let time = first_contact_of(&a, &b, Time::ZERO, Time::NEVER, 0.5).unwrap();
        let gap_m = a.pose_at(time).at.distance_to(b.pose_at(time).at);
        assert!((0.5..=0.5 + TOLERANCE_M).contains(&gap_m), "{gap_m}");
    }

    #[test]
    fn creeping_into_contact_is_not_missed() {
        let a = rover((0.0, 0.0), &[(1.0, 0.0)], 0.001);
        let b = rover((1.0, 0.3), &[], 0.5);
        let time = first_contact_of(&a, &b, Time::ZERO, Time::NEVER, 0.5).unwrap();
        // The way to contact is 1 − √(0.5² − 0.3²) = 0.6 m, at 1 mm/s.
        assert!((time.as_secs_f64() - 600.0).abs() < 2.0, "{time}");
        let by = 0.3 - 2.0 * TOLERANCE_M;
        assert_eq!(first_contact_of(&a, &b, Time::ZERO, Time::NEVER, by), None);
    }

    #[test]
    fn two_at_rest_stay_as_far_apart_as_they_are() {
        let (a, b) = (rover((0.0, 0.0), &[], 0.5), rover((3.0, 4.0), &[], 0.5));
        assert_eq!(
            closest_approach(&a, &b, secs(1.0), Time::NEVER),
            (5.0, secs(1.0))
        );
        assert_eq!(first_contact_of(&a, &b, secs(1.0), Time::NEVER, 4.9), None);
        assert_eq!(
            first_contact_of(&a, &b, secs(1.0), Time::NEVER, 5.1),
            Some(secs(1.0))
        );
    }

    fn climb(since_s: f64, from_m: f64, to_m: f64) -> Climb {
        Climb {
            since: secs(since_s),
            from_m,
            to_m,
            rate_mps: 0.5,
        }
    }

    #[test]
    fn a_climb_touches_the_ceiling_when_its_gap_is_used_up() {
        // A plate at 2 m: the head, 0.3 m above the foot, reaches it at 1.7 m, after 3.4 s.
        let ceiling = |low_m: f64, high_m: f64| low_m <= 2.0 && high_m + 0.3 >= 2.0;
        let at = climb_contact(&climb(1.0, 0.0, 5.0), secs(1.0), &ceiling).unwrap();
        assert!((at.as_secs_f64() - 4.4).abs() < 1e-6, "{at}");
        assert_eq!(
            climb_contact(&climb(1.0, 0.0, 1.6), secs(1.0), &ceiling),
            None
        );
        assert_eq!(
            climb_contact(&climb(1.0, 0.0, 5.0), secs(11.0), &ceiling),
            None,
            "it is over"
        );
        // Down onto it from above.
        let at = climb_contact(&climb(1.0, 4.0, 0.0), secs(2.0), &ceiling).unwrap();
        assert!((at.as_secs_f64() - 5.0).abs() < 1e-6, "{at}");
    }

    #[test]
    fn bodies_overlap_in_height_only_while_one_passes_the_other() {
        let (ground, high) = (Climb::level(0.0), Climb::level(1.5));
        assert_eq!(
            overlaps(&ground, &ground, secs(1.0), 0.3),
            [(secs(1.0), Time::NEVER)]
        );
        assert_eq!(overlaps(&ground, &high, secs(1.0), 0.3), []);
        let near = |got: &[(Time, Time)], expected: &[(f64, f64)]| {
            assert_eq!(got.len(), expected.len(), "{got:?}");
            for (got, expected) in got.iter().zip(expected) {
                let (begins_s, ends_s) = (got.0.as_secs_f64(), got.1.as_secs_f64());
                assert!((begins_s - expected.0).abs() < 1e-6, "{got:?}");
                assert!(
                    (ends_s - expected.1).abs() < 1e-6 || got.1 == Time::NEVER,
                    "{got:?}"
                );
            }
        };
        // From 0 to 3 m at 0.5 m/s past a body at 1.5 m: between 1.2 and 1.8 m.
        near(
            &overlaps(&climb(10.0, 0.0, 3.0), &high, Time::ZERO, 0.3),
            &[(12.4, 13.6)],
        );
        near(
            &overlaps(&climb(10.0, 0.0, 1.4), &high, Time::ZERO, 0.3),
            &[(12.4, 0.0)],
        );
        near(
            &overlaps(&climb(10.0, 0.0, 3.0), &ground, Time::ZERO, 0.3),
            &[(0.0, 10.6)],
        );
    }

    fn corners() -> impl Strategy<Value = Vec<(f64, f64)>> {
        prop::collection::vec((-2.0..2.0f64, -2.0..2.0f64), 0..4)
    }

    proptest! {
        #[test]
        fn pairs_agree_with_fine_sampling(
            ways in (corners(), corners()), speeds in (0.02..0.5f64, 0.02..0.5f64), distance_m in 0.1..2.0f64,
        ) {
            let a = rover((-1.0, 0.0), &ways.0, speeds.0);
            let b = rover((1.5, 0.5), &ways.1, speeds.1);
            let until = secs(20.0);
            let gap = |at: Time| a.pose_at(at).at.distance_to(b.pose_at(at).at);
            let (closest_m, when) = closest_approach(&a, &b, Time::ZERO, until);
            let contact = first_contact_of(&a, &b, Time::ZERO, until, distance_m);
            prop_assert!((gap(when) - closest_m).abs() < 1e-6);
            for step in 0..10_000 {
                let now = secs(f64::from(step) * 0.002);
                prop_assert!(gap(now) > closest_m - 2e-4);
                if contact.is_none_or(|time| now < time) {
                    prop_assert!(gap(now) > distance_m - 1e-9, "closer at {now}");
                }
            }
            if let Some(time) = contact {
                prop_assert!(gap(time) <= distance_m + TOLERANCE_M + 1e-9);
            }
            let within = |distance_m| first_contact_of(&a, &b, Time::ZERO, until, distance_m);
            prop_assert!(within(closest_m + 1e-6).is_some_and(|time| time <= when), "barely touching");
            prop_assert_eq!(within(closest_m - 2.0 * TOLERANCE_M), None);
        }
    }
}
