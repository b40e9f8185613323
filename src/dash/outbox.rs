//! What goes to one page next. Two frames are on their way at most; the page gives credit back when it has drawn one, so a slow
//! link makes nothing old, and a hidden page costs nothing. What waits is a set of subjects, never bytes: of each the newest
//! is sent. Orders go before states, states before texts, those before tiles, tiles before images; but who was passed over a
//! few times has its turn, so that a page that draws slowly sees all of it as well. Within each of these all have their turn.
//!
//! States go ten times a second at most, tiles twenty times, who hears whom once. Every second a page is told which moment it
//! shows, of which span; that also says that the server lives.

use std::collections::{BTreeSet, VecDeque};
use std::ops::Bound;
use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::board::{Board, Subject};
use super::events::Event;
use super::frame::{self, FRAME_BYTES_MAX, FrameKind, HEADER_BYTES};
use super::{contents, texts};
use crate::time::Time;

/// Frames on their way at most.
pub const IN_FLIGHT_MAX: u32 = 2;
/// What waits of a class has its turn after so many frames of others.
const PATIENCE: [u8; 5] = [u8::MAX, 1, 4, 6, 8];
/// Between two frames of states.
const STATES_EVERY: Duration = Duration::from_millis(100);
/// Between two frames of tiles.
const TILES_EVERY: Duration = Duration::from_millis(50);
/// Between two frames of who hears whom.
const RADIO_EVERY: Duration = Duration::from_secs(1);
/// Between two frames of which moment is shown.
const MOMENT_EVERY: Duration = Duration::from_secs(1);
/// Between two words of how far vehicles are in their plans.
const PROGRESS_EVERY: Duration = Duration::from_secs(1);

/// What a page is shown.
#[derive(Clone, Copy)]
pub struct Shown<'a> {
    /// The board.
    pub board: &'a Board,
    /// The moment at which it is as it is.
    pub at: Time,
    /// From when and until when there are moments that could be shown.
    pub span: (Time, Time),
    /// How fast it goes on, when it is another moment than the present; `None` = it is the present.
    pub speed: Option<f64>,
    /// What is worth a mark, oldest first.
    pub markers: &'a VecDeque<Event>,
}

/// What waits for one page.
#[derive(Debug)]
pub struct Outbox {
    waiting: BTreeSet<Subject>,
    /// The vehicle whose looks it is shown.
    rides: Option<VehicleId>,
    /// The rest of a text that has begun.
    rest: VecDeque<Vec<u8>>,
    in_flight: u32,
    /// How many frames have gone since the last one of each class, while something of it waited.
    passed_over: [u8; 5],
    /// What of each class went last.
    sent_last: [Option<Subject>; 5],
    /// Before which time nothing of each rate goes.
    rates_at: [Time; 5],
    /// The number of the last event that was sent.
    events_sent: u64,
    /// The number of the last marker that was sent.
    markers_sent: u64,
    /// Everything comes anew, and the page is to forget what it has.
    is_anew: bool,
    /// Not everything of that has gone: nothing waits for its rate, and the page draws when all is there.
    is_filling: bool,
}

impl Outbox {
    /// Makes what a page that has just come is sent: a text of welcome, then everything that is shown.
    pub fn new(now: Time, welcome: &str, shown: &Shown<'_>) -> Outbox {
        let markers = (!shown.markers.is_empty()).then_some(Subject::Markers);
        Outbox {
            waiting: everything(shown.board, None, markers),
            rides: None,
            rest: frame::texts(FrameKind::Welcome, shown.at, welcome.as_bytes()).into(),
            in_flight: 0,
            passed_over: [0; 5],
            sent_last: [None; 5],
            rates_at: [now; 5],
            events_sent: 0,
            markers_sent: 0,
            is_anew: false,
            is_filling: false,
        }
    }

    /// Lets everything come anew, as another board has it; a text that has begun is ended first.
    pub fn show_anew(&mut self, now: Time, board: &Board) {
        let markers = self.waiting.get(&Subject::Markers).copied();
        self.waiting = everything(board, self.rides, markers);
        (self.passed_over, self.rates_at) = ([0; 5], [now; 5]);
        self.sent_last = [None; 5];
        (self.events_sent, self.is_anew, self.is_filling) = (0, true, true);
    }

    /// Returns whether a frame may go.
    pub fn has_room(&self) -> bool {
        self.in_flight < IN_FLIGHT_MAX
    }

    /// Takes what has changed.
    pub fn note(&mut self, changes: &BTreeSet<Subject>) {
        let rides = self.rides;
        let for_it = changes.iter().filter(|of| is_for(**of, rides));
        self.waiting.extend(for_it);
    }

    /// Takes which vehicle the page rides with.
    pub fn ride(&mut self, vehicle: Option<VehicleId>) {
        self.rides = vehicle;
        self.waiting.retain(|of| is_for(*of, vehicle));
        self.waiting.extend(vehicle.map(Subject::Look));
    }

