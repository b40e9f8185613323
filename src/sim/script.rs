//! What happens in a scenario by itself: when sweeps are wished or missions begin, when the persons enter, when
//! everybody is sent home, and when the run is over or has failed. It carries nothing out: the kernel does.

use std::time::Duration;

use tomoswarm_proto::RunId;

use super::world::Stage;
use crate::config::{End, Expect};
use crate::ground::imager::Subject;
use crate::ground::station::Note as GroundNote;

/// The first sweep of a scenario, with nobody inside; without an empty sweep it is not driven.
pub const EMPTY_RUN: RunId = RunId(1);
/// The sweep whose picture is wanted.
pub const RUN: RunId = RunId(2);

/// The operator begins the first sweep after this time.
const BEGIN_AT: Duration = Duration::from_secs(2);
/// Between two sweeps people need this long to walk in.
const ENTER_TAKES: Duration = Duration::from_secs(2);
/// After the last picture nothing is waited for any longer than this.
const HOME_WITHIN: Duration = Duration::from_secs(900);

/// A step of the script.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Step {
    /// The empty sweep begins.
    BeginFirst,
    /// The persons walk in.
    PeopleEnter,
    /// The sweep whose picture is wanted begins.
    BeginMain,
    /// Every vehicle begins its own mission.
    BeginMissions,
    /// Everybody is sent home.
    ReturnHome,
    /// Who is not home by now is not waited for.
    GiveUpWaiting,
}

/// What is to be done in a step.
pub enum Act {
    /// The operator wishes a sweep.
    Sweep {
        /// Its name.
        run: RunId,
        /// The sweep that it is compared with.
        empty: Option<RunId>,
    },
    /// The operator starts every vehicle.
    Start,
    /// The world changes.
    Enter(Option<Box<Stage>>),
    /// The operator orders everybody home.
    ReturnHome,
    /// The run has failed.
    Fail(String),
}

/// What follows from something that has happened.
#[derive(Clone, PartialEq, Debug)]
pub enum Next {
    /// Nothing.
    Nothing,
    /// A step, so much later.
    Step(Duration, Step),
    /// The run is over.
    End,
    /// The run is over and has failed.
    Fail(String),
}

/// How far the script is.
pub struct Script {
    /// The stage with everybody in it, while they wait outside.
    outside: Option<Box<Stage>>,
    end: End,
    expect: Expect,
    empty: Option<RunId>,
    /// Every vehicle has a mission of its own, and nothing is swept.
    has_missions: bool,
    sweep_done: bool,
    /// Everybody was sent home.
    is_returning: bool,
}

impl Script {
    /// Makes the script of a scenario; with a stage given a sweep comes first, before it is set.
    pub fn new(outside: Option<Stage>, end: End, expect: Expect) -> Script {
        Script {
            outside: outside.map(Box::new),
            end,
            expect,
            empty: None,
            has_missions: false,
            sweep_done: false,
            is_returning: false,
        }
    }

    /// Makes the script of a scenario in which every vehicle has a mission of its own.
    pub fn of_missions(end: End, expect: Expect) -> Script {
        Script { has_missions: true, ..Script::new(None, end, expect) }
    }

    /// Gives the first step.
    pub fn first(&self) -> (Duration, Step) {
        let step = match self.outside {
            _ if self.has_missions => Step::BeginMissions,
            Some(_) => Step::BeginFirst,
            None => Step::BeginMain,
        };
        (BEGIN_AT, step)
    }

    /// Gives how many sweeps are still to be driven, the present one included.
    pub fn sweeps_left(&self) -> usize {
        if self.outside.is_some() { 2 } else { 1 }
    }

    /// Tells whether the sweep whose picture is wanted is done, or every mission has ended.
    pub fn is_sweep_done(&self) -> bool {
        self.sweep_done
    }

    /// Takes a step: gives what is to be done, and then what follows.
    pub fn step(&mut self, step: Step) -> (Act, Next) {
        match step {
            Step::BeginFirst => (Act::Sweep { run: EMPTY_RUN, empty: None }, Next::Nothing),
            Step::PeopleEnter => {
                self.empty = Some(EMPTY_RUN);
                (Act::Enter(self.outside.take()), Next::Step(ENTER_TAKES, Step::BeginMain))
            }
            Step::BeginMain => (Act::Sweep { run: RUN, empty: self.empty }, Next::Nothing),
            Step::BeginMissions => (Act::Start, Next::Nothing),
            Step::ReturnHome => {
                self.is_returning = true;
                (Act::ReturnHome, Next::Step(HOME_WITHIN, Step::GiveUpWaiting))
            }
            Step::GiveUpWaiting => (Act::Fail("not everybody came home in time".to_owned()), Next::Nothing),
        }
    }

