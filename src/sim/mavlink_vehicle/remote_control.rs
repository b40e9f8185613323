//! What the receiver of a remote control shows: there is none, but clients may speak in its place.

use crate::mavlink::dialect::RC_CHANNELS_OVERRIDE_DATA;

/// Channels of a receiver.
pub(super) const CHANNELS: usize = 18;
/// A channel of an override that changes nothing.
const KEEP: u16 = u16::MAX;

/// Pulse widths of the channels, microseconds; 0 = nothing is received.
#[derive(Clone, Debug, Default)]
pub(super) struct RemoteControl {
    channels: [u16; CHANNELS],
}

impl RemoteControl {
    /// Hears channels in place of those of a receiver.
    pub(super) fn hear(&mut self, said: &RC_CHANNELS_OVERRIDE_DATA) {
        let first = [
            said.chan1_raw,
            said.chan2_raw,
            said.chan3_raw,
            said.chan4_raw,
            said.chan5_raw,
            said.chan6_raw,
            said.chan7_raw,
            said.chan8_raw,
        ];
        // Of these 0 changes nothing either, since older messages end before them.
        let more = [
            said.chan9_raw,
            said.chan10_raw,
            said.chan11_raw,
            said.chan12_raw,
            said.chan13_raw,
            said.chan14_raw,
            said.chan15_raw,
            said.chan16_raw,
            said.chan17_raw,
            said.chan18_raw,
        ];
        for (channel, width) in self.channels.iter_mut().zip(first) {
            if width != KEEP {
                *channel = width;
            }
        }
        for (channel, width) in self.channels.iter_mut().skip(8).zip(more) {
            *channel = match width {
                0 | KEEP => *channel,
                // https://mavlink.io/en/messages/common.html#RC_CHANNELS_OVERRIDE: released.
                65_534 => 0,
                width => width,
            };
        }
    }

    /// Returns the pulse widths, microseconds.
    pub(super) fn channels(&self) -> [u16; CHANNELS] {
        self.channels
    }
}
