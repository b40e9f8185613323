//! The task of a simulation: how it sweeps, how long it may take.

use std::time::Duration;

use super::forms::seconds;
use super::keys::{Keyed, Keys, Number, NumberBounds, Whole, WordChoice, Words};
use super::source::Source;

/// How the next stops are chosen.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum PlannerChoice {
    /// All drive laps at a constant gap and measure while driving; the gap changes between laps.
    #[default]
    RotatingGap,
    /// One stands, the others drive: for comparison.
    Fan,
    /// The original's calibration: each of two drives round to all points but the other's.
    Calibrate,
    /// The original's fan: one of two stands on a corner while the other drives the three sides before it.
    FanCorners,
    /// The original's straight fan: both drive along opposite sides, then one along the two sides opposite to the other.
    FanStraight,
}

/// How a sweep is driven.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct SweepConfig {
    /// The planner.
    pub planner: PlannerChoice,
    /// Positions on the border of the area.
    pub positions: usize,
    /// Laps (rotating gap) or rounds (fan) of a sweep; `None`: as many as the planner needs.
    pub laps: Option<usize>,
    /// How long a vehicle stays at a stop, seconds; the fan stops, the rotating gap measures while driving.
    pub dwell_s: f64,
    /// How long it stays at most while it waits for a partner, seconds.
    pub dwell_limit_s: f64,
}

impl WordChoice for PlannerChoice {
    const WORDS: &'static [(&'static str, PlannerChoice)] = &[
        ("rotating-gap", PlannerChoice::RotatingGap),
        ("fan", PlannerChoice::Fan),
        ("calibrate", PlannerChoice::Calibrate),
        ("fan-corners", PlannerChoice::FanCorners),
        ("fan-straight", PlannerChoice::FanStraight),
    ];
}

impl SweepConfig {
    /// Returns how long a vehicle stays at a stop.
    pub fn dwell(&self) -> Duration {
        seconds(self.dwell_s)
    }

    /// Returns how long it stays at most while it waits for a partner.
    pub fn dwell_limit(&self) -> Duration {
        seconds(self.dwell_limit_s)
    }
}

/// The table `[sweep]`; a mission may say the planner.
pub(super) struct SweepTable<'a> {
    pub(super) sweep: &'a mut SweepConfig,
    pub(super) mission: Option<PlannerChoice>,
}

impl Keyed for SweepTable<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        let SweepConfig {
            planner,
            positions,
            laps,
            dwell_s,
            dwell_limit_s,
        } = &mut *self.sweep;
        let default = self.mission.unwrap_or(PlannerChoice::RotatingGap).word();
        let means =
            "how the next stops are chosen; the last three are for two vehicles, see `[mission]`";
        to.word(
            planner,
            Words {
                name: "planner",
                default,
                means,
            },
        );
        let means = "positions on the border of the area";
        to.whole(
            positions,
            Whole {
                name: "positions",
                default: 76,
                allowed: 8..=2000,
                means,
            },
        );
        to.maybe_whole(
            laps,
            NumberBounds {
                name: "laps",
                left_out: "the planner's own number",
                allowed: 1..=most_laps(*planner, *positions),
                means: "laps, or rounds of a fan, which may have as many as there are positions",
            },
        );
        let means = "how long a vehicle stays at a stop (fan and patterns)";
        to.number(
            dwell_s,
            Number {
                name: "dwell_s",
                default: 1.0,
                allowed: 0.0..=600.0,
                means,
            },
        );
        let means = "how long it stays at most while it waits for a partner (fan and patterns)";
        to.number(
            dwell_limit_s,
            Number {
                name: "dwell_limit_s",
                default: 30.0,
                allowed: 0.0..=3600.0,
                means,
            },
        );
    }
}

/// Returns the most laps of a sweep; a fan has a round for every position that one may stand at.
fn most_laps(planner: PlannerChoice, positions: usize) -> usize {
    match planner {
        PlannerChoice::RotatingGap => 64,
        PlannerChoice::Fan | PlannerChoice::Calibrate => positions.max(1),
        PlannerChoice::FanCorners | PlannerChoice::FanStraight => 4,
    }
}

/// The smallest gap between two vehicles on the ring, steps.
pub(super) const SMALLEST_GAP: usize = 4;

