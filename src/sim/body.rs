//! A rover as the world moves it: a disc that turns on the spot and drives straight, with
//! trapezoidal speed, in closed form. There is no step size: a command lays the phases to its end,
//! and any moment from the command on can be asked.
//!
//! It drives forward only. Corners that bend by less than 15° are passed without slowing (the
//! heading changes at once); at sharper ones it brakes to rest, turns, and goes on. It knows no
//! obstacles: see [`super::contact`].

use std::time::Duration;

use super::motion::{MotionPhase, PhaseBuilder, Piece, trapezoid};
use crate::geom::{Angle, Point, Vector};
use crate::time::Time;

pub use super::motion::DriveLimits;

/// A corner that bends less than this is passed without slowing, radians (15°).
pub const GENTLE_BEND_RAD: f64 = std::f64::consts::PI / 12.0;
/// Corners nearer than this to the one before are the same place, metres.
pub const SAME_PLACE_M: f64 = 1e-6;

/// Why a command is refused; the body then goes on as before.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum MotionRefusal {
    /// A place is not finite or further than 1000 km.
    #[error("a place is finite and under 1000 km, got ({}, {})", at.x_m, at.y_m)]
    Place {
        /// The place given.
        at: Point,
    },
    /// A heading is not finite.
    #[error("a heading is finite")]
    Heading,
    /// A speed limit is not a speed.
    #[error("a speed limit is at least 0.001 m/s, got {speed_mps}")]
    Speed {
        /// The limit given.
        speed_mps: f64,
    },
    /// The limits of the body are not possible.
    #[error("speed, acceleration, braking and turn rate are finite and at least 0.001")]
    Limits,
}

/// Where a body is and what it does at one moment.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct BodyState {
    /// Its middle, local frame.
    pub at: Point,
    /// Where it faces, and drives.
    pub heading: Angle,
    /// Speed over ground, m/s, never negative.
    pub speed_mps: f64,
}

/// A body with the motion of its last command.
#[derive(Clone, Debug)]
pub struct Body {
    limits: DriveLimits,
    since: Time,
    phases: Vec<MotionPhase>,
    rest: BodyState,
}

impl Body {
    /// Makes a body that stands.
    ///
    /// # Errors
    /// The place, the heading or the limits are impossible.
    pub fn at_rest(at: Point, heading: Angle, limits: DriveLimits) -> Result<Body, MotionRefusal> {
        check_place(at)?;
        check_heading(heading)?;
        if !limits.are_possible() {
            return Err(MotionRefusal::Limits);
        }
        let rest = BodyState {
            at,
            heading,
            speed_mps: 0.0,
        };
        Ok(Body {
            limits,
            since: Time::ZERO,
            phases: Vec::new(),
            rest,
        })
    }

    /// Drives through the corners still ahead, to rest in the last one.
    ///
    /// While moving, it goes on from the present speed when the first corner lies within 15° of the
    /// heading and the first sharp corner leaves room to brake; otherwise it brakes along its present
    /// path first, turns, and drives from there to the first corner. Without corners it brakes to rest.
    /// The lower of `speed_limit_mps` and the body's own limit holds.
    ///
    /// # Errors
    /// A corner or the speed limit is impossible.
    pub fn drive(
        &mut self,
        now: Time,
        corners: &[Point],
        speed_limit_mps: f64,
    ) -> Result<(), MotionRefusal> {
        corners.iter().try_for_each(|corner| check_place(*corner))?;
        if speed_limit_mps.is_nan() || speed_limit_mps < 0.001 {
            return Err(MotionRefusal::Speed {
                speed_mps: speed_limit_mps,
            });
        }
        let top_mps = speed_limit_mps.min(self.limits.speed_mps);
        let state = self.pose_at(now);
        let goes_on = state.speed_mps > 0.0 && self.can_go_on(state, &pieces(state.at, corners));
        let mut course = if goes_on {
            PhaseBuilder::new(state.at, state.heading)
        } else {
            self.braking(now, state)
        };
        let mut first_mps = if goes_on { state.speed_mps } else { 0.0 };
        let path = pieces(course.at, corners);
        for stretch in path.chunk_by(|before, after| is_gentle(before.heading, after.heading)) {
            if first_mps == 0.0 {
                course.turn(stretch[0].heading, self.limits.turn_rate_radps);
            }
            course.drive(
                stretch,
                &trapezoid(length_m(stretch), first_mps, top_mps, &self.limits),
            );
            first_mps = 0.0;
        }
        self.follow(now, course);
        Ok(())
    }

