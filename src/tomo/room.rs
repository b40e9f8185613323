//! How much room what stood in the empty sweep leaves for a change: nobody walks into a wall.
//!
//! ```text
//!   D = 1 / (1 + (x / x₀)²)        x = the image of the empty sweep,  x₀ = 1.5 deviations of its prior
//! ```
//!
//! The covariance C of a change becomes D C D. Without it links that graze a wall put their mismatch between the sweeps
//! into it, since their loss changes steeply with the place of their ends. That a person stands somewhere is as likely as a
//! change's variance is large there: D².

use super::Image;
use super::settings::ImagingSettings;
use crate::geom::Point;

/// Structure this many prior deviations strong leaves half of the room for a change.
const SOLID_SD: f64 = 1.5;

/// Returns D per pixel of an image of the empty sweep: 1 = free, near 0 = solid.
pub(super) fn room_for_change(structure: &Image) -> Vec<f64> {
    let half_db_per_m = half_db_per_m(structure);
    let room = |value: &f64| room_of(*value, half_db_per_m);
    structure.values.iter().map(room).collect()
}

/// Returns D at a place; 1 beside the image.
pub(super) fn room_at(structure: &Image, at: Point) -> f64 {
    let pixel = structure.grid.pixel_at(at);
    pixel.map_or(1.0, |pixel| {
        room_of(structure.values[pixel], half_db_per_m(structure))
    })
}

/// x₀.
fn half_db_per_m(structure: &Image) -> f64 {
    SOLID_SD
        * ImagingSettings::prior_for(structure.grid.area)
            .variance
            .sqrt()
}

fn room_of(value: f64, half_db_per_m: f64) -> f64 {
    let share = value.max(0.0) / half_db_per_m;
    1.0 / (1.0 + share * share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{PixelGrid, Rect};

    #[test]
    fn what_is_solid_leaves_no_room_and_what_is_free_leaves_all() {
        let grid = PixelGrid {
            area: Rect::new(Point::new(0.0, 0.0), Point::new(20.0, 10.0)),
            columns: 4,
            rows: 2,
        };
        let mut structure = Image::zeros(grid);
        let half = half_db_per_m(&structure);
        structure.values[0] = half;
        structure.values[5] = 10.0 * half;
        structure.values[7] = -half;
        let room = room_for_change(&structure);
        assert!((room[0] - 0.5).abs() < 1e-12, "{}", room[0]);
        assert!((room[5] - 1.0 / 101.0).abs() < 1e-12, "{}", room[5]);
        assert_eq!((room[1], room[7]), (1.0, 1.0));
        for (pixel, room) in room.iter().enumerate() {
            assert_eq!(room_at(&structure, grid.centre(pixel)), *room);
        }
        assert_eq!(room_at(&structure, Point::new(-1.0, 3.0)), 1.0);
    }
}
