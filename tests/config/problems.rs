//! Bad configurations: every mistake is listed, with file, line, key, value and what is allowed.

use tomoswarm::config::{self, bundled};

const VENUE: &str = "\
kind = \"venue\"
area_m = [0, 0, 20, 20]
fence_m = [[-3, -3], [23, -3], [23, 23], [-3, 23]]
homes_m = [[-1, -1], [21, 21]]
[datum]
latitude_deg = 52.0
longitude_deg = 4.9
";

const SIM: &str = "\
kind = \"sim\"
venue = \"courtyard.venue.toml\"
scene = \"../scenes/courtyard.scene.toml\"
";

/// Reads a file that must be refused, and returns what is said about it.
fn problems_of(file_name: &str, text: &str) -> String {
    match config::read(file_name, text, &mut |path| bundled::load(path)) {
        Ok(config) => format!("accepted: {config:?}"),
        Err(problems) => problems.to_string(),
    }
}

fn check(file_name: &str, text: &str, expected: &[&str]) {
    assert_eq!(problems_of(file_name, text), expected.join("\n"), "{text}");
}

/// Checks the answer to a simulation file of three good lines and the given ones.
fn check_sim(lines: &str, expected: &[&str]) {
    check("configs/a.toml", &format!("{SIM}{lines}"), expected);
}

/// Checks the answer to a venue file in which one line is replaced.
fn check_venue(old: &str, new: &str, expected: &[&str]) {
    assert!(VENUE.contains(old));
    check("v.toml", &VENUE.replace(old, new), expected);
}

fn check_scene(lines: &str, expected: &[&str]) {
    check("s.toml", &format!("kind = \"scene\"\n{lines}"), expected);
}

#[test]
fn several_mistakes_are_all_listed_in_the_order_of_the_lines() {
    check_sim(
        "end = \"stop\"
until_s = 0
[vehicles]
cuont = 2
radius_m = \"wide\"
max_speed_mps = nan
[range]
beams_deg = [0, 400]
[sweep]
positions = 2.5
[bus]
drop_share = 1.5
",
        &[
            "configs/a.toml:4: end = \"stop\": is no choice; \"hold\" or \"return\" is allowed",
            "configs/a.toml:5: until_s = 0: is out of range; a number from 1 to 1000000 is allowed",
            "configs/a.toml:7: vehicles.cuont: is not known; did you mean count?",
            "configs/a.toml:8: vehicles.radius_m = \"wide\": is no number; a number from 0.05 to 2 is allowed",
            "configs/a.toml:9: vehicles.max_speed_mps = nan: is out of range; a number from 0.01 to 20 is allowed",
            "configs/a.toml:11: range.beams_deg = [0, 400]: is no such list; a list of 1 to 64 numbers is allowed, each from -180 to 180",
            "configs/a.toml:13: sweep.positions = 2.5: is no such number; a whole number from 8 to 2000 is allowed",
            "configs/a.toml:15: bus.drop_share = 1.5: is out of range; a number from 0 to 0.99 is allowed",
        ],
    );
}

#[test]
fn a_broken_line_does_not_hide_the_mistakes_of_others() {
    check_sim(
        "until_s = \n[vehicles]\nradius_m = 5\ncount = = 3\n",
        &[
            "configs/a.toml:4: no valid TOML: string values must be quoted, expected literal string",
            "configs/a.toml:6: vehicles.radius_m = 5: is out of range; a number from 0.05 to 2 is allowed",
            "configs/a.toml:7: no valid TOML: extra `=`, expected nothing",
        ],
    );
    check_sim(
        "[vehicles]\ncount = 2\ncount = 3\n[vehicles]\n",
        &[
            "configs/a.toml:6: no valid TOML: duplicate key count; once is allowed",
            "configs/a.toml:7: no valid TOML: duplicate key vehicles; once is allowed",
        ],
    );
}

#[test]
fn an_unknown_key_names_the_nearest_known_one() {
    check_sim(
        "[vehicle]\ncount = 2\n",
        &["configs/a.toml:4: vehicle: is not known; did you mean vehicles?"],
    );
    check_sim(
        "[radio]\np0 = -40\n",
        &["configs/a.toml:5: radio.p0: is not known; did you mean p0_dbm?"],
    );
    check_sim(
        "[radio]\nxyzzy = 1\n",
        &[
            "configs/a.toml:5: radio.xyzzy: is not known; known here: channel, power_dbm, slot_ms, successor_ms, frequency_hz, p0_dbm, exponent, rician_k, packet_sd_db, device_sd_db, sensitivity_dbm, sensitivity_slope_db, object_limit_db",
        ],
    );
    check_sim(
        "[[bus.partition]]\nfrom_s = 1\nuntil_s = 2\nside = 3\nsides = [[\"ground\"], [1]]\n",
        &["configs/a.toml:7: bus.partition[0].side: is not known; did you mean sides?"],
    );
}

