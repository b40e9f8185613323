//! Tracks of vehicles: where several lie upon each other they take turns, patch by patch, so that each stays visible and
//! in its place.
//!
//! Deliberately absent: what else lies over a plot.

use std::collections::BTreeMap;

use embedded_graphics::geometry::{Point, Size};
use embedded_graphics::primitives::{PointsIter, Rectangle};

use super::colour::Theme;
use super::layout::Layout;
use super::overlay::{Mark, Overlay};
use super::paint;
use super::raster::Picture;
use super::stroke::Sheet;

/// Side of a patch, pixels.
const PATCH: u32 = 6;
/// A pixel that tracks cover by more than this, of 255, is theirs in turns.
const HALF: u8 = 127;

/// Draws all tracks.
pub(super) fn draw(picture: &mut Picture, layout: &Layout, theme: &Theme, overlays: &[Overlay]) {
    let mut rims = Sheet::new(layout.plot);
    let mut sheets: BTreeMap<Mark, Sheet> = BTreeMap::new();
    for overlay in overlays {
        let mark = overlay.mark();
        let Mark::Track(_) = mark else { continue };
        let sheet = sheets
            .entry(mark)
            .or_insert_with(|| Sheet::new(layout.plot));
        for path in paint::paths(overlay, layout) {
            rims.cover(&path, paint::rim(mark, theme));
            sheet.cover(&path, mark.pen(theme));
        }
    }
    rims.lay(picture, paint::rim(Mark::Track(None), theme));
    let mut turns = Turns::default();
    for patch in patches(layout.plot) {
        for (sharing, pixels) in shared(patch, &sheets) {
            let mark = turns.next(sharing, pixels.len());
            for at in pixels {
                let cover = sheets.get(&mark).map_or(0, |sheet| sheet.cover_of(at));
                picture.lay(at, mark.pen(theme).colour, f64::from(cover) / 255.0);
            }
        }
    }
}

/// Returns the patches of a plot, row by row.
fn patches(plot: Rectangle) -> impl Iterator<Item = Rectangle> {
    let counts = Size::new(
        plot.size.width.div_ceil(PATCH),
        plot.size.height.div_ceil(PATCH),
    );
    Rectangle::new(Point::zero(), counts)
        .points()
        .map(move |index| {
            let corner = plot.top_left + index * PATCH as i32;
            Rectangle::new(corner, Size::new_equal(PATCH)).intersection(&plot)
        })
}

/// Returns the covered pixels of a patch by the tracks that share them; an edge is the track's that covers most of it.
fn shared(patch: Rectangle, sheets: &BTreeMap<Mark, Sheet>) -> BTreeMap<Vec<Mark>, Vec<Point>> {
    let mut shared: BTreeMap<Vec<Mark>, Vec<Point>> = BTreeMap::new();
    for at in patch.points() {
        let covers = sheets
            .iter()
            .map(|(mark, sheet)| (*mark, sheet.cover_of(at)))
            .filter(|(_, cover)| *cover > 0);
        let Some((most, cover)) = covers.clone().max_by_key(|(_, cover)| *cover) else {
            continue;
        };
        let sharing = if cover > HALF {
            covers
                .filter(|(_, cover)| *cover > HALF)
                .map(|(mark, _)| mark)
                .collect()
        } else {
            vec![most]
        };
        shared.entry(sharing).or_default().push(at);
    }
    shared
}

/// Whose turn it is: for each set of tracks that share pixels, how many each of them has had.
#[derive(Default)]
struct Turns {
    had: BTreeMap<Vec<Mark>, Vec<usize>>,
}

impl Turns {
    /// Returns which track has the next pixels that some share: the one that has had the fewest.
    fn next(&mut self, sharing: Vec<Mark>, pixels: usize) -> Mark {
        let marks = sharing.clone();
        let had = self
            .had
            .entry(sharing)
            .or_insert_with(|| vec![0; marks.len()]);
        let turn = had.iter_mut().zip(marks).min_by_key(|(had, _)| **had);
        turn.map_or(Mark::Track(None), |(had, mark)| {
            *had += pixels;
            mark
        })
    }
}
