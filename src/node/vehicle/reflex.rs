//! The reflex: when a reading says that the vehicle must halt, and what it keeps clear of afterwards. It knows no map, no
//! plan and no network, and it moves nothing itself.

use std::collections::VecDeque;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::messages::ReflexObstacle;
use crate::geom::{Angle, Point, Track, Vector};
use crate::node::VehicleSettings;
use crate::node::peers::Peers;
use crate::node::sensor::Scan;
use crate::plan::{REACTION_S, stopping_distance_m};
use crate::time::Time;

/// What the reflex leaves between the body and an object, metres.
const MARGIN_M: f64 = 0.1;
/// What made the reflex halt is kept clear of for this long, even if the map does not show it.
const KEEP_FOR: Duration = Duration::from_secs(60);

/// The same of what stands where a peer is: it may drive on, and its separation is kept anyway.
const KEEP_PEER_FOR: Duration = Duration::from_secs(5);

/// Between what another reading saw empty and where its echo came from lies at least this much, metres.
const BEFORE_ECHO_M: f64 = 0.1;
/// So far inside its cone lies what another reading saw empty, radians.
const INSET_RAD: f64 = 0.035;
/// Who turns at a corner of its way shows it so much later at most: until then readings are told a direction that is gone.
const TURN_SHOWS_AFTER: Duration = Duration::from_millis(250);
/// Places on the arc of an echo that are asked about.
const ARC_PLACES: u32 = 13;
/// Readings that are remembered at most.
const READINGS_MAX: usize = 64;

/// What made the reflex halt of late, and what the last readings saw empty.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Reflex {
    obstacles: Vec<ReflexObstacle>,
    /// The readings of the last round of all beams, oldest first.
    readings: VecDeque<Reading>,
}

/// What a reading saw empty.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
struct Reading {
    at: Time,
    origin: Point,
    /// Of the vehicle.
    heading: Angle,
    /// Of the beam.
    direction: Angle,
    /// Up to here, metres.
    empty_m: f64,
}

impl Reading {
    /// Returns whether it saw a place empty; cones have this half-width.
    fn saw_empty(&self, place: Point, half_width_rad: f64) -> bool {
        let off = self.origin.angle_to(place) - self.direction;
        self.origin.distance_to(place) <= self.empty_m
            && off.radians().abs() <= half_width_rad - INSET_RAD
    }
}

impl Reflex {
    /// Remembers what made it halt, and forgets what is believed to be there no longer.
    pub(super) fn remember(&mut self, now: Time, obstacle: ReflexObstacle) {
        self.obstacles.retain(|known| known.until > now);
        self.obstacles.push(obstacle);
    }

    /// Remembers what a reading saw empty, until all beams have been looked along once more: nothing of what is farther than a
    /// thin post is heard, and nothing that was read while the vehicle may have turned already.
    pub(super) fn watch(&mut self, now: Time, settings: &VehicleSettings, scan: &Scan) {
        let look = &settings.look;
        let round = look.cycle() + look.period;
        let heading = scan.pose.heading;
        let has_turned = self
            .readings
            .back()
            .is_some_and(|last| (last.heading - heading).radians().abs() > INSET_RAD);
        if has_turned {
            self.readings
                .retain(|one| now.since(one.at) > TURN_SHOWS_AFTER);
        }
        while self.readings.len() >= READINGS_MAX
            || self
                .readings
                .front()
                .is_some_and(|one| now.since(one.at) > round)
        {
            self.readings.pop_front();
        }
        let heard_m = look
            .smallest_post
            .map_or(look.sure_range_m, |post| post.heard_m);
        let sure_m = look.sure_range_m.min(heard_m);
        let empty_m = match scan.range_m {
            Some(range_m) => (range_m - BEFORE_ECHO_M).min(sure_m),
            None => sure_m,
        };
        self.readings.push_back(Reading {
            at: now,
            origin: scan.pose.at,
            heading,
            direction: heading + scan.beam,
            empty_m,
        });
    }

