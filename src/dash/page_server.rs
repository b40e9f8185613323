//! Board, gate and outboxes together: what comes from the bus, from the operator and from pages goes to them, and what follows is
//! said as [`PageEffect`]s. Told the time, no I/O; the bus, the sockets and the operator are its caller's.
//!
//! ```text
//!   bus ──heard──► board ──changes──► outboxes ──frames──► pages
//!   page ──token, credit──► gate, outbox        page ──order──► gate ──► order book, operator
//!   operator ──how orders ended──► order book
//! ```

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde::Deserialize;
use serde_json::{Value, json};
use tomoswarm_proto::{Message, StopScope, VehicleId};

use super::board::Board;
use super::events::EventKind;
use super::gate::{FIRST_WITHIN, Gate, GateRefusal, PageId, Right};
use super::metrics::metrics;
use super::orders::{OrderRequest, OrderWord};
use super::outbox::Outbox;
use super::texts::outcome_in_words;
use crate::config::Venue;
use crate::operator::HeardMessage;
use crate::operator::operator_actor::{In, Out};
use crate::operator::order_goal::GoalId;
use crate::operator::preflight::{Requirements, inspect, is_go};
use crate::operator::status::Expected;
use crate::time::Time;

/// A stop for all that is pressed again within this time, and is open, is the same one: who names more than eight stops a
/// minute has them joined to *many*, which a start does not lift by itself.
const SAME_STOP: Duration = Duration::from_secs(8);
/// So is one that is pressed again before anybody can have shown it.
const SAME_PRESS: Duration = Duration::from_millis(300);

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
    #[serde(default)]
    credit: u32,
}

/// A connection.
#[derive(Debug)]
struct Page {
    opened: Time,
    /// Once it has said its token.
    outbox: Option<Outbox>,
}

/// All that is served to pages.
#[derive(Debug)]
pub struct PageServer {
    place: Value,
    venue: Venue,
    board: Board,
    gate: Gate,
    pages: BTreeMap<PageId, Page>,
    last_page: u32,
    seat: Option<PageId>,
    /// The moment that is shown when it is not the present.
    shown: Option<Time>,
    effects: Vec<PageEffect>,
}

impl PageServer {
    /// Makes a server without pages; `place` is what holds for all of them ([`super::texts::place`]), missions are
    /// judged by the venue.
    pub fn new(place: Value, venue: Venue, board: Board, gate: Gate) -> PageServer {
        PageServer {
            place,
            venue,
            board,
            gate,
            pages: BTreeMap::new(),
            last_page: 0,
            seat: None,
            shown: None,
            effects: Vec::new(),
        }
    }

    /// Returns what is known.
    pub fn board(&self) -> &Board {
        &self.board
    }

    /// Takes what came over the bus.
    pub fn hear(&mut self, now: Time, heard: &HeardMessage) {
        self.board.hear(now, heard);
    }

    /// Takes which moment is shown when it is not the present: in a simulation the virtual time. What is heard is told with
    /// that time; whatever concerns pages keeps the time of their caller.
    pub fn show_moment(&mut self, shown: Time) {
        self.shown = Some(shown);
    }

    /// Takes whether anyone can be reached.
    pub fn set_linked(&mut self, is_linked: bool) {
        self.board.set_linked(is_linked);
    }

