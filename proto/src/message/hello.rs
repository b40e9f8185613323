//! Who a node is and what it can do. Whether it may take part is not decided here.

use serde::{Deserialize, Serialize};

use super::{AutopilotFamily, BodyKind};
use crate::{Boot, Lease, Sender};

/// Who a node is; said on joining and repeated. Its first bytes are the same in all versions of the wire
/// (see [`crate::codec::greeting`]).
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Hello {
    /// Who speaks.
    pub node: Sender,
    /// Start of its software.
    pub boot: Boot,
    /// Hash of the venue file; nodes of different venues refuse each other.
    pub venue_hash: u64,
    /// Drawn anew at every start, so that two nodes of one name can be told apart.
    pub instance: u64,
    /// Whether it takes part already; otherwise it asks whether it may.
    pub is_member: bool,
    /// For how many whole seconds it has taken part; of two of one name the one that has for longer stays.
    pub member_for_s: u32,
    /// What people call it; may be empty.
    pub name: String,
    /// Version of the software.
    pub software: String,
    /// What it has and can do, ascending; range sensors of one kind are listed once each.
    pub capabilities: Vec<Capability>,
    /// The lease that it holds and gives orders under; `None` = it gives none.
    pub lease: Option<Lease>,
    /// What it wants to be told, ascending; what all nodes need is always told.
    pub interest: Vec<Interest>,
}

impl Hello {
    /// Returns what a node says that asks whether it may take part, and says nothing else of itself: it has neither a name
    /// nor a version, can do nothing, holds no lease, and wants to be told no more than all nodes are.
    pub fn asking(node: Sender, boot: Boot, venue_hash: u64, instance: u64) -> Hello {
        Hello {
            node,
            boot,
            venue_hash,
            instance,
            is_member: false,
            member_for_s: 0,
            name: String::new(),
            software: String::new(),
            capabilities: Vec::new(),
            lease: None,
            interest: Vec::new(),
        }
    }
}

/// Something that a node has or can do.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum Capability {
    /// An autopilot, and what it moves.
    Autopilot(AutopilotFamily, BodyKind),
    /// A range sensor.
    RangeSensor(RangeSensorKind),
    /// A servo that points a range sensor.
    Servo(ServoKind),
    /// A radio that says and hears beacons.
    Radio(RadioKind),
    /// Missions that the autopilot keeps and flies by itself.
    StoredMissions,
}

/// What a range sensor is read by.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum RangeSensorKind {
    /// The simulated world.
    Simulated,
    /// An ultrasonic sensor with trigger and echo lines.
    HcSr04,
    /// A lidar on a serial line.
    TfLuna,
    /// The autopilot.
    Autopilot,
    /// Something that this version has no name for.
    Other,
    /// A sensor that says lines of text on a serial line.
    SerialText,
}

/// What a servo is moved by.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum ServoKind {
    /// The simulated world.
    Simulated,
    /// A pulse-width output of the computer.
    Pwm,
    /// The autopilot.
    Autopilot,
    /// Something that this version has no name for.
    Other,
}

/// What says and hears beacons.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum RadioKind {
    /// The simulated world.
    Simulated,
    /// An XBee module with 802.15.4 firmware.
    XBee,
    /// Something that this version has no name for.
    Other,
}

/// A subject that a node may want to be told about; operators subscribe by it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum Interest {
    /// The state, the missions and the health of all vehicles.
    Fleet,
    /// The tiles of the map.
    Map,
    /// Samples as they are measured.
    Samples,
    /// The images of the ground station.
    Images,
    /// What vehicles look at.
    Looks,
    /// The lines of nodes' logs.
    Log,
    /// The settings of nodes.
    Settings,
}
