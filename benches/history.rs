//! What a swarm of eight said for some time, kept by the operator's page: how long it takes to show any moment of it, and how
//! much memory it takes. `cargo bench --no-default-features --bench history`; `-- 6` = six hours in place of fifty minutes,
//! `-- 6 20` = with at most 20 MiB.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    reason = "no product code"
)]

#[path = "eight/mod.rs"]
mod eight;

use std::collections::BTreeMap;
use std::rc::Rc;
use std::time::{Duration, Instant};

use tomoswarm::dash::board::{Board, BoardInput};
use tomoswarm::dash::history::{HISTORY_BYTES_MAX, History};
use tomoswarm::dash::playback::Playback;
use tomoswarm::geom::Lattice;
use tomoswarm::operator::HeardMessage;
use tomoswarm::sim::bus::BusListener;
use tomoswarm::time::Time;
use tomoswarm_proto::codec;

const HOURS: f64 = 50.0 / 60.0;
const MOMENTS: u32 = 200;

fn kind(heard: &HeardMessage) -> String {
    match heard {
        HeardMessage::Message(_, message) => format!("{:?}", message.kind()),
        HeardMessage::Greeting(..) | HeardMessage::Unknown(_) => "other".to_owned(),
    }
}

fn main() {
    let numbers: Vec<f64> = std::env::args()
        .filter_map(|arg| arg.parse().ok())
        .collect();
    let hours = numbers.first().copied().unwrap_or(HOURS);
    let mib = numbers.get(1).map(|mib| *mib as usize);
    let bytes_max = mib.map_or(HISTORY_BYTES_MAX, |mib| mib << 20);
    let scenario = eight::scenario(hours * 3600.0);
    let lattice = Lattice::new(scenario.sim().venue.cell_m);
    let board = Board::new(scenario.sim().venue.hash(), lattice);
    let kept = Rc::new(std::cell::RefCell::new((History::new(bytes_max), board)));
    let spent = Rc::new(std::cell::RefCell::new(BTreeMap::<
        String,
        (u64, usize, Duration),
    >::new()));
    let longest = Rc::new(std::cell::Cell::new(Duration::ZERO));
    let (tell, count, most) = (kept.clone(), spent.clone(), longest.clone());
    let listener = BusListener::new(move |now, heard| {
        let (history, board) = &mut *tell.borrow_mut();
        let input = BoardInput::Heard(heard.clone());
        let bytes = codec::pack(&input).expect("it can be packed").len();
        let began = Instant::now();
        history.tell(now, board, &input).expect("it can be packed");
        let mut count = count.borrow_mut();
        let (inputs, all_bytes, time) = count.entry(kind(heard)).or_default();
        *inputs += 1;
        *all_bytes += bytes;
        let took = began.elapsed();
        *time += took;
        most.set(most.get().max(took));
    });
    let ended = scenario.run_heard(&mut |_| true, listener);
    ended.expect("it runs");
    let (history, board) = &*kept.borrow();
    let (from, to) = history.span().expect("something was said");
    println!(
        "what eight vehicles said is kept of the last {:.1} min; the history takes {:.1} MB of {} MB, a copy of the board {:.2} MB without its plans",
        to.since(from).as_secs_f64() / 60.0,
        history.bytes() as f64 / 1e6,
        bytes_max >> 20,
        board.bytes() as f64 / 1e6
    );
    for (kind, (inputs, bytes, time)) in spent.borrow().iter() {
        let each_us = time.as_secs_f64() * 1e6 / *inputs as f64;
        let mb = *bytes as f64 / 1e6;
        println!(
            "  {kind:10} {inputs:8} inputs of {mb:6.2} MB, {each_us:6.1} us each to take and keep"
        );
    }
    println!("  the longest: {:.1?}", longest.get());
    let mut ages_s = Vec::new();
    let mut times: Vec<Duration> = (0..MOMENTS)
        .map(|place| {
            // Back and forth, so that no moment is near the one before.
            let share = f64::from(place * 89 % MOMENTS) / f64::from(MOMENTS);
            let moment = from + to.since(from).mul_f64(share);
            let began = Instant::now();
            let playback = Playback::begin(history, Time::ZERO, moment, 0.0);
            let mut playback = playback.expect("there is a history");
            while !playback.go_on(history, Time::ZERO, true) {}
            let took = began.elapsed();
            let states = playback.board().view().vehicles();
            let ages = states.filter_map(|(_, seen)| Some(moment.since(seen.state.as_ref()?.at)));
            ages_s.extend(ages.map(|age| age.as_secs_f64()));
            took
        })
        .collect();
    times.sort();
    let (median, most) = (times[times.len() / 2], times[times.len() - 1]);
    ages_s.sort_by(f64::total_cmp);
    let (half, last) = (ages_s[ages_s.len() / 2], ages_s[ages_s.len() * 95 / 100]);
    println!("states are {half:.2} s old there (median), {last:.2} s (95 %)");
    println!("a moment is had in {median:.1?} (median), {most:.1?} at most, of {MOMENTS}");
}
