//! The section `[mission]`: what every vehicle is out for. Without it vehicles sweep: they follow the plans of the
//! ground station. Which kinds of missions there are, and their parameters, is declared with the message that carries them
//! ([`TaskKind`]); here stand how a file says places, and the words that are other ways to say a sweep or legs. What a
//! mission does with its places is decided by the vehicle, see `node::mission`.

use tomoswarm_proto::{
    MissionKind, Position, STORED_ITEMS_MAX, TASK_PLACES_MAX, TaskKind, TaskNumber, TaskParameter,
    TaskUnit,
};

use super::Loader;
use super::forms::{FileName, MaybePlace, places};
use super::keys::{Form, KeyEntry, Keyed, Keys, Number, NumberBounds, Whole, Word, Words};
use super::mission::PlannerChoice;
use super::problem::{Problem, Problems};
use super::section::Section;
use super::source::Source;
use super::venue::Venue;
use super::waypoint_file::WaypointFile;
use crate::geom::{Point, Rect, without_dust};

/// What the word for a mission stands for.
#[derive(Clone, PartialEq, Debug)]
enum WrittenKind {
    /// As the ground station plans; a measurement pattern of the original says by which planner.
    Sweep(Option<PlannerChoice>),
    /// Straight around a square.
    Square,
    /// Straight from place to place.
    Waypoints,
    /// What an autopilot stores and carries out, from this item on.
    Stored {
        /// The item, counted from 1.
        from: usize,
    },
    /// A mission with the word that it travels by; it has its numbers, and no places yet.
    Named(TaskKind),
}

/// The words of files alone.
const WORDS: &[(&str, WrittenKind)] = &[
    ("sweep", WrittenKind::Sweep(None)),
    (
        "calibrate",
        WrittenKind::Sweep(Some(PlannerChoice::Calibrate)),
    ),
    ("fan", WrittenKind::Sweep(Some(PlannerChoice::FanCorners))),
    (
        "fan-straight",
        WrittenKind::Sweep(Some(PlannerChoice::FanStraight)),
    ),
    ("square", WrittenKind::Square),
    ("waypoints", WrittenKind::Waypoints),
    ("stored", WrittenKind::Stored { from: 1 }),
];

impl WrittenKind {
    /// Returns all kinds with their words, in the order in which people are told them.
    fn all() -> impl Iterator<Item = (&'static str, WrittenKind)> {
        let named = TaskKind::named_in_files().into_iter();
        let named = named.map(|task| (MissionKind::from(&task).word(), WrittenKind::Named(task)));
        WORDS.iter().cloned().chain(named)
    }
}

impl Word for WrittenKind {
    fn words(&self) -> Vec<&'static str> {
        WrittenKind::all().map(|(word, _)| word).collect()
    }

    fn chosen(&self) -> &'static str {
        match self {
            WrittenKind::Named(task) => MissionKind::from(task).word(),
            WrittenKind::Stored { .. } => MissionKind::Stored.word(),
            WrittenKind::Sweep(_) | WrittenKind::Square | WrittenKind::Waypoints => WORDS
                .iter()
                .find(|(_, kind)| kind == self)
                .map_or("", |(word, _)| word),
        }
    }

    fn choose(&mut self, word: &str) {
        if let Some((_, kind)) = WrittenKind::all().find(|(known, _)| *known == word) {
            *self = kind;
        }
    }
}

/// The table `[mission]` as it is written; a [`TaskKind`] is what follows from it.
#[derive(Clone, PartialEq, Debug)]
pub struct MissionTable {
    kind: WrittenKind,
    places: WrittenPlaces,
}

impl Default for MissionTable {
    /// Returns a sweep.
    fn default() -> MissionTable {
        MissionTable::of(WrittenKind::Sweep(None))
    }
}

impl MissionTable {
    fn of(kind: WrittenKind) -> MissionTable {
        MissionTable {
            kind,
            places: WrittenPlaces::default(),
        }
    }

    /// Returns a mission of every kind with its word, in the order in which people are told them.
    pub(super) fn each() -> impl Iterator<Item = (&'static str, MissionTable)> {
        WrittenKind::all().map(|(word, kind)| (word, MissionTable::of(kind)))
    }

