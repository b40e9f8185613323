//! How old is what the operator's page shows, how soon it shows anything, and what it takes while nobody sees it. Each test prints
//! what it measures, for docs/figures.md, and asserts three times what is wanted, since this build is not optimised:
//! `cargo test --test net page_times:: -- --ignored --nocapture --test-threads 1`. That a hidden page does nothing is tested always.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde_json::Value;
use tomoswarm::run::bus::BusSession;
use tomoswarm_proto::{
    Boot, Hello, LayerId, Message, PoseReport, Position, State, TILE_CELLS, TILE_SIDE, TileAddress,
    TileReport, VehicleId,
};

use crate::browser::Browser;
use crate::dash::{Dash, live_page, prepared, vehicle_on_bus};
use crate::relay::Relay;
use crate::swarm::Swarm;

/// What a slow link carries, bytes a second.
const SLOW: f64 = 30_000.0;
/// What is asserted, in units of what is wanted.
const LENIENCE: f64 = 3.0;

/// The time of day, milliseconds, by which a browser's `Date.now()` goes, too.
fn now_ms() -> f64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    since.as_secs_f64() * 1000.0
}

/// Returns the value that a share of all does not exceed.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    assert!(!values.is_empty(), "nothing was measured");
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share).round() as usize]
}

fn numbers(browser: &mut Browser, script: &str) -> Vec<f64> {
    serde_json::from_value(browser.eval(script)).unwrap()
}

fn hello_of_member(hello: Hello) -> Message {
    Message::Hello(Hello {
        is_member: true,
        ..hello
    })
}

fn tile(x: i32, revision: u64, cell: impl Fn(usize) -> i8) -> Message {
    Message::Tile(TileReport {
        layer: LayerId {
            vehicle: VehicleId(9),
            boot: Boot(1),
        },
        address: TileAddress { slice: 0, x, y: -1 },
        revision: revision.try_into().unwrap(),
        cells: Arc::new(std::array::from_fn(cell)),
    })
}

/// Puts a vehicle on the bus that is as many millimetres east as milliseconds have passed since a moment, which is returned, twenty
/// times a second. Its map changes as well, in so many tiles at a time, so that nothing of it can be packed.
fn odometer(swarm: &Swarm, tiles: i32) -> (BusSession, f64) {
    let began_ms = now_ms();
    let mut chance = 1_u64;
    let bus = vehicle_on_bus(swarm, Duration::from_millis(50), move |sequence, hello| {
        let x_m = (now_ms() - began_ms) / 1000.0;
        let state = State {
            vehicle: VehicleId(9),
            boot: Boot(1),
            sequence,
            pose: Some(PoseReport {
                at: Position::from_metres(x_m, -3.0, 0.0),
                ..PoseReport::default()
            }),
            ..State::default()
        };
        let noise: Vec<i8> = (0..TILE_CELLS)
            .map(|_| {
                chance = chance
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                ((chance >> 33) % 35) as i8 - 17
            })
            .collect();
        let changed = (0..tiles).map(|x| tile(x, sequence + 1, |cell| noise[cell]));
        [hello_of_member(hello), Message::State(state)]
            .into_iter()
            .chain(changed)
            .collect()
    });
    (bus, began_ms)
}

/// Opens the page through a relay: by the name of this machine, which the browser takes for the relay.
fn opened_through(relay: &Relay, dash: &Dash) -> Option<Browser> {
    let rule = format!("MAP localhost:{} {}", dash.port, relay.address());
    let options = format!("--host-resolver-rules=\"{rule}\"");
    let mut browser = Browser::open_with(1280, 800, &options)?;
    browser.go(&dash.operate.replace("127.0.0.1", "localhost"));
    browser.until(
        "tomoswarm.model.states.has(9) && tomoswarm.scene.view && tomoswarm.model.moment.isWhole",
        30,
    );
    assert!(relay.carried() > 100_000, "the page came another way");
    Some(browser)
}

