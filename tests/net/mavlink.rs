//! Vehicles that fly simulated autopilots over MAVLink, and what clients of others see of the mock autopilot.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use tomoswarm_proto::VehicleId;

use crate::relay::Relay;
use crate::swarm::{PROGRAM, Size, Swarm, Watch, free_address};

/// Returns two addresses with neighbouring ports.
fn two_addresses() -> [SocketAddr; 2] {
    loop {
        let first = free_address();
        let second = SocketAddr::new(first.ip(), first.port() + 1);
        if std::net::TcpListener::bind(second).is_ok() {
            return [first, second];
        }
    }
}

fn has_trouble(watch: &Watch, id: u8, text: &str) -> bool {
    let health = watch
        .view
        .vehicle(VehicleId(id))
        .and_then(|view| view.health.as_ref());
    health.is_some_and(|health| {
        health
            .value
            .troubles
            .iter()
            .any(|trouble| trouble.contains(text))
    })
}

#[test]
fn a_sweep_is_driven_over_mavlink_although_a_link_is_cut_for_five_seconds() {
    let mut swarm = Swarm::prepare(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    });
    let served = two_addresses();
    let relay = Relay::start(served[0]);
    swarm.fly_over_mavlink(served[0], &[relay.address(), served[1]]);
    swarm.run();
    swarm.until("both know where they are", 20, |watch| {
        (1..=2).all(|id| {
            let state = watch.view.state(VehicleId(id));
            state.is_some_and(|state| state.value.pose.is_some())
                && !has_trouble(watch, id, "autopilot")
        })
    });
    swarm.begin();
    swarm.until_samples(200);
    relay.cut();
    swarm.until("the cut is told", 10, |watch| {
        has_trouble(watch, 1, "autopilot link: tcp:")
    });
    std::thread::sleep(Duration::from_secs(5));
    relay.restore();
    swarm.until("the link is back", 10, |watch| {
        !has_trouble(watch, 1, "autopilot")
    });
    swarm.until_end();
    swarm.until_maps_equal(20);
    swarm.finish();
}

/// Returns a Python that has pymavlink; `None` where there is none.
fn python() -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/venv/bin/python");
    let found = [own, PathBuf::from("python3")];
    found.into_iter().find(|python| {
        let mut program = Command::new(python);
        let run = program.args(["-c", "import pymavlink"]).output();
        run.is_ok_and(|run| run.status.success())
    })
}

/// Runs a script of tests/mavlink, unless what it needs is missing.
fn run_script(script: &str, module: &str) {
    let Some(python) = python() else {
        println!("skipped: no Python with pymavlink (target/venv, see .ci/run)");
        return;
    };
    let has_module = Command::new(&python)
        .args(["-c", &format!("import {module}")])
        .output();
    if !has_module.is_ok_and(|run| run.status.success()) {
        println!("skipped: no {module} for Python (target/venv, see .ci/run)");
        return;
    }
    let run = Command::new(python)
        .arg(
            Path::new(env!("CARGO_MANIFEST_DIR"))
                .join("tests/mavlink")
                .join(script),
        )
        .env("TOMOSWARM", PROGRAM)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stdout);
    assert!(
        run.status.success(),
        "{said}{}",
        String::from_utf8_lossy(&run.stderr)
    );
    assert!(said.contains("ok "), "it has tested nothing: {said}");
}

#[test]
fn the_mock_autopilot_is_what_pymavlink_expects() {
    run_script("mock_pymavlink.py", "pymavlink");
}

#[test]
fn the_mock_autopilot_is_what_mavsdk_expects() {
    run_script("mock_mavsdk.py", "mavsdk");
}

#[test]
fn the_mock_autopilot_is_what_mavproxy_expects() {
    run_script("mock_mavproxy.py", "MAVProxy");
}
