//! The newest of everything that is shown: the fleet, the merged map, plans, images, who hears whom, the ground station, where
//! somebody truly stands, what happened, how orders fared. It is told what came over the bus and says what has changed; of the
//! map it asks for what it lacks, as every map does.
//!
//! It knows no page and no bytes. What is shown of a subject is made when it is sent, so a page never gets what is old.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    EmergencyName, Image, ImageSubject, Message, Plan, Sender, TILE_CELLS, TileAddress, VehicleId,
};

use super::cell_view::TileChanges;
use super::events::{EventKind, EventList};
use super::gate::PageId;
use super::look_view::LookView;
use super::marks::{MarkBook, MarkOrder, in_metres};
use super::newest_image::NewestImage;
use super::orders::{OrderBook, OrderRequest};
use super::radio::{Pair, RadioView};
use super::shown_cells::shown_cells;
use super::texts::{corners_ahead, outcome_in_words, shown_of_health, shown_of_mission};
use super::timetable::{ProgressOf, Timetable};
use super::track::Track;
use crate::geom::Lattice;
use crate::map::{JoinResult, Merged, Repair};
use crate::operator::HeardMessage;
use crate::operator::fleet_view::FleetView;
use crate::operator::given_marks::MarkOutcome;
use crate::operator::outcome::OrderOutcome;
use crate::sweep::VehicleProgress;
use crate::time::Time;

/// What the rest of a board takes, about: states, samples.
const OTHER_BYTES: usize = 64 << 10;
/// An image that was not said again for this long gives way to one that seems to be older: the ground has begun anew.
const IMAGE_STANDS: Duration = Duration::from_secs(60);

/// Something that a board is told. Two boards that were told the same at the same times are the same.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum BoardInput {
    /// What came over the bus.
    Heard(HeardMessage),
    /// Whether anyone can be reached.
    Linked(bool),
    /// A page has given an order; it gets the next number.
    Ordered(OrderRequest),
    /// What became of an order, by its number.
    Ended(u32, OrderOutcome),
    /// Which page has the seat.
    Seat(Option<PageId>),
    /// A page has asked for a mark; it gets the next number of marks.
    MarkGiven(MarkOrder),
    /// What became of a mark that a page has asked for, by its number.
    MarkEnded(u32, MarkOutcome),
}

/// Something that a page shows; the lower goes first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Subject {
    /// Open stops, orders and how they fared, the seat.
    Orders,
    /// Where a vehicle is.
    State(VehicleId),
    /// The ground station.
    Ground,
    /// How a vehicle fares.
    Vehicle(VehicleId),
    /// The way that a vehicle is committed to.
    Way(VehicleId),
    /// The plan of a vehicle.
    Plan(VehicleId),
    /// The plans against time.
    Timetable,
    /// How far vehicles are in it, and who waits for whom.
    Progress,
    /// Where somebody truly stands.
    Marks,
    /// What happened.
    Events,
    /// Which moment is shown, of which span; of no board.
    Moment,
    /// What of the span is worth a mark; of no board.
    Markers,
    /// How one vehicle hears another one.
    Radio(Pair),
    /// What was found.
    Finds(ImageSubject),
    /// Where a vehicle has been: sent once, since a page goes on with it by itself.
    Track(VehicleId),
    /// What the range sensors of a vehicle heard of late: for pages that ride with it.
    Look(VehicleId),
    /// A tile of the merged map.
    Tile(TileAddress),
    /// A part of an image.
    Stripe(ImageSubject, u16),
}

/// What is shown of all plans together.
const OF_PLANS: [Subject; 2] = [Subject::Timetable, Subject::Progress];

/// The newest of everything.
#[derive(Clone, Debug)]
pub struct Board {
    venue_hash: u64,
    view: FleetView,
    map: Merged,
    tile_changes: TileChanges,
    repair: Repair,
    /// Long: copies of the board share them.
    plans: BTreeMap<VehicleId, Arc<Plan>>,
    tracks: BTreeMap<VehicleId, Track>,
    looks: BTreeMap<VehicleId, LookView>,
    /// Made when it is asked for, of the plans as they are.
    timetable: OnceCell<Option<Arc<Timetable>>>,
    radio: RadioView,
    events: EventList,
    images: BTreeMap<ImageSubject, NewestImage>,
    orders: OrderBook,
    marks: MarkBook,
    is_linked: bool,
    changes: BTreeSet<Subject>,
}

