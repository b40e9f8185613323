//! The station actor: keeps the fleet table, the merged map and the samples, and brings one sweep after
//! another from a wish to its links.
//!
//! It is told messages of the vehicles, wishes of the operator, and plans; it says plans, orders, watermarks and
//! map repairs for the bus, requests for the planner, jobs for the imager, and notes. It solves nothing and plans
//! nothing itself.
//!
//! ```text
//!   Idle ─Sweep wished, all heard─► Stopping ─all at rest─► Planning ─plans─► Running ─every stop done─► Closing
//!    ▲                                 ▲                                         │                       │
//!    │                                 └─ a vehicle cannot begin, or nobody gets on┘                    │
//!    └────────────────────────────────────────────── samples in ─────────────────────────────────────────┘
//! ```
//!
//! An order of the operator other than Start *stands* until the operator's next Start: meanwhile whatever the
//! phase, nothing is begun, planned or timed, and no Start is given.
//!
//! Deadline: `repeat` (state is published and repeated, nobody asks and waits).

mod phases;

use std::time::Duration;

use tomoswarm_proto::{
    LayerId, Lease, Message, OrderKind, Plan, RunId, Samples, StopId, TileAddress, TileReport, VehicleId,
    Want,
};

use super::fleet::Fleet;
use super::imager::Job;
use super::planner::{Answer, Request};
use super::samples::SampleStore;
use crate::actor::{Actor, Class, Fault, Input};
use crate::geom::Lattice;
use crate::map::Merged;
use crate::sweep::Succession;
use crate::time::{Deadline, Time};

/// Everything is looked at and repeated this often.
const TICK: Duration = Duration::from_secs(1);
/// Wants sent for one digest.
const WANTS: usize = 64;
/// Tiles sent for one want.
const REPAIR_TILES: usize = 16;

/// What an operator wants.
#[derive(Clone, PartialEq, Debug)]
pub enum Wish {
    /// Sweep the area.
    Sweep {
        /// Name of the run.
        run: RunId,
        /// The run whose links were measured with nobody inside.
        empty: Option<RunId>,
    },
    /// Give every vehicle an order.
    Order(OrderKind),
}

/// What the station can be told.
#[derive(Clone, PartialEq, Debug)]
pub enum In {
    /// A message of a vehicle.
    Bus(Message),
    /// A wish of the operator.
    Wish(Wish),
    /// Plans, or why there are none.
    Planned(Answer),
}

/// What the station can say.
#[derive(Clone, PartialEq, Debug)]
pub enum Out {
    /// To the vehicles.
    Publish(Message),
    /// To the planner.
    Ask(Request),
    /// To the imager.
    Reconstruct(Job),
    /// To log and operator.
    Note(Note),
}

/// What happened, for log and operator.
#[derive(Clone, PartialEq, Debug)]
pub enum Note {
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

/// Who the station is, and for whom it is there.
#[derive(Clone, Debug)]
pub struct StationSettings {
    /// The vehicles that it waits for.
    pub vehicles: Vec<VehicleId>,
    /// By which right it gives orders.
    pub lease: Lease,
    /// Id of the sample store.
    pub store: u64,
    /// The cells of the map.
    pub lattice: Lattice,
    /// Side of a link's end bins, metres.
    pub bin_m: f64,
    /// Side of what counts as one spot, metres.
    pub spot_m: f64,
}

#[derive(Clone, Debug)]
enum Phase {
    Idle,
    Planning(Sweep),
    Running(Sweep, Laps),
    /// Everyone is brought to rest, to be planned for anew.
    Stopping(Sweep),
    Closing {
        sweep: Sweep,
        since: Time,
    },
}

/// Per lap still to be driven, the last stop of each vehicle.
type Laps = Vec<Vec<(VehicleId, StopId)>>;

#[derive(Clone, Copy, Debug)]
struct Sweep {
    run: RunId,
    empty: Option<RunId>,
    /// Laps done before the present plans were made.
    laps_before: usize,
    laps_done: usize,
}

/// The station actor.
#[derive(Debug)]
pub struct Station {
    fleet: Fleet,
    map: Merged,
    samples: SampleStore,
    phase: Phase,
    succession: Option<Succession>,
    wished: Option<Wish>,
    /// What the operator has ordered and not ended by a Start; the strongest of several.
    standing: Option<OrderKind>,
    planned_at: Time,
    /// When a vehicle was last heard to have got on with its plan.
    got_on_at: Time,
    /// Whether plans were made anew because nobody got on, since a lap was done.
    stalled: bool,
    plans_at: Time,
    tick_at: Time,
}

impl Station {
    /// Makes a station that has heard nobody yet.
    pub fn new(settings: StationSettings) -> Station {
        Station {
            fleet: Fleet::new(&settings.vehicles, settings.lease),
            map: Merged::new(settings.lattice, None),
            samples: SampleStore::new(settings.store, settings.bin_m, settings.spot_m),
            phase: Phase::Idle,
            succession: None,
            wished: None,
            standing: None,
            planned_at: Time::ZERO,
            got_on_at: Time::ZERO,
            stalled: false,
            plans_at: Time::ZERO,
            tick_at: Time::ZERO + TICK,
        }
    }

