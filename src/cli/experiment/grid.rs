//! An experiment with all files that it names, each read once, so that a file that changes under way changes nothing.

use std::collections::{BTreeMap, BTreeSet};
use std::hash::Hasher;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use fnv::FnvHasher;

use crate::cli::error::CliError;
use crate::cli::load::{self, LoadedSimulation};
use crate::cli::read;
use crate::config::{self, Experiment, Problems, Sim, SourceFile};
use crate::scene::VrmlScene;
use crate::sim::Scenario;

/// Cells that are named for a mistake.
const CELLS_NAMED: usize = 3;

type Load = Box<dyn FnMut(&str) -> Result<String, String> + Send>;

/// The files of an experiment.
struct Files {
    texts: BTreeMap<String, Result<String, String>>,
    /// Shapes by the file that holds them, and their upward axis.
    shapes: BTreeMap<(String, bool), Arc<VrmlScene>>,
    load: Load,
}

impl Files {
    fn text(&mut self, name: &str) -> Result<String, String> {
        let load = &mut self.load;
        self.texts
            .entry(name.to_owned())
            .or_insert_with(|| load(name))
            .clone()
    }

    fn shapes(&mut self, sim: &Sim) -> Result<Arc<VrmlScene>, CliError> {
        let key = (
            sim.scene.wrl.clone().unwrap_or_default(),
            sim.scene.up == config::Up::Y,
        );
        if let Some(known) = self.shapes.get(&key) {
            return Ok(known.clone());
        }
        let shapes = Arc::new(load::shapes_of(&sim.scene, &mut |name| self.text(name))?);
        self.shapes.insert(key, shapes.clone());
        Ok(shapes)
    }
}

/// An experiment, ready to be checked and run.
pub(super) struct ExperimentGrid {
    config: PathBuf,
    experiment: Experiment,
    files: Mutex<Files>,
}

impl ExperimentGrid {
    /// Reads an experiment's file.
    ///
    /// # Errors
    /// Everything that is wrong with it; the simulations are checked by [`ExperimentGrid::check`].
    pub(super) fn load(config: &Path) -> Result<ExperimentGrid, CliError> {
        ExperimentGrid::read(config, read::text(config)?)
    }

    /// Does the same with its text.
    ///
    /// # Errors
    /// As for [`ExperimentGrid::load`].
    pub(super) fn read(config: &Path, text: String) -> Result<ExperimentGrid, CliError> {
        let name = read::shown(config);
        let experiment = config::read_experiment(&name, &text)?;
        let texts = BTreeMap::from([(name, Ok(text))]);
        let load: Load = Box::new(read::around(config));
        let files = Mutex::new(Files {
            texts,
            shapes: BTreeMap::new(),
            load,
        });
        Ok(ExperimentGrid {
            config: config.to_owned(),
            experiment,
            files,
        })
    }

    /// Returns the experiment.
    pub(super) fn experiment(&self) -> &Experiment {
        &self.experiment
    }

    /// Makes every cell of the grid, and lists all that cannot be run.
    ///
    /// # Errors
    /// Every mistake once, with the cells that have it.
    pub(super) fn check(&self) -> Result<(), CliError> {
        let mut mistakes: Vec<(String, Vec<usize>)> = Vec::new();
        let mut index: BTreeMap<String, usize> = BTreeMap::new();
        for cell in 0..self.experiment.cells() {
            let Err(error) = self.check_cell(cell) else {
                continue;
            };
            for line in error.to_string().lines() {
                let place = *index.entry(line.to_owned()).or_insert_with(|| {
                    mistakes.push((line.to_owned(), Vec::new()));
                    mistakes.len() - 1
                });
                mistakes[place].1.push(cell);
            }
        }
        if mistakes.is_empty() {
            return Ok(());
        }
        Err(CliError::Usage(self.in_words(&mistakes)))
    }

    fn check_cell(&self, cell: usize) -> Result<(), CliError> {
        let seeds = self.experiment.seeds();
        let loaded = self.loaded(cell)?;
        load::scenario(
            loaded,
            Some(&self.config),
            self.experiment.seed_of(cell * seeds),
        )
        .map(drop)
    }

    fn in_words(&self, mistakes: &[(String, Vec<usize>)]) -> String {
        let (cells, seeds) = (self.experiment.cells(), self.experiment.seeds());
        let output = |(line, wrong): &(String, Vec<usize>)| {
            let keys: Vec<String> = wrong
                .iter()
                .take(CELLS_NAMED)
                .map(|cell| self.experiment.key(cell * seeds, false))
                .collect();
            let more = if wrong.len() > CELLS_NAMED {
                "; …"
            } else {
                ""
            };
            format!(
                "{line}\n  in {} of {cells} cells: {}{more}",
                wrong.len(),
                keys.join("; ")
            )
        };
        let list: Vec<String> = mistakes.iter().map(output).collect();
        format!(
            "{}: the grid cannot be run\n{}",
            self.config.display(),
            list.join("\n")
        )
    }

    fn sim(&self, cell: usize) -> Result<(Sim, Arc<VrmlScene>), CliError> {
        self.sim_and_names(cell)
            .map(|(sim, shapes, _)| (sim, shapes))
    }

    /// Returns the simulation of a cell, its shapes, and the names of the files that it was read from.
    fn sim_and_names(
        &self,
        cell: usize,
    ) -> Result<(Sim, Arc<VrmlScene>, BTreeSet<String>), CliError> {
        let mut files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        let mut names = BTreeSet::from([read::shown(&self.config)]);
        let sim: Result<Sim, Problems> = self.experiment.sim(cell, &mut |name| {
            names.insert(name.to_owned());
            files.text(name)
        });
        let sim = sim?;
        names.extend(sim.scene.wrl.clone());
        let shapes = files.shapes(&sim)?;
        Ok((sim, shapes, names))
    }

    fn loaded(&self, cell: usize) -> Result<LoadedSimulation, CliError> {
        let (sim, shapes) = self.sim(cell)?;
        Ok(LoadedSimulation::new(sim, VrmlScene::clone(&shapes)))
    }

    /// Makes the scenario of a run.
    ///
    /// # Errors
    /// What the files alone could not tell, for this seed.
    pub(super) fn scenario(&self, run: usize) -> Result<Scenario, CliError> {
        let (sim, shapes, names) = self.sim_and_names(run / self.experiment.seeds())?;
        let seed = self.experiment.seed_of(run).unwrap_or(sim.seed);
        let mut scenario = Scenario::new(sim, shapes.shapes.clone(), seed).map_err(|error| {
            match error.line() {
                Some(line) => CliError::Usage(format!("{line}: {error}")),
                None => CliError::Usage(error.to_string()),
            }
        })?;
        scenario.made_from = self.sources(&names);
        Ok(scenario)
    }

    /// Returns files that were read, by their names.
    fn sources(&self, names: &BTreeSet<String>) -> Vec<SourceFile> {
        let files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        let read = names
            .iter()
            .filter_map(|name| Some((name, files.texts.get(name)?.as_ref().ok()?)));
        read.map(|(name, text)| SourceFile::of(name, text.as_bytes()))
            .collect()
    }

    /// Returns a hash over all files that have been read, without their names; complete once the grid is checked.
    /// (FNV-1a, 64 bits.)
    pub(super) fn hash(&self) -> u64 {
        let files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        let mut hash = FnvHasher::default();
        for text in files.texts.values().filter_map(|text| text.as_ref().ok()) {
            hash.write(&(text.len() as u64).to_le_bytes());
            hash.write(text.as_bytes());
        }
        hash.finish()
    }
}