impl Board {
    /// Makes an empty board of a place: the hash of its file, and the lattice of its map.
    pub fn new(venue_hash: u64, lattice: Lattice) -> Board {
        Board {
            venue_hash,
            view: FleetView::default(),
            map: Merged::new(lattice, None),
            tile_changes: TileChanges::default(),
            repair: Repair::new(None),
            plans: BTreeMap::new(),
            tracks: BTreeMap::new(),
            looks: BTreeMap::new(),
            timetable: OnceCell::new(),
            radio: RadioView::default(),
            events: EventList::default(),
            images: BTreeMap::new(),
            orders: OrderBook::default(),
            marks: MarkBook::default(),
            is_linked: false,
            changes: BTreeSet::new(),
        }
    }

    /// Takes what it is told.
    pub fn take(&mut self, now: Time, input: &BoardInput) {
        match input {
            BoardInput::Heard(heard) => self.hear(now, heard),
            BoardInput::Linked(is_linked) => {
                self.is_linked = *is_linked;
                self.changes.insert(Subject::Orders);
            }
            BoardInput::Ordered(request) => self.enter(now, request),
            BoardInput::Ended(number, outcome) => {
                self.orders.given.end(*number, outcome.clone());
                self.changes.insert(Subject::Orders);
                let vehicles = outcome.vehicles.keys().copied().collect();
                let text = format!("order {number}: {}", outcome_in_words(outcome));
                self.add_event(now, EventKind::Order, vehicles, text);
            }
            BoardInput::Seat(page) => {
                self.orders.seat = *page;
                self.changes.insert(Subject::Orders);
            }
            BoardInput::MarkGiven(order) => {
                let number = self.marks.given.enter(now, order.clone());
                let what = if order.take_back { "take back" } else { "mark" };
                let (place, page) = (in_metres(order.place()), order.page);
                self.mark_event(
                    now,
                    format!("mark {number}: {what} {place}, by page {page}"),
                );
            }
            BoardInput::MarkEnded(number, outcome) => {
                self.marks.given.end(*number, outcome.clone());
                self.mark_event(now, format!("mark {number}: {outcome}"));
            }
        }
    }

    /// Shows that the marks have changed, with a line of what happened.
    fn mark_event(&mut self, now: Time, text: String) {
        self.changes.insert(Subject::Marks);
        self.add_event(now, EventKind::Mark, Vec::new(), text);
    }

    fn enter(&mut self, now: Time, request: &OrderRequest) {
        let number = self.orders.given.enter(now, request.clone());
        self.changes.insert(Subject::Orders);
        let whom = request.targets().into_iter().collect();
        let (word, page) = (request.order.word(), request.page);
        let mission = request.mission.as_ref();
        let mission = mission.map_or(String::new(), |said| format!(" {}", said.kind));
        let text = format!("order {number}: {word}{mission}, by page {page}");
        self.add_event(now, EventKind::Order, whom, text);
    }

    fn hear(&mut self, now: Time, heard: &HeardMessage) {
        let is_state = matches!(heard, HeardMessage::Message(_, Message::State(_)));
        if is_state && self.view.is_news(heard) {
            self.changes.insert(Subject::Orders);
        }
        let (sender, message) = match heard {
            HeardMessage::Message(sender, message) => (*sender, message),
            HeardMessage::Greeting(greeting, _) => {
                self.view.hear(now, heard);
                if let Sender::Vehicle(id) = greeting.node {
                    self.changes.insert(Subject::Vehicle(id));
                }
                return;
            }
            HeardMessage::Unknown(_) => return,
        };
        // Whoever has another venue file has another map, too.
        let is_ours = self.view.misfit(sender, self.venue_hash).is_none();
        self.mark_vehicle(message);
        let last = self.events.last();
        self.events.hear(now, message, &self.view);
        if self.events.last() != last {
            self.changes.insert(Subject::Events);
        }
        let before = (self.shown_stops(sender), self.view.lease(now));
        self.view.hear(now, heard);
        if (self.shown_stops(sender), self.view.lease(now)) != before {
            self.changes.insert(Subject::Orders);
        }
        if is_ours {
            self.keep(now, sender, message);
        }
    }

