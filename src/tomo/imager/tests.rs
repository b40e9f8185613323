//! What an imager keeps from one image to the next, and the shares of a pixel.

use super::*;
use crate::geom::Rect;
use crate::tomo::bins::BinKey;

const AREA: Rect = Rect {
    min: Point::new(0.0, 0.0),
    max: Point::new(20.0, 20.0),
};

/// Links across the area, so many metres apart, of which those at 9 to 11 m have lost something.
fn links(apart_m: f64) -> Vec<Link> {
    let count = (18.0 / apart_m) as usize;
    let of = |k: usize| {
        let at_m = 1.0 + apart_m * k as f64;
        let is_dark = (9.0..=11.0).contains(&at_m);
        // No two of them have lost the same.
        let strength = if is_dark { -70.0 - at_m } else { -60.0 };
        let up = (Point::new(at_m, 0.0), Point::new(at_m, 20.0));
        let across = (Point::new(0.0, at_m), Point::new(20.0, at_m));
        [up, across].map(|(from, to)| Link::fixed(from, to, 20, strength))
    };
    (0..count).flat_map(of).collect()
}

#[test]
fn shares_sum_to_their_pixel_where_links_lie_in_one_bin() {
    let settings = ImagingSettings::for_area(AREA);
    let now = links(0.1);
    let key = |link: &Link| BinKey::of(link.from, link.to, settings.pairing_m).0;
    let keys: std::collections::BTreeSet<BinKey> = now.iter().map(key).collect();
    assert!(
        4 * keys.len() < now.len(),
        "{} of {}",
        keys.len(),
        now.len()
    );
    let pixel = settings.grid.pixel_at(Point::new(10.1, 10.1)).unwrap();
    let extras = Extras {
        shares_of: Some(pixel),
        ..Extras::default()
    };
    let made = Imager::new(settings)
        .and_then(|mut imager| imager.update(&now, None, extras))
        .unwrap();
    let (value, shares) = (made.image.values[pixel], made.shares.unwrap());
    let sum: f64 = shares.links.iter().map(|link| link.share).sum();
    assert!(value > 0.2, "{value}");
    assert!((sum - value).abs() < 1e-9, "{sum} of {value}");
}

/// Puts an image that no links would make in the place of what is known to have stood there, and returns it.
fn mark(imager: &mut Imager) -> Option<Image> {
    let grid = imager.settings.grid;
    let marked = Some(Image {
        grid,
        values: vec![0.5; grid.len()],
    });
    let standing = imager.standing.as_mut().unwrap();
    standing.structure.clone_from(&marked);
    marked
}

fn structure_of(imager: &mut Imager, empty: &[Link]) -> Option<Image> {
    imager.find_scene(empty).unwrap();
    imager.standing.as_ref().unwrap().structure.clone()
}

#[test]
fn drafts_are_the_same_without_what_was_kept_to_make_them_sooner() {
    // Driven ends, of which some move from image to image.
    let sweep = |lost_db: f64, moved_m: f64| -> Vec<Link> {
        let one = |(k, link): (usize, Link)| {
            let off_m = if k % 3 == 0 { moved_m } else { 0.0 };
            let has_lost = (0.3..0.4).contains(&(k as f64 / 90.0));
            Link {
                from: Point::new(link.from.x_m + off_m, link.from.y_m + off_m),
                spots: 3,
                mean_dbm: link.mean_dbm - lost_db * f64::from(u8::from(has_lost)),
                ..link
            }
        };
        links(0.4).into_iter().enumerate().map(one).collect()
    };
    let empty = sweep(0.0, 0.0);
    let mut imager = Imager::new(ImagingSettings::for_change(AREA)).unwrap();
    for image in 0..4 {
        let now = sweep(6.0, 0.05 * f64::from(image));
        let mut without = imager.clone();
        without.forget_known();
        let update = |imager: &mut Imager| imager.update(&now, Some(&empty), Extras::default());
        assert_eq!(update(&mut imager), update(&mut without));
    }
}

