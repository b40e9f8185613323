//! The shared description of a place: every node of a swarm reads the same venue file, and its hash
//! is how they notice when they do not. Knows nothing of what stands there (that is the scene).

use std::hash::Hasher;

use fnv::FnvHasher;
use tomoswarm_proto::TILE_SIDE;

use super::FileLine;
use super::forms::{Name, RequiredPlaces, places};
use super::keys::{
    Form, KeyEntry, Keyed, Keys, MaybeTable, Number, NumberBounds, Numbers, number, read_table,
    written_list,
};
use super::outline::{CORNERS, simple_polygon};
use super::section::{COORDINATE_M, Section};
use super::swarm::Swarm;
use crate::geom::{Bearing, Geodetic, Point, Polygon, Rect, Segment, TangentPlane, without_dust};
use crate::map::REACH_TILES;

/// The most homes of a venue; vehicle ids are one byte.
const MOST_HOMES: usize = 250;
/// The smallest distance between two homes, metres.
const HOMES_APART_M: f64 = 1.0;
/// What is no farther from the fence than this lies on it, metres.
const ON_FENCE_M: f64 = 1e-3;
/// The most cells along one side of the fence, so that a map stays within memory.
const MOST_CELLS_A_SIDE: f64 = 10_000.0;

/// Where the local frame lies on the earth.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Datum {
    /// Latitude of the frame's origin, degrees north (WGS84).
    pub latitude_deg: f64,
    /// Longitude of the frame's origin, degrees east (WGS84).
    pub longitude_deg: f64,
    /// Height of z = 0, metres above the ellipsoid (WGS84).
    pub altitude_m: f64,
}

impl Datum {
    /// Returns the place on the earth.
    pub fn geodetic(self) -> Geodetic {
        let Datum {
            latitude_deg,
            longitude_deg,
            altitude_m,
        } = self;
        Geodetic {
            latitude_deg,
            longitude_deg,
            altitude_m,
        }
    }
}

/// A place where a swarm works; all coordinates are metres in its local frame (x, y in the plane).
#[derive(Clone, PartialEq, Debug)]
pub struct Venue {
    /// A plain name, fit to be part of a file's name.
    pub name: String,
    /// Where the frame's origin lies.
    pub datum: Datum,
    /// Compass bearing of the x axis (90 = x points east), degrees.
    pub x_axis_bearing_deg: f64,
    /// The rectangle that is imaged.
    pub area: Rect,
    /// Where vehicles may be; a simple polygon with the area wholly inside.
    pub fence: Polygon,
    /// Where vehicles start and return to; vehicle 1 has the first.
    pub homes: Vec<Point>,
    /// Side of a map cell, metres.
    pub cell_m: f64,
    /// Heights between which one map slice lies, metres above z = 0, ascending; n + 1 borders make n
    /// slices.
    pub slice_borders_m: Vec<f64>,
    /// The greatest height at which a vehicle may fly, metres above z = 0.
    pub ceiling_m: f64,
    /// What the nodes of the swarm agree on.
    pub swarm: Swarm,
}

impl Venue {
    /// Returns a venue of nothing, to be filled.
    pub(super) fn blank() -> Venue {
        let (nowhere, no_corners) = (Point::default(), Vec::new());
        Venue {
            name: String::new(),
            datum: Datum::default(),
            x_axis_bearing_deg: 0.0,
            area: Rect::new(nowhere, nowhere),
            fence: Polygon::new(no_corners),
            homes: Vec::new(),
            cell_m: 0.0,
            slice_borders_m: Vec::new(),
            ceiling_m: 0.0,
            swarm: Swarm::default(),
        }
    }

    /// Returns the compass bearing of the x axis (90° = x points east).
    pub fn x_axis_bearing(&self) -> Bearing {
        Bearing::from_degrees(self.x_axis_bearing_deg)
    }

