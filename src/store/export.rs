//! Stored data as text for other programs: samples as CSV, and what lies where on the earth as GeoJSON. Gives text, and
//! writes no files; links, images and pictures have their own writers.

use std::fmt::Write as _;

use serde_json::{Value, json};
use tomoswarm_proto::PoseReport;

use super::ground::{StoredImage, StoredSample};
use crate::config::Venue;
use crate::geom::{Point, TangentPlane};

/// The header of a file of samples.
pub const SAMPLES_HEADER: &str = "vehicle,boot,run,sequence,heard_at_s,utc,utc_error_s,transmitter,\
    tx_x_m,tx_y_m,tx_z_m,tx_heading_rad,tx_sd_m,rx_x_m,rx_y_m,rx_z_m,rx_heading_rad,rx_sd_m,\
    channel,power_dbm,rssi_dbm";

/// Points of a track that lie nearer than this to the one before are left out, metres.
const TRACK_STEP_M: f64 = 0.05;

/// Appends a sample as a line of CSV; what is not known is empty.
pub fn sample_line(text: &mut String, stored: &StoredSample) {
    let StoredSample {
        vehicle,
        boot,
        run,
        sample,
        utc_s,
    } = stored;
    let (utc, error) = utc_s.map_or_else(Default::default, |(utc_s, error_s)| {
        (utc_text(utc_s), format!("{error_s:.3}"))
    });
    let heard_at_s = sample.heard_at_ns as f64 / 1e9;
    let pose = |pose: &PoseReport| {
        let PoseReport { at, heading, sd } = pose;
        let sd_m = sd
            .metres()
            .map(|sd_m| format!("{sd_m:.4}"))
            .unwrap_or_default();
        let heading_rad = heading.radians();
        format!(
            "{:.4},{:.4},{:.4},{heading_rad:.5},{sd_m}",
            at.x_m(),
            at.y_m(),
            at.z_m()
        )
    };
    let (tx, rx) = (pose(&sample.transmitter_pose), pose(&sample.receiver_pose));
    let rssi = sample
        .rssi_dbm
        .map(|rssi_dbm| rssi_dbm.to_string())
        .unwrap_or_default();
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "{vehicle},{boot},{run},{},{heard_at_s:.6},{utc},{error},{},{tx},{rx},{},{},{rssi}",
        sample.sequence, sample.transmitter, sample.channel, sample.power_dbm
    );
}

/// Returns a moment in UTC as ISO 8601 with milliseconds ("2026-11-20T09:05:00.250Z"); empty for what is no time.
pub fn utc_text(utc_s: f64) -> String {
    let millis = (utc_s * 1e3).round();
    if !(0.0..253_402_300_800_000.0).contains(&millis) {
        return String::new();
    }
    let millis = millis as u64;
    let (days, of_day) = (millis / 86_400_000, millis % 86_400_000);
    let (year, month, day) = civil(days);
    let (hour, minute) = (of_day / 3_600_000, of_day / 60_000 % 60);
    let (second, milli) = (of_day / 1000 % 60, of_day % 1000);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{milli:03}Z")
}

/// Returns the date of a day counted from 1970-01-01 (Hinnant, "chrono-compatible low-level date algorithms").
fn civil(days: u64) -> (u64, u64, u64) {
    let shifted = days + 719_468;
    let (era, of_era) = (shifted / 146_097, shifted % 146_097);
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    (year + era * 400 + u64::from(month <= 2), month, day)
}

/// Where a picture's pixels lie on the earth, as a world file says it (degrees, WGS84): `corner` is the local place of the
/// upper left corner of the picture, rows run against y.
pub fn world_file(plane: &TangentPlane, corner: Point, metres_per_px: f64) -> String {
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
pub struct Features {
    plane: TangentPlane,
    list: Vec<Value>,
}

impl Features {
    /// Begins with what the venue says: area, fence, homes.
    pub fn of_venue(venue: &Venue) -> Features {
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

    /// Adds the peaks of a picture.
    pub fn peaks(&mut self, run: u32, made: &StoredImage) {
        for (index, peak) in made.peaks.iter().enumerate() {
            let says = json!({
                "what": "peak", "run": run, "kind": made.kind, "laps": made.laps, "rank": index + 1,
                "strength_db_per_m": peak.strength, "significance": peak.significance,
            });
            self.add(Shape::Point(peak.at), says);
        }
    }

    /// Adds who was found in a picture.
    pub fn finds(&mut self, run: u32, made: &StoredImage) {
        let found = made.finds.as_ref().map_or(&[][..], |finds| &finds.found);
        for (index, find) in found.iter().enumerate() {
            let [xx, xy, yy] = find.covariance_m2;
            let says = json!({
                "what": "find", "run": run, "kind": made.kind, "laps": made.laps, "rank": index + 1,
                "strength_db_per_m": find.strength, "evidence": find.evidence,
                "probability": find.probability, "covariance_m2": [[xx, xy], [xy, yy]],
            });
            self.add(Shape::Point(find.at), says);
        }
    }

    /// Adds where a vehicle drove.
    pub fn track(&mut self, says: Value, points: &[Point]) {
        if points.len() > 1 {
            self.add(Shape::Line(points.to_vec()), says);
        }
    }

    /// Returns the file.
    pub fn text(self) -> String {
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
            Shape::Line(points) => json!({"type": "LineString", "coordinates": places(points)}),
            Shape::Ring(points) => json!({"type": "Polygon", "coordinates": [places(points)]}),
        };
        self.list
            .push(json!({"type": "Feature", "geometry": geometry, "properties": says}));
    }
}

/// A shape in the local frame.
enum Shape {
    Point(Point),
    Line(Vec<Point>),
    /// The first corner is also the last.
    Ring(Vec<Point>),
}

fn polygon(corners: &[Point]) -> Shape {
    Shape::Ring(corners.iter().chain(corners.first()).copied().collect())
}

/// Adds where the receiver was to its track, unless it has hardly moved.
pub fn extend_track(track: &mut Vec<Point>, stored: &StoredSample) {
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
    fn moments_are_written_as_iso_8601() {
        assert_eq!(utc_text(0.0), "1970-01-01T00:00:00.000Z");
        assert_eq!(utc_text(951_782_399.25), "2000-02-28T23:59:59.250Z");
        assert_eq!(utc_text(951_782_400.0), "2000-02-29T00:00:00.000Z");
        assert_eq!(utc_text(4_107_542_399.999_6), "2100-03-01T00:00:00.000Z");
        assert_eq!(utc_text(1_700_000_000.0), "2023-11-14T22:13:20.000Z");
        assert_eq!(
            (utc_text(-1.0), utc_text(f64::NAN)),
            (String::new(), String::new())
        );
    }

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
