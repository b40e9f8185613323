//! Random floor plans: rooms in a row or a grid, walls, one door in every wall that two rooms share, boxes and thin poles,
//! all from a seed. Which rooms a plan has depends on nothing of the program that is tested.
//!
//! Every door is as wide as asked for, whatever it does to the plan, and what stands in the rooms bars none of them for a
//! vehicle that fits through the doors: things that would are left out ([`FloorPlan::is_open`]).

use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::Path;

use tomoswarm::geom::{Point, Rect};

use super::chance::Chance;

/// Deviation of a vehicle's place, metres.
pub const POSE_SD_M: f64 = 0.02;
/// Sides of rooms, metres.
const ROOM_M: (f64, f64) = (3.2, 6.0);
/// Thickness of walls, metres.
const WALL_M: (f64, f64) = (0.1, 0.2);
/// Radii of poles, metres.
const POLES_M: [f64; 5] = [0.01, 0.02, 0.03, 0.05, 0.1];
/// Columns and rows of rooms.
const SHAPES: [(usize, usize); 6] = [(3, 2), (2, 3), (2, 2), (4, 1), (1, 5), (6, 1)];
/// A door begins at least so far from the corner of a room, metres.
const CORNER_M: f64 = 0.05;
/// Between the outer wall and the fence, metres.
const BORDER_M: f64 = 0.5;
/// How finely [`FloorPlan::is_open`] tries places, metres.
const STEP_M: f64 = 0.05;

/// What a plan is made for.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Demand {
    /// The safety distance, from the middle of a vehicle, metres.
    pub distance_m: f64,
    /// Doors are so much wider than twice the distance and two deviations, metres.
    pub extra_m: f64,
    /// Poles thinner than this are left out, radius in metres.
    pub thinnest_m: f64,
}

impl Demand {
    /// Returns the width of the doors, metres.
    pub fn door_m(&self) -> f64 {
        2.0 * (self.distance_m + 2.0 * POSE_SD_M) + self.extra_m
    }
}

/// Something in a room.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Thing {
    /// A wall or a box.
    Block(Rect),
    /// An upright pole, by its middle and its radius in metres.
    Pole(Point, f64),
}

impl Thing {
    /// Returns the distance of a place from its side, metres; 0 inside.
    pub fn distance_m(&self, at: Point) -> f64 {
        match self {
            Thing::Block(Rect { min, max }) => {
                let x_m = (min.x_m - at.x_m).max(at.x_m - max.x_m).max(0.0);
                let y_m = (min.y_m - at.y_m).max(at.y_m - max.y_m).max(0.0);
                x_m.hypot(y_m)
            }
            Thing::Pole(middle, radius_m) => (middle.distance_to(at) - radius_m).max(0.0),
        }
    }

    fn toml(&self) -> String {
        match self {
            Thing::Block(Rect { min, max }) => format!(
                "[[object]]\noutline_m = [[{:?}, {:?}], [{:?}, {:?}], [{:?}, {:?}], [{:?}, {:?}]]\n",
                min.x_m, min.y_m, max.x_m, min.y_m, max.x_m, max.y_m, min.x_m, max.y_m
            ),
            Thing::Pole(at, radius_m) => format!(
                "[[object]]\ncentre_m = [{:?}, {:?}]\nradius_m = {radius_m:?}\n",
                at.x_m, at.y_m
            ),
        }
    }
}

/// A door: the middle of the gap, which way one goes through, and where to.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Doorway {
    /// Middle of the gap.
    pub at: Point,
    /// Whether it joins rooms beside each other; otherwise one above the other.
    pub is_along_x: bool,
    /// The rooms that it joins, by their numbers, the left or lower one first.
    pub rooms: [usize; 2],
}

/// Rooms, what stands in them, where the vehicle lives, and a place in each room.
#[derive(Clone, PartialEq, Debug)]
pub struct FloorPlan {
    /// Its seed.
    pub seed: u64,
    /// What it was made for.
    pub demand: Demand,
    /// Insides of the rooms, row by row.
    pub rooms: Vec<Rect>,
    /// Doors between them.
    pub doors: Vec<Doorway>,
    /// Walls.
    pub walls: Vec<Thing>,
    /// Boxes and poles.
    pub things: Vec<Thing>,
    /// Where the vehicle starts.
    pub home: Point,
    /// A place to visit in each room.
    pub places: Vec<Point>,
}

