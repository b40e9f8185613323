//! What sensors read of walls, posts, vehicles and the ground.

use super::*;
use crate::geom::Polygon;
use crate::scene::{Footprint, Material, Person, Post, SceneParts};
use proptest::prelude::*;

fn model() -> RangeModel {
    RangeModel {
        sd_m: 0.0,
        ..RangeModel::default()
    }
}

/// A scene of upright bodies: footprint, lower and upper end.
fn scene(bodies: &[(Footprint, f64, f64)]) -> Scene {
    let post = |(footprint, low_m, high_m): &(Footprint, f64, f64)| Post {
        name: "post".to_owned(),
        footprint: footprint.clone(),
        low_m: *low_m,
        high_m: *high_m,
        material: Material::default(),
    };
    let posts: Vec<Post> = bodies.iter().map(post).collect();
    let parts = SceneParts {
        shapes: &[],
        offset_m: [0.0; 3],
        materials: &Default::default(),
        default_material: Material::default(),
        posts: &posts,
        persons: &[],
    };
    Scene::build(&parts).unwrap()
}

fn nothing() -> Scene {
    scene(&[])
}

/// A box that is turned about a corner of its near side, in the local frame.
fn turned(middle: Point, length_m: f64, depth_m: f64, turn_degrees: f64) -> Footprint {
    let normal = Vector::polar(Angle::from_degrees(turn_degrees), 1.0);
    let half = normal.left() * (length_m / 2.0);
    let deep = normal * depth_m;
    Footprint::Corners(Polygon::new(vec![
        middle - half,
        middle - half + deep,
        middle + half + deep,
        middle + half,
    ]))
}

/// A long wall through (`ahead_m`, 0), its normal turned by `turn` from the x axis.
fn wall(ahead_m: f64, turn_degrees: f64) -> Scene {
    let near = Point::new(ahead_m, 0.0);
    scene(&[(turned(near, 80.0, 1.0, turn_degrees), -1.0, 3.0)])
}

/// A pole: its middle and radius, from the ground to 2 m.
fn pole(x_m: f64, y_m: f64, radius_m: f64) -> (Footprint, f64, f64) {
    let centre = Point::new(x_m, y_m);
    (Footprint::Round { centre, radius_m }, -1.0, 2.0)
}

fn read(model: RangeModel, scene: &Scene, discs: &[Disc]) -> Option<f64> {
    read_at(model, leaning(0.0, 0.0, 0.0, 0.0), scene, discs)
}

fn disc(x_m: f64, y_m: f64) -> Disc {
    Disc {
        centre: Point::new(x_m, y_m),
        radius_m: 0.3,
        low_m: 0.0,
        high_m: 1.8,
    }
}

#[test]
fn a_wall_ahead_is_read_at_its_distance() {
    assert!((read(model(), &wall(2.0, 0.0), &[]).unwrap() - 2.0).abs() < 1e-12);
    assert_eq!(read(model(), &wall(4.1, 0.0), &[]), None);
    assert_eq!(read(model(), &wall(0.015, 0.0), &[]), None);
    assert_eq!(read(model(), &nothing(), &[]), None);
}

#[test]
fn the_nearest_part_of_an_oblique_wall_in_the_cone_is_read() {
    // The ray nearest to the normal, 7.5° of the 30°: 2 m cos 30° / cos 22.5°.
    let expected = 2.0 * 30f64.to_radians().cos() / 22.5f64.to_radians().cos();
    assert!((read(model(), &wall(2.0, 30.0), &[]).unwrap() - expected).abs() < 1e-9);
}

#[test]
fn without_an_echo_the_sensor_waits_for_its_farthest_one() {
    let far = RangeSensor::new(RangeModel {
        max_m: 8.0,
        ..model()
    });
    let seconds_s = |range_m| far.takes(range_m).as_secs_f64();
    assert!((seconds_s(None) - 16.0 / 343.0).abs() < 1e-6);
    assert!((seconds_s(Some(3.43)) - 0.02).abs() < 1e-6);
}

#[test]
fn a_grazing_wall_gives_no_echo() {
    assert!(read(model(), &wall(2.0, 57.0), &[]).is_some());
    assert_eq!(read(model(), &wall(2.0, 58.0), &[]), None);
}