    /// Returns the word for its kind, as files say it.
    pub fn word(&self) -> &'static str {
        self.kind.chosen()
    }

    /// Returns whether the ground station plans it.
    pub(super) fn is_planned_by_ground(&self) -> bool {
        match self.kind {
            WrittenKind::Sweep(_) => true,
            WrittenKind::Square
            | WrittenKind::Waypoints
            | WrittenKind::Stored { .. }
            | WrittenKind::Named(_) => false,
        }
    }

    /// Returns whether it is one vehicle's alone.
    pub(super) fn is_of_one(&self) -> bool {
        matches!(self.kind, WrittenKind::Stored { .. })
    }

    /// Returns the planner that its kind of sweep needs.
    pub(super) fn planner(&self) -> Option<PlannerChoice> {
        match self.kind {
            WrittenKind::Sweep(planner) => planner,
            WrittenKind::Square
            | WrittenKind::Waypoints
            | WrittenKind::Stored { .. }
            | WrittenKind::Named(_) => None,
        }
    }

    /// Returns what follows from it, with the waypoint file that it may name; `None` for what the ground station plans. A
    /// square lies in the middle of the venue's area unless it says where.
    pub(super) fn task(
        &mut self,
        source: &Source<'_>,
        venue: Option<&Venue>,
        loader: &mut Loader,
    ) -> Option<TaskKind> {
        let MissionTable { kind, places } = self;
        let positions = |points: Vec<Point>| points.into_iter().map(Position::from).collect();
        match kind {
            WrittenKind::Sweep(_) => None,
            WrittenKind::Square => Some(TaskKind::Legs {
                places: positions(places.round(source, venue)),
            }),
            WrittenKind::Waypoints => Some(TaskKind::Legs {
                places: positions(places.list(source, venue, loader)),
            }),
            WrittenKind::Stored { from } => places.stored(*from, source, venue, loader),
            WrittenKind::Named(task) => {
                let mut task = task.clone();
                for parameter in task.parameters() {
                    match parameter {
                        TaskParameter::Number(..) => {}
                        TaskParameter::Places(list, _) => {
                            *list = positions(places.list_or_corners(source, venue, loader));
                        }
                    }
                }
                Some(task)
            }
        }
    }
}

impl Keyed for MissionTable {
    fn keys(&mut self, to: &mut dyn Keys) {
        let MissionTable { kind, places } = self;
        let means = "what the vehicles are out for, see below";
        to.word(
            kind,
            Words {
                name: "kind",
                default: "sweep",
                means,
            },
        );
        match kind {
            WrittenKind::Sweep(_) => {}
            WrittenKind::Square => places.square_keys(to),
            WrittenKind::Waypoints => places.list_keys(true, to),
            WrittenKind::Stored { from } => {
                places.file_key(Some("a file is needed, .waypoints or .plan"), to);
                let (name, means) = ("from", "the item that it begins with, counted from 1");
                to.whole(
                    from,
                    Whole {
                        name,
                        default: 1,
                        allowed: 1..=STORED_ITEMS_MAX,
                        means,
                    },
                );
            }
            WrittenKind::Named(task) => {
                task.parameters()
                    .into_iter()
                    .for_each(|parameter| match parameter {
                        TaskParameter::Number(value, number) => number_key(value, number, to),
                        TaskParameter::Places(..) => places.list_or_square_keys(to),
                    })
            }
        }
    }
}

/// Shows a number: lengths are written in metres, times in seconds.
fn number_key(value: &mut u32, number: TaskNumber, to: &mut dyn Keys) {
    let TaskNumber {
        name,
        unit,
        default,
        allowed,
        means,
    } = number;
    match unit {
        TaskUnit::Millimetre | TaskUnit::Millisecond => {
            let written = |thousandths: u32| f64::from(thousandths) / 1000.0;
            let allowed = written(*allowed.start())..=written(*allowed.end());
            let mut number = written(*value);
            to.number(
                &mut number,
                Number {
                    name,
                    default: written(default),
                    allowed,
                    means,
                },
            );
            *value = (number * 1000.0).round() as u32;
        }
        TaskUnit::One => {
            let allowed = *allowed.start() as usize..=*allowed.end() as usize;
            let mut number = *value as usize;
            to.whole(
                &mut number,
                Whole {
                    name,
                    default: default as usize,
                    allowed,
                    means,
                },
            );
            *value = u32::try_from(number).unwrap_or(u32::MAX);
        }
    }
}

