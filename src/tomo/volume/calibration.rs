//! From signal strengths of what flew to attenuations, as images of pixels have them ([`crate::tomo::calibrate()`]): by an empty
//! sweep, kriged over both ends in space, or without one by the path loss over lengths in space.
//!
//! Deliberately absent, though images of pixels have it: an image of what stood in the empty sweep, which its kriging could
//! rest on, and that ends are displaced ([`crate::tomo::displaced_ends`]).

use super::VolumeLink;
use super::space_bins::SpaceLink;
use crate::geom::Point;
use crate::tomo::Link;
use crate::tomo::calibrate::{DropReason, DroppedLinks, law_of, runs_along_a_side};
use crate::tomo::censored::CensoredMean;
use crate::tomo::kriging::{Level, LevelField};
use crate::tomo::link::floor_dbm;
use crate::tomo::link_noise::{below_bound_db2, driven_variance, single_variance, strength_of};
use crate::tomo::path_loss::{ExponentPrior, PathLoss, spread_db};
use crate::tomo::ring::side_tolerance_m;
use crate::tomo::settings::{ImagingSettings, NoiseModel};

/// The links of a sweep in space with what they have lost.
#[derive(Clone, PartialEq, Debug)]
pub struct SpaceCalibration {
    /// In the order of the links given, without those that are left out.
    pub links: Vec<VolumeLink>,
    /// What was left out.
    pub dropped: DroppedLinks,
    /// The law that was fitted on the sweep itself; `None` where there is an empty sweep, or too few links for one.
    pub path_loss: Option<PathLoss>,
}

/// Calibrates links `now`, pooled in bins of `settings.pairing_m`, by an empty sweep that is so, too, or without one by the path
/// loss of the sweep itself. The settings are those of the plane: its ring is where the links end, seen from above.
pub fn calibrate_in_space(
    now: &[SpaceLink],
    empty: Option<&[SpaceLink]>,
    settings: &ImagingSettings,
) -> SpaceCalibration {
    let seen_from_above = || {
        let both = now.iter().chain(empty.unwrap_or_default());
        both.map(|one| &one.link)
    };
    let sensitivity_dbm = floor_dbm(seen_from_above(), settings.noise.sensitivity_dbm);
    let noise = NoiseModel {
        sensitivity_dbm,
        ..settings.noise
    };
    let tolerance_m = side_tolerance_m(seen_from_above(), settings.ring, settings.side_tolerance_m);
    let settings = &ImagingSettings {
        noise,
        side_tolerance_m: tolerance_m,
        ..*settings
    };
    let path_loss = match empty {
        Some(_) => None,
        None => fit_path_loss(now, settings),
    };
    let reference = match empty {
        Some(links) => SpaceReference::Empty(empty_field(links, settings)),
        None => SpaceReference::FreeSpace(path_loss),
    };
    let (mut links, mut dropped) = (Vec::new(), DroppedLinks::new());
    for one in now {
        match lost(one, &reference, settings) {
            Ok(link) => links.push(link),
            Err(reason) => *dropped.entry(reason).or_default() += 1,
        }
    }
    SpaceCalibration {
        links,
        dropped,
        path_loss,
    }
}

/// With what strengths are compared.
enum SpaceReference {
    Empty(LevelField<6>),
    FreeSpace(Option<PathLoss>),
}

/// Returns what a link has lost, or why it is left out.
fn lost(
    one: &SpaceLink,
    reference: &SpaceReference,
    settings: &ImagingSettings,
) -> Result<VolumeLink, DropReason> {
    let (noise, length_m) = (&settings.noise, one.length_m());
    if length_m < settings.shortest_link_m || length_m <= 0.0 {
        return Err(DropReason::TooShort);
    }
    if runs_along_a_side(&one.link, settings.ring, settings.side_tolerance_m) {
        return Err(DropReason::SameSide);
    }
    let strength = strength_of(&one.link, noise).ok_or(DropReason::NeverHeard)?;
    let (attenuation_db, variance_db2) = match reference {
        SpaceReference::Empty(field) => {
            let now = level_of(one, strength, noise);
            let known = field.level_of(&now.ends_m);
            let (level_dbm, variance_db2) = known.ok_or(DropReason::NoEmptyPartner)?;
            if now.is_silent && field.is_silent_around(&now.ends_m) {
                return Err(DropReason::SilentBefore);
            }
            (level_dbm - now.level_dbm, variance_db2 + now.variance_db2)
        }
        SpaceReference::FreeSpace(law) => {
            let law = law.ok_or(DropReason::NoPathLoss)?;
            let lost_db = law.strength_dbm(length_m) - strength.mean_dbm;
            (lost_db, single_variance(&one.link, strength, noise))
        }
    };
    let [from_m, to_m] = one.ends_m();
    Ok(VolumeLink {
        from_m,
        to_m,
        attenuation_db,
        sd_db: variance_db2.sqrt(),
        is_at_floor: one.link.is_silent(),
    })
}

/// Returns the levels of the links of an empty sweep that are long enough and of which something is known.
fn empty_field(links: &[SpaceLink], settings: &ImagingSettings) -> LevelField<6> {
    let level = |one: &SpaceLink| {
        let strength = strength_of(&one.link, &settings.noise)?;
        let level = level_of(one, strength, &settings.noise);
        let is_long = one.length_m() >= 0.5 * settings.shortest_link_m && one.length_m() > 0.0;
        is_long.then(|| Level {
            variance_db2: level.variance_db2 + below_bound_db2(&one.link),
            ..level
        })
    };
    LevelField::new(links.iter().filter_map(level).collect(), settings.pairing_m)
}

/// Returns the strength of a link but for its distance in free space, which hardly differs from that of its neighbours.
fn level_of(one: &SpaceLink, strength: CensoredMean, noise: &NoiseModel) -> Level<6> {
    let [[a, b, c], [d, e, f]] = one.ends_m();
    let exponent = ExponentPrior::NEAR_FREE_SPACE.mean;
    Level {
        ends_m: [a, b, c, d, e, f],
        is_silent: one.link.is_silent(),
        level_dbm: strength.mean_dbm + exponent * spread_db(one.length_m()),
        variance_db2: driven_variance(&one.link, strength, noise),
    }
}

/// Fits the law, which asks for lengths alone: each link is laid along a line.
fn fit_path_loss(links: &[SpaceLink], settings: &ImagingSettings) -> Option<PathLoss> {
    let is_usable =
        |one: &&SpaceLink| one.link.packets > 0 && one.length_m() >= 0.5 * settings.shortest_link_m;
    let along_a_line = |one: &SpaceLink| Link {
        from: Point::default(),
        to: Point::new(one.length_m(), 0.0),
        ..one.link
    };
    let is_free =
        |one: &&SpaceLink| runs_along_a_side(&one.link, settings.ring, settings.side_tolerance_m);
    let usable = || links.iter().filter(is_usable);
    let free: Vec<Link> = usable().filter(is_free).map(along_a_line).collect();
    let usable: Vec<Link> = usable().map(along_a_line).collect();
    law_of(&free, &usable, settings.exponent)
}

#[cfg(test)]
mod tests;
