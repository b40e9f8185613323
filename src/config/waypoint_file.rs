//! Stored missions as ground stations write them: the text format "QGC WPL 110" (`.waypoints`) and the JSON of
//! QGroundControl's `.plan`, read into typed items; items and driven tracks written back as WPL 110 or as a plan.
//!
//! Which format it is, is seen by the content. All that is wrong is listed at once, with the line or the JSON path.
//! Fences, rally points, speeds and survey patterns ("ComplexItem") of a plan are not for us: the first three are
//! passed over, a survey is refused. Whether a place lies inside the venue's fence is not known here.
//!
//! Heights above the sea are the autopilot's (a geoid is not known here); those above home need none.

mod item;
mod plan;
mod stored;
mod wpl;

use super::problem::{Problem, Problems};
use crate::geom::{Geodetic, Point, TangentPlane};

/// The longest file that is read, bytes.
pub const MOST_WAYPOINT_BYTES: usize = 4 << 20;
/// The most items of a mission, home not counted.
pub const MOST_ITEMS: usize = 10_000;
/// So many problems are listed; after them it is not read on.
const MOST_PROBLEMS: usize = 50;

/// To what a height is counted.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Above {
    /// Mean sea level (frame 0).
    Sea,
    /// The home of the mission (frame 3).
    Home,
    /// The ground under the vehicle (frame 10).
    Ground,
}

/// A place of the plane, WGS84.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Spot {
    /// Degrees north, -90 to 90.
    pub latitude_deg: f64,
    /// Degrees east, -180 to 180.
    pub longitude_deg: f64,
}

/// Where an item is to be done.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Target {
    /// The place; `None` = where the vehicle is then (written as 0, 0). A waypoint always has one.
    pub spot: Option<Spot>,
    /// The height, metres.
    pub altitude_m: f64,
    /// Above what.
    pub above: Above,
}

/// Which speed is changed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SpeedOf {
    /// Through the air.
    Air,
    /// Over the ground.
    Ground,
    /// Upward.
    Climb,
    /// Downward.
    Descent,
}

/// Which way round a vehicle turns.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum TurnDirection {
    /// The shorter way.
    Shortest,
    /// To the right.
    Clockwise,
    /// To the left.
    CounterClockwise,
}

/// One thing to do in a mission (MAVLink's name and number).
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum MissionItem {
    /// Goes to a place and stays a while (NAV_WAYPOINT, 16).
    Waypoint {
        /// Where.
        to: Target,
        /// How long to stay, seconds.
        hold_s: f64,
        /// How near counts as there, metres; 0 = the autopilot's own.
        radius_m: f64,
    },
    /// Stays at a place until told otherwise (NAV_LOITER_UNLIM, 17).
    Loiter {
        /// Where.
        at: Target,
    },
    /// Stays at a place for a time (NAV_LOITER_TIME, 19).
    LoiterTime {
        /// Where.
        at: Target,
        /// How long, seconds.
        time_s: f64,
    },
    /// Goes home (NAV_RETURN_TO_LAUNCH, 20).
    ReturnToLaunch,
    /// Lands (NAV_LAND, 21).
    Land {
        /// Where.
        at: Target,
    },
    /// Takes off (NAV_TAKEOFF, 22).
    Takeoff {
        /// To which height; the spot is that of the start.
        to: Target,
    },
    /// Waits (NAV_DELAY, 93).
    Delay {
        /// How long, seconds.
        time_s: f64,
    },
    /// Turns (CONDITION_YAW, 115).
    Yaw {
        /// To which bearing, or by how much when relative, degrees in [0, 360].
        angle_deg: f64,
        /// How fast, degrees per second; 0 = the autopilot's own.
        rate_dps: f64,
        /// Which way round.
        turning: TurnDirection,
        /// Whether the angle is counted from where the vehicle looks.
        is_relative: bool,
    },
    /// Changes the speed of what follows (DO_CHANGE_SPEED, 178).
    ChangeSpeed {
        /// Which speed.
        of: SpeedOf,
        /// The speed, metres per second, above 0.
        speed_mps: f64,
    },
    /// Moves a servo (DO_SET_SERVO, 183).
    SetServo {
        /// The autopilot's output, 1 to 32.
        channel: u8,
        /// Pulse width, microseconds, 500 to 2500.
        pulse_us: f64,
    },
    /// Goes on with another item (DO_JUMP, 177).
    Jump {
        /// Which, counted from 1.
        to: usize,
        /// How often; `None` = for ever.
        times: Option<u16>,
    },
    /// A command whose meaning is not known here.
    Other {
        /// Its number (MAV_CMD).
        command: u16,
        /// The place, if it names one.
        at: Option<Target>,
        /// Its first four parameters; `None` = not given.
        parameters: [Option<f64>; 4],
    },
}

