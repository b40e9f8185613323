//! How far silence is believed of beams that see nothing beside the vehicle. What the map makes of a reading without an echo
//! is not known here.
//!
//! A wall turns a beam away that is nearer to it than γ = 90° − `incidence_limit_deg`. A vehicle that approaches a wall at a
//! slant of α < γ never hears it by a beam straight ahead, however near it comes; it does by one that looks γ or more to the
//! wall's side. Beams that all look less aside stay silent along such a wall, and what they pass over is taken for free.
//!
//! Let the wall's line be p away from the sensor. A beam that meets it at the angle β does so at p / sin β, so whoever is
//! turned away (β < γ) meets it beyond p / sin γ = p / cos `incidence_limit_deg`: up to there silence is true, whatever the
//! beam and the slant. A vehicle that drives over known free ground only keeps its radius and its padding as p, so it
//! never frees a part of the wall up to (`radius_m` + `padding_m`) / cos `incidence_limit_deg`, and keeps its distance
//! for good. A longer bound would free what is met just below γ.
//!
//! A wall's line counts, not where the wall ends: one that points at the vehicle is heard by what it ends in.
//!
//! Beams to both sides hear such a wall only where they look: in a round of all beams the vehicle drives on, and between two
//! looks to one side the wall stays free. With g = speed × round − 2 p tan(half the cone) this gap lets the vehicle through
//! when g > 2 `radius_m`. Silence beyond the usual 3 m, which frees long walls from afar, is believed of quicker rounds only.

use super::range::{
    INCIDENCE_LIMIT_DEG, Lobe, RangeSensor, SURE_RANGE, SURE_RANGE_M, SensorCoverage,
};
use super::sim::floored;
use super::source::Source;
use super::vehicle::BodySpec;
use crate::geom::without_dust;

/// Farther aside than abeam nothing is heard before it is touched, degrees.
const ABEAM_DEG: f64 = 90.0;
/// More than the dust of a quotient, metres.
const DUST_M: f64 = 1e-9;

/// What of walls a sensor hears.
struct Hearing {
    /// Angle between beam and normal beyond which they do not answer, degrees.
    incidence_limit_deg: f64,
    /// So far to both sides of a beam's axis it listens, degrees.
    half_angle_deg: f64,
}

impl RangeSensor {
    /// As [`SensorCoverage::bound_silence`], of a sensor of which all is known.
    pub(super) fn bound_silence(&mut self, source: &Source<'_>, body: &BodySpec, padding_m: f64) {
        let hearing = Hearing {
            incidence_limit_deg: self.incidence_limit_deg,
            half_angle_deg: match self.lobe {
                Lobe::Beam => 0.0,
                Lobe::Fan | Lobe::Cone => self.look.half_angle_deg,
            },
        };
        self.look.bound(source, (body, padding_m), &hearing);
    }
}

impl SensorCoverage {
    /// Refuses a sure range, or shortens the one that was left out, up to which beams that see nothing beside the vehicle
    /// would take a wall for free; refuses one of beams that look there too seldom.
    pub(super) fn bound_silence(&mut self, source: &Source<'_>, body: &BodySpec, padding_m: f64) {
        let hearing = Hearing {
            incidence_limit_deg: INCIDENCE_LIMIT_DEG,
            half_angle_deg: self.half_angle_deg,
        };
        self.bound(source, (body, padding_m), &hearing);
    }

    fn bound(
        &mut self,
        source: &Source<'_>,
        (body, padding_m): (&BodySpec, f64),
        hearing: &Hearing,
    ) {
        let reach_m = body.radius_m + padding_m;
        let aside_deg = [1.0, -1.0]
            .map(|side| self.aside_deg(side, hearing.half_angle_deg))
            .into_iter()
            .fold(ABEAM_DEG, f64::min);
        let answers_deg = ABEAM_DEG - hearing.incidence_limit_deg;
        if aside_deg >= answers_deg {
            self.bound_gaps(source, (body, reach_m), hearing);
            return;
        }
        let sine = libm::sin(answers_deg.to_radians());
        let most_m = floored(reach_m / sine + DUST_M);
        if !source.is_known(SURE_RANGE) {
            self.sure_range_m = self.sure_range_m.min(most_m);
        } else if self.sure_range_m > most_m {
            let wrong = format!(
                "is too far for beams that look no farther than {}° to one side: a wall along the way answers from {}° on, \
                 and would be taken for free",
                without_dust(aside_deg),
                without_dust(answers_deg),
            );
            let allowed = format!("at most {most_m} m is allowed, or beams to both sides");
            source.refuse(SURE_RANGE, &wrong, &allowed);
        }
    }

    /// Refuses a sure range beyond the usual one of a sensor that looks to each side so seldom that the vehicle fits between.
    fn bound_gaps(
        &self,
        source: &Source<'_>,
        (body, reach_m): (&BodySpec, f64),
        hearing: &Hearing,
    ) {
        let round_s = self.cycle().as_secs_f64();
        let seen_m = 2.0 * reach_m * libm::tan(hearing.half_angle_deg.to_radians());
        let gap_m = body.max_speed_mps * round_s - seen_m;
        if self.sure_range_m <= SURE_RANGE_M || gap_m <= 2.0 * body.radius_m {
            return;
        }
        let wrong = format!(
            "is too far for beams whose round takes {round_s:.2} s: between two looks to one side the vehicle drives past {gap_m:.2} m \
             of a wall, and passes through {:.2} m",
            2.0 * body.radius_m
        );
        let allowed = format!(
            "at most {SURE_RANGE_M} m is allowed, or fewer beams, a shorter scan_period_s or a lower speed"
        );
        source.refuse(SURE_RANGE, &wrong, &allowed);
    }

    /// Returns the angle up to which the beams look to one side (1: left, -1: right), at most abeam, degrees.
    fn aside_deg(&self, side: f64, half_angle_deg: f64) -> f64 {
        let axes_deg = self.beams_deg.iter().map(|beam_deg| side * beam_deg);
        axes_deg
            .filter(|axis_deg| axis_deg - half_angle_deg <= ABEAM_DEG)
            .map(|axis_deg| (axis_deg + half_angle_deg).min(ABEAM_DEG))
            .fold(0.0, f64::max)
    }
}
