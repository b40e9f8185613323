//! Facts about what a vehicle carries and keeps: range sensors, servos, the cells of its map.

use std::f64::consts::FRAC_PI_2;

use serde_json::{Value, json};
use tomoswarm::geom::{Angle, Attitude, Bearing, Cell, Lattice, Point, Rect, Vector};
use tomoswarm::hw::pulse::{ServoError, ServoRange};
use tomoswarm::map::CellRect;
use tomoswarm::plan::{Mount, echo_time_s};
use tomoswarm::scene::{Footprint, LevelCut, Material, Post, Scene};
use tomoswarm::sim::noise::Noise;
use tomoswarm::sim::range::{Disc, Lobe, RangeModel, RangeSensor, SensorPose, SensorSurroundings};

use super::fact::{Checked, Fact, place};
use super::vrml::scene_of;

/// Beyond this nothing is met, metres.
const FARTHEST_M: f64 = 2000.0;
/// Speed of sound of the facts, m/s; the program's own is rounded.
const FACT_SOUND_MPS: f64 = 343.2;
/// The angle of a servo's scale at which it looks ahead, degrees.
const AHEAD_DEG: f64 = 90.0;

/// Checks a fact about a range sensor.
pub fn check_distance_sensor(fact: &Fact) -> Checked {
    match () {
        () if fact.has("mount_deg") => {
            let yaw = Bearing::from_degrees(fact.number("yaw_bearing_deg")?).angle();
            let mount = Angle::from_degrees(fact.number("mount_deg")?);
            let eye = SensorPose {
                origin: [0.0; 3],
                attitude: Attitude::level(yaw),
                beam: mount,
            };
            let [x, y, _] = eye.direction();
            fact.expect(
                "angle_deg",
                json!(Vector::new(x, y).angle().positive_degrees()),
            )
        }
        () if fact.has("echo_ms") => {
            let per_metre_s = echo_time_s(1.0, FACT_SOUND_MPS);
            let distance_m = fact.number("echo_ms")? * 1e-3 / per_metre_s;
            fact.expect("distance_m", json!(distance_m))
        }
        () if fact.has("pos_ne") => range_in_a_world(fact),
        () => {
            let pitch = -Angle::from_degrees(fact.number("pitch_deg")?);
            fact.expect("pitch_angle_deg", json!(pitch.positive_degrees()))
        }
    }
}

/// Returns what the simulated sensor reads when it is a single ray without noise.
fn heard(eye: &SensorPose, scene: &Scene, discs: &[Disc]) -> Option<f64> {
    let sensor = RangeSensor::new(RangeModel {
        lobe: Lobe::Beam,
        min_m: 0.0,
        max_m: FARTHEST_M,
        incidence_max_rad: FRAC_PI_2,
        sd_m: 0.0,
        ..RangeModel::default()
    });
    let cut = LevelCut::of(scene, eye.origin[2]);
    let around = SensorSurroundings {
        scene,
        cut: &cut,
        discs,
    };
    sensor.echo_at(eye, around, &Noise::new(1), &[1])
}

/// Blocks and a pole on the ground, seen by a beam ahead: the blocks are the scene's, and the pole is what the
/// simulation takes vehicles and persons for, since a round post of a scene has corners.
fn range_in_a_world(fact: &Fact) -> Checked {
    let at = fact.place("pos_ne")?;
    let pitch_deg = if fact.has("pitch_deg") {
        fact.number("pitch_deg")?
    } else {
        0.0
    };
    let yaw = Bearing::from_degrees(fact.number("bearing_deg")?).angle();
    let eye = SensorPose {
        origin: [at.x_m, at.y_m, fact.number("alt")?],
        attitude: Attitude {
            pitch: Angle::from_degrees(pitch_deg),
            ..Attitude::level(yaw)
        },
        beam: Angle::ZERO,
    };
    let (side, height) = (fact.number("block_side")?, fact.number("height")?);
    let half = Vector::new(side / 2.0, side / 2.0);
    let block = |centre: [f64; 2]| {
        let centre = place(centre);
        Post {
            name: "block".to_owned(),
            footprint: Footprint::Corners(Rect::new(centre - half, centre + half).polygon()),
            low_m: 0.0,
            high_m: height,
            material: Material::default(),
        }
    };
    let blocks: Vec<Post> = fact.table("blocks")?.into_iter().map(block).collect();
    let scene = scene_of(&[], &blocks)?;
    let [north, east, radius_m] = fact.numbers("pole")?;
    let pole = Disc {
        centre: place([north, east]),
        radius_m,
        low_m: 0.0,
        high_m: height,
    };
    fact.expect(
        "distance",
        heard(&eye, &scene, &[pole]).map_or(Value::Null, |distance| json!(distance)),
    )
}

