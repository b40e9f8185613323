//! A mission that an operator gives, and the one declaration of what missions there are: each kind stands here with its
//! word, its parameters, what files and people may say of them, and how its members share them. Files, operators, ground
//! station and vehicles read them here. What a vehicle does in a mission is not known here.
//!
//! Adding a kind: its variants at the end of [`TaskKind`] and [`MissionKind`], and its lines in their functions below.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use super::stored::{self, StoredItem};
use crate::check::{COORDINATE_MAX_MM, CheckResult, require};
use crate::{Lease, Position, RunId, VehicleId};

/// Places of a task at most; there is at least one.
pub const TASK_PLACES_MAX: usize = 1000;

/// A mission for some vehicles, given by an operator to them and to the ground station. It moves nobody: that takes an
/// order to start.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Task {
    /// By whose right.
    pub lease: Lease,
    /// The run that it is; another task is another run.
    pub run: RunId,
    /// Who takes part, ascending; at least one.
    pub members: Vec<VehicleId>,
    /// The run whose samples stand for the place without what is looked for; `None` = no such run.
    pub compare_with: Option<RunId>,
    /// What is to be done.
    pub kind: TaskKind,
}

/// A mission with its parameters.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum TaskKind {
    /// Vehicles follow the plans of the ground station and measure.
    Sweep {
        /// How the stops are chosen.
        planner: SweepPlanner,
        /// Positions on the border of the area.
        positions: u16,
        /// Laps or rounds; `None` = as many as the planner needs.
        laps: Option<u16>,
        /// How long a vehicle stays at a stop, milliseconds.
        dwell_ms: u32,
        /// How long it stays at most while it waits for a partner, milliseconds.
        dwell_limit_ms: u32,
    },
    /// Straight from place to place, ending in front of what stands there (peers are waited for). The members begin at
    /// different places: the first member at the first, the second at the second, and so on.
    Legs {
        /// The places, in order.
        places: Vec<Position>,
    },
    /// Straight ahead as each stands, ending in front of what stands there (peers are waited for).
    Forward {
        /// How far, millimetres.
        distance_mm: u32,
    },
    /// Each looks around where it stands.
    Browse,
    /// Each looks at everything that it can get to, what is near to objects first.
    Search,
    /// The members share the places and visit them on paths around what they see.
    Pathfind {
        /// The places.
        places: Vec<Position>,
    },
    /// All together look at everything that can be reached.
    Explore,
    /// Each goes round over all places, on paths around what it sees; the members begin at different places.
    Patrol {
        /// The places of a round, in order.
        places: Vec<Position>,
        /// After so many rounds it ends; 0 = their number has no limit.
        rounds: u32,
        /// After so long it ends, milliseconds; 0 = without a limit.
        duration_ms: u32,
    },
    /// One vehicle's autopilot carries out what it stores.
    Stored {
        /// The items, home not among them; there is at least one.
        items: Vec<StoredItem>,
        /// The item that it begins with, counted from 1.
        from: u16,
    },
    /// A sweep as the ground station's file has it, but for what is given: `None` = as there.
    ConfiguredSweep {
        /// How the stops are chosen.
        planner: Option<SweepPlanner>,
        /// Positions on the border of the area.
        positions: Option<u16>,
        /// Laps or rounds.
        laps: Option<u16>,
        /// How long a vehicle stays at a stop, milliseconds.
        dwell_ms: Option<u32>,
        /// How long it stays at most while it waits for a partner, milliseconds.
        dwell_limit_ms: Option<u32>,
    },
}

/// What a vehicle is out for, without its parameters (see [`TaskKind`]).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
pub enum MissionKind {
    /// It follows the plans of the ground station and measures.
    #[default]
    Sweep,
    /// Straight from place to place.
    Legs,
    /// Straight ahead as it stands.
    Forward,
    /// It looks around where it stands.
    Browse,
    /// It looks at everything that it can get to.
    Search,
    /// It visits places on paths around what it sees.
    Pathfind,
    /// All vehicles together look at everything that can be reached.
    Explore,
    /// It goes round over places.
    Patrol,
    /// Its autopilot carries out a stored mission.
    Stored,
}

impl MissionKind {
    /// Returns the word that people read.
    pub fn word(self) -> &'static str {
        match self {
            MissionKind::Sweep => "sweep",
            MissionKind::Legs => "legs",
            MissionKind::Forward => "forward",
            MissionKind::Browse => "browse",
            MissionKind::Search => "search",
            MissionKind::Pathfind => "pathfind",
            MissionKind::Explore => "explore",
            MissionKind::Patrol => "patrol",
            MissionKind::Stored => "stored",
        }
    }
}

