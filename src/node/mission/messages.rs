//! What the mission actor is told and says, and which of it joins.

use std::fmt;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    EmergencyStop, LayerId, MissionProgress, MissionRefusal, Order, OrderKind, Plan, Revision,
    RunId, Sender, StandReason, State, StopId, Task, TileAddress, VehicleId,
};

use super::obstruction::Obstruction;
use super::pilot::WayEvent;
use crate::actor::{Input, InputClass};
use crate::geom::Point;
use crate::map::MapTile;
use crate::node::OwnState;
use crate::node::memory::{Remembered, VehicleMemory};
use crate::node::peers::join_states;
use crate::node::radio::BeaconReport;
use crate::node::vehicle::{self, MoveCommand};
use crate::sweep::{PlanRefusal, VehicleProgress};
use crate::time::Time;

/// Why a vehicle does something that nobody has ordered.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum AutonomyCause {
    /// Nobody was heard on the bus for `autonomy_s`.
    BusLost,
    /// The battery is below `battery_return`.
    BatteryLow,
    /// The battery is below `battery_hold`.
    BatteryEmpty,
    /// Its range sensors have not answered for too long.
    Blind,
}

impl fmt::Display for AutonomyCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            AutonomyCause::BusLost => "the bus is lost",
            AutonomyCause::BatteryLow => "the battery is low",
            AutonomyCause::BatteryEmpty => "the battery is nearly empty",
            AutonomyCause::Blind => "its range sensors do not answer",
        })
    }
}

/// What the mission actor can be told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum In {
    /// Where the vehicle is.
    State(OwnState),
    /// Where a peer is.
    Peer(State),
    /// A tile that changed.
    Tile(MapTile),
    /// A plan, own or a peer's.
    Plan(Plan),
    /// What an operator wants a run to be.
    Task(Task),
    /// How far a peer is.
    Progress(VehicleProgress),
    /// What a peer is out for, and where it is going.
    PeerMission(MissionProgress),
    /// What a peer's beacon tells.
    Sighted(BeaconReport),
    /// A ground station expects these vehicles.
    Expected(Vec<VehicleId>),
    /// Some node was heard on the bus, whatever it said.
    Heard(Sender),
    /// An order that the vehicle has accepted.
    Order(Order),
    /// Which emergency stops are open.
    Stops(Vec<EmergencyStop>),
    /// What the vehicle's envelope or reflex decided.
    SafetyEvent(vehicle::SafetyEvent),
    /// How it stands with what was to be remembered.
    Remembered(Remembered),
}

/// What the mission actor can say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Out {
    /// To the vehicle, and when it was decided.
    Command(Time, MoveCommand),
    /// Why it stands and does not go on by itself; `None` = it may.
    Holds(Option<StandReason>),
    /// The plan that is followed from now on.
    Accepted(RunId, Revision),
    /// How far it is with its mission, as it travels.
    Progress(MissionProgress),
    /// This is to be remembered. What follows from it is said when it is.
    Remember(VehicleMemory),
    /// What is heard by radio belongs to this run from now on; `None` = to none.
    Measure(Option<RunId>),
    /// For log and operator.
    MissionEvent(MissionEvent),
}

