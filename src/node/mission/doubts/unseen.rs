//! What an exploration does about what is in doubt: it looks from near at what alone may bar the way to ground that nobody has
//! seen.

use super::{CloseLook, DoubtStep, DoubtTry, Doubts, Reached, SMALL_CELLS, is_shut_in};
use crate::geom::{Cell, Point};
use crate::map::Bar;
use crate::node::mission::terrain::{PathSearch, RULES, ReachedGround, Resolution};
use crate::plan::{Component, Distances, SearchGrid};

/// From where it would look, if peers did not bar the way there.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct BehindPeers {
    /// The place.
    pub from: Point,
    /// Whether those may go away.
    pub may_go: bool,
}

impl Doubts {
    /// Returns what to try next so that ground that nobody has seen, and where there is room to stand, can be reached;
    /// `reached` is what can be, finely, if it can set out. Small things that bar are looked at once, although they are
    /// confirmed: an exploration that takes an echo for a pole in a doorway would end before it.
    ///
    /// # Errors
    /// None is: the share of the ground with room to stand that might be reached, which nobody has seen and to which no way is
    /// known, 0 to 1; of all such ground where the vehicle is too near to something to go anywhere.
    pub(crate) fn toward_unseen(
        &mut self,
        search: &PathSearch<'_>,
        reached: Option<ReachedGround>,
        peers: &[Vec<Point>],
    ) -> Result<DoubtTry, f64> {
        // Ground that is too large to be searched is told before.
        let roomy = search.ground(None, Resolution::Parts, true, &[]);
        let roomy = roomy.ok_or(0.0)?;
        let reached = reached.map(Reached::finely);
        let look = reached
            .as_ref()
            .and_then(|reached| self.look_toward_unseen(search, peers, (&roomy, reached)));
        if let Some(look) = look {
            return Ok(DoubtTry::Look(look));
        }
        let back = self.go_back(search, peers).map(DoubtTry::GoBack);
        back.ok_or_else(|| {
            self.unseen_share(search, &roomy, reached.as_ref())
                .unwrap_or(0.0)
        })
    }

    /// Returns a close look that can be taken while it waits for peers; `reached` is what can be, finely.
    pub(crate) fn look_meanwhile(
        &self,
        search: &PathSearch<'_>,
        reached: ReachedGround,
        peers: &[Vec<Point>],
    ) -> Option<CloseLook> {
        let roomy = search.ground(None, Resolution::Parts, true, &[])?;
        let reached = Reached::finely(reached);
        // What it finds to be given up meanwhile is so while the peers are there.
        self.clone()
            .look_toward_unseen(search, peers, (&roomy, &reached))
    }

    /// Returns from where it would look next to see more, if peers did not bar the way to that place: those that may go away, or
    /// all. What was given up because they did is not given up then. `gone` is what those claim that do not go away.
    pub(crate) fn unseen_behind_peers(
        &mut self,
        search: &PathSearch<'_>,
        peers: &[Vec<Point>],
        gone: &[Vec<Point>],
    ) -> Option<BehindPeers> {
        let stays = [Some(gone), Some(&[][..]).filter(|_| !gone.is_empty())];
        let mut tries = stays.into_iter().flatten();
        tries.find_map(|stay| {
            let may_go = stay.len() == gone.len();
            let is_any = stay.len() < peers.len();
            let from = is_any
                .then(|| self.unseen_without(search, stay))
                .flatten()?;
            Some(BehindPeers { from, may_go })
        })
    }

    /// The same, without all peers but those that claim this.
    fn unseen_without(&mut self, search: &PathSearch<'_>, stay: &[Vec<Point>]) -> Option<Point> {
        let roomy = search.ground(None, Resolution::Parts, true, &[])?;
        let reached = Reached::from_here(search, stay)?;
        let without = self.but_for_peers(search.lattice());
        let look = without
            .clone()
            .look_toward_unseen(search, stay, (&roomy, &reached))?;
        *self = without;
        let course = look.course.as_ref();
        let last = course.and_then(|course| course.corners.last().copied());
        Some(last.unwrap_or(search.from()))
    }