    /// Returns a hash over everything that must be equal on all nodes: all but the name. Comments,
    /// layout and the order of keys do not count. (FNV-1a, 64 bits, over the IEEE bytes.)
    pub fn hash(&self) -> u64 {
        let Datum {
            latitude_deg,
            longitude_deg,
            altitude_m,
        } = self.datum;
        let mut hash = Hash::default();
        hash.numbers(&[
            latitude_deg,
            longitude_deg,
            altitude_m,
            self.x_axis_bearing().radians(),
        ]);
        hash.points(&[self.area.min, self.area.max]);
        hash.points(self.fence.corners());
        hash.points(&self.homes);
        hash.numbers(&[self.cell_m, self.ceiling_m]);
        hash.numbers(&self.slice_borders_m);
        if let Some(contract) = self.swarm.hashed() {
            hash.numbers(&contract);
        }
        hash.0.finish()
    }

    /// Returns in words that a place lies outside the fence; `None` = it lies inside, or on it.
    pub fn refusal_of(&self, at: Point) -> Option<String> {
        let is_outside = !self.fence.contains(at) && self.fence.distance_to_edge(at) > ON_FENCE_M;
        let reach = Rect::around(self.fence.corners().iter().copied())?;
        let (Rect { min, max }, Point { x_m, y_m }) = (reach, at);
        is_outside.then(|| {
            format!(
                "({x_m}, {y_m}) lies outside the fence, which reaches from ({}, {}) to ({}, {}), metres",
                min.x_m, min.y_m, max.x_m, max.y_m
            )
        })
    }

    /// Returns the plane of the local frame on the earth.
    pub fn plane(&self) -> TangentPlane {
        TangentPlane::new(self.datum.geodetic(), self.x_axis_bearing())
    }

    /// Reads a venue; what is wrong is noted at the source.
    pub(super) fn read(root: &Section<'_>) -> Venue {
        root.require(
            "datum",
            "a table [datum] with latitude_deg and longitude_deg is needed",
        );
        let mut venue = Venue::blank();
        read_table(&mut venue, root);
        check_slices(root, &venue.slice_borders_m);
        venue.swarm.check(root.source, "swarm");
        if root.source.is_sound(&["area_m", "fence_m"]) {
            check_area(root, &venue);
        }
        if root.source.is_sound(&["homes_m", "fence_m"]) {
            check_homes(root, &venue);
        }
        venue
    }

    /// Returns where the homes of a venue stand in its file.
    pub(super) fn lines_of_homes(root: &Section<'_>) -> Vec<FileLine> {
        let homes = root.list("homes_m").unwrap_or_default().iter();
        let lines = homes.map(|home| root.source.line_of(home.span()));
        lines.map(|line| root.source.file_line(line)).collect()
    }
}

impl Keyed for Venue {
    fn keys(&mut self, to: &mut dyn Keys) {
        let Venue {
            name,
            datum,
            x_axis_bearing_deg,
            area,
            fence,
            homes,
            cell_m,
            slice_borders_m,
            ceiling_m,
            swarm,
        } = self;
        let means = "a plain name, fit to be part of a file's name";
        let mut plain = Name {
            name,
            default: "venue".to_owned(),
        };
        to.form(
            &mut plain,
            KeyEntry {
                name: "name",
                left_out: "venue",
                means,
            },
        );
        to.maybe_table(
            &mut DatumTable(datum),
            KeyEntry {
                name: "datum",
                left_out: "needed",
                means: "where (0, 0) lies on the earth",
            },
        );
        to.number(x_axis_bearing_deg, Number {
            name: "x_axis_bearing_deg",
            default: 90.0,
            allowed: 0.0..=360.0,
            means: "compass bearing of the x axis; 90: x points east. It turns files of waypoints and the wind, and is part of the \
                        venue's hash",
        });
        let left_out = "needed";
        let means = "`[x0, y0, x1, y1]`: what is imaged; vehicles drive along its border";
        to.form(
            &mut Area(area),
            KeyEntry {
                name: "area_m",
                left_out,
                means,
            },
        );
        let means = "corners `[[x, y], …]` around where vehicles may be";
        to.form(
            &mut Fence(fence),
            KeyEntry {
                name: "fence_m",
                left_out,
                means,
            },
        );
        let means = "where vehicles start and return to, one each; vehicle 1 has the first";
        let mut all = RequiredPlaces {
            places: homes,
            count: 1..=MOST_HOMES,
        };
        to.form(
            &mut all,
            KeyEntry {
                name: "homes_m",
                left_out,
                means,
            },
        );
        let means = "side of a map cell";
        to.number(
            cell_m,
            Number {
                name: "cell_m",
                default: 0.2,
                allowed: 0.05..=2.0,
                means,
            },
        );
        to.numbers(slice_borders_m, Numbers {
            name: "altitude_slices_m",
            default: &[0.0, 2.0],
            count: 2..=17,
            allowed: -10.0..=500.0,
            means: "borders of the map's slices, ascending; no effect yet but in the venue's hash: rovers use one slice",
        });
        let means = "highest altitude of a vehicle";
        to.number(
            ceiling_m,
            Number {
                name: "ceiling_m",
                default: 10.0,
                allowed: 0.5..=500.0,
                means,
            },
        );
        let means = "what all nodes agree on. A simulation may give these keys but `lost_after_s` in its own `[safety]` and \
                     `[radio]`, laid over its venue; the files of nodes may not";
        to.table(
            swarm,
            KeyEntry {
                name: "swarm",
                left_out: "",
                means,
            },
        );
    }
}

