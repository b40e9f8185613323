//! Laws of images that are made link by link: the same as all links at once, surer with each, and nothing left of one taken
//! out.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

use super::*;
use crate::geom::{Point, Rect, Segment};
use crate::tomo::WeightModel;

const PRIOR: Prior = Prior {
    variance: 0.3,
    length_m: 1.0,
};
/// Of a level and of a device.
const VARIANCES: [f64; 2] = [4.0, 1.0];

/// A small grid is held by pixels, a large one by links.
fn grid(is_large: bool) -> PixelGrid {
    let (columns, rows) = if is_large { (63, 41) } else { (12, 10) };
    PixelGrid {
        area: Rect::new(Point::new(0.0, 0.0), Point::new(6.0, 5.0)),
        columns,
        rows,
    }
}

/// Links, what they lost and how surely.
type Links = Vec<(Segment, f64, f64)>;

fn links(most: usize) -> impl Strategy<Value = Links> {
    let end = || (0.0..6.0f64, 0.0..5.0f64).prop_map(|(x_m, y_m)| Point::new(x_m, y_m));
    let link = (end(), end(), -5.0..20.0f64, 0.05..9.0f64);
    let link = link.prop_map(|(from, to, y, s2)| (Segment::new(from, to), y, s2));
    prop::collection::vec(link, 2..most)
}

fn rows(grid: &PixelGrid, links: &Links) -> WeightRows {
    let model = WeightModel::InverseArea { width_m: 0.3 };
    WeightRows::rescaled(links.iter().map(|link| link.0), grid, model)
}

fn effects(index: usize) -> [f64; 2] {
    [1.0, f64::from(u8::from(index.is_multiple_of(3)))]
}

fn link<'a>(
    rows: &'a WeightRows,
    links: &Links,
    row: usize,
    effects: &'a [f64],
) -> StreamedLink<'a> {
    StreamedLink {
        rows,
        row,
        effects,
        attenuation_db: links[row].1,
        variance_db2: links[row].2,
    }
}

fn streamed(grid: &PixelGrid, links: &Links) -> StreamingMap {
    let rows = rows(grid, links);
    let mut map = StreamingMap::new(grid, PRIOR, &VARIANCES);
    for row in 0..links.len() {
        assert!(map.push(link(&rows, links, row, &effects(row))));
    }
    map
}

/// Image, nuisances and variances by dense matrices.
fn batch(grid: &PixelGrid, links: &Links) -> (DVector<f64>, DVector<f64>, DVector<f64>) {
    let rows = rows(grid, links);
    let mut w = DMatrix::zeros(links.len(), grid.len());
    let h = DMatrix::from_fn(links.len(), 2, |i, k| effects(i)[k]);
    for i in 0..links.len() {
        rows.row(i)
            .for_each(|(pixel, weight)| w[(i, pixel)] += weight);
    }
    let c = DMatrix::from_fn(grid.len(), grid.len(), |i, j| {
        let distance_m = grid.centre(i).distance_to(grid.centre(j));
        PRIOR.variance * (-distance_m / PRIOR.length_m).exp()
    });
    let b = DMatrix::from_diagonal(&DVector::from_column_slice(&VARIANCES));
    let s2 = DVector::from_iterator(links.len(), links.iter().map(|link| link.2));
    let y = DVector::from_iterator(links.len(), links.iter().map(|link| link.1));
    let cw = &c * w.transpose();
    let k = &w * &cw + &h * &b * h.transpose() + DMatrix::from_diagonal(&s2);
    let factor = k.cholesky().unwrap();
    let dual = factor.solve(&y);
    let known = factor.solve(&cw.transpose());
    let variances = DVector::from_fn(grid.len(), |i, _| {
        c[(i, i)] - cw.row(i).dot(&known.column(i).transpose())
    });
    (&cw * &dual, b * h.transpose() * dual, variances)
}

