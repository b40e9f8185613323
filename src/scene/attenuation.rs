//! What the scene takes from a radio link, in dB: the exact average over the link's Fresnel zone.
//!
//! No path loss, no fading and no noise: those belong to the simulated radio. With s along a link of length d, h across it
//! (left is positive) and r(s) = ½ √(λ s (d−s)/d), the offset of the wave from the line is taken as normal with deviation
//! r. A solid's share is then, by Green's theorem, A = α · Σ over its counter-clockwise edges of −∫ Φ(h/r) ds. Every
//! connected solid saturates at about 30 dB, because energy leaks around it.

use std::collections::BTreeMap;

use super::build::Scene;
use super::outline::union;
use crate::geom::{Point, Rect, Segment, Vector};

/// Beyond this many deviations from the line nothing counts (Φ(−4.5) = 3.4e-6).
const REACH: f64 = 4.5;

/// The attenuation of all links at one height of a scene.
#[derive(Clone, Debug)]
pub struct Attenuation {
    wavelength_m: f64,
    /// What leaks around any object, as a share of the power.
    leak: f64,
    solids: Vec<Solid>,
    sheets: Vec<Sheet>,
    normal: NormalTable,
}

/// A connected region of one material.
#[derive(Clone, Debug)]
struct Solid {
    bounds: Rect,
    contours: Vec<Vec<Point>>,
    db_per_m: f64,
}

/// An open surface.
#[derive(Clone, Debug)]
struct Sheet {
    bounds: Rect,
    pieces: Vec<Segment>,
    db_per_crossing: f64,
}

/// A link with its own axes.
struct Link {
    from: Point,
    along: Vector,
    length_m: f64,
    /// λ / (4 d), 1/m · m: r² = spread · s (d − s).
    spread: f64,
    reach_m: f64,
}

/// A point in a link's axes, metres.
#[derive(Clone, Copy)]
struct Place {
    s_m: f64,
    h_m: f64,
}

impl Attenuation {
    /// Cuts the scene at a height (metres above z = 0) for links of a wavelength (metres); each object
    /// saturates at `limit_db`, usually 30 dB.
    ///
    /// Shapes of one material that overlap or share a border are joined, so that corners do not count twice.
    pub fn new(scene: &Scene, height_m: f64, wavelength_m: f64, limit_db: f64) -> Attenuation {
        let leak = libm::pow(10.0, -limit_db / 10.0);
        let mut materials: BTreeMap<u64, (f64, Vec<Vec<Point>>)> = BTreeMap::new();
        let mut sheets = Vec::new();
        for object in scene.objects() {
            let db_per_m = object.material.db_per_m;
            let contours = object.regions_at(height_m).into_iter().flatten();
            materials
                .entry(db_per_m.to_bits())
                .or_insert((db_per_m, Vec::new()))
                .1
                .extend(contours);
            let pieces = object.sheet_at(height_m);
            let db_per_crossing = object.material.db_per_crossing;
            let ends = pieces.iter().flat_map(|piece| [piece.from, piece.to]);
            if let Some(bounds) = Rect::around(ends).filter(|_| db_per_crossing > 0.0) {
                sheets.push(Sheet {
                    bounds,
                    pieces,
                    db_per_crossing,
                });
            }
        }
        let mut solids = Vec::new();
        for (db_per_m, contours) in materials
            .into_values()
            .filter(|(db_per_m, _)| *db_per_m > 0.0)
        {
            for contours in union(&contours) {
                let Some(bounds) = Rect::around(contours.iter().flatten().copied()) else {
                    continue;
                };
                solids.push(Solid {
                    bounds,
                    contours,
                    db_per_m,
                });
            }
        }
        Attenuation {
            wavelength_m,
            leak,
            solids,
            sheets,
            normal: NormalTable::new(),
        }
    }

    /// Returns the attenuation between two antennas, dB; never negative, the same bits in both directions.
    pub fn between(&self, a: Point, b: Point) -> f64 {
        let Some(link) = Link::new(a, b, self.wavelength_m) else {
            return 0.0;
        };
        let solids = self
            .solids
            .iter()
            .filter(|solid| link.may_meet(solid.bounds));
        let sheets = self
            .sheets
            .iter()
            .filter(|sheet| link.may_meet(sheet.bounds));
        solids
            .map(|solid| self.saturated_db(solid.db_per_m * self.solid_m(solid, &link)))
            .sum::<f64>()
            + sheets
                .map(|sheet| {
                    self.saturated_db(sheet.db_per_crossing * self.crossings(sheet, &link))
                })
                .sum::<f64>()
    }

    /// Returns an object's attenuation with what leaks around it, dB.
    #[inline]
    fn saturated_db(&self, plain_db: f64) -> f64 {
        let through = libm::exp(plain_db * -std::f64::consts::LN_10 / 10.0);
        (-10.0 * libm::log10(through + self.leak)).max(0.0)
    }

    /// Returns the average length inside all solids together, without saturation, metres.
    #[cfg(test)]
    #[inline]
    pub(super) fn inside_m(&self, a: Point, b: Point) -> f64 {
        let Some(link) = Link::new(a, b, self.wavelength_m) else {
            return 0.0;
        };
        self.solids
            .iter()
            .map(|solid| self.solid_m(solid, &link))
            .sum()
    }