impl MissionItem {
    /// Returns the place to which the vehicle goes for this item; `None` where it stays, or goes home.
    pub fn spot(&self) -> Option<Spot> {
        match self {
            MissionItem::Waypoint { to: target, .. }
            | MissionItem::Loiter { at: target }
            | MissionItem::LoiterTime { at: target, .. }
            | MissionItem::Land { at: target } => target.spot,
            MissionItem::Takeoff { .. }
            | MissionItem::ReturnToLaunch
            | MissionItem::Delay { .. }
            | MissionItem::Yaw { .. }
            | MissionItem::ChangeSpeed { .. }
            | MissionItem::SetServo { .. }
            | MissionItem::Jump { .. } => None,
            MissionItem::Other { at, .. } => at.and_then(|at| at.spot),
        }
    }
}

/// Where something stands in a file.
#[derive(Clone, PartialEq, Eq, Debug)]
struct Origin {
    /// Line, counted from 1; 0 where only the JSON path is known.
    line: usize,
    /// JSON path of the item; empty for a line.
    path: String,
}

/// A mission as it was stored.
#[derive(Clone, PartialEq, Debug)]
pub struct WaypointFile {
    /// Where the mission counts as begun; `None` when it is left to the autopilot (0, 0, 0). Metres above the sea.
    pub home: Option<Geodetic>,
    items: Vec<MissionItem>,
    /// One for each item.
    origins: Vec<Origin>,
}

impl WaypointFile {
    /// Reads a mission for its places; `file_name` is used in messages only.
    ///
    /// # Errors
    ///
    /// All that is wrong (the first fifty things): another format or version, an item that we do not know, numbers
    /// that are none or out of range, places off the planet, too long a file.
    pub fn read(file_name: &str, text: &str) -> Result<WaypointFile, Problems> {
        WaypointFile::read_with(Notes::new(file_name), text)
    }

    /// Reads a mission that an autopilot is to store: with jumps and whatever else it may know.
    ///
    /// # Errors
    ///
    /// As [`WaypointFile::read`]; of a command that is not known here only the numbers are judged.
    pub fn read_stored(file_name: &str, text: &str) -> Result<WaypointFile, Problems> {
        let notes = Notes {
            takes_all: true,
            ..Notes::new(file_name)
        };
        WaypointFile::read_with(notes, text)
    }

    fn read_with(mut notes: Notes<'_>, text: &str) -> Result<WaypointFile, Problems> {
        let mut file = WaypointFile {
            home: None,
            items: Vec::new(),
            origins: Vec::new(),
        };
        if text.len() > MOST_WAYPOINT_BYTES {
            let allowed = format!("at most {MOST_WAYPOINT_BYTES} bytes are read");
            notes.add(
                0,
                "size",
                &format!("{} bytes", text.len()),
                "is too long",
                &allowed,
            );
        } else if text
            .trim_start_matches('\u{feff}')
            .trim_start()
            .starts_with('{')
        {
            plan::read(text, &mut notes, &mut file);
        } else {
            wpl::read(text, &mut notes, &mut file);
        }
        if notes.found.is_empty() && file.items.is_empty() {
            notes.add(
                0,
                "items",
                "none",
                "is no mission",
                "at least one item after home is needed",
            );
        }
        file.note_lost_jumps(&mut notes);
        if notes.found.is_empty() {
            Ok(file)
        } else {
            Err(Problems::new(notes.file, notes.found))
        }
    }

    fn note_lost_jumps(&self, notes: &mut Notes<'_>) {
        let count = self.items.len();
        for (item, origin) in self.items.iter().zip(&self.origins) {
            if let MissionItem::Jump { to, .. } = item
                && !(1..=count).contains(to)
            {
                let (key, allowed) = (
                    item::param_key(origin, 0),
                    format!("1 to {count} is allowed"),
                );
                notes.add(
                    origin.line,
                    &key,
                    &to.to_string(),
                    "leads to no item",
                    &allowed,
                );
            }
        }
    }

    /// Makes a mission that drives a track again: a waypoint for every place, without stays.
    ///
    /// # Errors
    ///
    /// There are no places, more than [`MOST_ITEMS`], or one that is not on the planet; the text says which.
    pub fn of_track(home: Geodetic, track: &[Geodetic]) -> Result<WaypointFile, String> {
        if track.is_empty() || track.len() > MOST_ITEMS {
            return Err(format!(
                "a track of {} places, from 1 to {MOST_ITEMS} can be written",
                track.len()
            ));
        }
        let mut file = WaypointFile {
            home: Some(Geodetic {
                altitude_m: centimetres(home.altitude_m),
                ..home
            }),
            items: Vec::new(),
            origins: Vec::new(),
        };
        for (index, place) in std::iter::once(&home).chain(track).enumerate() {
            if !item::is_on_the_planet(*place) {
                return Err(format!(
                    "place {index} of the track is off the planet: {place:?}"
                ));
            }
        }
        for place in track {
            let Geodetic {
                latitude_deg,
                longitude_deg,
                altitude_m,
            } = *place;
            let spot = Some(Spot {
                latitude_deg,
                longitude_deg,
            });
            let to = Target {
                spot,
                altitude_m: centimetres(altitude_m - home.altitude_m),
                above: Above::Home,
            };
            file.push(
                MissionItem::Waypoint {
                    to,
                    hold_s: 0.0,
                    radius_m: 0.0,
                },
                wpl::origin_of(file.items.len()),
            );
        }
        Ok(file)
    }

