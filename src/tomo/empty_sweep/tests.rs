//! What an empty sweep says of links, asked again and again.

use super::*;
use crate::geom::{Point, Rect};
use crate::tomo::link_noise::strength_of;
use crate::tomo::tests_support::Noise;

fn settings() -> ImagingSettings {
    ImagingSettings::for_change(Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 20.0)))
}

/// Links from the west to the east whose ends were driven, behind a step of the level; every seventh was never heard.
fn sweep(moved_m: f64) -> Vec<Link> {
    let mut noise = Noise::new(3);
    let mut one = |k: u32| {
        let (from_m, to_m) = (0.4 * f64::from(k / 15), 0.4 * f64::from(k % 15));
        let is_behind = from_m + to_m > 6.0;
        let mean_dbm = -60.0 - 9.0 * f64::from(u32::from(is_behind)) + noise.normal();
        let ends = (
            Point::new(0.0, from_m + moved_m),
            Point::new(20.0, to_m + 0.5 * moved_m),
        );
        match k % 7 {
            0 => Link {
                misses: 6,
                ..Link::fixed(ends.0, ends.1, 0, f64::NAN)
            },
            _ => Link {
                spots: 4,
                ..Link::fixed(ends.0, ends.1, 8, mean_dbm)
            },
        }
    };
    (0..225).map(&mut one).collect()
}

fn asked(links: &[Link], settings: &ImagingSettings) -> Vec<Asked> {
    let ask = |link: &Link| Asked {
        link: *link,
        strength: strength_of(link, &settings.noise).unwrap(),
    };
    links.iter().map(ask).collect()
}

#[test]
fn who_is_asked_again_says_what_it_would_say_if_it_had_never_been_asked() {
    let (settings, empty) = (settings(), sweep(0.0));
    let empty = EmptyLinks {
        links: &empty,
        structure: None,
    };
    let mut known = KnownSweep::default();
    for round in 0..5 {
        // In each round others have moved, some have left, and they come in another order.
        let moved = sweep(0.05 * f64::from(round));
        let all = sweep(0.03).into_iter().zip(moved).enumerate();
        let mut links: Vec<Link> = all
            .filter(|(k, _)| k % 9 != round as usize)
            .map(|(k, (stays, moves))| if k % 5 == 0 { moves } else { stays })
            .collect();
        links.rotate_left(17 * round as usize);
        let asked = asked(&links, &settings);
        let again = known.of(empty, &links, &settings, None);
        assert!(again.is_driven());
        let alone = KnownSweep::default()
            .of(empty, &links, &settings, None)
            .ask(&asked, &settings);
        assert_eq!(again.ask(&asked, &settings), alone);
        let is_steep = |lost: &Lost| lost.slope_db2_m2 > 10.0;
        assert!(
            alone.iter().flatten().any(is_steep) && alone.contains(&Err(DropReason::SilentBefore))
        );
    }
}

#[test]
fn another_empty_sweep_answers_for_itself() {
    let (settings, empty, links) = (settings(), sweep(0.0), sweep(0.1));
    let stronger: Vec<Link> = empty
        .iter()
        .map(|link| Link {
            mean_dbm: link.mean_dbm + 3.0,
            ..*link
        })
        .collect();
    let asked = asked(&links, &settings);
    let mut known = KnownSweep::default();
    let mut ask = |empty: &[Link], settings: &ImagingSettings| {
        let empty = EmptyLinks {
            links: empty,
            structure: None,
        };
        known
            .of(empty, &links, settings, None)
            .ask(&asked, settings)
    };
    let first = ask(&empty, &settings);
    let second = ask(&stronger, &settings);
    let louder = first.iter().flatten().zip(second.iter().flatten());
    let heard = louder
        .map(|(first, second)| second.attenuation_db - first.attenuation_db)
        .filter(|more_db| (1.5..3.1).contains(more_db));
    // Silent neighbours are as silent as before.
    assert!(heard.count() > 80);
    let noisier = ImagingSettings {
        noise: NoiseModel {
            fading_sd_db: 2.0 * settings.noise.fading_sd_db,
            ..settings.noise
        },
        ..settings
    };
    assert_ne!(ask(&stronger, &noisier), second);
    assert_eq!(ask(&empty, &settings), first);
}
