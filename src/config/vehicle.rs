//! What vehicles can do, what their range sensor sees, and the margins that they keep. The reading
//! half gives every key its default and its limits.

use std::ops::RangeInclusive;
use std::time::Duration;

use super::section::Section;
use crate::geom::Angle;
use crate::plan::{Mount, Mounts, Sight};

/// How many vehicles a simulation may have: as many as the planners can keep apart on one ring.
pub(super) const SWARM: RangeInclusive<usize> = 2..=8;
/// How many vehicles a simulation may have that follow no plan of the ground station.
pub(super) const PARTY: RangeInclusive<usize> = 1..=8;
/// How many vehicles a world may hold for others who drive them.
pub(super) const CROWD: RangeInclusive<usize> = 2..=250;

/// The vehicles of a simulation, all alike; their ids are 1 to `count`.
#[derive(Clone, PartialEq, Debug)]
pub struct Vehicles {
    /// How many.
    pub count: usize,
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
    /// Turn rate on the spot, radians per second.
    pub turn_rate_rad_per_s: f64,
    /// Standard deviation of each coordinate of the measured place, metres.
    pub pose_sd_m: f64,
    /// Time over which the error of the measured place drifts by its own size, seconds.
    pub pose_correlation_s: f64,
    /// How long a full battery lasts while driving.
    pub endurance_driving: Duration,
    /// How long a full battery lasts at rest.
    pub endurance_resting: Duration,
}

/// The body of one vehicle and how it moves.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Body {
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
    /// Turn rate on the spot, radians per second.
    pub turn_rate_rad_per_s: f64,
}

impl Body {
    /// Reads its keys out of a table that may hold others.
    pub(super) fn read_keys(section: &Section) -> Body {
        Body {
            radius_m: section.number("radius_m", 0.25, 0.05..=2.0),
            height_m: section.number("height_m", 0.3, 0.05..=3.0),
            antenna_height_m: section.number("antenna_height_m", 0.5, 0.05..=10.0),
            max_speed_mps: section.number("max_speed_mps", 0.5, 0.01..=20.0),
            acceleration_mps2: section.number("acceleration_mps2", 0.5, 0.01..=20.0),
            braking_mps2: section.number("braking_mps2", 1.0, 0.01..=20.0),
            turn_rate_rad_per_s: section.number("turn_rate_deg_per_s", 90.0, 1.0..=720.0).to_radians(),
        }
    }
}

impl Vehicles {
    /// Gives the body that all of them have.
    pub fn body(&self) -> Body {
        Body {
            radius_m: self.radius_m,
            height_m: self.height_m,
            antenna_height_m: self.antenna_height_m,
            max_speed_mps: self.max_speed_mps,
            acceleration_mps2: self.acceleration_mps2,
            braking_mps2: self.braking_mps2,
            turn_rate_rad_per_s: self.turn_rate_rad_per_s,
        }
    }

    pub(super) fn read(section: &Section, count: Option<usize>, allowed: RangeInclusive<usize>) -> Vehicles {
        let in_file = section.whole("count", 2, allowed.clone());
        if let Some(count) = count {
            section.replace("count", count, allowed.clone());
        }
        let body = Body::read_keys(section);
        let vehicles = Vehicles {
            // A number that was refused is not reckoned with.
            count: count.filter(|count| allowed.contains(count)).unwrap_or(in_file),
            radius_m: body.radius_m,
            height_m: body.height_m,
            antenna_height_m: body.antenna_height_m,
            max_speed_mps: body.max_speed_mps,
            acceleration_mps2: body.acceleration_mps2,
            braking_mps2: body.braking_mps2,
            turn_rate_rad_per_s: body.turn_rate_rad_per_s,
            pose_sd_m: section.number("pose_sd_m", 0.05, 0.0..=5.0),
            pose_correlation_s: section.number("pose_correlation_s", 20.0, 0.1..=3600.0),
            endurance_driving: section.duration("endurance_driving_s", 21_600.0, 1.0..=1e6),
            endurance_resting: section.duration("endurance_resting_s", 86_400.0, 1.0..=1e6),
        };
        section.finish();
        vehicles
    }
}

