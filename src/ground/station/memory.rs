//! What a station that is started anew needs to go on where it was.
//!
//! The station says [`super::Out::Remember`] *before* everything else that it says in the same step, whenever something in
//! it has changed; the edge stores it before it publishes what follows (or, in trouble, as soon as it can). So no vehicle
//! ever follows a revision or obeys an order that a resumed station does not know, and a revision is never given twice.
//! What can be heard again is not
//! kept: states, progress, who reports a revision. Samples and tiles come from their own tables. Times are kept but count
//! for nothing: the next start of the station has another clock.
//!
//! A resumed station listens first and takes a lease above the highest echo; the same plans go out under the new lease.
//! It plans anew only when something is wrong: a vehicle was restarted or lost meanwhile, or shows a revision that it
//! has not given. Plans that were being made are asked for again, and pictures that were due are made again.

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{Lease, Revision, RunId, VehicleId};

use super::execution::{ExecutionPhase, SweepExecution, SweepRun};
use super::order_in_force::OrderInForce;
use super::pictures::Pictures;
use super::run_registry::RunRegistry;
use crate::ground::fleet::{Fleet, OrderLedger};
use crate::sweep::Succession;

/// The parts of which something is remembered, as they are now.
#[derive(Clone, Copy, Debug)]
pub(super) struct PartsToRemember<'a> {
    /// The id of the sample store.
    pub store: u64,
    pub lease: Lease,
    pub fleet: &'a Fleet,
    pub order: OrderInForce,
    pub runs: &'a RunRegistry,
    pub execution: &'a SweepExecution,
    pub pictures: &'a Pictures,
}

/// All that is remembered but the plans, which change only with their revision.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(super) struct StoredState {
    store: u64,
    lease: Lease,
    dealings: Vec<(VehicleId, OrderLedger)>,
    order: OrderInForce,
    runs: RunRegistry,
    phase: ExecutionPhase,
    /// Which plans there are, and for whom.
    edition: Option<(RunId, Revision, Vec<VehicleId>)>,
    pictures: Pictures,
}

/// What a station that is started anew needs; only for the version of the program that wrote it.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct StationMemory {
    state: StoredState,
    plans: Option<Succession>,
}

/// The parts of a station that goes on where an earlier one was.
#[derive(Debug)]
pub(super) struct RestoredParts {
    pub store: u64,
    pub lease: Lease,
    pub dealings: Vec<(VehicleId, OrderLedger)>,
    pub order: OrderInForce,
    pub runs: RunRegistry,
    pub execution: SweepExecution,
    pub pictures: Pictures,
}

impl StationMemory {
    /// Returns what is to be remembered, if that is another thing than what is stored.
    pub(super) fn of_changes(
        stored: Option<&StoredState>,
        parts: PartsToRemember<'_>,
    ) -> Option<StationMemory> {
        let is_known = stored.is_some_and(|stored| stored.is_of(parts));
        (!is_known).then(|| StationMemory {
            state: StoredState::of(parts),
            plans: parts.execution.plans().succession().cloned(),
        })
    }

    pub(super) fn state(&self) -> &StoredState {
        &self.state
    }

    /// Makes the parts of a station that goes on.
    pub(super) fn restore(self) -> RestoredParts {
        let StationMemory { state, plans } = self;
        RestoredParts {
            store: state.store,
            lease: state.lease,
            dealings: state.dealings,
            order: state.order,
            runs: state.runs,
            execution: SweepExecution::restored(state.phase, plans),
            pictures: state.pictures.restored(),
        }
    }

    /// Returns the run that is under way, if any.
    pub fn run(&self) -> Option<RunId> {
        self.state.phase.sweep().map(SweepRun::run)
    }
}

impl StoredState {
    /// Takes a copy of the parts as they are.
    pub(super) fn of(parts: PartsToRemember<'_>) -> StoredState {
        let edition = edition_of(parts.execution);
        StoredState {
            store: parts.store,
            lease: parts.lease,
            dealings: parts.fleet.dealings(),
            order: parts.order,
            runs: parts.runs.clone(),
            phase: parts.execution.phase().clone(),
            edition: edition.map(|(run, revision, members)| (run, revision, members.to_vec())),
            pictures: parts.pictures.clone(),
        }
    }

    /// Returns whether it is a copy of the parts as they are, whatever their times. It is asked after every step, so nothing
    /// is copied.
    fn is_of(&self, parts: PartsToRemember<'_>) -> bool {
        // Taken apart, so that none can be forgotten.
        let StoredState {
            store,
            lease,
            dealings,
            order,
            runs,
            phase,
            edition,
            pictures,
        } = self;
        let edition = edition
            .as_ref()
            .map(|(run, revision, members)| (*run, *revision, &members[..]));
        let dealings = dealings.iter().map(|(id, dealings)| (*id, dealings));
        let members = parts.fleet.members();
        *store == parts.store
            && *lease == parts.lease
            && *order == parts.order
            && edition == edition_of(parts.execution)
            && phase.is_same_but_for_times(parts.execution.phase())
            && members
                .map(|(id, member)| (id, member.dealings()))
                .eq(dealings)
            && runs.is_same_but_for_times(parts.runs)
            && pictures.is_same_but_for_times(parts.pictures)
    }
}

