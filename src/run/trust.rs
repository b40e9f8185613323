//! Who belongs to a swarm: an authority of its own, a certificate for every node, and a signed roster of those that are
//! allowed.
//!
//! A Pi has no clock, so certificates hold from 1970 to 9999 and nothing expires; instead the roster says who is allowed
//! today. The bus knows a neighbour by the common name in its certificate alone, so every certificate has a name of its
//! own ("vehicle-3.2" is the second one of vehicle 3): a replaced or revoked one is not in the roster and may do nothing
//! ([`access_rules`]). A running node takes up a newer roster, and never goes back to an older issue.
//!
//! This module opens no sockets and does not name zenoh; `run/bus.rs` turns the rules into its configuration. What is
//! written where is decided by `cli/enroll.rs`.

mod access;
mod authority;
mod certificate;
mod folder;
mod name;
mod roster;
mod trusted;

pub use access::{AccessRule, access_rules};
pub use authority::{Authority, AuthorityError, IssuedCertificate, is_host};
pub use certificate::{Certificate, CertificateError, Fingerprint};
pub use folder::{
    Lock, NewFile, Owner, StagedFolder, is_as_replaced, is_private, own, read_limited,
    read_limited_bytes, read_regular, replace_file, replace_folder, write_new_folder,
};
pub use name::CommonName;
pub use roster::{Roster, RosterEntry, RosterError};
pub use trusted::{TrustError, Trusted};
