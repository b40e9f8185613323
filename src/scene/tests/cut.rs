//! The cut at a height: which pieces are near, what hangs together, how wide it is.

use std::sync::Arc;

use super::*;
use crate::geom::{Angle, Segment, Vector};
use crate::scene::{CutForm, CutPiece, Cuts, LevelCut};

/// A box of 2 m × 4 m × 1 m in the middle, one that touches it from the east, one 2 cm beside that, a low one in the north.
const BOXES: &str = "
    Transform { translation 0 0 0.5 children Shape { geometry Box { size 2 4 1 } } }
    Transform { translation 1.505 0 0.5 children Shape { geometry Box { size 1 1 1 } } }
    Transform { translation 2.525 0 0.5 children Shape { geometry Box { size 1 1 1 } } }
    Transform { translation 0 9 0.1 children Shape { geometry Box { size 6 1 0.2 } } }";

fn pieces_in(
    cut: &LevelCut,
    tip: (f64, f64),
    middle_deg: f64,
    half_deg: f64,
    reach_m: f64,
) -> Vec<CutPiece> {
    let edge = |side: f64| Vector::polar(Angle::from_degrees(middle_deg + side * half_deg), 1.0);
    let pieces = cut.in_sector(Point::new(tip.0, tip.1), [edge(1.0), edge(-1.0)], reach_m);
    pieces.copied().collect()
}

fn all(cut: &LevelCut) -> Vec<CutPiece> {
    let mut pieces = pieces_in(cut, (0.0, -50.0), 90.0, 80.0, 200.0);
    pieces.sort_by_key(|piece| piece.solid);
    pieces
}

#[test]
fn what_touches_or_nearly_so_is_one_solid() {
    let cut = LevelCut::of(&scene_of(BOXES, 1.0, &[]), 0.5);
    let mut solids: Vec<usize> = all(&cut).iter().map(|piece| piece.solid).collect();
    solids.dedup();
    assert_eq!(solids, [0, 1]);
}

#[test]
fn a_width_counts_across_the_direction_of_all_that_hangs_together() {
    let cut = LevelCut::of(&scene_of(BOXES, 1.0, &[person(-8.0, 0.0)]), 0.5);
    let (east, north) = (Vector::new(1.0, 0.0), Vector::new(0.0, 1.0));
    assert!((cut.half_width_m(0, east) - 2.0).abs() < 1e-9);
    assert!((cut.half_width_m(0, north) - 3.005 / 2.0).abs() < 1e-9);
    let diagonal = Vector::polar(Angle::from_degrees(45.0), 1.0);
    let expected = (1.0 + 2.0 + 1.0 + 2.0) / 8f64.sqrt();
    assert!((cut.half_width_m(0, diagonal) - expected).abs() < 1e-9);
    for turn in 0..20 {
        let along = Vector::polar(Angle::from_degrees(f64::from(turn) * 17.0), 1.0);
        assert!((cut.half_width_m(2, along) - 0.3).abs() < 1e-9, "a person");
    }
    assert_eq!(cut.half_width_m(9, east), 0.0);
}

#[test]
fn an_object_is_as_wide_as_its_widest_solid_there_or_as_all_of_it() {
    let scene = scene_of(BOXES, 1.0, &[]);
    let cut = LevelCut::of(&scene, 0.5);
    let north = Vector::new(0.0, 1.0);
    assert!((cut.object_half_width_m(1, north) - 3.005 / 2.0).abs() < 1e-9);
    assert!((cut.object_half_width_m(3, north) - 3.0).abs() < 1e-9);
    assert_eq!(cut.object_half_width_m(7, north), 0.0);
}

#[test]
fn the_very_ends_of_a_body_belong_to_it() {
    let scene = scene_of(BOXES, 1.0, &[]);
    for (height_m, count) in [
        (-0.01, 0),
        (0.0, 16),
        (0.2, 16),
        (0.21, 12),
        (1.0, 12),
        (1.01, 0),
    ] {
        assert_eq!(
            all(&LevelCut::of(&scene, height_m)).len(),
            count,
            "{height_m}"
        );
    }
}

#[test]
fn a_round_body_is_a_circle_and_a_sheet_is_cut_too() {
    let sheet = "Shape { geometry IndexedFaceSet { coordIndex [0 1 2 3 -1]
        coord Coordinate { point [0 0 0, 2 0 0, 2 0 1, 0 0 1] } } }";
    let cut = LevelCut::of(&scene_of(sheet, 1.0, &[person(5.0, 0.0)]), 0.5);
    let pieces = all(&cut);
    let (last, straight) = pieces.split_last().unwrap();
    assert!(matches!(last.form, CutForm::Round(circle) if circle.radius_m == 0.3));
    let length_m = |piece: &CutPiece| match piece.form {
        CutForm::Straight(piece) => piece.length_m(),
        CutForm::Round(_) => 0.0,
    };
    assert!((straight.iter().map(length_m).sum::<f64>() - 2.0).abs() < 1e-9);
}

#[test]
fn what_lies_in_a_sector_is_found_and_what_lies_far_beside_it_is_not() {
    let mut chance = Sequence(3);
    let mut boxes = String::new();
    for _ in 0..60 {
        let [x, y] = [(); 2].map(|()| chance.within(-10.0, 10.0));
        boxes += &format!(
            "Transform {{ translation {x} {y} 0 children Shape {{ geometry Box {{ size 0.3 0.2 1 }} }} }}\n"
        );
    }
    let cut = LevelCut::of(&scene_of(&boxes, 1.0, &[]), 0.1);
    let everything = all(&cut);
    assert_eq!(everything.len(), 240);
    for _ in 0..300 {
        let tip = (chance.within(-9.0, 9.0), chance.within(-9.0, 9.0));
        let (middle_deg, half_deg) = (chance.within(-180.0, 180.0), chance.within(0.5, 60.0));
        let reach_m = chance.within(0.5, 8.0);
        let found = pieces_in(&cut, tip, middle_deg, half_deg, reach_m);
        let axis = Vector::polar(Angle::from_degrees(middle_deg), 1.0);
        let place = Point::new(tip.0, tip.1);
        let is_in = |at: Point| {
            let away = at - place;
            let half_cos = half_deg.to_radians().cos();
            away.length_m() <= reach_m && away.dot(axis) >= half_cos * away.length_m()
        };
        let middle = |piece: &CutPiece| match piece.form {
            CutForm::Straight(Segment { from, to }) => from.toward(to, 0.5),
            CutForm::Round(circle) => circle.centre,
        };
        for piece in &everything {
            if is_in(middle(piece)) {
                assert!(found.contains(piece), "{piece:?}");
            }
        }
        let stray = found
            .iter()
            .filter(|piece| middle(piece).distance_to(place) > reach_m + 0.4);
        assert_eq!(stray.count(), 0);
    }
}

#[test]
fn a_cut_is_made_once_for_a_height() {
    let scene = scene_of(BOXES, 1.0, &[]);
    let mut cuts = Cuts::default();
    let first = cuts.at(&scene, 0.5);
    for height_m in [0.1, 0.2, 0.3, 0.5, 0.4, 0.6] {
        cuts.at(&scene, height_m);
    }
    assert!(
        Arc::ptr_eq(&first, &cuts.at(&scene, 0.5)),
        "it was asked for often enough"
    );
    assert!(!Arc::ptr_eq(&first, &cuts.at(&scene, 0.4)));
    for height_m in [1.1, 1.2, 1.3, 1.4] {
        cuts.at(&scene, height_m);
    }
    assert!(!Arc::ptr_eq(&first, &cuts.at(&scene, 0.5)), "few are kept");
}
