//! Board, gate and outboxes together: what comes from the bus, from the operator and from pages goes to them, and what
//! follows is said as [`PageEffect`]s. Told the time, no I/O; the bus, the sockets and the operator are its caller's.
//!
//! ```text
//!   bus ──heard──► history ──► board ──changes──► outboxes ──frames──► pages
//!                     └─ a board at another time, for each page that looks at one ──► its outbox
//!   page ──token, credit──► gate, outbox        page ──order──► gate ──► order book, operator
//!   operator ──how orders ended──► order book
//! ```

mod looks;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde::Deserialize;
use tomoswarm_proto::{Interest, Message, StopScope, VehicleId};

pub use self::looks::CellQuestion;
use super::board::{Board, BoardInput, Subject};
use super::gate::{FIRST_WITHIN, Gate, GateRefusal, PageId, Right, is_same};
use super::ghost::Ghost;
use super::history::History;
use super::links::LinkBook;
use super::marks::MarkOrder;
use super::node_settings::NodeSettingsBook;
use super::orders::{OrderRequest, OrderWord, STOP_WITHIN};
use super::outbox::{Outbox, Shown};
use super::playback::Playback;
use super::texts;
use super::told::Place;
use crate::config::{Config, Venue, to_toml};
use crate::operator::HeardMessage;
use crate::operator::operator_actor::{In, Out};
use crate::operator::order_goal::GoalId;
use crate::time::Time;
use crate::tomo::ImagingSettings;

/// A stop for all that is pressed again within this time, and is open, is the same one: of more than eight names that are open
/// the rest is joined to *many*, which a start does not lift by itself. So is one that is still on its way.
const SAME_STOP: Duration = Duration::from_secs(8);

/// Between two words to the operator of whether looks are wanted.
const ASK_EVERY: Duration = Duration::from_secs(1);

/// The farthest moment that can be asked for, seconds; clocks may count from 1970.
const FARTHEST_S: f64 = 1e10;

/// What the caller shall do.
#[derive(Clone, PartialEq, Debug)]
pub enum PageEffect {
    /// Send a frame to a page.
    Send(PageId, Vec<u8>),
    /// Close the connection to a page, and say why.
    Close(PageId, GateRefusal),
    /// Tell the operator.
    Tell(In),
    /// Publish on the bus.
    Publish(Message),
}

/// What a page says over its connection.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PageMessage {
    #[serde(default)]
    token: Option<String>,
    /// See [`Page::secret`].
    #[serde(default)]
    secret: String,
    #[serde(default)]
    credit: u32,
    #[serde(default)]
    show: Option<WantedTime>,
    /// With which vehicle it rides from now on; 0 = with none.
    #[serde(default)]
    ride: Option<u8>,
}

/// What time a page wants to see.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
enum WantedTime {
    /// What is new.
    Present,
    /// A moment, seconds, and how fast to go on from there, seconds a second.
    Past { at_s: f64, speed: f64 },
}

/// A connection.
#[derive(Debug)]
struct Page {
    opened: Time,
    /// Once it has said its token.
    outbox: Option<Outbox>,
    /// What it drew for itself, which tells its orders from others' in its name.
    secret: String,
    /// What time it asked for last, until it can be shown: who asks a thousand times is shown the last.
    wanted: Option<WantedTime>,
    /// When it looks at another time than the present.
    playback: Option<Playback>,
    /// It has to be shown all of its board.
    is_anew: bool,
}

/// All that is served to pages.
#[derive(Debug)]
pub struct PageServer {
    place: Place,
    venue: Venue,
    board: Board,
    history: History,
    gate: Gate,
    pages: BTreeMap<PageId, Page>,
    last_page: u32,
    seat: Option<PageId>,
    /// Whether looks are wanted, as the operator was told last, and when that was.
    looks_wanted: (bool, Option<Time>),
    /// When it was heard last that no stop for all is open any more.
    lifted: Option<Time>,
    /// The moment that is shown when it is not the present.
    shown: Option<Time>,
    /// All was told: pages begin at the beginning.
    is_over: bool,
    /// The number of the last marker that pages were told of.
    marked: Option<u64>,
    /// What stands in the scene of a simulation, JSON; empty = it is not known.
    mesh: String,
    /// Where the vehicles of another run were, JSON; empty = there is none.
    ghost: String,
    /// What is set, TOML with the meaning of each key.
    settings: String,
    /// What nodes have said of theirs.
    node_settings: NodeSettingsBook,
    /// The links of all runs, as far as their samples were heard.
    links: LinkBook,
    /// How the ground station images the structure and the change, if that is known.
    imaging: Option<[ImagingSettings; 2]>,
    effects: Vec<PageEffect>,
}

