//! `[mission]`: what is read, and what is refused before anything is run.

use tomoswarm::config::{self, PlannerChoice, Sim, bundled};
use tomoswarm::geom::Point;
use tomoswarm_proto::{Position, TaskKind};

const SIM: &str = "\
kind = \"sim\"
venue = \"courtyard.venue.toml\"
scene = \"../scenes/courtyard.scene.toml\"
";

fn load(path: &str, file: &str) -> Result<String, String> {
    match path {
        "configs/way.waypoints" => Ok(file.to_owned()),
        other => bundled::load(other),
    }
}

/// Reads a simulation of the courtyard with these lines; `file` is what `way.waypoints` holds.
fn read_with(lines: &str, file: &str) -> Result<Sim, String> {
    let text = format!("{SIM}{lines}");
    let read = config::read_sim("configs/a.toml", &text, None, &mut |path| load(path, file));
    read.map_err(|problems| problems.to_string())
}

fn read(lines: &str) -> Result<Sim, String> {
    read_with(lines, "")
}

#[track_caller]
fn check_refused(lines: &str, file: &str, expected: &[&str]) {
    let output = read_with(lines, file).expect_err("it must be refused");
    assert!(
        expected.iter().all(|part| output.contains(part)),
        "{output}"
    );
}

#[test]
fn a_simulation_without_a_mission_sweeps_with_at_least_two() {
    assert_eq!(read("").unwrap().task, None);
    check_refused(
        "[vehicles]\ncount = 1\n",
        "",
        &["configs/a.toml:5", "vehicles.count", "2 to 8"],
    );
    assert_eq!(
        read("[mission]\nkind = \"explore\"\n[vehicles]\ncount = 1\n")
            .unwrap()
            .vehicles
            .count,
        1
    );
}

#[test]
fn a_square_goes_round_the_middle_of_the_area_from_north_west() {
    let sim = read("[mission]\nkind = \"square\"\nsize_m = 8\n").unwrap();
    let corners = [
        (6.0, 14.0),
        (14.0, 14.0),
        (14.0, 6.0),
        (6.0, 6.0),
        (6.0, 14.0),
    ];
    let places = corners
        .map(|(x_m, y_m)| Position::from_metres(x_m, y_m, 0.0))
        .to_vec();
    assert_eq!(sim.task, Some(TaskKind::Legs { places }));
}

#[test]
fn patterns_are_sweeps_of_two_vehicles_over_a_square_lattice() {
    let sim = read("[mission]\nkind = \"fan-straight\"\n").unwrap();
    assert_eq!(
        (sim.task, sim.sweep.planner),
        (None, PlannerChoice::FanStraight)
    );
    check_refused(
        "[mission]\nkind = \"fan\"\n[sweep]\npositions = 75\n",
        "",
        &["sweep.positions", "multiple of 4"],
    );
    for count in [1, 3] {
        check_refused(
            &format!("[mission]\nkind = \"calibrate\"\n[vehicles]\ncount = {count}\n"),
            "",
            &[
                "configs/a.toml:5: mission.kind = \"calibrate\"",
                &format!("drives two vehicles, not {count}; vehicles.count = 2 is needed"),
            ],
        );
    }
    check_refused(
        "[sweep]\nplanner = \"calibrate\"\n[vehicles]\ncount = 3\n",
        "",
        &["configs/a.toml:5: sweep.planner = \"calibrate\": drives two vehicles, not 3"],
    );
    check_refused(
        "[mission]\nkind = \"fan\"\n[sweep]\nplanner = \"calibrate\"\n",
        "",
        &["sweep.planner"],
    );
}

