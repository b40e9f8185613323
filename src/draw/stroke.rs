//! Smooth lines: coverage is gathered on a sheet and laid over the picture once, so that a track that runs over itself
//! many times does not grow darker.
//!
//! Deliberately absent: joins and caps other than round ones.

use embedded_graphics::geometry::Point;
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::primitives::Rectangle;

use super::raster::Picture;

/// A place in the picture in pixels, x to the right, y down; pixel (i, j) covers i..i+1, j..j+1.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct At {
    pub(super) x_px: f64,
    pub(super) y_px: f64,
}

impl At {
    pub(super) const fn new(x_px: f64, y_px: f64) -> At {
        At { x_px, y_px }
    }

    pub(super) fn distance_px(self, other: At) -> f64 {
        let (dx, dy) = (other.x_px - self.x_px, other.y_px - self.y_px);
        (dx * dx + dy * dy).sqrt()
    }

    fn toward(self, other: At, share: f64) -> At {
        let along = |from: f64, to: f64| from + (to - from) * share;
        At::new(along(self.x_px, other.x_px), along(self.y_px, other.y_px))
    }

    fn is_finite(self) -> bool {
        self.x_px.is_finite() && self.y_px.is_finite()
    }
}

/// How a line looks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pen {
    pub(super) width_px: f64,
    pub(super) colour: Rgb888,
    pub(super) opacity: f64,
    /// Length of a dash and of the gap after it, pixels; both positive.
    pub(super) dash_px: Option<(f64, f64)>,
}

/// Coverage (0 to 255) of the pixels within a clip rectangle.
#[derive(Clone, Debug)]
pub(super) struct Sheet {
    clip: Rectangle,
    shares: Vec<u8>,
    /// First and last touched column and row, relative to the clip rectangle.
    touched: Option<[usize; 4]>,
}

impl Sheet {
    /// Makes an empty sheet; nothing is ever drawn outside `clip`.
    pub(super) fn new(clip: Rectangle) -> Sheet {
        let pixels = clip.size.width as usize * clip.size.height as usize;
        Sheet {
            clip,
            shares: vec![0; pixels],
            touched: None,
        }
    }

    /// Draws a path of straight pieces; one point alone becomes a disc. Pieces with a place that is not finite are
    /// left out.
    pub(super) fn path(&mut self, picture: &mut Picture, places: &[At], pen: Pen) {
        self.cover(places, pen);
        self.lay(picture, pen);
    }

    /// Gathers the coverage of a path, as [`Sheet::path`] draws it, upon what was gathered before.
    pub(super) fn cover(&mut self, places: &[At], pen: Pen) {
        let radius_px = pen.width_px / 2.0;
        if let [only] = places {
            self.piece(*only, *only, radius_px);
        }
        let mut run_px = 0.0;
        let mut from = places.first().copied();
        for to in places.iter().skip(1).copied() {
            let Some(start) = from.filter(|start| start.is_finite() && to.is_finite()) else {
                from = Some(to);
                continue;
            };
            // Steps far below a pixel are gathered; recorded tracks have thousands of them.
            if start.distance_px(to) < 0.4 && places.len() > 64 {
                continue;
            }
            if let Some((first, last)) = self.clipped(start, to, radius_px + 2.0) {
                match pen.dash_px {
                    Some(dash_px) => self.dashes(first, last, radius_px, dash_px, &mut run_px),
                    None => self.piece(first, last, radius_px),
                }
            }
            from = Some(to);
        }
    }

    /// Returns how much of a pixel is covered, 0 to 255.
    pub(super) fn cover_of(&self, at: Point) -> u8 {
        let Point { x, y } = at - self.clip.top_left;
        let place = usize::try_from(x).ok().zip(usize::try_from(y).ok());
        let width = self.clip.size.width as usize;
        let index = place.filter(|(column, _)| *column < width);
        index
            .and_then(|(column, row)| self.shares.get(row * width + column))
            .copied()
            .unwrap_or(0)
    }

