//! What may be laid over a plot, in metres, and what the legend calls it.

use embedded_graphics::pixelcolor::Rgb888;
use tomoswarm_proto::VehicleId;

use super::colour::Theme;
use super::stroke::Pen;
use super::vehicle_colour::{place_of, rgb_at};
use crate::geom::{Point, Polygon, Rect, Vector};

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
    /// A true person: a circle with a dot in it.
    Circle {
        /// The middle.
        at: Point,
        /// The radius, metres; drawn with at least 4 pixels.
        radius_m: f64,
        /// Written beside the circle.
        label: Option<String>,
    },
    /// The way of a true person who walks.
    Walk {
        /// Its corners.
        points: Vec<Point>,
    },
    /// A found object.
    Cross {
        /// Where it was found.
        at: Point,
        /// Written beside the cross.
        label: Option<String>,
    },
    /// A person who was found.
    Find {
        /// Where.
        at: Point,
        /// Variance by x, covariance, variance by y of that, m²: the ellipse of 90 % is drawn.
        covariance_m2: [f64; 3],
        /// Written beside it.
        label: Option<String>,
    },
    /// The way a vehicle drove, named in the legend. Where tracks of several vehicles lie upon each other they are
    /// shown in turns.
    Track {
        /// Its places in order.
        points: Vec<Point>,
        /// Whose, which says the colour.
        vehicle: VehicleId,
    },
    /// A vehicle.
    Vehicle {
        /// Where it is.
        at: Point,
        /// Which one, which says the colour; its number is written beside the dot.
        vehicle: VehicleId,
    },
    /// A vehicle's home.
    Home {
        /// Where it is.
        at: Point,
        /// Whose, which says the colour; its number is written beside the mark.
        vehicle: VehicleId,
    },
    /// A place to look from.
    Viewpoint {
        /// Where it is.
        at: Point,
    },
    /// A direction, as a short line in both ways.
    Direction {
        /// The middle of the line.
        at: Point,
        /// Half of the line.
        half: Vector,
        /// What the legend calls such lines.
        meaning: &'static str,
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
            Overlay::Find { .. } => Mark::Find,
            Overlay::Track { vehicle, .. } => Mark::Track(Some(place_of(*vehicle))),
            Overlay::Vehicle { vehicle, .. } => Mark::Vehicle(Some(place_of(*vehicle))),
            Overlay::Home { vehicle, .. } => Mark::Home(Some(place_of(*vehicle))),
            Overlay::Viewpoint { .. } => Mark::Viewpoint,
            Overlay::Walk { .. } => Mark::Walk,
            Overlay::Direction { .. } => Mark::Direction,
            Overlay::Fence { .. } => Mark::Fence,
            Overlay::Area { .. } => Mark::Area,
        }
    }

    /// Returns what is written beside it in the plot.
    pub(super) fn label(&self) -> Option<String> {
        match self {
            Overlay::Outline { label, .. }
            | Overlay::Circle { label, .. }
            | Overlay::Cross { label, .. }
            | Overlay::Find { label, .. } => label.clone(),
            Overlay::Vehicle { vehicle, .. } | Overlay::Home { vehicle, .. } => {
                Some(vehicle.to_string())
            }
            Overlay::Track { .. }
            | Overlay::Walk { .. }
            | Overlay::Viewpoint { .. }
            | Overlay::Direction { .. }
            | Overlay::Fence { .. }
            | Overlay::Area { .. } => None,
        }
    }

    /// Returns the places that the plot should show, finite ones only.
    pub(super) fn places(&self) -> Vec<Point> {
        let places = match self {
            Overlay::Outline { polygon, .. } | Overlay::Fence { polygon } => {
                polygon.corners().to_vec()
            }
            Overlay::Circle { at, radius_m, .. } => disc_corners(*at, *radius_m),
            Overlay::Cross { at, .. }
            | Overlay::Find { at, .. }
            | Overlay::Vehicle { at, .. }
            | Overlay::Home { at, .. }
            | Overlay::Viewpoint { at } => vec![*at],
            // They lie within what they say something of.
            Overlay::Direction { .. } => Vec::new(),
            Overlay::Track { points, .. } | Overlay::Walk { points } => points.clone(),
            Overlay::Area { rect } => vec![rect.min, rect.max],
        };
        places
            .into_iter()
            .filter(|place| place.is_finite())
            .collect()
    }

    /// Returns whether anything of it can be drawn.
    pub(super) fn is_drawn(&self) -> bool {
        matches!(self, Overlay::Direction { .. }) || !self.places().is_empty()
    }

    /// Returns whether it is a mark at one place, and that lies outside of what is shown.
    pub(super) fn is_outside(&self, view: Rect) -> bool {
        match self {
            Overlay::Circle { at, .. }
            | Overlay::Cross { at, .. }
            | Overlay::Find { at, .. }
            | Overlay::Vehicle { at, .. }
            | Overlay::Home { at, .. }
            | Overlay::Viewpoint { at }
            | Overlay::Direction { at, .. } => !view.contains(*at),
            Overlay::Outline { .. }
            | Overlay::Fence { .. }
            | Overlay::Track { .. }
            | Overlay::Walk { .. }
            | Overlay::Area { .. } => false,
        }
    }

    /// Returns the mark that stands for it in the legend: one for the vehicles and one for the homes of all colours.
    pub(super) fn legend_mark(&self) -> Mark {
        match self.mark() {
            Mark::Vehicle(_) => Mark::Vehicle(None),
            Mark::Home(_) => Mark::Home(None),
            mark => mark,
        }
    }

    /// Returns what the legend calls it.
    pub(super) fn legend_text(&self) -> String {
        match self {
            Overlay::Outline { .. } => "true outline".to_string(),
            Overlay::Circle { .. } => "true person".to_string(),
            Overlay::Walk { .. } => "way of a true person".to_string(),
            Overlay::Cross { .. } => "strong place".to_string(),
            Overlay::Find { .. } => "found person, 90 % ellipse".to_string(),
            Overlay::Track { vehicle, .. } => format!("track of vehicle {vehicle}"),
            Overlay::Vehicle { .. } => "vehicle, in its colour".to_string(),
            Overlay::Home { .. } => "home, in its vehicle's colour".to_string(),
            Overlay::Viewpoint { .. } => "viewpoint".to_string(),
            Overlay::Direction { meaning, .. } => (*meaning).to_string(),
            Overlay::Fence { .. } => "fence".to_string(),
            Overlay::Area { .. } => "imaged area".to_string(),
        }
    }
}