    /// The average length inside a solid, metres.
    fn solid_m(&self, solid: &Solid, link: &Link) -> f64 {
        let mut sum_m = 0.0;
        for contour in &solid.contours {
            let Some(last) = contour.last() else { continue };
            let mut from = link.place(*last);
            for corner in contour {
                let to = link.place(*corner);
                sum_m -= self.edge_m(from, to, link);
                from = to;
            }
        }
        sum_m.max(0.0)
    }

    /// ∫ Φ(h/r) ds along an edge, within the link.
    fn edge_m(&self, from: Place, to: Place, link: &Link) -> f64 {
        if to.s_m < from.s_m {
            return -self.edge_m(to, from, link);
        }
        let (start_m, end_m) = (from.s_m.max(0.0), to.s_m.min(link.length_m));
        if end_m <= start_m {
            return 0.0;
        }
        if from.h_m.max(to.h_m) <= -link.reach_m {
            return 0.0;
        }
        if from.h_m.min(to.h_m) >= link.reach_m {
            return end_m - start_m;
        }
        let slope = (to.h_m - from.h_m) / (to.s_m - from.s_m);
        let line = Line {
            base_m: from.h_m - slope * from.s_m,
            slope,
        };
        self.line_m(&line, start_m, end_m, link)
    }

    fn line_m(&self, line: &Line, start_m: f64, end_m: f64, link: &Link) -> f64 {
        let sure_m = |start_m: f64, end_m: f64| {
            if line.at((start_m + end_m) / 2.0) > 0.0 {
                end_m - start_m
            } else {
                0.0
            }
        };
        let Some((near_m, far_m)) = line.within_reach(link) else {
            return sure_m(start_m, end_m);
        };
        let (near_m, far_m) = (near_m.clamp(start_m, end_m), far_m.clamp(start_m, end_m));
        let mut sum_m = sure_m(start_m, near_m) + sure_m(far_m, end_m);
        let middle_m = link.length_m / 2.0;
        let zero_m = -line.base_m / line.slope;
        let mut marks = [
            near_m,
            middle_m,
            if zero_m.is_finite() { zero_m } else { middle_m },
            far_m,
        ];
        marks[1] = marks[1].clamp(near_m, far_m);
        marks[2] = marks[2].clamp(near_m, far_m);
        if marks[1] > marks[2] {
            marks.swap(1, 2);
        }
        for pair in marks.windows(2) {
            if pair[1] > pair[0] {
                sum_m += self.gauss_m(line, pair[0], pair[1], link);
            }
        }
        sum_m
    }

    /// Eight-point Gauss–Legendre in t = √s from the nearer end, where h/r is smooth.
    fn gauss_m(&self, line: &Line, start_m: f64, end_m: f64, link: &Link) -> f64 {
        let mirrored = start_m + end_m > link.length_m;
        let (low_m, high_m, line) = if mirrored {
            (
                link.length_m - end_m,
                link.length_m - start_m,
                line.mirrored(link.length_m),
            )
        } else {
            (start_m, end_m, *line)
        };
        let (low, high) = (low_m.max(0.0).sqrt(), high_m.sqrt());
        let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
        let value = |t: f64| {
            let s_m = t * t;
            let radius = (link.spread * (link.length_m - s_m)).sqrt() * t;
            2.0 * t * self.normal.share_below(line.at(s_m) / radius)
        };
        let pairs = GAUSS.iter();
        half * pairs
            .map(|(node, weight)| {
                weight * (value(middle - half * node) + value(middle + half * node))
            })
            .sum::<f64>()
    }

    /// The average number of crossings: the variation of Φ(h/r) along the pieces, which has one turning
    /// point at most on each.
    #[inline]
    fn crossings(&self, sheet: &Sheet, link: &Link) -> f64 {
        sheet
            .pieces
            .iter()
            .map(|piece| self.piece_crossings(link.place(piece.from), link.place(piece.to), link))
            .sum()
    }

    fn piece_crossings(&self, from: Place, to: Place, link: &Link) -> f64 {
        let (from, to) = if to.s_m < from.s_m {
            (to, from)
        } else {
            (from, to)
        };
        if to.s_m <= 0.0 || from.s_m >= link.length_m {
            return 0.0;
        }
        let share = |place: Place| {
            self.normal
                .share_below(place.h_m / link.radius_m(place.s_m))
        };
        if to.s_m == from.s_m {
            return (share(to) - share(from)).abs();
        }
        let slope = (to.h_m - from.h_m) / (to.s_m - from.s_m);
        let line = Line {
            base_m: from.h_m - slope * from.s_m,
            slope,
        };
        let at = |s_m: f64| {
            share(Place {
                s_m,
                h_m: line.at(s_m),
            })
        };
        let (start_m, end_m) = (from.s_m.max(0.0), to.s_m.min(link.length_m));
        let turn_m = line.base_m * link.length_m / (line.slope * link.length_m + 2.0 * line.base_m);
        if turn_m > start_m && turn_m < end_m {
            return (at(turn_m) - at(start_m)).abs() + (at(end_m) - at(turn_m)).abs();
        }
        (at(end_m) - at(start_m)).abs()
    }
}

