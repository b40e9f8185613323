//! What a vehicle does whose mission has ended: it goes home, where it stands in nobody's way; and where it does, it makes
//! room.

use tomoswarm_proto::VehicleId;

use super::{Destination, Phase, RunnerContext, StepRunner};
use crate::node::mission::MissionEvent;
use crate::node::mission::aside::{Bound, ROOM_AFTER_LOOKS};
use crate::node::mission::home::HOME_M;

/// So many waits for peers in a row on the way home, and the return in order is waited for.
const HOME_WAITS_MAX: u32 = 80;

impl StepRunner {
    /// The mission has ended: the vehicle goes home over what is known, or else over what nobody has seen, since peers may
    /// have to pass where it stands; if it cannot it stays until it is sent.
    pub(super) fn head_home(&mut self, scene: &mut RunnerContext<'_>) {
        let (pose, home) = (scene.pose(), self.settings.home);
        if home.distance_to(pose.at) <= HOME_M || self.tries.are_spent() {
            self.phase = Phase::Over;
            return;
        }
        let may_wait = self.yields.in_a_row() < HOME_WAITS_MAX;
        if may_wait {
            let first = self.lets_first(scene);
            if !first.is_empty() {
                return self.yield_saying(scene, |_, _| MissionEvent::LetsFirst(first));
            }
        }
        let claims = scene.surroundings().claims();
        let courses = self.courses(scene);
        let course = [false, true]
            .into_iter()
            .find_map(|unknown_allowed| courses.course_to(home, unknown_allowed, &claims).ok());
        match course {
            Some(course) => self.drive(scene, &course, Destination::Home),
            None if may_wait => self.yield_to_peers(scene),
            None => self.phase = Phase::Over,
        }
    }

    /// At its home, makes room for a peer that stands and waits, although nothing is left to be done but to stand. One whose
    /// motors are off stays: people may be near.
    pub(super) fn make_room(&mut self, scene: &mut RunnerContext<'_>) {
        let is_home = self.settings.home.distance_to(scene.pose().at) <= HOME_M;
        if !self.barring.are_due(scene.now) || !scene.state.is_armed || !is_home {
            return;
        }
        let search = scene.terrain.search(scene.now, scene.pose());
        let waits = |bound: &Bound<'_>| {
            let goal = bound.peer.goal(scene.now);
            bound.peer.resting || goal.is_some_and(|goal| goal.waits)
        };
        let mut waiting = Bound::all(scene.peers, scene.now).filter(waits);
        let bars = waiting.any(|bound| bound.is_barred(&search, scene.pose().at));
        if self.barring.note(scene.now, bars) < ROOM_AFTER_LOOKS {
            return;
        }
        if let Some(course) = self.course_aside(scene) {
            // It has stood here for long, and waited on its way before: neither counts for what begins now.
            self.progress.get_on(scene.now);
            self.yields.end();
            self.tries.clear();
            self.barring.begin_anew();
            self.step_aside(scene, &course);
        }
    }

    /// Returns the peers that cannot get where they go once this vehicle is at home.
    fn lets_first(&self, scene: &RunnerContext<'_>) -> Vec<VehicleId> {
        let search = scene.terrain.search(scene.now, scene.pose());
        let home = self.settings.home;
        let all = Bound::all(scene.peers, scene.now);
        all.filter(|bound| bound.is_barred(&search, home))
            .map(|bound| bound.id)
            .collect()
    }
}
