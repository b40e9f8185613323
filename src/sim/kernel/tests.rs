//! What the kernel makes of what happens in the environment, in one small place: vehicle 1 faces a wall 1.5 m ahead,
//! vehicle 2 has free space ahead. Nobody sees anything, and nobody is ordered to move: the tests drive.

use super::*;
use crate::config;
use crate::geom::Point;
use crate::sim::Scenario;

const SIM: &str = "kind = \"sim\"\nvenue = \"venue.toml\"\nscene = \"scene.toml\"\nuntil_s = 12.0
[vehicles]\nmax_speed_mps = 1.0\nacceleration_mps2 = 5.0\nbraking_mps2 = 5.0
[range]\nbeams_deg = [0.0]\n[sweep]\npositions = 40
[[fault]]\nkind = \"sensor\"\nat_s = 0.0\n";
const VENUE: &str = "kind = \"venue\"\narea_m = [0.0, 0.0, 10.0, 10.0]\nhomes_m = [[-1.5, 5.0], [5.0, -2.0]]
fence_m = [[-4.0, -4.0], [14.0, -4.0], [14.0, 14.0], [-4.0, 14.0]]
[datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\n";
const SCENE: &str = "kind = \"scene\"
[[object]]\nname = \"wall\"\noutline_m = [[0.0, 4.5], [1.0, 4.5], [1.0, 5.5], [0.0, 5.5]]\n";

fn scenario(more: &str) -> Scenario {
    let mut loader = |name: &str| match name {
        "venue.toml" => Ok(VENUE.to_owned()),
        "scene.toml" => Ok(SCENE.to_owned()),
        other => Err(format!("no file {other}")),
    };
    let text = format!("{SIM}{more}");
    let sim =
        config::read_sim("test.toml", &text, None, &mut loader).unwrap_or_else(|wrong| panic!("{wrong}"));
    Scenario::new(sim, Vec::new(), 1).unwrap()
}

fn drive(kernel: &mut Kernel, vehicle: usize, to: Point) {
    kernel.command(vehicle, DeviceCommand::Fly(Fly::Drive { corners: vec![to], speed_mps: 1.0 }));
}

/// Runs until a second, or to the end.
fn run(kernel: &mut Kernel, until_s: f64) {
    let mut watch = |shown: &Shown<'_>| shown.status.now.as_secs_f64() < until_s;
    kernel.run(&mut watch, None).unwrap();
}

#[test]
fn a_contact_ends_the_run_unless_the_scenario_says_otherwise() {
    for ends_at_contact in [true, false] {
        let mut scenario = scenario("");
        scenario.ends_at_contact = ends_at_contact;
        let mut kernel = Kernel::new(scenario.parts().unwrap());
        drive(&mut kernel, 0, Point::new(3.0, 5.0));
        run(&mut kernel, 1e9);
        assert_eq!(kernel.ended.is_some(), ends_at_contact);
        assert!(kernel.record.failure.as_ref().is_some_and(|why| why.contains("touched the scene")));
        let wreck = kernel.environment.world().truth(0, kernel.now);
        assert!((wreck.at.x_m + 0.25).abs() < 0.01 && wreck.speed_mps == 0.0, "{wreck:?}");
        assert_eq!(kernel.environment.world().collisions().len(), 1);
    }
}

#[test]
fn a_rover_whose_software_has_died_stops_two_seconds_later() {
    let scenario = scenario("[[fault]]\nkind = \"dead\"\nat_s = 1.0\nvehicles = [2]\n");
    let mut kernel = Kernel::new(scenario.parts().unwrap());
    drive(&mut kernel, 1, Point::new(5.0, 9.0));
    let speed_mps = |kernel: &Kernel| kernel.environment.world().truth(1, kernel.now).speed_mps;
    run(&mut kernel, 2.0);
    assert_eq!(speed_mps(&kernel), 1.0, "nobody has told it to stop");
    run(&mut kernel, 4.0);
    assert_eq!(speed_mps(&kernel), 0.0);
    let y_m = kernel.environment.world().truth(1, kernel.now).at.y_m;
    // Its last word was a beacon of the second before.
    assert!((-0.6..=1.0).contains(&y_m), "{y_m}");
}
