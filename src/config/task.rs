//! The section `[mission]`: what every vehicle is out for. Without it vehicles sweep: they follow the plans of the
//! ground station. How a mission travels, and what of it is whose, stands here as well: files, operators and vehicles have
//! one type for it. What a mission does with its places is decided by the vehicle, see `node::mission`.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{self as proto, Position, TaskKind};

use super::Loader;
use super::forms::{FileName, MaybePlace, places};
use super::keys::{Bounds, Choice, Entry, Form, Keyed, Keys, Number, Words};
use super::mission::Planner;
use super::problem::Problems;
use super::section::Section;
use super::source::Source;
use super::venue::Venue;
use super::waypoint_file::WaypointFile;
use crate::geom::{Point, Rect};

/// The most places of a mission.
const MOST_PLACES: usize = 1000;

/// What a vehicle is out for; places in metres in the venue's frame. A recording of a vehicle has the order of the variants.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub enum Task {
    /// It follows the plans of the ground station and measures.
    #[default]
    Sweep,
    /// Straight from place to place, and it ends in front of what stands there. The first is the first for vehicle 1,
    /// the second for vehicle 2, and so on.
    Legs(Vec<Point>),
    /// Straight ahead as it stands, so far, metres; it ends in front of what stands there.
    Forward(f64),
    /// It looks around where it stands.
    Browse,
    /// It visits places on paths around what it sees; the vehicles share them.
    Pathfind(Vec<Point>),
    /// It looks at everything that it can get to, what is near to objects first.
    Search,
    /// All vehicles together look at everything that can be reached.
    Explore,
}

/// The words for the kinds of missions.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum MissionKind {
    /// As the ground station plans.
    #[default]
    Sweep,
    /// A sweep by the original's calibration.
    Calibrate,
    /// A sweep by the original's fan.
    Fan,
    /// A sweep by the original's straight fan.
    FanStraight,
    /// Straight around a square.
    Square,
    /// Straight from place to place.
    Waypoints,
    /// Straight ahead.
    Forward,
    /// A look around.
    Browse,
    /// All that can be reached, near to objects first.
    Search,
    /// Places on paths around what is seen.
    Pathfind,
    /// All that can be reached, together.
    Explore,
}

impl Choice for MissionKind {
    const WORDS: &'static [(&'static str, MissionKind)] = &[
        ("sweep", MissionKind::Sweep),
        ("calibrate", MissionKind::Calibrate),
        ("fan", MissionKind::Fan),
        ("fan-straight", MissionKind::FanStraight),
        ("square", MissionKind::Square),
        ("waypoints", MissionKind::Waypoints),
        ("forward", MissionKind::Forward),
        ("browse", MissionKind::Browse),
        ("search", MissionKind::Search),
        ("pathfind", MissionKind::Pathfind),
        ("explore", MissionKind::Explore),
    ];
}

/// The table `[mission]` as it is written; [`Task`] is what follows from it.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Mission {
    /// Which mission.
    pub kind: MissionKind,
    /// Side of the square, metres.
    pub size_m: Option<f64>,
    /// Middle of the square.
    pub centre_m: Option<Point>,
    /// The places, unless a file says them.
    pub waypoints_m: Vec<Point>,
    /// The file of places.
    pub file: Option<String>,
    /// How far straight ahead, metres.
    pub distance_m: f64,
}

impl Mission {
    /// Returns a mission of every kind, for those who want to see all keys.
    pub(super) fn each() -> Vec<Mission> {
        MissionKind::WORDS.iter().map(|(_, kind)| Mission { kind: *kind, ..Mission::default() }).collect()
    }

    /// Returns whether the ground station plans it.
    pub(super) fn is_planned_by_ground(&self) -> bool {
        match self.kind {
            MissionKind::Sweep | MissionKind::Calibrate | MissionKind::Fan | MissionKind::FanStraight => true,
            MissionKind::Square
            | MissionKind::Waypoints
            | MissionKind::Forward
            | MissionKind::Browse
            | MissionKind::Search
            | MissionKind::Pathfind
            | MissionKind::Explore => false,
        }
    }

    /// Returns the planner that its kind of sweep needs.
    pub(super) fn planner(&self) -> Option<Planner> {
        match self.kind {
            MissionKind::Calibrate => Some(Planner::Calibrate),
            MissionKind::Fan => Some(Planner::FanCorners),
            MissionKind::FanStraight => Some(Planner::FanStraight),
            MissionKind::Sweep
            | MissionKind::Square
            | MissionKind::Waypoints
            | MissionKind::Forward
            | MissionKind::Browse
            | MissionKind::Search
            | MissionKind::Pathfind
            | MissionKind::Explore => None,
        }
    }

