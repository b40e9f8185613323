//! The page's scene in three dimensions, and which links made a pixel, as a browser sees them: of a simulation, whose run
//! is over, and of a live swarm where a browser cannot draw it.

use std::path::Path;

use serde_json::Value;
use tomoswarm_proto::{StandReason, VehicleId};

use crate::browser::Browser;
use crate::dash::{Dash, every_control_has_a_name, prepared, shot, view};
use crate::sim_page::SimulationWithPage;
use crate::swarm::Swarm;

/// Which view of the scene is pressed.
const SHOWN: &str = "document.querySelector('.choice [aria-pressed=true]').id.replace('view-', '')";

/// A simulation that is over, seen in a browser at its end.
pub fn looked_at(folder: &Path) -> Option<(SimulationWithPage, Browser)> {
    let mut browser = Browser::open(1280, 800)?;
    let mut simulation = SimulationWithPage::start(folder, &[]);
    simulation.until_written();
    browser.go(&simulation.dash.look);
    browser.until(
        "tomoswarm.model.images.has(1) && tomoswarm.model.states.size === 2",
        20,
    );
    browser.until("tomoswarm.model.moment.to_s > 100", 10);
    Some((simulation, browser))
}

pub fn key(browser: &mut Browser, letter: char) {
    let upper = letter.to_ascii_uppercase();
    browser.key(
        &letter.to_string(),
        &format!("Key{upper}"),
        u32::from(upper),
    );
}

/// Waits until a view of the scene is shown and was drawn.
pub fn until_drawn(browser: &mut Browser, view: &str) {
    browser.until(&format!("{SHOWN} === '{view}'"), 10);
    browser.until(
        "tomoswarm.view.space.frames > (globalThis.frames_before ?? 0)",
        10,
    );
    browser.eval("globalThis.frames_before = tomoswarm.view.space.frames");
}

/// What the canvas of the three dimensions shows: how many colours there are, and the brightness, 0 to 255, of the middles of
/// occupied cells at the height of walls and of free cells on the ground.
fn seen(browser: &mut Browser) -> Value {
    browser.eval(
        "(() => { const { model, scene, view } = tomoswarm, { space } = view, { canvas, camera } = space;
           const flat = document.createElement('canvas'); [flat.width, flat.height] = [canvas.width, canvas.height];
           const pen = flat.getContext('2d'); pen.drawImage(canvas, 0, 0);
           const data = pen.getImageData(0, 0, flat.width, flat.height).data, colours = new Set();
           for (let i = 0; i < data.length; i += 4) colours.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
           const brightness = (x, y, z) => { const at = camera.position.clone().set(x, y, z).project(camera);
             const px = Math.round((at.x + 1) / 2 * flat.width), py = Math.round((1 - at.y) / 2 * flat.height), i = (py * flat.width + px) * 4;
             return (data[i] + data[i + 1] + data[i + 2]) / 3; };
           const cell = model.place.cell_m, occupied = [], free = [];
           for (let x = cell / 2; x < 6; x += cell) for (let y = cell / 2; y < 6; y += cell) {
             const word = scene.cellWord(x, y);
             if (word === 'occupied') occupied.push(brightness(x, y, 0.4));
             if (word === 'free') free.push(brightness(x, y, 0));
           }
           const middle = (all) => all.sort((a, b) => a - b)[Math.floor(all.length / 2)];
           return { colours: colours.size, occupied: middle(occupied), free: middle(free) }; })()",
    )
}

fn camera(browser: &mut Browser) -> [f64; 4] {
    let script = "(() => { const { position, matrixWorld } = tomoswarm.view.space.camera, [, , , , , , , , x, y] = matrixWorld.elements;
       return [...position.toArray(), Math.atan2(-y, -x)]; })()";
    let read = browser.eval(script);
    [0, 1, 2, 3].map(|part| read[part].as_f64().unwrap())
}

