//! What an autopilot says of distances, and which of the vehicle's range sensors has measured them: DISTANCE_SENSOR, of a
//! sensor that it names by the direction in which it is mounted, and OBSTACLE_DISTANCE, of one that looks all around.
//!
//! *Nothing is there* frees the ground, so it is said only by who has looked: an OBSTACLE_DISTANCE whose every element within
//! the cone says so, or a DISTANCE_SENSOR whose number the vehicle's file names for it. What is invalid, out of its own range
//! or of unknown age is no reading at all. A message that was under way for long is as old as its own clock shows.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use super::DriverOut;
use crate::geom::Angle;
use crate::mavlink::dialect::{
    DISTANCE_SENSOR_DATA, MavFrame, MavMessage, MavSensorOrientation, OBSTACLE_DISTANCE_DATA,
};
use crate::mavlink::frames::MavAddress;
use crate::time::Time;

/// The message that a sensor's distance comes in.
pub(super) const DISTANCE_SENSOR: u32 = 132;
/// An element of OBSTACLE_DISTANCE of which nothing is known, and a distance that no sensor says.
const UNKNOWN_CM: u16 = u16::MAX;
/// A signal of this quality is invalid; 0 = its quality is not known.
const INVALID_SIGNAL: u8 = 1;
/// A sensor is mounted where it says when it is this near to it, degrees.
const MOUNTED_WITHIN_DEG: f64 = 1.0;
/// The clock of a sender is known after so many messages: the first ones may have waited.
const KNOWN_AFTER: u32 = 5;
/// Two clocks run apart by at most one part in so many.
const DRIFT: i128 = 2000;
/// A clock that goes back by more than this was set or started anew; by less, a message was overtaken. One that is set back
/// unnoticed makes all that follows too old, until the clocks may have run apart by so much.
const SET_BACK: Duration = Duration::from_millis(200);

/// Which range sensors hang on an autopilot, and what their readings can mean.
#[derive(Clone, PartialEq, Debug)]
pub struct RangeSettings {
    /// The sensors.
    pub sensors: Vec<AutopilotSensor>,
    /// Half the opening of their cones.
    pub half_angle: Angle,
    /// Who says that nothing is there must look this far, metres.
    pub max_range_m: f64,
    /// How often a second the message is wanted.
    pub rate_hz: u16,
}

/// A range sensor that hangs on an autopilot.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct AutopilotSensor {
    /// Its number among those of the vehicle.
    pub sensor: usize,
    /// Where it is mounted, against the heading.
    pub mounted: Angle,
    /// Whether a servo turns it: then no message says where it looks.
    pub is_turned: bool,
    /// From here on a DISTANCE_SENSOR says that it has heard nothing, metres; `None` = it never says that.
    pub nothing_from_m: Option<f64>,
    /// Time from measuring to the message.
    pub delay: Duration,
}

/// A reading of a range sensor that hangs on an autopilot.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct AutopilotReading {
    /// The number of the sensor among those of the vehicle.
    pub sensor: usize,
    /// It was measured at this time or later.
    pub measured: Time,
    /// Distance to what is there, metres; `None` = the sensor says that nothing is.
    pub range_m: Option<f64>,
}

/// What became of what an autopilot said of distances.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct RangeTally {
    /// Messages for a sensor of the vehicle.
    pub heard: u64,
    /// Those of them that are no reading.
    pub dropped: u64,
    /// Why the last one was dropped; `None` when it was not.
    pub fault: Option<RangeFault>,
}

impl fmt::Display for RangeTally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let RangeTally {
            heard,
            dropped,
            fault,
        } = self;
        if *heard == 0 {
            return f.write_str("the autopilot says no distance along its direction");
        }
        write!(
            f,
            "{dropped} of {heard} distances of the autopilot were no reading"
        )?;
        fault.map_or(Ok(()), |fault| write!(f, ": {fault}"))
    }
}

