//! From signal strengths to attenuations: by an empty sweep where there is one, by a fitted path loss otherwise.
//!
//! What a link had in the empty sweep is kriged from its neighbours there ([`super::kriging`]) where ends were driven, as
//! no two sweeps drive the same places; fixed ends are the same again, and there a link has its partner. Where an image of
//! the empty sweep is known, what it explains is taken out of the neighbours and put back for the link (regression kriging,
//! Odeh et al. 1995): behind a wall the loss depends much on where the ends are, and a mean of neighbours would be of
//! another place.
//!
//! Every link that is not used is counted with its reason. Nothing is imaged here.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::geom::{Point, Rect};

use super::bins::BinKey;
use super::censored::CensoredMean;
use super::displaced_ends::add_displacement;
use super::kriging::{Level, LevelField};
use super::link::floor_dbm;
use super::link_noise::{
    below_bound_db2, excess_spread, packet_variance, single_variance, strength_of,
};
use super::path_loss::{ExponentPrior, LawBasis, PathLoss, spread_db};
use super::ring::side_tolerance_m;
use super::settings::{ImagingSettings, NoiseModel};
use super::weights::{WeightModel, WeightRows};
use super::{Image, Link};

/// Of fewer links than this nobody could tell a field.
const FEWEST_DRIVEN: usize = 30;
/// Two places that differ by less are the same one, metres (or the units of the input).
const SAME_PLACE_M: f64 = 1e-3;
/// What an image explains is computed of so few links at a time that their weights are fewer than this, 50 MB.
const MOST_WEIGHTS: usize = 1 << 22;

/// Why a link is not in the image.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum DropReason {
    /// Shorter than the shortest link that is imaged.
    TooShort,
    /// Runs along one side of the ring, where nothing stands.
    SameSide,
    /// Never heard, and not missed often enough to say why.
    NeverHeard,
    /// The empty sweep has no link near it.
    NoEmptyPartner,
    /// There are too few links to know how strong it would be in free space.
    NoPathLoss,
    /// Does not pass through the area.
    OutsideArea,
    /// Not heard, nor was it in the empty sweep: silence says nothing of a change.
    SilentBefore,
}

impl DropReason {
    /// Returns the reason in words.
    pub fn words(self) -> &'static str {
        match self {
            DropReason::TooShort => "too short",
            DropReason::SameSide => "along one side",
            DropReason::NeverHeard => "never heard",
            DropReason::NoEmptyPartner => "no partner in the empty sweep",
            DropReason::NoPathLoss => "too few links to know the path loss",
            DropReason::OutsideArea => "outside the area",
            DropReason::SilentBefore => "silent in the empty sweep, too",
        }
    }
}

/// How many links were dropped, by reason.
pub type DroppedLinks = BTreeMap<DropReason, usize>;

/// One calibrated link.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Observation {
    /// The first end, metres.
    pub from: Point,
    /// The second end, metres.
    pub to: Point,
    /// Attenuation by what stands in between, dB; positive = attenuation.
    pub attenuation_db: f64,
    /// Its variance, dB².
    pub variance_db2: f64,
    /// Packets heard, both directions together.
    pub packets: u32,
    /// Packets that were expected and not heard.
    pub misses: u32,
    /// Whether the receiver's floor hides how much more it may be.
    pub is_at_floor: bool,
}

/// Returns what is left of a link when something is explained, dB: at the receiver's floor, which hides how much more there is,
/// no less than nothing.
pub(super) fn unexplained_db(rest_db: f64, is_at_floor: bool) -> f64 {
    if is_at_floor {
        rest_db.max(0.0)
    } else {
        rest_db
    }
}

/// The calibrated links of a sweep.
#[derive(Clone, PartialEq, Debug)]
pub struct Calibrated {
    /// In the order of the links given.
    pub observations: Vec<Observation>,
    /// What was left out.
    pub dropped: DroppedLinks,
    /// The law that was fitted: on the sweep itself, or on the empty one where there is one.
    pub path_loss: Option<PathLoss>,
    /// Whether the attenuations rest on an empty sweep.
    pub by_empty_sweep: bool,
    /// Whether the ends of that were driven.
    pub is_driven: bool,
}