#[test]
fn a_person_before_a_wall_is_read_and_one_behind_it_is_not() {
    assert!((read(model(), &wall(2.0, 0.0), &[disc(1.5, 0.0)]).unwrap() - 1.2).abs() < 1e-12);
    assert!((read(model(), &wall(2.0, 0.0), &[disc(2.5, 0.0)]).unwrap() - 2.0).abs() < 1e-12);
    // The grazing wall gives no echo of its own and still hides what is behind it.
    assert_eq!(read(model(), &wall(1.0, 70.0), &[disc(2.5, 0.0)]), None);
}

#[test]
fn a_sensor_inside_a_disc_reads_nothing() {
    assert_eq!(read(model(), &wall(2.0, 0.0), &[disc(0.1, 0.0)]), None);
}

#[test]
fn readings_scatter_by_their_deviation_and_stay_in_range() {
    let sensor = RangeSensor::new(RangeModel {
        sd_m: 0.05,
        ..model()
    });
    let noise = Noise::new(1);
    let readings = readings(&sensor, &wall(2.0, 0.0), &noise, 10_000);
    let mean = readings.iter().sum::<f64>() / 10_000.0;
    let square = readings
        .iter()
        .map(|reading| (reading - 2.0).powi(2))
        .sum::<f64>()
        / 10_000.0;
    assert!((mean - 2.0).abs() < 0.002 && (square.sqrt() - 0.05).abs() < 0.002);
    let near = self::readings(&sensor, &wall(0.021, 0.0), &noise, 100);
    assert!(near.len() == 100 && near.iter().all(|reading| *reading >= 0.02));
}

/// What a sensor reads again and again.
fn readings(sensor: &RangeSensor, scene: &Scene, noise: &Noise, count: u64) -> Vec<f64> {
    let cut = LevelCut::of(scene, 0.0);
    let around = SensorSurroundings {
        scene,
        cut: &cut,
        discs: &[],
    };
    (0..count)
        .filter_map(|id| sensor.echo([0.0; 3], Angle::default(), around, noise, &[id]))
        .collect()
}

/// Level ground up to a height.
fn plate(at_m: f64) -> Scene {
    let middle = Point::new(-20.0, 0.0);
    scene(&[(turned(middle, 40.0, 40.0, 0.0), at_m - 1.0, at_m)])
}

fn read_at(model: RangeModel, eye: SensorPose, scene: &Scene, discs: &[Disc]) -> Option<f64> {
    let cut = LevelCut::of(scene, eye.origin[2]);
    let around = SensorSurroundings {
        scene,
        cut: &cut,
        discs,
    };
    RangeSensor::new(model).echo_at(&eye, around, &Noise::new(1), &[1])
}

fn leaning(roll_deg: f64, pitch_deg: f64, height_m: f64, beam_deg: f64) -> SensorPose {
    let [roll, pitch] = [roll_deg, pitch_deg].map(Angle::from_degrees);
    let attitude = Attitude {
        roll,
        pitch,
        yaw: Angle::ZERO,
    };
    SensorPose {
        origin: [0.0, 0.0, height_m],
        attitude,
        beam: Angle::from_degrees(beam_deg),
    }
}

#[test]
fn an_ideal_beam_reads_along_its_axis_only() {
    let ideal = RangeModel {
        lobe: Lobe::Beam,
        ..model()
    };
    let expected = 2.0 * 30f64.to_radians().cos() / 30f64.to_radians().cos();
    assert!((read(ideal, &wall(2.0, 30.0), &[]).unwrap() - expected).abs() < 1e-9);
    assert_eq!(read(ideal, &nothing(), &[disc(2.0, 0.31)]), None);
    assert!(read(ideal, &nothing(), &[disc(2.0, 0.29)]).is_some());
    assert!(read(model(), &nothing(), &[disc(2.0, 0.31)]).is_some());
}

