//! The `[bus]` of a node's file: in which shape the nodes are joined, where this one listens and connects to, and by
//! what it is known. Opens no file and no socket: certificates are only named here.

use std::time::Duration;

use super::endpoint::{Endpoint, Protocol};
use super::forms::FileName;
use super::forms::seconds;
use super::keys::{
    Flag, Form, KeyEntry, Keyed, Keys, Number, WordChoice, Words, quoted, read_defaults,
    written_list,
};
use super::section::Section;
use super::source::Source;

/// The most endpoints of one list.
const MOST_ENDPOINTS: usize = 256;
/// The files by which a node is known, all or none.
const IDENTITY_KEYS: [&str; 4] = ["ca", "certificate", "key", "roster"];

/// The shape in which the nodes are joined.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Topology {
    /// Everyone is joined with everyone; up to about 25 nodes.
    #[default]
    Mesh,
    /// The ground station listens, everyone else connects to it.
    Star,
}

/// Which node a `[bus]` belongs to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Role {
    Vehicle,
    Ground,
    Operator,
}

/// The files by which a node is known to the others and knows them; written by `tomoswarm enroll`.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Identity {
    /// Certificate of the authority that all nodes trust (PEM).
    pub ca: String,
    /// Certificate of this node (PEM).
    pub certificate: String,
    /// Private key of this node (PEM).
    pub key: String,
    /// Who is allowed, signed by the authority.
    pub roster: String,
}

/// How a node joins the bus.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct BusFile {
    /// The shape in which the nodes are joined.
    pub topology: Topology,
    /// Where this node listens; port 0 is a free one.
    pub listen: Vec<Endpoint>,
    /// Where it connects to, again and again.
    pub connect: Vec<Endpoint>,
    /// By what it is known; without, every endpoint is plain TCP.
    pub identity: Option<Identity>,
    /// Whether a node without certificates may be reached by other machines.
    pub unprotected_network: bool,
    /// The most that this node sends, kilobytes (1000 bytes) per second.
    pub egress_kb_per_s: f64,
    /// After this much silence a neighbour is taken for gone, seconds.
    pub lease_s: f64,
    /// Whether the nodes of a mesh tell each other of further ones; otherwise only `connect` joins them.
    pub gossip: bool,
}

impl BusFile {
    /// Returns what holds for a bus of which nothing is said, without any endpoint.
    pub fn unsaid() -> BusFile {
        let mut bus = BusFile::default();
        read_defaults(&mut BusFileTable {
            bus: &mut bus,
            role: Role::Operator,
        });
        BusFile {
            listen: Vec::new(),
            ..bus
        }
    }

    /// Returns after how much silence a neighbour is taken for gone.
    pub fn lease(&self) -> Duration {
        seconds(self.lease_s)
    }

    /// Checks the keys of `[bus]` together.
    pub(super) fn check(&self, source: &Source<'_>, role: Role) {
        let is_protected = IDENTITY_KEYS
            .iter()
            .any(|key| source.is_known(&format!("bus.{key}")));
        check_topology(source, self, role);
        check_ports(source, self);
        check_protection(source, self, is_protected);
    }
}

impl Topology {
    /// Returns its word in files.
    pub fn name(self) -> &'static str {
        self.word()
    }
}

impl WordChoice for Topology {
    const WORDS: &'static [(&'static str, Topology)] =
        &[("mesh", Topology::Mesh), ("star", Topology::Star)];
}

/// What a node may send, live and simulated.
pub(super) const EGRESS: Number = Number {
    name: "egress_kb_per_s",
    default: 64.0,
    allowed: 8.0..=100_000.0,
    means: "the most that a node sends, the same on all nodes: from each of the others four times as much is taken",
};

/// The table `[bus]` of a node.
pub(super) struct BusFileTable<'a> {
    pub(super) bus: &'a mut BusFile,
    pub(super) role: Role,
}

