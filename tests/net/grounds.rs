//! Two ground stations, a ground station that has lost its disk, and disks that are full or cannot be written.

use std::process::Command;
use std::time::Duration;

use tomoswarm_proto::{RunId, StationPhase};

use crate::small_disk::{SmallDisk, run};
use crate::swarm::{GROUND, PROGRAM, Size, Swarm, free_address, start, vehicle};

fn two() -> Swarm {
    Swarm::start(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    })
}

/// Returns the `[bus]` of one more node.
fn further(swarm: &Swarm) -> String {
    let all =
        [GROUND, vehicle(1), vehicle(2)].map(|node| format!("\"tcp/{}\"", swarm.address(node)));
    format!(
        "[bus]\nlisten = [\"tcp/{}\"]\nconnect = [{}]\n",
        free_address(),
        all.join(", ")
    )
}

#[test]
fn of_two_grounds_the_second_stands_by_and_ends_the_run_when_the_first_dies() {
    let mut swarm = two();
    swarm.begin();
    // The operator who began it may hold the lease: the ground plans under that as long as the operator lives.
    std::thread::sleep(Duration::from_secs(8));
    let first = swarm.look(|watch| watch.report());
    swarm.write(
        "ground-b.toml",
        &swarm.ground_text("state-b", &further(&swarm)),
    );
    swarm.spawn("ground-b", &["ground", "ground-b.toml"]);
    std::thread::sleep(Duration::from_secs(8));
    let printed = std::fs::read_to_string(swarm.path("ground-b.log")).unwrap();
    assert!(
        printed.contains("stands by: ") && !printed.contains("leads by lease"),
        "{printed}"
    );
    let leads = swarm.look(|watch| watch.report());
    assert_eq!((leads.store, leads.lease), (first.store, first.lease));
    swarm.kill("ground");
    let store = first.store;
    swarm.until("the second leads", 30, |watch| {
        let report = watch.report();
        report.store != store && report.lease > first.lease
    });
    swarm.until_end();
    swarm.end_in_order();
    swarm.check_samples("state-b", RunId(1));
}

#[test]
fn a_place_that_is_marked_is_on_disk_when_that_is_said_and_finds_are_judged_by_it() {
    let mut swarm = two();
    swarm.begin();
    swarm.until_samples(20);
    swarm.order(&["mark", "3,3.5", "1.25,5", "--timeout", "20"]);
    swarm.kill("ground");
    let unheard = swarm.try_order(&["mark", "2,2", "--run", "1", "--timeout", "2"]);
    assert!(!unheard.status.success(), "nobody has stored it");
    let reason = String::from_utf8_lossy(&unheard.stderr).into_owned();
    assert!(
        reason.contains("no ground station has stored the mark at (2, 2) of run 1"),
        "{reason}"
    );
    swarm.restart(GROUND);
    swarm.order(&["mark", "1.25,5", "--take-back", "--timeout", "30"]);
    swarm.until_end();
    swarm.order(&["mark", "--run", "1", "--timeout", "20", "--", "-0.5,0.25"]);
    swarm.until("an image is made", 60, |watch| watch.report().images >= 1);
    swarm.end_in_order();
    let said = swarm.tool(&["export", "state-g/ground.sqlite", "--out", "out"]);
    assert!(
        said.contains("structure: marked (3, 3.5): the nearest peak is "),
        "{said}"
    );
    let marks = std::fs::read_to_string(swarm.path("out/run-1-marks.csv")).unwrap();
    let places: Vec<&str> = marks.lines().skip(2).collect();
    assert!(
        places.len() == 2
            && places[0].starts_with("1,3,3.5,0,2")
            && places[1].starts_with("1,-0.5,0.25,0,2"),
        "{marks}"
    );
}

#[test]
fn a_ground_with_an_empty_disk_gets_all_samples_again() {
    let mut swarm = two();
    swarm.begin();
    swarm.until_samples(150);
    let before = swarm.look(|watch| watch.report());
    swarm.kill("ground");
    std::fs::remove_dir_all(swarm.path("state-g")).unwrap();
    swarm.restart(GROUND);
    let (store, samples) = (before.store, before.samples);
    swarm.until("the samples come again", 30, |watch| {
        let report = watch.report();
        report.store != store && report.samples >= samples
    });
    let run = swarm.look(|watch| watch.report().run);
    swarm.note(&format!("it knows of run {run}"));
    // The vehicles still show the Start of run 1, so the new ground drives it again; another is refused until then.
    swarm.until("nothing is under way", 120, |watch| {
        watch.report().phase == StationPhase::Idle
    });
    swarm.order(&["start", "--run", "2"]);
    swarm.until("a new run has ended", 120, |watch| {
        let report = watch.report();
        report.run == RunId(2) && watch.ends(&report)
    });
    swarm.end_in_order();
    swarm.check_samples("state-g", RunId(2));
}