    /// Covers a straight piece in dashes; `run_px` carries the pattern from piece to piece.
    fn dashes(
        &mut self,
        from: At,
        to: At,
        radius_px: f64,
        (on_px, off_px): (f64, f64),
        run_px: &mut f64,
    ) {
        let length_px = from.distance_px(to);
        let mut done_px = 0.0;
        while done_px < length_px {
            let phase_px = *run_px % (on_px + off_px);
            let on = phase_px < on_px;
            // At least a tenth of a pixel, so that rounding never holds the walk in place.
            let left_px = if on {
                on_px - phase_px
            } else {
                on_px + off_px - phase_px
            }
            .max(0.1);
            let next_px = (done_px + left_px).min(length_px);
            if on {
                let place = |at_px: f64| from.toward(to, at_px / length_px);
                self.piece(place(done_px), place(next_px), radius_px);
            }
            *run_px += next_px - done_px;
            done_px = next_px;
        }
    }

    /// Covers all pixels near a straight piece, with a soft rim one pixel wide.
    fn piece(&mut self, from: At, to: At, radius_px: f64) {
        let reach_px = radius_px + 1.0;
        let (left, top) = (
            f64::from(self.clip.top_left.x),
            f64::from(self.clip.top_left.y),
        );
        let (columns, rows) = (
            self.clip.size.width as usize,
            self.clip.size.height as usize,
        );
        let (low, high) = if from.y_px <= to.y_px {
            (from, to)
        } else {
            (to, from)
        };
        let height_px = high.y_px - low.y_px;
        for row in indices(low.y_px - reach_px - top, high.y_px + reach_px - top, rows) {
            let middle_px = top + row as f64 + 0.5;
            // Only the part of the piece near this row matters; a long slanting line stays cheap.
            let share = |y_px: f64| {
                if height_px > 1e-9 {
                    ((y_px - low.y_px) / height_px).clamp(0.0, 1.0)
                } else {
                    0.0
                }
            };
            let start = low.toward(high, share(middle_px - reach_px)).x_px;
            let end = if height_px > 1e-9 {
                low.toward(high, share(middle_px + reach_px)).x_px
            } else {
                high.x_px
            };
            let (west, east) = (
                start.min(end) - reach_px - left,
                start.max(end) + reach_px - left,
            );
            for column in indices(west, east, columns) {
                let distance_px =
                    distance_px(At::new(left + column as f64 + 0.5, middle_px), low, high);
                let share = (radius_px + 0.5 - distance_px).clamp(0.0, 1.0);
                self.cover_at(column, row, (share * 255.0) as u8);
            }
        }
    }

    fn cover_at(&mut self, column: usize, row: usize, cover: u8) {
        if cover == 0 {
            return;
        }
        let index = row * self.clip.size.width as usize + column;
        self.shares[index] = self.shares[index].max(cover);
        let [west, east, north, south] = self.touched.unwrap_or([column, column, row, row]);
        self.touched = Some([
            west.min(column),
            east.max(column),
            north.min(row),
            south.max(row),
        ]);
    }

    /// Lays what was gathered over the picture and empties the sheet.
    pub(super) fn lay(&mut self, picture: &mut Picture, pen: Pen) {
        let Some([west, east, north, south]) = self.touched.take() else {
            return;
        };
        for row in north..=south {
            for column in west..=east {
                let index = row * self.clip.size.width as usize + column;
                let cover = std::mem::take(&mut self.shares[index]);
                if cover > 0 {
                    let at = self.clip.top_left + Point::new(column as i32, row as i32);
                    picture.lay(at, pen.colour, pen.opacity * f64::from(cover) / 255.0);
                }
            }
        }
    }

    /// Cuts a piece to the clip rectangle grown by `margin_px` (Liang and Barsky 1984).
    fn clipped(&self, from: At, to: At, margin_px: f64) -> Option<(At, At)> {
        let (left, top) = (
            f64::from(self.clip.top_left.x),
            f64::from(self.clip.top_left.y),
        );
        let (width, height) = (
            f64::from(self.clip.size.width),
            f64::from(self.clip.size.height),
        );
        let mut shares = (0.0, 1.0);
        for (start, end, low, high) in [
            (from.x_px, to.x_px, left, left + width),
            (from.y_px, to.y_px, top, top + height),
        ] {
            let (low, high, length) = (low - margin_px, high + margin_px, end - start);
            if length == 0.0 && !(low..=high).contains(&start) {
                return None;
            }
            if length != 0.0 {
                let (a, b) = ((low - start) / length, (high - start) / length);
                shares = (a.min(b).max(shares.0), a.max(b).min(shares.1));
            }
        }
        (shares.0 <= shares.1).then(|| (from.toward(to, shares.0), from.toward(to, shares.1)))
    }
}

