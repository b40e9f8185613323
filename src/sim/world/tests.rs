//! What the referee sees of vehicles on the ground and in the air.

use super::super::range::RangeModel;
use super::*;
use crate::autopilot::FlightMode;
use crate::geom::Rect;
use crate::geom::Vector;
use crate::scene::{Footprint, Material, Post, SceneParts};
use crate::sim::body::DriveLimits;
use crate::sim::radio_field::RadioConstants;

const LIMITS: DriveLimits = DriveLimits {
    speed_mps: 1.0,
    acceleration_mps2: 0.5,
    braking_mps2: 1.0,
    turn_rate_radps: 1.5,
};

pub fn secs(seconds_s: f64) -> Time {
    Time::from_secs_f64(seconds_s)
}

/// A stage with posts of 0.5 m radius, by x and their two ends, on the x axis.
pub fn stage(posts: &[(f64, f64, f64)]) -> WorldContents {
    let post = |(x_m, low_m, high_m): &(f64, f64, f64)| Post {
        name: "post".to_owned(),
        footprint: Footprint::Round {
            centre: Point::new(*x_m, 0.0),
            radius_m: 0.5,
        },
        low_m: *low_m,
        high_m: *high_m,
        material: Material::default(),
    };
    let posts: Vec<Post> = posts.iter().map(post).collect();
    let scene = Scene::build(&SceneParts {
        shapes: &[],
        offset_m: [0.0; 3],
        materials: &Default::default(),
        default_material: Material::default(),
        posts: &posts,
        persons: &[],
    });
    let scene = scene.unwrap();
    let attenuation = Attenuation::new(&scene, 0.5, 0.125, 30.0);
    WorldContents { scene, attenuation }
}

/// Vehicles of 0.25 m radius and 0.3 m height at places on the x axis, facing along it.
pub fn world(
    kind: VehicleKind,
    altitude_m: f64,
    posts: &[(f64, f64, f64)],
    places_m: &[f64],
) -> World {
    let build = VehicleBuild {
        radius_m: 0.25,
        height_m: 0.3,
        sensor_m: 0.2,
        limits: LIMITS,
        pose_sd_m: 0.0,
        pose_drift: Duration::from_secs(20),
        endurance_driving: Duration::from_secs(1000),
        endurance_resting: Duration::from_secs(4000),
    };
    let fence = Rect::new(Point::new(-50.0, -50.0), Point::new(50.0, 50.0)).polygon();
    let noise = Noise::new(1);
    let field = RadioField::new(noise, RadioConstants::default());
    let sensor = RangeSensor::new(RangeModel {
        sd_m: 0.0,
        ..RangeModel::default()
    });
    let flying = FlightConditions {
        kind,
        altitude_m,
        climb_mps: 1.0,
        wind: Vector::default(),
    };
    let mut world =
        World::new(stage(posts), build, fence, noise, field, sensor).with_flying(flying);
    for (number, x_m) in places_m.iter().enumerate() {
        world
            .place(
                VehicleId(number as u8 + 1),
                Point::new(*x_m, 0.0),
                Angle::default(),
            )
            .unwrap();
    }
    world
}

/// A route along the x axis, at the present altitude.
pub fn drive(x_m: f64) -> Command {
    Command::Route {
        corners: vec![Point::new(x_m, 0.0)],
        altitude_m: None,
        speed_mps: Some(1.0),
    }
}

const LANDS: Command = Command::Mode(FlightMode::Land);

/// Lets a vehicle obey; returns the contacts that it leads to.
fn obeys(world: &mut World, vehicle: usize, now: Time, command: &Command) -> Vec<PredictedContact> {
    let obeyed = world.command(vehicle, now, command);
    assert_eq!(obeyed.result, CommandAck::Accepted, "{command:?}");
    obeyed.contacts
}

/// Lets ten telemetries a second come and contacts happen, until one has, or the time is over.
fn run(
    world: &mut World,
    mut touches: Vec<PredictedContact>,
    from: Time,
    until: Time,
) -> Option<Collision> {
    let mut now = from;
    while now < until {
        now = now + Duration::from_millis(100);
        for vehicle in 0..world.vehicles() {
            world.report(vehicle, now);
        }
        touches.extend(world.foreseen());
        touches.sort_by_key(|touch| touch.at);
        let due: Vec<PredictedContact> = touches.extract_if(.., |touch| touch.at <= now).collect();
        if let Some(collision) = due.iter().find_map(|touch| world.touch(touch)) {
            return Some(collision);
        }
    }
    None
}