impl PageServer {
    /// Makes a server without pages; `place` is what holds for all of them ([`super::texts::place`]), missions are
    /// judged by the venue.
    pub fn new(place: Place, venue: Venue, board: Board, gate: Gate) -> PageServer {
        PageServer {
            settings: to_toml(&Config::Venue(venue.clone())),
            node_settings: NodeSettingsBook::default(),
            place,
            venue,
            board,
            history: History::default(),
            gate,
            pages: BTreeMap::new(),
            last_page: 0,
            seat: None,
            looks_wanted: (false, None),
            lifted: None,
            shown: None,
            is_over: false,
            marked: None,
            mesh: String::new(),
            ghost: String::new(),
            links: LinkBook::default(),
            imaging: None,
            effects: Vec::new(),
        }
    }

    /// Returns what is known.
    pub fn board(&self) -> &Board {
        &self.board
    }

    /// Returns who may do what.
    pub fn gate(&self) -> &Gate {
        &self.gate
    }

    /// Returns the place.
    pub fn venue(&self) -> &Venue {
        &self.venue
    }

    /// Takes what came over the bus.
    pub fn hear(&mut self, now: Time, heard: &HeardMessage) {
        let input = match heard {
            HeardMessage::Message(_, Message::Settings(said)) => {
                return self.node_settings.take(said);
            }
            // Lines are said more than once.
            HeardMessage::Message(sender, Message::Log(log)) => {
                let Some(news) = self.board.events().news_of(log) else {
                    return;
                };
                HeardMessage::Message(*sender, Message::Log(news))
            }
            HeardMessage::Message(_, Message::Samples(batch)) => {
                self.links.take(batch);
                heard.clone()
            }
            HeardMessage::Message(_, Message::Image(image)) => {
                self.links.image_came((image.run, image.sequence));
                heard.clone()
            }
            HeardMessage::Message(..) | HeardMessage::Greeting(..) | HeardMessage::Unknown(_) => {
                heard.clone()
            }
        };
        let was_stopped = self.is_stop_open();
        self.tell(now, &BoardInput::Heard(input));
        if was_stopped && !self.is_stop_open() {
            self.lifted = Some(now);
        }
    }

    fn tell(&mut self, now: Time, input: &BoardInput) {
        // What came over the bus or from a page can be packed, and so can what the board holds of it: it was.
        let _ = self.history.tell(now, &mut self.board, input);
    }

    /// Takes which moment is shown when it is not the present: in a simulation the virtual time. What is heard is told with
    /// that time; whatever concerns pages keeps the time of their caller.
    pub fn show_moment(&mut self, shown: Time) {
        self.shown = Some(shown);
    }

    /// Takes what stands in the scene of a simulation ([`super::scene_mesh::scene_mesh`]).
    pub fn set_mesh(&mut self, mesh: String) {
        self.mesh = mesh;
    }

    /// Takes another run, to be shown beside one that began at a moment.
    pub fn set_ghost(&mut self, ghost: &Ghost, began: Time) {
        self.place.ghost = Some(ghost.about());
        self.ghost = ghost.beside(began);
    }

    /// Takes what is set beside the venue, in place of that.
    pub fn set_settings(&mut self, config: &Config) {
        self.settings = to_toml(config);
    }

    /// Takes how the ground station images the structure and the change, by the solver `map`.
    pub fn set_imaging(&mut self, structure: ImagingSettings, change: ImagingSettings) {
        self.imaging = Some([structure, change]);
    }

    /// Takes that nothing more will be told: this is a recording, which pages see from its beginning.
    pub fn end_history(&mut self) {
        self.is_over = true;
    }

    /// Takes whether anyone can be reached.
    pub fn set_linked(&mut self, now: Time, is_linked: bool) {
        if self.board.is_linked() != is_linked {
            self.tell(now, &BoardInput::Linked(is_linked));
        }
    }

