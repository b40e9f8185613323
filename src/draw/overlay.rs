//! What may be laid over a plot, in metres, and what the legend calls it.

use crate::geom::{Point, Polygon, Rect};

use super::colour::Theme;
use super::stroke::Pen;
use embedded_graphics::pixelcolor::Rgb888;

/// Something laid over a plot. Places are local-frame metres; parts outside the plot, and places that are not finite,
/// are not drawn. A label is left out when no free place is found near its mark.
#[derive(Clone, PartialEq, Debug)]
pub enum Overlay {
    /// The true border of a wall or another object.
    Outline {
        /// Its corners.
        polygon: Polygon,
        /// Written beside its longest edge.
        label: Option<String>,
    },
    /// A true person.
    Circle {
        /// The middle.
        at: Point,
        /// The radius, metres; drawn with at least 4 pixels.
        radius_m: f64,
        /// Written beside the circle.
        label: Option<String>,
    },
    /// A found object.
    Cross {
        /// Where it was found.
        at: Point,
        /// Written beside the cross.
        label: Option<String>,
    },
    /// The way a vehicle drove.
    Track {
        /// Its places in order.
        points: Vec<Point>,
        /// Index of the colour; eight colours, then again from the first.
        colour: usize,
        /// The vehicle's name, shown in the legend.
        label: Option<String>,
    },
    /// A vehicle.
    Dot {
        /// Where it is.
        at: Point,
        /// Written beside the dot.
        label: Option<String>,
    },
    /// A vehicle's home.
    Home {
        /// Where it is.
        at: Point,
        /// Written beside the mark.
        label: Option<String>,
    },
    /// The fence that vehicles must not cross.
    Fence {
        /// Its corners.
        polygon: Polygon,
    },
    /// The border of the imaged area.
    Area {
        /// The area.
        rect: Rect,
    },
}

impl Overlay {
    /// Returns the mark that shows it.
    pub(super) fn mark(&self) -> Mark {
        match self {
            Overlay::Outline { .. } => Mark::Outline,
            Overlay::Circle { .. } => Mark::Circle,
            Overlay::Cross { .. } => Mark::Cross,
            Overlay::Track { colour, .. } => Mark::Track { colour: colour % 8 },
            Overlay::Dot { .. } => Mark::Dot,
            Overlay::Home { .. } => Mark::Home,
            Overlay::Fence { .. } => Mark::Fence,
            Overlay::Area { .. } => Mark::Area,
        }
    }

    /// Returns what is written beside it in the plot.
    pub(super) fn label(&self) -> Option<&str> {
        match self {
            Overlay::Outline { label, .. }
            | Overlay::Circle { label, .. }
            | Overlay::Cross { label, .. }
            | Overlay::Dot { label, .. }
            | Overlay::Home { label, .. } => label.as_deref(),
            Overlay::Track { .. } | Overlay::Fence { .. } | Overlay::Area { .. } => None,
        }
    }

    /// Returns the places that the plot should show, finite ones only.
    pub(super) fn places(&self) -> Vec<Point> {
        let places = match self {
            Overlay::Outline { polygon, .. } | Overlay::Fence { polygon } => {
                polygon.corners().to_vec()
            }
            Overlay::Circle { at, radius_m, .. } => disc_corners(*at, *radius_m),
            Overlay::Cross { at, .. } | Overlay::Dot { at, .. } | Overlay::Home { at, .. } => {
                vec![*at]
            }
            Overlay::Track { points, .. } => points.clone(),
            Overlay::Area { rect } => vec![rect.min, rect.max],
        };
        places
            .into_iter()
            .filter(|place| place.is_finite())
            .collect()
    }

    /// Returns what the legend calls it.
    pub(super) fn legend_text(&self) -> String {
        match self {
            Overlay::Outline { .. } => "true outline".to_string(),
            Overlay::Circle { .. } => "true person".to_string(),
            Overlay::Cross { .. } => "found object".to_string(),
            Overlay::Track {
                label: Some(name), ..
            } => format!("track of {name}"),
            Overlay::Track { label: None, .. } => "vehicle track".to_string(),
            Overlay::Dot { .. } => "vehicle".to_string(),
            Overlay::Home { .. } => "home".to_string(),
            Overlay::Fence { .. } => "fence".to_string(),
            Overlay::Area { .. } => "imaged area".to_string(),
        }
    }
}

fn disc_corners(at: Point, radius_m: f64) -> Vec<Point> {
    let Rect { min, max } = Rect { min: at, max: at }.shrunk(-radius_m.max(0.0));
    vec![min, max]
}

/// A sign, as drawn in the plot and in the legend, in the order in which they lie on each other.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Mark {
    Area,
    Fence,
    Track { colour: usize },
    Outline,
    Home,
    Dot,
    Circle,
    Cross,
}

impl Mark {
    /// Returns the pen it is drawn with.
    pub(super) fn pen(self, theme: &Theme) -> Pen {
        let pen = |width_px: f64, colour: Rgb888| Pen {
            width_px,
            colour,
            opacity: 1.0,
            dash_px: None,
        };
        match self {
            Mark::Area => Pen {
                dash_px: Some((2.0, 4.0)),
                ..pen(1.4, theme.border)
            },
            Mark::Fence => Pen {
                dash_px: Some((9.0, 5.0)),
                ..pen(1.6, theme.border)
            },
            Mark::Track { colour } => Pen {
                opacity: 0.8,
                ..pen(1.6, theme.tracks[colour % theme.tracks.len()])
            },
            Mark::Outline => pen(1.8, theme.truth),
            Mark::Home => pen(1.6, theme.vehicle),
            Mark::Dot => pen(9.0, theme.vehicle),
            Mark::Circle => pen(1.8, theme.truth),
            Mark::Cross => pen(2.2, theme.found),
        }
    }
}