/// Calibrates the links `now` by an empty sweep, or without one by the path loss of the sweep itself.
pub fn calibrate(now: &[Link], empty: Option<&[Link]>, settings: &ImagingSettings) -> Calibrated {
    calibrate_around(now, empty, None, settings)
}

/// Calibrates as [`calibrate`] does; `structure` = the image of the empty sweep, if there is one.
pub(super) fn calibrate_around(
    now: &[Link],
    empty: Option<&[Link]>,
    structure: Option<&Image>,
    settings: &ImagingSettings,
) -> Calibrated {
    let all = || now.iter().chain(empty.unwrap_or_default());
    let sensitivity_dbm = floor_dbm(all(), settings.noise.sensitivity_dbm);
    let noise = NoiseModel {
        sensitivity_dbm,
        ..settings.noise
    };
    let tolerance_m = side_tolerance_m(all(), settings.ring, settings.side_tolerance_m);
    let settings = &ImagingSettings {
        noise,
        side_tolerance_m: tolerance_m,
        ..*settings
    };
    let path_loss = fit_path_loss(empty.unwrap_or(now), settings);
    let sweep = empty.map(|links| {
        let is_driven = are_driven(links, now);
        EmptySweep::of((links, is_driven), structure, settings, path_loss)
    });
    let is_driven = matches!(sweep, Some(EmptySweep::Driven { .. }));
    // Of fixed places nothing is asked.
    let explained =
        |links: &[Link]| explained_db(structure.filter(|_| is_driven), links, settings.weights);
    let now_explained = explained(now);
    let mut calibrated = Calibrated {
        observations: Vec::new(),
        dropped: DroppedLinks::new(),
        path_loss,
        by_empty_sweep: sweep.is_some(),
        is_driven,
    };
    let mut used = Vec::new();
    for (link, explained_db) in now.iter().zip(now_explained) {
        match observe((link, explained_db), sweep.as_ref(), path_loss, settings) {
            Ok(observation) => {
                calibrated.observations.push(observation);
                used.push(*link);
            }
            Err(reason) => *calibrated.dropped.entry(reason).or_default() += 1,
        }
    }
    if let Some(EmptySweep::Driven { field, .. }) = &sweep {
        // The exponent cancels, as the length is nearly the same.
        let level_dbm = |links: &[Link]| -> Vec<Option<f64>> {
            let levels = links.iter().zip(explained(links));
            levels
                .map(|(link, explained_db)| Some(field.level_of(link)?.0 - explained_db))
                .collect()
        };
        let observations = &mut calibrated.observations;
        add_displacement(observations, &used, settings.pairing_m, level_dbm);
    }
    calibrated
}

/// Returns what an image explains of the attenuation of links, dB; 0 without one.
fn explained_db(image: Option<&Image>, links: &[Link], weights: WeightModel) -> Vec<f64> {
    let mut explained_db = vec![0.0; links.len()];
    let Some(image) = image else {
        return explained_db;
    };
    let at_once = (MOST_WEIGHTS / image.values.len().max(1)).clamp(1, 256);
    for (links, explained_db) in links.chunks(at_once).zip(explained_db.chunks_mut(at_once)) {
        WeightRows::rescaled(links.iter().map(Link::segment), &image.grid, weights)
            .forward(&image.values, explained_db);
    }
    explained_db
}

