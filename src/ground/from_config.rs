//! From a checked file to a ground station: its method of sweeping, its images, and itself. It decides nothing.

use std::time::Duration;

use tomoswarm_proto::{Boot, Lease};

use super::GroundNode;
use super::imager::{Imager, Subject};
use super::planner::{Method, Planner};
use super::station::{Station, StationSettings};
use crate::config::{Imaging, Planner as PlannerName, Sim, Solver as SolverName, Sweep, Weights};
use crate::geom::{Lattice, PixelGrid, Rect};
use crate::sweep::Ring;
use crate::tomo::{MapSettings, Prior, SPOT_M, Settings as ImageSettings, Solver, TomoError, WeightModel};

/// A vehicle is lost when it has been silent for so long while others were heard.
pub const LOST_AFTER: Duration = Duration::from_secs(30);
/// A vehicle without a bus carries on under its plan for so long.
pub const AUTONOMY: Duration = Duration::from_secs(60);

/// Makes the ground station of a simulation's file, with the positions that are measured from; `store` names its
/// store of samples.
///
/// # Errors
/// The image has an impossible grid.
pub fn ground_node(sim: &Sim, ring: Ring, lease: Lease, store: u64) -> Result<GroundNode, TomoError> {
    let station = Station::new(StationSettings {
        vehicles: sim.vehicle_ids().collect(),
        lease: Some(lease),
        holder: lease.holder,
        take_over: false,
        boot: Boot(1),
        compare_with: None,
        lost_after: LOST_AFTER,
        autonomy: AUTONOMY,
        store,
        lattice: Lattice::new(sim.venue.cell_m),
        bin_m: sim.imaging.bin_m,
        spot_m: SPOT_M,
    });
    let planner = Planner::new(ring, method(&sim.sweep), sim.safety.separation_m, sim.durations.planner);
    let image = |subject| image_settings(&sim.imaging, sim.venue.area, sim.radio.sensitivity_dbm, subject);
    let imager = Imager::new(image(Subject::Change), image(Subject::Structure), sim.durations.imager)?;
    Ok(GroundNode::new(station, planner, imager))
}

/// Gives the planner of a sweep.
pub fn method(sweep: &Sweep) -> Method {
    let laps = sweep.laps;
    match sweep.planner {
        PlannerName::RotatingGap => Method::RotatingGap { laps },
        PlannerName::Fan => {
            let (dwell, dwell_limit) = (sweep.dwell, sweep.dwell_limit);
            Method::Fan { rounds: laps, dwell, dwell_limit }
        }
    }
}

/// Gives how an image is made of a subject: the defaults for the area, and what the file says.
/// `sensitivity_dbm` is the weakest packet that a receiver hears.
pub fn image_settings(
    imaging: &Imaging,
    area: Rect,
    sensitivity_dbm: f64,
    subject: Subject,
) -> ImageSettings {
    let mut settings = ImageSettings::for_area(area);
    settings.grid = PixelGrid { area, columns: imaging.columns, rows: imaging.rows };
    settings.shortest_link_m = imaging.min_link_m;
    settings.pairing_m = imaging.bin_m;
    settings.noise.sensitivity_dbm = sensitivity_dbm;
    settings.peaks.rim_m = imaging.rim_m;
    settings.peaks.limit = imaging.peaks;
    settings.peaks.separation_m = imaging.peak_separation_m;
    settings.weights = match imaging.weights {
        Weights::Line => WeightModel::Line,
        Weights::Ellipse => WeightModel::Ellipse { width_m: imaging.width_m },
        Weights::InverseArea => WeightModel::InverseArea { width_m: imaging.width_m },
    };
    let prior = match subject {
        Subject::Change => imaging.prior,
        Subject::Structure => imaging.structure_prior,
    };
    let sigma = prior.sigma_db_per_m;
    let prior = Prior { variance: sigma * sigma, length_m: prior.correlation_length_m };
    settings.solver = match imaging.solver {
        SolverName::Map => Solver::Map(prior, MapSettings::default()),
        SolverName::Tikhonov => ImageSettings::tikhonov_for(area),
    };
    settings
}