    /// Takes what the operator says of an order.
    pub fn operator_said(&mut self, now: Time, out: &Out) {
        if let Out::Ended(GoalId::Hand(number), outcome)
        | Out::InForce(GoalId::Hand(number), outcome) = out
        {
            self.board.orders_mut().end(*number, outcome.clone());
            let vehicles = outcome.vehicles.keys().copied().collect();
            let text = format!("order {number}: {}", outcome_in_words(outcome));
            self.board.add_event(now, EventKind::Order, vehicles, text);
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
        let Some(page) = self.pages.get_mut(&id) else {
            return Ok(());
        };
        if let Some(outbox) = &mut page.outbox {
            outbox.credit(said.credit);
            return Ok(());
        }
        let right = self
            .gate
            .right_of(said.token.as_deref().unwrap_or_default())?;
        let mut welcome = self.place.clone();
        welcome["page"] = json!(id.0);
        welcome["mayOrder"] = json!(right == Right::Operate);
        let shown = self.shown.unwrap_or(now);
        page.outbox = Some(Outbox::new(now, shown, &welcome.to_string(), &self.board));
        Ok(())
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
        let request = OrderRequest::read(body).map_err(GateRefusal::Unreadable)?;
        self.gate.judge_order(now, &request)?;
        self.look_at_seat(now);
        if request.order == OrderWord::Seat {
            return Ok(0);
        }
        if let Some(number) = self.stop_under_way(now, &request) {
            return Ok(number);
        }
        let mission = request
            .mission(&self.venue)
            .map_err(GateRefusal::Unreadable)?;
        let number = self.board.orders_mut().enter(now, request.clone());
        let whom: Vec<VehicleId> = request.targets().into_iter().collect();
        let (word, page) = (request.order.word(), request.page);
        let mission_word = request.mission.as_ref();
        let mission_word = mission_word.map_or(String::new(), |said| format!(" {}", said.kind));
        let text = format!("order {number}: {word}{mission_word}, by page {page}");
        self.board.add_event(now, EventKind::Order, whom, text);
        self.effects
            .extend(request.input(number, mission).map(PageEffect::Tell));
        Ok(number)
    }

    /// Returns the metrics for whoever may look.
    ///
    /// # Errors
    /// The token is none of this server's.
    pub fn metrics(&self, now: Time, authorization: Option<&str>) -> Result<String, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        Ok(metrics(self.shown.unwrap_or(now), &self.board))
    }

    /// Returns the checks before a start of everyone who was heard, as JSON, for whoever may look; `software` is the version
    /// that all are to run.
    ///
    /// # Errors
    /// The token is none of this server's.
    pub fn preflight(
        &self,
        now: Time,
        authorization: Option<&str>,
        software: &str,
    ) -> Result<String, GateRefusal> {
        self.gate.judge_looking(authorization)?;
        let now = self.shown.unwrap_or(now);
        let view = self.board.view();
        let everyone = Expected {
            vehicles: BTreeSet::new(),
            ground: true,
        };
        let needs = Requirements {
            vehicles: everyone.vehicles(view, now),
            venue_hash: self.board.venue_hash(),
            fence: self.venue.fence.clone(),
            homes: self.venue.homes.clone(),
            pose_sd_max_m: None,
            software: software.to_owned(),
        };
        let nodes = inspect(view, &needs, now);
        Ok(json!({ "isGo": is_go(&nodes), "nodes": nodes }).to_string())
    }

    /// Returns when to call [`PageServer::due`] next at the latest.
    pub fn deadline(&self) -> Time {
        let pages = self.pages.values().filter_map(|page| match &page.outbox {
            Some(outbox) => outbox.deadline(),
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
        let shown = self.shown.unwrap_or(now);
        if self.board.deadline().is_some_and(|at| at <= shown) {
            effects.extend(self.board.wake(shown).into_iter().map(PageEffect::Publish));
        }
        self.look_at_seat(now);
        let changes = self.board.take_changes();
        for (id, page) in &mut self.pages {
            match &mut page.outbox {
                Some(outbox) => {
                    outbox.note(&changes);
                    let frames = std::iter::from_fn(|| outbox.next(now, shown, &self.board));
                    effects.extend(frames.map(|frame| PageEffect::Send(*id, frame)));
                }
                None if now.since(page.opened) >= FIRST_WITHIN => {
                    effects.push(PageEffect::Close(*id, GateRefusal::Token));
                }
                None => {}
            }
        }
        for effect in &effects {
            if let PageEffect::Close(id, _) = effect {
                self.pages.remove(id);
            }
        }
        effects
    }

    /// Shows all pages who has the seat, when that has changed.
    fn look_at_seat(&mut self, now: Time) {
        let seat = self.gate.seat(now);
        if seat != self.seat {
            self.seat = seat;
            self.board.orders_mut().set_seat(seat);
        }
    }

    /// Returns the number of a stop for all that was given a moment ago and is still open.
    fn stop_under_way(&self, now: Time, request: &OrderRequest) -> Option<u32> {
        let is_stop = request.order == OrderWord::Stop && request.vehicles.is_empty();
        let is_open = || {
            let stops = self.board.view().open_stops();
            stops.iter().any(|stop| stop.scope == StopScope::All)
        };
        let given = self.board.orders().stop_of_all_since(now - SAME_STOP)?;
        let is_same = is_open() || now.since(given.at) < SAME_PRESS;
        (is_stop && is_same).then_some(given.number)
    }
}

#[cfg(test)]
mod tests;
