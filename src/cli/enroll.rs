//! `tomoswarm enroll FOLDER --venue FILE NODE`: gives a node its certificate, the roster and a ready configuration. Only
//! writes into FOLDER; nothing is copied to other machines, and nothing is left half written.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};

use tomoswarm_proto::{Sender, VehicleId};

use super::enroll_files::{
    NodeConfig, endpoint_list, file_name, vehicle_list, with_end, with_list,
};
use super::error::CliError;
use super::read;
use crate::config::{self, Config, Endpoint, Protocol, Topology, Venue};
use crate::run::membership::OPERATOR;
use crate::run::trust::{
    Authority, Certificate, CommonName, IssuedCertificate, Lock, NewFile, Roster, is_host,
    read_limited, replace_file, write_new_folder,
};

const CA: &str = "ca.pem";
const CA_KEY: &str = "ca-key.pem";
const ROSTER: &str = "roster.txt";
const VENUE: &str = "venue.toml";

/// Give a node of the swarm its certificate and a ready configuration; replace or revoke one.
///
/// The first call makes the authority of the swarm in FOLDER: its private key signs for all nodes and never leaves this
/// machine. Every node then gets a folder of its own with certificate, key, roster, venue and configuration.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct EnrollArgs {
    /// Folder of the swarm's authority; made when it is not there
    #[arg(value_name = "FOLDER")]
    pub folder: PathBuf,
    /// Which node
    #[arg(
        value_name = "NODE",
        value_enum,
        required_unless_present = "revoke",
        conflicts_with = "revoke"
    )]
    pub node: Option<EnrolledNode>,
    /// Number of the vehicle, 1 to 250
    #[arg(value_name = "N", value_parser = clap::value_parser!(u8).range(1..=250))]
    pub number: Option<u8>,
    /// The venue file, the same for all nodes
    #[arg(long, value_name = "FILE", required_unless_present = "revoke")]
    pub venue: Option<PathBuf>,
    /// A name or address under which others reach this node; may be given several times
    #[arg(long = "host", value_name = "H")]
    pub hosts: Vec<String>,
    /// Name or address under which the node reaches the ground station
    #[arg(long, value_name = "H", default_value = "127.0.0.1")]
    pub ground_host: String,
    /// Port of the ground station, and of the vehicles of a mesh
    #[arg(long, value_name = "PORT", default_value_t = 7447, value_parser = clap::value_parser!(u16).range(1..))]
    pub port: u16,
    /// How the swarm is joined; the same for all nodes
    #[arg(long, value_enum, default_value = "mesh")]
    pub topology: EnrolledTopology,
    /// Folder on the node for what outlives it [default: /var/lib/tomoswarm/NODE]
    #[arg(long, value_name = "DIR")]
    pub state_dir: Option<String>,
    /// Give an enrolled node a new certificate; the old one ends
    #[arg(long)]
    pub replace: bool,
    /// Take a node out of the roster: ground, vehicle-N or operator-N
    #[arg(long, value_name = "NAME", conflicts_with_all = ["replace", "hosts"])]
    pub revoke: Option<String>,
}

const AFTER_HELP: &str = "\
Without --host and --ground-host the nodes are reached on their own machine only.

Examples:
  tomoswarm enroll swarm --venue yard.venue.toml ground --host ground.local
  tomoswarm enroll swarm --venue yard.venue.toml vehicle 1 --host rover1.local --ground-host ground.local
  tomoswarm enroll swarm --venue yard.venue.toml vehicle 1 --host rover1.local --ground-host ground.local --replace
  tomoswarm enroll swarm --revoke vehicle-1

Exit codes: 0 done; 2 bad usage or files, or the node is enrolled already.";

/// Which node is enrolled.
#[derive(clap::ValueEnum, Clone, Copy, PartialEq, Eq, Debug)]
pub enum EnrolledNode {
    /// The ground station.
    Ground,
    /// A vehicle; its number follows.
    Vehicle,
    /// The operator's commands.
    Operator,
}

/// How the swarm is joined.
#[derive(clap::ValueEnum, Clone, Copy, PartialEq, Eq, Debug)]
pub enum EnrolledTopology {
    /// Everyone with everyone.
    Mesh,
    /// Everyone with the ground station.
    Star,
}

