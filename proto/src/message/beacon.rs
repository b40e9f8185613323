//! What a radio says. A beacon has to fit into one radio packet, so every field has to be worth its bytes.

use serde::{Deserialize, Serialize};

use super::{EmergencyStop, Progress};
use crate::{Boot, PoseReport, VehicleId};

/// Most bytes of a beacon's frame: what the smallest radio packet carries.
pub const BEACON_BYTES_MAX: usize = 100;
/// Most members that a beacon names.
pub const BEACON_MEMBERS_MAX: usize = 12;

/// What proves a beacon's sender; kept for later, and ignored today.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct BeaconTag(pub [u8; 4]);

/// What a radio says: who and where it is, how far with its plan, and that all must stop if so.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Beacon {
    /// Who speaks.
    pub sender: VehicleId,
    /// Start of its software.
    pub boot: Boot,
    /// Counts the beacons of this boot; a gap is a miss.
    pub sequence: u32,
    /// Where the sender is; `None` = it does not know, and nothing is measured by this beacon.
    pub pose: Option<PoseReport>,
    /// Radio channel.
    pub channel: u8,
    /// Transmit power, dBm.
    pub power_dbm: i8,
    /// Whether the sender has come to rest.
    pub is_at_rest: bool,
    /// Whether its motors have current.
    pub is_armed: bool,
    /// Whether it is in the air.
    pub is_airborne: bool,
    /// Whom the sender has heard in the last 5 s, ascending, at most [`BEACON_MEMBERS_MAX`], those heard longest ago
    /// left out; with the sender they are the ring.
    pub members: Vec<VehicleId>,
    /// How far the sender is with its plan.
    pub progress: Progress,
    /// One of the emergency stops that the sender knows to be open.
    pub stop: Option<EmergencyStop>,
    /// What proves the sender.
    pub tag: Option<BeaconTag>,
}
