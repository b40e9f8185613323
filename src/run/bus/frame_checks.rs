//! Whether a frame came whole, and under the key that it belongs to.

use tomoswarm_proto::Key;

use crate::exchange::ingress::{FrameRefusal, HeardMessage};

/// Passes a frame whose checksum fits, or which has none.
pub(super) fn whole(bytes: &[u8], check: Option<&[u8]>) -> Result<(), FrameRefusal> {
    match check.is_none_or(|check| check == crc32fast::hash(bytes).to_le_bytes()) {
        true => Ok(()),
        false => Err(FrameRefusal::Damaged),
    }
}

/// Lets a message pass that came under the key that belongs to it; greetings are looked at wherever they come.
pub(super) fn under_its_key(heard: HeardMessage, key: &str) -> Result<HeardMessage, FrameRefusal> {
    match &heard {
        HeardMessage::Message(sender, message) if Key::of(*sender, message).to_string() != key => {
            Err(FrameRefusal::NotItsToSay { sender: *sender })
        }
        HeardMessage::Message(..) | HeardMessage::Greeting(..) | HeardMessage::Unknown(_) => {
            Ok(heard)
        }
    }
}