    /// Returns the close look by which ground that nobody has seen may be reached; of what is known it needs where there is
    /// room to stand, and what can be reached.
    fn look_toward_unseen(
        &mut self,
        search: &PathSearch<'_>,
        peers: &[Vec<Point>],
        known: (&SearchGrid, &Reached),
    ) -> Option<CloseLook> {
        self.toward_unseen_past(search, peers, known, &[])
            .or_else(|| {
                let mut doubted = search.small_things(SMALL_CELLS);
                doubted.retain(|cell| self.places_of(search.lattice(), *cell).is_empty());
                match doubted.is_empty() {
                    true => None,
                    false => self.toward_unseen_past(search, peers, known, &doubted),
                }
            })
    }

    /// Returns the same, with confirmed cells (ascending) that are taken for free.
    fn toward_unseen_past(
        &mut self,
        search: &PathSearch<'_>,
        peers: &[Vec<Point>],
        (roomy, reached): (&SearchGrid, &Reached),
        doubted: &[Cell],
    ) -> Option<CloseLook> {
        let whole = search.optimistic_ground(None, doubted)?;
        let (map, lattice) = (search.fenced_map()?, search.lattice());
        loop {
            let mut grid = whole.clone();
            self.close_given_up(search, &mut grid);
            let nodes = grid.lattice();
            let optimistic =
                Distances::from_start(&grid, nodes.cell_at(search.from()), &RULES).ok()?;
            let wanted = |node: Cell| {
                let cost_m = optimistic.cost_m(node)?;
                let is_wanted = roomy.passable(node)
                    && !reached.ground.is_reached(nodes.centre(node))
                    && map.is_unseen(lattice.cell_at(nodes.centre(node)));
                is_wanted.then_some((cost_m, node))
            };
            let nearest = grid.area().cells().filter_map(wanted);
            let (_, node) = nearest.min_by(|a, b| a.0.total_cmp(&b.0))?;
            let route = optimistic.route_to(&grid, search.from(), nodes.centre(node))?;
            if let Some(step) = self.look_along(search, reached, &route.points, peers) {
                return match step {
                    DoubtStep::Try(DoubtTry::Look(look)) => Some(look),
                    DoubtStep::Try(DoubtTry::GoBack(_))
                    | DoubtStep::NoWay(_)
                    | DoubtStep::Spent(_) => None,
                };
            }
        }
    }

    /// See [`Doubts::toward_unseen`]; `None` when the fence is too large to search. Where something was heard, which was looked
    /// at from near as often as that may be and bars still, what might be reached ends.
    fn unseen_share(
        &self,
        search: &PathSearch<'_>,
        roomy: &SearchGrid,
        reached: Option<&Reached>,
    ) -> Option<f64> {
        let mut whole = search.optimistic_by_all()?;
        let (map, lattice, nodes) = (search.fenced_map()?, search.lattice(), whole.lattice());
        // Ground that is unknown after all looks may be empty.
        let is_heard = |cell| {
            map.barred(cell)
                .is_some_and(|barred| barred.bar >= Bar::Doubtful)
        };
        self.close_bars(search, &mut whole, |cell| {
            self.is_spent(lattice, *cell) && is_heard(*cell)
        });
        let might = Component::around(&whole, nodes.cell_at(search.from()), &RULES);
        let is_shut_in = is_shut_in(search, &whole);
        let (mut all, mut unseen) = (0_u32, 0_u32);
        for node in whole.area().cells() {
            if !roomy.passable(node) || !(is_shut_in || might.contains(node)) {
                continue;
            }
            let at = nodes.centre(node);
            let is_reached = reached.is_some_and(|reached| reached.ground.is_reached(at));
            all += 1;
            unseen += u32::from(!is_reached && map.is_unseen(lattice.cell_at(at)));
        }
        Some(f64::from(unseen) / f64::from(all.max(1)))
    }
}

#[cfg(test)]
mod tests {
    use tomoswarm_proto::LayerId;

    use super::*;
    use crate::node::mission::terrain::Terrain;
    use crate::node::mission::terrain::tests::tiles_valued;
    use crate::node::tests_support::{own_state, settings};
    use crate::time::Time;

    /// The vehicle's own value of a cell, 0.1 log-odds, by its middle in metres: a corridor along x with a closed end in the
    /// west, and one in the east, x ≥ 2, that the vehicle holds for this; outside nobody has seen anything.
    fn corridor(x_m: f64, y_m: f64, end: i8) -> i8 {
        let is_inside = (-2.0..2.0).contains(&x_m) && y_m.abs() < 0.8;
        let is_wall = (-2.2..2.2).contains(&x_m) && y_m.abs() < 1.0;
        match (is_inside, is_wall, x_m >= 2.0) {
            (true, ..) => -17,
            (false, true, true) => end,
            (false, true, false) => 17,
            (false, false, _) => 0,
        }
    }

