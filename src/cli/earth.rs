//! Where pictures and tracks lie on the earth: world files, and places of a receiver. Gives text, and writes no files; GeoJSON,
//! samples, links, images and pictures have their own writers.

use crate::geom::{Point, TangentPlane};
#[cfg(feature = "net")]
use crate::ground::MeasuredSample;

/// Points of a track that lie nearer than this to the one before are left out, metres.
#[cfg(feature = "net")]
const TRACK_STEP_M: f64 = 0.05;

/// Where a picture's pixels lie on the earth, as a world file says it (degrees, WGS84): `corner` is the local place of the
/// upper left corner of the picture, rows run against y.
pub(super) fn world_file(plane: &TangentPlane, corner: Point, metres_per_px: f64) -> String {
    // A world file is linear, degrees of longitude are not: 2 mm are lost over 100 m, 0.2 m over 1 km.
    const SPAN_PX: f64 = 500.0;
    let place = |x_px: f64, y_px: f64| {
        let local_m = [
            corner.x_m + x_px * metres_per_px,
            corner.y_m - y_px * metres_per_px,
            0.0,
        ];
        let at = plane.to_earth(local_m);
        (at.longitude_deg, at.latitude_deg)
    };
    let (first, right, down) = (
        place(0.5, 0.5),
        place(0.5 + SPAN_PX, 0.5),
        place(0.5, 0.5 + SPAN_PX),
    );
    let step = |to: (f64, f64)| ((to.0 - first.0) / SPAN_PX, (to.1 - first.1) / SPAN_PX);
    let ((a, d), (b, e)) = (step(right), step(down));
    format!(
        "{a:.15}\n{d:.15}\n{b:.15}\n{e:.15}\n{:.12}\n{:.12}\n",
        first.0, first.1
    )
}

/// Adds where the receiver was to its track, unless it has hardly moved.
#[cfg(feature = "net")]
pub(super) fn extend_track(track: &mut Vec<Point>, stored: &MeasuredSample) {
    let at = Point::from(stored.sample.receiver_pose.at);
    if at.is_finite()
        && track
            .last()
            .is_none_or(|last| last.distance_to(at) >= TRACK_STEP_M)
    {
        track.push(at);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Bearing;

    #[test]
    fn a_world_file_puts_pixels_where_they_lie() {
        let datum = crate::geom::Geodetic {
            latitude_deg: 52.0,
            longitude_deg: 5.0,
            altitude_m: 0.0,
        };
        // x points north, so y points west.
        let plane = TangentPlane::new(datum, Bearing::from_degrees(0.0));
        let text = world_file(&plane, Point::new(-10.0, 20.0), 0.05);
        let numbers: Vec<f64> = text.lines().map(|line| line.parse().unwrap()).collect();
        let [a, d, b, e, c, f] = numbers[..] else {
            panic!("{text}")
        };
        // The pixel in column 700 and row 300 has its middle at x = 25.025, y = 4.975.
        let at = plane.to_earth([25.025, 4.975, 0.0]);
        // 5e-9 degrees are half a millimetre.
        assert!((a * 700.0 + b * 300.0 + c - at.longitude_deg).abs() < 5e-9);
        assert!((d * 700.0 + e * 300.0 + f - at.latitude_deg).abs() < 5e-9);
        assert!(
            d > 0.0 && b > 0.0,
            "rightwards is north, downwards is east: {text}"
        );
    }
}
