//! What each client of a vehicle is told by itself, and how often: each asks for its own rates, as on an autopilot's ports.

use std::collections::BTreeMap;
use std::time::Duration;

use super::client_link::ClientId;
use super::wire_message::EKF_STATUS;
use crate::time::Time;

/// Messages come no more often than this, unless it is told otherwise.
const FASTEST: Duration = Duration::from_millis(2);
/// How often messages come that are asked for at their default rate.
pub const DEFAULT_EVERY: Duration = Duration::from_millis(250);

/// The messages of each group that REQUEST_DATA_STREAM names (MAV_DATA_STREAM), by their numbers; 0 = all groups.
const GROUPS: [(u8, &[u32]); 7] = [
    (1, &[]),
    (2, &[1, 42, 24, 245, 2]),
    (3, &[36]),
    (6, &[33, 32]),
    (10, &[30]),
    (11, &[74, 147]),
    (12, &[EKF_STATUS]),
];

/// One message that comes by itself.
#[derive(Clone, Copy, Debug)]
struct Stream {
    every: Duration,
    due: Time,
}

/// The messages that clients have asked for.
#[derive(Clone, Debug)]
pub struct Streams {
    /// Messages come no more often than this.
    fastest: Duration,
    /// Of each client, by the number of the message.
    asked: BTreeMap<ClientId, BTreeMap<u32, Stream>>,
}

impl Default for Streams {
    fn default() -> Streams {
        Streams::no_faster_than(FASTEST)
    }
}

impl Streams {
    /// Makes streams of which none comes more often than this.
    pub fn no_faster_than(fastest: Duration) -> Streams {
        Streams {
            fastest,
            asked: BTreeMap::new(),
        }
    }

    /// Lets a client have a message so often from now on; `None` = no more.
    pub fn set(&mut self, now: Time, client: ClientId, message: u32, every: Option<Duration>) {
        let of_client = self.asked.entry(client).or_default();
        match every {
            Some(every) => {
                let stream = Stream {
                    every: every.max(self.fastest),
                    due: now,
                };
                of_client.insert(message, stream);
            }
            None => {
                of_client.remove(&message);
            }
        }
    }

    /// Lets a client have all messages of a group so often; `None` = no more.
    pub fn set_group(&mut self, now: Time, client: ClientId, group: u8, every: Option<Duration>) {
        let groups = GROUPS
            .iter()
            .filter(|(number, _)| group == 0 || *number == group);
        for message in groups.flat_map(|(_, messages)| messages.iter()) {
            self.set(now, client, *message, every);
        }
    }

    /// Returns how often a client has a message; `None` = never.
    pub fn every(&self, client: ClientId, message: u32) -> Option<Duration> {
        let stream = self.asked.get(&client)?.get(&message)?;
        Some(stream.every)
    }

    /// Forgets a client that is gone.
    pub fn forget(&mut self, client: ClientId) {
        self.asked.remove(&client);
    }

    /// Returns when the next message is due.
    pub fn deadline(&self) -> Option<Time> {
        let streams = self.asked.values().flat_map(BTreeMap::values);
        streams.map(|stream| stream.due).min()
    }

    /// Returns what is due by now, and for whom.
    pub fn take_due(&mut self, now: Time) -> Vec<(ClientId, u32)> {
        let mut due = Vec::new();
        for (client, streams) in &mut self.asked {
            for (message, stream) in streams.iter_mut().filter(|(_, stream)| stream.due <= now) {
                stream.due = next_after(stream.every, now);
                due.push((*client, *message));
            }
        }
        due
    }
}

/// Returns when something comes next that comes so often: at multiples of that, whenever it was asked for, so that what comes
/// equally often comes at once. What was missed meanwhile is left out.
pub fn next_after(every: Duration, now: Time) -> Time {
    let every_ns = u64::try_from(every.as_nanos()).unwrap_or(u64::MAX).max(1);
    now + Duration::from_nanos(every_ns - now.as_nanos() % every_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    #[test]
    fn each_client_has_its_own_rates() {
        let (one, two) = (ClientId(1), ClientId(2));
        let mut streams = Streams::default();
        assert_eq!(streams.deadline(), None);
        streams.set(at(1.0), one, 33, Some(Duration::from_millis(100)));
        streams.set(at(1.0), two, 33, Some(Duration::ZERO));
        assert_eq!(streams.take_due(at(1.0)), [(one, 33), (two, 33)]);
        assert_eq!(streams.take_due(at(1.05)), [(two, 33)], "as fast as can be");
        assert_eq!(
            streams.take_due(at(7.0)),
            [(one, 33), (two, 33)],
            "once, however late"
        );
        assert_eq!(streams.every(one, 33), Some(Duration::from_millis(100)));
        streams.set(at(7.0), one, 33, None);
        streams.forget(two);
        assert_eq!((streams.deadline(), streams.every(one, 33)), (None, None));
    }

    #[test]
    fn what_comes_equally_often_comes_at_once_whenever_it_was_asked_for() {
        let (one, two) = (ClientId(1), ClientId(2));
        let mut streams = Streams::default();
        for (time_s, client) in [(1.017, one), (1.042, two)] {
            streams.set(at(time_s), client, 33, Some(Duration::from_millis(100)));
            assert_eq!(streams.take_due(at(time_s)), [(client, 33)], "at once");
        }
        for tenth in 11..14 {
            let now = at(0.1 * f64::from(tenth));
            assert_eq!(streams.deadline(), Some(now));
            assert_eq!(streams.take_due(now), [(one, 33), (two, 33)]);
        }
    }

    #[test]
    fn a_group_is_all_of_its_messages() {
        let mut streams = Streams::default();
        let client = ClientId(1);
        streams.set_group(at(0.0), client, 6, Some(DEFAULT_EVERY));
        assert_eq!(streams.take_due(at(0.0)), [(client, 32), (client, 33)]);
        streams.set_group(at(0.0), client, 0, None);
        assert_eq!(streams.deadline(), None);
    }
}