    /// Returns whether anyone can be reached.
    pub fn is_linked(&self) -> bool {
        self.is_linked
    }

    /// Returns the orders and how they fared.
    pub fn orders(&self) -> &OrderBook {
        &self.orders
    }

    /// Returns where somebody truly stands.
    pub fn marks(&self) -> &MarkBook {
        &self.marks
    }

    /// Returns what is known of the fleet.
    pub fn view(&self) -> &FleetView {
        &self.view
    }

    /// Returns the hash of the place's file.
    pub fn venue_hash(&self) -> u64 {
        self.venue_hash
    }

    /// Returns the plan of a vehicle.
    pub fn plan(&self, id: VehicleId) -> Option<&Plan> {
        self.plans.get(&id).map(Arc::as_ref)
    }

    /// Returns the plans that were heard last.
    pub(super) fn plans(&self) -> impl Iterator<Item = &Plan> {
        self.plans.values().map(Arc::as_ref)
    }

    /// Returns a copy with other plans, in which nothing has changed.
    pub(super) fn with_plans(&self, plans: Vec<Plan>) -> Board {
        let plans = plans.into_iter().map(|plan| (plan.vehicle, Arc::new(plan)));
        let mut copy = self.clone();
        (copy.plans, copy.timetable) = (plans.collect(), OnceCell::new());
        copy.changes.clear();
        copy
    }

    /// Returns where a vehicle has been.
    pub fn track(&self, id: VehicleId) -> Option<&Track> {
        self.tracks.get(&id)
    }

    /// Returns what the range sensors of a vehicle heard of late.
    pub fn look(&self, id: VehicleId) -> Option<&LookView> {
        self.looks.get(&id)
    }

    /// Returns the plans of the newest revision against time; `None` while they are not complete.
    pub fn timetable(&self) -> Option<&Timetable> {
        let made = self
            .timetable
            .get_or_init(|| Timetable::of(&self.plans).map(Arc::new));
        made.as_deref()
    }

    /// Returns how far vehicles are with their plans, by their own word.
    pub fn progress(&self) -> ProgressOf {
        let said = |(id, mission): (VehicleId, &tomoswarm_proto::MissionProgress)| {
            (id, VehicleProgress::from(mission))
        };
        let missions = self.view.vehicles();
        let missions = missions.filter_map(|(id, seen)| Some((id, &seen.mission.as_ref()?.value)));
        missions.map(said).collect()
    }

    /// Returns who hears whom.
    pub fn radio(&self) -> &RadioView {
        &self.radio
    }

    /// Returns what happened.
    pub fn events(&self) -> &EventList {
        &self.events
    }

    /// Adds to what happened: something of some vehicles, or of all.
    fn add_event(&mut self, now: Time, kind: EventKind, vehicles: Vec<VehicleId>, text: String) {
        self.events.add(now, kind, vehicles, text);
        self.changes.insert(Subject::Events);
    }

    /// Returns the newest image of a kind.
    pub fn image(&self, subject: ImageSubject) -> Option<&NewestImage> {
        self.images.get(&subject)
    }

    /// Returns the merged map.
    pub fn map(&self) -> &Merged {
        &self.map
    }

    /// Returns when the tiles of the map's layers changed last.
    pub fn tile_changes(&self) -> &TileChanges {
        &self.tile_changes
    }

    /// Returns the cells of a tile of the merged map as they are shown.
    pub fn tile(&self, address: TileAddress) -> Option<[i8; TILE_CELLS]> {
        self.map.values(address).map(shown_cells)
    }

    /// Returns what has changed since this was asked last.
    pub fn take_changes(&mut self) -> BTreeSet<Subject> {
        std::mem::take(&mut self.changes)
    }

