//! The air between the radios: how long a beacon takes, and which beacons are lost because two spoke at
//! once on one channel. It moves nobody and knows no strength: see [`super::radio_field`].

use std::sync::Arc;
use std::time::Duration;

use tomoswarm_proto::{Beacon, Message, codec};

use crate::geom::Point;
use crate::time::Time;

/// A beacon is on the air this long; two that overlap are lost.
const AIRTIME: Duration = Duration::from_millis(4);

/// A beacon that has been sent to its end.
#[derive(Clone, PartialEq, Debug)]
pub struct Sent {
    /// Index of the vehicle that spoke.
    pub from: usize,
    /// Where it was when it began to speak.
    pub place: Point,
    /// Radio channel.
    pub channel: u8,
    /// Transmit power, dBm.
    pub power_dbm: i8,
    /// Sender, its boot, and the beacon's sequence: what no other beacon has.
    pub key: [u64; 3],
    /// The bytes.
    pub frame: Arc<[u8]>,
}

/// What became of a beacon.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum Fate {
    /// It was clear on the air.
    Clear(Sent),
    /// Another one spoke at the same time.
    Collided,
    /// Nothing is known of it.
    Unknown,
}

/// What is on the air.
#[derive(Clone, Debug, Default)]
pub(super) struct Air {
    beacons: Vec<OnAir>,
    count: u64,
}

#[derive(Clone, Debug)]
struct OnAir {
    number: u64,
    start: Time,
    sent: Sent,
}

impl Air {
    /// Begins to send a beacon; returns its number and when it ends, or `None` when it does not fit into a
    /// frame: then it is not sent, and its sequence shows as a miss.
    pub(super) fn begin(
        &mut self,
        now: Time,
        from: usize,
        place: Point,
        beacon: Beacon,
    ) -> Option<(u64, Time)> {
        let (channel, power_dbm) = (beacon.channel, beacon.power_dbm);
        let key = [
            u64::from(beacon.sender.0),
            u64::from(beacon.boot.0),
            beacon.sequence.into(),
        ];
        let frame = codec::encode(&Message::Beacon(beacon)).ok()?.into();
        self.count += 1;
        let sent = Sent {
            from,
            place,
            channel,
            power_dbm,
            key,
            frame,
        };
        self.beacons.push(OnAir {
            number: self.count,
            start: now,
            sent,
        });
        Some((self.count, now + AIRTIME))
    }

    /// Ends a beacon.
    pub(super) fn end(&mut self, now: Time, number: u64) -> Fate {
        let Some(index) = self
            .beacons
            .iter()
            .position(|beacon| beacon.number == number)
        else {
            return Fate::Unknown;
        };
        let beacon = &self.beacons[index];
        let overlaps = |other: &OnAir| {
            let is_heard = other.sent.channel == beacon.sent.channel;
            other.number != number && is_heard && other.start + AIRTIME > beacon.start
        };
        let collided = self.beacons.iter().any(overlaps);
        let sent = beacon.sent.clone();
        // A beacon that has ended may still disturb one that began meanwhile.
        self.beacons
            .retain(|beacon| now.since(beacon.start) <= AIRTIME * 2);
        if collided {
            Fate::Collided
        } else {
            Fate::Clear(sent)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{Boot, VehicleId};

    fn beacon(sender: u8, sequence: u32, channel: u8) -> Beacon {
        Beacon {
            sender: VehicleId(sender),
            boot: Boot(7),
            sequence,
            pose: Some(Default::default()),
            channel,
            power_dbm: 3,
            ..Beacon::default()
        }
    }

    fn at_ms(ms: u64) -> Time {
        Time::ZERO + Duration::from_millis(ms)
    }

    /// Sends two beacons, the second later by `ms`; returns whether each was clear.
    fn clear(ms: u64, channels: [u8; 2]) -> [bool; 2] {
        let mut air = Air::default();
        let (one, one_ends) = air
            .begin(at_ms(10), 0, Point::default(), beacon(1, 1, channels[0]))
            .unwrap();
        let second = |air: &mut Air| {
            air.begin(
                at_ms(10 + ms),
                1,
                Point::default(),
                beacon(2, 1, channels[1]),
            )
        };
        let is_clear = |fate| matches!(fate, Fate::Clear(_));
        if at_ms(10 + ms) >= one_ends {
            let first = is_clear(air.end(one_ends, one));
            let (two, two_ends) = second(&mut air).unwrap();
            return [first, is_clear(air.end(two_ends, two))];
        }
        let (two, two_ends) = second(&mut air).unwrap();
        let first = is_clear(air.end(one_ends, one));
        [first, is_clear(air.end(two_ends, two))]
    }

    #[test]
    fn two_that_speak_at_once_on_one_channel_are_both_lost() {
        assert_eq!(clear(0, [15, 15]), [false, false]);
        assert_eq!(clear(3, [15, 15]), [false, false]);
        assert_eq!(clear(4, [15, 15]), [true, true]);
        assert_eq!(clear(3, [15, 16]), [true, true]);
    }

    #[test]
    fn a_beacon_is_told_apart_by_sender_boot_and_sequence_alone() {
        let mut air = Air::default();
        let key_of = |air: &mut Air, ms, beacon| {
            let (number, end) = air.begin(at_ms(ms), 0, Point::default(), beacon).unwrap();
            match air.end(end, number) {
                Fate::Clear(sent) => sent.key,
                fate => panic!("{fate:?}"),
            }
        };
        key_of(&mut air, 0, beacon(2, 5, 15));
        assert_eq!(
            key_of(&mut air, 100, beacon(1, 9, 15)),
            [1, 7, 9],
            "whatever others have sent before"
        );
        assert_eq!(air.end(at_ms(200), 99), Fate::Unknown);
    }
}
