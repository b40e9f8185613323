//! The nearest visible surface in a flat sector, exactly: what a fan hears of straight and round pieces in its plane.
//!
//! The sensor is at the origin and looks along x. A direction is told by its slope y/x, and a place on it by 1/x: in these
//! coordinates straight pieces stay straight, and what is nearer has the larger 1/x. So a straight piece hides of another one
//! a whole interval of slopes, and what is left of a piece comes nearest at the foot of the perpendicular or else at an end.
//! A circle hides what its chord between the tangents hides, and what lies inside it; of two circles that overlap the chords
//! decide, which is the one thing here that is not exact.
//!
//! What is too small to be heard, or met too obliquely, does not answer and still hides. Knows no scene and no noise.

use super::Body;
use crate::geom::Vector;

/// Slopes nearer than this are one: no sound passes between two pieces that share a corner.
const SLIT: f64 = 1e-9;
/// What hides something is nearer by more than this share: a corner that two pieces share is hidden by neither.
const HAIR: f64 = 1e-9;

/// What comes nearer than this touches the sensor, metres; it has no direction.
const TOUCH_M: f64 = 1e-12;

/// Where the sensor listens, and what echoes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sector {
    /// Slope of the edges: tangent of half the opening.
    pub(super) slope: f64,
    /// Nothing farther away is heard, metres.
    pub(super) max_m: f64,
    /// Cosine of the largest angle between ray and normal that returns an echo.
    pub(super) facing: f64,
}

/// The form of a surface, in the sensor's plane.
#[derive(Clone, Copy, Debug)]
pub(super) enum Form {
    /// A straight piece between two ends.
    Straight(Vector, Vector),
    /// A circle: its middle and its radius, metres.
    Round(Vector, f64),
}

/// A surface, in the sensor's plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    /// Its form.
    pub(super) form: Form,
    /// Whether it echoes whatever the angle at which it is met.
    pub(super) always_faces: bool,
    /// The body that it belongs to.
    pub(super) body: Body,
}

/// A surface as far as it lies in the sector.
#[derive(Clone, Copy, Debug)]
struct Seen {
    surface: Surface,
    /// The slopes between which it lies.
    from: f64,
    to: f64,
    /// 1/x of its straight piece, or of its chord, at these slopes.
    near_from: f64,
    near_to: f64,
    /// Where it comes nearest to the sensor, and how near, metres.
    nearest_slope: f64,
    nearest_m: f64,
}

/// A point that is heard.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Heard {
    /// How near it is, metres.
    pub(super) distance_m: f64,
    /// In which direction.
    pub(super) slope: f64,
}

/// Returns the nearest point that is heard; inside a circle the sensor itself. `hears` is asked whether a body is heard at a
/// distance, when it comes nearest along that slope.
pub(super) fn nearest(
    sector: &Sector,
    surfaces: impl Iterator<Item = Surface>,
    hears: &dyn Fn(Body, f64, f64) -> bool,
) -> Option<Heard> {
    let mut seen: Vec<Seen> = Vec::new();
    for surface in surfaces {
        if let Form::Round(centre, radius_m) = surface.form
            && centre.length_m() <= radius_m
        {
            return Some(Heard {
                distance_m: 0.0,
                slope: 0.0,
            });
        }
        seen.extend(Seen::of(surface, sector));
    }
    seen.sort_by(|a, b| a.nearest_m.total_cmp(&b.nearest_m));
    let mut best: Option<Heard> = None;
    let mut nearest_of: Vec<(Body, f64)> = Vec::new();
    let mut open = Vec::new();
    for one in &seen {
        let limit_m = best.map_or(sector.max_m, |best| best.distance_m);
        if one.nearest_m > limit_m {
            break;
        }
        // They come sorted: the first surface of a body is where it comes nearest.
        let body = one.surface.body;
        let known = nearest_of.iter().find(|(known, _)| *known == body);
        let along = known.map_or(one.nearest_slope, |(_, slope)| *slope);
        if known.is_none() {
            nearest_of.push((body, along));
        }
        let answer = |slope: f64| {
            let distance_m = one.distance_m(slope);
            let is_heard = one.faces(slope, distance_m, sector) && hears(body, distance_m, along);
            is_heard.then_some(Heard { distance_m, slope })
        };
        // Farther along it is neither met less obliquely nor heard better.
        if answer(one.nearest_slope).is_none() {
            continue;
        }
        open.clear();
        open.push((one.from, one.to));
        for other in seen.iter().take_while(|other| other.nearest_m < limit_m) {
            if !std::ptr::eq(one, other) {
                one.hide_behind(other, &mut open);
            }
        }
        for (from, to) in &open {
            let found = answer(one.nearest_between(*from, *to));
            best = match (best, found) {
                (Some(best), Some(found)) if found.distance_m >= best.distance_m => Some(best),
                (_, Some(found)) if found.distance_m <= limit_m => Some(found),
                (best, _) => best,
            };
        }
    }
    best
}

