//! One vehicle as the ground sees it: what it has said last, and when it was heard. Does not know the other ones, and decides
//! nothing about orders (`fleet/dealings.rs`).

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Boot, Lease, MissionProgress, Order, RunId, SeenState, StandReason, State};

use super::order_ledger::OrderLedger;
use crate::geom::{Point, Vector};
use crate::sweep::{
    LOWER_BOOT_AFTER, LowerNumbers, OUT_OF_SERVICE_AFTER, VOID_AFTER, VehicleProgress,
};
use crate::time::Time;

/// One vehicle as the ground sees it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct FleetMember {
    /// Its newest state, and when it came.
    state: Option<(Time, State)>,
    /// States that came behind the newest one since.
    lower: LowerNumbers,
    progress: Option<VehicleProgress>,
    /// When that, or a later one, was said last.
    progress_at: Option<Time>,
    mission: Option<MissionProgress>,
    heard_at: Option<Time>,
    /// The fastest that it was heard to drive, m/s.
    fastest_mps: f64,
    dealings: OrderLedger,
    /// Since when it has said that it does not know its place.
    placeless_since: Option<Time>,
    is_out_of_service: bool,
}

/// What a message of a vehicle has shown.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct FleetChange {
    /// Its software has been started anew.
    pub restarted: bool,
    /// It was lost, and is back.
    pub found: bool,
    /// It does not go on by itself from now on, or may again.
    pub drops_out: Option<bool>,
    /// It has made progress with its plan.
    pub made_progress: bool,
    /// It is over with another stop of its plan.
    pub left_stop: bool,
    /// Somebody else has ordered it to begin this run.
    pub started: Option<RunId>,
}

impl FleetMember {
    /// Returns its newest state.
    pub(crate) fn state(&self) -> Option<&State> {
        self.state.as_ref().map(|(_, state)| state)
    }

    /// Returns its newest state, as plans and orders name it; `None` = it was not heard.
    pub(crate) fn seen_state(&self) -> Option<SeenState> {
        self.state().map(|state| SeenState {
            boot: state.boot,
            sequence: state.sequence,
        })
    }

    /// Returns where it is; `None` when it was not heard, or does not know well enough.
    pub(crate) fn place(&self) -> Option<Point> {
        let knows = |state: &&State| state.stands_under != Some(StandReason::NoPlace);
        let pose = self.state().filter(knows)?.pose;
        pose.map(|pose| pose.at.into())
    }

    /// Returns whether it does not go on, whatever it is told: its battery is low, its range sensors do not answer, or it
    /// has not known its place for long.
    pub(crate) fn is_out_of_service(&self) -> bool {
        self.is_out_of_service
    }

    /// Returns whether it said last that it rests, and is committed to no way.
    pub(crate) fn rests(&self) -> bool {
        self.state()
            .is_some_and(|state| state.is_at_rest && state.leg.is_none())
    }

    /// Returns whether nothing is to be expected of it: it is lost, or does not go on by itself.
    pub(crate) fn is_away(&self) -> bool {
        self.dealings.is_lost() || self.is_out_of_service()
    }

    /// Returns the fastest that it was heard to drive, m/s.
    pub(crate) fn fastest_mps(&self) -> f64 {
        self.fastest_mps
    }

    /// Returns its newest progress.
    pub(crate) fn progress(&self) -> Option<VehicleProgress> {
        self.progress
    }

    /// Returns what the newest start of its software has said of its mission last.
    pub(crate) fn mission(&self) -> Option<&MissionProgress> {
        self.mission.as_ref()
    }

    /// Returns when it last said its state. Progress alone is no sign of life: it comes on when the autopilot is silent.
    pub(crate) fn heard_at(&self) -> Option<Time> {
        self.heard_at
    }

    /// Returns what was dealt with it.
    pub(crate) fn dealings(&self) -> &OrderLedger {
        &self.dealings
    }

