//! The roster: which certificates are allowed today, signed by the authority. A certificate that is not in it may do
//! nothing, whoever signed it. Reads no files.

use tomoswarm_proto::Sender;

use super::certificate::{Certificate, Fingerprint, from_hex, to_hex};
use super::name::CommonName;

const TITLE: &str = "tomoswarm roster 1";
const SIGNATURE: &str = "signature ";
/// The most certificates that a roster names, allowed and revoked.
const MOST_ENTRIES: usize = 10_000;

/// A certificate that is allowed.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct RosterEntry {
    /// The name in it.
    pub name: CommonName,
    /// Its serial number, hexadecimal.
    pub serial: String,
    /// Its fingerprint.
    pub fingerprint: Fingerprint,
}

/// Which certificates are allowed.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Roster {
    /// Which issue of the roster this is; the highest counts.
    pub issue: u64,
    /// Those that are allowed, at most one of a node, ascending by name.
    pub allowed: Vec<RosterEntry>,
    /// Those that were allowed once, ascending; their names are never given again.
    pub revoked: Vec<CommonName>,
}

/// Why a roster is refused.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum RosterError {
    /// The signature is missing or not the authority's.
    #[error("the roster is not signed by the authority of this swarm, or was changed afterwards")]
    Signature,
    /// A line makes no sense.
    #[error("line {line} of the roster makes no sense; expected {expected}")]
    Line {
        /// Number of the line, counted from 1.
        line: usize,
        /// What is expected there.
        expected: &'static str,
    },
    /// A newer one was in force here.
    #[error(
        "the roster is issue {found}, but issue {seen} was in force here already: copy the newest one"
    )]
    Old {
        /// Its issue.
        found: u64,
        /// The highest issue that this node has seen.
        seen: u64,
    },
    /// A node has a certificate already.
    #[error(
        "{name} is enrolled already; give --replace for a new certificate, which ends the old one"
    )]
    Duplicate {
        /// The certificate that it has.
        name: CommonName,
    },
    /// A node has no certificate.
    #[error("{node} is not enrolled; enrolled: {enrolled}")]
    Unknown {
        /// The name of the node.
        node: String,
        /// Who is enrolled.
        enrolled: String,
    },
    /// No further numbers are left.
    #[error("the roster is full")]
    Full,
}

impl Roster {
    /// Returns whether a file begins as a roster does, whoever has signed it.
    pub fn is_titled(file: &[u8]) -> bool {
        file.starts_with(TITLE.as_bytes())
    }

    /// Reads a roster that the authority has signed.
    ///
    /// # Errors
    /// It is not signed so, byte for byte, or makes no sense.
    pub fn verify(text: &str, authority: &Certificate) -> Result<Roster, RosterError> {
        let at = text.rfind(SIGNATURE).ok_or(RosterError::Signature)?;
        let (signed, last) = text.split_at(at);
        let signature = last
            .strip_prefix(SIGNATURE)
            .and_then(|rest| rest.strip_suffix('\n'));
        let signature = signature.and_then(from_hex).ok_or(RosterError::Signature)?;
        if !authority.has_signed(signed.as_bytes(), &signature) {
            return Err(RosterError::Signature);
        }
        parse(signed)
    }

    /// Checks that no newer issue was in force on a node before; `seen` is the highest that it has kept.
    ///
    /// # Errors
    /// A newer one was.
    pub fn check_not_older(&self, seen: Option<u64>) -> Result<(), RosterError> {
        match seen {
            Some(seen) if self.issue < seen => Err(RosterError::Old {
                found: self.issue,
                seen,
            }),
            Some(_) | None => Ok(()),
        }
    }

    /// Returns the certificate of a node that is allowed.
    pub fn of(&self, node: Sender) -> Option<&RosterEntry> {
        self.allowed.iter().find(|entry| entry.name.node == node)
    }

    /// Returns the name that the next certificate of a node gets: one that none had before.
    ///
    /// # Errors
    /// It has one that is allowed and not to be replaced; no numbers are left.
    pub fn next_name(&self, node: Sender, is_replaced: bool) -> Result<CommonName, RosterError> {
        if let Some(entry) = self.of(node).filter(|_| !is_replaced) {
            return Err(RosterError::Duplicate { name: entry.name });
        }
        let known = self
            .allowed
            .iter()
            .map(|entry| entry.name)
            .chain(self.revoked.iter().copied());
        let highest = known
            .filter(|name| name.node == node)
            .map(|name| name.issue)
            .max();
        let issue = highest
            .unwrap_or(0)
            .checked_add(1)
            .ok_or(RosterError::Full)?;
        Ok(CommonName { node, issue })
    }

