//! Another run beside the one that is shown: where its vehicles were, by the time of the run that is shown. Both are laid
//! over each other at the moment when a vehicle obeys its first start; a run without a start at what was said first.
//! Bounded: of a long way the places are farther apart in time.
//!
//! It is for looking at: nothing of it enters a board, a plan or an image.

use std::collections::BTreeMap;
use std::time::Duration;

use tomoswarm_proto::{Message, OrderKind, PoseReport, VehicleId};

use super::told::{GhostAbout, GhostWay, ToldGhost, as_text};
use crate::operator::HeardMessage;
use crate::time::Time;

/// Poses of a vehicle at most.
const POSES_MAX: usize = 6000;
/// Two poses are this far apart in time at first.
const STEP: Duration = Duration::from_millis(400);

/// Where the vehicles of another run were.
#[derive(Clone, Debug)]
pub struct Ghost {
    name: String,
    began: Time,
    ways: BTreeMap<VehicleId, Way>,
}

/// Where one vehicle was, ascending in time.
#[derive(Clone, Debug)]
struct Way {
    poses: Vec<(Time, PoseReport)>,
    step: Duration,
}

/// Returns when a run began: when a vehicle had first obeyed a start, or else when something was said first.
pub fn began(run: &[(Time, HeardMessage)]) -> Time {
    let is_started = |heard: &HeardMessage| match heard {
        HeardMessage::Message(_, Message::State(state)) => {
            state.ordered.kind == Some(OrderKind::Start)
        }
        HeardMessage::Message(..) | HeardMessage::Greeting(..) | HeardMessage::Unknown(_) => false,
    };
    let first = run.iter().find(|(_, heard)| is_started(heard));
    first.or(run.first()).map_or(Time::ZERO, |(at, _)| *at)
}

impl Ghost {
    /// Makes it of what was said in a run, ascending in time; `None` = no vehicle said where it is.
    pub fn of(name: String, run: &[(Time, HeardMessage)]) -> Option<Ghost> {
        let mut ways: BTreeMap<VehicleId, Way> = BTreeMap::new();
        for (at, heard) in run {
            if let HeardMessage::Message(_, Message::State(state)) = heard
                && let Some(pose) = state.pose
            {
                let way = ways.entry(state.vehicle).or_insert(Way {
                    poses: Vec::new(),
                    step: STEP,
                });
                way.add(*at, pose);
            }
        }
        (!ways.is_empty()).then(|| Ghost {
            name,
            began: began(run),
            ways,
        })
    }

    /// Returns what holds for the whole connection of a page.
    pub fn about(&self) -> GhostAbout {
        GhostAbout {
            name: self.name.clone(),
            vehicles: self.ways.keys().map(|id| id.0).collect(),
        }
    }

    /// Returns where its vehicles were beside a run that began at a moment, as text ([`ToldGhost`]).
    pub fn beside(&self, began: Time) -> String {
        let shift_s = began.as_secs_f64() - self.began.as_secs_f64();
        let rounded = |of: f64| of.round() as i64;
        let numbers = |(at, pose): &(Time, PoseReport)| {
            let cm = [pose.at.x_mm, pose.at.y_mm, pose.at.z_mm].map(|mm| i64::from(mm / 10));
            let at = rounded((at.as_secs_f64() + shift_s) * 10.0);
            [at, cm[0], cm[1], cm[2], i64::from(pose.heading.0) / 100]
        };
        let vehicle = |(id, way): (&VehicleId, &Way)| GhostWay {
            vehicle: id.0,
            poses: way.poses.iter().flat_map(numbers).collect(),
        };
        as_text(&ToldGhost {
            name: self.name.clone(),
            vehicles: self.ways.iter().map(vehicle).collect(),
        })
    }
}

impl Way {
    fn add(&mut self, at: Time, pose: PoseReport) {
        if self
            .poses
            .last()
            .is_some_and(|(last, _)| at.since(*last) < self.step)
        {
            return;
        }
        self.poses.push((at, pose));
        if self.poses.len() > POSES_MAX {
            self.step *= 2;
            let mut place = 0;
            self.poses.retain(|_| {
                place += 1;
                place % 2 == 1
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::tests_support::{at, heard, state};
    use serde_json::Value;
    use tomoswarm_proto::Position;

    /// A run in which vehicle 1 stands for so long, is started, and drives a metre a second; ten States a second.
    fn run(stands_s: f64, length_s: f64) -> Vec<(Time, HeardMessage)> {
        let states = (0..(length_s * 10.0) as u32).map(|step| {
            let now_s = f64::from(step) / 10.0;
            let mut state = state(1);
            if now_s >= stands_s {
                state.ordered.kind = Some(OrderKind::Start);
            }
            let pose = state.pose.as_mut().unwrap();
            pose.at = Position::from_metres((now_s - stands_s).max(0.0), 2.0, 0.5);
            (at(now_s), heard(Message::State(state)))
        });
        states.collect()
    }

    fn poses(ghost: &Ghost, began: Time) -> Vec<[i64; 5]> {
        let read: Value = serde_json::from_str(&ghost.beside(began)).unwrap();
        assert_eq!(read["vehicles"][0]["vehicle"], 1);
        let numbers: Vec<i64> =
            serde_json::from_value(read["vehicles"][0]["poses"].clone()).unwrap();
        let poses = numbers.chunks(5).map(|pose| pose.try_into().unwrap());
        poses.collect()
    }

    #[test]
    fn two_runs_lie_over_each_other_from_their_starts_on() {
        let (first, second) = (run(20.0, 60.0), run(5.0, 40.0));
        assert_eq!((began(&first), began(&second)), (at(20.0), at(5.0)));
        let ghost = Ghost::of("second".to_owned(), &second).unwrap();
        let poses = poses(&ghost, began(&first));
        // Ten seconds after both starts it has driven ten metres.
        let then = poses
            .iter()
            .find(|pose| (pose[0] - 300).abs() <= 2)
            .unwrap();
        let driven_cm = (then[0] - 200) * 10;
        assert_eq!(then[1..], [driven_cm, 200, 50, 0]);
        assert_eq!(poses[0][0], 150, "it began five seconds before its start");
    }

    #[test]
    fn a_run_without_a_start_begins_with_its_first_word_and_one_without_places_is_no_ghost() {
        let never = run(1e6, 10.0);
        assert_eq!(began(&never), at(0.0));
        assert_eq!(began(&[]), Time::ZERO);
        let mut nowhere = state(1);
        nowhere.pose = None;
        let nowhere = [(at(1.0), heard(Message::State(nowhere)))];
        assert!(Ghost::of(String::new(), &nowhere).is_none());
    }

    #[test]
    fn of_a_long_run_all_is_told_more_coarsely() {
        let ghost = Ghost::of(String::new(), &run(0.0, 6000.0)).unwrap();
        let poses = poses(&ghost, Time::ZERO);
        assert!(poses.len() > POSES_MAX / 2 && poses.len() <= POSES_MAX);
        assert!(poses.last().unwrap()[0] > 59_970, "up to its end");
        assert!(poses.windows(2).all(|two| two[1][0] - two[0][0] <= 16));
    }
}