/// Holds a key of flight for a moment; returns how far the camera has moved to the east, north and up, and turned.
fn fly(browser: &mut Browser, letter: char) -> [f64; 4] {
    let before = camera(browser);
    let upper = letter.to_ascii_uppercase();
    let (text, code) = (letter.to_string(), format!("Key{upper}"));
    browser.key_part("keyDown", &text, &code, u32::from(upper));
    browser.eval("globalThis.frames_before = tomoswarm.view.space.frames");
    browser.until("tomoswarm.view.space.frames > frames_before + 2", 10);
    browser.key_part("keyUp", &text, &code, u32::from(upper));
    let after = camera(browser);
    [0, 1, 2, 3].map(|part| after[part] - before[part])
}

#[test]
fn in_three_dimensions_walls_differ_from_ground_and_keys_fly_ride_and_lead_back() {
    let folder = tempfile::tempdir().unwrap();
    let Some((_simulation, mut browser)) = looked_at(folder.path()) else {
        return;
    };
    key(&mut browser, 'v');
    until_drawn(&mut browser, "space");
    // Walls are made a moment after the map.
    browser.until(
        "tomoswarm.view.space.layers.groups.get('walls')?.children.length === 1",
        10,
    );
    let scene = seen(&mut browser);
    let number = |of: &str| {
        scene[of]
            .as_f64()
            .unwrap_or_else(|| panic!("{of}: {scene}"))
    };
    assert!(number("colours") > 50.0, "{scene}");
    assert!(number("occupied") < 130.0, "walls are dark: {scene}");
    assert!(number("free") > 220.0, "the ground is light: {scene}");
    shot(&mut browser, "space");

    let [_, north, up, _] = fly(&mut browser, 'w');
    assert!(north > 0.1 && up.abs() < 0.01, "{north} {up}");
    assert!(fly(&mut browser, 'd')[0] > 0.1, "D flies to the right");
    assert!(fly(&mut browser, 'e')[2] > 0.1, "E flies up");
    let here = camera(&mut browser);
    key(&mut browser, 'r');
    browser.until(
        &format!(
            "Math.abs(tomoswarm.view.space.camera.position.z - {}) > 0.05",
            here[2]
        ),
        5,
    );
    every_control_has_a_name(&mut browser);

    // With the vehicle that is selected.
    browser.key("2", "Digit2", 50);
    key(&mut browser, 'g');
    until_drawn(&mut browser, "ride");
    browser.until(
        "(() => { const { x, y } = tomoswarm.model.states.get(2), { position } = tomoswarm.view.space.camera;
           return Math.hypot(position.x - x, position.y - y) < 0.5; })()",
        5,
    );
    let [_, _, _, turned] = fly(&mut browser, 'a');
    assert!(turned > 0.02, "who rides looks to the left: {turned}");
    let ride = seen(&mut browser);
    assert!(ride["colours"].as_u64().unwrap() > 20, "{ride}");
    shot(&mut browser, "ride");

    key(&mut browser, 'v');
    browser.until(&format!("{SHOWN} === 'plane'"), 5);
    browser.until("!document.getElementById('plane').hidden", 5);
    keys_are_listed(&mut browser);
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// `?` lists every key, and Escape leads back.
fn keys_are_listed(browser: &mut Browser) {
    browser.key("?", "Slash", 191);
    browser.until("document.getElementById('keys').open", 5);
    let listed = browser
        .eval("[...document.querySelectorAll('#keys dt')].map((key) => key.textContent).join(' ')");
    for key in ["Space", "H", "V, G", "W A S D", "P, N", "[ ]", "?"] {
        assert!(listed.as_str().unwrap().contains(key), "{key}: {listed}");
    }
    browser.key("Escape", "Escape", 27);
    browser.until("!document.getElementById('keys').open", 5);
}

/// The numbers of dB/m in the words of the links, with their signs; "takes" is a minus.
const SUM_OF_SHARES: &str = "[...document.querySelectorAll('#why-links li')].reduce((sum, { textContent }) => {
    const [, word, value] = textContent.match(/ (adds?|takes?) ([0-9.]+) dB/); return sum + (word.startsWith('add') ? 1 : -1) * Number(value); }, 0)";
const VALUE: &str = "Number(document.getElementById('why-result').textContent.match(/: (-?[0-9.]+) dB.m is the sum/)[1])";

