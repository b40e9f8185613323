//! Figures of the operator's page that need a quiet machine: `cargo test --test net page_figures -- --ignored --nocapture
//! --test-threads 1`. Nothing of the time taken is asserted; the values stand in docs/figures.md.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::browser::Browser;
use crate::dash::{Dash, live_page, prepared, take_seat};
use crate::page_3d::key;
use crate::sim_page::SimulationWithPage;
use crate::swarm::Watch;
use crate::websocket::{Incoming, WebSocket, upgrade};

/// Stops that are pressed.
const STOPS: usize = 40;
/// So long a page is fed for its heap, and at most so much of that may be kept, megabytes.
const MINUTES: u32 = 5;
const HEAP_MB: f64 = 100.0;
/// Of each figure over time.
const OVER: Duration = Duration::from_secs(20);

/// Writes a field of 60 m with nothing but a crate in a corner, and a simulation of vehicles that drive about on it;
/// returns its file.
pub fn field(folder: &Path, vehicles: usize) -> String {
    let mut homes = String::new();
    for number in 0..vehicles {
        let (x_m, y_m) = (12 + 4 * (number % 10), 20 + 4 * (number / 10));
        let _ = write!(homes, "[{x_m}.0, {y_m}.0], ");
    }
    let venue = format!(
        "kind = \"venue\"\nname = \"field\"\narea_m = [10.0, 10.0, 50.0, 50.0]\nhomes_m = [{homes}]\n\
         fence_m = [[0.0, 0.0], [60.0, 0.0], [60.0, 60.0], [0.0, 60.0]]\n\
         [datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\n"
    );
    std::fs::write(folder.join("field.venue.toml"), venue).unwrap();
    let scene = "kind = \"scene\"\nname = \"field\"\n[[object]]\nname = \"crate\"\noutline_m = [[2.0, 57.0], [3.0, 57.0], [3.0, 58.0]]\n";
    std::fs::write(folder.join("field.scene.toml"), scene).unwrap();
    let sim = format!(
        "kind = \"sim\"\nvenue = \"field.venue.toml\"\nscene = \"field.scene.toml\"\nuntil_s = 3600.0\nend = \"hold\"\n[vehicles]\ncount = {vehicles}\n\
         [mission]\nkind = \"patrol\"\nrounds = 0\nwaypoints_m = [[6.0, 6.0], [54.0, 6.0], [54.0, 54.0], [6.0, 54.0], [30.0, 6.0], \
         [54.0, 30.0], [30.0, 54.0], [6.0, 30.0]]\n"
    );
    let file = folder.join("field.sim.toml");
    std::fs::write(&file, sim).unwrap();
    file.display().to_string()
}

/// Returns the processor time of a process and all that it has started, seconds.
fn processor_s(id: u32) -> f64 {
    let mut times = BTreeMap::new();
    for entry in std::fs::read_dir("/proc").unwrap().flatten() {
        let Ok(stat) = std::fs::read_to_string(entry.path().join("stat")) else {
            continue;
        };
        let Some((head, rest)) = stat.rsplit_once(')') else {
            continue;
        };
        let own: u32 = head.split(' ').next().unwrap().parse().unwrap();
        let fields: Vec<&str> = rest.split_whitespace().collect();
        let ticks: [f64; 2] = [fields[11], fields[12]].map(|ticks| ticks.parse().unwrap());
        times.insert(
            own,
            (fields[1].parse::<u32>().unwrap(), ticks[0] + ticks[1]),
        );
    }
    let is_of = |mut process: u32| {
        while process != id {
            match times.get(&process) {
                Some((parent, _)) if *parent > 1 => process = *parent,
                _ => return false,
            }
        }
        true
    };
    let all = times.iter().filter(|(process, _)| is_of(**process));
    all.map(|(_, (_, ticks))| ticks).sum::<f64>() / 100.0
}

/// Returns how much memory a process has or had, by a name that Linux gives it, megabytes.
pub fn memory_mb(id: u32, name: &str) -> f64 {
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).unwrap();
    let line = status.lines().find(|line| line.starts_with(name)).unwrap();
    line.split_whitespace()
        .nth(1)
        .unwrap()
        .parse::<f64>()
        .unwrap()
        / 1000.0
}

/// What a page has drawn and read: frames of the scene, bytes, and processor time of browser and server, seconds.
fn counted(browser: &mut Browser, server: u32) -> [f64; 4] {
    let read = browser.eval("[tomoswarm.view.space?.frames ?? 0, tomoswarm.model.bytes]");
    let number = |part: usize| read[part].as_f64().unwrap();
    [
        number(0),
        number(1),
        processor_s(browser.id()),
        processor_s(server),
    ]
}

/// Returns what the browser has measured of a page, by these names.
fn metrics<const COUNT: usize>(browser: &mut Browser, names: [&str; COUNT]) -> [f64; COUNT] {
    let all = browser.ask("Performance.getMetrics", json!({}));
    names.map(|name| {
        let metrics = all["metrics"].as_array().unwrap();
        let metric = metrics.iter().find(|metric| metric["name"] == name);
        metric.unwrap()["value"].as_f64().unwrap()
    })
}

