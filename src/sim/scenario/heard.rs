//! A run to which somebody listens who is no node. It adds nothing to the run.

use super::{RunError, RunOutcome, RunView, Scenario};
use crate::sim::bus::BusListener;
use crate::sim::kernel::Kernel;

impl Scenario {
    /// Runs the scenario as [`Scenario::run`] does, and lets somebody listen to what operators hear.
    ///
    /// # Errors
    /// As for [`Scenario::run`].
    pub fn run_heard(
        &self,
        watch: &mut dyn FnMut(&RunView<'_>) -> bool,
        listener: BusListener,
    ) -> Result<RunOutcome, RunError> {
        let mut parts = self.parts()?;
        parts.bus = parts.bus.with_listener(listener);
        let mut kernel = Kernel::new(parts);
        kernel.run(watch, None)?;
        Ok(self.outcome(kernel)?)
    }
}