#[test]
fn a_file_of_no_or_another_kind_is_refused() {
    check(
        "x.toml",
        "",
        &[
            "x.toml:1: kind: is missing; a file begins with kind = \"venue\", \"scene\", \"sim\", \"vehicle\", \"ground\", \"operator\" or \"experiment\"",
        ],
    );
    check(
        "x.toml",
        "kind = \"vheicle\"\n",
        &[
            "x.toml:1: kind = \"vheicle\": is not known; a file begins with kind = \"venue\", \"scene\", \"sim\", \"vehicle\", \"ground\", \"operator\" or \"experiment\"",
        ],
    );
    check(
        "x.toml",
        "kind = 3\n",
        &["x.toml:1: kind = 3: is no text; 1 to 200 characters in quotes are allowed"],
    );
    check(
        "configs/x.toml",
        "kind = \"sim\"\nvenue = \"x.toml\"\nscene = \"courtyard.venue.toml\"\n",
        &[
            "configs/x.toml:2: venue = \"x.toml\": configs/x.toml cannot be read: configs/x.toml is not bundled with the program; the name of a venue file is needed, relative to this file",
            "configs/courtyard.venue.toml:3: kind = \"venue\": is of another kind; kind = \"scene\" is needed here",
        ],
    );
    let problems =
        config::read_sim("v.toml", VENUE, None, &mut |path| bundled::load(path)).unwrap_err();
    assert_eq!(
        problems.to_string().lines().collect::<Vec<_>>(),
        ["v.toml:1: kind = \"venue\": is of another kind; kind = \"sim\" is needed here",]
    );
}

#[test]
fn a_file_that_is_named_but_missing_is_reported_where_it_is_named() {
    check(
        "configs/x.toml",
        "kind = \"sim\"\n\nvenue = \"gone.toml\"\n",
        &[
            "configs/x.toml:1: scene: is missing; the name of a scene file is needed, relative to this file",
            "configs/x.toml:3: venue = \"gone.toml\": configs/gone.toml cannot be read: configs/gone.toml is not bundled with the program; the name of a venue file is needed, relative to this file",
        ],
    );
}

#[test]
fn a_simulation_that_names_itself_is_refused() {
    let text = "kind = \"sim\"\nvenue = \"me.toml\"\nscene = \"me.toml\"\n";
    let problems = config::read("me.toml", text, &mut |_| Ok(text.to_owned())).unwrap_err();
    assert_eq!(
        problems.to_string().lines().collect::<Vec<_>>(),
        [
            "me.toml:1: kind = \"sim\": is of another kind; kind = \"venue\" is needed here",
            "me.toml:1: kind = \"sim\": is of another kind; kind = \"scene\" is needed here",
        ]
    );
}

#[test]
fn mistakes_of_the_venue_and_the_scene_are_listed_with_their_own_files() {
    let venue = VENUE.replace("52.0", "152.0");
    let mut loader = |path: &str| match path {
        "v.toml" => Ok(venue.clone()),
        "s.toml" => Ok("kind = \"scene\"\nup = \"x\"\n".to_owned()),
        _ => Err("no such file".to_owned()),
    };
    let text = "kind = \"sim\"\nvenue = \"v.toml\"\nscene = \"s.toml\"\nseed = -1\n";
    let problems = config::read("a.toml", text, &mut loader).unwrap_err();
    assert_eq!(
        problems.to_string().lines().collect::<Vec<_>>(),
        [
            "a.toml:4: seed = -1: is no such number; a whole number from 0 to 9223372036854775807 is allowed",
            "v.toml:6: datum.latitude_deg = 152.0: is out of range; a number from -89 to 89 is allowed",
            "s.toml:2: up = \"x\": is no choice; \"y\" or \"z\" is allowed",
        ]
    );
}

