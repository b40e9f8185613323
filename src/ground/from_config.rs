//! From a checked file to a ground station: its method of sweeping, its images, and itself. It decides nothing.

use std::time::Duration;

use tomoswarm_proto::{Boot, Lease, RunId, VehicleId};

use super::imager::{ImagerActor, Subject, SubjectSettings};
use super::planner::{Method, PlannerActor};
use super::station::StationSettings;
use crate::config::{
    GroundFile, Imaging, PlannerChoice, Sim, Solver as SolverName, SweepConfig, Venue, Weights,
};
use crate::geom::{Lattice, PixelGrid, Rect, Segment};
use crate::sweep::{PatternKind, Ring, SweepError};
use crate::tomo::{
    FindSettings, ImagingSettings as ImageSettings, MapSettings, Prior, SPOT_M, Solver, TomoError,
    WeightModel,
};

/// What a ground station is made of, before it begins.
#[derive(Clone, Debug)]
pub struct GroundParts {
    /// What the station is told.
    pub station: StationSettings,
    /// The planner of its sweeps.
    pub planner: PlannerActor,
    /// The maker of its images.
    pub imager: ImagerActor,
}

/// Why a ground station cannot be made of its file.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum PartsError {
    /// The positions cannot be laid around the area.
    #[error(transparent)]
    Ring(#[from] SweepError),
    /// The image has an impossible grid.
    #[error(transparent)]
    Image(#[from] TomoError),
}

/// Returns what the ground station of a simulation's file is made of, with the positions that are measured from; `store`
/// names its store of samples.
///
/// # Errors
/// The image has an impossible grid.
pub fn simulated_ground(
    sim: &Sim,
    ring: Ring,
    lease: Lease,
    store: u64,
) -> Result<GroundParts, TomoError> {
    let inputs = StationInputs {
        venue: &sim.venue,
        vehicles: sim.vehicle_ids().collect(),
        sweep: &sim.sweep,
        imaging: &sim.imaging,
        sensitivity_dbm: sim.radio.reception.sensitivity_dbm,
        planner_time: sim.durations.planner(),
        imager_time: sim.durations.imager(),
        office: StationIdentity {
            lease: Some(lease),
            holder: lease.holder,
            take_over: false,
            boot: Boot(1),
            compare_with: None,
            store,
        },
    };
    inputs.parts(ring)
}

/// Returns what the ground station of a node's file is made of; its answers are there as soon as they are found. `boot`
/// counts its starts, `holder` is drawn at random for its lease, `store` names its store of samples.
///
/// # Errors
/// The positions cannot be laid around the area; the image has an impossible grid.
pub fn ground_parts(
    file: &GroundFile,
    boot: Boot,
    holder: u64,
    store: u64,
) -> Result<GroundParts, PartsError> {
    let inputs = StationInputs {
        venue: &file.venue,
        vehicles: file.vehicles.clone(),
        sweep: &file.sweep,
        imaging: &file.imaging,
        sensitivity_dbm: file.reception.sensitivity_dbm,
        planner_time: Duration::ZERO,
        imager_time: Duration::ZERO,
        office: StationIdentity {
            lease: None,
            holder,
            take_over: file.take_over,
            boot,
            compare_with: file.compare_with,
            store,
        },
    };
    let ring = Ring::new(file.venue.area, file.sweep.positions)?;
    Ok(inputs.parts(ring)?)
}

/// What both kinds of files say.
struct StationInputs<'f> {
    venue: &'f Venue,
    vehicles: Vec<VehicleId>,
    sweep: &'f SweepConfig,
    imaging: &'f Imaging,
    sensitivity_dbm: f64,
    planner_time: Duration,
    imager_time: Duration,
    office: StationIdentity,
}

/// Who a station is, and by which right it speaks.
struct StationIdentity {
    lease: Option<Lease>,
    holder: u64,
    take_over: bool,
    boot: Boot,
    compare_with: Option<RunId>,
    store: u64,
}