    /// Returns how far ahead of the body a reading lies that a vehicle that drives must halt for, metres: in the driven strip,
    /// and nearer than it can stop or than the closeness that it was given.
    ///
    /// What has come up suddenly is on no map before the beam looks there again, a round later: so it halts who could not stop
    /// then.
    ///
    /// An echo may have come from anywhere on its arc. Where another beam has seen nothing in the same round it has not: so who
    /// passes beside something is not held by the end of the arc that lies before it. An echo of a beam that looks ahead
    /// always counts.
    pub(super) fn halts_for(
        &self,
        settings: &VehicleSettings,
        speed_mps: f64,
        scan: &Scan,
    ) -> Option<f64> {
        let ahead_m = ahead_m(settings, scan)?;
        let waits_s = match scan.suspect {
            true => settings.look.cycle().as_secs_f64(),
            false => 0.0,
        };
        let needs_m =
            stopping_distance_m(speed_mps, REACTION_S + waits_s, settings.body.braking_mps2);
        let is_close = scan
            .range_m
            .is_some_and(|range_m| range_m < settings.safety.closeness_m);
        let halts = is_close || ahead_m < needs_m + MARGIN_M;
        (halts && !self.is_elsewhere(settings, scan)).then_some(ahead_m)
    }

    /// Returns whether an echo of a beam that looks aside has come from beside the driven strip: all of its arc that lies
    /// in the strip was seen empty.
    fn is_elsewhere(&self, settings: &VehicleSettings, scan: &Scan) -> bool {
        let half_rad = settings.look.half_angle.radians();
        let (Some(range_m), true) = (scan.range_m, scan.beam.radians().abs() > half_rad) else {
            return false;
        };
        let strip_m = settings.body.radius_m + MARGIN_M;
        arc_beams(settings, scan).all(|beam| {
            let to = Vector::polar(beam, range_m);
            let is_beside = to.x_m <= 0.0 || to.y_m.abs() > strip_m;
            is_beside || self.saw_empty(settings, place_along(scan, beam, range_m))
        })
    }

    /// Returns whether one of the last readings saw a place empty.
    fn saw_empty(&self, settings: &VehicleSettings, place: Point) -> bool {
        let half_rad = settings.look.half_angle.radians();
        self.readings
            .iter()
            .any(|one| one.saw_empty(place, half_rad))
    }

    /// Returns what a reading stands for: an echo from somewhere on its arc, where no other beam has just seen nothing,
    /// believed for a while, and not for long when it may be a peer.
    pub(super) fn obstacle_of(
        &self,
        settings: &VehicleSettings,
        peers: &Peers,
        now: Time,
        scan: &Scan,
    ) -> ReflexObstacle {
        let range_m = scan.range_m.unwrap_or_default();
        let is_open = |beam: &Angle| !self.saw_empty(settings, place_along(scan, *beam, range_m));
        let mut open = arc_beams(settings, scan).filter(is_open);
        let first = open.next();
        let ends = first.map(|first| (first, open.last().unwrap_or(first)));
        // If others have seen all of it empty, one of them is wrong.
        let half_rad = settings.look.half_angle;
        let (from, to) = ends.unwrap_or((scan.beam - half_rad, scan.beam + half_rad));
        let spread_rad = (to - from).radians() / 2.0;
        let middle = from + Angle::from_radians(spread_rad);
        let (at, spread_m) = (
            place_along(scan, middle, range_m),
            range_m * libm::sin(spread_rad),
        );
        let is_peer = peers.iter().any(|(_, peer)| {
            let met_m = peer.met_within_m(settings.body.radius_m + spread_m, scan.pose.sd_m);
            met_m.is_some_and(|met_m| peer.at.distance_to(at) <= met_m)
        });
        ReflexObstacle {
            at,
            keep_m: settings.body.radius_m + MARGIN_M + spread_m,
            middle_keep_m: settings.body.radius_m + MARGIN_M,
            until: now + if is_peer { KEEP_PEER_FOR } else { KEEP_FOR },
        }
    }

    /// Returns whether a route from `here` comes too near to something that made it halt, wherever on its arc it stands.
    pub(super) fn may_be_in_the_way(&self, now: Time, route: &Track, here: Point) -> bool {
        self.is_barred(now, route, here, |obstacle| obstacle)
    }

    /// Returns whether a route from `here` comes too near to something that made it halt, taken to stand in the middle of
    /// its arc: to keep clear of all of the arc is for whoever plans, and knows from the map what else the echo may have
    /// come from.
    pub(super) fn is_in_the_way(&self, now: Time, route: &Track, here: Point) -> bool {
        self.is_barred(now, route, here, ReflexObstacle::in_the_middle)
    }

