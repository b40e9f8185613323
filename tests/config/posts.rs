//! Which posts are not touched: what a speed covers, what is refused, and that both kinds of files say the same.

use tomoswarm::config::{self, Config, bundled};
use tomoswarm::node::VehicleSettings;
use tomoswarm::plan::SmallestPost;
use tomoswarm_proto::{Boot, VehicleId};

const SIM: &str = "\
kind = \"sim\"
venue = \"courtyard.venue.toml\"
scene = \"../scenes/courtyard.scene.toml\"
";

const VEHICLE: &str = "\
kind = \"vehicle\"
venue = \"courtyard.venue.toml\"
id = 1
state_dir = \"state/1\"
autopilot.driver = \"sim\"
range.driver = \"sim\"
servo.driver = \"sim\"
radio.driver = \"sim\"
world.connect = \"127.0.0.1:7500\"
world.token = \"0123456789abcdef\"
";

/// What a simulation and a vehicle's file with the same lines promise, which must be the same: the thinnest post, or what
/// is wrong with the lines (that of the simulation's file, without its place).
fn promise(lines: &str) -> Result<Option<SmallestPost>, String> {
    let of_sim = lines
        .replace("vehicle.", "vehicles.")
        .replace("pose.expected_sd_m", "vehicles.pose_sd_m");
    let sim = read(&format!("{SIM}{of_sim}"));
    let vehicle = read(&format!("{VEHICLE}{lines}"));
    match (sim, vehicle) {
        (Ok(Config::Sim(sim)), Ok(Config::Vehicle(file))) => {
            let simulated = VehicleSettings::from_config(
                &sim,
                VehicleId(1),
                Boot(1),
                sim.home(VehicleId(1)).unwrap(),
            );
            let live = VehicleSettings::from_vehicle_file(&file, Boot(1));
            assert_eq!(simulated.look, live.look);
            assert_eq!(live.look.smallest_post, sim.smallest_post());
            Ok(live.look.smallest_post)
        }
        (Err(sim), Err(vehicle)) => {
            assert_eq!(sim, vehicle);
            Err(sim)
        }
        (sim, vehicle) => panic!("{sim:?}\n{vehicle:?}"),
    }
}

fn read(text: &str) -> Result<Config, String> {
    let config = config::read("configs/x.toml", text, &mut |path| bundled::load(path));
    config.map_err(|problems| {
        let text = problems.to_string();
        assert_eq!(text.lines().count(), 1, "{text}");
        let without_place = text.split_once(": ").map(|(_, problem)| problem.to_owned());
        without_place.unwrap()
    })
}

fn radius_m(lines: &str) -> f64 {
    promise(lines).unwrap().unwrap().radius_m
}

#[test]
fn the_default_rover_covers_three_centimetres_and_at_half_its_speed_one() {
    // 0.5 m/s for five looks of 0.1 s, 30 ms of settling, an echo from 4 m (23 ms) and a reaction of 0.15 s: 0.352 m; braking
    // 0.125 m; radius 0.25 m, twice 0.05 m, half the diagonal of 0.2 m: 0.491 m. Together 0.968 m.
    let fast = promise("").unwrap().unwrap();
    assert!((fast.heard_m - 0.968).abs() < 1e-3, "{fast:?}");
    assert!((fast.radius_m - 0.0268).abs() < 1e-4, "{fast:?}");
    let slow = promise("vehicle.max_speed_mps = 0.25\n").unwrap().unwrap();
    assert!((slow.radius_m - 0.0099).abs() < 1e-4, "{slow:?}");
}

#[test]
fn a_named_radius_that_is_covered_is_accepted_with_how_far_it_is_heard() {
    for lines in [
        "range.smallest_radius_m = 0.03\n",
        "range.smallest_radius_m = 0.01\nvehicle.max_speed_mps = 0.25\n",
    ] {
        let post = promise(lines).unwrap().unwrap();
        let detection = tomoswarm::plan::PostDetection::measured(0.01, 0.7, 4.0);
        assert!((post.heard_m - detection.range_m(post.radius_m)).abs() < 1e-12);
    }
    let post = promise("range.smallest_radius_m = 0.01\nvehicle.max_speed_mps = 0.25\n").unwrap();
    assert_eq!(
        post.map(|post| (post.radius_m * 1e3, (post.heard_m * 1e6).round())),
        Some((10.0, 7e5))
    );
}

