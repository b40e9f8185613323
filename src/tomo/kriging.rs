//! What a link would have had in the empty sweep: ordinary kriging over the links of that sweep near it.
//!
//! A place is both ends of a link, four coordinates, in space six; every link of the empty sweep is entered in both orders, as it
//! is the same from either end. What is interpolated is the level, the strength without the spreading over its distance:
//! u = mean + 10 n log10 d, and without what an image of the empty sweep explains, if there is one. It varies little where
//! nothing stands near and much behind a wall, so its variance (the sill) is estimated place by place:
//!
//! ```text
//!   raw_j = mean over i near j of [ (u_i − u_j)² − s_i² − s_j² ] / 2 / (1 − exp(−½ (mean distance / ℓ)²))
//!   σ_j²  = max(mean of raw over j and its neighbours, ½ raw_j, 0) + 0.05 dB²
//!   K_ij  = σ² exp(−½ |Δ_ij|² / ℓ²) + δ_ij s_i²      k_i = σ² exp(−½ |Δ_i|² / ℓ²)
//!   a = K⁻¹ k,  b = K⁻¹ 1,  λ = a + b (1 − 1ᵀa) / (1ᵀb)
//!   û = λᵀ u,   v = σ² − kᵀ a + (1 − 1ᵀa)² / (1ᵀb)
//! ```
//!
//! (Cressie 1993, section 3.2.) Where no link of the empty sweep is near, nothing is said.

use std::collections::BTreeMap;

use super::cholesky::{Cholesky, dot};

/// Most neighbours that are looked at.
const MOST: usize = 32;
/// Neighbours lie within this, bins.
const REACH_BINS: f64 = 2.6;
/// Differences to neighbours within this make the sill, bins.
const NEAR_BINS: f64 = 1.6;
/// ℓ: over this distance levels are alike, bins.
const LENGTH_BINS: f64 = 1.5;
/// So many of the nearest links say whether the empty sweep was silent there, and so many of them suffice, a share.
const NEAREST: usize = 8;
const SILENT_SHARE: f64 = 0.2;
/// The level varies by this at least, dB².
const LEAST_SILL_DB2: f64 = 0.05;
/// Neighbours this near to each other say little of the sill: 1 − exp(…) is taken for this at least.
const LEAST_SHARE: f64 = 0.05;

/// What is known of one link of the empty sweep.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Level<const N: usize> {
    /// Its first end, then its other one, metres: N / 2 coordinates each.
    pub ends_m: [f64; N],
    /// Whether it was never heard, see [`super::Link::is_silent`].
    pub is_silent: bool,
    /// u: its strength but for its distance and for what is explained otherwise, dBm.
    pub level_dbm: f64,
    /// s²: the variance of that, dB².
    pub variance_db2: f64,
}

/// The levels of the empty sweep, to be asked for any link.
#[derive(Debug)]
pub(super) struct LevelField<const N: usize> {
    scale_m: f64,
    /// In both orders: the second half has the ends exchanged.
    places: Vec<[f64; N]>,
    levels: Vec<Level<N>>,
    sills_db2: Vec<f64>,
    /// By the square that the first end lies in.
    squares: BTreeMap<(i32, i32), Vec<usize>>,
}

/// A link of the empty sweep near a place: which, and how far away, metres.
#[derive(Clone, Copy)]
struct Neighbour {
    place: usize,
    away_m: f64,
}

impl<const N: usize> LevelField<N> {
    /// Takes the links of an empty sweep, pooled in bins of this size, metres.
    pub(super) fn new(levels: Vec<Level<N>>, bin_m: f64) -> LevelField<N> {
        let exchanged = |mut ends_m: [f64; N]| {
            ends_m.rotate_left(N / 2);
            ends_m
        };
        let straight: Vec<[f64; N]> = levels.iter().map(|level| level.ends_m).collect();
        let crossed = straight.iter().copied().map(exchanged);
        let mut field = LevelField {
            scale_m: bin_m,
            places: straight.iter().copied().chain(crossed).collect(),
            levels,
            sills_db2: Vec::new(),
            squares: BTreeMap::new(),
        };
        for (index, place) in field.places.iter().enumerate() {
            let square = field.square(place);
            field.squares.entry(square).or_default().push(index);
        }
        field.sills_db2 = field.sills();
        field
    }

    /// Returns what the level of a link between these ends was in the empty sweep, and the variance of that (dBm, dB²); `None`
    /// when no link of the empty sweep is near.
    pub(super) fn level_of(&self, ends_m: &[f64; N]) -> Option<(f64, f64)> {
        let near = self.neighbours(ends_m);
        let nearest = near.first()?;
        let sills = near.iter().map(|one| self.sill_db2(one.place));
        let mean_db2 = sills.sum::<f64>() / near.len() as f64;
        let sill_db2 = mean_db2.max(0.5 * self.sill_db2(nearest.place));
        self.kriged(&near, sill_db2)
    }

