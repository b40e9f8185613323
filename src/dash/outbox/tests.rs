//! The laws of the outbox, over random lives of it, and its paces.

use std::sync::Arc;

use proptest::prelude::*;
use tomoswarm_proto::{
    Boot, ImageSubject, LayerId, Message, Position, Rectangle, RunId, TileAddress, TileReport,
    VehicleId,
};

use super::*;
use crate::dash::board::BoardInput;
use crate::dash::frame::{STATE, TILE};
use crate::geom::Lattice;
use crate::operator::tests_support::{at, heard, state};

/// One step of a random life of an outbox.
#[derive(Clone, Debug)]
enum Step {
    State(u8, i32),
    Tile(i32, i8),
    Image(i8),
    Credit(u32),
    Wait(u64),
    Take,
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        (1..20_u8, any::<i32>()).prop_map(|(id, x_mm)| Step::State(id, x_mm / 4)),
        (0..30_i32, -17..17_i8).prop_map(|(x, value)| Step::Tile(x, value)),
        any::<i8>().prop_map(Step::Image),
        (1..3_u32).prop_map(Step::Credit),
        (1..120_u64).prop_map(Step::Wait),
        Just(Step::Take),
        Just(Step::Take),
    ]
}

/// The present of a board.
fn shown<'a>(board: &'a Board, now: Time, markers: &'a VecDeque<Event>) -> Shown<'a> {
    Shown {
        board,
        at: now,
        span: (Time::ZERO, now),
        speed: None,
        markers,
    }
}

/// A board, an outbox, and what was said last of everything.
struct Life {
    board: Board,
    outbox: Outbox,
    now: Time,
    count: u32,
}

impl Life {
    fn new() -> Life {
        let board = Board::new(7, Lattice::new(0.1));
        Life {
            outbox: Outbox::new(
                Time::ZERO,
                "{}",
                &shown(&board, Time::ZERO, &VecDeque::new()),
            ),
            board,
            now: Time::ZERO,
            count: 0,
        }
    }

    fn hear(&mut self, message: Message) {
        let input = BoardInput::Heard(heard(message));
        self.board.take(self.now, &input);
        let changes = self.board.take_changes();
        self.outbox.note(&changes);
    }

    fn state(&mut self, id: u8, x_mm: i32) {
        let mut state = state(id);
        state.sequence = u64::from(self.count);
        state.pose.as_mut().unwrap().at.x_mm = x_mm;
        self.hear(Message::State(state));
    }

    /// Cells of all sorts, so that the tile is long.
    fn tile(&mut self, x: i32, value: i8) {
        let cells = std::array::from_fn(|place| if place == 0 { value } else { (place % 7) as i8 });
        let layer = LayerId {
            vehicle: VehicleId(1),
            boot: Boot(1),
        };
        self.hear(Message::Tile(TileReport {
            layer,
            address: TileAddress { slice: 0, x, y: 0 },
            revision: self.count,
            cells: Arc::new(cells),
        }));
    }

    fn image(&mut self, pixel: i8) {
        let corner = |m| Position::from_metres(m, m, 0.0);
        let area = Rectangle {
            least: corner(0.0),
            greatest: corner(4.0),
        };
        self.hear(Message::Image(tomoswarm_proto::Image {
            run: RunId(1),
            sequence: self.count,
            laps: 1,
            subject: ImageSubject::Structure,
            area,
            columns: 64,
            rows: 48,
            part: 0,
            parts: 1,
            mean_step_udb_per_m: 1,
            mean: vec![pixel; 3072],
            deviation_step_udb_per_m: 1,
            deviation: Some(vec![1; 3072]),
            finds: Vec::new(),
            links_used: 1,
            links_dropped: 0,
        }));
    }

    fn take(&mut self) -> Option<Vec<u8>> {
        let markers = VecDeque::new();
        let shown = shown(&self.board, self.now, &markers);
        self.outbox.next(self.now, &shown)
    }
}

fn is(frame: &[u8], kind: FrameKind) -> bool {
    frame[0] == kind as u8
}

/// Returns the x of each vehicle in a frame of states.
fn places(frame: &[u8]) -> Vec<(u8, i32)> {
    let records = frame[HEADER_BYTES..].chunks(STATE.bytes());
    records
        .map(|record| {
            (
                record[0],
                i32::from_le_bytes(record[4..8].try_into().unwrap()),
            )
        })
        .collect()
}