/// Why a message is no reading.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum RangeFault {
    /// The sensor itself does not trust it.
    #[error("its signal is invalid (signal_quality 1)")]
    Invalid,
    /// The least distance is not below the greatest.
    #[error("it measures from {min_m:.2} to {max_m:.2} m, which is no range")]
    NoRange {
        /// The least, metres.
        min_m: f64,
        /// The greatest, metres.
        max_m: f64,
    },
    /// It is not within what the sensor measures.
    #[error("{range_m:.2} m is outside of its {min_m:.2} to {max_m:.2} m")]
    OutOfRange {
        /// What it says, metres.
        range_m: f64,
        /// The least, metres.
        min_m: f64,
        /// The greatest, metres.
        max_m: f64,
    },
    /// Nothing is there as far as it looks, and that is not far.
    #[error("it says that nothing is there, and looks {max_m:.2} m far, not {needed_m:.2} m")]
    Short {
        /// How far it looks, metres.
        max_m: f64,
        /// How far it should, metres.
        needed_m: f64,
    },
    /// Its directions count from north.
    #[error(
        "its directions are not the vehicle's (frame {frame}; 12, MAV_FRAME_BODY_FRD, is needed)"
    )]
    Frame {
        /// The number of its frame.
        frame: u8,
    },
    /// Its elements have no width.
    #[error("its elements have no width (increment)")]
    NoWidth,
    /// It knows nothing of a part of the cone.
    #[error("it knows nothing of a part of the cone at {beam_deg:.0}°")]
    Unknown {
        /// The middle of the cone, degrees against the heading.
        beam_deg: f64,
    },
    /// Its clock stands, or the same is said again.
    #[error("its time does not go on")]
    Repeated,
}

/// What has come of distances.
#[derive(Clone, Debug)]
pub(super) struct Ranges {
    settings: RangeSettings,
    /// Of each who says such messages, and of each kind of them.
    clocks: BTreeMap<(MavAddress, bool), SenderClock>,
    /// Of each sensor.
    tallies: BTreeMap<usize, RangeTally>,
}

/// The clock of one who says messages, as its own time and the moments of hearing show it.
#[derive(Clone, Copy, Debug)]
struct SenderClock {
    newest_ns: i128,
    heard_at: Time,
    /// Our time less its own, of the message that was under way for the shortest time, nanoseconds.
    least_ns: i128,
    messages: u32,
}

impl Ranges {
    pub(super) fn new(settings: RangeSettings) -> Ranges {
        Ranges {
            settings,
            clocks: BTreeMap::new(),
            tallies: BTreeMap::new(),
        }
    }

    /// Takes a message, if it is of distances; returns whether it is.
    pub(super) fn hear(
        &mut self,
        now: Time,
        from: MavAddress,
        message: &MavMessage,
        out: &mut Vec<DriverOut>,
    ) -> bool {
        match message {
            MavMessage::DISTANCE_SENSOR(said) => self.hear_distance(now, from, said, out),
            MavMessage::OBSTACLE_DISTANCE(said) => self.hear_obstacles(now, from, said, out),
            _ => return false,
        }
        true
    }

    /// Returns what became of the messages for each sensor, by its number.
    pub(super) fn tallies(&self) -> &BTreeMap<usize, RangeTally> {
        &self.tallies
    }

    fn hear_distance(
        &mut self,
        now: Time,
        from: MavAddress,
        said: &DISTANCE_SENSOR_DATA,
        out: &mut Vec<DriverOut>,
    ) {
        let Some(direction) = direction_of(said.orientation) else {
            return;
        };
        let within_rad = MOUNTED_WITHIN_DEG.to_radians();
        let all = self.settings.sensors.iter();
        let Some(sensor) = all
            .copied()
            .find(|sensor| sensor.mounted.is_near(direction, within_rad))
        else {
            return;
        };
        let own_ns = i128::from(said.time_boot_ms) * 1_000_000;
        // Sensors of one sender share its clock, and say the same time when they speak together.
        let said_at = self.said_at(now, (from, false), own_ns, true);
        let reading = self.settings.distance(said, sensor.nothing_from_m);
        self.conclude(sensor, said_at, reading, out);
    }

    fn hear_obstacles(
        &mut self,
        now: Time,
        from: MavAddress,
        said: &OBSTACLE_DISTANCE_DATA,
        out: &mut Vec<DriverOut>,
    ) {
        let own_ns = i128::from(said.time_usec) * 1000;
        let said_at = self.said_at(now, (from, true), own_ns, false);
        let sensors = self.settings.sensors.clone();
        for sensor in sensors.into_iter().filter(|sensor| !sensor.is_turned) {
            let reading = self.settings.obstacle(said, sensor.mounted);
            self.conclude(sensor, said_at, reading, out);
        }
    }

