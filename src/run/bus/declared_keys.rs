//! Keys that the library is told of before they are used: then it finds out once who hears what is published under one, and
//! not for every message anew. That holds for the keys under which this node speaks and for those under which others do;
//! nobody else is told of them. Everything goes under its whole key all the same.

use std::collections::BTreeMap;
use std::sync::Mutex;

use tomoswarm_proto::{MessageSubject, Topic};
use zenoh::Wait;

use super::super::mailbox::lock;
use super::library_panics::guarded;

/// Keys told of at most: eight of each of 250 vehicles, and some to spare.
const KEYS: usize = 2500;

/// The keys of a session.
#[derive(Debug, Default)]
pub(super) struct DeclaredKeys(Mutex<Keys>);

#[derive(Debug, Default)]
struct Keys {
    /// Whether the library was told of it.
    by_name: BTreeMap<String, bool>,
    has_new: bool,
}

impl DeclaredKeys {
    /// Notes a key under which something of a topic is said, for [`DeclaredKeys::declare_new`]. Of tiles, runs and parts there
    /// are too many.
    pub(super) fn note(&self, name: &str, topic: Topic) {
        if topic.about != MessageSubject::Whole {
            return;
        }
        let mut keys = lock(&self.0);
        if !keys.by_name.contains_key(name) && keys.by_name.len() < KEYS {
            keys.by_name.insert(name.to_owned(), false);
            keys.has_new = true;
        }
    }

    /// Tells a session of the keys that were used since it was told last; `None` = the library has panicked.
    pub(super) fn declare_new(&self, session: &zenoh::Session) -> Option<()> {
        let new: Vec<String> = {
            let mut keys = lock(&self.0);
            if !std::mem::take(&mut keys.has_new) {
                return Some(());
            }
            let new = keys.by_name.iter().filter(|(_, is_told)| !**is_told);
            new.map(|(name, _)| name.clone()).collect()
        };
        for name in new {
            // What the library refuses is not asked again. What it gives would take the key back when it is dropped, which
            // aborts the process after a panic of the library; the session's end takes all back.
            let told = guarded(|| session.declare_keyexpr(name.clone()).wait())?;
            std::mem::forget(told);
            lock(&self.0).by_name.insert(name, true);
        }
        Some(())
    }

    /// The next session is another one: it is to be told of all anew.
    pub(super) fn forget(&self) {
        let mut keys = lock(&self.0);
        keys.by_name
            .values_mut()
            .for_each(|is_told| *is_told = false);
        keys.has_new = true;
    }
}