    /// Returns everything that a page that has just come must be sent.
    pub fn subjects(&self) -> BTreeSet<Subject> {
        let vehicles = self.view.vehicles().flat_map(|(id, seen)| {
            let state = seen.state.as_ref().map(|_| Subject::State(id));
            let way = seen
                .state
                .as_ref()
                .and_then(|state| corners_ahead(&state.value));
            let way = way.map(|_| Subject::Way(id));
            state.into_iter().chain([Subject::Vehicle(id)]).chain(way)
        });
        let images = self.images.iter().flat_map(|(subject, image)| {
            let stripes = image
                .parts
                .keys()
                .map(|part| Subject::Stripe(*subject, *part));
            stripes.chain([Subject::Finds(*subject)])
        });
        let of_plans = OF_PLANS.into_iter().filter(|_| !self.plans.is_empty());
        let events = (self.events.last() > 0).then_some(Subject::Events);
        let marks = (!self.marks.is_empty()).then_some(Subject::Marks);
        [Subject::Orders, Subject::Ground]
            .into_iter()
            .chain(vehicles)
            .chain(self.plans.keys().map(|id| Subject::Plan(*id)))
            .chain(of_plans)
            .chain(events)
            .chain(marks)
            .chain(self.radio.pairs().map(Subject::Radio))
            .chain(self.tracks.keys().map(|id| Subject::Track(*id)))
            .chain(self.looks.keys().map(|id| Subject::Look(*id)))
            .chain(self.map.addresses().map(Subject::Tile))
            .chain(images)
            .collect()
    }

    /// Returns how many bytes a copy of it takes, about, without its plans.
    pub fn bytes(&self) -> usize {
        let parts = self.images.values().flat_map(|image| image.parts.values());
        let pixels = |part: &Image| part.mean.len() + part.deviation.as_ref().map_or(0, Vec::len);
        let places = self
            .tracks
            .values()
            .map(|track| size_of_val(track.places()));
        self.map.bytes()
            + self.tile_changes.bytes()
            + parts.map(pixels).sum::<usize>()
            + places.sum::<usize>()
            + self.events.bytes()
            + self.looks.values().map(LookView::bytes).sum::<usize>()
            + OTHER_BYTES
    }

    /// Returns when to wake it.
    pub fn deadline(&self) -> Option<Time> {
        self.repair.deadline()
    }

    /// Returns what is due to be asked of the others, when the map lacks something.
    pub fn wake(&mut self, now: Time) -> Vec<Message> {
        let mut out = Vec::new();
        self.repair.wake(now, &self.map, &mut out);
        // It answers nobody: whoever writes a layer does, and the ground station.
        out.retain(|message| matches!(message, Message::Want(_)));
        out
    }

    /// Returns the names of the open stops, each with whether a node shows it.
    fn shown_stops(&self, node: Sender) -> Vec<(EmergencyName, bool)> {
        let shows = |name| match node {
            Sender::Vehicle(id) => self.view.shows_stop(id, name),
            Sender::Ground | Sender::Operator(_) => false,
        };
        let open = self.view.open_stops().into_iter();
        open.map(|stop| (stop.name, shows(stop.name))).collect()
    }

    /// Marks what a message changes of a vehicle's row, before it is taken.
    fn mark_vehicle(&mut self, message: &Message) {
        match message {
            Message::State(state) => {
                self.changes.insert(Subject::State(state.vehicle));
                let known = self.view.state(state.vehicle).map(|state| &state.value);
                let is_same = known.is_some_and(|known| {
                    (known.boot, known.ordered, known.accepted, known.control)
                        == (state.boot, state.ordered, state.accepted, state.control)
                });
                if !is_same {
                    self.changes.insert(Subject::Vehicle(state.vehicle));
                }
                if known.and_then(corners_ahead) != corners_ahead(state) {
                    self.changes.insert(Subject::Way(state.vehicle));
                }
            }
            Message::Mission(mission) => {
                let known = self.view.vehicle(mission.vehicle);
                let known = known.and_then(|seen| seen.mission.as_ref());
                let known = known.map(|known| &known.value);
                if known.map(shown_of_mission) != Some(shown_of_mission(mission)) {
                    self.changes.insert(Subject::Vehicle(mission.vehicle));
                }
                let is_same = known.is_some_and(|known| known.progress == mission.progress);
                if !is_same && !self.plans.is_empty() {
                    self.changes.insert(Subject::Progress);
                }
            }
            Message::Health(health) => {
                let known = self.view.vehicle(health.vehicle);
                let known = known.and_then(|seen| seen.health.as_ref());
                let known = known.map(|known| shown_of_health(&known.value));
                if known != Some(shown_of_health(health)) {
                    self.changes.insert(Subject::Vehicle(health.vehicle));
                }
            }
            Message::Report(_) => {
                self.changes.insert(Subject::Ground);
            }
            Message::Standing(_)
            | Message::Hello(_)
            | Message::Tile(_)
            | Message::Digest(_)
            | Message::Want(_)
            | Message::Plan(_)
            | Message::Order(_)
            | Message::Samples(_)
            | Message::Have(_)
            | Message::Beacon(_)
            | Message::Task(_)
            | Message::Image(_)
            | Message::Fix(_)
            | Message::Mark(_)
            | Message::Look(_)
            | Message::Log(_)
            | Message::Settings(_) => {}
        }
    }

