//! What a vehicle knows of itself, as the vehicle actor tells the other actors of the same vehicle with every telemetry. Its
//! numbers are not rounded: what travels is made of it in `vehicle/report.rs` and nowhere else.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Ordered, Revision, RunId, VehicleMode};

use crate::autopilot::{FlightState, StoredProgress};
use crate::geom::{Point, Pose};

/// The state of the vehicle itself.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct OwnState {
    /// Counts the states of this boot.
    pub sequence: u64,
    /// Where the autopilot believes to be.
    pub pose: Pose,
    /// What its pose leaves out.
    pub flight_state: FlightState,
    /// Speed over ground, m/s.
    pub speed_mps: f64,
    /// What it is doing.
    pub mode: VehicleMode,
    /// Whether it has come to rest.
    pub is_at_rest: bool,
    /// Whether it obeys its mission: nobody has taken it over, and neither an order nor an emergency stop holds it back.
    pub may_move: bool,
    /// Whether its range sensors have answered of late.
    pub sees: bool,
    /// Whether the motors have current.
    pub is_armed: bool,
    /// Whether it stands on the ground; what drives always does.
    pub is_landed: bool,
    /// Charge left, 0 to 1; `None` = the autopilot has ceased to say it.
    #[serde(with = "crate::autopilot::charge")]
    pub battery: Option<f64>,
    /// Corners of the route that it is committed to, the first where it is; `None` at rest.
    pub leg: Option<Vec<Point>>,
    /// How far its autopilot is with the mission that it stores; `None` = it follows none.
    pub stored: Option<StoredProgress>,
    /// Run and revision of the plan it has accepted.
    pub accepted: (RunId, Revision),
    /// Highest order accepted.
    pub ordered: Ordered,
}
