//! What was heard of each peer last, and the samples that follow: one of each newer beacon heard, and one of each that was
//! missed between two, at both ends' places between those then and now, as far as these can be told. Decides neither for which
//! run is measured nor when to speak.
//!
//! A beacon that comes twice, or after a newer one, is no news. What was called missed when a newer one came stays so.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{
    BEACON_MEMBERS_MAX, Beacon, Boot, PoseReport, Position, RunId, Sample, VehicleId,
};

use super::ring::MEMBER_FOR;
use crate::geom::Pose;
use crate::time::Time;

/// So near to a place where it was heard, metres, an end that did not drive straight on was on the way to it, too.
const NEAR_M: f64 = 1.0;
/// Who faces its way this closely, radians, at both its ends, drove straight on (15°).
const STRAIGHT_RAD: f64 = 0.262;
/// A gap of more beacons than this is a new start, not that many misses.
const MISSES_MAX: u32 = 200;

/// A beacon that came in.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct HeardBeacon {
    /// What it said.
    pub beacon: Beacon,
    /// Received signal strength, dBm.
    pub rssi_dbm: i16,
}

/// What was heard, and the samples made of it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Reception {
    pose_sd_max_m: f64,
    heard: BTreeMap<VehicleId, Last>,
    /// How many samples of each run were made.
    samples: BTreeMap<RunId, u64>,
}

/// The last beacon of a peer.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Last {
    boot: Boot,
    sequence: u32,
    /// When it was heard.
    at: Time,
    /// Where it believed to be, if it knew.
    pose: Option<PoseReport>,
    /// Where the receiver was then, if it knew.
    receiver: Option<PoseReport>,
    /// In which run it was measured; `None` = in none.
    run: Option<RunId>,
}

impl Reception {
    /// Makes one that has heard nobody; of transmitters with a larger deviation than `pose_sd_max_m` nothing is measured.
    pub(super) fn new(pose_sd_max_m: f64) -> Reception {
        Reception {
            pose_sd_max_m,
            heard: BTreeMap::new(),
            samples: BTreeMap::new(),
        }
    }

    /// Returns how many samples of a run were made.
    pub(super) fn samples_made(&self, run: RunId) -> u64 {
        self.samples.get(&run).copied().unwrap_or_default()
    }

    /// Returns whether a beacon is newer than all that were heard of its sender. A start of the sender's software that is
    /// lower than the one heard last counts again when that one has left the ring.
    pub(super) fn is_news(&self, now: Time, beacon: &Beacon) -> bool {
        self.heard.get(&beacon.sender).is_none_or(|last| {
            let has_left = beacon.boot < last.boot && now.since(last.at) > MEMBER_FOR;
            (beacon.boot, beacon.sequence) > (last.boot, last.sequence) || has_left
        })
    }

    /// Returns whose own beacons were heard lately, ascending; of more than a beacon names, those heard last.
    pub(super) fn heard_lately(&self, now: Time) -> Vec<VehicleId> {
        let lately = self
            .heard
            .iter()
            .filter(|(_, last)| now.since(last.at) <= MEMBER_FOR);
        let mut lately: Vec<(Time, VehicleId)> = lately.map(|(id, last)| (last.at, *id)).collect();
        lately.sort_unstable_by(|a, b| b.cmp(a));
        lately.truncate(BEACON_MEMBERS_MAX);
        let mut members: Vec<VehicleId> = lately.into_iter().map(|(_, id)| id).collect();
        members.sort_unstable();
        members
    }

    /// Takes a beacon that is news, heard at the place `receiver`, if that is known; returns the samples that follow for the
    /// run that is measured.
    pub(super) fn take(
        &mut self,
        now: Time,
        heard: &HeardBeacon,
        receiver: Option<PoseReport>,
        measures: Option<RunId>,
    ) -> Vec<Sample> {
        let Beacon {
            sender,
            boot,
            sequence,
            pose,
            ref progress,
            ..
        } = heard.beacon;
        // If the two are not of one run, nobody would know what was measured.
        let run = measures.filter(|run| progress.run == *run);
        let made = match (receiver, run) {
            (Some(receiver), Some(_)) => self.measure(now, heard, receiver),
            (Some(_) | None, Some(_) | None) => Vec::new(),
        };
        self.heard.insert(
            sender,
            Last {
                boot,
                sequence,
                at: now,
                pose,
                receiver,
                run,
            },
        );
        made
    }

    fn measure(&mut self, now: Time, heard: &HeardBeacon, receiver: PoseReport) -> Vec<Sample> {
        let HeardBeacon { beacon, rssi_dbm } = heard;
        let Some(transmitter) = beacon.pose else {
            return Vec::new();
        };
        let missed = self.misses(beacon);
        let last = self.heard.get(&beacon.sender);
        let last_transmitter = last.and_then(|last| last.pose).unwrap_or(transmitter);
        let last_receiver = last.and_then(|last| last.receiver).unwrap_or(receiver);
        let mut made = Vec::new();
        for share in 1..=missed {
            let along = f64::from(share) / f64::from(missed + 1);
            let transmitter_then = between(last_transmitter, transmitter, along);
            let receiver_then = between(last_receiver, receiver, along);
            if let Some(ends) = transmitter_then.zip(receiver_then) {
                made.push(self.sample(now, beacon, ends, None));
            }
        }
        if Pose::from(transmitter).sd_m <= self.pose_sd_max_m {
            made.push(self.sample(now, beacon, (transmitter, receiver), Some(*rssi_dbm)));
        }
        made
    }

    /// Returns how many beacons of the sender were missed since the last one heard.
    fn misses(&self, beacon: &Beacon) -> u32 {
        let Some(last) = self.heard.get(&beacon.sender) else {
            return 0;
        };
        let gap = beacon
            .sequence
            .saturating_sub(last.sequence)
            .saturating_sub(1);
        let is_of_run = last.run == Some(beacon.progress.run);
        if is_of_run && last.boot == beacon.boot && gap <= MISSES_MAX {
            gap
        } else {
            0
        }
    }

    /// Makes a sample between a transmitter and a receiver, and counts it.
    fn sample(
        &mut self,
        now: Time,
        beacon: &Beacon,
        (transmitter_pose, receiver_pose): (PoseReport, PoseReport),
        rssi_dbm: Option<i16>,
    ) -> Sample {
        let count = self.samples.entry(beacon.progress.run).or_default();
        let sequence = *count;
        *count += 1;
        Sample {
            sequence,
            heard_at_ns: now.as_nanos(),
            transmitter: beacon.sender,
            transmitter_pose,
            receiver_pose,
            channel: beacon.channel,
            power_dbm: beacon.power_dbm,
            rssi_dbm,
        }
    }
}

/// Returns where an end was at a share of the time between two places; `None` when it may have gone another way.
fn between(from: PoseReport, to: PoseReport, share: f64) -> Option<PoseReport> {
    let (began, ended) = (Pose::from(from), Pose::from(to));
    let way = ended.at - began.at;
    let way_m = way.length_m();
    let is_near = way_m * share.min(1.0 - share) <= NEAR_M;
    let faces = |pose: Pose| pose.heading.is_near(way.angle(), STRAIGHT_RAD);
    let at = began.at.toward(ended.at, share);
    let z_m = from.at.z_m() + (to.at.z_m() - from.at.z_m()) * share;
    (is_near || (faces(began) && faces(ended))).then(|| PoseReport {
        at: Position::from_metres(at.x_m, at.y_m, z_m),
        ..to
    })
}

#[cfg(test)]
mod tests;
