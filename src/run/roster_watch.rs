//! The roster of a running node: its file is looked at again, and who may write what changes without a restart. A file that is
//! refused changes nothing: it is a trouble until a good one is there, be it the one that is in force.

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
        if let Some(access) = self.changed(troubles) {
            member.allow(access);
        }
    }

    /// Returns who may write what from now on, if the file is another good one than before.
    fn changed(&mut self, troubles: &Troubles) -> Option<Vec<AccessRule>> {
        let content = self.content();
        if content == self.last {
            troubles.clear("roster");
            return None;
        }
        match self.access() {
            Ok(access) => {
                // What could not be taken over is tried again.
                self.last = content;
                troubles.clear("roster");
                Some(access)
            }
            Err(error) => {
                troubles.raise("roster", error.to_string());
                None
            }
        }
    }

    fn content(&self) -> Option<Vec<u8>> {
        let identity = self.file.identity.as_ref()?;
        read_limited_bytes(Path::new(&identity.roster)).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::super::trust::{Authority, NewFile, Roster, write_new_folder};
    use super::*;
    use crate::config::{self, Identity};

    #[test]
    fn the_trouble_with_a_file_ends_when_the_one_in_force_is_back() {
        let folder = tempfile::tempdir().unwrap();
        let text = "kind = \"vehicle\"\nvenue = \"courtyard.venue.toml\"\nid = 1\nstate_dir = \"state\"\n\
                    vehicle.max_speed_mps = 0.2\nautopilot.driver = \"sim\"\nradio.driver = \"sim\"\n\
                    servo.driver = \"none\"\nrange.driver = \"none\"\nworld.connect = \"127.0.0.1:9\"\n\
                    world.token = \"secret-token\"\n";
        let mut load = |path: &str| config::bundled::load(path);
        let mut file = config::read_vehicle("configs/v.toml", text, &mut load).unwrap();
        let node = Sender::Vehicle(file.id);
        let authority = Authority::create().unwrap();
        let name = Roster::default().next_name(node, false).unwrap();
        let issued = authority.issue(name, &[]).unwrap();
        let roster = Roster::default().admitting(issued.entry).unwrap();
        let in_force = authority.sign(&roster).unwrap();
        let own = folder.path().join("vehicle-1");
        let files = [
            NewFile::open("ca", authority.certificate_pem()),
            NewFile::open("certificate", issued.certificate_pem),
            NewFile::private("key", issued.key_pem),
            NewFile::open("roster", in_force.as_str()),
        ];
        write_new_folder(&own, &files).unwrap();
        let path = |name: &str| own.join(name).display().to_string();
        file.bus.identity = Some(Identity {
            ca: path("ca"),
            certificate: path("certificate"),
            key: path("key"),
            roster: path("roster"),
        });
        let state_dir = StateDir::open(&folder.path().join("state")).unwrap();
        let mut watch = RosterWatch::begin(node, &file.venue, &file.bus, &state_dir);
        watch.access().unwrap();
        let troubles = Troubles::default();
        for (content, is_refused) in [
            ("no roster", true),
            (in_force.as_str(), false),
            ("", true),
            (in_force.as_str(), false),
        ] {
            std::fs::write(own.join("roster"), content).unwrap();
            assert_eq!(watch.changed(&troubles), None);
            let told = troubles.list();
            assert_eq!(!told.is_empty(), is_refused, "{content:?}: {told:?}");
        }
    }
}
