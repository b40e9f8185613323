//! Where vehicles can get to by the truth of a scene: a flood of places, the judge of who says that no way leads somewhere.
//!
//! It knows no map, no planner and no mission. A place is **reachable** for a vehicle when a line leads there from its
//! home along which its middle keeps a [`Room`] from everything that truly stands there and from the fence.
//! That room is the safety distance, two deviations of the place and three quarters of a map cell, on each side
//! (`VisibleScene`): a vehicle that knows the world as a map of cells cannot use less.
//!
//! The flood goes in steps of [`STEP_M`] along both axes. A gap that leaves the vehicle's middle more than a step is
//! found wherever it lies; one that leaves less may be missed, and one that leaves nothing is taken for open by a few
//! millimetres at most, and only between round things.
//!
//! - A home that has less room than that may be left straight, up to [`LEAVE_M`] far, where the body fits.
//! - Deliberately absent: other vehicles, and time. What enters the scene later stands there from the start.

use std::collections::BTreeMap;

use crate::geom::{Cell, Point, Polygon};
use crate::scene::Scene;

/// Distance between two places that are tried, metres.
pub const STEP_M: f64 = 0.05;
/// A home that has too little room may be left this far, metres.
pub const LEAVE_M: f64 = 1.0;
/// A place that keeps its distance by less is not free, metres: whether a gap exactly as wide as it must be lets somebody
/// through is not left to rounding.
const HAIR_M: f64 = 1e-6;
/// Places beyond so many steps from the datum are not tried, whatever the fence.
const MOST_STEPS: f64 = 2e5;
/// One answer serves for neighbours up to so many steps away.
const SERVES_STEPS: f64 = 20.0;
/// Side of the squares in which places are kept, steps.
const SQUARE: i32 = 32;

/// The room that a vehicle needs.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Room {
    /// Distance from its middle to the nearest surface, and to the fence, metres.
    pub keep_m: f64,
    /// The same of its body alone, metres; less than [`Room::keep_m`].
    pub body_m: f64,
    /// Only what stands above this height counts, metres.
    pub low_m: f64,
    /// Only what stands below this height counts, metres.
    pub high_m: f64,
}

/// The places that each of some vehicles can get to.
#[derive(Clone, Debug)]
pub struct Reachable {
    /// Places that are connected, each region for itself.
    regions: Vec<StepSet>,
    /// Which region each vehicle is in, in the order of the homes; `None` where it cannot leave its home.
    of_home: Vec<Option<usize>>,
    homes: Vec<Point>,
    fence: Polygon,
    room: Room,
}

impl Reachable {
    /// Finds them from the homes, in the order in which these are given.
    pub fn find(scene: &Scene, fence: &Polygon, homes: &[Point], room: &Room) -> Reachable {
        let mut ground = FreeGround {
            scene,
            fence,
            room: *room,
            known: BTreeMap::new(),
        };
        let mut found = Reachable {
            regions: Vec::new(),
            of_home: Vec::new(),
            homes: homes.to_vec(),
            fence: fence.clone(),
            room: *room,
        };
        for home in homes {
            let starts = ground.starts(*home);
            let region = starts.first().map(|first| {
                let known = found
                    .regions
                    .iter()
                    .position(|region| region.contains(*first));
                known.unwrap_or_else(|| {
                    found.regions.push(ground.flood(&starts));
                    found.regions.len() - 1
                })
            });
            found.of_home.push(region);
        }
        found
    }

    /// Returns whether the vehicle with a home, by its number from 0, can get to a place of the same scene. It can always
    /// get home.
    pub fn is_reachable(&self, scene: &Scene, home: usize, place: Point) -> bool {
        let is_home = |at: &Point| at.distance_to(place) < HAIR_M;
        if self.homes.get(home).is_some_and(is_home) {
            return true;
        }
        let region = self.of_home.get(home).copied().flatten();
        let Some(region) = region.and_then(|index| self.regions.get(index)) else {
            return false;
        };
        slack_m(scene, &self.fence, &self.room, place) > HAIR_M
            && step_at(place).is_some_and(|step| around(step).any(|near| region.contains(near)))
    }

    /// Returns the places that somebody can get to, so many steps apart, and all homes.
    pub fn places(&self, every_steps: i32) -> impl Iterator<Item = Point> + '_ {
        let is_kept = move |step: &Cell| {
            step.x.rem_euclid(every_steps) == 0 && step.y.rem_euclid(every_steps) == 0
        };
        self.regions
            .iter()
            .flat_map(StepSet::iter)
            .filter(is_kept)
            .map(place_of)
            .chain(self.homes.iter().copied())
    }
}

/// Returns the place of a step.
fn place_of(step: Cell) -> Point {
    Point::new(f64::from(step.x) * STEP_M, f64::from(step.y) * STEP_M)
}

/// Returns the step nearest to a point, unless it lies absurdly far out.
fn step_at(point: Point) -> Option<Cell> {
    let index = |metres: f64| libm::round(metres / STEP_M);
    let (x, y) = (index(point.x_m), index(point.y_m));
    (x.abs() <= MOST_STEPS && y.abs() <= MOST_STEPS).then(|| Cell::new(x as i32, y as i32))
}

/// Returns a step and the eight around it.
fn around(step: Cell) -> impl Iterator<Item = Cell> {
    (-1..=1).flat_map(move |y| (-1..=1).map(move |x| Cell::new(step.x + x, step.y + y)))
}