/// Returns for how long a page's thread has run scripts, computed styles, laid out, and been busy in all, seconds.
fn busy_s(browser: &mut Browser) -> [f64; 4] {
    let names = [
        "ScriptDuration",
        "RecalcStyleDuration",
        "LayoutDuration",
        "TaskDuration",
    ];
    metrics(browser, names)
}

/// Prints what a page draws and reads each second.
fn rates(what: &str, browser: &mut Browser, server: u32) {
    let busy_before = busy_s(browser);
    let (before, began) = (counted(browser, server), Instant::now());
    std::thread::sleep(OVER);
    let (after, took_s) = (counted(browser, server), began.elapsed().as_secs_f64());
    let [frames, bytes, page, server] = [0, 1, 2, 3].map(|of| (after[of] - before[of]) / took_s);
    println!(
        "{what}: {frames:.1} frames/s, feed {:.1} kB/s, browser {page:.2} cores, simulation and server {server:.2} cores",
        bytes / 1000.0
    );
    let busy = busy_s(browser);
    let share = |of: usize| (busy[of] - busy_before[of]) / took_s;
    println!(
        "  of that its page's thread: scripts {:.3}, styles {:.3}, layout {:.3}, all {:.3} cores",
        share(0),
        share(1),
        share(2),
        share(3)
    );
}

/// Lets a page draw more vehicles, which drive in circles: ten times a second it takes new states of them.
const MORE_VEHICLES: &str = "setInterval(() => {
    const { model } = tomoswarm, of = model.states.get(1), turn = performance.now() / 4000;
    for (let id = 9; id <= 50; id++) {
        const [x, y, heading] = [8 + 5 * (id % 10) + 2 * Math.cos(turn + id), 8 + 5 * (id % 9) + 2 * Math.sin(turn + id), turn + id + 1.57];
        model.states.set(id, { ...of, id, x, y, heading });
    }
    model.changed.add('states'); tomoswarm.view.plane.wanted();
}, 100); 0";

#[test]
#[ignore = "figures, on a quiet machine"]
fn frames_and_feed_of_eight_vehicles_and_frames_of_fifty() {
    let folder = tempfile::tempdir().unwrap();
    let config = field(folder.path(), 8);
    let Some(mut browser) = Browser::open(1280, 800) else {
        return;
    };
    let out = folder.path().join("out");
    let simulation = SimulationWithPage::of(&config, &out, &["--pace", "1"]);
    let server = simulation.id();
    browser.ask("Performance.enable", json!({}));
    browser.go(&simulation.dash.look);
    browser.until("tomoswarm.model.states.size === 8", 60);
    std::thread::sleep(Duration::from_secs(10));
    rates("8 vehicles from above, on demand", &mut browser, server);
    key(&mut browser, 'v');
    browser.until("tomoswarm.view.space?.frames > 3", 60);
    for vehicles in [8, 50] {
        if vehicles == 50 {
            browser.eval(MORE_VEHICLES);
        }
        let what = format!("{vehicles} vehicles in 3D");
        rates(&format!("{what}, on demand"), &mut browser, server);
        browser.key_part("keyDown", "d", "KeyD", 68);
        rates(&format!("{what}, flying"), &mut browser, server);
        browser.key_part("keyUp", "d", "KeyD", 68);
    }
    println!(
        "the simulation and its server: {:.0} MB",
        memory_mb(server, "VmRSS")
    );
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// Counts the page's frames: what it draws in one turn of the browser.
const FRAMES: &str = "(() => { const next = requestAnimationFrame; globalThis.framesDrawn = 0;
    globalThis.requestAnimationFrame = (act) => next((at) => { framesDrawn += 1; act(at); }); })()";

/// Returns the heap of a page's scripts, megabytes: as it is, and without what nothing needs any more.
fn heap_mb(browser: &mut Browser) -> [f64; 2] {
    let [with_garbage] = metrics(browser, ["JSHeapUsedSize"]);
    browser.ask("HeapProfiler.collectGarbage", json!({}));
    let [kept] = metrics(browser, ["JSHeapUsedSize"]);
    [with_garbage, kept].map(|bytes| bytes / 1e6)
}

/// Prints how many frames there are in a minute, what each takes, and the heap after it.
fn a_minute(browser: &mut Browser, what: &str) {
    let mut read = || {
        let frames = browser.eval("framesDrawn").as_f64().unwrap();
        (frames, busy_s(browser))
    };
    let (frames_before, busy_before) = read();
    std::thread::sleep(Duration::from_secs(60));
    let (frames, busy) = read();
    let frames = frames - frames_before;
    let of_frame_ms = |of: usize| 1000.0 * (busy[of] - busy_before[of]) / frames;
    let places = browser.eval("[...tomoswarm.model.tracks.values()].flat().length");
    let [with_garbage, kept] = heap_mb(browser);
    println!(
        "{what}: {:.1} frames/s, each {:.2} ms of scripts, {:.2} ms of the page's thread in all; {places} places in tracks; \
         heap {with_garbage:.1} MB, {kept:.2} MB of it kept",
        frames / 60.0,
        of_frame_ms(0),
        of_frame_ms(3)
    );
    assert!(kept < HEAP_MB, "{kept} MB");
}