/// `explained_db`: what the image of the empty sweep explains of the link.
fn observe(
    (link, explained_db): (&Link, f64),
    sweep: Option<&EmptySweep>,
    path_loss: Option<PathLoss>,
    settings: &ImagingSettings,
) -> Result<Observation, DropReason> {
    let length_m = link.length_m();
    if length_m < settings.shortest_link_m || length_m <= 0.0 {
        return Err(DropReason::TooShort);
    }
    if runs_along_a_side(link, settings.ring, settings.side_tolerance_m) {
        return Err(DropReason::SameSide);
    }
    let strength = strength_of(link, &settings.noise).ok_or(DropReason::NeverHeard)?;
    let (attenuation_db, variance_db2) = match sweep {
        Some(EmptySweep::Driven { field, exponent }) => {
            let now = level_of(link, strength, *exponent, &settings.noise);
            let (level_dbm, variance_db2) =
                field.level_of(link).ok_or(DropReason::NoEmptyPartner)?;
            if link.is_silent() && field.is_silent_around(link) {
                return Err(DropReason::SilentBefore);
            }
            let empty_dbm = level_dbm - explained_db;
            (empty_dbm - now.level_dbm, now.variance_db2 + variance_db2)
        }
        Some(EmptySweep::Fixed(sweep)) => {
            let partner = sweep.partner(link).ok_or(DropReason::NoEmptyPartner)?;
            if link.is_silent() && partner.link.is_silent() {
                return Err(DropReason::SilentBefore);
            }
            // A partner may be longer or shorter by a bin: what that costs in free space (exponent 2) is no attenuation.
            let longer_db = 2.0 * (spread_db(length_m) - spread_db(partner.link.length_m()));
            let now = (link, strength);
            let variance_db2 = paired_variance(now, partner, &settings.noise, settings.pairing_m);
            let lost_db = partner.strength.mean_dbm - strength.mean_dbm;
            (lost_db - longer_db, variance_db2)
        }
        None => {
            let law = path_loss.ok_or(DropReason::NoPathLoss)?;
            let free_dbm = law.strength_dbm(length_m);
            let lost_db = free_dbm - strength.mean_dbm;
            (lost_db, single_variance(link, strength, &settings.noise))
        }
    };
    let observation = Observation {
        from: link.from,
        to: link.to,
        attenuation_db,
        variance_db2,
        packets: link.packets,
        misses: link.misses,
        is_at_floor: link.is_silent(),
    };
    Ok(observation)
}

/// Returns whether the ends of links were driven: where they were measured in several spots, or, as a file need not say that,
/// where most links of the other sweep have other ends.
fn are_driven(empty: &[Link], now: &[Link]) -> bool {
    if empty.iter().any(|link| link.spots > 1) {
        return true;
    }
    if empty.len() < FEWEST_DRIVEN {
        return false;
    }
    let ends = |link: &Link| {
        let mut ends = [link.from, link.to]
            .map(|at| [at.x_m, at.y_m].map(|part_m| (part_m / SAME_PLACE_M).round() as i64));
        ends.sort_unstable();
        ends
    };
    let measured: BTreeSet<_> = empty.iter().map(ends).collect();
    let again = now
        .iter()
        .filter(|link| measured.contains(&ends(link)))
        .count();
    2 * again < now.len()
}

/// The empty sweep, to be asked what a link had in it.
enum EmptySweep {
    /// Its ends were driven.
    Driven {
        field: LevelField,
        /// Of the path loss: what is taken off a strength for its distance.
        exponent: f64,
    },
    /// Its ends are fixed.
    Fixed(Partners),
}

impl EmptySweep {
    fn of(
        (links, is_driven): (&[Link], bool),
        structure: Option<&Image>,
        settings: &ImagingSettings,
        path_loss: Option<PathLoss>,
    ) -> EmptySweep {
        let exponent = path_loss.map_or(ExponentPrior::NEAR_FREE_SPACE.mean, |law| law.exponent);
        let entries = entries_of(links, settings);
        if !is_driven {
            return EmptySweep::Fixed(Partners::new(entries, settings, exponent));
        }
        let is_long = |entry: &&Entry| entry.link.length_m() >= 0.5 * settings.shortest_link_m;
        let long: Vec<&Entry> = entries.values().filter(is_long).collect();
        let links: Vec<Link> = long.iter().map(|entry| entry.link).collect();
        let explained_db = explained_db(structure, &links, settings.weights);
        let level = |(entry, explained_db): (&Entry, f64)| {
            let level = level_of(&entry.link, entry.strength, exponent, &settings.noise);
            Level {
                level_dbm: level.level_dbm + explained_db,
                variance_db2: level.variance_db2 + below_bound_db2(&entry.link),
                ..level
            }
        };
        let levels = long.into_iter().zip(explained_db).map(level);
        EmptySweep::Driven {
            field: LevelField::new(levels.collect(), settings.pairing_m),
            exponent,
        }
    }
}