/// What the mission did or met.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum MissionEvent {
    /// A stop was done.
    Done(StopId),
    /// A new revision is followed.
    Adopted(RunId, Revision),
    /// A new revision does not fit.
    Refused(PlanRefusal),
    /// The own plan leads out of the fence, here: it is not taken.
    Outside(Point),
    /// A plan answers a state that is too old, or has a lower right than others: it is not taken.
    OldPlan(RunId, Revision),
    /// Something unknown is looked at.
    Looks(Point),
    /// Something keeps it from going on along its way.
    Blocked(Obstruction),
    /// A path around it was found; its length, metres.
    Path(f64),
    /// Nothing ahead can be reached over what is known, at least not now; searches in vain in a row.
    NoPath(u32),
    /// A stop that cannot be reached was given up.
    Skipped(StopId),
    /// All stops are done.
    Finished(RunId),
    /// A place of the mission was visited.
    Visited(Point),
    /// A place of the mission was passed over.
    Passed(Point),
    /// No way leads to a place of the mission, whatever is not seen yet: it is barred by these cells, by their middles, a few.
    NoWay(Point, Vec<Point>),
    /// Something that may bar its way and may not is looked at from near.
    LooksClosely(Point),
    /// What may bar the way to a place of the mission was looked at from near and bars still: these cells, a few; none when it
    /// cannot be looked at.
    StaysDoubtful(Point, Vec<Point>),
    /// The mission has ended.
    Ended(EndReason),
    /// These peers are in its way, none if it cannot say which: it waits for them to make room.
    WaitsForPeers(Vec<VehicleId>),
    /// Once it is at home these peers would not get where they go: it lets them go first.
    LetsFirst(Vec<VehicleId>),
    /// It makes room for peers that are in its way, here.
    StepsAside(Point),
    /// The vehicle is back home.
    Home,
    /// This vehicle is heard neither by bus nor by radio: an obstacle until it is.
    Silent(VehicleId),
    /// It is heard again.
    HeardAgain(VehicleId),
    /// It does not know its place well enough: it stands.
    PlaceLost,
    /// It knows its place again.
    PlaceFound,
    /// Nobody is heard at all: it stands.
    Alone,
    /// Somebody is heard again.
    NotAlone,
    /// Nobody was heard on the bus for as long as it may carry on by itself.
    BusLost,
    /// Somebody is heard on the bus again.
    BusBack,
    /// It does something that nobody has ordered.
    Decides(AutonomyCause, MissionStatus),
}

impl From<WayEvent> for MissionEvent {
    fn from(met: WayEvent) -> MissionEvent {
        match met {
            WayEvent::Stop(stop) => MissionEvent::Done(stop),
            WayEvent::Looks(at) => MissionEvent::Looks(at),
            WayEvent::Blocked(by) => MissionEvent::Blocked(by),
            WayEvent::Path(length_m) => MissionEvent::Path(length_m),
            WayEvent::NoPath(failures) => MissionEvent::NoPath(failures),
        }
    }
}

impl fmt::Display for MissionEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MissionEvent::Done(stop) => write!(f, "has done stop {stop}"),
            MissionEvent::Adopted(run, revision) => {
                write!(f, "follows run {run}, revision {revision}")
            }
            MissionEvent::Refused(why) => write!(f, "follows no plan: {why}"),
            MissionEvent::Outside(at) => write!(f, "follows no plan: it leaves the fence at {at}"),
            MissionEvent::OldPlan(run, revision) => write!(
                f,
                "does not follow run {run}, revision {revision}: it answers an old state, or others have a higher lease"
            ),
            MissionEvent::Looks(at) => write!(f, "looks at {at}"),
            MissionEvent::Blocked(by) => write!(f, "is blocked {}", by.in_words("by")),
            MissionEvent::Path(length_m) => write!(f, "has found a path of {length_m:.3} m"),
            MissionEvent::NoPath(tries) => write!(f, "has found no path, {tries} in a row"),
            MissionEvent::Skipped(stop) => write!(f, "gives up stop {stop}"),
            MissionEvent::Finished(run) => write!(f, "has done all stops of run {run}"),
            MissionEvent::Visited(at) => write!(f, "has visited {at}"),
            MissionEvent::Passed(at) => write!(f, "passes over {at}"),
            MissionEvent::NoWay(at, bars) => {
                write!(f, "has found no way to {at}: {}", barred_at(bars))
            }
            MissionEvent::LooksClosely(at) => write!(f, "looks closely at {at}"),
            MissionEvent::StaysDoubtful(at, bars) => {
                let why = match bars.is_empty() {
                    true => "what may bar it cannot be looked at from near".to_owned(),
                    false => barred_at(bars),
                };
                write!(f, "is not sure of a way to {at}: {why}")
            }
            MissionEvent::Ended(how) => write!(f, "has ended its mission: {how}"),
            MissionEvent::WaitsForPeers(peers) => {
                write!(f, "waits for {} to make room", peers_in_words(peers))
            }
            MissionEvent::LetsFirst(peers) => write!(f, "lets {} go first", peers_in_words(peers)),
            MissionEvent::StepsAside(to) => write!(f, "steps aside to {to} for its peers"),
            MissionEvent::Home => f.write_str("is home"),
            MissionEvent::Silent(peer) => {
                write!(f, "does not hear vehicle {peer}: an obstacle from now on")
            }
            MissionEvent::HeardAgain(peer) => write!(f, "hears vehicle {peer} again"),
            MissionEvent::PlaceLost => f.write_str("does not know its place, and stands"),
            MissionEvent::PlaceFound => f.write_str("knows its place again"),
            MissionEvent::Alone => f.write_str("hears nobody, and stands"),
            MissionEvent::NotAlone => f.write_str("hears somebody again"),
            MissionEvent::BusLost => f.write_str("has lost the bus"),
            MissionEvent::BusBack => f.write_str("has the bus again"),
            MissionEvent::Decides(cause, status) => write!(f, "{status} by itself: {cause}"),
        }
    }
}

