//! What the lists in the nodes' files said before a call of `tomoswarm enroll`, kept in the swarm's folder until they say what
//! the new roster says: a call that is killed between leaves it for the next one.

use std::path::Path;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Sender, VehicleId};

use super::error::CliError;
use super::read;
use super::swarm_folder::{Swarm, unwritable, vehicles_of};
use crate::config::Endpoint;
use crate::run::trust::{CommonName, NewFile, Roster, replace_file};

/// The file.
const FILE: &str = ".lists-before.json";

/// What the lists said, as names and endpoints in words.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct ListsBefore {
    /// The issue of the roster that the call puts in force.
    issue: u64,
    vehicles: Vec<u8>,
    reached: Vec<String>,
    ground: Option<String>,
    revoked: Option<String>,
}

impl ListsBefore {
    /// Notes what a swarm's lists say, and where its ground station is reached, before another roster comes into force, by which
    /// a node may be revoked.
    pub(super) fn of(
        (swarm, ground): (&Swarm, Option<&Endpoint>),
        next: &Roster,
        revoked: Option<Sender>,
    ) -> ListsBefore {
        let text = |endpoint: &Endpoint| endpoint.to_string();
        ListsBefore {
            issue: next.issue,
            vehicles: vehicles_of(&swarm.roster).iter().map(|id| id.0).collect(),
            reached: swarm.reached(&swarm.roster).iter().map(text).collect(),
            ground: ground.map(text),
            revoked: revoked.map(CommonName::node_name),
        }
    }

    /// Returns what an interrupted call has left in a folder whose roster has this issue; removes what is of none in force.
    ///
    /// # Errors
    /// The disk refuses.
    pub(super) fn left(folder: &Path, issue: u64) -> Result<Option<ListsBefore>, CliError> {
        let path = folder.join(FILE);
        if !path.exists() {
            return Ok(None);
        }
        // Written whole, and by this program alone: what it cannot read is of no use.
        let left = serde_json::from_str(&read::text(&path)?).ok();
        let left = left.filter(|left: &ListsBefore| left.issue == issue);
        if left.is_none() {
            ListsBefore::forget(folder)?;
        }
        Ok(left)
    }

    /// Keeps it in a folder.
    ///
    /// # Errors
    /// The disk refuses.
    pub(super) fn keep(&self, folder: &Path) -> Result<(), CliError> {
        let text =
            serde_json::to_string(self).map_err(|error| CliError::Fault(error.to_string()))?;
        let kept = replace_file(folder, &NewFile::open(FILE, text));
        kept.map_err(unwritable(&folder.join(FILE)))
    }

    /// Removes what is kept in a folder: the lists are up to date.
    ///
    /// # Errors
    /// The disk refuses.
    pub(super) fn forget(folder: &Path) -> Result<(), CliError> {
        let path = folder.join(FILE);
        std::fs::remove_file(&path).map_err(unwritable(&path))
    }

    /// Returns the vehicles that were enrolled.
    pub(super) fn vehicles(&self) -> Vec<VehicleId> {
        self.vehicles.iter().copied().map(VehicleId).collect()
    }

    /// Returns where vehicles were reached.
    pub(super) fn reached(&self) -> Vec<Endpoint> {
        let endpoint = |text: &String| Endpoint::parse(text).ok();
        self.reached.iter().filter_map(endpoint).collect()
    }

    /// Returns where the ground station was reached.
    pub(super) fn ground(&self) -> Option<Endpoint> {
        Endpoint::parse(self.ground.as_ref()?).ok()
    }

    /// Returns the node that is revoked.
    pub(super) fn revoked(&self) -> Option<Sender> {
        CommonName::node_of(self.revoked.as_ref()?)
    }
}
