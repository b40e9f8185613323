//! The task of a simulation: how it sweeps, how it makes images, how long it may take.

use std::time::Duration;

use super::section::{Section, whole_of};

/// How the next stops are chosen.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Planner {
    /// All drive laps at a constant gap and measure while driving; the gap changes between laps.
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
#[derive(Clone, PartialEq, Debug)]
pub struct Sweep {
    /// The planner.
    pub planner: Planner,
    /// Positions on the border of the area.
    pub positions: usize,
    /// Laps (rotating gap) or rounds (fan) of a sweep; `None`: as many as the planner needs.
    pub laps: Option<usize>,
    /// How long a vehicle stays at a stop; the fan stops, the rotating gap measures while driving.
    pub dwell: Duration,
    /// How long it stays at most while it waits for a partner.
    pub dwell_limit: Duration,
}

impl Sweep {
    /// Reads how a sweep of so many vehicles is driven; a mission may say the planner.
    pub(super) fn read(section: &Section, vehicles: usize, mission: Option<Planner>) -> Sweep {
        let names = [
            ("rotating-gap", Planner::RotatingGap),
            ("fan", Planner::Fan),
            ("calibrate", Planner::Calibrate),
            ("fan-corners", Planner::FanCorners),
            ("fan-straight", Planner::FanStraight),
        ];
        let planner = section.choice("planner", mission.unwrap_or(Planner::RotatingGap), &names);
        let positions = section.whole("positions", 76, 8..=2000);
        if mission.is_some_and(|mission| mission != planner) {
            section.refuse("planner", "is another one than mission.kind says", "leave one of them out");
        }
        // A fan has a round for every position that one may stand at.
        let most_laps = match planner {
            Planner::RotatingGap => 64,
            Planner::Fan | Planner::Calibrate => positions,
            Planner::FanCorners | Planner::FanStraight => 4,
        };
        let sweep = Sweep {
            planner,
            positions,
            laps: section.has("laps").then(|| section.whole("laps", 8, 1..=most_laps)),
            dwell: section.duration("dwell_s", 1.0, 0.0..=600.0),
            dwell_limit: section.duration("dwell_limit_s", 30.0, 0.0..=3600.0),
        };
        section.finish();
        check_sweep(section, &sweep, vehicles);
        sweep
    }
}

/// The smallest gap between two vehicles on the ring, steps.
pub(super) const SMALLEST_GAP: usize = 4;

impl Planner {
    /// Tells whether it drives a pattern of the original, over the points of a lattice.
    pub fn is_pattern(self) -> bool {
        match self {
            Planner::RotatingGap | Planner::Fan => false,
            Planner::Calibrate | Planner::FanCorners | Planner::FanStraight => true,
        }
    }
}

fn check_sweep(section: &Section, sweep: &Sweep, vehicles: usize) {
    if sweep.planner.is_pattern() {
        check_pattern(section, sweep, vehicles);
    }
    if sweep.planner == Planner::RotatingGap && vehicles * SMALLEST_GAP > sweep.positions {
        let wrong = format!("is too few for {vehicles} vehicles at least {SMALLEST_GAP} steps apart");
        section.refuse("positions", &wrong, "4 positions a vehicle are needed");
    }
    if sweep.dwell_limit < sweep.dwell {
        section.refuse("dwell_limit_s", "is shorter than dwell_s", "at least dwell_s is allowed");
    }
}

fn check_pattern(section: &Section, sweep: &Sweep, vehicles: usize) {
    if !sweep.positions.is_multiple_of(4) {
        let rule = "a multiple of 4 is needed: the points along the border of a square lattice";
        section.refuse("positions", "makes no square lattice", rule);
    }
    if vehicles != 2 {
        let wrong = format!("drives two vehicles, not {vehicles}");
        section.refuse("planner", &wrong, "vehicles.count = 2 is needed");
    }
    if section.has("laps") {
        section.refuse("laps", "means nothing to a pattern", "leave it out: a pattern is driven once");
    }
}

/// How much a pixel counts for a link.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Weights {
    /// The chord through the pixel (Siddon).
    Line,
    /// d^−½ inside an ellipse.
    Ellipse,
    /// One over the area of the smallest ellipse through the pixel.
    InverseArea,
}

/// How an image is found from the links.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Solver {
    /// Maximum a posteriori with an exponential covariance.
    Map,
    /// Tikhonov, the classical reference.
    Tikhonov,
}

