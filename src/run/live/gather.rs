//! What a live run leaves behind, as a simulation in virtual time leaves it: from the ground station's store and from what
//! the world's referee saw. It changes nothing and writes nothing.

use std::path::Path;

use tomoswarm_proto::{RunId, VehicleId};

use super::scenario_runner::RunLog;
use crate::geom::{Lattice, Point};
use crate::ground::MeasuredSample;
use crate::map::Merged;
use crate::run::link::Contact;
use crate::sim::{Collision, EMPTY_RUN, RUN, RunCounts, RunOutcome, Scenario, ScenarioError};
use crate::store::StoreError;
use crate::store::ground::{GroundStore, StoredImage};
use crate::time::Time;
use crate::tomo::{Link, LinkBins, Reconstruction, SPOT_M};

/// Why nothing can be gathered.
#[derive(Debug, thiserror::Error)]
pub enum GatherError {
    /// The store cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The scene cannot be built.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
}

/// What the store of a ground station holds of a scenario.
struct Stored {
    samples: u64,
    measured: Option<Vec<MeasuredSample>>,
    links: Vec<Link>,
    empty_links: Vec<Link>,
    change: Option<Reconstruction>,
    structure: Option<Reconstruction>,
    map: Merged,
}

/// Gathers an outcome; `failure` is why it is none of a whole mission. A mission that failed may have no store.
///
/// # Errors
/// [`GatherError`].
pub fn outcome(
    scenario: &Scenario,
    store: &Path,
    run_log: RunLog,
    tracks: Vec<(VehicleId, Vec<Point>)>,
    failure: Option<String>,
) -> Result<RunOutcome, GatherError> {
    let stored = match read(scenario, store) {
        Err(_) if failure.is_some() => Stored::nothing(scenario),
        read => read?,
    };
    let RunLog {
        log,
        bytes,
        messages,
        world,
        is_done,
        missions,
        home,
    } = run_log;
    let finished = is_done && failure.is_none();
    Ok(RunOutcome {
        finished,
        home,
        held: 0,
        failure: failure.or_else(|| (!finished).then(|| unended(scenario).to_owned())),
        simulated: Time::from_nanos(world.now_ns),
        collisions: world.collisions.iter().map(collision).collect(),
        fence_breaches: usize::try_from(world.fence_breaches).unwrap_or(usize::MAX),
        breaches: Vec::new(),
        min_separation_m: world.min_separation_m,
        samples: stored.samples,
        measured: stored.measured,
        links: stored.links,
        empty_links: stored.empty_links,
        change: stored.change,
        structure: stored.structure,
        not_made: Vec::new(),
        silences: Vec::new(),
        map: stored.map,
        tracks,
        missions,
        places: Vec::new(),
        persons: scenario.persons().to_vec(),
        ways: scenario.ways(Time::from_nanos(world.now_ns)),
        outlines: scenario.outlines()?,
        counts: RunCounts {
            events: 0,
            scans: world.scans,
            beacons_heard: world.beacons_heard,
            collided_beacons: world.collided_beacons,
            dropped_commands: world.dropped,
            messages,
        },
        bus_bytes: bytes,
        log: log.into_text(),
    })
}

fn unended(scenario: &Scenario) -> &'static str {
    match scenario.sim().is_planned_by_ground() {
        true => "the sweep did not end",
        false => "not every mission has ended",
    }
}

impl Stored {
    fn nothing(scenario: &Scenario) -> Stored {
        let map = Merged::new(Lattice::new(scenario.sim().venue.cell_m), None);
        Stored {
            samples: 0,
            measured: scenario.keeps_samples.then(Vec::new),
            links: Vec::new(),
            empty_links: Vec::new(),
            change: None,
            structure: None,
            map,
        }
    }
}

fn read(scenario: &Scenario, store: &Path) -> Result<Stored, StoreError> {
    let store = GroundStore::open_to_read(store)?;
    let (samples, now) = bins(scenario, &store, RUN)?;
    let empty = match scenario.sim().empty_sweep {
        true => bins(scenario, &store, EMPTY_RUN)?.1,
        false => LinkBins::default(),
    };
    let (links, empty_links, _) = now.links_against(&empty);
    let images = store.newest_images(RUN)?;
    let image = |kind: &str| images.iter().find(|image| image.kind == kind).map(picture);
    let mut stored = Stored {
        samples,
        links,
        empty_links,
        change: image("change"),
        structure: image("structure"),
        ..Stored::nothing(scenario)
    };
    if let Some(measured) = &mut stored.measured {
        store.each_sample(None, |sample| measured.push(sample))?;
    }
    for tile in store.tiles()? {
        // One that cannot be joined was not joined by the ground station either.
        let _ = stored.map.join(&tile);
    }
    Ok(stored)
}

/// Returns how many samples a run has, and the bins in which the ground station pools them.
fn bins(
    scenario: &Scenario,
    store: &GroundStore,
    run: RunId,
) -> Result<(u64, LinkBins), StoreError> {
    let mut bins = LinkBins::new(scenario.sim().imaging.bin_m, SPOT_M);
    let mut count = 0;
    store.each_sample(Some(run), |stored| {
        bins.record_sample(stored.vehicle, &stored.sample);
        count += 1;
    })?;
    Ok((count, bins))
}

fn picture(stored: &StoredImage) -> Reconstruction {
    Reconstruction {
        image: stored.image.clone(),
        peaks: stored.peaks.clone(),
        residual_rms_db: stored.residual_rms_db,
        used: stored.links,
        dropped: Default::default(),
        path_loss: None,
        by_empty_sweep: stored.kind == "change",
        finds: stored.finds.clone(),
        deviation: stored.deviation.clone(),
        shares: None,
        choice: None,
        links: None,
    }
}

fn collision(contact: &Contact) -> Collision {
    let Contact {
        at_ns,
        vehicle,
        with,
        place,
    } = *contact;
    Collision {
        at: Time::from_nanos(at_ns),
        vehicle,
        with,
        place,
    }
}