    /// Turns on the spot to a heading, the shorter way; brakes to rest first when moving.
    ///
    /// # Errors
    /// The heading is not finite.
    pub fn turn(&mut self, now: Time, heading: Angle) -> Result<(), MotionRefusal> {
        check_heading(heading)?;
        let mut course = self.braking(now, self.pose_at(now));
        course.turn(heading, self.limits.turn_rate_radps);
        self.follow(now, course);
        Ok(())
    }

    /// Brakes to rest along the present path with the braking limit; a turn ends at once.
    pub fn stop(&mut self, now: Time) {
        let course = self.braking(now, self.pose_at(now));
        self.follow(now, course);
    }

    /// Comes to rest at once, against all limits: it has hit something.
    pub fn halt(&mut self, now: Time) {
        let state = self.pose_at(now);
        self.follow(now, PhaseBuilder::new(state.at, state.heading));
    }

    /// Returns place, heading and speed at a moment; before the last command, those at the command.
    pub fn pose_at(&self, at: Time) -> BodyState {
        let time_s = self.seconds(at);
        match self.phase_index(at) {
            Some(index) => {
                let phase = &self.phases[index];
                BodyState {
                    at: phase.at(time_s),
                    heading: phase.heading(time_s),
                    speed_mps: phase.speed_mps(time_s),
                }
            }
            None => self.rest,
        }
    }

    /// Returns the next moment after `after` at which the law of motion changes; `None` when it is at
    /// rest for good.
    #[cfg(test)]
    pub fn next_change(&self, after: Time) -> Option<Time> {
        self.phases[self.phase_index(after)?..]
            .iter()
            .map(|phase| self.moment(phase.end_s()))
            .find(|moment| *moment > after)
    }

    /// Returns when the last command is done and the body at rest; `None` when that command moved nothing.
    pub fn arrival(&self) -> Option<Time> {
        self.phases.last().map(|phase| self.moment(phase.end_s()))
    }

    /// Returns where it will come to rest, and facing where, by the last command.
    #[cfg(test)]
    pub fn destination(&self) -> BodyState {
        self.rest
    }

    /// Returns whether the last command is done: no motion and no turn any more.
    pub fn is_done(&self, at: Time) -> bool {
        self.arrival().is_none_or(|arrival| arrival <= at)
    }

    /// Returns the limits of the drive.
    pub fn limits(&self) -> &DriveLimits {
        &self.limits
    }

    fn can_go_on(&self, state: BodyState, path: &[Piece]) -> bool {
        let Some(first) = path.first() else {
            return false;
        };
        let stretches = path.chunk_by(|before, after| is_gentle(before.heading, after.heading));
        let room_m = stretches.take(1).map(length_m).sum::<f64>();
        is_gentle(state.heading, first.heading)
            && self.limits.stopping_distance_m(state.speed_mps) <= room_m + 1e-9
    }

    /// The course of braking to rest along the path already laid; empty at rest or in a turn.
    fn braking(&self, now: Time, state: BodyState) -> PhaseBuilder {
        let mut course = PhaseBuilder::new(state.at, state.heading);
        if state.speed_mps > 0.0 {
            let path = self.path_ahead(now, self.limits.stopping_distance_m(state.speed_mps));
            let law = trapezoid(
                length_m(&path),
                state.speed_mps,
                state.speed_mps,
                &self.limits,
            );
            course.drive(&path, &law);
        }
        course
    }

    /// The straight pieces ahead until the next rest, cut off after `limit_m`.
    fn path_ahead(&self, now: Time, limit_m: f64) -> Vec<Piece> {
        let Some(index) = self.phase_index(now) else {
            return Vec::new();
        };
        let mut from = self.pose_at(now).at;
        let mut left_m = limit_m;
        let mut path = Vec::new();
        for phase in self.phases[index..]
            .iter()
            .take_while(|phase| phase.is_straight())
        {
            let piece = Piece::new(from, phase.to);
            if piece.length_m <= 0.0 {
                continue;
            }
            let to = if piece.length_m < left_m {
                phase.to
            } else {
                from.toward(phase.to, left_m / piece.length_m)
            };
            path.push(Piece {
                to,
                length_m: piece.length_m.min(left_m),
                heading: phase.heading,
                from,
            });
            left_m -= piece.length_m;
            if left_m <= 0.0 || phase.speed_mps(phase.end_s()) <= 0.0 {
                break;
            }
            from = phase.to;
        }
        path
    }

