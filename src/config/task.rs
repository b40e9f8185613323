//! The section `[mission]`: what every vehicle is out for. Without it vehicles sweep: they follow the plans of the
//! ground station. What a mission does with its places is decided by the vehicle, see `node::mission`.

use super::section::{COORDINATE_M, Section};
use crate::geom::{Point, Rect};

/// The most places of a mission.
const MOST_PLACES: usize = 1000;

/// What a vehicle is out for.
#[derive(Clone, PartialEq, Debug, Default)]
pub enum Task {
    /// It follows the plans of the ground station and measures.
    #[default]
    Sweep,
    /// Straight from place to place, and it ends in front of what stands there. The first is the first for vehicle 1,
    /// the second for vehicle 2, and so on.
    Legs {
        /// The places, metres in the venue's frame.
        places: Vec<Point>,
    },
    /// Straight ahead as it stands.
    Forward {
        /// How far, metres.
        distance_m: f64,
    },
    /// It looks around where it stands.
    Browse,
    /// It looks at everything that it can get to, what is near to objects first.
    Search,
    /// It visits places on paths around what it sees; the vehicles share them.
    Pathfind {
        /// The places, metres in the venue's frame.
        places: Vec<Point>,
    },
    /// All vehicles together look at everything that can be reached.
    Explore,
}

/// The words for the kinds of missions.
#[derive(Clone, Copy)]
enum Kind {
    Sweep,
    Square,
    Waypoints,
    Forward,
    Browse,
    Search,
    Pathfind,
    Explore,
}

const KINDS: [(&str, Kind); 8] = [
    ("sweep", Kind::Sweep),
    ("square", Kind::Square),
    ("waypoints", Kind::Waypoints),
    ("forward", Kind::Forward),
    ("browse", Kind::Browse),
    ("search", Kind::Search),
    ("pathfind", Kind::Pathfind),
    ("explore", Kind::Explore),
];

impl Task {
    /// Tells whether the ground station plans it.
    pub fn is_planned_by_ground(&self) -> bool {
        match self {
            Task::Sweep => true,
            Task::Legs { .. }
            | Task::Forward { .. }
            | Task::Browse
            | Task::Search
            | Task::Pathfind { .. }
            | Task::Explore => false,
        }
    }

    /// Gives the places that it names.
    pub fn places(&self) -> &[Point] {
        match self {
            Task::Legs { places } | Task::Pathfind { places } => places,
            Task::Sweep | Task::Forward { .. } | Task::Browse | Task::Search | Task::Explore => &[],
        }
    }

    /// Reads the section; a square lies in the middle of `area` unless it says where.
    pub(super) fn read(section: &Section, area: Option<Rect>) -> Task {
        let task = match section.choice("kind", Kind::Sweep, &KINDS) {
            Kind::Sweep => Task::Sweep,
            Kind::Square => Task::Legs { places: closed(read_square(section, area)) },
            Kind::Waypoints => Task::Legs { places: section.required_points("waypoints_m", 1..=MOST_PLACES) },
            Kind::Forward => Task::Forward { distance_m: section.number("distance_m", 5.0, 0.1..=1000.0) },
            Kind::Browse => Task::Browse,
            Kind::Search => Task::Search,
            Kind::Pathfind if section.has("waypoints_m") => {
                Task::Pathfind { places: section.required_points("waypoints_m", 1..=MOST_PLACES) }
            }
            Kind::Pathfind => Task::Pathfind { places: read_square(section, area) },
            Kind::Explore => Task::Explore,
        };
        section.finish();
        task
    }
}

/// Reads a square: its corners as the original's mission drives them, the first north-west.
fn read_square(section: &Section, area: Option<Rect>) -> Vec<Point> {
    let side_m = area.map_or(10.0, |area| area.width_m().min(area.height_m()));
    let half_m = 0.5 * section.number("size_m", side_m, 0.1..=10_000.0);
    let middle = area.map_or(Point::default(), Rect::centre);
    let centre = section.numbers("centre_m", &[middle.x_m, middle.y_m], 2..=2, COORDINATE_M);
    let corner = |east: f64, north: f64| Point::new(centre[0] + east * half_m, centre[1] + north * half_m);
    vec![corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0)]
}

/// Ends a round where it began.
fn closed(mut places: Vec<Point>) -> Vec<Point> {
    places.extend(places.first().copied());
    places
}
