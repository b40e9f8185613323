//! Overlays on the plot and their samples in the legend.

use embedded_graphics::geometry::{Point as Pixel, Size};
use embedded_graphics::primitives::Rectangle;

use crate::geom::{Point, Polygon, Segment};

use super::colour::Theme;
use super::label::Labels;
use super::layout::Layout;
use super::overlay::{Mark, Overlay};
use super::raster::Picture;
use super::stroke::{At, Pen, Sheet};
use super::text::write_rimmed;
use super::tracks;

const CASING_PX: f64 = 2.4;
const CIRCLE_LEAST_PX: f64 = 4.0;
/// Radius of the dot within a person, pixels.
const DOT_PX: f64 = 1.2;
const OUTLINE_MOST: usize = 600;
/// So many squared deviations from the mean lie 90 % in the plane.
const CHI_SQUARED_90: f64 = 4.605;
/// Labels stand beside ellipses of this radius at most, and on larger ones.
const ELLIPSE_MOST_PX: f64 = 60.0;

/// Draws all overlays, marks of one kind together, then their labels on top.
pub(super) fn overlays(
    picture: &mut Picture,
    layout: &Layout,
    theme: &Theme,
    overlays: &[Overlay],
) {
    let mut ordered: Vec<&Overlay> = overlays.iter().collect();
    ordered.sort_by_key(|overlay| overlay.mark());
    let mut sheet = Sheet::new(layout.plot);
    let mut labels = Labels::new(layout.plot);
    let mut are_tracks_drawn = false;
    for overlay in &ordered {
        let mark = overlay.mark();
        if let Mark::Track(_) = mark {
            if !std::mem::replace(&mut are_tracks_drawn, true) {
                tracks::draw(picture, layout, theme, overlays);
            }
            continue;
        }
        for path in paths(overlay, layout) {
            cased(&mut sheet, picture, theme, mark, &path);
        }
        taken(overlay, layout)
            .into_iter()
            .for_each(|rectangle| labels.keep_free(rectangle));
    }
    // What was found matters most: it chooses its place first.
    for overlay in ordered.iter().rev() {
        if is_numbered_elsewhere(overlay, overlays) {
            continue;
        }
        label(&mut labels, layout, theme, overlay);
    }
    for placed in labels.placed() {
        write_rimmed(
            picture,
            &placed.text,
            placed.at,
            placed.colour,
            theme.casing,
        );
    }
}

/// Returns whether it is the home of a vehicle that is drawn with its number: once is enough.
fn is_numbered_elsewhere(overlay: &Overlay, overlays: &[Overlay]) -> bool {
    let Overlay::Home { vehicle: whose, .. } = overlay else {
        return false;
    };
    overlays
        .iter()
        .any(|other| matches!(other, Overlay::Vehicle { vehicle, .. } if vehicle == whose))
}

/// Draws a sample of a mark on a tile of the plot's ground.
pub(super) fn sample(picture: &mut Picture, theme: &Theme, mark: Mark, tile: Rectangle) {
    picture.fill(tile, theme.ground);
    let Rectangle { top_left, size } = tile;
    let middle = At::new(
        f64::from(top_left.x) + f64::from(size.width) / 2.0,
        f64::from(top_left.y) + f64::from(size.height) / 2.0,
    );
    let place = |x_px: f64, y_px: f64| At::new(middle.x_px + x_px, middle.y_px + y_px);
    let paths = match mark {
        Mark::Area | Mark::Fence | Mark::Track(_) | Mark::Walk | Mark::Direction => {
            vec![vec![place(-14.0, 0.0), place(14.0, 0.0)]]
        }
        Mark::Outline => {
            vec![vec![
                place(-12.0, 5.0),
                place(-12.0, -5.0),
                place(12.0, -5.0),
                place(12.0, 5.0),
                place(-12.0, 5.0),
            ]]
        }
        Mark::Circle => person(middle, 6.0),
        Mark::Cross => cross(middle),
        Mark::Find => {
            let mut paths = cross(middle);
            paths.push(circle(middle, 9.0));
            paths
        }
        Mark::Vehicle(_) | Mark::Viewpoint => vec![vec![middle]],
        Mark::Home(_) => vec![house(middle)],
    };
    let mut sheet = Sheet::new(tile);
    for path in paths {
        cased(&mut sheet, picture, theme, mark, &path);
    }
}

