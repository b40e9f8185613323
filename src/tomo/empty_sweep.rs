//! The empty sweep, to be asked what a link had in it. Fixed ends are the same again, and there a link has its partner
//! ([`partners`]); where ends were driven it is kriged from its neighbours ([`driven`]), as no two sweeps drive the same places.
//!
//! While image follows image the empty sweep stays the same, and so do most links: [`KnownSweep`] keeps it with what it has
//! said, so that only links are worked out that have moved or are new. An answer depends on nothing that was asked before.

mod driven;
mod partners;

use std::collections::BTreeSet;

use self::driven::DrivenSweep;
use self::partners::{Partners, entries_of};
use super::calibrate::DropReason;
use super::censored::CensoredMean;
use super::path_loss::{ExponentPrior, PathLoss};
use super::settings::{ImagingSettings, NoiseModel};
use super::{Image, Link};

/// Of fewer links than this nobody could tell a field.
const FEWEST_DRIVEN: usize = 30;
/// Two places that differ by less are the same one, metres (or the units of the input).
const SAME_PLACE_M: f64 = 1e-3;

/// The links of an empty sweep, and the image of what stood there, if there is one.
#[derive(Clone, Copy, Debug)]
pub(super) struct EmptyLinks<'a> {
    pub links: &'a [Link],
    pub structure: Option<&'a Image>,
}

/// A link that is compared with the empty sweep, and how strong it is now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked {
    pub link: Link,
    pub strength: CensoredMean,
}

/// What a link has lost since the empty sweep.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Lost {
    /// Positive = attenuation, dB.
    pub attenuation_db: f64,
    /// Its variance, dB².
    pub variance_db2: f64,
    /// How steep the level of the empty sweep is there across the link, both ends together, dB²/m²; 0 for fixed ends.
    pub slope_db2_m2: f64,
}

/// An empty sweep that may be asked again. A copy knows none: it saves time alone.
#[derive(Debug, Default)]
pub(super) struct KnownSweep(Option<EmptySweep>);

impl Clone for KnownSweep {
    fn clone(&self) -> KnownSweep {
        KnownSweep::default()
    }
}

impl KnownSweep {
    /// Returns the empty sweep of these links; the one that is known if that was made from the same.
    pub(super) fn of(
        &mut self,
        empty: EmptyLinks<'_>,
        now: &[Link],
        settings: &ImagingSettings,
        path_loss: Option<PathLoss>,
    ) -> &mut EmptySweep {
        let conditions = Conditions {
            is_driven: are_driven(empty.links, now),
            noise: settings.noise,
            exponent: path_loss.map_or(ExponentPrior::NEAR_FREE_SPACE.mean, |law| law.exponent),
        };
        let known = self.0.take().filter(|one| one.is_of(empty, conditions));
        self.0.insert(match known {
            Some(known) => known,
            None => EmptySweep::of(empty, conditions, settings),
        })
    }

    /// Forgets it.
    pub(super) fn forget(&mut self) {
        self.0 = None;
    }
}

/// What the answers of an empty sweep depend on beside its links and their image, but for settings that stay.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Conditions {
    is_driven: bool,
    noise: NoiseModel,
    /// Of the path loss: what is taken off a strength for its distance.
    exponent: f64,
}

/// An empty sweep that can be asked.
#[derive(Debug)]
pub(super) struct EmptySweep {
    links: Vec<Link>,
    structure: Option<Image>,
    conditions: Conditions,
    ends: Ends,
}

#[derive(Debug)]
enum Ends {
    Driven(DrivenSweep),
    Fixed(Partners),
}

impl EmptySweep {
    fn of(empty: EmptyLinks<'_>, conditions: Conditions, settings: &ImagingSettings) -> EmptySweep {
        let EmptyLinks { links, structure } = empty;
        let (entries, exponent) = (entries_of(links, settings), conditions.exponent);
        let ends = if conditions.is_driven {
            Ends::Driven(DrivenSweep::new(&entries, structure, settings, exponent))
        } else {
            Ends::Fixed(Partners::new(entries, settings, exponent))
        };
        EmptySweep {
            links: links.to_vec(),
            structure: structure.cloned(),
            conditions,
            ends,
        }
    }

    /// Returns whether it was made from the same.
    fn is_of(&self, empty: EmptyLinks<'_>, conditions: Conditions) -> bool {
        self.conditions == conditions
            && Link::are_same(&self.links, empty.links, 0.0)
            && self.structure.as_ref() == empty.structure
    }

    /// Returns whether the ends of its links were driven.
    pub(super) fn is_driven(&self) -> bool {
        self.conditions.is_driven
    }

    /// Returns what each link has lost since, or why nobody can say.
    pub(super) fn ask(
        &mut self,
        asked: &[Asked],
        settings: &ImagingSettings,
    ) -> Vec<Result<Lost, DropReason>> {
        match &mut self.ends {
            Ends::Driven(driven) => driven.ask(asked, self.structure.as_ref(), settings),
            Ends::Fixed(partners) => {
                let lost = |asked: &Asked| partners.lost(asked, &settings.noise);
                asked.iter().map(lost).collect()
            }
        }
    }
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

#[cfg(test)]
mod tests;
