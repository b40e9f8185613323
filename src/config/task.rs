//! The section `[mission]`: what every vehicle is out for. Without it vehicles sweep: they follow the plans of the
//! ground station. What a mission does with its places is decided by the vehicle, see `node::mission`.

use super::mission::Planner;
use super::problem::Problems;
use super::section::{COORDINATE_M, Section};
use super::venue::Venue;
use super::waypoint_file::WaypointFile;
use super::{Loader, beside};
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
    Calibrate,
    Fan,
    FanStraight,
    Square,
    Waypoints,
    Forward,
    Browse,
    Search,
    Pathfind,
    Explore,
}

const KINDS: [(&str, Kind); 11] = [
    ("sweep", Kind::Sweep),
    ("calibrate", Kind::Calibrate),
    ("fan", Kind::Fan),
    ("fan-straight", Kind::FanStraight),
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

    /// Reads the section, and the waypoint file that it may name; a square lies in the middle of the venue's area unless
    /// it says where. A sweep may say its planner by that.
    pub(super) fn read(
        section: &Section,
        venue: Option<&Venue>,
        loader: &mut Loader,
    ) -> (Task, Option<Planner>) {
        let area = venue.map(|venue| venue.area);
        let kind = section.choice("kind", Kind::Sweep, &KINDS);
        let task = match kind {
            Kind::Sweep | Kind::Calibrate | Kind::Fan | Kind::FanStraight => Task::Sweep,
            Kind::Square => Task::Legs { places: read_square(section, area) },
            Kind::Waypoints => Task::Legs { places: read_places(section, venue, loader) },
            Kind::Forward => Task::Forward { distance_m: section.number("distance_m", 5.0, 0.1..=1000.0) },
            Kind::Browse => Task::Browse,
            Kind::Search => Task::Search,
            Kind::Pathfind if section.has("waypoints_m") || section.has("file") => {
                Task::Pathfind { places: read_places(section, venue, loader) }
            }
            Kind::Pathfind => {
                let mut places = read_square(section, area);
                places.pop();
                Task::Pathfind { places }
            }
            Kind::Explore => Task::Explore,
        };
        section.finish();
        (task, planner(kind))
    }
}

/// Gives the planner that a kind of sweep needs.
fn planner(kind: Kind) -> Option<Planner> {
    match kind {
        Kind::Calibrate => Some(Planner::Calibrate),
        Kind::Fan => Some(Planner::FanCorners),
        Kind::FanStraight => Some(Planner::FanStraight),
        Kind::Sweep
        | Kind::Square
        | Kind::Waypoints
        | Kind::Forward
        | Kind::Browse
        | Kind::Search
        | Kind::Pathfind
        | Kind::Explore => None,
    }
}

/// Reads places, given as they are or by a file.
fn read_places(section: &Section, venue: Option<&Venue>, loader: &mut Loader) -> Vec<Point> {
    let Some(name) = section.text("file") else {
        return section.required_points("waypoints_m", 1..=MOST_PLACES);
    };
    if section.has("waypoints_m") {
        section.refuse("waypoints_m", "is given beside a file", "one of waypoints_m and file is allowed");
    }
    let path = beside(&section.source.file_of(&section.full("file")), &name);
    let text = match loader(&path) {
        Ok(text) => text,
        Err(reason) => {
            let needed = "a waypoint file (QGC WPL 110) or a plan of QGroundControl is needed";
            section.refuse("file", &format!("{path} cannot be read: {reason}"), needed);
            return Vec::new();
        }
    };
    match (WaypointFile::read(&path, &text), venue) {
        (Err(problems), _) => {
            section.source.absorb(problems);
            Vec::new()
        }
        (Ok(_), None) => Vec::new(),
        (Ok(file), Some(venue)) => places_of(section, &path, &file, venue),
    }
}

/// Gives the places of a waypoint file in the venue's frame; what lies outside the fence is refused by its line.
fn places_of(section: &Section, path: &str, file: &WaypointFile, venue: &Venue) -> Vec<Point> {
    let places = file.points(&venue.plane());
    if places.is_empty() || places.len() > MOST_PLACES {
        let wrong = format!("{path} leads to {} places", places.len());
        section.refuse("file", &wrong, &format!("1 to {MOST_PLACES} places are allowed"));
    }
    let outside = places.iter().filter(|(_, at)| !venue.fence.contains(*at));
    let problem = |(index, at): &(usize, Point)| {
        let wrong = format!("leads to ({:.2}, {:.2}) m, outside the fence of the venue", at.x_m, at.y_m);
        file.problem(path, *index, &wrong, "places inside the fence are allowed")
    };
    let problems: Vec<_> = outside.map(problem).collect();
    if !problems.is_empty() {
        section.source.absorb(Problems::new(path, problems));
        return Vec::new();
    }
    places.into_iter().map(|(_, at)| at).collect()
}

/// Reads a square: its corners as the original's mission drives them, the first north-west, and that again at the end.
fn read_square(section: &Section, area: Option<Rect>) -> Vec<Point> {
    let side_m = area.map_or(10.0, |area| area.width_m().min(area.height_m()));
    let size_m = section.number("size_m", side_m, 0.1..=10_000.0);
    let middle = area.map_or(Point::default(), Rect::centre);
    let centre = section.numbers("centre_m", &[middle.x_m, middle.y_m], 2..=2, COORDINATE_M);
    let middle = Point::new(centre[0], centre[1]);
    let mut corners = Rect::new(middle, middle).shrunk(-0.5 * size_m).corners().to_vec();
    // Clockwise, and not from south-west.
    corners.reverse();
    corners.extend(corners.first().copied());
    corners
}