/// Returns the strength of a link but for its distance, and its variance.
fn level_of(link: &Link, strength: CensoredMean, exponent: f64, noise: &NoiseModel) -> Level {
    let excess_db2 = noise.spread_share * noise.spread_share * excess_spread(link, noise);
    Level {
        link: *link,
        level_dbm: strength.mean_dbm + exponent * spread_db(link.length_m()),
        variance_db2: single_variance(link, strength, noise) + excess_db2,
    }
}

/// 2 s_F²/spots + s_t²/n_now + s_t²/n_empty + s_match², s_match from the local spread of the empty sweep.
///
/// Where both sweeps stood at the very same places the fades cancel down to a small rest.
fn paired_variance(
    (link, strength): (&Link, CensoredMean),
    partner: &Entry,
    noise: &NoiseModel,
    pairing_m: f64,
) -> f64 {
    let square = |sd_db: f64| sd_db * sd_db;
    let now_share = 1.0 / f64::from(link.spots.max(1));
    let empty_share = 1.0 / f64::from(partner.link.spots.max(1));
    let is_same_place = link.spots <= 1
        && partner.link.spots <= 1
        && ends_apart_m(link, &partner.link) < 0.02 * pairing_m;
    let fading_db2 = if is_same_place {
        square(noise.matched_fading_sd_db)
    } else {
        square(noise.fading_sd_db) * (now_share + empty_share)
    };
    let share = if is_same_place {
        0.0
    } else {
        noise.match_share
    };
    fading_db2
        + packet_variance(strength, noise)
        + packet_variance(partner.strength, noise)
        + below_bound_db2(&partner.link)
        + share * share * partner.local_variance_db2
        + square(noise.spread_share)
            * (excess_spread(link, noise) + excess_spread(&partner.link, noise))
        + square(noise.model_sd_db)
}

/// Returns the larger of the distances between the ends of two links, the ends matched as they lie nearer.
fn ends_apart_m(a: &Link, b: &Link) -> f64 {
    let straight = a.from.distance_to(b.from).max(a.to.distance_to(b.to));
    let crossed = a.from.distance_to(b.to).max(a.to.distance_to(b.from));
    straight.min(crossed)
}

/// Returns whether both ends lie on one side of the ring.
pub fn runs_along_a_side(link: &Link, ring: Rect, tolerance_m: f64) -> bool {
    let both = |near: &dyn Fn(Point) -> f64| {
        near(link.from) <= tolerance_m && near(link.to) <= tolerance_m
    };
    both(&|at| (at.x_m - ring.min.x_m).abs())
        || both(&|at| (at.x_m - ring.max.x_m).abs())
        || both(&|at| (at.y_m - ring.min.y_m).abs())
        || both(&|at| (at.y_m - ring.max.y_m).abs())
}

/// Fits the law on the links along the sides when there are enough of them.
///
/// Otherwise on all that are long enough, and then only the level: many of these cross the same wall, so their errors go
/// together and the fit would be sure of nonsense (n = 3.5). The exponent stays at its prior, and what the
/// fit leaves open is found with the image.
fn fit_path_loss(links: &[Link], settings: &ImagingSettings) -> Option<PathLoss> {
    const FEWEST_FREE: usize = 8;
    let is_usable =
        |link: &&Link| link.packets > 0 && link.length_m() >= 0.5 * settings.shortest_link_m;
    let usable: Vec<Link> = links.iter().filter(is_usable).copied().collect();
    let is_free = |link: &&Link| runs_along_a_side(link, settings.ring, settings.side_tolerance_m);
    let free: Vec<Link> = usable.iter().filter(is_free).copied().collect();
    if free.len() >= FEWEST_FREE {
        let law = PathLoss::fit(&free, settings.exponent)?;
        return Some(PathLoss {
            basis: LawBasis::Sides,
            ..law
        });
    }
    let held = ExponentPrior {
        sd: settings.exponent.sd.min(1e-3),
        ..settings.exponent
    };
    let law = PathLoss::fit(&usable, held)?;
    let exponent_sd = settings.exponent.sd.min(1.0);
    Some(PathLoss {
        level_sd_db: law.residual_db,
        exponent_sd,
        ..law
    })
}