/// Draws a path with a rim, so that it reads on any ground.
fn cased(sheet: &mut Sheet, picture: &mut Picture, theme: &Theme, mark: Mark, path: &[At]) {
    let pen = mark.pen(theme);
    sheet.path(picture, path, rim(mark, theme));
    sheet.path(picture, path, pen);
}

/// Returns the pen of a mark's rim.
pub(super) fn rim(mark: Mark, theme: &Theme) -> Pen {
    let pen = mark.pen(theme);
    Pen {
        width_px: pen.width_px + CASING_PX,
        colour: theme.casing,
        opacity: mark_rim(mark),
        ..pen
    }
}

/// Returns the opacity of a mark's rim: fainter for lines, which lie close to each other.
fn mark_rim(mark: Mark) -> f64 {
    match mark {
        Mark::Track(_) | Mark::Walk | Mark::Area | Mark::Fence | Mark::Direction => 0.5,
        Mark::Outline
        | Mark::Home(_)
        | Mark::Viewpoint
        | Mark::Vehicle(_)
        | Mark::Circle
        | Mark::Cross
        | Mark::Find => 0.75,
    }
}

/// Returns the paths an overlay is drawn with.
pub(super) fn paths(overlay: &Overlay, layout: &Layout) -> Vec<Vec<At>> {
    match overlay {
        Overlay::Outline { polygon, .. } | Overlay::Fence { polygon } => {
            vec![closed(polygon, layout)]
        }
        Overlay::Area { rect } => vec![closed(&rect.polygon(), layout)],
        Overlay::Track { points, .. } | Overlay::Walk { points } => {
            vec![points.iter().map(|point| layout.place(*point)).collect()]
        }
        Overlay::Circle { at, radius_m, .. } => {
            person(layout.place(*at), radius_px(*radius_m, layout))
        }
        Overlay::Cross { at, .. } => cross(layout.place(*at)),
        Overlay::Find {
            at, covariance_m2, ..
        } => {
            let mut paths = cross(layout.place(*at));
            paths.push(ellipse(*at, *covariance_m2, layout));
            paths
        }
        Overlay::Vehicle { at, .. } | Overlay::Viewpoint { at } => vec![vec![layout.place(*at)]],
        Overlay::Home { at, .. } => vec![house(layout.place(*at))],
        Overlay::Direction { at, half, .. } => {
            vec![vec![layout.place(*at - *half), layout.place(*at + *half)]]
        }
    }
}

fn closed(polygon: &Polygon, layout: &Layout) -> Vec<At> {
    let corners = polygon.corners();
    corners
        .iter()
        .chain(corners.first())
        .map(|corner| layout.place(*corner))
        .collect()
}

fn circle(middle: At, radius_px: f64) -> Vec<At> {
    let pieces = 96;
    let place = |i: i32| {
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * f64::from(i) / f64::from(pieces));
        At::new(middle.x_px + radius_px * cos, middle.y_px + radius_px * sin)
    };
    // The last place is the first again, exactly, whatever the sine of a full turn is.
    (0..=pieces).map(|i| place(i % pieces)).collect()
}

/// Returns a circle with a dot in its middle: the outline of a round object has none.
fn person(middle: At, radius_px: f64) -> Vec<Vec<At>> {
    vec![circle(middle, radius_px), circle(middle, DOT_PX)]
}

fn cross(middle: At) -> Vec<Vec<At>> {
    let arm_px = 6.0;
    let place = |x_px: f64, y_px: f64| At::new(middle.x_px + x_px, middle.y_px + y_px);
    vec![
        vec![place(-arm_px, -arm_px), place(arm_px, arm_px)],
        vec![place(-arm_px, arm_px), place(arm_px, -arm_px)],
    ]
}

/// Returns the ellipse that holds 90 % of a normal distribution with this mean and covariance.
fn ellipse(at: Point, [xx, xy, yy]: [f64; 3], layout: &Layout) -> Vec<At> {
    // The Cholesky factor of the covariance turns a circle into it.
    let across = xx.max(0.0).sqrt();
    let slant = if across > 0.0 { xy / across } else { 0.0 };
    let rest = (yy - slant * slant).max(0.0).sqrt();
    let unit = circle(At::new(0.0, 0.0), CHI_SQUARED_90.sqrt());
    unit.into_iter()
        .map(|on| {
            let (x_m, y_m) = (across * on.x_px, slant * on.x_px + rest * on.y_px);
            layout.place(Point::new(at.x_m + x_m, at.y_m + y_m))
        })
        .collect()
}

