//! A run that is driven by the scenario's script while an operator shadows it: the operator hears the whole bus and
//! follows the same scenario, but nobody hears it. What the two order is compared; when is not.

use tomoswarm_proto::{Message, Order, OrderKind, RunId};

use crate::operator::operator_actor::Out;
use crate::operator::script::ScriptEnd;

/// What a script orders, or brings about.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Deed {
    /// This run is started; run 0 = the vehicles' own missions.
    Start(RunId),
    /// The persons enter.
    PersonsEnter,
    /// Everybody is sent home.
    Return,
    /// All is done.
    Ends,
    /// It is given up.
    GivesUp,
}

/// What the script that drove a run did, and what the operator beside it would have done.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ShadowRun {
    /// The script that drove.
    pub script: Vec<Deed>,
    /// The operator.
    pub operator: Vec<Deed>,
}

/// Returns what an operator that said this has done, each deed once and in order.
pub(super) fn deeds(said: &[Out]) -> Vec<Deed> {
    let mut deeds = Vec::new();
    for deed in said.iter().filter_map(deed) {
        if !deeds.contains(&deed) {
            deeds.push(deed);
        }
    }
    deeds
}

fn deed(said: &Out) -> Option<Deed> {
    match said {
        Out::Publish(Message::Order(Order { kind: OrderKind::Start, run, .. })) => Some(Deed::Start(*run)),
        Out::Publish(Message::Order(Order { kind: OrderKind::Return, .. })) => Some(Deed::Return),
        Out::Cue(_) => Some(Deed::PersonsEnter),
        Out::ScriptEnded(ScriptEnd::Done) => Some(Deed::Ends),
        Out::ScriptEnded(ScriptEnd::GaveUp { .. }) => Some(Deed::GivesUp),
        Out::Publish(_) | Out::InForce(..) | Out::Ended(..) => None,
    }
}
