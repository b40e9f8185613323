//! What one range reading says about cells: the inverse model of a sensor that sees a cone, written to its own
//! layer.
//!
//! - **Free** are cells of the cone nearer than the echo (by one cell and a margin) and wholly within
//!   `sure_range_m`: farther away a wall seen at a grazing angle gives no echo. This holds with an echo too, since
//!   the echo may come from something behind such a wall. A cell that has been hit is freed only by a cone that
//!   holds all of it, or by the inner half of a cone, so that a beam passing beside a wall's end does not wear it away.
//! - **Hit** are cells on the arc at the echo's distance. Something on the arc answered, not everything: so the
//!   more cells it has the less each is hit (walls are hit again from elsewhere, the rest is freed), and cells that looked free are spared when others of the arc explain the echo better.
//! - Echoes from near a peer are not mapped. The disc of the vehicle itself is free, and the cell that its middle
//!   is in.
//!
//! Not here: glitch filtering (the sensor's business), the reflex stop (the vehicle's).

use std::f64::consts::FRAC_PI_2;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{LayerId, TILE_SIDE, TileAddress};

use super::tile::{LAYER_CLAMP, index_in_tile, origin_of};
use super::window::{CellRect, Sums};
use super::{Merged, Tile};
use crate::geom::{Angle, Cell, Lattice, Point, Segment, Vector};

/// What a look that finds a cell empty adds, 0.1 log-odds.
const FREE: i8 = -4;
/// What an echo adds to a cell when few may have given it, 0.1 log-odds.
const HIT: i8 = 9;
/// What an echo adds to all cells of its arc together, and to each at least: one of them answered, not all.
const ARC_HITS: i8 = 27;
/// What an echo adds to each cell of a wide arc at least, 0.1 log-odds.
const HIT_LEAST: i8 = 3;
/// A cell that looked free is not hit when the likeliest of the arc stands above it by more, 0.1 log-odds.
const EXPLAINED_BY: i16 = 3;
/// Between echo and freed cells stay one cell and this much, metres: the spread of a range reading.
const FREE_MARGIN_M: f64 = 0.1;
/// Readings reach at most this many cells, whatever a sensor claims.
const REACH_CELLS: f64 = 500.0;

/// One range reading with the cone it was taken in.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ScanReading {
    /// Where the sensor was.
    pub origin: Point,
    /// Axis of the cone.
    pub direction: Angle,
    /// Half of the cone's opening, radians, 0 to π/2; 0 = a ray.
    pub half_width_rad: f64,
    /// Distance of the echo, metres; `None` = no echo.
    pub range_m: Option<f64>,
    /// An echo from farther away counts as none, metres.
    pub max_range_m: f64,
    /// Up to here everything gives an echo, at whatever angle it stands, metres. For walls not nearer than c to
    /// the vehicle that answer up to the incidence angle i, this is c / cos i. Cells are freed up to half of their
    /// diagonal less.
    pub sure_range_m: f64,
    /// Nothing is seen nearer than this, metres.
    pub min_range_m: f64,
}

/// The disc that the vehicle itself covers.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct OwnDisc {
    /// Its middle.
    pub at: Point,
    /// Its radius, metres.
    pub radius_m: f64,
}

/// Where a peer may be: on its leg, or at a single point.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PeerBody<'a> {
    /// Corners of its last leg.
    pub leg: &'a [Point],
    /// Its radius plus pose deviations, metres.
    pub radius_m: f64,
}

/// What a reading changed in its own layer.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Changes {
    /// Tiles with a new revision, ascending.
    pub changed: Vec<TileAddress>,
    /// Those of them in which a merged cell became occupied: to be sent at once.
    pub newly_occupied: Vec<TileAddress>,
}

impl Changes {
    /// Returns whether nothing changed.
    pub fn is_empty(&self) -> bool {
        self.changed.is_empty()
    }
}

/// Writes readings to its own layer of a map. Keeps nothing but scratch memory from one to the next.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Mapper {
    own: LayerId,
    slice: i16,
    #[serde(skip)]
    marks: Vec<Mark>,
    #[serde(skip)]
    arc: Vec<ArcCell>,
    #[serde(skip)]
    writes: Vec<(usize, i8, i8)>,
}

