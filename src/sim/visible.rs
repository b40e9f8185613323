//! What of a scene can be seen at all, found by brute force: the judge of what a mission has found.
//!
//! It knows no map, no planner and no mission, and shares no code with the simulated sensor but what is a fact of physics or of
//! the scene: how far away a thin post is heard ([`PostDetection`]), and how wide something is. In the plane at the sensor's
//! height:
//!
//! - **surface**: the cells of the map's lattice in which a piece of an outline lies (the cell just inside the solid;
//!   pieces between two solids that touch or overlap do not count);
//! - **reachable**: places that a vehicle can get to by the truth ([`super::reachable`]), looked from [`PITCH_M`] apart;
//! - **visible**: surface cells with a point that some reachable place has in range, within the incidence limit,
//!   unobstructed, of something wide enough to be heard from there, and that a cone of the sensor's width hears as its nearest
//!   echo when it looks well (the point may lie anywhere in the cone, and the vehicle may look anywhere).
//!
//! A cell was **detected** when the map holds an occupied cell there or in one of the eight around it: a hit is noisy and
//! is spread over the cone's arc.

use std::collections::{BTreeMap, BTreeSet};

use super::reachable::{Reachable, STEP_M};
use crate::geom::{Cell, Lattice, Point, Polygon, Rect, Segment, Vector};
use crate::map::{CellRect, Merged, Occupancy, View};
use crate::plan::PostDetection;
use crate::scene::{Hit, LevelCut, Outline, Scene};

/// Distance between two places that are looked from, metres.
pub const PITCH_M: f64 = 0.1;
/// Points that are tried along the surface in a cell's length.
const POINTS_A_CELL: f64 = 4.0;
/// How far from the surface its two sides are tried, metres.
const SKIN_M: f64 = 1e-3;
/// An echo that is nearer by less is not heard apart from another, metres.
const AT_ONCE_M: f64 = 0.01;
/// Rays of a cone; they are asked twice as far on both sides of a point, so that it may lie anywhere in the cone.
const CONE_RAYS: usize = 7;
/// Side of the squares into which places are sorted, metres.
const BUCKET_M: f64 = 1.0;
/// Places beyond so many steps from the datum are left out.
const MOST_STEPS: f64 = 1e5;

/// How a range sensor sees.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SensorView {
    /// Height above z = 0, metres.
    pub height_m: f64,
    /// Half of the cone's opening, radians.
    pub half_angle_rad: f64,
    /// Nearest echo, metres.
    pub min_m: f64,
    /// Farthest echo, metres.
    pub max_m: f64,
    /// Largest angle between ray and surface normal that returns an echo, radians.
    pub incidence_max_rad: f64,
    /// How far away something as wide as a post is heard; `None` for a ray, which hears whatever it meets.
    pub posts: Option<PostDetection>,
}

/// A point of the surface, to which side it faces, and of which object it is.
#[derive(Clone, Copy, Debug)]
struct Point2 {
    at: Point,
    outward: Vector,
    object: usize,
}

/// The surface of a scene at a height, by cells.
#[derive(Clone, Debug)]
pub struct VisibleSurface {
    cells: BTreeMap<Cell, Vec<Point2>>,
    /// How wide what stands there is.
    cut: LevelCut,
}

impl VisibleSurface {
    /// Finds the surface of all that stands at a height.
    pub fn of(scene: &Scene, height_m: f64, lattice: Lattice) -> VisibleSurface {
        let outlines = scene.outlines(height_m);
        let solids: Vec<(Rect, &Outline)> = outlines
            .iter()
            .filter_map(|outline| {
                Some((
                    Rect::around(outline.polygon.corners().iter().copied())?,
                    outline,
                ))
            })
            .collect();
        let is_solid = |point: Point| {
            solids
                .iter()
                .any(|(bounds, outline)| bounds.contains(point) && outline.contains(point))
        };
        let mut surface = VisibleSurface {
            cells: BTreeMap::new(),
            cut: LevelCut::of(scene, height_m),
        };
        for outline in &outlines {
            let is_sheet = outline.polygon.corners().len() < 3;
            for edge in outline
                .polygon
                .edges()
                .chain(outline.holes.iter().flat_map(Polygon::edges))
            {
                surface.add(edge, (outline.object, is_sheet), lattice, &is_solid);
            }
        }
        surface
    }