/// Returns the indices of 0..count between two bounds; none when the bounds are not finite.
fn indices(low: f64, high: f64, count: usize) -> std::ops::Range<usize> {
    // Casts of floats saturate, and turn what is no number into 0.
    let first = libm::floor(low).max(0.0) as usize;
    let end = (libm::floor(high).max(-1.0) + 1.0) as usize;
    first.min(count)..end.min(count)
}

fn distance_px(place: At, from: At, to: At) -> f64 {
    let (dx, dy) = (to.x_px - from.x_px, to.y_px - from.y_px);
    let squared = dx * dx + dy * dy;
    if squared < 1e-18 {
        return place.distance_px(from);
    }
    let share = ((place.x_px - from.x_px) * dx + (place.y_px - from.y_px) * dy) / squared;
    place.distance_px(from.toward(to, share.clamp(0.0, 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_graphics::geometry::{OriginDimensions, Size};
    use embedded_graphics::pixelcolor::RgbColor;

    const PEN: Pen = Pen {
        width_px: 2.0,
        colour: Rgb888::BLACK,
        opacity: 1.0,
        dash_px: None,
    };

    /// Draws on 40 x 30 white pixels, of which only 5..35 x 5..25 may be touched; returns the darkness of each pixel.
    fn darkness(places: &[At], pen: Pen) -> Vec<u8> {
        let mut picture = Picture::new(Size::new(40, 30), Rgb888::WHITE);
        Sheet::new(Rectangle::new(Point::new(5, 5), Size::new(30, 20))).path(
            &mut picture,
            places,
            pen,
        );
        assert_eq!(picture.size(), Size::new(40, 30));
        let pixel = |i: i32| {
            picture
                .colour_at(Point::new(i % 40, i / 40))
                .map_or(0, |colour| 255 - colour.r())
        };
        (0..1200).map(pixel).collect()
    }

    #[test]
    fn a_line_covers_its_own_width_times_length() {
        let sum = |to: At| {
            let dark = darkness(&[At::new(10.0, 10.0), to], PEN);
            dark.iter().map(|shade| f64::from(*shade)).sum::<f64>() / 255.0
        };
        // Round ends add a disc of radius 1.
        for to in [
            At::new(30.0, 10.0),
            At::new(10.0, 20.0),
            At::new(28.0, 21.0),
            At::new(12.0, 23.0),
        ] {
            let expected = 2.0 * At::new(10.0, 10.0).distance_px(to) + std::f64::consts::PI;
            assert!(
                (sum(to) - expected).abs() < 0.08 * expected,
                "{} {expected}",
                sum(to)
            );
        }
    }

    #[test]
    fn nothing_is_drawn_outside_the_clip_rectangle() {
        let far = [
            At::new(-1e12, 15.0),
            At::new(1e12, 15.5),
            At::new(3.0, -1e300),
            At::new(20.0, 1e300),
        ];
        let dark = darkness(&far, PEN);
        let outside = |i: usize| !(5..35).contains(&(i % 40)) || !(5..25).contains(&(i / 40));
        assert!(
            dark.iter()
                .enumerate()
                .all(|(i, shade)| *shade == 0 || !outside(i))
        );
        assert!(dark[15 * 40 + 20] > 200);
    }

    #[test]
    fn a_line_drawn_twice_is_no_darker() {
        let pen = Pen {
            opacity: 0.4,
            ..PEN
        };
        let (a, b) = (At::new(10.0, 10.0), At::new(30.0, 20.0));
        assert_eq!(darkness(&[a, b], pen), darkness(&[a, b, a, b], pen));
    }

    #[test]
    fn dashes_leave_gaps_and_odd_places_are_left_out() {
        let pen = Pen {
            dash_px: Some((5.0, 5.0)),
            width_px: 1.0,
            ..PEN
        };
        let dark = darkness(&[At::new(5.0, 10.5), At::new(35.0, 10.5)], pen);
        assert!(dark[10 * 40 + 7] == 255 && dark[10 * 40 + 12] == 0 && dark[10 * 40 + 17] == 255);
        let odd = [
            At::new(f64::NAN, 1.0),
            At::new(10.0, f64::INFINITY),
            At::new(10.0, 10.0),
        ];
        assert!(darkness(&odd, PEN).iter().all(|shade| *shade == 0));
        assert!(darkness(&[], PEN).iter().all(|shade| *shade == 0));
    }
}