/// The places of a mission as they are written.
#[derive(Clone, PartialEq, Debug, Default)]
struct WrittenPlaces {
    /// Side of the square, metres.
    size_m: Option<f64>,
    /// Middle of the square.
    centre_m: Option<Point>,
    /// The places, unless a file says them.
    waypoints_m: Vec<Point>,
    /// The file of places.
    file: Option<String>,
}

impl WrittenPlaces {
    fn has_list(&self) -> bool {
        self.file.is_some() || !self.waypoints_m.is_empty()
    }

    /// Returns the places, given as they are or by a file.
    fn list(&self, source: &Source<'_>, venue: Option<&Venue>, loader: &mut Loader) -> Vec<Point> {
        let Some(path) = &self.file else {
            return self.waypoints_m.clone();
        };
        let file = mission_file(path, WaypointFile::read, source, loader);
        match (file, venue) {
            (None, _) | (Some(_), None) => Vec::new(),
            (Some(file), Some(venue)) => places_of(source, path, &file, venue),
        }
    }

    /// Returns the mission that an autopilot is to store.
    fn stored(
        &self,
        from: usize,
        source: &Source<'_>,
        venue: Option<&Venue>,
        loader: &mut Loader,
    ) -> Option<TaskKind> {
        let path = self.file.as_ref()?;
        let (file, venue) = (
            mission_file(path, WaypointFile::read_stored, source, loader)?,
            venue?,
        );
        let items = file.stored_items(path, venue);
        let problems = outside(path, &file, &file.points(&venue.plane()), venue);
        if !problems.is_empty() {
            source.absorb(Problems::new(path, problems));
            return None;
        }
        match items {
            Err(problems) => source.absorb(problems),
            Ok(items) if from > items.len() => {
                let wrong = format!("is none of the {} items of {path}", items.len());
                source.refuse("mission.from", &wrong, "an item of the file is needed");
            }
            Ok(items) => {
                let from = u16::try_from(from).unwrap_or(u16::MAX);
                return Some(TaskKind::Stored { items, from });
            }
        }
        None
    }

    /// Returns the places, or without them the corners of the square.
    fn list_or_corners(
        &mut self,
        source: &Source<'_>,
        venue: Option<&Venue>,
        loader: &mut Loader,
    ) -> Vec<Point> {
        if self.has_list() {
            return self.list(source, venue, loader);
        }
        let mut corners = self.round(source, venue);
        corners.pop();
        corners
    }

    /// Returns the way round the square, and fills in what was left out: its corners as the original's mission drives them,
    /// the first north-west, and that again at the end.
    fn round(&mut self, source: &Source<'_>, venue: Option<&Venue>) -> Vec<Point> {
        let area = venue.map(|venue| venue.area);
        let side_m = area.map_or(10.0, |area| {
            without_dust(area.width_m().min(area.height_m()))
        });
        if self.size_m.is_none() && !source.is_known("mission.size_m") {
            source.remember_as("mission.size_m", 1, format!("{side_m} (the default)"));
        }
        let size_m = *self.size_m.get_or_insert(side_m);
        let middle = *self
            .centre_m
            .get_or_insert(area.map_or(Point::default(), |area| {
                let Point { x_m, y_m } = area.centre();
                Point::new(without_dust(x_m), without_dust(y_m))
            }));
        let mut corners = Rect::new(middle, middle)
            .shrunk(-0.5 * size_m)
            .corners()
            .to_vec();
        // Clockwise, and not from south-west.
        corners.reverse();
        corners.extend(corners.first().copied());
        corners
    }

