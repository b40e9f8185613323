//! Range sensors: where they sit, where they look and how far, and what they cannot do. What a reading means for the map
//! is not known here.

use std::time::Duration;

use super::forms::seconds;
use super::keys::{Keyed, Keys, List, Number, NumberBounds, Numbers, Rowed, WordChoice, Words};
use super::source::Source;
use crate::geom::Angle;
use crate::plan::{Mount, Mounts, PostDetection, SOUND_MPS, echo_time_s};

/// A range sensor on a servo, which looks along its beams in turn.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct RangeSensor {
    /// What the vehicle itself knows of it.
    pub look: SensorCoverage,
    /// Height above the ground, metres.
    pub height_m: f64,
    /// Angle between beam and the surface's normal beyond which no echo returns, degrees.
    pub incidence_limit_deg: f64,
    /// Standard deviation of a reading, metres.
    pub noise_sd_m: f64,
    /// Where it listens.
    pub lobe: Lobe,
    /// Share of the pings that are answered by something else, 0 to 1.
    pub glitch_share: f64,
}

/// Where a range sensor listens.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Lobe {
    /// Along one ray.
    Beam,
    /// In the plane of the vehicle, between the edges of the cone.
    #[default]
    Fan,
    /// In the whole cone.
    Cone,
}

impl WordChoice for Lobe {
    const WORDS: &'static [(&'static str, Lobe)] = &[
        ("fan", Lobe::Fan),
        ("beam", Lobe::Beam),
        ("cone", Lobe::Cone),
    ];
}

impl RangeSensor {
    /// Returns the angle between beam and the surface's normal beyond which no echo returns, radians.
    pub fn incidence_limit_rad(&self) -> f64 {
        self.incidence_limit_deg.to_radians()
    }
}

impl Keyed for RangeSensor {
    fn keys(&mut self, to: &mut dyn Keys) {
        let RangeSensor {
            look,
            height_m,
            incidence_limit_deg,
            noise_sd_m,
            lobe,
            glitch_share,
        } = self;
        look.keys(to);
        to.number(
            height_m,
            Number {
                name: "height_m",
                default: 0.3,
                allowed: 0.02..=10.0,
                means: "height above the ground",
            },
        );
        to.number(
            incidence_limit_deg,
            Number {
                name: "incidence_limit_deg",
                default: INCIDENCE_LIMIT_DEG,
                allowed: 5.0..=90.0,
                means: "angle between beam and the surface's normal beyond which no echo returns",
            },
        );
        to.number(
            noise_sd_m,
            Number {
                name: "noise_sd_m",
                default: 0.01,
                allowed: 0.0..=1.0,
                means: "standard deviation of a reading",
            },
        );
        let means =
            "where it listens: along one ray, in the plane of the vehicle, or all around the axis";
        to.word(
            lobe,
            Words {
                name: "lobe",
                default: Lobe::Fan.word(),
                means,
            },
        );
        to.number(
            glitch_share,
            Number {
                name: "glitch_share",
                default: 0.0,
                allowed: 0.0..=0.5,
                means: "share of the readings that are anywhere in the range",
            },
        );
    }
}

/// What a vehicle knows of its own range sensor, simulated or real: where it looks and how far.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct SensorCoverage {
    /// Directions of the beams against the vehicle's heading, in the order in which they are looked along, degrees.
    pub beams_deg: Vec<f64>,
    /// Half the opening of the cone, degrees.
    pub half_angle_deg: f64,
    /// Nearest echo, metres.
    pub min_range_m: f64,
    /// Farthest echo, metres.
    pub max_range_m: f64,
    /// Up to here no echo means that nothing is there, metres.
    pub sure_range_m: f64,
    /// Time from one reading to the next (one beam each), seconds.
    pub scan_period_s: f64,
    /// Time that the servo needs to come to rest, part of the period, seconds.
    pub settle_s: f64,
    /// Echoes from farther away are ignored, metres.
    pub farness_m: f64,
    /// Radius of an upright dowel whose farthest echo was measured, metres.
    pub dowel_radius_m: f64,
    /// How far away that dowel was heard, metres.
    pub dowel_range_m: f64,
    /// Posts of this radius and thicker ones must not be touched, metres; `None` = of that which the speed covers.
    pub smallest_radius_m: Option<f64>,
    /// Where the sensors sit; without any there is one that is pointed anywhere at once.
    pub sensors: Vec<SensorMount>,
}

