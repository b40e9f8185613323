//! What the station is told and says, and who it is: messages, which of them count from whom, and which are said without the
//! lease. What follows from a message is decided elsewhere.

use std::fmt;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    Boot, EmergencyStop, LayerId, Lease, Message, RunId, TileAddress, VehicleId,
};

use super::super::fleet::FleetChange;
use super::super::imager::Job;
use super::super::planner::{PlannerAnswer, Request};
use super::lost_vehicles::SilenceLimits;
use super::memory::StationMemory;
use super::pictures::PictureName;
use crate::actor::{Input, InputClass};
use crate::config::ImageTimes;
use crate::geom::Lattice;

/// What the station can be told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum In {
    /// A message of a vehicle, an operator, or another ground.
    Bus(Message),
    /// Plans, or why there are none.
    Planned(PlannerAnswer),
    /// A picture that was asked for is done with.
    Pictured {
        /// Which one.
        name: PictureName,
        /// Whether it was made; `false` = it cannot be.
        is_made: bool,
    },
    /// Which emergency stops are open.
    Stops(Vec<EmergencyStop>),
    /// Samples can be stored, or cannot. Said with every group of them.
    StoresSamples(bool),
    /// What is wrong with the process, in words.
    Troubles(Vec<String>),
}

/// What the station can say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Out {
    /// To the vehicles.
    Publish(Message),
    /// To the planner.
    Ask(Request),
    /// To the imager.
    Reconstruct(Job),
    /// To log and operator.
    StationEvent(StationEvent),
    /// A run is planned for: it begins, or goes on with new plans.
    BeginRun {
        /// Which run.
        run: RunId,
        /// The run that it is compared with.
        compared_with: Option<RunId>,
    },
    /// A run is closed: everything is done, and all its samples are in.
    EndRun(RunId),
    /// To be stored before anything that follows is published: what a station that is started anew needs.
    Remember(Box<StationMemory>),
}

impl Out {
    /// Returns whether it is said without the lease all the same: the report, and what is remembered and noted.
    pub(super) fn is_said_without_lease(&self) -> bool {
        match self {
            Out::Publish(message) => matches!(message, Message::Report(_)),
            Out::Ask(_) | Out::Reconstruct(_) => false,
            Out::StationEvent(_) | Out::BeginRun { .. } | Out::EndRun(_) | Out::Remember(_) => true,
        }
    }
}

/// Returns the vehicle that says a message, if that counts only from one that is expected; `None` = it counts from any.
pub(super) fn expected_author(message: &Message) -> Option<VehicleId> {
    match message {
        Message::State(state) => Some(state.vehicle),
        Message::Mission(mission) => Some(mission.vehicle),
        Message::Samples(batch) => Some(batch.vehicle),
        Message::Tile(_)
        | Message::Digest(_)
        | Message::Want(_)
        | Message::Report(_)
        | Message::Plan(_)
        | Message::Hello(_)
        | Message::Task(_)
        | Message::Order(_)
        | Message::Have(_)
        | Message::Health(_)
        | Message::Beacon(_)
        | Message::Standing(_)
        | Message::Image(_)
        | Message::Fix(_)
        | Message::Mark(_)
        | Message::Look(_)
        | Message::Log(_)
        | Message::Settings(_) => None,
    }
}

/// Returns the note that a vehicle is lost.
pub(super) fn note_lost(vehicle: VehicleId) -> Out {
    Out::StationEvent(StationEvent::Lost(vehicle))
}

/// Returns what is worth noting of what a vehicle has shown.
pub(super) fn notes_of(vehicle: VehicleId, shown: FleetChange) -> impl Iterator<Item = Out> {
    let found = shown.found.then_some(StationEvent::Found(vehicle));
    let drops_out = shown.drops_out.map(|is_out| match is_out {
        true => StationEvent::DroppedOut(vehicle),
        false => StationEvent::IsBack(vehicle),
    });
    let restarted = shown.restarted.then_some(StationEvent::Restarted(vehicle));
    let all = found.into_iter().chain(restarted).chain(drops_out);
    all.map(Out::StationEvent)
}