    /// Returns whether the empty sweep was silent around a link, too: more than one in five of the nearest few there were.
    pub(super) fn is_silent_around(&self, ends_m: &[f64; N]) -> bool {
        let near = self.neighbours(ends_m);
        let nearest = near.iter().take(NEAREST);
        let silent = nearest.filter(|one| self.level(one.place).is_silent);
        silent.count() as f64 > SILENT_SHARE * near.len().min(NEAREST) as f64
    }

    fn kriged(&self, near: &[Neighbour], sill_db2: f64) -> Option<(f64, f64)> {
        let alike = |away_m: f64| {
            let share = away_m / (LENGTH_BINS * self.scale_m);
            sill_db2 * libm::exp(-0.5 * share * share)
        };
        let factor = Cholesky::of(near.len(), |i, j| {
            let (one, other) = (near[i].place, near[j].place);
            let noise_db2 = if i == j {
                self.level(one).variance_db2
            } else {
                0.0
            };
            alike(apart_m(&self.places[one], &self.places[other])) + noise_db2
        })?;
        let toward: Vec<f64> = near.iter().map(|one| alike(one.away_m)).collect();
        let levels: Vec<f64> = near
            .iter()
            .map(|one| self.level(one.place).level_dbm)
            .collect();
        let (mut a, mut b) = (toward.clone(), vec![1.0; near.len()]);
        factor.solve(&mut a);
        factor.solve(&mut b);
        let (sum_a, sum_b): (f64, f64) = (a.iter().sum(), b.iter().sum());
        let rest = (1.0 - sum_a) / sum_b;
        let level_dbm = dot(&a, &levels) + rest * dot(&b, &levels);
        let variance_db2 = sill_db2 - dot(&toward, &a) + (1.0 - sum_a) * rest;
        Some((level_dbm, variance_db2.max(0.0)))
    }

    /// Returns the sill of each link.
    fn sills(&self) -> Vec<f64> {
        let near: Vec<Vec<Neighbour>> = (0..self.levels.len())
            .map(|index| {
                let mut near = self.neighbours(&self.places[index]);
                near.retain(|one| one.away_m > 1e-9);
                near
            })
            .collect();
        let raw: Vec<f64> = near
            .iter()
            .zip(&self.levels)
            .map(|(near, level)| self.raw_sill(level, near))
            .collect();
        let smoothed = |(near, own): (&Vec<Neighbour>, &f64)| {
            let others = near.iter().map(|one| raw[one.place % raw.len()]);
            let mean = (own + others.sum::<f64>()) / (1.0 + near.len() as f64);
            mean.max(0.5 * own).max(0.0) + LEAST_SILL_DB2
        };
        near.iter().zip(&raw).map(smoothed).collect()
    }

    /// Returns what the differences of a link to its neighbours say of the sill, dB²; 0 when none is near enough.
    fn raw_sill(&self, level: &Level<N>, near: &[Neighbour]) -> f64 {
        let (mut squares, mut away_m, mut count) = (0.0, 0.0, 0.0);
        let is_near = |one: &&Neighbour| one.away_m < NEAR_BINS * self.scale_m;
        for one in near.iter().filter(is_near) {
            let other = self.level(one.place);
            let step_db = other.level_dbm - level.level_dbm;
            squares += step_db * step_db - other.variance_db2 - level.variance_db2;
            away_m += one.away_m;
            count += 1.0;
        }
        if count == 0.0 {
            return 0.0;
        }
        let lengths = away_m / count / (LENGTH_BINS * self.scale_m);
        let share = 1.0 - libm::exp(-0.5 * lengths * lengths);
        squares / count / 2.0 / share.max(LEAST_SHARE)
    }

    fn level(&self, place: usize) -> &Level<N> {
        &self.levels[place % self.levels.len()]
    }

    fn sill_db2(&self, place: usize) -> f64 {
        self.sills_db2[place % self.levels.len()]
    }

    /// Returns the links nearest to a place, the nearest first.
    fn neighbours(&self, at: &[f64; N]) -> Vec<Neighbour> {
        let (x, y) = self.square(at);
        let mut near = Vec::new();
        for square in (-1..=1).flat_map(|up| (-1..=1).map(move |right| (right, up))) {
            let square = (x.saturating_add(square.0), y.saturating_add(square.1));
            for place in self.squares.get(&square).into_iter().flatten() {
                let away_m = apart_m(at, &self.places[*place]);
                if away_m <= REACH_BINS * self.scale_m {
                    near.push(Neighbour {
                        place: *place,
                        away_m,
                    });
                }
            }
        }
        // Of equally near ones the first link counts, so that the answer does not depend on the search.
        near.sort_by(|a, b| a.away_m.total_cmp(&b.away_m).then(a.place.cmp(&b.place)));
        near.truncate(MOST);
        near
    }

    fn square(&self, at: &[f64; N]) -> (i32, i32) {
        let index = |metres: f64| libm::floor(metres / (REACH_BINS * self.scale_m)) as i32;
        (index(at[0]), index(at[1]))
    }
}

