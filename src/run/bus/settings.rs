//! What a session on the bus is told, what it counts, and why it fails.

use std::path::PathBuf;
use std::time::Duration;

use tomoswarm_proto::Sender;

use super::super::trust::AccessRule;

/// How nodes are joined.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SessionTopology {
    /// Everyone with everyone; goes on without the ground station. Up to about 25 nodes.
    Mesh,
    /// All through the ground station.
    Star,
}

/// The files by which nodes know each other, and what the roster allows.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Trust {
    /// Certificate of the authority.
    pub ca: PathBuf,
    /// Own certificate.
    pub certificate: PathBuf,
    /// Own private key.
    pub key: PathBuf,
    /// Who may write what.
    pub access: Vec<AccessRule>,
}

/// How a node takes part in the bus.
#[derive(Clone, PartialEq, Debug)]
pub struct BusSettings {
    /// Who this is.
    pub node: Sender,
    /// Before every key: `tomoswarm/<venue>`.
    pub prefix: String,
    /// How nodes are joined.
    pub topology: SessionTopology,
    /// Where it listens, such as `tcp/127.0.0.1:7447`.
    pub listen: Vec<String>,
    /// Whom it connects to.
    pub connect: Vec<String>,
    /// Certificates; `None` = unprotected.
    pub trust: Option<Trust>,
    /// A link on which nothing comes for this long is given up.
    pub lease: Duration,
    /// What it may send, bytes per second.
    pub egress_bytes_per_s: u32,
    /// Whether the nodes of a mesh tell each other of further ones; otherwise only `connect` joins them.
    pub gossip: bool,
}

/// What the bus has carried and refused.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct BusTraffic {
    /// Frames published.
    pub sent: u64,
    /// Their bytes.
    pub sent_bytes: u64,
    /// Frames taken.
    pub taken: u64,
    /// Their bytes.
    pub taken_bytes: u64,
    /// Frames refused: not ours, impossible, too much, or not the sender's to say.
    pub refused: u64,
    /// Frames of kinds that are not known here, dropped.
    pub unknown: u64,
    /// How often the session was opened anew because a thread of the library had panicked.
    pub panics: u64,
    /// Frames dropped before they were sent because too much waited, among them batches of samples beyond the second; what
    /// the network drops under congestion is not known.
    pub dropped: u64,
}

/// Why a node cannot take part in the bus.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The settings are not taken.
    #[error("the bus cannot be set up: {reason}")]
    Settings {
        /// What zenoh says.
        reason: String,
    },
    /// It cannot listen where it should.
    #[error("the bus cannot listen on {endpoints}: {reason}")]
    Listen {
        /// Where.
        endpoints: String,
        /// What zenoh says.
        reason: String,
    },
    /// The machine has no thread to give.
    #[error("the bus has no thread: {0}")]
    Thread(#[from] std::io::Error),
}
