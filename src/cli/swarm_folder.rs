//! The folder of a swarm's authority: its key, the newest roster, and a folder for every enrolled node. Decides nothing about
//! who is enrolled; whatever changes on disk changes whole.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use tomoswarm_proto::{OperatorId, Sender, VehicleId};

use super::enroll_files::{
    CA, CA_KEY, CERTIFICATE, ROSTER, VENUE, endpoint_list, file_name, vehicle_list, with_end,
    with_list, with_other,
};
use super::enroll_pending::ListsBefore;
use super::error::CliError;
use super::read;
use crate::config::{self, BusFile, Config, Endpoint, Protocol, Topology, Venue};
use crate::run::trust::{
    Authority, AuthorityError, Certificate, CommonName, Lock, NewFile, Roster, StagedFolder,
    is_private, read_limited, replace_file, write_new_folder,
};

/// The authority's folder, open and locked.
pub(super) struct Swarm {
    /// The folder.
    pub(super) folder: PathBuf,
    /// Who signs.
    pub(super) authority: Authority,
    /// The newest issue.
    pub(super) roster: Roster,
    /// What the lists said before the call that made this issue, when it was interrupted.
    pub(super) interrupted: Option<ListsBefore>,
    _lock: Lock,
}

impl Swarm {
    /// Opens a folder and keeps others out of it. What a call before has not got to, since it was killed or the disk was full,
    /// is done: new folders of nodes are put where they belong once they are in force, and the newest roster is brought to all.
    ///
    /// # Errors
    /// Another process works on it; its files cannot be read or do not belong together; the disk refuses.
    pub(super) fn open(folder: &Path) -> Result<Swarm, CliError> {
        let text = |name: &str| {
            let path = folder.join(name);
            read_limited(&path).map_err(|source| CliError::Read { path, source })
        };
        let refused = |name: &str, reason: String| CliError::Input {
            path: folder.join(name),
            reason,
        };
        let lock = Lock::take(&folder.join(CA_KEY)).map_err(|source| CliError::Read {
            path: folder.join(CA_KEY),
            source,
        })?;
        let key = folder.join(CA_KEY);
        let is_private = is_private(&key).map_err(|source| CliError::Read { path: key, source })?;
        if !is_private {
            let reason = "everyone on this machine can read the private key; chmod 600 it";
            return Err(refused(CA_KEY, reason.to_owned()));
        }
        let authority = Authority::open(&text(CA)?, &text(CA_KEY)?)
            .map_err(|error| refused(CA_KEY, error.to_string()))?;
        let signed = text(ROSTER)?;
        let roster = Roster::verify(&signed, authority.certificate())
            .map_err(|error| refused(ROSTER, error.to_string()))?;
        let swarm = Swarm {
            folder: folder.to_owned(),
            authority,
            interrupted: ListsBefore::left(folder, roster.issue)?,
            roster,
            _lock: lock,
        };
        swarm.place_staged()?;
        // What cannot be brought to a folder now keeps nobody from signing: the next issue is brought there again.
        let _ = swarm.hand_out(&swarm.roster, &signed);
        Ok(swarm)
    }

    /// Makes the error of a file of the folder that is refused.
    pub(super) fn refused(&self, name: &str, error: impl std::error::Error) -> CliError {
        CliError::Input {
            path: self.folder.join(name),
            reason: error.to_string(),
        }
    }

    /// Returns the folder of a node.
    pub(super) fn node_folder(&self, node: Sender) -> PathBuf {
        self.folder.join(CommonName::node_name(node))
    }

    /// Checks that a venue is the swarm's.
    ///
    /// # Errors
    /// It is another.
    pub(super) fn check_venue(&self, venue: &Venue) -> Result<(), CliError> {
        let path = self.folder.join(VENUE);
        let own = read_venue(&path, &read::text(&path)?)?;
        check_same_venue(&path, &own, venue)
    }

    /// Returns the hosts under which an enrolled node is reached, as its certificate names them; `None` = that is not here.
    pub(super) fn hosts_of(&self, node: Sender) -> Option<Vec<String>> {
        Some(certificate_in(&self.node_folder(node))?.hosts)
    }