impl PlannerChoice {
    /// Returns whether it drives a pattern of the original, over the points of a lattice.
    pub fn is_pattern(self) -> bool {
        match self {
            PlannerChoice::RotatingGap | PlannerChoice::Fan => false,
            PlannerChoice::Calibrate | PlannerChoice::FanCorners | PlannerChoice::FanStraight => {
                true
            }
        }
    }
}

/// Checks a sweep of so many vehicles; a mission may say the planner.
pub(super) fn check_sweep(
    source: &Source<'_>,
    sweep: &SweepConfig,
    vehicles: usize,
    mission: Option<PlannerChoice>,
) {
    if mission.is_some_and(|mission| mission != sweep.planner) {
        let wrong = "is another one than mission.kind says";
        source.refuse("sweep.planner", wrong, "leave one of them out");
    }
    if sweep.planner.is_pattern() {
        check_pattern(source, sweep, vehicles);
    }
    if sweep.planner == PlannerChoice::RotatingGap && vehicles * SMALLEST_GAP > sweep.positions {
        let wrong =
            format!("is too few for {vehicles} vehicles at least {SMALLEST_GAP} steps apart");
        source.refuse(
            "sweep.positions",
            &wrong,
            "4 positions a vehicle are needed",
        );
    }
    if sweep.dwell_limit() < sweep.dwell() {
        source.refuse(
            "sweep.dwell_limit_s",
            "is shorter than dwell_s",
            "at least dwell_s is allowed",
        );
    }
}

fn check_pattern(source: &Source<'_>, sweep: &SweepConfig, vehicles: usize) {
    if !sweep.positions.is_multiple_of(4) {
        let rule = "a multiple of 4 is needed: the points along the border of a square lattice";
        source.refuse("sweep.positions", "makes no square lattice", rule);
    }
    if vehicles != 2 {
        let wrong = format!("drives two vehicles, not {vehicles}");
        // A mission may have said the planner.
        let is_of_mission = !source.is_known("sweep.planner") && source.is_known("mission.kind");
        let key = if is_of_mission {
            "mission.kind"
        } else {
            "sweep.planner"
        };
        source.refuse(key, &wrong, "vehicles.count = 2 is needed");
    }
    if source.is_known("sweep.laps") {
        let wrong = "means nothing to a pattern";
        source.refuse(
            "sweep.laps",
            wrong,
            "leave it out: a pattern is driven once",
        );
    }
}

/// How long slow actors think in virtual time; never zero.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Durations {
    /// The imager, for one image, seconds.
    pub imager_s: f64,
    /// The planner, for the next stops, seconds.
    pub planner_s: f64,
    /// A vehicle's search for a route (A*), seconds.
    pub route_s: f64,
}

impl Durations {
    /// Returns how long the imager thinks.
    pub fn imager(&self) -> Duration {
        seconds(self.imager_s)
    }

    /// Returns how long the planner thinks.
    pub fn planner(&self) -> Duration {
        seconds(self.planner_s)
    }

    /// Returns how long a search for a route takes.
    pub fn route(&self) -> Duration {
        seconds(self.route_s)
    }
}

impl Keyed for Durations {
    fn keys(&mut self, to: &mut dyn Keys) {
        let Durations {
            imager_s,
            planner_s,
            route_s,
        } = self;
        let mut number = |value, name, default, means| {
            to.number(
                value,
                Number {
                    name,
                    default,
                    allowed: 0.001..=600.0,
                    means,
                },
            );
        };
        number(imager_s, "imager_s", 2.0, "for one image");
        number(planner_s, "planner_s", 0.5, "for the next stops");
        number(
            route_s,
            "route_s",
            0.05,
            "for a vehicle's search for a route",
        );
    }
}

/// What a simulation is to end with, all the time without a collision or a breach of the fence.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Expect {
    /// Every sweep was driven to its end.
    #[default]
    Finished,
    /// Every vehicle whose software runs is home.
    Home,
    /// Every vehicle whose software runs stands where it is, and stays there.
    Held,
}

/// What vehicles do when the sweep is done.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum AfterSweep {
    /// They stay where they are.
    Hold,
    /// They drive home.
    #[default]
    Return,
}

impl WordChoice for Expect {
    const WORDS: &'static [(&'static str, Expect)] = &[
        ("finished", Expect::Finished),
        ("home", Expect::Home),
        ("held", Expect::Held),
    ];
}

impl WordChoice for AfterSweep {
    const WORDS: &'static [(&'static str, AfterSweep)] =
        &[("hold", AfterSweep::Hold), ("return", AfterSweep::Return)];
}
