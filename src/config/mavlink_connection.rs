//! How an autopilot is reached over MAVLink: the table `[autopilot.mavlink]` of a vehicle's file. Opens nothing.

use super::drivers::AutopilotDriver;
use super::drivers::DriverKey;
use super::keys::{
    Flag, Form, KeyEntry, Keyed, Keys, MaybeTable, Number, Whole, WordChoice, Words, quoted,
};
use super::section::Section;

/// An autopilot that speaks MAVLink.
#[derive(Clone, PartialEq, Debug)]
pub struct MavlinkConnection {
    /// Where it is.
    pub endpoint: MavlinkEndpoint,
    /// Bits per second, of a serial line.
    pub baud: usize,
    /// Its system id, 1 to 254.
    pub system: usize,
    /// Our own system id, 1 to 255.
    pub own_system: usize,
    /// From which messages its place is taken.
    pub place: MavlinkPlace,
    /// Whether it is given the venue's datum as the origin of its frame when it has none.
    pub sets_origin: bool,
    /// A place is never believed to be better known than this, metres.
    pub place_sd_min_m: f64,
    /// The channel of the remote control's switch, 1 to 18; 0 = none is used.
    pub remote_channel: usize,
    /// The pulse width at which the vehicle stands, microseconds.
    pub remote_hold_us: usize,
    /// The pulse width at which it goes home, microseconds.
    pub remote_return_us: usize,
    /// Whether it is armed even if its failsafes do not keep it where it is.
    pub arms_without_failsafes: bool,
    /// The file with the key of signatures; empty = nothing is signed.
    pub key_file: String,
}

impl Default for MavlinkConnection {
    fn default() -> MavlinkConnection {
        MavlinkConnection {
            endpoint: MavlinkEndpoint::Serial(String::new()),
            baud: 57_600,
            system: 1,
            own_system: 255,
            place: MavlinkPlace::Global,
            sets_origin: false,
            place_sd_min_m: 0.0,
            remote_channel: 0,
            remote_hold_us: 1500,
            remote_return_us: 1900,
            arms_without_failsafes: false,
            key_file: String::new(),
        }
    }
}

/// Where an autopilot is.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum MavlinkEndpoint {
    /// A serial port, a file of the machine.
    Serial(String),
    /// It listens for TCP connections.
    Tcp(String),
    /// It sends packets of UDP to this address of ours.
    UdpIn(String),
    /// It waits for packets of UDP.
    UdpOut(String),
}

impl MavlinkEndpoint {
    /// Returns the serial port that it is, if it is one.
    pub(super) fn serial_port(&self) -> Option<&str> {
        match self {
            MavlinkEndpoint::Serial(port) => Some(port),
            MavlinkEndpoint::Tcp(_) | MavlinkEndpoint::UdpIn(_) | MavlinkEndpoint::UdpOut(_) => {
                None
            }
        }
    }

    /// Reads an endpoint; `None` when the text is none.
    pub fn parse(text: &str) -> Option<MavlinkEndpoint> {
        let (kind, place) = text.split_once(':')?;
        let is_port = place.starts_with('/') && !place.contains(char::is_control);
        let is_address = || {
            let (host, port) = place.rsplit_once(':')?;
            let is_host = !host.is_empty()
                && !host.contains(|letter: char| letter.is_whitespace() || letter == '/');
            (is_host && port.parse::<u16>().is_ok_and(|port| port > 0)).then_some(())
        };
        let place = place.to_owned();
        match kind {
            "serial" if is_port => Some(MavlinkEndpoint::Serial(place)),
            "tcp" => is_address().map(|()| MavlinkEndpoint::Tcp(place)),
            "udp-in" => is_address().map(|()| MavlinkEndpoint::UdpIn(place)),
            "udp-out" => is_address().map(|()| MavlinkEndpoint::UdpOut(place)),
            _ => None,
        }
    }

    /// Returns whether it was not given yet.
    pub(super) fn is_blank(&self) -> bool {
        *self == MavlinkEndpoint::Serial(String::new())
    }

    /// Returns it as it stands in a file.
    pub fn in_words(&self) -> String {
        match self {
            MavlinkEndpoint::Serial(port) => format!("serial:{port}"),
            MavlinkEndpoint::Tcp(address) => format!("tcp:{address}"),
            MavlinkEndpoint::UdpIn(address) => format!("udp-in:{address}"),
            MavlinkEndpoint::UdpOut(address) => format!("udp-out:{address}"),
        }
    }
}

/// From which messages the place of an autopilot is taken.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum MavlinkPlace {
    /// GLOBAL_POSITION_INT.
    Global,
    /// LOCAL_POSITION_NED, counted from GPS_GLOBAL_ORIGIN.
    Local,
}

impl WordChoice for MavlinkPlace {
    const WORDS: &'static [(&'static str, MavlinkPlace)] = &[
        ("global", MavlinkPlace::Global),
        ("local", MavlinkPlace::Local),
    ];
}

