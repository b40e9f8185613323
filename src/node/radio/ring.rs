//! Whose turn it is to speak: a token ring without common clocks. Knows who was heard, and nothing else that beacons say.
//!
//! Members of the ring are the ids heard, or listed in a heard beacon, in the last 5 s, and oneself, ascending.
//! After hearing m, member k speaks (distance(m, k) − 1) · T + S later plus jitter: T is a slot, S what a direct successor
//! waits, a slot unless the venue says less. Each newly heard beacon restarts the wait; own silence is at most
//! (members + 1) · T.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Boot, VehicleId};

use super::super::RadioSettings;
use crate::time::Time;

/// Members not heard of for this long leave the ring.
pub(super) const MEMBER_FOR: Duration = Duration::from_secs(5);
/// Shares of a slot between which somebody who is not listed yet speaks, so as not to meet a member.
const JOIN_FROM: f64 = 0.15;
const JOIN_UNTIL: f64 = 0.85;

/// The ring as one of its members knows it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct BeaconRing {
    own: VehicleId,
    boot: Boot,
    slot: Duration,
    /// What the direct successor of whom was heard waits; `None` = a slot.
    #[serde(default)]
    successor: Option<Duration>,
    /// When each other member was last heard, or heard of.
    members: BTreeMap<VehicleId, Time>,
    /// When somebody last listed this vehicle among those heard.
    listed_at: Option<Time>,
    draws: u64,
    slot_at: Time,
}

impl BeaconRing {
    /// Makes a ring of nobody else; its member speaks for the first time after its own share of the first round.
    pub(super) fn new(own: VehicleId, boot: Boot, radio: &RadioSettings) -> BeaconRing {
        let slot = radio.slot;
        let slot_at = Time::ZERO + slot * (1 + u32::from(own.0));
        BeaconRing {
            own,
            boot,
            slot,
            successor: radio.successor,
            members: BTreeMap::new(),
            listed_at: None,
            draws: 0,
            slot_at,
        }
    }

    /// Returns when its own slot is.
    pub(super) fn slot_at(&self) -> Time {
        self.slot_at
    }

    /// Records whom a beacon shows: its speaker, and those that it lists as heard.
    pub(super) fn hear(&mut self, now: Time, speaker: VehicleId, listed: &[VehicleId]) {
        for member in listed
            .iter()
            .chain([&speaker])
            .filter(|member| **member != self.own)
        {
            self.members.insert(*member, now);
        }
        if listed.contains(&self.own) {
            self.listed_at = Some(now);
        }
        self.forget(now);
        self.slot_at = if self.is_listed(now) {
            now + self.wait_after(speaker)
        } else {
            self.joins_at(now)
        };
    }

    /// Records that the vehicle itself speaks; it does so again after the longest silence unless it hears somebody before.
    pub(super) fn speak(&mut self, now: Time) {
        self.forget(now);
        let ring = self.members.len() as u32 + 1;
        let silence = self.slot * (ring + 1);
        self.slot_at = now + silence - self.jitter();
    }

    fn forget(&mut self, now: Time) {
        self.members.retain(|_, at| now.since(*at) <= MEMBER_FOR);
    }

    /// Returns how long to wait after a member has spoken: by its distance in the ring.
    fn wait_after(&mut self, speaker: VehicleId) -> Duration {
        let own = self.own;
        let between = |from: VehicleId, to: VehicleId| {
            self.members
                .keys()
                .filter(|member| **member > from && **member < to)
                .count()
        };
        let others_before = if speaker < own {
            between(speaker, own)
        } else {
            self.members.len().saturating_sub(between(own, speaker) + 1)
        };
        let successor = self.successor.unwrap_or(self.slot);
        self.slot * others_before as u32 + successor + self.jitter()
    }

    /// Returns whether somebody has listed this vehicle lately, so that the others leave its slot free.
    fn is_listed(&self, now: Time) -> bool {
        self.listed_at.is_some_and(|at| now.since(at) <= MEMBER_FOR)
    }

    /// Returns when somebody speaks who is not listed yet. Where successors speak sooner than a slot, the next beacon is heard
    /// before most such waits are over: there a wait that has begun goes on, or nobody could join.
    fn joins_at(&mut self, now: Time) -> Time {
        let at = now + self.wait_to_join();
        match self.successor {
            Some(successor) if successor < self.slot && self.slot_at > now => at.min(self.slot_at),
            Some(_) | None => at,
        }
    }

    /// Returns a wait that ends in the middle of a slot, drawn anew each time. The members of a ring speak at the
    /// beginnings of all slots, and all who do not know of each other yet would answer in the same one.
    fn wait_to_join(&mut self) -> Duration {
        let share = (self.draw() >> 11) as f64 / (1u64 << 53) as f64;
        self.slot
            .mul_f64(JOIN_FROM + (JOIN_UNTIL - JOIN_FROM) * share)
    }

