//! Says whom a node seeks as long as it has reached nobody, and why in vain, as far as a connection of its own tells: a name
//! that is unknown, a port that nobody serves, a host that is silent. It tries each endpoint once on a thread of its own,
//! changes nothing, and falls silent when a first link stands. Links are the bus library's, which goes on seeking by itself.

use std::io::ErrorKind;
use std::net::{TcpStream, ToSocketAddrs};
use std::thread::JoinHandle;
use std::time::Duration;

use super::bus::BusSettings;
use crate::time::Time;

/// After so long a node that has reached nobody says so first, and then every so often.
const FIRST_AFTER: Duration = Duration::from_secs(5);
const EVERY: Duration = Duration::from_secs(30);
/// An address must answer within this time.
const ANSWERS_WITHIN: Duration = Duration::from_secs(2);

/// Watches whether a first link stands.
#[derive(Debug)]
pub(super) struct ReachWatch {
    connect: Vec<String>,
    listen: Vec<String>,
    /// When it says next that nobody is reached; `None` = somebody is, or there is nothing more to say.
    due: Option<Time>,
    is_reached: bool,
    attempt: Option<JoinHandle<()>>,
}

impl ReachWatch {
    /// Begins to watch a node with these endpoints.
    pub(super) fn new(now: Time, settings: &BusSettings) -> ReachWatch {
        ReachWatch {
            connect: settings.connect.clone(),
            listen: settings.listen.clone(),
            due: Some(now + FIRST_AFTER),
            is_reached: false,
            attempt: None,
        }
    }

    /// Returns whether somebody was ever reached; until then it logs every 30 s who is sought in vain.
    pub(super) fn look(&mut self, now: Time, is_linked: bool) -> bool {
        self.is_reached |= is_linked;
        if !self.is_reached && self.due.is_some_and(|due| due <= now) {
            self.report(now);
        }
        self.is_reached
    }

    /// Returns whether somebody was reached already.
    pub(super) fn is_reached(&self) -> bool {
        self.is_reached
    }

    fn report(&mut self, now: Time) {
        if self.connect.is_empty() {
            self.due = None;
            let listen = self.listen.join(", ");
            tracing::info!("nobody has come yet; it listens on {listen}, and seeks nobody itself");
            return;
        }
        self.due = Some(now + EVERY);
        if self.attempt.as_ref().is_some_and(|of| !of.is_finished()) {
            return;
        }
        let endpoints = self.connect.clone();
        let attempt = move || tracing::warn!("reaches nobody yet: {}", reasons(&endpoints));
        // Without a thread the next time serves.
        let builder = std::thread::Builder::new().name("reach".to_owned());
        self.attempt = builder.spawn(attempt).ok();
    }
}

/// Returns of each endpoint why it is not reached, as one line.
fn reasons(endpoints: &[String]) -> String {
    let all: Vec<String> = endpoints
        .iter()
        .map(|endpoint| format!("{endpoint}: {}", reason(endpoint)))
        .collect();
    all.join("; ")
}

/// Tries an endpoint (`tcp/HOST:PORT`, `tls/HOST:PORT`); returns what comes of it.
fn reason(endpoint: &str) -> String {
    let (protocol, address) = endpoint.split_once('/').unwrap_or(("", endpoint));
    let addresses = match address.to_socket_addrs() {
        Ok(addresses) => addresses,
        Err(error) => return format!("its host cannot be resolved ({error})"),
    };
    let mut reason = "its host has no address".to_owned();
    for address in addresses {
        reason = match TcpStream::connect_timeout(&address, ANSWERS_WITHIN) {
            Ok(_) if protocol == "tls" => {
                return "somebody listens there, but no link stands: with certificates of another authority, or no node of this \
                        swarm"
                    .to_owned();
            }
            Ok(_) => {
                return "somebody listens there, but no link stands: no node of this swarm, or one with certificates".to_owned();
            }
            Err(error) if error.kind() == ErrorKind::TimedOut => {
                format!("no answer within {} s", ANSWERS_WITHIN.as_secs())
            }
            Err(error) if error.kind() == ErrorKind::ConnectionRefused => {
                "nobody listens there (connection refused)".to_owned()
            }
            Err(error) => error.to_string(),
        };
    }
    reason
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use super::*;

    #[test]
    fn an_endpoint_says_why_it_is_not_reached() {
        let taken = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = taken.local_addr().unwrap();
        let open = reason(&format!("tls/{address}"));
        assert!(open.contains("another authority"), "{open}");
        drop(taken);
        let closed = reasons(&[
            format!("tcp/{address}"),
            "tcp/nowhere.invalid:7447".to_owned(),
        ]);
        let refused = format!("tcp/{address}: nobody listens there (connection refused); ");
        assert!(closed.starts_with(&refused), "{closed}");
        let unknown = "tcp/nowhere.invalid:7447: its host cannot be resolved";
        assert!(closed.contains(unknown), "{closed}");
    }

    #[test]
    fn a_node_that_reaches_nobody_says_so_after_a_while_and_again_until_a_link_stands() {
        let at = |seconds| Time::ZERO + Duration::from_secs(seconds);
        let mut watch = ReachWatch {
            connect: vec!["tcp/127.0.0.1:1".to_owned()],
            listen: Vec::new(),
            due: Some(at(5)),
            is_reached: false,
            attempt: None,
        };
        assert!(!watch.look(at(4), false) && watch.attempt.is_none());
        assert!(!watch.look(at(5), false));
        assert!(watch.attempt.take().is_some(), "it says so");
        assert!(!watch.look(at(34), false) && watch.attempt.is_none());
        assert!(!watch.look(at(35), false));
        assert!(watch.attempt.take().is_some(), "and again");
        assert!(watch.look(at(36), true));
        assert!(watch.look(at(70), false), "it was reached once");
        assert!(watch.attempt.is_none());
    }
}
