//! What the mission says of itself to the other nodes, as it travels. It decides nothing, and says *unknown* or *none* for
//! what is not known here.

use tomoswarm_proto::{MissionEnd, MissionPhase, Permille, Position, Progress, StandReason};

use super::goal::Goal;
use super::runner::StepRunner;
use super::{AutonomyCause, EndReason, Mission, MissionStatus};

impl Mission {
    /// Returns how far the vehicle is with its mission.
    pub(super) fn on_wire(&self) -> tomoswarm_proto::MissionProgress {
        let (done, stops) = self.plan.stops_done();
        let left = match (&self.runner, self.assignment.refusal()) {
            (Some(runner), _) => runner.places_left(),
            (None, Some(_)) => 0,
            (None, None) => stops - done,
        };
        // Who came home rests there, whatever becomes of its place; who does not know its place comes nowhere.
        let is_placed = self.place.is_known() || matches!(self.goal, Goal::Home(_));
        let rests = self.state.as_ref().is_some_and(|state| state.is_at_rest);
        tomoswarm_proto::MissionProgress {
            vehicle: self.settings.vehicle,
            boot: self.settings.boot,
            progress: self.progress(),
            kind: self.assignment.kind(),
            phase: self.phase(),
            share: self.share(done, stops),
            places_left: u16::try_from(left).unwrap_or(u16::MAX),
            goal: self.goal_place(),
            slice: self.settings.slice,
            end: self.end(),
            is_at_home: rests && (self.place.rests_at_home() || (is_placed && self.seems_home())),
            lease_number: self.leases.greatest().number,
        }
    }

    /// Returns what the vehicle does, for status lines.
    pub fn status(&self) -> MissionStatus {
        if self.holds() || self.is_held_back() {
            MissionStatus::Held
        } else {
            self.goal.status()
        }
    }

    /// Returns whether it stands and will not go on by itself, however long it takes.
    fn holds(&self) -> bool {
        let is_alone = self.autonomy.is_alone() && self.goal.is_under_way();
        matches!(self.goal, Goal::Held(_)) || is_alone
    }

    /// Returns whether it is under way and something else than its mission holds the vehicle back.
    fn is_held_back(&self) -> bool {
        self.goal.is_under_way() && !self.may_move()
    }

    /// Returns why it stands, or goes home, and does not go on by itself; `None` = it may.
    pub(super) fn holds_for(&self) -> Option<StandReason> {
        if self.autonomy.is_alone() && self.goal.is_under_way() {
            return Some(StandReason::Alone);
        }
        match (self.goal, self.goal.cause()) {
            (Goal::Held(_), Some(AutonomyCause::BusLost)) => Some(StandReason::Alone),
            (Goal::Held(_), Some(AutonomyCause::BatteryLow | AutonomyCause::BatteryEmpty)) => {
                let is_low = self.autonomy.is_battery_low();
                is_low.then_some(StandReason::Battery)
            }
            (Goal::Held(_), Some(AutonomyCause::Blind)) => Some(StandReason::Blind),
            (Goal::Held(_), None) => Some(StandReason::Held),
            // Whoever has sent it home, a start leads it nowhere until that has ended.
            (Goal::Returning(_) | Goal::Home(_), _) => match self.stays_home_for()? {
                AutonomyCause::Blind => Some(StandReason::Blind),
                AutonomyCause::BatteryLow | AutonomyCause::BatteryEmpty => {
                    Some(StandReason::Battery)
                }
                AutonomyCause::BusLost => None,
            },
            (Goal::Waiting | Goal::Following, _) => None,
        }
    }

    /// Returns why a vehicle that is at home stays there, whatever it is ordered.
    pub(super) fn stays_home_for(&self) -> Option<AutonomyCause> {
        match (self.autonomy.is_battery_low(), self.place.is_blind()) {
            (true, _) => Some(AutonomyCause::BatteryLow),
            (false, true) => Some(AutonomyCause::Blind),
            (false, false) => None,
        }
    }

    /// Returns how far it is with its plan; of a mission of its own in which run that is, since it follows no revision.
    fn progress(&self) -> Progress {
        match self.assignment.is_own() {
            true => Progress {
                run: self.assignment.run(),
                ..Progress::default()
            },
            false => self.plan.progress().into(),
        }
    }