#[test]
fn what_makes_no_mission_is_refused_with_key_and_line() {
    check_refused(
        "[mission]\nkind = \"fly\"\n",
        "",
        &["configs/a.toml:5", "mission.kind", "explore"],
    );
    check_refused(
        "[mission]\nkind = \"waypoints\"\n",
        "",
        &["mission.waypoints_m", "places [x, y]"],
    );
    check_refused(
        "[mission]\nkind = \"explore\"\nsize_m = 4\n",
        "",
        &["mission.size_m"],
    );
    check_refused(
        "[mission]\nkind = \"pathfind\"\nwaypoints_m = [[1, 1], [50, 1]]\n",
        "",
        &[
            "configs/a.toml:6",
            "mission.waypoints_m",
            "(50, 1), outside the fence",
        ],
    );
    check_refused(
        "[mission]\nkind = \"square\"\nsize_m = 80\n",
        "",
        &["mission.size_m", "outside the fence"],
    );
}

/// A file for QGroundControl with a home and one place.
fn waypoints(latitude_deg: f64, longitude_deg: f64) -> String {
    format!(
        "QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t52.3702\t4.8952\t0\t1\n\
         1\t0\t3\t16\t0\t0\t0\t0\t{latitude_deg}\t{longitude_deg}\t0\t1\n"
    )
}

#[test]
fn a_waypoint_file_leads_to_its_places_in_the_frame_of_the_venue() {
    let lines = "[mission]\nkind = \"waypoints\"\nfile = \"way.waypoints\"\n";
    // 0.0001° of latitude are 11.13 m to the north, the courtyard's y.
    let sim = read_with(lines, &waypoints(52.3703, 4.8952)).unwrap();
    let Some(TaskKind::Legs { places }) = &sim.task else {
        panic!("{:?}", sim.task)
    };
    assert!(
        places.len() == 1 && Point::from(places[0]).distance_to(Point::new(0.0, 11.13)) < 0.02,
        "{places:?}"
    );
}

#[test]
fn a_waypoint_file_is_refused_with_its_own_lines() {
    let lines = "[mission]\nkind = \"pathfind\"\nfile = \"way.waypoints\"\n";
    check_refused(
        lines,
        &waypoints(52.0, 4.8952),
        &["configs/way.waypoints:3", "outside the fence"],
    );
    check_refused(
        lines,
        &waypoints(152.0, 4.8952),
        &["configs/way.waypoints:3", "152"],
    );
    check_refused(
        lines,
        "QGC WPL 120\n",
        &["configs/way.waypoints:1", "another version"],
    );
    check_refused(lines, "", &["configs/way.waypoints"]);
    let both = format!("{lines}waypoints_m = [[1, 1]]\n");
    check_refused(
        &both,
        &waypoints(52.3703, 4.8952),
        &["mission.waypoints_m", "beside a file"],
    );
}

#[test]
fn an_end_that_the_keys_rule_out_is_refused_unless_something_may_go_wrong() {
    let lines = |expect: &str, end: &str, more: &str| {
        format!("expect = \"{expect}\"\nend = \"{end}\"\n{more}")
    };
    let explore = "[mission]\nkind = \"explore\"\n";
    for mission in ["", explore] {
        check_refused(
            &lines("home", "hold", mission),
            "",
            &[
                "configs/a.toml:4: expect = \"home\": is never so with end = \"hold\"",
                "end = \"return\" is needed",
            ],
        );
        check_refused(
            &lines("held", "return", mission),
            "",
            &[
                "configs/a.toml:4: expect = \"held\": is never so with end = \"return\"",
                "end = \"hold\" is needed",
            ],
        );
    }
    let fault = "[[fault]]\nkind = \"bus\"\nat_s = 90\n";
    let battery = "vehicles.endurance_driving_s = 600\n";
    let lossy = "bus.drop_share = 0.1\n";
    for (expect, end) in [("home", "hold"), ("held", "return")] {
        for more in [fault, battery, lossy] {
            assert!(read(&lines(expect, end, more)).is_ok(), "{expect} {more}");
        }
    }
    for (expect, end) in [("home", "return"), ("held", "hold"), ("finished", "hold")] {
        assert!(read(&lines(expect, end, explore)).is_ok(), "{expect} {end}");
    }
}