    fn follow(&mut self, now: Time, course: PhaseBuilder) {
        self.since = now;
        self.rest = BodyState {
            at: course.at,
            heading: course.heading,
            speed_mps: 0.0,
        };
        self.phases = course.phases;
    }

    /// The phases that are not over at `from` and have begun by `until`, in order.
    pub(super) fn phases_between(&self, from: Time, until: Time) -> &[MotionPhase] {
        let Some(first) = self.phase_index(from) else {
            return &[];
        };
        let until_s = self.seconds(until);
        let count = self.phases[first..].partition_point(|phase| phase.start_s < until_s);
        &self.phases[first..first + count]
    }

    /// Acceleration at a moment, m/s² in the local frame.
    pub(super) fn acceleration_at(&self, at: Time) -> Vector {
        self.phase_index(at)
            .map_or_else(Vector::default, |index| self.phases[index].acceleration())
    }

    pub(super) fn seconds(&self, at: Time) -> f64 {
        at.since(self.since).as_nanos() as f64 * 1e-9
    }

    /// The first whole nanosecond at or after a time of the phases.
    pub(super) fn moment(&self, time_s: f64) -> Time {
        self.since + Duration::from_nanos(libm::ceil(time_s * 1e9) as u64)
    }

    /// The last whole nanosecond at or before a time of the phases.
    pub(super) fn moment_before(&self, time_s: f64) -> Time {
        self.since + Duration::from_nanos((time_s * 1e9) as u64)
    }

    fn phase_index(&self, at: Time) -> Option<usize> {
        let last = self.phases.last()?;
        if self.moment(last.end_s()) <= at {
            return None;
        }
        let time_s = self.seconds(at);
        let index = self.phases.partition_point(|phase| phase.end_s() <= time_s);
        Some(index.min(self.phases.len() - 1))
    }
}

fn check_place(at: Point) -> Result<(), MotionRefusal> {
    if at.x_m.abs() < 1e6 && at.y_m.abs() < 1e6 {
        Ok(())
    } else {
        Err(MotionRefusal::Place { at })
    }
}

fn check_heading(heading: Angle) -> Result<(), MotionRefusal> {
    if heading.radians().is_finite() {
        Ok(())
    } else {
        Err(MotionRefusal::Heading)
    }
}

fn is_gentle(before: Angle, after: Angle) -> bool {
    (after - before).radians().abs() < GENTLE_BEND_RAD
}

fn length_m(path: &[Piece]) -> f64 {
    path.iter().map(|piece| piece.length_m).sum()
}

