//! The motion of a vehicle: its body in the plane and its altitude, moved by stages one after the other, each with an end
//! that is known when it begins. It knows no mode, no mission and no error of places: who begins a stage says which places
//! are the true ones, and decides what follows when all stages are over.

use std::collections::VecDeque;

use super::super::body::{Body, BodyState};
use super::flight::Climb;
use super::stages::Stage;
use crate::geom::Point;
use crate::time::Time;

/// A body in space with the stages that are laid for it.
#[derive(Clone, Debug)]
pub struct StagedMotion {
    body: Body,
    climb: Climb,
    stages: VecDeque<Stage>,
    /// When the stage under way is over; `None` = none is under way.
    stage_ends: Option<Time>,
    changes: u64,
}

impl StagedMotion {
    /// Takes a body at rest at an altitude, metres.
    pub(super) fn at_rest(body: Body, altitude_m: f64) -> StagedMotion {
        StagedMotion {
            body,
            climb: Climb::level(altitude_m),
            stages: VecDeque::new(),
            stage_ends: None,
            changes: 0,
        }
    }

    /// Returns the body, as it moves in the plane.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Returns the change of altitude.
    pub fn climb(&self) -> &Climb {
        &self.climb
    }

    /// Returns where the body is at a moment, as far as its stage goes.
    pub fn pose_at(&self, at: Time) -> BodyState {
        self.body.pose_at(at)
    }

    /// Returns the altitude above the ground at its start, metres.
    pub fn altitude_m(&self, at: Time) -> f64 {
        self.climb.altitude_m(at)
    }

    /// Returns a number that changes whenever the motion does.
    pub fn changes(&self) -> u64 {
        self.changes
    }

    /// Returns whether it neither moves nor turns nor climbs.
    pub fn is_at_rest(&self, at: Time) -> bool {
        self.body.is_done(at) && self.climb.until() <= at
    }

    /// Returns when the stage under way is over; `None` = none is under way.
    pub(super) fn stage_ends(&self) -> Option<Time> {
        self.stage_ends
    }

    /// Returns until when body or altitude change, as far as the stage under way goes.
    pub(super) fn moves_until(&self) -> Time {
        let arrival = self.body.arrival().unwrap_or(Time::ZERO);
        arrival.max(self.climb.until())
    }

    /// Lays stages in place of those that are left; the one under way goes on until [`StagedMotion::begin_next`].
    pub(super) fn lay(&mut self, stages: Vec<Stage>) {
        self.stages = stages.into();
    }

    /// Ends the stage under way; returns whether no other one is left.
    pub(super) fn end_stage(&mut self) -> bool {
        self.stage_ends = None;
        self.stages.is_empty()
    }

    /// Begins the next stage, if one is left; `to_true` turns the places that are steered for into true ones. Returns whether
    /// it has touched down: then it is for the caller to end that stage ([`StagedMotion::touch_down`]).
    pub(super) fn begin_next(&mut self, now: Time, to_true: impl FnOnce(&mut [Point])) -> bool {
        self.stage_ends = None;
        let Some(stage) = self.stages.pop_front() else {
            return false;
        };
        self.changes += 1;
        if stage.is_done_at_rest() && self.body.pose_at(now).speed_mps > 0.0 {
            // What is done on the spot waits until it stands.
            self.stages.push_front(stage);
            self.brake(now);
            return false;
        }
        self.climb = self.climb.halted(now);
        match stage {
            Stage::Drive {
                mut corners,
                speed_mps,
            } => {
                to_true(&mut corners);
                // An impossible command leaves the motion as it was.
                let _ = self.body.drive(now, &corners, speed_mps);
                self.end_with_body(now);
            }
            Stage::Turn(heading) => {
                // Checked when it was asked for; a body refuses nothing else.
                let _ = self.body.turn(now, heading);
                self.end_with_body(now);
            }
            Stage::Climb { to_m, rate_mps } => {
                self.climb = self.climb.towards(now, to_m, rate_mps);
                self.stage_ends = Some(self.climb.until());
            }
            Stage::Stand(time) => self.stage_ends = Some(now + time),
            Stage::Brake => self.brake(now),
            Stage::Touchdown => return true,
        }
        false
    }

    /// Stands on the ground; the stage of touching down is over at once.
    pub(super) fn touch_down(&mut self, now: Time) {
        self.climb = Climb::level(0.0).halted(now);
        self.stage_ends = Some(now);
    }

    /// Brakes and gives up all stages, since the motors have no current any more; what climbs goes on to climb.
    pub(super) fn cut(&mut self, now: Time) {
        self.stages.clear();
        self.stage_ends = None;
        self.body.stop(now);
        self.changes += 1;
    }

    /// Comes to rest at once, against all limits.
    pub(super) fn wreck(&mut self, at: Time) {
        self.stages.clear();
        self.stage_ends = None;
        self.body.halt(at);
        self.climb = Climb::level(self.climb.altitude_m(at));
        self.changes += 1;
    }

    fn brake(&mut self, now: Time) {
        self.body.stop(now);
        self.climb = self.climb.halted(now);
        self.end_with_body(now);
    }