/// A range sensor on a servo, which looks along its beams in turn.
#[derive(Clone, PartialEq, Debug)]
pub struct RangeSensor {
    /// Height above the ground, metres.
    pub height_m: f64,
    /// Directions of the beams against the vehicle's heading, in the order in which they are looked
    /// along.
    pub beams: Vec<Angle>,
    /// Half the opening of the cone, radians.
    pub half_angle_rad: f64,
    /// Nearest echo, metres.
    pub min_range_m: f64,
    /// Farthest echo, metres.
    pub max_range_m: f64,
    /// Up to here no echo means that nothing is there, metres.
    pub sure_range_m: f64,
    /// Time from one reading to the next (one beam each).
    pub scan_period: Duration,
    /// Time that the servo needs to point, part of the period.
    pub settle: Duration,
    /// Angle between beam and the surface's normal beyond which no echo returns, radians.
    pub incidence_limit_rad: f64,
    /// Standard deviation of a reading, metres.
    pub noise_sd_m: f64,
    /// Where it listens.
    pub lobe: Lobe,
    /// Share of the pings that are answered by something else, 0 to 1.
    pub glitch_share: f64,
    /// Echoes from farther away are ignored, metres.
    pub farness_m: f64,
    /// Which sensor looks where.
    pub mounts: Mounts,
}

/// Where a range sensor listens.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Lobe {
    /// Along one ray.
    Beam,
    /// In the plane of the vehicle, between the edges of the cone.
    Fan,
    /// In the whole cone.
    Cone,
}

impl RangeSensor {
    pub(super) fn read(section: &Section) -> RangeSensor {
        let look = Look::read_keys(section);
        let lobes = [("fan", Lobe::Fan), ("beam", Lobe::Beam), ("cone", Lobe::Cone)];
        let sensor = RangeSensor {
            height_m: section.number("height_m", 0.3, 0.02..=10.0),
            beams: look.beams,
            half_angle_rad: look.half_angle_rad,
            min_range_m: look.min_range_m,
            max_range_m: look.max_range_m,
            sure_range_m: look.sure_range_m,
            scan_period: look.scan_period,
            settle: look.settle,
            incidence_limit_rad: section.number("incidence_limit_deg", 60.0, 5.0..=90.0).to_radians(),
            noise_sd_m: section.number("noise_sd_m", 0.01, 0.0..=1.0),
            lobe: section.choice("lobe", Lobe::Fan, &lobes),
            glitch_share: section.number("glitch_share", 0.0, 0.0..=0.5),
            farness_m: look.farness_m,
            mounts: look.mounts,
        };
        section.finish();
        sensor
    }

    /// Gives what the vehicle itself knows of its sensor.
    pub fn look(&self) -> Look {
        Look {
            beams: self.beams.clone(),
            half_angle_rad: self.half_angle_rad,
            min_range_m: self.min_range_m,
            max_range_m: self.max_range_m,
            sure_range_m: self.sure_range_m,
            scan_period: self.scan_period,
            settle: self.settle,
            farness_m: self.farness_m,
            mounts: self.mounts.clone(),
        }
    }

    /// Gives the time in which every beam is looked along once.
    pub fn look_cycle(&self) -> Duration {
        self.look().cycle()
    }
}