impl Keyed for BusFileTable<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        let BusFile {
            topology,
            listen,
            connect,
            identity,
            unprotected_network,
            egress_kb_per_s,
            lease_s,
            gossip,
        } = &mut *self.bus;
        let means = "`mesh`: everyone is joined with everyone, up to about 25 nodes; `star`: the ground station listens, \
                     all others only connect";
        to.word(
            topology,
            Words {
                name: "topology",
                default: Topology::Mesh.word(),
                means,
            },
        );
        let is_protected = identity_keys(identity, to);
        let only_connects = *topology == Topology::Star && self.role != Role::Ground;
        let default = default_listen(self.role, only_connects, is_protected);
        let left_out = "this machine";
        let means = "endpoints, `tcp/HOST:PORT` or `tls/HOST:PORT`; port 0 is a free one. Ground: 127.0.0.1:7447, others \
                     127.0.0.1:0";
        to.form(
            &mut Endpoints {
                list: listen,
                default,
            },
            KeyEntry {
                name: "listen",
                left_out,
                means,
            },
        );
        let default = Vec::new();
        let means = "endpoints; needed by all but the ground in a star, and by an operator";
        to.form(
            &mut Endpoints {
                list: connect,
                default,
            },
            KeyEntry {
                name: "connect",
                left_out: "",
                means,
            },
        );
        let means = "without certificates a node binds and connects to loopback only; this lets it out, and anyone in";
        to.flag(
            unprotected_network,
            Flag {
                name: "unprotected_network",
                default: false,
                means,
            },
        );
        to.number(egress_kb_per_s, EGRESS);
        let means = "silence after which a neighbour is taken for gone";
        to.number(
            lease_s,
            Number {
                name: "lease_s",
                default: 3.0,
                allowed: 1.0..=30.0,
                means,
            },
        );
        let means = "in a mesh: nodes tell each other of further ones and join them too; with false only `connect` joins \
                     nodes";
        to.flag(
            gossip,
            Flag {
                name: "gossip",
                default: true,
                means,
            },
        );
    }
}

/// Shows the files by which a node is known, all or none of which are there, and returns whether any is.
fn identity_keys(identity: &mut Option<Identity>, to: &mut dyn Keys) -> bool {
    let [mut ca, mut certificate, mut key, mut roster] = match identity.take() {
        Some(Identity {
            ca,
            certificate,
            key,
            roster,
        }) => [ca, certificate, key, roster].map(Some),
        None => [const { None }; 4],
    };
    let means = [
        "certificate of the authority (PEM)",
        "of this node (PEM)",
        "private, of this node (PEM)",
        "who is \
                 allowed",
    ];
    let files = [&mut ca, &mut certificate, &mut key, &mut roster];
    for ((name, file), means) in IDENTITY_KEYS.into_iter().zip(files).zip(means) {
        to.form(
            &mut IdentityFile(file),
            KeyEntry {
                name,
                left_out: "",
                means,
            },
        );
    }
    let is_any = [&ca, &certificate, &key, &roster]
        .into_iter()
        .any(Option::is_some);
    if let (Some(ca), Some(certificate), Some(key), Some(roster)) = (ca, certificate, key, roster) {
        *identity = Some(Identity {
            ca,
            certificate,
            key,
            roster,
        });
    }
    is_any
}

/// A file that must be there when any of its kind is.
struct IdentityFile<'a>(&'a mut Option<String>);

impl Form for IdentityFile<'_> {
    fn to_toml(&self) -> Option<String> {
        self.0.as_deref().map(quoted)
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let is_any = IDENTITY_KEYS.iter().any(|key| section.has(key));
        let needed =
            "ca, certificate, key and roster are needed together; tomoswarm enroll writes them";
        FileName {
            name: self.0,
            needed: is_any.then_some(needed),
        }
        .read(section, key);
    }
}

/// A list of endpoints.
struct Endpoints<'a> {
    list: &'a mut Vec<Endpoint>,
    default: Vec<Endpoint>,
}

impl Form for Endpoints<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(written_list(
            self.list
                .iter()
                .map(|endpoint| quoted(&endpoint.to_string())),
        ))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        *self.list = read_endpoints(section, key).unwrap_or_else(|| self.default.clone());
    }
}

/// Returns a list of endpoints if it is there; those that are none are refused and left out.
fn read_endpoints(section: &Section, key: &'static str) -> Option<Vec<Endpoint>> {
    const RULE: &str =
        "endpoints such as [\"tcp/127.0.0.1:7447\"] or [\"tls/ground.local:7447\"] are allowed";
    if !section.has(key) {
        return None;
    }
    let Some(list) = section
        .list(key)
        .filter(|list| list.len() <= MOST_ENDPOINTS)
    else {
        section.refuse(
            key,
            &format!("is no list of at most {MOST_ENDPOINTS} endpoints"),
            RULE,
        );
        return Some(Vec::new());
    };
    let mut endpoints = Vec::new();
    for (index, entry) in list.iter().enumerate() {
        let number = index + 1;
        match entry.get_ref().as_str().map(Endpoint::parse) {
            None => section.refuse(key, &format!("number {number} is no text"), RULE),
            Some(Err(error)) => section.refuse(key, &format!("number {number} {error}"), RULE),
            Some(Ok(endpoint)) if endpoint.port > 0 && endpoints.contains(&endpoint) => {
                section.refuse(key, &format!("number {number} is there twice"), RULE);
            }
            Some(Ok(endpoint)) => endpoints.push(endpoint),
        }
    }
    Some(endpoints)
}

