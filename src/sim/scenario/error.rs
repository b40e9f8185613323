//! Why a scenario cannot be run, and where in its files that is to be mended.

use tomoswarm_proto::VehicleId;

use crate::config::FileLine;
use crate::scene::SceneError;
use crate::sweep::SweepError;
use crate::tomo::TomoError;

/// Why a scenario cannot be run.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum ScenarioError {
    /// The scene cannot be built.
    #[error("scene: {0}")]
    Scene(#[from] SceneError),
    /// There is no room for the persons.
    #[error(
        "random_persons: no room for person {number} of {count} within the rules of [random_persons]; fewer persons or smaller \
         distances are needed"
    )]
    NoRoom {
        /// Where the rules stand.
        line: FileLine,
        /// Which one.
        number: usize,
        /// Of how many.
        count: usize,
    },
    /// Somebody cannot walk where the file says.
    #[error("person[{index}].path_m: person {name} walks at ({:.2}, {:.2}) m {reason}", at.0, at.1)]
    Walk {
        /// Where the walk stands.
        line: Option<FileLine>,
        /// Which one of the persons of the file, from 0.
        index: usize,
        /// Who.
        name: String,
        /// Where, metres.
        at: (f64, f64),
        /// Why not, and what was expected.
        reason: String,
    },
    /// A vehicle starts inside something, or where wind carries it into something.
    #[error(
        "homes_m: vehicle {vehicle} starts {clearance_m:.2} m from an object; \
         more than its radius of {radius_m} m is needed{}",
        carried(*carried_m)
    )]
    StartsInside {
        /// Where its home stands.
        line: Option<FileLine>,
        /// Which one.
        vehicle: VehicleId,
        /// Distance from its middle to the object, metres.
        clearance_m: f64,
        /// Its radius, metres.
        radius_m: f64,
        /// How far wind carries it, metres.
        carried_m: f64,
    },
    /// The ring cannot be laid around the area.
    #[error("sweep: {0}")]
    Sweep(#[from] SweepError),
    /// The image cannot be made.
    #[error("imaging: {0}")]
    Image(#[from] TomoError),
    /// A vehicle cannot be put into the world.
    #[error("vehicle {vehicle}: {reason}")]
    Body {
        /// Which one.
        vehicle: VehicleId,
        /// Why.
        reason: String,
    },
}

/// Returns what is needed beside the radius where wind carries a vehicle.
fn carried(carried_m: f64) -> String {
    match carried_m > 0.0 {
        true => format!(", and the {carried_m:.2} m by which wind carries it"),
        false => String::new(),
    }
}

impl ScenarioError {
    /// Returns the line of a file in which it is to be mended; `None` when no single one is known.
    pub fn line(&self) -> Option<&FileLine> {
        match self {
            ScenarioError::NoRoom { line, .. } => Some(line),
            ScenarioError::Walk { line, .. } | ScenarioError::StartsInside { line, .. } => {
                line.as_ref()
            }
            ScenarioError::Scene(_)
            | ScenarioError::Sweep(_)
            | ScenarioError::Image(_)
            | ScenarioError::Body { .. } => None,
        }
    }
}
