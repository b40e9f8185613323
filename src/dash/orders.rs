//! Orders of pages: what a request asks for, and a list of the last ones with how they fared. It judges no right
//! ([`super::gate`] does), and brings nothing about: the operator does.

use std::collections::BTreeSet;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tomoswarm_proto::{OrderKind, RunId, VehicleId};

use super::gate::PageId;
use super::given::{Given, GivenBook};
use crate::config::{GivenMission, Venue};
use crate::operator::given_tasks::task_kind;
use crate::operator::operator_actor::In;
use crate::operator::order_goal::{MissionRequest, OrderGoal, StopRequest};
use crate::operator::outcome::OrderOutcome;

/// An order is given up after this time.
const ORDER_WITHIN: Duration = Duration::from_secs(5);
/// So long it is watched who comes to rest under a stop.
pub(super) const STOP_WITHIN: Duration = Duration::from_secs(15);

/// What a page asks for.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OrderRequest {
    /// What.
    pub order: OrderWord,
    /// Of whom; empty = of all.
    #[serde(default)]
    pub vehicles: BTreeSet<u8>,
    /// By which page.
    pub page: u32,
    /// What that page has drawn for itself and said over its connection.
    #[serde(default)]
    pub secret: String,
    /// With `seat`: take it from whoever has it.
    #[serde(default)]
    pub take_over: bool,
    /// With `start`: the mission that is to be begun, as a run of its own.
    #[serde(default)]
    pub mission: Option<MissionOrder>,
}

/// A mission as a page says it: what `tomoswarm order CONFIG start --mission` takes.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MissionOrder {
    /// The word for its kind.
    pub kind: String,
    /// Its keys, each as `KEY=VALUE`.
    #[serde(default)]
    pub set: Vec<String>,
    /// The content of the file that the keys name, if they do.
    #[serde(default)]
    pub file: Option<String>,
    /// The run that its images are compared with.
    #[serde(default)]
    pub compare_with: Option<u32>,
    /// Whether the sweep that is under way is given up for it.
    #[serde(default)]
    pub end_run: bool,
}

/// What can be asked for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OrderWord {
    /// The emergency stop.
    Stop,
    /// Stand still.
    Hold,
    /// Begin or go on; lifts stops.
    Start,
    /// Go home.
    Return,
    /// Come down.
    Land,
    /// Cut the motors, whatever falls.
    CutMotors,
    /// Nothing of vehicles: the seat.
    Seat,
}

impl OrderWord {
    /// Returns the word as people read it.
    pub fn word(self) -> &'static str {
        match self {
            OrderWord::Stop => "stop",
            OrderWord::Hold => "hold",
            OrderWord::Start => "start",
            OrderWord::Return => "return",
            OrderWord::Land => "land",
            OrderWord::CutMotors => "cut-motors",
            OrderWord::Seat => "seat",
        }
    }

    /// Returns whether it makes something move or fall, for which a page needs the seat.
    pub fn moves(self) -> bool {
        match self {
            OrderWord::Stop | OrderWord::Hold | OrderWord::Seat => false,
            OrderWord::Start | OrderWord::Return | OrderWord::Land | OrderWord::CutMotors => true,
        }
    }
}

impl OrderRequest {
    /// Reads what a page has posted.
    ///
    /// # Errors
    /// It is no request, or cuts the motors of nobody by number; in words.
    pub fn read(body: &[u8]) -> Result<OrderRequest, String> {
        let request: OrderRequest =
            serde_json::from_slice(body).map_err(|error| format!("not an order: {error}"))?;
        if let Some(id) = request.vehicles.iter().find(|id| !(1..=250).contains(*id)) {
            return Err(format!("not an order: vehicle {id} is none of 1 to 250"));
        }
        // Whose motors are cut is said by number: nobody falls because nothing was selected.
        if request.order == OrderWord::CutMotors && request.vehicles.is_empty() {
            return Err(
                "cut-motors expects the vehicles by number: it is never for all".to_owned(),
            );
        }
        Ok(request)
    }

    /// Returns the vehicles that it is for; empty = all.
    pub fn targets(&self) -> BTreeSet<VehicleId> {
        self.vehicles.iter().map(|id| VehicleId(*id)).collect()
    }

