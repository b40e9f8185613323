//! How far silence is believed of beams that see nothing beside the vehicle: what is refused, what is left as it is, and that
//! both kinds of files say the same.

use tomoswarm::config::{self, Config, SensorCoverage, bundled};

const SIM: &str = "\
kind = \"sim\"
venue = \"courtyard.venue.toml\"
scene = \"../scenes/courtyard.scene.toml\"
vehicles.max_speed_mps = 0.2
";

const VEHICLE: &str = "\
kind = \"vehicle\"
venue = \"courtyard.venue.toml\"
id = 1
state_dir = \"state/1\"
vehicle.max_speed_mps = 0.2
autopilot.driver = \"sim\"
range.driver = \"sim\"
servo.driver = \"sim\"
radio.driver = \"sim\"
world.connect = \"127.0.0.1:7500\"
world.token = \"0123456789abcdef\"
";

const AHEAD: &str = "range.beams_deg = [0]\n";

fn read(text: &str) -> Result<Config, String> {
    let config = config::read("configs/x.toml", text, &mut |path| bundled::load(path));
    config.map_err(|problems| problems.to_string())
}

/// The sensor of a simulation, or what is wrong with these lines.
fn in_sim(lines: &str) -> Result<SensorCoverage, String> {
    match read(&format!("{SIM}{lines}"))? {
        Config::Sim(sim) => Ok(sim.range.look),
        other => panic!("{other:?}"),
    }
}

/// The sensor of a vehicle's file with the same lines.
fn in_vehicle(lines: &str) -> Result<SensorCoverage, String> {
    let lines = lines.replace("vehicles.", "vehicle.");
    match read(&format!("{VEHICLE}{lines}"))? {
        Config::Vehicle(file) => Ok(file.look),
        other => panic!("{other:?}"),
    }
}

/// The sure range that both kinds of files make of the same lines, metres.
fn sure_m(lines: &str) -> f64 {
    let (simulated, own) = (in_sim(lines).unwrap(), in_vehicle(lines).unwrap());
    assert_eq!(simulated, own);
    own.sure_range_m
}

#[test]
fn a_sure_range_beyond_what_silence_proves_is_refused_with_both_cures() {
    let lines = "range.beams_deg = [0]\nrange.sure_range_m = 3\n";
    let problem = "range.sure_range_m = 3: is too far for beams that look no farther than 15° to one side: a wall along the \
                   way answers from 30° on, and would be taken for free; at most 0.7 m is allowed, or beams to both sides";
    assert_eq!(
        in_sim(lines).unwrap_err(),
        format!("configs/x.toml:6: {problem}")
    );
    assert_eq!(
        in_vehicle(lines).unwrap_err(),
        format!("configs/x.toml:13: {problem}")
    );
    let just_above = format!("{AHEAD}range.sure_range_m = 0.701\n");
    assert!(in_sim(&just_above).is_err() && in_vehicle(&just_above).is_err());
}

#[test]
fn a_sure_range_up_to_the_bound_is_taken_as_it_is_given() {
    assert_eq!(sure_m(&format!("{AHEAD}range.sure_range_m = 0.7\n")), 0.7);
    assert_eq!(sure_m(&format!("{AHEAD}range.sure_range_m = 0.69\n")), 0.69);
}

#[test]
fn a_sure_range_that_is_left_out_is_what_radius_padding_and_incidence_allow() {
    assert_eq!(sure_m(AHEAD), 0.7);
    let wide = "vehicles.radius_m = 0.3\nsafety.padding_m = 0.15\n";
    assert_eq!(sure_m(&format!("{AHEAD}{wide}")), 0.9);
    // 0.35 m over the cosine of 65°.
    let look = in_sim(&format!("{AHEAD}range.incidence_limit_deg = 65\n")).unwrap();
    assert_eq!(look.sure_range_m, 0.828);
    // What keeps far from walls is not bound.
    let far = in_vehicle("range.beams_deg = [0]\nsafety.padding_m = 1.5\n").unwrap();
    assert_eq!(far.sure_range_m, 3.0);
}

#[test]
fn what_silence_proves_may_be_too_little_for_the_speed() {
    let fast = format!("{AHEAD}vehicles.braking_mps2 = 0.1\n");
    for problem in [in_sim(&fast).unwrap_err(), in_vehicle(&fast).unwrap_err()] {
        assert!(problem.contains("only 0.11 m are surely seen"), "{problem}");
    }
    let fat = "range.beams_deg = [0]\nrange.incidence_limit_deg = 45\n";
    let problem = in_sim(fat).unwrap_err();
    let expected =
        "configs/x.toml:5: range.sure_range_m = 0.494 (the default): the vehicle cannot look";
    assert!(problem.starts_with(expected), "{problem}");
}

#[test]
fn beams_that_see_both_sides_are_left_alone() {
    for fan in [
        "",
        "range.beams_deg = [15, -15]\n",
        "range.beams_deg = [0, 90, -90]\n",
        "range.beams_deg = [0]\nrange.half_angle_deg = 30\n",
    ] {
        assert_eq!(sure_m(fan), 3.0, "{fan}");
        assert_eq!(
            sure_m(&format!("{fan}range.sure_range_m = 4\n")),
            4.0,
            "{fan}"
        );
    }
    for fan in [
        "[14, -15]",
        "[0, 90]",
        "[-90]",
        "[0, 120, -120]",
        "[0, 180]",
    ] {
        let lines = format!("range.beams_deg = {fan}\n");
        assert_eq!(sure_m(&lines), 0.7, "{fan}");
    }
}

