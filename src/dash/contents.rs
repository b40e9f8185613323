//! What is sent of each subject: in which kind of frame, and which text or record.

use std::collections::BTreeMap;

use super::board::{Board, Subject};
use super::frame::FrameKind;
use super::{records, texts};
use crate::time::Time;

/// Returns the kind of the frames that hold a subject.
pub fn kind(subject: Subject) -> FrameKind {
    match subject {
        Subject::Orders => FrameKind::Orders,
        Subject::State(_) => FrameKind::States,
        Subject::Ground => FrameKind::Ground,
        Subject::Vehicle(_) => FrameKind::Vehicle,
        Subject::Way(_) => FrameKind::Way,
        Subject::Plan(_) => FrameKind::Plan,
        Subject::Timetable => FrameKind::Timetable,
        Subject::Progress => FrameKind::Progress,
        Subject::Marks => FrameKind::Marks,
        Subject::Events => FrameKind::Events,
        Subject::Moment => FrameKind::Moment,
        Subject::Markers => FrameKind::Markers,
        Subject::Radio(_) => FrameKind::Radio,
        Subject::Finds(_) => FrameKind::Finds,
        Subject::Track(_) => FrameKind::Track,
        Subject::Look(_) => FrameKind::Look,
        Subject::Tile(_) => FrameKind::Tiles,
        Subject::Stripe(..) => FrameKind::Stripe,
    }
}

/// Returns the text or the record of a subject as the board has it at a moment, of events those behind a number; `None` of what
/// is not there any more, or is of no board.
pub fn bytes(now: Time, board: &Board, subject: Subject, events_after: u64) -> Option<Vec<u8>> {
    let text = match subject {
        Subject::State(id) => return records::state(now, board, id),
        Subject::Radio(pair) => return records::pair(now, board, pair),
        Subject::Tile(address) => return records::tile(board, address),
        Subject::Stripe(of, part) => return records::stripe(board, of, part),
        Subject::Orders => texts::orders(now, board),
        Subject::Ground => texts::ground(now, board),
        Subject::Timetable => texts::timetable(board),
        Subject::Progress => texts::progress(board)?,
        Subject::Marks => texts::marks(now, board),
        Subject::Vehicle(id) => texts::vehicle(board, id)?,
        Subject::Way(id) => texts::way(board, id)?,
        Subject::Plan(id) => texts::plan(board, id)?,
        Subject::Events => texts::events(now, board, events_after)?,
        Subject::Finds(of) => texts::finds(board, of)?,
        Subject::Track(id) => texts::track(board, id)?,
        Subject::Look(id) => board.look(id)?.text(now, id),
        Subject::Moment | Subject::Markers => return None,
    };
    Some(text.into_bytes())
}

/// Returns all that is shown of a board at a moment: two boards of which that is the same are the same to a page.
pub fn everything(now: Time, board: &Board) -> BTreeMap<Subject, Vec<u8>> {
    let of = |subject| Some((subject, bytes(now, board, subject, 0)?));
    board.subjects().into_iter().filter_map(of).collect()
}