    /// Takes what the operator says of an order or of a mark.
    pub fn operator_said(&mut self, now: Time, out: &Out) {
        if let Out::Ended(GoalId::Hand(number), outcome)
        | Out::InForce(GoalId::Hand(number), outcome) = out
        {
            self.tell(now, &BoardInput::Ended(*number, outcome.clone()));
        }
        if let Out::Marked(number, outcome) = out {
            self.tell(now, &BoardInput::MarkEnded(*number, outcome.clone()));
        }
    }

    /// Takes a connection.
    ///
    /// # Errors
    /// There are too many.
    pub fn open(&mut self, now: Time) -> Result<PageId, GateRefusal> {
        self.gate.judge_pages(self.pages.len())?;
        self.last_page += 1;
        let page = Page {
            opened: now,
            outbox: None,
            secret: String::new(),
            wanted: None,
            playback: None,
            is_anew: false,
        };
        self.pages.insert(PageId(self.last_page), page);
        Ok(PageId(self.last_page))
    }

    /// Takes what a page says: its token first, then credit.
    ///
    /// # Errors
    /// It cannot be read, or has no token; its connection is to be closed.
    pub fn page_said(&mut self, now: Time, id: PageId, text: &str) -> Result<(), GateRefusal> {
        let said: PageMessage = serde_json::from_str(text)
            .map_err(|error| GateRefusal::Unreadable(format!("not understood: {error}")))?;
        let present = self.present(now);
        let Some(page) = self.pages.get_mut(&id) else {
            return Ok(());
        };
        if let Some(outbox) = &mut page.outbox {
            outbox.credit(said.credit);
            page.wanted = said.show.or(page.wanted);
            if let Some(vehicle) = said.ride {
                outbox.ride(Some(VehicleId(vehicle)).filter(|id| id.0 > 0));
            }
            return Ok(());
        }
        let right = self
            .gate
            .right_of(said.token.as_deref().unwrap_or_default())?;
        let welcome = texts::welcome(&self.place, &self.board, id.0, right == Right::Operate);
        let newest = newest(&self.board, present, &self.history);
        page.outbox = Some(Outbox::new(now, &welcome, &newest));
        page.secret = said.secret;
        page.wanted = self.is_over.then_some(WantedTime::Past {
            at_s: 0.0,
            speed: 1.0,
        });
        Ok(())
    }

    /// Judges whether a token may look.
    ///
    /// # Errors
    /// It is none of this server's.
    pub fn may_look(&self, token: &str) -> Result<(), GateRefusal> {
        self.gate.right_of(token).map(|_| ())
    }

    /// Returns the moment that is the newest.
    pub fn present(&self, now: Time) -> Time {
        self.shown.unwrap_or(now)
    }

    /// Takes that a connection is gone.
    pub fn closed(&mut self, id: PageId) {
        self.pages.remove(&id);
        self.gate.leave(id);
    }

    /// Takes an order whose Host and Origin were judged; returns its number.
    ///
    /// # Errors
    /// Its token, its page or what it says is refused; nothing is ordered then.
    pub fn order(
        &mut self,
        now: Time,
        authorization: Option<&str>,
        body: &[u8],
    ) -> Result<u32, GateRefusal> {
        self.gate.judge_authorization(authorization)?;
        let mut request = OrderRequest::read(body).map_err(GateRefusal::Unreadable)?;
        self.judge_page(&request)?;
        request.secret.clear();
        // A stop that is said again is no further one, and is never too many.
        if let Some(number) = self.stop_under_way(now, &request) {
            return Ok(number);
        }
        self.gate.judge_order(now, &request)?;
        self.look_at_seat(now);
        if request.order == OrderWord::Seat {
            return Ok(0);
        }
        let mission = request
            .mission(&self.venue)
            .map_err(GateRefusal::Unreadable)?;
        if let Some(mission) = &mission {
            let ground = self.board.view().ground(now).map(|report| &report.value);
            let judged = mission.judge(ground).map_err(|misfit| misfit.to_string());
            judged.map_err(GateRefusal::Unreadable)?;
        }
        self.tell(now, &BoardInput::Ordered(request.clone()));
        let number = self.board.orders().given.last();
        self.effects
            .extend(request.input(number, mission).map(PageEffect::Tell));
        Ok(number)
    }

