//! How strong a link is of which some packets were not heard (a censored, or Tobit, mean).
//!
//! A packet is heard when it is stronger than the receiver's floor f, and sometimes not even then, since packets collide. So a
//! miss says "at most f" but for the share ε of collisions; n packets of mean m were heard, k were missed, one packet varies by
//! s about the link's mean μ:
//!
//! ```text
//!   L(μ) = − n (m − μ)² / 2 s² + k ln(ε + (1 − ε) Φ(t))          t = (f − μ) / s
//!   μ ← (n m + k r (μ − s h)) / (n + k r)                        h = φ(t) / Φ(t),   r = (1 − ε) Φ / (ε + (1 − ε) Φ)
//! ```
//!
//! (Tobin 1958; the steps are those of expectation and maximisation, Amemiya 1984.) A miss tells as much as r h (h + t)
//! packets that were heard. Of a link that was never heard only a bound is known: the μ at which to miss all k packets has
//! probability ½.

/// ε: the share of packets that is missed for other reasons than strength.
const COLLISIONS: f64 = 0.1;
/// Steps towards the most probable mean.
const STEPS: usize = 30;
/// Halvings of the interval in which the bound of a silent link lies, and its farther end, deviations.
const HALVINGS: usize = 40;
const FARTHEST: f64 = 6.0;
/// A link that was never heard needs so many misses to say anything.
pub(super) const FEWEST_MISSES: u32 = 3;

/// What packets and misses say together.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct CensoredMean {
    /// The mean strength; of a link that was never heard the bound below which it lies, dBm.
    pub mean_dbm: f64,
    /// So many packets that were all heard would say as much.
    pub packets: f64,
}

/// Returns the mean of a link of which `packets` were heard, with this mean, and `misses` were not, by a receiver with this
/// floor; `packet_sd_db` = how much one packet varies. `None` when none was heard and fewer than three were missed.
pub(super) fn censored_mean(
    (packets, mean_dbm): (u32, f64),
    misses: u32,
    floor_dbm: f64,
    packet_sd_db: f64,
) -> Option<CensoredMean> {
    let (heard, missed) = (f64::from(packets), f64::from(misses));
    if packets == 0 {
        return (misses >= FEWEST_MISSES).then(|| CensoredMean {
            mean_dbm: floor_dbm - packet_sd_db * deviations_of_silence(missed),
            packets: missed,
        });
    }
    let mut known = CensoredMean {
        mean_dbm,
        packets: heard,
    };
    if misses == 0 {
        return Some(known);
    }
    for _ in 0..STEPS {
        let below = (floor_dbm - known.mean_dbm) / packet_sd_db;
        let is_below = share_below(below);
        let censored =
            missed * (1.0 - COLLISIONS) * is_below / (COLLISIONS + (1.0 - COLLISIONS) * is_below);
        let hazard = hazard_below(below);
        let censored_dbm = known.mean_dbm - packet_sd_db * hazard;
        known = CensoredMean {
            mean_dbm: (heard * mean_dbm + censored * censored_dbm) / (heard + censored),
            packets: heard + censored * (hazard * (hazard + below)).clamp(0.0, 1.0),
        };
    }
    Some(known)
}

