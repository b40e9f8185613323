//! What is wanted of a vehicle, by its operator or by itself, as one state: each carries what belongs to it alone.
//!
//! ```text
//!                  Start                     Hold, emergency stop; battery empty, nobody heard
//!   [Waiting] ─────────► [Following] ◄────────────────────────────────────────► [Held]
//!                           │ Return; bus lost, battery low, blind    Start       │ Return
//!                           ▼                                                     ▼
//!                       [Returning]: [InQueue] (lower ids first) ◄─► [UnderWay] ─► [Home], at rest
//! ```
//!
//! Who is home after a return goes aside once more, as one that returns, when others cannot get home because of it.
//!
//! What leads from one to another is decided in [`super::Mission`] (orders), `autonomy` (what nobody has ordered) and
//! `returning`; the goal itself is changed in [`super::Mission`] alone.

use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::OrderKind;

use super::messages::{AutonomyCause, MissionStatus};
use crate::time::Time;

/// What is wanted of a vehicle.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) enum Goal {
    /// Nothing yet.
    Waiting,
    /// It is out for its mission: the ground's plan, or one of its own.
    Following,
    /// It stands.
    Held(GoalSource),
    /// It goes home.
    Returning(Return),
    /// It came home.
    Home(GoalSource),
}

/// Who wants it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) enum GoalSource {
    /// An operator.
    Order,
    /// The vehicle itself, and why.
    Itself(AutonomyCause),
}

/// A return, and how it gets on.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) struct Return {
    /// Who wants it.
    pub by: GoalSource,
    /// Tries in vain.
    pub tries: u32,
    /// Since when it lets others go first whom it would bar at home.
    pub lets_first_since: Option<Time>,
    /// How far it is.
    pub stage: ReturnStage,
}

/// Vehicles return one after the other.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) enum ReturnStage {
    /// It lets others go first.
    InQueue(ReturnQueue),
    /// It drives.
    UnderWay {
        /// When it went, if it may go through the unknown and others may free a known way.
        bold_since: Option<Time>,
        /// It does not wait for others to free its way: they follow their plans, or its battery is low.
        presses_on: bool,
    },
}

/// A vehicle's place in the queue of those that return.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub(super) struct ReturnQueue {
    /// Since when it waits.
    pub since: Time,
    /// Not before this is the way home judged again.
    pub try_at: Time,
    /// Since when its peers bar its way.
    pub barred_since: Option<Time>,
    /// It has let others have their turn before it.
    pub has_stepped_back: bool,
}

impl Goal {
    /// Returns the goal of a vehicle that is to return from now on.
    pub(super) fn go_home(now: Time, by: GoalSource) -> Goal {
        let queue = ReturnQueue {
            since: now,
            try_at: Time::ZERO,
            barred_since: None,
            has_stepped_back: false,
        };
        Goal::Returning(Return {
            by,
            tries: 0,
            lets_first_since: None,
            stage: ReturnStage::InQueue(queue),
        })
    }

    /// Returns the goal after an order. A vehicle at home stays there as long as something keeps it.
    pub(super) fn ordered(
        self,
        now: Time,
        kind: OrderKind,
        stays_home_for: Option<AutonomyCause>,
    ) -> Goal {
        match (kind, self, stays_home_for) {
            (OrderKind::Start, Goal::Home(_), Some(cause)) => Goal::Home(GoalSource::Itself(cause)),
            (OrderKind::Start, _, _) => Goal::Following,
            (OrderKind::Hold | OrderKind::Land | OrderKind::CutMotors, _, _) => {
                Goal::Held(GoalSource::Order)
            }
            (OrderKind::Return, _, _) => Goal::go_home(now, GoalSource::Order),
        }
    }

    /// Returns why the vehicle does something that nobody has ordered.
    pub(super) fn cause(&self) -> Option<AutonomyCause> {
        let by = match self {
            Goal::Waiting | Goal::Following => return None,
            Goal::Held(by) | Goal::Home(by) => by,
            Goal::Returning(home) => &home.by,
        };
        match by {
            GoalSource::Order => None,
            GoalSource::Itself(cause) => Some(*cause),
        }
    }

    /// Returns whether the vehicle drives, or is about to.
    pub(super) fn is_under_way(&self) -> bool {
        match self {
            Goal::Following | Goal::Returning(_) => true,
            Goal::Waiting | Goal::Held(_) | Goal::Home(_) => false,
        }
    }

    /// Returns whether the vehicle drives home.
    pub(super) fn drives_home(&self) -> bool {
        match self {
            Goal::Returning(home) => home.is_under_way(),
            Goal::Waiting | Goal::Following | Goal::Held(_) | Goal::Home(_) => false,
        }
    }

    /// Returns what the vehicle does, as a whole.
    pub(super) fn status(&self) -> MissionStatus {
        match self {
            Goal::Waiting => MissionStatus::Waiting,
            Goal::Following => MissionStatus::Following,
            Goal::Held(_) => MissionStatus::Held,
            Goal::Returning(_) => MissionStatus::Returning,
            Goal::Home(_) => MissionStatus::Home,
        }
    }
}

impl Return {
    /// Returns the return of a vehicle that leaves its home, so that others can get to theirs.
    pub(super) fn aside(now: Time, by: GoalSource) -> Return {
        Return {
            by,
            tries: 0,
            lets_first_since: Some(now),
            stage: ReturnStage::UnderWay {
                bold_since: None,
                presses_on: false,
            },
        }
    }

