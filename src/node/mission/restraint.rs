//! What stops the vehicle from outside its mission: the reflex, what the vehicle refuses, an order or an emergency stop, a
//! person who has taken it over. The mission is begun anew from where that leaves it; none of this is a step of it, done or
//! failed.
//!
//! Deliberately absent: what ends such a restraint, which the vehicle actor decides.

use super::{Mission, Out};
use crate::node::vehicle::{CommandRefusal, MoveCommand, SafetyEvent};
use crate::time::Time;

impl Mission {
    /// Notes whether the vehicle obeys, after a state in which it could move or not: as long as it does not, the mission
    /// pauses.
    pub(super) fn watch_restraint(&mut self, now: Time, could_move: bool) {
        if could_move && !self.may_move() && self.goal.is_under_way() {
            // The vehicle has seen to it that it stands, or somebody else steers it.
            self.interrupt(now);
        }
    }

    /// Stops the vehicle; what was commanded is begun anew when it may go on.
    pub(super) fn stop(&mut self, now: Time, out: &mut Vec<Out>) {
        self.interrupt(now);
        out.push(Out::Command(now, MoveCommand::Hold));
    }

    /// What was commanded counts no more: it is begun anew when the vehicle may go on.
    fn interrupt(&mut self, now: Time) {
        if let Some(runner) = &mut self.runner {
            runner.interrupt(now);
        }
        self.pilot.halted(now);
    }

    /// Returns whether the vehicle obeys its mission, as far as is known.
    pub(super) fn may_move(&self) -> bool {
        self.state.as_ref().is_none_or(|state| state.may_move)
    }

    /// Notes that the vehicle has obeyed a start: nothing holds it back any more, whatever its last state says.
    pub(super) fn obeys_again(&mut self) {
        if let Some(state) = &mut self.state {
            state.may_move = true;
        }
    }

    /// Takes what the vehicle has stopped or refused.
    pub(super) fn take_safety_event(&mut self, now: Time, event: &SafetyEvent) {
        match event {
            SafetyEvent::Halted { obstacle, .. } => {
                self.terrain.note_obstacle(now, *obstacle);
                self.pilot.halted(now);
            }
            SafetyEvent::Refused(refusal) => {
                self.pilot.refused(now, *refusal);
                if let Some(runner) = &mut self.runner {
                    runner.refused();
                }
                if let CommandRefusal::Separation(peer) = refusal {
                    self.step_back(now, |returning| returning.after_refusal_for(*peer));
                }
            }
            SafetyEvent::AutopilotSilent | SafetyEvent::Switched(_) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{MissionPhase, OrderKind, TaskKind};

    use super::super::tests::{at, driven, fed, order, plan, started};
    use super::super::{EndReason, In, MissionEvent, MissionStatus};
    use super::*;
    use crate::actor::Actor;
    use crate::geom::Point;
    use crate::node::OwnState;
    use crate::node::mission::PlaceWatch;
    use crate::node::tests_support::own_state;

    /// Feeds a state and wakes the mission, tenth by tenth; returns all that it says.
    fn pass(mission: &mut Mission, tenths: std::ops::Range<u32>, own: &OwnState) -> Vec<Out> {
        let mut said = Vec::new();
        for tenth in tenths {
            let now_s = 0.1 * f64::from(tenth);
            said.extend(fed(mission, now_s, In::State(own.clone())));
            mission.wake(at(now_s + 0.05), &mut said).unwrap();
        }
        said
    }

    fn ends(said: &[Out]) -> Vec<&MissionEvent> {
        let events = said.iter().filter_map(|out| match out {
            Out::MissionEvent(event @ MissionEvent::Ended(_)) => Some(event),
            _ => None,
        });
        events.collect()
    }

    #[test]
    fn a_mission_pauses_while_somebody_else_steers_and_goes_on_after_a_start() {
        let places = vec![Point::new(2.0, 0.0).into(), Point::new(2.0, 2.0).into()];
        for task in [
            TaskKind::Forward { distance_mm: 2_000 },
            TaskKind::Pathfind { places },
            TaskKind::Explore,
        ] {
            let mut mission = started(task.clone());
            let mut own = own_state(0.0, 0.0);
            pass(&mut mission, 12..30, &own);
            own.may_move = false;
            for second in 3..100 {
                let refused = SafetyEvent::Refused(CommandRefusal::NotInControl);
                fed(&mut mission, f64::from(second), In::SafetyEvent(refused));
                let said = pass(&mut mission, 10 * second..10 * second + 9, &own);
                let commands = said.iter().filter(|out| matches!(out, Out::Command(..)));
                assert_eq!((commands.count(), ends(&said).len()), (0, 0), "{task:?}");
            }
            assert_eq!(
                (mission.status(), mission.on_wire().phase),
                (MissionStatus::Held, MissionPhase::Held)
            );
            own.may_move = true;
            fed(&mut mission, 100.0, order(OrderKind::Start));
            let said = pass(&mut mission, 1001..1030, &own);
            let commands = said.iter().filter(|out| matches!(out, Out::Command(..)));
            assert!(commands.count() > 0 && ends(&said).is_empty(), "{task:?}");
        }
    }

    #[test]
    fn a_plan_that_comes_during_a_mission_of_its_own_takes_nothing_for_visited() {
        let mut mission = started(TaskKind::Forward { distance_mm: 2_000 });
        let own = own_state(0.0, 0.0);
        let said = pass(&mut mission, 12..20, &own);
        assert!(driven(&said).is_some());
        let mut said = fed(&mut mission, 2.0, plan(1, &[]));
        said.extend(pass(&mut mission, 21..40, &own));
        assert!(said.iter().any(|out| matches!(out, Out::Accepted(..))));
        let visits = said
            .iter()
            .filter(|out| matches!(out, Out::MissionEvent(MissionEvent::Visited(_))));
        assert_eq!((visits.count(), ends(&said).len()), (0, 0));
    }

    #[test]
    fn every_run_has_its_own_time_to_wait_for_its_place() {
        let mut mission = started(TaskKind::Explore);
        let mut own = own_state(0.0, 0.0);
        own.pose.sd_m = 9.0;
        let said = pass(&mut mission, 20..3100, &own);
        assert_eq!(
            ends(&said),
            [&MissionEvent::Ended(EndReason::NoPlace)],
            "after five minutes"
        );
        assert!(mission.place.wait(at(310.0)), "it waits still");
        mission.take_up(at(310.0), true, &mut Vec::new());
        assert!(!mission.place.wait(at(310.1)));
        assert!(!PlaceWatch::new(0.5).wait(at(310.1)));
    }
}
