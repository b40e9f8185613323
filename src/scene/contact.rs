//! Where a vehicle first touches something, exactly: an upright round post moved along a straight line.
//!
//! Time, speed and other vehicles are not known here.

use super::build::{BoundingBox, Object, Scene, Shape};
use super::mesh::Mesh;
use crate::geom::{Point, Rect, Segment};

/// The part of space, between two heights, that a vehicle fills.
#[derive(Clone, Copy)]
struct Band {
    low_m: f64,
    high_m: f64,
}

impl Scene {
    /// Returns the share of the way (0 to 1) at which an upright post first touches an object.
    ///
    /// The post has `radius_m` and reaches from `low_m` to `high_m` (z, metres); what only touches it from
    /// above or below, such as the ground it stands on, does not count. 0 when it touches at the start,
    /// `None` when the way is free. Exact for slow, long and null motions alike.
    pub fn first_contact(
        &self,
        along: Segment,
        radius_m: f64,
        low_m: f64,
        high_m: f64,
    ) -> Option<f64> {
        let band = Band { low_m, high_m };
        let swept = Rect::new(along.from, along.to).shrunk(-radius_m);
        let mut first: Option<f64> = None;
        for (object, bounds) in self
            .bounded()
            .filter(|(_, bounds)| bounds.meets(swept, band))
        {
            if object.holds(along.from, bounds, band) {
                return Some(0.0);
            }
            object.for_each_piece(band, &mut |piece: &[Point]| {
                let touched = piece_contact(piece, along, radius_m);
                first = match (first, touched) {
                    (Some(one), Some(other)) => Some(one.min(other)),
                    (one, other) => one.or(other),
                };
            });
        }
        first
    }

    /// Returns the distance from a place to the nearest object that reaches between two heights, metres; 0
    /// inside one, infinite when there is none.
    pub fn clearance_m(&self, at: Point, low_m: f64, high_m: f64) -> f64 {
        let band = Band { low_m, high_m };
        let mut nearest_m = f64::INFINITY;
        for (object, bounds) in self.bounded() {
            let reach = Rect::new(at, at).shrunk(-nearest_m);
            if !bounds.meets(reach, band) {
                continue;
            }
            if object.holds(at, bounds, band) {
                return 0.0;
            }
            object.for_each_piece(band, &mut |piece: &[Point]| {
                nearest_m = nearest_m.min(piece_distance_m(piece, at));
            });
        }
        nearest_m
    }
}

impl BoundingBox {
    fn meets(&self, plan: Rect, band: Band) -> bool {
        let apart = self.plan.min.x_m > plan.max.x_m
            || self.plan.max.x_m < plan.min.x_m
            || self.plan.min.y_m > plan.max.y_m
            || self.plan.max.y_m < plan.min.y_m;
        !apart && self.low_m < band.high_m && self.high_m > band.low_m
    }
}

impl Object {
    /// Returns whether a place lies inside a closed mesh at the middle of the heights that both share; the
    /// surface itself is looked at piece by piece.
    fn holds(&self, at: Point, bounds: &BoundingBox, band: Band) -> bool {
        match &self.shape {
            Shape::Prism { .. } => false,
            Shape::Mesh(mesh) => {
                let middle_m =
                    (bounds.low_m.max(band.low_m) + bounds.high_m.min(band.high_m)) / 2.0;
                self.closed && winding(mesh, at, middle_m) != 0
            }
        }
    }

    /// Hands on the object's convex pieces within a band, seen from above; a piece may be flat (two corners).
    fn for_each_piece(&self, band: Band, each: &mut dyn FnMut(&[Point])) {
        match &self.shape {
            Shape::Prism { footprint, .. } => each(footprint.corners()),
            Shape::Mesh(mesh) => {
                for triangle in mesh.corners() {
                    let low_m = triangle
                        .iter()
                        .fold(f64::INFINITY, |low, corner| low.min(corner[2]));
                    let high_m = triangle
                        .iter()
                        .fold(f64::NEG_INFINITY, |high, corner| high.max(corner[2]));
                    if low_m < band.high_m && high_m > band.low_m {
                        each(clipped(triangle, band).corners());
                    }
                }
            }
        }
    }
}

/// How often the cut of a closed mesh at a height runs around a point.
fn winding(mesh: &Mesh, at: Point, height_m: f64) -> i32 {
    mesh.segments_at(height_m)
        .fold(0, |sum, Segment { from, to }| {
            let upward = from.y_m <= at.y_m && at.y_m < to.y_m;
            let downward = to.y_m <= at.y_m && at.y_m < from.y_m;
            let left = (to - from).cross(at - from);
            sum + i32::from(upward && left > 0.0) - i32::from(downward && left < 0.0)
        })
}

/// A triangle's part between two heights, seen from above: at most five corners.
struct Clipped {
    corners: [Point; 5],
    count: usize,
}

impl Clipped {
    fn corners(&self) -> &[Point] {
        &self.corners[..self.count]
    }

