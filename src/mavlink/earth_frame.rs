//! The local frame on the earth: what MAVLink says in latitudes and compass bearings, in the venue's metres and angles.

use crate::geom::{Angle, Bearing, Geodetic, Point, TangentPlane};

/// Degrees as they are sent.
const PER_DEGREE: f64 = 1e7;

/// Where the local frame lies on the earth.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct EarthFrame {
    /// The origin; its altitude is that of the ground, metres.
    pub datum: Geodetic,
    /// Where the x axis points.
    pub x_axis: Bearing,
    plane: TangentPlane,
}

impl EarthFrame {
    /// Lays a frame.
    pub fn new(datum: Geodetic, x_axis: Bearing) -> EarthFrame {
        EarthFrame {
            datum,
            x_axis,
            plane: TangentPlane::new(datum, x_axis),
        }
    }

    /// Returns the direction of a bearing.
    pub fn heading_of(&self, bearing: Bearing) -> Angle {
        Angle::from_radians(self.x_axis.radians() - bearing.radians())
    }

    /// Returns the bearing of a direction.
    pub fn bearing_of(&self, heading: Angle) -> Bearing {
        Bearing::from_radians(self.x_axis.radians() - heading.radians())
    }

    /// Returns how far north and how far east of the datum a place (or a velocity) is, metres.
    pub fn north_east(&self, at: Point) -> (f64, f64) {
        let (sin, cos) = (
            libm::sin(self.x_axis.radians()),
            libm::cos(self.x_axis.radians()),
        );
        (at.x_m * cos + at.y_m * sin, at.x_m * sin - at.y_m * cos)
    }

    /// Returns the place that is so far north and east of the datum, metres.
    pub fn from_north_east(&self, north_m: f64, east_m: f64) -> Point {
        let (sin, cos) = (
            libm::sin(self.x_axis.radians()),
            libm::cos(self.x_axis.radians()),
        );
        Point::new(north_m * cos + east_m * sin, north_m * sin - east_m * cos)
    }

    /// Returns latitude and longitude of a place, 1e-7 degrees.
    pub fn wire_place(&self, at: Point) -> (i32, i32) {
        let place = self.plane.to_earth([at.x_m, at.y_m, 0.0]);
        let whole = |degrees: f64| (degrees * PER_DEGREE).round() as i32;
        (whole(place.latitude_deg), whole(place.longitude_deg))
    }

    /// Returns the place of a latitude and a longitude, 1e-7 degrees.
    pub fn local_place(&self, (latitude, longitude): (i32, i32)) -> Point {
        let place = Geodetic {
            latitude_deg: f64::from(latitude) / PER_DEGREE,
            longitude_deg: f64::from(longitude) / PER_DEGREE,
            altitude_m: self.datum.altitude_m,
        };
        let [x_m, y_m, _] = self.plane.to_local_m(place);
        Point::new(x_m, y_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(x_axis_deg: f64) -> EarthFrame {
        let datum = Geodetic {
            latitude_deg: 52.0,
            longitude_deg: 4.0,
            altitude_m: 10.0,
        };
        EarthFrame::new(datum, Bearing::from_degrees(x_axis_deg))
    }

    #[test]
    fn places_and_directions_come_back() {
        for x_axis_deg in [0.0, 75.0, 90.0, 200.0] {
            let (frame, at) = (frame(x_axis_deg), Point::new(12.0, -7.5));
            assert!(frame.local_place(frame.wire_place(at)).distance_to(at) < 0.012);
            let (north_m, east_m) = frame.north_east(at);
            assert!(frame.from_north_east(north_m, east_m).distance_to(at) < 1e-9);
            let heading = Angle::from_degrees(33.0);
            assert!(
                frame
                    .heading_of(frame.bearing_of(heading))
                    .is_near(heading, 1e-9)
            );
        }
    }

    #[test]
    fn north_is_where_latitudes_grow() {
        let frame = frame(60.0);
        let north = frame.from_north_east(100.0, 0.0);
        let ((latitude, longitude), (from, at)) = (
            frame.wire_place(north),
            frame.wire_place(Point::new(0.0, 0.0)),
        );
        assert!((f64::from(latitude - from) / 1e7 * 111_250.0 - 100.0).abs() < 0.2);
        assert!((longitude - at).abs() < 20);
        assert!(
            (frame.heading_of(Bearing::from_degrees(60.0)).radians()).abs() < 1e-12,
            "the x axis"
        );
    }
}
