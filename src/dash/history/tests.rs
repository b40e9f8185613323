//! Told again up to any moment, a board is the board as it was; thinned, it is at most an interval older.

use std::sync::Arc;

use proptest::prelude::*;
use tomoswarm_proto::{
    Boot, Health, ImageSubject, Lease, LogLine, LogLines, LogSeverity, Mark, Message, OpenStops,
    OperatorId, Position, Rectangle, RunId, Sender, TILE_CELLS, TileReport, VehicleId,
};

use super::*;
use crate::dash::contents::everything;
use crate::dash::marks::MarkOrder;
use crate::dash::orders::OrderRequest;
use crate::geom::Lattice;
use crate::operator::given_marks::MarkOutcome;
use crate::operator::tests_support::{at, heard, report, state};

fn board() -> Board {
    Board::new(7, Lattice::new(0.1))
}

fn state_of(id: u8, sequence: u64, is_landed: bool) -> BoardInput {
    let mut state = state(id);
    (state.sequence, state.is_landed) = (sequence, is_landed);
    BoardInput::Heard(heard(Message::State(state)))
}

fn tile(x: i32, revision: u32, value: i8) -> BoardInput {
    let layer = LayerId {
        vehicle: VehicleId(1),
        boot: Boot(1),
    };
    BoardInput::Heard(heard(Message::Tile(TileReport {
        layer,
        address: TileAddress { slice: 0, x, y: 0 },
        revision,
        cells: Arc::new([value; TILE_CELLS]),
    })))
}

fn health(id: u8, trouble: bool) -> BoardInput {
    BoardInput::Heard(heard(Message::Health(Health {
        vehicle: VehicleId(id),
        boot: Boot(1),
        troubles: trouble.then(|| "no echo".to_owned()).into_iter().collect(),
        ..Health::default()
    })))
}

/// A line of a vehicle's log.
fn line(number: u32) -> BoardInput {
    let line = LogLine {
        number,
        age_ms: 0,
        severity: LogSeverity::Error,
        text: "nobody listens".to_owned(),
    };
    let log = LogLines {
        node: Sender::Vehicle(VehicleId(1)),
        instance: 7,
        lines: vec![line],
    };
    BoardInput::Heard(heard(Message::Log(log)))
}

fn image(sequence: u32) -> BoardInput {
    let corner = |m| Position::from_metres(m, m, 0.0);
    BoardInput::Heard(heard(Message::Image(tomoswarm_proto::Image {
        run: RunId(1),
        sequence,
        laps: 1,
        subject: ImageSubject::Structure,
        area: Rectangle {
            least: corner(0.0),
            greatest: corner(4.0),
        },
        columns: 8,
        rows: 8,
        part: 0,
        parts: 1,
        mean_step_udb_per_m: 1,
        mean: vec![sequence as i8; 64],
        deviation_step_udb_per_m: 1,
        deviation: None,
        finds: Vec::new(),
        links_used: 1,
        links_dropped: 0,
    })))
}