    /// Returns what was dealt with it, to be dealt with further.
    pub(crate) fn dealings_mut(&mut self) -> &mut OrderLedger {
        &mut self.dealings
    }

    /// Returns whether it is waited for, and was not heard yet.
    pub(crate) fn is_unheard(&self) -> bool {
        self.state.is_none() && !self.dealings.is_lost()
    }

    /// Returns whether a start of its software is the newest one heard, or newer.
    pub(crate) fn is_current(&self, boot: Boot) -> bool {
        self.dealings.boot().is_none_or(|known| known <= boot)
    }

    /// Takes a state, from a station that orders by `lease`; an older one changes nothing, unless older ones go on and nothing
    /// newer comes, and one of an earlier start only after a long silence.
    pub(crate) fn hear_state(&mut self, now: Time, state: State, lease: Lease) -> FleetChange {
        let key = |state: &State| (state.boot, state.sequence);
        let is_believed = match self.state().map(key) {
            _ if !self.is_current(state.boot) => self.counts_anew(now, state.boot),
            Some((boot, sequence)) if boot == state.boot && state.sequence < sequence => {
                self.lower.go_on(now, state.sequence)
            }
            Some(known) => known < key(&state),
            None => true,
        };
        if !is_believed {
            return FleetChange::default();
        }
        self.lower = LowerNumbers::default();
        let restarted = self.dealings.hear(state.boot);
        self.heard_at = Some(now);
        let found = self.dealings.find();
        let started = self
            .dealings
            .take_shown_order(state.ordered, state.accepted.0, lease);
        let started = started.or_else(|| self.dealings.under_way(&state));
        // Also when a start of before the stop was shown after it: what an open stop holds stands.
        if let Some(StandReason::Stop(_)) = state.stands_under {
            self.dealings.be_stopped(state.vehicle, lease);
        }
        let speed_mps = Vector::from(state.velocity).length_m();
        self.fastest_mps = self.fastest_mps.max(speed_mps);
        let was_out = self.is_out_of_service;
        self.is_out_of_service = self.note_whether_out(now, &state);
        self.state = Some((now, state));
        let drops_out = Some(self.is_out_of_service).filter(|is_out| *is_out != was_out);
        FleetChange {
            restarted,
            found,
            drops_out,
            made_progress: false,
            left_stop: false,
            started,
        }
    }

    /// Returns whether it is out by a new state.
    fn note_whether_out(&mut self, now: Time, state: &State) -> bool {
        self.placeless_since = match state.stands_under {
            Some(StandReason::NoPlace) => self.placeless_since.or(Some(now)),
            _ => None,
        };
        let is_too_long = |since| now.since(since) > OUT_OF_SERVICE_AFTER;
        match state.stands_under {
            None => false,
            Some(StandReason::Battery | StandReason::Blind) => true,
            // Of several reasons only the first is said.
            Some(_) => self.is_out_of_service || self.placeless_since.is_some_and(is_too_long),
        }
    }

    /// Takes a progress; one of an older start of the software changes nothing, nor does one behind what was said not long
    /// ago.
    pub(crate) fn hear_progress(&mut self, now: Time, progress: VehicleProgress) -> FleetChange {
        if !self.is_current(progress.boot) {
            return FleetChange::default();
        }
        let restarted = self.dealings.hear(progress.boot);
        let key = |progress: &VehicleProgress| (progress.run, progress.revision, progress.done);
        let before = self.progress.as_ref().map(key);
        let is_void = self.progress_at.is_none_or(|at| now.since(at) > VOID_AFTER);
        if before <= Some(key(&progress)) || is_void {
            (self.progress, self.progress_at) = (Some(progress), Some(now));
        }
        let made_progress = before < Some(key(&progress));
        FleetChange {
            restarted,
            made_progress,
            left_stop: made_progress && progress.done.is_some(),
            ..FleetChange::default()
        }
    }

    /// Takes what it says of its mission, unless an earlier start of its software has said it.
    pub(crate) fn hear_mission(&mut self, mission: &MissionProgress) {
        if self.is_current(mission.boot) {
            self.mission = Some(*mission);
        }
    }

