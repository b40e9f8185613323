//! How a vehicle fares apart from where it is. What of it is a reason not to start is judged by whoever reads it.

use serde::{Deserialize, Serialize};

use crate::{Boot, VehicleId};

/// The kind of an autopilot's software.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub enum AutopilotFamily {
    /// The simulated autopilot of this program.
    #[default]
    Simulated,
    /// ArduPilot, over MAVLink.
    ArduPilot,
    /// PX4, over MAVLink.
    Px4,
    /// A motor controller that takes lines of text.
    SerialText,
    /// Something that this version has no name for.
    Other,
}

/// What an autopilot moves.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub enum BodyKind {
    /// It drives, and turns on the spot.
    #[default]
    Rover,
    /// It flies, and stays where it is.
    Copter,
    /// It swims.
    Boat,
    /// It flies, and cannot stay where it is.
    Plane,
    /// Something that this version has no name for.
    Other,
}

/// How well an autopilot knows its place by satellites.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub enum SatelliteFix {
    /// It has not said so.
    #[default]
    Unknown,
    /// There is no receiver.
    NoReceiver,
    /// Not at all.
    NoFix,
    /// Without height.
    TwoD,
    /// With height.
    ThreeD,
    /// With height and corrections.
    Differential,
    /// By carrier phase, ambiguities not resolved.
    RtkFloat,
    /// By carrier phase, ambiguities resolved.
    RtkFixed,
}

/// What an autopilot thinks of its own estimate of the pose.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub enum Estimator {
    /// It has not said so.
    #[default]
    Unknown,
    /// Not ready yet.
    Starting,
    /// Sound.
    Good,
    /// Not to be trusted.
    Bad,
}

/// What an autopilot does by itself when something fails.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub enum FailsafeAction {
    /// It has not said so.
    #[default]
    Unknown,
    /// Nothing.
    Off,
    /// It stays where it is.
    Hold,
    /// It comes down where it is.
    Land,
    /// It goes home in a straight line.
    Return,
    /// Something else.
    Other,
}

impl FailsafeAction {
    /// Returns whether the vehicle stays where it is then, or comes down there.
    pub fn keeps_place(self) -> bool {
        match self {
            FailsafeAction::Hold | FailsafeAction::Land => true,
            FailsafeAction::Unknown
            | FailsafeAction::Off
            | FailsafeAction::Return
            | FailsafeAction::Other => false,
        }
    }
}

/// What an autopilot does by itself, for each cause.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Failsafes {
    /// The battery is low.
    pub battery: FailsafeAction,
    /// Its companion computer is silent.
    pub companion: FailsafeAction,
    /// The remote control is out of reach.
    pub remote: FailsafeAction,
    /// It leaves its own fence.
    pub fence: FailsafeAction,
    /// It no longer trusts its own estimate of the pose.
    pub estimator: FailsafeAction,
}

impl Failsafes {
    /// Returns those that have to keep a vehicle where it is, each with its cause: home in a straight line leads through walls.
    pub fn needed(&self) -> [(&'static str, FailsafeAction); 3] {
        [
            ("battery", self.battery),
            ("companion", self.companion),
            ("fence", self.fence),
        ]
    }
}

/// What an autopilot says of itself.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct AutopilotHealth {
    /// The kind of its software.
    pub family: AutopilotFamily,
    /// What it moves.
    pub body: BodyKind,
    /// Version of its software, such as `4.5.4`; empty = not known.
    pub firmware: String,
    /// Voltage of the battery, mV; `None` = not measured.
    pub battery_mv: Option<u32>,
    /// Current out of the battery, mA; `None` = not measured.
    pub battery_ma: Option<i32>,
    /// How well it knows its place by satellites.
    pub fix: SatelliteFix,
    /// Satellites that it uses; `None` = not known.
    pub satellites: Option<u8>,
    /// What it thinks of its own estimate of the pose.
    pub estimator: Estimator,
    /// What it does by itself.
    pub failsafes: Failsafes,
}

/// What a radio has done since the software started.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct RadioHealth {
    /// Beacons that went on the air.
    pub sent: u64,
    /// Beacons that did not.
    pub unsent: u64,
    /// Those of them that found the channel busy.
    pub busy: u64,
    /// Frames that could not be read.
    pub bad: u64,
    /// How often the device was opened anew.
    pub reopens: u64,
}

/// What the range sensors have done since the software started.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct RangeHealth {
    /// Readings that were dropped as impossible.
    pub glitches: u64,
    /// Readings that never came.
    pub faults: u64,
}

/// What a recording takes of the disk.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct RecordingHealth {
    /// Used, MB.
    pub used_mb: u32,
    /// At most, MB; the oldest is deleted beyond it.
    pub limit_mb: u32,
}

/// The supply of the computer.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub enum Power {
    /// The computer does not say.
    #[default]
    Unknown,
    /// Enough since it was switched on.
    Good,
    /// Enough now, too low at times before.
    WasLow,
    /// Too low.
    Low,
}

/// How a vehicle fares apart from where it is: what an operator looks at before a run.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Health {
    /// Who speaks.
    pub vehicle: VehicleId,
    /// Start of its software.
    pub boot: Boot,
    /// Whom it has heard by radio in the last 5 s, ascending.
    pub hears: Vec<VehicleId>,
    /// Samples kept that the ground has not confirmed.
    pub samples_waiting: u64,
    /// Samples lost since nothing could keep them.
    pub samples_lost: u64,
    /// Inputs that actors have dropped unread.
    pub inputs_dropped: u64,
    /// Frames that were refused.
    pub frames_refused: u64,
    /// Frames of a kind that it does not know.
    pub frames_unknown: u64,
    /// Room left where it keeps its data, MB; `None` = not known.
    pub disk_free_mb: Option<u32>,
    /// Its recording; `None` = it keeps none, or does not say.
    pub recording: Option<RecordingHealth>,
    /// Its autopilot; `None` = it was never heard.
    pub autopilot: Option<AutopilotHealth>,
    /// Its radio; `None` = it has none, or does not say.
    pub radio: Option<RadioHealth>,
    /// Its range sensors; `None` = it has none, or does not say.
    pub range: Option<RangeHealth>,
    /// The supply of its computer.
    pub power: Power,
    /// Temperature of its processor, °C; `None` = not known.
    pub processor_c: Option<i8>,
    /// Whether its clock is synchronised; `None` = not known. Nothing is decided by it.
    pub is_clock_synchronised: Option<bool>,
    /// What is wrong, in words; empty when all is well.
    pub troubles: Vec<String>,
}