impl StationInputs<'_> {
    fn parts(self, ring: Ring) -> Result<GroundParts, TomoError> {
        let swarm = &self.venue.swarm;
        let image = |subject| {
            let of = |imaging: &Imaging| {
                image_settings(imaging, self.venue.area, self.sensitivity_dbm, subject)
            };
            SubjectSettings {
                draft: of(&drafting(self.imaging)),
                last: of(self.imaging),
            }
        };
        let imager = ImagerActor::new(
            image(Subject::Change),
            image(Subject::Structure),
            self.imager_time,
            self.imaging.every,
        )?;
        let planner = PlannerActor::new(
            ring,
            method(self.sweep),
            swarm.separation_m,
            self.planner_time,
        );
        let station = StationSettings {
            vehicles: self.vehicles,
            lease: self.office.lease,
            holder: self.office.holder,
            take_over: self.office.take_over,
            boot: self.office.boot,
            compare_with: self.office.compare_with,
            lost_after: swarm.lost_after(),
            autonomy: swarm.autonomy(),
            fence_m: self.venue.fence.edges().map(Segment::length_m).sum(),
            store: self.office.store,
            lattice: Lattice::new(self.venue.cell_m),
            image_times: self.imaging.every,
            bin_m: self.imaging.bin_m,
            spot_m: SPOT_M,
        };
        Ok(GroundParts {
            station,
            planner,
            imager,
        })
    }
}

/// Returns the planner of a sweep.
pub fn method(sweep: &SweepConfig) -> Method {
    let laps = sweep.laps;
    match sweep.planner {
        PlannerChoice::RotatingGap => Method::RotatingGap { laps },
        PlannerChoice::Fan => {
            let (dwell, dwell_limit) = (sweep.dwell(), sweep.dwell_limit());
            Method::Fan {
                rounds: laps,
                dwell,
                dwell_limit,
            }
        }
        PlannerChoice::Calibrate => pattern(sweep, PatternKind::Calibrate),
        PlannerChoice::FanCorners => pattern(sweep, PatternKind::Fan),
        PlannerChoice::FanStraight => pattern(sweep, PatternKind::FanStraight),
    }
}

fn pattern(sweep: &SweepConfig, kind: PatternKind) -> Method {
    Method::Pattern {
        kind,
        dwell: sweep.dwell(),
        dwell_limit: sweep.dwell_limit(),
    }
}

/// Returns how pictures are made while a run lasts: `auto` would decide anew each time.
fn drafting(imaging: &Imaging) -> Imaging {
    let solver = match imaging.solver {
        SolverName::Auto => SolverName::Map,
        named => named,
    };
    Imaging { solver, ..*imaging }
}

/// Returns how an image is made of a subject: the defaults for the area, and what the file says.
/// `sensitivity_dbm` is the weakest packet that a receiver hears.
pub fn image_settings(
    imaging: &Imaging,
    area: Rect,
    sensitivity_dbm: f64,
    subject: Subject,
) -> ImageSettings {
    let mut settings = ImageSettings::for_area(area);
    if let Some((columns, rows)) = imaging.pixels {
        settings.grid = PixelGrid {
            area,
            columns,
            rows,
        };
    }
    settings.shortest_link_m = imaging.min_link_m;
    settings.pairing_m = imaging.bin_m;
    settings.noise.sensitivity_dbm = sensitivity_dbm;
    settings.peaks.rim_m = imaging.rim_m;
    settings.peaks.limit = imaging.peaks;
    settings.peaks.separation_m = imaging.peak_separation_m;
    settings.finds = FindSettings {
        false_per_image: imaging.false_finds_per_image,
        ..FindSettings::IN_METRES
    };
    settings.weights = match imaging.weights {
        Weights::Line => WeightModel::Line,
        Weights::Ellipse => WeightModel::Ellipse {
            width_m: imaging.width_m,
        },
        Weights::InverseArea => WeightModel::InverseArea {
            width_m: imaging.width_m,
        },
    };
    let prior = match subject {
        Subject::Change => imaging.prior,
        Subject::Structure => imaging.structure_prior,
    };
    let sigma = prior.sigma_db_per_m;
    let prior = Prior {
        variance: sigma * sigma,
        length_m: prior.correlation_length_m,
    };
    settings.solver = match imaging.solver {
        SolverName::Map => Solver::Map(prior, MapSettings::default()),
        SolverName::Tikhonov => ImageSettings::tikhonov_for(area),
        SolverName::Tsvd => Solver::TSVD,
        SolverName::Tv => Solver::Variation(ImageSettings::candidates_for(area)),
        SolverName::Nn => Solver::NonNegative(ImageSettings::sparse_for(area)),
        SolverName::Points => Solver::Points(ImageSettings::sparse_for(area)),
        SolverName::Auto => Solver::Auto(ImageSettings::candidates_for(area)),
    };
    if settings.solver.is_non_negative() {
        settings.weights = settings.fresnel();
    }
    settings
}
