//! The messages: plain data with units in the names, valid only after [`Message::check`].

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::{Boot, LayerId, Lease, Revision, RunId, Sender, StopId, VehicleId};

/// Cells along one side of a tile.
pub const TILE_SIDE: usize = 32;
/// Cells of a tile.
pub const TILE_CELLS: usize = TILE_SIDE * TILE_SIDE;

/// A place in the venue's local frame.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Position {
    /// Metres along the venue's x axis.
    pub x_m: f64,
    /// Metres along the venue's y axis.
    pub y_m: f64,
    /// Metres above the datum; 0 for what drives on the ground.
    pub z_m: f64,
}

/// A pose as a vehicle knows it.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PoseReport {
    /// The place.
    pub at: Position,
    /// Direction, counter-clockwise from the x axis, radians.
    pub heading_rad: f64,
    /// Standard deviation of each coordinate, metres.
    pub sd_m: f64,
}

/// What a vehicle is doing.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub enum Mode {
    /// Standing, ready for a command.
    #[default]
    Idle,
    /// Driving along its leg.
    Driving,
    /// Turning on the spot.
    Turning,
    /// Stopped by its own reflex or envelope.
    Halted,
    /// Held by an order.
    Held,
    /// Stopped by an emergency order; only a start order ends it.
    Emergency,
}

/// The route that a vehicle is committed to: from where it stands or stood, to where it may end.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct LegReport {
    /// Corners of the route, the first where the leg began.
    pub route: Vec<Position>,
}

/// The highest order that a vehicle has accepted.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Ordered {
    /// By whose right.
    pub lease: Lease,
    /// Which of that lease's orders.
    pub revision: Revision,
    /// In which run.
    pub run: RunId,
    /// What was ordered; `None` = nothing yet.
    pub kind: Option<OrderKind>,
}

impl Ordered {
    /// Gives what orders are compared by: the higher one wins.
    pub fn edition(&self) -> (Lease, Revision) {
        (self.lease, self.revision)
    }
}

/// What a vehicle says of itself, several times a second.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct State {
    /// Who speaks.
    pub vehicle: VehicleId,
    /// Start of its software.
    pub boot: Boot,
    /// Counts the states of this boot.
    pub sequence: u64,
    /// Where it is.
    pub pose: PoseReport,
    /// Speed over ground, m/s.
    pub speed_mps: f64,
    /// What it is doing.
    pub mode: Mode,
    /// Charge left, 0 to 1.
    pub battery: f64,
    /// What it is committed to drive; `None` at rest.
    pub leg: Option<LegReport>,
    /// Run and revision of the plan it has accepted.
    pub accepted: (RunId, Revision),
    /// Highest order accepted.
    pub ordered: Ordered,
}

/// Where a tile lies: altitude slice, then tile column and row.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize)]
pub struct TileAddress {
    /// Altitude slice.
    pub slice: i16,
    /// Tile column: floor(cell x / 32).
    pub x: i32,
    /// Tile row: floor(cell y / 32).
    pub y: i32,
}

/// One whole tile of one layer, in absolute values.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct TileReport {
    /// Whose layer.
    pub layer: LayerId,
    /// Where the tile lies.
    pub address: TileAddress,
    /// Counts the changes of this tile; the highest wins.
    pub revision: u32,
    /// 1024 cells, row-major, x fastest; one unit = 0.1 log-odds, positive = occupied.
    #[serde(with = "crate::cells")]
    pub cells: Arc<[i8; TILE_CELLS]>,
}

/// What a node holds of one layer.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct LayerDigest {
    /// Which layer.
    pub layer: LayerId,
    /// How many tiles of it.
    pub tiles: u32,
    /// Sum of their revisions: who has the lower one lacks something.
    pub revisions: u64,
    /// Hash over (address, revision) of all of them.
    pub hash: u64,
}

/// What a node holds of all layers, once a second.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Digest {
    /// One entry a layer, ascending.
    pub layers: Vec<LayerDigest>,
}

/// Asks for the tiles of a layer that are newer than those known.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Want {
    /// Which layer.
    pub layer: LayerId,
    /// Revisions already held, ascending by address.
    pub known: Vec<(TileAddress, u32)>,
}

