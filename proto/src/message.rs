//! The messages: plain data with units in the names or in the types, valid only after [`Message::check`]. No message
//! decides anything, and none knows how it is sent.

mod beacon;
mod health;
mod hello;
mod image;
mod map;
mod order;
mod plan;
mod report;
mod samples;
mod state;
mod task;

use serde::{Deserialize, Serialize};

pub use beacon::{BEACON_BYTES_MAX, BEACON_MEMBERS_MAX, Beacon, BeaconTag};
pub use health::{
    AutopilotFamily, AutopilotHealth, BodyKind, Estimator, FailsafeAction, Failsafes, Fix, Health,
    Power, RadioHealth, RangeHealth, RecordingHealth,
};
pub use hello::{Capability, Hello, Interest, RadioKind, RangeSensorKind, ServoKind};
pub use image::{
    Covariance, Find, IMAGE_PART_PIXELS, IMAGE_SIDE_MAX, Image, ImageSubject, Rectangle,
};
pub use map::{Digest, LayerDigest, TILE_CELLS, TILE_SIDE, TileAddress, TileReport, Want};
pub use order::{EmergencyStop, Order, OrderKind, Standing, StopScope};
pub use plan::{
    Mission, MissionEnd, MissionPhase, MissionRefusal, Plan, Progress, SeenState, Stop,
};
pub use report::{Report, RunEnd, RunReport, StationPhase};
pub use samples::{Have, HeardFrom, LostSamples, Sample, Samples, WATERMARKS_ALWAYS};
pub use state::{Control, LegReport, Mode, Ordered, StandReason, State};
pub use task::{
    MissionKind, PlaceSharing, SweepPlanner, TASK_PLACES_MAX, Task, TaskKind, TaskNumber,
    TaskParameter, TaskUnit,
};

use crate::{Kind, Sender};

/// Everything that travels on the bus or by radio.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[allow(missing_docs, reason = "each variant is named by the type it carries")]
pub enum Message {
    Hello(Hello),
    State(State),
    Tile(TileReport),
    Digest(Digest),
    Want(Want),
    Plan(Plan),
    Mission(Mission),
    Order(Order),
    Samples(Samples),
    Have(Have),
    Beacon(Beacon),
    Health(Health),
    Report(Report),
    Standing(Standing),
    Task(Task),
    Image(Image),
}

impl Message {
    /// Returns which kind of message it is.
    pub fn kind(&self) -> Kind {
        match self {
            Message::Hello(_) => Kind::Hello,
            Message::State(_) => Kind::State,
            Message::Tile(_) => Kind::Tile,
            Message::Digest(_) => Kind::Digest,
            Message::Want(_) => Kind::Want,
            Message::Plan(_) => Kind::Plan,
            Message::Mission(_) => Kind::Mission,
            Message::Order(_) => Kind::Order,
            Message::Samples(_) => Kind::Samples,
            Message::Have(_) => Kind::Have,
            Message::Beacon(_) => Kind::Beacon,
            Message::Health(_) => Kind::Health,
            Message::Report(_) => Kind::Report,
            Message::Standing(_) => Kind::Standing,
            Message::Task(_) => Kind::Task,
            Message::Image(_) => Kind::Image,
        }
    }

    /// Returns the word that its keys, files and tables name this kind by.
    pub fn word(&self) -> &'static str {
        self.kind().word()
    }

    /// Returns who alone may say this message; `None` when several may (a tile and what stands are handed on by
    /// anyone, an order comes from the ground or an operator, a task from any operator).
    pub fn author(&self) -> Option<Sender> {
        match self {
            Message::Hello(hello) => Some(hello.node),
            Message::State(state) => Some(Sender::Vehicle(state.vehicle)),
            Message::Mission(mission) => Some(Sender::Vehicle(mission.vehicle)),
            Message::Samples(batch) => Some(Sender::Vehicle(batch.vehicle)),
            Message::Beacon(beacon) => Some(Sender::Vehicle(beacon.sender)),
            Message::Health(health) => Some(Sender::Vehicle(health.vehicle)),
            Message::Plan(_) | Message::Have(_) | Message::Report(_) | Message::Image(_) => {
                Some(Sender::Ground)
            }
            Message::Tile(_)
            | Message::Digest(_)
            | Message::Want(_)
            | Message::Order(_)
            | Message::Standing(_)
            | Message::Task(_) => None,
        }
    }
}