/// Returns which plans there are, and for whom.
fn edition_of(execution: &SweepExecution) -> Option<(RunId, Revision, &[VehicleId])> {
    let plans = execution.plans().succession()?;
    Some((plans.run(), plans.revision(), plans.members()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::imager::{ImageStage, Subject};
    use crate::ground::station::pictures::PictureName;
    use crate::ground::station::run_registry::RequestedSweep;
    use crate::time::Time;
    use tomoswarm_proto::OrderKind;

    /// The parts of a station that was just made, with one vehicle.
    struct Parts {
        lease: Lease,
        fleet: Fleet,
        order: OrderInForce,
        runs: RunRegistry,
        execution: SweepExecution,
        pictures: Pictures,
    }

    impl Parts {
        fn new() -> Parts {
            Parts {
                lease: Lease::default(),
                fleet: Fleet::new(&[VehicleId(1)], Lease::default()),
                order: OrderInForce::default(),
                runs: RunRegistry::default(),
                execution: SweepExecution::default(),
                pictures: Pictures::default(),
            }
        }

        fn parts_to_remember(&self) -> PartsToRemember<'_> {
            PartsToRemember {
                store: 7,
                lease: self.lease,
                fleet: &self.fleet,
                order: self.order,
                runs: &self.runs,
                execution: &self.execution,
                pictures: &self.pictures,
            }
        }
    }

    /// Returns whether something is remembered after a change; if so, only once.
    fn is_remembered_after(change: impl FnOnce(&mut Parts)) -> bool {
        let mut parts = Parts::new();
        let stored = StoredState::of(parts.parts_to_remember());
        let nothing = StationMemory::of_changes(Some(&stored), parts.parts_to_remember());
        assert_eq!(nothing, None, "nothing has changed");
        change(&mut parts);
        let memory = StationMemory::of_changes(Some(&stored), parts.parts_to_remember());
        if let Some(memory) = &memory {
            let again = StationMemory::of_changes(Some(memory.state()), parts.parts_to_remember());
            assert_eq!(again, None);
        }
        memory.is_some()
    }

    #[test]
    fn whatever_changes_is_remembered_once() {
        let picture = PictureName {
            run: RunId(1),
            laps: 1,
            subject: Subject::Change,
            stage: ImageStage::Last,
        };
        let plans = Succession::new(RunId(1), &[], Revision(3));
        let begun = ExecutionPhase::Stopping {
            sweep: SweepRun::new(RequestedSweep {
                run: RunId(1),
                compared_with: None,
            }),
            since: Time::ZERO,
        };
        assert!(is_remembered_after(|it| it.lease.number = 4));
        assert!(is_remembered_after(|it| {
            it.fleet.lose_unheard(Time::ZERO);
        }));
        assert!(is_remembered_after(|it| {
            it.order.update(Some(OrderKind::Hold));
        }));
        assert!(is_remembered_after(|it| it.runs.close(RunId(1))));
        assert!(is_remembered_after(|it| {
            it.execution = SweepExecution::restored(begun, None);
        }));
        assert!(is_remembered_after(|it| {
            it.execution = SweepExecution::restored(ExecutionPhase::default(), Some(plans));
        }));
        assert!(is_remembered_after(|it| {
            it.pictures.take(picture);
        }));
    }

    #[test]
    fn times_are_nothing_to_remember() {
        assert!(!is_remembered_after(|it| {
            it.runs.count_from(Time::from_secs_f64(9.0));
            it.execution.count_from(Time::from_secs_f64(9.0));
        }));
    }

    #[test]
    fn what_is_restored_is_what_was_remembered() {
        let mut parts = Parts::new();
        parts.runs.close(RunId(1));
        parts.lease.number = 4;
        parts.fleet.lose_unheard(Time::ZERO);
        let memory = StationMemory::of_changes(None, parts.parts_to_remember()).unwrap();
        let state = memory.state().clone();
        assert_eq!((state.store, state.lease), (7, parts.lease));
        assert_eq!(memory.run(), None);
        let restored = memory.restore();
        assert_eq!(restored.dealings, parts.fleet.dealings());
        let again = Parts {
            lease: restored.lease,
            order: restored.order,
            runs: restored.runs,
            execution: restored.execution,
            pictures: restored.pictures,
            ..parts
        };
        assert!(state.is_of(again.parts_to_remember()));
    }
}