#[test]
fn who_flies_over_a_post_does_not_touch_it_and_who_flies_lower_does() {
    for (altitude_m, touches) in [(1.5, false), (0.99, false), (0.97, true), (0.5, true)] {
        let mut world = world(VehicleKind::Copter, altitude_m, &[(5.0, 0.0, 1.0)], &[0.0]);
        let foreseen = obeys(&mut world, 0, Time::ZERO, &drive(10.0));
        let collision = run(&mut world, foreseen, Time::ZERO, secs(20.0));
        assert_eq!(collision.is_some(), touches, "at {altitude_m} m");
        let Some(collision) = collision else {
            assert!((world.truth(0, secs(20.0)).at.x_m - 10.0).abs() < 1e-9);
            continue;
        };
        // It touches 0.75 m before the middle of the post: 1 m and 2 s to come to speed, then 3.25 m at 1 m/s. (The post
        // is a polygon.)
        assert!((collision.place.x_m - 4.25).abs() < 0.02, "{collision:?}");
        assert!(
            (collision.at.as_secs_f64() - 1.0 - collision.place.x_m).abs() < 1e-6,
            "{collision:?}"
        );
        assert_eq!((collision.vehicle, collision.with), (VehicleId(1), None));
        assert_eq!(
            world.truth(0, secs(20.0)).at,
            collision.place,
            "it stays there"
        );
    }
}

#[test]
fn who_flies_under_something_does_not_touch_it() {
    let mut world = world(VehicleKind::Copter, 0.5, &[(5.0, 0.81, 2.0)], &[0.0]);
    let foreseen = obeys(&mut world, 0, Time::ZERO, &drive(10.0));
    assert_eq!(run(&mut world, foreseen, Time::ZERO, secs(20.0)), None);
}

#[test]
fn who_comes_down_on_something_touches_it_even_after_a_stage_that_nobody_commanded() {
    // From 12 m it sinks to 10 m at 1 m/s, and from there at 0.5 m/s onto a post of 1 m; its foot is 2 cm higher.
    let mut world = world(VehicleKind::Copter, 12.0, &[(0.0, 0.0, 1.0)], &[0.0]);
    let foreseen = obeys(&mut world, 0, secs(1.0), &LANDS);
    assert_eq!(foreseen, [], "the slow part has not begun");
    let collision = run(&mut world, foreseen, secs(1.0), secs(60.0)).unwrap();
    let expected_s = 1.0 + 2.0 + (9.0 + 0.02) / 0.5;
    assert!(
        (collision.at.as_secs_f64() - expected_s).abs() < 1e-6,
        "{collision:?}"
    );
}

#[test]
fn a_copter_that_has_landed_is_disarmed_and_takes_off_before_it_flies_again() {
    let mut world = world(VehicleKind::Copter, 2.0, &[], &[0.0]);
    obeys(&mut world, 0, secs(1.0), &LANDS);
    assert_eq!(run(&mut world, Vec::new(), secs(1.0), secs(8.0)), None);
    let down = world.report(0, secs(8.0));
    assert_eq!((down.is_armed, down.motion), (false, Motion::Resting));
    for command in [
        Command::Mode(FlightMode::Guided),
        Command::Arm { force: false },
    ] {
        obeys(&mut world, 0, secs(9.0), &command);
    }
    assert_eq!(
        world.command(0, secs(9.0), &drive(3.0)).result,
        CommandAck::Failed,
        "it has not taken off"
    );
    obeys(
        &mut world,
        0,
        secs(9.0),
        &Command::Takeoff { altitude_m: 2.0 },
    );
    let climbing = world.report(0, secs(10.0));
    assert_eq!(
        (climbing.is_armed, climbing.motion, climbing.speed_mps),
        (true, Motion::Turning, 0.0)
    );
    let mut sent_early = |at_s: f64| {
        let corners = vec![Point::new(0.25 * at_s, 0.0)];
        let route = Command::Route {
            corners,
            altitude_m: Some(2.0),
            speed_mps: Some(1.0),
        };
        obeys(&mut world, 0, secs(at_s), &route);
        assert_eq!(
            run(&mut world, Vec::new(), secs(at_s), secs(at_s + 20.0)),
            None
        );
        let end = secs(at_s + 20.0);
        (
            world.truth(0, end).at.x_m,
            world.crafts[0].autopilot.motion().altitude_m(end),
        )
    };
    // Before the climb is over, and long after it.
    for at_s in [10.5, 40.0] {
        let (x_m, altitude_m) = sent_early(at_s);
        assert!(
            (x_m - 0.25 * at_s).abs() < 1e-9 && (altitude_m - 2.0).abs() < 1e-9,
            "{x_m}, {altitude_m} m"
        );
    }
}