/// Returns peers in words.
fn peers_in_words(peers: &[VehicleId]) -> String {
    let ids: Vec<String> = peers.iter().map(VehicleId::to_string).collect();
    match ids.as_slice() {
        [] => "its peers".to_owned(),
        [one] => format!("vehicle {one}"),
        [first @ .., last] => format!("vehicles {} and {last}", first.join(", ")),
    }
}

/// Returns in words where a way is barred.
fn barred_at(bars: &[Point]) -> String {
    let places: Vec<String> = bars.iter().map(Point::to_string).collect();
    match places.len() {
        0 => "it leaves the ground where it may drive".to_owned(),
        _ => format!("it is barred at {}", places.join(", ")),
    }
}

/// How a mission ended.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum EndReason {
    /// Everything was done.
    Done,
    /// It stopped in front of something.
    Stopped(Obstruction),
    /// No way leads to so many of its places: all that can be reached was searched. The others were visited.
    NoWay(usize),
    /// So many of its places were given up although a way may lead there, or its peers never made room.
    GaveUp(usize),
    /// It had no places, and its peers never made room for it to go on.
    NoRoom,
    /// It had no places, and its ground is too large to be searched.
    TooLarge,
    /// It did not know its place well enough, for too long: what it would have said of its places would not have been true.
    NoPlace,
    /// Its range sensors did not answer for too long.
    Blind,
    /// Nobody was heard on the bus for too long.
    BusLost,
    /// Its battery was low.
    BatteryLow,
    /// For too long it has neither come to a place of the mission nor seen anything new.
    Stalled,
    /// It saw no way on, and more than a quarter of the ground with room to stand that it might reach is unseen.
    ShutIn {
        /// How much of that ground nobody has seen and no known way leads to, percent.
        unseen_percent: u8,
    },
    /// It was never begun.
    Refused(MissionRefusal),
}

impl From<AutonomyCause> for EndReason {
    fn from(cause: AutonomyCause) -> EndReason {
        match cause {
            AutonomyCause::BusLost => EndReason::BusLost,
            AutonomyCause::BatteryLow | AutonomyCause::BatteryEmpty => EndReason::BatteryLow,
            AutonomyCause::Blind => EndReason::Blind,
        }
    }
}

