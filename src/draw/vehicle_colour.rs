//! Colours of vehicles, one table for all pictures and for the terminal: a vehicle has the same colour wherever it is
//! drawn.
//!
//! The colours differ in lightness as well as in hue, so that they are told apart by colour-blind eyes too, and read on
//! white, on grey and on the dark end of the colour map. Deliberately absent: more than eight of them; a ninth vehicle
//! has the first one's, and its number beside it.

use tomoswarm_proto::VehicleId;

/// A vehicle's colour.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct VehicleColour {
    /// Red, green and blue (sRGB, 0 to 255).
    pub rgb: [u8; 3],
    /// The one like it of the 256 that terminals have.
    pub terminal: u8,
    /// A paler one of those 256, for its track.
    pub terminal_track: u8,
}

const fn colour(rgb: [u8; 3], terminal: u8, terminal_track: u8) -> VehicleColour {
    VehicleColour {
        rgb,
        terminal,
        terminal_track,
    }
}

/// Found by a search that made the least difference of two as large as it could be (OKLab distance, as seen by normal
/// eyes and with protanopia, deuteranopia and tritanopia after Machado, Oliveira & Fernandes 2009), the first ones
/// counting most.
const COLOURS: [VehicleColour; 8] = [
    colour([16, 120, 225], 32, 111),   // blue
    colour([222, 134, 0], 172, 180),   // orange
    colour([26, 180, 167], 37, 116),   // teal
    colour([70, 107, 48], 58, 143),    // moss
    colour([154, 151, 250], 141, 189), // lavender
    colour([133, 109, 135], 96, 146),  // mauve
    colour([152, 55, 168], 127, 175),  // purple
    colour([161, 128, 102], 137, 181), // tan
];

/// Returns the colour of a vehicle.
pub fn vehicle_colour(vehicle: VehicleId) -> VehicleColour {
    COLOURS[place_of(vehicle)]
}

/// Returns which of the colours a vehicle has; vehicle 1 the first.
pub(super) fn place_of(vehicle: VehicleId) -> usize {
    (usize::from(vehicle.0) + COLOURS.len() - 1) % COLOURS.len()
}

/// Returns the colour at a place of the table.
pub(super) fn rgb_at(place: usize) -> [u8; 3] {
    COLOURS[place % COLOURS.len()].rgb
}

#[cfg(test)]
mod tests {
    use super::*;

    type Matrix = [[f64; 3]; 3];

    /// How colours are seen, in linear RGB (Machado et al. 2009, severity 1): normal, without red, without green cones.
    const EYES: [Matrix; 3] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [
            [0.152_286, 1.052_583, -0.204_868],
            [0.114_503, 0.786_281, 0.099_216],
            [-0.003_882, -0.048_116, 1.051_998],
        ],
        [
            [0.367_322, 0.860_646, -0.227_968],
            [0.280_085, 0.672_501, 0.047_413],
            [-0.011_820, 0.042_940, 0.968_881],
        ],
    ];
    /// Linear RGB to cones, and their cube roots to OKLab (Ottosson 2020).
    const CONES: Matrix = [
        [0.412_221, 0.536_333, 0.051_446],
        [0.211_903, 0.680_700, 0.107_397],
        [0.088_302, 0.281_719, 0.629_979],
    ];
    const LAB: Matrix = [
        [0.210_454, 0.793_618, -0.004_072],
        [1.977_998, -2.428_592, 0.450_594],
        [0.025_904, 0.782_772, -0.808_676],
    ];

    fn times(matrix: &Matrix, vector: [f64; 3]) -> [f64; 3] {
        matrix.map(|row| (0..3).map(|i| row[i] * vector[i]).sum())
    }

    fn linear(rgb: [u8; 3]) -> [f64; 3] {
        rgb.map(|channel| {
            let share = f64::from(channel) / 255.0;
            if share <= 0.04045 {
                share / 12.92
            } else {
                libm::pow((share + 0.055) / 1.055, 2.4)
            }
        })
    }

    /// The distance of two colours in OKLab for the eyes that see the least of it; black and white are 1 apart.
    fn distance(one: [u8; 3], other: [u8; 3]) -> f64 {
        let lab = |eye: &Matrix, rgb: [u8; 3]| {
            let seen = times(eye, linear(rgb)).map(|channel| channel.clamp(0.0, 1.0));
            times(&LAB, times(&CONES, seen).map(libm::cbrt))
        };
        let of_eye = |eye: &Matrix| {
            let (a, b) = (lab(eye, one), lab(eye, other));
            (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
        };
        EYES.iter().map(of_eye).fold(f64::INFINITY, f64::min)
    }

    /// The contrast ratio of two colours (WCAG 2), 1 to 21.
    fn contrast(one: [u8; 3], other: [u8; 3]) -> f64 {
        let luminance = |rgb| {
            let [red, green, blue] = linear(rgb);
            0.2126 * red + 0.7152 * green + 0.0722 * blue + 0.05
        };
        let (a, b) = (luminance(one), luminance(other));
        a.max(b) / a.min(b)
    }

    /// What a number from 16 to 231 of a terminal's 256 colours looks like.
    fn of_terminal(number: u8) -> [u8; 3] {
        let levels = [0, 95, 135, 175, 215, 255];
        let place = usize::from(number - 16);
        [place / 36, place / 6 % 6, place % 6].map(|level| levels[level])
    }

    fn pairs() -> impl Iterator<Item = (usize, usize)> {
        (0..COLOURS.len()).flat_map(|late| (0..late).map(move |early| (early, late)))
    }

    #[test]
    fn every_vehicle_is_told_apart_also_by_colour_blind_eyes() {
        for (early, late) in pairs() {
            let apart = distance(COLOURS[early].rgb, COLOURS[late].rgb);
            let least = if late < 4 { 0.15 } else { 0.09 };
            assert!(apart > least, "{} and {}: {apart:.3}", early + 1, late + 1);
        }
    }

    #[test]
    fn every_vehicle_reads_on_white_and_on_black() {
        for (place, colour) in COLOURS.iter().enumerate() {
            for ground in [[255, 255, 255], [10, 8, 30], [34, 34, 40]] {
                let ratio = contrast(colour.rgb, ground);
                assert!(ratio > 2.5, "{} on {ground:?}: {ratio:.2}", place + 1);
            }
        }
    }

    #[test]
    fn a_terminal_shows_the_same_colours_and_no_two_alike() {
        for (place, colour) in COLOURS.iter().enumerate() {
            let off = distance(colour.rgb, of_terminal(colour.terminal));
            assert!(off < 0.08, "{}: {off:.3}", place + 1);
        }
        for (early, late) in pairs() {
            let (a, b) = (COLOURS[early], COLOURS[late]);
            for (one, other) in [
                (a.terminal, b.terminal),
                (a.terminal_track, b.terminal_track),
                (a.terminal, b.terminal_track),
                (a.terminal_track, b.terminal),
            ] {
                let apart = distance(of_terminal(one), of_terminal(other));
                assert!(apart > 0.04, "{one} and {other}: {apart:.3}");
            }
        }
    }

    #[test]
    fn vehicle_1_has_the_first_colour_and_vehicle_9_again() {
        assert_eq!(vehicle_colour(VehicleId(1)), COLOURS[0]);
        assert_eq!(vehicle_colour(VehicleId(8)), COLOURS[7]);
        assert_eq!(vehicle_colour(VehicleId(9)), COLOURS[0]);
        assert_eq!(vehicle_colour(VehicleId(0)), COLOURS[7]);
        assert_eq!(vehicle_colour(VehicleId(255)), COLOURS[6]);
    }
}
