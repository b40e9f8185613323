//! The files of a run, saved from the operator's page: of a ground station's store as `tomoswarm export` writes them, and of
//! what was heard where there is none; and missions of QGroundControl, there and back.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use serde_json::{Value, json};
use tomoswarm_proto::RunId;

use crate::browser::Browser;
use crate::dash::{Dash, hold, prepared, shot, view};
use crate::sim_page::SimulationWithPage;

/// Returns the status and the body of what is asked for.
fn get(dash: &Dash, token: &str, path: &str) -> (u16, Vec<u8>) {
    let mut stream = TcpStream::connect(("127.0.0.1", dash.port)).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(60)))
        .unwrap();
    let request = format!(
        "GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nAuthorization: Bearer {token}\r\nConnection: close\r\n\r\n",
        dash.port
    );
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let head = answer
        .windows(4)
        .position(|four| four == b"\r\n\r\n")
        .unwrap();
    let status = String::from_utf8_lossy(&answer[9..12]).parse().unwrap();
    (status, answer[head + 4..].to_vec())
}

/// The names of the files that there are of a run, and from where they come.
fn listed(dash: &Dash, run: u32) -> (Vec<String>, String) {
    let (status, body) = get(dash, Dash::token(&dash.look), &format!("/export?run={run}"));
    assert_eq!(status, 200, "{}", String::from_utf8_lossy(&body));
    let listed: Value = serde_json::from_slice(&body).unwrap();
    let names = listed["files"].as_array().unwrap().iter();
    let names = names
        .map(|name| name.as_str().unwrap().to_owned())
        .collect();
    (names, listed["from"].as_str().unwrap().to_owned())
}

