//! The reflex: when a reading says that the vehicle must halt, and what it keeps clear of afterwards. It knows no map, no
//! plan and no network, and it moves nothing itself.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::messages::{ReflexObstacle, Telemetry};
use crate::geom::{Point, Track, Vector};
use crate::node::VehicleSettings;
use crate::node::sensor::Scan;
use crate::plan::REACTION_S;
use crate::time::Time;

/// What the reflex leaves between the body and an object, metres.
const MARGIN_M: f64 = 0.1;
/// What made the reflex halt is kept clear of for this long, even if the map does not show it.
const KEEP_FOR: Duration = Duration::from_secs(60);

/// What made the reflex halt of late.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Reflex {
    obstacles: Vec<ReflexObstacle>,
}

impl Reflex {
    /// Remembers what made it halt, and forgets what is believed to be there no longer.
    pub(super) fn remember(&mut self, now: Time, obstacle: ReflexObstacle) {
        self.obstacles.retain(|known| known.until > now);
        self.obstacles.push(obstacle);
    }

    /// Returns whether a route from `here` comes too near to something that made it halt.
    pub(super) fn is_in_the_way(&self, now: Time, route: &Track, here: Point) -> bool {
        let is_clear = |obstacle: &ReflexObstacle| {
            let here_m = obstacle.at.distance_to(here);
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

/// Returns how far ahead of the body a reading lies that a vehicle that drives must halt for, metres: in the driven strip,
/// and nearer than it can stop or than the closeness that it was given.
pub(super) fn halts_for(
    settings: &VehicleSettings,
    telemetry: &Telemetry,
    scan: &Scan,
) -> Option<f64> {
    let ahead_m = ahead_m(settings, scan)?;
    let speed = telemetry.speed_mps;
    let needs_m = speed * REACTION_S + speed * speed / (2.0 * settings.body.braking_mps2);
    let is_close = scan
        .range_m
        .is_some_and(|range_m| range_m < settings.safety.closeness_m);
    (is_close || ahead_m < needs_m + MARGIN_M).then_some(ahead_m)
}

/// Returns what a reading stands for: an echo from somewhere in the beam's cone, believed for a while.
pub(super) fn obstacle_of(settings: &VehicleSettings, now: Time, scan: &Scan) -> ReflexObstacle {
    let range_m = scan.range_m.unwrap_or_default();
    let at = scan.pose.at + Vector::polar(scan.pose.heading + scan.beam, range_m);
    let spread_m = range_m * libm::sin(settings.look.half_angle.radians());
    let keep_m = settings.body.radius_m + MARGIN_M + spread_m;
    ReflexObstacle {
        at,
        keep_m,
        until: now + KEEP_FOR,
    }
}

/// Returns how far ahead of the body an echo may come from; `None` when it lies beside the strip.
fn ahead_m(settings: &VehicleSettings, scan: &Scan) -> Option<f64> {
    let range_m = scan.range_m?;
    let off_axis_rad = (scan.beam.radians().abs() - settings.look.half_angle.radians()).max(0.0);
    let (sin, cos) = libm::sincos(off_axis_rad);
    let strip_m = settings.body.radius_m + MARGIN_M;
    (range_m * sin <= strip_m).then_some(range_m * cos - settings.body.radius_m)
}
