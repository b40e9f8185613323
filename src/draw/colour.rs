//! Colours: the map from values to colours, and one theme for dark and one for light plots.
//!
//! The colour map runs from near-black violet over red and orange to pale yellow. Its anchors are ours; the way
//! between them is walked so that CIE lightness L* grows in equal steps, hence equal differences of value look equal
//! and the picture survives grey printing.

use embedded_graphics::pixelcolor::{Rgb888, RgbColor};

/// Colours through which the map passes, dark to light.
const ANCHORS: [[u8; 3]; 9] = [
    [10, 8, 30],
    [45, 20, 95],
    [95, 25, 120],
    [150, 40, 115],
    [205, 65, 85],
    [240, 110, 60],
    [250, 165, 70],
    [252, 215, 120],
    [255, 252, 210],
];

const LEVELS: usize = 256;

/// The colour of a value that is no finite number; it does not occur in the colour map.
pub(super) const NOT_FINITE: Rgb888 = Rgb888::new(0, 160, 150);

/// The picture's paper.
pub(super) const PAPER: Rgb888 = Rgb888::new(255, 255, 255);

/// Text and axes.
pub(super) const INK: Rgb888 = Rgb888::new(32, 32, 38);

/// A table of colours, growing in lightness.
#[derive(Clone, Debug)]
pub(super) struct ColourMap {
    levels: Vec<Rgb888>,
}

impl ColourMap {
    /// Builds the table from the anchors.
    pub(super) fn new() -> ColourMap {
        let (dark, light) = (
            lightness(ANCHORS[0].map(f64::from)),
            lightness(ANCHORS[8].map(f64::from)),
        );
        let target = |level: usize| dark + (light - dark) * level as f64 / (LEVELS - 1) as f64;
        ColourMap {
            levels: (0..LEVELS)
                .map(|level| of_lightness(target(level)))
                .collect(),
        }
    }

    /// Returns all colours, dark to light.
    pub(super) fn levels(&self) -> Vec<[u8; 3]> {
        let rgb = |colour: &Rgb888| [colour.r(), colour.g(), colour.b()];
        self.levels.iter().map(rgb).collect()
    }

    /// Returns the colour for a share of the range; shares outside 0..1 take the nearest end.
    pub(super) fn at(&self, share: f64) -> Rgb888 {
        // A share that is not a number (a range too wide for f64) becomes level 0 by the cast.
        let level = (share.clamp(0.0, 1.0) * (LEVELS - 1) as f64 + 0.5) as usize;
        self.levels[level.min(LEVELS - 1)]
    }
}

/// Returns the colour on the way through the anchors that has a lightness L*.
fn of_lightness(target: f64) -> Rgb888 {
    let next = (1..ANCHORS.len() - 1).find(|i| lightness(ANCHORS[*i].map(f64::from)) >= target);
    let next = next.unwrap_or(ANCHORS.len() - 1);
    let (from, to) = (
        ANCHORS[next - 1].map(f64::from),
        ANCHORS[next].map(f64::from),
    );
    let mixed = |share: f64| [0, 1, 2].map(|i| from[i] + (to[i] - from[i]) * share);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..24 {
        let middle = (low + high) / 2.0;
        if lightness(mixed(middle)) < target {
            low = middle;
        } else {
            high = middle;
        }
    }
    let [red, green, blue] = mixed(high).map(|channel| libm::round(channel) as u8);
    Rgb888::new(red, green, blue)
}

/// Returns CIE lightness L* (0 to 100) of an sRGB colour with channels 0 to 255 (IEC 61966-2-1, CIE 15).
fn lightness(srgb: [f64; 3]) -> f64 {
    let linear = srgb.map(|channel| {
        let share = channel / 255.0;
        if share <= 0.04045 {
            share / 12.92
        } else {
            libm::pow((share + 0.055) / 1.055, 2.4)
        }
    });
    let luminance = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
    if luminance <= 216.0 / 24389.0 {
        luminance * 24389.0 / 27.0
    } else {
        116.0 * libm::cbrt(luminance) - 16.0
    }
}