/// A position with what happens there and what it waits for.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Stop {
    /// Name of the stop, stable across revisions.
    pub id: StopId,
    /// Where it is.
    pub at: Position,
    /// Corners of the route that leads here from the stop before, without both ends.
    pub route: Vec<Position>,
    /// How long to stay, milliseconds; 0 = drive on.
    pub dwell_ms: u32,
    /// How long to stay at most when partners do not come, milliseconds.
    pub dwell_limit_ms: u32,
    /// Who should be at rest at the same time.
    pub partners: Vec<VehicleId>,
    /// Stops of others that must be done before the leg to this stop is entered.
    pub after: Vec<(VehicleId, StopId)>,
}

/// The whole list of stops of one vehicle.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Plan {
    /// Whose plan.
    pub vehicle: VehicleId,
    /// Of which run.
    pub run: RunId,
    /// Of which revision; all vehicles' plans of a revision belong together.
    pub revision: Revision,
    /// By whose right; a vehicle follows no plan of a lower lease than the highest it has heard.
    pub lease: Lease,
    /// Newest state heard from the vehicle, so that it can judge the plan's age by its own clock.
    pub seen_state: u64,
    /// Every vehicle of the revision, ascending; it is complete when all their plans are there.
    pub members: Vec<VehicleId>,
    /// Where the vehicle must stand to begin.
    pub start: Position,
    /// The stops, in order.
    pub stops: Vec<Stop>,
}

/// How far a vehicle is with its plan.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Progress {
    /// Who speaks.
    pub vehicle: VehicleId,
    /// Start of its software.
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

/// What an operator wants of a vehicle.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum OrderKind {
    /// Begin or go on with the plan.
    Start,
    /// Stand still, keep the plan.
    Hold,
    /// Drive home.
    Return,
    /// Come down where it is.
    Land,
    /// Stop at once.
    Emergency,
    /// Cut the motors at once, whatever falls; asked for separately and confirmed.
    CutMotors,
}

/// An order, repeated until its effect shows in State.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Order {
    /// For whom.
    pub vehicle: VehicleId,
    /// By whose right.
    pub lease: Lease,
    /// In which run.
    pub run: RunId,
    /// The higher one wins once handled.
    pub revision: Revision,
    /// Newest state heard from the vehicle, so that it can judge the order's age by its own clock.
    pub seen_state: u64,
    /// What to do.
    pub kind: OrderKind,
}

/// One beacon heard, or missed.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Sample {
    /// Counts the samples of this vehicle, boot and run.
    pub sequence: u64,
    /// When it was heard, nanoseconds of the receiver's clock.
    pub heard_at_ns: u64,
    /// Who sent the beacon.
    pub transmitter: VehicleId,
    /// Where the transmitter was (for a miss: where it was last heard to be).
    pub transmitter_pose: PoseReport,
    /// Where the receiver was.
    pub receiver_pose: PoseReport,
    /// Radio channel.
    pub channel: u8,
    /// Transmit power, dBm.
    pub power_dbm: i8,
    /// Received signal strength, dBm; `None` = missed.
    pub rssi_dbm: Option<i16>,
}

/// Samples of one vehicle, kept by it until the ground has them.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Samples {
    /// Who measured.
    pub vehicle: VehicleId,
    /// Start of its software.
    pub boot: Boot,
    /// In which run.
    pub run: RunId,
    /// The samples, ascending by sequence.
    pub samples: Vec<Sample>,
}

/// How many samples of a vehicle a store has without a gap.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct HeardFrom {
    /// Who measured.
    pub vehicle: VehicleId,
    /// Start of its software.
    pub boot: Boot,
    /// In which run.
    pub run: RunId,
    /// Every sample with a lower sequence is stored.
    pub below: u64,
}

/// What the ground has stored, so that vehicles may forget it.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Have {
    /// Which store speaks; a new disk has a new id.
    pub store: u64,
    /// Per vehicle, boot and run.
    pub watermarks: Vec<HeardFrom>,
    /// Runs that are closed, ascending: only of these may covered samples be forgotten for good.
    pub closed: Vec<RunId>,
}

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
    /// Version of the software.
    pub software: String,
    /// What it can do, in words such as `radio` or `range`.
    pub capabilities: Vec<String>,
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
    /// Room left where it keeps its data, MB; `None` = not known.
    pub disk_free_mb: Option<u32>,
    /// What is wrong, in words; empty when all is well.
    pub troubles: Vec<String>,
}