#[test]
fn a_named_radius_that_is_not_covered_is_refused_with_what_would_do() {
    assert_eq!(
        promise("range.smallest_radius_m = 0.02\n").unwrap_err(),
        "range.smallest_radius_m = 0.02: is not covered at 0.5 m/s: a post of this radius is heard up to 0.88 m, and 0.97 m are needed; at most 0.423 m/s is allowed for this radius, at least 0.027 m at this speed"
    );
    let said = promise("range.smallest_radius_m = 0.02\nvehicle.max_speed_mps = 0.423\n");
    assert!(said.is_ok(), "{said:?}");
    let said = promise("range.smallest_radius_m = 0.027\n");
    assert!(said.is_ok(), "{said:?}");
    assert!(
        promise("range.smallest_radius_m = 0.001\n")
            .unwrap_err()
            .ends_with("; no speed is allowed for this radius, at least 0.027 m at this speed")
    );
}

#[test]
fn the_measured_dowel_the_looks_and_the_body_decide_what_is_covered() {
    let default_m = radius_m("");
    assert!(radius_m("range.dowel_range_m = 1.0\n") < default_m / 2.0);
    assert!(radius_m("range.dowel_radius_m = 0.02\n") > default_m * 1.5);
    assert!(radius_m("vehicle.radius_m = 0.4\n") > default_m);
    assert!(radius_m("pose.expected_sd_m = 0.08\n") > default_m);
    assert!(radius_m("range.scan_period_s = 0.12\n") > default_m);
    assert!(radius_m("vehicle.braking_mps2 = 0.5\n") > default_m);
    assert_eq!(radius_m("safety.padding_m = 0.3\n"), default_m);
}

#[test]
fn beams_that_do_not_cover_the_width_that_is_driven_need_posts_that_are_heard_from_farther() {
    let slow = |lines: &str| promise(&format!("vehicle.max_speed_mps = 0.2\n{lines}"));
    // A single cone of 15° sees the border of 0.35 m to each side from 1.35 m on.
    let alone = slow("range.beams_deg = [0]\n").unwrap().unwrap();
    let look_s = 0.1 + 0.03 + 8.0 / 343.0 + 0.15;
    let expected = 0.35 / 15f64.to_radians().sin() + 0.2 * look_s;
    assert!((alone.heard_m - expected).abs() < 1e-9, "{alone:?}");
    for gap in ["[20, -20]", "[16, 40]", "[-30, 10]"] {
        let lines = format!("range.beams_deg = {gap}\n");
        assert_eq!(slow(&lines).unwrap(), None, "{gap}");
        let named = format!("{lines}range.smallest_radius_m = 1\n");
        assert!(
            slow(&named)
                .unwrap_err()
                .contains("no radius at this speed")
        );
    }
    // Who sees nothing so near can only look around.
    let looking = "mission.kind = \"browse\"\nrange.min_range_m = 0.9\n";
    let blind = promise(looking).unwrap().unwrap();
    assert!(blind.heard_m > 0.9 + 0.3);
}

#[test]
fn a_range_too_short_for_the_speed_promises_nothing() {
    // 0.3 m/s need 0.89 m, of which the farthest echo leaves 0.88 m.
    let reach = |range_m: f64| {
        let lines = format!(
            "range.max_range_m = {range_m:?}\nrange.sure_range_m = {range_m:?}\nvehicle.radius_m = 0.4\n\
             vehicle.max_speed_mps = 0.3\nsafety.padding_m = 0\n"
        );
        promise(&lines).unwrap()
    };
    assert_eq!(reach(0.88), None);
    assert!(reach(0.9).is_some());
    let deaf = "range.dowel_radius_m = 0.2\nrange.dowel_range_m = 0.7\n";
    assert!(promise(deaf).unwrap().is_some());
    assert_eq!(
        promise("range.dowel_radius_m = 1\nrange.dowel_range_m = 0.5\n").unwrap(),
        None
    );
}

#[test]
fn a_beam_promises_nothing_and_may_not_be_asked_to() {
    let beam = |lines: &str| read(&format!("{SIM}range.lobe = \"beam\"\n{lines}"));
    let Ok(Config::Sim(sim)) = beam("") else {
        panic!("a beam is allowed");
    };
    assert_eq!(sim.smallest_post(), None);
    assert_eq!(
        beam("range.smallest_radius_m = 0.1\n").unwrap_err(),
        "range.smallest_radius_m = 0.1: is not promised by a beam: it passes by what is thin; leave it out, or listen in a fan or a cone"
    );
}

#[test]
fn values_out_of_range_are_listed_with_what_is_allowed() {
    for (line, problem) in [
        (
            "dowel_radius_m = 0",
            "0: is out of range; a number from 0.001 to 1 is allowed",
        ),
        (
            "dowel_range_m = nan",
            "nan: is out of range; a number from 0.05 to 50 is allowed",
        ),
        (
            "smallest_radius_m = -1",
            "-1: is out of range; a number from 0.001 to 10 is allowed",
        ),
    ] {
        let key = line.split(" = ").next().unwrap();
        assert_eq!(
            promise(&format!("range.{line}\n")).unwrap_err(),
            format!("range.{key} = {problem}")
        );
    }
}
