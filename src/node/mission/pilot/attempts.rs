//! What was tried in vain to get on: looks at what is unknown, searches, and a path of which nothing has been driven yet.
//! Pure bookkeeping; what is tried next is decided by [`super::Pilot`].

use serde::{Deserialize, Serialize};

/// Looks at one place before what is unknown counts as barred.
const LOOKS_MAX: u32 = 4;
/// After so many paths in a row of which nothing could be driven, another one is in vain.
const BARRED_PATHS_MAX: u32 = 3;

/// Attempts to get on.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub(super) struct Attempts {
    /// Looks since the last drive.
    looks: u32,
    /// Looking has not helped: unknown cells count as barred in the next search.
    looked_in_vain: bool,
    /// A path was found, and nothing of it has been driven.
    has_untried_path: bool,
    /// Searches without a result in a row.
    failures: u32,
    /// Paths in a row of which nothing could be driven.
    barred_paths: u32,
}

impl Attempts {
    /// Records that another way begins, which was never looked at.
    pub(super) fn begin_way(&mut self) {
        (self.looks, self.looked_in_vain) = (0, false);
    }

    /// Records that the way is given up.
    pub(super) fn give_up_way(&mut self) {
        self.failures = 0;
    }

    /// Records that the vehicle gets on.
    pub(super) fn drive(&mut self) {
        self.begin_way();
        (self.has_untried_path, self.barred_paths) = (false, 0);
    }

    /// Records that a stop was passed.
    pub(super) fn pass_stop(&mut self) {
        self.failures = 0;
    }

    /// Returns whether what is unknown may be looked at once more, and counts that look.
    pub(super) fn look_once_more(&mut self) -> bool {
        let may_look = !self.looked_in_vain && self.looks < LOOKS_MAX;
        self.looks += u32::from(may_look);
        may_look
    }

    /// Records that a look is over; `is_in_vain` = what is unknown on the way was looked at and is unknown still.
    pub(super) fn end_look(&mut self, is_in_vain: bool) {
        self.looked_in_vain = is_in_vain;
    }

    /// Returns whether looking has not helped.
    pub(super) fn has_looked_in_vain(&self) -> bool {
        self.looked_in_vain
    }

    /// Records that a path was found, on or only back.
    pub(super) fn find_path(&mut self, leads_on: bool) {
        self.has_untried_path = true;
        self.failures += u32::from(!leads_on);
    }

    /// Records that the way is blocked; returns whether that is a path of which nothing has been driven.
    pub(super) fn is_blocked_at_once(&mut self) -> bool {
        let is_at_once = std::mem::take(&mut self.has_untried_path);
        self.barred_paths += u32::from(is_at_once);
        is_at_once
    }

    /// Returns whether path after path was found here and nothing of any could be driven: the search and the corridor
    /// disagree about where the vehicle stands.
    pub(super) fn are_paths_barred(&self) -> bool {
        self.barred_paths >= BARRED_PATHS_MAX
    }

    /// Counts a failure, after which may be looked again; returns how many there are in a row.
    pub(super) fn fail(&mut self) -> u32 {
        self.looked_in_vain = false;
        self.failures += 1;
        self.failures
    }

    /// Returns how many searches in a row had no result.
    pub(super) fn failures(&self) -> u32 {
        self.failures
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_place_is_looked_at_a_few_times_until_the_vehicle_drives() {
        let mut attempts = Attempts::default();
        let looks = (0..9).filter(|_| attempts.look_once_more()).count();
        assert_eq!(looks, LOOKS_MAX as usize);
        attempts.drive();
        assert!(attempts.look_once_more());
    }

    #[test]
    fn after_a_look_in_vain_none_follows_until_a_search_has_failed() {
        let mut attempts = Attempts::default();
        attempts.end_look(true);
        assert!(attempts.has_looked_in_vain() && !attempts.look_once_more());
        assert_eq!(attempts.fail(), 1);
        assert!(!attempts.has_looked_in_vain() && attempts.look_once_more());
    }

    #[test]
    fn a_path_is_untried_until_it_is_driven_or_blocked() {
        let mut attempts = Attempts::default();
        attempts.find_path(true);
        assert!(attempts.is_blocked_at_once() && !attempts.is_blocked_at_once());
        attempts.find_path(true);
        attempts.drive();
        assert!(!attempts.is_blocked_at_once());
    }

    #[test]
    fn paths_are_barred_when_one_after_the_other_is_blocked_at_once_whatever_else_is_given_up() {
        let mut attempts = Attempts::default();
        for _ in 0..BARRED_PATHS_MAX {
            assert!(!attempts.are_paths_barred());
            attempts.find_path(true);
            assert!(attempts.is_blocked_at_once());
            assert!(!attempts.is_blocked_at_once(), "one path counts once");
            attempts.give_up_way();
        }
        assert!(attempts.are_paths_barred());
        attempts.drive();
        assert!(!attempts.are_paths_barred());
    }

    #[test]
    fn failures_count_in_a_row_and_a_path_that_only_leads_back_is_one() {
        let mut attempts = Attempts::default();
        attempts.find_path(true);
        assert_eq!(attempts.failures(), 0);
        attempts.find_path(false);
        assert_eq!((attempts.failures(), attempts.fail()), (1, 2));
        attempts.drive();
        assert_eq!(attempts.failures(), 2, "it has got nowhere yet");
        attempts.pass_stop();
        assert_eq!(attempts.failures(), 0);
        attempts.fail();
        attempts.give_up_way();
        assert_eq!(attempts.failures(), 0);
    }
}