#[test]
fn what_stood_there_is_imaged_once_for_one_empty_sweep() {
    let mut empty = links(1.0);
    empty.push(Link {
        misses: 9,
        ..Link::fixed(Point::new(0.0, 3.3), Point::new(20.0, 7.1), 0, f64::NAN)
    });
    let settings = ImagingSettings::for_change(AREA);
    let mut imager = Imager::new(settings).unwrap();
    let structure = structure_of(&mut imager, &empty).unwrap();
    assert_eq!(room_for_change(&structure).len(), settings.grid.len());
    let marked = mark(&mut imager);
    assert_eq!(structure_of(&mut imager, &empty), marked);
    empty[0].mean_dbm -= 1.0;
    assert_ne!(structure_of(&mut imager, &empty), marked);
}

#[test]
fn radios_that_are_known_a_little_better_do_not_have_the_empty_sweep_imaged_anew() {
    let (empty, now) = (links(1.0), links(2.0));
    let settings = ImagingSettings::for_change(AREA);
    let mut imager = Imager::new(settings).unwrap();
    let update = |imager: &mut Imager| {
        imager
            .update(&now, Some(&empty), Extras::default())
            .unwrap()
    };
    update(&mut imager);
    let marked = mark(&mut imager);
    let mut corrected = empty.clone();
    for (index, link) in corrected.iter_mut().enumerate() {
        link.mean_dbm += if index % 2 == 0 { 0.15 } else { -0.15 };
        link.spread_db += 0.1;
    }
    assert_eq!(structure_of(&mut imager, &corrected), marked);
    // The last image of a run depends on its links alone.
    imager.forget();
    assert_ne!(structure_of(&mut imager, &corrected), marked);
    // Strengths that differ by more are those of another sweep.
    update(&mut imager);
    assert_eq!(mark(&mut imager), marked);
    corrected[0].mean_dbm += 1.0;
    assert_ne!(structure_of(&mut imager, &corrected), marked);
}

#[test]
fn an_image_that_would_take_too_much_memory_is_refused_before_it_takes_any() {
    let many = |pixels: usize, solver: Solver| {
        let usual = ImagingSettings::for_change(AREA);
        let grid = crate::geom::PixelGrid {
            columns: pixels,
            rows: pixels,
            ..usual.grid
        };
        let settings = ImagingSettings {
            grid,
            solver,
            ..usual
        };
        Imager::new(settings)
            .unwrap()
            .update(&links(0.02), None, Extras::default())
    };
    let map = ImagingSettings::for_change(AREA).solver;
    let Err(problem @ TomoError::TooLarge { .. }) = many(1024, map) else {
        panic!("an image of 1024 x 1024 pixels");
    };
    let said = problem.to_string();
    assert!(
        said.contains("1024 x 1024 pixels would take") && said.contains("expected at most 2.0 GB"),
        "{said}"
    );
    assert!(matches!(
        many(600, Solver::TSVD),
        Err(TomoError::TooLarge { .. })
    ));
    assert!(many(20, map).is_ok());
}

#[test]
fn each_step_is_told_when_it_begins() {
    let of_change = ImagingSettings::for_change(AREA);
    let settings = ImagingSettings {
        solver: Solver::Auto(ImagingSettings::candidates_for(AREA)),
        weights: of_change.fresnel(),
        ..of_change
    };
    let empty: Vec<Link> = links(1.0)
        .iter()
        .map(|link| Link {
            mean_dbm: -60.0,
            ..*link
        })
        .collect();
    let extras = Extras {
        persons: true,
        deviation: Some(100),
        ..Extras::default()
    };
    let told = std::cell::RefCell::new(Vec::new());
    let mut imager = Imager::new(settings).unwrap();
    let watched = imager
        .update_watched(&links(1.0), Some(&empty), extras, &|step| {
            told.borrow_mut().push(step);
        })
        .unwrap();
    let told = told.into_inner();
    let of = watched.choice.as_ref().unwrap().scores.len();
    let choosing = (0..of).map(|done| ImagingStep::Choosing { done, of });
    let solving = (0..8).map(|done| ImagingStep::Solving { done, of: 8 });
    let expected: Vec<ImagingStep> = [ImagingStep::Structure, ImagingStep::Persons]
        .into_iter()
        .chain(choosing)
        .chain(solving)
        .chain([ImagingStep::Deviation])
        .collect();
    assert_eq!(told, expected);
    let alone = Imager::new(settings)
        .and_then(|mut imager| imager.update(&links(1.0), Some(&empty), extras));
    assert_eq!(alone.unwrap(), watched);
}