impl fmt::Display for EndReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            EndReason::Done => f.write_str("did everything"),
            EndReason::Stopped(by) => write!(f, "stopped {}", by.in_words("in front of")),
            EndReason::NoWay(places) => {
                write!(f, "found that no way leads to {places} of its places")
            }
            EndReason::GaveUp(places) => write!(f, "gave up {places} of its places"),
            EndReason::NoRoom => f.write_str("gave up (its peers never made room)"),
            EndReason::TooLarge => f.write_str("gave up (its ground is too large to be searched)"),
            EndReason::NoPlace => f.write_str("gave up (it did not know its place for too long)"),
            EndReason::Blind => {
                f.write_str("gave up (its range sensors did not answer for too long)")
            }
            EndReason::BusLost => f.write_str("gave up (the bus was lost)"),
            EndReason::BatteryLow => f.write_str("gave up (its battery is low)"),
            EndReason::Stalled => f.write_str("gave up (for too long nothing new was seen)"),
            EndReason::ShutIn { unseen_percent } => write!(
                f,
                "gave up (it saw no way on: {unseen_percent} % of the ground that it might reach is unseen)"
            ),
            EndReason::Refused(why) => write!(f, "was refused: {why}"),
        }
    }
}

/// What a vehicle does, as a whole.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum MissionStatus {
    /// It waits for a start.
    Waiting,
    /// It follows its plan.
    Following,
    /// It stands and does not go on by itself.
    Held,
    /// It is on its way home, or waits for its turn.
    Returning,
    /// It came home.
    Home,
}

impl fmt::Display for MissionStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            MissionStatus::Waiting => "waits",
            MissionStatus::Following => "follows its plan",
            MissionStatus::Held => "holds",
            MissionStatus::Returning => "returns",
            MissionStatus::Home => "is home",
        })
    }
}

/// Which inputs replace unread ones.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Key {
    /// The own state.
    State,
    /// The state of one peer.
    Peer(VehicleId),
    /// A tile of a layer.
    Tile(LayerId, TileAddress),
    /// The plan of one vehicle.
    Plan(VehicleId),
    /// The task of one run.
    Task(RunId),
    /// The progress of one vehicle.
    Progress(VehicleId),
    /// The mission of one peer.
    PeerMission(VehicleId),
    /// The beacon of one peer.
    Sighted(VehicleId),
    /// Whom a ground station expects.
    Expected,
    /// That one node was heard.
    Heard(Sender),
    /// Of accepted orders the newest counts: it is what the vehicle obeys, and says that it does.
    Order,
    /// How it stands with the disk.
    Remembered,
}

/// Returns whether a vehicle was sent out, or home, and has not been told otherwise since.
fn is_out(state: &OwnState) -> bool {
    matches!(
        state.ordered.kind,
        Some(OrderKind::Start | OrderKind::Return)
    )
}

impl Input for In {
    type Key = Key;

    fn class(&self) -> InputClass<Key> {
        match self {
            In::State(_) => InputClass::Latest(Key::State),
            In::Peer(state) => InputClass::Latest(Key::Peer(state.vehicle)),
            In::Plan(plan) => InputClass::Latest(Key::Plan(plan.vehicle)),
            In::Task(task) => InputClass::Latest(Key::Task(task.run)),
            In::Tile(tile) => InputClass::Latest(Key::Tile(tile.report.layer, tile.report.address)),
            In::Progress(progress) => InputClass::Latest(Key::Progress(progress.vehicle)),
            In::PeerMission(mission) => InputClass::Latest(Key::PeerMission(mission.vehicle)),
            In::Sighted(sighting) => InputClass::Latest(Key::Sighted(sighting.progress.vehicle)),
            In::Expected(_) => InputClass::Latest(Key::Expected),
            In::Heard(by) => InputClass::Latest(Key::Heard(*by)),
            In::Order(_) => InputClass::Latest(Key::Order),
            In::Remembered(_) => InputClass::Latest(Key::Remembered),
            In::SafetyEvent(_) | In::Stops(_) => InputClass::Queue,
        }
    }