    /// Returns what follows from it, with the waypoint file that it may name; a square lies in the middle of the venue's
    /// area unless it says where.
    pub(super) fn task(&mut self, source: &Source<'_>, venue: Option<&Venue>, loader: &mut Loader) -> Task {
        match self.kind {
            MissionKind::Sweep | MissionKind::Calibrate | MissionKind::Fan | MissionKind::FanStraight => {
                Task::Sweep
            }
            MissionKind::Square => Task::Legs(self.square(source, venue)),
            MissionKind::Waypoints => Task::Legs(self.places(source, venue, loader)),
            MissionKind::Forward => Task::Forward(self.distance_m),
            MissionKind::Browse => Task::Browse,
            MissionKind::Search => Task::Search,
            MissionKind::Pathfind if self.has_places() => Task::Pathfind(self.places(source, venue, loader)),
            MissionKind::Pathfind => {
                let mut places = self.square(source, venue);
                places.pop();
                Task::Pathfind(places)
            }
            MissionKind::Explore => Task::Explore,
        }
    }

    fn has_places(&self) -> bool {
        self.file.is_some() || !self.waypoints_m.is_empty()
    }

    /// Returns the places, given as they are or by a file.
    fn places(&self, source: &Source<'_>, venue: Option<&Venue>, loader: &mut Loader) -> Vec<Point> {
        let Some(path) = &self.file else { return self.waypoints_m.clone() };
        let text = match loader(path) {
            Ok(text) => text,
            Err(reason) => {
                let needed = "a waypoint file (QGC WPL 110) or a plan of QGroundControl is needed";
                source.refuse(FILE, &format!("{path} cannot be read: {reason}"), needed);
                return Vec::new();
            }
        };
        match (WaypointFile::read(path, &text), venue) {
            (Err(problems), _) => {
                source.absorb(problems);
                Vec::new()
            }
            (Ok(_), None) => Vec::new(),
            (Ok(file), Some(venue)) => places_of(source, path, &file, venue),
        }
    }

    /// Returns a square, and fills in what was left out: its corners as the original's mission drives them, the first
    /// north-west, and that again at the end.
    fn square(&mut self, source: &Source<'_>, venue: Option<&Venue>) -> Vec<Point> {
        let area = venue.map(|venue| venue.area);
        let side_m = area.map_or(10.0, |area| area.width_m().min(area.height_m()));
        if self.size_m.is_none() && !source.is_known("mission.size_m") {
            source.remember_as("mission.size_m", 1, format!("{side_m} (the default)"));
        }
        let size_m = *self.size_m.get_or_insert(side_m);
        let middle = *self.centre_m.get_or_insert(area.map_or(Point::default(), Rect::centre));
        let mut corners = Rect::new(middle, middle).shrunk(-0.5 * size_m).corners().to_vec();
        // Clockwise, and not from south-west.
        corners.reverse();
        corners.extend(corners.first().copied());
        corners
    }

    fn square_keys(&mut self, to: &mut dyn Keys) {
        to.maybe_number(
            &mut self.size_m,
            Bounds {
                name: "size_m",
                left_out: "the shorter side of the area",
                allowed: 0.1..=10_000.0,
                means: "`square`, `pathfind`: side of the square",
            },
        );
        let means = "`square`, `pathfind`: middle of the square";
        let left_out = "the area's middle";
        to.form(&mut MaybePlace(&mut self.centre_m), Entry { name: "centre_m", left_out, means });
    }

    fn place_keys(&mut self, to: &mut dyn Keys) {
        let means = "`waypoints`, `pathfind`: file of the places, `.waypoints` (QGC WPL 110) or `.plan` of \
                     QGroundControl; every place must lie inside the fence";
        let mut file = FileName { name: &mut self.file, needed: None };
        to.form(&mut file, Entry { name: "file", left_out: "", means });
        let is_needed = self.kind == MissionKind::Waypoints && self.file.is_none();
        let mut waypoints = Waypoints { places: &mut self.waypoints_m, file: self.file.is_some(), is_needed };
        let means = "`waypoints`, `pathfind`: the places, `[[x, y], …]`, unless a file says them";
        to.form(&mut waypoints, Entry { name: "waypoints_m", left_out: "", means });
    }
}

impl Keyed for Mission {
    fn keys(&mut self, to: &mut dyn Keys) {
        let Mission { kind, size_m: _, centre_m: _, waypoints_m: _, file: _, distance_m } = self;
        let means = "what the vehicles are out for, see below";
        to.word(kind, Words { name: "kind", default: MissionKind::Sweep.word(), means });
        match kind {
            MissionKind::Square => self.square_keys(to),
            MissionKind::Waypoints => self.place_keys(to),
            MissionKind::Pathfind => {
                self.place_keys(to);
                if !self.has_places() {
                    self.square_keys(to);
                }
            }
            MissionKind::Forward => to.number(
                distance_m,
                Number {
                    name: "distance_m",
                    default: 5.0,
                    allowed: 0.1..=1000.0,
                    means: "`forward`: how far",
                },
            ),
            MissionKind::Sweep
            | MissionKind::Calibrate
            | MissionKind::Fan
            | MissionKind::FanStraight
            | MissionKind::Browse
            | MissionKind::Search
            | MissionKind::Explore => {}
        }
    }
}

