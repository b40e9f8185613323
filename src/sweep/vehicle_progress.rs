//! How far a vehicle is with its plan, as its peers and the ground believe it: what it says itself on the bus or by radio,
//! with its name and the start of its software, which the wire says once for a whole message.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Boot, MissionProgress, Progress, Revision, RunId, StopId, VehicleId};

/// How far one vehicle is with its plan.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct VehicleProgress {
    /// Which vehicle.
    pub vehicle: VehicleId,
    /// Which start of its software says so.
    pub boot: Boot,
    /// Of which run.
    pub run: RunId,
    /// The revision it follows.
    pub revision: Revision,
    /// Last stop done of this revision.
    pub done: Option<StopId>,
    /// The stop whose leg it has entered, if any.
    pub leg: Option<StopId>,
}

impl VehicleProgress {
    /// Returns what a vehicle says of itself.
    pub fn of(vehicle: VehicleId, boot: Boot, report: Progress) -> VehicleProgress {
        let Progress {
            run,
            revision,
            done,
            leg,
        } = report;
        VehicleProgress {
            vehicle,
            boot,
            run,
            revision,
            done,
            leg,
        }
    }
}

impl From<&MissionProgress> for VehicleProgress {
    fn from(mission: &MissionProgress) -> VehicleProgress {
        VehicleProgress::of(mission.vehicle, mission.boot, mission.progress)
    }
}

impl From<VehicleProgress> for Progress {
    /// Returns what the wire says beside the vehicle's name and start.
    fn from(known: VehicleProgress) -> Progress {
        let VehicleProgress {
            vehicle: _,
            boot: _,
            run,
            revision,
            done,
            leg,
        } = known;
        Progress {
            run,
            revision,
            done,
            leg,
        }
    }
}