#[test]
fn a_click_on_the_image_says_which_links_made_the_pixel_and_their_shares_add_up_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let Some((_simulation, mut browser)) = looked_at(folder.path()) else {
        return;
    };
    view(&mut browser, "image");
    // The picture has its size when it is drawn, and its place when what stands around it is.
    browser.until(
        "(() => { const image = tomoswarm.model.images.get(1), heat = document.getElementById('heat'), box = heat.getBoundingClientRect();
           const at = [box.left, box.top, box.width, box.height].join(), isAtRest = at === globalThis.heat_at; globalThis.heat_at = at;
           const isDrawn = document.getElementById('heat-scale').textContent.includes(`Run ${image.run}, lap ${image.laps}, ${image.linksUsed} links`);
           return isDrawn && isAtRest; })()",
        10,
    );
    let says = "document.getElementById('why-result').textContent.includes('is the sum of')";
    let adds_up = |browser: &mut Browser| {
        browser.until(says, 20);
        let value = browser.eval(VALUE).as_f64().unwrap();
        let sum = browser.eval(SUM_OF_SHARES).as_f64().unwrap();
        // Seven numbers of three decimals.
        assert!((sum - value).abs() < 0.005, "{sum} is not {value}");
        value
    };
    // The brightest pixel, in the view of the image and in the scene.
    let brightest = "(() => { const image = tomoswarm.model.images.get(1), at = image.mean.indexOf(Math.max(...image.mean));
       const part = (index, count) => (index + 0.5) / count; const [across, up] = [part(at % image.columns, image.columns), part(Math.floor(at / image.columns), image.rows)];";
    let in_image = browser.eval(&format!(
        "{brightest} const heat = document.getElementById('heat'); heat.scrollIntoView(); const box = heat.getBoundingClientRect();
           return [box.left + across * box.width, box.bottom - up * box.height]; }})()"
    ));
    let place = |of: &Value| [0, 1].map(|axis| of[axis].as_f64().unwrap());
    browser.click_at(place(&in_image));
    let bright = adds_up(&mut browser);
    assert!(bright > 1.0, "the brightest pixel: {bright}");
    browser.until("tomoswarm.scene.why.lines.length > 3", 5);
    shot(&mut browser, "why");
    let is_named = browser.eval(
        "/^tomoswarm image run-[0-9]+-links.csv( --empty run-[0-9]+-links.csv)? --why -?[0-9.]+,-?[0-9.]+$/.test(document.getElementById('why-command').textContent)",
    );
    assert_eq!(is_named, true, "the command");
    links_have_a_length_and_a_thickness(&mut browser);

    browser.eval("document.getElementById('why-clear').click()");
    browser.until("tomoswarm.scene.why === null", 5);
    let in_scene = browser.eval(&format!(
        "{brightest} const mm = (least, greatest, share) => (least + share * (greatest - least)) / 1000;
           const [x, y] = tomoswarm.scene.toPixel(mm(image.least_x_mm, image.greatest_x_mm, across), mm(image.least_y_mm, image.greatest_y_mm, up));
           const box = tomoswarm.scene.canvas.getBoundingClientRect(); return [box.left + x, box.top + y]; }})()"
    ));
    browser.click_at(place(&in_scene));
    assert_eq!(adds_up(&mut browser), bright, "the same pixel");

    // Outside of the image nothing is asked, and by words it is refused with a reason.
    browser.expect_complaints(&["status of 400", "/why\""]);
    browser.eval("(() => { document.getElementById('why-x').value = '900'; document.getElementById('why-ask').click(); })()");
    browser.until(
        "document.getElementById('why-result').textContent.includes('outside of the image')",
        20,
    );
    browser.until("document.querySelectorAll('#why-links li').length === 0", 5);
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// Every link that made the pixel says how long it is and who measured it, and is the thicker the more it adds.
fn links_have_a_length_and_a_thickness(browser: &mut Browser) {
    let said = "[...document.querySelectorAll('#why-links li')].slice(0, 6).every(({ textContent }) => /, between 1, 2, (adds|takes) [0-9.]+ dB.m: [0-9.]+ m long, lost /.test(textContent))";
    let words = browser.eval("document.getElementById('why-links').innerText");
    assert_eq!(browser.eval(said), true, "{words}");
    let as_far = "tomoswarm.scene.why.lines.every(({ from, to, length_m }) => Math.abs(Math.hypot(from[0] - to[0], from[1] - to[1]) - length_m) < 0.01)";
    assert_eq!(browser.eval(as_far), true);
    key(browser, 'v');
    until_drawn(browser, "space");
    let widths = "(() => { const drawn = tomoswarm.view.space.layers.groups.get('why')?.children ?? [], { lines } = tomoswarm.scene.why;
        return drawn.map(({ geometry }, i) => { const at = geometry.attributes.position.array; return [Math.hypot(at[0] - at[3], at[1] - at[4]), lines[i].share]; }); })()";
    browser.until(&format!("{widths}.length > 3"), 10);
    let widths: Vec<[f64; 2]> = serde_json::from_value(browser.eval(widths)).unwrap();
    for [width_m, share] in &widths {
        let expected_m = 0.02 + 0.08 * share;
        assert!((width_m - expected_m).abs() < 0.002, "{width_m} m, {share}");
    }
    assert!(widths[0][0] > 1.2 * widths.last().unwrap()[0], "{widths:?}");
    shot(browser, "why-3d");
    key(browser, 'v');
    browser.until(&format!("{SHOWN} === 'plane'"), 5);
    // Its size has changed: where what stands is told when it is drawn.
    browser.until("tomoswarm.scene.view !== null", 10);
}

