//! How images are made: the table `[imaging]` of simulations, grounds and files of links.

use serde::{Deserialize, Serialize};

use super::keys::{Form, KeyEntry, Keyed, Keys, Number, Whole, WordChoice, Words};
use super::section::{Section, whole_of};

/// How much a pixel counts for a link.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Weights {
    /// The chord through the pixel (Siddon).
    Line,
    /// d^−½ inside an ellipse.
    Ellipse,
    /// One over the area of the smallest ellipse through the pixel.
    #[default]
    InverseArea,
}

/// How an image is found from the links.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Solver {
    /// Maximum a posteriori with an exponential covariance.
    Map,
    /// Tikhonov, the classical reference.
    Tikhonov,
    /// The large singular values alone, the other one.
    Tsvd,
    /// Non-negative total variation.
    Tv,
    /// Non-negative and sparse.
    Nn,
    /// Those who were found, drawn over what is left.
    Points,
    /// The one of the last three that predicts best.
    #[default]
    Auto,
}

/// When images are made while a sweep goes on.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub enum ImageTimes {
    /// After every lap. Persons are searched at the end of the sweep, in its last image.
    #[default]
    Lap,
    /// Also in between, whenever the last one is made and there are new samples. Persons are searched in each.
    Free,
}

/// What is believed of an image before it is measured.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Prior {
    /// Standard deviation of a pixel, dB/m.
    pub sigma_db_per_m: f64,
    /// Distance over which the covariance falls to 1/e, metres.
    pub correlation_length_m: f64,
}

/// How images are made.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Imaging {
    /// Columns of the image (west to east) and its rows (south to north); `None` for squares, so many along the longer
    /// side as images of any area have.
    pub pixels: Option<(usize, usize)>,
    /// The weight model.
    pub weights: Weights,
    /// Tuning width of the ellipses, metres.
    pub width_m: f64,
    /// The solver.
    pub solver: Solver,
    /// Size of the bins into which moving ends are sorted, metres.
    pub bin_m: f64,
    /// The prior of the image of changes.
    pub prior: Prior,
    /// The prior of the absolute image.
    pub structure_prior: Prior,
    /// Links under this length are dropped, metres.
    pub min_link_m: f64,
    /// Width of the rim in which no peak is looked for, metres.
    pub rim_m: f64,
    /// Smallest distance between two peaks, metres.
    pub peak_separation_m: f64,
    /// The most objects that are reported.
    pub peaks: usize,
    /// How many places where nobody stands may be found in an image of a change, on the mean.
    pub false_finds_per_image: f64,
    /// When images are made.
    pub every: ImageTimes,
}

impl WordChoice for ImageTimes {
    const WORDS: &'static [(&'static str, ImageTimes)] =
        &[("lap", ImageTimes::Lap), ("free", ImageTimes::Free)];
}

impl WordChoice for Weights {
    const WORDS: &'static [(&'static str, Weights)] = &[
        ("line", Weights::Line),
        ("ellipse", Weights::Ellipse),
        ("inverse-area", Weights::InverseArea),
    ];
}

impl WordChoice for Solver {
    const WORDS: &'static [(&'static str, Solver)] = &[
        ("map", Solver::Map),
        ("tikhonov", Solver::Tikhonov),
        ("tsvd", Solver::Tsvd),
        ("tv", Solver::Tv),
        ("nn", Solver::Nn),
        ("points", Solver::Points),
        ("auto", Solver::Auto),
    ];
}

/// How images are made by the ground station of a file of its own, which has nobody to wait for.
pub(super) struct GroundImaging<'a>(pub &'a mut Imaging);

impl Keyed for GroundImaging<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        self.0.declare(to, ImageTimes::Free);
    }
}

impl Keyed for Imaging {
    fn keys(&mut self, to: &mut dyn Keys) {
        self.declare(to, ImageTimes::Lap);
    }
}

