//! Signatures of MAVLink 2 frames (<https://mavlink.io/en/guide/message_signing.html>): with a secret key that both sides
//! know, over a time that never goes back. The clock is an argument: a Raspberry Pi has none that survives a night, so what
//! was said last is stored, and the time is the larger of both.

use std::collections::BTreeMap;
use std::time::Duration;

use mavlink::{MAVLinkMessageRaw, MAVLinkV2MessageRaw};

/// Bytes of a key.
pub const KEY_BYTES: usize = 32;
/// The time counts ten microseconds each.
pub const PER_SECOND: u64 = 100_000;
/// A sender that was not heard before may be so much behind, in units of time.
const NEW_MAY_LAG: u64 = 60 * PER_SECOND;
/// The flag of a frame that is signed.
const SIGNED: u8 = 0x01;

/// Signatures count from 1 January 2015 on.
const COUNTS_FROM: Duration = Duration::from_secs(1_420_070_400);

/// Returns the time of signatures, units of 10 µs, so long after 1 January 1970; 0 where a clock is behind 2015.
pub fn signing_time(since_1970: Duration) -> u64 {
    let counted = since_1970.saturating_sub(COUNTS_FROM).as_micros() / 10;
    u64::try_from(counted).unwrap_or(u64::MAX)
}

/// Reads a key as it stands in a file: 64 hexadecimal digits.
pub fn key_from_hex(text: &str) -> Option<[u8; KEY_BYTES]> {
    let text = text.trim();
    if text.len() != 2 * KEY_BYTES || !text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return None;
    }
    let mut key = [0; KEY_BYTES];
    for (index, byte) in key.iter_mut().enumerate() {
        *byte = u8::from_str_radix(&text[2 * index..2 * index + 2], 16).ok()?;
    }
    Some(key)
}

/// Why a frame is not believed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum SigningRefusal {
    /// It bears no signature.
    #[error("it is not signed")]
    Unsigned,
    /// The key is another one, or a byte was changed.
    #[error("its signature is wrong")]
    Wrong,
    /// It has been said before.
    #[error("it is older than one that was heard")]
    Old,
}

/// The signatures of one link.
#[derive(Clone, Debug)]
pub struct Signing {
    key: [u8; KEY_BYTES],
    link: u8,
    /// The last time that was said or heard, units of 10 µs since 2015.
    time: u64,
    /// The last time of each sender, by link, system and component.
    heard: BTreeMap<(u8, u32, u8), u64>,
}

impl Signing {
    /// Begins with a key; `stored` is the time that was said last, as it was kept.
    pub fn new(key: [u8; KEY_BYTES], link: u8, stored: u64) -> Signing {
        Signing {
            key,
            link,
            time: stored,
            heard: BTreeMap::new(),
        }
    }

    /// Takes what a clock shows, units of 10 µs since 1 January 2015; one that is behind changes nothing.
    pub fn tick(&mut self, clock: u64) {
        self.time = self.time.max(clock);
    }

    /// Returns the time to keep for the next start.
    pub fn time(&self) -> u64 {
        self.time
    }

    /// Signs a frame that has the flag of one that is signed.
    pub fn sign(&mut self, raw: &mut MAVLinkV2MessageRaw) {
        self.time += 1;
        *raw.signature_link_id_mut() = self.link;
        raw.signature_timestamp_bytes_mut()
            .copy_from_slice(&self.time.to_le_bytes()[..6]);
        let mut value = [0; 6];
        raw.calculate_signature(&self.key, &mut value);
        raw.signature_value_mut().copy_from_slice(&value);
    }

    /// Judges a frame that was heard.
    ///
    /// # Errors
    /// Why it is not believed.
    pub fn check(&mut self, raw: &MAVLinkMessageRaw) -> Result<(), SigningRefusal> {
        let MAVLinkMessageRaw::V2(raw) = raw else {
            return Err(SigningRefusal::Unsigned);
        };
        if raw.incompatibility_flags() & SIGNED == 0 {
            return Err(SigningRefusal::Unsigned);
        }
        let mut value = [0; 6];
        raw.calculate_signature(&self.key, &mut value);
        if value != raw.signature_value() {
            return Err(SigningRefusal::Wrong);
        }
        let sender = (raw.signature_link_id(), raw.system_id(), raw.component_id());
        let said = raw.signature_timestamp();
        let is_old = match self.heard.get(&sender) {
            Some(last) => said <= *last,
            None => said + NEW_MAY_LAG < self.time,
        };
        if is_old {
            return Err(SigningRefusal::Old);
        }
        self.heard.insert(sender, said);
        self.time = self.time.max(said);
        Ok(())
    }
}