#[test]
fn a_ground_whose_disk_is_full_says_so_and_loses_nothing() {
    let mut swarm = two();
    let state_dir = swarm.path("state-small");
    let Some(disk) = SmallDisk::mount(&state_dir, 20_000) else {
        return;
    };
    swarm.kill("ground");
    let bus = format!(
        "[record]\nlimit_mb = 0\n[bus]\nlisten = [\"tcp/{}\"]\n",
        swarm.address(GROUND)
    );
    swarm.write("ground.toml", &swarm.ground_text("state-small", &bus));
    swarm.restart(GROUND);
    swarm.begin();
    swarm.until_samples(50);
    swarm.note("the disk is full");
    let rest = state_dir.join("rest");
    let mut file = std::fs::File::create(&rest).unwrap();
    while std::io::Write::write_all(&mut file, &[1; 512]).is_ok() {}
    let is_full = |trouble: &String| trouble.contains("the disk is full");
    swarm.until("it is said", 20, |watch| {
        watch.report().troubles.iter().any(is_full)
    });
    std::thread::sleep(Duration::from_secs(5));
    swarm.note("there is room again");
    // Less than 200 MB would be a trouble as well.
    disk.grow(400_000);
    swarm.until("all is well again", 20, |watch| {
        watch.report().troubles.is_empty()
    });
    swarm.until_end();
    swarm.end_in_order();
    swarm.check_samples("state-small", RunId(1));
}

#[test]
fn a_vehicle_whose_disk_is_full_goes_on_and_loses_nothing() {
    let mut swarm = two();
    let state_dir = swarm.path("state-small");
    let Some(_disk) = SmallDisk::mount(&state_dir, 400) else {
        return;
    };
    swarm.kill("vehicle-2");
    let bus = format!(
        "[record]\nlimit_mb = 0\n[bus]\nlisten = [\"tcp/{}\"]\nconnect = [\"tcp/{}\"]\n",
        swarm.address(vehicle(2)),
        swarm.address(GROUND)
    );
    swarm.write(
        "vehicle-2.toml",
        &swarm.vehicle_text(2, "state-small", &bus),
    );
    std::fs::write(state_dir.join("boot"), format!("{}\n", start(1))).unwrap();
    swarm.restart(vehicle(2));
    swarm.begin();
    let mut file = std::fs::File::create(state_dir.join("rest")).unwrap();
    while std::io::Write::write_all(&mut file, &[1; 512]).is_ok() {}
    swarm.until("it is said", 20, |watch| {
        let health = watch
            .view
            .vehicle(tomoswarm_proto::VehicleId(2))
            .and_then(|seen| seen.health.clone());
        health.is_some_and(|health| !health.value.troubles.is_empty())
    });
    swarm.finish();
}

#[test]
fn a_ground_that_cannot_write_its_folder_does_not_begin() {
    let folder = tempfile::tempdir().unwrap();
    let state_dir = folder.path().join("state");
    let Some(disk) = SmallDisk::mount(&state_dir, 100) else {
        return;
    };
    assert!(run(
        "mount",
        &["-o", "remount,ro", disk.0.to_str().unwrap()]
    ));
    let venue = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/courtyard.venue.toml");
    let bus = format!("[bus]\nlisten = [\"tcp/{}\"]\n", free_address());
    let text = format!(
        "kind = \"ground\"\nvenue = \"{venue}\"\nvehicles = [1, 2]\nstate_dir = \"state\"\n{bus}"
    );
    std::fs::write(folder.path().join("ground.toml"), text).unwrap();
    let run = Command::new(PROGRAM)
        .args(["ground", "ground.toml"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&run.stderr);
    assert!(
        run.status.code() == Some(2) && printed.contains("state_dir"),
        "{printed}"
    );
}