/// Draws one plan.
struct Draft {
    chance: Chance,
    drawn: u64,
    /// Borders of the columns and of the rows, outer walls included: inside of room i is from 2i + 1 to 2i + 2.
    columns: Vec<f64>,
    rows: Vec<f64>,
}

impl Draft {
    fn between(&mut self, (low, high): (f64, f64)) -> f64 {
        self.drawn += 1;
        low + (high - low) * self.chance.share("floor plan", &[self.drawn])
    }

    fn below(&mut self, end: usize) -> usize {
        self.drawn += 1;
        self.chance.below("floor plan", &[self.drawn], end)
    }

    /// Draws the borders of so many rooms in a row, with their walls.
    fn borders(&mut self, rooms: usize) -> Vec<f64> {
        // Anywhere against the lattice of map cells.
        let mut borders = vec![millimetre(self.between((0.0, 0.2)))];
        for border in 0..=2 * rooms {
            let length_m = self.between(if border % 2 == 0 { WALL_M } else { ROOM_M });
            borders.push(millimetre(borders[border] + length_m));
        }
        borders
    }

    fn room(&self, column: usize, row: usize) -> Rect {
        let (x, y) = (2 * column + 1, 2 * row + 1);
        Rect::new(
            Point::new(self.columns[x], self.rows[y]),
            Point::new(self.columns[x + 1], self.rows[y + 1]),
        )
    }

    /// Draws a point inside a rectangle.
    fn point_in(&mut self, within: Rect) -> Point {
        let x_m = self.between((within.min.x_m, within.max.x_m));
        let y_m = self.between((within.min.y_m, within.max.y_m));
        Point::new(millimetre(x_m), millimetre(y_m))
    }
}

fn millimetre(metres: f64) -> f64 {
    (metres * 1000.0).round() / 1000.0
}

fn block(x: (f64, f64), y: (f64, f64)) -> Thing {
    Thing::Block(Rect::new(Point::new(x.0, y.0), Point::new(x.1, y.1)))
}

impl FloorPlan {
    /// Draws a plan from a seed.
    pub fn draw(seed: u64, demand: Demand) -> FloorPlan {
        let mut draft = Draft {
            chance: Chance::new(seed),
            drawn: 0,
            columns: Vec::new(),
            rows: Vec::new(),
        };
        let (columns, rows) = SHAPES[draft.below(SHAPES.len())];
        draft.columns = draft.borders(columns);
        draft.rows = draft.borders(rows);
        let all = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
        let rooms = all.map(|(column, row)| draft.room(column, row)).collect();
        let mut plan = FloorPlan {
            seed,
            demand,
            rooms,
            doors: Vec::new(),
            walls: Vec::new(),
            things: Vec::new(),
            home: Point::default(),
            places: Vec::new(),
        };
        plan.put_walls(&mut draft, (columns, rows));
        let home = draft.below(plan.rooms.len());
        plan.put_things(&mut draft);
        let stands =
            |plan: &FloorPlan, draft: &mut Draft, room: usize| plan.free_place(draft, room);
        plan.home = stands(&plan, &mut draft, home);
        for room in 0..plan.rooms.len() {
            let place = stands(&plan, &mut draft, room);
            plan.places.push(place);
        }
        while !plan.is_open(demand.door_m() / 2.0 - STEP_M) && plan.things.pop().is_some() {}
        plan
    }

    /// Puts the outer walls, and those between rooms with their doors.
    fn put_walls(&mut self, draft: &mut Draft, (columns, rows): (usize, usize)) {
        let (x, y) = (draft.columns.clone(), draft.rows.clone());
        let (right, top) = (x.len() - 1, y.len() - 1);
        let (wide, high) = ((x[0], x[right]), (y[0], y[top]));
        self.walls = vec![
            block((x[0], x[1]), high),
            block((x[right - 1], x[right]), high),
            block(wide, (y[0], y[1])),
            block(wide, (y[top - 1], y[top])),
        ];
        for row in 0..rows {
            for column in 0..columns {
                let room = draft.room(column, row);
                let number = row * columns + column;
                if column + 1 < columns {
                    let wall = (room.max.x_m, x[2 * column + 3]);
                    let (low, up) = self.gap(draft, (room.min.y_m, room.max.y_m));
                    // Walls that meet overlap a little: no crack is left between them.
                    let ends = (y[2 * row], y[2 * row + 3]);
                    self.walls.push(block(wall, (ends.0, low)));
                    self.walls.push(block(wall, (up, ends.1)));
                    self.doors.push(Doorway {
                        at: Point::new((wall.0 + wall.1) / 2.0, (low + up) / 2.0),
                        is_along_x: true,
                        rooms: [number, number + 1],
                    });
                }
                if row + 1 < rows {
                    let wall = (room.max.y_m, y[2 * row + 3]);
                    let (left, right) = self.gap(draft, (room.min.x_m, room.max.x_m));
                    let ends = (x[2 * column], x[2 * column + 3]);
                    self.walls.push(block((ends.0, left), wall));
                    self.walls.push(block((right, ends.1), wall));
                    self.doors.push(Doorway {
                        at: Point::new((left + right) / 2.0, (wall.0 + wall.1) / 2.0),
                        is_along_x: false,
                        rooms: [number, number + columns],
                    });
                }
            }
        }
    }

