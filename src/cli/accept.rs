//! `tomoswarm accept FOLDER`: takes what `enroll` made for a node over into that node's own folder, from a stick, a copy or a
//! prepared card alike. What does not belong here is refused before anything changes; opens no connection.

use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::Command;

use tomoswarm_proto::Sender;

use super::accept_files::{
    CONFIGS, Files, is_enrolled, is_leaving, is_named, merged, new_files, user_in,
};
use super::enroll_files::{CA, CA_KEY, CERTIFICATE, KEY, ROSTER, VENUE, node_of};
use super::error::CliError;
use super::read;
use super::swarm_folder::{check_same_venue, read_venue};
use crate::config::{self, BusFile, Config, Identity, Venue};
use crate::run::membership::seen_roster_issue;
use crate::run::trust::{
    Certificate, CommonName, NewFile, Owner, Roster, TrustError, Trusted, is_as_replaced, own,
    read_limited_bytes, read_regular, replace_file, replace_folder,
};

/// The user of the services.
const USER: &str = "tomoswarm";

/// Take over on this machine what `enroll` made for it: a node's whole folder, or a newer roster alone.
///
/// FOLDER is a folder that `tomoswarm enroll` made for one node, or a roster.txt. Chain, roster, id, venue and the key's mode
/// are checked; then the folder of the node is exchanged in one step, and the former one is kept beside it. A configuration
/// that was edited here stays. Of what was brought it takes the files that `enroll` makes and those that the configuration
/// names, and follows no links. A node that runs takes up a newer roster, or a new certificate, by itself within seconds.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct AcceptArgs {
    /// What was brought: a folder of one node, or a roster.txt
    #[arg(value_name = "FOLDER")]
    pub folder: PathBuf,
    /// Folder of the node
    #[arg(long, value_name = "DIR", default_value = "/etc/tomoswarm")]
    pub into: PathBuf,
    /// Enable the service of the node, and start it unless it runs
    #[arg(long)]
    pub start: bool,
}

const AFTER_HELP: &str = "\
Examples:
  sudo tomoswarm accept /media/usb/vehicle-1 --start     a new vehicle
  sudo tomoswarm accept /tmp/roster.txt                  somebody was enrolled, replaced or revoked

Run as root it gives the files to the user tomoswarm, whose the services are.

Exit codes: 0 done, or nothing was new; 1 the service does not start; 2 refused, or bad usage or files.";

