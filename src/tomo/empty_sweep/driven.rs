//! An empty sweep whose ends were driven. Where an image of it is known, what that explains is taken out of the neighbours of a
//! link and put back for the link (regression kriging, Odeh et al. 1995): behind a wall the loss depends much on where the ends
//! are, and a mean of neighbours would be of another place.

use std::collections::BTreeMap;

use super::partners::Entry;
use super::{Asked, Lost};
use crate::tomo::bins::BinKey;
use crate::tomo::calibrate::DropReason;
use crate::tomo::censored::CensoredMean;
use crate::tomo::displaced_ends::slopes;
use crate::tomo::kriging::{Level, LevelField};
use crate::tomo::link_ends::LinkEnds;
use crate::tomo::link_noise::{below_bound_db2, driven_variance};
use crate::tomo::path_loss::spread_db;
use crate::tomo::settings::{ImagingSettings, NoiseModel};
use crate::tomo::weights::{WeightModel, WeightRows};
use crate::tomo::{Image, Link};

/// What an image explains is computed of so few links at a time that their weights are fewer than this, 50 MB.
const MOST_WEIGHTS: usize = 1 << 22;

/// An empty sweep whose ends were driven.
#[derive(Debug)]
pub(super) struct DrivenSweep {
    field: LevelField<4>,
    exponent: f64,
    /// What was said of the links that were asked for last.
    known: BTreeMap<LinkEnds, Option<Answer>>,
}

/// What the empty sweep says of a link by its ends alone.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Answer {
    /// Its level there, as it would have been measured, dBm; see [`Level`].
    level_dbm: f64,
    /// The variance of that, dB².
    variance_db2: f64,
    /// Whether the empty sweep was silent around it.
    is_silent_around: bool,
    /// See [`Lost`].
    slope_db2_m2: f64,
}

impl DrivenSweep {
    pub(super) fn new(
        entries: &BTreeMap<BinKey, Entry>,
        structure: Option<&Image>,
        settings: &ImagingSettings,
        exponent: f64,
    ) -> DrivenSweep {
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
        DrivenSweep {
            field: LevelField::new(levels.collect(), settings.pairing_m),
            exponent,
            known: BTreeMap::new(),
        }
    }

    pub(super) fn ask(
        &mut self,
        asked: &[Asked],
        structure: Option<&Image>,
        settings: &ImagingSettings,
    ) -> Vec<Result<Lost, DropReason>> {
        let unknown: BTreeMap<LinkEnds, Link> = asked
            .iter()
            .map(|asked| (LinkEnds::of(asked.link.segment()), asked.link))
            .filter(|(ends, _)| !self.known.contains_key(ends))
            .collect();
        let links: Vec<Link> = unknown.values().copied().collect();
        let answers = self.answers(&links, structure, settings);
        self.known.extend(unknown.into_keys().zip(answers));
        // Of links that have moved on nobody asks again.
        let former = std::mem::take(&mut self.known);
        let mut lost = Vec::with_capacity(asked.len());
        for asked in asked {
            let ends = LinkEnds::of(asked.link.segment());
            let answer = former.get(&ends).copied().flatten();
            self.known.insert(ends, answer);
            lost.push(self.lost(asked, answer, &settings.noise));
        }
        lost
    }

    fn lost(
        &self,
        Asked { link, strength }: &Asked,
        answer: Option<Answer>,
        noise: &NoiseModel,
    ) -> Result<Lost, DropReason> {
        let answer = answer.ok_or(DropReason::NoEmptyPartner)?;
        if link.is_silent() && answer.is_silent_around {
            return Err(DropReason::SilentBefore);
        }
        let now = level_of(link, *strength, self.exponent, noise);
        Ok(Lost {
            attenuation_db: answer.level_dbm - now.level_dbm,
            variance_db2: now.variance_db2 + answer.variance_db2,
            slope_db2_m2: answer.slope_db2_m2,
        })
    }

    /// Works out what is said of links; `None` of one that has no link of the empty sweep near it.
    fn answers(
        &self,
        links: &[Link],
        structure: Option<&Image>,
        settings: &ImagingSettings,
    ) -> Vec<Option<Answer>> {
        let kriged = |links: &[Link]| -> Vec<Option<(f64, f64)>> {
            let levels = links
                .iter()
                .zip(explained_db(structure, links, settings.weights));
            levels
                .map(|(link, explained_db)| {
                    let (level_dbm, variance_db2) = self.field.level_of(&ends_m(link))?;
                    Some((level_dbm - explained_db, variance_db2))
                })
                .collect()
        };
        // The exponent cancels, as the length is nearly the same.
        let slopes = slopes(links, settings.pairing_m, |links| {
            let level = |known: Option<(f64, f64)>| known.map(|(level_dbm, _)| level_dbm);
            kriged(links).into_iter().map(level).collect()
        });
        let all = links.iter().zip(kriged(links)).zip(slopes);
        all.map(|((link, kriged), slope_db2_m2)| {
            let (level_dbm, variance_db2) = kriged?;
            Some(Answer {
                level_dbm,
                variance_db2,
                is_silent_around: self.field.is_silent_around(&ends_m(link)),
                slope_db2_m2,
            })
        })
        .collect()
    }
}

/// Returns the strength of a link but for its distance, and its variance.
fn level_of(link: &Link, strength: CensoredMean, exponent: f64, noise: &NoiseModel) -> Level<4> {
    Level {
        ends_m: ends_m(link),
        is_silent: link.is_silent(),
        level_dbm: strength.mean_dbm + exponent * spread_db(link.length_m()),
        variance_db2: driven_variance(link, strength, noise),
    }
}

fn ends_m(link: &Link) -> [f64; 4] {
    [link.from.x_m, link.from.y_m, link.to.x_m, link.to.y_m]
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