impl From<&TaskKind> for MissionKind {
    fn from(task: &TaskKind) -> MissionKind {
        match task {
            TaskKind::Sweep { .. } | TaskKind::ConfiguredSweep { .. } => MissionKind::Sweep,
            TaskKind::Legs { .. } => MissionKind::Legs,
            TaskKind::Forward { .. } => MissionKind::Forward,
            TaskKind::Browse => MissionKind::Browse,
            TaskKind::Search => MissionKind::Search,
            TaskKind::Pathfind { .. } => MissionKind::Pathfind,
            TaskKind::Explore => MissionKind::Explore,
            TaskKind::Patrol { .. } => MissionKind::Patrol,
            TaskKind::Stored { .. } => MissionKind::Stored,
        }
    }
}

impl TaskKind {
    /// Returns one of each kind that files name by [`MissionKind::word`], in the order in which people are told them, with
    /// numbers of 0 and without places. Of sweeps, legs and stored missions files say more than their kind, by words of
    /// their own.
    pub fn named_in_files() -> Vec<TaskKind> {
        vec![
            TaskKind::Forward { distance_mm: 0 },
            TaskKind::Browse,
            TaskKind::Search,
            TaskKind::Pathfind { places: Vec::new() },
            TaskKind::Explore,
            TaskKind::Patrol {
                places: Vec::new(),
                rounds: 0,
                duration_ms: 0,
            },
        ]
    }

    /// Returns its parameters, to be read or set. Those of a sweep are numbers of the ground station's planner, and the
    /// items of a stored mission are the autopilot's: neither is among them.
    pub fn parameters(&mut self) -> Vec<TaskParameter<'_>> {
        match self {
            TaskKind::Legs { places } => {
                vec![TaskParameter::Places(
                    places,
                    PlaceSharing::EachBeginsElsewhere,
                )]
            }
            TaskKind::Pathfind { places } => {
                vec![TaskParameter::Places(places, PlaceSharing::InTurn)]
            }
            TaskKind::Forward { distance_mm } => {
                let (name, unit, means) = ("distance_m", TaskUnit::Millimetre, "how far");
                let far = TaskNumber {
                    name,
                    unit,
                    default: 5000,
                    allowed: 100..=1_000_000,
                    means,
                };
                vec![TaskParameter::Number(distance_mm, far)]
            }
            TaskKind::Patrol {
                places,
                rounds,
                duration_ms,
            } => {
                let (name, unit, means) = (
                    "rounds",
                    TaskUnit::One,
                    "after so many rounds it ends; 0: their number has no limit",
                );
                let many = TaskNumber {
                    name,
                    unit,
                    default: 2,
                    allowed: 0..=10_000,
                    means,
                };
                let (name, unit, means) = (
                    "duration_s",
                    TaskUnit::Millisecond,
                    "after so long it ends; 0: without a limit",
                );
                let long = TaskNumber {
                    name,
                    unit,
                    default: 0,
                    allowed: 0..=86_400_000,
                    means,
                };
                vec![
                    TaskParameter::Places(places, PlaceSharing::EachBeginsElsewhere),
                    TaskParameter::Number(rounds, many),
                    TaskParameter::Number(duration_ms, long),
                ]
            }
            TaskKind::Sweep { .. }
            | TaskKind::ConfiguredSweep { .. }
            | TaskKind::Browse
            | TaskKind::Search
            | TaskKind::Explore
            | TaskKind::Stored { .. } => Vec::new(),
        }
    }

    /// Returns all places that it names, in their order.
    pub fn places(&self) -> Vec<Position> {
        if let TaskKind::Stored { items, .. } = self {
            return items.iter().filter_map(StoredItem::place).collect();
        }
        let mut task = self.clone();
        let places = task
            .parameters()
            .into_iter()
            .filter_map(|parameter| match parameter {
                TaskParameter::Places(places, _) => Some(std::mem::take(places)),
                TaskParameter::Number(..) => None,
            });
        places.flatten().collect()
    }

    /// Returns why it is impossible, if it is.
    pub(crate) fn check(&self) -> CheckResult {
        match self {
            TaskKind::Sweep {
                dwell_ms,
                dwell_limit_ms,
                ..
            }
            | TaskKind::ConfiguredSweep {
                dwell_ms: Some(dwell_ms),
                dwell_limit_ms: Some(dwell_limit_ms),
                ..
            } => require(dwell_ms <= dwell_limit_ms, "a dwell is at most its limit")?,
            TaskKind::Stored { items, from } => stored::check(items, *from)?,
            _ => {}
        }
        let mut task = self.clone();
        task.parameters().iter().try_for_each(TaskParameter::check)
    }
}