/// The pieces from a place through the corners, each longer than `SAME_PLACE_M`. Of corners in the
/// same place the last stays, so that a goal is met exactly; a place already taken is left out.
fn pieces(from: Point, corners: &[Point]) -> Vec<Piece> {
    let mut places = vec![from];
    for corner in corners {
        while places.len() > 1 && places[places.len() - 1].distance_to(*corner) <= SAME_PLACE_M {
            places.pop();
        }
        if places[places.len() - 1].distance_to(*corner) > SAME_PLACE_M {
            places.push(*corner);
        }
    }
    places
        .windows(2)
        .map(|pair| Piece::new(pair[0], pair[1]))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: DriveLimits = DriveLimits {
        speed_mps: 0.5,
        acceleration_mps2: 0.4,
        braking_mps2: 0.8,
        turn_rate_radps: 1.0,
    };

    fn rover() -> Body {
        Body::at_rest(Point::new(1.0, 2.0), Angle::default(), LIMITS).unwrap()
    }

    fn point(x_m: f64, y_m: f64) -> Point {
        Point::new(x_m, y_m)
    }

    fn secs(seconds_s: f64) -> Time {
        Time::from_secs_f64(seconds_s)
    }

    fn check_arrival(corners: &[Point], expected_s: f64) {
        let mut body = rover();
        body.drive(Time::ZERO, corners, 9.0).unwrap();
        let arrival = body.arrival().unwrap();
        assert!(
            (arrival.as_secs_f64() - expected_s).abs() < 1e-8,
            "arrived at {arrival}"
        );
        let end = body.pose_at(arrival);
        assert_eq!((end.at, end.speed_mps), (corners[corners.len() - 1], 0.0));
        assert_ne!(body.pose_at(arrival - Duration::from_millis(1)).at, end.at);
        assert!(body.is_done(arrival) && !body.is_done(arrival - Duration::from_nanos(1)));
    }

    // Trapezoid by hand: v/2a + v/2b more than the length at full speed.
    const TRAPEZOID_S: f64 = 0.5 / 0.8 + 0.5 / 1.6;

    #[test]
    fn a_straight_drive_takes_the_time_of_a_trapezoid() {
        check_arrival(&[point(6.0, 2.0)], 10.0 + TRAPEZOID_S);
        // Too short for full speed: L = v²/2a + v²/2b, v² = 2L·ab/(a+b), t = v/a + v/b.
        let peak_mps = (2.0 * 0.1 * 0.4 * 0.8 / 1.2f64).sqrt();
        check_arrival(&[point(1.1, 2.0)], peak_mps / 0.4 + peak_mps / 0.8);
    }

    #[test]
    fn corners_on_a_line_do_not_slow_it() {
        let corners = [
            point(2.0, 2.0),
            point(2.0, 2.0),
            point(3.5, 2.0),
            point(6.0, 2.0),
        ];
        check_arrival(&corners, 10.0 + TRAPEZOID_S);
    }

    #[test]
    fn a_sharp_corner_costs_a_rest_and_a_turn() {
        let turn_s = std::f64::consts::FRAC_PI_2;
        check_arrival(
            &[point(6.0, 2.0), point(6.0, 7.0)],
            20.0 + 2.0 * TRAPEZOID_S + turn_s,
        );
    }

    #[test]
    fn a_gentle_corner_is_passed_at_full_speed() {
        let end = point(6.0, 2.0) + Vector::polar(Angle::from_degrees(14.0), 5.0);
        check_arrival(&[point(6.0, 2.0), end], 20.0 + TRAPEZOID_S);
    }

    #[test]
    fn driving_begins_with_the_turn() {
        let mut body = rover();
        body.drive(secs(5.0), &[point(1.0, 0.0)], 0.2).unwrap();
        let half = body.pose_at(secs(5.0 + std::f64::consts::FRAC_PI_4));
        assert_eq!(half.at, point(1.0, 2.0));
        assert!((half.heading.degrees() + 45.0).abs() < 1e-6);
        assert_eq!(
            body.next_change(secs(5.0)),
            Some(body.moment(std::f64::consts::FRAC_PI_2))
        );
        assert_eq!(body.pose_at(secs(1.0)).heading, Angle::default());
    }

    #[test]
    fn a_drive_repeated_on_the_way_changes_nothing() {
        let corners = [point(4.0, 2.0), point(7.0, 2.4), point(7.0, 5.0)];
        let mut once = rover();
        once.drive(Time::ZERO, &corners, 0.5).unwrap();
        let mut often = once.clone();
        for tenth in 1..250 {
            let now = secs(f64::from(tenth) * 0.1);
            let (here, there) = (often.pose_at(now), once.pose_at(now));
            assert!(here.at.distance_to(there.at) < 1e-6, "at {now}");
            assert!((here.speed_mps - there.speed_mps).abs() < 1e-6, "at {now}");
            let ahead = corners.iter().filter(|corner| {
                let passed = corner.x_m < there.at.x_m + 1e-6 && corner.y_m < there.at.y_m + 1e-6;
                !passed
            });
            often
                .drive(now, &ahead.copied().collect::<Vec<_>>(), 0.5)
                .unwrap();
        }
    }

    #[test]
    fn a_stop_takes_the_stopping_distance() {
        let mut body = rover();
        body.drive(Time::ZERO, &[point(9.0, 2.0)], 0.5).unwrap();
        body.stop(secs(5.0));
        let way_m = body.destination().at.x_m - body.pose_at(secs(5.0)).at.x_m;
        assert!((way_m - 0.25 / 1.6).abs() < 1e-9);
        assert!((body.arrival().unwrap().as_secs_f64() - 5.0 - 0.5 / 0.8).abs() < 1e-8);
        body.stop(secs(50.0));
        assert_eq!((body.arrival(), body.next_change(secs(50.0))), (None, None));
    }

    #[test]
    fn a_goal_behind_is_reached_after_braking_and_turning_round() {
        let mut body = rover();
        body.drive(Time::ZERO, &[point(9.0, 2.0)], 0.5).unwrap();
        body.drive(secs(5.0), &[point(2.0, 2.0)], 0.5).unwrap();
        let furthest = body.pose_at(secs(5.0)).at.x_m + 0.25 / 1.6;
        assert!((body.pose_at(secs(5.0 + 0.625)).at.x_m - furthest).abs() < 1e-6);
        assert_eq!(body.destination().at, point(2.0, 2.0));
    }

    #[test]
    fn a_goal_too_near_to_stop_is_passed_and_come_back_to() {
        for ahead_m in [0.0, 0.05, 0.1, 0.15, 0.156] {
            let mut body = rover();
            body.drive(Time::ZERO, &[point(9.0, 2.0)], 0.5).unwrap();
            let start = body.pose_at(secs(5.0)).at;
            let goal = start + Vector::new(ahead_m, 0.0);
            body.drive(secs(5.0), &[goal], 0.5).unwrap();
            // It rests where braking ends, 0.15625 m on, after 0.625 s.
            let rest = body.pose_at(secs(5.0 + 0.6251));
            assert!((rest.at.x_m - start.x_m - 0.25 / 1.6).abs() < 1e-9 && rest.speed_mps == 0.0);
            assert_eq!(body.pose_at(body.arrival().unwrap()).at, goal);
        }
    }

    #[test]
    fn a_lower_speed_limit_is_braked_to() {
        let mut body = rover();
        body.drive(Time::ZERO, &[point(9.0, 2.0)], 0.5).unwrap();
        body.drive(secs(5.0), &[point(9.0, 2.0)], 0.1).unwrap();
        assert!((body.pose_at(secs(5.0 + 0.4 / 0.8)).speed_mps - 0.1).abs() < 1e-9);
        assert!((body.pose_at(secs(9.0)).speed_mps - 0.1).abs() < 1e-9);
    }

    #[test]
    fn commands_without_motion_end_at_once() {
        let mut body = rover();
        body.drive(secs(1.0), &[], 0.5).unwrap();
        assert_eq!(body.arrival(), None);
        body.drive(secs(1.0), &[point(1.0, 2.0), point(1.0, 2.0)], 0.5)
            .unwrap();
        assert_eq!(body.arrival(), None);
        body.turn(secs(1.0), Angle::default()).unwrap();
        assert!(body.is_done(secs(1.0)));
    }

    #[test]
    fn impossible_commands_are_refused_and_change_nothing() {
        let mut body = rover();
        body.drive(Time::ZERO, &[point(9.0, 2.0)], 0.5).unwrap();
        let before = body.arrival();
        let nowhere = point(f64::NAN, 0.0);
        assert!(matches!(
            body.drive(secs(1.0), &[nowhere], 0.5),
            Err(MotionRefusal::Place { .. })
        ));
        assert!(matches!(
            body.drive(secs(1.0), &[point(1e9, 0.0)], 0.5),
            Err(MotionRefusal::Place { .. })
        ));
        for speed_mps in [f64::NAN, 0.0, -1.0] {
            let refusal = body.drive(secs(1.0), &[], speed_mps);
            assert!(matches!(refusal, Err(MotionRefusal::Speed { .. })));
        }
        assert_eq!(
            body.turn(secs(1.0), Angle::from_radians(f64::NAN)),
            Err(MotionRefusal::Heading)
        );
        assert_eq!(body.arrival(), before);
        let weak = DriveLimits {
            braking_mps2: 0.0,
            ..LIMITS
        };
        assert!(matches!(
            Body::at_rest(nowhere, Angle::default(), LIMITS),
            Err(MotionRefusal::Place { .. })
        ));
        assert!(matches!(
            Body::at_rest(Point::default(), Angle::default(), weak),
            Err(MotionRefusal::Limits)
        ));
    }

    #[derive(Clone, Debug)]
    enum Command {
        /// Corners (counted from where it is, if so) and speed limit.
        Drive(bool, Vec<(f64, f64)>, f64),
        Turn(f64),
        Stop,
    }

    fn command() -> impl Strategy<Value = (f64, Command)> {
        let corner = (-3.0..3.0f64, -3.0..3.0f64);
        let near = (-0.3..0.3f64, -0.3..0.3f64);
        let corners = prop::collection::vec(prop_oneof![corner, near], 0..6);
        let what = prop_oneof![
            4 => (any::<bool>(), corners, 0.05..0.6f64)
                .prop_map(|(from_here, corners, limit)| Command::Drive(from_here, corners, limit)),
            1 => (-4.0..4.0f64).prop_map(Command::Turn),
            1 => Just(Command::Stop),
        ];
        (0.0..6.0f64, what)
    }

    const STEP_S: f64 = 0.004;

    /// Compares two states a step apart with what the limits allow in that time.
    fn check_step(before: BodyState, after: BodyState, top_mps: f64) {
        let way_m = before.at.distance_to(after.at);
        assert!(way_m <= before.speed_mps.max(after.speed_mps) * STEP_S + 1e-4 * STEP_S + 1e-5);
        assert!(after.speed_mps <= top_mps + 1e-9 || after.speed_mps < before.speed_mps);
        let rate_mps2 = (after.speed_mps - before.speed_mps) / STEP_S;
        assert!(
            (-0.8 * 1.001 - 0.01..=0.4 * 1.001 + 0.01).contains(&rate_mps2),
            "{rate_mps2} m/s²"
        );
        if before.speed_mps == 0.0 && after.speed_mps == 0.0 {
            assert!(way_m < 1e-9);
            assert!((after.heading - before.heading).radians().abs() <= STEP_S * 1.001);
        } else {
            let bend_rad = (after.heading - before.heading).radians().abs();
            assert!(bend_rad < GENTLE_BEND_RAD + STEP_S || after.speed_mps < 0.01);
        }
    }

    proptest! {
        #[test]
        fn motion_keeps_its_limits_and_ends_in_the_goal(
            commands in prop::collection::vec(command(), 1..8),
        ) {
            let (mut body, mut now) = (rover(), secs(1.0));
            for (wait_s, command) in commands {
                let before = body.pose_at(now);
                let mut top_mps = 0.5;
                match command {
                    Command::Drive(from_here, corners, limit_mps) => {
                        let origin = if from_here { before.at } else { Point::default() };
                        let corners: Vec<Point> =
                            corners.iter().map(|(x, y)| origin + Vector::new(*x, *y)).collect();
                        body.drive(now, &corners, limit_mps).unwrap();
                        top_mps = limit_mps.min(0.5);
                        if let Some(goal) = corners.last() {
                            prop_assert_eq!(body.destination().at, *goal);
                        }
                    }
                    Command::Turn(to_rad) => body.turn(now, Angle::from_radians(to_rad)).unwrap(),
                    Command::Stop => body.stop(now),
                }
                let at_once = body.pose_at(now);
                prop_assert!(before.at.distance_to(at_once.at) < 1e-9);
                prop_assert!((before.speed_mps - at_once.speed_mps).abs() < 1e-4);
                if let Some(arrival) = body.arrival() {
                    prop_assert_eq!(body.pose_at(arrival), body.destination());
                    let near = body.pose_at(arrival - Duration::from_nanos(2));
                    prop_assert!(near.at.distance_to(body.destination().at) < 1e-6);
                }
                let until = now + Duration::from_secs_f64(wait_s);
                let mut state = at_once;
                while now < until {
                    now = now + Duration::from_secs_f64(STEP_S);
                    let next = body.pose_at(now);
                    check_step(state, next, top_mps);
                    state = next;
                }
            }
        }

        #[test]
        fn changes_come_in_order_and_end_with_the_arrival(
            corners in prop::collection::vec((-3.0..3.0f64, -3.0..3.0f64), 1..6),
        ) {
            let mut body = rover();
            let corners: Vec<Point> = corners.iter().map(|(x, y)| point(*x, *y)).collect();
            body.drive(secs(1.0), &corners, 0.5).unwrap();
            let (mut now, mut count) = (secs(1.0), 0);
            while let Some(next) = body.next_change(now) {
                prop_assert!(next > now);
                (now, count) = (next, count + 1);
            }
            prop_assert_eq!(Some(now), body.arrival());
            prop_assert!(count <= 4 * corners.len());
        }
    }
}
