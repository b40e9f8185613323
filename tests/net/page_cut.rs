//! Motors are cut from the operator's page: of whom, is typed, and nobody else falls.

use std::time::Duration;

use serde_json::json;

use crate::browser::Browser;
use crate::dash::{Dash, every_control_has_a_name, hold, live_page, shot, take_seat};

/// Types whose motors are to be cut.
fn type_numbers(browser: &mut Browser, text: &str) {
    browser.eval(&format!(
        "(() => {{ const i = document.getElementById('cut-numbers'); i.value = {text:?}; \
         i.dispatchEvent(new Event('input', {{bubbles: true}})); }})()"
    ));
}

/// Returns whether the button may be pressed, and the hint beside it.
fn offered(browser: &mut Browser) -> (bool, String) {
    let hint = browser.eval("document.getElementById('cut-hint').textContent");
    let is_disabled = browser.eval("document.getElementById('cut-motors').disabled");
    (
        is_disabled == json!(false),
        hint.as_str().unwrap().to_owned(),
    )
}

#[test]
fn motors_are_cut_of_whoever_is_typed_and_of_nobody_else() {
    let Some((mut browser, _swarm, dash)) = live_page(1440, 900) else {
        return;
    };
    browser.eval("document.getElementById('cut').open = true; 0");
    every_control_has_a_name(&mut browser);

    type_numbers(&mut browser, "2");
    let (may, hint) = offered(&mut browser);
    assert!(!may && hint.contains("not the seat"), "{hint}");
    take_seat(&mut browser);
    // Whoever is selected is not meant.
    hold(&mut browser, "tr[data-vehicle=\"1\"]", 0);
    for (typed, why) in [
        ("", "Type the number"),
        ("all", "\"all\" is none"),
        ("2,", "\"\" is none"),
        ("2 1", "\"2 1\" is none"),
        ("-1", "\"-1\" is none"),
        ("9", "There is no vehicle 9"),
        ("1, 9", "There is no vehicle 9"),
    ] {
        type_numbers(&mut browser, typed);
        let (may, hint) = offered(&mut browser);
        assert!(!may && hint.contains(why), "{typed:?}: {hint}");
    }
    let own = format!("127.0.0.1:{}", dash.port);
    let page = browser.eval("tomoswarm.model.place.page");
    let of_all = json!({"order": "cut-motors", "page": page}).to_string();
    let token = Dash::token(&dash.operate);
    let (status, answer) = dash.post(&own, &format!("http://{own}"), token, &of_all);
    assert!(status == 400 && answer.contains("by number"), "{answer}");

    type_numbers(&mut browser, " 02 ");
    assert!(offered(&mut browser).0);
    let is_cut = "tomoswarm.model.place.modes[tomoswarm.model.states.get(2).mode] === 'MOTORS CUT'";
    browser.eval("document.getElementById('cut').scrollIntoView(); 0");
    shot(&mut browser, "page-cut");
    hold(&mut browser, "#cut-motors", 900);
    std::thread::sleep(Duration::from_millis(1500));
    assert_eq!(
        browser.eval("tomoswarm.model.orders.orders.length"),
        json!(0)
    );
    hold(&mut browser, "#cut-motors", 4000);
    browser.until(is_cut, 10);
    browser.until("tomoswarm.model.orders.orders.at(-1)?.isDone", 10);
    let given = browser.eval(
        "(() => { const o = tomoswarm.model.orders.orders; return [o.length, o[0].what, o[0].vehicles]; })()",
    );
    assert_eq!(given, json!([1, "cut-motors", [2]]));
    assert_eq!(
        browser.eval(&is_cut.replace("get(2)", "get(1)")),
        json!(false)
    );
    let (may, hint) = offered(&mut browser);
    assert!(!may && hint.contains("Type the number"), "{hint}");
    assert_eq!(browser.complaints, Vec::<String>::new());
}
