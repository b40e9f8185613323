//! From a node's file to how it takes part in the bus, and how it greets.

use std::path::PathBuf;

use tomoswarm_proto::{Boot, Hello, Sender};

use super::bus::{Access, BusSettings, Topology, Trust};
use crate::config::{BusFile, Endpoint, Topology as Named, Venue};

/// The machine gave no random number, so that nothing can be told apart.
#[derive(Debug, thiserror::Error)]
#[error("the system gives no random numbers: {0}")]
pub struct NoChance(getrandom::Error);

/// Draws a random number.
///
/// # Errors
/// The system gives none.
pub fn draw() -> Result<u64, NoChance> {
    getrandom::u64().map_err(NoChance)
}

/// Gives how a node takes part in the bus; `access` says who may write what, where there are certificates.
pub fn bus_settings(node: Sender, venue: &Venue, file: &BusFile, access: Vec<Access>) -> BusSettings {
    let trust = file.identity.as_ref().map(|identity| Trust {
        ca: PathBuf::from(&identity.ca),
        certificate: PathBuf::from(&identity.certificate),
        key: PathBuf::from(&identity.key),
        access,
    });
    let text = |endpoints: &[Endpoint]| endpoints.iter().map(Endpoint::to_string).collect();
    BusSettings {
        node,
        prefix: format!("tomoswarm/{}", venue.name),
        topology: match file.topology {
            Named::Mesh => Topology::Mesh,
            Named::Star => Topology::Star,
        },
        listen: text(&file.listen),
        connect: text(&file.connect),
        trust,
        lease: file.lease,
        egress_bytes_per_s: (file.egress_kb_per_s * 1e3) as u32,
    }
}

/// Gives how a node greets.
///
/// # Errors
/// The system gives no random numbers.
pub fn greeting(node: Sender, boot: Boot, venue: &Venue, capabilities: &[&str]) -> Result<Hello, NoChance> {
    Ok(Hello {
        node,
        boot,
        venue_hash: venue.hash(),
        instance: draw()?,
        is_member: false,
        software: format!("tomoswarm {}", env!("CARGO_PKG_VERSION")),
        capabilities: capabilities.iter().map(|word| (*word).to_owned()).collect(),
    })
}
