//! What `tomoswarm enroll` says is to be done elsewhere: on the machine of each node, and with files that people have edited. The
//! files of the swarm's folder it brings up to date itself where they are as it wrote them.

use std::path::Path;

use tomoswarm_proto::Sender;

use super::enroll::WantedNode;
use super::enroll_files::{CA_KEY, CERTIFICATE, ROSTER, endpoint_list, file_name, vehicle_list};
use super::enroll_pending::ListsBefore;
use super::error::CliError;
use super::swarm_folder::{Swarm, is_far, vehicles_of};
use crate::run::trust::{CommonName, Roster};

/// Says for whom the ground station is to plan from now on, when that has changed.
pub(super) fn planned_for(before: &ListsBefore, next: &Roster) -> String {
    let (before, vehicles) = (before.vehicles(), vehicles_of(next));
    if before == vehicles || next.of(Sender::Ground).is_none() {
        return String::new();
    }
    format!(
        "the ground station plans for who is in its file: on its machine write\n  vehicles = [{}]\n\
         into its ground.toml, and start it anew\n",
        vehicle_list(&vehicles)
    )
}

/// Brings the files of all others up to date when the ground station is reached elsewhere; returns what is to be done with those
/// that were carried away.
pub(super) fn moved_ground(
    swarm: &Swarm,
    before: &ListsBefore,
    next: &Roster,
) -> Result<String, CliError> {
    let (Some(before), Some((_, after))) = (before.ground(), swarm.joined(next)) else {
        return Ok(String::new());
    };
    if before == after {
        return Ok(String::new());
    }
    let (named, edited_by_hand) = swarm.name_moved_ground((&before, &after), next)?;
    let names = |nodes: &[Sender]| {
        let names = nodes.iter().copied().map(CommonName::node_name);
        names.collect::<Vec<String>>().join(", ")
    };
    let mut said = String::new();
    if !named.is_empty() {
        said += &format!(
            "the ground station is reached at {after}, no more at {before}: the files of {} say so here; on their machines \
             write it into `connect`, and start them anew\n",
            names(&named)
        );
    }
    if !edited_by_hand.is_empty() {
        said += &format!(
            "the list `connect` of {} was edited: the ground station is reached at {after} now\n",
            names(&edited_by_hand)
        );
    }
    Ok(said)
}

/// Brings the lists of vehicles in the files of ground station and operators up to date; returns what is to be said of those
/// that people have edited.
pub(super) fn lists_said(
    swarm: &Swarm,
    before: &ListsBefore,
    next: &Roster,
) -> Result<String, CliError> {
    let mut said = String::new();
    if !swarm.list_in_ground(&before.vehicles(), next)? {
        said += &format!(
            "the list `vehicles` of the ground station's file was edited: make it [{}] by hand\n",
            vehicle_list(&vehicles_of(next))
        );
    }
    for operator in swarm.name_in_operators(&before.reached(), next)? {
        let name = CommonName::node_name(Sender::Operator(operator));
        let endpoints = endpoint_list(&swarm.reached(next));
        said += &format!(
            "the list `connect` of the file of {name} was edited: it is to end with {endpoints}\n"
        );
    }
    Ok(said)
}

/// Does what a call before has left undone since it was interrupted; returns what that call would have said of it.
///
/// # Errors
/// The disk refuses.
pub(super) fn interrupted_said(swarm: &Swarm) -> Result<String, CliError> {
    let Some(before) = &swarm.interrupted else {
        return Ok(String::new());
    };
    let roster = &swarm.roster;
    let mut said = "the call before was interrupted; what it left is done now\n".to_owned();
    if let Some(node) = before.revoked().filter(|node| roster.of(*node).is_none()) {
        swarm.retire(node, "revoked")?;
        said += &format!("{} is revoked\n", CommonName::node_name(node));
    }
    said += &lists_said(swarm, before, roster)?;
    said += &moved_ground(swarm, before, roster)?;
    said += &planned_for(before, roster);
    said += &roster_advice(swarm, roster, |_| false);
    ListsBefore::forget(&swarm.folder)?;
    Ok(said)
}

/// Says of which nodes that are enrolled there is no folder here: they were carried away, or never written.
pub(super) fn without_folders(swarm: &Swarm, wanted: &[WantedNode]) -> String {
    let is_gone = |wanted: &&WantedNode| !swarm.node_folder(wanted.node).join(CERTIFICATE).exists();
    let gone = wanted.iter().filter(is_gone);
    let names = gone.map(|wanted| CommonName::node_name(wanted.node));
    names
        .map(|name| {
            format!("{name} has no certificate here: unless its folder was carried to it, give it a new one (--replace)\n")
        })
        .collect()
}