    /// Returns which vehicle the page rides with.
    pub fn rides(&self) -> Option<VehicleId> {
        self.rides
    }

    /// Takes that the page has drawn some frames.
    pub fn credit(&mut self, frames: u32) {
        self.in_flight = self.in_flight.saturating_sub(frames);
    }

    /// Returns how many frames are on their way.
    pub fn in_flight(&self) -> u32 {
        self.in_flight
    }

    /// Returns when a frame may be due without anything new; `None` = not before the page gives credit.
    pub fn deadline(&self) -> Option<Time> {
        if !self.has_room() {
            return None;
        }
        if !self.rest.is_empty() {
            return Some(Time::ZERO);
        }
        let waiting = self.waiting.iter();
        waiting.map(|subject| self.due_at(*subject)).min()
    }

    /// Returns the next frame, if one may go now.
    pub fn next(&mut self, now: Time, shown: &Shown<'_>) -> Option<Vec<u8>> {
        if !self.has_room() {
            return None;
        }
        let frame = self
            .rest
            .pop_front()
            .or_else(|| self.is_anew.then(|| self.begin_anew(now, shown))?)
            .or_else(|| self.has_filled().then(|| self.begin_anew(now, shown))?)
            .or_else(|| self.choose(now, shown))?;
        self.in_flight += 1;
        Some(frame)
    }

    /// Returns whether all that was to come anew has gone since this was asked last.
    fn has_filled(&mut self) -> bool {
        let is_whole = self.waiting.iter().all(|of| *of == Subject::Moment);
        let has_filled = self.is_filling && is_whole;
        self.is_filling &= !is_whole;
        has_filled
    }

    /// Says first of all that everything comes anew, or last that all of it has come.
    fn begin_anew(&mut self, now: Time, shown: &Shown<'_>) -> Option<Vec<u8>> {
        self.begin_interval(now, Subject::Moment);
        self.moment(shown)
    }

    /// Says which moment is shown; it waits again at once, for its next turn.
    fn moment(&mut self, shown: &Shown<'_>) -> Option<Vec<u8>> {
        let is_anew = std::mem::take(&mut self.is_anew);
        let text = texts::moment(shown, is_anew, !self.is_filling);
        frame::texts(FrameKind::Moment, shown.at, text.as_bytes()).pop()
    }

    fn due_at(&self, subject: Subject) -> Time {
        let rate = rate(subject).filter(|_| !self.is_filling || subject == Subject::Moment);
        rate.map_or(Time::ZERO, |(rate, _)| self.rates_at[rate])
    }

    fn choose(&mut self, now: Time, shown: &Shown<'_>) -> Option<Vec<u8>> {
        loop {
            let subject = self.first(now)?;
            self.begin_interval(now, subject);
            // Of many that go together the last one counts.
            self.sent_last[class(subject)] = Some(subject);
            if let Some(frame) = self.make(shown, subject) {
                self.count(now, class(subject));
                return Some(frame);
            }
        }
    }

    /// Returns what goes first of all that is due: of a class that has waited too long, or else of the first class.
    fn first(&self, now: Time) -> Option<Subject> {
        let is_impatient = |of: &usize| self.passed_over[*of] >= PATIENCE[*of];
        let mut impatient = (0..PATIENCE.len()).filter(is_impatient);
        impatient
            .find_map(|of| self.in_turn(now, of))
            .or_else(|| (0..PATIENCE.len()).find_map(|of| self.in_turn(now, of)))
    }

    /// Returns what of a class is due and has its turn: the next one after that which went last.
    fn in_turn(&self, now: Time, of: usize) -> Option<Subject> {
        let is_due = |subject: &&Subject| class(**subject) == of && self.due_at(**subject) <= now;
        let after = self.sent_last[of].map_or(Bound::Unbounded, Bound::Excluded);
        let mut later = self.waiting.range((after, Bound::Unbounded));
        let mut all = self.waiting.iter();
        later.find(is_due).or_else(|| all.find(is_due)).copied()
    }

    /// Counts a frame of a class. Which moment is shown waits always, and counts once it is due.
    fn count(&mut self, now: Time, sent: usize) {
        let moment_is_due = self.due_at(Subject::Moment) <= now;
        for of in 0..PATIENCE.len() {
            let counts = |subject: &Subject| *subject != Subject::Moment || moment_is_due;
            let is_it = |subject: &Subject| class(*subject) == of && counts(subject);
            let waits = of != sent && self.waiting.iter().any(is_it);
            self.passed_over[of] = match waits {
                true => self.passed_over[of].saturating_add(1),
                false => 0,
            };
        }
    }

    /// Lets what comes often wait for its next turn.
    fn begin_interval(&mut self, now: Time, subject: Subject) {
        if let Some((rate, every)) = rate(subject) {
            self.rates_at[rate] = now + every;
        }
    }

