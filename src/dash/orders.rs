//! Orders of pages: what a request asks for, and a list of the last ones with how they fared. It judges no right
//! ([`super::gate`] does), and brings nothing about: the operator does.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use serde::Deserialize;
use tomoswarm_proto::{OrderKind, VehicleId};

use super::gate::PageId;
use crate::operator::operator_actor::In;
use crate::operator::order_goal::{OrderGoal, StopRequest};
use crate::operator::outcome::OrderOutcome;
use crate::time::Time;

/// So many orders are shown.
const SHOWN: usize = 16;
/// An order is given up after this time.
const ORDER_WITHIN: Duration = Duration::from_secs(5);
/// So long it is watched who comes to rest under a stop.
const STOP_WITHIN: Duration = Duration::from_secs(15);

/// What a page asks for.
#[derive(Clone, PartialEq, Eq, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OrderRequest {
    /// What.
    pub order: OrderWord,
    /// Of whom; empty = of all.
    #[serde(default)]
    pub vehicles: BTreeSet<u8>,
    /// By which page.
    pub page: u32,
    /// With `seat`: take it from whoever has it.
    #[serde(default)]
    pub take_over: bool,
}

/// What can be asked for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
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
            OrderWord::Seat => "seat",
        }
    }

    /// Returns whether it makes something move or fall, for which a page needs the seat.
    pub fn moves(self) -> bool {
        match self {
            OrderWord::Stop | OrderWord::Hold | OrderWord::Seat => false,
            OrderWord::Start | OrderWord::Return | OrderWord::Land => true,
        }
    }
}

impl OrderRequest {
    /// Reads what a page has posted.
    ///
    /// # Errors
    /// It is no request; in words.
    pub fn read(body: &[u8]) -> Result<OrderRequest, String> {
        let request: OrderRequest =
            serde_json::from_slice(body).map_err(|error| format!("not an order: {error}"))?;
        match request.vehicles.iter().find(|id| !(1..=250).contains(*id)) {
            Some(id) => Err(format!("not an order: vehicle {id} is none of 1 to 250")),
            None => Ok(request),
        }
    }

    /// Returns the vehicles that it is for; empty = all.
    pub fn targets(&self) -> BTreeSet<VehicleId> {
        self.vehicles.iter().map(|id| VehicleId(*id)).collect()
    }

    /// Returns what the operator is told, under a number; `None` of what is not for the operator.
    pub fn input(&self, number: u32) -> Option<In> {
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
        };
        let goal = OrderGoal {
            begins: kind == OrderKind::Start,
            ..OrderGoal::new(kind, vehicles, ORDER_WITHIN)
        };
        Some(In::Want(number, goal))
    }
}

/// An order that was given.
#[derive(Clone, PartialEq, Debug)]
pub struct GivenOrder {
    /// Its number.
    pub number: u32,
    /// What was asked for.
    pub request: OrderRequest,
    /// When.
    pub at: Time,
    /// What became of it; `None` = it is on its way.
    pub outcome: Option<OrderOutcome>,
}

/// The last orders, and who has the seat.
#[derive(Clone, Debug, Default)]
pub struct OrderBook {
    given: VecDeque<GivenOrder>,
    seat: Option<PageId>,
    last: u32,
}

impl OrderBook {
    /// Enters an order; returns its number.
    pub fn enter(&mut self, now: Time, request: OrderRequest) -> u32 {
        self.last = self.last.wrapping_add(1);
        self.given.push_back(GivenOrder {
            number: self.last,
            request,
            at: now,
            outcome: None,
        });
        if self.given.len() > SHOWN {
            self.given.pop_front();
        }
        self.last
    }

    /// Takes what became of an order.
    pub fn end(&mut self, number: u32, outcome: OrderOutcome) {
        if let Some(order) = self.given.iter_mut().find(|order| order.number == number) {
            order.outcome = Some(outcome);
        }
    }

    /// Takes who has the seat.
    pub fn set_seat(&mut self, seat: Option<PageId>) {
        self.seat = seat;
    }

    /// Returns who has the seat.
    pub fn seat(&self) -> Option<PageId> {
        self.seat
    }

    /// Returns the last orders, oldest first.
    pub fn given(&self) -> impl Iterator<Item = &GivenOrder> {
        self.given.iter()
    }

    /// Returns the last stop for all vehicles, if it was given after a moment.
    pub fn stop_of_all_since(&self, moment: Time) -> Option<&GivenOrder> {
        let is_it = |order: &&GivenOrder| {
            order.request.order == OrderWord::Stop && order.request.vehicles.is_empty()
        };
        self.given
            .iter()
            .rev()
            .find(is_it)
            .filter(|order| order.at >= moment)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(body: &str) -> Result<OrderRequest, String> {
        OrderRequest::read(body.as_bytes())
    }

    #[test]
    fn a_request_is_read_and_what_is_none_is_refused_with_a_reason() {
        let hold = read(r#"{"order":"hold","vehicles":[2,1],"page":3}"#).unwrap();
        assert_eq!(hold.targets(), [VehicleId(1), VehicleId(2)].into());
        assert!(
            matches!(hold.input(7), Some(In::Want(7, goal)) if goal.kind == OrderKind::Hold && !goal.begins)
        );
        for (body, reason) in [
            ("", "EOF"),
            (r#"{"order":"jump","page":1}"#, "unknown variant `jump`"),
            (r#"{"order":"stop"}"#, "missing field `page`"),
            (r#"{"order":"hold","page":1,"vehicles":[0]}"#, "vehicle 0"),
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
        assert!(matches!(stop.input(1), Some(In::Stop(1, request)) if request.vehicles.is_empty()));
        assert_eq!(read(r#"{"order":"seat","page":1}"#).unwrap().input(2), None);
    }

    #[test]
    fn the_book_keeps_the_last_orders_and_forgets_the_oldest() {
        let mut book = OrderBook::default();
        let request = read(r#"{"order":"hold","page":1}"#).unwrap();
        for number in 1..=20 {
            assert_eq!(book.enter(Time::ZERO, request.clone()), number);
        }
        let numbers: Vec<u32> = book.given().map(|order| order.number).collect();
        assert_eq!(numbers, (5..=20).collect::<Vec<u32>>());
    }
}
