//! Facts about links: snapping, weights, objectives, layers of candidates, calibration. Points are (x, y).

use serde_json::{Value, json};
use tomoswarm::geom::{PixelGrid, Point, Rect, Segment};
use tomoswarm::sweep::{
    LinkSetQuality, hypervolume_contributions, non_dominated_layers, snap_to_boundary,
};
use tomoswarm::tomo::{ImagingSettings, Link, WeightModel, WeightRows, calibrate};

use super::fact::{Checked, Fact, numbers, table, written};

fn point([x, y]: [f64; 2]) -> Point {
    Point::new(x, y)
}

fn segment(ends: &[[f64; 2]]) -> Result<Segment, String> {
    match ends {
        [from, to] => Ok(Segment::new(point(*from), point(*to))),
        _ => Err("a link has two ends".to_owned()),
    }
}

fn written_link(link: Option<Segment>) -> Value {
    link.map_or(Value::Null, |link| {
        json!([[link.from.x_m, link.from.y_m], [link.to.x_m, link.to.y_m]])
    })
}

/// Checks a fact about ends of links on the border.
pub fn check_snap(fact: &Fact) -> Checked {
    let network = fact.input("network")?;
    let [x, y] = numbers(&network["origin"])?;
    let size = |key: &str| {
        network[key]
            .as_f64()
            .ok_or_else(|| format!("the network has no {key}"))
    };
    let rect = Rect::new(
        Point::new(x, y),
        Point::new(x + size("width")?, y + size("height")?),
    );
    let link = Segment::new(point(fact.numbers("start")?), point(fact.numbers("end")?));
    let snapped = snap_to_boundary(rect, link, fact.flag("snap_inside")?);
    fact.expect("snapped", written_link(snapped))
}

/// Unit pixels from an origin.
fn pixels(fact: &Fact, key: &str) -> Result<PixelGrid, String> {
    let [columns, rows] = fact.numbers(key)?;
    let [x, y] = if fact.has("origin") {
        fact.numbers("origin")?
    } else {
        [0.0, 0.0]
    };
    let area = Rect::new(Point::new(x, y), Point::new(x + columns, y + rows));
    Ok(PixelGrid {
        area,
        columns: columns as usize,
        rows: rows as usize,
    })
}

/// Checks a fact about weights before they are rescaled.
pub fn check_weights(fact: &Fact) -> Checked {
    match () {
        () if fact.has("lambda") => {
            let (grid, link) = (pixels(fact, "grid")?, segment(&fact.table("link")?)?);
            let row = weights(
                link,
                &grid,
                WeightModel::Ellipse {
                    width_m: fact.number("lambda")?,
                },
            );
            let rows: Vec<&[f64]> = row.chunks(grid.columns).collect();
            fact.expect("weights", json!(rows))
        }
        () if fact.has("excess") => {
            let model = WeightModel::Gaussian {
                sd_m: fact.number("sigma")?,
            };
            fact.expect(
                "weight",
                json!(model.weight(fact.number("excess")?, 1.0, 1.0)),
            )
        }
        () if fact.has("sigma") => gaussian_row(fact),
        () => {
            let link = segment(&fact.table("link")?)?;
            let snapped = snap_to_boundary(pixels(fact, "size")?.area, link, true);
            if fact.expects("accepted") {
                return fact.expect("accepted", json!(snapped.is_some()));
            }
            fact.expect("snapped", written_link(snapped))
        }
    }
}

/// One row of the matrix, a value for every pixel.
fn weights(link: Segment, grid: &PixelGrid, model: WeightModel) -> Vec<f64> {
    let mut rows = WeightRows::new();
    rows.push(link, grid, model);
    let mut row = vec![0.0; grid.columns * grid.rows];
    rows.row(0).for_each(|(pixel, weight)| row[pixel] = weight);
    row
}

/// The model at every pixel; the matrix has the same values, but for those below 10⁻⁴, which it leaves out.
fn gaussian_row(fact: &Fact) -> Checked {
    let (grid, link) = (pixels(fact, "size")?, segment(&fact.table("link")?)?);
    let model = WeightModel::Gaussian {
        sd_m: fact.number("sigma")?,
    };
    let weight =
        |pixel: usize| model.weight(link.excess_path_m(grid.centre(pixel)), link.length_m(), 1.0);
    let all: Vec<f64> = (0..grid.columns * grid.rows).map(weight).collect();
    let kept: Vec<f64> = all
        .iter()
        .map(|weight| if *weight < 1e-4 { 0.0 } else { *weight })
        .collect();
    if weights(link, &grid, model) != kept {
        return Err("the matrix has other values".to_owned());
    }
    fact.expect("row", json!(all))
}

/// Checks a fact about the two objectives of a set of links.
pub fn check_objective(fact: &Fact) -> Checked {
    let ([width, height], [right, up]) = (fact.numbers("network_size")?, fact.numbers("padding")?);
    let area = Rect::new(
        Point::new(right, up),
        Point::new(width - right, height - up),
    );
    let grid = PixelGrid {
        area,
        columns: area.width_m() as usize,
        rows: area.height_m() as usize,
    };
    let pairs = fact
        .input("pairs")?
        .as_array()
        .ok_or("the pairs are no list")?;
    let links: Vec<Segment> = pairs
        .iter()
        .map(|pair| segment(&table(pair)?))
        .collect::<Result<_, String>>()?;
    let quality = LinkSetQuality::of(&links, &grid, fact.number("lambda")?, false);
    fact.expect("objective1", json!(quality.coverage()))?;
    fact.expect("uncovered_pixels", json!(quality.uncovered_pixels))?;
    fact.expect("unsnappable", json!(quality.unsnappable))?;
    fact.expect("sum_link_lengths", json!(quality.links_length_m))?;
    fact.expect(
        "objective2_delta_0_8",
        json!(quality.effort_m(fact.number("travel")?, 0.8)),
    )
}

/// Checks a fact about candidates with several objectives.
pub fn check_pareto(fact: &Fact) -> Checked {
    let objectives: Vec<[f64; 2]> = fact.table("objectives")?;
    if fact.expects("layers") {
        return fact.expect("layers", json!(non_dominated_layers(&objectives)));
    }
    let contributions = hypervolume_contributions(&objectives);
    fact.expect(
        "contribution",
        contributions.into_iter().map(written).collect(),
    )
}

/// Checks a fact about strengths less those of the empty network, the negative of our attenuations.
pub fn check_dataset(fact: &Fact) -> Checked {
    let list = |key: &str| -> Result<Vec<f64>, String> {
        let list = fact.input(key)?.as_array().ok_or("no list")?;
        list.iter()
            .map(|number| number.as_f64().ok_or_else(|| format!("{key}: no number")))
            .collect()
    };
    let (measured, empty) = (list("measured")?, list("empty")?);
    // Links from the left to the right side of an area, far enough from each other not to be pooled.
    let links = |means: &[f64]| -> Vec<Link> {
        let link = |(place, mean): (usize, &f64)| {
            let y_m = 2.0 + 3.0 * place as f64;
            Link::fixed(Point::new(0.0, y_m), Point::new(20.0, y_m), 4, *mean)
        };
        means.iter().enumerate().map(link).collect()
    };
    let settings =
        ImagingSettings::for_area(Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 20.0)));
    let calibrated = calibrate(&links(&measured), Some(&links(&empty)), &settings);
    let found: Vec<f64> = calibrated
        .observations
        .iter()
        .map(|link| -link.attenuation_db)
        .collect();
    fact.expect("calibrated", json!(found))
}
