//! The judge of a simulated run: it sees what no node sees, and says when the run is over, whether what was wanted came
//! about, and why it failed. It orders nothing: what is done in a run is its operator's matter ([`super::operator_script`]).

use tomoswarm_proto::VehicleId;

use super::operator_script::RUN;
use super::outcome::EndedMission;
use super::place_results::{self, PlaceResult};
use super::silence::SweepTimes;
use crate::config::Expect;
use crate::ground::station::StationEvent as GroundNote;
use crate::node::mission::{EndReason, MissionEvent};
use crate::operator::script::ScriptEnd;
use crate::time::Time;

/// What follows for the run.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum RunState {
    /// Nothing.
    GoesOn,
    /// It is over.
    Over,
    /// It is over and has failed.
    Failed(String),
}

/// What is known of how a run goes.
#[derive(Debug)]
pub(super) struct RunMonitor {
    /// Whether a ground station plans for all; otherwise every vehicle has a mission of its own.
    is_swept: bool,
    expect: Expect,
    /// When and how the mission of each vehicle ended.
    missions: Vec<EndedMission>,
    /// What became of the places that vehicles were to visit.
    places: Vec<PlaceResult>,
    sweeps: SweepTimes,
    is_done: bool,
}

impl RunMonitor {
    /// Makes the monitor of a run that has not begun.
    pub(super) fn new(is_swept: bool, expect: Expect, vehicles: &[VehicleId]) -> RunMonitor {
        let missions = vehicles.iter().map(|id| (*id, None)).collect();
        RunMonitor {
            is_swept,
            expect,
            missions,
            places: Vec::new(),
            sweeps: SweepTimes::default(),
            is_done: false,
        }
    }

    /// Watches what becomes of places.
    pub(super) fn with_places(mut self, places: Vec<PlaceResult>) -> RunMonitor {
        self.places = places;
        self
    }

    /// Returns whether the sweep that is wanted was driven to its end, or every mission has ended.
    pub(super) fn is_done(&self) -> bool {
        self.is_done
    }

    /// Returns whether the mission of a vehicle, by its index, has ended, or the sweep that is wanted.
    pub(super) fn has_ended(&self, vehicle: usize) -> bool {
        match self.is_swept {
            true => self.is_done,
            false => self.missions[vehicle].1.is_some(),
        }
    }

    /// Returns how many vehicles at least must be there for what is wanted to come about.
    pub(super) fn least_vehicles(&self) -> usize {
        let is_sweep_wanted = self.is_swept && self.expect == Expect::Finished && !self.is_done;
        if is_sweep_wanted { 2 } else { 1 }
    }

    /// Returns when and how the mission of each vehicle ended.
    pub(super) fn missions(&self) -> &[EndedMission] {
        &self.missions
    }

    /// Returns what became of the places that it watches.
    pub(super) fn places(&self) -> &[PlaceResult] {
        &self.places
    }

    /// Returns when sweeps were driven.
    pub(super) fn sweeps(&self) -> &SweepTimes {
        &self.sweeps
    }

    /// Takes what a vehicle, by its index, says of its mission.
    pub(super) fn hear_of_mission(&mut self, vehicle: usize, event: &MissionEvent) {
        let id = self.missions[vehicle].0;
        place_results::hear(&mut self.places, id, event);
    }

    /// Takes a note of the ground station.
    pub(super) fn hear(&mut self, now: Time, note: &GroundNote) {
        self.sweeps.hear(now, note);
        self.is_done |= matches!(note, GroundNote::RunClosed { run, .. } if *run == RUN);
    }

    /// Records that the mission of a vehicle has ended.
    pub(super) fn mission_ended(&mut self, now: Time, vehicle: usize, end: EndReason) {
        self.missions[vehicle].1 = Some((now, end));
    }

    /// Decides whether every mission has ended; who is dead is not waited for, but somebody must be left.
    pub(super) fn look_at_missions(&mut self, are_dead: impl Iterator<Item = bool>) {
        let missions = self.missions.iter().zip(are_dead);
        let mut alive = missions.filter(|(_, is_dead)| !is_dead).peekable();
        let is_somebody_left = alive.peek().is_some();
        let have_ended = alive.all(|(mission, _)| mission.1.is_some());
        self.is_done |= !self.is_swept && is_somebody_left && have_ended;
    }

