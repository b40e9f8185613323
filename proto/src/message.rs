//! The messages: plain data with units in the names, valid only after [`Message::check`].

use serde::{Deserialize, Serialize};

use crate::{Boot, LayerId, Lease, Revision, RunId, StopId, VehicleId};

/// Cells along one side of a tile.
pub const TILE_SIDE: usize = 32;
/// Cells of a tile.
pub const TILE_CELLS: usize = TILE_SIDE * TILE_SIDE;

/// Layers of a digest at most; one a start of a vehicle's software.
const LAYERS_MAX: usize = 256;
/// Tiles of a want at most.
const KNOWN_MAX: usize = 4096;
/// Bytes of a software version at most.
const SOFTWARE_MAX: usize = 256;
/// Stops of a plan at most.
const STOPS_MAX: usize = 4096;
/// Corners of a route, or partners or stops waited for, at most.
const LIST_MAX: usize = 1024;

/// A place in the venue's local frame.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Position {
    /// Metres along the venue's x axis.
    pub x_m: f64,
    /// Metres along the venue's y axis.
    pub y_m: f64,
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
    /// Highest order accepted: lease and revision.
    pub ordered: (Lease, Revision),
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
    pub cells: Vec<i8>,
}

/// What a node holds of one layer.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct LayerDigest {
    /// Which layer.
    pub layer: LayerId,
    /// How many tiles of it.
    pub tiles: u32,
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
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Plan {
    /// Whose plan.
    pub vehicle: VehicleId,
    /// Of which run.
    pub run: RunId,
    /// Of which revision; all vehicles' plans of a revision belong together.
    pub revision: Revision,
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
}

/// Who a node is; said on joining.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Hello {
    /// Who speaks; `None` = the ground station.
    pub vehicle: Option<VehicleId>,
    /// Start of its software.
    pub boot: Boot,
    /// Hash of the venue file; nodes of different venues refuse each other.
    pub venue_hash: u64,
    /// Version of the software.
    pub software: String,
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
}

impl Message {
    /// Names what makes a message impossible; `Ok` when it may be handed to an actor.
    ///
    /// # Errors
    /// The field that is wrong and what was expected of it.
    pub fn check(&self) -> Result<(), &'static str> {
        match self {
            Message::State(state) => state.check(),
            Message::Tile(tile) if tile.cells.len() != TILE_CELLS => Err("a tile has 1024 cells"),
            Message::Plan(plan) => plan.check(),
            Message::Tile(_) => Ok(()),
            Message::Samples(batch) => batch.check(),
            Message::Beacon(beacon) => beacon.check(),
            Message::Hello(hello) if hello.software.len() > SOFTWARE_MAX => {
                Err("a version has at most 256 bytes")
            }
            Message::Hello(_) => Ok(()),
            Message::Digest(digest) if digest.layers.len() > LAYERS_MAX => {
                Err("a digest has at most 256 layers")
            }
            Message::Digest(_) => Ok(()),
            Message::Want(want) if want.known.len() > KNOWN_MAX => Err("a want has at most 4096 tiles"),
            Message::Want(_) => Ok(()),
            Message::Progress(progress) => progress.check(),
            Message::Order(order) => number(order.run.0).and(number(order.revision.0)),
            Message::Have(have) => have.watermarks.iter().try_for_each(|mark| number(mark.run.0)),
        }
    }
}

/// Checks a number that others count on from: the last one is never given.
fn number(number: u32) -> Result<(), &'static str> {
    if number == u32::MAX { Err("a run, revision or stop is under 4294967295") } else { Ok(()) }
}

/// Checks members: each named once, ascending.
fn ascending(members: &[VehicleId]) -> Result<(), &'static str> {
    let sorted = members.windows(2).all(|pair| pair[0] < pair[1]);
    if sorted { Ok(()) } else { Err("members are ascending, each named once") }
}

impl Position {
    fn check(&self) -> Result<(), &'static str> {
        let sane = |metres: f64| metres.abs() < 1e6;
        if sane(self.x_m) && sane(self.y_m) { Ok(()) } else { Err("a position is finite and under 1000 km") }
    }
}

impl PoseReport {
    fn check(&self) -> Result<(), &'static str> {
        self.at.check()?;
        if !self.heading_rad.is_finite() {
            return Err("a heading is finite");
        }
        if (0.0..1e6).contains(&self.sd_m) { Ok(()) } else { Err("a pose deviation is from 0 to 1000 km") }
    }
}

impl State {
    fn check(&self) -> Result<(), &'static str> {
        self.pose.check()?;
        if !(0.0..1e3).contains(&self.speed_mps) {
            return Err("a speed is from 0 to 1000 m/s");
        }
        if !(0.0..=1.0).contains(&self.battery) {
            return Err("a battery is from 0 to 1");
        }
        number(self.accepted.0.0).and(number(self.accepted.1.0)).and(number(self.ordered.1.0))?;
        check_route(self.leg.as_ref().map_or(&[], |leg| &leg.route))
    }
}

impl Plan {
    fn check(&self) -> Result<(), &'static str> {
        self.start.check()?;
        if !self.members.contains(&self.vehicle) {
            return Err("a plan's vehicle is one of its members");
        }
        ascending(&self.members)?;
        number(self.run.0).and(number(self.revision.0))?;
        if self.stops.len() > STOPS_MAX {
            return Err("a plan has at most 4096 stops");
        }
        self.stops.iter().try_for_each(Stop::check)
    }
}

impl Stop {
    fn check(&self) -> Result<(), &'static str> {
        if self.partners.len() > LIST_MAX || self.after.len() > LIST_MAX {
            return Err("a stop has at most 1024 partners and 1024 stops to wait for");
        }
        number(self.id.0)?;
        self.after.iter().try_for_each(|(_, stop)| number(stop.0))?;
        self.at.check()?;
        check_route(&self.route)
    }
}

fn check_route(route: &[Position]) -> Result<(), &'static str> {
    if route.len() > LIST_MAX {
        return Err("a route has at most 1024 corners");
    }
    route.iter().try_for_each(Position::check)
}

impl Progress {
    fn check(&self) -> Result<(), &'static str> {
        number(self.run.0).and(number(self.revision.0))?;
        self.done.iter().chain(&self.leg).try_for_each(|stop| number(stop.0))
    }
}

impl Beacon {
    fn check(&self) -> Result<(), &'static str> {
        self.pose.check()?;
        self.progress.check()?;
        if self.progress.vehicle != self.sender {
            return Err("a beacon's progress is its sender's");
        }
        ascending(&self.members)
    }
}

impl Samples {
    fn check(&self) -> Result<(), &'static str> {
        number(self.run.0)?;
        if !self.samples.windows(2).all(|pair| pair[0].sequence < pair[1].sequence) {
            return Err("samples are ascending by sequence");
        }
        self.samples.iter().try_for_each(Sample::check)
    }
}

impl Sample {
    fn check(&self) -> Result<(), &'static str> {
        self.transmitter_pose.check()?;
        self.receiver_pose.check()?;
        match self.rssi_dbm {
            Some(rssi) if !(-200..=100).contains(&rssi) => Err("an RSSI is from -200 to 100 dBm"),
            Some(_) | None => Ok(()),
        }
    }
}