#[test]
fn two_copters_meet_at_one_altitude_and_one_passes_over_another_that_has_landed() {
    let mut both = world(VehicleKind::Copter, 2.0, &[], &[0.0, 6.0]);
    let foreseen = obeys(&mut both, 0, secs(1.0), &drive(12.0));
    let collision = run(&mut both, foreseen, secs(1.0), secs(20.0)).unwrap();
    assert_eq!(
        (collision.vehicle, collision.with),
        (VehicleId(1), Some(VehicleId(2)))
    );
    assert!((collision.place.x_m - 5.5).abs() < 2e-3, "{collision:?}");
    let mut over = world(VehicleKind::Copter, 2.0, &[], &[0.0, 6.0]);
    obeys(&mut over, 1, secs(1.0), &LANDS);
    run(&mut over, Vec::new(), secs(1.0), secs(8.0));
    let foreseen = obeys(&mut over, 0, secs(8.0), &drive(12.0));
    assert_eq!(run(&mut over, foreseen, secs(8.0), secs(30.0)), None);
    // Sinking beside it is no contact either; sinking onto it is.
    let foreseen = obeys(&mut over, 0, secs(30.0), &drive(6.2));
    assert_eq!(run(&mut over, foreseen, secs(30.0), secs(45.0)), None);
    let foreseen = obeys(&mut over, 0, secs(45.0), &LANDS);
    let collision = run(&mut over, foreseen, secs(45.0), secs(60.0)).unwrap();
    assert_eq!(collision.with, Some(VehicleId(2)));
    // From 2 m at 0.5 m/s down to 0.3 m.
    assert!(
        (collision.at.as_secs_f64() - 45.0 - 1.7 / 0.5).abs() < 1e-3,
        "{collision:?}"
    );
}

#[test]
fn rovers_touch_as_they_always_did() {
    let mut world = world(VehicleKind::Rover, 5.0, &[(5.0, 0.1, 1.0)], &[0.0, 20.0]);
    let foreseen = obeys(&mut world, 0, Time::ZERO, &drive(10.0));
    let [touch] = foreseen[..] else {
        panic!("{foreseen:?}")
    };
    assert!(
        (touch.at.as_secs_f64() - 5.25).abs() < 0.02 && touch.other.is_none(),
        "{touch:?}"
    );
}

#[test]
fn a_sensor_in_the_air_looks_over_what_is_low() {
    let range_m = |altitude_m: f64| {
        world(VehicleKind::Copter, altitude_m, &[(2.5, 0.0, 1.0)], &[0.0]).range_m(
            0,
            secs(1.0),
            Angle::default(),
            1,
        )
    };
    assert!((range_m(0.5).unwrap() - 2.0).abs() < 0.01);
    assert_eq!(range_m(1.5), None);
}

#[test]
fn without_satellites_the_believed_place_strays_and_its_deviation_says_so() {
    let outage = Outage {
        from: secs(10.0),
        until: secs(40.0),
    };
    let mut world = world(VehicleKind::Rover, 0.0, &[], &[]);
    world.build.pose_sd_m = 0.05;
    let mut world = world.with_outages(vec![(VehicleId(2), outage)], 0.1);
    for (id, x_m) in [(1, 0.0), (2, 5.0)] {
        world
            .place(VehicleId(id), Point::new(x_m, 0.0), Angle::default())
            .unwrap();
    }
    let mut strays = |vehicle: usize, now_s: f64| {
        let now = secs(now_s);
        let pose = world.report(vehicle, now).pose;
        (pose.sd_m, pose.at.distance_to(world.truth(vehicle, now).at))
    };
    assert_eq!(strays(1, 9.0).0, 0.05);
    assert!((strays(1, 30.0).0 - 2.05).abs() < 1e-9);
    assert!(strays(1, 30.0).1 > 0.3);
    assert_eq!((strays(0, 30.0).0, strays(1, 41.0).0), (0.05, 0.05));
    assert!(strays(0, 30.0).1 < 0.25);
}