/// A swarm with its page, and a relay to that.
fn relayed_page() -> (Swarm, Dash, Relay) {
    let mut swarm = prepared();
    swarm.run();
    let dash = Dash::start(&mut swarm);
    let relay = Relay::start(([127, 0, 0, 1], dash.port).into());
    (swarm, dash, relay)
}

/// How old the place of vehicle 9 is: whenever a newer one comes, and of what is drawn, at every moment.
const AGES: &str = "const { model, view } = tomoswarm, x = () => model.states.get(9)?.x ?? 0;
    globalThis.ages = { came: [], shown: [], drawn: x() };
    const take = model.take.bind(model), draw = view.draw.bind(view);
    model.take = (buffer, now_ms) => { const before = x(); take(buffer, now_ms); if (x() !== before) ages.came.push(Date.now() - began_ms - x() * 1000); };
    view.draw = (now_ms) => { draw(now_ms); ages.drawn = x(); };
    setInterval(() => ages.shown.push(Date.now() - began_ms - ages.drawn * 1000), 20);";

#[test]
#[ignore = "figures, on a quiet machine"]
fn over_a_slow_link_what_is_shown_is_not_old() {
    let (swarm, dash, relay) = relayed_page();
    let (_bus, began_ms) = odometer(&swarm, 6);
    let Some(mut browser) = opened_through(&relay, &dash) else {
        return;
    };
    relay.shape(SLOW, Duration::ZERO);
    // What was on its way before the link was slow has come after a moment; then so long.
    let settles = Duration::from_secs(3);
    let over = Duration::from_secs(15);
    std::thread::sleep(settles);
    browser.eval(&format!(
        "(() => {{ const began_ms = {began_ms}; {AGES} }})()"
    ));
    let before = relay.carried();
    std::thread::sleep(over);
    let rate = (relay.carried() - before) as f64 / over.as_secs_f64();
    let [mut came, mut shown] =
        ["came", "shown"].map(|of| numbers(&mut browser, &format!("ages.{of}")));
    let of = |ages: &mut Vec<f64>| [0.5, 0.95, 1.0].map(|share| quantile(ages, share));
    let (count, came, shown) = (came.len(), of(&mut came), of(&mut shown));
    println!(
        "a link of 30 kB/s that carries {:.1} kB/s: {count} places came, {:.0} ms old, 95 % {:.0}, most {:.0} ms; what is drawn is {:.0} ms old, 95 % {:.0}, most {:.0} ms",
        rate / 1000.0,
        came[0],
        came[1],
        came[2],
        shown[0],
        shown[1],
        shown[2]
    );
    assert!(rate > 0.7 * SLOW, "the link is not full: {rate} bytes/s");
    assert!(came[0] > 20.0, "the clocks differ: {came:?}");
    assert!(shown[2] < LENIENCE * 600.0, "{shown:?}");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// A place of the tile, outside of the fence and within what is seen.
const WALL_M: [f64; 2] = [0.8, -4.5];

/// Notes when the pixel of the wall becomes dark or light.
const TURNS: &str = "(() => { const { view, scene } = tomoswarm, draw = view.draw.bind(view);
    const isDark = () => { const [x, y] = scene.toPixel(WALL), r = scene.canvas.width / scene.canvas.clientWidth;
      return scene.canvas.getContext('2d').getImageData(Math.round(x * r), Math.round(y * r), 1, 1).data[0] < 100; };
    globalThis.turns = []; let was = isDark();
    view.draw = (now_ms) => { draw(now_ms); if (isDark() !== was) { was = !was; turns.push(Date.now()); } }; })()";

