//! Whether the vehicle knows its place, and what follows from that for what it is out for. As long as it does not, it
//! stands: nothing is searched, driven, visited or given up where it only seems to be. A place that is merely worse than
//! it was is driven with, but nothing is claimed with it: what is too narrow for a vehicle that may be anywhere need not be
//! so for one that knows where it is. In the same way nothing is claimed by a vehicle whose range sensors do not answer.
//!
//! ```text
//!   [Good] ◄─ as well known as lately ─► [Worse] ◄─ pose_sd_max_m ─► [Unknown]
//! ```
//!
//! A mission that must wait for its place ends after [`PLACE_WITHIN`] and says so. Who follows a plan of the ground station
//! stands as long as its range sensors do not answer, and goes home after [`OUT_OF_SERVICE_AFTER`], over its own track alone.
//! Deliberately absent: the stop of a vehicle that drives without a place, which the vehicle actor does by itself.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::autonomy::Decision;
use super::goal::Goal;
use super::{AutonomyCause, EndReason, Mission, MissionEvent, Out, is_at_home};
use crate::sweep::OUT_OF_SERVICE_AFTER;
use crate::time::Time;

/// A mission that waits for its place is given up after this long. People read of it in docs/modules.md.
const PLACE_WITHIN: Duration = Duration::from_secs(300);
/// Range sensors that have not answered for [`OUT_OF_SERVICE_AFTER`] are trusted again when they have answered for this long.
const SEES_AGAIN_AFTER: Duration = Duration::from_secs(30);
/// How well the place was known counts for this long.
const LATELY: Duration = Duration::from_secs(600);
/// A place whose deviation is this many times what it was lately is worse known.
const WORSE_THAN_LATELY: f64 = 1.5;
/// A deviation that is larger by less than this is none worse, metres.
const WORSE_THAN_LATELY_M: f64 = 0.02;

/// How well the place is known.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
enum PlaceQuality {
    Good,
    Worse,
    Unknown,
}

/// How well the vehicle knows its place, and since when something waits for that.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct PlaceWatch {
    sd_max_m: f64,
    quality: PlaceQuality,
    /// Since when its range sensors do not answer.
    blind_since: Option<Time>,
    /// Since when they answer.
    sees_since: Option<Time>,
    /// They have not for too long, and not for long since.
    is_blind: bool,
    /// The least deviation of late, metres, and when it was said.
    least: Option<(Time, f64)>,
    waits_since: Option<Time>,
    /// It rests at home: so it was when the place was known, and it has rested since.
    rests_at_home: bool,
}

impl PlaceWatch {
    /// Makes the watch of a vehicle that has not said where it is; above `sd_max_m` it does not know.
    pub(super) fn new(sd_max_m: f64) -> PlaceWatch {
        PlaceWatch {
            sd_max_m,
            quality: PlaceQuality::Good,
            blind_since: None,
            sees_since: None,
            is_blind: false,
            least: None,
            waits_since: None,
            rests_at_home: false,
        }
    }

    /// Records the deviation of the place, metres, and whether the range sensors answer; returns whether the place is known
    /// when that is news.
    pub(super) fn take(&mut self, now: Time, sd_m: f64, sees: bool) -> Option<bool> {
        let was_known = self.is_known();
        let is_least = |(at, least_m)| sd_m <= least_m || now.since(at) > LATELY;
        let is_known = sd_m <= self.sd_max_m;
        // Without a place nothing is asked of them.
        (self.blind_since, self.sees_since) = match (is_known, sees) {
            (false, _) => (None, None),
            (true, true) => (None, self.sees_since.or(Some(now))),
            (true, false) => (self.blind_since.or(Some(now)), None),
        };
        let is_long =
            |since: Option<Time>, at_least| since.is_some_and(|since| now.since(since) >= at_least);
        self.is_blind = is_long(self.blind_since, OUT_OF_SERVICE_AFTER)
            || (self.is_blind && !is_long(self.sees_since, SEES_AGAIN_AFTER));
        if is_known && self.least.is_none_or(is_least) {
            self.least = Some((now, sd_m));
        }
        let is_as_good =
            |(_, least_m): (Time, f64)| sd_m <= WORSE_THAN_LATELY * least_m + WORSE_THAN_LATELY_M;
        self.quality = match is_known {
            false => PlaceQuality::Unknown,
            true if self.least.is_none_or(is_as_good) => PlaceQuality::Good,
            true => PlaceQuality::Worse,
        };
        if self.may_claim() {
            self.end_wait();
        }
        (self.is_known() != was_known).then_some(is_known)
    }

