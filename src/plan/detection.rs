//! How far away an ultrasonic range sensor hears a post, and what follows for a vehicle: how thick a post must be that it
//! surely does not touch. Pure formulas; where beams look and what a reading means is not known here.
//!
//! A rigid post of radius ρ mirrors sound as a convex mirror of focal length ρ/2: at a distance r (to its surface) it
//! returns ρ/(r + ρ) of what a wall there returns, and a wall's echo falls with 1/r² (geometric acoustics, for ρ well over
//! 1.4 mm at 40 kHz). So it is heard while
//!
//! ```text
//!   r² (r + ρ) ≤ k ρ          k = r₀² (r₀ + ρ₀) / ρ₀ from one measured pair (ρ₀ heard up to r₀)
//! ```

use super::speed::stopping_distance_m;

/// Time from an echo to brakes that bite, seconds: what the vehicle's reflex counts on.
pub const REACTION_S: f64 = 0.15;
/// What rounding may take from a distance, as a share.
const HAIR: f64 = 1e-12;

/// How far away a sensor hears posts.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PostDetection {
    /// k, m².
    gain_m2: f64,
    /// Nothing is heard from farther away, metres.
    farthest_m: f64,
}

impl PostDetection {
    /// Takes one measured pair, the radius of a post and the farthest distance at which it was heard (both positive,
    /// metres), and the distance beyond which nothing is heard.
    pub fn measured(radius_m: f64, range_m: f64, farthest_m: f64) -> PostDetection {
        PostDetection {
            gain_m2: range_m * range_m * (range_m + radius_m) / radius_m,
            farthest_m,
        }
    }

    /// Returns whether a post is heard whose surface is this far away, metres.
    pub fn hears(&self, radius_m: f64, distance_m: f64) -> bool {
        let weakness_m3 = distance_m * distance_m * (distance_m + radius_m);
        distance_m <= self.farthest_m && weakness_m3 <= self.gain_m2 * radius_m * (1.0 + HAIR)
    }

    /// Returns how far away a post is heard, metres.
    pub fn range_m(&self, radius_m: f64) -> f64 {
        let strength_m3 = self.gain_m2 * radius_m;
        // The left side of the law grows ever faster, so that Newton's steps come down to its root from above.
        let mut range_m = libm::cbrt(strength_m3);
        for _ in 0..60 {
            let excess_m3 = range_m * range_m * (range_m + radius_m) - strength_m3;
            let step_m = excess_m3 / (range_m * (3.0 * range_m + 2.0 * radius_m));
            if step_m.is_nan() || step_m <= HAIR * range_m {
                break;
            }
            range_m -= step_m;
        }
        range_m.min(self.farthest_m)
    }

    /// Returns the radius of the thinnest post that is heard from so far away, metres; `None` when none is, not even a wall.
    pub fn thinnest_m(&self, distance_m: f64) -> Option<f64> {
        let rest_m2 = self.gain_m2 - distance_m * distance_m;
        let is_heard = distance_m <= self.farthest_m && rest_m2 > 0.0;
        is_heard.then(|| distance_m * distance_m * distance_m / rest_m2)
    }
}

/// A post, and how far away it is heard.
#[derive(Clone, Copy, PartialEq, Debug, serde::Serialize, serde::Deserialize)]
pub struct SmallestPost {
    /// Its radius, metres.
    pub radius_m: f64,
    /// From here on it is heard, along any beam that it stands in, metres from the sensor to its surface.
    pub heard_m: f64,
}

/// What decides which posts a vehicle does not touch: how far away they are heard, and what it needs until it stands.
///
/// A post may come into reach just after a beam has looked its way. So a vehicle at speed v drives on for t, a round of all
/// beams, a reading and the reaction, brakes at b, and its body, twice the deviation of its place and half a cell's diagonal
/// still have to fit:
///
/// ```text
///   v t + v²/2b + clear ≤ heard(ρ)          clear = radius + 2 σ + half a cell's diagonal
///   v t + seen          ≤ heard(ρ)          seen: nearer than this a post before the body may lie beside all beams, or
///                                           in the sensor's blind zone
/// ```
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ContactLimits {
    /// How far away posts are heard.
    pub detection: PostDetection,
    /// What must lie between the vehicle's middle, where its sensor is, and a post when it stands, metres.
    pub clear_m: f64,
    /// From here on the beams together look along the whole width that the vehicle drives through, metres; infinite when
    /// they leave a gap ahead.
    pub seen_from_m: f64,
    /// Time from a post's coming into reach to brakes that bite, at most, seconds.
    pub delay_s: f64,
    /// Braking, m/s², positive.
    pub braking_mps2: f64,
}

impl ContactLimits {
    /// Returns from how far away a post must be heard that a vehicle of this speed does not touch, metres.
    pub fn needed_m(&self, speed_mps: f64) -> f64 {
        let stopped_m =
            stopping_distance_m(speed_mps, self.delay_s, self.braking_mps2) + self.clear_m;
        stopped_m.max(speed_mps * self.delay_s + self.seen_from_m)
    }

