//! Where the vehicle may go: courses around what is seen and what peers claim. What is unknown counts as free until it was
//! looked at; the pilot looks before it drives.

use super::barred_places::BarredPlaces;
use crate::geom::Point;
use crate::node::mission::kind::{DriveRoute, RouteRoom};
use crate::node::mission::terrain::{PathSearch, RULES, Resolution, WAYS};
use crate::plan::{NoRoute, SearchGrid, shortest_route};

/// Searches courses from where the vehicle is.
pub(super) struct RouteFinder<'a> {
    pub search: PathSearch<'a>,
    /// What was looked at in vain.
    pub barred: &'a BarredPlaces,
}

impl RouteFinder<'_> {
    /// Returns a course to a place, clear of what peers claim; unknown ground may be crossed or not.
    ///
    /// # Errors
    /// Why there is none.
    pub(super) fn course_to(
        &self,
        goal: Point,
        unknown_allowed: bool,
        peers: &[Vec<Point>],
    ) -> Result<DriveRoute, NoRoute> {
        let course = |grid: &SearchGrid, is_narrow: bool| {
            let route = shortest_route(grid, self.search.from(), goal, &RULES)?;
            Ok(DriveRoute {
                corners: route.points[1..].to_vec(),
                room: RouteRoom::searched(is_narrow),
            })
        };
        let ground = |resolution: Resolution| {
            self.ground(Some(goal), resolution, unknown_allowed, peers)
                .ok_or(NoRoute::GoalOutside)
        };
        let mut failed = NoRoute::GoalOutside;
        for (resolution, is_narrow) in WAYS {
            let mut grid = ground(resolution)?;
            if self.search.is_cramped(&grid, resolution) {
                continue;
            }
            if is_narrow {
                grid.open_along(self.search.driven());
            }
            match course(&grid, is_narrow) {
                Ok(found) => return Ok(found),
                Err(none) => failed = none,
            }
        }
        Err(failed)
    }

    /// Returns a finder of courses that may lead to what made the reflex halt.
    pub(super) fn but_for_reflex(self) -> Self {
        RouteFinder {
            search: self.search.but_for_reflex(),
            ..self
        }
    }

    /// Returns where the vehicle may be, clear of what peers claim and of what was looked at in vain.
    pub(super) fn ground(
        &self,
        goal: Option<Point>,
        resolution: Resolution,
        unknown_allowed: bool,
        peers: &[Vec<Point>],
    ) -> Option<SearchGrid> {
        let mut grid = self
            .search
            .ground(goal, resolution, unknown_allowed, peers)?;
        let keep_m = self.search.keep_m();
        self.barred.close(&mut grid, keep_m, self.search.driven());
        grid.stand_on(grid.lattice().cell_at(self.search.from()));
        Some(grid)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::mission::terrain::Terrain;
    use crate::node::mission::terrain::tests::terrain_of;
    use crate::node::tests_support::own_state;
    use crate::time::Time;

    const GOAL: Point = Point::new(-1.0, 0.3);

    /// The course of a vehicle that stands at (3, 0.3).
    fn course(terrain: &Terrain, barred: &BarredPlaces) -> Result<DriveRoute, NoRoute> {
        let courses = RouteFinder {
            search: terrain.search(Time::ZERO, own_state(3.0, 0.3).pose),
            barred,
        };
        courses.course_to(GOAL, false, &[])
    }

    #[test]
    fn a_course_keeps_away_from_what_was_looked_at_in_vain() {
        let terrain = terrain_of(|_, _| false);
        let mut barred = BarredPlaces::default();
        let straight = course(&terrain, &barred).unwrap();
        assert_eq!(
            (straight.corners.len(), straight.room),
            (1, RouteRoom::Kept)
        );
        barred.note(Point::new(1.0, 0.3));
        assert!(course(&terrain, &barred).unwrap().corners.len() > 1);
        (-6..=6).for_each(|y_m| {
            barred.note(Point::new(1.0, f64::from(y_m)));
        });
        let reason = course(&terrain, &barred).unwrap_err();
        assert!(
            matches!(reason, NoRoute::Unreachable { searched: 100.. }),
            "{reason:?}"
        );
    }

    #[test]
    fn a_course_that_is_open_only_since_the_vehicle_has_driven_there_is_narrow() {
        let mut terrain =
            terrain_of(|x_m, y_m| (1.0..1.4).contains(&x_m) && !(0.0..0.6).contains(&y_m));
        assert!(course(&terrain, &BarredPlaces::default()).is_err());
        terrain.note_place(Point::new(0.0, 0.3));
        terrain.note_place(Point::new(2.6, 0.3));
        let narrow = course(&terrain, &BarredPlaces::default()).unwrap();
        assert_eq!(narrow.room, RouteRoom::DrivenBefore);
    }
}
