//! Where a vehicle's XBee is: the table `[radio.xbee]` of its file. Opens nothing. Channel and network are the venue's.

use super::drivers::RadioDriver;
use super::forms::PortName;
use super::keys::{Form, KeyEntry, Keyed, Keys, MaybeTable};
use super::section::Section;

/// Baud rates that a module can have, in the order of its register BD.
pub const XBEE_BAUDS: [u32; 9] = [
    1_200, 2_400, 4_800, 9_600, 19_200, 38_400, 57_600, 115_200, 230_400,
];

/// A module with 802.15.4 firmware on a serial line.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct XbeePort {
    /// The port, a file of the machine.
    pub port: String,
    /// Bits per second.
    pub baud: u32,
}

impl Default for XbeePort {
    fn default() -> XbeePort {
        XbeePort {
            port: String::new(),
            baud: 115_200,
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
