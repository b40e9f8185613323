//! The runs of a scenario: watched, recorded, listened to. None of it changes the run.

use std::time::Duration;

use super::super::bus::BusListener;
use super::super::entry::RecordingEntry;
use super::super::kernel::{Kernel, Parts, Recording};
use super::super::outcome::RunOutcome;
use super::super::run_view::RunView;
use super::{Scenario, ScenarioError};
use crate::actor::Fault;
use crate::scene::SceneError;

/// Why a run came to no outcome.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The scenario is impossible.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// An actor cannot go on.
    #[error(transparent)]
    Fault(#[from] Fault),
}

impl From<SceneError> for RunError {
    fn from(error: SceneError) -> RunError {
        RunError::Scenario(ScenarioError::Scene(error))
    }
}

impl Scenario {
    /// Runs the scenario; `watch` is asked every `shown_every` of virtual time whether to go on.
    ///
    /// # Errors
    /// The scenario is impossible, or an actor cannot go on.
    pub fn run(&self, watch: &mut dyn FnMut(&RunView<'_>) -> bool) -> Result<RunOutcome, RunError> {
        self.run_parts(self.parts()?, watch, None)
    }

    /// Runs the scenario as [`Scenario::run`] does, and hands every step of every actor to `record`; a segment with
    /// snapshots comes first, and again every `segment` of virtual time.
    ///
    /// # Errors
    /// As for [`Scenario::run`].
    pub fn run_recorded(
        &self,
        watch: &mut dyn FnMut(&RunView<'_>) -> bool,
        segment: Duration,
        record: &mut dyn FnMut(RecordingEntry),
    ) -> Result<RunOutcome, RunError> {
        let recording = Recording::to(record, segment);
        self.run_parts(self.parts()?, watch, Some(recording))
    }

    /// Runs the scenario as [`Scenario::run`] does, and lets somebody listen to what operators hear.
    ///
    /// # Errors
    /// As for [`Scenario::run`].
    pub fn run_heard(
        &self,
        watch: &mut dyn FnMut(&RunView<'_>) -> bool,
        listener: BusListener,
    ) -> Result<RunOutcome, RunError> {
        self.run_parts(self.parts_with(listener)?, watch, None)
    }

    /// Does both: [`Scenario::run_heard`] and [`Scenario::run_recorded`].
    ///
    /// # Errors
    /// As for [`Scenario::run`].
    pub fn run_heard_and_recorded(
        &self,
        watch: &mut dyn FnMut(&RunView<'_>) -> bool,
        listener: BusListener,
        segment: Duration,
        record: &mut dyn FnMut(RecordingEntry),
    ) -> Result<RunOutcome, RunError> {
        let recording = Recording::to(record, segment);
        self.run_parts(self.parts_with(listener)?, watch, Some(recording))
    }

    fn parts_with(&self, listener: BusListener) -> Result<Parts, RunError> {
        let mut parts = self.parts()?;
        parts.bus = parts.bus.with_listener(listener);
        Ok(parts)
    }

    /// Runs what the scenario is made of to the end.
    fn run_parts(
        &self,
        parts: Parts,
        watch: &mut dyn FnMut(&RunView<'_>) -> bool,
        recording: Option<Recording<'_>>,
    ) -> Result<RunOutcome, RunError> {
        let mut kernel = Kernel::new(parts);
        kernel.run(watch, recording)?;
        Ok(self.outcome(kernel)?)
    }
}
