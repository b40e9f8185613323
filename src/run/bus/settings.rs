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

/// Returns what zenoh says of an error without where in its sources it says so (` at PATH.rs:LINE.`).
pub(super) fn without_places(text: &str) -> String {
    let mut said = String::new();
    let mut words = text.split(' ').peekable();
    while let Some(word) = words.next() {
        let place = words.next_if(|next| word == "at" && next.contains(".rs:"));
        let behind = place.and_then(|place| place.rsplit_once(".rs:"));
        match behind {
            Some((_, behind)) => {
                let behind = behind.trim_start_matches(|c: char| c.is_ascii_digit());
                said += behind.strip_prefix('.').unwrap_or(behind);
            }
            None => {
                said += if said.is_empty() { "" } else { " " };
                said += word;
            }
        }
    }
    said
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_zenoh_do_not_name_places_in_its_sources() {
        let said = "Can not create a listener: [127.0.0.1:7447: Address in use (os error 98) at /a/src/tcp.rs:61.] at /a/b.rs:9.";
        let expected = "Can not create a listener: [127.0.0.1:7447: Address in use (os error 98)]";
        assert_eq!(without_places(said), expected);
        for other in ["", "at noon", "a file.rs:7 is named at last"] {
            assert_eq!(without_places(other), other);
        }
    }
}