/// h as a linear function of s.
#[derive(Clone, Copy)]
struct Line {
    base_m: f64,
    slope: f64,
}

impl Line {
    #[inline]
    fn at(&self, s_m: f64) -> f64 {
        self.base_m + self.slope * s_m
    }

    /// The same line with s counted from the other end.
    #[inline]
    fn mirrored(&self, length_m: f64) -> Line {
        Line {
            base_m: self.at(length_m),
            slope: -self.slope,
        }
    }

    /// Where |h| < REACH · r: one interval at most, because h² − REACH² r² is a parabola open upward.
    fn within_reach(&self, link: &Link) -> Option<(f64, f64)> {
        let wide = REACH * REACH * link.spread;
        let a = self.slope * self.slope + wide;
        let b = 2.0 * self.base_m * self.slope - wide * link.length_m;
        let c = self.base_m * self.base_m;
        let root = b * b - 4.0 * a * c;
        // With b ≥ 0 both ends lie before the link.
        if b >= 0.0 || root <= 0.0 {
            return None;
        }
        let q = (root.sqrt() - b) / 2.0;
        let (near_m, far_m) = (c / q, q / a);
        (near_m <= far_m).then_some((near_m, far_m))
    }
}

impl Link {
    /// `None` when the two ends coincide or are no numbers. The ends are put in order first, so that both
    /// directions give the same bits.
    fn new(one: Point, other: Point, wavelength_m: f64) -> Option<Link> {
        let order = one
            .x_m
            .total_cmp(&other.x_m)
            .then(one.y_m.total_cmp(&other.y_m));
        let (a, b) = if order.is_gt() {
            (other, one)
        } else {
            (one, other)
        };
        let length_m = a.distance_to(b);
        if !(length_m > 0.0 && length_m.is_finite()) {
            return None;
        }
        let spread = wavelength_m / (4.0 * length_m);
        let reach_m = REACH * spread.sqrt() * length_m / 2.0;
        Some(Link {
            from: a,
            along: (b - a) * (1.0 / length_m),
            length_m,
            spread,
            reach_m,
        })
    }

    #[inline]
    fn place(&self, point: Point) -> Place {
        let from = point - self.from;
        Place {
            s_m: self.along.dot(from),
            h_m: self.along.cross(from),
        }
    }

    #[inline]
    fn radius_m(&self, s_m: f64) -> f64 {
        (self.spread * s_m * (self.length_m - s_m)).max(0.0).sqrt()
    }

    /// Returns whether a rectangle comes near the link, by its extent along both of the link's axes.
    #[inline]
    fn may_meet(&self, bounds: Rect) -> bool {
        let Place { s_m, h_m } = self.place(bounds.centre());
        let (half_x, half_y) = (bounds.width_m() / 2.0, bounds.height_m() / 2.0);
        let (x, y) = (self.along.x_m.abs(), self.along.y_m.abs());
        let (reach_s, reach_h) = (half_x * x + half_y * y, half_x * y + half_y * x);
        h_m.abs() < self.reach_m + reach_h && s_m > -reach_s && s_m < self.length_m + reach_s
    }
}

/// Positive nodes and weights of the eight-point Gauss–Legendre rule (Abramowitz & Stegun, table 25.4).
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

/// The normal distribution function, tabulated within ±REACH and joined by cubics (error below 1e-7).
#[derive(Clone, Debug)]
struct NormalTable {
    /// Value and slope (per step) at each knot.
    knots: Vec<(f64, f64)>,
}

impl NormalTable {
    const STEPS_PER_UNIT: f64 = 16.0;

    fn new() -> NormalTable {
        let count = (2.0 * REACH * NormalTable::STEPS_PER_UNIT) as usize + 2;
        let knot = |index: usize| {
            let x = index as f64 / NormalTable::STEPS_PER_UNIT - REACH;
            let density = libm::exp(-x * x / 2.0) / std::f64::consts::TAU.sqrt();
            (
                libm::erfc(-x / std::f64::consts::SQRT_2) / 2.0,
                density / NormalTable::STEPS_PER_UNIT,
            )
        };
        NormalTable {
            knots: (0..count).map(knot).collect(),
        }
    }

    /// Φ(x); 0 and 1 beyond REACH.
    fn share_below(&self, x: f64) -> f64 {
        if !(x > -REACH && x < REACH) {
            return if x >= REACH { 1.0 } else { 0.0 };
        }
        let steps = (x + REACH) * NormalTable::STEPS_PER_UNIT;
        let index = steps as usize;
        let t = steps - index as f64;
        let ((from, slope_from), (to, slope_to)) = (self.knots[index], self.knots[index + 1]);
        let rise = to - from;
        from + t
            * (slope_from
                + t * (3.0 * rise - 2.0 * slope_from - slope_to
                    + t * (slope_from + slope_to - 2.0 * rise)))
    }
}
