//! The configuration that `enroll` writes for a node: ready to be checked and started. Decides nothing about trust.

use tomoswarm_proto::{Sender, VehicleId};

use crate::config::{self, Config, Endpoint, Problems, Protocol, Topology, quoted};

/// Certificate of the authority.
pub(super) const CA: &str = "ca.pem";
/// Private key of the authority, which no node gets.
pub(super) const CA_KEY: &str = "ca-key.pem";
/// Certificate of a node.
pub(super) const CERTIFICATE: &str = "certificate.pem";
/// Private key of a node.
pub(super) const KEY: &str = "key.pem";
/// Who is allowed.
pub(super) const ROSTER: &str = "roster.txt";
/// The place.
pub(super) const VENUE: &str = "venue.toml";

/// What the configuration of an enrolled node depends on.
#[derive(Clone, Debug)]
pub(super) struct NodeConfig {
    /// The node.
    pub node: Sender,
    /// How the swarm is joined.
    pub topology: Topology,
    /// Host under which the ground station is reached.
    pub ground_host: String,
    /// Port of the ground station, and of the vehicles of a mesh.
    pub port: u16,
    /// Whether other machines are to reach this node.
    pub is_reached: bool,
    /// Whether it has a host of its own, beside its own machine's.
    pub has_host: bool,
    /// The folder that outlives the node.
    pub state_dir: String,
    /// The vehicles that are enrolled.
    pub vehicles: Vec<VehicleId>,
    /// Where those of them are reached that others reach.
    pub reached: Vec<Endpoint>,
}

/// Returns the name of a node's configuration.
pub(super) fn file_name(node: Sender) -> &'static str {
    match node {
        Sender::Ground => "ground.toml",
        Sender::Vehicle(_) => "vehicle.toml",
        Sender::Operator(_) => "operator.toml",
    }
}

/// Returns which node a configuration is of; `None` = of none.
pub(super) fn node_of(config: &Config) -> Option<Sender> {
    match config {
        Config::Vehicle(file) => Some(Sender::Vehicle(file.id)),
        Config::Ground(_) => Some(Sender::Ground),
        Config::Operator(file) => Some(Sender::Operator(file.id)),
        Config::Venue(_) | Config::Scene(_) | Config::Sim(_) | Config::Experiment(_) => None,
    }
}

/// Returns vehicles as they stand in a list of a configuration, between its brackets.
pub(super) fn vehicle_list(vehicles: &[VehicleId]) -> String {
    let ids: Vec<String> = vehicles.iter().map(ToString::to_string).collect();
    ids.join(", ")
}

/// Returns endpoints as they stand in a list of a configuration, between its brackets.
pub(super) fn endpoint_list<'a>(endpoints: impl IntoIterator<Item = &'a Endpoint>) -> String {
    let list: Vec<String> = endpoints
        .into_iter()
        .map(|endpoint| quoted(&endpoint.to_string()))
        .collect();
    list.join(", ")
}

/// Returns a configuration with another list under a key, and all else as it was. `changed` is given what stands between the
/// brackets. `None` = the key does not stand once with its list on one line, or `changed` makes nothing of it.
pub(super) fn with_list(
    text: &str,
    key: &str,
    changed: impl FnOnce(&str) -> Option<String>,
) -> Option<String> {
    let opening = format!("{key} = [");
    let is_first = |at: &usize| text[..*at].ends_with('\n') || *at == 0;
    let mut openings = text
        .match_indices(&opening)
        .map(|(at, _)| at)
        .filter(is_first);
    let (at, None) = (openings.next()?, openings.next()) else {
        return None;
    };
    let (before, list) = text.split_at(at + opening.len());
    let (list, after) = list.split_at(end_of_list(list)?);
    Some(format!("{before}{}{after}", changed(list)?))
}

/// Returns where the bracket stands that ends a list, in the same line; brackets in strings end nothing.
fn end_of_list(list: &str) -> Option<usize> {
    let mut is_in_string = false;
    for (at, c) in list.char_indices() {
        match c {
            '"' => is_in_string = !is_in_string,
            ']' if !is_in_string => return Some(at),
            '\n' => return None,
            _ => {}
        }
    }
    None
}

/// Returns a list that ends with these items with others in their place; `None` = it ends otherwise.
pub(super) fn with_end(list: &str, former: &str, items: &str) -> Option<String> {
    let first = match list.strip_suffix(former)? {
        first if first.is_empty() || former.is_empty() => first,
        first => first.strip_suffix(", ")?,
    };
    let parts: Vec<&str> = [first, items]
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect();
    Some(parts.join(", "))
}

/// Returns a list with another item in the place of one; `None` = it has neither.
pub(super) fn with_other(list: &str, former: &str, item: &str) -> Option<String> {
    let items: Vec<&str> = list.split(", ").collect();
    let has_either = items.iter().any(|of| *of == former || *of == item);
    let other = |of: &&str| if *of == former { item } else { *of }.to_owned();
    has_either.then(|| items.iter().map(other).collect::<Vec<String>>().join(", "))
}