    fn is_barred(
        &self,
        now: Time,
        route: &Track,
        here: Point,
        taken: impl Fn(ReflexObstacle) -> ReflexObstacle,
    ) -> bool {
        let is_clear = |obstacle: &ReflexObstacle| {
            let (here_m, obstacle) = (obstacle.at.distance_to(here), taken(*obstacle));
            route
                .segments()
                .all(|piece| obstacle.is_passed_by(piece, here_m))
        };
        !self
            .obstacles
            .iter()
            .filter(|obstacle| obstacle.until > now)
            .all(is_clear)
    }
}

/// Returns directions over all of a reading's cone, from right to left, against the vehicle's heading.
fn arc_beams(settings: &VehicleSettings, scan: &Scan) -> impl Iterator<Item = Angle> {
    let (beam, half_rad) = (scan.beam, settings.look.half_angle.radians());
    (0..ARC_PLACES).map(move |step| {
        let share = 2.0 * f64::from(step) / f64::from(ARC_PLACES - 1) - 1.0;
        beam + Angle::from_radians(half_rad * share)
    })
}

/// Returns the place at a range along a direction against the vehicle's heading.
fn place_along(scan: &Scan, beam: Angle, range_m: f64) -> Point {
    scan.pose.at + Vector::polar(scan.pose.heading + beam, range_m)
}

/// Returns how far ahead of the body an echo may come from; `None` when it lies beside the strip.
fn ahead_m(settings: &VehicleSettings, scan: &Scan) -> Option<f64> {
    let range_m = scan.range_m?;
    let off_axis_rad = (scan.beam.radians().abs() - settings.look.half_angle.radians()).max(0.0);
    let (sin, cos) = libm::sincos(off_axis_rad);
    let strip_m = settings.body.radius_m + MARGIN_M;
    (range_m * sin <= strip_m).then_some(range_m * cos - settings.body.radius_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Pose;
    use crate::node::tests_support::settings;
    use crate::plan::SmallestPost;

    fn scan(heading_deg: f64, beam_deg: f64, range_m: Option<f64>) -> Scan {
        let pose = Pose {
            at: Point::default(),
            heading: Angle::from_degrees(heading_deg),
            sd_m: 0.02,
        };
        Scan {
            pose,
            beam: Angle::from_degrees(beam_deg),
            range_m,
            suspect: false,
        }
    }

    /// Whether an echo of the beam at 30° counts as one from beside, when straight ahead and on the beam before nothing was
    /// heard: 0.2 s ago and at these headings.
    fn is_elsewhere(heard_m: Option<f64>, range_m: f64, headings_deg: [f64; 2]) -> bool {
        let mut settings = settings(1);
        settings.look.smallest_post = heard_m.map(|heard_m| SmallestPost {
            radius_m: 0.03,
            heard_m,
        });
        let mut reflex = Reflex::default();
        let [before_deg, now_deg] = headings_deg;
        for (at_s, heading_deg, beam_deg) in [
            (1.0, before_deg, 0.0),
            (1.0, before_deg, 20.0),
            (1.2, now_deg, -30.0),
        ] {
            let now = Time::from_secs_f64(at_s);
            reflex.watch(now, &settings, &scan(heading_deg, beam_deg, None));
        }
        reflex.is_elsewhere(&settings, &scan(now_deg, 30.0, Some(range_m)))
    }

    #[test]
    fn what_other_beams_saw_empty_is_beside_the_way_unless_a_thin_post_was_out_of_their_hearing() {
        assert!(is_elsewhere(None, 1.0, [0.0, 0.0]));
        assert!(is_elsewhere(Some(1.05), 1.0, [0.0, 0.0]));
        assert!(!is_elsewhere(Some(0.95), 1.0, [0.0, 0.0]));
        assert!(is_elsewhere(Some(0.95), 0.9, [0.0, 0.0]));
    }

    #[test]
    fn what_was_seen_just_before_a_turn_showed_was_seen_elsewhere() {
        assert!(is_elsewhere(None, 1.0, [1.0, 0.0]));
        assert!(!is_elsewhere(None, 1.0, [3.0, 0.0]));
    }
}