    fn end_with_body(&mut self, now: Time) {
        self.stage_ends = Some(self.body.arrival().unwrap_or(now).max(now));
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::super::tests::{LIMITS, secs};
    use super::*;
    use crate::geom::{Angle, Vector};

    fn motion(altitude_m: f64) -> StagedMotion {
        let body = Body::at_rest(Point::default(), Angle::ZERO, LIMITS).unwrap();
        StagedMotion::at_rest(body, altitude_m)
    }

    fn drive(x_m: f64) -> Stage {
        Stage::Drive {
            corners: vec![Point::new(x_m, 0.0)],
            speed_mps: 2.0,
        }
    }

    fn begin(motion: &mut StagedMotion, now_s: f64, stages: Vec<Stage>) -> bool {
        motion.lay(stages);
        motion.begin_next(secs(now_s), |_| ())
    }

    #[test]
    fn stages_follow_each_other_each_with_its_end() {
        let mut motion = motion(1.0);
        let climb = Stage::Climb {
            to_m: 3.0,
            rate_mps: 0.5,
        };
        let stand = Stage::Stand(Duration::from_secs(3));
        // 8 m in 6 s: two of them to come to speed, and two to rest.
        begin(&mut motion, 10.0, vec![climb, drive(8.0), stand]);
        for (ends_s, is_last) in [(14.0, false), (20.0, false), (23.0, true)] {
            assert_eq!(motion.stage_ends(), Some(secs(ends_s)));
            assert_eq!(motion.end_stage(), is_last);
            motion.begin_next(secs(ends_s), |_| ());
        }
        assert_eq!((motion.stage_ends(), motion.changes()), (None, 3));
        assert_eq!(motion.altitude_m(secs(23.0)), 3.0);
        assert!((motion.pose_at(secs(23.0)).at.x_m - 8.0).abs() < 1e-9);
    }

    #[test]
    fn what_is_done_on_the_spot_waits_until_it_stands() {
        let mut motion = motion(5.0);
        begin(&mut motion, 0.0, vec![drive(50.0)]);
        begin(
            &mut motion,
            10.0,
            vec![Stage::Climb {
                to_m: 0.0,
                rate_mps: 1.0,
            }],
        );
        assert_eq!(
            motion.stage_ends(),
            Some(secs(12.0)),
            "it brakes from 2 m/s"
        );
        assert!(!motion.end_stage());
        motion.begin_next(secs(12.0), |_| ());
        assert_eq!(motion.stage_ends(), Some(secs(17.0)));
        assert!(!motion.is_at_rest(secs(16.9)) && motion.is_at_rest(secs(17.0)));
    }

    #[test]
    fn a_climb_that_is_given_up_ends_where_it_is() {
        let mut motion = motion(0.0);
        begin(
            &mut motion,
            0.0,
            vec![Stage::Climb {
                to_m: 9.0,
                rate_mps: 2.0,
            }],
        );
        assert_eq!(motion.moves_until(), secs(4.5));
        begin(&mut motion, 1.0, vec![Stage::Brake]);
        assert_eq!(
            (motion.altitude_m(secs(9.0)), motion.moves_until()),
            (2.0, secs(1.0))
        );
    }

    #[test]
    fn it_drives_to_the_true_places_that_it_is_told() {
        let mut motion = motion(0.0);
        motion.lay(vec![drive(4.0)]);
        let aside = |corners: &mut [Point]| {
            corners
                .iter_mut()
                .for_each(|corner| *corner += Vector::new(1.0, 0.0))
        };
        motion.begin_next(secs(0.0), aside);
        assert!((motion.pose_at(secs(60.0)).at.x_m - 5.0).abs() < 1e-9);
    }

    #[test]
    fn a_touchdown_is_left_to_the_caller_and_is_over_at_once() {
        let mut motion = motion(0.04);
        assert!(begin(&mut motion, 3.0, vec![Stage::Touchdown]));
        assert_eq!(motion.stage_ends(), None);
        motion.touch_down(secs(3.0));
        assert_eq!(
            (motion.stage_ends(), motion.altitude_m(secs(3.0))),
            (Some(secs(3.0)), 0.0)
        );
    }

    #[test]
    fn without_current_it_brakes_and_a_wreck_stands_at_once() {
        type GiveUp = fn(&mut StagedMotion, Time);
        let (cut, wreck): (GiveUp, GiveUp) = (StagedMotion::cut, StagedMotion::wreck);
        for (give_up, rests_s) in [(cut, 12.0), (wreck, 10.0)] {
            let mut motion = motion(0.0);
            begin(&mut motion, 0.0, vec![drive(50.0), drive(0.0)]);
            let before = motion.changes();
            give_up(&mut motion, secs(10.0));
            assert_eq!((motion.stage_ends(), motion.changes()), (None, before + 1));
            assert_eq!(motion.is_at_rest(secs(10.0)), rests_s == 10.0);
            assert!(motion.is_at_rest(secs(rests_s)));
            assert!(!motion.begin_next(secs(20.0), |_| ()), "nothing is left");
        }
    }
}