/// Places that stand in the file itself.
struct Waypoints<'a> {
    places: &'a mut Vec<Point>,
    /// Whether a file says them.
    file: bool,
    is_needed: bool,
}

impl Form for Waypoints<'_> {
    fn written(&self) -> Option<String> {
        (!self.places.is_empty()).then(|| places(self.places))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let is_given = section.has(key);
        if self.file && is_given {
            section.refuse(key, "is given beside a file", "one of waypoints_m and file is allowed");
        } else if self.is_needed || is_given {
            *self.places = section.required_points(key, 1..=MOST_PLACES);
        }
    }
}

/// The key of the file of places.
const FILE: &str = "mission.file";

impl Task {
    /// Tells whether the ground station plans it.
    pub fn is_planned_by_ground(&self) -> bool {
        match self {
            Task::Sweep => true,
            Task::Legs(_)
            | Task::Forward(_)
            | Task::Browse
            | Task::Pathfind(_)
            | Task::Search
            | Task::Explore => false,
        }
    }

    /// Gives the places that it names.
    pub fn places(&self) -> &[Point] {
        match self {
            Task::Legs(places) | Task::Pathfind(places) => places,
            Task::Sweep | Task::Forward(_) | Task::Browse | Task::Search | Task::Explore => &[],
        }
    }

    /// Returns what of it the vehicle at a place among so many does, counted from 0. Legs begin with another place for each,
    /// so that they do not all head for the same one; places to be visited are shared.
    pub fn share(&self, index: usize, of: usize) -> Task {
        match self {
            Task::Legs(places) => Task::Legs(begun_at(places, index)),
            Task::Pathfind(places) => {
                let of = of.max(1);
                Task::Pathfind(places.iter().copied().skip(index % of).step_by(of).collect())
            }
            Task::Sweep | Task::Forward(_) | Task::Browse | Task::Search | Task::Explore => self.clone(),
        }
    }

    /// Returns how it travels; `None` for a sweep, which has more to it.
    pub fn on_wire(&self) -> Option<TaskKind> {
        let positions = |places: &[Point]| places.iter().map(|at| Position::from(*at)).collect();
        Some(match self {
            Task::Sweep => return None,
            Task::Legs(places) => TaskKind::Legs { places: positions(places) },
            Task::Forward(distance_m) => {
                TaskKind::Forward { distance_mm: (distance_m * 1000.0).round() as u32 }
            }
            Task::Browse => TaskKind::Browse,
            Task::Pathfind(places) => TaskKind::Pathfind { places: positions(places) },
            Task::Search => TaskKind::Search,
            Task::Explore => TaskKind::Explore,
        })
    }

    /// Returns its kind, as it travels.
    pub fn kind(&self) -> proto::MissionKind {
        self.on_wire().map_or(proto::MissionKind::Sweep, |task| proto::MissionKind::from(&task))
    }
}

impl From<&TaskKind> for Task {
    fn from(task: &TaskKind) -> Task {
        let points = |places: &[Position]| places.iter().map(|at| Point::from(*at)).collect();
        match task {
            TaskKind::Sweep { .. } => Task::Sweep,
            TaskKind::Legs { places } => Task::Legs(points(places)),
            TaskKind::Forward { distance_mm } => Task::Forward(f64::from(*distance_mm) / 1000.0),
            TaskKind::Browse => Task::Browse,
            TaskKind::Pathfind { places } => Task::Pathfind(points(places)),
            TaskKind::Search => Task::Search,
            TaskKind::Explore => Task::Explore,
        }
    }
}

/// Returns places in another order: from one of them to the end, then from the first. A round that ends where it began does
/// so again.
fn begun_at(places: &[Point], index: usize) -> Vec<Point> {
    let is_round = places.len() > 2 && places.first() == places.last();
    let open = &places[..places.len() - usize::from(is_round)];
    let start = index % open.len().max(1);
    let mut turned: Vec<Point> = open[start..].iter().chain(&open[..start]).copied().collect();
    turned.extend(turned.first().copied().filter(|_| is_round));
    turned
}

/// Gives the places of a waypoint file in the venue's frame; what lies outside the fence is refused by its line.
fn places_of(source: &Source<'_>, path: &str, file: &WaypointFile, venue: &Venue) -> Vec<Point> {
    let places = file.points(&venue.plane());
    if places.is_empty() || places.len() > MOST_PLACES {
        let wrong = format!("{path} leads to {} places", places.len());
        source.refuse(FILE, &wrong, &format!("1 to {MOST_PLACES} places are allowed"));
    }
    let outside = places.iter().filter(|(_, at)| !venue.fence.contains(*at));
    let problem = |(index, at): &(usize, Point)| {
        let wrong = format!("leads to ({:.2}, {:.2}) m, outside the fence of the venue", at.x_m, at.y_m);
        file.problem(path, *index, &wrong, "places inside the fence are allowed")
    };
    let problems: Vec<_> = outside.map(problem).collect();
    if !problems.is_empty() {
        source.absorb(Problems::new(path, problems));
        return Vec::new();
    }
    places.into_iter().map(|(_, at)| at).collect()
}