#[test]
fn a_cone_hears_the_ground_that_a_fan_does_not() {
    let cone = RangeModel {
        lobe: Lobe::Cone,
        incidence_max_rad: 85f64.to_radians(),
        ..model()
    };
    let fan = RangeModel {
        lobe: Lobe::Fan,
        ..cone
    };
    let level = leaning(0.0, 0.0, 0.3, 0.0);
    let ground = read_at(cone, level, &plate(0.0), &[]).unwrap();
    // The lowest ray of the cone falls by 7.5°.
    let steepest = 0.3 / 7.5f64.to_radians().sin();
    assert!((ground - steepest).abs() < 1e-5, "{ground} {steepest}");
    assert_eq!(read_at(fan, level, &plate(0.0), &[]), None);
}

#[test]
fn in_the_plane_a_cone_hears_what_a_fan_hears() {
    let cone = RangeModel {
        lobe: Lobe::Cone,
        ..model()
    };
    for turn_deg in [-40.0, -10.0, 0.0, 25.0, 50.0] {
        let (a, b) = (
            read(cone, &wall(2.0, turn_deg), &[]),
            read(model(), &wall(2.0, turn_deg), &[]),
        );
        assert!(
            (a.unwrap() - b.unwrap()).abs() < 1e-5,
            "{turn_deg}°: {a:?} {b:?}"
        );
    }
}

#[test]
fn a_sensor_that_leans_reads_along_its_own_plane() {
    let ideal = RangeModel {
        lobe: Lobe::Beam,
        ..model()
    };
    // Nose down by 30° at 1 m: the ground is 2 m away; a wall at 1 m is hit first, 1 m / cos 30° away.
    let down = leaning(0.0, -30.0, 1.0, 0.0);
    let steep = RangeModel {
        incidence_max_rad: 61f64.to_radians(),
        ..ideal
    };
    assert!((read_at(steep, down, &plate(0.0), &[]).unwrap() - 2.0).abs() < 1e-9);
    let expected = 1.0 / 30f64.to_radians().cos();
    assert!((read_at(ideal, down, &wall(1.0, 0.0), &[]).unwrap() - expected).abs() < 1e-9);
    assert_eq!(
        read_at(ideal, down, &plate(0.0), &[]),
        None,
        "60° off the normal"
    );
    // Rolled to the right: what looks right sees the ground, what looks left does not.
    let rolled = |beam_deg| read_at(steep, leaning(30.0, 0.0, 1.0, beam_deg), &plate(0.0), &[]);
    assert!((rolled(-90.0).unwrap() - 2.0).abs() < 1e-9);
    assert_eq!((rolled(0.0), rolled(90.0)), (None, None));
}

#[test]
fn who_flies_over_a_rover_sees_it_only_when_it_leans_down() {
    let ideal = RangeModel {
        lobe: Lobe::Beam,
        ..model()
    };
    let rover = [Disc {
        centre: Point::new(2.0, 0.0),
        radius_m: 0.3,
        low_m: 0.0,
        high_m: 0.3,
    }];
    assert_eq!(
        read_at(ideal, leaning(0.0, 0.0, 1.3, 0.0), &nothing(), &rover),
        None
    );
    // Falling by 27° from 1.3 m it meets the top, 1 m lower, after 1 m / sin 27°.
    let met_m = read_at(ideal, leaning(0.0, -27.0, 1.3, 0.0), &nothing(), &rover).unwrap();
    assert!((met_m - 1.0 / 27f64.to_radians().sin()).abs() < 1e-9);
    // Falling by 40° it passes short of it; from lower down it hits the side.
    assert_eq!(
        read_at(ideal, leaning(0.0, -40.0, 1.3, 0.0), &nothing(), &rover),
        None
    );
    let side_m = read_at(ideal, leaning(0.0, -5.0, 0.29, 0.0), &nothing(), &rover).unwrap();
    assert!((side_m - 1.7 / 5f64.to_radians().cos()).abs() < 1e-9);
}

#[test]
fn glitches_come_as_often_as_they_should_and_anywhere_in_range() {
    let sensor = RangeSensor::new(RangeModel {
        glitch_share: 0.1,
        ..model()
    });
    let noise = Noise::new(4);
    let glitches = readings(&sensor, &nothing(), &noise, 20_000);
    assert!((1800..2200).contains(&glitches.len()), "{}", glitches.len());
    assert!(
        glitches
            .iter()
            .all(|range_m| (0.02..=4.0).contains(range_m))
    );
    assert!((glitches.iter().sum::<f64>() / glitches.len() as f64 - 2.01).abs() < 0.1);
}