    /// Records whether the vehicle rests, and whether it seems to be at home.
    pub(super) fn note_rest(&mut self, rests: bool, seems_home: bool) {
        let is_home = match self.is_known() {
            true => seems_home,
            // Where it seems to be says nothing.
            false => self.rests_at_home,
        };
        self.rests_at_home = rests && is_home;
    }

    /// Returns whether the place is known well enough to go on.
    pub(super) fn is_known(&self) -> bool {
        match self.quality {
            PlaceQuality::Good | PlaceQuality::Worse => true,
            PlaceQuality::Unknown => false,
        }
    }

    /// Returns whether the vehicle rests at home: it did when its place was known last, and has rested since.
    pub(super) fn rests_at_home(&self) -> bool {
        self.rests_at_home
    }

    /// Returns whether the range sensors answer.
    pub(super) fn sees(&self) -> bool {
        self.blind_since.is_none()
    }

    /// Returns whether the range sensors have not answered for too long.
    pub(super) fn is_blind(&self) -> bool {
        self.is_blind
    }

    /// Returns whether the place is known and the world seen so well that what is said of other places is true.
    pub(super) fn may_claim(&self) -> bool {
        match self.quality {
            PlaceQuality::Good => self.sees(),
            PlaceQuality::Worse | PlaceQuality::Unknown => false,
        }
    }

    /// Returns why a mission ends that has waited too long.
    pub(super) fn reason(&self) -> EndReason {
        match self.sees() {
            true => EndReason::NoPlace,
            false => EndReason::Blind,
        }
    }

    /// Records that something waits for the place; returns whether it has waited too long.
    pub(super) fn wait(&mut self, now: Time) -> bool {
        now.since(*self.waits_since.get_or_insert(now)) >= PLACE_WITHIN
    }

    /// Returns whether something has waited for so long.
    fn has_waited(&self, now: Time, at_least: Duration) -> bool {
        self.waits_since
            .is_some_and(|since| now.since(since) >= at_least)
    }

    /// Records that nothing waits for the place any more.
    pub(super) fn end_wait(&mut self) {
        self.waits_since = None;
    }
}

impl Mission {
    /// Returns whether the vehicle is at its home by the place that it believes to be at.
    pub(super) fn seems_home(&self) -> bool {
        let state = self.state.as_ref();
        state.is_some_and(|state| is_at_home(state.pose, self.settings.home))
    }

    /// Takes how well the place is known, metres, and whether the world is seen; says so when the vehicle stands for its
    /// place, or goes on.
    pub(super) fn watch_place(&mut self, now: Time, sd_m: f64, sees: bool, out: &mut Vec<Out>) {
        let event = match self.place.take(now, sd_m, sees) {
            None => return,
            Some(true) => MissionEvent::PlaceFound,
            Some(false) => MissionEvent::PlaceLost,
        };
        out.push(Out::MissionEvent(event));
        if !self.place.is_known() && self.goal.is_under_way() {
            self.stop(now, out);
        }
    }

    /// Without a place: a mission of its own waits for it, and ends when that takes too long. Who rests at home since it knew
    /// its place has come home when it is to return.
    pub(super) fn wait_for_place(&mut self, now: Time, out: &mut Vec<Out>) {
        self.end_return_at_home(out);
        if self.goal != Goal::Following {
            return self.place.end_wait();
        }
        if self.place.wait(now) {
            self.end_own_mission(EndReason::NoPlace, out);
        }
        if self.runner.is_none() && self.place.has_waited(now, OUT_OF_SERVICE_AFTER) {
            // Whoever plans goes on without it: it moves again only under a newer plan.
            self.plan.leave();
        }
    }

    /// A vehicle that follows a plan and does not see stands, and goes home when that takes too long; returns whether it
    /// does not see.
    pub(super) fn waits_to_see(&mut self, now: Time, out: &mut Vec<Out>) -> bool {
        if self.place.sees() {
            return false;
        }
        let drives = self.state.as_ref().is_some_and(|state| state.leg.is_some());
        if self.place.is_blind() {
            self.carry_out(now, Decision::Return(AutonomyCause::Blind), out);
        } else if drives {
            self.stop(now, out);
        }
        true
    }

