//! The page of a recording (`dash --replay`), and looking back at a simulation: any moment, any speed, no orders.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use tomoswarm::config::{self, Sim};
use tomoswarm::dash::board::{Board, BoardInput, Subject};
use tomoswarm::dash::contents;
use tomoswarm::dash::ghost::began;
use tomoswarm::dash::history::History;
use tomoswarm::dash::playback::Playback;
use tomoswarm::dash::texts;
use tomoswarm::geom::Lattice;
use tomoswarm::operator::HeardMessage;
use tomoswarm::sim::Scenario;
use tomoswarm::sim::bus::BusListener;
use tomoswarm::store::recording::what_was_said;
use tomoswarm::time::Time;
use tomoswarm_proto::{Message, Position, Sender, VehicleId};

use crate::browser::Browser;
use crate::dash::{Dash, shot, view};
use crate::swarm::PROGRAM;

const CONFIG: &str = "configs/small.sim.toml";

fn tomoswarm(args: &[&str]) -> Command {
    let mut command = Command::new(PROGRAM);
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(args);
    command
}

/// Records the small scenario; returns the folder of its recordings.
fn recorded(folder: &Path) -> PathBuf {
    recorded_as(folder, "run", &[])
}

/// Records it with further options, in a folder of a name.
fn recorded_as(folder: &Path, name: &str, options: &[&str]) -> PathBuf {
    let run = folder.join(name);
    let mut command = tomoswarm(&["sim", CONFIG, "--record", "--no-pictures", "--out"]);
    let output = command.arg(&run).args(options).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    run.join("flight")
}

/// A page of a recording that is served.
pub struct Served {
    child: Child,
    pub dash: Dash,
}

impl Served {
    pub fn start(folder: &Path) -> Served {
        Served::beside(folder, None)
    }

