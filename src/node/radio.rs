//! The radio actor: beacons in turn by a token ring without common clocks, and samples of what is heard.
//!
//! It is told what the radio driver heard or could not send, where the vehicle is, how far the mission is, and for which
//! run to measure. It says beacons, samples, and what peers' beacons tell. It never waits for the bus: a gap costs samples,
//! nothing else. Its beacons name an emergency stop that is open, and go out without a place too. A beacon lists only those
//! heard directly, so that one that has fallen silent leaves everybody's ring.
//!
//! Its parts know nothing of each other: whose turn it is (`radio/ring.rs`), the numbers of its own beacons
//! (`radio/numbering.rs`), and what was heard of peers and becomes samples (`radio/reception.rs`).
//!
//! ```text
//!   Waiting ─own slot─► speak ─► Waiting (silence limit)      Waiting ─beacon heard─► Waiting (slot after it)
//! ```
//!
//! Deadline: `own slot`.

mod numbering;
mod reception;
mod ring;
#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Beacon, EmergencyStop, PoseReport, Progress, RunId, Sample, VehicleId};

use self::numbering::BeaconNumbers;
pub use self::reception::HeardBeacon;
use self::reception::Reception;
use self::ring::BeaconRing;
use super::last_pose::LastPose;
use super::{OwnState, VehicleSettings};
use crate::actor::{Actor, Fault, Input, InputClass};
use crate::sweep::VehicleProgress;
use crate::time::{Deadline, Time};

/// What the radio actor can be told.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum In {
    /// A beacon came in.
    Heard(HeardBeacon),
    /// The beacon of this sequence never went on the air.
    Unsent(u32),
    /// Where the vehicle is.
    State(OwnState),
    /// How far the mission is.
    Progress(Progress),
    /// For which run to measure; `None` = not at all.
    Measure(Option<RunId>),
    /// Which emergency stops are open.
    Stops(Vec<EmergencyStop>),
}

/// What the radio actor can say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Out {
    /// Send this.
    Transmit(Beacon),
    /// A beacon heard, or missed, in a run.
    Sample(RunId, Sample),
    /// What a peer's beacon tells of it.
    Peer(BeaconReport),
    /// A peer's beacon names an emergency stop.
    Stop(VehicleId, EmergencyStop),
}

/// What a beacon tells of its sender, whatever it was measured for.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct BeaconReport {
    /// Where it believes to be; `None` = it does not know.
    pub pose: Option<PoseReport>,
    /// How far it is with its plan; also tells who it is, and the start of its software.
    pub progress: VehicleProgress,
}

/// The radio actor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Radio {
    settings: VehicleSettings,
    place: LastPose,
    /// Whether the vehicle was at rest, whether its motors had current, and whether it flew, when it was heard of last.
    is_at_rest: bool,
    is_armed: bool,
    is_airborne: bool,
    progress: Progress,
    measures: Option<RunId>,
    /// The emergency stops that are open; each beacon names one of them.
    stops: Vec<EmergencyStop>,
    ring: BeaconRing,
    numbers: BeaconNumbers,
    reception: Reception,
}

impl Radio {
    /// Makes the actor; it speaks for the first time after its own share of the first round.
    pub fn new(settings: VehicleSettings) -> Radio {
        Radio {
            place: LastPose::unknown(settings.swarm.pose_sd_max_m),
            stops: settings.stops.open.clone(),
            is_at_rest: false,
            is_armed: false,
            is_airborne: false,
            progress: Progress::default(),
            measures: None,
            ring: BeaconRing::new(settings.vehicle, settings.boot, &settings.radio),
            numbers: BeaconNumbers::default(),
            reception: Reception::new(settings.swarm.pose_sd_max_m),
            settings,
        }
    }

    /// Returns how many samples of a run were made.
    pub fn samples_made(&self, run: RunId) -> u64 {
        self.reception.samples_made(run)
    }

    fn hear(&mut self, now: Time, heard: &HeardBeacon, out: &mut Vec<Out>) {
        let beacon = &heard.beacon;
        if beacon.sender == self.settings.vehicle || !self.reception.is_news(now, beacon) {
            return;
        }
        out.extend(beacon.stop.map(|stop| Out::Stop(beacon.sender, stop)));
        let progress = VehicleProgress::of(beacon.sender, beacon.boot, beacon.progress);
        out.push(Out::Peer(BeaconReport {
            pose: beacon.pose,
            progress,
        }));
        let samples = self
            .reception
            .take(now, heard, self.place.report(now), self.measures);
        out.extend(
            samples
                .into_iter()
                .map(|sample| Out::Sample(beacon.progress.run, sample)),
        );
        self.ring.hear(now, beacon.sender, &beacon.members);
    }

    /// Returns the open stop that a beacon of this number names: one after the other.
    fn named_stop(&self, number: u32) -> Option<EmergencyStop> {
        let count = u32::try_from(self.stops.len()).unwrap_or(u32::MAX);
        let index = number.checked_rem(count)?;
        self.stops.get(index as usize).copied()
    }
}

impl Actor for Radio {
    type In = In;
    type Out = Out;

    fn handle(&mut self, now: Time, input: In, out: &mut Vec<Out>) -> Result<(), Fault> {
        match input {
            In::Heard(heard) => self.hear(now, &heard, out),
            In::Unsent(sequence) => self.numbers.take_back(sequence),
            In::State(state) => {
                self.place.take(now, &state);
                (self.is_at_rest, self.is_armed) = (state.is_at_rest, state.is_armed);
                self.is_airborne = !state.is_landed;
            }
            In::Progress(progress) => self.progress = progress,
            In::Measure(run) => self.measures = run,
            In::Stops(open) => self.stops = open,
        }
        Ok(())
    }

    fn deadline(&self) -> Option<Deadline> {
        Some(Deadline {
            at: self.ring.slot_at(),
            why: "own slot",
        })
    }

    fn wake(&mut self, now: Time, out: &mut Vec<Out>) -> Result<(), Fault> {
        self.ring.speak(now);
        let sequence = self.numbers.next_number();
        out.push(Out::Transmit(Beacon {
            sender: self.settings.vehicle,
            boot: self.settings.boot,
            sequence,
            pose: self.place.report(now),
            channel: self.settings.radio.channel,
            power_dbm: self.settings.radio.power_dbm,
            is_at_rest: self.is_at_rest,
            is_armed: self.is_armed,
            is_airborne: self.is_airborne,
            members: self.reception.heard_lately(now),
            progress: self.progress,
            stop: self.named_stop(sequence),
            tag: None,
        }));
        Ok(())
    }
}

impl Input for In {
    type Key = u8;

    fn class(&self) -> InputClass<u8> {
        match self {
            In::Heard(_) | In::Unsent(_) => InputClass::Queue,
            In::State(_) => InputClass::Latest(0),
            In::Progress(_) => InputClass::Latest(1),
            In::Measure(_) => InputClass::Latest(2),
            In::Stops(_) => InputClass::Latest(3),
        }
    }

    fn may_wait(&self) -> bool {
        match self {
            // The time of a place is when it is read: only that of a vehicle at rest may wait.
            In::State(state) => state.is_at_rest,
            In::Heard(_) | In::Unsent(_) | In::Progress(_) | In::Measure(_) | In::Stops(_) => false,
        }
    }
}
