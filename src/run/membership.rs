//! From a node's file to how it takes part in the bus, and how it greets.

use std::path::{Path, PathBuf};

use tomoswarm_proto::{Boot, Capability, Hello, OperatorId, Sender};

use super::bus::{BusSettings, SessionTopology, Trust};
use super::state_dir::StateDir;
use super::trust::{self, AccessRule, TrustError, Trusted};
use crate::config::{BusFile, Endpoint, Topology as Named, Venue};
use crate::exchange::software::SOFTWARE;
use crate::store::replace;

/// Who gives commands where no operator's file says which operator it is.
pub const FIRST_OPERATOR: OperatorId = OperatorId(1);

/// The file in a node's folder that keeps the highest issue of the roster.
const ROSTER_ISSUE: &str = "roster-issue";

/// The machine gave no random number, so that nothing can be told apart.
#[derive(Debug, thiserror::Error)]
#[error("the system gives no random numbers: {0}")]
pub struct RandomUnavailable(getrandom::Error);

/// Draws a random number.
///
/// # Errors
/// The system gives none.
pub fn draw() -> Result<u64, RandomUnavailable> {
    getrandom::u64().map_err(RandomUnavailable)
}

/// Returns how a node takes part in the bus; `access` says who may write what, where there are certificates.
pub fn bus_settings(
    node: Sender,
    venue: &Venue,
    file: &BusFile,
    access: Vec<AccessRule>,
) -> BusSettings {
    let trust = file.identity.as_ref().map(|identity| Trust {
        ca: PathBuf::from(&identity.ca),
        certificate: PathBuf::from(&identity.certificate),
        key: PathBuf::from(&identity.key),
        access,
    });
    let text = |endpoints: &[Endpoint]| endpoints.iter().map(Endpoint::to_string).collect();
    BusSettings {
        node,
        prefix: format!("tomoswarm/{}", venue.name),
        topology: match file.topology {
            Named::Mesh => SessionTopology::Mesh,
            Named::Star => SessionTopology::Star,
        },
        listen: text(&file.listen),
        connect: text(&file.connect),
        trust,
        lease: file.lease(),
        egress_bytes_per_s: (file.egress_kb_per_s * 1e3) as u32,
        gossip: file.gossip,
    }
}

/// Reads the files by which a node is known, and returns who may write what; nothing where there are no certificates.
/// The highest issue of the roster that was ever seen is kept, so that an older one does not count again.
///
/// # Errors
/// A file is damaged, of another authority, or revoked; the roster is older than one seen before, or its issue cannot be
/// kept.
pub fn access(
    node: Sender,
    venue: &Venue,
    file: &BusFile,
    state_dir: Option<&StateDir>,
) -> Result<Vec<AccessRule>, TrustError> {
    let Some(identity) = &file.identity else {
        return Ok(Vec::new());
    };
    let path = state_dir.map(|state_dir| state_dir.join(ROSTER_ISSUE));
    let seen = path.as_deref().map_or(Ok(None), seen_issue)?;
    let trusted = Trusted::read(identity, node, seen)?;
    if let Some(path) = path.filter(|_| seen != Some(trusted.roster.issue)) {
        keep_issue(&path, trusted.roster.issue)
            .map_err(|source| TrustError::Kept { path, source })?;
    }
    Ok(trust::access_rules(
        &trusted.roster,
        &venue.name,
        file.topology,
    ))
}

/// Returns the highest issue of the roster that a node has kept in its folder; `None` = it has seen none.
///
/// # Errors
/// What it has kept cannot be read, or is damaged.
pub fn seen_roster_issue(state_dir: &Path) -> Result<Option<u64>, TrustError> {
    seen_issue(&state_dir.join(ROSTER_ISSUE))
}

fn seen_issue(path: &Path) -> Result<Option<u64>, TrustError> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(source) => {
            return Err(TrustError::Read {
                path: path.to_owned(),
                source,
                needed: "a node needs a folder of its own that it can read (state_dir)",
            });
        }
    };
    let issue = text.trim().parse();
    issue.map(Some).map_err(|_| TrustError::Issue {
        path: path.to_owned(),
        text: text.trim().to_owned(),
    })
}

/// Keeps the issue of a roster, so that a power cut leaves it or the one before.
fn keep_issue(path: &Path, issue: u64) -> std::io::Result<()> {
    replace(path, &format!("{issue}\n"))
}

/// Returns how a node greets; `capabilities` are ascending. It has no name and asks for nothing but what all are told.
///
/// # Errors
/// The system gives no random numbers.
pub fn greeting(
    node: Sender,
    boot: Boot,
    venue: &Venue,
    capabilities: Vec<Capability>,
) -> Result<Hello, RandomUnavailable> {
    Ok(Hello {
        software: SOFTWARE.to_owned(),
        capabilities,
        ..Hello::asking(node, boot, venue.hash(), draw()?)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_issue_of_the_roster_is_kept_whole_and_a_torn_one_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("roster-issue");
        assert_eq!(seen_issue(&path).unwrap(), None);
        for issue in [7, 12] {
            keep_issue(&path, issue).unwrap();
            assert_eq!(seen_issue(&path).unwrap(), Some(issue));
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        for torn in ["", "many", "-1"] {
            std::fs::write(&path, torn).unwrap();
            let refused = seen_issue(&path).unwrap_err().to_string();
            assert!(
                refused.contains("roster-issue") && refused.contains("no issue"),
                "{refused}"
            );
        }
    }
}
