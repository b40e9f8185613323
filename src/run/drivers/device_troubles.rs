//! What is wrong with a vehicle's devices, and what of that has been named to whoever tells it.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use crate::run::mailbox::lock;

/// What was named once is not news again before this time, also when it was in order meanwhile: devices that fail and recover
/// at each use would have the process look after them at each use.
const NAMED_FOR: Duration = Duration::from_secs(1);

/// What is wrong with one device.
pub(super) struct DeviceTrouble {
    /// By what name it is told.
    pub(super) who: &'static str,
    /// Which one of several that have the name.
    pub(super) nth: usize,
    /// In words.
    pub(super) what: String,
}

/// The troubles that have been named.
#[derive(Default)]
pub(super) struct NamedTroubles(Mutex<BTreeMap<TroubleKind, Instant>>);

/// A trouble apart from the numbers in its words, such as a time that runs on: device, which one, and words.
type TroubleKind = (&'static str, usize, String);

impl NamedTroubles {
    /// Notes that these are named, and that others are not any more.
    pub(super) fn name(&self, now: Instant, troubles: &[DeviceTrouble]) {
        let named = &mut *lock(&self.0);
        named.retain(|_, at| now.duration_since(*at) < NAMED_FOR);
        named.extend(troubles.iter().map(|trouble| (kind_of(trouble), now)));
    }

    /// Returns whether one of these is not named.
    pub(super) fn has_new(&self, troubles: &[DeviceTrouble]) -> bool {
        // Nothing is wrong nearly always.
        if troubles.is_empty() {
            return false;
        }
        let named = lock(&self.0);
        troubles
            .iter()
            .any(|trouble| !named.contains_key(&kind_of(trouble)))
    }
}

fn kind_of(trouble: &DeviceTrouble) -> TroubleKind {
    let words = trouble.what.chars().filter(|one| !one.is_ascii_digit());
    (trouble.who, trouble.nth, words.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trouble(who: &'static str, nth: usize, what: &str) -> DeviceTrouble {
        let what = what.to_owned();
        DeviceTrouble { who, nth, what }
    }

    #[test]
    fn what_is_not_named_is_new_and_a_number_that_runs_on_is_not() {
        let (named, now) = (NamedTroubles::default(), Instant::now());
        let late = trouble("servo", 0, "confirmed after 1.20 s");
        assert!(!named.has_new(&[]) && named.has_new(std::slice::from_ref(&late)));
        named.name(now, &[late]);
        let later = trouble("servo", 0, "confirmed after 1.35 s");
        assert!(!named.has_new(&[later]));
        for new in [
            trouble("servo", 0, "it is not confirmed"),
            trouble("servo", 1, "confirmed after 1.20 s"),
            trouble("radio", 0, "confirmed after 1.20 s"),
        ] {
            let late = trouble("servo", 0, "confirmed after 1.20 s");
            assert!(named.has_new(&[late, new]), "beside one that is named");
        }
    }

    #[test]
    fn one_that_comes_as_another_goes_is_new_and_one_that_comes_again_is_so_after_a_second() {
        let (named, began) = (NamedTroubles::default(), Instant::now());
        let silent = || [trouble("range sensor", 0, "it answers nothing")];
        let gone = || [trouble("range sensor", 0, "port: it is gone")];
        named.name(began, &silent());
        assert!(named.has_new(&gone()));
        named.name(began + NAMED_FOR / 2, &gone());
        assert!(!named.has_new(&silent()) && !named.has_new(&gone()));
        named.name(began + NAMED_FOR, &gone());
        assert!(named.has_new(&silent()) && !named.has_new(&gone()));
    }
}
