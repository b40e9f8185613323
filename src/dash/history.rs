//! What a board was told, in the order of time, so that it can be had as it was at any moment: what was told until then is told
//! to a board again, beginning with a copy of the board that is kept every few thousand inputs.
//!
//! It is bounded. When it has grown too large the oldest parts are thinned: of what replaces itself (a state, a tile, …) only the
//! last of each second is kept, then of each ten seconds, then of each minute, and then the oldest part goes. What made an
//! event, and all orders, marks and images, stay as long as their part does. A moment of a thinned part is shown as it was at
//! most that much earlier, its plans ten times that.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use tomoswarm_proto::codec::{self, EncodeError};
use tomoswarm_proto::{LayerId, Message, Sender, TileAddress, VehicleId};

use super::board::{Board, BoardInput};
use super::events::{Event, EventKind};
use crate::operator::HeardMessage;
use crate::time::Time;

/// A history has at most so many bytes, the copies of boards included.
pub const HISTORY_BYTES_MAX: usize = 64 << 20;
/// Markers kept at most; the oldest go first.
pub const MARKERS_MAX: usize = 1000;
/// A copy of the board is kept every so many inputs.
const PART_INPUTS: usize = 8192;
/// The newest parts stay as they are.
const PARTS_KEPT: usize = 2;
/// Of what replaces itself a thinned part keeps the last in each of these.
const THINNED: [Duration; 3] = [
    Duration::from_secs(1),
    Duration::from_secs(10),
    Duration::from_secs(60),
];
/// Plans are long: of them the last of so much longer a time is kept.
const PLANS_RARER: u32 = 10;
/// Time, length and whether it stays, before each input.
const HEADER_BYTES: usize = 13;

/// What a board was told.
#[derive(Debug)]
pub struct History {
    parts: VecDeque<Part>,
    last: Time,
    bytes: usize,
    bytes_max: usize,
    markers: VecDeque<Event>,
}

/// Some thousands of inputs.
#[derive(Debug)]
struct Part {
    /// When the first one was told; all before it were told earlier.
    from: Time,
    /// The board as it was before.
    board: Board,
    board_bytes: usize,
    inputs: usize,
    packed: Vec<u8>,
    /// How often it was thinned.
    thinned: usize,
}

/// An input as it is kept.
struct Packed<'a> {
    at: Time,
    /// It made an event.
    stays: bool,
    bytes: &'a [u8],
}

