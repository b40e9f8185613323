//! What a board was told, in the order of time, so that it can be had as it was at any moment: what was told until then is told
//! to a board again, beginning with a copy of the board that is kept every few thousand inputs.
//!
//! It is bounded. When it has grown too large the oldest parts are thinned: of what replaces itself (a state, a tile, …)
//! only the last of each second is kept, then of each ten seconds, then of each minute, and then the oldest part goes. What
//! made an event, and all orders, marks and images, stay as long as their part does. A moment of a thinned part is shown as
//! it was at most that much earlier, its plans ten times that.
//!
//! Parts are compressed once they are full, and the plans of copies of the board always: who reads the history on and on keeps
//! the part that it has read last uncompressed ([`InflatedPart`]).
//! Parts are small enough for that.

mod board_snapshot;
mod packed_input;
mod part;

use std::collections::VecDeque;
use std::time::Duration;

use tomoswarm_proto::codec::EncodeError;
use tomoswarm_proto::{Message, Samples};

pub use self::board_snapshot::BoardSnapshot;
use self::packed_input::PackedInput;
pub use self::part::InflatedPart;
use self::part::Part;
use super::board::{Board, BoardInput};
use super::events::{Event, EventKind};
use crate::operator::HeardMessage;
use crate::time::Time;

/// A history has at most so many bytes, the copies of boards included.
pub const HISTORY_BYTES_MAX: usize = 20 << 20;
/// Markers kept at most; the oldest go first.
pub const MARKERS_MAX: usize = 1000;
/// The newest parts are not thinned.
const PARTS_KEPT: usize = 2;
/// Of what replaces itself a thinned part keeps the last in each of these.
const THINNED: [Duration; 3] = [
    Duration::from_secs(1),
    Duration::from_secs(10),
    Duration::from_secs(60),
];

/// What a board was told.
#[derive(Debug)]
pub struct History {
    parts: VecDeque<Part>,
    last: Time,
    bytes: usize,
    bytes_max: usize,
    markers: VecDeque<Event>,
}

impl Default for History {
    fn default() -> History {
        History::new(HISTORY_BYTES_MAX)
    }
}

impl History {
    /// Makes an empty one of so many bytes at most.
    pub fn new(bytes_max: usize) -> History {
        History {
            parts: VecDeque::new(),
            last: Time::ZERO,
            bytes: 0,
            bytes_max,
            markers: VecDeque::new(),
        }
    }

    /// Tells the board something, and keeps it; what comes with an earlier time than the one before gets that one's.
    ///
    /// # Errors
    /// The input cannot be packed; the board was told all the same.
    pub fn tell(
        &mut self,
        now: Time,
        board: &mut Board,
        input: &BoardInput,
    ) -> Result<(), EncodeError> {
        let now = now.max(self.last);
        if !is_shown(input) || is_known(board, input) {
            board.take(now, input);
            return Ok(());
        }
        self.make_room();
        // Without another part the newest one takes more.
        let begun = self.begin_part_when_due(now, board);
        let before = board.events().last();
        board.take(now, input);
        let mut stays = false;
        for event in board.events().after(before) {
            // Lines of logs are many: none of them is a mark, and they go with what is thinned.
            stays |= event.kind != EventKind::Note;
            if !matches!(event.kind, EventKind::Change | EventKind::Note) {
                self.markers.push_back(event.clone());
            }
        }
        while self.markers.len() > MARKERS_MAX {
            self.markers.pop_front();
        }
        if let Some(part) = self.parts.back_mut() {
            self.bytes += part.add(now, stays, input)?;
        }
        self.last = now;
        begun
    }

    /// Returns the time that it reaches over; `None` = nothing was told.
    pub fn span(&self) -> Option<(Time, Time)> {
        self.parts.front().map(|part| (part.from(), self.last))
    }

    /// Returns what is worth a mark: troubles, orders, images; oldest first.
    pub fn markers(&self) -> &VecDeque<Event> {
        &self.markers
    }

    /// Returns the bytes that it takes, about.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Returns the newest board that is kept of those that were told nothing at a moment or after it, and the moment before
    /// which it was told everything; `None` = nothing was told.
    pub fn board_before(&self, moment: Time) -> Option<(&BoardSnapshot, Time)> {
        let part = self.parts_from(moment).next()?;
        Some((part.board(), part.from()))
    }

    /// Tells a board, which was told everything before `from`, what was told before `until`; about `most` inputs. Returns
    /// before which moment it has now been told everything. `inflated`: what the same caller has read last, for its next
    /// call.
    pub fn tell_again(
        &self,
        board: &mut Board,
        inflated: &mut InflatedPart,
        from: Time,
        until: Time,
        most: usize,
    ) -> Time {
        let (mut told, mut told_at) = (0, from);
        for part in self.parts_from(from) {
            if part.from() >= until {
                return until;
            }
            for packed in part.inputs(inflated) {
                if packed.at >= until {
                    return until;
                }
                if packed.at < from {
                    continue;
                }
                if told >= most && packed.at > told_at {
                    return packed.at;
                }
                (told, told_at) = (told + 1, packed.at);
                if let Some(input) = packed.input() {
                    board.take(packed.at, &input);
                }
            }
        }
        until
    }