impl NodeConfig {
    /// Returns the text of the configuration, every key with its value; `venue` is the text of the venue's file.
    ///
    /// # Errors
    /// Everything that `tomoswarm check` would refuse.
    pub(super) fn text(&self, venue: &str) -> Result<String, Problems> {
        let file = config::read(file_name(self.node), &self.given(), &mut |_| {
            Ok(venue.to_owned())
        })?;
        Ok(format!(
            "# Written by tomoswarm enroll.\n{}",
            config::to_toml(&file)
        ))
    }

    /// Returns what is not left to the defaults.
    fn given(&self) -> String {
        let state = format!("state_dir = {}\n", quoted(&self.state_dir));
        let own = match self.node {
            Sender::Ground => {
                format!(
                    "kind = \"ground\"\nvenue = \"venue.toml\"\nvehicles = [{}]\n{state}{RECORD}",
                    vehicle_list(&self.vehicles)
                )
            }
            Sender::Vehicle(id) => {
                format!(
                    "kind = \"vehicle\"\nvenue = \"venue.toml\"\nid = {id}\n{state}{DRIVERS}{RECORD}"
                )
            }
            Sender::Operator(id) => {
                format!("kind = \"operator\"\nvenue = \"venue.toml\"\nid = {id}\n")
            }
        };
        format!("{own}\n{}", self.bus())
    }

    fn bus(&self) -> String {
        let topology = self.topology.name();
        let mut text = format!("[bus]\ntopology = \"{topology}\"\n");
        if self.node == Sender::Ground || self.topology == Topology::Mesh {
            text += &format!("listen = [{}]\n", quoted(&self.listen().to_string()));
        }
        if self.node != Sender::Ground {
            let (host, port) = (self.ground_host.clone(), self.port);
            let ground = Endpoint {
                protocol: Protocol::Tls,
                host,
                port,
            };
            // An operator must reach the vehicles of a mesh when the ground station is dead.
            let names_all =
                matches!(self.node, Sender::Operator(_)) && self.topology == Topology::Mesh;
            let vehicles: &[Endpoint] = if names_all { &self.reached } else { &[] };
            text += &format!(
                "connect = [{}]\n",
                endpoint_list([&ground].into_iter().chain(vehicles))
            );
        }
        text + "ca = \"ca.pem\"\ncertificate = \"certificate.pem\"\nkey = \"key.pem\"\nroster = \"roster.txt\"\n"
    }

    /// Returns where the node listens: on its own machine, unless others are to reach it.
    fn listen(&self) -> Endpoint {
        let host = if self.is_reached {
            "0.0.0.0"
        } else {
            "127.0.0.1"
        };
        // Several nodes of one machine cannot all have the same port.
        let is_fixed = match self.node {
            Sender::Ground => true,
            Sender::Vehicle(_) => self.has_host,
            Sender::Operator(_) => false,
        };
        let port = if is_fixed { self.port } else { 0 };
        Endpoint {
            protocol: Protocol::Tls,
            host: host.to_owned(),
            port,
        }
    }
}

const DRIVERS: &str = "
# Each device has a driver of its own choice; simulated ones speak with a world, and the word is the world's.
[autopilot]
driver = \"sim\"
[range]
driver = \"sim\"
[servo]
driver = \"sim\"
[radio]
driver = \"sim\"
[world]
connect = \"127.0.0.1:7500\"
token = \"choose-a-word\"
";

/// Eight hours of a sweep, of which a vehicle records up to 303 kB/s: 8.7 GB; recordings give way when a disk is short.
const RECORD: &str = "[record]\nlimit_mb = 10000\n";

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expected: Option<&str>) {
        let changed = with_list(text, "connect", |list| with_end(list, "1, 2", "3"));
        assert_eq!(changed.as_deref(), expected, "{text}");
    }

    #[test]
    fn a_list_is_changed_where_it_is_as_it_was_written_and_all_else_stays() {
        check(
            "a = 1\nconnect = [0, 1, 2] # 5\nb = 2",
            Some("a = 1\nconnect = [0, 3] # 5\nb = 2"),
        );
        check("connect = [0, 1, 2]\r\n", Some("connect = [0, 3]\r\n"));
        check(
            "connect = [\"[::1]:7\", 1, 2]\n",
            Some("connect = [\"[::1]:7\", 3]\n"),
        );
        for other in [
            "",
            "connect = [0, 2, 1]\n",
            "connect = [\n0, 1, 2]\n",
            "# connect = [0, 1, 2]\n",
            "connect = [0, 1, 2]\nconnect = [0, 1, 2]\n",
            "reconnect = [0, 1, 2]\n",
            "connect = [0, 1, 2",
        ] {
            check(other, None);
        }
    }

    #[test]
    fn items_at_the_end_of_a_list_are_replaced_added_and_taken_away() {
        for (list, former, items, expected) in [
            ("0", "", "1", Some("0, 1")),
            ("0, 1", "1", "2, 3", Some("0, 2, 3")),
            ("0, 1", "1", "", Some("0")),
            ("0, 1", "", "", Some("0, 1")),
            ("0, 11", "1", "2", None),
            ("1", "1", "2", Some("2")),
            ("", "", "1", Some("1")),
            ("1", "2", "3", None),
        ] {
            assert_eq!(
                with_end(list, former, items).as_deref(),
                expected,
                "{list}, {former}, {items}"
            );
        }
    }
}