/// Returns a mixture of two colours; share 0 is `under`, 1 is `over`.
pub(super) fn mix(under: Rgb888, over: Rgb888, share: f64) -> Rgb888 {
    let channel = |a: u8, b: u8| {
        libm::round(f64::from(a) + (f64::from(b) - f64::from(a)) * share.clamp(0.0, 1.0)) as u8
    };
    Rgb888::new(
        channel(under.r(), over.r()),
        channel(under.g(), over.g()),
        channel(under.b(), over.b()),
    )
}

/// The colours of everything laid over a plot, chosen against its ground.
#[derive(Debug)]
pub(super) struct Theme {
    /// The plot where nothing is imaged.
    pub(super) ground: Rgb888,
    /// A rim under lines and text, so that they read on any value.
    pub(super) casing: Rgb888,
    /// What is truly there.
    pub(super) truth: Rgb888,
    /// What was found.
    pub(super) found: Rgb888,
    /// What has no colour of its own: places to look from, and samples that stand for all vehicles.
    pub(super) neutral: Rgb888,
    /// Fence and border of the area.
    pub(super) border: Rgb888,
}

/// For heat maps, whose low values are dark.
pub(super) static DARK: Theme = Theme {
    ground: Rgb888::new(66, 66, 74),
    casing: Rgb888::new(0, 0, 0),
    truth: Rgb888::new(255, 255, 255),
    found: Rgb888::new(70, 255, 130),
    neutral: Rgb888::new(225, 225, 230),
    border: Rgb888::new(200, 200, 208),
};

/// For occupancy maps, whose free cells are white.
pub(super) static LIGHT: Theme = Theme {
    ground: Rgb888::new(196, 198, 204),
    casing: Rgb888::new(255, 255, 255),
    truth: Rgb888::new(200, 30, 40),
    found: Rgb888::new(0, 130, 60),
    neutral: Rgb888::new(70, 70, 80),
    border: Rgb888::new(84, 84, 96),
};

#[cfg(test)]
mod tests {
    use super::*;

    fn lightness_of(colour: Rgb888) -> f64 {
        lightness([colour.r(), colour.g(), colour.b()].map(f64::from))
    }

    #[test]
    fn lightness_agrees_with_published_values() {
        // White, mid grey and pure red as tabulated for sRGB (D65).
        assert!((lightness([255.0; 3]) - 100.0).abs() < 0.01);
        assert!((lightness([119.0; 3]) - 50.03).abs() < 0.05);
        assert!((lightness([255.0, 0.0, 0.0]) - 53.24).abs() < 0.05);
    }

    #[test]
    fn the_colour_map_grows_in_lightness_in_equal_steps() {
        let map = ColourMap::new();
        let shades: Vec<f64> = (0..=64)
            .map(|i| lightness_of(map.at(f64::from(i) / 64.0)))
            .collect();
        let equal = (shades[64] - shades[0]) / 64.0;
        assert!(shades[0] < 5.0 && shades[64] > 95.0);
        for pair in shades.windows(2) {
            assert!((pair[1] - pair[0] - equal).abs() < 0.6, "{pair:?}");
        }
        // Between neighbours of the full table rounding to 8 bits may cost a little, never a visible step back.
        let all: Vec<f64> = map
            .levels
            .iter()
            .map(|level| lightness_of(*level))
            .collect();
        assert!(all.windows(2).all(|pair| pair[1] > pair[0] - 0.1));
    }

    #[test]
    fn shares_outside_the_range_take_the_ends() {
        let map = ColourMap::new();
        assert_eq!(map.at(-3.0), map.at(0.0));
        assert_eq!(map.at(f64::INFINITY), map.at(1.0));
        assert_eq!(map.at(f64::NAN), map.at(0.0));
    }
}
