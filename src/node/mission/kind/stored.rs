//! A mission that the vehicle's autopilot stores and carries out by itself; here it is only begun, watched and gone on with.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{MissionRefusal, StoredItem};

use super::{Behaviour, MissionContext, MissionInput, MissionStep};
use crate::autopilot::{Item, StoredPhase};
use crate::geom::Point;
use crate::node::mission::EndReason;

/// So often in a row it is gone on with at the same item; then it is given up.
const TRIES_MAX: u32 = 15;
/// So often in a row the autopilot may fail to begin it; then it is refused.
const FAILURES_MAX: u32 = 3;

/// A stored mission.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Stored {
    /// Item 0 is home.
    items: Vec<Item>,
    /// The item under way, or to begin with.
    item: usize,
    tries: u32,
    failures: u32,
}

impl Stored {
    /// Makes the mission of these items, from one of them on.
    pub(super) fn new(home: Point, items: &[StoredItem], from: u16) -> Stored {
        let home = Item::Waypoint {
            at: home,
            altitude_m: 0.0,
            delay: std::time::Duration::ZERO,
        };
        Stored {
            items: std::iter::once(home)
                .chain(items.iter().map(Item::from))
                .collect(),
            item: usize::from(from),
            tries: 0,
            failures: 0,
        }
    }

    /// Returns how many places lie ahead, jumps left out.
    pub(super) fn places_left(&self) -> usize {
        let ahead = self.items.iter().skip(self.item);
        ahead.filter(|item| item.place().is_some()).count()
    }
}

impl Behaviour for Stored {
    fn next(&mut self, seen: MissionInput, _around: &MissionContext<'_>) -> MissionStep {
        match seen {
            MissionInput::Autopilot(Some(stored)) => {
                let item = usize::from(stored.item);
                if stored.phase == StoredPhase::UnderWay && item > 0 {
                    if item != self.item {
                        self.tries = 0;
                    }
                    (self.item, self.failures) = (item, 0);
                }
                match stored.phase {
                    StoredPhase::Preparing | StoredPhase::UnderWay => MissionStep::GoOn,
                    StoredPhase::Over => {
                        self.item = self.items.len();
                        MissionStep::EndHere(EndReason::Done)
                    }
                    StoredPhase::Failed if self.failures + 1 >= FAILURES_MAX => {
                        MissionStep::EndHere(EndReason::Refused(MissionRefusal::Autopilot))
                    }
                    StoredPhase::Failed => {
                        self.failures += 1;
                        MissionStep::Wait
                    }
                }
            }
            // It was stopped: by the reflex, for a peer, or because it does not see.
            MissionInput::Autopilot(None) if self.tries >= TRIES_MAX => {
                MissionStep::EndHere(self.give_up())
            }
            MissionInput::Autopilot(None) => {
                self.tries += 1;
                MissionStep::Wait
            }
            MissionInput::Ready => MissionStep::FollowStored {
                items: self.items.clone(),
                from: self.item,
            },
            MissionInput::UnderWay
            | MissionInput::Arrived
            | MissionInput::Blocked(_)
            | MissionInput::Looked { .. } => MissionStep::Think,
        }
    }

    fn goal(&self) -> Option<Point> {
        self.items.iter().skip(self.item).find_map(Item::place)
    }

    fn give_up(&self) -> EndReason {
        EndReason::GaveUp(self.places_left())
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests_support::step;
    use super::*;
    use crate::autopilot::StoredProgress;
    use tomoswarm_proto::Position;

    fn mission() -> Stored {
        let to = |x_m: f64| StoredItem::Waypoint {
            at: Position::from_metres(x_m, 0.0, 0.0),
            stay_ms: 0,
        };
        Stored::new(
            Point::default(),
            &[to(1.0), StoredItem::Speed(500), to(2.0)],
            1,
        )
    }

    fn shown(item: u16, phase: StoredPhase) -> MissionInput {
        MissionInput::Autopilot(Some(StoredProgress { item, phase }))
    }

    fn told(mission: &mut Stored, seen: MissionInput) -> MissionStep {
        step(mission, seen, (0.0, 0.0))
    }

    fn begins_with(mission: &mut Stored) -> usize {
        match told(mission, MissionInput::Ready) {
            MissionStep::FollowStored { from, items } => {
                assert_eq!(items.len(), 4, "with home");
                from
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn it_goes_on_with_the_item_that_was_under_way_and_ends_where_it_is() {
        let mut mission = mission();
        assert_eq!((begins_with(&mut mission), mission.places_left()), (1, 2));
        assert_eq!(
            told(&mut mission, shown(0, StoredPhase::Preparing)),
            MissionStep::GoOn
        );
        assert_eq!(
            told(&mut mission, shown(3, StoredPhase::UnderWay)),
            MissionStep::GoOn
        );
        assert_eq!(mission.goal(), Some(Point::new(2.0, 0.0)));
        assert_eq!(
            told(&mut mission, MissionInput::Autopilot(None)),
            MissionStep::Wait
        );
        assert_eq!(begins_with(&mut mission), 3);
        let end = MissionStep::EndHere(EndReason::Done);
        assert_eq!(told(&mut mission, shown(3, StoredPhase::Over)), end);
        assert_eq!((mission.places_left(), mission.goal()), (0, None));
    }

    #[test]
    fn what_stops_it_again_and_again_at_one_item_ends_it() {
        let mut mission = mission();
        for item in [1, 3] {
            told(&mut mission, shown(item, StoredPhase::UnderWay));
            for _ in 0..TRIES_MAX - 1 {
                assert_eq!(
                    told(&mut mission, MissionInput::Autopilot(None)),
                    MissionStep::Wait
                );
            }
        }
        told(&mut mission, MissionInput::Autopilot(None));
        let end = told(&mut mission, MissionInput::Autopilot(None));
        assert_eq!(end, MissionStep::EndHere(EndReason::GaveUp(1)));
    }

    #[test]
    fn an_autopilot_that_does_not_take_it_three_times_refuses_it() {
        let mut mission = mission();
        let mut failed = || told(&mut mission, shown(0, StoredPhase::Failed));
        assert_eq!([failed(), failed()], [MissionStep::Wait, MissionStep::Wait]);
        let end = EndReason::Refused(MissionRefusal::Autopilot);
        assert_eq!(failed(), MissionStep::EndHere(end));
    }
}