/// Returns how far below the floor a link lies of which so many packets in a row are missed with probability ½, deviations of
/// one packet.
fn deviations_of_silence(missed: f64) -> f64 {
    let share = libm::pow(0.5, 1.0 / missed);
    let (mut low, mut high) = (0.0, FARTHEST);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if share_below(middle) < share {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Φ.
fn share_below(deviations: f64) -> f64 {
    0.5 * libm::erfc(-deviations / std::f64::consts::SQRT_2)
}

/// φ / Φ; far below, where both vanish, their ratio is that of a straight line.
fn hazard_below(deviations: f64) -> f64 {
    const FAR: f64 = -30.0;
    if deviations < FAR {
        return -deviations;
    }
    let density = libm::exp(-0.5 * deviations * deviations) / std::f64::consts::TAU.sqrt();
    density / share_below(deviations)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tomo::tests_support::Noise;

    const FLOOR_DBM: f64 = -95.0;
    const SD_DB: f64 = 4.0;

    /// What is known of links of a mean from so many packets each: how far off that is on the mean, and how much it varies.
    fn off_db(mean_dbm: f64, collisions: f64) -> (f64, f64) {
        let mut noise = Noise::new(3);
        let offs: Vec<f64> = (0..400)
            .filter_map(|_| {
                let (mut packets, mut misses, mut sum_dbm) = (0, 0, 0.0);
                for _ in 0..17 {
                    let strength_dbm = mean_dbm + SD_DB * noise.normal();
                    if strength_dbm > FLOOR_DBM && noise.uniform() > collisions {
                        packets += 1;
                        sum_dbm += strength_dbm;
                    } else {
                        misses += 1;
                    }
                }
                let heard = (packets, sum_dbm / f64::from(packets));
                censored_mean(heard, misses, FLOOR_DBM, SD_DB).filter(|_| packets > 0)
            })
            .map(|known| known.mean_dbm - mean_dbm)
            .collect();
        let count = offs.len() as f64;
        let mean = offs.iter().sum::<f64>() / count;
        let square = offs.iter().map(|off| off * off).sum::<f64>() / count;
        (mean, square.sqrt())
    }

    #[test]
    fn the_mean_of_what_was_heard_and_missed_is_right_down_to_below_the_floor() {
        for (mean_dbm, collisions) in [
            (-80.0, 0.0),
            (-80.0, 0.3),
            (-91.0, 0.1),
            (-95.0, 0.1),
            (-97.0, 0.1),
        ] {
            let (mean_db, rms_db) = off_db(mean_dbm, collisions);
            assert!(
                mean_db.abs() < 0.5 && rms_db < 1.7,
                "{mean_dbm} {collisions}: {mean_db} ± {rms_db}"
            );
        }
    }

    #[test]
    fn misses_far_above_the_floor_are_collisions_and_say_nothing() {
        let known = censored_mean((4, -60.0), 9, FLOOR_DBM, SD_DB).unwrap();
        assert!((known.mean_dbm + 60.0).abs() < 1e-6 && (known.packets - 4.0).abs() < 1e-6);
        assert_eq!(
            censored_mean((4, -60.0), 0, FLOOR_DBM, SD_DB).unwrap(),
            CensoredMean {
                mean_dbm: -60.0,
                packets: 4.0
            }
        );
        // So far above that nothing can be told of it is far enough.
        let far = censored_mean((1, 500.0), u32::MAX, FLOOR_DBM, 1e-3).unwrap();
        assert_eq!(far.mean_dbm, 500.0);
    }

    #[test]
    fn the_more_were_missed_the_weaker_it_is_and_misses_tell_less_than_packets() {
        let of = |misses| censored_mean((5, -93.0), misses, FLOOR_DBM, SD_DB).unwrap();
        let means: Vec<f64> = [0, 1, 5, 20, 1000]
            .map(|misses| of(misses).mean_dbm)
            .to_vec();
        assert!(means.is_sorted_by(|a, b| a > b), "{means:?}");
        assert!((5.0..9.0).contains(&of(5).packets), "{:?}", of(5));
        let below = censored_mean((1, -120.0), 1, FLOOR_DBM, 0.1).unwrap();
        assert!(
            below.mean_dbm <= -119.9 && below.mean_dbm.is_finite(),
            "{below:?}"
        );
    }

    #[test]
    fn of_a_link_that_was_never_heard_the_bound_is_known() {
        let of = |misses| censored_mean((0, f64::NAN), misses, FLOOR_DBM, SD_DB);
        assert_eq!(of(2), None);
        let (few, many) = (of(3).unwrap(), of(40).unwrap());
        // 0.79³ = ½, and Φ(0.82) = 0.79.
        assert!(
            (few.mean_dbm - (FLOOR_DBM - 0.82 * SD_DB)).abs() < 0.03,
            "{few:?}"
        );
        assert!(many.mean_dbm < few.mean_dbm && many.packets == 40.0);
        assert!(of(u32::MAX).unwrap().mean_dbm > FLOOR_DBM - 6.0 * SD_DB - 1e-9);
    }
}