    /// Adds the points of an edge of an object; the solid lies to its left. (A sheet has two edges, there and back.)
    fn add(
        &mut self,
        edge: Segment,
        (object, is_sheet): (usize, bool),
        lattice: Lattice,
        is_solid: &dyn Fn(Point) -> bool,
    ) {
        let length_m = edge.length_m();
        if length_m <= 0.0 {
            return;
        }
        let count = libm::ceil(length_m / lattice.cell_m() * POINTS_A_CELL) as usize;
        let inward = edge.vector().left() * (1.0 / length_m);
        for index in 0..count {
            let at = edge
                .from
                .toward(edge.to, (index as f64 + 0.5) / count as f64);
            if is_solid(at + inward * -SKIN_M) {
                continue;
            }
            let inside = if is_sheet { at } else { at + inward * SKIN_M };
            let point = Point2 {
                at,
                outward: inward * -1.0,
                object,
            };
            self.cells
                .entry(lattice.cell_at(inside))
                .or_default()
                .push(point);
        }
    }

    /// Returns the cells, ascending.
    pub fn cells(&self) -> impl Iterator<Item = Cell> + '_ {
        self.cells.keys().copied()
    }

    /// Returns those of some cells that can be seen from places.
    pub fn seen_from(
        &self,
        scene: &Scene,
        sight: &SensorView,
        places: &PlaceIndex,
        among: &BTreeSet<Cell>,
    ) -> BTreeSet<Cell> {
        let eye = Eye::new(scene, &self.cut, *sight);
        let is_seen = |cell: &&Cell| {
            let points = self.cells.get(*cell);
            points.is_some_and(|points| points.iter().any(|point| eye.sees_from_any(point, places)))
        };
        among.iter().filter(is_seen).copied().collect()
    }
}

/// Places on a lattice of [`PITCH_M`], sorted into squares.
#[derive(Clone, Debug, Default)]
pub struct PlaceIndex {
    buckets: BTreeMap<Cell, Vec<Point>>,
}

impl PlaceIndex {
    /// Takes the places of the lattice that are nearest to points of tracks; steps of at most [`PITCH_M`] leave no gap.
    pub fn along<'a>(tracks: impl Iterator<Item = &'a [Point]>) -> PlaceIndex {
        let mut steps = BTreeSet::new();
        for track in tracks {
            steps.extend(track.first().and_then(|at| step_at(*at)));
            for pair in track.windows(2) {
                let pieces =
                    libm::ceil(pair[0].distance_to(pair[1]) / PITCH_M).clamp(1.0, MOST_STEPS);
                let between = (1..=pieces as usize)
                    .map(|piece| pair[0].toward(pair[1], piece as f64 / pieces));
                steps.extend(between.filter_map(step_at));
            }
        }
        PlaceIndex::at(steps.iter().map(|step| place_of(*step)))
    }

    /// Takes the places of a region, [`PITCH_M`] apart, and all homes.
    pub fn within(region: &Reachable) -> PlaceIndex {
        PlaceIndex::at(region.places(libm::round(PITCH_M / STEP_M) as i32))
    }

    fn at(places: impl Iterator<Item = Point>) -> PlaceIndex {
        let squares = Lattice::new(BUCKET_M);
        let mut sorted = PlaceIndex::default();
        for place in places {
            sorted
                .buckets
                .entry(squares.cell_at(place))
                .or_default()
                .push(place);
        }
        sorted
    }

    /// Returns all places in the squares that touch a circle's bounding square.
    fn near(&self, centre: Point, radius_m: f64) -> impl Iterator<Item = Point> + '_ {
        let squares = Lattice::new(BUCKET_M);
        let reach = Vector::new(radius_m, radius_m);
        let (low, high) = (
            squares.cell_at(centre + reach * -1.0),
            squares.cell_at(centre + reach),
        );
        let columns = (low.x..=high.x).flat_map(move |x| {
            self.buckets
                .range(Cell::new(x, low.y)..=Cell::new(x, high.y))
        });
        columns.flat_map(|(_, places)| places.iter().copied())
    }
}

