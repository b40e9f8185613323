//! An actor as bytes. Where they are kept is not known here.

use serde::Serialize;
use tomoswarm_proto::codec::{self, EncodeError};

/// An actor as it was: restored from it, it goes on as the original does.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Snapshot {
    /// The name of the actor, within its node.
    pub actor: &'static str,
    /// What [`codec::pack`] makes of it; only programs of one version read it.
    pub bytes: Vec<u8>,
}

impl Snapshot {
    /// Takes a snapshot of an actor.
    ///
    /// # Errors
    /// It cannot be written, which is a mistake of this program.
    pub fn of<A: Serialize>(name: &'static str, actor: &A) -> Result<Snapshot, EncodeError> {
        Ok(Snapshot {
            actor: name,
            bytes: codec::pack(actor)?,
        })
    }
}