impl Imaging {
    /// Declares the keys; `usual` is when images are made where the file does not say.
    fn declare(&mut self, to: &mut dyn Keys, usual: ImageTimes) {
        let Imaging {
            pixels,
            weights,
            width_m,
            solver,
            bin_m,
            prior,
            structure_prior,
            min_link_m,
            rim_m,
            peak_separation_m,
            peaks,
            false_finds_per_image,
            every,
        } = self;
        let means = "columns and rows of the image, 2 to 400 each";
        to.form(
            &mut Pixels { pixels },
            KeyEntry {
                name: "pixels",
                left_out: "squares, 40 along the longer side",
                means,
            },
        );
        let means = "how much a pixel counts for a link, with `solver` map, tikhonov and tsvd; the others know the width of a link";
        to.word(
            weights,
            Words {
                name: "weights",
                default: Weights::InverseArea.word(),
                means,
            },
        );
        let means = "tuning width of the ellipses";
        to.number(
            width_m,
            Number {
                name: "width_m",
                default: 0.3,
                allowed: 0.01..=10.0,
                means,
            },
        );
        let means = "how the image of a run is found from the links; with `auto` those before it are found with `map`";
        to.word(
            solver,
            Words {
                name: "solver",
                default: Solver::Auto.word(),
                means,
            },
        );
        let means = "size of the bins into which moving ends are sorted";
        to.number(
            bin_m,
            Number {
                name: "bin_m",
                default: 0.5,
                allowed: 0.05..=10.0,
                means,
            },
        );
        let left_out = "";
        let means = "what is believed of changes; only with `solver` map and auto";
        let mut table = PriorTable {
            prior,
            sigma_db_per_m: 0.45,
            correlation_length_m: 0.5,
        };
        to.table(
            &mut table,
            KeyEntry {
                name: "prior",
                left_out,
                means,
            },
        );
        let means = "what is believed of what stands; only with `solver` map and auto";
        let mut table = PriorTable {
            prior: structure_prior,
            sigma_db_per_m: 0.55,
            correlation_length_m: 1.0,
        };
        to.table(
            &mut table,
            KeyEntry {
                name: "structure_prior",
                left_out,
                means,
            },
        );
        let mut number = |value, name, default, means| {
            to.number(
                value,
                Number {
                    name,
                    default,
                    allowed: 0.0..=100.0,
                    means,
                },
            );
        };
        number(
            min_link_m,
            "min_link_m",
            3.0,
            "links under this length are dropped",
        );
        number(
            rim_m,
            "rim_m",
            1.5,
            "width of the rim in which no peak is looked for",
        );
        number(
            peak_separation_m,
            "peak_separation_m",
            3.0,
            "smallest distance between two peaks",
        );
        let means = "the most objects that are reported";
        to.whole(
            peaks,
            Whole {
                name: "peaks",
                default: 5,
                allowed: 1..=1000,
                means,
            },
        );
        let means =
            "how many places where nobody stands may be found in an image of a change, on the mean";
        to.number(
            false_finds_per_image,
            Number {
                name: "false_finds_per_image",
                default: 0.02,
                allowed: 1e-6..=1.0,
                means,
            },
        );
        let means = "when images are made: after every `lap`, with a search for persons at the end; or `free`, \
                     whenever the last one is made and there is something new, with a search in each";
        to.word(
            every,
            Words {
                name: "every",
                default: usual.word(),
                means,
            },
        );
    }
}

/// A table of a prior with its defaults.
struct PriorTable<'a> {
    prior: &'a mut Prior,
    sigma_db_per_m: f64,
    correlation_length_m: f64,
}

impl Keyed for PriorTable<'_> {
    fn keys(&mut self, to: &mut dyn Keys) {
        let Prior {
            sigma_db_per_m,
            correlation_length_m,
        } = &mut *self.prior;
        to.number(
            sigma_db_per_m,
            Number {
                name: "sigma_db_per_m",
                default: self.sigma_db_per_m,
                allowed: 0.001..=100.0,
                means: "standard deviation of a pixel",
            },
        );
        to.number(
            correlation_length_m,
            Number {
                name: "correlation_length_m",
                default: self.correlation_length_m,
                allowed: 0.01..=100.0,
                means: "distance over which the covariance falls to 1/e",
            },
        );
    }
}

/// The columns and rows of an image.
struct Pixels<'a> {
    pixels: &'a mut Option<(usize, usize)>,
}

impl Form for Pixels<'_> {
    fn to_toml(&self) -> Option<String> {
        self.pixels
            .map(|(columns, rows)| format!("[{columns}, {rows}]"))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        *self.pixels = read_pixels(section, key);
    }
}

fn read_pixels(section: &Section<'_>, key: &'static str) -> Option<(usize, usize)> {
    if !section.has(key) {
        return None;
    }
    let list = section.list(key).unwrap_or_default();
    let numbers: Vec<usize> = list
        .iter()
        .filter_map(|entry| whole_of(entry.get_ref()))
        .collect();
    match numbers[..] {
        [columns, rows]
            if list.len() == 2 && (2..=400).contains(&columns) && (2..=400).contains(&rows) =>
        {
            Some((columns, rows))
        }
        _ => {
            let allowed = "[columns, rows], each a whole number from 2 to 400, is allowed";
            section.refuse(key, "is no such pair", allowed);
            None
        }
    }
}
