//! Recordings of a live swarm as the page shows them: of a run that ended in order, and of vehicles that were killed.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tomoswarm::operator::HeardMessage;
use tomoswarm::store::recording::what_was_said;
use tomoswarm_proto::{Boot, Message, StandReason, State, VehicleId};

use crate::browser::Browser;
use crate::dash::{Dash, prepared};
use crate::recorded_page::Served;
use crate::swarm::{Swarm, vehicle};

/// What a page shows in what a live one and one of recordings can both know: no ages, no names (of vehicle files), no page's own
/// orders and seat, and of what happened no node's log, of which recordings have other lines, nor since when somebody is heard.
const BOARD: &str = "(() => { const { model } = tomoswarm, { place } = model;
    const digest = (numbers) => numbers.reduce((sum, n) => Math.imul(sum ^ Math.round(n * 1e6), 16777619) >>> 0, 2166136261);
    const sorted = (map, of) => [...map].sort(([one], [other]) => String(one).localeCompare(String(other))).map(of);
    const peak = (image) => image.mean.indexOf(Math.max(...image.mean));
    return {
      states: sorted(model.states, ([, s]) => [s.id, place.modes[s.mode], s.standsUnder, s.isAtRest, s.isArmed, s.isLanded]),
      places: sorted(model.states, ([, s]) => [s.x, s.y]),
      vehicles: sorted(model.vehicles, ([, { id, boot, run, revision, ordered, control, mission }]) =>
        ({ id, boot, run, revision, ordered, control, mission })),
      ways: sorted(model.ways, (way) => way),
      plans: sorted(model.plans, ([, plan]) => plan),
      tiles: sorted(model.tiles, ([key, tile]) => `${key} ${digest(tile.cells)}`),
      images: sorted(model.images, ([subject, i]) => [subject, i.run, i.sequence, i.laps, peak(i), digest(i.mean), digest(i.deviation)]),
      finds: sorted(model.finds, ([subject, { run, sequence, finds }]) => [subject, run, sequence, finds]),
      stops: model.orders.stops.map(({ name, vehicle, by, shown, not_shown }) => [name, vehicle, by, shown, not_shown]),
      ground: [model.ground?.phase, model.ground?.run, model.ground?.laps, model.ground?.members, model.ground?.runs],
      events: model.events.filter(({ kind, text }) => ['change', 'trouble', 'image'].includes(kind) && !text.startsWith('is heard'))
        .map(({ kind, vehicles, text }) => `${kind} ${vehicles} ${text}`).sort(),
    }; })()";

/// Takes where vehicles stand off a board: of them that is known more or less.
fn take_places(board: &mut Value) -> Vec<[f64; 2]> {
    serde_json::from_value(board["places"].take()).unwrap()
}

/// Returns what a page shows, but for tiles, when nothing of it has changed for two seconds, and where the vehicles stand.
fn settled(browser: &mut Browser) -> (Value, Vec<[f64; 2]>) {
    let (began, mut since, mut last) = (Instant::now(), Instant::now(), json!({}));
    let mut places_m = Vec::new();
    while since.elapsed() < Duration::from_secs(2) {
        let mut board = browser.eval(BOARD);
        places_m = take_places(&mut board);
        // Vehicles at rest look around, and cells that they saw once change now and then until they end.
        board["tiles"].take();
        if board != last {
            let parts = board.as_object().unwrap().iter();
            let changed: Vec<&String> = parts
                .filter(|(of, shown)| last[of.as_str()] != **shown)
                .map(|(of, _)| of)
                .collect();
            println!("{:?}: {changed:?}", began.elapsed());
            (since, last) = (Instant::now(), board);
        }
        assert!(began.elapsed() < Duration::from_secs(30), "no rest: {last}");
        std::thread::sleep(Duration::from_millis(100));
    }
    (last, places_m)
}

