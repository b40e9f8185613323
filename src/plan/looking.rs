//! Claims about looking and driving together: evidence from a swinging beam must release the way in time, and never
//! a wall. The rooms here know nothing of the map's sensor model.

use super::{Corridor, Release, RequiredClearance};
use crate::geom::{Angle, Lattice, Point, Segment, Vector};
use crate::map::{CellRect, Mapper, Merged, OwnDisc, ScanReading};
use tomoswarm_proto::{Boot, LayerId, VehicleId};

const OWN: LayerId = LayerId {
    vehicle: VehicleId(1),
    boot: Boot(1),
};
const BODY_M: f64 = 0.25;
const HALF_WIDTH_RAD: f64 = 0.2618;

/// The nearest wall that answers (up to 60° from its normal) in a cone, up to 3 m.
fn echo(walls: &[Segment], at: Point, direction: Angle) -> Option<f64> {
    let ray = |step: i32| {
        let turn = Angle::from_radians(f64::from(step) / 30.0 * HALF_WIDTH_RAD);
        let ray = Vector::polar(direction + turn, 1.0);
        let strikes = walls.iter().filter_map(|wall| {
            let (along, to) = (wall.vector(), wall.from - at);
            let cross = ray.cross(along);
            let (range_m, share) = (to.cross(along) / cross, to.cross(ray) / cross);
            (range_m > 0.0 && (0.0..=1.0).contains(&share))
                .then_some((range_m, cross.abs() / along.length_m()))
        });
        let first = strikes.min_by(|a, b| a.0.total_cmp(&b.0));
        first.and_then(|(range_m, steepness)| {
            (steepness >= 0.5 && range_m <= 3.0).then_some(range_m)
        })
    };
    (-30..=30).filter_map(ray).min_by(f64::total_cmp)
}

/// Drives east along y = 0.05 as far as released, at most 0.4 m/s, looking 10 times a second; returns where the
/// vehicle is at the end, and the last release.
fn drive(walls: &[Segment], seconds: i32) -> (f64, Release) {
    let mut map = Merged::new(Lattice::new(0.2), Some(OWN));
    let mut mapper = Mapper::new(OWN, 0);
    let route = [Point::new(0.0, 0.05), Point::new(8.0, 0.05)];
    let corridor = Corridor {
        clearance: RequiredClearance::everywhere(0.45),
        ahead_m: 4.0,
    };
    let mut at = route[0];
    let mut release = corridor.released(
        &map.view(0, CellRect::covering(map.lattice(), route_rect())),
        &route,
        at,
    );
    for look in 0..seconds * 10 {
        let turn = f64::from((look % 20 - 10).abs()) * 15.0 - 75.0;
        let direction = Angle::from_degrees(turn);
        let scan = ScanReading {
            origin: at,
            direction,
            half_width_rad: HALF_WIDTH_RAD,
            range_m: echo(walls, at, direction),
            max_range_m: 3.0,
            sure_range_m: 1.5,
            min_range_m: 0.05,
            origin_sd_m: 0.0,
        };
        mapper.record(
            &mut map,
            &scan,
            OwnDisc {
                at,
                radius_m: BODY_M,
            },
            &[],
        );
        let view = map.view(0, CellRect::covering(map.lattice(), route_rect()));
        release = corridor.released(&view, &route, at);
        at.x_m += release.ahead_m().clamp(0.0, 0.04);
        let nearest_m = walls
            .iter()
            .map(|wall| wall.distance_to_point(at))
            .fold(f64::INFINITY, f64::min);
        assert!(
            nearest_m > BODY_M + 0.05,
            "{nearest_m} m from a wall at {at:?}"
        );
    }
    (at.x_m, release)
}

fn route_rect() -> crate::geom::Rect {
    crate::geom::Rect::new(Point::new(-1.0, -1.5), Point::new(9.0, 1.5))
}

fn wall(x0: f64, y0: f64, x1: f64, y1: f64) -> Segment {
    Segment::new(Point::new(x0, y0), Point::new(x1, y1))
}

#[test]
fn open_ground_is_driven_without_a_halt() {
    let (x_m, release) = drive(&[], 24);
    assert!(x_m > 7.9, "{x_m}, {release:?}");
}

#[test]
fn a_wall_beside_the_way_does_not_hold_the_vehicle() {
    for aside_m in [0.75, 0.85, 1.0, 1.2, 1.5] {
        let (x_m, release) = drive(&[wall(-3.0, 0.05 + aside_m, 12.0, 0.05 + aside_m)], 40);
        assert!(x_m > 7.9, "{aside_m} m aside: stuck at {x_m}, {release:?}");
    }
}

#[test]
fn a_corridor_of_two_walls_is_driven_through() {
    for aside_m in [0.85, 1.0, 1.3] {
        let walls = [-aside_m, aside_m].map(|y_m| wall(-3.0, 0.05 + y_m, 12.0, 0.05 + y_m));
        let (x_m, release) = drive(&walls, 60);
        assert!(x_m > 7.9, "{aside_m} m aside: stuck at {x_m}, {release:?}");
    }
}

#[test]
fn a_wall_across_the_way_stops_the_vehicle_before_it() {
    for slant_m in [-2.0, 0.0, 1.0] {
        let (x_m, release) = drive(&[wall(5.0 - slant_m, -3.0, 5.0 + slant_m, 3.0)], 60);
        assert!((3.0..4.7).contains(&x_m), "{x_m}, {release:?}");
        assert!(release.blocked.is_some());
    }
}