    /// Returns up to a tenth of a slot, drawn anew each time.
    fn jitter(&mut self) -> Duration {
        self.slot * ((self.draw() >> 56) as u32) / 2560
    }

    /// Draws the next of a sequence of numbers of its own (SplitMix64).
    fn draw(&mut self) -> u64 {
        self.draws += 1;
        let own = (u64::from(self.own.0) << 32) | u64::from(self.boot.0);
        let mut mixed = own
            .wrapping_add(self.draws)
            .wrapping_mul(0x9E37_79B9_7F4A_7C15);
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::tests_support::settings;
    use super::*;

    const SLOT: Duration = Duration::from_millis(50);

    fn at(at_s: f64) -> Time {
        Time::from_secs_f64(at_s)
    }

    fn ids(ids: &[u8]) -> Vec<VehicleId> {
        ids.iter().copied().map(VehicleId).collect()
    }

    fn ring(own: u8) -> BeaconRing {
        ring_with(own, None)
    }

    fn ring_with(own: u8, successor: Option<Duration>) -> BeaconRing {
        let radio = RadioSettings {
            successor,
            ..settings(own).radio
        };
        BeaconRing::new(VehicleId(own), Boot(1), &radio)
    }

    /// How many slots it is until its own one, without the jitter.
    fn slots(ring: &BeaconRing, now: Time) -> u32 {
        let wait = ring.slot_at().since(now);
        let slots = wait.as_nanos() / SLOT.as_nanos();
        assert!(
            wait - SLOT * slots as u32 <= SLOT / 10,
            "{wait:?} is no slot"
        );
        slots as u32
    }

    #[test]
    fn a_member_speaks_as_many_slots_after_another_one_as_it_is_away_from_it() {
        for (own, speaker, expected) in [
            (2, 9, 1),
            (2, 5, 2),
            (5, 2, 1),
            (5, 9, 2),
            (9, 5, 1),
            (9, 2, 2),
            (7, 5, 1),
            (7, 9, 3),
        ] {
            let mut ring = ring(own);
            ring.hear(at(1.0), VehicleId(speaker), &ids(&[2, 5, 9, own]));
            assert_eq!(slots(&ring, at(1.0)), expected, "{own} after {speaker}");
        }
    }

    #[test]
    fn a_direct_successor_may_speak_sooner_and_the_others_a_slot_after_it() {
        const SUCCESSOR: Duration = Duration::from_millis(3);
        for (own, before) in [(2, 0), (5, 1), (9, 2)] {
            let mut ring = ring_with(own, Some(SUCCESSOR));
            ring.hear(at(1.0), VehicleId(1), &ids(&[1, 2, 5, 9]));
            let wait = ring.slot_at().since(at(1.0));
            let least = SLOT * before + SUCCESSOR;
            assert!(
                (least..=least + SLOT / 10).contains(&wait),
                "{own}: {wait:?}"
            );
        }
    }

    #[test]
    fn who_is_not_listed_speaks_though_it_hears_somebody_more_often_than_it_waits() {
        let mut ring = ring_with(7, Some(Duration::from_millis(3)));
        let mut now = at(1.0);
        while now < ring.slot_at() {
            assert!(now < at(1.0 + SLOT.as_secs_f64()), "it is not let in");
            ring.hear(now, VehicleId(2), &ids(&[5]));
            now = now + Duration::from_millis(4);
        }
    }

    #[test]
    fn who_is_not_listed_answers_in_the_middle_of_a_slot() {
        let mut ring = ring(7);
        for turn in 1..50 {
            let now = at(0.1 * f64::from(turn));
            ring.hear(now, VehicleId(2), &ids(&[5]));
            let wait = ring.slot_at().since(now);
            assert!(
                wait >= SLOT.mul_f64(JOIN_FROM) && wait <= SLOT.mul_f64(JOIN_UNTIL),
                "{wait:?}"
            );
        }
    }

    #[test]
    fn who_is_silent_for_5_s_leaves_the_ring_and_the_own_silence_is_shorter() {
        let mut ring = ring(1);
        let everyone: Vec<VehicleId> = (0..=255).map(VehicleId).collect();
        ring.hear(at(0.1), VehicleId(9), &everyone);
        let silence = |ring: &mut BeaconRing, now: Time| {
            ring.speak(now);
            let wait = ring.slot_at().since(now);
            wait.as_secs_f64() / SLOT.as_secs_f64()
        };
        assert!((256.8..=257.0).contains(&silence(&mut ring, at(0.2))));
        ring.hear(at(4.0), VehicleId(2), &[]);
        assert!((256.8..=257.0).contains(&silence(&mut ring, at(5.0))));
        assert!(
            (2.8..=3.0).contains(&silence(&mut ring, at(5.2))),
            "only 2 is left"
        );
        assert!(
            (1.8..=2.0).contains(&silence(&mut ring, at(9.1))),
            "nobody is left"
        );
    }
}
