//! The sensor actor: points a range sensor, waits until its servo has turned and settled, asks for an echo, and
//! turns the answer into a scan with pose and direction. Several sensors take turns, so that none hears another's echo;
//! which one looks along a beam follows from the beam ([`crate::plan::Mounts`]).
//!
//! It is told echoes, the vehicle's state, and that an operator looks through its eyes; it says where to steer, when to ping,
//! scans, and to whoever asks what they were. It keeps no map and decides nothing about safety: a reading that looks like a
//! glitch is marked as suspect, not hidden, since the reflex must see it all the same. One that is nearer than the sensor can
//! measure is no reading at all.
//!
//! A reading that jumped is believed when it is seen again: along its beam at the next look, or along any beam within two
//! rounds. (Who turns sees a thin thing along another beam each time.)
//!
//! An echo counts once, and only until the sensor turns on to the next beam.
//!
//! ```text
//!   [Pointing] ──servo settled: ping──► [Listening] ──next beam──► [Pointing], or [Listening] where no time is needed to settle
//! ```
//!
//! Deadlines: `next beam`, `servo settled`.

mod look_report;

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Look, VehicleId};

use self::look_report::LookReport;
use super::last_pose::LastPose;
use super::{LookSettings, OwnState};
use crate::actor::{Actor, Fault, Input, InputClass};
use crate::geom::{Angle, Pose, Vector};
use crate::plan::Pointing;
use crate::time::{Deadline, Time};

/// A reading this much nearer than the last one of its beam must be seen twice, metres.
const JUMP_M: f64 = 1.0;
/// Two echoes can be of one thing when their ranges differ by no more than this where their arcs meet, metres.
const ALIKE_M: f64 = 0.1;
/// Places on an arc that are asked about.
const ARC_PLACES: u32 = 13;
/// So many rounds of all beams long an echo that jumped confirms another one.
const ROUNDS: u32 = 2;

/// Asks the range sensor for an echo.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Ping {
    /// Counts the pings of this boot.
    pub number: u64,
}

/// The range driver's answer.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Echo {
    /// Which ping it answers.
    pub number: u64,
    /// Distance to what gave the echo, metres; `None` = no echo.
    pub range_m: Option<f64>,
}

/// A reading with its pose.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Scan {
    /// Where the vehicle was.
    pub pose: Pose,
    /// Direction looked at, relative to the heading.
    pub beam: Angle,
    /// Distance to what gave the echo, metres; `None` = no echo within range.
    pub range_m: Option<f64>,
    /// The reading jumped, and no other look has confirmed it yet.
    pub suspect: bool,
}

impl Scan {
    /// Returns the same reading as one of a vehicle that faces another way.
    pub fn facing(&self, heading: Angle) -> Scan {
        Scan {
            pose: Pose {
                heading,
                ..self.pose
            },
            beam: self.beam + (self.pose.heading - heading),
            ..self.clone()
        }
    }

    /// Returns whether its echo may have come from where another one came from; cones have this half-width.
    fn may_confirm(&self, other: &Scan, half_width_rad: f64) -> bool {
        let (Some(range_m), Some(others_m)) = (self.range_m, other.range_m) else {
            return false;
        };
        (0..ARC_PLACES).any(|step| {
            let share = (2.0 * f64::from(step) + 1.0) / f64::from(ARC_PLACES) - 1.0;
            let along = self.pose.heading + self.beam + Angle::from_radians(half_width_rad * share);
            let place = self.pose.at + Vector::polar(along, range_m);
            let off = other.pose.at.angle_to(place) - (other.pose.heading + other.beam);
            (other.pose.at.distance_to(place) - others_m).abs() <= ALIKE_M
                && off.radians().abs() <= half_width_rad
        })
    }
}

/// What the sensor actor can be told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum In {
    /// An answer of the range driver.
    Echo(Echo),
    /// Where the vehicle is.
    State(OwnState),
    /// An operator asks what it hears.
    Asked,
}

/// What the sensor actor can say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Out {
    /// Point the sensor, relative to the heading.
    Steer(Angle),
    /// Measure.
    Ping(Ping),
    /// A reading.
    Scan(Scan),
    /// The last readings, for operators who ask.
    Look(Look),
}

/// Which inputs replace unread ones.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Key {
    /// The newest state.
    State,
    /// That an operator asks.
    Asked,
}