#[test]
#[ignore = "figures, on a quiet machine"]
fn the_heap_of_a_page_and_its_scripts_for_each_frame() {
    let folder = tempfile::tempdir().unwrap();
    let config = field(folder.path(), 8);
    let Some(mut browser) = Browser::open(1280, 800) else {
        return;
    };
    let out = folder.path().join("out");
    let simulation = SimulationWithPage::of(&config, &out, &["--pace", "1"]);
    browser.ask("Performance.enable", json!({}));
    browser.go(&simulation.dash.look);
    browser.until("tomoswarm.model.states.size === 8", 60);
    browser.eval(FRAMES);
    for minute in 1..=MINUTES {
        let of_minute = format!("minute {minute}");
        a_minute(&mut browser, &of_minute);
    }
    browser.eval("document.getElementById('layer-tracks').click()");
    a_minute(&mut browser, "a further one without tracks");
    browser.eval("document.getElementById('layer-tracks').click()");
    key(&mut browser, 'v');
    browser.until("tomoswarm.view.space?.frames > 3", 60);
    a_minute(&mut browser, "a further one in 3D");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// A page without a browser: it reads all that comes, and gives credit at once.
fn reader(dash: &Dash) -> std::thread::JoinHandle<()> {
    let own = format!("127.0.0.1:{}", dash.port);
    let headers = format!("Host: {own}\r\nOrigin: http://{own}\r\n");
    let token = Dash::token(&dash.look).to_owned();
    let (stream, head) = upgrade(dash.port, "/feed", &headers);
    assert!(head.contains("101"), "{head}");
    std::thread::spawn(move || {
        let mut socket = WebSocket(stream);
        socket.say(&json!({ "token": token }).to_string());
        while let Incoming::Binary(_) = socket.next() {
            socket.say(r#"{"credit":1}"#);
        }
    })
}

#[test]
#[ignore = "figures, on a quiet machine"]
fn the_server_with_five_pages_takes_little() {
    let mut swarm = prepared();
    swarm.run();
    let dash = Dash::start(&mut swarm);
    swarm.order(&["start", "1", "2", "--run", "1", "--timeout", "60"]);
    let server = swarm.process_id("dash");
    let mut readers = Vec::new();
    for pages in [0, 1, 5] {
        while readers.len() < pages {
            readers.push(reader(&dash));
        }
        std::thread::sleep(Duration::from_secs(2));
        let (before_s, began) = (processor_s(server), Instant::now());
        std::thread::sleep(OVER);
        let share = (processor_s(server) - before_s) / began.elapsed().as_secs_f64();
        println!(
            "{pages} pages: {:.1} % of a core, {:.0} MB",
            100.0 * share,
            memory_mb(server, "VmRSS")
        );
    }
}

fn open_stops(watch: &Watch) -> usize {
    watch.view.open_stops().len()
}

#[test]
#[ignore = "figures, on a quiet machine"]
fn stops_by_the_space_key_reach_the_bus() {
    let Some((mut browser, swarm, dash)) = live_page(1280, 800) else {
        return;
    };
    take_seat(&mut browser);
    let page: Value = browser.eval("tomoswarm.model.place.page");
    let secret: Value = browser.eval("tomoswarm.feed.secret");
    let own = format!("127.0.0.1:{}", dash.port);
    let start = json!({"order": "start", "page": page, "secret": secret}).to_string();
    let mut all_ms = Vec::new();
    for _ in 0..STOPS {
        let began = Instant::now();
        browser.key_part("keyDown", " ", "Space", 32);
        while swarm.look(open_stops) == 0 {
            assert!(
                began.elapsed() < Duration::from_secs(5),
                "no stop on the bus"
            );
            std::thread::sleep(Duration::from_micros(200));
        }
        all_ms.push(began.elapsed().as_secs_f64() * 1000.0);
        browser.key_part("keyUp", " ", "Space", 32);
        // A start is refused while a vehicle was not heard for 2 s.
        let lifts = Instant::now();
        while swarm.look(open_stops) > 0 {
            assert!(
                lifts.elapsed() < Duration::from_secs(30),
                "the stop is not lifted"
            );
            let token = Dash::token(&dash.operate);
            dash.post(&own, &format!("http://{own}"), token, &start);
            std::thread::sleep(Duration::from_millis(300));
        }
        // More than eight new names a minute of one sender stand for many, which no start lifts.
        std::thread::sleep(Duration::from_millis(7600));
    }
    all_ms.sort_by(f64::total_cmp);
    println!(
        "space key to stop on the bus, {STOPS} times, the browser's tools included: median {:.1} ms, most {:.1} ms",
        all_ms[STOPS / 2],
        all_ms[STOPS - 1]
    );
}
