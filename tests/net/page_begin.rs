//! An empty sweep, and then one that is compared with it, begun from the operator's page; and what is wrong with one, said.

use serde_json::json;
use tomoswarm_proto::{MissionKind, RunEnd, RunId, RunReport};

use crate::browser::Browser;
use crate::dash::{Dash, every_control_has_a_name, hold, live_page, shot, take_seat, view};
use crate::swarm::{Swarm, Watch};

fn run(watch: &Watch, run: u32) -> Option<RunReport> {
    let runs = watch.report().runs;
    runs.into_iter().find(|report| report.run == RunId(run))
}

/// Begins what is chosen, with one lap.
fn begin(browser: &mut Browser) {
    browser.until(
        "document.querySelector('#mission-keys input[name=laps]') !== null",
        10,
    );
    browser.eval(
        "(() => { const i = document.querySelector('#mission-keys input[name=laps]'); i.value = '1'; \
           i.dispatchEvent(new Event('input', {bubbles: true})); })()",
    );
    hold(browser, "#begin-mission", 4000);
    browser.until(
        "document.getElementById('begin-result').textContent.includes('is given')",
        10,
    );
}

fn text_of(browser: &mut Browser, id: &str) -> String {
    let text = browser.eval(&format!("document.getElementById('{id}').textContent"));
    text.as_str().unwrap().to_owned()
}

#[test]
fn an_empty_sweep_is_begun_and_then_one_that_is_compared_with_it() {
    let Some((mut browser, swarm, dash)) = live_page(1440, 900) else {
        return;
    };
    take_seat(&mut browser);
    view(&mut browser, "begin");
    assert_eq!(
        browser.eval("document.getElementById('sweep-compared').disabled"),
        json!(true)
    );
    refusals(&dash, &swarm, &mut browser);

    hold(&mut browser, "#sweep-empty", 0);
    let hint = text_of(&mut browser, "compare-hint");
    assert!(hint.contains("nobody may stand in the area"), "{hint}");
    begin(&mut browser);
    let command = text_of(&mut browser, "begin-command");
    assert_eq!(
        command,
        "tomoswarm order CONFIG start --mission sweep --set 'laps=1'"
    );
    swarm.until("the empty sweep is done", 120, |watch| {
        run(watch, 1).is_some_and(|run| run.end == Some(RunEnd::Done))
    });
    let empty = swarm.look(|watch| run(watch, 1)).unwrap();
    assert_eq!(
        (empty.kind, empty.compared_with),
        (MissionKind::Sweep, None)
    );

    browser.until(
        "document.getElementById('sweep-compared').textContent.endsWith('with run 1')",
        20,
    );
    every_control_has_a_name(&mut browser);
    hold(&mut browser, "#sweep-compared", 0);
    let hint = text_of(&mut browser, "compare-hint");
    assert!(hint.contains("what has changed since run 1"), "{hint}");
    begin(&mut browser);
    assert!(text_of(&mut browser, "begin-command").ends_with("--compare-with 1"));
    shot(&mut browser, "begin_sweep");
    swarm.until("the second sweep is compared with the first", 60, |watch| {
        run(watch, 2).is_some_and(|run| run.compared_with == Some(RunId(1)))
    });
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// What is wrong with a mission is said with its reason, and nothing begins.
fn refusals(dash: &Dash, swarm: &Swarm, browser: &mut Browser) {
    let own = format!("127.0.0.1:{}", dash.port);
    let page = browser.eval("tomoswarm.model.place.page");
    let secret = browser.eval("tomoswarm.feed.secret");
    for (mission, reason) in [
        (json!({"kind": "sweep", "set": ["laps=0"]}), "laps"),
        (json!({"kind": "sweep", "set": ["lapz=1"]}), "lapz"),
        (
            json!({"kind": "sweep", "compare_with": 7}),
            "compare_with: run 7 is none that the ground station has",
        ),
        (
            json!({"kind": "sweep", "compare_with": 0}),
            "compare_with: a run from 1",
        ),
        (json!({"kind": "fan-crooked"}), "fan-crooked"),
    ] {
        let body = json!({"order": "start", "page": page, "secret": secret, "mission": mission})
            .to_string();
        let (status, answer) = dash.post(
            &own,
            &format!("http://{own}"),
            Dash::token(&dash.operate),
            &body,
        );
        assert!(
            status == 400 && answer.contains(reason),
            "{mission}: {answer}"
        );
    }
    assert!(
        swarm.look(|watch| run(watch, 1)).is_none(),
        "nothing has begun"
    );
}