fn disc_corners(at: Point, radius_m: f64) -> Vec<Point> {
    let Rect { min, max } = Rect { min: at, max: at }.shrunk(-radius_m.max(0.0));
    vec![min, max]
}

/// A sign, as drawn in the plot and in the legend, in the order in which they lie on each other. With a place in the
/// table of colours it is a vehicle's; without, it stands for all vehicles.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Mark {
    Area,
    Fence,
    Track(Option<usize>),
    Walk,
    Outline,
    Direction,
    Home(Option<usize>),
    Viewpoint,
    Vehicle(Option<usize>),
    Circle,
    Cross,
    Find,
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
        let colour_of = |place: Option<usize>| {
            place.map_or(theme.neutral, |place| {
                let [red, green, blue] = rgb_at(place);
                Rgb888::new(red, green, blue)
            })
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
            Mark::Track(vehicle) => pen(2.0, colour_of(vehicle)),
            Mark::Walk => Pen {
                dash_px: Some((5.0, 4.0)),
                ..pen(1.8, theme.truth)
            },
            Mark::Outline => pen(1.8, theme.truth),
            Mark::Direction => pen(1.6, theme.found),
            Mark::Home(vehicle) => pen(2.0, colour_of(vehicle)),
            Mark::Viewpoint => pen(9.0, theme.neutral),
            Mark::Vehicle(vehicle) => pen(9.0, colour_of(vehicle)),
            Mark::Circle => pen(1.8, theme.truth),
            Mark::Cross | Mark::Find => pen(2.2, theme.found),
        }
    }
}
