//! What a smaller build says about what it leaves out: one without the network, and one for vehicles alone. Which commands and
//! options exist in the whole build only, and how that is made. Adds nothing to the whole build.

use clap::error::{ContextKind, ContextValue, ErrorKind};

/// Whether this build is for vehicles alone.
const IS_FOR_VEHICLES: bool = cfg!(all(feature = "vehicle", not(feature = "whole")));

/// Commands that a build for vehicles alone has not, beside those below; all others have them.
const WITHOUT_VEHICLES: [&str; 5] = ["sim", "image", "plan", "experiment", "scene"];

/// Commands that a build for vehicles alone has, beside `check`.
const OF_VEHICLES: [&str; 4] = ["vehicle", "accept", "parameters", "xbee"];

/// Commands that a build without the network has not.
const COMMANDS: [&str; 16] = [
    "vehicle",
    "ground",
    "world",
    "mock-autopilot",
    "enroll",
    "accept",
    "export",
    "order",
    "dash",
    "status",
    "tap",
    "preflight",
    "parameters",
    "fix",
    "xbee",
    "replay",
];

/// Options that only the whole build has, with their command.
const OPTIONS: [(&str, &str); 6] = [
    ("sim", "--record"),
    ("sim", "--live"),
    ("sim", "--topology"),
    ("sim", "--dash"),
    ("sim", "--port"),
    ("check", "--devices"),
];

/// Returns what the help of a smaller build ends with; `None` = this is the whole one.
pub(super) fn note() -> Option<String> {
    if IS_FOR_VEHICLES {
        return Some(format!(
            "This build is for vehicles alone. {WHOLE} builds everything: also the commands\n{}.",
            left_out().join(", ")
        ));
    }
    (!cfg!(feature = "net")).then(|| format!(
        "This build has no network and no devices. {WHOLE} builds everything: also the commands\n{}, and `sim --live` and `sim --record`.",
        left_out().join(", ")
    ))
}

const WHOLE: &str = "`cargo build --release`";

/// Returns the commands that this build has not.
fn left_out() -> Vec<&'static str> {
    let is_left_out = |name: &&str| match IS_FOR_VEHICLES {
        true => !OF_VEHICLES.contains(name),
        false => !cfg!(feature = "net") && !WITHOUT_VEHICLES.contains(name),
    };
    WITHOUT_VEHICLES
        .into_iter()
        .chain(COMMANDS)
        .filter(is_left_out)
        .collect()
}

/// Returns what to say when a command line, the program's name first, asks for something that only the whole build has;
/// `None` when it is wrong in any build.
pub(super) fn explain(error: &clap::Error, line: &[String]) -> Option<String> {
    let word = |kind| match error.get(kind) {
        Some(ContextValue::String(word)) => Some(word.as_str()),
        _ => None,
    };
    let asked = match error.kind() {
        ErrorKind::InvalidSubcommand => {
            let word = word(ContextKind::InvalidSubcommand)?;
            left_out()
                .into_iter()
                .find(|known| *known == word)?
                .to_owned()
        }
        ErrorKind::UnknownArgument => {
            let word = word(ContextKind::InvalidArg)?;
            let is_asked = |(command, option): &&(&str, &str)| {
                *option == word && line.get(1).is_some_and(|asked| asked == command)
            };
            let (command, option) = OPTIONS.iter().find(is_asked)?;
            format!("{command} {option}")
        }
        _ => return None,
    };
    let kind = match IS_FOR_VEHICLES {
        true => "is for vehicles alone",
        false => "leaves out the network and devices",
    };
    Some(format!(
        "`tomoswarm {asked}` is not in this build, which {kind}; {WHOLE} builds everything"
    ))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use clap::{CommandFactory, Parser};

    use super::*;
    use crate::cli::Cli;

    fn options_of(command: &clap::Command) -> BTreeSet<String> {
        let long = |argument: &clap::Arg| Some(format!("--{}", argument.get_long()?));
        command.get_arguments().filter_map(long).collect()
    }

    #[test]
    fn what_is_left_out_is_missing_and_all_else_exists() {
        let cli = Cli::command();
        for name in WITHOUT_VEHICLES.into_iter().chain(COMMANDS) {
            let exists = cli.find_subcommand(name).is_some();
            assert_eq!(exists, !left_out().contains(&name), "{name}");
        }
        for (command, option) in OPTIONS {
            if let Some(command) = cli.find_subcommand(command) {
                let exists = options_of(command).contains(option);
                assert_eq!(exists, cfg!(feature = "net"), "{command} {option}");
            }
        }
    }

    /// Together with the test above: a command that is made for the whole build alone and not listed is found by one of
    /// the two builds that are tested.
    #[test]
    fn every_command_is_listed_or_in_every_build() {
        let all: BTreeSet<_> = Cli::command()
            .get_subcommands()
            .filter(|command| !command.is_hide_set())
            .map(|command| command.get_name().to_owned())
            .collect();
        let listed = ["check"].iter().chain(&WITHOUT_VEHICLES).chain(&COMMANDS);
        assert!(
            all.is_subset(&listed.map(ToString::to_string).collect()),
            "{all:?}"
        );
    }

    #[test]
    fn only_what_is_left_out_is_explained() {
        let explained = |arguments: &[&str]| {
            let line = ["tomoswarm"].iter().chain(arguments);
            let line: Vec<String> = line.map(ToString::to_string).collect();
            let error = Cli::try_parse_from(&line).err()?;
            explain(&error, &line)
        };
        for (arguments, asked) in [
            (&["order", "operator.toml", "hold"][..], "order"),
            (&["sim", "castle", "--live", "-n", "8"], "sim --live"),
            (&["sim", "--topology", "star"], "sim --topology"),
            (&["sim", "--record"], "sim --record"),
            (&["sim", "castle", "--dash"], "sim --dash"),
            (&["check", "--devices", "vehicle.toml"], "check --devices"),
        ] {
            let text = explained(arguments);
            let shown = text
                .as_ref()
                .is_some_and(|text| text.contains(&format!("`tomoswarm {asked}`")));
            assert_eq!(shown, cfg!(not(feature = "net")), "{arguments:?}: {text:?}");
        }
        for arguments in [
            &["ordre"][..],
            &["sim", "--liv"],
            &["plan", "--nothing"],
            &["plan", "--dash"],
            &["check", "--record"],
            &["--help"],
        ] {
            assert_eq!(explained(arguments), None, "{arguments:?}");
        }
    }
}
