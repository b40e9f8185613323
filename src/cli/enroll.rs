//! `tomoswarm enroll FOLDER --venue FILE NODE`: gives a node its certificate, the roster and a ready configuration. Only
//! writes into FOLDER; nothing is copied to other machines, and nothing is left half written.

use std::io::Write;
use std::path::PathBuf;

use tomoswarm_proto::{OperatorId, Sender, VehicleId};

use super::enroll_advice::{
    interrupted_said, lists_said, moved_ground, planned_for, roster_advice, where_to_take_over,
    without_folders,
};
use super::enroll_checks::{
    GivenOptions, check_apart, check_config, check_home, check_kept, check_reach,
};
use super::enroll_files::{CA, CERTIFICATE, KEY, NodeConfig, ROSTER, VENUE, file_name};
use super::enroll_pending::ListsBefore;
use super::error::CliError;
use super::read;
use super::swarm_folder::{Swarm, create_authority, is_far, read_venue, vehicles_of};
use crate::config::{Endpoint, Protocol, Topology, Venue};
use crate::run::membership::FIRST_OPERATOR;
use crate::run::trust::{CommonName, IssuedCertificate, NewFile, Roster, is_host};

/// Give nodes of the swarm their certificates and ready configurations; replace or revoke one.
///
/// The first call makes the authority of the swarm in FOLDER: its private key signs for all nodes and never leaves this
/// machine. Every node then gets a folder of its own with certificate, key, roster, venue and configuration, which `tomoswarm
/// accept` takes over on its machine.
///
/// All nodes in one call: --ground, --vehicle and --operator. Those enrolled already stay as they are. Each machine from
/// which orders are given is an operator with a number of its own (--operator, --operator=2=laptop.local).
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct EnrollArgs {
    /// Folder of the swarm's authority; made when it is not there
    #[arg(value_name = "FOLDER")]
    pub folder: PathBuf,
    /// Which node, when it is one
    #[arg(
        value_name = "NODE",
        value_enum,
        required_unless_present_any = ["revoke", "ground", "vehicles", "operators"],
        conflicts_with_all = ["revoke", "ground", "vehicles", "operators"]
    )]
    pub node: Option<EnrolledNode>,
    /// Number of the vehicle, 1 to 250, or of the operator [default: 1]
    #[arg(value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    pub number: Option<u8>,
    /// The ground station, and the hosts under which others reach it
    #[arg(long, value_name = "H[,H]", value_parser = hosts_in, conflicts_with_all = ["ground_host", "revoke"])]
    pub ground: Option<Hosts>,
    /// A vehicle with its hosts; may be given several times
    #[arg(long = "vehicle", value_name = "N=H[,H]", value_parser = vehicle_in, conflicts_with = "revoke")]
    pub vehicles: Vec<(VehicleId, Hosts)>,
    /// An operator's commands, of the first unless a number is given, and its host; may be given several times
    #[arg(
        long = "operator",
        value_name = "N=H[,H]",
        value_parser = operator_in,
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "1",
        conflicts_with = "revoke"
    )]
    pub operators: Vec<(OperatorId, Option<Hosts>)>,
    /// The venue file, the same for all nodes
    #[arg(long, value_name = "FILE", required_unless_present = "revoke")]
    pub venue: Option<PathBuf>,
    /// A name or address under which others reach NODE; may be given several times
    #[arg(long = "host", value_name = "H", conflicts_with_all = ["ground", "vehicles", "operators"])]
    pub hosts: Vec<String>,
    /// Name or address under which the node reaches the ground station [default: that of those enrolled before, or 127.0.0.1]
    #[arg(long, value_name = "H")]
    pub ground_host: Option<String>,
    /// Port of the ground station, and of the vehicles of a mesh [default: that of those enrolled before, or 7447]
    #[arg(long, value_name = "PORT", value_parser = clap::value_parser!(u16).range(1..))]
    pub port: Option<u16>,
    /// How the swarm is joined; the same for all nodes [default: as those enrolled before, or mesh]
    #[arg(long, value_enum)]
    pub topology: Option<EnrolledTopology>,
    /// Folder on the node for what outlives it [default: /var/lib/tomoswarm/NODE]
    #[arg(long, value_name = "DIR", conflicts_with_all = ["ground", "vehicles", "operators"])]
    pub state_dir: Option<String>,
    /// Give an enrolled NODE a new certificate; the old one ends
    #[arg(long, conflicts_with_all = ["ground", "vehicles", "operators"])]
    pub replace: bool,
    /// Take a node out of the roster: ground, vehicle-N or operator-N
    #[arg(long, value_name = "NAME", conflicts_with_all = ["replace", "hosts"])]
    pub revoke: Option<String>,
}