/// Returns where a node listens when its file does not say: on its own machine only.
fn default_listen(role: Role, only_connects: bool, is_protected: bool) -> Vec<Endpoint> {
    if only_connects {
        return Vec::new();
    }
    let port = match role {
        Role::Ground => 7447,
        Role::Vehicle | Role::Operator => 0,
    };
    let protocol = if is_protected {
        Protocol::Tls
    } else {
        Protocol::Tcp
    };
    vec![Endpoint {
        protocol,
        host: "127.0.0.1".to_owned(),
        port,
    }]
}

fn check_topology(source: &Source<'_>, bus: &BusFile, role: Role) {
    let are_sound = source.is_sound(&["bus.topology", "bus.listen", "bus.connect"]);
    if !are_sound {
        return;
    }
    match (bus.topology, role) {
        (Topology::Star, Role::Ground) => {
            if !bus.connect.is_empty() {
                let wrong = "is not for the ground station of a star";
                source.refuse(
                    "bus.connect",
                    wrong,
                    "it only listens; the others connect to it",
                );
            }
            refuse_silence(
                source,
                bus,
                "the ground station of a star must listen somewhere",
            );
        }
        (Topology::Star, Role::Vehicle | Role::Operator) => {
            if !bus.listen.is_empty() {
                let wrong = "is for the ground station of a star only";
                source.refuse("bus.listen", wrong, "leave it out: this node only connects");
            }
            require_connect(
                source,
                bus,
                "the endpoint of the ground station is needed in a star",
            );
        }
        (Topology::Mesh, Role::Vehicle | Role::Ground) => {
            refuse_silence(source, bus, "every node of a mesh must listen somewhere");
        }
        (Topology::Mesh, Role::Operator) => {
            refuse_silence(source, bus, "every node of a mesh must listen somewhere");
            require_connect(
                source,
                bus,
                "the endpoint of one node of the mesh is needed",
            );
        }
    }
}

fn refuse_silence(source: &Source<'_>, bus: &BusFile, rule: &str) {
    if bus.listen.is_empty() {
        source.refuse("bus.listen", "is empty", rule);
    }
}

fn require_connect(source: &Source<'_>, bus: &BusFile, rule: &str) {
    if !source.is_known("bus.connect") {
        source.require("bus.connect", rule);
    } else if bus.connect.is_empty() {
        source.refuse("bus.connect", "is empty", rule);
    }
}

fn check_ports(source: &Source<'_>, bus: &BusFile) {
    for (key, endpoints) in [("bus.listen", &bus.listen), ("bus.connect", &bus.connect)] {
        let mut twice =
            (1..endpoints.len()).filter(|at| endpoints[..*at].contains(&endpoints[*at]));
        if let Some(at) = twice.next() {
            let wrong = format!("{} stands there twice", endpoints[at]);
            source.refuse(key, &wrong, "each endpoint once is allowed");
        }
    }
    for endpoint in &bus.connect {
        if endpoint.port == 0 {
            let wrong = format!("{endpoint} has port 0");
            source.refuse(
                "bus.connect",
                &wrong,
                "a free port (0) is for listening only",
            );
        } else if bus.listen.contains(endpoint) {
            let wrong = format!("{endpoint} is where this node itself listens");
            source.refuse("bus.connect", &wrong, "another node's endpoint is allowed");
        }
    }
}

fn check_protection(source: &Source<'_>, bus: &BusFile, is_protected: bool) {
    if is_protected && bus.unprotected_network {
        let wrong = "does not go with certificates: all that this node says is protected";
        source.refuse(
            "bus.unprotected_network",
            wrong,
            "leave it out, or leave out the certificates",
        );
    }
    for (key, endpoints) in [("bus.listen", &bus.listen), ("bus.connect", &bus.connect)] {
        for endpoint in endpoints {
            check_endpoint(source, bus, is_protected, key, endpoint);
        }
    }
}

fn check_endpoint(
    source: &Source<'_>,
    bus: &BusFile,
    is_protected: bool,
    key: &str,
    endpoint: &Endpoint,
) {
    match endpoint.protocol {
        Protocol::Tcp if is_protected => {
            let wrong = format!("{endpoint} is unprotected although certificates are given");
            source.refuse(key, &wrong, "tls/HOST:PORT is needed with certificates");
        }
        Protocol::Tls if !is_protected => {
            let wrong = format!("{endpoint} needs certificates");
            source.refuse(
                key,
                &wrong,
                "give ca, certificate, key and roster (tomoswarm enroll writes them), or tcp/HOST:PORT",
            );
        }
        Protocol::Tcp if !bus.unprotected_network && !endpoint.is_loopback() => {
            let wrong = format!(
                "{endpoint} leaves this machine, and anyone there could read and give orders"
            );
            source.refuse(
                key,
                &wrong,
                "without certificates a node binds and connects to loopback (127.0.0.1, ::1, localhost) only: enroll \
                 it (tomoswarm enroll), or say unprotected_network = true",
            );
        }
        Protocol::Tcp | Protocol::Tls => {}
    }
}
