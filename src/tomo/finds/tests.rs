//! Persons in made-up sweeps whose links obey the model.

use super::*;
use crate::tomo::tests_support::Noise;

const AREA: Rect = Rect {
    min: Point::new(0.0, 0.0),
    max: Point::new(20.0, 20.0),
};

/// Links between random places of the edge, with persons that attenuate 10 dB/m and noise of 2 dB.
fn sweep(links: usize, persons: &[Point], seed: u64) -> Vec<Observation> {
    noisy_sweep(links, persons, seed, 2.0)
}

fn noisy_sweep(links: usize, persons: &[Point], seed: u64, noise_db: f64) -> Vec<Observation> {
    let settings = FindSettings::IN_METRES;
    let mut noise = Noise::new(seed);
    let edge = |share: f64| match (share * 4.0) as u32 {
        0 => Point::new(80.0 * share, 0.0),
        1 => Point::new(20.0, 80.0 * share - 20.0),
        2 => Point::new(60.0 - 80.0 * share, 20.0),
        _ => Point::new(0.0, 80.0 - 80.0 * share),
    };
    let mut observations = Vec::new();
    while observations.len() < links {
        let (from, to) = (edge(noise.uniform()), edge(noise.uniform()));
        if from.distance_to(to) < 6.0 {
            continue;
        }
        let link = settings.person.link(from, to, AREA, 0.0);
        let clean_db: f64 = persons
            .iter()
            .map(|at| 10.0 * settings.person.chord_m(&link, *at))
            .sum();
        observations.push(Observation {
            from,
            to,
            attenuation_db: clean_db + noise_db * noise.normal(),
            variance_db2: 4.0,
            packets: 10,
            misses: 0,
            is_at_floor: false,
        });
    }
    observations
}

/// Fixed ends around an area where nothing stood.
fn open(area: Rect) -> SearchedGround<'static> {
    SearchedGround {
        area,
        driven: None,
        structure: None,
    }
}

fn find(observations: &[Observation]) -> Finds {
    find_persons(observations, open(AREA), &FindSettings::IN_METRES).unwrap()
}

/// What is faint is nobody inside something solid, and somebody just beside it; who is plain is found wherever he stands.
#[test]
fn within_something_solid_more_is_asked_of_evidence() {
    let at = Point::new(9.25, 10.75);
    let grid = crate::geom::PixelGrid {
        area: AREA,
        columns: 40,
        rows: 40,
    };
    let solid_at = |solid: Point| {
        let mut image = Image::zeros(grid);
        let pixel = grid.pixel_at(solid).unwrap();
        image.values[pixel] = 9.0;
        image
    };
    let (inside, beside) = (solid_at(at), solid_at(Point::new(9.75, 10.75)));
    let found = |links: usize, structure: &Image| {
        let ground = SearchedGround {
            structure: Some(structure),
            ..open(AREA)
        };
        let of_seed = |seed: u64| {
            let observations = sweep(links, &[at], seed);
            let finds = find_persons(&observations, ground, &FindSettings::IN_METRES);
            finds.unwrap().found.len()
        };
        (1..9).map(of_seed).sum::<usize>()
    };
    let (hidden, plain) = (found(500, &inside), found(500, &beside));
    assert!(hidden <= 3 && plain >= 6, "{hidden} and {plain} of 8");
    assert_eq!((found(1500, &inside), found(1500, &beside)), (8, 8));
}

#[test]
fn two_persons_are_found_and_nobody_else() {
    let persons = [Point::new(6.2, 13.1), Point::new(14.7, 5.4)];
    for seed in 1..4 {
        let finds = find(&sweep(1500, &persons, seed));
        assert_eq!(finds.found.len(), 2, "{finds:?}");
        for person in persons {
            let nearest = finds
                .found
                .iter()
                .min_by(|a, b| {
                    a.at.distance_to(person)
                        .total_cmp(&b.at.distance_to(person))
                })
                .unwrap();
            let [xx, _, yy] = nearest.covariance_m2;
            let sd_m = (xx + yy).sqrt();
            assert!(
                nearest.at.distance_to(person) < 4.0 * sd_m && sd_m < 0.3,
                "{nearest:?}"
            );
            assert!((6.0..15.0).contains(&nearest.strength));
            assert!(nearest.evidence > finds.threshold && nearest.probability > 0.98);
        }
    }
}