impl EnrollArgs {
    /// Enrols, replaces or revokes, and says what to copy where.
    ///
    /// # Errors
    /// Bad usage or files; the node is enrolled already, or not at all; the disk refuses.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let output = match &self.revoke {
            Some(name) => self.revoke(name)?,
            None => self.enroll()?,
        };
        out.write_all(output.as_bytes())
            .map_err(|source| CliError::Write {
                path: "standard output".into(),
                source,
            })
    }

    fn enroll(&self) -> Result<String, CliError> {
        let node = self.wanted()?;
        self.check_hosts()?;
        let (venue, venue_text) = self.venue()?;
        check_home(node, &venue)?;
        if !self.folder.join(CA).exists() {
            create_authority(&self.folder, &venue_text)?;
        }
        let swarm = Swarm::open(&self.folder)?;
        swarm.check_venue(&venue)?;
        let name = swarm
            .roster
            .next_name(node, self.replace)
            .map_err(|error| swarm.refused(ROSTER, error))?;
        let issued = swarm
            .authority
            .issue(name, &self.hosts)
            .map_err(|error| swarm.refused(CA, error))?;
        let next = swarm
            .roster
            .admitting(issued.entry.clone())
            .map_err(|error| swarm.refused(ROSTER, error))?;
        let files = self.files(&swarm, &next, &issued, &venue_text)?;
        let reached_before = swarm.reached(&swarm.roster);
        // From here on the certificate is in force: the roster goes first, so that no number is given twice.
        let text = swarm.publish(&next)?;
        let former = swarm.retire(node, "replaced")?;
        let own = swarm.node_folder(node);
        let files: Vec<NewFile> = files
            .into_iter()
            .chain([NewFile::open(ROSTER, text)])
            .collect();
        write_new_folder(&own, &files).map_err(|source| CliError::Write {
            path: own.clone(),
            source,
        })?;
        let listed = swarm.list_in_ground(&next)?;
        swarm.name_in_operator(&reached_before, &swarm.reached(&next))?;
        Ok(enrolled(name, &own, former.as_deref(), listed, &next))
    }

    fn revoke(&self, name: &str) -> Result<String, CliError> {
        let node = CommonName::node_of(name).ok_or_else(|| {
            CliError::Usage(format!(
                "--revoke {name}: is no node; ground, operator-N or vehicle-N is expected"
            ))
        })?;
        let swarm = Swarm::open(&self.folder)?;
        let next = swarm
            .roster
            .revoking(node)
            .map_err(|error| swarm.refused(ROSTER, error))?;
        swarm.publish(&next)?;
        let former = swarm.retire(node, "revoked")?;
        let kept = former.map_or(String::new(), |folder| {
            format!("its files are kept in {}\n", folder.display())
        });
        Ok(format!(
            "{name} is revoked, roster issue {}\n{kept}{}",
            next.issue,
            roster_advice(&self.folder)
        ))
    }

    fn wanted(&self) -> Result<Sender, CliError> {
        match (self.node, self.number) {
            (Some(EnrolledNode::Ground), None) => Ok(Sender::Ground),
            (Some(EnrolledNode::Operator), None) => Ok(OPERATOR),
            (Some(EnrolledNode::Vehicle), Some(number)) => Ok(Sender::Vehicle(VehicleId(number))),
            (Some(EnrolledNode::Vehicle), None) => Err(CliError::Usage(
                "vehicle: its number is missing; vehicle N is expected, 1 to 250".to_owned(),
            )),
            (Some(EnrolledNode::Ground | EnrolledNode::Operator), Some(number)) => Err(
                CliError::Usage(format!("{number}: only vehicles have numbers")),
            ),
            (None, _) => Err(CliError::Usage(
                "ground, vehicle N or operator is expected".to_owned(),
            )),
        }
    }

    fn check_hosts(&self) -> Result<(), CliError> {
        let options = self.hosts.iter().map(|host| ("--host", host));
        for (option, host) in options.chain([("--ground-host", &self.ground_host)]) {
            if !is_host(host) {
                let expected = "an IP address or a host name is expected";
                return Err(CliError::Usage(format!(
                    "{option} {host:?}: is no host; {expected}"
                )));
            }
        }
        Ok(())
    }

    fn venue(&self) -> Result<(Venue, String), CliError> {
        let path = self
            .venue
            .as_deref()
            .ok_or_else(|| CliError::Usage("--venue FILE is needed".to_owned()))?;
        let text = read::text(path)?;
        Ok((read_venue(path, &text)?, text))
    }

    fn files(
        &self,
        swarm: &Swarm,
        next: &Roster,
        issued: &IssuedCertificate,
        venue: &str,
    ) -> Result<Vec<NewFile>, CliError> {
        let node = issued.entry.name.node;
        let own_file = swarm.node_folder(node).join(file_name(node));
        // What was edited by hand stays.
        let config = match own_file.exists() {
            true => read::text(&own_file)?,
            false => self.config_of(swarm, node, next).text(venue)?,
        };
        check_config(&own_file, &config, venue)?;
        Ok(vec![
            NewFile::open(CA, swarm.authority.certificate_pem()),
            NewFile::open("certificate.pem", issued.certificate_pem.clone()),
            NewFile::private("key.pem", issued.key_pem.clone()),
            NewFile::open(VENUE, venue),
            NewFile::open(file_name(node), config),
        ])
    }

    fn config_of(&self, swarm: &Swarm, node: Sender, roster: &Roster) -> NodeConfig {
        let state_dir = format!("/var/lib/tomoswarm/{}", CommonName::node_name(node));
        NodeConfig {
            node,
            topology: match self.topology {
                EnrolledTopology::Mesh => Topology::Mesh,
                EnrolledTopology::Star => Topology::Star,
            },
            ground_host: self.ground_host.clone(),
            port: self.port,
            is_reached: self.hosts.iter().any(|host| is_far(host)) || is_far(&self.ground_host),
            state_dir: self.state_dir.clone().unwrap_or(state_dir),
            vehicles: vehicles_of(roster),
            reached: swarm.reached(roster),
        }
    }
}

