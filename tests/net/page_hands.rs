//! Keys, fingers and links at the operator's page, and what it says when its program does not answer. Nobody else is there:
//! what is ordered reaches nobody.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::browser::Browser;
use crate::dash::{Dash, prepared, take_seat};
use crate::swarm::Swarm;
use crate::websocket::{Incoming, WebSocket, text_message, upgrade};

fn opened(width: u32) -> Option<(Browser, Swarm, Dash)> {
    let mut browser = Browser::open(width, 900)?;
    let mut swarm = prepared();
    let dash = Dash::start(&mut swarm);
    browser.go(&dash.operate);
    browser.until("tomoswarm.feed.isOpen && tomoswarm.scene.view", 20);
    Some((browser, swarm, dash))
}

/// Presses the space key; returns the number of the stop.
fn press_stop(browser: &mut Browser) -> Value {
    browser.eval("delete document.documentElement.dataset.stopNumber");
    browser.key(" ", "Space", 32);
    browser.until("document.documentElement.dataset.stopNumber", 5);
    browser.eval("document.documentElement.dataset.stopNumber")
}

fn focus(browser: &mut Browser, id: &str) {
    browser.eval(&format!("document.getElementById('{id}').focus()"));
}

fn touch(browser: &mut Browser, kind: &str, places: &[[f64; 2]]) {
    let points = places.iter().enumerate();
    let points: Vec<Value> = points
        .map(|(id, [x, y])| json!({ "x": x, "y": y, "id": id }))
        .collect();
    let params = json!({ "type": kind, "touchPoints": points });
    browser.ask("Input.dispatchTouchEvent", params);
}

fn middle_of(browser: &mut Browser, id: &str) -> [f64; 2] {
    let script = format!(
        "(() => {{ const r = document.getElementById('{id}').getBoundingClientRect(); \
         return [r.left + r.width / 2, r.top + r.height / 2]; }})()"
    );
    serde_json::from_value(browser.eval(&script)).unwrap()
}

