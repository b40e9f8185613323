//! Two pages and the seat, as two browsers see it, and another operator who takes the lease while a button is held.

use serde_json::Value;
use tomoswarm_proto::{OrderKind, VehicleId};

use crate::browser::Browser;
use crate::dash::{hold, live_page, shot, take_seat};
use crate::swarm::Swarm;

const SEAT: &str = "document.getElementById('seat').textContent";
const TAKES: &str = "document.getElementById('take-seat').textContent";
const SAID: &str = "document.getElementById('stop-result').textContent";

fn page(browser: &mut Browser) -> u64 {
    let page = browser.eval("tomoswarm.model.place.page");
    page.as_u64().unwrap()
}

/// Waits until a page sees that it has the seat, and may order.
fn sees_its_own(browser: &mut Browser) {
    browser.until(&format!("{SEAT}.startsWith('seat: this page')"), 10);
    browser.until("!document.getElementById('start').disabled", 5);
    browser.until("document.getElementById('take-seat').disabled", 5);
}

/// Waits until a page sees that another one has the seat, and that it may not order but take over.
fn sees_anothers(browser: &mut Browser, other: u64) {
    browser.until(&format!("{SEAT}.startsWith('seat: page {other}')"), 10);
    browser.until(
        &format!("{TAKES} === 'Take over the seat from page {other}'"),
        5,
    );
    browser.until("document.getElementById('start').disabled", 5);
    browser.until("!document.getElementById('take-seat').disabled", 5);
}

/// Return and Land are given once they were held, and the vehicles show them.
fn return_and_land_are_held(browser: &mut Browser, swarm: &Swarm) {
    // From then on the lease stays as it is.
    browser.until(
        "tomoswarm.model.orders.orders.every(({ isOver }) => isOver)",
        10,
    );
    for (word, kind) in [("return", OrderKind::Return), ("land", OrderKind::Land)] {
        let button = format!("#{word}");
        browser.pointer("mousePressed", &button);
        browser.until(
            &format!("tomoswarm.model.orders.orders.some(({{ what }}) => what === '{word}')"),
            10,
        );
        browser.pointer("mouseReleased", &button);
        swarm.until(&format!("{word} is shown by all"), 20, |watch| {
            (1..=2).all(|id| {
                let state = watch.view.state(VehicleId(id));
                state.is_some_and(|state| state.value.ordered.kind == Some(kind))
            })
        });
    }
}

#[test]
fn of_two_pages_one_has_the_seat_and_a_held_button_takes_it_over_as_both_see() {
    let Some((mut first, swarm, dash)) = live_page(1280, 800) else {
        return;
    };
    let mut second = Browser::open(1280, 800).unwrap();
    second.go(&dash.operate);
    second.until(
        "tomoswarm.model.states.size === 2 && tomoswarm.scene.view",
        20,
    );
    let (one, two) = (page(&mut first), page(&mut second));
    assert_ne!(one, two);
    // Who types a number that no vehicle has selects nobody.
    first.key("7", "Digit7", 55);
    first.until(&format!("{SAID} === 'There is no vehicle 7.'"), 5);
    assert_eq!(first.eval("document.documentElement.dataset.selected"), "");

    take_seat(&mut first);
    sees_its_own(&mut first);
    sees_anothers(&mut second, one);

    // A tap takes nothing over.
    hold(&mut second, "#take-seat", 300);
    second.until("!document.querySelector('#take-seat.filling')", 5);
    assert_eq!(first.eval("tomoswarm.model.orders.seat"), one);
    take_seat(&mut second);
    sees_its_own(&mut second);
    sees_anothers(&mut first, two);
    shot(&mut first, "seat-lost");

    // Whoever had it orders nothing more that moves; what stops needs no seat.
    first.expect_complaints(&["status of 403", "/order\""]);
    let gives = |order: &str| {
        format!(
            "import('/stop.js').then(({{ post }}) => post({{ order: '{order}', vehicles: [1] }}))"
        )
    };
    assert_eq!(first.eval(&gives("start")), Value::Null);
    first.until(&format!("{SAID}.startsWith('start was refused: ')"), 5);
    assert!(first.eval(&gives("hold")).is_u64());
    assert!(second.eval(&gives("start")).is_u64());
    let orders =
        "tomoswarm.model.orders.orders.map(({ what, page }) => `${what} by ${page}`).join()";
    let expected = format!("hold by {one},start by {two}");
    for browser in [&mut first, &mut second] {
        browser.until(&format!("{orders} === '{expected}'"), 10);
    }
    return_and_land_are_held(&mut second, &swarm);
    // The page that is closed gives it back at once.
    drop(second);
    first.until(&format!("{SEAT}.startsWith('seat: free')"), 10);
    assert_eq!(first.complaints, Vec::<String>::new());
}

/// Keeps what a held button does after its second until it is let on: the test says when the second is over.
const KEEPS_SECONDS: &str = "(() => { const real = setTimeout; globalThis.over = null;
    globalThis.setTimeout = (act, ms, ...rest) => { if (ms !== 1000) return real(act, ms, ...rest); globalThis.over = act; return 0; }; })()";

#[test]
fn a_lease_that_is_taken_while_a_button_is_held_leaves_the_page_ordering_nothing() {
    let Some((mut browser, swarm, _dash)) = live_page(1280, 800) else {
        return;
    };
    take_seat(&mut browser);
    let lease = "tomoswarm.model.orders.lease";
    browser.until(&format!("{lease} > 0"), 20);
    let before = browser.eval(lease).as_u64().unwrap();
    browser.until(&format!("{SEAT} === 'seat: this page · lease {before}'"), 5);
    let starts = "tomoswarm.model.orders.orders.filter(({ what }) => what === 'start').length";

    browser.eval(KEEPS_SECONDS);
    browser.pointer("mousePressed", "#start");
    browser.until(
        "globalThis.over && document.querySelector('#start.filling')",
        5,
    );
    let words = ["hold", "1", "2", "--take-over", "--timeout", "20"];
    let other = swarm.try_order(&words);
    let printed = String::from_utf8_lossy(&other.stderr).into_owned();
    browser.until(&format!("{lease} > {before}"), 10);
    let taken = browser.eval(lease).as_u64().unwrap();
    browser.eval("over(); 0");
    let said = format!(
        "{SAID} === 'Lease {taken} has come in place of {before} while the button was held: nothing is given.'"
    );
    browser.until(&said, 5);
    browser.pointer("mouseReleased", "#start");
    browser.until(&format!("{SEAT}.endsWith('lease {taken}')"), 5);
    // Whatever it had posted would be in its list by now: what is posted after it is.
    browser.key("h", "KeyH", 72);
    browser.until(
        "tomoswarm.model.orders.orders.some(({ what }) => what === 'hold')",
        10,
    );
    assert_eq!(browser.eval(starts), 0, "{printed}");

    // Who presses anew has read who orders now.
    browser.eval("globalThis.over = null");
    browser.pointer("mousePressed", "#start");
    browser.until("globalThis.over", 5);
    browser.eval("over(); 0");
    browser.until(&format!("{starts} === 1"), 10);
    browser.pointer("mouseReleased", "#start");
    assert_eq!(browser.complaints, Vec::<String>::new());
}