#[test]
#[ignore = "figures, on a quiet machine"]
fn a_tile_on_the_bus_is_a_pixel_soon() {
    let Some((mut browser, swarm, _dash)) = live_page(1280, 800) else {
        return;
    };
    // Its western half and its eastern one are occupied in turn, so far as it lies outside of the fence.
    let half = |revision: u64, cell: usize| {
        let is_west = cell % TILE_SIDE < TILE_SIDE / 2;
        match cell / TILE_SIDE < 10 {
            true if is_west == (revision % 2 == 1) => 17,
            true => -17,
            false => 0,
        }
    };
    let revision = Arc::new(AtomicU64::new(1));
    let (said, mut last) = (revision.clone(), 0);
    // Looked at so often that the test's own steps take no time.
    let (told, when) = std::sync::mpsc::channel();
    let _bus = vehicle_on_bus(&swarm, Duration::from_millis(1), move |count, hello| {
        let now = said.load(Ordering::Relaxed);
        let mut messages = Vec::new();
        let is_new = std::mem::replace(&mut last, now) != now;
        // Again and again, for whoever has joined since.
        if is_new || count % 200 == 0 {
            messages.extend([tile(0, now, |cell| half(now, cell)), hello_of_member(hello)]);
        }
        if is_new {
            let _ = told.send(now_ms());
        }
        messages
    });
    browser.until(
        &format!(
            "tomoswarm.scene.cellWord({}, {}) === 'occupied'",
            WALL_M[0], WALL_M[1]
        ),
        20,
    );
    let _ = when.recv();
    // The drawing that shows it is over as well.
    browser.eval("new Promise((drawn) => requestAnimationFrame(() => setTimeout(drawn, 200)))");
    let wall = format!("{}, {}", WALL_M[0], WALL_M[1]);
    browser.eval(&TURNS.replace("WALL", &wall));
    let mut late_ms = Vec::new();
    for turn in 1..=60 {
        revision.fetch_add(1, Ordering::Relaxed);
        let said_ms = when.recv_timeout(Duration::from_secs(5)).unwrap();
        browser.until(&format!("turns.length === {turn}"), 5);
        let shown_ms = browser.eval(&format!("turns[{}]", turn - 1)).as_f64();
        late_ms.push(shown_ms.unwrap() - said_ms);
        // Not in step with what draws.
        std::thread::sleep(Duration::from_millis(100 + turn * 37 % 200));
    }
    let least = late_ms.iter().copied().fold(f64::INFINITY, f64::min);
    let [median, most, worst] = [0.5, 0.95, 1.0].map(|share| quantile(&mut late_ms, share));
    println!(
        "a tile on the bus until its pixel has turned, 60 times: median {median:.0}, 95 % {most:.0}, most {worst:.0} ms"
    );
    assert!(least > -2.0, "the clocks differ: {least} ms");
    assert!(most < LENIENCE * 150.0, "{most} ms");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// Notes which cells become occupied and dark, and when.
#[cfg(feature = "hw")]
const NEW_WALLS: &str = "(() => { const { model, view, scene } = tomoswarm, draw = view.draw.bind(view), known = new Set();
    globalThis.walls = [];
    view.draw = (now_ms) => { draw(now_ms);
      const side = model.place.cell_m, pen = scene.canvas.getContext('2d'), r = scene.canvas.width / scene.canvas.clientWidth;
      for (const tile of model.tiles.values()) tile.cells.forEach((value, i) => {
        const [x, y] = [tile.x * 32 + i % 32 + 0.5, tile.y * 32 + Math.floor(i / 32) + 0.5].map((cells) => cells * side);
        if (value < 9 || known.has(`${x} ${y}`)) return;
        const [left, top] = scene.toPixel(x, y).map((at) => Math.round(at * r));
        if (pen.getImageData(left, top, 1, 1).data[0] > 60) return;
        known.add(`${x} ${y}`);
        walls.push(Date.now());
      }); }; scene.wanted(); })()";

