//! Where a vehicle's XBee is: the table `[radio.xbee]` of its file. Opens nothing. Channel and network are the venue's.

use tomoswarm_proto::BEACON_BYTES_MAX;

use super::drivers::RadioDriver;
use super::forms::PortName;
use super::keys::{Form, KeyEntry, Keyed, Keys, MaybeTable};
use super::section::Section;
use super::source::Source;
use super::swarm::Swarm;

/// Baud rates that a module can have, in the order of its register BD.
pub const XBEE_BAUDS: [u32; 9] = [
    1_200, 2_400, 4_800, 9_600, 19_200, 38_400, 57_600, 115_200, 230_400,
];

/// Transmit powers that levels of modules have, dBm: S1, S2C, XBee 3, and those of each with more power (`PL` in the manuals).
pub const XBEE_POWERS_DBM: [i8; 19] = [
    -10, -6, -5, -4, -3, -2, -1, 0, 2, 3, 5, 8, 10, 12, 14, 15, 16, 18, 19,
];

/// Bytes of a frame around a beacon, the same to the module and from it (Digi 90000982, frames 0x01 and 0x81).
const FRAME_BYTES: usize = 9;
/// Bits on the serial line for each byte, to the module (with two stop bits) and from it.
const BITS_TO: f64 = 11.0;
const BITS_FROM: f64 = 10.0;
/// Most time that a broadcast without payload takes on the air, with all waits for the channel, and that of each byte,
/// milliseconds (Digi, "802.15.4 latency", 16-bit addresses).
const AIR_MOST_MS: f64 = 9.376;
const AIR_BYTE_MS: f64 = 0.032;
/// By how much a slot is longer than the latency: a share of it, and milliseconds.
const SLOT_SHARE: f64 = 1.15;
const SLOT_MORE_MS: f64 = 2.0;

/// The speed of modules as `xbee setup` leaves them, bits per second.
pub const XBEE_BAUD: u32 = 115_200;

/// A module with 802.15.4 firmware on a serial line.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct XbeePort {
    /// The port, a file of the machine.
    pub port: String,
    /// Bits per second.
    pub baud: u32,
}

impl XbeePort {
    /// Returns the most time from when a beacon of so many bytes is handed to the port until another vehicle has heard it
    /// from a port like this, milliseconds: two serial lines, and the air.
    pub fn latency_ms(&self, bytes: usize) -> f64 {
        let bits = (BITS_TO + BITS_FROM) * (bytes + FRAME_BYTES) as f64;
        let lines_ms = bits * 1e3 / f64::from(self.baud);
        lines_ms + AIR_MOST_MS + AIR_BYTE_MS * bytes as f64
    }

    /// Returns the shortest slot of the ring in which a beacon is heard before the next vehicle speaks, milliseconds.
    pub fn least_slot_ms(&self) -> f64 {
        SLOT_SHARE * self.latency_ms(BEACON_BYTES_MAX) + SLOT_MORE_MS
    }

    /// Refuses a transmit power that no module has.
    pub(super) fn check_power(source: &Source<'_>, power_dbm: i8) {
        if XBEE_POWERS_DBM.contains(&power_dbm) || !source.is_sound(&["radio"]) {
            return;
        }
        let known = XBEE_POWERS_DBM.map(|power| power.to_string()).join(", ");
        let allowed = format!("allowed: {known}; `tomoswarm xbee show` says which one it is");
        source.refuse("radio.power_dbm", "is none that an XBee has", &allowed);
    }

    /// Refuses slots in which a beacon is not heard before the next vehicle speaks.
    pub(super) fn check_slot(&self, source: &Source<'_>, swarm: &Swarm, venue_file: &str) {
        let slot_ms = swarm.slot_ms;
        let needed_ms = self.least_slot_ms();
        if slot_ms >= needed_ms || !source.is_sound(&["radio.xbee", "venue"]) {
            return;
        }
        let wrong = format!(
            "a slot of {slot_ms} ms is too short: at this baud rate beacons are heard up to {:.1} ms after they are sent",
            self.latency_ms(BEACON_BYTES_MAX)
        );
        let allowed = format!(
            "slot_ms of at least {} is needed in {venue_file}, table [swarm], or a higher baud rate",
            needed_ms.ceil()
        );
        source.refuse("radio.xbee.baud", &wrong, &allowed);
    }
}

impl Default for XbeePort {
    fn default() -> XbeePort {
        XbeePort {
            port: String::new(),
            baud: XBEE_BAUD,
        }
    }
}

impl Keyed for XbeePort {
    fn keys(&mut self, to: &mut dyn Keys) {
        let XbeePort { port, baud } = self;
        let means =
            "the port, a file of the machine; names under `/dev/serial/by-id` outlast replugging";
        to.form(
            &mut PortName(port),
            KeyEntry {
                name: "port",
                left_out: "needed",
                means,
            },
        );
        to.form(
            &mut Baud(baud),
            KeyEntry {
                name: "baud",
                left_out: "115200",
                means: "bits per second, as `tomoswarm xbee setup` has set it",
            },
        );
    }
}

/// A baud rate that a module can have.
struct Baud<'a>(&'a mut u32);

impl Form for Baud<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(self.0.to_string())
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let baud = section.number(key, f64::from(*self.0), 0.0..=1e7);
        match XBEE_BAUDS
            .into_iter()
            .find(|known| f64::from(*known) == baud)
        {
            Some(known) => *self.0 = known,
            None => section.refuse(key, "is none that a module has", &in_words()),
        }
    }

    fn allowed(&self) -> String {
        XBEE_BAUDS.map(|baud| baud.to_string()).join(", ")
    }
}

fn in_words() -> String {
    let all = XBEE_BAUDS.map(|baud| baud.to_string());
    format!("allowed: {}", all.join(", "))
}

/// The table `[radio.xbee]`; it is read, and not used, while another driver is chosen.
pub(super) struct XbeeTable<'a> {
    /// What is chosen.
    pub(super) driver: &'a mut RadioDriver,
    /// What stands in for it while another driver is chosen.
    pub(super) unused: XbeePort,
}

impl MaybeTable for XbeeTable<'_> {
    fn get(&mut self) -> Option<&mut dyn Keyed> {
        match self.driver {
            RadioDriver::Xbee(port) => Some(port),
            RadioDriver::Simulated => None,
        }
    }

    fn fill(&mut self) -> &mut dyn Keyed {
        match self.driver {
            RadioDriver::Xbee(port) => port,
            RadioDriver::Simulated => &mut self.unused,
        }
    }
}