    /// Checks that an enrolled node is reached under these hosts, beside its own machine's, where its certificate is here.
    ///
    /// # Errors
    /// It is reached under others.
    pub(super) fn check_hosts(&self, node: Sender, hosts: &[String]) -> Result<(), CliError> {
        let far = |hosts: &[String]| -> BTreeSet<String> {
            hosts.iter().filter(|host| is_far(host)).cloned().collect()
        };
        let Some(enrolled) = self.hosts_of(node) else {
            return Ok(());
        };
        let (enrolled, given) = (far(&enrolled), far(hosts));
        if enrolled == given {
            return Ok(());
        }
        let (name, list) = (
            CommonName::node_name(node),
            Vec::from_iter(enrolled).join(", "),
        );
        let form = name.replace('-', " ");
        Err(CliError::Usage(format!(
            "{name} is enrolled already, with the hosts [{list}]; for a new certificate: enroll … {form} --host HOST --replace"
        )))
    }

    /// Signs a roster, and puts it in force together with the files of those that are new in it: here, and in the folders of
    /// all that it allows. Whenever this is interrupted, it was not begun, or the next opening of the folder ends it. Returns
    /// which former folders are kept, and where.
    pub(super) fn publish(
        &self,
        (before, next): (&ListsBefore, &Roster),
        new: &[(Sender, Vec<NewFile>)],
    ) -> Result<Vec<(Sender, PathBuf)>, CliError> {
        let signed = self.authority.sign(next);
        let text = signed.map_err(|error| self.refused(CA_KEY, error))?;
        let mut staged = Vec::new();
        for (node, files) in new {
            let folder = self.node_folder(*node);
            let files = [&files[..], &[NewFile::open(ROSTER, text.clone())]].concat();
            let written = StagedFolder::write(&folder, &files);
            staged.push((*node, written.map_err(unwritable(&folder))?));
        }
        before.keep(&self.folder)?;
        // From here on the certificates are in force: no number is given twice.
        replace_roster(&self.folder, &text)?;
        let mut kept = Vec::new();
        for (node, folder) in staged {
            kept.extend(self.place(node, folder)?.map(|former| (node, former)));
        }
        self.hand_out(next, &text)?;
        Ok(kept)
    }

    /// Puts a new folder of a node where it belongs; returns where the former one is kept.
    fn place(&self, node: Sender, new: StagedFolder) -> Result<Option<PathBuf>, CliError> {
        let former = self.retire(node, "replaced")?;
        let placed = new.place();
        placed.map_err(unwritable(&self.node_folder(node)))?;
        Ok(former)
    }

    /// Puts folders that an interrupted call has written where they belong, and removes those that were never in force.
    fn place_staged(&self) -> Result<(), CliError> {
        let vehicles = (1..=u8::MAX).map(|id| Sender::Vehicle(VehicleId(id)));
        let operators = (1..=u8::MAX).map(|id| Sender::Operator(OperatorId(id)));
        for node in vehicles.chain(operators).chain([Sender::Ground]) {
            let Some(staged) = StagedFolder::find(&self.node_folder(node)) else {
                continue;
            };
            let fingerprint = certificate_in(staged.path()).map(|found| found.fingerprint);
            let in_force = self.roster.of(node).map(|entry| entry.fingerprint);
            if in_force.is_some() && in_force == fingerprint {
                self.place(node, staged)?;
            } else {
                let path = staged.path().to_owned();
                staged.remove().map_err(unwritable(&path))?;
            }
        }
        Ok(())
    }

    /// Brings a signed roster to the folders of all that it allows and that hold another text.
    fn hand_out(&self, roster: &Roster, text: &str) -> Result<(), CliError> {
        let nodes = roster.allowed.iter().map(|entry| entry.name.node);
        let folders = nodes.map(|node| self.node_folder(node));
        let has_other = |folder: &PathBuf| {
            let held = read_limited(&folder.join(ROSTER));
            folder.is_dir() && held.ok().as_deref() != Some(text)
        };
        // All are tried, whichever fails.
        let handed: Vec<Result<(), CliError>> = folders
            .filter(has_other)
            .map(|folder| replace_roster(&folder, text))
            .collect();
        handed.into_iter().collect()
    }