/// Where one range sensor sits and how far its servo turns it.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct SensorMount {
    /// Direction of the servo's zero against the heading, degrees.
    pub mount_deg: f64,
    /// The servo turns from here, degrees against its zero.
    pub servo_from_deg: f64,
    /// The servo turns up to here, degrees.
    pub servo_to_deg: f64,
    /// Time that it needs for a turn of 60°, seconds.
    pub slew_s_per_60_deg: f64,
}

/// The key of the sure range.
pub(super) const SURE_RANGE: &str = "range.sure_range_m";
/// How many range sensors a vehicle may have.
const SENSORS: usize = 8;
/// Up to here no echo means that nothing is there, unless a file says otherwise, metres.
pub(super) const SURE_RANGE_M: f64 = 3.0;
/// Angle between beam and the surface's normal beyond which no echo returns, unless a file says otherwise, degrees.
pub(super) const INCIDENCE_LIMIT_DEG: f64 = 60.0;

impl SensorCoverage {
    /// Returns the directions of the beams against the heading, in their order.
    pub fn beams(&self) -> Vec<Angle> {
        self.beams_deg
            .iter()
            .map(|beam_deg| Angle::from_degrees(*beam_deg))
            .collect()
    }

    /// Returns half the opening of the cone, radians.
    pub fn half_angle_rad(&self) -> f64 {
        self.half_angle_deg.to_radians()
    }

    /// Returns the time from one reading to the next.
    pub fn scan_period(&self) -> Duration {
        seconds(self.scan_period_s)
    }

    /// Returns the time that the servo needs to come to rest.
    pub fn settle(&self) -> Duration {
        seconds(self.settle_s)
    }

    /// Returns which sensor looks where.
    pub fn mounts(&self) -> Mounts {
        Mounts::new(self.sensors.iter().map(SensorMount::mount).collect())
    }

    /// Returns the time in which every beam is looked along once.
    pub fn cycle(&self) -> Duration {
        self.scan_period() * u32::try_from(self.beams_deg.len()).unwrap_or(u32::MAX)
            + self.mounts().slew_of_round(&self.beams())
    }

    /// Returns the longest time between two readings: the period, and the longest turn of a servo.
    pub fn longest_period(&self) -> Duration {
        let mounts = self.mounts();
        let turns = mounts
            .all()
            .iter()
            .map(|mount| mount.slew(mount.from_rad, mount.to_rad));
        self.scan_period() + turns.max().unwrap_or_default()
    }

    /// Returns how far away posts are heard, by the measured dowel, up to a farthest echo, metres.
    pub fn post_detection(&self, farthest_m: f64) -> PostDetection {
        PostDetection::measured(self.dowel_radius_m, self.dowel_range_m, farthest_m)
    }

    /// Returns from where on the beams together look along the whole width of a strip straight ahead, metres from the sensor:
    /// nearer than that what stands at the strip's border may lie beside all beams or in the blind zone. Infinite when they
    /// leave a gap ahead.
    pub(super) fn seen_from_m(&self, half_width_m: f64) -> f64 {
        let ahead_deg = self.covered_deg(1.0).min(self.covered_deg(-1.0)).min(90.0);
        let border_m = half_width_m / libm::sin(ahead_deg.to_radians());
        border_m.max(self.min_range_m)
    }

    /// Returns up to which angle the beams leave no gap to one side (1: left, -1: right) of straight ahead, degrees.
    fn covered_deg(&self, side: f64) -> f64 {
        let mut middles_deg: Vec<f64> = self.beams_deg.iter().map(|beam| side * beam).collect();
        middles_deg.sort_by(f64::total_cmp);
        middles_deg
            .iter()
            .fold(0.0, |covered_deg: f64, middle_deg| {
                if middle_deg - self.half_angle_deg <= covered_deg {
                    covered_deg.max(middle_deg + self.half_angle_deg)
                } else {
                    covered_deg
                }
            })
    }

    /// Returns the time that one reading takes at most: until the servo stands and the farthest echo is heard, seconds.
    pub(super) fn reading_s(&self) -> f64 {
        self.settle_s + echo_time_s(self.max_range_m, SOUND_MPS)
    }

