//! `tomoswarm order CONFIG WHAT [VEHICLE]...`: tells vehicles what to do, and ends when their State shows that they do.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::builder::PossibleValuesParser;
use tomoswarm_proto::{OrderKind, Position, RunId, VehicleId};

use super::error::CliError;
use super::operator::{OperatorContext, fault, seconds};
use super::read;
use super::stop::StopFlag;
use crate::config::{GivenMission, Venue};
use crate::geom::Point;
use crate::operator::fleet_view::Incompatibility;
use crate::operator::given_marks::{MarkOutcome, MarkRequest};
use crate::operator::given_tasks::task_kind;
use crate::operator::names::kind_name;
use crate::operator::operator_actor::{In, Out};
use crate::operator::order_goal::{MissionRequest, OrderGoal, StopRequest};
use crate::operator::outcome::{OrderOutcome, VehicleOutcome};
use crate::run::bus::SessionTopology;
use crate::run::live_operator::LiveOperator;
use crate::time::Time;

/// Between two looks at whether the command shall end.
const LOOK: Duration = Duration::from_millis(100);
/// The hub of a star is reached within this time, or not at all.
const LINKS_WITHIN: Duration = Duration::from_millis(1500);
/// The number of the only want of this command.
const ONE: u32 = 0;
/// A place is no further away than this, metres.
const FAR_M: f64 = 100_000.0;

/// Tell vehicles what to do; ends when their State shows it.
///
/// The order is sent every 100 ms until every vehicle shows it, and is given up after the timeout. It is given by the lease
/// that the ground station holds or the vehicles obey; whoever gave a higher order in between is named. A stopping order
/// goes above a start of the same lease that comes in between. A start of a run that has ended is refused,
/// and any while the ground station drives another run.
///
/// An emergency is no order but a state of the swarm: every node that hears of it says it on, by bus and by radio, and keeps
/// it on its disk. Under it no vehicle obeys a start or a return. The next start lifts what is open then.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct OrderArgs {
    /// A file of kind "operator", or the ground station's own file; with certificates only the operator's (`tomoswarm enroll`)
    #[arg(value_name = "CONFIG")]
    pub config: PathBuf,
    /// What to do
    #[arg(value_enum, value_name = "WHAT")]
    pub what: OrderWord,
    /// Which vehicles [default: all]; with mark the places, X,Y in metres in the venue's frame (put -- before a negative X)
    #[arg(value_name = "VEHICLE", value_parser = parse_target)]
    pub targets: Vec<OrderTarget>,
    /// With start: begin this mission, as a run of its own [default: what the run is; without a task what the files say]
    #[arg(long, value_name = "KIND", value_parser = PossibleValuesParser::new(GivenMission::kinds()))]
    pub mission: Option<String>,
    /// A key of the mission, as a file has it in its table mission, or sweep where the ground station plans; may be repeated
    #[arg(long, value_name = "KEY=VALUE", requires = "mission")]
    pub set: Vec<String>,
    /// The run that the images of the mission are compared with: one without what is looked for
    #[arg(long, value_name = "N", requires = "mission", value_parser = clap::value_parser!(u32).range(1..=4_294_967_294))]
    pub compare_with: Option<u32>,
    /// In which run [default: the present one; a start of an idle ground station begins the next]
    #[arg(long, value_name = "N", conflicts_with = "mission", value_parser = clap::value_parser!(u32).range(1..=4_294_967_294))]
    pub run: Option<u32>,
    /// With start: give up the sweep that is under way, if there is one, for the run that this begins
    #[arg(long)]
    pub end_run: bool,
    /// Take the lease from whoever holds it
    #[arg(long)]
    pub take_over: bool,
    /// Lift emergency stops by this start although these vehicles are not heard
    #[arg(long, value_name = "VEHICLE", value_delimiter = ',', value_parser = clap::value_parser!(u8).range(1..=250))]
    pub although_unheard: Vec<u8>,
    /// Lift also what stands for more emergency stops than can be named
    #[arg(long)]
    pub lift_all: bool,
    /// Give up after so many seconds
    #[arg(long, value_name = "S", default_value = "5", value_parser = seconds)]
    pub timeout: Duration,
    /// Confirm that the motors are cut, whatever falls
    #[arg(long)]
    pub yes_cut_motors: bool,
    /// With mark: take the marks at these places back
    #[arg(long)]
    pub take_back: bool,
}

/// For whom, or where.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum OrderTarget {
    /// A vehicle.
    Vehicle(u8),
    /// A place, metres in the venue's frame.
    Place(Point),
}

