//! The venue's local frame on the earth: east-north-up tangent plane at a datum, by way of earth-centred coordinates.
//!
//! For configuration, autopilots and exports only; inside, everything is in the local frame. Good for the size of a
//! venue: heights are above the ellipsoid, and no geoid, projection or plate motion is known here.
//! Formulas: Hofmann-Wellenhof, Lichtenegger, Wasle, "GNSS" (2008), section 8.2; the inverse by Bowring (1985).

use super::Bearing;

/// Equatorial radius of the WGS84 ellipsoid, metres.
const A_M: f64 = 6_378_137.0;
/// Flattening of the WGS84 ellipsoid.
const F: f64 = 1.0 / 298.257_223_563;
/// Square of the first eccentricity.
const E2: f64 = F * (2.0 - F);
/// Polar radius, metres.
const B_M: f64 = A_M * (1.0 - F);

/// A place on the earth.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Geodetic {
    /// Degrees north.
    pub latitude_deg: f64,
    /// Degrees east, in [-180, 180].
    pub longitude_deg: f64,
    /// Metres above the ellipsoid.
    pub altitude_m: f64,
}

impl Geodetic {
    /// Returns earth-centred, earth-fixed coordinates, metres.
    pub fn ecef_m(self) -> [f64; 3] {
        let (latitude, longitude) = (
            self.latitude_deg.to_radians(),
            self.longitude_deg.to_radians(),
        );
        let sin = libm::sin(latitude);
        let normal_m = A_M / (1.0 - E2 * sin * sin).sqrt();
        let from_axis_m = (normal_m + self.altitude_m) * libm::cos(latitude);
        [
            from_axis_m * libm::cos(longitude),
            from_axis_m * libm::sin(longitude),
            (normal_m * (1.0 - E2) + self.altitude_m) * sin,
        ]
    }

    /// Returns the place of earth-centred, earth-fixed coordinates, metres; exact to a micrometre near the ground. Not
    /// for places within kilometres of the earth's middle.
    pub fn from_ecef_m([x_m, y_m, z_m]: [f64; 3]) -> Geodetic {
        let from_axis_m = libm::hypot(x_m, y_m);
        let second_e2 = (A_M * A_M - B_M * B_M) / (B_M * B_M);
        let mut reduced = libm::atan2(z_m * A_M, from_axis_m * B_M);
        let mut latitude = 0.0;
        // The first step is good to 1e-9 degrees near the ground, the second below what a double holds.
        for _ in 0..2 {
            let (sin, cos) = (libm::sin(reduced), libm::cos(reduced));
            let north = z_m + second_e2 * B_M * sin * sin * sin;
            latitude = libm::atan2(north, from_axis_m - E2 * A_M * cos * cos * cos);
            reduced = libm::atan2(B_M * libm::sin(latitude), A_M * libm::cos(latitude));
        }
        let (sin, cos) = (libm::sin(latitude), libm::cos(latitude));
        // Well-conditioned at the poles too.
        let altitude_m = from_axis_m * cos + z_m * sin - A_M * (1.0 - E2 * sin * sin).sqrt();
        Geodetic {
            latitude_deg: latitude.to_degrees(),
            longitude_deg: libm::atan2(y_m, x_m).to_degrees(),
            altitude_m,
        }
    }
}

/// Where a local frame (x, y along the venue's axes, z up, metres) lies on the earth.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TangentPlane {
    origin_m: [f64; 3],
    /// Unit vectors of the local x, y and z axes, earth-centred.
    axes: [[f64; 3]; 3],
}