    /// Moves the folder of a node's former certificate aside; nothing is ever deleted.
    pub(super) fn retire(&self, node: Sender, why: &str) -> Result<Option<PathBuf>, CliError> {
        let folder = self.node_folder(node);
        if !folder.exists() {
            return Ok(None);
        }
        let name = certificate_in(&folder).map(|found| found.common_name);
        let name = name.filter(|name| name.parse::<CommonName>().is_ok());
        let name = name.unwrap_or_else(|| format!("{}.unknown", CommonName::node_name(node)));
        let aside = self.folder.join(format!("{name}.{why}"));
        std::fs::rename(&folder, &aside).map_err(|source| CliError::Write {
            path: aside.clone(),
            source,
        })?;
        Ok(Some(aside))
    }

    /// Returns the file that a node gets anew, and the one that it had when it was last revoked; `None` = it has one, or had none.
    pub(super) fn file_before_revoked(&self, new: CommonName) -> Option<(PathBuf, PathBuf)> {
        let file = self.node_folder(new.node).join(file_name(new.node));
        let before = |issue| {
            let name = CommonName { issue, ..new };
            self.folder
                .join(format!("{name}.revoked"))
                .join(file_name(new.node))
        };
        let before = (1..new.issue)
            .rev()
            .map(before)
            .find(|before| before.exists());
        before
            .filter(|_| !file.exists())
            .map(|before| (file, before))
    }

    /// Lists the enrolled vehicles in the ground station's configuration, where that list still is as it was written;
    /// returns whether it lists them all.
    pub(super) fn list_in_ground(
        &self,
        before: &[VehicleId],
        next: &Roster,
    ) -> Result<bool, CliError> {
        let (before, after) = (vehicle_list(before), vehicle_list(&vehicles_of(next)));
        if before == after {
            return Ok(true);
        }
        let is_known = |list: &str| list == before || list == after;
        self.edit_config(Sender::Ground, |text| {
            with_list(text, "vehicles", |list| {
                is_known(list).then_some(after.clone())
            })
        })
    }

    /// Names the vehicles that are reached in the configurations of the operators of a mesh, where that list ends as it was
    /// written; returns those operators where it does not.
    pub(super) fn name_in_operators(
        &self,
        before: &[Endpoint],
        next: &Roster,
    ) -> Result<Vec<OperatorId>, CliError> {
        let mut edited_by_hand = Vec::new();
        let (before, after) = (endpoint_list(before), endpoint_list(&self.reached(next)));
        for operator in operators_of(next) {
            let says_it = self.edit_config(Sender::Operator(operator), |text| {
                let is_mesh = text.contains("topology = \"mesh\"");
                if !is_mesh || before == after {
                    return Some(text.to_owned());
                }
                with_list(text, "connect", |list| with_end(list, &before, &after))
            })?;
            if !says_it {
                edited_by_hand.push(operator);
            }
        }
        Ok(edited_by_hand)
    }

    /// Names the ground station where it is reached now in the configurations of all others that named it where it was; returns
    /// who they are, and those whose list names it in neither place.
    pub(super) fn name_moved_ground(
        &self,
        (before, after): (&Endpoint, &Endpoint),
        next: &Roster,
    ) -> Result<(Vec<Sender>, Vec<Sender>), CliError> {
        let [before, after] = [before, after].map(|endpoint| endpoint_list([endpoint]));
        let (mut named, mut edited_by_hand) = (Vec::new(), Vec::new());
        for node in next.allowed.iter().map(|entry| entry.name.node) {
            if node == Sender::Ground || self.bus_of(node).is_none() {
                continue;
            }
            let says_it = self.edit_config(node, |text| {
                with_list(text, "connect", |list| with_other(list, &before, &after))
            })?;
            match says_it {
                true => named.push(node),
                false => edited_by_hand.push(node),
            }
        }
        Ok((named, edited_by_hand))
    }