/// The authority's folder, open and locked.
struct Swarm {
    folder: PathBuf,
    authority: Authority,
    roster: Roster,
    _lock: Lock,
}

impl Swarm {
    fn open(folder: &Path) -> Result<Swarm, CliError> {
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
        let authority = Authority::open(&text(CA)?, &text(CA_KEY)?)
            .map_err(|error| refused(CA_KEY, error.to_string()))?;
        let roster = Roster::verify(&text(ROSTER)?, authority.certificate())
            .map_err(|error| refused(ROSTER, error.to_string()))?;
        Ok(Swarm {
            folder: folder.to_owned(),
            authority,
            roster,
            _lock: lock,
        })
    }

    fn refused(&self, name: &str, error: impl std::error::Error) -> CliError {
        CliError::Input {
            path: self.folder.join(name),
            reason: error.to_string(),
        }
    }

    fn node_folder(&self, node: Sender) -> PathBuf {
        self.folder.join(CommonName::node_name(node))
    }

    fn check_venue(&self, venue: &Venue) -> Result<(), CliError> {
        let path = self.folder.join(VENUE);
        let own = read_venue(&path, &read::text(&path)?)?;
        if own.hash() == venue.hash() && own.name == venue.name {
            return Ok(());
        }
        let reason = format!(
            "is venue {} (hash {:016x}), but {} (hash {:016x}) is given; all nodes of a swarm share one venue",
            own.name,
            own.hash(),
            venue.name,
            venue.hash()
        );
        Err(CliError::Input { path, reason })
    }

    /// Signs a roster and puts it in force: here, and in the folders of all that it allows.
    fn publish(&self, next: &Roster) -> Result<String, CliError> {
        let text = self
            .authority
            .sign(next)
            .map_err(|error| self.refused(CA_KEY, error))?;
        let file = NewFile::open(ROSTER, text.clone());
        let folders = next
            .allowed
            .iter()
            .map(|entry| self.node_folder(entry.name.node));
        for folder in [self.folder.clone()]
            .into_iter()
            .chain(folders)
            .filter(|folder| folder.is_dir())
        {
            replace_file(&folder, &file).map_err(|source| CliError::Write {
                path: folder.join(ROSTER),
                source,
            })?;
        }
        Ok(text)
    }

    /// Moves the folder of a node's former certificate aside; nothing is ever deleted.
    fn retire(&self, node: Sender, why: &str) -> Result<Option<PathBuf>, CliError> {
        let folder = self.node_folder(node);
        if !folder.exists() {
            return Ok(None);
        }
        let pem = read::text(&folder.join("certificate.pem")).ok();
        let name = pem
            .and_then(|pem| Certificate::from_pem(&pem).ok())
            .map(|found| found.common_name);
        let name = name.filter(|name| name.parse::<CommonName>().is_ok());
        let name = name.unwrap_or_else(|| format!("{}.unknown", CommonName::node_name(node)));
        let aside = self.folder.join(format!("{name}.{why}"));
        std::fs::rename(&folder, &aside).map_err(|source| CliError::Write {
            path: aside.clone(),
            source,
        })?;
        Ok(Some(aside))
    }

