//! Measures with an HC-SR04, on a thread of its own: triggers it for each ping, and hands the stamped edges of its echo line to
//! [`EchoEdges`], which says what they mean. Between pings it sleeps.
//!
//! ```text
//!   closed ──lines found and taken──► waits for a ping ──► triggers ──► takes edges until an answer ──► waits
//!     ▲                                                                            │
//!     └─────────────────────────── a line is gone ─────────────────────────────────┘
//! ```
//!
//! A line that is stuck is not triggered; where the supply is switched, it is off for a moment, at most every two seconds.

mod chardev_lines;
mod lines;
mod recording;
mod rppal_lines;
#[cfg(test)]
mod tests;

use std::io;
use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};

use self::lines::{EchoLines, Wiring};
pub use self::recording::record_edges;
use super::{EventSink, SharedPings};
use crate::config::HcSr04Lines;
use crate::hw::TimedReading;
use crate::hw::echo_edges::{EchoAnswer, EchoEdges, EchoFaults};
use crate::node::Event;
use crate::run::clock::Clock;
use crate::run::drivers::device_thread::{DeviceThread, Gone, Shared};
use crate::run::mailbox::lock;
use crate::time::Time;

/// Edges are taken so long after the moment by which they must have come: the kernel hands them on a little late.
const LATE: Duration = Duration::from_millis(2);
/// The supply is off so long.
const POWER_OFF: Duration = Duration::from_millis(100);
/// And not oftener than that: the sensor must start, and be tried.
const POWER_OFF_EVERY: Duration = Duration::from_secs(2);

/// An HC-SR04 and the thread that measures with it; dropping it ends the thread.
pub(super) struct HcSr04Reader(DeviceThread<Asked>);

/// What the thread and its owner share.
#[derive(Default)]
struct Asked {
    /// Since when a ping waits.
    ping: Option<Time>,
    faults: EchoFaults,
}

/// What the thread has.
struct Work {
    wiring: Wiring,
    edges: EchoEdges,
    power_off: Option<Time>,
    clock: Clock,
    pings: SharedPings,
    events: EventSink,
}

impl HcSr04Reader {
    /// Begins to measure; `events` gets echoes on the reader's thread.
    ///
    /// # Errors
    /// No thread can be started.
    pub(super) fn start(
        lines: &HcSr04Lines,
        clock: Clock,
        pings: SharedPings,
        events: EventSink,
    ) -> io::Result<HcSr04Reader> {
        HcSr04Reader::on(Wiring::of(lines), lines, clock, pings, events)
    }

    fn on(
        wiring: Wiring,
        lines: &HcSr04Lines,
        clock: Clock,
        pings: SharedPings,
        events: EventSink,
    ) -> io::Result<HcSr04Reader> {
        let mut work = Work {
            wiring,
            edges: EchoEdges::new(lines.air_temperature_c),
            power_off: None,
            clock,
            pings,
            events,
        };
        let session = move |shared: &Shared<Asked>| {
            let mut has_worked = false;
            work.session(shared, &mut has_worked)
                .map_err(|why| Gone { why, has_worked })
        };
        let name = format!("{} and {}", lines.trigger, lines.echo);
        DeviceThread::start("range sensor", name, Asked::default(), session).map(HcSr04Reader)
    }

    /// Measures soon.
    pub(super) fn ping(&self, now: Time) {
        self.0.with(|asked| asked.ping = Some(now));
    }

    /// Returns why its lines are not open; `None` while they are.
    pub(super) fn trouble(&self) -> Option<String> {
        self.0.trouble()
    }

    /// Returns how often it was triggered in vain.
    pub(super) fn faults(&self) -> EchoFaults {
        self.0.with(|asked| asked.faults)
    }
}

impl Work {
    /// Takes the lines and measures until the end, or until a line is gone.
    fn session(&mut self, shared: &Shared<Asked>, has_worked: &mut bool) -> Result<(), String> {
        let mut lines = self.wiring.open()?;
        self.edges.restart();
        shared.with(|asked| asked.ping = None);
        shared.opened();
        while let Some(ping) = shared.wait(|asked| asked.ping.take()) {
            let answer = self.measure(&mut lines)?;
            *has_worked = true;
            shared.with(|asked| asked.faults = self.edges.faults());
            match answer {
                EchoAnswer::Reading(reading) => {
                    let measured = ping;
                    let timed = TimedReading { measured, reading };
                    let echo = lock(&self.pings.0).answer(timed);
                    if let Some(echo) = echo {
                        (self.events)(Event::Echo(echo));
                    }
                }
                EchoAnswer::Stuck => self.switch_power(&mut lines, shared)?,
                EchoAnswer::Silent | EchoAnswer::Glitch => {}
            }
        }
        Ok(())
    }

    /// Triggers the sensor and takes edges until they say something.
    fn measure(&mut self, lines: &mut EchoLines) -> Result<EchoAnswer, String> {
        // Edges of nothing that was asked are counted.
        while let Some(edge) = lines.next_edge(Duration::ZERO)? {
            let _ = self.edges.edge(edge);
        }
        if let Some(answer) = self.edges.trigger(kernel_now(), lines.is_high()?) {
            return Ok(answer);
        }
        lines.trigger()?;
        loop {
            let due = self.edges.deadline().unwrap_or(Time::ZERO) + LATE;
            let found = match lines.next_edge(due.since(kernel_now()))? {
                Some(edge) => self.edges.edge(edge),
                None => self.edges.wake(kernel_now()),
            };
            match found {
                Some(answer) => return Ok(answer),
                // It was woken a little early.
                None if self.edges.deadline().is_some() => {}
                None => return Ok(EchoAnswer::Glitch),
            }
        }
    }

    /// Switches the supply of a stuck sensor off for a moment, where it can be.
    fn switch_power(
        &mut self,
        lines: &mut EchoLines,
        shared: &Shared<Asked>,
    ) -> Result<(), String> {
        let now = self.clock.now();
        let is_soon = |off: Time| now.since(off) < POWER_OFF_EVERY;
        if self.power_off.is_some_and(is_soon) || !lines.has_power() {
            return Ok(());
        }
        self.power_off = Some(now);
        lines.set_power(false)?;
        shared.pause(POWER_OFF);
        lines.set_power(true)
    }
}

/// Returns the time of the clock by which the kernel stamps edges.
fn kernel_now() -> Time {
    let now = clock_gettime(ClockId::Monotonic);
    let whole = |number: i64| u64::try_from(number).unwrap_or_default();
    Time::from_nanos(whole(now.tv_sec) * 1_000_000_000 + whole(now.tv_nsec))
}
