//! Who may do what: which Host and Origin a request may name, which token may look and which may order, how many pages there
//! are, how often they may order, and which of them has the seat. It decides, and opens nothing.
//!
//! - A request must name one of the server's own names as its Host: a page of elsewhere whose name was bound to this machine
//!   names its own. That Origin and Host agree says nothing.
//! - The feed and every order must come from a page of the server itself (Origin); one without Origin is refused.
//! - There are two tokens of 128 bits: one may look, the other one may order as well. Nothing is kept in cookies.
//! - Stop, Hold and marks need no seat. Whatever makes a vehicle move or fall needs it: one page has it, renews it, and loses
//!   it after [`SEAT_LASTS`]; another one may take it over.
//! - Orders are counted; stops by themselves, so that nobody who floods the one keeps back the other.

use std::collections::BTreeSet;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::orders::{OrderRequest, OrderWord};
use crate::time::Time;

/// Pages that are served at a time at most.
pub const PAGES_MAX: usize = 16;
/// The first message of a page must come within this time.
pub const FIRST_WITHIN: Duration = Duration::from_secs(2);
/// Longest message of a page, and longest body of a request, bytes.
pub const INBOUND_MAX: usize = 4096;
/// A seat that is not renewed is free after this time.
pub const SEAT_LASTS: Duration = Duration::from_secs(15);
/// Orders taken a second, and as many stops.
pub const ORDERS_PER_S: usize = 20;
/// Requests and messages of pages that wait to be taken; what comes when there are more is refused.
pub const REQUESTS_WAITING: usize = 256;

/// One page, counted from 1.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub struct PageId(pub u32);

/// What a token allows.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Right {
    /// To look.
    Look,
    /// To look and to order.
    Operate,
}

/// Why something is refused.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum GateRefusal {
    /// The request names another host.
    #[error("this server is not known by that name")]
    Host,
    /// The request comes from a page of somebody else.
    #[error("only the server's own page may ask for this")]
    Origin,
    /// No token, or not one of this server.
    #[error("this link's token is not known: take a link that was printed when it began")]
    Token,
    /// What is shown is no live swarm.
    #[error("what is shown here takes no orders: it is no live swarm")]
    NotLive,
    /// The token may look only.
    #[error("this link may look only: take the one with #operate")]
    LookOnly,
    /// No token came in time.
    #[error("no token came within {} s", FIRST_WITHIN.as_secs())]
    Late,
    /// A page that is not connected asks for the seat.
    #[error("this page is not connected, and cannot have the seat")]
    NotOpen,
    /// There are too many pages.
    #[error("{PAGES_MAX} pages are open already")]
    Pages,
    /// Too many orders.
    #[error("more than {ORDERS_PER_S} orders and marks a second")]
    Flood,
    /// Too many requests, or messages of pages (where to look in time, credit), whatever they ask for.
    #[error(
        "more than {REQUESTS_WAITING} requests and messages of pages wait: too many came at a time"
    )]
    Waiting,
    /// The order names a page that has not given it.
    #[error("the order does not come from the page that it names")]
    NotThatPage,
    /// It moves something, and the page has not the seat.
    #[error("this makes vehicles move, and this page has not the seat")]
    NoSeat,
    /// Another page has the seat.
    #[error("page {} has the seat", .0.0)]
    SeatTaken(PageId),
    /// What was said cannot be read.
    #[error("{0}")]
    Unreadable(String),
}

impl GateRefusal {
    /// Returns whether the same may be taken a moment later.
    pub fn is_passing(&self) -> bool {
        match self {
            GateRefusal::Late | GateRefusal::Pages | GateRefusal::Flood | GateRefusal::Waiting => {
                true
            }
            GateRefusal::Host
            | GateRefusal::Origin
            | GateRefusal::Token
            | GateRefusal::NotLive
            | GateRefusal::LookOnly
            | GateRefusal::NotOpen
            | GateRefusal::NotThatPage
            | GateRefusal::NoSeat
            | GateRefusal::SeatTaken(_)
            | GateRefusal::Unreadable(_) => false,
        }
    }
}

/// The names by which a server is known to requests.
#[derive(Clone, Debug)]
pub struct OwnNames {
    hosts: BTreeSet<String>,
    /// What an Origin begins with.
    scheme: &'static str,
}

/// Returns a host with a port, as requests name it: an address of six in brackets, the usual port of TLS left out.
pub fn named(host: &str, port: u16) -> String {
    let host = match host.contains(':') {
        true => format!("[{host}]"),
        false => host.to_ascii_lowercase(),
    };
    match port {
        443 => host,
        _ => format!("{host}:{port}"),
    }
}