    /// Edits the configuration of a node, if there is one; returns whether it says then what it is to say. `edited` gives
    /// `None` where people have written something else.
    fn edit_config(
        &self,
        node: Sender,
        edited: impl FnOnce(&str) -> Option<String>,
    ) -> Result<bool, CliError> {
        let folder = self.node_folder(node);
        let path = folder.join(file_name(node));
        if !path.exists() {
            return Ok(true);
        }
        let text = read::text(&path)?;
        let Some(edited) = edited(&text) else {
            return Ok(false);
        };
        if edited != text {
            let file = NewFile::open(file_name(node), edited);
            replace_file(&folder, &file).map_err(|source| CliError::Write { path, source })?;
        }
        Ok(true)
    }

    /// Returns how a node joins the bus, as its configuration in this folder says it.
    fn bus_of(&self, node: Sender) -> Option<BusFile> {
        let folder = self.node_folder(node);
        let path = folder.join(file_name(node));
        let venue = read::text(&folder.join(VENUE)).ok()?;
        let text = read::text(&path).ok()?;
        match config::read(&read::shown(&path), &text, &mut |_| Ok(venue.clone())).ok()? {
            Config::Vehicle(file) => Some(file.bus),
            Config::Ground(file) => Some(file.bus),
            Config::Operator(file) => Some(file.bus),
            Config::Venue(_) | Config::Scene(_) | Config::Sim(_) | Config::Experiment(_) => None,
        }
    }

    /// Returns how those of a roster join: the swarm's shape, and where the ground station is reached. `None` =
    /// nobody is, or no file says it.
    pub(super) fn joined(&self, roster: &Roster) -> Option<(Topology, Endpoint)> {
        let nodes = roster.allowed.iter().map(|entry| entry.name.node);
        let of = |node: Sender| {
            let bus = self.bus_of(node)?;
            let ground = match node {
                Sender::Ground => {
                    let hosts = self.hosts_of(node).unwrap_or_default();
                    let host = hosts.into_iter().find(|host| is_far(host));
                    let own = bus.listen.first()?;
                    Endpoint {
                        host: host.unwrap_or_else(|| "127.0.0.1".to_owned()),
                        ..own.clone()
                    }
                }
                Sender::Vehicle(_) | Sender::Operator(_) => bus.connect.first()?.clone(),
            };
            Some((bus.topology, ground))
        };
        // The ground station itself first: it stands there first.
        let mut nodes: Vec<Sender> = nodes.collect();
        nodes.sort_by_key(|node| *node != Sender::Ground);
        nodes.into_iter().find_map(of)
    }

    /// Returns where the vehicles of a roster are reached by others: those with a host of their own and a fixed port.
    pub(super) fn reached(&self, roster: &Roster) -> Vec<Endpoint> {
        let vehicles = vehicles_of(roster).into_iter();
        vehicles.filter_map(|id| self.reached_vehicle(id)).collect()
    }

    /// Returns where the ground station, as it is given, and the vehicles of a roster are reached by others.
    pub(super) fn reached_nodes(
        &self,
        roster: &Roster,
        ground: Option<&Endpoint>,
    ) -> Vec<(Sender, Endpoint)> {
        let ground = ground.map(|ground| (Sender::Ground, ground.clone()));
        let ground =
            ground.filter(|(node, ground)| roster.of(*node).is_some() && is_far(&ground.host));
        let vehicles = vehicles_of(roster).into_iter();
        let vehicles =
            vehicles.filter_map(|id| Some((Sender::Vehicle(id), self.reached_vehicle(id)?)));
        ground.into_iter().chain(vehicles).collect()
    }

    fn reached_vehicle(&self, id: VehicleId) -> Option<Endpoint> {
        let hosts = self.hosts_of(Sender::Vehicle(id))?;
        let host = hosts.into_iter().find(|host| is_far(host))?;
        let bus = self.bus_of(Sender::Vehicle(id))?;
        let port = bus.listen.first().map(|listen| listen.port);
        Some(Endpoint {
            protocol: Protocol::Tls,
            host,
            port: port.filter(|port| *port != 0)?,
        })
    }
}

/// Returns the certificate in a node's folder.
fn certificate_in(folder: &Path) -> Option<Certificate> {
    let text = read::text(&folder.join(CERTIFICATE)).ok()?;
    Certificate::from_pem(&text).ok()
}

