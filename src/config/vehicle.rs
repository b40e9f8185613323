//! What vehicles can do and the margins that they keep; their range sensors have a file of their own.

use std::ops::RangeInclusive;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::forms::seconds;
use super::keys::{Keyed, Keys, Number, Whole, WordChoice, Words, read_defaults};
use super::range::SensorCoverage;
use super::section::Section;
use super::source::Source;
use crate::geom::{Angle, Bearing, Vector};
use crate::plan::{ContactLimits, REACTION_S, SensingLimits};

/// How many vehicles a simulation may have: as many as the planners can keep apart on one ring.
pub(super) const SWARM: RangeInclusive<usize> = 2..=8;
/// How many vehicles a simulation may have that follow no plan of the ground station.
pub(super) const PARTY: RangeInclusive<usize> = 1..=8;
/// How many vehicles a world may hold for others who drive them.
pub(super) const CROWD: RangeInclusive<usize> = 2..=250;

/// The vehicles of a simulation, all alike; their ids are 1 to `count`.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Vehicles {
    /// How many.
    pub count: usize,
    /// Their bodies.
    pub body: BodySpec,
    /// Standard deviation of each coordinate of the measured place, metres.
    pub pose_sd_m: f64,
    /// Time over which the error of the measured place drifts by its own size, seconds.
    pub pose_correlation_s: f64,
    /// How long a full battery lasts while driving, seconds.
    pub endurance_driving_s: f64,
    /// How long a full battery lasts at rest, seconds; a copter in the air uses as much as driving.
    pub endurance_resting_s: f64,
    /// Whether they fly, and in what.
    pub flight: Flight,
    /// How fast the deviation of the place grows without satellites, metres per second.
    pub gps_growth_mps: f64,
}

impl Vehicles {
    /// Returns how long a full battery lasts while driving.
    pub fn endurance_driving(&self) -> Duration {
        seconds(self.endurance_driving_s)
    }

    /// Returns how long a full battery lasts at rest.
    pub fn endurance_resting(&self) -> Duration {
        seconds(self.endurance_resting_s)
    }
}

/// The table `[vehicles]` of a simulation of so many vehicles.
pub(super) struct VehiclesTable<'a> {
    pub(super) vehicles: &'a mut Vehicles,
    pub(super) allowed: RangeInclusive<usize>,
}

impl Keyed for VehiclesTable<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        let Vehicles {
            count,
            body,
            pose_sd_m,
            pose_correlation_s,
            endurance_driving_s,
            endurance_resting_s,
            flight,
            gps_growth_mps,
        } = &mut *self.vehicles;
        let allowed = self.allowed.clone();
        let means = "how many; from 1 on when they do not sweep";
        to.whole(
            count,
            Whole {
                name: "count",
                default: 2,
                allowed,
                means,
            },
        );
        body.keys(to);
        to.number(
            pose_sd_m,
            Number {
                name: "pose_sd_m",
                default: 0.05,
                allowed: 0.0..=5.0,
                means: "standard deviation of each coordinate of the measured place",
            },
        );
        to.number(
            pose_correlation_s,
            Number {
                name: "pose_correlation_s",
                default: 20.0,
                allowed: 0.1..=3600.0,
                means: "time over which the error of the measured place drifts by its own size",
            },
        );
        to.number(
            endurance_driving_s,
            Number {
                name: "endurance_driving_s",
                default: 21_600.0,
                allowed: 1.0..=1e6,
                means: "how long a full battery lasts while driving",
            },
        );
        to.number(
            endurance_resting_s,
            Number {
                name: "endurance_resting_s",
                default: 86_400.0,
                allowed: 1.0..=1e6,
                means: "how long a full battery lasts at rest",
            },
        );
        flight.keys(to);
        to.number(
            gps_growth_mps,
            Number {
                name: "gps_growth_mps",
                default: 0.05,
                allowed: 0.0..=10.0,
                means: "by which the deviation of the place grows without satellites",
            },
        );
    }
}

/// What kind of vehicle it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Craft {
    /// It drives.
    #[default]
    Rover,
    /// It flies.
    Copter,
}

impl WordChoice for Craft {
    const WORDS: &'static [(&'static str, Craft)] =
        &[("rover", Craft::Rover), ("copter", Craft::Copter)];
}

/// How far a steady wind carries a copter from where it is sent, metres for each m/s.
pub const CARRIED_S: f64 = 0.05;

/// Whether vehicles fly, and in what wind.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Flight {
    /// What they are.
    pub craft: Craft,
    /// Altitude at which copters fly, metres.
    pub altitude_m: f64,
    /// Climbing and sinking of copters, metres per second.
    pub climb_mps: f64,
    /// Wind, metres per second; it carries copters only.
    pub wind_mps: f64,
    /// Compass bearing that the wind comes from, degrees.
    pub wind_from_deg: f64,
}