/// A new value for a cell of its own layer.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
struct Mark {
    address: TileAddress,
    index: usize,
    old: i8,
    new: i8,
}

/// A cell which the echo may have come from.
#[derive(Clone, Copy, Debug)]
struct ArcCell {
    mark: Mark,
    centre: Point,
    merged: i16,
}

/// The tile whose cells are being judged, as it was before.
struct Judged<'a> {
    address: TileAddress,
    own: Option<&'a Tile>,
    sums: Option<&'a Sums>,
}

/// What a reading says about one cell.
enum CellReading {
    Nothing,
    Free,
    Hit,
}

impl Mapper {
    /// Makes a mapper that writes the layer `own` at an altitude slice.
    pub fn new(own: LayerId, slice: i16) -> Mapper {
        Mapper {
            own,
            slice,
            marks: Vec::new(),
            arc: Vec::new(),
            writes: Vec::new(),
        }
    }

    /// Writes one reading, each cell at most once. Readings with values that are not finite are ignored.
    pub fn record(
        &mut self,
        map: &mut Merged,
        scan: &ScanReading,
        body: OwnDisc,
        peers: &[PeerBody<'_>],
    ) -> Changes {
        let Some(cone) = Cone::of(scan, map.lattice()) else {
            return Changes::default();
        };
        self.marks.clear();
        self.arc.clear();
        let body = body.within_reach(&cone);
        let footprint = Footprint::of(body, cone.lattice);
        let area = cone.area(body);
        let (columns, rows) = area.tiles();
        for y in rows {
            for x in columns.clone() {
                let address = TileAddress {
                    slice: self.slice,
                    x,
                    y,
                };
                self.judge_tile(map, &cone, &footprint, area, address);
            }
        }
        self.mark_hits(&cone, peers);
        self.write(map)
    }

    /// Judges the cells of one tile that lie within `area`.
    fn judge_tile(
        &mut self,
        map: &Merged,
        cone: &Cone,
        body: &Footprint,
        area: CellRect,
        address: TileAddress,
    ) {
        let own = map.layer(self.own).and_then(|layer| layer.tile(address));
        let tile = Judged {
            address,
            own,
            sums: map.sums(address),
        };
        let first = origin_of(address);
        let last = Cell::new(
            first.x + TILE_SIDE as i32 - 1,
            first.y + TILE_SIDE as i32 - 1,
        );
        for y in first.y.max(area.low.y)..=last.y.min(area.high.y) {
            for x in first.x.max(area.low.x)..=last.x.min(area.high.x) {
                self.judge_cell(cone, body, Cell::new(x, y), &tile);
            }
        }
    }

    #[inline]
    fn judge_cell(&mut self, cone: &Cone, body: &Footprint, cell: Cell, tile: &Judged<'_>) {
        let Judged { address, own, sums } = *tile;
        let centre = cone.lattice.centre(cell);
        let index = index_in_tile(cell);
        let old = own.map_or(0, |tile| tile.cells[index]);
        match if body.covers(cell, centre) {
            CellReading::Free
        } else {
            cone.says(cell, centre - cone.origin, old)
        } {
            CellReading::Nothing => {}
            CellReading::Free => {
                let new = (old + FREE).max(-LAYER_CLAMP);
                if new != old {
                    self.marks.push(Mark {
                        address,
                        index,
                        old,
                        new,
                    });
                }
            }
            CellReading::Hit => {
                let mark = Mark {
                    address,
                    index,
                    old,
                    new: old,
                };
                self.arc.push(ArcCell {
                    mark,
                    centre,
                    merged: sums.map_or(0, |sums| sums[index]),
                });
            }
        }
    }

    /// Picks those cells of the arc that are hit: none when a peer may have answered.
    fn mark_hits(&mut self, cone: &Cone, peers: &[PeerBody<'_>]) {
        let Some(likeliest) = self.arc.iter().map(|cell| cell.merged).max() else {
            return;
        };
        let near_peer = |peer: &PeerBody<'_>| {
            self.arc
                .iter()
                .any(|cell| peer.reaches(cell.centre, cone.half_cell_m))
        };
        if peers.iter().any(near_peer) {
            return;
        }
        let hit = || {
            self.arc
                .iter()
                .filter(|cell| cell.merged >= likeliest.min(EXPLAINED_BY) - EXPLAINED_BY)
        };
        let cells = i8::try_from(hit().count()).unwrap_or(i8::MAX);
        let weight = (ARC_HITS / cells).clamp(HIT_LEAST, HIT);
        let marks = hit().map(|cell| Mark {
            new: (cell.mark.old + weight).min(LAYER_CLAMP),
            ..cell.mark
        });
        self.marks.extend(marks.filter(|mark| mark.new != mark.old));
    }

    fn write(&mut self, map: &mut Merged) -> Changes {
        // Tiles were judged in order, but the hits stand behind the freed cells.
        self.marks.sort_unstable();
        let mut changes = Changes::default();
        for marks in self.marks.chunk_by(|a, b| a.address == b.address) {
            let address = marks[0].address;
            self.writes.clear();
            self.writes
                .extend(marks.iter().map(|mark| (mark.index, mark.old, mark.new)));
            let newly_occupied = map.write(self.own, address, &self.writes);
            changes.changed.push(address);
            if newly_occupied {
                changes.newly_occupied.push(address);
            }
        }
        changes
    }
}

impl OwnDisc {
    /// Returns the body, or one of no size when it is impossibly large or far from the sensor.
    fn within_reach(self, cone: &Cone) -> OwnDisc {
        let reach_m = REACH_CELLS * cone.lattice.cell_m();
        let near =
            self.at.distance_to(cone.origin) <= reach_m && (0.0..=reach_m).contains(&self.radius_m);
        if near {
            self
        } else {
            OwnDisc {
                at: cone.origin,
                radius_m: 0.0,
            }
        }
    }
}

/// The disc of the vehicle prepared for judging cells.
struct Footprint {
    at: Point,
    /// The cell that its middle is in.
    cell: Cell,
    radius_m2: f64,
}

impl Footprint {
    fn of(body: OwnDisc, lattice: Lattice) -> Footprint {
        let OwnDisc { at, radius_m } = body;
        Footprint {
            at,
            cell: lattice.cell_at(at),
            radius_m2: radius_m * radius_m,
        }
    }

