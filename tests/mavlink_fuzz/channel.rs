//! A link that loses, doubles and delays.

use std::time::Duration;

use tomoswarm::time::Time;

use crate::chance::Chance;

/// One direction of a link.
pub struct Channel<T> {
    lost: f64,
    doubled: f64,
    /// How long it takes, at least and at most.
    latency: (Duration, Duration),
    under_way: Vec<(Time, T)>,
}

impl<T: Clone> Channel<T> {
    /// Makes a link that loses this share, and takes as long for everything.
    pub fn new(lost: f64, latency: Duration) -> Channel<T> {
        Channel {
            lost,
            doubled: 0.0,
            latency: (latency, latency),
            under_way: Vec::new(),
        }
    }

    /// Draws a link that may double and disorder what it carries, too.
    pub fn drawn(chance: &mut Chance) -> Channel<T> {
        let latest = Duration::from_millis(chance.one_of(&[1, 20, 400]));
        Channel {
            doubled: chance.one_of(&[0.0, 0.1]),
            latency: (Duration::from_millis(1), latest),
            ..Channel::new(chance.one_of(&[0.0, 0.05, 0.3]), latest)
        }
    }

    /// Sends something.
    pub fn send(&mut self, now: Time, chance: &mut Chance, what: T) {
        let times = if chance.happens(self.doubled) { 2 } else { 1 };
        for _ in 0..times {
            if !chance.happens(self.lost) {
                let (soonest, latest) = self.latency;
                let takes = soonest + (latest - soonest).mul_f64(chance.share());
                self.under_way.push((now + takes, what.clone()));
            }
        }
    }

    /// Takes what has come by now, in the order in which it comes.
    pub fn come(&mut self, now: Time) -> Vec<T> {
        self.under_way.sort_by_key(|(at, _)| *at);
        let count = self.under_way.partition_point(|(at, _)| *at <= now);
        self.under_way
            .drain(..count)
            .map(|(_, what)| what)
            .collect()
    }
}
