//! What made the vehicle's reflex halt lately, whether the map shows it or not: each counts until its time is over. What a
//! search closes because of it is decided by [`super::PathSearch`].

use serde::{Deserialize, Serialize};

use crate::geom::{Point, Segment};
use crate::node::mission::way::Way;
use crate::node::vehicle::ReflexObstacle;
use crate::plan::Release;
use crate::time::Time;

/// Obstacles are looked for along the way in steps of this length, metres.
const STEP_M: f64 = 0.1;

/// Obstacles that the reflex has met.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct ReflexObstacles {
    known: Vec<ReflexObstacle>,
}

impl ReflexObstacles {
    /// Remembers what made the reflex halt, and forgets what is not believed any more.
    pub(super) fn note(&mut self, now: Time, obstacle: ReflexObstacle) {
        self.known.retain(|known| known.until > now);
        self.known.push(obstacle);
    }

    /// Returns the obstacles that are believed to be there.
    pub(super) fn present(&self, now: Time) -> impl Iterator<Item = &ReflexObstacle> {
        self.known.iter().filter(move |known| known.until > now)
    }
}

/// Ends the release of a way, from the place where the vehicle is, before the way leads to one of the obstacles.
pub(super) fn hold_before(
    obstacles: &[ReflexObstacle],
    place: Point,
    way: &Way,
    release: &mut Release,
) {
    for obstacle in obstacles {
        if let Some(at_m) = free_until_m(obstacle, place, way, release) {
            release.free_until_m = at_m;
            (release.blocked, release.blocked_at_m) = (Some(obstacle.at), Some(at_m));
        }
    }
}

/// Returns the length along the way, metres, up to which a release keeps clear of an obstacle; `None` = it never comes too
/// near.
fn free_until_m(
    obstacle: &ReflexObstacle,
    place: Point,
    way: &Way,
    release: &Release,
) -> Option<f64> {
    let (here_m, away_m) = (release.here_m, obstacle.at.distance_to(place));
    let steps = (release.ahead_m() / STEP_M).ceil() as usize;
    let leads_there = |step: &usize| {
        let until_m = (here_m + *step as f64 * STEP_M).min(release.free_until_m);
        way.until(place, here_m, until_m)
            .windows(2)
            .any(|pair| !obstacle.is_passed_by(Segment::new(pair[0], pair[1]), away_m))
    };
    let step = (1..=steps).find(leads_there)?;
    Some(here_m + (step - 1) as f64 * STEP_M)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(time_s: f64) -> Time {
        Time::from_secs_f64(time_s)
    }

    /// An obstacle at (`x_m`, 0) that is believed until a time.
    fn obstacle(x_m: f64, until_s: f64) -> ReflexObstacle {
        ReflexObstacle {
            at: Point::new(x_m, 0.0),
            keep_m: 0.5,
            middle_keep_m: 0.35,
            until: at(until_s),
        }
    }

    /// What remains of a release of 4 m along x, from the datum.
    fn held(now_s: f64, obstacles: &[ReflexObstacle]) -> (f64, Option<Point>) {
        let mut known = ReflexObstacles::default();
        obstacles.iter().for_each(|one| known.note(at(0.0), *one));
        let mut way = Way::default();
        way.append([], Point::new(8.0, 0.0), None);
        let mut release = Release {
            free_until_m: 4.0,
            here_m: 0.0,
            blocked: None,
            blocked_at_m: None,
            unknown: None,
            unknown_at_m: None,
        };
        let present: Vec<ReflexObstacle> = known.present(at(now_s)).copied().collect();
        hold_before(&present, Point::default(), &way, &mut release);
        (release.free_until_m, release.blocked)
    }

    #[test]
    fn a_release_ends_where_the_way_comes_too_near_to_the_nearest_obstacle() {
        let (free_m, blocked) = held(1.0, &[obstacle(3.0, 9.0), obstacle(2.0, 9.0)]);
        assert!((free_m - 1.5).abs() < 1e-9, "{free_m} m");
        assert_eq!(blocked, Some(Point::new(2.0, 0.0)));
    }

    #[test]
    fn what_is_behind_or_out_of_date_holds_nobody() {
        assert_eq!(held(1.0, &[obstacle(-0.3, 9.0)]), (4.0, None), "behind");
        assert_eq!(held(9.0, &[obstacle(2.0, 9.0)]), (4.0, None), "too old");
    }

    #[test]
    fn what_is_out_of_date_is_forgotten_when_something_is_met() {
        let mut known = ReflexObstacles::default();
        known.note(at(1.0), obstacle(2.0, 3.0));
        known.note(at(3.0), obstacle(4.0, 9.0));
        assert_eq!(known.known, [obstacle(4.0, 9.0)]);
    }
}