fn check_against_the_batch(grid: &PixelGrid, links: &Links, map: &mut StreamingMap) {
    let (image, nuisance, variances) = batch(grid, links);
    let largest = image.amax().max(1.0);
    for (got, expected) in map.image().iter().zip(image.iter()) {
        assert!((got - expected).abs() < 1e-8 * largest, "{got} {expected}");
    }
    for (got, expected) in map.nuisance().iter().zip(nuisance.iter()) {
        assert!((got - expected).abs() < 1e-8 * largest, "{got} {expected}");
    }
    for pixel in (0..grid.len()).step_by(grid.len() / 7) {
        let got = map.deviation(pixel);
        let apart = got * got - variances[pixel];
        assert!(apart.abs() < 1e-8, "{apart}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn link_by_link_equals_the_batch_by_pixels(links in links(40)) {
        let grid = grid(false);
        check_against_the_batch(&grid, &links, &mut streamed(&grid, &links));
    }

    #[test]
    fn the_deviation_never_grows_with_another_link(links in links(24), is_large in any::<bool>()) {
        let grid = grid(is_large);
        let rows = rows(&grid, &links);
        let mut map = StreamingMap::new(&grid, PRIOR, &VARIANCES);
        let pixels: Vec<usize> = (0..grid.len()).step_by(grid.len() / 9).collect();
        let mut before = vec![PRIOR.variance.sqrt(); pixels.len()];
        for row in 0..links.len() {
            prop_assert!(map.push(link(&rows, &links, row, &effects(row))));
            for (pixel, before) in pixels.iter().zip(&mut before) {
                let after = map.deviation(*pixel);
                prop_assert!(after <= *before + 1e-12, "{after} {before}");
                *before = after;
            }
        }
    }

    #[test]
    fn a_link_that_is_taken_out_has_left_no_trace(links in links(30)) {
        let grid = grid(false);
        let (rows, last) = (rows(&grid, &links), links.len() - 1);
        let mut map = streamed(&grid, &links);
        prop_assert!(map.remove(link(&rows, &links, last, &effects(last))));
        let mut fewer = links;
        fewer.truncate(last);
        check_against_the_batch(&grid, &fewer, &mut map);
    }
}

proptest! {
    // A matrix of 2,583 pixels is slow without optimization.
    #![proptest_config(ProptestConfig::with_cases(2))]

    #[test]
    fn link_by_link_equals_the_batch_by_links(links in links(20)) {
        let grid = grid(true);
        check_against_the_batch(&grid, &links, &mut streamed(&grid, &links));
    }
}

#[test]
fn links_taken_together_and_one_by_one_give_the_same_image() {
    let at = |k: usize| Point::new((k * 37 % 60) as f64 / 10.0, (k * 23 % 50) as f64 / 10.0);
    let links: Links = (0..30)
        .map(|k| {
            (
                Segment::new(at(k), at(k * 3 + 4)),
                (k * 29 % 13) as f64 - 3.0,
                1.0 + (k % 5) as f64,
            )
        })
        .collect();
    for is_large in [false, true] {
        let grid = grid(is_large);
        let one_by_one = streamed(&grid, &links);
        let first: Links = links[..20].to_vec();
        let rows_of = rows(&grid, &links);
        let first_rows = rows(&grid, &first);
        let column = |k: usize| Nuisance {
            column: (0..first.len()).map(|i| effects(i)[k]).collect(),
            variance: VARIANCES[k],
        };
        let mut together = StreamingMap::new(&grid, PRIOR, &VARIANCES);
        let y: Vec<f64> = first.iter().map(|link| link.1).collect();
        let s2: Vec<f64> = first.iter().map(|link| link.2).collect();
        assert!(together.add(&first_rows, &y, &s2, &[column(0), column(1)]));
        for row in 20..links.len() {
            assert!(together.push(link(&rows_of, &links, row, &effects(row))));
        }
        for (a, b) in together.image().iter().zip(one_by_one.image()) {
            assert!((a - b).abs() < 1e-8, "{a} {b}");
        }
    }
}

#[test]
fn a_link_without_a_number_changes_nothing() {
    for is_large in [false, true] {
        let grid = grid(is_large);
        let at = |x_m: f64, y_m: f64| Point::new(x_m, y_m);
        let links: Links = vec![(Segment::new(at(0.0, 1.0), at(6.0, 4.0)), 3.0, 1.0)];
        let mut map = streamed(&grid, &links);
        let before = map.image().to_vec();
        let rows = rows(&grid, &links);
        for (attenuation_db, variance_db2) in
            [(f64::NAN, 1.0), (1.0, 0.0), (1.0, f64::NAN), (1.0, -1.0)]
        {
            let wrong = StreamedLink {
                attenuation_db,
                variance_db2,
                ..link(&rows, &links, 0, &[1.0, 1.0])
            };
            assert!(!map.push(wrong));
        }
        assert_eq!(map.image(), before);
    }
}