    /// Returns for how long it has let others go first.
    pub(super) fn lets_first_for(&self, now: Time) -> Duration {
        self.lets_first_since
            .map_or(Duration::ZERO, |since| now.since(since))
    }

    /// Returns whether it drives.
    pub(super) fn is_under_way(&self) -> bool {
        matches!(self.stage, ReturnStage::UnderWay { .. })
    }

    /// Returns the same return now that others have their turn; the way home is judged again at `try_at`.
    pub(super) fn stepped_back(self, now: Time, try_at: Time) -> Return {
        let barred_since = match self.stage {
            ReturnStage::InQueue(queue) => queue.barred_since,
            ReturnStage::UnderWay { .. } => None,
        };
        let queue = ReturnQueue {
            since: now,
            try_at,
            barred_since,
            has_stepped_back: true,
        };
        Return {
            stage: ReturnStage::InQueue(queue),
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::tests_support::{drawn, variants};
    use std::collections::BTreeSet;

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    #[test]
    fn the_drawings_show_the_goals_and_nothing_else() {
        let word = |goal: &Goal| match goal {
            Goal::Waiting => "Waiting",
            Goal::Following => "Following",
            Goal::Held(_) => "Held",
            Goal::Returning(_) => "Returning",
            Goal::Home(_) => "Home",
        };
        let goals = variants::<Goal>();
        let all: BTreeSet<String> = goals.union(&variants::<ReturnStage>()).cloned().collect();
        assert_eq!(drawn(include_str!("goal.rs")), all);
        assert!(drawn(include_str!("autonomy.rs")).is_subset(&goals));
        let low = GoalSource::Itself(AutonomyCause::BatteryLow);
        let shown = [
            Goal::Waiting,
            Goal::Following,
            Goal::Held(low),
            Goal::go_home(at(1.0), low),
            Goal::Home(low),
        ];
        let words: BTreeSet<String> = shown.iter().map(|goal| word(goal).to_owned()).collect();
        assert_eq!(words, goals);
    }

    #[test]
    fn an_order_leads_where_the_drawing_says_but_for_what_keeps_a_vehicle_at_home() {
        let low = GoalSource::Itself(AutonomyCause::BatteryLow);
        for from in [
            Goal::Waiting,
            Goal::Following,
            Goal::Held(low),
            Goal::Home(low),
        ] {
            let keeps = Some(AutonomyCause::BatteryLow);
            let after = |kind, keeps| from.ordered(at(2.0), kind, keeps);
            assert_eq!(after(OrderKind::Start, None), Goal::Following);
            for stop in [OrderKind::Hold, OrderKind::Land, OrderKind::CutMotors] {
                assert_eq!(after(stop, keeps), Goal::Held(GoalSource::Order));
            }
            let home = Goal::go_home(at(2.0), GoalSource::Order);
            assert_eq!(after(OrderKind::Return, keeps), home);
            let started = match from {
                Goal::Home(_) => Goal::Home(low),
                Goal::Waiting | Goal::Following | Goal::Held(_) | Goal::Returning(_) => {
                    Goal::Following
                }
            };
            assert_eq!(after(OrderKind::Start, keeps), started, "from {from:?}");
        }
    }

    #[test]
    fn only_what_a_vehicle_decides_has_a_cause() {
        let low = GoalSource::Itself(AutonomyCause::BatteryLow);
        assert_eq!(
            Goal::go_home(at(1.0), low).cause(),
            Some(AutonomyCause::BatteryLow)
        );
        assert_eq!(Goal::Held(low).cause(), Some(AutonomyCause::BatteryLow));
        for goal in [
            Goal::Waiting,
            Goal::Following,
            Goal::Home(GoalSource::Order),
            Goal::go_home(at(1.0), GoalSource::Order),
        ] {
            assert_eq!(goal.cause(), None, "{goal:?}");
        }
    }

    #[test]
    fn who_steps_back_keeps_who_wants_it_and_its_tries() {
        let Goal::Returning(home) = Goal::go_home(at(1.0), GoalSource::Order) else {
            panic!("it returns")
        };
        let stage = ReturnStage::UnderWay {
            bold_since: Some(at(2.0)),
            presses_on: true,
        };
        let back = Return {
            tries: 3,
            stage,
            ..home
        }
        .stepped_back(at(5.0), at(8.0));
        assert_eq!(
            (back.by, back.tries, back.is_under_way()),
            (GoalSource::Order, 3, false)
        );
        let ReturnStage::InQueue(queue) = back.stage else {
            panic!("{back:?}")
        };
        assert!(queue.has_stepped_back && queue.barred_since.is_none());
        assert_eq!((queue.since, queue.try_at), (at(5.0), at(8.0)));
    }

    #[test]
    fn who_waits_behind_peers_does_not_forget_since_when() {
        let Goal::Returning(mut home) = Goal::go_home(at(1.0), GoalSource::Order) else {
            panic!("it returns")
        };
        if let ReturnStage::InQueue(queue) = &mut home.stage {
            queue.barred_since = Some(at(4.0));
        }
        let back = home
            .stepped_back(at(5.0), at(8.0))
            .stepped_back(at(9.0), at(12.0));
        let ReturnStage::InQueue(queue) = back.stage else {
            panic!("{back:?}")
        };
        assert_eq!(queue.barred_since, Some(at(4.0)));
    }
}