fn parse_target(text: &str) -> Result<OrderTarget, String> {
    let Some((x, y)) = text.split_once(',') else {
        let id = text.parse().ok().filter(|id| (1..=250).contains(id));
        let expected = "expected a vehicle, 1 to 250, or with mark a place X,Y";
        return id
            .map(OrderTarget::Vehicle)
            .ok_or_else(|| expected.to_owned());
    };
    let metres = |text: &str| {
        let metres = text.trim().parse::<f64>().ok();
        metres.filter(|metres| metres.abs() <= FAR_M)
    };
    let place = metres(x).zip(metres(y));
    place
        .map(|(x_m, y_m)| OrderTarget::Place(Point::new(x_m, y_m)))
        .ok_or_else(|| format!("expected X,Y in metres, at most {FAR_M} m away"))
}

/// What a vehicle can be told.
#[derive(clap::ValueEnum, Clone, Copy, PartialEq, Eq, Debug)]
pub enum OrderWord {
    /// Begin a run, or go on; lifts the emergency stops that are open
    Start,
    /// Stand still, keep the plan (= hold)
    Pause,
    /// Go on (= start, but never begins a new run)
    Resume,
    /// Stand still, keep the plan
    Hold,
    /// Drive home
    Return,
    /// Come down where it is
    Land,
    /// Stop at once, whoever hears of it; only start ends it
    Emergency,
    /// Cut the motors at once, whatever falls; needs --yes-cut-motors
    CutMotors,
    /// Note in the ground station's store that somebody truly stands at X,Y: finds are compared with it. Moves nobody
    Mark,
}

const AFTER_HELP: &str = "\
An emergency waits for nobody: it goes out as soon as the bus is open, and whoever hears of it stops, also one that has
another venue file. It says what each vehicle shows: in force, and whether it still brakes; not shown; not heard. A start is
refused while a vehicle was not heard for 2 s and a stop would be lifted, unless --although-unheard names it. A return is
refused while a stop is open. Whoever has another venue file or version of the wire is named and obeys no order.

A mission goes to the vehicles and to the ground station as a task, and is a run of its own; the vehicles named take part,
or all. It is shown by each vehicle, or refused with its reason. What --mission takes, and its keys, are those of [mission] in
a file (configs/README.md); sweep, calibrate, fan and fan-straight are planned by the ground station. resume goes on with the
mission of the present run.

Examples:
  tomoswarm order operator.toml start                 all vehicles begin
  tomoswarm order operator.toml start --mission explore
  tomoswarm order operator.toml start 2 3 --mission pathfind --set 'waypoints_m=[[4, 2], [8, 6]]'
  tomoswarm order operator.toml start --mission waypoints --set file=yard.waypoints
  tomoswarm order operator.toml start --mission sweep --compare-with 1     as ground.toml has it, compared with run 1
  tomoswarm order operator.toml start --mission sweep --set laps=4 --end-run   in place of the sweep that is under way
  tomoswarm order operator.toml hold 2 3              two of them stand still
  tomoswarm order operator.toml emergency             everyone stops at once
  tomoswarm order operator.toml emergency 2           vehicle 2 alone does
  tomoswarm order operator.toml start                 lifts it, and all begin again
  tomoswarm order operator.toml start --take-over     in place of another ground station
  tomoswarm order operator.toml mark 3.2,7.5          somebody stands there, in the present or last run
  tomoswarm order operator.toml mark 3.2,7.5 --run 2 --take-back

A mark is said until the ground station has stored it (table marks, docs/store.md); tomoswarm export writes marks, and how far
finds are from them. A place outside the fence is refused, and a run above all that the ground station knows; marks are taken
back anywhere.

Exit codes: 0 every vehicle shows the order, or the marks are stored; 1 not in time, overruled, nobody heard, a vehicle that does not fit or refuses the
mission, a start of a run that has ended or while another one is under way, or one that would lift a stop while a vehicle is not heard; 2 bad usage or
configuration.";

impl OrderWord {
    /// Returns the order that it is; an emergency stop is none.
    fn kind(self) -> Option<OrderKind> {
        match self {
            OrderWord::Start | OrderWord::Resume => Some(OrderKind::Start),
            OrderWord::Pause | OrderWord::Hold => Some(OrderKind::Hold),
            OrderWord::Return => Some(OrderKind::Return),
            OrderWord::Land => Some(OrderKind::Land),
            OrderWord::CutMotors => Some(OrderKind::CutMotors),
            OrderWord::Emergency | OrderWord::Mark => None,
        }
    }

    /// Returns how it was said.
    fn name(self) -> &'static str {
        match self {
            OrderWord::Pause => "pause",
            OrderWord::Resume => "resume",
            OrderWord::Start
            | OrderWord::Hold
            | OrderWord::Return
            | OrderWord::Land
            | OrderWord::Emergency
            | OrderWord::CutMotors
            | OrderWord::Mark => self.kind().map_or("emergency", kind_name),
        }
    }
}