/// Returns what takes the folders of nodes, those that are here, over on their machines.
pub(super) fn where_to_take_over<'a>(
    swarm: &Swarm,
    nodes: impl Iterator<Item = (Sender, &'a Vec<String>)>,
) -> String {
    let here = nodes.map(|(node, hosts)| (swarm.node_folder(node), node, hosts));
    let here = here.filter(|(folder, ..)| folder.join(CERTIFICATE).exists());
    let lines: String = here
        .map(|(folder, node, hosts)| taken_over(&folder, node, hosts))
        .collect();
    match lines.is_empty() {
        true => lines,
        false => format!("on the machine of each:\n{lines}"),
    }
}

/// Returns a path as a word of a command that is to be typed: in quotes where it has a space or a letter that shells read.
fn in_shell(path: &Path) -> String {
    let path = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+=:@%,".contains(c);
    match !path.is_empty() && path.chars().all(is_plain) {
        true => path,
        false => format!("'{}'", path.replace('\'', "'\\''")),
    }
}

/// Returns what takes a node's folder over on its machine.
fn taken_over(folder: &Path, node: Sender, hosts: &[String]) -> String {
    let (name, file) = (CommonName::node_name(node), file_name(node));
    let folder = in_shell(folder);
    match (node, hosts.iter().find(|host| is_far(host))) {
        (Sender::Operator(_), Some(host)) => {
            format!("  scp -pr {folder} {host}:, and there: tomoswarm preflight {name}/{file}\n")
        }
        (Sender::Operator(_), None) => format!("  tomoswarm preflight {folder}/{file}\n"),
        (Sender::Ground | Sender::Vehicle(_), Some(host)) => format!(
            "  scp -pr {folder} {host}: && ssh -t {host} sudo tomoswarm accept {name} --start\n"
        ),
        // Several of them on one machine are tried out; only one can be its service.
        (Sender::Vehicle(_), None) => format!("  tomoswarm vehicle {folder}/{file}\n"),
        (Sender::Ground, None) => format!("  sudo tomoswarm accept {folder} --start\n"),
    }
}

/// Returns what brings a roster to all that have an older one.
pub(super) fn roster_advice(
    swarm: &Swarm,
    next: &Roster,
    has_it: impl Fn(Sender) -> bool,
) -> String {
    let roster = swarm.folder.join(ROSTER);
    let roster = in_shell(&roster);
    let (mut text, mut carried_away) = (String::new(), Vec::new());
    for node in next.allowed.iter().map(|entry| entry.name.node) {
        if has_it(node) {
            continue;
        }
        let Some(hosts) = swarm.hosts_of(node) else {
            carried_away.push(CommonName::node_name(node));
            continue;
        };
        let line = match (node, hosts.iter().find(|host| is_far(host))) {
            // Its commands read its folder each time, and in a mesh its file names the new vehicles.
            (Sender::Operator(_), Some(host)) => {
                format!("  scp -pr {} {host}:\n", in_shell(&swarm.node_folder(node)))
            }
            (Sender::Operator(_), None) => continue,
            (Sender::Ground | Sender::Vehicle(_), Some(host)) => {
                format!("  scp {roster} {host}: && ssh -t {host} sudo tomoswarm accept {ROSTER}\n")
            }
            (Sender::Ground | Sender::Vehicle(_), None) => {
                format!("  sudo tomoswarm accept {roster}\n")
            }
        };
        // Several nodes of one machine are told once.
        if !text.contains(&line) {
            text += &line;
        }
    }
    if !text.is_empty() {
        text = format!("the others need the new roster, running or not:\n{text}");
    }
    // Nothing but its folder says where a node is reached.
    if !carried_away.is_empty() {
        text += &format!(
            "no certificate of {} is here, so nothing says where they are reached, and new files do not name them: bring \
             {roster} to the machine of each, and there: sudo tomoswarm accept {ROSTER} (of an operator into its folder)\n",
            carried_away.join(", ")
        );
    }
    let key = swarm.folder.join(CA_KEY);
    text + &format!(
        "keep {} on this machine, with a backup: who has it can enrol anyone\n",
        key.display()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_with_spaces_or_quotes_is_one_word_of_a_command() {
        for (path, word) in [
            ("swarm/vehicle-1", "swarm/vehicle-1"),
            ("schwärm/ground", "schwärm/ground"),
            ("s w/ground", "'s w/ground'"),
            ("a;b", "'a;b'"),
            ("it's", "'it'\\''s'"),
        ] {
            assert_eq!(in_shell(Path::new(path)), word);
        }
    }
}
