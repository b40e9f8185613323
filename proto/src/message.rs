//! The messages: plain data with units in the names or in the types, valid only after [`Message::check`]. No message
//! decides anything, and none knows how it is sent.

mod beacon;
mod fix;
mod health;
mod hello;
mod image;
mod log;
mod look;
mod map;
mod mark;
mod order;
mod plan;
mod report;
mod samples;
mod state;
mod stored;
mod task;

use serde::{Deserialize, Serialize};

pub use beacon::{BEACON_BYTES_MAX, BEACON_MEMBERS_MAX, Beacon, BeaconTag};
pub use fix::{FIX_AGE_MAX_MS, Fix};
pub use health::{
    AutopilotFamily, AutopilotHealth, BodyKind, Estimator, FailsafeAction, Failsafes, Health,
    Power, RadioHealth, RangeHealth, RecordingHealth, SatelliteFix,
};
pub use hello::{Capability, Hello, Interest, RadioKind, RangeSensorKind, ServoKind};
pub use image::{
    Covariance, Find, IMAGE_FINDS_MAX, IMAGE_PART_PIXELS, IMAGE_SIDE_MAX, Image, ImageSubject,
    Rectangle,
};
pub use log::{
    LOG_LINE_BYTES_MAX, LOG_LINES_MAX, LogLine, LogLines, LogSeverity, NodeSettings,
    SETTINGS_PART_BYTES_MAX, SETTINGS_PARTS_MAX,
};
pub use look::{LOOK_READINGS_MAX, Look, LookReading, READING_AGE_MAX_MS};
pub use map::{Digest, LayerDigest, TILE_CELLS, TILE_SIDE, TileAddress, TileReport, TileRequest};
pub use mark::Mark;
pub use order::{EmergencyStop, OpenStops, Order, OrderKind, StopScope};
pub use plan::{
    MissionEnd, MissionPhase, MissionProgress, MissionRefusal, Plan, Progress, SeenState, Stop,
};
pub use report::{GroundReport, RunEnd, RunReport, StationPhase};
pub use samples::{Have, HeardFrom, LostSamples, Sample, Samples, WATERMARKS_ALWAYS};
pub use state::{Control, LegReport, Ordered, StandReason, State, VehicleMode};
pub use stored::{Parameter, STORED_ITEMS_MAX, StoredItem};
pub use task::{
    MissionKind, PlaceSharing, SweepPlanner, TASK_PLACES_MAX, Task, TaskKind, TaskNumber,
    TaskParameter, TaskUnit,
};

use crate::{MessageKind, Sender};

/// Everything that travels on the bus or by radio.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[allow(missing_docs, reason = "each variant is named by the type it carries")]
pub enum Message {
    Hello(Hello),
    State(State),
    Tile(TileReport),
    Digest(Digest),
    Want(TileRequest),
    Plan(Plan),
    Mission(MissionProgress),
    Order(Order),
    Samples(Samples),
    Have(Have),
    Beacon(Beacon),
    Health(Health),
    Report(GroundReport),
    Standing(OpenStops),
    Task(Task),
    Image(Image),
    Fix(Fix),
    Mark(Mark),
    Look(Look),
    Log(LogLines),
    Settings(NodeSettings),
}

impl Message {
    /// Returns which kind of message it is.
    pub fn kind(&self) -> MessageKind {
        match self {
            Message::Hello(_) => MessageKind::Hello,
            Message::State(_) => MessageKind::State,
            Message::Tile(_) => MessageKind::Tile,
            Message::Digest(_) => MessageKind::Digest,
            Message::Want(_) => MessageKind::Want,
            Message::Plan(_) => MessageKind::Plan,
            Message::Mission(_) => MessageKind::Mission,
            Message::Order(_) => MessageKind::Order,
            Message::Samples(_) => MessageKind::Samples,
            Message::Have(_) => MessageKind::Have,
            Message::Beacon(_) => MessageKind::Beacon,
            Message::Health(_) => MessageKind::Health,
            Message::Report(_) => MessageKind::Report,
            Message::Standing(_) => MessageKind::Standing,
            Message::Task(_) => MessageKind::Task,
            Message::Image(_) => MessageKind::Image,
            Message::Fix(_) => MessageKind::Fix,
            Message::Mark(_) => MessageKind::Mark,
            Message::Look(_) => MessageKind::Look,
            Message::Log(_) => MessageKind::Log,
            Message::Settings(_) => MessageKind::Settings,
        }
    }

    /// Returns the word that its keys, files and tables name this kind by.
    pub fn word(&self) -> &'static str {
        self.kind().word()
    }

    /// Returns who alone may say this message; `None` when several may (a tile and what stands are handed on by
    /// anyone, an order comes from the ground or an operator, a task and a fix from any operator, a mark from any
    /// operator and, once it is stored, from the ground).
    pub fn author(&self) -> Option<Sender> {
        match self {
            Message::Hello(hello) => Some(hello.node),
            Message::State(state) => Some(Sender::Vehicle(state.vehicle)),
            Message::Mission(mission) => Some(Sender::Vehicle(mission.vehicle)),
            Message::Samples(batch) => Some(Sender::Vehicle(batch.vehicle)),
            Message::Beacon(beacon) => Some(Sender::Vehicle(beacon.sender)),
            Message::Health(health) => Some(Sender::Vehicle(health.vehicle)),
            Message::Look(look) => Some(Sender::Vehicle(look.vehicle)),
            Message::Log(log) => Some(log.node),
            Message::Settings(settings) => Some(settings.node),
            Message::Plan(_) | Message::Have(_) | Message::Report(_) | Message::Image(_) => {
                Some(Sender::Ground)
            }
            Message::Tile(_)
            | Message::Digest(_)
            | Message::Want(_)
            | Message::Order(_)
            | Message::Standing(_)
            | Message::Task(_)
            | Message::Fix(_)
            | Message::Mark(_) => None,
        }
    }
}