impl AcceptArgs {
    /// Takes over what was brought, and says what changed.
    ///
    /// # Errors
    /// What was brought does not belong here; the disk refuses; the service does not start.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let (node, text) = match self.lone_roster() {
            Some(path) => self.accept_roster(&path)?,
            None => self.accept_folder()?,
        };
        out.write_all(text.as_bytes()).map_err(CliError::stdout)?;
        match service(node).filter(|_| self.start) {
            Some(service) => start(service),
            None => Ok(()),
        }
    }

    fn check_service(&self, node: Sender) -> Result<(), CliError> {
        if self.start && service(node).is_none() {
            let reason = "--start: an operator has no service, only commands";
            return Err(CliError::Usage(reason.to_owned()));
        }
        Ok(())
    }

    /// Returns the roster that was brought alone.
    fn lone_roster(&self) -> Option<PathBuf> {
        if self.folder.is_file() {
            return Some(self.folder.clone());
        }
        let is_alone = [CERTIFICATE, KEY, CA_KEY]
            .iter()
            .chain(&CONFIGS)
            .all(|name| !self.folder.join(name).exists());
        let path = self.folder.join(ROSTER);
        (is_alone && path.is_file()).then_some(path)
    }

    fn accept_roster(&self, path: &Path) -> Result<(Sender, String), CliError> {
        let mut files = self.own_files()?;
        if files.is_empty() {
            let reason = "there is no node here yet, and a roster alone makes none; \
                          the folder of one node is expected";
            return Err(input(&self.into, reason));
        }
        let node = Node::of(&self.into, &files)?;
        self.check_service(node.sender)?;
        let roster = read_limited_bytes(path).map_err(|source| unread(path, source))?;
        if !Roster::is_titled(&roster) {
            let reason = "is no roster; a roster.txt that `tomoswarm enroll` wrote is expected, or the folder of one node";
            return Err(input(path, reason));
        }
        let identity = Identity {
            roster: path.display().to_string(),
            ..node.identity.clone()
        };
        let trusted = Trusted::read(&identity, node.sender, node.seen(&files)?).map_err(refused)?;
        let issue = trusted.roster.issue;
        if files.insert(ROSTER.to_owned(), roster.clone()).as_ref() == Some(&roster) {
            return Ok((
                node.sender,
                format!("roster issue {issue} is here already\n"),
            ));
        }
        let here = self.into.join(ROSTER);
        replace_file(&self.into, &NewFile::open(ROSTER, roster))
            .and_then(|()| own(&here, owner()))
            .map_err(|source| unwritten(&here, source))?;
        let text = format!(
            "{} has roster issue {issue}; if it runs, within seconds\n",
            trusted.own
        );
        Ok((node.sender, text))
    }

    fn accept_folder(&self) -> Result<(Sender, String), CliError> {
        if self.folder.join(CA_KEY).exists() {
            let reason = "is the folder of the authority, whose key stays where it is; \
                          the folder of one node inside it is expected";
            return Err(input(&self.folder, reason));
        }
        let (
            Brought {
                files: brought,
                left,
            },
            own_files,
        ) = (files_brought(&self.folder)?, self.own_files()?);
        let config = config_of(&self.folder, &brought)?;
        let merged = merged(&brought, &own_files, config);
        // What is wrong with a file that was brought is said of where it lies; one that names files by where they will be is
        // understood only there.
        let node = Node::of(&self.into, &merged.files).map_err(|error| match merged.is_edited {
            true => error,
            false => Node::of(&self.folder, &merged.files).err().unwrap_or(error),
        })?;
        self.check_service(node.sender)?;
        self.check_swarm(&brought, &own_files)?;
        self.check_node(node.sender, &own_files)?;
        self.check_venue(&brought, &node.venue)?;
        let shown = |name: &str| self.folder.join(name).display().to_string();
        let identity = Identity {
            ca: shown(CA),
            certificate: shown(CERTIFICATE),
            key: shown(KEY),
            roster: shown(ROSTER),
        };
        let seen = node.seen(&own_files)?;
        let trusted = Trusted::read_brought(&identity, node.sender, seen).map_err(refused)?;
        let about = format!("{}, roster issue {}", trusted.own, trusted.roster.issue);
        let (new, owner) = (new_files(&merged.files), owner());
        let is_same = merged.files == own_files;
        if is_same && is_as_replaced(&self.into, &new, owner).is_ok_and(|is_right| is_right) {
            let mut text = format!("{about}: is here already\n");
            text += &remarks(&left, owner, node.sender);
            return Ok((node.sender, text));
        }
        let former = replace_folder(&self.into, &new, owner)
            .map_err(|source| unwritten(&self.into, source))?;
        let mut text = match is_same {
            false => format!("{} is now that of {about}\n", self.into.display()),
            true => format!(
                "{about}: was here already, and its files have the owner and the modes now that they need\n"
            ),
        };
        text += &remarks(&left, owner, node.sender);
        if let Some(former) = former {
            text += &format!("the former folder is kept in {}\n", former.display());
        }
        if merged.is_edited {
            text += &format!("{config} was edited here and stays\n");
        }
        if let Some(beside) = merged.beside {
            text += &format!("the one that was brought says something else: see {beside}\n");
        }
        text += &format!("delete {}: the node has it\n", shown(KEY));
        Ok((node.sender, text))
    }

    fn own_files(&self) -> Result<Files, CliError> {
        match self.into.exists() {
            true => files_in(&self.into),
            false => Ok(Files::new()),
        }
    }

    /// Checks that what was brought is of the swarm that is here.
    fn check_swarm(&self, brought: &Files, own: &Files) -> Result<(), CliError> {
        let Some(own) = own.get(CA) else {
            return Ok(());
        };
        let (brought, own) = (
            authority(&self.folder, brought.get(CA))?,
            authority(&self.into, Some(own))?,
        );
        if own.fingerprint == brought.fingerprint {
            return Ok(());
        }
        let into = self.into.display();
        let reason = format!(
            "is of another swarm ({}) than {into} ({}); move {into} away if this machine is to change",
            brought.common_name, own.common_name
        );
        Err(input(&self.folder, reason))
    }

    /// Checks that what was brought is of the node that is here.
    fn check_node(&self, node: Sender, own: &Files) -> Result<(), CliError> {
        match node_in(own).filter(|own| *own != node) {
            None => Ok(()),
            Some(own) => {
                let (own, brought) = (CommonName::node_name(own), CommonName::node_name(node));
                let into = self.into.display();
                let reason = format!(
                    "is of {brought}, but {into} is of {own}; move {into} away if this machine is to change"
                );
                Err(input(&self.folder, reason))
            }
        }
    }

    /// Checks that the venue that was brought is the node's, and the one that was here.
    fn check_venue(&self, brought: &Files, of_node: &Venue) -> Result<(), CliError> {
        let path = self.folder.join(VENUE);
        let brought = read_venue(&path, &text_of(&path, brought.get(VENUE))?)?;
        check_same_venue(&path, &brought, of_node)?;
        let path = self.into.join(VENUE);
        match path.exists() {
            true => check_same_venue(&path, &read_venue(&path, &read::text(&path)?)?, &brought),
            false => Ok(()),
        }
    }
}