#[test]
fn keys_fingers_and_links_do_what_the_page_says() {
    let Some((mut browser, _swarm, dash)) = opened(1440) else {
        return;
    };
    let ticked = "document.getElementById('layer-links').checked";
    focus(&mut browser, "layer-links");
    browser.key("Enter", "Enter", 13);
    assert_eq!(browser.eval(ticked), true, "Enter ticks a box");
    let first = press_stop(&mut browser);
    assert_eq!(browser.eval(ticked), true, "Space is Stop there, too");
    browser.key("Enter", "Enter", 13);
    assert_eq!(browser.eval(ticked), false);
    std::thread::sleep(Duration::from_millis(600));
    assert_eq!(press_stop(&mut browser), first, "nobody is reached");

    take_seat(&mut browser);
    starts_once_for_each_hold(&mut browser);
    assert_ne!(press_stop(&mut browser), first, "a start came between");
    two_fingers_zoom(&mut browser);
    a_run_stays_chosen(&mut browser);
    a_stop_that_finds_no_connection_is_sent_until_it_is_delivered(&mut browser);
    the_list_of_keys_keeps_nobody_from_stop(&mut browser);
    commands_are_named(&mut browser);

    browser.ask("Emulation.setLocaleOverride", json!({ "locale": "en-US" }));
    let midnight = "import('/model.js').then(({ timeOfDay }) => timeOfDay(new Date(Date.UTC(2026, 0, 1, 0, 5)), false))";
    assert_eq!(browser.eval(midnight), "00:05:00");

    let look = Dash::token(&dash.look);
    browser.eval(&format!("location.hash = '#look={look}'; 0"));
    // A page that is just being left answers nothing.
    std::thread::sleep(Duration::from_secs(2));
    browser.until(
        "document.documentElement?.dataset.mayStop === 'no' && globalThis.tomoswarm?.model.place?.mayOrder === false",
        20,
    );
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// Enter that repeats itself gives one start, and so does a finger; one that slides off gives none.
fn starts_once_for_each_hold(browser: &mut Browser) {
    browser.eval(
        "globalThis.starts = 0; globalThis.fetch = ((fetch) => (to, how) => { \
         if (how?.body && JSON.parse(how.body).order === 'start') starts += 1; return fetch(to, how); })(fetch); 0",
    );
    focus(browser, "start");
    browser.key_part("keyDown", "Enter", "Enter", 13);
    for _ in 0..35 {
        let again = json!({
            "type": "keyDown", "key": "Enter", "code": "Enter", "windowsVirtualKeyCode": 13, "autoRepeat": true,
        });
        browser.ask("Input.dispatchKeyEvent", again);
        std::thread::sleep(Duration::from_millis(100));
    }
    browser.key_part("keyUp", "Enter", "Enter", 13);
    assert_eq!(browser.eval("starts"), 1, "held once, by Enter");

    browser.ask(
        "Emulation.setTouchEmulationEnabled",
        json!({ "enabled": true, "maxTouchPoints": 2 }),
    );
    let start = middle_of(browser, "start");
    touch(browser, "touchStart", &[start]);
    browser.until("document.querySelector('#start.filling')", 5);
    touch(browser, "touchMove", &[[start[0], start[1] - 300.0]]);
    browser.until("!document.querySelector('#start.filling')", 5);
    std::thread::sleep(Duration::from_millis(1200));
    touch(browser, "touchEnd", &[]);
    assert_eq!(browser.eval("starts"), 1, "it slid off");
    touch(browser, "touchStart", &[start]);
    browser.until("starts === 2", 5);
    touch(browser, "touchEnd", &[]);
}

/// Three attempts fail at once, as when nobody listens at the other end of a tunnel for a moment.
fn a_stop_that_finds_no_connection_is_sent_until_it_is_delivered(browser: &mut Browser) {
    browser.eval(
        "globalThis.failed = 0; globalThis.whole = fetch; globalThis.fetch = (to, how) => { \
         if (!how?.body || JSON.parse(how.body).order !== 'stop' || failed === 3) return whole(to, how); \
         failed += 1; return Promise.reject(new TypeError('refused')); }; 0",
    );
    let result = "document.getElementById('stop-result').textContent";
    browser.eval("delete document.documentElement.dataset.stopNumber");
    browser.key(" ", "Space", 32);
    browser.until(&format!("{result}.includes('is NOT DELIVERED')"), 2);
    browser.eval("tomoswarm.scene.wanted(); 0");
    browser.until("document.documentElement.dataset.stopNumber", 5);
    assert_eq!(browser.eval("failed"), 3);
    let shown = browser.eval(result);
    assert!(
        !shown.as_str().unwrap().contains("NOT DELIVERED"),
        "{shown}"
    );
    assert_eq!(
        browser.eval("Boolean(document.querySelector('#bar.dead'))"),
        false
    );
    browser.eval("globalThis.fetch = whole; 0");
}

/// A phone has no space key: the button works beside the list.
fn the_list_of_keys_keeps_nobody_from_stop(browser: &mut Browser) {
    let is_open = "document.getElementById('keys').open";
    browser.eval("document.getElementById('help').click()");
    browser.until(is_open, 5);
    let [x, y] = middle_of(browser, "stop");
    let there = format!("document.elementFromPoint({x}, {y}).id");
    assert_eq!(browser.eval(&there), "stop");
    browser.eval("delete document.documentElement.dataset.stopNumber");
    touch(browser, "touchStart", &[[x, y]]);
    browser.until("document.documentElement.dataset.stopNumber", 5);
    touch(browser, "touchEnd", &[]);
    browser.key("Escape", "Escape", 27);
    browser.until(&format!("!{is_open}"), 5);
}

/// What is said beside the orders, and the seat, name their commands as well.
fn commands_are_named(browser: &mut Browser) {
    browser.eval("document.activeElement.blur(); 0");
    browser.key("c", "KeyC", 67);
    browser.until("document.querySelector('#cell code')", 10);
    for (of, command) in [
        ("#cell code", "tomoswarm tap CONFIG --kind tile --cells"),
        (
            "#seat-command code",
            "tomoswarm order CONFIG start --take-over",
        ),
        (
            "#why-command",
            "tomoswarm image run-N-links.csv --empty run-M-links.csv --why X,Y",
        ),
    ] {
        let named = browser.eval(&format!("document.querySelector('{of}').textContent"));
        assert_eq!(named, command);
    }
    browser.key("Escape", "Escape", 27);
    browser.until("document.getElementById('cell').hidden", 5);
}

/// Two fingers that part zoom about the place between them, and point at nothing.
fn two_fingers_zoom(browser: &mut Browser) {
    browser.eval("document.getElementById('plane').scrollIntoView(); tomoswarm.scene.setPick(() => { globalThis.picked = true; }); 0");
    let [x, y] = middle_of(browser, "plane");
    let seen = "(() => { const { x, y, scale } = tomoswarm.scene.view; return [x, y, scale]; })()";
    let before: [f64; 3] = serde_json::from_value(browser.eval(seen)).unwrap();
    touch(browser, "touchStart", &[[x - 50.0, y], [x + 50.0, y]]);
    for step in 1..=10 {
        let apart = 50.0 + f64::from(step) * 5.0;
        touch(browser, "touchMove", &[[x - apart, y], [x + apart, y]]);
    }
    touch(browser, "touchEnd", &[]);
    let after: [f64; 3] = serde_json::from_value(browser.eval(seen)).unwrap();
    assert!(
        (1.8..2.2).contains(&(after[2] / before[2])),
        "{before:?} {after:?}"
    );
    for axis in 0..2 {
        assert!(
            (before[axis] - after[axis]).abs() * before[2] < 5.0,
            "{before:?} {after:?}"
        );
    }
    assert_eq!(browser.eval("typeof picked"), "undefined");
    let one = [x + 3.0, y];
    touch(browser, "touchStart", &[one]);
    touch(browser, "touchEnd", &[]);
    browser.until("globalThis.picked", 5);
    browser.eval("tomoswarm.scene.setPick(null); 0");
}

/// The run that is compared with stays chosen while a connection begins anew, and while no ground station is heard.
fn a_run_stays_chosen(browser: &mut Browser) {
    let ground = "{ isHeard: true, age_s: 0, at_ms: 0, run: 3, laps: 1, lapsDone: 1, lost: [], troubles: [], \
        runs: [{ run: 3, kind: 'sweep', comparedWith: null, end: 'done', samples: '5', images: 1 }] }";
    let shows = |ground: &str| {
        format!(
            "new Promise((shown) => {{ const {{ model, scene }} = tomoswarm; model.ground = {ground}; model.changed.add('ground'); \
             scene.wanted(); requestAnimationFrame(() => requestAnimationFrame(() => shown(0))); }})"
        )
    };
    browser.eval("document.getElementById('tab-begin').click()");
    browser.eval(&shows(ground));
    browser.eval("document.getElementById('sweep-compared').click()");
    let command =
        "document.getElementById('begin-command').textContent.endsWith('--compare-with 3')";
    for ground in ["null", "{ isHeard: false }", ground] {
        assert_eq!(browser.eval(command), true, "before {ground}");
        browser.eval(&shows(ground));
    }
    assert_eq!(browser.eval(command), true);
    let chosen = browser.eval("document.getElementById('compare-with').value");
    assert_eq!(chosen, "3");
}

#[test]
fn a_page_whose_program_does_not_answer_says_that_it_cannot_stop_and_goes_on_trying() {
    let Some((mut browser, mut swarm, _dash)) = opened(1000) else {
        return;
    };
    // Whatever is asked of a program that is gone fails.
    browser.expect_complaints(&["WebSocket connection to", "/feed'"]);
    browser.expect_complaints(&["Failed to load resource: net::ERR_", "/order\""]);
    let is_lost = "document.querySelector('#bar.lost')";
    let result = "document.getElementById('stop-result').textContent";
    assert_eq!(browser.eval(&format!("Boolean({is_lost})")), false);
    swarm.stop_process("dash");
    browser.until(is_lost, 10);
    browser.until(&format!("{result}.includes('Cannot stop from here')"), 2);
    browser.key(" ", "Space", 32);
    assert_eq!(browser.eval(result), "Stop: sending …");
    browser.until(&format!("{result}.includes('Cannot stop from here')"), 5);
    browser.until("!tomoswarm.feed.isOpen", 20);
    swarm.let_process_go_on("dash");
    browser.until("document.documentElement.dataset.stopNumber", 10);
    browser.until(&format!("tomoswarm.feed.isOpen && !{is_lost}"), 20);
    swarm.kill("dash");
    browser.until(is_lost, 10);
}

#[test]
fn a_connection_that_answers_no_ping_gives_its_place_back_and_one_that_does_keeps_it() {
    let mut swarm = prepared();
    let dash = Dash::start(&mut swarm);
    let own = format!("127.0.0.1:{}", dash.port);
    let open = || {
        let headers = format!("Host: {own}\r\nOrigin: http://{own}\r\n");
        let (mut stream, head) = upgrade(dash.port, "/feed", &headers);
        assert!(head.contains(" 101 "), "{head}");
        let token = json!({ "token": Dash::token(&dash.look) }).to_string();
        std::io::Write::write_all(&mut stream, &text_message(&token)).unwrap();
        stream
    };
    let (mut dead, alive) = (open(), WebSocket(open()));
    let reads = std::thread::spawn(move || {
        let mut alive = alive;
        while !matches!(alive.next(), Incoming::End | Incoming::Close(..)) {}
    });
    let began = Instant::now();
    let mut buffer = [0; 4096];
    while std::io::Read::read(&mut dead, &mut buffer).is_ok_and(|read| read > 0) {}
    let after_s = began.elapsed().as_secs_f64();
    assert!((14.0..40.0).contains(&after_s), "closed after {after_s} s");
    std::thread::sleep(Duration::from_secs(2));
    assert!(!reads.is_finished(), "who answers stays");
    swarm.kill("dash");
    reads.join().unwrap();
}