#[test]
fn a_venue_must_make_sense() {
    check_venue(
        "[0, 0, 20, 20]",
        "[20, 0, 0, 20]",
        &[
            "v.toml:2: area_m = [20, 0, 0, 20]: the first corner is not south-west of the second; [x0, y0, x1, y1] in metres is needed",
        ],
    );
    check_venue(
        "[0, 0, 20, 20]",
        "[0, 0, 20]",
        &[
            "v.toml:2: area_m = [0, 0, 20]: is no such list; a list of 4 numbers is allowed, each from -10000 to 10000",
        ],
    );
    check_venue(
        "[0, 0, 20, 20]",
        "[0, 0, 20, 24]",
        &[
            "v.toml:2: area_m = [0, 0, 20, 24]: its east side leaves the fence; the area must lie wholly inside fence_m",
        ],
    );
    check_venue(
        "[0, 0, 20, 20]",
        "[0, 0, 20, 2000]",
        &[
            "v.toml:2: area_m = [0, 0, 20, 2000]: the area is 20 m by 2000 m; sides from 1 to 1000 m are allowed",
        ],
    );
    check_venue(
        "[23, 23], [-3, 23]",
        "[-3, 23], [23, 23]",
        &[
            "v.toml:3: fence_m = [[-3, -3], [23, -3], [-3, 23], [23, 23]]: side 2 touches side 4; corners in order around a simple outline are needed",
        ],
    );
    check_venue(
        "[[-1, -1], [21, 21]]",
        "[[-1, -1], [-1, -0.5], [30, 30]]",
        &[
            "v.toml:4: homes_m = [[-1, -1], [-1, -0.5], [30, 30]]: homes 1 and 2 are too near to each other; homes must be at least 1 m apart",
            "v.toml:4: homes_m = [[-1, -1], [-1, -0.5], [30, 30]]: home 3 (30, 30) lies outside the fence; every home must lie inside fence_m",
        ],
    );
    check_venue(
        "[[-1, -1], [21, 21]]",
        "[[-1, inf]]",
        &[
            "v.toml:4: homes_m = [[-1, inf]]: is no such list; a list of 1 to 250 places [x, y] in metres is needed",
        ],
    );
    check_venue(
        "area_m",
        "cell_m = 0.01\narea_m",
        &["v.toml:2: cell_m = 0.01: is out of range; a number from 0.05 to 2 is allowed"],
    );
    check_venue(
        "area_m",
        "altitude_slices_m = [0, 2, 1]\narea_m",
        &[
            "v.toml:2: altitude_slices_m = [0, 2, 1]: the borders do not ascend; each border must lie at least 0.1 m above the one before",
        ],
    );
    check_venue(
        "area_m",
        "name = \"../etc\"\narea_m",
        &[
            "v.toml:2: name = \"../etc\": is no plain name; 1 to 64 letters, digits, - and _ are allowed",
        ],
    );
    check_venue(
        "[datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.9\n",
        "",
        &[
            "v.toml:1: datum: is missing; a table [datum] with latitude_deg and longitude_deg is needed",
        ],
    );
    check_venue(
        "latitude_deg = 52.0\n",
        "",
        &["v.toml:5: datum.latitude_deg: is missing; a number from -89 to 89 is allowed"],
    );
}