    /// Keeps what the fleet view does not.
    fn keep(&mut self, now: Time, sender: Sender, message: &Message) {
        match message {
            Message::Tile(report) => {
                let shown = self.tile(report.address);
                // What is refused is the map's to judge; a listener has nobody to complain to.
                if let Ok(JoinResult::Newer { .. }) = self.map.join(report) {
                    self.tile_changes.hear(now, report);
                    if self.tile(report.address) != shown {
                        self.changes.insert(Subject::Tile(report.address));
                    }
                }
                self.repair.pass(now, &self.map, report);
            }
            Message::Digest(digest) => self.repair.hear_digest(now, &self.map, digest),
            Message::Plan(plan) => {
                if !self.has_plan(plan) {
                    self.plans.insert(plan.vehicle, Arc::new(plan.clone()));
                    self.changes.insert(Subject::Plan(plan.vehicle));
                    self.timetable = OnceCell::new();
                    self.changes.extend(OF_PLANS);
                }
            }
            Message::Image(image) => self.keep_image(now, image),
            Message::State(state) => {
                if let Some(pose) = &state.pose {
                    self.tracks.entry(state.vehicle).or_default().add(pose.at);
                }
            }
            Message::Samples(batch) => {
                let pairs = self.radio.hear(now, batch);
                self.changes.extend(pairs.into_iter().map(Subject::Radio));
            }
            Message::Look(look) => {
                let known = self.looks.entry(look.vehicle);
                let known = known.and_modify(|known| known.hear(now, look));
                known.or_insert_with(|| LookView::new(now, look));
                self.changes.insert(Subject::Look(look.vehicle));
            }
            Message::Mark(mark) => {
                if let Some(text) = self.marks.hear(sender, mark) {
                    self.mark_event(now, text);
                }
            }
            // Settings are kept beside the board: there is no looking back at them.
            Message::Settings(_)
            | Message::Log(_)
            | Message::Mission(_)
            | Message::Health(_)
            | Message::Report(_)
            | Message::Standing(_)
            | Message::Hello(_)
            | Message::Want(_)
            | Message::Order(_)
            | Message::Have(_)
            | Message::Beacon(_)
            | Message::Task(_)
            | Message::Fix(_) => {}
        }
    }

    /// Returns whether a plan says what is known.
    pub fn has_plan(&self, plan: &Plan) -> bool {
        let edition = |plan: &Plan| (plan.run, plan.lease, plan.revision);
        let known = self.plans.get(&plan.vehicle);
        known.is_some_and(|known| edition(plan) == edition(known))
    }

    fn keep_image(&mut self, now: Time, image: &Image) {
        let edition = (image.run, image.sequence);
        let known = self.images.get(&image.subject);
        let is_old = known
            .is_some_and(|known| known.is_after(edition) && now.since(known.at) < IMAGE_STANDS);
        if is_old {
            return;
        }
        let fresh = |earlier| NewestImage::new(now, edition, earlier);
        let newest = self.images.entry(image.subject);
        let newest = newest.or_insert_with(|| fresh(VecDeque::new()));
        if newest.edition != edition {
            *newest = fresh(newest.give_way());
        }
        newest.at = now;
        let is_known = newest.parts.get(&image.part) == Some(image);
        if is_known {
            return;
        }
        let is_first = newest.parts.is_empty();
        newest.parts.insert(image.part, image.clone());
        self.changes
            .insert(Subject::Stripe(image.subject, image.part));
        if image.part == 0 {
            self.changes.insert(Subject::Finds(image.subject));
        }
        if is_first {
            let what = match image.subject {
                ImageSubject::Structure => "the structure",
                ImageSubject::Change => "the change",
            };
            let (run, laps) = (image.run.0, image.laps);
            let text = format!("image of {what}, run {run}, lap {laps}");
            self.add_event(now, EventKind::Image, Vec::new(), text);
        }
    }
}

#[cfg(test)]
mod tests;
