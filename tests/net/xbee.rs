//! Vehicles whose radios are XBees at pseudo-terminals, and what sets them up.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use tomoswarm::store::ground::GroundStore;
use tomoswarm_proto::{RadioHealth, RunId, VehicleId};

use crate::cable::Cable;
use crate::drivers::median;
use crate::python::run_script;
use crate::swarm::{PROGRAM, Size, Swarm, vehicle};

fn two() -> Swarm {
    let mut swarm = Swarm::prepare(Size {
        vehicles: 2,
        laps: 1,
        relayed: false,
    });
    swarm.speak_by_xbee();
    swarm
}

fn health(swarm: &Swarm, id: u8) -> Option<(RadioHealth, Vec<String>)> {
    swarm.look(|watch| {
        let view = watch.view.vehicle(VehicleId(id))?;
        let health = &view.health.as_ref()?.value;
        Some((health.radio?, health.troubles.clone()))
    })
}

#[test]
fn a_sweep_is_measured_by_xbees_that_are_pulled_out_and_plugged_in_again() {
    let mut swarm = two();
    swarm.run();
    swarm.begin();
    swarm.until_samples(150);
    // The port of vehicle 1 is closed and opened anew with its process.
    swarm.kill("vehicle-1");
    swarm.restart(vehicle(1));
    swarm.until_end();
    let (radio, troubles) = health(&swarm, 2).unwrap();
    assert!(radio.sent > 200 && radio.bad == 0, "{radio:?}");
    assert!(radio.unsent * 10 < radio.sent, "{radio:?}");
    assert!(
        !troubles.iter().any(|trouble| trouble.contains("radio")),
        "{troubles:?}"
    );
    swarm.finish();
    let said = std::fs::read_to_string(swarm.path("world.log")).unwrap();
    assert!(!said.contains(" 0 beacons heard"), "{said}");
}

/// Returns what a command prints, what it complains of, and its exit code.
fn xbee(folder: &Path, words: &str) -> (String, String, Option<i32>) {
    command(folder, &format!("xbee {words}"))
}

fn command(folder: &Path, words: &str) -> (String, String, Option<i32>) {
    let run = Command::new(PROGRAM)
        .args(words.split(' '))
        .current_dir(folder)
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&run.stdout), text(&run.stderr), run.status.code())
}

#[test]
fn a_module_is_found_at_another_baud_rate_set_up_and_shown_and_a_vehicle_says_what_is_wrong() {
    let mut swarm = two();
    swarm.run();
    let sends = |swarm: &Swarm, id: u8| health(swarm, id).is_some_and(|(radio, _)| radio.sent > 20);
    while !(sends(&swarm, 1) && sends(&swarm, 2)) {
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    let folder = swarm.path("");
    let (_, said, code) = xbee(&folder, "show ports/vehicle-2");
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("another program uses it"), "{said}");
    let devices = "check --devices vehicle-2.toml";
    let (_, said, code) = command(&folder, devices);
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains("vehicle-2.toml: ") && said.contains("the vehicle is running"),
        "{said}"
    );
    swarm.kill("vehicle-2");
    let (shown, said, code) = command(&folder, devices);
    assert_eq!(code, Some(0), "{said}");
    assert!(
        shown.contains("all registers are right")
            && shown.contains("autopilot: simulated, not looked at"),
        "{shown}"
    );
    let of_two = "--vehicle 2 --venue venue.toml";
    let (shown, said, code) = xbee(&folder, &format!("show ports/vehicle-2 {of_two}"));
    assert_eq!(code, Some(0), "{said}");
    assert!(
        shown.contains("MY 2\n") && shown.contains("AP 2\n"),
        "{shown}"
    );
    let of_three = "--vehicle 3 --venue venue.toml --baud 38400";
    let (shown, said, code) = xbee(&folder, &format!("setup ports/vehicle-2 {of_three}"));
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("found at 115200 baud, API mode 2"), "{said}");
    assert!(shown.contains("MY 3\n"), "{shown}");
    swarm.restart(vehicle(2));
    swarm.until("it says that its module is silent", 20, |watch| {
        let view = watch.view.vehicle(VehicleId(2));
        let health = view.and_then(|view| view.health.as_ref());
        health.is_some_and(|health| {
            let mut troubles = health.value.troubles.iter();
            troubles.any(|trouble| trouble.contains("the module does not answer"))
        })
    });
    swarm.kill("vehicle-2");
    let (_, said, code) = xbee(
        &folder,
        &format!("show ports/vehicle-2 {of_two} --baud 38400"),
    );
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("MY is 3, wanted 2"), "{said}");
    let (_, said, code) = command(&folder, devices);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("no module answers at 115200 baud"), "{said}");
    let (_, said, code) = xbee(&folder, &format!("setup ports/vehicle-2 {of_two}"));
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("found at 38400 baud"), "{said}");
    swarm.restart(vehicle(2));
    swarm.until("it speaks again", 20, |watch| {
        let view = watch.view.vehicle(VehicleId(1));
        let health = view.and_then(|view| view.health.as_ref());
        health.is_some_and(|health| health.value.hears.contains(&VehicleId(2)))
    });
    for (words, code, part) in [
        ("show ports/nobody", 1, "ports/nobody: No such file"),
        ("show ports/nobody", 1, "a serial port is needed"),
        ("show ", 2, "a value is required for '<PORT>'"),
        ("show ports/nobody --baud 12345", 2, "allowed: 1200, 2400"),
        (
            "setup ports/nobody --vehicle 1 --venue venue.toml --baud 0",
            2,
            "no module speaks at it",
        ),
        ("show venue.toml", 1, "it is no serial port"),
        ("show ports", 1, "ports: it is a directory, no serial port"),
        (
            "setup ports --vehicle 1 --venue venue.toml",
            1,
            "ports: it is a directory, no serial port",
        ),
        (
            "setup ports/vehicle-1 --vehicle 1 --venue sim.toml",
            2,
            "another kind",
        ),
        (
            "setup ports/vehicle-1 --vehicle 0 --venue venue.toml",
            2,
            "1..=250",
        ),
    ] {
        let (_, said, found) = xbee(&folder, words);
        assert_eq!(found, Some(code), "{words}: {said}");
        assert!(said.contains(part), "{words}: {said}");
    }
    for (words, part) in [
        ("check --devices venue.toml", "kind = \"vehicle\" is needed"),
        ("check --devices gone.toml", "gone.toml: cannot be read"),
        ("check --move vehicle-2.toml", "--devices"),
        ("check --record-edges . vehicle-2.toml", "--devices"),
    ] {
        let (_, said, found) = command(&folder, words);
        assert_eq!(found, Some(2), "{words}: {said}");
        assert!(said.contains(part), "{words}: {said}");
    }
    swarm.end_in_order();
}