#[test]
fn a_scene_must_make_sense() {
    check_scene(
        "wrl = \"\"\noffset_m = [1, 2]\n",
        &[
            "s.toml:2: wrl = \"\": is no text; 1 to 200 characters in quotes are allowed",
            "s.toml:3: offset_m = [1, 2]: is no such list; a list of 3 numbers is allowed, each from -10000 to 10000",
        ],
    );
    check_scene(
        "[material.Wall]\ndb_per_m = -3\n[material.Roof]\ndb_per_meter = 3\n",
        &[
            "s.toml:3: material.Wall.db_per_m = -3: is out of range; a number from 0 to 200 is allowed",
            "s.toml:5: material.Roof.db_per_meter: is not known; did you mean db_per_m?",
        ],
    );
    check_scene(
        "[material]\nWall = 20\n",
        &["s.toml:3: material.Wall = 20: is no table; a table [material.Wall] is allowed"],
    );
    check_scene(
        "[[person]]\nname = \"a\"\n[[person]]\nat_m = [1, 2, 3]\nradius_m = 1e300\n",
        &[
            "s.toml:2: person[0].at_m: is missing; a place [x, y] in metres is needed",
            "s.toml:5: person[1].at_m = [1, 2, 3]: is no such list; a list of 2 numbers is allowed, each from -10000 to 10000",
            "s.toml:6: person[1].radius_m = 1e300: is out of range; a number from 0.05 to 2 is allowed",
        ],
    );
    check_scene(
        "[[object]]\noutline_m = [[0, 0], [1, 1], [1, 0], [0, 1]]\ntop_m = 0\n",
        &[
            "s.toml:3: object[0].outline_m = [[0, 0], [1, 1], [1, 0], [0, 1]]: side 1 touches side 3; corners in order around a simple outline are needed",
            "s.toml:4: object[0].top_m = 0: is not above bottom_m; a body needs a height",
        ],
    );
    check_scene(
        "[[object]]\ncentre_m = [0, 0]\noutline_m = [[0, 0], [1, 1], [1, 0]]\n",
        &[
            "s.toml:2: object[0].radius_m: is missing; a number from 0.01 to 500 is allowed",
            "s.toml:4: object[0].outline_m = [[0, 0], [1, 1], [1, 0]]: stands beside a circle; give outline_m, or centre_m and radius_m",
        ],
    );
    check_scene(
        "[material.Wall]\ncolour = \"#8a5a2\"\n[default_material]\ncolour = 7\n",
        &[
            "s.toml:3: material.Wall.colour = \"#8a5a2\": is no colour; red, green and blue such as \"#8a5a2b\" are needed",
            "s.toml:5: default_material.colour = 7: is no text; 1 to 200 characters in quotes are allowed",
        ],
    );
    check_scene(
        "[random_persons]\ncount = 101\n",
        &[
            "s.toml:3: random_persons.count = 101: is out of range; a whole number from 0 to 100 is allowed",
        ],
    );
    check_scene(
        "person = 3\n",
        &["s.toml:2: person = 3: is no such list; up to 1000 tables [[person]] are allowed"],
    );
}

#[test]
fn a_vehicle_that_cannot_look_before_it_drives_is_refused() {
    check_sim(
        "[vehicles]\nmax_speed_mps = 3\n",
        &[
            "configs/a.toml:5: vehicles.max_speed_mps = 3: the vehicle cannot look before it drives: 3 m/s needs 6.30 m to stop, but only 2.41 m are surely seen ahead: it would outrun its looks above 1.675 m/s; lower max_speed_mps, brake harder, scan faster or with fewer beams, or see farther",
        ],
    );
    check_sim(
        "[range]\nscan_period_s = 1.2\n",
        &[
            "configs/a.toml:1: vehicles.max_speed_mps = 0.5 (the default): the vehicle cannot look before it drives: 0.5 m/s needs 3.73 m to stop, but only 2.41 m are surely seen ahead: it would outrun its looks above 0.327 m/s; lower max_speed_mps, brake harder, scan faster or with fewer beams, or see farther",
        ],
    );
}

#[test]
fn a_vehicle_that_sees_nothing_beyond_its_own_margins_is_refused() {
    check_sim(
        "[range]\nsure_range_m = 0.5\n",
        &[
            "configs/a.toml:5: range.sure_range_m = 0.5: the vehicle cannot look before it drives: a sure range of 0.5 m leaves nothing to drive in beyond a margin of 0.59 m; see farther, or lower radius_m, padding_m, pose_sd_m or cell_m",
        ],
    );
}

#[test]
fn the_speed_limit_counts_the_deviation_of_the_place_the_cell_and_the_handling_of_a_look() {
    // 0.5 m/s for five looks and one reading more, and braking: 0.425 m. The margin is 0.25 + 0.1 m, twice 0.05 m,
    // and half the diagonal of a cell of 0.2 m: 0.591 m. Together 1.016 m.
    let is_refused = |lines: &str| {
        !problems_of("configs/a.toml", &format!("{SIM}{lines}")).starts_with("accepted")
    };
    assert!(is_refused("[range]\nsure_range_m = 1.01\n"));
    assert!(!is_refused("[range]\nsure_range_m = 1.02\n"));
    assert!(is_refused(
        "[vehicles]\npose_sd_m = 0.06\n[range]\nsure_range_m = 1.02\n"
    ));
    assert!(is_refused(
        "[range]\nsure_range_m = 1.02\nscan_period_s = 0.11\n"
    ));
}