#[test]
fn a_post_is_heard_up_to_the_distance_of_its_radius() {
    for (radius_m, heard_m) in [(0.01, 0.7), (0.03, 1.004), (0.3, 2.08)] {
        let post = |gap_m: f64| scene(&[pole(gap_m + radius_m, 0.0, radius_m)]);
        let near = read(model(), &post(heard_m - 0.01), &[]).unwrap();
        assert!((near - (heard_m - 0.01)).abs() < 1e-9, "{near}");
        assert_eq!(read(model(), &post(heard_m + 0.01), &[]), None);
        let disc = |gap_m: f64| Disc {
            radius_m,
            ..disc(gap_m + radius_m, 0.0)
        };
        assert!(read(model(), &nothing(), &[disc(heard_m - 0.01)]).is_some());
        assert_eq!(read(model(), &nothing(), &[disc(heard_m + 0.01)]), None);
    }
}

#[test]
fn a_wall_is_a_thin_thing_seen_end_on_and_a_wide_one_broadside() {
    let wall = |turn_deg: f64| {
        let near = Point::new(1.5, 0.0);
        scene(&[(turned(near, 0.04, 3.0, turn_deg), -1.0, 2.0)])
    };
    assert_eq!(read(model(), &wall(0.0), &[]), None, "2 cm on either side");
    let broadside = scene(&[(turned(Point::new(1.5, 0.0), 3.0, 0.04, 0.0), -1.0, 2.0)]);
    assert!((read(model(), &broadside, &[]).unwrap() - 1.5).abs() < 1e-9);
    assert!(read(model(), &scene(&[pole(1.0, 0.0, 0.03)]), &[]).is_some());
}

#[test]
fn bricks_that_touch_are_one_wall() {
    let row = |gap_m: f64| {
        let brick = |index: i32| {
            let middle = Point::new(2.0, f64::from(index) * (0.1 + gap_m));
            (turned(middle, 0.1, 0.1, 0.0), -1.0, 2.0)
        };
        scene(&(-5..=5).map(brick).collect::<Vec<_>>())
    };
    assert!(read(model(), &row(0.005), &[]).is_some());
    assert_eq!(read(model(), &row(0.05), &[]), None);
}

#[test]
fn what_is_too_small_to_be_heard_hides_what_is_behind_it() {
    let behind = |half_m: f64| {
        scene(&[
            pole(1.2, 0.0, 0.02),
            (
                turned(Point::new(1.5, 0.0), 2.0 * half_m, 4.0, 0.0),
                -1.0,
                2.0,
            ),
        ])
    };
    let wide = RangeModel {
        posts: PostDetection::measured(0.02, 1.4, 4.0),
        ..model()
    };
    assert_eq!(read(model(), &behind(0.022), &[]), None);
    assert!((read(wide, &behind(0.022), &[]).unwrap() - 1.18).abs() < 1e-9);
}

#[test]
fn a_beam_hears_what_it_meets_however_small() {
    let ideal = RangeModel {
        lobe: Lobe::Beam,
        ..model()
    };
    let poles = scene(&[pole(3.0, 0.0, 0.01)]);
    assert!((read(ideal, &poles, &[]).unwrap() - 2.99).abs() < 1e-3);
    assert_eq!(read(ideal, &scene(&[pole(3.0, 0.02, 0.01)]), &[]), None);
}

#[test]
fn a_person_is_a_circle_for_a_level_fan() {
    // Whichever way the corners of its triangles lie, and however obliquely its faces are met.
    let strict = RangeModel {
        incidence_max_rad: 5f64.to_radians(),
        ..model()
    };
    for step in 0..40 {
        let at = Vector::polar(Angle::from_degrees(f64::from(step) * 0.3 - 6.0), 1.5);
        let person = [Person {
            name: "p".into(),
            at: Point::default() + at,
            path: Vec::new(),
            radius_m: 0.3,
            height_m: 1.8,
            db_per_m: 10.0,
        }];
        let parts = SceneParts {
            shapes: &[],
            offset_m: [0.0; 3],
            materials: &Default::default(),
            default_material: Material::default(),
            posts: &[],
            persons: &person,
        };
        let scene = Scene::build(&parts).unwrap();
        let eye = leaning(0.0, 0.0, 0.5, 0.0);
        assert!((read_at(strict, eye, &scene, &[]).unwrap() - 1.2).abs() < 1e-9);
    }
}