    /// Counts its silence from a moment on, if it was not heard before.
    pub(crate) fn count_silence_from(&mut self, from: Time) {
        self.heard_at.get_or_insert(from);
    }

    /// Returns the order that is not yet seen in a state, answering the newest state heard.
    pub(crate) fn open_order(&self) -> Option<Order> {
        let seen = self.seen_state()?;
        Some(Order {
            seen: Some(seen),
            ..self.dealings.open_order()?.clone()
        })
    }

    /// Takes the open order for said.
    pub(crate) fn note_said(&mut self) {
        if self.state.is_some() {
            self.dealings.note_said();
        }
    }

    /// Takes up what was dealt with it before.
    pub(crate) fn recall(&mut self, dealings: OrderLedger) {
        self.dealings = dealings;
    }

    /// Returns whether a lower count of starts is believed: it has been silent for so long that its disk is a new one.
    fn counts_anew(&self, now: Time, boot: Boot) -> bool {
        !self.is_current(boot)
            && self
                .heard_at
                .is_some_and(|at| now.since(at) > LOWER_BOOT_AFTER)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::{OrderKind, Ordered, Revision, VehicleId};

    const LEASE: Lease = Lease {
        number: 1,
        holder: 9,
    };
    const RUN: RunId = RunId(1);

    fn at(at_s: u32) -> Time {
        Time::from_secs_f64(f64::from(at_s))
    }

    fn state(boot: u32, sequence: u64) -> State {
        let vehicle = VehicleId(1);
        State {
            vehicle,
            boot: Boot(boot),
            sequence,
            pose: Some(Default::default()),
            ..State::default()
        }
    }

    fn progress(boot: u32) -> VehicleProgress {
        let vehicle = VehicleId(1);
        VehicleProgress {
            vehicle,
            boot: Boot(boot),
            run: RUN,
            ..VehicleProgress::default()
        }
    }

    fn hear(member: &mut FleetMember, now_s: u32, boot: u32, sequence: u64) -> FleetChange {
        member.hear_state(at(now_s), state(boot, sequence), LEASE)
    }

    #[test]
    fn old_states_change_nothing() {
        let mut member = FleetMember::default();
        assert!(member.is_unheard() && member.place().is_none());
        hear(&mut member, 0, 1, 9);
        assert_eq!(hear(&mut member, 1, 1, 4), FleetChange::default());
        let newest = SeenState {
            boot: Boot(1),
            sequence: 9,
        };
        assert_eq!(
            (member.seen_state(), member.heard_at()),
            (Some(newest), Some(at(0)))
        );
        assert!(!member.is_unheard() && member.place().is_some());
    }

    #[test]
    fn who_cannot_go_on_is_out_until_it_can_and_who_lost_its_place_only_after_a_minute() {
        let mut member = FleetMember::default();
        let mut shows = |now_s: u32, stands_under: Option<StandReason>| {
            let state = State {
                stands_under,
                ..state(1, 1 + u64::from(now_s))
            };
            let drops_out = member.hear_state(at(now_s), state, LEASE).drops_out;
            (drops_out, member.is_out_of_service(), member.is_away())
        };
        let (battery, no_place) = (Some(StandReason::Battery), Some(StandReason::NoPlace));
        assert_eq!(shows(1, None), (None, false, false));
        assert_eq!(shows(2, battery), (Some(true), true, true));
        assert_eq!(shows(3, Some(StandReason::Blind)), (None, true, true));
        let held = Some(StandReason::Held);
        assert_eq!(shows(4, held), (None, true, true), "that may hide another");
        assert_eq!(shows(5, battery), (None, true, true));
        assert_eq!(shows(6, None), (Some(false), false, false));
        assert_eq!(shows(10, no_place), (None, false, false));
        assert_eq!(shows(70, no_place), (None, false, false));
        assert_eq!(shows(71, no_place), (Some(true), true, true));
        assert_eq!(shows(72, None), (Some(false), false, false));
        assert_eq!(shows(73, no_place), (None, false, false), "a new minute");
    }

    #[test]
    fn an_order_waits_until_it_is_heard_and_answers_the_newest_state() {
        let mut member = FleetMember::default();
        member.dealings_mut().start(VehicleId(1), LEASE, RUN);
        assert_eq!(member.open_order(), None);
        hear(&mut member, 0, 1, 5);
        let open = member.open_order().unwrap();
        assert_eq!(
            (open.revision, open.seen),
            (Revision(1), member.seen_state())
        );
        let ordered = Ordered {
            lease: LEASE,
            revision: Revision(1),
            run: RUN,
            kind: Some(OrderKind::Start),
        };
        member.hear_state(
            at(1),
            State {
                ordered,
                ..state(1, 6)
            },
            LEASE,
        );
        assert_eq!(member.open_order(), None);
    }

    #[test]
    fn who_drives_a_leg_is_under_way_though_it_was_started_before_it_was_heard() {
        let ordered = Ordered {
            lease: LEASE,
            revision: Revision(1),
            run: RUN,
            kind: Some(OrderKind::Start),
        };
        let accepted = (RUN, Revision(3));
        let mut member = FleetMember::default();
        let rests = State {
            ordered,
            accepted,
            ..state(1, 1)
        };
        assert_eq!(member.hear_state(at(0), rests, LEASE).started, None);
        let drives = State {
            ordered,
            accepted,
            leg: Some(Default::default()),
            ..state(1, 2)
        };
        assert_eq!(
            member.hear_state(at(1), drives.clone(), LEASE).started,
            Some(RUN)
        );
        let drives = State {
            sequence: 3,
            ..drives
        };
        assert_eq!(
            member.hear_state(at(2), drives, LEASE).started,
            None,
            "that is known"
        );
    }

    #[test]
    fn a_restart_is_seen_and_what_was_said_before_it_counts_no_more() {
        let mut member = FleetMember::default();
        assert!(!hear(&mut member, 0, 1, 100).restarted);
        assert!(hear(&mut member, 0, 2, 1).restarted);
        assert_eq!(
            member.hear_progress(Time::ZERO, progress(1)),
            FleetChange::default()
        );
        assert!(member.hear_progress(Time::ZERO, progress(2)).made_progress);
        assert!(member.hear_progress(Time::ZERO, progress(3)).restarted);
        let mission = |boot| MissionProgress {
            vehicle: VehicleId(1),
            boot: Boot(boot),
            ..MissionProgress::default()
        };
        member.hear_mission(&mission(2));
        assert_eq!(member.mission(), None);
        member.hear_mission(&mission(3));
        assert_eq!(member.mission(), Some(&mission(3)));
    }

    #[test]
    fn a_vehicle_with_a_new_disk_is_believed_after_a_long_silence_and_has_restarted() {
        let mut member = FleetMember::default();
        hear(&mut member, 0, 9, 100);
        assert_eq!(
            hear(&mut member, 30, 1, 7),
            FleetChange::default(),
            "30 s are not long enough"
        );
        assert!(!member.is_current(Boot(1)));
        assert!(hear(&mut member, 31, 1, 8).restarted);
        assert!(
            member.is_current(Boot(1))
                && member.hear_progress(Time::ZERO, progress(1)).made_progress
        );
        assert!(
            !hear(&mut member, 32, 1, 9).restarted,
            "it is heard by its own count now"
        );
    }

    #[test]
    fn who_was_lost_is_found_by_a_newer_state_alone() {
        let mut member = FleetMember::default();
        hear(&mut member, 0, 1, 5);
        member.dealings_mut().lose();
        assert!(
            !hear(&mut member, 1, 1, 5).found
                && !member.hear_progress(Time::ZERO, progress(1)).found
        );
        assert!(hear(&mut member, 1, 1, 6).found && !member.dealings().is_lost());
    }
}
