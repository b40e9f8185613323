//! What the way ahead is for, and what follows from that for how it is driven: whether another one may be searched, and what
//! a search does with unknown ground.

use serde::{Deserialize, Serialize};

/// What a search does with unknown cells. Once looking at them has not helped they always count as barred.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(crate) enum Unknown {
    /// They are as good as free: the way is looked at before it is driven.
    Free,
    /// They are crossed only when no path leads around them.
    LastResort,
    /// They are barred.
    Barred,
}

impl Unknown {
    /// Returns whether unknown ground may be crossed, try by try; `looked` = looking at it has not helped.
    pub(crate) fn tries(self, looked: bool) -> &'static [bool] {
        match self {
            Unknown::Free if !looked => &[true],
            Unknown::LastResort if !looked => &[false, true],
            Unknown::Free | Unknown::LastResort | Unknown::Barred => &[false],
        }
    }
}

/// What the way ahead is for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) enum WayPurpose {
    /// To pass the stops of the ground's plan: a leg that is blocked is planned around.
    Plan,
    /// To drive a route as it is: what blocks it is said, and the giver of the route decides.
    Route,
    /// To come home.
    Home {
        /// What searches do with unknown cells.
        unknown: Unknown,
        /// The way is only a wish: nothing of it is driven before a path is found.
        needs_path: bool,
    },
}

impl WayPurpose {
    /// Returns the purpose of a way home to which a path is searched at once.
    pub(super) fn home(unknown: Unknown) -> WayPurpose {
        WayPurpose::Home {
            unknown,
            needs_path: false,
        }
    }

    /// Returns whether another way may be searched when this one is blocked.
    pub(super) fn is_replaceable(self) -> bool {
        match self {
            WayPurpose::Plan | WayPurpose::Home { .. } => true,
            WayPurpose::Route => false,
        }
    }

    /// Returns what searches do with unknown cells.
    pub(super) fn unknown(self) -> Unknown {
        match self {
            WayPurpose::Plan | WayPurpose::Route => Unknown::Free,
            WayPurpose::Home { unknown, .. } => unknown,
        }
    }

    /// Returns whether nothing of the way is driven before a path is found.
    pub(super) fn needs_path(self) -> bool {
        matches!(
            self,
            WayPurpose::Home {
                needs_path: true,
                ..
            }
        )
    }

    /// Records that no path was found, or that the one found is blocked. The straight line home is a wish from then on; a
    /// leg of a plan is a way that others know of, and what is unknown on it may turn out to be free.
    pub(super) fn path_failed(&mut self) {
        if let WayPurpose::Home {
            unknown,
            needs_path,
        } = self
        {
            *needs_path = *unknown != Unknown::Free;
        }
    }

    /// Records that a path was found.
    pub(super) fn path_found(&mut self) {
        if let WayPurpose::Home { needs_path, .. } = self {
            *needs_path = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_ground_is_crossed_first_last_or_never() {
        for (unknown, fresh) in [
            (Unknown::Free, &[true][..]),
            (Unknown::LastResort, &[false, true]),
            (Unknown::Barred, &[false]),
        ] {
            assert_eq!(unknown.tries(false), fresh, "{unknown:?}");
            assert_eq!(unknown.tries(true), [false], "{unknown:?}, looked at");
        }
    }

    #[test]
    fn only_the_way_home_needs_a_path_after_a_failure_and_until_one_is_found() {
        for (mut purpose, needs) in [
            (WayPurpose::Plan, false),
            (WayPurpose::Route, false),
            (WayPurpose::home(Unknown::Free), false),
            (WayPurpose::home(Unknown::LastResort), true),
            (WayPurpose::home(Unknown::Barred), true),
        ] {
            assert!(!purpose.needs_path());
            purpose.path_failed();
            assert_eq!(purpose.needs_path(), needs, "{purpose:?}");
            purpose.path_found();
            assert!(!purpose.needs_path(), "{purpose:?}");
        }
    }

    #[test]
    fn a_route_alone_is_driven_as_it_is() {
        assert!(!WayPurpose::Route.is_replaceable());
        assert!(
            WayPurpose::Plan.is_replaceable() && WayPurpose::home(Unknown::Barred).is_replaceable()
        );
    }
}