/// A fan and a cone without incidence limits, as wide as they may be in the simulation.
fn wide(lobe: Lobe) -> RangeModel {
    RangeModel {
        lobe,
        half_angle_rad: 15f64.to_radians(),
        incidence_max_rad: 60f64.to_radians(),
        ..model()
    }
}

#[test]
fn a_thin_pole_is_not_missed_by_a_fan_that_leans_nor_by_a_cone() {
    for step in 0..60 {
        let direction = Angle::from_degrees(f64::from(step) * 0.4 - 11.8);
        let at = Vector::polar(direction, 0.6);
        let poles = scene(&[pole(at.x_m, at.y_m, 0.01)]);
        for lobe in [Lobe::Fan, Lobe::Cone] {
            for (roll_deg, pitch_deg) in [(0.0, 0.0), (3.0, -4.0), (-8.0, 6.0)] {
                let eye = leaning(roll_deg, pitch_deg, 0.5, 0.0);
                let range_m = read_at(wide(lobe), eye, &poles, &[]);
                assert!(
                    range_m.is_some_and(|range_m| (range_m - 0.59).abs() < 0.02),
                    "{lobe:?} {step} {roll_deg} {pitch_deg}: {range_m:?}"
                );
                let vehicle = Disc {
                    radius_m: 0.01,
                    ..disc(at.x_m, at.y_m)
                };
                let range_m = read_at(wide(lobe), eye, &nothing(), &[vehicle]);
                assert!(
                    range_m.is_some_and(|range_m| (range_m - 0.59).abs() < 0.02),
                    "vehicle: {lobe:?} {step} {roll_deg} {pitch_deg}: {range_m:?}"
                );
            }
        }
    }
}

/// The same lobe by rays, each a beam of its own; every object is heard as far as the sensor hears it. `across`: rays from
/// one edge of a cone to the other; a fan has very many.
fn by_rays(
    model: RangeModel,
    eye: &SensorPose,
    around: SensorSurroundings<'_>,
    across: usize,
) -> Option<f64> {
    let axes = eye.axes();
    let count = 2000;
    let rays: Vec<[f64; 3]> = match model.lobe {
        Lobe::Beam => Vec::new(),
        Lobe::Fan => (-count..=count)
            .map(|index| {
                let (sin, cos) =
                    (model.half_angle_rad * f64::from(index) / f64::from(count)).sin_cos();
                [cos, sin, 0.0]
            })
            .collect(),
        Lobe::Cone => cone::rings(model.half_angle_rad, across),
    };
    let sensor = RangeSensor::new(model);
    let heard = rays.iter().filter_map(|ray| {
        let along = axes.along(*ray);
        let met = cone::first_met(eye.origin, along, model.max_m, around)?;
        let radius_m = around.half_width_m(met.body, along);
        (met.cosine >= sensor.facing && model.posts.hears(radius_m, met.distance_m))
            .then_some(met.distance_m)
    });
    heard.min_by(f64::total_cmp)
}