/// The sensor actor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Sensor {
    look: LookSettings,
    place: LastPose,
    beam: usize,
    phase: Phase,
    pings: u64,
    /// Last reading of each beam, metres; infinite = no echo.
    last_m: Vec<f64>,
    /// Readings of the last rounds that jumped.
    jumped: Vec<(Time, Scan)>,
    /// Where the servos stand.
    pointing: Pointing,
    altitude_m: f64,
    report: LookReport,
}

/// A reading that nothing can be learnt from.
struct Glitch;

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum Phase {
    /// The servo turns to a beam.
    Pointing {
        /// When it has settled.
        settled: Time,
        /// When the beam after this one is due.
        next: Time,
    },
    /// Nothing moves until the next beam.
    Listening {
        /// Which ping has no answer yet; `None` before the first one, and once it has one.
        awaited: Option<u64>,
        /// When the next beam is due.
        next: Time,
    },
}

impl Sensor {
    /// Makes the actor; it points its first beam at the first wake.
    pub fn new(vehicle: VehicleId, look: LookSettings, pose_sd_max_m: f64) -> Sensor {
        let last_m = vec![f64::INFINITY; look.beams.len()];
        let phase = Phase::Listening {
            awaited: None,
            next: Time::ZERO + look.period,
        };
        let (place, pointing) = (
            LastPose::unknown(pose_sd_max_m),
            Pointing::new(look.mounts.clone()),
        );
        let report = LookReport::new(vehicle, &look);
        Sensor {
            look,
            place,
            beam: 0,
            phase,
            pings: 0,
            last_m,
            jumped: Vec::new(),
            pointing,
            altitude_m: 0.0,
            report,
        }
    }

    fn ping(&mut self, now: Time, next: Time, out: &mut Vec<Out>) {
        self.pings += 1;
        let next = next.max(now + Duration::from_nanos(1));
        self.phase = Phase::Listening {
            awaited: Some(self.pings),
            next,
        };
        out.push(Out::Ping(Ping { number: self.pings }));
    }

    fn take_echo(&mut self, now: Time, echo: Echo, out: &mut Vec<Out>) {
        let Phase::Listening { awaited, next } = self.phase else {
            return;
        };
        if awaited != Some(echo.number) {
            return; // a late answer to an earlier ping, or the same once more
        }
        let Some(pose) = self.place.pose(now) else {
            return;
        };
        let Ok(range_m) = self.judged(echo.range_m) else {
            return;
        };
        self.phase = Phase::Listening {
            awaited: None,
            next,
        };
        let reading_m = range_m.unwrap_or(f64::INFINITY);
        let has_jumped =
            reading_m < self.last_m[self.beam] - JUMP_M && reading_m < self.look.sure_range_m;
        self.last_m[self.beam] = reading_m;
        let mut scan = Scan {
            pose,
            beam: self.look.beams[self.beam],
            range_m,
            suspect: false,
        };
        if has_jumped {
            scan.suspect = !self.is_confirmed(now, &scan);
            self.jumped.push((now, scan.clone()));
        }
        let look = self.report.take(now, &scan, self.altitude_m);
        out.push(Out::Scan(scan));
        out.extend(look.map(Out::Look));
    }

    /// Returns whether one of the last readings that jumped may be of the same thing; forgets older ones.
    fn is_confirmed(&mut self, now: Time, scan: &Scan) -> bool {
        let lasts = self.look.cycle() * ROUNDS;
        self.jumped.retain(|(at, _)| now.since(*at) <= lasts);
        let half_rad = self.look.half_angle.radians();
        self.jumped
            .iter()
            .any(|(_, other)| scan.may_confirm(other, half_rad))
    }

    /// What is farther than the sensor hears is no echo; what is nearer says nothing at all, since it would hide the rest.
    fn judged(&self, range_m: Option<f64>) -> Result<Option<f64>, Glitch> {
        match range_m {
            None => Ok(None),
            Some(range_m) if range_m > self.look.max_range_m => Ok(None),
            Some(range_m) if range_m >= self.look.min_range_m => Ok(Some(range_m)),
            Some(_) => Err(Glitch),
        }
    }
}