    /// Makes the frame of a subject, and of as many like it as fit; `None` of what is not there any more.
    fn make(&mut self, shown: &Shown<'_>, subject: Subject) -> Option<Vec<u8>> {
        let now = shown.at;
        let bytes = |of| contents::bytes(now, shown.board, of, self.events_sent);
        let text = match subject {
            Subject::Moment => return self.moment(shown),
            Subject::State(_) | Subject::Tile(_) | Subject::Radio(_) => {
                return self.gather(shown, subject);
            }
            Subject::Stripe(..) => {
                let stripe = bytes(subject);
                self.waiting.remove(&subject);
                return Some(frame::records(FrameKind::Stripe, now, 1, &stripe?));
            }
            Subject::Markers => {
                let text = texts::markers(shown.markers, self.markers_sent);
                self.markers_sent = shown.markers.back().map_or(0, |marker| marker.number);
                text.map(String::into_bytes)
            }
            Subject::Events => {
                let text = bytes(subject);
                self.events_sent = shown.board.events().last();
                text
            }
            Subject::Orders
            | Subject::Ground
            | Subject::Vehicle(_)
            | Subject::Way(_)
            | Subject::Plan(_)
            | Subject::Timetable
            | Subject::Progress
            | Subject::Marks
            | Subject::Track(_)
            | Subject::Look(_)
            | Subject::Finds(_) => bytes(subject),
        };
        self.waiting.remove(&subject);
        self.rest = frame::texts(contents::kind(subject), now, &text?).into();
        self.rest.pop_front()
    }

    /// Fills a frame with the records that wait and are of the kind of one of them, from that one on and then around, so that
    /// all have their turn when they do not fit into one.
    fn gather(&mut self, shown: &Shown<'_>, first: Subject) -> Option<Vec<u8>> {
        let kind = contents::kind(first);
        let (mut body, mut taken) = (Vec::new(), Vec::new());
        let mut count = 0;
        let later = self.waiting.range(first..);
        for subject in later.chain(self.waiting.range(..first)) {
            if contents::kind(*subject) != kind {
                continue;
            }
            let record = contents::bytes(shown.at, shown.board, *subject, 0).unwrap_or_default();
            if HEADER_BYTES + body.len() + record.len() > FRAME_BYTES_MAX {
                break;
            }
            count += usize::from(!record.is_empty());
            body.extend(record);
            taken.push(*subject);
        }
        for subject in &taken {
            self.waiting.remove(subject);
        }
        if let Some(last) = taken.last() {
            self.sent_last[class(first)] = Some(*last);
        }
        (count > 0).then(|| frame::records(kind, shown.at, count, &body))
    }
}

/// Returns whether a page that rides with a vehicle is shown a subject.
fn is_for(subject: Subject, rides: Option<VehicleId>) -> bool {
    match subject {
        Subject::Look(id) => rides == Some(id),
        _ => true,
    }
}

/// Returns all that a page waits for that is to see a board, with the markers if there are any that it has not seen.
fn everything(
    board: &Board,
    rides: Option<VehicleId>,
    markers: Option<Subject>,
) -> BTreeSet<Subject> {
    let mut all = board.subjects();
    all.retain(|of| is_for(*of, rides));
    all.extend([Subject::Moment].into_iter().chain(markers));
    all
}

/// Returns which rate holds for a subject, and how long it waits between two frames; `None` = it goes at once.
fn rate(subject: Subject) -> Option<(usize, Duration)> {
    match subject {
        Subject::State(_) => Some((0, STATES_EVERY)),
        Subject::Tile(_) => Some((1, TILES_EVERY)),
        Subject::Radio(_) => Some((2, RADIO_EVERY)),
        Subject::Moment => Some((3, MOMENT_EVERY)),
        Subject::Progress => Some((4, PROGRESS_EVERY)),
        Subject::Orders
        | Subject::Ground
        | Subject::Vehicle(_)
        | Subject::Way(_)
        | Subject::Plan(_)
        | Subject::Timetable
        | Subject::Marks
        | Subject::Events
        | Subject::Markers
        | Subject::Track(_)
        | Subject::Look(_)
        | Subject::Finds(_)
        | Subject::Stripe(..) => None,
    }
}

/// Returns which class a subject is of: orders, states, other texts, tiles, images.
fn class(subject: Subject) -> usize {
    match subject {
        Subject::Orders => 0,
        Subject::State(_) | Subject::Look(_) => 1,
        Subject::Ground
        | Subject::Vehicle(_)
        | Subject::Way(_)
        | Subject::Plan(_)
        | Subject::Timetable
        | Subject::Progress
        | Subject::Marks
        | Subject::Events
        | Subject::Moment
        | Subject::Markers
        | Subject::Radio(_)
        | Subject::Track(_)
        | Subject::Finds(_) => 2,
        Subject::Tile(_) => 3,
        Subject::Stripe(..) => 4,
    }
}

#[cfg(test)]
mod tests;
