//! The roster of a running node: its file is looked at again, and who may write what changes without a restart. A file that is
//! refused changes nothing: it is a trouble until a good one is there.

use std::path::Path;

use tomoswarm_proto::Sender;

use super::mailbox::Troubles;
use super::member::BusMember;
use super::membership;
use super::state_dir::StateDir;
use super::trust::{AccessRule, TrustError, read_limited_bytes};
use crate::config::{BusFile, Venue};

/// Looks whether the roster of a node has changed.
#[derive(Debug)]
pub struct RosterWatch<'a> {
    node: Sender,
    venue: &'a Venue,
    file: &'a BusFile,
    state_dir: &'a StateDir,
    /// The file as it was looked at last; `None` = it could not be read.
    last: Option<Vec<u8>>,
}

impl<'a> RosterWatch<'a> {
    /// Begins with the roster as it is now.
    pub fn begin(
        node: Sender,
        venue: &'a Venue,
        file: &'a BusFile,
        state_dir: &'a StateDir,
    ) -> RosterWatch<'a> {
        let mut watch = RosterWatch {
            node,
            venue,
            file,
            state_dir,
            last: None,
        };
        watch.last = watch.content();
        watch
    }

    /// Reads all files by which the node is known, and returns who may write what.
    ///
    /// # Errors
    /// As for [`membership::access`].
    pub fn access(&self) -> Result<Vec<AccessRule>, TrustError> {
        membership::access(self.node, self.venue, self.file, Some(self.state_dir))
    }

    /// Looks again; what is new counts from now on.
    pub fn look(&mut self, member: &BusMember, troubles: &Troubles) {
        let content = self.content();
        if content == self.last {
            return;
        }
        match self.access() {
            Ok(access) => {
                // What could not be taken over is tried again.
                self.last = content;
                troubles.clear("roster");
                member.allow(access);
            }
            Err(error) => troubles.raise("roster", error.to_string()),
        }
    }

    fn content(&self) -> Option<Vec<u8>> {
        let identity = self.file.identity.as_ref()?;
        read_limited_bytes(Path::new(&identity.roster)).ok()
    }
}