/// Checks a fact about a servo: pulse widths are a servo's, and what it reaches is its mount's.
pub fn check_servo(fact: &Fact) -> Checked {
    let pulses = if fact.has("servo_pwm") {
        fact.numbers("servo_pwm")?
    } else {
        [1000.0, 2000.0]
    };
    let scale_deg = fact.numbers("servo_values")?;
    let shown = |error: ServoError| error.to_string();
    let servo = ServoRange::new(scale_deg, pulses).map_err(shown)?;
    let pulse_us = |angle_deg: f64| servo.pulse_us(angle_deg).map_err(shown);
    let mount = ScaledMount::new(scale_deg);
    match () {
        () if fact.has("initial") => {
            fact.flag("initial")?;
            let rest_deg = mount.scale_deg(mount.mount.rest_rad());
            fact.expect("value", json!(rest_deg))?;
            fact.expect("pwm", json!(pulse_us(rest_deg)?))
        }
        () if fact.has("requested_bearing_deg") => {
            let yaw = Bearing::from_degrees(fact.number("vehicle_yaw_deg")?);
            let wanted = Bearing::from_degrees(fact.number("requested_bearing_deg")?);
            let beam = wanted.angle() - yaw.angle();
            let offset_rad = mount.mount.reach(beam).ok_or("out of reach")?;
            fact.expect("pwm", json!(pulse_us(mount.scale_deg(offset_rad))?))
        }
        () if fact.has("pwm") => fact.expect(
            "value",
            json!(servo.angle_deg(fact.number("pwm")?).map_err(shown)?),
        ),
        () if fact.expects("allowed") => {
            let beam = Angle::from_degrees(fact.number("value")? - AHEAD_DEG);
            fact.expect("allowed", json!(mount.mount.reach(beam).is_some()))
        }
        () => fact.expect("pwm", json!(pulse_us(fact.number("value")?)?)),
    }
}

/// A servo's scale of the facts, and the mount that it is.
struct ScaledMount {
    mount: Mount,
    zero_deg: f64,
}

impl ScaledMount {
    /// The zero of a mount lies half a turn on where the scale goes further: it turns by half a turn at most.
    fn new([low_deg, high_deg]: [f64; 2]) -> ScaledMount {
        let zero_deg = if high_deg > 180.0 { 180.0 } else { 0.0 };
        let mount = Mount {
            zero: Angle::from_degrees(zero_deg - AHEAD_DEG),
            from_rad: (low_deg - zero_deg).to_radians(),
            to_rad: (high_deg - zero_deg).to_radians(),
            slew_s_per_rad: 0.0,
        };
        ScaledMount { mount, zero_deg }
    }

    /// Returns the angle on the scale of a position of the servo, degrees.
    fn scale_deg(&self, offset_rad: f64) -> f64 {
        self.zero_deg + offset_rad.to_degrees()
    }
}

/// Checks a fact about the cells of a map around the origin; indices are (row = north, column = east).
pub fn check_memory_map(fact: &Fact) -> Checked {
    let (size_m, per_m) = (fact.number("size_m")?, fact.number("cells_per_m")?);
    let lattice = Lattice::new(1.0 / per_m);
    let half = (size_m * per_m / 2.0) as i32;
    let index = |point: Point| {
        let cell = lattice.cell_at(point);
        json!([cell.y + half, cell.x + half])
    };
    let cell = || {
        let [row, column] = fact.numbers("index")?.map(|index: f64| index as i32 - half);
        Ok::<Cell, String>(Cell::new(column, row))
    };
    match () {
        () if fact.expects("in_bounds") => {
            let all = CellRect::new(Cell::new(-half, -half), Cell::new(half - 1, half - 1));
            fact.expect("in_bounds", json!(all.contains(cell()?)))
        }
        () if fact.has("index") => {
            let (centre, half_m) = (lattice.centre(cell()?), lattice.cell_m() / 2.0);
            fact.expect("north", json!(centre.y_m - half_m))?;
            fact.expect("east", json!(centre.x_m - half_m))
        }
        () if fact.has("angle_deg") => {
            let angle = Angle::from_degrees(fact.number("angle_deg")?);
            let hit = Point::default() + Vector::polar(angle, fact.number("distance")?);
            fact.expect("cell", index(hit))?;
            fact.expect("count", json!(1))
        }
        () => fact.expect(
            "index",
            index(Point::new(fact.number("east")?, fact.number("north")?)),
        ),
    }
}
