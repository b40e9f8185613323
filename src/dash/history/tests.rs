//! Told again up to any moment, a board is the board as it was; thinned, it is at most an interval older.

use std::sync::Arc;

use proptest::prelude::*;
use tomoswarm_proto::{
    Boot, Health, ImageSubject, LayerId, Lease, LogLine, LogLines, LogSeverity, Mark, Message,
    OpenStops, OperatorId, Plan, Position, Rectangle, Revision, RunId, Sender, Stop, StopId,
    TILE_CELLS, TileAddress, TileReport, VehicleId,
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

/// A plan of stops at places that are hard to compress.
fn plan(id: u8, revision: u32, stops: u32) -> BoardInput {
    let stop = |number: u32| {
        let place = |by: u32| f64::from(number.wrapping_mul(by) % 100_000) / 1000.0;
        Stop {
            id: StopId(number),
            at: Position::from_metres(place(2_654_435_761), place(2_246_822_519), 0.0),
            route: Vec::new(),
            dwell_ms: 0,
            dwell_limit_ms: 0,
            partners: Vec::new(),
            after: Vec::new(),
        }
    };
    BoardInput::Heard(heard(Message::Plan(Plan {
        vehicle: VehicleId(id),
        run: RunId(1),
        revision: Revision(revision),
        members: vec![VehicleId(1), VehicleId(2)],
        stops: (0..stops).map(stop).collect(),
        ..Plan::default()
    })))
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
        before.map_or((board(), until), |(board, from)| (board.board(), from));
    let mut inflated = InflatedPart::default();
    while from < until {
        from = history.tell_again(&mut board, &mut inflated, from, until, most);
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
    let newest = thinned.parts.back().unwrap().bytes(None);
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
    let few = 100 << 10;
    let (history, _) = ten_minutes(few);
    // The newest parts are whole in any case.
    let newest: usize = history
        .parts
        .iter()
        .rev()
        .take(PARTS_KEPT)
        .map(|part| part.bytes(None))
        .sum();
    assert!(history.bytes() <= few + newest, "{}", history.bytes());
    let (from, to) = history.span().unwrap();
    assert!(from > at(60.0) && to == at(599.99), "{from} {to}");
    assert!(history.markers().len() > 20);
}

/// So many states, a hundred a second.
fn tell_states(history: &mut History, present: &mut Board, ticks: std::ops::Range<u64>) {
    for tick in ticks {
        let state = state_of((tick % 5) as u8 + 1, tick, false);
        history
            .tell(at(tick as f64 / 100.0), present, &state)
            .unwrap();
    }
}

#[test]
fn plans_of_parts_that_were_compressed_are_as_they_were() {
    let (mut history, mut present) = (History::default(), board());
    let mut was = Vec::new();
    for thousand in 0..25_u64 {
        // Copies of the board share plans now and then.
        if thousand % 5 == 0 {
            for id in [1, 2] {
                let plan = plan(id, thousand as u32 + 1, 30 + thousand as u32);
                history
                    .tell(at(thousand as f64 * 10.0), &mut present, &plan)
                    .unwrap();
            }
        }
        tell_states(
            &mut history,
            &mut present,
            thousand * 1000..(thousand + 1) * 1000,
        );
        let moment = history.span().unwrap().1;
        was.push((moment, everything(moment, &present)));
    }
    assert!(history.parts.len() > 3, "{} parts", history.parts.len());
    for (moment, expected) in was {
        assert_eq!(
            everything(moment, &told_again(&history, moment, 999)),
            expected
        );
    }
}

#[test]
fn plans_that_all_parts_share_are_counted_after_the_first_part_is_gone() {
    let bytes = |plans: u8| {
        // No room: only the newest parts are kept.
        let (mut history, mut present) = (History::new(0), board());
        for id in 1..=plans {
            history
                .tell(Time::ZERO, &mut present, &plan(id, 1, 4000))
                .unwrap();
        }
        tell_states(&mut history, &mut present, 0..50_000);
        assert_eq!(history.parts.len(), PARTS_KEPT);
        history.bytes()
    };
    let (with, without) = (bytes(1), bytes(0));
    assert!(with > without + 20_000, "{with} {without}");
}

#[test]
fn who_reads_on_while_parts_are_thinned_and_joined_reads_the_same_as_who_comes_anew() {
    let (mut history, mut present) = (History::new(300 << 10), board());
    let (mut held, mut least_parts, mut most_thinned) = (InflatedPart::default(), usize::MAX, 0);
    for step in 0..30_u64 {
        tell_states(&mut history, &mut present, step * 2000..(step + 1) * 2000);
        let (from, to) = history.span().unwrap();
        for share in [0.02, 0.5] {
            let moment = from + to.since(from).mul_f64(share);
            let (snapshot, before) = history.board_before(moment).unwrap();
            let mut board = snapshot.board();
            let mut told = before;
            while told < moment {
                told = history.tell_again(&mut board, &mut held, told, moment, 4000);
            }
            let anew = told_again(&history, moment - Duration::from_nanos(1), 4000);
            assert_eq!(everything(moment, &board), everything(moment, &anew));
        }
        most_thinned = history
            .parts
            .iter()
            .map(Part::thinned)
            .max()
            .max(Some(most_thinned))
            .unwrap();
        if most_thinned > 1 {
            least_parts = least_parts.min(history.parts.len());
        }
    }
    assert!(
        most_thinned > 1 && least_parts < 7,
        "{most_thinned} {least_parts}"
    );
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