    /// Returns whether the vehicle stands on a cell with this middle.
    #[inline]
    fn covers(&self, cell: Cell, centre: Point) -> bool {
        let from_middle = centre - self.at;
        self.cell == cell || from_middle.dot(from_middle) <= self.radius_m2
    }
}

impl PeerBody<'_> {
    fn reaches(&self, point: Point, spread_m: f64) -> bool {
        let reach_m = self.radius_m + spread_m;
        let near = |leg: Segment| leg.distance_to_point(point) <= reach_m;
        match self.leg {
            [at] => at.distance_to(point) <= reach_m,
            corners => corners
                .windows(2)
                .any(|pair| near(Segment::new(pair[0], pair[1]))),
        }
    }
}

/// A reading prepared for judging cells.
struct Cone {
    lattice: Lattice,
    origin: Point,
    axis: Vector,
    /// The cell on the axis at the echo's distance: hit even where no cell's middle lies on a narrow arc.
    struck: Option<Cell>,
    half_cell_m: f64,
    /// Half of a cell's diagonal.
    half_diagonal_m: f64,
    sin: f64,
    cos: f64,
    tan: f64,
    /// Tangent of half of the half-width.
    tan_half: f64,
    /// Squares of the distances between which cells are free.
    free_m2: (f64, f64),
    /// Squares of the distances between which cells are hit.
    hit_m2: (f64, f64),
    /// Nothing farther away is judged.
    reach_m: f64,
}

