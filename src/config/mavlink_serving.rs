//! Where the swarm is shown to ground stations over MAVLink: the table `[mavlink]` of an operator's file. Opens nothing.

use std::net::SocketAddr;

use super::forms::FileName;
use super::keys::{Flag, Form, KeyEntry, Keyed, Keys, quoted};
use super::section::Section;
use super::source::Source;

/// What is told to whoever shows the swarm.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct MavlinkServing {
    /// Where a ground station listens: packets of UDP are sent there. Either this or `listen` is there.
    pub address: Option<SocketAddr>,
    /// Where packets of UDP are waited for.
    pub listen: Option<SocketAddr>,
    /// Whether commands of ground stations become orders.
    pub commands: bool,
    /// The file with the key of signatures; `None` = nothing is signed.
    pub key_file: Option<String>,
}

impl MavlinkServing {
    /// Checks its keys together.
    pub(super) fn check(&self, source: &Source<'_>) {
        if !source.is_sound(&["mavlink"]) {
            return;
        }
        let rule = "either address (where a ground station listens) or listen (where they speak to) is needed";
        match (self.address, self.listen) {
            (None, None) => source.require("mavlink.address", rule),
            (Some(_), Some(_)) => {
                source.refuse("mavlink.listen", "is given beside address", rule);
            }
            (Some(_), None) | (None, Some(_)) => {}
        }
    }
}

impl Keyed for MavlinkServing {
    fn keys(&mut self, to: &mut dyn Keys) {
        let MavlinkServing {
            address,
            listen,
            commands,
            key_file,
        } = self;
        let mut address_key = |name, value: &mut Option<SocketAddr>, means| {
            let left_out = "none";
            to.form(
                &mut UdpAddress(value),
                KeyEntry {
                    name,
                    left_out,
                    means,
                },
            );
        };
        let means = "where a ground station listens for UDP, such as QGroundControl at \"127.0.0.1:14550\"; this or `listen` is \
                     needed";
        address_key("address", address, means);
        let means = "an address of this machine at which ground stations speak first over UDP; this or `address` is needed";
        address_key("listen", listen, means);
        let means = "commands of ground stations become orders; otherwise they are denied";
        to.flag(
            commands,
            Flag {
                name: "commands",
                default: false,
                means,
            },
        );
        let means = "file with the key of MAVLink 2 signatures, 64 hexadecimal digits; who does not sign with it is not heard";
        to.form(
            &mut FileName {
                name: key_file,
                needed: None,
            },
            KeyEntry {
                name: "key",
                left_out: "not signed",
                means,
            },
        );
    }
}

/// An address with a port, which may be left out.
struct UdpAddress<'a>(&'a mut Option<SocketAddr>);

impl Form for UdpAddress<'_> {
    fn to_toml(&self) -> Option<String> {
        self.0.map(|address| quoted(&address.to_string()))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let Some(text) = section.text(key) else {
            return;
        };
        let rule = "a numeric address with a port such as \"127.0.0.1:14550\" is allowed";
        match text.parse::<SocketAddr>() {
            Err(_) => section.refuse(key, "is no address with a port", rule),
            Ok(address) if address.port() == 0 => section.refuse(key, "has port 0", rule),
            Ok(address) => *self.0 = Some(address),
        }
    }
}