/// A fixed sensor on a serial port hears something go away, a cell at a time.
#[cfg(feature = "hw")]
#[test]
#[ignore = "figures, on a quiet machine"]
fn an_echo_of_a_real_sensor_is_a_pixel_soon() {
    let Some(mut browser) = Browser::open(1280, 800) else {
        return;
    };
    let mut swarm = prepared();
    let path = swarm.path("sensor");
    let range = format!(
        "[range]\ndriver = \"serial-text\"\nscan_period_s = 0.05\nsettle_s = 0.01\nhalf_angle_deg = 5.0\n[range.serial-text]\nport = \"{}\"\n",
        path.display()
    );
    crate::drivers::with_range(&swarm, 1, &range);
    // Who hears so narrowly drives no faster than this.
    let file = std::fs::read_to_string(swarm.path("vehicle-1.toml")).unwrap();
    swarm.write(
        "vehicle-1.toml",
        &file.replace("max_speed_mps = 1.5", "max_speed_mps = 0.4"),
    );
    let mut port = crate::drivers::serial_port(&path);
    let (distance_mm, (told, when)) = (
        Arc::new(AtomicU64::new(1200)),
        std::sync::mpsc::channel::<f64>(),
    );
    let says = distance_mm.clone();
    std::thread::spawn(move || {
        let mut last = 0;
        // Twenty times a second, as such sensors do; until nobody listens any more.
        for _ in 0..2400 {
            let now = says.load(Ordering::Relaxed);
            if std::mem::replace(&mut last, now) != now && told.send(now_ms()).is_err() {
                return;
            }
            let line = format!("R{now:04}\r");
            if std::io::Write::write_all(&mut port, line.as_bytes()).is_err() {
                return;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    });
    swarm.run();
    let dash = Dash::start(&mut swarm);
    browser.go(&dash.look);
    browser.until("tomoswarm.model.tiles.size > 0 && tomoswarm.scene.view", 60);
    let _ = when.recv();
    browser.eval(NEW_WALLS);
    browser.until("walls.length > 0", 20);
    let mut late_ms = Vec::new();
    for step in 1..=12 {
        // The wall before is drawn, and nothing of it comes late.
        std::thread::sleep(Duration::from_millis(400 + step * 13 % 50));
        let before = browser.eval("walls.length").as_u64().unwrap();
        distance_mm.store(1200 + 200 * step, Ordering::Relaxed);
        let said_ms = when.recv_timeout(Duration::from_secs(5)).unwrap();
        browser.until(&format!("walls.length > {before}"), 10);
        let shown_ms = browser.eval(&format!("walls[{before}]")).as_f64().unwrap();
        late_ms.push(shown_ms - said_ms);
    }
    let [median, most, worst] = [0.5, 0.95, 1.0].map(|share| quantile(&mut late_ms, share));
    println!(
        "a sensor's line on a vehicle's serial port until the wall is a pixel, 12 times: median {median:.0}, 95 % {most:.0}, most {worst:.0} ms; {late_ms:.0?}"
    );
    assert!(late_ms[0] > 0.0, "the clocks differ: {late_ms:?}");
    assert!(most < LENIENCE * 150.0, "{late_ms:?}");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// When a page says, by the browser's own timing, milliseconds after the navigation: the first words seen, controls that work, and
/// the first picture with vehicles, the map and the images that there were.
const TIMES: &str = "[performance.getEntriesByName('first-contentful-paint')[0].startTime,
    performance.getEntriesByName('controls')[0].startTime, performance.getEntriesByName('picture')[0].startTime]";

#[test]
#[ignore = "figures, on a quiet machine"]
fn controls_and_the_first_picture_are_there_soon() {
    let Some((mut browser, _swarm, dash)) = live_page(1280, 800) else {
        return;
    };
    browser.until("tomoswarm.model.tiles.size > 0", 20);
    let mut all = [Vec::new(), Vec::new(), Vec::new()];
    for _ in 0..9 {
        browser.go("about:blank");
        browser.go(&dash.operate);
        browser.until("performance.getEntriesByName('picture').length === 1", 20);
        let tiles = "[performance.getEntriesByName('picture')[0].detail.tiles, tomoswarm.model.place.tiles]";
        let tiles = numbers(&mut browser, tiles);
        assert!(
            tiles[1] > 0.0 && tiles[0] >= tiles[1],
            "with the map: {tiles:?}"
        );
        for (of, at_ms) in all.iter_mut().zip(numbers(&mut browser, TIMES)) {
            of.push(at_ms);
        }
    }
    let names = ["first words", "first controls", "first picture"];
    for ((name, wanted_ms), values) in names.iter().zip([800.0, 800.0, 1500.0]).zip(&mut all) {
        let [median, most] = [0.5, 1.0].map(|share| quantile(values, share));
        println!("{name} after {median:.0} ms, most of nine {most:.0} ms");
        assert!(median < LENIENCE * wanted_ms, "{name}: {values:?}");
    }
    let mut order = all.iter_mut().map(|values| quantile(values, 0.5));
    let [_, controls, picture] = [(); 3].map(|()| order.next().unwrap());
    assert!(controls < picture, "Stop works before all is there");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// Counts what a page draws and asks for.
const COUNTS: &str = "(() => { const { view } = tomoswarm, draw = view.draw.bind(view), asks = fetch, send = WebSocket.prototype.send;
    const next = requestAnimationFrame;
    globalThis.counted = { scenes: 0, turns: 0, asked: 0, said: 0 };
    view.draw = (now_ms) => { counted.scenes += 1; draw(now_ms); };
    globalThis.requestAnimationFrame = (act) => next((at) => { counted.turns += 1; act(at); });
    globalThis.fetch = (...of) => { counted.asked += 1; return asks(...of); };
    WebSocket.prototype.send = function (...of) { counted.said += 1; send.apply(this, of); }; })()";

#[test]
fn a_page_that_nobody_sees_draws_nothing_and_asks_for_nothing() {
    let (swarm, dash, relay) = relayed_page();
    let (_bus, _) = odometer(&swarm, 1);
    let Some(mut browser) = opened_through(&relay, &dash) else {
        return;
    };
    // A page with the seat, three dimensions and a view that looks again by itself has more to do than any other.
    crate::dash::take_seat(&mut browser);
    crate::page_3d::key(&mut browser, 'v');
    browser.until("tomoswarm.view.space?.frames > 3", 30);
    crate::dash::view(&mut browser, "check");
    browser.eval(COUNTS);
    let all = "(() => { const { model, view } = tomoswarm; return { ...counted, frames: model.frames, bytes: model.bytes, space: view.space.frames }; })()";
    let moves = |before: &Value, after: &Value| {
        let number = |of: &Value, key: &str| of[key].as_u64().unwrap();
        let keys = [
            "frames", "bytes", "scenes", "turns", "space", "asked", "said",
        ];
        keys.map(|key| number(after, key) - number(before, key))
    };
    let over = Duration::from_secs(10);
    let watch = |browser: &mut Browser| {
        let (before, carried) = (browser.eval(all), relay.carried());
        std::thread::sleep(over);
        let carried = relay.carried() - carried;
        (moves(&before, &browser.eval(all)), carried)
    };
    let (seen, carried_seen) = watch(&mut browser);
    assert!(seen.iter().all(|count| *count > 0), "{seen:?}");

    browser.hide();
    // Two frames may be on their way still; the last that comes is never drawn.
    browser.until("(() => { const at = tomoswarm.model.frames; if (globalThis.at_frames === at) return performance.now() - globalThis.at_ms > 2000;
        [globalThis.at_frames, globalThis.at_ms] = [at, performance.now()]; return false; })()", 10);
    let (hidden, carried) = watch(&mut browser);
    println!(
        "frames, bytes of them, drawings of the scene, drawings, 3D drawings, questions, words in ten seconds: seen {seen:?}, {carried_seen} bytes on the line; hidden {hidden:?}, {carried} bytes on the line"
    );
    assert_eq!(hidden, [0; 7]);
    // What is left are pings.
    assert!(carried < 500, "{carried} bytes");

    browser.unhide();
    let before = browser.eval("tomoswarm.model.frames").as_u64().unwrap();
    browser.until(
        &format!("tomoswarm.model.frames > {before} + 20 && tomoswarm.feed.isOpen"),
        10,
    );
    // It comes back with the newest, not with what has passed.
    browser.until(
        "performance.now() - tomoswarm.model.states.get(9).at_ms < 1500",
        5,
    );
    assert_eq!(browser.complaints, Vec::<String>::new());
}