/// Returns the tiles of a page as nodes that have ended have said them, when nothing of them has changed for a second.
fn ended_tiles(browser: &mut Browser) -> Value {
    let (mut since, mut last) = (Instant::now(), json!([]));
    while since.elapsed() < Duration::from_secs(1) {
        let tiles = browser.eval(BOARD)["tiles"].take();
        if tiles != last {
            (since, last) = (Instant::now(), tiles);
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    last
}

fn stands_under_a_stop(state: &State) -> bool {
    matches!(state.stands_under, Some(StandReason::Stop(_))) && state.is_at_rest
}

#[test]
fn a_live_run_and_its_recordings_end_on_the_same_board() {
    let Some(mut browser) = Browser::open(1280, 800) else {
        return;
    };
    let mut swarm = prepared();
    let dash = Dash::start(&mut swarm);
    swarm.run();
    browser.go(&dash.operate);
    swarm.begin();
    browser.until("tomoswarm.model.images.has(0)", 60);
    browser.key(" ", "Space", 32);
    swarm.until("everyone stands under a stop", 10, |watch| {
        let states = (1..=2).map(|id| watch.view.state(VehicleId(id)));
        states
            .flatten()
            .filter(|state| stands_under_a_stop(&state.value))
            .count()
            == 2
    });
    let (mut live, stood_m) = settled(&mut browser);
    swarm.end_in_order();
    live["tiles"] = ended_tiles(&mut browser);

    let served = Served::start(swarm.folder.path());
    browser.go(&served.dash.look);
    browser.until("document.title.startsWith('REPLAY')", 10);
    browser.key("n", "KeyN", 78);
    browser.until("tomoswarm.model.isWhole() && tomoswarm.model.images.has(0) && tomoswarm.model.orders.stops.length > 0", 20);
    let (mut replayed, stand_m) = settled(&mut browser);
    replayed["tiles"] = ended_tiles(&mut browser);
    for of in [
        "states", "vehicles", "plans", "tiles", "images", "stops", "events",
    ] {
        let count = live[of].as_array().unwrap().len();
        assert!(count > 0, "nothing is compared: {of}");
    }
    for (of, shown) in live.as_object().unwrap() {
        assert_eq!(shown, &replayed[of], "{of}");
    }
    for (stood, stands) in stood_m.iter().zip(&stand_m) {
        let off_m = (stood[0] - stands[0]).hypot(stood[1] - stands[1]);
        assert!(off_m < 0.3, "{stood:?} and {stands:?}");
    }
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// Returns the recordings of a vehicle, oldest first.
fn recordings_of(swarm: &Swarm, id: u8) -> Vec<PathBuf> {
    let folder = std::fs::read_dir(swarm.path(&format!("state-{id}/flight"))).unwrap();
    let mut files: Vec<PathBuf> = folder.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// Returns what a vehicle has said of itself last, as the swarm's operator has heard it.
fn last_state(swarm: &Swarm, id: u8) -> State {
    swarm.look(|watch| watch.view.state(VehicleId(id)).unwrap().value.clone())
}

#[test]
fn vehicles_that_were_killed_are_shown_up_to_their_last_words() {
    let mut swarm = prepared();
    swarm.run();
    swarm.begin();
    let moves = |id: u8| {
        move |watch: &crate::swarm::Watch| {
            let state = watch.view.state(VehicleId(id));
            state.is_some_and(|state| !state.value.is_at_rest)
        }
    };
    swarm.until("vehicle 1 drives", 20, moves(1));
    // What was said in the half second before it is killed may not be written out yet.
    std::thread::sleep(Duration::from_millis(1500));
    let first = last_state(&swarm, 1);
    swarm.kill("vehicle-1");
    swarm.restart(vehicle(1));
    swarm.until("vehicle 1 is there again", 20, |watch| {
        let state = watch.view.state(VehicleId(1));
        state.is_some_and(|state| state.value.boot > first.boot && state.value.sequence > 5)
    });
    let last = [1, 2].map(|id| last_state(&swarm, id));
    for name in ["vehicle-1", "vehicle-2"] {
        swarm.kill(name);
    }
    swarm.end_in_order();

    let of_1 = recordings_of(&swarm, 1);
    let of_2 = recordings_of(&swarm, 2);
    let files: Vec<PathBuf> = of_1.iter().chain(&of_2).cloned().collect();
    let run = what_was_said(&files).unwrap();
    // Of each start the last segment.
    let unfinished = run
        .notes
        .iter()
        .filter(|note| note.contains("ends unfinished"));
    assert_eq!(unfinished.count(), 3, "{:?}", run.notes);
    for file in [&of_1[0], of_1.last().unwrap(), of_2.last().unwrap()] {
        let note = format!("{}: ends unfinished at byte ", file.display());
        let is_it = |of: &&String| of.starts_with(&note) && of.ends_with("shown up to there");
        assert_eq!(run.notes.iter().filter(is_it).count(), 1, "{:?}", run.notes);
    }
    let said = |id: u8, boot: Boot| -> Vec<&State> {
        let states = run.heard.iter().filter_map(|(_, heard)| match heard {
            HeardMessage::Message(_, Message::State(state)) => Some(state),
            _ => None,
        });
        let is_of = |state: &&State| (state.vehicle, state.boot) == (VehicleId(id), boot);
        states.filter(is_of).collect()
    };
    for heard in [&first, &last[0], &last[1]] {
        let states = said(heard.vehicle.0, heard.boot);
        // A recording is written out twice a second, and a state is said five times a second.
        let newest = states.last().unwrap().sequence;
        assert!(newest + 8 >= heard.sequence, "{newest}: {heard:?}");
        assert!(states.iter().any(|state| state.pose.is_some()), "{heard:?}");
    }
    let drove = said(1, first.boot).iter().any(|state| !state.is_at_rest);
    assert!(drove, "what it did before it was killed is there");

    let served = Served::start(swarm.folder.path());
    let Some(mut browser) = Browser::open(1280, 800) else {
        return;
    };
    browser.go(&served.dash.look);
    browser.until("document.title.startsWith('REPLAY')", 10);
    browser.key("n", "KeyN", 78);
    let boot = "tomoswarm.model.vehicles.get(1)?.boot";
    browser.until(&format!("{boot} === {}", last[0].boot.0), 10);
    browser.until(
        "tomoswarm.model.events.some(({ vehicles, text }) => vehicles[0] === 1 && text === 'was started anew')",
        10,
    );
    assert_eq!(
        browser.eval("[...tomoswarm.model.states.keys()].sort()"),
        json!([1, 2])
    );
    assert_eq!(browser.complaints, Vec::<String>::new());
}
