//! Whether the program that runs is still the one that is installed. A package replaces the file of a program and leaves the
//! program running, so after an upgrade a node goes on with the former one until it is started anew.
//!
//! Linux shows it: the link `/proc/self/exe` then ends with ` (deleted)`. Elsewhere nothing is known, and nothing is said.

use std::path::Path;

use super::mailbox::Troubles;

/// What the running program is.
const OWN_PROGRAM: &str = "/proc/self/exe";
/// How the kernel marks a file that has no name any more.
const REPLACED: &str = " (deleted)";

/// Tells whether the node runs an older program than the one that is installed.
pub(super) fn watch_program(troubles: &Troubles) {
    match trouble_of(Path::new(OWN_PROGRAM)) {
        Some(trouble) => troubles.raise("program", trouble),
        None => troubles.clear("program"),
    }
}

fn trouble_of(process: &Path) -> Option<String> {
    // Where there is no such link nothing is known.
    let link = std::fs::read_link(process).ok()?;
    trouble(link.to_str()?, |path| path.exists())
}

/// Returns what is wrong, in words; `link` is what the kernel says of the program, `exists` whether a file is there now.
fn trouble(link: &str, exists: impl Fn(&Path) -> bool) -> Option<String> {
    let program = link.strip_suffix(REPLACED)?;
    // A program may be called like that.
    if exists(Path::new(link)) {
        return None;
    }
    Some(match exists(Path::new(program)) {
        true => format!(
            "it runs an older program than is installed: {program} was replaced; start it anew when it stands"
        ),
        false => format!("it runs a program that is not installed any more: {program} was removed"),
    })
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;

    #[test]
    fn a_program_whose_file_was_replaced_or_removed_says_so() {
        const PROGRAM: &str = "/usr/bin/tomoswarm";
        let check = |link: &str, there: &[&str], expected: Option<&str>| {
            let exists = |path: &Path| there.iter().any(|name| path == Path::new(name));
            let found = trouble(link, exists);
            let is_right = match (&found, expected) {
                (Some(found), Some(expected)) => found.starts_with(expected),
                (None, None) => true,
                (Some(_), None) | (None, Some(_)) => false,
            };
            assert!(is_right, "{link}, {there:?}: {found:?}");
        };
        let deleted = "/usr/bin/tomoswarm (deleted)";
        check(PROGRAM, &[PROGRAM], None);
        check(PROGRAM, &[], None);
        let older =
            "it runs an older program than is installed: /usr/bin/tomoswarm was replaced; start";
        check(deleted, &[PROGRAM], Some(older));
        let gone = "it runs a program that is not installed any more: /usr/bin/tomoswarm was";
        check(deleted, &[], Some(gone));
        check(deleted, &[deleted], None);
        check("/opt/a (deleted) b", &[], None);
        check("", &[], None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn of_a_process_it_is_seen_when_its_program_is_replaced_and_when_it_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let [program, newer] = ["sleep", "newer"].map(|name| folder.path().join(name));
        // By a process of its own: a file that is being written, here or in what a test has begun meanwhile, does not run.
        let copy = |to: &Path| Command::new("cp").arg("/bin/sleep").arg(to).status();
        assert!(copy(&program).unwrap().success() && copy(&newer).unwrap().success());
        let mut process = Command::new(&program).arg("60").spawn().unwrap();
        let link = format!("/proc/{}/exe", process.id());
        let said = || trouble_of(Path::new(&link));
        let before = said();
        std::fs::rename(&newer, &program).unwrap();
        let replaced = said();
        std::fs::remove_file(&program).unwrap();
        let removed = said();
        process.kill().unwrap();
        process.wait().unwrap();
        assert_eq!(before, None);
        assert!(
            replaced
                .unwrap()
                .contains("older program than is installed")
        );
        assert!(removed.unwrap().contains("was removed"));
        assert_eq!(said(), None, "there is no such process any more");
    }
}