fn order() -> BoardInput {
    BoardInput::Ordered(OrderRequest::read(br#"{"order":"hold","page":1,"vehicles":[1]}"#).unwrap())
}

fn mark(x_m: i32, stands: bool, is_stored: bool) -> BoardInput {
    let sender = match is_stored {
        true => Sender::Ground,
        false => Sender::Operator(OperatorId(2)),
    };
    let mark = Mark {
        run: RunId(1),
        at: Position::from_metres(f64::from(x_m), 1.0, 0.0),
        stands,
    };
    BoardInput::Heard(HeardMessage::Message(sender, Message::Mark(mark)))
}

fn mark_given() -> BoardInput {
    BoardInput::MarkGiven(MarkOrder::read(br#"{"at":[1,2],"page":1}"#).unwrap())
}

fn ground(laps_done: u32) -> BoardInput {
    let report = tomoswarm_proto::GroundReport {
        laps_done,
        lease: Lease::default(),
        ..report()
    };
    BoardInput::Heard(heard(Message::Report(report)))
}

fn input() -> impl Strategy<Value = BoardInput> {
    prop_oneof![
        4 => (1..4_u8, any::<bool>()).prop_map(|(id, landed)| state_of(id, 0, landed)),
        3 => (0..4_i32, -17..17_i8).prop_map(|(x, value)| tile(x, 0, value)),
        2 => (1..4_u8, any::<bool>()).prop_map(|(id, trouble)| health(id, trouble)),
        1 => Just(image(0)),
        1 => Just(order()),
        2 => (0..2_i32, any::<bool>(), any::<bool>()).prop_map(|(x, stands, stored)| mark(x, stands, stored)),
        1 => Just(mark_given()),
        1 => (1..4_u32).prop_map(|number| BoardInput::MarkEnded(number, MarkOutcome::NoRun)),
        1 => (0..3_u32).prop_map(ground),
        1 => any::<bool>().prop_map(BoardInput::Linked),
        1 => Just(BoardInput::Heard(heard(Message::Standing(OpenStops::default())))),
    ]
}

/// Numbers that count on, as those who say something do.
fn numbered(input: BoardInput, number: u32) -> BoardInput {
    match input {
        BoardInput::Heard(HeardMessage::Message(sender, message)) => {
            let message = match message {
                Message::State(mut state) => {
                    state.sequence = number.into();
                    Message::State(state)
                }
                Message::Tile(mut tile) => {
                    tile.revision = number;
                    Message::Tile(tile)
                }
                Message::Image(mut image) => {
                    image.sequence = number;
                    Message::Image(image)
                }
                other => other,
            };
            BoardInput::Heard(HeardMessage::Message(sender, message))
        }
        other => other,
    }
}

/// A board that is told everything before a moment again, in steps of so many inputs.
fn told_again(history: &History, moment: Time, most: usize) -> Board {
    let until = moment + Duration::from_nanos(1);
    // Nothing is kept of a time in which nothing new was said.
    let before = history.board_before(moment);
    let (mut board, mut from) =
        before.map_or((board(), until), |(board, from)| (board.clone(), from));
    while from < until {
        from = history.tell_again(&mut board, from, until, most);
    }
    board
}

proptest! {
    #[test]
    fn told_again_up_to_any_moment_a_board_is_as_it_was(
        inputs in prop::collection::vec((input(), 0..3_u64), 1..200),
        most in 1..50_usize,
    ) {
        let (mut history, mut present) = (History::default(), board());
        let (mut now, mut was) = (at(5.0), Vec::new());
        for (number, (input, after)) in inputs.into_iter().enumerate() {
            // Several at one time, too.
            now = now + Duration::from_millis(200 * after);
            let input = numbered(input, number as u32 + 1);
            history.tell(now, &mut present, &input).unwrap();
            was.push((now, everything(now, &present)));
        }
        for (index, (moment, expected)) in was.iter().enumerate() {
            let is_last_of_its_time = was.get(index + 1).is_none_or(|(next, _)| next > moment);
            if is_last_of_its_time {
                prop_assert_eq!(&everything(*moment, &told_again(&history, *moment, most)), expected);
            }
        }
    }
}

/// Ten minutes of a swarm: ten states a second, a tile a second, now and then something that makes an event.
fn ten_minutes(bytes_max: usize) -> (History, Board) {
    let (mut history, mut present) = (History::new(bytes_max), board());
    for tick in 0..60_000_u64 {
        let now = at(tick as f64 / 100.0);
        let input = match tick % 100 {
            0 => tile((tick / 100 % 4) as i32, tick as u32 + 1, 5),
            50 => health(1, tick % 2000 < 1000),
            _ => state_of((tick % 5) as u8 + 1, tick, false),
        };
        history.tell(now, &mut present, &input).unwrap();
    }
    (history, present)
}

#[test]
fn a_history_that_is_too_large_is_thinned_from_its_oldest_part_on_and_keeps_events() {
    let (whole, present) = ten_minutes(usize::MAX);
    let (thinned, _) = ten_minutes(whole.bytes() / 2);
    // It is looked at when a part begins.
    let newest = thinned.parts.back().unwrap().packed.len();
    let room = whole.bytes() / 2 + newest;
    assert!(thinned.bytes() <= room, "{} {room}", thinned.bytes());
    assert_eq!(thinned.span(), whole.span());
    let age_of = |history: &History, moment: Time| {
        let board = told_again(history, moment, 5000);
        let ages = (1..=5).map(|id| board.view().state(VehicleId(id)).unwrap().age(moment));
        (ages.max().unwrap(), board.events().last())
    };
    for moment_s in [20.005, 123.455, 300.005, 599.985] {
        let moment = at(moment_s);
        let ((age, events), (was, events_were)) =
            (age_of(&thinned, moment), age_of(&whole, moment));
        assert!(age <= was + THINNED[0], "{moment_s}: {age:?}, {was:?}");
        assert_eq!(events, events_were, "at {moment_s}");
    }
    // The newest is whole.
    let last = whole.span().unwrap().1;
    assert_eq!(
        everything(last, &told_again(&thinned, last, 5000)),
        everything(last, &present)
    );
}

#[test]
fn a_history_of_little_room_forgets_its_beginning_and_stays_within_it() {
    let few = 400 << 10;
    let (history, _) = ten_minutes(few);
    // The newest parts are whole in any case.
    let newest: usize = history
        .parts
        .iter()
        .rev()
        .take(PARTS_KEPT)
        .map(Part::bytes)
        .sum();
    assert!(
        history.bytes() <= few.max(newest) + (1 << 20),
        "{}",
        history.bytes()
    );
    let (from, to) = history.span().unwrap();
    assert!(from > at(60.0) && to == at(599.99), "{from} {to}");
    assert!(history.markers().len() > 20);
}

/// Ten minutes of states, a mark at their beginning that is said on for a while, and that it is taken back in their middle.
fn ten_minutes_with_a_mark(bytes_max: usize) -> History {
    let (mut history, mut present) = (History::new(bytes_max), board());
    let mut tell = |at_s: f64, input: BoardInput| {
        history.tell(at(at_s), &mut present, &input).unwrap();
        history.bytes()
    };
    let bytes = tell(0.0, mark(1, true, true));
    for tick in 1..100 {
        let after = tell(f64::from(tick) / 5.0, mark(1, true, false));
        assert_eq!(after, bytes, "it is stored already");
    }
    for tick in 0..60_000_u64 {
        let at_s = 30.0 + tick as f64 / 100.0;
        tell(at_s, state_of((tick % 5) as u8 + 1, tick, false));
        if tick == 30_000 {
            tell(at_s, mark(1, false, true));
        }
    }
    history
}

#[test]
fn where_somebody_was_marked_stays_in_a_thinned_history_and_what_is_said_again_takes_no_room() {
    let whole = ten_minutes_with_a_mark(usize::MAX);
    let thinned = ten_minutes_with_a_mark(whole.bytes() / 2);
    assert!(thinned.bytes() < whole.bytes() * 3 / 4);
    assert_eq!(thinned.span(), whole.span());
    for history in [&whole, &thinned] {
        let known = |moment_s: f64| {
            let board = told_again(history, at(moment_s), 5000);
            board.marks().known().count()
        };
        let counts = [20.0, 320.0, 331.0, 600.0].map(known);
        assert_eq!(counts, [1, 1, 0, 0]);
        let kinds = history.markers().iter().map(|marker| marker.kind);
        let of_marks = kinds.filter(|kind| *kind == EventKind::Mark).count();
        assert_eq!(of_marks, 2);
    }
}

#[test]
fn marks_are_troubles_orders_and_images_and_the_oldest_go_first() {
    let (mut history, mut present) = (History::default(), board());
    history
        .tell(at(1.0), &mut present, &state_of(1, 1, false))
        .unwrap();
    for number in 0..MARKERS_MAX as u32 + 5 {
        let now = at(2.0 + f64::from(number));
        history.tell(now, &mut present, &image(number + 1)).unwrap();
    }
    history
        .tell(at(5000.0), &mut present, &health(1, true))
        .unwrap();
    for number in 1..=2 * MARKERS_MAX as u32 {
        history
            .tell(at(5001.0), &mut present, &line(number))
            .unwrap();
    }
    let notes = present.events().after(0);
    assert!(notes.filter(|event| event.kind == EventKind::Note).count() > 100);
    let markers = history.markers();
    assert_eq!(markers.len(), MARKERS_MAX);
    assert_eq!(markers.back().unwrap().kind, EventKind::Trouble);
    assert_eq!(markers.front().unwrap().at, at(2.0 + 6.0));
}

#[test]
fn of_what_a_vehicle_hears_the_later_look_replaces_the_one_before() {
    let look = |id| {
        BoardInput::Heard(heard(Message::Look(tomoswarm_proto::Look {
            vehicle: VehicleId(id),
            half_angle: tomoswarm_proto::Heading(2618),
            max_range_mm: 4000,
            readings: Vec::new(),
        })))
    };
    assert!(replaced(&look(1)).is_some() && replaced(&look(1)) == replaced(&look(1)));
    assert!(replaced(&look(1)) != replaced(&look(2)));
}