/// What is believed of an image before it is measured.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Prior {
    /// Standard deviation of a pixel, dB/m.
    pub sigma_db_per_m: f64,
    /// Distance over which the covariance falls to 1/e, metres.
    pub correlation_length_m: f64,
}

/// How images are made.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Imaging {
    /// Columns of the image (west to east).
    pub columns: usize,
    /// Rows of the image (south to north).
    pub rows: usize,
    /// The weight model.
    pub weights: Weights,
    /// Tuning width of the ellipses, metres.
    pub width_m: f64,
    /// The solver.
    pub solver: Solver,
    /// Size of the bins into which moving ends are sorted, metres.
    pub bin_m: f64,
    /// The prior of the image of changes.
    pub prior: Prior,
    /// The prior of the absolute image.
    pub structure_prior: Prior,
    /// Links under this length are dropped, metres.
    pub min_link_m: f64,
    /// Width of the rim in which no peak is looked for, metres.
    pub rim_m: f64,
    /// Smallest distance between two peaks, metres.
    pub peak_separation_m: f64,
    /// The most objects that are reported.
    pub peaks: usize,
}

impl Imaging {
    pub(super) fn read(section: &Section) -> Imaging {
        let (columns, rows) = read_pixels(section);
        let weights =
            [("line", Weights::Line), ("ellipse", Weights::Ellipse), ("inverse-area", Weights::InverseArea)];
        let imaging = Imaging {
            columns,
            rows,
            weights: section.choice("weights", Weights::InverseArea, &weights),
            width_m: section.number("width_m", 0.3, 0.01..=10.0),
            solver: section.choice(
                "solver",
                Solver::Map,
                &[("map", Solver::Map), ("tikhonov", Solver::Tikhonov)],
            ),
            bin_m: section.number("bin_m", 0.5, 0.05..=10.0),
            prior: read_prior(&section.section("prior"), 0.45, 0.5),
            structure_prior: read_prior(&section.section("structure_prior"), 0.55, 1.0),
            min_link_m: section.number("min_link_m", 3.0, 0.0..=100.0),
            rim_m: section.number("rim_m", 1.5, 0.0..=100.0),
            peak_separation_m: section.number("peak_separation_m", 3.0, 0.0..=100.0),
            peaks: section.whole("peaks", 5, 1..=1000),
        };
        section.finish();
        imaging
    }
}

fn read_prior(section: &Section, sigma_db_per_m: f64, correlation_length_m: f64) -> Prior {
    let prior = Prior {
        sigma_db_per_m: section.number("sigma_db_per_m", sigma_db_per_m, 0.001..=100.0),
        correlation_length_m: section.number("correlation_length_m", correlation_length_m, 0.01..=100.0),
    };
    section.finish();
    prior
}

fn read_pixels(section: &Section) -> (usize, usize) {
    let default = (40, 40);
    if !section.has("pixels") {
        return default;
    }
    let list = section.list("pixels").unwrap_or_default();
    let numbers: Vec<usize> = list.iter().filter_map(|entry| whole_of(entry.get_ref())).collect();
    match numbers[..] {
        [columns, rows] if list.len() == 2 && (2..=400).contains(&columns) && (2..=400).contains(&rows) => {
            (columns, rows)
        }
        _ => {
            let allowed = "[columns, rows], each a whole number from 2 to 400, is allowed";
            section.refuse("pixels", "is no such pair", allowed);
            default
        }
    }
}

/// How long slow actors think in virtual time; never zero.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Durations {
    /// The imager, for one image.
    pub imager: Duration,
    /// The planner, for the next stops.
    pub planner: Duration,
    /// A vehicle's search for a route (A*).
    pub route: Duration,
}

impl Durations {
    pub(super) fn read(section: &Section) -> Durations {
        let allowed = 0.001..=600.0;
        let durations = Durations {
            imager: section.duration("imager_s", 2.0, allowed.clone()),
            planner: section.duration("planner_s", 0.5, allowed.clone()),
            route: section.duration("route_s", 0.05, allowed),
        };
        section.finish();
        durations
    }
}

/// What a simulation is to end with, all the time without a collision or a breach of the fence.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Expect {
    /// Every sweep was driven to its end.
    Finished,
    /// Every vehicle whose software runs is home.
    Home,
    /// Every vehicle whose software runs stands where it is, and stays there.
    Held,
}

/// What vehicles do when the sweep is done.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum End {
    /// They stay where they are.
    Hold,
    /// They drive home.
    Return,
}
