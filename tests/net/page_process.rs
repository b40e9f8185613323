//! The operator's page as a process beside another command: `ground --dash`, `sim --live --dash`.

use std::io::{BufRead, BufReader, Read};
use std::net::TcpStream;
use std::process::{Command, Stdio};
use std::time::Duration;

use tomoswarm_proto::{Sender, StandReason, VehicleId};

use crate::dash::Dash;
use crate::swarm::{PROGRAM, Size, Swarm, free_address};

fn prepared() -> Swarm {
    Swarm::prepare(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    })
}

/// Ends the page's process with the swarm: nothing else does when the ground station was killed.
struct EndsPage(String);

impl Drop for EndsPage {
    fn drop(&mut self) {
        let _ = Command::new("pkill")
            .args(["-KILL", "-f", &self.0])
            .status();
    }
}

#[test]
fn the_page_of_a_ground_station_that_was_killed_stops_everybody_and_killing_a_page_stops_nobody() {
    let mut swarm = prepared();
    // A port of its own tells it from the pages of other tests.
    let port = free_address().port().to_string();
    let _ends = EndsPage(format!("dash operator.toml --port {port}"));
    swarm.serve_page(&port);
    swarm.run();
    let dash = Dash::of_log(&swarm.path("ground.log"));
    swarm.until("all are there", 60, |watch| {
        let all = (1..=2).all(|id| watch.view.state(VehicleId(id)).is_some());
        all && watch.view.grounds().next().is_some()
    });
    swarm.order(&["start", "1", "2", "--run", "1", "--timeout", "60"]);
    swarm.until("a vehicle drives", 60, |watch| {
        let drives = |id| {
            watch
                .view
                .state(VehicleId(id))
                .is_some_and(|state| !state.value.is_at_rest)
        };
        drives(1) || drives(2)
    });

    swarm.spawn("page", &["dash", "operator.toml", "--port", "0"]);
    Dash::of_log(&swarm.path("page.log"));
    swarm.kill("page");
    std::thread::sleep(Duration::from_secs(3));
    swarm.look(|watch| {
        assert!(
            watch.view.open_stops().is_empty(),
            "killing a page stops nobody"
        );
        for id in 1..=2 {
            let state = watch.view.state(VehicleId(id)).unwrap();
            assert_eq!(state.value.stands_under, None, "vehicle {id}");
        }
    });

    swarm.kill("ground");
    let own = format!("127.0.0.1:{}", dash.port);
    let stop = r#"{"order":"stop","page":1}"#;
    let token = Dash::token(&dash.operate);
    let (status, said) = dash.post(&own, &format!("http://{own}"), token, stop);
    assert_eq!(status, 200, "{said}");
    swarm.until("every vehicle stands under a stop", 10, |watch| {
        (1..=2).all(|id| {
            watch
                .view
                .state(VehicleId(id))
                .is_some_and(|state| matches!(state.value.stands_under, Some(StandReason::Stop(_))))
        })
    });
}

#[test]
fn a_ground_station_whose_page_finds_its_port_taken_begins_and_tries_it_again() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let _ends = EndsPage(format!("dash operator.toml --port {port}"));
    let mut swarm = prepared();
    swarm.serve_page(&port);
    swarm.run();
    swarm.until("the ground station is there", 60, |watch| {
        watch.view.grounds().next().is_some()
    });
    let said = swarm.log_of(Sender::Ground);
    let why = format!(
        "warning: the page of operator.toml could not begin: 127.0.0.1:{port} cannot be listened on"
    );
    assert!(said.contains(&why), "{said}");
    drop(taken);
    let dash = Dash::of_log(&swarm.path("ground.log"));
    let (status, said) = dash.metrics(Dash::token(&dash.look));
    assert_eq!(status, 200, "{said}");
}

#[test]
fn a_ground_station_whose_page_has_a_wrong_file_is_refused() {
    let mut swarm = prepared();
    std::fs::write(swarm.path("operator.toml"), "kind = \"operator\"").unwrap();
    swarm.serve_page("0");
    swarm.restart(Sender::Ground);
    let (code, said) = swarm.ended("ground", Duration::from_secs(20));
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("operator.toml"), "{said}");
}

#[test]
fn a_live_simulation_has_a_page_with_orders_that_ends_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new(PROGRAM);
    command.current_dir(env!("CARGO_MANIFEST_DIR"));
    command.args([
        "sim",
        "configs/small.sim.toml",
        "--live",
        "--dash",
        "--port",
        "0",
        "--no-pictures",
        "--out",
    ]);
    let command = command
        .arg(folder.path().join("run"))
        .stdout(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut out = BufReader::new(child.stdout.take().unwrap());
    let mut links = [String::new(), String::new()];
    for link in &mut links {
        out.read_line(link).unwrap();
    }
    assert!(links[1].contains("/#operate="), "{links:?}");
    let dash = Dash::at(links[1].split_whitespace().last().unwrap().to_owned());
    let own = format!("127.0.0.1:{}", dash.port);
    let token = Dash::token(&dash.look);
    let hold = r#"{"order":"hold","page":1}"#;
    let (status, said) = dash.post(&own, &format!("http://{own}"), token, hold);
    assert_eq!(status, 200, "{said}");
    Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    let mut rest = String::new();
    out.read_to_string(&mut rest).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(1), "{rest}");
    assert!(
        TcpStream::connect(("127.0.0.1", dash.port)).is_err(),
        "its page is gone"
    );
}