/// Who may do what.
#[derive(Clone, Debug)]
pub struct Gate {
    look: String,
    /// `None` = nobody may order.
    operate: Option<String>,
    seat: Option<(PageId, Time)>,
    orders: RateLimit,
    stops: RateLimit,
}

/// When the last few were taken.
#[derive(Clone, Debug, Default)]
struct RateLimit(std::collections::VecDeque<Time>);

impl RateLimit {
    fn take(&mut self, now: Time) -> bool {
        self.0.retain(|at| now.since(*at) < Duration::from_secs(1));
        let may = self.0.len() < ORDERS_PER_S;
        if may {
            self.0.push_back(now);
        }
        may
    }
}

impl OwnNames {
    /// Returns the names of a server on a port of this machine.
    pub fn on_port(port: u16) -> OwnNames {
        let names = ["127.0.0.1", "localhost", "[::1]"];
        OwnNames {
            hosts: names.iter().map(|name| format!("{name}:{port}")).collect(),
            scheme: "http://",
        }
    }

    /// Returns the names of a server with TLS: those in its certificate, and no other.
    pub fn in_certificate(hosts: &[String], port: u16) -> OwnNames {
        OwnNames {
            hosts: hosts.iter().map(|host| named(host, port)).collect(),
            scheme: "https://",
        }
    }

    /// Judges the Host of any request.
    ///
    /// # Errors
    /// It is missing, or none of the server's names.
    pub fn judge_host(&self, host: Option<&str>) -> Result<(), GateRefusal> {
        let is_own = host.is_some_and(|host| self.hosts.contains(&host.to_ascii_lowercase()));
        is_own.then_some(()).ok_or(GateRefusal::Host)
    }

    /// Judges the Origin of an order or of a feed; the Host was judged before.
    ///
    /// # Errors
    /// It is missing, or not that of the server's own page.
    pub fn judge_origin(&self, origin: Option<&str>) -> Result<(), GateRefusal> {
        let host = origin.and_then(|origin| origin.strip_prefix(self.scheme));
        let is_own = host.is_some_and(|host| self.hosts.contains(&host.to_ascii_lowercase()));
        is_own.then_some(()).ok_or(GateRefusal::Origin)
    }
}

impl Gate {
    /// Makes the gate of a server with its two tokens.
    pub fn new(look: String, operate: String) -> Gate {
        Gate {
            look,
            operate: Some(operate),
            seat: None,
            orders: RateLimit::default(),
            stops: RateLimit::default(),
        }
    }

    /// Makes the gate of a server that takes no orders, with its token.
    pub fn looking_only(look: String) -> Gate {
        Gate {
            operate: None,
            ..Gate::new(look, String::new())
        }
    }

    /// Returns what a token allows.
    ///
    /// # Errors
    /// It is none of this server's.
    pub fn right_of(&self, token: &str) -> Result<Right, GateRefusal> {
        let operate = self.operate.as_ref();
        let may_operate = operate.is_some_and(|operate| is_same(token, operate));
        let may_look = is_same(token, &self.look);
        match (may_operate, may_look) {
            (true, _) => Ok(Right::Operate),
            (false, true) => Ok(Right::Look),
            (false, false) => Err(GateRefusal::Token),
        }
    }

    /// Judges what the header Authorization of an order says.
    ///
    /// # Errors
    /// It has no token of this server, or one that may look only.
    pub fn judge_authorization(&self, header: Option<&str>) -> Result<(), GateRefusal> {
        let token = header.and_then(|header| header.strip_prefix("Bearer "));
        match self.right_of(token.unwrap_or_default())? {
            Right::Operate => Ok(()),
            Right::Look if self.operate.is_none() => Err(GateRefusal::NotLive),
            Right::Look => Err(GateRefusal::LookOnly),
        }
    }

    /// Judges what the header Authorization of a request that only looks says.
    ///
    /// # Errors
    /// It has no token of this server.
    pub fn judge_looking(&self, header: Option<&str>) -> Result<(), GateRefusal> {
        let token = header.and_then(|header| header.strip_prefix("Bearer "));
        self.right_of(token.unwrap_or_default()).map(|_| ())
    }

    /// Judges whether one more page may come.
    ///
    /// # Errors
    /// There are too many.
    pub fn judge_pages(&self, open: usize) -> Result<(), GateRefusal> {
        (open < PAGES_MAX).then_some(()).ok_or(GateRefusal::Pages)
    }