/// The table `[datum]`, which must be there.
struct DatumTable<'a>(&'a mut Datum);

impl MaybeTable for DatumTable<'_> {
    fn get(&mut self) -> Option<&mut dyn Keyed> {
        Some(self.0)
    }

    fn fill(&mut self) -> &mut dyn Keyed {
        self.0
    }
}

impl Keyed for Datum {
    fn keys(&mut self, to: &mut dyn Keys) {
        let Datum {
            latitude_deg,
            longitude_deg,
            altitude_m,
        } = self;
        let needed = |name, allowed, means| NumberBounds {
            name,
            left_out: "needed",
            allowed,
            means,
        };
        // A local frame has no axes at the poles.
        to.needed_number(
            latitude_deg,
            needed("latitude_deg", -89.0..=89.0, "north (WGS84)"),
        );
        to.needed_number(
            longitude_deg,
            needed("longitude_deg", -180.0..=180.0, "east (WGS84)"),
        );
        let means = "of z = 0 above the ellipsoid (WGS84)";
        to.number(
            altitude_m,
            Number {
                name: "altitude_m",
                default: 0.0,
                allowed: -500.0..=9000.0,
                means,
            },
        );
    }
}

/// The rectangle that is imaged.
pub(super) struct Area<'a>(pub(super) &'a mut Rect);

impl Form for Area<'_> {
    fn to_toml(&self) -> Option<String> {
        let Rect { min, max } = *self.0;
        Some(written_list(
            [min.x_m, min.y_m, max.x_m, max.y_m].into_iter().map(number),
        ))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        *self.0 = read_area(section, key);
    }
}

/// The outline that vehicles do not leave.
struct Fence<'a>(&'a mut Polygon);

impl Form for Fence<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(places(self.0.corners()))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        *self.0 = read_fence(section, key);
    }
}

fn read_area(root: &Section<'_>, key: &'static str) -> Rect {
    let rule = "[x0, y0, x1, y1] in metres is needed";
    root.require(key, rule);
    let nothing = Rect::new(Point::default(), Point::default());
    let Some(numbers) = root.optional_numbers(key, 4..=4, COORDINATE_M) else {
        return nothing;
    };
    let (width_m, height_m) = (numbers[2] - numbers[0], numbers[3] - numbers[1]);
    if width_m <= 0.0 || height_m <= 0.0 {
        root.refuse(
            key,
            "the first corner is not south-west of the second",
            rule,
        );
        return nothing;
    }
    if !(1.0..=1000.0).contains(&width_m) || !(1.0..=1000.0).contains(&height_m) {
        let (width_m, height_m) = (without_dust(width_m), without_dust(height_m));
        let wrong = format!("the area is {width_m} m by {height_m} m");
        root.refuse(key, &wrong, "sides from 1 to 1000 m are allowed");
    }
    Rect::new(
        Point::new(numbers[0], numbers[1]),
        Point::new(numbers[2], numbers[3]),
    )
}