/// Asks for the scene in three dimensions, which is refused in words; then Space stops everybody.
fn stops_without_3d(browser: &mut Browser, swarm: &Swarm, dash: &Dash, reason: &str) {
    browser.go(&dash.operate);
    browser.until("tomoswarm.model.states.size === 2", 20);
    key(browser, 'v');
    let said = "document.getElementById('stop-result').textContent";
    browser.until(&format!("{said}.includes('3D cannot be shown here')"), 10);
    let words = browser.eval(said);
    assert!(words.as_str().unwrap().contains(reason), "{words}");
    browser.until(
        &format!("{SHOWN} === 'plane' && !document.getElementById('plane').hidden"),
        5,
    );
    browser.key(" ", "Space", 32);
    browser.until(&format!("{said}.includes('Stop is given')"), 5);
    swarm.until("everyone stands under a stop", 10, |watch| {
        (1..=2).all(|id| {
            let state = watch.view.state(VehicleId(id));
            state
                .is_some_and(|state| matches!(state.value.stands_under, Some(StandReason::Stop(_))))
        })
    });
}

#[test]
fn a_page_without_webgl_or_without_three_js_says_so_and_its_space_key_stops_everybody() {
    let blind = "--disable-3d-apis";
    let Some(mut browser) = Browser::open_with(1280, 800, blind) else {
        return;
    };
    browser.expect_complaints(&["THREE.WebGLRenderer", "WebGL context"]);
    let mut swarm = prepared();
    swarm.run();
    let dash = Dash::start(&mut swarm);
    swarm.until("all are there", 60, |watch| {
        (1..=2).all(|id| watch.view.state(VehicleId(id)).is_some())
    });
    stops_without_3d(&mut browser, &swarm, &dash, "WebGL");
    drop(browser);

    // The files of the page without the one that draws.
    let files = swarm.path("files");
    std::fs::create_dir(&files).unwrap();
    let web = concat!(env!("CARGO_MANIFEST_DIR"), "/web");
    for entry in std::fs::read_dir(web).unwrap() {
        let path = entry.unwrap().path();
        if path.is_file() {
            std::fs::copy(&path, files.join(path.file_name().unwrap())).unwrap();
        }
    }
    let lift = swarm.tool(&["order", "operator.toml", "start", "--timeout", "30"]);
    swarm.until(&format!("the stop is lifted: {lift}"), 10, |watch| {
        watch.view.open_stops().is_empty()
    });
    let words = ["dash", "operator.toml", "--port", "0", "--files", "files"];
    swarm.spawn("lacking", &words);
    let lacking = Dash::of_log(&swarm.path("lacking.log"));
    let mut browser = Browser::open(1280, 800).unwrap();
    browser.expect_complaints(&["status of 404", "/three.js\""]);
    stops_without_3d(&mut browser, &swarm, &lacking, "scene3d.js");
    browser.until(
        "performance.getEntriesByType('resource').some(({ name, responseStatus }) => name.endsWith('three.js') && responseStatus === 404)",
        5,
    );
}