    /// What peers repeat all the time is read a few at a time.
    fn may_wait(&self) -> bool {
        match self {
            In::Peer(_) | In::PeerMission(_) | In::Sighted(_) | In::Heard(_) => true,
            // A vehicle that is out acts on what its state says.
            In::State(state) => state.is_at_rest && !is_out(state),
            In::Plan(_)
            | In::Task(_)
            | In::Tile(_)
            | In::Progress(_)
            | In::Expected(_)
            | In::Order(_)
            | In::Remembered(_)
            | In::SafetyEvent(_)
            | In::Stops(_) => false,
        }
    }

    fn join(unread: In, newer: In) -> In {
        let edition = |plan: &Plan| (plan.lease, plan.run, plan.revision);
        let rank = |order: &Order| (order.lease, order.revision);
        let step = |progress: &VehicleProgress| {
            (
                progress.boot,
                progress.run,
                progress.revision,
                progress.done,
                progress.leg,
            )
        };
        match (unread, newer) {
            (In::Plan(unread), In::Plan(newer)) if edition(&unread) > edition(&newer) => {
                In::Plan(unread)
            }
            (In::Task(unread), In::Task(newer)) if unread.lease > newer.lease => In::Task(unread),
            // Tiles and progress may overtake each other: the higher revision stays.
            (In::Tile(unread), In::Tile(newer))
                if unread.report.revision > newer.report.revision =>
            {
                In::Tile(unread)
            }
            (In::Progress(unread), In::Progress(newer)) if step(&unread) > step(&newer) => {
                In::Progress(unread)
            }
            (In::Peer(unread), In::Peer(newer)) => In::Peer(join_states(unread, newer)),
            (In::Order(unread), In::Order(newer)) if rank(&unread) > rank(&newer) => {
                In::Order(unread)
            }
            (_, newer) => newer,
        }
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::Ordered;

    use super::*;
    use crate::node::tests_support::own_state;

    #[test]
    fn a_place_that_stays_doubtful_is_barred_at_no_ground_that_was_not_looked_at() {
        let check = |bars: Vec<Point>, expected: &str| {
            let words = MissionEvent::StaysDoubtful(Point::new(4.6, 5.0), bars).to_string();
            let start = "is not sure of a way to [4.600, 5.000]: ";
            assert_eq!(words, format!("{start}{expected}"));
        };
        check(vec![Point::new(2.1, 4.7)], "it is barred at [2.100, 4.700]");
        check(Vec::new(), "what may bar it cannot be looked at from near");
    }

    #[test]
    fn the_state_of_a_vehicle_may_wait_while_it_rests_and_is_not_out() {
        let of = |is_at_rest, kind| {
            In::State(OwnState {
                is_at_rest,
                ordered: Ordered {
                    kind,
                    ..Ordered::default()
                },
                ..own_state(0.0, 0.0)
            })
        };
        for kind in [None, Some(OrderKind::Hold), Some(OrderKind::Land)] {
            assert!(of(true, kind).may_wait() && !of(false, kind).may_wait());
        }
        for kind in [OrderKind::Start, OrderKind::Return] {
            assert!(!of(true, Some(kind)).may_wait() && !of(false, Some(kind)).may_wait());
        }
    }

    #[test]
    fn whom_it_waits_for_is_said_by_name_where_that_is_known() {
        let ids = |ids: &[u8]| ids.iter().copied().map(VehicleId).collect::<Vec<_>>();
        let waits = |peers: &[u8]| MissionEvent::WaitsForPeers(ids(peers)).to_string();
        assert_eq!(waits(&[]), "waits for its peers to make room");
        assert_eq!(waits(&[3]), "waits for vehicle 3 to make room");
        assert_eq!(
            waits(&[1, 3, 12]),
            "waits for vehicles 1, 3 and 12 to make room"
        );
        let first = MissionEvent::LetsFirst(ids(&[2, 4])).to_string();
        assert_eq!(first, "lets vehicles 2 and 4 go first");
    }
}
