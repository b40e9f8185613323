//! What a session is called among its neighbours: who it is of, so that a link can be told from those of others, and a random
//! part, so that a session which is opened anew is not taken for the one before.
//!
//! A name proves nothing: on links without certificates anyone may take any.

use tomoswarm_proto::{OperatorId, Sender, VehicleId};
use zenoh::session::ZenohId;

/// Where the venue and the node stand in a name's 16 bytes, the lowest first; the rest is random.
const VENUE: std::ops::Range<usize> = 0..4;
const NODE: std::ops::Range<usize> = 4..6;

/// Returns a new name for a session of a node in a venue, which its prefix of keys stands for.
pub(super) fn random(node: Sender, prefix: &str) -> ZenohId {
    let plain = ZenohId::default();
    let mut bytes = plain.to_le_bytes();
    bytes[VENUE].copy_from_slice(&venue(prefix));
    bytes[NODE].copy_from_slice(&code(node));
    // A name of zeros is the only one that is refused, and its random part would have to be.
    ZenohId::try_from(&bytes[..]).unwrap_or(plain)
}

/// Returns whose session of the venue has this name; `None` when it is another one's.
pub(super) fn node_of(id: ZenohId, prefix: &str) -> Option<Sender> {
    let bytes = id.to_le_bytes();
    if bytes[VENUE] != venue(prefix) {
        return None;
    }
    match bytes[NODE] {
        [0, 0] => Some(Sender::Ground),
        [1, number] => Some(Sender::Vehicle(VehicleId(number))),
        [2, number] => Some(Sender::Operator(OperatorId(number))),
        _ => None,
    }
}

fn venue(prefix: &str) -> [u8; 4] {
    crc32fast::hash(prefix.as_bytes()).to_le_bytes()
}

fn code(node: Sender) -> [u8; 2] {
    match node {
        Sender::Ground => [0, 0],
        Sender::Vehicle(id) => [1, id.0],
        Sender::Operator(id) => [2, id.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_says_whose_session_it_is_and_is_never_used_again() {
        let nodes = [
            Sender::Ground,
            Sender::Vehicle(VehicleId(1)),
            Sender::Operator(OperatorId(1)),
        ];
        for node in nodes {
            let (one, other) = (
                random(node, "tomoswarm/here"),
                random(node, "tomoswarm/here"),
            );
            assert_eq!(node_of(one, "tomoswarm/here"), Some(node));
            assert_eq!(node_of(one, "tomoswarm/there"), None);
            assert_ne!(one, other);
        }
        assert_eq!(node_of(ZenohId::default(), "tomoswarm/here"), None);
    }
}