    /// Gives the fleet table.
    pub fn fleet(&self) -> &Fleet {
        &self.fleet
    }

    /// Gives the merged map.
    pub fn map(&self) -> &Merged {
        &self.map
    }

    /// Gives the stored samples.
    pub fn samples(&self) -> &SampleStore {
        &self.samples
    }

    fn hear(&mut self, now: Time, message: Message, out: &mut Vec<Out>) {
        match message {
            Message::State(state) => self.fleet.heard_state(now, state),
            Message::Progress(progress) => {
                if let Some(succession) = &mut self.succession {
                    succession.hear(&progress);
                }
                if self.fleet.heard_progress(progress) {
                    self.got_on_at = now;
                }
            }
            Message::Samples(batch) => self.store(&batch),
            Message::Tile(report) => self.join(&report),
            Message::Digest(digest) => {
                let wants = self.map.want(&digest).into_iter().take(WANTS);
                out.extend(wants.map(|want| Out::Publish(Message::Want(want))));
            }
            Message::Want(want) => self.repair(&want, out),
            // Said by the ground itself, or the bus's and the radio's business.
            Message::Plan(_)
            | Message::Order(_)
            | Message::Have(_)
            | Message::Hello(_)
            | Message::Health(_)
            | Message::Report(_)
            | Message::Beacon(_) => {}
        }
    }

    fn store(&mut self, batch: &Samples) {
        self.samples.take(batch);
    }

    fn join(&mut self, report: &TileReport) {
        // A tile that cannot be joined changes nothing; its sender keeps it, and repeats it.
        let _ = self.map.join(report);
    }

    fn repair(&self, want: &Want, out: &mut Vec<Out>) {
        let tiles = self.map.answer(want, REPAIR_TILES);
        out.extend(tiles.into_iter().map(|report| Out::Publish(Message::Tile(report))));
    }

    fn wish(&mut self, now: Time, wish: Wish, out: &mut Vec<Out>) {
        match wish {
            Wish::Order(kind) => {
                let run = self.run();
                self.fleet.order_all(run, kind);
                self.publish_orders(out);
                match kind {
                    OrderKind::Start => self.go_on(now, out),
                    OrderKind::Hold
                    | OrderKind::Return
                    | OrderKind::Land
                    | OrderKind::Emergency
                    | OrderKind::CutMotors => {
                        self.standing = self.standing.max(Some(kind));
                    }
                }
            }
            Wish::Sweep { .. } => {
                self.wished = Some(wish);
                self.begin(now, out);
            }
        }
    }

    fn run(&self) -> RunId {
        match &self.phase {
            Phase::Idle => RunId::default(),
            Phase::Planning(sweep)
            | Phase::Running(sweep, _)
            | Phase::Stopping(sweep)
            | Phase::Closing { sweep, .. } => sweep.run,
        }
    }

    fn publish_plans(&mut self, now: Time, out: &mut Vec<Out>) {
        let plans = self.succession.iter().flat_map(Succession::plans);
        let stamped = |plan: &Plan| {
            let (lease, seen_state) = (self.fleet.lease(), self.fleet.seen_state(plan.vehicle));
            Out::Publish(Message::Plan(Plan { lease, seen_state, ..plan.clone() }))
        };
        out.extend(plans.map(stamped));
        self.plans_at = now;
    }

    fn publish_orders(&self, out: &mut Vec<Out>) {
        out.extend(self.fleet.open_orders().into_iter().map(|order| Out::Publish(Message::Order(order))));
    }

    fn tick(&mut self, now: Time, out: &mut Vec<Out>) {
        self.begin(now, out);
        self.publish_orders(out);
        out.push(Out::Publish(Message::Have(self.samples.have())));
        out.push(Out::Publish(Message::Digest(self.map.digest())));
        self.look_after_plans(now, out);
        self.look_after_laps(now, out);
        self.close(now, out);
    }
}

impl Actor for Station {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        match input {
            In::Bus(message) => self.hear(now, message, out),
            In::Wish(wish) => self.wish(now, wish, out),
            In::Planned(answer) => self.planned(now, answer, out),
        }
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        Some(Deadline { at: self.tick_at, why: "repeat" })
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        self.tick_at = now + TICK;
        self.tick(now, out);
        Ok(())
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
}

impl Input for In {
    type Key = Key;

    fn class(&self) -> Class<Key> {
        match self {
            In::Bus(Message::State(state)) => Class::Latest(Key::State(state.vehicle)),
            In::Bus(Message::Progress(progress)) => Class::Latest(Key::Progress(progress.vehicle)),
            In::Bus(Message::Tile(report)) => Class::Latest(Key::Tile(report.layer, report.address)),
            In::Bus(_) | In::Wish(_) | In::Planned(_) => Class::Queue,
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

#[cfg(test)]
mod tests;
