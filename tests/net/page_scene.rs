//! What the page says of the scene beside drawing it, as a browser sees it of a simulation that is over: who has seen a
//! cell and when, slices of altitude, and what was found against time.

use serde_json::{Value, json};
use tomoswarm::dash::frame::{self, FrameKind};
use tomoswarm::time::Time;
use tomoswarm_proto::TILE_CELLS;

use crate::browser::Browser;
use crate::dash::{Dash, every_control_has_a_name, pixel, shot, view};
use crate::page_3d::looked_at;
use crate::page_figures::field;
use crate::sim_page::SimulationWithPage;

/// A tile is this wide: 32 cells of 0.2 m.
const TILE_M: f64 = 6.4;
/// What is said of a cell.
const SAID: &str = "document.getElementById('cell').innerText";

/// Asks the server for a cell.
fn cell(dash: &Dash, query: &str, token: &str) -> (u16, String) {
    let (status, answer) = dash.ask(&format!(
        "GET /cell?{query} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nAuthorization: Bearer {token}\r\nConnection: close\r\n\r\n",
        dash.port
    ));
    let body = answer.split_once("\r\n\r\n").map_or("", |(_, body)| body);
    (status, body.to_owned())
}

/// Moves the pointer to a place of the scene, without a button.
fn point_at(browser: &mut Browser, [x_m, y_m]: [f64; 2]) {
    let at = browser.eval(&format!(
        "(() => {{ const {{ scene }} = tomoswarm, box = scene.canvas.getBoundingClientRect(), [x, y] = scene.toPixel({x_m}, {y_m});
           return [box.left + x, box.top + y]; }})()"
    ));
    let params = json!({"type": "mouseMoved", "x": at[0], "y": at[1]});
    browser.ask("Input.dispatchMouseEvent", params);
}

/// The middle of a cell that is occupied, metres.
fn occupied(browser: &mut Browser) -> [f64; 2] {
    let found = browser.eval(
        "(() => { const cell = tomoswarm.model.place.cell_m, [[x0, y0], [x1, y1]] = tomoswarm.model.place.area;
           for (let x = x0 + cell / 2; x < x1; x += cell) for (let y = y0 + cell / 2; y < y1; y += cell) {
             if (tomoswarm.scene.cellWord(x, y) === 'occupied') return [x, y]; }
           return null; })()",
    );
    [0, 1].map(|axis| found[axis].as_f64().unwrap())
}

#[test]
fn a_cell_says_who_has_seen_it_what_and_when_to_pointer_and_key_and_of_an_earlier_moment() {
    let folder = tempfile::tempdir().unwrap();
    let Some((simulation, mut browser)) = looked_at(folder.path()) else {
        return;
    };
    let wall = occupied(&mut browser);
    point_at(&mut browser, wall);
    browser.until(
        &format!("/: occupied\\n(.*\\n)*.*vehicle [12] \\(start 1\\): occupied \\(occupied with [5-9][0-9] %\\); its tile changed .* ago/.test({SAID})"),
        10,
    );
    shot(&mut browser, "cell");
    // What the page says is what the server says.
    let dash = &simulation.dash;
    let token = Dash::token(&dash.look);
    let query = format!("x={}&y={}", wall[0], wall[1]);
    let (status, body) = cell(dash, &query, token);
    assert_eq!(status, 200, "{body}");
    let read: Value = serde_json::from_str(&body).unwrap();
    let told = read["told"].as_array().unwrap();
    assert!(!told.is_empty() && told.len() <= 2, "{body}");
    for row in told {
        let line = format!("vehicle {} (start {})", row["vehicle"], row["boot"]);
        browser.until(&format!("{SAID}.includes('{line}')"), 5);
    }
    for (query, token, expected) in [
        (query.as_str(), "", 401),
        (&query, "nonsense", 401),
        ("x=1", token, 400),
        ("x=1&y=north", token, 400),
        ("x=inf&y=1", token, 400),
        ("x=1&y=1&slice=70000", token, 400),
        ("x=1e300&y=-1e300", token, 200),
    ] {
        let (status, body) = cell(dash, query, token);
        assert_eq!(status, expected, "{query} {token:?}: {body}");
    }

    // Before anybody had looked there nobody has said anything.
    browser.eval("tomoswarm.time.goTo(0.3, 0); 0");
    browser.until(
        "tomoswarm.model.moment.speed === 0 && tomoswarm.model.shown_ms < 500 && !tomoswarm.model.isFilling",
        10,
    );
    browser.until(
        &format!("{SAID}.includes(': unknown') && {SAID}.includes('No vehicle says anything')"),
        10,
    );
    browser.key("n", "KeyN", 78);
    browser.until(&format!("{SAID}.includes(': occupied')"), 10);

    // By the keyboard alone: the middle of what is seen, which arrows move.
    browser.ask(
        "Input.dispatchMouseEvent",
        json!({"type": "mouseMoved", "x": 5, "y": 5}),
    );
    browser.until("document.getElementById('cell').hidden", 5);
    browser.eval("tomoswarm.scene.canvas.focus()");
    browser.key("c", "KeyC", 67);
    browser.until("!document.getElementById('cell').hidden", 5);
    let before = browser.eval("JSON.stringify(tomoswarm.scene.cell)");
    browser.key("ArrowRight", "ArrowRight", 39);
    browser.until(
        &format!(
            "JSON.stringify(tomoswarm.scene.cell) !== '{}'",
            before.as_str().unwrap()
        ),
        5,
    );
    every_control_has_a_name(&mut browser);
    // In three dimensions as well.
    browser.key("v", "KeyV", 86);
    browser.until("tomoswarm.view.space?.frames > 0", 10);
    browser.until(
        "tomoswarm.view.space.layers.groups.get('cell')?.visible === true",
        5,
    );
    shot(&mut browser, "cell_3d");
    browser.key("Escape", "Escape", 27);
    browser.until("document.getElementById('cell').hidden", 5);
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// Gives the page's model a tile of a slice at a place as the feed would.
fn take_tile(browser: &mut Browser, at: [f64; 2], slice: i16, value: i8) {
    let [x, y] = at.map(|metres| (metres / TILE_M).floor() as i32);
    let record = frame::tile(slice, x, y, &[value; TILE_CELLS]);
    let bytes = frame::records(FrameKind::Tiles, Time::ZERO, 1, &record);
    let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    browser.eval(&format!(
        "(() => {{ const {{ model, scene }} = tomoswarm, shown_ms = model.shown_ms;
           model.take(new Uint8Array('{hex}'.match(/../g).map((b) => parseInt(b, 16))).buffer, performance.now());
           model.shown_ms = shown_ms; scene.wanted(); }})()"
    ));
}