    /// Beside another run.
    fn beside(folder: &Path, other: Option<&Path>) -> Served {
        let mut command = tomoswarm(&["dash", "--port", "0", "--replay"]);
        command.arg(folder).stdout(Stdio::piped());
        if let Some(other) = other {
            command.arg("--ghost").arg(other);
        }
        let mut child = command.spawn().unwrap();
        let mut line = String::new();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        out.read_line(&mut line).unwrap();
        let link = line.split_whitespace().last().unwrap().to_owned();
        assert!(link.contains("/#look="), "{line}");
        let dash = Dash::at(link);
        Served { child, dash }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// All that a page would be shown of a board at a moment.
fn everything(board: &Board, now: Time) -> BTreeMap<Subject, Vec<u8>> {
    let mut all = contents::everything(now, board);
    all.insert(Subject::Events, events(now, board));
    all
}

/// What happened; what happened at the same time in any order. What a node says before it has joined is recorded, and heard by
/// nobody.
fn events(now: Time, board: &Board) -> Vec<u8> {
    let Some(text) = texts::events(now, board, 0) else {
        return Vec::new();
    };
    let read: serde_json::Value = serde_json::from_str(&text).unwrap();
    let line = |event: &serde_json::Value| {
        let parts = ["age_s", "kind", "vehicles", "text"].map(|key| event[key].to_string());
        parts.join(" ")
    };
    let all = read["events"].as_array().unwrap().iter();
    let mut lines: Vec<String> = all
        .map(line)
        .filter(|line| !line.contains("is heard"))
        .collect();
    lines.sort();
    lines.join("\n").into_bytes()
}

fn small() -> Sim {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut loader =
        |name: &str| std::fs::read_to_string(root.join(name)).map_err(|error| error.to_string());
    let text = loader(CONFIG).unwrap();
    config::read_sim(CONFIG, &text, None, &mut loader).unwrap()
}

/// What a listener of the simulated bus hears of the same run.
fn heard_in_the_simulation() -> Vec<(Time, HeardMessage)> {
    let sim = small();
    let scenario = Scenario::new(sim, Vec::new(), 1).unwrap();
    let (tell, heard) = std::sync::mpsc::channel();
    let listener = BusListener::new(move |now, heard| tell.send((now, heard.clone())).unwrap());
    scenario.run_heard(&mut |_| true, listener).unwrap();
    heard.iter().collect()
}

#[test]
fn a_recording_ends_on_the_board_of_the_simulation_and_every_moment_is_found_in_time() {
    let folder = tempfile::tempdir().unwrap();
    let files = files(&recorded(folder.path()));
    let run = what_was_said(&files).unwrap();
    assert_eq!(run.notes, Vec::<String>::new());
    // What vehicles and the ground station have noted for people is there as it was in the simulation, some of it.
    let noted = |all: &[(Time, HeardMessage)]| -> BTreeSet<(Time, String)> {
        let lines = all.iter().filter_map(|(at, heard)| match heard {
            HeardMessage::Message(sender, Message::Log(log)) => {
                Some((*at, format!("{sender}: {}", log.lines[0].text)))
            }
            _ => None,
        });
        lines.collect()
    };
    let (replayed, simulated) = (noted(&run.heard), noted(&heard_in_the_simulation()));
    assert!(replayed.len() > 20, "{replayed:?}");
    assert!(
        replayed.is_subset(&simulated),
        "{:?}",
        replayed.difference(&simulated).next()
    );
    let sim = small();
    let new = || {
        let mut board = Board::new(sim.venue.hash(), Lattice::new(sim.venue.cell_m));
        board.take(Time::ZERO, &BoardInput::Linked(true));
        board
    };
    let (mut history, mut present) = (History::default(), new());
    for (at, heard) in &run.heard {
        let input = BoardInput::Heard(heard.clone());
        history.tell(*at, &mut present, &input).unwrap();
    }
    // A simulation's listener hears lines of its scenario as well.
    let told = |all: Vec<(Time, HeardMessage)>| {
        let mut board = new();
        for (at, heard) in all {
            if !matches!(&heard, HeardMessage::Message(_, Message::Log(_))) {
                board.take(at, &BoardInput::Heard(heard));
            }
        }
        board
    };
    // Those who say what is shown of a fleet; operators only ask.
    let (replayed, simulated) = (told(run.heard.clone()), told(heard_in_the_simulation()));
    let end = run.heard.last().unwrap().0;
    let (one, other) = (everything(&replayed, end), everything(&simulated, end));
    assert!(one.len() > 20, "{}", one.len());
    let differ: Vec<&Subject> = one
        .keys()
        .chain(other.keys())
        .filter(|of| one.get(*of) != other.get(*of))
        .collect();
    let of = |all: &BTreeMap<Subject, Vec<u8>>| {
        let text = |of: &&Subject| {
            all.get(*of)
                .map(|bytes| String::from_utf8_lossy(bytes).into_owned())
        };
        differ.first().map(text)
    };
    assert!(
        differ.is_empty(),
        "{differ:?}: {:?} {:?}",
        of(&one),
        of(&other)
    );

    let (from, to) = history.span().unwrap();
    let mut longest = Duration::ZERO;
    for share in [0.9, 0.1, 0.5, 0.51, 0.0, 1.0] {
        let moment = from + to.since(from).mul_f64(share);
        let began = Instant::now();
        let mut playback = Playback::begin(&history, Time::ZERO, moment, 0.0).unwrap();
        while !playback.go_on(&history, Time::ZERO, true) {}
        longest = longest.max(began.elapsed());
        let mut folded = new();
        for (at, heard) in run.heard.iter().filter(|(at, _)| *at <= moment) {
            folded.take(*at, &BoardInput::Heard(heard.clone()));
        }
        assert!(
            everything(&folded, moment) == everything(playback.board(), moment),
            "{share}"
        );
    }
    println!(
        "a moment of {} inputs is found within {longest:?}",
        run.heard.len()
    );
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let nodes = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = nodes
        .flat_map(|node| std::fs::read_dir(node).unwrap())
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    files
}

/// Sets the bar to a moment, as a hand does.
fn go_to(browser: &mut Browser, at_s: f64) {
    let script = format!(
        "(() => {{ const bar = document.getElementById('time-at'); bar.value = '{at_s}'; bar.dispatchEvent(new Event('input')); }})()"
    );
    browser.eval(&script);
    browser.until(
        &format!("Math.abs(tomoswarm.model.shown_ms / 1000 - {at_s}) < 0.06"),
        10,
    );
}

#[test]
fn a_recording_is_shown_at_any_moment_and_speed_and_takes_no_orders() {
    let folder = tempfile::tempdir().unwrap();
    let served = Served::start(&recorded(folder.path()));
    let own = format!("127.0.0.1:{}", served.dash.port);
    let stop = r#"{"order":"stop","page":1}"#;
    let token = Dash::token(&served.dash.look);
    let (status, said) = served
        .dash
        .post(&own, &format!("http://{own}"), token, stop);
    assert_eq!(status, 403, "{said}");
    assert!(said.contains("takes no orders"), "{said}");

    let Some(mut browser) = Browser::open(1280, 800) else {
        return;
    };
    browser.go(&served.dash.look);
    browser.until("document.title.startsWith('REPLAY')", 10);
    browser.until(
        "getComputedStyle(document.getElementById('stop')).display === 'none'",
        5,
    );
    browser.until(
        "getComputedStyle(document.getElementById('head')).borderTopStyle === 'double'",
        5,
    );
    // It begins at the beginning and plays.
    browser.until(
        "tomoswarm.model.shown_ms > 1500 && tomoswarm.model.shown_ms < 60000",
        10,
    );
    browser.until("tomoswarm.model.states.size === 2", 10);
    assert_eq!(
        browser.eval("tomoswarm.model.images.size").as_u64(),
        Some(0)
    );
    view(&mut browser, "log");

    // To the end: the image is there, and the mark of it.
    browser.key("n", "KeyN", 78);
    browser.until("tomoswarm.model.images.size > 0", 10);
    browser.until(
        "tomoswarm.model.markers.some((mark) => mark.kind === 'image')",
        10,
    );
    let end = "JSON.stringify([...tomoswarm.model.states.values()].map((state) => [state.id, state.x, state.y]))";
    let at_the_end = browser.eval(end);
    let tiles = browser.eval("tomoswarm.model.tiles.size");

    // Back: nothing of later is left.
    go_to(&mut browser, 30.0);
    browser.until(
        "tomoswarm.model.images.size === 0 && tomoswarm.model.states.size === 2",
        10,
    );
    browser.until("!document.body.innerText.includes('image of the')", 5);
    assert_ne!(browser.eval(end), at_the_end);
    // Where they have been until then is there.
    browser.until(
        "[1, 2].every((id) => tomoswarm.model.tracks.get(id)?.length > 5)",
        5,
    );
    // It stands; ages are those of the moment.
    std::thread::sleep(Duration::from_secs(4));
    browser.until("Math.abs(tomoswarm.model.shown_ms - 30000) < 60", 1);
    browser.until("!document.body.innerText.includes('silent for') && !document.body.innerText.includes('NO DATA')", 1);

    // A hand that drags asks for more than can be shown, and gets what it asked for last.
    browser.eval(
        "(() => { const bar = document.getElementById('time-at'); for (let at = 0; at <= 100; at += 0.5) { bar.value = String(at); bar.dispatchEvent(new Event('input')); } })()",
    );
    browser.until(
        "Math.abs(tomoswarm.model.shown_ms - 100000) < 60 && !tomoswarm.model.isFilling",
        10,
    );
    go_to(&mut browser, 30.0);

    // At a hundredfold speed it comes to the end by itself, and that is the same end.
    browser.eval(
        "(() => { const speed = document.getElementById('time-speed'); speed.value = '100'; })()",
    );
    browser.key("p", "KeyP", 80);
    let same_end = format!("{end} === '{}'", at_the_end.as_str().unwrap());
    browser.until(&same_end, 20);
    assert_eq!(browser.eval("tomoswarm.model.tiles.size"), tiles);

    // From mark to mark.
    browser.key("[", "BracketLeft", 219);
    browser.until(
        "document.getElementById('time-mark').textContent.length > 5",
        5,
    );
    browser.until(
        "tomoswarm.model.moment.to_s - tomoswarm.model.shown_ms / 1000 > 0.05",
        5,
    );
    shot(&mut browser, "replay");
    assert_eq!(browser.complaints, Vec::<String>::new());
    an_earlier_image_is_made_of_fewer_links(&mut browser);
    a_pair_was_heard_before_the_moment_that_is_shown(&mut browser);
}

/// Who looks back sees how strongly a pair was heard in the minutes before, also while nothing plays.
fn a_pair_was_heard_before_the_moment_that_is_shown(browser: &mut Browser) {
    view(browser, "radio");
    let times = "Number(document.getElementById('pair-caption').textContent.match(/dBm in ([0-9]+) seconds/)?.[1] ?? 0)";
    let mut counts = Vec::new();
    for at_s in [30.0, 90.0] {
        go_to(browser, at_s);
        browser.until("!tomoswarm.model.isFilling", 10);
        browser.until(
            "document.querySelectorAll('#radio-matrix button').length > 0",
            10,
        );
        browser.eval("document.querySelector('#radio-matrix button').click()");
        browser.until(&format!("{times} > 5"), 10);
        let last_ms =
            "Math.max(...[...tomoswarm.model.history.values()].flat().map(([at_ms]) => at_ms))";
        browser.until(&format!("{last_ms} <= {at_s} * 1000 + 60"), 5);
        counts.push(browser.eval(times).as_u64().unwrap());
    }
    assert!(counts[0] < counts[1], "{counts:?}");
    shot(browser, "pair");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// Who looks back at the image of the change after the first lap is told of the links that it was made of.
fn an_earlier_image_is_made_of_fewer_links(browser: &mut Browser) {
    let marks =
        "tomoswarm.model.markers.filter((mark) => mark.kind === 'image').map((mark) => mark.at_s)";
    let marks: Vec<f64> = serde_json::from_value(browser.eval(marks)).unwrap();
    let mut links = Vec::new();
    for at_s in marks.iter().rev() {
        go_to(browser, at_s + 0.2);
        browser.until("!tomoswarm.model.isFilling", 10);
        let laps = browser.eval("tomoswarm.model.images.get(1)?.laps ?? null");
        let Some(laps) = laps.as_u64() else {
            break;
        };
        browser.eval("document.getElementById('why-clear').click()");
        browser.eval(
            "for (const axis of ['x', 'y']) document.getElementById(`why-${axis}`).value = '3'",
        );
        browser.eval("document.getElementById('why-ask').click()");
        let result = "document.getElementById('why-result').textContent";
        browser.until(&format!("{result}.includes('is the sum of')"), 20);
        let said = browser.eval(result).as_str().unwrap().to_owned();
        assert!(!said.contains("has not heard all"), "{said}");
        let (_, after) = said.split_once("is the sum of ").unwrap();
        let count: usize = after.split(' ').next().unwrap().parse().unwrap();
        links.push((laps, count));
    }
    println!("laps and links of the images of the change, from the last one on: {links:?}");
    let [(2, all), .., (1, first)] = links[..] else {
        panic!("{links:?}");
    };
    assert!(first > 50 && first < all, "{links:?}");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn another_run_is_shown_beside_a_recording_at_the_same_time_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let run = recorded(folder.path());
    let other = recorded_as(folder.path(), "other", &["--seed", "5"]);
    let served = Served::beside(&run, Some(&other));
    let heard = |flight: &Path| what_was_said(&files(flight)).unwrap().heard;
    let (own, others) = (heard(&run), heard(&other));
    let shift_s = began(&own).as_secs_f64() - began(&others).as_secs_f64();

    let Some(mut browser) = Browser::open(1280, 800) else {
        return;
    };
    browser.go(&served.dash.look);
    browser.until("document.title.startsWith('REPLAY')", 10);
    browser.until("!document.getElementById('ghost-choice').hidden", 5);
    browser.until("tomoswarm.scene.ghost.ways?.length === 2", 10);
    browser.until(
        "Number(document.getElementById('time-at').max) > 100 && tomoswarm.model.states.size === 2",
        20,
    );
    for at_s in [30.0, 60.0, 45.0] {
        go_to(&mut browser, at_s);
        let seen = browser.eval(
            "tomoswarm.scene.ghost.vehicles().map(({ id, x, y, track }) => [id, x, y, track.length])",
        );
        for vehicle in seen.as_array().unwrap() {
            let id = vehicle[0].as_u64().unwrap() as u8;
            let expected = place_at(&others, id, at_s - shift_s);
            let away = [1, 2].map(|axis| vehicle[axis].as_f64().unwrap() - expected[axis - 1]);
            // Times go in tenths of a second, and between two of its poses it is on a straight line.
            assert!(
                libm::hypot(away[0], away[1]) < 0.35,
                "{id} at {at_s} s: {vehicle} is not at {expected:?}"
            );
            assert!(vehicle[3].as_u64().unwrap() > 10, "{vehicle}");
        }
        assert_eq!(seen.as_array().unwrap().len(), 2);
    }
    shot(&mut browser, "ghost");
    // Without its layer the scene is another one; in three dimensions it is there as well.
    let drawn = "new Promise((drawn) => setTimeout(() => drawn(document.getElementById('plane').toDataURL()), 300))";
    let with = browser.eval(drawn);
    browser.eval("document.getElementById('layer-ghost').click()");
    assert_ne!(browser.eval(drawn), with);
    browser.eval("document.getElementById('layer-ghost').click()");
    browser.key("v", "KeyV", 86);
    browser.until(
        "tomoswarm.view.space?.layers.groups.get('ghost')?.children.length === 6",
        10,
    );
    shot(&mut browser, "ghost_3d");
    assert_eq!(browser.complaints, Vec::<String>::new());
    drop(browser);

    // Of another venue, of nothing, and without a run beside which it could be shown: refused.
    let elsewhere = folder.path().join("elsewhere");
    let mut command = tomoswarm(&["sim", "--until", "20", "--record", "--no-pictures", "--out"]);
    command.arg(&elsewhere).output().unwrap();
    for (other, reason) in [
        (elsewhere.join("flight"), "one file is expected"),
        (folder.path().join("nowhere"), "nowhere"),
    ] {
        let mut command = tomoswarm(&["dash", "--port", "0", "--replay"]);
        let output = command
            .arg(&run)
            .arg("--ghost")
            .arg(other)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(reason), "{reason}: {said}");
    }
    let output = tomoswarm(&["dash", "operator.toml", "--ghost"])
        .arg(&other)
        .output();
    assert_eq!(output.unwrap().status.code(), Some(2));
}

/// Where a vehicle was at a time of its run, between the two places that it said then, metres.
fn place_at(run: &[(Time, HeardMessage)], id: u8, at_s: f64) -> [f64; 2] {
    let said = run.iter().filter_map(|(at, heard)| match heard {
        HeardMessage::Message(_, Message::State(state)) if state.vehicle == VehicleId(id) => {
            Some((at.as_secs_f64(), state.pose?.at))
        }
        _ => None,
    });
    let said: Vec<(f64, Position)> = said.collect();
    let next = said.partition_point(|(at, _)| *at <= at_s);
    let (one, other) = (said[next - 1], said[next]);
    let share = (at_s - one.0) / (other.0 - one.0);
    let between = |from: f64, to: f64| from + share * (to - from);
    [
        between(one.1.x_m(), other.1.x_m()),
        between(one.1.y_m(), other.1.y_m()),
    ]
}

/// What the program says to `dash --replay` of a path.
fn refused(path: &Path) -> (Option<i32>, String) {
    let mut command = tomoswarm(&["dash", "--port", "0", "--replay"]);
    let Output { status, stderr, .. } = command.arg(path).output().unwrap();
    (status.code(), String::from_utf8_lossy(&stderr).into_owned())
}

#[test]
fn what_is_no_recording_is_refused_and_one_that_is_cut_off_is_shown_up_to_there() {
    let folder = tempfile::tempdir().unwrap();
    let flight = recorded(folder.path());
    let ground = files(&flight).remove(0);
    let bytes = std::fs::read(&ground).unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let found = bytes.windows(6).position(|part| part == b"format").unwrap();
    let mut of_another = bytes.clone();
    let version = found + bytes[found..].iter().position(u8::is_ascii_digit).unwrap();
    of_another[version] = b'9';
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    for (path, reason) in [
        (folder.path().join("nowhere"), "nowhere"),
        (empty, "holds no recording"),
        (write("text.mcap", b"hello"), "is no MCAP"),
        (write("none.mcap", b""), "is no MCAP"),
        (write("other.mcap", &of_another), "recorded by tomoswarm"),
    ] {
        let (code, said) = refused(&path);
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains(reason), "{reason}: {said}");
    }
    // Two runs are not one.
    let again = flight.join("again");
    std::fs::create_dir(&again).unwrap();
    std::fs::copy(&ground, again.join("flight-000001.mcap")).unwrap();
    let (code, said) = refused(&flight);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("recordings of one run"), "{said}");
    std::fs::remove_dir_all(&again).unwrap();

    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let mut command = tomoswarm(&["dash", "--port", &port, "--replay"]);
    let output = command.arg(&flight).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{output:?}");

    // Of the ground station alone, and cut off: what it heard of the vehicles is shown up to there.
    let cut = write("cut.mcap", &bytes[..bytes.len() / 2]);
    let run = what_was_said(std::slice::from_ref(&cut)).unwrap();
    assert!(
        run.notes
            .iter()
            .any(|note| note.contains("shown up to there")),
        "{:?}",
        run.notes
    );
    let senders: std::collections::BTreeSet<Sender> = run
        .heard
        .iter()
        .filter_map(|(_, heard)| match heard {
            HeardMessage::Message(sender, _) => Some(*sender),
            _ => None,
        })
        .collect();
    assert!(
        senders.contains(&Sender::Ground) && senders.len() >= 3,
        "{senders:?}"
    );
    Served::start(&cut);
}