    /// Judges an order of a page that may order.
    ///
    /// # Errors
    /// There are too many a second, or it makes something move and the page has not the seat.
    pub fn judge_order(&mut self, now: Time, request: &OrderRequest) -> Result<(), GateRefusal> {
        let limit = match request.order {
            OrderWord::Stop => &mut self.stops,
            OrderWord::Hold
            | OrderWord::Start
            | OrderWord::Return
            | OrderWord::Land
            | OrderWord::CutMotors
            | OrderWord::Seat => &mut self.orders,
        };
        if !limit.take(now) {
            return Err(GateRefusal::Flood);
        }
        let page = PageId(request.page);
        if request.order.moves() && self.seat(now) != Some(page) {
            return Err(GateRefusal::NoSeat);
        }
        if request.order == OrderWord::Seat {
            self.take_seat(now, page, request.take_over)?;
        }
        Ok(())
    }

    /// Judges a mark of a page that may order. It moves nobody, so that it needs no seat: who stands beside the person marks,
    /// while somebody else drives.
    ///
    /// # Errors
    /// There are too many orders a second.
    pub fn judge_mark(&mut self, now: Time) -> Result<(), GateRefusal> {
        self.orders
            .take(now)
            .then_some(())
            .ok_or(GateRefusal::Flood)
    }

    /// Returns which page has the seat.
    pub fn seat(&self, now: Time) -> Option<PageId> {
        let (page, at) = self.seat?;
        (now.since(at) < SEAT_LASTS).then_some(page)
    }

    /// Returns when the seat becomes free if it is not renewed.
    pub fn seat_ends(&self) -> Option<Time> {
        self.seat.map(|(_, at)| at + SEAT_LASTS)
    }

    /// Takes that a page is gone, and its seat with it.
    pub fn leave(&mut self, page: PageId) {
        self.seat = self.seat.filter(|(of, _)| *of != page);
    }

    /// Gives a page the seat, or renews it.
    fn take_seat(&mut self, now: Time, page: PageId, take_over: bool) -> Result<(), GateRefusal> {
        match self.seat(now) {
            Some(other) if other != page && !take_over => Err(GateRefusal::SeatTaken(other)),
            _ => {
                self.seat = Some((page, now));
                Ok(())
            }
        }
    }
}

