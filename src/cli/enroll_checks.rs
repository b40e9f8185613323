//! What `tomoswarm enroll` refuses before it signs anything: nodes that could not meet, since they would look for each other in
//! other places than they are, or would be in one place. It changes nothing.

use std::path::Path;

use tomoswarm_proto::Sender;

use super::enroll_files::node_of;
use super::error::CliError;
use super::read;
use super::swarm_folder::is_far;
use crate::config::{self, BusFile, Config, Endpoint, Venue};
use crate::run::trust::CommonName;

/// Refuses nodes that others would reach in one place.
///
/// # Errors
/// The first two of them.
pub(super) fn check_apart(reached: &[(Sender, Endpoint)]) -> Result<(), CliError> {
    for (at, (node, endpoint)) in reached.iter().enumerate() {
        let mut before = reached[..at].iter();
        if let Some((other, _)) = before.find(|(other, known)| other != node && known == endpoint) {
            let [node, other] = [*node, *other].map(CommonName::node_name);
            return Err(CliError::Usage(format!(
                "{node} and {other} would both be reached at {endpoint}: a host of its own is expected for each, or 127.0.0.1 \
                 for a vehicle that shares its machine with another node"
            )));
        }
    }
    Ok(())
}

/// What the options of a call say that a node's file says already.
pub(super) struct GivenOptions<'a> {
    /// `--port`.
    pub(super) port: Option<u16>,
    /// `--state-dir`.
    pub(super) state_dir: Option<&'a str>,
}

/// Refuses a new certificate beside a node's file that stays as it is, where that file would not do.
///
/// # Errors
/// Other machines would not reach the node, it would not reach the ground station, or the options say something else.
pub(super) fn check_kept(
    (node, path): (Sender, &Path),
    config: &Config,
    hosts: &[String],
    given: &GivenOptions<'_>,
) -> Result<(), CliError> {
    let (bus, state_dir): (&BusFile, Option<&str>) = match config {
        Config::Vehicle(file) => (&file.bus, Some(&file.state_dir)),
        Config::Ground(file) => (&file.bus, Some(&file.state_dir)),
        Config::Operator(file) => (&file.bus, None),
        Config::Venue(_) | Config::Scene(_) | Config::Sim(_) | Config::Experiment(_) => {
            return Ok(());
        }
    };
    let stays = "which stays as it is: edit it, or move its folder away for a new one";
    let refused = |reason: String| {
        Err(CliError::Input {
            path: path.to_owned(),
            reason: format!("{reason}; {stays}"),
        })
    };
    let far = hosts.iter().find(|host| is_far(host));
    if let (Some(host), Some(listen)) = (far, bus.listen.first())
        && !matches!(node, Sender::Operator(_))
        && !bus.listen.iter().any(|listen| is_far(&listen.host))
    {
        return refused(format!(
            "listens at {listen} alone, where nobody reaches {host}; 0.0.0.0 is expected in `listen` of this file"
        ));
    }
    let ground = match node {
        Sender::Ground => bus.listen.first(),
        Sender::Vehicle(_) | Sender::Operator(_) => bus.connect.first(),
    };
    if let Some(ground) = ground {
        check_reach(node, hosts, &ground.host)?;
        if given.port.is_some_and(|port| port != ground.port) {
            return refused(format!(
                "says port {} of the ground station, and not that of --port, in this file",
                ground.port
            ));
        }
    }
    match (given.state_dir, state_dir) {
        (Some(given), Some(kept)) if given != kept => refused(format!(
            "says state_dir = {kept:?}, and not what --state-dir says, in this file"
        )),
        _ => Ok(()),
    }
}

/// Reads a configuration; refuses what `tomoswarm check` would refuse, and that of another node.
///
/// # Errors
/// It is none of this node.
pub(super) fn check_config(
    node: Sender,
    path: &Path,
    text: &str,
    venue: &str,
) -> Result<Config, CliError> {
    let config = config::read(&read::shown(path), text, &mut |_| Ok(venue.to_owned()))?;
    match node_of(&config) {
        Some(found) if found == node => Ok(config),
        found => {
            let found = found.map_or("no node".to_owned(), CommonName::node_name);
            let wanted = CommonName::node_name(node);
            let reason = format!("is the configuration of {found}; that of {wanted} is expected");
            Err(CliError::Input {
                path: path.to_owned(),
                reason,
            })
        }
    }
}

/// Refuses a vehicle of another machine that would look for the ground station on its own. The hosts of an operator are those of
/// its page, and say nothing of where it stands.
///
/// # Errors
/// It would.
pub(super) fn check_reach(
    node: Sender,
    hosts: &[String],
    ground_host: &str,
) -> Result<(), CliError> {
    let far = hosts.iter().find(|host| is_far(host));
    let Some(host) = far.filter(|_| matches!(node, Sender::Vehicle(_)) && !is_far(ground_host))
    else {
        return Ok(());
    };
    let name = CommonName::node_name(node);
    Err(CliError::Usage(format!(
        "{name} is on another machine ({host}), where {ground_host} is that machine itself; the host under which it reaches \
         the ground station is expected: --ground HOST, or --ground-host HOST"
    )))
}

/// Refuses a vehicle for which a venue has no home.
///
/// # Errors
/// There is none.
pub(super) fn check_home(node: Sender, venue: &Venue) -> Result<(), CliError> {
    let homes = venue.homes.len();
    match node {
        Sender::Vehicle(id) if usize::from(id.0) > homes => Err(CliError::Usage(format!(
            "vehicle {id}: has no home, the venue has {homes} of them"
        ))),
        Sender::Vehicle(_) | Sender::Ground | Sender::Operator(_) => Ok(()),
    }
}