impl TangentPlane {
    /// Lays a frame with its origin at the datum and its x axis along a compass bearing (90 degrees = east).
    pub fn new(datum: Geodetic, x_axis: Bearing) -> TangentPlane {
        let (latitude, longitude) = (
            datum.latitude_deg.to_radians(),
            datum.longitude_deg.to_radians(),
        );
        let (sin_lat, cos_lat) = (libm::sin(latitude), libm::cos(latitude));
        let (sin_lon, cos_lon) = (libm::sin(longitude), libm::cos(longitude));
        let east = [-sin_lon, cos_lon, 0.0];
        let north = [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat];
        let up = [cos_lat * cos_lon, cos_lat * sin_lon, sin_lat];
        let (sin, cos) = (libm::sin(x_axis.radians()), libm::cos(x_axis.radians()));
        let mixed = |to_east: f64, to_north: f64| {
            [0, 1, 2].map(|axis: usize| to_east * east[axis] + to_north * north[axis])
        };
        TangentPlane {
            origin_m: datum.ecef_m(),
            axes: [mixed(sin, cos), mixed(-cos, sin), up],
        }
    }

    /// Returns the place on the earth of a local point, metres.
    pub fn to_earth(&self, local_m: [f64; 3]) -> Geodetic {
        let along = |axis: usize| {
            (0..3)
                .map(|of| local_m[of] * self.axes[of][axis])
                .sum::<f64>()
        };
        Geodetic::from_ecef_m([0, 1, 2].map(|axis| self.origin_m[axis] + along(axis)))
    }