const AFTER_HELP: &str = "\
Without hosts the nodes are reached on their own machine only.

Examples:
  tomoswarm enroll swarm --venue yard.venue.toml --ground ground.local --vehicle 1=rover1.local --vehicle 2=rover2.local --operator
  tomoswarm enroll swarm --venue yard.venue.toml vehicle 3 --host rover3.local --ground-host ground.local
  tomoswarm enroll swarm --venue yard.venue.toml operator 2 --ground-host ground.local
  tomoswarm enroll swarm --venue yard.venue.toml vehicle 1 --host rover1.local --ground-host ground.local --replace
  tomoswarm enroll swarm --revoke vehicle-1

Exit codes: 0 done; 2 bad usage or files, or a node is enrolled already, in another way.";

/// Where the ground station listens unless something else is said.
const DEFAULT_PORT: u16 = 7447;

/// Hosts under which a node is reached; one at least.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Hosts(Vec<String>);

/// Reads hosts, separated by commas.
fn hosts_in(text: &str) -> Result<Hosts, String> {
    let hosts: Vec<String> = text.split(',').map(str::to_owned).collect();
    match hosts.iter().find(|host| !is_host(host)) {
        Some(host) => Err(no_host(host)),
        None => Ok(Hosts(hosts)),
    }
}

/// Reads the number of a vehicle with its hosts.
fn vehicle_in(text: &str) -> Result<(VehicleId, Hosts), String> {
    let expected = || "N=HOST is expected, N from 1 to 250".to_owned();
    let (number, hosts) = text.split_once('=').ok_or_else(expected)?;
    match CommonName::node_of(&format!("vehicle-{number}")) {
        Some(Sender::Vehicle(vehicle)) => Ok((vehicle, hosts_in(hosts)?)),
        Some(Sender::Ground | Sender::Operator(_)) | None => Err(expected()),
    }
}

/// Reads the number of an operator, with its hosts where it has some.
fn operator_in(text: &str) -> Result<(OperatorId, Option<Hosts>), String> {
    let (number, hosts) = match text.split_once('=') {
        Some((number, hosts)) => (number, Some(hosts_in(hosts)?)),
        None => (text, None),
    };
    match CommonName::node_of(&format!("operator-{number}")) {
        Some(Sender::Operator(id)) if id.0 > 0 => Ok((id, hosts)),
        Some(_) | None => Err("N or N=HOST is expected, N from 1 to 255".to_owned()),
    }
}

fn no_host(host: &str) -> String {
    format!("{host:?}: is no host; an IP address or a host name is expected")
}