impl Flight {
    /// Returns the altitude at which the vehicles are under way, metres; rovers stay on the ground.
    pub fn way_altitude_m(&self) -> f64 {
        match self.craft {
            Craft::Rover => 0.0,
            Craft::Copter => self.altitude_m,
        }
    }

    /// Returns how far wind carries the vehicles from where they are sent, metres; rovers it does not.
    pub fn carried_m(&self) -> f64 {
        match self.craft {
            Craft::Rover => 0.0,
            Craft::Copter => self.wind_mps * CARRIED_S,
        }
    }

    /// Returns where the wind blows to, m/s, in a frame whose x axis has this bearing.
    pub fn wind(&self, x_axis: Bearing) -> Vector {
        let wind_from = Bearing::from_degrees(self.wind_from_deg);
        let from = Angle::from_radians(x_axis.radians() - wind_from.radians());
        -Vector::polar(from, self.wind_mps)
    }
}

impl Keyed for Flight {
    fn keys(&mut self, to: &mut dyn Keys) {
        let Flight {
            craft,
            altitude_m,
            climb_mps,
            wind_mps,
            wind_from_deg,
        } = self;
        craft_keys((craft, altitude_m), to);
        to.number(
            climb_mps,
            Number {
                name: "climb_mps",
                default: 1.0,
                allowed: 0.1..=20.0,
                means: "climbing and sinking of copters",
            },
        );
        // Beyond it a copter would be carried so far aside that it never came to where it was sent.
        to.number(
            wind_mps,
            Number {
                name: "wind_mps",
                default: 0.0,
                allowed: 0.0..=5.0,
                means: "wind; carries copters aside by 5 cm for each m/s, which their margins hold, and makes them lean",
            },
        );
        to.number(
            wind_from_deg,
            Number {
                name: "wind_from_deg",
                default: 270.0,
                allowed: 0.0..=360.0,
                means: "compass bearing that the wind comes from",
            },
        );
    }
}

/// What a vehicle is, and how high it flies.
fn craft_keys((craft, altitude_m): (&mut Craft, &mut f64), to: &mut dyn Keys) {
    let default = Craft::Rover.word();
    to.word(
        craft,
        Words {
            name: "kind",
            default,
            means: "what they are",
        },
    );
    to.number(
        altitude_m,
        Number {
            name: "altitude_m",
            default: 1.5,
            allowed: 0.3..=500.0,
            means: "altitude above home at which copters fly; simulated ones begin hovering there",
        },
    );
}

/// What a vehicle's own file says of its flight: what it is, how high it flies, and in what wind.
pub(super) struct OwnFlight<'a>(pub(super) &'a mut Flight);

impl Keyed for OwnFlight<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        let Flight {
            craft,
            altitude_m,
            climb_mps: _,
            wind_mps,
            wind_from_deg: _,
        } = self.0;
        craft_keys((craft, altitude_m), to);
        to.number(
            wind_mps,
            Number {
                name: "wind_mps",
                default: 0.0,
                allowed: 0.0..=5.0,
                means: "the strongest wind in which a copter is flown: its margins hold 5 cm for each m/s",
            },
        );
    }
}

/// Refuses copters that would fly above the ceiling; `key` says how high they fly.
pub(super) fn check_ceiling(
    root: &Section<'_>,
    key: &str,
    (flight, body): (&Flight, &BodySpec),
    ceiling_m: f64,
) {
    let top_m = flight.altitude_m + body.height_m;
    if flight.craft == Craft::Copter && top_m > ceiling_m {
        let wrong = format!(
            "with the height of a vehicle is above the ceiling of the venue, {ceiling_m} m"
        );
        root.source
            .refuse(key, &wrong, "a lower altitude is needed");
    }
}

/// The body of one vehicle and how it moves.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct BodySpec {
    /// Radius of the body, metres.
    pub radius_m: f64,
    /// Height of the body, metres.
    pub height_m: f64,
    /// Height of the antenna above the ground, metres.
    pub antenna_height_m: f64,
    /// Speed limit, metres per second.
    pub max_speed_mps: f64,
    /// Acceleration, metres per second squared.
    pub acceleration_mps2: f64,
    /// Braking, metres per second squared, positive.
    pub braking_mps2: f64,
    /// Turn rate on the spot, degrees per second.
    pub turn_rate_deg_per_s: f64,
}

impl BodySpec {
    /// Returns the turn rate on the spot, radians per second.
    pub fn turn_rate_rad_per_s(&self) -> f64 {
        self.turn_rate_deg_per_s.to_radians()
    }
}