    /// Decides after a return home, when `home` of the `alive` vehicles are home. Where all are expected there,
    /// whatever an operator can hear of them, this is the end.
    pub(super) fn came_home(&self, home: usize, alive: usize) -> RunState {
        if self.expect == Expect::Home && home == alive {
            RunState::Over
        } else {
            RunState::GoesOn
        }
    }

    /// Records how the operator's script ended.
    pub(super) fn script_ended(&self, end: &ScriptEnd) -> RunState {
        match end {
            ScriptEnd::Done => RunState::Over,
            ScriptEnd::GaveUp { why, .. } => RunState::Failed(why.clone()),
        }
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::RunId;

    use super::super::operator_script::EMPTY_RUN;
    use super::*;

    fn monitor(is_swept: bool, expect: Expect) -> RunMonitor {
        RunMonitor::new(
            is_swept,
            expect,
            &[VehicleId(1), VehicleId(2), VehicleId(3)],
        )
    }

    #[test]
    fn a_sweep_that_is_wanted_needs_two_vehicles_and_anything_else_one() {
        let mut swept = monitor(true, Expect::Finished);
        assert_eq!(swept.least_vehicles(), 2);
        swept.hear(
            Time::ZERO,
            &GroundNote::RunClosed {
                run: RUN,
                links: 1,
                samples: 1,
            },
        );
        assert_eq!(swept.least_vehicles(), 1, "it is done");
        for other in [
            monitor(true, Expect::Home),
            monitor(false, Expect::Finished),
        ] {
            assert_eq!(other.least_vehicles(), 1);
        }
    }

    #[test]
    fn only_the_sweep_that_is_wanted_counts() {
        let mut monitor = monitor(true, Expect::Finished);
        let closed = |run: RunId| GroundNote::RunClosed {
            run,
            links: 1,
            samples: 1,
        };
        monitor.hear(Time::ZERO, &closed(EMPTY_RUN));
        monitor.hear(Time::ZERO, &GroundNote::Stalled(RUN));
        assert!(!monitor.is_done());
        monitor.hear(Time::ZERO, &closed(RUN));
        assert!(monitor.is_done());
    }

    #[test]
    fn missions_are_done_when_all_that_are_alive_have_ended_theirs() {
        let mut monitor = monitor(false, Expect::Finished);
        let dead = [false, true, false];
        monitor.mission_ended(Time::ZERO, 0, EndReason::Done);
        monitor.look_at_missions(dead.into_iter());
        assert!(!monitor.is_done());
        monitor.look_at_missions([true; 3].into_iter());
        assert!(!monitor.is_done(), "nobody is left");
        monitor.mission_ended(Time::ZERO, 2, EndReason::NoRoom);
        monitor.look_at_missions([false; 3].into_iter());
        assert!(
            !monitor.is_done(),
            "the one that is under way may still die"
        );
        monitor.look_at_missions(dead.into_iter());
        assert!(monitor.is_done());
        assert_eq!(monitor.missions()[1], (VehicleId(2), None));
        assert_eq!(
            monitor.missions()[2].1,
            Some((Time::ZERO, EndReason::NoRoom))
        );
    }

    #[test]
    fn who_comes_home_ends_a_run_only_where_all_are_expected_there() {
        assert_eq!(monitor(true, Expect::Home).came_home(3, 3), RunState::Over);
        assert_eq!(
            monitor(true, Expect::Home).came_home(2, 3),
            RunState::GoesOn
        );
        assert_eq!(
            monitor(true, Expect::Finished).came_home(3, 3),
            RunState::GoesOn
        );
    }

    #[test]
    fn an_operator_that_gives_up_has_failed_with_its_reason() {
        let monitor = monitor(true, Expect::Finished);
        assert_eq!(monitor.script_ended(&ScriptEnd::Done), RunState::Over);
        let gave_up = ScriptEnd::GaveUp {
            step: 3,
            why: "nobody came".to_owned(),
        };
        assert_eq!(
            monitor.script_ended(&gave_up),
            RunState::Failed("nobody came".to_owned())
        );
    }
}