    fn square_keys(&mut self, to: &mut dyn Keys) {
        let WrittenPlaces {
            size_m,
            centre_m,
            waypoints_m: _,
            file: _,
        } = self;
        let (left_out, means) = ("the shorter side of the area", "side of the square");
        to.maybe_number(
            size_m,
            NumberBounds {
                name: "size_m",
                left_out,
                allowed: 0.1..=10_000.0,
                means,
            },
        );
        let (left_out, means) = ("the area's middle", "middle of the square");
        to.form(
            &mut MaybePlace(centre_m),
            KeyEntry {
                name: "centre_m",
                left_out,
                means,
            },
        );
    }

    fn file_key(&mut self, needed: Option<&'static str>, to: &mut dyn Keys) {
        let means = "a mission, `.waypoints` (QGC WPL 110) or `.plan` of QGroundControl; every place must lie inside the fence";
        let name = &mut self.file;
        let entry = KeyEntry {
            name: "file",
            left_out: "",
            means,
        };
        to.form(&mut FileName { name, needed }, entry);
    }

    fn list_keys(&mut self, is_needed: bool, to: &mut dyn Keys) {
        self.file_key(None, to);
        let WrittenPlaces {
            size_m: _,
            centre_m: _,
            waypoints_m,
            file,
        } = self;
        let is_needed = is_needed && file.is_none();
        let mut waypoints = Waypoints {
            places: waypoints_m,
            file: file.is_some(),
            is_needed,
        };
        let means = "the places, `[[x, y], …]`, unless a file says them";
        to.form(
            &mut waypoints,
            KeyEntry {
                name: "waypoints_m",
                left_out: "",
                means,
            },
        );
    }

    fn list_or_square_keys(&mut self, to: &mut dyn Keys) {
        self.list_keys(false, to);
        if !self.has_list() {
            self.square_keys(to);
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
    fn to_toml(&self) -> Option<String> {
        (!self.places.is_empty()).then(|| places(self.places))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let is_given = section.has(key);
        if self.file && is_given {
            section.refuse(
                key,
                "is given beside a file",
                "one of waypoints_m and file is allowed",
            );
        } else if self.is_needed || is_given {
            *self.places = section.required_points(key, 1..=TASK_PLACES_MAX);
        }
    }
}

/// The key of the file of places.
const FILE: &str = "mission.file";

/// Returns the places of a waypoint file in the venue's frame; what lies outside the fence is refused by its line.
fn places_of(source: &Source<'_>, path: &str, file: &WaypointFile, venue: &Venue) -> Vec<Point> {
    let places = file.points(&venue.plane());
    if places.is_empty() || places.len() > TASK_PLACES_MAX {
        let wrong = format!("{path} leads to {} places", places.len());
        source.refuse(
            FILE,
            &wrong,
            &format!("1 to {TASK_PLACES_MAX} places are allowed"),
        );
    }
    let problems = outside(path, file, &places, venue);
    if !problems.is_empty() {
        source.absorb(Problems::new(path, problems));
        return Vec::new();
    }
    places.into_iter().map(|(_, at)| at).collect()
}

/// Reads a file of a mission; what is wrong is noted at the source.
fn mission_file(
    path: &str,
    read: fn(&str, &str) -> Result<WaypointFile, Problems>,
    source: &Source<'_>,
    loader: &mut Loader,
) -> Option<WaypointFile> {
    let text = match loader(path) {
        Ok(text) => text,
        Err(reason) => {
            let needed = "a waypoint file (QGC WPL 110) or a plan of QGroundControl is needed";
            source.refuse(FILE, &format!("{path} cannot be read: {reason}"), needed);
            return None;
        }
    };
    read(path, &text)
        .map_err(|problems| source.absorb(problems))
        .ok()
}

/// Returns which of the places of a file lie outside the fence, by its lines.
fn outside(
    path: &str,
    file: &WaypointFile,
    places: &[(usize, Point)],
    venue: &Venue,
) -> Vec<Problem> {
    let outside = places.iter().filter(|(_, at)| !venue.fence.contains(*at));
    let problem = |(index, at): &(usize, Point)| {
        let wrong = format!(
            "leads to ({:.2}, {:.2}) m, outside the fence of the venue",
            at.x_m, at.y_m
        );
        file.problem(path, *index, &wrong, "places inside the fence are allowed")
    };
    outside.map(problem).collect()
}
