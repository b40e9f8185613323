//! Facts about what a vehicle carries and keeps: range sensors, servos, the cells of its map.

use serde_json::{Value, json};
use tomoswarm::geom::{
    Angle, Attitude, Bearing, Cell, Cylinder, Lattice, Point, Prism, Ray, Rect, Vector,
};
use tomoswarm::map::CellRect;
use tomoswarm::node::echo::{SPEED_OF_SOUND_MPS, echo_distance_m};
use tomoswarm::node::servo::ServoRange;

use super::fact::{Checked, Fact, place};

/// Beyond this nothing is met, metres.
const FARTHEST_M: f64 = 2000.0;

/// Checks a fact about a range sensor.
pub fn check_distance_sensor(fact: &Fact) -> Checked {
    match () {
        () if fact.has("mount_deg") => {
            let yaw = Bearing::from_degrees(fact.number("yaw_bearing_deg")?).angle();
            let mount = Angle::from_degrees(fact.number("mount_deg")?);
            let [x, y, _] = Attitude::level(yaw).beam(mount, Angle::default());
            fact.expect(
                "angle_deg",
                json!(Vector::new(x, y).angle().positive_degrees()),
            )
        }
        () if fact.has("echo_ms") => {
            let distance_m = echo_distance_m(fact.number("echo_ms")? * 1e-3, SPEED_OF_SOUND_MPS);
            fact.expect("distance_m", json!(distance_m))
        }
        () if fact.has("pos_ne") => range_in_a_world(fact),
        () => {
            let pitch = -Angle::from_degrees(fact.number("pitch_deg")?);
            fact.expect("pitch_angle_deg", json!(pitch.positive_degrees()))
        }
    }
}

/// Blocks and a pole on the ground, seen by a beam ahead.
fn range_in_a_world(fact: &Fact) -> Checked {
    let at = fact.place("pos_ne")?;
    let pitch_deg = if fact.has("pitch_deg") {
        fact.number("pitch_deg")?
    } else {
        0.0
    };
    let yaw = Bearing::from_degrees(fact.number("bearing_deg")?).angle();
    let attitude = Attitude {
        pitch: Angle::from_degrees(pitch_deg),
        ..Attitude::level(yaw)
    };
    let direction = attitude.beam(Angle::default(), Angle::default());
    let ray = Ray::new([at.x_m, at.y_m, fact.number("alt")?], direction)
        .ok_or("the beam has no direction")?;
    let (side, height) = (fact.number("block_side")?, fact.number("height")?);
    let half = Vector::new(side / 2.0, side / 2.0);
    let block = |centre: Point| {
        let outline = Rect::new(centre - half, centre + half).polygon();
        Prism {
            outline,
            heights_m: [0.0, height],
        }
        .met_after_m(ray)
    };
    let blocks = fact
        .table("blocks")?
        .into_iter()
        .filter_map(|centre| block(place(centre)));
    let [north, east, radius_m] = fact.numbers("pole")?;
    let pole = Cylinder {
        centre: place([north, east]),
        radius_m,
        heights_m: [0.0, height],
    };
    let met = blocks
        .chain(pole.met_after_m(ray))
        .min_by(f64::total_cmp)
        .filter(|met| *met <= FARTHEST_M);
    fact.expect(
        "distance",
        met.map_or(Value::Null, |distance| json!(distance)),
    )
}

/// Checks a fact about a servo.
pub fn check_servo(fact: &Fact) -> Checked {
    let pulses = if fact.has("servo_pwm") {
        fact.numbers("servo_pwm")?
    } else {
        [1000.0, 2000.0]
    };
    let servo = ServoRange::new(fact.numbers("servo_values")?, pulses)
        .map_err(|error| error.to_string())?;
    let shown = |error: tomoswarm::node::servo::ServoError| error.to_string();
    match () {
        () if fact.has("initial") => {
            fact.flag("initial")?;
            fact.expect("value", json!(servo.rest_deg()))?;
            fact.expect(
                "pwm",
                json!(servo.pulse_us(servo.rest_deg()).map_err(shown)?),
            )
        }
        () if fact.has("requested_bearing_deg") => {
            let yaw = Bearing::from_degrees(fact.number("vehicle_yaw_deg")?);
            let wanted = Bearing::from_degrees(fact.number("requested_bearing_deg")?);
            let angle_deg = servo
                .toward_bearing_deg(yaw, wanted)
                .ok_or("out of reach")?;
            fact.expect("pwm", json!(servo.pulse_us(angle_deg).map_err(shown)?))
        }
        () if fact.has("pwm") => fact.expect(
            "value",
            json!(servo.angle_deg(fact.number("pwm")?).map_err(shown)?),
        ),
        () if fact.expects("allowed") => {
            fact.expect("allowed", json!(servo.owns(fact.number("value")?)))
        }
        () => fact.expect(
            "pwm",
            json!(servo.pulse_us(fact.number("value")?).map_err(shown)?),
        ),
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
            let corner = lattice.corner(cell()?);
            fact.expect("north", json!(corner.y_m))?;
            fact.expect("east", json!(corner.x_m))
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