impl Actor for Sensor {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        match input {
            In::Echo(echo) => self.take_echo(now, echo, out),
            In::State(state) => {
                self.altitude_m = state.flight_state.altitude_m;
                self.place.take(now, &state);
            }
            In::Asked => self.report.ask(now),
        }
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        Some(match self.phase {
            Phase::Pointing { settled, .. } => Deadline {
                at: settled,
                why: "servo settled",
            },
            Phase::Listening { next, .. } => Deadline {
                at: next,
                why: "next beam",
            },
        })
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        match self.phase {
            Phase::Listening { .. } => {
                self.beam = (self.beam + 1) % self.look.beams.len();
                let beam = self.look.beams[self.beam];
                let turns = self.pointing.steer(now.since(Time::ZERO), beam);
                let next = now + self.look.period + turns;
                let settled = now + turns + self.look.settle;
                out.push(Out::Steer(beam));
                if settled > now {
                    self.phase = Phase::Pointing { settled, next };
                } else {
                    self.ping(now, next, out);
                }
            }
            Phase::Pointing { next, .. } => self.ping(now, next, out),
        }
        Ok(())
    }
}

impl Input for In {
    type Key = Key;

    fn class(&self) -> InputClass<Key> {
        match self {
            In::Echo(_) => InputClass::Queue,
            In::State(_) => InputClass::Latest(Key::State),
            In::Asked => InputClass::Latest(Key::Asked),
        }
    }