/// Returns how far two places are apart in all coordinates, metres.
fn apart_m<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let square = |(x, y): (&f64, &f64)| (x - y) * (x - y);
    a.iter().zip(b).map(square).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;
    use crate::tomo::tests_support::Noise;

    /// Links from the west side to the east side, half a metre apart at both ends.
    fn field(level_dbm: impl Fn(f64, f64) -> f64) -> LevelField<4> {
        let of = |k: i32| {
            let (from_m, to_m) = (f64::from(k / 20) * 0.5, f64::from(k % 20) * 0.5);
            Level {
                ends_m: [0.0, from_m, 20.0, to_m],
                is_silent: false,
                level_dbm: level_dbm(from_m, to_m),
                variance_db2: 1.0,
            }
        };
        LevelField::new((0..400).map(of).collect(), 0.5)
    }

    fn ask(field: &LevelField<4>, from_m: f64, to_m: f64) -> Option<(f64, f64)> {
        let straight = field.level_of(&[0.0, from_m, 20.0, to_m]);
        let crossed = field.level_of(&[20.0, to_m, 0.0, from_m]);
        match (straight, crossed) {
            (Some(one), Some(other)) => {
                assert!((one.0 - other.0).abs() < 1e-9 && (one.1 - other.1).abs() < 1e-9);
            }
            (one, other) => assert_eq!(one, other),
        }
        straight
    }

    #[test]
    fn where_nothing_stands_the_noise_of_the_neighbours_is_averaged() {
        let noise = RefCell::new(Noise::new(1));
        let field = field(|_, _| -40.0 + noise.borrow_mut().normal());
        let places =
            (0..100).map(|k| (0.7 + 0.8 * f64::from(k % 10), 0.9 + 0.8 * f64::from(k / 10)));
        let errors: Vec<(f64, f64)> = places
            .map(|(from_m, to_m)| ask(&field, from_m, to_m).unwrap())
            .map(|(level_dbm, variance_db2)| (level_dbm + 40.0, variance_db2))
            .collect();
        let square_db2 = errors
            .iter()
            .map(|(error_db, _)| error_db * error_db)
            .sum::<f64>()
            / 100.0;
        let said_db2 = errors
            .iter()
            .map(|(_, variance_db2)| variance_db2)
            .sum::<f64>()
            / 100.0;
        assert!(square_db2 < 0.2, "{square_db2} of 1");
        assert!(
            (0.4..2.5).contains(&(square_db2 / said_db2)),
            "{square_db2} {said_db2}"
        );
    }

    #[test]
    fn behind_an_edge_the_level_follows_it_and_is_less_sure() {
        let field = field(|from_m, _| if from_m > 5.1 { -55.0 } else { -40.0 });
        let (behind, free) = (
            ask(&field, 6.0, 5.0).unwrap(),
            ask(&field, 1.0, 5.0).unwrap(),
        );
        assert!((behind.0 + 55.0).abs() < 1.0 && (free.0 + 40.0).abs() < 0.1);
        let at_edge = ask(&field, 5.1, 5.0).unwrap();
        assert!((-56.0..-39.0).contains(&at_edge.0));
        assert!(at_edge.1 > 5.0 * free.1, "{at_edge:?} {free:?}");
    }

    #[test]
    fn where_no_link_is_near_nothing_is_said() {
        let field = field(|_, _| -40.0);
        assert_eq!(ask(&field, 12.0, 5.0), None);
        assert_eq!(ask(&LevelField::new(Vec::new(), 0.5), 1.0, 1.0), None);
    }
    #[test]
    fn in_space_a_link_that_rises_is_another_one_than_one_that_falls() {
        let of = |k: i32| {
            let (along_m, is_rising) = (f64::from(k / 2) * 0.25, k % 2 == 0);
            let (from_m, to_m) = if is_rising { (1.0, 4.0) } else { (4.0, 1.0) };
            Level {
                ends_m: [0.0, along_m, from_m, 20.0, along_m, to_m],
                is_silent: false,
                level_dbm: if is_rising { -40.0 } else { -55.0 },
                variance_db2: 1.0,
            }
        };
        let field: LevelField<6> = LevelField::new((0..80).map(of).collect(), 0.5);
        let level = |ends_m| field.level_of(&ends_m).map(|(level_dbm, _)| level_dbm);
        let rising = level([0.0, 5.1, 1.1, 20.0, 5.1, 4.0]).unwrap();
        let from_above = level([20.0, 5.1, 4.0, 0.0, 5.1, 1.1]).unwrap();
        let falling = level([0.0, 5.1, 4.0, 20.0, 5.1, 1.1]).unwrap();
        assert!((rising + 40.0).abs() < 1e-6 && (from_above + 40.0).abs() < 1e-6);
        assert!((falling + 55.0).abs() < 1e-6, "{falling}");
        assert_eq!(level([0.0, 5.1, 7.0, 20.0, 5.1, 7.0]), None);
    }
}