    /// Says a reading, or counts what is none.
    fn conclude(
        &mut self,
        sensor: AutopilotSensor,
        said: Result<Option<Time>, RangeFault>,
        reading: Result<Option<f64>, RangeFault>,
        out: &mut Vec<DriverOut>,
    ) {
        let tally = self.tallies.entry(sensor.sensor).or_default();
        tally.heard += 1;
        match said.and_then(|said| Ok((said, reading?))) {
            Ok((Some(said), range_m)) => {
                tally.fault = None;
                out.push(DriverOut::Reading(AutopilotReading {
                    sensor: sensor.sensor,
                    measured: before(said, sensor.delay),
                    range_m,
                }));
            }
            // Its clock is not known yet.
            Ok((None, _)) => {}
            Err(fault) => (tally.dropped, tally.fault) = (tally.dropped + 1, Some(fault)),
        }
    }

    /// Returns when a message was said; `None` while the sender's clock is not known.
    fn said_at(
        &mut self,
        now: Time,
        who: (MavAddress, bool),
        own_ns: i128,
        may_repeat: bool,
    ) -> Result<Option<Time>, RangeFault> {
        let blank = SenderClock::begin(now, own_ns);
        let clock = self.clocks.entry(who).or_insert(blank);
        clock.hear(now, own_ns, may_repeat)
    }
}

impl SenderClock {
    fn begin(now: Time, own_ns: i128) -> SenderClock {
        SenderClock {
            newest_ns: own_ns - 1,
            heard_at: now,
            least_ns: i128::from(now.as_nanos()) - own_ns,
            messages: 0,
        }
    }

    /// Returns when a message with this time was said; `None` while that is not known.
    fn hear(
        &mut self,
        now: Time,
        own_ns: i128,
        may_repeat: bool,
    ) -> Result<Option<Time>, RangeFault> {
        let back_ns = i128::try_from(SET_BACK.as_nanos()).unwrap_or(i128::MAX);
        if own_ns + back_ns < self.newest_ns {
            *self = SenderClock::begin(now, own_ns);
        }
        let is_repeated = own_ns < self.newest_ns || (own_ns == self.newest_ns && !may_repeat);
        if is_repeated {
            return Err(RangeFault::Repeated);
        }
        let now_ns = i128::from(now.as_nanos());
        let passed_ns = now_ns - i128::from(self.heard_at.as_nanos());
        (self.newest_ns, self.heard_at) = (own_ns, now);
        self.messages = self.messages.saturating_add(1);
        self.least_ns = (self.least_ns + passed_ns / DRIFT).min(now_ns - own_ns);
        let said_ns = u64::try_from(own_ns + self.least_ns).unwrap_or(0);
        Ok((self.messages >= KNOWN_AFTER).then_some(Time::from_nanos(said_ns)))
    }
}

impl RangeSettings {
    /// Returns what a DISTANCE_SENSOR has measured.
    fn distance(
        &self,
        said: &DISTANCE_SENSOR_DATA,
        nothing_from_m: Option<f64>,
    ) -> Result<Option<f64>, RangeFault> {
        let limits = Limits::of(said.min_distance, said.max_distance)?;
        if said.signal_quality == INVALID_SIGNAL {
            return Err(RangeFault::Invalid);
        }
        let range_m = metres(said.current_distance);
        let is_nothing = said.current_distance != UNKNOWN_CM
            && nothing_from_m.is_some_and(|from_m| range_m >= from_m);
        if is_nothing {
            return self.nothing_within(limits);
        }
        // One that hears nothing often says its greatest distance, or 0.
        let is_measured = said.current_distance > 0 && range_m < limits.max_m;
        limits.check(range_m, is_measured).map(Some)
    }

    /// Returns what an OBSTACLE_DISTANCE says of the cone around a direction.
    fn obstacle(
        &self,
        said: &OBSTACLE_DISTANCE_DATA,
        beam: Angle,
    ) -> Result<Option<f64>, RangeFault> {
        let limits = Limits::of(said.min_distance, said.max_distance)?;
        if said.frame != MavFrame::MAV_FRAME_BODY_FRD {
            let frame = said.frame as u8;
            return Err(RangeFault::Frame { frame });
        }
        let beam_deg = beam.degrees();
        let unknown = RangeFault::Unknown { beam_deg };
        let mut nearest_m: Option<f64> = None;
        for element in elements(said, beam, self.half_angle)? {
            let element = element.filter(|cm| *cm != UNKNOWN_CM).ok_or(unknown)?;
            if element == said.max_distance.saturating_add(1) {
                continue;
            }
            let range_m = metres(element);
            let range_m = limits.check(range_m, range_m <= limits.max_m)?;
            nearest_m = Some(nearest_m.map_or(range_m, |nearest_m| nearest_m.min(range_m)));
        }
        match nearest_m {
            Some(range_m) => Ok(Some(range_m)),
            None => self.nothing_within(limits),
        }
    }

