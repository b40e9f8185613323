//! An empty sweep between fixed places: a link has its partner there, the link of the same two bins, or the nearest one.

use std::collections::BTreeMap;

use super::{Asked, Lost};
use crate::tomo::Link;
use crate::tomo::bins::BinKey;
use crate::tomo::calibrate::DropReason;
use crate::tomo::censored::CensoredMean;
use crate::tomo::link_noise::{
    below_bound_db2, excess_spread, packet_variance, single_variance, strength_of,
};
use crate::tomo::path_loss::spread_db;
use crate::tomo::settings::{ImagingSettings, NoiseModel};

/// A link of the empty sweep with what its neighbours say.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Entry {
    pub link: Link,
    pub strength: CensoredMean,
    /// How much the standing structure changes to the neighbouring bins, dB².
    local_variance_db2: f64,
}

/// The links of an empty sweep between fixed places, searchable by place.
#[derive(Debug)]
pub(super) struct Partners {
    pairing_m: f64,
    entries: BTreeMap<BinKey, Entry>,
}

/// Returns the links of an empty sweep of which something is known, one for each bin.
pub(super) fn entries_of(links: &[Link], settings: &ImagingSettings) -> BTreeMap<BinKey, Entry> {
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
    pub(super) fn new(
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

    /// Returns what a link has lost since.
    ///
    /// # Errors
    /// It has no partner, or both are silent.
    pub(super) fn lost(
        &self,
        Asked { link, strength }: &Asked,
        noise: &NoiseModel,
    ) -> Result<Lost, DropReason> {
        let partner = self.partner(link).ok_or(DropReason::NoEmptyPartner)?;
        if link.is_silent() && partner.link.is_silent() {
            return Err(DropReason::SilentBefore);
        }
        // A partner may be longer or shorter by a bin: what that costs in free space (exponent 2) is no attenuation.
        let longer_db = 2.0 * (spread_db(link.length_m()) - spread_db(partner.link.length_m()));
        let lost_db = partner.strength.mean_dbm - strength.mean_dbm;
        Ok(Lost {
            attenuation_db: lost_db - longer_db,
            variance_db2: paired_variance((link, *strength), partner, noise, self.pairing_m),
            slope_db2_m2: 0.0,
        })
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
