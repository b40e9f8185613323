//! The table `[pose]` of a vehicle's file: who says where it is, and how well. How the speed is judged by it is not known here.

use super::keys::{Keyed, Keys, Number, WordChoice, Words};

/// How well a vehicle knows its place.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct PoseFile {
    /// Who says where it is.
    pub source: PoseSource,
    /// The deviation that its place usually has, metres; its speed is judged by it.
    pub expected_sd_m: f64,
}

impl Keyed for PoseFile {
    fn keys(&mut self, to: &mut dyn Keys) {
        let PoseFile {
            source,
            expected_sd_m,
        } = self;
        let means = "who measures where it is: `autopilot`, all by itself, or with it something outside, `external` (`tomoswarm fix`)";
        to.word(
            source,
            Words {
                name: "source",
                default: "autopilot",
                means,
            },
        );
        to.number(
            expected_sd_m,
            Number {
                name: "expected_sd_m",
                default: 0.05,
                allowed: 0.0..=5.0,
                means: "deviation that the place usually has; the speed is judged by it",
            },
        );
    }
}

/// Who says where a vehicle is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum PoseSource {
    /// Its autopilot, by what it measures itself.
    #[default]
    Autopilot,
    /// Its autopilot, from what something outside measures: motion capture, ultra-wideband.
    External,
}

impl WordChoice for PoseSource {
    const WORDS: &'static [(&'static str, PoseSource)] = &[
        ("autopilot", PoseSource::Autopilot),
        ("external", PoseSource::External),
    ];
}
