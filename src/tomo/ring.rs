//! The ring on which links end, as their ends show it: its sides, and how far beside them the ends lie.
//!
//! A few ends far outside (a vehicle that was carried away) and ends that are not exactly on a line move no side: a side is
//! where many ends lie in a narrow strip and few beside it, further in. Ends that form no such strip have no side there, and
//! the outermost of them counts. Nothing is calibrated here.

use crate::geom::{Point, Rect};

use super::Link;

/// A strip in which ends of one side lie, a share of the shorter extent.
const STRIP: f64 = 0.1;
/// At most this share of the ends lies beyond a side.
const BEYOND: f64 = 0.1;
/// A side has at least this share of the ends that it would have if all sides were equally full for their length.
const FULL: f64 = 0.5;
/// So many times as many ends lie in the strip of a side as in the one next to it, further in.
const PEAKED: usize = 2;
/// Ends of a side lie within so many standard deviations of its line.
const DEVIATIONS: f64 = 3.0;
/// Fewer ends beside a side do not say how far those of a side lie from it.
const FEWEST_ENDS: usize = 20;
/// Standard deviations in a median deviation of what is normally distributed.
const OF_MEDIAN: f64 = 1.4826;

/// Returns the ring on which links end; `None` without any.
pub fn ring_of<'a>(links: impl Iterator<Item = &'a Link>) -> Option<Rect> {
    let ends: Vec<Point> = links.flat_map(|link| [link.from, link.to]).collect();
    let around = Rect::around(ends.iter().copied())?;
    let x_m = sorted(ends.iter().map(|at| at.x_m));
    let y_m = sorted(ends.iter().map(|at| at.y_m));
    let (width_m, height_m) = (inner_extent(&x_m), inner_extent(&y_m));
    let strip_m = STRIP * width_m.min(height_m);
    let perimeter_m = 2.0 * (width_m + height_m);
    // NaN where all ends are one place, and then no strip is full.
    let fewest = |side_m: f64| FULL * side_m / perimeter_m * ends.len() as f64;
    let [west, east] = [&x_m, &mirrored(&x_m)].map(|all| side(all, strip_m, fewest(height_m)));
    let [south, north] = [&y_m, &mirrored(&y_m)].map(|all| side(all, strip_m, fewest(width_m)));
    let from_above = |side: Option<f64>, outermost: f64| side.map_or(outermost, |at_m| -at_m);
    Some(Rect {
        min: Point::new(
            west.unwrap_or(around.min.x_m),
            south.unwrap_or(around.min.y_m),
        ),
        max: Point::new(
            from_above(east, around.max.x_m),
            from_above(north, around.max.y_m),
        ),
    })
}

/// Returns how far from a side of a ring both ends of a link may lie that runs along it: so far as most ends of the side do,
/// at least `least_m`, and at most as wide as the strip of a side.
pub fn side_tolerance_m<'a>(
    links: impl Iterator<Item = &'a Link>,
    ring: Rect,
    least_m: f64,
) -> f64 {
    let most_m = STRIP * ring.width_m().min(ring.height_m());
    let ends: Vec<Point> = links.flat_map(|link| [link.from, link.to]).collect();
    let beside = |of_side: &dyn Fn(Point) -> f64| {
        let off = ends.iter().map(|at| of_side(*at));
        let off_m = sorted(off.filter(|off_m| off_m.abs() <= most_m));
        if off_m.len() < FEWEST_ENDS {
            0.0
        } else {
            reach_m(off_m)
        }
    };
    let reaches_m = [
        beside(&|at| at.x_m - ring.min.x_m),
        beside(&|at| at.x_m - ring.max.x_m),
        beside(&|at| at.y_m - ring.min.y_m),
        beside(&|at| at.y_m - ring.max.y_m),
    ];
    let reach_m = reaches_m.into_iter().fold(0.0, f64::max);
    reach_m.min(most_m).max(least_m)
}

/// Returns how far from a line most of what lies about it reaches, metres.
fn reach_m(off_m: Vec<f64>) -> f64 {
    let Some(middle_m) = median(&off_m) else {
        return 0.0;
    };
    let deviations = sorted(off_m.iter().map(|off_m| (off_m - middle_m).abs()));
    let sd_m = OF_MEDIAN * median(&deviations).unwrap_or(0.0);
    middle_m.abs() + DEVIATIONS * sd_m
}

/// Returns where the side lies that is first from below; `all` = the ends along an axis, sorted.
fn side(all: &[f64], strip_m: f64, fewest: f64) -> Option<f64> {
    let up_to = |from: usize, at_m: f64| from + all[from..].partition_point(|end| *end <= at_m);
    let strip = |from: usize| {
        let low_m = all[from];
        let end = up_to(from, low_m + strip_m);
        let next = up_to(end, low_m + 2.0 * strip_m) - end;
        (from, end, next)
    };
    let is_side = |(from, end, next): &(usize, usize, usize)| {
        (end - from) as f64 >= fewest && end - from >= PEAKED * next
    };
    let beyond = (BEYOND * all.len() as f64) as usize;
    let (first, _, _) = (0..=beyond.min(all.len().checked_sub(1)?))
        .map(strip)
        .find(is_side)?;
    // The first full strip holds a part of the side only: the fullest one near it holds all of it.
    let (from, end, _) = (first..up_to(first, all[first] + strip_m))
        .map(strip)
        .max_by(|(a, a_end, _), (b, b_end, _)| (a_end - a).cmp(&(b_end - b)).then(b.cmp(a)))?;
    median(&all[from..end])
}

/// Returns the extent without a tenth on either side.
fn inner_extent(all: &[f64]) -> f64 {
    let beyond = (BEYOND * all.len() as f64) as usize;
    all[all.len() - 1 - beyond] - all[beyond]
}

fn mirrored(all: &[f64]) -> Vec<f64> {
    all.iter().rev().map(|at_m| -at_m).collect()
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Returns the middle one of sorted values.
fn median(sorted: &[f64]) -> Option<f64> {
    sorted.get(sorted.len() / 2).copied()
}

#[cfg(test)]
mod tests;