    fn push(&mut self, corner: Point) {
        if let Some(place) = self.corners.get_mut(self.count) {
            *place = corner;
            self.count += 1;
        }
    }
}

/// Walks around the triangle; each side gives its part within the band.
fn clipped(triangle: [[f64; 3]; 3], band: Band) -> Clipped {
    let mut out = Clipped {
        corners: [Point::default(); 5],
        count: 0,
    };
    for corner in 0..3 {
        let (a, b) = (triangle[corner], triangle[(corner + 1) % 3]);
        let at =
            |share: f64| Point::new(a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]));
        let inside = |height_m: f64| (band.low_m..=band.high_m).contains(&height_m);
        if inside(a[2]) {
            out.push(at(0.0));
        }
        let rise = b[2] - a[2];
        // In the order in which the side meets the two heights; a level side meets none (its shares are no numbers, or
        // infinite, and fall away below).
        let mut shares = [(band.low_m - a[2]) / rise, (band.high_m - a[2]) / rise];
        shares.sort_by(f64::total_cmp);
        for share in shares
            .into_iter()
            .filter(|share| *share > 0.0 && *share < 1.0)
        {
            out.push(at(share));
        }
    }
    out
}

/// Returns the share of the way at which a disc first touches a convex piece.
fn piece_contact(piece: &[Point], along: Segment, radius_m: f64) -> Option<f64> {
    // Its edges alone would not tell of a disc that begins inside the piece.
    if piece_distance_m(piece, along.from) <= radius_m {
        return Some(0.0);
    }
    edges(piece)
        .filter_map(|edge| edge_contact(edge, along, radius_m))
        .min_by(f64::total_cmp)
}

/// Returns the distance from a point to a convex piece, metres; 0 inside.
fn piece_distance_m(piece: &[Point], at: Point) -> f64 {
    let sides_m2 = edges(piece).map(|edge| edge.vector().cross(at - edge.from));
    let (least_m2, most_m2) = sides_m2
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), side| {
            (side.min(least), side.max(most))
        });
    if !is_flat(piece) && (least_m2 >= 0.0 || most_m2 <= 0.0) {
        return 0.0;
    }
    distance_to_edges_m(piece, at)
}

/// Returns whether a piece is seen edge-on, so that it has no inside (1e-9 m² is below any wall of ours).
fn is_flat(piece: &[Point]) -> bool {
    let Some(first) = piece.first() else {
        return true;
    };
    let twice_m2: f64 = edges(piece)
        .map(|edge| (edge.from - *first).cross(edge.to - *first))
        .sum();
    twice_m2.abs() < 1e-9
}

fn distance_to_edges_m(piece: &[Point], at: Point) -> f64 {
    edges(piece)
        .map(|edge| edge.distance_to_point(at))
        .fold(f64::INFINITY, f64::min)
}

fn edges(piece: &[Point]) -> impl Iterator<Item = Segment> + '_ {
    let next = piece.iter().cycle().skip(1);
    piece
        .iter()
        .zip(next)
        .map(|(from, to)| Segment::new(*from, *to))
}

/// Returns the share at which a disc that starts clear of a segment first touches it: at one of its ends, or
/// where its middle crosses one of the two lines beside the segment.
fn edge_contact(edge: Segment, along: Segment, radius_m: f64) -> Option<f64> {
    let ends = [
        end_contact(edge.from, along, radius_m),
        end_contact(edge.to, along, radius_m),
    ];
    ends.into_iter()
        .flatten()
        .chain(side_contact(edge, along, radius_m))
        .min_by(f64::total_cmp)
}

/// Solves |from + t·way − end|² = r² for the smaller root.
fn end_contact(end: Point, along: Segment, radius_m: f64) -> Option<f64> {
    let (way, gap) = (along.vector(), along.from - end);
    let (a, b, c) = (
        way.dot(way),
        gap.dot(way),
        gap.dot(gap) - radius_m * radius_m,
    );
    let root = b * b - a * c;
    if b >= 0.0 || root < 0.0 {
        return None;
    }
    // b is negative here, so nothing is lost between two numbers that are nearly the same, as in (−b − √root) / a.
    let share = c / (root.sqrt() - b);
    (share <= 1.0).then_some(share.max(0.0))
}

fn side_contact(edge: Segment, along: Segment, radius_m: f64) -> Option<f64> {
    let (side, way) = (edge.vector(), along.vector());
    let length_m = side.length_m();
    if length_m == 0.0 {
        return None;
    }
    let height_m = side.cross(along.from - edge.from) / length_m;
    let rise_m = side.cross(way) / length_m;
    let share = (height_m.abs() - radius_m) / (rise_m * -height_m.signum());
    if !(0.0..=1.0).contains(&share) {
        return None;
    }
    let foot = side.dot(along.from + way * share - edge.from) / (length_m * length_m);
    (0.0..=1.0).contains(&foot).then_some(share)
}