/// A node as its files say it is.
struct Node {
    sender: Sender,
    venue: Venue,
    identity: Identity,
    state_dir: Option<String>,
}

impl Node {
    /// Reads the configuration among the files that are, or are to be, in a folder.
    fn of(folder: &Path, files: &Files) -> Result<Node, CliError> {
        let path = folder.join(config_of(folder, files)?);
        let mut elsewhere = read::around(&path);
        let mut load = |wanted: &str| {
            let inside = Path::new(wanted).strip_prefix(folder).ok();
            let file = inside.and_then(|name| files.get(name.to_str()?));
            match (file, inside) {
                (Some(file), _) => {
                    String::from_utf8(file.clone()).map_err(|error| error.to_string())
                }
                // It would be gone after the exchange.
                (None, Some(_)) => Err(format!(
                    "{wanted} is in a folder inside the node's, or is missing: files beside the configuration are expected"
                )),
                (None, None) => elsewhere(wanted),
            }
        };
        let shown = read::shown(&path);
        let text = load(&shown).map_err(|reason| input(&path, reason))?;
        let (sender, venue, bus, state_dir) = parts(config::read(&shown, &text, &mut load)?)
            .ok_or_else(|| input(&path, "is no node's file"))?;
        let identity = bus
            .identity
            .ok_or_else(|| input(&path, "names no certificates; tomoswarm enroll writes them"))?;
        check_names(folder, &path, &identity)?;
        Ok(Node {
            sender,
            venue,
            identity,
            state_dir,
        })
    }

    /// Returns the highest issue of the roster that was in force here: what the node has kept, or has in its folder.
    fn seen(&self, own: &Files) -> Result<Option<u64>, CliError> {
        let kept = match &self.state_dir {
            Some(folder) => seen_roster_issue(Path::new(folder)).map_err(refused)?,
            None => None,
        };
        Ok(kept.max(issue_in(own)))
    }
}

/// Returns what files of all kinds of nodes have; `None` = the file is of no node.
fn parts(config: Config) -> Option<(Sender, Venue, BusFile, Option<String>)> {
    let node = node_of(&config)?;
    let (venue, bus, state_dir) = match config {
        Config::Vehicle(file) => (file.venue, file.bus, Some(file.state_dir)),
        Config::Ground(file) => (file.venue, file.bus, Some(file.state_dir)),
        Config::Operator(file) => (file.venue, file.bus, None),
        Config::Venue(_) | Config::Scene(_) | Config::Sim(_) | Config::Experiment(_) => {
            return None;
        }
    };
    Some((node, venue, bus, state_dir))
}

/// Returns the name of the only configuration among the files of a folder.
fn config_of(folder: &Path, files: &Files) -> Result<&'static str, CliError> {
    let found: Vec<&str> = CONFIGS
        .into_iter()
        .filter(|name| files.contains_key(*name))
        .collect();
    match found[..] {
        [name] => CONFIGS.into_iter().find(|known| *known == name),
        _ => None,
    }
    .ok_or_else(|| {
        let reason = match found[..] {
            [] => format!(
                "has none of {}; the folder of one node is expected",
                CONFIGS.join(", ")
            ),
            _ => format!(
                "has, or would have, {}; a folder is of one node",
                found.join(" and ")
            ),
        };
        input(folder, reason)
    })
}

