//! What can be got to and seen of a scene, kept for all runs that share it: it does not depend on the mission, and on the
//! seed only where persons stand by chance.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::config::{Axis, Experiment};
use crate::sim::{Scenario, ScenarioError, VisibleScene};

type CacheEntry = Arc<OnceLock<Result<Arc<VisibleScene>, ScenarioError>>>;

/// What has been found so far, by the values of all axes that it depends on.
#[derive(Default)]
pub(super) struct VisibleSceneCache {
    known: Mutex<BTreeMap<Vec<String>, CacheEntry>>,
}

impl VisibleSceneCache {
    /// Returns what can be seen in a run. Who asks for the same at the same time waits for the first.
    ///
    /// # Errors
    /// The scene cannot be built.
    pub(super) fn of(
        &self,
        experiment: &Experiment,
        run: usize,
        scenario: &Scenario,
    ) -> Result<Arc<VisibleScene>, ScenarioError> {
        let is_drawn = scenario.sim().scene.random_persons.is_some();
        let matters = |axis: &Axis| *axis != Axis::Mission && (*axis != Axis::Seed || is_drawn);
        let key = Axis::ALL
            .iter()
            .filter(|axis| matters(axis))
            .map(|axis| experiment.name_of(run, *axis).to_owned());
        let entry = self
            .known
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .entry(key.collect())
            .or_default()
            .clone();
        entry
            .get_or_init(|| VisibleScene::find(scenario).map(Arc::new))
            .clone()
    }
}