/// Of who is plain and of who is often not found at all; 0.9 less three deviations of so many draws.
#[test]
fn of_ten_persons_nine_stand_within_their_ellipses() {
    for links in [1500, 600] {
        let (mut inside, mut outside) = (0, 0);
        for seed in 0..100u32 {
            let person = Point::new(
                5.0 + 0.1 * f64::from(seed),
                12.0 - 0.07 * f64::from(seed % 50),
            );
            let observations = sweep(links, &[person], u64::from(seed));
            for find in find(&observations).found {
                let off = person - find.at;
                let [xx, xy, yy] = find.covariance_m2;
                let square = (yy * off.x_m * off.x_m - 2.0 * xy * off.x_m * off.y_m
                    + xx * off.y_m * off.y_m)
                    / (xx * yy - xy * xy);
                // 90 % of a normal distribution of two dimensions.
                match square <= 4.605 {
                    true => inside += 1,
                    false => outside += 1,
                }
            }
        }
        println!("{links} links: {inside} of {} within", inside + outside);
        assert!(inside + outside > 60, "{inside} and {outside} of 100");
        let share = f64::from(inside) / f64::from(inside + outside);
        assert!((0.80..=0.99).contains(&share), "{links} links: {share}");
    }
}

#[test]
fn links_without_noise_give_persons_back() {
    let persons = [Point::new(6.2, 13.1), Point::new(14.7, 5.4)];
    let finds = find(&noisy_sweep(600, &persons, 4, 1e-3));
    assert_eq!(finds.found.len(), 2, "{finds:?}");
    for person in persons {
        let near = |find: &&Find| find.at.distance_to(person) < 0.01;
        let find = finds.found.iter().find(near).expect("within a centimetre");
        assert!((find.strength - 10.0).abs() < 0.1, "{find:?}");
    }
}

#[test]
fn links_at_the_floor_say_at_least() {
    let person = [Point::new(6.2, 13.1)];
    let at_floor = |is_told: bool| -> Vec<Observation> {
        let cut = |one: Observation| Observation {
            attenuation_db: one.attenuation_db.min(1.0),
            is_at_floor: is_told && one.attenuation_db > 1.0,
            ..one
        };
        noisy_sweep(1000, &person, 4, 0.3)
            .into_iter()
            .map(cut)
            .collect()
    };
    let (told, untold) = (find(&at_floor(true)), find(&at_floor(false)));
    let [told] = &told.found[..] else {
        panic!("{told:?}")
    };
    assert!((told.strength - 10.0).abs() < 1.5, "{told:?}");
    assert!(told.at.distance_to(person[0]) < 0.1, "{told:?}");
    let weakest = untold.found.iter().map(|find| find.strength);
    assert!(weakest.fold(f64::INFINITY, f64::min) < 6.0, "{untold:?}");
}

#[test]
fn a_mirrored_or_turned_sweep_gives_mirrored_or_turned_finds() {
    let persons = [Point::new(6.2, 13.1), Point::new(14.7, 5.4)];
    let mirror: fn(Point) -> Point = |at| Point::new(20.0 - at.x_m, at.y_m);
    let quarter_turn: fn(Point) -> Point = |at| Point::new(20.0 - at.y_m, at.x_m);
    for (seed, moved) in [
        (5, mirror),
        (6, quarter_turn),
        (7, mirror),
        (8, quarter_turn),
    ] {
        let links = sweep(500, &persons, seed);
        let of_moved: Vec<Observation> = links
            .iter()
            .map(|one| Observation {
                from: moved(one.from),
                to: moved(one.to),
                ..*one
            })
            .collect();
        let (finds, others) = (find(&links), find(&of_moved));
        assert!(!finds.found.is_empty());
        assert_eq!(finds.found.len(), others.found.len());
        for (find, other) in finds.found.iter().zip(&others.found) {
            let apart_m = moved(find.at).distance_to(other.at);
            let off = (find.evidence - other.evidence).abs();
            assert!(apart_m < 5e-3 && off < 0.05, "{find:?} {other:?}");
        }
    }
}