/// Which node is enrolled.
#[derive(clap::ValueEnum, Clone, Copy, PartialEq, Eq, Debug)]
pub enum EnrolledNode {
    /// The ground station.
    Ground,
    /// A vehicle; its number follows.
    Vehicle,
    /// An operator's commands; its number may follow.
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

impl EnrolledTopology {
    fn named(self) -> Topology {
        match self {
            EnrolledTopology::Mesh => Topology::Mesh,
            EnrolledTopology::Star => Topology::Star,
        }
    }
}

/// A node that is to be enrolled, and where others reach it.
pub(super) struct WantedNode {
    pub(super) node: Sender,
    hosts: Vec<String>,
}

/// A node that has a new certificate.
struct IssuedNode {
    hosts: Vec<String>,
    issued: IssuedCertificate,
}

/// A node that gets a folder.
struct NewNode {
    name: CommonName,
    hosts: Vec<String>,
    files: Vec<NewFile>,
}

impl EnrollArgs {
    /// Enrols, replaces or revokes, and says what to copy where.
    ///
    /// # Errors
    /// Bad usage or files; a node is enrolled already, or not at all; the disk refuses.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let output = match &self.revoke {
            Some(name) => self.revoke(name)?,
            None => self.enroll()?,
        };
        out.write_all(output.as_bytes()).map_err(CliError::stdout)
    }

    fn enroll(&self) -> Result<String, CliError> {
        let wanted = self.wanted()?;
        self.check_hosts()?;
        let (venue, venue_text) = self.venue()?;
        wanted
            .iter()
            .try_for_each(|wanted| check_home(wanted.node, &venue))?;
        if !self.folder.join(CA).exists() {
            let ground_host = self.ground_host(None);
            wanted
                .iter()
                .try_for_each(|wanted| check_reach(wanted.node, &wanted.hosts, &ground_host))?;
            let all = wanted.iter().map(|wanted| (wanted.node, &wanted.hosts));
            check_apart(&self.reached(all, None))?;
            create_authority(&self.folder, &venue_text)?;
        }
        let swarm = Swarm::open(&self.folder)?;
        swarm.check_venue(&venue)?;
        let mut said = interrupted_said(&swarm)?;
        let (next, issued) = self.issue(&swarm, &wanted)?;
        let is_issued = |node| {
            issued
                .iter()
                .any(|issued| issued.issued.entry.name.node == node)
        };
        let joined = swarm.joined(&swarm.roster);
        match &joined {
            Some(joined) => self.check_options(&swarm, joined, is_issued(Sender::Ground))?,
            None if issued.is_empty() => {}
            None => self.check_all_given(&swarm, is_issued(Sender::Ground))?,
        }
        let ground = joined.as_ref().map(|(_, ground)| ground);
        let mut reached = swarm.reached_nodes(&swarm.roster, ground);
        reached.retain(|(node, _)| !is_issued(*node));
        let all = issued
            .iter()
            .map(|issued| (issued.issued.entry.name.node, &issued.hosts));
        reached.extend(self.reached(all, ground));
        check_apart(&reached)?;
        if issued.is_empty() {
            let issue = swarm.roster.issue;
            let gone = without_folders(&swarm, &wanted);
            let advice =
                where_to_take_over(&swarm, wanted.iter().map(|node| (node.node, &node.hosts)));
            return Ok(
                said + &format!("all are enrolled already, roster issue {issue}\n{gone}{advice}")
            );
        }
        let new: Vec<NewNode> = issued
            .into_iter()
            .map(|IssuedNode { hosts, issued }| {
                let of = (&swarm, joined.as_ref());
                Ok(NewNode {
                    name: issued.entry.name,
                    files: self.files(of, &next, &hosts, &issued, &venue_text)?,
                    hosts,
                })
            })
            .collect::<Result<_, CliError>>()?;
        let before = ListsBefore::of((&swarm, ground), &next, None);
        let files: Vec<(Sender, Vec<NewFile>)> = new
            .iter()
            .map(|new| (new.name.node, new.files.clone()))
            .collect();
        let edited_before = new
            .iter()
            .filter_map(|new| swarm.file_before_revoked(new.name))
            .collect::<Vec<_>>();
        let former = swarm.publish((&before, &next), &files)?;
        for node in &new {
            said += &format!("{} is enrolled, roster issue {}\n", node.name, next.issue);
            for (_, former) in former.iter().filter(|(of, _)| *of == node.name.node) {
                let former = former.display();
                said +=
                    &format!("the former files are kept in {former} and are worth nothing now\n");
            }
        }
        for (file, before) in edited_before {
            let (file, before) = (file.display(), before.display());
            said += &format!(
                "{file} is new; the one that the node had before it was revoked is {before}\n"
            );
        }
        said += &lists_said(&swarm, &before, &next)?;
        let is_new = |node| new.iter().any(|new| new.name.node == node);
        said += &where_to_take_over(&swarm, new.iter().map(|new| (new.name.node, &new.hosts)));
        match is_new(Sender::Ground) {
            true => said += &moved_ground(&swarm, &before, &next)?,
            false => said += &planned_for(&before, &next),
        }
        ListsBefore::forget(&self.folder)?;
        Ok(said + &roster_advice(&swarm, &next, is_new))
    }

    /// Issues certificates for those that are not enrolled already in just this way, and the roster that allows them all.
    fn issue(
        &self,
        swarm: &Swarm,
        wanted: &[WantedNode],
    ) -> Result<(Roster, Vec<IssuedNode>), CliError> {
        let (mut next, mut all) = (swarm.roster.clone(), Vec::new());
        for WantedNode { node, hosts } in wanted {
            if self.node.is_none() && swarm.roster.of(*node).is_some() {
                swarm.check_hosts(*node, hosts)?;
                continue;
            }
            let name = next
                .next_name(*node, self.replace)
                .map_err(|error| swarm.refused(ROSTER, error))?;
            let issued = swarm
                .authority
                .issue(name, hosts)
                .map_err(|error| swarm.refused(CA, error))?;
            next = next
                .admitting(issued.entry.clone())
                .map_err(|error| swarm.refused(ROSTER, error))?;
            all.push(IssuedNode {
                hosts: hosts.clone(),
                issued,
            });
        }
        // However many are admitted, it is one issue.
        next.issue = next.issue.min(swarm.roster.issue.saturating_add(1));
        Ok((next, all))
    }

    fn revoke(&self, name: &str) -> Result<String, CliError> {
        let node = CommonName::node_of(name).ok_or_else(|| {
            CliError::Usage(format!(
                "--revoke {name}: is no node; ground, operator-N or vehicle-N is expected"
            ))
        })?;
        let swarm = Swarm::open(&self.folder)?;
        let said = interrupted_said(&swarm)?;
        let was_interrupted =
            swarm.interrupted.as_ref().and_then(ListsBefore::revoked) == Some(node);
        if was_interrupted && swarm.roster.of(node).is_none() {
            return Ok(said);
        }
        let next = swarm
            .roster
            .revoking(node)
            .map_err(|error| swarm.refused(ROSTER, error))?;
        let joined = swarm.joined(&swarm.roster);
        let ground = joined.as_ref().map(|(_, ground)| ground);
        let before = ListsBefore::of((&swarm, ground), &next, Some(node));
        swarm.publish((&before, &next), &[])?;
        let former = swarm.retire(node, "revoked")?;
        let lists = lists_said(&swarm, &before, &next)?;
        ListsBefore::forget(&self.folder)?;
        let kept = former.map_or(String::new(), |folder| {
            format!("its files are kept in {}\n", folder.display())
        });
        Ok(said
            + &format!(
                "{name} is revoked, roster issue {}\n{kept}{lists}{}{}",
                next.issue,
                planned_for(&before, &next),
                roster_advice(&swarm, &next, |_| false)
            ))
    }

    fn wanted(&self) -> Result<Vec<WantedNode>, CliError> {
        if self.node.is_some() {
            let hosts = self.hosts.clone();
            let node = self.wanted_node()?;
            return Ok(vec![WantedNode { node, hosts }]);
        }
        let ground = self
            .ground
            .iter()
            .map(|hosts| (Sender::Ground, hosts.0.clone()));
        let vehicles = self
            .vehicles
            .iter()
            .map(|(id, hosts)| (Sender::Vehicle(*id), hosts.0.clone()));
        let operators = self.operators.iter().map(|(id, hosts)| {
            let hosts = hosts.as_ref().map(|hosts| hosts.0.clone());
            (Sender::Operator(*id), hosts.unwrap_or_default())
        });
        let mut wanted: Vec<WantedNode> = Vec::new();
        for (node, hosts) in ground.chain(vehicles).chain(operators) {
            if wanted.iter().any(|other| other.node == node) {
                let name = CommonName::node_name(node);
                return Err(CliError::Usage(format!("{name} is given twice")));
            }
            wanted.push(WantedNode { node, hosts });
        }
        Ok(wanted)
    }

    fn wanted_node(&self) -> Result<Sender, CliError> {
        match (self.node, self.number) {
            (Some(EnrolledNode::Ground), None) => Ok(Sender::Ground),
            (Some(EnrolledNode::Operator), number) => {
                Ok(Sender::Operator(number.map_or(FIRST_OPERATOR, OperatorId)))
            }
            (Some(EnrolledNode::Vehicle), Some(number @ 1..=250)) => {
                Ok(Sender::Vehicle(VehicleId(number)))
            }
            (Some(EnrolledNode::Vehicle), Some(number)) => Err(CliError::Usage(format!(
                "vehicle {number}: vehicles have numbers from 1 to 250"
            ))),
            (Some(EnrolledNode::Vehicle), None) => Err(CliError::Usage(
                "vehicle: its number is missing; vehicle N is expected, 1 to 250".to_owned(),
            )),
            (Some(EnrolledNode::Ground), Some(number)) => Err(CliError::Usage(format!(
                "{number}: there is one ground station, which has no number"
            ))),
            (None, _) => Err(CliError::Usage(
                "ground, vehicle N or operator [N] is expected".to_owned(),
            )),
        }
    }

    fn check_hosts(&self) -> Result<(), CliError> {
        let options = self.hosts.iter().map(|host| ("--host", host));
        let ground = self.ground_host.iter().map(|host| ("--ground-host", host));
        for (option, host) in options.chain(ground) {
            if !is_host(host) {
                return Err(CliError::Usage(format!("{option} {}", no_host(host))));
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
        (swarm, joined): (&Swarm, Option<&(Topology, Endpoint)>),
        next: &Roster,
        hosts: &[String],
        issued: &IssuedCertificate,
        venue: &str,
    ) -> Result<Vec<NewFile>, CliError> {
        let node = issued.entry.name.node;
        let own_file = swarm.node_folder(node).join(file_name(node));
        // What was edited by hand stays.
        let config = match own_file.exists() {
            true => read::text(&own_file)?,
            false => {
                let config = self.config_of((swarm, joined), node, hosts, next);
                check_reach(node, hosts, &config.ground_host)?;
                config.text(venue)?
            }
        };
        let read = check_config(node, &own_file, &config, venue)?;
        if own_file.exists() {
            let given = GivenOptions {
                port: self.port,
                state_dir: self.state_dir.as_deref(),
            };
            check_kept((node, &own_file), &read, hosts, &given)?;
        }
        Ok(vec![
            NewFile::open(CA, swarm.authority.certificate_pem()),
            NewFile::open(CERTIFICATE, issued.certificate_pem.clone()),
            NewFile::private(KEY, issued.key_pem.clone()),
            NewFile::open(VENUE, venue),
            NewFile::open(file_name(node), config),
        ])
    }

    /// Refuses options that say something else than the swarm's files; where the ground station is reached is its own to say.
    fn check_options(
        &self,
        swarm: &Swarm,
        (shape, ground): &(Topology, Endpoint),
        is_ground_new: bool,
    ) -> Result<(), CliError> {
        let folder = self.folder.display();
        let given = self.topology.map(EnrolledTopology::named);
        if let Some(given) = given.filter(|given| given != shape) {
            let (given, shape) = (given.name(), shape.name());
            return Err(CliError::Usage(format!(
                "--topology {given}: the swarm is a {shape}, as the files in {folder} say; leave it out, or make a new swarm"
            )));
        }
        if is_ground_new {
            return Ok(());
        }
        if let Some(port) = self.port.filter(|port| *port != ground.port) {
            return Err(CliError::Usage(format!(
                "--port {port}: the ground station is reached at {ground}, as the files in {folder} say; leave it out"
            )));
        }
        let known = swarm.hosts_of(Sender::Ground);
        let is_other = |host: &&String| known.as_ref().is_some_and(|known| !known.contains(host));
        if let Some(host) = self.ground_host.as_ref().filter(is_other) {
            let known = known.unwrap_or_default().join(", ");
            return Err(CliError::Usage(format!(
                "--ground-host {host}: the ground station's certificate is of {known}; one of them is expected"
            )));
        }
        Ok(())
    }

    /// Refuses to guess how a swarm is joined of which no folder of a node is here any more.
    fn check_all_given(&self, swarm: &Swarm, is_ground_new: bool) -> Result<(), CliError> {
        let is_ground_given = is_ground_new || self.ground_host.is_some();
        let is_all_given = self.topology.is_some() && self.port.is_some() && is_ground_given;
        if is_all_given || swarm.roster.allowed.is_empty() {
            return Ok(());
        }
        Err(CliError::Usage(format!(
            "no file in {} says how the swarm is joined: the folders of its nodes were carried away; --topology, --port and \
             --ground-host are expected, as they were at first",
            self.folder.display()
        )))
    }

    /// Returns where others reach nodes that are to be enrolled.
    fn reached<'a>(
        &self,
        wanted: impl Iterator<Item = (Sender, &'a Vec<String>)>,
        joined: Option<&Endpoint>,
    ) -> Vec<(Sender, Endpoint)> {
        let port = self
            .port
            .or(joined.map(|ground| ground.port))
            .unwrap_or(DEFAULT_PORT);
        let is_reached = |(node, _): &(Sender, &Vec<String>)| !matches!(node, Sender::Operator(_));
        let endpoint = |(node, hosts): (Sender, &Vec<String>)| {
            let endpoint = Endpoint {
                protocol: Protocol::Tls,
                host: hosts.iter().find(|host| is_far(host))?.clone(),
                port,
            };
            Some((node, endpoint))
        };
        wanted.filter(is_reached).filter_map(endpoint).collect()
    }

    /// Returns the host under which the ground station is reached: as it is given, as the swarm's files say, or this machine.
    fn ground_host(&self, joined: Option<&Endpoint>) -> String {
        let given = self.ground.as_ref().and_then(|hosts| hosts.0.first());
        let given = given.or(self.ground_host.as_ref());
        let host = given.or(joined.map(|ground| &ground.host)).cloned();
        host.unwrap_or_else(|| "127.0.0.1".to_owned())
    }

    fn config_of(
        &self,
        (swarm, joined): (&Swarm, Option<&(Topology, Endpoint)>),
        node: Sender,
        hosts: &[String],
        roster: &Roster,
    ) -> NodeConfig {
        let (shape, ground) = joined.map(|(shape, ground)| (*shape, ground)).unzip();
        let ground_host = self.ground_host(ground);
        let port = self.port.or(ground.map(|ground| ground.port));
        let state_dir = format!("/var/lib/tomoswarm/{}", CommonName::node_name(node));
        NodeConfig {
            node,
            topology: self
                .topology
                .map(EnrolledTopology::named)
                .or(shape)
                .unwrap_or(Topology::Mesh),
            is_reached: hosts.iter().any(|host| is_far(host)) || is_far(&ground_host),
            has_host: hosts.iter().any(|host| is_far(host)),
            ground_host,
            port: port.unwrap_or(DEFAULT_PORT),
            state_dir: self.state_dir.clone().unwrap_or(state_dir),
            vehicles: vehicles_of(roster),
            reached: swarm.reached(roster),
        }
    }
}