impl Seen {
    fn of(surface: Surface, sector: &Sector) -> Option<Seen> {
        let (a, b) = match surface.form {
            Form::Straight(a, b) => (a, b),
            Form::Round(centre, radius_m) => chord(centre, radius_m),
        };
        let (a, b) = clipped(a, b, sector.slope)?;
        let (a, b) = if a.y_m * b.x_m <= b.y_m * a.x_m {
            (a, b)
        } else {
            (b, a)
        };
        let mut seen = Seen {
            surface,
            from: a.y_m / a.x_m,
            to: b.y_m / b.x_m,
            near_from: 1.0 / a.x_m,
            near_to: 1.0 / b.x_m,
            nearest_slope: 0.0,
            nearest_m: 0.0,
        };
        // What is seen edge-on shows nothing.
        if seen.to - seen.from <= SLIT {
            return None;
        }
        seen.nearest_slope = seen.nearest_between(seen.from, seen.to);
        seen.nearest_m = seen.distance_m(seen.nearest_slope);
        (seen.nearest_m <= sector.max_m).then_some(seen)
    }

    /// 1/x of its piece or chord in a direction.
    fn near_at(&self, slope: f64) -> f64 {
        let share = (slope - self.from) / (self.to - self.from);
        self.near_from + share * (self.near_to - self.near_from)
    }

    /// Distance from the sensor in a direction, metres.
    fn distance_m(&self, slope: f64) -> f64 {
        let stretch = (1.0 + slope * slope).sqrt();
        match self.surface.form {
            Form::Straight(..) => stretch / self.near_at(slope),
            Form::Round(centre, radius_m) => {
                let (ahead_m, beside_m) = seen_along(centre, slope);
                let square_m2 = radius_m * radius_m - beside_m * beside_m;
                ahead_m - square_m2.max(0.0).sqrt()
            }
        }
    }

    /// The direction of the point that comes nearest to the sensor, were there no ends: the foot of the perpendicular.
    fn foot(&self) -> Option<f64> {
        let foot = match self.surface.form {
            Form::Straight(a, b) => {
                let normal = (b - a).left();
                normal * (normal.dot(a) / normal.dot(normal))
            }
            Form::Round(centre, _) => centre,
        };
        (foot.x_m > 0.0).then(|| foot.y_m / foot.x_m)
    }

    fn nearest_between(&self, from: f64, to: f64) -> f64 {
        match self.foot() {
            Some(foot) if foot > from && foot < to => foot,
            Some(_) | None => {
                if self.distance_m(from) <= self.distance_m(to) {
                    from
                } else {
                    to
                }
            }
        }
    }

    fn faces(&self, slope: f64, distance_m: f64, sector: &Sector) -> bool {
        if self.surface.always_faces {
            return true;
        }
        match self.surface.form {
            Form::Straight(a, b) => {
                let along = b - a;
                let perpendicular_m = a.cross(along).abs() / along.length_m();
                perpendicular_m * (1.0 + HAIR) >= sector.facing * distance_m
            }
            Form::Round(centre, radius_m) => {
                let (_, beside_m) = seen_along(centre, slope);
                let square = 1.0 - beside_m * beside_m / (radius_m * radius_m);
                square.max(0.0).sqrt() * (1.0 + HAIR) >= sector.facing
            }
        }
    }

    /// Takes from some intervals of slopes those in which another surface hides this one.
    fn hide_behind(&self, other: &Seen, open: &mut Vec<(f64, f64)>) {
        let Some((mut from, mut to)) = self.behind(other) else {
            if let (Form::Straight(..), Form::Round(..)) = (self.surface.form, other.surface.form)
                && let Some((from, to)) = self.inside(other)
            {
                cut_out(open, from, to);
            }
            return;
        };
        match (self.surface.form, other.surface.form) {
            (Form::Straight(..), Form::Round(..)) => {
                if let Some((enters, leaves)) = self.inside(other) {
                    (from, to) = (from.min(enters), to.max(leaves));
                }
                cut_out(open, from, to);
            }
            (Form::Round(..), Form::Straight(..)) => match other.inside(self) {
                // What lies inside the circle is behind its front.
                Some((enters, leaves)) => {
                    cut_out(open, from, to.min(enters));
                    cut_out(open, from.max(leaves), to);
                }
                None => cut_out(open, from, to),
            },
            (Form::Straight(..), Form::Straight(..)) | (Form::Round(..), Form::Round(..)) => {
                cut_out(open, from, to);
            }
        }
    }

