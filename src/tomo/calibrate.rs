//! From signal strengths to attenuations: by an empty sweep where there is one, by a fitted path loss otherwise.
//!
//! What a link had in the empty sweep says [`super::empty_sweep`]. Every link that is not used is counted with its reason.
//! Nothing is imaged here.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::geom::{Point, Rect};

use super::Link;
use super::censored::CensoredMean;
use super::displaced_ends::add_displacement;
use super::empty_sweep::{Asked, EmptyLinks, KnownSweep, Lost};
use super::link::floor_dbm;
use super::link_noise::{single_variance, strength_of};
use super::path_loss::{ExponentPrior, LawBasis, PathLoss};
use super::ring::side_tolerance_m;
use super::settings::{ImagingSettings, NoiseModel};

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
    let structure = None;
    let empty = empty.map(|links| EmptyLinks { links, structure });
    calibrate_around(now, empty, settings, &mut KnownSweep::default())
}

/// Calibrates as [`calibrate`] does, with what is known of the empty sweep; that gives the same as without.
pub(super) fn calibrate_around(
    now: &[Link],
    empty: Option<EmptyLinks<'_>>,
    settings: &ImagingSettings,
    known: &mut KnownSweep,
) -> Calibrated {
    let of_empty = empty.map(|empty| empty.links);
    let all = || now.iter().chain(of_empty.unwrap_or_default());
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
    let path_loss = fit_path_loss(of_empty.unwrap_or(now), settings);
    let mut dropped = DroppedLinks::new();
    let mut leave_out = |reason: DropReason| *dropped.entry(reason).or_default() += 1;
    let mut asked = Vec::with_capacity(now.len());
    for link in now {
        match strength_to_compare(link, settings) {
            Ok(strength) => asked.push(Asked {
                link: *link,
                strength,
            }),
            Err(reason) => leave_out(reason),
        }
    }
    let (is_driven, lost) = match empty {
        Some(empty) => {
            let sweep = known.of(empty, now, settings, path_loss);
            (sweep.is_driven(), sweep.ask(&asked, settings))
        }
        None => {
            let lost = |asked: &Asked| lost_by_law(asked, path_loss, &settings.noise);
            (false, asked.iter().map(lost).collect())
        }
    };
    let (mut observations, mut slopes) = (Vec::new(), Vec::new());
    for (Asked { link, .. }, lost) in asked.iter().zip(lost) {
        match lost {
            Ok(lost) => {
                slopes.push(lost.slope_db2_m2);
                observations.push(Observation {
                    from: link.from,
                    to: link.to,
                    attenuation_db: lost.attenuation_db,
                    variance_db2: lost.variance_db2,
                    packets: link.packets,
                    misses: link.misses,
                    is_at_floor: link.is_silent(),
                });
            }
            Err(reason) => leave_out(reason),
        }
    }
    if is_driven {
        add_displacement(&mut observations, &slopes, settings.pairing_m);
    }
    Calibrated {
        observations,
        dropped,
        path_loss,
        by_empty_sweep: empty.is_some(),
        is_driven,
    }
}

/// Returns how strong a link is, if it is one that may be imaged.
fn strength_to_compare(
    link: &Link,
    settings: &ImagingSettings,
) -> Result<CensoredMean, DropReason> {
    let length_m = link.length_m();
    if length_m < settings.shortest_link_m || length_m <= 0.0 {
        return Err(DropReason::TooShort);
    }
    if runs_along_a_side(link, settings.ring, settings.side_tolerance_m) {
        return Err(DropReason::SameSide);
    }
    strength_of(link, &settings.noise).ok_or(DropReason::NeverHeard)
}

/// Returns what a link has lost against free space.
fn lost_by_law(
    Asked { link, strength }: &Asked,
    path_loss: Option<PathLoss>,
    noise: &NoiseModel,
) -> Result<Lost, DropReason> {
    let law = path_loss.ok_or(DropReason::NoPathLoss)?;
    Ok(Lost {
        attenuation_db: law.strength_dbm(link.length_m()) - strength.mean_dbm,
        variance_db2: single_variance(link, *strength, noise),
        slope_db2_m2: 0.0,
    })
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

/// Fits the law on the links along the sides when there are enough of them, see [`law_of`].
fn fit_path_loss(links: &[Link], settings: &ImagingSettings) -> Option<PathLoss> {
    let is_usable =
        |link: &&Link| link.packets > 0 && link.length_m() >= 0.5 * settings.shortest_link_m;
    let usable: Vec<Link> = links.iter().filter(is_usable).copied().collect();
    let is_free = |link: &&Link| runs_along_a_side(link, settings.ring, settings.side_tolerance_m);
    let free: Vec<Link> = usable.iter().filter(is_free).copied().collect();
    law_of(&free, &usable, settings.exponent)
}

/// Fits the law on the links `free` of things in between when there are enough of them.
///
/// Otherwise on all that are long enough, `usable`, and then only the level: many of these cross the same wall, so their errors
/// go together and the fit would be sure of nonsense (n = 3.5). The exponent stays at its prior, and what the
/// fit leaves open is found with the image.
pub(super) fn law_of(free: &[Link], usable: &[Link], exponent: ExponentPrior) -> Option<PathLoss> {
    const FEWEST_FREE: usize = 8;
    if free.len() >= FEWEST_FREE {
        let law = PathLoss::fit(free, exponent)?;
        return Some(PathLoss {
            basis: LawBasis::Sides,
            ..law
        });
    }
    let held = ExponentPrior {
        sd: exponent.sd.min(1e-3),
        ..exponent
    };
    let law = PathLoss::fit(usable, held)?;
    Some(PathLoss {
        level_sd_db: law.residual_db,
        exponent_sd: exponent.sd.min(1.0),
        ..law
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tomo::path_loss::spread_db;

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
