//! A link as a QR code of block characters, for the camera of a phone in front of a terminal.

use qrcode::render::unicode::Dense1x2;
use qrcode::{EcLevel, QrCode};

/// Returns a text as a QR code, two rows of modules to a line, with the rim that readers want. What is light in it is
/// drawn, as most terminals are dark. `None` when the text is too long for one.
pub(super) fn qr_text(text: &str) -> Option<String> {
    let code = QrCode::with_error_correction_level(text, EcLevel::L).ok()?;
    // `Dark` is what is drawn, a block.
    let drawn = code
        .render::<Dense1x2>()
        .dark_color(Dense1x2::Light)
        .light_color(Dense1x2::Dark)
        .build();
    Some(drawn + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads a drawn code as a camera would: eight by eight points to a module.
    fn read(drawn: &str) -> Option<String> {
        const POINTS: usize = 8;
        let modules: Vec<Vec<bool>> = drawn
            .lines()
            .flat_map(|line| {
                let row = |is_lower: bool| {
                    let is_light = move |block: char| match block {
                        '█' => true,
                        '▀' => !is_lower,
                        '▄' => is_lower,
                        _ => false,
                    };
                    line.chars().map(is_light).collect()
                };
                [row(false), row(true)]
            })
            .collect();
        let (width, height) = (modules[0].len(), modules.len());
        let level = |x: usize, y: usize| match modules[y / POINTS][x / POINTS] {
            true => 255,
            false => 0,
        };
        let (width, height) = (width * POINTS, height * POINTS);
        let mut image = rqrr::PreparedImage::prepare_from_greyscale(width, height, level);
        let (_, text) = image.detect_grids().first()?.decode().ok()?;
        Some(text)
    }

    #[test]
    fn a_reader_reads_the_link_again() {
        let link = "https://192.168.178.104:8377/#operate=0123456789abcdef0123456789abcdef";
        let drawn = qr_text(link).unwrap();
        assert_eq!(read(&drawn).as_deref(), Some(link));
        assert!(drawn.lines().count() < 25, "{drawn}");
        let long = "x".repeat(4000);
        assert_eq!(qr_text(&long), None);
    }
}