impl Keyed for BodySpec {
    fn keys(&mut self, to: &mut dyn Keys) {
        let BodySpec {
            radius_m,
            height_m,
            antenna_height_m,
            max_speed_mps,
            acceleration_mps2,
            braking_mps2,
            turn_rate_deg_per_s,
        } = self;
        let mut number = |value, name, default, allowed, means| {
            to.number(
                value,
                Number {
                    name,
                    default,
                    allowed,
                    means,
                },
            );
        };
        number(radius_m, "radius_m", 0.25, 0.05..=2.0, "radius of the body");
        number(height_m, "height_m", 0.3, 0.05..=3.0, "height of the body");
        number(
            antenna_height_m,
            "antenna_height_m",
            0.5,
            0.05..=10.0,
            "height of a rover's antenna above the ground; a copter's is at its altitude",
        );
        number(
            max_speed_mps,
            "max_speed_mps",
            0.5,
            0.01..=20.0,
            "speed limit",
        );
        number(
            acceleration_mps2,
            "acceleration_mps2",
            0.5,
            0.01..=20.0,
            "acceleration",
        );
        number(braking_mps2, "braking_mps2", 1.0, 0.01..=20.0, "braking");
        number(
            turn_rate_deg_per_s,
            "turn_rate_deg_per_s",
            90.0,
            1.0..=720.0,
            "turn rate on the spot",
        );
    }
}

/// The margins that a vehicle keeps by itself; what the swarm agrees on stands in [`Swarm`](super::Swarm).
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Safety {
    /// Room around a vehicle's body that must be known free, metres.
    pub padding_m: f64,
    /// Below this charge a vehicle returns by itself, 0 to 1.
    pub battery_return: f64,
    /// Below this charge it stays where it is, 0 to 1.
    pub battery_hold: f64,
    /// A reading nearer than this from where it drives to halts it, however slow it is, metres; 0 = only when it could
    /// not stop otherwise.
    pub closeness_m: f64,
}

impl Default for Safety {
    /// Returns what holds when nothing is said.
    fn default() -> Safety {
        let mut safety = Safety {
            padding_m: 0.0,
            battery_return: 0.0,
            battery_hold: 0.0,
            closeness_m: 0.0,
        };
        read_defaults(&mut safety);
        safety
    }
}

impl Safety {
    /// Checks its keys together.
    pub(super) fn check(&self, source: &Source<'_>) {
        if self.battery_hold > self.battery_return {
            let wrong = "is above battery_return: nobody would come home";
            source.refuse(
                "safety.battery_hold",
                wrong,
                "at most battery_return is allowed",
            );
        }
    }
}

impl Keyed for Safety {
    fn keys(&mut self, to: &mut dyn Keys) {
        let Safety {
            padding_m,
            battery_return,
            battery_hold,
            closeness_m,
        } = self;
        to.number(
            padding_m,
            Number {
                name: "padding_m",
                default: 0.1,
                allowed: 0.0..=5.0,
                means: "room around the body that must be known free",
            },
        );
        to.number(
            battery_return,
            Number {
                name: "battery_return",
                default: 0.2,
                allowed: 0.0..=1.0,
                means: "below this charge a vehicle returns",
            },
        );
        to.number(
            battery_hold,
            Number {
                name: "battery_hold",
                default: 0.05,
                allowed: 0.0..=1.0,
                means: "below this charge it stays where it is",
            },
        );
        to.number(closeness_m, Number {
            name: "closeness_m",
            default: 0.0,
            allowed: 0.0..=10.0,
            means: "a reading nearer than this from where a vehicle drives to halts it, however slow; 0: only when it \
                    could not stop otherwise",
        });
    }
}

/// Returns what a vehicle surely sees and how it stops, the one rule for its speed: the corridor that must be known free
/// ends half a cell's diagonal before the sure range, every beam is looked along once a cycle, and one reading later
/// the brakes are told. `pose_sd_m` is the deviation of its place, metres.
pub(super) fn sensing_limits(
    body: &BodySpec,
    look: &SensorCoverage,
    safety: &Safety,
    cell_m: f64,
    pose_sd_m: f64,
) -> SensingLimits {
    let corridor_m = body.radius_m + safety.padding_m + 2.0 * pose_sd_m;
    SensingLimits {
        range_m: look.sure_range_m,
        margin_m: corridor_m + cell_m * std::f64::consts::FRAC_1_SQRT_2,
        scan_period_s: look.cycle().as_secs_f64(),
        latency_s: look.longest_period().as_secs_f64(),
        braking_mps2: body.braking_mps2,
    }
}

/// Returns what decides which posts a vehicle does not touch: after a round of all beams, one reading (until the servo stands
/// and the farthest echo is heard) and the reaction of its reflex it brakes, and its body, twice the deviation of its place
/// and half a cell's diagonal still fit before the post; the padding does not count. `pose_sd_m` is the deviation of its
/// place, metres.
pub(super) fn contact_limits(
    body: &BodySpec,
    look: &SensorCoverage,
    cell_m: f64,
    pose_sd_m: f64,
) -> ContactLimits {
    let width_m = body.radius_m + 2.0 * pose_sd_m;
    ContactLimits {
        detection: look.post_detection(look.max_range_m.min(look.farness_m)),
        clear_m: width_m + cell_m * std::f64::consts::FRAC_1_SQRT_2,
        seen_from_m: look.seen_from_m(width_m),
        delay_s: look.cycle().as_secs_f64() + look.reading_s() + REACTION_S,
        braking_mps2: body.braking_mps2,
    }
}