    fn phase(&self) -> MissionPhase {
        match self.goal {
            _ if self.holds() || self.is_held_back() => MissionPhase::Held,
            Goal::Waiting => MissionPhase::Waiting,
            Goal::Held(_) => MissionPhase::Held,
            Goal::Returning(_) => MissionPhase::Returning,
            Goal::Home(_) => MissionPhase::Over,
            Goal::Following if self.assignment.refusal().is_some() => MissionPhase::Over,
            Goal::Following => self
                .runner
                .as_ref()
                .map_or_else(|| self.plan.phase(), StepRunner::phase),
        }
    }

    /// Returns how much of the plan is done; nobody knows how much of a mission of its own there is.
    fn share(&self, done: usize, stops: usize) -> Option<Permille> {
        let is_planned = !self.assignment.is_own() && stops > 0;
        is_planned
            .then(|| Permille::from_fraction(done as f64 / stops as f64))
            .flatten()
    }

    /// Returns where it is going: what its mission wants to come to or to see, also while that waits for something; home when it
    /// returns; otherwise where its way ends.
    pub(super) fn goal_place(&self) -> Option<Position> {
        let runner = self
            .runner
            .as_ref()
            .filter(|_| self.goal == Goal::Following);
        let way = self.pilot.way();
        let home = self.settings.home;
        let end = match self.goal {
            Goal::Returning(_) => Some(home),
            _ => (!way.is_empty()).then(|| way.end()),
        };
        runner
            .and_then(StepRunner::goal)
            .or(end)
            .map(Position::from)
    }

    fn end(&self) -> Option<MissionEnd> {
        if let Some(why) = self.assignment.refusal() {
            return Some(MissionEnd::Refused(why));
        }
        match &self.runner {
            Some(runner) => runner.end().map(end_on_wire),
            None => self.plan.is_done().then_some(MissionEnd::Done),
        }
    }
}