#[test]
fn two_persons_side_by_side_are_told_apart() {
    let persons = [Point::new(9.0, 10.0), Point::new(10.5, 10.0)];
    let finds = find(&sweep(1500, &persons, 9));
    assert_eq!(finds.found.len(), 2, "{finds:?}");
}

#[test]
fn where_nobody_stands_nobody_is_found() {
    let found: usize = (0..20)
        .map(|seed| find(&sweep(400, &[], seed)).found.len())
        .sum();
    assert!(found <= 1, "{found} of 20");
}

#[test]
fn too_few_links_give_a_place_and_no_find() {
    let person = Point::new(8.0, 11.0);
    let finds = find(&sweep(100, &[person], 3));
    assert!(finds.found.is_empty(), "{finds:?}");
    let next = finds.next.expect("the best place");
    assert!(next.evidence < finds.threshold && next.probability < 0.98);
    assert!(next.evidence > 0.0 && AREA.contains(next.at), "{next:?}");
}

#[test]
fn who_passes_is_found_however_little_it_gains() {
    let settings = FindSettings {
        false_per_image: 1.0,
        ..FindSettings::IN_METRES
    };
    let (model, person) = (settings.person, Point::new(8.0, 11.0));
    let nobody = sweep(400, &[], 3);
    let mut passed = 0;
    for step in 1..=24 {
        let strength = 0.5 * f64::from(step);
        let stands_in = |one: &Observation| {
            let link = model.link(one.from, one.to, AREA, 0.0);
            Observation {
                attenuation_db: one.attenuation_db + strength * model.chord_m(&link, person),
                ..*one
            }
        };
        let observations: Vec<Observation> = nobody.iter().map(stands_in).collect();
        let finds = find_persons(&observations, open(AREA), &settings).unwrap();
        passed += finds.found.len();
        let Some(next) = finds.next else { continue };
        // The noise is measured anew when those who were added are known.
        let passes = next.evidence >= finds.threshold + 0.8;
        let is_located = next.deviation_m() <= LOCATED * model.radius_m;
        assert!(!(passes && is_located), "{strength} dB/m: {finds:?}");
    }
    assert!(passed >= 8, "{passed}");
}

#[test]
fn who_may_stand_anywhere_along_the_links_is_not_found() {
    // All links lie side by side, so nothing tells where along them the person stands.
    let person = FindSettings::IN_METRES.person;
    let mut noise = Noise::new(4);
    let observation = |k: i32| {
        let y_m = 8.0 + 0.1 * f64::from(k % 40);
        let (from, to) = (Point::new(0.0, y_m), Point::new(20.0, y_m));
        let link = person.link(from, to, AREA, 0.0);
        let clean_db = 12.0 * person.chord_m(&link, Point::new(10.0, 10.0));
        Observation {
            from,
            to,
            attenuation_db: clean_db + 0.5 * noise.normal(),
            variance_db2: 0.25,
            packets: 10,
            misses: 0,
            is_at_floor: false,
        }
    };
    let finds = find(&(0..400).map(observation).collect::<Vec<_>>());
    assert_eq!(finds.found, [], "{finds:?}");
    let next = finds.next.unwrap();
    assert!(
        next.deviation_m() > 1.0 && next.evidence > finds.threshold,
        "{next:?}"
    );
    let settings = FindSettings::IN_METRES;
    assert_eq!(finds.unlocated(&settings), Some(&next));
    let weak = find(&sweep(100, &[Point::new(8.0, 11.0)], 3));
    assert!(weak.next.is_some() && weak.unlocated(&settings).is_none());
}