    /// Tells the samples that were told from a moment on and before another, as far as they are kept, oldest first.
    pub fn each_samples(&self, from: Time, until: Time, take: &mut dyn FnMut(Time, &Samples)) {
        let mut inflated = InflatedPart::default();
        for part in self.parts_from(from) {
            if part.from() >= until {
                return;
            }
            let is_asked =
                |packed: &PackedInput<'_>| packed.is_samples && (from..until).contains(&packed.at);
            for packed in part.inputs(&mut inflated).filter(is_asked) {
                if let Some(BoardInput::Heard(HeardMessage::Message(_, Message::Samples(batch)))) =
                    packed.input()
                {
                    take(packed.at, &batch);
                }
            }
        }
    }

    /// Returns the part in which a moment lies, or else the first one, and those after it.
    fn parts_from(&self, moment: Time) -> impl Iterator<Item = &Part> {
        let later = self.parts.partition_point(|part| part.from() <= moment);
        self.parts.iter().skip(later.saturating_sub(1))
    }

    /// Begins a part when the newest one is full; never between two inputs of the same time.
    fn begin_part_when_due(&mut self, now: Time, board: &Board) -> Result<(), EncodeError> {
        let is_full = self
            .parts
            .back()
            .is_none_or(|part| part.is_full() && now > self.last);
        if !is_full {
            return Ok(());
        }
        let board = BoardSnapshot::of(board, self.parts.back().map(Part::board))?;
        let buffer = self.parts.back_mut().map(Part::close);
        let part = Part::new(now, board, buffer.unwrap_or_default());
        self.parts.push_back(part);
        self.bytes = self.sum_of_bytes();
        Ok(())
    }

    fn sum_of_bytes(&self) -> usize {
        let before = std::iter::once(None).chain(self.parts.iter().map(Some));
        let each = self.parts.iter().zip(before);
        each.map(|(part, before)| part.bytes(before)).sum()
    }

    /// Thins or drops one part, when there are too many bytes in those that are full: a step at a time, since each takes a
    /// while and others wait.
    fn make_room(&mut self) {
        let open = self.parts.back().map_or(0, Part::open_bytes);
        if self.bytes - open <= self.bytes_max || self.parts.len() <= PARTS_KEPT {
            return;
        }
        let older = self.parts.len() - PARTS_KEPT;
        let thinned = |place: &usize| self.parts[*place].thinned();
        let place = (0..older).min_by_key(thinned).unwrap_or(0);
        match THINNED.get(self.parts[place].thinned()) {
            Some(interval) => {
                self.parts[place].thin(*interval);
                self.join_with_older(place, *interval);
            }
            None => drop(self.parts.pop_front()),
        }
        self.bytes = self.sum_of_bytes();
    }

    /// Joins a part that was thinned with the one before it, when both are as thin and small enough together; otherwise closes
    /// it.
    fn join_with_older(&mut self, place: usize, interval: Duration) {
        let newer = &self.parts[place];
        let joins = |older: &Part| older.thinned() == newer.thinned() && older.fits_with(newer);
        let before = place.checked_sub(1).filter(|at| joins(&self.parts[*at]));
        match before {
            Some(before) => {
                if let Some(newer) = self.parts.remove(place) {
                    self.parts[before].join(&newer, interval);
                }
            }
            None => drop(self.parts[place].close()),
        }
    }
}

/// Returns whether something can change what a board shows.
fn is_shown(input: &BoardInput) -> bool {
    let BoardInput::Heard(heard) = input else {
        return true;
    };
    match heard {
        HeardMessage::Message(_, message) => !matches!(
            message,
            Message::Digest(_)
                | Message::Want(_)
                | Message::Have(_)
                | Message::Beacon(_)
                | Message::Order(_)
                | Message::Task(_)
                | Message::Fix(_)
        ),
        HeardMessage::Greeting(..) => true,
        HeardMessage::Unknown(_) => false,
    }
}

/// Returns whether an input says again what a board knows. Plans are long, and said again as long as they hold; marks are said
/// until they are stored.
fn is_known(board: &Board, input: &BoardInput) -> bool {
    match input {
        BoardInput::Heard(HeardMessage::Message(_, Message::Plan(plan))) => board.has_plan(plan),
        BoardInput::Heard(HeardMessage::Message(sender, Message::Mark(mark))) => {
            board.marks().knows(*sender, mark)
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests;
