//! How a simulated module gets a packet on the air: it waits a drawn while, listens, and when the channel is busy waits again,
//! twice as long at most, four times (IEEE 802.15.4, unslotted CSMA-CA). Knows nothing of who hears it.

use std::time::Duration;

use super::Packet;
use crate::sim::noise::{Noise, NoisePurpose};
use crate::time::Time;

/// What a packet waits for is a multiple of this.
const SLOT: Duration = Duration::from_micros(320);
/// It listens for so long.
const LISTENS: Duration = Duration::from_micros(128);
/// It listens once more than this at most.
const BACK_OFFS_MOST: u8 = 4;
/// A module is busy with a packet for so long before it listens.
const PROCESSING: Duration = Duration::from_millis(1);

/// A packet that is being sent.
#[derive(Clone, Debug)]
pub(super) struct Sending {
    /// The packet.
    pub(super) packet: Packet,
    /// By what the host calls it; 0 = it wants no word of it.
    pub(super) id: u8,
    /// The channel is found busy whatever is on it.
    is_blocked: bool,
    back_offs: u8,
    is_on_air: bool,
    due: Time,
}

/// How sending goes on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Progress {
    /// It waits for the channel.
    Waits,
    /// It is on the air from now on, until then.
    Begins(Time),
    /// It was sent.
    Sent,
    /// The channel was always busy.
    GivenUp,
}

impl Sending {
    /// Begins to send; `exponent` is that of the first wait (register RN).
    pub(super) fn begin(
        now: Time,
        packet: Packet,
        id: u8,
        exponent: u32,
        is_blocked: bool,
        draw: Draw,
    ) -> Sending {
        let mut sending = Sending {
            packet,
            id,
            is_blocked,
            back_offs: 0,
            is_on_air: false,
            due: now + PROCESSING,
        };
        sending.wait(now + PROCESSING, exponent, draw);
        sending
    }

    /// Returns whether it is on the air.
    pub(super) fn is_on_air(&self) -> bool {
        self.is_on_air
    }

    /// Returns when it goes on.
    pub(super) fn deadline(&self) -> Time {
        self.due
    }

    /// Goes on at its deadline; `is_busy` = somebody is on the channel.
    pub(super) fn go_on(
        &mut self,
        now: Time,
        is_busy: bool,
        exponent: u32,
        draw: Draw,
    ) -> Progress {
        if self.is_on_air {
            return Progress::Sent;
        }
        if !is_busy && !self.is_blocked {
            (self.is_on_air, self.due) = (true, now + self.packet.air_time());
            return Progress::Begins(self.due);
        }
        if self.back_offs == BACK_OFFS_MOST {
            return Progress::GivenUp;
        }
        self.back_offs += 1;
        self.wait(now, exponent + u32::from(self.back_offs), draw);
        Progress::Waits
    }

    fn wait(&mut self, now: Time, exponent: u32, draw: Draw) {
        let ids = [draw.module, draw.number, u64::from(self.back_offs)];
        let share = draw.noise.uniform(NoisePurpose::BackOff, &ids);
        let slots = (share * f64::from(1_u32 << exponent.min(5))) as u32;
        self.due = now + SLOT * slots + LISTENS;
    }
}

/// By what the waits of a packet are drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draw {
    pub(super) noise: Noise,
    pub(super) module: u64,
    pub(super) number: u64,
}