fn read_fence(root: &Section<'_>, key: &'static str) -> Polygon {
    let corners = root.required_points(key, CORNERS);
    if corners.is_empty() {
        return Polygon::new(corners);
    }
    simple_polygon(corners).unwrap_or_else(|wrong| {
        root.refuse(
            key,
            &wrong,
            "corners in order around a simple outline are needed",
        );
        Polygon::new(Vec::new())
    })
}

fn check_slices(root: &Section<'_>, borders_m: &[f64]) {
    if borders_m.windows(2).any(|pair| pair[1] - pair[0] < 0.1) {
        let allowed = "each border must lie at least 0.1 m above the one before";
        root.refuse("altitude_slices_m", "the borders do not ascend", allowed);
    }
}

fn check_area(root: &Section, venue: &Venue) {
    let corners = venue.area.corners();
    for (index, from) in corners.iter().enumerate() {
        let side = Segment::new(*from, corners[(index + 1) % corners.len()]);
        if !venue.fence.contains_corridor(side, 0.01) {
            let wrong = format!(
                "its {} side leaves the fence",
                ["south", "east", "north", "west"][index]
            );
            root.refuse("area_m", &wrong, "the area must lie wholly inside fence_m");
            return;
        }
    }
    let reach_m = |coordinate: fn(&Point) -> f64| {
        let all = || venue.fence.corners().iter().map(coordinate);
        all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min)
    };
    let longest_m = reach_m(|point| point.x_m).max(reach_m(|point| point.y_m));
    if longest_m / venue.cell_m > MOST_CELLS_A_SIDE {
        let longest_m = without_dust(longest_m);
        let wrong = format!("the fence is {longest_m} m long, over {MOST_CELLS_A_SIDE} cells");
        root.refuse("fence_m", &wrong, "make cell_m larger or the fence smaller");
    }
    let reach_m = f64::from(REACH_TILES) * TILE_SIDE as f64 * venue.cell_m;
    let is_far = |corner: &Point| corner.x_m.abs().max(corner.y_m.abs()) >= reach_m;
    if venue.fence.corners().iter().any(is_far) {
        let wrong =
            format!("the fence lies beyond the map, which reaches {reach_m:.0} m from the datum");
        root.refuse(
            "fence_m",
            &wrong,
            "put the datum nearer to the place, or make cell_m larger",
        );
    }
}

fn check_homes(root: &Section, venue: &Venue) {
    for (index, home) in venue.homes.iter().enumerate() {
        let number = index + 1;
        let Point { x_m, y_m } = *home;
        if !venue.fence.contains_disc(*home, 0.01) {
            let wrong = format!("home {number} ({x_m}, {y_m}) lies outside the fence");
            root.refuse("homes_m", &wrong, "every home must lie inside fence_m");
        }
        let earlier = venue.homes.iter().take(index);
        let nearest = earlier
            .enumerate()
            .find(|(_, other)| other.distance_to(*home) < HOMES_APART_M);
        if let Some((other, _)) = nearest {
            let wrong = format!(
                "homes {} and {number} are too near to each other",
                other + 1
            );
            root.refuse("homes_m", &wrong, "homes must be at least 1 m apart");
        }
    }
}

/// The FNV-1a hash of what all nodes must agree on.
#[derive(Default)]
struct Hash(FnvHasher);

impl Hash {
    /// Takes in a list; its length too, so that neighbouring lists cannot be cut differently.
    fn numbers(&mut self, numbers: &[f64]) {
        self.0.write(&(numbers.len() as u64).to_le_bytes());
        for number in numbers {
            // Adding zero makes −0 and 0 the same.
            self.0.write(&(number + 0.0).to_bits().to_le_bytes());
        }
    }

    fn points(&mut self, points: &[Point]) {
        let numbers: Vec<f64> = points
            .iter()
            .flat_map(|point| [point.x_m, point.y_m])
            .collect();
        self.numbers(&numbers);
    }
}
