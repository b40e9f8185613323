//! Where somebody truly stands, marked from the operator's page: by pointing and by typing, seen by all, stored, taken back;
//! and who may not.

use serde_json::json;
use tomoswarm::store::ground::GroundStore;
use tomoswarm_proto::{RunId, VehicleId};

use crate::browser::Browser;
use crate::dash::{Dash, every_control_has_a_name, hold, pixel, prepared, shot, view};
use crate::swarm::Swarm;

/// The colour of a mark in the scene.
const MARK: [u64; 3] = [0x7a, 0x1f, 0xa0];

/// The marks of run 1 that the ground station has stored, metres.
fn stored(swarm: &Swarm) -> Vec<[f64; 2]> {
    let store = GroundStore::open_to_read(&swarm.path("state-g/ground.sqlite")).unwrap();
    let marks = store.marks(RunId(1)).unwrap();
    marks
        .iter()
        .map(|mark| [mark.at.x_m, mark.at.y_m])
        .collect()
}

/// Waits until the page knows these marks as stored, and no other.
fn until_known(browser: &mut Browser, places: &[[f64; 2]]) {
    let places = json!(places);
    browser.until(
        &format!(
            "JSON.stringify(tomoswarm.model.marks.marks.map(({{ at }}) => at)) === JSON.stringify({places})
             && tomoswarm.model.marks.marks.every(({{ state, run }}) => state === 'stored' && run === 1)"
        ),
        20,
    );
}

/// A running swarm in run 1, and a page that may order.
fn driving() -> (Swarm, Dash) {
    let mut swarm = prepared();
    swarm.run();
    let dash = Dash::start(&mut swarm);
    swarm.begin();
    swarm.until("a run is under way", 60, |watch| {
        watch.report().run == RunId(1)
    });
    (swarm, dash)
}

#[test]
fn a_place_that_is_typed_or_pointed_at_is_marked_seen_stored_and_taken_back() {
    let Some(mut browser) = Browser::open(1440, 900) else {
        return;
    };
    let (mut swarm, dash) = driving();
    browser.go(&dash.operate);
    browser.until("tomoswarm.model.ground?.run === 1", 20);

    // By the keyboard alone: a key leads there, two numbers, Enter.
    browser.key("m", "KeyM", 77);
    browser.until("document.activeElement.id === 'mark-x'", 5);
    browser.ask("Input.insertText", json!({"text": "-0.5"}));
    browser.key("Tab", "Tab", 9);
    browser.ask("Input.insertText", json!({"text": "2.25"}));
    browser.until(
        "document.getElementById('mark-command').textContent === 'tomoswarm order CONFIG mark -- -0.5,2.25'",
        5,
    );
    shot(&mut browser, "mark_typed");
    // Enter does what the button does, once that may be pressed.
    browser.until("!document.getElementById('mark-give').disabled", 5);
    let enter = json!({"type": "keyDown", "key": "Enter", "code": "Enter", "windowsVirtualKeyCode": 13, "text": "\r"});
    browser.ask("Input.dispatchKeyEvent", enter);
    until_known(&mut browser, &[[-0.5, 2.25]]);
    assert_eq!(stored(&swarm), [[-0.5, 2.25]]);

    // By the pointer, in the scene.
    hold(&mut browser, "#mark-point", 0);
    let at = browser.eval(
        "(() => { const { scene } = tomoswarm, box = scene.canvas.getBoundingClientRect(), [x, y] = scene.toPixel(3, 3.5);
           return [box.left + x, box.top + y]; })()",
    );
    browser.click_at([0, 1].map(|axis| at[axis].as_f64().unwrap()));
    browser.until(
        "Math.abs(document.getElementById('mark-x').value - 3) < 0.1 && Math.abs(document.getElementById('mark-y').value - 3.5) < 0.1",
        5,
    );
    // A moment between both is looked back at later.
    browser.eval("new Promise((later) => setTimeout(later, 1000))");
    // A pixel of the scene is some centimetres.
    browser.eval("(() => { for (const [id, value] of [['mark-x', 3], ['mark-y', 3.5]]) document.getElementById(id).value = value; })()");
    hold(&mut browser, "#mark-give", 0);
    until_known(&mut browser, &[[-0.5, 2.25], [3.0, 3.5]]);
    // Whoever marks by the command is seen as well.
    swarm.order(&["mark", "1.25,5", "--timeout", "20"]);
    until_known(&mut browser, &[[-0.5, 2.25], [1.25, 5.0], [3.0, 3.5]]);
    let is_drawn = |browser: &mut Browser| pixel(browser, [3.0, 3.5])[..3] == MARK;
    browser.eval("new Promise((drawn) => { tomoswarm.scene.wanted(); setTimeout(drawn, 300); })");
    assert!(
        is_drawn(&mut browser),
        "{:?}",
        pixel(&mut browser, [3.0, 3.5])
    );
    every_control_has_a_name(&mut browser);
    shot(&mut browser, "marks");
    seen_in_three_dimensions(&mut browser);

    browser.eval(
        "[...document.querySelectorAll('#mark-list button')].find((b) => b.getAttribute('aria-label').includes('x 1.25, y 5.00')).click()",
    );
    until_known(&mut browser, &[[-0.5, 2.25], [3.0, 3.5]]);
    assert_eq!(stored(&swarm).len(), 2);
    browser.until(
        "document.getElementById('mark-given').innerText.includes('run 1: (1.25, 5) is not marked now')",
        10,
    );

    before_the_last(&mut browser);
    assert_eq!(browser.complaints, Vec::<String>::new());

    // A page whose program begins late knows what was marked before.
    let words = ["dash", "operator.toml", "--port", "0"];
    browser.go("about:blank");
    swarm.kill("dash");
    swarm.spawn("late", &words);
    let late = Dash::of_log(&swarm.path("late.log"));
    browser.go(&late.look);
    until_known(&mut browser, &[[-0.5, 2.25], [3.0, 3.5]]);
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// A mark is a post of its colour in three dimensions, with its word.
fn seen_in_three_dimensions(browser: &mut Browser) {
    browser.eval("document.getElementById('view-space').click()");
    browser.until(
        "tomoswarm.view.space?.layers.groups.get('marks')?.children.length >= 18",
        10,
    );
    // Three marks, each with its word.
    browser.until(
        "[...tomoswarm.view.space.layers.labels.made.keys()].filter((key) => key.startsWith('12 marked')).length === 3",
        5,
    );
    let post = browser.eval(
        "(() => { const { canvas, camera } = tomoswarm.view.space;
           const flat = document.createElement('canvas'); [flat.width, flat.height] = [canvas.width, canvas.height];
           const pen = flat.getContext('2d'); pen.drawImage(canvas, 0, 0);
           const at = camera.position.clone().set(3, 3.5, 1.0).project(camera);
           const px = Math.round((at.x + 1) / 2 * flat.width), py = Math.round((1 - at.y) / 2 * flat.height);
           const near = pen.getImageData(px - 3, py - 3, 7, 7).data, all = [];
           for (let i = 0; i < near.length; i += 4) all.push([near[i], near[i + 1], near[i + 2]]);
           return all; })()",
    );
    let is_of_mark = |of: &serde_json::Value| {
        (0..3).all(|channel| of[channel].as_i64().unwrap().abs_diff(MARK[channel] as i64) <= 6)
    };
    let near = post.as_array().unwrap();
    assert!(near.iter().any(is_of_mark), "{post}");
    shot(browser, "marks_3d");
    browser.eval("document.getElementById('view-plane').click()");
}