    /// Returns the thinnest post that a vehicle of this speed does not touch; `None` when the sensor does not promise it of
    /// any.
    pub fn smallest(&self, speed_mps: f64) -> Option<SmallestPost> {
        let heard_m = self.needed_m(speed_mps);
        let radius_m = self.detection.thinnest_m(heard_m)?;
        Some(SmallestPost { radius_m, heard_m })
    }

    /// Returns a post with how far away it is heard.
    pub fn post(&self, radius_m: f64) -> SmallestPost {
        SmallestPost {
            radius_m,
            heard_m: self.detection.range_m(radius_m),
        }
    }

    /// Returns whether a vehicle of this speed does not touch posts of a radius, or thicker ones.
    pub fn covers(&self, radius_m: f64, speed_mps: f64) -> bool {
        self.detection.hears(radius_m, self.needed_m(speed_mps))
    }

    /// Returns the highest speed at which a vehicle does not touch posts of a radius, m/s; `None` when it does at any.
    pub fn highest_speed_mps(&self, radius_m: f64) -> Option<f64> {
        let range_m = self.detection.range_m(radius_m);
        let (room_m, seen_m) = (range_m - self.clear_m, range_m - self.seen_from_m);
        if room_m <= 0.0 || seen_m <= 0.0 {
            return None;
        }
        let (delay_s, braking_mps2) = (self.delay_s, self.braking_mps2);
        let stops_mps =
            braking_mps2 * ((delay_s * delay_s + 2.0 * room_m / braking_mps2).sqrt() - delay_s);
        Some(stops_mps.min(seen_m / delay_s))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A post of 1 cm heard up to 0.7 m.
    fn detection() -> PostDetection {
        PostDetection::measured(0.01, 0.7, 4.0)
    }

    fn limits() -> ContactLimits {
        ContactLimits {
            detection: detection(),
            clear_m: 0.49,
            seen_from_m: 0.4,
            delay_s: 0.7,
            braking_mps2: 1.0,
        }
    }

    #[test]
    fn the_measured_post_is_heard_as_far_as_it_was_measured_and_thicker_ones_farther() {
        for (radius_m, range_m) in [(0.01, 0.7), (0.02, 0.879), (0.05, 1.187), (0.1, 1.483)] {
            let found_m = detection().range_m(radius_m);
            assert!((found_m - range_m).abs() < 1e-3, "{radius_m} m: {found_m}");
        }
        assert_eq!(detection().range_m(50.0), 4.0);
        assert_eq!(detection().range_m(0.0), 0.0);
    }

    #[test]
    fn what_a_wall_does_not_return_nothing_returns() {
        let deaf = PostDetection::measured(1.0, 1.0, 9.0);
        assert!(deaf.thinnest_m(1.4).is_some());
        assert_eq!(deaf.thinnest_m(1.42), None);
        assert_eq!(detection().thinnest_m(4.01), None);
    }

    #[test]
    fn without_room_to_see_no_speed_will_do() {
        assert_eq!(limits().highest_speed_mps(0.001), None);
        let blind = ContactLimits {
            seen_from_m: f64::INFINITY,
            ..limits()
        };
        assert_eq!(blind.highest_speed_mps(1.0), None);
        assert_eq!(blind.smallest(0.1), None);
        assert!(!blind.covers(1.0, 0.1));
    }

    proptest! {
        #[test]
        fn range_and_thinnest_post_are_inverse(radius_m in 0.001..0.5f64) {
            let range_m = detection().range_m(radius_m);
            prop_assert!((detection().thinnest_m(range_m).unwrap() - radius_m).abs() < 1e-9);
            prop_assert!(detection().hears(radius_m, range_m * (1.0 - 1e-9)));
            prop_assert!(!detection().hears(radius_m, range_m * (1.0 + 1e-9)));
        }

        #[test]
        fn the_highest_speed_is_the_highest_that_covers(
            radius_m in 0.01..0.4f64, seen_from_m in 0.0..1.0f64, delay_s in 0.1..2.0f64,
        ) {
            let limits = ContactLimits { seen_from_m, delay_s, ..limits() };
            if let Some(highest_mps) = limits.highest_speed_mps(radius_m) {
                prop_assert!(limits.covers(radius_m, highest_mps * (1.0 - 1e-6)));
                prop_assert!(!limits.covers(radius_m, highest_mps * (1.0 + 1e-6)));
                let smallest = limits.smallest(highest_mps).unwrap();
                prop_assert!((smallest.radius_m - radius_m).abs() < 1e-6);
                prop_assert!((smallest.heard_m - limits.post(radius_m).heard_m).abs() < 1e-6);
            } else {
                prop_assert!(!limits.covers(radius_m, 0.001));
            }
        }
    }
}
