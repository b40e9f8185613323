//! `sim --record`: the recordings of all nodes of a simulated run, a folder for each node.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::error::CliError;
use crate::config::{self, Config, Sim};
use crate::geom::Lattice;
use crate::sim::RecordingEntry;
use crate::sim::bus::NodeId;
use crate::store::recording::{OpenRecording, RecordingLimits, RecordingSubject, WriteError};

/// A new segment begins after this much virtual time.
pub(super) const SEGMENT: Duration = Duration::from_secs(300);
/// A simulated node may record so much, bytes; then its oldest segments go.
const CAP: u64 = 4 << 30;

/// The recordings of all nodes of a run.
pub(super) struct Flights {
    folder: PathBuf,
    settings: String,
    venue: String,
    lattice: Lattice,
    nodes: BTreeMap<String, (OpenRecording, u64)>,
    trouble: Option<WriteError>,
}

impl Flights {
    /// Makes recordings in a folder; `settings` is the text of the simulation's file.
    pub(super) fn new(folder: PathBuf, settings: String, sim: &Sim) -> Flights {
        let lattice = Lattice::new(sim.venue.cell_m);
        Flights {
            folder,
            settings,
            venue: config::to_toml(&Config::Venue(sim.venue.clone())),
            lattice,
            nodes: BTreeMap::new(),
            trouble: None,
        }
    }

    /// Takes what a run hands out; after the first trouble nothing more is written.
    pub(super) fn take(&mut self, entry: &RecordingEntry) {
        if self.trouble.is_none() {
            self.trouble = self.write(entry).err();
        }
    }

    /// Returns whether something could not be written.
    pub(super) fn is_in_trouble(&self) -> bool {
        self.trouble.is_some()
    }

    fn write(&mut self, entry: &RecordingEntry) -> Result<(), WriteError> {
        match entry {
            RecordingEntry::Segment {
                node,
                now,
                snapshots,
            } => {
                let (flight, segment) = self.flight(&name(*node));
                *segment = flight.begin(*now, None)?;
                snapshots
                    .iter()
                    .try_for_each(|snapshot| flight.snapshot(*segment, *now, snapshot))
            }
            RecordingEntry::Step(node, step) => {
                let (flight, segment) = self.flight(&name(*node));
                flight.step(*segment, step)
            }
        }
    }

    fn flight(&mut self, node: &str) -> &mut (OpenRecording, u64) {
        self.nodes.entry(node.to_owned()).or_insert_with(|| {
            let (settings, venue) = (self.settings.clone(), self.venue.clone());
            let lattice = self.lattice;
            let about = RecordingSubject {
                node: node.to_owned(),
                settings,
                venue,
                lattice,
                start: None,
                utc_at_zero_ns: None,
            };
            let limits = RecordingLimits {
                cap_bytes: CAP,
                segment_bytes: CAP,
                segment: SEGMENT,
                leaves_reserve: false,
            };
            (
                OpenRecording::new(&self.folder.join(folder_of(node)), about, limits),
                0,
            )
        })
    }

    /// Ends all recordings in order.
    ///
    /// # Errors
    /// Something could not be written.
    pub(super) fn end(self) -> Result<(), CliError> {
        let failed = |WriteError { path, reason }: WriteError| CliError::Write {
            path,
            source: std::io::Error::other(reason),
        };
        self.trouble.map_or(Ok(()), Err).map_err(failed)?;
        self.nodes
            .into_values()
            .try_for_each(|(flight, _)| flight.end())
            .map_err(failed)
    }
}

fn name(node: NodeId) -> String {
    match node {
        NodeId::Vehicle(id) => format!("vehicle/{id}"),
        NodeId::Ground => "ground".to_owned(),
        NodeId::Operator(operator) => format!("operator/{operator}"),
    }
}

fn folder_of(node: &str) -> PathBuf {
    Path::new(&node.replace('/', "-")).to_owned()
}