#[test]
fn values_that_do_not_fit_together_are_refused() {
    check_sim(
        "[vehicles]\npose_sd_m = 1.0\n",
        &[
            "configs/a.toml:5: vehicles.pose_sd_m = 1.0: is above safety.pose_sd_max_m: nothing would ever be measured; at most pose_sd_max_m is allowed",
        ],
    );
    check_sim(
        "[range]\nsure_range_m = 5\n",
        &[
            "configs/a.toml:5: range.sure_range_m = 5: is beyond max_range_m; at most max_range_m is allowed",
        ],
    );
    check_sim(
        "[range]\nsettle_s = 0.2\n[sweep]\ndwell_s = 60\n",
        &[
            "configs/a.toml:5: range.settle_s = 0.2: leaves no time for a reading; less than scan_period_s is allowed",
            "configs/a.toml:6: sweep.dwell_limit_s = 30 (the default): is shorter than dwell_s; at least dwell_s is allowed",
        ],
    );
    check_sim(
        "[vehicles]\nradius_m = 0.5\n",
        &[
            "configs/a.toml:1: safety.separation_m = 1 (the default): lets two vehicles touch: it is measured from middle to middle; more than two vehicles.radius_m is allowed",
        ],
    );
    check_sim(
        "[radio]\npower_dbm = 0.4\n",
        &["configs/a.toml:5: radio.power_dbm = 0.4: is no whole number; beacons report whole dBm"],
    );
    check_sim(
        "[vehicles]\ncount = 1\n",
        &[
            "configs/a.toml:5: vehicles.count = 1: is out of range; a whole number from 2 to 8 is allowed",
        ],
    );
    check_sim(
        "[vehicles]\ncount = 8\n[sweep]\npositions = 20\n",
        &[
            "configs/a.toml:7: sweep.positions = 20: is too few for 8 vehicles at least 4 steps apart; 4 positions a vehicle are needed",
        ],
    );
    check_sim(
        "[safety]\npadding_m = 2.9\n[vehicles]\nmax_speed_mps = 0.01\n[range]\nmax_range_m=9\nsure_range_m=9\n",
        &[
            "configs/a.toml:2: venue = \"courtyard.venue.toml\": home 1 is nearer than 3.15 m to the fence; a vehicle, its padding and three deviations of its place must fit at home",
            "configs/a.toml:2: venue = \"courtyard.venue.toml\": home 2 is nearer than 3.15 m to the fence; a vehicle, its padding and three deviations of its place must fit at home",
            "configs/a.toml:2: venue = \"courtyard.venue.toml\": its fence leaves less than 3.15 m around the area; vehicles drive along the area's border and need their radius, their padding and three deviations of their place",
        ],
    );
    check_sim(
        "[[bus.partition]]\nfrom_s = 5\nuntil_s = 2\nsides = [[\"ground\"], [9]]\n",
        &[
            "configs/a.toml:6: bus.partition[0].until_s = 2: is not after from_s; a partition must last some time",
            "configs/a.toml:7: bus.partition[0].sides = [[\"ground\"], [9]]: is no such list; lists of nodes are needed, such as [[\"ground\"], [1, 2]]; vehicles are 1 to 2",
        ],
    );
    check_sim(
        "[[bus.partition]]\nfrom_s = 5\nuntil_s = 9\nsides = [[\"ground\", 1], [1, 2]]\n",
        &[
            "configs/a.toml:7: bus.partition[0].sides = [[\"ground\", 1], [1, 2]]: names a node twice; a node is on one side",
        ],
    );
}

#[test]
fn every_vehicle_needs_a_home() {
    let mut loader = |path: &str| {
        Ok(if path == "v.toml" {
            VENUE
        } else {
            "kind = \"scene\"\n"
        }
        .to_owned())
    };
    let text = "kind = \"sim\"\nvenue = \"v.toml\"\nscene = \"s.toml\"\nvehicles.count = 3\n";
    let problems = config::read("a.toml", text, &mut loader).unwrap_err();
    assert_eq!(
        problems.to_string(),
        "a.toml:4: vehicles.count = 3: the venue has 2 homes for 3 vehicles; at most one vehicle per home is allowed"
    );
}

#[test]
fn random_persons_must_fit_into_the_area() {
    let scene = "kind = \"scene\"\n[random_persons]\ncount = 40\n";
    let mut loader = |path: &str| Ok(if path == "v.toml" { VENUE } else { scene }.to_owned());
    let text = "kind = \"sim\"\nvenue = \"v.toml\"\nscene = \"s.toml\"\n";
    let problems = config::read("a.toml", text, &mut loader).unwrap_err();
    assert_eq!(
        problems.to_string().lines().collect::<Vec<_>>(),
        [
            "a.toml:3: scene = \"s.toml\": 40 random persons do not fit into the area of the venue; fewer persons or smaller distances are needed in [random_persons]",
        ]
    );
}