    /// Lists the enrolled vehicles in the ground station's configuration, where that list still is as it was written;
    /// returns whether it lists them all.
    fn list_in_ground(&self, next: &Roster) -> Result<bool, CliError> {
        let (before, after) = (
            vehicle_list(&vehicles_of(&self.roster)),
            vehicle_list(&vehicles_of(next)),
        );
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

    /// Names the vehicles that are reached in the configuration of the operator of a mesh, where that list ends as it was
    /// written.
    fn name_in_operator(&self, before: &[Endpoint], after: &[Endpoint]) -> Result<(), CliError> {
        let (before, after) = (endpoint_list(before), endpoint_list(after));
        self.edit_config(OPERATOR, |text| {
            let mesh = Some(text).filter(|text| text.contains("topology = \"mesh\""))?;
            with_list(mesh, "connect", |list| with_end(list, &before, &after))
        })?;
        Ok(())
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

    /// Returns where the vehicles of a roster are reached by others: those with a host of their own and a fixed port.
    fn reached(&self, roster: &Roster) -> Vec<Endpoint> {
        let endpoint = |id: VehicleId| {
            let folder = self.node_folder(Sender::Vehicle(id));
            let certificate =
                Certificate::from_pem(&read::text(&folder.join("certificate.pem")).ok()?).ok()?;
            let host = certificate.hosts.into_iter().find(|host| is_far(host))?;
            let path = folder.join(file_name(Sender::Vehicle(id)));
            let venue = read::text(&folder.join(VENUE)).ok()?;
            let text = read::text(&path).ok()?;
            let file = config::read(&read::shown(&path), &text, &mut |_| Ok(venue.clone()));
            let Ok(Config::Vehicle(file)) = file else {
                return None;
            };
            let port = file
                .bus
                .listen
                .first()
                .map(|listen| listen.port)
                .filter(|port| *port != 0)?;
            Some(Endpoint {
                protocol: Protocol::Tls,
                host,
                port,
            })
        };
        vehicles_of(roster)
            .into_iter()
            .filter_map(endpoint)
            .collect()
    }
}

/// Returns whether other machines may reach a node under this host.
fn is_far(host: &str) -> bool {
    !matches!(host, "127.0.0.1" | "::1" | "localhost")
}

fn create_authority(folder: &Path, venue: &str) -> Result<(), CliError> {
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
    let fault = |error: crate::run::trust::AuthorityError| CliError::Fault(error.to_string());
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

fn read_venue(path: &Path, text: &str) -> Result<Venue, CliError> {
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

/// Refuses a configuration that `tomoswarm check` would refuse.
fn check_config(path: &Path, text: &str, venue: &str) -> Result<(), CliError> {
    config::read(&read::shown(path), text, &mut |_| Ok(venue.to_owned()))?;
    Ok(())
}

fn check_home(node: Sender, venue: &Venue) -> Result<(), CliError> {
    let homes = venue.homes.len();
    match node {
        Sender::Vehicle(id) if usize::from(id.0) > homes => Err(CliError::Usage(format!(
            "vehicle {id}: has no home, the venue has {homes} of them"
        ))),
        Sender::Vehicle(_) | Sender::Ground | Sender::Operator(_) => Ok(()),
    }
}

fn vehicles_of(roster: &Roster) -> Vec<VehicleId> {
    let vehicle = |node: Sender| match node {
        Sender::Vehicle(id) => Some(id),
        Sender::Ground | Sender::Operator(_) => None,
    };
    let ids: BTreeSet<VehicleId> = roster
        .allowed
        .iter()
        .filter_map(|entry| vehicle(entry.name.node))
        .collect();
    ids.into_iter().collect()
}

fn enrolled(
    name: CommonName,
    own: &Path,
    former: Option<&Path>,
    is_listed: bool,
    next: &Roster,
) -> String {
    let mut text = format!("{name} is enrolled, roster issue {}\n", next.issue);
    if let Some(former) = former {
        text += &format!(
            "the former files are kept in {} and are worth nothing now\n",
            former.display()
        );
    }
    text += &format!(
        "1. copy {} to the node as /etc/tomoswarm (its key.pem for the service's user only, mode 0600)\n",
        own.display()
    );
    text += &format!(
        "2. on the node: tomoswarm check /etc/tomoswarm/{}\n",
        file_name(name.node)
    );
    text += &roster_advice(own.parent().unwrap_or(Path::new(".")));
    if !is_listed {
        text += "the ground station's file was edited: add the vehicle to its list `vehicles` by hand\n";
    }
    text
}

fn roster_advice(folder: &Path) -> String {
    format!(
        "copy {} to every other node and restart it: a roster counts from a node's next start\n\
         keep {} on this machine, with a backup: who has it can enrol anyone\n",
        folder.join(ROSTER).display(),
        folder.join(CA_KEY).display()
    )
}
