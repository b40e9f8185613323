//! What nodes say of themselves to a page: the lines of their logs, and their settings; to nobody who has not asked.

use std::time::{Duration, Instant};

use crate::browser::Browser;
use crate::dash::{Dash, live_page, prepared, view};

/// Lines of logs of a vehicle that the page shows; 0 = of the ground station.
fn lines(browser: &mut Browser, vehicle: u8) -> Vec<String> {
    let script = format!(
        "tomoswarm.model.events.filter((event) => event.kind === 'note' && (event.vehicles[0] ?? 0) === {vehicle}).map((event) => event.text)"
    );
    let shown = browser.eval(&script);
    let texts = shown.as_array().unwrap().iter();
    texts
        .map(|text| text.as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn a_page_shows_each_line_of_the_logs_once_and_the_settings_of_each_node() {
    let Some((mut browser, swarm, _dash)) = live_page(1280, 800) else {
        return;
    };
    let is_note = |vehicle: u8| {
        format!(
            "tomoswarm.model.events.some((event) => event.kind === 'note' && (event.vehicles[0] ?? 0) === {vehicle})"
        )
    };
    for node in [0, 1, 2] {
        browser.until(&is_note(node), 20);
    }
    // Of what was said before the page was there, too.
    let of_vehicle = lines(&mut browser, 2);
    let joined = |line: &&String| line.as_str() == "takes part in the bus";
    assert_eq!(
        of_vehicle.iter().filter(joined).count(),
        1,
        "{of_vehicle:?}"
    );
    let of_ground = lines(&mut browser, 0);
    let of_ground: Vec<&String> = of_ground
        .iter()
        .filter(|line| line.ends_with("takes part in the bus"))
        .collect();
    assert_eq!(of_ground, ["the ground station: takes part in the bus"]);
    // What happens later comes soon: a stop is in the vehicles' own words.
    browser.key(" ", "Space", 32);
    browser.until(
        "tomoswarm.model.events.some((event) => event.kind === 'note' && event.vehicles[0] === 1 && event.text.includes('stop'))",
        10,
    );
    view(&mut browser, "log");
    browser.eval("(() => { const kind = document.getElementById('log-kind'); kind.value = 'note'; kind.dispatchEvent(new Event('change')); })()");
    browser.until(
        "(() => { const rows = [...document.querySelectorAll('#log-list li')]; return rows.length > 3 && rows.every((row) => row.className === 'note'); })()",
        5,
    );

    view(&mut browser, "settings");
    let choose = |browser: &mut Browser, node: &str| {
        browser.until(
            &format!("document.querySelector('#settings-of option[value=\"{node}\"]') !== null"),
            10,
        );
        browser.eval(&format!(
            "(() => {{ const of = document.getElementById('settings-of'); of.value = '{node}'; of.dispatchEvent(new Event('change')); }})()"
        ));
    };
    let has_row = |text: &str| {
        format!(
            "[...document.querySelectorAll('#settings-list li code')].some((row) => row.textContent === '{text}')"
        )
    };
    for id in ["1", "2"] {
        choose(&mut browser, id);
        browser.until(&has_row(&format!("id = {id}")), 10);
        browser.until(&has_row("vehicle.radius_m = 0.25"), 5);
        // With its default, and what is allowed.
        browser.until(
            "[...document.querySelectorAll('#settings-list li')].some((row) => row.textContent.startsWith('vehicle.radius_m = 0.25 ') && row.textContent.endsWith('(default: 0.25; allowed: 0.05 to 2 m)'))",
            10,
        );
    }
    choose(&mut browser, "ground");
    browser.until(&has_row("kind = \"ground\""), 10);
    assert_eq!(browser.complaints, Vec::<String>::new());
    drop(swarm);
}

#[test]
fn nobody_says_lines_or_settings_who_was_not_asked() {
    let mut swarm = prepared();
    swarm.run();
    std::thread::sleep(Duration::from_secs(4));
    assert_eq!(
        swarm.look(|watch| watch.told_of_nodes),
        0,
        "nobody has asked"
    );
    let dash = Dash::start(&mut swarm);
    swarm.until("each node's settings, and lines", 20, |watch| {
        watch.told_of_nodes >= 6
    });
    let look = Dash::token(&dash.look);
    for (query, expected) in [
        ("?of=2", 200),
        ("?of=ground", 200),
        ("?of=9", 400),
        ("?of=0", 400),
        ("?of=x", 400),
        ("", 200),
    ] {
        let request = format!(
            "GET /settings{query} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nAuthorization: Bearer {look}\r\nConnection: close\r\n\r\n",
            dash.port
        );
        // Settings come in parts, one a second.
        let began = Instant::now();
        while dash.ask(&request).0 != expected {
            assert!(began.elapsed() < Duration::from_secs(10), "{query}");
            std::thread::sleep(Duration::from_millis(100));
        }
    }
}
