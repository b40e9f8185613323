//! The table `[pose]` of a vehicle's file: who says where it is, and how well. How the speed is judged by it is not known here.

use super::keys::{Form, KeyEntry, Keyed, Keys, Number, quoted};
use super::section::Section;

/// How well a vehicle knows its place.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct PoseFile {
    /// The deviation that its place usually has, metres; its speed is judged by it.
    pub expected_sd_m: f64,
}

impl Keyed for PoseFile {
    fn keys(&mut self, to: &mut dyn Keys) {
        let PoseFile { expected_sd_m } = self;
        let means = "who says where it is; today only `\"autopilot\"`";
        to.form(
            &mut PoseSource,
            KeyEntry {
                name: "source",
                left_out: "autopilot",
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

/// Who says where a vehicle is: the autopilot, until others are built.
struct PoseSource;

impl Form for PoseSource {
    fn to_toml(&self) -> Option<String> {
        Some(quoted("autopilot"))
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        let allowed = "source = \"autopilot\" is allowed today";
        match section.text(key).as_deref() {
            None | Some("autopilot") => {}
            Some("external") => section.refuse(key, "is not built yet", allowed),
            Some(_) => section.refuse(key, "is not known", allowed),
        }
    }
}