    /// Lets the mission begin with a takeoff to a height above home, metres: an autopilot that stands on the ground flies no
    /// waypoint without one.
    pub fn with_takeoff(mut self, height_m: f64) -> WaypointFile {
        let to = Target {
            spot: None,
            altitude_m: centimetres(height_m),
            above: Above::Home,
        };
        let mut items = std::mem::take(&mut self.items);
        items.insert(0, MissionItem::Takeoff { to });
        self.origins.clear();
        for item in items {
            self.push(item, wpl::origin_of(self.items.len()));
        }
        self
    }

    /// Returns the items in order, home not among them.
    pub fn items(&self) -> &[MissionItem] {
        &self.items
    }

    /// Returns the mission as "QGC WPL 110", tab-separated, home first; what [`WaypointFile::read`] gives back.
    pub fn to_wpl(&self) -> String {
        wpl::write(self)
    }

    /// Returns the mission as a `.plan` of QGroundControl; [`WaypointFile::read`] gives the same items back.
    pub fn to_plan(&self) -> String {
        plan::write(self)
    }

    /// Returns the places to which the vehicle goes, in the local frame, each with the index of its item.
    pub fn points(&self, frame: &TangentPlane) -> Vec<(usize, Point)> {
        let altitude_m = self.home.map_or(0.0, |home| home.altitude_m);
        let local = |spot: Spot| {
            let Spot {
                latitude_deg,
                longitude_deg,
            } = spot;
            let [x_m, y_m, _] = frame.to_local_m(Geodetic {
                latitude_deg,
                longitude_deg,
                altitude_m,
            });
            Point::new(x_m, y_m)
        };
        let spots = self
            .items
            .iter()
            .enumerate()
            .filter_map(|(index, item)| Some((index, item.spot()?)));
        spots.map(|(index, spot)| (index, local(spot))).collect()
    }

    /// Returns what is wrong with an item, for a check that needs to know more than the file (a fence, a vehicle).
    pub fn problem(&self, file_name: &str, index: usize, wrong: &str, allowed: &str) -> Problem {
        let origin = self
            .origins
            .get(index)
            .cloned()
            .unwrap_or_else(|| wpl::origin_of(index));
        let value = self.items.get(index).map_or_else(String::new, item::shown);
        let key = if origin.path.is_empty() {
            format!("item {}", index + 1)
        } else {
            origin.path
        };
        let (wrong, allowed) = (wrong.to_owned(), allowed.to_owned());
        Problem {
            file: file_name.to_owned(),
            line: origin.line,
            key,
            value,
            wrong,
            allowed,
        }
    }

    fn push(&mut self, item: MissionItem, origin: Origin) {
        self.items.push(item);
        self.origins.push(origin);
    }
}

/// Rounds a height, metres: a computed one looks measured to the nanometre otherwise.
fn centimetres(height_m: f64) -> f64 {
    (height_m * 100.0).round() / 100.0
}

/// What is found wrong while a file is read.
struct Notes<'a> {
    file: &'a str,
    /// Commands that are not known here are taken as well.
    takes_all: bool,
    found: Vec<Problem>,
}

impl<'a> Notes<'a> {
    fn new(file: &'a str) -> Notes<'a> {
        Notes {
            file,
            takes_all: false,
            found: Vec::new(),
        }
    }

    /// Returns whether so much is wrong that reading on is of no use.
    fn are_full(&self) -> bool {
        self.found.len() >= MOST_PROBLEMS
    }

    fn add(&mut self, line: usize, key: &str, value: &str, wrong: &str, allowed: &str) {
        if self.are_full() {
            return;
        }
        let (file, key, value) = (self.file.to_owned(), key.to_owned(), shortened(value));
        let (wrong, allowed) = (wrong.to_owned(), allowed.to_owned());
        self.found.push(Problem {
            file,
            line,
            key,
            value,
            wrong,
            allowed,
        });
    }
}

/// Cuts what was found to a readable length and takes control characters out.
fn shortened(text: &str) -> String {
    const LONGEST: usize = 60;
    let mut cut: String = text
        .chars()
        .take(LONGEST)
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect();
    if text.chars().nth(LONGEST).is_some() {
        cut.push_str("...");
    }
    cut
}

#[cfg(test)]
mod tests;