    /// Returns between which slopes another surface's piece or chord lies before this one's.
    fn behind(&self, other: &Seen) -> Option<(f64, f64)> {
        let (from, to) = (self.from.max(other.from), self.to.min(other.to));
        if to <= from {
            return None;
        }
        let lead = |slope: f64| other.near_at(slope) - self.near_at(slope);
        let (lead_from, lead_to) = (lead(from), lead(to));
        let hair = HAIR * self.near_from.max(self.near_to);
        match (lead_from > hair, lead_to > hair) {
            (true, true) => Some((from, to)),
            (false, false) => None,
            (leads_first, _) => {
                let crossing = from + (to - from) * (lead_from / (lead_from - lead_to));
                let crossing = crossing.clamp(from, to);
                Some(if leads_first {
                    (from, crossing)
                } else {
                    (crossing, to)
                })
            }
        }
    }

    /// Returns between which slopes this straight piece lies inside a circle.
    fn inside(&self, circle: &Seen) -> Option<(f64, f64)> {
        let Form::Round(centre, radius_m) = circle.surface.form else {
            return None;
        };
        let end = |slope: f64, near: f64| Vector::new(1.0 / near, slope / near);
        let (a, b) = (end(self.from, self.near_from), end(self.to, self.near_to));
        let (along, away) = (b - a, centre - a);
        let square_m2 = along.dot(along);
        let beside_m2 = along.cross(away) * along.cross(away) / square_m2;
        let half = (radius_m * radius_m - beside_m2) / square_m2;
        if half <= 0.0 {
            return None;
        }
        let middle = along.dot(away) / square_m2;
        let (enters, leaves) = (
            (middle - half.sqrt()).max(0.0),
            (middle + half.sqrt()).min(1.0),
        );
        let slope = |share: f64| {
            let at = a + along * share;
            at.y_m / at.x_m
        };
        (enters < leaves).then(|| (slope(enters), slope(leaves)))
    }
}

/// How far ahead and how far beside a direction a point lies, metres.
fn seen_along(point: Vector, slope: f64) -> (f64, f64) {
    let stretch = (1.0 + slope * slope).sqrt();
    let along = Vector::new(1.0 / stretch, slope / stretch);
    (along.dot(point), along.cross(point))
}

/// The points in which the tangents from the origin touch a circle outside of which it lies.
fn chord(centre: Vector, radius_m: f64) -> (Vector, Vector) {
    let square_m2 = centre.dot(centre);
    let share = radius_m / square_m2;
    let middle = centre * (1.0 - radius_m * share);
    let half = centre.left() * (share * (square_m2 - radius_m * radius_m).max(0.0).sqrt());
    (middle - half, middle + half)
}

/// Returns the part of a straight piece between the edges of a sector; both ends lie ahead.
fn clipped(a: Vector, b: Vector, slope: f64) -> Option<(Vector, Vector)> {
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for sign in [1.0, -1.0] {
        // How far inside of this edge the ends lie.
        let inside = |at: Vector| slope * at.x_m + sign * at.y_m;
        let (at_a, at_b) = (inside(a), inside(b));
        if at_a < 0.0 && at_b < 0.0 {
            return None;
        }
        if at_a < 0.0 {
            from = from.max(at_a / (at_a - at_b));
        } else if at_b < 0.0 {
            to = to.min(at_a / (at_a - at_b));
        }
    }
    let along = b - a;
    let (a, b) = (a + along * from, a + along * to);
    let is_ahead = a.x_m > TOUCH_M && b.x_m > TOUCH_M;
    (from < to && is_ahead).then_some((a, b))
}

/// Takes an interval out of ascending ones.
fn cut_out(open: &mut Vec<(f64, f64)>, from: f64, to: f64) {
    let mut index = 0;
    while let Some((start, end)) = open.get(index).copied() {
        if to <= from || end <= from || start >= to {
            index += 1;
            continue;
        }
        open.remove(index);
        for rest in [(to, end), (start, from)] {
            if rest.1 - rest.0 > SLIT {
                open.insert(index, rest);
            }
        }
    }
}

#[cfg(test)]
mod tests;