    /// Takes a mark whose Host and Origin were judged; returns its number among the marks.
    ///
    /// # Errors
    /// Its token or what it says is refused; nothing is marked then.
    pub fn mark(
        &mut self,
        now: Time,
        authorization: Option<&str>,
        body: &[u8],
    ) -> Result<u32, GateRefusal> {
        self.gate.judge_authorization(authorization)?;
        let order = MarkOrder::read(body)
            .and_then(|order| order.within(&self.venue))
            .map_err(GateRefusal::Unreadable)?;
        self.gate.judge_mark(now)?;
        self.tell(now, &BoardInput::MarkGiven(order.clone()));
        let number = self.board.marks().given.last();
        let told = PageEffect::Tell(In::Mark(number, order.request()));
        self.effects.push(told);
        Ok(number)
    }

    /// Asks vehicles for what they hear while a page rides with one, and no longer; not at every word of a page, since
    /// operators' greetings wait for nobody.
    fn ask_for_looks(&mut self, now: Time, effects: &mut Vec<PageEffect>) {
        let mut open = self.pages.values().filter_map(|page| page.outbox.as_ref());
        let are_wanted = open.any(|outbox| outbox.rides().is_some());
        let (were_wanted, asked) = self.looks_wanted;
        if are_wanted != were_wanted && asked.is_none_or(|at| now.since(at) >= ASK_EVERY) {
            self.looks_wanted = (are_wanted, Some(now));
            effects.push(PageEffect::Tell(In::Ask(Interest::Looks, are_wanted)));
        }
    }

    /// Returns when to call [`PageServer::due`] next at the latest.
    pub fn deadline(&self, now: Time) -> Time {
        let pages = self.pages.values().filter_map(|page| match &page.outbox {
            Some(outbox) => page.deadline(now, outbox, &self.history),
            None => Some(page.opened + FIRST_WITHIN),
        });
        let seat = self.seat.and(self.gate.seat_ends());
        // Another moment than the present comes with what is heard.
        let board = self.board.deadline().filter(|_| self.shown.is_none());
        pages.chain(board).chain(seat).min().unwrap_or(Time::NEVER)
    }

    /// Returns all that is due.
    pub fn due(&mut self, now: Time) -> Vec<PageEffect> {
        let mut effects = std::mem::take(&mut self.effects);
        let present = self.present(now);
        if self.board.deadline().is_some_and(|at| at <= present) {
            effects.extend(
                self.board
                    .wake(present)
                    .into_iter()
                    .map(PageEffect::Publish),
            );
        }
        self.look_at_seat(now);
        let changes = self.board.take_changes();
        let marked = self.history.markers().back().map(|marker| marker.number);
        let is_marked = std::mem::replace(&mut self.marked, marked) != marked;
        for (id, page) in &mut self.pages {
            if page.outbox.is_none() && now.since(page.opened) >= FIRST_WITHIN {
                effects.push(PageEffect::Close(*id, GateRefusal::Late));
                continue;
            }
            if is_marked && let Some(outbox) = &mut page.outbox {
                outbox.note(&[Subject::Markers].into());
            }
            let newest = newest(&self.board, present, &self.history);
            let frames = page.frames(now, &newest, &changes, &self.history, self.is_over);
            effects.extend(frames.into_iter().map(|frame| PageEffect::Send(*id, frame)));
        }
        for effect in &effects {
            if let PageEffect::Close(id, _) = effect {
                self.pages.remove(id);
            }
        }
        self.ask_for_looks(now, &mut effects);
        effects
    }

    /// Shows all pages who has the seat, when that has changed.
    fn look_at_seat(&mut self, now: Time) {
        let seat = self.gate.seat(now);
        if seat != self.seat {
            self.seat = seat;
            self.tell(now, &BoardInput::Seat(seat));
        }
    }

    /// Judges whether what the seat is needed for comes from the page that it names, and no other one that has seen its number.
    fn judge_page(&self, request: &OrderRequest) -> Result<(), GateRefusal> {
        let page = self.pages.get(&PageId(request.page));
        match page.filter(|page| page.outbox.is_some()) {
            _ if request.order != OrderWord::Seat && !request.order.moves() => Ok(()),
            Some(page) if !is_same(&page.secret, &request.secret) => Err(GateRefusal::NotThatPage),
            // A page that is gone has no seat, and is given none.
            None if request.order == OrderWord::Seat => Err(GateRefusal::NotOpen),
            None | Some(_) => Ok(()),
        }
    }

