//! What lies where on the earth, as world files and GeoJSON. Gives text, and writes no files; samples, links, images and
//! pictures have their own writers.

use serde_json::{Value, json};

use crate::config::Venue;
use crate::geom::{Point, TangentPlane};
#[cfg(feature = "net")]
use crate::ground::MeasuredSample;
use crate::tomo::{Find, Finds, Peak};

/// An image whose peaks and finds are shown.
#[derive(Clone, Copy, Debug)]
pub(super) struct MadeImage<'a> {
    /// What it shows, and of which run after how many laps, as far as that is known.
    pub(super) says: &'a Value,
    /// Its strong places, strongest first.
    pub(super) peaks: &'a [Peak],
    /// Who was found in it.
    pub(super) finds: Option<&'a Finds>,
}

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

/// What a GeoJSON file is made of, one thing after another (RFC 7946: WGS84, longitude before latitude).
#[derive(Debug)]
pub(super) struct Features {
    plane: TangentPlane,
    list: Vec<Value>,
}

impl Features {
    /// Begins with what the venue says: area, fence, homes.
    pub(super) fn of_venue(venue: &Venue) -> Features {
        let mut features = Features {
            plane: venue.plane(),
            list: Vec::new(),
        };
        let name = &venue.name;
        features.add(
            polygon(&venue.area.corners()),
            json!({"what": "area", "venue": name}),
        );
        features.add(
            polygon(venue.fence.corners()),
            json!({"what": "fence", "venue": name}),
        );
        for (index, home) in venue.homes.iter().enumerate() {
            features.add(
                Shape::Point(*home),
                json!({"what": "home", "vehicle": index + 1}),
            );
        }
        features
    }

    /// Adds the peaks and the finds of an image.
    pub(super) fn image(&mut self, made: MadeImage<'_>) {
        for (index, peak) in made.peaks.iter().enumerate() {
            let says = json!({
                "what": "peak", "rank": index + 1, "strength_db_per_m": peak.strength,
                "significance": peak.significance.min(1e9),
            });
            self.add(Shape::Point(peak.at), joined(made.says, says));
        }
        let found = made.finds.map_or(&[][..], |finds| &finds.found);
        for (index, find) in found.iter().enumerate() {
            let Find {
                at,
                strength,
                covariance_m2: [xx, xy, yy],
                evidence,
                probability,
                ..
            } = find;
            let says = json!({
                "what": "find", "rank": index + 1, "strength_db_per_m": strength, "evidence": evidence,
                "probability": probability, "covariance_m2": [[xx, xy], [xy, yy]],
            });
            self.add(Shape::Point(*at), joined(made.says, says));
        }
    }

    /// Adds where somebody truly stood.
    #[cfg(feature = "net")]
    pub(super) fn mark(&mut self, says: Value, at: Point) {
        self.add(Shape::Point(at), says);
    }

    /// Adds where a vehicle drove.
    #[cfg(feature = "net")]
    pub(super) fn track(&mut self, says: Value, points: &[Point]) {
        if points.len() > 1 {
            self.add(Shape::Line(points.to_vec()), says);
        }
    }

    /// Returns the file.
    pub(super) fn text(self) -> String {
        format!(
            "{}\n",
            json!({"type": "FeatureCollection", "features": self.list})
        )
    }

    fn add(&mut self, shape: Shape, says: Value) {
        let place = |point: &Point| {
            let at = self.plane.to_earth([point.x_m, point.y_m, 0.0]);
            let rounded = |degrees: f64| (degrees * 1e9).round() / 1e9;
            json!([rounded(at.longitude_deg), rounded(at.latitude_deg)])
        };
        let places = |points: &[Point]| points.iter().map(place).collect::<Vec<_>>();
        let geometry = match &shape {
            Shape::Point(point) => json!({"type": "Point", "coordinates": place(point)}),
            #[cfg(feature = "net")]
            Shape::Line(points) => json!({"type": "LineString", "coordinates": places(points)}),
            Shape::Ring(points) => json!({"type": "Polygon", "coordinates": [places(points)]}),
        };
        self.list
            .push(json!({"type": "Feature", "geometry": geometry, "properties": says}));
    }
}

/// Returns the keys of two objects as one.
fn joined(one: &Value, other: Value) -> Value {
    let objects = [one.clone(), other].into_iter();
    let keys = objects.filter_map(|object| object.as_object().cloned());
    Value::Object(keys.flatten().collect())
}

/// A shape in the local frame.
enum Shape {
    Point(Point),
    #[cfg(feature = "net")]
    Line(Vec<Point>),
    /// The first corner is also the last.
    Ring(Vec<Point>),
}

fn polygon(corners: &[Point]) -> Shape {
    Shape::Ring(corners.iter().chain(corners.first()).copied().collect())
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
