//! A route of straight pieces, measured along its length.

use super::{Point, Segment};

/// A polyline with at least one point.
#[derive(Clone, PartialEq, Debug)]
pub struct Track {
    points: Vec<Point>,
}

impl Track {
    /// Makes a track through the given points; `None` without any.
    pub fn new(points: Vec<Point>) -> Option<Track> {
        (!points.is_empty()).then_some(Track { points })
    }

    /// Makes the straight track between two places.
    pub fn straight(from: Point, to: Point) -> Track {
        Track {
            points: vec![from, to],
        }
    }

    /// Returns the straight pieces, in order; none for a single point.
    pub fn segments(&self) -> impl Iterator<Item = Segment> + '_ {
        self.points
            .windows(2)
            .map(|pair| Segment::new(pair[0], pair[1]))
    }

    /// Returns the length, metres.
    pub fn length_m(&self) -> f64 {
        self.segments().map(Segment::length_m).sum()
    }

    /// Returns the first point.
    pub fn start(&self) -> Point {
        self.points[0]
    }

    /// Returns the last point.
    pub fn end(&self) -> Point {
        self.points[self.points.len() - 1]
    }

    /// Returns places along the track, at most so many metres apart, its points among them.
    pub fn places(&self, apart_m: f64) -> impl Iterator<Item = Point> + '_ {
        let along = move |piece: Segment| {
            let steps = (piece.length_m() / apart_m).ceil().max(1.0) as u32;
            (0..steps).map(move |step| {
                piece
                    .from
                    .toward(piece.to, f64::from(step) / f64::from(steps))
            })
        };
        self.segments().flat_map(along).chain([self.end()])
    }

    /// Returns the distance from a point to the nearest part of the track, metres.
    pub fn distance_to_point(&self, point: Point) -> f64 {
        let start = self.start().distance_to(point);
        self.segments()
            .map(|segment| segment.distance_to_point(point))
            .fold(start, f64::min)
    }

    /// Returns the smallest distance between two tracks, metres.
    pub fn distance_to(&self, other: &Track) -> f64 {
        let ends = self
            .distance_to_point(other.start())
            .min(other.distance_to_point(self.start()));
        self.segments()
            .flat_map(|a| other.segments().map(move |b| a.distance_to(b)))
            .fold(ends, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_along_a_track_are_its_points_and_between_them() {
        let points = [(0.0, 0.0), (0.25, 0.0), (0.25, 0.1)].map(|(x, y)| Point::new(x, y));
        let places = |points: &[Point]| {
            let track = Track::new(points.to_vec()).unwrap();
            track.places(0.1).collect::<Vec<_>>()
        };
        let all = places(&points);
        assert_eq!(all.len(), 5, "{all:?}");
        assert!(points.iter().all(|point| all.contains(point)));
        let apart = |pair: &[Point]| pair[0].distance_to(pair[1]) <= 0.1 + 1e-12;
        assert!(all.windows(2).all(apart));
        assert_eq!(places(&points[..1]), [points[0]]);
    }

    #[test]
    fn tracks_know_their_length_and_distance() {
        let points = [(0.0, 0.0), (3.0, 0.0), (3.0, 4.0)];
        let track = Track::new(points.iter().map(|(x, y)| Point::new(*x, *y)).collect()).unwrap();
        let dot = Track::new(vec![Point::new(5.0, 2.0)]).unwrap();
        assert_eq!(track.length_m(), 7.0);
        assert_eq!(track.distance_to(&dot), 2.0);
        assert_eq!(dot.distance_to(&track), 2.0);
        assert!(Track::new(vec![]).is_none());
    }
}