#[test]
fn a_servo_helps_only_by_the_beams_that_it_turns_to() {
    let servo =
        "[[range.sensor]]\nservo_from_deg = -90\nservo_to_deg = 90\nslew_s_per_60_deg = 0.02\n";
    assert_eq!(sure_m(&format!("{AHEAD}{servo}")), 0.7);
    assert_eq!(sure_m(servo), 3.0);
}

#[test]
fn a_ray_listens_along_itself_only() {
    let lines = "range.beams_deg = [0, 25, -25]\nrange.lobe = ";
    let sure_m = |lobe: &str| in_sim(&format!("{lines}{lobe:?}\n")).unwrap().sure_range_m;
    assert_eq!((sure_m("cone"), sure_m("beam")), (3.0, 0.7));
}

#[test]
fn a_vehicle_that_is_not_driven_may_look_ahead_only() {
    let text = VEHICLE
        .replace("servo.driver = \"sim\"", "servo.driver = \"none\"")
        .replace("range.driver = \"sim\"", "range.driver = \"none\"");
    let file = read(&format!("{text}range.sure_range_m = 3.5\n"));
    assert!(
        matches!(&file, Ok(Config::Vehicle(file)) if file.look.sure_range_m == 3.5),
        "{file:?}"
    );
}

#[test]
fn what_is_written_of_a_bounded_sure_range_is_read_back() {
    for text in [format!("{SIM}{AHEAD}"), format!("{VEHICLE}{AHEAD}")] {
        let config = read(&text).unwrap();
        let written = config::to_toml(&config);
        assert!(written.contains("sure_range_m = 0.7 "), "{written}");
        let back = config::read("-", &written, &mut |path| bundled::load(path));
        assert_eq!(back.unwrap(), config);
    }
}

#[test]
fn an_experiment_is_told_of_a_sensor_where_it_names_it() {
    let text = "kind = \"experiment\"\nsim = \"courtyard.sim.toml\"\nsafety_distances_m = [0.35, 1.5]\n\
                [[sensor]]\nbeams_deg = [0]\n[with.vehicles]\nmax_speed_mps = 0.2\n";
    let grid = config::read_experiment("configs/trial.toml", text).unwrap();
    // The courtyard's own file says a sure range of 3 m.
    let near = grid.sim(0, &mut |path| bundled::load(path)).unwrap_err();
    let expected = "configs/courtyard.sim.toml:20: range.sure_range_m = 3.0: is too far for beams";
    assert!(near.to_string().starts_with(expected), "{near}");
    assert!(grid.sim(1, &mut |path| bundled::load(path)).is_ok());
}

#[test]
fn silence_from_afar_is_believed_of_rounds_that_leave_no_gap_beside_the_vehicle() {
    let sensor = |period_s: f64, sure_m: f64| {
        format!(
            "range.max_range_m = 6\nrange.scan_period_s = {period_s}\nrange.sure_range_m = {sure_m}\n"
        )
    };
    assert_eq!(sure_m(&sensor(0.1, 4.0)), 4.0);
    // As much as without the key.
    assert_eq!(sure_m(&sensor(1.0, 3.0)), 3.0);
    for refused in [in_sim(&sensor(1.0, 4.0)), in_vehicle(&sensor(1.0, 4.0))] {
        let said = refused.unwrap_err();
        let problem = "range.sure_range_m = 4: is too far for beams whose round takes";
        assert!(said.contains(problem), "{said}");
        assert!(said.contains("at most 3 m is allowed"), "{said}");
    }
    // A ray leaves more of a wall between two looks than a cone does.
    let slow = sensor(0.55, 4.0);
    assert_eq!(sure_m(&slow), 4.0);
    let said = in_sim(&format!("{slow}range.lobe = \"beam\"\n")).unwrap_err();
    assert!(said.contains("drives past 0.55 m"), "{said}");
}

#[test]
fn a_sensor_that_leaves_ground_beside_the_body_unseen_is_refused() {
    let explorer = |lines: &str| in_sim(&format!("mission.kind = \"explore\"\n{lines}"));
    for sensor in [explorer, in_sim] {
        let wrong = sensor("range.min_range_m = 0.3\n").unwrap_err();
        for part in [
            "configs/x.toml:",
            "range.min_range_m = 0.3: leaves ground just beside a body with a radius of 0.25 m unseen",
            "at most 0.25 m is allowed for this radius",
        ] {
            assert!(wrong.contains(part), "{wrong}");
        }
        for fits in [
            "range.min_range_m = 0.25\n",
            "range.min_range_m = 0.3\nvehicles.radius_m = 0.3\n",
        ] {
            assert!(sensor(fits).is_ok(), "{fits}: {:?}", sensor(fits));
        }
    }
    let looks = "mission.kind = \"browse\"\nrange.min_range_m = 0.3\n";
    assert!(in_sim(looks).is_ok(), "who only looks around stays");
}