#[test]
fn a_page_saves_of_a_store_what_the_command_writes_and_nothing_else_of_the_machine() {
    let mut swarm = prepared();
    swarm.run();
    swarm.spawn(
        "dash",
        &[
            "dash",
            "operator.toml",
            "--port",
            "0",
            "--store",
            "state-g/ground.sqlite",
        ],
    );
    let dash = Dash::of_log(&swarm.path("dash.log"));
    swarm.begin();
    swarm.order(&["mark", "3,3.5", "--timeout", "20"]);
    swarm.until("an image of the run that is over", 120, |watch| {
        let report = watch.report();
        report.run == RunId(1) && watch.ends(&report) && report.images > 0
    });
    // What it stores meanwhile would come between two looks at it.
    swarm.kill("ground");
    let said = swarm.tool(&[
        "export",
        "state-g/ground.sqlite",
        "--out",
        "out",
        "--run",
        "1",
    ]);
    assert!(said.contains("written to"), "{said}");
    let mut written: Vec<String> = std::fs::read_dir(swarm.path("out"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    written.sort();
    let (names, from) = listed(&dash, 1);
    assert_eq!(names, written);
    assert_eq!(from, "the ground station's store");
    assert!(names.contains(&"run-1-marks.csv".to_owned()), "{names:?}");
    let look = Dash::token(&dash.look);
    for name in &names {
        let (status, body) = get(&dash, look, &format!("/export?run=1&file={name}"));
        let file = std::fs::read(swarm.path("out").join(name)).unwrap();
        assert_eq!(status, 200, "{name}");
        assert!(
            body == file,
            "{name}: {} bytes, {} expected",
            body.len(),
            file.len()
        );
    }
    for (token, path, expected) in [
        ("", "/export?run=1", 401),
        (&look[1..], "/export?run=1&file=venue.toml", 401),
        (look, "/export", 400),
        (look, "/export?run=x", 400),
        (look, "/export?run=9", 400),
        (look, "/export?run=1&file=../ground.toml", 400),
        (look, "/export?run=1&file=ground.sqlite", 400),
        (look, "/export?run=1&file=", 400),
    ] {
        let (status, body) = get(&dash, token, path);
        assert_eq!(
            status,
            expected,
            "{path}: {}",
            String::from_utf8_lossy(&body)
        );
    }
    let (_, body) = get(&dash, look, "/export?run=9");
    let said = String::from_utf8_lossy(&body).into_owned();
    assert!(said.contains("holds no run 9; it holds run 1"), "{said}");
    let Some(mut browser) = Browser::open(1280, 800) else {
        return;
    };
    browser.go(&dash.look);
    browser.until("tomoswarm.model.ground?.run === 1", 20);
    saved_by_a_browser(&mut browser, &names);
}

/// The page lists the files, and a browser is given one that is whole.
fn saved_by_a_browser(browser: &mut Browser, names: &[String]) {
    view(browser, "settings");
    browser.until("document.getElementById('save-run').value === '1'", 5);
    // What would be saved is kept in place of that.
    browser.eval(
        "globalThis.saved = []; URL.createObjectURL = (blob) => { globalThis.saved.push(blob); return '#'; }; \
         HTMLAnchorElement.prototype.click = () => {}; 0",
    );
    hold(browser, "#export-files", 0);
    let shown = "JSON.stringify([...document.querySelectorAll('#export-list button')].map((b) => b.textContent))";
    browser.until(&format!("{shown} === '{}'", json!(names)), 20);
    shot(browser, "export");
    let press = "[...document.querySelectorAll('#export-list button')].find((b) => b.textContent === 'run-1-links.csv').click()";
    browser.eval(press);
    browser.until("globalThis.saved.length === 1", 20);
    let text = browser.eval("globalThis.saved[0].text()");
    let mut lines = text.as_str().unwrap().lines();
    let header = lines.find(|line| !line.starts_with('#'));
    assert!(
        header.is_some_and(|header| header.starts_with("tx_x_m,tx_y_m,rx_x_m,")),
        "{text}"
    );
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn a_page_of_a_simulation_saves_what_it_has_heard_and_missions_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let mut simulation = SimulationWithPage::start(folder.path(), &["--samples"]);
    simulation.until_written();
    let dash = &simulation.dash;
    let runs: Vec<u32> = (1..4)
        .filter(|run| get(dash, Dash::token(&dash.look), &format!("/export?run={run}")).0 == 200)
        .collect();
    assert!(!runs.is_empty());
    let look = Dash::token(&dash.look);
    for run in &runs {
        let (names, from) = listed(dash, *run);
        assert!(
            from.starts_with("what this page's program has heard"),
            "{from}"
        );
        let links = format!("run-{run}-links.csv");
        assert!(
            names.contains(&links) && names.contains(&format!("run-{run}-samples.csv")),
            "{names:?}"
        );
        let (status, body) = get(
            dash,
            look,
            &format!("/export?run={run}&file=run-{run}-samples.csv"),
        );
        let text = String::from_utf8(body).unwrap();
        assert!(
            status == 200 && text.starts_with("vehicle,boot,run,sequence,"),
            "{text:.100}"
        );
        assert!(text.lines().count() > 100, "{}", text.lines().count());
    }
    // A mission goes out as a plan and comes back as the places that it was made of.
    let own = format!("127.0.0.1:{}", dash.port);
    let origin = format!("http://{own}");
    let body = |answer: String| answer.split_once("\r\n\r\n").unwrap().1.to_owned();
    for (path, begins) in [("/waypoints", "QGC WPL 110"), ("/waypoints?as=plan", "{")] {
        let (status, plan) = dash.post_to(path, (&own, &origin), look, "[[1, 2], [2.5, 3]]");
        let plan = body(plan);
        assert!(status == 200 && plan.starts_with(begins), "{plan}");
        let (status, places) = dash.post_to("/places", (&own, &origin), look, &plan);
        assert_eq!(
            (status, body(places)),
            (200, "[[1.0,2.0],[2.5,3.0]]".to_owned())
        );
    }
    let evil = "http://evil.example";
    let long = " ".repeat((256 << 10) + 1);
    for (path, origin, token, body, expected) in [
        ("/places", evil, look, "{}", 403),
        ("/places", &origin, "", "{}", 401),
        ("/places", &origin, look, "{}", 400),
        ("/places", &origin, look, long.as_str(), 413),
        ("/waypoints?as=kml", &origin, look, "[[1, 2]]", 400),
    ] {
        let (status, answer) = dash.post_to(path, (&own, origin), token, body);
        assert_eq!(status, expected, "{path} {origin} {token}: {answer}");
    }
}