proptest! {
    #[test]
    fn frames_are_short_few_in_order_and_hold_the_newest(steps in prop::collection::vec(step(), 1..300)) {
        let mut life = Life::new();
        let mut newest = std::collections::BTreeMap::new();
        for step in steps {
            life.count += 1;
            match step {
                Step::State(id, x_mm) => { newest.insert(id, x_mm); life.state(id, x_mm) }
                Step::Tile(x, value) => life.tile(x, value),
                Step::Image(pixel) => life.image(pixel),
                Step::Credit(frames) => life.outbox.credit(frames),
                Step::Wait(wait_ms) => life.now = life.now + Duration::from_millis(wait_ms),
                Step::Take => {
                    let before = life.outbox.in_flight();
                    let waiting: Vec<Subject> = life.outbox.waiting.iter().copied().collect();
                    let had_rest = !life.outbox.rest.is_empty();
                    let is_due_at = |rate: usize| life.outbox.rates_at[rate] <= life.now;
                    let (states_due, tiles_due, moment_due) = (is_due_at(0), is_due_at(1), is_due_at(3));
                    let has_turn = |of: usize| life.outbox.passed_over[of] >= PATIENCE[of];
                    let (tiles_turn, stripes_turn) = (has_turn(3), has_turn(4));
                    let frame = life.take();
                    prop_assert!(life.outbox.in_flight() <= IN_FLIGHT_MAX);
                    let Some(frame) = frame else {
                        let is_due = |of: &Subject| match of {
                            Subject::State(_) => states_due,
                            Subject::Tile(_) => tiles_due,
                            Subject::Moment => moment_due,
                            _ => true,
                        };
                        let may = before < IN_FLIGHT_MAX && (had_rest || waiting.iter().any(is_due));
                        prop_assert!(!may, "nothing went: {waiting:?}");
                        continue;
                    };
                    prop_assert!(before < IN_FLIGHT_MAX);
                    prop_assert!(frame.len() <= FRAME_BYTES_MAX);
                    let waits_state = waiting.iter().any(|of| matches!(of, Subject::State(_))) && states_due;
                    let waits_tile = waiting.iter().any(|of| matches!(of, Subject::Tile(_))) && tiles_due;
                    if is(&frame, FrameKind::Tiles) { prop_assert!(!waits_state || tiles_turn); }
                    if is(&frame, FrameKind::Stripe) { prop_assert!(!waits_state && !waits_tile || stripes_turn); }
                    if is(&frame, FrameKind::States) {
                        for (id, x_mm) in places(&frame) {
                            prop_assert_eq!(newest.get(&id), Some(&x_mm));
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn who_gives_credit_gets_everything_and_then_only_signs_of_life(
        vehicles in prop::collection::btree_set(1..100_u8, 0..40),
        tiles in prop::collection::btree_set(0..60_i32, 0..60),
    ) {
        let mut life = Life::new();
        for id in &vehicles { life.count += 1; life.state(*id, 5); }
        for x in &tiles { life.count += 1; life.tile(*x, 3); }
        let (mut seen, mut shown) = (Vec::new(), 0);
        for _ in 0..400 {
            life.now = life.now + Duration::from_millis(60);
            while let Some(frame) = life.take() {
                if is(&frame, FrameKind::States) { seen.extend(places(&frame).into_iter().map(|(id, _)| id)); }
                if is(&frame, FrameKind::Tiles) { shown += usize::from(u16::from_le_bytes([frame[2], frame[3]])); }
            }
            life.outbox.credit(2);
        }
        seen.sort_unstable();
        prop_assert_eq!(seen, vehicles.into_iter().collect::<Vec<u8>>());
        prop_assert_eq!(shown, tiles.len());
        prop_assert_eq!(life.outbox.waiting, [Subject::Moment].into());
    }
}

#[test]
fn without_credit_two_frames_go_and_no_third() {
    let mut life = Life::new();
    life.count = 1;
    life.state(1, 3);
    assert!(is(&life.take().unwrap(), FrameKind::Welcome));
    assert!(is(&life.take().unwrap(), FrameKind::Orders));
    life.now = at(100.0);
    assert_eq!((life.take(), life.outbox.deadline()), (None, None));
    life.outbox.credit(1);
    assert!(is(&life.take().unwrap(), FrameKind::States));
    life.outbox.credit(99);
    assert_eq!(life.outbox.in_flight(), 0);
}

#[test]
fn a_page_that_draws_slowly_while_everything_changes_sees_the_map_and_the_image_all_the_same() {
    let mut life = Life::new();
    let (mut tiles, mut stripes, mut states) = (0, 0, 0);
    for tick in 0..100 {
        // A frame a tick, and each time all states and orders are new.
        life.now = at(f64::from(tick) / 4.0);
        life.count += 1;
        (1..9).for_each(|id| life.state(id, tick));
        life.outbox.note(&[Subject::Orders].into());
        life.tile(tick, 3);
        life.image(tick as i8);
        life.outbox.credit(1);
        let frame = life.take();
        let is = |kind| frame.as_ref().is_some_and(|frame| is(frame, kind));
        states += usize::from(is(FrameKind::States));
        tiles += usize::from(is(FrameKind::Tiles));
        stripes += usize::from(is(FrameKind::Stripe));
    }
    assert!(
        tiles >= 10 && stripes >= 8 && states >= 20,
        "{tiles} {stripes} {states}"
    );
}

#[test]
fn all_have_their_turn_of_those_that_do_not_fit_into_one_frame() {
    let mut life = Life::new();
    let tiles = 0..400;
    let mut seen = std::collections::BTreeSet::new();
    for tick in 0..60 {
        life.now = at(f64::from(tick));
        for x in tiles.clone() {
            life.count += 1;
            life.tile(x, (tick % 17) as i8);
        }
        life.outbox.credit(1);
        life.take();
        let waits = |x: &i32| {
            let is_it = |of: &Subject| matches!(of, Subject::Tile(address) if address.x == *x);
            life.outbox.waiting.iter().any(is_it)
        };
        seen.extend(tiles.clone().filter(|x| !waits(x)));
    }
    assert_eq!(seen.len(), tiles.len(), "all change all the time");
}

#[test]
fn a_page_that_draws_slowly_is_told_which_moment_it_shows_however_much_vehicles_say() {
    let mut life = Life::new();
    let vehicles = (1..9).map(|id| Subject::Vehicle(VehicleId(id)));
    let (mut moments, mut texts) = (0, 0);
    for tick in 0..300 {
        // A frame a tick, and each time the texts of all vehicles are new.
        life.now = at(f64::from(tick) / 4.0);
        life.count += 1;
        (1..9).for_each(|id| life.state(id, tick));
        life.outbox.note(&vehicles.clone().collect());
        life.outbox.credit(1);
        let frame = life.take();
        let is = |kind| frame.as_ref().is_some_and(|frame| is(frame, kind));
        moments += usize::from(is(FrameKind::Moment));
        texts += usize::from(is(FrameKind::Vehicle));
    }
    assert!(moments >= 5 && texts >= 40, "{moments} {texts}");
}

#[test]
fn states_go_ten_times_a_second_however_often_they_change() {
    let mut life = Life::new();
    let mut frames = 0;
    for tick in 0..1000 {
        life.now = at(f64::from(tick) / 100.0);
        life.count += 1;
        life.state(1, tick);
        life.outbox.credit(2);
        while let Some(frame) = life.take() {
            frames += usize::from(is(&frame, FrameKind::States));
        }
    }
    assert!((99..=101).contains(&frames), "{frames} in 10 s");
}

#[test]
fn a_server_with_nothing_to_say_is_heard_once_a_second() {
    let mut life = Life::new();
    let mut beats = 0;
    for tick in 0..100 {
        life.now = at(f64::from(tick) / 10.0);
        life.outbox.credit(2);
        while let Some(frame) = life.take() {
            beats += usize::from(is(&frame, FrameKind::Moment));
        }
    }
    assert!((9..=10).contains(&beats), "{beats} in 10 s");
    assert_eq!(TILE.bytes(), 12);
}

#[test]
fn what_comes_anew_waits_for_no_rate_and_its_end_is_said() {
    let mut life = Life::new();
    for x in 0..1000 {
        life.count += 1;
        life.tile(x, 3);
    }
    life.state(1, 5);
    while life.take().is_some() {
        life.outbox.credit(2);
    }
    life.outbox.show_anew(life.now, &life.board);
    let mut kinds = Vec::new();
    let mut moments = Vec::new();
    while let Some(frame) = life.take() {
        life.outbox.credit(1);
        kinds.push(frame[0]);
        if is(&frame, FrameKind::Moment) {
            let text: serde_json::Value = serde_json::from_slice(&frame[HEADER_BYTES..]).unwrap();
            moments.push((text["isAnew"].clone(), text["isWhole"].clone()));
        }
    }
    let tiles = kinds.iter().filter(|kind| **kind == FrameKind::Tiles as u8);
    assert!(tiles.count() > 2, "at one time: {kinds:?}");
    assert_eq!(kinds.first(), Some(&(FrameKind::Moment as u8)));
    assert_eq!(kinds.last(), Some(&(FrameKind::Moment as u8)));
    let expected = [(true, false), (false, true)];
    assert_eq!(
        moments,
        expected.map(|(anew, whole)| (anew.into(), whole.into()))
    );
}
