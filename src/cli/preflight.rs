//! `tomoswarm preflight CONFIG`: one table that says go or no-go before a run. Changes nothing.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::error::CliError;
use super::operator::{OperatorContext, seconds};
use super::preflight_text::{json, text};
use super::screen;
use super::status::listen;
use super::stop::StopFlag;
use crate::exchange::software::SOFTWARE;
use crate::operator::fleet_view::FleetView;
use crate::operator::preflight::{Requirements, inspect, is_go};
use crate::operator::status::Expected;
use crate::time::Time;

/// Look at everyone before a run: go or no-go.
///
/// Every vehicle: on the bus and fresh, same software and venue file as here, certain of its place, inside the fence, at its
/// home, hears every other one by radio and has sent beacons (a real radio says how many, and how many not), charged, room
/// on its disk, nothing lost, no troubles, not held. The ground station: one, with the lease, idle, no hold stands, room
/// on its disk, its store works.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct PreflightArgs {
    /// A file of kind "operator", or the ground station's own file; with certificates only the operator's (`tomoswarm enroll`)
    #[arg(value_name = "CONFIG")]
    pub config: PathBuf,
    /// Who shall take part, e.g. 1,2,3 [default: the ground file's vehicles, or all that are heard]
    #[arg(long, value_name = "IDS", value_delimiter = ',', value_parser = clap::value_parser!(u8).range(1..=250))]
    pub vehicles: Vec<u8>,
    /// The deviation that a vehicle's place may have, metres [default: pose_sd_max_m of the venue]
    #[arg(long, value_name = "M", value_parser = metres)]
    pub pose_sd_max: Option<f64>,
    /// Listen for so many seconds at most
    #[arg(long = "for", value_name = "S", default_value = "4", value_parser = seconds)]
    pub listen: Duration,
    /// One JSON object
    #[arg(long)]
    pub json: bool,
}

const AFTER_HELP: &str = "\
Ends as soon as all is go when the vehicles are named; otherwise it listens the whole time. What is not reported is
shown as not known and refuses nothing: the autopilot's failsafes, and the room on a disk.

Examples:
  tomoswarm preflight operator.toml --vehicles 1,2,3  these three shall take part
  tomoswarm preflight ground.toml && tomoswarm order ground.toml start

Exit codes: 0 go; 1 no-go; 2 bad usage or configuration.";

fn metres(text: &str) -> Result<f64, String> {
    let number: Option<f64> = text.parse().ok();
    number
        .filter(|m| (0.001..=100.0).contains(m))
        .ok_or_else(|| "0.001 to 100 metres are allowed".to_owned())
}

impl PreflightArgs {
    /// Listens, checks and shows.
    ///
    /// # Errors
    /// A bad file, or anything that is no-go.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let context = OperatorContext::read(&self.config)?;
        let asked: BTreeSet<VehicleId> = self.vehicles.iter().map(|id| VehicleId(*id)).collect();
        let named = if asked.is_empty() {
            context.vehicles.clone()
        } else {
            asked
        };
        let stop = StopFlag::listen();
        let mut operator = context.open()?;
        let is_enough = |view: &FleetView, now: Time| {
            !named.is_empty()
                && is_go(&inspect(
                    view,
                    &self.needs(&context, &named, view, now),
                    now,
                ))
        };
        listen(&mut operator, self.listen, &stop, is_enough)?;
        let (view, now) = (operator.view(), operator.now());
        let nodes = inspect(view, &self.needs(&context, &named, view, now), now);
        operator.close();
        let width = screen::columns_of_stdout();
        let text = if self.json {
            format!("{}\n", json(&nodes))
        } else {
            text(&nodes, width)
        };
        out.write_all(text.as_bytes()).map_err(CliError::stdout)?;
        if is_go(&nodes) {
            Ok(())
        } else {
            Err(CliError::Swarm("no-go".to_owned()))
        }
    }

    fn needs(
        &self,
        context: &OperatorContext,
        named: &BTreeSet<VehicleId>,
        view: &FleetView,
        now: Time,
    ) -> Requirements {
        let everyone = || {
            Expected {
                vehicles: BTreeSet::new(),
                ground: true,
            }
            .vehicles(view, now)
        };
        Requirements {
            vehicles: if named.is_empty() {
                everyone()
            } else {
                named.clone()
            },
            venue_hash: context.venue.hash(),
            fence: context.venue.fence.clone(),
            homes: context.venue.homes.clone(),
            pose_sd_max_m: self.pose_sd_max.or(Some(context.venue.swarm.pose_sd_max_m)),
            software: SOFTWARE.to_owned(),
        }
    }
}