/// Boxes and poles beside each other, some low, some high.
fn arbitrary_scene() -> impl Strategy<Value = Scene> {
    let body = (
        0.4..4.0f64,
        -1.2..1.2f64,
        0.01..0.5f64,
        0.0..90.0f64,
        0.0..2.0f64,
        any::<bool>(),
    );
    proptest::collection::vec(body, 1..7).prop_map(|bodies| {
        let body =
            |(x_m, y_m, size_m, turn_deg, top_m, is_round): &(f64, f64, f64, f64, f64, bool)| {
                if *is_round {
                    let (footprint, low_m, _) = pole(*x_m + size_m, *y_m, *size_m / 4.0);
                    (footprint, low_m, *top_m)
                } else {
                    let middle = Point::new(*x_m + size_m, *y_m);
                    (
                        turned(middle, *size_m, size_m / 3.0, *turn_deg),
                        -1.0,
                        *top_m,
                    )
                }
            };
        scene(&bodies.iter().map(body).collect::<Vec<_>>())
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]
    #[test]
    fn a_sensor_that_leans_hears_nothing_farther_than_rays_do_nor_what_is_not_there(
        scene in arbitrary_scene(), roll_deg in -10.0..10.0f64, pitch_deg in -10.0..10.0f64, is_cone in any::<bool>(),
    ) {
        let lobe = if is_cone { Lobe::Cone } else { Lobe::Fan };
        // What is wide enough to be heard differs by the direction that one looks along: everything is heard here.
        let model = RangeModel { posts: PostDetection::measured(1e-4, 9.0, 4.0), ..wide(lobe) };
        let eye = leaning(roll_deg, pitch_deg, 0.8, 0.0);
        let cut = LevelCut::of(&scene, 0.8);
        let around = SensorSurroundings { scene: &scene, cut: &cut, discs: &[] };
        let range_m = RangeSensor::new(model).nearest_m(&eye, around);
        // Of what is partly hidden a cone hears what it sees of edges and nearest points, and what its own rays meet.
        let across = if scene.objects().len() > 1 { model.rays } else { 60 };
        if let Some(rays_m) = by_rays(model, &eye, around, across) {
            prop_assert!(range_m.is_some_and(|range_m| range_m <= rays_m + 1e-6), "{range_m:?} {rays_m}");
        }
        if let Some(range_m) = range_m && !is_cone {
            // Nothing at all is nearer. (What a cone says has been met by a ray.) What the fan's plane cuts the top of may stand
            // between two rays: one that leans a little more or less meets more of it.
            let all = RangeModel { incidence_max_rad: 90f64.to_radians(), half_angle_rad: model.half_angle_rad + 1e-3, ..model };
            let more = [(0.0, 0.0), (0.02, 0.0), (-0.02, 0.0), (0.0, 0.02), (0.0, -0.02)];
            let eyes = more.map(|(roll, pitch)| leaning(roll_deg + roll, pitch_deg + pitch, 0.8, 0.0));
            let nearest_m = eyes.iter().filter_map(|eye| by_rays(all, eye, around, across)).min_by(f64::total_cmp);
            prop_assert!(nearest_m.is_none_or(|nearest_m| range_m > nearest_m - 0.01), "{range_m} {nearest_m:?}");
        }
    }

    #[test]
    fn a_disc_is_read_at_its_nearest_point_inside_the_fan(
        x_m in -1.0..3.0f64, y_m in -2.0..2.0f64, radius_m in 0.05..0.6f64,
    ) {
        prop_assume!(x_m.hypot(y_m) > radius_m + 0.05);
        let disc = Disc { centre: Point::new(x_m, y_m), radius_m, low_m: -1.0, high_m: 1.0 };
        let loud = RangeModel { posts: PostDetection::measured(0.001, 9.0, 9.0), max_m: 9.0, ..model() };
        let got = read(loud, &nothing(), &[disc]);
        // Many rays over the fan, each against the circle.
        let half_rad = 7.5f64.to_radians();
        let nearest_m = (-2000..=2000)
            .filter_map(|index| {
                let (sin, cos) = (half_rad * f64::from(index) / 2000.0).sin_cos();
                let (ahead_m, beside_m) = (cos * x_m + sin * y_m, cos * y_m - sin * x_m);
                let square = radius_m * radius_m - beside_m * beside_m;
                (ahead_m > 0.0 && square > 0.0).then(|| ahead_m - square.sqrt())
            })
            .fold(f64::INFINITY, f64::min);
        match got {
            Some(distance_m) => {
                // Where the edge only touches the disc, rays within the fan may just miss it.
                prop_assert!(nearest_m - distance_m > -1e-9);
                prop_assert!(nearest_m - distance_m < 1e-3 || nearest_m.is_infinite());
            }
            None => prop_assert!(nearest_m.is_infinite()),
        }
    }
}
