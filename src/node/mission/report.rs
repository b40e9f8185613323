//! What the mission says of itself to the other nodes, as it travels. It decides nothing, and says *unknown* or *none* for
//! what is not known here.

use tomoswarm_proto::{MissionEnd, MissionKind, MissionPhase, Permille, Position, StandReason};

use super::goal::Goal;
use super::runner::StepRunner;
use super::{Cause, End, Mission, is_at_home};
use crate::node::Task;

impl Mission {
    /// Returns how far the vehicle is with its mission.
    pub(super) fn on_wire(&self) -> tomoswarm_proto::Mission {
        let (done, stops) = self.plan.stops_done();
        let left = self.runner.as_ref().map_or(stops - done, StepRunner::places_left);
        let is_home =
            |state: &super::OwnState| state.is_at_rest && is_at_home(state.pose, self.settings.home);
        tomoswarm_proto::Mission {
            vehicle: self.settings.vehicle,
            boot: self.settings.boot,
            progress: self.plan.progress().into(),
            kind: self.kind(),
            phase: self.phase(),
            share: self.share(done, stops),
            places_left: u16::try_from(left).unwrap_or(u16::MAX),
            goal: self.place_ahead(),
            slice: self.settings.slice,
            end: self.end(),
            is_at_home: self.state.as_ref().is_some_and(is_home),
        }
    }

    /// Returns why it stands and does not go on by itself; `None` = it may.
    pub(super) fn holds_for(&self) -> Option<StandReason> {
        self.holds().then(|| match self.goal.cause() {
            _ if self.links.is_alone && self.goal.is_under_way() => StandReason::Alone,
            Some(Cause::BusLost) => StandReason::Alone,
            Some(Cause::BatteryLow | Cause::BatteryEmpty) => StandReason::Battery,
            None => StandReason::Held,
        })
    }

    fn kind(&self) -> MissionKind {
        match self.settings.task {
            Task::Plan => MissionKind::Sweep,
            Task::Legs(_) => MissionKind::Legs,
            Task::Forward(_) => MissionKind::Forward,
            Task::Browse => MissionKind::Browse,
            Task::Search => MissionKind::Search,
            Task::Pathfind(_) => MissionKind::Pathfind,
            Task::Explore => MissionKind::Explore,
        }
    }

    fn phase(&self) -> MissionPhase {
        match self.goal {
            _ if self.holds() => MissionPhase::Held,
            Goal::Waiting => MissionPhase::Waiting,
            Goal::Held(_) => MissionPhase::Held,
            Goal::Returning(_) => MissionPhase::Returning,
            Goal::Home(_) => MissionPhase::Over,
            Goal::Following => self.runner.as_ref().map_or_else(|| self.plan.phase(), StepRunner::phase),
        }
    }

    /// Returns how much of the plan is done; nobody knows how much of a mission of its own there is.
    fn share(&self, done: usize, stops: usize) -> Option<Permille> {
        let is_planned = self.runner.is_none() && stops > 0;
        is_planned.then(|| Permille::from_fraction(done as f64 / stops as f64)).flatten()
    }

    /// Returns where its way ends.
    fn place_ahead(&self) -> Option<Position> {
        let way = self.pilot.way();
        (!way.is_empty()).then(|| way.end().into())
    }

    fn end(&self) -> Option<MissionEnd> {
        match &self.runner {
            Some(runner) => runner.end().map(end_on_wire),
            None => self.plan.is_done().then_some(MissionEnd::Done),
        }
    }
}

fn end_on_wire(end: &End) -> MissionEnd {
    // Whoever missed something missed one place at least.
    let places = |count: usize| u16::try_from(count).unwrap_or(u16::MAX).max(1);
    match end {
        End::Done => MissionEnd::Done,
        End::Stopped(_) => MissionEnd::Stopped,
        End::NoWay(count) => MissionEnd::NoWay(places(*count)),
        End::GaveUp(count) => MissionEnd::GaveUp(places(*count)),
        End::NoRoom | End::TooLarge => MissionEnd::GaveUp(1),
    }
}