fn end_on_wire(end: &EndReason) -> MissionEnd {
    // Whoever missed something missed one place at least.
    let places = |count: usize| u16::try_from(count).unwrap_or(u16::MAX).max(1);
    match end {
        EndReason::Done => MissionEnd::Done,
        EndReason::Stopped(_) => MissionEnd::Stopped,
        EndReason::NoWay(count) => MissionEnd::NoWay(places(*count)),
        EndReason::GaveUp(count) => MissionEnd::GaveUp(places(*count)),
        EndReason::NoRoom
        | EndReason::TooLarge
        | EndReason::NoPlace
        | EndReason::Blind
        | EndReason::BusLost
        | EndReason::BatteryLow
        | EndReason::Stalled
        | EndReason::ShutIn { .. } => MissionEnd::GaveUp(1),
        EndReason::Refused(why) => MissionEnd::Refused(*why),
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{MissionKind, MissionRefusal, OrderKind, TaskKind};

    use super::super::tests::{at, fed, order, plan, planned};
    use super::*;
    use crate::actor::Actor;
    use crate::geom::Point;
    use crate::node::mission::{In, Obstruction, ObstructionKind};
    use crate::node::tests_support::{own_state, settings};

    fn shows(mission: &Mission) -> (MissionPhase, Option<Permille>, u16, Option<Position>, bool) {
        let report = mission.on_wire();
        (
            report.phase,
            report.share,
            report.places_left,
            report.goal,
            report.is_at_home,
        )
    }

    #[test]
    fn a_vehicle_with_a_plan_says_how_far_it_is_and_where_it_goes() {
        let mut mission = planned(None);
        let none = Some(Permille(0));
        let end = Some(Position {
            x_mm: 2000,
            y_mm: 2000,
            z_mm: 0,
        });
        assert_eq!(
            shows(&mission),
            (MissionPhase::Waiting, none, 2, None, true)
        );
        fed(&mut mission, 2.0, order(OrderKind::Start));
        assert_eq!(shows(&mission), (MissionPhase::Going, none, 2, end, true));
        fed(&mut mission, 5.0, In::State(own_state(2.0, 0.0)));
        assert_eq!(
            shows(&mission),
            (MissionPhase::Going, Some(Permille(500)), 1, end, false)
        );
        let report = mission.on_wire();
        assert_eq!(
            (report.kind, report.end, report.slice),
            (MissionKind::Sweep, None, 0)
        );
        fed(&mut mission, 6.0, In::State(own_state(2.0, 2.0)));
        let report = mission.on_wire();
        assert_eq!(
            (report.phase, report.end),
            (MissionPhase::Over, Some(MissionEnd::Done))
        );
        assert_eq!(
            (report.share, report.places_left, report.goal),
            (Some(Permille::WHOLE), 0, None)
        );
    }

    #[test]
    fn who_only_rests_for_the_next_plan_is_not_said_to_be_over() {
        let mut mission = Mission::new(settings(1));
        fed(&mut mission, 1.0, In::State(own_state(0.0, 0.0)));
        fed(&mut mission, 1.0, plan(1, &[]));
        fed(&mut mission, 1.1, order(OrderKind::Start));
        fed(&mut mission, 1.2, In::State(own_state(0.0, 0.0)));
        let report = mission.on_wire();
        assert_eq!(
            (report.phase, report.is_at_home),
            (MissionPhase::Waiting, true)
        );
    }

    #[test]
    fn a_vehicle_that_holds_says_so_and_why() {
        let mut mission = planned(None);
        assert_eq!(mission.holds_for(), None);
        fed(&mut mission, 2.0, order(OrderKind::Hold));
        assert_eq!(
            (mission.holds_for(), mission.on_wire().phase),
            (Some(StandReason::Held), MissionPhase::Held)
        );
        fed(&mut mission, 3.0, order(OrderKind::Start));
        let empty = crate::node::OwnState {
            battery: Some(0.01),
            ..own_state(1.0, 0.0)
        };
        fed(&mut mission, 4.0, In::State(empty));
        assert_eq!(mission.holds_for(), Some(StandReason::Battery));
    }

    #[test]
    fn a_mission_of_its_own_has_places_left_and_no_share() {
        let places = vec![Point::new(2.0, 0.0).into(), Point::new(2.0, 2.0).into()];
        let task = Some(TaskKind::Pathfind { places });
        let mut mission = Mission::new(crate::node::VehicleSettings {
            task,
            ..settings(1)
        });
        fed(&mut mission, 1.0, In::State(own_state(0.0, 0.0)));
        fed(&mut mission, 1.1, order(OrderKind::Start));
        mission.wake(at(1.2), &mut Vec::new()).unwrap();
        let report = mission.on_wire();
        assert_eq!(
            (report.kind, report.phase),
            (MissionKind::Pathfind, MissionPhase::Looking)
        );
        assert_eq!(
            (report.share, report.places_left, report.end),
            (None, 2, None)
        );
    }

    #[test]
    fn every_end_can_be_said() {
        let obstruction = Obstruction {
            at: Point::new(1.0, 1.0),
            kind: ObstructionKind::UnseenGround,
        };
        for (end, on_wire) in [
            (EndReason::Done, MissionEnd::Done),
            (EndReason::Stopped(obstruction), MissionEnd::Stopped),
            (EndReason::NoWay(3), MissionEnd::NoWay(3)),
            (EndReason::GaveUp(70_000), MissionEnd::GaveUp(u16::MAX)),
            (EndReason::NoRoom, MissionEnd::GaveUp(1)),
            (EndReason::NoPlace, MissionEnd::GaveUp(1)),
            (EndReason::Blind, MissionEnd::GaveUp(1)),
            (EndReason::BusLost, MissionEnd::GaveUp(1)),
            (EndReason::BatteryLow, MissionEnd::GaveUp(1)),
            (EndReason::Stalled, MissionEnd::GaveUp(1)),
            (
                EndReason::ShutIn { unseen_percent: 97 },
                MissionEnd::GaveUp(1),
            ),
            (
                EndReason::Refused(MissionRefusal::NoPlace),
                MissionEnd::Refused(MissionRefusal::NoPlace),
            ),
        ] {
            assert_eq!(end_on_wire(&end), on_wire);
        }
    }
}