/// Returns whether two texts are the same, in a time that does not tell how much of them is.
pub(super) fn is_same(one: &str, other: &str) -> bool {
    let differing = one
        .bytes()
        .zip(other.bytes())
        .fold(0, |all, (a, b)| all | (a ^ b));
    one.len() == other.len() && differing == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOK: &str = "00112233445566778899aabbccddeeff";
    const OPERATE: &str = "ffeeddccbbaa99887766554433221100";

    fn gate() -> Gate {
        Gate::new(LOOK.to_owned(), OPERATE.to_owned())
    }

    fn names() -> OwnNames {
        OwnNames::on_port(8377)
    }

    fn request(order: OrderWord, page: u32) -> OrderRequest {
        OrderRequest {
            order,
            vehicles: BTreeSet::new(),
            page,
            secret: String::new(),
            take_over: false,
            mission: None,
        }
    }

    fn at(at_s: f64) -> Time {
        Time::from_secs_f64(at_s)
    }

    #[test]
    fn only_the_servers_own_names_are_hosts() {
        for host in [
            "127.0.0.1:8377",
            "localhost:8377",
            "LOCALHOST:8377",
            "[::1]:8377",
        ] {
            assert_eq!(names().judge_host(Some(host)), Ok(()), "{host}");
        }
        for host in [
            "evil.example:8377",
            "127.0.0.1",
            "127.0.0.1:8378",
            "127.0.0.1:8377.evil.example",
            "localhost:8377@evil.example",
            "127.0.0.1:83770",
            "",
        ] {
            assert_eq!(
                names().judge_host(Some(host)),
                Err(GateRefusal::Host),
                "{host}"
            );
        }
        assert_eq!(names().judge_host(None), Err(GateRefusal::Host));
    }

    #[test]
    fn an_origin_that_fits_a_forged_host_does_not_count() {
        assert_eq!(names().judge_origin(Some("http://127.0.0.1:8377")), Ok(()));
        for origin in [
            Some("http://evil.example:8377"),
            Some("https://127.0.0.1:8377"),
            Some("http://127.0.0.1:8377/"),
            Some("null"),
            Some(""),
            None,
        ] {
            assert_eq!(
                names().judge_origin(origin),
                Err(GateRefusal::Origin),
                "{origin:?}"
            );
        }
    }

    #[test]
    fn a_token_allows_what_it_is_for_and_no_other_text_is_one() {
        assert_eq!(gate().right_of(LOOK), Ok(Right::Look));
        assert_eq!(gate().right_of(OPERATE), Ok(Right::Operate));
        for text in [
            "",
            &OPERATE[1..],
            &OPERATE[..31],
            &format!("{OPERATE}0"),
            &OPERATE.to_uppercase(),
        ] {
            assert_eq!(gate().right_of(text), Err(GateRefusal::Token), "{text}");
        }
    }

    #[test]
    fn who_may_look_only_orders_nothing_not_even_a_stop() {
        let judged = |header: Option<String>| gate().judge_authorization(header.as_deref());
        assert_eq!(judged(Some(format!("Bearer {OPERATE}"))), Ok(()));
        assert_eq!(
            judged(Some(format!("Bearer {LOOK}"))),
            Err(GateRefusal::LookOnly)
        );
        for header in [
            None,
            Some(OPERATE.to_owned()),
            Some("Bearer ".to_owned()),
            Some(format!("Basic {OPERATE}")),
        ] {
            assert_eq!(
                judged(header.clone()),
                Err(GateRefusal::Token),
                "{header:?}"
            );
        }
    }

    #[test]
    fn too_many_requests_are_not_called_orders_and_may_be_tried_again() {
        let refusal = GateRefusal::Waiting;
        assert!(refusal.is_passing());
        let words = refusal.to_string();
        assert!(
            words.contains("256 requests") && !words.contains("order"),
            "{words}"
        );
    }

    #[test]
    fn a_seventeenth_page_is_refused() {
        assert_eq!(gate().judge_pages(15), Ok(()));
        assert_eq!(gate().judge_pages(16), Err(GateRefusal::Pages));
    }

    #[test]
    fn twenty_orders_a_second_pass_and_a_flood_of_them_keeps_no_stop_back() {
        let mut gate = gate();
        for _ in 0..ORDERS_PER_S {
            assert_eq!(
                gate.judge_order(at(1.0), &request(OrderWord::Hold, 1)),
                Ok(())
            );
        }
        let hold = request(OrderWord::Hold, 2);
        assert_eq!(gate.judge_order(at(1.9), &hold), Err(GateRefusal::Flood));
        assert_eq!(
            gate.judge_order(at(1.9), &request(OrderWord::Stop, 2)),
            Ok(())
        );
        assert_eq!(gate.judge_order(at(2.1), &hold), Ok(()));
    }

    #[test]
    fn what_moves_needs_the_seat_and_what_stops_does_not() {
        let mut gate = gate();
        let moving = [OrderWord::Start, OrderWord::Return, OrderWord::Land];
        for order in moving.into_iter().chain([OrderWord::CutMotors]) {
            assert_eq!(
                gate.judge_order(at(0.0), &request(order, 1)),
                Err(GateRefusal::NoSeat)
            );
        }
        for order in [OrderWord::Stop, OrderWord::Hold] {
            assert_eq!(gate.judge_order(at(0.0), &request(order, 1)), Ok(()));
        }
        assert_eq!(
            gate.judge_order(at(0.0), &request(OrderWord::Seat, 1)),
            Ok(())
        );
        assert_eq!(
            gate.judge_order(at(1.0), &request(OrderWord::Start, 1)),
            Ok(())
        );
        assert_eq!(
            gate.judge_order(at(1.0), &request(OrderWord::Start, 2)),
            Err(GateRefusal::NoSeat)
        );
    }

    #[test]
    fn a_seat_is_one_pages_until_it_is_taken_over_left_or_not_renewed() {
        let mut gate = gate();
        let (one, two) = (request(OrderWord::Seat, 1), request(OrderWord::Seat, 2));
        let over = OrderRequest {
            take_over: true,
            ..two.clone()
        };
        assert_eq!(gate.judge_order(at(0.0), &one), Ok(()));
        assert_eq!(
            gate.judge_order(at(14.0), &two),
            Err(GateRefusal::SeatTaken(PageId(1)))
        );
        assert_eq!(gate.judge_order(at(14.5), &one), Ok(()));
        assert_eq!(gate.seat(at(29.0)), Some(PageId(1)));
        assert_eq!(gate.seat(at(29.6)), None);
        assert_eq!(gate.judge_order(at(20.0), &over), Ok(()));
        assert_eq!(gate.seat(at(21.0)), Some(PageId(2)));
        gate.leave(PageId(1));
        assert_eq!(gate.seat(at(21.0)), Some(PageId(2)));
        gate.leave(PageId(2));
        assert_eq!(gate.judge_order(at(22.0), &one), Ok(()));
    }
}