    /// What the vehicle knows of the corridor, and, if a peer has confirmed the end, what that says.
    fn terrain(end: i8, has_peer: bool) -> Terrain {
        let settings = settings(1);
        let mut terrain = Terrain::new(settings.clone());
        let mut learn = |layer, value: &dyn Fn(f64, f64) -> i8| {
            let tiles = tiles_valued(layer, value);
            tiles
                .into_iter()
                .for_each(|tile| terrain.learn(&tile.into()));
        };
        learn(settings.layer(), &|x_m, y_m| corridor(x_m, y_m, end));
        if has_peer {
            learn(LayerId::default(), &|x_m, y_m| {
                corridor(x_m, y_m, 17).max(0)
            });
        }
        terrain
    }

    /// Looks as it is told to until it ends, at a map that stays as it is; returns the looks and the share that is unseen then.
    fn explored(terrain: &Terrain, doubts: &mut Doubts, peers: &[Vec<Point>]) -> (usize, f64) {
        let mut at = Point::new(-1.0, 0.0);
        for looks in 0..50 {
            let search = terrain.search(Time::ZERO, own_state(at.x_m, at.y_m).pose);
            match doubts.toward_unseen(&search, search.reached_finely(peers), peers) {
                Ok(DoubtTry::Look(look)) => {
                    at = look.course.map_or(at, |way| *way.corners.last().unwrap());
                    doubts.note(search.lattice(), look.at, at);
                }
                Ok(DoubtTry::GoBack(way)) => at = *way.corners.last().unwrap(),
                Err(share) => return (looks, share),
            }
        }
        panic!("it never ends");
    }

    #[test]
    fn what_bars_still_after_all_looks_bounds_the_ground_that_might_be_reached() {
        // The end may be a wall and may not; and it may be ground that nobody has seen.
        let (looks, share) = explored(&terrain(9, false), &mut Doubts::default(), &[]);
        assert!(looks >= 3 && share < 0.1, "{looks} looks, {share}");
        let (_, share) = explored(&terrain(17, false), &mut Doubts::default(), &[]);
        assert!(share < 0.1, "a wall: {share}");
        let (looks, share) = explored(&terrain(0, false), &mut Doubts::default(), &[]);
        assert!(
            looks >= 3 && share > 0.9,
            "nobody has heard anything: {share}"
        );
    }

    #[test]
    fn what_peers_have_confirmed_bounds_it_too() {
        let share = |has_peer: bool| {
            let terrain = terrain(-3, has_peer);
            let search = terrain.search(Time::ZERO, own_state(-1.0, 0.0).pose);
            let roomy = search.ground(None, Resolution::Parts, true, &[]).unwrap();
            let reached = Reached::from_here(&search, &[]);
            let doubts = Doubts::default();
            doubts
                .unseen_share(&search, &roomy, reached.as_ref())
                .unwrap()
        };
        assert!(share(false) > 0.9 && share(true) < 0.1);
    }

    #[test]
    fn where_peers_bar_the_way_to_where_it_would_look_from_it_waits() {
        let terrain = terrain(9, false);
        let standing = [vec![Point::new(0.5, 0.0)]];
        let mut doubts = Doubts::default();
        let (looks, share) = explored(&terrain, &mut doubts, &standing);
        assert!(looks == 0 && share > 0.9, "{looks} looks, {share}");
        let search = terrain.search(Time::ZERO, own_state(-1.0, 0.0).pose);
        let mut behind = |gone: &[Vec<Point>]| {
            let found = doubts.unseen_behind_peers(&search, &standing, gone);
            found.map(|found| (found.from.x_m > 0.0, found.may_go))
        };
        assert_eq!(behind(&[]), Some((true, true)));
        assert_eq!(behind(&standing), Some((true, false)), "it does not go");
        let nobody = doubts.unseen_behind_peers(&search, &[], &[]);
        assert_eq!(nobody, None);
        let (looks, share) = explored(&terrain, &mut doubts, &[]);
        assert!(looks >= 3 && share < 0.1, "once it is gone: {share}");
        assert_eq!(doubts.unseen_behind_peers(&search, &standing, &[]), None);
    }
}
