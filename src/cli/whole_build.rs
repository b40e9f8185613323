//! What a build without the network says about what it leaves out: which commands and options exist in the whole build
//! only, and how that is made. Adds nothing to the whole build.

use clap::error::{ContextKind, ContextValue, ErrorKind};

/// Commands that only the whole build has.
const COMMANDS: [&str; 14] = [
    "vehicle",
    "ground",
    "world",
    "mock-autopilot",
    "enroll",
    "export",
    "order",
    "status",
    "tap",
    "preflight",
    "parameters",
    "fix",
    "xbee",
    "replay",
];

/// Options that only the whole build has, with their command.
const OPTIONS: [(&str, &str); 3] = [
    ("sim", "--record"),
    ("sim", "--live"),
    ("sim", "--topology"),
];

/// Returns what the help of a build without the network ends with.
pub(super) fn note() -> String {
    format!(
        "This build has no network and no devices. `cargo build --release` builds everything: also the commands\n{}, and `sim --live` and `sim --record`.",
        COMMANDS.join(", ")
    )
}

/// Returns what to say when the command line asks for something that only the whole build has; `None` when it is wrong
/// in any build.
pub(super) fn explain(error: &clap::Error) -> Option<String> {
    let word = |kind| match error.get(kind) {
        Some(ContextValue::String(word)) => Some(word.as_str()),
        _ => None,
    };
    let asked = match error.kind() {
        ErrorKind::InvalidSubcommand => {
            let word = word(ContextKind::InvalidSubcommand)?;
            COMMANDS.iter().find(|known| **known == word)?.to_string()
        }
        ErrorKind::UnknownArgument => {
            let word = word(ContextKind::InvalidArg)?;
            let (command, option) = OPTIONS.iter().find(|(_, option)| *option == word)?;
            format!("{command} {option}")
        }
        _ => return None,
    };
    Some(format!(
        "`tomoswarm {asked}` is not in this build, which leaves out the network and devices; `cargo build --release` builds everything"
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
    fn what_is_listed_exists_in_the_whole_build_and_in_no_other() {
        let cli = Cli::command();
        for name in COMMANDS {
            let exists = cli.find_subcommand(name).is_some();
            assert_eq!(exists, cfg!(feature = "net"), "{name}");
        }
        for (command, option) in OPTIONS {
            let exists = options_of(cli.find_subcommand(command).unwrap()).contains(option);
            assert_eq!(exists, cfg!(feature = "net"), "{command} {option}");
        }
    }

    /// Together with the test above: a command that is made for the whole build alone and not listed is found by one of
    /// the two builds that are tested.
    #[test]
    fn every_command_is_listed_or_in_every_build() {
        let core = ["sim", "image", "plan", "check", "experiment", "scene"];
        let all: BTreeSet<_> = Cli::command()
            .get_subcommands()
            .map(|command| command.get_name().to_owned())
            .collect();
        let listed = core.iter().chain(&COMMANDS).map(ToString::to_string);
        assert!(all.is_subset(&listed.collect()), "{all:?}");
    }

    #[test]
    fn only_what_is_left_out_is_explained() {
        let explained = |arguments: &[&str]| {
            let line = ["tomoswarm"].iter().chain(arguments);
            Cli::try_parse_from(line).err().as_ref().and_then(explain)
        };
        for (arguments, asked) in [
            (&["order", "operator.toml", "hold"][..], "order"),
            (&["sim", "castle", "--live", "-n", "8"], "sim --live"),
            (&["sim", "--topology", "star"], "sim --topology"),
            (&["sim", "--record"], "sim --record"),
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
            &["--help"],
        ] {
            assert_eq!(explained(arguments), None, "{arguments:?}");
        }
    }
}