/// Returns the place of a step.
fn place_of(step: Cell) -> Point {
    Point::new(f64::from(step.x) * PITCH_M, f64::from(step.y) * PITCH_M)
}

/// Returns the step nearest to a point, unless it lies absurdly far out.
fn step_at(point: Point) -> Option<Cell> {
    let index = |metres: f64| libm::round(metres / PITCH_M);
    let (x, y) = (index(point.x_m), index(point.y_m));
    (x.abs() <= MOST_STEPS && y.abs() <= MOST_STEPS).then(|| Cell::new(x as i32, y as i32))
}

/// A sensor that may look anywhere.
struct Eye<'a> {
    scene: &'a Scene,
    cut: &'a LevelCut,
    sight: SensorView,
    facing: f64,
    /// Directions beside that of a point, a ray's distance apart, from far right to far left without the middle.
    beside: Vec<(i32, Vector)>,
}

impl<'a> Eye<'a> {
    fn new(scene: &'a Scene, cut: &'a LevelCut, sight: SensorView) -> Eye<'a> {
        let steps = CONE_RAYS as i32 - 1;
        let apart_rad = 2.0 * sight.half_angle_rad / f64::from(steps);
        let turned = |index: i32| {
            let (sin, cos) = libm::sincos(apart_rad * f64::from(index));
            (index, Vector::new(cos, sin))
        };
        let beside = (-steps..=steps)
            .filter(|index| *index != 0)
            .map(turned)
            .collect();
        Eye {
            scene,
            cut,
            sight,
            facing: libm::cos(sight.incidence_max_rad),
            beside,
        }
    }

    fn sees_from_any(&self, point: &Point2, places: &PlaceIndex) -> bool {
        places
            .near(point.at, self.sight.max_m)
            .any(|place| self.sees(place, point))
    }

    fn sees(&self, place: Point, point: &Point2) -> bool {
        let away = point.at - place;
        let distance_m = away.length_m();
        if distance_m > self.sight.max_m || distance_m < self.sight.min_m || distance_m <= AT_ONCE_M
        {
            return false;
        }
        let along = away * (1.0 / distance_m);
        if -along.dot(point.outward) < self.facing
            || !self.is_wide_enough(point.object, along, distance_m)
        {
            return false;
        }
        self.hit(place, along, distance_m - 2.0 * SKIN_M).is_none()
            && self.hears_it_first(place, along, distance_m)
    }

    /// Returns whether some cone that holds a direction gives no echo nearer than so far.
    fn hears_it_first(&self, place: Point, along: Vector, distance_m: f64) -> bool {
        let answers = |beside: Vector| {
            let ray = Vector::new(
                along.x_m * beside.x_m - along.y_m * beside.y_m,
                along.x_m * beside.y_m + along.y_m * beside.x_m,
            );
            let hit = self.hit(place, ray, distance_m - AT_ONCE_M);
            hit.is_some_and(|hit| {
                cosine(ray, &hit) >= self.facing
                    && self.is_wide_enough(hit.object, ray, hit.distance_m)
            })
        };
        let steps = CONE_RAYS as i32 - 1;
        // A cone from index `first` to `first + steps` holds index 0.
        let quiet = |first: i32| {
            let of_cone = |index: &i32| (first..=first + steps).contains(index);
            self.beside
                .iter()
                .filter(|(index, _)| of_cone(index))
                .all(|(_, beside)| !answers(*beside))
        };
        (-steps..=0).rev().any(quiet)
    }

    /// Returns whether an object is wide enough across a direction to be heard from so far away.
    fn is_wide_enough(&self, object: usize, along: Vector, distance_m: f64) -> bool {
        self.sight.posts.is_none_or(|posts| {
            posts.hears(self.cut.object_half_width_m(object, along), distance_m)
        })
    }

    /// Returns where a ray meets the first surface nearer than so far.
    fn hit(&self, from: Point, along: Vector, within_m: f64) -> Option<Hit> {
        self.scene.cast(
            [from.x_m, from.y_m, self.sight.height_m],
            [along.x_m, along.y_m, 0.0],
            within_m,
        )
    }
}

