//! `[[object]]`: a body with an upright outline that a scene file adds to its shapes.

use super::super::forms::{MaybePlace, Name, places};
use super::super::keys::{Form, KeyEntry, Keyed, Keys, Number, NumberBounds};
use super::super::outline::{CORNERS, simple_polygon};
use super::super::section::Section;
use super::{MaterialSpec, MaterialTable};
use crate::geom::{Point, Polygon};

/// The footprint of an upright body.
#[derive(Clone, PartialEq, Debug)]
pub enum Outline {
    /// A simple polygon, convex or not, local frame.
    Polygon(Polygon),
    /// A circle, local frame.
    Circle {
        /// The middle.
        centre: Point,
        /// The radius, metres.
        radius_m: f64,
    },
}

impl Default for Outline {
    fn default() -> Outline {
        Outline::Polygon(Polygon::new(Vec::new()))
    }
}

/// An upright body with a constant footprint.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Object {
    /// A plain name.
    pub name: String,
    /// The footprint.
    pub outline: Outline,
    /// Height of the underside, metres above z = 0.
    pub bottom_m: f64,
    /// Height of the top, metres above z = 0.
    pub top_m: f64,
    /// What it does to radio.
    pub material: MaterialSpec,
}

impl Object {
    pub(super) fn keys(&mut self, index: usize, to: &mut dyn Keys) {
        let Object {
            name,
            outline,
            bottom_m,
            top_m,
            material,
        } = self;
        let mut plain = Name {
            name,
            default: format!("object-{}", index + 1),
        };
        let left_out = "object-N";
        to.form(
            &mut plain,
            KeyEntry {
                name: "name",
                left_out,
                means: "a plain name",
            },
        );
        outline.keys(to);
        let mut number = |value, name, default, means| {
            to.number(
                value,
                Number {
                    name,
                    default,
                    allowed: -10.0..=500.0,
                    means,
                },
            );
        };
        number(
            bottom_m,
            "bottom_m",
            0.0,
            "height of the underside above z = 0",
        );
        number(top_m, "top_m", 2.5, "height of the top");
        MaterialTable {
            material,
            default: MaterialSpec::SOLID,
        }
        .keys(to);
    }
}

impl Keyed for Outline {
    /// Shows the keys of both footprints: which of them stand in a file says which it is.
    fn keys(&mut self, to: &mut dyn Keys) {
        let (mut centre, mut radius) = match self {
            Outline::Polygon(_) => (None, None),
            Outline::Circle { centre, radius_m } => (Some(*centre), Some(*radius_m)),
        };
        let (left_out, means) = ("", "middle of a circle, `[x, y]`");
        to.form(
            &mut MaybePlace(&mut centre),
            KeyEntry {
                name: "centre_m",
                left_out,
                means,
            },
        );
        let (allowed, means) = (0.01..=500.0, "radius of a circle");
        to.maybe_number(
            &mut radius,
            NumberBounds {
                name: "radius_m",
                left_out: "none",
                allowed,
                means,
            },
        );
        if let (Some(centre), Some(radius_m)) = (centre, radius) {
            *self = Outline::Circle { centre, radius_m };
        }
        let means = "3 to 500 corners around a simple outline, convex or not";
        to.form(
            &mut Footprint(self),
            KeyEntry {
                name: "outline_m",
                left_out: "",
                means,
            },
        );
    }
}

/// The corners of an outline, if it is no circle.
struct Footprint<'a>(&'a mut Outline);

impl Form for Footprint<'_> {
    fn to_toml(&self) -> Option<String> {
        match &*self.0 {
            Outline::Polygon(polygon) => Some(places(polygon.corners())),
            Outline::Circle { .. } => None,
        }
    }

    fn read(&mut self, section: &Section<'_>, key: &'static str) {
        if section.has("centre_m") || section.has("radius_m") {
            section.require("centre_m", "a place [x, y] in metres is needed");
            section.require("radius_m", "a number from 0.01 to 500 is allowed");
            if section.has(key) {
                let allowed = "give outline_m, or centre_m and radius_m";
                section.refuse(key, "stands beside a circle", allowed);
            }
            return;
        }
        let corners = section.required_points(key, CORNERS);
        if corners.is_empty() {
            return;
        }
        *self.0 = Outline::Polygon(simple_polygon(corners).unwrap_or_else(|wrong| {
            section.refuse(
                key,
                &wrong,
                "corners in order around a simple outline are needed",
            );
            Polygon::new(Vec::new())
        }));
    }
}