#[test]
fn the_order_of_links_changes_nothing_but_the_last_digits() {
    let mut observations = sweep(1500, &[Point::new(12.0, 8.0)], 5);
    let one = find(&observations);
    observations.reverse();
    let other = find(&observations);
    assert_eq!(one.found.len(), other.found.len());
    assert!(one.found[0].at.distance_to(other.found[0].at) < 1e-3);
}

#[test]
fn places_are_farther_apart_where_they_and_the_links_would_take_too_much_memory() {
    let settings = FindSettings::IN_METRES;
    let of = |side_m: f64, links: usize| {
        let inner = Rect::new(Point::default(), Point::new(side_m, side_m));
        let pitch_m = places_apart_m(&settings, inner, links);
        let places = (side_m / pitch_m) * (side_m / pitch_m);
        (pitch_m, places * links as f64)
    };
    assert_eq!(of(18.4, 17_500).0, settings.pitch_m);
    assert_eq!(of(30.0, 10_000).0, settings.pitch_m);
    for (side_m, links) in [(18.4, 500_000), (100.0, 100_000), (1000.0, 10_000)] {
        let (pitch_m, pairs) = of(side_m, links);
        assert!(pitch_m > settings.pitch_m && pairs < 1.01 * MOST_PAIRS);
    }
}

#[test]
fn without_links_or_room_there_is_nothing_to_search() {
    let settings = FindSettings::IN_METRES;
    assert_eq!(find_persons(&[], open(AREA), &settings), None);
    let small = Rect::new(Point::new(0.0, 0.0), Point::new(1.0, 20.0));
    let one = sweep(50, &[], 1);
    assert_eq!(find_persons(&one, open(small), &settings), None);
}

#[test]
fn nobody_is_sought_in_an_area_that_is_narrower_than_a_person() {
    let observations = sweep(100, &[Point::new(10.0, 10.0)], 3);
    let settings = FindSettings {
        rim_m: 0.0,
        ..FindSettings::IN_METRES
    };
    let narrow = |side_m: f64| {
        let area = Rect::new(Point::new(10.0, 10.0), Point::new(10.0 + side_m, 20.0));
        find_persons(&observations, open(area), &settings).is_some()
    };
    let radius_m = settings.person.radius_m;
    assert!(!narrow(1.9 * radius_m) && narrow(2.5 * radius_m));
}

#[test]
fn an_area_far_larger_than_what_the_links_enclose_shows_nobody_else() {
    let persons = [Point::new(6.2, 13.1), Point::new(14.7, 5.4)];
    let settings = FindSettings::IN_METRES;
    for (seed, persons) in [(1, &persons[..]), (11, &[]), (12, &[])] {
        let observations = sweep(600, persons, seed);
        let near = find(&observations);
        assert_eq!(near.found.len(), persons.len(), "{near:?}");
        for beyond_m in [5.0, 100.0] {
            let far = find_persons(&observations, open(AREA.shrunk(-beyond_m)), &settings).unwrap();
            assert_eq!(far.found.len(), persons.len(), "{far:?}");
            assert!((far.threshold - near.threshold).abs() < 1.0);
        }
        let beside = Rect::new(Point::new(30.0, 0.0), Point::new(50.0, 20.0));
        assert_eq!(find_persons(&observations, open(beside), &settings), None);
    }
}

#[test]
fn links_that_tell_no_place_from_another_find_nobody() {
    let link = sweep(1, &[], 1)[0];
    let (from, to) = (Point::new(0.0, 5.0), Point::new(20.0, 15.0));
    let observation = |_| Observation { from, to, ..link };
    let observations: Vec<Observation> = (0..40).map(observation).collect();
    let settings = FindSettings::IN_METRES;
    assert_eq!(find_persons(&observations, open(AREA), &settings), None);
}