    /// Checks the keys of `[range]` together.
    pub(super) fn check(&self, source: &Source<'_>) {
        source.remember_default(SURE_RANGE, self.sure_range_m);
        self.check_limits(source);
        let refuse = |key: &str, wrong: &str, allowed: &str| source.refuse(key, wrong, allowed);
        if self.sure_range_m > self.max_range_m {
            refuse(
                SURE_RANGE,
                "is beyond max_range_m",
                "at most max_range_m is allowed",
            );
        }
        if self.min_range_m >= self.sure_range_m {
            refuse(
                "range.min_range_m",
                "leaves nothing to see",
                "less than sure_range_m is allowed",
            );
        }
        if self.settle() >= self.scan_period() {
            let wrong = "leaves no time for a reading";
            refuse(
                "range.settle_s",
                wrong,
                "less than scan_period_s is allowed",
            );
        }
        if source.is_known("range.farness_m") && self.farness_m < self.sure_range_m {
            let wrong = "is nearer than sure_range_m: what stands there would be taken for free";
            refuse("range.farness_m", wrong, "at least sure_range_m is allowed");
        }
        self.check_sensors(source);
    }

    fn check_limits(&self, source: &Source<'_>) {
        for (index, sensor) in self.sensors.iter().enumerate() {
            if sensor.servo_to_deg < sensor.servo_from_deg {
                let key = format!("range.sensor[{index}].servo_to_deg");
                source.refuse(
                    &key,
                    "is below servo_from_deg",
                    "at least servo_from_deg is allowed",
                );
            }
        }
    }

    fn check_sensors(&self, source: &Source<'_>) {
        if self.sensors.is_empty() || !source.is_sound(&["range.sensor"]) {
            return;
        }
        let mounts = self.mounts();
        for beam in self
            .beams()
            .into_iter()
            .filter(|beam| mounts.aim(*beam).is_none())
        {
            let wrong = format!("{:.0}° is reached by no servo", beam.degrees());
            let allowed = match source.is_known("range.sensor") {
                true => "directions within the limits of a [[range.sensor]] are allowed",
                false => "[0], straight ahead, is allowed without a servo",
            };
            source.refuse("range.beams_deg", &wrong, allowed);
        }
        let echo = Duration::from_secs_f64(echo_time_s(self.max_range_m, SOUND_MPS));
        if mounts.all().len() > 1 && self.scan_period().saturating_sub(self.settle()) < echo {
            let wrong = "lets the next sensor hear the echo of the last: less than an echo from max_range_m takes";
            source.refuse(
                "range.scan_period_s",
                wrong,
                "more is needed, or a shorter range",
            );
        }
    }
}

impl Keyed for SensorCoverage {
    fn keys(&mut self, to: &mut dyn Keys) {
        self.keys_with(false, to, &mut |sensor, _, to| sensor.keys(to));
    }
}

impl SensorCoverage {
    /// Shows its keys, and those of each sensor by a function that is told its number; where nothing turns them, what is left
    /// out looks straight ahead.
    pub(super) fn keys_with(
        &mut self,
        is_fixed: bool,
        to: &mut dyn Keys,
        sensor_keys: &mut dyn FnMut(&mut SensorMount, usize, &mut dyn Keys),
    ) {
        let default_beams_deg: &[f64] = match is_fixed {
            true => &[0.0],
            false => &[0.0, 25.0, -25.0, 50.0, -50.0],
        };
        self.show(default_beams_deg, to, sensor_keys);
    }

    /// Makes the sensors fixed: without any there is one that looks straight ahead. One that has limits to be turned
    /// within is refused.
    pub(super) fn fix(&mut self, source: &Source<'_>) {
        for (index, sensor) in self.sensors.iter().enumerate() {
            if sensor.servo_from_deg != sensor.servo_to_deg {
                let key = format!("range.sensor[{index}].servo_to_deg");
                let wrong = "needs a servo, and the servo's driver is \"none\"";
                source.refuse(
                    &key,
                    wrong,
                    "the same as servo_from_deg is allowed for a sensor that is fixed",
                );
            }
        }
        if self.sensors.is_empty() {
            self.sensors.push(SensorMount::default());
        }
    }