    /// Returns the next issue, in which a certificate is allowed and the node's former one is not.
    ///
    /// # Errors
    /// The roster is full.
    pub fn admitting(&self, entry: RosterEntry) -> Result<Roster, RosterError> {
        let mut next = self.without(entry.name.node)?;
        next.allowed.push(entry);
        next.allowed.sort_by_key(|entry| entry.name);
        if next.allowed.len() + next.revoked.len() > MOST_ENTRIES {
            return Err(RosterError::Full);
        }
        Ok(next)
    }

    /// Returns the next issue, in which a node is not allowed.
    ///
    /// # Errors
    /// It was not allowed before.
    pub fn revoking(&self, node: Sender) -> Result<Roster, RosterError> {
        if self.of(node).is_some() {
            return self.without(node);
        }
        let names: Vec<String> = self
            .allowed
            .iter()
            .map(|entry| CommonName::node_name(entry.name.node))
            .collect();
        let enrolled = if names.is_empty() {
            "nobody".to_owned()
        } else {
            names.join(", ")
        };
        Err(RosterError::Unknown {
            node: CommonName::node_name(node),
            enrolled,
        })
    }

    fn without(&self, node: Sender) -> Result<Roster, RosterError> {
        let mut next = self.clone();
        next.issue = self.issue.checked_add(1).ok_or(RosterError::Full)?;
        let (gone, kept) = next
            .allowed
            .into_iter()
            .partition(|entry| entry.name.node == node);
        next.allowed = kept;
        let gone: Vec<RosterEntry> = gone;
        next.revoked.extend(gone.iter().map(|entry| entry.name));
        next.revoked.sort();
        Ok(next)
    }

    /// Returns its text without a signature; what is signed.
    pub(super) fn unsigned_text(&self) -> String {
        let mut text = format!("{TITLE}\nissue {}\n", self.issue);
        for RosterEntry {
            name,
            serial,
            fingerprint,
        } in &self.allowed
        {
            text += &format!("allow {name} {serial} {fingerprint}\n");
        }
        for name in &self.revoked {
            text += &format!("revoked {name}\n");
        }
        text
    }

    /// Puts a signature under the text.
    pub(super) fn with_signature(text: &str, signature: &[u8]) -> String {
        format!("{text}{SIGNATURE}{}\n", to_hex(signature))
    }
}

fn parse(text: &str) -> Result<Roster, RosterError> {
    let wrong = |line: usize, expected| RosterError::Line { line, expected };
    let mut lines = text.lines().zip(1..);
    if lines.next() != Some((TITLE, 1)) {
        return Err(wrong(1, TITLE));
    }
    let issue = lines
        .next()
        .and_then(|(line, _)| line.strip_prefix("issue ")?.parse().ok());
    let issue = issue.ok_or(wrong(2, "issue NUMBER"))?;
    let mut roster = Roster {
        issue,
        ..Roster::default()
    };
    for (line, number) in lines.take(MOST_ENTRIES + 1) {
        let words: Vec<&str> = line.split(' ').collect();
        let understood = match words[..] {
            ["allow", name, serial, fingerprint] => {
                let entry = entry_of(name, serial, fingerprint);
                let entry = entry.filter(|entry| roster.of(entry.name.node).is_none());
                entry.map(|entry| roster.allowed.push(entry))
            }
            ["revoked", name] => name_of(name).map(|name| roster.revoked.push(name)),
            _ => None,
        };
        understood.ok_or(wrong(
            number,
            "allow NAME SERIAL FINGERPRINT, one of a node, or revoked NAME",
        ))?;
    }
    Ok(roster)
}

fn entry_of(name: &str, serial: &str, fingerprint: &str) -> Option<RosterEntry> {
    from_hex(serial).filter(|bytes| !bytes.is_empty())?;
    let fingerprint = Fingerprint::from_hex(fingerprint)?;
    Some(RosterEntry {
        name: name_of(name)?,
        serial: serial.to_owned(),
        fingerprint,
    })
}

/// Reads a name. An operator that was enrolled before operators had numbers is operator 1: the swarm is read, and the
/// operator needs a new certificate, since the old one bears another name.
fn name_of(text: &str) -> Option<CommonName> {
    match text.strip_prefix("operator.") {
        Some(issue) => format!("operator-1.{issue}").parse().ok(),
        None => text.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::OperatorId;

    const OPERATOR: Sender = Sender::Operator(OperatorId(1));

    #[test]
    fn an_operator_enrolled_before_operators_had_numbers_is_the_first() {
        let fingerprint = "ab".repeat(32);
        let text =
            format!("{TITLE}\nissue 4\nallow operator.2 0102 {fingerprint}\nrevoked operator.1\n");
        let roster = parse(&text).unwrap();
        assert_eq!(
            roster.of(OPERATOR).unwrap().name.to_string(),
            "operator-1.2"
        );
        assert_eq!(roster.revoked[0].to_string(), "operator-1.1");
        assert_eq!(
            roster.next_name(OPERATOR, true).unwrap().to_string(),
            "operator-1.3"
        );
    }
}