    /// Returns the local point, metres, of a place on the earth.
    pub fn to_local_m(&self, place: Geodetic) -> [f64; 3] {
        let ecef_m = place.ecef_m();
        let along = |of: usize| {
            (0..3)
                .map(|axis| self.axes[of][axis] * (ecef_m[axis] - self.origin_m[axis]))
                .sum::<f64>()
        };
        [along(0), along(1), along(2)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn place(latitude_deg: f64, longitude_deg: f64, altitude_m: f64) -> Geodetic {
        Geodetic {
            latitude_deg,
            longitude_deg,
            altitude_m,
        }
    }

    fn check_ecef(at: Geodetic, expected_m: [f64; 3]) {
        let got_m = at.ecef_m();
        let is_near = got_m
            .iter()
            .zip(expected_m)
            .all(|(got, expected)| (got - expected).abs() < 1e-3);
        assert!(is_near, "{at:?} gave {got_m:?}");
        let back = Geodetic::from_ecef_m(expected_m);
        assert!(
            (back.latitude_deg - at.latitude_deg).abs() < 1e-6,
            "{back:?}"
        );
        assert!((back.altitude_m - at.altitude_m).abs() < 2e-3, "{back:?}");
    }

    #[test]
    fn earth_centred_coordinates_are_those_of_the_ellipsoid() {
        // On the equator and at the pole by the definition of the axes.
        check_ecef(place(0.0, 0.0, 0.0), [6_378_137.0, 0.0, 0.0]);
        check_ecef(place(0.0, 90.0, 100.0), [0.0, 6_378_237.0, 0.0]);
        check_ecef(place(90.0, 0.0, 0.0), [0.0, 0.0, 6_356_752.314_245]);
        // At 45 degrees N = a / sqrt(1 - e2 / 2) = 6 388 838.290 m, z = N (1 - e2) sin 45.
        check_ecef(place(45.0, 0.0, 0.0), [4_517_590.879, 0.0, 4_487_348.409]);
    }

    /// Lengths of a degree along the meridian and the parallel at a latitude, metres (series of the US National
    /// Geospatial-Intelligence Agency, good to centimetres).
    fn degree_m(latitude_deg: f64) -> (f64, f64) {
        let phi = latitude_deg.to_radians();
        let north = 111_132.92 - 559.82 * (2.0 * phi).cos() + 1.175 * (4.0 * phi).cos()
            - 0.0023 * (6.0 * phi).cos();
        let east = 111_412.84 * phi.cos() - 93.5 * (3.0 * phi).cos() + 0.118 * (5.0 * phi).cos();
        (north, east)
    }

    #[test]
    fn a_hundred_metres_are_as_many_degrees_as_the_series_say() {
        for latitude_deg in [0.0, -33.9, 52.3702, 71.0] {
            let plane = TangentPlane::new(
                place(latitude_deg, 4.8952, 20.0),
                Bearing::from_degrees(90.0),
            );
            let (north_m, east_m) = degree_m(latitude_deg);
            let at = plane.to_earth([100.0, 0.0, 0.0]);
            assert!(
                (at.longitude_deg - 4.8952 - 100.0 / east_m).abs() < 1e-8,
                "{at:?}"
            );
            assert!((at.latitude_deg - latitude_deg).abs() < 1e-7, "{at:?}");
            let at = plane.to_earth([0.0, 100.0, 0.0]);
            assert!(
                (at.latitude_deg - latitude_deg - 100.0 / north_m).abs() < 1e-8,
                "{at:?}"
            );
            assert!((at.longitude_deg - 4.8952).abs() < 1e-9, "{at:?}");
            // The earth falls away below the tangent by d² / 2R, 0.8 mm.
            assert!((at.altitude_m - 20.0 - 0.000_78).abs() < 5e-5, "{at:?}");
        }
    }

    #[test]
    fn the_x_axis_points_along_its_bearing() {
        let datum = place(52.0, 5.0, 0.0);
        let to_north = TangentPlane::new(datum, Bearing::from_degrees(0.0));
        let (at, y) = (
            to_north.to_earth([50.0, 0.0, 0.0]),
            to_north.to_earth([0.0, 50.0, 0.0]),
        );
        assert!(
            at.latitude_deg > 52.0004 && (at.longitude_deg - 5.0).abs() < 1e-9,
            "{at:?}"
        );
        // y is a quarter turn counter-clockwise from x: west.
        assert!(
            y.longitude_deg < 4.9993 && (y.latitude_deg - 52.0).abs() < 1e-7,
            "{y:?}"
        );
        let slanted =
            TangentPlane::new(datum, Bearing::from_degrees(135.0)).to_earth([50.0, 0.0, 0.0]);
        assert!(slanted.latitude_deg < 52.0 && slanted.longitude_deg > 5.0);
    }

    proptest! {
        #[test]
        fn distances_and_bearings_are_those_of_geographiclib(
            latitude in -88.0..88.0f64, longitude in -180.0..180.0f64, axis in 0.0..360.0f64,
            bearing in 0.0..360.0f64, distance_m in 0.1..2000.0f64,
        ) {
            use geographiclib_rs::{DirectGeodesic, Geodesic};
            let datum = place(latitude, longitude, 0.0);
            let plane = TangentPlane::new(datum, Bearing::from_degrees(axis));
            let (there, to): (f64, f64) = Geodesic::wgs84().direct(latitude, longitude, bearing, distance_m);
            let [x_m, y_m, z_m] = plane.to_local_m(place(there, to, 0.0));
            // A chord of the ellipse, seen from above: shorter by d³ / 6 R², which is 33 um at 2 km; below the
            // tangent by d² / 2 R.
            prop_assert!((x_m.hypot(y_m) - distance_m).abs() < 5e-5, "{} for {distance_m}", x_m.hypot(y_m));
            let along = (axis - bearing).to_radians();
            prop_assert!((x_m - distance_m * along.cos()).abs() < 1e-4 && (y_m - distance_m * along.sin()).abs() < 1e-4);
            let drop_m = distance_m * distance_m / 2.0 / 6.371e6;
            prop_assert!((z_m + drop_m).abs() < 0.01 * drop_m + 1e-6, "{z_m} for {drop_m}");
            let back = plane.to_earth([x_m, y_m, z_m]);
            prop_assert!((back.latitude_deg - there).abs() < 1e-9 && back.altitude_m.abs() < 1e-6, "{back:?}");
        }

        #[test]
        fn there_and_back_is_the_same_point(
            latitude in -89.0..89.0f64, longitude in -180.0..180.0f64, bearing in 0.0..360.0f64,
            x in -2000.0..2000.0f64, y in -2000.0..2000.0f64, z in -100.0..500.0f64,
        ) {
            let plane = TangentPlane::new(place(latitude, longitude, 30.0), Bearing::from_degrees(bearing));
            let back = plane.to_local_m(plane.to_earth([x, y, z]));
            for (got, expected) in back.iter().zip([x, y, z]) {
                prop_assert!((got - expected).abs() < 1e-5, "{back:?}");
            }
        }
    }
}
