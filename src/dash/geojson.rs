//! What lies where on the earth, as GeoJSON: what `tomoswarm export` and the operator's page write. Gives text, and writes no
//! files.

use serde_json::{Value, json};

use crate::config::Venue;
use crate::geom::{Point, TangentPlane};
use crate::tomo::{Find, Finds, Peak};

/// An image whose peaks and finds are shown.
#[derive(Clone, Copy, Debug)]
pub struct MadeImage<'a> {
    /// What it shows, and of which run after how many laps, as far as that is known.
    pub says: &'a Value,
    /// Its strong places, strongest first.
    pub peaks: &'a [Peak],
    /// Who was found in it.
    pub finds: Option<&'a Finds>,
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

    /// Adds the peaks and the finds of an image.
    pub fn image(&mut self, made: MadeImage<'_>) {
        for (index, peak) in made.peaks.iter().enumerate() {
            let says = json!({
                "what": "peak", "rank": index + 1, "strength_db_per_m": peak.strength,
                "significance": peak.significance,
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

    /// Adds a place, with what it is.
    pub fn place(&mut self, says: Value, at: Point) {
        self.add(Shape::Point(at), says);
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

/// Returns the keys of two objects as one.
fn joined(one: &Value, other: Value) -> Value {
    let objects = [one.clone(), other].into_iter();
    let keys = objects.filter_map(|object| object.as_object().cloned());
    Value::Object(keys.flatten().collect())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{self, Config};

    #[test]
    fn what_is_added_follows_the_venue_and_a_track_of_one_place_is_none() {
        let text = include_str!("../../configs/small.venue.toml");
        let read = config::read("venue.toml", text, &mut |path| Err(path.to_owned()));
        let Ok(Config::Venue(venue)) = read else {
            panic!("no venue")
        };
        let mut features = Features::of_venue(&venue);
        features.place(json!({"what": "mark", "run": 2}), Point::new(1.0, 2.0));
        features.track(json!({"what": "track"}), &[Point::new(0.0, 0.0)]);
        features.track(
            json!({"what": "track"}),
            &[Point::new(0.0, 0.0), Point::new(1.0, 0.0)],
        );
        let file: Value = serde_json::from_str(&features.text()).unwrap();
        let all = file["features"].as_array().unwrap();
        let of = |feature: &Value| {
            let [what, kind] = [&feature["properties"]["what"], &feature["geometry"]["type"]];
            (
                what.as_str().unwrap().to_owned(),
                kind.as_str().unwrap().to_owned(),
            )
        };
        let mut kinds: Vec<(String, String)> = all.iter().map(of).collect();
        let own = kinds.split_off(2 + venue.homes.len());
        let named = |what: &str, kind: &str| (what.to_owned(), kind.to_owned());
        assert_eq!(
            kinds[..2],
            [named("area", "Polygon"), named("fence", "Polygon")]
        );
        assert_eq!(own, [named("mark", "Point"), named("track", "LineString")]);
        let place = &all[all.len() - 2]["geometry"]["coordinates"];
        let expected = venue.plane().to_earth([1.0, 2.0, 0.0]);
        assert!(
            (place[0].as_f64().unwrap() - expected.longitude_deg).abs() < 1e-8,
            "{place}"
        );
        assert!(
            (place[1].as_f64().unwrap() - expected.latitude_deg).abs() < 1e-8,
            "{place}"
        );
    }
}
