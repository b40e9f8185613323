//! What commands of ground stations ask of one vehicle, and what each is answered: a command becomes an order, is in
//! progress until the operator says how that ended, and is not taken twice.
//!
//! ```text
//!   command ─► Open (IN_PROGRESS) ─► in force: ACCEPTED; refused: DENIED; else FAILED
//!      └ the same again ─► joins the open one, or hears its answer
//! ```

use std::time::Duration;

use tomoswarm_proto::OrderKind;

use crate::autopilot::{FlightMode, VehicleKind};
use crate::mavlink::asked_command::{AskedCommand, FORCE};
use crate::mavlink::client_link::ClientId;
use crate::mavlink::dialect::{MavCmd, MavResult};
use crate::mavlink::frames::MavAddress;
use crate::mavlink::modes::{ShownMode, mode_of};
use crate::time::Time;

/// The same within this time is said twice.
const SAID_TWICE: Duration = Duration::from_secs(1);
/// So is the same with a confirmation that counts up.
const SAID_AGAIN: Duration = Duration::from_secs(10);
/// Arming, a mode and the start of a mission are often given one after the other: they are one start.
const ONE_START: Duration = Duration::from_secs(5);
/// Orders that may be open at a time.
const OPEN_MAX: usize = 8;
/// The mode BRAKE of copters, which no mission uses.
const BRAKE: u32 = 17;

/// What is wanted of a vehicle.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct WantedOrder {
    pub kind: OrderKind,
    /// Whether a start may begin a new run; otherwise it goes on with the present one.
    pub begins: bool,
}

/// Returns what a command wants.
///
/// # Errors
/// What it is answered that wants nothing of the kind.
pub(super) fn wanted(kind: VehicleKind, asked: &AskedCommand) -> Result<WantedOrder, MavResult> {
    let (denied, unsupported) = (
        MavResult::MAV_RESULT_DENIED,
        MavResult::MAV_RESULT_UNSUPPORTED,
    );
    let order = |kind| {
        Ok(WantedOrder {
            kind,
            begins: kind == OrderKind::Start,
        })
    };
    match asked.command {
        MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => match asked.whole(1).ok_or(denied)? {
            1 => order(OrderKind::Start),
            0 if asked.parameters[1] == FORCE => order(OrderKind::CutMotors),
            0 => order(OrderKind::Land),
            _ => Err(denied),
        },
        MavCmd::MAV_CMD_DO_SET_MODE => {
            wanted_by_mode(kind, asked.whole(2).ok_or(denied)?).ok_or(unsupported)
        }
        MavCmd::MAV_CMD_MISSION_START => order(OrderKind::Start),
        MavCmd::MAV_CMD_DO_PAUSE_CONTINUE => match asked.whole(1).ok_or(denied)? {
            0 => order(OrderKind::Hold),
            1 => Ok(WantedOrder {
                kind: OrderKind::Start,
                begins: false,
            }),
            _ => Err(denied),
        },
        MavCmd::MAV_CMD_NAV_LOITER_UNLIM => order(OrderKind::Hold),
        MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH => order(OrderKind::Return),
        MavCmd::MAV_CMD_NAV_LAND => order(OrderKind::Land),
        MavCmd::MAV_CMD_DO_FLIGHTTERMINATION => match asked.whole(1).ok_or(denied)? {
            1 => order(OrderKind::CutMotors),
            _ => Err(denied),
        },
        _ => Err(unsupported),
    }
}

/// Returns what the mode of a number wants; `None` for one that is not driven.
pub(super) fn wanted_by_mode(kind: VehicleKind, number: u32) -> Option<WantedOrder> {
    let kind = match mode_of(kind, number) {
        ShownMode::Known(FlightMode::Auto | FlightMode::Guided) => OrderKind::Start,
        ShownMode::Known(FlightMode::Hold | FlightMode::Loiter) => OrderKind::Hold,
        ShownMode::Known(FlightMode::Return) => OrderKind::Return,
        ShownMode::Known(FlightMode::Land) => OrderKind::Land,
        ShownMode::Other(BRAKE) if kind == VehicleKind::Copter => OrderKind::Hold,
        ShownMode::Known(FlightMode::Manual) | ShownMode::Other(_) => return None,
    };
    Some(WantedOrder {
        kind,
        begins: kind == OrderKind::Start,
    })
}

/// Who waits for the answer to a command.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Asker {
    pub client: ClientId,
    pub from: MavAddress,
    /// `None` = it came in a message that is not answered.
    pub command: Option<MavCmd>,
}

/// What became of a command.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Taken {
    /// It is to be ordered under this number.
    Order(u32),
    /// It is under way already.
    UnderWay,
    /// It is answered.
    Answered(MavResult),
}

/// An order that a command has led to.
#[derive(Clone, Debug)]
struct GivenOrder {
    number: u32,
    wanted: WantedOrder,
    at: Time,
    askers: Vec<Asker>,
    end: Option<MavResult>,
}

/// The orders that were asked of one vehicle: those that are open, and the last one.
#[derive(Clone, Debug, Default)]
pub(super) struct GivenOrders(Vec<GivenOrder>);

impl GivenOrders {
    /// Takes what is wanted; `number` names a new order.
    pub(super) fn take(
        &mut self,
        now: Time,
        wanted: WantedOrder,
        asker: Asker,
        confirmation: u8,
        number: u32,
    ) -> Taken {
        if let Some(last) = self.0.last_mut()
            && last.wanted.kind == wanted.kind
            && let Some(taken) = last.again(now, asker, confirmation)
        {
            return taken;
        }
        if self.0.iter().filter(|given| given.end.is_none()).count() >= OPEN_MAX {
            return Taken::Answered(MavResult::MAV_RESULT_TEMPORARILY_REJECTED);
        }
        self.0.retain(|given| given.end.is_none());
        self.0.push(GivenOrder {
            number,
            wanted,
            at: now,
            askers: vec![asker],
            end: None,
        });
        Taken::Order(number)
    }

    /// Takes how an order has ended; returns who waits for that.
    pub(super) fn ended(&mut self, number: u32, end: MavResult) -> Vec<Asker> {
        let is_meant = |given: &&mut GivenOrder| given.number == number && given.end.is_none();
        let Some(given) = self.0.iter_mut().find(is_meant) else {
            return Vec::new();
        };
        given.end = Some(end);
        let askers = given.askers.clone();
        let newest = self.0.last().map(|given| given.number);
        self.0
            .retain(|given| given.end.is_none() || Some(given.number) == newest);
        askers
    }
}

impl GivenOrder {
    /// Returns what is answered when the same is wanted again; `None` when it is to be ordered anew.
    fn again(&mut self, now: Time, asker: Asker, confirmation: u8) -> Option<Taken> {
        let Some(end) = self.end else {
            if !self.askers.contains(&asker) && self.askers.len() < OPEN_MAX {
                self.askers.push(asker);
            }
            return Some(Taken::UnderWay);
        };
        let age = now.since(self.at);
        let is_said_again = self.askers.contains(&asker)
            && (age < SAID_TWICE || confirmation > 0 && age < SAID_AGAIN);
        let is_one_start = self.wanted.kind == OrderKind::Start
            && end == MavResult::MAV_RESULT_ACCEPTED
            && age < ONE_START;
        (is_said_again || is_one_start).then_some(Taken::Answered(end))
    }
}