/// What happened, for log and operator.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum StationEvent {
    /// Plans were made.
    Planned {
        /// Of which run.
        run: RunId,
        /// Laps of the schedule.
        laps: usize,
        /// Stops of all vehicles.
        stops: usize,
    },
    /// No plan could be made.
    NoPlan(String),
    /// A vehicle did not begin its plan, or nobody gets on: everyone is brought to rest and planned for anew.
    Replans(RunId),
    /// Too few vehicles are left for the sweep: it goes on when one is back.
    Waits(RunId),
    /// A vehicle has been silent for too long while others were heard.
    Lost(VehicleId),
    /// A lost vehicle is heard again.
    Found(VehicleId),
    /// A vehicle does not go on by itself: its battery is low, its range sensors do not answer, or it has not known its
    /// place for long.
    DroppedOut(VehicleId),
    /// A vehicle that did not go on by itself may again.
    IsBack(VehicleId),
    /// A vehicle's software was started anew.
    Restarted(VehicleId),
    /// Orders and plans are given by this right from now on.
    Leads(Lease),
    /// Another ground gives the orders, by this right.
    StandsBy(Lease),
    /// Vehicles follow plans of a higher run, by another ground: the sweep is given up.
    Overtaken(RunId),
    /// An operator has begun a later run: the sweep under way is given up.
    MadeWay {
        /// The run that is given up.
        run: RunId,
        /// The one that was begun.
        next: RunId,
    },
    /// Nobody gets on, also after plans were made anew: the sweep cannot be ended.
    Stalled(RunId),
    /// All vehicles have done a lap.
    LapDone {
        /// Of which run.
        run: RunId,
        /// Laps done.
        laps: usize,
        /// Links measured so far.
        links: usize,
        /// Samples stored so far.
        samples: u64,
    },
    /// All vehicles have done all stops and the samples are in.
    RunClosed {
        /// Which run.
        run: RunId,
        /// Links measured.
        links: usize,
        /// Samples stored.
        samples: u64,
    },
}

impl fmt::Display for StationEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StationEvent::Planned { run, laps, stops } => {
                write!(f, "has planned run {run}: {laps} laps, {stops} stops")
            }
            StationEvent::NoPlan(why) => write!(f, "has no plan: {why}"),
            StationEvent::Replans(run) => write!(f, "plans run {run} anew"),
            StationEvent::Waits(run) => {
                write!(f, "waits with run {run}: too few vehicles are left")
            }
            StationEvent::Lost(vehicle) => write!(f, "has lost vehicle {vehicle}"),
            StationEvent::Found(vehicle) => write!(f, "hears vehicle {vehicle} again"),
            StationEvent::DroppedOut(vehicle) => {
                write!(f, "sees that vehicle {vehicle} is out of service")
            }
            StationEvent::IsBack(vehicle) => {
                write!(f, "sees that vehicle {vehicle} is in service again")
            }
            StationEvent::Restarted(vehicle) => {
                write!(f, "sees that vehicle {vehicle} was started anew")
            }
            StationEvent::Leads(lease) => write!(f, "leads by lease {}", lease.number),
            StationEvent::StandsBy(lease) => {
                write!(f, "stands by: another holds lease {}", lease.number)
            }
            StationEvent::Overtaken(run) => {
                write!(
                    f,
                    "gives up its sweep: vehicles follow run {run} of another"
                )
            }
            StationEvent::MadeWay { run, next } => {
                write!(f, "gives up run {run}: run {next} was begun in its place")
            }
            StationEvent::Stalled(run) => write!(f, "cannot end run {run}: nobody gets on"),
            StationEvent::LapDone {
                run,
                laps,
                links,
                samples,
            } => write!(
                f,
                "sees lap {laps} of run {run} done: {links} links, {samples} samples"
            ),
            StationEvent::RunClosed {
                run,
                links,
                samples,
            } => write!(f, "closes run {run}: {links} links, {samples} samples"),
        }
    }
}