/// Returns the cosine of the angle at which a level ray meets a surface.
fn cosine(along: Vector, hit: &Hit) -> f64 {
    (along.x_m * hit.normal[0] + along.y_m * hit.normal[1]).abs()
}

/// What of a scene can be seen, for runs that share scene, room and sensor.
#[derive(Clone, Debug)]
pub struct Visible {
    /// The surface.
    pub surface: VisibleSurface,
    /// The cells that can be seen from where a vehicle can get to.
    pub cells: BTreeSet<Cell>,
}

impl Visible {
    /// Finds it.
    pub fn find(
        scene: &Scene,
        lattice: Lattice,
        region: &Reachable,
        sight: &SensorView,
    ) -> Visible {
        let surface = VisibleSurface::of(scene, sight.height_m, lattice);
        let places = PlaceIndex::within(region);
        let all = surface.cells().collect();
        let cells = surface.seen_from(scene, sight, &places, &all);
        Visible { surface, cells }
    }

    /// Returns the visible cells that were in range, unobstructed, along tracks that were driven.
    pub fn along<'a>(
        &self,
        scene: &Scene,
        sight: &SensorView,
        tracks: impl Iterator<Item = &'a [Point]>,
    ) -> BTreeSet<Cell> {
        self.surface
            .seen_from(scene, sight, &PlaceIndex::along(tracks), &self.cells)
    }
}

/// Returns how many of some cells a map has detected: occupied there, or in a cell beside or diagonal to it.
pub fn detected(map: &Merged, slice: i16, cells: &BTreeSet<Cell>) -> usize {
    let Some(extent) = map.extent(slice) else {
        return 0;
    };
    let view = map.view(slice, extent);
    let is_near = |cell: &&Cell| {
        let around =
            (-1..=1).flat_map(|y| (-1..=1).map(move |x| Cell::new(cell.x + x, cell.y + y)));
        around.into_iter().any(|cell| is_occupied(&view, cell))
    };
    cells.iter().filter(is_near).count()
}

/// Returns how many cells of a map are occupied.
pub fn occupied(map: &Merged, slice: i16) -> usize {
    let Some(CellRect { low, high }) = map.extent(slice) else {
        return 0;
    };
    let view = map.view(slice, CellRect { low, high });
    let row = |y: i32| {
        (low.x..=high.x)
            .filter(|x| is_occupied(&view, Cell::new(*x, y)))
            .count()
    };
    (low.y..=high.y).map(row).sum()
}

fn is_occupied(view: &View<'_>, cell: Cell) -> bool {
    view.occupancy(cell) == Occupancy::Occupied
}

/// Returns the smallest distance between bodies that drove along tracks and the scene, metres: from the body's side,
/// negative inside something; `None` when there is nothing.
pub fn least_clearance_m<'a>(
    scene: &Scene,
    (radius_m, low_m, high_m): (f64, f64, f64),
    tracks: impl Iterator<Item = &'a [Point]>,
) -> Option<f64> {
    let mut least_m = f64::INFINITY;
    for track in tracks {
        // So far along the track nothing can be nearer than what is known already.
        let mut sure_m = 0.0;
        let mut last = None::<Point>;
        for at in track {
            sure_m -= last.map_or(0.0, |last| last.distance_to(*at));
            last = Some(*at);
            if sure_m > 0.0 {
                continue;
            }
            let clear_m = scene.clearance_m(*at, low_m, high_m) - radius_m;
            least_m = least_m.min(clear_m);
            sure_m = clear_m - least_m;
        }
    }
    least_m.is_finite().then_some(least_m)
}

#[cfg(test)]
mod tests;
