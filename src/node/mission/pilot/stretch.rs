//! The stretch of the way that is driven now: how much room it needs, and where it ends. It follows from how its path was
//! found, see [`super::detour`].

use serde::{Deserialize, Serialize};

use super::detour::FoundBy;
use crate::geom::Point;
use crate::node::mission::way::Way;
use crate::plan::RequiredClearance;

/// A stretch whose end is this near has been driven, metres.
const END_M: f64 = 0.3;

/// The stretch that is driven now.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub(super) enum Stretch {
    /// The way, with the room that a vehicle keeps.
    Ordinary,
    /// The way, over places where the vehicle has driven: its body must have room there, its padding need not.
    DrivenBefore,
    /// Back out of a dead end, to where the odometer shows this, metres. There a path is searched, whatever is released.
    Retreat {
        /// The odometer at its end, metres.
        end_m: f64,
    },
    /// The same over the vehicle's own track: it was there, so only what its reflex meets bars it, as long as its place was known
    /// well enough, then and now, for the track to be where it was.
    OwnTrack {
        /// The odometer at its end, metres.
        end_m: f64,
    },
}

impl Stretch {
    /// Returns the stretch of a way whose first `length_m` are a path that was found.
    pub(super) fn of_path(found_by: FoundBy, length_m: f64, way: &Way) -> Stretch {
        match found_by {
            FoundBy::GoingOn => Stretch::Ordinary,
            FoundBy::DrivenPlaces => Stretch::DrivenBefore,
            FoundBy::BackingOff => Stretch::Retreat {
                end_m: way.odometer_m(length_m),
            },
            FoundBy::OwnTrack => Stretch::OwnTrack {
                end_m: way.odometer_m(length_m),
            },
        }
    }

    /// Returns what must be free: what the vehicle keeps, or what it needs where it has driven before, or on its own track.
    pub(super) fn clearance(
        self,
        kept: RequiredClearance,
        driven_before: RequiredClearance,
        own_track: RequiredClearance,
    ) -> RequiredClearance {
        match self {
            Stretch::Ordinary | Stretch::Retreat { .. } => kept,
            Stretch::DrivenBefore => driven_before,
            Stretch::OwnTrack { .. } => own_track,
        }
    }

    /// Returns the corners of the way as far as the stretch leads.
    pub(super) fn route(self, way: &Way) -> Vec<Point> {
        let points = way.points();
        match self {
            Stretch::Ordinary | Stretch::DrivenBefore => points,
            // The way on lies over the way back: only the latter is judged, until its end is reached.
            Stretch::Retreat { end_m } | Stretch::OwnTrack { end_m } => {
                way.until(points[0], 0.0, way.along_m(end_m))
            }
        }
    }

    /// Returns whether the way back out of a dead end has been driven by a vehicle that is `here_m` along the way.
    pub(super) fn has_retreated(self, way: &Way, here_m: f64) -> bool {
        match self {
            Stretch::Ordinary | Stretch::DrivenBefore => false,
            Stretch::Retreat { end_m } | Stretch::OwnTrack { end_m } => {
                way.along_m(end_m) - here_m < END_M
            }
        }
    }

    /// Ends a retreat: the way that it led back along is left out.
    pub(super) fn end_retreat(&mut self) {
        match self {
            Stretch::Ordinary | Stretch::DrivenBefore => {}
            Stretch::Retreat { .. } | Stretch::OwnTrack { .. } => *self = Stretch::Ordinary,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A way 2 m back along x and then 5 m on.
    fn way() -> Way {
        let mut way = Way::default();
        way.append([Point::new(-2.0, 0.0)], Point::new(3.0, 0.0), None);
        way
    }

    #[test]
    fn of_a_way_back_nothing_behind_its_end_is_judged() {
        let way = way();
        let back = Stretch::of_path(FoundBy::BackingOff, 2.0, &way);
        assert_eq!(back, Stretch::Retreat { end_m: 2.0 });
        assert_eq!(back.route(&way), [Point::default(), Point::new(-2.0, 0.0)]);
        for found_by in [FoundBy::GoingOn, FoundBy::DrivenPlaces] {
            let on = Stretch::of_path(found_by, 2.0, &way);
            assert_eq!(on.route(&way), way.points(), "{found_by:?}");
        }
    }

    #[test]
    fn a_way_back_has_been_driven_just_before_its_end() {
        let way = way();
        for back in [
            Stretch::Retreat { end_m: 2.0 },
            Stretch::OwnTrack { end_m: 2.0 },
        ] {
            assert!(!back.has_retreated(&way, 1.6) && back.has_retreated(&way, 1.8));
        }
        assert!(!Stretch::Ordinary.has_retreated(&way, 7.0));
    }

    #[test]
    fn places_driven_before_need_room_for_the_body_alone_and_the_own_track_asks_no_map() {
        let widths = [
            Stretch::Ordinary,
            Stretch::DrivenBefore,
            Stretch::Retreat { end_m: 1.0 },
            Stretch::OwnTrack { end_m: 1.0 },
        ]
        .map(|stretch| {
            stretch
                .clearance(
                    RequiredClearance::everywhere(0.6),
                    RequiredClearance::everywhere(0.3),
                    RequiredClearance::everywhere(0.0),
                )
                .occupied_m
        });
        assert_eq!(widths, [0.6, 0.3, 0.6, 0.0]);
    }

    #[test]
    fn a_retreat_that_is_left_out_leaves_nothing_behind() {
        let mut stretch = Stretch::Retreat { end_m: 1.0 };
        stretch.end_retreat();
        assert_eq!(stretch, Stretch::Ordinary);
        let mut stretch = Stretch::DrivenBefore;
        stretch.end_retreat();
        assert_eq!(stretch, Stretch::DrivenBefore, "its room is as it is");
    }
}