/// Who the station is, and for whom it is there.
#[derive(Clone, Debug)]
pub struct StationSettings {
    /// The vehicles that it waits for; others are passed over.
    pub vehicles: Vec<VehicleId>,
    /// By which right it gives orders from the start; `None` = it listens first, and takes one above the highest heard.
    pub lease: Option<Lease>,
    /// Its random id as the holder of a lease.
    pub holder: u64,
    /// Whether a live ground that holds a lease is displaced.
    pub take_over: bool,
    /// Start of its software.
    pub boot: Boot,
    /// The run measured with nobody inside, with which runs begun by an operator's order are compared.
    pub compare_with: Option<RunId>,
    /// A vehicle is lost when it has been silent for this long while others were heard.
    pub lost_after: Duration,
    /// A vehicle without a bus carries on under its plan for this long.
    pub autonomy: Duration,
    /// The length of the fence, metres.
    pub fence_m: f64,
    /// Id of the sample store.
    pub store: u64,
    /// The cells of the map.
    pub lattice: Lattice,
    /// When images are made.
    pub image_times: ImageTimes,
    /// Side of a link's end bins, metres.
    pub bin_m: f64,
    /// Side of what counts as one spot, metres.
    pub spot_m: f64,
}

/// What a station is made with, and never changes.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct StationConstants {
    pub boot: Boot,
    /// The run with which runs are compared that have no task.
    pub compare_with: Option<RunId>,
    pub silence: SilenceLimits,
    pub image_times: ImageTimes,
    /// The length of the fence, metres.
    pub fence_m: f64,
}

impl StationConstants {
    pub(super) fn of(settings: &StationSettings) -> StationConstants {
        StationConstants {
            boot: settings.boot,
            compare_with: settings.compare_with,
            silence: SilenceLimits::new(settings.lost_after, settings.autonomy),
            image_times: settings.image_times,
            fence_m: settings.fence_m,
        }
    }
}

/// Which inputs replace unread ones.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Key {
    /// The state of one vehicle.
    State(VehicleId),
    /// The progress of one vehicle.
    Progress(VehicleId),
    /// A tile of a layer.
    Tile(LayerId, TileAddress),
    /// Plans.
    Planned,
    /// That a picture is done with.
    Pictured(PictureName),
    /// Whether samples can be stored.
    StoresSamples,
    /// What is wrong with the process.
    Troubles,
}

impl Input for In {
    type Key = Key;

    fn class(&self) -> InputClass<Key> {
        match self {
            In::Bus(Message::State(state)) => InputClass::Latest(Key::State(state.vehicle)),
            In::Bus(Message::Mission(mission)) => {
                InputClass::Latest(Key::Progress(mission.vehicle))
            }
            In::Bus(Message::Tile(report)) => {
                InputClass::Latest(Key::Tile(report.layer, report.address))
            }
            In::Planned(_) => InputClass::Latest(Key::Planned),
            In::Pictured { name, .. } => InputClass::Latest(Key::Pictured(*name)),
            In::StoresSamples(_) => InputClass::Latest(Key::StoresSamples),
            In::Troubles(_) => InputClass::Latest(Key::Troubles),
            In::Bus(_) | In::Stops(_) => InputClass::Queue,
        }
    }

    fn join(unread: In, newer: In) -> In {
        match (unread, newer) {
            (In::Bus(Message::State(unread)), In::Bus(Message::State(newer)))
                if (unread.boot, unread.sequence) > (newer.boot, newer.sequence) =>
            {
                In::Bus(Message::State(unread))
            }
            // Tiles may overtake each other: the higher revision stays.
            (In::Bus(Message::Tile(unread)), In::Bus(Message::Tile(newer)))
                if unread.revision > newer.revision =>
            {
                In::Bus(Message::Tile(unread))
            }
            (_, newer) => newer,
        }
    }
}