impl Keyed for MavlinkConnection {
    fn keys(&mut self, to: &mut dyn Keys) {
        let MavlinkConnection {
            endpoint,
            baud,
            system,
            own_system,
            place,
            sets_origin,
            place_sd_min_m,
            remote_channel,
            remote_hold_us,
            remote_return_us,
            arms_without_failsafes,
            key_file,
        } = self;
        let means = "where it is: a serial port, an address that it listens at, or one of ours to which it sends";
        to.form(
            &mut EndpointKey(endpoint),
            KeyEntry {
                name: "connection",
                left_out: "needed",
                means,
            },
        );
        let blank = MavlinkConnection::default();
        to.whole(
            baud,
            Whole {
                name: "baud",
                default: blank.baud,
                allowed: 1200..=4_000_000,
                means: "bits per second, of a serial port",
            },
        );
        to.whole(
            system,
            Whole {
                name: "system",
                default: blank.system,
                allowed: 1..=254,
                means: "its system id (SYSID_THISMAV); others on the same link are not listened to",
            },
        );
        let means =
            "ours; its failsafe for a silent ground station listens to this one (SYSID_MYGCS)";
        to.whole(
            own_system,
            Whole {
                name: "own_system",
                default: blank.own_system,
                allowed: 1..=255,
                means,
            },
        );
        let means = "from which messages its place is taken: GLOBAL_POSITION_INT, or (indoors) LOCAL_POSITION_NED with the \
                     origin that it says";
        to.word(
            place,
            Words {
                name: "place",
                default: "global",
                means,
            },
        );
        let means =
            "indoors: gives it the venue's datum as the origin of its frame when it has none";
        to.flag(
            sets_origin,
            Flag {
                name: "sets_origin",
                default: blank.sets_origin,
                means,
            },
        );
        let means = "a place is never believed to be better known than this, whatever the autopilot says, metres";
        to.number(
            place_sd_min_m,
            Number {
                name: "place_sd_min_m",
                default: blank.place_sd_min_m,
                allowed: 0.0..=10.0,
                means,
            },
        );
        let means = "channel of a switch of the remote control that lets the vehicle stand or go home; 0 = none";
        to.whole(
            remote_channel,
            Whole {
                name: "remote_channel",
                default: blank.remote_channel,
                allowed: 0..=18,
                means,
            },
        );
        let means = "it stands while the switch is within 150 of this";
        to.whole(
            remote_hold_us,
            Whole {
                name: "remote_hold_us",
                default: blank.remote_hold_us,
                allowed: 800..=2200,
                means,
            },
        );
        let means = "it goes home when the switch comes within 150 of this";
        to.whole(
            remote_return_us,
            Whole {
                name: "remote_return_us",
                default: blank.remote_return_us,
                allowed: 800..=2200,
                means,
            },
        );
        let means = "arms it even if its failsafes for battery, companion and fence do not keep it where it is";
        to.flag(
            arms_without_failsafes,
            Flag {
                name: "arms_without_failsafes",
                default: blank.arms_without_failsafes,
                means,
            },
        );
        let means = "file with the key of MAVLink 2 signatures, 64 hexadecimal digits; without one nothing is signed";
        to.form(
            &mut FileKey(key_file),
            KeyEntry {
                name: "key",
                left_out: "not signed",
                means,
            },
        );
    }
}

/// The key `connection`.
struct EndpointKey<'a>(&'a mut MavlinkEndpoint);

impl Form for EndpointKey<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(quoted(&self.0.in_words()))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let rule = "\"serial:/dev/serial/by-id/…\", \"tcp:HOST:PORT\", \"udp-in:ADDRESS:PORT\" or \"udp-out:HOST:PORT\" is needed";
        section.require(key, rule);
        let Some(text) = section.text(key) else {
            return;
        };
        match MavlinkEndpoint::parse(&text) {
            Some(endpoint) => *self.0 = endpoint,
            None => section.refuse(key, "is no connection", rule),
        }
    }
}

/// The name of a file; empty = none.
struct FileKey<'a>(&'a mut String);

impl Form for FileKey<'_> {
    fn to_toml(&self) -> Option<String> {
        (!self.0.is_empty()).then(|| quoted(self.0))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        if let Some(file) = section.text(key) {
            *self.0 = file;
        }
    }
}

/// The table of the driver; checked and not used while another one is chosen.
pub(super) struct MavlinkTable<'a> {
    /// What is chosen.
    pub(super) driver: &'a mut AutopilotDriver,
    /// What stands in for it while another driver is chosen.
    pub(super) unused: MavlinkConnection,
}

impl MaybeTable for MavlinkTable<'_> {
    fn get(&mut self) -> Option<&mut dyn Keyed> {
        match self.driver {
            AutopilotDriver::Mavlink(connection) => Some(connection.as_mut()),
            AutopilotDriver::Simulated => None,
        }
    }

    fn fill(&mut self) -> &mut dyn Keyed {
        match self.driver {
            AutopilotDriver::Mavlink(connection) => connection.as_mut(),
            AutopilotDriver::Simulated => &mut self.unused,
        }
    }
}

/// The table `[autopilot]` of a vehicle.
pub(super) struct AutopilotTable<'a>(pub(super) &'a mut AutopilotDriver);

impl Keyed for AutopilotTable<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        DriverKey(&mut *self.0).show(to);
        let means =
            "what the driver `mavlink` is told; checked and not used while another one is chosen";
        to.maybe_table(
            &mut MavlinkTable {
                driver: self.0,
                unused: MavlinkConnection::default(),
            },
            KeyEntry {
                name: "mavlink",
                left_out: "",
                means,
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_endpoint_comes_back_as_it_was_written_and_nonsense_is_none() {
        for text in [
            "serial:/dev/ttyAMA0",
            "tcp:127.0.0.1:5760",
            "tcp:rover.local:5760",
            "udp-in:0.0.0.0:14550",
            "udp-out:[::1]:14550",
        ] {
            let endpoint = MavlinkEndpoint::parse(text);
            assert_eq!(
                endpoint.map(|endpoint| endpoint.in_words()).as_deref(),
                Some(text)
            );
        }
        for text in [
            "",
            "serial",
            "serial:ttyAMA0",
            "tcp:5760",
            "tcp::5760",
            "tcp:host:0",
            "tcp:host:66000",
            "udp:127.0.0.1:1",
            "udp-in:a b:1",
            "tcp:a/b:1",
        ] {
            assert_eq!(MavlinkEndpoint::parse(text), None, "{text:?}");
        }
    }
}
