//! What a set of links promises and costs: the two objectives by which the original's planner judged plans, both the
//! smaller the better.
//!
//! Coverage counts in how many ellipses of links every pixel lies; effort mixes the length of the links with that of
//! the vehicles' ways, which the caller knows. Nothing is known here of obstacles or order.

use super::snap_to_boundary;
use crate::geom::{PixelGrid, Segment};

/// How a set of links is judged.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct LinkSetQuality {
    /// Pairs of a link and a pixel in its ellipse.
    pub incidences: usize,
    /// Pixels in no link's ellipse.
    pub uncovered_pixels: usize,
    /// Links that do not cross the area.
    pub unsnappable: usize,
    /// Length of all links between the places of measurement (not only inside the area), metres.
    pub links_length_m: f64,
}

impl LinkSetQuality {
    /// Judges links over a grid of pixels: each is snapped to the border of the grid's area, and weighs on pixels
    /// whose middle makes its way longer by less than `width_m`.
    pub fn of(
        links: &[Segment],
        grid: &PixelGrid,
        width_m: f64,
        snap_inside: bool,
    ) -> LinkSetQuality {
        let mut is_covered = vec![false; grid.len()];
        let mut quality = LinkSetQuality::default();
        for link in links {
            quality.links_length_m += link.length_m();
            let Some(part) = snap_to_boundary(grid.area, *link, snap_inside) else {
                quality.unsnappable += 1;
                continue;
            };
            for (pixel, covered) in is_covered.iter_mut().enumerate() {
                if part.excess_path_m(grid.centre(pixel)) < width_m {
                    *covered = true;
                    quality.incidences += 1;
                }
            }
        }
        quality.uncovered_pixels = is_covered.iter().filter(|covered| !**covered).count();
        quality
    }

    /// Returns the first objective: the more often pixels are seen, the smaller.
    pub fn coverage(&self) -> f64 {
        -(self.incidences as f64)
    }

    /// Returns the second objective: `share` (0 to 1) of the links' length and the rest of the vehicles' ways, metres.
    pub fn effort_m(&self, travel_m: f64, share: f64) -> f64 {
        share * self.links_length_m + (1.0 - share) * travel_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Point, Rect};

    fn link(x0: f64, y0: f64, x1: f64, y1: f64) -> Segment {
        Segment::new(Point::new(x0, y0), Point::new(x1, y1))
    }

    fn grid() -> PixelGrid {
        PixelGrid {
            area: Rect::new(Point::new(1.0, 1.0), Point::new(5.0, 5.0)),
            columns: 4,
            rows: 4,
        }
    }

    #[test]
    fn a_link_along_a_row_of_pixels_sees_that_row() {
        let quality = LinkSetQuality::of(&[link(0.0, 2.5, 6.0, 2.5)], &grid(), 0.2, false);
        let expected = LinkSetQuality {
            incidences: 4,
            uncovered_pixels: 12,
            unsnappable: 0,
            links_length_m: 6.0,
        };
        assert_eq!(quality, expected);
        assert_eq!(
            (quality.coverage(), quality.effort_m(10.0, 0.75)),
            (-4.0, 7.0)
        );
    }

    #[test]
    fn a_link_beside_the_area_is_counted_as_such() {
        let links = [link(0.0, 0.5, 6.0, 0.5), link(2.0, 2.5, 6.0, 2.5)];
        assert_eq!(
            LinkSetQuality::of(&links, &grid(), 0.2, false).unsnappable,
            2
        );
        assert_eq!(
            LinkSetQuality::of(&links, &grid(), 0.2, true).unsnappable,
            1
        );
        assert_eq!(
            LinkSetQuality::of(&[], &grid(), 0.2, true).uncovered_pixels,
            16
        );
    }
}