/// What a vehicle knows of its own range sensor, simulated or real: where it looks and how far.
#[derive(Clone, PartialEq, Debug)]
pub struct Look {
    /// Directions of the beams against the vehicle's heading, in the order in which they are looked along.
    pub beams: Vec<Angle>,
    /// Half the opening of the cone, radians.
    pub half_angle_rad: f64,
    /// Nearest echo, metres.
    pub min_range_m: f64,
    /// Farthest echo, metres.
    pub max_range_m: f64,
    /// Up to here no echo means that nothing is there, metres.
    pub sure_range_m: f64,
    /// Time from one reading to the next (one beam each).
    pub scan_period: Duration,
    /// Time that the servo needs to come to rest, part of the period.
    pub settle: Duration,
    /// Echoes from farther away are ignored, metres.
    pub farness_m: f64,
    /// Which sensor looks where; a single one that reaches every direction unless the file says otherwise.
    pub mounts: Mounts,
}

/// How many range sensors a vehicle may have.
const SENSORS: usize = 8;
/// Speed of sound, m/s.
const SOUND_MPS: f64 = 343.0;

impl Look {
    /// Reads its keys out of a table that may hold others.
    pub(super) fn read_keys(section: &Section) -> Look {
        let beams = section.numbers("beams_deg", &[0.0, 25.0, -25.0, 50.0, -50.0], 1..=64, -180.0..=180.0);
        let max_range_m = section.number("max_range_m", 4.0, 0.1..=200.0);
        let look = Look {
            beams: beams.into_iter().map(Angle::from_degrees).collect(),
            half_angle_rad: section.number("half_angle_deg", 15.0, 0.1..=60.0).to_radians(),
            min_range_m: section.number("min_range_m", 0.02, 0.0..=5.0),
            max_range_m,
            sure_range_m: section.number("sure_range_m", 3.0, 0.1..=200.0),
            scan_period: section.duration("scan_period_s", 0.1, 0.001..=10.0),
            settle: section.duration("settle_s", 0.03, 0.0..=10.0),
            farness_m: section.optional_number("farness_m", 0.1..=200.0).unwrap_or(max_range_m),
            mounts: Mounts::new(section.sections("sensor", SENSORS).iter().map(read_mount).collect()),
        };
        look.check(section);
        look
    }

    fn check(&self, section: &Section) {
        let look = self;
        if look.sure_range_m > look.max_range_m {
            section.refuse("sure_range_m", "is beyond max_range_m", "at most max_range_m is allowed");
        }
        if look.min_range_m >= look.sure_range_m {
            section.refuse("min_range_m", "leaves nothing to see", "less than sure_range_m is allowed");
        }
        if look.settle >= look.scan_period {
            section.refuse("settle_s", "leaves no time for a reading", "less than scan_period_s is allowed");
        }
        if look.farness_m < look.sure_range_m {
            let wrong = "is nearer than sure_range_m: what stands there would be taken for free";
            section.refuse("farness_m", wrong, "at least sure_range_m is allowed");
        }
        self.check_sensors(section);
    }

    fn check_sensors(&self, section: &Section) {
        if !section.has("sensor") || !section.source.is_sound(&["range.sensor"]) {
            return;
        }
        for beam in self.beams.iter().filter(|beam| self.mounts.aim(**beam).is_none()) {
            let wrong = format!("{:.0}° is reached by no servo", beam.degrees());
            section.refuse(
                "beams_deg",
                &wrong,
                "directions within the limits of a [[range.sensor]] are allowed",
            );
        }
        let echo = Duration::from_secs_f64(2.0 * self.max_range_m / SOUND_MPS);
        if self.mounts.all().len() > 1 && self.scan_period.saturating_sub(self.settle) < echo {
            let wrong =
                "lets the next sensor hear the echo of the last: less than an echo from max_range_m takes";
            section.refuse("scan_period_s", wrong, "more is needed, or a shorter range");
        }
    }

    /// Gives the time in which every beam is looked along once.
    pub fn cycle(&self) -> Duration {
        self.scan_period * u32::try_from(self.beams.len()).unwrap_or(u32::MAX)
            + self.mounts.slew_of_round(&self.beams)
    }

