//! Which keys a node may write: what the roster means on the bus. Plain data; the bus makes its configuration of it.

use tomoswarm_proto::Sender;

use super::super::subjects::written_by;
use super::roster::Roster;
use crate::config::Topology;

/// What the owner of one certificate may do. All that no rule allows is refused.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct AccessRule {
    /// The common name in its certificate.
    pub common_name: String,
    /// Key expressions under which it may publish or hand on.
    pub writes: Vec<String>,
    /// Key expressions that it may read.
    pub reads: Vec<String>,
}

/// Returns the rules of all certificates of a roster; `venue` is the name of the venue.
///
/// A node writes under its own keys ([`written_by`]) and reads everything of its venue: who hears what is the table's
/// ([`crate::exchange::table`]), and a kind that the roster's authority does not know yet must pass. In a star everything
/// comes to a vehicle through the ground station, which therefore may hand on what others wrote; it is the ground station
/// that holds them to their own keys.
pub fn access_rules(roster: &Roster, venue: &str, topology: Topology) -> Vec<AccessRule> {
    let all = format!("tomoswarm/{venue}/**");
    let rule = |name: super::CommonName| {
        let writes = match (name.node, topology) {
            (Sender::Ground, Topology::Star) => vec![all.clone()],
            (Sender::Ground | Sender::Vehicle(_) | Sender::Operator(_), Topology::Mesh)
            | (Sender::Vehicle(_) | Sender::Operator(_), Topology::Star) => {
                let own = written_by(name.node).into_iter();
                own.map(|key| format!("tomoswarm/{venue}/{key}")).collect()
            }
        };
        AccessRule {
            common_name: name.to_string(),
            writes,
            reads: vec![all.clone()],
        }
    };
    roster
        .allowed
        .iter()
        .map(|entry| rule(entry.name))
        .collect()
}