/// Waits until the scene is drawn, and returns how bright it is at a place.
fn brightness(browser: &mut Browser, at: [f64; 2]) -> u64 {
    browser.eval("new Promise((drawn) => { tomoswarm.scene.wanted(); setTimeout(drawn, 200); })");
    pixel(browser, at)[0]
}

#[test]
fn one_slice_of_altitude_is_shown_or_all_by_a_list_and_by_a_key() {
    let folder = tempfile::tempdir().unwrap();
    let Some((_simulation, mut browser)) = looked_at(folder.path()) else {
        return;
    };
    let off = "(() => { for (const name of ['image', 'plan', 'tracks']) { const box = document.getElementById(`layer-${name}`); if (box.checked) box.click(); } })()";
    browser.eval(off);
    assert_eq!(
        browser.eval("document.getElementById('slice-choice').hidden"),
        true,
        "there is nothing to choose"
    );
    browser.key("l", "KeyL", 76);
    let says = "document.getElementById('stop-result').textContent";
    browser.until(&format!("{says}.includes('one slice')"), 5);

    // A copter's tile above: occupied all over where the ground is free.
    let free = browser.eval(
        "(() => { const { model, scene } = tomoswarm, cell = model.place.cell_m;
           const near = [...model.states.values()];
           for (let x = cell / 2; x < 3; x += cell) for (let y = cell / 2; y < 3; y += cell) {
             const isClear = near.every((state) => Math.hypot(state.x - x, state.y - y) > 1)
               && (model.finds.get(1)?.finds ?? []).every(({ at }) => Math.hypot(at[0] - x, at[1] - y) > 1);
             if (isClear && scene.cellWord(x, y) === 'free') return [x, y]; }
           return null; })()",
    );
    let free = [0, 1].map(|axis| free[axis].as_f64().unwrap());
    take_tile(&mut browser, free, 1, 17);
    browser.until("!document.getElementById('slice-choice').hidden", 5);
    let choose = |slice: &str| {
        format!(
            "(() => {{ const s = document.getElementById('slice'); s.value = '{slice}'; s.dispatchEvent(new Event('change')); }})()"
        )
    };
    let word = format!("tomoswarm.scene.cellWord({}, {})", free[0], free[1]);
    for (slice, expected) in [("", "occupied"), ("0", "free"), ("1", "occupied")] {
        browser.eval(&choose(slice));
        assert_eq!(browser.eval(&word), expected, "slice {slice:?}");
        let bright = brightness(&mut browser, free);
        assert_eq!(
            bright < 60,
            expected == "occupied",
            "slice {slice:?}: {bright}"
        );
    }
    // Free above hides nothing that stands below.
    let wall = {
        browser.eval(&choose("0"));
        occupied(&mut browser)
    };
    take_tile(&mut browser, wall, 1, -17);
    browser.eval(&choose(""));
    let word = format!("tomoswarm.scene.cellWord({}, {})", wall[0], wall[1]);
    assert_eq!(browser.eval(&word), "occupied");

    let shown = "String(tomoswarm.scene.map.slice)";
    for expected in ["0", "1", "null"] {
        browser.key("l", "KeyL", 76);
        browser.until(&format!("{shown} === '{expected}'"), 5);
    }
    browser.until(&format!("{says}.includes('all altitudes')"), 5);
    every_control_has_a_name(&mut browser);
    let options = "[...document.getElementById('slice').options].map((o) => o.textContent).join()";
    // The venue names the borders of the lowest.
    let names = "all altitudes,slice 0, 0 to 2 m,slice 1";
    assert_eq!(browser.eval(options), names);
    browser.key("v", "KeyV", 86);
    browser.until(
        "tomoswarm.view.space?.layers.groups.get('walls')?.children.length === 1",
        10,
    );
    shot(&mut browser, "slices_3d");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn finds_have_ellipses_and_their_deviation_strength_and_probability_are_drawn_against_time() {
    let folder = tempfile::tempdir().unwrap();
    let Some((_simulation, mut browser)) = looked_at(folder.path()) else {
        return;
    };
    view(&mut browser, "image");
    browser.until("tomoswarm.model.finds.get(1)?.earlier.length === 1", 10);
    browser.until(
        "/find 1 at x .* m \\(± [0-9.]+ m; ellipse [0-9.]+ × [0-9.]+ m, the longer -?[0-9]+° from x\\)/.test(document.getElementById('finds').innerText)",
        10,
    );
    browser.until("!document.getElementById('finds-measure-choice').hidden", 5);
    let inked = "(() => { const c = document.getElementById('finds-history'); const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
        let count = 0; for (let i = 3; i < d.length; i += 4) count += d[i] > 128 ? 1 : 0; return count; })()";
    let mut drawn = Vec::new();
    for measure in ["deviation", "strength", "probability"] {
        browser.eval(&format!("(() => {{ const s = document.getElementById('finds-measure'); s.value = '{measure}'; s.dispatchEvent(new Event('change')); }})()"));
        browser.eval("new Promise((drawn) => setTimeout(drawn, 200))");
        if browser.eval("document.getElementById('finds-history').hidden") == json!(true) {
            assert_eq!(measure, "probability", "that alone may be unknown");
            continue;
        }
        drawn.push(browser.eval(inked).as_u64().unwrap());
        assert!(*drawn.last().unwrap() > 100, "{measure}: {drawn:?}");
    }
    assert!(drawn.len() >= 2 && drawn[0] != drawn[1], "{drawn:?}");
    // The ellipse lies around the find in the picture.
    let around = browser.eval(
        "(() => { const { model } = tomoswarm, image = model.images.get(1), [find] = model.finds.get(1).finds, over = document.getElementById('heat-finds');
           const share = (metres, least, greatest) => (metres * 1000 - least) / (greatest - least);
           const { major_m, angle_rad } = find.ellipse, end = [find.at[0] + major_m * Math.cos(angle_rad), find.at[1] + major_m * Math.sin(angle_rad)];
           const x = share(end[0], image.least_x_mm, image.greatest_x_mm) * over.width, y = over.height * (1 - share(end[1], image.least_y_mm, image.greatest_y_mm));
           const near = over.getContext('2d').getImageData(Math.round(x) - 2, Math.round(y) - 2, 5, 5).data;
           return near.some((v, i) => i % 4 === 3 && v > 100); })()",
    );
    assert_eq!(around, json!(true));
    every_control_has_a_name(&mut browser);
    shot(&mut browser, "finds");
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn vehicles_that_measure_nothing_say_whom_they_hear() {
    let folder = tempfile::tempdir().unwrap();
    let Some(mut browser) = Browser::open(1280, 800) else {
        return;
    };
    let config = field(folder.path(), 3);
    let out = folder.path().join("out");
    let simulation = SimulationWithPage::of(&config, &out, &["--pace", "4"]);
    browser.go(&simulation.dash.look);
    view(&mut browser, "radio");
    let cell = |receiver: u8, transmitter: u8| {
        format!(
            "[...document.querySelectorAll('#radio-matrix button')].find((of) => of.getAttribute('aria-label').startsWith('{receiver} hears {transmitter}: '))"
        )
    };
    for (receiver, transmitter) in [(1, 2), (2, 1), (1, 3), (3, 2)] {
        let of = cell(receiver, transmitter);
        browser.until(
            &format!("{of}?.textContent === 'heard' && {of}.getAttribute('aria-label').endsWith(': yes, by its own word')"),
            30,
        );
    }
    assert_eq!(browser.eval("tomoswarm.model.pairs.size"), 0, "no samples");
    let unit = browser.eval("document.getElementById('radio-unit').textContent");
    assert!(
        unit.as_str().unwrap().contains("by the vehicle's own word"),
        "{unit}"
    );
    // Who says no more that it hears somebody is not taken to.
    browser.eval("(() => { tomoswarm.model.vehicles.get(1).health.hears = []; tomoswarm.model.changed.add('vehicle'); tomoswarm.scene.wanted(); })()");
    let silent = cell(1, 2);
    browser.until(&format!("{silent}.textContent === '–'"), 5);
    shot(&mut browser, "radio-heard");
    assert_eq!(browser.complaints, Vec::<String>::new());
}