/// A link of the empty sweep with what its neighbours say.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Entry {
    link: Link,
    strength: CensoredMean,
    /// How much the standing structure changes to the neighbouring bins, dB².
    local_variance_db2: f64,
}

/// The links of an empty sweep between fixed places, searchable by place.
struct Partners {
    pairing_m: f64,
    entries: BTreeMap<BinKey, Entry>,
}

/// Returns the links of an empty sweep of which something is known, one for each bin.
fn entries_of(links: &[Link], settings: &ImagingSettings) -> BTreeMap<BinKey, Entry> {
    let known = |(key, link): (BinKey, Link)| {
        let entry = Entry {
            link,
            strength: strength_of(&link, &settings.noise)?,
            local_variance_db2: 0.0,
        };
        Some((key, entry))
    };
    pooled(links, settings.pairing_m)
        .into_iter()
        .filter_map(known)
        .collect()
}

impl Partners {
    fn new(
        entries: BTreeMap<BinKey, Entry>,
        settings: &ImagingSettings,
        exponent: f64,
    ) -> Partners {
        let mut sweep = Partners {
            pairing_m: settings.pairing_m,
            entries,
        };
        let spreads: Vec<f64> = sweep
            .entries
            .keys()
            .map(|key| sweep.local_variance(*key, exponent, &settings.noise))
            .collect();
        sweep
            .entries
            .values_mut()
            .zip(spreads)
            .for_each(|(entry, spread)| entry.local_variance_db2 = spread);
        sweep
    }

    /// Returns the mean square step to the neighbouring bins beyond what noise explains, dB².
    fn local_variance(&self, key: BinKey, exponent: f64, noise: &NoiseModel) -> f64 {
        let level = |entry: &Entry| {
            entry.strength.mean_dbm + exponent * spread_db(entry.link.length_m().max(1e-3))
        };
        let here = &self.entries[&key];
        let (mut sum, mut count) = (0.0, 0);
        for key in neighbours(key) {
            if let Some(entry) = self.entries.get(&key) {
                let step_db = level(entry) - level(here);
                // Two neighbours differ by noise, too; only what is beyond it is structure.
                let of = |one: &Entry| single_variance(&one.link, one.strength, noise);
                let expected = of(entry) + of(here);
                sum += step_db * step_db - expected;
                count += 1;
            }
        }
        if count == 0 {
            0.0
        } else {
            (sum / f64::from(count)).max(0.0)
        }
    }

    /// Returns the link of the same bin, else the nearest one within reach.
    fn partner(&self, link: &Link) -> Option<&Entry> {
        let (key, _) = BinKey::of(link.from, link.to, self.pairing_m);
        if let Some(entry) = self.entries.get(&key) {
            return Some(entry);
        }
        neighbours(key)
            .filter_map(|key| self.entries.get(&key))
            .map(|entry| (ends_apart_m(link, &entry.link), entry))
            .filter(|(apart_m, _)| *apart_m <= self.pairing_m)
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, entry)| entry)
    }
}

/// Returns one link per bin; links of one bin are pooled.
fn pooled(links: &[Link], pairing_m: f64) -> BTreeMap<BinKey, Link> {
    let mut bins: BTreeMap<BinKey, Link> = BTreeMap::new();
    for link in links {
        let (key, exchanged) = BinKey::of(link.from, link.to, pairing_m);
        let (from, to) = if exchanged {
            (link.to, link.from)
        } else {
            (link.from, link.to)
        };
        let link = Link { from, to, ..*link };
        bins.entry(key)
            .and_modify(|known| *known = known.pooled(&link))
            .or_insert(link);
    }
    bins
}