impl Cone {
    fn of(scan: &ScanReading, lattice: Lattice) -> Option<Cone> {
        let bounds_m =
            scan.max_range_m + scan.sure_range_m + scan.min_range_m + scan.half_width_rad;
        let range_finite = scan
            .range_m
            .is_none_or(|range_m| range_m.is_finite() && range_m >= 0.0);
        if !scan.origin.is_finite() || !bounds_m.is_finite() || !range_finite {
            return None;
        }
        let half_cell_m = lattice.cell_m() / 2.0;
        let farthest_m = scan.max_range_m.min(REACH_CELLS * lattice.cell_m());
        let echo_m = scan.range_m.filter(|range_m| *range_m <= farthest_m);
        let clear_m = echo_m.map_or(farthest_m, |echo_m| {
            echo_m - lattice.cell_m() - FREE_MARGIN_M
        });
        let half_diagonal_m = half_cell_m * std::f64::consts::SQRT_2;
        let free_to_m = clear_m.min(scan.sure_range_m.min(farthest_m) - half_diagonal_m);
        let reach_m = echo_m
            .map_or(free_to_m, |echo_m| echo_m + half_cell_m)
            .max(0.0);
        // Just under a quarter turn, so that the tangent stays finite.
        let half_width_rad = scan.half_width_rad.clamp(0.0, FRAC_PI_2 - 1e-6);
        let (sin, cos) = libm::sincos(half_width_rad);
        let axis = Vector::polar(scan.direction, 1.0);
        Some(Cone {
            lattice,
            origin: scan.origin,
            axis,
            struck: echo_m.map(|echo_m| lattice.cell_at(scan.origin + axis * echo_m)),
            half_cell_m,
            half_diagonal_m,
            sin,
            cos,
            tan: sin / cos,
            tan_half: sin / (1.0 + cos),
            free_m2: (square(scan.min_range_m), square(free_to_m)),
            hit_m2: echo_m.map_or((1.0, 0.0), |echo_m| {
                (square(echo_m - half_cell_m), square(echo_m + half_cell_m))
            }),
            reach_m,
        })
    }

    /// Returns cells around all that can be judged: the cone lies within the hull of its tip, its edges and the
    /// tangents at half of its half-width.
    fn area(&self, body: OwnDisc) -> CellRect {
        let (ahead, aside) = (self.axis * self.reach_m, self.axis.left() * self.reach_m);
        let edge = |side: f64| ahead * self.cos + aside * (self.sin * side);
        let tangent = |side: f64| ahead + aside * (self.tan_half * side);
        let corners = [
            Vector::default(),
            edge(1.0),
            edge(-1.0),
            tangent(1.0),
            tangent(-1.0),
        ]
        .map(|to| self.origin + to);
        let around =
            |points: &[Point], margin_m: f64| CellRect::around(self.lattice, points, margin_m);
        let own = CellRect::new(
            self.lattice.cell_at(self.origin),
            self.lattice.cell_at(self.origin),
        );
        let cone = around(&corners, self.half_cell_m).unwrap_or(own);
        around(&[body.at], body.radius_m).map_or(cone, |disc| disc.join(cone))
    }

    /// Judges a cell by its middle as seen from the sensor, and by its old value in its own layer.
    #[inline]
    fn says(&self, cell: Cell, to: Vector, old: i8) -> CellReading {
        if self.struck == Some(cell) {
            return CellReading::Hit;
        }
        let (ahead_m, aside_m) = (self.axis.dot(to), self.axis.cross(to).abs());
        if ahead_m <= 0.0 || (aside_m > ahead_m * self.tan && aside_m > self.half_cell_m) {
            return CellReading::Nothing;
        }
        let distance_m2 = to.dot(to);
        if (self.hit_m2.0..=self.hit_m2.1).contains(&distance_m2) {
            return CellReading::Hit;
        }
        if !(self.free_m2.0..=self.free_m2.1).contains(&distance_m2) {
            return CellReading::Nothing;
        }
        let holds_it = aside_m <= ahead_m * self.tan_half
            || ahead_m * self.sin - aside_m * self.cos >= self.half_diagonal_m;
        if old > 0 && !holds_it {
            CellReading::Nothing
        } else {
            CellReading::Free
        }
    }
}

/// The square of a distance; 0 for negative ones.
fn square(metres: f64) -> f64 {
    metres.max(0.0) * metres.max(0.0)
}

#[cfg(test)]
mod tests;