    /// Gives what follows from a note of the ground station.
    pub fn hear(&mut self, note: &GroundNote) -> Next {
        match note {
            GroundNote::RunClosed { run, .. } if *run == EMPTY_RUN => {
                Next::Step(ENTER_TAKES, Step::PeopleEnter)
            }
            GroundNote::RunClosed { .. } => {
                self.sweep_done = true;
                Next::Nothing
            }
            // Where something else is expected of the vehicles, the sweep need not end.
            GroundNote::NoPlan(_) | GroundNote::Stalled(_) if self.expect != Expect::Finished => {
                Next::Nothing
            }
            GroundNote::NoPlan(reason) => Next::Fail(reason.clone()),
            GroundNote::Stalled(run) => {
                Next::Fail(format!("sweep {run} cannot be ended: no vehicle gets on"))
            }
            GroundNote::Overtaken(run) => {
                Next::Fail(format!("sweep {run} was given up: vehicles follow a higher one"))
            }
            GroundNote::Planned { .. }
            | GroundNote::LapDone { .. }
            | GroundNote::Replans(_)
            | GroundNote::Waits(_)
            | GroundNote::Lost(_)
            | GroundNote::Found(_)
            | GroundNote::Restarted(_)
            | GroundNote::Leads(_)
            | GroundNote::StandsBy(_) => Next::Nothing,
        }
    }

    /// Gives what follows from a picture: the last one of the main run ends the run, or sends everybody home.
    pub fn picture(&self, run: RunId, subject: Subject) -> Next {
        if !self.sweep_done || run != RUN || subject != Subject::Structure {
            return Next::Nothing;
        }
        self.done()
    }

    /// Gives what follows when a vehicle's mission has ended: so many have now, of those whose software runs.
    pub fn mission_ended(&mut self, ended: usize, of: usize) -> Next {
        if !self.has_missions || self.sweep_done || ended < of {
            return Next::Nothing;
        }
        self.sweep_done = true;
        self.done()
    }

    fn done(&self) -> Next {
        match self.end {
            End::Hold => Next::End,
            End::Return => Next::Step(Duration::ZERO, Step::ReturnHome),
        }
    }

    /// Gives what follows when a vehicle came home, of which so many are home now and so many could be. Who came home
    /// on their own may still be sent out again.
    pub fn came_home(&self, homes: usize, of: usize) -> Next {
        let is_last = self.is_returning || self.expect == Expect::Home;
        if is_last && homes == of { Next::End } else { Next::Nothing }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn closed(run: RunId) -> GroundNote {
        GroundNote::RunClosed { run, links: 1, samples: 1 }
    }

    #[test]
    fn without_an_empty_sweep_the_main_one_begins_and_compares_with_nothing() {
        let mut script = Script::new(None, End::Hold, Expect::Finished);
        assert_eq!(script.first().1, Step::BeginMain);
        let (act, next) = script.step(Step::BeginMain);
        assert!(matches!(act, Act::Sweep { run: RUN, empty: None }));
        assert_eq!(next, Next::Nothing);
    }

    #[test]
    fn the_main_sweep_compares_with_the_empty_one_that_was_driven() {
        let mut script = Script::new(None, End::Hold, Expect::Finished);
        assert!(matches!(script.hear(&closed(EMPTY_RUN)), Next::Step(_, Step::PeopleEnter)));
        assert!(!script.is_sweep_done());
        assert!(matches!(script.step(Step::PeopleEnter).1, Next::Step(_, Step::BeginMain)));
        assert!(matches!(script.step(Step::BeginMain).0, Act::Sweep { run: RUN, empty: Some(EMPTY_RUN) }));
    }

    #[test]
    fn only_the_last_picture_of_a_closed_sweep_ends_the_run() {
        for (end, last) in
            [(End::Hold, Next::End), (End::Return, Next::Step(Duration::ZERO, Step::ReturnHome))]
        {
            let mut script = Script::new(None, end, Expect::Finished);
            assert_eq!(script.picture(RUN, Subject::Structure), Next::Nothing, "the sweep is not closed");
            assert_eq!(script.hear(&closed(RUN)), Next::Nothing);
            assert_eq!(script.picture(RUN, Subject::Change), Next::Nothing);
            assert_eq!(script.picture(EMPTY_RUN, Subject::Structure), Next::Nothing);
            assert_eq!(script.picture(RUN, Subject::Structure), last);
        }
    }

    #[test]
    fn missions_begin_by_a_start_and_are_done_when_the_last_one_has_ended() {
        let mut script = Script::of_missions(End::Return, Expect::Finished);
        assert!(matches!(script.step(script.first().1).0, Act::Start));
        assert_eq!(script.mission_ended(1, 2), Next::Nothing);
        assert!(!script.is_sweep_done());
        assert_eq!(script.mission_ended(2, 2), Next::Step(Duration::ZERO, Step::ReturnHome));
        assert!(script.is_sweep_done());
        assert_eq!(script.mission_ended(2, 2), Next::Nothing, "only once");
    }

    #[test]
    fn a_sweep_that_cannot_end_is_no_failure_where_vehicles_are_to_come_home() {
        let mut script = Script::new(None, End::Return, Expect::Home);
        assert_eq!(script.hear(&GroundNote::Stalled(RUN)), Next::Nothing);
        assert_eq!(script.hear(&GroundNote::NoPlan(String::new())), Next::Nothing);
    }

    #[test]
    fn the_run_ends_when_the_last_one_is_home_and_fails_when_nobody_gets_on() {
        let mut script = Script::new(None, End::Return, Expect::Finished);
        assert_eq!(script.came_home(2, 2), Next::Nothing, "nobody was sent home");
        script.step(Step::ReturnHome);
        assert_eq!(script.came_home(1, 2), Next::Nothing);
        assert_eq!(script.came_home(2, 2), Next::End);
        assert!(matches!(script.hear(&GroundNote::Stalled(RUN)), Next::Fail(_)));
        assert!(matches!(script.step(Step::GiveUpWaiting).0, Act::Fail(_)));
    }
}