/// The log says what happened, and a moment before that shows what was known then; from there nothing is marked.
fn before_the_last(browser: &mut Browser) {
    view(browser, "log");
    browser.eval("(() => { const s = document.getElementById('log-kind'); s.value = 'mark'; s.dispatchEvent(new Event('change')); })()");
    for line in [
        "mark 1: mark (-0.5, 2.25), by page 1",
        "run 1: marked (3, 3.5)",
        "run 1: the mark at (1.25, 5) is taken back",
    ] {
        let has = format!("document.getElementById('log-list').innerText.includes('{line}')");
        browser.until(&has, 10);
    }
    let of_mark = "tomoswarm.model.markers.filter((mark) => mark.kind === 'mark' && mark.text.startsWith('run 1: marked'))";
    browser.until(&format!("{of_mark}.length >= 3"), 20);
    browser.eval(&format!(
        "(() => {{ const marks = {of_mark}; tomoswarm.time.goTo((marks[0].at_s + marks[1].at_s) / 2, 0); }})()"
    ));
    browser.until("document.title.startsWith('REPLAY')", 10);
    until_known(browser, &[[-0.5, 2.25]]);
    view(browser, "marks");
    browser.until(
        "getComputedStyle(document.getElementById('mark-form')).display === 'none'",
        5,
    );
    shot(browser, "marks_before");
    browser.key("n", "KeyN", 78);
    until_known(browser, &[[-0.5, 2.25], [3.0, 3.5]]);
}

#[test]
fn whoever_may_not_marks_nothing() {
    let (swarm, dash) = driving();
    let own = format!("127.0.0.1:{}", dash.port);
    let origin = format!("http://{own}");
    let evil = format!("evil.example:{}", dash.port);
    let evil_origin = format!("http://{evil}");
    let (operate, look) = (Dash::token(&dash.operate), Dash::token(&dash.look));
    let none = String::new();
    let mark = r#"{"at":[2,2],"page":1}"#;
    for (host, origin, token, body, expected) in [
        (&own, &origin, operate, "{}", 400),
        (&own, &origin, operate, r#"{"at":[1e9,2],"page":1}"#, 400),
        (
            &own,
            &origin,
            operate,
            r#"{"at":[2,2],"page":1,"run":0}"#,
            400,
        ),
        (&evil, &evil_origin, operate, mark, 421),
        (&own, &evil_origin, operate, mark, 403),
        (&own, &none, operate, mark, 403),
        (&own, &origin, "", mark, 401),
        (&own, &origin, &operate[1..], mark, 401),
        (&own, &origin, look, mark, 403),
        (&own, &origin, operate, &" ".repeat(5000), 413),
    ] {
        let (status, answer) = dash.post_to("/mark", (host, origin), token, body);
        assert_eq!(
            status, expected,
            "{host} {origin} {token} {body:.40}: {answer}"
        );
    }
    let (status, answer) = dash.ask(&format!(
        "GET /mark HTTP/1.1\r\nHost: {own}\r\nAuthorization: Bearer {operate}\r\nConnection: close\r\n\r\n"
    ));
    assert_eq!(status, 405, "{answer}");
    // The one that may is stored alone, without the seat.
    let here = r#"{"at":[3,3],"page":1}"#;
    let (status, answer) = dash.post_to("/mark", (&own, &origin), operate, here);
    assert!(
        status == 200 && answer.ends_with("{\"number\":1}"),
        "{answer}"
    );
    let began = std::time::Instant::now();
    while stored(&swarm).is_empty() {
        assert!(began.elapsed().as_secs() < 20, "it is not stored");
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    assert_eq!(stored(&swarm), [[3.0, 3.0]]);
    assert!(swarm.look(|watch| watch.view.state(VehicleId(1)).is_some()));
}
