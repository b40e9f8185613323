//! What a node reads of its certificates before it joins: every file checked against the others, so that a mistake is
//! said at the start and not as a connection that never comes about.

use std::path::{Path, PathBuf};

use rcgen::KeyPair;
use tomoswarm_proto::Sender;

use super::certificate::{Certificate, CertificateError};
use super::folder::{has_modes, is_open_to_others, read_limited};
use super::name::CommonName;
use super::roster::{Roster, RosterError};
use crate::config::Identity;

/// What a node knows of itself and the others once its files are checked.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Trusted {
    /// The name in this node's certificate.
    pub own: CommonName,
    /// Who is allowed.
    pub roster: Roster,
}

/// What a file of a node is needed as.
const ENROLLED: &str = "`tomoswarm enroll` writes it, for the user of the service";

/// Why a node may not join with its files.
#[derive(Debug, thiserror::Error)]
pub enum TrustError {
    /// A file cannot be read.
    #[error("{}: cannot be read: {source}; {needed}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
        /// What is needed there.
        needed: &'static str,
    },
    /// A certificate is refused.
    #[error("{}: the certificate {source}", path.display())]
    Certificate {
        /// The file.
        path: PathBuf,
        /// Why.
        source: CertificateError,
    },
    /// The roster is refused.
    #[error("{}: {source}", path.display())]
    Roster {
        /// The file.
        path: PathBuf,
        /// Why.
        source: RosterError,
    },
    /// The certificate is that of another node.
    #[error("{}: the certificate is of \"{found}\", not of {expected}", path.display())]
    OtherNode {
        /// The file.
        path: PathBuf,
        /// The name in it.
        found: String,
        /// The node that it should be of.
        expected: String,
    },
    /// The certificate was replaced or revoked, or never allowed.
    #[error("{}: {name} is not in the roster (issue {issue}): it was replaced or revoked; enrol this node again", path.display())]
    NotAllowed {
        /// The file.
        path: PathBuf,
        /// The name in it.
        name: CommonName,
        /// The issue of the roster.
        issue: u64,
    },
    /// What was kept of the rosters seen is damaged.
    #[error("{}: `{text}` is no issue of a roster; write the highest issue used so far into it", path.display())]
    Issue {
        /// The file.
        path: PathBuf,
        /// What stands in it.
        text: String,
    },
    /// The issue of the roster cannot be kept.
    #[error("{}: the issue of the roster cannot be kept: {source}", path.display())]
    Kept {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The key is none, or that of another certificate.
    #[error("{}: is not the private key of the certificate", path.display())]
    Key {
        /// The file.
        path: PathBuf,
    },
    /// Everyone on the machine can read the key.
    #[error("{}: everyone on this machine can read the private key; chmod 600 it", path.display())]
    OpenKey {
        /// The file.
        path: PathBuf,
    },
}

impl Trusted {
    /// Reads and checks the files of a node; `seen` is the highest issue of the roster that this node has kept.
    ///
    /// # Errors
    /// Any of them is not what it should be.
    pub fn read(
        identity: &Identity,
        node: Sender,
        seen: Option<u64>,
    ) -> Result<Trusted, TrustError> {
        Trusted::read_where(identity, node, seen, false)
    }

    /// Reads and checks files that are brought to a node: the same, but on a stick without modes the key's says nothing.
    ///
    /// # Errors
    /// As for [`Trusted::read`].
    pub fn read_brought(
        identity: &Identity,
        node: Sender,
        seen: Option<u64>,
    ) -> Result<Trusted, TrustError> {
        Trusted::read_where(identity, node, seen, true)
    }

    fn read_where(
        identity: &Identity,
        node: Sender,
        seen: Option<u64>,
        is_brought: bool,
    ) -> Result<Trusted, TrustError> {
        let authority = read_certificate(&identity.ca)?;
        if !authority.is_authority {
            let source = CertificateError::NoAuthority;
            return Err(TrustError::Certificate {
                path: identity.ca.clone().into(),
                source,
            });
        }
        let roster = read_roster(&identity.roster, &authority, seen)?;
        let path = PathBuf::from(&identity.certificate);
        let certificate = read_certificate(&identity.certificate)?;
        let refused = |source| TrustError::Certificate {
            path: path.clone(),
            source,
        };
        certificate.check_signed_by(&authority).map_err(refused)?;
        let own = own_name(&path, &certificate, node)?;
        let is_allowed = |entry: &super::RosterEntry| {
            entry.name == own && entry.fingerprint == certificate.fingerprint
        };
        if !roster.of(node).is_some_and(is_allowed) {
            return Err(TrustError::NotAllowed {
                path,
                name: own,
                issue: roster.issue,
            });
        }
        check_key(Path::new(&identity.key), &certificate, is_brought)?;
        Ok(Trusted { own, roster })
    }
}

fn read_text(path: &str) -> Result<String, TrustError> {
    read_limited(Path::new(path)).map_err(|source| TrustError::Read {
        path: path.into(),
        source,
        needed: ENROLLED,
    })
}

fn read_certificate(path: &str) -> Result<Certificate, TrustError> {
    let refused = |source| TrustError::Certificate {
        path: path.into(),
        source,
    };
    Certificate::from_pem(&read_text(path)?).map_err(refused)
}

fn read_roster(
    path: &str,
    authority: &Certificate,
    seen: Option<u64>,
) -> Result<Roster, TrustError> {
    let refused = |source| TrustError::Roster {
        path: path.into(),
        source,
    };
    let roster = Roster::verify(&read_text(path)?, authority).map_err(refused)?;
    roster.check_not_older(seen).map_err(refused)?;
    Ok(roster)
}

fn own_name(
    path: &Path,
    certificate: &Certificate,
    node: Sender,
) -> Result<CommonName, TrustError> {
    let name: Option<CommonName> = certificate.common_name.parse().ok();
    name.filter(|name| name.node == node)
        .ok_or_else(|| TrustError::OtherNode {
            path: path.to_owned(),
            found: certificate.common_name.clone(),
            expected: CommonName::node_name(node),
        })
}

fn check_key(path: &Path, certificate: &Certificate, is_brought: bool) -> Result<(), TrustError> {
    let unreadable = |source| TrustError::Read {
        path: path.to_owned(),
        source,
        needed: ENROLLED,
    };
    let is_without_modes = is_brought && !has_modes(path).map_err(unreadable)?;
    if !is_without_modes && is_open_to_others(path).map_err(unreadable)? {
        return Err(TrustError::OpenKey {
            path: path.to_owned(),
        });
    }
    let text = read_limited(path).map_err(unreadable)?;
    let key = KeyPair::from_pem(&text).ok();
    let fits = key.is_some_and(|key| key.public_key_raw() == certificate.public_key);
    if fits {
        Ok(())
    } else {
        Err(TrustError::Key {
            path: path.to_owned(),
        })
    }
}
