//! What is worth a warning before a scenario is run: persons whom nobody can find, and a mission that is given up before it can
//! end. It prints nothing.

use super::person_checks;
use crate::config::{Expect, Sim};
use crate::sim::{Scenario, ScenarioError};

/// Returns a line for each thing that is to be known of a scenario before it is run.
///
/// # Errors
/// The scene cannot be built.
pub(super) fn warnings(scenario: &Scenario) -> Result<Vec<String>, ScenarioError> {
    let mut lines = person_checks::warnings(scenario)?;
    lines.extend(endless(scenario.sim()));
    Ok(lines)
}

/// Returns that a mission cannot end in time. It is no mistake: a page may show it as long as it is looked at.
fn endless(sim: &Sim) -> Option<String> {
    let is_awaited = sim.is_endless() && sim.expect == Expect::Finished;
    is_awaited.then(|| {
        format!(
            "the patrol goes on until the battery is low, after {:.0} s at the earliest, and the run is given up after {} s (until_s): \
             it will count as not finished; for another end give `rounds` or `duration_s` in [mission], or a larger until_s",
            sim.low_battery_after_s(),
            sim.until_s
        )
    })
}
