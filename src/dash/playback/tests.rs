//! A board at another time is the board as it was then.

use proptest::prelude::*;
use tomoswarm_proto::Message;

use super::*;
use crate::dash::board::BoardInput;
use crate::geom::Lattice;
use crate::operator::tests_support::{at, heard, state};

fn told(count: u64) -> History {
    let (mut history, mut board) = (History::default(), Board::new(7, Lattice::new(0.1)));
    for sequence in 0..count {
        let mut state = state(1);
        state.sequence = sequence;
        let input = BoardInput::Heard(heard(Message::State(state)));
        history.tell(told_at(sequence), &mut board, &input).unwrap();
    }
    history
}

fn told_at(sequence: u64) -> Time {
    at(10.0 + sequence as f64 / 10.0)
}

/// The sequence of the state that a playback shows, once it has gone all the way; and in how many steps.
fn shown(playback: &mut Playback, history: &History, now_s: f64) -> (Option<u64>, usize) {
    let mut steps = 1;
    while !playback.go_on(history, at(now_s), true) {
        assert_eq!(playback.deadline(history, at(now_s)), Some(at(now_s)));
        steps += 1;
    }
    let state = playback.board().view().state(tomoswarm_proto::VehicleId(1));
    (state.map(|state| state.value.sequence), steps)
}

#[test]
fn it_stands_goes_on_and_ends_at_the_end() {
    let history = told(100);
    let mut playback = Playback::begin(&history, at(500.0), at(12.0), 0.0).unwrap();
    assert_eq!(shown(&mut playback, &history, 500.0).0, Some(20));
    assert_eq!(playback.deadline(&history, at(500.0)), None);
    assert_eq!(playback.moment(&history, at(600.0)), at(12.0));
    playback.go_to(&history, at(600.0), at(11.0), 2.0);
    assert_eq!(shown(&mut playback, &history, 600.0).0, Some(10));
    assert_eq!(shown(&mut playback, &history, 601.05).0, Some(31));
    assert!(playback.deadline(&history, at(601.1)).is_some());
    assert_eq!(shown(&mut playback, &history, 700.0).0, Some(99));
    assert!(playback.is_at_end(&history, at(700.0)));
    assert_eq!(playback.deadline(&history, at(700.0)), None);
}

#[test]
fn a_moment_outside_is_the_nearest_end_and_a_strange_speed_the_nearest_one() {
    let history = told(100);
    for (asked, speed, expected) in [
        (Time::ZERO, -3.0, 0),
        (at(9e8), 1e300, 99),
        (Time::NEVER, 0.0, 99),
    ] {
        let mut playback = Playback::begin(&history, at(0.0), asked, speed).unwrap();
        assert_eq!(shown(&mut playback, &history, 0.0).0, Some(expected));
        playback.go_to(&history, at(0.0), at(12.0), 0.0);
        playback.go_to(&history, at(0.0), asked, speed);
        assert_eq!(shown(&mut playback, &history, 0.0).0, Some(expected));
    }
    assert!(Playback::begin(&History::default(), at(0.0), at(0.0), 1.0).is_none());
}

#[test]
fn a_long_way_is_gone_in_steps() {
    let history = told(30_000);
    let mut playback = Playback::begin(&history, at(0.0), at(10.0 + 819.0), 0.0).unwrap();
    let (sequence, steps) = shown(&mut playback, &history, 0.0);
    // From the copy at the first of 8,192 on.
    assert_eq!((sequence, steps), (Some(8190), 5));
    playback.go_to(&history, at(0.0), at(10.0 + 2900.0), 0.0);
    let (sequence, steps) = shown(&mut playback, &history, 0.0);
    assert_eq!(
        (sequence, steps),
        (Some(29_000), 3),
        "from the copy at 24,576"
    );
}

#[test]
fn while_more_comes_what_has_the_time_of_the_newest_waits() {
    let history = told(100);
    let mut playback = Playback::begin(&history, at(0.0), Time::NEVER, 0.0).unwrap();
    assert!(playback.go_on(&history, at(0.0), false));
    let newest = |playback: &Playback| {
        let board = playback.board().view();
        let state = board.state(tomoswarm_proto::VehicleId(1));
        state.map(|state| state.value.sequence)
    };
    assert_eq!(newest(&playback), Some(98));
    assert!(playback.go_on(&history, at(0.0), true));
    assert_eq!(newest(&playback), Some(99));
}

proptest! {
    #[test]
    fn however_it_gets_there_it_shows_the_moment(ways in prop::collection::vec((0.0..40.0_f64, 0.0..20.0_f64), 1..12)) {
        let history = told(300);
        let mut playback = Playback::begin(&history, at(0.0), at(0.0), 0.0).unwrap();
        let mut now_s = 0.0;
        for (moment_s, speed) in ways {
            playback.go_to(&history, at(now_s), at(moment_s), speed);
            now_s += 0.37;
            let moment = playback.moment(&history, at(now_s));
            let expected = (1..300).take_while(|sequence| told_at(*sequence) <= moment).last().unwrap_or(0);
            prop_assert_eq!(shown(&mut playback, &history, now_s).0, Some(expected));
        }
    }
}
