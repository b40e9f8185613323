//! What cannot be looked at from near because peers bar the way to where it could be: that is waited for, and nothing is given up
//! for it.

use super::{DoubtStep, Doubts, LOOKS_MAX};
use crate::geom::{Cell, Point};
use crate::node::mission::terrain::PathSearch;

impl Doubts {
    /// Returns whether something is in doubt on the way to a goal that can be looked at as soon as peers make room. What was
    /// given up because they barred the way to where it could be looked at is not given up then.
    pub(in crate::node::mission) fn wait_for_peers(
        &mut self,
        search: &PathSearch<'_>,
        goal: Point,
        peers: &[Vec<Point>],
    ) -> bool {
        let lattice = search.lattice();
        let is_spent = |cell: &Cell| self.places_of(lattice, *cell).len() >= LOOKS_MAX;
        let given_up = self.given_up.iter().copied().filter(is_spent);
        let without = Doubts {
            given_up: given_up.collect(),
            ..self.clone()
        };
        let looks = || matches!(without.clone().judged(search, goal, &[]), DoubtStep::Try(_));
        let waits = !peers.is_empty() && looks();
        if waits {
            *self = without;
        }
        waits
    }
}