/// The keys with one end, or both, in a neighbouring bin.
fn neighbours(key: BinKey) -> impl Iterator<Item = BinKey> {
    const STEPS: [(i32, i32); 5] = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)];
    STEPS
        .into_iter()
        .flat_map(move |low| STEPS.into_iter().map(move |high| (low, high)))
        .skip(1)
        .map(move |(low, high)| key.moved(low, high))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> ImagingSettings {
        ImagingSettings::for_change(Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 20.0)))
    }

    fn link(x0: f64, y0: f64, x1: f64, y1: f64, mean_dbm: f64) -> Link {
        Link::fixed(Point::new(x0, y0), Point::new(x1, y1), 10, mean_dbm)
    }

    #[test]
    fn without_spots_a_sweep_is_driven_when_the_other_one_has_other_ends() {
        let sweep = |shift_m: f64| -> Vec<Link> {
            let one = |n: u32| {
                let y_m = 0.4 * f64::from(n) + shift_m;
                link(0.0, y_m, 20.0, 20.0 - y_m, -60.0)
            };
            (0..40).map(one).collect()
        };
        let is_driven =
            |now: &[Link], empty: &[Link]| calibrate(now, Some(empty), &settings()).is_driven;
        assert!(is_driven(&sweep(0.1), &sweep(0.0)));
        assert!(!is_driven(&sweep(0.0), &sweep(0.0)));
        assert!(
            !is_driven(&sweep(0.1), &sweep(0.0)[..10]),
            "too few to tell"
        );
        let mut turned = sweep(0.0);
        for link in &mut turned {
            std::mem::swap(&mut link.from, &mut link.to);
        }
        assert!(!is_driven(&turned, &sweep(0.0)));
    }

    #[test]
    fn every_link_is_used_or_dropped_with_a_reason() {
        let now = [
            link(0.0, 5.0, 20.0, 9.0, -70.0),
            link(0.0, 1.0, 1.0, 0.0, -50.0),
            link(0.0, 1.0, 0.3, 15.0, -60.0),
            link(5.0, 0.0, 5.0, 20.0, -60.0),
        ];
        let empty = [link(20.1, 9.1, 0.1, 5.1, -64.0)];
        let got = calibrate(&now, Some(&empty), &settings());
        assert_eq!(got.observations.len(), 1);
        assert!((got.observations[0].attenuation_db - 6.0).abs() < 0.1);
        let expected = [
            (DropReason::TooShort, 1),
            (DropReason::SameSide, 1),
            (DropReason::NoEmptyPartner, 1),
        ];
        assert_eq!(got.dropped, DroppedLinks::from(expected));
    }

    #[test]
    fn fades_cancel_only_at_the_very_same_places() {
        let variance = |moved_m: f64, spots: u32| {
            let mut now = link(0.0, 5.0, 20.0, 9.0, -70.0);
            let mut empty = link(0.0, 5.0 + moved_m, 20.0, 9.0, -64.0);
            (now.spots, empty.spots) = (spots, spots);
            calibrate(&[now], Some(&[empty]), &settings()).observations[0].variance_db2
        };
        assert!(variance(0.0, 1) < 4.0 && variance(0.1, 1) > 15.0 && variance(0.1, 8) < 6.0);
    }

    #[test]
    fn links_of_the_empty_sweep_in_one_bin_are_pooled() {
        let now = link(0.1, 5.1, 20.1, 9.1, -70.0);
        let far = Link {
            packets: 30,
            ..link(0.1, 5.1, 20.1, 9.1, -60.0)
        };
        let near = Link {
            packets: 10,
            ..link(20.2, 9.2, 0.2, 5.2, -66.0)
        };
        for empty in [[far, near], [near, far]] {
            let got = calibrate(&[now], Some(&empty), &settings());
            assert!(
                (got.observations[0].attenuation_db - 8.5).abs() < 0.05,
                "{got:?}"
            );
        }
    }

    #[test]
    fn a_silent_link_attenuates_at_least_down_to_the_bound_of_its_strength() {
        let mut now = link(0.0, 5.0, 20.0, 9.0, f64::NAN);
        (now.packets, now.misses) = (0, 12);
        let empty = [link(0.0, 5.0, 20.0, 9.0, -75.0)];
        let got = calibrate(&[now], Some(&empty), &settings());
        // 0.944¹² = ½, and Φ(1.588) = 0.944: 1.588 deviations of a packet below -95 dBm.
        let seen = got.observations[0];
        assert!(
            (seen.attenuation_db - 20.0 - 1.588 * 2.5).abs() < 0.01,
            "{seen:?}"
        );
        assert!(seen.is_at_floor);
    }

    #[test]
    fn what_was_silent_before_says_nothing_of_a_change() {
        let silent = |mut link: Link| {
            (link.packets, link.misses) = (0, 12);
            link
        };
        let fixed = link(0.0, 5.0, 20.0, 9.0, f64::NAN);
        let got = calibrate(&[silent(fixed)], Some(&[silent(fixed)]), &settings());
        assert!(got.observations.is_empty());
        assert_eq!(
            got.dropped,
            DroppedLinks::from([(DropReason::SilentBefore, 1)])
        );
        // Driven: 40 links side by side, those of the upper half silent before; all are silent now.
        let of = |step: u32, is_silent: bool| {
            let y_m = 0.4 * f64::from(step);
            let mut link = link(0.0, y_m, 20.0, 20.0 - y_m, -60.0);
            link.spots = 4;
            if is_silent { silent(link) } else { link }
        };
        let empty: Vec<Link> = (0..40).map(|step| of(step, step >= 20)).collect();
        let now: Vec<Link> = (0..40).map(|step| of(step, true)).collect();
        let got = calibrate(&now, Some(&empty), &settings());
        let before = got.dropped.get(&DropReason::SilentBefore).copied();
        assert!(
            (18..=24).contains(&before.unwrap_or(0)),
            "{:?}",
            got.dropped
        );
        let lost = got.observations.iter().map(|seen| seen.attenuation_db);
        assert!(
            lost.clone().count() >= 16 && lost.clone().all(|db| db > 34.0),
            "{:?}",
            lost.collect::<Vec<_>>()
        );
    }

    #[test]
    fn long_links_that_cross_a_wall_leave_the_exponent_physical() {
        let links: Vec<Link> = (0..60)
            .map(|k| {
                let d_m = 2.0 + 0.3 * f64::from(k);
                let behind_db = if d_m > 10.0 { 12.0 } else { 0.0 };
                link(0.0, 10.0, d_m, 10.0, -40.0 - 20.0 * d_m.log10() - behind_db)
            })
            .collect();
        let law = calibrate(&links, None, &settings()).path_loss.unwrap();
        assert!((1.6..2.4).contains(&law.exponent), "{law:?}");
    }

    #[test]
    fn links_along_the_sides_that_were_never_heard_give_no_law() {
        let silent = (0..12).map(|k| Link {
            packets: 0,
            misses: 9,
            ..link(0.0, 1.0, 0.0, 5.0 + f64::from(k), f64::NAN)
        });
        let heard = (0..40).map(|k| {
            let x_m = 1.0 + 0.4 * f64::from(k);
            let lost_db = if k < 4 { 12.0 } else { 0.0 };
            link(
                x_m,
                0.0,
                x_m,
                20.0,
                -40.0 - 20.0 * 20.0f64.log10() - lost_db,
            )
        });
        let links: Vec<Link> = silent.chain(heard).collect();
        let got = calibrate(&links, None, &settings());
        assert!(got.path_loss.is_some());
        let lost: Vec<f64> = got
            .observations
            .iter()
            .map(|seen| seen.attenuation_db)
            .collect();
        assert!(lost[..4].iter().all(|db| *db > 10.0), "{lost:?}");
        assert!(lost[4..].iter().all(|db| db.abs() < 1.0), "{lost:?}");
    }

    #[test]
    fn without_an_empty_sweep_links_along_the_sides_give_the_law() {
        let free = (0..12).map(|k| {
            let d_m = 4.0 + f64::from(k);
            link(0.0, 1.0, 0.0, 1.0 + d_m, -40.0 - 20.0 * d_m.log10())
        });
        let blocked = (0..40).map(|k| {
            let x_m = 1.0 + 0.4 * f64::from(k);
            link(x_m, 0.0, x_m, 20.0, -40.0 - 20.0 * 20.0f64.log10() - 15.0)
        });
        let links: Vec<Link> = free.chain(blocked).collect();
        let got = calibrate(&links, None, &settings());
        assert_eq!(
            got.dropped,
            DroppedLinks::from([(DropReason::SameSide, 12)])
        );
        assert!(
            got.observations
                .iter()
                .all(|seen| (seen.attenuation_db - 15.0).abs() < 0.2)
        );
    }

    /// Links of a ring of 5 m with a person inside, each end moved by up to `jitter_m`; one vehicle stood outside once.
    fn ring_of_5_m(jitter_m: f64, has_stray: bool) -> Vec<Link> {
        let noise = |k: u32| 2.0 * (f64::from(k) * 0.618_034).fract() - 1.0;
        let place = |k: u32| {
            let along_m = f64::from(k % 80) * 0.25;
            let at_m = along_m % 5.0;
            let (x_m, y_m) = match along_m / 5.0 {
                side if side < 1.0 => (at_m, 0.0),
                side if side < 2.0 => (5.0, at_m),
                side if side < 3.0 => (5.0 - at_m, 5.0),
                _ => (0.0, 5.0 - at_m),
            };
            let (dx_m, dy_m) = (noise(k + 1), noise(13 * k + 5));
            match has_stray && k == 8 {
                true => Point::new(x_m, y_m - 5.0),
                false => Point::new(x_m + jitter_m * dx_m, y_m + jitter_m * dy_m),
            }
        };
        let one = |k: u32| {
            let (from, to) = (place(k % 80), place((k + 7 + 2 * (k / 80)) % 80));
            let is_across = !runs_along_a_side(
                &Link::fixed(from, to, 10, 0.0),
                Rect::new(Point::default(), Point::new(5.0, 5.0)),
                0.3,
            );
            let lost_db = if is_across { 10.0 } else { 0.0 };
            let strength_dbm = -40.0 - 2.0 * spread_db(from.distance_to(to).max(0.1)) - lost_db;
            Link::fixed(from, to, 10, strength_dbm)
        };
        (0..800).map(one).collect()
    }

    #[test]
    fn a_stray_place_and_jitter_leave_the_links_along_the_sides_the_reference() {
        for (jitter_m, has_stray) in [(0.0, false), (0.0, true), (0.2, false), (0.2, true)] {
            let links = ring_of_5_m(jitter_m, has_stray);
            let area = Rect::around(links.iter().flat_map(|link| [link.from, link.to])).unwrap();
            let settings = ImagingSettings {
                ring: super::super::ring_of(links.iter()).unwrap(),
                ..ImagingSettings::for_area(area)
            };
            let got = calibrate(&links, None, &settings);
            let law = got.path_loss.unwrap();
            let case = (jitter_m, has_stray);
            assert_eq!(law.basis, LawBasis::Sides, "{case:?}: {law:?}");
            assert!(law.links >= 40, "{case:?}: {law:?}");
            let lost = got.observations.iter().map(|seen| seen.attenuation_db);
            let mut off: Vec<f64> = lost.map(|db| (db - 10.0).abs()).collect();
            off.sort_by(f64::total_cmp);
            assert!(off[off.len() / 2] < 1.0, "{case:?}: {}", off[off.len() / 2]);
        }
    }

    #[test]
    fn few_links_along_the_sides_help_to_know_the_path_loss_and_without_any_nothing_is_imaged() {
        let along =
            (0..7).map(|step| link(0.0, f64::from(step), 0.0, 12.0 + f64::from(step), -62.0));
        let across = [
            link(0.0, 5.0, 20.0, 9.0, -66.0),
            link(0.0, 6.0, 20.0, 9.0, -86.0),
        ];
        let all: Vec<Link> = along.chain(across).collect();
        let got = calibrate(&all, None, &settings());
        assert!(got.path_loss.is_some());
        assert_eq!(got.observations.len(), 2);
        assert!(got.observations[1].attenuation_db - got.observations[0].attenuation_db > 19.0);
        let got = calibrate(&across, None, &settings());
        assert!(got.path_loss.is_none() && got.observations.is_empty());
        assert_eq!(
            got.dropped,
            DroppedLinks::from([(DropReason::NoPathLoss, 2)])
        );
    }
}