    /// Draws where a door is in a side of a room, to the millimetre.
    fn gap(&self, draft: &mut Draft, (from, to): (f64, f64)) -> (f64, f64) {
        let door_m = self.demand.door_m();
        let low = millimetre(draft.between((from + CORNER_M, to - CORNER_M - door_m)));
        (low, millimetre(low + door_m))
    }

    /// Puts up to two boxes and up to three poles into every room, none of them right before a door.
    fn put_things(&mut self, draft: &mut Draft) {
        for room in self.rooms.clone() {
            for _ in 0..draft.below(3) {
                let corner = draft.point_in(room);
                let (wide_m, deep_m) = (draft.between((0.3, 0.9)), draft.between((0.3, 0.9)));
                let x = (
                    corner.x_m,
                    millimetre((corner.x_m + wide_m).min(room.max.x_m)),
                );
                let y = (
                    corner.y_m,
                    millimetre((corner.y_m + deep_m).min(room.max.y_m)),
                );
                let is_thick = x.1 - x.0 > 0.1 && y.1 - y.0 > 0.1;
                self.put(block(x, y), is_thick);
            }
            for _ in 0..draft.below(4) {
                let (at, radius_m) = (draft.point_in(room), POLES_M[draft.below(POLES_M.len())]);
                self.put(
                    Thing::Pole(at, radius_m),
                    radius_m >= self.demand.thinnest_m,
                );
            }
        }
    }

    fn put(&mut self, thing: Thing, is_wanted: bool) {
        let reach_m = self.demand.door_m();
        let is_before = |door: &Doorway| {
            (-10..=10).any(|step| {
                let along_m = reach_m * f64::from(step) / 10.0;
                let at = if door.is_along_x {
                    Point::new(door.at.x_m + along_m, door.at.y_m)
                } else {
                    Point::new(door.at.x_m, door.at.y_m + along_m)
                };
                thing.distance_m(at) < reach_m / 2.0
            })
        };
        if is_wanted && !self.doors.iter().any(is_before) {
            self.things.push(thing);
        }
    }

    /// Draws a place in a room that is well clear of everything, as far as the room allows.
    fn free_place(&self, draft: &mut Draft, room: usize) -> Point {
        let wanted_m = self.demand.door_m() / 2.0 + 0.1;
        let mut best = self.rooms[room].centre();
        for _ in 0..200 {
            let place = draft.point_in(self.rooms[room]);
            if self.clearance_m(place) >= wanted_m {
                return place;
            }
            if self.clearance_m(place) > self.clearance_m(best) {
                best = place;
            }
        }
        best
    }

    /// Returns the distance of a place from everything, metres; 0 inside.
    pub fn clearance_m(&self, at: Point) -> f64 {
        self.walls
            .iter()
            .chain(&self.things)
            .map(|thing| thing.distance_m(at))
            .fold(f64::INFINITY, f64::min)
    }