/// Checks that a configuration names the files that are exchanged.
fn check_names(folder: &Path, config: &Path, identity: &Identity) -> Result<(), CliError> {
    let named = [
        &identity.ca,
        &identity.certificate,
        &identity.key,
        &identity.roster,
    ];
    for (named, name) in named.into_iter().zip([CA, CERTIFICATE, KEY, ROSTER]) {
        let own = folder.join(name);
        if Path::new(named) != own {
            let reason = format!(
                "names {named}, but {} is exchanged; name that",
                own.display()
            );
            return Err(input(config, reason));
        }
    }
    Ok(())
}

/// Returns the issue of the roster among the files of a folder, if it is a good one.
fn issue_in(files: &Files) -> Option<u64> {
    let text = |name: &str| std::str::from_utf8(files.get(name)?).ok();
    let authority = Certificate::from_pem(text(CA)?).ok()?;
    Some(Roster::verify(text(ROSTER)?, &authority).ok()?.issue)
}

/// Returns whose certificate is among the files of a folder.
fn node_in(files: &Files) -> Option<Sender> {
    let text = std::str::from_utf8(files.get(CERTIFICATE)?).ok()?;
    let name: CommonName = Certificate::from_pem(text).ok()?.common_name.parse().ok()?;
    Some(name.node)
}

fn authority(folder: &Path, file: Option<&Vec<u8>>) -> Result<Certificate, CliError> {
    let path = folder.join(CA);
    let certificate = Certificate::from_pem(&text_of(&path, file)?);
    certificate.map_err(|source| refused(TrustError::Certificate { path, source }))
}

fn text_of(path: &Path, file: Option<&Vec<u8>>) -> Result<String, CliError> {
    let missing = "is missing; the folder of one node is expected, as `tomoswarm enroll` wrote it";
    let file = file.ok_or_else(|| input(path, missing))?;
    String::from_utf8(file.clone()).map_err(|error| input(path, error))
}

/// What was brought.
struct Brought {
    /// What is taken.
    files: Files,
    /// Names of what is not, without leavings of other machines.
    left: Vec<String>,
}

/// Returns the files of a folder that was brought which `enroll` makes, or which its configuration names; follows no links.
fn files_brought(folder: &Path) -> Result<Brought, CliError> {
    let (mut files, mut others) = (Files::new(), Vec::new());
    for name in names_in(folder)? {
        match is_enrolled(&name) {
            true => drop(files.insert(name.clone(), regular(&folder.join(&name))?)),
            false if is_leaving(&name) => {}
            false => others.push(name),
        }
    }
    let (named, left): (Vec<String>, Vec<String>) =
        others.into_iter().partition(|name| is_named(&files, name));
    for name in named {
        let content = regular(&folder.join(&name))?;
        files.insert(name, content);
    }
    Ok(Brought { files, left })
}

fn regular(path: &Path) -> Result<Vec<u8>, CliError> {
    read_regular(path).map_err(|source| unread(path, source))
}

/// Returns the names in a folder, in order.
fn names_in(folder: &Path) -> Result<Vec<String>, CliError> {
    let unlisted = |error| {
        let reason = format!("cannot be read: {error}; the folder of one node is expected");
        input(folder, reason)
    };
    let entries = std::fs::read_dir(folder).map_err(unlisted)?;
    let entries: Vec<_> = entries.collect::<Result<_, _>>().map_err(unlisted)?;
    let names = entries.iter().map(std::fs::DirEntry::file_name);
    // No file that is of use has a name that is no text.
    let mut names: Vec<String> = names.flat_map(std::ffi::OsString::into_string).collect();
    names.sort_unstable();
    Ok(names)
}

/// Returns what else is to be said: what was brought in vain, and that the services' user is missing. An operator has no
/// service: its files are for whoever runs its commands.
fn remarks(left: &[String], owner: Option<Owner>, node: Sender) -> String {
    let mut text = String::new();
    if !left.is_empty() {
        text += &format!(
            "left where it was, since `enroll` does not make it and no configuration names it: {}\n",
            left.join(", ")
        );
    }
    if owner.is_none() && rustix::process::geteuid().is_root() {
        text += &match service(node) {
            Some(_) => format!(
                "there is no user {USER}, so its service could not read this: install the package, then accept it again\n"
            ),
            None => format!(
                "there is no user {USER}, so only root can read this: run its commands as root, or accept it as who runs them\n"
            ),
        };
    }
    text
}