    /// Ends the return of a vehicle that rests at home already, and cannot or need not drive; returns whether it is one.
    pub(super) fn end_return_at_home(&mut self, out: &mut Vec<Out>) -> bool {
        let Goal::Returning(home) = self.goal else {
            return false;
        };
        if self.place.rests_at_home {
            self.goal = Goal::Home(home.by);
            out.push(Out::MissionEvent(MissionEvent::Home));
        }
        self.place.rests_at_home
    }

    /// Ends the mission of its own that is under way, if there is one.
    pub(super) fn end_own_mission(&mut self, end: EndReason, out: &mut Vec<Out>) {
        let runner = self.runner.as_mut().filter(|runner| runner.end().is_none());
        if let Some(runner) = runner {
            runner.end_for(end.clone());
            out.push(Out::MissionEvent(MissionEvent::Ended(end)));
        }
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{OrderKind, StandReason, TaskKind};

    use super::super::tests::{at, driven, fed, order, planned, started};
    use super::*;
    use crate::actor::Actor;
    use crate::geom::Point;
    use crate::node::OwnState;
    use crate::node::mission::goal::GoalSource;
    use crate::node::mission::{In, MissionStatus};
    use crate::node::tests_support::{own_state, settings};

    /// A vehicle at a place on x that knows it this well.
    fn state(x_m: f64, sd_m: f64) -> In {
        let mut own = own_state(x_m, 0.0);
        own.pose.sd_m = sd_m;
        In::State(own)
    }

    fn said(out: &[Out]) -> Vec<MissionEvent> {
        let event = |output: &Out| match output {
            Out::MissionEvent(event) => Some(event.clone()),
            Out::Command(..)
            | Out::Holds(_)
            | Out::Accepted(..)
            | Out::Progress(_)
            | Out::Remember(_)
            | Out::Measure(_) => None,
        };
        out.iter().filter_map(event).collect()
    }

    #[test]
    fn a_place_is_good_worse_or_unknown_by_what_it_was_lately() {
        let mut watch = PlaceWatch::new(0.5);
        let mut shows = |time_s: f64, sd_m: f64| {
            let news = watch.take(at(time_s), sd_m, true);
            (news, watch.is_known(), watch.may_claim())
        };
        assert_eq!(shows(1.0, 0.1), (None, true, true));
        assert_eq!(shows(2.0, 0.16), (None, true, true));
        assert_eq!(shows(3.0, 0.18), (None, true, false), "worse");
        assert_eq!(shows(4.0, 0.51), (Some(false), false, false));
        assert_eq!(shows(5.0, f64::NAN), (None, false, false));
        assert_eq!(shows(6.0, 0.18), (Some(true), true, false));
        assert_eq!(shows(602.0, 0.18), (None, true, true), "as for long");
    }

    #[test]
    fn who_does_not_see_claims_nothing_and_says_that_reason() {
        let mut watch = PlaceWatch::new(0.5);
        watch.take(at(1.0), 0.1, false);
        assert_eq!(
            (watch.may_claim(), watch.reason()),
            (false, EndReason::Blind)
        );
        watch.take(at(1.0), 0.6, false);
        assert_eq!(watch.reason(), EndReason::NoPlace);
        watch.take(at(1.0), 0.1, true);
        assert!(watch.may_claim());
    }

    #[test]
    fn a_mission_without_a_sensor_is_given_up_and_one_that_sees_again_goes_on() {
        for (blind_until_s, expected) in [
            (400.0, Some(EndReason::Blind)),
            (200.0, Some(EndReason::Done)),
        ] {
            let mut mission = started(TaskKind::Browse);
            let mut own = own_state(0.0, 0.0);
            for step in 0..4000 {
                let now_s = 2.0 + 0.1 * f64::from(step);
                own.sees = now_s > blind_until_s;
                let mut out = fed(&mut mission, now_s, In::State(own.clone()));
                mission.wake(at(now_s + 0.05), &mut out).unwrap();
                turn(&mut own, &out);
            }
            let end = mission
                .runner
                .as_ref()
                .and_then(|runner| runner.end())
                .cloned();
            assert_eq!(end, expected);
        }
    }

    #[test]
    fn who_follows_a_plan_and_does_not_see_stands_and_goes_home_after_a_minute() {
        let mut mission = planned(None);
        fed(&mut mission, 2.0, order(OrderKind::Start));
        let mut own = own_state(0.5, 0.0);
        own.leg = Some(vec![Point::new(0.5, 0.0), Point::new(2.0, 0.0)]);
        own.sees = false;
        let out = fed(&mut mission, 3.0, In::State(own.clone()));
        assert!(super::super::tests::holds(&out), "{out:?}");
        own.leg = None;
        let out = fed(&mut mission, 62.9, In::State(own.clone()));
        assert_eq!((said(&out), driven(&out)), (vec![], None), "it stands");
        assert_eq!(mission.holds_for(), None);
        let out = fed(&mut mission, 63.0, In::State(own.clone()));
        let decided = MissionEvent::Decides(AutonomyCause::Blind, MissionStatus::Returning);
        assert!(said(&out).contains(&decided), "{out:?}");
        assert_eq!(mission.holds_for(), Some(StandReason::Blind));
        // A start leads it nowhere once it is at home, until it sees.
        mission.goal = Goal::Home(GoalSource::Itself(AutonomyCause::Blind));
        for (now_s, sees, is_kept) in [
            (70.0, false, true),
            (71.0, true, true),
            (72.0, false, true),
            (73.0, true, true),
            (102.9, true, true),
            (103.0, true, false),
        ] {
            own.sees = sees;
            fed(&mut mission, now_s, In::State(own.clone()));
            let reason = is_kept.then_some(StandReason::Blind);
            assert_eq!(mission.holds_for(), reason, "{now_s} s");
            fed(&mut mission, now_s, order(OrderKind::Start));
            let status = if is_kept {
                MissionStatus::Home
            } else {
                MissionStatus::Following
            };
            assert_eq!(mission.goal.status(), status, "{now_s} s");
        }
        // The others drive under another plan by now.
        let out = fed(&mut mission, 103.1, In::State(own));
        assert_eq!(driven(&out), None);
    }

    #[test]
    fn who_does_not_see_is_not_woken_for_what_it_would_search() {
        let mut mission = planned(Some((1.4, 1.8)));
        fed(&mut mission, 2.0, order(OrderKind::Start));
        let mut own = own_state(0.8, 0.0);
        let mut now_s = 2.0;
        while mission.goal_deadline().is_none() {
            now_s += 0.1;
            assert!(now_s < 60.0, "the wall is not met");
            fed(&mut mission, now_s, In::State(own.clone()));
        }
        own.sees = false;
        fed(&mut mission, now_s + 0.1, In::State(own.clone()));
        assert_eq!(mission.goal_deadline().map(|due| due.why), None);
        own.sees = true;
        fed(&mut mission, now_s + 0.2, In::State(own));
        assert!(mission.goal_deadline().is_some(), "it searches again");
    }

    #[test]
    fn who_sees_again_within_a_minute_goes_on_with_its_plan() {
        let mut mission = planned(None);
        fed(&mut mission, 2.0, order(OrderKind::Start));
        let mut own = own_state(0.5, 0.0);
        for (now_s, sees, drives) in [
            (3.0, false, false),
            (50.0, false, false),
            (51.0, true, true),
            (52.0, false, false),
            (100.0, false, false),
        ] {
            own.sees = sees;
            let out = fed(&mut mission, now_s, In::State(own.clone()));
            assert_eq!(driven(&out).is_some(), drives, "{now_s} s: {out:?}");
            assert_eq!(mission.goal.status(), MissionStatus::Following);
        }
    }

    #[test]
    fn a_vehicle_without_a_place_stands_and_neither_drives_nor_arrives() {
        let mut mission = planned(None);
        fed(&mut mission, 2.0, order(OrderKind::Start));
        let out = fed(&mut mission, 3.0, state(0.5, 0.6));
        assert_eq!(said(&out), [MissionEvent::PlaceLost]);
        assert!(super::super::tests::holds(&out));
        let out = fed(&mut mission, 4.0, state(2.0, 0.6));
        assert_eq!(
            (said(&out), driven(&out)),
            (vec![], None),
            "stop 1 is there"
        );
        let out = fed(&mut mission, 5.0, state(0.5, 0.05));
        assert_eq!(said(&out), [MissionEvent::PlaceFound]);
        assert!(driven(&out).is_some(), "it goes on");
    }

    #[test]
    fn who_has_not_known_its_place_follows_no_plan_from_there() {
        let mut mission = Mission::new(settings(1));
        fed(&mut mission, 1.0, state(9.0, 3.0));
        assert!(!mission.plan.is_begun());
        fed(&mut mission, 2.0, state(0.0, 0.05));
        assert!(mission.plan.is_begun());
    }

    #[test]
    fn a_mission_that_waits_too_long_for_its_place_is_given_up_and_makes_no_step() {
        let mut mission = started(TaskKind::Explore);
        let mut ended = None;
        for step in 1..4000 {
            let now_s = 2.0 + 0.1 * f64::from(step);
            let out = fed(&mut mission, now_s, state(0.3, 0.6));
            assert_eq!(driven(&out), None);
            if said(&out).contains(&MissionEvent::Ended(EndReason::NoPlace)) {
                assert_eq!(ended.replace(now_s), None, "once");
            }
        }
        let within_s = PLACE_WITHIN.as_secs_f64();
        assert!(ended.is_some_and(|at_s| (at_s - 2.1 - within_s).abs() < 0.2));
    }

    #[test]
    fn a_short_time_without_a_place_ends_no_mission() {
        let mut mission = started(TaskKind::Explore);
        fed(&mut mission, 2.0, state(0.3, 0.6));
        fed(&mut mission, 290.0, state(0.3, 0.6));
        fed(&mut mission, 291.0, state(0.3, 0.05));
        fed(&mut mission, 292.0, state(0.3, 0.6));
        fed(&mut mission, 590.0, state(0.3, 0.6));
        assert_eq!(
            mission.runner.as_ref().and_then(|runner| runner.end()),
            None
        );
    }

    #[test]
    fn what_a_worse_place_does_not_let_through_is_not_said_to_be_unreachable() {
        let places = vec![Point::new(30.0, 0.0).into()];
        for (sd_m, expected) in [(0.05, true), (0.2, false)] {
            let mut mission = started(TaskKind::Pathfind {
                places: places.clone(),
            });
            let mut own = own_state(0.0, 0.0);
            let mut events = Vec::new();
            for step in 0..3000 {
                own.pose.sd_m = sd_m;
                let mut out = fed(
                    &mut mission,
                    2.0 + 0.1 * f64::from(step),
                    In::State(own.clone()),
                );
                mission
                    .wake(at(2.05 + 0.1 * f64::from(step)), &mut out)
                    .unwrap();
                turn(&mut own, &out);
                events.extend(said(&out));
            }
            let is_said = events
                .iter()
                .any(|event| matches!(event, MissionEvent::NoWay(..)));
            assert_eq!(is_said, expected, "{sd_m} m: {events:?}");
        }
    }

    /// Obeys turns at once.
    fn turn(own: &mut OwnState, out: &[Out]) {
        use crate::node::vehicle::MoveCommand;
        for output in out {
            if let Out::Command(_, MoveCommand::Turn(heading)) = output {
                own.pose.heading = *heading;
            }
        }
    }

    #[test]
    fn who_rests_at_home_when_its_place_is_lost_is_home_when_it_is_to_return_and_nobody_else() {
        let comes_home = |x_m: f64, moves: bool| {
            let mut mission = started(TaskKind::Browse);
            fed(&mut mission, 2.0, state(x_m, 0.05));
            let mut lost = own_state(9.0, 0.0);
            lost.pose.sd_m = 9.0;
            lost.is_at_rest = !moves;
            fed(&mut mission, 3.0, In::State(lost.clone()));
            lost.is_at_rest = true;
            fed(&mut mission, 3.1, order(OrderKind::Return));
            let out = fed(&mut mission, 3.2, In::State(lost));
            let is_home = mission.on_wire().is_at_home;
            let says = said(&out).contains(&MissionEvent::Home)
                || mission.goal.status() == MissionStatus::Home;
            assert_eq!(says, is_home, "the operator hears the same");
            is_home
        };
        assert!(comes_home(0.0, false));
        assert!(!comes_home(3.0, false), "it was elsewhere");
        assert!(!comes_home(0.0, true), "it has moved since");
    }

    #[test]
    fn who_came_home_is_home_even_when_it_loses_its_place_and_nobody_comes_home_without_one() {
        let mut mission = started(TaskKind::Browse);
        fed(&mut mission, 2.0, state(0.0, 9.0));
        assert!(mission.on_wire().is_at_home, "it rests since it was");
        let mut moves = own_state(0.0, 0.0);
        (moves.pose.sd_m, moves.is_at_rest) = (9.0, false);
        fed(&mut mission, 2.1, In::State(moves));
        fed(&mut mission, 2.2, state(0.0, 9.0));
        assert!(!mission.on_wire().is_at_home, "it may be anywhere");
        mission.goal = Goal::Home(super::super::goal::GoalSource::Order);
        assert!(mission.on_wire().is_at_home);
    }
}