/// What a later input of the same replaces.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Replaced {
    State(VehicleId),
    Mission(VehicleId),
    Health(VehicleId),
    Look(VehicleId),
    Samples(VehicleId),
    Plan(VehicleId),
    Report(u64),
    Tile(LayerId, TileAddress),
    Standing(Sender),
    Greeting(Sender),
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
        self.begin_part_when_due(now, board);
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
        let bytes = codec::pack(input)?;
        let packed = Packed {
            at: now,
            stays,
            bytes: &bytes,
        };
        if let Some(part) = self.parts.back_mut() {
            self.bytes += packed.write(&mut part.packed);
            part.inputs += 1;
        }
        self.last = now;
        Ok(())
    }

    /// Returns the time that it reaches over; `None` = nothing was told.
    pub fn span(&self) -> Option<(Time, Time)> {
        self.parts.front().map(|part| (part.from, self.last))
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
    pub fn board_before(&self, moment: Time) -> Option<(&Board, Time)> {
        let later = self.parts.partition_point(|part| part.from <= moment);
        let part = self.parts.get(later.saturating_sub(1))?;
        Some((&part.board, part.from))
    }

    /// Tells a board, which was told everything before `from`, what was told before `until`; about `most` inputs. Returns before
    /// which moment it has now been told everything.
    pub fn tell_again(&self, board: &mut Board, from: Time, until: Time, most: usize) -> Time {
        let later = self.parts.partition_point(|part| part.from <= from);
        let (mut told, mut told_at) = (0, from);
        for part in self.parts.iter().skip(later.saturating_sub(1)) {
            for packed in part.inputs() {
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

    /// Begins a part when the newest one is full; never between two inputs of the same time.
    fn begin_part_when_due(&mut self, now: Time, board: &Board) {
        let is_full = self
            .parts
            .back()
            .is_none_or(|part| part.inputs >= PART_INPUTS && now > self.last);
        if !is_full {
            return;
        }
        let board_bytes = board.bytes();
        self.bytes += board_bytes;
        let mut board = board.clone();
        // A copy has nothing to say of what came before it.
        board.take_changes();
        self.parts.push_back(Part {
            from: now,
            board,
            board_bytes,
            inputs: 0,
            packed: Vec::new(),
            thinned: 0,
        });
        self.make_room();
    }

    fn make_room(&mut self) {
        while self.bytes > self.bytes_max && self.parts.len() > PARTS_KEPT {
            let older = self.parts.len() - PARTS_KEPT;
            let thinned = |place: &usize| self.parts[*place].thinned;
            let place = (0..older).min_by_key(thinned).unwrap_or(0);
            match THINNED.get(self.parts[place].thinned) {
                Some(interval) => {
                    self.parts[place].thin(*interval);
                    self.join_with_older(place);
                }
                None => drop(self.parts.pop_front()),
            }
            self.bytes = self.parts.iter().map(Part::bytes).sum();
        }
    }

    /// Joins a part with the one before it, when both are as thin and small enough together.
    fn join_with_older(&mut self, place: usize) {
        let Some(before) = place.checked_sub(1) else {
            return;
        };
        let (older, newer) = (&self.parts[before], &self.parts[place]);
        let fits = older.inputs + newer.inputs <= PART_INPUTS;
        if older.thinned != newer.thinned || !fits {
            return;
        }
        if let Some(newer) = self.parts.remove(place) {
            let older = &mut self.parts[before];
            older.packed.extend(newer.packed);
            older.inputs += newer.inputs;
        }
    }
}

impl Part {
    fn bytes(&self) -> usize {
        self.board_bytes + self.packed.len()
    }

    fn inputs(&self) -> impl Iterator<Item = Packed<'_>> {
        let mut rest = self.packed.as_slice();
        std::iter::from_fn(move || Packed::read(&mut rest))
    }

    fn thin(&mut self, interval: Duration) {
        let inputs: Vec<Packed<'_>> = self.inputs().collect();
        let (mut kept, mut seen) = (Vec::new(), BTreeSet::new());
        for packed in inputs.iter().rev() {
            let replaced = packed.input().as_ref().and_then(replaced);
            let interval = match replaced {
                Some(Replaced::Plan(_)) => interval * PLANS_RARER,
                _ => interval,
            };
            let bucket = packed.at.since(Time::ZERO).as_nanos() / interval.as_nanos();
            let is_last = replaced.is_none_or(|what| seen.insert((bucket, what)));
            if is_last || packed.stays {
                kept.push(packed);
            }
        }
        let mut thin = Vec::new();
        for packed in kept.iter().rev() {
            packed.write(&mut thin);
        }
        (self.inputs, self.thinned) = (kept.len(), self.thinned + 1);
        thin.shrink_to_fit();
        self.packed = thin;
    }
}

impl Packed<'_> {
    /// Adds it to others; returns how many bytes that took.
    fn write(&self, to: &mut Vec<u8>) -> usize {
        let before = to.len();
        to.extend(self.at.as_nanos().to_le_bytes());
        to.extend((self.bytes.len() as u32).to_le_bytes());
        to.push(u8::from(self.stays));
        to.extend(self.bytes);
        to.len() - before
    }

    /// Takes the first of several.
    fn read<'a>(rest: &mut &'a [u8]) -> Option<Packed<'a>> {
        let (header, body) = rest.split_first_chunk::<HEADER_BYTES>()?;
        let (at, header) = header.split_first_chunk()?;
        let (length, header) = header.split_first_chunk()?;
        let (bytes, after) = body.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        *rest = after;
        Some(Packed {
            at: Time::from_nanos(u64::from_le_bytes(*at)),
            stays: header.first() == Some(&1),
            bytes,
        })
    }

    /// Reads what was packed here.
    fn input(&self) -> Option<BoardInput> {
        codec::unpack(self.bytes).ok()
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

/// Returns what a later input of the same kind replaces; `None` = it stands for itself.
fn replaced(input: &BoardInput) -> Option<Replaced> {
    let BoardInput::Heard(heard) = input else {
        return None;
    };
    let (sender, message) = match heard {
        HeardMessage::Message(sender, message) => (sender, message),
        HeardMessage::Greeting(greeting, _) => return Some(Replaced::Greeting(greeting.node)),
        HeardMessage::Unknown(_) => return None,
    };
    match message {
        Message::State(state) => Some(Replaced::State(state.vehicle)),
        Message::Mission(mission) => Some(Replaced::Mission(mission.vehicle)),
        Message::Health(health) => Some(Replaced::Health(health.vehicle)),
        Message::Look(look) => Some(Replaced::Look(look.vehicle)),
        Message::Samples(batch) => Some(Replaced::Samples(batch.vehicle)),
        Message::Plan(plan) => Some(Replaced::Plan(plan.vehicle)),
        Message::Report(report) => Some(Replaced::Report(report.store)),
        Message::Tile(tile) => Some(Replaced::Tile(tile.layer, tile.address)),
        Message::Standing(_) => Some(Replaced::Standing(*sender)),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