    /// Gives the longest time between two readings: the period, and the longest turn of a servo.
    pub fn longest_period(&self) -> Duration {
        let turns = self.mounts.all().iter().map(|mount| mount.slew(mount.from_rad, mount.to_rad));
        self.scan_period + turns.max().unwrap_or_default()
    }
}

fn read_mount(section: &Section) -> Mount {
    let (from_deg, to_deg) = (
        section.number("servo_from_deg", 0.0, -180.0..=180.0),
        section.number("servo_to_deg", 0.0, -180.0..=180.0),
    );
    if to_deg < from_deg {
        section.refuse("servo_to_deg", "is below servo_from_deg", "at least servo_from_deg is allowed");
    }
    let slew_s_per_60_deg = section.number("slew_s_per_60_deg", 0.15, 0.0..=10.0);
    let mount = Mount {
        zero: Angle::from_degrees(section.number("mount_deg", 0.0, -180.0..=180.0)),
        from_rad: from_deg.to_radians(),
        to_rad: to_deg.max(from_deg).to_radians(),
        slew_s_per_rad: slew_s_per_60_deg / 60f64.to_radians(),
    };
    section.finish();
    mount
}

/// The margins that vehicles keep.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Safety {
    /// Room around a vehicle's body that must be known free, metres.
    pub padding_m: f64,
    /// Smallest distance between two vehicles, middle to middle, metres.
    pub separation_m: f64,
    /// Above this deviation of the place nothing is measured or mapped, metres.
    pub pose_sd_max_m: f64,
    /// How long a vehicle carries on when it hears nobody on the bus; then it returns.
    pub autonomy: Duration,
    /// Below this charge a vehicle returns by itself, 0 to 1.
    pub battery_return: f64,
    /// Below this charge it stays where it is, 0 to 1.
    pub battery_hold: f64,
    /// A reading nearer than this from where it drives to halts it, however slow it is, metres; 0 = only when it could
    /// not stop otherwise.
    pub closeness_m: f64,
}

impl Safety {
    pub(super) fn read(section: &Section) -> Safety {
        let safety = Safety {
            padding_m: section.number("padding_m", 0.1, 0.0..=5.0),
            separation_m: read_separation_m(section),
            pose_sd_max_m: section.number("pose_sd_max_m", 0.5, 0.01..=10.0),
            autonomy: section.duration("autonomy_s", 60.0, 3.0..=86_400.0),
            battery_return: section.number("battery_return", 0.2, 0.0..=1.0),
            battery_hold: section.number("battery_hold", 0.05, 0.0..=1.0),
            closeness_m: section.number("closeness_m", 0.0, 0.0..=10.0),
        };
        if safety.battery_hold > safety.battery_return {
            section.refuse(
                "battery_hold",
                "is above battery_return: nobody would come home",
                "at most battery_return is allowed",
            );
        }
        section.finish();
        safety
    }
}

/// Reads the smallest distance between two vehicles, middle to middle, metres.
pub(super) fn read_separation_m(section: &Section) -> f64 {
    section.number("separation_m", 1.0, 0.1..=20.0)
}

/// Gives what a vehicle surely sees and how it stops, the one rule for its speed: the corridor that must be known free
/// ends half a cell's diagonal before the sure range, every beam is looked along once a cycle, and one reading later
/// the brakes are told. `pose_sd_m` is the deviation of its place, metres.
pub(super) fn sight(body: &Body, look: &Look, safety: &Safety, cell_m: f64, pose_sd_m: f64) -> Sight {
    let corridor_m = body.radius_m + safety.padding_m + 2.0 * pose_sd_m;
    Sight {
        range_m: look.sure_range_m,
        margin_m: corridor_m + cell_m * std::f64::consts::FRAC_1_SQRT_2,
        scan_period_s: look.cycle().as_secs_f64(),
        latency_s: look.longest_period().as_secs_f64(),
        braking_mps2: body.braking_mps2,
    }
}
