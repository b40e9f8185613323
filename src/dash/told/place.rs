//! What holds for the whole connection of a page: what is shown, where, and what truly stands there.

use serde::Serialize;

use super::At;
use crate::config::DeclaredKey;

/// What a page shows: how the time that it shows came about.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "UPPERCASE")]
#[cfg_attr(test, derive(ts_rs::TS))]
pub enum Showing {
    /// The swarm as it is.
    Live,
    /// A simulation.
    Simulation,
    /// A recording.
    Replay,
}

told! {
    /// What holds for the whole connection of any page.
    pub struct Place {
        /// What is shown.
        pub showing: Showing,
        /// The name of the venue.
        pub venue: String,
        /// The side of a cell of the map, metres.
        pub cell_m: f64,
        /// The borders between slices of altitude, metres, ascending.
        pub slices_m: Vec<f64>,
        /// The bearing of the x axis, degrees from north clockwise.
        #[serde(rename = "xAxis_deg")]
        pub x_axis_deg: f64,
        /// The corners of the area with the least and with the greatest x and y.
        pub area: [At; 2],
        /// The corners of the fence.
        pub fence: Vec<At>,
        /// Where vehicles are at home, by their numbers.
        pub homes: Vec<At>,
        /// The words for modes, by the numbers that records have.
        pub modes: Vec<&'static str>,
        /// The words for why a vehicle stands, by the numbers that records have.
        #[serde(rename = "standsUnder")]
        pub stands_under: Vec<&'static str>,
        /// The colours of the first vehicles: red, green, blue.
        #[serde(rename = "vehicleColours")]
        pub vehicle_colours: Vec<[u8; 3]>,
        /// The colours of images, from nothing to the most.
        pub heat: Vec<[u8; 3]>,
        /// The missions that can be begun.
        pub missions: Vec<DeclaredMission>,
        /// What truly stands in a simulation.
        pub truth: Option<Truth>,
        /// Where the range sensors of simulated vehicles look.
        pub sensors: Option<Sensors>,
        /// Another run that is shown beside this one.
        pub ghost: Option<GhostAbout>,
    }

    /// The first text of a connection.
    pub struct Welcome {
        /// What holds for any page.
        #[serde(flatten)]
        pub place: Place,
        /// Its number.
        pub page: u32,
        /// Whether its token may order.
        #[serde(rename = "mayOrder")]
        pub may_order: bool,
        /// How many tiles of the map there are.
        pub tiles: usize,
        /// Of which subjects there is an image.
        pub images: Vec<i64>,
    }

    /// A kind of mission.
    pub struct DeclaredMission {
        /// The word for it.
        pub kind: &'static str,
        /// Its keys.
        pub keys: Vec<DeclaredKey>,
    }

    /// What truly stands in the scene of a simulation.
    pub struct Truth {
        /// Corners of what stands there at the height of the antennas, and of holes in it.
        pub outlines: Vec<Vec<At>>,
        /// Who stands there.
        pub persons: Vec<TruePerson>,
    }

    /// A person of a simulation.
    pub struct TruePerson {
        /// Its name.
        pub name: String,
        /// Where it stands.
        pub at: At,
        /// Its radius, metres.
        pub radius_m: f64,
    }

    /// Where the range sensors of simulated vehicles look, and how far.
    pub struct Sensors {
        /// The directions of the beams, radians from where the vehicle faces.
        pub beams_rad: Vec<f64>,
        /// Half of the angle of a beam, radians.
        pub half_angle_rad: f64,
        /// How far a beam hears, metres.
        pub max_range_m: f64,
        /// How high the sensors are, metres.
        pub height_m: f64,
    }

    /// Another run that is shown beside this one.
    pub struct GhostAbout {
        /// Its name.
        pub name: String,
        /// Its vehicles.
        pub vehicles: Vec<u8>,
    }
}