/// Returns every file of a folder, without those in folders inside it.
fn files_in(folder: &Path) -> Result<Files, CliError> {
    let mut files = Files::new();
    for name in names_in(folder)? {
        let path = folder.join(&name);
        // A link counts as what it leads to: it is the node's own.
        if path.is_file() {
            let content = read_limited_bytes(&path).map_err(|source| unread(&path, source))?;
            files.insert(name, content);
        }
    }
    Ok(files)
}

/// Returns to whom the files are to belong: the services' user, if the caller may give them away and there is one.
fn owner() -> Option<Owner> {
    let passwd = std::fs::read_to_string("/etc/passwd").ok()?;
    let (user, group) = user_in(&passwd, USER)?;
    rustix::process::geteuid()
        .is_root()
        .then_some(Owner { user, group })
}

/// Returns the service of a node; `None` = it has none.
fn service(node: Sender) -> Option<&'static str> {
    match node {
        Sender::Vehicle(_) => Some("tomoswarm-vehicle"),
        Sender::Ground => Some("tomoswarm-ground"),
        Sender::Operator(_) => None,
    }
}

/// Enables a service, and starts it unless it runs.
fn start(service: &str) -> Result<(), CliError> {
    let failed = |reason: &dyn Display| {
        CliError::Swarm(format!(
            "systemctl enable --now {service}: {reason}; journalctl -u {service} says why"
        ))
    };
    let status = Command::new("systemctl")
        .args(["enable", "--now", service])
        .status()
        .map_err(|error| failed(&error))?;
    match status.success() {
        true => Ok(()),
        false => Err(failed(&status)),
    }
}

fn input(path: &Path, reason: impl Display) -> CliError {
    CliError::Input {
        path: path.to_owned(),
        reason: reason.to_string(),
    }
}

fn refused(error: TrustError) -> CliError {
    CliError::Usage(error.to_string())
}

fn unread(path: &Path, source: std::io::Error) -> CliError {
    CliError::Read {
        path: path.to_owned(),
        source,
    }
}

fn unwritten(path: &Path, error: std::io::Error) -> CliError {
    let needed = match error.kind() {
        ErrorKind::ResourceBusy | ErrorKind::CrossesDevices => {
            "it is a mount point, and a folder is exchanged in one step: --into a folder inside it, which the service is told \
             (systemctl edit), or take the mount away"
        }
        _ => "sudo is needed, or a folder of yours with --into",
    };
    input(path, format!("cannot be written: {error}; {needed}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_enroll_does_not_make_is_left_and_links_are_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let write =
            |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        let taken = || files_brought(folder.path());
        write(
            "vehicle.toml",
            "autopilot.mavlink.signing.key = \"mavlink.key\"",
        );
        for name in [
            "key.pem",
            "mavlink.key",
            "photo.jpg",
            "._key.pem",
            ".DS_Store",
        ] {
            write(name, "content");
        }
        std::fs::create_dir(folder.path().join("places")).unwrap();
        let Brought { files, left } = taken().unwrap();
        let names: Vec<&String> = files.keys().collect();
        assert_eq!(names, ["key.pem", "mavlink.key", "vehicle.toml"]);
        assert_eq!(left, ["photo.jpg", "places"]);
        let text = remarks(
            &left,
            None,
            Sender::Operator(tomoswarm_proto::OperatorId(1)),
        );
        assert!(text.contains("no configuration names it: photo.jpg, places\n"));
        assert!(!text.contains("service"), "an operator has none: {text}");
        for name in ["ca.pem", "mavlink.key"] {
            // It may be there already.
            let _ = std::fs::remove_file(folder.path().join(name));
            std::os::unix::fs::symlink("/etc/passwd", folder.path().join(name)).unwrap();
            let why = taken().err().unwrap().to_string();
            assert!(why.contains(name) && why.contains("it is a link"), "{why}");
            std::fs::remove_file(folder.path().join(name)).unwrap();
        }
    }

    #[test]
    fn a_mount_point_is_named_as_what_it_is() {
        for (kind, part) in [
            (ErrorKind::ResourceBusy, "it is a mount point"),
            (ErrorKind::CrossesDevices, "it is a mount point"),
            (ErrorKind::PermissionDenied, "sudo is needed"),
        ] {
            let said = unwritten(Path::new("/etc/tomoswarm"), kind.into()).to_string();
            assert!(said.contains(part), "{said}");
        }
    }
}
