//! What of a mission is one vehicle's to do. How its places are shared is declared with it
//! ([`PlaceSharing`]); no kind of mission is known here.

use tomoswarm_proto::{PlaceSharing, Position, TaskKind, TaskParameter};

/// Returns what of a mission the vehicle at a place among so many does, counted from 0.
pub(crate) fn share(task: &TaskKind, index: usize, of: usize) -> TaskKind {
    let mut share = task.clone();
    for parameter in share.parameters() {
        match parameter {
            TaskParameter::Number(..) => {}
            TaskParameter::Places(places, PlaceSharing::EachBeginsElsewhere) => {
                *places = begun_at(places, index);
            }
            TaskParameter::Places(places, PlaceSharing::InTurn) => {
                let of = of.max(1);
                *places = places
                    .iter()
                    .copied()
                    .skip(index % of)
                    .step_by(of)
                    .collect();
            }
        }
    }
    share
}

/// Returns places in another order: from one of them to the end, then from the first. A round that ends where it began does
/// so again.
fn begun_at(places: &[Position], index: usize) -> Vec<Position> {
    let is_round = places.len() > 2 && places.first() == places.last();
    let open = &places[..places.len() - usize::from(is_round)];
    let start = index % open.len().max(1);
    let mut turned: Vec<Position> = open[start..]
        .iter()
        .chain(&open[..start])
        .copied()
        .collect();
    turned.extend(turned.first().copied().filter(|_| is_round));
    turned
}
