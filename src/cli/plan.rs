//! `tomoswarm plan CONFIG`: plans a sweep offline and shows it, without driving it.

use std::io::Write;
use std::path::PathBuf;

use tomoswarm_proto::Plan;

use super::error::CliError;
use super::load::{self, planned};
use crate::config::Sim;
use crate::geom::Point;
use crate::sim::Scenario;
use crate::sweep::{PlannedSweep, check_separation, expected_duration_s, tracks_of};

/// Plan a sweep and show it: laps, stops, lengths, and how long it will take.
///
/// The plans are those that `tomoswarm sim` drives when all vehicles start at their homes. They are proven to keep the vehicles
/// apart whatever the delays. Only a sweep has laps: a file with another mission is refused. Lengths are metres, x to the
/// east, y to the north.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct PlanArgs {
    /// A simulation file (kind = "sim") [default: the bundled courtyard]
    #[arg(value_name = "CONFIG")]
    pub config: Option<PathBuf>,
    /// Number of vehicles, 2 to 8, in place of the file's
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub vehicles: Option<usize>,
    /// List every stop as CSV: vehicle,stop,x_m,y_m,dwell_ms,after
    ///
    /// `after` are the stops of others that must be done before this one is driven to: vehicle:stop, parted by spaces.
    #[arg(long)]
    pub stops: bool,
}

const AFTER_HELP: &str = "\
A lap is one round of all vehicles; its gaps are the steps along the ring of positions between neighbours.

Examples:
  tomoswarm plan                                      the bundled courtyard
  tomoswarm plan --vehicles 5                         is a fifth rover worth it?
  tomoswarm plan my.sim.toml --stops > stops.csv      for a table or a script

Exit codes: 0 done; 2 bad usage or bad files, no sweep can be planned, or the file's mission is no sweep and has no laps.";

impl PlanArgs {
    /// Plans and prints.
    ///
    /// # Errors
    /// Bad files, or a sweep that cannot be driven.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let loaded = load::load(self.config.as_deref(), self.vehicles)?;
        let scenario = load::scenario(loaded, self.config.as_deref(), None)?;
        self.has_laps(scenario.sim())?;
        let sweep = planned(&scenario).map_err(|error| CliError::Usage(error.to_string()))?;
        let text = if self.stops {
            stops(&sweep.plans)
        } else {
            summary(&scenario, &sweep)?
        };
        let failed = |source| CliError::Write {
            path: "standard output".into(),
            source,
        };
        out.write_all(text.as_bytes()).map_err(failed)
    }

    /// Refuses what the ground station does not plan.
    ///
    /// # Errors
    /// The mission is no sweep.
    fn has_laps(&self, sim: &Sim) -> Result<(), CliError> {
        if sim.is_planned_by_ground() {
            return Ok(());
        }
        Err(CliError::Input {
            path: self.config.clone().unwrap_or_default(),
            reason: format!(
                "its mission is {}, which has no laps to plan: every vehicle finds its own way \
                 (`tomoswarm sim` shows it)",
                sim.mission.word()
            ),
        })
    }
}

fn summary(scenario: &Scenario, sweep: &PlannedSweep) -> Result<String, CliError> {
    let sim = scenario.sim();
    let fault = |error: crate::sweep::PlanError| CliError::Fault(error.to_string());
    let speed_mps = sim.vehicles.body.max_speed_mps;
    let duration_s = expected_duration_s(&sweep.plans, speed_mps).map_err(fault)?;
    check_separation(&sweep.plans, sim.venue.swarm.separation_m).map_err(fault)?;
    let mut text = format!(
        "{}: {} positions around {:.1} x {:.1} m, {} laps, at least {:.1} min at {speed_mps} m/s\n\
         the plans keep all vehicles {:.2} m apart, whatever the delays (proven over all orders of legs)\n",
        sim.venue.name,
        scenario.ring().positions(),
        sim.venue.area.width_m(),
        sim.venue.area.height_m(),
        sweep.schedule.laps.len(),
        duration_s / 60.0,
        sim.venue.swarm.separation_m,
    );
    for plan in &sweep.plans {
        let length_m: f64 = tracks_of(plan)
            .iter()
            .map(crate::geom::Track::length_m)
            .sum();
        let start = Point::from(plan.start);
        text += &format!(
            "vehicle {}: {} stops, {length_m:.0} m, from {:.2}, {:.2} m\n",
            plan.vehicle,
            plan.stops.len(),
            start.x_m,
            start.y_m
        );
    }
    for lap in &sweep.schedule.laps {
        let gaps = gaps(scenario, &sweep.plans, lap);
        text += &format!("lap {}: gaps {gaps} steps\n", lap.number + 1);
    }
    Ok(text)
}

/// Returns the gaps between neighbours at the beginning of a lap, in steps of the ring.
fn gaps(scenario: &Scenario, plans: &[Plan], lap: &crate::sweep::Lap) -> String {
    let place = |(vehicle, first, _): &(_, _, _)| {
        let plan = plans.iter().find(|plan| plan.vehicle == *vehicle)?;
        let stop = plan.stops.iter().find(|stop| stop.id == *first)?;
        Some(scenario.ring().nearest(stop.at.into()))
    };
    let mut places: Vec<usize> = lap.stops.iter().filter_map(place).collect();
    places.sort_unstable();
    let next = places.iter().cycle().skip(1);
    let steps = places
        .iter()
        .zip(next)
        .map(|(a, b)| scenario.ring().steps_ahead(*a, *b).to_string());
    steps.collect::<Vec<_>>().join(", ")
}

fn stops(plans: &[Plan]) -> String {
    let mut text = "vehicle,stop,x_m,y_m,dwell_ms,after\n".to_owned();
    for plan in plans {
        for stop in &plan.stops {
            let after: Vec<String> = stop
                .after
                .iter()
                .map(|(vehicle, id)| format!("{vehicle}:{id}"))
                .collect();
            let (x_m, y_m) = (stop.at.x_m(), stop.at.y_m());
            let (vehicle, id, dwell_ms) = (plan.vehicle, stop.id, stop.dwell_ms);
            text += &format!(
                "{vehicle},{id},{x_m:.4},{y_m:.4},{dwell_ms},{}\n",
                after.join(" ")
            );
        }
    }
    text
}