    fn show(
        &mut self,
        default_beams_deg: &'static [f64],
        to: &mut dyn Keys,
        sensor_keys: &mut dyn FnMut(&mut SensorMount, usize, &mut dyn Keys),
    ) {
        let SensorCoverage {
            beams_deg,
            half_angle_deg,
            min_range_m,
            max_range_m,
            sure_range_m,
            scan_period_s,
            settle_s,
            farness_m,
            dowel_radius_m,
            dowel_range_m,
            smallest_radius_m,
            sensors,
        } = self;
        to.numbers(
            beams_deg,
            Numbers {
                name: "beams_deg",
                default: default_beams_deg,
                count: 1..=64,
                allowed: -180.0..=180.0,
                means: "directions against the heading, looked along in this order",
            },
        );
        to.number(
            max_range_m,
            Number::new("max_range_m", 4.0, 0.1..=200.0, "farthest echo"),
        );
        to.number(
            half_angle_deg,
            Number::new(
                "half_angle_deg",
                15.0,
                0.1..=60.0,
                "half the opening of the cone",
            ),
        );
        to.number(
            min_range_m,
            Number::new("min_range_m", 0.02, 0.0..=5.0, "nearest echo"),
        );
        let mut sure = Some(*sure_range_m);
        to.maybe_number(
            &mut sure,
            NumberBounds {
                name: "sure_range_m",
                left_out: "3, less for beams that see nothing beside the vehicle",
                allowed: 0.1..=200.0,
                means: "up to here no echo means that nothing is there; at most (`radius_m` + `padding_m`) / cos \
                        `incidence_limit_deg` for beams that see nothing beside the vehicle, and above 3 for quick rounds of all beams \
                        only, see below",
            },
        );
        *sure_range_m = sure.unwrap_or(SURE_RANGE_M);
        let means = "from one reading to the next, one beam each";
        to.number(
            scan_period_s,
            Number::new("scan_period_s", 0.1, 0.001..=10.0, means),
        );
        let means = "time that the servo needs to come to rest, part of scan_period_s";
        to.number(settle_s, Number::new("settle_s", 0.03, 0.0..=10.0, means));
        let mut farness = Some(*farness_m);
        to.maybe_number(
            &mut farness,
            NumberBounds {
                name: "farness_m",
                left_out: "max_range_m",
                allowed: 0.1..=200.0,
                means: "echoes from farther away are ignored",
            },
        );
        *farness_m = farness.unwrap_or(*max_range_m);
        let means = "radius of an upright dowel whose farthest echo was measured; by it everything is judged that is small";
        to.number(
            dowel_radius_m,
            Number::new("dowel_radius_m", 0.01, 0.001..=1.0, means),
        );
        let means = "how far away that dowel was heard";
        to.number(
            dowel_range_m,
            Number::new("dowel_range_m", 0.7, 0.05..=50.0, means),
        );
        to.maybe_number(
            smallest_radius_m,
            NumberBounds {
                name: "smallest_radius_m",
                left_out: "what the speed covers",
                allowed: 0.001..=10.0,
                means: "posts of this radius and thicker ones must not be touched; refused when the speed does not cover it",
            },
        );
        to.rows(&mut List { list: sensors, keys: sensor_keys }, Rowed {
            name: "sensor",
            most: SENSORS,
            means: "range sensors, which ping in turn; without any there is one that is pointed anywhere at once. A \
                    beam is looked along by the sensor that turns least from the middle of its limits; one that none \
                    reaches is refused",
        });
    }
}

impl SensorMount {
    /// Returns it in radians.
    pub fn mount(&self) -> Mount {
        Mount {
            zero: Angle::from_degrees(self.mount_deg),
            from_rad: self.servo_from_deg.to_radians(),
            to_rad: self.servo_to_deg.max(self.servo_from_deg).to_radians(),
            slew_s_per_rad: self.slew_s_per_60_deg / 60f64.to_radians(),
        }
    }
}

impl Keyed for SensorMount {
    fn keys(&mut self, to: &mut dyn Keys) {
        let SensorMount {
            mount_deg,
            servo_from_deg,
            servo_to_deg,
            slew_s_per_60_deg,
        } = self;
        let turn = -180.0..=180.0;
        let means = "where the servo's zero points, against the heading";
        to.number(
            mount_deg,
            Number::new("mount_deg", 0.0, turn.clone(), means),
        );
        let means = "the servo turns from here, against its zero";
        to.number(
            servo_from_deg,
            Number::new("servo_from_deg", 0.0, turn.clone(), means),
        );
        to.number(
            servo_to_deg,
            Number::new(
                "servo_to_deg",
                0.0,
                turn,
                "up to here; both equal: no servo",
            ),
        );
        let means = "time to turn by 60°, beside settle_s";
        to.number(
            slew_s_per_60_deg,
            Number::new("slew_s_per_60_deg", 0.15, 0.0..=10.0, means),
        );
    }
}