/// Waits until vehicle 1 says that something is wrong with its radio, or that nothing is; returns after how long.
fn until_said(swarm: &Swarm, is_wrong: bool) -> Duration {
    let began = Instant::now();
    loop {
        let troubles = health(swarm, 1).map(|(_, troubles)| troubles);
        let is_said =
            |troubles: Vec<String>| troubles.iter().any(|trouble| trouble.starts_with("radio"));
        if troubles.map(is_said) == Some(is_wrong) {
            return began.elapsed();
        }
        assert!(began.elapsed() < Duration::from_secs(20), "it is not said");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_module_that_is_pulled_out_is_missed_soon_costs_nothing_and_sends_soon_when_it_is_back() {
    const WATCHED: Duration = Duration::from_secs(10);
    let mut swarm = two();
    let text = std::fs::read_to_string(swarm.path("vehicle-1.toml")).unwrap();
    swarm.write(
        "vehicle-1.toml",
        &text.replace("ports/vehicle-1", "cable-1"),
    );
    let mut cable = Cable::new(swarm.path("ports/vehicle-1"), swarm.path("cable-1"));
    swarm.run();
    until_said(&swarm, true);
    let taken = |threads: &str| swarm.processor_s(vehicle(1), threads);
    let before = [taken("radio"), taken("")];
    std::thread::sleep(WATCHED);
    let [radio, all] = [taken("radio") - before[0], taken("") - before[1]]
        .map(|seconds| seconds / WATCHED.as_secs_f64());
    swarm.note(&format!(
        "unplugged: {:.1} % of a core, {:.1} % of it for the radio",
        1e2 * all,
        1e2 * radio
    ));
    assert!(radio < 0.01, "{radio} of a core");
    let mut missed_after = Vec::new();
    for turn in 0..5 {
        let plugged = Instant::now();
        cable.plug();
        let sends = cable.sent_after(plugged);
        until_said(&swarm, false);
        std::thread::sleep(Duration::from_millis(500 + 130 * turn));
        cable.pull_out();
        let said = until_said(&swarm, true);
        swarm.note(&format!(
            "sends {sends:?} after it is plugged in, missed after {said:?}"
        ));
        let most_s = if turn == 0 { 3 } else { 2 };
        assert!(sends < Duration::from_secs(most_s), "{sends:?}");
        missed_after.push(said);
    }
    // The next ping, ten a second, shows that it is gone.
    let missed = median(missed_after);
    assert!(missed < Duration::from_millis(300), "{missed:?}");
    swarm.end_in_order();
}

#[test]
fn the_makers_library_speaks_with_simulated_modules_in_both_api_modes() {
    run_script("xbee/vendor_library.py", "digi.xbee");
}

/// How far the strongest place in the image of a sweep that has ended is from the person, metres.
fn find_error_m(swarm: &Swarm) -> f64 {
    let persons = swarm.persons();
    let [person] = persons[..] else {
        panic!("one person is expected: {persons:?}");
    };
    let store = GroundStore::open_to_read(&swarm.path("state-g/ground.sqlite")).unwrap();
    let images = store.newest_images(RunId(1)).unwrap();
    let image = images.iter().find(|image| image.kind == "structure");
    image.unwrap().peaks[0].at.distance_to(person)
}

/// Figures of docs/figures.md, XBee: packets of a small sweep over pseudo-terminals against the simulated driver's, and where
/// its image shows the person.
#[test]
#[ignore = "two whole sweeps, by hand"]
fn a_sweep_by_modules_finds_the_person_with_the_packets_of_one_by_the_simulated_radio() {
    let swept = |by_modules: bool| {
        let mut swarm = Swarm::prepare(Size {
            vehicles: 2,
            laps: 1,
            relayed: false,
        });
        if by_modules {
            swarm.speak_by_xbee();
        }
        swarm.run();
        swarm.begin();
        swarm.until_end();
        let heard = swarm.look(|watch| watch.report().samples);
        swarm.finish();
        (heard, find_error_m(&swarm))
    };
    let ((simulated, simulated_m), (by_modules, by_modules_m)) = (swept(false), swept(true));
    println!(
        "the person is found {by_modules_m:.2} m off by modules, {simulated_m:.2} m by the simulated radio"
    );
    let share = by_modules as f64 / simulated as f64;
    println!(
        "{by_modules} packets by modules, {simulated} by the simulated radio: {:.0} %",
        100.0 * share
    );
    assert!(share >= 0.8, "{share}");
    assert!(by_modules_m <= 1.0, "{by_modules_m} m");
}
