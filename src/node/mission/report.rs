//! What the mission says of itself to the other nodes, as it travels. It decides nothing, and says *unknown* or *none* for
//! what is not known here.

use tomoswarm_proto::{MissionKind, StandReason};

use super::Mission;
use super::autonomy::Cause;
use crate::node::Task;

impl Mission {
    /// Returns how far the vehicle is with its mission.
    pub(super) fn on_wire(&self) -> tomoswarm_proto::Mission {
        tomoswarm_proto::Mission {
            vehicle: self.settings.vehicle,
            boot: self.settings.boot,
            progress: self.said.into(),
            kind: self.kind(),
            slice: self.settings.slice,
            ..tomoswarm_proto::Mission::default()
        }
    }

    /// Returns why it stands and does not go on by itself; `None` = it may.
    pub(super) fn holds_for(&self) -> Option<StandReason> {
        self.holds().then(|| match self.own {
            _ if self.links.is_alone => StandReason::Alone,
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
}
