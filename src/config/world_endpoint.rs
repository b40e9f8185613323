//! Where a process that simulates the world listens, and the word that lets drivers into it.

use core::net::SocketAddr;

use super::keys::{Form, KeyEntry, Keyed, Keys, quoted};
use super::section::Section;

/// The shortest secret between a simulated driver and its world, characters.
const SHORTEST_TOKEN: usize = 8;
const LONGEST_TOKEN: usize = 128;
const TOKEN_RULE: &str = "8 to 128 letters, digits, - and _ are needed";

/// The address and token of the process that simulates the world.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct WorldEndpoint {
    /// Where it listens; always on this machine.
    pub connect: SocketAddr,
    /// What a driver says to be let in.
    pub token: String,
}

impl Keyed for WorldEndpoint {
    fn keys(&mut self, to: &mut dyn Keys) {
        let WorldEndpoint { connect, token } = self;
        let left_out = "needed";
        let means = "where it listens, an address of this machine";
        to.form(
            &mut WorldAddress(connect),
            KeyEntry {
                name: "connect",
                left_out,
                means,
            },
        );
        let means = "what a driver says to be let in, the world's own word: 8 to 128 letters, digits, `-`, `_`";
        to.form(
            &mut Token(token),
            KeyEntry {
                name: "token",
                left_out,
                means,
            },
        );
    }
}

/// Where the simulated world listens.
struct WorldAddress<'a>(&'a mut SocketAddr);

impl Form for WorldAddress<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(quoted(&self.0.to_string()))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let rule = "an address of this machine such as \"127.0.0.1:7500\" is needed";
        section.require(key, rule);
        let Some(text) = section.text(key) else {
            return;
        };
        let address: Option<SocketAddr> = text.parse().ok();
        let wrong = match address {
            None => "is no address with a port",
            Some(address) if !address.ip().is_loopback() => "leaves this machine",
            Some(address) if address.port() == 0 => "has port 0",
            Some(address) => {
                *self.0 = address;
                return;
            }
        };
        section.refuse(key, wrong, rule);
    }
}

/// Reads a word that lets drivers into the simulated world.
///
/// # Errors
/// It is none; the text says what is expected.
pub fn world_token(text: &str) -> Result<String, String> {
    let is_plain = text
        .bytes()
        .all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_'));
    match (SHORTEST_TOKEN..=LONGEST_TOKEN).contains(&text.len()) && is_plain {
        true => Ok(text.to_owned()),
        false => Err(TOKEN_RULE.to_owned()),
    }
}

/// The word that lets a driver into the simulated world.
struct Token<'a>(&'a mut String);

impl Form for Token<'_> {
    fn to_toml(&self) -> Option<String> {
        Some(quoted(self.0))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let rule = format!("{TOKEN_RULE}, the same as the world was given");
        section.require(key, &rule);
        let Some(token) = section.text(key) else {
            return;
        };
        match world_token(&token) {
            Ok(token) => *self.0 = token,
            Err(_) => section.refuse(key, "is no such word", &rule),
        }
    }
}
