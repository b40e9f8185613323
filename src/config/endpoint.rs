//! Where a node listens or connects to: `tcp/HOST:PORT` or `tls/HOST:PORT`. Resolves no names and opens nothing.

use core::net::{IpAddr, Ipv6Addr};
use std::fmt;

/// How an endpoint speaks.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Protocol {
    /// Plain TCP: anyone may read and write.
    Tcp,
    /// TLS with certificates on both sides.
    Tls,
}

/// A host and a port, and how is spoken there.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Endpoint {
    /// How is spoken.
    pub protocol: Protocol,
    /// An IP address (IPv6 without its brackets) or a host name.
    pub host: String,
    /// The port; 0 is a free one, for listening only.
    pub port: u16,
}

/// Why a text is no endpoint.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum EndpointError {
    /// It begins with neither protocol.
    #[error("begins with neither tcp/ nor tls/")]
    Protocol,
    /// There is no port behind a colon.
    #[error("has no port from 0 to 65535 behind a colon")]
    Port,
    /// The host is neither an address nor a name.
    #[error("names no host: an IP address (IPv6 in brackets) or a host name is needed")]
    Host,
}

impl Endpoint {
    /// Reads an endpoint.
    ///
    /// # Errors
    /// What is wrong with the text.
    pub fn parse(text: &str) -> Result<Endpoint, EndpointError> {
        let (protocol, place) = match text.split_once('/') {
            Some(("tcp", place)) => (Protocol::Tcp, place),
            Some(("tls", place)) => (Protocol::Tls, place),
            Some(_) | None => return Err(EndpointError::Protocol),
        };
        let (host, port) = place.rsplit_once(':').ok_or(EndpointError::Port)?;
        let is_number = !port.is_empty() && port.bytes().all(|byte| byte.is_ascii_digit());
        let port = port
            .parse()
            .ok()
            .filter(|_| is_number)
            .ok_or(EndpointError::Port)?;
        let in_brackets = host
            .strip_prefix('[')
            .and_then(|host| host.strip_suffix(']'));
        let host = match in_brackets {
            Some(inner) if inner.parse::<Ipv6Addr>().is_ok() => inner,
            Some(_) => return Err(EndpointError::Host),
            None if is_host(host) => host,
            None => return Err(EndpointError::Host),
        };
        Ok(Endpoint {
            protocol,
            host: host.to_owned(),
            port,
        })
    }

    /// Returns whether nothing of it leaves this machine.
    pub fn is_loopback(&self) -> bool {
        let address = self.host.parse::<IpAddr>();
        address.map_or_else(
            |_| self.host.eq_ignore_ascii_case("localhost"),
            |address| address.is_loopback(),
        )
    }
}

/// Returns whether a text is an IPv4 address or a name that a host may have.
///
/// Names of digits and dots only are refused unless they are addresses: "127.0.1" is a mistake.
pub fn is_host(text: &str) -> bool {
    let is_label = |label: &str| {
        let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-';
        (1..=63).contains(&label.len()) && label.bytes().all(is_plain) && !label.starts_with('-')
    };
    let is_like_an_address = text
        .bytes()
        .all(|byte| byte.is_ascii_digit() || byte == b'.');
    if is_like_an_address {
        return text.parse::<core::net::Ipv4Addr>().is_ok();
    }
    text.len() <= 253 && text.split('.').all(is_label)
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let protocol = match self.protocol {
            Protocol::Tcp => "tcp",
            Protocol::Tls => "tls",
        };
        let Endpoint { host, port, .. } = self;
        match host.contains(':') {
            true => write!(f, "{protocol}/[{host}]:{port}"),
            false => write!(f, "{protocol}/{host}:{port}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expected: Result<(Protocol, &str, u16, bool), EndpointError>) {
        let got = Endpoint::parse(text);
        let plain = got
            .clone()
            .map(|e| (e.protocol, e.host.clone(), e.port, e.is_loopback()));
        let expected =
            expected.map(|(protocol, host, port, here)| (protocol, host.to_owned(), port, here));
        assert_eq!(plain, expected, "{text}");
        if let Ok(endpoint) = got {
            assert_eq!(endpoint.to_string(), text);
        }
    }

    #[test]
    fn an_endpoint_is_a_protocol_a_host_and_a_port() {
        check(
            "tcp/127.0.0.1:7447",
            Ok((Protocol::Tcp, "127.0.0.1", 7447, true)),
        );
        check("tls/127.9.9.9:0", Ok((Protocol::Tls, "127.9.9.9", 0, true)));
        check("tls/[::1]:65535", Ok((Protocol::Tls, "::1", 65535, true)));
        check("tcp/localhost:1", Ok((Protocol::Tcp, "localhost", 1, true)));
        check("tcp/[fe80::1]:1", Ok((Protocol::Tcp, "fe80::1", 1, false)));
        check("tcp/0.0.0.0:1", Ok((Protocol::Tcp, "0.0.0.0", 1, false)));
        check(
            "tls/ground-1.local:7447",
            Ok((Protocol::Tls, "ground-1.local", 7447, false)),
        );
        check(
            "tcp/localhost.evil.org:1",
            Ok((Protocol::Tcp, "localhost.evil.org", 1, false)),
        );
    }

    #[test]
    fn what_is_no_endpoint_is_refused_with_its_reason() {
        for text in [
            "",
            "127.0.0.1:1",
            "udp/127.0.0.1:1",
            "TCP/127.0.0.1:1",
            "tcp:127.0.0.1:1",
        ] {
            check(text, Err(EndpointError::Protocol));
        }
        for text in [
            "tcp/",
            "tcp/host",
            "tcp/host:",
            "tcp/host:65536",
            "tcp/host:+1",
            "tcp/host:-1",
            "tcp/a:1 ",
        ] {
            check(text, Err(EndpointError::Port));
        }
        for text in [
            "tcp/:1",
            "tcp/::1:1",
            "tcp/[::1:1",
            "tcp/[127.0.0.1]:1",
            "tcp/127.0.1:1",
            "tcp/a..b:1",
            "tcp/a b:1",
        ] {
            check(text, Err(EndpointError::Host));
        }
        for text in [
            "tcp/a?b:1",
            "tcp/-a:1",
            "tcp/a#b:1",
            "tcp/a/b:1",
            "tcp/ä:1",
            "tcp/[]:1",
        ] {
            check(text, Err(EndpointError::Host));
        }
    }
}