    fn may_wait(&self) -> bool {
        match self {
            // The time of a place is when it is read: only that of a vehicle at rest may wait.
            In::State(state) => state.is_at_rest,
            In::Echo(_) | In::Asked => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::tests_support::{drawn, variants};
    use crate::plan::{Mount, Mounts};

    fn sensor() -> Sensor {
        let settings = super::super::tests_support::settings(1);
        Sensor::new(VehicleId(1), settings.look, settings.swarm.pose_sd_max_m)
    }

    fn fed(sensor: &mut Sensor, now: Time, input: In) -> Vec<Out> {
        let mut out = Vec::new();
        sensor.handle(now, input, &mut out).unwrap();
        out
    }

    fn state(x_m: f64, speed_mps: f64) -> In {
        let mut state = super::super::tests_support::own_state(x_m, 0.0);
        state.speed_mps = speed_mps;
        In::State(state)
    }

    /// Runs the sensor until it has pinged once more, and returns the moment.
    fn next_ping(sensor: &mut Sensor) -> (Time, u64) {
        loop {
            let mut out = Vec::new();
            let due = sensor.deadline().unwrap().at;
            sensor.wake(due, &mut out).unwrap();
            assert!(
                sensor.deadline().unwrap().at > due,
                "a wake moves the deadline on"
            );
            if let Some(Out::Ping(ping)) = out.first() {
                return (due, ping.number);
            }
        }
    }

    #[test]
    fn a_ping_waits_until_the_servo_has_settled() {
        let mut sensor = sensor();
        let mut out = Vec::new();
        sensor
            .wake(sensor.deadline().unwrap().at, &mut out)
            .unwrap();
        assert!(matches!(out[..], [Out::Steer(_)]));
        assert_eq!(sensor.deadline().unwrap().at, Time::from_secs_f64(0.15));
    }

    #[test]
    fn a_servo_that_needs_no_time_pings_at_once_and_no_wake_is_in_vain() {
        let mut settings = super::super::tests_support::settings(1);
        settings.look.settle = Duration::ZERO;
        let mut sensor = Sensor::new(
            VehicleId(1),
            settings.look.clone(),
            settings.swarm.pose_sd_max_m,
        );
        for number in 1..=7 {
            let mut out = Vec::new();
            let due = sensor.deadline().unwrap().at;
            sensor.wake(due, &mut out).unwrap();
            assert!(
                matches!(out[..], [Out::Steer(_), Out::Ping(ping)] if ping.number == number),
                "{out:?}"
            );
            assert_eq!(sensor.deadline().unwrap().at, due + settings.look.period);
        }
    }

    #[test]
    fn ten_readings_a_second_go_round_all_beams() {
        let mut sensor = sensor();
        let pings: Vec<Time> = (0..7).map(|_| next_ping(&mut sensor).0).collect();
        for pair in pings.windows(2) {
            assert_eq!(pair[1].since(pair[0]), Duration::from_millis(100));
        }
    }

    #[test]
    fn two_servos_take_turns_and_each_ping_waits_for_its_own_to_turn() {
        let servo = |zero_deg, limit_deg: f64| Mount {
            zero: Angle::from_degrees(zero_deg),
            from_rad: -limit_deg.to_radians(),
            to_rad: limit_deg.to_radians(),
            slew_s_per_rad: 0.3 / 60f64.to_radians(),
        };
        let mut settings = super::super::tests_support::settings(1);
        settings.look.beams = [0.0, 180.0, 20.0].map(Angle::from_degrees).to_vec();
        settings.look.mounts = Mounts::new(vec![servo(0.0, 45.0), servo(180.0, 0.0)]);
        let mut sensor = Sensor::new(
            VehicleId(1),
            settings.look.clone(),
            settings.swarm.pose_sd_max_m,
        );
        let mut pings = Vec::new();
        let mut steered = Vec::new();
        while pings.len() < 7 {
            let mut out = Vec::new();
            let due = sensor.deadline().unwrap().at;
            sensor.wake(due, &mut out).unwrap();
            for output in out {
                match output {
                    Out::Steer(beam) => steered.push((due, beam.degrees())),
                    Out::Ping(_) => pings.push(due.since(steered[steered.len() - 1].0).as_millis()),
                    Out::Scan(_) | Out::Look(_) => panic!("nothing has answered"),
                }
            }
        }
        // It begins with the second beam, astern, which has no servo. 20° take the first one 100 ms, and 50 ms to settle.
        assert_eq!(pings, [50, 150, 150, 50, 150, 150, 50]);
        let round = steered[6].0.since(steered[3].0);
        assert_eq!(
            round,
            Duration::from_millis(500),
            "three readings and two turns"
        );
        assert_eq!(settings.look.cycle(), round);
    }

    #[test]
    fn a_scan_carries_the_pose_on_to_the_moment_of_the_echo() {
        let mut sensor = sensor();
        let (due, number) = next_ping(&mut sensor);
        fed(
            &mut sensor,
            due - Duration::from_millis(100),
            state(1.0, 0.5),
        );
        let out = fed(
            &mut sensor,
            due,
            In::Echo(Echo {
                number,
                range_m: Some(2.0),
            }),
        );
        let [Out::Scan(scan)] = &out[..] else {
            panic!("{out:?}")
        };
        assert!((scan.pose.at.x_m - 1.05).abs() < 1e-9);
    }

    #[test]
    fn readings_out_of_range_late_or_without_pose_are_no_hits() {
        let mut sensor = sensor();
        let (due, number) = next_ping(&mut sensor);
        assert!(
            fed(
                &mut sensor,
                due,
                In::Echo(Echo {
                    number,
                    range_m: Some(2.0)
                })
            )
            .is_empty()
        );
        fed(&mut sensor, due, state(0.0, 0.0));
        assert!(
            fed(
                &mut sensor,
                due,
                In::Echo(Echo {
                    number: number + 1,
                    range_m: None
                })
            )
            .is_empty()
        );
        let out = fed(
            &mut sensor,
            due,
            In::Echo(Echo {
                number,
                range_m: Some(9.0),
            }),
        );
        assert!(matches!(&out[..], [Out::Scan(Scan { range_m: None, .. })]));
    }

    #[test]
    fn the_drawing_names_the_phases() {
        assert_eq!(drawn(include_str!("sensor.rs")), variants::<Phase>());
    }

    #[test]
    fn an_echo_counts_once_and_only_for_the_beam_that_it_was_asked_of() {
        let near = |number| {
            In::Echo(Echo {
                number,
                range_m: Some(1.0),
            })
        };
        let mut sensor = sensor();
        fed(&mut sensor, Time::ZERO, state(0.0, 0.0));
        assert!(
            fed(&mut sensor, Time::ZERO, near(0)).is_empty(),
            "nothing was asked yet"
        );
        let (due, number) = next_ping(&mut sensor);
        fed(&mut sensor, due, state(0.0, 0.0));
        assert_eq!(fed(&mut sensor, due, near(number)).len(), 1);
        assert!(
            fed(&mut sensor, due, near(number)).is_empty(),
            "it does not confirm itself"
        );
        let (_, number) = next_ping(&mut sensor);
        let turns_on = sensor.deadline().unwrap().at;
        sensor.wake(turns_on, &mut Vec::new()).unwrap();
        fed(&mut sensor, turns_on, state(0.0, 0.0));
        assert!(
            fed(&mut sensor, turns_on, near(number)).is_empty(),
            "it would stand for the next beam"
        );
    }

    #[test]
    fn what_is_nearer_than_anything_can_be_heard_frees_nothing() {
        for range_m in [0.05, 0.0, -1.0, f64::NAN, f64::NEG_INFINITY] {
            let mut sensor = sensor();
            let (due, number) = next_ping(&mut sensor);
            fed(&mut sensor, due, state(0.0, 0.0));
            let out = fed(
                &mut sensor,
                due,
                In::Echo(Echo {
                    number,
                    range_m: Some(range_m),
                }),
            );
            assert!(out.is_empty(), "{range_m}: {out:?}");
        }
        let mut sensor = sensor();
        let (due, number) = next_ping(&mut sensor);
        fed(&mut sensor, due, state(0.0, 0.0));
        let out = fed(
            &mut sensor,
            due,
            In::Echo(Echo {
                number,
                range_m: Some(f64::INFINITY),
            }),
        );
        assert!(matches!(
            &out[..],
            [Out::Scan(Scan {
                range_m: None,
                suspect: false,
                ..
            })]
        ));
    }

    #[test]
    fn an_isolated_reading_is_never_believed_and_the_wall_behind_it_is_again() {
        // A wall at 2.5 m in every beam; every eleventh reading is a glitch at 0.7 m.
        let mut sensor = sensor();
        let (mut believed, mut unsure) = (0, 0);
        for round in 1..=330 {
            let (due, number) = next_ping(&mut sensor);
            fed(&mut sensor, due, state(0.0, 0.0));
            let range_m = Some(if round % 11 == 0 { 0.7 } else { 2.5 });
            for out in fed(&mut sensor, due, In::Echo(Echo { number, range_m })) {
                let Out::Scan(scan) = out else { continue };
                if scan.suspect {
                    unsure += 1;
                } else {
                    assert_eq!(scan.range_m, Some(2.5), "in round {round}");
                    believed += 1;
                }
            }
        }
        // The wall itself is new at the first look along each of the three beams.
        assert_eq!((believed, unsure), (297, 33));
    }

    #[test]
    fn a_sudden_near_reading_is_suspect_until_seen_again() {
        let mut sensor = sensor();
        let mut suspects = Vec::new();
        for round in 0..9 {
            let (due, number) = next_ping(&mut sensor);
            fed(&mut sensor, due, state(0.0, 0.0));
            let range_m = (round >= 3).then_some(1.0);
            for out in fed(&mut sensor, due, In::Echo(Echo { number, range_m })) {
                if let Out::Scan(scan) = out {
                    suspects.push(scan.suspect);
                }
            }
        }
        assert_eq!(
            suspects,
            [false, false, false, true, true, true, false, false, false]
        );
    }

    #[test]
    fn who_turns_hears_a_thin_thing_again_along_another_beam() {
        // Beams at −30°, 0° and 30°; it stands at −30° and 1 m, and the vehicle has turned there when it is looked at again.
        for (heading_deg, range_m, is_suspect) in
            [(-30.0, 1.05, false), (-30.0, 1.3, true), (10.0, 1.05, true)]
        {
            let mut sensor = sensor();
            let mut last = None;
            for heading_deg in [0.0, heading_deg] {
                let (due, number) = next_ping(&mut sensor);
                let mut state = super::super::tests_support::own_state(0.0, 0.0);
                let beam = sensor.look.beams[sensor.beam];
                let is_there = (beam.degrees() + heading_deg + 30.0).abs() < 1.0;
                state.pose.heading = Angle::from_degrees(heading_deg);
                fed(&mut sensor, due, In::State(state));
                let range_m = if last.is_none() { 1.0 } else { range_m };
                let echo = Echo {
                    number,
                    range_m: Some(range_m),
                };
                let out = fed(&mut sensor, due, In::Echo(echo));
                let Some(Out::Scan(scan)) = out.first() else {
                    panic!("{out:?}")
                };
                last = Some((scan.suspect, is_there));
            }
            assert_eq!(last.map(|(suspect, _)| suspect), Some(is_suspect));
        }
    }
}
