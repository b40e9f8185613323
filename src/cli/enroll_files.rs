//! The configuration that `enroll` writes for a node: ready to be checked and started. Decides nothing about trust.

use tomoswarm_proto::{Sender, VehicleId};

use crate::config::{self, Endpoint, Problems, Protocol, Topology, quoted};

/// What the configuration of an enrolled node depends on.
#[derive(Clone, Debug)]
pub struct NodeConfig {
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
    /// The folder that outlives the node.
    pub state_dir: String,
    /// The vehicles that are enrolled.
    pub vehicles: Vec<VehicleId>,
    /// Where those of them are reached that others reach.
    pub reached: Vec<Endpoint>,
}

/// Gives the name of a node's configuration.
pub fn file_name(node: Sender) -> &'static str {
    match node {
        Sender::Ground => "ground.toml",
        Sender::Vehicle(_) => "vehicle.toml",
        Sender::Operator(_) => "operator.toml",
    }
}

/// Returns the key of a ground station's configuration that lists its vehicles.
pub fn vehicles_line(vehicles: &[VehicleId]) -> String {
    let ids: Vec<String> = vehicles.iter().map(ToString::to_string).collect();
    format!("vehicles = [{}]", ids.join(", "))
}

/// Returns endpoints as they stand in a list of a configuration.
pub fn endpoints(list: &[&Endpoint]) -> String {
    let list: Vec<String> = list.iter().map(|endpoint| quoted(&endpoint.to_string())).collect();
    list.join(", ")
}

impl NodeConfig {
    /// Returns the text of the configuration, every key with its value; `venue` is the text of the venue's file.
    ///
    /// # Errors
    /// Everything that `tomoswarm check` would refuse.
    pub fn text(&self, venue: &str) -> Result<String, Problems> {
        let file = config::read(file_name(self.node), &self.given(), &mut |_| Ok(venue.to_owned()))?;
        Ok(format!("# Written by tomoswarm enroll.\n{}", config::written(&file)))
    }

    /// Returns what is not left to the defaults.
    fn given(&self) -> String {
        let state = format!("state_dir = {}\n", quoted(&self.state_dir));
        let own = match self.node {
            Sender::Ground => {
                format!(
                    "kind = \"ground\"\nvenue = \"venue.toml\"\n{}\n{state}",
                    vehicles_line(&self.vehicles)
                )
            }
            Sender::Vehicle(id) => {
                format!("kind = \"vehicle\"\nvenue = \"venue.toml\"\nid = {id}\n{state}{DRIVERS}")
            }
            Sender::Operator(_) => "kind = \"operator\"\nvenue = \"venue.toml\"\n".to_owned(),
        };
        format!("{own}\n{}", self.bus())
    }

    fn bus(&self) -> String {
        let topology = match self.topology {
            Topology::Mesh => "mesh",
            Topology::Star => "star",
        };
        let mut text = format!("[bus]\ntopology = \"{topology}\"\n");
        if self.node == Sender::Ground || self.topology == Topology::Mesh {
            text += &format!("listen = [{}]\n", quoted(&self.listen().to_string()));
        }
        if self.node != Sender::Ground {
            let (host, port) = (self.ground_host.clone(), self.port);
            let ground = Endpoint { protocol: Protocol::Tls, host, port };
            // An operator must reach the vehicles of a mesh when the ground station is dead.
            let names_all = matches!(self.node, Sender::Operator(_)) && self.topology == Topology::Mesh;
            let vehicles: &[Endpoint] = if names_all { &self.reached } else { &[] };
            let all: Vec<&Endpoint> = [&ground].into_iter().chain(vehicles).collect();
            text += &format!("connect = [{}]\n", endpoints(&all));
        }
        text + "ca = \"ca.pem\"\ncertificate = \"certificate.pem\"\nkey = \"key.pem\"\nroster = \"roster.txt\"\n"
    }

    /// Gives where the node listens: on its own machine, unless others are to reach it.
    fn listen(&self) -> Endpoint {
        let host = if self.is_reached { "0.0.0.0" } else { "127.0.0.1" };
        // Several nodes of one machine cannot all have the same port.
        let is_fixed = match self.node {
            Sender::Ground => true,
            Sender::Vehicle(_) => self.is_reached,
            Sender::Operator(_) => false,
        };
        let port = if is_fixed { self.port } else { 0 };
        Endpoint { protocol: Protocol::Tls, host: host.to_owned(), port }
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
