//! A board as it was, kept for long. Plans are most of a board, and say the same again and again: they are packed and
//! compressed, and snapshots share them as long as they do not change.

use std::sync::Arc;

use tomoswarm_proto::codec::{self, EncodeError};
use tomoswarm_proto::{Lease, Plan, Revision, RunId, VehicleId};

use crate::dash::board::Board;
use crate::dash::deflate::{deflate, inflate};
use crate::dash::radio::RadioView;

/// What tells a plan of a vehicle from its others.
type Edition = (VehicleId, RunId, Lease, Revision);

/// A board as it was.
#[derive(Debug)]
pub struct BoardSnapshot {
    /// Without plans.
    board: Board,
    board_bytes: usize,
    editions: Vec<Edition>,
    /// The plans, packed one after another and compressed.
    plans: Arc<[u8]>,
}

impl BoardSnapshot {
    /// Makes one of a board; `before` = the one that was made last.
    ///
    /// # Errors
    /// A plan cannot be packed.
    pub(super) fn of(
        board: &Board,
        before: Option<&BoardSnapshot>,
    ) -> Result<BoardSnapshot, EncodeError> {
        let edition = |plan: &Plan| (plan.vehicle, plan.run, plan.lease, plan.revision);
        let editions: Vec<Edition> = board.plans().map(edition).collect();
        let plans = match before.filter(|before| before.editions == editions) {
            Some(before) => before.plans.clone(),
            None => deflate(&codec::pack(&board.plans().collect::<Vec<_>>())?).into(),
        };
        let board = board.with_plans(Vec::new());
        Ok(BoardSnapshot {
            board_bytes: board.bytes(),
            board,
            editions,
            plans,
        })
    }

    /// Returns the board as it was; it has nothing to say of what came before it.
    pub fn board(&self) -> Board {
        let mut packed = Vec::new();
        inflate(&self.plans, &mut packed);
        // What was packed here can be read.
        let plans = codec::unpack(&packed);
        self.board.with_plans(plans.unwrap_or_default())
    }

    /// Returns who was heard by whom.
    pub fn radio(&self) -> &RadioView {
        self.board.radio()
    }

    /// Returns how many bytes it takes, about, without what it shares with the one before.
    pub(super) fn bytes(&self, before: Option<&BoardSnapshot>) -> usize {
        let shares = before.is_some_and(|before| Arc::ptr_eq(&before.plans, &self.plans));
        self.board_bytes + if shares { 0 } else { self.plans.len() }
    }
}