/// Returns by how much a place keeps more than its distance, metres; negative where it does not. Nowhere does it change
/// by more than the way between two places.
fn slack_m(scene: &Scene, fence: &Polygon, room: &Room, at: Point) -> f64 {
    let to_edge_m = fence.distance_to_edge(at);
    let inside_m = if fence.contains(at) {
        to_edge_m
    } else {
        -to_edge_m
    };
    if inside_m <= room.keep_m {
        return inside_m - room.keep_m;
    }
    inside_m.min(scene.clearance_m(at, room.low_m, room.high_m)) - room.keep_m
}

/// Which places are free, as far as asked.
struct FreeGround<'a> {
    scene: &'a Scene,
    fence: &'a Polygon,
    room: Room,
    known: BTreeMap<Cell, Box<[Option<bool>]>>,
}

impl FreeGround<'_> {
    fn is_free(&mut self, step: Cell) -> bool {
        let (square, index) = parts(step);
        let known = self.known.get(&square).and_then(|square| square[index]);
        known.unwrap_or_else(|| self.ask(step))
    }

    /// Asks the scene. One answer serves for many neighbours: no step comes nearer by more than its own length.
    fn ask(&mut self, step: Cell) -> bool {
        let slack_m = slack_m(self.scene, self.fence, &self.room, place_of(step));
        let free = slack_m > HAIR_M;
        // Within so many steps, diagonal ones too, the answer is the same.
        let reach =
            (slack_m.abs() / STEP_M * std::f64::consts::FRAC_1_SQRT_2).min(SERVES_STEPS) as i32;
        for y in step.y - reach..=step.y + reach {
            for x in step.x - reach..=step.x + reach {
                let (square, index) = parts(Cell::new(x, y));
                let empty = || vec![None; (SQUARE * SQUARE) as usize].into_boxed_slice();
                self.known.entry(square).or_insert_with(empty)[index] = Some(free);
            }
        }
        free
    }

    /// Returns the free places where a vehicle begins: beside its home, or, where that has too little room, wherever it
    /// can be left to straight.
    fn starts(&mut self, home: Point) -> Vec<Cell> {
        let Some(middle) = step_at(home) else {
            return Vec::new();
        };
        let beside: Vec<Cell> = around(middle).filter(|step| self.is_free(*step)).collect();
        if !beside.is_empty() {
            return beside;
        }
        let reach = (LEAVE_M / STEP_M) as i32;
        let mut free: Vec<(f64, Cell)> = Vec::new();
        for y in -reach..=reach {
            for x in -reach..=reach {
                let step = Cell::new(middle.x + x, middle.y + y);
                let far_m = home.distance_to(place_of(step));
                if far_m <= LEAVE_M && self.is_free(step) && self.body_fits(home, place_of(step)) {
                    free.push((far_m, step));
                }
            }
        }
        free.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
        free.into_iter().map(|(_, step)| step).collect()
    }

    /// Returns whether the body fits all along a line.
    fn body_fits(&self, from: Point, to: Point) -> bool {
        let body = Room {
            keep_m: self.room.body_m,
            ..self.room
        };
        let pieces = libm::ceil(from.distance_to(to) / STEP_M).max(1.0) as u32;
        (0..=pieces).all(|piece| {
            let at = from.toward(to, f64::from(piece) / f64::from(pieces));
            slack_m(self.scene, self.fence, &body, at) > 0.0
        })
    }

    fn flood(&mut self, starts: &[Cell]) -> StepSet {
        let mut reached = StepSet::default();
        let mut open: Vec<Cell> = starts
            .iter()
            .copied()
            .filter(|step| reached.insert(*step))
            .collect();
        while let Some(step) = open.pop() {
            for (x, y) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                let next = Cell::new(step.x + x, step.y + y);
                if self.is_free(next) && reached.insert(next) {
                    open.push(next);
                }
            }
        }
        reached
    }
}

/// Returns the square that holds a step, and which of its places that is.
fn parts(step: Cell) -> (Cell, usize) {
    let square = Cell::new(step.x.div_euclid(SQUARE), step.y.div_euclid(SQUARE));
    let (x, y) = (step.x.rem_euclid(SQUARE), step.y.rem_euclid(SQUARE));
    (square, (y * SQUARE + x) as usize)
}

/// A set of steps, by squares.
#[derive(Clone, Debug, Default)]
struct StepSet {
    /// A row of bits each.
    squares: BTreeMap<Cell, [u32; SQUARE as usize]>,
}

impl StepSet {
    /// Adds a step; returns whether it is new.
    fn insert(&mut self, step: Cell) -> bool {
        let (square, index) = parts(step);
        let rows = self.squares.entry(square).or_default();
        let (row, bit) = (index / SQUARE as usize, 1 << (index % SQUARE as usize));
        let is_new = rows[row] & bit == 0;
        rows[row] |= bit;
        is_new
    }

    fn contains(&self, step: Cell) -> bool {
        let (square, index) = parts(step);
        let (row, bit) = (index / SQUARE as usize, 1 << (index % SQUARE as usize));
        self.squares
            .get(&square)
            .is_some_and(|rows| rows[row] & bit != 0)
    }

    /// Returns all steps, square by square.
    fn iter(&self) -> impl Iterator<Item = Cell> + '_ {
        self.squares.iter().flat_map(|(square, rows)| {
            let low = Cell::new(square.x * SQUARE, square.y * SQUARE);
            (0..SQUARE * SQUARE)
                .filter(|index| rows[(index / SQUARE) as usize] & (1 << (index % SQUARE)) != 0)
                .map(move |index| Cell::new(low.x + index % SQUARE, low.y + index / SQUARE))
        })
    }
}

#[cfg(test)]
mod tests;
