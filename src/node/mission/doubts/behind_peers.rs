//! What cannot be looked at from near because peers bar the way to where it could be: that is waited for, and nothing is given up
//! for it.

use super::{DoubtStep, Doubts};
use crate::geom::{Cell, Lattice, Point};
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
        let without = self.but_for_peers(search.lattice());
        let looks = || matches!(without.clone().judged(search, goal, &[]), DoubtStep::Try(_));
        let waits = !peers.is_empty() && looks();
        if waits {
            *self = without;
        }
        waits
    }

    /// Returns the same without what was given up although it was not looked at often: peers may have barred the way there.
    pub(super) fn but_for_peers(&self, lattice: Lattice) -> Doubts {
        let is_spent = |cell: &Cell| self.is_spent(lattice, *cell);
        let given_up = self.given_up.iter().copied().filter(is_spent);
        Doubts {
            given_up: given_up.collect(),
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{DoubtTry, LOOKS_ALL_MAX};
    use super::*;
    use crate::node::mission::terrain::tests::terrain_of;
    use crate::node::tests_support::own_state;
    use crate::time::Time;

    #[test]
    fn what_only_peers_keep_it_from_looking_at_is_waited_for_and_not_given_up() {
        // A closed chamber at the end of a corridor, in which a peer stands.
        let is_chamber = |x_m: f64, y_m: f64| {
            let off_m = (x_m - 4.8).abs().max(y_m.abs());
            (1.2..1.4).contains(&off_m)
        };
        let is_wall = |x_m: f64, y_m: f64| x_m < 1.4 && y_m.abs() > 1.0;
        let terrain =
            terrain_of(|x_m, y_m| is_chamber(x_m, y_m) || is_wall(x_m, y_m) || y_m.abs() > 4.0);
        let search = terrain.search(Time::ZERO, own_state(-3.0, 0.0).pose);
        let goal = Point::new(4.8, 0.0);
        let on_its_way = [vec![Point::new(-0.5, 0.0)]];
        let mut doubts = Doubts::default();
        // It looks at what it can come to, and then only the chamber is left.
        let mut looks = 0;
        while let DoubtStep::Try(DoubtTry::Look(look)) = doubts.toward(&search, goal, &on_its_way) {
            let place = look.course.map(|course| course.corners[0]);
            doubts.note(search.lattice(), look.at, place.unwrap_or(search.from()));
            looks += 1;
        }
        assert!(looks < LOOKS_ALL_MAX, "{looks}");
        assert!(doubts.wait_for_peers(&search, goal, &on_its_way));
        assert!(doubts.given_up.is_empty(), "it may be looked at later");
        let step = doubts.toward(&search, goal, &[]);
        assert!(matches!(step, DoubtStep::Try(_)), "{step:?}");
        assert!(!doubts.wait_for_peers(&search, goal, &[]), "for nobody");
        let behind_it = [vec![Point::new(-4.5, 0.0)]];
        let step = Doubts::default().toward(&search, goal, &behind_it);
        assert!(matches!(step, DoubtStep::Try(_)), "{step:?}");
    }
}