    /// Returns whether somebody who keeps so far from everything gets from home to the places in all rooms. A plain search
    /// that shares nothing with the program's.
    pub fn is_open(&self, keep_m: f64) -> bool {
        let (low, high) = self.outside();
        let count = |from_m: f64, to_m: f64| ((to_m - from_m) / STEP_M) as usize + 1;
        let (wide, tall) = (count(low.x_m, high.x_m), count(low.y_m, high.y_m));
        let at = |index: usize| {
            let (x, y) = (index % wide, index / wide);
            Point::new(low.x_m + STEP_M * x as f64, low.y_m + STEP_M * y as f64)
        };
        let nearest = |place: Point| {
            let step = |from_m: f64, to_m: f64| ((to_m - from_m) / STEP_M).round() as usize;
            step(low.y_m, place.y_m) * wide + step(low.x_m, place.x_m)
        };
        let mut is_new = vec![true; wide * tall];
        let mut open = vec![nearest(self.home)];
        is_new[open[0]] = false;
        while let Some(index) = open.pop() {
            for next in [index + 1, index - 1, index + wide, index - wide] {
                // Outside of the outer walls nobody gets.
                if is_new[next] {
                    is_new[next] = false;
                    if self.clearance_m(at(next)) >= keep_m {
                        open.push(next);
                    }
                }
            }
        }
        let is_reached = |place: &Point| {
            !is_new[nearest(*place)] && self.clearance_m(at(nearest(*place))) >= keep_m
        };
        self.places.iter().all(is_reached)
    }

    /// Returns the corners of the fence.
    fn outside(&self) -> (Point, Point) {
        let blocks = || {
            self.walls.iter().filter_map(|wall| match wall {
                Thing::Block(rect) => Some(*rect),
                Thing::Pole(..) => None,
            })
        };
        let low = |of: fn(Rect) -> f64| blocks().map(of).fold(f64::INFINITY, f64::min) - BORDER_M;
        let high =
            |of: fn(Rect) -> f64| blocks().map(of).fold(f64::NEG_INFINITY, f64::max) + BORDER_M;
        (
            Point::new(low(|rect| rect.min.x_m), low(|rect| rect.min.y_m)),
            Point::new(high(|rect| rect.max.x_m), high(|rect| rect.max.y_m)),
        )
    }

    /// Returns its files, by name: scene, venue, and a simulation each of exploring it and of visiting its places.
    pub fn files(&self) -> Vec<(&'static str, String)> {
        let places: Vec<String> = self.places.iter().map(in_toml).collect();
        let pathfind = format!("kind = \"pathfind\"\nwaypoints_m = [{}]", places.join(", "));
        vec![
            ("plan.scene.toml", self.scene()),
            ("plan.venue.toml", self.venue()),
            ("explore.sim.toml", self.sim("kind = \"explore\"")),
            ("pathfind.sim.toml", self.sim(&pathfind)),
        ]
    }

    /// Writes its files into a folder, for a person to look at.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        fs::create_dir_all(folder)?;
        for (name, text) in self.files() {
            fs::write(folder.join(name), text)?;
        }
        Ok(())
    }

    fn scene(&self) -> String {
        let mut text = format!("kind = \"scene\"\nname = \"plan-{}\"\n", self.seed);
        for thing in self.walls.iter().chain(&self.things) {
            let _ = write!(text, "{}", thing.toml());
        }
        text
    }

    fn venue(&self) -> String {
        let (low, high) = self.outside();
        let inner = |from_m: f64, by_m: f64| millimetre(from_m + by_m);
        let area = [
            inner(low.x_m, BORDER_M),
            inner(low.y_m, BORDER_M),
            inner(high.x_m, -BORDER_M),
            inner(high.y_m, -BORDER_M),
        ];
        let corners = [
            low,
            Point::new(high.x_m, low.y_m),
            high,
            Point::new(low.x_m, high.y_m),
        ];
        format!(
            "kind = \"venue\"\nname = \"plan-{}\"\narea_m = {area:?}\nfence_m = [{}]\nhomes_m = [{}]\n\
             [datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\n",
            self.seed,
            corners.each_ref().map(in_toml).join(", "),
            in_toml(&self.home)
        )
    }

    fn sim(&self, mission: &str) -> String {
        let radius_m = 0.25;
        format!(
            "kind = \"sim\"\nvenue = \"plan.venue.toml\"\nscene = \"plan.scene.toml\"\nuntil_s = 20000.0\nseed = {}\n\
             [mission]\n{mission}\n[vehicles]\ncount = 1\nradius_m = {radius_m}\npose_sd_m = {POSE_SD_M}\n\
             [safety]\npadding_m = {}\n",
            self.seed,
            millimetre(self.demand.distance_m - radius_m)
        )
    }
}

fn in_toml(at: &Point) -> String {
    format!("[{:?}, {:?}]", millimetre(at.x_m), millimetre(at.y_m))
}
