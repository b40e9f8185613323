//! Keys that the library is told of before they are used: then it finds out once who hears what is published under one, and
//! not for every message anew. That holds for the keys under which this node speaks and for those under which others do;
//! nobody else is told of them. Everything goes under its whole key all the same.

use std::collections::BTreeMap;
use std::sync::Mutex;

use tomoswarm_proto::{MessageSubject, Topic};
use zenoh::Wait;
use zenoh::key_expr::KeyExpr;

use super::super::mailbox::lock;
use super::library_panics;
use super::library_panics::guarded;

/// Keys told of at most in one session: eight of each of 250 vehicles, and some to spare.
const KEYS: usize = 2500;

/// The keys of a session.
#[derive(Debug, Default)]
pub(super) struct DeclaredKeys(Mutex<Keys>);

#[derive(Debug)]
struct Keys {
    by_name: BTreeMap<String, KeyState>,
    has_new: bool,
    /// How many panics of the library there were before the session.
    panics_before: u64,
}

impl Default for Keys {
    fn default() -> Keys {
        Keys {
            by_name: BTreeMap::new(),
            has_new: false,
            panics_before: library_panics::count(),
        }
    }
}

#[derive(Debug)]
enum KeyState {
    /// The library is to be told of it.
    New,
    /// The library was told of it, or has refused it, and is not asked again.
    Told(Option<KeyExpr<'static>>),
}

/// What the library gave for the keys of a session that is not used any more: to be dropped once that is closed. Each holds the
/// session in memory, and calls the library when it is dropped: after a panic of the library all are left alone, since one
/// more panic of it, while a destructor runs, would end the process.
pub(super) struct KeyHandles {
    handles: Vec<KeyExpr<'static>>,
    panics_before: u64,
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
            keys.by_name.insert(name.to_owned(), KeyState::New);
            keys.has_new = true;
        }
    }

    /// Tells a session of the keys that were used since it was told last; `None` = the library has panicked.
    pub(super) fn declare_new(&self, session: &zenoh::Session) -> Option<()> {
        for name in self.new_names() {
            let told = guarded(|| session.declare_keyexpr(name.clone()).wait())?;
            let told = KeyState::Told(told.ok());
            lock(&self.0).by_name.insert(name, told);
        }
        Some(())
    }

    fn new_names(&self) -> Vec<String> {
        let mut keys = lock(&self.0);
        if !std::mem::take(&mut keys.has_new) {
            return Vec::new();
        }
        let is_new = |(name, state): (&String, &KeyState)| {
            matches!(state, KeyState::New).then(|| name.clone())
        };
        keys.by_name.iter().filter_map(is_new).collect()
    }

    /// Returns the keys that the session was told of, ascending.
    #[cfg(test)]
    pub(super) fn told(&self) -> Vec<String> {
        let is_told = |(name, state): (&String, &KeyState)| {
            matches!(state, KeyState::Told(Some(_))).then(|| name.clone())
        };
        lock(&self.0).by_name.iter().filter_map(is_told).collect()
    }

    /// Forgets all: the next session is another one.
    pub(super) fn take(&self) -> KeyHandles {
        let keys = std::mem::take(&mut *lock(&self.0));
        let handle = |state| match state {
            KeyState::New => None,
            KeyState::Told(handle) => handle,
        };
        KeyHandles {
            handles: keys.by_name.into_values().filter_map(handle).collect(),
            panics_before: keys.panics_before,
        }
    }
}

impl Drop for KeyHandles {
    fn drop(&mut self) {
        let is_sound =
            || library_panics::count() == self.panics_before && !std::thread::panicking();
        let mut handles = std::mem::take(&mut self.handles).into_iter();
        while is_sound()
            && let Some(handle) = handles.next()
        {
            guarded(|| drop(handle));
        }
        handles.for_each(std::mem::forget);
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::{MessageKind, RunId};

    use super::*;

    fn topic(about: MessageSubject) -> Topic {
        Topic {
            kind: MessageKind::State,
            about,
        }
    }

    #[test]
    fn each_key_is_new_once_and_of_many_only_the_first_are_kept() {
        let keys = DeclaredKeys::default();
        keys.note("a/image", topic(MessageSubject::Run(RunId(1))));
        assert_eq!(keys.new_names(), [""; 0], "there are too many of them");
        for _ in 0..2 {
            keys.note("a/state", topic(MessageSubject::Whole));
            keys.note("b/state", topic(MessageSubject::Whole));
        }
        assert_eq!(keys.new_names(), ["a/state", "b/state"]);
        assert_eq!(keys.new_names(), [""; 0]);
        for number in 0..2 * KEYS {
            keys.note(&format!("{number}"), topic(MessageSubject::Whole));
        }
        assert_eq!(lock(&keys.0).by_name.len(), KEYS);
        drop(keys.take());
        assert_eq!(lock(&keys.0).by_name.len(), 0);
        keys.note("a/state", topic(MessageSubject::Whole));
        assert_eq!(
            keys.new_names(),
            ["a/state"],
            "the next session is to be told"
        );
    }
}