impl OrderArgs {
    /// Orders, and says who obeyed after how long.
    ///
    /// # Errors
    /// A bad file, or a vehicle that did not obey.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        match (self.what, self.yes_cut_motors) {
            (OrderWord::CutMotors, false) => {
                let refused =
                    "cut-motors lets fall whatever flies; confirm it with --yes-cut-motors";
                return Err(CliError::Usage(refused.to_owned()));
            }
            (what, true) if what != OrderWord::CutMotors => {
                return Err(CliError::Usage(
                    "--yes-cut-motors belongs to cut-motors only".to_owned(),
                ));
            }
            (_, _) => {}
        }
        let is_start = self.what.kind() == Some(OrderKind::Start);
        if !is_start && (self.lift_all || !self.although_unheard.is_empty()) {
            let refused = "--although-unheard and --lift-all belong to start and resume only";
            return Err(CliError::Usage(refused.to_owned()));
        }
        let begins = self.mission.is_some() || self.run.is_some();
        if self.end_run && (self.what != OrderWord::Start || !begins || !self.targets.is_empty()) {
            let refused = "--end-run belongs to start of all vehicles with --mission or --run only: \
                the sweep is given up for another run";
            return Err(CliError::Usage(refused.to_owned()));
        }
        if self.mission.is_some() && self.what != OrderWord::Start {
            return Err(CliError::Usage(
                "--mission belongs to start only".to_owned(),
            ));
        }
        let (vehicles, places) = self.targets();
        if self.what == OrderWord::Mark {
            return self.mark(&vehicles, &places, out);
        }
        if !places.is_empty() || self.take_back {
            let refused = "places X,Y and --take-back belong to mark only";
            return Err(CliError::Usage(refused.to_owned()));
        }
        let context = OperatorContext::read(&self.config)?;
        let mission = self.mission(&context.venue)?;
        let stop = StopFlag::listen();
        let is_star = context.settings.topology == SessionTopology::Star;
        let mut operator = context.open()?;
        operator.tell(self.wish(mission));
        let outcome = until_over(&mut operator, &stop, is_star)?;
        let troubles = operator.session().troubles();
        operator.close();
        if let Some(refused) = outcome.refused {
            return Err(CliError::Swarm(format!("not ordered: {refused}")));
        }
        let text = outcome_text(context.venue.hash(), &outcome);
        out.write_all(text.as_bytes()).map_err(CliError::stdout)?;
        if outcome.is_done() {
            Ok(())
        } else {
            Err(undone(self.what.name(), &outcome, &troubles))
        }
    }

    /// Returns the vehicles and the places that are named.
    fn targets(&self) -> (Vec<u8>, Vec<Point>) {
        let (mut vehicles, mut places) = (Vec::new(), Vec::new());
        for target in &self.targets {
            match target {
                OrderTarget::Vehicle(id) => vehicles.push(*id),
                OrderTarget::Place(at) => places.push(*at),
            }
        }
        (vehicles, places)
    }

    /// Marks places, and says what became of each.
    fn mark(&self, vehicles: &[u8], places: &[Point], out: &mut dyn Write) -> Result<(), CliError> {
        if places.is_empty() || !vehicles.is_empty() {
            let refused = "mark expects places, X,Y in metres, and no vehicles";
            return Err(CliError::Usage(refused.to_owned()));
        }
        let context = OperatorContext::read(&self.config)?;
        // A mark that is somewhere all the same can be taken back.
        let mut marked = places.iter().filter(|_| !self.take_back);
        if let Some(outside) = marked.find_map(|at| context.venue.refusal_of(*at)) {
            return Err(CliError::Usage(format!("nothing is marked: {outside}")));
        }
        let stop = StopFlag::listen();
        let mut operator = context.open()?;
        for (number, at) in (0..).zip(places) {
            let request = MarkRequest {
                run: self.run.map(RunId),
                at: Position::from_metres(at.x_m, at.y_m, 0.0),
                stands: !self.take_back,
                within: self.timeout,
            };
            operator.tell(In::Mark(number, request));
        }
        let (mut open, mut undone) = (places.len(), Vec::new());
        while open > 0 {
            if stop.is_asked() {
                (0..)
                    .zip(places)
                    .for_each(|(number, _)| operator.tell(In::Withdraw(number)));
            }
            let until = operator.now() + LOOK;
            for said in operator.go_on(until, |_, _| {}).map_err(fault)? {
                let Out::Marked(_, outcome) = said else {
                    continue;
                };
                open -= 1;
                match outcome {
                    MarkOutcome::Stored(_) => {
                        writeln!(out, "{outcome}").map_err(CliError::stdout)?;
                    }
                    MarkOutcome::NoRun
                    | MarkOutcome::NotStored(_)
                    | MarkOutcome::StoreInTrouble { .. }
                    | MarkOutcome::Withdrawn
                    | MarkOutcome::UnknownRun { .. } => {
                        undone.push(outcome.to_string());
                    }
                }
            }
        }
        undone.dedup();
        let troubles = operator.session().troubles();
        operator.close();
        if undone.is_empty() {
            return Ok(());
        }
        undone.extend(troubles);
        Err(CliError::Swarm(undone.join("; ")))
    }

    /// Returns the mission that is to be begun, if one is named.
    ///
    /// # Errors
    /// Mistakes in its keys.
    fn mission(&self, venue: &Venue) -> Result<Option<MissionRequest>, CliError> {
        let Some(kind) = &self.mission else {
            return Ok(None);
        };
        let vehicles = Some(self.targets.len()).filter(|count| *count > 0);
        let mut loader = |name: &str| read::named(Path::new(name));
        let GivenMission { task, sweep } =
            GivenMission::read(kind, &self.set, (venue, vehicles), &mut loader)?;
        let compare_with = self.compare_with.map(RunId);
        Ok(Some(MissionRequest {
            kind: task_kind(task, &sweep),
            compare_with,
        }))
    }

    /// Returns what the operator is told.
    fn wish(&self, mission: Option<MissionRequest>) -> In {
        let ids = |all: &[u8]| all.iter().map(|id| VehicleId(*id)).collect();
        let (vehicles, within) = (ids(&self.targets().0), self.timeout);
        match self.what.kind() {
            None => In::Stop(ONE, StopRequest { vehicles, within }),
            Some(kind) => In::Want(
                ONE,
                OrderGoal {
                    run: self.run.map(RunId),
                    begins: self.what == OrderWord::Start,
                    mission,
                    ends_run: self.end_run,
                    take_over: self.take_over,
                    although_unheard: ids(&self.although_unheard),
                    lifts_many: self.lift_all,
                    ..OrderGoal::new(kind, vehicles, within)
                },
            ),
        }
    }
}