/// A parameter of a task.
#[derive(PartialEq, Eq, Debug)]
pub enum TaskParameter<'a> {
    /// A number in its unit, and what may be said of it.
    Number(&'a mut u32, TaskNumber),
    /// Places in the venue's frame, 1 to [`TASK_PLACES_MAX`], and what of them is whose.
    Places(&'a mut Vec<Position>, PlaceSharing),
}

impl TaskParameter<'_> {
    /// Returns why it is impossible, if it is. What files allow of a number may change without a new wire.
    fn check(&self) -> CheckResult {
        match self {
            TaskParameter::Number(
                number,
                TaskNumber {
                    unit: TaskUnit::Millimetre,
                    ..
                },
            ) => require(
                **number < COORDINATE_MAX_MM.unsigned_abs(),
                "a distance of a task is under 1000 km",
            ),
            TaskParameter::Number(..) => Ok(()),
            TaskParameter::Places(places, _) => {
                let is_allowed = (1..=TASK_PLACES_MAX).contains(&places.len());
                require(is_allowed, "a task of places has 1 to 1000 of them")?;
                places.iter().try_for_each(Position::check)
            }
        }
    }
}

/// What files and people may say of a number.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct TaskNumber {
    /// Its key, which ends as its unit says.
    pub name: &'static str,
    /// What the number on the wire counts.
    pub unit: TaskUnit,
    /// What it is when it is left out, in its unit.
    pub default: u32,
    /// From where to where files may say it, in its unit; on the wire a length is anything under 1000 km, and all else
    /// what it wants.
    pub allowed: RangeInclusive<u32>,
    /// What it means.
    pub means: &'static str,
}

/// What a number of a task counts.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum TaskUnit {
    /// Lengths; files say metres, by a key that ends in `_m`.
    Millimetre,
    /// Times; files say seconds, by a key that ends in `_s`.
    Millisecond,
    /// How many; files say the same.
    One,
}

/// What of the places of a task is whose.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PlaceSharing {
    /// All are everybody's, and each member begins at another one in their order, so that they do not all head for the same.
    EachBeginsElsewhere,
    /// Each is one member's: the members take them in turn.
    InTurn,
}

/// How the next stops of a sweep are chosen.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum SweepPlanner {
    /// All drive laps at a constant gap and measure while driving; the gap changes between laps.
    RotatingGap,
    /// One stands, the others drive.
    Fan,
    /// Each of two drives round to all points but the other's.
    Calibrate,
    /// One of two stands on a corner while the other drives the three sides before it.
    FanCorners,
    /// Two drive along opposite sides, then one along the two sides opposite to the other.
    FanStraight,
}

#[cfg(test)]
mod tests {
    use serde::de::IntoDeserializer;
    use serde::de::value::Error;

    use super::*;

    /// Returns the kinds of the wire, in its order.
    fn kinds() -> Vec<MissionKind> {
        let of_number = |number: u32| {
            MissionKind::deserialize(IntoDeserializer::<Error>::into_deserializer(number))
        };
        (0..).map_while(|number| of_number(number).ok()).collect()
    }

    #[test]
    fn files_name_every_kind_but_three_each_by_a_word_of_its_own() {
        let named: Vec<MissionKind> = TaskKind::named_in_files()
            .iter()
            .map(MissionKind::from)
            .collect();
        let mut expected = kinds();
        let by_other_words = [MissionKind::Sweep, MissionKind::Legs, MissionKind::Stored];
        expected.retain(|kind| !by_other_words.contains(kind));
        assert_eq!(named, expected);
        let words: std::collections::BTreeSet<&str> =
            kinds().into_iter().map(MissionKind::word).collect();
        assert_eq!(words.len(), kinds().len());
    }

    #[test]
    fn what_a_file_may_say_of_a_number_can_travel_and_its_key_says_the_unit() {
        for mut task in TaskKind::named_in_files() {
            for parameter in task.parameters() {
                let TaskParameter::Number(_, number) = parameter else {
                    continue;
                };
                let (has_metres, has_seconds) =
                    (number.name.ends_with("_m"), number.name.ends_with("_s"));
                let expected = (
                    number.unit == TaskUnit::Millimetre,
                    number.unit == TaskUnit::Millisecond,
                );
                assert_eq!((has_metres, has_seconds), expected, "{number:?}");
                assert!(number.allowed.contains(&number.default), "{number:?}");
                let mut most = *number.allowed.end();
                assert_eq!(TaskParameter::Number(&mut most, number).check(), Ok(()));
            }
        }
    }
}