    /// Reads the mission that it is to begin, by the rules of the command line; `None` = it says none.
    ///
    /// # Errors
    /// Every mistake, in words.
    pub fn mission(&self, venue: &Venue) -> Result<Option<MissionRequest>, String> {
        let Some(said) = &self.mission else {
            return Ok(None);
        };
        if self.order != OrderWord::Start {
            return Err("a mission belongs to start only".to_owned());
        }
        if said
            .compare_with
            .is_some_and(|run| run == 0 || run == u32::MAX)
        {
            return Err("compare_with: a run from 1 to 4294967294 is expected".to_owned());
        }
        if said.end_run && !self.vehicles.is_empty() {
            return Err(
                "end_run: the sweep is given up for a run of all vehicles; select none".to_owned(),
            );
        }
        let vehicles = Some(self.vehicles.len()).filter(|count| *count > 0);
        let mut loader = |name: &str| {
            let missing =
                || format!("the page has sent no file, and {name} is none of this machine's");
            said.file.clone().ok_or_else(missing)
        };
        let given = GivenMission::read(&said.kind, &said.set, (venue, vehicles), &mut loader);
        let GivenMission { task, sweep } = given.map_err(|problems| problems.to_string())?;
        Ok(Some(MissionRequest {
            kind: task_kind(task, &sweep),
            compare_with: said.compare_with.map(RunId),
        }))
    }

    /// Returns what the operator is told, under a number; `None` of what is not for the operator.
    pub fn input(&self, number: u32, mission: Option<MissionRequest>) -> Option<In> {
        let vehicles = self.targets();
        let kind = match self.order {
            OrderWord::Stop => {
                let within = STOP_WITHIN;
                return Some(In::Stop(number, StopRequest { vehicles, within }));
            }
            OrderWord::Seat => return None,
            OrderWord::Hold => OrderKind::Hold,
            OrderWord::Start => OrderKind::Start,
            OrderWord::Return => OrderKind::Return,
            OrderWord::Land => OrderKind::Land,
            OrderWord::CutMotors => OrderKind::CutMotors,
        };
        let goal = OrderGoal {
            begins: kind == OrderKind::Start,
            mission,
            ends_run: self.mission.as_ref().is_some_and(|mission| mission.end_run),
            ..OrderGoal::new(kind, vehicles, ORDER_WITHIN)
        };
        Some(In::Want(number, goal))
    }
}

/// An order that was given.
pub type GivenOrder = Given<OrderRequest, OrderOutcome>;

/// The last orders, and who has the seat.
#[derive(Clone, Debug, Default)]
pub struct OrderBook {
    /// The last orders.
    pub given: GivenBook<OrderRequest, OrderOutcome>,
    /// Who has the seat.
    pub seat: Option<PageId>,
}