fn house(middle: At) -> Vec<At> {
    let corners = [
        (-5.0, 6.0),
        (-5.0, -1.0),
        (0.0, -6.0),
        (5.0, -1.0),
        (5.0, 6.0),
        (-5.0, 6.0),
    ];
    corners
        .iter()
        .map(|(x_px, y_px)| At::new(middle.x_px + x_px, middle.y_px + y_px))
        .collect()
}

fn radius_px(radius_m: f64, layout: &Layout) -> f64 {
    layout.length_px(radius_m).max(CIRCLE_LEAST_PX)
}

/// Returns the pixels of a mark that stands at one point, when that point lies in the plot.
fn point_mark(overlay: &Overlay, layout: &Layout) -> Option<Rectangle> {
    match overlay {
        Overlay::Circle { at, radius_m, .. } => {
            around(*at, radius_px(*radius_m, layout) + 2.0, layout)
        }
        Overlay::Find {
            at,
            covariance_m2: [xx, _, yy],
            ..
        } => {
            let radius_m = (CHI_SQUARED_90 * xx.max(*yy).max(0.0)).sqrt();
            let radius_px = layout.length_px(radius_m).min(ELLIPSE_MOST_PX) + 2.0;
            around(*at, radius_px.max(7.0), layout)
        }
        Overlay::Cross { at, .. } | Overlay::Home { at, .. } => around(*at, 7.0, layout),
        Overlay::Vehicle { at, .. } | Overlay::Viewpoint { at } => around(*at, 6.0, layout),
        Overlay::Outline { .. }
        | Overlay::Track { .. }
        | Overlay::Walk { .. }
        | Overlay::Direction { .. }
        | Overlay::Fence { .. }
        | Overlay::Area { .. } => None,
    }
}

/// Returns the pixels that labels shall not cover.
fn taken(overlay: &Overlay, layout: &Layout) -> Vec<Rectangle> {
    match overlay {
        Overlay::Outline { polygon, .. } => polygon
            .edges()
            .flat_map(|edge| along(edge, layout))
            .take(OUTLINE_MOST)
            .collect(),
        Overlay::Circle { .. }
        | Overlay::Cross { .. }
        | Overlay::Find { .. }
        | Overlay::Vehicle { .. }
        | Overlay::Viewpoint { .. }
        | Overlay::Home { .. } => point_mark(overlay, layout).into_iter().collect(),
        Overlay::Track { .. }
        | Overlay::Walk { .. }
        | Overlay::Direction { .. }
        | Overlay::Fence { .. }
        | Overlay::Area { .. } => Vec::new(),
    }
}

/// Returns small squares along an edge, at most a few pixels apart on edges no longer than the plot.
fn along(edge: Segment, layout: &Layout) -> impl Iterator<Item = Rectangle> {
    let pieces = (layout.length_px(edge.length_m()) / 6.0).clamp(1.0, 150.0) as i32;
    (0..=pieces).filter_map(move |i| {
        around(
            edge.from.toward(edge.to, f64::from(i) / f64::from(pieces)),
            3.0,
            layout,
        )
    })
}

fn around(point: Point, radius_px: f64, layout: &Layout) -> Option<Rectangle> {
    let At { x_px, y_px } = layout.place(point);
    // A circle larger than the plot has no place beside it anyway; the bound keeps pixel sums within i32.
    let radius_px = radius_px.min(2000.0);
    let corner = Pixel::new((x_px - radius_px) as i32, (y_px - radius_px) as i32);
    let side_px = (2.0 * radius_px) as u32;
    let shown = layout.plot.contains(Pixel::new(x_px as i32, y_px as i32)) && point.is_finite();
    shown.then(|| Rectangle::new(corner, Size::new(side_px, side_px)))
}

fn label(labels: &mut Labels, layout: &Layout, theme: &Theme, overlay: &Overlay) {
    let Some(text) = overlay.label() else {
        return;
    };
    let colour = overlay.mark().pen(theme).colour;
    if let Some(rectangle) = point_mark(overlay, layout) {
        labels.place(rectangle, &text, colour, true);
    }
    if let Overlay::Outline { polygon, .. } = overlay
        && let Some(edge) = polygon
            .edges()
            .max_by(|a, b| a.length_m().total_cmp(&b.length_m()))
        && let Some(rectangle) = around(edge.from.toward(edge.to, 0.5), 1.0, layout)
    {
        let vector = edge.to - edge.from;
        labels.place(
            rectangle,
            &text,
            colour,
            vector.y_m.abs() > vector.x_m.abs(),
        );
    }
}