/// Makes the error of a folder that the disk refuses.
pub(super) fn unwritable(folder: &Path) -> impl Fn(std::io::Error) -> CliError {
    let path = folder.to_owned();
    move |source| CliError::Write {
        path: path.clone(),
        source,
    }
}

fn replace_roster(folder: &Path, text: &str) -> Result<(), CliError> {
    replace_file(folder, &NewFile::open(ROSTER, text)).map_err(|source| CliError::Write {
        path: folder.join(ROSTER),
        source,
    })
}

/// Returns whether other machines may reach a node under this host.
pub(super) fn is_far(host: &str) -> bool {
    !matches!(host, "127.0.0.1" | "::1" | "localhost")
}

/// Makes a folder with a new authority that has enrolled nobody yet.
///
/// # Errors
/// The folder is there and not empty; no key can be made; the disk refuses.
pub(super) fn create_authority(folder: &Path, venue: &str) -> Result<(), CliError> {
    let is_taken = std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if is_taken || folder.is_file() {
        let reason = format!(
            "is no folder of a swarm (it has no {CA}) and not empty; a new folder is expected"
        );
        return Err(CliError::Input {
            path: folder.to_owned(),
            reason,
        });
    }
    let fault = |error: AuthorityError| CliError::Fault(error.to_string());
    let authority = Authority::create().map_err(fault)?;
    let roster = authority
        .sign(&Roster {
            issue: 1,
            ..Roster::default()
        })
        .map_err(fault)?;
    let files = [
        NewFile::open(CA, authority.certificate_pem()),
        NewFile::private(CA_KEY, authority.key_pem()),
        NewFile::open(ROSTER, roster),
        NewFile::open(VENUE, venue),
    ];
    write_new_folder(folder, &files).map_err(|source| CliError::Write {
        path: folder.to_owned(),
        source,
    })
}

/// Checks that a venue is the one that stands in a file.
///
/// # Errors
/// It is another.
pub(super) fn check_same_venue(path: &Path, own: &Venue, given: &Venue) -> Result<(), CliError> {
    if own.hash() == given.hash() && own.name == given.name {
        return Ok(());
    }
    let reason = format!(
        "is venue {} (hash {:016x}), but {} (hash {:016x}) is given; all nodes of a swarm share one venue",
        own.name,
        own.hash(),
        given.name,
        given.hash()
    );
    Err(CliError::Input {
        path: path.to_owned(),
        reason,
    })
}

/// Reads a venue.
///
/// # Errors
/// The text is none.
pub(super) fn read_venue(path: &Path, text: &str) -> Result<Venue, CliError> {
    match config::read(&read::shown(path), text, &mut |_| {
        Err("a venue names no files".to_owned())
    })? {
        Config::Venue(venue) => Ok(venue),
        Config::Scene(_)
        | Config::Sim(_)
        | Config::Experiment(_)
        | Config::Vehicle(_)
        | Config::Ground(_)
        | Config::Operator(_) => {
            let reason = "is no venue; a file of kind = \"venue\" is expected".to_owned();
            Err(CliError::Input {
                path: path.to_owned(),
                reason,
            })
        }
    }
}

/// Returns the vehicles that a roster allows, ascending.
pub(super) fn vehicles_of(roster: &Roster) -> Vec<VehicleId> {
    nodes_of(roster, |node| match node {
        Sender::Vehicle(id) => Some(id),
        Sender::Ground | Sender::Operator(_) => None,
    })
}

/// Returns the operators that a roster allows, ascending.
fn operators_of(roster: &Roster) -> Vec<OperatorId> {
    nodes_of(roster, |node| match node {
        Sender::Operator(id) => Some(id),
        Sender::Ground | Sender::Vehicle(_) => None,
    })
}

fn nodes_of<Id: Ord>(roster: &Roster, id_of: impl Fn(Sender) -> Option<Id>) -> Vec<Id> {
    let ids = roster
        .allowed
        .iter()
        .filter_map(|entry| id_of(entry.name.node));
    ids.collect::<BTreeSet<Id>>().into_iter().collect()
}