impl OrderBook {
    /// Returns the last stop for all vehicles, unless something that moves was ordered after it.
    pub fn stop_of_all(&self) -> Option<&GivenOrder> {
        let is_it = |order: &&GivenOrder| {
            order.request.order == OrderWord::Stop && order.request.vehicles.is_empty()
        };
        let mut newest_first = self.given.iter().rev();
        let last = newest_first.find(|order| is_it(order) || order.request.order.moves());
        last.filter(is_it)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config;
    use tomoswarm_proto::{GroundReport, RunEnd, RunReport};

    fn read(body: &str) -> Result<OrderRequest, String> {
        OrderRequest::read(body.as_bytes())
    }

    #[test]
    fn a_request_is_read_and_what_is_none_is_refused_with_a_reason() {
        let hold = read(r#"{"order":"hold","vehicles":[2,1],"page":3}"#).unwrap();
        assert_eq!(hold.targets(), [VehicleId(1), VehicleId(2)].into());
        assert!(
            matches!(hold.input(7, None), Some(In::Want(7, goal)) if goal.kind == OrderKind::Hold && !goal.begins)
        );
        for (body, reason) in [
            ("", "EOF"),
            (r#"{"order":"jump","page":1}"#, "unknown variant `jump`"),
            (r#"{"order":"stop"}"#, "missing field `page`"),
            (r#"{"order":"hold","page":1,"vehicles":[0]}"#, "vehicle 0"),
            (
                r#"{"order":"cut-motors","page":1}"#,
                "expects the vehicles by number",
            ),
            (
                r#"{"order":"hold","page":1,"speed":9}"#,
                "unknown field `speed`",
            ),
        ] {
            let refused = read(body).unwrap_err();
            assert!(refused.contains(reason), "{body}: {refused}");
        }
    }

    #[test]
    fn a_stop_without_vehicles_is_for_all_and_the_seat_is_nothing_for_the_operator() {
        let stop = read(r#"{"order":"stop","page":1}"#).unwrap();
        assert!(
            matches!(stop.input(1, None), Some(In::Stop(1, request)) if request.vehicles.is_empty())
        );
        assert_eq!(
            read(r#"{"order":"seat","page":1}"#).unwrap().input(2, None),
            None
        );
    }

    fn venue() -> Venue {
        let text = "kind = \"venue\"\nname = \"small\"\narea_m = [0.4, 0.4, 5.6, 3.6]\n\
            fence_m = [[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [0.0, 4.0]]\nhomes_m = [[0.7, 0.7], [5.3, 3.3]]\n\
            [datum]\nlatitude_deg = 52.0\nlongitude_deg = 4.0\naltitude_m = 0.0\n";
        match config::read("a.toml", text, &mut |path| Err(path.to_owned())).unwrap() {
            config::Config::Venue(venue) => venue,
            other => panic!("{other:?}"),
        }
    }

    fn mission(body: &str) -> Result<Option<MissionRequest>, String> {
        read(body).unwrap().mission(&venue())
    }

    #[test]
    fn a_mission_is_read_by_the_rules_of_the_command_line() {
        let request = read(
            r#"{"order":"start","vehicles":[1],"page":1,
                "mission":{"kind":"pathfind","set":["waypoints_m=[[1, 1], [2, 3]]"],"compare_with":4}}"#,
        )
        .unwrap();
        let mission = request.mission(&venue()).unwrap();
        let said = mission.clone().unwrap();
        assert_eq!(said.compare_with, Some(RunId(4)));
        assert!(
            format!("{:?}", said.kind).contains("2000"),
            "{:?}",
            said.kind
        );
        let input = request.input(3, mission.clone());
        assert!(matches!(input, Some(In::Want(3, goal)) if goal.mission == mission && goal.begins));
        assert_eq!(mission_of_hold(), Ok(None));
    }

    fn mission_of_hold() -> Result<Option<MissionRequest>, String> {
        mission(r#"{"order":"hold","page":1}"#)
    }

    #[test]
    fn what_is_wrong_with_a_mission_is_said_and_nothing_of_this_machine_is_read() {
        let body = |order: &str, mission: &str| {
            format!(r#"{{"order":"{order}","page":1,"mission":{mission}}}"#)
        };
        for (order, said, reason) in [
            ("hold", r#"{"kind":"explore"}"#, "start only"),
            ("start", r#"{"kind":"dance"}"#, "dance"),
            (
                "start",
                r#"{"kind":"pathfind","set":["waypoints_m=[[90, 1]]"]}"#,
                "fence",
            ),
            ("start", r#"{"kind":"sweep","set":["laps=0"]}"#, "laps"),
            ("start", r#"{"kind":"sweep","set":["speed"]}"#, "KEY=VALUE"),
            (
                "start",
                r#"{"kind":"sweep","compare_with":0}"#,
                "compare_with",
            ),
            (
                "start",
                r#"{"kind":"waypoints","set":["file=/etc/passwd"]}"#,
                "sent no file",
            ),
            (
                "start",
                r#"{"kind":"waypoints","set":["file=a.waypoints"],"file":"nonsense"}"#,
                "a.waypoints",
            ),
        ] {
            let refused = mission(&body(order, said)).unwrap_err();
            assert!(refused.contains(reason), "{said}: {refused}");
        }
    }

    #[test]
    fn a_sweep_needs_a_ground_station_and_is_compared_with_a_run_that_is_over_and_was_measured() {
        let run = |run, end, samples| RunReport {
            run: RunId(run),
            end,
            samples,
            ..RunReport::default()
        };
        let report = GroundReport {
            runs: vec![
                run(3, Some(RunEnd::Done), 40),
                run(4, Some(RunEnd::Failed), 0),
                run(5, None, 7),
            ],
            ..GroundReport::default()
        };
        let new = GroundReport::default();
        let judged = |kind: &str, with: Option<u32>, ground: Option<&GroundReport>| {
            let with = with.map_or("null".to_owned(), |run| run.to_string());
            let body = format!(
                r#"{{"order":"start","page":1,"mission":{{"kind":"{kind}","compare_with":{with}}}}}"#
            );
            mission(&body)
                .unwrap()
                .unwrap()
                .judge(ground)
                .map_err(|misfit| misfit.to_string())
        };
        for (kind, with, ground) in [
            ("sweep", None, Some(&new)),
            ("sweep", Some(3), Some(&report)),
            // It names its last runs only.
            ("fan", Some(1), Some(&report)),
            ("explore", None, None),
        ] {
            assert_eq!(judged(kind, with, ground), Ok(()), "{kind} {with:?}");
        }
        for (kind, with, ground, reason) in [
            (
                "sweep",
                None,
                None,
                "a sweep is planned by a ground station, and none is heard",
            ),
            (
                "explore",
                Some(3),
                None,
                "a ground station compares with run 3, and none is heard",
            ),
            (
                "sweep",
                Some(4),
                Some(&report),
                "compare_with: run 4 has no samples",
            ),
            (
                "sweep",
                Some(5),
                Some(&report),
                "compare_with: run 5 is not over yet",
            ),
            (
                "sweep",
                Some(9),
                Some(&report),
                "run 9 is none that the ground station has; its newest is run 5",
            ),
            (
                "sweep",
                Some(1),
                Some(&new),
                "none that the ground station has",
            ),
        ] {
            let refused = judged(kind, with, ground).unwrap_err();
            assert!(refused.contains(reason), "{kind} {with:?}: {refused}");
        }
    }
}