#[test]
fn hostile_text_is_refused_without_harm() {
    let deep_list = format!("{SIM}x = {}", "[".repeat(100_000));
    assert!(problems_of("a.toml", &deep_list).contains("a.toml:4: no valid TOML: "));
    let deep_key = format!("{SIM}[{}a]\n", "a.".repeat(100_000));
    assert!(problems_of("a.toml", &deep_key).contains("no valid TOML: recursion limit"));
    let deep_table = format!("{SIM}x = {}", "{a=".repeat(100_000));
    assert!(problems_of("a.toml", &deep_table).contains("a.toml:4: no valid TOML: "));
    let huge = "# filler\n".repeat(1_000_000);
    check(
        "a.toml",
        &huge,
        &["a.toml:1: the file has 9000000 bytes; at most 1048576 are read"],
    );
    assert!(
        problems_of("a.toml", "\u{0}\u{1}kind\u{feff} = \"\u{7f}")
            .contains("a.toml:1: no valid TOML")
    );
}

#[test]
fn a_long_or_multi_line_value_is_shown_on_one_short_line() {
    let long = format!("end = '''\n{}'''\n", "long\n".repeat(50));
    let shown = problems_of("configs/a.toml", &format!("{SIM}{long}"));
    assert_eq!(shown.lines().count(), 1);
    assert!(shown.len() < 200, "{shown}");
}

#[test]
fn a_fan_may_have_a_round_for_every_position_and_a_rotating_gap_64_laps() {
    let output = |lines: &str| problems_of("configs/a.toml", &format!("{SIM}[sweep]\n{lines}"));
    assert!(output("planner = \"fan\"\nlaps = 76\n").starts_with("accepted"));
    assert_eq!(
        output("planner = \"fan\"\nlaps = 77\n"),
        "configs/a.toml:6: sweep.laps = 77: is out of range; a whole number from 1 to 76 is allowed"
    );
    assert_eq!(
        output("laps = 65\n"),
        "configs/a.toml:5: sweep.laps = 65: is out of range; a whole number from 1 to 64 is allowed"
    );
}

#[test]
fn sensors_that_cannot_look_where_they_should_are_refused() {
    check_sim(
        "[range]\nfarness_m = 2.5\n[[range.sensor]]\nservo_from_deg = -30\nservo_to_deg = 30\n",
        &[
            "configs/a.toml:1: range.beams_deg: 50° is reached by no servo; directions within the limits of a [[range.sensor]] are allowed",
            "configs/a.toml:1: range.beams_deg: -50° is reached by no servo; directions within the limits of a [[range.sensor]] are allowed",
            "configs/a.toml:5: range.farness_m = 2.5: is nearer than sure_range_m: what stands there would be taken for free; at least sure_range_m is allowed",
        ],
    );
    check_sim(
        "[range]\nbeams_deg = [0, 180]\nscan_period_s = 0.05\n[[range.sensor]]\nmount_deg = 200\n[[range.sensor]]\nservo_from_deg = 5\nservo_to_deg = -5\nslew_s_per_60_deg = -1\n",
        &[
            "configs/a.toml:8: range.sensor[0].mount_deg = 200: is out of range; a number from -180 to 180 is allowed",
            "configs/a.toml:11: range.sensor[1].servo_to_deg = -5: is below servo_from_deg; at least servo_from_deg is allowed",
            "configs/a.toml:12: range.sensor[1].slew_s_per_60_deg = -1: is out of range; a number from 0 to 10 is allowed",
        ],
    );
    check_sim(
        "[range]\nbeams_deg = [0, 180]\nscan_period_s = 0.05\n[[range.sensor]]\n[[range.sensor]]\nmount_deg = 180\n",
        &[
            "configs/a.toml:6: range.scan_period_s = 0.05: lets the next sensor hear the echo of the last: less than an echo from max_range_m takes; more is needed, or a shorter range",
        ],
    );
}