    /// Returns that nothing is there, when who says so looks far enough.
    fn nothing_within(&self, limits: Limits) -> Result<Option<f64>, RangeFault> {
        if limits.max_m < self.max_range_m {
            return Err(RangeFault::Short {
                max_m: limits.max_m,
                needed_m: self.max_range_m,
            });
        }
        Ok(None)
    }
}

/// What a sensor says that it can measure, metres.
#[derive(Clone, Copy)]
struct Limits {
    min_m: f64,
    max_m: f64,
}

impl Limits {
    fn of(min_cm: u16, max_cm: u16) -> Result<Limits, RangeFault> {
        let (min_m, max_m) = (metres(min_cm), metres(max_cm));
        match min_cm < max_cm {
            true => Ok(Limits { min_m, max_m }),
            false => Err(RangeFault::NoRange { min_m, max_m }),
        }
    }

    /// Returns a range that is no nearer than the sensor can measure, and of which something else holds, too.
    fn check(self, range_m: f64, is_measured: bool) -> Result<f64, RangeFault> {
        let Limits { min_m, max_m } = self;
        match is_measured && range_m >= min_m {
            true => Ok(range_m),
            false => Err(RangeFault::OutOfRange {
                range_m,
                min_m,
                max_m,
            }),
        }
    }
}

/// Returns a time so long before another one.
fn before(at: Time, earlier: Duration) -> Time {
    let earlier_ns = u64::try_from(earlier.as_nanos()).unwrap_or(u64::MAX);
    Time::from_nanos(at.as_nanos().saturating_sub(earlier_ns))
}

fn metres(cm: u16) -> f64 {
    f64::from(cm) / 100.0
}

/// Returns where a sensor of this orientation looks, counter-clockwise against the heading; `None` when that is not level.
fn direction_of(orientation: MavSensorOrientation) -> Option<Angle> {
    // ROTATION_NONE to ROTATION_YAW_315: eighths of a turn, clockwise; backwards is ROTATION_PITCH_180, too.
    let eighths = match orientation as u8 {
        12 => 4,
        eighths => eighths,
    };
    (eighths < 8).then(|| Angle::from_degrees(-45.0 * f64::from(eighths)))
}

/// Returns the elements that a cone meets, centimetres, some of them more than once; `None` where there is none.
fn elements(
    said: &OBSTACLE_DISTANCE_DATA,
    beam: Angle,
    half_angle: Angle,
) -> Result<Vec<Option<u16>>, RangeFault> {
    let width_deg = match f64::from(said.increment_f) {
        0.0 => f64::from(said.increment),
        width_deg => width_deg,
    };
    let offset_deg = f64::from(said.angle_offset);
    let is_width = (0.5..=360.0).contains(&width_deg.abs());
    if !is_width || !offset_deg.is_finite() {
        return Err(RangeFault::NoWidth);
    }
    // Rays no further apart than half an element leave none out.
    let half_deg = half_angle.degrees();
    let steps = (4.0 * half_deg / width_deg.abs()).ceil().max(1.0) as u32;
    let clockwise = width_deg.signum();
    let ray = |step: u32| {
        let share = 2.0 * f64::from(step) / f64::from(steps) - 1.0;
        let ray_deg = -(beam.degrees() + half_deg * share);
        let along_deg = libm::fmod(clockwise * (ray_deg - offset_deg), 360.0);
        // From the edge of the first element, which its direction halves.
        let from_edge_deg = libm::fmod(along_deg + width_deg.abs() / 2.0 + 720.0, 360.0);
        let index = (from_edge_deg / width_deg.abs()).floor() as usize;
        said.distances.get(index).copied()
    };
    Ok((0..=steps).map(ray).collect())
}

#[cfg(test)]
mod tests;
