//! Which program this is, as nodes say it of themselves when they greet and as `tomoswarm --version` does.
//!
//! A package is built with the variable `TOMOSWARM_BUILD` (`deploy/build-deb` sets it, and nothing else does), so that two
//! programs of different commits are told apart; every other build says the version alone, and so is the same wherever and
//! whenever it is built.

/// Version of this software. In a simulation all nodes say this one: what a run does is the same in every build.
pub const RELEASE: &str = env!("CARGO_PKG_VERSION");

/// Version of this very program, such as `0.1.0+git1700.abcdef0`; [`RELEASE`] where its build was not told one.
pub const SOFTWARE: &str = software(option_env!("TOMOSWARM_BUILD"));

// A greeting with a longer one is refused by everyone.
const _: () = assert!(
    SOFTWARE.len() <= LONGEST,
    "TOMOSWARM_BUILD is longer than 64 bytes"
);

/// The longest version that a greeting may say, bytes.
const LONGEST: usize = 64;

/// Returns what a program says that was built with this variable; an empty one counts as none.
const fn software(build: Option<&'static str>) -> &'static str {
    match build {
        Some(build) if !build.is_empty() => build,
        Some(_) | None => RELEASE,
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{Boot, Hello, Message, Sender};

    use super::*;

    #[test]
    fn a_program_that_is_built_for_a_package_says_of_which_commit_it_is_and_any_other_its_version()
    {
        assert_eq!(
            software(Some("0.1.0+git1700.abcdef0")),
            "0.1.0+git1700.abcdef0"
        );
        assert_eq!(software(Some("")), RELEASE);
        assert_eq!(software(None), RELEASE);
    }

    #[test]
    fn the_longest_version_is_that_of_a_greeting() {
        let check = |length: usize| {
            let hello = Hello {
                software: "x".repeat(length),
                ..Hello::asking(Sender::Ground, Boot(1), 5, 1)
            };
            Message::Hello(hello).check().is_ok()
        };
        assert!(check(LONGEST) && !check(LONGEST + 1));
    }
}