/// Waits until the want is over, or the command shall end. In a star without its ground station nobody is ever heard.
fn until_over(
    operator: &mut LiveOperator,
    stop: &StopFlag,
    is_star: bool,
) -> Result<OrderOutcome, CliError> {
    let mut was_linked = false;
    loop {
        was_linked |= operator.session().is_linked();
        if is_star && !was_linked && operator.now() >= Time::ZERO + LINKS_WITHIN {
            let ends = "nothing was said: the ground station is not reached, and in a star nobody is reached without it";
            return Err(CliError::Swarm(ends.to_owned()));
        }
        if stop.is_asked() {
            operator.tell(In::Withdraw(ONE));
        }
        let output = operator
            .go_on(operator.now() + LOOK, |_, _| {})
            .map_err(fault)?;
        let over = output.into_iter().find_map(|out| match out {
            Out::Ended(_, outcome) => Some(outcome),
            Out::Publish(_)
            | Out::Give(_)
            | Out::StopEvent(_)
            | Out::InForce(..)
            | Out::Announce(_)
            | Out::Marked(..)
            | Out::ScriptEnded(_) => None,
        });
        if let Some(outcome) = over {
            return Ok(outcome);
        }
    }
}

fn outcome_text(venue_hash: u64, outcome: &OrderOutcome) -> String {
    let line = |(id, of): (&VehicleId, &VehicleOutcome)| match of {
        VehicleOutcome::Foreign(misfit @ Incompatibility::Venue(_)) => {
            format!("vehicle {id} {misfit}; here it is {venue_hash:016x}\n")
        }
        of => format!("vehicle {id} {of}\n"),
    };
    let lifts = outcome.lifts.iter().map(|stop| {
        let (name, by) = (stop.name, stop.by);
        format!("lifts emergency stop {name} of operator {by}\n")
    });
    lifts.chain(outcome.vehicles.iter().map(line)).collect()
}

fn undone(name: &str, outcome: &OrderOutcome, troubles: &[String]) -> CliError {
    let undone: BTreeSet<&VehicleId> = outcome
        .vehicles
        .iter()
        .filter(|(_, of)| !of.is_done())
        .map(|(id, _)| id)
        .collect();
    let ids: Vec<String> = undone.iter().map(ToString::to_string).collect();
    let mut text = match ids.is_empty() {
        true => "nobody was heard".to_owned(),
        false => format!("{name} is not shown by vehicle {}", ids.join(", ")),
    };
    for trouble in troubles {
        text += &format!("; {trouble}");
    }
    CliError::Swarm(text)
}