    /// Returns the number of a stop for all that is on its way, or was given a moment ago and is open. One that was lifted, or
    /// after which something that moves was ordered, is over: what is pressed last counts.
    fn stop_under_way(&self, now: Time, request: &OrderRequest) -> Option<u32> {
        let is_stop = request.order == OrderWord::Stop && request.vehicles.is_empty();
        let given = self.board.orders().stop_of_all().filter(|_| is_stop)?;
        let is_lifted = self.lifted.is_some_and(|at| at >= given.at);
        let age = now.since(given.at);
        let is_on_its_way = given.outcome.is_none() && age < STOP_WITHIN;
        let is_same = is_on_its_way || (age < SAME_STOP && self.is_stop_open());
        (is_same && !is_lifted).then_some(given.number)
    }

    fn is_stop_open(&self) -> bool {
        let stops = self.board.view().open_stops();
        stops.iter().any(|stop| stop.scope == StopScope::All)
    }
}

/// Returns what is shown of the present, up to which a history reaches.
fn newest<'a>(board: &'a Board, present: Time, history: &'a History) -> Shown<'a> {
    let from = history.span().map_or(present, |(from, _)| from);
    Shown {
        board,
        at: present,
        span: (from, present),
        speed: None,
        markers: history.markers(),
    }
}

impl Page {
    /// Takes what time is to be shown.
    fn show(&mut self, now: Time, wanted: WantedTime, history: &History, is_over: bool) {
        let (at, speed) = match wanted {
            WantedTime::Past { at_s, speed } => {
                (Time::from_secs_f64(at_s.clamp(0.0, FARTHEST_S)), speed)
            }
            // The end of a recording is no present.
            WantedTime::Present if is_over => (Time::NEVER, 0.0),
            WantedTime::Present => {
                self.is_anew |= self.playback.take().is_some();
                return;
            }
        };
        match &mut self.playback {
            Some(playback) => playback.go_to(history, now, at, speed),
            None => self.playback = Playback::begin(history, now, at, speed),
        }
        self.is_anew |= self.playback.is_some();
    }

    /// Returns the frames that may go now; `newest` is what is shown of the present.
    fn frames(
        &mut self,
        now: Time,
        newest: &Shown<'_>,
        changes: &BTreeSet<Subject>,
        history: &History,
        is_over: bool,
    ) -> Vec<Vec<u8>> {
        let has_room = self.outbox.as_ref().is_some_and(Outbox::has_room);
        if let Some(wanted) = self.wanted.take_if(|_| has_room) {
            self.show(now, wanted, history, is_over);
        }
        let Some(outbox) = &mut self.outbox else {
            return Vec::new();
        };
        if let Some(playback) = &self.playback
            && !is_over
            && playback.speed() > 0.0
            && playback.is_at_end(history, now)
        {
            // It has come to the present.
            (self.playback, self.is_anew) = (None, true);
        }
        let Some(playback) = &mut self.playback else {
            if std::mem::take(&mut self.is_anew) {
                outbox.show_anew(now, newest.board);
            }
            outbox.note(changes);
            return std::iter::from_fn(|| outbox.next(now, newest)).collect();
        };
        // A page that draws nothing is told nothing, and its board stays where it is.
        if !outbox.has_room() || !playback.go_on(history, now, is_over) {
            return Vec::new();
        }
        let changes = playback.board_mut().take_changes();
        if std::mem::take(&mut self.is_anew) {
            outbox.show_anew(now, playback.board());
        }
        outbox.note(&changes);
        let shown = Shown {
            board: playback.board(),
            at: playback.moment(history, now),
            speed: Some(playback.speed()),
            ..*newest
        };
        std::iter::from_fn(|| outbox.next(now, &shown)).collect()
    }

    /// Returns when something may be due for it.
    fn deadline(&self, now: Time, outbox: &Outbox, history: &History) -> Option<Time> {
        let frames = outbox.deadline()?;
        if self.wanted.is_some() {
            return Some(now);
        }
        let playback = self.playback.as_ref();
        let playback = playback.and_then(|playback| playback.deadline(history, now));
        Some(playback.map_or(frames, |at| at.min(frames)))
    }
}

#[cfg(test)]
mod tests;