/// What the ground station is doing.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub enum StationPhase {
    /// Nothing is wished, or all is done.
    #[default]
    Idle,
    /// A sweep is wished; not every vehicle has been heard yet.
    Waiting,
    /// Everyone is brought to rest.
    Stopping,
    /// Plans are made.
    Planning,
    /// The sweep is driven.
    Running,
    /// All stops are done; the last samples come in.
    Closing,
}

/// What the ground station says of itself, once a second.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Report {
    /// Start of its software.
    pub boot: Boot,
    /// By which right it gives orders and plans.
    pub lease: Lease,
    /// Which store it writes.
    pub store: u64,
    /// What it is doing.
    pub phase: StationPhase,
    /// The run it is doing that for.
    pub run: RunId,
    /// Laps done of the run.
    pub laps_done: u32,
    /// Laps of the run, as far as planned.
    pub laps: u32,
    /// Samples stored of the run.
    pub samples: u64,
    /// Pictures made so far.
    pub pictures: u32,
    /// The vehicles that it plans for, ascending.
    pub members: Vec<VehicleId>,
    /// The vehicles that it has given up for now, ascending.
    pub lost: Vec<VehicleId>,
    /// What was ordered and not ended by a start.
    pub standing: Option<OrderKind>,
    /// What is wrong, in words; empty when all is well.
    pub troubles: Vec<String>,
}

/// What a radio says: who and where it is, and how far with its plan.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Beacon {
    /// Who speaks.
    pub sender: VehicleId,
    /// Start of its software.
    pub boot: Boot,
    /// Counts the beacons of this boot; a gap is a miss.
    pub sequence: u64,
    /// Where the sender is.
    pub pose: PoseReport,
    /// Radio channel.
    pub channel: u8,
    /// Transmit power, dBm.
    pub power_dbm: i8,
    /// Whom the sender has heard in the last 5 s, ascending; with the sender they are the ring.
    pub members: Vec<VehicleId>,
    /// How far the sender is with its plan.
    pub progress: Progress,
}

/// Everything that travels on the bus or by radio.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[allow(missing_docs, reason = "each variant is named by the type it carries")]
pub enum Message {
    Hello(Hello),
    State(State),
    Tile(TileReport),
    Digest(Digest),
    Want(Want),
    Plan(Plan),
    Progress(Progress),
    Order(Order),
    Samples(Samples),
    Have(Have),
    Beacon(Beacon),
    Health(Health),
    Report(Report),
}

impl Message {
    /// Gives the word that its keys, files and tables name this kind by.
    pub fn word(&self) -> &'static str {
        match self {
            Message::Hello(_) => "hello",
            Message::State(_) => "state",
            Message::Tile(_) => "tile",
            Message::Digest(_) => "digest",
            Message::Want(_) => "want",
            Message::Plan(_) => "plan",
            Message::Progress(_) => "progress",
            Message::Order(_) => "order",
            Message::Samples(_) => "samples",
            Message::Have(_) => "have",
            Message::Beacon(_) => "beacon",
            Message::Health(_) => "health",
            Message::Report(_) => "report",
        }
    }

    /// Gives who alone may say this message; `None` when several may (a tile is handed on by anyone, an order comes
    /// from the ground or an operator).
    pub fn author(&self) -> Option<Sender> {
        match self {
            Message::Hello(hello) => Some(hello.node),
            Message::State(state) => Some(Sender::Vehicle(state.vehicle)),
            Message::Progress(progress) => Some(Sender::Vehicle(progress.vehicle)),
            Message::Samples(batch) => Some(Sender::Vehicle(batch.vehicle)),
            Message::Beacon(beacon) => Some(Sender::Vehicle(beacon.sender)),
            Message::Health(health) => Some(Sender::Vehicle(health.vehicle)),
            Message::Plan(_) | Message::Have(_) | Message::Report(_) => Some(Sender::Ground),
            Message::Tile(_) | Message::Digest(_) | Message::Want(_) | Message::Order(_) => None,
        }
    }
}
