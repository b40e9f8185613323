//! What a node's folder holds after files were brought to it: plain lists of files, decided without a disk. Trust is decided
//! elsewhere.

use std::collections::BTreeMap;

use super::enroll_files::{CA, CERTIFICATE, KEY, ROSTER, VENUE};
use crate::run::trust::NewFile;

/// The configurations that a node's folder may have, one of them.
pub(super) const CONFIGS: [&str; 3] = ["vehicle.toml", "ground.toml", "operator.toml"];

/// Files of one folder by name.
pub(super) type Files = BTreeMap<String, Vec<u8>>;

/// What a folder is to hold.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct MergedFiles {
    /// All files.
    pub(super) files: Files,
    /// Whether the configuration was edited on the node, and therefore stays.
    pub(super) is_edited: bool,
    /// Name under which the configuration that was brought lies beside an edited one, if it says something new.
    pub(super) beside: Option<String>,
}

/// Returns whether a file that was brought is one that `enroll` makes for a node.
pub(super) fn is_enrolled(name: &str) -> bool {
    [CA, CERTIFICATE, KEY, ROSTER, VENUE].contains(&name) || CONFIGS.contains(&name)
}

/// Returns whether a file lies there because of the machine that has written the stick.
pub(super) fn is_leaving(name: &str) -> bool {
    name.starts_with('.') || ["Thumbs.db", "desktop.ini"].contains(&name)
}

/// Returns whether a configuration names a file.
pub(super) fn is_named(files: &Files, name: &str) -> bool {
    let quoted = [format!("\"{name}\""), format!("'{name}'")];
    let names_it = |config: &&str| {
        let text = files
            .get(*config)
            .and_then(|text| std::str::from_utf8(text).ok());
        text.is_some_and(|text| quoted.iter().any(|name| text.contains(name)))
    };
    CONFIGS.iter().any(names_it)
}

/// Returns what a node's folder is to hold: what is brought, and of its own what is not brought. A configuration that was
/// edited on the node (it is not what was brought last) stays, and a new one lies beside it.
pub(super) fn merged(brought: &Files, own: &Files, config: &str) -> MergedFiles {
    let (base, beside) = (format!(".{config}.accepted"), format!("{config}.new"));
    let mut files = own.clone();
    files.remove(&beside);
    files.extend(brought.clone());
    let (offered, last) = (brought.get(config), own.get(&base));
    let kept = own
        .get(config)
        .filter(|own| Some(*own) != offered && Some(*own) != last);
    let is_new = kept.is_some() && offered != last;
    if let Some(offered) = offered {
        files.insert(base, offered.clone());
        if is_new {
            files.insert(beside.clone(), offered.clone());
        } else if let (Some(_), Some(unread)) = (kept, own.get(&beside)) {
            files.insert(beside.clone(), unread.clone());
        }
    }
    if let Some(kept) = kept {
        files.insert(config.to_owned(), kept.clone());
    }
    MergedFiles {
        is_edited: kept.is_some(),
        beside: is_new.then_some(beside),
        files,
    }
}

/// Returns files to be written: only what everybody may know is open to everybody.
pub(super) fn new_files(files: &Files) -> Vec<NewFile> {
    let is_open =
        |name: &str| [CA, CERTIFICATE, ROSTER, VENUE].contains(&name) || name.ends_with(".toml");
    files
        .iter()
        .map(|(name, content)| match is_open(name) {
            true => NewFile::open(name, content.clone()),
            false => NewFile::private(name, content.clone()),
        })
        .collect()
}

/// Returns the numbers of a user and its group, of the text of /etc/passwd; `None` = there is no such user.
pub(super) fn user_in(passwd: &str, user: &str) -> Option<(u32, u32)> {
    passwd.lines().find_map(|line| {
        let mut fields = line.split(':');
        let (name, _, number, group) = (
            fields.next()?,
            fields.next()?,
            fields.next()?,
            fields.next()?,
        );
        (name == user).then_some((number.parse().ok()?, group.parse().ok()?))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: &str = "vehicle.toml";

    fn files(list: &[(&str, &str)]) -> Files {
        list.iter()
            .map(|(name, text)| ((*name).to_owned(), text.as_bytes().to_vec()))
            .collect()
    }

    fn check(brought: &str, own: &[(&str, &str)], expected: &[(&str, &str)]) {
        let brought = files(&[(CONFIG, brought), ("roster.txt", "2")]);
        let mut expected = files(expected);
        expected.insert("roster.txt".to_owned(), b"2".to_vec());
        assert_eq!(
            merged(&brought, &files(own), CONFIG).files,
            expected,
            "{own:?}"
        );
    }

    #[test]
    fn a_configuration_edited_on_the_node_stays_and_a_new_one_lies_beside_it() {
        let base = ".vehicle.toml.accepted";
        let new = "vehicle.toml.new";
        check("a", &[], &[(CONFIG, "a"), (base, "a")]);
        // Not edited: what is brought counts.
        let accepted = [(CONFIG, "a"), (base, "a"), ("roster.txt", "1")];
        check("b", &accepted, &[(CONFIG, "b"), (base, "b")]);
        // Edited, and nothing new is brought.
        let edited = [(CONFIG, "mine"), (base, "a"), ("mine.key", "k")];
        check(
            "a",
            &edited,
            &[(CONFIG, "mine"), (base, "a"), ("mine.key", "k")],
        );
        // Edited, and something new is brought, and brought again.
        let both = [(CONFIG, "mine"), (base, "b"), (new, "b"), ("mine.key", "k")];
        check("b", &edited, &both);
        check("b", &both, &both);
        // The edit was brought, so it is an edit no more.
        check("mine", &both[..3], &[(CONFIG, "mine"), (base, "mine")]);
        // Written by hand before anything was brought.
        check(
            "a",
            &[(CONFIG, "mine")],
            &[(CONFIG, "mine"), (base, "a"), (new, "a")],
        );
    }

    #[test]
    fn of_what_is_brought_counts_what_enroll_makes_and_what_a_configuration_names() {
        let brought = files(&[(CONFIG, "key = \"mavlink.key\"")]);
        for (name, is_taken) in [
            (CONFIG, true),
            ("key.pem", true),
            ("mavlink.key", true),
            ("link.key", false),
            ("photo.jpg", false),
            ("._key.pem", false),
        ] {
            let found = is_enrolled(name) || is_named(&brought, name);
            assert_eq!(found, is_taken, "{name}");
        }
        assert!(is_leaving("._key.pem") && is_leaving(".DS_Store") && !is_leaving("photo.jpg"));
    }

    #[test]
    fn only_what_everybody_may_know_is_open() {
        let names = [
            "ca.pem",
            "key.pem",
            "mavlink.key",
            "roster.txt",
            "vehicle.toml",
        ];
        let list: Vec<(&str, &str)> = names.iter().map(|name| (*name, "")).collect();
        let private: Vec<String> = new_files(&files(&list))
            .into_iter()
            .filter(|file| file.is_private)
            .map(|file| file.name)
            .collect();
        assert_eq!(private, ["key.pem", "mavlink.key"]);
    }

    #[test]
    fn a_user_is_found_by_its_whole_name() {
        let passwd = "root:x:0:0:root:/root:/bin/sh\ntomoswarm2:x:7:7::/:\ntomoswarm:x:998:997::/:/no\nbad:x:y:1::\n";
        for (user, expected) in [
            ("tomoswarm", Some((998, 997))),
            ("root", Some((0, 0))),
            ("tomo", None),
            ("bad", None),
        ] {
            assert_eq!(user_in(passwd, user), expected, "{user}");
        }
    }
}
