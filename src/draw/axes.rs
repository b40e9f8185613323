//! Frame, ticks, axis names and title.

use embedded_graphics::geometry::{Point, Size};
use embedded_graphics::primitives::Rectangle;

use super::colour::INK;
use super::layout::Layout;
use super::raster::Picture;
use super::text::{LARGE, SMALL, short, width_px, write, write_upward};

const TICK_PX: i32 = 6;

/// Draws frame, ticks, names and title around a plot of the plane.
pub(super) fn draw(picture: &mut Picture, layout: &Layout, title: &str, length_unit: &str) {
    let names = ["x", "y"].map(|axis| format!("{axis} ({length_unit})"));
    draw_named(picture, layout, title, [&names[0], &names[1]]);
}

/// Draws them around any plot, with the names of its axes.
pub(super) fn draw_named(picture: &mut Picture, layout: &Layout, title: &str, names: [&str; 2]) {
    picture.frame(layout.plot, INK);
    let Rectangle { top_left, size } = layout.plot;
    let (left, top) = (top_left.x, top_left.y);
    let (width, height) = (size.width as i32, size.height as i32);
    along_x(picture, layout, top + height);
    along_y(picture, layout, left);
    let line_px = SMALL.character_size.height as i32;
    let [name, upward] = names;
    let x = left + (width - width_px(name, SMALL) as i32) / 2;
    write(
        picture,
        name,
        Point::new(x, top + height + TICK_PX + line_px + 6),
        SMALL,
        INK,
    );
    let y = top + (height + width_px(upward, SMALL) as i32) / 2;
    let labels_px = layout
        .y_ticks
        .iter()
        .map(|tick| width_px(&tick.label, SMALL))
        .max()
        .unwrap_or(0) as i32;
    write_upward(
        picture,
        upward,
        Point::new(left - TICK_PX - 12 - labels_px - line_px, y),
        SMALL,
        INK,
    );
    heading(picture, layout, title);
}

fn along_x(picture: &mut Picture, layout: &Layout, bottom: i32) {
    let mut free_from = i32::MIN;
    for tick in &layout.x_ticks {
        let x = libm::floor(layout.x_px(tick.value)) as i32;
        picture.fill(
            Rectangle::new(Point::new(x, bottom + 1), Size::new(1, TICK_PX as u32)),
            INK,
        );
        let width = width_px(&tick.label, SMALL) as i32;
        // Long numbers may be wider than the distance of the ticks: then every other one is written.
        if x - width / 2 >= free_from {
            write(
                picture,
                &tick.label,
                Point::new(x - width / 2, bottom + TICK_PX + 3),
                SMALL,
                INK,
            );
            free_from = x - width / 2 + width + 6;
        }
    }
}

fn along_y(picture: &mut Picture, layout: &Layout, left: i32) {
    for tick in &layout.y_ticks {
        let y = libm::floor(layout.y_px(tick.value)) as i32;
        picture.fill(
            Rectangle::new(
                Point::new(left - 1 - TICK_PX, y),
                Size::new(TICK_PX as u32, 1),
            ),
            INK,
        );
        let x = left - TICK_PX - 4 - width_px(&tick.label, SMALL) as i32;
        write(picture, &tick.label, Point::new(x, y - 7), SMALL, INK);
    }
}

/// Writes the title over the plot, moved left when it would leave the picture, smaller or cut when it is too long.
fn heading(picture: &mut Picture, layout: &Layout, title: &str) {
    let room_px = layout.size.width - 24;
    let title = short(title, (room_px / 7) as usize);
    let font = if width_px(&title, LARGE) <= room_px {
        LARGE
    } else {
        SMALL
    };
    let (left, width) = (layout.plot.top_left.x, width_px(&title, font) as i32);
    let x = left.min(layout.size.width as i32 - 12 - width).max(12);
    write(picture, &title, Point::new(x, 12), font, INK);
}
