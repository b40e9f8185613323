//! The `[bus]` of a node's file: in which shape the nodes are joined, where this one listens and connects to, and by
//! what it is known. Opens no file and no socket: certificates are only named here.

use std::time::Duration;

use super::beside;
use super::endpoint::{Endpoint, Protocol};
use super::section::Section;

/// The most endpoints of one list.
const MOST_ENDPOINTS: usize = 256;
/// The files by which a node is known, all or none.
const IDENTITY_KEYS: [&str; 4] = ["ca", "certificate", "key", "roster"];

/// The shape in which the nodes are joined.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Topology {
    /// Everyone is joined with everyone; up to about 25 nodes.
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
#[derive(Clone, PartialEq, Debug)]
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
    /// After this much silence a neighbour is taken for gone.
    pub lease: Duration,
    /// Whether the nodes of a mesh tell each other of further ones; otherwise only `connect` joins them.
    pub gossip: bool,
}

impl BusFile {
    pub(super) fn read(section: &Section, role: Role) -> BusFile {
        let topologies = [("mesh", Topology::Mesh), ("star", Topology::Star)];
        let topology = section.choice("topology", Topology::Mesh, &topologies);
        let listen = read_endpoints(section, "listen");
        let connect = read_endpoints(section, "connect");
        let (identity, is_protected) = read_identity(section);
        let only_connects = topology == Topology::Star && role != Role::Ground;
        let bus = BusFile {
            topology,
            listen: listen.unwrap_or_else(|| default_listen(role, only_connects, is_protected)),
            connect: connect.unwrap_or_default(),
            identity,
            unprotected_network: section.flag("unprotected_network", false),
            egress_kb_per_s: section.number("egress_kb_per_s", 64.0, 8.0..=100_000.0),
            lease: section.duration("lease_s", 3.0, 1.0..=30.0),
            gossip: section.flag("gossip", true),
        };
        section.finish();
        check_topology(section, &bus, role);
        check_ports(section, &bus);
        check_protection(section, &bus, is_protected);
        bus
    }
}

/// Gives a list of endpoints if it is there; those that are none are refused and left out.
fn read_endpoints(section: &Section, key: &'static str) -> Option<Vec<Endpoint>> {
    const RULE: &str =
        "endpoints such as [\"tcp/127.0.0.1:7447\"] or [\"tls/ground.local:7447\"] are allowed";
    if !section.has(key) {
        return None;
    }
    let Some(list) = section.list(key).filter(|list| list.len() <= MOST_ENDPOINTS) else {
        section.refuse(key, &format!("is no list of at most {MOST_ENDPOINTS} endpoints"), RULE);
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

/// Reads the files by which a node is known, and tells whether any of them is given.
fn read_identity(section: &Section) -> (Option<Identity>, bool) {
    let is_any = IDENTITY_KEYS.iter().any(|key| section.has(key));
    let file = |key: &'static str| {
        if is_any {
            let needed = "ca, certificate, key and roster are needed together; tomoswarm enroll writes them";
            section.require(key, needed);
        }
        section.text(key).map(|path| beside(section.source.file(), &path))
    };
    let (ca, certificate, key, roster) = (file("ca"), file("certificate"), file("key"), file("roster"));
    let identity = || Some(Identity { ca: ca?, certificate: certificate?, key: key?, roster: roster? });
    (identity(), is_any)
}

/// Gives where a node listens when its file does not say: on its own machine only.
fn default_listen(role: Role, only_connects: bool, is_protected: bool) -> Vec<Endpoint> {
    if only_connects {
        return Vec::new();
    }
    let port = match role {
        Role::Ground => 7447,
        Role::Vehicle | Role::Operator => 0,
    };
    let protocol = if is_protected { Protocol::Tls } else { Protocol::Tcp };
    vec![Endpoint { protocol, host: "127.0.0.1".to_owned(), port }]
}

fn check_topology(section: &Section, bus: &BusFile, role: Role) {
    let are_sound = section.source.is_sound(&["bus.topology", "bus.listen", "bus.connect"]);
    if !are_sound {
        return;
    }
    match (bus.topology, role) {
        (Topology::Star, Role::Ground) => {
            if !bus.connect.is_empty() {
                let wrong = "is not for the ground station of a star";
                section.refuse("connect", wrong, "it only listens; the others connect to it");
            }
            refuse_silence(section, bus, "the ground station of a star must listen somewhere");
        }
        (Topology::Star, Role::Vehicle | Role::Operator) => {
            if !bus.listen.is_empty() {
                let wrong = "is for the ground station of a star only";
                section.refuse("listen", wrong, "leave it out: this node only connects");
            }
            require_connect(section, bus, "the endpoint of the ground station is needed in a star");
        }
        (Topology::Mesh, Role::Vehicle | Role::Ground) => {
            refuse_silence(section, bus, "every node of a mesh must listen somewhere");
        }
        (Topology::Mesh, Role::Operator) => {
            refuse_silence(section, bus, "every node of a mesh must listen somewhere");
            require_connect(section, bus, "the endpoint of one node of the mesh is needed");
        }
    }
}

fn refuse_silence(section: &Section, bus: &BusFile, rule: &str) {
    if bus.listen.is_empty() {
        section.refuse("listen", "is empty", rule);
    }
}

fn require_connect(section: &Section, bus: &BusFile, rule: &str) {
    section.require("connect", rule);
    if section.has("connect") && bus.connect.is_empty() {
        section.refuse("connect", "is empty", rule);
    }
}

fn check_ports(section: &Section, bus: &BusFile) {
    for endpoint in &bus.connect {
        if endpoint.port == 0 {
            let wrong = format!("{endpoint} has port 0");
            section.refuse("connect", &wrong, "a free port (0) is for listening only");
        } else if bus.listen.contains(endpoint) {
            let wrong = format!("{endpoint} is where this node itself listens");
            section.refuse("connect", &wrong, "another node's endpoint is allowed");
        }
    }
}

fn check_protection(section: &Section, bus: &BusFile, is_protected: bool) {
    if is_protected && bus.unprotected_network {
        let wrong = "does not go with certificates: all that this node says is protected";
        section.refuse("unprotected_network", wrong, "leave it out, or leave out the certificates");
    }
    for (key, endpoints) in [("listen", &bus.listen), ("connect", &bus.connect)] {
        for endpoint in endpoints {
            check_endpoint(section, bus, is_protected, key, endpoint);
        }
    }
}

fn check_endpoint(section: &Section, bus: &BusFile, is_protected: bool, key: &str, endpoint: &Endpoint) {
    match endpoint.protocol {
        Protocol::Tcp if is_protected => {
            let wrong = format!("{endpoint} is unprotected although certificates are given");
            section.refuse(key, &wrong, "tls/HOST:PORT is needed with certificates");
        }
        Protocol::Tls if !is_protected => {
            let wrong = format!("{endpoint} needs certificates");
            section.refuse(
                key,
                &wrong,
                "give ca, certificate, key and roster (tomoswarm enroll writes them), or tcp/HOST:PORT",
            );
        }
        Protocol::Tcp if !bus.unprotected_network && !endpoint.is_loopback() => {
            let wrong =
                format!("{endpoint} leaves this machine, and anyone there could read and give orders");
            section.refuse(
                key,
                &wrong,
                "without certificates a node binds and connects to loopback (127.0.0.1, ::1, localhost) only: enroll \
                 it (tomoswarm enroll), or say unprotected_network = true",
            );
        }
        Protocol::Tcp | Protocol::Tls => {}
    }
}