#[test]
fn the_speed_limit_counts_the_turns_of_the_servos() {
    // As above, 1.016 m without turns. Five beams at ±50° on one servo of 0.1 s for 60°: 200° a round, 0.33 s, and at
    // worst 100° more: 0.17 s; 0.25 m at 0.5 m/s.
    let is_refused = |sure_m: f64| {
        let sensor =
            "[[range.sensor]]\nservo_from_deg = -50\nservo_to_deg = 50\nslew_s_per_60_deg = 0.1\n";
        let lines = format!(
            "[range]\nsure_range_m = {sure_m}\nbeams_deg = [0, 25, 50, -25, -50]\n{sensor}"
        );
        !problems_of("configs/a.toml", &format!("{SIM}{lines}")).starts_with("accepted")
    };
    assert!(is_refused(1.26));
    assert!(!is_refused(1.27));
}

#[test]
fn copters_above_the_ceiling_and_winds_too_strong_are_refused() {
    check_sim(
        "[vehicles]\nkind = \"plane\"\nwind_mps = 9\n",
        &[
            "configs/a.toml:5: vehicles.kind = \"plane\": is no choice; \"rover\" or \"copter\" is allowed",
            "configs/a.toml:6: vehicles.wind_mps = 9: is out of range; a number from 0 to 5 is allowed",
        ],
    );
    check_sim(
        "[vehicles]\nkind = \"copter\"\naltitude_m = 9.8\n",
        &[
            "configs/a.toml:6: vehicles.altitude_m = 9.8: with the height of a vehicle is above the ceiling of the venue, 10 m; a lower altitude is needed",
        ],
    );
    check_sim(
        "[vehicles]\naltitude_m = 9.8\n[[fault]]\nkind = \"gps\"\n",
        &["configs/a.toml:6: fault[0].at_s: is missing; a number from 0 to 1000000 is allowed"],
    );
    check_sim(
        "[[fault]]\nkind = \"radio\"\nat_s = 1\nground = true\n",
        &[
            "configs/a.toml:7: fault[0].ground = true: has no effect for this kind; it must be left out, or the kind be bus, restart or dead",
        ],
    );
}

#[test]
fn a_wind_that_cannot_be_flown_in_is_refused_with_the_one_that_can() {
    let copters = |wind: &str| {
        format!("[vehicles]\nkind = \"copter\"\nwind_mps = {wind}\n[safety]\nseparation_m = 0.6\n")
    };
    // Between two copters of 0.25 m there is room for 0.1 m.
    check_sim(
        &copters("4.0"),
        &[
            "configs/a.toml:6: vehicles.wind_mps = 4.0: carries copters 0.20 m aside: more than their place, separation and \
           sensors leave room for; at most 1.9 m/s can be flown in here",
        ],
    );
    for lines in [
        copters("1.9"),
        copters("4.0").replace("copter\"", "rover\""),
    ] {
        let said = problems_of("configs/a.toml", &format!("{SIM}{lines}"));
        assert!(said.starts_with("accepted"), "{said}");
    }
}

#[test]
fn a_sensor_whose_echoes_come_too_late_is_refused() {
    check_sim(
        "[range]\nmax_range_m = 30.0\n",
        &[
            "configs/a.toml:5: range.max_range_m = 30.0: is heard after 0.175 s, and the next reading begins after 0.070 s: an \
           empty look would say nothing; at most 12.0 m is allowed, or a longer scan_period_s, or a shorter settle_s",
        ],
    );
    for lines in [
        "max_range_m = 12.0",
        "max_range_m = 30.0\nscan_period_s = 0.3",
    ] {
        let said = problems_of("configs/a.toml", &format!("{SIM}[range]\n{lines}\n"));
        assert!(said.starts_with("accepted"), "{said}");
    }
}

#[test]
fn places_at_the_fence_leave_room_for_a_body_whose_place_may_be_off() {
    let mission =
        |y_m: f64| format!("[mission]\nkind = \"pathfind\"\nwaypoints_m = [[10.0, {y_m:?}]]\n");
    // The fence lies at y = -3; a rover of 0.25 m whose place is known to 0.05 m.
    check_sim(
        &mission(-2.65),
        &[
            "configs/a.toml:6: mission.waypoints_m = [[10.0, -2.65]]: leads to (10, -2.65), 0.35 m from the fence, where a vehicle whose place may be off needs 0.40 m; places inside the fence are allowed",
        ],
    );
    assert!(
        problems_of("configs/a.toml", &format!("{SIM}{}", mission(-2.59))).starts_with("accepted")
    );
}
