//! What links of copters have lost, by an empty sweep that flew elsewhere and without one.

use super::*;
use crate::geom::Rect;
use crate::tomo::path_loss::LawBasis;
use crate::tomo::tests_support::Noise;
use crate::tomo::volume::SpaceBins;

const SIDE_M: f64 = 10.0;
const HEIGHTS_M: [f64; 3] = [1.0, 2.5, 4.0];

fn settings() -> ImagingSettings {
    let area = Rect::new(Point::new(0.0, 0.0), Point::new(SIDE_M, SIDE_M));
    ImagingSettings {
        pairing_m: 0.5,
        ..ImagingSettings::for_change(area)
    }
}

/// How a link is heard: from its ends to dBm; `None` = it is missed.
type Heard = dyn Fn([f64; 3], [f64; 3]) -> Option<f64>;

fn free_space(from: [f64; 3], to: [f64; 3]) -> f64 {
    let length_m = (0..3)
        .map(|axis| (to[axis] - from[axis]).powi(2))
        .sum::<f64>()
        .sqrt();
    -40.0 - 20.0 * libm::log10(length_m)
}

/// Copters at several heights around a square that hear each other four times, each time a little elsewhere.
fn swept(heard: &Heard, seed: u64) -> Vec<SpaceLink> {
    let mut noise = Noise::new(seed);
    let mut places = Vec::new();
    for step in 0..9 {
        let along_m = 1.0 + f64::from(step);
        for height_m in HEIGHTS_M {
            places.push([along_m, 0.0, height_m]);
            places.push([along_m, SIDE_M, height_m]);
            places.push([0.0, along_m, height_m]);
            places.push([SIDE_M, along_m, height_m]);
        }
    }
    let mut bins = SpaceBins::new(0.5);
    for (index, from) in places.iter().enumerate() {
        for to in places[..index].iter().skip(index % 3).step_by(3) {
            for _ in 0..4 {
                let mut off = || 0.16 * (noise.uniform() - 0.5);
                let [from, to] = [from, to].map(|at| at.map(|metres| metres + off()));
                let rssi_dbm = heard(from, to).map(|mean_dbm| mean_dbm + 2.5 * noise.normal());
                let place = |at: [f64; 3]| Point::new(at[0], at[1]);
                let packet = SpaceLink {
                    link: Link::of_packet(place(from), place(to), 0.0, rssi_dbm),
                    heights_m: [from[2], to[2]],
                };
                bins.record(None, &packet);
            }
        }
    }
    bins.links_against(None).0
}

#[test]
fn where_nothing_changed_nothing_is_lost_and_the_deviation_covers_what_is_off() {
    // The level of the empty sweep depends on where the ends are, as behind a wall.
    let heard = |from: [f64; 3], to: [f64; 3]| {
        Some(free_space(from, to) - 3.0 * libm::sin(from[2] + 0.4 * to[0]))
    };
    let (now, empty) = (swept(&heard, 1), swept(&heard, 2));
    let got = calibrate_in_space(&now, Some(&empty), &settings());
    assert!(
        got.links.len() > 1_200,
        "{} {:?}",
        got.links.len(),
        got.dropped
    );
    assert_eq!(got.path_loss, None);
    let count = got.links.len() as f64;
    let mean_db = got.links.iter().map(|one| one.attenuation_db).sum::<f64>() / count;
    let ratio = |one: &VolumeLink| (one.attenuation_db / one.sd_db).powi(2);
    let squares = got.links.iter().map(ratio).sum::<f64>() / count;
    println!(
        "mean {mean_db:.3} dB, squares {squares:.3}, dropped {:?}",
        got.dropped
    );
    assert!(mean_db.abs() < 0.2, "{mean_db}");
    // Fades, of which there are none here, are a part of the deviation.
    assert!((0.1..1.2).contains(&squares), "{squares}");
    let reasons: Vec<DropReason> = got.dropped.into_keys().collect();
    assert_eq!(reasons, [DropReason::TooShort, DropReason::SameSide]);
}

#[test]
fn what_a_link_between_other_heights_has_lost_is_its_own() {
    let free = |from: [f64; 3], to: [f64; 3]| Some(free_space(from, to));
    let shadowed = |from: [f64; 3], to: [f64; 3]| {
        let is_low = from[2].max(to[2]) < 1.5;
        Some(free_space(from, to) - if is_low { 8.0 } else { 0.0 })
    };
    let got = calibrate_in_space(&swept(&shadowed, 3), Some(&swept(&free, 4)), &settings());
    let mean_db = |is_low: bool| {
        let of: Vec<f64> = got
            .links
            .iter()
            .filter(|one| (one.from_m[2].max(one.to_m[2]) < 1.5) == is_low)
            .map(|one| one.attenuation_db)
            .collect();
        assert!(of.len() > 50);
        of.iter().sum::<f64>() / of.len() as f64
    };
    assert!((mean_db(true) - 8.0).abs() < 0.3, "{}", mean_db(true));
    assert!(mean_db(false).abs() < 0.3, "{}", mean_db(false));
}

#[test]
fn silence_counts_as_in_an_image_of_a_plane() {
    let free = |from: [f64; 3], to: [f64; 3]| Some(free_space(from, to));
    let low_is_silent =
        |from: [f64; 3], to: [f64; 3]| (from[2].max(to[2]) > 1.5).then(|| free_space(from, to));
    let (silent, heard) = (swept(&low_is_silent, 5), swept(&free, 6));
    let got = calibrate_in_space(&silent, Some(&heard), &settings());
    let at_floor = || got.links.iter().filter(|one| one.is_at_floor);
    assert!(at_floor().count() > 50);
    // About −60 dBm were heard, and the floor is −95 dBm.
    assert!(at_floor().all(|one| one.attenuation_db > 25.0));
    let again = calibrate_in_space(&silent, Some(&swept(&low_is_silent, 7)), &settings());
    assert!(again.links.iter().all(|one| !one.is_at_floor));
    assert!(again.dropped[&DropReason::SilentBefore] > 50);
    let elsewhere: Vec<SpaceLink> = heard
        .iter()
        .map(|one| SpaceLink {
            heights_m: one.heights_m.map(|height_m| height_m + 5.0),
            ..*one
        })
        .collect();
    let got = calibrate_in_space(&heard, Some(&elsewhere), &settings());
    assert!(got.links.is_empty() && got.dropped.contains_key(&DropReason::NoEmptyPartner));
}

#[test]
fn without_an_empty_sweep_the_path_loss_is_one_over_lengths_in_space() {
    let free = |from: [f64; 3], to: [f64; 3]| Some(free_space(from, to));
    let got = calibrate_in_space(&swept(&free, 8), None, &settings());
    let law = got.path_loss.unwrap();
    assert_eq!(law.basis, LawBasis::Sides);
    assert!((law.exponent - 2.0).abs() < 0.1, "{law:?}");
    let count = got.links.len() as f64;
    let mean_db = got.links.iter().map(|one| one.attenuation_db).sum::<f64>() / count;
    assert!(mean_db.abs() < 0.3, "{mean_db}");
    let none = calibrate_in_space(&[], None, &settings());
    assert_eq!((none.links.len(), none.path_loss), (0, None));
}
